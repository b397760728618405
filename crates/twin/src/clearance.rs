//! Room between the collision shapes of different parts.
//!
//! Fused surfaces are half a voxel uncertain, and a lid that lies on its rim or a door in its frame
//! touches it: convex pieces of both would overlap and jam the joint. So the collision shape of a
//! part leaves out what comes within one voxel of a part nearer to the root in any recorded state.
//! The visual mesh keeps everything.

use crate::field::{Field, ONE_VOXEL};
use glam::Vec3;
use hingecast_geom::Pose;
use rayon::prelude::*;

/// The field of `part` without what comes within a voxel of the fields of `nearer` parts.
/// `poses[state][part]`: world from canonical.
pub fn trim(part: usize, fields: &[Option<Field>], nearer: &[usize], poses: &[Vec<Pose>]) -> Option<Field> {
    let own = fields[part].as_ref()?;
    let others: Vec<(&Field, Vec<(glam::Mat3, Vec3)>)> = nearer
        .iter()
        .filter_map(|&q| {
            let into = |at: &Vec<Pose>| {
                let pose = at[q].inverse() * at[part];
                (pose.mat3().as_mat3(), pose.trans.as_vec3())
            };
            Some((fields[q].as_ref()?, poses.iter().map(into).collect()))
        })
        .collect();
    let values = own.values.par_iter().enumerate().map(|(i, &value)| {
        if value >= 0.0 {
            return value;
        }
        let x = own.place(i);
        let touches = others.iter().any(|(field, into)| into.iter().any(|(r, t)| field.at(*r * x + *t) < ONE_VOXEL));
        if touches { 1.0 } else { value }
    });
    Some(Field { values: values.collect(), known: Vec::new(), firm: own.firm.clone(), ..*own })
}
