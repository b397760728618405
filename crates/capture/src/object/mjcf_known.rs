//! What the MJCF loader understands. Whatever may bear on surfaces or joints and is not listed here
//! is refused: skipped in silence it would be another object. MuJoCo itself reads all of it.

use super::xml::Reader;
use crate::CaptureError;
use roxmltree::{Document, Node};

const HINT: &str = "use a hingecast built with MuJoCo, which reads all of MJCF, or write it without";

/// Elements without a bearing on surfaces and joints, with all that is in them.
const BESIDES: &[&str] = &[
    "actuator",
    "camera",
    "contact",
    "custom",
    "general",
    "inertial",
    "keyframe",
    "light",
    "motor",
    "option",
    "pair",
    "position",
    "sensor",
    "site",
    "size",
    "statistic",
    "tendon",
    "velocity",
    "visual",
];

/// Attributes of an element that are read, and those without a bearing.
fn attributes(element: &str) -> Option<[&'static str; 2]> {
    Some(match element {
        "mujoco" => ["model", ""],
        "worldbody" | "asset" | "freejoint" => ["", "name group align"],
        "default" => ["class", ""],
        "compiler" => [
            "angle meshdir texturedir assetdir",
            "autolimits balanceinertia boundinertia boundmass inertiafromgeom inertiagrouprange settotalmass usethread \
             exactmeshinertia alignfree saveinertial coordinate eulerseq strippath discardvisual fusestatic",
        ],
        "body" => ["name childclass pos quat euler axisangle xyaxes zaxis", "mocap gravcomp user sleep"],
        "joint" => [
            "name class type axis pos range",
            "group stiffness damping armature frictionloss margin springdamper springref solreflimit solimplimit \
             solreffriction solimpfriction actuatorfrcrange actuatorfrclimited actuatorgravcomp user ref limited",
        ],
        "geom" => [
            "name class type size pos quat euler axisangle xyaxes zaxis fromto rgba material mesh group",
            "contype conaffinity condim priority friction mass density shellinertia solmix solref solimp margin gap user \
             fluidshape fluidcoef",
        ],
        "mesh" => ["name class file scale", "inertia maxhullvert smoothnormal content_type"],
        "material" => [
            "name class rgba texture texrepeat",
            "texuniform emission specular shininess reflectance metallic roughness",
        ],
        "texture" => [
            "name class file rgb1",
            "type builtin rgb2 width height mark markrgb random content_type colorspace nchannel",
        ],
        _ => return None,
    })
}

/// Values that say what is so anyway: others are refused.
const ONLY: &[(&str, &str, &[&str])] = &[
    ("compiler", "autolimits", &["true"]),
    ("compiler", "coordinate", &["local"]),
    ("compiler", "eulerseq", &["xyz"]),
    ("compiler", "strippath", &["false"]),
    ("compiler", "discardvisual", &["false"]),
    ("compiler", "fusestatic", &["false"]),
    ("joint", "ref", &["0"]),
    ("joint", "limited", &["true", "auto"]),
];

/// Walks the whole file.
pub(super) fn check(reader: &Reader, xml: &Document) -> Result<(), CaptureError> {
    let mut next = vec![xml.root_element()];
    while let Some(node) = next.pop() {
        let element = node.tag_name().name();
        if BESIDES.contains(&element) {
            continue;
        }
        let Some(known) = attributes(element) else {
            return Err(reader.at(node, format!("<{element}> is not read without MuJoCo"), HINT));
        };
        for a in node.attributes() {
            let listed = known.iter().any(|list| list.split_whitespace().any(|name| name == a.name()));
            let only = ONLY.iter().find(|(e, name, _)| *e == element && *name == a.name());
            if !listed || only.is_some_and(|(.., values)| !values.contains(&a.value().trim())) {
                let what = format!("{}=\"{}\" is not read without MuJoCo", a.name(), a.value());
                return Err(reader.at(node, what, HINT));
            }
        }
        fitted(reader, node)?;
        next.extend(node.children().filter(Node::is_element));
    }
    Ok(())
}

/// A primitive that is fitted to a mesh.
fn fitted(reader: &Reader, node: Node) -> Result<(), CaptureError> {
    let kind = node.attribute("type").unwrap_or("mesh");
    if node.tag_name().name() != "geom" || node.attribute("mesh").is_none() || kind == "mesh" {
        return Ok(());
    }
    Err(reader.at(node, format!("a {kind} fitted to a mesh is not read without MuJoCo"), HINT))
}
