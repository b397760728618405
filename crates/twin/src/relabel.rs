//! Parts for pixels that no canonical gaussian explains: surface that was hidden in the first state (the inside
//! of a drawer, the back of a door).
//!
//! Each such point is carried along with every part in turn into the other states. Where some camera looks
//! through it, it cannot belong to that part; where a surface is measured at it, it may.

use crate::{BACKGROUND, Observation, UNKNOWN};
use glam::DVec3;
use hingecast_geom::Pose;
use rayon::prelude::*;
use std::collections::BTreeMap;

/// Views of a state that are asked; more say little that is new.
const VIEWS_PER_STATE: usize = 16;

/// What the other states say about one point under one part's motion.
#[derive(Clone, Copy, Default)]
struct Verdict {
    against: u32,
    support: u32,
}

/// Gives unknown pixels that have depth the part with the fewest contradictions, then the most support; ties go to
/// the lowest part (the root). `labels[i]` are those of observation `i`; `poses[state][part]` world from canonical;
/// `cell` is the edge of the cubes in which points are judged together, scene units.
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
    // Cells of unknown surface per state: sum of points, count.
    let observations = (0..labels.len()).into_par_iter().map(load).collect::<Result<Vec<_>, E>>()?;
    let mut cells: Vec<BTreeMap<[i32; 3], (DVec3, f64)>> = vec![BTreeMap::new(); poses.len()];
    for (seen, labels) in observations.iter().zip(labels.iter()) {
        for_unknown(seen, labels, &mut |_, x| {
            let slot = cells[seen.state].entry(key(x, cell)).or_insert((DVec3::ZERO, 0.0));
            slot.0 += x;
            slot.1 += 1.0;
        });
    }
    let mut witnesses: Vec<Vec<(&Observation, &Vec<u8>)>> = vec![Vec::new(); poses.len()];
    for (seen, labels) in observations.iter().zip(labels.iter()) {
        witnesses[seen.state].push((seen, labels));
    }
    for list in &mut witnesses {
        let step = list.len().div_ceil(VIEWS_PER_STATE).max(1);
        *list = list.iter().step_by(step).copied().collect();
    }
    let verdicts: Vec<BTreeMap<[i32; 3], u8>> = cells
        .par_iter()
        .enumerate()
        .map(|(state, cells)| {
            let judge = |x: DVec3| {
                let verdict = |part: usize| {
                    let canonical = poses[state][part].inverse().apply(x);
                    (0..poses.len())
                        .filter(|s| *s != state)
                        .map(|s| ask(poses[s][part].apply(canonical), &witnesses[s], cell))
                        .fold(Verdict::default(), |a, b| Verdict {
                            against: a.against + b.against,
                            support: a.support + b.support,
                        })
                };
                let all: Vec<Verdict> = (0..n_parts).map(verdict).collect();
                (0..n_parts).min_by_key(|p| (all[*p].against, u32::MAX - all[*p].support, *p)).unwrap_or(0) as u8
            };
            cells.iter().map(|(k, (sum, n))| (*k, judge(*sum / *n))).collect()
        })
        .collect();
    drop(witnesses);
    labels.par_iter_mut().zip(&observations).for_each(|(labels, seen)| {
        let mut found = Vec::new();
        for_unknown(seen, labels, &mut |i, x| {
            if let Some(part) = verdicts[seen.state].get(&key(x, cell)) {
                found.push((i, *part));
            }
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

/// Calls `emit(pixel, world point)` for every unknown pixel with depth.
fn for_unknown(seen: &Observation, labels: &[u8], emit: &mut dyn FnMut(usize, DVec3)) {
    let c = &seen.camera;
    let world_from_camera = c.camera_from_world.inverse();
    for (i, label) in labels.iter().enumerate() {
        let z = seen.depth[i] as f64;
        if *label == UNKNOWN && z > 0.0 {
            let (u, v) = ((i % c.width) as f64 + 0.5, (i / c.width) as f64 + 0.5);
            emit(i, world_from_camera.apply(DVec3::new((u - c.cx) / c.fx, (v - c.cy) / c.fy, 1.0) * z));
        }
    }
}

/// One state's answer about a world point: one vote against when a camera sees through it, else one vote for when a
/// camera measures a surface there.
fn ask(x: DVec3, witnesses: &[(&Observation, &Vec<u8>)], tolerance: f64) -> Verdict {
    let (mut through, mut hit) = (0, 0);
    for (seen, labels) in witnesses {
        let (uv, z) = seen.camera.project(x);
        let (w, h) = (seen.camera.width, seen.camera.height);
        if !(z > 0.0 && uv.x >= 0.0 && uv.y >= 0.0 && uv.x < w as f64 && uv.y < h as f64) {
            continue;
        }
        let i = uv.y as usize * w + uv.x as usize;
        let depth = seen.depth[i] as f64;
        if labels[i] == BACKGROUND || depth > z + 2.0 * tolerance {
            through += 1;
        } else if depth > 0.0 && (depth - z).abs() < tolerance {
            hit += 1;
        }
    }
    // One view through is a pixel at an edge; two are a fact.
    let against = through >= 2 && through > hit;
    Verdict { against: against as u32, support: (!against && hit > 0) as u32 }
}
