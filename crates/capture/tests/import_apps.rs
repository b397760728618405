//! Exports of apps for phones, each written by hand around one known 3D point. World axes are
//! whatever the app says; the test's cameras do not mind which of them is called up.

mod common;

use common::dots::*;
use glam::DVec3;
use hingecast_capture::import::{Config, Format, ImportReport, detect, import};
use hingecast_capture::{CaptureError, Recording};
use serde_json::json;
use std::io::Write;
use std::path::{Path, PathBuf};

/// Depth's size.
const SMALL: (usize, usize) = (W / SHRINK as usize, H / SHRINK as usize);

fn folder() -> (tempfile::TempDir, PathBuf) {
    let dir = tempfile::tempdir().unwrap();
    let src = dir.path().join("scan");
    std::fs::create_dir(&src).unwrap();
    (dir, src)
}

fn imported(src: &Path, config: &Config) -> Result<(Recording, ImportReport), CaptureError> {
    let out = src.with_extension("imported");
    let report = import(&[src], &out, config, &Default::default())?;
    Ok((Recording::open(&out).unwrap(), report))
}

/// Imports an app's folder: metres, y up, one state, colour at depth's size with exact intrinsics.
fn verify(src: &Path, format: Format) -> (Recording, ImportReport) {
    if src.is_dir() {
        assert_eq!(detect(src).unwrap(), format);
    }
    // All confidences are let through: dots fall on either half.
    let (recording, report) = imported(src, &Config { min_confidence: 0, ..Default::default() }).unwrap();
    assert_eq!((report.formats.clone(), report.states), (vec![format], 1));
    assert!(recording.metric && recording.registered);
    assert_eq!((recording.frames.len(), recording.up), (cameras().len(), DVec3::Y));
    for (i, (f, c)) in recording.frames.iter().zip(cameras()).enumerate() {
        let small = c.resized(SMALL.0, SMALL.1);
        assert_eq!((f.camera.width, f.camera.height), SMALL);
        for (a, b) in
            [(f.camera.fx, small.fx), (f.camera.fy, small.fy), (f.camera.cx, small.cx), (f.camera.cy, small.cy)]
        {
            assert!((a - b).abs() < 1e-4, "{a} {b}");
        }
        shows(&recording, i, POINTS[0]);
    }
    (recording, report)
}

/// Pixels with depth in the left and in the right half of a frame.
fn known_halves(recording: &Recording, frame: usize) -> [usize; 2] {
    let view = recording.load(frame).unwrap();
    let mut halves = [0; 2];
    for (i, z) in view.depth.iter().enumerate() {
        halves[usize::from(i % SMALL.0 >= SMALL.0 / 2)] += usize::from(*z > 0.0);
    }
    halves
}

fn record3d_about() -> serde_json::Value {
    let c = cameras()[0];
    let mut poses: Vec<[f64; 7]> = cameras().iter().map(|c| quaternion(&gl(c))).collect();
    // Numbers 0 2 4 6 8 have pictures, the poses between them are of pictures that were taken away.
    poses = poses.into_iter().flat_map(|p| [p, [0.0, 0.0, 0.0, 1.0, 9.0, 9.0, 9.0]]).collect();
    json!({ "w": W, "h": H, "dw": SMALL.0, "dh": SMALL.1, "fps": 60, "poses": poses,
        "K": [c.fx, 0, 0, 0, c.fy, 0, c.cx, c.cy, 1], "frameTimestamps": [0.0, 0.1] })
}

