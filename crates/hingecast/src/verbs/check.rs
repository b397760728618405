//! `hingecast check`

use super::{Outcome, Session};
use crate::cli::Check;
use hingecast::failure::Result;
use hingecast_capture::Recording;

pub fn run(session: &Session, args: &Check) -> Result<Outcome> {
    let recording = Recording::open(&args.recording)?;
    session.ui.say(&format!("{} frames", recording.frames.len()));
    Ok(Outcome::Done)
}
