//! Operational-space control of the arm: from a wanted pose of the grip site to joint torques,
//! every 2 ms.
//!
//! O. Khatib, "A unified approach for motion and force control of robot manipulators", 1987, in the
//! form of robosuite's OSC_POSE (uncoupled position and orientation, null space towards the
//! starting posture):
//!
//! ```text
//! F   = kp (x* - x) - kd v          kp = 150 1/s^2, kd = 2 sqrt(kp)
//! tau = kp e - kd w                 e = 1/2 sum_c R[:,c] x R*[:,c]
//! Lp  = (Jp M^-1 Jp')^-1, Lo = (Jo M^-1 Jo')^-1, L = (J M^-1 J')^-1, Jbar = M^-1 J' L
//! u   = clip(J' [Lp F; Lo tau] + bias + (I - Jbar J)' M (kn (q0 - q) - 2 sqrt(kn) qdot)),   kn = 10
//! ```
//! World frame, metres, radians; J = [Jp; Jo] is 6 x 7. `tests/control.rs` compares with the
//! formulas written out in full.

use glam::{DMat3, DVec3};

/// Joints of the arm.
pub const N: usize = 7;
/// Gains, 1/s^2: robosuite's defaults, critically damped.
const KP: f64 = 150.0;
const KN: f64 = 10.0;
/// The largest torque of each joint, N m.
pub const TORQUE_LIMITS: [f64; N] = [80.0, 80.0, 80.0, 80.0, 80.0, 12.0, 12.0];

/// What the simulator says about the arm at one instant.
#[derive(Clone, Debug)]
pub struct ArmState {
    /// Joint angles, rad.
    pub q: [f64; N],
    /// Joint speeds, rad/s.
    pub qdot: [f64; N],
    /// Joint-space inertia, row-major 7 x 7.
    pub mass: [[f64; N]; N],
    /// Gravity, Coriolis and centrifugal torques.
    pub bias: [f64; N],
    /// Rows 0..3 linear, 3..6 angular velocity of the grip site.
    pub jacobian: [[f64; N]; 6],
    /// Of the grip site, world frame, m.
    pub position: DVec3,
    /// `world_from_grip`.
    pub rotation: DMat3,
}

/// Where the grip site shall go.
#[derive(Clone, Copy, Debug)]
pub struct Goal {
    /// World frame, m.
    pub position: DVec3,
    /// `world_from_grip`.
    pub rotation: DMat3,
}

/// Torques that pull the grip site towards `goal` and the posture towards `posture`.
pub fn torques(arm: &ArmState, goal: &Goal, posture: &[f64; N]) -> [f64; N] {
    let kd = 2.0 * KP.sqrt();
    let velocity: [f64; 6] = std::array::from_fn(|r| dot(&arm.jacobian[r], &arm.qdot));
    let e = 0.5
        * (arm.rotation.x_axis.cross(goal.rotation.x_axis)
            + arm.rotation.y_axis.cross(goal.rotation.y_axis)
            + arm.rotation.z_axis.cross(goal.rotation.z_axis));
    let error = [goal.position - arm.position, e].map(|v| v.to_array()).concat();
    let acceleration: [f64; 6] = std::array::from_fn(|r| KP * error[r] - kd * velocity[r]);

    // Inverse task inertia A = J M^-1 J', once for all three of its uses. X = M^-1 J' is kept: Jbar
    // = X L.
    let factor = Cholesky::<N>::new(&arm.mass);
    let x: [[f64; N]; 6] = std::array::from_fn(|r| factor.solve(&arm.jacobian[r]));
    let a: [[f64; 6]; 6] = std::array::from_fn(|r| std::array::from_fn(|c| dot(&arm.jacobian[r], &x[c])));
    let block = |o: usize| -> [[f64; 3]; 3] { std::array::from_fn(|r| std::array::from_fn(|c| a[o + r][o + c])) };
    let linear = Cholesky::<3>::new(&block(0)).solve(&[acceleration[0], acceleration[1], acceleration[2]]);
    let angular = Cholesky::<3>::new(&block(3)).solve(&[acceleration[3], acceleration[4], acceleration[5]]);
    let wrench = [linear, angular].concat();

    // (I - Jbar J)' t = t - J' L X' t with t = M p.
    let kn = 2.0 * KN.sqrt();
    let p: [f64; N] = std::array::from_fn(|j| KN * (posture[j] - arm.q[j]) - kn * arm.qdot[j]);
    let t: [f64; N] = std::array::from_fn(|j| dot(&arm.mass[j], &p));
    let projected: [f64; 6] = std::array::from_fn(|r| dot(&x[r], &t));
    let taken = Cholesky::<6>::new(&a).solve(&projected);

    std::array::from_fn(|j| {
        let task: f64 = (0..6).map(|r| arm.jacobian[r][j] * (wrench[r] - taken[r])).sum();
        (task + arm.bias[j] + t[j]).clamp(-TORQUE_LIMITS[j], TORQUE_LIMITS[j])
    })
}

fn dot<const K: usize>(a: &[f64; K], b: &[f64; K]) -> f64 {
    let mut sum = 0.0;
    for k in 0..K {
        sum += a[k] * b[k];
    }
    sum
}

/// A = G G' of a symmetric positive definite matrix.
struct Cholesky<const K: usize> {
    g: [[f64; K]; K],
}

impl<const K: usize> Cholesky<K> {
    fn new(a: &[[f64; K]; K]) -> Self {
        let mut g = [[0.0; K]; K];
        for r in 0..K {
            for c in 0..=r {
                let mut sum = a[r][c];
                for k in 0..c {
                    sum -= g[r][k] * g[c][k];
                }
                // At a singular posture (a stretched arm) a pivot goes to 0: the floor bounds the
                // force there.
                g[r][c] = if r == c { sum.max(1e-12).sqrt() } else { sum / g[c][c] };
            }
        }
        Self { g }
    }

    fn solve(&self, b: &[f64; K]) -> [f64; K] {
        let mut y = *b;
        for r in 0..K {
            for k in 0..r {
                y[r] -= self.g[r][k] * y[k];
            }
            y[r] /= self.g[r][r];
        }
        for r in (0..K).rev() {
            for k in r + 1..K {
                y[r] -= self.g[k][r] * y[k];
            }
            y[r] /= self.g[r][r];
        }
        y
    }
}
