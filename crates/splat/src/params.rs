//! Parameters of all gaussians as planes (structure of arrays), the layout that the kernels and
//! Adam work on.

use crate::error::{SplatError, check_finite, check_len};
use hingecast_geom::Gaussians;

/// First plane of each parameter. A plane holds one f32 per gaussian.
pub mod plane {
    /// x y z, world (or canonical) frame, scene units.
    pub const MEANS: usize = 0;
    /// Natural logarithm of the standard deviations along the gaussian's own axes.
    pub const SCALES: usize = 3;
    /// w x y z, normalised when used.
    pub const QUATS: usize = 6;
    /// Logit.
    pub const OPACITY: usize = 10;
    /// Degree 0: rgb.
    pub const SH0: usize = 11;
    /// Degree 1: basis y, z, x, each rgb. Absent when the degree is 0.
    pub const SH1: usize = 14;
    /// Number of planes without degree 1.
    pub const COUNT_DEGREE_0: usize = 14;
    /// Number of planes with degree 1.
    pub const COUNT_DEGREE_1: usize = 23;
}

/// Gaussians are handled in vectors of up to 16; every plane is padded to a multiple of this.
pub(crate) const PAD: usize = 16;

/// 14 (degree 0) or 23 (degree 1) planes of `len` floats, see [`plane`]. Also holds gradients and
/// Adam moments.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Planes {
    len: usize,
    planes: Vec<Vec<f32>>,
}

impl Planes {
    /// `count` planes (14 or 23) of `len` zeros.
    pub fn zeros(len: usize, count: usize) -> Self {
        Self { len, planes: vec![vec![0.0; len.next_multiple_of(PAD)]; count] }
    }

    /// Number of gaussians.
    pub fn len(&self) -> usize {
        self.len
    }

    /// True without gaussians.
    pub fn is_empty(&self) -> bool {
        self.len == 0
    }

    /// 14 or 23.
    pub fn count(&self) -> usize {
        self.planes.len()
    }

    /// Plane `k`, see [`plane`]. (len)
    pub fn plane(&self, k: usize) -> &[f32] {
        &self.planes[k][..self.len]
    }

    /// Plane `k`, to add to or change. (len)
    pub fn plane_mut(&mut self, k: usize) -> &mut [f32] {
        &mut self.planes[k][..self.len]
    }

    /// With the padding, for the kernels.
    pub(crate) fn padded(&self, k: usize) -> &[f32] {
        &self.planes[k]
    }

    pub(crate) fn padded_mut(&mut self) -> impl Iterator<Item = &mut Vec<f32>> {
        self.planes.iter_mut()
    }

    /// Parameter `k..k + W` of gaussian `i`.
    pub fn get<const W: usize>(&self, k: usize, i: usize) -> [f32; W] {
        std::array::from_fn(|j| self.planes[k + j][i])
    }

    /// Overwrites parameter `k..k + W` of gaussian `i`.
    pub fn set<const W: usize>(&mut self, k: usize, i: usize, value: [f32; W]) {
        for j in 0..W {
            self.planes[k + j][i] = value[j];
        }
    }

    /// From interchange layout.
    ///
    /// # Errors
    /// Arrays of different lengths, no gaussians, NaN or inf.
    pub fn from_gaussians(g: &Gaussians) -> Result<Self, SplatError> {
        let n = g.len();
        if n == 0 {
            return Err(SplatError::Empty { what: "the set of gaussians", item: "gaussian" });
        }
        check_len("gaussians.quats", g.quats.len(), n, "one per mean")?;
        check_len("gaussians.scales", g.scales.len(), n, "one per mean")?;
        check_len("gaussians.opacities", g.opacities.len(), n, "one per mean")?;
        check_len("gaussians.sh0", g.sh0.len(), n, "one per mean")?;
        check_finite("gaussians.means", g.means.as_flattened())?;
        check_finite("gaussians.quats", g.quats.as_flattened())?;
        check_finite("gaussians.scales", g.scales.as_flattened())?;
        check_finite("gaussians.opacities", &g.opacities)?;
        check_finite("gaussians.sh0", g.sh0.as_flattened())?;
        if !g.sh1.is_empty() {
            check_len("gaussians.sh1", g.sh1.len(), n, "one per mean, or none")?;
            check_finite("gaussians.sh1", g.sh1.as_flattened().as_flattened())?;
        }
        let count = if g.sh1.is_empty() { plane::COUNT_DEGREE_0 } else { plane::COUNT_DEGREE_1 };
        let mut out = Self::zeros(n, count);
        for i in 0..n {
            out.set(plane::MEANS, i, g.means[i]);
            out.set(plane::SCALES, i, g.scales[i]);
            out.set(plane::QUATS, i, g.quats[i]);
            out.set(plane::OPACITY, i, [g.opacities[i]]);
            out.set(plane::SH0, i, g.sh0[i]);
            if let Some(sh1) = g.sh1.get(i) {
                for basis in 0..3 {
                    out.set(plane::SH1 + 3 * basis, i, sh1[basis]);
                }
            }
        }
        // Padding gaussians: a valid rotation so that no NaN is computed, and too transparent to be
        // drawn.
        for i in n..n.next_multiple_of(PAD) {
            out.planes[plane::QUATS][i] = 1.0;
            out.planes[plane::OPACITY][i] = -20.0;
        }
        Ok(out)
    }

    /// Back to interchange layout; quaternions are normalised.
    pub fn to_gaussians(&self) -> Gaussians {
        let n = self.len;
        let unit = |q: [f32; 4]| {
            let norm = q.iter().map(|x| x * x).sum::<f32>().sqrt();
            if norm > 0.0 { q.map(|x| x / norm) } else { [1.0, 0.0, 0.0, 0.0] }
        };
        Gaussians {
            means: (0..n).map(|i| self.get(plane::MEANS, i)).collect(),
            quats: (0..n).map(|i| unit(self.get(plane::QUATS, i))).collect(),
            scales: (0..n).map(|i| self.get(plane::SCALES, i)).collect(),
            opacities: self.plane(plane::OPACITY).to_vec(),
            sh0: (0..n).map(|i| self.get(plane::SH0, i)).collect(),
            sh1: if self.count() == plane::COUNT_DEGREE_0 {
                Vec::new()
            } else {
                (0..n).map(|i| std::array::from_fn(|b| self.get(plane::SH1 + 3 * b, i))).collect()
            },
        }
    }
}
