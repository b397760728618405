//! Photographs on the surface: a part's mesh is cut into flat charts (the atlas), and every texel
//! of these takes its colour from the pixels of all states that show it.
//!
//! ```text
//! mesh --atlas--> charts, texels in space --paint--> colour of each texel --fill--> picture
//! views that agree on colours ----------------------------^
//! ```

mod atlas;
pub mod files;
mod paint;

use crate::color::Sum;
use crate::vertices::{self, Points, Shown};
use hingecast_geom::{Cancelled, Pose, Progress, TriMesh};
use rayon::prelude::*;

/// A picture and where on it each face lies.
#[derive(Clone, Debug, PartialEq)]
pub struct Texture {
    /// Corners of the charts: a vertex of the mesh has one in each chart that it borders. Points of
    /// the unit square, v upwards as in OBJ, (0, 0) the lower left corner of the picture. (k, 2)
    pub corners: Vec<[f32; 2]>,
    /// The vertex of the mesh that each corner is. (k)
    pub vertices: Vec<u32>,
    /// Three corners a face, faces in the order of the mesh's. (m, 3)
    pub faces: Vec<[u32; 3]>,
    /// Texels a row.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// sRGB, row by row from above. (height, width, 3)
    pub rgb: Vec<u8>,
}

/// How much a picture may cost.
pub struct Most {
    /// Texels of one part's picture; 0: no pictures.
    pub texels: usize,
    /// Views that are asked.
    pub views: usize,
}

/// A picture for each part that has a surface; `sums` are what its coloured vertices collected.
/// Parts whose surface cannot be cut into charts have none. `shown`: views made equally bright. [part]
///
/// # Errors
/// What `shown` answers, or [`Cancelled`].
pub fn paint<E: From<Cancelled>>(
    meshes: &[TriMesh],
    sums: &[Vec<Sum>],
    poses: &[Vec<Pose>],
    most: &Most,
    tolerance: f32,
    shown: &Shown<E>,
    progress: &Progress,
) -> Result<Vec<Option<Texture>>, E> {
    if most.texels == 0 {
        return Ok(vec![None; meshes.len()]);
    }
    let cut = |(mesh, sums): (&TriMesh, &Vec<Sum>)| {
        let finest = finest(sums)?;
        atlas::cut(mesh, finest, most.texels, progress)
    };
    let atlases: Vec<Option<atlas::Atlas>> = meshes.par_iter().zip(sums).map(cut).collect();
    progress.check()?;
    let none = Points::default();
    let texels: Vec<&Points> = atlases.iter().map(|a| a.as_ref().map_or(&none, |a| &a.texels)).collect();
    let painted = vertices::collect(&texels, poses, most.views, shown, &|sum, glimpse| {
        paint::accumulate(sum, glimpse, tolerance);
    })?;
    let finish = |(atlas, sums): (Option<atlas::Atlas>, Vec<[f32; 4]>)| atlas.map(|a| paint::finish(a, &sums));
    Ok(atlases.into_par_iter().zip(painted).map(finish).collect())
}

/// Pixels a scene unit in the views that show a part best: its upper quartile over the vertices,
/// or nothing if no view shows it.
fn finest(sums: &[Sum]) -> Option<f32> {
    let mut all: Vec<f32> = sums.iter().map(|s| s.finest).filter(|f| *f > 0.0).collect();
    let at = all.len() * 3 / 4;
    (!all.is_empty()).then(|| *all.select_nth_unstable_by(at, f32::total_cmp).1)
}
