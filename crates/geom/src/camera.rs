//! The pinhole camera: OpenCV axes, pixel centres at +0.5, depth is z.

use crate::Pose;
use glam::{DVec2, DVec3, Mat3, Vec3};
use serde::{Deserialize, Serialize};

/// Pinhole camera without distortion (importers undistort).
/// `fx fy cx cy` in pixels; the centre of the top-left pixel is at (0.5, 0.5).
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Camera {
    /// Columns of the picture, pixels.
    pub width: usize,
    /// Rows of the picture, pixels.
    pub height: usize,
    /// Horizontal focal length, pixels.
    pub fx: f64,
    /// Vertical focal length, pixels.
    pub fy: f64,
    /// Column of the principal point, pixels; `width / 2` when centred.
    pub cx: f64,
    /// Row of the principal point, pixels; `height / 2` when centred.
    pub cy: f64,
    /// Maps world points into the camera frame (x right, y down, z forward).
    pub camera_from_world: Pose,
}

impl Camera {
    /// Camera at `eye` looking at `target`, image "down" away from `up`. `fov_y` in radians.
    pub fn look_at(eye: DVec3, target: DVec3, up: DVec3, width: usize, height: usize, fov_y: f64) -> Self {
        let z = (target - eye).normalize();
        let side = if z.cross(up).length() < 1e-6 { DVec3::Y } else { up };
        let x = z.cross(side).normalize();
        let y = z.cross(x);
        let world_from_camera = Pose::from_mat3_trans(glam::DMat3::from_cols(x, y, z), eye);
        let f = 0.5 * height as f64 / (0.5 * fov_y).tan();
        Self {
            width,
            height,
            fx: f,
            fy: f,
            cx: 0.5 * width as f64,
            cy: 0.5 * height as f64,
            camera_from_world: world_from_camera.inverse(),
        }
    }

    /// Camera position in the world.
    pub fn centre(&self) -> DVec3 {
        self.camera_from_world.inverse().trans
    }

    /// Pixel position and z depth of a world point; z <= 0 means behind the camera.
    pub fn project(&self, x_world: DVec3) -> (DVec2, f64) {
        let x = self.camera_from_world.apply(x_world);
        (DVec2::new(self.fx * x.x / x.z + self.cx, self.fy * x.y / x.z + self.cy), x.z)
    }

    /// World point at pixel position `uv` and z depth `depth`.
    pub fn unproject(&self, uv: DVec2, depth: f64) -> DVec3 {
        let x = DVec3::new((uv.x - self.cx) / self.fx, (uv.y - self.cy) / self.fy, 1.0) * depth;
        self.camera_from_world.inverse().apply(x)
    }

    /// World direction through pixel position `uv`, scaled so that its camera z is 1.
    pub fn ray(&self, uv: DVec2) -> DVec3 {
        let d = DVec3::new((uv.x - self.cx) / self.fx, (uv.y - self.cy) / self.fy, 1.0);
        self.camera_from_world.rot.conjugate() * d
    }

    /// The same camera at `width` x `height` pixels (image pyramid levels).
    pub fn resized(&self, width: usize, height: usize) -> Self {
        let (sx, sy) = (width as f64 / self.width as f64, height as f64 / self.height as f64);
        Self { width, height, fx: self.fx * sx, fy: self.fy * sy, cx: self.cx * sx, cy: self.cy * sy, ..*self }
    }
}

/// A camera in f32, ready to project many points of one frame.
#[derive(Clone, Copy, Debug)]
pub struct Projection {
    /// Camera frame from the points' frame.
    pub rot: Mat3,
    trans: Vec3,
    /// fx fy cx cy
    f: [f32; 4],
    width: usize,
    height: usize,
}

impl Projection {
    /// For points of the frame whose pose in the world is `world_from_frame`.
    pub fn new(camera: &Camera, world_from_frame: &Pose) -> Self {
        let pose = camera.camera_from_world * *world_from_frame;
        Self {
            rot: pose.mat3().as_mat3(),
            trans: pose.trans.as_vec3(),
            f: [camera.fx as f32, camera.fy as f32, camera.cx as f32, camera.cy as f32],
            width: camera.width,
            height: camera.height,
        }
    }

    /// The point in the camera frame, from one of the points' frame.
    pub fn to_camera(&self, x: Vec3) -> Vec3 {
        self.rot * x + self.trans
    }

    /// Pixel position of a point of the camera frame; meaningless unless z > 0.
    pub fn uv(&self, x: Vec3) -> (f32, f32) {
        (self.f[0] * x.x / x.z + self.f[2], self.f[1] * x.y / x.z + self.f[3])
    }

    /// Index of the pixel on which a point of the camera frame falls, if it is in the picture.
    pub fn pixel(&self, x: Vec3) -> Option<usize> {
        let (u, v) = self.uv(x);
        let inside = x.z > 0.0 && u >= 0.0 && v >= 0.0 && u < self.width as f32 && v < self.height as f32;
        inside.then(|| v as usize * self.width + u as usize)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn look_at_sees_its_target_in_the_middle_with_z_up() {
        let c = Camera::look_at(DVec3::new(2.0, 1.0, 1.5), DVec3::ZERO, DVec3::Z, 640, 480, 0.8);
        let (uv, z) = c.project(DVec3::ZERO);
        assert!((uv - DVec2::new(320.0, 240.0)).length() < 1e-9 && z > 0.0);
        assert!(c.project(DVec3::Z * 0.1).0.y < 240.0, "up in the world is up in the image");
        let x = DVec3::new(0.2, -0.3, 0.1);
        let (uv, z) = c.project(x);
        assert!((c.unproject(uv, z) - x).length() < 1e-12);
    }

    #[test]
    fn looking_straight_down_is_defined() {
        let c = Camera::look_at(DVec3::new(0.0, 0.0, 2.0), DVec3::ZERO, DVec3::Z, 64, 64, 0.8);
        assert!(c.camera_from_world.rot.is_finite());
    }
}
