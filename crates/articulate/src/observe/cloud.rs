//! A state's measured surface as oriented samples: one per voxel and facing.

use super::depth_view::DepthView;
use super::robust::median;
use glam::{DVec3, IVec3, Vec3};
use hingecast_geom::PointTree;
use rayon::prelude::*;
use std::collections::HashMap;

/// Oriented samples of a surface, world frame.
#[derive(Clone, Debug, Default)]
pub struct Cloud {
    /// Scene units.
    pub points: Vec<Vec3>,
    /// Unit, towards the cameras that saw them.
    pub normals: Vec<Vec3>,
}

/// Gathers the planes of all views of a state into one sample per voxel of edge `voxel` and facing
/// (one of six). Samples that fewer than `least` pixels support are dropped as stray.
pub fn gather(views: &[DepthView], voxel: f32, stride: usize, least: u32) -> Cloud {
    let planes: Vec<Vec<(Vec3, Vec3, f32)>> = views
        .par_iter()
        .map(|view| {
            let mut out = Vec::new();
            view.planes(stride, &mut |x, n, w| out.push((x, n, w)));
            out
        })
        .collect();
    merge(planes.into_iter().flatten(), voxel, least)
}

/// One sample per voxel and facing from oriented points, see [`gather`].
pub fn merge(planes: impl Iterator<Item = (Vec3, Vec3, f32)>, voxel: f32, least: u32) -> Cloud {
    type Key = ([i32; 3], u8);
    let mut cells: HashMap<Key, (DVec3, DVec3, f64, u32)> = HashMap::new();
    for (x, n, w) in planes {
        let key: IVec3 = (x / voxel).floor().as_ivec3();
        let slot = cells.entry((key.to_array(), facing(n))).or_insert((DVec3::ZERO, DVec3::ZERO, 0.0, 0));
        let w = w as f64;
        slot.0 += w * x.as_dvec3();
        slot.1 += w * n.as_dvec3();
        slot.2 += w;
        slot.3 += 1;
    }
    // The table's order is not the same in every run. Along Morton's curve, what is asked one after
    // the other lies close together in every state's grid and tree.
    let lowest = cells.keys().fold(IVec3::MAX, |lo, k| lo.min(k.0.into()));
    let mut cells: Vec<_> = cells.into_iter().collect();
    cells.sort_by_cached_key(|c| (morton(IVec3::from(c.0.0) - lowest), c.0.1));
    let mut cloud = Cloud::default();
    let mut pixels = Vec::new();
    for (_, (x, n, weight, count)) in cells {
        let mean = n / weight;
        // Normals that disagree within a voxel make a sample that faces nowhere.
        if count >= least && mean.length() > 0.7 {
            cloud.points.push((x / weight).as_vec3());
            cloud.normals.push(mean.normalize().as_vec3());
            pixels.push(count as f32);
        }
    }
    flatten(&mut cloud, &pixels, voxel);
    cloud
}

/// Samples are flattened where they are off their neighbours' plane by more than this share of a
/// voxel (median).
const ROUGH: f32 = 0.05;
/// Neighbours that hold a sample's plane: within this many voxels, facing alike, so many at most.
const AROUND: f32 = 1.7;
const ALIKE: f32 = 0.85;
const HOLDERS: usize = 24;

/// Noise spreads a surface over two layers of voxels, and whatever is compared with the nearer of
/// two layers seems to lie on it. So every sample of a rough cloud moves along its normal into the
/// mean plane of its neighbours, by their numbers of pixels.
fn flatten(cloud: &mut Cloud, pixels: &[f32], voxel: f32) {
    for _ in 0..2 {
        let tree = PointTree::new(&cloud.points);
        let plane = |i: usize| {
            let (x, n) = (cloud.points[i], cloud.normals[i]);
            let (mut sum, mut weight) = (0.0, 0.0);
            for j in tree.k_nearest(x, HOLDERS) {
                let gap = cloud.points[j as usize] - x;
                if gap.length() < AROUND * voxel && cloud.normals[j as usize].dot(n) > ALIKE {
                    sum += pixels[j as usize] * n.dot(gap);
                    weight += pixels[j as usize];
                }
            }
            sum / weight.max(1.0)
        };
        let mut some: Vec<f32> = (0..cloud.points.len()).into_par_iter().step_by(16).map(|i| plane(i).abs()).collect();
        if median(&mut some) < ROUGH * voxel {
            return;
        }
        let off: Vec<f32> = (0..cloud.points.len()).into_par_iter().map(plane).collect();
        for ((x, n), off) in cloud.points.iter_mut().zip(&cloud.normals).zip(off) {
            *x += *n * off;
        }
    }
}

