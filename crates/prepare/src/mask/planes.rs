//! Floor, table, wall: large flat surfaces with everything that moves on one side of them.

use super::{Room, Wanted, place};
use glam::{DMat3, DVec3, Vec3};
use hingecast_articulate::DepthView;
use nalgebra::Matrix3;
use std::collections::{BTreeMap, BTreeSet};

/// Planes that are sought.
const MOST: usize = 8;
/// Samples that are tried as planes.
const TRIES: usize = 160;
/// A plane has at least this share of all samples.
const LEAST: f64 = 0.03;
/// Samples of a plane face within this cosine of it.
const FACES: f32 = 0.94;
/// Share of what moves that may lie behind a support, and how far that counts as behind, voxels.
const BEHIND: f64 = 0.03;
const DEEP: f32 = 1.5;
/// A support is at least so many times as large as what moves (along it), and covers this share of
/// what is seen along both of its directions.
const LARGER: f32 = 1.5;
const COVERS: f32 = 0.5;
/// Every so many pixels say how far from a plane its pixels lie: those within so many voxels, and
/// not fewer than these.
const EVERY: usize = 13;
const NEAR: f32 = 2.5;
const FEW: usize = 50;
/// No plane's own samples are taken to be farther off than this, voxels. One whose are must fill the first
/// share of its extent, in patches of so many voxels, and any other the second (but not the floor, which may
/// be seen in patches only): else it is the fronts of several things, or their tops, by chance in line.
const BLURRED: f32 = 1.5;
const FILLED: [f32; 2] = [0.7, 0.4];
const PATCH: f32 = 3.0;

/// A thing lies on a plane if its top is at least so many tolerances of it before it, and not more than so
/// many voxels.
const LIFTED: f32 = 3.0;
const THIN: f32 = 4.0;

/// A flat surface: `normal . x = offset`.
#[derive(Clone, Debug)]
pub(crate) struct Plane {
    /// Unit, towards the cameras.
    pub normal: Vec3,
    pub offset: f32,
    /// Farther than this from it is something else, scene units.
    pub tolerance: f32,
    /// The same for pixels whose z is in one of these bins.
    pub at_distance: BTreeMap<i32, f32>,
}

impl Plane {
    /// Signed distance, positive towards the cameras.
    pub fn height(&self, x: Vec3) -> f32 {
        self.normal.dot(x) - self.offset
    }

    /// The farthest from it that any of its pixels may be.
    pub fn widest(&self) -> f32 {
        self.at_distance.values().copied().fold(self.tolerance, f32::max)
    }

    /// Whether it is the flat top of a thing (scissors) that lies on another: along it, a little in front, and
    /// by more than the other's own samples are off.
    fn lies_on(&self, other: &Self, points: &[Vec3], voxel: f32) -> bool {
        let mut heights: Vec<f32> = points.iter().map(|x| other.height(*x)).collect();
        let middle = heights.len() / 2;
        let gap = *heights.select_nth_unstable_by(middle, f32::total_cmp).1;
        self.normal.dot(other.normal) > FACES && gap > LIFTED * other.tolerance && gap < THIN * voxel
    }

    /// Whether a place that was measured at `z` belongs to it: on it, or behind it.
    pub fn holds(&self, x: Vec3, z: f32) -> bool {
        let tolerance = self.at_distance.get(&bin(z)).copied().unwrap_or(self.tolerance);
        self.height(x) < tolerance.max(self.tolerance)
    }
}

/// Bins of z: stereo cameras' errors grow with its square.
fn bin(z: f32) -> i32 {
    (z.max(1e-6).ln() / 0.2).floor() as i32
}

/// The planes of the room. None has what is `wanted` behind it.
pub(super) fn supports(room: &Room, wanted: &Wanted, up: Vec3, seed: u64) -> Vec<Plane> {
    let voxel = room.lattice.voxel;
    let (mut still, mut moved) = (Vec::new(), Vec::new());
    for (cloud, m) in room.clouds.iter().zip(&room.moved) {
        for i in 0..cloud.points.len() {
            if m[i] { moved.push(cloud.points[i]) } else { still.push((cloud.points[i], cloud.normals[i])) }
        }
    }
    let all: Vec<Vec3> = still.iter().map(|s| s.0).chain(moved.iter().copied()).collect();
    let mut rng = fastrand::Rng::with_seed(seed);
    let least = (LEAST * all.len() as f64) as usize;
    let mut out: Vec<Plane> = Vec::new();
    for _ in 0..MOST {
        let Some((plane, members)) = largest(&still, voxel, &mut rng) else { break };
        if members.len() < least {
            break;
        }
        let points: Vec<Vec3> = members.iter().map(|&i| still[i].0).collect();
        let lies_on = |other: &Plane| plane.lies_on(other, &points, voxel);
        let before = !is_behind(&plane, wanted, &moved, &all, voxel);
        if before && is_support(&plane, &points, &moved, &all, up, voxel) && !out.iter().any(lies_on) {
            out.push(plane);
        }
        let mut taken = members.into_iter().peekable();
        let mut k = 0;
        still.retain(|_| {
            let gone = taken.next_if_eq(&k).is_some();
            k += 1;
            !gone
        });
    }
    out
}

