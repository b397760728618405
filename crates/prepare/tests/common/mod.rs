//! A room of boxes, seen by cameras: exact depth, and the truth about what stands where.

#![allow(dead_code)]

use glam::{DQuat, DVec2, DVec3};
use hingecast_articulate::{DepthView, OBJECT, UNKNOWN};
use hingecast_geom::{Camera, Pose};

/// A box, axis-aligned in its own frame.
#[derive(Clone, Copy)]
pub struct Block {
    pub half: DVec3,
    pub world_from_block: Pose,
}

pub fn block(centre: [f64; 3], size: [f64; 3], turn_deg: f64) -> Block {
    let rot = DQuat::from_rotation_z(turn_deg.to_radians());
    Block { half: 0.5 * DVec3::from(size), world_from_block: Pose::new(rot, DVec3::from(centre)) }
}

/// Floor, a wall behind, a shelf, a bin and a crate.
pub fn room() -> Vec<Block> {
    vec![
        block([0.0, 0.0, -0.05], [4.0, 4.0, 0.1], 0.0),
        block([0.0, 1.05, 1.25], [4.0, 0.1, 2.5], 0.0),
        block([1.2, 0.7, 0.5], [0.5, 0.4, 1.0], 12.0),
        block([-1.3, 0.2, 0.2], [0.3, 0.3, 0.4], 30.0),
        block([-0.9, -1.1, 0.1], [0.5, 0.25, 0.2], -20.0),
    ]
}

/// On the floor, under the middle of the things that are pushed.
pub const MIDDLE: DVec3 = DVec3::new(0.1, 0.75, 0.0);

/// World from world: `push` about [`MIDDLE`].
pub fn pushed(push: Pose) -> Pose {
    Pose::from_trans(MIDDLE) * push * Pose::from_trans(-MIDDLE)
}

/// Blocks moved by [`pushed`].
fn moved(all: impl IntoIterator<Item = Block>, push: Pose) -> Vec<Block> {
    let push = pushed(push);
    all.into_iter().map(|b| Block { world_from_block: push * b.world_from_block, ..b }).collect()
}

/// A cupboard of 0.8 x 0.4 x 0.9 m before the wall whose door, on its front, is open by `door_deg`;
/// the whole of it moved by `push` (about its own middle).
pub fn cupboard(door_deg: f64, push: Pose) -> Vec<Block> {
    // Back, sides, bottom, a board, top: hollow, as cupboards are.
    let panels = [
        block([0.1, 0.95, 0.45], [0.8, 0.02, 0.9], 0.0),
        block([-0.29, 0.77, 0.45], [0.02, 0.38, 0.9], 0.0),
        block([0.49, 0.77, 0.45], [0.02, 0.38, 0.9], 0.0),
        block([0.1, 0.77, 0.05], [0.8, 0.38, 0.02], 0.0),
        block([0.1, 0.8, 0.5], [0.78, 0.3, 0.02], 0.0),
        block([0.1, 0.77, 0.89], [0.8, 0.38, 0.02], 0.0),
    ];
    // The hinge stands at the left edge of the front.
    let hinge = Pose::new(DQuat::from_rotation_z(-door_deg.to_radians()), DVec3::new(-0.3, 0.57, 0.45));
    let door = Block {
        half: DVec3::new(0.4, 0.01, 0.44),
        world_from_block: hinge * Pose::from_trans(DVec3::new(0.4, -0.01, 0.0)),
    };
    let handle = Block {
        half: DVec3::new(0.015, 0.02, 0.08),
        world_from_block: hinge * Pose::from_trans(DVec3::new(0.74, -0.04, 0.0)),
    };
    moved(panels.into_iter().chain([door, handle]), push)
}

/// A case of 0.7 x 0.4 x 0.6 m before the wall, its walls 6 cm thick, with one drawer as deep as it, pulled
/// out by `out` m; the whole of it moved by `push` (about its own middle).
pub fn chest(out: f64, push: Pose) -> Vec<Block> {
    let case = [
        block([0.1, 0.94, 0.3], [0.7, 0.02, 0.6], 0.0),
        block([-0.22, 0.75, 0.3], [0.06, 0.4, 0.6], 0.0),
        block([0.42, 0.75, 0.3], [0.06, 0.4, 0.6], 0.0),
        block([0.1, 0.75, 0.57], [0.7, 0.4, 0.06], 0.0),
        block([0.1, 0.75, 0.03], [0.7, 0.4, 0.06], 0.0),
    ];
    let drawer = [
        block([0.1, 0.54 - out, 0.3], [0.58, 0.02, 0.48], 0.0),
        block([-0.17, 0.73 - out, 0.28], [0.02, 0.36, 0.36], 0.0),
        block([0.37, 0.73 - out, 0.28], [0.02, 0.36, 0.36], 0.0),
        block([0.1, 0.73 - out, 0.1], [0.52, 0.36, 0.02], 0.0),
        block([0.1, 0.91 - out, 0.28], [0.52, 0.02, 0.36], 0.0),
        block([0.1, 0.51 - out, 0.3], [0.12, 0.04, 0.03], 0.0),
    ];
    moved(case.into_iter().chain(drawer), push)
}

