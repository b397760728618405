//! Small files of every format, as people's programs write them, and damaged ones.

use super::*;
use glam::Vec2;
use std::fs;

struct Bench {
    dir: tempfile::TempDir,
    library: Library,
}

impl Bench {
    fn new() -> Self {
        Self { dir: tempfile::tempdir().unwrap(), library: Library::default() }
    }

    fn write(&self, name: &str, content: impl AsRef<[u8]>) {
        let file = self.dir.path().join(name);
        fs::create_dir_all(file.parent().unwrap()).unwrap();
        fs::write(file, content).unwrap();
    }

    fn load(&mut self, name: &str, content: impl AsRef<[u8]>) -> Result<PartGeometry, CaptureError> {
        self.write(name, content);
        let grey = self.library.plain(GREY);
        self.library.load(&self.dir.path().join(name), grey)
    }

    fn refused(&mut self, name: &str, content: impl AsRef<[u8]>) -> String {
        let error = self.load(name, content).expect_err("it should be refused").to_string();
        assert_eq!(error.lines().count(), 3, "{error}");
        error
    }

    /// Every shortened and many changed versions end in a mesh or an error.
    fn damage(&mut self, name: &str, content: &[u8]) {
        for cut in 0..content.len() {
            let _ = self.load(name, &content[..cut]);
        }
        let mut rng = fastrand::Rng::with_seed(5);
        for _ in 0..3000 {
            let mut changed = content.to_vec();
            for _ in 0..rng.usize(1..4) {
                let at = rng.usize(..changed.len());
                changed[at] = *rng.choice(b"09-#\"<>/ \n\x00\xff,}").unwrap();
            }
            let _ = self.load(name, &changed);
        }
    }
}

fn png() -> Vec<u8> {
    let mut out = std::io::Cursor::new(Vec::new());
    let image = image::RgbImage::from_fn(2, 2, |_, y| image::Rgb(if y == 0 { [255, 0, 0] } else { [0, 0, 255] }));
    image.write_to(&mut out, image::ImageFormat::Png).unwrap();
    out.into_inner()
}

fn size(mesh: &PartGeometry) -> Vec3 {
    let lo = mesh.vertices.iter().fold(Vec3::INFINITY, |a, &b| a.min(b));
    mesh.vertices.iter().fold(Vec3::NEG_INFINITY, |a, &b| a.max(b)) - lo
}

/// A square of 2 x 3 in two triangles.
const SQUARE: [[[f32; 3]; 3]; 2] =
    [[[0.0, 0.0, 0.0], [2.0, 0.0, 0.0], [2.0, 3.0, 0.0]], [[0.0, 0.0, 0.0], [2.0, 3.0, 0.0], [0.0, 3.0, 0.0]]];

fn binary_stl(head: &str) -> Vec<u8> {
    let mut out = vec![b' '; 80];
    out[..head.len()].copy_from_slice(head.as_bytes());
    out.extend(2u32.to_le_bytes());
    for triangle in SQUARE {
        out.extend([0.0f32, 0.0, 1.0].iter().chain(triangle.iter().flatten()).flat_map(|x| x.to_le_bytes()));
        out.extend([0, 0]);
    }
    out
}

fn ascii_stl(first: &str, last: &str) -> String {
    let mut out = format!("{first}\n");
    for triangle in SQUARE {
        out += "  facet normal 0 0 1\n    outer loop\n";
        triangle.iter().for_each(|[x, y, z]| out += &format!("      vertex {x:e} {y} {z}\n"));
        out += "    endloop\n  endfacet\n";
    }
    out + last
}

