//! Signed distance of one part, fused in the canonical frame from the depth of all states.
//!
//! Truncated signed distance in the way of Curless and Levoy 1996 on blocks of 8^3 voxels near the
//! part's own surface. Three things differ from the usual: a pixel of another part still says that
//! the ray up to it is empty; a background pixel empties its whole ray; and what no ray ever
//! reached counts as solid, so that closed things come out closed and have a volume. Units: scene
//! units; frame: canonical world.

use crate::field::{Field, TRUNCATION};
use crate::{BACKGROUND, Observation, UNKNOWN};
use glam::Vec3;
use hingecast_geom::{Cancelled, Pose};
use rayon::prelude::*;
use std::collections::BTreeMap;
use std::sync::atomic::{AtomicU32, Ordering};

/// Voxels per block edge.
const B: i32 = 8;
pub(crate) const BLOCK: usize = (B * B * B) as usize;
/// Unit in which a block counts the area that pixels stand for: this many are a voxel's face.
pub(crate) const COVER_UNIT: f32 = 256.0;
/// A block needs this many surface pixels: single flying pixels at depth edges open no block.
const MIN_HITS: u32 = 3;
/// Rays that must agree before space without any surface counts as empty.
const MIN_EMPTY: u16 = 2;

pub(crate) type Key = [i32; 3];

/// Blocks near the surface of one part, with the running average in them.
pub struct PartVolume {
    /// Edge of a voxel, scene units.
    pub voxel: f32,
    truncation: f32,
    hits: BTreeMap<Key, u32>,
    pub(crate) blocks: Vec<Block>,
    /// Blocks in the bounding box that hold no surface: only asked whether a ray crossed them.
    hollow: Vec<(Key, u16)>,
    lo: Key,
    hi: Key,
}

pub(crate) struct Block {
    pub(crate) key: Key,
    sum: Vec<f32>,
    pub(crate) weight: Vec<f32>,
    /// Surface pixels that fell into each voxel, and the area that they stand for in units of 1 /
    /// [`COVER_UNIT`] of the voxel's face.
    pub(crate) hits: Vec<AtomicU32>,
    pub(crate) cover: Vec<AtomicU32>,
}

impl Block {
    fn new(key: Key) -> Self {
        let zeros = || (0..BLOCK).map(|_| AtomicU32::new(0)).collect();
        Self { key, sum: vec![0.0; BLOCK], weight: vec![0.0; BLOCK], hits: zeros(), cover: zeros() }
    }
}

impl PartVolume {
    /// Nothing seen yet; `voxel` is the edge of a voxel, scene units.
    pub fn new(voxel: f32) -> Self {
        Self {
            voxel,
            truncation: TRUNCATION * voxel,
            hits: BTreeMap::new(),
            blocks: Vec::new(),
            hollow: Vec::new(),
            lo: [0; 3],
            hi: [-1; 3],
        }
    }

    fn block_size(&self) -> f32 {
        self.voxel * B as f32
    }

    /// First pass: notes which blocks this part's surface comes near in `seen`.
    pub fn mark(&mut self, seen: &Observation, part: u8, canonical_from_world: &Pose) {
        let canonical_from_camera = *canonical_from_world * seen.camera.camera_from_world.inverse();
        let (w, size, reach) = (seen.camera.width, self.block_size(), self.truncation);
        for (i, &label) in seen.labels.iter().enumerate() {
            let depth = seen.depth[i];
            // Every other pixel, as on a chessboard: blocks are many pixels wide.
            if label != part || !(depth > 0.0) || (i % w + i / w) % 2 == 1 {
                continue;
            }
            let x = canonical_from_camera.apply(seen.camera_point(i)).as_vec3();
            let (lo, hi) = ((x - reach) / size, (x + reach) / size);
            for bz in lo.z.floor() as i32..=hi.z.floor() as i32 {
                for by in lo.y.floor() as i32..=hi.y.floor() as i32 {
                    for bx in lo.x.floor() as i32..=hi.x.floor() as i32 {
                        *self.hits.entry([bz, by, bx]).or_default() += 1;
                    }
                }
            }
        }
    }

    /// Ends the first pass: allocates the blocks. False when the part was never seen.
    pub fn allocate(&mut self) -> bool {
        let hits = std::mem::take(&mut self.hits);
        let keys: Vec<Key> = hits.into_iter().filter(|(_, n)| *n >= MIN_HITS).map(|(k, _)| k).collect();
        let Some(first) = keys.first() else { return false };
        (self.lo, self.hi) = (*first, *first);
        for k in &keys {
            for a in 0..3 {
                self.lo[a] = self.lo[a].min(k[a]);
                self.hi[a] = self.hi[a].max(k[a]);
            }
        }
        self.blocks = keys.iter().map(|&key| Block::new(key)).collect();
        for z in self.lo[0]..=self.hi[0] {
            for y in self.lo[1]..=self.hi[1] {
                for x in self.lo[2]..=self.hi[2] {
                    if keys.binary_search(&[z, y, x]).is_err() {
                        self.hollow.push(([z, y, x], 0));
                    }
                }
            }
        }
        true
    }

