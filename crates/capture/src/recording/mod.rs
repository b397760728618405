//! The native recording: nerfstudio's `transforms.json` plus our per-frame `state`.
//!
//! Keys of ours, all optional but `state`: per frame `state` (integer), `view`, `time` (seconds),
//! `occluded` (bool), `occluder_mask_path`; for the whole `name`, `metric` (lengths are metres),
//! `up` (world direction, default z), `registered` (false: each state has a world frame of its own,
//! default true), `film` (state 0 is a scan, the others are cut out of a film, default false).
//! Instead of `state` a recording may have one `state_000/transforms.json` per state. Held-out frames are those that nerfstudio's
//! `test_filenames` lists.

mod cache;
mod fields;
mod fingerprint;
pub mod images;
pub(crate) mod mask;
pub mod masked;
mod packed_depth;
mod palette;
pub(crate) mod stray;
pub(crate) mod transforms;
mod view;
mod write;

pub use cache::ViewCache;
pub use packed_depth::PackedDepth;
pub use view::View;

use crate::CaptureError;
use glam::{DMat4, DVec3};
use hingecast_geom::{Camera, Pose};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use transforms::{Document, Entry, Problem};

/// Whether a frame may be fitted, or is kept for measuring.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Split {
    /// May be fitted.
    Train,
    /// Held out: only for measuring.
    Test,
}

/// One picture of one state. Paths are absolute.
#[derive(Clone, Debug, PartialEq)]
pub struct Frame {
    /// Number of the joint configuration, from 0.
    pub state: usize,
    /// Number of the view within its state.
    pub view: usize,
    /// Whether it may be fitted.
    pub split: Split,
    /// Where it was taken from; its size is that of all images of the frame.
    pub camera: Camera,
    /// The colour image.
    pub color: PathBuf,
    /// The depth image, if there is one.
    pub depth: Option<PathBuf>,
    /// Scene units per stored depth unit.
    pub depth_scale: f64,
    /// The object's mask (non-zero = object), if there is one.
    pub mask: Option<PathBuf>,
    /// Numbers that are the object, where masks have one a thing; empty: all but 0.
    pub mask_ids: Vec<u16>,
    /// The whole frame is hidden by the person: leave it out.
    pub occluded: bool,
    /// Pixels that show the person instead of the object (non-zero = hidden).
    pub occluder_mask: Option<PathBuf>,
    /// Seconds.
    pub time: Option<f64>,
}

/// All frames of all states; pixels are read by [`Recording::load`].
#[derive(Clone, Debug, PartialEq)]
pub struct Recording {
    /// Folder that holds `transforms.json`.
    pub root: PathBuf,
    /// Name of the recording.
    pub name: String,
    /// All frames, in file order.
    pub frames: Vec<Frame>,
    /// States with training frames: 0..n_states. Held-out states follow and have test frames only.
    pub n_states: usize,
    /// Lengths are metres; otherwise scene units.
    pub metric: bool,
    /// Unit vector that points up in the world.
    pub up: DVec3,
    /// All states share one world frame. False: each state's poses are in a world of their own
    /// (scans that were put together), and nobody has brought them together yet.
    pub registered: bool,
    /// State 0 is a scan from all sides; the other states are cut out of a film of play: a few views
    /// each, and hands may be in them. `time` counts in the film.
    pub film: bool,
    /// What whoever brought the scans together was not sure of; `build` hands it on.
    pub doubts: Vec<String>,
    /// Everything that the scans show, the room too, holds the cameras where they are now. No file says
    /// so: what looked at all of it does, before a build.
    pub settled: bool,
}

/// Largest tolerated entry of |R'R - 1|: json files with 4 digits stay below, a scaled or sheared
/// pose does not.
pub(crate) const MAX_RIGIDITY_ERROR: f64 = 1e-3;

/// Focal lengths that lenses have, image widths: fields of view of 0.06 and 179 degrees.
const NARROWEST: f64 = 0.009;
const WIDEST: f64 = 1000.0;
/// Farthest that a principal point is read from the middle of the image, image sizes: crops keep
/// theirs.
const FARTHEST_MIDDLE: f64 = 20.0;

impl Recording {
    /// Opens a recording folder (or its `transforms.json`); reads no pixels.
    ///
    /// # Errors
    /// The first thing that makes the recording unusable; `check` lists all of them.
    pub fn open(path: &Path) -> Result<Self, CaptureError> {
        let recording = Self::open_uncut(path)?;
        recording.uncut().map_or(Ok(recording), Err)
    }

    /// The same, of a film also between its import and its being cut into states.
    ///
    /// # Errors
    /// As [`Recording::open`].
    pub fn open_uncut(path: &Path) -> Result<Self, CaptureError> {
        let documents = transforms::read(path)?;
        let mut problems = Vec::new();
        let recording = Self::from_documents(&documents, &mut problems);
        match problems.into_iter().next() {
            Some(problem) => Err(problem.error),
            None => Ok(recording),
        }
    }

