//! MJCF objects: frames, joints, shapes, defaults; and the project's own samples when they are
//! there.

use glam::{DQuat, DVec3};
use hingecast_capture::Truth;
use hingecast_capture::object::ArticulatedObject;
use hingecast_capture::synth::{SynthConfig, synth, useful_ranges};
use hingecast_geom::{Coupling, JointKind, Progress};

const LAMP: &str = r#"<mujoco model="lamp">
  <compiler angle="degree"/>
  <default><geom density="300"/><default class="arm"><geom type="capsule" size="0.01" rgba="0.2 0.2 0.2 1"/><joint axis="0 1 0" range="-90 90"/></default></default>
  <asset><material name="brass" rgba="0.8 0.6 0.2 1"/></asset>
  <worldbody>
    <geom type="plane" size="1 1 1"/>
    <body name="foot" pos="0 0 0.01">
      <geom type="cylinder" size="0.1 0.01" material="brass"/>
      <body name="lower" pos="0 0 0.01" childclass="arm">
        <joint name="shoulder"/>
        <geom fromto="0 0 0 0 0 0.3"/>
        <geom type="box" size="1 1 1" group="3"/>
        <body name="upper" pos="0 0 0.3" quat="0.7071067811865476 0 0.7071067811865476 0">
          <joint name="elbow" type="slide" axis="0 0 2" range="0 0.1"/>
          <geom fromto="0 0 0 0 0 0.2"/>
          <geom type="ellipsoid" size="0.05 0.04 0.03" pos="0 0 0.2" rgba="1 1 1 1"/>
        </body>
      </body>
    </body>
  </worldbody>
</mujoco>"#;

fn load(text: &str) -> Result<ArticulatedObject, hingecast_capture::CaptureError> {
    let dir = tempfile::tempdir().unwrap();
    let file = dir.path().join("object.xml");
    std::fs::write(&file, text).unwrap();
    ArticulatedObject::load(&file)
}

#[test]
fn nested_bodies_make_a_chain() {
    let lamp = load(LAMP).unwrap();
    assert_eq!(lamp.tree.parts, ["foot", "lower", "upper"]);
    let [shoulder, elbow] = &lamp.tree.joints[..] else { panic!("{:?}", lamp.tree.joints) };
    assert_eq!((shoulder.screw.kind, elbow.screw.kind), (JointKind::Revolute, JointKind::Prismatic));
    assert!((shoulder.limits[1] - 90f64.to_radians()).abs() < 1e-12 && elbow.limits == [0.0, 0.1]);
    assert!(shoulder.screw.pivot.distance(DVec3::new(0.0, 0.0, 0.02)) < 1e-12);
    // quat turns z into x: the upper arm lies along world x, and slides along it.
    assert!(elbow.screw.axis.distance(DVec3::X) < 1e-9, "{}", elbow.screw.axis);
    assert_eq!((elbow.parent, elbow.child), (1, 2));
    let (lo, hi) = lamp.bounds(&[0.0, 0.0]);
    assert!((hi - DVec3::new(0.23, 0.1, 0.37)).abs().max_element() < 1e-3, "{hi}");
    assert!((lo - DVec3::new(-0.1, -0.1, 0.0)).abs().max_element() < 1e-3, "{lo}");
    // Shoulder turned by 90 deg about y, slid by 0.1: the head was at (0.2, 0, 0.32).
    let head = lamp.tree.poses(&[90f64.to_radians(), 0.1])[2].apply(DVec3::new(0.2, 0.0, 0.32));
    let turned = DQuat::from_rotation_y(90f64.to_radians()) * DVec3::new(0.3, 0.0, 0.3) + DVec3::Z * 0.02;
    assert!(head.distance(turned) < 1e-9, "{head} {turned}");
    assert!(lamp.part_mesh(0).colors.iter().all(|c| *c == [204, 153, 51]));
}

const OVEN: &str = r#"<mujoco model="oven">
  <worldbody>
    <body name="case">
      <geom type="box" size="0.2 0.2 0.01" pos="0 0 0.01"/>
      <geom type="box" size="0.2 0.2 0.01" pos="0 0 0.39"/>
      <geom type="box" size="0.2 0.01 0.18" pos="0 0.19 0.2"/>
      <body name="door">
        <joint name="hinge" type="hinge" axis="0 0 1" pos="0.2 -0.21 0" range="0 90"/>
        <geom type="box" size="0.2 0.005 0.2" pos="0 -0.21 0.2"/>
      </body>
      <body name="rack">
        <joint name="slide" type="slide" axis="0 -1 0" range="0 0.3"/>
        <geom type="box" size="0.17 0.15 0.005" pos="0 0 0.2"/>
      </body>
    </body>
  </worldbody>
</mujoco>"#;

