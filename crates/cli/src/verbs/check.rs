//! `hingecast check`

use super::{Outcome, Session};
use crate::cli::Check;
use hingecast::failure::Result;
use hingecast::prepare::check;
use hingecast_capture::check::{StateFrames, fix};

pub fn run(session: &Session, args: &Check) -> Result<Outcome> {
    let mut report = check(&args.recording, 0, &session.ui.stage("check"))?;
    let mut repaired = Vec::new();
    if args.fix {
        repaired = fix(&args.recording, &report)?;
        repaired.iter().for_each(|line| session.ui.say(&format!("repaired: {line}")));
        if !repaired.is_empty() {
            report = check(&args.recording, 0, &session.ui.stage("check"))?;
        }
    }
    for finding in report.summary() {
        session.ui.say(&finding.to_string());
    }
    for s in &report.states {
        session.ui.say(&line(s));
    }
    if report.findings.is_empty() {
        session.ui.say("nothing wrong was found");
    }
    session
        .answer(&serde_json::json!({ "findings": report.findings, "states": report.states, "repaired": repaired }))?;
    Ok(if report.has_errors() { Outcome::UnderBar } else { Outcome::Done })
}

/// What is there of a state. One that only has test frames is held out on purpose.
fn line(s: &StateFrames) -> String {
    let StateFrames { state, usable, partly_hidden, occluded, test } = s;
    if usable + occluded == 0 && *test > 0 {
        return format!("held-out state {state}: {test} test frames");
    }
    let hidden = if occluded + partly_hidden > 0 {
        format!(", {occluded} left out as occluded, {partly_hidden} with hidden pixels")
    } else {
        String::new()
    };
    format!("state {state:>3}: {usable} usable training frames{hidden}, {test} test frames")
}

#[cfg(test)]
mod tests {
    use super::*;

    /// States that are held out read "0 usable training frames", as if something were wrong.
    #[test]
    fn a_held_out_state_is_called_so() {
        let state = |usable, occluded| line(&StateFrames { state: 7, usable, occluded, test: 4, ..Default::default() });
        assert_eq!(state(0, 0), "held-out state 7: 4 test frames");
        assert_eq!(state(3, 0), "state   7: 3 usable training frames, 4 test frames");
        // All of its pictures show hands: that is wrong.
        assert!(state(0, 3).contains("0 usable training frames, 3 left out as occluded"));
    }
}
