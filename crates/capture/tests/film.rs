//! A film as an app leaves it: a scan, a play, and the truth beside.

mod common;

use hingecast_capture::synth::{Drift, Frames, Scenery, SynthConfig, World};
use hingecast_capture::{Recording, Truth};

fn film() -> SynthConfig {
    let world = World {
        scene: Scenery::Room,
        frames: Frames::PerState,
        drift: Some(Drift { deg: 0.5, mm: 5.0 }),
        ..World::default()
    };
    SynthConfig { film: Some(40), views: 6, size: 32, world, ..Default::default() }
}

#[test]
fn a_film_is_a_scan_and_a_play_without_masks_and_states() {
    let dir = tempfile::tempdir().unwrap();
    let report = common::record(dir.path(), &film());
    let [scan, play] = ["scan", "play"].map(|part| Recording::open(&report.recording.join(part)).unwrap());
    let truth = Truth::open(&report.truth.unwrap()).unwrap();
    assert_eq!((scan.frames.len(), play.frames.len(), report.frames), (6, 40, 46));
    for recording in [&scan, &play] {
        assert!(recording.n_states == 1 && recording.registered && !recording.film);
        assert!(recording.frames.iter().all(|f| f.mask.is_none() && f.occluder_mask.is_none() && f.time.is_some()));
        assert!(!recording.root.join("mask").exists() && !recording.root.join("occluder").exists());
    }
    // Ten pictures a second, one hand-held camera: it never jumps.
    assert_eq!(truth.film_times.len(), 40);
    assert!(play.frames.iter().zip(&truth.film_times).all(|(f, t)| (f.time.unwrap() - t).abs() < 1e-9));
    let exact = &truth.cameras[6..];
    let far = exact[0].centre().distance(exact[39].centre());
    for pair in exact.windows(2) {
        assert!(pair[0].centre().distance(pair[1].centre()) < 0.1 * far);
    }
    assert!(far > 0.2, "{far}");
    // Play has a world of its own, and drifts along its way: the first picture is right.
    let stated = |k: usize| play.frames[k].camera.camera_from_world * truth.recording_from_world_at(1 + k);
    assert!((stated(0).inverse() * exact[0].camera_from_world).angle() < 1e-6);
    assert!(truth.recording_from_world_at(1).angle() > 0.01);
    let off = (0..40).map(|k| (stated(k).inverse() * exact[k].camera_from_world).angle().to_degrees());
    let worst = off.fold(0.0, f64::max);
    assert!((worst - 0.5).abs() < 0.01, "{worst}");
}

#[test]
fn joints_rest_and_move_smoothly_and_hands_are_there_while_they_move() {
    let dir = tempfile::tempdir().unwrap();
    let report = common::record(dir.path(), &film());
    let truth = Truth::open(&report.truth.unwrap()).unwrap();
    let values = &truth.tree.joints[0].values;
    assert_eq!((values.len(), values[0]), (41, values[1]), "the film begins where the scan was");
    let steps: Vec<f64> = values.windows(2).map(|w| (w[1] - w[0]).abs()).collect();
    let range = truth.tree.joints[0].limits[1] - truth.tree.joints[0].limits[0];
    assert!(steps.iter().all(|s| *s < 0.1 * range), "{steps:?}");
    let rests = steps.iter().filter(|s| **s == 0.0).count();
    assert!((6..30).contains(&rests), "{rests}");
    for state in 1..=40 {
        let moves = steps[state - 1] > 0.0;
        let hand = truth.root.join(format!("hands/s{state:03}_v000.png")).is_file();
        assert!(hand || !moves, "state {state} moves without a hand");
    }
    assert!(!truth.root.join("hands/s001_v000.png").exists() && !truth.root.join("hands/s000_v000.png").exists());
    // A folder with something of a person's in it is not replaced.
    std::fs::write(report.recording.join("play/notes.txt"), "years").unwrap();
    let object = common::hinged_box(dir.path());
    let again = hingecast_capture::synth::synth(&object, &film(), &report.recording, &Default::default());
    assert!(again.is_err_and(|e| e.what.contains("notes.txt")));
}