/// A rack of bars that face all ways, with a flap of two bars that hangs at `deg`; the whole of it moved by
/// `push` (about its own middle). It has more facings than the room around it.
pub fn rack(deg: f64, push: Pose) -> Vec<Block> {
    let bar = |k: usize| {
        let turn = 25.0 * k as f64;
        let at = DQuat::from_rotation_z(turn.to_radians()) * DVec3::new(0.28, 0.0, 0.0);
        block([0.1 + at.x, 0.65 + at.y, 0.35], [0.03, 0.04, 0.7], turn)
    };
    let flap = |z: f64| {
        let hinge = Pose::new(DQuat::from_rotation_x(-deg.to_radians()), DVec3::new(0.1, 0.4, 0.7));
        let world_from_block = hinge * Pose::from_trans(DVec3::new(0.0, 0.0, -z));
        Block { half: DVec3::new(0.2, 0.015, 0.03), world_from_block }
    };
    moved((0..14).map(bar).chain([block([0.1, 0.65, 0.35], [0.6, 0.6, 0.03], 0.0), flap(0.1), flap(0.25)]), push)
}

/// What a camera sees: z, 0 where nothing is; and which block, from 1.
pub fn picture(camera: &Camera, blocks: &[Block]) -> (Vec<f32>, Vec<u8>) {
    let (w, h) = (camera.width, camera.height);
    let (mut depth, mut which) = (vec![0.0; w * h], vec![0; w * h]);
    for i in 0..w * h {
        let ray = camera.ray(DVec2::new((i % w) as f64 + 0.5, (i / w) as f64 + 0.5));
        let mut nearest = f64::INFINITY;
        for (k, b) in blocks.iter().enumerate() {
            let inside = b.world_from_block.inverse();
            let (eye, ray) = (inside.apply(camera.centre()), inside.rotate(ray));
            let (lo, hi) = ((-b.half - eye) / ray, (b.half - eye) / ray);
            let (enter, leave) = (lo.min(hi).max_element(), lo.max(hi).min_element());
            if enter < leave && enter > 0.0 && enter < nearest {
                nearest = enter;
                let (_, z) = camera.project(camera.centre() + b.world_from_block.rotate(ray) * enter);
                (depth[i], which[i]) = (z as f32, k as u8 + 1);
            }
        }
    }
    (depth, which)
}

/// Cameras on an arc in front of the cupboard, looking at it; `seed` varies them.
pub fn cameras(count: usize, seed: u64) -> Vec<Camera> {
    let mut rng = fastrand::Rng::with_seed(seed);
    (0..count)
        .map(|k| {
            let turn = (-60.0 + 120.0 * (k as f64 + rng.f64()) / count as f64).to_radians();
            let (r, z) = (1.7 + 0.3 * rng.f64(), 0.5 + 1.1 * rng.f64());
            let eye = DVec3::new(0.1 + r * turn.sin(), 0.6 - r * turn.cos(), z);
            Camera::look_at(eye, DVec3::new(0.1, 0.6, 0.4), DVec3::Z, 128, 96, 1.0)
        })
        .collect()
}

/// Views of a scene in a world of their own: `own_from_world` of the cameras.
pub fn views(blocks: &[Block], own_from_world: &Pose, count: usize, seed: u64) -> Vec<DepthView> {
    let view = |camera: Camera| {
        let (depth, _) = picture(&camera, blocks);
        let class = depth.iter().map(|z| if *z > 0.0 { OBJECT } else { UNKNOWN }).collect();
        let camera = Camera { camera_from_world: camera.camera_from_world * own_from_world.inverse(), ..camera };
        DepthView { camera, depth, class }
    };
    cameras(count, seed).into_iter().map(view).collect()
}
