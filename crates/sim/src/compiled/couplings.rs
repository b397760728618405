//! Equality constraints: joints that follow others are kept, loops are refused.

use super::Reader;
use crate::SimError;
use hingecast_capture::object::ArticulatedObject;
use hingecast_geom::Coupling;
use mujoco_rs::prelude::*;
use std::collections::BTreeMap;

/// Coefficients of one in MuJoCo's `polycoef`.
const TERMS: usize = 5;

/// Joints of a model that follow others: follower and leader (MuJoCo's ids), polynomial as in
/// [`Coupling`].
pub(crate) fn followers(model: &MjModel) -> Vec<(usize, usize, [f64; TERMS])> {
    let active = (0..model.ffi().neq as usize).filter(|&e| model.eq_active0()[e]);
    active.filter(|&e| model.eq_type()[e] == MjtEq::mjEQ_JOINT).filter_map(|e| follower(model, e)).collect()
}

fn follower(model: &MjModel, e: usize) -> Option<(usize, usize, [f64; TERMS])> {
    let [follower, leader] = [model.eq_obj1id()[e], model.eq_obj2id()[e]].map(usize::try_from);
    let (follower, leader) = (follower.ok()?, leader.ok()?);
    let polynomial = std::array::from_fn(|k| model.eq_data()[e][k]);
    Some((follower, leader, absolute(polynomial, at_rest(model, follower), at_rest(model, leader))))
}

/// The joint's value in the reference configuration.
fn at_rest(model: &MjModel, joint: usize) -> f64 {
    model.qpos0()[model.jnt_qposadr()[joint] as usize]
}

impl Reader<'_> {
    /// `ids`: MuJoCo's joint -> the tree's. `part_of`: of every body.
    pub(super) fn couplings(
        &self,
        ids: &BTreeMap<usize, usize>,
        part_of: &[usize],
        object: &mut ArticulatedObject,
    ) -> Result<(), SimError> {
        let model = self.model;
        for e in (0..model.ffi().neq as usize).filter(|&e| model.eq_active0()[e]) {
            let ends = [model.eq_obj1id()[e], model.eq_obj2id()[e]].map(|id| usize::try_from(id).ok());
            let name = model.id_to_name(MjtObjBase::mjOBJ_EQUALITY, e).unwrap_or_default();
            match model.eq_type()[e] {
                MjtEq::mjEQ_JOINT => {
                    let Some(joint) = ends[0].and_then(|j| ids.get(&j)) else { continue };
                    if let Some((_, leader, polynomial)) = follower(model, e) {
                        let coupled = ids.get(&leader).map(|&leader| Coupling { follower: *joint, leader, polynomial });
                        object.tree.couplings.extend(coupled);
                    } else {
                        let held = at_rest(model, ends[0].unwrap_or(0)) + model.eq_data()[e][0];
                        object.tree.joints[*joint].limits = [held; 2];
                        let name = &object.tree.joints[*joint].name;
                        object.notes.push(format!("joint '{name}' is held at {held:.4} by an equality"));
                    }
                }
                MjtEq::mjEQ_CONNECT | MjtEq::mjEQ_WELD => {
                    let bodies = self.bodies_of(e, ends);
                    let parts = bodies.map(|b| part_of[b]);
                    if bodies.iter().any(|&b| model.body_mocapid()[b] >= 0) {
                        object
                            .notes
                            .push(format!("the equality '{name}' to a mocap body is left out: a handle to drag by"));
                    } else if parts[0] != parts[1] {
                        let what = format!("the equality '{name}' closes a loop of joints");
                        return Err(self.refuse(what, "a twin is a tree of joints: take the equality out"));
                    }
                }
                _ => {
                    let what = format!("the equality '{name}' is neither joint, connect nor weld");
                    return Err(self.refuse(what, "a twin knows joints that follow one other joint alone"));
                }
            }
        }
        Ok(())
    }

    /// The two bodies that a connect or weld holds together, by themselves or by sites of theirs.
    fn bodies_of(&self, e: usize, ends: [Option<usize>; 2]) -> [usize; 2] {
        let sites = self.model.eq_objtype()[e] == MjtObjBase::mjOBJ_SITE;
        ends.map(|end| {
            let id = end.unwrap_or(0);
            if sites { self.model.site_bodyid()[id] as usize } else { id }
        })
    }
}

/// MuJoCo counts from the reference: y - y0 = sum of a_k (x - x0)^k. As a polynomial in x, y itself:
/// (x - x0)^k by the binomial theorem.
fn absolute(a: [f64; TERMS], y0: f64, x0: f64) -> [f64; TERMS] {
    let mut out = [0.0; TERMS];
    out[0] = y0;
    // Coefficients of (x - x0)^k.
    let mut power = [0.0; TERMS];
    power[0] = 1.0;
    for factor in a {
        for k in 0..TERMS {
            out[k] += factor * power[k];
        }
        for k in (0..TERMS).rev() {
            power[k] = if k > 0 { power[k - 1] } else { 0.0 } - x0 * power[k];
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_polynomial_about_a_reference_is_one_about_zero() {
        let (a, y0, x0) = ([0.3, -1.2, 0.5, 0.25, -0.125], 0.7, -0.4);
        let coupling = Coupling { follower: 0, leader: 1, polynomial: absolute(a, y0, x0) };
        for x in [-1.0, -0.4, 0.0, 0.9f64] {
            let direct = y0 + (0..TERMS).map(|k| a[k] * (x - x0).powi(k as i32)).sum::<f64>();
            assert!((coupling.value(x) - direct).abs() < 1e-12, "{x}");
        }
    }
}
