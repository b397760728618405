//! Which pairs of states are looked at for what moved between them.

/// Pairs of states per parent and round.
const PAIRS: usize = 6;
/// Two states show well what has moved if they show this part (one in so many) of the most that two
/// states do.
const WELL: usize = 4;
/// Fewer samples do not make a pair worth looking at, or a pose worth asking.
pub const LEAST_SAMPLES: usize = 12;

/// Pairs of states that show motion, at most two from one source state and two to one target.
/// `counts`: open samples of the first that the second contradicts. (n, n)
///
/// In turns the pair where most has moved, the pair where both states show most of what has moved
/// (a closed drawer shows its front alone, and a front fits wherever there is another), and the
/// pair where least has moved that both show well: with luck one part alone.
pub fn varied_pairs(counts: &[usize], n: usize) -> Vec<usize> {
    let back = |k: usize| counts[k % n * n + k / n];
    let both = |k: usize| counts[k].min(back(k));
    let most = (0..n * n).map(both).max().unwrap_or(0);
    let ranked = |least: usize, by: &dyn Fn(usize) -> isize| {
        let mut pairs: Vec<usize> =
            (0..n * n).filter(|&k| counts[k] >= LEAST_SAMPLES && WELL * both(k) >= least).collect();
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pairs_are_those_with_most_motion_and_those_with_one_part_alone() {
        // Four states: a big part has left for good from state 1 on (100 samples); a small one
        // moves between 2 and 3 (20).
        let mut counts = vec![0; 16];
        for t in 1..4 {
            (counts[t], counts[4 * t]) = (100, 110);
        }
        (counts[2 * 4 + 3], counts[3 * 4 + 2]) = (27, 28);
        let pairs = varied_pairs(&counts, 4);
        assert_eq!(pairs.len(), PAIRS, "{pairs:?}");
        assert!(pairs.contains(&4), "most has moved: {pairs:?}");
        assert!(pairs.contains(&14) && pairs.contains(&11), "least has moved: {pairs:?}");
        assert!(pairs.iter().all(|k| counts[*k] >= LEAST_SAMPLES), "{pairs:?}");
        // No pair shows anything.
        assert!(varied_pairs(&[0; 16], 4).is_empty());
    }
}
