//! A box out of a surface's room, with what of the surface lies in it.

use super::convex::{self, Convex};
use super::room::Room;
use glam::Vec3;
use hingecast_geom::TriMesh;

type Triangle = [Vec3; 3];

/// How near to a cut, as a share of the reach, what faces away from it is the other side's skin.
const SKIN: f32 = 0.5;
/// Cosine of the angle to the cut's normal within which a face faces along it.
const FACING: f32 = 0.7;

/// What lies in a box.
pub struct Cell {
    /// Corners of the box.
    lo: Vec3,
    hi: Vec3,
    /// The surface, cut at the box.
    pub soup: Vec<Triangle>,
    /// Its corners, and those of the box that are in the solid.
    points: Vec<Vec3>,
    /// Convex hull of the solid in the box.
    pub hull: Convex,
}

impl Cell {
    /// All of a mesh.
    pub fn whole(mesh: &TriMesh, room: &Room) -> Option<Self> {
        let (lo, hi) = mesh.bounds()?;
        let soup = mesh.faces.iter().map(|f| f.map(|i| mesh.vertices[i as usize])).collect();
        Self::of(lo, hi, soup, room)
    }

    /// Roughly the volume of the hulls of both sides of a cut.
    pub fn volume_cut(&self, axis: usize, at: f32, room: &Room) -> f64 {
        let cut: Vec<Vec3> = self
            .soup
            .iter()
            .flat_map(|t| (0..3).map(move |k| (t[k], t[(k + 1) % 3])))
            .filter(|(a, b)| (a[axis] < at) != (b[axis] < at))
            .map(|(a, b)| a.lerp(b, (at - a[axis]) / (b[axis] - a[axis])))
            .collect();
        let (mut hi, mut lo) = (self.hi, self.lo);
        (hi[axis], lo[axis]) = (at, at);
        let volume = |lo, hi, below: bool| {
            let side = self.points.iter().filter(|p| (p[axis] < at) == below);
            let points: Vec<Vec3> = side.chain(&cut).copied().chain(corners(lo, hi, room)).collect();
            convex::hull(&convex::extreme(&points, convex::ROUGH)).map_or(0.0, |h| h.volume)
        };
        volume(self.lo, hi, true) + volume(lo, self.hi, false)
    }

    fn of(lo: Vec3, hi: Vec3, soup: Vec<Triangle>, room: &Room) -> Option<Self> {
        let mut points: Vec<Vec3> = soup.iter().flatten().copied().collect();
        points.sort_unstable_by_key(|p| p.to_array().map(f32::to_bits));
        points.dedup();
        points.extend(corners(lo, hi, room));
        let few = convex::extreme(&points, convex::FINE);
        let hull = convex::hull(&few).or_else(|| convex::hull(&thickened(&few, 0.5 * room.cell)))?;
        Some(Self { lo, hi, soup, points, hull })
    }

    /// The two sides of a cut at `at` along `axis`. Sides without a volume are left out.
    pub fn cut(&self, axis: usize, at: f32, room: &Room) -> [Option<Self>; 2] {
        let [mut below, mut above] = halves(&self.soup, axis, at);
        // What faces away from a cut that it lies at is the other side's surface.
        let skin = SKIN * room.reach;
        let up = |t: &mut Triangle| along(t, axis) > FACING && t.iter().all(|p| p[axis] <= at + skin);
        let down = |t: &mut Triangle| along(t, axis) < -FACING && t.iter().all(|p| p[axis] >= at - skin);
        let (tops, bottoms): (Vec<_>, Vec<_>) =
            (above.extract_if(.., up).collect(), below.extract_if(.., down).collect());
        below.extend(tops);
        above.extend(bottoms);
        let (mut hi, mut lo) = (self.hi, self.lo);
        (hi[axis], lo[axis]) = (at, at);
        [Self::of(self.lo, hi, below, room), Self::of(lo, self.hi, above, room)]
    }
}

/// Corners of a box that are in the solid: where three cuts meet there, no surface shows it.
fn corners(lo: Vec3, hi: Vec3, room: &Room) -> impl Iterator<Item = Vec3> {
    let corner = move |k: usize| Vec3::new([lo, hi][k % 2].x, [lo, hi][k / 2 % 2].y, [lo, hi][k / 4].z);
    (0..8).map(corner).filter(|x| room.deep(*x))
}

/// The part of a triangle's unit normal along an axis.
fn along(t: &Triangle, axis: usize) -> f32 {
    (t[1] - t[0]).cross(t[2] - t[0]).normalize_or_zero()[axis]
}

/// A sheet has no volume: points on both sides of it.
fn thickened(points: &[Vec3], by: f32) -> Vec<Vec3> {
    let Some(&a) = points.first() else { return Vec::new() };
    let far =
        |from: &dyn Fn(Vec3) -> f32| points.iter().copied().max_by(|p, q| from(*p).total_cmp(&from(*q))).unwrap_or(a);
    let b = far(&|p| (p - a).length());
    let c = far(&|p| (p - a).cross(b - a).length());
    let Some(n) = (b - a).cross(c - a).try_normalize() else { return Vec::new() };
    points.iter().flat_map(|p| [*p + n * by, *p - n * by]).collect()
}

/// Triangles cut at a plane across `axis`: what is below, what is above.
fn halves(soup: &[Triangle], axis: usize, at: f32) -> [Vec<Triangle>; 2] {
    let mut out = [Vec::new(), Vec::new()];
    for t in soup {
        let low = t.iter().filter(|p| p[axis] <= at).count();
        let high = t.iter().filter(|p| p[axis] >= at).count();
        if low == 3 || high == 3 {
            out[usize::from(low != 3)].push(*t);
            continue;
        }
        for (side, part) in out.iter_mut().enumerate() {
            let height = |p: Vec3| if side == 0 { at - p[axis] } else { p[axis] - at };
            let mut polygon: Vec<Vec3> = Vec::with_capacity(4);
            for k in 0..3 {
                let (a, b) = (t[k], t[(k + 1) % 3]);
                if height(a) >= 0.0 {
                    polygon.push(a);
                }
                if height(a) * height(b) < 0.0 {
                    polygon.push(a.lerp(b, height(a) / (height(a) - height(b))));
                }
            }
            part.extend((2..polygon.len()).map(|k| [polygon[0], polygon[k - 1], polygon[k]]));
        }
    }
    out
}
