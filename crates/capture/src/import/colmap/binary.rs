//! COLMAP's binary files: little-endian numbers one after the other, counts before lists.

use super::model::{Image, Model, RigFrame, Rigs, assemble, camera, camera_model, pose, pose_by_frames};
use crate::CaptureError;
use glam::{DVec2, DVec3};
use hingecast_geom::Pose;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// What COLMAP writes for a feature without a point.
const NO_POINT: u64 = u64::MAX;
/// Its number of a camera among kinds of sensors.
const CAMERA: u32 = 0;

pub(super) fn read(folder: &Path) -> Result<Model, CaptureError> {
    let mut cameras = BTreeMap::new();
    let mut file = Bytes::open(&folder.join("cameras.bin"))?;
    for _ in 0..file.u64()? {
        let (id, model) = (file.u32()?, file.u32()? as i32);
        let size = (file.u64()?, file.u64()?);
        let Some((name, count)) = camera_model(model) else {
            return Err(file.wrong(&format!("the camera model {model} is unknown")));
        };
        let params = (0..count).map(|_| file.f64()).collect::<Result<Vec<f64>, _>>()?;
        cameras.insert(id, camera(name, size, &params, &file.path)?);
    }

    let mut images = read_images(&folder.join("images.bin"))?;
    let rigs = folder.join("rigs.bin");
    let rigs = if rigs.is_file() { read_rigs(&rigs)? } else { Rigs::new() };
    let frames = folder.join("frames.bin");
    if frames.is_file() {
        pose_by_frames(&mut images, &rigs, &read_frames(&frames)?, &frames)?;
    }
    let points = folder.join("points3D.bin");
    let points = if points.is_file() { read_points(&points)? } else { BTreeMap::new() };
    assemble(cameras, images, points, &rigs, folder)
}

fn read_images(path: &Path) -> Result<Vec<Image>, CaptureError> {
    let mut file = Bytes::open(path)?;
    let mut images = Vec::new();
    for _ in 0..file.u64()? {
        let id = file.u32()?;
        let camera_from_world = file.pose()?;
        let camera = file.u32()?;
        let name = file.text()?;
        let mut seen = Vec::new();
        for _ in 0..file.u64()? {
            let (at, point) = (DVec2::new(file.f64()?, file.f64()?), file.u64()?);
            seen.extend((point != NO_POINT).then_some((at, point)));
        }
        images.push(Image { id, camera, name, camera_from_world, seen });
    }
    Ok(images)
}

fn read_rigs(path: &Path) -> Result<Rigs, CaptureError> {
    let mut file = Bytes::open(path)?;
    let mut rigs = Rigs::new();
    for _ in 0..file.u64()? {
        let (id, sensors) = (file.u32()?, file.u32()?);
        let rig = rigs.entry(id).or_default();
        for k in 0..sensors {
            let (kind, sensor) = (file.u32()?, file.u32()?);
            // The first is the rig's own frame.
            let pose = if k == 0 {
                Some(Pose::IDENTITY)
            } else if file.take::<1>()? == [1] {
                Some(file.pose()?)
            } else {
                None
            };
            if kind == CAMERA {
                rig.insert(sensor, pose);
            }
        }
    }
    Ok(rigs)
}

fn read_frames(path: &Path) -> Result<Vec<RigFrame>, CaptureError> {
    let mut file = Bytes::open(path)?;
    let mut frames = Vec::new();
    for _ in 0..file.u64()? {
        file.u32()?;
        let rig = file.u32()?;
        let rig_from_world = file.pose()?;
        let mut images = Vec::new();
        for _ in 0..file.u32()? {
            let (kind, sensor, data) = (file.u32()?, file.u32()?, file.u64()?);
            images.extend((kind == CAMERA).then_some((sensor, data as u32)));
        }
        frames.push(RigFrame { rig, rig_from_world, images });
    }
    Ok(frames)
}

fn read_points(path: &Path) -> Result<BTreeMap<u64, DVec3>, CaptureError> {
    let mut file = Bytes::open(path)?;
    let mut points = BTreeMap::new();
    for _ in 0..file.u64()? {
        let id = file.u64()?;
        points.insert(id, DVec3::new(file.f64()?, file.f64()?, file.f64()?));
        // Colour, error, and the images that see it.
        file.take::<3>()?;
        file.f64()?;
        for _ in 0..file.u64()? {
            file.u64()?;
        }
    }
    Ok(points)
}

/// A file, read from its start to its end. A count too large ends at the end of the file.
struct Bytes {
    path: PathBuf,
    bytes: Vec<u8>,
    at: usize,
}

impl Bytes {
    fn open(path: &Path) -> Result<Self, CaptureError> {
        let bytes = std::fs::read(path).map_err(|e| CaptureError::read(path, e))?;
        Ok(Self { path: path.to_path_buf(), bytes, at: 0 })
    }

    fn take<const N: usize>(&mut self) -> Result<[u8; N], CaptureError> {
        let found = self.bytes.get(self.at..).and_then(|rest| rest.first_chunk::<N>().copied());
        self.at += N;
        found.ok_or_else(|| self.wrong("it ends too early"))
    }

    fn u32(&mut self) -> Result<u32, CaptureError> {
        self.take().map(u32::from_le_bytes)
    }

    fn u64(&mut self) -> Result<u64, CaptureError> {
        self.take().map(u64::from_le_bytes)
    }

    fn f64(&mut self) -> Result<f64, CaptureError> {
        self.take().map(f64::from_le_bytes)
    }

    fn pose(&mut self) -> Result<Pose, CaptureError> {
        let mut n = [0.0; 7];
        for slot in &mut n {
            *slot = self.f64()?;
        }
        pose(n, &self.path, &format!("byte {}", self.at))
    }

    fn text(&mut self) -> Result<String, CaptureError> {
        let rest = self.bytes.get(self.at..).unwrap_or_default();
        let Some(end) = rest.iter().position(|b| *b == 0) else { return Err(self.wrong("it ends too early")) };
        let text = String::from_utf8_lossy(&rest[..end]).into_owned();
        self.at += end + 1;
        Ok(text)
    }

    fn wrong(&self, what: &str) -> CaptureError {
        CaptureError::new(
            format!("a file of a COLMAP model is damaged: {what}"),
            format!("{}: byte {} of {}", self.path.display(), self.at.min(self.bytes.len()), self.bytes.len()),
            "copy it again, or write text files: colmap model_converter --output_type TXT",
        )
    }
}
