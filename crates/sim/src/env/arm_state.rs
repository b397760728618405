//! The arm as the controller wants it.

use crate::control::ArmState;
use crate::object::matrix;
use crate::scene::Scene;
use glam::DVec3;
use mujoco_rs::prelude::*;
use std::sync::Arc;

/// Joints, mass matrix, bias forces and the grip's Jacobian at this moment.
pub(super) fn arm_state(data: &MjData<Arc<MjModel>>, scene: &Scene) -> ArmState {
    let ids = &scene.ids;
    let nv = data.qvel().len();
    let (jp, jr) = data.jac_site(true, true, ids.grip);
    let mut full = vec![0.0; nv * nv];
    data.full_m(&mut full).expect("the buffer has nv * nv numbers");
    ArmState {
        q: ids.arm_qpos.map(|a| data.qpos()[a]),
        qdot: ids.arm_dof.map(|d| data.qvel()[d]),
        mass: ids.arm_dof.map(|r| ids.arm_dof.map(|c| full[r * nv + c])),
        bias: ids.arm_dof.map(|d| data.qfrc_bias()[d]),
        jacobian: std::array::from_fn(|r| {
            let rows = if r < 3 { &jp[r * nv..] } else { &jr[(r - 3) * nv..] };
            ids.arm_dof.map(|d| rows[d])
        }),
        position: DVec3::from(data.site_xpos()[ids.grip]),
        rotation: matrix(&data.site_xmat()[ids.grip]),
    }
}
