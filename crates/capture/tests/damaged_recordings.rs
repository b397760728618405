//! Every way in which a recording was seen or thought to break: each ends in a named finding of
//! three lines, and in a repair where that is safe. Never a panic.

mod common;

use hingecast_capture::Recording;
use hingecast_capture::check::{CheckReport, Severity, check, fix};
use hingecast_capture::synth::SynthConfig;
use serde_json::{Value, json};
use std::path::{Path, PathBuf};
use std::sync::OnceLock;

/// A healthy recording of a hinged box, made once.
fn healthy() -> &'static Path {
    static DIR: OnceLock<tempfile::TempDir> = OnceLock::new();
    DIR.get_or_init(|| {
        let dir = tempfile::tempdir().unwrap();
        let config =
            SynthConfig { states: 3, views: 14, test_views: 1, test_states: 0, size: 48, ..Default::default() };
        common::record(dir.path(), &config);
        dir
    })
    .path()
}

struct Damaged {
    dir: tempfile::TempDir,
}

impl Damaged {
    fn new() -> Self {
        let dir = tempfile::tempdir().unwrap();
        copy(&healthy().join("rec"), &dir.path().join("rec"));
        Self { dir }
    }

    fn root(&self) -> PathBuf {
        self.dir.path().join("rec")
    }

    fn text(&self) -> String {
        std::fs::read_to_string(self.root().join("transforms.json")).unwrap()
    }

    fn write(&self, text: &str) {
        std::fs::write(self.root().join("transforms.json"), text).unwrap();
    }

    /// Changes the parsed `transforms.json`.
    fn json(&self, change: impl Fn(&mut Value)) {
        let mut value: Value = serde_json::from_str(&self.text()).unwrap();
        change(&mut value);
        self.write(&serde_json::to_string(&value).unwrap());
    }

    /// Changes every frame.
    fn frames(&self, change: impl Fn(&mut Value)) {
        self.json(|v| v["frames"].as_array_mut().unwrap().iter_mut().for_each(&change));
    }

    /// The file that a key of frame `i` names.
    fn file(&self, i: usize, key: &str) -> PathBuf {
        let v: Value = serde_json::from_str(&self.text()).unwrap();
        self.root().join(v["frames"][i][key].as_str().unwrap())
    }
}

fn copy(from: &Path, to: &Path) {
    std::fs::create_dir_all(to).unwrap();
    for e in std::fs::read_dir(from).unwrap().flatten() {
        let target = to.join(e.file_name());
        if e.path().is_dir() { copy(&e.path(), &target) } else { std::fs::copy(e.path(), target).map(|_| ()).unwrap() }
    }
}

fn image(path: &Path, change: impl Fn(u8) -> u8) {
    let mut i = image::open(path).unwrap().into_luma8();
    i.pixels_mut().for_each(|p| p.0[0] = change(p.0[0]));
    i.save(path).unwrap();
}

/// Camera-to-world of a frame times a change of columns.
fn columns(frame: &mut Value, change: impl Fn(usize, f64) -> f64) {
    for row in 0..3 {
        for c in 0..4 {
            let x = frame["transform_matrix"][row][c].as_f64().unwrap();
            frame["transform_matrix"][row][c] = json!(change(c, x));
        }
    }
}

/// What `check` must say, and whether `fix` must make the errors go away.
#[derive(Clone, Copy, PartialEq)]
enum Then {
    Error,
    Warning,
    /// An error that fix repairs.
    Fixed,
    /// A warning that fix repairs.
    FixedWarning,
}
use Then::{Error, Fixed, FixedWarning, Warning};

type Case = (&'static str, &'static str, Then, fn(&Damaged));

