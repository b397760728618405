//! `check`, with what only a registration can tell: whether states that share little surface lie apart.

use super::raw_depths::RawDepths;
use super::words::failure;
use crate::failure::{Failure, Result};
use hingecast_capture::Recording;
use hingecast_capture::check::{CheckReport, Severity, check as look_over};
use hingecast_geom::Progress;
use hingecast_prepare::register::Freedom;
use std::path::Path;

/// Name of the finding that a state has another frame than the others.
const APART: &str = "states-apart";

/// Looks over the recording at `path`.
///
/// # Errors
/// The wish to stop.
pub fn check(path: &Path, seed: u64, progress: &Progress) -> Result<CheckReport> {
    let mut report = look_over(path, progress)?;
    let suspects: Vec<usize> = report.findings.iter().filter(|f| f.code == APART).filter_map(|f| f.state).collect();
    if suspects.is_empty() {
        return Ok(report);
    }
    let Ok(recording) = Recording::open(path) else { return Ok(report) };
    let up = Freedom::AboutUp(recording.up);
    let mut depths = RawDepths::new(&recording);
    match hingecast_prepare::apart(&mut depths, &suspects, up, seed, progress) {
        Ok(apart) => {
            let clear = |state: Option<usize>| apart.iter().find(|(s, _)| Some(*s) == state).map(|(_, clear)| *clear);
            report.findings.retain(|f| f.code != APART || clear(f.state).is_some());
            for finding in report.findings.iter_mut().filter(|f| f.code == APART) {
                if clear(finding.state) == Some(true) {
                    finding.severity = Severity::Warning;
                    finding.hint = "nothing to do: `hingecast build` brings it to the others".into();
                } else {
                    finding.severity = Severity::Error;
                }
            }
            Ok(report)
        }
        Err(e @ hingecast_prepare::PrepareError::Cancelled(_)) => Err(failure(e, &recording)),
        // What cannot be compared stays as it was found.
        Err(_) => Ok(report),
    }
}

/// What `build` asks first: whether states have to be brought together.
///
/// # Errors
/// A finding that makes the build worthless, with the advice; the wish to stop.
pub(crate) fn before_build(recording: &Recording, seed: u64, progress: &Progress) -> Result<bool> {
    let report = check(&recording.root, seed, progress)?;
    if let Some(why) = gravest(&report) {
        let hint = format!("{}; `--force` builds all the same", why.hint);
        return Err(Failure { hint, ..why });
    }
    Ok(report.findings.iter().any(|f| f.code == APART && f.severity == Severity::Warning))
}

/// What else may keep scans from coming together: a finding that explains it better than `found` does.
pub(super) fn or_why(found: Failure, recording: &Recording, progress: &Progress) -> Failure {
    look_over(&recording.root, progress).ok().and_then(|report| gravest(&report)).unwrap_or(found)
}

/// The first finding that makes a build worthless.
fn gravest(report: &CheckReport) -> Option<Failure> {
    report.grave().next().map(|f| Failure::new(f.what.clone(), f.place.clone(), f.hint.clone()))
}
