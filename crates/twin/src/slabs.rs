//! The box with bevelled edges and corners around some points: a convex hull of thirteen fixed
//! directions (a k-DOP, Klosowski et al. 1998). Asked for millions of voxels, where a true hull
//! would take long.

use glam::Vec3;

/// Normals of faces, edges and corners of a cube, one of each pair.
const NORMALS: [Vec3; 13] = [
    Vec3::new(1.0, 0.0, 0.0),
    Vec3::new(0.0, 1.0, 0.0),
    Vec3::new(0.0, 0.0, 1.0),
    Vec3::new(1.0, 1.0, 0.0),
    Vec3::new(1.0, -1.0, 0.0),
    Vec3::new(1.0, 0.0, 1.0),
    Vec3::new(1.0, 0.0, -1.0),
    Vec3::new(0.0, 1.0, 1.0),
    Vec3::new(0.0, 1.0, -1.0),
    Vec3::new(1.0, 1.0, 1.0),
    Vec3::new(1.0, 1.0, -1.0),
    Vec3::new(1.0, -1.0, 1.0),
    Vec3::new(-1.0, 1.0, 1.0),
];

/// Lowest and highest height of a set of points along each of the normals.
pub struct Slabs([[f32; 2]; NORMALS.len()]);

impl Slabs {
    /// The smallest that hold all points; without points they hold nothing.
    pub fn around(points: impl Iterator<Item = Vec3>) -> Self {
        let mut slabs = [[f32::MAX, f32::MIN]; NORMALS.len()];
        for x in points {
            for ([lo, hi], n) in slabs.iter_mut().zip(&NORMALS) {
                let h = n.dot(x);
                (*lo, *hi) = (lo.min(h), hi.max(h));
            }
        }
        Self(slabs)
    }

    /// True where `x` lies between all of them.
    pub fn hold(&self, x: Vec3) -> bool {
        self.0.iter().zip(&NORMALS).all(|([lo, hi], n)| (*lo..=*hi).contains(&n.dot(x)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_ball_is_held_and_its_box_is_not() {
        let ring = (0..1000).map(|k| {
            // Points on the unit sphere, evenly (Fibonacci).
            let (z, turn) = (1.0 - 2.0 * (k as f32 + 0.5) / 1000.0, 2.399_963_2 * k as f32);
            let r = (1.0 - z * z).sqrt();
            Vec3::new(r * turn.cos(), r * turn.sin(), z)
        });
        let slabs = Slabs::around(ring);
        assert!(slabs.hold(Vec3::ZERO) && slabs.hold(Vec3::splat(0.56)));
        assert!(!slabs.hold(Vec3::splat(0.62)) && !slabs.hold(Vec3::new(0.8, 0.8, 0.0)) && !slabs.hold(Vec3::X * 1.1));
        assert!(!Slabs::around(std::iter::empty()).hold(Vec3::ZERO));
    }
}