/// Place on Morton's curve: the bits of x, y and z in turns. Coordinates are not negative.
fn morton(c: IVec3) -> u64 {
    let spread = |v: i32| (0..21).fold(0u64, |sum, bit| sum | (v as u64 >> bit & 1) << (3 * bit));
    spread(c.x) | spread(c.y) << 1 | spread(c.z) << 2
}

/// Which of the six faces of a cube a direction goes through.
fn facing(n: Vec3) -> u8 {
    let a = n.abs();
    let axis = if a.x >= a.y && a.x >= a.z {
        0
    } else if a.y >= a.z {
        1
    } else {
        2
    };
    2 * axis + u8::from(n[axis as usize] < 0.0)
}

#[cfg(test)]
mod tests {
    use super::super::depth_view::OBJECT;
    use super::*;
    use hingecast_geom::Camera;

    #[test]
    fn a_slanted_plane_has_its_exact_normal() {
        let camera = Camera::look_at(DVec3::new(2.0, 0.4, 1.1), DVec3::ZERO, DVec3::Z, 64, 48, 0.6);
        let n = DVec3::new(0.8, 0.3, 0.52).normalize();
        let eye = camera.centre();
        let mut view = DepthView { camera, depth: vec![0.0; 64 * 48], class: vec![OBJECT; 64 * 48] };
        for i in 0..64 * 48 {
            let ray = camera.ray(glam::DVec2::new((i % 64) as f64 + 0.5, (i / 64) as f64 + 0.5));
            view.depth[i] = (-n.dot(eye) / n.dot(ray)) as f32;
        }
        let cloud = gather(&[view], 0.05, 1, 1);
        assert!(cloud.points.len() > 100);
        for (x, m) in cloud.points.iter().zip(&cloud.normals) {
            assert!(m.as_dvec3().cross(n).length() < 1e-3 && x.as_dvec3().dot(n).abs() < 1e-5, "{m} {x}");
        }
    }

    #[test]
    fn an_edge_pulls_nothing_off_its_planes() {
        // A roof: z = 0.4 - |x| / 3, seen from above by pixels half a voxel wide.
        let camera = Camera::look_at(DVec3::new(0.3, -0.2, 3.0), DVec3::ZERO, DVec3::Y, 64, 64, 0.6);
        let eye = camera.centre();
        let mut view = DepthView { camera, depth: vec![0.0; 64 * 64], class: vec![OBJECT; 64 * 64] };
        let sides = [DVec3::new(1.0, 0.0, 3.0), DVec3::new(-1.0, 0.0, 3.0)];
        for i in 0..64 * 64 {
            let ray = camera.ray(glam::DVec2::new((i % 64) as f64 + 0.5, (i / 64) as f64 + 0.5));
            view.depth[i] = sides.map(|n| (1.2 - n.dot(eye)) / n.dot(ray)).into_iter().fold(0.0, f64::max) as f32;
        }
        let cloud = gather(&[view], 0.06, 1, 1);
        let off = |x: &Vec3| ((1.2 - x.x.abs() - 3.0 * x.z) / 10f32.sqrt()).abs();
        let mean = cloud.points.iter().map(off).sum::<f32>() / cloud.points.len() as f32;
        // Counted alike, all windows give 6e-5.
        assert!(cloud.points.len() > 300 && mean < 2e-5, "{} {mean}", cloud.points.len());
    }

    #[test]
    fn a_noisy_plane_that_straddles_two_layers_becomes_one() {
        let mut rng = fastrand::Rng::with_seed(3);
        // z = 0.2 is where two layers of voxels of edge 0.1 meet; the noise is a fifth of a voxel.
        let planes: Vec<(Vec3, Vec3, f32)> = (0..40_000)
            .map(|_| {
                let z = 0.2 + 0.02 * hingecast_geom::random::normal(&mut rng) as f32;
                (Vec3::new(3.0 * rng.f32(), 3.0 * rng.f32(), z), Vec3::Z, 1.0)
            })
            .collect();
        let cloud = merge(planes.into_iter(), 0.1, 2);
        let off: Vec<f32> = cloud.points.iter().map(|x| (x.z - 0.2).abs()).collect();
        let mean = off.iter().sum::<f32>() / off.len() as f32;
        // The layers' means lie 0.016 to either side.
        assert!(cloud.points.len() > 1000 && mean < 0.004, "{mean}");
    }
}
