//! Clutter: a low shelf at the wall, a box, a bucket and a ball, standing about on the floor.
//!
//! Pieces keep away from the space that the object needs, from each other and from the cameras. Of
//! the places tried, each takes the one where it hides the least of the object from the cameras.

use super::site::Site;
use crate::object::{PartGeometry, shapes};
use glam::{DMat3, DQuat, DVec2, DVec3, Vec2};
use hingecast_geom::Pose;

/// Free floor around the object's space, around a camera and between two pieces, m.
const APART: f64 = 0.11;
const FROM_CAMERAS: f64 = 0.15;
const BETWEEN: f64 = 0.04;
/// A piece stands at most this far from the object's space, times the size of the clutter, m.
const FARTHEST: f64 = 0.75;
/// Places that are tried.
const TRIES: usize = 200;
/// Clutter is as large as written here for an object of this diagonal, m; smaller beside a small
/// one, within the second line's bounds.
const USUAL: f64 = 0.8;
const SCALE: [f64; 2] = [0.35, 1.3];

/// Materials of the clutter, counted from the first one.
pub(super) const SHELF: u32 = 0;
pub(super) const BOX: u32 = 1;
pub(super) const BUCKET: u32 = 2;
pub(super) const BALL: u32 = 3;
pub(super) const BOOKS: u32 = 4;

/// A piece around the origin of its own frame: x along the wall, y away from it, z up from the
/// floor.
struct Piece {
    geometry: PartGeometry,
    /// Half sizes along x and y.
    half: DVec2,
    height: f64,
    /// Stands with its back to the wall.
    at_wall: bool,
}

/// All pieces at their places in the world. `eyes`: where cameras stand.
pub(super) fn stand_about(site: &Site, eyes: &[DVec3], first_material: u32, rng: &mut fastrand::Rng) -> PartGeometry {
    let diagonal = (site.hi - site.lo).length() / site.metre;
    let scale = (diagonal / USUAL).clamp(SCALE[0], SCALE[1]);
    let size = scale * site.metre;
    let eyes: Vec<DVec3> = eyes.iter().map(|x| on_floor(site, *x)).collect();
    let targets = targets(site);
    let mut out = PartGeometry::default();
    let mut taken: Vec<(DVec2, DVec2)> = Vec::new();
    for piece in pieces(size, first_material, rng) {
        let places: Vec<DVec2> = (0..TRIES).map(|_| place(site, &piece, size, rng)).collect();
        let free = |x: &&DVec2| {
            let clear = |(centre, half): &(DVec2, DVec2)| apart(**x, piece.half, *centre, *half) > BETWEEN * size;
            clear_of_object(site, **x, piece.half) > APART * site.metre
                && x.y - piece.half.y > site.wall
                && taken.iter().all(clear)
                && eyes.iter().all(|eye| !near(*eye, **x, &piece, FROM_CAMERAS * size))
        };
        let worth = |x: &DVec2| {
            let hidden = eyes.iter().map(|eye| hides(&targets, *eye, *x, &piece)).sum::<usize>();
            hidden as f64 + clear_of_object(site, *x, piece.half) / (FARTHEST * size)
        };
        let best = places.iter().filter(free).min_by(|a, b| worth(a).total_cmp(&worth(b)));
        if let Some(&x) = best {
            taken.push((x, piece.half));
            let turn = DQuat::from_mat3(&DMat3::from_cols(site.side, site.front, DVec3::Z));
            let at = site.side * x.x + site.front * x.y + DVec3::Z * site.floor;
            out.append(&piece.geometry, &Pose::new(turn, at), DVec3::ONE);
        }
    }
    out
}

/// `size`: scene units of a metre, times the scale of the clutter.
fn pieces(size: f64, material: u32, rng: &mut fastrand::Rng) -> Vec<Piece> {
    let mut between = |lo: f64, hi: f64| (lo + (hi - lo) * rng.f64()) * size;
    let shelf = shelf(DVec3::new(between(0.28, 0.36), between(0.11, 0.14), between(0.28, 0.36)), size, material);
    let half = DVec3::new(between(0.10, 0.16), between(0.08, 0.13), between(0.08, 0.14));
    let turn = DQuat::from_rotation_z(between(0.2, 1.3) / size);
    let mut cardboard = PartGeometry::default();
    let upright = Pose::new(turn, DVec3::Z * half.z);
    cardboard.append(&textured(&shapes::cuboid(half, material + BOX)), &upright, DVec3::ONE);
    let (radius, tall) = (between(0.06, 0.09), between(0.10, 0.14));
    let mut bucket = PartGeometry::default();
    let standing = Pose::from_trans(DVec3::Z * tall);
    bucket.append(&textured(&shapes::cylinder(radius, tall, material + BUCKET)), &standing, DVec3::ONE);
    let r = between(0.07, 0.11);
    let mut ball = PartGeometry::default();
    let resting = Pose::from_trans(DVec3::Z * r);
    ball.append(&textured(&shapes::ellipsoid(DVec3::splat(r), material + BALL)), &resting, DVec3::ONE);
    let around = half.truncate().length();
    let piece = |geometry, half, height| Piece { geometry, half, height, at_wall: false };
    vec![
        shelf,
        piece(cardboard, DVec2::splat(around), 2.0 * half.z),
        piece(bucket, DVec2::splat(radius), 2.0 * tall),
        piece(ball, DVec2::splat(r), 2.0 * r),
    ]
}

