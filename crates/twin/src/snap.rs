//! Vertices onto the planes that pixels measured. A mesh out of voxels knows its surface to a third
//! of a voxel where it is thin or bent; the pixels that show a vertex know it far better.
//!
//! A vertex x is moved by the d that minimises sum_i w_i (m_i . (x + d) - c_i)^2 + l |d|^2 over the
//! planes (m_i, c_i) of the pixels that show it in all states (quadrics as in dual contouring, Ju
//! et al. 2002): onto a face, and into an edge where two faces meet.

use crate::Observation;
use crate::vertices::Glimpse;
use glam::{Mat3, Vec3};
use hingecast_geom::TriMesh;

/// Weight of staying where it is: a share of that of all planes, and a part of one plane seen face
/// on.
const STAY: [f32; 2] = [0.02, 0.05];
/// Pixels that a neighbour may be off a pixel's plane before the plane counts half.
const BENT: f32 = 0.1;
/// Cosine between the vertex's normal and a plane's below which the plane is another face's.
const ALIKE: f32 = 0.5;

/// What the planes seen so far say about one vertex.
#[derive(Clone, Copy, Default)]
pub struct Pull {
    /// sum w m m', upper triangle by rows.
    outer: [f32; 6],
    /// sum w m r, r the way along m from the vertex to the plane.
    way: Vec3,
}

/// Adds the plane of a pixel of the vertex's part, if it lies within `reach` of the vertex.
pub fn accumulate(pull: &mut Pull, g: &Glimpse, reach: f32) {
    let x = g.x;
    if !(g.normal.dot(x) < 0.0) {
        return;
    }
    let Some((plane, bend)) = plane(g.seen, g.pixel, g.part) else { return };
    // plane . X = 1 holds on it; it points away from the camera.
    let scale = plane.length_recip();
    let (m, r) = (plane * scale, (1.0 - plane.dot(x)) * scale);
    let slant = -m.dot(x) / x.length();
    let off = r / reach;
    if -m.dot(g.normal) < ALIKE || off.abs() >= 1.0 {
        return;
    }
    let sure = (1.0 - off * off) * (1.0 - off * off);
    let w = slant * slant * sure / (1.0 + (bend / BENT).powi(2));
    let m = g.rot.transpose() * m;
    let o = [m.x * m.x, m.x * m.y, m.x * m.z, m.y * m.y, m.y * m.z, m.z * m.z];
    pull.outer.iter_mut().zip(o).for_each(|(sum, o)| *sum += w * o);
    pull.way += w * r * m;
}

/// The plane n . X = 1 (camera frame) of a pixel of `part` whose four neighbours are the part's
/// too, and how far the worst of them is off it, in pixels. Inverse depth is affine in the ray's
/// slopes over a plane.
fn plane(seen: &Observation, i: usize, part: u8) -> Option<(Vec3, f32)> {
    let c = &seen.camera;
    let (u, v) = (i % c.width, i / c.width);
    if u == 0 || v == 0 || u + 1 >= c.width || v + 1 >= c.height {
        return None;
    }
    let inverse = |j: usize| (seen.labels[j] == part && seen.depth[j] > 0.0).then(|| 1.0 / seen.depth[j]);
    let (w, l, r) = (inverse(i)?, inverse(i - 1)?, inverse(i + 1)?);
    let (above, below) = (inverse(i - c.width)?, inverse(i + c.width)?);
    let (du, dv) = (0.5 * (r - l), 0.5 * (below - above));
    let bend = (l + r - 2.0 * w).abs().max((above + below - 2.0 * w).abs()) * c.fx as f32 / w;
    let at_axis = w - du * (u as f32 + 0.5 - c.cx as f32) - dv * (v as f32 + 0.5 - c.cy as f32);
    Some((Vec3::new(du * c.fx as f32, dv * c.fy as f32, at_axis), bend))
}

/// Moves every vertex onto its planes, at most by `most`.
pub fn finish(mesh: &mut TriMesh, pulls: &[Pull], most: f32) {
    for (x, pull) in mesh.vertices.iter_mut().zip(pulls) {
        let [a, b, c, d, e, f] = pull.outer;
        let stay = STAY[0] * (a + d + f) + STAY[1];
        let outer = Mat3::from_cols(Vec3::new(a + stay, b, c), Vec3::new(b, d + stay, e), Vec3::new(c, e, f + stay));
        let way = outer.inverse() * pull.way;
        *x += way.clamp_length_max(most);
    }
}
