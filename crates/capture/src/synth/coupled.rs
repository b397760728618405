//! Ranges of joints that follow others: a leader goes no farther than its followers can.

use super::ranges::{UsefulRange, each_alone};
use crate::object::ArticulatedObject;

/// Places of a leader's range at which its followers are asked.
const STEPS: usize = 200;
/// A follower may leave its limits by this share of their width: files are rounded.
const ROUNDING: f64 = 1e-3;

/// One range a joint of the tree, other joints at 0, or open if only that frees it. A joint that
/// follows another has the range in which it follows.
pub fn useful_ranges(object: &ArticulatedObject) -> Vec<UsefulRange> {
    let mut ranges = each_alone(object);
    follow(object, &mut ranges);
    ranges
}

/// Narrows the ranges of leaders to where no follower leaves its limits, from the closed end on, and
/// gives every follower the range in which it follows.
pub(super) fn follow(object: &ArticulatedObject, ranges: &mut [UsefulRange]) {
    let tree = &object.tree;
    let leads = |j: usize| tree.coupling_of(j).is_none() && tree.couplings.iter().any(|c| c.leader == j);
    for leader in (0..ranges.len()).filter(|&j| leads(j)) {
        let UsefulRange { lower, upper, .. } = ranges[leader];
        let values = |k: usize| {
            let mut q = vec![f64::NAN; tree.joints.len()];
            q[leader] = lower + (upper - lower) * k as f64 / STEPS as f64;
            tree.follow(&mut q);
            q
        };
        // Joints that do not hang on this leader stay NaN.
        let possible = |q: &[f64]| {
            q.iter().zip(&tree.joints).all(|(q, j)| {
                let slack = ROUNDING * (j.limits[1] - j.limits[0]);
                q.is_nan() || (*q >= j.limits[0] - slack && *q <= j.limits[1] + slack)
            })
        };
        let first = (0..=STEPS).find(|&k| possible(&values(k))).unwrap_or(0);
        let last = (first..=STEPS).take_while(|&k| possible(&values(k))).last().unwrap_or(first);
        let (from, to) = (values(first), values(last));
        for (range, (from, to)) in ranges.iter_mut().zip(from.iter().zip(&to)).filter(|(_, ends)| !ends.0.is_nan()) {
            *range = UsefulRange { lower: *from, upper: *to, ..*range };
        }
    }
}
