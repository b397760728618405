//! Truth of a film, by the states that its pictures were cut into.

use crate::failure::{Failure, Result};
use hingecast_capture::{Recording, Truth};

/// Pictures are at most this far from a moment that the truth knows, seconds.
const SAME_TIME: f64 = 1e-3;

/// Gives `truth` the states of `recording`: of each, the mean of the true values at the times of its
/// pictures; the scan stays state 0.
///
/// # Errors
/// A picture at a time that the truth does not know.
pub(super) fn by_time(truth: &mut Truth, recording: &Recording) -> Result<()> {
    let mut moments: Vec<Vec<usize>> = vec![vec![0]];
    for state in 1..recording.n_states {
        let mut own = Vec::new();
        for frame in recording.frames.iter().filter(|f| f.state == state) {
            let near = |t: &f64| frame.time.is_some_and(|time| (time - t).abs() < SAME_TIME);
            let Some(k) = truth.film_times.iter().position(near) else {
                let what = format!("the truth knows nothing of a picture at {:?} s", frame.time);
                let hint = "give the truth of this film: <FOLDER>.truth, as `hingecast synth --film` writes it";
                return Err(Failure::new(what, truth.root.display().to_string(), hint));
            };
            own.push(k + 1);
        }
        moments.push(own);
    }
    let mean = |values: &[f64], own: &Vec<usize>| own.iter().map(|&s| values[s]).sum::<f64>() / own.len().max(1) as f64;
    for joint in &mut truth.tree.joints {
        joint.values = moments.iter().map(|own| mean(&joint.values, own)).collect();
    }
    truth.n_states = recording.n_states;
    truth.world_from_object.clear();
    truth.recording_from_world.clear();
    Ok(())
}
