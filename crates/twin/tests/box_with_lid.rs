//! A hollow box with a hinged lid, ray-cast analytically, fused and exported: sizes, masses and
//! joints must come back.

mod common;

use common::{Slabs, observe, slabs};
use glam::DVec3;
use hingecast_geom::{Cancelled, KinematicTree, Progress};
use hingecast_twin::{BACKGROUND, Config, Twin, build, build::Input, write};

/// The base is red, the lid green.
fn paint(part: usize, _: DVec3) -> [u8; 3] {
    [[200, 0, 0], [0, 200, 0]][part]
}

fn twin_of(parts: &[Slabs; 2]) -> Twin {
    let config = Config { voxel: 1.0 / 128.0, max_texels: 0, ..Default::default() };
    common::twin_of(&|state, view| observe(parts, &paint, state, view), &config)
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
    assert!(twin.parts.iter().all(|p| p.texture.is_none()), "no texels were asked for");
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
        let mut seen = observe(&slabs(), &paint, i / 8, 3 * (i % 8));
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
