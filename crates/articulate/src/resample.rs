//! How sure joints are, by resampling: what is independent in a recording is a view, or a stretch of the
//! camera's way, not a pixel. Stereo blotches, flying pixels and drift are shared by many samples; a
//! covariance that counts samples is several times too sure.
//!
//! Delete-a-group jackknife (Kott 2001): the views of every state in groups of two stretches of the way, half
//! of it apart, so that no side of the object goes with its group; the joints are fitted anew without each
//! group in turn, and var = (G - 1) / G sum of the squared deviations. With so few groups its own error is Student's: deviations are given such that twice the
//! answer holds 95 %.

use crate::depths::Depths;
use crate::error::ArticulateError;
use crate::model::estimate::{Discovery, Estimate};
use crate::observe::depth_view::DepthView;
use crate::observe::evidence::Evidence;
use crate::observe::lattice::Lattice;
use crate::passes::driver::settle;
use crate::passes::optional_names;
use hingecast_geom::{Joint, KinematicTree, Pose, Progress};

/// Groups of views; of a state with fewer views nothing is left out.
const GROUPS: usize = 5;
/// Student's 97.5 % quantile with GROUPS - 1 degrees of freedom, over that of the normal distribution.
const FEW_GROUPS: f64 = 2.776 / 1.960;
/// Passes that a resampled fit goes through: the tree stays as it was found.
const FITS: [&str; 3] = ["align_states", "refine_joints", "align_axes"];

/// Standard deviations of every joint of `found`: axis (radians), pivot (scene units), value (mean over the
/// states, radians or scene units). `cameras`: as corrected, per state and view. Empty where every state has too few views to leave some out.
///
/// # Errors
/// A view that cannot be read, the wish to stop.
pub fn deviations(
    depths: &mut dyn Depths,
    lattice: Lattice,
    cameras: &[Vec<Pose>],
    found: &Estimate,
    seed: u64,
    progress: &Progress,
) -> Result<Vec<[f64; 3]>, ArticulateError> {
    let n_states = depths.n_states();
    let skip: Vec<String> = optional_names().filter(|name| !FITS.contains(name)).map(String::from).collect();
    let mut sums = vec![[0.0; 3]; found.tree.joints.len()];
    for group in 0..GROUPS {
        progress.report(group, GROUPS, "how sure")?;
        let mut left_out = 0;
        let evidence = Evidence::gather::<ArticulateError>(
            n_states,
            lattice,
            &mut |state| {
                progress.check()?;
                let mut views = depths.views(state).map_err(ArticulateError::of_depths)?;
                views.iter_mut().zip(&cameras[state]).for_each(|(v, pose)| v.camera.camera_from_world = *pose);
                let (views, gone) = without(views, group);
                left_out += gone;
                Ok(views)
            },
            seed,
        )?;
        if left_out == 0 {
            return Ok(Vec::new());
        }
        let again = Discovery::again(&evidence, found.tree.clone(), found.cost);
        let (_, other, _) = settle(evidence, again, seed, &skip, &progress.silent())?;
        for (sum, squares) in sums.iter_mut().zip(apart(&found.tree, &other.tree)) {
            (0..3).for_each(|k| sum[k] += squares[k]);
        }
    }
    let share = (GROUPS - 1) as f64 / GROUPS as f64;
    Ok(sums.into_iter().map(|s| s.map(|sum| FEW_GROUPS * (share * sum).sqrt())).collect())
}

/// The views without a group, and how many went.
fn without(views: Vec<DepthView>, group: usize) -> (Vec<DepthView>, usize) {
    let n = views.len();
    if n < GROUPS {
        return (views, 0);
    }
    let kept: Vec<DepthView> = views
        .into_iter()
        .enumerate()
        .filter(|(i, _)| i * 2 * GROUPS / n % GROUPS != group)
        .map(|(_, view)| view)
        .collect();
    let gone = n - kept.len();
    (kept, gone)
}

/// Squared deviations of every joint: axis, pivot, values (mean of their squares).
fn apart(a: &KinematicTree, b: &KinematicTree) -> Vec<[f64; 3]> {
    let one = |(a, b): (&Joint, &Joint)| {
        let same = if a.screw.axis.dot(b.screw.axis) < 0.0 { -1.0 } else { 1.0 };
        let axis = a.screw.axis.cross(same * b.screw.axis).length();
        let pivot = if a.screw.kind.turns() { b.screw.foot(a.screw.pivot).distance(a.screw.pivot) } else { 0.0 };
        let others = a.values.iter().zip(&b.values).skip(1);
        let squares = others.map(|(x, y)| (x - same * y).powi(2)).sum::<f64>();
        [axis.powi(2), pivot.powi(2), squares / (a.values.len() - 1).max(1) as f64]
    };
    a.joints.iter().zip(&b.joints).map(one).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DVec3;
    use hingecast_geom::{JointKind, Screw};

    fn hinge(axis: DVec3, pivot: DVec3, values: [f64; 3]) -> KinematicTree {
        let screw = Screw { kind: JointKind::Revolute, axis: axis.normalize(), pivot };
        let joint = Joint { name: "j".into(), parent: 0, child: 1, screw, values: values.to_vec(), limits: [0.0; 2] };
        KinematicTree { parts: vec!["a".into(), "b".into()], joints: vec![joint], ..Default::default() }
    }

    /// An axis that points the other way, with values of the other sign, is the same joint; so is one whose
    /// pivot lies elsewhere on it.
    #[test]
    fn the_same_joint_written_otherwise_is_no_deviation() {
        let a = hinge(DVec3::Z, DVec3::X, [0.0, 0.5, 1.0]);
        let b = hinge(-DVec3::Z, DVec3::new(1.0, 0.0, 7.0), [0.0, -0.5, -1.0]);
        assert_eq!(apart(&a, &b), [[0.0; 3]]);
        let tilted = hinge(DVec3::new(0.01, 0.0, 1.0), DVec3::new(1.02, 0.0, 0.0), [0.0, 0.5, 1.03]);
        let [axis, pivot, value] = apart(&a, &tilted)[0].map(f64::sqrt);
        assert!((axis - 0.01).abs() < 1e-5 && (pivot - 0.02).abs() < 1e-4, "{axis} {pivot}");
        assert!((value - 0.03 / 2f64.sqrt()).abs() < 1e-9, "{value}");
    }
}
