//! Lenses, ways of the camera, sensors and drift of rendered recordings.

mod common;

use common::{made, small, with};
use glam::{DVec2, DVec3};
use hingecast_capture::synth::{Drift, Frames, Lens, Noise, Scenery, SynthConfig, Trajectory, World};
use hingecast_capture::{Split, Truth};

#[test]
fn pictures_have_the_size_and_lens_that_was_asked_for() {
    let dir = tempfile::tempdir().unwrap();
    let (recording, truth) =
        made(dir.path(), &with(World { lens: Some("iphone/4".parse().unwrap()), ..Default::default() }));
    for (i, frame) in recording.frames.iter().enumerate() {
        let c = &frame.camera;
        assert_eq!((c.width, c.height, c.fx, c.fy, c.cx, c.cy), (64, 48, 53.0, 53.0, 32.0, 24.0));
        let view = recording.load(i).unwrap();
        assert_eq!((view.depth.len(), view.rgb.len()), (64 * 48, 3 * 64 * 48));
        // All of the object is in the picture, and it is not tiny.
        let labels = truth.labels(&frame.color).unwrap();
        let edge = |p: usize| [0, 63].contains(&(p % 64)) || p / 64 == 0 || p / 64 == 47;
        assert!(labels.iter().enumerate().all(|(p, l)| *l == 0 || !edge(p)), "frame {i} is cropped");
        assert!(labels.iter().filter(|l| **l > 0).count() > 64 * 48 / 20, "frame {i}");
    }
    // A lens that is neither square nor centred puts points where it says.
    let lens: Lens = "80,48,70,60,44,20".parse().unwrap();
    let (recording, truth) = made(dir.path(), &with(World { lens: Some(lens), ..Default::default() }));
    let body = &truth.tree.poses_at(0)[0];
    for i in recording.frames_of(0, Split::Train) {
        let labels = truth.labels(&recording.frames[i].color).unwrap();
        let view = recording.load(i).unwrap();
        for p in (0..labels.len()).filter(|p| labels[*p] == 1) {
            let uv = DVec2::new((p % 80) as f64 + 0.5, (p / 80) as f64 + 0.5);
            let x = body.inverse().apply(truth.cameras[i].unproject(uv, f64::from(view.depth[p])));
            let off = (x.abs() - DVec3::new(0.2, 0.15, 0.1)).max_element();
            assert!(off.abs() < 3e-4, "{off}");
        }
    }
    assert_eq!("d435".parse(), Ok(Lens::D435));
    assert_eq!("d435/2".parse(), Ok(Lens { width: 320, height: 240, fx: 307.5, fy: 307.5, cx: 160.0, cy: 120.0 }));
    for text in [
        "",
        "phone",
        "64,48,50,50,32",
        "64.5,48,50,50,32,24",
        "d435/0",
        "d435/100",
        "64,48,0,50,32,24",
        "64,48,50,50,90,24",
    ] {
        assert!(text.parse::<Lens>().is_err(), "{text}");
    }
}

/// Azimuth from the front, -y, in degrees, and height above the object's middle over the distance.
fn around(truth: &Truth, frame: usize) -> (f64, f64) {
    let to_eye = truth.cameras[frame].centre() - DVec3::new(0.0, 0.0, 0.05);
    (to_eye.x.atan2(-to_eye.y).to_degrees(), to_eye.z / to_eye.length())
}

#[test]
fn trajectories_stay_where_they_say() {
    let dir = tempfile::tempdir().unwrap();
    for (trajectory, least, most) in [(Trajectory::Front, 50.0, 74.0), (Trajectory::Walk, 90.0, 104.0)] {
        let (recording, truth) =
            made(dir.path(), &SynthConfig { views: 30, ..with(World { trajectory, ..Default::default() }) });
        let places: Vec<(f64, f64)> = recording.frames_of(1, Split::Train).iter().map(|&i| around(&truth, i)).collect();
        let reach = |side: f64| places.iter().map(|p| side * p.0).fold(f64::MIN, f64::max);
        for side in [-1.0, 1.0] {
            assert!((least..most).contains(&reach(side)), "{trajectory:?}: {} deg", reach(side));
        }
        let high = places.iter().map(|p| p.1).fold(f64::MIN, f64::max);
        let low = places.iter().map(|p| p.1).fold(f64::MAX, f64::min);
        assert!(high - low > 0.2 && low > 0.0 && high < 0.9, "{trajectory:?}: {low} to {high}");
        for i in 0..recording.frames.len() {
            let labels = truth.labels(&recording.frames[i].color).unwrap();
            assert!(labels.iter().any(|l| *l > 0), "{trajectory:?}: frame {i} shows nothing");
        }
        let steps: Vec<f64> = places.windows(2).map(|p| (p[1].0 - p[0].0).abs()).collect();
        if trajectory == Trajectory::Walk {
            assert!(steps.iter().all(|s| *s < 15.0), "a walk jumps: {steps:?}");
            // Another walk in another state, and a hand that rolls.
            let other: Vec<(f64, f64)> =
                recording.frames_of(2, Split::Train).iter().map(|&i| around(&truth, i)).collect();
            assert!(places.iter().zip(&other).any(|(a, b)| (a.1 - b.1).abs() > 0.05));
            let roll = |i: &usize| truth.cameras[*i].camera_from_world.rotate(DVec3::Z).x.abs();
            assert!(recording.frames_of(1, Split::Train).iter().any(|i| roll(i) > 0.01));
        }
    }
}