#[test]
fn record3d_exr() {
    let (_dir, src) = folder();
    for (i, c) in cameras().iter().enumerate() {
        let (uv, z) = c.project(POINTS[0]);
        large_rgb(src.join(format!("rgb/{}.jpg", 2 * i)), uv);
        let values = metres(uv, z);
        let pixels = exr::prelude::SpecificChannels::build()
            .with_channel("R")
            .with_pixel_fn(|at: exr::math::Vec2<usize>| (exr::prelude::f16::from_f32(values[at.1 * SMALL.0 + at.0]),));
        let image = exr::image::Image::from_channels(SMALL, pixels);
        save(src.join(format!("depth/{}.exr", 2 * i)), |p| {
            use exr::prelude::WritableImage;
            image.write().to_file(p).unwrap();
        });
    }
    write_json(src.join("metadata.json"), record3d_about());
    let (recording, report) = verify(&src, Format::Record3d);
    assert_eq!(recording.frames[0].time, Some(0.0));
    assert!(report.notes.iter().any(|n| n.contains("reduced from 64 x 48 to 16 x 12")), "{:?}", report.notes);
    // A folder around it is seen through.
    let outer = src.with_file_name("outer");
    std::fs::create_dir(&outer).unwrap();
    std::fs::rename(&src, outer.join("EXR_RGBD")).unwrap();
    assert_eq!(imported(&outer, &Config::default()).unwrap().1.frames, 5);
}

fn r3d(file: &Path, conf: impl Fn(usize) -> u8) {
    let mut zip = zip::ZipWriter::new(std::fs::File::create(file).unwrap());
    let mut add = |name: String, bytes: &[u8]| {
        zip.start_file(
            name,
            zip::write::SimpleFileOptions::default().compression_method(zip::CompressionMethod::Stored),
        )
        .unwrap();
        zip.write_all(bytes).unwrap();
    };
    let packed = |bytes: &[u8]| {
        let mut out = Vec::new();
        lzfse_rust::encode_bytes(bytes, &mut out).unwrap();
        out
    };
    for (i, c) in cameras().iter().enumerate() {
        let (uv, z) = c.project(POINTS[0]);
        let jpg = file.with_file_name("picture.jpg");
        large_rgb(jpg.clone(), uv);
        add(format!("rgbd/{}.jpg", 2 * i), &std::fs::read(jpg).unwrap());
        let depth: Vec<u8> =
            metres(uv, z).iter().map(|z| if *z > 0.0 { *z } else { 2.5 }).flat_map(f32::to_le_bytes).collect();
        add(format!("rgbd/{}.depth", 2 * i), &packed(&depth));
        let conf: Vec<u8> = (0..SMALL.0 * SMALL.1).map(|p| conf(p % SMALL.0)).collect();
        add(format!("rgbd/{}.conf", 2 * i), &packed(&conf));
    }
    add("metadata".into(), record3d_about().to_string().as_bytes());
    zip.finish().unwrap();
}

#[test]
fn record3d_r3d_and_its_confidence() {
    let (dir, _) = folder();
    let file = dir.path().join("2026-01-01--12-00-00.r3d");
    r3d(&file, |x| if x < SMALL.0 / 2 { 0 } else { 1 });
    verify(&file, Format::Record3d);
    let halves = |min_confidence| {
        let (recording, report) = imported(&file, &Config { min_confidence, ..Default::default() }).unwrap();
        assert_eq!(
            report.notes.iter().any(|n| n.contains("--min-confidence")),
            min_confidence > 0,
            "{:?}",
            report.notes
        );
        known_halves(&recording, 0)
    };
    let half = SMALL.0 * SMALL.1 / 2;
    assert_eq!([halves(0), halves(1), halves(2)], [[half, half], [0, half], [0, 0]]);
    // Nothing of the unpacked zip stays.
    let names: Vec<_> = std::fs::read_dir(dir.path()).unwrap().flatten().map(|e| e.file_name()).collect();
    assert_eq!(names.len(), 4, "{names:?}");
    // Cut short.
    let bytes = std::fs::read(&file).unwrap();
    std::fs::write(&file, &bytes[..bytes.len() / 2]).unwrap();
    let e = imported(&file, &Config::default()).unwrap_err();
    assert!(e.what.contains("cannot be unpacked") && e.place.ends_with(".r3d"), "{e}");
}

