//! Vertex colours: the mean of the pixels that really show the vertex, facing views first.

use crate::vertices::Glimpse;
use hingecast_geom::TriMesh;

/// What the pixels that show a vertex say of it.
#[derive(Clone, Copy, Default)]
pub struct Sum {
    rgb: [f32; 3],
    weight: f32,
    /// Pixels a scene unit of the surface, in the view that shows it best.
    pub finest: f32,
}

/// Pixels that a scene unit of the surface has in this view, if the view shows the point: the pixel
/// carries its part's label, and its depth is the point's within `tolerance`.
pub fn shows(g: &Glimpse, tolerance: f32) -> Option<f32> {
    let (seen, p) = (g.seen, g.pixel);
    let facing = -g.normal.dot(g.x.normalize_or_zero());
    let is = facing > 0.2 && seen.labels[p] == g.part && (seen.depth[p] - g.x.z).abs() <= tolerance;
    is.then(|| facing * seen.camera.fx as f32 / g.x.z)
}

/// Adds what a pixel says to a vertex's `sum`.
pub fn accumulate(sum: &mut Sum, g: &Glimpse, tolerance: f32) {
    let Some(fineness) = shows(g, tolerance) else { return };
    let facing = g.normal.dot(g.x.normalize_or_zero());
    let w = facing * facing;
    for k in 0..3 {
        sum.rgb[k] += w * g.seen.rgb[3 * g.pixel + k] as f32;
    }
    sum.weight += w;
    sum.finest = sum.finest.max(fineness);
}

/// Turns the sums into colours; a vertex that nobody saw takes the mean of its coloured neighbours,
/// else grey.
pub fn finish(mesh: &mut TriMesh, sums: &[Sum]) {
    let mut colors: Vec<Option<[f32; 3]>> =
        sums.iter().map(|s| (s.weight > 0.0).then(|| s.rgb.map(|x| x / s.weight))).collect();
    for _ in 0..8 {
        let mut spread = vec![([0.0f32; 3], 0.0f32); colors.len()];
        for f in &mesh.faces {
            for k in 0..3 {
                let (to, from) = (f[k] as usize, f[(k + 1) % 3] as usize);
                for (to, from) in [(to, from), (from, to)] {
                    if let (None, Some(c)) = (colors[to], colors[from]) {
                        (0..3).for_each(|k| spread[to].0[k] += c[k]);
                        spread[to].1 += 1.0;
                    }
                }
            }
        }
        let mut changed = false;
        for (color, (sum, n)) in colors.iter_mut().zip(spread) {
            if color.is_none() && n > 0.0 {
                *color = Some(sum.map(|s| s / n));
                changed = true;
            }
        }
        if !changed {
            break;
        }
    }
    mesh.colors = colors.iter().map(|c| c.unwrap_or([128.0; 3]).map(|x| x.round() as u8)).collect();
}

/// Linear value of an sRGB one (IEC 61966-2-1): vertex colours of glTF and USD are linear.
pub fn linear(srgb: u8) -> f32 {
    let s = f32::from(srgb) / 255.0;
    if s <= 0.04045 { s / 12.92 } else { ((s + 0.055) / 1.055).powf(2.4) }
}
