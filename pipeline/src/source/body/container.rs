//! glTF bytes as a document of what a body is made of: nodes, meshes and skins, and which node is which bone where the file says so.
//! What a body does not need (pictures, materials, animations) is taken out first, since the glTF library refuses whole files for faults
//! and novelties there. Knows no skeleton.

use kitsuke::skeleton::Bone;
use kitsuke::skeleton::names::vrm0_bone;
use serde_json::{Map, Value, json};
use std::collections::BTreeSet;

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
/// Extensions without which vertices cannot be read, and what people call them.
const PACKED: [(&str, &str); 3] = [
    ("KHR_draco_mesh_compression", "Draco"),
    ("EXT_meshopt_compression", "meshopt"),
    ("KHR_meshopt_compression", "meshopt"),
];

/// A file's nodes, meshes and skins, and the bytes that they name.
pub(super) struct Container {
    pub document: gltf::Document,
    pub buffers: Vec<gltf::buffer::Data>,
    /// Accessors without bytes, whose numbers the format says are all 0.
    pub zeros: BTreeSet<usize>,
    /// What a VRM file says its nodes are; empty in other files. The nodes need not exist.
    pub humanoid: Vec<(Bone, usize)>,
    /// Whether it is of VRM 0.x, which faces -Z.
    pub is_vrm0: bool,
}

/// Opens a GLB, a VRM, or glTF text with its data inside.
pub(super) fn open(bytes: &[u8]) -> Result<Container, String> {
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
    if let Some(name) = packed(&root) {
        return Err(format!(
            "its meshes are compressed with {name}, which is not read here: export without compression"
        ));
    }
    let (humanoid, is_vrm0) = humanoid(&root);
    for part in UNNEEDED {
        root.remove(part);
    }
    strip_meshes(&mut root)?;
    let zeros = with_views(&mut root);
    let json = serde_json::to_vec(&root).map_err(|error| unreadable(&error))?;
    let document = gltf::Gltf::from_slice(&json).map_err(|error| unreadable(&error))?.document;
    let buffers = gltf::import_buffers(&document, None, blob)
        .map_err(|error| format!("a buffer cannot be read ({error}); all data must lie inside the file"))?;
    Ok(Container { document, buffers, zeros, humanoid, is_vrm0 })
}

/// The elements of an array of the root, those that are objects.
fn objects<'a>(root: &'a mut Map<String, Value>, name: &str) -> impl Iterator<Item = &'a mut Map<String, Value>> {
    root.get_mut(name).and_then(Value::as_array_mut).into_iter().flatten().filter_map(Value::as_object_mut)
}

/// By what the meshes are compressed.
fn packed(root: &Map<String, Value>) -> Option<&'static str> {
    let required = root.get("extensionsRequired")?.as_array()?;
    PACKED.iter().find(|(extension, _)| required.iter().any(|name| name == extension)).map(|(_, name)| *name)
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

/// Leaves of the meshes only places, weights and the shapes that may be on. What they name must exist: the library takes that for granted.
fn strip_meshes(root: &mut Map<String, Value>) -> Result<(), String> {
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
                attributes.retain(|name, _| {
                    name == "POSITION" || name.starts_with("JOINTS_") || name.starts_with("WEIGHTS_")
                });
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
