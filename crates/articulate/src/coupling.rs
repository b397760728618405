//! Joints that are a function of each other: two doors on one rod, a pair of scissors' handles that
//! a gear couples.
//!
//! Of every pair the value of one is fitted as a polynomial (degree 1, then 2) of the other's over
//! the states. Had the two been moved independently, each state beyond those that the polynomial
//! needs would have hit it by chance only, with probability (twice the tolerance) / (range): the
//! product says by how many nats the recording tells that they are coupled.

use crate::Doubt;
use hingecast_geom::{Certainty, Coupling, JointKind, KinematicTree};

/// A value is this sure at best: rad, and share of the object's diagonal.
const FINEST_TURN: f64 = 0.002;
const FINEST_SLIDE: f64 = 5e-4;
/// Standard deviations within which a value fits.
const SIGMAS: f64 = 3.0;
/// A joint that moves by fewer tolerances than this says nothing.
const MOVES: f64 = 10.0;
/// States whose values are nearer than this, tolerances, count as one.
const APART: f64 = 2.0;
/// Nats from which the recording tells, as everywhere; and from which it is worth a doubt.
const TELLS: f64 = 10.0;
const SUSPECT: f64 = 3.0;

/// The couplings that the recording tells, and a doubt for each that it only suggests. `certainty`:
/// one a joint, `None` where nothing is known.
pub fn find(tree: &KinematicTree, certainty: &[Option<Certainty>], diagonal: f64) -> (Vec<Coupling>, Vec<Doubt>) {
    let joints = &tree.joints;
    let tolerance: Vec<f64> = joints
        .iter()
        .enumerate()
        .map(|(j, joint)| {
            let finest = if joint.screw.kind.turns() { FINEST_TURN } else { FINEST_SLIDE * diagonal };
            let known = certainty.get(j).copied().flatten().map_or(0.0, |c| c.value);
            SIGMAS * finest.max(if known.is_finite() { known } else { f64::MAX })
        })
        .collect();
    let range = |j: usize| {
        let (lo, hi) = joints[j].values.iter().fold((f64::MAX, f64::MIN), |(l, h), &q| (l.min(q), h.max(q)));
        hi - lo
    };
    let able = |j: usize| joints[j].screw.kind != JointKind::Fixed && range(j) > MOVES * tolerance[j];
    // The one that is known best, against its range, leads.
    let mut order: Vec<usize> = (0..joints.len()).filter(|&j| able(j)).collect();
    order.sort_by(|&a, &b| (range(b) / tolerance[b]).total_cmp(&(range(a) / tolerance[a])).then(a.cmp(&b)));
    let (mut couplings, mut doubts) = (Vec::<Coupling>::new(), Vec::new());
    for (at, &follower) in order.iter().enumerate() {
        let free = |j: &&usize| couplings.iter().all(|c| c.follower != **j);
        let fits = order[..at].iter().filter(free).filter_map(|&leader| {
            let pair = Pair { leader: &joints[leader].values, follower: &joints[follower].values };
            let (polynomial, nats) = pair.relation(tolerance[leader], tolerance[follower], range(follower))?;
            Some((Coupling { follower, leader, polynomial }, nats))
        });
        let best = fits.max_by(|a, b| a.1.total_cmp(&b.1));
        match best {
            Some((coupling, nats)) if nats >= TELLS => couplings.push(coupling),
            Some((coupling, nats)) if nats >= SUSPECT => doubts.push(Doubt::MayFollow {
                joint: joints[follower].name.clone(),
                leader: joints[coupling.leader].name.clone(),
                nats,
            }),
            _ => {}
        }
    }
    couplings.sort_by_key(|c| c.follower);
    (couplings, doubts)
}

/// Values of two joints in the same states.
struct Pair<'a> {
    leader: &'a [f64],
    follower: &'a [f64],
}

