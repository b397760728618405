//! The surfaces of a compiled model: geoms, meshes, materials, textures.

use super::{Reader, Seen};
use crate::SimError;
use crate::object::matrix;
use glam::{DVec3, Vec2, Vec3};
use hingecast_capture::object::{ArticulatedObject, Material, PartGeometry, Texture, shapes};
use hingecast_geom::Pose;
use mujoco_rs::prelude::*;
use mujoco_rs::wrappers::mj_model::traits::ModelType;
use std::collections::{BTreeMap, HashMap};

/// The first group that MuJoCo's viewer hides.
const HIDDEN_GROUP: i32 = 3;
/// The colour of a geom that was given none; any other one replaces its material's.
const NO_COLOR: [f32; 4] = [0.5, 0.5, 0.5, 1.0];

/// A texture as it is drawn: an image, or, where MuJoCo projects it in ways of its own, a colour.
#[derive(Clone, Copy)]
enum Paint {
    Image(usize),
    Color([f32; 3]),
}

impl Reader<'_> {
    /// Adds what is seen of every geom to its part.
    pub(super) fn geometry<M: ModelType>(
        &self,
        data: &MjData<M>,
        part_of: &[usize],
        object: &mut ArticulatedObject,
    ) -> Result<Seen, SimError> {
        let model = self.model;
        if model.ffi().nflex > 0 {
            return Err(self.refuse("the model holds cloth or another flex", "parts must be rigid"));
        }
        if model.ffi().nskin > 0 {
            object.notes.push("skins are left out".into());
        }
        let (mut seen, mut planes, mut paints) = (Seen::new(), 0, BTreeMap::new());
        for geom in 0..model.ffi().ngeom as usize {
            let body = model.geom_bodyid()[geom] as usize;
            let (rgba, texture) = self.look(geom);
            if rgba[3] == 0.0 || model.geom_group()[geom] >= HIDDEN_GROUP {
                continue;
            }
            if model.geom_type()[geom] == MjtGeomBase::mjGEOM_PLANE {
                planes += 1;
                continue;
            }
            let has_uv = self.mesh_of(geom).is_none_or(|mesh| model.mesh_texcoordadr()[mesh] >= 0);
            let paint = match texture {
                Some((id, _)) => Some(self.paint(id, has_uv, &mut paints, object)?),
                None => None,
            };
            let rgb = [rgba[0], rgba[1], rgba[2]];
            let material = match paint {
                Some(Paint::Image(image)) => Material { color: rgb, texture: Some(image) },
                Some(Paint::Color(c)) => Material { color: [0, 1, 2].map(|k| rgb[k] * c[k]), texture: None },
                None => Material { color: rgb, texture: None },
            };
            let material = object.material(material);
            let mut shape = self.shape(geom, material, texture.map_or([1.0; 2], |(_, repeat)| repeat))?;
            shape.materials.fill(material);
            let pose = Pose::from_mat3_trans(matrix(&data.geom_xmat()[geom]), DVec3::from(data.geom_xpos()[geom]));
            object.parts[part_of[body]].append(&shape, &pose, DVec3::ONE);
            seen.insert(self.name(MjtObjBase::mjOBJ_BODY, body));
        }
        if planes > 0 {
            object.notes.push(format!("{planes} planes are left out: they count as floor and wall"));
        }
        Ok(seen)
    }

    /// What the viewer draws it with: colour, texture and how often that repeats.
    fn look(&self, geom: usize) -> ([f32; 4], Option<(usize, [f32; 2])>) {
        let model = self.model;
        let own = model.geom_rgba()[geom];
        let Ok(mat) = usize::try_from(model.geom_matid()[geom]) else { return (own, None) };
        let roles = &model.mat_texid()[mat];
        let rgb = [MjtTextureRoleBase::mjTEXROLE_RGB, MjtTextureRoleBase::mjTEXROLE_RGBA]
            .into_iter()
            .find_map(|role| usize::try_from(roles[role as usize]).ok());
        let material = model.mat_rgba()[mat];
        // A ray, too, passes through a material of alpha 0.
        let mut rgba = if own == NO_COLOR { material } else { own };
        if material[3] == 0.0 {
            rgba[3] = 0.0;
        }
        (rgba, rgb.map(|id| (id, model.mat_texrepeat()[mat])))
    }

    fn mesh_of(&self, geom: usize) -> Option<usize> {
        // Primitives that were fitted to a mesh keep its number.
        let is_mesh = self.model.geom_type()[geom] == MjtGeomBase::mjGEOM_MESH;
        is_mesh.then(|| usize::try_from(self.model.geom_dataid()[geom]).ok()).flatten()
    }

    fn shape(&self, geom: usize, material: u32, repeat: [f32; 2]) -> Result<PartGeometry, SimError> {
        let [a, b, c] = self.model.geom_size()[geom];
        let mut shape = match self.model.geom_type()[geom] {
            MjtGeomBase::mjGEOM_BOX => shapes::cuboid(DVec3::new(a, b, c), material),
            MjtGeomBase::mjGEOM_SPHERE => shapes::ellipsoid(DVec3::splat(a), material),
            MjtGeomBase::mjGEOM_ELLIPSOID => shapes::ellipsoid(DVec3::new(a, b, c), material),
            MjtGeomBase::mjGEOM_CYLINDER => shapes::cylinder(a, b, material),
            MjtGeomBase::mjGEOM_CAPSULE => shapes::capsule(a, b, material),
            MjtGeomBase::mjGEOM_MESH => match self.mesh_of(geom) {
                Some(mesh) => self.mesh(mesh, material, repeat),
                None => PartGeometry::default(),
            },
            _ => {
                let what =
                    format!("{} is a height field or a signed distance", self.name(MjtObjBase::mjOBJ_GEOM, geom));
                return Err(self.refuse(what, "use meshes and primitive shapes"));
            }
        };
        if self.mesh_of(geom).is_none() {
            shape.uvs.iter_mut().for_each(|uv| *uv *= Vec2::from(repeat));
        }
        Ok(shape)
    }

    /// A mesh in the frame that MuJoCo gave it. Corners that agree in place, normal and texture
    /// coordinates are one vertex.
    fn mesh(&self, mesh: usize, material: u32, repeat: [f32; 2]) -> PartGeometry {
        let model = self.model;
        let first = |table: &[i32]| usize::try_from(table[mesh]).ok();
        let place = first(model.mesh_vertadr()).unwrap_or(0);
        let normal = first(model.mesh_normaladr()).unwrap_or(0);
        let uv = first(model.mesh_texcoordadr());
        let faces = first(model.mesh_faceadr()).unwrap_or(0);
        let mut out = PartGeometry::default();
        let mut known = HashMap::new();
        for face in faces..faces + model.mesh_facenum()[mesh] as usize {
            let corner = |k: usize, out: &mut PartGeometry, known: &mut HashMap<[i32; 3], u32>| {
                let [v, n, t] =
                    [model.mesh_face(), model.mesh_facenormal(), model.mesh_facetexcoord()].map(|f| f[face][k]);
                *known.entry([v, n, t]).or_insert_with(|| {
                    out.vertices.push(Vec3::from(model.mesh_vert()[place + v as usize]));
                    out.normals.push(Vec3::from(model.mesh_normal()[normal + n as usize]).normalize_or_zero());
                    // MuJoCo counts v from the image's top.
                    out.uvs.push(uv.map_or(Vec2::ZERO, |uv| {
                        let [u, v] = model.mesh_texcoord()[uv + t as usize];
                        Vec2::new(u * repeat[0], 1.0 - v * repeat[1])
                    }));
                    out.vertices.len() as u32 - 1
                })
            };
            let corners = [0, 1, 2].map(|k| corner(k, &mut out, &mut known));
            out.faces.push(corners);
        }
        out.materials = vec![material; out.faces.len()];
        out
    }

    /// The texture as an image of the object's, or its mean colour where its own coordinates are
    /// missing or it is a cube.
    fn paint(
        &self,
        id: usize,
        has_uv: bool,
        known: &mut BTreeMap<(usize, bool), Paint>,
        object: &mut ArticulatedObject,
    ) -> Result<Paint, SimError> {
        let model = self.model;
        let flat = has_uv && model.tex_type()[id] == MjtTexture::mjTEXTURE_2D;
        if let Some(paint) = known.get(&(id, flat)) {
            return Ok(*paint);
        }
        let bytes = model.load_texture(id).map_err(|e| SimError::load(self.file, e))?;
        let [width, height, channels] =
            [model.tex_width(), model.tex_height(), model.tex_nchannel()].map(|t| t[id] as usize);
        let pixels = bytes.chunks_exact(channels.max(1)).take(width * height);
        let rgb: Vec<u8> = pixels.flat_map(|p| if p.len() < 3 { [p[0]; 3] } else { [p[0], p[1], p[2]] }).collect();
        if rgb.is_empty() || rgb.len() != 3 * width * height {
            return Ok(Paint::Color([1.0; 3]));
        }
        let paint = if flat {
            object.textures.push(Texture::from_rgb(width, height, &rgb));
            Paint::Image(object.textures.len() - 1)
        } else {
            let mean = |c: usize| rgb.iter().skip(c).step_by(3).map(|&x| f64::from(x)).sum::<f64>();
            Paint::Color([0, 1, 2].map(|c| (mean(c) / (255 * width * height) as f64) as f32))
        };
        known.insert((id, flat), paint);
        Ok(paint)
    }
}
