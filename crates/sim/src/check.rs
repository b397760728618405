//! Loads a model, drives every joint over its range, lets it rest for two seconds, and notes what
//! goes wrong (metrics.md, "Simulator").

use crate::compiled::couplings::followers;
use crate::object::joint_range;
use crate::{SimError, log};
use mujoco_rs::prelude::*;
use serde::{Deserialize, Serialize};
use std::path::Path;

/// Share of its range that a joint must reach.
const FREE: f64 = 0.98;

/// Shortest time that a joint is driven over its range, s.
const LEAST_SECS: f64 = 0.25;

/// How a model is tried.
#[derive(Clone, Copy, Debug)]
pub struct CheckConfig {
    /// Servo speed of hinges, rad/s.
    pub hinge_speed: f64,
    /// Servo speed of slides, scene units/s.
    pub slide_speed: f64,
    /// Length of the free fall and settling, s.
    pub settle_secs: f64,
}

impl Default for CheckConfig {
    fn default() -> Self {
        Self { hinge_speed: 0.5, slide_speed: 0.1, settle_secs: 2.0 }
    }
}

/// How one joint followed its servo.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct JointSweep {
    /// Name of the joint.
    pub name: String,
    /// Its limits, or one turn: rad or scene units.
    pub range: [f64; 2],
    /// Highest share of the range that the joint really reached, 0..1.
    pub reached: f64,
    /// Largest distance between wanted and real value, rad or scene units.
    pub worst_lag: f64,
    /// That far only with the other joints at an end of their ranges: something stands in the way
    /// otherwise.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub freed: bool,
}

/// What MuJoCo made of one file.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct FileCheck {
    /// File name, without the folder.
    pub file: String,
    /// Bodies in the compiled model, the world included.
    pub bodies: usize,
    /// Geoms in the compiled model, visual ones included.
    pub geoms: usize,
    /// One entry a hinge or slide, in the model's order.
    pub sweeps: Vec<JointSweep>,
    /// Deepest contact between parts at rest in the first state, scene units.
    pub rest_penetration: f64,
    /// Largest joint speed at the end of the free two seconds, rad/s or units/s.
    pub settled_speed: f64,
    /// Everything stayed finite.
    pub finite: bool,
    /// Warnings of compiler and simulation.
    pub warnings: Vec<String>,
}

impl FileCheck {
    /// The findings as sentences; empty for a good model.
    pub fn doubts(&self, diagonal: f64) -> Vec<String> {
        let mut out: Vec<String> = self.warnings.iter().map(|w| format!("{}: MuJoCo says {w}", self.file)).collect();
        if !self.finite {
            out.push(format!("{}: the simulation diverges", self.file));
        }
        if self.rest_penetration > 0.005 * diagonal {
            out.push(format!("{}: parts overlap by {:.4} at rest", self.file, self.rest_penetration));
        }
        for s in &self.sweeps {
            if !(s.reached >= FREE) {
                out.push(format!(
                    "{}: joint '{}' reaches only {:.0} % of its range",
                    self.file,
                    s.name,
                    100.0 * s.reached
                ));
            }
        }
        out
    }
}

/// Tries both files of a twin folder.
///
/// # Errors
/// When MuJoCo cannot load one of them.
pub fn check_twin(folder: &Path, config: &CheckConfig) -> Result<Vec<FileCheck>, SimError> {
    ["robot.xml", "robot.urdf"].iter().map(|name| check_file(&folder.join(name), config)).collect()
}

/// Tries one MJCF or URDF file.
///
/// # Errors
/// When MuJoCo cannot load it.
pub fn check_file(path: &Path, config: &CheckConfig) -> Result<FileCheck, SimError> {
    let (result, warnings) = log::collect(|| try_model(path, config));
    let mut check = result?;
    check.warnings = warnings;
    Ok(check)
}

fn try_model(path: &Path, config: &CheckConfig) -> Result<FileCheck, SimError> {
    let model = MjModel::from_xml(path).map_err(|e| SimError::load(path, e))?;
    let mut check = FileCheck {
        file: path.file_name().unwrap_or_default().to_string_lossy().into_owned(),
        bodies: model.ffi().nbody as usize,
        geoms: model.ffi().ngeom as usize,
        sweeps: Vec::new(),
        rest_penetration: 0.0,
        settled_speed: 0.0,
        finite: true,
        warnings: Vec::new(),
    };
    let mut data = MjData::new(&model);
    within_limits(&model, &mut data);
    data.forward();
    check.rest_penetration = data.contact().iter().map(|c| -c.dist).fold(0.0, f64::max);

    // Left alone: gravity pulls, lids fall, nothing may explode.
    let dt = model.opt().timestep;
    for _ in 0..(config.settle_secs / dt) as usize {
        data.step();
    }
    check.settled_speed = data.qvel().iter().fold(0.0, |a, v| v.abs().max(a));
    check.finite &= finite(&data);

    for joint in 0..model.ffi().njnt as usize {
        check.sweeps.extend(best_sweep(&model, joint, config, &mut check.finite));
    }
    Ok(check)
}

fn finite(data: &MjData<&MjModel>) -> bool {
    // MuJoCo resets a diverged simulation and counts it: look at both.
    data.qpos().iter().chain(data.qvel()).all(|x| x.is_finite() && x.abs() < 1e6)
        && data.warning().iter().all(|w| w.number == 0)
}

