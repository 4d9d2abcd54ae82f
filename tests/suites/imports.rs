//! Meshes of any topology in many formats: one known mesh written in many ways must come out as itself, odd files of other programs are
//! read or refused with the reason, and other libraries must see the same positions.

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use glam::{DVec3, Vec2};
use kitsuke_pipeline::source::import::{self, Format, ImportedMesh, Picture};
use kitsuke_tests::hostile;
use serde_json::{Value, json};
use std::fmt::Write;
use std::fs;
use std::path::{Path, PathBuf};

/// An L with a concave corner, a quad and a triangle, metres.
const POSITIONS: [[f64; 3]; 8] = [
    [0.0, 0.0, 0.0],
    [2.0, 0.0, 0.0],
    [2.0, 1.0, 0.0],
    [1.0, 1.0, 0.0],
    [1.0, 2.0, 0.0],
    [0.0, 2.0, 0.0],
    [0.0, 0.0, -1.0],
    [2.0, 0.0, -1.0],
];
const FACES: [&[u32]; 3] = [&[0, 1, 2, 3, 4, 5], &[0, 6, 7, 1], &[1, 7, 2]];
/// Positions of 32 bits, and sums of numbers that are no binary fractions, differ by less.
const SAME_M: f64 = 1e-6;

fn uv_of(vertex: usize) -> [f64; 2] {
    let [x, y, z] = POSITIONS[vertex];
    [x / 4.0, (y - z) / 4.0]
}

fn colour_of(vertex: usize) -> [u8; 3] {
    [255, 30 * vertex as u8, 0]
}

fn read_in(file: &str, bytes: &[u8], folder: Option<&Path>) -> Result<(ImportedMesh, Vec<String>), String> {
    let mut report = Vec::new();
    let mesh = import::read_bytes(file, bytes, folder, &mut report);
    let said: Vec<String> = report.iter().map(|d| format!("{}: {}", d.code, d.problem)).collect();
    assert!(report.iter().all(|d| d.file == file && !d.problem.is_empty() && !d.help.is_empty()), "{report:?}");
    mesh.map(|mesh| (mesh, said.clone())).ok_or_else(|| said.join("; "))
}

fn read(file: &str, bytes: &[u8]) -> ImportedMesh {
    let (mesh, said) = read_in(file, bytes, None).unwrap_or_else(|said| panic!("{file}: {said}"));
    assert_eq!(said, [""; 0], "{file}");
    mesh
}

fn refusal(file: &str, bytes: impl AsRef<[u8]>) -> String {
    read_in(file, bytes.as_ref(), None).map(|(mesh, _)| mesh.positions.len()).expect_err(file)
}

/// The plainest OBJ of the mesh.
fn obj_text() -> String {
    let mut text = String::new();
    POSITIONS.iter().for_each(|[x, y, z]| writeln!(text, "v {x} {y} {z}").unwrap());
    (0..POSITIONS.len()).map(uv_of).for_each(|[u, v]| writeln!(text, "vt {u} {v}").unwrap());
    for face in FACES {
        let corners: Vec<String> = face.iter().map(|v| format!("{0}/{0}", v + 1)).collect();
        writeln!(text, "f {}", corners.join(" ")).unwrap();
    }
    text
}

/// Places and texture coordinates of the corners of all triangles, in their order, metres.
fn corners(mesh: &ImportedMesh, unit_m: f64) -> Vec<(DVec3, Option<Vec2>)> {
    let triangle = |(number, triangle): (usize, &[u32; 3])| {
        let uv = mesh.uv.get(number).copied();
        (0..3).map(|i| (mesh.positions[triangle[i] as usize] * unit_m, uv.map(|uv| uv[i]))).collect::<Vec<_>>()
    };
    mesh.triangles.iter().enumerate().flat_map(triangle).collect()
}

fn assert_same(what: &str, mesh: &ImportedMesh, unit_m: f64) {
    let own = corners(mesh, unit_m);
    let wanted = corners(&read("plain.obj", obj_text().as_bytes()), 1.0);
    assert_eq!(own.len(), wanted.len(), "{what}");
    for (own, wanted) in own.iter().zip(&wanted) {
        assert!(own.0.distance(wanted.0) < SAME_M, "{what}: {} instead of {}", own.0, wanted.0);
        let (own, wanted) = (own.1.unwrap_or_else(|| panic!("{what} has no texture coordinates")), wanted.1.unwrap());
        assert!(own.distance(wanted) < 1e-6, "{what}: texture coordinate {own} instead of {wanted}");
    }
}

fn assert_coloured(what: &str, mesh: &ImportedMesh) {
    let wanted: Vec<[u8; 3]> = (0..POSITIONS.len()).map(colour_of).collect();
    assert_eq!(mesh.colours, wanted, "{what}");
}

#[test]
fn the_plain_mesh_is_what_it_is() {
    let mesh = read("plain.obj", obj_text().as_bytes());
    assert_eq!(mesh.positions, POSITIONS.map(DVec3::from_array));
    assert_eq!((mesh.polygon_count, mesh.quad_count, mesh.larger_count), (3, 1, 1));
    assert_eq!((mesh.triangles.len(), mesh.uv.len(), mesh.part_of_triangle.len()), (7, 7, 7));
    assert_eq!((mesh.format, mesh.unit_m, mesh.axes), (Format::Obj, None, None));
    let areas = mesh.triangles.iter().map(|triangle| {
        let [a, b, c] = triangle.map(|v| mesh.positions[v as usize]);
        (b - a).cross(c - a) / 2.0
    });
    // None of the L's is turned over, and together they are the L.
    let own: Vec<DVec3> = areas.take(4).collect();
    assert!(own.iter().all(|area| area.z > 0.0), "{own:?}");
    assert_eq!(own.iter().sum::<DVec3>(), DVec3::new(0.0, 0.0, 3.0));
    let soundness = mesh.soundness();
    assert_eq!((soundness.components, soundness.border_loops, soundness.unused), (1, 1, 0));
    assert_eq!((soundness.degenerate, soundness.non_manifold_edges), (0, 0));
}

#[test]
fn a_look_at_the_surface_finds_what_is_wrong_with_it() {
    // Two triangles whose shared edge is parted, a fin on another edge, one without area, one apart, a vertex of none.
    let text = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 1 0 0\nv 0 1 0\nv 1 1 0\nv 0 0 1\nv 5 0 0\nv 6 0 0\nv 5 1 0\nv 9 9 9\n\
                f 1 2 3\nf 4 6 5\nf 2 3 7\nf 1 2 2\nf 8 9 10\n";
    let found = read("odd.obj", text.as_bytes()).soundness();
    assert_eq!((found.components, found.unused, found.degenerate, found.non_manifold_edges), (2, 1, 1, 1));
    assert_eq!(found.border_loops, 2);
}

