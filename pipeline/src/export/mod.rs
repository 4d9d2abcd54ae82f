//! A kimono as a GLB file that every glTF tool reads: mesh, skin, named morph targets, texture, and a motion if one is wanted. What glTF cannot
//! say is turned into what it can: masks go into the morph targets, rates become weights, and what hangs becomes joints. Knows the arrays of a
//! pack, not its bytes.

mod buffers;
mod joints;
mod morphs;

use buffers::{Array, Buffers, MESHOPT, Use};
use glam::{Mat4, Vec2, Vec3};
use joints::Keys;
use kitsuke::accessories::{Accessories, Obi};
use kitsuke::arrays::SkinWeights;
use kitsuke::skeleton::Pose;
use kitsuke::{Garment, vertex_normals};
use morphs::{Animated, of_poses, of_samples};
use serde_json::{Value, json};

const QUANTISED: &str = "KHR_mesh_quantization";

/// How the file is made.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Settings {
    /// Numbers of 16 bits (`KHR_mesh_quantization`) on the finest grid that holds all shapes.
    pub is_quantised: bool,
    /// Compressed arrays (`EXT_meshopt_compression`); quantised, too.
    pub is_compressed: bool,
    /// Most morph targets of a motion: where there are more, those few that show most of the movement. Programs without textures for morph targets
    /// show eight.
    pub most_morphs: Option<usize>,
}

/// A motion of the wearer.
#[derive(Clone, Debug, PartialEq)]
pub struct Clip {
    /// Its name in the file.
    pub name: String,
    /// When each pose is, seconds, ascending from 0.
    pub times_s: Vec<f32>,
    /// The poses.
    pub poses: Vec<Pose>,
}

/// A written file and what is to be known of it.
#[derive(Clone, Debug, PartialEq)]
pub struct Exported {
    /// The file.
    pub glb: Vec<u8>,
    /// The names of its morph targets.
    pub morphs: Vec<String>,
    /// How far few of many morph targets lie from all that the kernel blends, mean and largest over frames and vertices, metres.
    pub condensed_m: Option<(f64, f64)>,
    /// Edge of the grid of quantised numbers, metres; 0 without.
    pub step_m: f32,
}

/// Why a kimono cannot be written.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum ExportError {
    /// Programs hold morph targets in textures of so many layers.
    #[error("the motion needs {0} morph targets, and programs show {MOST_MORPHS} at most: name fewer (--morphs)")]
    Morphs(usize),
    /// A motion without poses, or whose times do not fit them.
    #[error("the motion has no frames, or its times do not ascend from 0")]
    Motion,
}

/// Most morph targets that three.js, Filament and Babylon.js hold.
pub const MOST_MORPHS: usize = 256;

