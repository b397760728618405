//! From pictures in the order of time to states.

use super::change::{Change, change};
use crate::error::PrepareError;
use hingecast_articulate::DepthView;
use hingecast_geom::Progress;
use rayon::prelude::*;

/// A rest has at least so many pictures; fewer are part of a motion.
const REST: usize = 5;
/// No more blocks than this change while nothing moves.
const STILL: usize = 2;
/// Views of a rest that are kept, spread over it.
const VIEWS: usize = 8;
/// Pictures to either side between which the pace of a motion is asked.
const PACE: usize = 2;

/// A film as states.
#[derive(Clone, Debug, PartialEq)]
pub struct Cut {
    /// The pictures of each state, in the order of time.
    pub states: Vec<Vec<usize>>,
    /// How many of the states are rests: several pictures in which nothing moves.
    pub rests: usize,
    /// Pictures that no state has.
    pub left_out: usize,
}

/// Cuts a film whose cameras are in one frame into at most `most` states: rests, and between them single
/// pictures at even steps of what changes.
///
/// # Errors
/// The wish to stop.
pub fn cut(film: &[DepthView], most: usize, progress: &Progress) -> Result<Cut, PrepareError> {
    let n = film.len();
    progress.report(0, 2, "what rests in the film")?;
    let rests = rests(n, &|a, b| change(&film[a], &film[b]));
    progress.report(1, 2, "what rests in the film")?;
    let pace: Vec<f64> = (0..n)
        .into_par_iter()
        .map(|k| change(&film[k.saturating_sub(PACE)], &film[(k + PACE).min(n - 1)]).amount)
        .collect();
    Ok(states(&rests, &pace, most))
}

/// Runs of pictures, first and last, in which nothing moves.
fn rests(n: usize, change: &(dyn Fn(usize, usize) -> Change + Sync)) -> Vec<(usize, usize)> {
    let still = |a: usize, b: usize| change(a, b).blocks <= STILL;
    let mut out = Vec::new();
    let mut first = 0;
    while first + REST <= n {
        // The farthest of the few first: in a motion it moved most.
        let mut last = first;
        if still(first, first + REST - 1) {
            while last + 1 < n && still(first, last + 1) && still((first + last).div_ceil(2), last + 1) {
                last += 1;
            }
        }
        if last + 1 >= first + REST {
            // Where a motion begins or ends it is slower than can be seen.
            let ends = usize::from(last - first > REST);
            out.push((first + if first > 0 { ends } else { 0 }, last - if last + 1 < n { ends } else { 0 }));
            first = last + 1;
        } else {
            first += 1;
        }
    }
    out
}

/// `pace`: how much changes around each picture.
fn states(rests: &[(usize, usize)], pace: &[f64], most: usize) -> Cut {
    let n = pace.len();
    // The longest rests, if there are too many.
    let mut rests = rests.to_vec();
    rests.sort_by_key(|(a, b)| (std::cmp::Reverse(b - a), *a));
    rests.truncate(most);
    let resting = |k: usize| rests.iter().any(|(a, b)| (*a..=*b).contains(&k));
    let moving: Vec<usize> = (0..n).filter(|&k| !resting(k)).collect();
    let single = spread(&moving, pace, most - rests.len());
    let mut states: Vec<Vec<usize>> = rests
        .iter()
        .map(|&(a, b)| {
            let views = (b - a + 1).min(VIEWS);
            (0..views).map(|v| a + (2 * v + 1) * (b - a + 1) / (2 * views)).collect()
        })
        .chain(single.into_iter().map(|k| vec![k]))
        .collect();
    states.sort();
    let kept: usize = states.iter().map(Vec::len).sum();
    Cut { states, rests: rests.len(), left_out: n - kept }
}

/// At most `most` of `pictures`, at even steps of the pace summed up.
fn spread(pictures: &[usize], pace: &[f64], most: usize) -> Vec<usize> {
    if pictures.len() <= most {
        return pictures.to_vec();
    }
    // A little for every picture: where nothing was seen to change something may.
    let mean = pictures.iter().map(|k| pace[*k]).sum::<f64>() / pictures.len() as f64;
    let mut sum = 0.0;
    let summed: Vec<f64> = pictures
        .iter()
        .map(|k| {
            sum += pace[*k] + 0.1 * mean + 1e-12;
            sum
        })
        .collect();
    let at = |step: usize| {
        let wanted = sum * (step as f64 + 0.5) / most as f64;
        summed.partition_point(|s| *s < wanted).min(pictures.len() - 1)
    };
    let mut chosen: Vec<usize> = (0..most).map(|step| pictures[at(step)]).collect();
    chosen.dedup();
    chosen
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Where a part stands in each picture; a hundredth can be seen.
    fn film(values: &[f64]) -> Cut {
        let change = |a: usize, b: usize| {
            let off = (values[a] - values[b]).abs();
            Change { blocks: if off > 0.01 { 9 } else { 0 }, amount: off }
        };
        let n = values.len();
        let pace: Vec<f64> = (0..n).map(|k| change(k.saturating_sub(2), (k + 2).min(n - 1)).amount).collect();
        states(&rests(n, &change), &pace, 20)
    }

    #[test]
    fn rests_are_states_and_motion_is_cut_at_even_steps() {
        // Ten pictures at rest, thirty of motion that grows faster, ten at rest.
        let mut values = vec![0.0; 10];
        values.extend((1..=30).map(|k| f64::from(k * k) / 900.0));
        values.extend(vec![1.0; 10]);
        let cut = film(&values);
        assert_eq!(cut.rests, 2);
        assert!(cut.states.len() <= 20 && cut.states.len() >= 16, "{cut:?}");
        assert!(cut.states[0].iter().all(|k| *k < 13) && cut.states.last().unwrap().iter().all(|k| *k >= 37));
        let singles: Vec<usize> = cut.states.iter().filter(|s| s.len() == 1).map(|s| s[0]).collect();
        let steps: Vec<f64> = singles.windows(2).map(|w| values[w[1]] - values[w[0]]).collect();
        assert!(steps.iter().all(|s| *s < 0.16), "{steps:?}");
        let kept: usize = cut.states.iter().map(Vec::len).sum();
        assert_eq!(cut.left_out, values.len() - kept);
    }

    #[test]
    fn a_film_without_rest_has_one_view_a_state() {
        let values: Vec<f64> = (0..40).map(|k| f64::from(k) * 0.05).collect();
        let cut = film(&values);
        assert_eq!((cut.rests, cut.states.len()), (0, 20));
        assert!(cut.states.iter().all(|s| s.len() == 1));
    }
}
