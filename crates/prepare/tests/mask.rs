//! The object is found in a room without masks.

mod common;

use common::{Block, block, cameras, cupboard, picture, room, views};
use glam::{DQuat, DVec3};
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

/// What is not one whole object is said to be so: masks of clutter beside it came without a word.
#[test]
fn masks_of_more_or_less_than_one_thing_are_doubted() {
    // A crate stands alone at first, later against the open door.
    let crate_at = [[-0.9, -0.6, 0.1], [-0.5, -0.2, 0.1]];
    let scene = |k: usize| {
        let clutter = block(crate_at[k / 2], [0.3, 0.3, 0.4], 30.0);
        [room(), vec![clutter], cupboard(30.0 * k as f64, Pose::IDENTITY)].concat()
    };
    let doubts = |wanted: Wanted, scene: &dyn Fn(usize) -> Vec<Block>| {
        let mut states: Vec<_> = (0..4).map(|k| views(&scene(k), &Pose::IDENTITY, 10, k as u64)).collect();
        object_masks(&mut states, &wanted, false, DVec3::Z, 0, &Progress::default()).unwrap().report.doubts
    };
    let found = doubts(Wanted::Moving, &scene);
    assert!(found.len() == 1 && found[0].contains("1 of 4 states, first in state 2"), "{found:?}");
    let found = doubts(Wanted::InBox([-2.0, -2.0, -0.2], [2.0, 2.0, 2.5]), &scene);
    assert!(found.len() == 1 && found[0].contains("2 things that do not touch"), "{found:?}");
    let found = doubts(Wanted::InBox([-0.4, 0.1, -0.1], [0.6, 1.2, 1.0]), &scene);
    assert!(found.len() == 1 && found[0].contains("cuts through what it holds"), "{found:?}");
    // On rough ground, which is no plane.
    let mut rng = fastrand::Rng::with_seed(3);
    let stone = |k: i32| {
        let at = [0.3 * f64::from(k % 12 - 6), 0.3 * f64::from(k / 12 - 6), 0.5 * rng.f64() - 0.4];
        let mut stone = block(at, [0.32, 0.32, 0.6], 0.0);
        let tilt = DVec3::new(rng.f64() - 0.5, rng.f64() - 0.5, 0.0);
        stone.world_from_block.rot = DQuat::from_scaled_axis(1.2 * tilt);
        stone
    };
    let ground: Vec<Block> = (0..144).map(stone).collect();
    let found = doubts(Wanted::Moving, &|k| [ground.clone(), cupboard(30.0 * k as f64, Pose::IDENTITY)].concat());
    assert!(found.iter().any(|d| d.contains("neither floor nor wall")), "{found:?}");
}
