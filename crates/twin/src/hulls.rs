//! Collision shapes: convex pieces, every one checked.

use crate::pieces;
use glam::Vec3;
use hingecast_geom::TriMesh;
use parry3d::math::Vector;
use parry3d::transformation::try_convex_hull;
use std::cell::Cell;
use std::panic::AssertUnwindSafe;
use std::sync::Once;

/// Convex hulls that together cover `mesh`, and how many pieces were dropped as flat or broken.
pub fn decompose(mesh: &TriMesh, config: &pieces::Config) -> (Vec<TriMesh>, usize) {
    let Some((lo, hi)) = mesh.bounds() else { return (Vec::new(), 0) };
    if let Some(whole) = convex(mesh) {
        return (vec![whole], 0);
    }
    let mut pieces = quietly(|| pieces::decompose(mesh, config)).unwrap_or_default();
    if pieces.is_empty() {
        // Of what cannot be cut, the hull of the whole.
        pieces.extend(hull_of(&mesh.vertices));
    }
    let total = pieces.len();
    let thinnest = 1e-3 * (hi - lo).length();
    pieces.retain(|h| usable(h, thinnest));
    let dropped = total - pieces.len();
    (pieces, dropped)
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
    let hull = hull_of(&mesh.vertices)?;
    let (lo, hi) = mesh.bounds()?;
    let alike = volume >= CONVEX * hull.mass_integrals().volume;
    (alike && hull.vertices.len() <= MOST_CORNERS && usable(&hull, 1e-3 * (hi - lo).length())).then_some(hull)
}

/// Points as parry takes them.
pub(crate) fn vectors(points: &[Vec3]) -> Vec<Vector> {
    points.iter().map(|v| Vector::new(v.x, v.y, v.z)).collect()
}

/// The convex hull of some points, unless they lie in a plane. (On some, parry panics.)
pub(crate) fn hull_of(points: &[Vec3]) -> Option<TriMesh> {
    let points = vectors(points);
    let (vertices, faces) = quietly(|| try_convex_hull(&points).ok()).flatten()?;
    let vertices = vertices.into_iter().map(|p| Vec3::new(p.x, p.y, p.z)).collect();
    Some(TriMesh { vertices, faces, colors: Vec::new() })
}

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
    let outer = CATCHING.replace(true);
    let answer = std::panic::catch_unwind(AssertUnwindSafe(work)).ok();
    CATCHING.set(outer);
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
    fn a_box_is_convex_and_a_sheet_or_a_notched_box_is_not() {
        let whole = TriMesh::cuboid(Vec3::ZERO, Vec3::new(0.1, 0.1, 0.1));
        let (pieces, dropped) = decompose(&whole, &pieces::Config { reach: 1e-3, most: 8 });
        assert_eq!((pieces.len(), dropped, pieces[0].vertices.len()), (1, 0, 8));
        assert!((pieces[0].mass_integrals().volume - 1e-3).abs() < 1e-9);
        let mut notched = whole.clone();
        notched.append(&TriMesh::cuboid(Vec3::new(0.1, 0.0, 0.0), Vec3::new(0.15, 0.1, 0.05)));
        assert!(convex(&notched).is_none());
        let mut open = whole.clone();
        open.faces.pop();
        assert!(convex(&open).is_none(), "a sheet encloses nothing");
    }

    #[test]
    fn a_panic_of_the_decomposition_is_no_panic_of_ours() {
        assert_eq!(quietly(|| 1), Some(1));
        assert_eq!(quietly(|| -> u8 { panic!("no hull") }), None);
    }
}
