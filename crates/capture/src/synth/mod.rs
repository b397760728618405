//! Renders a recording of an articulated object, and the truth about it.
//!
//! Cameras stand on the upper hemisphere; joints are played as a person would (see `play`); colour
//! is supersampled, depth and masks are exact at pixel centres. Everything is a function of the
//! object, the configuration and its seed. `world` is what stands around the object.

mod cameras;
mod config;
mod coupled;
mod drift;
mod film;
mod framing;
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
mod smooth;
mod staging;
mod still;
mod trajectory;
mod world;

pub use config::{Noise, SynthConfig, SynthReport};
pub use coupled::useful_ranges;
pub use ranges::UsefulRange;
pub(crate) use staging::Staging;
pub use staging::may_be_replaced;
pub use world::{Drift, Frames, Lens, Masks, Push, Scenery, Trajectory, World};

use crate::object::{ArticulatedObject, PartGeometry};
use crate::{CaptureError, Frame, Recording, Split, Truth};
use glam::{DVec3, Vec3};
use hingecast_geom::{Camera, Pose, Progress};
use output::Exposure;
use plan::Shot;
use rayon::prelude::*;
use std::path::Path;
use std::sync::atomic::{AtomicUsize, Ordering};
use world::{Placement, Room, Site};

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
    let config = &config.resolved();
    let out = std::path::absolute(out).map_err(|e| CaptureError::write(out, e))?;
    let truth_out = Truth::folder_of(&out);
    let work = Staging::new(&out)?;
    let truth_work = config.truth.then(|| Staging::new(&truth_out)).transpose()?;
    let film = config.film.is_some();
    let hands = config.play || config.occluders > 0.0;
    let folders =
        [("rgb", true), ("depth", true), ("mask", config.world.masks != Masks::None), ("occluder", hands && !film)];
    // Each capture has folders of its own.
    let captures: &[&str] = if film { &[film::SCAN, film::PLAY] } else { &["."] };
    for capture in captures {
        for (folder, _) in folders.iter().filter(|(_, wanted)| *wanted) {
            work.folder(&format!("{capture}/{folder}"))?;
        }
    }
    if let Some(truth) = &truth_work {
        let own = ["labels", "parts"].into_iter().chain(film.then_some(output::HANDS));
        own.into_iter().try_for_each(|folder| truth.folder(folder))?;
    }

    let ranges = plan::ranges(object, config)?;
    let states = plan::joint_values(object, config, &ranges);
    let metres_per_unit = if object.metric { 1.0 } else { ASSUMED_DIAGONAL_METRES / object.diagonal().max(1e-9) };
    let front = world::front(object, &ranges);
    let placement = Placement::new(object, config, &plan::times(config), front, metres_per_unit);
    let site = (config.world.scene == Scenery::Room)
        .then(|| Site::new(object, &states, &placement, front, 1.0 / metres_per_unit, config.seed));
    let shots = plan::shots(object, config, &states, &placement, front, site.as_ref());
    let room = site.as_ref().map(|site| {
        let cameras: Vec<Camera> = shots.iter().map(|s| s.camera).collect();
        // The material after the object's own is that of hands.
        Room::new(site, &cameras, object.materials.len() as u32 + 1, config.seed)
    });
    let studio = Studio {
        object,
        config,
        states: &states,
        held: if config.play {
            player::hold(object, &states[..config.states], film, metres_per_unit)
        } else {
            Vec::new()
        },
        background: Vec3::from_array(
            config.background.map(|c| crate::object::texture::linear_from_srgb(f32::from(c) / 255.0)),
        ),
        metres_per_unit,
        depth_scale: plan::depth_scale(object, &shots, room.as_ref().map_or(&[], |r| &r.geometry.vertices)),
        room: room.as_ref(),
        placement: &placement,
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

    let frames: Vec<Frame> = frames.into_iter().flatten().collect();
    let recording = |root: &str, frames: Vec<Frame>| Recording {
        root: work.path.join(root),
        name: object.name.clone(),
        frames,
        n_states: if film { 1 } else { config.states },
        metric: object.metric,
        up: DVec3::Z,
        film: false,
        doubts: Vec::new(),
        settled: false,
        registered: film || config.world.frames == Frames::Shared,
    };
    if film {
        let (scan, play): (Vec<Frame>, Vec<Frame>) = frames.into_iter().partition(|f| f.state == 0);
        let play = play.into_iter().enumerate().map(|(view, f)| Frame { state: 0, view, ..f }).collect();
        recording(film::SCAN, scan).write()?;
        recording(film::PLAY, play).write()?;
    } else {
        recording("", frames).write()?;
    }
    if let Some(truth) = truth_work {
        output::write_truth(object, config, &ranges, &states, &shots, &placement, &truth.path)?;
        truth.finish()?;
    }
    work.finish()?;
    let names = object.tree.joints.iter().map(|j| j.name.clone());
    Ok(SynthReport {
        recording: out,
        truth: config.truth.then_some(truth_out),
        frames: shots.len(),
        notes: still::notes(object, &states[..config.states], &shots),
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
    room: Option<&'a Room>,
    placement: &'a Placement,
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
        let n_parts = self.object.parts.len();
        let mut poses = self.placement.part_poses(self.object, &self.states[state], state);
        let bodies = self.object.parts.iter().chain(self.room.map(|r| &r.geometry));
        let bodies = || bodies.clone().zip(poses.iter().copied().chain([Pose::IDENTITY]));
        let scene = scene::Scene::new(bodies());
        let reaching = (self.config.occluders > 0.0)
            .then(|| occluder::hand(self.object, self.states, state, self.metres_per_unit, self.config.seed));
        let holding = self.held.iter().filter(|h| h.states.contains(&state)).map(|h| (&h.geometry, poses[h.part]));
        let hands: Vec<(&PartGeometry, Pose)> =
            holding.chain(reaching.as_ref().map(|hand| (hand, self.placement.of_object(state)))).collect();
        let share = if self.config.play { 1.0 } else { self.config.occluders };
        let looks = shade::Looks::new(self.object, self.room, hands.iter().map(|h| h.0));
        let with_hands = (!hands.is_empty()).then(|| scene::Scene::new(bodies().chain(hands.iter().copied())));
        poses.extend(self.room.map(|_| Pose::IDENTITY));
        // All pictures of a play are one way of the camera.
        let (capture, views) = match self.config.film {
            Some(pictures) if state > 0 => (1, pictures),
            _ => (state, self.config.views),
        };
        let drifted = self.config.world.drift.map_or(Vec::new(), |size| {
            let seed = self.config.seed ^ 0x6472_6966_7400 ^ ((capture as u64) << 48);
            let mut rng = fastrand::Rng::with_seed(seed.wrapping_mul(0x9e37_79b9_7f4a_7c15));
            let all = drift::along(views, &size, 1e-3 / self.metres_per_unit, &mut rng);
            if self.config.film.is_some() && state > 0 { all[state - 1..state].to_vec() } else { all }
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
                let around = usize::from(self.room.is_some());
                let mut exposure = Exposure::new(picture, n_parts, around, shot.camera.width);
                if reached {
                    exposure.note_hidden(&scene, n_parts, &shot.camera);
                }
                let mut camera = shot.camera;
                let segmented = (train && self.config.world.masks == Masks::Sam).then(|| {
                    let mut mask = exposure.mask.clone();
                    let mut rng = fastrand::Rng::with_seed((seed ^ 0x0073_616d).wrapping_mul(0x9e37_79b9_7f4a_7c15));
                    world::masks::segmenter(&mut mask, camera.width, camera.height, &mut rng);
                    mask
                });
                if train {
                    noise::sense(self.config.noise, &mut exposure, &mut camera, self.metres_per_unit, &mut rng);
                    camera = drifted.get(shot.view).map_or(camera, |off| drift::stated(camera, *off));
                }
                if let Some(mask) = segmented {
                    exposure.mask = mask;
                }
                let camera = self.placement.stated(camera, state);
                let root = match self.config.film {
                    None => self.root.to_path_buf(),
                    Some(_) => self.root.join(if state == 0 { film::SCAN } else { film::PLAY }),
                };
                let mut frame = output::write(shot, camera, &exposure, self.depth_scale, &root, self.truth)?;
                frame.time = match self.config.film {
                    Some(_) => Some(film::time(state, shot.view)),
                    None => (self.config.play && train).then_some(state as f64 * player::SECS_PER_STATE),
                };
                tell()?;
                Ok(frame)
            })
            .collect()
    }
}
