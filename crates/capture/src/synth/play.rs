//! How a person plays with the joints: one after the other, overlapping in time, each through its
//! whole range.

/// Share of the neighbour's sweep that a joint's sweep overlaps: some states then show two joints
/// moving together.
const OVERLAP: f64 = 0.3;
/// How far the first joint is pushed back at the end, as a person closes what he opened first.
const PUSHED_BACK: f64 = 0.45;

/// When joint after joint sweeps. Time runs from 0 (first state) to 1 (last state).
pub(crate) struct Play {
    /// Per joint: start and end of its sweep, and whether it is pushed back a little at the end.
    sweeps: Vec<(f64, f64, bool)>,
}

impl Play {
    /// `behind`: of each joint, whether it moves only when others are open; these come last, and
    /// nothing is pushed back into their way. `two_states`: only first and last are recorded, so
    /// every joint goes all the way.
    pub fn new(behind: &[bool], two_states: bool, rng: &mut fastrand::Rng) -> Self {
        let n_joints = behind.len();
        if two_states || n_joints == 1 {
            return Self { sweeps: vec![(0.0, 1.0, false); n_joints] };
        }
        let mut order: Vec<usize> = (0..n_joints).collect();
        rng.shuffle(&mut order);
        order.sort_by_key(|&j| behind[j]);
        let push_back = !behind.contains(&true);
        let n = n_joints as f64;
        let length = 1.0 / (n - (n - 1.0) * OVERLAP);
        let mut sweeps = vec![(0.0, 1.0, false); n_joints];
        for (place, &joint) in order.iter().enumerate() {
            let start = place as f64 * length * (1.0 - OVERLAP);
            sweeps[joint] = (start, start + length, place == 0 && push_back);
        }
        Self { sweeps }
    }

    /// Fraction of its range (0 = start of the range, 1 = end) at which each joint stands at
    /// `time`.
    pub fn fractions(&self, time: f64) -> Vec<f64> {
        self.sweeps
            .iter()
            .map(|&(start, end, back)| {
                let length = end - start;
                let open = ease((time - start) / length);
                let closing = if back { PUSHED_BACK * ease((time - (1.0 - length)) / length) } else { 0.0 };
                open - closing
            })
            .collect()
    }
}

/// 0 before, 1 after, steps of nearly equal size between with a soft start and stop.
fn ease(t: f64) -> f64 {
    let t = t.clamp(0.0, 1.0);
    // Half linear, half smoothstep: the largest step stays within 1.25 times the mean.
    0.5 * t + 0.5 * t * t * (3.0 - 2.0 * t)
}
