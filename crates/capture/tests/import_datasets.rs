//! COLMAP, BOP, TUM RGB-D and instant-ngp: layouts of desks rather than of phones, each written by
//! hand around one known 3D point a state.

mod common;

use common::dots::*;
use glam::{DQuat, DVec3};
use hingecast_capture::import::{Config, Format, ImportReport, detect, import};
use hingecast_capture::{CaptureError, Recording};
use hingecast_geom::{Camera, Pose};
use serde_json::{Value, json};
use std::fmt::Write;
use std::path::{Path, PathBuf};

fn folder() -> (tempfile::TempDir, PathBuf) {
    let dir = tempfile::tempdir().unwrap();
    let src = dir.path().join("scan");
    std::fs::create_dir(&src).unwrap();
    (dir, src)
}

fn imported(src: &Path) -> Result<(Recording, ImportReport), CaptureError> {
    let out = src.with_extension("imported");
    let report = import(&[src], &out, &Config::default(), &Default::default())?;
    Ok((Recording::open(&out).unwrap(), report))
}

/// Imports, and looks for the point of each state in metres.
fn verify(src: &Path, format: Format, states: usize) -> (Recording, ImportReport) {
    assert_eq!(detect(src).unwrap(), format);
    let (recording, report) = imported(src).unwrap();
    assert_eq!((report.states, recording.frames.len()), (states, states * cameras().len()));
    assert!(recording.metric && recording.registered);
    for (i, f) in recording.frames.iter().enumerate() {
        let small = cameras()[f.view].resized(W / SHRINK as usize, H / SHRINK as usize);
        let off = (f.camera.fx - small.fx).abs() + (f.camera.cx - small.cx).abs() + (f.camera.cy - small.cy).abs();
        assert!(off < 1e-6 && (f.camera.centre() - small.centre()).length() < 5e-3, "{:?} {small:?}", f.camera);
        shows(&recording, i, POINTS[f.state]);
    }
    (recording, report)
}

/// Metres of a unit of the COLMAP models here.
const UNIT: f64 = 2.5;

struct ColmapImage {
    id: u32,
    name: String,
    state: usize,
    pose: Pose,
}

/// Pictures and depth of both states, and what COLMAP says about them in its own unit.
fn colmap_pictures(src: &Path) -> Vec<ColmapImage> {
    let mut images = Vec::new();
    for (state, point) in POINTS.iter().enumerate() {
        for (i, c) in cameras().iter().enumerate() {
            let (uv, z) = c.project(*point);
            let name = format!("{}/{i}.png", ["closed", "open"][state]);
            large_rgb(src.join("images").join(&name), uv);
            depth(src.join("depth").join(&name), uv, z, SHRINK);
            let pose = Pose::new(c.camera_from_world.rot, c.camera_from_world.trans / UNIT);
            // No order, and no ids without gaps.
            images.push(ColmapImage { id: (97 * images.len() as u32 + 5) % 101, name, state, pose });
        }
    }
    images
}

fn numbers(p: &Pose) -> [f64; 7] {
    [p.rot.w, p.rot.x, p.rot.y, p.rot.z, p.trans.x, p.trans.y, p.trans.z]
}

fn words(p: &Pose) -> String {
    numbers(p).map(|n| n.to_string()).join(" ")
}

/// Where an image shows its point, often enough to compare depths.
fn seen(image: &ColmapImage) -> Vec<(f64, f64, u64)> {
    let c = cameras()[0];
    let at = Camera { camera_from_world: image.pose, ..c }.project(POINTS[image.state] / UNIT).0;
    vec![(at.x, at.y, 10 + image.state as u64); 12]
}

/// The pose that `images` holds when `frames` is there: not kept up.
fn stale(with_frames: bool, pose: &Pose) -> Pose {
    if with_frames { Pose::new(DQuat::IDENTITY, DVec3::new(7.0, 8.0, 9.0)) } else { *pose }
}

