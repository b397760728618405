//! What every stage may look at.

use crate::config::Config;
use crate::failure::{Failure, Result};
use hingecast_capture::{Recording, Split, View, ViewCache};
use hingecast_geom::Pose;
use rayon::prelude::*;
use std::collections::BTreeMap;
use std::sync::Arc;

/// A recording, what is known of its cameras by now, and the settings.
pub struct Inputs<'a> {
    /// What was recorded.
    pub recording: &'a Recording,
    /// Its views, decoded within a budget of memory.
    pub cache: &'a ViewCache,
    /// All settings.
    pub config: &'a Config,
    /// Worker threads.
    pub threads: usize,
    /// Colour behind the object, and whether the pictures really show it.
    pub background: ([f32; 3], bool),
    /// camera_from_world where the depth corrected it, by frame.
    pub cameras: BTreeMap<usize, Pose>,
}

impl Inputs<'_> {
    /// A frame's pixels with its corrected camera.
    ///
    /// # Errors
    /// When a picture cannot be read.
    pub fn view(&self, frame: usize) -> Result<View> {
        let mut view = Arc::unwrap_or_clone(self.cache.get(frame)?);
        if let Some(pose) = self.cameras.get(&frame) {
            view.camera.camera_from_world = *pose;
        }
        Ok(view)
    }

    /// The same, which nobody wants again soon: the cache lets go of it.
    ///
    /// # Errors
    /// When a picture cannot be read.
    pub fn take_view(&self, frame: usize) -> Result<View> {
        let mut view = self.cache.take(frame)?;
        if let Some(pose) = self.cameras.get(&frame) {
            view.camera.camera_from_world = *pose;
        }
        Ok(view)
    }

    /// Training frames of every state. `[state]`
    pub fn training_frames(&self) -> Vec<Vec<usize>> {
        (0..self.recording.n_states).map(|s| self.recording.frames_of(s, Split::Train)).collect()
    }

    /// Box of the masked depth of some states, world frame. That of the first state scales every
    /// length in the settings.
    ///
    /// # Errors
    /// When hardly any pixel shows the object.
    pub fn extent(&self, states: &[usize]) -> Result<(glam::DVec3, glam::DVec3)> {
        let frames: Vec<usize> = states.iter().flat_map(|s| self.recording.frames_of(*s, Split::Train)).collect();
        let stride = if states.len() > 1 { 8 } else { 4 };
        let points: Vec<Vec<glam::DVec3>> = frames
            .par_iter()
            .map(|&f| {
                let mut own = Vec::new();
                super::pixels::unproject(&*self.cache.get(f)?, stride, &mut |x, _| own.push(x));
                Ok(own)
            })
            .collect::<Result<_>>()?;
        let mut axes: [Vec<f64>; 3] = std::array::from_fn(|a| points.iter().flatten().map(|x| x[a]).collect());
        if axes[0].len() < 100 {
            return Err(Failure::new(
                "the recording shows no object: fewer than 100 pixels have mask and depth",
                self.recording.root.display().to_string(),
                "hingecast check RECORDING; are the masks inverted, or the depth unit wrong?",
            ));
        }
        // A thousandth on each side is noise: flying pixels at depth edges.
        let mut quantile = |a: usize, q: f64| {
            let k = ((axes[a].len() - 1) as f64 * q) as usize;
            *axes[a].select_nth_unstable_by(k, f64::total_cmp).1
        };
        let lo = glam::DVec3::new(quantile(0, 0.001), quantile(1, 0.001), quantile(2, 0.001));
        let hi = glam::DVec3::new(quantile(0, 0.999), quantile(1, 0.999), quantile(2, 0.999));
        Ok((lo, hi))
    }
}