/// ASCII STL was taken for an OBJ without a triangle, and the part was empty.
#[test]
fn stl_is_read_binary_and_ascii() {
    let mut b = Bench::new();
    let ascii = ascii_stl("solid part", "endsolid part\n");
    let loud = ascii.to_uppercase().replace('\n', "\r\n");
    for (name, content) in [
        ("a.stl", ascii.clone().into_bytes()),
        ("a.obj", ascii.into_bytes()),
        ("b.STL", loud.into_bytes()),
        ("c.stl", ascii_stl("solid", "endsolid").into_bytes()),
        ("d.stl", ascii_stl("solid T\u{fc}r links", "endsolid T\u{fc}r").into_bytes()),
        ("e.stl", binary_stl("made by something")),
        ("f.stl", binary_stl("solid part")),
        ("g.stl", binary_stl("solid\nfacet normal")),
        ("without_extension", binary_stl("")),
        ("h.stl", [binary_stl("trailing"), b"\r\n".to_vec()].concat()),
    ] {
        let mesh = b.load(name, content).unwrap_or_else(|e| panic!("{name}: {e}"));
        assert_eq!((mesh.faces.len(), mesh.vertices.len()), (2, 4), "{name}");
        assert_eq!(size(&mesh), Vec3::new(2.0, 3.0, 0.0), "{name}");
    }
    let short = binary_stl("cut");
    assert!(b.refused("i.stl", &short[..short.len() - 50]).contains("says 2 triangles and has 1"));
    assert!(b.refused("j.stl", "solid x\nendsolid x\n").contains("no triangle"));
    b.damage("k.stl", ascii_stl("solid part", "endsolid part\n").as_bytes());
    b.damage("l.stl", &binary_stl("solid"));
}

#[test]
fn what_is_no_surface_is_refused() {
    let mut b = Bench::new();
    assert!(b.refused("points.obj", "v 0 0 0\nv 1 0 0\nv 1 1 0\n").contains("no triangle came"));
    assert!(b.refused("lines.obj", "v 0 0 0\nv 1 0 0\nl 1 2\n").contains("no triangle came"));
    assert!(b.refused("text.obj", "anything\n").contains("no triangle came"));
    for wrong in ["nan", "1e9", "-inf", "1e39"] {
        let error = b.refused("far.obj", format!("v 0 0 {wrong}\nv 1 0 0\nv 1 1 0\nf 1 2 3\n"));
        assert!(error.contains("a vertex lies at"), "{error}");
    }
    for (name, content, format) in
        [("a.ply", "ply\nformat", "PLY"), ("a.fbx", "Kaydara FBX Binary", "FBX"), ("a.step", "ISO-10303-21;", "step")]
    {
        let error = b.refused(name, content);
        assert!(error.contains(&format!("format {format}")) && error.contains("convert it"), "{error}");
    }
    let error = b.library.load(Path::new("/nowhere/a.stl"), 0).unwrap_err().to_string();
    assert!(error.contains("the mesh file is not there"), "{error}");
}

