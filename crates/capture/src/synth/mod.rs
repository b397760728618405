//! Renders a recording of an articulated object, and the truth about it.
//!
//! Cameras stand on the upper hemisphere; joints are played as a person would (see `play`); colour is supersampled, depth
//! and masks are exact at pixel centres. Everything is a function of the object, the configuration and its seed.

mod cameras;
mod play;
mod ranges;
mod render;
pub(crate) mod scene;
mod shade;

pub use ranges::{UsefulRange, useful_ranges};

use crate::object::ArticulatedObject;
use crate::recording::images;
use crate::{CaptureError, Frame, Recording, Split, Truth};
use glam::{DVec3, Vec3};
use hingecast_geom::{Camera, Progress};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicUsize, Ordering};

/// What to record.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct SynthConfig {
    /// Joint configurations. 2 = everything at one end, then everything at the other.
    pub states: usize,
    /// Training cameras per state.
    pub views: usize,
    /// Held-out cameras per state.
    pub test_views: usize,
    /// Held-out joint configurations between recorded ones; their frames are all test frames. 0 with fewer than 3 states.
    pub test_states: usize,
    /// Width and height of the images, pixels.
    pub size: usize,
    /// Field of view, degrees; 40 is a phone's main camera upright.
    pub fov_deg: f64,
    /// The same cameras for all states (a rig); false: a person walks around anew for each state.
    pub same_cameras: bool,
    /// Joint name -> first and last value of its play, radians or scene units. Others get their useful range.
    pub ranges: BTreeMap<String, [f64; 2]>,
    /// sRGB behind the object.
    pub background: [u8; 3],
    /// Write the truth folder beside the recording.
    pub truth: bool,
    pub seed: u64,
}

impl Default for SynthConfig {
    fn default() -> Self {
        Self {
            states: 25,
            views: 60,
            test_views: 4,
            test_states: 2,
            size: 256,
            fov_deg: 40.0,
            same_cameras: true,
            ranges: BTreeMap::new(),
            background: [255; 3],
            truth: true,
            seed: 0,
        }
    }
}

/// What was recorded.
#[derive(Clone, Debug)]
pub struct SynthReport {
    pub recording: PathBuf,
    /// `None` when the configuration wanted none.
    pub truth: Option<PathBuf>,
    pub frames: usize,
    /// Joint name, first and last value of its play.
    pub ranges: Vec<(String, [f64; 2])>,
}

/// One view to render.
struct Shot {
    state: usize,
    view: usize,
    split: Split,
    camera: Camera,
}

/// Records `object` into the folder `out` (and `<out>.truth`). A recording that stands there is replaced as a whole.
///
/// # Errors
/// When the configuration makes no sense, the disk is full, `out` holds something else, or the person asked to stop.
pub fn synth(
    object: &ArticulatedObject,
    config: &SynthConfig,
    out: &Path,
    progress: &Progress,
) -> Result<SynthReport, CaptureError> {
    validate(config)?;
    let out = std::path::absolute(out).map_err(|e| CaptureError::write(out, e))?;
    let truth_out = Truth::folder_of(&out);
    let work = Staging::new(&out)?;
    let truth_work = Staging::new(&truth_out)?;

    let ranges = ranges(object, config)?;
    let states = joint_values(config, &ranges);
    let shots = shots(object, config, &states);
    let depth_scale = depth_scale(object, &shots);
    for folder in ["rgb", "depth", "mask"] {
        work.folder(folder)?;
    }
    truth_work.folder("labels")?;
    truth_work.folder("parts")?;

    let looks = shade::Looks::new(object);
    let background =
        Vec3::from_array(config.background.map(|c| crate::object::texture::linear_from_srgb(f32::from(c) / 255.0)));
    let done = AtomicUsize::new(0);
    (0..states.len()).into_par_iter().try_for_each(|state| {
        let poses = object.tree.poses(&states[state]);
        let scene = scene::Scene::new(object.parts.iter().zip(poses.iter().copied()));
        let here: Vec<&Shot> = shots.iter().filter(|s| s.state == state).collect();
        here.into_par_iter().try_for_each(|shot| {
            progress.check()?;
            let picture = render::render(&scene, &looks, &poses, &shot.camera, background);
            write_picture(shot, &picture, depth_scale, &work.path, config.truth.then_some(truth_work.path.as_path()))?;
            let count = done.fetch_add(1, Ordering::Relaxed) + 1;
            progress.report(count, shots.len(), "views").map_err(CaptureError::from)
        })
    })?;

    let recording = Recording {
        root: work.path.clone(),
        name: object.name.clone(),
        frames: shots.iter().map(|s| frame(s, &work.path, depth_scale)).collect(),
        n_states: config.states,
        metric: object.metric,
        up: DVec3::Z,
    };
    recording.write()?;
    if config.truth {
        write_truth(object, config, &ranges, &states, &shots, &truth_work.path)?;
        truth_work.finish(&truth_out)?;
    }
    work.finish(&out)?;
    let names = object.tree.joints.iter().map(|j| j.name.clone());
    Ok(SynthReport {
        recording: out,
        truth: config.truth.then_some(truth_out),
        frames: shots.len(),
        ranges: names.zip(ranges).collect(),
    })
}

