//! Views made equally bright. Cameras choose exposure and white balance anew for every picture, and
//! a surface painted from such pictures has patches.

use crate::Observation;
use crate::color::shows;
use crate::vertices::{Points, Shown};
use hingecast_geom::{Pose, Projection};
use rayon::prelude::*;

/// Vertices of a part that are asked.
const ASKED: usize = 2000;
/// Vertices that must be seen before a view is changed.
const FEWEST: usize = 50;
/// Darker or brighter than this says nothing of the exposure. sRGB
const RANGE: [u8; 2] = [10, 245];
/// No view is made brighter or darker than by this factor.
const MOST: f32 = 2.0;
/// Rounds of vertices that take the mean of their views, and views that follow their vertices.
const ROUNDS: usize = 40;

/// What a view shows of the vertices that are asked: which, and the logarithm of its value. [channel]
type Shades = [Vec<(u32, f32)>; 3];

/// Factors of red, green and blue that bring the views to colours on which they agree: of every vertex
/// that several of them show (gain compensation of panoramas, Brown and Lowe 2007, with medians). In the
/// mean over all views nothing becomes brighter. [view, in the order of `shown`]
///
/// # Errors
/// What `shown` answers.
pub fn gains<E>(
    points: &[Points],
    poses: &[Vec<Pose>],
    views: usize,
    tolerance: f32,
    shown: &Shown<E>,
) -> Result<Vec<[f32; 3]>, E> {
    let of_view = |seen: &Observation| {
        let (mut shades, mut next): (Shades, u32) = (Default::default(), 0);
        for (part, points) in points.iter().enumerate() {
            let camera = Projection::new(&seen.camera, &poses[seen.state][part]);
            for i in (0..points.at.len()).step_by(points.at.len() / ASKED + 1) {
                let id = next;
                next += 1;
                let Some(g) = points.before(i, part, seen, &camera).filter(|g| shows(g, tolerance).is_some()) else {
                    continue;
                };
                for (k, shades) in shades.iter_mut().enumerate() {
                    let value = seen.rgb[3 * g.pixel + k];
                    if value > RANGE[0] && value < RANGE[1] {
                        shades.push((id, f32::from(value).ln()));
                    }
                }
            }
        }
        shades
    };
    let mut shades: Vec<Shades> = Vec::new();
    shown(views, &mut |batch| shades.extend(batch.par_iter().map(of_view).collect::<Vec<_>>()))?;
    let asked = points.iter().map(|p| p.at.len().min(ASKED + 1)).sum();
    let solved = [0, 1, 2].map(|k| solve(&shades.iter().map(|s| s[k].as_slice()).collect::<Vec<_>>(), asked));
    Ok((0..shades.len()).map(|view| [0, 1, 2].map(|k| solved[k][view])).collect())
}

/// One channel: factors of views that show some of `asked` vertices.
fn solve(views: &[&[(u32, f32)]], asked: usize) -> Vec<f32> {
    let mut seen = vec![0u32; asked];
    views.iter().copied().flatten().for_each(|(v, _)| seen[*v as usize] += 1);
    // What one view alone shows would hold it where it is.
    let shared = |shades: &[(u32, f32)]| -> Vec<(u32, f32)> {
        shades.iter().filter(|(v, _)| seen[*v as usize] > 1).copied().collect()
    };
    let views: Vec<Vec<(u32, f32)>> = views.iter().map(|shades| shared(shades)).collect();
    let mut gains = vec![0.0f32; views.len()];
    for _ in 0..ROUNDS {
        let mut levels = vec![0.0f32; asked];
        for (shades, gain) in views.iter().zip(&gains) {
            shades.iter().for_each(|(v, is)| levels[*v as usize] += (is + gain) / seen[*v as usize] as f32);
        }
        let follow = |shades: &Vec<(u32, f32)>| {
            let mut off: Vec<f32> = shades.iter().map(|(v, is)| levels[*v as usize] - is).collect();
            let middle = off.len() / 2;
            if off.len() < FEWEST { 0.0 } else { *off.select_nth_unstable_by(middle, f32::total_cmp).1 }
        };
        gains = views.par_iter().map(follow).collect();
        let changed = views.iter().filter(|shades| shades.len() >= FEWEST).count().max(1) as f32;
        let mean = gains.iter().sum::<f32>() / changed;
        let centred = |(gain, shades): (&f32, &Vec<_>)| if shades.len() < FEWEST { 0.0 } else { gain - mean };
        gains = gains.iter().zip(&views).map(centred).collect();
    }
    gains.into_iter().map(|gain| gain.exp().clamp(1.0 / MOST, MOST)).collect()
}

/// Views with their colours multiplied by `gains`, one of these a view.
pub fn evened(views: &[Observation], gains: &[[f32; 3]]) -> Vec<Observation> {
    let mut views = views.to_vec();
    views.par_iter_mut().zip(gains).for_each(|(seen, gain)| {
        for (i, value) in seen.rgb.iter_mut().enumerate() {
            *value = (*value as f32 * gain[i % 3]).round().min(255.0) as u8;
        }
    });
    views
}
