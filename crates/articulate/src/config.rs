//! Settings of the search, and limits that all of it shares.

use serde::{Deserialize, Serialize};

/// Settings of [`find`](crate::find()).
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Config {
    /// Cells of the grid along the object's longest side.
    pub cells: usize,
    /// No more moving parts than this.
    pub max_parts: usize,
    /// Correct camera poses by the depth, where it shows that they are off.
    pub align_cameras: bool,
    /// Decide labels where parts meet pixel by pixel, where depth is sharp. Twins come out better,
    /// joints stay the same.
    pub borders: bool,
    /// In noisy recordings, fit the joints anew without a part of the views each, to know how sure they are.
    pub resample: bool,
    /// State 0 is a scan of the thing alone, the others are pictures of a film in the order of time, and
    /// what they show besides may be hands.
    #[serde(skip)]
    pub film: bool,
    /// Everything that the cameras saw, the room too, holds them where they are: what the object alone says
    /// moves them little.
    #[serde(skip)]
    pub held: bool,
    /// Seed of everything random: the same seed, the same bytes.
    #[serde(skip)]
    pub seed: u64,
    /// Names of passes (see [`crate::passes`]) that are left out, to see what each
    /// is worth.
    #[serde(skip)]
    pub skip: Vec<String>,
}

impl Default for Config {
    fn default() -> Self {
        Self {
            cells: 96,
            max_parts: 16,
            align_cameras: true,
            borders: true,
            resample: true,
            film: false,
            held: false,
            seed: 0,
            skip: Vec::new(),
        }
    }
}

/// With fewer states a flat part is free to slide in its own plane: more is tried, and less is
/// believed.
pub const MANY_STATES: usize = 4;
