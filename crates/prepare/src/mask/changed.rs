//! Surface that other states looked through.
//!
//! Asked pixel by pixel, not on a grid: scissors on a floor are thinner than any cell.

use glam::{IVec3, Vec3};
use hingecast_articulate::observe::cloud::Cloud;
use hingecast_articulate::observe::lattice::Lattice;
use hingecast_articulate::observe::witness::{Witness, counted};
use rayon::prelude::*;
use std::collections::HashMap;

/// Views of another state that look through a sample of moved surface.
const WITNESSES: usize = 2;
/// Moved samples in the cells around that make one of them believed.
const COMPANY: usize = 5;

/// Whether each sample of each state lies where another state saw empty space, in company.
pub(super) fn moved(clouds: &[Cloud], witnesses: &[Vec<Witness>], lattice: &Lattice) -> Vec<Vec<bool>> {
    (0..clouds.len())
        .into_par_iter()
        .map(|s| {
            let cloud = &clouds[s];
            let free = |x: Vec3| {
                // States with fewer views than that are asked together.
                let mut single = 0;
                (0..witnesses.len()).filter(|r| *r != s).any(|r| {
                    let (through, on) = counted(&witnesses[r], x, 0.0);
                    // Cameras that are a little off look past edges; the others do not.
                    let few = witnesses[r].len() < WITNESSES;
                    single += usize::from(few && through > on);
                    (through >= WITNESSES && through > on) || single >= WITNESSES
                })
            };
            let raw: Vec<bool> = cloud.points.par_iter().map(|x| free(*x)).collect();
            let mut cells: HashMap<IVec3, usize> = HashMap::new();
            for (x, _) in cloud.points.iter().zip(&raw).filter(|(_, m)| **m) {
                *cells.entry(lattice.cell(*x)).or_default() += 1;
            }
            let company = |i: usize| {
                let at = lattice.cell(cloud.points[i]);
                let around = (0..27).map(|k| at + IVec3::new(k % 3 - 1, k / 3 % 3 - 1, k / 9 - 1));
                around.filter_map(|c| cells.get(&c)).sum::<usize>() >= COMPANY
            };
            (0..raw.len()).map(|i| raw[i] && company(i)).collect()
        })
        .collect()
}
