//! Depth of a recording as it came: no masks, all that was measured.

use crate::failure::{Failure, Result};
use glam::{DVec2, Vec3};
use hingecast_articulate::{DepthError, DepthView, Depths, OBJECT, UNKNOWN};
use hingecast_capture::{Recording, Split, ViewCache};
use rayon::prelude::*;

/// Views kept decoded, bytes.
const KEPT: usize = 512 << 20;
/// Share of the points, at each end of every axis, that may lie outside the extent.
const STRAY: f64 = 0.005;

/// Views of a state that say whether the object was pushed.
const SOME: usize = 16;

/// The training views of a recording.
pub(super) struct RawDepths {
    cache: ViewCache,
    frames: Vec<Vec<usize>>,
    masked: bool,
}

impl RawDepths {
    pub fn new(recording: &Recording) -> Self {
        let frames = (0..recording.n_states).map(|s| recording.frames_of(s, Split::Train)).collect();
        Self { cache: ViewCache::new(recording, KEPT), frames, masked: false }
    }

    /// All views with their masks.
    pub fn all_masked(recording: &Recording) -> Self {
        Self { masked: true, ..Self::new(recording) }
    }

    /// Some views of every state, with their masks.
    pub fn masked(recording: &Recording) -> Self {
        let mut own = Self::all_masked(recording);
        for frames in &mut own.frames {
            let n = frames.len().min(SOME);
            *frames = (0..n).map(|k| frames[k * frames.len() / n]).collect();
        }
        own
    }

    fn view(&self, frame: usize) -> Result<DepthView> {
        let view = self.cache.get(frame)?;
        if view.depth.is_empty() {
            let place = self.cache.recording().frames[frame].color.display().to_string();
            return Err(Failure::new("a picture has no depth", place, "add depth_file_path to every frame"));
        }
        if self.masked {
            return Ok(crate::stages::parts::depth_view(&view));
        }
        let known = |i: usize| if view.depth[i] > 0.0 && view.usable[i] == 1 { OBJECT } else { UNKNOWN };
        let class = (0..view.depth.len()).map(known).collect();
        Ok(DepthView { camera: view.camera, depth: view.depth.clone(), class })
    }
}

impl RawDepths {
    /// The middle of what is seen.
    pub fn middle(&mut self) -> Result<glam::DVec3> {
        let (lo, hi) = self.extent().map_err(|e| match e.downcast::<Failure>() {
            Ok(own) => *own,
            Err(e) => Failure::new(e.to_string(), "the recording", "run `hingecast check` on it"),
        })?;
        Ok(0.5 * (lo + hi).as_dvec3())
    }
}

impl Depths for RawDepths {
    fn n_states(&self) -> usize {
        self.frames.len()
    }

    fn extent(&mut self) -> std::result::Result<(Vec3, Vec3), DepthError> {
        let mut axes: [Vec<f32>; 3] = Default::default();
        for state in 0..self.frames.len() {
            for view in self.views(state)? {
                let w = view.camera.width;
                for i in (0..view.class.len()).step_by(61).filter(|&i| view.class[i] == OBJECT) {
                    let uv = DVec2::new((i % w) as f64 + 0.5, (i / w) as f64 + 0.5);
                    let x = view.camera.unproject(uv, f64::from(view.depth[i])).as_vec3();
                    (0..3).for_each(|a| axes[a].push(x[a]));
                }
            }
        }
        if axes[0].is_empty() {
            let place = self.cache.recording().root.display().to_string();
            return Err(Failure::new("no picture has depth", place, "run `hingecast check` on the recording").into());
        }
        let mut at = |a: usize, share: f64| {
            let k = ((axes[a].len() - 1) as f64 * share) as usize;
            *axes[a].select_nth_unstable_by(k, f32::total_cmp).1
        };
        let lo = [0, 1, 2].map(|a| at(a, STRAY));
        Ok((lo.into(), [0, 1, 2].map(|a| at(a, 1.0 - STRAY)).into()))
    }

    fn views(&mut self, state: usize) -> std::result::Result<Vec<DepthView>, DepthError> {
        let frames = &self.frames[state];
        frames.par_iter().map(|&f| self.view(f)).collect::<Result<_>>().map_err(DepthError::from)
    }
}
