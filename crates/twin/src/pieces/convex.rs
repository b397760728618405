//! Convex hulls, and which points are worth one.

use super::{Bounds, OUTSIDE};
use crate::hulls::hull_of;
use glam::Vec3;
use hingecast_geom::TriMesh;

/// A convex mesh with its planes.
pub struct Convex {
    pub mesh: TriMesh,
    pub volume: f64,
    /// Its box.
    pub lo: Vec3,
    pub hi: Vec3,
    /// Outward normals and heights, those of large faces first.
    planes: Vec<(Vec3, f32)>,
}

/// Cosine of the angle between normals that count as one.
const SAME: f32 = 0.9998;
/// A box stands for a hull that fills this share of it.
const BOX: f64 = 0.9;

impl Convex {
    fn of(mesh: TriMesh) -> Option<Self> {
        let (lo, hi) = mesh.bounds()?;
        let volume = mesh.mass_integrals().volume;
        let mut faces: Vec<(Vec3, f32)> = mesh.faces.iter().filter_map(|f| face(&mesh, f)).collect();
        // The large ones first: they turn most places away.
        faces.sort_by(|a, b| b.1.total_cmp(&a.1));
        let mut planes: Vec<(Vec3, f32)> = Vec::new();
        for (n, _) in faces {
            if planes.iter().all(|p| p.0.dot(n) < SAME) {
                // The normal of a sliver is any: the plane stands where it holds all.
                planes.push((n, mesh.vertices.iter().map(|v| n.dot(*v)).fold(f32::MIN, f32::max)));
            }
        }
        (volume > 0.0).then_some(Self { mesh, volume, lo, hi, planes })
    }

    /// How many of some places lie in it, which are in order of z; counts no further than `most`.
    pub fn holds(&self, places: &[Vec3], most: usize) -> usize {
        let from = places.partition_point(|x| x.z < self.lo.z);
        let to = places.partition_point(|x| x.z <= self.hi.z);
        let inside = |x: &&Vec3| {
            let within = x.x >= self.lo.x && x.x <= self.hi.x && x.y >= self.lo.y && x.y <= self.hi.y;
            within && self.planes.iter().all(|(n, d)| n.dot(**x) <= *d)
        };
        places[from..to].iter().filter(inside).take(most).count()
    }

    /// Places all over it: corners, middles of edges, and what is half-way from them to its middle.
    pub fn places(&self) -> Vec<Vec3> {
        let v = &self.mesh.vertices;
        let middle = v.iter().sum::<Vec3>() / v.len() as f32;
        let edges = self.mesh.faces.iter().flat_map(|f| (0..3).map(move |k| (f[k], f[(k + 1) % 3])));
        let mut places: Vec<Vec3> = v.clone();
        places.extend(edges.filter(|(a, b)| a < b).map(|(a, b)| (v[a as usize] + v[b as usize]) / 2.0));
        let inner: Vec<Vec3> = places.iter().map(|x| (*x + middle) / 2.0).collect();
        places.extend(inner);
        places.push(middle);
        places
    }

    /// How far a place lies before the farthest plane that it is before; below zero inside.
    pub fn beyond(&self, x: Vec3) -> f32 {
        self.planes.iter().map(|(n, d)| n.dot(x) - d).fold(f32::MIN, f32::max)
    }

    /// The box along the axes of the frame that stands for it: of its volume, where that moves no
    /// side by more than the reach and keeps it out of the outside.
    pub fn as_box(&self, bounds: &Bounds) -> Option<Self> {
        let size = self.hi - self.lo;
        let volume = f64::from(size.x * size.y * size.z);
        if self.volume < BOX * volume {
            return None;
        }
        let area = 2.0 * (size.x * size.y + size.y * size.z + size.z * size.x);
        let inset = ((volume - self.volume) as f32 / area).min(bounds.room.reach);
        let lean = Self::of(TriMesh::cuboid(self.lo + inset, self.hi - inset))?;
        (bounds.outside(&lean) <= OUTSIDE * lean.volume).then_some(lean)
    }

    /// A hull of fewer of its corners, of which the others stand out by no more than `by`.
    pub fn smoothed(self, by: f32) -> Self {
        let mut chosen = extreme(&self.mesh.vertices, 0);
        while chosen.len() < self.mesh.vertices.len() {
            let Some(now) = hull(&chosen) else { break };
            let out = self.mesh.vertices.iter().map(|x| (now.beyond(*x), *x));
            let Some((most, x)) = out.max_by(|a, b| a.0.total_cmp(&b.0)) else { break };
            if most <= by {
                return now;
            }
            chosen.push(x);
        }
        self
    }
}

/// Unit normal and twice the area.
fn face(mesh: &TriMesh, face: &[u32; 3]) -> Option<(Vec3, f32)> {
    let [a, b, c] = face.map(|i| mesh.vertices[i as usize]);
    let n = (b - a).cross(c - a);
    Some((n.try_normalize()?, n.length()))
}

/// The hull of some points, unless they lie in a plane.
pub fn hull(points: &[Vec3]) -> Option<Convex> {
    if points.len() < 4 {
        return None;
    }
    Convex::of(hull_of(points)?)
}

/// The hull of two pieces whose boxes are no farther apart than `apart`.
pub fn common(a: &Convex, b: &Convex, apart: f32) -> Option<Convex> {
    if (a.lo - apart).cmpgt(b.hi).any() || (b.lo - apart).cmpgt(a.hi).any() {
        return None;
    }
    let points: Vec<Vec3> = a.mesh.vertices.iter().chain(&b.mesh.vertices).copied().collect();
    hull(&points)
}

/// Directions in which points are asked how far they reach: for a piece, and to compare cuts.
pub const FINE: usize = 256;
pub const ROUGH: usize = 48;

/// The points that reach farthest in evenly spread directions (Fibonacci), and along the axes and
/// diagonals of the frame: all corners of boxes along it are among them.
pub fn extreme(points: &[Vec3], directions: usize) -> Vec<Vec3> {
    let even = (0..directions).map(|k| {
        let (z, turn) = (1.0 - 2.0 * (k as f32 + 0.5) / directions as f32, 2.399_963_2 * k as f32);
        let r = (1.0 - z * z).sqrt();
        Vec3::new(r * turn.cos(), r * turn.sin(), z)
    });
    let corners = (0..27).map(|k| Vec3::new((k % 3) as f32 - 1.0, (k / 3 % 3) as f32 - 1.0, (k / 9) as f32 - 1.0));
    let farthest = |d: Vec3| {
        let mut best = (f32::MIN, None);
        for (i, p) in points.iter().enumerate() {
            let h = d.dot(*p);
            if h > best.0 {
                best = (h, Some(i));
            }
        }
        best.1
    };
    let mut chosen: Vec<usize> = even.chain(corners).filter_map(farthest).collect();
    chosen.sort_unstable();
    chosen.dedup();
    chosen.into_iter().map(|i| points[i]).collect()
}
