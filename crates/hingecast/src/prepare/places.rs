//! Where cameras, states and the object stand: what is corrected in a recording, and kept beside it.

use super::examine::or_why;
use super::raw_depths::RawDepths;
use super::words::{AGREE_WELL, failure};
use crate::failure::Result;
use hingecast_capture::{Recording, Split};
use hingecast_geom::{Pose, Progress};
use hingecast_prepare::register::Freedom;
use hingecast_prepare::{PrepareError, Registration, Settled};
use std::collections::BTreeMap;

/// Corrects cameras that drifted along a scan, in a recording that shows a room; `masks`: what of it is
/// the object is known. Answers all of them (see [`Prepared::cameras`](super::Prepared::cameras)), or
/// nothing when none moved, and whether the room holds them.
///
/// # Errors
/// A picture that cannot be read; the wish to stop.
pub fn settle(recording: &mut Recording, masks: bool, progress: &Progress) -> Result<(Vec<Pose>, bool)> {
    let mut depths = if masks { RawDepths::all_masked(recording) } else { RawDepths::new(recording) };
    let settled = hingecast_prepare::settle(&mut depths, progress);
    let Settled { cameras, held } = settled.map_err(|e| failure(e, recording))?;
    let frames = (0..cameras.len()).flat_map(|state| recording.frames_of(state, Split::Train));
    let by_frame: BTreeMap<usize, Pose> = frames.zip(cameras.into_iter().flatten()).collect();
    if by_frame.iter().all(|(&i, pose)| recording.frames[i].camera.camera_from_world == *pose) {
        return Ok((Vec::new(), held));
    }
    let cameras: Vec<Pose> = by_frame.into_values().collect();
    put_cameras(recording, &cameras);
    Ok((cameras, held))
}

/// Takes out what the scans of a masked recording in one frame have drifted from each other (see
/// [`Prepared::level`](super::Prepared::level)). Answers that, and whether the room holds the states.
pub(super) fn level(recording: &mut Recording, seed: u64, progress: &Progress) -> Result<(Vec<Pose>, bool)> {
    let found = hingecast_prepare::level(&mut RawDepths::all_masked(recording), seed, progress);
    let found = found.map_err(|e| failure(e, recording))?;
    let held = found.is_some();
    let level = found.unwrap_or_default();
    apply(recording, &level);
    Ok((level, held))
}

/// Gives every training frame that is used its camera.
pub(super) fn put_cameras(recording: &mut Recording, cameras: &[Pose]) {
    let training = recording.frames.iter_mut().filter(|f| f.split == Split::Train && !f.occluded);
    training.zip(cameras).for_each(|(frame, pose)| frame.camera.camera_from_world = *pose);
}

/// Brings the states' worlds together: cameras of every state in the frame of state 0.
///
/// # Errors
/// Scans that have too little in common, or fit in two ways; a picture that cannot be read; the
/// wish to stop.
pub fn register(recording: &mut Recording, seed: u64, progress: &Progress) -> Result<Registration> {
    let mut depths = RawDepths::new(recording);
    let up = Freedom::AboutUp(recording.up);
    let found = match hingecast_prepare::register(&mut depths, up, seed, progress) {
        // Up may not be what the file says.
        Err(PrepareError::Apart { .. }) => hingecast_prepare::register(&mut depths, Freedom::Any, seed, progress),
        Ok(upright) if upright.least_share() < AGREE_WELL => {
            match hingecast_prepare::register(&mut depths, Freedom::Any, seed, progress) {
                Ok(any) if any.least_share() > upright.least_share() => Ok(any),
                Err(e @ (PrepareError::Cancelled(_) | PrepareError::Depths(_))) => Err(e),
                _ => Ok(upright),
            }
        }
        other => other,
    };
    let found = found.map_err(|e| match e {
        PrepareError::Cancelled(_) | PrepareError::Depths(_) => failure(e, recording),
        e => or_why(failure(e, recording), recording, progress),
    })?;
    apply(recording, &found.common_from_state);
    recording.registered = true;
    Ok(found)
}

pub(super) fn apply(recording: &mut Recording, common_from_state: &[Pose]) {
    for frame in &mut recording.frames {
        if let Some(common_from_own) = common_from_state.get(frame.state) {
            frame.camera.camera_from_world = frame.camera.camera_from_world * common_from_own.inverse();
        }
    }
}

/// Pushes of states one after the other that differ by less than so many degrees, and by less than this share
/// of how far they are, are one.
const ALIKE_DEG: f64 = 0.3;
const ALIKE: f64 = 0.1;

/// Brings states in which the object as a whole stands elsewhere back to where it stood. Answers by what,
/// and a doubt for each place.
pub(super) fn take_pushes_out(
    recording: &mut Recording,
    seed: u64,
    progress: &Progress,
) -> Result<(Vec<Pose>, Vec<String>)> {
    let mut depths = RawDepths::masked(recording);
    let found = hingecast_prepare::steady(&mut depths, recording.up, seed, progress);
    let pushes = found.map_err(|e| failure(e, recording))?;
    if pushes.iter().all(|p| *p == Pose::IDENTITY) {
        return Ok((Vec::new(), Vec::new()));
    }
    let middle = depths.middle()?;
    let far = |push: &Pose| (push.apply(middle) - middle).length();
    // What was pushed stays there: one doubt for all the states after it.
    let mut stays: Vec<(usize, usize)> = Vec::new();
    for state in (0..pushes.len()).filter(|s| pushes[*s] != Pose::IDENTITY) {
        let alike = |since: usize| {
            let between = pushes[since].inverse() * pushes[state];
            between.angle().to_degrees() < ALIKE_DEG && far(&between) < ALIKE * far(&pushes[state])
        };
        match stays.last_mut() {
            Some((first, last)) if *last + 1 == state && alike(*first) => *last = state,
            _ => stays.push((state, state)),
        }
    }
    let doubts = stays.into_iter().map(|(first, last)| {
        let (far, turn) = (far(&pushes[first]), pushes[first].angle().to_degrees());
        let far = if recording.metric { format!("{:.0} mm", 1e3 * far) } else { format!("{far:.3} scene units") };
        let (states, leave) = match first == last {
            true => (format!("state {first}"), "that state"),
            false => (format!("states {first} to {last}"), "those states"),
        };
        format!(
            "{states}: the object as a whole was taken to stand {far} and {turn:.1} deg elsewhere, pushed, and brought back; if \
             it stood still, leave {leave} out"
        )
    });
    let doubts = doubts.collect();
    apply(recording, &pushes);
    Ok((pushes, doubts))
}
