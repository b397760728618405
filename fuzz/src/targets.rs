//! The readers: of each a small valid folder, the files in it that get damaged, and the reading.

use crate::samples::{DAE, GLTF, MESHES, MJCF, MTL, OBJ, STL, URDF};
use glam::{DVec3, Vec3};
use hingecast::artifacts::{Extent, Groups, Joints, Parts, Placed, Splats, TwinFile, samples, tracks};
use hingecast::stage::RunFolder;
use hingecast::{Config, Preset};
use hingecast_capture::object::ArticulatedObject;
use hingecast_capture::recording::images;
use hingecast_capture::{CaptureError, Recording, Truth, check, import};
use hingecast_geom::{Gaussians, Joint, JointKind, KinematicTree, Pose, Progress, Screw, TriMesh};
use hingecast_policy::net::{NetConfig, Network};
use hingecast_policy::{Demos, Episode, ObsKey, Policy, PolicyConfig, demos};
use serde_json::json;
use std::collections::BTreeMap;
use std::fs::{create_dir_all, write};
use std::path::Path;

/// A reader under test.
pub struct Target {
    /// What the command line calls it.
    pub name: &'static str,
    /// Makes the folder, all of it valid.
    pub make: fn(&Path),
    /// Files in it that get damaged, one at a time.
    pub damage: &'static [&'static str],
    /// Reads the folder as the program would.
    pub read: fn(&Path) -> Result<(), String>,
}

/// All of them, the quick ones first.
pub const TARGETS: &[Target] = &[
    Target { name: "ply_mesh", make: ply_mesh, damage: &["a.ply", "b.ply"], read: read_ply_mesh },
    Target { name: "ply_gaussians", make: ply_gaussians, damage: &["g.ply"], read: read_ply_gaussians },
    Target { name: "npy", make: npy, damage: &["a.npy"], read: read_npy },
    Target { name: "depth_png", make: pictures, damage: &["depth.png", "color.png"], read: read_pictures },
    Target { name: "obj", make: object, damage: &["lid.obj", "lid.mtl"], read: read_urdf },
    Target { name: "meshes", make: meshes, damage: &["a.stl", "a.dae", "a.gltf"], read: read_urdf },
    Target { name: "urdf", make: object, damage: &["robot.urdf"], read: read_urdf },
    Target { name: "mjcf", make: object, damage: &["object.xml"], read: read_mjcf },
    Target { name: "recording", make: recording, damage: &["transforms.json"], read: read_recording },
    Target { name: "check", make: recording, damage: &["transforms.json"], read: read_check },
    Target { name: "import", make: recording, damage: &["transforms.json"], read: read_import },
    Target { name: "demos", make: demonstrations, damage: &["demos.hdf5"], read: read_demos },
    Target { name: "policy", make: policy, damage: &["policy.json", "policy.safetensors"], read: read_policy },
    Target { name: "truth", make: truth, damage: &["truth.json"], read: read_truth },
    Target { name: "config", make: config, damage: &["config.toml"], read: read_config },
    Target {
        name: "run",
        make: run,
        damage: &[
            "run.json",
            "parts/parts.json",
            "parts/samples.ply",
            "splat/extent.json",
            "splat/placed.json",
            "joints/joints.json",
            "twin/twin.json",
        ],
        read: read_run,
    },
    Target { name: "run_track", make: run_track, damage: &["parts/parts.json", "state_000.ply"], read: read_run_track },
];

fn text(e: impl std::fmt::Display) -> String {
    e.to_string()
}

/// A chest with a lid: two parts, one hinge with a value in each of two states.
fn chest() -> KinematicTree {
    let screw = Screw { kind: JointKind::Revolute, axis: DVec3::X, pivot: DVec3::new(0.0, 0.1, 0.2) };
    let (name, values, limits) = ("lid_hinge".to_string(), vec![0.0, 0.9], [0.0, 1.9]);
    KinematicTree {
        parts: vec!["chest".into(), "lid".into()],
        joints: vec![Joint { name, parent: 0, child: 1, screw, values, limits }],
        ..Default::default()
    }
}

fn box_mesh() -> TriMesh {
    let mut mesh = TriMesh::cuboid(Vec3::ZERO, Vec3::ONE);
    mesh.colors = (0..mesh.vertices.len()).map(|i| [i as u8 * 30, 7, 200]).collect();
    mesh
}

fn few_gaussians() -> Gaussians {
    Gaussians {
        means: vec![[1.0, 2.0, 3.0], [4.0, 5.0, 6.0]],
        quats: vec![[1.0, 0.0, 0.0, 0.0], [0.5, 0.5, 0.5, 0.5]],
        scales: vec![[-3.0, -4.0, -5.0]; 2],
        opacities: vec![2.0, -1.0],
        sh0: vec![[0.1, 0.2, 0.3]; 2],
        sh1: vec![[[0.1, 0.2, 0.3], [0.4, 0.5, 0.6], [0.7, 0.8, 0.9]]; 2],
    }
}

