//! A person's corrections: `[[joint]]` entries of the config overrule what was found; only the
//! stages from `joints` on run again.

use crate::artifacts::{Extent, Joints};
use crate::failure::{Failure, Result};
use glam::DVec3;
use hingecast_articulate::Doubt;
use hingecast_geom::{Joint, JointKind, KinematicTree};
use serde::{Deserialize, Serialize};

/// One `[[joint]]` entry; what it leaves out stays as found.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct JointOverride {
    /// Name of the joint that is meant, as in `twin.json` (`joint_1`).
    pub joint: String,
    /// New name.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub name: Option<String>,
    /// Another type.
    #[serde(rename = "type", skip_serializing_if = "Option::is_none")]
    pub kind: Option<JointKind>,
    /// Direction, world frame, any length.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub axis: Option<[f64; 3]>,
    /// A point on the axis, world frame, scene units, as of the first state.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub pivot: Option<[f64; 3]>,
    /// Name of the part that carries it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub parent: Option<String>,
    /// Degrees for hinges, scene units for slides, from the first state's value.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub limits: Option<[f64; 2]>,
    /// It follows no other joint, whatever the recording says.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub independent: Option<bool>,
}

/// Farthest that a pivot lies from the object or a slide goes, diagonals of it: a nearly straight
/// way is a turn about something far.
const FARTHEST: f64 = 20.0;
/// Most that a hinge turns.
const MOST_TURNS: f64 = 10.0;

/// What limits may leave out of the range that was seen, share of it, before it is a doubt: nobody
/// writes down all digits of a value.
const ROUNDED: f64 = 0.005;

/// Applies the entries in order, to joints of an object of this `size`.
///
/// # Errors
/// Joints or parts that are not there, axes of no length, limits upside down, numbers out of all
/// proportion, a tree that hangs on itself.
pub fn apply(file: &mut Joints, entries: &[JointOverride], size: &Extent) -> Result<()> {
    for (k, entry) in entries.iter().enumerate() {
        one(file, entry, size)
            .map_err(|(what, hint)| Failure::new(what, format!("[[joint]] number {}", k + 1), hint))?;
    }
    file.doubts.extend(left_out(&file.tree));
    file.tree.validate().map_err(|e| Failure::new(e, "[[joint]]", "change 'parent'"))
}

/// A doubt for every joint with recorded states beyond its limits: those that nobody corrected are
/// the range that was seen.
fn left_out(tree: &KinematicTree) -> Vec<Doubt> {
    let doubt = |j: &Joint| {
        let [lo, hi] = j.limits;
        let beyond = |v: f64| (lo - v).max(v - hi);
        let [least, most] = j.seen();
        let states: Vec<usize> =
            (0..j.values.len()).filter(|s| beyond(j.values[*s]) > ROUNDED * (most - least)).collect();
        let (joint, by, turns) = (j.name.clone(), beyond(least).max(beyond(most)), j.screw.kind.turns());
        (!states.is_empty()).then_some(Doubt::LimitsLeaveOut { joint, states, by, turns })
    };
    let limited = |j: &&Joint| !matches!(j.screw.kind, JointKind::Fixed | JointKind::Continuous);
    tree.joints.iter().filter(limited).filter_map(doubt).collect()
}

/// Takes out what a person says is no coupling, and the doubts about it.
pub fn uncouple(file: &mut Joints, entries: &[JointOverride]) {
    for entry in entries.iter().filter(|e| e.independent == Some(true)) {
        let name = entry.name.as_ref().unwrap_or(&entry.joint);
        if let Some(j) = file.tree.joints.iter().position(|joint| joint.name == *name) {
            file.tree.couplings.retain(|c| c.follower != j);
        }
        file.doubts.retain(|d| !matches!(d, Doubt::MayFollow { joint, .. } if joint == name));
    }
}

