//! Vertex colours: the mean of the pixels that really show the vertex, facing views first.

use crate::Observation;
use hingecast_geom::{Pose, TriMesh};
use rayon::prelude::*;

/// Adds what `batch` sees of part `part` to `sums` (rgb and weight per vertex).
/// A pixel counts when it carries the part's label and its depth is the vertex's within `tolerance`.
pub fn accumulate(
    sums: &mut [[f32; 4]],
    mesh: &TriMesh,
    normals: &[glam::Vec3],
    part: u8,
    batch: &[Observation],
    world_from_canonical: &[Pose],
    tolerance: f32,
) {
    for (seen, pose) in batch.iter().zip(world_from_canonical) {
        let camera_from_canonical = seen.camera.camera_from_world * *pose;
        let (rot, trans) = (camera_from_canonical.mat3().as_mat3(), camera_from_canonical.trans.as_vec3());
        let c = &seen.camera;
        sums.par_iter_mut().enumerate().for_each(|(i, sum)| {
            let x = rot * mesh.vertices[i] + trans;
            let facing = -(rot * normals[i]).dot(x.normalize_or_zero());
            if !(x.z > 0.0 && facing > 0.2) {
                return;
            }
            let (u, v) = (c.fx as f32 * x.x / x.z + c.cx as f32, c.fy as f32 * x.y / x.z + c.cy as f32);
            if !(u >= 0.0 && v >= 0.0 && u < c.width as f32 && v < c.height as f32) {
                return;
            }
            let p = v as usize * c.width + u as usize;
            if seen.labels[p] != part || (seen.depth[p] - x.z).abs() > tolerance {
                return;
            }
            let w = facing * facing;
            for k in 0..3 {
                sum[k] += w * seen.rgb[3 * p + k] as f32;
            }
            sum[3] += w;
        });
    }
}

/// Turns the sums into colours; a vertex that nobody saw takes the mean of its coloured neighbours, else grey.
pub fn finish(mesh: &mut TriMesh, sums: &[[f32; 4]]) {
    let mut colors: Vec<Option<[f32; 3]>> =
        sums.iter().map(|s| (s[3] > 0.0).then(|| [s[0] / s[3], s[1] / s[3], s[2] / s[3]])).collect();
    for _ in 0..8 {
        let mut spread = vec![([0.0f32; 3], 0.0f32); colors.len()];
        for f in &mesh.faces {
            for k in 0..3 {
                let (to, from) = (f[k] as usize, f[(k + 1) % 3] as usize);
                for (to, from) in [(to, from), (from, to)] {
                    if let (None, Some(c)) = (colors[to], colors[from]) {
                        (0..3).for_each(|k| spread[to].0[k] += c[k]);
                        spread[to].1 += 1.0;
                    }
                }
            }
        }
        let mut changed = false;
        for (color, (sum, n)) in colors.iter_mut().zip(spread) {
            if color.is_none() && n > 0.0 {
                *color = Some(sum.map(|s| s / n));
                changed = true;
            }
        }
        if !changed {
            break;
        }
    }
    mesh.colors = colors.iter().map(|c| c.unwrap_or([128.0; 3]).map(|x| x.round() as u8)).collect();
}