const ASCII_PLY: &str = "ply\nformat ascii 1.0\ncomment by hand\nelement vertex 4\nproperty double x\nproperty \
double y\nproperty float z\nproperty uchar red\nproperty uchar green\nproperty uchar blue\nelement face 2\nproperty \
list uchar int vertex_indices\nend_header\n0 0 0 1 2 3\n1 0 0 4 5 6\n1 1 0 7 8 9\n0 1 0.5 9 9 9\n3 0 1 2\n4 0 1 2 3\n";

fn ply_mesh(at: &Path) {
    create_dir_all(at).unwrap();
    box_mesh().write_ply(&at.join("a.ply")).unwrap();
    write(at.join("b.ply"), ASCII_PLY).unwrap();
}

fn read_ply_mesh(at: &Path) -> Result<(), String> {
    for name in ["a.ply", "b.ply"] {
        let mesh = TriMesh::read_ply(&at.join(name)).map_err(text)?;
        assert!(mesh.faces.iter().flatten().all(|i| (*i as usize) < mesh.vertices.len()));
        assert!(mesh.colors.is_empty() || mesh.colors.len() == mesh.vertices.len());
    }
    Ok(())
}

fn ply_gaussians(at: &Path) {
    create_dir_all(at).unwrap();
    few_gaussians().write_ply(&at.join("g.ply")).unwrap();
}

fn read_ply_gaussians(at: &Path) -> Result<(), String> {
    let g = Gaussians::read_ply(&at.join("g.ply")).map_err(text)?;
    let n = g.means.len();
    assert!([g.quats.len(), g.scales.len(), g.opacities.len(), g.sh0.len()] == [n; 4]);
    assert!(g.sh1.is_empty() || g.sh1.len() == n);
    Ok(())
}

fn npy(at: &Path) {
    create_dir_all(at).unwrap();
    let mut header = "{'descr': '<f4', 'fortran_order': False, 'shape': (3, 4), }".to_string();
    header += &" ".repeat(117 - header.len());
    header.push('\n');
    let mut bytes = b"\x93NUMPY\x01\x00\x76\x00".to_vec();
    bytes.extend(header.bytes());
    bytes.extend((0..12).flat_map(|i| (i as f32).to_le_bytes()));
    write(at.join("a.npy"), bytes).unwrap();
}

fn read_npy(at: &Path) -> Result<(), String> {
    let (values, w, h) = images::read_depth(&at.join("a.npy")).map_err(text)?;
    assert_eq!(Some(values.len()), w.checked_mul(h), "numbers and shape");
    Ok(())
}

const W: usize = 8;
const H: usize = 6;

fn pictures(at: &Path) {
    create_dir_all(at).unwrap();
    let rgb: Vec<u8> = (0..3 * W * H).map(|i| i as u8).collect();
    let depth: Vec<u16> = (0..W * H).map(|i| 900 + i as u16).collect();
    let mask: Vec<u8> = (0..W * H).map(|i| if i % 5 == 0 { 0 } else { 255 }).collect();
    images::write_rgb(&at.join("color.png"), &rgb, W, H).unwrap();
    images::write_depth(&at.join("depth.png"), &depth, W, H).unwrap();
    images::write_gray(&at.join("mask.png"), &mask, W, H).unwrap();
}

fn read_pictures(at: &Path) -> Result<(), String> {
    let (values, w, h) = images::read_depth(&at.join("depth.png")).map_err(text)?;
    assert_eq!(values.len(), w * h);
    images::read(&at.join("color.png")).map(|_| ()).map_err(text)
}

/// Two states of three views each, around the origin.
fn recording(at: &Path) {
    pictures(at);
    let frame = |state: usize, view: usize| {
        let (s, c) = (view as f64 + 0.3 * state as f64).sin_cos();
        json!({
            "file_path": "color.png", "depth_file_path": "depth.png", "mask_path": "mask.png",
            "state": state, "view": view, "time": 0.5, "occluded": false,
            "transform_matrix": [[c, 0.0, s, s], [s, 0.0, -c, -c], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 0.0, 1.0]],
        })
    };
    let frames: Vec<_> = (0..6).map(|i| frame(i / 3, i % 3)).collect();
    let all = json!({
        "name": "chest", "metric": true, "up": [0, 0, 1], "camera_model": "OPENCV", "k1": 0.0,
        "fl_x": 10.0, "fl_y": 10.0, "cx": 4.0, "cy": 3.0, "w": W, "h": H, "depth_unit_scale_factor": 0.001,
        "test_filenames": ["none.png"], "frames": frames,
    });
    write(at.join("transforms.json"), serde_json::to_string_pretty(&all).unwrap()).unwrap();
}

