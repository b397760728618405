//! Fits a ray-traced scene and measures held-out views: textured boxes and a sphere, a thin plate,
//! thin rods.
//!
//! `cargo run --release -p hingecast-splat --example fit_quality [-- gaussians iterations threads
//! noise]` `noise`: standard deviation of the depth in 1/1000 of the depth; with it colours are
//! rounded to 8 bit. Colour is supersampled 4 x 4 over a white background; mask and depth are those
//! of the pixel centre.

use glam::{DQuat, DVec2, DVec3};
use hingecast_geom::{Camera, Progress};
use hingecast_splat::{
    Engine, FitConfig, Pixels, RenderOptions, Target, TargetImages, Views, fit, initialise, metrics,
};
use std::sync::Arc;
use std::time::Instant;

const SIZE: usize = 256;
const BACKGROUND: [f32; 3] = [1.0; 3];

/// A box with half extents `half` at `centre`, or a sphere when `half.y` is 0 (radius `half.x`).
struct Solid {
    centre: DVec3,
    half: DVec3,
    rot: DQuat,
    texture: u32,
}

fn scene() -> Vec<Solid> {
    let solid = |c: [f64; 3], h: [f64; 3], axis: DVec3, angle: f64, texture| Solid {
        centre: DVec3::from(c),
        half: DVec3::from(h),
        rot: DQuat::from_axis_angle(axis, angle),
        texture,
    };
    vec![
        solid([0.0, 0.0, 0.0], [0.35, 0.25, 0.2], DVec3::Z, 0.2, 0),
        solid([0.1, 0.05, 0.34], [0.13, 0.0, 0.0], DVec3::Z, 0.0, 1),
        // A door standing open: 1 cm thin.
        solid([0.52, 0.12, 0.02], [0.16, 0.006, 0.18], DVec3::Z, 0.9, 2),
        // Rods: 1.2 cm and 2 cm thick.
        solid([-0.2, 0.0, 0.4], [0.006, 0.006, 0.2], DVec3::Y, 0.3, 3),
        solid([-0.1, -0.32, 0.0], [0.25, 0.01, 0.01], DVec3::Z, 0.2, 3),
    ]
}

/// Distance and normal of the first hit.
fn hit(s: &Solid, eye: DVec3, dir: DVec3) -> Option<(f64, DVec3)> {
    let inverse = s.rot.conjugate();
    let (o, d) = (inverse * (eye - s.centre), inverse * dir);
    if s.half.y == 0.0 {
        let (a, b, c) = (d.dot(d), o.dot(d), o.dot(o) - s.half.x * s.half.x);
        let root = b * b - a * c;
        let t = (root > 0.0).then(|| (-b - root.sqrt()) / a)?;
        return (t > 0.0).then(|| (t, s.rot * (o + d * t).normalize()));
    }
    let (t1, t2) = ((-s.half - o) / d, (s.half - o) / d);
    let (near, far) = (t1.min(t2), t1.max(t2));
    let t = near.max_element();
    if t > far.min_element() || t <= 0.0 {
        return None;
    }
    let axis = [near.x, near.y, near.z].iter().position(|v| *v == t)?;
    let normal = [DVec3::X, DVec3::Y, DVec3::Z][axis] * -d[axis].signum();
    Some((t, s.rot * normal))
}

fn colour(s: &Solid, point: DVec3, normal: DVec3) -> DVec3 {
    let p = s.rot.conjugate() * (point - s.centre);
    let cell = (p * 14.0).floor();
    let check = if (cell.x + cell.y + cell.z).rem_euclid(2.0) < 1.0 { 1.0 } else { 0.0 };
    let wave = 0.5 + 0.5 * (31.0 * p.x + 17.0 * p.y).sin() * (23.0 * p.z + 3.0).cos();
    let base = match s.texture {
        0 => DVec3::new(0.75, 0.35, 0.2) * (0.5 + 0.5 * check) + DVec3::new(0.0, 0.2, 0.3) * wave,
        1 => DVec3::new(0.2, 0.3 + 0.5 * wave, 0.8 - 0.4 * check),
        2 => DVec3::new(0.3 + 0.5 * check, 0.6, 0.25 + 0.3 * wave),
        _ => DVec3::new(0.35, 0.35, 0.4),
    };
    let light = 0.55 + 0.45 * normal.dot(DVec3::new(0.4, -0.5, 0.77)).max(0.0);
    base * light
}

/// Colour and camera depth along the ray through `uv`.
fn trace(scene: &[Solid], camera: &Camera, uv: DVec2) -> Option<(DVec3, f64)> {
    // The ray's camera z is 1, so the parameter is the depth.
    let (eye, dir) = (camera.centre(), camera.ray(uv));
    let hits = scene.iter().filter_map(|s| hit(s, eye, dir).map(|(t, n)| (t, n, s)));
    let (t, n, s) = hits.min_by(|a, b| a.0.total_cmp(&b.0))?;
    Some((colour(s, eye + dir * t, n), t))
}

struct Truth {
    rgb: Vec<f32>,
    depth: Vec<f32>,
    mask: Vec<f32>,
}

