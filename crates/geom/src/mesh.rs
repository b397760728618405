//! Triangle meshes with vertex colours, and their integrals.

use crate::Pose;
use glam::{DMat3, DVec3, Vec3};

/// Triangles, counter-clockwise seen from outside. `colors` is empty or one sRGB triple a vertex.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct TriMesh {
    /// Corner positions, scene units. (n, 3)
    pub vertices: Vec<Vec3>,
    /// Indices of three vertices a triangle. (m, 3)
    pub faces: Vec<[u32; 3]>,
    /// sRGB of every vertex, or empty. (n, 3)
    pub colors: Vec<[u8; 3]>,
}

/// Volume (m^3), centroid (m) and second moments about the centroid (m^5) of a closed mesh.
#[derive(Clone, Copy, Debug)]
pub struct MassIntegrals {
    /// Enclosed volume; negative when the faces are oriented inwards.
    pub volume: f64,
    /// Centre of the volume, in the frame of the mesh.
    pub centroid: DVec3,
    /// Integral of (|r|^2 1 - r r') dV about the centroid: times density it is the inertia tensor.
    pub inertia_per_density: DMat3,
}

impl TriMesh {
    /// True without faces, whatever the vertices.
    pub fn is_empty(&self) -> bool {
        self.faces.is_empty()
    }

    fn corners(&self, face: usize) -> [DVec3; 3] {
        self.faces[face].map(|i| self.vertices[i as usize].as_dvec3())
    }

    /// Moves every vertex from frame `b` to frame `a`; `pose` is `a_from_b`.
    pub fn transform(&mut self, pose: &Pose) {
        for v in &mut self.vertices {
            *v = pose.apply(v.as_dvec3()).as_vec3();
        }
    }

    /// A copy moved by `pose`, as [`TriMesh::transform`] does.
    pub fn transformed(&self, pose: &Pose) -> Self {
        let mut out = self.clone();
        out.transform(pose);
        out
    }

    /// Appends `other`; colours survive only when both have them (or this one is empty).
    pub fn append(&mut self, other: &TriMesh) {
        let keep_colors = (self.vertices.is_empty() || !self.colors.is_empty()) && !other.colors.is_empty();
        let base = self.vertices.len() as u32;
        self.vertices.extend_from_slice(&other.vertices);
        self.faces.extend(other.faces.iter().map(|f| f.map(|i| i + base)));
        if keep_colors {
            self.colors.extend_from_slice(&other.colors);
        } else {
            self.colors.clear();
        }
    }

    /// Lower and upper corner of the axis-aligned box; `None` without vertices.
    pub fn bounds(&self) -> Option<(Vec3, Vec3)> {
        let first = *self.vertices.first()?;
        Some(self.vertices.iter().fold((first, first), |(lo, hi), v| (lo.min(*v), hi.max(*v))))
    }

    /// Sum of the areas of the faces, scene units squared.
    pub fn area(&self) -> f64 {
        (0..self.faces.len()).map(|f| self.face_area(f)).sum()
    }

    fn face_area(&self, face: usize) -> f64 {
        let [a, b, c] = self.corners(face);
        0.5 * (b - a).cross(c - a).length()
    }

    /// `n` points uniform over the area, with the face each lies on. Empty when the area is 0.
    pub fn sample_surface(&self, n: usize, seed: u64) -> Vec<(Vec3, u32)> {
        let mut cumulative = Vec::with_capacity(self.faces.len());
        let mut total = 0.0;
        for f in 0..self.faces.len() {
            total += self.face_area(f);
            cumulative.push(total);
        }
        if total.is_nan() || total <= 0.0 {
            return Vec::new();
        }
        let mut rng = fastrand::Rng::with_seed(seed);
        (0..n)
            .map(|_| {
                let t = rng.f64() * total;
                let face = cumulative.partition_point(|&c| c <= t).min(self.faces.len() - 1);
                let [a, b, c] = self.corners(face);
                // Square-root warp: uniform over the triangle.
                let (r, s) = (rng.f64().sqrt(), rng.f64());
                ((a * (1.0 - r) + b * (r * (1.0 - s)) + c * (r * s)).as_vec3(), face as u32)
            })
            .collect()
    }

    /// Area-weighted vertex normals, unit length (z where undefined).
    pub fn vertex_normals(&self) -> Vec<Vec3> {
        let mut normals = vec![Vec3::ZERO; self.vertices.len()];
        for f in &self.faces {
            let [a, b, c] = f.map(|i| self.vertices[i as usize]);
            let n = (b - a).cross(c - a);
            for &i in f {
                normals[i as usize] += n;
            }
        }
        normals.into_iter().map(|n| n.try_normalize().unwrap_or(Vec3::Z)).collect()
    }

