//! What `find` refuses at its door, each with what is wrong, where, and what to try.

use glam::{DVec3, Vec3};
use hingecast_articulate::{ArticulateError, Config, DepthError, DepthView, Depths, Doubt, MOST_STATES, find};
use hingecast_geom::{Camera, Progress};

/// States and an extent as they are given.
struct Given {
    states: Vec<Vec<DepthView>>,
    extent: [Vec3; 2],
}

impl Depths for Given {
    fn n_states(&self) -> usize {
        self.states.len()
    }

    fn extent(&mut self) -> Result<(Vec3, Vec3), DepthError> {
        Ok(self.extent.into())
    }

    fn views(&mut self, state: usize) -> Result<Vec<DepthView>, DepthError> {
        Ok(self.states[state].clone())
    }
}

/// A wall at z = 0, 24 x 16 pixels, seen from above.
fn wall() -> DepthView {
    DepthView::new(Camera::look_at(DVec3::Z * 3.0, DVec3::ZERO, DVec3::Y, 24, 16, 0.7), vec![3.0; 24 * 16])
}

fn walls(n_states: usize) -> Vec<Vec<DepthView>> {
    vec![vec![wall(); 2]; n_states]
}

/// Fails as [`ArticulateError::Input`] with these words in what is wrong and where, and with
/// something to try.
fn assert_refused(depths: &mut dyn Depths, config: &Config, what_says: &str, place_says: &str) {
    match find(depths, config, &Progress::default()) {
        Err(ArticulateError::Input { what, place, hint }) => {
            assert!(what.contains(what_says), "{what}");
            assert!(place.contains(place_says), "{place}");
            assert!(!hint.is_empty());
        }
        Err(other) => panic!("{other:?}"),
        Ok(_) => panic!("nothing was refused"),
    }
}

/// The second view of the second state is spoilt: refused from memory, and from elsewhere, where
/// the extent is known without it.
fn assert_view_refused(spoil: impl Fn(&mut DepthView), what_says: &str, place_says: &str) {
    let mut states = walls(3);
    spoil(&mut states[1][1]);
    assert_refused(&mut states.clone(), &Config::default(), what_says, place_says);
    let extent = [Vec3::splat(-1.0), Vec3::ONE];
    assert_refused(&mut Given { states, extent }, &Config::default(), what_says, place_says);
}

#[test]
fn no_states() {
    assert_refused(&mut walls(0), &Config::default(), "0 states", "number of states");
}

#[test]
fn more_states_than_bits() {
    assert_refused(&mut walls(MOST_STATES + 1), &Config::default(), "65 states", "number of states");
}

#[test]
fn an_extent_that_is_not_finite() {
    for bad in [f32::NAN, f32::INFINITY] {
        let extent = [Vec3::splat(-1.0), Vec3::new(1.0, bad, 1.0)];
        assert_refused(&mut Given { states: walls(2), extent }, &Config::default(), "no extent", &bad.to_string());
    }
}

#[test]
fn an_empty_extent() {
    for extent in [[Vec3::ONE, Vec3::ONE], [Vec3::ONE, Vec3::new(0.0, 2.0, 2.0)]] {
        assert_refused(&mut Given { states: walls(2), extent }, &Config::default(), "no extent", "from [1, 1, 1]");
    }
    // No pixel shows anything.
    let nothing = DepthView::new(wall().camera, vec![0.0; 24 * 16]);
    assert_refused(&mut vec![vec![nothing]; 2], &Config::default(), "no extent", "inf");
}

#[test]
fn a_camera_pose_that_is_not_finite() {
    let bad = f64::NAN;
    assert_view_refused(|v| v.camera.camera_from_world.trans.y = bad, "camera pose", "state 1, view 1");
    assert_view_refused(|v| v.camera.camera_from_world.rot.w = bad, "camera pose", "state 1, view 1");
}

/// Views in memory used to panic here, when their extent was asked for.
#[test]
fn wrong_sizes() {
    assert_view_refused(|v| v.depth.truncate(300), "300 depths and 384 classes for 384 pixels", "state 1, view 1");
    assert_view_refused(|v| v.class.truncate(300), "384 depths and 300 classes for 384 pixels", "state 1, view 1");
    assert_view_refused(|v| v.camera.width = 0, "384 depths and 384 classes for 0 pixels", "state 1, view 1");
}

#[test]
fn depth_on_the_object_that_is_none() {
    for bad in [f32::NAN, f32::INFINITY, 0.0, -1.0] {
        let spoil = |v: &mut DepthView| v.depth[24 * 2 + 5] = bad;
        assert_view_refused(spoil, &format!("depth {bad}"), "state 1, view 1, pixel 5, 2");
    }
}

#[test]
fn an_unknown_pass_to_skip() {
    let config = Config { skip: vec!["prune".into(), "prunes".into()], ..Config::default() };
    assert_refused(&mut walls(2), &config, "'prunes'", "passes.skip");
    // What the rest cannot do without is none that could be left out.
    let config = Config { skip: vec!["relabel".into()], ..Config::default() };
    assert_refused(&mut walls(2), &config, "'relabel'", "passes.skip");
}

#[test]
fn cells_out_of_range() {
    for cells in [0, 7, 1001] {
        let place = format!("cells = {cells}");
        assert_refused(&mut walls(2), &Config { cells, ..Config::default() }, "out of range", &place);
    }
}

/// Something else's error stays that.
#[test]
fn what_depths_fail_with() {
    struct Broken;
    impl Depths for Broken {
        fn n_states(&self) -> usize {
            2
        }
        fn extent(&mut self) -> Result<(Vec3, Vec3), DepthError> {
            Ok((Vec3::ZERO, Vec3::ONE))
        }
        fn views(&mut self, _: usize) -> Result<Vec<DepthView>, DepthError> {
            Err("the disk is gone".into())
        }
    }
    let error = find(&mut Broken, &Config::default(), &Progress::default()).err().unwrap();
    assert!(matches!(&error, ArticulateError::Depths(e) if e.to_string() == "the disk is gone"), "{error:?}");
}

/// One state is few, but no reason to refuse.
#[test]
fn one_state_is_a_thing_that_never_moves() {
    let found = find(&mut walls(1), &Config { cells: 16, ..Config::default() }, &Progress::default()).unwrap();
    assert!(found.tree.joints.is_empty());
    assert_eq!(found.doubts[0], Doubt::NothingMoves);
}
