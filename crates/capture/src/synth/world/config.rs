//! The settings of the world around the object. As they are by default there is none: the object
//! floats in front of a plain background, and everything about it is known exactly.

use super::lens::Lens;
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
    /// Size and lens of the pictures; none: square ones of `size`.
    pub lens: Option<Lens>,
    /// Where the cameras go.
    pub trajectory: Trajectory,
    /// How far the stated poses of training frames wander off.
    pub drift: Option<Drift>,
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
    /// As a segmenter makes them: ragged, with holes, now and then with a piece too much or
    /// missing.
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

/// Where cameras stand, those of held-out frames, too.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Trajectory {
    /// All around, from the horizon to straight above, at one distance.
    #[default]
    Hemisphere,
    /// A person's arc of 200 degrees around the front (160 beside a wall), at changing heights and
    /// distances, with a hand that is not steady; anew in each state.
    Walk,
    /// Up to 70 degrees to either side of the front, to 53 degrees above the horizon.
    Front,
}

/// Drift of a tracker along the way of each state: the poses of its training frames, in order,
/// wander off smoothly; the first is right, the worst is off by this.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Drift {
    /// Largest turn, degrees, about the camera.
    pub deg: f64,
    /// Largest shift, millimetres.
    pub mm: f64,
}

/// The object as a whole is pushed along the floor, between two states, and stays there.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Push {
    /// How far its middle goes, millimetres; away from the wall or along it.
    pub mm: f64,
    /// How far it turns about the vertical through its middle, degrees, to either side.
    pub deg: f64,
    /// The first states after a push each, 1 .. states - 1; pushes add up. Empty: one push, before
    /// a state that the seed picks.
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

impl std::str::FromStr for Drift {
    type Err = String;

    /// `DEG:MM`.
    fn from_str(text: &str) -> Result<Self, String> {
        match pair(text) {
            Some((deg, Some(mm))) => Ok(Self { deg, mm }),
            _ => Err(format!("'{text}' is not DEG:MM, such as 1:10")),
        }
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
