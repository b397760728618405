//! A PartNet-Mobility (or other) URDF -> a folder that a simulator runs: MJCF and URDF with convex
//! collision pieces, joints, limits, masses. Says what it changed.
//!
//! Lengths, axes and the zero of every joint stay those that `synth` records, so a twin of the
//! object and the object itself have one base frame. Surfaces of such objects are open sheets in
//! many shells: each shell that is small against its part (a handle, a knob) is decomposed by
//! itself, where the voxels of the whole part would swallow it.

use crate::failure::Result;
use glam::{DVec3, Vec3};
use hingecast_capture::object::{ArticulatedObject, PartGeometry};
use hingecast_capture::synth::{UsefulRange, useful_ranges};
use hingecast_geom::folder::{may_be_emptied, may_become};
use hingecast_geom::{JointKind, KinematicTree, Progress, TriMesh};
use hingecast_twin::hulls::{convex, decompose};
use hingecast_twin::link::touching;
use hingecast_twin::pieces;
use hingecast_twin::separate::separate;
use hingecast_twin::{Inertial, PartModel, Twin, mass};
use rayon::prelude::*;
use serde::Serialize;
use std::collections::HashMap;
use std::path::Path;
use std::sync::atomic::{AtomicUsize, Ordering};

/// A shell below this share of its part's diagonal is a detail with pieces of its own.
const DETAIL: f32 = 0.35;
/// Shells smaller than this share of the object's diagonal (screws, letters) collide with nothing
/// that matters.
const CRUMB: f64 = 0.01;
/// The most convex shells of a part that are pieces as they are.
const MOST_CONVEX: usize = 64;
/// The most details of a part that get pieces of their own, largest first.
const MOST_DETAILS: usize = 24;
/// The most convex pieces of a part's concave rest, and of one detail.
const MOST_PIECES: usize = 24;
const MOST_OF_DETAIL: usize = 8;
/// How far pieces may stand out of a surface, share of its diagonal.
const REACH: f32 = 0.003;

/// How an object is made fit for the simulator.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct ImportConfig {
    /// Units of the new files per unit of the old one.
    pub scale: f64,
    /// kg/m^3 in the new units.
    pub density: f64,
}

impl Default for ImportConfig {
    fn default() -> Self {
        Self { scale: 1.0, density: 600.0 }
    }
}

/// What was written.
#[derive(Clone, Debug, Serialize)]
pub struct Imported {
    /// Number of parts, the base included.
    pub parts: usize,
    /// Names of the joints.
    pub joints: Vec<String>,
    /// Convex pieces of all parts.
    pub hulls: usize,
    /// Of all parts, kg.
    pub mass: f64,
    /// Of the object, scene units.
    pub diagonal: f64,
    /// What is not as in the source, as sentences.
    pub changes: Vec<String>,
}