/// A real export: 86 frames of a door that stands still.
#[test]
fn record3d_of_a_real_phone() {
    let Some(data) = std::env::var_os("HINGECAST_DATA") else {
        eprintln!("skipped: HINGECAST_DATA is not set, the real Record3D export is not at hand");
        return;
    };
    let src = PathBuf::from(data).join("real-door-handle/EXR_RGBD");
    let dir = tempfile::tempdir().unwrap();
    let out = dir.path().join("rec");
    let report = import(&[&src], &out, &Config { max_views: 12, ..Default::default() }, &Default::default()).unwrap();
    assert_eq!((report.frames, report.formats), (12, vec![Format::Record3d]));
    for said in ["74 of 86 pictures were left out", "intrinsics of 1440 x 1920", "from 720 x 960 to 192 x 256"] {
        assert!(report.notes.iter().any(|n| n.contains(said)), "{:?}", report.notes);
    }
    let recording = Recording::open(&out).unwrap();
    assert!(recording.metric && recording.up == DVec3::Y);
    let camera = recording.frames[0].camera;
    assert!((camera.fx - 1_404.302_978_515_625 * 192.0 / 1440.0).abs() < 1e-9 && camera.width == 192);
    // What one view measured, its neighbour measures, too: 1 cm in the median, where both see it.
    let mut off = Vec::new();
    for pair in [[0, 1], [5, 6], [10, 11]] {
        let [a, b] = pair.map(|i| (recording.frames[i].camera, recording.load(i).unwrap()));
        for i in (0..a.1.depth.len()).filter(|i| a.1.depth[*i] > 0.0) {
            let uv = glam::DVec2::new((i % 192) as f64 + 0.5, (i / 192) as f64 + 0.5);
            let (uv, z) = b.0.project(a.0.unproject(uv, f64::from(a.1.depth[i])));
            if z > 0.1 && uv.cmpge(glam::DVec2::ZERO).all() && uv.x < 192.0 && uv.y < 256.0 {
                let seen = f64::from(b.1.depth[uv.y as usize * 192 + uv.x as usize]);
                off.extend((seen > 0.0).then_some((seen - z).abs()));
            }
        }
    }
    off.sort_by(f64::total_cmp);
    assert!(off.len() > 20_000 && off[off.len() / 2] < 0.01, "{} pixels, {}", off.len(), off[off.len() / 2]);
}

#[test]
fn a_film_is_thinned_evenly_and_says_so() {
    let (dir, _) = folder();
    let file = dir.path().join("film.r3d");
    r3d(&file, |_| 2);
    for (config, times) in [
        (Config { every: 2, ..Default::default() }, vec![0, 2, 4]),
        (Config { max_views: 2, ..Default::default() }, vec![1, 3]),
    ] {
        let (recording, report) = imported(&file, &config).unwrap();
        assert_eq!(recording.frames.len(), times.len());
        for (f, i) in recording.frames.iter().zip(times) {
            assert!((f.camera.centre() - cameras()[i].centre()).length() < 1e-6);
        }
        assert!(report.notes.iter().any(|n| n.contains("of 5 pictures were left out")), "{:?}", report.notes);
    }
}

#[test]
fn scanner_3d_app_without_where_it_was() {
    let (_dir, src) = folder();
    for (i, c) in cameras().iter().enumerate() {
        let n = 3 * i;
        let (uv, z) = c.project(POINTS[0]);
        large_rgb(src.join(format!("frame_{n:05}.jpg")), uv);
        depth(src.join(format!("depth_{n:05}.png")), uv, z, SHRINK);
        confidence(src.join(format!("conf_{n:05}.png")), 2);
        let about = json!({ "intrinsics": k(c).concat(), "cameraPoseARFrame": gl(c).concat(), "time": 0.1 * n as f64,
            "location": { "latitude": 48.858_222, "longitude": 2.2945 } });
        write_json(src.join(format!("frame_{n:05}.json")), about.clone());
        // Depth without a picture.
        write_json(src.join(format!("frame_{:05}.json", n + 1)), about);
        depth(src.join(format!("depth_{:05}.png", n + 1)), uv, z, SHRINK);
    }
    write_json(src.join("info.json"), json!({ "gps": [48.858_222, 2.2945] }));
    let (recording, report) = verify(&src, Format::Scanner3d);
    assert!(report.notes.iter().any(|n| n.contains("5 of 10 frames")), "{:?}", report.notes);
    let text = std::fs::read_to_string(recording.root.join("transforms.json")).unwrap();
    assert!(!text.contains("48.85") && !text.contains("location"));
    let (recording, _) = imported(&src, &Config::default()).unwrap();
    assert_eq!(known_halves(&recording, 0), [0, SMALL.0 * SMALL.1 / 2]);
}

