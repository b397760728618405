//! The stage: observations and tree in, [`Twin`] out.

use crate::fuse::{self, Field};
use crate::slabs::Slabs;
use crate::{Inertial, Observation, PartModel, Twin, clearance, color, hulls, mass, separate, simplify, surface};
use glam::{DMat3, DVec3, Vec3};
use hingecast_geom::{Cancelled, KinematicTree, Pose, Progress, TriMesh};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

/// How fine, how heavy. Lengths are shares of the object's diagonal so that glasses and fridges get the same care.
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
    /// Pieces of surface smaller than this share of the part's largest piece are dropped, unless views agree on them.
    pub crumbs: f64,
    /// At most this many images colour the vertices.
    pub color_views: usize,
}

/// Share of the collision volume that may be cut away without a word.
const LOST: f64 = 0.02;

impl Default for Config {
    fn default() -> Self {
        Self {
            voxel: 1.0 / 256.0,
            density: 500.0,
            max_faces: 20_000,
            simplify_error: 5e-4,
            max_hulls: 48,
            crumbs: 0.02,
            color_views: 160,
        }
    }
}

/// What `build` reads besides the observations.
pub struct Input<'a> {
    pub name: &'a str,
    pub tree: &'a KinematicTree,
    /// States of the recording: a tree without joints does not tell.
    pub n_states: usize,
    /// Number of observations; `load(i)` is called up to three times for each.
    pub n_observations: usize,
    /// Diagonal of the object's box in the first state, scene units.
    pub diagonal: f64,
    pub metric: bool,
    pub up: DVec3,
}

/// Fuses, meshes, colours, decomposes and weighs every part.
///
/// # Errors
/// What `load` answers, or [`Cancelled`].
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

    // Leaves first: what a drawer fills is not the cabinet's, where no ray can tell.
    let mut order: Vec<usize> = (0..tree.parts.len()).collect();
    order.sort_by_key(|&p| std::cmp::Reverse(tree.ancestry(p).len()));
    let mut fields: Vec<Option<(Field, Slabs)>> = (0..tree.parts.len()).map(|_| None).collect();
    // A part also empties what it passes through between the states, in the parts that carry it.
    let swept: Vec<Vec<Pose>> = poses.iter().cloned().chain(sweeps(tree, BETWEEN)).collect();
    let carried = |part: usize, by: usize| tree.ancestry(part).iter().any(|&j| tree.joints[j].parent == by);
    for &part in &order {
        let Some(volume) = &volumes[part] else { continue };
        let relative: Vec<(usize, Vec<Pose>)> = (0..fields.len())
            .filter(|&q| fields[q].is_some())
            .map(|q| (q, if carried(q, part) { &swept } else { &poses }))
            .map(|(q, path)| (q, path.iter().map(|at| at[q].inverse() * at[part]).collect()))
            .collect();
        // Far from what is seen of this part, the hollow of the other is empty as well: nothing of a cabinet is in its drawer.
        let taken = |x: Vec3, deep: bool| {
            relative.iter().any(|(q, q_from_part)| {
                let (field, hull) = fields[*q].as_ref().expect("filtered");
                q_from_part.iter().any(|pose| {
                    let x = pose.apply(x.as_dvec3()).as_vec3();
                    field.at(x) < 0.0 || deep && hull.hold(x)
                })
            })
        };
        let field = volume.field(&taken, tree.joint_of(part).is_some());
        let hull = field.hull();
        fields[part] = Some((field, hull));
    }
    let fields: Vec<Option<Field>> = fields.into_iter().map(|f| Some(f?.0)).collect();
    progress.check()?;

    let mut doubts = Vec::new();
    let mesh_of = |field: &Field| {
        let fine = surface::drop_crumbs(&surface::extract(field), config.crumbs, &|x| field.firm_near(x));
        simplify::simplify(&fine, config.max_faces, (config.simplify_error * input.diagonal) as f32)
    };
    let mut meshes: Vec<TriMesh> =
        fields.par_iter().map(|f| f.as_ref().map_or_else(TriMesh::default, mesh_of)).collect();
    // Root first, then along the tree: every part keeps clear of those before it, also between recorded states.
    let path: Vec<Vec<Pose>> = poses.iter().cloned().chain(sweeps(tree, CLEARED)).collect();
    let collision: Vec<TriMesh> = (0..fields.len())
        .into_par_iter()
        .map(|part| {
            let before = order.iter().rev().take_while(|&&q| q != part).copied().collect::<Vec<_>>();
            if before.is_empty() {
                return meshes[part].clone();
            }
            clearance::trim(part, &fields, &before, &path).map_or_else(TriMesh::default, |f| mesh_of(&f))
        })
        .collect();
    drop(fields);
    colour(&mut meshes, input, load, &poses, config, voxel, progress)?;

    let hull_config = hulls::HullConfig { max_hulls: config.max_hulls, ..Default::default() };
    let decomposed: Vec<(Vec<TriMesh>, usize)> =
        collision.par_iter().map(|mesh| hulls::decompose(mesh, &hull_config)).collect();
    let (mut pieces, flat): (Vec<Vec<TriMesh>>, Vec<usize>) = decomposed.into_iter().unzip();
    let root_first: Vec<usize> = order.iter().rev().copied().collect();
    let solid = |pieces: &[Vec<TriMesh>]| pieces.iter().flatten().map(|h| h.mass_integrals().volume).sum::<f64>();
    let before = solid(&pieces);
    let lost = separate::separate(&mut pieces, &root_first, &path, 0.1 * voxel);
    let share = 1.0 - solid(&pieces) / before.max(1e-30);
    if lost > 0 && share > LOST {
        doubts.push(format!(
            "{lost} collision pieces lay inside other parts and were dropped; with what was cut off others, {:.0} % of the volume",
            100.0 * share
        ));
    }
    let mut parts = Vec::new();
    for (part, (mesh, (hulls, dropped))) in meshes.into_iter().zip(pieces.into_iter().zip(flat)).enumerate() {
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
            mass::inertial(&mesh, &hulls, config.density)
        };
        if let Some(doubt) = doubt {
            doubts.push(format!("part '{name}': {doubt}"));
        }
        parts.push(PartModel { name: name.clone(), mesh, hulls, inertial });
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

