//! First gaussians: flat discs on the surface that the depth pictures show, or points in the visual
//! hull without depth.

use crate::error::SplatError;
use crate::target::Target;
use crate::views::Views;
use glam::{DVec2, DVec3, Quat, Vec3};
use hingecast_geom::Gaussians;
use hingecast_geom::gaussians::SH_C0;

/// More surface samples than this only cost time.
const MOST_SAMPLES: usize = 2_000_000;
/// Neighbouring pixels whose depth differs by more are on different surfaces.
const DEPTH_STEP: f64 = 0.03;

/// A pixel's piece of surface.
#[derive(Clone, Copy, Debug)]
pub struct SurfaceSample {
    /// Where it is: world (or canonical) frame, scene units.
    pub position: Vec3,
    /// Unit, towards the camera.
    pub normal: Vec3,
    /// 0..1
    pub colour: Vec3,
    /// Samples of different groups never share a gaussian.
    pub group: u16,
}

/// About `n` gaussians, evenly spread over the surface: standard deviations 0.55 of the spacing
/// along the surface and 0.1 across it, opacity 0.9, colour the mean of what the views saw.
///
/// # Errors
/// No views, or nothing to start from: neither depth nor masks that agree on a volume.
pub fn initialise(views: &Views, n: usize, seed: u64) -> Result<Gaussians, SplatError> {
    if views.count == 0 {
        return Err(SplatError::Empty { what: "the set of views", item: "view" });
    }
    if n == 0 {
        return Err(SplatError::Range { what: "number of gaussians", value: 0.0, range: "1.." });
    }
    let own = |v: usize| surface_samples(&(views.get)(v), views.count, seed.wrapping_add(v as u64));
    let samples: Vec<SurfaceSample> = (0..views.count).flat_map(own).collect();
    if samples.is_empty() { from_hull(views, n, seed) } else { Ok(from_surface(&samples, n).0) }
}

/// Every pixel of one of `count` views with depth, or every k-th when there are too many; group 0,
/// world frame.
pub fn surface_samples(target: &Target, count: usize, seed: u64) -> Vec<SurfaceSample> {
    let mut rng = fastrand::Rng::with_seed(seed);
    let mut out = Vec::new();
    let (depth, mask) = target.depth_and_mask();
    let pixels = depth.iter().zip(&mask).filter(|(z, m)| **z > 0.0 && **m > 0.5).count();
    let keep = (MOST_SAMPLES as f64 / count as f64 / pixels.max(1) as f64).min(1.0);
    let rgb = target.rgb();
    let (w, h) = (target.camera.width, target.camera.height);
    for y in 0..h {
        for x in 0..w {
            let i = y * w + x;
            let counts = depth[i] > 0.0 && mask[i] > 0.5 && target.weight_at(x, y) > 0.5;
            if !counts || (keep < 1.0 && rng.f64() > keep) {
                continue;
            }
            let Some(normal) = normal(target, &depth, x, y) else { continue };
            out.push(SurfaceSample {
                position: point(target, &depth, x, y).as_vec3(),
                normal,
                colour: Vec3::new(rgb[3 * i], rgb[3 * i + 1], rgb[3 * i + 2]),
                group: 0,
            });
        }
    }
    out
}

fn point(target: &Target, depth: &[f32], x: usize, y: usize) -> DVec3 {
    let z = f64::from(depth[y * target.camera.width + x]);
    target.camera.unproject(DVec2::new(x as f64 + 0.5, y as f64 + 0.5), z)
}

