//! What a person reads about it.

use crate::failure::Failure;
use hingecast_capture::Recording;
use hingecast_prepare::{PrepareError, Registration};

/// How sure a registration is, for a person.
pub fn sentence(found: &Registration) -> String {
    let used = found.pairs.iter().filter(|p| p.used);
    let worst = used.min_by(|a, b| a.share.total_cmp(&b.share));
    worst.map_or("one state: nothing to register".into(), |p| {
        format!(
            "{} states brought into one frame: of what two scans both see at least {:.0} % agrees (states {} and {}; second best place {:.0} % as good)",
            found.common_from_state.len(),
            100.0 * p.share,
            p.states.0,
            p.states.1,
            100.0 * p.second
        )
    })
}

/// Scans that were brought together rightly agree on this share of what two of them see, and nearly always
/// on more. Below it, up may not be what the files say; and it is doubted.
pub(super) const AGREE_WELL: f64 = 0.88;

/// Slack from which a registration is doubted, degrees: joints are to be right to half of one.
const LOOSE: f64 = 1.0;

/// A doubt where scans agree on too little, and for each state whose frame is held loosely.
pub fn registration_doubts(found: &Registration) -> Vec<String> {
    let loose = found.slack.iter().enumerate().filter(|(_, slack)| slack.to_degrees() > LOOSE);
    let least = found.least_share();
    let little = (least < AGREE_WELL).then(|| {
        format!(
            "of what two scans both see only {:.0} % agrees: their frames may have been brought together wrongly; look at \
             the states overlaid (hingecast check RECORDING -o page.html)",
            100.0 * least
        )
    });
    let loose = loose.map(|(state, slack)| {
        format!(
            "state {state}: its frame could be turned by {:.1} deg, and what it shares with the others would lie no \
                 worse: joints may be off by as much; scan with floor, another wall and a few things around",
            slack.to_degrees()
        )
    });
    little.into_iter().chain(loose).collect()
}

pub(super) fn failure(e: PrepareError, recording: &Recording) -> Failure {
    let place = recording.root.display().to_string();
    let hint = match &e {
        PrepareError::Empty { .. } => "record that state again from nearer; does its depth have the right unit?",
        PrepareError::Apart { .. } => {
            "record with more overlap: the same side of the object, floor and wall around it, in every scan"
        }
        PrepareError::Ambiguous { .. } => {
            "put a few things around the object that stay where they are, and have them in every scan"
        }
        PrepareError::NothingMoved { .. } => {
            "move every part by more than its own thickness between scans; or say where the object is: hingecast mask --box / --at"
        }
        PrepareError::NoObject { .. } => {
            "say where the object is: hingecast mask --box or --at; or give masks (docs/recordings.md); was something else moved, too?"
        }
        PrepareError::NothingThere => {
            "look at the place: a pixel on the object, with depth; or a box around it in the recording's frame and unit"
        }
        PrepareError::NoFocus => "point the camera at the object; check poses and the unit of depth",
        PrepareError::Depths(_) => "run `hingecast check` on the recording",
        PrepareError::Cancelled(_) => "",
    };
    match e {
        PrepareError::Cancelled(c) => c.into(),
        PrepareError::Depths(d) => match d.downcast::<Failure>() {
            Ok(own) => *own,
            Err(d) => Failure::new(d.to_string(), place, hint),
        },
        e => Failure::new(e.to_string(), place, hint),
    }
}
