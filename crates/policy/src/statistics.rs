//! How sure a success rate is, and a difference of two rates measured on the same episodes. All
//! intervals are 95 %.
//!
//! ```text
//! Wilson 1927, k of n, p = k/n:     (p + z^2/2n +- z sqrt(p (1-p)/n + z^2/4n^2)) / (1 + z^2/n)
//! McNemar 1947, exact:              P = min(1, 2 sum_{i <= min(b,c)} C(b+c, i) / 2^(b+c))
//! Tango 1998, all D with            |b - c - n D| / sqrt(n (2 q + D (1-D))) <= z,
//!     q = (sqrt(B^2 - 4AC) - B) / 2A,  A = 2n,  B = (2n - b + c) D - b - c,  C = -c D (1-D)
//! ```
//! b: episodes that only the first won, c: only the second, D: the true difference, q: the most
//! likely probability of c given D. Tango's score interval is the one that Fagerland, Lydersen and
//! Laake (2013) recommend beside McNemar's test; it keeps its width where no episode differs.

use serde::Serialize;

/// Standard normal quantile of 97.5 %.
const Z: f64 = 1.959_963_984_540_054;

/// Wilson's interval of a proportion.
///
/// ```
/// # use hingecast_policy::statistics::wilson;
/// let [low, high] = wilson(190, 200);
/// assert!((low - 0.9104).abs() < 1e-4 && (high - 0.9726).abs() < 1e-4);
/// ```
///
/// # Panics
/// No trials, or more successes than trials.
pub fn wilson(successes: usize, trials: usize) -> [f64; 2] {
    assert!(trials > 0 && successes <= trials, "{successes} successes of {trials}");
    let n = trials as f64;
    let p = successes as f64 / n;
    let z2 = Z * Z / n;
    let half = Z * (p * (1.0 - p) / n + z2 / (4.0 * n)).sqrt();
    let middle = p + z2 / 2.0;
    // Rounding must not push the limits of 0 of n and n of n outside, or off their exact ends.
    let low = if successes == 0 { 0.0 } else { (middle - half) / (1.0 + z2) };
    let high = if successes == trials { 1.0 } else { (middle + half) / (1.0 + z2) };
    [low, high]
}

/// The same episodes on two things: how often which of them succeeded.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct Paired {
    /// Episodes in which both succeeded.
    pub both: usize,
    /// Episodes in which only the first succeeded.
    pub only_first: usize,
    /// Episodes in which only the second succeeded.
    pub only_second: usize,
    /// Episodes in which neither succeeded.
    pub neither: usize,
}

/// What a paired comparison says.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Comparison {
    /// Success rate of the first minus that of the second.
    pub difference: f64,
    /// Tango's interval of it.
    pub interval: [f64; 2],
    /// McNemar's exact two-sided P: how often chance alone would make the two differ at least as
    /// much.
    pub p_value: f64,
}

impl Paired {
    /// Episode i of `first` had the same seed as episode i of `second`.
    ///
    /// # Panics
    /// Different numbers of episodes.
    pub fn count(first: &[bool], second: &[bool]) -> Self {
        assert_eq!(first.len(), second.len(), "paired episodes");
        let mut out = Self::default();
        for pair in first.iter().zip(second) {
            match pair {
                (true, true) => out.both += 1,
                (true, false) => out.only_first += 1,
                (false, true) => out.only_second += 1,
                (false, false) => out.neither += 1,
            }
        }
        out
    }

    /// How many episodes there are.
    pub fn episodes(&self) -> usize {
        self.both + self.only_first + self.only_second + self.neither
    }

    /// Difference, interval and P of the two success rates.
    ///
    /// # Panics
    /// No episodes.
    pub fn compare(&self) -> Comparison {
        let (b, c, n) = (self.only_first, self.only_second, self.episodes());
        assert!(n > 0, "no episodes to compare");
        Comparison {
            difference: (b as f64 - c as f64) / n as f64,
            interval: [-upper_limit(c, b, n), upper_limit(b, c, n)],
            p_value: mcnemar_exact(b, c),
        }
    }
}

/// McNemar's exact test: two-sided binomial probability of b against c discordant pairs.
pub fn mcnemar_exact(b: usize, c: usize) -> f64 {
    let n = b + c;
    // ln C(n, i) / 2^n, so that thousands of pairs do not overflow.
    let mut log_term = -(n as f64) * std::f64::consts::LN_2;
    let mut tail = 0.0;
    for i in 0..=b.min(c) {
        tail += log_term.exp();
        log_term += ((n - i) as f64).ln() - ((i + 1) as f64).ln();
    }
    (2.0 * tail).min(1.0)
}

