//! The colour of texels: the pixels that show one, near and facing ones far before the others.

use super::Texture;
use super::atlas::{Atlas, PADDING};
use crate::color::shows;
use crate::vertices::Glimpse;

/// How much more a finer view counts: twice as many pixels a unit, sixteen times as much. Views from
/// afar and aslant blur what a near one shows.
const SHARPNESS: i32 = 4;

/// Adds what the pixels around a texel say to its `sum` (rgb and weight).
pub fn accumulate(sum: &mut [f32; 4], g: &Glimpse, tolerance: f32) {
    let Some(fineness) = shows(g, tolerance) else { return };
    // Shares stay in the range of f32 whatever the unit of length: a pixel at the tolerance is 1.
    let w = (fineness * tolerance).powi(SHARPNESS);
    let rgb = between(g);
    (0..3).for_each(|k| sum[k] += w * rgb[k]);
    sum[3] += w;
}

/// The colour where the texel falls, between the four pixels around it, as far as these are of its
/// part.
fn between(g: &Glimpse) -> [f32; 3] {
    let c = &g.seen.camera;
    let u = c.fx as f32 * g.x.x / g.x.z + c.cx as f32 - 0.5;
    let v = c.fy as f32 * g.x.y / g.x.z + c.cy as f32 - 0.5;
    let (mut rgb, mut weight) = ([0.0; 3], 0.0);
    for (dx, dy) in [(0, 0), (1, 0), (0, 1), (1, 1)] {
        let (x, y) = (u.floor() as isize + dx, v.floor() as isize + dy);
        if x < 0 || y < 0 || x >= c.width as isize || y >= c.height as isize {
            continue;
        }
        let p = y as usize * c.width + x as usize;
        let w = (1.0 - (u - x as f32).abs()) * (1.0 - (v - y as f32).abs());
        if g.seen.labels[p] == g.part && w > 0.0 {
            (0..3).for_each(|k| rgb[k] += w * g.seen.rgb[3 * p + k] as f32);
            weight += w;
        }
    }
    if weight > 0.0 { rgb.map(|x| x / weight) } else { [0, 1, 2].map(|k| g.seen.rgb[3 * g.pixel + k] as f32) }
}

/// The picture. What no view shows has the colour of its vertices; the gaps between charts take the
/// colours beside them, so that no filter reaches what is no surface.
pub fn finish(atlas: Atlas, sums: &[[f32; 4]]) -> Texture {
    let [width, height] = atlas.size;
    let mut rgb = vec![0u8; 3 * width * height];
    let mut known = vec![false; width * height];
    for ((&place, sum), plain) in atlas.places.iter().zip(sums).zip(&atlas.plain) {
        let place = place as usize;
        let color = if sum[3] > 0.0 { [0, 1, 2].map(|k| sum[k] / sum[3]) } else { *plain };
        rgb[3 * place..3 * place + 3].copy_from_slice(&color.map(|x| x.round() as u8));
        known[place] = true;
    }
    for _ in 0..2 * PADDING {
        grow(&mut rgb, &mut known, width);
    }
    let corners = atlas.corners.iter().map(|c| [c.x / width as f32, 1.0 - c.y / height as f32]).collect();
    Texture { corners, vertices: atlas.vertices, faces: atlas.faces, width, height, rgb }
}

/// Every texel beside a known one gets the mean of its known neighbours.
fn grow(rgb: &mut [u8], known: &mut [bool], width: usize) {
    let height = known.len() / width;
    let mut new = Vec::new();
    for place in (0..known.len()).filter(|&p| !known[p]) {
        let (x, y) = (place % width, place / width);
        let (mut sum, mut n) = ([0u32; 3], 0);
        for ny in y.saturating_sub(1)..(y + 2).min(height) {
            for nx in x.saturating_sub(1)..(x + 2).min(width) {
                let q = ny * width + nx;
                if known[q] {
                    (0..3).for_each(|k| sum[k] += rgb[3 * q + k] as u32);
                    n += 1;
                }
            }
        }
        if n > 0 {
            new.push((place, sum.map(|s| (s / n) as u8)));
        }
    }
    for (place, color) in new {
        rgb[3 * place..3 * place + 3].copy_from_slice(&color);
        known[place] = true;
    }
}
