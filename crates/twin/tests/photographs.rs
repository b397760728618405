//! A box with a lid, painted with a pattern that no vertex colours could hold, photographed with
//! exposures that differ: the texture shows the pattern, and its files are read by others.

mod common;

use common::{observe, slabs, twin_of};
use glam::{DVec3, Vec2, Vec3};
use hingecast_geom::TriMesh;
use hingecast_twin::{Config, Observation, Texture, Twin, is_ours, write};

/// Squares of 4 cm on all faces; the lid is blue where the base is red.
fn squares(part: usize, x: DVec3) -> [u8; 3] {
    let dark = edge(x).iter().map(|(cell, _)| cell).sum::<i64>() % 2 == 0;
    let [bright, dim] = [[200, 60, 40], [40, 60, 200]];
    match (dark, part) {
        (true, _) => [60, 60, 60],
        (false, 0) => bright,
        (false, _) => dim,
    }
}

/// Of each coordinate: the square it lies in, and how far from its border. Shifted, so that no face
/// lies on a border.
fn edge(x: DVec3) -> [(i64, f64); 3] {
    x.to_array().map(|x| {
        let cells = x / 0.04 + 100.3;
        (cells.floor() as i64, 0.04 * (0.5 - (cells.fract() - 0.5).abs()))
    })
}

fn config(max_texels: usize) -> Config {
    Config { voxel: 1.0 / 64.0, max_texels, ..Default::default() }
}

fn seen(state: usize, view: usize) -> Observation {
    observe(&slabs(), &squares, state, view)
}

/// Points within faces and the colour of the picture there.
fn texels(mesh: &TriMesh, texture: &Texture) -> Vec<(Vec3, [u8; 3])> {
    let shares = [[0.6, 0.2, 0.2], [0.2, 0.6, 0.2], [0.2, 0.2, 0.6], [0.34, 0.33, 0.33]];
    let mut out = Vec::new();
    for face in &texture.faces {
        for share in shares {
            let mix =
                |of: &dyn Fn(usize) -> Vec3| -> Vec3 { face.iter().zip(share).map(|(&k, s)| s * of(k as usize)).sum() };
            let at = mix(&|k| mesh.vertices[texture.vertices[k] as usize]);
            let uv = mix(&|k| Vec2::from(texture.corners[k]).extend(0.0));
            let x = ((uv.x * texture.width as f32) as usize).min(texture.width - 1);
            let y = (((1.0 - uv.y) * texture.height as f32) as usize).min(texture.height - 1);
            let place = 3 * (y * texture.width + x);
            out.push((at, [0, 1, 2].map(|k| texture.rgb[place + k])));
        }
    }
    out
}

/// Share of the points well within squares, on the outer faces, whose colour is the square's to
/// within `levels`.
fn right(twin: &Twin, part: usize, levels: u8) -> f64 {
    let model = &twin.parts[part];
    let [lo, hi] = [DVec3::new(-0.2, -0.15, 0.0), DVec3::new(0.2, 0.15, if part == 0 { 0.2 } else { 0.22 })];
    let (mut n, mut hits) = (0, 0);
    for (at, color) in texels(&model.mesh, model.texture.as_ref().expect("a picture")) {
        let at = at.as_dvec3();
        // Of an outer face that cameras see: not below, not where base and lid touch.
        let side = [lo.x, hi.x].iter().any(|x| (at.x - x).abs() < 0.001)
            || [lo.y, hi.y].iter().any(|y| (at.y - y).abs() < 0.001);
        let inner = if part == 0 { (0.03..0.17).contains(&at.z) && side } else { (at.z - hi.z).abs() < 0.001 };
        // Well within: the coordinates along the face (the one across it is near a border or not,
        // the same everywhere).
        let across = (0..3).min_by(|&a, &b| {
            let off = |k: usize| (at[k] - lo[k]).abs().min((at[k] - hi[k]).abs());
            off(a).total_cmp(&off(b))
        });
        let deep = edge(at).iter().enumerate().all(|(k, (_, border))| Some(k) == across || *border > 0.01);
        if inner && deep {
            let is = squares(part, at);
            n += 1;
            hits += usize::from(color.iter().zip(is).all(|(a, b)| a.abs_diff(b) <= levels));
        }
    }
    assert!(n > 100, "{n} points of part {part} asked");
    hits as f64 / n as f64
}