/// Tango's upper limit by bisection: the score falls as the assumed difference rises.
fn upper_limit(b: usize, c: usize, n: usize) -> f64 {
    let (b, c, n) = (b as f64, c as f64, n as f64);
    let score = |d: f64| {
        let (p, q, r) = (2.0 * n, (2.0 * n - b + c) * d - b - c, -c * d * (1.0 - d));
        let only_second = ((q * q - 4.0 * p * r).max(0.0).sqrt() - q) / (2.0 * p);
        (b - c - n * d) / (n * (2.0 * only_second + d * (1.0 - d))).sqrt()
    };
    // At the estimate itself the score is zero, or 0/0 where no pair differs.
    let (mut low, mut high) = ((b - c) / n, 1.0);
    for _ in 0..100 {
        let middle = 0.5 * (low + high);
        if score(middle) > -Z { low = middle } else { high = middle }
    }
    high
}

#[cfg(test)]
mod tests {
    use super::*;

    fn close(found: [f64; 2], published: [f64; 2], digits: f64) {
        for k in 0..2 {
            assert!((found[k] - published[k]).abs() <= 0.5001 * digits, "{found:?} instead of {published:?}");
        }
    }

    /// Newcombe, Statistics in Medicine 17 (1998) 857, table I, method 3.
    #[test]
    fn wilson_as_published() {
        close(wilson(81, 263), [0.2553, 0.3662], 1e-4);
        close(wilson(15, 148), [0.0624, 0.1605], 1e-4);
        close(wilson(0, 20), [0.0, 0.1611], 1e-4);
        close(wilson(1, 29), [0.0061, 0.1718], 1e-4);
        assert_eq!(wilson(29, 29)[1], 1.0);
    }

    fn paired(both: usize, only_first: usize, only_second: usize, neither: usize) -> Comparison {
        Paired { both, only_first, only_second, neither }.compare()
    }

    /// Fagerland, Lydersen and Laake, BMC Medical Research Methodology 13 (2013) 91, and their R
    /// package `contingencytables`: Bentur et al. 2009 (1, 1, 7, 12), Cavo et al. 2012 (59, 6, 16,
    /// 80).
    #[test]
    fn paired_tables_as_published() {
        let bentur = paired(1, 1, 7, 12);
        close(bentur.interval, [-0.517, -0.026], 1e-3);
        assert!((bentur.p_value - 0.0703).abs() < 5e-5, "{bentur:?}");
        let cavo = paired(59, 6, 16, 80);
        close(cavo.interval, [-0.1240, -0.0054], 1e-4);
        assert!((cavo.difference + 0.0621).abs() < 5e-5 && (cavo.p_value - 0.052479).abs() < 5e-7, "{cavo:?}");
    }

    /// No episode differs: not "no doubt", but z^2 / (n + z^2) to either side.
    #[test]
    fn equal_outcomes_keep_an_interval() {
        let same = paired(200, 0, 0, 0);
        let half = Z * Z / (200.0 + Z * Z);
        close(same.interval, [-half, half], 1e-9);
        assert_eq!((same.difference, same.p_value), (0.0, 1.0));
    }

    #[test]
    fn changing_places_changes_the_sign() {
        for (b, c, n) in [(0, 5, 9), (12, 2, 50), (0, 40, 40), (7, 7, 30)] {
            let (one, other) = (paired(n - b - c, b, c, 0), paired(0, c, b, n - b - c));
            assert!((one.difference + other.difference).abs() < 1e-15 && one.p_value == other.p_value);
            close(one.interval, [-other.interval[1], -other.interval[0]], 1e-12);
            assert!(one.interval[0] <= one.difference && one.difference <= one.interval[1], "{one:?}");
            assert!(one.interval[0] >= -1.0 && one.interval[1] <= 1.0);
        }
    }

    /// Over all tables of 12 episodes with equal true rates the exact test rejects at 5 % no more
    /// than 5 % of the time.
    #[test]
    fn mcnemar_keeps_its_level() {
        for n in [6usize, 12, 40, 2000] {
            let binomial = |i: usize| {
                let log: f64 = (0..i).map(|k| ((n - k) as f64 / (k + 1) as f64).ln()).sum();
                (log - n as f64 * 2f64.ln()).exp()
            };
            let rejected: f64 = (0..=n).filter(|b| mcnemar_exact(*b, n - b) <= 0.05).map(binomial).sum();
            assert!(rejected <= 0.05 && rejected > 0.01, "{n}: {rejected}");
        }
    }

    #[test]
    fn pairs_are_counted() {
        let counted = Paired::count(&[true, true, false, false, true], &[true, false, true, false, true]);
        assert_eq!(counted, Paired { both: 2, only_first: 1, only_second: 1, neither: 1 });
    }
}
