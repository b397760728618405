//! Where depth comes from.

use crate::error::{ArticulateError, DepthError};
use crate::observe::depth_view::{DepthView, OBJECT};
use glam::{DVec2, Vec3};

/// Depth pictures of an object in several states: a recording on disk, or `Vec<Vec<DepthView>>` in
/// memory (`[state][view]`).
pub trait Depths {
    /// Number of states.
    fn n_states(&self) -> usize;

    /// Box of the object over all states, world frame, scene units. What lies outside is not looked
    /// at.
    ///
    /// # Errors
    /// Whatever keeps it from being known.
    fn extent(&mut self) -> Result<(Vec3, Vec3), DepthError>;

    /// The views of one state. Asked for two or three times; dropped before the next state is asked
    /// for.
    ///
    /// # Errors
    /// Whatever keeps them from being read.
    fn views(&mut self, state: usize) -> Result<Vec<DepthView>, DepthError>;
}

impl Depths for Vec<Vec<DepthView>> {
    fn n_states(&self) -> usize {
        self.len()
    }

    fn extent(&mut self) -> Result<(Vec3, Vec3), DepthError> {
        for (state, views) in self.iter().enumerate() {
            check_views(views, state)?;
        }
        let (mut lo, mut hi) = (Vec3::INFINITY, Vec3::NEG_INFINITY);
        for view in self.iter().flatten() {
            let w = view.camera.width;
            for i in (0..view.class.len()).filter(|&i| view.class[i] == OBJECT) {
                let uv = DVec2::new((i % w) as f64 + 0.5, (i / w) as f64 + 0.5);
                let x = view.camera.unproject(uv, view.depth[i] as f64).as_vec3();
                (lo, hi) = (lo.min(x), hi.max(x));
            }
        }
        Ok((lo, hi))
    }

    fn views(&mut self, state: usize) -> Result<Vec<DepthView>, DepthError> {
        Ok(self[state].clone())
    }
}

/// Refuses views that nothing can be read from. Finite depth is for whoever makes the views to see
/// to; a camera is looked at here, since one that is not finite spoils every state.
///
/// # Errors
/// Sizes that do not fit, cameras or depths that are not finite.
pub(crate) fn check_views(views: &[DepthView], state: usize) -> Result<(), ArticulateError> {
    for (k, view) in views.iter().enumerate() {
        let place = || format!("state {state}, view {k}");
        let pixels = view.camera.width * view.camera.height;
        if view.depth.len() != pixels || view.class.len() != pixels {
            let what = format!("{} depths and {} classes for {pixels} pixels", view.depth.len(), view.class.len());
            return Err(ArticulateError::input(what, place(), "give one of each per pixel of the camera"));
        }
        let pose = &view.camera.camera_from_world;
        if !(pose.trans.is_finite() && pose.rot.is_finite()) {
            let hint = "leave the view out, or give its pose in metres";
            return Err(ArticulateError::input("a camera pose that is not finite", place(), hint));
        }
        let bad = |i: &usize| view.class[*i] == OBJECT && !(view.depth[*i] > 0.0 && view.depth[*i].is_finite());
        if let Some(i) = (0..pixels).find(bad) {
            let what = format!("depth {} on the object", view.depth[i]);
            let place = format!("{}, pixel {}, {}", place(), i % view.camera.width, i / view.camera.width);
            return Err(ArticulateError::input(what, place, "mark pixels without depth as UNKNOWN"));
        }
    }
    Ok(())
}