/// Writes a kimono with what comes with it as GLB: Y up, metres, the front along +Z, in the T-pose. Without a clip there is a morph target for
/// each sample, with it one for whatever the kernel blends in its poses, and an animation of joints and weights.
///
/// # Errors
/// When a motion has no frames or wants too many morph targets.
pub fn glb(
    garment: &Garment,
    accessories: &Accessories,
    clip: Option<&Clip>,
    settings: Settings,
) -> Result<Exported, ExportError> {
    let data = garment.data();
    let (shown, condensed_m) = match clip {
        Some(clip) => {
            let ascend = clip.times_s.first() == Some(&0.0) && clip.times_s.windows(2).all(|pair| pair[0] < pair[1]);
            if clip.poses.is_empty() || clip.times_s.len() != clip.poses.len() || !ascend {
                return Err(ExportError::Motion);
            }
            let all = of_poses(garment, &clip.poses);
            let few = settings.most_morphs.filter(|most| *most < all.morphs.len()).map(|most| all.condensed(most));
            let condensed_m = few.as_ref().map(|few| few.apart_m(&all));
            (few.unwrap_or(all).within_one(), condensed_m)
        }
        None => (of_samples(garment), None),
    };
    if shown.morphs.len() > MOST_MORPHS {
        return Err(ExportError::Morphs(shown.morphs.len()));
    }
    let base_m: Vec<Vec3> =
        data.mesh.positions_m.iter().zip(&shown.offset_m).map(|(base_m, by_m)| *base_m + *by_m).collect();
    let obi = accessories.obi.as_ref();
    let places_m = base_m.iter().chain(obi.into_iter().flat_map(|obi| &obi.positions_m));
    let is_quantised = settings.is_quantised || settings.is_compressed;
    let grid = is_quantised.then(|| Grid::around(places_m, shown.morphs.iter().flat_map(|morph| &morph.deltas_m)));
    let step_m = grid.map_or(0.0, |grid| grid.step_m);

    let mut file = File { buffers: Buffers::new(settings.is_compressed), grid };
    let skin = file.skin(garment);
    let kimono = file.kimono(garment, &base_m, &shown);
    let mut meshes = vec![kimono];
    let mut materials = vec![file.material(&data.name, accessories)];
    let mut document =
        json!({ "asset": { "version": "2.0", "generator": concat!("kitsuke ", env!("CARGO_PKG_VERSION")) } });
    if let Some(texture) = accessories.texture.as_ref().filter(|texture| !texture.png.is_empty()) {
        let view = file.buffers.view(&texture.png);
        document["images"] = json!([{ "name": texture.name, "mimeType": "image/png", "bufferView": view }]);
        document["textures"] = json!([{ "source": 0, "sampler": 0 }]);
        document["samplers"] = json!([{ "magFilter": 9729, "minFilter": 9987 }]);
    }
    if let Some(obi) = obi {
        meshes.push(file.obi(obi, materials.len()));
        materials.push(plain("obi", OBI));
    }
    let mut nodes = joints::nodes(&data.skeleton);
    let roots: Vec<usize> = joints::roots(&data.skeleton).collect();
    let kimono_node = nodes.len();
    for (number, mesh) in meshes.iter().enumerate() {
        nodes.push(json!({ "name": mesh["name"], "mesh": number, "skin": 0 }));
    }
    let scene: Vec<usize> = roots.into_iter().chain(kimono_node..nodes.len()).collect();
    document["scene"] = json!(0);
    document["scenes"] = json!([{ "name": data.name, "nodes": scene }]);
    document["nodes"] = json!(nodes);
    document["meshes"] = json!(meshes);
    document["materials"] = json!(materials);
    document["skins"] = json!([skin]);
    if let Some(clip) = clip {
        document["animations"] = json!([file.animation(garment, clip, &shown.weights, kimono_node)]);
    }
    let mut extensions = Vec::new();
    extensions.extend(is_quantised.then_some(QUANTISED));
    extensions.extend(settings.is_compressed.then_some(MESHOPT));
    if !extensions.is_empty() {
        document["extensionsUsed"] = json!(extensions);
        document["extensionsRequired"] = json!(extensions);
    }
    let morphs = shown.morphs.into_iter().map(|morph| morph.name).collect();
    Ok(Exported { glb: file.buffers.glb(document), morphs, condensed_m, step_m })
}

/// Colour of an obi, which has no texture.
const OBI: [f64; 4] = [0.32, 0.08, 0.07, 1.0];
/// And of a kimono without one.
const CLOTH: [f64; 4] = [0.6, 0.6, 0.65, 1.0];

fn plain(name: &str, colour: [f64; 4]) -> Value {
    // Cloth does not shine, and is seen from inside, too.
    let pbr = json!({ "baseColorFactor": colour, "metallicFactor": 0.0, "roughnessFactor": 0.9 });
    json!({ "name": name, "doubleSided": true, "pbrMetallicRoughness": pbr })
}

/// A cubic grid on which positions and deltas have whole numbers of 16 bits.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Grid {
    centre_m: Vec3,
    step_m: f32,
}

