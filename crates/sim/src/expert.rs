//! A scripted demonstrator: hovers, comes down, closes, follows the joint's way. It knows the
//! joint's screw and the grasp frame of the object in front of it, and has a person's
//! imperfections: its own speed, approach and hover height in every episode, pauses, noise on every
//! action, and a second try when the part slips.

use crate::env::{ACTION, Env};
use crate::task::TaskKind;
use glam::{DQuat, DVec3};
use hingecast_geom::Pose;
use hingecast_geom::pose::rotation_vector;
use hingecast_geom::random::normal;

/// Steps of closing before the hand pulls.
const CLOSE_STEPS: usize = 8;
/// Standard deviation of each number of an action.
const NOISE: f64 = 0.05;
/// A hand that is farther than this from where it should hold has lost the part, m.
const LOST: f64 = 0.035;

#[derive(Clone, Copy, Debug, PartialEq)]
enum Phase {
    Hover,
    Descend,
    Close(usize),
    Follow,
    /// Open, and back off before the next try.
    Release(usize),
}

/// The demonstrator in one episode.
pub struct Expert {
    rng: fastrand::Rng,
    phase: Phase,
    /// Of the fastest motion.
    speed: f64,
    /// How far ahead on the joint's way the hand aims, m.
    lead: f64,
    hover: f64,
    /// Sideways error of the hover point, m.
    aside: DVec3,
    pause: usize,
    /// Chance of a pause at a change of phase.
    dreamy: f64,
    /// `grip_from_grasp` when the fingers closed: the hand does not sit exactly where it aimed.
    hold: Option<Pose>,
}

impl Expert {
    /// A person's habits for one episode, drawn from `seed`.
    pub fn new(seed: u64) -> Self {
        let mut rng = fastrand::Rng::with_seed(seed ^ 0x6465_6d6f_6e73_7472);
        let mut between = |lo: f64, hi: f64| lo + (hi - lo) * rng.f64();
        let speed = between(0.6, 1.0);
        let lead = between(0.025, 0.04);
        let hover = between(0.04, 0.09);
        let dreamy = between(0.0, 0.5);
        let aside = DVec3::new(between(-0.012, 0.012), between(-0.012, 0.012), 0.0);
        Self { rng, phase: Phase::Hover, speed, lead, hover, aside, pause: 0, dreamy, hold: None }
    }

    /// The next action in `env`, which must be the one that was acted in before.
    pub fn act(&mut self, env: &Env) -> [f64; ACTION] {
        let (grip, grasp) = (env.grip(), env.grasp());
        let mut action = if self.pause > 0 {
            self.pause -= 1;
            let fingers = if matches!(self.phase, Phase::Close(_) | Phase::Follow) { 1.0 } else { -1.0 };
            [0.0, 0.0, 0.0, 0.0, 0.0, 0.0, fingers]
        } else {
            self.decide(env, &grip, &grasp)
        };
        for a in &mut action[..6] {
            *a += NOISE * normal(&mut self.rng);
        }
        action.map(|a| a.clamp(-1.0, 1.0))
    }

