//! The twin folder: `twin.json`, `robot.{urdf,xml,sdf,glb,usda}`, `robosuite.xml` and `robosuite_object.py`,
//! `meshes/{visual,collision}`, `splats/<part>.ply`.
//!
//! Link frames: axes of the canonical world; origin on the joint axis nearest the part's centre of
//! mass (revolute), at the centre of mass (prismatic), at the world origin (root). Mesh files are
//! in link frames.

use crate::link::{hull_file, link_origin, mean_color, texture_file, visual_file};
use crate::{PartModel, Twin, glb, mjcf, sdf, texture, urdf, usd};
use glam::{DVec3, Vec3};
use hingecast_geom::ply::PlyError;
use hingecast_geom::staging::{Staging, write_whole};
use hingecast_geom::{Gaussians, JointKind, Pose, TriMesh};
use serde_json::json;
use std::path::{Path, PathBuf};

/// Why a twin could not be written.
#[derive(Debug, thiserror::Error)]
pub enum ExportError {
    /// The operating system refused to write.
    #[error(
        "cannot write {path}: {source}\n  where: the twin folder\n  try: free some disk space, or another -o folder"
    )]
    Io {
        /// The file or folder.
        path: PathBuf,
        /// What the system said.
        source: std::io::Error,
    },
    /// A mesh or the gaussians of a part could not be written.
    #[error(transparent)]
    Ply(#[from] PlyError),
}

/// Writes the whole folder beside `dir` and renames it into place; what stands there goes, so
/// whoever calls makes sure that it [`is_ours`]. `splats`: gaussians in the canonical world and the
/// part of each.
///
/// # Errors
/// When the disk refuses; the old folder is then still there.
///
/// # Panics
/// When `splats` has fewer parts than gaussians.
pub fn write(twin: &Twin, splats: Option<(&Gaussians, &[u8])>, dir: &Path) -> Result<(), ExportError> {
    let at = |path: &Path| {
        let path = path.to_path_buf();
        move |source| ExportError::Io { path, source }
    };
    let whole = Staging::new(dir).map_err(at(dir))?;
    let staging = whole.path();
    for folder in ["meshes/visual", "meshes/collision", "splats"] {
        let folder = staging.join(folder);
        std::fs::create_dir_all(&folder).map_err(at(&folder))?;
    }
    for (i, part) in twin.parts.iter().enumerate() {
        write_part(&staging, i, part, link_origin(twin, i))?;
        if let Some((gaussians, labels)) = splats {
            let members: Vec<usize> = (0..gaussians.len()).filter(|&g| labels[g] as usize == i).collect();
            let mut own = gaussians.select(&members);
            let link_from_world = Pose::from_trans(-link_origin(twin, i));
            (0..own.len()).for_each(|g| own.transform_one(g, &link_from_world));
            own.write_ply(&staging.join("splats").join(format!("part_{i}.ply")))?;
        }
    }
    let file = |name: &str, content: Vec<u8>| {
        let path = staging.join(name);
        write_whole(&path, &content).map_err(at(&path))
    };
    file("robot.urdf", urdf::to_string(twin).into_bytes())?;
    file("robot.usda", usd::to_string(twin).into_bytes())?;
    file("robot.xml", mjcf::to_string(twin).into_bytes())?;
    file("robot.sdf", sdf::to_string(twin).into_bytes())?;
    file("robosuite.xml", mjcf::for_robosuite(twin).into_bytes())?;
    file("robosuite_object.py", robosuite_object(twin).into_bytes())?;
    file("robot.glb", glb::to_bytes(twin).map_err(at(&staging.join("robot.glb")))?)?;
    let summary = serde_json::to_string_pretty(&summary(twin)).expect("plain data") + "\n";
    file("twin.json", summary.into_bytes())?;
    whole.finish().map_err(at(dir))
}

