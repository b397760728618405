//! Matrices and fields of foreign files, with errors that name file and key.

use crate::CaptureError;
use crate::recording::{MAX_RIGIDITY_ERROR, camera_from_gl};
use glam::{DMat3, DMat4, DQuat, DVec3};
use hingecast_geom::{Camera, Pose, pose::rigidity_error};
use serde_json::Value;
use std::path::{Path, PathBuf};

/// A JSON file.
pub(super) fn json(path: &Path) -> Result<Value, CaptureError> {
    let text = std::fs::read_to_string(path).map_err(|e| CaptureError::read(path, e))?;
    serde_json::from_str(&text).map_err(|e| {
        let hint = "look at that line; a file cut short ends in the middle: copy it again";
        CaptureError::new(format!("the file is not JSON: {e}"), path.display().to_string(), hint)
    })
}

pub(super) fn wrong(file: &Path, key: &str, expected: &str) -> CaptureError {
    let what = format!("{key} is missing or wrong: {expected} is expected");
    CaptureError::new(what, format!("{}: {key}", file.display()), "check the file against the layout's description")
}

/// A list of rows, or all numbers in one list, row-major.
pub(super) fn matrix<const N: usize>(value: &Value) -> Option<[[f64; N]; N]> {
    let flat: Vec<f64> = match value.as_array()?.first()? {
        Value::Array(_) => serde_json::from_value::<Vec<Vec<f64>>>(value.clone()).ok()?.concat(),
        _ => serde_json::from_value(value.clone()).ok()?,
    };
    rows(&flat)
}

/// N*N finite numbers as rows.
pub(super) fn rows<const N: usize>(flat: &[f64]) -> Option<[[f64; N]; N]> {
    if flat.len() != N * N || !flat.iter().all(|x| x.is_finite()) {
        return None;
    }
    let mut out = [[0.0; N]; N];
    flat.chunks(N).zip(&mut out).for_each(|(from, to)| to.copy_from_slice(from));
    Some(out)
}

/// Pose of a camera-to-world matrix with OpenGL axes.
pub(super) fn pose_from_gl(m: &[[f64; 4]; 4], file: &Path, key: &str) -> Result<Pose, CaptureError> {
    camera_from_gl(&DMat4::from_cols_array_2d(m).transpose(), &format!("{}: {key}", file.display()))
}

/// Pose of a world-to-camera matrix with OpenCV axes.
pub(super) fn pose_from_cv(m: &[[f64; 4]; 4], file: &Path, key: &str) -> Result<Pose, CaptureError> {
    let m = DMat4::from_cols_array_2d(m).transpose();
    let error = rigidity_error(&m);
    if error > MAX_RIGIDITY_ERROR {
        let det = DMat3::from_mat4(m).determinant();
        let what = format!("a camera pose is not rigid: |R'R - 1| = {error:.3e}, determinant {det:.3}");
        let hint = "world-to-camera [R | t] with orthonormal R is expected";
        return Err(CaptureError::new(what, format!("{}: {key}", file.display()), hint));
    }
    Ok(Pose::from_mat4(&m))
}

/// Pose of camera-to-world numbers qx qy qz qw tx ty tz with OpenGL axes.
pub(super) fn quaternion_pose_from_gl(numbers: &[f64], file: &Path, key: &str) -> Result<Pose, CaptureError> {
    let cv_from_gl = Pose::new(DQuat::from_xyzw(1.0, 0.0, 0.0, 0.0), DVec3::ZERO);
    let world_from_gl = rigid(numbers, file, key)?;
    let gl_from_world = world_from_gl.inverse();
    Ok(Pose::new(cv_from_gl.rot * gl_from_world.rot, cv_from_gl.rot * gl_from_world.trans))
}

/// The transform of qx qy qz qw tx ty tz.
pub(super) fn rigid(numbers: &[f64], file: &Path, key: &str) -> Result<Pose, CaptureError> {
    /// Numbers with four digits stay below; no quaternion at all does not.
    const MAX_LENGTH_ERROR: f64 = 1e-2;
    if let [x, y, z, w, tx, ty, tz] = *numbers
        && numbers.iter().all(|n| n.is_finite())
    {
        let rot = DQuat::from_xyzw(x, y, z, w);
        if (rot.length() - 1.0).abs() < MAX_LENGTH_ERROR {
            return Ok(Pose::new(rot.normalize(), DVec3::new(tx, ty, tz)));
        }
    }
    Err(wrong(file, key, "a rotation qx qy qz qw of length 1 and a place tx ty tz"))
}

/// A pinhole of a 3x3 matrix; `size` 0 x 0 when only the image knows.
pub(super) fn camera(k: &[[f64; 3]; 3], size: (usize, usize), camera_from_world: Pose) -> Camera {
    Camera { width: size.0, height: size.1, fx: k[0][0], fy: k[1][1], cx: k[0][2], cy: k[1][2], camera_from_world }
}

/// Width and height of an image, without decoding it.
pub(super) fn image_size(path: &Path) -> Result<(usize, usize), CaptureError> {
    let size = image::image_dimensions(path).map_err(|e| CaptureError::read(path, e))?;
    Ok((size.0 as usize, size.1 as usize))
}

/// The path itself, or with one of the usual endings when it has none.
pub(super) fn with_image_ending(path: PathBuf) -> PathBuf {
    if path.is_file() {
        return path;
    }
    let endings = [".png", ".jpg", ".jpeg"];
    let candidates = endings.iter().map(|e| PathBuf::from(format!("{}{e}", path.display())));
    candidates.into_iter().find(|p| p.is_file()).unwrap_or(path)
}

/// Files of a folder with one of the endings whose names are or end in a number, by that number.
pub(super) fn numbered(folder: &Path, endings: &[&str]) -> Vec<(usize, PathBuf)> {
    let number = |p: &PathBuf| {
        let stem = p.file_stem()?.to_str()?;
        stem[stem.trim_end_matches(|c: char| c.is_ascii_digit()).len()..].parse().ok()
    };
    let mut found: Vec<(usize, PathBuf)> =
        files(folder, endings).into_iter().filter_map(|p| Some((number(&p)?, p))).collect();
    found.sort();
    found
}

/// Files of a folder with one of the endings, by name.
pub(super) fn files(folder: &Path, endings: &[&str]) -> Vec<PathBuf> {
    let fits = |p: &PathBuf| p.extension().and_then(|e| e.to_str()).is_some_and(|e| endings.contains(&e));
    let mut found: Vec<PathBuf> =
        std::fs::read_dir(folder).into_iter().flatten().flatten().map(|e| e.path()).filter(fits).collect();
    found.sort();
    found
}
