//! What to say of masks that have a number for each thing.

use super::{MaskFrom, Shot};
use crate::CaptureError;
use crate::recording::mask::{self, Labels};

/// Refuses numbers that no mask has: `found` are the object's pixels of each picture with a mask, and what
/// its mask holds.
pub(super) fn some_is_object(shots: &[Shot], found: &[(Option<usize>, &Labels)]) -> Result<(), CaptureError> {
    let ids = chosen(shots);
    if ids.is_empty() || found.iter().any(|(object, _)| object.is_none_or(|n| n > 0)) {
        return Ok(());
    }
    let there = mask::sum(found.iter().map(|(_, labels)| *labels));
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
    let what = format!("no pixel of any mask is {}", mask::words(ids));
    Err(CaptureError::new(what, place.unwrap_or_else(|| "the masks".into()), hint))
}

/// Says that the masks have several numbers, and that all of them were taken.
pub(super) fn note<'a>(shots: &[Shot], labels: impl Iterator<Item = &'a Labels>) -> Option<String> {
    let all = mask::sum(labels);
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
