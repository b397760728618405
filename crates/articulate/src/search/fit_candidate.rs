//! A candidate becomes a part.

use super::candidates::{CANDIDATE_SAMPLES, Candidate};
use crate::fit::gauss_newton::{Settings, gauss_newton};
use crate::fit::sweep_values::improved_values;
use crate::model::motions::poses_of;
use crate::model::owners::Member;
use crate::observe::evidence::Evidence;
use crate::observe::sample::{Motion, Sample};
use crate::score::claims::Claims;
use crate::score::verdict::Verdict;
use hingecast_geom::{Joint, KinematicTree, Pose};

/// Most samples that a new joint is refined with; all of them refine the finished tree.
const MOST_MEMBERS: usize = 6000;

/// Adds the candidate to the tree as a part; its screw and values are refined and asked again in
/// turns, first with the source samples, then with everything that moves with it. `still`: the
/// verdicts on all samples if they moved with the parent.
pub fn fit_candidate(
    evidence: &Evidence,
    claims: &Claims,
    tree: &mut KinematicTree,
    p: &Candidate,
    still: &[Verdict],
    seed: u64,
) {
    let n_states = evidence.n_states();
    let child = tree.parts.len();
    let parent_poses = poses_of(tree, p.parent, n_states);
    tree.parts.push(format!("part_{child}"));
    // Values count from state 0; the samples stand where state `source` has it.
    let zero = p.sweep.values[0];
    let values = p.sweep.values.iter().map(|v| v - zero).collect();
    let joint =
        Joint { name: format!("joint_{child}"), parent: p.parent, child, screw: p.screw, values, limits: [0.0; 2] };
    tree.joints.push(joint);
    let m = Motion::from(parent_poses[p.source]);
    let source: Vec<Sample> = p.samples.iter().map(|s| Sample { state: p.source, ..s.moved(&m) }).collect();
    for gate in [3.0, 1.5] {
        polish(evidence, tree, &source, gate, n_states, seed);
        resweep(evidence, claims, tree, &source, &parent_poses);
    }
    let moving: Vec<usize> = (0..still.len()).filter(|&i| still[i].against != 0).collect();
    for gate in [1.5, 1.0, 0.7] {
        let mine = evidence.judge_some(&poses_of(tree, child, n_states), &moving);
        let explained = moving.iter().zip(&mine).filter(|(_, v)| v.explains());
        let mut members: Vec<Sample> = explained.map(|(&i, _)| evidence.samples[i]).collect();
        if members.len() < 20 {
            break;
        }
        fastrand::Rng::with_seed(seed).shuffle(&mut members);
        members.truncate(MOST_MEMBERS);
        polish(evidence, tree, &members, gate, 4, seed);
        resweep(evidence, claims, tree, &members[..members.len().min(2 * CANDIDATE_SAMPLES)], &parent_poses);
        // Asking answers in steps of the grid.
        polish(evidence, tree, &members, gate, 4, seed);
    }
}

/// Gauss and Newton on the last joint alone; `gate`: voxels.
fn polish(evidence: &Evidence, tree: &mut KinematicTree, members: &[Sample], gate: f64, partners: usize, seed: u64) {
    let child = tree.parts.len() - 1;
    let mut free = vec![false; tree.joints.len()];
    free[child - 1] = true;
    let members: Vec<Member> = members.iter().map(|s| Member { sample: *s, part: child, shown: u64::MAX }).collect();
    let settings = Settings { partners, ..Settings::narrowing(gate, 0.5 * gate, evidence.lattice.voxel) };
    gauss_newton(evidence, tree, &members, &free, &settings, seed);
}

/// Asks every state anew for the last joint's value.
fn resweep(evidence: &Evidence, claims: &Claims, tree: &mut KinematicTree, members: &[Sample], parent_poses: &[Pose]) {
    let joint = tree.joints.last_mut().expect("a part was added");
    joint.values = improved_values(evidence, claims, joint, members, parent_poses);
}
