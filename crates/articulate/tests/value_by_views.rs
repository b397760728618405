//! A value that views contradict is sought again among all that the joint may have.

mod common;

use common::objects::cupboard_open_by;
use common::settled::discovery;
use hingecast_articulate::label::by_evidence::label_clouds;
use hingecast_articulate::observe::witness::Witness;
use hingecast_articulate::passes::driver::settle;
use hingecast_articulate::shown::shown;
use hingecast_articulate::value_by_views::correct;
use hingecast_geom::{KinematicTree, Progress};

/// A lid in the middle of its way came out as one that leans the other way, and stayed there.
#[test]
fn a_value_that_views_contradict_is_sought_again() {
    let scene = cupboard_open_by(&[0.0, 0.5, 1.2, 0.8, 0.9], &[0.0, 0.0, 0.1, 0.3, 0.45]).coarse();
    let evidence = scene.evidence();
    let (evidence, mut estimate, _) =
        settle(scene.evidence(), discovery(&evidence, &scene.tree), 0, &[], &Progress::default()).unwrap();
    let labels = label_clouds(&evidence, &estimate.tree, &estimate.owners);
    let witnesses: Vec<Vec<Witness>> = (0..5).map(|s| Witness::some(&scene.recorded(s), 160)).collect();
    let j = (0..2).find(|j| estimate.tree.joints[*j].screw.kind.turns()).expect("a hinge");
    let right = estimate.tree.joints[j].values[3];
    assert!((right.abs() - 0.8).abs() < 0.02, "{right}");
    estimate.tree.joints[j].values[3] = right - 0.6 * right.signum();
    let ask = |tree: &KinematicTree| shown(&evidence, tree, &labels, &witnesses);
    let said = ask(&estimate.tree);
    assert_eq!(said[j].contradicted, [3]);
    assert!(correct(&evidence, &mut estimate, &labels, &witnesses, &said, 0));
    let value = estimate.tree.joints[j].values[3];
    assert!((value - right).abs() < 0.01, "{value} for {right}");
    // What views bear out is left alone.
    let said = ask(&estimate.tree);
    let before = estimate.tree.clone();
    assert!(!correct(&evidence, &mut estimate, &labels, &witnesses, &said, 0));
    assert_eq!(estimate.tree, before);
}