fn one(file: &mut Joints, entry: &JointOverride, size: &Extent) -> std::result::Result<(), (String, String)> {
    let names: Vec<&str> = file.tree.joints.iter().map(|j| j.name.as_str()).collect();
    let there = match names.is_empty() {
        true => "leave [[joint]] out: this run found no joint".to_string(),
        false => format!("joint = one of: {}", names.join(", ")),
    };
    let Some(j) = names.iter().position(|n| *n == entry.joint) else {
        return Err((format!("no joint '{}'", entry.joint), there));
    };
    let parent =
        match &entry.parent {
            None => file.tree.joints[j].parent,
            Some(name) => file.tree.parts.iter().position(|p| p == name).ok_or_else(|| {
                (format!("no part '{name}'"), format!("parent = one of: {}", file.tree.parts.join(", ")))
            })?,
        };
    let joint = &mut file.tree.joints[j];
    // What was in doubt about it a person has now decided.
    if entry.kind.is_some() || entry.axis.is_some() {
        file.doubts.retain(|d| d.about() != Some(&joint.name));
    }
    if entry.kind.is_some() || entry.axis.is_some() || entry.pivot.is_some() {
        file.certainty[j] = None;
    }
    let before = joint.screw;
    joint.parent = parent;
    if let Some(kind) = entry.kind {
        joint.screw.kind = kind;
    }
    if let Some(axis) = entry.axis {
        let axis = DVec3::from(axis).try_normalize().filter(|a| a.is_finite());
        let hint = "axis = [x, y, z], not all 0".to_string();
        joint.screw.axis = axis.ok_or_else(|| ("an axis without direction".to_string(), hint))?;
    }
    if let Some(pivot) = entry.pivot {
        let middle = 0.5 * (DVec3::from(size.lo) + DVec3::from(size.hi));
        let far = DVec3::from(pivot).distance(middle);
        if !(far <= FARTHEST * size.diagonal) {
            let hint =
                format!("pivot = [x, y, z] in scene units, near {middle:.3}; the object is {:.3} large", size.diagonal);
            return Err((format!("a pivot {far:.3e} from the object"), hint));
        }
        joint.screw.pivot = DVec3::from(pivot);
    }
    // The part keeps going where it went, as far as the new screw can take it.
    if joint.screw != before {
        let screw = joint.screw;
        let reach = before.pivot + before.axis.any_orthonormal_vector();
        for v in &mut joint.values {
            let to = before.motion(*v).apply(reach) - reach;
            *v = match (before.kind.turns(), screw.kind.turns()) {
                (false, true) => {
                    let arm = reach - screw.foot(reach);
                    let side = screw.axis.cross(arm);
                    if side.length() > 1e-9 { to.dot(side.normalize()) / arm.length() } else { 0.0 }
                }
                (true, false) => to.dot(screw.axis),
                _ => *v * if before.axis.dot(screw.axis) < 0.0 { -1.0 } else { 1.0 },
            };
        }
        if screw.kind == JointKind::Fixed {
            joint.values.iter_mut().for_each(|v| *v = 0.0);
        }
        joint.limits = joint.seen();
    }
    if let Some([lo, hi]) = entry.limits {
        if !(lo <= hi) {
            return Err((format!("limits {lo} .. {hi} are upside down"), "limits = [lower, upper]".to_string()));
        }
        let most = if joint.screw.kind.turns() { 360.0 * MOST_TURNS } else { FARTHEST * size.diagonal };
        if !(lo.abs().max(hi.abs()) <= most) {
            let hint = format!("limits = [lower, upper] within {most:.1}; degrees for hinges, scene units for slides");
            return Err((format!("limits {lo:e} .. {hi:e} are out of all proportion"), hint));
        }
        let unit = if joint.screw.kind.turns() { 1f64.to_radians() } else { 1.0 };
        joint.limits = [lo * unit, hi * unit];
    }
    if let Some(name) = &entry.name {
        may_be_called(name, j, &file.tree)?;
        let joint = &mut file.tree.joints[j];
        file.doubts = std::mem::take(&mut file.doubts).into_iter().map(|d| d.renamed(&joint.name, name)).collect();
        joint.name.clone_from(name);
    }
    Ok(())
}

