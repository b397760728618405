//! What is particular to PartNet-Mobility folders: meanings of links, joints that stay at 0, meshes
//! that the data set never had.

use super::joint::UrdfJoint;
use super::places::Places;
use crate::object::xml::children;
use roxmltree::Node;
use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

/// Meanings of PartNet links: semantics.txt ("link_2 hinge lid") where it speaks of these links; in
/// some objects it numbers them otherwise, and the visuals' names ("lid-3") have to do.
pub(super) fn names(folder: &Path, links: &[(String, Node)]) -> BTreeMap<String, String> {
    let text = std::fs::read_to_string(folder.join("semantics.txt")).unwrap_or_default();
    let words = |l: &str| l.split_whitespace().map(String::from).collect::<Vec<_>>();
    let rows: BTreeMap<String, String> =
        text.lines().map(words).filter(|w| w.len() == 3).map(|w| (w[0].clone(), w[2].clone())).collect();
    let with_visuals: BTreeSet<&String> =
        links.iter().filter(|(_, n)| children(*n, "visual").next().is_some()).map(|(name, _)| name).collect();
    if !rows.is_empty() && rows.keys().collect::<BTreeSet<_>>() == with_visuals {
        return rows;
    }
    if !is_partnet(folder) {
        return BTreeMap::new();
    }
    let of_visual = |n: &Node| {
        let name = children(*n, "visual").next()?.attribute("name")?;
        Some(name.rsplit_once('-').map_or(name, |(stem, _)| stem).to_string())
    };
    links.iter().filter_map(|(name, n)| Some((name.clone(), of_visual(n)?))).collect()
}

/// Whether the folder is an object of the data set.
pub(super) fn is_partnet(folder: &Path) -> bool {
    folder.join("mobility_v2.json").exists()
}

/// Joints that stay at 0: those that gt.json calls minor, or whose child is a wheel, knob or
/// button.
pub(super) fn minor_joints(folder: &Path, joints: &[UrdfJoint], names: &BTreeMap<String, String>) -> BTreeSet<String> {
    let truth: Option<serde_json::Value> =
        std::fs::read_to_string(folder.join("gt.json")).ok().and_then(|t| serde_json::from_str(&t).ok());
    if let Some(list) = truth.as_ref().and_then(|t| t["joints"].as_array()) {
        let minor = list.iter().filter(|j| j["minor"] == true);
        return minor.filter_map(|j| Some(j["joint"].as_str()?.to_string())).collect();
    }
    let small = |name: &str| ["wheel", "caster", "knob", "button", "switch", "key"].iter().any(|w| name.contains(w));
    joints.iter().filter(|j| names.get(&j.child).is_some_and(|n| small(n))).map(|j| j.name.clone()).collect()
}

/// Joints that move nothing, because all the meshes below them are among those that were never part
/// of the data set.
pub(super) fn idle_joints(links: &[(String, Node)], joints: &[UrdfJoint], places: &Places) -> BTreeSet<String> {
    let is_there = |link: &Node| {
        children(*link, "visual").flat_map(|v| children(v, "geometry")).filter_map(|g| g.first_element_child()).any(
            |shape| {
                shape.tag_name().name() != "mesh"
                    || shape.attribute("filename").is_some_and(|f| places.find(f).is_file())
            },
        )
    };
    let parent_of: BTreeMap<&str, &str> = joints.iter().map(|j| (j.child.as_str(), j.parent.as_str())).collect();
    let mut moved: BTreeSet<&str> = BTreeSet::new();
    for (name, _) in links.iter().filter(|(_, link)| is_there(link)) {
        let mut at = Some(name.as_str());
        while let Some(link) = at.filter(|link| moved.insert(link)) {
            at = parent_of.get(link).copied();
        }
    }
    joints.iter().filter(|j| !moved.contains(j.child.as_str())).map(|j| j.name.clone()).collect()
}
