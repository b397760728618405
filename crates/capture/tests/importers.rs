//! Each layout is written by hand around one known 3D point: after the import it must project to
//! its pixel, with its depth and mask. Conversions here are written out anew, not taken from the
//! crate.

mod common;

use common::dots::*;
use glam::DVec2;
use hingecast_capture::import::{Config, Format, detect, import};
use hingecast_capture::{Recording, Split};
use hingecast_geom::Camera;
use serde_json::json;
use std::path::{Path, PathBuf};

struct Expect {
    format: Format,
    states: usize,
    depth: bool,
    mask: bool,
}

/// Imports `src` with the format detected, and looks for the point of each state in each picture.
fn verify(src: &Path, e: &Expect) -> Recording {
    assert_eq!(detect(src).unwrap(), e.format);
    let out = src.with_extension("imported");
    let report = import(&[src], &out, &Config::default(), &Default::default()).unwrap();
    assert_eq!((report.formats, report.states), (vec![e.format], e.states));
    let recording = Recording::open(&out).unwrap();
    for (i, f) in recording.frames.iter().enumerate() {
        let (uv, z) = f.camera.project(POINTS[f.state]);
        let (w, h) = (f.camera.width, f.camera.height);
        let p = uv.y.floor() as usize * w + uv.x.floor() as usize;
        let view = recording.load(i).unwrap();
        let [r, g, b] = [0, 1, 2].map(|c| view.rgb[3 * p + c]);
        assert!(r > 150 && g < 100 && b < 100, "state {} view {}: {r} {g} {b} at {uv}", f.state, f.view);
        if e.depth {
            assert!((f64::from(view.depth[p]) - z).abs() < 2e-3, "{} {z}", view.depth[p]);
        }
        if e.mask {
            let far = ((h as f64 - 1.0 - uv.y.floor()) as usize) * w + (w as f64 - 1.0 - uv.x.floor()) as usize;
            assert_eq!((view.mask[p], view.mask[far]), (1, 0));
        }
    }
    recording
}

fn folder() -> (tempfile::TempDir, PathBuf) {
    let dir = tempfile::tempdir().unwrap();
    let src = dir.path().join("src");
    std::fs::create_dir(&src).unwrap();
    (dir, src)
}

#[test]
fn artgs() {
    let (_dir, src) = folder();
    for (s, name) in ["start", "end"].iter().enumerate() {
        for part in ["train", "test"] {
            let mut frames = Vec::new();
            for (i, c) in cameras().iter().enumerate() {
                let (uv, z) = c.project(POINTS[s]);
                rgba(src.join(format!("{name}/{part}/rgba/{i:04}.png")), uv);
                depth(src.join(format!("{name}/{part}/depth/{i:04}.png")), uv, z, 1);
                // Some releases leave the ending away.
                let file = if i == 0 {
                    format!("{name}/{part}/rgba/{i:04}")
                } else {
                    format!("./{name}/{part}/rgba/{i:04}.png")
                };
                frames.push(json!({"file_path": file, "time": s, "transform_matrix": gl(c)}));
            }
            let fov = 2.0 * (0.5 * W as f64 / cameras()[0].fx).atan();
            write_json(
                src.join(format!("transforms_{part}_{name}.json")),
                json!({"camera_angle_x": fov, "frames": frames}),
            );
        }
    }
    let r = verify(&src, &Expect { format: Format::Artgs, states: 2, depth: true, mask: true });
    assert_eq!((r.frames_of(0, Split::Train).len(), r.frames_of(1, Split::Test).len()), (5, 5));
    // Below 0.1 m is invalid.
    assert!(r.load(0).unwrap().depth.iter().all(|&z| z == 0.0 || z > 0.1));
}

