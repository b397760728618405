//! Projection of one gaussian and its gradient, by matrices.

use super::{Real, Scene, SceneGradient, vec3};
use crate::project::{DILATION, NEAR, SH_C0, SH_C1};
use glam::{DMat3, DQuat, DVec3};
use hingecast_geom::{Camera, Pose};

/// A gaussian on the screen.
#[derive(Clone, Default)]
pub(super) struct Screen {
    pub visible: bool,
    pub mean: [Real; 2],
    pub z: Real,
    /// Inverse covariance xx, xy, yy.
    pub conic: [Real; 3],
    pub log_opacity: Real,
    /// ln(1/255)
    pub least: Real,
    pub rgb: [Real; 3],
    /// Half extents of alpha >= 1/255, px.
    pub reach: [Real; 2],
}

/// Gradient by what is on the screen.
#[derive(Clone, Copy, Default)]
pub(super) struct SplatGradient {
    pub rgb: [Real; 3],
    pub z: Real,
    mean: [Real; 2],
    conic: [Real; 3],
    log_opacity: Real,
}

impl SplatGradient {
    /// `d` = dL/d ln(alpha) at offset (dx, dy) from the centre.
    pub fn add_alpha(&mut self, s: &Screen, d: Real, dx: Real, dy: Real) {
        self.log_opacity += d;
        self.mean[0] += d * (s.conic[0] * dx + s.conic[1] * dy);
        self.mean[1] += d * (s.conic[1] * dx + s.conic[2] * dy);
        self.conic[0] -= 0.5 * d * dx * dx;
        self.conic[1] -= d * dx * dy;
        self.conic[2] -= 0.5 * d * dy * dy;
    }
}

/// Where gaussian `i` stands in the world, and the pieces of its covariance.
struct World {
    pose: Pose,
    mean: DVec3,
    /// Rotation of the gaussian in its group's frame.
    rot: DMat3,
    /// world rotation * diag(standard deviations)
    m: DMat3,
}

fn quat(scene: &Scene, i: usize) -> DQuat {
    let [w, x, y, z] = scene.gaussians.quats[i].map(Real::from);
    DQuat::from_xyzw(x, y, z, w)
}

fn world(scene: &Scene, i: usize) -> World {
    let pose = scene.groups.get(i).map_or(Pose::IDENTITY, |&g| scene.world_from_group[usize::from(g)]);
    let rot = DMat3::from_quat(quat(scene, i).normalize());
    let s = vec3(scene.gaussians.scales[i]);
    let m = pose.mat3() * rot * DMat3::from_diagonal(DVec3::new(s.x.exp(), s.y.exp(), s.z.exp()));
    World { pose, mean: pose.apply(vec3(scene.gaussians.means[i])), rot, m }
}

/// Viewing direction in the group's frame, not normalised.
fn direction(world: &World, camera: &Camera) -> DVec3 {
    world.pose.rot.conjugate() * (world.mean - camera.centre())
}

/// Colour before the clamp at 0.
fn colour(scene: &Scene, i: usize, direction: DVec3) -> DVec3 {
    let mut rgb = DVec3::splat(0.5) + Real::from(SH_C0) * vec3(scene.gaussians.sh0[i]);
    if let Some(sh1) = scene.gaussians.sh1.get(i) {
        let d = direction.normalize();
        rgb += Real::from(SH_C1) * (-d.y * vec3(sh1[0]) + d.z * vec3(sh1[1]) - d.x * vec3(sh1[2]));
    }
    rgb
}

/// Rows of J W: the Jacobian of the projection at camera position `x`, times the camera rotation.
fn jacobian_rows(camera: &Camera, x: DVec3) -> [DVec3; 2] {
    let w = camera.camera_from_world.mat3().transpose();
    let z2 = x.z * x.z;
    [
        w * DVec3::new(camera.fx / x.z, 0.0, -camera.fx * x.x / z2),
        w * DVec3::new(0.0, camera.fy / x.z, -camera.fy * x.y / z2),
    ]
}