/// The plane with most samples, refined, and its samples in order.
fn largest(samples: &[(Vec3, Vec3)], voxel: f32, rng: &mut fastrand::Rng) -> Option<(Plane, Vec<usize>)> {
    if samples.len() < 50 {
        return None;
    }
    let members = |n: Vec3, offset: f32, within: f32| -> Vec<usize> {
        let on = |&i: &usize| {
            let (x, m) = samples[i];
            (n.dot(x) - offset).abs() < within && m.dot(n) > FACES
        };
        (0..samples.len()).filter(on).collect()
    };
    let every = (samples.len() / 4000).max(1);
    let votes = |n: Vec3, offset: f32| {
        let on = samples.iter().step_by(every).filter(|(x, m)| (n.dot(*x) - offset).abs() < voxel && m.dot(n) > FACES);
        on.count()
    };
    let tries = (0..TRIES).map(|_| samples[rng.usize(0..samples.len())]);
    let (x, n) = tries.max_by_key(|(x, n)| votes(*n, n.dot(*x)))?;
    let (mut normal, mut offset) = (n, n.dot(x));
    for within in [1.5, 1.0, 1.0] {
        let own = members(normal, offset, within * voxel);
        if own.len() < 12 {
            return None;
        }
        (normal, offset) = fitted(own.iter().map(|&i| samples[i].0), normal);
    }
    let own = members(normal, offset, 1.5 * voxel);
    let off = own.iter().map(|&i| (normal.dot(samples[i].0) - offset).abs()).collect();
    Some((Plane { normal, offset, tolerance: tolerance(off, voxel), at_distance: BTreeMap::new() }, own))
}

/// How far from a plane its own samples may lie, when these are `off`.
fn tolerance(mut off: Vec<f32>, voxel: f32) -> f32 {
    let middle = off.len() / 2;
    let median = *off.select_nth_unstable_by(middle, f32::total_cmp).1;
    (5.0 * median).clamp(0.3 * voxel, BLURRED * voxel)
}

/// Widens the planes to what single pixels are off: samples are means of many.
pub(super) fn widen(supports: &mut [Plane], views: &[DepthView], voxel: f32) {
    let mut off: Vec<BTreeMap<i32, Vec<f32>>> = vec![BTreeMap::new(); supports.len()];
    for view in views {
        let world_from_camera = view.camera.camera_from_world.inverse();
        let (rot, trans) = (world_from_camera.mat3().as_mat3(), world_from_camera.trans.as_vec3());
        for i in (0..view.depth.len()).step_by(EVERY) {
            let Some(x) = place(view, &rot, trans, i) else { continue };
            for (plane, off) in supports.iter().zip(&mut off) {
                let height = plane.height(x).abs();
                if height < NEAR * voxel {
                    off.entry(bin(view.depth[i])).or_default().push(height);
                }
            }
        }
    }
    for (plane, off) in supports.iter_mut().zip(off) {
        let enough = off.into_iter().filter(|(_, off)| off.len() >= FEW);
        plane.at_distance = enough.map(|(bin, off)| (bin, tolerance(off, voxel))).collect();
    }
}

/// Total least squares; the normal on the side of `towards`.
fn fitted(points: impl Iterator<Item = Vec3>, towards: Vec3) -> (Vec3, f32) {
    let points: Vec<DVec3> = points.map(|x| x.as_dvec3()).collect();
    let centre = points.iter().sum::<DVec3>() / points.len() as f64;
    let mut m = DMat3::ZERO;
    for x in &points {
        let d = *x - centre;
        m += DMat3::from_cols(d * d.x, d * d.y, d * d.z);
    }
    let eigen = Matrix3::from_column_slice(&m.to_cols_array()).symmetric_eigen();
    let k = eigen.eigenvalues.imin();
    let n = DVec3::new(eigen.eigenvectors[(0, k)], eigen.eigenvectors[(1, k)], eigen.eigenvectors[(2, k)]);
    let n = if n.dot(towards.as_dvec3()) < 0.0 { -n } else { n };
    (n.as_vec3(), n.dot(centre) as f32)
}

/// Whether what is wanted lies behind a plane: what moved; half of what is in the box; the place.
fn is_behind(plane: &Plane, wanted: &Wanted, moved: &[Vec3], all: &[Vec3], voxel: f32) -> bool {
    let behind = |x: &Vec3| plane.height(*x) < -DEEP * voxel;
    let share = |points: &[Vec3]| points.iter().filter(|x| behind(x)).count() as f64 / points.len().max(1) as f64;
    share(moved) > BEHIND
        || match wanted {
            Wanted::Moving => false,
            Wanted::InBox(lo, hi) => {
                let (lo, hi) = (Vec3::from(*lo), Vec3::from(*hi));
                let held = all.iter().filter(|x| x.cmpge(lo).all() && x.cmple(hi).all());
                share(&held.copied().collect::<Vec<_>>()) > 0.5
            }
            Wanted::At(x) => behind(&Vec3::from(*x)),
        }
}

