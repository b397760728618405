//! The passes after the search, from a tree that the test makes wrong by hand.

use super::scene::Scene;
use super::truth::{Off, nearest};
use hingecast_articulate::model::estimate::Discovery;
use hingecast_articulate::observe::evidence::Evidence;
use hingecast_articulate::passes::driver::settle;
use hingecast_articulate::score::part_cost::PartCost;
use hingecast_geom::{KinematicTree, Pose, Progress};

/// As if the search had found `tree` on `evidence`.
pub fn discovery(evidence: &Evidence, tree: &KinematicTree) -> Discovery {
    let still = evidence.judge(&vec![Pose::IDENTITY; evidence.n_states()]);
    Discovery::again(evidence, tree.clone(), PartCost::new(&still, evidence.n_states()))
}

/// The tree that all passes but those in `skip` make of `tree`.
pub fn settled(scene: &Scene, tree: &KinematicTree, skip: &[&str]) -> KinematicTree {
    let evidence = scene.evidence();
    let found = discovery(&evidence, tree);
    let names: Vec<String> = skip.iter().map(|name| name.to_string()).collect();
    let tree = settle(evidence, found, 0, &names, &Progress::default()).expect("nobody stops it").1.tree;
    eprintln!("without {skip:?}: {} parts", tree.parts.len());
    tree
}

/// How far a joint of that tree is from the truth.
pub fn off(tree: &KinematicTree, scene: &Scene, joint: usize) -> Off {
    let truth = &scene.tree.joints[joint];
    let (_, off) = nearest(tree, truth).unwrap_or_else(|| panic!("no {:?} in {tree:?}", truth.screw.kind));
    eprintln!("joint {joint}: {off:?}");
    off
}
