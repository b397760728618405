//! Files and folders that appear whole or not at all, also when the process is killed or the
//! machine loses its power.
//!
//! ```text
//! PARENT/.NAME.hingecast-<process>-<random>/hingecast-staging   locked while the process lives
//!                                          /new                 what is being written
//!                                          /old                 what stood at NAME, between the two renames
//! ```
//! The name cannot be a person's and is made with `create_dir`, so nothing of anybody's is ever
//! taken over. What a killed process left is removed by the next one that writes the same NAME:
//! only if it has such a name, holds the mark, and its process is gone.

use rayon::prelude::*;
use std::ffi::{OsStr, OsString};
use std::fs::{self, File};
use std::io::{ErrorKind, Result, Write};
use std::path::{Path, PathBuf};

/// The file that says: this folder is hingecast's.
const MARK: &str = "hingecast-staging";
const MARK_TEXT: &[u8] = b"A folder that hingecast fills. No hingecast running? Then it may be deleted.\n";
/// Names may have 255 bytes; ours adds some 40.
const LONGEST_STEM: usize = 120;

/// A folder that is filled out of sight and takes its place when all is there.
#[derive(Debug)]
pub struct Staging {
    target: PathBuf,
    container: PathBuf,
    /// Holds the lock that says that somebody is at work here.
    _mark: File,
}

impl Staging {
    /// Nothing happens at `target` before [`Self::finish`]. A link stays a link: the folder that it
    /// names is replaced.
    ///
    /// # Errors
    /// When the folder around `target` cannot be made or written.
    pub fn new(target: &Path) -> Result<Self> {
        let target = fs::canonicalize(target).or_else(|_| std::path::absolute(target))?;
        let parent = parent(&target);
        fs::create_dir_all(parent)?;
        sweep(&target);
        let container = fresh(&target, |path| fs::create_dir(path).map(|()| path.to_path_buf()))?;
        let mut mark = File::create_new(container.join(MARK))?;
        // Where the disk knows no locks, the process number alone says who lives.
        let _ = mark.try_lock();
        mark.write_all(MARK_TEXT)?;
        let staging = Self { target, container, _mark: mark };
        fs::create_dir(staging.path())?;
        Ok(staging)
    }

    /// The folder to fill.
    pub fn path(&self) -> PathBuf {
        self.container.join("new")
    }

    /// Puts what was filled at the target; what stood there is renamed away first and deleted last.
    ///
    /// # Errors
    /// When the disk refuses; the old folder is then back in its place.
    pub fn finish(self) -> Result<()> {
        let (new, old) = (self.path(), self.container.join("old"));
        sync_below(&new)?;
        let replaces = fs::symlink_metadata(&self.target).is_ok();
        if replaces {
            fs::rename(&self.target, &old)?;
        }
        if let Err(e) = fs::rename(&new, &self.target) {
            if replaces {
                fs::rename(&old, &self.target)?;
            }
            return Err(e);
        }
        if replaces {
            // From here on nobody puts it back.
            fs::rename(&old, self.container.join("gone"))?;
        }
        sync_folder(parent(&self.target))
    }
}

impl Drop for Staging {
    fn drop(&mut self) {
        let _ = remove(&self.container);
    }
}

/// Lets `write` make the file `path` out of sight, and renames it into place: a reader never sees
/// half a file.
///
/// # Errors
/// `write`'s own; else when the disk refuses. What stood at `path` is then untouched.
pub fn write_through<E: From<std::io::Error>>(
    path: &Path,
    write: impl FnOnce(&Path) -> std::result::Result<(), E>,
) -> std::result::Result<(), E> {
    let staging = Staging::new(path)?;
    let new = staging.path().join("file");
    write(&new)?;
    File::open(&new)?.sync_all()?;
    fs::rename(&new, &staging.target)?;
    Ok(sync_folder(parent(&staging.target))?)
}

/// Writes `bytes` under a name that nobody has and renames: a reader never sees half a file, and
/// after the return a power cut takes nothing back. A link stays a link: the file that it names is
/// written.
///
/// # Errors
/// When the disk refuses; what stood at `path` is then untouched.
pub fn write_whole(path: &Path, bytes: &[u8]) -> Result<()> {
    let target = fs::canonicalize(path).or_else(|_| std::path::absolute(path))?;
    sweep(&target);
    write_renamed(&target, bytes, true)?;
    sync_folder(parent(&target))
}

/// As [`write_whole`], but not forced to the disk: for the thousands of files of a [`Staging`],
/// which does that once for all, and for pictures that can be drawn again.
///
/// # Errors
/// When the disk refuses.
pub fn write_quick(path: &Path, bytes: &[u8]) -> Result<()> {
    write_renamed(&std::path::absolute(path)?, bytes, false)
}

fn write_renamed(target: &Path, bytes: &[u8], sync: bool) -> Result<()> {
    let (temporary, mut file) = fresh(target, |at| Ok((at.to_path_buf(), File::create_new(at)?)))?;
    let _ = file.try_lock();
    let written = file
        .write_all(bytes)
        .and_then(|()| if sync { file.sync_all() } else { Ok(()) })
        .and_then(|()| fs::rename(&temporary, target));
    if written.is_err() {
        let _ = fs::remove_file(&temporary);
    }
    written
}

/// Whether a file can be written at `file`, without touching what may stand there.
///
/// # Errors
/// When it cannot.
pub fn probe(file: &Path) -> Result<()> {
    let at = fresh(&std::path::absolute(file)?, |at| File::create_new(at).map(|_| at.to_path_buf()))?;
    fs::remove_file(at)
}