#[test]
fn the_picture_shows_what_the_photographs_show() {
    let twin = twin_of(&seen, &config(1 << 20));
    for part in 0..2 {
        let share = right(&twin, part, 24);
        assert!(share > 0.97, "part {part}: {share} of the points have their colour");
        let texture = twin.parts[part].texture.as_ref().unwrap();
        assert_eq!(texture.faces.len(), twin.parts[part].mesh.faces.len());
        assert_eq!(texture.rgb.len(), 3 * texture.width * texture.height);
    }
    are_read_by_others(&twin);
}

/// The files of `twin`: OBJ, MTL and PNG.
fn are_read_by_others(twin: &Twin) {
    let dir = tempfile::tempdir().unwrap();
    let folder = dir.path().join("twin");
    write(twin, None, &folder).unwrap();
    let visual = folder.join("meshes/visual");
    for part in 0..2 {
        let texture = twin.parts[part].texture.as_ref().unwrap();
        let [obj, mtl] =
            ["obj", "mtl"].map(|end| std::fs::read_to_string(visual.join(format!("part_{part}.{end}"))).unwrap());
        let count = |of: &str| obj.lines().filter(|l| l.starts_with(of)).count();
        let mesh = &twin.parts[part].mesh;
        assert_eq!(
            [count("v "), count("vt "), count("f ")],
            [mesh.vertices.len(), texture.corners.len(), mesh.faces.len()]
        );
        assert!(obj.contains(&format!("mtllib part_{part}.mtl")) && mtl.contains(&format!("map_Kd part_{part}.png")));
        let file = std::io::BufReader::new(std::fs::File::open(visual.join(format!("part_{part}.png"))).unwrap());
        let mut reader = png::Decoder::new(file).read_info().unwrap();
        let mut rgb = vec![0; reader.output_buffer_size().unwrap()];
        reader.next_frame(&mut rgb).unwrap();
        assert_eq!(rgb, texture.rgb);
    }
    is_read_as_gltf(twin, &folder.join("robot.glb"));
    says_what_sdf_asks(twin, &folder);
    says_what_usd_asks(twin, &std::fs::read_to_string(folder.join("robot.usda")).unwrap());
    // A material of the URDF would lie over that of the OBJ.
    assert!(!std::fs::read_to_string(folder.join("robot.urdf")).unwrap().contains("<material"));
    // A twin that is written again may replace all of it, and nothing that somebody else put there.
    assert!(is_ours(std::path::Path::new("meshes/visual/part_0.png")));
    assert!(is_ours(std::path::Path::new("meshes/visual/part_1.mtl")));
    // Older versions wrote such.
    assert!(is_ours(std::path::Path::new("meshes/collision/part_0_3.stl")));
    assert!(!is_ours(std::path::Path::new("meshes/visual/photo.png")));
}

