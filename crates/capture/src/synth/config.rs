//! What to record, and what came of it.

use super::world::{Masks, Trajectory, World};
use crate::CaptureError;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::path::PathBuf;

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
    /// Held-out joint configurations between recorded ones; their frames are all test frames. 0
    /// with fewer than 3 states.
    pub test_states: usize,
    /// Width and height of the images, pixels; `world.lens` overrules this and `fov_deg`.
    pub size: usize,
    /// Field of view, degrees; 40 is a phone's main camera upright.
    pub fov_deg: f64,
    /// The same cameras for all states (a rig); false: a person walks around anew for each state,
    /// as on a `Trajectory::Walk` always.
    pub same_cameras: bool,
    /// Joint name -> first and last value of its play, radians or scene units. Others get their
    /// useful range.
    pub ranges: BTreeMap<String, [f64; 2]>,
    /// sRGB behind the object.
    pub background: [u8; 3],
    /// What the sensor does to training frames; test frames stay clean, they measure.
    pub noise: Noise,
    /// Share of the training frames into which a hand and forearm reach, 0..1.
    pub occluders: f64,
    /// A recording of play: in every training frame hands hold the parts that move, and move along;
    /// `time` runs. Instead of `occluders`.
    pub play: bool,
    /// A film: two captures, `scan` (the joints where they start, `views` pictures on a walk) and
    /// `play` (so many pictures of one camera that looks on while hands move the joints), as an app
    /// leaves them. `states`, test views, `play`, masks and the trajectory are then given.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub film: Option<usize>,
    /// What stands around the object, and what happens to it and to the recording.
    #[serde(skip_serializing_if = "World::is_default")]
    pub world: World,
    /// Write the truth folder beside the recording.
    pub truth: bool,
    /// Of everything random: the same seed gives the same recording.
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
            noise: Noise::None,
            occluders: 0.0,
            play: false,
            film: None,
            world: World::default(),
            truth: true,
            seed: 0,
        }
    }
}

/// Imitated sensors.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Noise {
    /// A perfect sensor.
    #[default]
    None,
    /// Intel RealSense D435, with the ragged masks and poses around it: see `noise/d435.rs`.
    D435,
    /// Depth of a stereo camera as neighbouring pixels share its errors, and colour noise.
    Stereo,
    /// Depth of a time-of-flight sensor (a phone's LiDAR), and colour noise.
    Tof,
}

/// What was recorded.
#[derive(Clone, Debug)]
pub struct SynthReport {
    /// Folder of the recording.
    pub recording: PathBuf,
    /// `None` when the configuration wanted none.
    pub truth: Option<PathBuf>,
    /// How many frames were written, over all states.
    pub frames: usize,
    /// Joint name, first and last value of its play.
    pub ranges: Vec<(String, [f64; 2])>,
    /// What a person should know: joints that hardly move, a sentence each.
    pub notes: Vec<String>,
}

/// A film with fewer pictures holds no play.
const FEWEST_PICTURES: usize = 10;

impl SynthConfig {
    /// The same with what a film decides: the scan is a state, every picture of the play another.
    pub(super) fn resolved(&self) -> Self {
        let Some(pictures) = self.film else { return self.clone() };
        let world = World { masks: Masks::None, trajectory: Trajectory::Walk, ..self.world.clone() };
        Self { states: 1 + pictures, test_views: 0, test_states: 0, play: true, world, ..self.clone() }
    }
}

pub(super) fn validate(c: &SynthConfig) -> Result<(), CaptureError> {
    let checks = [
        (c.states >= 1, "states", c.states.to_string(), "1 or more; 2 and more show motion"),
        (c.views >= 1, "views", c.views.to_string(), "1 or more; 60 is a good recording"),
        ((8..=4096).contains(&c.size), "size", c.size.to_string(), "8 to 4096 pixels"),
        (c.fov_deg > 5.0 && c.fov_deg < 120.0, "fov_deg", c.fov_deg.to_string(), "5 to 120 degrees"),
        ((0.0..=1.0).contains(&c.occluders), "occluders", c.occluders.to_string(), "a share from 0 to 1"),
        (
            c.world.lens.is_none_or(|l| l.is_sane()),
            "lens",
            format!("{:?}", c.world.lens),
            "8 to 4096 pixels, 5 to 120 degrees, cx and cy near the middle",
        ),
        (drift_is_sane(c), "drift", format!("{:?}", c.world.drift), "0 to 45 degrees, 0 mm or more"),
        (push_is_sane(c), "push", format!("{:?}", c.world.push), "finite mm and degrees, in states from 1 to the last"),
        (
            c.film.is_none_or(|n| n >= FEWEST_PICTURES && c.occluders == 0.0 && c.world.push.is_none()),
            "film",
            format!("{:?}", c.film),
            "10 pictures or more, without occluders and push: hands are in the film anyway",
        ),
        (!(c.play && c.occluders > 0.0), "occluders", c.occluders.to_string(), "0 with play: hands are in all frames"),
    ];
    match checks.into_iter().find(|(good, ..)| !good) {
        None => Ok(()),
        Some((_, key, value, hint)) => {
            Err(CaptureError::new(format!("{key} is out of range"), format!("synth: {key} = {value}"), hint))
        }
    }
}

fn push_is_sane(c: &SynthConfig) -> bool {
    c.world.push.as_ref().is_none_or(|p| {
        let finite = p.mm.is_finite() && p.deg.is_finite();
        finite && c.states > 1 && p.states.iter().all(|s| (1..c.states).contains(s))
    })
}

fn drift_is_sane(c: &SynthConfig) -> bool {
    c.world.drift.is_none_or(|d| (0.0..=45.0).contains(&d.deg) && d.mm >= 0.0 && d.mm.is_finite())
}