/// Converts `source` into the folder `out`.
///
/// # Errors
/// When the source cannot be read, or `out` holds something else.
pub fn import(source: &Path, out: &Path, config: &ImportConfig, progress: &Progress) -> Result<Imported> {
    may_become("output folder", out, &["twin.json"], "give a new folder")?;
    may_be_emptied("output folder", out, &hingecast_twin::is_ours, "give a new folder, or empty this one yourself")?;
    let mut object = crate::objects::load(source)?;
    let mut changes = std::mem::take(&mut object.notes);
    // The ranges that `synth` plays: files let doors swing through their cabinets.
    let useful = useful_ranges(&object);
    let mut useful = useful;
    for (joint, range) in object.tree.joints.iter_mut().zip(&mut useful) {
        let [from, to] = joint.limits;
        if joint.screw.kind == JointKind::Continuous {
            *range = UsefulRange { lower: from, upper: to, behind: false };
            continue;
        }
        if (range.upper - range.lower).abs() < STUCK * (to - from) {
            // A button that sinks into its body, a lid modelled inside its neck.
            changes.push(format!(
                "joint '{}' runs into its neighbours' surface at once: the file's {from:.3} .. {to:.3} stay",
                joint.name
            ));
            *range = UsefulRange { lower: from, upper: to, behind: false };
            continue;
        }
        let limits = [range.lower.min(range.upper), range.lower.max(range.upper)];
        if limits.iter().zip(joint.limits).any(|(a, b)| (a - b).abs() > 1e-6) {
            changes.push(format!(
                "joint '{}' may go {:.3} .. {:.3}, not {from:.3} .. {to:.3}",
                joint.name, limits[0], limits[1]
            ));
            joint.limits = limits;
        }
    }
    rescale(&mut object, config.scale);
    let useful: Vec<UsefulRange> = useful
        .into_iter()
        .zip(&object.tree.joints)
        .map(|(range, joint)| {
            let unit = if joint.screw.kind.turns() { 1.0 } else { config.scale };
            UsefulRange { lower: range.lower * unit, upper: range.upper * unit, ..range }
        })
        .collect();
    if config.scale != 1.0 {
        changes.push(format!("all lengths times {}", config.scale));
    }
    for c in object.tree.couplings.iter().filter(|c| c.line().is_none()) {
        let [a, b] = [c.follower, c.leader].map(|j| object.tree.joints[j].name.as_str());
        changes.push(format!("joint '{a}' follows '{b}' along a curve: robot.xml says so, robot.urdf cannot"));
    }
    let merged: Vec<String> = object
        .tree
        .parts
        .iter()
        .zip(&object.parts)
        .filter(|(_, p)| p.links.len() > 1)
        .map(|(name, p)| format!("{name} ({} links)", p.links.len()))
        .collect();
    if !merged.is_empty() {
        changes.push(format!("links joined by fixed or minor joints became one part: {}", merged.join(", ")));
    }
    if object.textures.iter().len() > 0 {
        changes.push("textures became one colour a part; shapes keep their materials' colours".into());
    }
    changes.push(format!("masses and inertias come from {} kg/m^3: the source's are not read", config.density));
    changes.push(
        "the part and its parent do not collide with each other: convex pieces of both overlap at the joint".into(),
    );

    let diagonal = object.diagonal();
    let (done, total) = (AtomicUsize::new(0), object.parts.len());
    let parts: Vec<(PartModel, Option<String>)> = object
        .parts
        .par_iter()
        .zip(&object.tree.parts)
        .map(|(geometry, name)| {
            let mesh = coloured(&object, geometry);
            let hulls = collision(&mesh, diagonal);
            progress.report(done.fetch_add(1, Ordering::Relaxed) + 1, total, name)?;
            // The shells of such a part enclose no one volume; its convex pieces do.
            let (inertial, doubt) = mass::inertial(&TriMesh::default(), &hulls, config.density);
            let doubt = doubt
                .filter(|d| d.contains("guessed"))
                .map(|_| format!("part '{name}': mass guessed, it has no collision piece"));
            Ok((PartModel { name: name.clone(), mesh, texture: None, hulls, inertial }, doubt))
        })
        .collect::<Result<_>>()?;
    let (mut parts, doubts): (Vec<PartModel>, Vec<Option<String>>) = parts.into_iter().unzip();
    let before: usize = parts.iter().map(|p| p.hulls.len()).sum();
    let lost = room_to_move(&object, &useful, &mut parts, diagonal);
    if lost > 0 {
        changes.push(format!("{lost} of {before} collision pieces stood in the way of other parts and were left out"));
    }
    changes.extend(doubts.into_iter().flatten());
    weigh_links(&object.tree, &mut parts);
    for part in parts.iter().filter(|p| p.mesh.is_empty()) {
        changes.push(format!("part '{}' has no surface: a hundredth of what hangs on it is its mass", part.name));
    }
    let hulls = parts.iter().map(|p| p.hulls.len()).sum();
    changes.push(format!("surfaces became {hulls} convex collision pieces"));

    let twin = Twin {
        name: object.name.clone(),
        tree: object.tree.clone(),
        parts,
        doubts: changes.clone(),
        certainty: vec![None; object.tree.joints.len()],
        diagonal,
        metric: object.metric,
        up: DVec3::Z,
    };
    hingecast_twin::write(&twin, None, out)?;
    Ok(Imported {
        parts: twin.parts.len(),
        joints: twin
            .tree
            .joints
            .iter()
            .map(|j| {
                format!("{} ({:?}, {:.3} .. {:.3})", j.name, j.screw.kind, j.limits[0], j.limits[1]).to_lowercase()
            })
            .collect(),
        hulls,
        mass: twin.parts.iter().map(|p| p.inertial.mass).sum(),
        diagonal,
        changes,
    })
}

/// A part of nothing between two joints still needs a mass: a hundredth of what it carries.
fn weigh_links(tree: &KinematicTree, parts: &mut [PartModel]) {
    let mut order: Vec<usize> = (0..parts.len()).filter(|&p| parts[p].mesh.is_empty()).collect();
    // What hangs farther out first: chains of such parts.
    order.sort_by_key(|&p| std::cmp::Reverse(tree.ancestry(p).len()));
    for part in order {
        if let Some(carried) = tree.joints.iter().find(|j| j.parent == part).map(|j| parts[j.child].inertial) {
            let (mass, inertia) = (0.01 * carried.mass, carried.inertia * 0.01);
            parts[part].inertial = Inertial { mass, inertia, ..carried };
        }
    }
}

/// A joint that the surfaces leave less than this share of its range is not stopped by them: they
/// overlap as they are modelled.
const STUCK: f64 = 0.1;
/// Configurations of a joint's range at which its parts are kept clear of others.
const STOPS: usize = 61;
/// Gap that is left between pieces of different parts, share of the object's diagonal.
const GAP: f64 = 5e-4;

