//! What is left without the room's planes, in pieces that do not touch each other.

use super::planes::Plane;
use super::{Room, place};
use glam::{IVec3, Vec3};
use hingecast_articulate::DepthView;
use hingecast_articulate::observe::lattice::Lattice;
use hingecast_articulate::observe::witness::{Witness, counted};
use rayon::prelude::*;
use std::collections::BTreeMap;

/// Pixels, over all views and states, that make a cell count.
const PIXELS: u16 = 3;
/// Pieces hang together by cells with at least this share of the pixels that the middle one of the
/// cells has: between things that stand close, a few pixels that fly fill a cell here and there.
const FIRM: f64 = 0.2;
/// Cells around firm ones that go with them: so many rounds.
const ROUNDS: usize = 2;
/// Of the views that look at a cell close to a wall, the share whose pixels must lie in it, and how close
/// that is, tolerances of the wall.
const SEEN: f64 = 0.25;
const CLOSE: f32 = 4.0;
/// Cells farther apart than this, along an axis, do not touch.
const TOUCH: i32 = 2;
/// Pieces with at least this share of the moved samples of the largest belong to the object.
const ALSO: f64 = 0.25;
/// Pieces with at least this share are named.
const NAMED: f64 = 0.05;
/// A place that a person names is at most so many cells from the thing that is meant.
const NAMED_PLACE: i32 = 4;
/// Beyond this share of z, times pixels, a neighbour lies on another surface.
const JUMP: f32 = 4.0;

/// Cells with something in them that is not the room's.
pub(super) struct Pieces {
    pub lattice: Lattice,
    counts: Vec<u16>,
    /// Of every state: cells with enough pixels of its own.
    pub states: Vec<Vec<usize>>,
}

/// The cells of the object.
pub(super) struct Object {
    pub lattice: Lattice,
    pub cells: Vec<bool>,
}

impl Pieces {
    pub fn new(lattice: Lattice) -> Self {
        Self { lattice, counts: vec![0; lattice.len()], states: Vec::new() }
    }

    /// Counts the pixels of a state's views in cells that most of its views see surface in; not
    /// those between two surfaces, which time-of-flight cameras make.
    pub fn add(&mut self, views: &[DepthView], supports: &[Plane]) {
        let witnesses = Witness::some(views, super::ACROSS);
        // Pixels, and the witnesses whose pixels these are.
        let mut own: BTreeMap<usize, (u16, u32)> = BTreeMap::new();
        for (k, view) in views.iter().enumerate() {
            let world_from_camera = view.camera.camera_from_world.inverse();
            let (rot, trans) = (world_from_camera.mat3().as_mat3(), world_from_camera.trans.as_vec3());
            let witness = Witness::which(k, views.len()).map_or(0, |bit| 1 << bit);
            for i in 0..view.depth.len() {
                let Some(x) = place(view, &rot, trans, i).filter(|_| !flies(view, i, view.camera.width)) else {
                    continue;
                };
                if supports.iter().any(|p| p.holds(x, view.depth[i])) {
                    continue;
                }
                if let Some(c) = self.lattice.index(x) {
                    let (count, seen_by) = own.entry(c).or_default();
                    (*count, *seen_by) = (count.saturating_add(1), *seen_by | witness);
                }
            }
        }
        let believed = own.into_par_iter().filter(|(c, (_, seen_by))| {
            let middle = self.lattice.centre(self.lattice.coords(*c));
            let (through, on) = counted(&witnesses, middle, self.lattice.voxel);
            // What one camera alone has a little in front of a wall is a camera's error.
            let seen = f64::from(seen_by.count_ones()) >= SEEN * (on + through) as f64;
            on >= through && (seen || supports.iter().all(|p| p.height(middle) > CLOSE * p.widest()))
        });
        let mut of_state = Vec::new();
        for (c, (count, _)) in believed.collect::<Vec<_>>() {
            self.counts[c] = self.counts[c].saturating_add(count);
            if count >= PIXELS {
                of_state.push(c);
            }
        }
        self.states.push(of_state);
    }

    /// Whether the middle of a cell is in a box.
    pub fn in_box(&self, i: usize, lo: Vec3, hi: Vec3) -> bool {
        let middle = self.lattice.centre(self.lattice.coords(i));
        middle.cmpge(lo).all() && middle.cmple(hi).all()
    }

