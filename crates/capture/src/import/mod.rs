//! Other layouts of the field into native recordings.
//!
//! Each layout's file lists its pictures as `Shot`s; `store` decodes, brings colour and mask to the
//! size of the depth, undistorts and writes them. World frame and scale stay the source's; `join`
//! puts several sources together, a state each.

mod artgs;
mod bop;
mod colmap;
mod dta;
mod dynamic3dgs;
mod film;
mod foreign;
mod format;
mod grid;
mod join;
mod labels;
mod lens;
mod masks;
mod nerfstudio;
mod numbers;
mod paris;
mod polycam;
mod record3d;
mod resize;
mod scanner3d;
mod screwsplat;
mod store;
mod stray;
mod thin;
mod tum;
mod unpack;

pub use format::{Format, detect};

use crate::{CaptureError, Split};
use glam::DVec3;
use grid::Grid;
use hingecast_geom::{Camera, Progress};
use lens::Lens;
use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use unpack::Scratch;

/// What to import, and how much of it.
#[derive(Clone, Debug, PartialEq)]
pub struct Config {
    /// Layout of all sources; [`Format::Auto`] looks at each.
    pub format: Format,
    /// Pixels of less confidence lose their depth, where the source has confidence maps: 0 low, 1
    /// medium, 2 high (ARKit's scale).
    pub min_confidence: u8,
    /// Of each state, only every so many-th training picture; at least 1.
    pub every: usize,
    /// At most so many training pictures a state, evenly spread.
    pub max_views: usize,
    /// The last of two sources is a film in which hands move the parts that the first, a scan, shows
    /// at rest; of a film, at most so many pictures. Its states are cut later, by who sees depth.
    pub film: Option<usize>,
    /// Folders of masks named as the colour images are, one a source; empty: those of the source.
    pub masks: Vec<PathBuf>,
    /// Numbers that are the object in masks with one a thing; empty: what the source says, or all but 0.
    pub mask_ids: Vec<u16>,
}

/// Pictures of a film that are kept at most: fifteen seconds at 26 a second.
pub const FILM_PICTURES: usize = 400;

impl Default for Config {
    /// ARKit's low confidence is depth it made up at edges. 120 views show a thing from all sides;
    /// a film has thousands, which cost time and add no side.
    fn default() -> Self {
        Self {
            format: Format::Auto,
            min_confidence: 1,
            every: 1,
            max_views: 120,
            masks: Vec::new(),
            mask_ids: Vec::new(),
            film: None,
        }
    }
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
    /// `color` is a film, and this the number of its picture, from 0.
    pub film_frame: Option<usize>,
    /// May be smaller than the colour image.
    pub depth: Option<Grid>,
    /// Scene units per stored unit; depths below `depth_least` (scene units) are invalid.
    pub depth_scale: f64,
    pub depth_least: f64,
    /// Of the depth, pixel by pixel.
    pub confidence: Option<Grid>,
    pub mask: MaskFrom,
    /// Numbers of label images that are the object; empty: all but 0.
    pub mask_ids: Vec<u16>,
    /// Pixels that a hand hides.
    pub occluder: Option<PathBuf>,
    /// The person hides the object.
    pub occluded: bool,
    pub time: Option<f64>,
}

impl Shot {
    /// A training picture of the only state, without depth, its mask in its alpha.
    pub fn of(camera: Camera, color: PathBuf) -> Self {
        Self {
            state: 0,
            split: Split::Train,
            camera,
            lens: Lens::default(),
            color,
            film_frame: None,
            depth: None,
            depth_scale: 1e-3,
            depth_least: 0.0,
            confidence: None,
            mask: MaskFrom::Alpha,
            mask_ids: Vec::new(),
            occluder: None,
            occluded: false,
            time: None,
        }
    }
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
    /// The second state is a film.
    pub film: bool,
    /// What it calls the object, if it says so.
    pub name: Option<String>,
    /// What its maker was not sure of.
    pub doubts: Vec<String>,
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
        Self {
            shots,
            metric: false,
            up: DVec3::Z,
            registered: true,
            film: false,
            name: None,
            doubts: Vec::new(),
            notes: Vec::new(),
        }
    }
}

/// Where the object's mask comes from.
#[derive(Clone, Debug)]
pub(crate) enum MaskFrom {
    /// The colour image's alpha, if it has one.
    Alpha,
    File(PathBuf),
    /// Whatever one of several files shows: a file for each thing.
    Any(Vec<PathBuf>),
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
    not_a_source(sources, out)?;
    masks::one_a_source(sources.len(), config)?;
    crate::synth::may_be_replaced(out)?;
    let mut scratch = Scratch::new(out);
    // Sources and where they are read: zip files are unpacked.
    let mut found = Vec::new();
    convert(sources, out, config, progress, &mut scratch, &mut found).map_err(|mut e| {
        for (at, src) in found.iter().filter(|(at, src)| at != src) {
            e.place = e.place.replace(&at.display().to_string(), &src.display().to_string());
        }
        e
    })
}

