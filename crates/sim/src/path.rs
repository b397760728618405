//! The way of the grasped spot, and whether a part ended where the true joint would have it.
//!
//! A compliant hand opens many a wrong hinge: that the joint moved says little about where the part
//! now is. So besides `success` there is *as true*: at the end of the episode the grasped spot of
//! the part lies within [`TOLERANCE`] of the way on which the true object's joint leads it, at a
//! point of that way where the task is done. Base frame, simulated metres.
//!
//! ```text
//! hinge: spot(q) = foot + R(axis, q - closed) r       slide: spot(q) = spot + (q - closed) axis
//! off(p) = min over q in [goal, far end] |p - spot(q)|
//! ```

use crate::scene::Scene;
use crate::task::{CLOSE_FROM, TaskKind, TaskSpec};
use glam::DVec3;
use hingecast_geom::Screw;

/// Half the width of a pad, m: a hand that is sent to where the true object would have the spot
/// still closes on it with the middle of its pads. What comes after opening (reaching in, taking
/// over with another hand, closing again) begins with such a move.
pub const TOLERANCE: f64 = 0.0085;
/// Of the spot's whole move at most this share is tolerated: what has not moved must never count.
const SHARE: f64 = 0.25;

/// Where a scene's own joint leads the spot that the task grasps.
#[derive(Clone, Debug)]
pub struct SpotPath {
    /// The joint as it stands when closed; positive motion opens.
    pub screw: Screw,
    /// The spot when closed.
    pub spot: DVec3,
    /// The task's range, rad or m.
    pub travel: f64,
    kind: TaskKind,
}

impl SpotPath {
    /// The way on which the scene's joint leads the grasped spot.
    pub fn of(scene: &Scene) -> Self {
        let target = &scene.target;
        let mut screw = target.screw;
        if target.open < target.closed {
            screw.axis = -screw.axis;
        }
        let task: &TaskSpec = &scene.task;
        Self { screw, spot: task.grasp.trans, travel: task.travel, kind: task.kind }
    }

    /// The spot after this share of the range.
    pub fn at(&self, share: f64) -> DVec3 {
        self.screw.motion(share * self.travel).apply(self.spot)
    }

    /// Shares of the range between which the task is done.
    fn done(&self) -> [f64; 2] {
        let goal = self.kind.goal();
        if self.kind == TaskKind::Close { [0.0, goal] } else { [goal, 1.0] }
    }

    /// The spot where the task begins to be done.
    pub fn goal(&self) -> DVec3 {
        self.at(self.kind.goal())
    }

    /// How far `point` is from the way, where the task is done, m.
    pub fn off(&self, point: DVec3) -> f64 {
        let done = self.done();
        let [lo, hi] = done.map(|share| share * self.travel);
        // The value at which the way is nearest to the point, if the joint may stand there; else
        // one of the two ends.
        let nearest = if self.screw.kind.turns() {
            let radius = |x: DVec3| (x - self.screw.pivot).reject_from_normalized(self.screw.axis);
            let (from, to) = (radius(self.spot), radius(point));
            let turn = self.screw.axis.dot(from.cross(to)).atan2(from.dot(to));
            // The same turn with the next whole number of turns that is not below the range.
            lo + (turn - lo).rem_euclid(std::f64::consts::TAU)
        } else {
            (point - self.spot).dot(self.screw.axis)
        };
        let inside = (lo..=hi).contains(&nearest).then(|| nearest / self.travel);
        let shares = done.into_iter().chain(inside);
        shares.map(|share| self.at(share).distance(point)).fold(f64::INFINITY, f64::min)
    }

    /// What counts as on the way, m.
    pub fn tolerance(&self) -> f64 {
        let start = if self.kind == TaskKind::Close { CLOSE_FROM } else { 0.0 };
        TOLERANCE.min(SHARE * self.at(start).distance(self.goal()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use hingecast_geom::JointKind;

    fn path(kind: JointKind, travel: f64, task: TaskKind) -> SpotPath {
        let screw = Screw { kind, axis: DVec3::Z, pivot: DVec3::new(0.0, 0.0, 7.0) };
        SpotPath { screw, spot: DVec3::X, travel, kind: task }
    }

    /// Against the same minimum by trying 20 000 values.
    #[test]
    fn the_distance_is_the_smallest_one_over_the_done_part_of_the_way() {
        let mut rng = fastrand::Rng::with_seed(4);
        for k in 0..300 {
            let kind = if k % 3 == 0 { JointKind::Prismatic } else { JointKind::Revolute };
            let task = if k % 2 == 0 { TaskKind::Open } else { TaskKind::Close };
            let p = path(kind, 0.3 + 5.9 * rng.f64(), task);
            let mut draw = || 3.0 * rng.f64() - 1.5;
            let point = DVec3::new(draw(), draw(), draw());
            let [lo, hi] = p.done();
            let tried = (0..=20_000).map(|i| p.at(lo + (hi - lo) * i as f64 / 20_000.0).distance(point));
            let slow = tried.fold(f64::INFINITY, f64::min);
            assert!((p.off(point) - slow).abs() < 2e-4, "{p:?} {point}: {} {slow}", p.off(point));
        }
    }

    #[test]
    fn a_part_that_has_not_moved_is_off_however_short_its_way() {
        for travel in [1e-3, 0.02, 1.5] {
            for kind in [JointKind::Revolute, JointKind::Prismatic] {
                let p = path(kind, travel, TaskKind::Open);
                assert!(p.off(p.spot) > p.tolerance() && p.off(p.goal()) < 1e-12 && p.off(p.at(0.8)) < 1e-12, "{p:?}");
                // A joint that stops at half of the range believes at a quarter that it is done.
                assert!(p.off(p.at(0.25)) > p.tolerance(), "{p:?}");
                let close = path(kind, travel, TaskKind::Close);
                assert!(close.off(close.at(CLOSE_FROM)) > close.tolerance() && close.off(close.at(0.05)) < 1e-12);
            }
        }
    }
}
