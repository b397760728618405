//! Candidates for a new part on one parent: pairs of states, hypotheses, alignment, and a question to all states.

use super::cameras::mean_point;
use super::evidence::{Evidence, Motion, Sample, Verdict};
use super::hypotheses::{Duel, Hypothesis, distinct, nearest_screw};
use super::jury::Jury;
use super::plausible::plausibility;
use super::scan::{SOUGHT, Scan, agreement, points, scan, whole_range};
use super::space::{POSSIBLE, TAKEN};
use crate::icp;
use glam::DVec3;
use hingecast_geom::{JointKind, Pose, Screw};
use rayon::prelude::*;

/// Pairs of states per parent and round.
const PAIRS: usize = 6;
/// Two states show well what has moved if they show this part of the most that two states do.
const WELL: usize = 4;
/// Hypotheses per pair that are aligned.
const ALIGNED: usize = 180;
/// Samples that align and judge a hypothesis.
const JURY: usize = 400;
/// Poses per parent that are asked in all states, each as a hinge and as a slide.
const ASKED: usize = 36;
/// Samples that ask.
pub const CROWD: usize = 200;
/// Fewer samples do not make a pair worth looking at, or a pose worth asking.
const FEW: usize = 12;
/// With fewer states a flat part is free to slide in its own plane: neighbours are kept as well.
pub const MANY_STATES: usize = 4;

/// How hypotheses of a pair of states are sought.
struct Rule {
    /// Surface with one of these bits is no place to land.
    explained: u32,
    /// Voxels between hypotheses.
    apart: f32,
    /// Whether they are moved uphill before they are aligned.
    climbs: bool,
}

const DENSE: Rule = Rule { explained: TAKEN, apart: 3.0, climbs: false };
/// What an opened door shows for the first time stands still as far as anybody knows, but in two states it attracts so many
/// wrong motions that the right one is lost. So with few states all is sought once more without it, and wider apart.
const WIDE: Rule = Rule { explained: TAKEN | POSSIBLE, apart: 7.0, climbs: true };

/// A screw on a parent, ready to become a part.
pub struct Proposal {
    pub parent: usize,
    pub source: usize,
    pub screw: Screw,
    pub scan: Scan,
    /// Contradictions of open samples that it removes.
    pub gain: f64,
    /// Source samples that take part, in the parent's canonical frame as of the source state.
    pub crowd: Vec<Sample>,
}

/// Screws of a new part on `parent`, whose poses are `place` (world from its canonical frame).
pub fn propose(
    evidence: &Evidence,
    parent: usize,
    place: &[Pose],
    open: &[usize],
    verdicts: &[Vec<Verdict>],
    jury: &Jury,
    seed: u64,
) -> Vec<Proposal> {
    let n = evidence.n_states();
    let verdict = &verdicts[parent];
    // Open samples of state b that the parent's motion would put into empty space of state a.
    let mut counts = vec![0usize; n * n];
    for &i in open {
        let b = evidence.samples[i].state;
        (0..n).filter(|a| verdict[i].against >> a & 1 == 1).for_each(|a| counts[b * n + a] += 1);
    }
    let pairs = varied(&counts, n);
    let back: Vec<Pose> = place.iter().map(Pose::inverse).collect();
    let mut all = Vec::new();
    for (k, &pair) in pairs.iter().enumerate() {
        let (b, a) = (pair / n, pair % n);
        // Open samples of one state that the parent's motion would put into emptiness of the other.
        let moving = |from: usize, to: usize| -> Vec<Sample> {
            let own = |i: &&usize| evidence.samples[**i].state == from && verdict[**i].against >> to & 1 == 1;
            open.iter().filter(own).map(|&i| evidence.samples[i].moved(&back[from].into())).collect()
        };
        let (source, reverse) = (moving(b, a), moving(a, b));
        let cloud = &evidence.clouds[a];
        let m = Motion::from(back[a]);
        let (space, place_a) = (&evidence.spaces[a], Motion::from(place[a]));
        let mut duel = Duel { source, targets: Vec::new(), reverse, space, explained: 0, apart: 0.0, place: place_a };
        let mut hypotheses = Vec::new();
        for rule in if n < MANY_STATES { &[DENSE, WIDE][..] } else { &[DENSE][..] } {
            let free = |i: &usize| space.bits(cloud.points[*i]) & rule.explained == 0;
            let targets = (0..cloud.points.len()).filter(free);
            duel.targets = targets.map(|i| (m.apply(cloud.points[i]), m.rot * cloud.normals[i])).collect();
            (duel.explained, duel.apart) = (rule.explained, rule.apart);
            let found = duel.propose(ALIGNED / pairs.len().min(3), seed ^ ((k as u64 + 1) << 8));
            hypotheses.extend(found.into_iter().map(|h| (h, rule.climbs)));
        }
        duel.explained = TAKEN;
        let keep = (ASKED / pairs.len()).max(6);
        let aligned = align(evidence, &duel, &hypotheses, [b, a], parent, place, &back, keep, seed);
        let asked: Vec<Proposal> = aligned
            .into_par_iter()
            .map(|(h, crowd)| {
                let mut rng = fastrand::Rng::with_seed(seed);
                let mut crowd = crowd;
                rng.shuffle(&mut crowd);
                crowd.truncate(CROWD);
                let range = whole_range(&h.screw, evidence.extent());
                let found = scan(evidence, &crowd, place, &h.screw, range, 1.5 * evidence.lattice.voxel, SOUGHT);
                let own: Vec<Pose> = (0..n).map(|s| place[s] * h.screw.motion(found.values[s])).collect();
                let gain = jury.gain(evidence, &own, false);
                Proposal { parent, source: b, screw: h.screw, scan: found, gain, crowd }
            })
            .collect();
        all.extend(asked);
    }
    all
}

