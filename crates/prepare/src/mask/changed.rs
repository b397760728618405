//! Surface that other states looked through.

use glam::IVec3;
use hingecast_articulate::observe::cloud::Cloud;
use hingecast_articulate::observe::lattice::Lattice;
use hingecast_articulate::observe::occupancy::{Answer, Occupancy};
use rayon::prelude::*;
use std::collections::HashMap;

/// Moved samples in the cells around that make one of them believed.
const COMPANY: usize = 5;

/// Whether each sample of each state lies where another state saw empty space, in company.
pub(super) fn moved(clouds: &[Cloud], spaces: &[Occupancy], lattice: &Lattice) -> Vec<Vec<bool>> {
    (0..clouds.len())
        .into_par_iter()
        .map(|s| {
            let cloud = &clouds[s];
            let free = |i: usize| {
                let (x, n) = (cloud.points[i], cloud.normals[i]);
                (0..spaces.len()).any(|r| r != s && spaces[r].ask(x, n) == Answer::Free)
            };
            let raw: Vec<bool> = (0..cloud.points.len()).map(free).collect();
            let mut cells: HashMap<IVec3, usize> = HashMap::new();
            for (x, _) in cloud.points.iter().zip(&raw).filter(|(_, m)| **m) {
                *cells.entry(super::cell(lattice, *x)).or_default() += 1;
            }
            let company = |i: usize| {
                let at = super::cell(lattice, cloud.points[i]);
                let around = (0..27).map(|k| at + IVec3::new(k % 3 - 1, k / 3 % 3 - 1, k / 9 - 1));
                around.filter_map(|c| cells.get(&c)).sum::<usize>() >= COMPANY
            };
            (0..raw.len()).map(|i| raw[i] && company(i)).collect()
        })
        .collect()
}
