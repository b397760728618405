//! The object is found in a room without masks.

mod common;

use common::{cameras, cupboard, picture, room, views};
use glam::DVec3;
use hingecast_geom::{Pose, Progress};
use hingecast_prepare::{PrepareError, object_masks};

#[test]
fn the_cupboard_is_what_moves_and_what_that_hangs_on() {
    let scene = |k: usize| [room(), cupboard(30.0 * k as f64, Pose::IDENTITY)].concat();
    let mut states: Vec<_> = (0..4).map(|k| views(&scene(k), &Pose::IDENTITY, 12, k as u64)).collect();
    let found = object_masks(&mut states, DVec3::Z, 0, &Progress::default()).unwrap();
    assert_eq!(found.report.supports.len(), 2, "floor and wall: {:?}", found.report);
    let first = room().len() as u8 + 1;
    let mut all = Vec::new();
    for (k, masks) in found.masks.iter().enumerate() {
        for (camera, mask) in cameras(12, k as u64).iter().zip(masks) {
            let (_, which) = picture(camera, &scene(k));
            let both = mask.iter().zip(&which).filter(|(m, w)| **m == 1 && **w >= first).count();
            let either = mask.iter().zip(&which).filter(|(m, w)| **m == 1 || **w >= first).count();
            all.push(both as f64 / either.max(1) as f64);
        }
    }
    let mean = all.iter().sum::<f64>() / all.len() as f64;
    let worst = all.iter().copied().fold(1.0, f64::min);
    println!("IoU {mean} mean, {worst} worst");
    assert!(mean > 0.97 && worst > 0.93, "{mean} mean, {worst} worst");
}

#[test]
fn nothing_that_moves_is_no_object() {
    let scene = [room(), cupboard(20.0, Pose::IDENTITY)].concat();
    let mut states: Vec<_> = (0..3).map(|k| views(&scene, &Pose::IDENTITY, 12, k as u64)).collect();
    let found = object_masks(&mut states, DVec3::Z, 0, &Progress::default());
    assert!(matches!(found, Err(PrepareError::NothingMoved { .. })), "{:?}", found.map(|f| f.report));
}