    /// Second pass: averages a batch of observations in, in their order (deterministic on any
    /// thread count). `world_from_canonical[i]` is this part's pose in the state of `batch[i]`.
    pub fn integrate(&mut self, batch: &[Observation], world_from_canonical: &[Pose], part: u8) {
        let views: Vec<Ray> = batch.iter().zip(world_from_canonical).map(|(seen, pose)| Ray::new(seen, pose)).collect();
        let (voxel, truncation, size) = (self.voxel, self.truncation, self.block_size());
        self.blocks.par_iter_mut().for_each(|block| {
            let corner = Vec3::new(block.key[2] as f32, block.key[1] as f32, block.key[0] as f32) * size;
            for view in &views {
                if view.sees(corner + 0.5 * size, 0.87 * size) {
                    view.average_into(block, corner, voxel, truncation, part);
                }
            }
        });
        let blocks = &self.blocks;
        batch.par_iter().zip(world_from_canonical).for_each(|(seen, pose)| count_hits(blocks, seen, pose, part, voxel));
        self.hollow.par_iter_mut().for_each(|(key, empty)| {
            let centre = (Vec3::new(key[2] as f32, key[1] as f32, key[0] as f32) + 0.5) * size;
            for view in &views {
                if let Some((z, depth, label)) = view.pixel(centre) {
                    let crossed = label == BACKGROUND || (label != UNKNOWN && depth > z + 0.87 * size);
                    *empty = empty.saturating_add(crossed as u16);
                }
            }
        });
    }

    /// What was seen of the part, as a dense field; where nothing was, it is solid and not `known`.
    pub fn seen(&self) -> Field {
        // One voxel of empty border on each side closes the surface.
        let n = |a: usize| ((self.hi[a] - self.lo[a] + 1) * B) as usize + 2;
        let dims = [n(2), n(1), n(0)];
        let base = Vec3::new(self.lo[2] as f32, self.lo[1] as f32, self.lo[0] as f32) * self.block_size();
        let mut field = Field::empty(base - self.voxel * 0.5, self.voxel, dims);
        let mut set = |i: usize, value: Option<f32>| {
            field.values[i] = value.unwrap_or(-1.0);
            field.known[i] = value.is_some();
        };
        for b in &self.blocks {
            (0..BLOCK)
                .for_each(|i| set(self.index(dims, &b.key, i), (b.weight[i] > 0.0).then(|| b.sum[i] / b.weight[i])));
        }
        for (key, empty) in &self.hollow {
            (0..BLOCK).for_each(|i| set(self.index(dims, key, i), (*empty >= MIN_EMPTY).then_some(1.0)));
        }
        self.keep_thin(&mut field);
        field
    }

    /// Where voxel `i` of block `key` lies in the dense field, which has an empty border of one
    /// voxel.
    pub(crate) fn index(&self, dims: [usize; 3], key: &Key, i: usize) -> usize {
        let at = |a: usize, d: usize| ((key[a] - self.lo[a]) * B) as usize + d + 1;
        (at(0, i / 64) * dims[1] + at(1, i / 8 % 8)) * dims[0] + at(2, i % 8)
    }
}

/// Counts the part's surface pixels per voxel. Sums of integers: the order of threads does not
/// matter.
fn count_hits(blocks: &[Block], seen: &Observation, world_from_canonical: &Pose, part: u8, voxel: f32) {
    let canonical_from_camera = world_from_canonical.inverse() * seen.camera.camera_from_world.inverse();
    let pixel_area = 1.0 / (seen.camera.fx * seen.camera.fy) as f32;
    for (i, &label) in seen.labels.iter().enumerate() {
        let depth = seen.depth[i];
        if label != part || !(depth > 0.0) {
            continue;
        }
        let x = (canonical_from_camera.apply(seen.camera_point(i)) / voxel as f64).floor().as_ivec3();
        let key = [x.z.div_euclid(B), x.y.div_euclid(B), x.x.div_euclid(B)];
        if let Ok(b) = blocks.binary_search_by_key(&key, |b| b.key) {
            let inner = (x.z.rem_euclid(B) * B + x.y.rem_euclid(B)) * B + x.x.rem_euclid(B);
            let faces = pixel_area * depth * depth / (voxel * voxel);
            blocks[b].hits[inner as usize].fetch_add(1, Ordering::Relaxed);
            blocks[b].cover[inner as usize].fetch_add((faces * COVER_UNIT) as u32, Ordering::Relaxed);
        }
    }
}

/// One observation prepared for projecting canonical points.
struct Ray<'a> {
    seen: &'a Observation,
    rot: glam::Mat3,
    trans: Vec3,
    f: [f32; 4],
}

