//! Plays a GLB file as its format says, plainly and apart from what writes it: morph targets, skin, animation. Knows glTF, not kimono. For files
//! of one skin, without compression.

use glam::{DMat4, DQuat, DVec3};
use serde_json::Value;

/// An open file.
#[derive(Clone, Debug)]
pub struct Player {
    /// Its document.
    pub json: Value,
    data: Vec<u8>,
}

impl Player {
    /// Of a GLB file that is sound.
    #[must_use]
    pub fn open(glb: &[u8]) -> Player {
        assert_eq!(&glb[..4], b"glTF");
        let length = |at: usize| u32::from_le_bytes(glb[at..at + 4].try_into().expect("4 bytes")) as usize;
        assert_eq!((length(4), length(8)), (2, glb.len()));
        let text = length(12);
        let json = serde_json::from_slice(&glb[20..20 + text]).expect("JSON");
        Player { json, data: glb[28 + text..].to_vec() }
    }

    /// Rows of an accessor.
    #[must_use]
    pub fn rows(&self, accessor: &Value) -> Vec<Vec<f64>> {
        let accessor = &self.json["accessors"][number(accessor)];
        let width = match accessor["type"].as_str() {
            Some("SCALAR") => 1,
            Some("VEC2") => 2,
            Some("VEC3") => 3,
            Some("VEC4") => 4,
            Some("MAT4") => 16,
            other => panic!("{other:?}"),
        };
        let (component, count) = (number(&accessor["componentType"]), number(&accessor["count"]));
        let is_fraction = accessor["normalized"] == true;
        let read = |view: &Value, row: usize, component: usize, width: usize| -> Vec<f64> {
            let view = &self.json["bufferViews"][number(view)];
            let size = [1, 1, 2, 2, 4, 4, 4][component - 5120];
            let stride = view["byteStride"].as_u64().map_or(size * width, |stride| stride as usize);
            let first = number(&view["byteOffset"]) + row * stride;
            let value = |i: usize| -> f64 {
                let at = &self.data[first + i * size..][..size];
                match component {
                    5121 => at[0].into(),
                    5122 => i16::from_le_bytes([at[0], at[1]]).into(),
                    5123 => u16::from_le_bytes([at[0], at[1]]).into(),
                    5125 => u32::from_le_bytes(at.try_into().expect("4 bytes")).into(),
                    5126 => f32::from_le_bytes(at.try_into().expect("4 bytes")).into(),
                    other => panic!("{other}"),
                }
            };
            let whole = match (is_fraction, component) {
                (false, _) => 1.0,
                (true, 5121) => 255.0,
                (true, 5122) => 32767.0,
                (true, _) => 65535.0,
            };
            (0..width).map(|i| (value(i) / whole).max(if is_fraction { -1.0 } else { f64::MIN })).collect()
        };
        let mut rows = match accessor.get("bufferView") {
            Some(view) => (0..count).map(|row| read(view, row, component, width)).collect(),
            None => vec![vec![0.0; width]; count],
        };
        if let Some(sparse) = accessor.get("sparse") {
            let (indices, values) = (&sparse["indices"], &sparse["values"]);
            for entry in 0..number(&sparse["count"]) {
                let row = read(&indices["bufferView"], entry, number(&indices["componentType"]), 1)[0] as usize;
                rows[row] = read(&values["bufferView"], entry, component, width);
            }
        }
        rows
    }

    fn vectors(&self, accessor: &Value) -> Vec<DVec3> {
        self.rows(accessor).iter().map(|row| DVec3::new(row[0], row[1], row[2])).collect()
    }

    /// Where a mesh's vertices are, metres, in frame `frame` of the first animation, or, without, as the file stands. `weights` count instead of
    /// the file's own.
    #[must_use]
    pub fn positions_m(&self, mesh: usize, frame: Option<usize>, weights: Option<&[f64]>) -> Vec<DVec3> {
        let nodes = self.json["nodes"].as_array().expect("nodes");
        let own = nodes.iter().position(|node| node["mesh"] == mesh).expect("a node shows the mesh");
        let keys = |node: usize, path: &str| -> Option<Vec<f64>> {
            let animation = &self.json["animations"][0];
            let channels = animation["channels"].as_array().expect("channels");
            let target = |channel: &&Value| channel["target"]["node"] == node && channel["target"]["path"] == path;
            let sampler = &animation["samplers"][number(&channels.iter().find(target)?["sampler"])];
            let frames = self.rows(&sampler["input"]).len();
            let rows = self.rows(&sampler["output"]);
            let width = rows.len() / frames;
            Some(rows[frame? * width..(frame? + 1) * width].concat())
        };
        let numbers = |value: &Value| -> Vec<f64> {
            value.as_array().into_iter().flatten().map(|number| number.as_f64().expect("a number")).collect()
        };
        let primitive = &self.json["meshes"][mesh]["primitives"][0];
        let mut blended = self.vectors(&primitive["attributes"]["POSITION"]);
        let weights = weights.map(<[f64]>::to_vec).or_else(|| frame.and_then(|_| keys(own, "weights")));
        let weights = weights.unwrap_or_else(|| numbers(&self.json["meshes"][mesh]["weights"]));
        for (target, weight) in primitive["targets"].as_array().into_iter().flatten().zip(weights) {
            let deltas = self.vectors(&target["POSITION"]);
            blended.iter_mut().zip(deltas).for_each(|(place, delta)| *place += weight * delta);
        }
        let local = |node: usize| {
            let part = |path: &str| frame.and_then(|_| keys(node, path)).unwrap_or_else(|| numbers(&nodes[node][path]));
            let turn = part("rotation");
            let turn = if turn.is_empty() { DQuat::IDENTITY } else { DQuat::from_slice(&turn) };
            let place = part("translation");
            let place = if place.is_empty() { DVec3::ZERO } else { DVec3::from_slice(&place) };
            DMat4::from_rotation_translation(turn, place)
        };
        let mut world = vec![DMat4::NAN; nodes.len()];
        let mut open: Vec<(usize, DMat4)> = numbers(&self.json["scenes"][0]["nodes"])
            .into_iter()
            .map(|node| (node as usize, DMat4::IDENTITY))
            .collect();
        while let Some((node, parent)) = open.pop() {
            world[node] = parent * local(node);
            open.extend(numbers(&nodes[node]["children"]).into_iter().map(|child| (child as usize, world[node])));
        }
        let skin = &self.json["skins"][number(&nodes[own]["skin"])];
        let matrices = self.rows(&skin["inverseBindMatrices"]);
        let joints: Vec<DMat4> = numbers(&skin["joints"])
            .into_iter()
            .zip(&matrices)
            .map(|(joint, inverse)| world[joint as usize] * DMat4::from_cols_slice(inverse))
            .collect();
        let influences = self.rows(&primitive["attributes"]["JOINTS_0"]);
        let shares = self.rows(&primitive["attributes"]["WEIGHTS_0"]);
        let posed = |((place, joint), share): ((&DVec3, &Vec<f64>), &Vec<f64>)| -> DVec3 {
            let one = |(&joint, &share): (&f64, &f64)| joints[joint as usize].transform_point3(*place) * share;
            joint.iter().zip(share).map(one).sum()
        };
        blended.iter().zip(&influences).zip(&shares).map(posed).collect()
    }
}

fn number(value: &Value) -> usize {
    value.as_u64().unwrap_or_else(|| panic!("{value} is no whole number")) as usize
}
