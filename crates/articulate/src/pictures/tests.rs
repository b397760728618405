//! Gradients against central differences, and what pictures and depth do together.

use super::information::Information;
use super::levenberg::refine_by_pictures;
use super::problem::{Guess, Problem, Shot, exp};
use crate::fit::unknowns::{slots, update};
use glam::DVec3;
use hingecast_geom::{Camera, Gaussians, Joint, JointKind, KinematicTree, Pose, Progress, Screw};
use hingecast_splat::{Engine, Pixels, RenderOptions, Target, TargetImages};
use nalgebra::{DVector, Matrix6, Vector6};
use std::sync::Arc;

/// A lid on a base, three states.
fn tree(tilt: f64, shift: f64, values: [f64; 3]) -> KinematicTree {
    let axis = DVec3::new(tilt, 0.2, 1.0).normalize();
    let screw = Screw { kind: JointKind::Revolute, axis, pivot: DVec3::new(0.3 + shift, 0.1, 0.0) };
    let limits = [0.0, 1.0];
    let joint = Joint { name: "joint_1".into(), parent: 0, child: 1, screw, values: values.to_vec(), limits };
    KinematicTree { parts: vec!["base".into(), "part_1".into()], joints: vec![joint], ..Default::default() }
}

const TRUE_VALUES: [f64; 3] = [0.0, 0.3, 0.7];

fn engine(n: usize, opacity: f32) -> Engine {
    let mut rng = fastrand::Rng::with_seed(5);
    let mut f = |lo: f32, hi: f32| lo + (hi - lo) * rng.f32();
    let mut g = Gaussians::default();
    for i in 0..n {
        let x = if i < n / 2 { f(-0.4, -0.05) } else { f(0.05, 0.4) };
        g.means.push([x, f(-0.3, 0.3), f(-0.3, 0.3)]);
        g.quats.push([1.0, 0.0, 0.0, 0.0]);
        g.scales.push([f(0.03, 0.06).ln(), f(0.03, 0.06).ln(), f(0.03, 0.06).ln()]);
        g.opacities.push(opacity);
        g.sh0.push([f(-1.0, 1.5), f(-1.0, 1.5), f(-1.0, 1.5)]);
    }
    let groups: Vec<u16> = (0..n).map(|i| u16::from(i >= n / 2)).collect();
    let mut engine = Engine::from_gaussians(&g, 1).unwrap();
    engine.set_groups(&groups, &[Pose::IDENTITY; 2]).unwrap();
    engine
}

/// Pictures of the true object; those of the second state by cameras that take the world to be at
/// `rig`.
fn shots(engine: &mut Engine, rig: &Pose) -> Vec<Shot> {
    let truth = tree(0.1, 0.0, TRUE_VALUES);
    let mut out = Vec::new();
    for (state, k) in (0..3).flat_map(|s| (0..4).map(move |k| (s, k))) {
        let turn = (k as f64 + 0.3 * state as f64) * 1.7;
        let eye = DVec3::new(1.6 * turn.cos(), 1.6 * turn.sin(), 0.7);
        let camera = Camera::look_at(eye, DVec3::ZERO, DVec3::Z, 112, 96, 0.8);
        let moved = |p: &Pose| if state == 1 { *rig * *p } else { *p };
        engine.set_poses(&truth.poses_at(state).iter().map(moved).collect::<Vec<_>>()).unwrap();
        let rgb = engine.render(&camera, &RenderOptions::default()).unwrap().rgb;
        let images = TargetImages {
            rgb: Pixels::F32(&rgb),
            depth: None,
            mask: None,
            weight: None,
            background: [0.0; 3],
            shows_background: true,
        };
        out.push(Shot { target: Arc::new(Target::new(&camera, &images).unwrap()), state });
    }
    out
}

/// The same for every part and state.
fn known(nats: f64) -> Vec<Vec<Information>> {
    let m = Matrix6::identity() * nats;
    vec![vec![Information::new(&m); 2]; 3]
}

fn rig() -> Pose {
    exp(&Vector6::new(0.01, -0.006, 0.004, 0.01, 0.005, -0.008))
}

