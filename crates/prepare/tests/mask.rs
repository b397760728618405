//! The object is found in a room without masks.

mod common;

use common::{cameras, cupboard, picture, room, views};
use glam::DVec3;
use hingecast_geom::{Pose, Progress};
use hingecast_prepare::{PrepareError, Wanted, object_masks};

#[test]
fn the_cupboard_is_what_moves_and_what_that_hangs_on() {
    let scene = |k: usize| [room(), cupboard(30.0 * k as f64, Pose::IDENTITY)].concat();
    let mut states: Vec<_> = (0..4).map(|k| views(&scene(k), &Pose::IDENTITY, 12, k as u64)).collect();
    let found = object_masks(&mut states, &Wanted::Moving, false, DVec3::Z, 0, &Progress::default()).unwrap();
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
    let found = object_masks(&mut states, &Wanted::Moving, false, DVec3::Z, 0, &Progress::default());
    assert!(matches!(found, Err(PrepareError::NothingMoved { .. })), "{:?}", found.map(|f| f.report));
}

/// Nothing moves, but a person says where the object is: by a box, or by a place on it.
#[test]
fn a_person_says_what_the_object_is() {
    let scene = [room(), cupboard(20.0, Pose::IDENTITY)].concat();
    let first = room().len() as u8 + 1;
    let overlap = |wanted: Wanted| {
        let mut states: Vec<_> = (0..2).map(|k| views(&scene, &Pose::IDENTITY, 12, k as u64)).collect();
        let found = object_masks(&mut states, &wanted, false, DVec3::Z, 0, &Progress::default()).unwrap();
        let (mut both, mut either) = (0, 0);
        for (k, masks) in found.masks.iter().enumerate() {
            for (camera, mask) in cameras(12, k as u64).iter().zip(masks) {
                let (_, which) = picture(camera, &scene);
                both += mask.iter().zip(&which).filter(|(m, w)| **m == 1 && **w >= first).count();
                either += mask.iter().zip(&which).filter(|(m, w)| **m == 1 || **w >= first).count();
            }
        }
        both as f64 / either as f64
    };
    // The cupboard is 0.8 x 0.4 x 0.9 m around (0.1, 0.75); its door stands open to y = 0.3.
    let by_box = overlap(Wanted::InBox([-0.4, 0.1, -0.1], [0.6, 1.04, 1.0]));
    let by_place = overlap(Wanted::At([0.1, 0.7, 0.9]));
    assert!(by_box > 0.95 && by_place > 0.95, "{by_box} by a box, {by_place} by a place");
    let mut states: Vec<_> = (0..2).map(|k| views(&scene, &Pose::IDENTITY, 12, k as u64)).collect();
    let nothing = object_masks(&mut states, &Wanted::At([0.0, -0.6, 1.2]), false, DVec3::Z, 0, &Progress::default());
    assert!(matches!(nothing, Err(PrepareError::NothingThere)));
}