    /// Everything in a box that is not the room's; `None` where nothing is.
    pub fn inside(&self, lo: Vec3, hi: Vec3) -> Option<Object> {
        let own = |i: usize| self.counts[i] > 0 && self.in_box(i, lo, hi);
        let cells: Vec<bool> = (0..self.counts.len()).map(own).collect();
        cells.contains(&true).then_some(Object { lattice: self.lattice, cells })
    }

    /// The piece at a place, or nearest to it within a few cells.
    pub fn at(&self, x: Vec3) -> Option<Object> {
        let (piece, count) = self.pieces();
        let at = self.lattice.cell(x);
        let away = |i: &usize| (self.lattice.coords(*i) - at).length_squared();
        let near = (0..piece.len()).filter(|i| piece[*i] > 0).min_by_key(away)?;
        if away(&near) > NAMED_PLACE * NAMED_PLACE {
            return None;
        }
        let own: Vec<bool> = (0..=count).map(|p| p == piece[near]).collect();
        Some(self.grown(&piece, &own))
    }

    /// The pieces that moved surface is on, and the share of moved surface that is on them.
    pub fn object(&self, room: &Room, doubts: &mut Vec<String>) -> (Object, f64) {
        let (piece, count) = self.pieces();
        let mut moved = vec![0usize; count as usize + 1];
        for (cloud, m) in room.clouds.iter().zip(&room.moved) {
            for (x, _) in cloud.points.iter().zip(m).filter(|(_, m)| **m) {
                if let Some(i) = self.lattice.index(*x) {
                    moved[piece[i] as usize] += 1;
                }
            }
        }
        let all: usize = moved.iter().sum();
        moved[0] = 0;
        let most = moved.iter().copied().max().unwrap_or(0) as f64;
        let own: Vec<bool> = moved.iter().map(|m| *m > 0 && *m as f64 >= ALSO * most).collect();
        let others = moved.iter().zip(&own).filter(|(m, own)| !**own && **m as f64 >= NAMED * most).count();
        if others > 0 {
            doubts.push(format!("{others} other thing(s) moved apart from the object and were left out"));
        }
        let together = own.iter().filter(|o| **o).count();
        if together > 1 {
            doubts.push(format!("the object is in {together} pieces that do not touch"));
        }
        let on: usize = moved.iter().zip(&own).filter(|(_, own)| **own).map(|(m, _)| m).sum();
        (self.grown(&piece, &own), on as f64 / all.max(1) as f64)
    }

    /// Pixels that make a cell hold a piece together.
    fn firm(&self) -> u16 {
        let mut full: Vec<u16> = self.counts.iter().copied().filter(|c| *c >= PIXELS).collect();
        let middle = full.len() / 2;
        if full.is_empty() {
            return PIXELS;
        }
        let median = *full.select_nth_unstable(middle).1;
        PIXELS.max((FIRM * f64::from(median)).round() as u16)
    }

    /// The piece of every cell, from 1, 0 where nothing is; and how many there are.
    pub fn pieces(&self) -> (Vec<u32>, u32) {
        let firm = self.firm();
        let (mut piece, count) = joined(&self.lattice, TOUCH, |i| self.counts[i] >= firm);
        // Cells that few pixels hit - a door seen slantwise - go with those around them.
        for _ in 0..ROUNDS {
            let joins = |i: usize| {
                let free = piece[i] == 0 && self.counts[i] > 0;
                free.then(|| around(&self.lattice, i, 1).map(|j| piece[j]).filter(|p| *p > 0).min()).flatten()
            };
            let joined: Vec<(usize, u32)> = (0..piece.len()).filter_map(|i| Some((i, joins(i)?))).collect();
            joined.into_iter().for_each(|(i, p)| piece[i] = p);
        }
        (piece, count)
    }

    /// The cells of some pieces.
    fn grown(&self, piece: &[u32], own: &[bool]) -> Object {
        let cells = piece.iter().map(|p| own[*p as usize]).collect();
        Object { lattice: self.lattice, cells }
    }
}

