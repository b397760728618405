//! What a person should know before believing the joints. A doubt is data; its `Display` is the
//! sentence that people read.

use hingecast_geom::JointKind;
use serde::{Deserialize, Serialize};
use std::fmt;

/// One doubt. Joints and parts are meant by their names in the tree.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "snake_case")]
pub enum Doubt {
    /// No part moves.
    NothingMoves,
    /// The joint's other type explains the recording nearly as well.
    Undecidable {
        /// Name of the joint.
        joint: String,
        /// The other type.
        rival: JointKind,
        /// How many nats it is behind.
        nats: f64,
    },
    /// The part may not move at all: views contradict its motion about as much as they contradict rest.
    MayNotMove {
        /// Name of the joint.
        joint: String,
        /// Share of the places where the part would be at rest that other states look through.
        at_rest: f64,
        /// The same where it is said to be, and where its own state measured it.
        moved: f64,
    },
    /// The part may be the other side of another joint's part: one line, and it moves only where that does.
    MayBeOneWith {
        /// Name of the joint.
        joint: String,
        /// Name of the other.
        other: String,
    },
    /// Views of some states contradict the joint's value there.
    Contradicted {
        /// Name of the joint.
        joint: String,
        /// Indices of the states.
        states: Vec<usize>,
    },
    /// The axis may point elsewhere.
    LooseAxis {
        /// Name of the joint.
        joint: String,
        /// Standard deviation, degrees.
        deg: f64,
    },
    /// The axis may lie elsewhere.
    LoosePivot {
        /// Name of the joint.
        joint: String,
        /// Standard deviation, scene units.
        units: f64,
    },
    /// A part is two pieces that do not touch.
    TwoPieces {
        /// Name of the part.
        part: String,
        /// Share of the part that is the second piece.
        share: f64,
    },
    /// States hardly show a joint's part.
    Unseen {
        /// Name of the joint.
        joint: String,
        /// Indices of the states.
        states: Vec<usize>,
    },
    /// Surface moved in a way that no part explains.
    Unexplained {
        /// Share of the surface.
        share: f64,
    },
    /// Two states only: parts that moved alike cannot be told apart.
    TwoStates,
    /// Its values are a function of another joint's, in too few states to be sure.
    MayFollow {
        /// Name of the joint.
        joint: String,
        /// Name of the joint that it may follow.
        leader: String,
        /// How much the recording tells it.
        nats: f64,
    },
    /// Limits that a person gave leave out recorded states.
    LimitsLeaveOut {
        /// Name of the joint.
        joint: String,
        /// Indices of the states.
        states: Vec<usize>,
        /// How far the farthest of them is beyond, radians or scene units.
        by: f64,
        /// It is an angle.
        turns: bool,
    },
    /// Anything else, as a sentence.
    Other {
        /// What a person reads.
        sentence: String,
    },
}

impl Doubt {
    /// The joint or the part that is meant, if it is about one.
    pub fn about(&self) -> Option<&str> {
        match self {
            Self::Undecidable { joint, .. }
            | Self::MayNotMove { joint, .. }
            | Self::MayBeOneWith { joint, .. }
            | Self::Contradicted { joint, .. }
            | Self::LooseAxis { joint, .. }
            | Self::LoosePivot { joint, .. }
            | Self::MayFollow { joint, .. }
            | Self::LimitsLeaveOut { joint, .. }
            | Self::Unseen { joint, .. } => Some(joint),
            Self::TwoPieces { part, .. } => Some(part),
            Self::NothingMoves | Self::Unexplained { .. } | Self::TwoStates | Self::Other { .. } => None,
        }
    }