/// Pairs of states that show motion, at most two from one source state and two to one target. `counts`: open samples of the first that
/// the second contradicts. (n, n)
///
/// In turns the pair where most has moved, the pair where both states show most of what has moved (a closed drawer shows its front
/// alone, and a front fits wherever there is another), and the pair where least has moved that both show well: with luck one part alone.
fn varied(counts: &[usize], n: usize) -> Vec<usize> {
    let back = |k: usize| counts[k % n * n + k / n];
    let both = |k: usize| counts[k].min(back(k));
    let most = (0..n * n).map(both).max().unwrap_or(0);
    let ranked = |least: usize, by: &dyn Fn(usize) -> isize| {
        let mut pairs: Vec<usize> = (0..n * n).filter(|&k| counts[k] >= FEW && WELL * both(k) >= least).collect();
        pairs.sort_by_key(|k| (-by(*k), -(counts[*k] as isize), *k));
        pairs.into_iter()
    };
    let mut lists = [
        ranked(0, &|k| counts[k] as isize),
        ranked(0, &|k| both(k) as isize),
        ranked(most, &|k| -((counts[k] + back(k)) as isize)),
    ];
    let (mut from, mut to) = (vec![0; n], vec![0; n]);
    let mut out: Vec<usize> = Vec::new();
    while out.len() < PAIRS {
        let before = out.len();
        for list in &mut lists {
            let new = list.find(|k| !out.contains(k) && from[k / n] < 2 && to[k % n] < 2);
            if let Some(k) = new.filter(|_| out.len() < PAIRS) {
                from[k / n] += 1;
                to[k % n] += 1;
                out.push(k);
            }
        }
        if out.len() == before {
            break;
        }
    }
    out
}

/// Aligns hypotheses by ICP and answers, of the best that differ, hinge and slide with the samples that fit.
fn align(
    evidence: &Evidence,
    duel: &Duel,
    hypotheses: &[(Hypothesis, bool)],
    [b, a]: [usize; 2],
    parent: usize,
    place: &[Pose],
    back: &[Pose],
    keep: usize,
    seed: u64,
) -> Vec<(Hypothesis, Vec<Sample>)> {
    let voxel = evidence.lattice.voxel as f64;
    let gates = [3.0, 2.5, 2.0, 1.5, 1.5, 1.0, 1.0, 1.0].map(|g| g * voxel);
    let some = |samples: Vec<Sample>, most: usize| {
        let mut samples = samples;
        fastrand::Rng::with_seed(seed).shuffle(&mut samples);
        samples.truncate(most);
        samples
    };
    let (jury, reverse) = (some(duel.source.clone(), JURY), some(duel.reverse.clone(), JURY));
    // Met within the noise, where nothing known is.
    let met = |samples: &[Sample], m: Motion, t: usize| {
        let meets = |s: &&Sample| {
            let x = m.apply(s.point);
            evidence.spaces[t].bits(x) & TAKEN == 0 && evidence.meets(t, x, m.rot * s.normal)
        };
        samples.iter().filter(meets).count()
    };
    let mut all: Vec<(Hypothesis, Pose)> = hypotheses
        .par_iter()
        .filter_map(|(h, climbs)| {
            let start = h.screw.motion(h.q);
            let near = some(duel.fitting(&start.into(), 1), JURY);
            if near.len() < FEW {
                return None;
            }
            let uphill = |pose: Pose| {
                let (forth, back) = (&jury[..jury.len().min(CLIMBING)], &reverse[..reverse.len().min(CLIMBING)]);
                agreement(evidence, a, forth, &pose.into(), SOUGHT)
                    + agreement(evidence, b, back, &(place[b] * pose.inverse()).into(), SOUGHT)
            };
            let start = place[a] * start;
            let start = if *climbs { climb(start, &near, voxel, &uphill) } else { start };
            let (pose, _) = icp::align(&points(&near), &normals(&near), &evidence.clouds[a], start, &gates);
            let score = met(&jury, pose.into(), a) * duel.source.len() / jury.len().max(1)
                + met(&reverse, (place[b] * pose.inverse()).into(), b) * duel.reverse.len() / reverse.len().max(1);
            Some((Hypothesis { score, ..*h }, back[a] * pose))
        })
        .collect();
    all.sort_by_key(|h| std::cmp::Reverse(h.0.score));
    // Each pose as a hinge and as a slide, where that is what it is.
    let mut screws: Vec<(f64, Hypothesis, Vec<Sample>)> = Vec::new();
    for (h, pose) in all {
        let crowd = duel.fitting(&pose.into(), 0);
        if crowd.len() < FEW {
            continue;
        }
        for kind in [JointKind::Revolute, JointKind::Prismatic] {
            let Some((screw, q)) = nearest_screw(&pose, kind, mean_point(crowd.iter().map(|s| s.point))) else {
                continue;
            };
            let (exact, near) = (Motion::from(pose), Motion::from(screw.motion(q)));
            let off = |s: &Sample| exact.apply(s.point).distance(near.apply(s.point)) > 3.0 * evidence.lattice.voxel;
            if 2 * crowd.iter().filter(|s| off(s)).count() > crowd.len() {
                continue;
            }
            let merit = h.score as f64 * plausibility(&screw, &[0.0, q], parent, &crowd, evidence.extent());
            screws.push((merit, Hypothesis { screw, q, score: h.score }, crowd.clone()));
        }
    }
    screws.sort_by(|a, b| b.0.total_cmp(&a.0));
    let extent = points(&jury);
    let mut kept: Vec<Hypothesis> = Vec::new();
    let mut out = Vec::new();
    // First what differs much, then, with few states, what differs little.
    let tiers = if evidence.n_states() < MANY_STATES { &[(1, 4.0), (2, 2.0)][..] } else { &[(1, 4.0)][..] };
    for (share, apart) in tiers {
        let mut rest = Vec::new();
        for screw in screws {
            let with: Vec<Hypothesis> = kept.iter().copied().chain([screw.1]).collect();
            let new = distinct(with, &extent, apart * voxel as f32, usize::MAX).len() > kept.len();
            if new && out.len() < share * keep {
                kept.push(screw.1);
                out.push((screw.1, screw.2));
            } else {
                rest.push(screw);
            }
        }
        screws = rest;
    }
    out
}

