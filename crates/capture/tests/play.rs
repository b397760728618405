//! A recording of play: a hand holds the part that moves, moves along with it, and is masked.

mod common;

use glam::{DVec2, DVec3};
use hingecast_capture::synth::SynthConfig;
use hingecast_capture::{Recording, Split, Truth};

fn play() -> SynthConfig {
    SynthConfig { play: true, views: 8, test_views: 1, states: 4, test_states: 1, size: 96, ..Default::default() }
}

/// The hand's surface as the training cameras of a state see it, in the lid's canonical frame.
fn hand_in_lid(recording: &Recording, truth: &Truth, state: usize) -> Vec<DVec3> {
    let lid_from_world = truth.tree.poses_at(state)[1].inverse();
    let mut out = Vec::new();
    for i in recording.frames_of(state, Split::Train) {
        let (frame, view) = (&recording.frames[i], recording.load(i).unwrap());
        let labels = truth.labels(&frame.color).unwrap();
        let w = frame.camera.width;
        for p in 0..view.depth.len() {
            // Hand: masked as one, something is there, and it is no part of the object.
            if view.usable[p] == 0 && view.depth[p] > 0.0 && labels[p] == 0 {
                let uv = DVec2::new((p % w) as f64 + 0.5, (p / w) as f64 + 0.5);
                out.push(lid_from_world.apply(frame.camera.unproject(uv, f64::from(view.depth[p]))));
            }
        }
    }
    out
}

#[test]
fn the_hand_holds_on_and_moves_with_the_part() {
    let dir = tempfile::tempdir().unwrap();
    let report = common::record(dir.path(), &play());
    let recording = Recording::open(&report.recording).unwrap();
    let truth = Truth::open(&report.truth.unwrap()).unwrap();
    let first = hand_in_lid(&recording, &truth, 0);
    for state in 1..4 {
        let here = hand_in_lid(&recording, &truth, state);
        assert!(first.len() > 200 && here.len() > 200, "state {state}: {} and {} points", first.len(), here.len());
        // Both are the same arm seen by the same cameras, and the lid has turned by 30 deg and more
        // since: only an arm that turned with it lies on itself. Pixels are 9 mm apart.
        let nearest = |x: &DVec3| first.iter().map(|y| x.distance(*y)).fold(f64::INFINITY, f64::min);
        let apart = here.iter().map(nearest).sum::<f64>() / here.len() as f64;
        assert!(apart < 0.02, "state {state}: {apart} m apart");
        // It holds the lid by the middle of the edge that is away from the hinge (y = 0.15).
        let edge = DVec3::new(0.0, -0.14, 0.12);
        let grip = here.iter().map(|x| (*x - edge).abs().max_element()).fold(f64::INFINITY, f64::min);
        assert!(grip < 0.05, "state {state}: {grip} m from the middle of the edge");
    }
}

#[test]
fn hands_are_masked_in_training_frames_only_and_time_runs() {
    let dir = tempfile::tempdir().unwrap();
    let report = common::record(dir.path(), &play());
    let recording = Recording::open(&report.recording).unwrap();
    let truth = Truth::open(&report.truth.unwrap()).unwrap();
    let background = [255u8; 3];
    for (i, frame) in recording.frames.iter().enumerate() {
        let train = frame.split == Split::Train;
        assert_eq!(frame.time, train.then_some(frame.state as f64 * 0.2), "{}", frame.color.display());
        let view = recording.load(i).unwrap();
        if !train {
            assert!(frame.occluder_mask.is_none() && !view.usable.contains(&0));
            continue;
        }
        // Whatever is neither object nor masked is background, even beside the hand, where pixels
        // are mixed. Beside the object they are mixed with the object.
        let labels = truth.labels(&frame.color).unwrap();
        let w = frame.camera.width;
        for p in 0..labels.len() {
            let (x, y) = (p % w, p / w);
            let near = |k: usize| k.saturating_sub(1)..=(k + 1).min(w - 1);
            let beside_object = near(y).any(|y| near(x).any(|x| labels[y * w + x] > 0));
            if view.usable[p] == 1 && !beside_object {
                assert_eq!(view.rgb[3 * p..3 * p + 3], background, "{} ({x}, {y})", frame.color.display());
            }
        }
    }
    let hidden = |i: &usize| recording.frames[*i].occluder_mask.is_some();
    for state in 0..4 {
        assert!(recording.frames_of(state, Split::Train).iter().filter(|i| hidden(i)).count() >= 7, "state {state}");
    }
}

#[test]
fn play_and_occluders_exclude_each_other() {
    let dir = tempfile::tempdir().unwrap();
    let object = common::hinged_box(dir.path());
    let config = SynthConfig { occluders: 0.2, ..play() };
    let error = hingecast_capture::synth::synth(&object, &config, &dir.path().join("rec"), &Default::default());
    let text = error.unwrap_err().to_string();
    assert!(text.lines().count() == 3 && text.contains("occluders = 0.2"), "{text}");
}
