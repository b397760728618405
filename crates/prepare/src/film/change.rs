//! How much of what two pictures show has changed between them, with the camera's own motion taken
//! out.
//!
//! Points of one picture are carried into the other, and their depth there is compared with what was
//! measured, block by block: medians of many pixels are far sharper than a pixel. What lies behind
//! something in the other picture is hidden, not changed.

use glam::{DVec2, DVec3};
use hingecast_articulate::{DepthView, OBJECT};

/// Points across a picture, and points along a side of a block.
const ACROSS: usize = 160;
const BLOCK: usize = 8;
/// A block has at least so many points that can be judged.
const FEW: usize = 12;
/// A block has changed when its median is off by more than so many deviations of all blocks, and by
/// this share of the distance.
const SURE: f64 = 5.0;
const LEAST: f64 = 0.0015;
/// Off by more than this share of the distance is another surface; so is a step between neighbours.
const OTHER: f64 = 0.03;
const STEP: f32 = 0.03;
/// A block counts as changed by at most this share of the distance.
const MOST: f64 = 0.05;

/// What changed between two pictures.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Change {
    /// Blocks that changed and have a neighbour that did.
    pub blocks: usize,
    /// The same over all blocks, each weighed by how far it is off. 0..1
    pub amount: f64,
}

/// Between pictures `a` and `b`, whichever way more is seen of it.
pub(super) fn change(a: &DepthView, b: &DepthView) -> Change {
    let (there, back) = (one_way(a, b), one_way(b, a));
    Change { blocks: there.blocks.max(back.blocks), amount: there.amount.max(back.amount) }
}

fn one_way(a: &DepthView, b: &DepthView) -> Change {
    let (w, h) = (a.camera.width, a.camera.height);
    let step = (w / ACROSS).max(1);
    let (columns, rows) = ((w / step).div_ceil(BLOCK), (h / step).div_ceil(BLOCK));
    let mut blocks: Vec<Vec<f64>> = vec![Vec::new(); columns * rows];
    let world_from_a = a.camera.camera_from_world.inverse();
    let b_from_a = b.camera.camera_from_world * world_from_a;
    let (rot, trans) = (b_from_a.mat3(), b_from_a.trans);
    for (row, y) in (step..h.saturating_sub(step)).step_by(step).enumerate() {
        for (column, x) in (step..w.saturating_sub(step)).step_by(step).enumerate() {
            let Some(z) = even(a, x, y, step) else { continue };
            let c = &a.camera;
            let ray = DVec3::new((x as f64 + 0.5 - c.cx) / c.fx, (y as f64 + 0.5 - c.cy) / c.fy, 1.0);
            let p = rot * (ray * f64::from(z)) + trans;
            if let Some(off) = compare(b, p, step) {
                blocks[row / BLOCK * columns + column / BLOCK].push(off);
            }
        }
    }
    weigh(&mut blocks, columns)
}

/// How far what `b` measured lies behind `p` (in its own frame), share of the distance; `None` where
/// it cannot tell.
fn compare(b: &DepthView, p: DVec3, step: usize) -> Option<f64> {
    if p.z <= 0.0 {
        return None;
    }
    let c = &b.camera;
    let uv = DVec2::new(c.fx * p.x / p.z + c.cx, c.fy * p.y / p.z + c.cy);
    if !(uv.x >= 0.0 && uv.y >= 0.0 && uv.x < c.width as f64 && uv.y < c.height as f64) {
        return None;
    }
    let (x, y) = (uv.x as usize, uv.y as usize);
    // At an edge only what lies before all of it tells something.
    let (z, one_surface) = match between(b, uv, step) {
        Some(z) => (z, true),
        None => (f64::from(around(b, x, y, step)?.0), false),
    };
    let off = z / p.z - 1.0;
    // Well before it: hidden.
    (off > OTHER || one_surface && off.abs() < OTHER).then_some(off)
}

/// Depth of a pixel, where it and those around it are one surface.
fn even(view: &DepthView, x: usize, y: usize, step: usize) -> Option<f32> {
    let (lo, hi) = around(view, x, y, step)?;
    let z = view.depth[y * view.camera.width + x];
    (hi - lo < STEP * z).then_some(z)
}

