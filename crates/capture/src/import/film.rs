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

/// Each picture once, whatever its time: else ffmpeg fills gaps with copies. The second is how
/// ffmpeg before 5.1 calls it; newer ones know only the first.
const AS_THEY_ARE: [[&str; 2]; 2] = [["-fps_mode", "passthrough"], ["-vsync", "0"]];

fn extract(film: &Path, pictures: &BTreeSet<usize>, folder: &Path) -> Result<(), CaptureError> {
    let select = any_of(&pictures.iter().copied().collect::<Vec<usize>>());
    let rgb = film.with_file_name("rgb");
    let by_hand = format!("install ffmpeg, or take the pictures out yourself: {}", command(film, &rgb));
    let absolute = std::path::absolute(film).map_err(|e| CaptureError::read(film, e))?;
    let mut said = String::new();
    for mode in AS_THEY_ARE {
        // Turned pictures would not fit their cameras.
        let output = Command::new("ffmpeg")
            .args(["-nostdin", "-v", "error", "-noautorotate", "-i"])
            .arg(&absolute)
            .args(["-vf", &format!("select='{select}'")])
            .args(mode)
            .args(["-start_number", "0", "-qscale:v", "2"])
            // Not with its folder, whose name may have a % as well.
            .arg("%06d.jpg")
            .current_dir(folder)
            .stdin(Stdio::null())
            .output()
            .map_err(|e| {
                let what = format!("the pictures are in a film, and ffmpeg cannot be started: {e}");
                CaptureError::new(what, film.display().to_string(), by_hand.clone())
            })?;
        if output.status.success() {
            return whole(film, pictures.len(), folder);
        }
        said = String::from_utf8_lossy(&output.stderr).into_owned();
        if !said.contains("fps_mode") {
            break;
        }
    }
    let last = said.lines().next_back().unwrap_or("no reason given");
    Err(CaptureError::new(format!("ffmpeg failed: {last}"), film.display().to_string(), by_hand))
}

/// ffmpeg's expression that is not 0 for these pictures. Sums of halves: it gives up on expressions
/// that are nested deeper than 100, and a plain sum of 120 terms is.
fn any_of(pictures: &[usize]) -> String {
    match pictures {
        [] => "0".into(),
        [i] => format!("eq(n\\,{i})"),
        _ => {
            let (a, b) = pictures.split_at(pictures.len() / 2);
            format!("({}+{})", any_of(a), any_of(b))
        }
    }
}

fn whole(film: &Path, wanted: usize, folder: &Path) -> Result<(), CaptureError> {
    let got = std::fs::read_dir(folder).map_or(0, |entries| entries.count());
    if got == wanted {
        return Ok(());
    }
    Err(CaptureError::new(
        format!("the film gave {got} of {wanted} pictures: it has fewer than the app noted"),
        film.display().to_string(),
        "copy the film again; it may be cut short",
    ))
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

#[cfg(test)]
mod tests {
    use super::any_of;

    /// The default of 120 pictures was once too much for ffmpeg.
    #[test]
    fn long_lists_stay_flat() {
        assert_eq!(any_of(&[3, 5, 9]), "(eq(n\\,3)+(eq(n\\,5)+eq(n\\,9)))");
        let many = any_of(&(0..2000).collect::<Vec<_>>());
        let mut depth = 0i32;
        let deepest = many.chars().map(|c| {
            depth += i32::from(c == '(') - i32::from(c == ')');
            depth
        });
        assert!(deepest.max().unwrap() <= 13);
    }
}
