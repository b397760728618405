//! Repairs that need no guessing. `transforms.json` is kept beside the new one as
//! `transforms.json.bak`; images are never changed, an inverted mask is written under a new name.

use super::CheckReport;
use crate::recording::{images, transforms};
use crate::{CaptureError, Split};
use glam::{DMat3, DMat4, DVec3};
use serde::Serialize;
use serde_json::{Value, json};
use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

/// One repair. `file` is a `transforms.json`, `index` a position in its `frames`.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Fix {
    /// The frame goes out of the list; its images stay on the disk.
    DropFrame {
        /// The `transforms.json`.
        file: PathBuf,
        /// Position in its `frames`, from 0.
        index: usize,
    },
    /// The nearest rotation replaces a nearly rigid matrix.
    Orthonormalise {
        /// The `transforms.json`.
        file: PathBuf,
        /// Position in its `frames`, from 0.
        index: usize,
    },
    /// A mask that marks the background is written inverted, under a new name.
    InvertMask {
        /// The `transforms.json`.
        file: PathBuf,
        /// Position in its `frames`, from 0.
        index: usize,
    },
    /// `depth_unit_scale_factor` of all frames times `factor`.
    ScaleDepth {
        /// New scale over old scale.
        factor: f64,
    },
    /// All poses from OpenCV's to OpenGL's axes.
    FlipCameraAxes,
    /// States without gaps, order kept.
    RenumberStates,
}

/// More than this share of frames is not dropped: then the cause should be found.
const MOST_DROPPED: f64 = 0.5;

/// Applies all fixes of a report. Returns what was done, one line each; run `check` again
/// afterwards.
///
/// # Errors
/// When a file cannot be read or written, or most frames would have to go.
pub fn fix(path: &Path, report: &CheckReport) -> Result<Vec<String>, CaptureError> {
    let fixes: Vec<&Fix> = report.findings.iter().filter_map(|f| f.fix.as_ref()).collect();
    if fixes.is_empty() {
        return Ok(Vec::new());
    }
    let mut documents = transforms::read(path)?;
    let mut done = Vec::new();
    let mut dropped = BTreeSet::new();
    for fix in fixes {
        match fix {
            Fix::DropFrame { file, index } => {
                dropped.insert((file.clone(), *index));
            }
            Fix::Orthonormalise { file, index } => {
                if let Some(frame) = frame_mut(&mut documents, file, *index) {
                    orthonormalise(frame);
                    done.push(format!("frames[{index}]: pose made rigid"));
                }
            }
            Fix::InvertMask { file, index } => {
                let folder = file.parent().unwrap_or(Path::new(".")).to_path_buf();
                if let Some(frame) = frame_mut(&mut documents, file, *index) {
                    done.push(invert_mask(frame, &folder)?);
                }
            }
            Fix::ScaleDepth { factor } => {
                for d in &mut documents {
                    scale_depth(&mut d.value, *factor);
                }
                done.push(format!("depth_unit_scale_factor multiplied by {factor}"));
            }
            Fix::FlipCameraAxes => {
                for frame in documents.iter_mut().flat_map(|d| frames_mut(&mut d.value)) {
                    change_pose(frame, |m| DMat4::from_cols(m.x_axis, -m.y_axis, -m.z_axis, m.w_axis));
                }
                done.push("poses turned from OpenCV's to OpenGL's axes".into());
            }
            // After frames are dropped.
            Fix::RenumberStates => {}
        }
    }
    let total: usize = documents.iter_mut().map(|d| frames_mut(&mut d.value).len()).sum();
    if dropped.len() as f64 > MOST_DROPPED * total as f64 {
        return Err(CaptureError::new(
            format!("{} of {total} frames would have to be dropped; nothing was changed", dropped.len()),
            path.display().to_string(),
            "find the common cause in the findings (a wrong folder, a broken export) and repair that",
        ));
    }
    // Training frames of every state: all, and those that would be left.
    let mut frames = BTreeMap::<usize, (usize, usize)>::new();
    for (d, e) in documents.iter().flat_map(|d| d.entries.iter().map(move |e| (d, e))) {
        if e.split == Split::Train {
            let (all, left) = frames.entry(e.state).or_default();
            *all += 1;
            *left += usize::from(!dropped.contains(&(d.file.clone(), e.index)));
        }
    }
    if let Some((state, (all, _))) = frames.into_iter().find(|(_, (_, left))| *left == 0) {
        return Err(CaptureError::new(
            format!("all {all} training frames of state {state} would have to be dropped; nothing was changed"),
            path.display().to_string(),
            "find their common cause in the findings and repair that; or take the state's frames out of transforms.json",
        ));
    }
    for (file, index) in dropped.iter().rev() {
        for d in documents.iter_mut().filter(|d| d.file == *file) {
            if *index < frames_mut(&mut d.value).len() {
                frames_mut(&mut d.value).remove(*index);
                done.push(format!("frames[{index}] dropped"));
            }
        }
    }
    if renumber_states(&mut documents) {
        done.push("states renumbered without gaps".into());
    }
    for d in &documents {
        backup(&d.file)?;
        let text = serde_json::to_vec_pretty(&d.value).map_err(|e| CaptureError::write(&d.file, e))?;
        images::write_file(&d.file, &text)?;
    }
    Ok(done)
}

/// A copy beside the file: `.bak`, or `.bak2` and so on where a file of that name is another's or
/// another time's. None is written over.
pub(crate) fn backup(file: &Path) -> Result<(), CaptureError> {
    let text = std::fs::read(file).map_err(|e| CaptureError::read(file, e))?;
    let kept = free(
        &text,
        (1..).map(|n| file.with_extension(if n == 1 { "json.bak".into() } else { format!("json.bak{n}") })),
    );
    images::write_file(&kept, &text)
}