impl Screen {
    pub fn project(scene: &Scene, i: usize, camera: &Camera) -> Self {
        let world = world(scene, i);
        let x = camera.camera_from_world.apply(world.mean);
        let (width, height) = (camera.width as Real, camera.height as Real);
        let mean = [camera.fx * x.x / x.z + camera.cx, camera.fy * x.y / x.z + camera.cy];
        let near_frame =
            mean[0] > -0.5 * width && mean[0] < 1.5 * width && mean[1] > -0.5 * height && mean[1] < 1.5 * height;
        let opacity = 1.0 / (1.0 + Real::from(-scene.gaussians.opacities[i]).exp());
        let reach2 = 2.0 * (255.0 * opacity).ln();
        if x.z <= Real::from(NEAR) || !near_frame || reach2 <= 0.0 {
            return Self::default();
        }
        let rows = jacobian_rows(camera, x);
        let t = rows.map(|row| world.m.transpose() * row);
        let dilation = Real::from(DILATION);
        let (a, b, c) = (t[0].dot(t[0]) + dilation, t[0].dot(t[1]), t[1].dot(t[1]) + dilation);
        let det = a * c - b * b;
        Self {
            visible: true,
            mean,
            z: x.z,
            conic: [c / det, -b / det, a / det],
            log_opacity: opacity.ln(),
            least: -(255.0 as Real).ln(),
            rgb: colour(scene, i, direction(&world, camera)).max(DVec3::ZERO).to_array(),
            reach: [(reach2 * a).sqrt(), (reach2 * c).sqrt()],
        }
    }
}

