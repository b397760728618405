//! Few pieces out of many.

use super::convex::{self, Convex};
use super::{Bounds, WORTH};
use glam::Vec3;

/// The common hull of two pieces, and by how much it is more than both.
struct Pair {
    more: f64,
    of: [usize; 2],
    hull: Convex,
}

/// Joins neighbours whose common hull fits, those first that it makes no larger, and drops what
/// others cover. Then goes on, whatever costs the least volume, until there are no more pieces than
/// asked, and while that costs next to nothing.
pub fn join(pieces: Vec<Convex>, bounds: &Bounds) -> Vec<Convex> {
    let mut pieces: Vec<Option<Convex>> = pieces.into_iter().map(Some).collect();
    let common = |pieces: &[Option<Convex>], i: usize, j: usize| {
        let (a, b) = (pieces[i].as_ref()?, pieces[j].as_ref()?);
        let hull = convex::common(a, b, bounds.room.cell)?;
        Some(Pair { more: hull.volume - a.volume - b.volume, of: [i, j], hull })
    };
    for must_fit in [true, false] {
        let fitting = |pair: &Pair| !must_fit || bounds.fits(&pair.hull);
        let all = (0..pieces.len()).flat_map(|j| (0..j).map(move |i| (i, j)));
        let mut pairs: Vec<Pair> = all.filter_map(|(i, j)| common(&pieces, i, j)).filter(fitting).collect();
        loop {
            let least = (0..pairs.len()).min_by(|&a, &b| pairs[a].more.total_cmp(&pairs[b].more));
            let pair = least.map_or(f64::MAX, |k| pairs[k].more);
            let (lost, dropped) = if must_fit { (f64::MAX, None) } else { cheapest(&pieces, bounds.room.reach) };
            let many = pieces.iter().flatten().count() > bounds.most;
            if pair == f64::MAX && dropped.is_none() || !must_fit && !many && pair.min(lost) > WORTH * bounds.whole {
                break;
            }
            let gone = match (least, dropped) {
                (Some(k), _) if pair <= lost => {
                    let Pair { of, hull, .. } = pairs.swap_remove(k);
                    of.iter().for_each(|&i| pieces[i] = None);
                    pieces.push(Some(hull));
                    let new = pieces.len() - 1;
                    pairs.extend((0..new).filter_map(|i| common(&pieces, i, new)).filter(fitting));
                    of.to_vec()
                }
                (_, dropped) => dropped.into_iter().inspect(|&i| pieces[i] = None).collect(),
            };
            pairs.retain(|p| gone.iter().all(|i| !p.of.contains(i)));
        }
        if must_fit {
            drop_covered(&mut pieces, bounds.room.reach);
        }
    }
    pieces.into_iter().flatten().collect()
}

/// A lost volume counts so many times as much as a filled one: a handle that is gone opens nothing.
const LOST: f64 = 4.0;

/// The piece whose loss costs the least, and how much: its volume and a layer on its surface, for a
/// thin thing is missed more than its volume says. The last is never lost.
fn cheapest(pieces: &[Option<Convex>], reach: f32) -> (f64, Option<usize>) {
    let costs = pieces.iter().enumerate().filter_map(|(i, p)| {
        let p = p.as_ref()?;
        Some((LOST * (p.volume + f64::from(reach) * p.mesh.area()), i))
    });
    let alone = pieces.iter().flatten().count() < 2;
    let least = costs.min_by(|a, b| a.0.total_cmp(&b.0)).filter(|_| !alone);
    (least.map_or(f64::MAX, |l| l.0), least.map(|l| l.1))
}

/// Drops, the smallest first, what lies within `reach` of others that stay.
fn drop_covered(pieces: &mut [Option<Convex>], reach: f32) {
    let volume = |i: usize| pieces[i].as_ref().map_or(0.0, |p: &Convex| p.volume);
    let mut order: Vec<usize> = (0..pieces.len()).filter(|&i| pieces[i].is_some()).collect();
    order.sort_by(|&a, &b| volume(a).total_cmp(&volume(b)));
    for i in order {
        let Some(own) = pieces[i].take() else { continue };
        let held = |x: &Vec3| pieces.iter().flatten().any(|p| p.beyond(*x) <= reach);
        if !own.places().iter().all(held) {
            pieces[i] = Some(own);
        }
    }
}
