//! `report/index.html`: doubts first, then pictures, joints, time. One folder, no network.

pub mod draw;
pub mod html;
mod plot;

use crate::artifacts::{Joints, Parts, Splats, TwinFile};
use crate::failure::{Failure, Result};
use crate::stage::RunFolder;
use crate::stages::labeller::Labeller;
use crate::stages::targets;
use glam::{DVec3, Vec3};
use hingecast_articulate::PassRecord;
use hingecast_capture::{Recording, Split, ViewCache};
use hingecast_geom::KinematicTree;
use hingecast_splat::metrics;
use image::RgbImage;
use std::path::{Path, PathBuf};

/// One held-out picture: file, PSNR.
pub(crate) struct HeldOut {
    pub file: String,
    pub state: usize,
    pub psnr: f64,
}

pub(crate) struct Content {
    pub twin: TwinFile,
    /// Lengths are metres; otherwise scene units.
    pub metric: bool,
    /// Rows of photos with parts and axes; file, caption.
    pub overlays: Vec<(String, String)>,
    pub held_out: Vec<HeldOut>,
    pub plot: String,
    /// What the passes of the search did.
    pub trace: Vec<PassRecord>,
}

impl Content {
    /// Of lengths.
    pub fn unit(&self) -> &'static str {
        if self.metric { "m" } else { "units" }
    }
}

/// Writes the report of a finished run; answers the path of `index.html`.
///
/// # Errors
/// When the run is unfinished or its recording is gone.
pub fn write(run: &RunFolder) -> Result<PathBuf> {
    run.finished()?;
    let folder = run.folder("report");
    std::fs::create_dir_all(&folder).map_err(Failure::io(&folder))?;
    let twin = TwinFile::read(&run.root)?;
    let recording = crate::prepare::recording_of(run)?;
    let Splats { gaussians, extent, .. } = Splats::read(&run.root)?;
    let found = Joints::read(&run.root)?;
    found.fit(&run.root, recording.n_states, gaussians.len())?;
    twin.fits(&run.root, recording.n_states, &found.tree)?;
    let cache = ViewCache::new(&recording, 64 << 20);
    let background = targets::background(&recording, &cache)?;
    let mut labeller = Labeller::new(&gaussians, &found.labels, run.record.threads.max(1))?;
    let centres = part_centres(&gaussians.means, &found.labels, found.tree.parts.len());

    // First, middle and last state from three sides that are far from each other.
    let n = recording.n_states;
    let mut states = vec![0, n / 2, n - 1];
    states.dedup();
    let mut overlays = Vec::new();
    for &state in &states {
        let q = found.tree.values_at(state);
        labeller.pose(&found.tree, &q)?;
        let frames = spread(&recording, state, 4);
        let mut tiles = Vec::new();
        for f in frames {
            let view = recording.load(f)?;
            let picture = labeller.render(&view.camera, background.0)?;
            let mut image = draw::from_rgb8(&view.rgb, view.camera.width, view.camera.height);
            draw::color_parts(&mut image, &picture.parts);
            draw_axes(&mut image, &view.camera, &found.tree, &q, &centres, extent.diagonal);
            tiles.push(image);
        }
        let file = format!("state_{state:03}.png");
        save(&folder, &file, &draw::row(&tiles))?;
        overlays.push((file, format!("state {state}")));
    }

    // Held-out cameras of these states: photo, twin, difference.
    let mut held_out = Vec::new();
    for &state in &states {
        labeller.pose(&found.tree, &found.tree.values_at(state))?;
        for f in recording.frames_of(state, Split::Test).into_iter().take(2) {
            let view = recording.load(f)?;
            let (w, h) = (view.camera.width, view.camera.height);
            let picture = labeller.render(&view.camera, background.0)?;
            let photo = targets::photo(&view, background);
            let file = format!("held_out_{f:05}.png");
            let (left, right) = (draw::from_rgb_f32(&photo, w, h), draw::from_rgb_f32(&picture.rgb, w, h));
            let difference = draw::difference(&left, &right);
            save(&folder, &file, &draw::row(&[left, right, difference]))?;
            held_out.push(HeldOut { file, state, psnr: metrics::psnr(&picture.rgb, &photo) });
        }
    }
    let plot = plot::joint_values(&twin.tree, extent.diagonal);
    let metric = recording.metric;
    let content = Content { twin, metric, overlays, held_out, plot, trace: Parts::read_trace(&run.root) };
    let path = folder.join("index.html");
    crate::view::write(&run.root.join("twin"), &folder.join("view.html"))?;
    let text = html::page(run, &content);
    hingecast_geom::staging::write_whole(&path, text.as_bytes()).map_err(Failure::io(&path))?;
    Ok(path)
}

fn save(folder: &Path, file: &str, image: &RgbImage) -> Result<()> {
    let path = folder.join(file);
    let mut png = std::io::Cursor::new(Vec::new());
    image.write_to(&mut png, image::ImageFormat::Png).map_err(Failure::io(&path))?;
    // Whole or not at all: in place, a kill left empty pictures behind.
    hingecast_geom::staging::write_quick(&path, png.get_ref()).map_err(Failure::io(&path))
}

/// `count` frames of a state whose cameras are far apart (farthest-point choice).
fn spread(recording: &Recording, state: usize, count: usize) -> Vec<usize> {
    let frames = recording.frames_of(state, Split::Train);
    let Some(&first) = frames.first() else { return Vec::new() };
    let centre = |f: usize| recording.frames[f].camera.centre();
    let mut chosen = vec![first];
    while chosen.len() < count.min(frames.len()) {
        let away = |f: &usize| chosen.iter().map(|c| centre(*c).distance(centre(*f))).fold(f64::INFINITY, f64::min);
        let next = frames.iter().max_by(|a, b| away(a).total_cmp(&away(b))).expect("not empty");
        chosen.push(*next);
    }
    chosen
}

fn part_centres(means: &[[f32; 3]], labels: &[u8], n_parts: usize) -> Vec<DVec3> {
    let mut sums = vec![(DVec3::ZERO, 0.0); n_parts];
    for (m, l) in means.iter().zip(labels) {
        sums[*l as usize].0 += Vec3::from(*m).as_dvec3();
        sums[*l as usize].1 += 1.0;
    }
    sums.into_iter().map(|(s, n)| if n > 0.0 { s / n } else { DVec3::ZERO }).collect()
}

fn draw_axes(
    image: &mut RgbImage,
    camera: &hingecast_geom::Camera,
    tree: &KinematicTree,
    q: &[f64],
    centres: &[DVec3],
    diagonal: f64,
) {
    let poses = tree.poses(q);
    for joint in &tree.joints {
        let screw = joint.screw.transformed(&poses[joint.parent]);
        let centre = poses[joint.child].apply(centres[joint.child]);
        let color = draw::PALETTE[joint.child % draw::PALETTE.len()];
        draw::draw_axis(image, camera, &screw, centre, 0.5 * diagonal, color);
    }
}
