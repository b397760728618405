//! What pixels say about the vertices that they may show.

use crate::Observation;
use glam::{Mat3, Vec3};
use hingecast_geom::{Pose, Projection, TriMesh};
use rayon::prelude::*;

/// Shows at most so many observations to a visitor, evenly chosen, in batches.
pub type Shown<'a, E> = dyn Fn(usize, &mut dyn FnMut(&[Observation])) -> Result<(), E> + 'a;

/// A vertex before a pixel: in front of the camera and in the picture, but perhaps behind
/// something.
pub struct Glimpse<'a> {
    /// The observation that the pixel belongs to.
    pub seen: &'a Observation,
    /// Part id of the vertex.
    pub part: u8,
    /// The pixel it falls on.
    pub pixel: usize,
    /// Position of the vertex, camera frame, scene units.
    pub x: Vec3,
    /// Unit normal of the vertex, camera frame.
    pub normal: Vec3,
    /// Camera frame from canonical frame.
    pub rot: Mat3,
}

/// Lets the vertices of all parts collect what at most `views` observations `say`.
/// `poses[state][part]`: world from canonical. [part][vertex]
///
/// # Errors
/// What `shown` answers.
pub fn collect<T: Clone + Default + Send, E>(
    meshes: &[TriMesh],
    poses: &[Vec<Pose>],
    views: usize,
    shown: &Shown<E>,
    say: &(dyn Fn(&mut T, &Glimpse) + Sync),
) -> Result<Vec<Vec<T>>, E> {
    let normals: Vec<Vec<Vec3>> = meshes.iter().map(TriMesh::vertex_normals).collect();
    let mut all: Vec<Vec<T>> = meshes.iter().map(|m| vec![T::default(); m.vertices.len()]).collect();
    shown(views, &mut |batch| {
        for (part, (mesh, all)) in meshes.iter().zip(&mut all).enumerate() {
            for seen in batch {
                let camera = Projection::new(&seen.camera, &poses[seen.state][part]);
                all.par_iter_mut().enumerate().with_min_len(1024).for_each(|(i, own)| {
                    let x = camera.to_camera(mesh.vertices[i]);
                    if let Some(pixel) = camera.pixel(x) {
                        let normal = camera.rot * normals[part][i];
                        say(own, &Glimpse { seen, part: part as u8, pixel, x, normal, rot: camera.rot });
                    }
                });
            }
        }
    })?;
    Ok(all)
}