/// World normal towards the camera from the depth of the neighbours; None beside a depth edge,
/// where the pixel may be a mixture, unless it is seen on no other side.
fn normal(target: &Target, depth: &[f32], x: usize, y: usize) -> Option<Vec3> {
    let (w, h) = (target.camera.width, target.camera.height);
    let own = f64::from(depth[y * w + x]);
    let here = point(target, depth, x, y);
    let same = |u: usize, v: usize| {
        let z = f64::from(depth[v * w + u]);
        z > 0.0 && (z - own).abs() < DEPTH_STEP * own
    };
    // Difference along one axis: both neighbours if possible, else the one that is on this surface.
    let slope = |lo: Option<(usize, usize)>, hi: Option<(usize, usize)>| {
        let lo = lo.filter(|&(u, v)| same(u, v)).map(|(u, v)| point(target, depth, u, v));
        let hi = hi.filter(|&(u, v)| same(u, v)).map(|(u, v)| point(target, depth, u, v));
        match (lo, hi) {
            (Some(lo), Some(hi)) => Some(hi - lo),
            (Some(lo), None) => Some(here - lo),
            (None, Some(hi)) => Some(hi - here),
            (None, None) => None,
        }
    };
    let dx = slope((x > 0).then(|| (x - 1, y)), (x + 1 < w).then_some((x + 1, y)));
    let dy = slope((y > 0).then(|| (x, y - 1)), (y + 1 < h).then_some((x, y + 1)));
    let towards = (target.camera.centre() - here).normalize();
    let n = match (dx, dy) {
        (Some(dx), Some(dy)) => dx.cross(dy).try_normalize()?,
        // One pixel wide: a wire faces the camera.
        _ => towards,
    };
    Some((if n.dot(towards) < 0.0 { -n } else { n }).as_vec3())
}

/// One gaussian per group, occupied voxel and side; the voxel size is searched for about `n`.
/// Answers the gaussians and their groups.
pub fn from_surface(samples: &[SurfaceSample], n: usize) -> (Gaussians, Vec<u16>) {
    let (mut lo, mut hi) = (Vec3::INFINITY, Vec3::NEG_INFINITY);
    for s in samples {
        (lo, hi) = (lo.min(s.position), hi.max(s.position));
    }
    let diagonal = (hi - lo).length().max(1e-6);
    let mut voxel = diagonal / (n as f32).sqrt();
    let mut best = Vec::new();
    for _ in 0..6 {
        let merged = merge(samples, lo, voxel);
        let ratio = merged.len() as f32 / n as f32;
        best = merged;
        // Fewer samples than gaussians wanted: smaller voxels do not help.
        if (0.97..1.03).contains(&ratio) || best.len() == samples.len() {
            break;
        }
        voxel *= ratio.sqrt().clamp(0.2, 5.0);
    }
    let groups = best.iter().map(|s| s.group).collect();
    let mut g = Gaussians::default();
    for s in best {
        let q = Quat::from_rotation_arc(Vec3::Z, s.normal);
        g.means.push(s.position.into());
        g.quats.push([q.w, q.x, q.y, q.z]);
        g.scales.push([(0.55 * voxel).ln(), (0.55 * voxel).ln(), (0.1 * voxel).ln()]);
        g.opacities.push(logit(0.9));
        g.sh0.push(((s.colour - 0.5) / SH_C0).into());
    }
    (g, groups)
}

fn logit(p: f32) -> f32 {
    (p / (1.0 - p)).ln()
}

/// Means per voxel; samples that face away from the voxel's first one are a second surface (the
/// back of a thin sheet).
fn merge(samples: &[SurfaceSample], origin: Vec3, voxel: f32) -> Vec<SurfaceSample> {
    let mut keyed: Vec<((u16, u64), u32)> = samples
        .iter()
        .enumerate()
        .map(|(i, s)| {
            let c = ((s.position - origin) / voxel).as_u64vec3().min(glam::U64Vec3::splat((1 << 21) - 1));
            ((s.group, c.x | c.y << 21 | c.z << 42), i as u32)
        })
        .collect();
    keyed.sort_unstable();
    let mut out = Vec::new();
    for group in keyed.chunk_by(|a, b| a.0 == b.0) {
        let leader = &samples[group[0].1 as usize];
        let first = leader.normal;
        let mut sides = [(Vec3::ZERO, Vec3::ZERO, Vec3::ZERO, 0f32); 2];
        for &(_, i) in group {
            let s = &samples[i as usize];
            let side = &mut sides[usize::from(s.normal.dot(first) < -0.2)];
            side.0 += s.position;
            side.1 += s.normal;
            side.2 += s.colour;
            side.3 += 1.0;
        }
        for (position, normal, colour, count) in sides {
            // A single stray pixel among many is noise.
            if count > 0.0 && count >= 0.05 * group.len() as f32 {
                let normal = normal.try_normalize().unwrap_or(first);
                let (position, colour) = (position / count, colour / count);
                out.push(SurfaceSample { position, normal, colour, group: leader.group });
            }
        }
    }
    out
}

