//! Where on the moving part a parallel gripper can close, found from collision geometry alone.
//!
//! For every way to come (from above, or leaning from four sides) and every direction to close in,
//! rays ask a grid over the part: what is met first, and how thick is it a little deeper? Where
//! both fingers would meet the moving part, the open hand is put there, on the way there, and along
//! the joint's way, and MuJoCo says whether it collides.
//!
//! A hinge turns its part, and a hand that does not turn with it needs a place that may turn
//! between the fingers: one where the closing direction lies along the axis. Elsewhere the wrist
//! turns with the part.

mod judge;
mod reach;

use crate::SimError;
use crate::object::{self, ObjectJoint, bounds, hangs_on, write_pose};
use crate::scene::alone;
use crate::task::{TABLE, TaskKind, TaskSpec};
use glam::{DMat3, DQuat, DVec3};
use hingecast_geom::{JointKind, Pose, Screw};
use mujoco_rs::prelude::*;
use reach::{farthest, hardly_moves, reachable_scale, two_digits};
use std::f64::consts::{FRAC_PI_2, FRAC_PI_4};
use std::path::Path;
use std::sync::Arc;

const GRIPPER: &str = include_str!("../assets/gripper.xml");
/// The hand opens 80 mm; a person leaves some room.
const WIDEST: f64 = 0.07;
/// Thinner things than a sheet of card are not pinched reliably.
const THINNEST: f64 = 0.003;
/// Half of what the hand opens, m: where the pads' inner faces are then.
const HALF_OPEN: f64 = 0.04;
/// Points of a finger's inner face, wide open, in the grip's frame: across, along the approach,
/// from the middle, m (gripper.xml).
const FINGER: [[f64; 3]; 8] = [
    [-0.0085, 0.0088, HALF_OPEN],
    [0.0085, 0.0088, HALF_OPEN],
    [-0.0085, -0.0088, HALF_OPEN],
    [0.0085, -0.0088, HALF_OPEN],
    [-0.0105, -0.02, 0.046],
    [0.0105, -0.02, 0.046],
    [-0.0105, -0.045, 0.046],
    [0.0105, -0.045, 0.046],
];
/// How deep the pads' middle may sit below the surface that is met first, m. The pads reach 9 mm
/// farther.
const DEPTHS: [f64; 3] = [0.008, 0.016, 0.024];
/// The same for small pieces, m: enough to hold.
const TIPS: f64 = 0.003;
/// How far the hand may lean back from pointing down when it comes from a side, rad. The sixth
/// joint ends at 3.75 rad, 0.8 beyond the start; a level hand needs the fifth joint at its stop.
const TILTS: [f64; 5] = [0.5, 0.75, 1.0, 1.3, FRAC_PI_2];
/// The last stretch of the approach must be free, m.
const APPROACH: [f64; 3] = [0.0, 0.04, 0.09];
/// Shares of the range at which the hand must still fit.
const ALONG: [f64; 3] = [0.2, 0.4, 0.6];
/// Overlap that contact may have there, m: the part rocks between the pads.
const ROCKING: f64 = 0.004;
/// A part of which no point goes so far has not been opened by anybody, m.
const LEAST_WAY: f64 = 0.005;
/// Longest way of the grasp to 60 % of the range, m: beyond it the arm would have to reach around
/// the object.
const LONGEST_WAY: f64 = 0.25;
/// Highest grasp above the table on that way, m.
const HIGHEST: f64 = 0.4;
/// Largest diagonal of the object, m.
const LARGEST: f64 = 0.75;
/// Where the middle of the way shall be on the table, m from its centre towards the far side: in
/// front of the arm with room on both sides. The covered box comes out at simulation.md's x
/// 0..0.06.
const MIDDLE: f64 = 0.0305;

/// A hand that leans stands between the arm and the grasp: so much farther away the object is put
/// when it lies level, m.
const BEHIND: f64 = 0.12;

/// One place to hold, with the object's turn on the table.
#[derive(Clone, Debug)]
pub struct Candidate {
    /// The task with this place to hold and this turn on the table.
    pub task: TaskSpec,
    /// How good the place is, without unit: more is better.
    pub score: f64,
}