/// From the screen to the parameters of gaussian `i` and its group's twist.
pub(super) fn backward(
    scene: &Scene,
    camera: &Camera,
    i: usize,
    s: &Screen,
    g: &SplatGradient,
    out: &mut SceneGradient,
) {
    let world = world(scene, i);
    let w = camera.camera_from_world.mat3();
    let x = camera.camera_from_world.apply(world.mean);
    out.opacities[i] = g.log_opacity * (1.0 - s.log_opacity.exp());

    // Colour: `d_direction` in the group's frame.
    let dir = direction(&world, camera);
    let raw = colour(scene, i, dir);
    let mut d_direction = DVec3::ZERO;
    let d = dir.normalize();
    for c in 0..3 {
        if raw[c] < 0.0 {
            continue;
        }
        out.sh0[i][c] = g.rgb[c] * Real::from(SH_C0);
        if let Some(sh1) = scene.gaussians.sh1.get(i) {
            let scale = g.rgb[c] * Real::from(SH_C1);
            for (basis, value) in [-d.y, d.z, -d.x].into_iter().enumerate() {
                out.sh1[i][basis][c] = scale * value;
            }
            let f = |basis: usize| Real::from(sh1[basis][c]);
            d_direction += scale * DVec3::new(-f(2), -f(0), f(1));
        }
    }
    let d_direction = (d_direction - d * d.dot(d_direction)) / dir.length();
    let d_direction_world = world.pose.rot * d_direction;

    // Conic to covariance: dS = -K dK K with the full symmetric matrices.
    let k = glam::DMat2::from_cols_array(&[s.conic[0], s.conic[1], s.conic[1], s.conic[2]]);
    let d_k = glam::DMat2::from_cols_array(&[g.conic[0], 0.5 * g.conic[1], 0.5 * g.conic[1], g.conic[2]]);
    let d_cov = -(k * d_k * k);

    // S2 = T S_world T' with T = rows (2 x 3): dS_world = T' dS2 T, dT = 2 dS2 T S_world.
    let rows = jacobian_rows(camera, x);
    let sigma = world.m * world.m.transpose();
    let mut d_sigma = DMat3::ZERO;
    let mut d_rows = [DVec3::ZERO; 2];
    for a in 0..2 {
        for b in 0..2 {
            let v = d_cov.col(b)[a];
            d_sigma += DMat3::from_cols(rows[a] * rows[b].x, rows[a] * rows[b].y, rows[a] * rows[b].z) * v;
            d_rows[a] += 2.0 * v * (sigma * rows[b]);
        }
    }

    // Position: screen mean, depth, and the Jacobian's entries.
    let d_j = d_rows.map(|row| w * row);
    let (z, z2) = (x.z, x.z * x.z);
    let mut d_x = DVec3::new(g.mean[0] * camera.fx / z, g.mean[1] * camera.fy / z, g.z);
    d_x.z -= (g.mean[0] * camera.fx * x.x + g.mean[1] * camera.fy * x.y) / z2;
    d_x.x -= d_j[0].z * camera.fx / z2;
    d_x.y -= d_j[1].z * camera.fy / z2;
    d_x.z -= d_j[0].x * camera.fx / z2 + d_j[1].y * camera.fy / z2;
    d_x.z += 2.0 * (d_j[0].z * camera.fx * x.x + d_j[1].z * camera.fy * x.y) / (z2 * z);
    let d_mean_by_screen = w.transpose() * d_x;
    let d_mean_world = d_mean_by_screen + d_direction_world;
    out.means[i] = (world.pose.rot.conjugate() * d_mean_world).to_array();

    // S_world = M M', M = R_group Q diag(s).
    let d_m = d_sigma * world.m * 2.0;
    let d_q_s = world.pose.mat3().transpose() * d_m;
    let scales = vec3(scene.gaussians.scales[i]);
    let mut d_rot = DMat3::ZERO;
    for axis in 0..3 {
        let s = scales[axis].exp();
        out.scales[i][axis] = d_q_s.col(axis).dot(world.rot.col(axis)) * s;
        *d_rot.col_mut(axis) = d_q_s.col(axis) * s;
    }
    out.quats[i] = quat_backward(quat(scene, i), &d_rot);

    // Twist exp(v, w) on the left of world_from_group: x -> x + v + w x x, S -> S + [w] S - S [w],
    // and the direction in the group's frame changes as if the camera had moved the other way.
    let group = scene.groups.get(i).map_or(0, |&g| usize::from(g));
    let turn = world.mean.cross(d_mean_by_screen) + camera.centre().cross(d_direction_world);
    for axis in 0..3 {
        let e = [DVec3::X, DVec3::Y, DVec3::Z][axis];
        let e_sigma = DMat3::from_cols(e.cross(sigma.x_axis), e.cross(sigma.y_axis), e.cross(sigma.z_axis));
        let by_sigma: Real = (0..3).map(|c| d_sigma.col(c).dot(e_sigma.col(c))).sum();
        out.poses[group][axis] += d_mean_world[axis];
        out.poses[group][3 + axis] += turn[axis] + 2.0 * by_sigma;
    }
}

/// dL/d(raw quaternion) from dL/d(rotation matrix): derivatives of the matrix entries, then of the
/// normalisation.
fn quat_backward(raw: DQuat, d: &DMat3) -> [Real; 4] {
    let norm = raw.length();
    let q = raw / norm;
    let (w, x, y, z) = (q.w, q.x, q.y, q.z);
    // Row-major matrices dQ/dw, dQ/dx, dQ/dy, dQ/dz, halved.
    let parts: [[Real; 9]; 4] = [
        [0.0, -z, y, z, 0.0, -x, -y, x, 0.0],
        [0.0, y, z, y, -2.0 * x, -w, z, w, -2.0 * x],
        [-2.0 * y, x, w, x, 0.0, z, -w, z, -2.0 * y],
        [-2.0 * z, -w, x, w, -2.0 * z, y, x, y, 0.0],
    ];
    let entries: [Real; 9] = std::array::from_fn(|k| d.row(k / 3)[k % 3]);
    let d_unit = parts.map(|p| 2.0 * p.iter().zip(&entries).map(|(a, b)| a * b).sum::<Real>());
    let unit = [w, x, y, z];
    let along: Real = unit.iter().zip(&d_unit).map(|(a, b)| a * b).sum();
    std::array::from_fn(|k| (d_unit[k] - unit[k] * along) / norm)
}