/// Depth at a place between pixels, on the plane through those around: its inverse is affine.
fn between(view: &DepthView, uv: DVec2, step: usize) -> Option<f64> {
    let (x, y, w) = (uv.x as usize, uv.y as usize, view.camera.width);
    even(view, x, y, step)?;
    let inverse = |x: usize, y: usize| 1.0 / f64::from(view.depth[y * w + x]);
    let slope = |ahead: f64, behind: f64| 0.5 * (ahead - behind) / step as f64;
    let along = slope(inverse(x + step, y), inverse(x - step, y)) * (uv.x - x as f64 - 0.5);
    let down = slope(inverse(x, y + step), inverse(x, y - step)) * (uv.y - y as f64 - 0.5);
    Some(1.0 / (inverse(x, y) + along + down))
}

/// Nearest and farthest depth around a pixel; `None` where one is not known.
fn around(view: &DepthView, x: usize, y: usize, step: usize) -> Option<(f32, f32)> {
    let (w, h) = (view.camera.width, view.camera.height);
    if x < step || y < step || x + step >= w || y + step >= h {
        return None;
    }
    let (mut lo, mut hi) = (f32::INFINITY, 0.0f32);
    for (u, v) in [(x, y), (x - step, y), (x + step, y), (x, y - step), (x, y + step)] {
        let i = v * w + u;
        if view.class[i] != OBJECT {
            return None;
        }
        (lo, hi) = (lo.min(view.depth[i]), hi.max(view.depth[i]));
    }
    Some((lo, hi))
}

/// From what the points of every block are off to what has changed.
fn weigh(blocks: &mut [Vec<f64>], columns: usize) -> Change {
    let median = |all: &mut Vec<f64>| {
        let middle = all.len() / 2;
        *all.select_nth_unstable_by(middle, f64::total_cmp).1
    };
    let medians: Vec<Option<f64>> =
        blocks.iter_mut().map(|b| if b.len() < FEW { None } else { Some(median(b)) }).collect();
    let mut known: Vec<f64> = medians.iter().flatten().copied().collect();
    if known.is_empty() {
        return Change::default();
    }
    let middle = median(&mut known);
    let mut off: Vec<f64> = known.iter().map(|m| (m - middle).abs()).collect();
    let limit = (SURE * 1.4826 * median(&mut off)).max(LEAST);
    let changed: Vec<bool> = medians.iter().map(|m| m.is_some_and(|m| (m - middle).abs() > limit)).collect();
    let beside = |i: usize| {
        let (x, y) = (i % columns, i / columns);
        let near = |k: usize, end: usize| k.saturating_sub(1)..(k + 2).min(end);
        let rows = changed.len() / columns;
        near(y, rows).any(|v| near(x, columns).any(|u| v * columns + u != i && changed[v * columns + u]))
    };
    let own: Vec<usize> = (0..changed.len()).filter(|&i| changed[i] && beside(i)).collect();
    let far = |i: &usize| medians[*i].map_or(0.0, |m| (m - middle).abs().min(MOST) / MOST);
    Change { blocks: own.len(), amount: own.iter().map(far).sum::<f64>() / known.len() as f64 }
}

#[cfg(test)]
mod tests {
    use super::*;
    use hingecast_geom::Camera;

    /// A wall at z = 0 and a board of 0.4 x 0.4 before it, `out` away from it, as a camera that has
    /// moved by `x` along the wall sees them; depth off by a millimetre, pixel by pixel.
    fn view(x: f64, out: f64, seed: u64) -> DepthView {
        let eye = DVec3::new(x, -2.0, 0.0);
        let camera = Camera::look_at(eye, DVec3::ZERO, DVec3::Z, 160, 120, 0.9);
        let mut rng = fastrand::Rng::with_seed(seed);
        let depth = |i: usize| {
            let ray = camera.ray(DVec2::new((i % 160) as f64 + 0.5, (i / 160) as f64 + 0.5));
            let at = |wall: f64| eye + ray * ((wall - eye.y) / ray.y);
            let board = at(-out);
            let hit = if board.x.abs() < 0.2 && board.z.abs() < 0.2 { board } else { at(0.0) };
            camera.project(hit).1 as f32 + 0.001 * (2.0 * rng.f32() - 1.0)
        };
        DepthView::new(camera, (0..160 * 120).map(depth).collect())
    }

    #[test]
    fn what_moves_is_seen_and_a_camera_that_moves_is_not() {
        assert_eq!(change(&view(0.0, 0.2, 1), &view(0.15, 0.2, 2)).blocks, 0);
        let little = change(&view(0.0, 0.2, 1), &view(0.05, 0.21, 2));
        let more = change(&view(0.0, 0.2, 1), &view(0.05, 0.24, 2));
        assert!(little.blocks >= 4, "{little:?}");
        assert!(more.amount > 2.0 * little.amount, "{more:?} {little:?}");
    }
}