const CASES: &[Case] = &[
    ("transforms_json_missing", "unreadable", Error, |d| {
        std::fs::remove_file(d.root().join("transforms.json")).unwrap()
    }),
    ("transforms_json_cut_short", "unreadable", Error, |d| d.write(&d.text()[..d.text().len() / 2])),
    ("transforms_json_empty_file", "unreadable", Error, |d| d.write("")),
    ("transforms_json_is_a_list", "unreadable", Error, |d| d.write("[1, 2]")),
    ("transforms_json_is_an_image", "unreadable", Error, |d| {
        std::fs::copy(d.file(0, "file_path"), d.root().join("transforms.json")).map(|_| ()).unwrap()
    }),
    ("film_not_cut", "uncut-film", Error, |d| {
        d.json(|v| {
            v["film"] = json!(true);
            v["registered"] = json!(false);
        })
    }),
    ("frames_missing", "unreadable", Error, |d| d.json(|v| drop(v.as_object_mut().unwrap().remove("frames")))),
    ("frames_of_wrong_type", "unreadable", Error, |d| d.json(|v| v["frames"] = json!("many"))),
    ("frames_empty", "no-frames", Error, |d| d.json(|v| v["frames"] = json!([]))),
    ("one_frame_is_a_number", "field-type", Fixed, |d| d.json(|v| v["frames"][3] = json!(7))),
    ("file_path_missing", "field-missing", Fixed, |d| {
        d.json(|v| drop(v["frames"][0].as_object_mut().unwrap().remove("file_path")))
    }),
    ("state_missing", "field-missing", Fixed, |d| {
        d.json(|v| drop(v["frames"][5].as_object_mut().unwrap().remove("state")))
    }),
    ("state_is_text", "field-type", Fixed, |d| d.json(|v| v["frames"][5]["state"] = json!("open"))),
    ("state_is_negative", "field-type", Fixed, |d| d.json(|v| v["frames"][5]["state"] = json!(-1))),
    ("depth_unit_of_one_state", "depth-unit", Error, |d| {
        d.frames(|f| {
            if f["state"] == 1 {
                f["depth_unit_scale_factor"] = json!(10.0 * f["depth_unit_scale_factor"].as_f64().unwrap())
            }
        })
    }),
    ("millimetres_called_metres", "depth-unit", Error, |d| {
        d.json(|v| v["metric"] = json!(true));
        d.frames(|f| {
            f["depth_unit_scale_factor"] = json!(1e3 * f["depth_unit_scale_factor"].as_f64().unwrap());
            columns(f, |c, x| if c == 3 { 1e3 * x } else { x });
        })
    }),
    ("states_with_a_gap", "states-gap", Fixed, |d| {
        d.frames(|f| {
            if f["state"] == 2 {
                f["state"] = json!(5)
            }
        })
    }),
    ("states_count_from_one", "states-gap", Fixed, |d| {
        d.frames(|f| f["state"] = json!(f["state"].as_u64().unwrap() + 1))
    }),
    ("only_one_state", "one-state", Error, |d| {
        d.json(|v| v["frames"].as_array_mut().unwrap().retain(|f| f["state"] == 0))
    }),
    ("all_frames_are_held_out", "no-training-frames", Error, |d| {
        d.json(|v| {
            let all: Vec<Value> = v["frames"].as_array().unwrap().iter().map(|f| f["file_path"].clone()).collect();
            v["test_filenames"] = json!(all);
        })
    }),
    ("matrix_of_three_columns", "field-type", Fixed, |d| {
        d.json(|v| v["frames"][2]["transform_matrix"] = json!([[1, 0, 0], [0, 1, 0], [0, 0, 1]]))
    }),
    ("matrix_as_flat_list", "field-type", Fixed, |d| {
        d.json(|v| v["frames"][2]["transform_matrix"] = json!(vec![0.0; 16]))
    }),
    ("matrix_missing", "field-missing", Fixed, |d| {
        d.json(|v| drop(v["frames"][2].as_object_mut().unwrap().remove("transform_matrix")))
    }),
    ("pose_has_nan", "not-finite", Fixed, |d| {
        d.json(|v| v["frames"][2]["transform_matrix"][0][3] = json!("NAN"));
        d.write(&d.text().replace("\"NAN\"", "NaN"));
    }),
    ("pose_has_infinity", "not-finite", Fixed, |d| {
        d.json(|v| v["frames"][2]["transform_matrix"][0][3] = json!("INF"));
        d.write(&d.text().replace("\"INF\"", "-Infinity"));
    }),
    ("pose_is_scaled", "pose-not-rigid", Fixed, |d| {
        d.json(|v| columns(&mut v["frames"][2], |c, x| if c < 3 { 2.0 * x } else { x }))
    }),
    ("pose_is_nearly_rigid", "pose-not-rigid", Fixed, |d| {
        d.frames(|f| columns(f, |c, x| if c == 1 { 1.01 * x } else { x }))
    }),
    ("pose_is_mirrored", "pose-mirrored", Fixed, |d| {
        d.json(|v| columns(&mut v["frames"][2], |c, x| if c == 0 { -x } else { x }))
    }),
    ("poses_have_opencv_axes", "camera-axes", Fixed, |d| {
        d.frames(|f| columns(f, |c, x| if c == 1 || c == 2 { -x } else { x }))
    }),
    ("cameras_all_at_one_place", "one-place", Error, |d| d.frames(|f| columns(f, |c, x| if c == 3 { 0.5 } else { x }))),
    ("a_state_lies_elsewhere", "states-apart", Error, |d| {
        d.frames(|f| {
            if f["state"] == 2 {
                columns(f, |c, x| if c == 3 { x + 0.15 } else { x })
            }
        })
    }),
    ("one_camera_stands_elsewhere", "view-apart", Fixed, |d| {
        d.json(|v| columns(&mut v["frames"][2], |c, x| if c == 3 { x + 8.0 } else { x }))
    }),
    ("focal_length_negative", "focal-length", Error, |d| d.json(|v| v["fl_x"] = json!(-300.0))),
    ("focal_length_in_millimetres", "focal-length", Warning, |d| {
        d.json(|v| {
            v["fl_x"] = json!(4.25);
            v["fl_y"] = json!(4.25);
        })
    }),
    ("focal_length_missing", "field-missing", Error, |d| d.json(|v| drop(v.as_object_mut().unwrap().remove("fl_x")))),
    ("principal_point_of_a_larger_image", "principal-point", Error, |d| {
        d.json(|v| {
            v["cx"] = json!(320.0);
            v["cy"] = json!(240.0);
        })
    }),
    ("lens_distorted", "distortion", Error, |d| d.json(|v| v["k1"] = json!(0.1))),
    ("camera_model_unknown", "camera-model", Error, |d| d.json(|v| v["camera_model"] = json!("EQUIRECTANGULAR"))),
    ("image_size_wrong_everywhere", "image-size", Error, |d| d.json(|v| v["w"] = json!(640))),
    ("image_size_zero", "image-size", Error, |d| d.json(|v| v["w"] = json!(0))),
    ("one_image_of_another_size", "image-size", Fixed, |d| {
        image::RgbImage::new(20, 20).save(d.file(4, "file_path")).unwrap()
    }),
    ("depth_of_another_size", "image-size", Fixed, |d| {
        image::ImageBuffer::<image::Luma<u16>, _>::new(20, 20).save(d.file(4, "depth_file_path")).unwrap()
    }),
    ("mask_of_another_size", "image-size", Fixed, |d| {
        image::GrayImage::new(20, 20).save(d.file(4, "mask_path")).unwrap()
    }),
    ("an_image_is_missing", "file-missing", Fixed, |d| std::fs::remove_file(d.file(4, "file_path")).unwrap()),
    ("a_depth_image_is_missing", "file-missing", Fixed, |d| {
        std::fs::remove_file(d.file(4, "depth_file_path")).unwrap()
    }),
    ("all_masks_are_missing", "file-missing", Error, |d| std::fs::remove_dir_all(d.root().join("mask")).unwrap()),
    ("an_image_is_cut_short", "image-unreadable", Fixed, |d| {
        let path = d.file(4, "file_path");
        let bytes = std::fs::read(&path).unwrap();
        std::fs::write(&path, &bytes[..bytes.len() / 2]).unwrap();
    }),
    ("an_image_is_an_empty_file", "image-unreadable", Fixed, |d| std::fs::write(d.file(4, "file_path"), b"").unwrap()),
    ("depth_is_a_coloured_preview", "depth-format", Fixed, |d| {
        image::RgbImage::new(48, 48).save(d.file(4, "depth_file_path")).unwrap()
    }),
    ("depth_in_millimetres_called_metres", "depth-unit", Fixed, |d| {
        d.frames(|f| f["depth_unit_scale_factor"] = json!(f["depth_unit_scale_factor"].as_f64().unwrap() * 1000.0))
    }),
    ("depth_ten_times_too_small", "depth-unit", Fixed, |d| {
        d.frames(|f| f["depth_unit_scale_factor"] = json!(f["depth_unit_scale_factor"].as_f64().unwrap() * 0.1))
    }),
    ("depth_scale_is_zero", "field-type", Error, |d| d.frames(|f| f["depth_unit_scale_factor"] = json!(0))),
    ("depth_is_empty", "depth-empty", Warning, |d| {
        image::ImageBuffer::<image::Luma<u16>, _>::new(48, 48).save(d.file(4, "depth_file_path")).unwrap()
    }),
    ("depth_missing_altogether", "no-depth", Warning, |d| {
        d.frames(|f| drop(f.as_object_mut().unwrap().remove("depth_file_path")))
    }),
    ("a_mask_is_empty", "mask-empty", Fixed, |d| image(&d.file(4, "mask_path"), |_| 0)),
    ("a_mask_is_full", "mask-full", Fixed, |d| image(&d.file(4, "mask_path"), |_| 255)),
    ("a_state_has_no_masks", "state-unmasked", Error, |d| {
        d.frames(|f| {
            if f["state"] == 1 {
                f.as_object_mut().unwrap().remove("mask_path");
            }
        })
    }),
    ("the_masks_of_a_state_are_full", "state-unmasked", Error, |d| {
        let v: Value = serde_json::from_str(&d.text()).unwrap();
        let frames = v["frames"].as_array().unwrap();
        (0..frames.len()).filter(|&i| frames[i]["state"] == 1).for_each(|i| image(&d.file(i, "mask_path"), |_| 255));
    }),
    ("masks_are_inverted", "mask-inverted", Fixed, |d| {
        let v: Value = serde_json::from_str(&d.text()).unwrap();
        for i in 0..v["frames"].as_array().unwrap().len() {
            image(&d.file(i, "mask_path"), |p| 255 - p);
        }
    }),
    ("a_frame_is_listed_twice", "duplicate-file", FixedWarning, |d| {
        d.json(|v| {
            let again = v["frames"][1].clone();
            v["frames"].as_array_mut().unwrap().push(again);
        })
    }),
    ("two_frames_with_one_pose", "duplicate-pose", FixedWarning, |d| {
        d.json(|v| v["frames"][1]["transform_matrix"] = v["frames"][0]["transform_matrix"].clone())
    }),
    ("two_files_with_identical_bytes", "duplicate-image", FixedWarning, |d| {
        std::fs::copy(d.file(0, "file_path"), d.file(1, "file_path")).map(|_| ()).unwrap()
    }),
    ("too_few_views", "few-views", Error, |d| {
        d.json(|v| v["frames"].as_array_mut().unwrap().retain(|f| f["state"] != 1 || f["view"].as_u64().unwrap() < 2))
    }),
    ("some_frames_are_occluded", "occluded", Warning, |d| d.json(|v| v["frames"][0]["occluded"] = json!(true))),
    ("a_state_is_wholly_occluded", "all-occluded", Error, |d| {
        d.frames(|f| {
            if f["state"] == 1 {
                f["occluded"] = json!(true)
            }
        })
    }),
    ("occluded_is_text", "field-type", Fixed, |d| d.json(|v| v["frames"][0]["occluded"] = json!("yes"))),
    ("an_occluder_mask_is_missing", "file-missing", Fixed, |d| {
        d.json(|v| v["frames"][0]["occluder_mask_path"] = json!("occluder/none.png"))
    }),
    ("up_is_zero", "field-type", Error, |d| d.json(|v| v["up"] = json!([0, 0, 0]))),
];