/// Steps over a joint's range in which a part empties what it passes through: the back of a drawer is a thin board.
const BETWEEN: usize = 120;
/// Steps over a joint's range in which collision shapes are kept clear.
const CLEARED: usize = 40;

/// Each joint in turn over its range in small steps, the others as in the first state. [pose][part]
fn sweeps(tree: &KinematicTree, steps: usize) -> Vec<Vec<Pose>> {
    let Some(first) = tree.joints.iter().map(|j| j.values.first().copied()).collect::<Option<Vec<f64>>>() else {
        return Vec::new();
    };
    let mut out = Vec::new();
    for (j, joint) in tree.joints.iter().enumerate() {
        for k in 0..=steps {
            let mut q = first.clone();
            q[j] = joint.limits[0] + (joint.limits[1] - joint.limits[0]) * k as f64 / steps as f64;
            out.push(tree.poses(&q));
        }
    }
    out
}

fn colour<E: From<Cancelled> + Send>(
    meshes: &mut [TriMesh],
    input: &Input,
    load: &(dyn Fn(usize) -> Result<Observation, E> + Sync),
    poses: &[Vec<Pose>],
    config: &Config,
    voxel: f32,
    progress: &Progress,
) -> Result<(), E> {
    let n = input.n_observations;
    let used = n.min(config.color_views.max(1));
    let chosen: Vec<usize> = (0..used).map(|k| k * n / used.max(1)).collect();
    let normals: Vec<Vec<Vec3>> = meshes.iter().map(TriMesh::vertex_normals).collect();
    let mut sums: Vec<Vec<[f32; 4]>> = meshes.iter().map(|m| vec![[0.0; 4]; m.vertices.len()]).collect();
    for batch in chosen.chunks(32) {
        progress.check()?;
        let seen = batch.par_iter().map(|&i| load(i)).collect::<Result<Vec<_>, E>>()?;
        for (part, mesh) in meshes.iter().enumerate() {
            let at: Vec<Pose> = seen.iter().map(|o| poses[o.state][part]).collect();
            color::accumulate(&mut sums[part], mesh, &normals[part], part as u8, &seen, &at, 2.0 * voxel);
        }
    }
    for (mesh, sums) in meshes.iter_mut().zip(&sums) {
        color::finish(mesh, sums);
    }
    Ok(())
}
