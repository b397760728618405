//! Moments of an episode that can be gone back to: what tele-operation undoes. Everything that the
//! next step depends on is kept, the solver's warm start too, so going on from a moment gives the
//! bits that going on the first time gave.

use super::Env;
use mujoco_rs::prelude::*;

/// All that the next step of physics reads: time, positions, velocities, actuation, controls, warm
/// start, mocap bodies.
const PHYSICS: u32 = MjtState::mjSTATE_INTEGRATION as u32;

/// All that going on from one instant of an episode needs.
#[derive(Clone, Debug)]
pub struct Moment {
    physics: Box<[f64]>,
    gripper: [f64; 2],
    touched: bool,
    held: bool,
    holding: bool,
    finite: bool,
    moved_most: f64,
}

impl Env {
    /// The present moment of this episode.
    pub fn moment(&self) -> Moment {
        Moment {
            physics: self.data.state(PHYSICS),
            gripper: self.gripper,
            touched: self.touched,
            held: self.held,
            holding: self.holding,
            finite: self.finite,
            moved_most: self.moved_most,
        }
    }

    /// Back to a moment of the same episode.
    ///
    /// # Panics
    /// When the moment is of another scene.
    pub fn go_back(&mut self, moment: &Moment) {
        self.data.set_state(&moment.physics, PHYSICS).expect("a moment of this scene");
        self.data.kinematics();
        self.gripper = moment.gripper;
        (self.touched, self.held, self.holding) = (moment.touched, moment.held, moment.holding);
        (self.finite, self.moved_most) = (moment.finite, moment.moved_most);
    }
}