fn said(report: &CheckReport) -> String {
    report.summary().iter().map(|f| format!("{f}\n")).collect()
}

#[test]
fn a_healthy_recording_has_no_findings() {
    let report = check(&healthy().join("rec"), &Default::default()).unwrap();
    assert!(report.findings.is_empty(), "{}", said(&report));
    assert_eq!(report.states.len(), 3);
    assert_eq!((report.states[0].usable, report.states[0].test), (14, 1));
    let least = report.shared.iter().flatten().copied().fold(1.0, f64::min);
    assert!(report.shared.len() == 3 && least > 0.3, "{:?}", report.shared);
}

#[test]
fn a_state_that_lies_elsewhere_shares_little_with_any() {
    let d = Damaged::new();
    let (_, _, _, damage) = CASES.iter().find(|c| c.0 == "a_state_lies_elsewhere").unwrap();
    damage(&d);
    let shared = check(&d.root(), &Default::default()).unwrap().shared;
    let (apart, together) = (shared[2][0].max(shared[2][1]), shared[0][1].min(shared[1][0]));
    assert!(apart < 0.5 * together, "{shared:?}");
}

#[test]
fn every_damage_is_named_and_repaired_where_that_is_safe() {
    assert!(CASES.len() >= 30);
    let mut failed = Vec::new();
    for (name, code, then, damage) in CASES {
        let d = Damaged::new();
        damage(&d);
        let report = check(&d.root(), &Default::default()).unwrap();
        let Some(finding) = report.findings.iter().find(|f| f.code == *code) else {
            failed.push(format!("{name}: {code} not found, but:\n{}", said(&report)));
            continue;
        };
        let severity = if matches!(then, Warning | FixedWarning) { Severity::Warning } else { Severity::Error };
        if finding.severity != severity || finding.to_string().lines().count() != 3 {
            failed.push(format!("{name}: wrong severity or lines:\n{finding}"));
        }
        // What check calls an error, reading must refuse too, or at least survive.
        match Recording::open(&d.root()) {
            Err(e) if e.to_string().lines().count() != 3 => failed.push(format!("{name}: not three lines:\n{e}")),
            Err(_) => {}
            Ok(r) => (0..r.frames.len()).for_each(|i| drop(r.load(i))),
        }
        let fixed = fix(&d.root(), &report);
        if matches!(then, Fixed | FixedWarning) {
            let after = check(&d.root(), &Default::default()).unwrap();
            if after.has_errors() || after.findings.iter().any(|f| f.code == *code) || fixed.is_err() {
                failed.push(format!("{name}: still broken after {fixed:?}:\n{}", said(&after)));
            }
            if !d.root().join("transforms.json.bak").exists() {
                failed.push(format!("{name}: no backup"));
            }
        } else if let Err(e) = fixed
            && e.to_string().lines().count() != 3
        {
            failed.push(format!("{name}: not three lines:\n{e}"));
        }
    }
    assert!(failed.is_empty(), "{} of {} cases:\n{}", failed.len(), CASES.len(), failed.join("\n"));
}

