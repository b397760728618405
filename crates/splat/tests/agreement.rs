//! The fast engine against its slow twin, for every instruction set of this CPU, and against itself
//! with other threads.

mod common;

use common::{camera, gaussians, poses, relative_error, target};
use hingecast_splat::reference::{self, Scene};
use hingecast_splat::{DepthLoss, Engine, Gradients, LossConfig, Planes, Rates, RenderOptions, Simd, plane};

const N: usize = 150;

fn extra_values() -> Vec<f32> {
    let mut rng = fastrand::Rng::with_seed(8);
    (0..N * 3).map(|_| rng.f32()).collect()
}

#[test]
fn render_agrees_with_the_reference() {
    let g = gaussians(N, 1, true);
    let (groups, poses): (Vec<u16>, _) = ((0..N).map(|i| (i % 2) as u16).collect(), poses());
    let extra = extra_values();
    for (w, h) in [(71, 53), (64, 48), (7, 5)] {
        let camera = camera(w, h);
        let scene = Scene { gaussians: &g, groups: &groups, world_from_group: &poses, extra: &extra, channels: 3 };
        let slow = reference::render(&scene, &camera, [0.1, 0.2, 0.3]);
        for simd in Simd::available() {
            let mut engine = Engine::with_simd(&g, 2, simd).unwrap();
            engine.set_groups(&groups, &poses).unwrap();
            let options = RenderOptions { background: [0.1, 0.2, 0.3], extra: &extra, channels: 3 };
            let fast = engine.render(&camera, &options).unwrap();
            let check = |what: &str, a: Vec<f32>, b: &[f64]| {
                let worst = a.iter().zip(b).map(|(a, b)| (f64::from(*a) - b).abs()).fold(0.0, f64::max);
                assert_eq!(a.len(), b.len());
                assert!(worst < 1e-4, "{what} differs by {worst} ({simd:?}, {w} x {h})");
            };
            for c in 0..3 {
                check("rgb", fast.rgb[c..].iter().step_by(3).copied().collect(), &slow.rgb[c]);
                check("extra", fast.extra[c * w * h..(c + 1) * w * h].to_vec(), &slow.extra[c]);
            }
            check("depth", fast.depth.clone(), &slow.depth);
            check("transmittance", fast.alpha.iter().map(|a| 1.0 - a).collect(), &slow.transmittance);
        }
    }
}

fn plane_error(fast: &Planes, first: usize, width: usize, slow: &[f64]) -> f64 {
    let values = (0..fast.len()).flat_map(|i| (0..width).map(move |k| (i, k)));
    relative_error(values.map(|(i, k)| f64::from(fast.plane(first + k)[i])), slow.iter().copied())
}

#[test]
fn loss_and_gradients_agree_with_the_reference() {
    for (sh1, depth_loss, size) in [(true, DepthLoss::Log, (71, 53)), (false, DepthLoss::L1, (64, 48))] {
        let g = gaussians(N, 2, sh1);
        let (groups, poses): (Vec<u16>, _) = ((0..N).map(|i| u16::from(i % 5 == 0)).collect(), poses());
        let camera = camera(size.0, size.1);
        let target = target(&camera, 3);
        let config = LossConfig { depth_loss, depth: 0.4, depth_scale: 0.05, ..Default::default() };
        let scene = Scene { gaussians: &g, groups: &groups, world_from_group: &poses, extra: &[], channels: 0 };
        let (slow_terms, slow) = reference::loss_and_gradients(&scene, &target, &config);
        for simd in Simd::available() {
            let mut engine = Engine::with_simd(&g, 2, simd).unwrap();
            engine.set_groups(&groups, &poses).unwrap();
            let mut fast = Gradients::default();
            let terms = engine.loss_and_gradients(&target, &config, &mut fast).unwrap();
            for (what, a, b) in [
                ("total", terms.total, slow_terms.total),
                ("l1", terms.l1, slow_terms.l1),
                ("ssim", terms.ssim, slow_terms.ssim),
                ("depth", terms.depth, slow_terms.depth),
                ("alpha", terms.alpha, slow_terms.alpha),
                ("mse", terms.mse, slow_terms.mse),
            ] {
                assert!((a - b).abs() < 1e-4 * b.abs().max(0.1), "{what}: {a} against {b} ({simd:?})");
            }
            let p = &fast.params;
            for (what, error) in [
                ("means", plane_error(p, plane::MEANS, 3, slow.means.as_flattened())),
                ("scales", plane_error(p, plane::SCALES, 3, slow.scales.as_flattened())),
                ("quats", plane_error(p, plane::QUATS, 4, slow.quats.as_flattened())),
                ("opacity", plane_error(p, plane::OPACITY, 1, &slow.opacities)),
                ("sh0", plane_error(p, plane::SH0, 3, slow.sh0.as_flattened())),
                ("poses", relative_error(fast.poses.iter().flatten().copied(), slow.poses.iter().flatten().copied())),
            ] {
                assert!(error < 1e-3, "{what}: relative error {error} ({simd:?})");
            }
            if sh1 {
                let error = plane_error(p, plane::SH1, 9, slow.sh1.as_flattened().as_flattened());
                assert!(error < 1e-3, "sh1: relative error {error} ({simd:?})");
            }
        }
    }
}

