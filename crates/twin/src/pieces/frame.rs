//! The axes along which a thing is made: most of what has hinges is boxes and boards.

use glam::{Mat3, Vec3};
use hingecast_geom::TriMesh;

/// Faces whose normals are this close to an axis stand on it (radians).
const ALONG: f32 = 0.09;
/// Directions that are tried as the first axis.
const TRIED: usize = 300;

/// Columns: the direction that most of the surface stands on, the one across it that most of the
/// rest stands on, and their product. World from frame.
pub fn axes(mesh: &TriMesh) -> Mat3 {
    let mut faces: Vec<(Vec3, f32)> = mesh.faces.iter().filter_map(|f| normal_and_area(mesh, f)).collect();
    // The largest first: of equal claims, the largest face decides.
    faces.sort_by(|a, b| b.1.total_cmp(&a.1));
    let z = most_stood_on(&faces).unwrap_or(Vec3::Z);
    let across: Vec<(Vec3, f32)> = faces
        .iter()
        .filter(|(n, _)| n.dot(z).abs() < ALONG.sin())
        .filter_map(|(n, area)| Some((n.reject_from(z).try_normalize()?, *area)))
        .collect();
    let x = most_stood_on(&across).and_then(|x| x.reject_from(z).try_normalize());
    let x = x.unwrap_or_else(|| z.any_orthonormal_vector());
    Mat3::from_cols(x, z.cross(x), z)
}

/// Twice the area, with the unit normal.
fn normal_and_area(mesh: &TriMesh, face: &[u32; 3]) -> Option<(Vec3, f32)> {
    let [a, b, c] = face.map(|i| mesh.vertices[i as usize]);
    let n = (b - a).cross(c - a);
    Some((n.try_normalize()?, n.length()))
}

/// The line along which the largest area's normals lie, either way.
fn most_stood_on(faces: &[(Vec3, f32)]) -> Option<Vec3> {
    let near = ALONG.cos();
    let area = |d: Vec3| faces.iter().filter(|(n, _)| n.dot(d).abs() > near).map(|f| f.1).sum::<f32>();
    let tried = faces.iter().step_by((faces.len() / TRIED).max(1)).map(|f| (area(f.0), f.0));
    let mut best = tried
        .fold(None, |best: Option<(f32, Vec3)>, new| match best {
            Some(old) if old.0 >= new.0 => Some(old),
            _ => Some(new),
        })?
        .1;
    for _ in 0..3 {
        let near = faces.iter().filter(|(n, _)| n.dot(best).abs() > near);
        best = near.map(|(n, area)| n * (area * n.dot(best).signum())).sum::<Vec3>().normalize_or(best);
    }
    Some(best)
}
