//! Where to cut a cell.

use super::cell::Cell;
use super::room::Room;
use rayon::prelude::*;

/// Places along an axis where the section changes most, that are tried.
const JUMPS: usize = 6;
/// Places along an axis that are tried anyway.
const EVEN: usize = 7;
/// A section that changes by all of the cell's is worth this share of the hull's volume.
const JUMP_COUNTS: f64 = 0.5;

/// A cut that leaves one side takes this share off it, or is none.
const LESS: f64 = 0.98;

/// The two sides of the best cut: it leaves the least volume of hulls, or parts what has one
/// section from what has another.
pub fn best(cell: &Cell, room: &Room) -> Option<[Option<Cell>; 2]> {
    let tried: Vec<(usize, f32, f64)> = (0..3).flat_map(|axis| places(cell, axis, room.cell)).collect();
    let scores: Vec<f64> = tried
        .par_iter()
        .map(|&(axis, at, jump)| JUMP_COUNTS * jump - cell.volume_cut(axis, at, room) / cell.hull.volume)
        .collect();
    let best = (0..tried.len()).reduce(|best, new| if scores[new] > scores[best] { new } else { best })?;
    let sides = cell.cut(tried[best].0, tried[best].1, room);
    // A cut past which nothing is left, and nothing less, leads nowhere.
    let left: f64 = sides.iter().flatten().map(|c| c.hull.volume).sum();
    (sides.iter().all(Option::is_some) || left < LESS * cell.hull.volume).then_some(sides)
}

/// Places along an axis worth a try, and how much the section changes there, as a share of the
/// cell's: (axis, place, change).
fn places(cell: &Cell, axis: usize, step: f32) -> Vec<(usize, f32, f64)> {
    let (lo, hi) = (cell.hull.lo[axis], cell.hull.hi[axis]);
    let n = ((hi - lo) / step).ceil() as usize;
    if n < 3 {
        return Vec::new();
    }
    let step = (hi - lo) / n as f32;
    // What faces along the axis is by how much the section changes: sums of area, and of area times place.
    let mut bins = vec![[0.0f64; 3]; n];
    for t in &cell.soup {
        let area = 0.5 * (t[1] - t[0]).cross(t[2] - t[0])[axis];
        let at = (t[0][axis] + t[1][axis] + t[2][axis]) / 3.0;
        let bin = &mut bins[(((at - lo) / step) as usize).min(n - 1)];
        bin[0] += f64::from(area);
        bin[1] += f64::from(area.abs());
        bin[2] += f64::from(area.abs() * at);
    }
    let across = cell.hull.hi - cell.hull.lo;
    let section = f64::from(across[(axis + 1) % 3] * across[(axis + 2) % 3]).max(1e-30);
    let pair = |k: usize| std::array::from_fn::<f64, 3, _>(|c| bins[k][c] + bins[k + 1][c]);
    let mut jumps: Vec<(f32, f64)> = (0..n - 1)
        .filter_map(|k| {
            let [signed, all, moment] = pair(k);
            let peak = |j: usize| pair(j)[0].abs() <= signed.abs();
            let highest = (k == 0 || peak(k - 1)) && (k + 2 >= n || peak(k + 1));
            (all > 0.0 && highest).then(|| ((moment / all) as f32, signed.abs() / section))
        })
        .filter(|(at, _)| (lo + 0.75 * step..=hi - 0.75 * step).contains(at))
        .collect();
    jumps.sort_by(|a, b| b.1.total_cmp(&a.1));
    jumps.truncate(JUMPS);
    let even = (1..=EVEN).map(|k| (lo + (hi - lo) * k as f32 / (EVEN + 1) as f32, 0.0));
    jumps.into_iter().chain(even).map(|(at, jump)| (axis, at, jump)).collect()
}
