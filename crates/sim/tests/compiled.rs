//! Objects as MuJoCo compiles them: our surfaces against MuJoCo's own rays, our kinematics against
//! its own.

use glam::{DVec3, Vec3};
use hingecast_capture::object::ArticulatedObject;
use hingecast_geom::JointKind;
use hingecast_sim::compiled::load;
use mujoco_rs::prelude::*;
use std::path::{Path, PathBuf};

const OBJ: &str = "v 0 0 0\nv 0.3 0 0\nv 0.3 0 0.2\nv 0 0 0.2\nv 0.15 0.08 0.1\nvt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\nvt 0.5 0.5\n\
f 1/1 2/2 3/3\nf 1/1 3/3 4/4\nf 2/2 1/1 5/5\nf 3/3 2/2 5/5\nf 4/4 3/3 5/5\nf 1/1 4/4 5/5\n";

/// A cupboard whose door is the text that is asked for.
fn cupboard(head: &str, door: &str) -> String {
    format!(
        r#"<mujoco model="cupboard">{head}<worldbody><body name="case" pos="0 0 0.02">
          <geom type="box" size="0.2 0.15 0.01" rgba="0.6 0.5 0.4 1"/>
          <geom type="box" size="0.01 0.15 0.2" pos="-0.19 0 0.2"/>
          <geom type="cylinder" size="0.03 0.1" pos="0.1 0.05 0.12" euler="0 20 0"/>{door}
        </body></worldbody></mujoco>"#
    )
}

const LEAF: &str = r#"<geom type="box" size="0.19 0.008 0.19" pos="0.19 0 0.19"/>"#;
const HINGE: &str = r#"<joint name="hinge" axis="0 0 1" range="-100 0"/>"#;

