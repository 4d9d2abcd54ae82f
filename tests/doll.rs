//! The doll of `tests/garments/bodies` taken apart, and written again as other programs write bodies: other axes, scales, skins, names. What
//! must be read from each is the doll itself.

use glam::{DMat4, DQuat, DVec3};
use serde_json::{Value, json};
use std::path::Path;

/// A body as plain lists, metres.
#[derive(Clone, Debug)]
pub struct Doll {
    /// VRM name, parent, place; parents first.
    pub joints: Vec<(String, Option<usize>, DVec3)>,
    /// Places of the skin.
    pub positions_m: Vec<DVec3>,
    /// Per vertex four joints and their weights.
    pub rows: Vec<[(usize, f32); 4]>,
    /// Vertex indices.
    pub triangles: Vec<[u32; 3]>,
}

/// How a body is written.
pub struct Rig<'a> {
    /// What stands above the joints: translation, rotation, uniform scale.
    pub above: (DVec3, DQuat, f64),
    /// How each joint's axes are turned in the world.
    pub turned: &'a dyn Fn(usize) -> DQuat,
    /// In which space the mesh is.
    pub mesh_from_world: DMat4,
    /// By how much each joint is turned further in the pose that the file shows.
    pub shown: &'a dyn Fn(usize) -> DQuat,
    /// The joint's name in the file.
    pub name: &'a dyn Fn(&str) -> String,
    /// To which skin each triangle belongs; every skin lists the joints in another order.
    pub skin_of: &'a dyn Fn(&[u32; 3]) -> usize,
}

impl Default for Rig<'_> {
    fn default() -> Self {
        Rig {
            above: (DVec3::ZERO, DQuat::IDENTITY, 1.0),
            turned: &|_| DQuat::IDENTITY,
            mesh_from_world: DMat4::IDENTITY,
            shown: &|_| DQuat::IDENTITY,
            name: &str::to_owned,
            skin_of: &|_| 0,
        }
    }
}

/// A glTF file in pieces.
#[derive(Clone, Debug)]
pub struct File {
    /// The JSON part.
    pub json: Value,
    /// The bytes.
    pub bin: Vec<u8>,
}

impl File {
    /// Appends bytes as a view of their own and gives its index.
    pub fn view(&mut self, bytes: &[u8]) -> usize {
        self.bin.resize(self.bin.len().next_multiple_of(4), 0);
        let views = self.json["bufferViews"].as_array_mut().unwrap();
        views.push(json!({"buffer": 0, "byteOffset": self.bin.len(), "byteLength": bytes.len()}));
        self.bin.extend_from_slice(bytes);
        views.len() - 1
    }

    /// Appends an accessor and gives its index.
    pub fn accessor(&mut self, accessor: Value) -> usize {
        let accessors = self.json["accessors"].as_array_mut().unwrap();
        accessors.push(accessor);
        accessors.len() - 1
    }

    /// Appends floats as an accessor of this type.
    pub fn floats(&mut self, kind: &str, floats: &[f32]) -> usize {
        let width = match kind {
            "VEC3" => 3,
            "VEC4" => 4,
            _ => 16,
        };
        let bytes: Vec<u8> = floats.iter().flat_map(|float| float.to_le_bytes()).collect();
        let view = self.view(&bytes);
        self.accessor(json!({"bufferView": view, "componentType": 5126, "count": floats.len() / width, "type": kind}))
    }

    /// Appends whole numbers as an accessor of this type.
    pub fn words(&mut self, kind: &str, words: &[u16]) -> usize {
        let bytes: Vec<u8> = words.iter().flat_map(|word| word.to_le_bytes()).collect();
        let (view, width) = (self.view(&bytes), if kind == "SCALAR" { 1 } else { 4 });
        self.accessor(json!({"bufferView": view, "componentType": 5123, "count": words.len() / width, "type": kind}))
    }

    /// The node of this name.
    ///
    /// # Panics
    /// When there is none.
    #[must_use]
    pub fn node(&self, name: &str) -> usize {
        self.json["nodes"].as_array().unwrap().iter().position(|node| node["name"] == name).unwrap()
    }

    /// The whole file.
    #[must_use]
    pub fn glb(&self) -> Vec<u8> {
        let mut json = self.json.clone();
        json["buffers"] = json!([{"byteLength": self.bin.len()}]);
        let mut text = json.to_string().into_bytes();
        text.resize(text.len().next_multiple_of(4), b' ');
        let mut bin = self.bin.clone();
        bin.resize(bin.len().next_multiple_of(4), 0);
        let length = 12 + 8 + text.len() + 8 + bin.len();
        let mut bytes = Vec::new();
        bytes.extend_from_slice(b"glTF");
        [2, length as u32, text.len() as u32].iter().for_each(|word| bytes.extend(word.to_le_bytes()));
        bytes.extend_from_slice(b"JSON");
        bytes.append(&mut text);
        bytes.extend((bin.len() as u32).to_le_bytes());
        bytes.extend_from_slice(b"BIN\0");
        bytes.append(&mut bin);
        bytes
    }
}

