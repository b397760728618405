//! Log-likelihood ratios between fits of the same samples, in nats.

/// Samples count as independent evidence in groups of this size: neighbours share their noise.
pub const CORRELATED: f64 = 25.0;
/// A rival that is at least this many nats behind is refuted.
pub const REFUTED_NATS: f64 = 10.0;

/// How many nats worse than `own` a fit with cost `theirs` explains `n` samples.
pub fn nats_behind(n: usize, theirs: f64, own: f64) -> f64 {
    let floor = 1e-6;
    0.5 * (n as f64 / CORRELATED) * ((theirs + floor) / (own + floor)).ln()
}

/// What two unknowns must gain on `n` samples, nats (the Bayesian information criterion).
pub fn bic_of_two_unknowns(n: usize) -> f64 {
    (n as f64 / CORRELATED).max(2.0).ln()
}
