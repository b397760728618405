//! From an object to the report, by the commands of the README.

mod common;

use common::{TINY, assert_finite, assert_same_bytes, files, hingecast, tiny_recording};
use std::path::Path;

/// The whole path has pictures that are compared, and textures, at a bound; other tiny builds do with less.
const PHOTOGRAPHS: &str = "--set fit.steps=120 --set fit.gaussians=2000 --set twin.max_texels=300000";

const SCREW: [&str; 4] = ["parts", "splat", "joints", "twin"];
const TRACK: [&str; 5] = ["splat", "motion", "parts", "joints", "twin"];

/// The paths that a page refers to by `src` or `href`.
fn references(html: &str) -> Vec<String> {
    ["src=\"", "href=\""]
        .iter()
        .flat_map(|key| html.split(key).skip(1))
        .map(|rest| rest.split('"').next().unwrap_or_default().to_string())
        .collect()
}

fn text(path: &Path) -> String {
    std::fs::read_to_string(path).unwrap_or_else(|e| panic!("{}: {e}", path.display()))
}

/// Joints and pictures as good as they usually are on the tiny recording. Three seeds gave axes of
/// 0.0013 to 0.0024 deg, pivots of 9e-6 to 1.1e-5, angles of 0.0013 to 0.0015 deg in the mean over
/// states, 27.5 to 27.7 dB and labels of 0.923 to 0.930.
fn assert_usual(figures: &serde_json::Value) {
    let number = |value: &serde_json::Value| value.as_f64().unwrap_or(f64::NAN);
    assert_eq!((&figures["found_parts"], &figures["true_parts"]), (&2.into(), &2.into()), "{figures}");
    assert_eq!((number(&figures["joint_type_accuracy"]), number(&figures["tree_accuracy"])), (1.0, 1.0), "{figures}");
    let joints = figures["joints"].as_array().unwrap();
    assert_eq!(joints.len(), 1, "{figures}");
    for joint in joints {
        assert_eq!(joint["found_type"], joint["true_type"], "{figures}");
        assert!(number(&joint["axis_deg"]) < 0.01, "{figures}");
        // Scene units; the box is 0.4 across.
        assert!(number(&joint["pivot"]) < 5e-5, "{figures}");
        // Degrees: values, the whole motion, and the range.
        assert!(number(&joint["state_mean"]) < 0.006, "{figures}");
        assert!(number(&joint["motion_max"]) < 0.025, "{figures}");
        assert!(number(&joint["range_error"]) < 0.02, "{figures}");
    }
    for (states, psnr, labels) in [("first_state", 26.5, 0.88), ("other_states", 25.5, 0.9)] {
        let pictures = &figures[states];
        assert!(number(&pictures["psnr"]) > psnr && number(&pictures["label_miou"]) > labels, "{figures}");
        assert!(number(&pictures["mask_iou"]) > 0.96, "{figures}");
    }
}