impl Grid {
    /// The finest one that holds all of them.
    fn around<'a>(places_m: impl Iterator<Item = &'a Vec3>, deltas_m: impl Iterator<Item = &'a Vec3>) -> Grid {
        let (least_m, most_m) =
            places_m.fold((Vec3::MAX, Vec3::MIN), |(least_m, most_m), p| (least_m.min(*p), most_m.max(*p)));
        let half_m = (most_m - least_m).max_element() / 2.0;
        let farthest_m = deltas_m.fold(half_m, |farthest_m, delta_m| farthest_m.max(delta_m.abs().max_element()));
        let step_m = if farthest_m > 0.0 { farthest_m / f32::from(i16::MAX - 1) } else { 1.0 };
        Grid { centre_m: (least_m + most_m) / 2.0, step_m }
    }

    fn steps(self, move_m: Vec3) -> [i16; 3] {
        (move_m / self.step_m).round().to_array().map(|steps| steps as i16)
    }
}

/// A file as it grows.
struct File {
    buffers: Buffers,
    grid: Option<Grid>,
}

impl File {
    fn positions(&mut self, places_m: &[Vec3]) -> usize {
        match self.grid {
            Some(grid) => {
                let steps: Vec<[i16; 3]> =
                    places_m.iter().map(|place_m| grid.steps(*place_m - grid.centre_m)).collect();
                self.buffers.array(&Array::of(Use::Vertices, &steps).bounded(&steps))
            }
            None => {
                let rows: Vec<[f32; 3]> = places_m.iter().map(Vec3::to_array).collect();
                self.buffers.array(&Array::of(Use::Vertices, &rows).bounded(&rows))
            }
        }
    }

    fn deltas(&mut self, deltas_m: &[Vec3]) -> usize {
        match self.grid {
            Some(grid) => {
                let steps: Vec<[i16; 3]> = deltas_m.iter().map(|delta_m| grid.steps(*delta_m)).collect();
                self.buffers.array(&Array::of(Use::Vertices, &steps).bounded(&steps))
            }
            // Plus 0, so that none is -0.
            None => {
                let rows: Vec<[f32; 3]> = deltas_m.iter().map(|delta_m| (*delta_m + Vec3::ZERO).to_array()).collect();
                self.buffers.sparse(&rows)
            }
        }
    }

    fn normals(&mut self, normals: &[Vec3]) -> usize {
        match self.grid {
            Some(_) => {
                let of = |normal: &Vec3| (*normal * 32767.0).round().to_array().map(|number| number as i16);
                let rows: Vec<[i16; 3]> = normals.iter().map(of).collect();
                self.buffers.array(&Array::of(Use::Vertices, &rows).normalised())
            }
            None => {
                let rows: Vec<[f32; 3]> = normals.iter().map(Vec3::to_array).collect();
                self.buffers.array(&Array::of(Use::Vertices, &rows))
            }
        }
    }

    /// Texture coordinates, of which glTF has v downwards.
    fn uv(&mut self, uv: &[Vec2]) -> usize {
        let rows: Vec<[f32; 2]> = uv.iter().map(|uv| [uv.x, 1.0 - uv.y]).collect();
        let is_within = rows.iter().flatten().all(|number| (0.0..=1.0).contains(number));
        match is_within && self.grid.is_some() {
            true => {
                let rows: Vec<[u16; 2]> =
                    rows.iter().map(|row| row.map(|number| (number * 65535.0).round() as u16)).collect();
                self.buffers.array(&Array::of(Use::Vertices, &rows).normalised())
            }
            false => self.buffers.array(&Array::of(Use::Vertices, &rows)),
        }
    }

