//! Joints and states' frames by the pictures: what the gaussians, put where the tree says, should look like in every view, against
//! what it shows; together with what the depth says about the same poses.
//!
//! Cost in nats: that of the pictures (`pictures`), plus half the squared twist that takes every part from where the depth has it, by
//! [`Information`].
//!
//! Unknowns: axes, pivots and values of all joints; the values of the first state too, since the gaussians stand where all states together
//! put them and not quite where the first had them; and the frame of every state, which is eliminated (Schur).

use super::Information;
use super::pictures::ByPart;
use super::refine::{Slot, slots, update};
use super::settle::tidy;
use super::twist::{Twist, twists};
use glam::DVec3;
use hingecast_geom::pose::{quat_from_rotation_vector, rotation_vector};
use hingecast_geom::{KinematicTree, Pose, Progress};
use hingecast_splat::{Engine, Gradients, SplatError, Target};
use nalgebra::{DMatrix, DVector, Matrix6, Vector6};
use std::sync::Arc;

/// A picture and the state that it shows.
#[derive(Clone, Debug)]
pub struct Shot {
    pub target: Arc<Target>,
    pub state: usize,
}

/// What the pictures made of it.
#[derive(Clone, Debug)]
pub struct Refined {
    pub tree: KinematicTree,
    /// Where the parts of the gaussians really stand in the first state.
    pub first: Vec<Pose>,
    /// Per state: what its cameras take for the world, from the world.
    pub rig: Vec<Pose>,
    /// Nats before and after.
    pub cost: [f64; 2],
}

/// Damping of the first try, share of the diagonal.
const DAMPING: f64 = 1e-3;
/// Steps, and the nats below which a further one is not worth a look at all pictures.
const ROUNDS: usize = 12;
const SETTLED: f64 = 0.5;

/// Everything that does not change from step to step.
struct Problem<'a> {
    shots: &'a [Shot],
    /// As the depth has it, with its information. [state][part]
    depth: Vec<Vec<Pose>>,
    information: Vec<Vec<Matrix6<f64>>>,
    slots: Vec<Option<Slot>>,
    /// Index of the first joint's value in the first state; the others' follow.
    zeros: usize,
    /// Nats per unit of the pictures' cost.
    weight: f64,
}

/// An answer.
#[derive(Clone)]
struct Guess {
    tree: KinematicTree,
    rig: Vec<Pose>,
}

/// Normal equations of the joints, and of every state's frame.
struct Sums {
    a: DMatrix<f64>,
    b: DVector<f64>,
    cost: f64,
    frames: Vec<Frame>,
}

/// Gradient and Hessian by a twist of a state's frame, and how the joints change the gradient.
struct Frame {
    gradient: Vector6<f64>,
    hessian: Matrix6<f64>,
    by_joints: DMatrix<f64>,
}

/// Moves the joints of `tree` and the states' frames so that the engine's gaussians (group = part) look like the pictures, as far as the
/// depth lets them. `information`: [state][part].
///
/// # Errors
/// Those of the engine; the wish to stop.
pub fn refine(
    engine: &mut Engine,
    shots: &[Shot],
    tree: &KinematicTree,
    information: &[Vec<Information>],
    progress: &Progress,
) -> Result<Refined, SplatError> {
    let n_states = information.len();
    let mut guess = Guess { tree: tree.clone(), rig: vec![Pose::IDENTITY; n_states] };
    if tree.joints.is_empty() {
        return Ok(Refined { first: tree.poses(&[]), tree: guess.tree, rig: guess.rig, cost: [0.0; 2] });
    }
    let (slots, zeros) = slots(tree, &vec![true; tree.joints.len()], n_states);
    let mut problem = Problem {
        shots,
        depth: (0..n_states).map(|s| tree.poses_at(s)).collect(),
        information: information.iter().map(|s| s.iter().map(Information::matrix).collect()).collect(),
        slots,
        zeros,
        weight: 1.0,
    };
    let first = problem.look(engine, &guess)?;
    let (cost, filled) = first.iter().fold((0.0, 0), |(c, f), s| (c + s.cost, f + s.filled));
    // As log-likelihood: the variance of a channel is cost / (3 filled).
    problem.weight = 3.0 * filled as f64 / (2.0 * cost.max(1e-12));
    let mut sums = problem.sums(&guess, &first);
    let before = sums.cost;
    let mut damping = DAMPING;
    for round in 0..ROUNDS {
        progress.report(round, ROUNDS, &format!("joints by the pictures, {:.0} nats", before - sums.cost))?;
        let Some((next, seen)) = problem.step(engine, &guess, &sums, damping)? else { break };
        let tried = problem.sums(&next, &seen);
        if tried.cost >= sums.cost {
            damping *= 10.0;
            continue;
        }
        let gain = sums.cost - tried.cost;
        (guess, sums, damping) = (next, tried, (damping * 0.1).max(1e-4));
        if gain < SETTLED {
            break;
        }
    }
    let first = guess.tree.poses_at(0);
    tidy(&mut guess.tree);
    Ok(Refined { tree: guess.tree, first, rig: guess.rig, cost: [before, sums.cost] })
}