fn colmap_text(src: &Path, with_frames: bool) {
    let images = colmap_pictures(src);
    let sparse = src.join("sparse/0");
    std::fs::create_dir_all(&sparse).unwrap();
    let file = |name: &str, text: String| std::fs::write(sparse.join(name), format!("# comment\n{text}")).unwrap();
    let c = cameras()[0];
    file("cameras.txt", format!("3 PINHOLE {W} {H} {} {} {} {}\n", c.fx, c.fy, c.cx, c.cy));
    let (mut lines, mut frames) = (String::new(), String::new());
    for i in &images {
        writeln!(lines, "{} {} 3 {}", i.id, words(&stale(with_frames, &i.pose)), i.name).unwrap();
        // One feature without a point.
        let points: Vec<String> = seen(i).iter().map(|(x, y, p)| format!("{x} {y} {p}")).collect();
        writeln!(lines, "1 2 -1 {}", points.join(" ")).unwrap();
        writeln!(frames, "{} 8 {} 1 CAMERA 3 {}", i.id + 1, words(&i.pose), i.id).unwrap();
    }
    file("images.txt", lines);
    let point = |s: usize| {
        format!("{} {} {} {} 1 2 3 0.5 1 2\n", 10 + s, POINTS[s].x / UNIT, POINTS[s].y / UNIT, POINTS[s].z / UNIT)
    };
    file("points3D.txt", point(0) + &point(1));
    if with_frames {
        file("rigs.txt", "8 1 CAMERA 3\n".into());
        file("frames.txt", frames);
    }
}

fn colmap_binary(src: &Path, with_frames: bool) {
    let images = colmap_pictures(src);
    let c = cameras()[0];
    let floats = |out: &mut Vec<u8>, all: &[f64]| all.iter().for_each(|x| out.extend(x.to_le_bytes()));
    let mut bytes = 1u64.to_le_bytes().to_vec();
    bytes.extend([3u32, 1].map(u32::to_le_bytes).concat());
    bytes.extend([W as u64, H as u64].map(u64::to_le_bytes).concat());
    floats(&mut bytes, &[c.fx, c.fy, c.cx, c.cy]);
    std::fs::write(src.join("cameras.bin"), bytes).unwrap();

    let mut list = (images.len() as u64).to_le_bytes().to_vec();
    let mut frames = list.clone();
    for i in &images {
        list.extend(i.id.to_le_bytes());
        floats(&mut list, &numbers(&stale(with_frames, &i.pose)));
        list.extend(3u32.to_le_bytes());
        list.extend(i.name.bytes());
        list.push(0);
        list.extend(13u64.to_le_bytes());
        for (x, y, p) in seen(i).into_iter().chain([(1.0, 2.0, u64::MAX)]) {
            floats(&mut list, &[x, y]);
            list.extend(p.to_le_bytes());
        }
        frames.extend([i.id + 1, 8].map(u32::to_le_bytes).concat());
        floats(&mut frames, &numbers(&i.pose));
        frames.extend([1u32, 0, 3].map(u32::to_le_bytes).concat());
        frames.extend(u64::from(i.id).to_le_bytes());
    }
    std::fs::write(src.join("images.bin"), list).unwrap();
    let mut points = 2u64.to_le_bytes().to_vec();
    for (s, p) in POINTS.iter().enumerate() {
        points.extend((10 + s as u64).to_le_bytes());
        floats(&mut points, &(*p / UNIT).to_array());
        points.extend([1, 2, 3]);
        floats(&mut points, &[0.5]);
        points.extend(1u64.to_le_bytes());
        points.extend([4u32, 5].map(u32::to_le_bytes).concat());
    }
    std::fs::write(src.join("points3D.bin"), points).unwrap();
    if with_frames {
        std::fs::write(
            src.join("rigs.bin"),
            [1u64.to_le_bytes().to_vec(), [8u32, 1, 0, 3].map(u32::to_le_bytes).concat()].concat(),
        )
        .unwrap();
        std::fs::write(src.join("frames.bin"), frames).unwrap();
    }
}

#[test]
fn colmap_old_and_new_text_and_binary() {
    for with_frames in [false, true] {
        for write in [colmap_text, colmap_binary] {
            let (_dir, src) = folder();
            write(&src, with_frames);
            let (_, report) = verify(&src, Format::Colmap, 2);
            assert!(
                report.notes.iter().any(|n| n.contains("is 2.50") && n.contains(" m, by the depth at 120 points")),
                "{:?}",
                report.notes
            );
            assert!(report.notes.iter().any(|n| n.contains("closed, open")), "{:?}", report.notes);
        }
    }
}