/// An open shelf with books on it. `outer`: half width, half depth and whole height.
fn shelf(outer: DVec3, size: f64, material: u32) -> Piece {
    let board = 0.011 * size;
    let mut out = PartGeometry::default();
    let mut put = |half: DVec3, at: DVec3, material: u32| {
        out.append(&textured(&shapes::cuboid(half, material)), &Pose::from_trans(at), DVec3::ONE);
    };
    for side in [-1.0, 1.0] {
        let half = DVec3::new(board, outer.y, 0.5 * outer.z);
        put(half, DVec3::new(side * (outer.x - board), 0.0, 0.5 * outer.z), material + SHELF);
    }
    for height in [0.12, 0.55, 1.0] {
        let half = DVec3::new(outer.x - 2.0 * board, outer.y, board);
        put(half, DVec3::Z * (height * outer.z - board), material + SHELF);
    }
    // Thickness and height of each book, m; all on one half of the shelf.
    let books = [(0.03, 0.21), (0.045, 0.17), (0.025, 0.24), (0.05, 0.19), (0.035, 0.15)];
    let mut x = -outer.x + 3.0 * board;
    for (k, (thick, tall)) in books.into_iter().enumerate() {
        let half = 0.5 * size * DVec3::new(0.8 * thick, 0.13, 0.9 * tall);
        put(half, DVec3::new(x + half.x, 0.1 * outer.y, outer.z + half.z), material + BOOKS + k as u32 % 3);
        x += 2.0 * half.x + 0.002 * size;
    }
    Piece { geometry: out, half: outer.truncate(), height: outer.z + 0.24 * size, at_wall: true }
}

/// The same surface with texture coordinates by position: each face is seen along the axis that it
/// faces most, the whole piece within 0..1.
fn textured(mesh: &PartGeometry) -> PartGeometry {
    let reach = mesh.vertices.iter().map(|v| v.abs().max_element()).fold(f32::MIN_POSITIVE, f32::max);
    let mut out = PartGeometry { materials: mesh.materials.clone(), ..Default::default() };
    for face in &mesh.faces {
        let [a, b, c] = face.map(|i| mesh.vertices[i as usize]);
        let across = (b - a).cross(c - a).abs();
        for &i in face {
            let x = mesh.vertices[i as usize] / reach * 0.5 + 0.5;
            let uv = match across.max_position() {
                0 => Vec2::new(x.y, x.z),
                1 => Vec2::new(x.x, x.z),
                _ => Vec2::new(x.x, x.y),
            };
            out.vertices.push(mesh.vertices[i as usize]);
            out.normals.push(mesh.normals[i as usize]);
            out.uvs.push(uv);
        }
        let n = out.vertices.len() as u32;
        out.faces.push([n - 3, n - 2, n - 1]);
    }
    out
}

/// Somewhere in front of the wall, coordinates along it and away from it.
fn place(site: &Site, piece: &Piece, size: f64, rng: &mut fastrand::Rng) -> DVec2 {
    let [along, away] = site.footprint();
    let reach = FARTHEST * size + piece.half.max_element();
    let mut between = |lo: f64, hi: f64| lo + (hi - lo) * rng.f64();
    let x = between(along[0] - reach, along[1] + reach);
    let y = between(site.wall + piece.half.y, away[1] + 0.5 * reach);
    DVec2::new(x, if piece.at_wall { site.wall + piece.half.y + 0.004 * site.metre } else { y })
}

/// Distance of a piece from the space that the object needs.
fn clear_of_object(site: &Site, centre: DVec2, half: DVec2) -> f64 {
    let [along, away] = site.footprint();
    let (lo, hi) = (DVec2::new(along[0], away[0]), DVec2::new(along[1], away[1]));
    apart(centre, half, 0.5 * (lo + hi), 0.5 * (hi - lo))
}

/// Distance of two rectangles along the axes; 0 when they overlap.
fn apart(a: DVec2, half_a: DVec2, b: DVec2, half_b: DVec2) -> f64 {
    ((a - b).abs() - half_a - half_b).max(DVec2::ZERO).length()
}

/// A point of the world in coordinates along the wall, away from it, and above the floor.
fn on_floor(site: &Site, x: DVec3) -> DVec3 {
    DVec3::new(x.dot(site.side), x.dot(site.front), x.z - site.floor)
}

fn near(eye: DVec3, at: DVec2, piece: &Piece, distance: f64) -> bool {
    eye.z < piece.height + distance && apart(eye.truncate(), DVec2::ZERO, at, piece.half) < distance
}

/// Points that cameras should see: the middle of the object's space and its sides, below half
/// height.
fn targets(site: &Site) -> [DVec3; 5] {
    let [along, away] = site.footprint();
    let height = 0.3 * (site.hi.z - site.floor);
    let at =
        |a: f64, b: f64| DVec3::new(along[0] + a * (along[1] - along[0]), away[0] + b * (away[1] - away[0]), height);
    [at(0.5, 0.5), at(0.05, 0.5), at(0.95, 0.5), at(0.5, 0.05), at(0.5, 0.95)]
}

/// How many lines from the camera to the targets pass through the piece.
fn hides(targets: &[DVec3], eye: DVec3, at: DVec2, piece: &Piece) -> usize {
    let through = |target: &&DVec3| {
        (1..32).any(|k| {
            let x = eye.lerp(**target, f64::from(k) / 32.0);
            x.z < piece.height && ((x.truncate() - at).abs() - piece.half).max_element() < 0.0
        })
    };
    targets.iter().filter(through).count()
}
