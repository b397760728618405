//! Hinges that lie far away from the object may be slides.

use super::pass::Round;
use crate::fit::rival::rival;
use crate::model::estimate::Estimate;
use crate::model::mean::mean_point;
use crate::score::compare::REFUTED_NATS;

/// A hinge this many extents away from the object may be a slide.
const FAR_EXTENTS: f64 = 2.0;

/// Turns hinges that lie far away into slides where a slide explains the recording as well.
pub fn far_hinges(round: &Round, estimate: &mut Estimate) {
    let evidence = round.evidence;
    let centre = mean_point(evidence.samples.iter().map(|s| s.point));
    for j in 0..estimate.tree.joints.len() {
        let joint = &estimate.tree.joints[j];
        if !joint.screw.kind.turns() || joint.screw.distance(centre) < FAR_EXTENTS * evidence.extent() as f64 {
            continue;
        }
        let own = estimate.owners.members(evidence, joint.child);
        let (slide, nats) = rival(evidence, &estimate.tree, j, &own, round.seed);
        if nats < REFUTED_NATS {
            estimate.tree = slide;
        }
    }
}