#[test]
fn a_rack_behind_a_door_is_played_once_the_door_is_open() {
    let oven = load(OVEN).unwrap();
    let ranges = useful_ranges(&oven);
    assert!(!ranges[0].behind && ranges[1].behind, "{ranges:?}");
    assert!(ranges[1].upper > 0.29, "{ranges:?}");
    let dir = tempfile::tempdir().unwrap();
    let out = dir.path().join("rec");
    let config = SynthConfig { states: 9, views: 1, test_views: 0, size: 16, ..SynthConfig::default() };
    synth(&oven, &config, &out, &Progress::default()).unwrap();
    let truth = Truth::open(&Truth::folder_of(&out)).unwrap();
    let [hinge, slide] = &truth.tree.joints[..] else { panic!("{:?}", truth.tree.joints) };
    assert!(slide.values[..9].iter().any(|q| *q > 0.29), "{:?}", slide.values);
    for (door, rack) in hinge.values.iter().zip(&slide.values) {
        assert!(*rack < 0.05 || *door > 1.0, "the rack goes through the door: {door} {rack}");
    }
}

#[test]
fn mistakes_are_named_with_file_and_line() {
    for (wrong, right, line) in [
        ("axis=\"0 0 0\"", "axis=\"0 0 2\"", "object.xml:14"),
        ("range=\"0.1 0\"", "range=\"0 0.1\"", "object.xml:14"),
        ("type=\"ball\"", "type=\"slide\"", "object.xml:14"),
        ("material=\"gold\"", "material=\"brass\"", "object.xml:8"),
        ("size=\"0.05 x 0.03\"", "size=\"0.05 0.04 0.03\"", "object.xml:16"),
    ] {
        let error = load(&LAMP.replace(right, wrong)).unwrap_err().to_string();
        assert!(error.contains(line) && error.lines().count() == 3, "{wrong}: {error}");
    }
    assert!(load("<mujoco><worldbody/></mujoco>").unwrap_err().to_string().contains("no visible surface"));
    assert!(load("<mujoco><worldbody>").unwrap_err().to_string().contains("not XML"));
    assert!(load("<sdf/>").unwrap_err().to_string().contains("<sdf>"));
}

#[test]
fn our_own_samples_load() {
    let folder = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../../objects");
    for entry in std::fs::read_dir(folder).into_iter().flatten().flatten().filter(|e| e.path().is_dir()) {
        let object = ArticulatedObject::load(&entry.path()).unwrap_or_else(|e| panic!("{e}"));
        assert!(!object.tree.joints.is_empty(), "{}", object.name);
    }
}

/// Inside itself, a class once was its own parent, and the loader looked for that parent for ever.
#[test]
fn a_default_class_inside_itself_is_refused() {
    let geom = r#"<worldbody><geom type="sphere" size="1"/></worldbody>"#;
    for defaults in [
        r#"<default><default class="a"><default class="a"/></default></default>"#,
        r#"<default><default class="main"/></default>"#,
        "<default><default/></default>",
    ] {
        let e = load(&format!("<mujoco>{defaults}{geom}</mujoco>")).unwrap_err();
        assert!(e.what.contains("there already") && e.place.contains("object.xml:1"), "{e}");
    }
    // Two top-level elements of one name are usual.
    load(&format!("<mujoco><default/><default/>{geom}</mujoco>")).unwrap();
}

#[test]
fn trees_that_are_too_deep_or_too_large_are_refused() {
    let nested = |n: usize| {
        let inner = r#"<geom type="sphere" size="0.1"/>"#;
        format!("<mujoco><worldbody>{}{inner}{}</worldbody></mujoco>", "<body>".repeat(n), "</body>".repeat(n))
    };
    load(&nested(200)).unwrap();
    let e = load(&nested(300)).unwrap_err();
    assert!(e.what.contains("levels deep"), "{e}");
    let body = r#"<body name="b"><joint axis="0 0 1"/><geom type="sphere" size="0.1"/></body>"#;
    let e = load(&format!("<mujoco><worldbody>{}</worldbody></mujoco>", body.repeat(2000))).unwrap_err();
    assert!(e.what.contains("at most 254"), "{e}");
}