#[test]
fn colmap_models_that_cannot_be_read_say_why() {
    let (_dir, src) = folder();
    colmap_text(&src, false);
    let cameras = src.join("sparse/0/cameras.txt");
    std::fs::write(&cameras, "3 FOV 64 48 60 60 32 24 0.9\n").unwrap();
    let e = imported(&src).unwrap_err();
    assert!(e.what.contains("FOV") && e.hint.contains("image_undistorter"), "{e}");
    let (_dir, src) = folder();
    colmap_binary(&src, true);
    let whole = std::fs::read(src.join("images.bin")).unwrap();
    std::fs::write(src.join("images.bin"), &whole[..whole.len() - 3]).unwrap();
    let e = imported(&src).unwrap_err();
    assert!(e.what.contains("too early") && e.place.contains("images.bin"), "{e}");
    // Depth of something else does not fit the model.
    let (_dir, src) = folder();
    colmap_text(&src, false);
    for i in 0..3 {
        for state in ["closed", "open"] {
            let file = src.join(format!("depth/{state}/{i}.png"));
            let other = image::ImageBuffer::from_fn(16, 12, |x, _| image::Luma([400 * (1 + i) + x as u16]));
            other.save(file).unwrap();
        }
    }
    let e = imported(&src).unwrap_err();
    assert!(e.what.contains("do not fit"), "{e}");
}

fn bop(src: &Path, with_poses: bool) {
    let (mut scene, mut truth) = (json!({}), json!({}));
    for (i, c) in cameras().iter().enumerate() {
        let (uv, z) = c.project(POINTS[0]);
        large_rgb(src.join(format!("rgb/{i:06}.png")), uv);
        depth(src.join(format!("depth/{i:06}.png")), uv, z, SHRINK);
        mask(src.join(format!("mask_visib/{i:06}_000000.png")), glam::DVec2::new(2.0, 2.0), 255);
        mask(src.join(format!("mask_visib/{i:06}_000001.png")), uv, 255);
        let mut matrix = k(c);
        // OpenCV's pixel centres.
        (matrix[0][2], matrix[1][2]) = (c.cx - 0.5, c.cy - 0.5);
        let m = cv(c);
        let rotation: Vec<f64> = m[..3].iter().flat_map(|r| r[..3].to_vec()).collect();
        let place: Vec<f64> = m[..3].iter().map(|r| 1000.0 * r[3]).collect();
        let key = i.to_string();
        // Ten units a millimetre would be 0.1; this is one.
        scene[&key] = json!({ "cam_K": matrix.concat(), "depth_scale": 1.0 });
        if with_poses {
            scene[&key]["cam_R_w2c"] = json!(rotation);
            scene[&key]["cam_t_w2c"] = json!(place);
        }
        let (r, t) = if with_poses {
            (json!([1, 0, 0, 0, 1, 0, 0, 0, 1]), json!([0, 0, 900]))
        } else {
            (json!(rotation), json!(place))
        };
        truth[&key] = json!([{ "obj_id": 7, "cam_R_m2c": r, "cam_t_m2c": t }]);
        if i > 0 {
            truth[&key].as_array_mut().unwrap().push(json!({ "obj_id": 3, "cam_R_m2c": r, "cam_t_m2c": t }));
        }
    }
    write_json(src.join("scene_camera.json"), scene);
    write_json(src.join("scene_gt.json"), truth);
}

#[test]
fn bop_with_poses_of_cameras_or_of_a_marker() {
    for with_poses in [true, false] {
        let (_dir, src) = folder();
        bop(&src, with_poses);
        let (recording, _) = verify(&src, Format::Bop, 1);
        let masked =
            |frame: usize, x: usize, y: usize| recording.load(frame).unwrap().mask[y * W / SHRINK as usize + x];
        // The corner is the marker's: part of the object only where no marker is the world.
        assert_eq!(masked(1, 0, 0), u8::from(with_poses));
    }
    let (_dir, src) = folder();
    bop(&src, false);
    std::fs::remove_file(src.join("scene_gt.json")).unwrap();
    let e = imported(&src).unwrap_err();
    assert!(e.what.contains("no poses") && e.hint.contains("marker"), "{e}");
}

