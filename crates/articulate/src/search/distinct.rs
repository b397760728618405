//! Hypotheses of which none is nearly like another.

use crate::observe::sample::Motion;
use glam::Vec3;
use hingecast_geom::Screw;

/// A screw and how far it takes the source samples to the target state.
#[derive(Clone, Copy, Debug)]
pub struct Hypothesis {
    /// In the parent's canonical frame.
    pub screw: Screw,
    /// Value at the target state minus value at the source state.
    pub q: f64,
    /// Source samples that land on vacated surface.
    pub score: usize,
}

/// The best hypotheses of a stream, none nearly like another.
pub struct Distinct<'a> {
    marks: &'a [Vec3],
    apart: f32,
    keep: usize,
    held: Vec<(Hypothesis, Vec<Vec3>)>,
}

impl<'a> Distinct<'a> {
    /// `marks`: points by which motions are told apart; `apart`: scene units.
    pub fn new(marks: &'a [Vec3], apart: f32, keep: usize) -> Self {
        Self { marks, apart, keep, held: Vec::new() }
    }

    /// Takes a hypothesis, unless better ones that differ fill all places.
    pub fn offer(&mut self, h: Hypothesis) {
        let full = self.held.len() == self.keep;
        if full && self.held.iter().all(|o| o.0.score >= h.score) {
            return;
        }
        let m = Motion::from(h.screw.motion(h.q));
        let ends: Vec<Vec3> = self.marks.iter().map(|x| m.apply(*x)).collect();
        let same = |o: &(Hypothesis, Vec<Vec3>)| {
            o.0.screw.kind == h.screw.kind && o.1.iter().zip(&ends).all(|(a, b)| a.distance(*b) < self.apart)
        };
        if let Some(like) = self.held.iter_mut().find(|o| same(o)) {
            if h.score > like.0.score {
                *like = (h, ends);
            }
        } else if !full {
            self.held.push((h, ends));
        } else if let Some(worst) = self.held.iter_mut().min_by_key(|o| o.0.score) {
            *worst = (h, ends);
        }
    }

    /// Best first.
    pub fn sorted(mut self) -> Vec<Hypothesis> {
        self.held.sort_by_key(|h| std::cmp::Reverse(h.0.score));
        self.held.into_iter().map(|h| h.0).collect()
    }
}

/// Leaves out hypotheses that move `points` nearly like a better one.
pub fn distinct(sorted: Vec<Hypothesis>, points: &[Vec3], apart: f32, keep: usize) -> Vec<Hypothesis> {
    let mut out: Vec<(Hypothesis, Motion)> = Vec::new();
    for h in sorted {
        let m = Motion::from(h.screw.motion(h.q));
        let same = |o: &Motion| points.iter().all(|x| o.apply(*x).distance(m.apply(*x)) < apart);
        if !out.iter().any(|(o, om)| o.screw.kind == h.screw.kind && same(om)) {
            out.push((h, m));
            if out.len() == keep {
                break;
            }
        }
    }
    out.into_iter().map(|(h, _)| h).collect()
}
