//! What is believed of the object while the evidence is settled.

use super::motions::poses_of;
use super::owners::Owners;
use crate::observe::evidence::Evidence;
use crate::score::part_cost::PartCost;
use crate::score::verdict::Verdict;
use hingecast_geom::{KinematicTree, Pose};

/// What the search found, before labels are settled.
pub struct Discovery {
    /// Parts and joints.
    pub tree: KinematicTree,
    /// Under every part, on every sample. `[part][sample]`
    pub verdicts: Vec<Vec<Verdict>>,
    /// What a part has to be worth.
    pub cost: PartCost,
}

impl Discovery {
    /// A tree that was found on other evidence.
    pub fn again(evidence: &Evidence, tree: KinematicTree, cost: PartCost) -> Self {
        let judge = |p: usize| evidence.judge(&poses_of(&tree, p, evidence.n_states()));
        Self { verdicts: (0..tree.parts.len()).map(judge).collect(), tree, cost }
    }
}

/// The tree and what was found with it.
#[derive(Clone, Debug)]
pub struct Estimate {
    /// Parts and joints.
    pub tree: KinematicTree,
    /// Who owns which sample.
    pub owners: Owners,
    /// Under every part, on every sample. `[part][sample]`
    pub verdicts: Vec<Vec<Verdict>>,
    /// What a part has to be worth.
    pub cost: PartCost,
    /// Per joint, the states that do not show its part, each with the state whose value it keeps.
    pub hidden: Vec<Vec<(usize, usize)>>,
    /// Per state: world from the world that its cameras believed in.
    pub world_from_state: Vec<Pose>,
    /// Corrections of the states' frames that the evidence has yet to be moved by.
    pub reframe: Option<Vec<Pose>>,
    /// Of the last fit.
    pub report: FitReport,
    /// Share of the samples that every part contradicts.
    pub unexplained: f64,
}

/// What the last round of Gauss and Newton knew.
#[derive(Clone, Debug, Default, serde::Serialize, serde::Deserialize)]
pub struct FitReport {
    /// Root mean square of the accepted residuals, scene units.
    pub rms: f64,
    /// Accepted residuals.
    pub rows: usize,
    /// Mean over all comparisons of r^2 / gate^2, 1 where no surface was found.
    pub cost: f64,
    /// Standard deviations per joint: axis `[rad]`, pivot `[scene units]`, value (mean over states).
    pub sigmas: Vec<[f64; 3]>,
}