fn read_recording(at: &Path) -> Result<(), String> {
    let recording = Recording::open(at).map_err(text)?;
    (0..recording.frames.len().min(8)).try_for_each(|i| recording.load(i).map(|_| ()).map_err(text))
}

fn read_check(at: &Path) -> Result<(), String> {
    check::check(at, &Progress::default()).map(|_| ()).map_err(text)
}

fn read_import(at: &Path) -> Result<(), String> {
    let out = at.with_extension("imported");
    let _ = std::fs::remove_dir_all(&out);
    let config = import::Config { format: import::Format::Nerfstudio, ..Default::default() };
    let answer = import::import(&[at], &out, &config, &Progress::default());
    let _ = std::fs::remove_dir_all(&out);
    answer.map(|_| ()).map_err(text)
}

fn object(at: &Path) {
    pictures(at);
    for (name, content) in [("robot.urdf", URDF), ("object.xml", MJCF), ("lid.obj", OBJ), ("lid.mtl", MTL)] {
        write(at.join(name), content).unwrap();
    }
}

fn meshes(at: &Path) {
    pictures(at);
    for (name, content) in [("robot.urdf", MESHES), ("a.stl", STL), ("a.dae", DAE), ("a.gltf", GLTF)] {
        write(at.join(name), content).unwrap();
    }
}

fn read_object(path: &Path) -> Result<(), String> {
    let object = ArticulatedObject::load(path).map_err(text)?;
    object.tree.validate().expect("a tree that was read is one");
    object.diagonal();
    (0..object.parts.len()).for_each(|part| drop(object.part_mesh(part)));
    Ok(())
}

fn read_urdf(at: &Path) -> Result<(), String> {
    read_object(&at.join("robot.urdf"))
}

fn read_mjcf(at: &Path) -> Result<(), String> {
    read_object(&at.join("object.xml"))
}

fn demonstrations(at: &Path) {
    create_dir_all(at).unwrap();
    let rows = |width: usize| (0..4).map(|i| vec![0.1 * i as f64; width]).collect::<Vec<_>>();
    let obs = BTreeMap::from([("eef_pos".to_string(), rows(3)), ("joint".to_string(), rows(1))]);
    let episode = Episode {
        model_file: "<mujoco/>".into(),
        actions: vec![[0.5; 7]; 4],
        states: rows(5),
        rewards: vec![0.0, 0.0, 0.0, 1.0],
        dones: vec![false, false, false, true],
        next_obs: obs.clone(),
        obs,
    };
    let masks = BTreeMap::from([("train".to_string(), vec!["demo_0".to_string()])]);
    let env_args = json!({"env_name": "open", "type": 1, "env_kwargs": {}});
    demos::write(&at.join("demos.hdf5"), &Demos { env_args, episodes: vec![episode; 2], masks }).unwrap();
}

fn read_demos(at: &Path) -> Result<(), String> {
    demos::read(&at.join("demos.hdf5")).map(|_| ()).map_err(text)
}

fn policy(at: &Path) {
    let net = NetConfig { rnn_layers: 1, rnn_hidden: 4, num_modes: 2, actor_layer_dims: vec![3], ..Default::default() };
    let obs = vec![ObsKey { key: "eef_pos".into(), width: 3 }];
    let parameters = Network::new(&net, 3).initial_parameters(0);
    Policy::new(PolicyConfig::new(obs, 10, net, None, 5), parameters).unwrap().save(at).unwrap();
}

fn read_policy(at: &Path) -> Result<(), String> {
    let policy = Policy::load(at).map_err(text)?;
    let obs = BTreeMap::from([("eef_pos".to_string(), vec![0.1; 3])]);
    policy.input(&obs).map(|_| ()).map_err(text)
}

fn truth(at: &Path) {
    create_dir_all(at.join("parts")).unwrap();
    let truth = Truth {
        root: at.to_path_buf(),
        object: "chest".into(),
        tree: chest(),
        diagonal: 0.4,
        n_states: 2,
        source_limits: vec![[0.0, 1.9]],
        cameras: Vec::new(),
    };
    write(at.join("truth.json"), serde_json::to_string_pretty(&truth).unwrap()).unwrap();
    chest().parts.iter().for_each(|name| box_mesh().write_ply(&at.join(format!("parts/{name}.ply"))).unwrap());
}

fn read_truth(at: &Path) -> Result<(), String> {
    let truth = Truth::open(at).map_err(text)?;
    truth.part_meshes().map(|_| ()).map_err(|e: CaptureError| e.to_string())
}

const CONFIG: &str = "seed = 3\nmemory_mb = 500\n\n[fit]\ngaussians = 12000\nsteps = 1500\n\n[screw]\ncells = 72\n\n[twin]\n\
density = 700.0\n\n[[joint]]\njoint = \"joint_1\"\nlimits = [0.0, 90.0]\naxis = [0, 0, 1]\n";