/// How large the object shall be.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Size {
    /// Simulated metres per unit of the file.
    Exactly(f64),
    /// So many times what the arm reaches with ease, at most 1 metre per unit.
    Reachable(f64),
}

type Probe = MjData<Arc<MjModel>>;

/// The gripper in a probe's model, looked up by name once.
#[derive(Clone, Copy)]
struct Hand {
    body: usize,
    /// The geom that fingers hang on.
    palm: usize,
}

impl Hand {
    fn of(model: &MjModel) -> Self {
        let id = |kind, name: &str| model.name_to_id(kind, name).expect("a name in our own gripper");
        Self { body: id(MjtObjBase::mjOBJ_BODY, "gripper"), palm: id(MjtObjBase::mjOBJ_GEOM, "hand") }
    }

    fn owns(self, model: &MjModel, geom: usize) -> bool {
        model.geom_bodyid()[geom] as usize == self.body
    }
}

/// Tasks on this object, best first: one per place to hold. Empty when the gripper fits nowhere.
///
/// # Errors
/// When the model cannot be loaded, nothing moves, or `joint` is not there.
pub fn candidates(path: &Path, kind: TaskKind, joint: Option<&str>, size: Size) -> Result<Vec<Candidate>, SimError> {
    let data = alone(path, 1.0, Some(GRIPPER))?;
    let hand = Hand::of(data.model());
    let all = object::joints(data.model());
    let names: Vec<&str> = all.iter().map(|j| j.name.as_str()).collect();
    let place = path.display().to_string();
    if all.is_empty() {
        return Err(SimError::nothing_moves(place));
    }
    if let Some(name) = joint.filter(|n| !names.contains(n)) {
        return Err(SimError::task(
            format!("no joint '{name}' in the model"),
            place,
            format!("its hinges and slides are: {}", names.join(", ")),
        ));
    }
    let mut out = Vec::new();
    // The first joint that hardly moves, and whether any does more than that.
    let (mut still, mut moves) = (None, false);
    for j in all.iter().filter(|j| joint.is_none_or(|n| n == j.name)) {
        let s = match size {
            Size::Exactly(s) => s,
            Size::Reachable(factor) => two_digits((factor * reachable_scale(&mut data_at(&data), hand, j)).min(1.0)),
        };
        match at_scale(path, kind, &j.name, s)? {
            Reached::Places(places) => {
                moves = true;
                out.extend(places);
            }
            Reached::HardlyMoves(way) => still = still.or(Some((j, way))),
        }
    }
    if let (false, Some((j, way))) = (moves, still) {
        return Err(hardly_moves(j, way, place));
    }
    out.sort_by(|a, b| b.score.total_cmp(&a.score));
    Ok(distinct(out))
}

fn data_at(data: &Probe) -> Probe {
    let mut copy = MjData::new(data.model_clone());
    copy.kinematics();
    copy
}

/// What is found at one size of the object.
enum Reached {
    Places(Vec<Candidate>),
    /// No point of the part goes farther than this, m.
    HardlyMoves(f64),
}

fn at_scale(path: &Path, kind: TaskKind, name: &str, scale: f64) -> Result<Reached, SimError> {
    let none = || Ok(Reached::Places(Vec::new()));
    let mut data = alone(path, scale, Some(GRIPPER))?;
    park_gripper(&mut data);
    let Some(joint) = object::joints(data.model()).into_iter().find(|j| j.name == name) else { return none() };
    let hand = Hand::of(data.model());
    let (closed, open) = ends(&mut data, hand, &joint);
    pose_joint(&mut data, &joint, closed);
    let Some([low, _]) = object_bounds(&data, hand) else { return none() };
    let Some(part) = bounds(&data, |g| is_part(data.model(), g, &joint)) else { return none() };
    let screw = object::screw(&data, &joint);
    // A full turn ends where it began.
    let parts_of_way = (1..=8).map(|k| screw.motion((open - closed) * f64::from(k) / 8.0));
    let way = parts_of_way.map(|motion| farthest(part, &motion)).fold(0.0, f64::max);
    if way < LEAST_WAY {
        return Ok(Reached::HardlyMoves(way));
    }
    let search = Search { hand, closed, open, screw, low: low.z, part, joint };
    let mut base = TaskSpec::new(kind, name, scale);
    base.part_centre = 0.5 * (part[0] + part[1]);
    base.travel = (open - closed).abs();
    let mut out = Vec::new();
    for (approach, closing) in directions() {
        out.extend(search.scan(&mut data, approach, closing, &base));
    }
    Ok(Reached::Places(out))
}

