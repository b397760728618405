//! Whether a grasp holds: the wrist, the way there, fingers that close on the part.

use super::*;

impl Search {
    /// Whether the wrist turns with the part.
    pub(super) fn wrists(&self, closing: DVec3) -> Vec<bool> {
        let along_axis = closing.dot(self.screw.axis).abs();
        if self.screw.kind == JointKind::Prismatic || along_axis > 0.9 { vec![false] } else { vec![true] }
    }

    /// Does the open hand fit there, on the way there and along the joint's way? Then: how good is
    /// it?
    pub(super) fn judge(
        &self,
        data: &mut Probe,
        grasp: &Pose,
        width: f64,
        room: f64,
        turn_wrist: bool,
        base: &TaskSpec,
    ) -> Option<Candidate> {
        let approach = grasp.rotate(DVec3::Z);
        pose_joint(data, &self.joint, self.closed);
        for back in APPROACH {
            let pose = Pose::new(grasp.rot, grasp.trans - approach * back);
            if !self.fits(data, &pose, 0.0) {
                return None;
            }
        }
        if !self.closes(data, grasp, width) {
            return None;
        }
        let span = self.open - self.closed;
        for share in ALONG {
            pose_joint(data, &self.joint, self.closed + share * span);
            let moved = self.screw.motion(share * span) * *grasp;
            let pose = Pose::new(if turn_wrist { moved.rot } else { grasp.rot }, moved.trans);
            if !self.fits(data, &pose, ROCKING) {
                return None;
            }
        }
        pose_joint(data, &self.joint, self.closed);

        let way = self.screw.motion(0.6 * span).apply(grasp.trans) - grasp.trans;
        let yaw = self.best_yaw(grasp, way)?;
        let turn = DQuat::from_rotation_z(yaw);
        let towards_arm = -(turn * way).normalize_or_zero().x;
        let lever = if self.screw.kind.turns() {
            let farthest = 0.5 * (self.part[1] - self.part[0]).length() + self.screw.distance(base.part_centre);
            self.screw.distance(grasp.trans) / farthest.max(1e-9)
        } else {
            // A drawer is pulled in its middle, else it binds.
            let off = grasp.trans - base.part_centre;
            1.0 - off.reject_from_normalized(self.screw.axis).length()
                / (self.part[1] - self.part[0]).length().max(1e-9)
        };
        // The less the hand leans, the farther the wrist is from its stops.
        let score = 1.2 * lever - 2.0 * approach.z + 0.4 * room - 3.0 * width
            + 0.4 * towards_arm
            + if turn_wrist { 0.0 } else { 0.4 };

        let mut task = base.clone();
        task.width = width;
        task.turn_wrist = turn_wrist;
        task.grasp = *grasp;
        // The hand may come with either finger first: as it hangs at the start is less turning.
        let world = turn * grasp.rot;
        let flipped = grasp.rot * DQuat::from_rotation_z(std::f64::consts::PI);
        let start = crate::env::GRIPPER_DOWN;
        if (turn * flipped).dot(start).abs() > world.dot(start).abs() {
            task.grasp.rot = flipped;
        }
        let middle = turn * (grasp.trans + 0.5 * way);
        let ahead = MIDDLE + BEHIND * (1.0 - approach.z * approach.z).max(0.0).sqrt();
        task.place = Pose::new(turn, DVec3::new(ahead - middle.x, -middle.y, TABLE - self.low));
        Some(Candidate { task, score })
    }

    /// Which side of the object faces the arm: the hand comes from above or away from the arm, and
    /// the way leads towards the arm, or else the wrist has to bend back on itself.
    pub(super) fn best_yaw(&self, grasp: &Pose, way: DVec3) -> Option<f64> {
        let yaws = (0..4).map(|k| k as f64 * FRAC_PI_2);
        let approach = grasp.rotate(DVec3::Z);
        let fine = yaws.filter(|&y| approach.z < -0.99 || (DQuat::from_rotation_z(y) * approach).x > 0.3);
        // Doors swing more outwards than sideways: the larger component decides, as rounding to
        // quarter turns does.
        let towards = |yaw: f64| -(DQuat::from_rotation_z(yaw) * way).x;
        fine.max_by(|a, b| towards(*a).total_cmp(&towards(*b)))
    }

    /// Nothing but the part stands in the fingers' way when they close: rays from the corners of
    /// pads and shafts inwards, as far as the part's surface. A lip of the case behind a door's
    /// edge would stop one finger, and the hand would pull at the case.
    pub(super) fn closes(&self, data: &mut Probe, grasp: &Pose, width: f64) -> bool {
        FINGER.iter().all(|&[side, along, inner]| {
            [1.0, -1.0].into_iter().all(|finger| {
                let from = grasp.apply(DVec3::new(side, finger * inner, along));
                let inwards = grasp.rotate(DVec3::new(0.0, -finger, 0.0));
                let groups = [1, 1, 1, 1, 1, 0];
                let way = HALF_OPEN - 0.5 * width;
                let (met, distance) = data.ray(&from.to_array(), &inwards.to_array(), Some(&groups), true, None, None);
                met.is_none_or(|g| distance > way || is_part(data.model(), g, &self.joint))
            })
        })
    }

    /// No contact of the hand deeper than `slack`, and the hand above the table. With slack,
    /// fingers may touch the part itself.
    pub(super) fn fits(&self, data: &mut Probe, pose: &Pose, slack: f64) -> bool {
        place_gripper(data, pose);
        data.kinematics();
        data.com_pos();
        data.collision();
        let model = data.model();
        let [low, _] = bounds(data, |g| self.hand.owns(model, g)).unwrap_or([DVec3::splat(f64::MAX); 2]);
        if low.z < self.low + 0.003 {
            return false;
        }
        data.contact().iter().all(|c| {
            let [a, b] = c.geom.map(|g| g.max(0) as usize);
            let (finger, other) = match [a, b].map(|g| self.hand.owns(model, g)) {
                [true, false] => (a, b),
                [false, true] => (b, a),
                _ => return true,
            };
            let rocking = slack > 0.0 && finger != self.hand.palm && is_part(model, other, &self.joint);
            rocking || c.dist > -slack
        })
    }
}
