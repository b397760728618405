//! Fewer triangles within a stated error (meshoptimizer: quadric edge collapse).

use hingecast_geom::TriMesh;

/// Collapses edges until `max_faces` are left or the surface would move by more than `max_error`
/// (scene units).
pub fn simplify(mesh: &TriMesh, max_faces: usize, max_error: f32) -> TriMesh {
    if mesh.is_empty() {
        return mesh.clone();
    }
    let positions: Vec<[f32; 3]> = mesh.vertices.iter().map(|v| v.to_array()).collect();
    let bytes: &[u8] = meshopt::typed_to_bytes(&positions);
    let Ok(adapter) = meshopt::VertexDataAdapter::new(bytes, 12, 0) else { return mesh.clone() };
    let indices: Vec<u32> = mesh.faces.iter().flatten().copied().collect();
    let options = meshopt::SimplifyOptions::ErrorAbsolute;
    // More than there are makes the C++ side abort.
    let kept = meshopt::simplify(&indices, &adapter, (max_faces * 3).min(indices.len()), max_error, options, None);
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

    #[test]
    fn a_mesh_with_fewer_faces_than_asked_for_is_left_alone() {
        let mesh = TriMesh::cuboid(Vec3::ZERO, Vec3::ONE);
        assert_eq!(simplify(&mesh, 20_000, 1e-6).faces.len(), 12);
    }
}
