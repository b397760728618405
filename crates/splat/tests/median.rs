//! What a pixel shows: one surface, not the mean of two.

use glam::DVec3;
use hingecast_geom::{Camera, Gaussians};
use hingecast_splat::{Engine, RenderOptions};

/// A half-opaque disc before an opaque one.
fn two_discs(front_opacity_logit: f32) -> Gaussians {
    Gaussians {
        means: vec![[0.0, 0.0, 0.0], [0.0, 0.0, -1.0]],
        quats: vec![[1.0, 0.0, 0.0, 0.0]; 2],
        scales: vec![[-1.0, -1.0, -5.0]; 2],
        opacities: vec![front_opacity_logit, 8.0],
        sh0: vec![[0.0; 3]; 2],
        sh1: Vec::new(),
    }
}

#[test]
fn the_depth_is_that_of_the_surface_where_half_of_the_light_is_gone() {
    let camera = Camera::look_at(DVec3::new(0.0, 0.0, 3.0), DVec3::ZERO, DVec3::Y, 33, 33, 0.5);
    for (logit, gaussian, depth) in [(1.0, 0, 3.0), (-1.0, 1, 4.0)] {
        let mut engine = Engine::from_gaussians(&two_discs(logit), 1).unwrap();
        engine.render(&camera, &RenderOptions::default()).unwrap();
        let hit = engine.median().unwrap()[16 * 33 + 16].expect("the middle is covered");
        assert_eq!(hit.gaussian, gaussian);
        assert!((hit.depth - depth).abs() < 1e-4, "{hit:?}");
    }
    let mut engine = Engine::from_gaussians(&two_discs(1.0), 1).unwrap();
    assert!(engine.median().is_err(), "nothing was rendered yet");
}