    /// What is wrong with a film whose import was stopped before it was cut: all of it is one state.
    pub(crate) fn uncut(&self) -> Option<CaptureError> {
        (self.film && !self.registered).then(|| {
            let what = "a film that is not cut into states yet: its import was stopped";
            CaptureError::new(
                what,
                self.root.display().to_string(),
                "import it again: hingecast import SCAN --film PLAY -o REC",
            )
        })
    }

    /// What can be made of the documents; everything that is wrong goes to `problems`, frames with
    /// problems are left out.
    pub(crate) fn from_documents(documents: &[Document], problems: &mut Vec<Problem>) -> Self {
        let root = documents.first().map(|d| d.root.clone()).unwrap_or_default();
        let (mut frames, mut origins) = (Vec::new(), Vec::new());
        let (mut name, mut metric, mut up, mut registered) = (None, false, DVec3::Z, true);
        let doubts = documents.iter().flat_map(|d| d.doubts.clone()).collect();
        let film = documents.iter().any(|d| d.film);
        for document in documents {
            problems.extend(document.problems.iter().cloned());
            name = name.or_else(|| document.name.clone());
            metric |= document.metric;
            up = document.up;
            registered &= document.registered;
            let mut next_view = BTreeMap::<usize, usize>::new();
            for entry in &document.entries {
                let next = next_view.entry(entry.state).or_default();
                match frame(entry, *next) {
                    Ok(f) => {
                        frames.push(f);
                        let place = format!("{}.transform_matrix", entry.place);
                        origins.push((place, (document.file.clone(), entry.index)));
                    }
                    Err(error) => problems.push(Problem { error, frame: Some((document.file.clone(), entry.index)) }),
                }
                *next += 1;
            }
        }
        // Scans with a world each may lie anywhere.
        let world = |f: &Frame| if registered { 0 } else { f.state };
        let worlds: std::collections::BTreeSet<usize> = frames.iter().map(world).collect();
        let mut stray = Vec::new();
        for own in worlds {
            let members: Vec<usize> = (0..frames.len()).filter(|&i| world(&frames[i]) == own).collect();
            let centres: Vec<_> = members.iter().map(|&i| frames[i].camera.centre()).collect();
            stray.extend(stray::cameras(&centres).into_iter().map(|(k, what)| (members[k], what)));
        }
        stray.sort_by_key(|s| s.0);
        for (i, what) in stray.into_iter().rev() {
            let (place, origin) = origins.remove(i);
            frames.remove(i);
            let hint = "leave the frame out (hingecast check --fix), or correct its transform_matrix";
            problems.push(Problem { error: CaptureError::new(what, place, hint), frame: Some(origin) });
        }
        let n_states = count_states(&frames, documents, problems);
        let folder = || root.file_name().map(|n| n.to_string_lossy().into_owned()).unwrap_or("recording".into());
        let name = name.unwrap_or_else(folder);
        Self { root, name, frames, n_states, metric, up, registered, film, doubts, settled: false }
    }

    /// Whether a state is cut out of a film: a picture or a few of one camera, hands in them.
    pub fn is_filmed(&self, state: usize) -> bool {
        self.film && state > 0
    }

    /// Indices of the usable frames of a state, in file order; wholly occluded frames are left out.
    pub fn frames_of(&self, state: usize, split: Split) -> Vec<usize> {
        let wanted = |f: &Frame| f.state == state && f.split == split && !f.occluded;
        (0..self.frames.len()).filter(|&i| wanted(&self.frames[i])).collect()
    }
}

