//! Moves gaussians that do nothing, or have grown out of proportion, to where the picture is wrong.
//! Their number stays fixed.

use crate::engine::{Engine, RenderOptions};
use crate::error::SplatError;
use crate::params::plane;
use crate::target::Target;
use crate::views::Views;
use glam::DVec2;
use hingecast_geom::gaussians::SH_C0;
use std::collections::BTreeMap;

/// Opacity below which a gaussian is dead.
const DEAD_OPACITY: f32 = 0.02;
/// Standard deviation, as a share of the object's radius, above which a gaussian is out of
/// proportion.
const LARGEST: f32 = 0.5;
/// Errors smaller than this are noise of the pictures, not missing gaussians.
const NOISE: f32 = 0.03;

/// Views that are asked where the picture is wrong.
const VIEWS: usize = 8;

/// A place on the surface that the render gets wrong.
struct Place {
    position: [f32; 3],
    colour: [f32; 3],
    /// Standard deviation of one pixel there, scene units.
    size: f32,
}

/// Gives every dead gaussian a new life at a pixel of some views, chosen with a probability that
/// grows with its error. Returns how many moved. With groups, a gaussian stays in its group: it goes
/// where a gaussian of that group is seen, to the place that this is in the group's frame.
///
/// # Errors
/// As [`Engine::render`].
pub(crate) fn relocate(
    engine: &mut Engine,
    views: &Views,
    extent: f32,
    most: usize,
    rng: &mut fastrand::Rng,
) -> Result<usize, SplatError> {
    let (_, second, steps) = engine.moments();
    // Only a whole pass through the views tells; a drawer's inside is in few of them.
    let passed = steps as usize >= views.count;
    let never_seen = |i: usize| passed && (0..second.count()).all(|k| second.plane(k)[i] == 0.0);
    let huge = |i: usize| (0..3).any(|k| engine.params().plane(plane::SCALES + k)[i].exp() > LARGEST * extent);
    let mut dead: Vec<usize> = engine
        .opacities()
        .iter()
        .enumerate()
        .filter(|(i, o)| **o < DEAD_OPACITY || o.is_nan() || never_seen(*i) || huge(*i))
        .map(|(i, _)| i)
        .collect();
    dead.truncate(most);
    if dead.is_empty() {
        return Ok(0);
    }
    let some: Vec<usize> = (0..views.count.min(VIEWS)).map(|_| rng.usize(..views.count)).collect();
    let per_view = dead.len().div_ceil(some.len());
    let mut places: BTreeMap<u16, Vec<Place>> = BTreeMap::new();
    for view in some {
        if let Some(poses) = views.poses {
            engine.set_poses(&poses(view))?;
        }
        add_places(engine, &(views.get)(view), per_view, rng, &mut places)?;
    }
    let groups = engine.groups().to_vec();
    let (params, first, second, _) = engine.state_mut();
    let mut moved = 0;
    for i in dead {
        let group = groups.get(i).copied().unwrap_or(0);
        let Some(place) = places.get_mut(&group).and_then(Vec::pop) else { continue };
        moved += 1;
        for k in 0..params.count() {
            first.plane_mut(k)[i] = 0.0;
            second.plane_mut(k)[i] = 0.0;
        }
        params.set(plane::MEANS, i, place.position);
        params.set(plane::SCALES, i, [place.size.ln(); 3]);
        params.set(plane::QUATS, i, [1.0, 0.0, 0.0, 0.0]);
        params.set(plane::OPACITY, i, [0.0]);
        params.set(plane::SH0, i, place.colour.map(|c| (c - 0.5) / SH_C0));
        for k in plane::SH1..params.count() {
            params.plane_mut(k)[i] = 0.0;
        }
    }
    Ok(moved)
}

/// Draws up to `count` pixels of one view, by error.
fn add_places(
    engine: &mut Engine,
    target: &Target,
    count: usize,
    rng: &mut fastrand::Rng,
    places: &mut BTreeMap<u16, Vec<Place>>,
) -> Result<(), SplatError> {
    let camera = target.camera();
    let render = engine.render(camera, &RenderOptions { background: target.background(), ..Default::default() })?;
    let rgb = target.rgb();
    let (depth, _) = target.depth_and_mask();
    let seen = render.depth_normalised();
    let group_at = groups_seen(engine)?;
    // Cumulative error over pixels whose depth is known, by camera or by render.
    let mut cumulative = Vec::with_capacity(depth.len());
    let mut total = 0.0f64;
    for i in 0..depth.len() {
        let known = (depth[i] > 0.0 || seen[i] > 0.0) && group_at(i).is_some();
        let error: f32 = (0..3).map(|c| (render.rgb[3 * i + c] - rgb[3 * i + c]).abs()).sum();
        let weight = target.weight_at(i % camera.width, i / camera.width);
        if known {
            total += f64::from((error - NOISE).max(0.0) * weight);
        }
        cumulative.push(total);
    }
    // Nothing to gain here, or nothing known.
    let count = if total > 0.0 { count } else { 0 };
    for _ in 0..count {
        let wanted = rng.f64() * total;
        let i = cumulative.partition_point(|c| *c <= wanted).min(depth.len() - 1);
        let z = if depth[i] > 0.0 { depth[i] } else { seen[i] };
        let (x, y) = (i % camera.width, i / camera.width);
        let uv = DVec2::new(x as f64 + rng.f64(), y as f64 + rng.f64());
        let Some(group) = group_at(i) else { continue };
        let world = camera.unproject(uv, f64::from(z));
        let canonical = engine.poses().get(group as usize).map_or(world, |pose| pose.inverse().apply(world));
        places.entry(group).or_default().push(Place {
            position: canonical.as_vec3().into(),
            colour: [rgb[3 * i], rgb[3 * i + 1], rgb[3 * i + 2]],
            size: (0.5 * f64::from(z) / camera.fx) as f32,
        });
    }
    Ok(())
}

/// Which group each pixel of the last render shows; group 0 everywhere if there are none.
fn groups_seen(engine: &mut Engine) -> Result<impl Fn(usize) -> Option<u16> + use<>, SplatError> {
    let groups = engine.groups().to_vec();
    let hits = if groups.is_empty() { Vec::new() } else { engine.median()? };
    Ok(move |i: usize| if groups.is_empty() { Some(0) } else { hits[i].map(|hit| groups[hit.gaussian as usize]) })
}