/// Whether a file of this path, from the twin folder, is one that [`fn@write`] writes.
pub fn is_ours(path: &Path) -> bool {
    let names: Option<Vec<&str>> = path.iter().map(|name| name.to_str()).collect();
    let part = |name: &str, ends: &[&str]| {
        ends.iter()
            .any(|end| name.strip_prefix("part_").and_then(|n| n.strip_suffix(end)).is_some_and(|n| !n.is_empty()))
    };
    match names.as_deref() {
        Some(
            [
                "twin.json"
                | "robot.glb"
                | "robot.sdf"
                | "robot.urdf"
                | "robot.usda"
                | "robot.xml"
                | "robosuite.xml"
                | "robosuite_object.py"
                | "view.html",
            ],
        ) => true,
        Some(["meshes", "visual", name]) => part(name, &[".obj", ".mtl", ".png", ".ply"]),
        // Older versions wrote STL.
        Some(["meshes", "collision", name]) => part(name, &[".obj", ".stl"]),
        Some(["splats", name]) => part(name, &[".ply"]),
        _ => false,
    }
}

fn write_part(dir: &Path, index: usize, part: &PartModel, origin: DVec3) -> Result<(), ExportError> {
    let local = |mesh: &TriMesh| {
        let mut mesh = mesh.clone();
        mesh.vertices.iter_mut().for_each(|v| *v = (v.as_dvec3() - origin).as_vec3());
        mesh
    };
    let meshes = dir.join("meshes");
    let path = meshes.join(visual_file(index));
    let visual = if part.mesh.is_empty() { placeholder() } else { local(&part.mesh) };
    match &part.texture {
        Some(picture) => texture::files::write(&visual, picture, &path),
        None => visual.write_obj(&path),
    }
    .map_err(|source| ExportError::Io { path: path.clone(), source })?;
    // The same surface as PLY: the format whose vertex colours every mesh viewer shows.
    visual.write_ply(&path.with_extension("ply"))?;
    for (k, hull) in part.hulls.iter().enumerate() {
        let path = meshes.join(hull_file(index, k));
        local(hull).write_obj(&path).map_err(|source| ExportError::Io { path: path.clone(), source })?;
    }
    Ok(())
}

/// The class that robosuite loads, with the names of the joints.
fn robosuite_object(twin: &Twin) -> String {
    let moving = twin.tree.joints.iter().filter(|j| j.screw.kind != JointKind::Fixed);
    let names: Vec<&str> = moving.map(|j| j.name.as_str()).collect();
    let names = serde_json::to_string(&names).expect("plain data");
    format!("{}JOINTS = {names}\n", include_str!("robosuite_object.py"))
}

/// A millimetre cube for a part without surface: loaders refuse empty meshes.
fn placeholder() -> TriMesh {
    TriMesh::cuboid(Vec3::splat(-5e-4), Vec3::splat(5e-4))
}

fn summary(twin: &Twin) -> serde_json::Value {
    let parts: Vec<_> = twin
        .parts
        .iter()
        .enumerate()
        .map(|(i, p)| {
            let origin = link_origin(twin, i);
            json!({
                "name": p.name,
                "link_origin": origin.to_array(),
                "visual": format!("meshes/{}", visual_file(i)),
                "texture": p.texture.as_ref().map(|_| format!("meshes/{}", texture_file(i))),
                "collision": (0..p.hulls.len()).map(|k| format!("meshes/{}", hull_file(i, k))).collect::<Vec<_>>(),
                "splats": format!("splats/part_{i}.ply"),
                "mass": p.inertial.mass,
                "com": p.inertial.com.to_array(),
                "inertia": p.inertial.inertia.to_cols_array_2d(),
                "faces": p.mesh.faces.len(),
                "open_edges": p.mesh.open_edges(),
                "volume": p.mesh.mass_integrals().volume,
                "mean_color": mean_color(&p.mesh),
            })
        })
        .collect();
    json!({
        "format": 1,
        "name": twin.name,
        "metric": twin.metric,
        "up": twin.up.to_array(),
        "diagonal": twin.diagonal,
        "parts": parts,
        "tree": twin.tree,
        "doubts": twin.doubts,
        "certainty": twin.certainty,
    })
}