/// A model's reference configuration may lie outside its joints' limits.
fn within_limits(model: &MjModel, data: &mut MjData<&MjModel>) {
    for j in (0..model.ffi().njnt as usize).filter(|&j| model.jnt_limited()[j]) {
        if matches!(model.jnt_type()[j], MjtJoint::mjJNT_HINGE | MjtJoint::mjJNT_SLIDE) {
            let [lo, hi] = model.jnt_range()[j];
            let q = &mut data.qpos_mut()[model.jnt_qposadr()[j] as usize];
            *q = q.clamp(lo, hi.max(lo));
        }
    }
}

/// Where the other joints are held during a sweep.
#[derive(Clone, Copy, PartialEq)]
enum Others {
    /// As the model starts, within the limits.
    Start,
    /// At an end of their ranges.
    End(usize),
}

/// A rack behind a door, a flap below a flap: what is stopped is tried again with all others at one
/// end of their ranges, then at the other.
fn best_sweep(model: &MjModel, joint: usize, config: &CheckConfig, finite: &mut bool) -> Option<JointSweep> {
    let mut best = sweep(model, joint, Others::Start, config, finite)?;
    for end in [1, 0] {
        if best.reached < FREE && model.ffi().njnt > 1 {
            let again = sweep(model, joint, Others::End(end), config, finite)?;
            if again.reached > best.reached {
                best = JointSweep { freed: true, ..again };
            }
        }
    }
    Some(best)
}

/// Drives one joint from end to end by a stiff servo, all others held, but for those that follow it.
/// A joint that follows another is not driven.
fn sweep(
    model: &MjModel,
    joint: usize,
    others: Others,
    config: &CheckConfig,
    all_finite: &mut bool,
) -> Option<JointSweep> {
    let speed = match model.jnt_type()[joint] {
        MjtJoint::mjJNT_HINGE => config.hinge_speed,
        MjtJoint::mjJNT_SLIDE => config.slide_speed,
        _ => return None,
    };
    let couplings = followers(model);
    if couplings.iter().any(|(follower, ..)| *follower == joint) {
        return None;
    }
    let range = joint_range(model, joint);
    // A button of 3 mm is not pressed in the time in which a servo settles.
    let speed = f64::min(speed, (range[1] - range[0]) / LEAST_SECS).max(1e-9);
    let mut data = MjData::new(model);
    let nv = model.ffi().nv as usize;
    let dof = model.jnt_dofadr()[joint] as usize;
    let address = model.jnt_qposadr()[joint] as usize;
    within_limits(model, &mut data);
    if let Others::End(end) = others {
        for j in (0..model.ffi().njnt as usize).filter(|&j| model.jnt_limited()[j]) {
            data.qpos_mut()[model.jnt_qposadr()[j] as usize] = model.jnt_range()[j][end];
        }
    }
    data.qpos_mut()[address] = range[0];
    for _ in &couplings {
        for (follower, leader, polynomial) in &couplings {
            let [to, from] = [follower, leader].map(|j| model.jnt_qposadr()[*j] as usize);
            data.qpos_mut()[to] = polynomial.iter().rev().fold(0.0, |sum, c| sum * data.qpos()[from] + c);
        }
    }
    data.forward();
    let start: Vec<f64> = data.qpos().to_vec();
    let dt = model.opt().timestep;
    let steps = ((range[1] - range[0]) / speed / dt).ceil() as usize;
    let mut out = JointSweep {
        name: model.id_to_name(MjtObjBase::mjOBJ_JOINT, joint).unwrap_or("?").to_string(),
        range,
        reached: 0.0,
        worst_lag: 0.0,
        freed: false,
    };
    // Computed-torque servo: bias forces are cancelled, the error obeys a critically damped 10 Hz
    // spring.
    // What follows is left to the constraint.
    let follows: Vec<usize> = couplings.iter().map(|(f, ..)| model.jnt_dofadr()[*f] as usize).collect();
    let omega = std::f64::consts::TAU * 10.0;
    let mut mass = vec![0.0; nv * nv];
    for k in 0..=steps {
        let t = (k as f64 * dt * speed / (range[1] - range[0]).max(1e-9)).min(1.0);
        data.step1();
        data.full_m(&mut mass).ok()?;
        let accelerations: Vec<f64> = (0..nv)
            .map(|d| {
                let wanted = if d == dof { range[0] + t * (range[1] - range[0]) } else { start[d] };
                let velocity = if d == dof && t < 1.0 { speed } else { 0.0 };
                if follows.contains(&d) {
                    return 0.0;
                }
                omega * omega * (wanted - data.qpos()[d]) + 2.0 * omega * (velocity - data.qvel()[d])
            })
            .collect();
        let forces: Vec<f64> = (0..nv)
            .map(|r| {
                let inertia: f64 = (0..nv).map(|c| mass[r * nv + c] * accelerations[c]).sum();
                inertia + data.qfrc_bias()[r] - data.qfrc_passive()[r]
            })
            .collect();
        data.qfrc_applied_mut().copy_from_slice(&forces);
        data.step2();
        let q = data.qpos()[address];
        out.worst_lag = out.worst_lag.max((q - (range[0] + t * (range[1] - range[0]))).abs());
        out.reached = out.reached.max((q - range[0]) / (range[1] - range[0]).max(1e-9));
    }
    *all_finite &= finite(&data);
    Some(out)
}
