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

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DVec3;
    use hingecast_capture::{Frame, Split};
    use hingecast_geom::{Camera, Joint, JointKind, KinematicTree, Screw};

    fn recording(times: &[&[f64]]) -> Recording {
        let camera = Camera::look_at(DVec3::X, DVec3::ZERO, DVec3::Z, 8, 8, 1.0);
        let frame = |state: usize, view: usize, time: f64| Frame {
            state,
            view,
            split: Split::Train,
            camera,
            color: "rgb/a.png".into(),
            depth: None,
            depth_scale: 1e-3,
            mask: None,
            occluded: false,
            occluder_mask: None,
            mask_ids: Vec::new(),
            time: Some(time),
        };
        let of =
            |(s, own): (usize, &&[f64])| own.iter().enumerate().map(move |(v, t)| frame(s, v, *t)).collect::<Vec<_>>();
        Recording {
            root: "rec".into(),
            name: "box".into(),
            frames: times.iter().enumerate().flat_map(of).collect(),
            n_states: times.len(),
            metric: true,
            up: DVec3::Z,
            registered: true,
            film: true,
            doubts: Vec::new(),
            settled: false,
        }
    }

    #[test]
    fn a_state_of_a_film_has_the_mean_of_its_pictures_values() {
        let screw = Screw { kind: JointKind::Revolute, axis: DVec3::Z, pivot: DVec3::ZERO };
        let joint = Joint {
            name: "hinge".into(),
            parent: 0,
            child: 1,
            screw,
            values: vec![0.5, 0.5, 1.0, 2.0, 4.0],
            limits: [0.0, 4.0],
        };
        let mut truth = Truth {
            root: "truth".into(),
            object: "box".into(),
            tree: KinematicTree { parts: vec!["a".into(), "b".into()], joints: vec![joint], couplings: Vec::new() },
            diagonal: 1.0,
            n_states: 5,
            source_limits: vec![[0.0, 4.0]],
            cameras: Vec::new(),
            world_from_object: Vec::new(),
            recording_from_world: Vec::new(),
            film_times: vec![0.0, 0.1, 0.2, 0.3],
        };
        // The scan's own times say nothing of the film.
        by_time(&mut truth, &recording(&[&[0.3, 7.0], &[0.0, 0.1], &[0.3]])).unwrap();
        assert_eq!((truth.n_states, &truth.tree.joints[0].values[..]), (3, &[0.5, 0.75, 4.0][..]));
        assert!(by_time(&mut truth, &recording(&[&[0.0], &[0.15]])).is_err());
    }
}
