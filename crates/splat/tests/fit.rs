//! Fits of a painted ball: from depth, from masks alone, stopped and resumed.

mod common;

use glam::{DVec2, DVec3};
use hingecast_geom::{Camera, Pose, Progress};
use hingecast_splat::{
    Engine, FitConfig, LossConfig, Pixels, RenderOptions, SplatError, Target, TargetImages, Views, fit, initialise,
    metrics,
};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

const W: usize = 88;
const H: usize = 72;

fn cameras(count: usize, phase: f64) -> Vec<Camera> {
    (0..count)
        .map(|i| {
            let z: f64 = 0.8 - 1.6 * (i as f64 + 0.5) / count as f64;
            let (s, c) = (i as f64 * 2.4 + phase).sin_cos();
            let eye = DVec3::new((1.0 - z * z).sqrt() * c, (1.0 - z * z).sqrt() * s, z) * 2.0;
            Camera::look_at(eye, DVec3::ZERO, DVec3::Z, W, H, 0.7)
        })
        .collect()
}

/// A ball of radius 0.5 with broad stripes: rgb, depth, mask.
fn picture(camera: &Camera) -> (Vec<f32>, Vec<f32>, Vec<f32>) {
    let (mut rgb, mut depth, mut mask) = (vec![], vec![], vec![]);
    for y in 0..H {
        for x in 0..W {
            let (eye, dir) = (camera.centre(), camera.ray(DVec2::new(x as f64 + 0.5, y as f64 + 0.5)));
            let (a, b, c) = (dir.dot(dir), eye.dot(dir), eye.dot(eye) - 0.25);
            let root = b * b - a * c;
            if root > 0.0 {
                let t = (-b - root.sqrt()) / a;
                let p = eye + dir * t;
                rgb.extend([0.5 + 0.4 * (9.0 * p.x).sin() as f32, 0.4 + 0.3 * (8.0 * p.z).cos() as f32, 0.3]);
                depth.push(t as f32);
                mask.push(1.0);
            } else {
                // What lies around the object is not the background of the render.
                rgb.extend([((x * y) % 7) as f32 / 7.0, 0.9, 0.1]);
                depth.push(3.0);
                mask.push(0.0);
            }
        }
    }
    (rgb, depth, mask)
}

fn targets(with_depth: bool) -> Vec<Arc<Target>> {
    cameras(16, 0.0)
        .iter()
        .map(|camera| {
            let (rgb, depth, mask) = picture(camera);
            let images = TargetImages {
                rgb: Pixels::F32(&rgb),
                depth: with_depth.then_some(&depth),
                mask: Some(Pixels::F32(&mask)),
                weight: None,
                background: [0.0; 3],
                shows_background: false,
            };
            Arc::new(Target::new(camera, &images).unwrap())
        })
        .collect()
}

/// Mean PSNR, mean depth error and largest alpha far from the object over views that were not
/// trained on.
fn held_out(engine: &mut Engine) -> (f64, f64, f32) {
    let (mut psnr, mut depth_error, mut stray) = (0.0, 0.0, 0f32);
    let cameras = cameras(5, 1.3);
    for camera in &cameras {
        let (mut rgb, depth, mask) = picture(camera);
        for i in 0..W * H {
            if mask[i] == 0.0 {
                rgb[3 * i..3 * i + 3].fill(0.0);
            }
        }
        let r = engine.render(camera, &RenderOptions::default()).unwrap();
        psnr += metrics::psnr(&r.rgb, &rgb) / cameras.len() as f64;
        let known: Vec<f32> = depth.iter().zip(&mask).map(|(z, m)| z * m).collect();
        depth_error += metrics::depth_mae(&r.depth_normalised(), &known).unwrap() / cameras.len() as f64;
        for y in 0..H {
            for x in 0..W {
                let from_centre = DVec2::new(x as f64 - 44.0, y as f64 - 36.0).length();
                if from_centre > 34.0 {
                    stray = stray.max(r.alpha[y * W + x]);
                }
            }
        }
    }
    (psnr, depth_error, stray)
}

#[test]
fn from_depth() {
    let targets = targets(true);
    let get = |i: usize| Arc::clone(&targets[i]);
    let views = Views { count: targets.len(), get: &get, poses: None };
    let first = initialise(&views, 2000, 1).unwrap();
    assert!((1800..2200).contains(&first.len()), "{} gaussians", first.len());
    assert!(first == initialise(&views, 2000, 1).unwrap(), "the same seed gives the same gaussians");
    for m in &first.means {
        let r = glam::Vec3::from(*m).length();
        assert!((r - 0.5).abs() < 0.03, "on the ball: {r}");
    }
    let mut engine = Engine::from_gaussians(&first, 2).unwrap();
    let config = FitConfig { iterations: 600, ..FitConfig::default() };
    let report = fit(&mut engine, &views, &config, &Progress::default()).unwrap();
    let (psnr, depth_error, stray) = held_out(&mut engine);
    // The pictures are not anti-aliased: most of the error is the staircase of the silhouette.
    assert!(psnr > 27.5 && report.psnr > 27.5, "psnr {psnr}, train {}", report.psnr);
    // A pixel is 2 cm wide here.
    assert!(depth_error < 0.008, "depth error {depth_error}");
    assert!(stray < 0.05, "something floats around the object: alpha {stray}");
}

#[test]
fn from_masks_alone() {
    let targets = targets(false);
    let get = |i: usize| Arc::clone(&targets[i]);
    let views = Views { count: targets.len(), get: &get, poses: None };
    let mut engine = Engine::from_gaussians(&initialise(&views, 1500, 1).unwrap(), 2).unwrap();
    let config = FitConfig { iterations: 900, ..FitConfig::default() };
    fit(&mut engine, &views, &config, &Progress::default()).unwrap();
    let (psnr, _, stray) = held_out(&mut engine);
    assert!(psnr > 22.0, "psnr {psnr}");
    assert!(stray < 0.05, "something floats around the object: alpha {stray}");
}

