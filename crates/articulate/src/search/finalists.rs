//! Which candidates are worth fitting.

use super::candidates::Candidate;
use crate::config::MANY_STATES;
use crate::observe::evidence::Evidence;
use crate::observe::sample::{Motion, Sample};
use crate::score::prior::prior;

/// Candidates that are refined before one is chosen, and how many voxels apart they are. Few states
/// leave a flat part free to slide in its own plane, where refining cannot pull it back: then
/// neighbours are tried as well.
const FINALISTS: (usize, f32) = (12, 8.0);
const NEIGHBOURS: (usize, f32) = (24, 2.5);
/// The best candidates that differ.
pub fn finalists(evidence: &Evidence, mut all: Vec<Candidate>) -> Vec<Candidate> {
    let merit = |p: &Candidate| p.gain * prior(&p.screw, &p.sweep.values, p.parent, &p.samples, evidence.extent());
    all.sort_by(|a, b| merit(b).total_cmp(&merit(a)));
    // In the parent's frame: where the candidate has its samples in state s, and where another
    // would take them from where the first state has them.
    let own = |p: &Candidate, s: usize| Motion::from(p.screw.motion(p.sweep.values[s]));
    let other = |o: &Candidate, p: &Candidate, s: usize| {
        let (v, first) = (&o.sweep.values, p.sweep.values[0]);
        Motion::from(o.screw.motion(v[s] - v[0]) * p.screw.motion(first))
    };
    let mut out: Vec<Candidate> = Vec::new();
    // First what differs much, then, with few states, what differs little.
    let tiers = if evidence.n_states() < MANY_STATES { &[FINALISTS, NEIGHBOURS][..] } else { &[FINALISTS][..] };
    for (most, apart) in tiers {
        let mut rest = Vec::new();
        for p in all {
            let same = |o: &Candidate| {
                o.screw.kind == p.screw.kind
                    && o.parent == p.parent
                    && (0..p.sweep.values.len()).all(|s| {
                        let (a, b) = (own(&p, s), other(o, &p, s));
                        let gap = |x: &Sample| a.apply(x.point).distance(b.apply(x.point));
                        p.samples.iter().step_by(8).all(|x| gap(x) < apart * evidence.lattice.voxel)
                    })
            };
            if out.len() < *most && !out.iter().any(same) {
                out.push(p);
            } else {
                rest.push(p);
            }
        }
        all = rest;
    }
    out
}