impl<'a> Ray<'a> {
    fn new(seen: &'a Observation, world_from_canonical: &Pose) -> Self {
        let camera_from_canonical = seen.camera.camera_from_world * *world_from_canonical;
        let c = &seen.camera;
        Self {
            seen,
            rot: camera_from_canonical.mat3().as_mat3(),
            trans: camera_from_canonical.trans.as_vec3(),
            f: [c.fx as f32, c.fy as f32, c.cx as f32, c.cy as f32],
        }
    }

    /// Whether a ball about `centre` may be in the picture.
    fn sees(&self, centre: Vec3, radius: f32) -> bool {
        let x = self.rot * centre + self.trans;
        if x.z <= radius {
            return false;
        }
        let (u, v) = (self.f[0] * x.x / x.z + self.f[2], self.f[1] * x.y / x.z + self.f[3]);
        let r = self.f[0].max(self.f[1]) * radius / (x.z - radius);
        let (w, h) = (self.seen.camera.width as f32, self.seen.camera.height as f32);
        u > -r && v > -r && u < w + r && v < h + r
    }

    /// z of the point, and depth and label of the pixel it falls on.
    #[inline]
    fn pixel(&self, x: Vec3) -> Option<(f32, f32, u8)> {
        let x = self.rot * x + self.trans;
        self.pixel_camera(x)
    }

    #[inline]
    fn pixel_camera(&self, x: Vec3) -> Option<(f32, f32, u8)> {
        if !(x.z > 0.0) {
            return None;
        }
        let inv = 1.0 / x.z;
        let (u, v) = (self.f[0] * x.x * inv + self.f[2], self.f[1] * x.y * inv + self.f[3]);
        let (w, h) = (self.seen.camera.width, self.seen.camera.height);
        if !(u >= 0.0 && v >= 0.0 && u < w as f32 && v < h as f32) {
            return None;
        }
        let i = v as usize * w + u as usize;
        Some((x.z, self.seen.depth[i], self.seen.labels[i]))
    }

    fn average_into(&self, block: &mut Block, corner: Vec3, voxel: f32, truncation: f32, part: u8) {
        let step = self.rot.x_axis * voxel;
        let inv_truncation = 1.0 / truncation;
        for zy in 0..(B * B) as usize {
            let (y, z) = (zy % 8, zy / 8);
            let start = corner + Vec3::new(0.5, y as f32 + 0.5, z as f32 + 0.5) * voxel;
            let mut x_camera = self.rot * start + self.trans;
            for x in 0..B as usize {
                let seen = self.pixel_camera(x_camera);
                x_camera += step;
                let Some((z_voxel, depth, label)) = seen else { continue };
                let i = zy * 8 + x;
                let (value, weight) = if label == BACKGROUND {
                    (1.0, 1.0)
                } else if label == UNKNOWN || !(depth > 0.0) {
                    continue;
                } else {
                    let s = (depth - z_voxel) * inv_truncation;
                    if s >= 1.0 {
                        (1.0, 1.0)
                    } else if s > 0.0 {
                        (s, 1.0)
                    } else if label == part && s > -1.0 {
                        // Behind the surface the weight fades: the far side of a thin sheet is not
                        // ours to fill.
                        (s, 1.0 + s)
                    } else {
                        continue;
                    }
                };
                block.sum[i] += value * weight;
                block.weight[i] += weight;
            }
        }
    }
}

/// Runs both passes over all observations for all parts. `load(i)` gives observation `i`; it is
/// called twice.
///
/// # Errors
/// Whatever `load` answers, or [`Cancelled`] from the progress handle.
pub fn fuse<E: From<Cancelled> + Send>(
    n: usize,
    load: &(dyn Fn(usize) -> Result<Observation, E> + Sync),
    poses: &[Vec<Pose>],
    voxel: f32,
    progress: &hingecast_geom::Progress,
) -> Result<Vec<Option<PartVolume>>, E> {
    /// Observations held decoded at once: enough work per fork, little memory.
    const BATCH: usize = 48;
    let n_parts = poses.first().map_or(0, Vec::len);
    let mut volumes: Vec<PartVolume> = (0..n_parts).map(|_| PartVolume::new(voxel)).collect();
    for pass in 0..2 {
        for start in (0..n).step_by(BATCH) {
            let end = (start + BATCH).min(n);
            progress.report(pass * n + start, 2 * n, "")?;
            let batch = (start..end).into_par_iter().map(load).collect::<Result<Vec<_>, E>>()?;
            if pass == 0 {
                volumes.par_iter_mut().enumerate().for_each(|(part, volume)| {
                    for seen in &batch {
                        volume.mark(seen, part as u8, &poses[seen.state][part].inverse());
                    }
                });
            } else {
                for (part, volume) in volumes.iter_mut().enumerate() {
                    let at: Vec<Pose> = batch.iter().map(|seen| poses[seen.state][part]).collect();
                    volume.integrate(&batch, &at, part as u8);
                }
            }
        }
        if pass == 0 {
            for v in &mut volumes {
                v.allocate();
            }
        }
    }
    Ok(volumes.into_iter().map(|v| if v.blocks.is_empty() { None } else { Some(v) }).collect())
}
