//! A surface cut into charts on one page (uvunwrap, after xatlas), and its texels in space.

use crate::vertices::Points;
use glam::{Vec2, Vec3};
use hingecast_geom::{Progress, TriMesh};

/// Empty texels around a chart: what filters of two levels of detail reach.
pub const PADDING: u32 = 2;

/// Charts of one part, nothing painted yet.
pub struct Atlas {
    /// Corners of charts in texels, rows downwards. (k, 2)
    pub corners: Vec<Vec2>,
    /// Vertex of the mesh that each corner is. (k)
    pub vertices: Vec<u32>,
    /// Three corners a face. (m, 3)
    pub faces: Vec<[u32; 3]>,
    /// Texels a row, and rows.
    pub size: [usize; 2],
    /// Where the texels that a face covers lie in space, frame of the mesh.
    pub texels: Points,
    /// Index in the picture of each of the texels.
    pub places: Vec<u32>,
    /// Colour of the surface at each of the texels, from the vertices.
    pub plain: Vec<[f32; 3]>,
}

/// Cuts a coloured mesh at `density` texels a scene unit, coarser if there would be more than
/// `most` of them. Nothing if it cannot be cut.
pub fn cut(mesh: &TriMesh, density: f32, most: usize, progress: &Progress) -> Option<Atlas> {
    let area = mesh.area() as f32;
    // What is packed fills some 0.6 of the page.
    let density = density.min((0.6 * most as f32 / area.max(1e-12)).sqrt());
    let positions: Vec<[f32; 3]> = mesh.vertices.iter().map(|v| v.to_array()).collect();
    let indices: Vec<u32> = mesh.faces.iter().flatten().copied().collect();
    let options = uvunwrap::Options {
        density: uvunwrap::Density::Fixed { texels_per_unit: density, page_size: None },
        packing: uvunwrap::Packing::Fast,
        padding: PADDING,
        ..Default::default()
    };
    let input = uvunwrap::MeshInput::new(&positions, &indices);
    let page = uvunwrap::generate_with_progress(&[input], &options, |_| progress.check().is_ok()).ok()?;
    let size = [page.width as usize, page.height as usize];
    let out = page.meshes.into_iter().next()?;
    let scale = Vec2::new(size[0] as f32, size[1] as f32);
    let mut atlas = Atlas {
        corners: out.vertices.iter().map(|v| Vec2::from(v.uv) * scale).collect(),
        vertices: out.vertices.iter().map(|v| v.xref).collect(),
        faces: out.indices.chunks_exact(3).map(|f| [f[0], f[1], f[2]]).collect(),
        size,
        texels: Points::default(),
        places: Vec::new(),
        plain: Vec::new(),
    };
    atlas.spread(mesh);
    Some(atlas)
}

impl Atlas {
    /// Finds the texels whose middle lies on a face.
    fn spread(&mut self, mesh: &TriMesh) {
        let normals = mesh.vertex_normals();
        let mut taken = vec![false; self.size[0] * self.size[1]];
        for face in &self.faces {
            let [a, b, c] = face.map(|k| self.corners[k as usize]);
            let twice = (b - a).perp_dot(c - a);
            if !(twice.abs() > 1e-9) {
                continue;
            }
            let (lo, hi) = (a.min(b).min(c), a.max(b).max(c));
            let end = |x: f32, n: usize| (x.max(0.0).ceil() as usize).min(n);
            for y in lo.y.max(0.0) as usize..end(hi.y, self.size[1]) {
                for x in lo.x.max(0.0) as usize..end(hi.x, self.size[0]) {
                    let p = Vec2::new(x as f32 + 0.5, y as f32 + 0.5);
                    let share = [(b - p).perp_dot(c - p), (c - p).perp_dot(a - p), (a - p).perp_dot(b - p)];
                    let share = share.map(|s| s / twice);
                    let place = y * self.size[0] + x;
                    if share.iter().any(|s| *s < 0.0) || std::mem::replace(&mut taken[place], true) {
                        continue;
                    }
                    let of = face.map(|k| self.vertices[k as usize] as usize);
                    let mixed = |of_vertex: &dyn Fn(usize) -> Vec3| -> Vec3 {
                        of.iter().zip(share).map(|(&v, s)| s * of_vertex(v)).sum()
                    };
                    let color =
                        |v: usize| mesh.colors.get(v).map_or(Vec3::splat(128.0), |c| Vec3::from(c.map(f32::from)));
                    self.texels.at.push(mixed(&|v| mesh.vertices[v]));
                    self.texels.normals.push(mixed(&|v| normals[v]).normalize_or_zero());
                    self.plain.push(mixed(&color).to_array());
                    self.places.push(place as u32);
                }
            }
        }
    }
}
