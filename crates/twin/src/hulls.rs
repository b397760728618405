//! Convex pieces for collision: VHACD (Mamou 2016, parry3d), every piece checked.

use glam::Vec3;
use hingecast_geom::TriMesh;
use parry3d::math::Vector;
use parry3d::transformation::try_convex_hull;
use parry3d::transformation::vhacd::{VHACD, VHACDParameters};
use std::cell::Cell;
use std::panic::AssertUnwindSafe;
use std::sync::Once;

/// Resolution 128 and concavity 0.001 keep a drawer with thin walls open; the defaults fill 3 % of
/// it.
#[derive(Clone, Copy, Debug)]
pub struct HullConfig {
    /// Voxels along the longest side of the mesh.
    pub resolution: u32,
    /// How far a piece may be from convex before it is cut again, 0..1; smaller gives more pieces.
    pub concavity: f32,
    /// Most pieces; what is concave then stays so.
    pub max_hulls: u32,
}

impl Default for HullConfig {
    fn default() -> Self {
        Self { resolution: 128, concavity: 0.001, max_hulls: 48 }
    }
}

/// Convex hulls that together cover `mesh`, and how many pieces were dropped as flat or broken.
pub fn decompose(mesh: &TriMesh, config: &HullConfig) -> (Vec<TriMesh>, usize) {
    if mesh.is_empty() {
        return (Vec::new(), 0);
    }
    if let Some(whole) = convex(mesh) {
        return (vec![whole], 0);
    }
    let points: Vec<Vector> = mesh.vertices.iter().map(|v| Vector::new(v.x, v.y, v.z)).collect();
    // On some surfaces parry's own hulls of voxels fail, and it panics. A slightly other grid of
    // voxels does then; the hull of the whole always does.
    let at = |resolution: u32| {
        let parameters = VHACDParameters {
            resolution,
            concavity: config.concavity,
            max_convex_hulls: config.max_hulls,
            ..Default::default()
        };
        quietly(|| VHACD::decompose(&parameters, &points, &mesh.faces, false).compute_convex_hulls(4))
    };
    let tries = (0..TRIES).map(|k| config.resolution - k * config.resolution / 16);
    let whole = || try_convex_hull(&points).into_iter().collect();
    let mut pieces: Vec<(Vec<Vector>, Vec<[u32; 3]>)> = tries.filter_map(at).next().unwrap_or_else(whole);
    // Pieces without any voxel come back empty.
    pieces.retain(|(vertices, _)| !vertices.is_empty());
    let total = pieces.len();
    let (lo, hi) = mesh.bounds().unwrap_or_default();
    let thinnest = 1e-3 * (hi - lo).length();
    let hulls: Vec<TriMesh> = pieces
        .into_iter()
        .map(|(vertices, faces)| TriMesh {
            vertices: vertices.into_iter().map(|p| Vec3::new(p.x, p.y, p.z)).collect(),
            faces,
            colors: Vec::new(),
        })
        .filter(|h| usable(h, thinnest))
        .collect();
    let dropped = total - hulls.len();
    (hulls, dropped)
}

/// Share of its hull's volume from which on a closed surface counts as convex.
const CONVEX: f64 = 0.99;
/// Corners that one piece may have; rounder things are better several pieces of few corners.
const MOST_CORNERS: usize = 256;

/// The hull of a closed surface that is convex already: a box is one piece, and no slices.
pub fn convex(mesh: &TriMesh) -> Option<TriMesh> {
    let volume = mesh.mass_integrals().volume;
    if !(volume > 0.0) || mesh.open_edges() != 0 {
        return None;
    }
    let points: Vec<Vector> = mesh.vertices.iter().map(|v| Vector::new(v.x, v.y, v.z)).collect();
    let (vertices, faces) = try_convex_hull(&points).ok()?;
    let vertices = vertices.into_iter().map(|p| Vec3::new(p.x, p.y, p.z)).collect();
    let hull = TriMesh { vertices, faces, colors: Vec::new() };
    let (lo, hi) = mesh.bounds()?;
    let alike = volume >= CONVEX * hull.mass_integrals().volume;
    (alike && hull.vertices.len() <= MOST_CORNERS && usable(&hull, 1e-3 * (hi - lo).length())).then_some(hull)
}