fn validate(c: &SynthConfig) -> Result<(), CaptureError> {
    let checks = [
        (c.states >= 1, "states", c.states.to_string(), "1 or more; 2 and more show motion"),
        (c.views >= 1, "views", c.views.to_string(), "1 or more; 60 is a good recording"),
        ((8..=4096).contains(&c.size), "size", c.size.to_string(), "8 to 4096 pixels"),
        (c.fov_deg > 5.0 && c.fov_deg < 120.0, "fov_deg", c.fov_deg.to_string(), "5 to 120 degrees"),
    ];
    match checks.into_iter().find(|(good, ..)| !good) {
        None => Ok(()),
        Some((_, key, value, hint)) => {
            Err(CaptureError::new(format!("{key} is out of range"), format!("synth: {key} = {value}"), hint))
        }
    }
}

/// First and last value of each joint's play.
fn ranges(object: &ArticulatedObject, config: &SynthConfig) -> Result<Vec<[f64; 2]>, CaptureError> {
    let names: Vec<&str> = object.tree.joints.iter().map(|j| j.name.as_str()).collect();
    if let Some((name, range)) =
        config.ranges.iter().find(|(n, r)| !names.contains(&n.as_str()) || !r.iter().all(|x| x.is_finite()))
    {
        let hint = format!("the joints are: {}", names.join(", "));
        return Err(CaptureError::new(
            "no such joint, or its range is not finite",
            format!("--range {name}={range:?}"),
            hint,
        ));
    }
    let useful = useful_ranges(object);
    let own = |(name, u): (&&str, &UsefulRange)| config.ranges.get(*name).copied().unwrap_or([u.lower, u.upper]);
    Ok(names.iter().zip(&useful).map(own).collect())
}

/// Joint values of the recorded states, then of the held-out ones between them.
fn joint_values(config: &SynthConfig, ranges: &[[f64; 2]]) -> Vec<Vec<f64>> {
    let mut rng = fastrand::Rng::with_seed(config.seed ^ 0x706c_6179);
    let play = play::Play::new(ranges.len(), config.states == 2, &mut rng);
    let last = (config.states.max(2) - 1) as f64;
    let held_out = if config.states < 3 { 0 } else { config.test_states };
    // Held-out states stand half-way between two recorded ones, spread over the play.
    let between = (0..held_out).map(|k| (last * (k + 1) as f64 / (held_out + 1) as f64).floor() + 0.5);
    let times = (0..config.states).map(|s| s as f64).chain(between).map(|s| s / last);
    let value = |[from, to]: [f64; 2], f: f64| from + f * (to - from);
    times.map(|t| play.fractions(t).into_iter().zip(ranges).map(|(f, &r)| value(r, f)).collect()).collect()
}

/// All views: per state the training cameras, then the held-out ones.
fn shots(object: &ArticulatedObject, config: &SynthConfig, states: &[Vec<f64>]) -> Vec<Shot> {
    let fov = config.fov_deg.to_radians();
    let subject = cameras::Subject::new(object, states);
    let directions = |salt: u64, n: usize| {
        cameras::directions(n, &mut fastrand::Rng::with_seed(config.seed.wrapping_mul(0x9e37_79b9) ^ salt))
    };
    let per_state = |state: usize| {
        let salt = if config.same_cameras { 0 } else { state as u64 };
        let train = if state < config.states { directions(salt, config.views) } else { Vec::new() };
        (train, directions(1_000_003 + state as u64, config.test_views))
    };
    let all: Vec<_> = (0..states.len()).map(per_state).collect();
    let every: Vec<DVec3> = all.iter().flat_map(|(train, test)| train.iter().chain(test).copied()).collect();
    let distance = subject.distance(&every, fov);
    let mut shots = Vec::new();
    for (state, (train, test)) in all.iter().enumerate() {
        let splits = train.iter().map(|d| (Split::Train, d)).chain(test.iter().map(|d| (Split::Test, d)));
        for (view, (split, &direction)) in splits.enumerate() {
            let camera = subject.camera(direction, distance, config.size, fov);
            shots.push(Shot { state, view, split, camera });
        }
    }
    shots
}

