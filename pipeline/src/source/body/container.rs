//! glTF bytes as a document of what a body is made of: nodes, meshes and skins, and which node is which bone where the file says so.
//! What a body does not need (pictures, materials, animations) is taken out first, since the glTF library refuses whole files for faults
//! and novelties there; who wants to know how a mesh looks gets them as they stand ([`Looks`]). Knows no skeleton.

use super::compressed::Compressed;
use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use kitsuke::skeleton::Bone;
use kitsuke::skeleton::names::vrm0_bone;
use serde_json::{Map, Value, json};
use std::collections::BTreeSet;
use std::path::{Component, Path};

/// Longest JSON part, bytes.
const LONGEST_JSON: usize = 64 << 20;
/// Parts of a file that do not shape a body.
const UNNEEDED: [&str; 9] = [
    "animations",
    "cameras",
    "images",
    "textures",
    "samplers",
    "materials",
    "extensions",
    "extensionsUsed",
    "extensionsRequired",
];
/// An extension without which vertices cannot be read.
const DRACO: &str = "KHR_draco_mesh_compression";

/// A file's nodes, meshes and skins, and the bytes that they name.
pub(in crate::source) struct Container {
    pub document: gltf::Document,
    pub buffers: Vec<gltf::buffer::Data>,
    /// Accessors without bytes, whose numbers the format says are all 0.
    pub zeros: BTreeSet<usize>,
    /// What a VRM file says its nodes are; empty in other files. The nodes need not exist.
    pub humanoid: Vec<(Bone, usize)>,
    /// Whether it is of VRM 0.x, which faces -Z.
    pub is_vrm0: bool,
}

/// What a file says of how its meshes look, unchecked.
#[derive(Default)]
pub(in crate::source) struct Looks {
    /// `materials`, `textures` and `images` of the file, as they stand.
    pub root: Map<String, Value>,
    /// The material of each primitive of each mesh.
    pub material_of: Vec<Vec<Option<usize>>>,
    /// What the morph targets of each mesh are called: names, or their numbers from 0.
    pub morphs: Vec<Vec<String>>,
}

/// Opens a GLB, a VRM, or glTF text with its data inside.
pub(super) fn open(bytes: &[u8]) -> Result<Container, String> {
    let is_needed = |name: &str| name == "POSITION" || name.starts_with("JOINTS_") || name.starts_with("WEIGHTS_");
    opened(bytes, None, is_needed).map(|(container, _)| container)
}

/// Opens the same with how its meshes look; data and pictures may lie in files in this folder.
pub(in crate::source) fn open_with_looks(bytes: &[u8], folder: Option<&Path>) -> Result<(Container, Looks), String> {
    let kept = ["JOINTS_", "WEIGHTS_", "TEXCOORD_", "COLOR_"];
    opened(bytes, folder, |name| name == "POSITION" || kept.iter().any(|kind| name.starts_with(kind)))
}

fn opened(bytes: &[u8], folder: Option<&Path>, is_needed: impl Fn(&str) -> bool) -> Result<(Container, Looks), String> {
    let unreadable = |error: &dyn std::fmt::Display| format!("this is no readable GLB: {error}");
    let glb;
    let (json, blob) = match bytes.starts_with(b"glTF") {
        true => {
            glb = gltf::Glb::from_slice(bytes).map_err(|error| unreadable(&error))?;
            (&*glb.json, glb.bin.as_ref().map(|bin| bin.to_vec()))
        }
        false => (bytes, None),
    };
    if json.len() > LONGEST_JSON {
        return Err(format!("its JSON part is longer than {} MB", LONGEST_JSON >> 20));
    }
    let mut root: Map<String, Value> = serde_json::from_slice(json).map_err(|error| match blob {
        None => format!("this is neither GLB nor glTF text: {error}"),
        Some(_) => unreadable(&error),
    })?;
    if root.get("extensionsRequired").and_then(Value::as_array).is_some_and(|all| all.iter().any(|name| name == DRACO))
    {
        return Err(
            "its meshes are compressed with Draco, which is not read here: export without compression, or with \
                    meshopt (`gltfpack -c`)"
                .to_owned(),
        );
    }
    let compressed = Compressed::taken(&mut root)?;
    let (humanoid, is_vrm0) = humanoid(&root);
    let mut looks = Looks { root: Map::new(), material_of: materials(&mut root), morphs: morphs(&mut root) };
    for part in UNNEEDED {
        if let Some(removed) = root.remove(part) {
            looks.root.insert(part.to_owned(), removed);
        }
    }
    strip_meshes(&mut root, is_needed)?;
    let zeros = with_views(&mut root);
    let json = serde_json::to_vec(&root).map_err(|error| unreadable(&error))?;
    let document = gltf::Gltf::from_slice(&json).map_err(|error| unreadable(&error))?.document;
    let buffers = buffers(&document, &compressed, folder, blob)?;
    Ok((Container { document, buffers, zeros, humanoid, is_vrm0 }, looks))
}

