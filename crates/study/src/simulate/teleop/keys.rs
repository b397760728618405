//! From keys and time to actions. Knows no terminal: events come in with their time, actions and
//! commands go out.
//!
//! A terminal tells when a key goes down and repeats it while it is held; few tell when it goes up
//! (the kitty protocol does). So a motion lasts for 150 ms after each event of its key, or until
//! the release where releases are told. World frame, as the picture shows it: x to the right (away
//! from the arm), y into the picture, z up.

use hingecast_sim::env::ACTION;
use std::time::Duration;

/// How long a key counts as held after an event: longer than the gap between two repeats (30 to 50
/// ms, more over a network), short enough that a tap is a nudge of three steps.
const HOLD: Duration = Duration::from_millis(150);
/// Shares of full speed that can be chosen.
const SPEEDS: [f64; 6] = [0.1, 0.2, 0.35, 0.5, 0.7, 1.0];
const FIRST_SPEED: usize = 3;
/// Full turning is too quick to aim by: 0.5 rad of goal a step.
const TURN: f64 = 0.4;

/// What a key stands for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Key {
    /// The hand moves, or turns, while it is held.
    Move {
        /// 0 to 2: along x, y, z; 3 to 5: about x, y, z. World frame.
        axis: usize,
        /// In the axis' own direction, or against it; turns by the right-hand rule.
        forward: bool,
    },
    /// The fingers close if they were asked to open, and the other way round.
    Gripper,
    /// The next higher share of full speed, up to 1.
    Faster,
    /// The next lower share of full speed, down to 0.1.
    Slower,
    /// What [`Session::key`](super::session::Session::key) obeys at once.
    Command(Command),
}

/// What the session does at once.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Command {
    /// Begin to record; while recording: stop and keep.
    Record,
    /// Throw away what is being recorded and go back to the episode's start.
    Discard,
    /// One second back, in the world and in the recording.
    Undo,
    /// Throw the episode away that was kept last; never one from before this session.
    TakeBack,
    /// End the session; an episode that is being recorded is lost.
    Quit,
}

/// What happened to a key.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Stroke {
    /// It went down, or repeats itself on a terminal that cannot tell.
    Down,
    /// A repeat that is known to be one.
    Again,
    /// It went up; few terminals tell.
    Up,
}

/// Which keys are held, and what was chosen with them.
#[derive(Clone, Debug)]
pub(crate) struct Keyboard {
    /// Whether the terminal tells when keys go up.
    releases: bool,
    /// Per axis and direction (backward, forward): until when it counts as held.
    held: [[Option<Duration>; 2]; 6],
    /// The last event of a key that is no motion: a held one must not act twice.
    last: Option<(Key, Duration)>,
    speed: usize,
    /// Whether the fingers are asked to close.
    pub closed: bool,
}

impl Keyboard {
    pub fn new(releases: bool) -> Self {
        Self { releases, held: Default::default(), last: None, speed: FIRST_SPEED, closed: false }
    }

    /// Takes an event in; answers what is to be done at once.
    pub fn event(&mut self, key: Key, stroke: Stroke, now: Duration) -> Option<Command> {
        if let Key::Move { axis, forward } = key {
            self.held[axis][usize::from(forward)] = match stroke {
                Stroke::Up => None,
                _ if self.releases => Some(Duration::MAX),
                _ => Some(now + HOLD),
            };
            return None;
        }
        if stroke == Stroke::Up {
            return None;
        }
        let repeated = self.last.is_some_and(|(k, at)| k == key && !self.releases && now < at + HOLD);
        self.last = Some((key, now));
        if repeated || stroke == Stroke::Again {
            return None;
        }
        match key {
            Key::Gripper => self.closed = !self.closed,
            Key::Faster => self.speed = (self.speed + 1).min(SPEEDS.len() - 1),
            Key::Slower => self.speed = self.speed.saturating_sub(1),
            Key::Command(command) => return Some(command),
            Key::Move { .. } => {}
        }
        None
    }

    /// All motions end: the terminal lost the focus, and releases go elsewhere.
    pub fn let_go(&mut self) {
        self.held = Default::default();
    }