#[test]
fn obj_materials_are_found_as_people_write_them() {
    let mut b = Bench::new();
    b.write(
        "my looks.mtl",
        "newmtl wood dark\nd -halo 0.5\nKd 0.1 0.2 0.3\nmap_Kd -s 2 4 1 -o 0.5 -clamp on tex\\my tex.png\n",
    );
    b.write("second.mtl", "newmtl grey\nKd 0.25\nmap_Kd\nnewmtl lost\nKd 0 0 0\nmap_Kd gone.png\n");
    b.write("tex/my tex.png", png());
    let square = "v 0 0 0\nv 2 0 0\nv 2 3 0\nv 0 3 0\nvt 0 0\nvt 1 0\nvt 1 1\n";
    let obj = format!(
        "\u{feff}# caf\u{e9}\nmtllib \"my looks.mtl\"\nmtllib second.mtl third.mtl\n{square}usemtl\twood dark\n\
         f -4/1 -3/2 \\\n-2/3\nusemtl\nusemtl grey\nf 1 3 4\nusemtl lost\nf 1 2 4\n"
    );
    let mesh = b.load("lid.obj", obj).unwrap();
    assert_eq!(size(&mesh), Vec3::new(2.0, 3.0, 0.0));
    let looks: Vec<Material> = mesh.materials.iter().map(|m| b.library.materials[*m as usize]).collect();
    let texture = Some(0);
    let expected = [([0.1, 0.2, 0.3], texture), ([0.25; 3], None), (GREY, None)];
    assert_eq!(looks, expected.map(|(color, texture)| Material { color, texture }));
    let uvs: Vec<Vec2> = mesh.faces[0].iter().map(|i| mesh.uvs[*i as usize]).collect();
    assert_eq!(uvs, [Vec2::new(0.5, 0.0), Vec2::new(2.5, 0.0), Vec2::new(2.5, 4.0)]);
    assert_eq!(b.library.notes.len(), 1, "{:?}", b.library.notes);
    assert!(b.library.notes[0].contains("gone.png is not there"), "{:?}", b.library.notes);

    b.write("broken.png", "no picture");
    b.write("c.mtl", "newmtl a\nmap_Kd broken.png\n");
    b.load("c.obj", format!("mtllib c.mtl\nmtllib nowhere.mtl\nusemtl a\n{square}f 1 2 3\n")).unwrap();
    assert!(b.library.notes[1].contains("nowhere.mtl is not there"), "{:?}", b.library.notes);
    assert!(b.library.notes[2].contains("broken.png cannot be decoded"), "{:?}", b.library.notes);
    // Bytes that are no UTF-8, in a comment, were a "read error".
    let latin = [b"# caf\xe9\n".as_slice(), square.as_bytes(), b"f 1 2 3\n"].concat();
    assert_eq!(b.load("latin.obj", latin).unwrap().faces.len(), 1);
}

/// A scene of two placings of one geometry of two materials.
fn collada() -> String {
    let source = |id: &str, numbers: &str, n: usize, stride: usize| {
        format!(
            "<source id='{id}'><float_array id='{id}-a' count='{}'>{numbers}</float_array><technique_common>\
             <accessor source='#{id}-a' count='{n}' stride='{stride}'/></technique_common></source>",
            n * stride
        )
    };
    let effect = |id: &str, diffuse: &str, extra: &str| {
        format!(
            "<effect id='{id}-fx'><profile_COMMON>{extra}<technique sid='c'><lambert><diffuse>{diffuse}</diffuse>\
             </lambert></technique></profile_COMMON></effect>"
        )
    };
    let sampler = "<newparam sid='s'><surface type='2D'><init_from>pic</init_from></surface></newparam>\
                   <newparam sid='sam'><sampler2D><source>s</source></sampler2D></newparam>";
    format!(
        "<?xml version='1.0' encoding='utf-8'?>\n<COLLADA xmlns='http://www.collada.org/2005/11/COLLADASchema' \
         version='1.4.1'><asset><unit name='cm' meter='0.01'/><up_axis>Y_UP</up_axis></asset>\
         <library_images><image id='pic'><init_from>tex/my%20tex.png</init_from></image></library_images>\
         <library_effects>{}{}</library_effects><library_materials>\
         <material id='red'><instance_effect url='#red-fx'/></material>\
         <material id='pic-m'><instance_effect url='#pic-fx'/></material></library_materials>\
         <library_geometries><geometry id='g'><mesh>{}{}{}<vertices id='v'><input semantic='POSITION' source='#p'/>\
         </vertices><triangles material='one' count='1'><input semantic='VERTEX' source='#v' offset='0'/>\
         <input semantic='NORMAL' source='#n' offset='1'/><p>0 0 1 0 2 0</p></triangles>\
         <polylist material='two' count='1'><input semantic='VERTEX' source='#v' offset='0'/>\
         <input semantic='TEXCOORD' source='#t' offset='1' set='0'/><vcount>4</vcount><p>0 0 1 1 2 2 3 0</p></polylist>\
         </mesh></geometry></library_geometries>\
         <library_nodes><node id='again'><translate>0 0 500</translate><instance_geometry url='#g'/></node></library_nodes>\
         <library_visual_scenes><visual_scene id='scene'><node><translate>100 0 0</translate>\
         <rotate>0 0 1 90</rotate><node><matrix>1 0 0 0 0 1 0 0 0 0 1 10 0 0 0 1</matrix><instance_geometry url='#g'>\
         <bind_material><technique_common><instance_material symbol='one' target='#red'/>\
         <instance_material symbol='two' target='#pic-m'/></technique_common></bind_material></instance_geometry></node>\
         </node><node><scale>1 1 -1</scale><instance_node url='#again'/></node></visual_scene></library_visual_scenes>\
         <scene><instance_visual_scene url='#scene'/></scene></COLLADA>",
        effect("red", "<color>1 0 0 1</color>", ""),
        effect("pic", "<texture texture='sam' texcoord='UV'/>", sampler),
        source("p", "0 0 0 200 0 0 200 300 0\n0 300 0", 4, 3),
        source("n", "0 0 2", 1, 3),
        source("t", "0 0 1 0 1 1", 3, 2),
    )
}