#[test]
fn same_bytes_with_one_and_two_threads() {
    let g = gaussians(3000, 4, true);
    let camera = camera(100, 90);
    let target = target(&camera, 5);
    let extra: Vec<f32> = (0..3000).map(|i| i as f32 / 3000.0).collect();
    let config = LossConfig::default();
    let rates = Rates { means: 1e-3, sh1: 1e-3, ..Default::default() };
    for simd in Simd::available() {
        let run = |threads: usize| {
            let mut engine = Engine::with_simd(&g, threads, simd).unwrap();
            let render = engine.render(&camera, &RenderOptions { extra: &extra, channels: 1, ..Default::default() });
            let mut gradients = Gradients::default();
            let terms = engine.loss_and_gradients(&target, &config, &mut gradients).unwrap();
            for _ in 0..50 {
                engine.step(&target, &config, &rates).unwrap();
            }
            (render.unwrap(), terms, gradients.params, gradients.poses, engine.gaussians())
        };
        let (one, two, three) = (run(1), run(2), run(3));
        assert!(one == two, "{simd:?}: two threads give other bytes than one");
        assert!(one == three, "{simd:?}: three threads give other bytes than one");
    }
}

#[test]
fn a_loss_on_extra_channels_reaches_values_and_shapes() {
    let g = gaussians(N, 9, false);
    let camera = camera(71, 53);
    let target = target(&camera, 10);
    let extra = extra_values();
    let mut engine = Engine::from_gaussians(&g, 2).unwrap();
    // Only the extra channels count: their mean.
    let nothing = LossConfig { ssim: 1e-12, depth: 0.0, alpha: 0.0, ..Default::default() };
    let (mut all, mut plain) = (Gradients::default(), Gradients::default());
    let mut seen = 0.0;
    let terms = engine
        .loss_and_gradients_with_extra(
            &target,
            &nothing,
            &extra,
            3,
            |picture, gradient| {
                let scale = 1.0 / picture.len() as f32;
                gradient.fill(scale);
                seen = f64::from(picture.iter().sum::<f32>() * scale);
                seen
            },
            &mut all,
        )
        .unwrap();
    let without = engine.loss_and_gradients(&target, &nothing, &mut plain).unwrap();
    assert!((terms.total - without.total - seen).abs() < 1e-9 && seen > 0.0);
    assert_eq!(all.extra.len(), 3 * N);
    assert!(plain.extra.is_empty());
    // The sum is linear in the values: value times gradient adds up to the loss.
    let sum: f64 = all.extra.iter().zip(&extra).map(|(a, b)| f64::from(a * b)).sum();
    assert!((sum - seen).abs() < 1e-4 * seen, "{sum} against {seen}");
    assert!(all.params.plane(plane::MEANS) != plain.params.plane(plane::MEANS));
}

#[test]
fn fused_step_equals_gradients_then_adam() {
    let g = gaussians(500, 6, true);
    let camera = camera(71, 53);
    let target = target(&camera, 7);
    let (config, rates) = (LossConfig::default(), Rates { sh1: 1e-3, ..Default::default() });
    for simd in Simd::available() {
        let mut fused = Engine::with_simd(&g, 2, simd).unwrap();
        let mut parts = Engine::with_simd(&g, 2, simd).unwrap();
        let mut gradients = Gradients::default();
        for _ in 0..5 {
            let a = fused.step(&target, &config, &rates).unwrap();
            let b = parts.loss_and_gradients(&target, &config, &mut gradients).unwrap();
            parts.adam_step(&gradients, &rates).unwrap();
            assert_eq!(a, b);
        }
        assert!(fused.gaussians() == parts.gaussians(), "{simd:?}");
        assert!(fused.gaussians() != g);
    }
}
