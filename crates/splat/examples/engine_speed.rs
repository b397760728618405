//! Milliseconds per pass at 20 000 gaussians and 256 x 256, the engine against its per-pixel scalar
//! twin, in one run.
//!
//! `cargo run --release -p hingecast-splat --example engine_speed [-- threads]` A bumpy sphere of
//! flattened gaussians, colour + depth + alpha loss with SSIM, fourteen parameters each. The twin
//! computes in f64; the same loops in f32 took about two thirds of its time. The twin runs one view
//! per thread, which is its best case: no synchronisation inside an image.

use glam::{DVec3, Vec3};
use hingecast_geom::{Camera, Gaussians};
use hingecast_splat::reference::{self, Scene};
use hingecast_splat::{
    Engine, Gradients, LossConfig, PixelGradients, Pixels, Rates, RenderOptions, Simd, Target, TargetImages,
};
use std::time::Instant;

const N: usize = 20_000;
const SIZE: usize = 256;

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
        let q = glam::Quat::from_rotation_arc(Vec3::Z, d);
        g.quats.push([q.w, q.x, q.y, q.z].map(|v| v + 0.1 * noise()));
        g.opacities.push(1.0 + 1.2 * noise());
        let cell = (d * 6.0).floor();
        let check = if (cell.x + cell.y + cell.z) as i32 & 1 == 0 { 0.8 } else { -0.6 };
        g.sh0.push([check + 0.3 * noise(), 0.6 * (4.0 * d.x).sin() + 0.2 * noise(), -0.5 * check + 0.2 * noise()]);
    }
    g
}

fn cameras() -> Vec<Camera> {
    (0..8)
        .map(|i| {
            let z: f64 = 0.9 - 1.8 * (i as f64 + 0.5) / 8.0;
            let (s, c) = (i as f64 * 2.399_963).sin_cos();
            let eye = DVec3::new((1.0 - z * z).sqrt() * c, (1.0 - z * z).sqrt() * s, z) * 3.2;
            Camera::look_at(eye, DVec3::ZERO, DVec3::Z, SIZE, SIZE, 45f64.to_radians())
        })
        .collect()
}

/// Median of `rounds` timings, ms.
fn median_ms(rounds: usize, mut f: impl FnMut(usize)) -> f64 {
    let mut times: Vec<f64> = (0..rounds)
        .map(|i| {
            let start = Instant::now();
            f(i);
            start.elapsed().as_secs_f64() * 1e3
        })
        .collect();
    times.sort_by(f64::total_cmp);
    times[rounds / 2]
}

fn main() {
    let threads = std::env::args().nth(1).and_then(|a| a.parse().ok()).unwrap_or(2);
    let truth = sphere();
    let cameras = cameras();
    let mut painter = Engine::from_gaussians(&truth, threads).expect("a valid scene");
    let targets: Vec<Target> = cameras
        .iter()
        .map(|camera| {
            let r = painter.render(camera, &RenderOptions::default()).expect("a valid camera");
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
            Target::new(camera, &images).expect("valid images")
        })
        .collect();
    drop(painter);
    let mut start = truth;
    let mut rng = fastrand::Rng::with_seed(11);
    for (m, c) in start.means.iter_mut().zip(&mut start.sh0) {
        for k in 0..3 {
            m[k] += 0.01 * (rng.f32() - 0.5);
            c[k] += 0.5 * (rng.f32() - 0.5);
        }
    }
    let (config, rates) = (LossConfig::default(), Rates { means: 1e-4, ..Rates::default() });

    println!(
        "{N} gaussians, {SIZE} x {SIZE}, {threads} threads; ms (median), and how often faster than the scalar twin"
    );
    let slow = measure_reference(&start, &cameras, &targets, &config, threads);
    println!(
        "{:<10} forward {:6.2}        backward {:6.2}        iteration {:6.2}",
        "scalar", slow[0], slow[1], slow[2]
    );
    for simd in Simd::available() {
        let fast = measure_engine(&start, simd, threads, &cameras, &targets, &config, &rates);
        println!(
            "{:<10} forward {:6.2} ({:4.1}x) backward {:6.2} ({:4.1}x) iteration {:6.2} ({:4.1}x)",
            format!("{simd:?}"),
            fast[0],
            slow[0] / fast[0],
            fast[1],
            slow[1] / fast[1],
            fast[2],
            slow[2] / fast[2]
        );
    }
}

/// Forward, backward (pixels to parameters), iteration without Adam; ms per view with `threads`
/// views at a time.
fn measure_reference(
    g: &Gaussians,
    cameras: &[Camera],
    targets: &[Target],
    config: &LossConfig,
    threads: usize,
) -> [f64; 3] {
    let scene = Scene { gaussians: g, groups: &[], world_from_group: &[], extra: &[], channels: 0 };
    let parallel = |work: &(dyn Fn(usize) + Sync)| {
        median_ms(9, |i| {
            std::thread::scope(|s| {
                for t in 0..threads {
                    s.spawn(move || work((i + t) % cameras.len()));
                }
            });
        }) / threads as f64
    };
    let forward = parallel(&|i| {
        std::hint::black_box(reference::render(&scene, &cameras[i], [0.0; 3]));
    });
    let prepared: Vec<_> = cameras
        .iter()
        .zip(targets)
        .map(|(camera, target)| {
            let image = reference::render(&scene, camera, [0.0; 3]);
            let pixels = reference::loss(&image, target, config).1;
            (image, pixels)
        })
        .collect();
    let backward = parallel(&|i| {
        std::hint::black_box(reference::backward(&scene, &prepared[i].0, &prepared[i].1));
    });
    let iteration = parallel(&|i| {
        std::hint::black_box(reference::loss_and_gradients(&scene, &targets[i], config));
    });
    [forward, backward, iteration]
}

fn measure_engine(
    g: &Gaussians,
    simd: Simd,
    threads: usize,
    cameras: &[Camera],
    targets: &[Target],
    config: &LossConfig,
    rates: &Rates,
) -> [f64; 3] {
    let mut engine = Engine::with_simd(g, threads, simd).expect("a valid scene");
    for i in 0..16 {
        engine.step(&targets[i % 8], config, rates).expect("a valid target");
    }
    let iteration = median_ms(200, |i| {
        engine.step(&targets[i % 8], config, rates).expect("a valid target");
    });
    // Backward alone, out of the public interface: gradients of given pixels, less what the copy of
    // the pixels costs.
    let forward = median_ms(100, |i| {
        engine.render(&cameras[i % 8], &RenderOptions::default()).expect("a valid camera");
    });
    let pixels = PixelGradients {
        rgb: vec![1e-6; 3 * SIZE * SIZE],
        depth: vec![1e-6; SIZE * SIZE],
        alpha: vec![1e-6; SIZE * SIZE],
        extra: Vec::new(),
    };
    let mut gradients = Gradients::default();
    let backward = median_ms(100, |_| engine.backward(&pixels, &mut gradients).expect("a render"));
    [forward, backward, iteration]
}
