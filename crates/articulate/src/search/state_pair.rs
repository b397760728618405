//! Two states, and what moved between them.

use crate::observe::occupancy::{Answer, Occupancy};
use crate::observe::sample::{Motion, Sample};
use crate::score::claims::Claims;
use glam::Vec3;

/// The moving samples of one state and the surface of another, both in the parent's canonical
/// frame.
pub struct StatePair<'a> {
    /// Moving samples of the source state.
    pub source: Vec<Sample>,
    /// Point and normal of the target state's surface where a part may land.
    pub targets: Vec<(Vec3, Vec3)>,
    /// The moving samples of the target state, in the parent's canonical frame.
    pub reverse: Vec<Sample>,
    /// Index of the target state, and its space.
    pub target: usize,
    /// Space of the target state.
    pub space: &'a Occupancy,
    /// Of the known parts.
    pub claims: &'a Claims,
    /// Surface with one of these claims is no place to land.
    pub explained: u8,
    /// Voxels between hypotheses: a wrong motion has hundreds of near-copies that would crowd the
    /// right one out.
    pub apart: f32,
    /// World at the target state from the parent's canonical frame.
    pub place: Motion,
}

impl StatePair<'_> {
    pub(super) fn fits(&self, m: &Motion, s: &Sample) -> bool {
        let x = self.place.apply(m.apply(s.point));
        let n = self.place.rot * (m.rot * s.normal);
        let (answer, cell) = self.space.ask_cell(x, n);
        answer == Answer::Surface && self.claims.at(self.target, cell) & self.explained == 0
    }

    /// Source samples that land on unexplained surface, or have landing neighbours in the grid
    /// (`slack` rings).
    pub fn fitting(&self, m: &Motion, slack: usize) -> Vec<Sample> {
        let v = self.space.lattice.voxel;
        let offsets: Vec<Vec3> = if slack == 0 {
            vec![Vec3::ZERO]
        } else {
            [Vec3::ZERO, Vec3::X, Vec3::NEG_X, Vec3::Y, Vec3::NEG_Y, Vec3::Z, Vec3::NEG_Z].map(|o| o * v).to_vec()
        };
        let fits = |s: &&Sample| {
            offsets.iter().any(|o| {
                let moved = Motion { rot: m.rot, trans: m.trans + *o };
                self.fits(&moved, s)
            })
        };
        self.source.iter().filter(fits).copied().collect()
    }
}
