//! Statistics that strays do not move.

/// The upper median; 0 of nothing.
pub fn median(values: &mut [f32]) -> f32 {
    let half = values.len() / 2;
    if values.is_empty() { 0.0 } else { *values.select_nth_unstable_by(half, f32::total_cmp).1 }
}

/// Standard deviation of what has these absolute values, by their median: strays do not matter.
pub fn deviation(absolute: &mut [f32]) -> f32 {
    median(absolute) / 0.6745
}
