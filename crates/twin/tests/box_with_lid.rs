//! A hollow box with a hinged lid, ray-cast analytically, fused and exported: sizes, masses and
//! joints must come back.

use glam::{DVec2, DVec3};
use hingecast_geom::{Camera, Cancelled, Joint, JointKind, KinematicTree, Progress, Screw};
use hingecast_twin::{BACKGROUND, Config, Observation, Twin, build, build::Input, write};

/// Slabs of one part: lower and upper corner.
type Slabs = Vec<(DVec3, DVec3)>;

fn slabs() -> [Slabs; 2] {
    let v = DVec3::new;
    let t = 0.02;
    let base = vec![
        (v(-0.2, -0.15, 0.0), v(0.2, 0.15, t)),
        (v(-0.2, -0.15, t), v(-0.2 + t, 0.15, 0.2)),
        (v(0.2 - t, -0.15, t), v(0.2, 0.15, 0.2)),
        (v(-0.2 + t, -0.15, t), v(0.2 - t, -0.15 + t, 0.2)),
        (v(-0.2 + t, 0.15 - t, t), v(0.2 - t, 0.15, 0.2)),
    ];
    [base, vec![(v(-0.2, -0.15, 0.2), v(0.2, 0.15, 0.22))]]
}

fn tree() -> KinematicTree {
    let screw = Screw { kind: JointKind::Revolute, axis: DVec3::NEG_Y, pivot: DVec3::new(-0.2, 0.0, 0.2) };
    KinematicTree {
        parts: vec!["base".into(), "lid".into()],
        joints: vec![Joint {
            name: "hinge".into(),
            parent: 0,
            child: 1,
            screw,
            values: vec![0.0, 0.5, 1.0, 1.5],
            limits: [0.0, 1.5],
        }],
        ..Default::default()
    }
}

fn ray_box(o: DVec3, d: DVec3, lo: DVec3, hi: DVec3) -> Option<f64> {
    let (a, b) = ((lo - o) / d, (hi - o) / d);
    let near = a.min(b).max_element();
    let far = a.max(b).min_element();
    (near <= far && near > 0.0).then_some(near)
}

fn observe(parts: &[Slabs; 2], state: usize, view: usize) -> Observation {
    let angle = view as f64 * 2.4;
    let height = 0.1 + 0.9 * (view as f64 + 0.5) / 24.0;
    let ring = (1.0 - height * height).max(0.0).sqrt();
    let target = DVec3::new(0.0, 0.0, 0.15);
    let eye = target + 1.2 * DVec3::new(ring * angle.cos(), ring * angle.sin(), height);
    let camera = Camera::look_at(eye, target, DVec3::Z, 160, 160, 0.7);
    let poses = tree().poses_at(state);
    let mut seen = Observation {
        state,
        camera,
        depth: vec![0.0; 160 * 160],
        labels: vec![BACKGROUND; 160 * 160],
        rgb: vec![0; 3 * 160 * 160],
    };
    for i in 0..160 * 160 {
        let d = camera.ray(DVec2::new((i % 160) as f64 + 0.5, (i / 160) as f64 + 0.5));
        for (part, boxes) in parts.iter().enumerate() {
            let back = poses[part].inverse();
            for &(lo, hi) in boxes {
                if let Some(z) = ray_box(back.apply(eye), back.rotate(d), lo, hi)
                    && (seen.labels[i] == BACKGROUND || (z as f32) < seen.depth[i])
                {
                    seen.depth[i] = z as f32;
                    seen.labels[i] = part as u8;
                    seen.rgb[3 * i + part] = 200;
                    seen.rgb[3 * i + 1 - part] = 0;
                }
            }
        }
    }
    seen
}

/// From 24 views of each of the four states.
fn twin_of(parts: &[Slabs; 2]) -> Twin {
    let tree = tree();
    let input = Input {
        name: "box",
        tree: &tree,
        n_states: 4,
        n_observations: 4 * 24,
        diagonal: 0.55,
        metric: true,
        up: DVec3::Z,
    };
    let load = |i: usize| Ok::<_, Cancelled>(observe(parts, i / 24, i % 24));
    let config = Config { voxel: 1.0 / 128.0, ..Default::default() };
    build(&input, &load, &config, &Progress::default()).unwrap()
}

/// A lid of a quarter of a voxel is whole, in its place, and as thin as it is.
#[test]
fn a_sheet_thinner_than_a_voxel() {
    let mut parts = slabs();
    parts[1][0].1.z = 0.201;
    let twin = twin_of(&parts);
    let lid = &twin.parts[1].mesh;
    let points = lid.sample_surface(20_000, 1);
    let off = points.iter().filter(|p| !(0.198..0.203).contains(&p.0.z)).count();
    let area = lid.area();
    assert!(off < 400 && (area / (2.0 * 0.4 * 0.3) - 1.0).abs() < 0.05, "{off} points off the sheet, area {area}");
}

