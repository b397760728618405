//! From a rendered picture to the files of a frame, and the truth folder.

use super::SynthConfig;
use super::plan::Shot;
use super::ranges::UsefulRange;
use super::render::{Picture, centre_ray};
use super::scene::Scene;
use super::world::Placement;
use crate::object::ArticulatedObject;
use crate::recording::images;
use crate::{CaptureError, Frame, Truth};
use hingecast_geom::Camera;
use std::path::Path;

/// A frame is useless when a hand hides this share of the object's pixels.
const WHOLLY_HIDDEN: f64 = 0.6;

/// A picture split into what the files hold, row-major.
pub(crate) struct Exposure {
    pub rgb: Vec<u8>,
    /// Scene units, 0 = unknown.
    pub depth: Vec<f32>,
    /// 255 = object.
    pub mask: Vec<u8>,
    /// Part id + 1, 0 = background; stays exact whatever the sensor does.
    pub labels: Vec<u8>,
    /// 255 = hand, also where it only tints the pixel: a ring of one pixel around it, since colour
    /// is supersampled.
    pub occluder: Option<Vec<u8>>,
    pub occluded: bool,
}

impl Exposure {
    /// `n_parts` of the object, then `n_around` of what stands around it; a part beyond them is a
    /// hand.
    pub fn new(picture: Picture, n_parts: usize, n_around: usize, width: usize) -> Self {
        let is_hand = |p: u16| usize::from(p) > n_parts + n_around;
        let own = |p: u16| if usize::from(p) > n_parts { 0 } else { p as u8 };
        let labels: Vec<u8> = picture.part.iter().map(|&p| own(p)).collect();
        let height = picture.part.len() / width.max(1);
        let near = |k: usize, end: usize| k.saturating_sub(1)..(k + 2).min(end);
        let tinted = |i: usize| {
            near(i / width, height).any(|y| near(i % width, width).any(|x| is_hand(picture.part[y * width + x])))
        };
        let hand: Vec<u8> = (0..picture.part.len()).map(|i| if tinted(i) { 255 } else { 0 }).collect();
        Self {
            rgb: picture.rgb,
            depth: picture.depth,
            mask: labels.iter().map(|&p| if p > 0 { 255 } else { 0 }).collect(),
            occluder: hand.iter().any(|&h| h > 0).then_some(hand),
            labels,
            occluded: false,
        }
    }

    /// Marks the frame as occluded when the hand hides most of the object. `bare` is the scene
    /// without the hand, in which the object has `n_parts`.
    pub fn note_hidden(&mut self, bare: &Scene, n_parts: usize, camera: &Camera) {
        let Some(hand) = &self.occluder else { return };
        let hits = |i: usize| {
            let (origin, direction) = centre_ray(camera, i % camera.width, i / camera.width);
            bare.cast(origin, direction, f32::INFINITY).is_some_and(|hit| hit.part < n_parts)
        };
        let hidden = (0..hand.len()).filter(|&i| hand[i] > 0 && hits(i)).count() as f64;
        let visible = self.labels.iter().filter(|&&p| p > 0).count() as f64;
        self.occluded = hidden > WHOLLY_HIDDEN * (hidden + visible);
    }
}

/// Folder of a truth that holds the pixels of hands, where the recording itself does not.
pub(super) const HANDS: &str = "hands";

/// Writes the images of a shot; `camera` is the one that the recording will state. Without a folder
/// for masks or hands, there are none.
pub(super) fn write(
    shot: &Shot,
    camera: Camera,
    e: &Exposure,
    depth_scale: f64,
    root: &Path,
    truth: Option<&Path>,
) -> Result<Frame, CaptureError> {
    let (w, h) = (camera.width, camera.height);
    let name = format!("s{:03}_v{:03}.png", shot.state, shot.view);
    let file = |folder: &str| root.join(folder).join(&name);
    images::write_rgb(&file("rgb"), &e.rgb, w, h)?;
    let per_unit = 1.0 / depth_scale;
    let units: Vec<u16> = e.depth.iter().map(|&z| (f64::from(z) * per_unit).round() as u16).collect();
    images::write_depth(&file("depth"), &units, w, h)?;
    let mask = root.join("mask").is_dir().then(|| file("mask"));
    if let Some(mask) = &mask {
        images::write_gray(mask, &e.mask, w, h)?;
    }
    let occluder = e.occluder.as_ref().filter(|_| root.join("occluder").is_dir());
    if let Some(hand) = occluder {
        images::write_gray(&file("occluder"), hand, w, h)?;
    }
    if let Some(truth) = truth {
        images::write_gray(&truth.join("labels").join(&name), &e.labels, w, h)?;
        if let Some(hand) = e.occluder.as_ref().filter(|_| truth.join(HANDS).is_dir()) {
            images::write_gray(&truth.join(HANDS).join(&name), hand, w, h)?;
        }
    }
    Ok(Frame {
        state: shot.state,
        view: shot.view,
        split: shot.split,
        camera,
        color: file("rgb"),
        depth: Some(file("depth")),
        depth_scale,
        mask,
        mask_ids: Vec::new(),
        occluded: e.occluded,
        occluder_mask: occluder.map(|_| file("occluder")),
        time: None,
    })
}

pub(super) fn write_truth(
    object: &ArticulatedObject,
    config: &SynthConfig,
    ranges: &[UsefulRange],
    states: &[Vec<f64>],
    shots: &[Shot],
    placement: &Placement,
    root: &Path,
) -> Result<(), CaptureError> {
    let mut tree = object.tree.clone();
    for (i, joint) in tree.joints.iter_mut().enumerate() {
        joint.values = states.iter().map(|q| q[i]).collect();
        joint.limits = [ranges[i].lower.min(ranges[i].upper), ranges[i].lower.max(ranges[i].upper)];
    }
    for (part, name) in tree.parts.iter().enumerate() {
        let path = root.join("parts").join(format!("{name}.ply"));
        object.part_mesh(part).write_ply(&path).map_err(|e| CaptureError::write(&path, e))?;
    }
    let truth = Truth {
        root: root.to_path_buf(),
        object: object.name.clone(),
        tree,
        diagonal: object.diagonal(),
        n_states: config.states,
        source_limits: object.tree.joints.iter().map(|j| j.limits).collect(),
        cameras: shots.iter().map(|s| s.camera).collect(),
        world_from_object: placement.world_from_object.clone(),
        recording_from_world: placement.recording_from_world.clone(),
        film_times: config.film.map_or(Vec::new(), |n| (1..=n).map(|state| super::film::time(state, 0)).collect()),
    };
    truth.write()
}
