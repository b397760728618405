//! The states' frames, brought together on what stands still.
//!
//! Every pair of scans is registered globally: oriented samples that could be the same piece of
//! surface vote for the turn and the shift that would make them so; the places with most votes are
//! refined, and judged by what agrees less what one scan saw where the other looked through. The
//! best pairs connect all states; then all are refined together, finely.

mod apart;
mod balanced;
pub(crate) mod fine;
mod level;
mod pair;
mod place;
mod steady;
mod votes;

pub use apart::apart;
pub use level::level;
pub use steady::steady;

use crate::error::PrepareError;
use crate::scan::Scan;
use glam::DVec3;
use hingecast_articulate::{DepthView, Depths};
use hingecast_geom::{Pose, Progress};
use serde::{Deserialize, Serialize};

/// Up to so many states every pair is tried; beyond, each with the first and the two before it.
const ALL_PAIRS: usize = 8;
/// Space around a scan that is looked at, shares of its longest side.
const AROUND: f32 = 0.02;
/// Fewer coarse samples hold no scan.
const FEW: usize = 200;
/// A pair agrees when this share of the samples that can be judged does.
const AGREES: f64 = 0.6;
/// And what agrees, less what contradicts, is this share of all samples: a corner of a room fits any corner.
const OVERLAPS: f64 = 0.03;
/// The second best place of a pair has at most this share of the best one's score.
const SECOND: f64 = 0.8;

/// What may differ between the frames of two scans.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Freedom {
    /// A turn about this unit vector, up in every scan, and any shift: phones know gravity.
    AboutUp(DVec3),
    /// Any turn and any shift.
    Any,
}

/// How the states' frames lie to each other.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Registration {
    /// Of every state: the frame of state 0 from its own.
    pub common_from_state: Vec<Pose>,
    /// The pairs that were compared.
    pub pairs: Vec<PairReport>,
    /// Largest turn, radians, and shift, scene units, by which two ways of going from one state to
    /// another around a circle of pairs differ after the fine step; 0 with two states.
    pub circle: (f64, f64),
    /// By how much each state's frame could be turned, radians, or shifted, shares of the scan's radius,
    /// without its surfaces lying worse than they do: what holds it least. `[state]`
    #[serde(default)]
    pub slack: Vec<f64>,
}

impl Registration {
    /// Of the pairs that connect the states, the least share that agrees; 1 with one state.
    pub fn least_share(&self) -> f64 {
        self.pairs.iter().filter(|p| p.used).map(|p| p.share).fold(1.0, f64::min)
    }
}

/// How well two scans fit.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct PairReport {
    /// The two states.
    pub states: (usize, usize),
    /// Share of the samples that can be judged which agree, 0..1.
    pub share: f64,
    /// Score of the second best place over that of the best, 0..1; near 1 nothing tells them apart.
    pub second: f64,
    /// Whether the pair connects its states in the end.
    pub used: bool,
}

/// Brings the frames of all states together. Views' pixels of class `OBJECT` count.
///
/// # Errors
/// A state without surface, one that agrees with no other or in two ways, a view that cannot be
/// read, the wish to stop.
pub fn register(
    depths: &mut dyn Depths,
    freedom: Freedom,
    seed: u64,
    progress: &Progress,
) -> Result<Registration, PrepareError> {
    let n = depths.n_states();
    let mut scans = Vec::new();
    for state in 0..n {
        progress.report(state, n, "scans")?;
        scans.push(scan(depths, state)?);
    }
    let pairs: Vec<(usize, usize)> = (1..n)
        .flat_map(|s| (0..s).map(move |r| (r, s)))
        .filter(|(r, s)| n <= ALL_PAIRS || *r == 0 || s - r <= 2)
        .collect();
    let mut found = Vec::new();
    for (k, &(r, s)) in pairs.iter().enumerate() {
        progress.report(k, pairs.len(), "pairs of scans")?;
        found.push(pair::align(&scans[s], &scans[r], freedom, seed)?);
    }
    let Connected { poses, order, used } = connect(n, &pairs, &found)?;
    progress.report(0, 1, "all scans together")?;
    let pair = |r: usize, s: usize| {
        let at = |(a, b): (usize, usize)| pairs.iter().position(|p| *p == (a, b)).map(|k| found[k].pose);
        at((r, s)).or_else(|| at((s, r)).map(|p| p.inverse()))
    };
    let common_from_state = fine::together(&scans, poses, &order, &pair, seed);
    let slack = fine::slack(&scans, &common_from_state, seed);
    let circle = circle(&pairs, &found, &common_from_state);
    let reports = pairs.iter().zip(&found).zip(used).map(|((&states, f), used)| PairReport {
        states,
        share: f.share,
        second: f.second,
        used,
    });
    Ok(Registration { common_from_state, pairs: reports.collect(), circle, slack })
}

