//! Bad input is refused with an error that names it.

mod common;

use common::{camera, target};
use hingecast_geom::{Camera, Gaussians, Pose};
use hingecast_splat::{
    Engine, Gradients, LossConfig, PixelGradients, Pixels, Planes, Rates, RenderOptions, SplatError, Target,
    TargetImages, Views, initialise,
};
use std::sync::Arc;

#[test]
fn bad_gaussians() {
    assert!(matches!(Engine::from_gaussians(&Gaussians::default(), 1), Err(SplatError::Empty { .. })));
    let mut g = gaussians_of(5);
    g.scales[2][1] = f32::NAN;
    let error = Engine::from_gaussians(&g, 1).err().unwrap().to_string();
    assert!(error.contains("gaussians.scales[7] is NaN"), "{error}");
    let mut g = gaussians_of(5);
    g.quats.pop();
    assert!(matches!(Engine::from_gaussians(&g, 1), Err(SplatError::Length { .. })));
}

#[test]
fn bad_targets() {
    let camera = camera(8, 6);
    let rgb = vec![0.5f32; 8 * 6 * 3];
    let images = TargetImages {
        rgb: Pixels::F32(&rgb),
        depth: None,
        mask: None,
        weight: None,
        background: [0.0; 3],
        shows_background: true,
    };
    assert!(Target::new(&camera, &images).is_ok());
    assert!(matches!(
        Target::new(&camera, &TargetImages { rgb: Pixels::F32(&rgb[1..]), ..images }),
        Err(SplatError::Length { .. })
    ));
    let mut broken = rgb.clone();
    broken[3] = f32::INFINITY;
    assert!(matches!(
        Target::new(&camera, &TargetImages { rgb: Pixels::F32(&broken), ..images }),
        Err(SplatError::NotFinite { what: "target.rgb", index: 3, .. })
    ));
    let depth = vec![-1.0f32; 8 * 6];
    assert!(matches!(
        Target::new(&camera, &TargetImages { depth: Some(&depth), ..images }),
        Err(SplatError::Range { what: "target.depth", .. })
    ));
    assert!(matches!(Target::new(&Camera { width: 0, ..camera }, &images), Err(SplatError::Range { .. })));
    assert!(matches!(Target::new(&Camera { fx: f64::NAN, ..camera }, &images), Err(SplatError::Range { .. })));
}

#[test]
fn bad_calls() {
    let mut engine = Engine::from_gaussians(&gaussians_of(5), 1).unwrap();
    let camera = camera(20, 20);
    let mut gradients = Gradients::default();
    assert!(matches!(engine.backward(&PixelGradients::default(), &mut gradients), Err(SplatError::NotRendered)));
    assert!(engine.render(&camera, &RenderOptions { extra: &[0.0; 4], channels: 1, ..Default::default() }).is_err());
    let extra = [f32::NAN; 5];
    assert!(engine.render(&camera, &RenderOptions { extra: &extra, channels: 1, ..Default::default() }).is_err());
    assert!(engine.set_groups(&[0; 4], &[Pose::IDENTITY]).is_err());
    assert!(engine.set_groups(&[1; 5], &[Pose::IDENTITY]).is_err());
    assert!(engine.set_groups(&[0; 5], &[Pose::from_trans(glam::DVec3::NAN)]).is_err());
    assert!(engine.set_poses(&[Pose::IDENTITY]).is_err());
    gradients.params = Planes::zeros(5, 14);
    gradients.params.plane_mut(2)[3] = f32::NAN;
    assert!(matches!(engine.adam_step(&gradients, &Rates::default()), Err(SplatError::NotFinite { .. })));
}

fn gaussians_of(n: usize) -> Gaussians {
    common::gaussians(n, 1, false)
}

#[test]
fn no_views() {
    let get = |_: usize| -> Arc<Target> { unreachable!("there are no views") };
    assert!(matches!(initialise(&Views { count: 0, get: &get, poses: None }, 10, 0), Err(SplatError::Empty { .. })));
}

#[test]
fn an_empty_mask_and_gaussians_behind_the_camera_are_fine() {
    let camera = camera(40, 30);
    let rgb = vec![0u8; 40 * 30 * 3];
    let mask = vec![0u8; 40 * 30];
    let images = TargetImages {
        rgb: Pixels::U8(&rgb),
        depth: None,
        mask: Some(Pixels::U8(&mask)),
        weight: None,
        background: [0.0; 3],
        shows_background: false,
    };
    let empty = Target::new(&camera, &images).unwrap();
    let mut g = gaussians_of(20);
    for m in &mut g.means {
        // Well behind the camera at (1.2, -0.9, 0.7), which looks at the origin.
        *m = [5.0, -4.0, 3.0];
    }
    let mut engine = Engine::from_gaussians(&g, 2).unwrap();
    let terms = engine.step(&empty, &LossConfig::default(), &Rates::default()).unwrap();
    assert_eq!(terms.total, 0.0);
    assert!(engine.gaussians() != Gaussians::default());
    // And a target with an object that nothing covers.
    let terms = engine.step(&target(&camera, 1), &LossConfig::default(), &Rates::default()).unwrap();
    assert!(terms.total > 0.0 && terms.total.is_finite());
}