/// Scene units per depth step: a ten-thousandth unless the object is too far for 16 bits.
fn depth_scale(object: &ArticulatedObject, shots: &[Shot]) -> f64 {
    let (lo, hi) = object.bounds(&vec![0.0; object.tree.joints.len()]);
    let centre = 0.5 * (lo + hi);
    let farthest =
        shots.iter().map(|s| s.camera.centre().distance(centre)).fold(0.0, f64::max) + 2.0 * (hi - lo).length();
    let mut scale = 1e-4;
    while farthest / scale > 65_535.0 {
        scale *= 10.0;
    }
    // Small objects (a pair of glasses in metres) deserve finer steps.
    while farthest / (scale / 10.0) < 65_535.0 {
        scale /= 10.0;
    }
    scale
}

fn file_name(s: &Shot) -> String {
    format!("s{:03}_v{:03}.png", s.state, s.view)
}

fn frame(s: &Shot, root: &Path, depth_scale: f64) -> Frame {
    let name = file_name(s);
    Frame {
        state: s.state,
        view: s.view,
        split: s.split,
        camera: s.camera,
        color: root.join("rgb").join(&name),
        depth: Some(root.join("depth").join(&name)),
        depth_scale,
        mask: Some(root.join("mask").join(&name)),
        occluded: false,
        occluder_mask: None,
        time: None,
    }
}

fn write_picture(
    shot: &Shot,
    picture: &render::Picture,
    depth_scale: f64,
    root: &Path,
    truth: Option<&Path>,
) -> Result<(), CaptureError> {
    let (w, h) = (shot.camera.width, shot.camera.height);
    let name = file_name(shot);
    images::write_rgb(&root.join("rgb").join(&name), &picture.rgb, w, h)?;
    let per_unit = 1.0 / depth_scale;
    let units: Vec<u16> = picture.depth.iter().map(|&z| (f64::from(z) * per_unit).round() as u16).collect();
    images::write_depth(&root.join("depth").join(&name), &units, w, h)?;
    let mask: Vec<u8> = picture.part.iter().map(|&p| if p > 0 { 255 } else { 0 }).collect();
    images::write_gray(&root.join("mask").join(&name), &mask, w, h)?;
    if let Some(truth) = truth {
        images::write_gray(&truth.join("labels").join(&name), &picture.part, w, h)?;
    }
    Ok(())
}

fn write_truth(
    object: &ArticulatedObject,
    config: &SynthConfig,
    ranges: &[[f64; 2]],
    states: &[Vec<f64>],
    shots: &[Shot],
    root: &Path,
) -> Result<(), CaptureError> {
    let mut tree = object.tree.clone();
    for (i, joint) in tree.joints.iter_mut().enumerate() {
        joint.values = states.iter().map(|q| q[i]).collect();
        joint.limits = [ranges[i][0].min(ranges[i][1]), ranges[i][0].max(ranges[i][1])];
    }
    for (part, name) in tree.parts.iter().enumerate() {
        let path = root.join("parts").join(format!("{name}.ply"));
        object.part_mesh(part).write_ply(&path).map_err(|e| CaptureError::write(&path, e))?;
    }
    let truth = Truth {
        root: root.to_path_buf(),
        object: object.name.clone(),
        tree,
        diagonal: object.diagonal(),
        n_states: config.states,
        source_limits: object.tree.joints.iter().map(|j| j.limits).collect(),
        cameras: shots.iter().map(|s| s.camera).collect(),
    };
    truth.write()
}

/// A folder that is filled under a temporary name and takes its place when all is there.
struct Staging {
    path: PathBuf,
}

impl Staging {
    /// # Errors
    /// When `target` holds something that is no recording: nothing of a person's is ever removed.
    fn new(target: &Path) -> Result<Self, CaptureError> {
        let ours = |name: &str| target.join(name).is_file();
        let empty = std::fs::read_dir(target).map(|mut d| d.next().is_none()).unwrap_or(true);
        if target.exists() && !empty && !ours("transforms.json") && !ours("truth.json") {
            return Err(CaptureError::new(
                "the output folder holds something else",
                target.display().to_string(),
                "give a new folder, or empty this one yourself",
            ));
        }
        let mut name = target.file_name().unwrap_or_default().to_os_string();
        name.push(".part");
        let path = target.with_file_name(name);
        // Left over from a run that was killed.
        let _ = std::fs::remove_dir_all(&path);
        std::fs::create_dir_all(&path).map_err(|e| CaptureError::write(&path, e))?;
        Ok(Self { path })
    }

    fn folder(&self, name: &str) -> Result<(), CaptureError> {
        let path = self.path.join(name);
        std::fs::create_dir_all(&path).map_err(|e| CaptureError::write(&path, e))
    }

    fn finish(&self, target: &Path) -> Result<(), CaptureError> {
        if target.exists() {
            std::fs::remove_dir_all(target).map_err(|e| CaptureError::write(target, e))?;
        }
        std::fs::rename(&self.path, target).map_err(|e| CaptureError::write(target, e))
    }
}

impl Drop for Staging {
    fn drop(&mut self) {
        // After `finish` there is nothing left under the temporary name.
        let _ = std::fs::remove_dir_all(&self.path);
    }
}
