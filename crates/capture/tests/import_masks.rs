//! Masks as segmenters write them: one number a thing, one folder a thing, beside the capture.

mod common;

use common::{record, small};
use hingecast_capture::CaptureError;
use hingecast_capture::check::{Severity, check};
use hingecast_capture::import::{Config, ImportReport, import};
use hingecast_capture::recording::images;
use hingecast_capture::{Recording, Truth};
use serde_json::{Value, json};
use std::path::{Path, PathBuf};

/// The small recording of the hinged box with 1 = body and 2 = lid in its masks.
fn labelled(dir: &Path) -> PathBuf {
    let report = record(dir, &small());
    let recording = Recording::open(&report.recording).unwrap();
    let truth = Truth::open(&report.truth.unwrap()).unwrap();
    for frame in &recording.frames {
        let labels = truth.labels(&frame.color).unwrap();
        images::write_gray(frame.mask.as_ref().unwrap(), &labels, frame.camera.width, frame.camera.height).unwrap();
    }
    report.recording
}

/// `transforms.json` changed by `change`.
fn change(root: &Path, change: impl Fn(&mut Value)) {
    let file = root.join("transforms.json");
    let mut value: Value = serde_json::from_slice(&std::fs::read(&file).unwrap()).unwrap();
    change(&mut value);
    std::fs::write(&file, value.to_string()).unwrap();
}

fn imported(dir: &Path, src: &Path, config: &Config) -> Result<(ImportReport, Recording), CaptureError> {
    let report = import(&[src], &dir.join("out"), config, &Default::default())?;
    let recording = Recording::open(&report.recording)?;
    Ok((report, recording))
}

/// Pixels of the object, over all frames.
fn object(recording: &Recording) -> usize {
    (0..recording.frames.len()).map(|i| recording.load(i).unwrap().mask.iter().filter(|m| **m == 1).count()).sum()
}

#[test]
fn a_number_of_label_images_is_the_object() {
    let dir = tempfile::tempdir().unwrap();
    let src = labelled(dir.path());
    let (report, all) = imported(dir.path(), &src, &Config::default()).unwrap();
    let all = object(&all);
    let note = report.notes.iter().find(|n| n.contains("--mask-id")).unwrap_or_else(|| panic!("{:?}", report.notes));
    assert!(note.contains("2 numbers") && note.contains("1 (") && note.contains("2 ("), "{note}");
    let of = |ids: Vec<u16>| {
        let (report, own) = imported(dir.path(), &src, &Config { mask_ids: ids, ..Config::default() }).unwrap();
        assert!(!report.notes.iter().any(|n| n.contains("--mask-id")), "{:?}", report.notes);
        object(&own)
    };
    let (body, lid) = (of(vec![1]), of(vec![2]));
    assert!(body > 0 && lid > 0 && body + lid == all && of(vec![1, 2]) == all);
    let e = imported(dir.path(), &src, &Config { mask_ids: vec![7], ..Config::default() }).unwrap_err().to_string();
    assert!(e.lines().count() == 3 && e.contains("is 7") && e.contains("1 (") && e.contains("2 ("), "{e}");
}

/// One rule: what `--mask-id` does at import, `mask_id` does in a recording that is not imported.
#[test]
fn a_recording_says_which_number_is_the_object() {
    let dir = tempfile::tempdir().unwrap();
    let src = labelled(dir.path());
    let both = object(&Recording::open(&src).unwrap());
    let said = |root: &Path| {
        let found = check(root, &Default::default()).unwrap().findings;
        found.into_iter().find(|f| f.code == "mask-labels").map(|f| (f.severity == Severity::Error, f.to_string()))
    };
    let (grave, text) = said(&src).unwrap();
    assert!(!grave && text.contains("2 numbers") && text.contains("mask_id"), "{text}");
    change(&src, |v| v["mask_id"] = json!(2));
    let lid = object(&Recording::open(&src).unwrap());
    assert!(lid > 0 && lid < both && said(&src).is_none());
    assert_eq!(object(&imported(dir.path(), &src, &Config::default()).unwrap().1), lid);
    change(&src, |v| v["mask_id"] = json!([1, 2]));
    assert_eq!(object(&Recording::open(&src).unwrap()), both);
    change(&src, |v| v["mask_id"] = json!(9));
    let (grave, text) = said(&src).unwrap();
    assert!(grave && text.contains("is 9") && text.contains("1 ("), "{text}");
    change(&src, |v| v["mask_id"] = json!("door"));
    assert!(Recording::open(&src).unwrap_err().to_string().contains("mask_id"));
}

/// SAM 2 writes a folder for each thing, numbers as names, beside the pictures.
#[test]
fn a_folder_of_masks_belongs_to_the_pictures_by_name() {
    let dir = tempfile::tempdir().unwrap();
    let src = labelled(dir.path());
    let plain = object(&Recording::open(&src).unwrap());
    let things = dir.path().join("masks");
    let recording = Recording::open(&src).unwrap();
    for (thing, half) in [("chair", false), ("door", true)] {
        std::fs::create_dir_all(things.join(thing)).unwrap();
        for frame in &recording.frames {
            let name = frame.color.file_name().unwrap();
            let (labels, w, h) = images::read_depth(frame.mask.as_ref().unwrap()).unwrap();
            let bytes: Vec<u8> = labels.iter().map(|l| u8::from(*l > if half { 1.0 } else { 0.0 })).collect();
            images::write_gray(&things.join(thing).join(name), &bytes, w, h).unwrap();
        }
    }
    change(&src, |v| {
        v["frames"]
            .as_array_mut()
            .unwrap()
            .iter_mut()
            .for_each(|f| drop(f.as_object_mut().unwrap().remove("mask_path")));
    });
    let with = |folder: PathBuf| imported(dir.path(), &src, &Config { masks: vec![folder], ..Config::default() });
    let e = with(things.clone()).unwrap_err().to_string();
    assert!(e.lines().count() == 3 && e.contains("chair (") && e.contains("door (") && e.contains("--masks"), "{e}");
    assert_eq!(object(&with(things.join("chair")).unwrap().1), plain);
    let (report, lid) = with(things.join("door")).unwrap();
    assert!(object(&lid) < plain && lid.frames.len() == recording.frames.len(), "{:?}", report.notes);
    // A picture that has no mask is left out, and said; a folder of others is refused.
    std::fs::remove_file(things.join("door").join(recording.frames[1].color.file_name().unwrap())).unwrap();
    let (report, fewer) = with(things.join("door")).unwrap();
    assert_eq!(fewer.frames.len() + 1, recording.frames.len());
    assert!(report.notes.iter().any(|n| n.contains("1 of")), "{:?}", report.notes);
    let e = with(src.join("depth").join("..").join("nothing")).unwrap_err().to_string();
    assert!(e.contains("no masks in this folder"), "{e}");
    let two = Config { masks: vec![things.join("door"), things.join("chair")], ..Config::default() };
    assert!(imported(dir.path(), &src, &two).unwrap_err().to_string().contains("2 folders of masks"));
}
