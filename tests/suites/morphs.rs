//! A garment whose base and targets are one glTF file with morph targets, held against the same garment of OBJ files.

use glam::{DVec3, Vec3};
use kitsuke_pipeline::ir::Garment;
use kitsuke_pipeline::source::{self, import, obj};
use kitsuke_pipeline::{diagnostic::Diagnostic, load};
use serde_json::{Value, json};
use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};
use tempfile::TempDir;

/// The targets of the tube.
const TARGETS: [&str; 3] = ["01_right_down", "02_left_down", "03_right_elbow"];
/// How the file's one node is scaled and moved.
const SCALE: f64 = 0.5;
const SHIFT: [f64; 3] = [0.1, -0.2, 0.3];
/// Deltas of 16 bits reach one unit of the file, which is half a metre: what is between two of them is less.
const SAME_M: f32 = 2e-5;

fn tube() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("garments/tube")
}

fn obj(name: &str) -> obj::Mesh {
    let bytes = fs::read(tube().join(name)).unwrap();
    obj::read(name, &bytes, &mut Vec::new()).unwrap()
}

/// The tube as exporters write it: vertices split by texture coordinate, a mesh and node of its own for each part, names of morph targets in
/// the extras. Deltas are floats, sparse floats and normalised 16 bits.
fn tube_gltf(change: impl Fn(&mut Value)) -> Vec<u8> {
    let base = obj("base.obj");
    let targets = TARGETS.map(|name| obj(&format!("poses/{name}.obj")));
    let triangles = base.triangulate();
    let (mut data, mut views, mut accessors) = (Vec::new(), Vec::new(), Vec::new());
    let mut add = |bytes: Vec<u8>, mut accessor: Value| {
        accessor["bufferView"] = json!(views.len());
        views.push(json!({"buffer": 0, "byteOffset": data.len(), "byteLength": bytes.len()}));
        data.extend(bytes);
        data.resize(data.len().next_multiple_of(4), 0);
        accessor
    };
    let floats =
        |rows: &[Vec3]| rows.iter().flat_map(|row| row.to_array()).flat_map(f32::to_le_bytes).collect::<Vec<u8>>();
    let shift = DVec3::from_array(SHIFT);
    let place = |mesh: &obj::Mesh, v: u32| ((mesh.positions[v as usize] - shift) / SCALE).as_vec3();
    let scale = [SCALE; 3];
    let (mut meshes, mut nodes, mut first) = (Vec::new(), vec![json!({"scale": scale, "translation": SHIFT})], 0);
    for (name, &count) in base.parts.iter().zip(&triangles.part_counts) {
        let mut known = BTreeMap::new();
        let mut own: Vec<obj::Corner> = Vec::new();
        let mut indices = Vec::new();
        for corner in triangles.corners[first..first + count as usize].iter().flatten() {
            let index = *known.entry(*corner).or_insert_with(|| {
                own.push(*corner);
                own.len() as u16 - 1
            });
            indices.extend(index.to_le_bytes());
        }
        first += count as usize;
        let rows = |mesh: &obj::Mesh| own.iter().map(|corner| place(mesh, corner.vertex)).collect::<Vec<Vec3>>();
        let places = rows(&base);
        let moves =
            |target: &obj::Mesh| rows(target).iter().zip(&places).map(|(to, from)| *to - *from).collect::<Vec<Vec3>>();
        let uv = |corner: &obj::Corner| corner.uv.map(|uv| base.uv[uv as usize]).unwrap();
        let uv = own.iter().map(uv).flat_map(|uv| [uv.x, 1.0 - uv.y]).flat_map(f32::to_le_bytes).collect();
        let float = |kind: &str| json!({"componentType": 5126, "count": own.len(), "type": kind});
        let at = accessors.len();
        accessors.push(add(floats(&places), float("VEC3")));
        accessors.push(add(uv, float("VEC2")));
        accessors.push(add(indices, json!({"componentType": 5123, "count": 3 * count, "type": "SCALAR"})));
        accessors.push(add(floats(&moves(&targets[0])), float("VEC3")));
        let moved: Vec<(u16, Vec3)> =
            (0..).zip(moves(&targets[1])).filter(|(v, way)| *v == 0 || *way != Vec3::ZERO).collect();
        let rows_of = moved.iter().flat_map(|(v, _)| v.to_le_bytes()).collect();
        let [numbers, ways] = [rows_of, floats(&moved.iter().map(|(_, way)| *way).collect::<Vec<Vec3>>())]
            .map(|bytes| add(bytes, json!({}))["bufferView"].clone());
        let mut sparse = float("VEC3");
        sparse["sparse"] = json!({
            "count": moved.len(), "indices": {"bufferView": numbers, "componentType": 5123}, "values": {"bufferView": ways},
        });
        accessors.push(sparse);
        let whole = |n: f32| ((n * 32767.0).round() as i16).to_le_bytes();
        let rows_of =
            moves(&targets[2]).into_iter().flat_map(|way| [way.x, way.y, way.z, 0.0]).flat_map(whole).collect();
        let mut short =
            add(rows_of, json!({"componentType": 5122, "normalized": true, "count": own.len(), "type": "VEC3"}));
        // The stride belongs to the view.
        short["stride"] = json!(8);
        accessors.push(short);
        let [p, t, i, a, b, c] = [0, 1, 2, 3, 4, 5].map(|i| at + i);
        nodes.push(json!({"mesh": meshes.len(), "name": name}));
        meshes.push(json!({
            "primitives": [{
                "attributes": {"POSITION": p, "TEXCOORD_0": t}, "indices": i,
                "targets": [{"POSITION": a}, {"POSITION": b}, {"POSITION": c}],
            }],
            "extras": {"targetNames": ["right down", "left down", "肘"]},
        }));
    }
    for accessor in &mut accessors {
        if let Some(stride) = accessor.as_object_mut().unwrap().remove("stride") {
            views[accessor["bufferView"].as_u64().unwrap() as usize]["byteStride"] = stride;
        }
    }
    nodes[0]["children"] = json!((1..nodes.len()).collect::<Vec<_>>());
    let mut root = json!({
        "asset": {"version": "2.0"}, "scenes": [{"nodes": [0]}], "nodes": nodes, "meshes": meshes, "accessors": accessors,
        "bufferViews": views, "buffers": [{"byteLength": data.len()}],
    });
    change(&mut root);
    let mut json = serde_json::to_vec(&root).unwrap();
    json.resize(json.len().next_multiple_of(4), b' ');
    let mut file = b"glTF\x02\0\0\0".to_vec();
    file.extend(((28 + json.len() + data.len()) as u32).to_le_bytes());
    for (kind, chunk) in [(b"JSON", &json), (b"BIN\0", &data)] {
        file.extend((chunk.len() as u32).to_le_bytes());
        file.extend(kind);
        file.extend(chunk);
    }
    file
}