#[test]
fn collada_is_placed_in_metres_and_not_turned() {
    let mut b = Bench::new();
    b.write("tex/my tex.png", png());
    let mesh = b.load("door.dae", collada()).unwrap();
    assert_eq!(mesh.faces.len(), 6);
    // The first placing: turned by 90 degrees about z, then 1 m along x; 0.1 m up.
    let corner = |face: usize, k: usize| mesh.vertices[mesh.faces[face][k] as usize];
    assert!(corner(0, 1).distance(Vec3::new(1.0, 2.0, 0.1)) < 1e-6, "{}", corner(0, 1));
    assert!(corner(0, 2).distance(Vec3::new(-2.0, 2.0, 0.1)) < 1e-6, "{}", corner(0, 2));
    assert_eq!(mesh.normals[mesh.faces[0][0] as usize], Vec3::Z);
    // The second is mirrored: 5 m below, its faces turned over.
    assert!(corner(3, 1).distance(Vec3::new(2.0, 3.0, -5.0)) < 1e-6, "{}", corner(3, 1));
    let looks: Vec<Material> = mesh.materials.iter().map(|m| b.library.materials[*m as usize]).collect();
    assert_eq!((looks[0].color, looks[0].texture), ([1.0, 0.0, 0.0], None));
    assert_eq!((looks[1].color, looks[1].texture), ([1.0; 3], Some(0)));
    assert_eq!(looks[3].color, GREY);
    assert_eq!(mesh.uvs[mesh.faces[1][1] as usize], Vec2::new(1.0, 0.0));
    assert_eq!(b.library.notes.len(), 2, "{:?}", b.library.notes);

    // Nodes that hold themselves, once and twice.
    let circle = collada().replace(
        "<instance_geometry url='#g'/></node></library_nodes>",
        "<instance_node url='#again'/><instance_node url='#again'/></node></library_nodes>",
    );
    assert!(b.refused("circle.dae", circle).contains("nodes hold themselves"));
    // Another geometry with the same ids for its sources.
    let (before, rest) =
        collada().split_once("<geometry id='g'>").map(|(a, b)| (a.to_string(), b.to_string())).unwrap();
    let (geometry, after) = rest.split_once("</geometry>").unwrap();
    let other = geometry.replace("0 0 0 200 0 0 200 300 0\n0 300 0", "1 1 1 1 1 1 1 1 1 1 1 1");
    let twice = format!("{before}<geometry id='g'>{geometry}</geometry><geometry id='h'>{other}</geometry>{after}");
    let same = b.load("twice.dae", twice).unwrap();
    assert_eq!(same.vertices, mesh.vertices);
    let none = collada().replace("0 0 1 0 2 0</p>", "0 0 1 0 9 0</p>");
    assert!(b.refused("far.dae", none).contains("no vertex 9"));
    assert!(b.refused("text.dae", "<COLLADA").contains("COLLADA"));
    b.damage("damaged.dae", collada().as_bytes());
}