#[test]
fn poses_drift_smoothly_in_training_frames_only() {
    let dir = tempfile::tempdir().unwrap();
    let world = World { drift: Some("1:10".parse().unwrap()), frames: Frames::PerState, ..Default::default() };
    let (recording, truth) = made(dir.path(), &SynthConfig { views: 25, ..with(world) });
    for state in 0..3 {
        let back = truth.recording_from_world_at(state).inverse();
        // How the frame is off in the true world: turn, and way of the camera.
        let off = |i: usize| {
            let stated = back * recording.frames[i].camera.camera_from_world.inverse();
            let exact = truth.cameras[i].camera_from_world.inverse();
            ((stated * exact.inverse()).angle().to_degrees(), stated.trans - exact.trans)
        };
        let train: Vec<(f64, DVec3)> = recording.frames_of(state, Split::Train).into_iter().map(off).collect();
        let worst = train.iter().fold((0.0, 0.0), |w: (f64, f64), o| (w.0.max(o.0), w.1.max(o.1.length())));
        assert!((worst.0 - 1.0).abs() < 1e-6 && (worst.1 - 0.01).abs() < 1e-8, "{worst:?}");
        assert!(train[0].0 < 1e-6 && train[0].1.length() < 1e-8, "{:?}", train[0]);
        let step = train.windows(2).map(|o| o[0].1.distance(o[1].1)).fold(0.0, f64::max);
        assert!(step < 0.004, "a step of {step} m");
        for i in recording.frames_of(state, Split::Test) {
            assert!(off(i).0 < 1e-6 && off(i).1.length() < 1e-8);
        }
    }
    assert!("1".parse::<Drift>().is_err() && "1:-3".parse::<Drift>().is_err());
}

/// Root mean square of what depth is off along the ray on the object, and the share of its pixels
/// without depth.
fn depth_errors(noise: Noise) -> (f64, f64) {
    let dir = tempfile::tempdir().unwrap();
    let exact_dir = tempfile::tempdir().unwrap();
    let world = World { scene: Scenery::Room, lens: Some("iphone/2".parse().unwrap()), ..Default::default() };
    let (recording, truth) = made(dir.path(), &SynthConfig { noise, ..with(world.clone()) });
    let (exact, _) = made(exact_dir.path(), &with(world));
    let (mut square, mut n, mut lost, mut all) = (0.0, 0.0, 0.0, 0.0);
    for (i, frame) in recording.frames.iter().enumerate() {
        let (view, wanted) = (recording.load(i).unwrap(), exact.load(i).unwrap());
        let test = frame.split == Split::Test;
        assert_eq!(view.depth == wanted.depth && view.rgb == wanted.rgb, test, "frame {i}");
        // Masks and poses are left alone.
        assert!(view.mask == wanted.mask && frame.camera == exact.frames[i].camera, "frame {i}");
        let labels = truth.labels(&frame.color).unwrap();
        for p in (0..labels.len()).filter(|p| labels[*p] > 0 && !test) {
            all += 1.0;
            lost += f64::from(u8::from(view.depth[p] == 0.0));
            let off = f64::from(view.depth[p] - wanted.depth[p]).abs();
            if view.depth[p] > 0.0 && off < 0.02 {
                square += off * off;
                n += 1.0;
            }
        }
    }
    (f64::sqrt(square / n), lost / all)
}

#[test]
fn stereo_and_time_of_flight_spoil_depth_and_colour_of_training_frames() {
    for noise in [Noise::Stereo, Noise::Tof] {
        let (off, lost) = depth_errors(noise);
        // Noise of some mm; time of flight adds its bias and, at edges, a part of the step.
        assert!((0.0008..0.009).contains(&off), "{noise:?}: {off} m");
        assert!((0.005..0.3).contains(&lost), "{noise:?}: {lost} of the pixels are lost");
    }
}

/// A drawer between two others that it touches gets no range, and `synth` says so.
#[test]
fn a_joint_that_got_no_range_is_named() {
    let dir = tempfile::tempdir().unwrap();
    let urdf = r#"<robot name="slot">
      <link name="body"><visual><geometry><box size="0.4 0.4 0.4"/></geometry></visual></link>
      <link name="blade"><visual><geometry><box size="0.1 0.02 0.1"/></geometry></visual></link>
      <link name="lid"><visual><origin xyz="0 -0.2 0"/><geometry><box size="0.4 0.4 0.02"/></geometry></visual></link>
      <joint name="blade_slide" type="prismatic"><origin xyz="0.15 0 0"/><axis xyz="1 0 0"/>
        <limit lower="0" upper="0.3"/><parent link="body"/><child link="blade"/></joint>
      <joint name="lid_hinge" type="revolute"><origin xyz="0 0.2 0.22"/><axis xyz="-1 0 0"/>
        <limit lower="0" upper="1.5"/><parent link="body"/><child link="lid"/></joint>
    </robot>"#;
    let file = dir.path().join("slot.urdf");
    std::fs::write(&file, urdf).unwrap();
    let object = hingecast_capture::object::ArticulatedObject::load(&file).unwrap();
    let report =
        hingecast_capture::synth::synth(&object, &small(), &dir.path().join("rec"), &Default::default()).unwrap();
    assert_eq!(report.notes.len(), 1, "{:?}", report.notes);
    let note = &report.notes[0];
    assert!(note.contains("'blade_slide'") && note.contains("stuck") && note.contains("--range"), "{note}");
}