impl Pair<'_> {
    /// The polynomial of least degree that fits all states, and its nats.
    fn relation(&self, leader_tol: f64, follower_tol: f64, range: f64) -> Option<([f64; 5], f64)> {
        let distinct = self.distinct(leader_tol, follower_tol);
        (1..=2).find_map(|degree| {
            let polynomial = self.least_squares(degree)?;
            let slope = |x: f64| polynomial[1] + 2.0 * polynomial[2] * x;
            let value = |x: f64| polynomial[0] + x * (polynomial[1] + x * polynomial[2]);
            let mut widest = 0.0f64;
            for (&x, &y) in self.leader.iter().zip(self.follower) {
                let tolerance = follower_tol.hypot(slope(x) * leader_tol);
                if !((value(x) - y).abs() <= tolerance) {
                    return None;
                }
                widest = widest.max(tolerance);
            }
            let spare = distinct.saturating_sub(degree + 1) as f64;
            Some((polynomial, spare * (range / (2.0 * widest)).max(1.0).ln()))
        })
    }

    /// States that differ from each other in either value.
    fn distinct(&self, leader_tol: f64, follower_tol: f64) -> usize {
        let mut kept: Vec<(f64, f64)> = Vec::new();
        for (&x, &y) in self.leader.iter().zip(self.follower) {
            let same = |k: &(f64, f64)| (k.0 - x).abs() < APART * leader_tol && (k.1 - y).abs() < APART * follower_tol;
            if !kept.iter().any(same) {
                kept.push((x, y));
            }
        }
        kept.len()
    }

    /// Normal equations about the leader's mean, then moved back to zero.
    fn least_squares(&self, degree: usize) -> Option<[f64; 5]> {
        let n = self.leader.len();
        if n <= degree || n != self.follower.len() {
            return None;
        }
        let mean = self.leader.iter().sum::<f64>() / n as f64;
        let rows = nalgebra::DMatrix::from_fn(n, degree + 1, |r, c| (self.leader[r] - mean).powi(c as i32));
        let right = nalgebra::DVector::from_column_slice(self.follower);
        let solved = rows.svd(true, true).solve(&right, 1e-12).ok()?;
        let [a, b, c] = [0, 1, 2].map(|k| solved.get(k).copied().unwrap_or(0.0));
        // a + b (x - m) + c (x - m)^2
        Some([a - b * mean + c * mean * mean, b - 2.0 * c * mean, c, 0.0, 0.0])
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DVec3;
    use hingecast_geom::{Joint, Screw};

    fn tree(values: &[&[f64]]) -> KinematicTree {
        let joint = |(k, values): (usize, &&[f64])| {
            let screw = Screw { kind: JointKind::Revolute, axis: DVec3::Z, pivot: DVec3::ZERO };
            let name = format!("joint_{}", k + 1);
            Joint { name, parent: 0, child: k + 1, screw, values: values.to_vec(), limits: [-2.0, 2.0] }
        };
        let parts = (0..=values.len()).map(|k| format!("part_{k}")).collect();
        KinematicTree { parts, joints: values.iter().enumerate().map(joint).collect(), ..Default::default() }
    }

    fn told(values: &[&[f64]]) -> (Vec<Coupling>, usize) {
        let tree = tree(values);
        let (couplings, doubts) = find(&tree, &vec![None; tree.joints.len()], 1.0);
        (couplings, doubts.len())
    }

    #[test]
    fn five_states_tell_that_doors_open_together_and_three_only_suggest_it() {
        let left = [0.0, 0.21, 0.37, 0.9, 1.4];
        let right = left.map(|q| 0.1 - 0.5 * q + 0.0005);
        let (couplings, doubts) = told(&[&left, &right]);
        let [c] = couplings[..] else { panic!("{couplings:?}") };
        assert_eq!((c.follower, c.leader, doubts), (1, 0, 0));
        assert!((c.polynomial[1] + 0.5).abs() < 1e-9 && c.polynomial[2] == 0.0, "{c:?}");
        let three = [0.0, 0.8, 1.4];
        assert_eq!(told(&[&three, &three.map(|q| -q)]), (vec![], 1));
        // Two states say nothing: a line goes through any two points.
        assert_eq!(told(&[&left[..2], &right[..2]]), (vec![], 0));
    }

    #[test]
    fn a_curve_is_told_by_more_states_than_a_line() {
        let left = [0.0, 0.2, 0.45, 0.7, 1.0, 1.3];
        let right = left.map(|q| 0.2 * q + 0.4 * q * q);
        let (couplings, _) = told(&[&left, &right]);
        assert!((couplings[0].value(0.6) - 0.264).abs() < 1e-3 || (couplings[0].value(0.264) - 0.6).abs() < 0.1);
        assert_eq!(couplings[0].line(), None);
    }

    /// Moved one at a time, or each as it came: independent, whatever a few states look like.
    #[test]
    fn joints_that_were_moved_by_themselves_are_not_coupled() {
        let mut rng = fastrand::Rng::with_seed(3);
        for n in [3, 5, 25] {
            for _ in 0..200 {
                let mut own = || (0..n).map(|_| 1.4 * rng.f64()).collect::<Vec<_>>();
                let (a, b) = (own(), own());
                assert_eq!(told(&[&a, &b]).0, vec![], "{a:?} {b:?}");
            }
        }
        assert_eq!(told(&[&[0.0, 0.5, 1.0, 1.0, 1.0], &[0.0, 0.0, 0.0, 0.5, 1.0]]), (vec![], 0));
    }

    /// A door shut and wide open many times over is two configurations.
    #[test]
    fn the_same_state_again_tells_nothing_more() {
        let ends = [0.0, 1.2, 0.0, 1.2, 0.001, 1.199, 0.0, 1.2];
        assert_eq!(told(&[&ends, &ends.map(|q| -q)]), (vec![], 0));
    }
}
