//! A session of tele-operation: the world under the person's keys, an episode being recorded, the
//! ones that were kept. Knows no terminal and no file; time comes in from outside, so a list of key
//! events and times is a session.
//!
//! Nothing is recorded until the person asks for it: then the world begins anew from the episode's
//! seed. It waits until the first key moves the hand, so that no episode begins with a person who
//! thinks. Success ends an episode and keeps it, as in scripted demonstrations. Undo goes back one
//! second: the world to that moment, the recording to that step.

use super::keys::{Command, Key, Keyboard, Stroke};
use crate::simulate::record::{Tape, WorldArgs, env_args, episode_seed, masks};
use hingecast::failure::Result;
use hingecast_policy::Demos;
use hingecast_sim::env::Moment;
use hingecast_sim::{Env, Outcome, Scene, Start};
use std::time::Duration;

/// Steps that one undo takes back: a second.
pub const UNDO_STEPS: usize = 20;

/// A world under a person's keys, and the episodes recorded in it.
pub struct Session {
    /// The world that the keys move.
    pub env: Env,
    /// What is kept: episodes from before this session, then its own.
    pub demos: Demos,
    keyboard: Keyboard,
    world: WorldArgs,
    /// Episodes that were there before this session: they cannot be taken back.
    before: usize,
    recording: Option<Recording>,
    /// The world stands still until a key moves the hand.
    waiting: bool,
    quit: bool,
    changed: bool,
    notice: String,
}

struct Recording {
    tape: Tape,
    /// The moment before each step.
    moments: Vec<Moment>,
}

/// What the status lines say.
#[derive(Clone, Debug, PartialEq)]
pub struct Status {
    /// Whether an episode is being recorded; else the person practises.
    pub recording: bool,
    /// Control steps of the recording so far; 0 without one.
    pub steps: usize,
    /// Steps that rollouts of this task last.
    pub horizon: usize,
    /// How far the joint is from closed, share of the task's range.
    pub moved: f64,
    /// Whether the task is done at this moment.
    pub success: bool,
    /// Episodes in the file, those from before this session included.
    pub kept: usize,
    /// From the grip site to the place to hold, world frame, m.
    pub to_grasp: [f64; 3],
    /// Whether both fingers touch the moving part.
    pub holding: bool,
    /// Whether the fingers are asked to close.
    pub closed: bool,
    /// Share of full speed, 0.1 to 1.
    pub speed: f64,
    /// What the last command did, as a sentence.
    pub notice: String,
}

impl Session {
    /// The world at the start of the next episode; nothing is recorded yet. `world` must be that of
    /// `scene`: it goes into the demonstrations. `kept`: demonstrations of the same world to go on
    /// from; `None` for a new file. `releases`: whether the terminal tells when keys go up.
    pub fn new(scene: &Scene, world: WorldArgs, kept: Option<Demos>, releases: bool) -> Self {
        let demos = kept.unwrap_or_else(|| Demos { env_args: env_args(&world), ..Demos::default() });
        let mut out = Self {
            env: Env::new(scene),
            before: demos.episodes.len(),
            demos,
            keyboard: Keyboard::new(releases),
            world,
            recording: None,
            waiting: true,
            quit: false,
            changed: false,
            notice: "Enter begins to record; until then you practise".into(),
        };
        out.begin();
        out
    }

    /// A key event at `now`, the time since some moment that is the same for all calls. Commands
    /// are obeyed at once, motions by the next steps.
    ///
    /// # Panics
    /// A [`Key::Move`] whose axis is above 5.
    pub fn key(&mut self, key: Key, stroke: Stroke, now: Duration) {
        let closed = self.keyboard.closed;
        let command = self.keyboard.event(key, stroke, now);
        if self.keyboard.closed != closed {
            self.waiting = false;
        }
        match command {
            None => {}
            Some(Command::Quit) => self.quit = true,
            Some(Command::Record) if self.recording.is_some() => self.stop(),
            Some(Command::Record) => {
                self.begin();
                self.recording = Some(Recording { tape: Tape::begin(&self.env), moments: Vec::new() });
                self.notice = "recording; it begins with your first motion".into();
            }
            Some(Command::Discard) => self.discard("discarded; Enter records from the same start"),
            Some(Command::Undo) => self.undo(),
            Some(Command::TakeBack) => self.take_back(),
        }
    }

