//! Which convex pieces are boxes: simulators are faster and steadier with a box than with its mesh.

use crate::xml::xyz;
use glam::{DMat3, DQuat, DVec3, EulerRot, Vec3};
use hingecast_geom::TriMesh;

/// A box, in the frame of the mesh it was.
#[derive(Clone, Copy, Debug)]
pub struct Cuboid {
    /// Its middle.
    pub centre: DVec3,
    /// Half of its edges.
    pub half: DVec3,
    /// Frame of the mesh from the box's own; as little turned as can be.
    pub rot: DQuat,
}

impl Cuboid {
    /// Its edges, its middle from `origin` on, and roll, pitch and yaw, radians, as URDF and SDFormat write
    /// them.
    pub(crate) fn words(&self, origin: DVec3) -> [String; 3] {
        let (yaw, pitch, roll) = self.rot.to_euler(EulerRot::ZYX);
        [2.0 * self.half, self.centre - origin, DVec3::new(roll, pitch, yaw)].map(xyz)
    }
}

/// Corners may be off by this share of the diagonal.
const EXACT: f64 = 1e-5;

/// The box that a mesh is, if it is one.
pub fn of(mesh: &TriMesh) -> Option<Cuboid> {
    let corners: [Vec3; 8] = mesh.vertices.clone().try_into().ok()?;
    let first = corners[0].as_dvec3();
    let from_first = corners.map(|c| c.as_dvec3() - first);
    let off = EXACT * from_first.iter().map(|e| e.length()).fold(0.0, f64::max);
    let across = |a: DVec3, b: DVec3| a.dot(b).abs() <= off * a.length().max(b.length());
    let [a, b, c] = (0..8 * 8 * 8)
        .map(|k| [k % 8, k / 8 % 8, k / 64].map(|i| from_first[i]))
        .filter(|[a, b, c]| a.length().min(b.length()).min(c.length()) > off)
        .find(|[a, b, c]| across(*a, *b) && across(*b, *c) && across(*c, *a))?;
    // Every corner is the first and some of the edges.
    let sums = (0..8).map(|k| [a, b, c].iter().enumerate().filter(|(j, _)| k >> j & 1 == 1).map(|(_, e)| *e).sum());
    let at_corner = |sum: DVec3| from_first.iter().any(|c| (*c - sum).length() <= off);
    if !sums.into_iter().all(at_corner) {
        return None;
    }
    let mut edges = vec![a, b, c];
    let mut take = |axis: DVec3| {
        let k = (0..edges.len()).max_by(|&i, &j| along(edges[i], axis).total_cmp(&along(edges[j], axis)))?;
        let edge = edges.swap_remove(k);
        Some(edge * edge.dot(axis).signum())
    };
    let (x, y, z) = (take(DVec3::X)?, take(DVec3::Y)?, take(DVec3::Z)?);
    let half = DVec3::new(x.length(), y.length(), z.length()) / 2.0;
    let (x, y) = (x.normalize(), y.reject_from(x).normalize());
    let rot = DQuat::from_mat3(&DMat3::from_cols(x, y, x.cross(y)));
    Some(Cuboid { centre: first + (a + b + c) / 2.0, half, rot })
}

/// Share of an edge that lies along an axis.
fn along(edge: DVec3, axis: DVec3) -> f64 {
    edge.dot(axis).abs() / edge.length()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_turned_box_is_found_in_any_order_and_a_wedge_is_not() {
        let (lo, hi) = (Vec3::new(-0.1, -0.02, -0.3), Vec3::new(0.1, 0.02, 0.3));
        let rot = DQuat::from_euler(EulerRot::ZYX, 0.3, -0.2, 0.1);
        let mut mesh = TriMesh::cuboid(lo, hi);
        mesh.vertices.iter_mut().for_each(|v| *v = (rot * v.as_dvec3()).as_vec3() + Vec3::ONE);
        mesh.vertices.swap(0, 6);
        mesh.vertices.swap(3, 4);
        let found = of(&mesh).unwrap();
        assert!((found.centre - DVec3::ONE).length() < 1e-6 && (found.half - hi.as_dvec3()).length() < 1e-6);
        assert!(found.rot.angle_between(rot) < 1e-5, "{found:?}");
        let axes = of(&TriMesh::cuboid(lo, hi)).unwrap();
        assert!(axes.rot.angle_between(DQuat::IDENTITY) < 1e-9);
        mesh.vertices[2] *= 1.01;
        assert!(of(&mesh).is_none());
        mesh.vertices.pop();
        assert!(of(&mesh).is_none());
    }
}