#[test]
fn dta() {
    let (_dir, src) = folder();
    let mut yml = String::new();
    for s in 0..2 {
        for (i, c) in cameras().iter().enumerate() {
            let (uv, z) = c.project(POINTS[s]);
            let id = format!("{s:04}_{i:04}");
            rgb(src.join(format!("color_segmented/{id}.png")), uv);
            depth(src.join(format!("depth_filtered/{id}.png")), uv, z, 2);
            mask(src.join(format!("mask/{id}.png")), uv, 255);
            yml += &format!("frame_{id}:\n  cam_in_ob:\n");
            gl(c).concat().iter().for_each(|x| yml += &format!("  - {x}\n"));
            yml += &format!("  time: {s}\n");
        }
    }
    std::fs::write(src.join("init_keyframes.yml"), yml).unwrap();
    let rows = k(&cameras()[0]).map(|r| format!("{} {} {}", r[0], r[1], r[2]));
    std::fs::write(src.join("cam_K.txt"), rows.join("\n")).unwrap();
    verify(&src, &Expect { format: Format::Dta, states: 2, depth: true, mask: true });
}

#[test]
fn paris() {
    let (_dir, src) = folder();
    for (s, name) in ["start", "end"].iter().enumerate() {
        for part in ["train", "val", "test"] {
            let mut file = json!({"K": k(&cameras()[0])});
            for (i, c) in cameras().iter().enumerate() {
                rgba(src.join(format!("{name}/{part}/{i:04}.png")), c.project(POINTS[s]).0);
                file[format!("{i:04}")] = json!(gl(c));
            }
            write_json(src.join(format!("{name}/camera_{part}.json")), file);
        }
    }
    let r = verify(&src, &Expect { format: Format::Paris, states: 2, depth: false, mask: true });
    assert_eq!((r.frames_of(0, Split::Train).len(), r.frames_of(0, Split::Test).len()), (5, 10));
}

#[test]
fn screwsplat() {
    let (_dir, src) = folder();
    for (s, point) in POINTS.iter().enumerate() {
        let state = src.join(format!("{s}"));
        npy(state.join("intrinsic.npy"), &[3, 3], &k(&cameras()[0]).concat());
        for (i, c) in cameras().iter().enumerate() {
            let (uv, z) = c.project(*point);
            rgba(state.join(format!("images/{i:03}.png")), uv);
            npy(state.join(format!("extrinsics/{i:03}.npy")), &[4, 4], &cv(c).concat());
            npy(state.join(format!("depths/{i:03}.npy")), &[H as u64, W as u64], &vec![z; W * H]);
        }
    }
    verify(&src, &Expect { format: Format::Screwsplat, states: 2, depth: true, mask: true });
}

#[test]
fn dynamic_3d_gaussians() {
    let (_dir, src) = folder();
    let (mut ks, mut w2cs, mut names) = (Vec::new(), Vec::new(), Vec::new());
    for (t, point) in POINTS.iter().enumerate() {
        let list = cameras();
        ks.push(list.iter().map(k).collect::<Vec<_>>());
        w2cs.push(list.iter().map(cv).collect::<Vec<_>>());
        names.push((0..list.len()).map(|c| format!("{c}/{t:06}.jpg")).collect::<Vec<_>>());
        for (c, camera) in list.iter().enumerate() {
            let uv = camera.project(*point).0;
            rgb(src.join(format!("ims/{c}/{t:06}.jpg")), uv);
            mask(src.join(format!("seg/{c}/{t:06}.png")), uv, 1);
        }
    }
    write_json(src.join("train_meta.json"), json!({"w": W, "h": H, "k": ks, "w2c": w2cs, "fn": names}));
    verify(&src, &Expect { format: Format::Dynamic3dgs, states: 2, depth: false, mask: true });
}

/// OpenCV's distortion, written out.
fn distorted(c: &Camera, uv: DVec2, [k1, k2, p1, p2, k3]: [f64; 5]) -> DVec2 {
    let (x, y) = ((uv.x - c.cx) / c.fx, (uv.y - c.cy) / c.fy);
    let r2 = x * x + y * y;
    let radial = 1.0 + k1 * r2 + k2 * r2 * r2 + k3 * r2 * r2 * r2;
    let xd = x * radial + 2.0 * p1 * x * y + p2 * (r2 + 2.0 * x * x);
    let yd = y * radial + p1 * (r2 + 2.0 * y * y) + 2.0 * p2 * x * y;
    DVec2::new(xd * c.fx + c.cx, yd * c.fy + c.cy)
}