fn is_support(plane: &Plane, points: &[Vec3], moved: &[Vec3], all: &[Vec3], up: Vec3, voxel: f32) -> bool {
    let up_along = up - plane.normal * up.dot(plane.normal);
    let a =
        up_along.try_normalize().filter(|_| up_along.length() > 0.1).unwrap_or(plane.normal.any_orthonormal_vector());
    let sides = [a, plane.normal.cross(a)];
    let size = |points: &[Vec3]| sides.map(|s| spread(points, s));
    let (own, seed, seen) = (size(points), size(moved), size(all));
    let share = filled(points, sides, voxel) / (own[0] * own[1]);
    let blurred = plane.tolerance >= BLURRED * voxel;
    if blurred && share < FILLED[0] {
        return false;
    }
    let larger = own[0] * own[1] > LARGER * seed[0] * seed[1];
    // Under the lowest of all, whatever its size: the floor may be seen in patches only.
    let lowest = plane.normal.dot(up) > 0.9 && {
        let below = all.iter().filter(|x| plane.height(**x) < -DEEP * voxel).count();
        (below as f64) < BEHIND * all.len() as f64
    };
    larger && (lowest || share > FILLED[1] && (0..2).all(|k| own[k] > COVERS * seen[k]))
}

/// Area in which there are points, along two directions.
fn filled(points: &[Vec3], sides: [Vec3; 2], voxel: f32) -> f32 {
    let edge = PATCH * voxel;
    let patch = |x: &Vec3| sides.map(|s| (x.dot(s) / edge).floor() as i32);
    let patches: BTreeSet<[i32; 2]> = points.iter().map(patch).collect();
    patches.len() as f32 * edge * edge
}

/// Length along a direction, without the outermost hundredths.
fn spread(points: &[Vec3], along: Vec3) -> f32 {
    let mut at: Vec<f32> = points.iter().map(|x| x.dot(along)).collect();
    if at.is_empty() {
        return 0.0;
    }
    let last = at.len() - 1;
    let mut of = |share: f64| *at.select_nth_unstable_by((last as f64 * share) as usize, f32::total_cmp).1;
    of(0.99) - of(0.01)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn plane(offset: f32, tolerance: f32) -> Plane {
        Plane { normal: Vec3::Z, offset, tolerance, at_distance: BTreeMap::new() }
    }

    /// Scissors on a floor were taken for another floor, and nothing was left of them.
    #[test]
    fn what_lies_on_the_floor_is_no_floor() {
        let at = |z: f32| vec![Vec3::new(0.1, 0.2, z), Vec3::new(-0.3, 0.1, z), Vec3::new(0.4, 0.0, z)];
        let top = plane(0.04, 0.02);
        assert!(top.lies_on(&plane(0.0, 0.0075), &at(0.04), 0.025));
        // A noisy floor's own upper samples are the floor's; a table is none of it.
        assert!(!top.lies_on(&plane(0.0, 0.02), &at(0.04), 0.025));
        assert!(!plane(0.7, 0.02).lies_on(&plane(0.0, 0.0075), &at(0.7), 0.025));
        let wall = Plane { normal: Vec3::Y, ..plane(0.04, 0.02) };
        assert!(!wall.lies_on(&plane(0.0, 0.0075), &at(0.04), 0.025));
    }

    /// A chest among things as high as its rim was cut off at the rim, by a table that was none.
    #[test]
    fn tops_of_things_in_line_are_no_table() {
        let grid = |lo: [f32; 2], hi: [f32; 2], z: f32| -> Vec<Vec3> {
            let steps = |k: usize| ((hi[k] - lo[k]) / 0.025) as usize;
            let row = |i: usize| (0..steps(1)).map(move |j| (i, j));
            let at = |(i, j): (usize, usize)| Vec3::new(lo[0] + 0.025 * i as f32, lo[1] + 0.025 * j as f32, z);
            (0..steps(0)).flat_map(row).map(at).collect()
        };
        let (voxel, level) = (0.025, plane(0.5, 0.0125));
        let lid = grid([-0.4, -0.4], [0.4, 0.4], 0.7);
        let corners = [[-2.0, -1.2], [1.5, -1.2], [-2.0, 0.7], [1.5, 0.7], [-0.4, -0.3]];
        let tops: Vec<Vec3> = corners.iter().flat_map(|c| grid(*c, [c[0] + 0.5, c[1] + 0.5], 0.5)).collect();
        let table = grid([-2.0, -1.2], [2.0, 1.2], 0.5);
        for (points, is) in [(tops, false), (table, true)] {
            let all = [grid([-2.2, -1.3], [2.2, 1.3], 0.0), points.clone(), lid.clone()].concat();
            assert_eq!(is_support(&level, &points, &lid, &all, Vec3::Z, voxel), is);
        }
    }
}