fn picture(scene: &[Solid], camera: &Camera) -> Truth {
    let mut out = Truth { rgb: Vec::new(), depth: Vec::new(), mask: Vec::new() };
    for y in 0..SIZE {
        for x in 0..SIZE {
            let mut sum = DVec3::ZERO;
            for k in 0..16 {
                let offset = DVec2::new((k % 4) as f64 + 0.5, (k / 4) as f64 + 0.5) * 0.25;
                let sample = trace(scene, camera, DVec2::new(x as f64, y as f64) + offset);
                sum += sample.map_or(DVec3::ONE, |(c, _)| c);
            }
            out.rgb.extend((sum / 16.0).as_vec3().to_array());
            let centre = trace(scene, camera, DVec2::new(x as f64 + 0.5, y as f64 + 0.5));
            out.depth.push(centre.map_or(0.0, |(_, z)| z as f32));
            out.mask.push(if centre.is_some() { 1.0 } else { 0.0 });
        }
    }
    out
}

/// `count` cameras on a spiral, turned by `phase`.
fn cameras(count: usize, phase: f64) -> Vec<Camera> {
    (0..count)
        .map(|i| {
            let z: f64 = 0.95 - 1.5 * (i as f64 + 0.5) / count as f64;
            let (s, c) = (i as f64 * 2.399_963 + phase).sin_cos();
            let eye = DVec3::new((1.0 - z * z).sqrt() * c, (1.0 - z * z).sqrt() * s, z) * 2.0;
            Camera::look_at(eye, DVec3::new(0.08, 0.0, 0.1), DVec3::Z, SIZE, SIZE, 40f64.to_radians())
        })
        .collect()
}

fn main() {
    let args: Vec<usize> = std::env::args().skip(1).filter_map(|a| a.parse().ok()).collect();
    let arg = |i: usize, default: usize| args.get(i).copied().unwrap_or(default);
    let (n, iterations, threads, noise) = (arg(0, 25_000), arg(1, 4000), arg(2, 2), arg(3, 0));
    let mut rng = fastrand::Rng::with_seed(3);
    let scene = scene();
    let diagonal = 1.45;
    let targets: Vec<Arc<Target>> = cameras(60, 0.0)
        .iter()
        .map(|camera| {
            let mut t = picture(&scene, camera);
            if noise > 0 {
                for z in &mut t.depth {
                    let normal = (0..12).map(|_| rng.f32()).sum::<f32>() - 6.0;
                    *z *= 1.0 + 1e-3 * noise as f32 * normal;
                }
                for c in &mut t.rgb {
                    *c = (*c * 255.0).round() / 255.0;
                }
            }
            let images = TargetImages {
                rgb: Pixels::F32(&t.rgb),
                depth: Some(&t.depth),
                mask: Some(Pixels::F32(&t.mask)),
                weight: None,
                background: BACKGROUND,
                shows_background: true,
            };
            Arc::new(Target::new(camera, &images).expect("valid images"))
        })
        .collect();
    let get = |i: usize| Arc::clone(&targets[i]);
    let views = Views { count: targets.len(), get: &get, poses: None };

    let start = Instant::now();
    let first = initialise(&views, n, 1).expect("depth to start from");
    println!("initialised {} gaussians in {:.2} s", first.len(), start.elapsed().as_secs_f64());
    let mut engine = Engine::from_gaussians(&first, threads).expect("valid gaussians");
    let held_out: Vec<(Camera, Truth)> = cameras(12, 1.1).into_iter().map(|c| (c, picture(&scene, &c))).collect();
    report("start", &mut engine, &held_out, diagonal);

    let start = Instant::now();
    let config = FitConfig { iterations, ..FitConfig::default() };
    let result = fit(&mut engine, &views, &config, &Progress::default()).expect("a fit");
    let seconds = start.elapsed().as_secs_f64();
    println!(
        "{iterations} iterations in {seconds:.1} s ({:.2} ms each), train psnr {:.2} dB, {} relocated",
        1e3 * seconds / iterations as f64,
        result.psnr,
        result.relocated
    );
    report("end", &mut engine, &held_out, diagonal);
}

fn report(when: &str, engine: &mut Engine, views: &[(Camera, Truth)], diagonal: f64) {
    let (mut psnr, mut ssim, mut depth, mut bias, mut iou) = (0.0, 0.0, 0.0, 0.0, 0.0);
    for (camera, truth) in views {
        let r =
            engine.render(camera, &RenderOptions { background: BACKGROUND, ..Default::default() }).expect("a camera");
        psnr += metrics::psnr(&r.rgb, &truth.rgb);
        ssim += metrics::ssim(&r.rgb, &truth.rgb, SIZE, SIZE);
        let z = r.depth_normalised();
        depth += metrics::depth_mae(&z, &truth.depth).unwrap_or(f64::NAN);
        let both = || z.iter().zip(&truth.depth).filter(|(a, b)| **a > 0.0 && **b > 0.0);
        bias += both().map(|(a, b)| f64::from(a - b)).sum::<f64>() / both().count() as f64;
        iou += metrics::mask_iou(&r.alpha, &truth.mask);
    }
    let n = views.len() as f64;
    println!(
        "{when}: held-out psnr {:.2} dB, ssim {:.4}, depth error {:.3} % of the diagonal (bias {:+.3} %), mask iou {:.4}",
        psnr / n,
        ssim / n,
        100.0 * depth / n / diagonal,
        100.0 * bias / n / diagonal,
        iou / n
    );
}