    /// One control step of 50 ms, if the world does not wait. `now`: as for [`Session::key`]; which
    /// motions are held then. While recording, success ends the episode and keeps it, and an object
    /// that is knocked away discards it.
    ///
    /// # Errors
    /// Never in practice: the keys' actions are finite.
    pub fn step(&mut self, now: Duration) -> Result<()> {
        self.waiting &= !self.keyboard.moving(now);
        if self.waiting {
            return Ok(());
        }
        let action = self.keyboard.action(now);
        if let Some(recording) = &mut self.recording {
            recording.moments.push(self.env.moment());
            recording.tape.note(&self.env, &action);
        }
        self.env.step(&action)?;
        if self.recording.is_some() {
            match self.env.outcome() {
                Outcome::Success => self.keep("success"),
                Outcome::KnockedAway => self.discard("knocked away, discarded; Enter records from the same start"),
                _ => {}
            }
        }
        Ok(())
    }

    /// All motions end: the terminal lost the focus, so releases go elsewhere.
    pub fn let_go(&mut self) {
        self.keyboard.let_go();
    }

    /// Whether [`Command::Quit`] was given; the session can still be driven.
    pub fn wants_to_quit(&self) -> bool {
        self.quit
    }

    /// Whether the kept episodes changed since the last call.
    pub fn take_changed(&mut self) -> bool {
        std::mem::take(&mut self.changed)
    }

    /// Where the object stands, and the state: what a picture needs.
    pub fn shown(&self) -> Start {
        self.env.start()
    }

    /// What the status lines say at this moment.
    pub fn status(&self) -> Status {
        let to_grasp = (self.env.grasp().trans - self.env.grip().trans).to_array();
        Status {
            recording: self.recording.is_some(),
            steps: self.recording.as_ref().map_or(0, |r| r.tape.actions().len()),
            horizon: self.env.scene.task.horizon,
            moved: self.env.moved(),
            success: self.env.success(),
            kept: self.demos.episodes.len(),
            to_grasp,
            holding: self.env.holding(),
            closed: self.keyboard.closed,
            speed: self.keyboard.speed(),
            notice: self.notice.clone(),
        }
    }

    /// The start of the next episode; nothing is recorded.
    fn begin(&mut self) {
        self.env.reset(episode_seed(self.world.seed, self.demos.episodes.len()));
        self.keyboard.closed = false;
        self.recording = None;
        self.waiting = true;
    }

    fn stop(&mut self) {
        match self.recording.as_ref().map_or(0, |r| r.tape.actions().len()) {
            0 => self.discard("nothing had moved yet; nothing is kept"),
            _ => self.keep("stopped before the task was done (Delete takes it back)"),
        }
    }

    fn keep(&mut self, why: &str) {
        let Some(Recording { tape, .. }) = self.recording.take() else { return };
        let steps = tape.actions().len();
        self.demos.episodes.push(tape.finish(&self.env));
        self.renew_masks();
        self.notice = format!("kept demo_{} of {steps} steps: {why}", self.demos.episodes.len() - 1);
        self.begin();
    }

    fn discard(&mut self, why: &str) {
        self.notice = match self.recording.is_some() {
            true => why.into(),
            false => "nothing is being recorded; back at the start".into(),
        };
        self.begin();
    }

    fn undo(&mut self) {
        let Some(recording) = &mut self.recording else {
            self.notice = "nothing is being recorded: nothing to undo".into();
            return;
        };
        let to = recording.moments.len().saturating_sub(UNDO_STEPS);
        if let Some(moment) = recording.moments.get(to) {
            self.env.go_back(moment);
            recording.moments.truncate(to);
            recording.tape.cut(to);
        }
        // The fingers as they were asked to be then.
        self.keyboard.closed = recording.tape.actions().last().is_some_and(|a| a[6] > 0.0);
        self.waiting = true;
        self.notice = format!("back at step {to}; it goes on with your next motion");
    }

    fn take_back(&mut self) {
        if self.recording.is_some() || self.demos.episodes.len() <= self.before {
            self.notice = "only an episode that this session has kept can be taken back, between two recordings".into();
            return;
        }
        self.demos.episodes.pop();
        self.renew_masks();
        self.notice = format!("demo_{} is taken back", self.demos.episodes.len());
        self.begin();
    }

    /// `train` and `valid` cover all episodes; a file's other masks stay.
    fn renew_masks(&mut self) {
        self.demos.masks.remove("valid");
        self.demos.masks.extend(masks(self.demos.episodes.len()));
        self.changed = true;
    }
}
