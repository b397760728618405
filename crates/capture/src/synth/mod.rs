//! Renders a recording of an articulated object, and the truth about it.
//!
//! Cameras stand on the upper hemisphere; joints are played as a person would (see `play`); colour
//! is supersampled, depth and masks are exact at pixel centres. Everything is a function of the
//! object, the configuration and its seed.

mod cameras;
mod config;
mod coupled;
mod noise;
mod occluder;
mod output;
mod plan;
mod play;
mod player;
mod ranges;
mod render;
pub(crate) mod scene;
mod shade;
mod staging;
mod still;

pub use config::{Noise, SynthConfig, SynthReport};
pub use coupled::useful_ranges;
pub use ranges::UsefulRange;
pub(crate) use staging::Staging;
pub use staging::may_be_replaced;

use crate::object::{ArticulatedObject, PartGeometry};
use crate::{CaptureError, Frame, Recording, Split, Truth};
use glam::{DVec3, Vec3};
use hingecast_geom::{Pose, Progress};
use output::Exposure;
use plan::Shot;
use rayon::prelude::*;
use std::path::Path;
use std::sync::atomic::{AtomicUsize, Ordering};

/// Sensors and hands have sizes in metres. An object without metric scale counts as this large (its
/// diagonal), a small piece of furniture.
const ASSUMED_DIAGONAL_METRES: f64 = 0.8;

/// Records `object` into the folder `out` (and `<out>.truth`). A recording that stands there is
/// replaced as a whole.
///
/// # Errors
/// When the configuration makes no sense, the disk is full, `out` holds something else, or the
/// person asked to stop.
pub fn synth(
    object: &ArticulatedObject,
    config: &SynthConfig,
    out: &Path,
    progress: &Progress,
) -> Result<SynthReport, CaptureError> {
    config::validate(config)?;
    let out = std::path::absolute(out).map_err(|e| CaptureError::write(out, e))?;
    let truth_out = Truth::folder_of(&out);
    let work = Staging::new(&out)?;
    let truth_work = config.truth.then(|| Staging::new(&truth_out)).transpose()?;
    for folder in ["rgb", "depth", "mask", "occluder"] {
        if folder != "occluder" || config.play || config.occluders > 0.0 {
            work.folder(folder)?;
        }
    }
    if let Some(truth) = &truth_work {
        truth.folder("labels")?;
        truth.folder("parts")?;
    }

    let ranges = plan::ranges(object, config)?;
    let states = plan::joint_values(object, config, &ranges);
    let shots = plan::shots(object, config, &states);
    let metres_per_unit = if object.metric { 1.0 } else { ASSUMED_DIAGONAL_METRES / object.diagonal().max(1e-9) };
    let studio = Studio {
        object,
        config,
        states: &states,
        held: if config.play { player::hold(object, &states[..config.states], metres_per_unit) } else { Vec::new() },
        background: Vec3::from_array(
            config.background.map(|c| crate::object::texture::linear_from_srgb(f32::from(c) / 255.0)),
        ),
        metres_per_unit,
        depth_scale: plan::depth_scale(object, &shots),
        root: &work.path,
        truth: truth_work.as_ref().map(|t| t.path.as_path()),
    };
    let done = AtomicUsize::new(0);
    let tell = || progress.report(done.fetch_add(1, Ordering::Relaxed) + 1, shots.len(), "views");
    let frames: Vec<Vec<Frame>> = (0..states.len())
        .into_par_iter()
        .map(|state| {
            progress.check()?;
            let here: Vec<&Shot> = shots.iter().filter(|s| s.state == state).collect();
            studio.record_state(state, &here, &|| tell().map_err(CaptureError::from))
        })
        .collect::<Result<_, _>>()?;

    let recording = Recording {
        root: work.path.clone(),
        name: object.name.clone(),
        frames: frames.into_iter().flatten().collect(),
        n_states: config.states,
        metric: object.metric,
        up: DVec3::Z,
        registered: true,
    };
    recording.write()?;
    if let Some(truth) = truth_work {
        output::write_truth(object, config, &ranges, &states, &shots, &truth.path)?;
        truth.finish()?;
    }
    work.finish()?;
    let names = object.tree.joints.iter().map(|j| j.name.clone());
    Ok(SynthReport {
        recording: out,
        truth: config.truth.then_some(truth_out),
        frames: shots.len(),
        notes: still::notes(object, &ranges, &shots),
        ranges: names.zip(ranges.iter().map(|r| [r.lower, r.upper])).collect(),
    })
}

/// What stays the same over all shots.
struct Studio<'a> {
    object: &'a ArticulatedObject,
    config: &'a SynthConfig,
    states: &'a [Vec<f64>],
    /// The hands of a play; none otherwise.
    held: Vec<player::Hand>,
    /// Linear light.
    background: Vec3,
    metres_per_unit: f64,
    depth_scale: f64,
    root: &'a Path,
    truth: Option<&'a Path>,
}

impl Studio<'_> {
    /// Renders and writes all views of a state; the same hand reaches into some of them, or holds
    /// on in all.
    fn record_state(
        &self,
        state: usize,
        shots: &[&Shot],
        tell: &(dyn Fn() -> Result<(), CaptureError> + Sync),
    ) -> Result<Vec<Frame>, CaptureError> {
        let mut poses = self.object.tree.poses(&self.states[state]);
        let scene = scene::Scene::new(self.object.parts.iter().zip(poses.iter().copied()));
        let reaching = (self.config.occluders > 0.0)
            .then(|| occluder::hand(self.object, self.states, state, self.metres_per_unit, self.config.seed));
        let holding = self.held.iter().filter(|h| h.states.contains(&state)).map(|h| (&h.geometry, poses[h.part]));
        let hands: Vec<(&PartGeometry, Pose)> =
            holding.chain(reaching.as_ref().map(|hand| (hand, Pose::IDENTITY))).collect();
        let share = if self.config.play { 1.0 } else { self.config.occluders };
        let looks = shade::Looks::new(self.object, hands.iter().map(|h| h.0));
        let with_hands = (!hands.is_empty()).then(|| {
            let parts = self.object.parts.iter().zip(poses.iter().copied());
            scene::Scene::new(parts.chain(hands.iter().copied()))
        });
        poses.extend(hands.iter().map(|h| h.1));
        shots
            .par_iter()
            .map(|shot| {
                // One generator a view: the order in which threads take views must not matter.
                let seed = (self.config.seed << 32) ^ ((shot.state as u64) << 16) ^ shot.view as u64;
                let mut rng = fastrand::Rng::with_seed(seed.wrapping_mul(0x9e37_79b9_7f4a_7c15));
                let train = shot.split == Split::Train;
                let reached = train && rng.f64() < share;
                let seen = if reached { with_hands.as_ref().unwrap_or(&scene) } else { &scene };
                let picture = render::render(seen, &looks, &poses, &shot.camera, self.background);
                let mut exposure = Exposure::new(picture, self.object.parts.len(), shot.camera.width);
                if reached {
                    exposure.note_hidden(&scene, &shot.camera);
                }
                let mut camera = shot.camera;
                if train && self.config.noise == Noise::D435 {
                    noise::d435(&mut exposure, &mut camera, self.metres_per_unit, &mut rng);
                }
                let mut frame = output::write(shot, camera, &exposure, self.depth_scale, self.root, self.truth)?;
                frame.time = (self.config.play && train).then_some(state as f64 * player::SECS_PER_STATE);
                tell()?;
                Ok(frame)
            })
            .collect()
    }
}
