//! Fewer views of a film: neighbours show the same.

use super::{Config, Source};
use crate::Split;
use std::collections::BTreeMap;

/// Keeps every `every`-th training picture of each state, and of these at most `max_views`, evenly
/// spread; says what was left out. Held-out pictures stay.
pub(super) fn thin(source: &mut Source, config: &Config) {
    let mut of_state = BTreeMap::<usize, Vec<usize>>::new();
    for (i, shot) in source.shots.iter().enumerate() {
        if shot.split == Split::Train {
            of_state.entry(shot.state).or_default().push(i);
        }
    }
    let mut keep: Vec<bool> = source.shots.iter().map(|s| s.split == Split::Test).collect();
    let (mut before, mut after) = (0, 0);
    for views in of_state.values() {
        let stepped: Vec<usize> = views.iter().copied().step_by(config.every.max(1)).collect();
        let chosen = spread(stepped.len(), config.max_views.max(1));
        before += views.len();
        after += chosen.len();
        chosen.into_iter().for_each(|k| keep[stepped[k]] = true);
    }
    if after < before {
        source.notes.push(format!(
            "{} of {before} pictures were left out, evenly: {after} are kept (--every {}, --max-views {})",
            before - after,
            config.every,
            config.max_views
        ));
    }
    let mut kept = keep.into_iter();
    source.shots.retain(|_| kept.next().unwrap_or(true));
}

/// At most `most` of `0..n`, evenly spread, in order.
fn spread(n: usize, most: usize) -> Vec<usize> {
    let count = n.min(most);
    (0..count).map(|k| (2 * k + 1) * n / (2 * count)).collect()
}

#[cfg(test)]
mod tests {
    use super::spread;

    #[test]
    fn what_is_kept_is_spread_evenly() {
        assert_eq!(spread(3, 5), [0, 1, 2]);
        assert_eq!(spread(10, 5), [1, 3, 5, 7, 9]);
        let chosen = spread(1000, 120);
        assert_eq!(chosen.len(), 120);
        assert!(chosen.windows(2).all(|w| (8..=9).contains(&(w[1] - w[0]))));
    }
}