/// Positions, normals, texture coordinates and indices of the square, padded to 4 bytes.
fn gltf_buffer() -> Vec<u8> {
    let floats = |list: &[f32]| list.iter().flat_map(|x| x.to_le_bytes()).collect::<Vec<u8>>();
    [
        floats(&[0.0, 0.0, 0.0, 2.0, 0.0, 0.0, 2.0, 3.0, 0.0, 0.0, 3.0, 0.0]),
        floats(&[0.0, 0.0, 1.0].repeat(4)),
        floats(&[0.0, 0.0, 1.0, 0.0, 1.0, 1.0, 0.0, 1.0]),
        [0u16, 1, 2, 0, 2, 3].iter().flat_map(|x| x.to_le_bytes()).collect(),
    ]
    .concat()
}

fn gltf(buffer: &str, image: &str) -> String {
    format!(
        r##"{{"asset":{{"version":"2.0"}},"scene":0,"scenes":[{{"nodes":[0]}}],
        "nodes":[{{"translation":[0,0,5],"children":[1]}},{{"mesh":0,"scale":[2,1,1]}}],
        "meshes":[{{"primitives":[{{"attributes":{{"POSITION":0,"NORMAL":1,"TEXCOORD_0":2}},"indices":3,"material":0}}]}}],
        "materials":[{{"pbrMetallicRoughness":{{"baseColorFactor":[1,0.2158605,0,1],"baseColorTexture":{{"index":0}}}}}}],
        "textures":[{{"source":0}}],"images":[{image}],
        "buffers":[{{"byteLength":140{buffer}}}],
        "bufferViews":[{{"buffer":0,"byteLength":48}},{{"buffer":0,"byteOffset":48,"byteLength":48}},
        {{"buffer":0,"byteOffset":96,"byteLength":32}},{{"buffer":0,"byteOffset":128,"byteLength":12}}],
        "accessors":[{{"bufferView":0,"componentType":5126,"count":4,"type":"VEC3"}},
        {{"bufferView":1,"componentType":5126,"count":4,"type":"VEC3"}},
        {{"bufferView":2,"componentType":5126,"count":4,"type":"VEC2"}},
        {{"bufferView":3,"componentType":5123,"count":6,"type":"SCALAR"}}]}}"##
    )
}

fn glb(json: &str, buffer: &[u8]) -> Vec<u8> {
    let mut json = json.as_bytes().to_vec();
    json.resize(json.len().next_multiple_of(4), b' ');
    let mut out = b"glTF\x02\0\0\0".to_vec();
    out.extend((28 + json.len() as u32 + buffer.len() as u32).to_le_bytes());
    for (kind, chunk) in [(b"JSON", json.as_slice()), (b"BIN\0", buffer)] {
        out.extend((chunk.len() as u32).to_le_bytes());
        out.extend(kind);
        out.extend(chunk);
    }
    out
}

