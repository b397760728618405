//! States with a world each come together.

mod common;

use common::{block, cupboard, room, views};
use glam::{DQuat, DVec3};
use hingecast_geom::{Pose, Progress};
use hingecast_prepare::{PrepareError, register, register::Freedom};

fn own_worlds(n: usize, tilt: f64) -> Vec<Pose> {
    let mut rng = fastrand::Rng::with_seed(5);
    let world = |k: usize| match k {
        0 => Pose::IDENTITY,
        _ => {
            let turn = DQuat::from_rotation_z(rng.f64() * 6.28) * DQuat::from_rotation_x(tilt * rng.f64());
            Pose::new(turn, DVec3::new(rng.f64() * 4.0 - 2.0, rng.f64() * 4.0 - 2.0, rng.f64() * 2.0 - 1.0))
        }
    };
    (0..n).map(world).collect()
}

/// Turn in degrees and shift in metres, of points of the room, by which the registration is off.
fn error(found: &[Pose], own_from_world: &[Pose]) -> (f64, f64) {
    found.iter().zip(own_from_world).fold((0.0, 0.0), |(turn, shift), (common_from_own, own)| {
        let off = *common_from_own * *own;
        let middle = DVec3::new(0.1, 0.6, 0.4);
        (f64::max(turn, off.angle().to_degrees()), f64::max(shift, (off.apply(middle) - middle).length()))
    })
}

#[test]
fn scans_with_a_world_each_come_together() {
    for (tilt, freedom) in [(0.0, Freedom::AboutUp(DVec3::Z)), (2.0, Freedom::Any)] {
        let worlds = own_worlds(4, tilt);
        let state = |k: usize| {
            let scene = [room(), cupboard(30.0 * k as f64, Pose::IDENTITY)].concat();
            views(&scene, &worlds[k], 12, k as u64)
        };
        let mut states: Vec<_> = (0..4).map(state).collect();
        let found = register(&mut states, freedom, 0, &Progress::default()).unwrap();
        let (turn, shift) = error(&found.common_from_state, &worlds);
        println!("{turn} deg {shift} m {:#?} {:?}", found.pairs, found.circle);
        assert!(turn < 0.1 && shift < 0.001, "{turn} deg, {shift} m: {:#?}", found.pairs);
    }
}

#[test]
fn an_empty_room_is_no_place() {
    let worlds = own_worlds(2, 0.0);
    let scene = [block([0.0, 0.0, -0.05], [6.0, 6.0, 0.1], 0.0)];
    let mut states: Vec<_> = (0..2).map(|k| views(&scene, &worlds[k], 12, k as u64)).collect();
    let found = register(&mut states, Freedom::AboutUp(DVec3::Z), 0, &Progress::default());
    assert!(found.is_err(), "{found:?}");
}

#[test]
fn a_square_block_alone_is_ambiguous() {
    let worlds = own_worlds(2, 0.0);
    let scene = [block([0.0, 0.0, -0.05], [6.0, 6.0, 0.1], 0.0), block([0.1, 0.6, 0.3], [0.5, 0.5, 0.6], 0.0)];
    let mut states: Vec<_> = (0..2).map(|k| views(&scene, &worlds[k], 12, k as u64)).collect();
    let found = register(&mut states, Freedom::AboutUp(DVec3::Z), 0, &Progress::default());
    assert!(matches!(found, Err(PrepareError::Ambiguous { .. })), "{found:?}");
}
