//! What a build has made so far: in memory where a stage ran, read from the run folder where it was
//! kept.

use super::{Groups, Joints, Parts, Splats, samples};
use crate::failure::Result;
use hingecast_articulate::Labelled;
use std::cell::OnceCell;
use std::path::PathBuf;

/// Artifacts of one run; each is read at most once.
pub struct Made {
    run: PathBuf,
    parts: OnceCell<Parts>,
    samples: OnceCell<Vec<Labelled>>,
    groups: OnceCell<Groups>,
    splats: OnceCell<Splats>,
    joints: OnceCell<Joints>,
}

/// What is in a cell, or what `read` answers.
fn get<T>(cell: &OnceCell<T>, read: impl FnOnce() -> Result<T>) -> Result<&T> {
    if let Some(there) = cell.get() {
        return Ok(there);
    }
    let value = read()?;
    Ok(cell.get_or_init(|| value))
}

impl Made {
    /// Nothing is in memory yet.
    pub fn new(run: PathBuf) -> Self {
        let (parts, samples, groups) = (OnceCell::new(), OnceCell::new(), OnceCell::new());
        Self { run, parts, samples, groups, splats: OnceCell::new(), joints: OnceCell::new() }
    }

    /// Of `--method screw`.
    ///
    /// # Errors
    /// When its file is missing or not ours; so with all others.
    pub fn parts(&self) -> Result<&Parts> {
        get(&self.parts, || Parts::read(&self.run))
    }

    /// The labelled surface of every state.
    pub fn samples(&self) -> Result<&Vec<Labelled>> {
        get(&self.samples, || samples::read(&self.run, &self.parts()?.tree))
    }

    /// Of `--method track`.
    pub fn groups(&self) -> Result<&Groups> {
        get(&self.groups, || Groups::read(&self.run))
    }

    /// The gaussians.
    pub fn splats(&self) -> Result<&Splats> {
        get(&self.splats, || Splats::read(&self.run))
    }

    /// The tree that the twin is built by.
    pub fn joints(&self) -> Result<&Joints> {
        get(&self.joints, || Joints::read(&self.run))
    }

    /// Remembers what the stage `parts` of `--method screw` made.
    pub fn keep_parts(&mut self, parts: Parts, samples: Vec<Labelled>) {
        (self.parts, self.samples) = (parts.into(), samples.into());
    }

    /// Remembers what the stage `parts` of `--method track` made.
    pub fn keep_groups(&mut self, groups: Groups) {
        self.groups = groups.into();
    }

    /// Remembers what the stage `splat` made.
    pub fn keep_splats(&mut self, splats: Splats) {
        self.splats = splats.into();
    }

    /// Remembers what the stage `joints` made.
    pub fn keep_joints(&mut self, joints: Joints) {
        self.joints = joints.into();
    }
}