/// Removes what killed processes left beside `target`, under `target`'s name; puts an old folder
/// back that was renamed away and not replaced. What cannot be removed stays: it harms nobody.
fn sweep(target: &Path) {
    let entries = fs::read_dir(parent(target)).into_iter().flatten().flatten();
    let stem = stem(target);
    for entry in entries.filter(|e| process_of(&e.file_name()).is_some_and(|(of, _)| of == stem)) {
        clear(&entry.path(), Some(target));
    }
}

/// Removes a folder in one step, as seen from outside: killed on the way, nothing of it is left
/// under its name.
///
/// # Errors
/// When the disk refuses.
pub fn remove_folder(folder: &Path) -> Result<()> {
    let staging = Staging::new(folder)?;
    fs::rename(&staging.target, staging.container.join("gone"))
}

/// Removes what killed processes left in `folder`, whatever it was for.
pub fn sweep_folder(folder: &Path) {
    for entry in fs::read_dir(folder).into_iter().flatten().flatten() {
        clear(&entry.path(), None);
    }
}

/// Whether a name is one of ours for unfinished work.
pub fn is_temporary(name: &OsStr) -> bool {
    process_of(name).is_some()
}

fn clear(path: &Path, target: Option<&Path>) {
    let Some((_, process)) = path.file_name().and_then(process_of) else { return };
    let Ok(meta) = fs::symlink_metadata(path) else { return };
    if lives(process) {
        return;
    }
    // Another container's processes are not in our /proc, but their locks are on our disk.
    let locked =
        |file: &Path| File::open(file).is_ok_and(|f| matches!(f.try_lock(), Err(fs::TryLockError::WouldBlock)));
    if meta.is_file() {
        if !locked(path) {
            let _ = fs::remove_file(path);
        }
        return;
    }
    let mark = path.join(MARK);
    if !meta.is_dir() || locked(&mark) {
        return;
    }
    if !mark.is_file() {
        // Killed before the mark was there: an empty folder goes, any other stays.
        let _ = fs::remove_dir(path);
        return;
    }
    let old = path.join("old");
    if fs::symlink_metadata(&old).is_ok() {
        // Two renames, killed between them. Where something new stands at the target, the old is
        // superseded.
        match target {
            Some(target) if fs::symlink_metadata(target).is_err() => {
                if fs::rename(&old, target).is_err() {
                    return;
                }
            }
            Some(_) => {}
            None => return,
        }
    }
    let _ = remove(path);
}

/// The mark goes last: a removal that was killed is known for ours.
fn remove(container: &Path) -> Result<()> {
    for entry in fs::read_dir(container)?.flatten().filter(|e| e.file_name() != MARK) {
        let is_folder = entry.file_type()?.is_dir();
        if is_folder { fs::remove_dir_all(entry.path())? } else { fs::remove_file(entry.path())? }
    }
    fs::remove_file(container.join(MARK))?;
    fs::remove_dir(container)
}

/// False only where that is certain.
fn lives(process: u32) -> bool {
    let all = Path::new("/proc");
    // Without a /proc the locks decide.
    all.join("self").exists() && all.join(process.to_string()).exists()
}

/// Tries `make` with names of ours beside `target` until one is free.
fn fresh<T>(target: &Path, make: impl Fn(&Path) -> Result<T>) -> Result<T> {
    let mut random = fastrand::Rng::new();
    loop {
        let mut name = OsString::from(".");
        name.push(stem(target));
        name.push(format!(".hingecast-{}-{:016x}", std::process::id(), random.u64(..)));
        match make(&parent(target).join(name)) {
            Err(e) if e.kind() == ErrorKind::AlreadyExists => {}
            made => return made,
        }
    }
}

/// The name of what is written, as part of ours.
fn stem(target: &Path) -> OsString {
    let name = target.file_name().unwrap_or_default();
    if name.len() <= LONGEST_STEM {
        return name.to_os_string();
    }
    let text = name.to_string_lossy();
    text.char_indices()
        .take_while(|(at, c)| at + c.len_utf8() <= LONGEST_STEM)
        .map(|(_, c)| c)
        .collect::<String>()
        .into()
}

/// Stem and process of a name of ours.
fn process_of(name: &OsStr) -> Option<(OsString, u32)> {
    let name = name.to_str()?.strip_prefix('.')?;
    let (stem, tail) = name.rsplit_once(".hingecast-")?;
    let (process, random) = tail.split_once('-')?;
    let digits = |text: &str, radix: u32| text.chars().all(|c| c.is_digit(radix) && !c.is_ascii_uppercase());
    let ours = digits(process, 10) && random.len() == 16 && digits(random, 16);
    ours.then(|| process.parse().ok()).flatten().map(|process| (stem.into(), process))
}

fn parent(path: &Path) -> &Path {
    path.parent().unwrap_or(Path::new("/"))
}

/// Every file and folder below `folder`, and itself, is on the disk.
fn sync_below(folder: &Path) -> Result<()> {
    let (mut folders, mut files) = (vec![folder.to_path_buf()], Vec::new());
    let mut at = 0;
    while at < folders.len() {
        for entry in fs::read_dir(&folders[at])? {
            let entry = entry?;
            let kind = entry.file_type()?;
            if kind.is_dir() {
                folders.push(entry.path());
            } else if kind.is_file() {
                files.push(entry.path());
            }
        }
        at += 1;
    }
    files.par_iter().try_for_each(|file| File::open(file)?.sync_all())?;
    folders.iter().rev().try_for_each(|folder| sync_folder(folder))
}

/// A rename is on the disk when its folder is. Only Unix opens folders as files.
fn sync_folder(folder: &Path) -> Result<()> {
    if cfg!(unix) { File::open(folder)?.sync_all() } else { Ok(()) }
}