    fn corners(&mut self, triangles: &[[u32; 3]], vertices: usize) -> usize {
        let corners: Vec<[u32; 1]> = triangles.iter().flatten().map(|&corner| [corner]).collect();
        // 65535 itself means that a strip begins anew.
        if vertices < usize::from(u16::MAX) {
            let short: Vec<[u16; 1]> = corners.iter().map(|[corner]| [*corner as u16]).collect();
            return self.buffers.array(&Array::of(Use::Corners, &short));
        }
        self.buffers.array(&Array::of(Use::Corners, &corners))
    }

    /// `JOINTS_0` and `WEIGHTS_0`.
    fn influences(&mut self, skin: &[SkinWeights]) -> [usize; 2] {
        let merged: Vec<SkinWeights> = skin.iter().map(merged).collect();
        let joints: Vec<[u8; 4]> = merged.iter().map(|skin| skin.joints).collect();
        let weights: Vec<[u16; 4]> = merged.iter().map(|skin| skin.weights).collect();
        let joints = self.buffers.array(&Array::of(Use::Vertices, &joints));
        [joints, self.buffers.array(&Array::of(Use::Vertices, &weights).normalised())]
    }

    fn kimono(&mut self, garment: &Garment, base_m: &[Vec3], shown: &Animated) -> Value {
        let data = garment.data();
        let with_twins = |values: &[Vec3]| -> Vec<Vec3> {
            let twins = data.mesh.twin_of.iter().map(|&original| values[original as usize]);
            values.iter().copied().chain(twins).collect()
        };
        let triangles = data.mesh.triangles.iter().map(|corners| corners.map(|v| data.mesh.unique(v)));
        // Of the base as it is worn, wherever the morph targets begin.
        let normals = unit_normals(&data.mesh.positions_m, triangles);
        let skin: Vec<SkinWeights> = with_skin(&data.skin, &data.mesh.twin_of);
        let [joints, weights] = self.influences(&skin);
        let mut attributes = json!({
            "POSITION": self.positions(&with_twins(base_m)), "NORMAL": self.normals(&with_twins(&normals)),
            "JOINTS_0": joints, "WEIGHTS_0": weights,
        });
        if !data.mesh.uv.is_empty() {
            attributes["TEXCOORD_0"] = json!(self.uv(&data.mesh.uv));
        }
        let indices = self.corners(&data.mesh.triangles, garment.vertex_count());
        let mut primitive = json!({ "attributes": attributes, "indices": indices, "material": 0 });
        let mut mesh = json!({ "name": data.name });
        if !shown.morphs.is_empty() {
            let target = |morph: &morphs::Morph| json!({ "POSITION": self.deltas(&with_twins(&morph.deltas_m)) });
            primitive["targets"] = json!(shown.morphs.iter().map(target).collect::<Vec<Value>>());
            let names: Vec<&str> = shown.morphs.iter().map(|morph| morph.name.as_str()).collect();
            mesh["extras"] = json!({ "targetNames": names });
            mesh["weights"] = json!(shown.rest);
        }
        mesh["primitives"] = json!([primitive]);
        mesh
    }

    fn obi(&mut self, obi: &Obi, material: usize) -> Value {
        let normals = unit_normals(&obi.positions_m, obi.triangles.iter().copied());
        let [joints, weights] = self.influences(&obi.skin);
        let attributes = json!({
            "POSITION": self.positions(&obi.positions_m), "NORMAL": self.normals(&normals),
            "JOINTS_0": joints, "WEIGHTS_0": weights,
        });
        let indices = self.corners(&obi.triangles, obi.positions_m.len());
        json!({ "name": "obi", "primitives": [{ "attributes": attributes, "indices": indices, "material": material }] })
    }

    fn material(&mut self, name: &str, accessories: &Accessories) -> Value {
        let mut material = plain(name, CLOTH);
        if accessories.texture.as_ref().is_some_and(|texture| !texture.png.is_empty()) {
            material["pbrMetallicRoughness"]["baseColorFactor"] = json!([1.0, 1.0, 1.0, 1.0]);
            material["pbrMetallicRoughness"]["baseColorTexture"] = json!({ "index": 0 });
        }
        material
    }

