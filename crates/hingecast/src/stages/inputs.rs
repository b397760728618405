//! What every stage may look at.

use crate::config::Config;
use crate::failure::{Failure, Result};
use hingecast_capture::{Recording, Split, View, ViewCache};
use hingecast_geom::Pose;
use rayon::prelude::*;
use std::collections::BTreeMap;
use std::sync::Arc;

/// Looked-at pixels with mask and depth that an object is measured by, at least.
const FEWEST: usize = 100;

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
    /// Doubts about what was done to the recording before the stages.
    pub doubts: Vec<String>,
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
        if axes[0].len() < FEWEST {
            return Err(self.shows_no_object(&frames, stride)?);
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
    /// Why `extent` failed: of pixels on a grid of `stride`, how many the masks hold, and how many of
    /// these have depth.
    fn shows_no_object(&self, frames: &[usize], stride: usize) -> Result<Failure> {
        let (mut masked, mut measured, mut all) = (0, 0, 0);
        for &f in frames {
            let view = self.cache.get(f)?;
            let (w, h) = (view.camera.width, view.camera.height);
            all += w * h;
            for i in
                (stride / 2..h).step_by(stride).flat_map(|y| (stride / 2..w).step_by(stride).map(move |x| y * w + x))
            {
                let held = view.mask[i] == 1 && view.usable[i] == 1;
                masked += usize::from(held);
                measured += usize::from(held && view.depth.get(i).is_some_and(|z| *z > 0.0));
            }
        }
        let (views, cell) = (frames.len().max(1), stride * stride);
        Ok(too_few(
            &self.recording.root.display().to_string(),
            views,
            masked * cell,
            measured * cell,
            all,
            FEWEST * cell,
        ))
    }
}

/// Pixels in masks, of these with depth, of all pictures of `views` together; `least` would do.
fn too_few(place: &str, views: usize, masked: usize, measured: usize, all: usize, least: usize) -> Failure {
    let what = format!(
        "the recording hardly shows the object: about {measured} pixels in {views} pictures have mask and depth, {least} are needed"
    );
    let share = 100.0 * masked as f64 / all.max(1) as f64;
    let hint = if masked == 0 {
        "hingecast check RECORDING; the masks are empty: are they inverted?".to_string()
    } else if 2 * measured < masked {
        format!(
            "hingecast check RECORDING; the masks hold {share:.1} % of the pictures, without depth: is its unit wrong?"
        )
    } else {
        let times = (2.0 * least as f64 / measured as f64).sqrt().ceil();
        format!(
            "the masks hold {share:.1} % of the pictures: larger pictures ({times:.0} x), from nearer, or more of them"
        )
    };
    Failure::new(what, place, hint)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// It said "fewer than 100", counted every 16th pixel, and asked whether the masks were inverted
    /// where pictures of 32 pixels were merely small.
    #[test]
    fn few_pixels_are_counted_and_the_advice_fits() {
        let failure = |masked, measured| too_few("rec", 4, masked, measured, 4 * 32 * 32, 1600);
        let small = failure(400, 384);
        assert!(small.what.contains("about 384 pixels in 4 pictures") && small.what.contains("1600"), "{small}");
        assert!(small.hint.contains("9.8 %") && small.hint.contains("larger pictures (3 x)"), "{small}");
        assert!(failure(0, 0).hint.contains("inverted"));
        assert!(failure(400, 16).hint.contains("unit"));
    }
}
