//! What synth writes, the reader reads: geometry, splits, truth, determinism.

mod common;

use glam::DVec2;
use hingecast_capture::synth::SynthConfig;
use hingecast_capture::{Recording, Split, Truth, ViewCache};

#[test]
fn a_recording_reads_back_as_it_was_rendered() {
    let dir = tempfile::tempdir().unwrap();
    let report = common::record(dir.path(), &common::small());
    let recording = Recording::open(&report.recording).unwrap();
    assert_eq!((recording.n_states, recording.frames.len()), (3, 3 * 7 + 1));
    assert!(recording.metric && recording.name == "hinged_box");
    assert_eq!(recording.frames_of(1, Split::Train).len(), 6);
    assert_eq!(recording.frames_of(3, Split::Train).len(), 0);
    assert_eq!(recording.frames_of(3, Split::Test).len(), 1);
    let truth = Truth::open(&report.truth.unwrap()).unwrap();
    assert_eq!(truth.n_states, 3);
    assert_eq!(truth.tree.joints[0].values.len(), 4);
    for (frame, exact) in recording.frames.iter().zip(&truth.cameras) {
        let off = (frame.camera.camera_from_world.inverse().trans - exact.camera_from_world.inverse().trans).length();
        assert!(off < 1e-9);
    }
    assert_eq!(truth.part_meshes().unwrap().len(), 2);
}

#[test]
fn depth_lies_on_the_true_surface_and_labels_tell_its_part() {
    let dir = tempfile::tempdir().unwrap();
    let report = common::record(dir.path(), &common::small());
    let recording = Recording::open(&report.recording).unwrap();
    let truth = Truth::open(&report.truth.unwrap()).unwrap();
    for &i in &recording.frames_of(2, Split::Train) {
        let (frame, view) = (&recording.frames[i], recording.load(i).unwrap());
        let labels = truth.labels(&frame.color).unwrap();
        let poses = truth.tree.poses_at(2);
        let mut seen = 0;
        for (p, &z) in view.depth.iter().enumerate() {
            assert_eq!((z > 0.0, view.mask[p] == 1), (labels[p] > 0, labels[p] > 0));
            if z == 0.0 {
                continue;
            }
            let uv = DVec2::new((p % 64) as f64 + 0.5, (p / 64) as f64 + 0.5);
            let part = labels[p] as usize - 1;
            let x = poses[part].inverse().apply(frame.camera.unproject(uv, f64::from(z)));
            // Distance to the box's surface in its canonical place.
            let (centre, half) = if part == 0 {
                (glam::DVec3::ZERO, glam::DVec3::new(0.2, 0.15, 0.1))
            } else {
                (glam::DVec3::new(0.0, 0.0, 0.12), glam::DVec3::new(0.19, 0.14, 0.015))
            };
            let outside = ((x - centre).abs() - half).max_element();
            assert!(outside.abs() < 1e-4, "part {part}: {outside}");
            seen += 1;
        }
        assert!(seen > 300);
    }
}

#[test]
fn the_same_seed_gives_the_same_bytes_with_one_thread_and_with_two() {
    let dir = tempfile::tempdir().unwrap();
    let bytes = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        let report = pool.install(|| common::record(dir.path(), &common::small()));
        let recording = Recording::open(&report.recording).unwrap();
        let images: Vec<Vec<u8>> = recording.frames.iter().map(|f| std::fs::read(&f.color).unwrap()).collect();
        (recording.fingerprint().unwrap(), images)
    };
    assert_eq!(bytes(1), bytes(2));
}

#[test]
fn the_cache_stays_within_its_budget_and_returns_the_same_pixels() {
    let dir = tempfile::tempdir().unwrap();
    let report = common::record(dir.path(), &common::small());
    let recording = Recording::open(&report.recording).unwrap();
    let budget = 3 * (64 * 64 * 6 + 400);
    let cache = ViewCache::new(&recording, budget);
    cache.prefetch(&[0, 1, 2, 3, 4]).unwrap();
    for frame in [0, 4, 0, 2, 5, 0] {
        assert_eq!(*cache.get(frame).unwrap(), recording.load(frame).unwrap());
        assert_eq!(*cache.get(frame).unwrap(), recording.load(frame).unwrap());
        assert!(cache.bytes() <= budget && cache.bytes() > 0);
    }
}

#[test]
fn two_states_stand_at_the_two_ends_of_every_range() {
    let dir = tempfile::tempdir().unwrap();
    let config = SynthConfig { states: 2, ..common::small() };
    let report = common::record(dir.path(), &config);
    let truth = Truth::open(&report.truth.unwrap()).unwrap();
    assert_eq!(truth.tree.joints[0].values, report.ranges[0].1.to_vec());
}

#[test]
fn a_folder_with_other_things_is_not_overwritten() {
    let dir = tempfile::tempdir().unwrap();
    let object = common::hinged_box(dir.path());
    let out = dir.path().join("thesis");
    std::fs::create_dir(&out).unwrap();
    std::fs::write(out.join("thesis.tex"), "years of work").unwrap();
    let error = hingecast_capture::synth::synth(&object, &common::small(), &out, &Default::default()).unwrap_err();
    assert_eq!(error.to_string().lines().count(), 3);
    assert!(out.join("thesis.tex").exists());
}
