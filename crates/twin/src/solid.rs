//! From what was seen of the parts to which room is solid.

use crate::field::Field;
use crate::fuse::PartVolume;
use crate::slabs::Slabs;
use glam::Vec3;
use hingecast_geom::{KinematicTree, Pose};

/// Steps over a joint's range in which a part empties what it passes through: the back of a drawer
/// is a thin board.
const BETWEEN: usize = 120;

/// The fields of all parts; `poses[state][part]`: world from canonical.
pub fn fields(volumes: Vec<Option<PartVolume>>, tree: &KinematicTree, poses: &[Vec<Pose>]) -> Vec<Option<Field>> {
    let mut fields: Vec<Option<Field>> = volumes.into_iter().map(|v| Some(v?.seen())).collect();
    // What solid voxels of a part that is done lie within.
    let mut hulls: Vec<Option<Slabs>> = fields.iter().map(|_| None).collect();
    // A part also empties what it passes through between the states, in the parts that carry it.
    let swept: Vec<Vec<Pose>> = poses.iter().cloned().chain(sweeps(tree, BETWEEN)).collect();
    let carried = |part: usize, by: usize| tree.ancestry(part).iter().any(|&j| tree.joints[j].parent == by);
    for part in leaves_first(tree) {
        let Some(mut field) = fields[part].take() else { continue };
        let done = hulls.iter().enumerate().filter_map(|(q, hull)| Some((q, fields[q].as_ref()?, hull.as_ref()?)));
        let done: Vec<(&Field, &Slabs, Vec<Pose>)> = done
            .map(|(q, field, hull)| {
                let path = if carried(q, part) { &swept } else { poses };
                (field, hull, path.iter().map(|at| at[q].inverse() * at[part]).collect())
            })
            .collect();
        // What a drawer fills is not the cabinet's, where no ray can tell; and far from what is
        // seen of this part, the hollow of the other is empty as well: nothing of a cabinet is in
        // its drawer.
        let taken = |x: Vec3, deep: bool| {
            done.iter().any(|(field, hull, into)| {
                into.iter().any(|pose| {
                    let x = pose.apply(x.as_dvec3()).as_vec3();
                    field.at(x) < 0.0 || deep && hull.hold(x)
                })
            })
        };
        field.close(&taken, tree.joint_of(part).is_some());
        hulls[part] = Some(field.hull());
        fields[part] = Some(field);
    }
    fields
}

/// Parts, those that carry others after these.
pub fn leaves_first(tree: &KinematicTree) -> Vec<usize> {
    let mut order: Vec<usize> = (0..tree.parts.len()).collect();
    order.sort_by_key(|&p| std::cmp::Reverse(tree.ancestry(p).len()));
    order
}

/// Each joint in turn over its range in small steps, the others as in the first state. [pose][part]
pub fn sweeps(tree: &KinematicTree, steps: usize) -> Vec<Vec<Pose>> {
    let Some(first) = tree.joints.iter().map(|j| j.values.first().copied()).collect::<Option<Vec<f64>>>() else {
        return Vec::new();
    };
    let mut out = Vec::new();
    for (j, joint) in tree.joints.iter().enumerate() {
        for k in 0..=steps {
            let mut q = first.clone();
            q[j] = joint.limits[0] + (joint.limits[1] - joint.limits[0]) * k as f64 / steps as f64;
            out.push(tree.poses(&q));
        }
    }
    out
}
