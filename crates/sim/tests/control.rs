//! The control law against its formulas written out with dense inverses.

use glam::{DMat3, DQuat, DVec3};
use hingecast_sim::control::{ArmState, Goal, N, TORQUE_LIMITS, torques};
use nalgebra::{DMatrix, DVector};

/// simulation.md's formulas, line by line, nothing shared with the crate.
fn plainly(arm: &ArmState, goal: &Goal, q0: &[f64; N]) -> DVector<f64> {
    let j = DMatrix::from_fn(6, N, |r, c| arm.jacobian[r][c]);
    let (jp, jo) = (j.rows(0, 3).into_owned(), j.rows(3, 3).into_owned());
    let m = DMatrix::from_fn(N, N, |r, c| arm.mass[r][c]);
    let m_inv = m.clone().try_inverse().unwrap();
    let qdot = DVector::from_row_slice(&arm.qdot);
    let inverse = |j: &DMatrix<f64>| (j * &m_inv * j.transpose()).try_inverse().unwrap();
    let v3 = |v: DVec3| DVector::from_row_slice(&v.to_array());
    let f = v3(goal.position - arm.position) * 150.0 - &jp * &qdot * (2.0 * 150f64.sqrt());
    let mut e = DVec3::ZERO;
    for c in 0..3 {
        e += 0.5 * arm.rotation.col(c).cross(goal.rotation.col(c));
    }
    let tau = v3(e) * 150.0 - &jo * &qdot * (2.0 * 150f64.sqrt());
    let jbar = &m_inv * j.transpose() * inverse(&j);
    let (fp, fo) = (inverse(&jp) * f, inverse(&jo) * tau);
    let wrench = DVector::from_fn(6, |r, _| if r < 3 { fp[r] } else { fo[r - 3] });
    let posture = DVector::from_fn(N, |k, _| 10.0 * (q0[k] - arm.q[k]) - 2.0 * 10f64.sqrt() * arm.qdot[k]);
    let null = (DMatrix::identity(N, N) - jbar * &j).transpose() * m * posture;
    let u = j.transpose() * wrench + DVector::from_row_slice(&arm.bias) + null;
    DVector::from_fn(N, |k, _| u[k].clamp(-TORQUE_LIMITS[k], TORQUE_LIMITS[k]))
}

#[test]
fn torques_agree_with_the_formulas_within_1e_9() {
    let mut rng = fastrand::Rng::with_seed(7);
    let mut worst = 0f64;
    let mut unclipped = 0;
    for _ in 0..200 {
        let mut r = |s: f64| s * (2.0 * rng.f64() - 1.0);
        let b: [[f64; N]; N] = std::array::from_fn(|_| std::array::from_fn(|_| r(0.6)));
        let mass = std::array::from_fn(|i| {
            std::array::from_fn(|k| (0..N).map(|l| b[i][l] * b[k][l]).sum::<f64>() + if i == k { 0.3 } else { 0.0 })
        });
        let rotation = |r: &mut dyn FnMut(f64) -> f64| {
            DMat3::from_quat(DQuat::from_xyzw(r(1.0), r(1.0), r(1.0), r(1.0) + 1e-3).normalize())
        };
        let arm = ArmState {
            q: std::array::from_fn(|_| r(2.0)),
            qdot: std::array::from_fn(|_| r(0.5)),
            mass,
            bias: std::array::from_fn(|_| r(10.0)),
            jacobian: std::array::from_fn(|_| std::array::from_fn(|_| r(0.8))),
            position: DVec3::new(r(0.5), r(0.5), r(0.5)),
            rotation: rotation(&mut r),
        };
        let near = arm.position + DVec3::new(r(0.05), r(0.05), r(0.05));
        let goal = Goal { position: near, rotation: rotation(&mut r) };
        let q0 = std::array::from_fn(|_| r(2.0));
        let (ours, plain) = (torques(&arm, &goal, &q0), plainly(&arm, &goal, &q0));
        for k in 0..N {
            worst = worst.max((ours[k] - plain[k]).abs());
            unclipped += usize::from(ours[k].abs() < TORQUE_LIMITS[k]);
        }
    }
    assert!(unclipped > 300, "only {unclipped} of 1400 torques are inside their limits: the comparison says little");
    assert!(worst < 1e-9, "{worst:e}");
}