fn config(at: &Path) {
    create_dir_all(at).unwrap();
    write(at.join("config.toml"), CONFIG).unwrap();
}

fn read_config(at: &Path) -> Result<(), String> {
    Config::resolve(Preset::Fast, Some(&at.join("config.toml")), &[]).map(|_| ()).map_err(text)
}

fn run(at: &Path) {
    ["parts", "splat", "joints", "twin"].iter().for_each(|stage| create_dir_all(at.join(stage)).unwrap());
    let record = json!({
        "version": "0.1.0", "recording": "rec", "fingerprint": "0", "threads": 2, "doubts": ["it is dark"],
        "stages": [{ "name": "parts", "stamp": "1", "secs": 1.5, "peak_memory": 1000, "files": [] }],
    });
    write(at.join("run.json"), record.to_string()).unwrap();
    let certainty =
        hingecast_geom::Certainty { axis_deg: 0.1, pivot: 0.1, value: 0.1, rival: JointKind::Prismatic, nats: 5.0 };
    let parts = Parts {
        tree: chest(),
        cameras: BTreeMap::from([(0, Pose::IDENTITY), (1, Pose::IDENTITY)]),
        report: Default::default(),
        certainty: vec![certainty],
        information: Vec::new(),
        doubts: vec!["it is dark".into()],
        lo: [0.0; 3],
        hi: [1.0; 3],
        voxel: 0.01,
        doubted: Vec::new(),
    };
    parts.write(&at.join("parts"), &[]).unwrap();
    let header = "ply\nformat ascii 1.0\nelement vertex 2\n";
    let columns = ["x", "y", "z", "state", "part"].map(|name| format!("property float {name}\n")).concat();
    write(at.join("parts/samples.ply"), format!("{header}{columns}end_header\n0 0 0 0 0\n1 0 0 1 1\n")).unwrap();
    let placed =
        Placed { parts: vec![0, 1], tree: chest(), state_from_world: vec![Pose::IDENTITY; 2], nats: [10.0, 5.0] };
    let extent = Extent { lo: [0.0; 3], hi: [1.0; 3], diagonal: 1.7 };
    let splats = Splats { gaussians: few_gaussians(), extent, placed: Some(placed) };
    splats.write(&at.join("splat")).unwrap();
    let joints = Joints { tree: chest(), labels: vec![0, 1], doubts: Vec::new(), certainty: vec![Some(certainty)] };
    joints.write(&at.join("joints")).unwrap();
    let part = |name: &str| {
        json!({
            "name": name, "link_origin": [0.0, 0.0, 0.1], "visual": format!("{name}.obj"), "collision": ["a.stl"],
            "mass": 1.0, "volume": 0.1, "open_edges": 0, "faces": 12,
        })
    };
    let twin = json!({
        "name": "chest", "diagonal": 0.4, "tree": chest(), "doubts": [], "certainty": [certainty],
        "parts": [part("chest"), part("lid")],
    });
    write(at.join("twin/twin.json"), serde_json::to_string_pretty(&twin).unwrap()).unwrap();
    chest().parts.iter().for_each(|name| box_mesh().write_ply(&at.join(format!("twin/{name}.ply"))).unwrap());
}

/// As the verbs that go on with a run read it. Whatever was read must be usable: poses, labels.
fn read_run(at: &Path) -> Result<(), String> {
    RunFolder::open(at).map_err(text)?;
    let parts = Parts::read(at).map_err(text)?;
    let samples = samples::read(at, &parts.tree).map_err(text)?;
    samples::canonical_points(&samples, &parts.tree, 100);
    let splats = Splats::read(at).map_err(text)?;
    let joints = Joints::read(at).map_err(text)?;
    joints.fit(at, 2, splats.gaussians.len()).map_err(text)?;
    let twin = TwinFile::read(at).map_err(text)?;
    twin.fits(at, 2, &joints.tree).map_err(text)?;
    (0..2).for_each(|state| drop(twin.tree.poses_at(state)));
    twin.meshes(&at.join("twin")).map(|_| ()).map_err(text)
}

fn run_track(at: &Path) {
    create_dir_all(at.join("parts")).unwrap();
    let groups = Groups { labels: vec![0, 1], motions: vec![vec![Pose::IDENTITY; 2]; 2], silhouettes: vec![(2, 0.5)] };
    groups.write(&at.join("parts")).unwrap();
    let g = few_gaussians();
    (0..2).for_each(|state| tracks::save_state(at, state, &g.means, &g.quats).unwrap());
}

fn read_run_track(at: &Path) -> Result<(), String> {
    Groups::read(at).map_err(text)?;
    tracks::read_states(at).map(|_| ()).map_err(text)
}