#[test]
fn a_stopped_fit_resumes_to_the_same_bytes() {
    let targets = targets(true);
    let get = |i: usize| Arc::clone(&targets[i]);
    let views = Views { count: targets.len(), get: &get, poses: None };
    let first = initialise(&views, 800, 1).unwrap();
    let folder = tempfile::tempdir().unwrap();
    let plain = FitConfig { iterations: 200, relocate_every: 60, ..FitConfig::default() };
    let saved = FitConfig { checkpoint: Some(folder.path().join("fit.safetensors")), ..plain.clone() };

    let mut whole = Engine::from_gaussians(&first, 2).unwrap();
    fit(&mut whole, &views, &plain, &Progress::default()).unwrap();

    // Stopped at the first report after 100 iterations, by someone else with one thread, and taken
    // up again.
    let stop = Arc::new(AtomicBool::new(false));
    let flag = Arc::clone(&stop);
    let progress = Progress::new(move |done, _, _| flag.store(done >= 100, Ordering::Relaxed), stop);
    let mut stopped = Engine::from_gaussians(&first, 1).unwrap();
    let error = fit(&mut stopped, &views, &saved, &progress);
    assert!(matches!(error, Err(SplatError::Cancelled(_))));
    let mut resumed = Engine::from_gaussians(&first, 2).unwrap();
    fit(&mut resumed, &views, &saved, &Progress::default()).unwrap();
    assert!(resumed.gaussians() == whole.gaussians());

    // A checkpoint of another fit is refused, and so is rubbish.
    let mut other = Engine::from_gaussians(&common::gaussians(10, 1, false), 1).unwrap();
    let error = fit(&mut other, &views, &saved, &Progress::default()).unwrap_err().to_string();
    assert!(error.contains("has shape"), "{error}");
    std::fs::write(saved.checkpoint.as_ref().unwrap(), [0u8; 5]).unwrap();
    assert!(matches!(fit(&mut other, &views, &saved, &Progress::default()), Err(SplatError::Checkpoint { .. })));
}

/// With groups they once stayed where they were: a canonical place needs the group's pose.
#[test]
fn dead_gaussians_of_a_group_move_to_its_surface() {
    let targets = targets(true);
    let get = |i: usize| Arc::clone(&targets[i]);
    let pose = common::poses()[1];
    let poses = |_: usize| vec![Pose::IDENTITY, pose];
    let views = Views { count: targets.len(), get: &get, poses: Some(&poses) };
    let mut first = initialise(&views, 1500, 1).unwrap();
    for m in &mut first.means {
        *m = pose.inverse().apply(glam::Vec3::from(*m).as_dvec3()).as_vec3().into();
    }
    // Group 0 has one dead gaussian, far away, and nothing that any view shows: it has to stay.
    let mut groups = vec![1u16; first.len()];
    groups[0] = 0;
    for i in (0..first.len()).step_by(10) {
        first.means[i] = [3.0, 3.0, 3.0];
        first.opacities[i] = -9.0;
    }
    let dead: Vec<usize> = (10..first.len()).step_by(10).collect();
    let mut engine = Engine::from_gaussians(&first, 2).unwrap();
    engine.set_groups(&groups, &[Pose::IDENTITY, pose]).unwrap();
    let config = FitConfig { iterations: 200, relocate_every: 40, ..FitConfig::default() };
    let report = fit(&mut engine, &views, &config, &Progress::default()).unwrap();
    let after = engine.gaussians();
    let off = |i: usize| (pose.apply(glam::Vec3::from(after.means[i]).as_dvec3()).length() - 0.5).abs();
    let on_the_ball = dead.iter().filter(|&&i| off(i) < 0.05).count();
    assert!(report.relocated >= dead.len(), "{} moved", report.relocated);
    assert!(10 * on_the_ball >= 9 * dead.len(), "{on_the_ball} of {}", dead.len());
    assert!(glam::Vec3::from(after.means[0]).length() > 4.0, "{:?}", after.means[0]);
}

#[test]
fn a_group_pose_is_found_by_its_twist_gradient() {
    let targets = targets(true);
    let get = |i: usize| Arc::clone(&targets[i]);
    let views = Views { count: targets.len(), get: &get, poses: None };
    let mut engine = Engine::from_gaussians(&initialise(&views, 1500, 1).unwrap(), 2).unwrap();
    fit(&mut engine, &views, &FitConfig { iterations: 300, ..FitConfig::default() }, &Progress::default()).unwrap();

    // Everything is one group that starts 5 cm off; plain gradient descent of decreasing length
    // brings it back.
    let wrong = DVec3::new(0.05, -0.03, 0.02);
    let mut at = wrong;
    let groups = vec![0u16; engine.len()];
    let config = LossConfig { ssim: 0.0, ..LossConfig::default() };
    let mut gradients = hingecast_splat::Gradients::default();
    for i in 0..200 {
        engine.set_groups(&groups, &[Pose::from_trans(at)]).unwrap();
        engine.loss_and_gradients(&targets[i % targets.len()], &config, &mut gradients).unwrap();
        let g = gradients.poses[0];
        let direction = DVec3::new(g[0], g[1], g[2]).normalize_or_zero();
        at -= direction * 0.004 * 0.97f64.powi(i as i32);
    }
    assert!(at.length() < 0.004, "from {} m off to {} m off", wrong.length(), at.length());
}
