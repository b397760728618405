//! Wrong on purpose: an object whose target joint is off by a known amount, to see whether a policy
//! notices.
//!
//! All in the base frame; r points from the axis to the grasp, a is the axis, t = a x r the
//! direction of motion there. `axis`: a turned about r (a slide: about the vertical), so that the
//! part's motion goes sideways by that angle. `pivot`: the axis moved away from the grasp along -r.
//! `limits`: the range cut from its open end. `edge`: the hinge on the other side of the moving
//! part, turning the other way, as if seen in a mirror.

use crate::SimError;
use glam::{DQuat, DVec3};
use serde::{Deserialize, Serialize};

/// One way to make the target joint wrong.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Spoil {
    /// Degrees.
    Axis(f64),
    /// Millimetres in the simulation.
    Pivot(f64),
    /// The share of the range that is left.
    Limits(f64),
    /// The hinge on the opposite edge.
    Edge,
}

impl Spoil {
    /// Reads `axis=30`, `pivot=10`, `limits=0.5` or `edge`; several are joined by commas.
    ///
    /// # Errors
    /// When it is none of these.
    pub fn read(text: &str) -> Result<Vec<Self>, SimError> {
        text.split(',').map(Self::read_one).collect()
    }

    fn read_one(text: &str) -> Result<Self, SimError> {
        let number = |t: &str| t.parse::<f64>().ok().filter(|x| x.is_finite());
        let read = match text.split_once('=') {
            None if text == "edge" => Some(Self::Edge),
            Some(("axis", t)) => number(t).map(Self::Axis),
            Some(("pivot", t)) => number(t).map(Self::Pivot),
            Some(("limits", t)) => number(t).filter(|x| *x > 0.0 && *x <= 1.0).map(Self::Limits),
            _ => None,
        };
        read.ok_or_else(|| {
            let hint = "axis=DEGREES, pivot=MM, limits=SHARE (0 to 1] or edge; several joined by commas";
            SimError::task(format!("'{text}' spoils nothing that is known"), "--spoil", hint)
        })
    }
}

/// The joint as it is, in the base frame (simulated metres).
#[derive(Clone, Copy, Debug)]
pub(crate) struct Line {
    pub axis: DVec3,
    pub pivot: DVec3,
}

impl Line {
    /// The line after `spoil`; limits are none of its business.
    pub fn spoiled(self, spoil: &Spoil, slides: bool, grasp: DVec3, part_centre: DVec3) -> Self {
        let foot = |x: DVec3| self.pivot + self.axis * (x - self.pivot).dot(self.axis);
        // A slide has no pivot: it goes askew about the vertical, or gravity would open the drawer.
        let r = if slides { DVec3::Z } else { grasp - foot(grasp) };
        let r = r.reject_from_normalized(self.axis).normalize_or(self.axis.any_orthonormal_vector());
        match *spoil {
            // About the foot, so that the axis stays where it is next to the grasp.
            Spoil::Axis(degrees) => {
                let axis = DQuat::from_axis_angle(r, degrees.to_radians()) * self.axis;
                Self { axis, pivot: foot(grasp) }
            }
            Spoil::Pivot(mm) => Self { pivot: self.pivot - r * (1e-3 * mm), ..self },
            Spoil::Edge => {
                let across = part_centre - foot(part_centre);
                let across = across - r.cross(self.axis) * across.dot(r.cross(self.axis));
                Self { axis: -self.axis, pivot: self.pivot + 2.0 * across }
            }
            Spoil::Limits(_) => self,
        }
    }
}