    /// Of quantised numbers the grid stands in the inverse bind matrices, since nothing else moves a skinned mesh.
    fn skin(&mut self, garment: &Garment) -> Value {
        let skeleton = &garment.data().skeleton;
        let mesh_from_numbers = self.grid.map_or(Mat4::IDENTITY, |grid| {
            Mat4::from_scale_rotation_translation(Vec3::splat(grid.step_m), glam::Quat::IDENTITY, grid.centre_m)
        });
        let rest_m = joints::rest_m(skeleton);
        let bind = |rest_m: &Vec3| (Mat4::from_translation(-*rest_m) * mesh_from_numbers).to_cols_array();
        let matrices: Vec<[f32; 16]> = rest_m.iter().map(bind).collect();
        let matrices = self.buffers.array(&Array::of(Use::Other, &matrices));
        let joints: Vec<usize> = (0..rest_m.len()).collect();
        json!({ "joints": joints, "inverseBindMatrices": matrices })
    }

    fn animation(&mut self, garment: &Garment, clip: &Clip, weights: &[Vec<f32>], kimono: usize) -> Value {
        let times: Vec<[f32; 1]> = clip.times_s.iter().map(|time_s| [*time_s]).collect();
        let input = self.buffers.array(&Array::of(Use::Other, &times).bounded(&times));
        let (mut samplers, mut channels) = (Vec::new(), Vec::new());
        let mut add = |node: usize, path: &str, output: usize| {
            channels.push(json!({ "sampler": samplers.len(), "target": { "node": node, "path": path } }));
            samplers.push(json!({ "input": input, "output": output }));
        };
        for (joint, Keys { rotations, translations_m }) in
            joints::keys(&garment.data().skeleton, &clip.poses).iter().enumerate()
        {
            add(joint, "rotation", self.buffers.array(&Array::of(Use::Other, rotations)));
            if let Some(translations_m) = translations_m {
                add(joint, "translation", self.buffers.array(&Array::of(Use::Other, translations_m)));
            }
        }
        if weights.first().is_some_and(|row| !row.is_empty()) {
            let rows: Vec<[f32; 1]> = weights.iter().flatten().map(|weight| [*weight]).collect();
            add(kimono, "weights", self.buffers.array(&Array::of(Use::Other, &rows)));
        }
        json!({ "name": clip.name, "samplers": samplers, "channels": channels })
    }
}

fn unit_normals(positions_m: &[Vec3], triangles: impl IntoIterator<Item = [u32; 3]>) -> Vec<Vec3> {
    let mut normals = vec![Vec3::ZERO; positions_m.len()];
    vertex_normals(positions_m, triangles, &mut normals);
    // Where no triangle has a direction, as in the runtime's frames: files must not hold normals without length.
    normals.into_iter().map(|normal| normal.try_normalize().unwrap_or(Vec3::Y)).collect()
}

fn with_skin(skin: &[SkinWeights], twin_of: &[u32]) -> Vec<SkinWeights> {
    skin.iter().copied().chain(twin_of.iter().map(|&original| skin[original as usize])).collect()
}

/// Every joint once, the heaviest first, and joint 0 where there is no weight.
fn merged(skin: &SkinWeights) -> SkinWeights {
    let mut rows: Vec<(u8, u16)> = Vec::new();
    for (&joint, &weight) in skin.joints.iter().zip(&skin.weights).filter(|(_, weight)| **weight > 0) {
        match rows.iter_mut().find(|(known, _)| *known == joint) {
            Some((_, sum)) => *sum += weight,
            None => rows.push((joint, weight)),
        }
    }
    rows.sort_by_key(|&(joint, weight)| (std::cmp::Reverse(weight), joint));
    let mut merged = SkinWeights::default();
    for (place, (joint, weight)) in rows.into_iter().enumerate() {
        (merged.joints[place], merged.weights[place]) = (joint, weight);
    }
    merged
}