/// A state's scan.
fn scan(depths: &mut dyn Depths, state: usize) -> Result<Scan, PrepareError> {
    scan_of(&depths.views(state)?, state)
}

/// The scan of a state's views.
fn scan_of(views: &[DepthView], state: usize) -> Result<Scan, PrepareError> {
    let scan = Scan::new(views, AROUND);
    let samples = scan.as_ref().map_or(0, |s| s.coarse.points.len());
    scan.filter(|_| samples >= FEW).ok_or(PrepareError::Empty { state, samples })
}

/// All states, connected by the best pairs.
struct Connected {
    /// The frame of state 0 from each state's.
    poses: Vec<Pose>,
    /// The states in the order in which they are reached.
    order: Vec<usize>,
    /// Which pairs connect them.
    used: Vec<bool>,
}

/// The tree of the best pairs (Prim 1957).
fn connect(n: usize, pairs: &[(usize, usize)], found: &[pair::Placed]) -> Result<Connected, PrepareError> {
    let mut pose: Vec<Option<Pose>> = vec![None; n];
    let mut used = vec![false; pairs.len()];
    pose[0] = Some(Pose::IDENTITY);
    let mut order = vec![0];
    while let Some(missing) = (0..n).find(|&s| pose[s].is_none()) {
        let open = |k: &usize| pose[pairs[*k].0].is_some() != pose[pairs[*k].1].is_some();
        let sure = |k: &usize| found[*k].is_sure();
        let best = |filter: &dyn Fn(&usize) -> bool| {
            let candidates = (0..pairs.len()).filter(|k| open(k) && filter(k));
            candidates.max_by(|&a, &b| found[a].score.total_cmp(&found[b].score).then(b.cmp(&a)))
        };
        let Some(k) = best(&sure) else {
            let k = best(&|_| true).unwrap_or(0);
            let (r, s) = pairs.get(k).copied().unwrap_or((0, missing));
            let (state, other) = if pose[r].is_some() { (s, r) } else { (r, s) };
            let f = &found[k];
            return Err(if !f.agrees() {
                let share = if f.share < AGREES { f.share } else { f.score.max(0.0) };
                PrepareError::Apart { state, other, percent: 100.0 * share }
            } else {
                PrepareError::Ambiguous { state, other, degrees: f.rival.0.to_degrees(), distance: f.rival.1 }
            });
        };
        let ((r, s), r_from_s) = (pairs[k], found[k].pose);
        match (pose[r], pose[s]) {
            (Some(from), _) => {
                pose[s] = Some(from * r_from_s);
                order.push(s);
            }
            (None, Some(from)) => {
                pose[r] = Some(from * r_from_s.inverse());
                order.push(r);
            }
            (None, None) => unreachable!("an open pair has one end placed"),
        }
        used[k] = true;
    }
    Ok(Connected { poses: pose.into_iter().flatten().collect(), order, used })
}

/// How far apart the pairs by themselves and all states together are, over the pairs that agree.
fn circle(pairs: &[(usize, usize)], found: &[pair::Placed], common: &[Pose]) -> (f64, f64) {
    let sure = pairs.iter().zip(found).filter(|(_, f)| f.is_sure());
    sure.fold((0.0, 0.0), |(turn, shift), (&(r, s), f)| {
        let together = common[r].inverse() * common[s];
        let off = together * f.pose.inverse();
        let moved = (off.apply(f.centre) - f.centre).length();
        (f64::max(turn, off.angle()), f64::max(shift, moved))
    })
}
