//! Reading numbers and names out of URDF and MJCF, with errors that name file, line and element.

use crate::CaptureError;
use roxmltree::{Document, Node};
use std::path::Path;

pub(super) struct Reader<'a> {
    pub file: &'a Path,
}

impl Reader<'_> {
    pub fn error(&self, what: impl Into<String>, hint: &str) -> CaptureError {
        CaptureError::new(what, self.file.display().to_string(), hint)
    }

    /// An error that names the element and its line.
    pub fn at(&self, node: Node, what: impl Into<String>, hint: &str) -> CaptureError {
        let line = node.document().text_pos_at(node.range().start).row;
        let name = node.attribute("name").map(|n| format!(" name=\"{n}\"")).unwrap_or_default();
        let place = format!("{}:{line}: <{}{name}>", self.file.display(), node.tag_name().name());
        CaptureError::new(what, place, hint)
    }

    pub fn text(&self, node: Node, key: &str) -> Result<String, CaptureError> {
        let hint = format!("add {key}=\"...\"");
        node.attribute(key).map(String::from).ok_or_else(|| self.at(node, format!("{key} is missing"), &hint))
    }

    /// All numbers in `text`, the value of attribute `key`.
    pub fn list(&self, node: Node, key: &str, text: &str) -> Result<Vec<f64>, CaptureError> {
        let numbers: Option<Vec<f64>> =
            text.split_whitespace().map(|w| w.parse().ok().filter(|x: &f64| x.is_finite())).collect();
        let what = || format!("{key}=\"{text}\" should be finite numbers");
        numbers.ok_or_else(|| self.at(node, what(), "correct the numbers"))
    }

    pub fn exactly<const N: usize>(&self, node: Node, key: &str, text: &str) -> Result<[f64; N], CaptureError> {
        let what = || format!("{key}=\"{text}\" should be {N} finite numbers");
        self.list(node, key, text)?.try_into().map_err(|_| self.at(node, what(), "correct the numbers"))
    }

    pub fn numbers<const N: usize>(&self, node: Node, key: &str) -> Result<Option<[f64; N]>, CaptureError> {
        node.attribute(key).map(|text| self.exactly(node, key, text)).transpose()
    }
}

pub(super) fn children<'a, 'i: 'a>(node: Node<'a, 'i>, name: &'static str) -> impl Iterator<Item = Node<'a, 'i>> {
    node.children().filter(move |n| n.is_element() && n.tag_name().name() == name)
}

/// How deep elements are nested, without recursion: a file may nest them deeper than a stack goes.
pub(super) fn levels(xml: &Document) -> usize {
    let (mut deepest, mut level) = (0, 0usize);
    let mut at = Some(xml.root());
    while let Some(node) = at {
        deepest = deepest.max(level);
        at = if let Some(child) = node.first_child() {
            level += 1;
            Some(child)
        } else {
            let mut up = node;
            while up.next_sibling().is_none() && up.parent().is_some() {
                up = up.parent().expect("it was just there");
                level -= 1;
            }
            up.next_sibling()
        };
    }
    deepest
}
