//! Every analytic gradient against central differences of the f64 reference.
//!
//! A gaussian's edge (alpha = 1/255) and the depth order are steps of the pipeline: a difference
//! that happens to cross one is wrong. Steps are small (the reference is f64) and of several sizes,
//! and one of them has to agree: a wrong gradient agrees with none.

mod common;

use common::{camera, gaussians, poses, target};
use hingecast_geom::pose::quat_from_rotation_vector;
use hingecast_geom::{Gaussians, Pose};
use hingecast_splat::reference::{self, Scene};
use hingecast_splat::{Engine, Gradients, LossConfig, PixelGradients, RenderOptions, plane};

const N: usize = 20;
const STEPS: [f32; 6] = [5e-4, 2e-4, 8e-5, 2e-5, 5e-6, 1e-6];

/// 1 % of the value, or of 2 % of the largest value of its kind.
fn close(analytic: f64, difference: f64, largest: f64) -> bool {
    (analytic - difference).abs() <= 0.01 * difference.abs().max(0.02 * largest)
}

/// Checks one parameter array: `set(g, i, k, value)` writes and `get` reads component k of gaussian
/// i.
fn check_parameter(
    name: &str,
    g: &Gaussians,
    width: usize,
    access: fn(&mut Gaussians, usize, usize) -> &mut f32,
    analytic: &dyn Fn(usize, usize) -> f64,
    value: &dyn Fn(&Gaussians) -> f64,
) {
    let largest =
        (0..N).flat_map(|i| (0..width).map(move |k| (i, k))).fold(0f64, |m, (i, k)| m.max(analytic(i, k).abs()));
    assert!(largest > 0.0, "{name}: no gradient at all");
    let mut work = g.clone();
    for i in 0..N {
        for k in 0..width {
            let centre = *access(&mut work, i, k);
            let tried: Vec<f64> = STEPS
                .iter()
                .map(|step| {
                    let (lo, hi) = (centre - step, centre + step);
                    *access(&mut work, i, k) = hi;
                    let above = value(&work);
                    *access(&mut work, i, k) = lo;
                    let below = value(&work);
                    *access(&mut work, i, k) = centre;
                    (above - below) / (f64::from(hi) - f64::from(lo))
                })
                .collect();
            let a = analytic(i, k);
            assert!(tried.iter().any(|d| close(a, *d, largest)), "{name}[{i}][{k}]: {a} against {tried:?}");
        }
    }
}

fn check_all_parameters(g: &Gaussians, gradients: &Gradients, value: &dyn Fn(&Gaussians) -> f64) {
    let p = &gradients.params;
    let from = |first: usize| move |i: usize, k: usize| f64::from(p.plane(first + k)[i]);
    check_parameter("means", g, 3, |g, i, k| &mut g.means[i][k], &from(plane::MEANS), value);
    check_parameter("scales", g, 3, |g, i, k| &mut g.scales[i][k], &from(plane::SCALES), value);
    check_parameter("quats", g, 4, |g, i, k| &mut g.quats[i][k], &from(plane::QUATS), value);
    check_parameter("opacity", g, 1, |g, i, _| &mut g.opacities[i], &from(plane::OPACITY), value);
    check_parameter("sh0", g, 3, |g, i, k| &mut g.sh0[i][k], &from(plane::SH0), value);
    if !g.sh1.is_empty() {
        check_parameter("sh1", g, 9, |g, i, k| &mut g.sh1[i][k / 3][k % 3], &from(plane::SH1), value);
    }
}

fn check_poses(poses: &[Pose], analytic: &[[f64; 6]], value: &dyn Fn(&[Pose]) -> f64) {
    for group in 0..poses.len() {
        let largest = analytic[group].iter().fold(0f64, |m, x| m.max(x.abs()));
        for k in 0..6 {
            let at = |h: f64| {
                let mut xi = [0.0; 6];
                xi[k] = h;
                let twist = Pose::new(
                    quat_from_rotation_vector(glam::DVec3::new(xi[3], xi[4], xi[5])),
                    glam::DVec3::new(xi[0], xi[1], xi[2]),
                );
                let mut moved = poses.to_vec();
                moved[group] = twist * moved[group];
                value(&moved)
            };
            let tried: Vec<f64> = [1e-5, 1e-6, 1e-7].iter().map(|h| (at(*h) - at(-h)) / (2.0 * h)).collect();
            let a = analytic[group][k];
            assert!(tried.iter().any(|d| close(a, *d, largest)), "pose {group} twist {k}: {a} against {tried:?}");
        }
    }
}