/// Steps of the climb, voxels.
const STEPS: [f64; 3] = [4.0, 2.0, 1.0];
/// Samples of each state that judge a step.
const CLIMBING: usize = 150;

/// Moves a pose uphill in six directions: shifts along the axes of the coordinates and turns about the samples' centre. ICP alone
/// leaves a plate where it lies in its own plane.
fn climb(start: Pose, samples: &[Sample], voxel: f64, agreement: &dyn Fn(Pose) -> f32) -> Pose {
    let centre = start.apply(mean_point(samples.iter().map(|s| s.point)));
    let far = samples.iter().map(|s| start.apply(s.point.as_dvec3()).distance_squared(centre)).sum::<f64>();
    let radius = (far / samples.len() as f64).sqrt().max(voxel);
    let mut best = (agreement(start), start);
    for step in STEPS {
        // Up to a few steps of this length.
        for _ in 0..3 {
            let before = best.0;
            for k in 0..12 {
                let axis = DVec3::AXES[k % 3] * if k % 6 < 3 { 1.0 } else { -1.0 } * step * voxel;
                let about = best.1.apply(start.inverse().apply(centre));
                let moved = if k < 6 {
                    Pose { trans: best.1.trans + axis, ..best.1 }
                } else {
                    let turn = Screw { kind: JointKind::Revolute, axis: axis.normalize(), pivot: about };
                    turn.motion(step * voxel / radius) * best.1
                };
                let there = agreement(moved);
                if there > best.0 + 1e-4 {
                    best = (there, moved);
                }
            }
            if best.0 <= before {
                break;
            }
        }
    }
    best.1
}

fn normals(samples: &[Sample]) -> Vec<glam::Vec3> {
    samples.iter().map(|s| s.normal).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pairs_are_those_with_most_motion_and_those_with_one_part_alone() {
        // Four states: a big part has left for good from state 1 on (100 samples); a small one moves between 2 and 3 (20).
        let mut counts = vec![0; 16];
        for t in 1..4 {
            (counts[t], counts[4 * t]) = (100, 110);
        }
        (counts[2 * 4 + 3], counts[3 * 4 + 2]) = (27, 28);
        let pairs = varied(&counts, 4);
        assert_eq!(pairs.len(), PAIRS, "{pairs:?}");
        assert!(pairs.contains(&4), "most has moved: {pairs:?}");
        assert!(pairs.contains(&14) && pairs.contains(&11), "least has moved: {pairs:?}");
        assert!(pairs.iter().all(|k| counts[*k] >= FEW), "{pairs:?}");
        // No pair shows anything.
        assert!(varied(&[0; 16], 4).is_empty());
    }
}