    /// Whether any motion is asked for.
    pub fn moving(&self, now: Duration) -> bool {
        self.held.iter().flatten().any(|until| until.is_some_and(|t| now < t))
    }

    /// The action that the keys ask for; opposite keys cancel.
    pub fn action(&self, now: Duration) -> [f64; ACTION] {
        let on = |until: Option<Duration>| f64::from(u8::from(until.is_some_and(|t| now < t)));
        let mut out = [0.0; ACTION];
        for (axis, [backward, forward]) in self.held.iter().enumerate() {
            let speed = if axis < 3 { self.speed() } else { TURN * self.speed() };
            out[axis] = speed * (on(*forward) - on(*backward));
        }
        out[ACTION - 1] = if self.closed { 1.0 } else { -1.0 };
        out
    }

    /// Share of full speed.
    pub fn speed(&self) -> f64 {
        SPEEDS[self.speed]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const RIGHT: Key = Key::Move { axis: 0, forward: true };
    const LEFT: Key = Key::Move { axis: 0, forward: false };

    fn ms(t: u64) -> Duration {
        Duration::from_millis(t)
    }

    #[test]
    fn a_tap_is_a_nudge_and_repeats_go_on() {
        let mut k = Keyboard::new(false);
        k.event(RIGHT, Stroke::Down, ms(0));
        assert_eq!(k.action(ms(149)), [0.5, 0.0, 0.0, 0.0, 0.0, 0.0, -1.0]);
        assert!(k.action(ms(150)) == [0.0, 0.0, 0.0, 0.0, 0.0, 0.0, -1.0] && !k.moving(ms(150)));
        for t in (500..900).step_by(40) {
            k.event(RIGHT, Stroke::Down, ms(t));
            assert!(k.moving(ms(t + 39)));
        }
        k.event(LEFT, Stroke::Down, ms(880));
        assert_eq!(k.action(ms(890))[0], 0.0, "opposite keys cancel");
        k.event(RIGHT, Stroke::Up, ms(900));
        assert_eq!(k.action(ms(901))[0], -0.5);
    }

    #[test]
    fn with_releases_a_key_is_held_until_it_goes_up() {
        let mut k = Keyboard::new(true);
        k.event(RIGHT, Stroke::Down, ms(0));
        k.event(Key::Move { axis: 5, forward: false }, Stroke::Down, ms(0));
        let action = k.action(ms(60_000));
        assert!((action[0], action[5]) == (0.5, -0.2), "{action:?}");
        k.event(RIGHT, Stroke::Up, ms(60_001));
        assert_eq!(k.action(ms(60_002))[0], 0.0);
        k.let_go();
        assert!(!k.moving(ms(60_003)));
    }

    #[test]
    fn a_held_command_acts_once() {
        let mut k = Keyboard::new(false);
        let undo = Key::Command(Command::Undo);
        assert_eq!(k.event(undo, Stroke::Down, ms(0)), Some(Command::Undo));
        for t in [40, 80, 120, 250] {
            assert_eq!(k.event(undo, Stroke::Down, ms(t)), None, "at {t}");
        }
        assert_eq!(k.event(undo, Stroke::Down, ms(500)), Some(Command::Undo));
        k.event(Key::Gripper, Stroke::Down, ms(600));
        k.event(Key::Gripper, Stroke::Down, ms(640));
        assert!(k.closed && k.action(ms(641))[6] == 1.0);
        let mut k = Keyboard::new(true);
        k.event(Key::Gripper, Stroke::Down, ms(0));
        k.event(Key::Gripper, Stroke::Again, ms(500));
        k.event(Key::Gripper, Stroke::Up, ms(700));
        k.event(Key::Gripper, Stroke::Down, ms(760));
        assert!(!k.closed, "pressed twice");
    }

    #[test]
    fn speed_stays_between_its_ends() {
        let mut k = Keyboard::new(true);
        for _ in 0..9 {
            k.event(Key::Faster, Stroke::Down, ms(0));
        }
        assert_eq!(k.speed(), 1.0);
        for _ in 0..9 {
            k.event(Key::Slower, Stroke::Down, ms(0));
        }
        assert_eq!(k.speed(), 0.1);
    }
}
