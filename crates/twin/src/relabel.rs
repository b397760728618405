//! Parts for pixels that no canonical gaussian explains: surface that was hidden in the first state
//! (the inside of a drawer, the back of a door).
//!
//! Each such point is carried along with every part in turn into the other states. Where some
//! camera looks through it, it cannot belong to that part; where a surface is measured at it, it
//! may. Labels that the gaussians gave are put to the same test and lose when the other states
//! clearly prefer another part.

use crate::{BACKGROUND, Observation};
use glam::{DVec3, Vec3};
use hingecast_geom::{Pose, Projection};
use rayon::prelude::*;
use std::collections::BTreeMap;

/// Views of a state that are asked, and states; more say little that is new.
const VIEWS_PER_STATE: usize = 12;
const STATES: usize = 12;

/// A camera of another state, ready to project many points. World frame.
struct Witness<'a> {
    camera: Projection,
    depth: &'a [f32],
    labels: &'a [u8],
}

impl<'a> Witness<'a> {
    fn new(seen: &'a Observation, labels: &'a [u8]) -> Self {
        Self { camera: Projection::new(&seen.camera, &Pose::IDENTITY), depth: &seen.depth, labels }
    }
}

/// What the other states say about one point under one part's motion.
#[derive(Clone, Copy, Default)]
struct Verdict {
    against: u32,
    support: u32,
}

/// Votes (states) by which another part must lead to take a point from the part that the gaussians
/// gave it.
const CLEARLY: u32 = 3;

/// A cube of one state's surface and the label that its points carry.
type Cell = ([i32; 3], u8);

/// Gives unknown pixels that have depth the part with the fewest contradictions, then the most
/// support; ties go to the lowest part (the root). `labels[i]` are those of observation `i`;
/// `poses[state][part]` world from canonical; `cell` is the edge of the cubes in which points are
/// judged together, scene units.
///
/// # Errors
/// What `load` answers.
///
/// # Panics
/// When an observation is of a state without poses.
pub fn resolve<E: Send>(
    labels: &mut [Vec<u8>],
    load: &(dyn Fn(usize) -> Result<Observation, E> + Sync),
    poses: &[Vec<Pose>],
    cell: f64,
) -> Result<(), E> {
    let n_parts = poses.first().map_or(0, Vec::len);
    if n_parts < 2 {
        return Ok(());
    }
    // Cells of surface per state: sum of points, count.
    let observations = (0..labels.len()).into_par_iter().map(load).collect::<Result<Vec<_>, E>>()?;
    let mut cells: Vec<BTreeMap<Cell, (DVec3, f64)>> = vec![BTreeMap::new(); poses.len()];
    for (seen, labels) in observations.iter().zip(labels.iter()) {
        for_surface(seen, labels, &mut |i, x| {
            let slot = cells[seen.state].entry((key(x, cell), labels[i])).or_insert((DVec3::ZERO, 0.0));
            slot.0 += x;
            slot.1 += 1.0;
        });
    }
    let mut by_state: Vec<Vec<usize>> = vec![Vec::new(); poses.len()];
    observations.iter().enumerate().for_each(|(i, seen)| by_state[seen.state].push(i));
    let asked_states: Vec<usize> = (0..poses.len()).step_by(poses.len().div_ceil(STATES).max(1)).collect();
    let asked: Vec<(usize, Vec<Witness>)> = asked_states
        .iter()
        .map(|&state| {
            let step = by_state[state].len().div_ceil(VIEWS_PER_STATE).max(1);
            let views = by_state[state].iter().step_by(step);
            (state, views.map(|&i| Witness::new(&observations[i], &labels[i])).collect())
        })
        .collect();
    let verdicts: Vec<BTreeMap<Cell, u8>> = cells
        .par_iter()
        .enumerate()
        .map(|(state, cells)| {
            // The asked states' poses of each part, relative to this state.
            let there_from_here: Vec<Vec<Pose>> = (0..n_parts)
                .map(|p| asked.iter().map(|(s, _)| poses[*s][p] * poses[state][p].inverse()).collect())
                .collect();
            let judge = |x: DVec3, label: u8| {
                let verdict = |part: usize| {
                    let others = asked.iter().zip(&there_from_here[part]).filter(|((s, _), _)| *s != state);
                    others.map(|((_, views), pose)| ask(pose.apply(x).as_vec3(), views, cell as f32)).fold(
                        Verdict::default(),
                        |a, b| Verdict { against: a.against + b.against, support: a.support + b.support },
                    )
                };
                let all: Vec<Verdict> = (0..n_parts).map(verdict).collect();
                let best = (0..n_parts).min_by_key(|p| (all[*p].against, u32::MAX - all[*p].support, *p)).unwrap_or(0);
                match all.get(label as usize) {
                    // A given label stays unless the other states clearly prefer another part.
                    Some(own)
                        if own.against + CLEARLY > all[best].against && own.support + CLEARLY > all[best].support =>
                    {
                        label
                    }
                    _ => best as u8,
                }
            };
            cells.iter().map(|(k, (sum, n))| (*k, judge(*sum / *n, k.1))).collect()
        })
        .collect();
    drop(asked);
    labels.par_iter_mut().zip(&observations).for_each(|(labels, seen)| {
        let mut found = Vec::new();
        for_surface(seen, labels, &mut |i, x| match verdicts[seen.state].get(&(key(x, cell), labels[i])) {
            Some(part) if *part != labels[i] => found.push((i, *part)),
            _ => {}
        });
        for (i, part) in found {
            labels[i] = part;
        }
    });
    Ok(())
}

fn key(x: DVec3, cell: f64) -> [i32; 3] {
    (x / cell).floor().as_ivec3().to_array()
}

/// Calls `emit(pixel, world point)` for every pixel of the object with depth.
fn for_surface(seen: &Observation, labels: &[u8], emit: &mut dyn FnMut(usize, DVec3)) {
    let world_from_camera = seen.camera.camera_from_world.inverse();
    for (i, label) in labels.iter().enumerate() {
        if *label != BACKGROUND && seen.depth[i] > 0.0 {
            emit(i, world_from_camera.apply(seen.camera_point(i)));
        }
    }
}

/// One state's answer about a world point: one vote against when a camera sees through it, else one
/// vote for when a camera measures a surface there.
fn ask(x: Vec3, witnesses: &[Witness], tolerance: f32) -> Verdict {
    let (mut through, mut hit) = (0, 0);
    for w in witnesses {
        let x = w.camera.to_camera(x);
        let Some(i) = w.camera.pixel(x) else { continue };
        let depth = w.depth[i];
        if w.labels[i] == BACKGROUND || depth > x.z + 2.0 * tolerance {
            through += 1;
        } else if depth > 0.0 && (depth - x.z).abs() < tolerance {
            hit += 1;
        }
    }
    // One view through is a pixel at an edge; two are a fact.
    let against = through >= 2 && through > hit;
    Verdict { against: against as u32, support: (!against && hit > 0) as u32 }
}
