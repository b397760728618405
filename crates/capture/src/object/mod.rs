//! Articulated objects with their looks: what `synth` renders and `rollout` compares with.
//!
//! Geometry stands in the world frame (z up) with every joint at 0, the canonical configuration, as
//! the tree's screws do.

mod mesh_file;
mod mjcf;
mod mjcf_known;
pub mod shapes;
mod text;
pub(crate) mod texture;
mod urdf;
mod xml;

pub use texture::Texture;

use crate::CaptureError;
use glam::{DVec3, Vec2, Vec3};
use hingecast_geom::{KinematicTree, Pose, TriMesh};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// Deepest nesting of elements that is read; robots and furniture stay below 50.
const MOST_LEVELS: usize = 256;
/// Most parts of an object.
const MOST_PARTS: usize = 254;

/// An object with joints. `tree.parts[i]` names `parts[i]`; the joints' `values` are empty.
#[derive(Clone, Debug, Default)]
pub struct ArticulatedObject {
    /// Name, for recordings and reports.
    pub name: String,
    /// The file it came from.
    pub source: PathBuf,
    /// Lengths are metres; PartNet-Mobility objects are scaled to a diagonal of about 2 instead.
    pub metric: bool,
    /// Parts and joints; the screws stand in the canonical world frame.
    pub tree: KinematicTree,
    /// Geometry of every part; index = part id.
    pub parts: Vec<PartGeometry>,
    /// What the faces of all parts look like.
    pub materials: Vec<Material>,
    /// What the materials refer to.
    pub textures: Vec<Texture>,
    /// What was left out or assumed when it was loaded, one sentence each.
    pub notes: Vec<String>,
}

/// The triangles of one part, canonical world frame. Vertex arrays have one length.
#[derive(Clone, Debug, Default)]
pub struct PartGeometry {
    /// Links of the source that this part is made of (fixed and minor joints merge links).
    pub links: Vec<String>,
    /// Positions, scene units. (n, 3)
    pub vertices: Vec<Vec3>,
    /// Unit, or zero where the file has none.
    pub normals: Vec<Vec3>,
    /// Texture coordinates, v up as in OBJ. (n, 2)
    pub uvs: Vec<Vec2>,
    /// Indices of three vertices a triangle. (m, 3)
    pub faces: Vec<[u32; 3]>,
    /// Index into `materials`, one a face.
    pub materials: Vec<u32>,
}

/// Diffuse colour (sRGB, 0..1) times texture.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Material {
    /// sRGB, 0..1.
    pub color: [f32; 3],
    /// Index into the object's textures.
    pub texture: Option<usize>,
}

impl ArticulatedObject {
    /// Loads a URDF or MJCF file, or a folder with `mobility.urdf`, `object.xml`, or a single such
    /// file. Of MJCF a part is understood and the rest refused: `hingecast::objects::load` has
    /// MuJoCo read it.
    ///
    /// # Errors
    /// When nothing is found, or the description or one of its meshes cannot be read.
    pub fn load(path: &Path) -> Result<Self, CaptureError> {
        let file = if path.is_dir() { description_in(path)? } else { path.to_path_buf() };
        let text = text::read(&file)?;
        let xml = roxmltree::Document::parse(&text).map_err(|e| {
            // Without its namespace, xacro is not even XML.
            if matches!(&e, roxmltree::Error::UnknownNamespace(prefix, _) if prefix == "xacro") {
                return urdf::not_expanded(&file);
            }
            let hint = "open it in an XML editor at that line, or export it again";
            CaptureError::new(format!("the object file is not XML: {e}"), file.display().to_string(), hint)
        })?;
        flat_enough(&file, &xml)?;
        match xml.root_element().tag_name().name() {
            "robot" => urdf::load(&file, &xml),
            "mujoco" => mjcf::load(&file, &xml),
            other => Err(CaptureError::new(
                format!("the object file starts with <{other}>; <robot> (URDF) or <mujoco> (MJCF) is expected"),
                file.display().to_string(),
                "point at a URDF or MJCF file",
            )),
        }
    }

