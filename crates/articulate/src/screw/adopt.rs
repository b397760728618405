//! A proposal becomes a part.

use super::discover::poses_of;
use super::evidence::{Evidence, Motion, Sample, Verdict};
use super::propose::{CROWD, Proposal};
use super::refine::{self, Member, refine};
use super::scan::{SOUGHT, Scan, Worth, agreement, scan, whole_range};
use hingecast_geom::{Joint, KinematicTree, Pose};

/// Most samples that a new joint is refined with; all of them refine the finished tree.
const MEMBERS: usize = 6000;

/// Adds the proposal to the tree as a part; its screw and values are refined and asked again in turns, first with the
/// source samples, then with everything that moves with it.
/// `still`: the verdicts on all samples if they moved with the parent.
pub fn adopt(evidence: &Evidence, tree: &mut KinematicTree, p: &Proposal, still: &[Verdict], seed: u64) {
    let n_states = evidence.n_states();
    let child = tree.parts.len();
    let place = poses_of(tree, p.parent, n_states);
    tree.parts.push(format!("part_{child}"));
    // Values count from state 0; the crowd stands where state `source` has it.
    let zero = p.scan.values[0];
    let values = p.scan.values.iter().map(|v| v - zero).collect();
    let joint =
        Joint { name: format!("joint_{child}"), parent: p.parent, child, screw: p.screw, values, limits: [0.0; 2] };
    tree.joints.push(joint);
    let voxel = evidence.lattice.voxel as f64;
    let m = Motion::from(place[p.source]);
    let crowd: Vec<Sample> = p.crowd.iter().map(|s| Sample { state: p.source, ..s.moved(&m) }).collect();
    for gate in [3.0, 1.5] {
        polish(evidence, tree, &crowd, gate * voxel, n_states, seed);
        rescan(evidence, tree, &crowd, &place);
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
        members.truncate(MEMBERS);
        polish(evidence, tree, &members, gate * voxel, 4, seed);
        rescan(evidence, tree, &members[..members.len().min(2 * CROWD)], &place);
        // Asking answers in steps of the grid.
        polish(evidence, tree, &members, gate * voxel, 4, seed);
    }
}

/// Gauss-Newton on the last joint alone.
fn polish(evidence: &Evidence, tree: &mut KinematicTree, members: &[Sample], gate: f64, partners: usize, seed: u64) {
    let child = tree.parts.len() - 1;
    let mut free = vec![false; tree.joints.len()];
    free[child - 1] = true;
    let members: Vec<Member> = members.iter().map(|s| Member { sample: *s, part: child, shown: u64::MAX }).collect();
    let settings = refine::Settings { gates: [gate, 0.5 * gate], rounds: 6, partners };
    refine(evidence, tree, &members, &free, &settings, seed);
}

/// Another value must agree this much better with a state than the one that is held.
const BETTER: f32 = 0.01;

/// Asks every state anew for the last joint's value.
fn rescan(evidence: &Evidence, tree: &mut KinematicTree, members: &[Sample], place: &[Pose]) {
    let joint = tree.joints.last_mut().expect("a part was added");
    joint.values = asked_again(evidence, joint, members, place);
}

/// The values of a joint that the states agree with best, for `members` of its child; the held ones unless others are better.
pub fn asked_again(evidence: &Evidence, joint: &Joint, members: &[Sample], place: &[Pose]) -> Vec<f64> {
    let samples = in_parent(joint, members, place);
    let mut found = rescanned(evidence, joint, &samples, place, SOUGHT);
    for (s, parent) in place.iter().enumerate() {
        let held = Motion::from(*parent * joint.screw.motion(joint.values[s]));
        if found.scores[s] < agreement(evidence, s, &samples, &held, SOUGHT) + BETTER {
            found.values[s] = joint.values[s];
        }
    }
    let zero = found.values[0];
    found.values.iter().map(|v| v - zero).collect()
}

/// Samples of a joint's child in its parent's frame as of value 0. `place`: world from that frame, per state.
pub fn in_parent(joint: &Joint, members: &[Sample], place: &[Pose]) -> Vec<Sample> {
    let back = |s: &Sample| Motion::from((place[s.state] * joint.screw.motion(joint.values[s.state])).inverse());
    members.iter().map(|s| s.moved(&back(s))).collect()
}

/// All states asked for the value of a joint, by samples of its child as [`in_parent`] answers them.
pub fn rescanned(evidence: &Evidence, joint: &Joint, samples: &[Sample], place: &[Pose], worth: Worth) -> Scan {
    let range = whole_range(&joint.screw, evidence.extent());
    scan(evidence, samples, place, &joint.screw, range, evidence.lattice.voxel, worth)
}
