//! Views made equally bright. Cameras choose exposure and white balance anew for every picture, and
//! a surface painted from such pictures has patches.

use crate::Observation;
use crate::color::shows;
use crate::vertices::{Glimpse, Shown};
use hingecast_geom::{Pose, Projection, TriMesh};
use rayon::prelude::*;

/// Vertices of a part that are asked.
const ASKED: usize = 2000;
/// Vertices that must be seen before a view is changed.
const FEWEST: usize = 50;
/// Darker or brighter than this says nothing of the exposure. sRGB
const RANGE: [f32; 2] = [10.0, 245.0];
/// No view is made brighter or darker than by this factor.
const MOST: f32 = 2.0;

/// Factors of red, green and blue that bring each view to the colours that all views say in the
/// mean: the median over the vertices that it shows. [view, in the order of `shown`]
///
/// # Errors
/// What `shown` answers.
pub fn gains<E>(
    meshes: &[TriMesh],
    poses: &[Vec<Pose>],
    views: usize,
    tolerance: f32,
    shown: &Shown<E>,
) -> Result<Vec<[f32; 3]>, E> {
    let normals: Vec<_> = meshes.iter().map(TriMesh::vertex_normals).collect();
    let of_view = |seen: &Observation| {
        let mut ratios: [Vec<f32>; 3] = Default::default();
        for (part, mesh) in meshes.iter().enumerate() {
            let camera = Projection::new(&seen.camera, &poses[seen.state][part]);
            for i in (0..mesh.vertices.len()).step_by(mesh.vertices.len() / ASKED + 1) {
                let x = camera.to_camera(mesh.vertices[i]);
                let Some(pixel) = camera.pixel(x) else { continue };
                let normal = camera.rot * normals[part][i];
                let g = Glimpse { seen, part: part as u8, pixel, x, normal, rot: camera.rot };
                if shows(&g, tolerance).is_none() {
                    continue;
                }
                for (k, ratios) in ratios.iter_mut().enumerate() {
                    let [is, should] = [seen.rgb[3 * pixel + k], mesh.colors[i][k]].map(f32::from);
                    if is > RANGE[0] && is < RANGE[1] && should > RANGE[0] {
                        ratios.push(should / is);
                    }
                }
            }
        }
        ratios.map(|mut r| {
            let middle = r.len() / 2;
            let gain = if r.len() < FEWEST { 1.0 } else { *r.select_nth_unstable_by(middle, f32::total_cmp).1 };
            gain.clamp(1.0 / MOST, MOST)
        })
    };
    let mut gains = Vec::new();
    shown(views, &mut |batch| gains.extend(batch.par_iter().map(of_view).collect::<Vec<_>>()))?;
    Ok(gains)
}

/// `shown` with its views' colours multiplied by `gains`; to be asked once.
pub fn evened<'a, E>(
    gains: &'a [[f32; 3]],
    shown: &'a Shown<E>,
) -> impl Fn(usize, &mut dyn FnMut(&[Observation])) -> Result<(), E> + 'a {
    move |views, visit| {
        let mut next = 0;
        shown(views, &mut |batch| {
            let mut batch = batch.to_vec();
            batch.par_iter_mut().zip(&gains[next..]).for_each(|(seen, gain)| {
                for (i, value) in seen.rgb.iter_mut().enumerate() {
                    *value = (*value as f32 * gain[i % 3]).round().min(255.0) as u8;
                }
            });
            next += batch.len();
            visit(&batch);
        })
    }
}