#[test]
fn gltf_is_placed_by_its_nodes_and_not_turned() {
    let mut b = Bench::new();
    b.write("door.bin", gltf_buffer());
    b.write("my pic.png", png());
    let apart = gltf(r#","uri":"door.bin""#, r#"{"uri":"my%20pic.png"}"#);
    let whole = glb(&gltf("", r#"{"uri":"my%20pic.png"}"#), &gltf_buffer());
    for (name, content) in [("a.gltf", apart.as_bytes()), ("a.glb", &whole), ("named_wrongly.obj", &whole)] {
        let mesh = b.load(name, content).unwrap_or_else(|e| panic!("{name}: {e}"));
        assert_eq!((mesh.faces.len(), size(&mesh)), (2, Vec3::new(4.0, 3.0, 0.0)), "{name}");
        assert!(mesh.vertices.iter().all(|v| v.z == 5.0) && mesh.normals.iter().all(|n| *n == Vec3::Z), "{name}");
        assert_eq!(mesh.uvs[2], Vec2::new(1.0, 0.0), "{name}");
        let looks = b.library.materials[mesh.materials[0] as usize];
        assert!((looks.color[1] - 0.502).abs() < 1e-3 && looks.texture == Some(0), "{looks:?}");
        // The top row of the picture is where v is 0 in the file.
        let red = b.library.textures[0].sample_srgb(Vec2::new(0.5, 0.75));
        assert!(red[0] > 0.9 && red[2] < 0.1, "{red:?}");
    }
    assert!(b.library.notes.is_empty(), "{:?}", b.library.notes);
    let inside = gltf(r#","uri":"data:application/octet-stream;base64,AAAA""#, r#"{"uri":"data:image/png;base64,AA"}"#);
    assert!(b.refused("b.gltf", inside).contains("cut short"));
    let gone = gltf(r#","uri":"gone.bin""#, r#"{"uri":"gone.png"}"#);
    assert!(b.refused("c.gltf", gone).contains("gone.bin is not there"));
    let gone = gltf(r#","uri":"door.bin""#, r#"{"uri":"gone.png"}"#);
    b.load("d.gltf", gone).unwrap();
    assert!(b.library.notes[0].contains("gone.png is not there"), "{:?}", b.library.notes);
}

#[test]
fn damaged_gltf_is_refused() {
    let mut b = Bench::new();
    b.write("door.bin", gltf_buffer());
    let good = gltf(r#","uri":"door.bin""#, r#"{"bufferView":0,"mimeType":"image/png"}"#);
    assert!(b.load("a.gltf", &good).is_ok());
    for (from, to) in [
        (r#""children":[1]"#, r#""children":[0]"#),
        (r#""POSITION":0"#, r#""POSITION":9"#),
        (r#""POSITION":0"#, r#""POSITION":2"#),
        (r#""indices":3"#, r#""indices":0"#),
        (r#"5123,"count":6"#, r#"5123,"count":60"#),
        (r#""count":4,"type":"VEC3"},"#, r#""count":0,"type":"VEC3"},"#),
        (r#""count":4,"type":"VEC3"},"#, r#""count":4000000000,"type":"VEC3"},"#),
        (r#""byteOffset":48"#, r#""byteOffset":18446744073709551600"#),
        (r#"{"buffer":0,"byteLength":48}"#, r#"{"buffer":0,"byteLength":48,"byteStride":4}"#),
        (r#"{"bufferView":0,"mimeType":"image/png"}"#, r#"{"bufferView":7}"#),
        (r#""asset""#, r#""extensionsRequired":["KHR_draco_mesh_compression"],"asset""#),
    ] {
        let bad = good.replacen(from, to, 1);
        assert_ne!(bad, good, "{from}");
        b.refused("b.gltf", bad);
    }
    for image in [r#"{"bufferView":0}"#, "{}"] {
        let odd = good.replacen(r#"{"bufferView":0,"mimeType":"image/png"}"#, image, 1);
        assert!(b.load("i.gltf", odd).is_ok(), "{image}");
    }
    let zeros = r#""sparse":{"count":1,"indices":{"bufferView":3,"componentType":5123},"values":{"bufferView":0}}"#;
    let sparse = good.replacen(
        r#"{"bufferView":0,"componentType":5126,"count":4"#,
        &format!(r#"{{{zeros},"componentType":5126,"count":99999999999"#),
        1,
    );
    assert!(b.refused("c.gltf", sparse).contains("sparse"));
    b.damage("d.gltf", good.as_bytes());
    b.damage("e.glb", &glb(&gltf("", r#"{"bufferView":0,"mimeType":"image/png"}"#), &gltf_buffer()));
}