/// From one side all pictures are darker: left so, the surface would have a dark and a bright half.
#[test]
fn exposures_are_made_even() {
    let uneven = |state: usize, view: usize| {
        let mut seen = seen(state, view);
        if seen.camera.camera_from_world.inverse().apply(DVec3::ZERO).x < 0.0 {
            seen.rgb.iter_mut().for_each(|c| *c = (*c as f32 * 0.6) as u8);
        }
        seen
    };
    let twin = twin_of(&uneven, &config(1 << 20));
    for part in 0..2 {
        let texture = twin.parts[part].texture.as_ref().unwrap();
        // The strongest channel of the bright squares, wherever they are: one value.
        let strong = if part == 0 { 0 } else { 2 };
        let mut bright: Vec<u8> = texels(&twin.parts[part].mesh, texture)
            .iter()
            .filter(|(at, _)| {
                let at = at.as_dvec3();
                squares(part, at)[strong] == 200 && edge(at).iter().all(|(_, border)| *border > 0.008)
            })
            .map(|(_, color)| color[strong])
            .collect();
        bright.sort_unstable();
        let at = |share: f64| bright[(share * (bright.len() - 1) as f64) as usize];
        assert!(at(0.9) - at(0.1) < 15, "part {part}: {} to {} of {}", at(0.2), at(0.8), bright.len());
    }
}

/// Asked for few texels, the picture is coarse; on however many threads, the same.
#[test]
fn few_texels_on_one_thread_and_many() {
    let on = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| twin_of(&seen, &config(20_000))).parts.into_iter().map(|p| p.texture).collect::<Vec<_>>()
    };
    let one = on(1);
    for texture in &one {
        let texels = texture.as_ref().map(|t| t.width * t.height);
        assert!(texels.is_some_and(|n| (2_000..30_000).contains(&n)), "{texels:?}");
    }
    assert_eq!(one, on(3));
}

/// Somebody else's reader finds the surface, its picture, and the lid where its joint puts it.
fn is_read_as_gltf(twin: &Twin, path: &std::path::Path) {
    let (file, buffers, images) = gltf::import(path).unwrap();
    let raw = std::fs::read(path).unwrap();
    let json: serde_json::Value = serde_json::from_slice(&gltf::Glb::from_slice(&raw).unwrap().json).unwrap();
    let names = |of: &str| json[of].as_array().unwrap().iter().map(|x| x["name"].clone()).collect::<Vec<_>>();
    assert_eq!(
        (names("nodes"), names("animations")),
        (vec!["base".into(), "lid".into(), "box".into()], vec!["hinge".into()])
    );
    let node = |part: usize| file.nodes().nth(part).unwrap();
    let bytes = |b: gltf::Buffer| buffers.get(b.index()).map(|b| &b.0[..]);
    for (part, image) in images.iter().enumerate() {
        let texture = twin.parts[part].texture.as_ref().unwrap();
        assert_eq!((&image.pixels, image.width as usize), (&texture.rgb, texture.width));
    }
    let first = |part: usize| -> Vec3 {
        let primitive = node(part).mesh().unwrap().primitives().next().unwrap();
        Vec3::from(primitive.reader(bytes).read_positions().unwrap().next().unwrap())
    };
    let of_mesh = |part: usize| {
        let corner = twin.parts[part].texture.as_ref().unwrap().vertices[0];
        twin.parts[part].mesh.vertices[corner as usize]
    };
    assert!((first(0) - of_mesh(0)).length() < 1e-6);
    let (rest, _, _) = node(1).transform().decomposed();
    let link = Vec3::from(rest);
    assert!((link + first(1) - of_mesh(1)).length() < 1e-6);

    let animation = file.animations().next().unwrap();
    let channel = animation.channels().next().unwrap();
    assert_eq!(channel.target().node().index(), 1);
    let reader = channel.reader(bytes);
    let gltf::animation::util::ReadOutputs::Rotations(turns) = reader.read_outputs().unwrap() else {
        panic!("a hinge turns");
    };
    let turns: Vec<glam::Quat> = turns.into_f32().map(glam::Quat::from_array).collect();
    assert_eq!((turns.len(), reader.read_inputs().unwrap().count()), (49, 49));
    // Half of the time there, half of it back: 1.5 rad in the middle.
    for (k, q) in [(0, 0.0), (12, 0.75), (24, 1.5), (36, 0.75), (48, 0.0)] {
        let at = link + turns[k] * first(1);
        let should = twin.tree.joints[0].screw.motion(q).apply(of_mesh(1).as_dvec3()).as_vec3();
        assert!((at - should).length() < 1e-5, "at {q}: {at} {should}");
    }
    // z was up, and y is.
    let root = file.default_scene().unwrap().nodes().next().unwrap();
    let (_, upright, _) = root.transform().decomposed();
    assert!((glam::Quat::from_array(upright) * Vec3::Z - Vec3::Y).length() < 1e-6);
}