impl Doll {
    /// Reads the doll's file, whose joints are not turned and whose nodes are not scaled.
    ///
    /// # Panics
    /// When the file is another one.
    #[must_use]
    pub fn read() -> Doll {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("garments/bodies/doll.glb");
        let bytes = std::fs::read(path).unwrap();
        let length = u32::from_le_bytes(bytes[12..16].try_into().unwrap()) as usize;
        let json: Value = serde_json::from_slice(&bytes[20..20 + length]).unwrap();
        let bin = &bytes[28 + length..];
        let raw = |accessor: &Value, width: usize| -> Vec<f64> {
            let accessor = &json["accessors"][accessor.as_u64().unwrap() as usize];
            let view = &json["bufferViews"][accessor["bufferView"].as_u64().unwrap() as usize];
            let start = view["byteOffset"].as_u64().unwrap_or(0) + accessor["byteOffset"].as_u64().unwrap_or(0);
            let (start, count) = (start as usize, width * accessor["count"].as_u64().unwrap() as usize);
            let component = |i: usize| match accessor["componentType"].as_u64().unwrap() {
                5126 => f64::from(f32::from_le_bytes(bin[start + 4 * i..][..4].try_into().unwrap())),
                5123 => f64::from(u16::from_le_bytes(bin[start + 2 * i..][..2].try_into().unwrap())),
                5121 if accessor["normalized"] == true => f64::from(bin[start + i]) / 255.0,
                5121 => f64::from(bin[start + i]),
                other => panic!("component type {other}"),
            };
            (0..count).map(component).collect()
        };
        let nodes = json["nodes"].as_array().unwrap();
        let skin: Vec<usize> = json["skins"][0]["joints"]
            .as_array()
            .unwrap()
            .iter()
            .map(|joint| joint.as_u64().unwrap() as usize)
            .collect();
        let children = |node: usize| nodes[node]["children"].as_array().cloned().unwrap_or_default();
        let parent =
            |node: usize| skin.iter().position(|&above| children(above).iter().any(|child| *child == json!(node)));
        let mut joints: Vec<(String, Option<usize>, DVec3)> = Vec::new();
        for &node in &skin {
            let above = parent(node);
            let way: Vec<f64> =
                nodes[node]["translation"].as_array().unwrap().iter().map(|v| v.as_f64().unwrap()).collect();
            let from_m = above.map_or(DVec3::ZERO, |above| joints[above].2);
            joints.push((nodes[node]["name"].as_str().unwrap().to_owned(), above, from_m + DVec3::from_slice(&way)));
        }
        let primitive = &json["meshes"][0]["primitives"][0];
        let attributes = &primitive["attributes"];
        let positions_m = raw(&attributes["POSITION"], 3).chunks(3).map(DVec3::from_slice).collect();
        let (numbers, weights) = (raw(&attributes["JOINTS_0"], 4), raw(&attributes["WEIGHTS_0"], 4));
        let rows = numbers.chunks(4).zip(weights.chunks(4));
        let rows = rows.map(|(j, w)| std::array::from_fn(|i| (j[i] as usize, w[i] as f32))).collect();
        let indices = raw(&primitive["indices"], 1);
        let triangles = indices.chunks(3).map(|t| [t[0] as u32, t[1] as u32, t[2] as u32]).collect();
        Doll { joints, positions_m, rows, triangles }
    }

    /// The body in another pose: each joint turned in the world, with all that hangs on it, and skin that follows.
    #[must_use]
    pub fn posed(&self, turned: &dyn Fn(&str) -> DQuat) -> Doll {
        let mut world: Vec<DMat4> = Vec::new();
        for (name, parent, place) in &self.joints {
            let above = parent.map_or(DMat4::IDENTITY, |above| world[above]);
            let about =
                DMat4::from_translation(*place) * DMat4::from_quat(turned(name)) * DMat4::from_translation(-*place);
            world.push(above * about);
        }
        let skin = |(place, row): (&DVec3, &[(usize, f32); 4])| {
            row.iter().map(|&(joint, weight)| f64::from(weight) * world[joint].transform_point3(*place)).sum()
        };
        let joints = self.joints.iter().zip(&world);
        Doll {
            joints: joints
                .map(|((name, above, place), to)| (name.clone(), *above, to.transform_point3(*place)))
                .collect(),
            positions_m: self.positions_m.iter().zip(&self.rows).map(skin).collect(),
            ..self.clone()
        }
    }

