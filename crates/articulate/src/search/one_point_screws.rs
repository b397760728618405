//! Screws from single correspondences.
//!
//! One oriented point (x, n) of a moving part, found again as (y, m), gives the whole screw. A
//! slide keeps the normal, and y - x is its direction. About a hinge both y - x and m - n are
//! square to the axis, so the axis is their cross product; the angle is that between the normals
//! seen along it, and the centre lies where a turn by that angle takes x to y. Where the normal is
//! parallel to the axis (scissors lying flat) the angle is left open and all are tried. So instead
//! of matching point clouds, every pair (x, y) of few anchors and many targets is tried, and tested
//! by carrying the other samples along: most fail within a few look-ups.

use super::distinct::{Distinct, Hypothesis, distinct};
use super::state_pair::StatePair;
use crate::observe::sample::{Motion, Sample};
use glam::Vec3;
use hingecast_geom::{JointKind, Screw};
use rayon::prelude::*;

/// Source samples whose correspondences are tried, and target samples that they are tried with.
const ANCHORS: usize = 40;
const TARGETS: usize = 3000;
/// Samples nearest to the anchor that are tried first, and how many of them must fit.
const FIRST: usize = 10;
const FIRST_FIT: usize = 7;
/// Samples that count for the score.
const SCORED: usize = 250;
/// Points by which motions are told apart.
const MARKS: usize = 8;
/// Angles tried where the normal is parallel to the axis.
const OPEN_ANGLES: usize = 48;

impl StatePair<'_> {
    /// The best hypotheses, best first; at most `keep`.
    pub fn one_point_screws(&self, keep: usize, seed: u64) -> Vec<Hypothesis> {
        let mut rng = fastrand::Rng::with_seed(seed);
        let anchors = spread(&self.source, ANCHORS, &mut rng);
        let mut targets = self.targets.clone();
        rng.shuffle(&mut targets);
        targets.truncate(TARGETS);
        let mut scored: Vec<usize> = (0..self.source.len()).collect();
        rng.shuffle(&mut scored);
        scored.truncate(SCORED);
        let voxel = self.space.lattice.voxel;
        // Where these go tells motions apart.
        let marks: Vec<Vec3> = anchors.iter().take(MARKS).map(|&a| self.source[a].point).collect();
        let mut found: Vec<Hypothesis> = anchors
            .par_iter()
            .map(|&a| {
                let anchor = self.source[a];
                let mut near: Vec<usize> = (0..self.source.len()).collect();
                near.sort_by(|i, j| {
                    let d = |k: &usize| self.source[*k].point.distance_squared(anchor.point);
                    d(i).total_cmp(&d(j)).then(i.cmp(j))
                });
                // Spread over a neighbourhood: the very nearest say nothing about the rotation.
                let reach = near.len().min(4 * FIRST);
                let first: Vec<usize> = near[..reach].iter().step_by(4).copied().collect();
                let need = FIRST_FIT * first.len() / FIRST;
                let mut best = Distinct::new(&marks, self.apart * voxel, keep);
                let mut consider = |screw: Screw, q: f64| {
                    let m = Motion::from(screw.motion(q));
                    let mut misses = 0;
                    for &i in &first {
                        misses += usize::from(!self.fits(&m, &self.source[i]));
                        if first.len() - misses < need {
                            return;
                        }
                    }
                    let score = scored.iter().filter(|&&i| self.fits(&m, &self.source[i])).count();
                    best.offer(Hypothesis { screw, q, score });
                };
                for (y, m) in &targets {
                    screws_between(anchor.point, anchor.normal, *y, *m, voxel, &mut consider);
                }
                best.sorted()
            })
            .collect::<Vec<_>>()
            .concat();
        found.sort_by_key(|h| std::cmp::Reverse(h.score));
        distinct(found, &marks, self.apart * voxel, keep)
    }
}

/// All screws that take (x, n) to (y, m).
fn screws_between(x: Vec3, n: Vec3, y: Vec3, m: Vec3, voxel: f32, emit: &mut dyn FnMut(Screw, f64)) {
    let (chord, along) = (y - x, n.dot(m));
    let far = chord.length();
    if far < 2.0 * voxel {
        return;
    }
    if along > 0.97 {
        let screw = Screw { kind: JointKind::Prismatic, axis: (chord / far).as_dvec3(), pivot: x.as_dvec3() };
        emit(screw, far as f64);
        // The normal may be the axis itself: the chord is then square to it.
        if chord.dot(n).abs() < 2.0 * voxel {
            for k in 1..OPEN_ANGLES {
                let angle = std::f64::consts::TAU * k as f64 / OPEN_ANGLES as f64 - std::f64::consts::PI;
                if angle.abs() > 1e-3 {
                    turn(x, y, n, angle, emit);
                }
            }
        }
    }
    let bend = m - n;
    let axis = bend.cross(chord);
    if bend.length() < 0.1 || axis.length() < 0.2 * bend.length() * far {
        return;
    }
    let axis = axis.normalize();
    // Seen along the axis.
    let (a, b) = (n - axis * n.dot(axis), m - axis * m.dot(axis));
    if a.length() < 0.35 || b.length() < 0.35 {
        return;
    }
    let angle = axis.dot(a.cross(b)).atan2(a.dot(b));
    turn(x, y, axis, angle as f64, emit);
}

/// The turn by `angle` about `axis` that takes x to y, as far as y can be reached.
fn turn(x: Vec3, y: Vec3, axis: Vec3, angle: f64, emit: &mut dyn FnMut(Screw, f64)) {
    let (x, y, axis) = (x.as_dvec3(), y.as_dvec3(), axis.as_dvec3().normalize());
    let chord = (y - x) - axis * (y - x).dot(axis);
    let half = (0.5 * angle).tan();
    if half.abs() < 0.02 {
        return;
    }
    let pivot = x + 0.5 * chord + axis.cross(chord) / (2.0 * half);
    emit(Screw { kind: JointKind::Revolute, axis, pivot }, angle);
}

/// `count` samples spread over the set: farthest point sampling.
fn spread(samples: &[Sample], count: usize, rng: &mut fastrand::Rng) -> Vec<usize> {
    let mut distance = vec![f32::INFINITY; samples.len()];
    let mut out = Vec::new();
    let mut next = rng.usize(..samples.len().max(1));
    while out.len() < count.min(samples.len()) {
        out.push(next);
        for (d, s) in distance.iter_mut().zip(samples) {
            *d = d.min(s.point.distance_squared(samples[next].point));
        }
        next = (0..samples.len()).max_by(|a, b| distance[*a].total_cmp(&distance[*b]).then(b.cmp(a))).unwrap_or(0);
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DVec3;

    #[test]
    fn one_correspondence_gives_the_hinge() {
        let truth = Screw {
            kind: JointKind::Revolute,
            axis: DVec3::new(0.1, 0.2, 1.0).normalize(),
            pivot: DVec3::new(0.3, -0.2, 0.1),
        };
        let pose = truth.motion(0.9);
        let (x, n) = (DVec3::new(1.0, 0.4, 0.3), DVec3::new(0.3, 0.9, 0.2).normalize());
        let mut best = f64::INFINITY;
        let (y, m) = (pose.apply(x), pose.rotate(n));
        screws_between(x.as_vec3(), n.as_vec3(), y.as_vec3(), m.as_vec3(), 0.01, &mut |s, q| {
            let off =
                s.axis.cross(truth.axis).length() + truth.distance(s.pivot) + (s.motion(q).inverse() * pose).angle();
            best = best.min(off);
        });
        assert!(best < 1e-4, "{best}");
    }
}
