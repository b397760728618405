//! Numbers of a run's own files that point nowhere: refused when the file is read, whoever wrote
//! them there.

use crate::failure::{Failure, Result};
use crate::stage::read_json;
use hingecast_geom::KinematicTree;
use serde::de::DeserializeOwned;
use std::path::Path;

/// What is wrong, in words that go on from "not what this program writes: ".
pub type Verdict = std::result::Result<(), String>;

/// Reads a file and holds it against `check`.
///
/// # Errors
/// When the file is missing, not ours, or `check` says so.
pub fn read_checked<T: DeserializeOwned>(path: &Path, check: impl FnOnce(&T) -> Verdict) -> Result<T> {
    let value: T = read_json(path)?;
    checked(path, check(&value))?;
    Ok(value)
}

/// A verdict about a file as three lines.
///
/// # Errors
/// What the verdict says.
pub fn checked(path: &Path, verdict: Verdict) -> Result<()> {
    verdict.map_err(|what| {
        let hint = "build again: the same command with --fresh";
        Failure::new(format!("not what this program writes: {what}"), path.display().to_string(), hint)
    })
}

/// There are parts, joints connect them, and every joint has a value for each state; answers how
/// many states that are, `None` without joints.
///
/// # Errors
/// What is wrong with it.
pub fn tree(tree: &KinematicTree) -> std::result::Result<Option<usize>, String> {
    if tree.parts.is_empty() {
        return Err("no parts".into());
    }
    tree.validate()?;
    let states = tree.joints.first().map(|j| j.values.len());
    for j in &tree.joints {
        if !j.limits.iter().all(|l| l.is_finite()) {
            return Err(format!("joint '{}' has a limit that is not finite", j.name));
        }
        if Some(j.values.len()) != states || j.values.is_empty() {
            let first = states.unwrap_or(0);
            return Err(format!("joint '{}' has {} values, the first joint {first}", j.name, j.values.len()));
        }
    }
    Ok(states)
}

/// The tree has a value for each of a recording's states.
///
/// # Errors
/// It has others.
pub fn states(of: &KinematicTree, n_states: usize) -> Verdict {
    match tree(of)? {
        Some(n) if n != n_states => Err(format!("its joints have values of {n} states, the recording has {n_states}")),
        _ => Ok(()),
    }
}

/// Every label is that of a part.
///
/// # Errors
/// One is not.
pub fn labels(labels: &[u8], n_parts: usize) -> Verdict {
    match labels.iter().position(|l| usize::from(*l) >= n_parts) {
        Some(at) => Err(format!("label {at} names part {} of {n_parts}", labels[at])),
        None => Ok(()),
    }
}

/// Two lists that go together are equally long.
///
/// # Errors
/// They are not.
pub fn as_many(what: &str, n: usize, as_what: &str, m: usize) -> Verdict {
    if n == m { Ok(()) } else { Err(format!("{n} {what} for {m} {as_what}")) }
}

/// Lengths of the object's box and the like.
///
/// # Errors
/// One is not finite.
pub fn finite(what: &str, values: &[f64]) -> Verdict {
    if values.iter().all(|v| v.is_finite()) { Ok(()) } else { Err(format!("{what} is not finite")) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DVec3;
    use hingecast_geom::{Joint, JointKind, Screw};

    fn lamp() -> KinematicTree {
        let screw = Screw { kind: JointKind::Revolute, axis: DVec3::X, pivot: DVec3::ZERO };
        let joint = |name: &str, parent, child| Joint {
            name: name.into(),
            parent,
            child,
            screw,
            values: vec![0.0, 0.5, 1.0],
            limits: [0.0, 1.0],
        };
        let parts = ["foot", "arm", "shade"].map(String::from).to_vec();
        KinematicTree { parts, joints: vec![joint("elbow", 0, 1), joint("neck", 1, 2)], ..Default::default() }
    }

    #[test]
    fn numbers_that_point_nowhere_are_refused() {
        assert_eq!(tree(&lamp()), Ok(Some(3)));
        let wrong = |change: &dyn Fn(&mut KinematicTree)| {
            let mut changed = lamp();
            change(&mut changed);
            tree(&changed).unwrap_err()
        };
        assert_eq!(wrong(&|t| t.parts.clear()), "no parts");
        assert!(wrong(&|t| t.joints[1].child = 3).contains("of 3"));
        assert!(wrong(&|t| t.joints[0].parent = 9).contains("elbow"));
        assert!(wrong(&|t| t.joints[1].values.truncate(2)).contains("'neck' has 2 values"));
        assert!(wrong(&|t| t.joints.iter_mut().for_each(|j| j.values.clear())).contains("0 values"));
        assert!(wrong(&|t| t.joints[1].limits[0] = f64::NAN).contains("limit"));
        assert!(states(&lamp(), 4).unwrap_err().contains("3 states, the recording has 4"));
        assert!(labels(&[0, 2, 3], 3).unwrap_err().contains("label 2 names part 3"));
        assert!(as_many("labels", 2, "gaussians", 3).is_err() && finite("box", &[0.0, f64::INFINITY]).is_err());
    }
}
