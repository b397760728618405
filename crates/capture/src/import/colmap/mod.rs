//! COLMAP's sparse models, text or binary, before and since rigs (3.12), with depth beside them.
//!
//! `cameras`, `images`, `points3D`, since 3.12 `rigs` and `frames`, in the folder, in `sparse/` or
//! in `sparse/0/`; pictures in `images/`. Poses are world-to-camera, OpenCV axes, w first; pixel
//! centres at +0.5. Pictures in several folders of `images/` are several states: one model of all
//! of them shares a world.
//!
//! COLMAP makes no depth: `depth/<name>.png` (millimetres) or `.npy`, `.exr` (metres) is the
//! sensor's, `masks/<name>.png` anybody's. COLMAP's unit is its own: see `scale`.

mod binary;
mod model;
mod scale;
mod text;

use super::grid::Grid;
use super::{MaskFrom, Shot, Source};
use crate::CaptureError;
use glam::DVec3;
use hingecast_geom::Camera;
use model::Model;
use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

pub(super) fn read(src: &Path) -> Result<Source, CaptureError> {
    let folder = model_folder(src).unwrap_or_else(|| src.to_path_buf());
    // COLMAP itself prefers the binary files.
    let is_binary = folder.join("images.bin").is_file();
    let model = if is_binary { binary::read(&folder)? } else { text::read(&folder)? };
    let root = project(src, &folder);

    let mut source: Source = Vec::new().into();
    let states = states(&model);
    let mut without_depth = 0;
    for image in &model.images {
        let (pinhole, lens) = &model.cameras[&image.camera];
        let color = root.join("images").join(&image.name);
        let depth = beside(&root, &["depth", "depths"], &image.name, &["png", "npy", "exr"]);
        without_depth += usize::from(depth.is_none());
        let in_millimetres = depth.as_ref().is_none_or(|d| d.extension().is_some_and(|e| e == "png"));
        let mask = beside(&root, &["masks", "mask"], &image.name, &["png"]);
        source.shots.push(Shot {
            state: states.iter().position(|s| *s == top_folder(&image.name)).unwrap_or(0),
            lens: *lens,
            depth: depth.map(Grid::File),
            depth_scale: if in_millimetres { 1e-3 } else { 1.0 },
            mask: mask.map_or(MaskFrom::Alpha, MaskFrom::File),
            ..Shot::of(Camera { camera_from_world: image.camera_from_world, ..*pinhole }, color)
        });
    }
    if states.len() > 1 {
        source.notes.push(format!("folders of pictures are states, in this order: {}", states.join(", ")));
    }
    if without_depth > 0 {
        source.notes.push(format!(
            "{without_depth} of {} pictures have no depth in depth/: COLMAP makes none",
            source.shots.len()
        ));
    }
    source.notes.push("COLMAP does not know what is up: z is taken (\"up\" in transforms.json)".into());
    if without_depth < source.shots.len() {
        scale::to_metres(&mut source, &model)?;
    }
    source.up = DVec3::Z;
    Ok(source)
}

/// Where the model lies, if there is one.
pub(super) fn model_folder(src: &Path) -> Option<PathBuf> {
    let holds = |p: &PathBuf| {
        ["txt", "bin"].iter().any(|e| ["cameras", "images"].iter().all(|n| p.join(format!("{n}.{e}")).is_file()))
    };
    ["", "sparse", "sparse/0", "colmap/sparse/0"].iter().map(|sub| src.join(sub)).find(holds)
}

/// The folder that holds `images/`: that of the source, or one above the model.
fn project(src: &Path, model: &Path) -> PathBuf {
    let above = model.ancestors().take(3).find(|p| p.join("images").is_dir());
    if src.join("images").is_dir() { src.to_path_buf() } else { above.unwrap_or(src).to_path_buf() }
}

/// Names of states: the first folders of the pictures' names. The cameras of a rig have a folder
/// each, too: those are no states.
fn states(model: &Model) -> Vec<String> {
    if model.has_rigs {
        return vec![String::new()];
    }
    model.images.iter().map(|i| top_folder(&i.name)).collect::<BTreeSet<_>>().into_iter().collect()
}

fn top_folder(name: &str) -> String {
    name.split_once('/').map(|(folder, _)| folder.to_string()).unwrap_or_default()
}

/// `depth/a/b.png` of `a/b.jpg`, or `masks/a/b.jpg.png`, as COLMAP calls masks.
fn beside(root: &Path, folders: &[&str], name: &str, endings: &[&str]) -> Option<PathBuf> {
    let mut names = endings.iter().flat_map(|e| [Path::new(name).with_extension(e), format!("{name}.{e}").into()]);
    names.find_map(|n| folders.iter().map(|f| root.join(f).join(&n)).find(|p| p.is_file()))
}
