//! Convex pieces of different parts that still overlap in a recorded state, cut apart.
//!
//! A convex piece reaches a little beyond the surface that it stands for. Where a piece of a moving
//! part overlaps one of a part nearer to the root, it is cut along a plane that supports the still
//! piece: of those along its faces and that of the minimal translation (GJK/EPA) the one that
//! leaves the most. (The minimal translation alone cuts a thin lid through its thickness where its
//! rim sinks in.) What loses nearly everything is dropped.

use crate::hulls::{hull_of, usable, vectors};
use glam::{Mat3, Vec3};
use hingecast_geom::{Pose, TriMesh};
use parry3d::math::{Pose as ParryPose, Vector};
use parry3d::query;
use parry3d::shape::ConvexPolyhedron;
use rayon::prelude::*;

/// A piece cut below this share of its volume is dropped.
const LEAST_LEFT: f64 = 0.15;

/// Faces of a still piece whose normals differ by less are tried once.
const SAME_FACE: f32 = 0.97;

struct Piece {
    shape: ConvexPolyhedron,
    lo: Vec3,
    hi: Vec3,
    /// Outward, of faces that differ.
    normals: Vec<Vec3>,
}

impl Piece {
    /// How far the piece reaches along `n`.
    fn support(&self, n: Vec3) -> f32 {
        self.shape.points().iter().map(|p| n.dot(Vec3::new(p.x, p.y, p.z))).fold(f32::MIN, f32::max)
    }
}

fn piece(hull: &TriMesh) -> Option<Piece> {
    let points = vectors(&hull.vertices);
    let (lo, hi) = hull.bounds()?;
    let mut normals: Vec<Vec3> = Vec::new();
    for f in &hull.faces {
        let [a, b, c] = f.map(|i| hull.vertices[i as usize]);
        let n = (b - a).cross(c - a).normalize_or_zero();
        if n != Vec3::ZERO && normals.iter().all(|o| o.dot(n) < SAME_FACE) {
            normals.push(n);
        }
    }
    Some(Piece { shape: ConvexPolyhedron::from_convex_hull(&points)?, lo, hi, normals })
}

/// Cuts `hulls[part]` for all parts in `order` (root first) clear of the parts before it that it
/// `meets`, in all states. `poses[state][part]`: world from canonical; `clearance`: the gap to
/// leave, scene units. Answers how many pieces were dropped.
pub fn separate(
    hulls: &mut [Vec<TriMesh>],
    order: &[usize],
    poses: &[Vec<Pose>],
    clearance: f32,
    meets: impl Fn(usize, usize) -> bool,
) -> usize {
    let mut dropped = 0;
    for (k, &part) in order.iter().enumerate() {
        let mut cut = std::mem::take(&mut hulls[part]);
        for &other in order[..k].iter().filter(|&&other| meets(part, other)) {
            let still: Vec<Piece> = hulls[other].iter().filter_map(piece).collect();
            let mut other_from_part: Vec<Pose> = poses.iter().map(|at| at[other].inverse() * at[part]).collect();
            other_from_part.dedup();
            let results: Vec<Option<TriMesh>> =
                cut.par_iter().map(|hull| clear_of(hull, &still, &other_from_part, clearance)).collect();
            dropped += results.iter().filter(|r| r.is_none()).count();
            cut = results.into_iter().flatten().collect();
        }
        hulls[part] = cut;
    }
    dropped
}

/// `hull` cut clear of `still` under all motions; `None` when too little is left.
fn clear_of(hull: &TriMesh, still: &[Piece], motions: &[Pose], clearance: f32) -> Option<TriMesh> {
    let whole = hull.mass_integrals().volume;
    let mut hull = hull.clone();
    let mut moving = piece(&hull)?;
    for motion in motions {
        let (rot, trans) = (motion.mat3().as_mat3(), motion.trans.as_vec3());
        let place = ParryPose::from_parts(Vector::new(trans.x, trans.y, trans.z), parry_rotation(motion));
        for other in still {
            let (lo, hi) = moved_box(&moving, rot, trans);
            if lo.cmpgt(other.hi).any() || hi.cmplt(other.lo).any() {
                continue;
            }
            let found = query::contact(&ParryPose::IDENTITY, &other.shape, &place, &moving.shape, 0.5 * clearance);
            let Ok(Some(contact)) = found else { continue };
            let nearest = Vec3::new(contact.normal1.x, contact.normal1.y, contact.normal1.z);
            // Supporting planes of the still piece, in the moving part's frame.
            let left = std::iter::once(nearest).chain(other.normals.iter().copied()).filter_map(|n| {
                let offset = other.support(n) + clearance - n.dot(trans);
                let cut = clip(&hull, rot.transpose() * n, offset)?;
                Some((cut.mass_integrals().volume, cut))
            });
            let (volume, most) = left.max_by(|a, b| a.0.total_cmp(&b.0))?;
            if !(volume > LEAST_LEFT * whole) {
                return None;
            }
            hull = most;
            moving = piece(&hull)?;
        }
    }
    let (lo, hi) = hull.bounds()?;
    usable(&hull, 1e-3 * (hi - lo).length()).then_some(hull)
}

fn parry_rotation(pose: &Pose) -> parry3d::math::Rotation {
    let q = pose.rot.as_quat();
    parry3d::math::Rotation::from_xyzw(q.x, q.y, q.z, q.w)
}

fn moved_box(piece: &Piece, rot: Mat3, trans: Vec3) -> (Vec3, Vec3) {
    let (centre, half) = ((piece.lo + piece.hi) * 0.5, (piece.hi - piece.lo) * 0.5);
    let reach = rot.x_axis.abs() * half.x + rot.y_axis.abs() * half.y + rot.z_axis.abs() * half.z;
    let centre = rot * centre + trans;
    (centre - reach, centre + reach)
}

/// The part of a convex hull where normal . x >= offset, as a hull again.
fn clip(hull: &TriMesh, normal: Vec3, offset: f32) -> Option<TriMesh> {
    let height: Vec<f32> = hull.vertices.iter().map(|v| normal.dot(*v) - offset).collect();
    let mut points: Vec<Vec3> =
        hull.vertices.iter().zip(&height).filter(|(_, h)| **h >= 0.0).map(|(v, _)| *v).collect();
    for f in &hull.faces {
        for k in 0..3 {
            let (a, b) = (f[k] as usize, f[(k + 1) % 3] as usize);
            // Each edge once: from its kept end.
            if height[a] >= 0.0 && height[b] < 0.0 {
                points.push(hull.vertices[a].lerp(hull.vertices[b], height[a] / (height[a] - height[b])));
            }
        }
    }
    hull_of(&points)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_lid_sunk_into_its_box_is_cut_and_the_box_is_not() {
        let base = TriMesh::cuboid(Vec3::ZERO, Vec3::ONE);
        let lid = TriMesh::cuboid(Vec3::new(0.0, 0.0, 0.95), Vec3::new(1.0, 1.0, 1.15));
        let lost = TriMesh::cuboid(Vec3::splat(0.4), Vec3::splat(0.5));
        let mut hulls = vec![vec![base.clone()], vec![lid, lost]];
        let dropped = separate(&mut hulls, &[0, 1], &[vec![Pose::IDENTITY; 2]], 1e-4, |_, _| true);
        assert_eq!((dropped, hulls[1].len()), (1, 1));
        assert_eq!(hulls[0][0], base);
        let (lo, hi) = hulls[1][0].bounds().unwrap();
        assert!((lo.z - 1.0).abs() < 2e-3 && (hi.z - 1.15).abs() < 1e-5, "{lo} {hi}");
    }
}
