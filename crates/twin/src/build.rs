//! The stage: observations and tree in, [`Twin`] out.

use crate::field::Field;
use crate::vertices::Points;
use crate::{
    Inertial, Observation, PartModel, Twin, clearance, color, exposure, fuse, hulls, mass, pieces, separate, simplify,
    snap, solid, surface, texture, vertices,
};
use glam::{DMat3, DVec3};
use hingecast_geom::{Cancelled, KinematicTree, Pose, Progress, TriMesh};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

/// How fine, how heavy. Lengths are shares of the object's diagonal so that glasses and fridges get
/// the same care.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Config {
    /// Voxel edge / diagonal. 1/256 is about half a pixel of a 256² picture that the object fills.
    pub voxel: f64,
    /// kg/m^3 of the solid; the default is light wood and hollow plastic.
    pub density: f64,
    /// Faces of the visual mesh of one part.
    pub max_faces: usize,
    /// Simplification may move the surface by this share of the diagonal.
    pub simplify_error: f64,
    /// Convex pieces of one part.
    pub max_hulls: u32,
    /// Pieces of surface smaller than this share of the part's largest piece are dropped, unless
    /// views agree on them.
    pub crumbs: f64,
    /// At most this many images colour the surface.
    pub color_views: usize,
    /// Texels of the picture of one part, at most; 0: colours of vertices alone.
    pub max_texels: usize,
}

/// At most this many images say where the surface is exactly, and a pixel speaks for what lies
/// within this many voxels of its plane.
const SNAP_VIEWS: usize = 480;
const SNAP_REACH: f32 = 1.5;
/// Collision pieces may stand out of the surface by so many voxels: it is known no better.
const REACH: f32 = 0.5;
/// Share of the collision volume that may be cut away without a word.
const LOST: f64 = 0.02;

impl Default for Config {
    fn default() -> Self {
        Self {
            voxel: 1.0 / 256.0,
            density: 500.0,
            max_faces: 20_000,
            simplify_error: 5e-4,
            max_hulls: 24,
            crumbs: 0.02,
            color_views: 160,
            max_texels: 4_000_000,
        }
    }
}

/// What `build` reads besides the observations.
pub struct Input<'a> {
    /// Name of the object, as the simulator files get it.
    pub name: &'a str,
    /// Parts and joints; every joint has a value for every state.
    pub tree: &'a KinematicTree,
    /// States of the recording: a tree without joints does not tell.
    pub n_states: usize,
    /// Number of observations; `load(i)` is called up to seven times for each.
    pub n_observations: usize,
    /// Diagonal of the object's box in the first state, scene units.
    pub diagonal: f64,
    /// Lengths are metres; otherwise scene units.
    pub metric: bool,
    /// Unit vector that points up in the world.
    pub up: DVec3,
}

