//! Pictures out of films, by an `ffmpeg` that is installed.

use super::Shot;
use super::unpack::Scratch;
use crate::CaptureError;
use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

/// Puts a file in the place of each picture that is still in a film: those that thinning left, in
/// one pass over each film.
///
/// # Errors
/// When there is no ffmpeg, or it does not give as many pictures as were asked for.
pub(super) fn take_out(shots: &mut [Shot], scratch: &mut Scratch) -> Result<(), CaptureError> {
    let mut wanted = BTreeMap::<PathBuf, BTreeSet<usize>>::new();
    for shot in shots.iter() {
        if let Some(i) = shot.film_frame {
            wanted.entry(shot.color.clone()).or_default().insert(i);
        }
    }
    for (film, pictures) in wanted {
        let folder = scratch.folder()?;
        extract(&film, &pictures, &folder)?;
        let order: BTreeMap<usize, usize> = pictures.iter().enumerate().map(|(k, i)| (*i, k)).collect();
        for shot in shots.iter_mut().filter(|s| s.color == film) {
            if let Some(k) = shot.film_frame.take().and_then(|i| order.get(&i)) {
                shot.color = folder.join(format!("{k:06}.jpg"));
            }
        }
    }
    Ok(())
}

fn extract(film: &Path, pictures: &BTreeSet<usize>, folder: &Path) -> Result<(), CaptureError> {
    let select = pictures.iter().map(|i| format!("eq(n\\,{i})")).collect::<Vec<_>>().join("+");
    // New times without gaps: else ffmpeg fills them with copies. Turned pictures would not fit the
    // cameras.
    let filter = format!("select='{select}',setpts=N/FRAME_RATE/TB");
    let by_hand =
        format!("install ffmpeg, or take the pictures out yourself: {}", command(film, &film.with_file_name("rgb")));
    let output = Command::new("ffmpeg")
        .args(["-nostdin", "-v", "error", "-noautorotate", "-i"])
        .arg(film)
        .args(["-vf", &filter, "-start_number", "0", "-qscale:v", "2"])
        .arg(folder.join("%06d.jpg"))
        .stdin(Stdio::null())
        .output()
        .map_err(|e| {
            let what = format!("the pictures are in a film, and ffmpeg cannot be started: {e}");
            CaptureError::new(what, film.display().to_string(), by_hand.clone())
        })?;
    if !output.status.success() {
        let said = String::from_utf8_lossy(&output.stderr);
        let last = said.lines().next_back().unwrap_or("no reason given");
        return Err(CaptureError::new(format!("ffmpeg failed: {last}"), film.display().to_string(), by_hand));
    }
    let got = std::fs::read_dir(folder).map_or(0, |entries| entries.count());
    if got != pictures.len() {
        return Err(CaptureError::new(
            format!("the film gave {got} of {} pictures: it has fewer than the app noted", pictures.len()),
            film.display().to_string(),
            "copy the film again; it may be cut short",
        ));
    }
    Ok(())
}

/// What takes all pictures out of a film, numbered from 0 (ffmpeg 5.1 and newer; before, `-vsync
/// 0`).
pub(super) fn command(film: &Path, folder: &Path) -> String {
    format!(
        "mkdir {0}; ffmpeg -noautorotate -i {1} -fps_mode passthrough -start_number 0 -qscale:v 2 {0}/%06d.jpg",
        folder.display(),
        film.display()
    )
}
