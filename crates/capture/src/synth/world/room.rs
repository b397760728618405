//! The room: a wooden floor, a papered wall behind the object, clutter. Only what a camera in front
//! of the wall sees is there; beyond the edges is the background.

use super::site::Site;
use super::{clutter, patterns};
use crate::object::texture::Texture;
use crate::object::{Material, PartGeometry};
use glam::{DVec3, Vec2, Vec3};
use hingecast_geom::Camera;

/// Edge of the floor and length of the wall, m; more behind a large object, as its second line
/// says: that many times what it needs.
const EDGE: [f64; 2] = [3.0, 4.0];
const AROUND: f64 = 2.5;
/// Height of the wall, m, and at least this many times the object's.
const HEIGHT: f64 = 2.6;
const ABOVE: f64 = 1.3;
/// A plank's width, m.
const PLANK: f64 = 0.13;

/// World frame, scene units.
pub(crate) struct Room {
    pub geometry: PartGeometry,
    /// Those of the geometry's numbers from `first_material` on; textures count along `textures`.
    pub materials: Vec<Material>,
    pub textures: Vec<Texture>,
}

impl Room {
    /// `first_material`: the numbers before it are taken. `cameras` of all views: none of them
    /// shall stand in the clutter.
    pub fn new(site: &Site, cameras: &[Camera], first_material: u32, seed: u64) -> Self {
        let mut rng = fastrand::Rng::with_seed((seed ^ 0x726f_6f6d).wrapping_mul(0x9e37_79b9_7f4a_7c15));
        let [along, away] = site.footprint();
        let needed = (along[1] - along[0]).max(away[1] - away[0]);
        let edge = ((EDGE[0] + (EDGE[1] - EDGE[0]) * rng.f64()) * site.metre).max(AROUND * needed);
        let height = (HEIGHT * site.metre).max(ABOVE * (site.hi.z - site.lo.z));
        // The object does not stand in the very middle of the wall.
        let left = 0.5 * (along[0] + along[1]) - edge * (0.5 + 0.1 * (rng.f64() - 0.5));
        let corner = site.side * left + site.front * site.wall + DVec3::Z * site.floor;
        let (side, front, up) = (site.side * edge, site.front * edge, DVec3::Z * height);

        let mut geometry = PartGeometry::default();
        quad(&mut geometry, corner, side, front, first_material);
        quad(&mut geometry, corner, side, up, first_material + 1);
        let eyes: Vec<DVec3> = cameras.iter().map(Camera::centre).collect();
        append(&mut geometry, clutter::stand_about(site, &eyes, first_material + 2, &mut rng));

        let planks = (edge / site.metre / PLANK).ceil() as usize;
        let textures = vec![
            patterns::planks(planks, &mut rng),
            patterns::wallpaper(&mut rng),
            patterns::grain(&mut rng),
            patterns::cardboard(&mut rng),
            patterns::rings(Vec3::new(0.20, 0.42, 0.46), Vec3::new(0.80, 0.80, 0.74), &mut rng),
            patterns::blotches(Vec3::new(0.78, 0.30, 0.20), Vec3::new(0.90, 0.76, 0.30), &mut rng),
            patterns::blotches(Vec3::splat(0.72), Vec3::splat(0.86), &mut rng),
        ];
        let plain = |texture: usize| Material { color: [1.0; 3], texture: Some(texture) };
        let book = |color: [f32; 3]| Material { color, texture: Some(textures.len() - 1) };
        let mut materials: Vec<Material> = (0..textures.len() - 1).map(plain).collect();
        materials.extend([book([0.62, 0.24, 0.28]), book([0.26, 0.34, 0.62]), book([0.30, 0.55, 0.36])]);
        Self { geometry, materials, textures }
    }
}

/// A rectangle at `corner` with the edges `u` and `v`, textured from 0 to 1 along both.
fn quad(out: &mut PartGeometry, corner: DVec3, u: DVec3, v: DVec3, material: u32) {
    let base = out.vertices.len() as u32;
    for (a, b) in [(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)] {
        out.vertices.push((corner + u * a + v * b).as_vec3());
        out.normals.push(u.cross(v).normalize().as_vec3());
        out.uvs.push(Vec2::new(a as f32, b as f32));
    }
    out.faces.extend([[base, base + 1, base + 2], [base, base + 2, base + 3]]);
    out.materials.extend([material; 2]);
}

fn append(out: &mut PartGeometry, more: PartGeometry) {
    out.append(&more, &hingecast_geom::Pose::IDENTITY, DVec3::ONE);
}