    /// The MJCF file at `path` (a file, or a folder as in [`Self::load`]); `None` if it is anything
    /// else. Deeply nested files are refused: readers walk them by recursion.
    ///
    /// # Errors
    /// A file that cannot be read or is nested too deeply.
    pub fn mjcf_at(path: &Path) -> Result<Option<PathBuf>, CaptureError> {
        let file = if path.is_dir() { description_in(path)? } else { path.to_path_buf() };
        let bytes = std::fs::read(&file).map_err(|e| CaptureError::read(&file, e))?;
        let text = String::from_utf8_lossy(&bytes);
        let Ok(xml) = roxmltree::Document::parse(&text) else { return Ok(None) };
        if xml.root_element().tag_name().name() != "mujoco" {
            return Ok(None);
        }
        flat_enough(&file, &xml)?;
        Ok(Some(file))
    }

    /// Finds an OBJECT argument: a path, or a bare name in `objects/` (here or in
    /// `$HINGECAST_OBJECTS`), in `$HINGECAST_DATA/partnet-mobility-dev/`, or in the `objects/` that
    /// the running program lies below: that of the repository it was built in.
    ///
    /// # Errors
    /// When it is nowhere; the hint lists the places.
    pub fn resolve(argument: &str) -> Result<PathBuf, CaptureError> {
        // A bare name may also be that of a recording made here before: that is no object.
        let is_object = |p: &PathBuf| p.is_file() || (p.is_dir() && description_in(p).is_ok());
        let path = PathBuf::from(argument);
        if is_object(&path) || path.components().count() > 1 && path.exists() {
            return Ok(path);
        }
        let mut places = vec![PathBuf::from("objects")];
        places.extend(std::env::var_os("HINGECAST_OBJECTS").map(PathBuf::from));
        places.extend(std::env::var_os("HINGECAST_DATA").map(|d| PathBuf::from(d).join("partnet-mobility-dev")));
        places.extend(std::env::current_exe().ok().as_deref().and_then(samples_above));
        if let Some(found) = places.iter().map(|p| p.join(argument)).find(is_object) {
            return Ok(found);
        }
        let listed: Vec<String> = places.iter().map(|p| p.display().to_string()).collect();
        Err(CaptureError::new(
            format!("there is no object {argument}"),
            format!("looked for a path and in {}", listed.join(", ")),
            "give a path to a URDF or MJCF file or its folder; or set HINGECAST_OBJECTS to the folder objects/ of the \
             sources, or HINGECAST_DATA",
        ))
    }

    fn finish(
        mut self,
        library: mesh_file::Library,
        names: &BTreeMap<String, String>,
        seen: impl Fn(&str) -> bool,
    ) -> Result<Self, String> {
        (self.materials, self.textures) = (library.materials, library.textures);
        self.notes.extend(library.notes);
        self.finished(names, seen)
    }