#[test]
fn noisy_recordings_with_hands_are_healthy() {
    let dir = tempfile::tempdir().unwrap();
    let noise = hingecast_capture::synth::Noise::D435;
    let config = SynthConfig { states: 3, views: 14, size: 96, noise, occluders: 0.3, ..Default::default() };
    common::record(dir.path(), &config);
    let report = check(&dir.path().join("rec"), &Default::default()).unwrap();
    assert!(!report.has_errors(), "{}", said(&report));
    assert!(report.states.iter().any(|s| s.partly_hidden > 0));
}

#[test]
fn one_transforms_json_per_state_reads_the_same() {
    let d = Damaged::new();
    let whole = Recording::open(&d.root()).unwrap();
    let value: Value = serde_json::from_str(&d.text()).unwrap();
    std::fs::remove_file(d.root().join("transforms.json")).unwrap();
    for s in 0..3 {
        let mut v = value.clone();
        let frames = v["frames"].as_array_mut().unwrap();
        frames.retain(|f| f["state"] == s);
        for f in frames.iter_mut() {
            f.as_object_mut().unwrap().remove("state");
            for key in ["file_path", "depth_file_path", "mask_path"] {
                f[key] = json!(format!("../{}", f[key].as_str().unwrap()));
            }
        }
        for name in v["test_filenames"].as_array_mut().unwrap() {
            *name = json!(format!("../{}", name.as_str().unwrap()));
        }
        let folder = d.root().join(format!("state_{s:03}"));
        std::fs::create_dir(&folder).unwrap();
        std::fs::write(folder.join("transforms.json"), v.to_string()).unwrap();
    }
    let split = Recording::open(&d.root()).unwrap();
    assert_eq!((split.n_states, split.frames.len()), (whole.n_states, whole.frames.len()));
    assert_eq!(split.load(5).unwrap(), whole.load(5).unwrap());
    let report = check(&d.root(), &Default::default()).unwrap();
    assert!(report.findings.is_empty(), "{}", said(&report));
}
