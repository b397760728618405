//! Masks as a segmenter makes them: borders off by 1 to 3 pixels, smoothly along the edge; holes
//! where the object looks like something else; in some frames a piece of it is missing or a piece
//! of its surroundings is taken for it.

use crate::synth::smooth::Smooth;
use glam::DVec2;

/// Share of the frames with a hole, and its mean radius as a share of the object's.
const HOLES: f64 = 0.5;
const HOLE: f64 = 0.07;
/// Share of the frames that lack a piece, share of those with one too many; mean radius of it.
const MISSING: f64 = 0.06;
const EXTRA: f64 = 0.06;
const PIECE: f64 = 0.3;

/// Replaces an exact mask (255 = object, row-major) by a segmenter's.
pub(crate) fn segmenter(mask: &mut [u8], w: usize, h: usize, rng: &mut fastrand::Rng) {
    // All is drawn for every frame, so that one more thing does not change the rest.
    let [hole, missing, extra] = [HOLES, MISSING, EXTRA].map(|share| rng.f64() < share);
    wander(mask, w, h, rng);
    let inside: Vec<usize> = (0..mask.len()).filter(|&i| mask[i] > 0).collect();
    if inside.is_empty() {
        return;
    }
    let border: Vec<usize> = inside.iter().copied().filter(|&i| on_border(mask, w, h, i)).collect();
    let radius = (inside.len() as f64 / std::f64::consts::PI).sqrt();
    let of_size = |share: f64, rng: &mut fastrand::Rng| radius * share * (0.6 + 0.8 * rng.f64());
    let (a, b, c) = (of_size(HOLE, rng), of_size(PIECE, rng), of_size(PIECE, rng));
    let mut blob = |wanted: bool, among: &[usize], radius: f64, value: u8, rng: &mut fastrand::Rng| {
        let shape = Smooth::new(w, h, (0.5 * radius).max(2.0), rng);
        let place = rng.f64();
        if !wanted || among.is_empty() {
            return;
        }
        let at = |i: usize| DVec2::new((i % w) as f64, (i / w) as f64);
        let centre = at(among[(place * among.len() as f64) as usize]);
        for (i, pixel) in mask.iter_mut().enumerate() {
            if at(i).distance(centre) < radius * (1.0 + 0.25 * shape.at(i % w, i / w)) {
                *pixel = value;
            }
        }
    };
    blob(hole, &inside, a.max(1.5), 0, rng);
    blob(missing, &border, b, 0, rng);
    blob(extra, &border, c, 255, rng);
}

/// Reads the mask at places that wander by 1 to 3 pixels, slowly along the edge.
pub(crate) fn wander(mask: &mut [u8], w: usize, h: usize, rng: &mut fastrand::Rng) {
    let amplitude = 1.0 + 2.0 * rng.f64();
    let fields = [Smooth::new(w, h, 9.0, rng), Smooth::new(w, h, 9.0, rng)];
    let exact = mask.to_vec();
    for y in 0..h {
        for x in 0..w {
            let shift = |f: &Smooth| (0.7 * amplitude * f.at(x, y)).clamp(-3.0, 3.0);
            let sx = (x as f64 + shift(&fields[0])).round().clamp(0.0, (w - 1) as f64) as usize;
            let sy = (y as f64 + shift(&fields[1])).round().clamp(0.0, (h - 1) as f64) as usize;
            mask[y * w + x] = exact[sy * w + sx];
        }
    }
}

fn on_border(mask: &[u8], w: usize, h: usize, i: usize) -> bool {
    let (x, y) = (i % w, i / w);
    let off = |x: usize, y: usize| x >= w || y >= h || mask[y * w + x] == 0;
    off(x.wrapping_sub(1), y) || off(x + 1, y) || off(x, y.wrapping_sub(1)) || off(x, y + 1)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn mask_edges_wander_and_stay_within_three_pixels() {
        let mut mask: Vec<u8> = (0..64 * 64).map(|i| if i % 64 < 32 { 255 } else { 0 }).collect();
        wander(&mut mask, 64, 64, &mut fastrand::Rng::with_seed(3));
        let wrong: Vec<usize> = (0..64 * 64).filter(|i| (mask[*i] == 255) != (i % 64 < 32)).map(|i| i % 64).collect();
        assert!(wrong.len() > 10 && wrong.iter().all(|x| (29..35).contains(x)), "{wrong:?}");
    }

    /// A disc of radius 30 in 96 x 96 pixels, segmented 300 times: what is wrong farther than 4
    /// pixels from its edge is a hole, a missing or an extra piece.
    #[test]
    fn a_segmenter_leaves_holes_and_misses_or_adds_pieces_in_some_frames() {
        let from_edge = |i: usize| DVec2::new((i % 96) as f64 - 48.0, (i / 96) as f64 - 48.0).length() - 30.0;
        let (mut missing, mut extra, mut clean) = (0, 0, 0);
        for seed in 0..300 {
            let mut mask: Vec<u8> = (0..96 * 96).map(|i| if from_edge(i) < 0.0 { 255 } else { 0 }).collect();
            segmenter(&mut mask, 96, 96, &mut fastrand::Rng::with_seed(seed * 0x9e37_79b9));
            let lost = (0..96 * 96).filter(|&i| from_edge(i) < -5.0 && mask[i] == 0).count();
            let won = (0..96 * 96).filter(|&i| from_edge(i) > 5.0 && mask[i] > 0).count();
            missing += usize::from(lost > 45);
            extra += usize::from(won > 20);
            clean += usize::from(lost + won == 0);
        }
        assert!(
            (6..36).contains(&missing) && (6..36).contains(&extra),
            "{missing} lack a piece, {extra} have one more"
        );
        assert!((90..210).contains(&clean), "{clean} of 300 are but ragged");
    }
}