/// Names go into URDF and MJCF, where another joint's, an empty one or one with control characters makes a
/// model that nobody loads.
fn may_be_called(name: &str, j: usize, tree: &KinematicTree) -> std::result::Result<(), (String, String)> {
    if name.trim().is_empty() || name.chars().any(char::is_control) {
        return Err((format!("no name for a joint: {name:?}"), "name = letters, digits, _ and -".to_string()));
    }
    match tree.joints.iter().enumerate().any(|(k, other)| k != j && other.name == name) {
        true => Err((format!("two joints called '{name}'"), "name = one that no other joint has".to_string())),
        false => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use hingecast_geom::Screw;

    fn door() -> Joints {
        let screw = Screw { kind: JointKind::Revolute, axis: DVec3::Z, pivot: DVec3::ZERO };
        let (name, values, limits) = ("joint_1".to_string(), vec![0.0, 1.0], [0.0, 1.0]);
        let joints = vec![Joint { name, parent: 0, child: 1, screw, values, limits }];
        let tree = KinematicTree { parts: ["base", "part_1"].map(String::from).to_vec(), joints, ..Default::default() };
        Joints { tree, labels: Vec::new(), doubts: Vec::new(), certainty: vec![None] }
    }

    fn refused(entry: JointOverride) -> String {
        let size = Extent { lo: [0.0; 3], hi: [1.0; 3], diagonal: 1.7 };
        let entry = JointOverride { joint: "joint_1".into(), ..entry };
        apply(&mut door(), &[entry], &size).map_err(|e| e.what).err().unwrap_or_default()
    }

    #[test]
    fn without_joints_there_is_none_to_name() {
        let mut file = door();
        file.tree.joints.clear();
        let size = Extent { lo: [0.0; 3], hi: [1.0; 3], diagonal: 1.7 };
        let entry = JointOverride { joint: "joint_1".into(), ..Default::default() };
        let e = apply(&mut file, &[entry], &size).unwrap_err();
        assert!(e.hint.contains("found no joint"), "{e}");
    }

    /// They once went into the twin without a word, and the report called them the range seen.
    #[test]
    fn limits_that_leave_out_recorded_states_are_a_doubt() {
        let size = Extent { lo: [0.0; 3], hi: [1.0; 3], diagonal: 1.7 };
        let doubts = |limits: [f64; 2], kind: Option<JointKind>| {
            let mut file = door();
            let entry = JointOverride {
                joint: "joint_1".into(),
                name: Some("door".into()),
                limits: Some(limits),
                kind,
                ..Default::default()
            };
            apply(&mut file, &[entry], &size).unwrap();
            file.doubts.iter().map(Doubt::to_string).collect::<Vec<_>>()
        };
        // It was seen to 57.2958 degrees; a person writes 57.2.
        assert!(doubts([0.0, 57.2], None).is_empty());
        assert!(doubts([0.0, 90.0], None).is_empty());
        let [short] = &doubts([0.0, 50.0], None)[..] else { panic!("no doubt") };
        assert!(short.contains("joint 'door': its limits leave out state 1, by up to 7.3 deg"), "{short}");
        let [both] = &doubts([10.0, 50.0], None)[..] else { panic!("no doubt") };
        assert!(both.contains("states 0, 1, by up to 10.0 deg"), "{both}");
        assert!(doubts([0.0, 50.0], Some(JointKind::Continuous)).is_empty());
    }

    /// Off by powers of ten, they once took all memory, or all time.
    #[test]
    fn numbers_out_of_all_proportion_are_refused() {
        let pivot = |x: f64| refused(JointOverride { pivot: Some([x, 0.0, 0.0]), ..Default::default() });
        assert_eq!(pivot(12.0), "");
        for x in [50.0, 1e6, 1e300, f64::INFINITY, f64::NAN] {
            assert!(pivot(x).contains("from the object"), "{x}");
        }
        let limits = |x: f64| refused(JointOverride { limits: Some([-x, x]), ..Default::default() });
        assert_eq!(limits(720.0), "");
        for x in [4000.0, 1e7, 1e308, f64::INFINITY] {
            assert!(limits(x).contains("proportion"), "{x}");
        }
    }
}
