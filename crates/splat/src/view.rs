//! A camera as the kernels see it: one camera_from_group transform per group of gaussians, in f32.

use crate::error::SplatError;
use glam::DVec3;
use hingecast_geom::{Camera, Pose};

/// Tiles are 16 x 16 pixels.
pub(crate) const TILE: usize = 16;
/// Tile coordinates are stored in bytes.
const LARGEST_SIDE: usize = 256 * TILE;

/// x_camera = r * x_group + t.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Frame {
    pub r: [[f32; 3]; 3],
    pub t: [f32; 3],
    /// Camera centre in the group's frame, for view-dependent colour.
    pub centre: [f32; 3],
}

/// One image to be rendered.
#[derive(Clone, Debug, Default)]
pub(crate) struct View {
    /// One per group; a single one when there are no groups.
    pub frames: Vec<Frame>,
    pub fx: f32,
    pub fy: f32,
    pub cx: f32,
    pub cy: f32,
    pub width: usize,
    pub height: usize,
    pub tiles_x: usize,
    pub tiles_y: usize,
}

impl View {
    /// # Errors
    /// Image sides of 0 or above 4096 px, focal lengths or poses that are not finite.
    pub fn new(camera: &Camera, world_from_group: &[Pose]) -> Result<Self, SplatError> {
        for (what, side) in [("camera.width", camera.width), ("camera.height", camera.height)] {
            if side == 0 || side > LARGEST_SIDE {
                return Err(SplatError::Range { what, value: side as f64, range: "1..=4096 pixels" });
            }
        }
        for (what, f) in [("camera.fx", camera.fx), ("camera.fy", camera.fy)] {
            if !(f > 0.0 && f.is_finite()) {
                return Err(SplatError::Range { what, value: f, range: "the positive numbers" });
            }
        }
        let pose = camera.camera_from_world;
        if !(camera.cx.is_finite() && camera.cy.is_finite() && pose.rot.is_finite() && pose.trans.is_finite()) {
            return Err(SplatError::Range {
                what: "camera.cx, cy or camera_from_world",
                value: f64::NAN,
                range: "the finite numbers",
            });
        }
        let frames = if world_from_group.is_empty() {
            vec![frame(&camera.camera_from_world)]
        } else {
            world_from_group.iter().map(|w| frame(&(camera.camera_from_world * *w))).collect()
        };
        Ok(Self {
            frames,
            fx: camera.fx as f32,
            fy: camera.fy as f32,
            cx: camera.cx as f32,
            cy: camera.cy as f32,
            width: camera.width,
            height: camera.height,
            tiles_x: camera.width.div_ceil(TILE),
            tiles_y: camera.height.div_ceil(TILE),
        })
    }

    /// Floats per row of an image plane: the width padded to whole tiles.
    pub fn stride(&self) -> usize {
        self.tiles_x * TILE
    }

    /// Floats per image plane.
    pub fn plane_len(&self) -> usize {
        self.stride() * self.tiles_y * TILE
    }
}

fn frame(camera_from_group: &Pose) -> Frame {
    let m = camera_from_group.mat3();
    let row = |k: usize| m.row(k).as_vec3().to_array();
    Frame {
        r: [row(0), row(1), row(2)],
        t: camera_from_group.trans.as_vec3().to_array(),
        centre: camera_from_group.inverse().trans.as_vec3().to_array(),
    }
}

/// Sums over the gaussians of one group: dL/dr (3 x 3, row-major), dL/dt, dL/dcentre of its
/// [`Frame`].
pub(crate) type FrameGradient = [f64; 15];

/// dL/dxi for world_from_group <- exp(xi) * world_from_group, xi = (translation, rotation),
/// rotation about the world origin.
///
/// With camera_from_group = (R, t), R = R_cw R_wg, t = R_cw t_wg + t_cw: dR = R_cw [w] R_wg and dt
/// = R_cw (v + w x t_wg); the camera centre in the group's frame is -R' t.
pub(crate) fn twist_gradient(sums: &FrameGradient, camera: &Camera, world_from_group: &Pose) -> [f64; 6] {
    let camera_from_group = camera.camera_from_world * *world_from_group;
    let r = camera_from_group.mat3();
    let t = camera_from_group.trans;
    let centre = DVec3::from_slice(&sums[12..15]);
    // centre = -r' t adds -t_i centre_j to dL/dr_ij and -r centre to dL/dt.
    let row = |i: usize| DVec3::from_slice(&sums[3 * i..3 * i + 3]) - centre * t[i];
    let d_r = [row(0), row(1), row(2)];
    let d_t = DVec3::from_slice(&sums[9..12]) - r * centre;
    let r_cw = camera.camera_from_world.mat3();
    let r_wg = world_from_group.mat3();
    let v = r_cw.transpose() * d_t;
    let mut out = [v.x, v.y, v.z, 0.0, 0.0, 0.0];
    for (k, axis) in [DVec3::X, DVec3::Y, DVec3::Z].into_iter().enumerate() {
        let turn = glam::DMat3::from_cols(axis.cross(r_wg.x_axis), axis.cross(r_wg.y_axis), axis.cross(r_wg.z_axis));
        let m = r_cw * turn;
        let rotation: f64 = (0..3).map(|i| d_r[i].dot(m.row(i))).sum();
        out[3 + k] = rotation + d_t.dot(r_cw * axis.cross(world_from_group.trans));
    }
    out
}
