//! Pictures that are not square, and the lenses of sensors that people have.

use serde::{Deserialize, Serialize};

/// A pinhole without distortion, pixels; the centre of the top-left pixel is at (0.5, 0.5).
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Lens {
    /// Columns of the pictures.
    pub width: usize,
    /// Rows of the pictures.
    pub height: usize,
    /// Horizontal focal length.
    pub fx: f64,
    /// Vertical focal length.
    pub fy: f64,
    /// Column of the principal point.
    pub cx: f64,
    /// Row of the principal point.
    pub cy: f64,
}

impl Lens {
    /// Depth stream of an Intel RealSense D435 at 640 x 480, aligned to its colour.
    pub const D435: Self = Self { width: 640, height: 480, fx: 615.0, fy: 615.0, cx: 320.0, cy: 240.0 };
    /// Depth of an iPhone's LiDAR, 256 x 192, beside a main camera of 1920 x 1440.
    pub const IPHONE: Self = Self { width: 256, height: 192, fx: 212.0, fy: 212.0, cx: 128.0, cy: 96.0 };

    /// The same view in pictures smaller by `factor`, in whole pixels.
    pub fn reduced(&self, factor: f64) -> Self {
        let pixels = |n: usize| (n as f64 / factor).round().max(1.0) as usize;
        let (width, height) = (pixels(self.width), pixels(self.height));
        let (sx, sy) = (width as f64 / self.width as f64, height as f64 / self.height as f64);
        Self { width, height, fx: self.fx * sx, fy: self.fy * sy, cx: self.cx * sx, cy: self.cy * sy }
    }

    /// Whether pictures are of a size that is rendered, 8 to 4096 pixels, with the principal point
    /// in their middle half and a field of view from 5 to 120 degrees.
    pub fn is_sane(&self) -> bool {
        let one = |n: usize, f: f64, c: f64| {
            let half = 0.5 * n as f64;
            let fov = 2.0 * (half / f).atan().to_degrees();
            (8..=4096).contains(&n) && fov > 5.0 && fov < 120.0 && (c - half).abs() < 0.5 * half
        };
        one(self.width, self.fx, self.cx) && one(self.height, self.fy, self.cy)
    }
}

impl std::str::FromStr for Lens {
    type Err = String;

    /// `d435`, `iphone` or `W,H,fx,fy,cx,cy`, in each case `/N` for pictures smaller by N.
    fn from_str(text: &str) -> Result<Self, String> {
        let wrong = || format!("'{text}' is not d435, iphone or W,H,fx,fy,cx,cy, with /N or without");
        let (name, factor) = text.split_once('/').unwrap_or((text, "1"));
        let factor = factor.parse().ok().filter(|f: &f64| f.is_finite() && *f > 0.0).ok_or_else(wrong)?;
        let whole = match name {
            "d435" => Self::D435,
            "iphone" => Self::IPHONE,
            numbers => {
                let all: Option<Vec<f64>> = numbers.split(',').map(|n| n.trim().parse().ok()).collect();
                match all.as_deref() {
                    Some(&[w, h, fx, fy, cx, cy]) if w.fract() == 0.0 && h.fract() == 0.0 => {
                        Self { width: w as usize, height: h as usize, fx, fy, cx, cy }
                    }
                    _ => return Err(wrong()),
                }
            }
        };
        let lens = whole.reduced(factor);
        let hint = "8 to 4096 pixels, fields of view from 5 to 120 deg, cx and cy near the middle are expected";
        lens.is_sane().then_some(lens).ok_or_else(|| format!("{lens:?}: {hint}"))
    }
}
