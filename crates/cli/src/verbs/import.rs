//! `hingecast import`

use super::{Outcome, Session};
use crate::cli::Import;
use hingecast::failure::Result;
use hingecast_capture::import::{Format, import};

pub fn run(session: &Session, args: &Import) -> Result<Outcome> {
    let format = Format::from_name(&args.format)?;
    let report = import(&args.source, &args.out, format, &session.ui.stage("import"))?;
    session.ui.say(&format!("imported {} frames -> {}", report.frames, report.recording.display()));
    session.ui.say(&format!("next: hingecast check {}", report.recording.display()));
    session.answer(&serde_json::json!({ "recording": report.recording, "frames": report.frames }))?;
    Ok(Outcome::Done)
}
