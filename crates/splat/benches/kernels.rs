//! One view of 20 000 gaussians at 256 x 256: forward, loss, backward, a whole step of training.
//!
//! `cargo bench -p hingecast-splat`. The scene is that of `examples/engine_speed.rs`, which
//! compares with the scalar twin. Projection, sorting and rasterising are one pass behind
//! `Engine::render`.

use divan::{Bencher, black_box};
use glam::{DVec3, Quat, Vec3};
use hingecast_geom::{Camera, Gaussians};
use hingecast_splat::{
    Engine, Gradients, LossConfig, PixelGradients, Pixels, Rates, RenderOptions, Target, TargetImages,
};

const N: usize = 20_000;
const SIZE: usize = 256;
const THREADS: [usize; 2] = [1, 2];

fn main() {
    divan::main();
}

/// A bumpy, checkered sphere of flattened gaussians.
fn sphere() -> Gaussians {
    let mut rng = fastrand::Rng::with_seed(7);
    let mut noise = move || (0..6).map(|_| rng.f32() - 0.5).sum::<f32>() * 1.41;
    let spacing = (12.57 / N as f32).sqrt();
    let mut g = Gaussians::default();
    for i in 0..N {
        let z = 1.0 - 2.0 * (i as f32 + 0.5) / N as f32;
        let (s, c) = (i as f32 * 2.399_963).sin_cos();
        let d = Vec3::new((1.0 - z * z).sqrt() * c, (1.0 - z * z).sqrt() * s, z);
        let radius = 1.0 + 0.12 * (5.0 * d.x).sin() * (4.0 * d.y + 1.0).cos() + 0.05 * (11.0 * d.z).sin();
        let jitter = Vec3::new(noise(), noise(), noise()) * spacing * 0.15;
        g.means.push((d * radius + jitter).into());
        let tangent = |n: f32| (0.8 * spacing).ln() + 0.35 * n;
        g.scales.push([tangent(noise()), tangent(noise()), (0.25 * spacing).ln() + 0.35 * noise()]);
        let q = Quat::from_rotation_arc(Vec3::Z, d);
        g.quats.push([q.w, q.x, q.y, q.z].map(|v| v + 0.1 * noise()));
        g.opacities.push(1.0 + 1.2 * noise());
        let cell = (d * 6.0).floor();
        let check = if (cell.x + cell.y + cell.z) as i32 & 1 == 0 { 0.8 } else { -0.6 };
        g.sh0.push([check + 0.3 * noise(), 0.6 * (4.0 * d.x).sin() + 0.2 * noise(), -0.5 * check + 0.2 * noise()]);
    }
    g
}

fn camera() -> Camera {
    Camera::look_at(DVec3::new(2.2, 1.4, 1.8), DVec3::ZERO, DVec3::Z, SIZE, SIZE, 45f64.to_radians())
}

/// The engine on a sphere that is a little off, and what the sphere looks like.
fn off_and_target(threads: usize) -> (Engine, Target) {
    let truth = sphere();
    let r = Engine::from_gaussians(&truth, threads).unwrap().render(&camera(), &RenderOptions::default()).unwrap();
    let mask: Vec<f32> = r.alpha.iter().map(|a| f32::from(*a > 0.5)).collect();
    let depth = r.depth_normalised();
    let images = TargetImages {
        rgb: Pixels::F32(&r.rgb),
        depth: Some(&depth),
        mask: Some(Pixels::F32(&mask)),
        weight: None,
        background: [0.0; 3],
        shows_background: true,
    };
    let target = Target::new(&camera(), &images).unwrap();
    let mut off = truth;
    let mut rng = fastrand::Rng::with_seed(11);
    off.means.iter_mut().flatten().for_each(|m| *m += 0.01 * (rng.f32() - 0.5));
    (Engine::from_gaussians(&off, threads).unwrap(), target)
}

/// Project, sort, rasterise, and hand the picture out.
#[divan::bench(args = THREADS)]
fn forward(bencher: Bencher, threads: usize) {
    let (mut engine, _) = off_and_target(threads);
    let options = RenderOptions::default();
    bencher.bench_local(|| engine.render(black_box(&camera()), &options).unwrap());
}

/// Forward, then colour, depth, alpha and SSIM against a target.
#[divan::bench(args = THREADS)]
fn forward_and_loss(bencher: Bencher, threads: usize) {
    let (mut engine, target) = off_and_target(threads);
    bencher.bench_local(|| engine.loss(black_box(&target), &LossConfig::default()).unwrap());
}

/// From gradients of pixels to gradients of parameters, after one forward pass.
#[divan::bench(args = THREADS)]
fn backward(bencher: Bencher, threads: usize) {
    let (mut engine, _) = off_and_target(threads);
    engine.render(&camera(), &RenderOptions::default()).unwrap();
    let n = SIZE * SIZE;
    let pixels =
        PixelGradients { rgb: vec![1e-6; 3 * n], depth: vec![1e-6; n], alpha: vec![1e-6; n], extra: Vec::new() };
    let mut gradients = Gradients::default();
    bencher.bench_local(|| engine.backward(black_box(&pixels), &mut gradients).unwrap());
}

/// Forward, loss, backward, Adam.
#[divan::bench(args = THREADS)]
fn step(bencher: Bencher, threads: usize) {
    let (mut engine, target) = off_and_target(threads);
    let rates = Rates { means: 1e-4, ..Rates::default() };
    bencher.bench_local(|| engine.step(black_box(&target), &LossConfig::default(), &rates).unwrap());
}