/// Without depth: random points inside every mask, round and of a third of their spacing.
fn from_hull(views: &Views, n: usize, seed: u64) -> Result<Gaussians, SplatError> {
    let mut rng = fastrand::Rng::with_seed(seed);
    let targets: Vec<_> = (0..views.count).map(|i| (views.get)(i)).collect();
    let masks: Vec<Vec<f32>> = targets.iter().map(|t| t.depth_and_mask().1).collect();
    // The point nearest to all viewing axes, and the largest ball around it that some view sees
    // whole.
    let (mut a, mut b) = (glam::DMat3::ZERO, DVec3::ZERO);
    for t in &targets {
        let axis = t.camera.ray(DVec2::new(0.5 * t.camera.width as f64, 0.5 * t.camera.height as f64)).normalize();
        let m = glam::DMat3::IDENTITY - glam::DMat3::from_cols(axis * axis.x, axis * axis.y, axis * axis.z);
        a += m;
        b += m * t.camera.centre();
    }
    let centre = if a.determinant().abs() > 1e-9 { a.inverse() * b } else { DVec3::ZERO };
    let radius = targets
        .iter()
        .map(|t| {
            let c = &t.camera;
            (c.centre() - centre).length() * (0.5 * c.width.max(c.height) as f64 / c.fx.min(c.fy))
        })
        .fold(0.0, f64::max);

    let mut g = Gaussians::default();
    let mut inside = 0u32;
    let mut tries = 0u32;
    while g.len() < n && tries < 2_000_000 {
        tries += 1;
        let mut coordinate = || (2.0 * rng.f64() - 1.0) * radius;
        let x = centre + DVec3::new(coordinate(), coordinate(), coordinate());
        let mut seen = 0;
        let mut colour = Vec3::ZERO;
        let in_all = targets.iter().zip(&masks).all(|(t, mask)| {
            let (uv, z) = t.camera.project(x);
            let (w, h) = (t.camera.width, t.camera.height);
            let in_picture = z > 0.0 && uv.x >= 0.0 && uv.y >= 0.0 && uv.x < w as f64 && uv.y < h as f64;
            if !in_picture {
                return true;
            }
            seen += 1;
            let (u, v) = (uv.x as usize, uv.y as usize);
            if let (Some(cx), Some(cy)) = (u.checked_sub(t.crop.x0), v.checked_sub(t.crop.y0))
                && cx < t.crop.width
                && cy < t.crop.height
            {
                colour += Vec3::from_array(std::array::from_fn(|c| t.rgb[c][t.layout.row(cy) + cx]));
            }
            mask[v * w + u] > 0.5
        });
        if in_all && 2 * seen >= views.count {
            inside += 1;
            g.means.push(x.as_vec3().into());
            g.quats.push([1.0, 0.0, 0.0, 0.0]);
            g.opacities.push(logit(0.1));
            g.sh0.push(((colour / seen as f32 - 0.5) / SH_C0).into());
        }
    }
    if g.is_empty() {
        return Err(SplatError::Empty {
            what: "the volume that all masks agree on (and there is no depth)",
            item: "point: check masks, poses, and that depth was read",
        });
    }
    let volume = (2.0 * radius).powi(3) * f64::from(inside) / f64::from(tries);
    let spacing = (volume / g.len() as f64).cbrt() as f32;
    g.scales = vec![[(0.33 * spacing).ln(); 3]; g.len()];
    Ok(g)
}
