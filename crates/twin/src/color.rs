//! Vertex colours: the mean of the pixels that really show the vertex, facing views first.

use crate::vertices::Glimpse;
use hingecast_geom::TriMesh;

/// Adds what a pixel says to a vertex's `sum` (rgb and weight).
/// It counts when it carries the part's label and its depth is the vertex's within `tolerance`.
pub fn accumulate(sum: &mut [f32; 4], g: &Glimpse, tolerance: f32) {
    let (seen, p) = (g.seen, g.pixel);
    let facing = -g.normal.dot(g.x.normalize_or_zero());
    if !(facing > 0.2) || seen.labels[p] != g.part || (seen.depth[p] - g.x.z).abs() > tolerance {
        return;
    }
    let w = facing * facing;
    for k in 0..3 {
        sum[k] += w * seen.rgb[3 * p + k] as f32;
    }
    sum[3] += w;
}

/// Turns the sums into colours; a vertex that nobody saw takes the mean of its coloured neighbours,
/// else grey.
pub fn finish(mesh: &mut TriMesh, sums: &[[f32; 4]]) {
    let mut colors: Vec<Option<[f32; 3]>> =
        sums.iter().map(|s| (s[3] > 0.0).then(|| [s[0] / s[3], s[1] / s[3], s[2] / s[3]])).collect();
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