/// The bytes of all buffers, decompressed.
fn buffers(
    document: &gltf::Document,
    compressed: &Compressed,
    folder: Option<&Path>,
    mut blob: Option<Vec<u8>>,
) -> Result<Vec<gltf::buffer::Data>, String> {
    let buffer = |buffer: gltf::Buffer<'_>| {
        if compressed.stand_ins.contains(&buffer.index()) {
            return Ok(gltf::buffer::Data(Vec::new()));
        }
        let bytes = match buffer.source() {
            gltf::buffer::Source::Bin => blob.take().ok_or("a buffer is to lie in the file, which has none")?,
            gltf::buffer::Source::Uri(uri) => {
                named(uri, folder).map_err(|error| format!("a buffer cannot be read: {error}"))?
            }
        };
        match bytes.len() < buffer.length() {
            true => Err(format!("a buffer has {} bytes instead of {}", bytes.len(), buffer.length())),
            false => Ok(gltf::buffer::Data(bytes)),
        }
    };
    let mut buffers: Vec<_> = document.buffers().take(compressed.own_buffers).map(buffer).collect::<Result<_, _>>()?;
    buffers.extend(compressed.decoded(&buffers)?);
    Ok(buffers)
}

/// What a URI names: data inside the file, or a file in its folder.
pub(in crate::source) fn named(uri: &str, folder: Option<&Path>) -> Result<Vec<u8>, String> {
    if let Some(data) = uri.strip_prefix("data:") {
        let (_, base64) = data.split_once(";base64,").unwrap_or(("", data));
        return STANDARD.decode(base64).map_err(|error| format!("its data is no base64 ({error})"));
    }
    let name = plain(uri);
    let Some(folder) = folder else { return Err(format!("it names {name}; all data must lie inside the file")) };
    // What a stranger's file names lies beside it or below.
    let is_below = |part: Component<'_>| matches!(part, Component::Normal(_) | Component::CurDir);
    if name.contains(':') || !Path::new(&name).components().all(is_below) {
        return Err(format!("it names {name}, which is not in the file's folder"));
    }
    let path = folder.join(&name);
    match path.metadata() {
        Ok(metadata) if metadata.is_file() => std::fs::read(&path).map_err(|error| format!("{name}: {error}")),
        Ok(_) => Err(format!("it names {name}, which is no file")),
        Err(error) => Err(format!("it names {name}, which cannot be read ({error}); copy it beside this file")),
    }
}

/// The name that a URI writes with escapes.
pub(in crate::source) fn plain(uri: &str) -> String {
    let bytes = uri.as_bytes();
    let (mut name, mut at) = (Vec::with_capacity(bytes.len()), 0);
    while at < bytes.len() {
        let digits = bytes.get(at + 1..at + 3).and_then(|digits| std::str::from_utf8(digits).ok());
        match digits.filter(|_| bytes[at] == b'%').and_then(|digits| u8::from_str_radix(digits, 16).ok()) {
            Some(byte) => (name.push(byte), at += 3).1,
            None => (name.push(bytes[at]), at += 1).1,
        }
    }
    String::from_utf8_lossy(&name).into_owned()
}

/// The material that each primitive of each mesh names.
fn materials(root: &mut Map<String, Value>) -> Vec<Vec<Option<usize>>> {
    let material = |primitive: &mut Map<String, Value>| Some(primitive.get("material")?.as_u64()? as usize);
    objects(root, "meshes").map(|mesh| objects(mesh, "primitives").map(material).collect()).collect()
}

