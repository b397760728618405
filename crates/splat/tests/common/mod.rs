//! Small scenes for the tests.
#![allow(dead_code)]

use glam::{DQuat, DVec3};
use hingecast_geom::{Camera, Gaussians, Pose};
use hingecast_splat::{Pixels, Target, TargetImages};

/// `n` gaussians in a ball of radius 0.5, sizes 0.02..0.15, opacities 0.2..0.9.
pub fn gaussians(n: usize, seed: u64, sh1: bool) -> Gaussians {
    let mut rng = fastrand::Rng::with_seed(seed);
    let mut f = |lo: f32, hi: f32| lo + (hi - lo) * rng.f32();
    let mut g = Gaussians::default();
    for _ in 0..n {
        g.means.push([f(-0.4, 0.4), f(-0.4, 0.4), f(-0.4, 0.4)]);
        g.quats.push([f(-1.0, 1.0), f(-1.0, 1.0), f(-1.0, 1.0), f(0.2, 1.0)]);
        g.scales.push([f(0.02, 0.15).ln(), f(0.02, 0.15).ln(), f(0.02, 0.15).ln()]);
        g.opacities.push(f(-1.4, 2.2));
        g.sh0.push([f(-0.8, 1.5), f(-0.8, 1.5), f(-0.8, 1.5)]);
        if sh1 {
            g.sh1.push(std::array::from_fn(|_| [f(-0.3, 0.3), f(-0.3, 0.3), f(-0.3, 0.3)]));
        }
    }
    g
}

/// fx and fy differ, the principal point is off centre, the size is no multiple of 16.
pub fn camera(width: usize, height: usize) -> Camera {
    let c = Camera::look_at(DVec3::new(1.2, -0.9, 0.7), DVec3::new(0.03, 0.02, 0.0), DVec3::Z, width, height, 0.7);
    Camera { fx: c.fx * 1.05, cx: c.cx + 1.3, cy: c.cy - 0.8, ..c }
}

pub fn poses() -> Vec<Pose> {
    vec![
        Pose::new(DQuat::from_rotation_z(0.3), DVec3::new(0.05, -0.02, 0.01)),
        Pose::new(DQuat::from_euler(glam::EulerRot::XYZ, 0.4, -0.3, 0.9), DVec3::new(-0.06, 0.03, 0.08)),
    ]
}

/// Smooth random colours and depths, a disc as mask, a few ignored pixels.
pub fn target(camera: &Camera, seed: u64) -> Target {
    let (w, h) = (camera.width, camera.height);
    let mut rng = fastrand::Rng::with_seed(seed);
    let phase: Vec<f32> = (0..9).map(|_| rng.f32() * 6.0).collect();
    let (mut rgb, mut depth, mut mask, mut weight) = (vec![], vec![], vec![], vec![]);
    for y in 0..h {
        for x in 0..w {
            let (u, v) = (x as f32 / w as f32, y as f32 / h as f32);
            for c in 0..3 {
                rgb.push(0.5 + 0.4 * (9.0 * u + phase[c]).sin() * (7.0 * v + phase[3 + c]).cos());
            }
            let inside = (u - 0.5).powi(2) + (v - 0.45).powi(2) < 0.1;
            mask.push(if inside { 255u8 } else { 0 });
            depth.push(if inside && (x + y) % 7 != 0 { 1.5 + 0.2 * (5.0 * u + phase[6]).sin() } else { 0.0 });
            weight.push(if x > w / 2 && x < w / 2 + 4 && y > h / 3 { 0u8 } else { 255 });
        }
    }
    Target::new(
        camera,
        &TargetImages {
            rgb: Pixels::F32(&rgb),
            depth: Some(&depth),
            mask: Some(Pixels::U8(&mask)),
            weight: Some(Pixels::U8(&weight)),
            background: [0.2, 0.4, 0.1],
            shows_background: false,
        },
    )
    .unwrap()
}

/// Largest absolute difference, relative to the largest absolute value of `b`.
pub fn relative_error(a: impl IntoIterator<Item = f64>, b: impl IntoIterator<Item = f64>) -> f64 {
    let (mut worst, mut scale) = (0f64, 1e-12f64);
    for (x, y) in a.into_iter().zip(b) {
        worst = worst.max((x - y).abs());
        scale = scale.max(y.abs());
    }
    worst / scale
}