impl Problem<'_> {
    fn size(&self) -> usize {
        self.zeros + self.slots.len()
    }

    /// What all pictures say about a guess, per state.
    fn look(&self, engine: &mut Engine, guess: &Guess) -> Result<Vec<ByPart>, SplatError> {
        let n_parts = guess.tree.parts.len();
        let mut out: Vec<ByPart> = guess.rig.iter().map(|_| ByPart::new(n_parts)).collect();
        let mut gradients = Gradients::default();
        for shot in self.shots {
            let rig = guess.rig[shot.state];
            let poses: Vec<Pose> = guess.tree.poses_at(shot.state).iter().map(|p| rig * *p).collect();
            engine.set_poses(&poses)?;
            out[shot.state].add_view(engine, &shot.target, &mut gradients)?;
        }
        Ok(out)
    }

    /// Normal equations of pictures and depth together.
    fn sums(&self, guess: &Guess, seen: &[ByPart]) -> Sums {
        let size = self.size();
        let mut out = Sums { a: DMatrix::zeros(size, size), b: DVector::zeros(size), cost: 0.0, frames: Vec::new() };
        let zero = guess.tree.poses_at(0);
        let at_zero: Vec<_> = (0..zero.len()).map(|part| self.columns(&guess.tree, 0, part, &zero)).collect();
        for (state, seen) in seen.iter().enumerate() {
            out.cost += self.weight * seen.cost;
            let poses = guess.tree.poses_at(state);
            let mut hessian = Matrix6::zeros();
            let mut gradient = Vector6::zeros();
            let mut by_joints = DMatrix::zeros(6, size);
            for part in 0..poses.len() {
                let here = self.columns(&guess.tree, state, part, &poses);
                let here: Vec<_> = here.into_iter().map(|(i, t)| (i, t.moved(&guess.rig[state]).vector())).collect();
                let mut add = |g: &Vector6<f64>, h: &Matrix6<f64>, columns: &[(usize, Vector6<f64>)]| {
                    hessian += h;
                    gradient += g;
                    for (i, ci) in columns {
                        out.b[*i] -= ci.dot(g);
                        let hc = h * ci;
                        for (k, ck) in columns {
                            out.a[(*i, *k)] += ck.dot(&hc);
                        }
                        for (row, value) in hc.iter().enumerate() {
                            by_joints[(row, *i)] += value;
                        }
                    }
                };
                add(&(seen.gradient[part] * self.weight), &(seen.hessian[part] * self.weight), &here);
                // The depth knows how a part went from the first state to this one.
                let moved = guess.rig[state] * poses[part] * zero[part].inverse();
                let off = log(&(moved * self.depth[state][part].inverse()));
                let h = &self.information[state][part];
                let since = at_zero[part].iter().map(|(i, t)| (*i, -t.moved(&moved).vector()));
                let columns: Vec<_> = here.into_iter().chain(since).collect();
                out.cost += 0.5 * off.dot(&(h * off));
                add(&(h * off), h, &columns);
            }
            out.frames.push(Frame { gradient, hessian, by_joints });
        }
        out
    }

    /// The unknowns that move a part in a state, each with the twist that it causes before the state's frame moves it on.
    fn columns(&self, tree: &KinematicTree, state: usize, part: usize, poses: &[Pose]) -> Vec<(usize, Twist)> {
        let mut out = Vec::new();
        for j in tree.ancestry(part) {
            let Some(slot) = self.slots[j] else { continue };
            let twists = twists(tree, j, state, poses);
            let value = if state > 0 { slot.values + state - 1 } else { self.zeros + j };
            out.extend(twists[..slot.n_shape].iter().enumerate().map(|(k, t)| (slot.shape + k, *t)));
            out.push((value, twists[4]));
        }
        out
    }

    /// The guess that the sums ask for, and what the pictures say about it.
    fn step(
        &self,
        engine: &mut Engine,
        guess: &Guess,
        sums: &Sums,
        damping: f64,
    ) -> Result<Option<(Guess, Vec<ByPart>)>, SplatError> {
        let (mut a, mut b) = (sums.a.clone(), sums.b.clone());
        let scale = a.diagonal().max().max(1e-300);
        for i in 0..self.size() {
            a[(i, i)] += damping * a[(i, i)] + 1e-12 * scale;
        }
        let mut inverses = Vec::new();
        for frame in &sums.frames {
            let mut h = frame.hessian;
            for i in 0..6 {
                h[(i, i)] += damping * h[(i, i)] + 1e-12 * scale;
            }
            let inverse = h.try_inverse().unwrap_or_default();
            let solved = inverse * &frame.by_joints;
            b += solved.transpose() * frame.gradient;
            a -= frame.by_joints.transpose() * solved;
            inverses.push(inverse);
        }
        let Some(solved) = a.cholesky() else { return Ok(None) };
        let by = solved.solve(&b);
        let mut next = guess.clone();
        update(&mut next.tree, &self.slots, &by);
        for (j, joint) in next.tree.joints.iter_mut().enumerate() {
            joint.values[0] += by[self.zeros + j];
        }
        for ((rig, frame), inverse) in next.rig.iter_mut().zip(&sums.frames).zip(inverses) {
            let xi = -(inverse * (frame.gradient + &frame.by_joints * &by));
            *rig = exp(&xi) * *rig;
        }
        let seen = self.look(engine, &next)?;
        Ok(Some((next, seen)))
    }
}

