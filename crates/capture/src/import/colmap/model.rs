//! A sparse model in memory, however it was stored.

use super::super::Lens;
use crate::CaptureError;
use glam::{DQuat, DVec2, DVec3};
use hingecast_geom::{Camera, Pose};
use std::collections::BTreeMap;
use std::path::Path;

pub(super) struct Model {
    /// Pinhole (pose unset) and lens, by id.
    pub cameras: BTreeMap<u32, (Camera, Lens)>,
    /// By name.
    pub images: Vec<Image>,
    pub points: BTreeMap<u64, DVec3>,
    /// A rig has more than one camera.
    pub has_rigs: bool,
}

pub(super) struct Image {
    pub id: u32,
    pub camera: u32,
    pub name: String,
    pub camera_from_world: Pose,
    /// Where points of the model are seen: pixel and point.
    pub seen: Vec<(DVec2, u64)>,
}

/// Cameras of a rig by id: each one's pose in the rig, where it is known.
pub(super) type Rigs = BTreeMap<u32, BTreeMap<u32, Option<Pose>>>;

pub(super) struct RigFrame {
    pub rig: u32,
    pub rig_from_world: Pose,
    /// Camera and image.
    pub images: Vec<(u32, u32)>,
}

/// Numbers of parameters of COLMAP's camera models, by their ids.
const MODELS: [(&str, usize); 11] = [
    ("SIMPLE_PINHOLE", 3),
    ("PINHOLE", 4),
    ("SIMPLE_RADIAL", 4),
    ("RADIAL", 5),
    ("OPENCV", 8),
    ("OPENCV_FISHEYE", 8),
    ("FULL_OPENCV", 12),
    ("FOV", 5),
    ("SIMPLE_RADIAL_FISHEYE", 4),
    ("RADIAL_FISHEYE", 5),
    ("THIN_PRISM_FISHEYE", 12),
];

/// Name and number of parameters of a camera model.
pub(super) fn camera_model(id: i32) -> Option<(&'static str, usize)> {
    MODELS.get(usize::try_from(id).ok()?).copied()
}

/// The camera of a model's parameters.
pub(super) fn camera(model: &str, size: (u64, u64), p: &[f64], file: &Path) -> Result<(Camera, Lens), CaptureError> {
    let place = || format!("{}: {model} {p:?}", file.display());
    let undistort = "colmap image_undistorter makes pinhole pictures and a model of them";
    let ideal = Lens::default();
    let ([fx, fy, cx, cy], lens) = match (model, p) {
        ("SIMPLE_PINHOLE", &[f, cx, cy]) => ([f, f, cx, cy], ideal),
        ("PINHOLE", &[fx, fy, cx, cy]) => ([fx, fy, cx, cy], ideal),
        ("SIMPLE_RADIAL", &[f, cx, cy, k]) => ([f, f, cx, cy], Lens { k: [k, 0.0, 0.0, 0.0], ..ideal }),
        ("RADIAL", &[f, cx, cy, k1, k2]) => ([f, f, cx, cy], Lens { k: [k1, k2, 0.0, 0.0], ..ideal }),
        ("OPENCV", &[fx, fy, cx, cy, k1, k2, p1, p2]) => {
            ([fx, fy, cx, cy], Lens { k: [k1, k2, 0.0, 0.0], p: [p1, p2], fisheye: false })
        }
        // Its radial series is a quotient; ours has no divisor.
        ("FULL_OPENCV", &[fx, fy, cx, cy, k1, k2, p1, p2, k3, 0.0, 0.0, 0.0]) => {
            ([fx, fy, cx, cy], Lens { k: [k1, k2, k3, 0.0], p: [p1, p2], fisheye: false })
        }
        ("OPENCV_FISHEYE", &[fx, fy, cx, cy, k1, k2, k3, k4]) => {
            ([fx, fy, cx, cy], Lens { k: [k1, k2, k3, k4], p: [0.0; 2], fisheye: true })
        }
        ("SIMPLE_RADIAL_FISHEYE", &[f, cx, cy, k]) => {
            ([f, f, cx, cy], Lens { k: [k, 0.0, 0.0, 0.0], p: [0.0; 2], fisheye: true })
        }
        ("RADIAL_FISHEYE", &[f, cx, cy, k1, k2]) => {
            ([f, f, cx, cy], Lens { k: [k1, k2, 0.0, 0.0], p: [0.0; 2], fisheye: true })
        }
        _ => return Err(CaptureError::new(format!("the camera model {model} is not read"), place(), undistort)),
    };
    if !p.iter().all(|x| x.is_finite()) {
        return Err(CaptureError::new("a camera has a number that is not finite", place(), undistort));
    }
    let (width, height) = (size.0 as usize, size.1 as usize);
    Ok((Camera { width, height, fx, fy, cx, cy, camera_from_world: Pose::IDENTITY }, lens))
}

