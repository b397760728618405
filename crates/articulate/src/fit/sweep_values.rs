//! One screw against all states: at which value does each state agree with it, and how well.

use super::question::{Question, Sweep, Worth, agreement_above, grid_agreement};
use super::sweep_film::sweep_film;
use crate::model::motions::in_parent_frame;
use crate::observe::evidence::Evidence;
use crate::observe::sample::{Motion, Sample};
use crate::score::claims::Claims;
use hingecast_geom::{Joint, Pose, Screw};

/// Asks every state for the value of a screw.
///
/// `samples`: in the parent's canonical frame as of the source state. `parent_poses[s]`: world at s
/// from that frame. Values from `range[0]` to `range[1]` are tried in steps that move no sample
/// farther than about `step`, scene units.
pub fn sweep_values(
    question: &Question,
    samples: &[Sample],
    parent_poses: &[Pose],
    screw: &Screw,
    range: [f64; 2],
    step: f32,
) -> Sweep {
    let reach = if screw.kind.turns() {
        samples.iter().map(|s| screw.distance(s.point.as_dvec3())).fold(0.0, f64::max)
    } else {
        1.0
    };
    let count = (((range[1] - range[0]) * reach / step as f64).ceil() as usize).clamp(1, 1500);
    let grid: Vec<f64> = (0..=count).map(|k| range[0] + (range[1] - range[0]) * k as f64 / count as f64).collect();
    if question.evidence.film {
        return sweep_film(question, samples, parent_poses, screw, &grid, reach);
    }
    // Turns about one axis share its frame; composing with the parent is one product a state.
    let (mut values, mut scores) = (Vec::new(), Vec::new());
    for (state, place) in parent_poses.iter().enumerate() {
        let mut best = (f32::NEG_INFINITY, 0.0);
        for &q in &grid {
            let m = Motion::from(*place * screw.motion(q));
            let score = agreement_above(question, state, samples, &m, best.0);
            // Of equals the smaller motion.
            if score > best.0 + 1e-6 || (score > best.0 - 1e-6 && q.abs() < f64::abs(best.1)) {
                best = (score, q);
            }
        }
        values.push(best.1);
        scores.push(best.0);
    }
    Sweep { values, scores }
}

/// Values worth trying: all turns, or slides across the object. Radians or scene units.
pub fn full_range(screw: &Screw, extent: f32) -> [f64; 2] {
    if screw.kind.turns() { [-std::f64::consts::PI, std::f64::consts::PI] } else { [-extent as f64, extent as f64] }
}

/// Another value must agree this much better with a state than the one that is held, share of the
/// samples.
const CLEARLY_BETTER: f32 = 0.01;

/// The values of a joint that the states agree with best, for `members` of its child, counted from
/// the first state; but for films the held ones unless others are clearly better.
pub fn improved_values(
    evidence: &Evidence,
    claims: &Claims,
    joint: &Joint,
    members: &[Sample],
    parent_poses: &[Pose],
) -> Vec<f64> {
    let samples = in_parent_frame(joint, members, parent_poses);
    let question = Question { evidence, claims, worth: Worth::SOUGHT };
    let mut found = sweep_joint(&question, joint, &samples, parent_poses);
    // Along a film the path counts, not a picture.
    let single = if evidence.film { &[] } else { parent_poses };
    for (s, parent) in single.iter().enumerate() {
        let held = Motion::from(*parent * joint.screw.motion(joint.values[s]));
        if found.scores[s] < grid_agreement(&question, s, &samples, &held) + CLEARLY_BETTER {
            found.values[s] = joint.values[s];
        }
    }
    let zero = found.values[0];
    found.values.iter().map(|v| v - zero).collect()
}

/// All states asked for the value of a joint, by samples of its child as [`in_parent_frame`]
/// answers them.
pub fn sweep_joint(question: &Question, joint: &Joint, samples: &[Sample], parent_poses: &[Pose]) -> Sweep {
    let range = full_range(&joint.screw, question.evidence.extent());
    sweep_values(question, samples, parent_poses, &joint.screw, range, question.evidence.lattice.voxel)
}