/// Grids of voxels that are tried before the part is taken as one piece.
const TRIES: u32 = 6;

/// What `work` answers, or nothing if it panics, which is then not printed either.
fn quietly<T>(work: impl FnOnce() -> T) -> Option<T> {
    thread_local!(static CATCHING: Cell<bool> = const { Cell::new(false) });
    static HOOK: Once = Once::new();
    HOOK.call_once(|| {
        let before = std::panic::take_hook();
        std::panic::set_hook(Box::new(move |info| {
            if !CATCHING.get() {
                before(info);
            }
        }));
    });
    CATCHING.set(true);
    let answer = std::panic::catch_unwind(AssertUnwindSafe(work)).ok();
    CATCHING.set(false);
    answer
}

/// A hull that a simulator accepts: finite, closed, with a volume, not a sheet.
pub fn usable(hull: &TriMesh, thinnest: f32) -> bool {
    if hull.faces.len() < 4 || hull.vertices.iter().any(|v| !v.is_finite()) || hull.open_edges() != 0 {
        return false;
    }
    let volume = hull.mass_integrals().volume;
    // Mean thickness = 2 V / A for a slab.
    volume > 0.0 && 2.0 * volume / hull.area().max(1e-30) > 0.5 * thinnest as f64
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_box_is_one_piece_and_a_box_with_a_notch_is_not() {
        let whole = TriMesh::cuboid(Vec3::ZERO, Vec3::new(0.1, 0.1, 0.1));
        let (pieces, dropped) = decompose(&whole, &HullConfig::default());
        assert_eq!((pieces.len(), dropped, pieces[0].vertices.len()), (1, 0, 8));
        assert!((pieces[0].mass_integrals().volume - 1e-3).abs() < 1e-9);
        assert!(convex(&drawer()).is_none());
        let mut open = whole.clone();
        open.faces.pop();
        assert!(convex(&open).is_none(), "a sheet encloses nothing");
    }

    #[test]
    fn a_panic_of_the_decomposition_is_no_panic_of_ours() {
        assert_eq!(quietly(|| 1), Some(1));
        assert_eq!(quietly(|| -> u8 { panic!("no hull") }), None);
    }

    /// An open-top box out of five slabs, as one mesh.
    fn drawer() -> TriMesh {
        let t = 0.012;
        let mut mesh = TriMesh::default();
        for (lo, hi) in [
            ([0.0, 0.0, 0.0], [0.4, 0.3, t]),
            ([0.0, 0.0, t], [t, 0.3, 0.15]),
            ([0.4 - t, 0.0, t], [0.4, 0.3, 0.15]),
            ([t, 0.0, t], [0.4 - t, t, 0.15]),
            ([t, 0.3 - t, t], [0.4 - t, 0.3, 0.15]),
        ] {
            mesh.append(&TriMesh::cuboid(Vec3::from(lo), Vec3::from(hi)));
        }
        mesh
    }

    #[test]
    fn a_drawer_stays_open() {
        let (hulls, _) = decompose(&drawer(), &HullConfig::default());
        assert!(hulls.len() >= 5);
        // No hull reaches into the middle of the cavity.
        for hull in &hulls {
            assert!(hull.open_edges() == 0);
            let inside = |p: Vec3| {
                hull.faces.iter().all(|f| {
                    let [a, b, c] = f.map(|i| hull.vertices[i as usize]);
                    (b - a).cross(c - a).dot(p - a) <= 0.0
                })
            };
            for x in 0..10 {
                for y in 0..10 {
                    let p = Vec3::new(0.04 + 0.032 * x as f32, 0.04 + 0.022 * y as f32, 0.08);
                    assert!(!inside(p), "{p} is filled");
                }
            }
        }
    }
}
