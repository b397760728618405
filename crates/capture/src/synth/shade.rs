//! The look of a surface point: diffuse colour under fixed lights of mild contrast. All in linear
//! light.
//!
//! Nothing is cast: no shadows, no highlights, so that a point keeps its colour while cameras move
//! and changes it only mildly when its part turns, as under a cloudy sky.

use super::occluder;
use super::scene::Hit;
use super::world::Room;
use crate::object::texture::Texture;
use crate::object::{ArticulatedObject, Material, PartGeometry};
use glam::{Vec2, Vec3, Vec3A};

/// Light from below and above (blended by the normal), and two soft lamps: direction to the lamp
/// and strength. White under all of them stays below 1, so nothing is clipped.
const GROUND: f32 = 0.42;
const SKY: f32 = 0.58;
const LAMPS: [([f32; 3], f32); 2] = [([0.48, -0.36, 0.80], 0.28), ([-0.74, 0.56, 0.37], 0.12)];

/// What shading needs: the parts (a room and hands may follow the object's own), materials, and per
/// face how many texels a unit of length covers, for the mip level.
pub(crate) struct Looks<'a> {
    parts: Vec<&'a PartGeometry>,
    materials: Vec<Material>,
    textures: Vec<&'a Texture>,
    /// Linear-light colour per material.
    colors: Vec<Vec3>,
    /// log2 of texels per scene unit, per part and face.
    density: Vec<Vec<f32>>,
}

impl<'a> Looks<'a> {
    pub fn new(
        object: &'a ArticulatedObject,
        room: Option<&'a Room>,
        hands: impl IntoIterator<Item = &'a PartGeometry>,
    ) -> Self {
        let linear =
            |c: [f32; 3]| Vec3::from_array(c.map(|x| crate::object::texture::linear_from_srgb(x.clamp(0.0, 1.0))));
        let parts: Vec<&PartGeometry> = object.parts.iter().chain(room.map(|r| &r.geometry)).chain(hands).collect();
        let mut materials = object.materials.clone();
        materials.push(Material { color: occluder::SKIN, texture: None });
        let mut textures: Vec<&Texture> = object.textures.iter().collect();
        if let Some(room) = room {
            let after = |m: &Material| Material { texture: m.texture.map(|t| t + textures.len()), ..*m };
            materials.extend(room.materials.iter().map(after));
            textures.extend(&room.textures);
        }
        let colors = materials.iter().map(|m| linear(m.color)).collect();
        let density = parts
            .iter()
            .map(|p| {
                let of_face = |(f, &m): (&[u32; 3], &u32)| {
                    let Some(texture) = materials[m as usize].texture else { return 0.0 };
                    let size = textures[texture].size();
                    let [a, b, c] = f.map(|i| p.uvs[i as usize] * size);
                    let texels = (b - a).perp_dot(c - a).abs();
                    let [a, b, c] = f.map(|i| p.vertices[i as usize]);
                    let area = (b - a).cross(c - a).length();
                    0.5 * (texels.max(1e-6) / area.max(1e-12)).log2()
                };
                p.faces.iter().zip(&p.materials).map(of_face).collect()
            })
            .collect();
        Self { parts, materials, textures, colors, density }
    }

    /// Same part, same material.
    pub fn alike(&self, a: &Hit, b: &Hit) -> bool {
        let material = |h: &Hit| self.parts[h.part].materials[h.face];
        a.part == b.part && material(a) == material(b)
    }

    /// Linear-light colour of a hit. `footprint` is the side of the sample's patch at the hit,
    /// scene units; `turn` rotates canonical normals into the world.
    pub fn shade(&self, hit: &Hit, direction: Vec3A, footprint: f32, turn: glam::Quat) -> Vec3 {
        let part = self.parts[hit.part];
        let corners = part.faces[hit.face].map(|i| i as usize);
        let weights = [1.0 - hit.u - hit.v, hit.u, hit.v];
        let material = part.materials[hit.face] as usize;
        let mut albedo = self.colors[material];
        if let Some(texture) = self.materials[material].texture {
            let uv = corners.iter().zip(weights).fold(Vec2::ZERO, |sum, (&i, w)| sum + part.uvs[i] * w);
            let level = self.density[hit.part][hit.face] + footprint.log2();
            albedo *= self.textures[texture].sample(uv, level);
        }
        // Both sides are lit alike: the normal faces the camera.
        let facing = if hit.normal.dot(direction) > 0.0 { -hit.normal } else { hit.normal };
        let smooth = corners.iter().zip(weights).fold(Vec3::ZERO, |sum, (&i, w)| sum + part.normals[i] * w);
        let smooth = Vec3A::from(turn * smooth.normalize_or_zero());
        let smooth = if smooth.dot(facing) < 0.0 { -smooth } else { smooth };
        // Normals that disagree with the face come from broken files.
        let normal = if smooth.dot(facing) > 0.5 { smooth } else { facing };
        albedo * light(normal)
    }
}

fn light(normal: Vec3A) -> f32 {
    let ambient = GROUND + (SKY - GROUND) * (0.5 + 0.5 * normal.z);
    LAMPS.iter().fold(ambient, |sum, &(to_lamp, strength)| {
        sum + strength * normal.dot(Vec3A::from_array(to_lamp).normalize()).max(0.0)
    })
}
