//! Which measured surface known parts explain: two bits for every cell of every state's lattice.
//!
//! A search for one more part, or for the value of one joint, asks about surface that nothing else
//! explains. What is already explained is no property of the recording, so it stands here and not
//! in the evidence: a value, made for one question and passed to whoever asks it.

use crate::model::motions::{poses_of, state_to_state};
use crate::observe::evidence::Evidence;
use crate::observe::sample::Sample;
use glam::Vec3;
use hingecast_geom::{KinematicTree, Pose};
use rayon::prelude::*;

/// A known part could explain this surface: nothing speaks against it, but nobody saw it elsewhere.
pub const POSSIBLE: u8 = 1;
/// A known part explains this surface.
pub const TAKEN: u8 = 2;

/// Cells in a word.
const CELLS: usize = 32;

/// Claims of known parts on the surface of every state.
#[derive(Clone, Debug, Default)]
pub struct Claims {
    /// Two bits a cell; nothing where nothing is claimed. `[state][cell / 32]`
    states: Vec<Vec<u64>>,
}

impl Claims {
    /// Nothing is claimed.
    pub fn none() -> Self {
        Self::default()
    }

    /// Claims of parts with these poses (world from canonical) `[part][state]`: on cells around
    /// surface that one of them explains (never contradicted, and confirmed by half of the states),
    /// and on those that one could explain (never contradicted).
    pub fn of_parts(evidence: &Evidence, parts: &[Vec<Pose>]) -> Self {
        let n = evidence.n_states();
        let between: Vec<_> = parts.iter().map(|p| state_to_state(p)).collect();
        let of_state = |state: usize| {
            let cloud = &evidence.clouds[state];
            let mut words = vec![0u64; evidence.lattice.len().div_ceil(CELLS)];
            let mut mark = |x: Vec3, bit: u8| {
                evidence.lattice.around(x, &mut |i| words[i / CELLS] |= u64::from(bit) << (2 * (i % CELLS)));
            };
            for i in 0..cloud.points.len() {
                let s = Sample::of(cloud, state, i);
                let verdicts = between.iter().map(|b| evidence.verdict(&s, &b[state]));
                let most = verdicts.filter(|v| v.against == 0).map(|v| v.support.count_ones() as usize).max();
                match most {
                    Some(most) if 2 * most >= n - 1 => mark(s.point, TAKEN),
                    Some(_) => mark(s.point, POSSIBLE),
                    None => {}
                }
            }
            words
        };
        Self { states: (0..n).into_par_iter().map(of_state).collect() }
    }

    /// Claims of all parts but the child of joint `j`.
    pub fn of_others(evidence: &Evidence, tree: &KinematicTree, j: usize) -> Self {
        let others = (0..tree.parts.len()).filter(|p| *p != tree.joints[j].child);
        Self::of_parts(evidence, &others.map(|p| poses_of(tree, p, evidence.n_states())).collect::<Vec<_>>())
    }

    /// The bits [`TAKEN`] and [`POSSIBLE`] of a cell of a state's lattice.
    #[inline]
    pub fn at(&self, state: usize, cell: usize) -> u8 {
        self.states.get(state).map_or(0, |words| (words[cell / CELLS] >> (2 * (cell % CELLS)) & 3) as u8)
    }

    /// The same at a place; nothing is claimed beyond the lattice.
    #[inline]
    pub fn at_place(&self, evidence: &Evidence, state: usize, x: Vec3) -> u8 {
        evidence.lattice.index(x).map_or(0, |cell| self.at(state, cell))
    }
}
