//! Which part a pixel shows, by the labelled samples of its state.

use super::pixels;
use glam::Vec3;
use hingecast_articulate::Labelled;
use hingecast_articulate::label::labelled::far_off_plane;
use hingecast_articulate::observe::mask_votes::contradicted;
use hingecast_capture::View;
use hingecast_geom::{PointTree, Pose};
use hingecast_twin::{BACKGROUND, UNKNOWN};
use rayon::prelude::*;

/// A state's labelled samples, to be asked for the part of what lies near them.
pub struct LabelledSurface {
    tree: PointTree,
    points: Vec<Vec3>,
    parts: Vec<u8>,
    /// Whatever lies nearer to a sample than this, and to no other sample nearer, is of its part.
    inside: Vec<f32>,
}

/// Samples that may say what part a point is.
const ASKED: usize = 12;
/// Samples around one that tell how far from it only its own part is.
const AROUND: usize = 64;

impl LabelledSurface {
    fn new(points: Vec<Vec3>, parts: Vec<u8>) -> Self {
        let tree = PointTree::new(&points);
        // A point at distance d of its nearest sample s has its `ASKED` nearest within d of itself
        // plus s's distance to its own `ASKED` nearest, so within 2 d plus that of s.
        let inside = |i: usize| {
            let near = tree.k_nearest(points[i], AROUND);
            let far = |k: usize| points[near[k] as usize].distance(points[i]);
            let other = near.iter().position(|j| parts[*j as usize] != parts[i]);
            let alone = match other {
                Some(k) => far(k),
                None if near.len() == points.len() => f32::INFINITY,
                None => far(near.len() - 1),
            };
            0.499 * (alone - far(ASKED.min(near.len()) - 1))
        };
        let inside = (0..points.len()).into_par_iter().map(inside).collect();
        Self { tree, points, parts, inside }
    }

    /// The part of a point with this normal, if any sample lies within `reach` (squared): that of
    /// the sample, of the nearest few, that lies nearest in its plane.
    pub fn part_at(&self, x: Vec3, normal: Option<Vec3>, reach: f32) -> Option<u8> {
        let (nearest, squared) = self.tree.nearest(x).filter(|n| n.1 < reach)?;
        let Some(n) = normal.filter(|_| squared.sqrt() >= self.inside[nearest]) else {
            return Some(self.parts[nearest]);
        };
        self.weighed(x, n)
    }

    fn weighed(&self, x: Vec3, normal: Vec3) -> Option<u8> {
        let far = |i: &u32| far_off_plane(self.points[*i as usize] - x, normal);
        let near = self.tree.k_nearest(x, ASKED).into_iter();
        near.min_by(|a, b| far(a).total_cmp(&far(b))).map(|i| self.parts[i as usize])
    }
}

/// The labelled samples of every state; `state_from_world`: how far each state's world has been
/// moved since, if it has.
pub fn surfaces(labelled: &[Labelled], n_states: usize, state_from_world: &[Pose]) -> Vec<LabelledSurface> {
    let of_state = |state: usize| {
        let own: Vec<&Labelled> = labelled.iter().filter(|s| s.state == state).collect();
        let back = state_from_world.get(state).map_or(Pose::IDENTITY, Pose::inverse);
        let points: Vec<Vec3> = own.iter().map(|s| back.apply(s.point.as_dvec3()).as_vec3()).collect();
        LabelledSurface::new(points, own.iter().map(|s| s.part).collect())
    };
    (0..n_states).into_par_iter().map(of_state).collect()
}

/// Part of every pixel of a view: that of the labelled sample of its state which lies nearest in
/// its plane, if one is within two of `voxel`, scene units: how far apart samples lie.
pub fn parts_of_pixels(view: &View, surface: &LabelledSurface, voxel: f32) -> Vec<u8> {
    let reach = (2.0 * voxel).powi(2);
    let silent = |i: usize| {
        if view.usable[i] == 1 && view.mask[i] == 0 && !(view.depth[i] > 0.0) { BACKGROUND } else { UNKNOWN }
    };
    let mut out: Vec<u8> = (0..view.mask.len()).map(silent).collect();
    for i in contradicted(&view.camera, &surface.points, voxel, &|i| out[i] == BACKGROUND) {
        out[i as usize] = UNKNOWN;
    }
    pixels::unproject(view, 1, &mut |x, i| {
        if let Some(part) = surface.part_at(x.as_vec3(), pixels::normal(view, i), reach) {
            out[i] = part;
        }
    });
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Where one part is all around, it answers at once: the same as when the samples are weighed.
    #[test]
    fn a_quick_answer_is_the_weighed_one() {
        let mut rng = fastrand::Rng::with_seed(3);
        // A sheet of two parts with a wavy border, and a third a little above.
        let (mut points, mut parts) = (Vec::new(), Vec::new());
        for k in 0..6000 {
            let (x, y) = (rng.f32(), rng.f32());
            let above = k % 10 == 0 && x < 0.3;
            points.push(Vec3::new(x, y, if above { 0.02 } else { 0.0 }));
            parts.push(if above { 2 } else { u8::from(y > 0.5 + 0.1 * (9.0 * x).sin()) });
        }
        let surface = LabelledSurface::new(points, parts);
        let mut quick = 0;
        for _ in 0..5000 {
            let x = Vec3::new(rng.f32(), rng.f32(), 0.03 * rng.f32() - 0.005);
            let (nearest, squared) = surface.tree.nearest(x).expect("samples");
            quick += usize::from(squared.sqrt() < surface.inside[nearest]);
            assert_eq!(surface.part_at(x, Some(Vec3::Z), 1.0), surface.weighed(x, Vec3::Z), "{x}");
        }
        assert!(quick > 1500 && quick < 4500, "{quick}");
    }
}
