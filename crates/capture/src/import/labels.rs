//! What to say of masks that have a number for each thing.

use super::{MaskFrom, Shot};
use crate::CaptureError;
use crate::recording::mask;
use std::collections::BTreeMap;

/// Pixels of each number of a mask; empty where it has one thing, or none.
pub(super) fn of(from: &MaskFrom) -> Result<BTreeMap<u16, usize>, CaptureError> {
    match from {
        MaskFrom::File(path) => mask::labels(path),
        _ => Ok(BTreeMap::new()),
    }
}

/// Refuses numbers that no mask has: `found` are the object's pixels of each picture with a mask, and what
/// its mask holds.
pub(super) fn some_is_object(
    shots: &[Shot],
    found: &[(Option<usize>, &BTreeMap<u16, usize>)],
) -> Result<(), CaptureError> {
    let ids = chosen(shots);
    if ids.is_empty() || found.iter().any(|(object, _)| object.is_none_or(|n| n > 0)) {
        return Ok(());
    }
    let there = sum(found.iter().map(|(_, labels)| *labels));
    let hint = if there.is_empty() {
        "the masks do not number things: leave --mask-id (mask_id) away".to_string()
    } else {
        format!("their numbers are {}: --mask-id N", mask::listed(&there))
    };
    let place = shots.iter().find_map(|s| match &s.mask {
        MaskFrom::File(path) => Some(path.display().to_string()),
        MaskFrom::Any(paths) => paths.first().map(|p| p.display().to_string()),
        MaskFrom::Alpha => None,
    });
    let what = format!("no pixel of any mask is {}", words(ids));
    Err(CaptureError::new(what, place.unwrap_or_else(|| "the masks".into()), hint))
}

/// Says that the masks have several numbers, and that all of them were taken.
pub(super) fn note<'a>(shots: &[Shot], labels: impl Iterator<Item = &'a BTreeMap<u16, usize>>) -> Option<String> {
    let all = sum(labels);
    (chosen(shots).is_empty() && all.len() > 1).then(|| {
        format!(
            "masks have {} numbers, all taken for the object: {}; --mask-id N takes one",
            all.len(),
            mask::listed(&all)
        )
    })
}

fn chosen(shots: &[Shot]) -> &[u16] {
    shots.iter().map(|s| &s.mask_ids[..]).find(|ids| !ids.is_empty()).unwrap_or(&[])
}

fn words(ids: &[u16]) -> String {
    ids.iter().map(u16::to_string).collect::<Vec<_>>().join(" or ")
}

fn sum<'a>(all: impl Iterator<Item = &'a BTreeMap<u16, usize>>) -> BTreeMap<u16, usize> {
    let mut out = BTreeMap::new();
    all.flatten().for_each(|(id, n)| *out.entry(*id).or_insert(0) += n);
    out
}
