//! Whether states that seem to lie apart do: an opened laptop shares little surface with a shut one, and
//! nothing is wrong with its frame.

use super::{AGREES, Freedom, SECOND, pair, scan};
use crate::error::PrepareError;
use hingecast_articulate::Depths;
use hingecast_geom::Progress;

/// Another place must fit so many times better than the recorded one.
const BETTER: f64 = 1.25;
/// States that one is compared with.
const COMPARED: usize = 3;

/// Those of `suspects` that fit the other states clearly better elsewhere than where they were recorded, each
/// with whether it is clear where. Views' pixels of class `OBJECT` count.
///
/// # Errors
/// A state without surface, a view that cannot be read, the wish to stop.
pub fn apart(
    depths: &mut dyn Depths,
    suspects: &[usize],
    freedom: Freedom,
    seed: u64,
    progress: &Progress,
) -> Result<Vec<(usize, bool)>, PrepareError> {
    let n = depths.n_states();
    let mut out = Vec::new();
    for (k, &state) in suspects.iter().enumerate() {
        let own = scan(depths, state)?;
        // Its neighbours first, and rather those that nobody suspects.
        let mut others: Vec<usize> = (0..n).filter(|r| *r != state).collect();
        others.sort_by_key(|r| (suspects.contains(r), r.abs_diff(state)));
        let (mut here, mut elsewhere) = (false, false);
        for &other in others.iter().take(COMPARED) {
            progress.report(k, suspects.len(), "do the states share a frame?")?;
            let placed = pair::align(&own, &scan(depths, other)?, freedom, seed)?;
            let better = placed.score > BETTER * placed.recorded.max(0.0);
            here |= !better;
            elsewhere |= better && placed.share >= AGREES && placed.second <= SECOND;
        }
        if !here {
            out.push((state, elsewhere));
        }
    }
    Ok(out)
}