/// What is written takes the place of what was there: never that of a source, or of a folder with one
/// in it.
fn not_a_source<P: AsRef<Path>>(sources: &[P], out: &Path) -> Result<(), CaptureError> {
    let Ok(out) = out.canonicalize() else { return Ok(()) };
    let is_there = |src: &&Path| src.canonicalize().is_ok_and(|src| src.starts_with(&out));
    match sources.iter().map(P::as_ref).find(is_there) {
        None => Ok(()),
        Some(src) => {
            let what = format!("the output would take the place of a source: {}", src.display());
            Err(CaptureError::new(what, out.display().to_string(), "another folder: -o RECORDING"))
        }
    }
}

fn convert<P: AsRef<Path>>(
    sources: &[P],
    out: &Path,
    config: &Config,
    progress: &Progress,
    scratch: &mut Scratch,
    found: &mut Vec<(PathBuf, PathBuf)>,
) -> Result<ImportReport, CaptureError> {
    let several = sources.len() > 1;
    if config.film.is_some() && sources.len() != 2 {
        let what = format!("{} scans with a film, and it takes one", sources.len().saturating_sub(1));
        let hint = "one scan of the thing at rest and one film: hingecast import SCAN --film PLAY -o RECORDING";
        return Err(CaptureError::new(what, "--film", hint));
    }
    let mut formats = Vec::new();
    let mut parts = Vec::new();
    for (i, src) in sources.iter().map(P::as_ref).enumerate() {
        progress.check()?;
        let at = find(src, scratch)?;
        found.push((at.clone(), src.to_path_buf()));
        let format = if config.format == Format::Auto { detect(&at)? } else { config.format };
        let mut source = read(&at, format, several)?;
        if !source.shots.iter().any(|s| s.split == Split::Train) {
            let what = format!("no training pictures were found for the layout {}", format.name());
            let hint = "check that the folder is complete, or name another --format";
            return Err(CaptureError::new(what, src.display().to_string(), hint));
        }
        if let Some(folder) = config.masks.get(i) {
            masks::beside(&mut source, &at, folder)?;
        }
        match config.film.filter(|_| parts.len() == 1) {
            Some(most) => thin::thin(&mut source, &Config { max_views: most, every: 1, ..config.clone() }),
            None => thin::thin(&mut source, config),
        }
        film::take_out(&mut source.shots, scratch)?;
        formats.push(format);
        parts.push((src.to_path_buf(), source));
    }
    let mut source = join::join(parts)?;
    source.film = config.film.is_some();
    if !config.mask_ids.is_empty() {
        source.shots.iter_mut().for_each(|s| s.mask_ids.clone_from(&config.mask_ids));
    }
    let name = source.name.clone().unwrap_or_else(|| recording_name(sources, out));
    let (recording, notes) = store::store(&source, &name, out, config.min_confidence, progress)?;
    source.notes.extend(notes);
    Ok(ImportReport {
        recording: recording.root.clone(),
        formats,
        states: recording.n_states,
        frames: recording.frames.len(),
        notes: source.notes,
    })
}

/// The folder (or file) to read: zip files are unpacked, and what holds nothing but one folder is
/// that folder.
fn find(src: &Path, scratch: &mut Scratch) -> Result<PathBuf, CaptureError> {
    let mut found = src.to_path_buf();
    if !src.exists() {
        let hint = "check the path: a folder, or a .r3d or .zip";
        return Err(CaptureError::new("the source is not there", src.display().to_string(), hint));
    }
    if src.is_file() && unpack::is_zip(src) {
        found = scratch.folder()?;
        unpack::unpack(src, &found)?;
    } else if src.is_file() {
        return foreign::refuse(src).map_or(Ok(found), Err);
    }
    while found.is_dir() && format::known(&found).is_none() {
        match &subfolders(&found)[..] {
            [only] => found = only.clone(),
            _ if src.is_file() => return Err(foreign::zip_of_something_else(src)),
            // Not known: say so about what was given.
            _ => return Ok(src.to_path_buf()),
        }
    }
    Ok(found)
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
        Format::Record3d => record3d::read(src)?,
        Format::Scanner3d => scanner3d::read(src)?,
        Format::Stray => stray::read(src)?,
        Format::Polycam => polycam::read(src)?,
        Format::Colmap => colmap::read(src)?,
        Format::Bop => bop::read(src)?,
        Format::Tum => tum::read(src)?,
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
