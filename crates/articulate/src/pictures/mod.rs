//! Noisy recordings: joints and frames by pictures and depth together.

pub mod gradient;
pub mod information;
pub mod levenberg;
pub mod problem;

#[cfg(test)]
mod tests;