/// The piece of every cell that is `full`, from 1, and 0 elsewhere; and how many there are. Cells at most
/// `touch` apart along every axis hang together.
pub(super) fn joined(lattice: &Lattice, touch: i32, full: impl Fn(usize) -> bool) -> (Vec<u32>, u32) {
    let mut piece = vec![0u32; lattice.len()];
    let mut count = 0;
    for start in 0..piece.len() {
        if piece[start] > 0 || !full(start) {
            continue;
        }
        count += 1;
        piece[start] = count;
        let mut open = vec![start];
        while let Some(i) = open.pop() {
            for j in around(lattice, i, touch) {
                if piece[j] == 0 && full(j) {
                    piece[j] = count;
                    open.push(j);
                }
            }
        }
    }
    (piece, count)
}

/// Cells at most `reach` away along every axis, in order.
fn around(lattice: &Lattice, i: usize, reach: i32) -> impl Iterator<Item = usize> + '_ {
    let (at, n) = (lattice.coords(i), 2 * reach + 1);
    let offsets = (0..n * n * n).map(move |k| IVec3::new(k % n, k / n % n, k / (n * n)) - reach);
    offsets.filter_map(move |o| lattice.index_of(at + o))
}

/// Whether a pixel hangs between the surfaces beside it.
pub(super) fn flies(view: &DepthView, i: usize, w: usize) -> bool {
    let z = view.depth[i];
    let jump = JUMP / view.camera.fx as f32 * z * 2.0;
    let off = |j: Option<usize>| {
        let j = j.filter(|&j| j < view.depth.len() && view.class[j] == hingecast_articulate::OBJECT);
        j.is_some_and(|j| (view.depth[j] - z).abs() > jump)
    };
    let across = off((!i.is_multiple_of(w)).then(|| i - 1)) && off((i % w + 1 < w).then_some(i + 1));
    let along = off(i.checked_sub(w)) && off(Some(i + w));
    across || along
}

impl Object {
    pub fn has(&self, x: Vec3) -> bool {
        self.lattice.index(x).is_some_and(|i| self.cells[i])
    }

    /// Lowest and highest corner.
    pub fn bounds(&self) -> (Vec3, Vec3) {
        let (mut lo, mut hi) = (Vec3::INFINITY, Vec3::NEG_INFINITY);
        for i in (0..self.cells.len()).filter(|&i| self.cells[i]) {
            let at = self.lattice.coords(i).as_vec3();
            lo = lo.min(self.lattice.lo + at * self.lattice.voxel);
            hi = hi.max(self.lattice.lo + (at + Vec3::ONE) * self.lattice.voxel);
        }
        debug_assert!(self.lattice.cell(lo).min_element() >= 0 || !lo.is_finite());
        (lo, hi)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Two slabs, four cells apart, with cells between them that a few flying pixels hit.
    #[test]
    fn few_pixels_between_two_things_do_not_join_them() {
        let mut pieces = Pieces::new(Lattice::new(Vec3::ZERO, Vec3::ONE, 20));
        let lattice = pieces.lattice;
        let at = |x: i32, y: i32, z: i32| lattice.index_of(IVec3::new(x, y, z)).unwrap();
        for (y, z) in (4..16).flat_map(|y| (4..16).map(move |z| (y, z))) {
            for x in [5, 6, 11, 12] {
                pieces.counts[at(x, y, z)] = 40;
            }
        }
        let between: Vec<usize> = (7..11).map(|x| at(x, 9, 9)).collect();
        between.iter().for_each(|i| pieces.counts[*i] = PIXELS + 1);
        assert_eq!(pieces.lattice.coords(at(11, 4, 5)), IVec3::new(11, 4, 5));
        let (piece, count) = pieces.pieces();
        assert_eq!(count, 2);
        let (left, right) = (piece[at(5, 9, 9)], piece[at(12, 9, 9)]);
        assert!(left > 0 && right > 0 && left != right);
        // What hangs between goes with what it is next to.
        let of: Vec<u32> = between.iter().map(|i| piece[*i]).collect();
        assert_eq!(of, [left, left, right, right]);
        // Many pixels do join: a bar is a bar.
        between.iter().for_each(|i| pieces.counts[*i] = 40);
        assert_eq!(pieces.pieces().1, 1);
    }
}