/// Convex pieces reach beyond what they stand for: cut so that no joint is stopped by a neighbour
/// that shares no joint with its part, at any of some stops of its way, all others at 0 (or open,
/// where only that frees it). Answers how many pieces were lost to that.
fn room_to_move(object: &ArticulatedObject, useful: &[UsefulRange], parts: &mut [PartModel], diagonal: f64) -> usize {
    let tree = &object.tree;
    // As the ranges were found: others at 0, or where their limits come nearest to it.
    let rest = |j: usize| 0f64.clamp(tree.joints[j].limits[0], tree.joints[j].limits[1]);
    let others =
        |open: bool| (0..useful.len()).map(|j| if open { useful[j].upper } else { rest(j) }).collect::<Vec<_>>();
    let mut poses = Vec::new();
    for (j, range) in useful.iter().enumerate() {
        for k in 0..STOPS {
            let mut q = others(range.behind);
            q[j] = range.lower + (range.upper - range.lower) * k as f64 / (STOPS - 1) as f64;
            tree.follow(&mut q);
            poses.push(tree.poses(&q));
        }
    }
    let mut order: Vec<usize> = (0..parts.len()).collect();
    order.sort_by_key(|&p| tree.ancestry(p).len());
    let jointed: Vec<[usize; 2]> = touching(tree, |p| parts[p].mesh.is_empty());
    let meet = |a: usize, b: usize| !jointed.contains(&[a, b]) && !jointed.contains(&[b, a]);
    let mut hulls: Vec<Vec<TriMesh>> = parts.iter_mut().map(|p| std::mem::take(&mut p.hulls)).collect();
    let lost = separate(&mut hulls, &order, &poses, (GAP * diagonal) as f32, meet);
    parts.iter_mut().zip(hulls).for_each(|(part, hulls)| part.hulls = hulls);
    lost
}

fn rescale(object: &mut ArticulatedObject, scale: f64) {
    for part in &mut object.parts {
        part.vertices.iter_mut().for_each(|v| *v *= scale as f32);
    }
    let length = |j: usize| if object.tree.joints[j].screw.kind.turns() { 1.0 } else { scale };
    let units: Vec<f64> = (0..object.tree.joints.len()).map(length).collect();
    for c in &mut object.tree.couplings {
        let (follower, leader) = (units[c.follower], units[c.leader]);
        c.polynomial = std::array::from_fn(|k| c.polynomial[k] * follower / leader.powi(k as i32));
    }
    for joint in &mut object.tree.joints {
        joint.screw.pivot *= scale;
        if !joint.screw.kind.turns() {
            joint.limits = joint.limits.map(|l| l * scale);
        }
    }
}

/// The part's surface with its materials' colours at the vertices.
fn coloured(object: &ArticulatedObject, geometry: &PartGeometry) -> TriMesh {
    let mut colors = vec![[180u8; 3]; geometry.vertices.len()];
    for (face, material) in geometry.faces.iter().zip(&geometry.materials) {
        if let Some(m) = object.materials.get(*material as usize) {
            let color = m.color.map(|c| (255.0 * c.clamp(0.0, 1.0)).round() as u8);
            face.iter().for_each(|&v| colors[v as usize] = color);
        }
    }
    TriMesh { vertices: geometry.vertices.clone(), faces: geometry.faces.clone(), colors }
}

/// Convex pieces: details each by itself, the rest together.
fn collision(mesh: &TriMesh, diagonal: f64) -> Vec<TriMesh> {
    let Some((lo, hi)) = mesh.bounds() else { return Vec::new() };
    let part = (hi - lo).length();
    let size = |shell: &TriMesh| shell.bounds().map_or(0.0, |(lo, hi)| (hi - lo).length());
    let mut all: Vec<TriMesh> = shells(mesh).into_iter().filter(|s| f64::from(size(s)) > CRUMB * diagonal).collect();
    all.sort_by(|a, b| size(b).total_cmp(&size(a)));
    // What is convex already is one piece each, the largest first.
    let mut hulls = Vec::new();
    all.retain(|shell| match convex(shell).filter(|_| hulls.len() < MOST_CONVEX) {
        Some(hull) => {
            hulls.push(hull);
            false
        }
        None => true,
    });
    if all.is_empty() {
        return hulls;
    }
    let (mut details, rest): (Vec<TriMesh>, Vec<TriMesh>) = all.into_iter().partition(|s| size(s) < DETAIL * part);
    details.sort_by(|a, b| size(b).total_cmp(&size(a)));
    let mut body = TriMesh::default();
    let spare = details.split_off(details.len().min(MOST_DETAILS));
    // Where everything is small against the whole (a chair of sticks), nothing is a detail.
    let all_small = rest.is_empty();
    for shell in rest.iter().chain(&spare).chain(details.iter().filter(|_| all_small)) {
        body.append(shell);
    }
    let pieces_of = |mesh: &TriMesh, most: usize| {
        let config = pieces::Config { reach: REACH * size(mesh), most };
        decompose(mesh, &config).0
    };
    hulls.extend(pieces_of(&body, MOST_PIECES));
    if !all_small {
        hulls.extend(details.iter().flat_map(|d| pieces_of(d, MOST_OF_DETAIL)));
    }
    hulls
}