/// Two joints that end in one link made the walk endless or exponential.
#[test]
fn a_urdf_link_is_the_child_of_one_joint() {
    let link = |name: &str| {
        let visual = r#"<visual><geometry><sphere radius="0.1"/></geometry></visual>"#;
        format!(r#"<link name="{name}">{visual}</link>"#)
    };
    let joint = |name: &str, parent: &str, child: &str| {
        let ends = format!(r#"<parent link="{parent}"/><child link="{child}"/>"#);
        format!(r#"<joint name="{name}" type="fixed">{ends}</joint>"#)
    };
    let links = ["root", "a", "b"].map(link).concat();
    let joints = |all: &[(&str, &str)]| -> String {
        all.iter().enumerate().map(|(i, (p, c))| joint(&format!("j{i}"), p, c)).collect()
    };
    let robot = |all: &[(&str, &str)]| load(&format!("<robot name=\"r\">{links}{}</robot>", joints(all)));
    robot(&[("root", "a"), ("a", "b")]).unwrap();
    for wrong in [&[("root", "a"), ("a", "b"), ("b", "a")][..], &[("root", "a"), ("root", "b"), ("a", "b")]] {
        let e = robot(wrong).unwrap_err();
        assert!(e.what.contains("child of two joints"), "{e}");
    }
}

/// Skipped in silence, each of these made another object of it.
#[test]
fn what_this_reader_does_not_understand_is_refused_with_its_line() {
    let base = |inner: &str| format!("<mujoco>\n{inner}\n<worldbody><geom size=\"0.1\"/></worldbody></mujoco>");
    let body = |inner: &str| format!("<mujoco>\n<worldbody><geom size=\"0.1\"/>{inner}</worldbody></mujoco>");
    let cases = [
        (body(r#"<frame pos="0 0 1"/>"#), "<frame>"),
        (body(r#"<include file="door.xml"/>"#), "<include>"),
        (body(r#"<replicate count="2"/>"#), "<replicate>"),
        (body(r#"<body><attach model="m"/></body>"#), "<attach>"),
        (body(r#"<body><joint ref="0.1"/></body>"#), "ref="),
        (body(r#"<body><joint limited="false"/></body>"#), "limited="),
        (body(r#"<geom type="capsule" mesh="m"/>"#), "fitted"),
        (base(r#"<compiler eulerseq="zyx"/>"#), "eulerseq="),
        (base(r#"<equality><joint joint1="a"/></equality>"#), "<equality>"),
        (base(r#"<asset><mesh name="m" vertex="0 0 0"/></asset>"#), "vertex="),
        (base(r#"<asset><mesh name="m" file="m.obj" refpos="0 0 1"/></asset>"#), "refpos="),
        (base("<deformable/>"), "<deformable>"),
    ];
    for (text, says) in cases {
        let e = load(&text).unwrap_err();
        assert!(e.what.contains(says) && e.place.contains("object.xml:2"), "{says}: {e}");
    }
}

#[test]
fn settings_add_up_and_ghosts_are_not_seen() {
    let settings = r#"<compiler angle="degree"/><compiler angle="radian"/>"#;
    let ghosts = r#"<geom size="9" rgba="1 0 0 0"/><geom size="9" material="air"/>"#;
    let asset = r#"<asset><material name="air" rgba="1 1 1 0"/></asset>"#;
    let body = r#"<body><joint range="-1.6 0"/><geom size="0.1"/></body>"#;
    let object = load(&format!("<mujoco>{settings}{asset}<worldbody>{ghosts}{body}</worldbody></mujoco>")).unwrap();
    assert_eq!(object.tree.joints[0].limits, [-1.6, 0.0]);
    assert!(object.diagonal() < 1.0, "{}", object.diagonal());
}

/// Two doors that open together: recorded so, whatever the play says, and only as far as both can.
#[test]
fn joints_that_follow_others_are_played_together() {
    let door = |name: &str, x: f64, range: &str| {
        let joint = format!(r#"<joint name="{name}" axis="0 0 1" range="{range}"/>"#);
        let leaf = format!(r#"<geom type="box" size="0.09 0.005 0.2" pos="{} -0.22 0.2"/>"#, -0.5 * x);
        format!(r#"<body name="{name}_door" pos="{x} 0 0">{joint}{leaf}</body>"#)
    };
    let case = r#"<geom type="box" size="0.2 0.2 0.01"/>"#;
    let doors = door("left", -0.2, "-90 0") + &door("right", 0.2, "0 45");
    let mut object = load(&format!("<mujoco><worldbody>{case}{doors}</worldbody></mujoco>")).unwrap();
    object.tree.couplings.push(Coupling { follower: 1, leader: 0, polynomial: [0.0, -1.0, 0.0, 0.0, 0.0] });
    let ranges = useful_ranges(&object);
    let open = ranges[0].lower.min(ranges[0].upper);
    assert!((open + 45f64.to_radians()).abs() < 0.02, "as far as the right one can: {ranges:?}");
    let dir = tempfile::tempdir().unwrap();
    let out = dir.path().join("rec");
    let mut config = SynthConfig { states: 5, views: 1, test_views: 0, size: 16, ..SynthConfig::default() };
    synth(&object, &config, &out, &Progress::default()).unwrap();
    let truth = Truth::open(&Truth::folder_of(&out)).unwrap();
    let [left, right] = &truth.tree.joints[..] else { panic!("{:?}", truth.tree.joints) };
    assert!(left.values.iter().any(|q| *q < -0.5), "{:?}", left.values);
    for (l, r) in left.values.iter().zip(&right.values) {
        assert!((l + r).abs() < 1e-12, "{l} {r}");
    }
    config.ranges.insert("right".into(), [0.0, 0.1]);
    let e = synth(&object, &config, &out, &Progress::default()).unwrap_err();
    assert!(e.what.contains("follows 'left'"), "{e}");
}
