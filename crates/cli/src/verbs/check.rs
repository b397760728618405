//! `hingecast check`

use super::{Outcome, Session};
use crate::cli::Check;
use hingecast::failure::Result;
use hingecast_capture::check::{check, fix};

pub fn run(session: &Session, args: &Check) -> Result<Outcome> {
    let mut report = check(&args.recording, &session.ui.stage("check"))?;
    let mut repaired = Vec::new();
    if args.fix {
        repaired = fix(&args.recording, &report)?;
        repaired.iter().for_each(|line| session.ui.say(&format!("repaired: {line}")));
        if !repaired.is_empty() {
            report = check(&args.recording, &session.ui.stage("check"))?;
        }
    }
    for finding in report.summary() {
        session.ui.say(&finding.to_string());
    }
    for s in &report.states {
        let hidden = if s.occluded + s.partly_hidden > 0 {
            format!(", {} left out as occluded, {} with hidden pixels", s.occluded, s.partly_hidden)
        } else {
            String::new()
        };
        session
            .ui
            .say(&format!("state {:>3}: {} usable training frames{hidden}, {} test frames", s.state, s.usable, s.test));
    }
    if report.findings.is_empty() {
        session.ui.say("nothing wrong was found");
    }
    session
        .answer(&serde_json::json!({ "findings": report.findings, "states": report.states, "repaired": repaired }))?;
    Ok(if report.has_errors() { Outcome::UnderBar } else { Outcome::Done })
}
