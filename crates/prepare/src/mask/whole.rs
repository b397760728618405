//! Whether what was found is one thing, and not a room or several things.

use super::pieces::{Object, Pieces, joined};
use glam::Vec3;

/// Cells of one state farther apart than this, along an axis, do not touch: it is seen less densely than all.
const TOUCH: i32 = 3;
/// A piece with less than this share of the cells is no matter.
const PIECE: f64 = 0.08;
/// A box that leaves out this share of a thing cuts it.
const CUT: f64 = 0.08;

/// Names states in which the object alone falls apart: a thing that stood against it in another state.
pub(super) fn falls_apart(pieces: &Pieces, object: &Object, doubts: &mut Vec<String>) {
    let apart = |state: &usize| {
        let mut own = vec![false; object.cells.len()];
        pieces.states[*state].iter().filter(|i| object.cells[**i]).for_each(|i| own[*i] = true);
        let (piece, count) = joined(&pieces.lattice, TOUCH, |i| own[i]);
        large(&sizes(&piece, count, |_| true)) > 1
    };
    let n = pieces.states.len();
    let states: Vec<usize> = (0..n).filter(apart).collect();
    if let Some(first) = states.first() {
        doubts.push(format!(
            "in {} of {n} states, first in state {first}, the object is in pieces that do not touch: is a thing in its masks \
             that stood against it in another state?",
            states.len()
        ));
    }
}

/// What a box holds: several things, or a part of one.
pub(super) fn boxed(pieces: &Pieces, lo: Vec3, hi: Vec3, doubts: &mut Vec<String>) {
    let (piece, count) = pieces.pieces();
    let whole = sizes(&piece, count, |_| true);
    let held = sizes(&piece, count, |i| pieces.in_box(i, lo, hi));
    let things = large(&held);
    if things > 1 {
        doubts.push(format!("the box holds {things} things that do not touch; all are taken for the object"));
    }
    // Of the thing that the box holds most of.
    let most = (1..held.len()).max_by_key(|p| held[*p]);
    let share = most.map_or(0.0, |p| (whole[p] - held[p]) as f64 / whole[p].max(1) as f64);
    if share > CUT {
        doubts.push(format!(
            "the box cuts through what it holds: {:.0} % of it, over all states, is outside and left out",
            100.0 * share
        ));
    }
}

/// How many cells of every piece count; 0 of what is no piece.
fn sizes(piece: &[u32], count: u32, counts: impl Fn(usize) -> bool) -> Vec<usize> {
    let mut cells = vec![0usize; count as usize + 1];
    piece.iter().enumerate().filter(|(i, p)| **p > 0 && counts(*i)).for_each(|(_, p)| cells[*p as usize] += 1);
    cells
}

/// How many pieces have a share of the cells that matters.
fn large(sizes: &[usize]) -> usize {
    let all: usize = sizes.iter().sum();
    sizes.iter().filter(|c| **c as f64 >= PIECE * all.max(1) as f64).count()
}