#[test]
fn gradients_of_the_image_by_everything() {
    let g = gaussians(N, 11, true);
    let groups: Vec<u16> = (0..N).map(|i| u16::from(i % 3 == 0)).collect();
    let poses = poses();
    let mut rng = fastrand::Rng::with_seed(12);
    let channels = 2;
    let extra: Vec<f32> = (0..N * channels).map(|_| rng.f32()).collect();
    let camera = camera(44, 37);
    let count = camera.width * camera.height;

    // The scalar is a random weighting of all pixels of all planes.
    let mut random = |n: usize| -> Vec<f32> { (0..n).map(|_| rng.f32() * 2.0 - 1.0).collect() };
    let pixels = PixelGradients {
        rgb: random(3 * count),
        depth: random(count),
        alpha: random(count),
        extra: random(channels * count),
    };
    let background = [0.3, 0.6, 0.9];
    let value = |g: &Gaussians, poses: &[Pose], extra: &[f32]| {
        let scene = Scene { gaussians: g, groups: &groups, world_from_group: poses, extra, channels };
        let image = reference::render(&scene, &camera, background);
        let mut sum = 0.0;
        for i in 0..count {
            for c in 0..3 {
                sum += f64::from(pixels.rgb[3 * i + c]) * image.rgb[c][i];
            }
            sum += f64::from(pixels.depth[i]) * image.depth[i];
            sum += f64::from(pixels.alpha[i]) * (1.0 - image.transmittance[i]);
            for c in 0..channels {
                sum += f64::from(pixels.extra[c * count + i]) * image.extra[c][i];
            }
        }
        sum
    };

    let mut engine = Engine::from_gaussians(&g, 2).unwrap();
    engine.set_groups(&groups, &poses).unwrap();
    engine.render(&camera, &RenderOptions { background, extra: &extra, channels }).unwrap();
    let mut gradients = Gradients::default();
    engine.backward(&pixels, &mut gradients).unwrap();

    check_all_parameters(&g, &gradients, &|g| value(g, &poses, &extra));
    check_poses(&poses, &gradients.poses, &|poses| value(&g, poses, &extra));

    // The picture is linear in the extra values.
    for i in 0..extra.len() {
        let mut moved = extra.clone();
        moved[i] += 1.0;
        let difference = value(&g, &poses, &moved) - value(&g, &poses, &extra);
        let a = f64::from(gradients.extra[i]);
        assert!((a - difference).abs() < 1e-3 * difference.abs().max(1.0), "extra {i}: {a} against {difference}");
    }

    // Moving the camera by a twist is moving every group by it.
    for k in 0..6 {
        let sum: f64 = gradients.poses.iter().map(|p| p[k]).sum();
        assert!((sum - gradients.camera[k]).abs() < 1e-9);
    }
}

#[test]
fn gradients_of_the_loss_by_everything() {
    let g = gaussians(N, 21, false);
    let camera = camera(44, 37);
    let target = target(&camera, 22);
    let config = LossConfig { depth: 0.3, depth_scale: 0.1, ..Default::default() };
    let groups = vec![0u16; N];
    let value = |g: &Gaussians, poses: &[Pose]| {
        let scene = Scene { gaussians: g, groups: &groups, world_from_group: poses, extra: &[], channels: 0 };
        let image = reference::render(&scene, target.camera(), target.background());
        reference::loss(&image, &target, &config).0.total
    };
    let mut engine = Engine::from_gaussians(&g, 2).unwrap();
    let mut gradients = Gradients::default();
    engine.loss_and_gradients(&target, &config, &mut gradients).unwrap();
    check_all_parameters(&g, &gradients, &|g| value(g, &[Pose::IDENTITY]));
    check_poses(&[Pose::IDENTITY], &gradients.poses, &|poses| value(&g, poses));
}