/// The folder of a scan; `film` is what the pictures' place is called, numbered from `first`.
fn stray(src: &Path, pictures: &str, first: usize) {
    let mut csv = String::from(
        "timestamp, frame, x, y, z, qx, qy, qz, qw, fx, fy, cx, cy, distortion_center_x, distortion_center_y\n",
    );
    for (i, c) in cameras().iter().enumerate() {
        let (uv, z) = c.project(POINTS[0]);
        large_rgb(src.join(format!("{pictures}/{:06}.jpg", first + i)), uv);
        depth(src.join(format!("depth/{i:06}.png")), uv, z, SHRINK);
        confidence(src.join(format!("confidence/{i:06}.png")), 2);
        let world_from_camera = c.camera_from_world.inverse();
        let (q, t) = (world_from_camera.rot, world_from_camera.trans);
        csv += &format!(
            "{}, {i:06}, {}, {}, {}, {}, {}, {}, {}, {}, {}, {}, {}, , \n",
            170_340.47 + i as f64 / 60.0,
            t.x,
            t.y,
            t.z,
            q.x,
            q.y,
            q.z,
            q.w,
            c.fx,
            c.fy,
            c.cx,
            c.cy
        );
    }
    std::fs::write(src.join("odometry.csv"), csv).unwrap();
    std::fs::write(src.join("camera_matrix.csv"), "1.0, 0.0, 2.0\n0.0, 1.0, 3.0\n0.0, 0.0, 1.0\n").unwrap();
}

#[test]
fn stray_scanner() {
    for (pictures, first) in [("rgb", 0), ("images", 1)] {
        let (_dir, src) = folder();
        stray(&src, pictures, first);
        let (recording, _) = verify(&src, Format::Stray);
        assert!((recording.frames[1].time.unwrap() - 170_340.486_666).abs() < 1e-3);
    }
    // From 1 and not one for each row: whose picture is which?
    let (_dir, src) = folder();
    stray(&src, "rgb", 1);
    std::fs::remove_file(src.join("rgb/000005.jpg")).unwrap();
    let e = imported(&src, &Config::default()).unwrap_err();
    assert!(e.what.contains("unclear") && e.hint.contains("-start_number 0"), "{e}");
    std::fs::remove_dir_all(src.join("rgb")).unwrap();
    let e = imported(&src, &Config::default()).unwrap_err();
    assert!(e.what.contains("no film"), "{e}");
    // A film that is none: with ffmpeg or without it, three lines say what to run.
    std::fs::write(src.join("rgb.mp4"), "no film").unwrap();
    let e = imported(&src, &Config::default()).unwrap_err();
    assert!(e.place.ends_with("rgb.mp4") && e.hint.contains("ffmpeg -noautorotate -i"), "{e}");
}

