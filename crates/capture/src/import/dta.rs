//! DTA: `cam_K.txt`, `init_keyframes.yml` with `cam_in_ob` (camera-to-world, OpenGL) and time 0 or
//! 1 per frame id, `color_segmented/`, `depth_filtered/` (millimetres, maybe smaller), `mask/`.

use super::numbers::{camera, image_size, pose_from_gl, rows, with_image_ending, wrong};
use super::{Grid, Lens, MaskFrom, Shot};
use crate::{CaptureError, Split};
use std::path::Path;

pub(super) fn read(src: &Path) -> Result<Vec<Shot>, CaptureError> {
    let k_file = src.join("cam_K.txt");
    let text = std::fs::read_to_string(&k_file).map_err(|e| CaptureError::read(&k_file, e))?;
    let flat: Vec<f64> = text.split_whitespace().filter_map(|w| w.parse().ok()).collect();
    let k = rows::<3>(&flat).ok_or_else(|| wrong(&k_file, "K", "3x3 finite numbers"))?;

    let file = src.join("init_keyframes.yml");
    let text = std::fs::read_to_string(&file).map_err(|e| CaptureError::read(&file, e))?;
    let mut shots = Vec::new();
    for frame in keyframes(&text) {
        let place = format!("frame_{}", frame.id);
        let m = rows::<4>(&frame.cam_in_ob)
            .ok_or_else(|| wrong(&file, &format!("{place}.cam_in_ob"), "16 finite numbers"))?;
        let camera_from_world = pose_from_gl(&m, &file, &format!("{place}.cam_in_ob"))?;
        let in_folder = |folder: &str| with_image_ending(src.join(folder).join(&frame.id));
        let color = ["color_segmented", "color_raw", "color"].map(in_folder).into_iter().find(|p| p.is_file());
        let color = color.unwrap_or_else(|| in_folder("color_segmented"));
        let depth = ["depth_filtered", "depth"].map(in_folder).into_iter().find(|p| p.is_file());
        let mask = Some(in_folder("mask")).filter(|p| p.is_file());
        shots.push(Shot {
            state: usize::from(frame.time.unwrap_or_else(|| state_of_id(&frame.id)) > 0.5),
            split: Split::Train,
            camera: camera(&k, image_size(&color)?, camera_from_world),
            lens: Lens::default(),
            color,
            depth: depth.map(Grid::File),
            depth_scale: 1e-3,
            depth_least: 0.0,
            confidence: None,
            film_frame: None,
            mask: mask.map_or(MaskFrom::Alpha, MaskFrom::File),
            occluder: None,
            mask_ids: Vec::new(),
            occluded: false,
            time: None,
        });
    }
    Ok(shots)
}

struct Keyframe {
    id: String,
    cam_in_ob: Vec<f64>,
    time: Option<f64>,
}

/// Id = `<state>_<view>`.
fn state_of_id(id: &str) -> f64 {
    id.split('_').next().and_then(|s| s.parse().ok()).unwrap_or(0.0)
}

/// The few YAML shapes that this file has: mappings by indentation, numbers in `[a, b]` or in `- a`
/// lines.
fn keyframes(text: &str) -> Vec<Keyframe> {
    let mut out: Vec<Keyframe> = Vec::new();
    let mut reading_matrix = false;
    for line in text.lines() {
        let content = line.split('#').next().unwrap_or("").trim();
        if let Some(id) = content.strip_prefix("frame_").and_then(|rest| rest.split(':').next())
            && !line.starts_with(char::is_whitespace)
        {
            out.push(Keyframe { id: id.trim().to_string(), cam_in_ob: Vec::new(), time: None });
            reading_matrix = false;
            continue;
        }
        let Some(frame) = out.last_mut() else { continue };
        let (key, rest) = match content.split_once(':') {
            Some((key, rest)) => (Some(key.trim()), rest),
            None => (None, content),
        };
        match key {
            Some("cam_in_ob") => reading_matrix = true,
            Some("time") => frame.time = rest.trim().parse().ok(),
            None => {}
            Some(_) => reading_matrix = false,
        }
        if key == Some("time") {
            reading_matrix = false;
        }
        if reading_matrix {
            let words = rest.split(|c: char| c.is_whitespace() || ",[]".contains(c));
            frame.cam_in_ob.extend(words.filter(|w| *w != "-").filter_map(|w| w.parse::<f64>().ok()));
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn both_yaml_shapes_are_read() {
        let list = "frame_0000_0001:\n  cam_in_ob:\n  - 1.0\n  - -2.5e-1\n  time: 1\n";
        let flow = "frame_0_1:\n  time: 0\n  cam_in_ob: [1.0, -0.25,\n    3]\n  other: 7\n";
        let (a, b) = (keyframes(list), keyframes(flow));
        assert_eq!(
            (a[0].id.as_str(), a[0].cam_in_ob.as_slice(), a[0].time),
            ("0000_0001", &[1.0, -0.25][..], Some(1.0))
        );
        assert_eq!((b[0].cam_in_ob.as_slice(), b[0].time), (&[1.0, -0.25, 3.0][..], Some(0.0)));
    }
}
