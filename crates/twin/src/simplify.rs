//! Fewer triangles within a stated error (meshoptimizer: quadric edge collapse).

use hingecast_geom::TriMesh;

/// Collapses edges until `max_faces` are left or the surface would move by more than `max_error` (scene units).
pub fn simplify(mesh: &TriMesh, max_faces: usize, max_error: f32) -> TriMesh {
    if mesh.is_empty() {
        return mesh.clone();
    }
    let positions: Vec<[f32; 3]> = mesh.vertices.iter().map(|v| v.to_array()).collect();
    let bytes: &[u8] = meshopt::typed_to_bytes(&positions);
    let Ok(adapter) = meshopt::VertexDataAdapter::new(bytes, 12, 0) else { return mesh.clone() };
    let indices: Vec<u32> = mesh.faces.iter().flatten().copied().collect();
    let options = meshopt::SimplifyOptions::ErrorAbsolute;
    // meshoptimizer aborts the process when asked for more than there is.
    let wanted = (max_faces * 3).min(indices.len());
    let kept = meshopt::simplify(&indices, &adapter, wanted, max_error, options, None);
    compact(mesh, &kept)
}

/// The mesh with only the vertices that `indices` use.
fn compact(mesh: &TriMesh, indices: &[u32]) -> TriMesh {
    let mut new_index = vec![u32::MAX; mesh.vertices.len()];
    let mut out = TriMesh::default();
    for face in indices.chunks_exact(3) {
        let f = [face[0], face[1], face[2]].map(|i| {
            let slot = &mut new_index[i as usize];
            if *slot == u32::MAX {
                *slot = out.vertices.len() as u32;
                out.vertices.push(mesh.vertices[i as usize]);
                if let Some(c) = mesh.colors.get(i as usize) {
                    out.colors.push(*c);
                }
            }
            *slot
        });
        // Faces without area stay: taking them out would open the surface.
        out.faces.push(f);
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::Vec3;

    /// A small part, a coarse voxel: the process used to abort.
    #[test]
    fn a_mesh_below_the_limit_is_no_reason_to_abort() {
        let corners = [Vec3::ZERO, Vec3::X, Vec3::Y, Vec3::Z];
        let faces = vec![[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]];
        let mesh = TriMesh { vertices: corners.to_vec(), faces, ..Default::default() };
        assert_eq!(simplify(&mesh, 20_000, 1e-3).faces.len(), 4);
    }
}
