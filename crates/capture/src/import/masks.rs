//! Masks that lie in a folder of their own, named as the colour images are: what a segmenter wrote.

use super::{Config, MaskFrom, Shot, Source, subfolders};
use crate::CaptureError;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// Folders that a message lists.
const LISTED: usize = 12;

/// Refuses folders of masks that do not belong to sources, one to one.
pub(super) fn one_a_source(sources: usize, config: &Config) -> Result<(), CaptureError> {
    let folders = config.masks.len();
    if folders == 0 || folders == sources {
        return Ok(());
    }
    let what = format!("{sources} sources, but {folders} folders of masks");
    let place = config.masks.iter().map(|p| p.display().to_string()).collect::<Vec<_>>().join(", ");
    Err(CaptureError::new(what, place, "name a folder of masks for each source, in their order: --masks A --masks B"))
}

/// Takes the masks of `folder` for the pictures of a source that is read at `at`. A picture's mask has
/// its path or its name, with the ending of an image; names that are numbers match by value. Pictures
/// without one are left out, and a note says how many.
///
/// # Errors
/// When the folder is missing, holds a folder for each thing, or has no mask of any picture.
pub(super) fn beside(source: &mut Source, at: &Path, folder: &Path) -> Result<(), CaptureError> {
    let by_path = source.shots.iter().any(|shot| of_path(shot, at, folder).is_some());
    let files = Files::of(folder, by_path)?;
    let before = source.shots.len();
    let example = source.shots.first().map(|s| s.color.clone()).unwrap_or_default();
    source.shots.retain_mut(|shot| {
        let Some(file) = of_path(shot, at, folder).or_else(|| files.of_shot(shot)) else { return false };
        shot.mask = MaskFrom::File(file);
        true
    });
    let after = source.shots.len();
    if after == 0 {
        let stem = example.file_stem().unwrap_or_default().to_string_lossy();
        let what = format!("none of the {before} pictures has a mask in this folder");
        let hint = format!("masks are named as the pictures are: {stem}.png for {}", example.display());
        return Err(CaptureError::new(what, folder.display().to_string(), hint));
    }
    if after < before {
        let without = before - after;
        source.notes.push(format!("{without} of {before} pictures have no mask in {}: left out", folder.display()));
    }
    Ok(())
}

/// The file that has a picture's path below the source: with its folder of pictures, or without.
fn of_path(shot: &Shot, at: &Path, folder: &Path) -> Option<PathBuf> {
    let own = shot.color.strip_prefix(at).ok().filter(|_| shot.film_frame.is_none())?;
    let above = own.parent().filter(|p| !p.as_os_str().is_empty())?;
    let without =
        above.parent().filter(|p| !p.as_os_str().is_empty()).map(|p| p.join(own.file_name().unwrap_or_default()));
    let all = std::iter::once(own.to_path_buf()).chain(without);
    all.flat_map(|p| ["png", "jpg", "jpeg"].map(|e| folder.join(p.with_extension(e)))).find(|p| p.is_file())
}

/// Images of a folder.
struct Files {
    by_stem: BTreeMap<String, PathBuf>,
    by_number: BTreeMap<u64, PathBuf>,
}

impl Files {
    /// `by_path`: folders inside are the pictures' own, not those of things.
    fn of(folder: &Path, by_path: bool) -> Result<Self, CaptureError> {
        let own = images(folder);
        let of_things: Vec<(PathBuf, usize)> =
            subfolders(folder).into_iter().map(|f| (f.clone(), images(&f).len())).filter(|(_, n)| *n > 0).collect();
        match (&own[..], &of_things[..]) {
            ([], _) if by_path => {}
            ([], []) => {
                let what = "there are no masks in this folder";
                let hint = "masks are PNG (or JPEG) files, named as the colour images are";
                return Err(CaptureError::new(what, folder.display().to_string(), hint));
            }
            ([], things) => {
                let name = |f: &Path| f.file_name().unwrap_or_default().to_string_lossy().into_owned();
                let mut list: Vec<String> =
                    things.iter().take(LISTED).map(|(f, n)| format!("{} ({n} masks)", name(f))).collect();
                if things.len() > LISTED {
                    list.push("...".into());
                }
                let what = format!("the masks are in a folder for each thing: {}", list.join(", "));
                let hint = format!("name that of the object: --masks {}", things[0].0.display());
                return Err(CaptureError::new(what, folder.display().to_string(), hint));
            }
            _ => {}
        }
        let (mut by_stem, mut by_number) = (BTreeMap::new(), BTreeMap::new());
        for file in own {
            let stem = file.file_stem().unwrap_or_default().to_string_lossy().into_owned();
            stem.parse::<u64>().into_iter().for_each(|n| drop(by_number.insert(n, file.clone())));
            by_stem.insert(stem, file);
        }
        Ok(Self { by_stem, by_number })
    }

    fn of_shot(&self, shot: &Shot) -> Option<PathBuf> {
        if let Some(n) = shot.film_frame {
            return self.by_number.get(&(n as u64)).cloned();
        }
        let name = shot.color.file_name()?.to_string_lossy().into_owned();
        let stem = shot.color.file_stem()?.to_string_lossy().into_owned();
        // COLMAP's masks are called picture.jpg.png.
        let named = self.by_stem.get(&stem).or_else(|| self.by_stem.get(&name));
        named.or_else(|| self.by_number.get(&stem.parse().ok()?)).cloned()
    }
}

/// The images right in a folder, by name.
fn images(folder: &Path) -> Vec<PathBuf> {
    let is_image = |p: &PathBuf| {
        let ending = p.extension().map(|e| e.to_string_lossy().to_lowercase());
        p.is_file() && ending.is_some_and(|e| ["png", "jpg", "jpeg"].contains(&e.as_str()))
    };
    let all = std::fs::read_dir(folder).into_iter().flatten().flatten().map(|e| e.path());
    let mut found: Vec<PathBuf> = all.filter(is_image).collect();
    found.sort();
    found
}