fn tum(src: &Path) -> (String, String, String) {
    let (mut rgbs, mut depths, mut truth) =
        (String::from("# color images\n"), String::new(), String::from("# tx ty tz\n"));
    for (i, c) in cameras().iter().enumerate() {
        let (uv, z) = c.project(POINTS[0]);
        let t = 1_305_031_102.175_304 + i as f64;
        large_rgb(src.join(format!("rgb/{t:.6}.png")), uv);
        let values = metres(uv, z);
        save(src.join(format!("depth/{t:.6}.png")), |p| {
            let pixel = |x, y| image::Luma([(5000.0 * values[(y * W as u32 / SHRINK + x) as usize]).round() as u16]);
            image::ImageBuffer::from_fn(W as u32 / SHRINK, H as u32 / SHRINK, pixel).save(p).unwrap();
        });
        writeln!(rgbs, "{t:.6} rgb/{t:.6}.png").unwrap();
        // The depth camera is 15 ms late.
        writeln!(depths, "{:.6} depth/{t:.6}.png", t + 0.015).unwrap();
        let p = c.camera_from_world.inverse();
        // Two poses around the picture: it lies in the middle.
        for (dt, side) in [(-0.004, -0.01), (0.004, 0.01)] {
            let at = p.trans + DVec3::X * side;
            let q = p.rot;
            writeln!(truth, "{:.6} {} {} {} {} {} {} {}", t + dt, at.x, at.y, at.z, q.x, q.y, q.z, q.w).unwrap();
        }
    }
    (rgbs, depths, truth)
}

#[test]
fn tum_rgb_d() {
    for associated in [false, true] {
        let (_dir, src) = folder();
        let (rgbs, depths, truth) = tum(&src);
        let write = |name: &str, text: &str| std::fs::write(src.join(name), text).unwrap();
        write("groundtruth.txt", &truth);
        let c = cameras()[0];
        let e = {
            write("rgb.txt", &rgbs);
            write("depth.txt", &depths);
            imported(&src).unwrap_err()
        };
        assert!(e.what.contains("intrinsics") && e.hint.contains("calibration.txt"), "{e}");
        write("calibration.txt", &format!("{} {} {} {}\n", c.fx, c.fy, c.cx - 0.5, c.cy - 0.5));
        if associated {
            let lines = rgbs.lines().skip(1).zip(depths.lines()).map(|(a, b)| format!("{b} {a}\n"));
            write("associations.txt", &lines.collect::<String>());
            std::fs::remove_file(src.join("rgb.txt")).unwrap();
        }
        let (recording, _) = verify(&src, Format::Tum, 1);
        assert_eq!(recording.up, DVec3::Z);
        assert!((recording.frames[0].time.unwrap() - 1_305_031_102.175_304).abs() < 1e-5);
    }
}

/// NeRFCapture's depth once was left out without a word.
#[test]
fn nerf_capture_and_instant_ngp_keep_their_depth() {
    for key in ["integer_depth_scale", "depth_integer_scale"] {
        let (_dir, src) = folder();
        let mut frames = Vec::new();
        for (i, c) in cameras().iter().enumerate() {
            let (uv, z) = c.project(POINTS[0]);
            large_rgb(src.join(format!("images/{i}.png")), uv);
            depth(src.join(format!("images/{i}.depth.png")), uv, z, SHRINK);
            frames.push(json!({ "file_path": format!("images/{i}"), "depth_path": format!("images/{i}.depth.png"),
                "transform_matrix": gl(c), "fl_x": c.fx, "fl_y": c.fy, "cx": c.cx, "cy": c.cy, "w": W, "h": H }));
        }
        let mut top: Value = json!({ "frames": frames });
        top[key] = json!(0.001);
        write_json(src.join("transforms.json"), top.clone());
        let (recording, report) = verify(&src, Format::Nerfstudio, 1);
        assert_eq!(recording.up, DVec3::Y);
        assert!(report.notes.iter().any(|n| n.contains("NeRFCapture")), "{:?}", report.notes);
        top.as_object_mut().unwrap().remove(key);
        write_json(src.join("transforms.json"), top);
        let e = imported(&src).unwrap_err();
        assert!(e.what.contains("integer_depth_scale"), "{e}");
    }
}
