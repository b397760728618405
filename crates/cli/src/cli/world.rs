//! Flags of what stands around a rendered object.

use super::words;
use clap::Args;
use hingecast_capture::synth::{Drift, Frames, Lens, Masks, Push, Scenery, Trajectory, World};

#[derive(Args, Debug, Clone)]
pub struct WorldSettings {
    /// What stands around the object: `room` is a floor of 3 to 4 m, a wall 1 to 3 cm behind the
    /// object and clutter 10 cm and more beside it; cameras stay in front of the wall.
    #[arg(long, default_value = "none", value_parser = words::<Scenery>(&["none", "room"]))]
    pub scene: Scenery,
    /// Pictures of a sensor instead of square ones: `iphone` (256 x 192 pixels, focal length 212),
    /// `d435` (640 x 480, 615), or all six numbers in pixels; `/N` makes them smaller by N
    /// [default: --size, with a field of view of 40 deg].
    #[arg(long, value_name = "NAME|W,H,FX,FY,CX,CY", conflicts_with = "size")]
    pub camera: Option<Lens>,
    /// Where cameras go: all around from above; a hand-held arc of 200 deg around the front, anew
    /// in each state; or within 70 deg of the front.
    #[arg(long, default_value = "hemisphere", value_parser = words::<Trajectory>(&["hemisphere", "walk", "front"]))]
    pub trajectory: Trajectory,
    /// Poses of training frames drift along the way of each state, in the order of the views, by up
    /// to DEG degrees and MM millimetres; the first is right [default: no drift].
    #[arg(long, value_name = "DEG:MM")]
    pub drift: Option<Drift>,
    /// Masks of the training frames: `true` to the sensor, `none` (nor for test frames), or `sam`:
    /// ragged by 1 to 3 pixels, with holes, now and then with a piece too much or missing.
    #[arg(long, default_value = "true", value_parser = words::<Masks>(&["true", "none", "sam"]))]
    pub masks: Masks,
    /// Frames of reference: `per-state` turns each state's cameras but the first's about `up` by 0
    /// to 360 deg and shifts them by up to 2 m, as phone scans are; `tilted` turns them in any way
    /// [default: shared; with --film, of which the scan is a state and the play one, per-state].
    #[arg(long, value_parser = words::<Frames>(&["shared", "per-state", "tilted"]))]
    pub frames: Option<Frames>,
    /// The object is pushed by MM millimetres and turned by DEG degrees, 2 unless given, between
    /// two states, and stays there [default: not pushed].
    #[arg(long, value_name = "MM[:DEG]")]
    pub push: Option<Push>,
    /// First states after a push each [default: one, which the seed picks].
    #[arg(long, value_name = "N,...", value_delimiter = ',', requires = "push")]
    pub push_states: Vec<usize>,
}

impl WorldSettings {
    /// `film`: whether a film is recorded.
    pub fn world(&self, film: bool) -> World {
        let push = self.push.clone().map(|push| Push { states: self.push_states.clone(), ..push });
        World {
            scene: self.scene,
            masks: self.masks,
            frames: self.frames.unwrap_or(if film { Frames::PerState } else { Frames::Shared }),
            push,
            lens: self.camera,
            trajectory: self.trajectory,
            drift: self.drift,
        }
    }
}