#[test]
fn synth_check_build_eval_report() {
    let dir = tempfile::tempdir().unwrap();
    let dir = dir.path();
    tiny_recording(dir);
    for file in ["rec/transforms.json", "rec.truth/truth.json"] {
        assert!(dir.join(file).is_file(), "{file}");
    }

    // A recording fresh from `synth` is in order.
    let checked = hingecast(dir, "check rec --json").done();
    let json = checked.json();
    let errors = json["findings"].as_array().unwrap().iter().filter(|f| f["severity"] == "error").count();
    assert_eq!(errors, 0, "{checked}");
    assert_eq!(json["states"].as_array().unwrap().len(), 5 + 2, "five states and two held-out ones: {checked}");

    let built = hingecast(dir, &format!("build rec -o run --json {TINY} {PHOTOGRAPHS}")).done();
    let answer = built.json();
    assert!(answer["secs"].as_f64().unwrap() > 0.0 && answer["peak_memory"].as_f64().unwrap() > 1e6, "{built}");
    let twin = dir.join("run/twin");
    for file in ["config.toml", "run.json", "splat/gaussians.ply", "twin/twin.json", "twin/splats/part_0.ply"] {
        assert!(dir.join("run").join(file).is_file(), "{file}\n{built}");
    }

    // Somebody else's program loads both files.
    #[cfg(feature = "mujoco")]
    for check in hingecast_sim::check_twin(&twin, &hingecast_sim::CheckConfig::default()).unwrap() {
        assert!(check.finite, "{check:?}");
        assert!(check.geoms > 0, "{check:?}");
        assert_eq!(check.warnings, Vec::<String>::new(), "{}", check.file);
    }
    #[cfg(feature = "mujoco")]
    {
        let file = twin.join("robosuite.xml");
        let check = hingecast_sim::check_file(&file, &hingecast_sim::CheckConfig::default()).unwrap();
        assert!(check.finite && check.warnings.is_empty(), "{check:?}");
    }
    // The photographs are on it.
    for part in 0..2 {
        let [obj, picture] = ["obj", "png"].map(|end| twin.join(format!("meshes/visual/part_{part}.{end}")));
        assert!(text(&obj).contains("vt ") && picture.is_file(), "{}", picture.display());
    }
    // Every mesh file that the robots name is there; urdf and mjcf name the same joints.
    let (urdf, mjcf) = (text(&twin.join("robot.urdf")), text(&twin.join("robot.xml")));
    let meshes: Vec<&str> = urdf.split("filename=\"").skip(1).map(|r| r.split('"').next().unwrap()).collect();
    assert!(!meshes.is_empty());
    for mesh in meshes {
        assert!(twin.join(mesh).is_file(), "{mesh} of robot.urdf");
    }
    let json: serde_json::Value = serde_json::from_str(&text(&twin.join("twin.json"))).unwrap();
    for joint in json["tree"]["joints"].as_array().unwrap() {
        let name = format!("name=\"{}\"", joint["name"].as_str().unwrap());
        assert!(urdf.contains(&name) && mjcf.contains(&name), "{name}");
    }

    let evaluated = hingecast(dir, "eval run --truth rec.truth --json").done();
    let figures = evaluated.json();
    assert_finite(&figures, "eval");
    assert_eq!(figures["object"], "hinged_box");
    assert_usual(&figures);
    assert!(dir.join("run/eval.json").is_file());

    // An unreachable bar: exit 1, and the figures are printed all the same.
    let barred = hingecast(dir, "eval run --truth rec.truth --fail-under psnr=99");
    assert_eq!(barred.code, Some(1), "{barred}");
    assert!(barred.stderr.contains("psnr=99"), "{barred}");

    std::fs::remove_dir_all(dir.join("run/report")).unwrap();
    let page = dir.join("run/report/index.html");
    assert_eq!(hingecast(dir, "report run --json").done().json()["report"], "run/report/index.html");
    let html = text(&page);
    assert!(html.contains("class=\"doubts\"") || html.contains("class=\"fine\""), "the doubts come first");
    let pictures = references(&html);
    assert!(pictures.len() >= 3, "{pictures:?}");
    for file in pictures {
        assert!(!file.contains("://"), "the report needs no network: {file}");
        assert!(dir.join("run/report").join(&file).is_file(), "{file} is not there");
    }

    // A page to take it by its handles: whole, without a network, of a run and of a twin alone.
    assert_eq!(hingecast(dir, "view run --json").done().json()["page"], "run/report/view.html");
    hingecast(dir, "view run/twin -o alone.html").done();
    let (page, alone) = (text(&dir.join("run/report/view.html")), text(&dir.join("alone.html")));
    assert_eq!(page, alone);
    let said = page.split("id=\"twin\">").nth(1).unwrap().split("</script>").next().unwrap();
    let said: serde_json::Value = serde_json::from_str(said).unwrap();
    assert_eq!((&said["tree"], said["collision"].as_array().unwrap().len()), (&json["tree"], 2));
    assert!(!page.contains("<!--"), "a mark was left unfilled");
    let nowhere = hingecast(dir, "view rec");
    assert_eq!((nowhere.code, nowhere.stderr.lines().count()), (Some(2), 3), "{nowhere}");

    // The same command again changes nothing and is quick about it.
    let again = hingecast(dir, &format!("build rec -o run {TINY} {PHOTOGRAPHS}")).done();
    assert_eq!(again.stderr.matches("kept").count(), 4, "{again}");
}

