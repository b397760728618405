//! Stage `joints` of `--method screw`: the tree by depth and pictures, with a person's corrections.

use crate::artifacts::{Joints, Parts, Splats};
use crate::failure::Result;
use crate::overrides::{self, JointOverride};
use hingecast_articulate::coupling;

/// `corrections`: the `[[joint]]` entries of the settings, in order.
///
/// # Errors
/// Corrections that fit nothing.
pub fn run(parts: &Parts, splats: &Splats, corrections: &[JointOverride]) -> Result<Joints> {
    let placed = splats.placed.as_ref();
    let mut joints = Joints {
        tree: placed.map_or_else(|| parts.tree.clone(), |p| p.tree.clone()),
        labels: placed.map_or_else(Vec::new, |p| p.parts.clone()),
        doubts: parts.doubted.clone(),
        certainty: parts.certainty.iter().cloned().map(Some).collect(),
    };
    overrides::apply(&mut joints, corrections, &splats.extent)?;
    let (couplings, doubts) = coupling::find(&joints.tree, &joints.certainty, splats.extent.diagonal);
    joints.tree.couplings = couplings;
    joints.doubts.extend(doubts);
    overrides::uncouple(&mut joints, corrections);
    Ok(joints)
}
