//! A film of play: its pictures placed on the scan, cut into states; and the hands in it.

use super::masks::{Pixels, write_pixels};
use super::raw_depths::RawDepths;
use super::words::failure;
use super::{put_cameras, register, settle};
use crate::failure::{Failure, Result};
use hingecast_articulate::{Config, Depths, find};
use hingecast_capture::{Frame, Recording, Split};
use hingecast_geom::{Pose, Progress};
use hingecast_prepare::film::{Cut, Placing, cut, onto};
use hingecast_prepare::hands::{Belief, hands};
use hingecast_prepare::{PrepareError, Registration};
use serde::{Deserialize, Serialize};
use std::path::Path;

/// States that a film is cut into, the scan among them, unless a person says otherwise.
pub const FILM_STATES: usize = 30;
/// Cells along the object's longest side, in which hands are told from parts.
const CELLS: usize = 64;
/// Parts that are sought then, hands among them.
const MOST_PARTS: usize = 8;
/// Passes that give the last digits, which hands do not need.
const SKIPPED: [&str; 3] = ["turn_axes", "far_hinges", "align_axes"];
/// More of the object's pixels than this are no hand: the parts are wrong.
const TOO_MANY: f64 = 0.6;

/// What became of a film.
#[derive(Clone, Debug)]
pub struct Film {
    /// How the film as a whole lies to the scan.
    pub registration: Registration,
    /// How its pictures lie on the scan.
    pub placing: Placing,
    /// Its states; picture numbers count in the film.
    pub cut: Cut,
    /// How many pictures it had.
    pub pictures: usize,
}

/// Cuts the film of a recording that `import` made of a scan (state 0) and a film (state 1) into at most
/// `most` states, the scan among them, all in the scan's frame. Pictures that no state has are deleted.
///
/// # Errors
/// A film that does not fit the scan, or of which hardly anything is left; a picture that cannot be read
/// or deleted; the wish to stop.
pub fn film(recording: &mut Recording, most: usize, seed: u64, progress: &Progress) -> Result<Film> {
    settle(recording, false, progress)?;
    let registration = register(recording, seed, progress)?;
    let error = |e: PrepareError| failure(e, recording);
    let mut depths = RawDepths::new(recording);
    let scan = depths.views(0).map_err(PrepareError::Depths).map_err(error)?;
    let mut pictures = depths.views(1).map_err(PrepareError::Depths).map_err(error)?;
    let placing = onto(&scan, &mut pictures, progress).map_err(error)?;
    let cut = cut(&pictures, most.saturating_sub(1), progress).map_err(error)?;
    if cut.states.is_empty() {
        let place = recording.root.display().to_string();
        return Err(Failure::new("the film has no pictures", place, "film while the parts are moved, for 5 s or more"));
    }
    let cameras: Vec<Pose> = scan.iter().chain(&pictures).map(|view| view.camera.camera_from_world).collect();
    put_cameras(recording, &cameras);
    let n = pictures.len();
    let of_film: Vec<usize> = recording.frames_of(1, Split::Train);
    let mut kept: Vec<Frame> = recording.frames.iter().filter(|f| f.state == 0).cloned().collect();
    let mut keeps = vec![false; recording.frames.len()];
    for (state, views) in cut.states.iter().enumerate() {
        for (view, &picture) in views.iter().enumerate() {
            let frame = of_film[picture];
            keeps[frame] = true;
            kept.push(Frame { state: state + 1, view, ..recording.frames[frame].clone() });
        }
    }
    let before = std::mem::replace(&mut recording.frames, kept);
    recording.n_states = 1 + cut.states.len();
    recording.write()?;
    let gone = before.iter().zip(&keeps).filter(|(f, kept)| f.state == 1 && !**kept).map(|(f, _)| f);
    for file in gone.flat_map(|f| [Some(&f.color), f.depth.as_ref(), f.mask.as_ref()]).flatten() {
        std::fs::remove_file(file).map_err(Failure::io(file))?;
    }
    Ok(Film { registration, placing, cut, pictures: n })
}

/// What was cut, for a person.
pub fn film_sentences(film: &Film) -> Vec<String> {
    let Film { placing, cut, pictures, .. } = film;
    let single = cut.states.len() - cut.rests;
    let mut out = vec![
        format!(
            "film: {pictures} pictures cut into {} states - {} rests and {single} single pictures -, {} pictures left out",
            cut.states.len(),
            cut.rests,
            cut.left_out
        ),
        format!(
            "film: its pictures lie {:.4} scene units off the scan's surface (median); drift of up to {:.2} deg and {:.4} \
             scene units was taken out",
            placing.off,
            placing.farthest.0.to_degrees(),
            placing.farthest.1
        ),
    ];
    if placing.lost > 0 {
        out.push(format!("doubt: {} pictures of the film could not be placed on the scan", placing.lost));
    }
    out
}

/// The hands that were found in a film.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct HandReport {
    /// Share of the object's masked pixels in the film that are hands.
    pub share: f64,
    /// Parts that only hands had: the scan shows next to nothing of them.
    pub phantoms: usize,
    /// Whether the masks were believed and written.
    pub used: bool,
}

/// Finds what no part explains in the pictures of a film and writes it into `folder`, as occluders of the
/// frames.
///
/// # Errors
/// A search that fails, a picture that cannot be read or written, the wish to stop.
pub(super) fn find_hands(
    recording: &mut Recording,
    folder: &Path,
    seed: u64,
    progress: &Progress,
) -> Result<HandReport> {
    let config = Config {
        cells: CELLS,
        max_parts: MOST_PARTS,
        align_cameras: false,
        held: false,
        borders: false,
        resample: false,
        film: true,
        seed,
        skip: SKIPPED.map(String::from).to_vec(),
    };
    let mut depths = RawDepths::all_masked(recording);
    let found = find(&mut depths, &config, progress)?;
    let belief = Belief { tree: &found.tree, cameras: &found.cameras, samples: &found.samples };
    let mut found = hands(&mut depths, &belief, progress).map_err(|e| failure(e, recording))?;
    let used = found.share <= TOO_MANY;
    let report = HandReport { share: found.share, phantoms: found.phantoms, used };
    if used {
        // Of the scan there are none.
        found.masks[0].clear();
        write_pixels(recording, &found.masks, Pixels::Hand, folder)?;
    }
    Ok(report)
}

/// What of a film was taken for hands, for a person.
pub(super) fn hands_sentence(found: &HandReport) -> String {
    let percent = 100.0 * found.share;
    match found.used {
        true => format!("hands: {percent:.0} % of the object's pixels in the film belong to no part and are left out"),
        false => format!("hands: none believed; {percent:.0} % of the object's pixels in the film fit no part"),
    }
}

/// What is doubtful about them.
pub(super) fn hands_doubt(found: &HandReport) -> Option<String> {
    let percent = 100.0 * found.share;
    (!found.used).then(|| {
        format!(
            "{percent:.0} % of the object's pixels in the film fit no part: too many for hands; the parts may be wrong, and \
             hands are in the twin"
        )
    })
}
