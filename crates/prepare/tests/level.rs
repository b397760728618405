//! Cameras that drifted are held by the room, where the object stands still in it.

mod common;

use common::{Block, cameras, cupboard, picture, room};
use glam::{DQuat, DVec3};
use hingecast_articulate::{DepthView, OBJECT, OTHER, UNKNOWN};
use hingecast_geom::{Camera, Pose, Progress};
use hingecast_prepare::{Settled, level, settle};

/// A small motion about the middle of the scene.
fn small(rng: &mut fastrand::Rng, deg: f64, mm: f64) -> Pose {
    let mut some = || DVec3::new(rng.f64() - 0.5, rng.f64() - 0.5, rng.f64() - 0.5).normalize();
    let (axis, shift) = (some(), some());
    let middle = DVec3::new(0.1, 0.6, 0.4);
    let turn = Pose::new(DQuat::from_axis_angle(axis, deg.to_radians()), 1e-3 * mm * shift);
    Pose::from_trans(middle) * turn * Pose::from_trans(-middle)
}

/// A view of a thing in a room, with the pose that tracking said.
fn view(camera: Camera, thing: &[Block], room: &[Block], said: Pose) -> DepthView {
    let (depth, which) = picture(&camera, &[room, thing].concat());
    let camera = Camera { camera_from_world: camera.camera_from_world * said.inverse(), ..camera };
    let masked = |k: &u8| match *k as usize {
        0 => UNKNOWN,
        k if k > room.len() => OBJECT,
        _ => OTHER,
    };
    DepthView { class: which.iter().map(masked).collect(), camera, depth }
}

type States = Vec<Vec<DepthView>>;

/// Four states of a cupboard; `said(state, view)`: the world that tracking had, from the true one.
fn states(said: &mut dyn FnMut(usize, usize) -> Pose, room: &dyn Fn(usize) -> Vec<Block>) -> States {
    (0..4)
        .map(|k| {
            let thing = cupboard(25.0 * k as f64, Pose::IDENTITY);
            let views = cameras(12, k as u64).into_iter().enumerate();
            views.map(|(v, camera)| view(camera, &thing, &room(v), said(k, v))).collect()
        })
        .collect()
}

#[test]
fn what_scans_drifted_from_each_other_is_taken_out() {
    let mut rng = fastrand::Rng::with_seed(3);
    let offset: Vec<Pose> = (0..4).map(|k| if k == 0 { Pose::IDENTITY } else { small(&mut rng, 0.5, 5.0) }).collect();
    let mut scans = states(&mut |k, _| offset[k], &|_| room());
    let found = level(&mut scans, 0, &Progress::default()).unwrap().unwrap();
    for (k, (found, said)) in found.iter().zip(&offset).enumerate() {
        let off = *found * *said;
        println!("state {k}: {:.4} deg {:.5} m", off.angle().to_degrees(), off.trans.length());
        assert!(off.angle().to_degrees() < 0.05 && off.trans.length() < 1e-3);
    }
    // Nothing to do where nothing drifted.
    let mut scans = states(&mut |_, _| Pose::IDENTITY, &|_| room());
    assert!(level(&mut scans, 0, &Progress::default()).unwrap().unwrap().is_empty());
}

#[test]
fn cameras_settle_on_the_room_and_a_turntable_is_none() {
    let mut rng = fastrand::Rng::with_seed(4);
    let drift: Vec<Pose> = (0..48).map(|_| small(&mut rng, 0.4, 4.0)).collect();
    let error = |settled: &Settled, truth: &States| {
        let pairs = settled.cameras.concat().into_iter().zip(truth.concat());
        let off: Vec<f64> =
            pairs.map(|(a, b)| (a.inverse() * b.camera.camera_from_world).angle().to_degrees()).collect();
        off.iter().sum::<f64>() / off.len() as f64
    };
    let truth = states(&mut |_, _| Pose::IDENTITY, &|_| room());
    let mut scans = states(&mut |k, v| drift[12 * k + v], &|_| room());
    let settled = settle(&mut scans, &Progress::default()).unwrap();
    let off = error(&settled, &truth);
    println!("{off:.3} deg, held: {}", settled.held);
    // What the views of a state have in common stays.
    assert!(settled.held && off < 0.2, "{off} deg");
    // The room turns from view to view about the object, as it does for an object on a turntable.
    let turned = |v: usize| {
        let turn = common::pushed(Pose::new(DQuat::from_rotation_z(0.5 * v as f64), DVec3::ZERO));
        room().into_iter().map(|b| Block { world_from_block: turn * b.world_from_block, ..b }).collect()
    };
    let mut scans = states(&mut |k, v| drift[12 * k + v], &turned);
    let recorded = Settled { cameras: poses(&scans), held: true };
    let settled = settle(&mut scans, &Progress::default()).unwrap();
    let (before, off) = (error(&recorded, &truth), error(&settled, &truth));
    println!("turntable: {before:.3} deg, then {off:.3}, held: {}", settled.held);
    assert!(!settled.held && off < 1.05 * before, "{off} deg, {before} before");
}

fn poses(states: &States) -> Vec<Vec<Pose>> {
    states.iter().map(|views| views.iter().map(|v| v.camera.camera_from_world).collect()).collect()
}