/// Connected pieces of the surface; vertices at the same place are one.
fn shells(mesh: &TriMesh) -> Vec<TriMesh> {
    let mut at: HashMap<[u32; 3], u32> = HashMap::new();
    let same: Vec<u32> = mesh
        .vertices
        .iter()
        .enumerate()
        .map(|(i, v)| *at.entry((*v + Vec3::ZERO).to_array().map(f32::to_bits)).or_insert(i as u32))
        .collect();
    let piece = mesh.pieces(|i| same[i as usize]);
    // By the smallest vertex of each shell: the order does not depend on the hash.
    let mut faces: std::collections::BTreeMap<u32, Vec<[u32; 3]>> = std::collections::BTreeMap::new();
    for face in &mesh.faces {
        faces.entry(piece[face[0] as usize]).or_default().push(face.map(|i| same[i as usize]));
    }
    faces
        .into_values()
        .map(|faces| {
            let mut index: HashMap<u32, u32> = HashMap::new();
            let mut vertices = Vec::new();
            let faces = faces
                .into_iter()
                .map(|f| {
                    f.map(|i| {
                        *index.entry(i).or_insert_with(|| {
                            vertices.push(mesh.vertices[i as usize]);
                            vertices.len() as u32 - 1
                        })
                    })
                })
                .collect();
            TriMesh { vertices, faces, colors: Vec::new() }
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn boxes_are_a_piece_each() {
        let mut shelf = TriMesh::cuboid(Vec3::ZERO, Vec3::new(1.0, 0.3, 0.02));
        // No common corner: that would make one shell of them.
        shelf.append(&TriMesh::cuboid(Vec3::new(0.01, 0.01, 0.02), Vec3::new(0.03, 0.29, 0.9)));
        assert_eq!(collision(&shelf, 1.4).iter().map(|h| h.vertices.len()).collect::<Vec<_>>(), [8, 8]);
    }

    #[test]
    fn a_knob_on_a_door_gets_a_piece_of_its_own() {
        let mut door = TriMesh::cuboid(Vec3::ZERO, Vec3::new(1.0, 0.02, 1.5));
        door.append(&TriMesh::cuboid(Vec3::new(0.9, 0.05, 0.7), Vec3::new(0.94, 0.09, 0.74)));
        assert_eq!(shells(&door).len(), 2);
        let hulls = collision(&door, 1.8);
        let knob = hulls.iter().filter_map(TriMesh::bounds).find(|(lo, _)| lo.y > 0.04);
        let (lo, hi) = knob.expect("a piece in front of the door");
        assert!((hi - lo).length() < 0.08, "{lo} {hi}");
    }

    /// Convex pieces of a flap and of the drawer below it overlap as they are decomposed: once
    /// neither could move.
    #[cfg(feature = "mujoco")]
    #[test]
    fn neighbours_do_not_stop_each_other() {
        let text = r#"<mujoco><compiler angle="radian"/><worldbody>
          <body name="case"><geom type="box" size=".2 .2 .01"/><geom type="box" size=".2 .01 .2" pos="0 .2 .2"/>
            <body name="flap" pos="0 0 .2"><joint name="turn" axis="-1 0 0" pos="0 .19 0" range="0 1.4"/>
              <geom type="box" size=".18 .18 .012"/></body>
            <body name="drawer" pos="0 0 .1"><joint name="pull" type="slide" axis="0 -1 0" range="0 .2"/>
              <geom type="box" size=".18 .18 .01"/><geom type="box" size=".18 .01 .096" pos="0 -.17 0"/></body>
          </body></worldbody></mujoco>"#;
        let dir = tempfile::tempdir().unwrap();
        let file = dir.path().join("object.xml");
        std::fs::write(&file, text).unwrap();
        let out = dir.path().join("out");
        let imported = import(&file, &out, &ImportConfig::default(), &Progress::default()).unwrap();
        assert_eq!(imported.parts, 3);
        let check = hingecast_sim::check_file(&out.join("robot.xml"), &Default::default()).unwrap();
        assert_eq!(check.doubts(imported.diagonal), Vec::<String>::new());
        assert!(check.rest_penetration < 1e-3, "{}", check.rest_penetration);
    }
}