/// What the morph targets of each mesh are called. Programs write the names in `extras.targetNames`; who does not has numbers.
fn morphs(root: &mut Map<String, Value>) -> Vec<Vec<String>> {
    let of_mesh = |mesh: &mut Map<String, Value>| {
        let lists = objects(mesh, "primitives").map(|primitive| primitive.get("targets").and_then(Value::as_array));
        let count = lists.map(|targets| targets.map_or(0, Vec::len)).max().unwrap_or(0);
        let names = mesh.get("extras").and_then(|extras| extras.get("targetNames")?.as_array());
        let name = |i: usize| names?.get(i)?.as_str().map(str::to_owned);
        (0..count).map(|i| name(i).unwrap_or_else(|| i.to_string())).collect()
    };
    objects(root, "meshes").map(of_mesh).collect()
}

/// The elements of an array of the root, those that are objects.
fn objects<'a>(root: &'a mut Map<String, Value>, name: &str) -> impl Iterator<Item = &'a mut Map<String, Value>> {
    root.get_mut(name).and_then(Value::as_array_mut).into_iter().flatten().filter_map(Value::as_object_mut)
}

/// Which nodes a VRM file says are which bones, and whether it is VRM 0.x.
fn humanoid(root: &Map<String, Value>) -> (Vec<(Bone, usize)>, bool) {
    let extension = |name: &str| root.get("extensions")?.get(name)?.get("humanoid")?.get("humanBones");
    let node = |bone: &Value| bone.get("node")?.as_u64().map(|node| node as usize);
    if let Some(bones) = extension("VRMC_vrm").and_then(Value::as_object) {
        let of = |(name, bone): (&String, &Value)| Some((Bone::from_name(name)?, node(bone)?));
        return (bones.iter().filter_map(of).collect(), false);
    }
    if let Some(bones) = extension("VRM").and_then(Value::as_array) {
        let of = |bone: &Value| Some((vrm0_bone(bone.get("bone")?.as_str()?)?, node(bone)?));
        return (bones.iter().filter_map(of).collect(), true);
    }
    (Vec::new(), false)
}

/// Leaves of the meshes only needed attributes, and the shapes that may be on. What they name must exist: the library takes that for granted.
fn strip_meshes(root: &mut Map<String, Value>, is_needed: impl Fn(&str) -> bool) -> Result<(), String> {
    let count = root.get("accessors").and_then(Value::as_array).map_or(0, Vec::len) as u64;
    let exists = |named: &Value| match named.as_u64() {
        Some(index) if index < count => Ok(()),
        _ => Err(format!("a mesh names accessor {named}, but the file has {count}")),
    };
    for node in objects(root, "nodes") {
        node.remove("camera");
    }
    for mesh in objects(root, "meshes") {
        for primitive in objects(mesh, "primitives") {
            primitive.remove("material");
            primitive.get("indices").map_or(Ok(()), exists)?;
            if let Some(attributes) = primitive.get_mut("attributes").and_then(Value::as_object_mut) {
                attributes.retain(|name, _| is_needed(name));
                attributes.values().try_for_each(exists)?;
            }
            for target in objects(primitive, "targets") {
                target.retain(|name, _| name == "POSITION");
                target.values().try_for_each(exists)?;
            }
        }
    }
    Ok(())
}

/// Gives what the library demands and a body does not need: a view to each accessor that has none, and bounds. Returns the accessors
/// that had no bytes at all.
fn with_views(root: &mut Map<String, Value>) -> BTreeSet<usize> {
    let mut zeros = BTreeSet::new();
    for (index, accessor) in objects(root, "accessors").enumerate() {
        if !accessor.contains_key("bufferView") && !accessor.contains_key("sparse") {
            accessor.insert("bufferView".to_owned(), json!(0));
            zeros.insert(index);
        }
        if accessor.get("type").is_some_and(|kind| kind == "VEC3") {
            accessor.insert("min".to_owned(), json!([0.0, 0.0, 0.0]));
            accessor.insert("max".to_owned(), json!([0.0, 0.0, 0.0]));
        }
    }
    zeros
}