/// Closed is the end at which the object is more compact; where both are alike, the one nearer to
/// the recorded zero.
fn ends(data: &mut Probe, hand: Hand, joint: &ObjectJoint) -> (f64, f64) {
    let volume = joint.range.map(|q| {
        pose_joint(data, joint, q);
        object_bounds(data, hand).map_or(0.0, |[lo, hi]| {
            let size = hi - lo;
            size.x * size.y * size.z
        })
    });
    let [lo, hi] = joint.range;
    let first = if (volume[0] - volume[1]).abs() < 0.02 * volume[0].max(volume[1]) {
        lo.abs() <= hi.abs()
    } else {
        volume[0] < volume[1]
    };
    if first { (lo, hi) } else { (hi, lo) }
}

/// Ways to come and directions to close, base frame.
fn directions() -> Vec<(DVec3, DVec3)> {
    let mut out: Vec<(DVec3, DVec3)> = (0..4)
        .map(|k| (DVec3::NEG_Z, DVec3::new((k as f64 * FRAC_PI_4).cos(), (k as f64 * FRAC_PI_4).sin(), 0.0)))
        .collect();
    for ahead in [DVec3::X, DVec3::NEG_X, DVec3::Y, DVec3::NEG_Y] {
        for tilt in TILTS {
            let approach = ahead * tilt.sin() - DVec3::Z * tilt.cos();
            let side = ahead.cross(DVec3::Z);
            out.push((approach, side));
            out.push((approach, side.cross(approach)));
        }
    }
    out
}

struct Search {
    hand: Hand,
    joint: ObjectJoint,
    closed: f64,
    open: f64,
    /// Base frame, joint closed.
    screw: Screw,
    /// Lowest point of the object: the table.
    low: f64,
    part: [DVec3; 2],
}

impl Search {
    fn scan(&self, data: &mut Probe, approach: DVec3, closing: DVec3, base: &TaskSpec) -> Vec<Candidate> {
        let side = approach.cross(closing);
        let [lo, hi] = self.part;
        let extent = |d: DVec3| {
            let half = 0.5 * (hi - lo);
            (0.5 * (lo + hi).dot(d), half.dot(d.abs()))
        };
        let ((cu, hu), (cv, hv), (ca, ha)) = (extent(closing), extent(side), extent(approach));
        let step = (2.0 * hu.max(hv) / 48.0).max(0.004);
        let (nu, nv) = ((hu / step).ceil() as i32, (hv / step).ceil() as i32);
        // A place that was judged before may have left the part half open.
        pose_joint(data, &self.joint, self.closed);
        // First pass: where would the fingers meet the part on both sides? Handles and knobs are
        // smaller than the grid's step.
        let mut places = self.details(data, approach, closing);
        let mut hits: Vec<(i32, i32, DVec3, f64)> = Vec::new();
        for u in -nu..=nu {
            for v in -nv..=nv {
                let above =
                    closing * (cu + u as f64 * step) + side * (cv + v as f64 * step) + approach * (ca - ha - 0.2);
                if let Some((point, width)) = self.pinch(data, above, approach, closing) {
                    hits.push((u, v, point, width));
                }
            }
        }
        for &(u, v, point, width) in &hits {
            // A place whose neighbours could be held as well forgives errors.
            let room = hits.iter().filter(|h| (h.0 - u).abs() <= 3 && (h.1 - v).abs() <= 3).count() as f64 / 49.0;
            places.push((point, width, room));
        }
        let mut out = Vec::new();
        for (point, width, room) in places {
            let grasp = Pose::from_mat3_trans(DMat3::from_cols(closing.cross(approach), closing, approach), point);
            for turn_wrist in self.wrists(closing) {
                if let Some(c) = self.judge(data, &grasp, width, room, turn_wrist, base) {
                    out.push(c);
                }
            }
        }
        out
    }