/// No Rust crate reads UsdPhysics; `scripts/consumers.py` lets OpenUSD's own validators read such files.
fn says_what_usd_asks(twin: &Twin, text: &str) {
    let after = |from: &str, key: &str| -> Vec<f64> {
        let rest = text.split(from).nth(1).and_then(|rest| rest.split(key).nth(1)).unwrap();
        let row = rest.lines().next().unwrap().trim_matches(|c| "= ()".contains(c));
        row.split(", ").map(|x| x.parse().unwrap()).collect()
    };
    let hinge = "def PhysicsRevoluteJoint \"hinge\"";
    let joint = &twin.tree.joints[0];
    let turned = after(hinge, "quatf physics:localRot0");
    let turned = glam::DQuat::from_xyzw(turned[1], turned[2], turned[3], turned[0]);
    assert!((turned * DVec3::X - joint.screw.axis).length() < 1e-6);
    let at = DVec3::from_slice(&after(hinge, "point3f physics:localPos0"));
    assert!(joint.screw.distance(at) < 1e-6);
    assert_eq!(after(hinge, "float physics:upperLimit"), [1.5f64.to_degrees()]);
    // Per degree: a hinge that turns 57 times as fast is held 57 times less.
    let damper = after(hinge, "float drive:angular:physics:damping")[0];
    assert!((damper.to_degrees() / hingecast_twin::link::damping(twin, joint) - 1.0).abs() < 1e-9);
    for (part, link) in ["base", "lid"].into_iter().enumerate() {
        let from = format!("def Xform \"{link}\"");
        assert_eq!(after(&from, "float physics:mass"), [twin.parts[part].inertial.mass]);
        assert!(text.contains(&format!("@./meshes/visual/part_{part}.png@")));
        let moments: f64 = after(&from, "float3 physics:diagonalInertia").iter().sum();
        let inertia = twin.parts[part].inertial.inertia;
        let trace = inertia.x_axis.x + inertia.y_axis.y + inertia.z_axis.z;
        assert!((moments / trace - 1.0).abs() < 1e-9);
    }
    let count = |c: char| text.chars().filter(|&x| x == c).count();
    assert_eq!((count('{'), count('(')), (count('}'), count(')')));
}

/// Links and joints by name, and files that are there.
fn says_what_sdf_asks(twin: &Twin, folder: &std::path::Path) {
    let text = std::fs::read_to_string(folder.join("robot.sdf")).unwrap();
    let file = roxmltree::Document::parse(&text).unwrap();
    let named = |tag: &str| -> Vec<String> {
        let all = file.descendants().filter(|n| n.has_tag_name(tag));
        all.filter_map(|n| n.attribute("name")).map(str::to_string).collect()
    };
    assert_eq!(named("link"), twin.tree.parts);
    assert_eq!(named("joint"), ["base_stands", "hinge"]);
    let uris = file.descendants().filter(|n| n.has_tag_name("uri")).filter_map(|n| n.text());
    assert!(uris.map(|uri| folder.join(uri)).all(|file| file.is_file()));
    let masses = file.descendants().filter(|n| n.has_tag_name("mass")).filter_map(|n| n.text()?.parse::<f64>().ok());
    let mass: f64 = twin.parts.iter().map(|p| p.inertial.mass).sum();
    assert!((masses.sum::<f64>() / mass - 1.0).abs() < 1e-8);
    // Boxes are boxes: the walls of this one.
    assert!(file.descendants().any(|n| n.has_tag_name("box")), "{text}");
}