/// The first of the names that is free, or has this content already.
fn free(content: &[u8], mut names: impl Iterator<Item = PathBuf>) -> PathBuf {
    let taken =
        |path: &PathBuf| path.symlink_metadata().is_ok() && std::fs::read(path).ok().as_deref() != Some(content);
    names.find(|path| !taken(path)).expect("there are more numbers than files")
}

/// The frames of a document; the reader made sure that there is a list.
fn frames_mut(value: &mut Value) -> &mut Vec<Value> {
    if !value["frames"].is_array() {
        value["frames"] = json!([]);
    }
    match &mut value["frames"] {
        Value::Array(list) => list,
        _ => unreachable!("set to a list above"),
    }
}

fn frame_mut<'a>(documents: &'a mut [transforms::Document], file: &Path, index: usize) -> Option<&'a mut Value> {
    let document = documents.iter_mut().find(|d| d.file == file)?;
    frames_mut(&mut document.value).get_mut(index)
}

fn change_pose(frame: &mut Value, change: impl Fn(DMat4) -> DMat4) {
    let rows: Option<Vec<Vec<f64>>> = serde_json::from_value(frame["transform_matrix"].clone()).ok();
    let Some(rows) = rows.filter(|r| r.len() >= 3 && r.iter().all(|row| row.len() == 4)) else { return };
    let mut m = [[0.0, 0.0, 0.0, 1.0]; 4];
    for (to, from) in m.iter_mut().zip(&rows) {
        to.copy_from_slice(from);
    }
    let changed = change(DMat4::from_cols_array_2d(&m).transpose());
    frame["transform_matrix"] = json!(changed.transpose().to_cols_array_2d());
}

/// Gram and Schmidt, shared evenly: repeated averaging with the inverse transpose converges to the
/// polar factor (Higham 1986), the rotation nearest to the matrix.
fn orthonormalise(frame: &mut Value) {
    change_pose(frame, |m| {
        let mut r = DMat3::from_mat4(m);
        for _ in 0..20 {
            r = (r + r.inverse().transpose()) * 0.5;
        }
        DMat4::from_cols(
            r.x_axis.extend(0.0),
            r.y_axis.extend(0.0),
            r.z_axis.extend(0.0),
            DVec3::new(m.w_axis.x, m.w_axis.y, m.w_axis.z).extend(1.0),
        )
    });
}

fn invert_mask(frame: &mut Value, folder: &Path) -> Result<String, CaptureError> {
    let name = frame["mask_path"].as_str().unwrap_or_default().to_string();
    let image = images::read(&folder.join(&name))?.into_luma8();
    let top = image.iter().max().copied().unwrap_or(255);
    let inverted: Vec<u8> = image.iter().map(|&v| if v > top / 2 { 0 } else { 255 }).collect();
    let png = images::gray_png(&inverted, image.width() as usize, image.height() as usize)?;
    let names = (1..).map(|n| if n == 1 { "inverted.png".into() } else { format!("inverted{n}.png") });
    let path = free(&png, names.map(|end| folder.join(Path::new(&name).with_extension(end))));
    images::write_file(&path, &png)?;
    let new = path.strip_prefix(folder).unwrap_or(&path).to_string_lossy().replace('\\', "/");
    frame["mask_path"] = json!(new);
    Ok(format!("{name} inverted into {new}"))
}

/// The factor stands at the top or at frames, or nowhere (then it is 1e-3).
fn scale_depth(value: &mut Value, factor: f64) {
    let key = "depth_unit_scale_factor";
    let top = value[key].as_f64().unwrap_or(1e-3);
    value[key] = json!(top * factor);
    for frame in frames_mut(value) {
        if let Some(own) = frame.get(key).and_then(Value::as_f64) {
            frame[key] = json!(own * factor);
        }
    }
}

/// True when something changed. Where folders number the states, the number is written into the
/// frames.
fn renumber_states(documents: &mut [transforms::Document]) -> bool {
    let in_folders = documents.len() > 1;
    let mut numbers = BTreeMap::<u64, u64>::new();
    let folder_number = |file: &Path| {
        let name = file.parent()?.file_name()?.to_str()?;
        name.strip_prefix("state_")?.parse::<u64>().ok()
    };
    let state_of = |frame: &Value, file: &Path| frame["state"].as_u64().or_else(|| folder_number(file));
    for d in documents.iter_mut() {
        let file = d.file.clone();
        for frame in frames_mut(&mut d.value) {
            if let Some(s) = state_of(frame, &file) {
                numbers.insert(s, 0);
            }
        }
    }
    // Held-out states, which have test frames only, come after the others.
    let train: BTreeSet<u64> = documents
        .iter()
        .flat_map(|d| &d.entries)
        .filter(|e| e.split == Split::Train)
        .map(|e| e.state as u64)
        .filter(|s| numbers.contains_key(s))
        .collect();
    let others: Vec<u64> = numbers.keys().copied().filter(|s| !train.contains(s)).collect();
    for (new, old) in train.into_iter().chain(others).enumerate() {
        numbers.insert(old, new as u64);
    }
    if numbers.iter().all(|(old, new)| old == new) {
        return false;
    }
    for d in documents.iter_mut() {
        let file = d.file.clone();
        for frame in frames_mut(&mut d.value) {
            if let Some(s) = state_of(frame, &file)
                && (in_folders || frame.get("state").is_some())
            {
                frame["state"] = json!(numbers[&s]);
            }
        }
    }
    true
}