/// Checks one entry's numbers and turns its OpenGL pose into an OpenCV camera.
fn frame(entry: &Entry, default_view: usize) -> Result<Frame, CaptureError> {
    let place = |key: &str, value: String| format!("{}.{key} = {value}", entry.place);
    let i = &entry.intrinsics;
    if i.distortion.iter().any(|k| k.abs() > 1e-12) {
        return Err(CaptureError::new(
            "the lens is distorted; a recording holds undistorted pictures",
            place("k1 k2 k3 k4 p1 p2", format!("{:?}", i.distortion)),
            "hingecast import undistorts: hingecast import THIS -o RECORDING --format nerfstudio",
        ));
    }
    if !(i.fx > 0.0 && i.fy > 0.0) {
        return Err(CaptureError::new(
            "the focal length is not positive",
            place("fl_x, fl_y", format!("{}, {}", i.fx, i.fy)),
            "give the focal length in pixels, about the image width for a phone",
        ));
    }
    if i.width == 0 || i.height == 0 {
        return Err(CaptureError::new(
            "the image size is zero",
            place("w, h", format!("{}, {}", i.width, i.height)),
            "give the size of the colour image in pixels",
        ));
    }
    let far = |c: f64, size: usize| !((c - 0.5 * size as f64).abs() <= FARTHEST_MIDDLE * size as f64);
    if [i.fx, i.fy].iter().any(|f| !(NARROWEST..WIDEST).contains(&(f / i.width.max(1) as f64))) {
        return Err(CaptureError::new(
            "the focal length is absurd",
            place("fl_x, fl_y", format!("{}, {} for {} x {} pixels", i.fx, i.fy, i.width, i.height)),
            "give the focal length in pixels, about the image width for a phone",
        ));
    }
    if far(i.cx, i.width) || far(i.cy, i.height) {
        return Err(CaptureError::new(
            "the principal point is absurd",
            place("cx, cy", format!("{}, {} for {} x {} pixels", i.cx, i.cy, i.width, i.height)),
            "give cx and cy in pixels of these images, about half of w and h",
        ));
    }
    let camera_from_world = camera_from_gl(&entry.world_from_camera, &entry.place)?;
    Ok(Frame {
        state: entry.state,
        view: entry.view.unwrap_or(default_view),
        split: entry.split,
        camera: Camera { width: i.width, height: i.height, fx: i.fx, fy: i.fy, cx: i.cx, cy: i.cy, camera_from_world },
        color: entry.color.clone(),
        depth: entry.depth.clone(),
        depth_scale: entry.depth_scale,
        mask: entry.mask.clone(),
        mask_ids: entry.mask_ids.clone(),
        occluded: entry.occluded,
        occluder_mask: entry.occluder_mask.clone(),
        time: entry.time,
    })
}

/// OpenCV `camera_from_world` of an OpenGL camera-to-world matrix: negate columns y and z, then
/// invert.
pub(crate) fn camera_from_gl(world_from_gl: &DMat4, place: &str) -> Result<Pose, CaptureError> {
    let error = hingecast_geom::pose::rigidity_error(world_from_gl);
    let value = || format!("{place}.transform_matrix");
    if error.is_infinite() {
        return Err(CaptureError::new(
            "a camera pose has a number that is not finite",
            value(),
            "leave the frame out, or run hingecast check --fix",
        ));
    }
    if error > MAX_RIGIDITY_ERROR {
        let what = if glam::DMat3::from_mat4(*world_from_gl).determinant() < 0.0 {
            "a camera pose is mirrored (determinant -1): one axis has the wrong sign".to_string()
        } else {
            format!("a camera pose is not rigid: |R'R - 1| = {error:.3e}, at most {MAX_RIGIDITY_ERROR:.0e} expected")
        };
        return Err(CaptureError::new(
            what,
            value(),
            "rows are [R | t] with R orthonormal and (0 0 0 1) last; hingecast check --fix repairs small errors",
        ));
    }
    let cv = DMat4::from_cols(world_from_gl.x_axis, -world_from_gl.y_axis, -world_from_gl.z_axis, world_from_gl.w_axis);
    Ok(Pose::from_mat4(&cv).inverse())
}

/// OpenGL camera-to-world matrix of an OpenCV camera, as `transforms.json` holds it.
pub(crate) fn gl_from_camera(camera_from_world: &Pose) -> DMat4 {
    let m = camera_from_world.inverse().to_mat4();
    DMat4::from_cols(m.x_axis, -m.y_axis, -m.z_axis, m.w_axis)
}

/// States with training frames must be 0..n; held-out states come after them.
fn count_states(frames: &[Frame], documents: &[Document], problems: &mut Vec<Problem>) -> usize {
    let mut train: Vec<usize> = frames.iter().filter(|f| f.split == Split::Train).map(|f| f.state).collect();
    train.sort_unstable();
    train.dedup();
    let place = documents.first().map(|d| d.file.display().to_string()).unwrap_or_default();
    let quiet = problems.is_empty();
    let mut report = |error| problems.push(Problem { error, frame: None });
    // Problems met before explain missing frames better than what follows from them.
    if frames.is_empty() && quiet {
        report(CaptureError::new(
            "the recording has no frames",
            format!("{place}: frames = []"),
            "record again, or point at the folder that holds the pictures' transforms.json",
        ));
    } else if train.is_empty() && quiet {
        report(CaptureError::new(
            "every frame is held out: nothing is left to fit",
            format!("{place}: test_filenames lists all {} frames", frames.len()),
            "take some file names out of test_filenames",
        ));
    }
    if let Some((expected, &found)) = train.iter().enumerate().find(|(i, s)| i != *s) {
        report(CaptureError::new(
            format!("states are not numbered 0, 1, 2, ...: state {expected} has no training frames"),
            format!("{place}: frames[].state goes from {} to {found}", expected as i64 - 1),
            "renumber the states without gaps (hingecast check --fix does it)",
        ));
    }
    train.len()
}