    /// Follows a ray to the part and measures its thickness a little deeper: the middle between the
    /// fingers, and the width.
    fn pinch(&self, data: &mut Probe, from: DVec3, approach: DVec3, closing: DVec3) -> Option<(DVec3, f64)> {
        let met = self.ray(data, from, approach)?;
        // Deepest first: a better hold, where there is one.
        DEPTHS.iter().rev().find_map(|depth| self.thickness(data, from + approach * (met + depth), closing))
    }

    /// The middle of the part between the fingers if they close about `at`, and its width.
    fn thickness(&self, data: &mut Probe, at: DVec3, closing: DVec3) -> Option<(DVec3, f64)> {
        let near = self.ray(data, at - closing * HALF_OPEN, closing)?;
        let far = self.ray(data, at + closing * HALF_OPEN, -closing)?;
        let width = 2.0 * HALF_OPEN - near - far;
        let middle = at + closing * (0.5 * (near - far));
        ((THINNEST..=WIDEST).contains(&width)).then_some((middle, width))
    }

    /// Places on the part's own small pieces (bars, knobs): in their middle, and just below the
    /// face that is met first, where the tips of the fingers need less room behind.
    fn details(&self, data: &mut Probe, approach: DVec3, closing: DVec3) -> Vec<(DVec3, f64, f64)> {
        let side = approach.cross(closing);
        let pieces: Vec<[DVec3; 2]> = {
            let model = data.model();
            let own = (0..model.ffi().ngeom as usize).filter(|&g| is_part(model, g, &self.joint));
            own.filter_map(|g| bounds(data, |other| other == g)).collect()
        };
        let mut out = Vec::new();
        for [lo, hi] in pieces {
            let (centre, half) = (0.5 * (lo + hi), 0.5 * (hi - lo));
            if 2.0 * half.dot(closing.abs()) > WIDEST {
                continue;
            }
            let deep = half.dot(approach.abs());
            for depth in [deep, TIPS] {
                let at = centre + approach * (depth - deep);
                let Some((middle, width)) = self.thickness(data, at, closing) else { continue };
                // How far to both sides could it be held as well?
                let beside = [-0.012, -0.008, -0.004, 0.004, 0.008, 0.012];
                let held = beside.iter().filter(|b| self.thickness(data, at + side * **b, closing).is_some()).count();
                out.push((middle, width, held as f64 / beside.len() as f64));
            }
        }
        out
    }

    /// Distance to the moving part, if it is the first thing met. A start inside a solid meets
    /// nothing.
    fn ray(&self, data: &mut Probe, from: DVec3, direction: DVec3) -> Option<f64> {
        let groups = [1, 1, 1, 1, 1, 0];
        let (geom, distance) = data.ray(&from.to_array(), &direction.to_array(), Some(&groups), true, None, None);
        geom.filter(|&g| is_part(data.model(), g, &self.joint)).map(|_| distance)
    }
}

/// Of candidates that are nearly the same, the best one.
fn distinct(sorted: Vec<Candidate>) -> Vec<Candidate> {
    let mut out: Vec<Candidate> = Vec::new();
    for c in sorted {
        let same = |o: &Candidate| {
            o.task.joint == c.task.joint
                && o.task.grasp.trans.distance(c.task.grasp.trans) < 0.02
                && (o.task.grasp.rot.inverse() * c.task.grasp.rot).w.abs() > 0.99
        };
        if !out.iter().any(same) {
            out.push(c);
        }
        if out.len() == 24 {
            break;
        }
    }
    out
}

fn object_bounds(data: &Probe, hand: Hand) -> Option<[DVec3; 2]> {
    bounds(data, |g| !hand.owns(data.model(), g))
}

fn is_part(model: &MjModel, geom: usize, joint: &ObjectJoint) -> bool {
    hangs_on(model, model.geom_bodyid()[geom] as usize, joint.body)
}

fn pose_joint(data: &mut Probe, joint: &ObjectJoint, q: f64) {
    data.qpos_mut()[joint.qpos] = q;
    data.kinematics();
}

fn place_gripper(data: &mut Probe, pose: &Pose) {
    write_pose(&mut data.qpos_mut()[..7], pose);
}

fn park_gripper(data: &mut Probe) {
    place_gripper(data, &Pose::from_trans(DVec3::new(0.0, 0.0, 50.0)));
}