    fn decide(&mut self, env: &Env, grip: &Pose, grasp: &Pose) -> [f64; ACTION] {
        // The hand comes along the grasp's z. A part that stands half open (task `close`) is met
        // with the wrist as it would be when closed, unless the wrist turns with the part.
        let task = &env.scene.task;
        let rot = if task.turn_wrist { grasp.rot } else { self.level(env, grasp) };
        let aim = Pose::new(rot, grasp.trans);
        let approach = rot * DVec3::Z;
        match self.phase {
            Phase::Hover => {
                let sideways = rot * self.aside;
                let to = Pose::new(rot, aim.trans - approach * self.hover + sideways);
                let off = (to.trans - grip.trans).length();
                let turned = rotation_vector(rot * grip.rot.inverse()).length();
                if off < 0.012 && turned < 0.12 {
                    self.enter(Phase::Descend);
                }
                self.towards(grip, &to, self.speed, -1.0)
            }
            Phase::Descend => {
                let off = (aim.trans - grip.trans).length();
                if off < 0.006 {
                    self.enter(Phase::Close(0));
                }
                // Sideways errors are taken out before depth: the fingers must straddle the part.
                let delta = aim.trans - grip.trans;
                let along = approach * delta.dot(approach);
                let across = delta - along;
                let patience = (1.0 - across.length() / 0.01).clamp(0.0, 1.0);
                let to = Pose::new(rot, grip.trans + across + along * patience);
                self.towards(grip, &to, 0.6 * self.speed, -1.0)
            }
            Phase::Close(n) => {
                if n + 1 >= CLOSE_STEPS {
                    self.hold = Some(grasp.inverse() * *grip);
                    self.enter(Phase::Follow);
                } else {
                    self.phase = Phase::Close(n + 1);
                }
                self.towards(grip, &aim, 0.3, 1.0)
            }
            Phase::Follow => {
                let hold = self.hold.unwrap_or(Pose::IDENTITY);
                if (grasp.apply(hold.trans) - grip.trans).length() > LOST {
                    self.enter(Phase::Release(0));
                }
                let (motion, _) = self.ahead(env, grasp);
                let next = motion * *grasp;
                let rot = if task.turn_wrist { next.rot * hold.rot } else { grip_level(grip, rot) };
                let to = Pose::new(rot, next.apply(hold.trans));
                self.towards(grip, &to, self.speed, 1.0)
            }
            Phase::Release(n) => {
                if n >= 10 {
                    self.enter(Phase::Hover);
                } else {
                    self.phase = Phase::Release(n + 1);
                }
                let to = Pose::new(grip.rot, grip.trans - approach * 0.03);
                self.towards(grip, &to, 0.5 * self.speed, -1.0)
            }
        }
    }

    /// The orientation of the hand for a part that the wrist does not follow: as if the part were
    /// closed.
    fn level(&self, env: &Env, grasp: &Pose) -> DQuat {
        let screw = env.screw();
        let back = env.scene.target.closed - env.joint_value();
        (screw.motion(back) * *grasp).rot
    }

    /// The joint's motion by the lead, and its sign.
    fn ahead(&self, env: &Env, grasp: &Pose) -> (Pose, f64) {
        let screw = env.screw();
        let target = &env.scene.target;
        let goal = match env.scene.task.kind {
            TaskKind::Close => target.closed,
            // A little beyond the bar of one half, and never against the stop.
            _ => {
                let range = target.open - target.closed;
                target.closed + range.signum() * (0.7 * env.scene.task.travel).min(0.9 * range.abs())
            }
        };
        let radius = if screw.kind.turns() { screw.distance(grasp.trans).max(0.01) } else { 1.0 };
        let step = (goal - env.joint_value()).clamp(-self.lead / radius, self.lead / radius);
        (screw.motion(step), step.signum())
    }

    fn enter(&mut self, phase: Phase) {
        self.phase = phase;
        if self.rng.f64() < self.dreamy {
            self.pause = self.rng.usize(1..6);
        }
    }

    /// Drives the grip site to `to`; `limit` bounds every number.
    fn towards(&self, grip: &Pose, to: &Pose, limit: f64, fingers: f64) -> [f64; ACTION] {
        // The arm covers about 15 mm in a step of full action (50 mm): more gain gets it there
        // sooner, less overshoots less.
        let v = (to.trans - grip.trans) * (1.6 / 0.05);
        let v = v * (limit / v.length().max(limit));
        let w = rotation_vector(to.rot * grip.rot.inverse()) * (0.8 / 0.5);
        let w = w * (0.6 * limit / w.length().max(0.6 * limit));
        [v.x, v.y, v.z, w.x, w.y, w.z, fingers]
    }
}

/// While following, a wrist that does not turn keeps its orientation.
fn grip_level(grip: &Pose, wanted: DQuat) -> DQuat {
    if grip.rot.dot(wanted) < 0.0 { -wanted } else { wanted }
}
