//! URDF files as people have them: paths of packages, materials by name, encodings, xacro, joints
//! that are not complete.

mod common;

use glam::{DMat3, DVec3};
use hingecast_capture::object::ArticulatedObject;
use hingecast_geom::JointKind;
use std::fs;
use std::path::Path;

/// A door of 0.38 x 0.02 x 0.38 as ASCII STL would be long; a triangle does.
const STL: &str = "solid d\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 0.38 0 0\nvertex 0 0 0.38\nendloop\n\
                   endfacet\nendsolid d\n";
const OBJ: &str = "v 0 0 0\nv 0.4 0 0\nv 0 0 0.4\nf 1 2 3\n";
const HINGE: &str = r#"<joint name="hinge" type="revolute"><origin xyz="-0.19 -0.16 0"/><parent link="case"/>
    <child link="door"/><axis xyz="0 0 1"/><limit lower="-1.7" upper="0"/></joint>"#;

fn write(file: &Path, content: impl AsRef<[u8]>) {
    fs::create_dir_all(file.parent().unwrap()).unwrap();
    fs::write(file, content).unwrap();
}

fn mesh(file: &str) -> String {
    format!(r#"<visual><geometry><mesh filename="{file}"/></geometry></visual>"#)
}

/// A case and a door.
fn cabinet(case: &str, door: &str, rest: &str) -> String {
    format!(r#"<robot name="cabinet"><link name="case">{case}</link><link name="door">{door}</link>{rest}</robot>"#)
}

const BOX: &str = r#"<visual><geometry><box size="0.4 0.3 0.4"/></geometry></visual>"#;

fn load(file: &Path, urdf: impl AsRef<[u8]>) -> Result<ArticulatedObject, String> {
    write(file, urdf);
    ArticulatedObject::load(file).map_err(|e| e.to_string())
}

/// The three lines of the error.
fn refused(urdf: impl AsRef<[u8]>) -> String {
    let dir = tempfile::tempdir().unwrap();
    let error = load(&dir.path().join("cabinet.urdf"), urdf).expect_err("it should be refused");
    assert_eq!(error.lines().count(), 3, "{error}");
    error
}

fn loaded(urdf: impl AsRef<[u8]>) -> ArticulatedObject {
    let dir = tempfile::tempdir().unwrap();
    load(&dir.path().join("cabinet.urdf"), urdf).unwrap()
}

/// Was looked for in urdf/cabinet_description/meshes; backslashes were part of the name.
#[test]
fn meshes_are_found_by_package_and_by_backslashes() {
    let dir = tempfile::tempdir().unwrap();
    let package = dir.path().join("cabinet_description");
    write(&package.join("meshes/case.obj"), OBJ);
    write(&package.join("meshes/my door.stl"), STL);
    let by_package =
        |p: &str| cabinet(&mesh(&format!("package://{p}/meshes/case.obj")), &mesh("..\\meshes\\my door.stl"), HINGE);
    let object = load(&package.join("urdf/object.urdf"), by_package("cabinet_description")).unwrap();
    let joint = &object.tree.joints[0];
    assert_eq!(joint.limits, [-1.7, 0.0]);
    assert!(joint.screw.pivot.distance(DVec3::new(-0.19, -0.16, 0.0)) < 1e-12 && joint.screw.axis == DVec3::Z);
    assert_eq!(object.parts[1].faces.len(), 1);
    // Under another name than the folder's.
    write(&package.join("package.xml"), "<package><name>cabinet</name></package>");
    load(&package.join("urdf/object.urdf"), by_package("cabinet")).unwrap();
    let error = load(&package.join("urdf/object.urdf"), cabinet(&mesh("package://cabinet/no.obj"), BOX, HINGE));
    let error = error.unwrap_err();
    assert!(error.contains("the mesh file is not there") && error.contains("ROS_PACKAGE_PATH"), "{error}");
    assert!(error.contains("object.urdf:1: <mesh>"), "{error}");
}

/// The door was empty and "moved".
#[test]
fn what_moves_has_a_surface() {
    let error = refused(cabinet(BOX, "", HINGE));
    assert!(error.contains("'door'") && error.contains("'hinge'") && error.contains("no visible surface"), "{error}");
    let flat = r#"<visual><geometry><box size="0 0 0"/></geometry></visual>"#;
    assert!(refused(cabinet(BOX, flat, HINGE)).contains("'door'"));
    // Two joints in a row, with nothing between them.
    let rest = format!(
        r#"{HINGE}<link name="lid">{BOX}</link><joint name="slide" type="prismatic"><parent link="door"/>
           <child link="lid"/><limit lower="0" upper="0.1"/></joint>"#
    );
    assert_eq!(loaded(cabinet(BOX, "", &rest)).tree.joints.len(), 2);
    let far = r#"<visual><origin xyz="0 0 1e30"/><geometry><box size="1 1 1"/></geometry></visual>"#;
    assert!(refused(cabinet(BOX, far, HINGE)).contains("reaches farther"));
}

/// The door was grey.
#[test]
fn materials_are_found_wherever_they_are_defined() {
    let dir = tempfile::tempdir().unwrap();
    let visual = |material: &str| BOX.replace("</visual>", &format!("{material}</visual>"));
    let (named, red) = (r#"<material name="red"/>"#, r#"<material name="red"><color rgba="1 0 0 1"/></material>"#);
    let colors = |object: &ArticulatedObject| {
        object.parts.iter().map(|p| object.materials[p.materials[0] as usize].color).collect::<Vec<_>>()
    };
    for urdf in [
        cabinet(&visual(red), &visual(named), HINGE),
        cabinet(&visual(named), &visual(red), HINGE),
        cabinet(&visual(named), &visual(named), &format!("{HINGE}{red}")),
    ] {
        let object = loaded(urdf);
        assert_eq!(colors(&object), [[1.0, 0.0, 0.0]; 2]);
        assert!(object.notes.is_empty(), "{:?}", object.notes);
    }
    let object = loaded(cabinet(&visual(named), BOX, HINGE));
    assert_eq!(colors(&object), [[0.7; 3]; 2]);
    assert!(object.notes[0].contains("material red is defined nowhere"), "{:?}", object.notes);

    image::RgbImage::new(2, 2).save(dir.path().join("wood.png")).unwrap();
    let wood = r#"<material name="wood"><texture filename="wood.png"/></material>"#;
    let lost = r#"<material name="lost"><color rgba="0 1 0 1"/><texture filename="lost.png"/></material>"#;
    let object = load(&dir.path().join("a.urdf"), cabinet(&visual(wood), &visual(lost), HINGE)).unwrap();
    let looks: Vec<_> = object.parts.iter().map(|p| object.materials[p.materials[0] as usize]).collect();
    assert_eq!((looks[0].texture, looks[1].texture), (Some(0), None));
    assert_eq!((looks[0].color, looks[1].color), ([1.0; 3], [0.0, 1.0, 0.0]));
    assert!(object.notes.len() == 1 && object.notes[0].contains("lost.png is not there"), "{:?}", object.notes);
}

/// Was "no visible surface ... correct the links and joints".
#[test]
fn unexpanded_xacro_says_how_to_expand_it() {
    let space = r#"<robot name="oven" xmlns:xacro="http://www.ros.org/wiki/xacro">"#;
    let good = cabinet(BOX, BOX, HINGE).replace(r#"<robot name="cabinet">"#, space);
    let with = |more: &str| good.replace("</robot>", &format!("{more}</robot>"));
    for text in [
        with(r#"<xacro:property name="w" value="0.4"/>"#),
        with(r#"<xacro:door/>"#).replace(r#" xmlns:xacro="http://www.ros.org/wiki/xacro""#, ""),
        with(r#"<material name="a"><color rgba="${r} 0 0 1"/></material>"#),
        with(r#"<link name="a"><visual><geometry><mesh filename="$(find oven)/a.stl"/></geometry></visual></link>"#),
    ] {
        let error = refused(text);
        assert!(error.contains("xacro cabinet.xacro > cabinet.urdf"), "{error}");
    }
    // Expanded files keep the namespace.
    loaded(good);
}

#[test]
fn other_encodings_are_read_or_named() {
    let with = |encoding: &str| {
        let urdf = cabinet(BOX, BOX, HINGE).replace("\"cabinet\"", "\"Schr\u{e4}nkchen\"");
        let urdf = format!(r#"<?xml version="1.0" encoding="{encoding}"?>{urdf}"#);
        urdf.chars().map(|c| c as u8).collect::<Vec<u8>>()
    };
    assert_eq!(loaded(with("ISO-8859-1")).name, "Schr\u{e4}nkchen");
    let error = refused(with("windows-1251"));
    assert!(error.contains("encoding windows-1251") && error.contains("save it as UTF-8"), "{error}");
}

#[test]
fn joints_are_complete_or_named() {
    for (kind, hint) in [("revolute", "continuous"), ("prismatic", "upper=")] {
        let joint = HINGE.replace("revolute", kind).replace(r#"<limit lower="-1.7" upper="0"/>"#, "");
        let error = refused(format!("\n{}", cabinet(BOX, BOX, &joint)));
        assert!(error.contains("has no <limit>") && error.contains(hint) && error.contains(".urdf:2:"), "{error}");
    }
    for kind in ["planar", "floating"] {
        let error = refused(cabinet(BOX, BOX, &HINGE.replace("revolute", kind)));
        assert!(error.contains(kind) && error.contains(".urdf:1:"), "{error}");
    }
    let still = loaded(cabinet(BOX, BOX, &HINGE.replace("-1.7", "0")));
    assert_eq!(still.tree.joints[0].limits, [0.0, 0.0]);
    assert!(still.notes[0].contains("'hinge' does not move"), "{:?}", still.notes);
    let capsule = r#"<visual><geometry><capsule radius="0.1" length="0.4"/></geometry></visual>"#;
    let object = loaded(cabinet(BOX, capsule, HINGE));
    let (lo, hi) = object.parts[1].vertices.iter().fold((0f32, 0f32), |(lo, hi), v| (lo.min(v.z), hi.max(v.z)));
    assert!((lo + 0.3).abs() < 1e-6 && (hi - 0.3).abs() < 1e-6, "{lo} {hi}");
}

#[test]
fn followers_follow_the_joint_that_leads() {
    let joint = |name: &str, mimic: &str| {
        format!(
            r#"<link name="l_{name}">{BOX}</link><joint name="{name}" type="continuous"><parent link="case"/>
               <child link="l_{name}"/>{mimic}</joint>"#
        )
    };
    let chain = joint("c", r#"<mimic joint="b" multiplier="2" offset="1"/>"#)
        + &joint("b", r#"<mimic joint="a" multiplier="-3" offset="0.5"/>"#)
        + &joint("a", "");
    let tree = loaded(cabinet(BOX, BOX, &format!("{HINGE}{chain}"))).tree;
    let led: Vec<_> =
        tree.couplings.iter().map(|c| (&*tree.joints[c.follower].name, &*tree.joints[c.leader].name)).collect();
    assert_eq!(led, [("c", "a"), ("b", "a")]);
    // 2 (-3 a + 0.5) + 1
    assert_eq!([0, 1].map(|k| tree.couplings[k].line().unwrap()), [[2.0, -6.0], [0.5, -3.0]]);
    let fixed = joint("a", "").replace("continuous", "fixed") + &joint("b", r#"<mimic joint="a" offset="0.5"/>"#);
    let object = loaded(cabinet(BOX, BOX, &format!("{HINGE}{fixed}")));
    assert_eq!((object.tree.couplings.len(), object.tree.joints[1].limits), (0, [0.5, 0.5]));
    assert!(object.notes[0].contains("follows 'a', which is fixed"), "{:?}", object.notes);
    let circle = joint("b", r#"<mimic joint="a"/>"#) + &joint("a", r#"<mimic joint="b"/>"#);
    assert!(refused(cabinet(BOX, BOX, &format!("{HINGE}{circle}"))).contains("in a circle"));
    let itself = joint("a", r#"<mimic joint="a"/>"#);
    assert!(refused(cabinet(BOX, BOX, &format!("{HINGE}{itself}"))).contains("in a circle"));
    let nobody = joint("a", r#"<mimic joint="z"/>"#);
    assert!(refused(cabinet(BOX, BOX, &format!("{HINGE}{nobody}"))).contains("z, which is not there"));
}

/// Their makers say to leave out the meshes that were never part of the data set.
#[test]
fn partnet_meshes_that_never_existed_are_left_out() {
    let dir = tempfile::tempdir().unwrap();
    write(&dir.path().join("textured_objs/a.obj"), OBJ);
    let there = mesh("textured_objs/a.obj");
    let both = format!("{there}{}", mesh("textured_objs/b.obj"));
    let urdf = cabinet(&there, &both, HINGE);
    let error = load(&dir.path().join("mobility.urdf"), &urdf).unwrap_err();
    assert!(error.contains("the mesh file is not there") && error.contains("b.obj"), "{error}");
    write(&dir.path().join("mobility_v2.json"), "[]");
    let object = ArticulatedObject::load(dir.path()).unwrap();
    assert_eq!(object.notes, ["left out, as the data set never had these meshes: textured_objs/b.obj"]);
    assert_eq!((object.tree.joints.len(), object.parts[1].faces.len()), (1, 1));
    // A joint of which nothing is left.
    let urdf = cabinet(&there, &mesh("textured_objs/b.obj"), HINGE);
    let object = load(&dir.path().join("mobility.urdf"), &urdf).unwrap();
    assert!(object.tree.joints.is_empty() && object.parts.len() == 1);
    assert!(object.notes.iter().any(|n| n.contains("'hinge' stays at 0")), "{:?}", object.notes);
}

/// Origin and rows of the rotation of every part's first link, with the joints at 0.
const AT_ZERO: [([f64; 3], [[f64; 3]; 3]); 4] = [
    (
        [0.000000000, 0.000000000, 0.000000000],
        [
            [1.000000000, 0.000000000, 0.000000000],
            [0.000000000, 1.000000000, 0.000000000],
            [0.000000000, 0.000000000, 1.000000000],
        ],
    ),
    (
        [0.100000000, 0.200000000, 0.300000000],
        [
            [0.724300143, -0.674157922, -0.144569699],
            [0.495520388, 0.654767330, -0.570735743],
            [0.479425539, 0.341746746, 0.808307067],
        ],
    ),
    (
        [0.027715150, -0.085367871, 0.704153533],
        [
            [0.986862987, 0.125719905, 0.101468963],
            [0.127758540, -0.222843532, -0.966446334],
            [-0.098889839, 0.966713642, -0.235977825],
        ],
    ),
    (
        [0.046662440, -0.197611552, 0.748225706],
        [
            [0.125719905, -0.986862987, 0.101468963],
            [-0.222843532, -0.127758540, -0.966446334],
            [0.966713642, 0.098889839, -0.235977825],
        ],
    ),
];
/// The same with the joints moved.
const YOURDFPY: [([f64; 3], [[f64; 3]; 3]); 4] = [
    (
        [0.000000000, 0.000000000, 0.000000000],
        [
            [1.000000000, 0.000000000, 0.000000000],
            [0.000000000, 1.000000000, 0.000000000],
            [0.000000000, 0.000000000, 1.000000000],
        ],
    ),
    (
        [0.100000000, 0.200000000, 0.300000000],
        [
            [0.581285301, -0.813684191, -0.005043431],
            [0.729475151, 0.523853604, -0.439822016],
            [0.360518240, 0.251983015, 0.898070798],
        ],
    ),
    (
        [0.164081414, -0.207928251, 0.734422411],
        [
            [0.927002532, 0.172530815, 0.333015651],
            [0.340587495, -0.015429408, -0.940086215],
            [-0.157055607, 0.984883268, -0.073064938],
        ],
    ),
    (
        [0.209460137, -0.303016931, 0.796057746],
        [
            [0.172530815, -0.123698754, 0.977206087],
            [-0.015429408, -0.992300921, -0.122885378],
            [0.984883268, 0.006123803, -0.173111086],
        ],
    ),
];

/// The same robot in three orders of its elements moves alike. The figures are yourdfpy 0.0.60's
/// (`URDF.load(file, load_meshes=False)`, `update_cfg`, `get_transform(link)`), at a = 0.3,
/// b = -0.2, c = 1.1.
#[test]
fn kinematics_do_not_depend_on_the_order() {
    let link = |name: &str| format!(r#"<link name="{name}">{BOX}</link>"#);
    let joint = |name: &str, kind: &str, ends: [&str; 2], rest: &str| {
        let [parent, child] = ends;
        format!(r#"<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{child}"/>{rest}</joint>"#)
    };
    let elements = [
        link("base"),
        joint(
            "a",
            "revolute",
            ["base", "arm"],
            r#"<origin xyz="0.1 0.2 0.3" rpy="0.4 -0.5 0.6"/><axis xyz="0 1 1"/><limit lower="-1" upper="1"/>"#,
        ),
        link("arm"),
        joint(
            "b",
            "prismatic",
            ["arm", "hand"],
            r#"<axis xyz="0 0 -1"/><origin rpy="1.2 0.3 -0.7" xyz="0 0 0.5"/><limit lower="-1" upper="1"/>"#,
        ),
        link("hand"),
        joint("weld", "fixed", ["hand", "palm"], r#"<origin xyz="0 0.05 0" rpy="0 0 1.5707963267948966"/>"#),
        link("palm"),
        joint("c", "continuous", ["palm", "tip"], r#"<origin xyz="0.02 0 0.1"/>"#),
        link("tip"),
    ];
    for order in [[0, 1, 2, 3, 4, 5, 6, 7, 8], [8, 7, 6, 5, 4, 3, 2, 1, 0], [7, 3, 5, 8, 1, 0, 6, 4, 2]] {
        let urdf: String = order.iter().map(|i| elements[*i].as_str()).collect();
        let object = loaded(format!(r#"<robot name="r">{urdf}</robot>"#));
        assert_eq!(object.tree.parts, ["base", "arm", "hand", "tip"], "{order:?}");
        let names: Vec<&str> = object.tree.joints.iter().map(|j| j.name.as_str()).collect();
        assert_eq!(names, ["a", "b", "c"]);
        assert_eq!(object.tree.joints[2].screw.kind, JointKind::Continuous);
        let poses = object.tree.poses(&[0.3, -0.2, 1.1]);
        for (part, (trans, rot)) in YOURDFPY.iter().enumerate() {
            // Parts stand in the world at 0; a pose says where they went.
            let (origin, axes) = AT_ZERO[part];
            let (origin, axes) = (DVec3::from(origin), DMat3::from_cols_array_2d(&axes).transpose());
            assert!(poses[part].apply(origin).distance(DVec3::from(*trans)) < 1e-6, "{order:?} {part}");
            let turned = DMat3::from_quat(poses[part].rot) * axes;
            let expected = DMat3::from_cols_array_2d(rot).transpose();
            assert!(turned.abs_diff_eq(expected, 1e-6), "{order:?} {part}: {turned} {expected}");
        }
    }
}