    /// Moved as a whole.
    #[must_use]
    pub fn moved(&self, to: DMat4) -> Doll {
        Doll {
            joints: self
                .joints
                .iter()
                .map(|(name, above, p)| (name.clone(), *above, to.transform_point3(*p)))
                .collect(),
            positions_m: self.positions_m.iter().map(|p| to.transform_point3(*p)).collect(),
            ..self.clone()
        }
    }

    /// Writes the body as glTF.
    #[must_use]
    pub fn written(&self, rig: &Rig<'_>) -> File {
        let (at, turn, scale) = rig.above;
        let above = DMat4::from_scale_rotation_translation(DVec3::splat(scale), turn, at);
        let mut file = File {
            json: json!({"asset": {"version": "2.0"}, "scene": 0, "accessors": [], "bufferViews": [], "skins": [], "meshes": []}),
            bin: Vec::new(),
        };
        let bound: Vec<DMat4> = (0..self.joints.len())
            .map(|j| DMat4::from_scale_rotation_translation(DVec3::splat(scale), (rig.turned)(j), self.joints[j].2))
            .collect();
        let numbers = |of: glam::DVec4| [of.x, of.y, of.z, of.w];
        let mut nodes: Vec<Value> = Vec::new();
        for (j, (name, parent, _)) in self.joints.iter().enumerate() {
            let local = parent.map_or(above, |parent| bound[parent]).inverse() * bound[j];
            let (scale, rotation, translation) = local.to_scale_rotation_translation();
            let rotation = (rotation * (rig.shown)(j)).normalize();
            let children: Vec<usize> =
                (0..self.joints.len()).filter(|&child| self.joints[child].1 == Some(j)).collect();
            let mut node = json!({
                "name": (rig.name)(name), "translation": translation.to_array(), "scale": scale.to_array(),
                "rotation": numbers(rotation.into()),
            });
            if !children.is_empty() {
                node["children"] = json!(children);
            }
            nodes.push(node);
        }
        let armature = nodes.len();
        nodes.push(json!({
            "name": "Armature", "children": [0], "translation": at.to_array(), "scale": DVec3::splat(scale).to_array(), "rotation": numbers(turn.into()),
        }));
        let mut roots = vec![armature];
        let skins = 1 + self.triangles.iter().map(rig.skin_of).max().unwrap_or(0);
        for skin in 0..skins {
            // Each skin begins with another joint.
            let order: Vec<usize> = (0..self.joints.len()).map(|at| (at + 7 * skin) % self.joints.len()).collect();
            let place_of = |joint: usize| order.iter().position(|&own| own == joint).unwrap() as u16;
            let world_from_mesh = rig.mesh_from_world.inverse();
            let matrices: Vec<f32> = order
                .iter()
                .flat_map(|&j| (bound[j].inverse() * world_from_mesh).to_cols_array())
                .map(|number| number as f32)
                .collect();
            let matrices = file.floats("MAT4", &matrices);
            let own: Vec<&[u32; 3]> =
                self.triangles.iter().filter(|triangle| (rig.skin_of)(triangle) == skin).collect();
            let mut used: Vec<u32> = own.iter().flat_map(|triangle| triangle.iter().copied()).collect();
            used.sort_unstable();
            used.dedup();
            let vertex = |v: u32| used.binary_search(&v).unwrap() as u16;
            let mesh =
                |v: &u32| rig.mesh_from_world.transform_point3(self.positions_m[*v as usize]).as_vec3().to_array();
            let positions: Vec<f32> = used.iter().flat_map(mesh).collect();
            let row = |v: &u32| self.rows[*v as usize];
            let joints: Vec<u16> = used.iter().flat_map(row).map(|(joint, _)| place_of(joint)).collect();
            let weights: Vec<f32> = used.iter().flat_map(row).map(|(_, weight)| weight).collect();
            let indices: Vec<u16> = own.iter().flat_map(|triangle| triangle.map(vertex)).collect();
            let position = file.floats("VEC3", &positions);
            let joints = file.words("VEC4", &joints);
            let weights = file.floats("VEC4", &weights);
            let indices = file.words("SCALAR", &indices);
            file.json["skins"].as_array_mut().unwrap().push(json!({"joints": order, "inverseBindMatrices": matrices}));
            file.json["meshes"].as_array_mut().unwrap().push(json!({"name": format!("skin{skin}"), "primitives": [{
                "attributes": {"POSITION": position, "JOINTS_0": joints, "WEIGHTS_0": weights}, "indices": indices,
            }]}));
            roots.push(nodes.len());
            nodes.push(json!({"name": format!("mesh{skin}"), "mesh": skin, "skin": skin}));
        }
        file.json["nodes"] = json!(nodes);
        file.json["scenes"] = json!([{"nodes": roots}]);
        file
    }
}
