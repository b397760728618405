//! Pictures with one dot: a known 3D point whose pixel and depth a recording must give back.
//! Conversions here are written out anew, not taken from the crate.

use glam::{DMat4, DVec2, DVec3, DVec4};
use hingecast_geom::Camera;
use npyz::WriterBuilder;
use serde_json::Value;
use std::path::{Path, PathBuf};

pub const W: usize = 64;
pub const H: usize = 48;
/// One point a state: a wrong state would show.
pub const POINTS: [DVec3; 2] = [DVec3::new(0.31, -0.17, 0.15), DVec3::new(-0.25, 0.2, 0.28)];

pub fn cameras() -> Vec<Camera> {
    (0..5)
        .map(|i| {
            let a = 1.1 * i as f64;
            let eye = DVec3::new(1.5 * a.cos(), 1.5 * a.sin(), 0.6 + 0.1 * i as f64);
            Camera::look_at(eye, DVec3::ZERO, DVec3::Z, W, H, 0.7)
        })
        .collect()
}

/// world_from_camera with OpenGL axes, rows.
pub fn gl(c: &Camera) -> [[f64; 4]; 4] {
    let m = c.camera_from_world.inverse().to_mat4() * DMat4::from_diagonal(DVec4::new(1.0, -1.0, -1.0, 1.0));
    m.transpose().to_cols_array_2d()
}

/// camera_from_world with OpenCV axes, rows.
pub fn cv(c: &Camera) -> [[f64; 4]; 4] {
    c.camera_from_world.to_mat4().transpose().to_cols_array_2d()
}

pub fn k(c: &Camera) -> [[f64; 3]; 3] {
    [[c.fx, 0.0, c.cx], [0.0, c.fy, c.cy], [0.0, 0.0, 1.0]]
}

pub fn dot(uv: DVec2) -> impl Fn(u32, u32) -> bool {
    move |x, y| (f64::from(x) - uv.x.floor()).abs() <= 1.0 && (f64::from(y) - uv.y.floor()).abs() <= 1.0
}

pub fn save<I: Fn(&Path)>(path: PathBuf, write: I) {
    std::fs::create_dir_all(path.parent().unwrap()).unwrap();
    write(&path);
}

/// A red dot at `uv` on black; alpha only at the dot.
pub fn rgba(path: PathBuf, uv: DVec2) {
    let on = dot(uv);
    let pixel = |x, y| if on(x, y) { image::Rgba([255, 0, 0, 255]) } else { image::Rgba([0, 0, 0, 0]) };
    save(path, |p| image::RgbaImage::from_fn(W as u32, H as u32, pixel).save(p).unwrap());
}

pub fn rgb(path: PathBuf, uv: DVec2) {
    let on = dot(uv);
    let pixel = |x, y| if on(x, y) { image::Rgb([255, 0, 0]) } else { image::Rgb([0, 0, 0]) };
    save(path, |p| image::RgbImage::from_fn(W as u32, H as u32, pixel).save(p).unwrap());
}

pub fn mask(path: PathBuf, uv: DVec2, one: u8) {
    let on = dot(uv);
    let pixel = |x, y| image::Luma([if on(x, y) { one } else { 0 }]);
    save(path, |p| image::GrayImage::from_fn(W as u32, H as u32, pixel).save(p).unwrap());
}

/// Millimetres at the dot, 50 mm (invalid in some layouts) elsewhere; `shrink` halves the size.
pub fn depth(path: PathBuf, uv: DVec2, z: f64, shrink: u32) {
    let on = dot(uv / f64::from(shrink));
    let pixel = |x, y| image::Luma([if on(x, y) { (z * 1000.0).round() as u16 } else { 50u16 }]);
    let (w, h) = (W as u32 / shrink, H as u32 / shrink);
    save(path, |p| image::ImageBuffer::<image::Luma<u16>, _>::from_fn(w, h, pixel).save(p).unwrap());
}

pub fn npy(path: PathBuf, shape: &[u64], values: &[f64]) {
    save(path, |p| {
        let file = std::fs::File::create(p).unwrap();
        let mut w = npyz::WriteOptions::new().default_dtype().shape(shape).writer(file).begin_nd().unwrap();
        w.extend(values.iter().copied()).unwrap();
        w.finish().unwrap();
    });
}

pub fn write_json(path: PathBuf, value: Value) {
    save(path, |p| std::fs::write(p, value.to_string()).unwrap());
}

/// A camera picture of which depth sees every `SHRINK`-th pixel.
pub const SHRINK: u32 = 4;

/// A red square where the depth of a smaller map (see [`depth`] with `SHRINK`) has its dot.
pub fn large_rgb(path: PathBuf, uv: DVec2) {
    let on = dot(uv / f64::from(SHRINK));
    let pixel =
        |x: u32, y: u32| if on(x / SHRINK, y / SHRINK) { image::Rgb([255u8, 0, 0]) } else { image::Rgb([0, 0, 0]) };
    save(path, |p| image::RgbImage::from_fn(W as u32, H as u32, pixel).save(p).unwrap());
}

/// A confidence map of depth's size: 0 in the left half, `high` in the right.
pub fn confidence(path: PathBuf, high: u8) {
    let (w, h) = (W as u32 / SHRINK, H as u32 / SHRINK);
    save(path, |p| {
        image::GrayImage::from_fn(w, h, |x, _| image::Luma([if x < w / 2 { 0 } else { high }])).save(p).unwrap()
    });
}

/// qx qy qz qw tx ty tz of a camera-to-world matrix.
pub fn quaternion(rows: &[[f64; 4]; 4]) -> [f64; 7] {
    let m = DMat4::from_cols_array_2d(rows).transpose();
    let q = glam::DQuat::from_mat4(&m);
    [q.x, q.y, q.z, q.w, m.w_axis.x, m.w_axis.y, m.w_axis.z]
}

/// A small depth map as plain numbers: metres at the dot, 0 elsewhere.
pub fn metres(uv: DVec2, z: f64) -> Vec<f32> {
    let on = dot(uv / f64::from(SHRINK));
    let (w, h) = (W as u32 / SHRINK, H as u32 / SHRINK);
    (0..w * h).map(|i| if on(i % w, i / w) { z as f32 } else { 0.0 }).collect()
}

/// Looks for the point of a frame's state in its picture and its depth (tolerance 2 mm).
pub fn shows(recording: &hingecast_capture::Recording, frame: usize, point: DVec3) {
    let camera = recording.frames[frame].camera;
    let (uv, z) = camera.project(point);
    let view = recording.load(frame).unwrap();
    let p = uv.y.floor() as usize * camera.width + uv.x.floor() as usize;
    let [r, g, b] = [0, 1, 2].map(|c| view.rgb[3 * p + c]);
    assert!(r > 150 && g < 100 && b < 100, "frame {frame}: {r} {g} {b} at {uv}");
    assert!((f64::from(view.depth[p]) - z).abs() < 2e-3, "frame {frame}: {} {z} at {uv}", view.depth[p]);
}