    /// The same about a joint that has got another name.
    pub fn renamed(mut self, old: &str, new: &str) -> Self {
        match &mut self {
            Self::MayFollow { leader: other, .. } | Self::MayBeOneWith { other, .. } if other == old => {
                *other = new.to_string();
            }
            _ => {}
        }
        match &mut self {
            Self::Undecidable { joint, .. }
            | Self::MayNotMove { joint, .. }
            | Self::MayBeOneWith { joint, .. }
            | Self::Contradicted { joint, .. }
            | Self::LooseAxis { joint, .. }
            | Self::LoosePivot { joint, .. }
            | Self::MayFollow { joint, .. }
            | Self::LimitsLeaveOut { joint, .. }
            | Self::Unseen { joint, .. }
                if joint == old =>
            {
                *joint = new.to_string();
            }
            _ => {}
        }
        self
    }
}

impl fmt::Display for Doubt {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        match self {
            Self::NothingMoves => write!(f, "nothing moves: one part without joints"),
            Self::Undecidable { joint, rival, nats } => write!(
                f,
                "undecidable: '{joint}' may as well be {}: it moved too little to tell ({nats:.1} nats apart; 10 would do)",
                kind_name(*rival)
            ),
            Self::MayNotMove { joint, at_rest, moved } => write!(
                f,
                "joint '{joint}' may not move at all: cameras look through {:.0} % of where its part was, and through \
                 {:.0} % of where it was measured or is said to be; scans that see different places, or cameras that \
                 drift, look like that",
                100.0 * at_rest,
                100.0 * moved
            ),
            Self::MayBeOneWith { joint, other } => write!(
                f,
                "joint '{joint}' has the axis of '{other}', lies beside it and moves only where that does: the two may be \
                 the sides of one part"
            ),
            Self::Contradicted { joint, states } => write!(
                f,
                "joint '{joint}': its value in state{} {} is contradicted: cameras look through where its part is said to be",
                if states.len() == 1 { "" } else { "s" },
                listed(states)
            ),
            Self::LooseAxis { joint, deg } => {
                write!(f, "joint '{joint}': the depth says where its axis points only to {deg:.1} deg")
            }
            Self::LoosePivot { joint, units } => {
                write!(f, "joint '{joint}': the depth says where its axis lies only to {units:.3} units")
            }
            Self::TwoPieces { part, share } => write!(
                f,
                "'{part}' has two pieces that do not touch ({:.0} % of it is the second) and always moved together: if \
                 they are two parts, record them moving one at a time",
                100.0 * share
            ),
            Self::Unseen { joint, states } => write!(
                f,
                "joint '{joint}': its part is hardly seen in state{} {states:?}; the value there is a guess",
                if states.len() == 1 { "" } else { "s" }
            ),
            Self::Unexplained { share } => write!(
                f,
                "{:.1} % of the surface moved in a way that no part explains (soft, or too small a part, or frames that \
                 differ)",
                100.0 * share
            ),
            Self::MayFollow { joint, leader, nats } => write!(
                f,
                "joint '{joint}' may follow '{leader}': in every state their values fit one line or curve ({nats:.1} nats, 10 \
                 would do); if that is so, record more states, and if not, move one of them alone"
            ),
            Self::TwoStates => write!(
                f,
                "two states only: parts that moved alike (two drawers pulled out equally far) come out as one; if that \
                 may be so, record more states, or move one part at a time"
            ),
            Self::LimitsLeaveOut { joint, states, by, turns } => {
                let by = if *turns { format!("{:.1} deg", by.to_degrees()) } else { format!("{by:.4} units") };
                write!(
                    f,
                    "joint '{joint}': its limits leave out state{} {}, by up to {by}: the twin cannot go where the object was",
                    if states.len() == 1 { "" } else { "s" },
                    listed(states)
                )
            }
            Self::Other { sentence } => write!(f, "{sentence}"),
        }
    }
}

/// The first few of many.
fn listed(states: &[usize]) -> String {
    const SHOWN: usize = 8;
    let mut names: Vec<String> = states.iter().take(SHOWN).map(usize::to_string).collect();
    if states.len() > SHOWN {
        names.push(format!("and {} more", states.len() - SHOWN));
    }
    names.join(", ")
}

fn kind_name(kind: JointKind) -> &'static str {
    match kind {
        JointKind::Prismatic => "a slide",
        JointKind::Fixed => "fixed",
        _ => "a hinge",
    }
}