fn copy(from: &Path, to: &Path) {
    fs::create_dir_all(to).unwrap();
    for entry in fs::read_dir(from).unwrap().map(Result::unwrap) {
        let (from, to) = (entry.path(), to.join(entry.file_name()));
        if from.is_dir() { copy(&from, &to) } else { fs::copy(&from, &to).map(|_| ()).unwrap() }
    }
}

/// The tube without sizes and paths, its manifest and pose table changed, and a glTF file beside them.
fn garment(
    manifest: impl Fn(&str) -> String,
    poses: impl Fn(&str) -> String,
    gltf: &[u8],
) -> (Option<Garment>, Vec<Diagnostic>) {
    let folder = TempDir::new().unwrap();
    copy(tube().parent().unwrap(), folder.path());
    let own = folder.path().join("tube");
    let edit = |name: &str, change: &dyn Fn(&str) -> String| {
        let path = own.join(name);
        fs::write(&path, change(&fs::read_to_string(&path).unwrap())).unwrap();
    };
    edit("garment.toml", &|text| {
        let is_kept = |line: &&str| !["paths", "sizes", "rules"].iter().any(|key| line.starts_with(key));
        manifest(&text.lines().filter(is_kept).map(|line| format!("{line}\n")).collect::<String>())
    });
    edit("poses.csv", &poses);
    fs::write(own.join("tube.glb"), gltf).unwrap();
    let loaded = load(&own);
    let files = source::input_files(&own).map(|files| files.into_iter().map(|file| file.path).collect::<Vec<_>>());
    if let Ok(files) = files {
        assert!(files.iter().all(|file| !file.contains('#')), "{files:?}");
    }
    (loaded.garment, loaded.diagnostics)
}

