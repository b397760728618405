//! Lens distortion as OpenCV and nerfstudio define it, and where an undistorted pixel comes from.

use glam::DVec2;
use hingecast_geom::Camera;

/// Radial k1..k4 (powers 2, 4, 6, 8 of the radius, as in nerfstudio) and tangential p1 p2; or
/// OpenCV's fisheye, where k1..k4 act on powers of the angle.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Lens {
    pub k: [f64; 4],
    pub p: [f64; 2],
    pub fisheye: bool,
}

impl Lens {
    pub fn is_ideal(&self) -> bool {
        !self.fisheye && self.k == [0.0; 4] && self.p == [0.0; 2]
    }

    /// Position in the distorted picture of the ideal pixel position `uv`.
    pub fn distort(&self, camera: &Camera, uv: DVec2) -> DVec2 {
        let x = DVec2::new((uv.x - camera.cx) / camera.fx, (uv.y - camera.cy) / camera.fy);
        let d = self.distort_normalised(x);
        DVec2::new(d.x * camera.fx + camera.cx, d.y * camera.fy + camera.cy)
    }

    fn distort_normalised(&self, x: DVec2) -> DVec2 {
        let [k1, k2, k3, k4] = self.k;
        let series = |t: f64| 1.0 + t * (k1 + t * (k2 + t * (k3 + t * k4)));
        let r2 = x.length_squared();
        if self.fisheye {
            // theta_d = theta (1 + k1 theta^2 + ...), OpenCV's fisheye model.
            let r = r2.sqrt();
            if r < 1e-12 {
                return x;
            }
            let theta = r.atan();
            return x * (theta * series(theta * theta) / r);
        }
        let [p1, p2] = self.p;
        let tangential = DVec2::new(
            2.0 * p1 * x.x * x.y + p2 * (r2 + 2.0 * x.x * x.x),
            p1 * (r2 + 2.0 * x.y * x.y) + 2.0 * p2 * x.x * x.y,
        );
        x * series(r2) + tangential
    }
}
