//! Other layouts of the field into native recordings.
//!
//! Each layout's file lists its pictures as `Shot`s; `store` decodes, undistorts, brings depth and
//! mask to the colour's size and writes them. World frame and scale stay the source's; `join` puts
//! several sources together, a state each.

mod artgs;
mod dta;
mod dynamic3dgs;
mod format;
mod join;
mod lens;
mod nerfstudio;
mod numbers;
mod paris;
mod screwsplat;
mod store;

pub use format::{Format, detect};

use crate::{CaptureError, Split};
use glam::DVec3;
use hingecast_geom::{Camera, Progress};
use lens::Lens;
use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

/// What to import, and how much of it.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Config {
    /// Layout of all sources; [`Format::Auto`] looks at each.
    pub format: Format,
}

/// What was imported.
#[derive(Clone, Debug)]
pub struct ImportReport {
    /// Folder of the native recording.
    pub recording: PathBuf,
    /// The layout of each source; never [`Format::Auto`].
    pub formats: Vec<Format>,
    /// How many joint states it has.
    pub states: usize,
    /// How many frames it has, over all states.
    pub frames: usize,
    /// What a person should know: what was left out, resized or assumed. One sentence each.
    pub notes: Vec<String>,
}

/// One picture of a source, geometry converted to our conventions, pixels not read yet.
#[derive(Clone, Debug)]
pub(crate) struct Shot {
    pub state: usize,
    pub split: Split,
    /// Pinhole part, OpenCV axes. Width and height 0: take the colour image's.
    pub camera: Camera,
    pub lens: Lens,
    pub color: PathBuf,
    pub depth: Option<PathBuf>,
    /// Scene units per stored unit; depths below `depth_least` (scene units) are invalid.
    pub depth_scale: f64,
    pub depth_least: f64,
    pub mask: MaskFrom,
    /// Pixels that a hand hides.
    pub occluder: Option<PathBuf>,
    /// The person hides the object.
    pub occluded: bool,
    pub time: Option<f64>,
}

/// All pictures of a source, and what it says about its world.
pub(crate) struct Source {
    pub shots: Vec<Shot>,
    /// Lengths are metres.
    pub metric: bool,
    /// Unit vector.
    pub up: DVec3,
    /// All states share one world.
    pub registered: bool,
    /// See [`ImportReport::notes`].
    pub notes: Vec<String>,
}

impl Source {
    /// How many joint states there are.
    fn states(&self) -> usize {
        self.shots.iter().map(|s| s.state).collect::<BTreeSet<_>>().len()
    }
}

impl From<Vec<Shot>> for Source {
    /// Layouts that say nothing of scale and up.
    fn from(shots: Vec<Shot>) -> Self {
        Self { shots, metric: false, up: DVec3::Z, registered: true, notes: Vec::new() }
    }
}

/// Where the object's mask comes from.
#[derive(Clone, Debug)]
pub(crate) enum MaskFrom {
    /// The colour image's alpha, if it has one.
    Alpha,
    File(PathBuf),
}

/// Converts sources into a native recording at `out`. One source may have several states; several
/// sources are one state each, in the order given.
///
/// # Errors
/// When a layout is not recognised, a file of it is missing or broken, one of several sources has
/// several states, or `out` holds something that is no recording.
pub fn import<P: AsRef<Path>>(
    sources: &[P],
    out: &Path,
    config: &Config,
    progress: &Progress,
) -> Result<ImportReport, CaptureError> {
    crate::synth::may_be_replaced(out)?;
    let several = sources.len() > 1;
    let mut formats = Vec::new();
    let mut parts = Vec::new();
    for src in sources.iter().map(P::as_ref) {
        progress.check()?;
        let format = if config.format == Format::Auto { detect(src)? } else { config.format };
        let source = read(src, format, several)?;
        if !source.shots.iter().any(|s| s.split == Split::Train) {
            let hint = "check that the folder is complete, or name another --format";
            return Err(CaptureError::new(
                format!("no training pictures were found for the layout {}", format.name()),
                src.display().to_string(),
                hint,
            ));
        }
        formats.push(format);
        parts.push((src.to_path_buf(), source));
    }
    let source = join::join(parts)?;
    let name = recording_name(sources, out);
    let recording = store::store(&source, &name, out, progress)?;
    Ok(ImportReport {
        recording: recording.root.clone(),
        formats,
        states: recording.n_states,
        frames: recording.frames.len(),
        notes: source.notes,
    })
}

/// The pictures of one source. `several`: it is one of several, and one state.
fn read(src: &Path, format: Format, several: bool) -> Result<Source, CaptureError> {
    Ok(match format {
        Format::Auto | Format::Nerfstudio => nerfstudio::read(src, several)?,
        Format::Artgs => artgs::read(src)?.into(),
        Format::Dta => dta::read(src)?.into(),
        Format::Paris => paris::read(src)?.into(),
        Format::Screwsplat => screwsplat::read(src)?.into(),
        Format::Dynamic3dgs => dynamic3dgs::read(src)?.into(),
    })
}

/// The name of the only source, or of the recording's folder.
fn recording_name<P: AsRef<Path>>(sources: &[P], out: &Path) -> String {
    let from = if let [only] = sources { only.as_ref() } else { out };
    let name = if from.is_file() { from.file_stem() } else { from.file_name() };
    name.map_or_else(|| "recording".into(), |n| n.to_string_lossy().into_owned())
}

/// Folders inside `src`; those named by numbers in numeric order, then the others by name.
fn subfolders(src: &Path) -> Vec<PathBuf> {
    let mut found: Vec<PathBuf> =
        std::fs::read_dir(src).into_iter().flatten().flatten().map(|e| e.path()).filter(|p| p.is_dir()).collect();
    let number = |p: &PathBuf| {
        let name = p.file_name()?.to_str()?;
        name.trim_start_matches(|c: char| !c.is_ascii_digit()).parse::<u64>().ok()
    };
    found.sort_by_key(|p| (number(p).unwrap_or(u64::MAX), p.clone()));
    found
}
