//! Where pieces may not reach: what lies outside a surface, farther from it than they may.

use crate::hulls::vectors;
use glam::Vec3;
use hingecast_geom::TriMesh;
use parry3d::math::Vector;
use parry3d::query::PointQuery;
use parry3d::shape;
use parry3d::transformation::voxelization::{FillMode, VoxelSet, VoxelizedVolume};
use rayon::prelude::*;

/// Cells along the longest side of the surface, at least and at most.
const CELLS: [f32; 2] = [64.0, 160.0];
/// Thickness of the layer of forbidden places, cells.
const LAYER: f32 = 3.0;

/// A surface on a grid.
pub struct Room {
    origin: Vec3,
    /// Edge of a cell.
    pub cell: f32,
    dims: [usize; 3],
    /// How far beyond the surface a piece may be, same unit.
    pub reach: f32,
    /// In the solid, a cell from its surface.
    deep: Vec<bool>,
    /// Half of what is solid, unit of the mesh cubed: a bound from below for what is not closed.
    pub volume: f64,
    /// Places outside, a little farther from the surface than pieces may reach, in order of z.
    pub outside: Vec<Vec3>,
}

impl Room {
    /// `reach`: how far beyond the surface a piece may be, same unit as the mesh.
    pub fn around(mesh: &TriMesh, reach: f32) -> Option<Self> {
        let (lo, hi) = mesh.bounds()?;
        let longest = (hi - lo).max_element();
        let cells = (longest / reach).clamp(CELLS[0], CELLS[1]) as u32;
        let points = vectors(&mesh.vertices);
        let fill = FillMode::FloodFill { detect_cavities: false };
        let set: VoxelSet = VoxelizedVolume::voxelize(&points, &mesh.faces, cells, fill, false).into();
        let cell = set.scale;
        let steps = (reach / cell + LAYER).ceil() as usize;
        // A margin around what is solid.
        let at = |k: usize| set.voxels().iter().map(move |v| [v.coords.x, v.coords.y, v.coords.z][k] as i64);
        let first: [i64; 3] = std::array::from_fn(|k| at(k).min().unwrap_or(0) - steps as i64);
        let dims: [usize; 3] = std::array::from_fn(|k| (at(k).max().unwrap_or(0) - first[k]) as usize + steps + 1);
        let o = set.origin;
        let origin = Vec3::new(o.x, o.y, o.z) + Vec3::from(first.map(|x| x as f32)) * cell;
        let mut room = Self {
            origin,
            cell,
            dims,
            reach,
            deep: vec![false; dims.iter().product()],
            volume: 0.5 * f64::from(cell).powi(3) * set.voxels().len() as f64,
            outside: Vec::new(),
        };
        // On the surface, then near it; on it or in the solid.
        let mut near = room.deep.clone();
        let mut solid = room.deep.clone();
        for v in set.voxels() {
            let i: [usize; 3] =
                std::array::from_fn(|k| ([v.coords.x, v.coords.y, v.coords.z][k] as i64 - first[k]) as usize);
            let i = room.index(i);
            (solid[i], near[i], room.deep[i]) = (true, v.is_on_surface, !v.is_on_surface);
        }
        room.spread(&mut near, steps);
        let surface = shape::TriMesh::new(points, mesh.faces.clone()).ok()?;
        let layer = reach..reach + LAYER * cell;
        room.outside = (0..near.len())
            .into_par_iter()
            .filter(|&i| near[i] && !solid[i])
            .map(|i| room.place(i))
            .filter(|x| {
                let p = Vector::new(x.x, x.y, x.z);
                let found = surface.project_local_point(p, false).point;
                layer.contains(&(found - p).length())
            })
            .collect();
        Some(room)
    }

    fn index(&self, [x, y, z]: [usize; 3]) -> usize {
        x + self.dims[0] * (y + self.dims[1] * z)
    }

    fn place(&self, i: usize) -> Vec3 {
        let [nx, ny, _] = self.dims;
        self.origin + Vec3::new((i % nx) as f32, (i / nx % ny) as f32, (i / (nx * ny)) as f32) * self.cell
    }

    /// Marks what lies within `steps` cells along each axis of what is marked.
    fn spread(&self, marks: &mut [bool], steps: usize) {
        let strides = [1, self.dims[0], self.dims[0] * self.dims[1]];
        for (axis, stride) in strides.into_iter().enumerate() {
            let n = self.dims[axis];
            let old = marks.to_vec();
            for i in (0..old.len()).filter(|&i| old[i]) {
                let k = i / stride % n;
                for j in k.saturating_sub(steps)..(k + steps + 1).min(n) {
                    marks[i + j * stride - k * stride] = true;
                }
            }
        }
    }

    /// True in the solid, about a cell from its surface and more.
    pub fn deep(&self, x: Vec3) -> bool {
        let p = ((x - self.origin) / self.cell).round();
        let n = Vec3::from(self.dims.map(|n| n as f32));
        p.cmpge(Vec3::ZERO).all()
            && p.cmplt(n).all()
            && self.deep[self.index([p.x as usize, p.y as usize, p.z as usize])]
    }
}
