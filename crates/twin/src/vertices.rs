//! What pixels say about the points of surfaces that they may show.

use crate::Observation;
use glam::{Mat3, Vec3};
use hingecast_geom::{Pose, Projection, TriMesh};
use rayon::prelude::*;

/// Shows at most so many observations to a visitor, evenly chosen, in batches.
pub type Shown<'a, E> = dyn Fn(usize, &mut dyn FnMut(&[Observation])) -> Result<(), E> + 'a;

/// Points of a part's surface, in the frame in which it is stored.
#[derive(Default)]
pub struct Points {
    /// Positions, scene units. (n, 3)
    pub at: Vec<Vec3>,
    /// Unit normals. (n, 3)
    pub normals: Vec<Vec3>,
}

impl Points {
    /// The vertices of a mesh.
    pub fn of(mesh: &TriMesh) -> Self {
        Self { at: mesh.vertices.clone(), normals: mesh.vertex_normals() }
    }

    /// Point `i`, of `part`, before the pixel of `seen` that it falls on, if that is in the picture. `camera`:
    /// the projection of `seen` from the frame in which the points are stored.
    pub fn before<'a>(&self, i: usize, part: usize, seen: &'a Observation, camera: &Projection) -> Option<Glimpse<'a>> {
        let x = camera.to_camera(self.at[i]);
        let pixel = camera.pixel(x)?;
        Some(Glimpse { seen, part: part as u8, pixel, x, normal: camera.rot * self.normals[i], rot: camera.rot })
    }
}

/// A point before a pixel: in front of the camera and in the picture, but perhaps behind
/// something.
pub struct Glimpse<'a> {
    /// The observation that the pixel belongs to.
    pub seen: &'a Observation,
    /// Part id of the point.
    pub part: u8,
    /// The pixel it falls on.
    pub pixel: usize,
    /// Position of the point, camera frame, scene units.
    pub x: Vec3,
    /// Unit normal of the point, camera frame.
    pub normal: Vec3,
    /// Camera frame from canonical frame.
    pub rot: Mat3,
}

/// Lets the points of all parts collect what at most `views` observations `say`.
/// `poses[state][part]`: world from canonical. [part][point]
///
/// # Errors
/// What `shown` answers.
pub fn collect<T: Clone + Default + Send, E>(
    points: &[&Points],
    poses: &[Vec<Pose>],
    views: usize,
    shown: &Shown<E>,
    say: &(dyn Fn(&mut T, &Glimpse) + Sync),
) -> Result<Vec<Vec<T>>, E> {
    let mut all: Vec<Vec<T>> = points.iter().map(|p| vec![T::default(); p.at.len()]).collect();
    shown(views, &mut |batch| {
        for (part, (points, all)) in points.iter().zip(&mut all).enumerate() {
            for seen in batch {
                let camera = Projection::new(&seen.camera, &poses[seen.state][part]);
                all.par_iter_mut().enumerate().with_min_len(1024).for_each(|(i, own)| {
                    if let Some(glimpse) = points.before(i, part, seen, &camera) {
                        say(own, &glimpse);
                    }
                });
            }
        }
    })?;
    Ok(all)
}
