//! Claims of known parts on measured surface.

mod common;

use common::objects::{slide, tree};
use common::scene::{Scene, cuboid};
use common::truth::from_boxes;
use glam::{DVec3, Vec3};
use hingecast_articulate::model::motions::poses_of;
use hingecast_articulate::observe::evidence::Evidence;
use hingecast_articulate::score::claims::{Claims, TAKEN};

/// A box that stands, and one that slides past it by more than its own length from state to state.
fn two_boxes() -> Scene {
    let boxes =
        vec![vec![cuboid([-0.6, -0.8, -0.3], [-0.2, -0.5, 0.2])], vec![cuboid([0.0, 0.3, -0.3], [0.3, 0.6, 0.0])]];
    Scene::new(boxes, tree(vec![slide(1, DVec3::X, &[0.0, 0.4, -0.4, -0.8])])).coarse()
}

/// Of all samples on the box of a part, the share where a known part claims [`TAKEN`], and the
/// share where it claims anything.
fn claimed(scene: &Scene, evidence: &Evidence, claims: &Claims, part: usize) -> [f64; 2] {
    let (mut taken, mut any, mut all) = (0, 0, 0);
    for s in &evidence.samples {
        let x = scene.tree.poses_at(s.state)[part].inverse().apply(s.point.as_dvec3());
        if from_boxes(x, &scene.boxes[part]) < 1e-3 {
            let claim = claims.at_place(evidence, s.state, s.point);
            all += 1;
            taken += usize::from(claim & TAKEN != 0);
            any += usize::from(claim != 0);
        }
    }
    assert!(all > 500, "{all} samples on part {part}");
    [taken, any].map(|n| n as f64 / all as f64)
}

#[test]
fn a_part_takes_its_own_surface_and_no_other() {
    let scene = two_boxes();
    let evidence = scene.evidence();
    let poses = [0, 1].map(|part| poses_of(&scene.tree, part, scene.n_states));
    for known in [0, 1] {
        let claims = Claims::of_parts(&evidence, &poses[known..=known]);
        let (own, other) = (claimed(&scene, &evidence, &claims, known), claimed(&scene, &evidence, &claims, 1 - known));
        eprintln!("part {known}: own {own:?}, other {other:?}");
        assert!(own[0] > 0.99, "{own:?}");
        assert_eq!(other[0], 0.0);
    }
    // The question about joint 0 is asked with the claims of all parts but its child.
    let others = Claims::of_others(&evidence, &scene.tree, 0);
    assert!(claimed(&scene, &evidence, &others, 0)[0] > 0.99);
    assert_eq!(claimed(&scene, &evidence, &others, 1)[0], 0.0);
    let both = Claims::of_parts(&evidence, &poses);
    assert!([0, 1].iter().all(|part| claimed(&scene, &evidence, &both, *part)[0] > 0.99));
}

#[test]
fn nothing_is_claimed_by_none_or_beyond_the_lattice() {
    let scene = two_boxes();
    let evidence = scene.evidence();
    for part in [0, 1] {
        assert_eq!(claimed(&scene, &evidence, &Claims::none(), part), [0.0; 2]);
    }
    let all = Claims::of_parts(&evidence, &[poses_of(&scene.tree, 0, scene.n_states)]);
    assert_eq!(all.at_place(&evidence, 0, Vec3::splat(5.0)), 0);
}
