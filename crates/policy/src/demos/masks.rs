//! Masks: which demonstrations train, which validate. robomimic calls them filter keys.

use super::Demos;
use crate::PolicyError;
use std::collections::{BTreeMap, BTreeSet};

/// Names in each mask that are there and stand in it once; nothing both trains and validates.
pub(super) fn check(
    masks: &BTreeMap<String, Vec<String>>,
    is_there: impl Fn(&str) -> bool,
    file: &str,
) -> Result<(), PolicyError> {
    for (mask, names) in masks {
        let mut seen = BTreeSet::new();
        for name in names {
            let what = match (is_there(name), seen.insert(name)) {
                (true, true) => continue,
                (false, _) => "a mask names a demonstration that is not there",
                (true, false) => "a mask names a demonstration twice",
            };
            let hint = "write the masks again, or delete the group mask: then 90 % train and 10 % validate";
            return Err(PolicyError::new(what, format!("{file}, mask/{mask}: {name}"), hint));
        }
    }
    apart(masks, "train", "valid", &format!("{file}, "))
}

/// What validates must not be learnt from: the best checkpoint would be chosen by what was learnt
/// by heart. robomimic refuses it, too (`load_data_for_training`).
fn apart(masks: &BTreeMap<String, Vec<String>>, train: &str, valid: &str, file: &str) -> Result<(), PolicyError> {
    let (Some(a), Some(b)) = (masks.get(train), masks.get(valid)) else {
        return Ok(());
    };
    let b: BTreeSet<&String> = b.iter().collect();
    let both: Vec<&str> = a.iter().filter(|name| b.contains(name)).map(String::as_str).collect();
    if both.is_empty() {
        return Ok(());
    }
    // Thousands of names help nobody.
    let more = if both.len() > 10 { format!(" and {} more", both.len() - 10) } else { String::new() };
    let names = both[..both.len().min(10)].join(", ");
    Err(PolicyError::new(
        "demonstrations that both train and validate",
        format!("{file}mask/{train} and mask/{valid}: {names}{more}"),
        "take them out of one of the masks, or delete the group mask: then 90 % train and 10 % validate",
    ))
}

impl Demos {
    /// Refuses masks of these names that share demonstrations.
    ///
    /// # Errors
    /// They do; the error names those in both.
    pub fn masks_apart(&self, train: &str, valid: &str) -> Result<(), PolicyError> {
        apart(&self.masks, train, valid, "")
    }
}
