//! The settings of the world around the object. As they are by default there is none: the object
//! floats in front of a plain background, and everything about it is known exactly.

use serde::{Deserialize, Serialize};

/// What stands around the object, and what happens to it and to the recording.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct World {
    /// What else is to be seen.
    pub scene: Scenery,
    /// Which masks come with the recording.
    pub masks: Masks,
    /// In which frame of reference each state's cameras are stated.
    pub frames: Frames,
    /// Somebody pushes the object between two states.
    pub push: Option<Push>,
}

impl World {
    /// Whether nothing was asked for.
    pub fn is_default(&self) -> bool {
        *self == Self::default()
    }
}

/// What is to be seen beside the object.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Scenery {
    /// Nothing.
    #[default]
    None,
    /// A floor, a wall behind the object and clutter beside it, all with texture and depth.
    Room,
}

/// The masks of the training frames. `none` holds for test frames, too.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Masks {
    /// The object, as exactly as the sensor has it (`d435` imitates ragged ones).
    #[default]
    True,
    /// No mask files.
    None,
    /// As a segmenter makes them: ragged, with holes, now and then with a piece too much or missing.
    Sam,
}

/// Frames of reference of the states. Cameras of held-out states stay in the true world: they
/// measure.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Frames {
    /// One for all.
    #[default]
    Shared,
    /// Every state but the first has its own: turned about `up` and shifted by up to 2 m, as scans
    /// of a phone are, which knows what is down.
    PerState,
    /// The same, but turned in any way.
    Tilted,
}

/// The object as a whole is pushed along the floor, between two states, and stays there.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Push {
    /// How far its middle goes, millimetres; away from the wall or along it.
    pub mm: f64,
    /// How far it turns about the vertical through its middle, degrees, to either side.
    pub deg: f64,
    /// The first states after a push each, 1 .. states - 1; pushes add up. Empty: one push, before a
    /// state that the seed picks.
    #[serde(default)]
    pub states: Vec<usize>,
}

impl std::str::FromStr for Push {
    type Err = String;

    /// `MM[:DEG]`, 2 degrees unless said.
    fn from_str(text: &str) -> Result<Self, String> {
        let (mm, deg) = pair(text).ok_or_else(|| format!("'{text}' is not MM[:DEG], such as 30 or 12:1.5"))?;
        Ok(Self { mm, deg: deg.unwrap_or(2.0), states: Vec::new() })
    }
}

/// `A` or `A:B`, finite and not negative.
fn pair(text: &str) -> Option<(f64, Option<f64>)> {
    let number = |t: &str| t.trim().parse().ok().filter(|x: &f64| x.is_finite() && *x >= 0.0);
    match text.split_once(':') {
        None => Some((number(text)?, None)),
        Some((a, b)) => Some((number(a)?, Some(number(b)?))),
    }
}