/// Fuses, meshes, colours, decomposes and weighs every part.
///
/// # Errors
/// What `load` answers, or [`Cancelled`].
///
/// # Panics
/// When a joint has fewer values than `n_states`, or an observation is of a state beyond them.
pub fn build<E: From<Cancelled> + Send>(
    input: &Input,
    load: &(dyn Fn(usize) -> Result<Observation, E> + Sync),
    config: &Config,
    progress: &Progress,
) -> Result<Twin, E> {
    let tree = input.tree;
    let poses: Vec<Vec<Pose>> = (0..input.n_states).map(|s| tree.poses_at(s)).collect();
    let voxel = (config.voxel * input.diagonal) as f32;
    let volumes = fuse::fuse(input.n_observations, load, &poses, voxel, progress)?;

    let order = solid::leaves_first(tree);
    let fields = solid::fields(volumes, tree, &poses);
    progress.check()?;

    let shown = |most: usize, visit: &mut dyn FnMut(&[Observation])| -> Result<(), E> {
        let n = input.n_observations;
        let used = n.min(most.max(1));
        for batch in (0..used).map(|k| k * n / used).collect::<Vec<_>>().chunks(32) {
            progress.check()?;
            visit(&batch.par_iter().map(|&i| load(i)).collect::<Result<Vec<_>, E>>()?);
        }
        Ok(())
    };
    let mut doubts = Vec::new();
    let fine = |field: &Field| surface::drop_crumbs(&surface::extract(field), config.crumbs, &|x| field.firm_near(x));
    let simple =
        |fine: &TriMesh| simplify::simplify(fine, config.max_faces, (config.simplify_error * input.diagonal) as f32);
    let mut meshes: Vec<TriMesh> = fields.par_iter().map(|f| f.as_ref().map_or_else(TriMesh::default, fine)).collect();
    // For mass and collision, where a sheet should stay as thick as the grid makes it.
    let thick: Vec<TriMesh> = meshes.par_iter().map(simple).collect();
    let points: Vec<Points> = meshes.iter().map(Points::of).collect();
    let pulls = vertices::collect(&points.iter().collect::<Vec<_>>(), &poses, SNAP_VIEWS, &shown, &|pull, glimpse| {
        snap::accumulate(pull, glimpse, SNAP_REACH * voxel);
    })?;
    meshes.iter_mut().zip(&pulls).for_each(|(mesh, pulls)| snap::finish(mesh, pulls, voxel));
    meshes = meshes.par_iter().map(simple).collect();
    // Root first, then along the tree: every part keeps clear of those before it, also between
    // recorded states.
    let path: Vec<Vec<Pose>> = poses.iter().cloned().chain(solid::sweeps(tree, CLEARED)).collect();
    let collision: Vec<TriMesh> = (0..fields.len())
        .into_par_iter()
        .map(|part| {
            let before = order.iter().rev().take_while(|&&q| q != part).copied().collect::<Vec<_>>();
            if before.is_empty() {
                return thick[part].clone();
            }
            clearance::trim(part, &fields, &before, &path).map_or_else(TriMesh::default, |f| simple(&fine(&f)))
        })
        .collect();
    drop(fields);
    let points: Vec<Points> = meshes.iter().map(Points::of).collect();
    let tolerance = 2.0 * voxel;
    let gains = exposure::gains(&points, &poses, config.color_views, tolerance, &shown)?;
    let evened = |most: usize, visit: &mut dyn FnMut(&[Observation])| -> Result<(), E> {
        let mut next = 0;
        shown(most, &mut |batch| {
            visit(&exposure::evened(batch, &gains[next..]));
            next += batch.len();
        })
    };
    let sums =
        vertices::collect(&points.iter().collect::<Vec<_>>(), &poses, config.color_views, &evened, &|sum, glimpse| {
            color::accumulate(sum, glimpse, tolerance);
        })?;
    meshes.iter_mut().zip(&sums).for_each(|(mesh, sums)| color::finish(mesh, sums));
    let most = texture::Most { texels: config.max_texels, views: config.color_views };
    let textures = texture::paint(&meshes, &sums, &poses, &most, tolerance, &evened, progress)?;

    let closely = pieces::Config { reach: REACH * voxel, most: config.max_hulls as usize };
    let decomposed: Vec<(Vec<TriMesh>, usize)> =
        collision.par_iter().map(|mesh| hulls::decompose(mesh, &closely)).collect();
    let (mut pieces, flat): (Vec<Vec<TriMesh>>, Vec<usize>) = decomposed.into_iter().unzip();
    let root_first: Vec<usize> = order.iter().rev().copied().collect();
    let solid = |pieces: &[Vec<TriMesh>]| pieces.iter().flatten().map(|h| h.mass_integrals().volume).sum::<f64>();
    let before = solid(&pieces);
    let lost = separate::separate(&mut pieces, &root_first, &path, 0.1 * voxel, |_, _| true);
    let share = 1.0 - solid(&pieces) / before.max(1e-30);
    if lost > 0 && share > LOST {
        doubts.push(format!(
            "{lost} collision pieces lay inside other parts and were dropped; with what was cut off others, {:.0} % of the volume",
            100.0 * share
        ));
    }
    let mut parts = Vec::new();
    let surfaces = meshes.into_iter().zip(textures);
    for (part, ((mesh, texture), (hulls, dropped))) in surfaces.zip(pieces.into_iter().zip(flat)).enumerate() {
        let name = &tree.parts[part];
        if mesh.is_empty() {
            doubts.push(format!("part '{name}' has no surface: no depth pixel carries its label"));
        } else if hulls.is_empty() {
            doubts.push(format!("part '{name}' has no collision hull: its surface is too thin or open"));
        } else if dropped * 4 > hulls.len() {
            doubts.push(format!(
                "part '{name}': {dropped} flat collision pieces of {} were dropped",
                dropped + hulls.len()
            ));
        }
        let (inertial, doubt) = if mesh.is_empty() {
            (Inertial { mass: 1e-3, com: DVec3::ZERO, inertia: DMat3::IDENTITY * 1e-6 }, None)
        } else {
            mass::inertial(&thick[part], &hulls, config.density)
        };
        if let Some(doubt) = doubt {
            doubts.push(format!("part '{name}': {doubt}"));
        }
        parts.push(PartModel { name: name.clone(), mesh, texture, hulls, inertial });
    }
    Ok(Twin {
        name: input.name.to_string(),
        tree: tree.clone(),
        parts,
        doubts,
        certainty: vec![None; tree.joints.len()],
        diagonal: input.diagonal,
        metric: input.metric,
        up: input.up,
    })
}

/// Steps over a joint's range in which collision shapes are kept clear.
const CLEARED: usize = 40;
