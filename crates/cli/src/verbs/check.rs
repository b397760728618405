//! `hingecast check`

use super::{Outcome, Session};
use crate::cli::Check;
use hingecast::failure::{Failure, Result};
use hingecast::prepare::{check, write_page};
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
    if let Some(page) = &args.out {
        if page.extension().is_none_or(|e| e != "html") {
            let hint = "a page: -o check.html";
            return Err(Failure::new("the page's name does not end in .html", page.display().to_string(), hint));
        }
        // One of ours, or a new one: what else is there is nobody's to write over.
        for file in [page.clone(), page.with_extension("png")] {
            let ours = std::fs::read_to_string(page).is_ok_and(|text| text.contains("<title>check "));
            if file.exists() && !ours {
                let what = "a file of this name is there, and no page of check";
                return Err(Failure::new(what, file.display().to_string(), "another name: -o PAGE.html"));
            }
        }
        write_page(&args.recording, &report, page)?;
        session.ui.say(&format!("look: {}", page.display()));
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