/// Pictures of the film are found by their number, also of a film without a steady rate.
#[test]
fn stray_scanner_with_its_film() {
    let (_dir, src) = folder();
    stray(&src, "pictures", 0);
    // Five pictures, the last three of them half a second late, as phones do under load.
    let made = std::process::Command::new("ffmpeg")
        .args(["-nostdin", "-v", "error", "-framerate", "30", "-i"])
        .arg(src.join("pictures/%06d.jpg"))
        .args(["-vf", "setpts='if(gt(N,1),PTS+0.5/TB,PTS)'", "-fps_mode", "vfr", "-qscale:v", "2"])
        .arg(src.join("rgb.mp4"))
        .status();
    if !made.is_ok_and(|status| status.success()) {
        eprintln!("skipped: there is no ffmpeg (5.1 or newer)");
        return;
    }
    verify(&src, Format::Stray);
    let two = Config { max_views: 2, min_confidence: 0, ..Default::default() };
    let (recording, _) = imported(&src, &two).unwrap();
    assert_eq!(recording.frames.len(), 2);
    (0..2).for_each(|i| shows(&recording, i, POINTS[0]));
    // One row more than the film has pictures.
    let csv = std::fs::read_to_string(src.join("odometry.csv")).unwrap();
    let last = csv.lines().last().unwrap();
    std::fs::write(src.join("odometry.csv"), format!("{csv}{last}\n")).unwrap();
    let e = imported(&src, &Config::default()).unwrap_err();
    assert!(e.what.contains("5 of 6 pictures") && e.place.ends_with("rgb.mp4"), "{e}");
}

#[test]
fn polycam_raw_data() {
    let (_dir, src) = folder();
    for (i, c) in cameras().iter().enumerate() {
        let (uv, z) = c.project(POINTS[0]);
        let file = |folder: &str, ending: &str| src.join(format!("keyframes/{folder}/{}.{ending}", 7_000_000 + i));
        large_rgb(file("corrected_images", "jpg"), uv);
        depth(file("depth", "png"), uv, z, SHRINK);
        confidence(file("confidence", "png"), [127, 255][i % 2]);
        let mut about =
            json!({ "fx": c.fx, "fy": c.fy, "cx": c.cx, "cy": c.cy, "width": W, "height": H, "blur_score": 99.0 });
        for (r, row) in gl(c)[..3].iter().enumerate() {
            row.iter().enumerate().for_each(|(k, x)| about[format!("t_{r}{k}")] = json!(x));
        }
        write_json(file("corrected_cameras", "json"), about);
    }
    verify(&src, Format::Polycam);
    let half = SMALL.0 * SMALL.1 / 2;
    for (min_confidence, expected) in [(1, [half, half]), (2, [0, half])] {
        let (recording, _) = imported(&src, &Config { min_confidence, ..Default::default() }).unwrap();
        assert_eq!([0, 1].map(|i| known_halves(&recording, i)[1]), expected);
    }
}

#[test]
fn files_that_are_not_read_are_named_with_what_to_do() {
    let (dir, src) = folder();
    for (name, what, hint) in [
        ("take.mkv", "Azure Kinect", "k4a_mkv2image"),
        ("take.bag", "RealSense", "rs-convert -i"),
        ("take.mcap", "ROS", "rtabmap-export"),
        ("take.svo2", "ZED", "ZED_SVO_Export"),
        ("scan.usdz", "finished model", "raw data"),
    ] {
        let file = src.join(name);
        std::fs::write(&file, [0x1a, 0x45, 0xdf, 0xa3, 0xff, 0xfe]).unwrap();
        for given in [&file, &src] {
            let e = import(&[given], &dir.path().join("out"), &Config::default(), &Default::default()).unwrap_err();
            assert!(e.what.contains(what) && e.hint.contains(hint) && e.place.ends_with(name), "{e}");
            assert_eq!(e.to_string().lines().count(), 3);
        }
        std::fs::remove_file(&file).unwrap();
    }
    let file = dir.path().join("other.zip");
    let mut zip = zip::ZipWriter::new(std::fs::File::create(&file).unwrap());
    zip.start_file("readme.txt", zip::write::SimpleFileOptions::default()).unwrap();
    zip.finish().unwrap();
    let e = imported(&file, &Config::default()).unwrap_err();
    assert!(e.what.contains("no recording") && e.hint.contains("Record3D"), "{e}");
    // Two scans in a folder: each is a source.
    std::fs::create_dir_all(src.join("a/keyframes/cameras")).unwrap();
    std::fs::create_dir_all(src.join("b/keyframes/cameras")).unwrap();
    let e = imported(&src, &Config::default()).unwrap_err();
    assert!(e.what.contains("2 recordings") && e.hint.contains("/a ") && e.hint.contains("-o RECORDING"), "{e}");
}
