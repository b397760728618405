//! The zero surface of a field as triangles: naive surface nets (Gibson 1998), one vertex per
//! crossed cell, one quad per crossed edge. Closed wherever the field's border is outside. Also
//! drops crumbs.

use crate::field::Field;
use glam::Vec3;
use hingecast_geom::TriMesh;
use std::collections::BTreeMap;

const CORNERS: [[usize; 3]; 8] =
    [[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0], [0, 0, 1], [1, 0, 1], [0, 1, 1], [1, 1, 1]];
const EDGES: [[usize; 2]; 12] =
    [[0, 1], [2, 3], [4, 5], [6, 7], [0, 2], [1, 3], [4, 6], [5, 7], [0, 4], [1, 5], [2, 6], [3, 7]];

/// Triangles of the zero level, counter-clockwise from outside (positive side), in the field's
/// frame.
pub fn extract(field: &Field) -> TriMesh {
    let [nx, ny, nz] = field.dims;
    let mut vertex_of = vec![u32::MAX; nx * ny * nz];
    let mut mesh = TriMesh::default();
    if nx < 2 || ny < 2 || nz < 2 {
        return mesh;
    }
    for z in 0..nz - 1 {
        for y in 0..ny - 1 {
            for x in 0..nx - 1 {
                let v = CORNERS.map(|c| field.values[field.index(x + c[0], y + c[1], z + c[2])]);
                let inside = v.iter().filter(|v| **v < 0.0).count();
                if inside == 0 || inside == 8 {
                    continue;
                }
                // The vertex is the mean of the crossings on the cell's edges.
                let (mut sum, mut n) = (Vec3::ZERO, 0.0);
                for [a, b] in EDGES {
                    if (v[a] < 0.0) != (v[b] < 0.0) {
                        let t = v[a] / (v[a] - v[b]);
                        let (p, q) = (CORNERS[a].map(|c| c as f32), CORNERS[b].map(|c| c as f32));
                        sum += Vec3::from(p).lerp(Vec3::from(q), t);
                        n += 1.0;
                    }
                }
                vertex_of[field.index(x, y, z)] = mesh.vertices.len() as u32;
                let cell = Vec3::new(x as f32, y as f32, z as f32) + sum / n;
                mesh.vertices.push(field.origin + cell * field.voxel);
            }
        }
    }
    // A crossed edge along axis a is shared by the four cells around it.
    for z in 0..nz - 1 {
        for y in 0..ny - 1 {
            for x in 0..nx - 1 {
                let here = field.values[field.index(x, y, z)] < 0.0;
                for axis in 0..3 {
                    let d = |k: usize| usize::from(axis == k);
                    let next = field.values[field.index(x + d(0), y + d(1), z + d(2))] < 0.0;
                    if here == next {
                        continue;
                    }
                    let (b, c) = ((axis + 1) % 3, (axis + 2) % 3);
                    if [x, y, z][b] == 0 || [x, y, z][c] == 0 {
                        continue; // an edge in the border, which is all outside
                    }
                    let cell = |ob: usize, oc: usize| {
                        let mut p = [x, y, z];
                        p[b] -= ob;
                        p[c] -= oc;
                        vertex_of[field.index(p[0], p[1], p[2])]
                    };
                    let mut quad = [cell(1, 1), cell(0, 1), cell(0, 0), cell(1, 0)];
                    if !here {
                        quad.reverse();
                    }
                    // Split along the shorter diagonal.
                    let p = quad.map(|i| mesh.vertices[i as usize]);
                    if p[0].distance_squared(p[2]) <= p[1].distance_squared(p[3]) {
                        mesh.faces.push([quad[0], quad[1], quad[2]]);
                        mesh.faces.push([quad[0], quad[2], quad[3]]);
                    } else {
                        mesh.faces.push([quad[1], quad[2], quad[3]]);
                        mesh.faces.push([quad[1], quad[3], quad[0]]);
                    }
                }
            }
        }
    }
    mesh
}

/// Vertices of the smallest piece that can be more than a few stray voxels.
const SMALLEST: usize = 24;

/// Keeps the connected pieces whose area is at least `fraction` of the largest's, and smaller ones
/// that are `firm` at half of their vertices or more: a handle stands off its door.
pub fn drop_crumbs(mesh: &TriMesh, fraction: f64, firm: &dyn Fn(Vec3) -> bool) -> TriMesh {
    let piece = mesh.pieces(|i| i);
    let mut area = BTreeMap::<u32, f64>::new();
    for f in &mesh.faces {
        let [a, b, c] = f.map(|i| mesh.vertices[i as usize]);
        *area.entry(piece[f[0] as usize]).or_default() += 0.5 * (b - a).cross(c - a).length() as f64;
    }
    let largest = area.values().fold(0.0f64, |a, b| a.max(*b));
    let small = |p: &u32| area.get(p).is_some_and(|a| *a < fraction * largest);
    // Firm vertices and all, of the small pieces.
    let mut sure = BTreeMap::<u32, (usize, usize)>::new();
    for (p, &x) in piece.iter().zip(&mesh.vertices).filter(|(p, _)| small(p)) {
        let (yes, all) = sure.entry(*p).or_default();
        *yes += usize::from(firm(x));
        *all += 1;
    }
    let mut new_index = vec![u32::MAX; mesh.vertices.len()];
    let mut out = TriMesh::default();
    for f in &mesh.faces {
        if sure.get(&piece[f[0] as usize]).is_some_and(|&(yes, all)| all < SMALLEST || 2 * yes < all) {
            continue;
        }
        out.faces.push(f.map(|i| {
            let slot = &mut new_index[i as usize];
            if *slot == u32::MAX {
                *slot = out.vertices.len() as u32;
                out.vertices.push(mesh.vertices[i as usize]);
            }
            *slot
        }));
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    fn ball(n: usize, radius: f32) -> Field {
        let centre = Vec3::splat((n - 1) as f32 / 2.0);
        let mut values = Vec::new();
        for z in 0..n {
            for y in 0..n {
                for x in 0..n {
                    values.push(
                        ((Vec3::new(x as f32, y as f32, z as f32) - centre).length() - radius).clamp(-3.0, 3.0) / 3.0,
                    );
                }
            }
        }
        Field {
            origin: Vec3::ZERO,
            voxel: 1.0,
            dims: [n; 3],
            known: vec![true; values.len()],
            firm: Vec::new(),
            values,
        }
    }

    #[test]
    fn a_ball_is_closed_outward_and_round() {
        let mesh = extract(&ball(32, 10.0));
        assert_eq!(mesh.open_edges(), 0);
        let volume = mesh.mass_integrals().volume;
        let exact = 4.0 / 3.0 * std::f64::consts::PI * 1000.0;
        assert!((volume / exact - 1.0).abs() < 0.02, "{volume} against {exact}");
    }

    #[test]
    fn crumbs_go_and_the_ball_stays() {
        let mut mesh = extract(&ball(32, 10.0));
        let faces = mesh.faces.len();
        let crumb = extract(&ball(8, 2.5));
        mesh.append(&crumb);
        mesh.append(&TriMesh::cuboid(Vec3::splat(40.0), Vec3::splat(40.5)));
        assert_eq!(drop_crumbs(&mesh, 0.1, &|_| false).faces.len(), faces);
        assert_eq!(drop_crumbs(&mesh, 0.1, &|_| true).faces.len(), faces + crumb.faces.len());
    }
}