#[test]
fn obj_is_the_same_however_it_is_written() {
    let plain = obj_text();
    let utf16 = |swap: bool| -> Vec<u8> {
        let units = std::iter::once(0xfeff).chain(plain.encode_utf16());
        units.flat_map(|unit: u16| if swap { unit.to_be_bytes() } else { unit.to_le_bytes() }).collect()
    };
    let count = POSITIONS.len() as i64;
    let backwards = FACES.map(|face| {
        let corners: Vec<String> = face.iter().map(|&v| format!("{0}/{0}", i64::from(v) - count)).collect();
        format!("f {}\n", corners.join(" "))
    });
    let (head, _) = plain.split_once('f').unwrap();
    let ways: [(&str, Vec<u8>); 5] = [
        ("crlf", plain.replace('\n', "\r\n").into()),
        ("backwards", format!("{head}{}", backwards.concat()).into()),
        ("utf16le", utf16(false)),
        ("utf16be", utf16(true)),
        ("bom", format!("\u{feff}{plain}").into()),
    ];
    for (what, bytes) in ways {
        assert_same(what, &read("mesh.obj", &bytes), 1.0);
        // What it is, a file says itself.
        if !what.starts_with("utf16") {
            assert_same(what, &read("mesh.txt", &bytes), 1.0);
        }
    }
    let coloured = |full: f32| -> String {
        let mut vertex = 0;
        let line = |line: &str| match line.strip_prefix("v ") {
            Some(_) => {
                let [r, g, b] = colour_of(vertex).map(|channel| f32::from(channel) / full);
                vertex += 1;
                format!("{line} {r} {g} {b}\n")
            }
            None => format!("{line}\n"),
        };
        plain.lines().map(line).collect()
    };
    for full in [255.0, 1.0] {
        let mesh = read("mesh.obj", coloured(full).as_bytes());
        assert_same("coloured", &mesh, 1.0);
        assert_coloured("obj", &mesh);
    }
    let painted: String = (0..8).map(colour_of).map(|[r, g, b]| format!("ff{r:02x}{g:02x}{b:02x}")).collect();
    assert_coloured("painted", &read("mesh.obj", format!("#MRGB {painted}\n{plain}").as_bytes()));
}

#[test]
fn obj_has_its_materials_from_wherever_another_machine_had_them() {
    let folder = tempfile::tempdir().unwrap();
    let library = "newmtl plain\nKd 1 1 1\n\nnewmtl Komon Chirimen FRONT_1\r\n\tmap_Kd -s 1 1 1 -o 0.5 komon textures\\komon 1.png\r\n\
                   newmtl other\nmap_Kd other.png\n";
    fs::write(folder.path().join("komon base.mtl"), library).unwrap();
    let face = "f 1/1 7/7 8/8 2/2";
    for path in
        ["komon base.mtl", r"C:\Users\artist\MD Projects\komon base.mtl", "./komon base.mtl", "../up/komon base.mtl"]
    {
        let text = obj_text().replace(face, &format!("usemtl plain\n{face}"));
        let text = format!("mtllib {path}\ng sode\nusemtl Komon Chirimen FRONT_1\n{text}");
        let (mesh, said) = read_in("m.obj", text.as_bytes(), Some(folder.path())).unwrap();
        assert_eq!(said, [""; 0], "{path}");
        assert_same(path, &mesh, 1.0);
        let parts: Vec<(&str, &str)> = mesh.parts.iter().map(|part| (&*part.name, &*part.material)).collect();
        assert_eq!(parts, [("sode", "Komon Chirimen FRONT_1"), ("sode", "plain")]);
        assert_eq!(mesh.part_of_triangle, [0, 0, 0, 0, 1, 1, 1]);
        assert_eq!(mesh.texture, Some(Picture::Named(r"komon textures\komon 1.png".to_owned())));
    }
    // A mesh that was renamed together with its materials.
    let text = format!("mtllib gone.mtl\nusemtl other\n{}", obj_text());
    let (mesh, _) = read_in("x/komon base.obj", text.as_bytes(), Some(folder.path())).unwrap();
    assert_eq!(mesh.texture, Some(Picture::Named("other.png".to_owned())));
    let (mesh, said) = read_in("m.obj", text.as_bytes(), Some(folder.path())).unwrap();
    assert_eq!((mesh.texture, said.len()), (None, 1), "{said:?}");
    assert!(said[0].starts_with("mesh-materials: the materials' file gone.mtl is not beside"), "{said:?}");
}

/// Numbers of one type as a PLY file holds them.
fn ply_number(kind: &str, order: &str, number: f64) -> Vec<u8> {
    macro_rules! bytes {
        ($kind:ty) => {
            if order == "big" {
                (number as $kind).to_be_bytes().to_vec()
            } else {
                (number as $kind).to_le_bytes().to_vec()
            }
        };
    }
    if order == "text" {
        return format!("{number} ").into_bytes();
    }
    match kind {
        "char" | "int8" => bytes!(i8),
        "uchar" | "uint8" => bytes!(u8),
        "short" => bytes!(i16),
        "ushort" => bytes!(u16),
        "int" | "int32" => bytes!(i32),
        "uint" => bytes!(u32),
        "float" | "float32" => bytes!(f32),
        "double" => bytes!(f64),
        other => panic!("{other}"),
    }
}