    /// The last step of every loader: names the parts, drops doubled faces, checks the whole. A
    /// part is called after its first link that has a name of its own in `names` or else is `seen`
    /// (has geometry); same names get numbers.
    ///
    /// # Errors
    /// Too many parts, a tree that is none, a joint that carries nothing to be seen, or nothing to
    /// be seen at all.
    pub fn finished(mut self, names: &BTreeMap<String, String>, seen: impl Fn(&str) -> bool) -> Result<Self, String> {
        // Labels are 8-bit and 0 is the background. Asked first: naming takes its time.
        if self.parts.len() > MOST_PARTS {
            let n = self.parts.len();
            return Err(format!("the object has {n} moving parts, at most {MOST_PARTS} are supported"));
        }
        for part in &mut self.parts {
            part.drop_duplicate_faces();
            part.drop_unused_vertices();
            let link = part.links.iter().find(|l| seen(l)).or(part.links.first());
            let named = part.links.iter().find_map(|l| names.get(l));
            let name = named.or(link).cloned().unwrap_or_default().replace(['/', '\\'], "_");
            let mut unique = name.clone();
            let mut n = 2;
            while self.tree.parts.contains(&unique) {
                unique = format!("{name}_{n}");
                n += 1;
            }
            self.tree.parts.push(unique);
        }
        self.tree.validate()?;
        if self.parts.iter().all(|p| p.faces.is_empty()) {
            return Err("the object has no visible surface".into());
        }
        // A part may be nothing but a link between two joints.
        let bare = |j: usize| {
            let on_it = |p: usize| self.tree.ancestry(p).contains(&j);
            (0..self.parts.len()).all(|p| self.parts[p].faces.is_empty() || !on_it(p))
        };
        if let Some(j) = (0..self.tree.joints.len()).find(|&j| bare(j)) {
            let (joint, part) = (&self.tree.joints[j], &self.tree.parts[self.tree.joints[j].child]);
            return Err(format!("joint '{}' carries '{part}', which has no visible surface", joint.name));
        }
        let far = |v: &Vec3| !(v.abs().max_element() <= mesh_file::FARTHEST);
        if let Some((part, _)) = self.tree.parts.iter().zip(&self.parts).find(|(_, p)| p.vertices.iter().any(far)) {
            return Err(format!("the part '{part}' reaches farther than {:e}", mesh_file::FARTHEST));
        }
        Ok(self)
    }

    /// Index of a material, added if it is new.
    pub fn material(&mut self, material: Material) -> u32 {
        let known = self.materials.iter().position(|m| *m == material);
        known.unwrap_or_else(|| {
            self.materials.push(material);
            self.materials.len() - 1
        }) as u32
    }

    /// All vertices with the parts at `poses` (world_from_canonical).
    pub fn posed_vertices<'a>(&'a self, poses: &'a [Pose]) -> impl Iterator<Item = DVec3> + 'a {
        self.parts.iter().zip(poses).flat_map(|(part, pose)| part.vertices.iter().map(|v| pose.apply(v.as_dvec3())))
    }

    /// Lower and upper corner with the joints at `q`; zero without geometry.
    pub fn bounds(&self, q: &[f64]) -> (DVec3, DVec3) {
        let poses = self.tree.poses(q);
        let mut points = self.posed_vertices(&poses);
        let first = points.next().unwrap_or_default();
        points.fold((first, first), |(lo, hi), x| (lo.min(x), hi.max(x)))
    }

    /// Length of the canonical bounding box's diagonal.
    pub fn diagonal(&self) -> f64 {
        let (lo, hi) = self.bounds(&vec![0.0; self.tree.joints.len()]);
        (hi - lo).length()
    }

    /// The part's surface with its colours at the vertices.
    pub fn part_mesh(&self, part: usize) -> TriMesh {
        let p = &self.parts[part];
        let mut colors = vec![[200u8; 3]; p.vertices.len()];
        for (face, &material) in p.faces.iter().zip(&p.materials) {
            for &i in face {
                let m = &self.materials[material as usize];
                let texel = m.texture.map_or([1.0; 3], |t| self.textures[t].sample_srgb(p.uvs[i as usize]));
                colors[i as usize] = [0, 1, 2].map(|c| (m.color[c] * texel[c] * 255.0).round() as u8);
            }
        }
        TriMesh { vertices: p.vertices.clone(), faces: p.faces.clone(), colors }
    }
}

/// The loaders walk bodies and classes by recursion.
fn flat_enough(file: &Path, xml: &roxmltree::Document) -> Result<(), CaptureError> {
    let levels = xml::levels(xml);
    if levels <= MOST_LEVELS {
        return Ok(());
    }
    let what = format!("elements are nested {levels} levels deep, at most {MOST_LEVELS} are read");
    Err(CaptureError::new(what, file.display().to_string(), "flatten the tree of bodies"))
}

