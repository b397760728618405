//! Kinematics and geometry of the real objects agree with their gt.json.

mod common;

use glam::{DMat3, DVec3};
use hingecast_capture::object::ArticulatedObject;
use hingecast_capture::synth::useful_ranges;
use hingecast_geom::{JointKind, Pose, Screw};
use serde_json::Value;
use std::collections::BTreeMap;
use std::f64::consts::FRAC_PI_2;

fn vector(v: &Value) -> DVec3 {
    DVec3::new(v[0].as_f64().unwrap(), v[1].as_f64().unwrap(), v[2].as_f64().unwrap())
}

/// gt.json is y-up; the URDF's base joint turns it by rpy (90, 0, -90) degrees.
fn world_from_gt() -> Pose {
    Pose::from_mat3_trans(DMat3::from_rotation_z(-FRAC_PI_2) * DMat3::from_rotation_x(FRAC_PI_2), DVec3::ZERO)
}

#[test]
fn joints_move_parts_as_the_truth_says() {
    for folder in common::dev_objects() {
        let object = ArticulatedObject::load(&folder).unwrap();
        let gt: Value = serde_json::from_str(&std::fs::read_to_string(folder.join("gt.json")).unwrap()).unwrap();
        let joints: Vec<&Value> = gt["joints"].as_array().unwrap().iter().filter(|j| j["minor"] != true).collect();
        assert_eq!(object.tree.joints.len(), joints.len(), "{}", object.name);

        let mut rng = fastrand::Rng::with_seed(7);
        let value_of: BTreeMap<String, f64> = joints
            .iter()
            .map(|j| {
                let (lo, hi) = (j["lower"].as_f64().unwrap(), j["upper"].as_f64().unwrap());
                (j["joint"].as_str().unwrap().to_string(), lo + rng.f64() * (hi - lo))
            })
            .collect();
        let q: Vec<f64> = object.tree.joints.iter().map(|j| value_of[&j.name]).collect();
        let poses = object.tree.poses(&q);

        for part in gt["parts"].as_array().unwrap() {
            let link = part["link"].as_str().unwrap();
            let ours = object.parts.iter().position(|p| p.links.iter().any(|l| l == link)).unwrap();
            // gt.json: the part's own motion first, then its parent's.
            let mut pose = Pose::IDENTITY;
            let mut at = part["id"].as_i64();
            while let Some(j) = joints.iter().find(|j| j["child"].as_i64() == at) {
                let kind = if j["type"] == "prismatic" { JointKind::Prismatic } else { JointKind::Revolute };
                let screw = Screw { kind, axis: vector(&j["axis"]).normalize(), pivot: vector(&j["origin"]) };
                pose = screw.motion(value_of[j["joint"].as_str().unwrap()]) * pose;
                at = j["parent"].as_i64();
            }
            let world = world_from_gt();
            for corner in [vector(&part["bbox"][0]), vector(&part["bbox"][1])] {
                let (expected, found) = (world.apply(pose.apply(corner)), poses[ours].apply(world.apply(corner)));
                assert!(expected.distance(found) < 1e-5, "{} {link}: {expected} {found}", object.name);
            }
        }
    }
}

#[test]
fn surfaces_fill_the_boxes_of_the_truth() {
    for folder in common::dev_objects() {
        let object = ArticulatedObject::load(&folder).unwrap();
        let gt: Value = serde_json::from_str(&std::fs::read_to_string(folder.join("gt.json")).unwrap()).unwrap();
        for part in gt["parts"].as_array().unwrap() {
            let link = part["link"].as_str().unwrap();
            let ours = object.parts.iter().find(|p| p.links.iter().any(|l| l == link)).unwrap();
            if ours.links.iter().filter(|l| *l != "base").count() > 1 {
                continue; // merged with its wheels
            }
            let back = world_from_gt().inverse();
            let points: Vec<DVec3> = ours.vertices.iter().map(|v| back.apply(v.as_dvec3())).collect();
            let lo = points.iter().fold(DVec3::INFINITY, |a, &b| a.min(b));
            let hi = points.iter().fold(DVec3::NEG_INFINITY, |a, &b| a.max(b));
            let (glo, ghi) = (vector(&part["bbox"][0]), vector(&part["bbox"][1]));
            assert!(
                lo.distance(glo) < 1e-3 && hi.distance(ghi) < 1e-3,
                "{} {link}: {lo} {glo} {hi} {ghi}",
                object.name
            );
            let faces = part["triangles"].as_u64().unwrap() as usize;
            assert!(ours.faces.len() <= faces, "{} {link}", object.name);
        }
    }
}

#[test]
fn double_sided_faces_are_stored_once() {
    for folder in common::dev_objects().iter().filter(|f| f.ends_with("foldingchair_100568")) {
        let object = ArticulatedObject::load(folder).unwrap();
        let faces: usize = object.parts.iter().map(|p| p.faces.len()).sum();
        assert!((1300..=2768 / 2).contains(&faces), "{faces} of 2768 faces are left");
    }
}

#[test]
fn useful_ranges_stay_inside_the_limits_and_away_from_collisions() {
    for folder in common::dev_objects() {
        let object = ArticulatedObject::load(&folder).unwrap();
        for (joint, range) in object.tree.joints.iter().zip(useful_ranges(&object)) {
            let (lo, hi) = (range.lower.min(range.upper), range.lower.max(range.upper));
            assert!(lo >= joint.limits[0] - 1e-9 && hi <= joint.limits[1] + 1e-9, "{}", object.name);
            let least = if joint.screw.kind.turns() { 0.5 } else { 0.2 };
            assert!(hi - lo > least, "{} {}: {lo}..{hi}", object.name, joint.name);
            if object.name.contains("laptop") {
                assert!(range.lower < 1.8, "the lid would go through the keyboard: {range:?}");
            }
        }
    }
}