#[test]
fn sizes_masses_and_joints_come_back() {
    let twin = twin_of(&slabs());
    assert!(twin.doubts.is_empty(), "{:?}", twin.doubts);

    let expected: Vec<f64> =
        slabs().iter().map(|s| s.iter().map(|(lo, hi)| (hi - lo).element_product()).sum::<f64>()).collect();
    for (part, volume) in twin.parts.iter().zip(expected) {
        assert_eq!(part.mesh.open_edges(), 0, "{} is closed", part.name);
        let ratio = part.inertial.mass / 500.0 / volume;
        assert!((0.75..1.35).contains(&ratio), "{}: volume is {ratio} of the truth", part.name);
    }
    // The inside of the box is open: from the middle, up is free.
    let (lo, hi) = twin.parts[1].mesh.bounds().unwrap();
    // Half a voxel: the surface was moved onto what the pixels measured.
    assert!((hi.z - lo.z - 0.02).abs() < 0.002, "lid thickness {}", hi.z - lo.z);
    assert!((hi.x - 0.2).abs() < 0.002 && (lo.x + 0.2).abs() < 0.002, "{lo} {hi}");
    let inner = twin.parts[0].mesh.vertices.iter().filter(|v| v.x.abs() < 0.15 && v.y.abs() < 0.1);
    let top = inner.fold(f32::MIN, |a, v| a.max(v.z));
    assert!(top < 0.035, "the floor of the box is at 0.02, found {top}");
    // Colours went to the right parts.
    let lid = hingecast_twin::link::mean_color(&twin.parts[1].mesh);
    assert!(lid[1] > 0.5 && lid[0] < 0.2, "{lid:?}");

    let dir = tempfile::tempdir().unwrap();
    let folder = dir.path().join("twin");
    write(&twin, None, &folder).unwrap();
    let robot = urdf_rs::read_file(folder.join("robot.urdf")).unwrap();
    assert_eq!(robot.links.len(), 2);
    let joint = &robot.joints[0];
    assert_eq!(joint.joint_type, urdf_rs::JointType::Revolute);
    assert!((joint.axis.xyz.0[1] + 1.0).abs() < 1e-9 && joint.limit.upper == 1.5);
    for file in robot.links.iter().flat_map(|l| &l.visual) {
        let urdf_rs::Geometry::Mesh { filename, .. } = &file.geometry else { panic!("meshes only") };
        assert!(folder.join(filename).exists());
    }
    // Link frame: on the axis, beside the lid's centre of mass.
    let origin = hingecast_twin::link::link_origin(&twin, 1);
    assert!((origin - DVec3::new(-0.2, 0.0, 0.2)).length() < 0.01, "{origin}");
}

/// Four states and no joint: whatever moved was not recognised. Once this was an index out of
/// bounds.
#[test]
fn a_recording_in_which_no_part_was_found_to_move_has_a_twin_of_one_part() {
    let tree = KinematicTree { parts: vec!["base".into()], ..Default::default() };
    let input = Input {
        name: "box",
        tree: &tree,
        n_states: 4,
        n_observations: 4 * 8,
        diagonal: 0.55,
        metric: true,
        up: DVec3::Z,
    };
    let load = |i: usize| {
        let mut seen = observe(&slabs(), i / 8, 3 * (i % 8));
        seen.labels.iter_mut().filter(|l| **l != BACKGROUND).for_each(|l| *l = 0);
        Ok::<_, Cancelled>(seen)
    };
    let config = Config { voxel: 1.0 / 64.0, ..Default::default() };
    let twin = build(&input, &load, &config, &Progress::default()).unwrap();
    assert_eq!(twin.parts.len(), 1);
    assert!(!twin.parts[0].mesh.is_empty());
}

/// A bar of half a voxel, less than half a pixel wide, between two posts on the lid: what a hand
/// would hold.
#[test]
fn a_thin_handle_stays_on_its_door() {
    let mut parts = slabs();
    let v = DVec3::new;
    parts[1].extend([
        (v(-0.01, -0.07, 0.22), v(0.01, -0.05, 0.26)),
        (v(-0.01, 0.05, 0.22), v(0.01, 0.07, 0.26)),
        (v(-0.001, -0.05, 0.25), v(0.001, 0.05, 0.252)),
    ]);
    let twin = twin_of(&parts);
    let bar = |points: &[glam::Vec3], y: f32| {
        points.iter().any(|p| (p.y - y).abs() < 0.006 && p.x.abs() < 0.006 && (p.z - 0.251).abs() < 0.006)
    };
    let hulls: Vec<glam::Vec3> = twin.parts[1].hulls.iter().flat_map(|h| h.vertices.clone()).collect();
    for k in -4..=4 {
        let y = 0.01 * k as f32;
        assert!(bar(&twin.parts[1].mesh.vertices, y), "the bar is broken at y = {y}");
    }
    assert!(hulls.iter().filter(|p| p.z > 0.24 && p.x.abs() < 0.006 && p.y.abs() < 0.055).count() >= 4);
    // And nothing is made of what no bar is: the space between bar and lid is empty.
    let between = |p: &&glam::Vec3| p.y.abs() < 0.045 && p.x.abs() < 0.1 && (0.23..0.242).contains(&p.z);
    assert_eq!(twin.parts[1].mesh.vertices.iter().filter(between).count(), 0);
}