/// The nearest folder `objects` of samples beside the program or at most four folders above it:
/// `target/release/`, or `target/<triple>/release/deps/`.
fn samples_above(program: &Path) -> Option<PathBuf> {
    program.ancestors().skip(1).take(5).map(|at| at.join("objects")).find(|at| at.join("hinged_box").is_dir())
}

/// The description file in a folder.
fn description_in(folder: &Path) -> Result<PathBuf, CaptureError> {
    for name in ["mobility.urdf", "object.xml", "robot.urdf", "robot.xml"] {
        if folder.join(name).is_file() {
            return Ok(folder.join(name));
        }
    }
    let entries = std::fs::read_dir(folder).map_err(|e| CaptureError::read(folder, e))?;
    let is_description = |p: &PathBuf| p.extension().is_some_and(|e| e == "urdf" || e == "xml");
    let mut found: Vec<PathBuf> = entries.flatten().map(|e| e.path()).filter(is_description).collect();
    found.sort();
    match &found[..] {
        [one] => Ok(one.clone()),
        _ => Err(CaptureError::new(
            format!("the folder holds {} .urdf or .xml files, one is expected", found.len()),
            folder.display().to_string(),
            "point at the file itself",
        )),
    }
}

impl PartGeometry {
    /// Appends a mesh placed by `canonical_from_mesh`; `scale` acts in the mesh's frame.
    pub fn append(&mut self, mesh: &PartGeometry, canonical_from_mesh: &Pose, scale: DVec3) {
        let base = self.vertices.len() as u32;
        let place = |v: &Vec3| canonical_from_mesh.apply(v.as_dvec3() * scale).as_vec3();
        self.vertices.extend(mesh.vertices.iter().map(place));
        let turn = |n: &Vec3| canonical_from_mesh.rotate(n.as_dvec3() / scale).as_vec3().normalize_or_zero();
        self.normals.extend(mesh.normals.iter().map(turn));
        self.uvs.extend_from_slice(&mesh.uvs);
        self.faces.extend(mesh.faces.iter().map(|f| f.map(|i| i + base)));
        self.materials.extend_from_slice(&mesh.materials);
    }

    /// Keeps one of several faces over the same three corners. PartNet stores each face twice with
    /// opposite winding, and two coincident colours would flicker.
    pub(crate) fn drop_duplicate_faces(&mut self) {
        let key = |v: Vec3| (v * 1e5).round().as_i64vec3().to_array();
        let mut seen = std::collections::HashSet::new();
        let keep: Vec<bool> = self
            .faces
            .iter()
            .map(|f| {
                let mut corners = f.map(|i| key(self.vertices[i as usize]));
                corners.sort_unstable();
                // Faces without area are never hit and only confuse normals.
                corners[0] != corners[1] && corners[1] != corners[2] && seen.insert(corners)
            })
            .collect();
        let mut flags = keep.iter();
        self.faces.retain(|_| *flags.next().unwrap_or(&true));
        let mut flags = keep.iter();
        self.materials.retain(|_| *flags.next().unwrap_or(&true));
    }
    fn drop_unused_vertices(&mut self) {
        let mut used = vec![false; self.vertices.len()];
        self.faces.iter().flatten().for_each(|&i| used[i as usize] = true);
        let mut new_index = vec![0u32; used.len()];
        for (next, (slot, _)) in new_index.iter_mut().zip(&used).filter(|(_, u)| **u).enumerate() {
            *slot = next as u32;
        }
        self.faces.iter_mut().flatten().for_each(|i| *i = new_index[*i as usize]);
        fn keep<T>(list: &mut Vec<T>, used: &[bool]) {
            let mut flags = used.iter();
            list.retain(|_| *flags.next().unwrap_or(&false));
        }
        keep(&mut self.vertices, &used);
        keep(&mut self.normals, &used);
        keep(&mut self.uvs, &used);
    }
}
