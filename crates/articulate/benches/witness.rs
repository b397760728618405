//! What the search for parts does most: verdicts of states on samples, sweeps of a joint's value,
//! fits of all joints. On a cupboard of boxes, five states. `cargo bench -p hingecast-articulate`.

#[path = "../tests/common/mod.rs"]
mod common;

use common::objects::cupboard_open_by;
use common::scene::Scene;
use common::truth::from_boxes;
use divan::counter::ItemsCount;
use divan::{Bencher, black_box};
use hingecast_articulate::fit::gauss_newton::{Settings, gauss_newton};
use hingecast_articulate::fit::question::{Question, Worth};
use hingecast_articulate::fit::sweep_values::sweep_values;
use hingecast_articulate::model::motions::{in_parent_frame, poses_of, state_to_state};
use hingecast_articulate::model::owners::{ASKING, Member, subset};
use hingecast_articulate::observe::evidence::Evidence;
use hingecast_articulate::observe::sample::Sample;
use hingecast_articulate::score::claims::Claims;
use std::sync::OnceLock;

fn main() {
    divan::main();
}

/// The scene, what was seen of it, and the part that every sample lies on.
fn seen() -> &'static (Scene, Evidence, Vec<Member>) {
    static SEEN: OnceLock<(Scene, Evidence, Vec<Member>)> = OnceLock::new();
    SEEN.get_or_init(|| {
        let scene = cupboard_open_by(&[0.0, 0.4, 0.8, 1.2, 1.6], &[0.0, 0.3, 0.1, 0.45, 0.2]).coarse();
        let evidence = scene.evidence();
        let part = |s: &Sample| {
            let poses = scene.tree.poses_at(s.state);
            let off = |k: &usize| from_boxes(poses[*k].inverse().apply(s.point.as_dvec3()), &scene.boxes[*k]);
            (0..scene.boxes.len()).min_by(|a, b| off(a).total_cmp(&off(b))).unwrap()
        };
        let member = |s: &Sample| Member { sample: *s, part: part(s), shown: u64::MAX };
        let members = evidence.samples.iter().map(member).collect();
        (scene, evidence, members)
    })
}

/// Raw verdicts of all states on a thousand samples, one thread.
#[divan::bench]
fn verdict(bencher: Bencher) {
    let (scene, evidence, _) = seen();
    let from = state_to_state(&poses_of(&scene.tree, 1, scene.n_states));
    let samples: Vec<&Sample> = evidence.samples.iter().step_by(evidence.samples.len() / 1000).take(1000).collect();
    let explained = || samples.iter().filter(|s| evidence.verdict(black_box(s), &from[s.state]).explains()).count();
    bencher.counter(ItemsCount::new(samples.len())).bench_local(explained);
}

/// Verdicts on all samples, lone contradictions left out; all threads.
#[divan::bench]
fn judge(bencher: Bencher) {
    let (scene, evidence, _) = seen();
    let poses = poses_of(&scene.tree, 1, scene.n_states);
    bencher.counter(ItemsCount::new(evidence.samples.len())).bench_local(|| evidence.judge(black_box(&poses)));
}

/// The hinge's value in every state, by as many samples of the door as a pass asks.
#[divan::bench]
fn sweep(bencher: Bencher) {
    let (scene, evidence, members) = seen();
    let joint = &scene.tree.joints[0];
    let parents = poses_of(&scene.tree, joint.parent, scene.n_states);
    let own = members.iter().filter(|m| m.part == joint.child).map(|m| m.sample);
    let samples = in_parent_frame(joint, &subset(own, ASKING, 0), &parents);
    let claims = Claims::none();
    let question = Question { evidence, claims: &claims, worth: Worth::ANY };
    let step = 0.5 * evidence.lattice.voxel;
    let ask = || sweep_values(&question, black_box(&samples), &parents, &joint.screw, [-1.8, 1.8], step);
    bencher.bench_local(ask);
}

/// Both joints from half a voxel beside the truth; all threads.
#[divan::bench(max_time = 5)]
fn fit_all_joints(bencher: Bencher) {
    let (scene, evidence, members) = seen();
    let moving: Vec<Member> = members.iter().filter(|m| m.part != 0).copied().collect();
    let mut off = scene.tree.clone();
    for joint in &mut off.joints {
        joint.values.iter_mut().skip(1).for_each(|q| *q += 0.5 * f64::from(evidence.lattice.voxel));
    }
    let settings = Settings::narrowing(2.0, 0.5, evidence.lattice.voxel);
    let free = vec![true; off.joints.len()];
    bencher
        .with_inputs(|| off.clone())
        .bench_local_values(|mut tree| gauss_newton(evidence, &mut tree, &moving, &free, &settings, 0));
}
