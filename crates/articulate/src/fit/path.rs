//! The values of a joint along a film: a smooth path through what every picture says.
//!
//! A single picture may not show a part, or show nothing that would tell one value from another; hands
//! move it steadily.

/// Through steps of a grid of values, the path on which the scores are highest, less `cost` times the
/// square of every step from one state to the next (Viterbi 1967; the step is a distance transform,
/// Felzenszwalb and Huttenlocher 2012). `scores[state][step of the grid]`; one index a state.
pub fn smooth_path(scores: &[Vec<f32>], cost: f64) -> Vec<usize> {
    let Some(first) = scores.first() else { return Vec::new() };
    let mut best: Vec<f64> = first.iter().map(|s| f64::from(*s)).collect();
    let mut came: Vec<Vec<usize>> = Vec::new();
    for own in &scores[1..] {
        let (reached, from) = spread(&best, cost);
        best = reached.iter().zip(own).map(|(r, s)| r + f64::from(*s)).collect();
        came.push(from);
    }
    let last = (0..best.len()).fold(0, |a, b| if best[b] > best[a] { b } else { a });
    let mut out = vec![last];
    for from in came.iter().rev() {
        out.push(from[*out.last().expect("never empty")]);
    }
    out.reverse();
    out
}

/// Of every place k the most of `best[j] - cost (k - j)^2`, and its j.
fn spread(best: &[f64], cost: f64) -> (Vec<f64>, Vec<usize>) {
    // Parabolas that are highest somewhere, and where each takes over from the one before.
    let (mut tops, mut starts): (Vec<usize>, Vec<f64>) = (Vec::new(), Vec::new());
    for j in 0..best.len() {
        let takes_over = |i: usize| {
            let (a, b) = (i as f64, j as f64);
            ((best[i] - best[j]) / cost + b * b - a * a) / (2.0 * (b - a))
        };
        while let Some(&i) = tops.last() {
            if takes_over(i) > starts[tops.len() - 1] {
                break;
            }
            tops.pop();
            starts.pop();
        }
        starts.push(tops.last().map_or(f64::NEG_INFINITY, |&i| takes_over(i)));
        tops.push(j);
    }
    let mut at = 0;
    let each = |k: usize| {
        while at + 1 < tops.len() && starts[at + 1] < k as f64 {
            at += 1;
        }
        let j = tops[at];
        (best[j] - cost * (k as f64 - j as f64).powi(2), j)
    };
    (0..best.len()).map(each).unzip()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_path_is_the_best_of_all() {
        // Against trying every path.
        let mut rng = fastrand::Rng::with_seed(3);
        let (states, steps) = (4usize, 6usize);
        for _ in 0..50 {
            let scores: Vec<Vec<f32>> = (0..states).map(|_| (0..steps).map(|_| rng.f32()).collect()).collect();
            let cost = 0.3 * rng.f64();
            let worth = |path: &[usize]| -> f64 {
                let own: f64 = path.iter().zip(&scores).map(|(k, s)| f64::from(s[*k])).sum();
                own - path.windows(2).map(|w| cost * (w[1] as f64 - w[0] as f64).powi(2)).sum::<f64>()
            };
            let all = (0..steps.pow(states as u32)).map(|k| {
                let path: Vec<usize> = (0..states as u32).map(|s| k / steps.pow(s) % steps).collect();
                worth(&path)
            });
            let best = all.fold(f64::NEG_INFINITY, f64::max);
            assert!((worth(&smooth_path(&scores, cost)) - best).abs() < 1e-9);
        }
    }

    #[test]
    fn a_picture_that_shows_nothing_is_bridged() {
        // A part moves by a step a state; in the third nothing is seen, in the fourth a far value looks
        // a little better.
        let mut scores = vec![vec![0.0f32; 30]; 6];
        (0..6).for_each(|s| scores[s][5 + s] = 0.5);
        scores[2][7] = 0.0;
        scores[3][29] = 0.6;
        assert_eq!(smooth_path(&scores, 0.01), [5, 6, 7, 8, 9, 10]);
    }
}