fn of_gltf(text: &str) -> String {
    let text = text.replace("base.obj", "tube.glb").replace("poses/01_right_down.obj", "tube.glb#right down");
    text.replace("poses/02_left_down.obj", "tube.glb#left down").replace("poses/03_right_elbow.obj", "tube.glb#肘")
}

#[test]
fn morph_targets_of_one_file_are_the_targets_that_obj_files_are() {
    let (plain, said) = garment(str::to_owned, str::to_owned, b"");
    let plain = plain.unwrap_or_else(|| panic!("{said:?}"));
    let (morphed, said) = garment(of_gltf, of_gltf, &tube_gltf(|_| {}));
    let morphed = morphed.unwrap_or_else(|| panic!("{said:?}"));
    // What seams of the texture and parts split is one again.
    assert_eq!(morphed.base.positions_m.len(), plain.base.positions_m.len());
    assert_eq!(morphed.base.triangles.len(), plain.base.triangles.len());
    assert_eq!(morphed.base.parts, plain.base.parts);
    let same = |own: &[Vec3], wanted: &[Vec3]| {
        for (own_corners, corners) in morphed.base.triangles.iter().zip(&plain.base.triangles) {
            for (&a, &b) in own_corners.iter().zip(corners) {
                let (a, b) = (own[a as usize], wanted[b as usize]);
                assert!(a.distance(b) < SAME_M, "{a} {b}");
            }
        }
    };
    same(&morphed.base.positions_m, &plain.base.positions_m);
    assert_eq!(morphed.targets.len(), TARGETS.len());
    for (own, wanted) in morphed.targets.iter().zip(&plain.targets) {
        assert_eq!(own.name, wanted.name);
        same(&own.positions_m, &wanted.positions_m);
    }
}

#[test]
fn a_file_lists_its_morph_targets() {
    let morphs = |change: fn(&mut Value)| {
        import::read_bytes("tube.glb", &tube_gltf(change), None, &mut Vec::new()).unwrap().morphs
    };
    assert_eq!(morphs(|_| {}), ["right down", "left down", "肘"]);
    let without = |root: &mut Value| {
        root["meshes"].as_array_mut().unwrap().iter_mut().for_each(|mesh| mesh["extras"] = json!({"targetNames": 3}));
    };
    assert_eq!(morphs(without), ["0", "1", "2"]);
}

#[test]
fn what_is_wrong_with_morph_targets_is_said() {
    let said = |manifest: fn(&str) -> String, poses: fn(&str) -> String, change: fn(&mut Value)| {
        let (garment, said) = garment(manifest, poses, &tube_gltf(change));
        assert!(garment.is_none());
        said.iter()
            .map(|d| format!("{} {} {:?}: {} {}\n", d.code, d.file, d.place, d.problem, d.help))
            .collect::<String>()
    };
    let check = |said: &str, wanted: &[&str]| wanted.iter().for_each(|w| assert!(said.contains(w), "{w}: {said}"));
    let misspelt = said(of_gltf, |text| of_gltf(text).replace("#left down", "#left dwn"), |_| {});
    check(
        &misspelt,
        &[
            "morph-target tube/poses.csv Line(4): tube/tube.glb has no morph target `left dwn`; did you mean `left down`?",
        ],
    );
    check(&misspelt, &["It has right down, left down, 肘."]);
    let twice = |root: &mut Value| root["meshes"][0]["extras"]["targetNames"][1] = json!("right down");
    check(
        &said(of_gltf, of_gltf, twice),
        &["morph-target tube/tube.glb", "two of a mesh's 3 morph targets are called right down"],
    );
    let unnamed = said(of_gltf, |text| of_gltf(text).replace("#left down", "#"), |_| {});
    check(&unnamed, &["names no morph target after its `#`"]);
    let in_cm = said(|text| of_gltf(text).replace("unit = \"m\"", "unit = \"cm\""), of_gltf, |_| {});
    check(&in_cm, &["gltf-unit tube/garment.toml", "in metres with +Y up"]);
    let short = |root: &mut Value| root["accessors"][3]["count"] = json!(2);
    check(&said(of_gltf, of_gltf, short), &["mesh-gltf tube/tube.glb", "moves 2 of"]);
    let (absent, said) = garment(of_gltf, |text| of_gltf(text).replace("tube.glb#", "other.glb#"), &tube_gltf(|_| {}));
    assert!(absent.is_none() && said.iter().any(|d| d.problem.contains("tube/other.glb cannot be read")), "{said:?}");
}
