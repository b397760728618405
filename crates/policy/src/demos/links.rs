//! Follows links as h5py and robomimic do, which cannot tell a link from what it leads to.
//!
//! A hard link is a name of the object itself. A soft link holds a path: from the root where it
//! begins with `/`, else from the group that the link lies in; `.` is the group itself, and `..`
//! is a name like any other. External links lead into other files, which a file from elsewhere
//! must not make us open.
//! Source: HDF5 file format specification 3.0, IV.A.2.g (link message) and III.B (symbol tables).

use rust_hdf5::{H5Dataset, H5File, H5Group, Hdf5Error, LinkClass};

/// Soft links on one path, as many as the HDF5 library follows (H5L_NUM_LINKS). It ends circles.
const MOST_LINKS: usize = 16;

/// What a name leads to.
pub(super) enum Found {
    Group(H5Group),
    Dataset(H5Dataset),
    /// No such name, or something that is neither.
    Nothing,
}

/// Why a name leads nowhere.
pub(super) enum Wrong {
    /// What is wrong with a link, and `LINK -> WHERE IT LEADS`.
    Link(String, String),
    /// What the reader says of a damaged file.
    File(Hdf5Error),
}

impl From<Hdf5Error> for Wrong {
    fn from(e: Hdf5Error) -> Self {
        Self::File(e)
    }
}

/// What `name` in the group `from` is, after all links on the way.
pub(super) fn find(h5: &H5File, from: &H5Group, name: &str) -> Result<Found, Wrong> {
    let mut here = match from.name().trim_matches('/') {
        "" => h5.root_group(),
        path => h5.root_group().group(path)?,
    };
    // Names yet to go through, the next one last; and the links that were followed.
    let mut ahead = vec![name.to_string()];
    let mut followed: Vec<String> = Vec::new();
    while let Some(name) = ahead.pop() {
        let place = format!("{}/{name}", here.name().trim_end_matches('/'));
        let class = match here.link_class(&name) {
            Err(Hdf5Error::NotFound(_)) if followed.is_empty() => return Ok(Found::Nothing),
            Err(Hdf5Error::NotFound(_)) => return Err(leads_nowhere(followed)),
            class => class?,
        };
        match class {
            LinkClass::Hard => match here.group(&name) {
                Ok(group) => here = group,
                Err(Hdf5Error::NotFound(_)) if ahead.is_empty() => return dataset(h5, &place),
                Err(Hdf5Error::NotFound(_)) => return Err(leads_nowhere(followed)),
                Err(e) => return Err(e.into()),
            },
            LinkClass::Soft { path } => {
                followed.push(format!("{place} -> {path}"));
                if followed.len() > MOST_LINKS {
                    let what = format!("links in a circle, or more than {MOST_LINKS} one after the other");
                    return Err(Wrong::Link(what, followed.swap_remove(0)));
                }
                if path.starts_with('/') {
                    here = h5.root_group();
                }
                let names = path.split('/').filter(|n| !n.is_empty() && *n != ".");
                ahead.extend(names.rev().map(str::to_string));
            }
            LinkClass::External { file, path } => {
                let what = "a link into another file, which is not followed".to_string();
                return Err(Wrong::Link(what, format!("{place} -> {path} in {file}")));
            }
            LinkClass::UserDefined { link_type } => {
                let what = format!("a link of kind {link_type}, which is not followed");
                return Err(Wrong::Link(what, place));
            }
        }
    }
    Ok(Found::Group(here))
}

fn dataset(h5: &H5File, path: &str) -> Result<Found, Wrong> {
    match h5.dataset(path.trim_start_matches('/')) {
        Ok(dataset) => Ok(Found::Dataset(dataset)),
        Err(Hdf5Error::NotFound(_)) => Ok(Found::Nothing),
        Err(e) => Err(e.into()),
    }
}

fn leads_nowhere(mut followed: Vec<String>) -> Wrong {
    let link = if followed.is_empty() { String::new() } else { followed.swap_remove(0) };
    Wrong::Link("a link that leads nowhere".to_string(), link)
}