#[test]
fn nerfstudio_is_undistorted() {
    let (_dir, src) = folder();
    let lens = [1.8, 0.4, 0.02, -0.03, 0.1];
    let mut moved = 0f64;
    let mut frames = Vec::new();
    for (s, point) in POINTS.iter().enumerate() {
        for (i, c) in cameras().iter().enumerate() {
            let (uv, z) = c.project(*point);
            let uv_d = distorted(c, uv, lens);
            moved = moved.max(uv.distance(uv_d));
            rgb(src.join(format!("images/{s}_{i}.png")), uv_d);
            depth(src.join(format!("depth/{s}_{i}.png")), uv_d, z, 1);
            mask(src.join(format!("masks/{s}_{i}.png")), uv_d, 255);
            frames.push(
                json!({"file_path": format!("images/{s}_{i}.png"), "depth_file_path": format!("depth/{s}_{i}.png"),
                "mask_path": format!("masks/{s}_{i}.png"), "time": 0.5 * s as f64, "transform_matrix": gl(c)}),
            );
        }
    }
    assert!(moved > 1.6, "the test should test something: {moved}");
    let c = cameras()[0];
    let [k1, k2, p1, p2, k3] = lens;
    write_json(
        src.join("transforms.json"),
        json!({"w": W, "h": H, "fl_x": c.fx, "fl_y": c.fy, "cx": c.cx, "cy": c.cy, "camera_model": "OPENCV",
            "k1": k1, "k2": k2, "p1": p1, "p2": p2, "k3": k3, "frames": frames}),
    );
    let refused = Recording::open(&src).unwrap_err().to_string();
    assert!(refused.contains("field is missing: state") || refused.contains("hingecast import"), "{refused}");
    let r = verify(&src, &Expect { format: Format::Nerfstudio, states: 2, depth: true, mask: true });
    // Pincushion: the corners of the ideal picture lie outside the recorded one.
    assert!(r.load(0).unwrap().usable[0] == 0);
}

#[test]
fn nerfstudio_with_a_folder_per_state() {
    let (_dir, src) = folder();
    for (s, point) in POINTS.iter().enumerate() {
        let state = src.join(["closed", "open"][s]);
        let mut frames = Vec::new();
        for (i, c) in cameras().iter().enumerate() {
            rgba(state.join(format!("images/{i}.png")), c.project(*point).0);
            frames.push(
                json!({"file_path": format!("images/{i}.png"), "transform_matrix": gl(c), "fl_x": c.fx, "fl_y": c.fy}),
            );
        }
        write_json(state.join("transforms.json"), json!({"frames": frames}));
    }
    verify(&src, &Expect { format: Format::Nerfstudio, states: 2, depth: false, mask: true });
}

#[test]
fn broken_sources_end_in_three_lines() {
    let (_dir, src) = folder();
    let fails = |what: &str| {
        let e = import(&[&src], &src.with_extension("out"), &Config::default(), &Default::default())
            .unwrap_err()
            .to_string();
        assert!(e.lines().count() == 3 && e.contains(what), "{e}");
    };
    fails("not recognised");
    std::fs::write(src.join("train_meta.json"), "{").unwrap();
    fails("not JSON");
    std::fs::write(src.join("train_meta.json"), "{\"w\": 4, \"h\": 4, \"fn\": [[\"a.jpg\"]], \"k\": [[[1, 2]]]}")
        .unwrap();
    fails("k[0][0]");
    std::fs::remove_file(src.join("train_meta.json")).unwrap();
    std::fs::write(src.join("cam_K.txt"), "1 2 3").unwrap();
    fails("3x3");
    std::fs::write(src.join("cam_K.txt"), "9 0 3 0 9 3 0 0 1").unwrap();
    fails("init_keyframes.yml");
    std::fs::write(src.join("init_keyframes.yml"), "frame_0_0:\n  cam_in_ob: [1, 2]\n").unwrap();
    fails("16 finite numbers");
}