fn write(dir: &Path, text: &str) -> PathBuf {
    std::fs::write(dir.join("pyramid.obj"), OBJ).unwrap();
    let leaf = format!("<mujoco>{LEAF}</mujoco>");
    std::fs::write(dir.join("leaf.xml"), leaf).unwrap();
    let whole = format!(r#"<mujoco><worldbody><body name="door">{HINGE}{LEAF}</body></worldbody></mujoco>"#);
    std::fs::write(dir.join("whole_door.xml"), whole).unwrap();
    let file = dir.join("object.xml");
    std::fs::write(&file, text).unwrap();
    file
}

/// Distance along the ray to the nearest triangle (Moeller and Trumbore).
fn hit(triangles: &[[DVec3; 3]], from: DVec3, way: DVec3) -> Option<f64> {
    let one = |t: &[DVec3; 3]| {
        let (a, b) = (t[1] - t[0], t[2] - t[0]);
        let p = way.cross(b);
        let det = a.dot(p);
        let s = from - t[0];
        let (u, v) = (s.dot(p) / det, way.dot(s.cross(a)) / det);
        let inside = det.abs() > 1e-14 && u >= 0.0 && v >= 0.0 && u + v <= 1.0;
        Some(b.dot(s.cross(a)) / det).filter(|d| inside && *d > 0.0)
    };
    triangles.iter().filter_map(one).min_by(f64::total_cmp)
}

/// Share of rays on which both agree to 0.5 mm, with every joint at a third of its range; of those
/// that hit anything.
fn agreement(object: &ArticulatedObject, file: &Path) -> f64 {
    let model = MjModel::from_xml(file).unwrap();
    let mut data = MjData::new(&model);
    let mut q: Vec<f64> = object.tree.joints.iter().map(|j| j.limits[0] + 0.3 * (j.limits[1] - j.limits[0])).collect();
    object.tree.follow(&mut q);
    for (joint, q) in object.tree.joints.iter().zip(&q) {
        let id = model.name_to_id(MjtObjBase::mjOBJ_JOINT, &joint.name).unwrap();
        data.qpos_mut()[model.jnt_qposadr()[id] as usize] = *q;
    }
    data.kinematics();
    let poses = object.tree.poses(&q);
    let at = |part: usize, i: u32| poses[part].apply(object.parts[part].vertices[i as usize].as_dvec3());
    let faces = |part: usize| object.parts[part].faces.iter().map(move |f| f.map(|i| at(part, i)));
    let triangles: Vec<_> = (0..object.parts.len()).flat_map(faces).collect();
    let (lo, hi) = object.bounds(&q);
    let (centre, size) = (0.5 * (lo + hi), (hi - lo).length());
    let mut rng = fastrand::Rng::with_seed(1);
    let mut direction = || DVec3::from_array(std::array::from_fn(|_| rng.f64() - 0.5)).normalize();
    let (mut hits, mut equal) = (0, 0);
    for _ in 0..3000 {
        let from = centre + size * direction();
        let way = (centre + 0.3 * size * direction() - from).normalize();
        let (_, theirs) = data.ray(&from.to_array(), &way.to_array(), Some(&[1, 1, 1, 0, 0, 0]), true, None, None);
        let ours = hit(&triangles, from, way).unwrap_or(-1.0);
        hits += usize::from(ours > 0.0 || theirs > 0.0);
        equal += usize::from((ours > 0.0 || theirs > 0.0) && (ours - theirs).abs() < 5e-4);
    }
    assert!(hits > 300, "{hits} of 3000 rays hit anything");
    f64::from(equal as u32) / f64::from(hits as u32)
}

/// What the loader of our own once skipped without a word, read wrongly or refused.
#[test]
fn whatever_mjcf_says_the_surfaces_are_those_of_mujocos_rays() {
    let pyramid = r#"<asset><mesh name="pyramid" file="pyramid.obj""#;
    let mesh =
        |kind: &str| format!(r#"<body name="door" pos="-0.19 -0.16 0">{HINGE}<geom {kind} mesh="pyramid"/></body>"#);
    let door = format!(r#"<body name="door" pos="-0.19 -0.16 0">{HINGE}{LEAF}</body>"#);
    let frame = format!(r#"<frame pos="0 -0.1 0.03" euler="0 0 10">{door}</frame>"#);
    let twice = r#"<compiler angle="degree"/><compiler angle="radian"/><compiler eulerseq="zyx"/>"#;
    let turned = r#"<body name="door" euler="0.3 -0.5 0.8"><joint name="hinge" axis="1 2 3" range="-1 0" ref="0.2"/>"#;
    let ghost = r#"<geom type="box" size="1 1 1" rgba="1 0 0 0" contype="0" conaffinity="0"/>"#;
    let inline = r#"<asset><mesh name="pyramid" vertex="0 0 0 0.3 0 0 0 0.3 0 0 0 0.3"/></asset>"#;
    let cases = [
        ("frame", cupboard("", &frame)),
        ("include in a body", cupboard("", &door.replace(LEAF, r#"<include file="leaf.xml"/>"#))),
        (
            "attach",
            cupboard(
                r#"<asset><model name="m" file="whole_door.xml"/></asset>"#,
                r#"<body><frame pos="-0.19 -0.16 0"><attach model="m" body="door" prefix="a_"/></frame></body>"#,
            ),
        ),
        ("two compilers, euler sequence, reference", cupboard(twice, &format!("{turned}{LEAF}</body>"))),
        ("ghost", cupboard("", &format!("{ghost}{door}"))),
        ("mesh", cupboard(&format!("{pyramid}/></asset>"), &mesh(r#"type="mesh""#))),
        ("scale", cupboard(&format!(r#"{pyramid} scale="1 -1 0.7"/></asset>"#), &mesh(r#"type="mesh""#))),
        (
            "reference pose of a mesh",
            cupboard(
                &format!(r#"{pyramid} refpos="0.1 0.02 0" refquat="0.8 0 0.6 0"/></asset>"#),
                &mesh(r#"type="mesh""#),
            ),
        ),
        ("fitted", cupboard(&format!("{pyramid}/></asset>"), &mesh(r#"type="capsule""#))),
        ("inline", cupboard(inline, &mesh(r#"type="mesh""#))),
        (
            "replicate",
            cupboard(
                "",
                &format!(
                    r#"<replicate count="3" offset="0 0.03 0.1"><geom size="0.02" pos="0.1 0 0"/></replicate>{door}"#
                ),
            ),
        ),
        (
            "default classes",
            cupboard(
                r#"<default><default class="d"><geom type="capsule" size="0.02"/><joint type="slide" range="0 0.2"/></default></default>"#,
                r#"<body name="door" childclass="d"><joint name="hinge" axis="0 -1 0"/><geom fromto="0 -0.2 0 0.1 -0.2 0.2"/></body>"#,
            ),
        ),
    ];
    let dir = tempfile::tempdir().unwrap();
    for (name, text) in cases {
        let file = write(dir.path(), &text);
        let object = load(&file).unwrap_or_else(|e| panic!("{name}: {e}"));
        assert_eq!((object.parts.len(), object.tree.joints.len()), (2, 1), "{name}");
        let share = agreement(&object, &file);
        assert!(share > 0.995, "{name}: {share}");
    }
}

#[test]
fn joints_are_mujocos_own() {
    let dir = tempfile::tempdir().unwrap();
    let free = r#"<body name="door"><joint name="hinge" axis="0 0 1" limited="false" range="-100 0"/><geom size="0.1"/></body>"#;
    let object = load(&write(dir.path(), &cupboard("", free))).unwrap();
    assert_eq!(object.tree.joints[0].screw.kind, JointKind::Continuous);
    assert_eq!(object.tree.parts, ["case", "door"]);

    let slide = r#"<body name="drawer"><joint name="slide" type="slide" axis="0 -1 0"/><geom size="0.1"/></body>"#;
    let object = load(&write(dir.path(), &cupboard("", slide))).unwrap();
    assert!(object.notes[0].contains("'slide' has no range"), "{:?}", object.notes);
    assert!(object.tree.joints[0].limits[1] > 0.3, "{:?}", object.tree.joints[0].limits);

    let standing = r#"<body name="cup" pos="0 0 0.5"><freejoint/><geom size="0.1"/></body>"#;
    let text = cupboard("", "").replace("</worldbody>", &format!("{standing}</worldbody>"));
    let object = load(&write(dir.path(), &text)).unwrap();
    assert!(object.tree.joints.is_empty() && object.notes[0].contains("free"), "{:?}", object.notes);
}

/// Two doors that open together: the value of one is a function of the other's, counted from the
/// references.
#[test]
fn joints_that_follow_others_are_kept_as_mujoco_means_them() {
    let door = |name: &str, x: f64, more: &str| {
        let joint = format!(r#"<joint name="{name}" axis="0 0 1" range="-1.5 1.5" {more}/>"#);
        format!(r#"<body name="{name}_door" pos="{x} -0.16 0">{joint}<geom type="box" size="0.05 0.01 0.1"/></body>"#)
    };
    let doors = door("left", -0.19, r#"ref="0.3""#) + &door("right", 0.19, r#"ref="-0.1""#);
    let head = r#"<compiler angle="radian"/><equality><joint joint1="right" joint2="left" polycoef="0.05 -1 0.2 0 0"/></equality>"#;
    let dir = tempfile::tempdir().unwrap();
    let file = write(dir.path(), &cupboard(head, &doors));
    let object = load(&file).unwrap();
    let [coupling] = object.tree.couplings[..] else { panic!("{:?}", object.tree.couplings) };
    assert_eq!((coupling.follower, coupling.leader), (1, 0));
    // y - y0 = 0.05 - (x - x0) + 0.2 (x - x0)^2
    let x = 0.9;
    let expected = -0.1 + 0.05 - (x - 0.3) + 0.2 * (x - 0.3f64).powi(2);
    assert!((coupling.value(x) - expected).abs() < 1e-12);
    assert!(agreement(&object, &file) > 0.995);
}

#[test]
fn what_a_tree_of_hinges_cannot_say_is_refused_in_three_lines() {
    let dir = tempfile::tempdir().unwrap();
    let part = |joints: &str, geom: &str| format!(r#"<body name="door">{joints}{geom}</body>"#);
    let two = r#"<joint name="x" type="slide" range="0 1"/><joint name="turn" range="0 9"/>"#;
    let loops = r#"<equality><connect name="rod" body1="door" body2="case" anchor="0 0 0"/></equality>"#;
    let sphere = r#"<geom size="0.1"/>"#;
    let hidden = r#"<geom size="0.1" group="3"/>"#;
    for (head, door, says) in [
        ("", part(two, sphere), "'turn' is the second joint"),
        ("", part(r#"<joint name="b" type="ball"/>"#, sphere), "'b' is a ball joint"),
        (loops, part(HINGE, sphere), "'rod' closes a loop"),
        ("", part(HINGE, hidden), "no visible surface"),
        ("", part(HINGE, r#"<geom type="mesh" mesh="none"/>"#), "MuJoCo cannot load"),
    ] {
        let e = load(&write(dir.path(), &cupboard(head, &door))).unwrap_err().to_string();
        assert!(e.contains(says) && e.lines().count() == 3, "{says}: {e}");
    }
}

/// Both readers see our own samples alike: same parts, joints and surfaces.
#[test]
fn our_own_samples_are_read_alike_with_and_without_mujoco() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../objects");
    for entry in std::fs::read_dir(folder).unwrap().flatten().filter(|e| e.path().is_dir()) {
        let file = ArticulatedObject::mjcf_at(&entry.path()).unwrap();
        let Some(file) = file else { continue };
        let (ours, theirs) = (ArticulatedObject::load(&file).unwrap(), load(&file).unwrap());
        assert_eq!(ours.tree.parts, theirs.tree.parts, "{}", ours.name);
        for (a, b) in ours.tree.joints.iter().zip(&theirs.tree.joints) {
            assert_eq!((&a.name, a.parent, a.child, a.screw.kind), (&b.name, b.parent, b.child, b.screw.kind));
            assert!((a.limits[0] - b.limits[0]).abs().max((a.limits[1] - b.limits[1]).abs()) < 1e-9, "{}", a.name);
            let apart = a.screw.axis.distance(b.screw.axis).max(a.screw.distance(b.screw.pivot));
            assert!(apart < 1e-9, "{}: {apart}", a.name);
        }
        for (part, (a, b)) in ours.parts.iter().zip(&theirs.parts).enumerate() {
            assert_eq!(a.faces.len(), b.faces.len(), "{} {part}", ours.name);
            let box_of = |v: &[Vec3]| v.iter().fold([Vec3::MAX, Vec3::MIN], |[lo, hi], x| [lo.min(*x), hi.max(*x)]);
            let (a, b) = (box_of(&a.vertices), box_of(&b.vertices));
            assert!(a[0].distance(b[0]).max(a[1].distance(b[1])) < 1e-5, "{} {part}: {a:?} {b:?}", ours.name);
        }
    }
}