/// The twist (v, w) of a small motion, to first order.
fn log(pose: &Pose) -> Vector6<f64> {
    let (v, w) = (pose.trans, rotation_vector(pose.rot));
    Vector6::new(v.x, v.y, v.z, w.x, w.y, w.z)
}

/// The motion of a small twist; turns are cut at a tenth of a radian.
fn exp(xi: &Vector6<f64>) -> Pose {
    let turn = DVec3::new(xi[3], xi[4], xi[5]).clamp_length_max(0.1);
    Pose::new(quat_from_rotation_vector(turn), DVec3::new(xi[0], xi[1], xi[2]))
}

#[cfg(test)]
mod tests {
    use super::*;
    use hingecast_geom::{Camera, Gaussians, Joint, JointKind, Screw};
    use hingecast_splat::{Pixels, RenderOptions, TargetImages};

    /// A lid on a base, three states.
    fn tree(tilt: f64, shift: f64, values: [f64; 3]) -> KinematicTree {
        let axis = DVec3::new(tilt, 0.2, 1.0).normalize();
        let screw = Screw { kind: JointKind::Revolute, axis, pivot: DVec3::new(0.3 + shift, 0.1, 0.0) };
        let limits = [0.0, 1.0];
        let joint = Joint { name: "joint_1".into(), parent: 0, child: 1, screw, values: values.to_vec(), limits };
        KinematicTree { parts: vec!["base".into(), "part_1".into()], joints: vec![joint] }
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

    /// Pictures of the true object; those of the second state by cameras that take the world to be at `rig`.
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
        let guess = Guess { tree: start, rig: vec![Pose::IDENTITY; 3] };
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
                update(&mut moved.tree, &problem.slots, &by);
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
                    moved.rig[state] = exp(&xi) * moved.rig[state];
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

    /// Depth that is wrong and knows little: the pictures find the joint, its values and the frame that is off.
    #[test]
    fn pictures_find_a_joint_and_a_frame() {
        let mut engine = engine(600, 4.0);
        let shots = shots(&mut engine, &rig());
        let wrong = tree(0.12, 0.01, [0.0, 0.315, 0.68]);
        let refined = refine(&mut engine, &shots, &wrong, &known(1.0), &Progress::default()).unwrap();
        let (found, truth) = (&refined.tree.joints[0], &tree(0.1, 0.0, TRUE_VALUES).joints[0]);
        let axis = |j: &Joint| j.screw.axis.angle_between(truth.screw.axis);
        assert!(axis(found) < 0.2 * axis(&wrong.joints[0]), "axis {} rad off", axis(found));
        assert!(found.screw.distance(truth.screw.pivot) < 0.004, "{:?}", found.screw);
        for (a, b) in found.values.iter().zip(TRUE_VALUES) {
            assert!((a - b).abs() < 0.006, "{:?}", found.values);
        }
        let left = refined.rig[1] * rig().inverse();
        assert!(left.trans.length() < 0.003 && left.angle() < 0.003, "{left:?}");
        assert!(refined.cost[1] < refined.cost[0]);
    }

    #[test]
    fn nothing_moves_where_there_is_no_joint() {
        let mut engine = engine(600, 4.0);
        let shots = shots(&mut engine, &rig());
        let still = KinematicTree { parts: vec!["base".into(), "part_1".into()], joints: Vec::new() };
        let refined = refine(&mut engine, &shots, &still, &known(1.0), &Progress::default()).unwrap();
        assert!(refined.tree == still && refined.rig == [Pose::IDENTITY; 3]);
    }

    /// Depth that is sure keeps the last word, wrong or not.
    #[test]
    fn sure_depth_stays() {
        let mut engine = engine(600, 4.0);
        let shots = shots(&mut engine, &Pose::IDENTITY);
        let wrong = tree(0.13, 0.02, [0.0, 0.33, 0.66]);
        let refined = refine(&mut engine, &shots, &wrong, &known(1e12), &Progress::default()).unwrap();
        let moved = refined.tree.joints[0].screw.axis.angle_between(wrong.joints[0].screw.axis);
        assert!(moved < 1e-3, "{moved}");
    }
}
