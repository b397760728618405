//! One page in which a twin is taken by its handles: no network, any browser. Made of `web/` (`make web`).

use crate::artifacts::TwinFile;
use crate::escape::escape;
use crate::failure::{Failure, Result};
use crate::stage::read_json;
use base64::Engine as _;
use base64::engine::general_purpose::STANDARD;
use glam::{DQuat, DVec3};
use hingecast_geom::staging::write_whole;
use std::path::{Path, PathBuf};

/// Bundled by `web/build.mjs`.
const PAGE: &str = include_str!("page.html");
/// How far above the ground and to the side the camera stands at first, share of how far in front.
const ABOVE: f64 = 0.55;
const BESIDE: f64 = 0.6;

/// Writes the page of the twin in `twin` (a folder with `twin.json` and `robot.glb`) to `out`.
///
/// # Errors
/// When that is no twin, one of an older version, or the disk refuses.
pub fn write(twin: &Path, out: &Path) -> Result<()> {
    let checked = TwinFile::read_in(twin)?;
    let mut said: serde_json::Value = read_json(&twin.join("twin.json"))?;
    let glb = twin.join("robot.glb");
    let hint = "build the twin again: `hingecast build REC -o RUN --from twin`";
    let old = |e: std::io::Error| Failure::new(format!("cannot read it: {e}"), glb.display().to_string(), hint);
    let bytes = std::fs::read(&glb).map_err(old)?;
    let mut pieces = Vec::new();
    for part in &checked.parts {
        let read = |file: &String| {
            let path = twin.join(file);
            std::fs::read_to_string(&path).map_err(Failure::io(&path))
        };
        pieces.push(part.collision.iter().map(read).collect::<Result<Vec<_>>>()?);
    }
    said["collision"] = serde_json::json!(pieces);
    said["front"] = serde_json::json!(front(&checked).to_array());
    // Inside a script element no name may close it, or open a comment.
    let data = serde_json::to_string(&said).expect("plain data").replace('<', "\\u003c");
    let title = escape(&checked.name);
    // The twin last: a name that looks like a mark stays one.
    let page = PAGE.replacen("<!--TITLE-->", &title, 1).replacen("<!--GLB-->", &STANDARD.encode(bytes), 1).replacen(
        "<!--TWIN-->",
        &data,
        1,
    );
    if let Some(folder) = out.parent() {
        std::fs::create_dir_all(folder).map_err(Failure::io(folder))?;
    }
    write_whole(out, page.as_bytes()).map_err(Failure::io(out))
}

/// The page's place for a run or a twin's folder, and the folder.
///
/// # Errors
/// When there is neither.
pub fn place(path: &Path) -> Result<(PathBuf, PathBuf)> {
    if path.join("twin.json").is_file() {
        return Ok((path.to_path_buf(), path.join("view.html")));
    }
    let twin = path.join("twin");
    if twin.join("twin.json").is_file() {
        return Ok((twin, path.join("report").join("view.html")));
    }
    let hint = "the -o of `hingecast build` once its twin is done, or of `hingecast import-object`";
    Err(Failure::new("no twin here", path.display().to_string(), hint))
}

/// From where to look at first, of length 1, y up: from the side to which things open.
fn front(twin: &TwinFile) -> DVec3 {
    let up = twin.up.normalize_or(DVec3::Z);
    let tree = &twin.tree;
    let closed = tree.poses(&vec![0.0; tree.joints.len()]);
    let mut way = DVec3::ZERO;
    for (j, joint) in tree.joints.iter().enumerate() {
        for limit in joint.limits {
            let mut q = vec![0.0; tree.joints.len()];
            q[j] = limit;
            // A place on the part, away from its axis.
            let at = DVec3::from(twin.parts[joint.child].com);
            let moved = tree.poses(&q)[joint.child].apply(at) - closed[joint.child].apply(at);
            way += moved.reject_from(up);
        }
    }
    let ahead = way.try_normalize().unwrap_or_else(|| up.any_orthonormal_vector());
    let seen = ahead + ABOVE * up + BESIDE * up.cross(ahead);
    DQuat::from_rotation_arc(up, DVec3::Y) * seen.normalize()
}
