//! A set of 3D gaussians in interchange layout, and the INRIA `.ply` that every splat viewer reads.

use crate::Pose;
use crate::ply::{self, PlyError};
use glam::{Quat, Vec3};
use std::path::Path;

/// Degree-0 spherical harmonic: rgb = 0.5 + SH_C0 * f_dc.
pub const SH_C0: f32 = 0.282_094_79;

/// `n` gaussians. Every array has length `n`.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Gaussians {
    /// Centres, world frame, metres. (n, 3)
    pub means: Vec<[f32; 3]>,
    /// Rotations, w x y z, normalised when used. (n, 4)
    pub quats: Vec<[f32; 4]>,
    /// Natural logarithm of the standard deviations. (n, 3)
    pub scales: Vec<[f32; 3]>,
    /// Logit of the opacity. (n)
    pub opacities: Vec<f32>,
    /// Degree-0 colour coefficients f_dc. (n, 3)
    pub sh0: Vec<[f32; 3]>,
    /// Degree-1 coefficients [basis y, z, x]`[rgb]`; empty when the degree is 0. (n, 3, 3)
    pub sh1: Vec<[[f32; 3]; 3]>,
}

impl Gaussians {
    /// How many gaussians there are.
    pub fn len(&self) -> usize {
        self.means.len()
    }

    /// True without gaussians.
    pub fn is_empty(&self) -> bool {
        self.means.is_empty()
    }

    /// The gaussians at `indices`, in that order.
    ///
    /// # Panics
    /// When an index is not below [`Gaussians::len`].
    pub fn select(&self, indices: &[usize]) -> Self {
        fn pick<T: Copy>(from: &[T], indices: &[usize]) -> Vec<T> {
            indices.iter().map(|&i| from[i]).collect()
        }
        Self {
            means: pick(&self.means, indices),
            quats: pick(&self.quats, indices),
            scales: pick(&self.scales, indices),
            opacities: pick(&self.opacities, indices),
            sh0: pick(&self.sh0, indices),
            sh1: if self.sh1.is_empty() { Vec::new() } else { pick(&self.sh1, indices) },
        }
    }

    /// Moves gaussian `i` rigidly (view-dependent colour is left in the old frame: degree 1 is a
    /// small term).
    pub fn transform_one(&mut self, i: usize, pose: &Pose) {
        let x = Vec3::from(self.means[i]).as_dvec3();
        self.means[i] = pose.apply(x).as_vec3().into();
        let [w, x, y, z] = self.quats[i];
        let q = pose.rot.as_quat() * Quat::from_xyzw(x, y, z, w);
        self.quats[i] = [q.w, q.x, q.y, q.z];
    }

    /// Opacity in (0, 1) of gaussian `i`.
    pub fn opacity(&self, i: usize) -> f32 {
        1.0 / (1.0 + (-self.opacities[i]).exp())
    }

    /// Writes the INRIA layout: x y z nx ny nz f_dc_* f_rest_* opacity scale_* rot_*.
    /// `f_rest` is channel-major (all of red first), as the reference implementation stores it.
    ///
    /// # Errors
    /// The file cannot be written.
    pub fn write_ply(&self, path: &Path) -> Result<(), PlyError> {
        let rest = if self.sh1.is_empty() { 0 } else { 9 };
        let mut names: Vec<String> =
            ["x", "y", "z", "nx", "ny", "nz", "f_dc_0", "f_dc_1", "f_dc_2"].map(String::from).to_vec();
        names.extend((0..rest).map(|k| format!("f_rest_{k}")));
        names
            .extend(["opacity", "scale_0", "scale_1", "scale_2", "rot_0", "rot_1", "rot_2", "rot_3"].map(String::from));
        let mut data = Vec::with_capacity(self.len() * names.len());
        for i in 0..self.len() {
            data.extend(self.means[i]);
            data.extend([0.0; 3]);
            data.extend(self.sh0[i]);
            if rest > 0 {
                for channel in 0..3 {
                    data.extend((0..3).map(|basis| self.sh1[i][basis][channel]));
                }
            }
            data.push(self.opacities[i]);
            data.extend(self.scales[i]);
            data.extend(self.quats[i]);
        }
        ply::write_float_vertices(path, &names, &data)
    }

    /// Reads the INRIA layout; harmonics above degree 1 are dropped.
    ///
    /// # Errors
    /// The file cannot be read, is no PLY, or lacks a property of the layout.
    pub fn read_ply(path: &Path) -> Result<Self, PlyError> {
        let table = ply::read_vertices(path)?;
        let column = |name: &str| table.column(path, name);
        let [x, y, z] = [column("x")?, column("y")?, column("z")?];
        let dc = [column("f_dc_0")?, column("f_dc_1")?, column("f_dc_2")?];
        let opacity = column("opacity")?;
        let scale = [column("scale_0")?, column("scale_1")?, column("scale_2")?];
        let rot = [column("rot_0")?, column("rot_1")?, column("rot_2")?, column("rot_3")?];
        // K coefficients per channel beyond degree 0: 3 for degree 1, 8 for 2, 15 for 3.
        let rest_total = table.names.iter().filter(|n| n.starts_with("f_rest_")).count();
        let per_channel = rest_total / 3;
        let mut rest = [[0usize; 3]; 3];
        if per_channel >= 3 {
            for (basis, row) in rest.iter_mut().enumerate() {
                for (channel, slot) in row.iter_mut().enumerate() {
                    *slot = column(&format!("f_rest_{}", channel * per_channel + basis))?;
                }
            }
        }
        let mut out = Gaussians::default();
        for row in 0..table.rows() {
            let at = |c: usize| table.data[row * table.names.len() + c];
            out.means.push([at(x), at(y), at(z)]);
            out.quats.push(rot.map(at));
            out.scales.push(scale.map(at));
            out.opacities.push(at(opacity));
            out.sh0.push(dc.map(at));
            if per_channel >= 3 {
                out.sh1.push(rest.map(|r| r.map(at)));
            }
        }
        Ok(out)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ply_round_trips_with_degree_one() {
        let g = Gaussians {
            means: vec![[1.0, 2.0, 3.0], [4.0, 5.0, 6.0]],
            quats: vec![[1.0, 0.0, 0.0, 0.0], [0.5, 0.5, 0.5, 0.5]],
            scales: vec![[-3.0, -4.0, -5.0]; 2],
            opacities: vec![2.0, -1.0],
            sh0: vec![[0.1, 0.2, 0.3]; 2],
            sh1: vec![[[0.1, 0.2, 0.3], [0.4, 0.5, 0.6], [0.7, 0.8, 0.9]]; 2],
        };
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("g.ply");
        g.write_ply(&path).unwrap();
        assert_eq!(Gaussians::read_ply(&path).unwrap(), g);
    }
}