    /// Integrals over the enclosed volume by signed tetrahedra about the mesh's mean vertex
    /// (Blow and Binstock 2004). Meaningful only for a closed, consistently oriented mesh.
    pub fn mass_integrals(&self) -> MassIntegrals {
        let n = self.vertices.len().max(1) as f64;
        let origin = self.vertices.iter().map(|v| v.as_dvec3()).sum::<DVec3>() / n;
        let (mut volume, mut first) = (0.0, DVec3::ZERO);
        let mut second = DMat3::ZERO;
        for f in 0..self.faces.len() {
            let [a, b, c] = self.corners(f).map(|x| x - origin);
            let v = a.dot(b.cross(c)) / 6.0;
            volume += v;
            first += (a + b + c) * (v / 4.0);
            // Integral of x x' over the tetrahedron (0,a,b,c) = V/20 (aa' + bb' + cc' + ss'), s = a + b + c.
            let s = a + b + c;
            for x in [a, b, c, s] {
                second += outer(x, x) * (v / 20.0);
            }
        }
        let offset = if volume.abs() > 0.0 { first / volume } else { DVec3::ZERO };
        let covariance = second - outer(offset, offset) * volume;
        let trace = covariance.x_axis.x + covariance.y_axis.y + covariance.z_axis.z;
        MassIntegrals {
            volume,
            centroid: origin + offset,
            inertia_per_density: DMat3::from_diagonal(DVec3::splat(trace)) - covariance,
        }
    }

    /// Edges that do not belong to exactly two oppositely oriented faces: 0 for a watertight mesh.
    pub fn open_edges(&self) -> usize {
        let mut balance = std::collections::BTreeMap::<(u32, u32), i32>::new();
        for f in &self.faces {
            for k in 0..3 {
                let (a, b) = (f[k], f[(k + 1) % 3]);
                *balance.entry((a.min(b), a.max(b))).or_default() += if a < b { 1 } else { -1 };
            }
        }
        balance.values().filter(|&&b| b != 0).count()
    }

    /// For every vertex the smallest vertex of its connected piece. `alike(i)` names the vertex
    /// that `i` counts as: itself, or the first one at the same place where a file gives every face
    /// corners of its own.
    pub fn pieces(&self, alike: impl Fn(u32) -> u32) -> Vec<u32> {
        let mut root: Vec<u32> = (0..self.vertices.len() as u32).map(&alike).collect();
        fn find(root: &mut [u32], mut i: u32) -> u32 {
            while root[i as usize] != i {
                root[i as usize] = root[root[i as usize] as usize];
                i = root[i as usize];
            }
            i
        }
        for &[a, b, c] in &self.faces {
            for (x, y) in [(a, b), (b, c)] {
                let (x, y) = (find(&mut root, x), find(&mut root, y));
                root[x.max(y) as usize] = x.min(y);
            }
        }
        (0..root.len() as u32).map(|i| find(&mut root, i)).collect()
    }

    /// An axis-aligned box.
    pub fn cuboid(lo: Vec3, hi: Vec3) -> Self {
        let vertices = (0..8)
            .map(|i| {
                let pick = |bit: usize, l: f32, h: f32| if i >> bit & 1 == 1 { h } else { l };
                Vec3::new(pick(0, lo.x, hi.x), pick(1, lo.y, hi.y), pick(2, lo.z, hi.z))
            })
            .collect();
        let quads = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
        let faces = quads.iter().flat_map(|q| [[q[0], q[1], q[2]], [q[0], q[2], q[3]]]).collect();
        Self { vertices, faces, colors: Vec::new() }
    }
}

/// The matrix a b'.
fn outer(a: DVec3, b: DVec3) -> DMat3 {
    DMat3::from_cols(a * b.x, a * b.y, a * b.z)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_box_has_the_textbook_integrals() {
        let (lo, hi) = (Vec3::new(1.0, 2.0, 3.0), Vec3::new(2.0, 4.0, 6.0));
        let mesh = TriMesh::cuboid(lo, hi);
        let m = mesh.mass_integrals();
        assert!((m.volume - 6.0).abs() < 1e-9);
        assert!((m.centroid - DVec3::new(1.5, 3.0, 4.5)).length() < 1e-9);
        // V/12 (b^2 + c^2), sides 1, 2, 3
        let expected = DVec3::new(4.0 + 9.0, 1.0 + 9.0, 1.0 + 4.0) * (6.0 / 12.0);
        let i = m.inertia_per_density;
        assert!((DVec3::new(i.x_axis.x, i.y_axis.y, i.z_axis.z) - expected).length() < 1e-9);
        assert!(i.x_axis.y.abs() < 1e-9);
        assert_eq!(mesh.open_edges(), 0);
        assert!((mesh.area() - 22.0).abs() < 1e-6);
    }

    #[test]
    fn samples_cover_faces_by_area() {
        let mesh = TriMesh::cuboid(Vec3::ZERO, Vec3::new(1.0, 1.0, 10.0));
        let samples = mesh.sample_surface(4000, 1);
        let on_ends = samples.iter().filter(|(x, _)| x.z < 1e-6 || x.z > 10.0 - 1e-5).count();
        // The two ends are 2 of 42 units of area.
        assert!((on_ends as f64 / 4000.0 - 2.0 / 42.0).abs() < 0.015, "{on_ends}");
    }
}
