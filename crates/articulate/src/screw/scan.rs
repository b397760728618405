//! One screw against all states: at which value does each state agree with it, and how well.

use super::evidence::{Evidence, Motion, Sample};
use super::space::{FREE, POSSIBLE, TAKEN, facing_bit};
use glam::Vec3;
use hingecast_geom::{Pose, Screw};

/// Value per state and how well the states agree.
#[derive(Clone, Debug)]
pub struct Scan {
    /// Relative to the source state.
    pub values: Vec<f64>,
    /// Per state: surface met minus emptiness entered, shares of the samples.
    pub scores: Vec<f32>,
}

/// What entering space that was seen empty costs against meeting one surface.
pub const EMPTY: f32 = 1.5;
/// What surface counts that known parts explain, against 1 for surface that none does.
#[derive(Clone, Copy)]
pub struct Worth {
    /// A known part explains it already.
    pub explained: f32,
    /// A known part could explain it.
    pub possible: f32,
}

/// For parts that are sought.
pub const SOUGHT: Worth = Worth { explained: 0.25, possible: 0.8 };

/// `samples`: in the parent's canonical frame as of the source state. `parent[s]`: world at s from that frame.
/// Values from `range[0]` to `range[1]` are tried in steps that move no sample farther than about `step`.
pub fn scan(
    evidence: &Evidence,
    samples: &[Sample],
    parent: &[Pose],
    screw: &Screw,
    range: [f64; 2],
    step: f32,
    worth: Worth,
) -> Scan {
    let reach = if screw.kind.turns() {
        samples.iter().map(|s| screw.distance(s.point.as_dvec3())).fold(0.0, f64::max)
    } else {
        1.0
    };
    let count = (((range[1] - range[0]) * reach / step as f64).ceil() as usize).clamp(1, 1500);
    let grid: Vec<f64> = (0..=count).map(|k| range[0] + (range[1] - range[0]) * k as f64 / count as f64).collect();
    // Turns about one axis share its frame; composing with the parent is one product a state.
    let (mut values, mut scores) = (Vec::new(), Vec::new());
    for (state, place) in parent.iter().enumerate() {
        let mut best = (f32::NEG_INFINITY, 0.0);
        for &q in &grid {
            let m = Motion::from(*place * screw.motion(q));
            let score = at_least(evidence, state, samples, &m, worth, best.0);
            // Of equals the smaller motion.
            if score > best.0 + 1e-6 || (score > best.0 - 1e-6 && q.abs() < f64::abs(best.1)) {
                best = (score, q);
            }
        }
        values.push(best.1);
        scores.push(best.0);
    }
    Scan { values, scores }
}

/// Share of the samples that meet surface, minus what enters empty space.
pub fn agreement(evidence: &Evidence, state: usize, samples: &[Sample], m: &Motion, worth: Worth) -> f32 {
    at_least(evidence, state, samples, m, worth, f32::NEG_INFINITY)
}

/// The agreement, or little once it is sure to stay below `floor`.
fn at_least(evidence: &Evidence, state: usize, samples: &[Sample], m: &Motion, worth: Worth, floor: f32) -> f32 {
    let n = samples.len() as f32;
    let mut sum = 0.0;
    for (k, s) in samples.iter().enumerate() {
        let bits = evidence.spaces[state].bits(m.apply(s.point));
        if bits & facing_bit(m.rot * s.normal) != 0 {
            sum += match bits & (TAKEN | POSSIBLE) {
                0 => 1.0,
                POSSIBLE => worth.possible,
                _ => worth.explained,
            };
        } else if bits & FREE != 0 {
            sum -= EMPTY;
        }
        if k % 16 == 15 && sum + (n - 1.0 - k as f32) < floor * n {
            return -EMPTY;
        }
    }
    sum / n
}

/// Values worth trying: all turns, or slides across the object.
pub fn whole_range(screw: &Screw, extent: f32) -> [f64; 2] {
    if screw.kind.turns() { [-std::f64::consts::PI, std::f64::consts::PI] } else { [-extent as f64, extent as f64] }
}

/// Points of samples.
pub fn points(samples: &[Sample]) -> Vec<Vec3> {
    samples.iter().map(|s| s.point).collect()
}
