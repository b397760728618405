use super::*;
use glam::{Quat, Vec3};

/// Thickness of a drawer's boards.
const BOARD: f32 = 0.012;
const CLOSELY: Config = Config { reach: 0.0015, most: 24 };

/// An open-top box, 0.4 by 0.3 by 0.15, as one surface without inner faces.
fn drawer() -> TriMesh {
    let outer = TriMesh::cuboid(Vec3::ZERO, Vec3::new(0.4, 0.3, 0.15));
    let inner = TriMesh::cuboid(Vec3::splat(BOARD), Vec3::new(0.4 - BOARD, 0.3 - BOARD, 0.15));
    let mut mesh = TriMesh::default();
    let top = |mesh: &TriMesh, f: &[u32; 3]| f.iter().all(|&i| mesh.vertices[i as usize].z == 0.15);
    let mut shell = outer.clone();
    shell.faces.retain(|f| !top(&outer, f));
    mesh.append(&shell);
    let mut hollow = inner.clone();
    hollow.faces.retain(|f| !top(&inner, f));
    hollow.faces.iter_mut().for_each(|f| f.swap(0, 1));
    mesh.append(&hollow);
    // The rim, between the upper corners of both: 4, 5, 7, 6 in turn.
    for (a, b) in [(4, 5), (5, 7), (7, 6), (6, 4)] {
        mesh.faces.push([a, b, b + 8]);
        mesh.faces.push([a, b + 8, a + 8]);
    }
    mesh
}

fn turned(mesh: &TriMesh, by: Quat) -> TriMesh {
    let vertices = mesh.vertices.iter().map(|v| by * *v).collect();
    TriMesh { vertices, ..mesh.clone() }
}

fn volume(pieces: &[TriMesh]) -> f64 {
    pieces.iter().map(|p| p.mass_integrals().volume).sum()
}

fn inside(piece: &TriMesh, x: Vec3) -> bool {
    piece.faces.iter().all(|f| {
        let [a, b, c] = f.map(|i| piece.vertices[i as usize]);
        (b - a).cross(c - a).dot(x - a) <= 1e-9
    })
}

#[test]
fn a_drawer_is_five_boards_however_it_lies() {
    let drawer = drawer();
    let real = drawer.mass_integrals().volume;
    assert_eq!(drawer.open_edges(), 0);
    for by in [Quat::IDENTITY, Quat::from_euler(glam::EulerRot::XYZ, 0.4, -0.7, 1.1)] {
        let pieces = decompose(&turned(&drawer, by), &CLOSELY);
        assert_eq!(pieces.len(), 5);
        assert!(pieces.iter().all(|p| crate::cuboid::of(p).is_some() && p.open_edges() == 0));
        let share = volume(&pieces) / real;
        assert!((0.95..1.05).contains(&share), "{share}");
        for k in 0..100 {
            let x = Vec3::new(0.03 + 0.0375 * (k % 10) as f32, 0.03 + 0.026 * (k / 10) as f32, 0.08);
            assert!(pieces.iter().all(|p| !inside(p, by * x)), "{x} is filled");
        }
    }
}

#[test]
fn a_handle_stays_open_behind() {
    let mut door = TriMesh::cuboid(Vec3::ZERO, Vec3::new(0.4, 0.02, 0.6));
    for (lo, hi) in [
        ([0.03, 0.02, 0.2], [0.045, 0.06, 0.215]),
        ([0.03, 0.02, 0.385], [0.045, 0.06, 0.4]),
        ([0.03, 0.06, 0.2], [0.045, 0.075, 0.4]),
    ] {
        door.append(&TriMesh::cuboid(Vec3::from(lo), Vec3::from(hi)));
    }
    let pieces = decompose(&door, &CLOSELY);
    assert!((3..=4).contains(&pieces.len()), "{}", pieces.len());
    let held = |x: [f32; 3]| pieces.iter().any(|p| inside(p, Vec3::from(x)));
    assert!(held([0.037, 0.067, 0.3]), "the bar is there");
    assert!(!held([0.037, 0.04, 0.3]), "a finger fits behind it");
}

#[test]
fn a_ring_keeps_its_hole_and_to_the_number_asked() {
    let (sides, mut ring) = (48, TriMesh::default());
    let at = |k: usize, r: f32, z: f32| {
        let turn = std::f32::consts::TAU * k as f32 / sides as f32;
        Vec3::new(r * turn.cos(), r * turn.sin(), z)
    };
    for k in 0..sides {
        ring.vertices.extend([at(k, 0.2, 0.0), at(k, 0.2, 0.05), at(k, 0.15, 0.05), at(k, 0.15, 0.0)]);
        let corner = |j: usize, side: usize| (4 * ((k + side) % sides) + j % 4) as u32;
        for j in 0..4 {
            let [a, b, c, d] = [corner(j, 0), corner(j, 1), corner(j + 1, 1), corner(j + 1, 0)];
            ring.faces.extend([[a, b, c], [a, c, d]]);
        }
    }
    assert_eq!(ring.open_edges(), 0);
    let real = ring.mass_integrals().volume;
    assert!(real > 0.0);
    let fine = decompose(&ring, &CLOSELY);
    assert!((8..=24).contains(&fine.len()) && volume(&fine) / real < 1.2, "{} {}", fine.len(), volume(&fine) / real);
    assert!(fine.iter().all(|p| !inside(p, Vec3::new(0.0, 0.0, 0.025))), "the hole is filled");
    let few = decompose(&ring, &Config { most: 4, ..CLOSELY });
    assert!(few.len() <= 4 && !few.is_empty());
}

#[test]
fn a_sheet_becomes_a_plate_and_nothing_stays_nothing() {
    let mut sheet = TriMesh::cuboid(Vec3::ZERO, Vec3::new(0.3, 0.2, 0.0));
    sheet.faces.truncate(2);
    let pieces = decompose(&sheet, &CLOSELY);
    assert_eq!(pieces.len(), 1);
    assert!(volume(&pieces) > 0.0);
    assert!(decompose(&TriMesh::default(), &CLOSELY).is_empty());
}
