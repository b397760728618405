//! Joints and states' frames by the pictures: what the gaussians, put where the tree says, should
//! look like in every view, against what it shows; together with what the depth says about the same
//! poses.
//!
//! Cost in nats: that of the pictures (`pictures`), plus half the squared twist that takes every
//! part from where the depth has it, by [`Information`](super::information::Information).
//!
//! Unknowns: axes, pivots and values of all joints; the values of the first state too, since the
//! gaussians stand where all states together put them and not quite where the first had them; and
//! the frame of every state, which is eliminated (Schur).

use super::gradient::ByPart;
use crate::fit::unknowns::{LONGEST_TURN, Slot, update};
use crate::model::twist::{Twist, twists};
use glam::DVec3;
use hingecast_geom::pose::{quat_from_rotation_vector, rotation_vector};
use hingecast_geom::{Joint, KinematicTree, Pose};
use hingecast_splat::{Engine, Gradients, SplatError, Target};
use nalgebra::{DMatrix, DVector, Matrix6, Vector6};
use std::sync::Arc;

/// A picture and the state that it shows.
#[derive(Clone, Debug)]
pub struct Shot {
    /// The picture.
    pub target: Arc<Target>,
    /// Index of the state.
    pub state: usize,
}

/// Everything that does not change from step to step.
pub(super) struct Problem<'a> {
    pub(super) shots: &'a [Shot],
    /// As the depth has it, with its information. `[state][part]`
    pub(super) depth: Vec<Vec<Pose>>,
    pub(super) information: Vec<Vec<Matrix6<f64>>>,
    pub(super) slots: Vec<Option<Slot>>,
    /// Index of the first joint's value in the first state; the others' follow.
    pub(super) zeros: usize,
    /// Nats per unit of the pictures' cost.
    pub(super) weight: f64,
}

/// An answer.
#[derive(Clone)]
pub(super) struct Guess {
    pub(super) tree: KinematicTree,
    pub(super) state_from_world: Vec<Pose>,
}

/// Normal equations of the joints, and of every state's frame.
pub(super) struct Sums {
    pub(super) a: DMatrix<f64>,
    pub(super) b: DVector<f64>,
    pub(super) cost: f64,
    pub(super) frames: Vec<Frame>,
}

/// Gradient and Hessian by a twist of a state's frame, and how the joints change the gradient.
pub(super) struct Frame {
    pub(super) gradient: Vector6<f64>,
    pub(super) hessian: Matrix6<f64>,
    pub(super) by_joints: DMatrix<f64>,
}

impl Problem<'_> {
    pub(super) fn size(&self) -> usize {
        self.zeros + self.slots.len()
    }

    /// What all pictures say about a guess, per state.
    pub(super) fn look(&self, engine: &mut Engine, guess: &Guess) -> Result<Vec<ByPart>, SplatError> {
        let n_parts = guess.tree.parts.len();
        let mut out: Vec<ByPart> = guess.state_from_world.iter().map(|_| ByPart::new(n_parts)).collect();
        let mut gradients = Gradients::default();
        for shot in self.shots {
            let state_from_world = guess.state_from_world[shot.state];
            let poses: Vec<Pose> = guess.tree.poses_at(shot.state).iter().map(|p| state_from_world * *p).collect();
            engine.set_poses(&poses)?;
            out[shot.state].add_view(engine, &shot.target, &mut gradients)?;
        }
        Ok(out)
    }

    /// Normal equations of pictures and depth together.
    pub(super) fn sums(&self, guess: &Guess, seen: &[ByPart]) -> Sums {
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
                let here: Vec<_> =
                    here.into_iter().map(|(i, t)| (i, t.moved(&guess.state_from_world[state]).vector())).collect();
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
                let moved = guess.state_from_world[state] * poses[part] * zero[part].inverse();
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

    /// The unknowns that move a part in a state, each with the twist that it causes before the
    /// state's frame moves it on.
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
    pub(super) fn step(
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
        if by.iter().any(|x| !x.is_finite()) {
            return Ok(None);
        }
        let mut next = guess.clone();
        // Half of what any slide does: the depth has been near already.
        let range = |joint: &Joint| joint.seen()[1] - joint.seen()[0];
        let slides = guess.tree.joints.iter().filter(|j| !j.screw.kind.turns());
        let longest = 0.5 * slides.map(range).fold(0.0, f64::max);
        update(&mut next.tree, &self.slots, &by, longest);
        for (j, joint) in next.tree.joints.iter_mut().enumerate() {
            let most = if joint.screw.kind.turns() { LONGEST_TURN } else { longest };
            joint.values[0] += by[self.zeros + j].clamp(-most, most);
        }
        for ((state_from_world, frame), inverse) in next.state_from_world.iter_mut().zip(&sums.frames).zip(inverses) {
            let xi = -(inverse * (frame.gradient + &frame.by_joints * &by));
            *state_from_world = exp(&xi) * *state_from_world;
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
pub(super) fn exp(xi: &Vector6<f64>) -> Pose {
    let turn = DVec3::new(xi[3], xi[4], xi[5]).clamp_length_max(0.1);
    Pose::new(quat_from_rotation_vector(turn), DVec3::new(xi[0], xi[1], xi[2]))
}
