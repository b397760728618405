//! COLMAP's text files: numbers between blanks, `#` before comments.

use super::model::{Image, Model, RigFrame, Rigs, assemble, camera, pose, pose_by_frames};
use crate::CaptureError;
use glam::{DVec2, DVec3};
use hingecast_geom::Pose;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

pub(super) fn read(folder: &Path) -> Result<Model, CaptureError> {
    let mut cameras = BTreeMap::new();
    let file = folder.join("cameras.txt");
    for line in lines(&file)? {
        let mut words = Words::new(&file, &line);
        let id = words.whole()?;
        let model = words.word()?.to_string();
        let size = (words.whole()?, words.whole()?);
        cameras.insert(id as u32, camera(&model, size, &words.rest()?, &file)?);
    }

    let rigs = folder.join("rigs.txt");
    let rigs = if rigs.is_file() { read_rigs(&rigs)? } else { Rigs::new() };
    let frames_file = folder.join("frames.txt");
    let mut images = read_images(&folder.join("images.txt"))?;
    if frames_file.is_file() {
        pose_by_frames(&mut images, &rigs, &read_frames(&frames_file)?, &frames_file)?;
    }
    let file = folder.join("points3D.txt");
    let mut points = BTreeMap::new();
    // Only the scale needs them.
    for line in if file.is_file() { lines(&file)? } else { Vec::new() } {
        let mut words = Words::new(&file, &line);
        points.insert(words.whole()?, DVec3::new(words.number()?, words.number()?, words.number()?));
    }
    assemble(cameras, images, points, &rigs, folder)
}

/// Two lines an image, the second of which may be empty.
fn read_images(file: &Path) -> Result<Vec<Image>, CaptureError> {
    let text = read_text(file)?;
    let mut lines = text.lines();
    let mut images = Vec::new();
    while let Some(line) = lines.next() {
        if line.trim().is_empty() || line.trim_start().starts_with('#') {
            continue;
        }
        let mut words = Words::new(file, line);
        let id = words.whole()? as u32;
        let camera_from_world = words.pose()?;
        let camera = words.whole()? as u32;
        let name = words.left.trim().to_string();
        let numbers: Vec<f64> = lines.next().unwrap_or("").split_whitespace().filter_map(|w| w.parse().ok()).collect();
        let seen = numbers.as_chunks::<3>().0.iter().filter(|[_, _, id]| *id >= 0.0);
        let seen = seen.map(|[x, y, id]| (DVec2::new(*x, *y), *id as u64)).collect();
        images.push(Image { id, camera, name, camera_from_world, seen });
    }
    Ok(images)
}

fn read_rigs(file: &Path) -> Result<Rigs, CaptureError> {
    let mut rigs = Rigs::new();
    for line in lines(file)? {
        let mut words = Words::new(file, &line);
        let (id, sensors) = (words.whole()? as u32, words.whole()?);
        let rig = rigs.entry(id).or_default();
        for k in 0..sensors {
            let kind = words.word()?.to_string();
            let sensor = words.whole()? as u32;
            // The first is the rig's own frame.
            let pose = if k == 0 {
                Some(Pose::IDENTITY)
            } else if words.whole()? == 1 {
                Some(words.pose()?)
            } else {
                None
            };
            if kind == "CAMERA" {
                rig.insert(sensor, pose);
            }
        }
    }
    Ok(rigs)
}

fn read_frames(file: &Path) -> Result<Vec<RigFrame>, CaptureError> {
    let mut frames = Vec::new();
    for line in lines(file)? {
        let mut words = Words::new(file, &line);
        words.whole()?;
        let rig = words.whole()? as u32;
        let rig_from_world = words.pose()?;
        let mut images = Vec::new();
        for _ in 0..words.whole()? {
            let is_camera = words.word()? == "CAMERA";
            let (sensor, data) = (words.whole()? as u32, words.whole()? as u32);
            images.extend(is_camera.then_some((sensor, data)));
        }
        frames.push(RigFrame { rig, rig_from_world, images });
    }
    Ok(frames)
}

fn read_text(file: &Path) -> Result<String, CaptureError> {
    std::fs::read_to_string(file).map_err(|e| CaptureError::read(file, e))
}

/// Lines that are neither empty nor comments.
fn lines(file: &Path) -> Result<Vec<String>, CaptureError> {
    let text = read_text(file)?;
    let lines = text.lines().map(str::trim).filter(|l| !l.is_empty() && !l.starts_with('#'));
    Ok(lines.map(String::from).collect())
}

/// The words of a line, one after the other.
struct Words<'a> {
    file: PathBuf,
    line: &'a str,
    left: &'a str,
}

impl<'a> Words<'a> {
    fn new(file: &Path, line: &'a str) -> Self {
        Self { file: file.to_path_buf(), line, left: line }
    }

    fn word(&mut self) -> Result<&'a str, CaptureError> {
        let start = self.left.trim_start();
        let (word, left) = start.split_at(start.find(char::is_whitespace).unwrap_or(start.len()));
        self.left = left;
        if word.is_empty() { Err(self.wrong("more numbers")) } else { Ok(word) }
    }

    fn number(&mut self) -> Result<f64, CaptureError> {
        let number: Option<f64> = self.word()?.parse().ok();
        number.filter(|x| x.is_finite()).ok_or_else(|| self.wrong("a finite number"))
    }

    fn whole(&mut self) -> Result<u64, CaptureError> {
        self.word()?.parse().map_err(|_| self.wrong("a whole number"))
    }

    fn pose(&mut self) -> Result<Pose, CaptureError> {
        let mut n = [0.0; 7];
        for slot in &mut n {
            *slot = self.number()?;
        }
        pose(n, &self.file, self.line.get(..40).unwrap_or(self.line))
    }

    fn rest(&mut self) -> Result<Vec<f64>, CaptureError> {
        let mut out = Vec::new();
        while !self.left.trim().is_empty() {
            out.push(self.number()?);
        }
        Ok(out)
    }

    fn wrong(&self, expected: &str) -> CaptureError {
        let line: String = self.line.chars().take(80).collect();
        CaptureError::new(
            format!("a line of a COLMAP model is wrong: {expected} expected"),
            format!("{}: {line}", self.file.display()),
            "export the model again: colmap model_converter --output_type TXT",
        )
    }
}