/// Style point 9: the bytes do not depend on the number of threads. All files of the run but those
/// that tell of time.
#[test]
fn one_thread_or_two_give_the_same_bytes() {
    let dir = tempfile::tempdir().unwrap();
    let dir = dir.path();
    tiny_recording(dir);
    for (method, stages) in [("screw", &SCREW[..]), ("track", &TRACK[..])] {
        for threads in [1, 2] {
            let line = format!("build rec -o {method}{threads} --method {method} --threads {threads} -q {TINY}");
            hingecast(dir, &line).done();
        }
        let run = |threads: usize| dir.join(format!("{method}{threads}"));
        assert!(files(&run(1).join("twin")).len() > 10);
        for stage in stages {
            assert_same_bytes(&run(1).join(stage), &run(2).join(stage));
        }
    }
}

/// Noisy recordings: the pictures are asked about joints and frames, and that depends on the number
/// of threads no more.
#[test]
fn noise_asks_the_pictures_too() {
    let dir = tempfile::tempdir().unwrap();
    let dir = dir.path();
    hingecast(dir, "synth hinged_box -o rec --states 5 --views 12 --test-views 1 --size 96 --noise d435 -q").done();
    for threads in [1, 2] {
        hingecast(dir, &format!("build rec -o run{threads} --to joints --threads {threads} -q {TINY}")).done();
    }
    for stage in &SCREW[..3] {
        assert_same_bytes(&dir.join("run1").join(stage), &dir.join("run2").join(stage));
    }
    let placed: serde_json::Value = serde_json::from_str(&text(&dir.join("run1/splat/placed.json"))).unwrap();
    assert_eq!(placed["state_from_world"].as_array().unwrap().len(), 5);
    let nats = |k: usize| placed["nats"][k].as_f64().unwrap();
    assert!(nats(1) < nats(0), "{} -> {}", nats(0), nats(1));
    let joints: serde_json::Value = serde_json::from_str(&text(&dir.join("run1/joints/joints.json"))).unwrap();
    assert_eq!(joints["tree"], placed["tree"]);
}

#[test]
fn another_seed_gives_another_twin() {
    let dir = tempfile::tempdir().unwrap();
    let dir = dir.path();
    tiny_recording(dir);
    let build = |seed: u64| {
        hingecast(dir, &format!("build rec -o run{seed} --seed {seed} --to splat -q {TINY}")).done();
        std::fs::read(dir.join(format!("run{seed}/splat/gaussians.ply"))).unwrap()
    };
    assert_ne!(build(1), build(2));
}

/// A person's word beats what was found, and only the later stages run again.
#[test]
fn a_joint_can_be_corrected_by_hand() {
    let dir = tempfile::tempdir().unwrap();
    let dir = dir.path();
    tiny_recording(dir);
    hingecast(dir, &format!("build rec -o run -q --to joints {TINY}")).done();
    let correct = |text: &str| {
        std::fs::write(dir.join("mine.toml"), text).unwrap();
        hingecast(dir, &format!("build rec -o run --config mine.toml {TINY}"))
    };
    let entry = "[[joint]]\njoint = \"joint_1\"\nname = \"lid\"\naxis = [0.0, 2.0, 0.0]\nlimits = [-5.0, 90.0]\n";
    let done = correct(entry).done();
    assert_eq!(done.stderr.matches("kept").count(), 2, "{done}");
    let json: serde_json::Value = serde_json::from_str(&text(&dir.join("run/twin/twin.json"))).unwrap();
    let joint = &json["tree"]["joints"][0];
    assert_eq!(joint["name"], "lid");
    assert_eq!(joint["screw"]["axis"], serde_json::json!([0.0, 1.0, 0.0]));
    assert!((joint["limits"][1].as_f64().unwrap() - 90f64.to_radians()).abs() < 1e-9);
    let wrong = correct("[[joint]]\njoint = \"joint_7\"\n");
    assert_eq!(wrong.code, Some(2), "{wrong}");
    assert!(wrong.stderr.contains("no joint 'joint_7'") && wrong.stderr.contains("joint_1"), "{wrong}");
}
