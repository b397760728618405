//! Several scans, one a state, into one recording.

use super::Source;
use crate::CaptureError;
use glam::{DQuat, DVec3};
use hingecast_geom::Pose;
use std::path::{Path, PathBuf};

/// Ups that differ by less than this are one, radians.
const SAME_UP: f64 = 1e-6;

/// Each source becomes a state, in the order given. Worlds stay the sources' own; only where they
/// disagree about what is up, all are turned so that z is.
///
/// # Errors
/// When a source has several states itself, or lengths of one are metres and of another are not.
pub(super) fn join(parts: Vec<(PathBuf, Source)>) -> Result<Source, CaptureError> {
    let alone = parts.len() == 1;
    for (path, source) in &parts {
        let states = source.states();
        if states > 1 && !alone {
            return Err(CaptureError::new(
                format!("one of several sources has {states} states itself"),
                path.display().to_string(),
                "several sources are one state each: import this one alone, or split it into a folder a state",
            ));
        }
    }
    let Some((first, base)) = parts.first() else { return Ok(Vec::new().into()) };
    if let Some((other, _)) = parts.iter().find(|(_, s)| s.metric != base.metric) {
        let (metres, units) = if base.metric { (first, other) } else { (other, first) };
        return Err(CaptureError::new(
            "one source is in metres, another says nothing of its scale",
            format!("metres: {}; unknown: {}", metres.display(), units.display()),
            "export all states with the same app; if it is metres, too: \"metric\": true in its transforms.json",
        ));
    }
    let (metric, up) = (base.metric, base.up);
    let agree = parts.iter().all(|(_, s)| s.up.angle_between(up) < SAME_UP);
    let mut all = Source { metric, up: if agree { up } else { DVec3::Z }, ..Vec::new().into() };
    for (state, (path, mut source)) in parts.into_iter().enumerate() {
        if !agree {
            turn_up(&mut source);
        }
        if !alone {
            source.shots.iter_mut().for_each(|s| s.state = state);
        }
        // One name for all that have one, or none.
        all.name = if state == 0 { source.name } else { all.name.filter(|name| source.name.as_ref() == Some(name)) };
        all.doubts.extend(source.doubts);
        all.registered &= alone && source.registered;
        all.shots.extend(source.shots);
        all.notes.extend(source.notes.into_iter().map(|note| name(&path, note, alone)));
    }
    if !alone {
        all.notes.push(format!("{} scans were put together, each in a world frame of its own so far", all.states()));
    }
    Ok(all)
}

/// Turns the world so that z is up.
fn turn_up(source: &mut Source) {
    let z_from_up = Pose::new(DQuat::from_rotation_arc(source.up, DVec3::Z), DVec3::ZERO);
    let up_from_z = z_from_up.inverse();
    for shot in &mut source.shots {
        let pose = &mut shot.camera.camera_from_world;
        *pose = Pose::new((pose.rot * up_from_z.rot).normalize(), pose.trans);
    }
    source.up = DVec3::Z;
}

/// A note says which source it is about, where there are several.
fn name(path: &Path, note: String, alone: bool) -> String {
    if alone { note } else { format!("{}: {note}", path.display()) }
}
