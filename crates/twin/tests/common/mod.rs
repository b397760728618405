//! A hollow box with a hinged lid, ray-cast analytically.

use glam::{DVec2, DVec3};
use hingecast_geom::{Camera, Cancelled, Joint, JointKind, KinematicTree, Progress, Screw};
use hingecast_twin::{BACKGROUND, Config, Observation, Twin, build, build::Input};

/// Slabs of one part: lower and upper corner.
pub type Slabs = Vec<(DVec3, DVec3)>;

/// Of the base and the lid.
pub fn slabs() -> [Slabs; 2] {
    let v = DVec3::new;
    let t = 0.02;
    let base = vec![
        (v(-0.2, -0.15, 0.0), v(0.2, 0.15, t)),
        (v(-0.2, -0.15, t), v(-0.2 + t, 0.15, 0.2)),
        (v(0.2 - t, -0.15, t), v(0.2, 0.15, 0.2)),
        (v(-0.2 + t, -0.15, t), v(0.2 - t, -0.15 + t, 0.2)),
        (v(-0.2 + t, 0.15 - t, t), v(0.2 - t, 0.15, 0.2)),
    ];
    [base, vec![(v(-0.2, -0.15, 0.2), v(0.2, 0.15, 0.22))]]
}

/// The lid turns about an edge of the box; four states.
pub fn tree() -> KinematicTree {
    let screw = Screw { kind: JointKind::Revolute, axis: DVec3::NEG_Y, pivot: DVec3::new(-0.2, 0.0, 0.2) };
    KinematicTree {
        parts: vec!["base".into(), "lid".into()],
        joints: vec![Joint {
            name: "hinge".into(),
            parent: 0,
            child: 1,
            screw,
            values: vec![0.0, 0.5, 1.0, 1.5],
            limits: [0.0, 1.5],
        }],
        ..Default::default()
    }
}

fn ray_box(o: DVec3, d: DVec3, lo: DVec3, hi: DVec3) -> Option<f64> {
    let (a, b) = ((lo - o) / d, (hi - o) / d);
    let near = a.min(b).max_element();
    let far = a.max(b).min_element();
    (near <= far && near > 0.0).then_some(near)
}

/// Colour of a point of a part, the part's frame.
pub type Paint<'a> = &'a (dyn Fn(usize, DVec3) -> [u8; 3] + Sync);

/// One of 24 views of one of four states.
pub fn observe(parts: &[Slabs; 2], paint: Paint, state: usize, view: usize) -> Observation {
    let angle = view as f64 * 2.4;
    let height = 0.1 + 0.9 * (view as f64 + 0.5) / 24.0;
    let ring = (1.0 - height * height).max(0.0).sqrt();
    let target = DVec3::new(0.0, 0.0, 0.15);
    let eye = target + 1.2 * DVec3::new(ring * angle.cos(), ring * angle.sin(), height);
    let camera = Camera::look_at(eye, target, DVec3::Z, 160, 160, 0.7);
    let poses = tree().poses_at(state);
    let mut seen = Observation {
        state,
        camera,
        depth: vec![0.0; 160 * 160],
        labels: vec![BACKGROUND; 160 * 160],
        rgb: vec![0; 3 * 160 * 160],
    };
    for i in 0..160 * 160 {
        let d = camera.ray(DVec2::new((i % 160) as f64 + 0.5, (i / 160) as f64 + 0.5));
        for (part, boxes) in parts.iter().enumerate() {
            let back = poses[part].inverse();
            for &(lo, hi) in boxes {
                if let Some(z) = ray_box(back.apply(eye), back.rotate(d), lo, hi)
                    && (seen.labels[i] == BACKGROUND || (z as f32) < seen.depth[i])
                {
                    seen.depth[i] = z as f32;
                    seen.labels[i] = part as u8;
                    let color = paint(part, back.apply(eye + z * d));
                    seen.rgb[3 * i..3 * i + 3].copy_from_slice(&color);
                }
            }
        }
    }
    seen
}

/// From 24 views of each of the four states.
pub fn twin_of(load: &(dyn Fn(usize, usize) -> Observation + Sync), config: &Config) -> Twin {
    let tree = tree();
    let input = Input {
        name: "box",
        tree: &tree,
        n_states: 4,
        n_observations: 4 * 24,
        diagonal: 0.55,
        metric: true,
        up: DVec3::Z,
    };
    let load = |i: usize| Ok::<_, Cancelled>(load(i / 24, i % 24));
    build(&input, &load, config, &Progress::default()).unwrap()
}
