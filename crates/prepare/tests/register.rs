//! States with a world each come together.

mod common;

use common::{Block, MIDDLE, block, chest, cupboard, pushed, rack, room, views};
use glam::{DQuat, DVec3};
use hingecast_geom::{Pose, Progress};
use hingecast_prepare::{PrepareError, register, register::Freedom, steady};

fn own_worlds(n: usize, tilt: f64) -> Vec<Pose> {
    let mut rng = fastrand::Rng::with_seed(5);
    let world = |k: usize| match k {
        0 => Pose::IDENTITY,
        _ => {
            let turn =
                DQuat::from_rotation_z(rng.f64() * std::f64::consts::TAU) * DQuat::from_rotation_x(tilt * rng.f64());
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

/// A thing of many facings that was pushed by a coarse cell: the room holds the worlds, not the thing, nor
/// something between both.
#[test]
fn a_pushed_thing_does_not_drag_the_world_along() {
    let worlds = own_worlds(4, 0.0);
    let push = Pose::new(DQuat::from_rotation_z(0.035), DVec3::new(0.025, -0.017, 0.0));
    let state = |k: usize| {
        let thing = rack(25.0 * k as f64, if k < 3 { Pose::IDENTITY } else { push });
        views(&[room(), thing].concat(), &worlds[k], 12, k as u64)
    };
    let mut states: Vec<_> = (0..4).map(state).collect();
    let found = register(&mut states, Freedom::AboutUp(DVec3::Z), 0, &Progress::default()).unwrap();
    let (turn, shift) = error(&found.common_from_state, &worlds);
    println!("{turn} deg {shift} m {:?}", found.circle);
    assert!(turn < 0.1 && shift < 0.001, "{turn} deg, {shift} m: {:#?}", found.pairs);
}

/// How loosely scans are held grows with the noise of their surfaces, and is more than they are off.
#[test]
fn what_holds_a_scan_loosely_is_said() {
    let scene = [room(), cupboard(30.0, Pose::IDENTITY)].concat();
    let slack = [0.004, 0.04].map(|noise| {
        let worlds = own_worlds(2, 0.0);
        let mut states: Vec<_> = (0..2).map(|k| views(&scene, &worlds[k], 12, k as u64)).collect();
        let mut rng = fastrand::Rng::with_seed(7);
        let depths = states.iter_mut().flatten().flat_map(|view| &mut view.depth);
        depths.for_each(|z| *z *= 1.0 + noise * (rng.f32() - 0.5));
        let found = register(&mut states, Freedom::AboutUp(DVec3::Z), 0, &Progress::default()).unwrap();
        let (turn, _) = error(&found.common_from_state, &worlds);
        assert_eq!((found.slack.len(), found.slack[0]), (2, 0.0));
        let slack = found.slack[1].to_degrees();
        assert!(turn < slack, "off by {turn} deg, {slack} said");
        slack
    });
    assert!(slack[0] < 0.3 && slack[1] > 2.0 * slack[0], "{slack:?} deg");
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

/// Views of a thing alone, masked: the room's depth stays, and frees what is before it.
fn masked(thing: Vec<Block>, seed: u64) -> Vec<hingecast_articulate::DepthView> {
    let scene = [room(), thing].concat();
    let first = room().len() as u8 + 1;
    common::cameras(12, seed)
        .into_iter()
        .map(|camera| {
            let (depth, which) = common::picture(&camera, &scene);
            let class = which.iter().map(|k| match *k {
                0 => hingecast_articulate::UNKNOWN,
                k if k >= first => hingecast_articulate::OBJECT,
                _ => hingecast_articulate::OTHER,
            });
            hingecast_articulate::DepthView { class: class.collect(), camera, depth }
        })
        .collect()
}

#[test]
fn a_push_is_taken_out_and_a_door_is_not() {
    for (mm, deg) in [(0.0, 0.0), (5.0, 0.3), (30.0, 2.0), (60.0, 3.0)] {
        let push = Pose::new(DQuat::from_rotation_z(f64::to_radians(deg)), DVec3::new(0.6 * mm, -0.8 * mm, 0.0) * 1e-3);
        // Pushed in state 2, and left there.
        let mut states: Vec<_> = (0..5)
            .map(|k| masked(cupboard(25.0 * k as f64, if k < 2 { Pose::IDENTITY } else { push }), k as u64))
            .collect();
        let found = steady(&mut states, DVec3::Z, 0, &Progress::default()).unwrap();
        for (state, common_from_state) in found.iter().enumerate() {
            let stood = if state < 2 { Pose::IDENTITY } else { pushed(push) };
            let (turn, shift) = off(*common_from_state, stood);
            println!("{mm} mm {deg} deg state {state}: {turn:.4} deg {shift:.5} m");
            assert!(turn < 0.05 && shift < 0.001, "{mm} mm, state {state}: off by {turn} deg, {shift} m");
            assert!(mm > 0.0 || *common_from_state == Pose::IDENTITY, "nobody pushed: {common_from_state:?}");
        }
    }
}

/// A chest with its drawer so far out in each state, pushed in state `first` and left there.
fn chests(out: [f64; 5], first: usize, push: Pose) -> Vec<Vec<hingecast_articulate::DepthView>> {
    let stood = |k: usize| if k < first { Pose::IDENTITY } else { push };
    (0..5).map(|k| masked(chest(out[k], stood(k)), k as u64)).collect()
}

/// How far a state is off that `stood` there: degrees, and the shift of the middle, m.
fn off(found: Pose, stood: Pose) -> (f64, f64) {
    let off = found * stood;
    (off.angle().to_degrees(), (off.apply(MIDDLE) - MIDDLE).length())
}

/// A drawer that is nearly as far out as before lies well on itself: it is not the base for that.
#[test]
fn a_drawer_is_no_base() {
    let push = Pose::new(DQuat::from_rotation_z(0.035), DVec3::new(0.018, -0.024, 0.0));
    let mut states = chests([0.0, 0.1, 0.2, 0.26, 0.34], 4, push);
    let found = steady(&mut states, DVec3::Z, 0, &Progress::default()).unwrap();
    assert!(found[..4].iter().all(|p| *p == Pose::IDENTITY), "nobody pushed: {found:?}");
    let (turn, shift) = off(found[4], pushed(push));
    assert!(turn < 0.05 && shift < 0.001, "{turn} deg, {shift} m");
}

/// Pushed once, and then the drawer is pulled out: against the recorded place alone it was taken for the base,
/// and the chest for pushed anew in every state.
#[test]
fn what_was_pushed_stays_there() {
    let push = Pose::new(DQuat::from_rotation_z(0.035), DVec3::new(0.036, -0.048, 0.0));
    let mut states = chests([0.02, 0.02, 0.14, 0.26, 0.34], 1, push);
    let found = steady(&mut states, DVec3::Z, 0, &Progress::default()).unwrap();
    for (state, pose) in found.iter().enumerate().skip(1) {
        let (turn, shift) = off(*pose, pushed(push));
        println!("state {state}: {turn} deg, {shift} m");
        assert!(turn < 0.05 && shift < 0.001, "state {state}: off by {turn} deg, {shift} m");
    }
}
