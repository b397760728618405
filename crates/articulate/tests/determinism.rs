//! The same input gives the same bytes, with any number of threads.

mod common;

use common::objects::{case, joint, tree};
use common::scene::{Scene, cuboid};
use glam::DVec3;
use hingecast_articulate::Articulation;
use hingecast_geom::JointKind;

/// A case with a door, few and small pictures.
fn case_with_door(noise: f64) -> Scene {
    let door = vec![cuboid([-0.42, -0.5, -0.3], [-0.3, 0.5, 0.4]), cuboid([-0.55, 0.3, 0.0], [-0.42, 0.4, 0.15])];
    let hinge = joint(0, 1, JointKind::Revolute, DVec3::Z, DVec3::new(-0.42, -0.5, 0.0), &[0.0, 0.4, 0.9, 1.3]);
    let scene = Scene::new(vec![case(-0.3, 0.5), door], tree(vec![hinge]));
    Scene { size: 64, views: 12, cells: 32, noise, ..scene }
}

fn found_with(threads: usize, scene: &Scene) -> Articulation {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
    pool.install(|| scene.find())
}

/// Exact depth goes on to borders pixel by pixel, noisy depth to corrected cameras and what
/// pictures may add.
#[test]
fn one_thread_or_three() {
    for noise in [0.0, 0.01] {
        let scene = case_with_door(noise);
        let (one, three) = (found_with(1, &scene), found_with(3, &scene));
        assert!(!one.tree.joints.is_empty());
        assert_eq!(one.information.is_empty(), noise == 0.0);
        assert_eq!(one.tree, three.tree);
        assert_eq!(one.doubts, three.doubts);
        assert_eq!(one.cameras, three.cameras);
        let bits = |found: &Articulation| -> Vec<(usize, u8, [u32; 3])> {
            found.samples.iter().map(|s| (s.state, s.part, s.point.to_array().map(f32::to_bits))).collect()
        };
        assert!(!one.samples.is_empty() && bits(&one) == bits(&three));
        // Everything but the time that it took.
        let told = |found: &Articulation| -> Vec<String> {
            found.trace.iter().map(|r| format!("{} {} {} {:?}", r.pass, r.round, r.parts, r.nats)).collect()
        };
        assert_eq!(told(&one), told(&three));
    }
}