/// The gradient by every unknown and every frame against central differences of the cost.
#[test]
fn gradients_agree_with_central_differences() {
    let mut engine = engine(160, 1.5);
    let shots = shots(&mut engine, &rig());
    let start = tree(0.12, 0.01, [0.01, 0.29, 0.72]);
    let information = known(300.0);
    let (slots, zeros) = slots(&start, &[true], 3);
    let depth = tree(0.1, 0.02, [0.0, 0.31, 0.7]);
    let problem = Problem {
        shots: &shots,
        depth: (0..3).map(|s| depth.poses_at(s)).collect(),
        information: information.iter().map(|s| s.iter().map(Information::matrix).collect()).collect(),
        slots,
        zeros,
        weight: 1.0,
    };
    let guess = Guess { tree: start, state_from_world: vec![Pose::IDENTITY; 3] };
    let seen = problem.look(&mut engine, &guess).unwrap();
    let sums = problem.sums(&guess, &seen);
    let mut cost = |guess: &Guess| {
        let seen = problem.look(&mut engine, guess).unwrap();
        problem.sums(guess, &seen).cost
    };
    // Gaussians that change their order in depth make steps: one of the distances is free of them.
    let central = |at: &mut dyn FnMut(f64) -> f64| [2e-3, 1e-3, 3e-4].map(|h| (at(h) - at(-h)) / (2.0 * h));
    let gradient = -sums.b.clone();
    let mut pairs = Vec::new();
    for k in 0..problem.size() {
        let mut at = |step: f64| {
            let mut moved = guess.clone();
            let mut by = DVector::zeros(problem.size());
            by[k] = step;
            update(&mut moved.tree, &problem.slots, &by, 1.0);
            moved.tree.joints[0].values[0] += by[problem.zeros];
            cost(&moved)
        };
        pairs.push((gradient[k], central(&mut at)));
    }
    for (state, frame) in sums.frames.iter().enumerate() {
        for k in 0..6 {
            let mut at = |step: f64| {
                let mut moved = guess.clone();
                let mut xi = Vector6::zeros();
                xi[k] = step;
                moved.state_from_world[state] = exp(&xi) * moved.state_from_world[state];
                cost(&moved)
            };
            pairs.push((frame.gradient[k], central(&mut at)));
        }
    }
    let largest = pairs.iter().map(|p| p.0.abs()).fold(0.0, f64::max);
    for (k, (analytic, numeric)) in pairs.iter().enumerate() {
        let close = |d: &f64| (analytic - d).abs() < 0.01 * largest + 0.03 * analytic.abs();
        assert!(numeric.iter().any(close), "unknown {k}: {analytic} against {numeric:?}");
    }
}

/// Depth that is wrong and knows little: the pictures find the joint, its values and the frame that
/// is off.
#[test]
fn pictures_find_a_joint_and_a_frame() {
    let mut engine = engine(600, 4.0);
    let shots = shots(&mut engine, &rig());
    let wrong = tree(0.12, 0.01, [0.0, 0.315, 0.68]);
    let refined = refine_by_pictures(&mut engine, &shots, &wrong, &known(1.0), &Progress::default()).unwrap();
    let (found, truth) = (&refined.tree.joints[0], &tree(0.1, 0.0, TRUE_VALUES).joints[0]);
    let axis = |j: &Joint| j.screw.axis.angle_between(truth.screw.axis);
    assert!(axis(found) < 0.2 * axis(&wrong.joints[0]), "axis {} rad off", axis(found));
    assert!(found.screw.distance(truth.screw.pivot) < 0.004, "{:?}", found.screw);
    for (a, b) in found.values.iter().zip(TRUE_VALUES) {
        assert!((a - b).abs() < 0.006, "{:?}", found.values);
    }
    let left = refined.state_from_world[1] * rig().inverse();
    assert!(left.trans.length() < 0.003 && left.angle() < 0.003, "{left:?}");
    assert!(refined.cost[1] < refined.cost[0]);
}

#[test]
fn nothing_moves_where_there_is_no_joint() {
    let mut engine = engine(600, 4.0);
    let shots = shots(&mut engine, &rig());
    let still = KinematicTree { parts: vec!["base".into(), "part_1".into()], ..Default::default() };
    let refined = refine_by_pictures(&mut engine, &shots, &still, &known(1.0), &Progress::default()).unwrap();
    assert!(refined.tree == still && refined.state_from_world == [Pose::IDENTITY; 3]);
}

/// Depth that is sure keeps the last word, wrong or not.
#[test]
fn sure_depth_stays() {
    let mut engine = engine(600, 4.0);
    let shots = shots(&mut engine, &Pose::IDENTITY);
    let wrong = tree(0.13, 0.02, [0.0, 0.33, 0.66]);
    let refined = refine_by_pictures(&mut engine, &shots, &wrong, &known(1e12), &Progress::default()).unwrap();
    let moved = refined.tree.joints[0].screw.axis.angle_between(wrong.joints[0].screw.axis);
    assert!(moved < 1e-3, "{moved}");
}