/// The transform of COLMAP's qw qx qy qz tx ty tz.
pub(super) fn pose(n: [f64; 7], file: &Path, place: &str) -> Result<Pose, CaptureError> {
    let rot = DQuat::from_xyzw(n[1], n[2], n[3], n[0]);
    if !(rot.length() > 0.5 && rot.length() < 2.0 && n.iter().all(|x| x.is_finite())) {
        let what = format!("a pose is none: QW QX QY QZ TX TY TZ = {n:?}");
        return Err(CaptureError::new(what, format!("{}: {place}", file.display()), "export the model again"));
    }
    Ok(Pose::new(rot.normalize(), DVec3::new(n[4], n[5], n[6])))
}

/// With frames, poses come from them: those in `images` are not kept up by newer versions.
pub(super) fn pose_by_frames(
    images: &mut Vec<Image>,
    rigs: &Rigs,
    frames: &[RigFrame],
    file: &Path,
) -> Result<(), CaptureError> {
    let mut placed = BTreeMap::new();
    for frame in frames {
        for &(camera, image) in &frame.images {
            let in_rig = rigs.get(&frame.rig).and_then(|rig| rig.get(&camera)).copied().flatten();
            let Some(camera_from_rig) = in_rig else {
                let what = format!("camera {camera} of rig {} has no pose in it", frame.rig);
                let hint = "let COLMAP estimate it (rig_configurator, mapper), or export without rigs";
                return Err(CaptureError::new(what, file.display().to_string(), hint));
            };
            let (a, b) = (camera_from_rig, frame.rig_from_world);
            placed.insert(image, Pose::new(a.rot * b.rot, a.apply(b.trans)));
        }
    }
    // Images of no frame were not registered.
    images.retain(|i| placed.contains_key(&i.id));
    images.iter_mut().for_each(|i| i.camera_from_world = placed[&i.id]);
    Ok(())
}

/// Puts the parts together, images by name; every image has a camera.
pub(super) fn assemble(
    cameras: BTreeMap<u32, (Camera, Lens)>,
    mut images: Vec<Image>,
    points: BTreeMap<u64, DVec3>,
    rigs: &Rigs,
    folder: &Path,
) -> Result<Model, CaptureError> {
    images.sort_by(|a, b| a.name.cmp(&b.name));
    if let Some(i) = images.iter().find(|i| !cameras.contains_key(&i.camera)) {
        let what = format!("image {} has camera {}, which is not there", i.name, i.camera);
        return Err(CaptureError::new(what, folder.display().to_string(), "copy all files of one model"));
    }
    Ok(Model { cameras, images, points, has_rigs: rigs.values().any(|r| r.len() > 1) })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The second camera of a rig stands beside the first; what `images` says of either is old.
    #[test]
    fn cameras_of_a_rig_stand_where_the_rig_does() {
        let old = Pose::from_trans(DVec3::new(9.0, 9.0, 9.0));
        let image = |id, camera| Image { id, camera, name: id.to_string(), camera_from_world: old, seen: vec![] };
        let mut images = vec![image(4, 1), image(5, 2), image(6, 1)];
        let turned = Pose::new(DQuat::from_rotation_y(0.3), DVec3::new(-0.1, 0.0, 0.0));
        let rigs = Rigs::from([(7, BTreeMap::from([(1, Some(Pose::IDENTITY)), (2, Some(turned))]))]);
        let rig_from_world = Pose::new(DQuat::from_rotation_z(1.0), DVec3::new(1.0, 2.0, 3.0));
        let frames = [RigFrame { rig: 7, rig_from_world, images: vec![(1, 4), (2, 5)] }];
        pose_by_frames(&mut images, &rigs, &frames, Path::new("frames.txt")).unwrap();
        // Image 6 is in no frame: it was never registered.
        assert_eq!(images.iter().map(|i| i.id).collect::<Vec<_>>(), [4, 5]);
        let point = DVec3::new(0.5, -0.2, 0.7);
        assert_eq!(images[0].camera_from_world, rig_from_world);
        let expected = turned.apply(rig_from_world.apply(point));
        assert!((images[1].camera_from_world.apply(point) - expected).length() < 1e-12);
        // A camera without a place in its rig.
        let unknown = Rigs::from([(7, BTreeMap::from([(1, Some(Pose::IDENTITY)), (2, None)]))]);
        assert!(pose_by_frames(&mut images, &unknown, &frames, Path::new("frames.txt")).is_err());
    }
}