/// A way to write PLY.
struct Way {
    order: &'static str,
    number: &'static str,
    /// Type and largest value of colours.
    colour: (&'static str, f64),
    count: &'static str,
    index: &'static str,
    indices: &'static str,
    /// Texture coordinates stand at the faces' corners, else at the vertices by these names.
    at_corners: Option<[&'static str; 2]>,
    has_others: bool,
}

fn ply(way: &Way) -> Vec<u8> {
    let &Way { order, number, colour: (colour, full), count, index, indices, at_corners, has_others } = way;
    let mut head = format!(
        "ply\nformat {} 1.0\ncomment TextureFile komon 1.png\nobj_info made by hand\n",
        match order {
            "text" => "ascii",
            "big" => "binary_big_endian",
            _ => "binary_little_endian",
        }
    );
    let mut body = Vec::new();
    let row = |body: &mut Vec<u8>| {
        if order == "text" {
            *body.last_mut().unwrap() = b'\n';
        }
    };
    if has_others {
        head += "element camera 2\nproperty double focus\nproperty list uchar short path\n";
        for _ in 0..2 {
            [("double", 1.25), ("uchar", 1.0), ("short", -3.0)]
                .iter()
                .for_each(|(kind, n)| body.extend(ply_number(kind, order, *n)));
            row(&mut body);
        }
    }
    write!(head, "element vertex {}\nproperty {number} x\n", POSITIONS.len()).unwrap();
    if has_others {
        head += "property float nx\n";
    }
    write!(head, "property {number} y\nproperty {number} z\n").unwrap();
    ["red", "green", "blue"].iter().for_each(|name| writeln!(head, "property {colour} {name}").unwrap());
    at_corners.iter().flatten().for_each(|name| writeln!(head, "property {number} {name}").unwrap());
    for (vertex, [x, y, z]) in POSITIONS.into_iter().enumerate() {
        body.extend(ply_number(number, order, x));
        if has_others {
            body.extend(ply_number("float", order, 0.125));
        }
        [y, z].iter().for_each(|n| body.extend(ply_number(number, order, *n)));
        colour_of(vertex).iter().for_each(|c| body.extend(ply_number(colour, order, f64::from(*c) / 255.0 * full)));
        if at_corners.is_some() {
            uv_of(vertex).iter().for_each(|n| body.extend(ply_number(number, order, *n)));
        }
        row(&mut body);
    }
    writeln!(head, "element face {}", FACES.len()).unwrap();
    if has_others {
        head += "property uchar flags\n";
    }
    writeln!(head, "property list {count} {index} {indices}").unwrap();
    if at_corners.is_none() {
        head += "property list uchar float texcoord\n";
    }
    for face in FACES {
        if has_others {
            body.extend(ply_number("uchar", order, 7.0));
        }
        body.extend(ply_number(count, order, face.len() as f64));
        face.iter().for_each(|v| body.extend(ply_number(index, order, f64::from(*v))));
        if at_corners.is_none() {
            body.extend(ply_number("uchar", order, 2.0 * face.len() as f64));
            let uv = face.iter().flat_map(|v| uv_of(*v as usize));
            uv.for_each(|n| body.extend(ply_number("float", order, n)));
        }
        row(&mut body);
    }
    if has_others {
        head += "element edge 1\nproperty int vertex1\n";
        body.extend(ply_number("int", order, 1.0));
        row(&mut body);
    }
    [head.as_bytes(), b"end_header\n", &body].concat()
}

#[test]
fn ply_is_the_same_however_it_is_written() {
    let mut written = 0;
    for order in ["text", "big", "little"] {
        for number in ["float", "double", "float32"] {
            for (at, colour) in [("uchar", 255.0), ("ushort", 65535.0), ("float", 1.0)].into_iter().enumerate() {
                let names = [Some(["s", "t"]), Some(["texture_u", "texture_v"]), None];
                let way = Way {
                    order,
                    number,
                    colour,
                    count: ["uchar", "uint", "int8"][at],
                    index: ["int", "ushort", "uint"][(at + written) % 3],
                    indices: ["vertex_indices", "vertex_index"][written % 2],
                    at_corners: names[(at + written / 3) % 3],
                    has_others: written % 4 < 2,
                };
                let bytes = ply(&way);
                let what = format!("{order} {number} {} {:?}", colour.0, way.at_corners);
                let mesh = read("scan.ply", &bytes);
                assert_same(&what, &mesh, 1.0);
                assert_coloured(&what, &mesh);
                assert_eq!(mesh.texture, Some(Picture::Named("komon 1.png".to_owned())), "{what}");
                assert_eq!((mesh.format, mesh.polygon_count), (Format::Ply, 3), "{what}");
                // Cut short anywhere it is refused.
                for length in (0..bytes.len() - 12).step_by(13) {
                    assert!(!refusal("scan.ply", &bytes[..length]).is_empty());
                }
                if order == "text" {
                    let text = String::from_utf8(bytes).unwrap();
                    assert_same("crlf", &read("scan.ply", text.replace('\n', "\r\n").as_bytes()), 1.0);
                    let bare = text.replace(" 0.", " .");
                    assert_same("bare points", &read("scan.ply", format!("{bare}\n\n").as_bytes()), 1.0);
                }
                written += 1;
            }
        }
    }
}

#[test]
fn what_is_wrong_with_a_ply_is_said() {
    let way = Way {
        order: "text",
        number: "float",
        colour: ("uchar", 255.0),
        count: "uchar",
        index: "int",
        indices: "vertex_indices",
        at_corners: Some(["s", "t"]),
        has_others: false,
    };
    let text = String::from_utf8(ply(&way)).unwrap();
    let with = |from: &str, to: &str| {
        assert!(text.contains(from), "{from}");
        refusal("scan.ply", text.replacen(from, to, 1))
    };
    let huge = "the header promises 4000000000 of vertex, more than the file has bytes for";
    assert!(with("element vertex 8", "element vertex 4000000000").contains(huge));
    assert!(with("property float y\n", "property float x\n").contains("have one name"));
    assert!(with("property float y\n", "property float w\n").contains("no property y"));
    assert!(with("vertex_indices", "corners").contains("no list vertex_indices"));
    assert!(with("element vertex", "element point").contains("no element vertex"));
    assert!(with("\n3 1 7 2", "\n3 1 8 2").contains("face 2 names vertex 8, counted from 0, but there are 8"));
    assert!(with("\n3 1 7 2", "\n3 1 -7 2").contains("face 2 names vertex -7"));
    assert!(with("\n2 1 0", "\n2 nan 0").contains("in line"));
    assert!(with("\n2 1 0", "\n2 1e30 0").contains("vertex 2 lies at"));
    assert!(refusal("scan.ply", "v 1 2 3\n").contains("does not begin as one"));
    let bare = text.replacen("\n2 1 0 ", "\n2. +1. -.0 ", 1);
    assert_same("bare points", &read("scan.ply", bare.as_bytes()), 1.0);
    let cloud = text.replace("element face 3", "element face 0");
    let (mesh, said) = read_in("scan.ply", cloud.as_bytes(), None).unwrap();
    assert_eq!((mesh.positions.len(), mesh.triangles.len()), (8, 0));
    assert_eq!(said, ["mesh-faces: the file has 8 vertices and no faces"]);
}

/// A glTF of the mesh as text with its data inside, places divided by `unit_m` under a node that scales them back.
fn gltf(unit_m: f64, change: impl Fn(&mut Value, &mut Vec<u8>)) -> (Value, Vec<u8>) {
    let plain = read("plain.obj", obj_text().as_bytes());
    let mut data = Vec::new();
    let floats = |data: &mut Vec<u8>, numbers: &mut dyn Iterator<Item = f64>| {
        numbers.for_each(|n| data.extend((n as f32).to_le_bytes()))
    };
    floats(&mut data, &mut POSITIONS.iter().flatten().map(|n| n / unit_m));
    floats(&mut data, &mut (0..8).flat_map(|v| [uv_of(v)[0], 1.0 - uv_of(v)[1]]));
    plain.triangles.iter().flatten().for_each(|v| data.extend((*v as u16).to_le_bytes()));
    data.extend([0, 0]);
    (0..8).for_each(|vertex| data.extend(colour_of(vertex).map(linear).iter().flat_map(|c| c.to_le_bytes())));
    let mut root = json!({
        "asset": {"version": "2.0"},
        "scenes": [{"nodes": [0]}],
        "nodes": [{"children": [1], "scale": [unit_m, unit_m, unit_m]}, {"mesh": 0, "name": "sode"}],
        "meshes": [{"primitives": [
            {"attributes": {"POSITION": 0, "TEXCOORD_0": 1, "COLOR_0": 3}, "indices": 2, "material": 0}
        ]}],
        "materials": [{"name": "chirimen", "pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}],
        "textures": [{"source": 0}],
        "images": [{"uri": "komon%201.png"}],
        "accessors": [
            {"bufferView": 0, "componentType": 5126, "count": 8, "type": "VEC3", "min": [0, 0, 0], "max": [1, 1, 1]},
            {"bufferView": 1, "componentType": 5126, "count": 8, "type": "VEC2"},
            {"bufferView": 2, "componentType": 5123, "count": 21, "type": "SCALAR"},
            {"bufferView": 3, "componentType": 5126, "count": 8, "type": "VEC3"},
        ],
        "bufferViews": [
            {"buffer": 0, "byteOffset": 0, "byteLength": 96},
            {"buffer": 0, "byteOffset": 96, "byteLength": 64},
            {"buffer": 0, "byteOffset": 160, "byteLength": 42},
            {"buffer": 0, "byteOffset": 204, "byteLength": 96},
        ],
        "buffers": [{"byteLength": 300}],
    });
    change(&mut root, &mut data);
    root["buffers"][0]["byteLength"] = json!(data.len());
    (root, data)
}

fn linear(channel: u8) -> f32 {
    let share = f64::from(channel) / 255.0;
    (if share <= 0.04045 { share / 12.92 } else { libm::pow((share + 0.055) / 1.055, 2.4) }) as f32
}

fn glb((root, data): &(Value, Vec<u8>)) -> Vec<u8> {
    let mut json = serde_json::to_vec(root).unwrap();
    json.resize(json.len().next_multiple_of(4), b' ');
    let mut data = data.clone();
    data.resize(data.len().next_multiple_of(4), 0);
    let mut file = b"glTF\x02\0\0\0".to_vec();
    file.extend(((28 + json.len() + data.len()) as u32).to_le_bytes());
    for (kind, chunk) in [(b"JSON", &json), (b"BIN\0", &data)] {
        file.extend((chunk.len() as u32).to_le_bytes());
        file.extend(kind);
        file.extend(chunk);
    }
    file
}

#[test]
fn gltf_is_the_same_however_it_is_written() {
    let as_it_is = |_: &mut Value, _: &mut Vec<u8>| {};
    let folder = tempfile::tempdir().unwrap();
    for unit_m in [1.0, 0.001, 0.01] {
        let parted = gltf(unit_m, as_it_is);
        let mut named = parted.0.clone();
        named["buffers"][0]["uri"] = json!("data%201.bin");
        fs::write(folder.path().join("data 1.bin"), &parted.1).unwrap();
        let mut inside = parted.0.clone();
        inside["buffers"][0]["uri"] =
            json!(format!("data:application/octet-stream;base64,{}", STANDARD.encode(&parted.1)));
        let ways = [("glb", glb(&parted)), ("text", inside.to_string().into()), ("parted", named.to_string().into())];
        for (what, bytes) in ways {
            // The name says nothing that the content does not.
            for file in ["mesh.glb", "mesh.gltf", "mesh"] {
                let (mesh, said) = read_in(file, &bytes, Some(folder.path())).unwrap();
                assert_eq!(said, [""; 0], "{what}");
                assert_same(what, &mesh, 1.0);
                assert_coloured(what, &mesh);
                assert_eq!(mesh.texture, Some(Picture::Named("komon 1.png".to_owned())), "{what}");
                assert_eq!((mesh.format, mesh.unit_m), (Format::Gltf, Some(1.0)));
                let axes = mesh.axes.unwrap();
                assert_eq!((axes.up, axes.front), (DVec3::Y, DVec3::Z));
                assert_eq!((&*mesh.parts[0].name, &*mesh.parts[0].material), ("sode", "chirimen"));
            }
        }
        assert!(refusal("mesh.gltf", named.to_string()).contains("all data must lie inside"));
    }
    let mirrored = gltf(1.0, |root, data| {
        root["nodes"][1]["scale"] = json!([-1, 1, 1]);
        for row in data[..96].chunks_mut(12) {
            let x = -f32::from_le_bytes(row[..4].try_into().unwrap());
            row[..4].copy_from_slice(&x.to_le_bytes());
        }
        for triangle in data[160..202].chunks_mut(6) {
            let (_, rest) = triangle.split_at_mut(2);
            let (b, c) = rest.split_at_mut(2);
            b.swap_with_slice(c);
        }
    });
    assert_same("mirrored", &read("mesh.glb", &glb(&mirrored)), 1.0);
    let bare = gltf(1.0, |root, data| {
        let plain = read("plain.obj", obj_text().as_bytes());
        let corners: Vec<usize> = plain.triangles.iter().flatten().map(|v| *v as usize).collect();
        let mut rows = |size: usize, from: usize| -> usize {
            let first = data.len();
            for corner in &corners {
                let row = data[from + corner * size..][..size].to_vec();
                data.extend(row);
            }
            first
        };
        let (places, uv) = (rows(12, 0), rows(8, 96));
        root["bufferViews"][0] = json!({"buffer": 0, "byteOffset": places, "byteLength": 12 * 21});
        root["bufferViews"][1] = json!({"buffer": 0, "byteOffset": uv, "byteLength": 8 * 21});
        (0..2).for_each(|accessor| root["accessors"][accessor]["count"] = json!(21));
        root["meshes"][0]["primitives"][0] = json!({"attributes": {"POSITION": 0, "TEXCOORD_0": 1}});
    });
    let mesh = read("mesh.glb", &glb(&bare));
    assert_same("not indexed", &mesh, 1.0);
    assert_eq!(mesh.positions.len(), 21);
    let picture = gltf(1.0, |root, data| {
        let first = data.len();
        data.extend(b"\x89PNG\r\n\x1a\n");
        root["bufferViews"].as_array_mut().unwrap().push(json!({"buffer": 0, "byteOffset": first, "byteLength": 8}));
        root["images"][0] = json!({"bufferView": 4, "mimeType": "image/png"});
    });
    assert_eq!(read("mesh.glb", &glb(&picture)).texture, Some(Picture::Held(b"\x89PNG\r\n\x1a\n".to_vec())));
}

#[test]
fn strips_and_fans_are_triangles_and_lines_are_passed_over() {
    let of_mode = |mode: u32, indices: &[u16]| {
        let file = gltf(1.0, |root, data| {
            let first = data.len();
            data.extend(indices.iter().flat_map(|i| i.to_le_bytes()));
            root["bufferViews"][2] = json!({"buffer": 0, "byteOffset": first, "byteLength": 2 * indices.len()});
            root["accessors"][2]["count"] = json!(indices.len());
            root["meshes"][0]["primitives"][0]["mode"] = json!(mode);
        });
        read_in("mesh.glb", &glb(&file), None).unwrap_or_else(|said| panic!("{said}"))
    };
    assert_eq!(of_mode(5, &[0, 1, 5, 4]).0.triangles, [[0, 1, 5], [1, 4, 5]]);
    // A vertex that stands twice turns the strip.
    assert_eq!(of_mode(5, &[0, 1, 5, 5, 4, 3]).0.triangles, [[0, 1, 5], [5, 3, 4]]);
    assert_eq!(of_mode(6, &[0, 1, 2, 3]).0.triangles, [[1, 2, 0], [2, 3, 0]]);
    let file = gltf(1.0, |root, _| {
        let line = json!({"attributes": {"POSITION": 0}, "mode": 1});
        root["meshes"][0]["primitives"].as_array_mut().unwrap().push(line);
    });
    let (mesh, said) = read_in("mesh.glb", &glb(&file), None).unwrap();
    assert_same("with a line", &mesh, 1.0);
    assert_eq!(said, ["mesh-faces: 1 primitives are points or lines and were passed over"]);
}

#[test]
fn what_is_wrong_with_a_gltf_is_said() {
    let with = |change: fn(&mut Value)| refusal("mesh.glb", glb(&gltf(1.0, |root, _| change(root))));
    let draco = with(|root| root["extensionsRequired"] = json!(["KHR_draco_mesh_compression"]));
    assert!(draco.contains("compressed with Draco"), "{draco}");
    assert!(with(|root| root["accessors"][0]["count"] = json!(7)).contains("names vertex 7, but has 7"));
    assert!(with(|root| root["accessors"][1]["count"] = json!(7)).contains("7 texture coordinates for 8 vertices"));
    assert!(with(|root| root["accessors"][0]["count"] = json!(4_000_000_000_u32)).contains("beyond its buffer"));
    assert!(with(|root| root["nodes"][1]["children"] = json!([0])).contains("no tree"));
    assert!(with(|root| root["nodes"][1]["scale"] = json!([1e30, 1, 1])).contains("vertex 1 of mesh sode lies at"));
    for uri in ["../data.bin", "/etc/hostname", "file:///etc/hostname", "%ff.bin", "a/../../b.bin", "http://x/y.bin"] {
        let mut file = gltf(1.0, |_, _| {}).0;
        file["buffers"][0]["uri"] = json!(uri);
        let said = read_in("mesh.gltf", file.to_string().as_bytes(), Some(Path::new("."))).expect_err(uri);
        assert!(said.contains("a buffer cannot be read"), "{said}");
    }
}

/// What gltfpack wrote; see the README there.
fn packed(name: &str) -> ImportedMesh {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("gltfpack").join(name);
    read(name, &fs::read(path).unwrap())
}

/// The triangles of a mesh, sorted by their texture coordinates, since gltfpack orders vertices for the codec; and where their corners lie.
fn surface(mesh: &ImportedMesh) -> Vec<[(String, DVec3); 3]> {
    let corner = |t: usize, i: usize| (format!("{:.6}", mesh.uv[t][i]), mesh.positions[mesh.triangles[t][i] as usize]);
    let in_order = |t: usize| {
        let mut corners = [0, 1, 2].map(|i| corner(t, i));
        let least = (0..3).min_by_key(|&i| corners[i].0.clone()).unwrap();
        corners.rotate_left(least);
        corners
    };
    let mut triangles: Vec<_> = (0..mesh.triangles.len()).map(in_order).collect();
    triangles.sort_by_key(|corners| corners.clone().map(|(uv, _)| uv));
    triangles
}

#[test]
fn what_gltfpack_compressed_is_what_it_did_not_compress() {
    // It rounds floats that it compresses.
    let pairs = [("quantised.glb", "quantised-cc.glb", 0.0), ("floats.glb", "floats-cz.glb", 1e-4)];
    for (plain, compressed, tolerance_m) in pairs {
        let [plain, compressed] = [plain, compressed].map(packed);
        assert_eq!((plain.positions.len(), plain.triangles.len()), (48, 70));
        assert_eq!(plain.parts, compressed.parts);
        let [plain, compressed] = [plain, compressed].map(|mesh| surface(&mesh).concat());
        for ((uv, place), (own_uv, own_place)) in plain.iter().zip(&compressed) {
            assert!(uv == own_uv && own_place.distance(*place) <= tolerance_m, "{own_uv} {own_place}; {uv} {place}");
        }
    }
    // A transform of the texture undoes the quantisation of its coordinates: the sheet has the whole picture.
    let uv = || packed("quantised-cc.glb").uv.into_iter().flatten();
    let most = uv().fold(Vec2::MIN, Vec2::max);
    let least = uv().fold(Vec2::MAX, Vec2::min);
    assert!(least.abs_diff_eq(Vec2::ZERO, 1e-3) && most.abs_diff_eq(Vec2::ONE, 1e-3), "{least} {most}");
}

/// A file whose views are all compressed, as meshopt would write them if nothing repeated: indices in sequence, rows as literal deltas.
fn compressed(change: impl Fn(&mut Value, &mut Vec<u8>)) -> Vec<u8> {
    let (mut root, data) = gltf(1.0, |_, _| {});
    let mut packed: Vec<u8> = Vec::new();
    for (number, stride) in [12, 8, 2, 12].into_iter().enumerate() {
        let view = &mut root["bufferViews"][number];
        let whole = |name: &str| view[name].as_u64().unwrap() as usize;
        let (offset, length) = (whole("byteOffset"), whole("byteLength"));
        let rows = &data[offset..offset + length];
        let (first, count) = (packed.len(), length / stride);
        let mode = if stride == 2 {
            let mut before = 0;
            packed.push(0xd1);
            for row in rows.chunks(2) {
                let index = i32::from(row[0]);
                let step = index - before;
                packed.push((((step << 1) ^ (step >> 31)) << 1) as u8);
                before = index;
            }
            packed.extend([0; 4]);
            "INDICES"
        } else {
            packed.push(0xa1);
            packed.extend(vec![0xff; stride / 4]);
            for byte in 0..stride {
                let mut before = rows[byte];
                for row in rows.chunks(stride) {
                    let step = row[byte].wrapping_sub(before) as i8;
                    packed.push(((step << 1) ^ (step >> 7)) as u8);
                    before = row[byte];
                }
            }
            let tail = stride + stride / 4;
            packed.extend(vec![0; 24_usize.saturating_sub(tail)]);
            packed.extend(&rows[..stride]);
            packed.extend(vec![0; stride / 4]);
            "ATTRIBUTES"
        };
        view["buffer"] = json!(1);
        view["extensions"]["KHR_meshopt_compression"] = json!({
            "buffer": 0, "byteOffset": first, "byteLength": packed.len() - first, "byteStride": stride, "count": count, "mode": mode,
        });
    }
    root["buffers"] = json!([{"byteLength": 0}, {"byteLength": data.len()}]);
    root["extensionsRequired"] = json!(["KHR_meshopt_compression"]);
    change(&mut root, &mut packed);
    root["buffers"][0]["byteLength"] = json!(packed.len());
    glb(&(root, packed))
}

#[test]
fn compressed_views_are_held_against_what_the_file_says_of_them() {
    assert_same("compressed", &read("mesh.glb", &compressed(|_, _| {})), 1.0);
    let with = |view: usize, name: &'static str, value: Value| {
        let file = compressed(|root, _| {
            root["bufferViews"][view]["extensions"]["KHR_meshopt_compression"][name] = value.clone()
        });
        refusal("mesh.glb", file)
    };
    let check = |said: String, wanted: &str| assert!(said.contains(wanted), "{said}");
    check(
        with(0, "count", json!(9)),
        "buffer view 0 is compressed (meshopt), but its byteLength or byteStride is not that of 9 rows",
    );
    check(with(2, "byteStride", json!(4)), "is not that of 21 rows of 4 bytes");
    check(with(1, "mode", json!("VERTICES")), "its mode is none of ATTRIBUTES");
    check(with(1, "filter", json!("ZIGZAG")), "its filter is none of NONE");
    check(with(1, "byteOffset", json!(-1)), "its byteOffset is no whole number");
    check(with(3, "buffer", json!(7)), "buffer view 3 cannot be decompressed (meshopt): it reaches beyond its buffer");
    check(with(3, "byteLength", json!(u64::MAX)), "reaches beyond its buffer");
    check(with(3, "byteLength", json!(100)), "end early");
    check(with(2, "mode", json!("TRIANGLES")), "no version that is known");
    check(with(2, "count", json!(u64::MAX)), "its size is no number");
    let huge = compressed(|root, _| {
        root["bufferViews"][0]["byteLength"] = json!(12 << 25);
        root["bufferViews"][0]["extensions"]["KHR_meshopt_compression"]["count"] = json!(1 << 25);
    });
    check(refusal("mesh.glb", huge), "hold more than 256 MB");
    let large = compressed(|root, _| {
        root["bufferViews"][0]["byteLength"] = json!(12 << 20);
        root["bufferViews"][0]["extensions"]["KHR_meshopt_compression"]["count"] = json!(1 << 20);
    });
    check(refusal("mesh.glb", large), "more rows than its data can hold");
    // What stands behind the first row of indices in the file: a step from vertex 0.
    let beyond = compressed(|root, packed| {
        let own = &root["bufferViews"][2]["extensions"]["KHR_meshopt_compression"];
        packed[own["byteOffset"].as_u64().unwrap() as usize + 1] = 0x7c;
    });
    check(refusal("mesh.glb", beyond), "names vertex 31, but has 8");
}

/// FBX text of the mesh: `unit_m` by the header, and nodes and geometry with transforms of their own that the places undo.
fn fbx(unit_m: f64, up_axis: usize, scale: f64, shift: f64, geometric_shift: f64) -> String {
    let list = |numbers: &mut dyn Iterator<Item = f64>| numbers.map(|n| n.to_string()).collect::<Vec<_>>().join(",");
    let place = |n: f64| n / unit_m;
    let places = POSITIONS.iter().flat_map(|[x, y, z]| {
        let [x, y, z] = [x, y, z].map(|n| place(*n));
        [(x - shift) / scale - geometric_shift, y / scale, z / scale]
    });
    let places = list(&mut places.into_iter());
    let order =
        |face: &[u32]| -> Vec<u32> { if scale < 0.0 { face.iter().rev().copied().collect() } else { face.to_vec() } };
    let corners = FACES.iter().flat_map(|face| {
        let face = order(face);
        let last = face.len() - 1;
        face.into_iter().enumerate().map(move |(i, v)| if i == last { -f64::from(v) - 1.0 } else { f64::from(v) })
    });
    let corners = list(&mut corners.into_iter());
    let uv = list(&mut (0..8).flat_map(uv_of));
    let uv_index = list(&mut FACES.iter().flat_map(|face| order(face)).map(f64::from));
    let (front, front_sign) = if up_axis == 1 { (2, 1) } else { (1, -1) };
    let array = |name: &str, numbers: &str| format!("{name}: *{} {{\n a: {numbers}\n}}\n", numbers.split(',').count());
    let number =
        |name: &str, kind: &str, long: &str, n: f64| format!("P: \"{name}\", \"{kind}\", \"{long}\", \"\",{n}\n");
    let vector =
        |name: &str, kind: &str, [x, y, z]: [f64; 3]| format!("P: \"{name}\", \"{kind}\", \"\", \"A\",{x},{y},{z}\n");
    [
        "; FBX 7.4.0 project file\n; written by hand\n\nFBXHeaderExtension:  {\nFBXHeaderVersion: 1003\nFBXVersion: 7400\n}\n",
        "GlobalSettings:  {\nVersion: 1000\nProperties70:  {\n",
        &number("UpAxis", "int", "Integer", up_axis as f64),
        &number("UpAxisSign", "int", "Integer", 1.0),
        &number("FrontAxis", "int", "Integer", f64::from(front)),
        &number("FrontAxisSign", "int", "Integer", f64::from(front_sign)),
        &number("CoordAxis", "int", "Integer", 0.0),
        &number("CoordAxisSign", "int", "Integer", 1.0),
        &number("UnitScaleFactor", "double", "Number", unit_m * 100.0),
        "}\n}\nObjects:  {\nGeometry: 1001, \"Geometry::sode\", \"Mesh\" {\n",
        &array("Vertices", &places),
        &array("PolygonVertexIndex", &corners),
        "GeometryVersion: 124\nLayerElementUV: 0 {\nVersion: 101\nName: \"map1\"\nMappingInformationType: \"ByPolygonVertex\"\n",
        "ReferenceInformationType: \"IndexToDirect\"\n",
        &array("UV", &uv),
        &array("UVIndex", &uv_index),
        "}\nLayerElementMaterial: 0 {\nVersion: 101\nName: \"\"\nMappingInformationType: \"AllSame\"\n",
        "ReferenceInformationType: \"IndexToDirect\"\n",
        &array("Materials", "0"),
        "}\nLayer: 0 {\nVersion: 100\nLayerElement:  {\nType: \"LayerElementUV\"\nTypedIndex: 0\n}\n",
        "LayerElement:  {\nType: \"LayerElementMaterial\"\nTypedIndex: 0\n}\n}\n}\n",
        "Model: 1002, \"Model::sode\", \"Mesh\" {\nVersion: 232\nProperties70:  {\n",
        &vector("Lcl Translation", "Lcl Translation", [shift, 0.0, 0.0]),
        &vector("Lcl Scaling", "Lcl Scaling", [scale, scale, scale]),
        &vector("GeometricTranslation", "Vector3D", [geometric_shift, 0.0, 0.0]),
        "}\n}\nMaterial: 1003, \"Material::chirimen\", \"\" {\nVersion: 102\nShadingModel: \"phong\"\n}\n",
        "Texture: 1004, \"Texture::komon\", \"\" {\nType: \"TextureVideoClip\"\nFileName: \"C:\\komon 1.png\"\n",
        "RelativeFilename: \"komon 1.png\"\n}\n}\n",
        "Connections:  {\nC: \"OO\",1002,0\nC: \"OO\",1001,1002\nC: \"OO\",1003,1002\nC: \"OP\",1004,1003, \"DiffuseColor\"\n}\n",
    ]
    .concat()
}

#[test]
fn fbx_is_the_same_however_it_is_written() {
    for unit_m in [1.0, 0.01, 0.001] {
        for (up_axis, up, front) in [(1, DVec3::Y, DVec3::Z), (2, DVec3::Z, DVec3::NEG_Y)] {
            for (scale, shift, geometric) in [(1.0, 0.0, 0.0), (100.0, 25.0, 0.0), (0.5, -3.0, 8.0), (-2.0, 1.0, 1.0)] {
                let what = format!("unit {unit_m}, up {up}, scale {scale}, shift {shift}, {geometric}");
                let mesh = read("mesh.fbx", fbx(unit_m, up_axis, scale, shift, geometric).as_bytes());
                let unit = mesh.unit_m.unwrap();
                assert!((unit / unit_m - 1.0).abs() < 1e-12, "{what}: {unit}");
                let wanted: Vec<DVec3> = POSITIONS.iter().map(|p| DVec3::from_array(*p)).collect();
                let same = |(own, wanted): (&DVec3, &DVec3)| (*own * unit).distance(*wanted) < SAME_M;
                assert!(mesh.positions.iter().zip(&wanted).all(same), "{what}: {:?}", mesh.positions);
                if scale > 0.0 {
                    assert_same(&what, &mesh, unit);
                } else {
                    // Turned polygons begin at another corner; they face the same way.
                    assert_eq!(mesh.triangles.len(), 7, "{what}");
                    let triangle = mesh.triangles[0].map(|v| mesh.positions[v as usize]);
                    assert!((triangle[1] - triangle[0]).cross(triangle[2] - triangle[0]).z > 0.0, "{what}");
                }
                let axes = mesh.axes.unwrap();
                assert_eq!((axes.up, axes.front), (up, front), "{what}");
                assert_eq!((&*mesh.parts[0].name, &*mesh.parts[0].material), ("sode", "chirimen"), "{what}");
                assert_eq!(mesh.texture, Some(Picture::Named("komon 1.png".to_owned())), "{what}");
            }
        }
    }
    let text = fbx(1.0, 1, 1.0, 0.0, 0.0);
    let said = refusal("mesh.fbx", text.replace("a: 0,1,2,3,4,-6", "a: 0,1,2,3,99,-6"));
    assert!(said.contains("cannot be read"), "{said}");
    for length in (40..text.len()).step_by(97) {
        let _ = read_in("mesh.fbx", &text.as_bytes()[..length], None);
    }
}

#[test]
fn what_is_not_read_is_told_with_what_to_do() {
    let said = |file: &str, bytes: &[u8]| {
        let mut report = Vec::new();
        assert!(import::read_bytes(file, bytes, None, &mut report).is_none());
        format!("{file}: {}. {}", report[0].problem, report[0].help)
    };
    insta::assert_snapshot!(
        [
            said("dress.stl", b"solid x\n"),
            said("dress.zprj", b"PK\x03\x04"),
            said("dress.dae", b"<?xml version=\"1.0\"?><COLLADA>"),
            said("dress.mcx", b"FOR8"),
            said("dress.fbx", b"PK\x03\x04"),
            said("dress", b"\0\0\0\0"),
            said("dress.obj", b""),
        ]
        .join("\n")
    );
}

fn shared(folder: &str) -> Option<PathBuf> {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../shared/data").join(folder);
    if !path.exists() {
        println!("skipped: {} is absent", path.display());
    }
    path.exists().then_some(path)
}

/// The files of a folder at any depth, sorted, with their names in it.
fn files_of(folder: &Path) -> Vec<(String, PathBuf)> {
    let (mut files, mut folders) = (Vec::new(), vec![folder.to_owned()]);
    while let Some(next) = folders.pop() {
        for entry in fs::read_dir(&next).unwrap() {
            let path = entry.unwrap().path();
            if path.is_dir() {
                folders.push(path);
            } else {
                let name = path.strip_prefix(folder).unwrap().to_string_lossy().replace('\\', "/");
                files.push((name, path));
            }
        }
    }
    files.sort();
    files
}

/// Every file of other programs: what it gives, or the first message.
#[test]
fn odd_files_are_read_or_refused_with_the_reason() {
    let mut summary = String::new();
    for folder in ["obj_quirks", "fbx", "gltf", "garments", "scans", "md_export"] {
        let Some(path) = shared(folder) else { return };
        for (name, path) in files_of(&path) {
            let is_other = ["mtl", "bin", "png", "jpg", "json", "md", "txt"]
                .iter()
                .any(|kind| path.extension().is_some_and(|own| own == *kind));
            if is_other || name.contains("LICENSE") {
                continue;
            }
            let mut report = Vec::new();
            let mesh = import::read(&name, &path, &mut report).unwrap();
            assert!(report.iter().all(|d| d.file == name && !d.help.is_empty()), "{report:?}");
            let first = report.first().map(|d| format!("{}: {}", d.code, d.problem));
            let Some(mesh) = mesh else {
                writeln!(summary, "{folder}/{name}: refused, {}", first.expect("a reason")).unwrap();
                continue;
            };
            let found = mesh.soundness();
            let texture = match &mesh.texture {
                None => "no texture".to_owned(),
                Some(Picture::Named(name)) => format!("texture {name}"),
                Some(Picture::Held(bytes)) => format!("texture of {} bytes", bytes.len()),
            };
            writeln!(
                summary,
                "{folder}/{name}: {} {} vertices ({} unused), {} faces, {} triangles, {} parts, {}{}unit {}, {} pieces, {} rims, {texture}{}",
                mesh.format.name(),
                mesh.positions.len(),
                found.unused,
                mesh.polygon_count,
                mesh.triangles.len(),
                mesh.parts.len(),
                if mesh.uv.is_empty() { "" } else { "uv, " },
                if mesh.colours.is_empty() { "" } else { "colours, " },
                mesh.unit_m.map_or("unknown".to_owned(), |unit_m| format!("{unit_m} m")),
                found.components,
                found.border_loops,
                first.map_or(String::new(), |first| format!("; {first}")),
            )
            .unwrap();
        }
    }
    insta::assert_snapshot!(summary);
}

/// Text and binary are one mesh. The OBJ files are later frames of its simulation: the same faces, moved.
#[test]
fn one_garment_is_the_same_as_text_and_binary_and_has_the_faces_of_its_obj() {
    let Some(folder) = shared("garments") else { return };
    let read = |name: &str| {
        let mut report = Vec::new();
        let mesh = import::read(name, &folder.join(name), &mut report).unwrap();
        mesh.unwrap_or_else(|| panic!("{report:?}"))
    };
    let text = read("marvelous_quad_7700_ascii.fbx");
    let binary = read("marvelous_quad_7700_binary.fbx");
    let obj = read("marvelous_quad_12.obj");
    let apart = text.positions.iter().zip(&binary.positions).map(|(a, b)| a.distance(*b)).fold(0.0, f64::max);
    assert!(apart < 1e-3, "{apart}");
    assert_eq!((text.positions.len(), &text.triangles, &text.uv), (216, &binary.triangles, &binary.uv));
    assert_eq!((text.unit_m, text.axes), (binary.unit_m, binary.axes));
    assert_eq!((obj.positions.len(), obj.polygon_count), (text.positions.len(), text.polygon_count));
    // Bent quads may be cut along the other diagonal.
    let sorted = |mesh: &ImportedMesh| {
        let mut quads: Vec<Vec<u32>> = mesh.triangles.chunks(2).map(|pair| pair.concat()).collect();
        quads.iter_mut().for_each(|quad| {
            quad.sort_unstable();
            quad.dedup();
        });
        quads
    };
    assert_eq!(sorted(&text), sorted(&obj));
    // The cache that comes with the scene holds the frames in the scene's unit: its twelfth of 24 a second is the OBJ's.
    let path = folder.join("marvelous_quad.xml");
    let cache = ufbx::load_geometry_cache(&path.to_string_lossy(), ufbx::GeometryCacheOpts::default());
    let cache = cache.unwrap_or_else(|error| panic!("{error:?}"));
    let mut places = vec![ufbx::Vec3 { x: 0.0, y: 0.0, z: 0.0 }; obj.positions.len()];
    let options = ufbx::GeometryCacheDataOpts::default();
    let count = ufbx::sample_geometry_cache_vec3(&cache.channels[0], 12.0 / 24.0, &mut places, options);
    let apart = |(a, b): (&DVec3, &ufbx::Vec3)| a.distance(DVec3::new(b.x, b.y, b.z));
    let apart = obj.positions.iter().zip(&places).map(apart).fold(0.0, f64::max);
    assert!(count == 216 && apart < 0.01, "{count} {apart}");
}

/// What reads, and the files that it is fed.
type Fed = (fn(&[u8]), Vec<Vec<u8>>);

/// The corpora of the fuzz targets, and other kinds of our own, with some bytes changed, taken out or doubled.
#[test]
fn damaged_files_do_no_harm() {
    let mut state = 1_u64;
    let mut next = |below: usize| {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 33) as usize % below.max(1)
    };
    let corpus = |name: &str| files_of(&Path::new(env!("CARGO_MANIFEST_DIR")).join("../fuzz/corpus").join(name));
    let own: [Fed; 4] = [
        (hostile::ply, corpus("ply").iter().map(|(_, path)| fs::read(path).unwrap()).collect()),
        (hostile::gltf_mesh, corpus("gltf_mesh").iter().map(|(_, path)| fs::read(path).unwrap()).collect()),
        (|bytes| drop(read_in("m.obj", bytes, None)), vec![obj_text().into()]),
        (|bytes| drop(read_in("m.fbx", bytes, None)), vec![fbx(0.01, 1, 2.0, 1.0, 1.0).into()]),
    ];
    for (read, files) in own {
        for round in 0..6000 / files.len() {
            for file in &files {
                let mut bytes = file.clone();
                for _ in 0..1 + round % 4 {
                    if bytes.is_empty() {
                        break;
                    }
                    let (at, length) = (next(bytes.len()), 1 + next(6));
                    let end = (at + length).min(bytes.len());
                    match next(4) {
                        0 => bytes[at..end].iter_mut().for_each(|byte| *byte = [0, 0xff, b'9', b'-'][next(4)]),
                        1 => drop(bytes.drain(at..end)),
                        2 => bytes.extend_from_within(at..end),
                        _ => bytes[at] ^= 1 << next(8),
                    }
                }
                read(&bytes);
            }
        }
    }
}

/// Other libraries see the same positions.
#[test]
fn positions_are_those_of_other_libraries() {
    let (mut by_ufbx, mut by_tobj) = (0, 0);
    for folder in ["obj_quirks", "scans", "garments", "md_export"] {
        let Some(path) = shared(folder) else { return };
        for (name, path) in files_of(&path).into_iter().filter(|(name, _)| name.ends_with(".obj")) {
            let mut report = Vec::new();
            let Some(mesh) = import::read(&name, &path, &mut report).unwrap() else { continue };
            let bytes = fs::read(&path).unwrap();
            let options = ufbx::LoadOpts {
                obj_merge_objects: true,
                obj_merge_groups: true,
                file_format: ufbx::FileFormat::Obj,
                ..Default::default()
            };
            if let Ok(scene) = ufbx::load_memory(&bytes, options)
                && let [other] = &*scene.meshes
                && other.vertices.len() == mesh.positions.len()
            {
                let same =
                    |(a, b): (&DVec3, &ufbx::Vec3)| a.distance(DVec3::new(b.x, b.y, b.z)) <= 1e-9 * (1.0 + a.length());
                assert!(mesh.positions.iter().zip(&other.vertices).all(same), "{name}");
                assert_eq!(other.num_triangles, mesh.triangles.len(), "{name}");
                by_ufbx += 1;
            }
            // It renumbers: compared are the places of the corners.
            let options = tobj::LoadOptions { single_index: false, ..Default::default() };
            let no_materials = |_: &Path| Err(tobj::LoadError::OpenFileFailed);
            let is_told = !name.contains("synthetic");
            if is_told && let Ok((models, _)) = tobj::load_obj_buf(&mut &*bytes, &options, no_materials) {
                let (mut own, mut other) = (Vec::new(), Vec::new());
                let rounded = |place: [f64; 3]| place.map(|n| (n * 1e3).round() as i64);
                for model in &models {
                    let place = |v: u32| &model.mesh.positions[3 * v as usize..][..3];
                    other
                        .extend(model.mesh.indices.iter().map(|v| rounded([0, 1, 2].map(|i| f64::from(place(*v)[i])))));
                }
                own.extend(
                    mesh.triangles
                        .iter()
                        .flatten()
                        .map(|v| rounded(mesh.positions[*v as usize].to_array().map(|n| f64::from(n as f32)))),
                );
                for places in [&mut own, &mut other] {
                    places.sort_unstable();
                    places.dedup();
                }
                if !mesh.triangles.is_empty() && mesh.larger_count == 0 {
                    assert_eq!(own, other, "{name}");
                    by_tobj += 1;
                }
            }
        }
    }
    assert!(by_ufbx >= 15 && by_tobj >= 8, "{by_ufbx} by ufbx, {by_tobj} by tobj");
}
