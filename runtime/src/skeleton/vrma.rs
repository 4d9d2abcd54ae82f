//! VRM animation (.vrma) and animated VRM models to poses. Pure: bytes in, poses out.
//!
//! - Binary glTF with one of the extensions `VRMC_vrm_animation`, `VRMC_vrm` (VRM 1.0) or `VRM` (0.x), which say which node
//!   is which bone. The first animation is played; where there is none, the rest pose is the one frame.
//! - Rotations are normalised by the rest pose (VRM, `how_to_transform_human_pose.md`): in world axes, each bone's turn from
//!   its rest, so that rest rotations of any kind and nodes between bones do not matter.
//! - The hips' way from their rest is scaled by the height of the hips.

use super::names::vrm0_bone;
use super::recording::{Format, LONGEST_S, MOST_FRAMES, Place, Recording, RecordingError};
use super::tracked::{RestPose, Tracked, Turned};
use super::{Bone, Pose, Skeleton};
use glam::{DMat4, DQuat, DVec3};
use serde::Deserialize;
use std::collections::BTreeMap;

/// Most nodes of a file.
pub const MOST_NODES: usize = 1 << 14;
/// Longest JSON chunk, bytes.
pub const LONGEST_JSON: usize = 64 << 20;
/// Most node transforms over all frames.
const MOST_TRANSFORMS: usize = 1 << 26;
/// Frames are this far apart at least and at most, seconds; between that as the keys are.
const FRAME_TIME_S: [f64; 2] = [1.0 / 120.0, 1.0 / 30.0];

#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
struct Document {
    #[serde(default)]
    nodes: Vec<Node>,
    #[serde(default)]
    animations: Vec<Animation>,
    #[serde(default)]
    accessors: Vec<Accessor>,
    #[serde(default)]
    buffer_views: Vec<BufferView>,
    #[serde(default)]
    extensions: Extensions,
}

#[derive(Deserialize)]
struct Node {
    #[serde(default)]
    children: Vec<usize>,
    #[serde(default)]
    translation: [f64; 3],
    #[serde(default = "no_rotation")]
    rotation: [f64; 4],
    #[serde(default = "no_scale")]
    scale: [f64; 3],
    matrix: Option<[f64; 16]>,
}

fn no_rotation() -> [f64; 4] {
    [0.0, 0.0, 0.0, 1.0]
}

fn no_scale() -> [f64; 3] {
    [1.0; 3]
}

#[derive(Deserialize)]
struct Animation {
    channels: Vec<Channel>,
    samplers: Vec<Sampler>,
}

#[derive(Deserialize)]
struct Channel {
    sampler: usize,
    target: Target,
}

#[derive(Deserialize)]
struct Target {
    node: Option<usize>,
    path: String,
}

#[derive(Deserialize)]
struct Sampler {
    input: usize,
    output: usize,
    #[serde(default)]
    interpolation: Interpolation,
}

#[derive(Clone, Copy, Default, Deserialize, PartialEq)]
#[serde(rename_all = "UPPERCASE")]
enum Interpolation {
    #[default]
    Linear,
    Step,
    CubicSpline,
}

#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
struct Accessor {
    buffer_view: Option<usize>,
    #[serde(default)]
    byte_offset: usize,
    component_type: u32,
    #[serde(default)]
    normalized: bool,
    count: usize,
    #[serde(rename = "type")]
    kind: String,
    sparse: Option<serde::de::IgnoredAny>,
}

#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
struct BufferView {
    buffer: usize,
    #[serde(default)]
    byte_offset: usize,
    byte_length: usize,
    byte_stride: Option<usize>,
}

#[derive(Default, Deserialize)]
struct Extensions {
    #[serde(rename = "VRMC_vrm_animation")]
    animation: Option<Humanoid<BTreeMap<String, BoneNode>>>,
    #[serde(rename = "VRMC_vrm")]
    vrm1: Option<Humanoid<BTreeMap<String, BoneNode>>>,
    #[serde(rename = "VRM")]
    vrm0: Option<Humanoid<Vec<NamedBoneNode>>>,
}

#[derive(Deserialize)]
struct Humanoid<T> {
    humanoid: HumanBones<T>,
}

#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
struct HumanBones<T> {
    human_bones: T,
}

#[derive(Deserialize)]
struct BoneNode {
    node: usize,
}

#[derive(Deserialize)]
struct NamedBoneNode {
    bone: String,
    node: usize,
}

fn wrong(problem: impl Into<String>) -> RecordingError {
    RecordingError::new(Place::Whole, problem)
}

/// Reads the first animation for this wearer.
///
/// # Errors
/// What is wrong, and what to do.
pub fn read(bytes: &[u8], wearer: &Skeleton) -> Result<Recording, RecordingError> {
    let (document, binary) = open(bytes)?;
    let rig = Rig::new(&document)?;
    let mut channels = Vec::new();
    if let Some(animation) = document.animations.first() {
        for channel in &animation.channels {
            channels.extend(Curve::new(&document, binary, animation, channel, &rig)?);
        }
    }
    let (start_s, frame_time_s, frame_count) = timing(&channels)?;
    if frame_count.saturating_mul(rig.chain.len()) > MOST_TRANSFORMS {
        return Err(wrong("the animation is too long for so many nodes; cut it into pieces"));
    }
    let rest = rig.stance(|node| rig.locals[node]);
    let hips =
        rig.node_of[Bone::Hips as usize].ok_or_else(|| wrong("no node is the bone hips; export it as a humanoid"))?;
    let height_m = rest[hips].translation.y;
    let worn_m = wearer.rest_m(Bone::Hips).map_or(1.0, |at| f64::from(at.y));
    let scale = if height_m > 1e-3 && worn_m > 1e-3 { worn_m / height_m } else { 1.0 };
    let (mut times_s, mut frames) = (Vec::new(), Vec::new());
    let mut locals = rig.locals.clone();
    for frame in 0..frame_count {
        let time_s = frame as f64 * frame_time_s;
        for curve in &channels {
            curve.apply(start_s + time_s, &mut locals[curve.node]);
        }
        let stance = rig.stance(|node| locals[node]);
        let turned: Turned = rig.node_of.map(|node| {
            let node = node?;
            Some(rig.to_wearer * stance[node].rotation * rest[node].rotation.inverse() * rig.to_wearer.inverse())
        });
        let moved_m = rig.to_wearer * (stance[hips].translation - rest[hips].translation) * scale;
        let mut tracked = Tracked::certain(Pose::from_turned(wearer, &turned, moved_m).sanitised());
        for bone in Bone::ALL {
            tracked.confidence[bone as usize] = f32::from(u8::from(rig.node_of[bone as usize].is_some()));
        }
        times_s.push(time_s);
        frames.push(tracked);
    }
    let mut notes = vec![format!("{} of {} bones are there", rig.node_of.iter().flatten().count(), Bone::COUNT)];
    if document.animations.is_empty() {
        notes.push("there is no animation, so the rest pose is the one frame".into());
    }
    Ok(Recording { format: Format::Gltf, times_s, frames, notes })
}

/// The rest pose of a VRM model or animation. Of VRM 0.x that is no rotation at all, as its specification demands.
///
/// # Errors
/// What is wrong, and what to do.
pub fn read_rest(bytes: &[u8]) -> Result<RestPose, RecordingError> {
    let (document, _) = open(bytes)?;
    let rig = Rig::new(&document)?;
    let rest = rig.stance(|node| rig.locals[node]);
    let is_vrm0 = rig.to_wearer != DQuat::IDENTITY;
    let of = |rotation: &dyn Fn(usize) -> DQuat| {
        rig.node_of.map(|node| node.filter(|_| !is_vrm0).map_or(DQuat::IDENTITY, rotation))
    };
    Ok(RestPose {
        local: of(&|node| rig.locals[node].rotation),
        world: of(&|node| rest[node].rotation),
        hips_m: rig.node_of[Bone::Hips as usize].map(|hips| rig.to_wearer * rest[hips].translation),
    })
}

/// The JSON and the binary chunk of binary glTF.
fn open(bytes: &[u8]) -> Result<(Document, &[u8]), RecordingError> {
    let cut = || wrong("the file is cut off or no binary glTF 2.0; export it again as .vrma or .vrm");
    let word = |at: usize| bytes.get(at..at + 4).map(|b| u32::from_le_bytes([b[0], b[1], b[2], b[3]]) as usize);
    if !bytes.starts_with(b"glTF") || word(4) != Some(2) {
        return Err(cut());
    }
    let (mut at, mut json, mut binary) = (12_usize, None, &bytes[..0]);
    while let (Some(length), Some(kind)) = (word(at), bytes.get(at + 4..at + 8)) {
        let chunk = (at + 8).checked_add(length).and_then(|end| bytes.get(at + 8..end)).ok_or_else(cut)?;
        match kind {
            b"JSON" if json.is_none() => json = Some(chunk),
            b"BIN\0" if binary.is_empty() => binary = chunk,
            _ => {}
        }
        at += 8 + length;
    }
    let json = json.ok_or_else(cut)?;
    if json.len() > LONGEST_JSON {
        return Err(wrong("the JSON part is longer than 64 MB; remove what does not move the body"));
    }
    let document = serde_json::from_slice(json).map_err(|error| wrong(format!("its JSON is no glTF: {error}")))?;
    Ok((document, binary))
}

#[derive(Clone, Copy)]
struct Transform {
    translation: DVec3,
    rotation: DQuat,
    scale: DVec3,
}

/// The nodes that carry bones.
struct Rig {
    node_of: [Option<usize>; Bone::COUNT],
    parents: Vec<Option<usize>>,
    /// Nodes that are bones or above bones, each after its parent.
    chain: Vec<usize>,
    locals: Vec<Transform>,
    /// VRM 0.x faces -Z.
    to_wearer: DQuat,
}

impl Rig {
    fn new(document: &Document) -> Result<Rig, RecordingError> {
        let count = document.nodes.len();
        if count > MOST_NODES {
            return Err(wrong(format!("more than {MOST_NODES} nodes; remove what does not move the body")));
        }
        let mut parents = vec![None; count];
        for (parent, node) in document.nodes.iter().enumerate() {
            for &child in &node.children {
                match parents.get_mut(child) {
                    Some(slot @ None) => *slot = Some(parent),
                    Some(Some(_)) => return Err(wrong(format!("node {child} has two parents; glTF forbids it"))),
                    None => return Err(wrong(format!("node {parent} has a child {child} that does not exist"))),
                }
            }
        }
        let (named, is_vrm0) = named_bones(&document.extensions)?;
        let mut node_of = [None; Bone::COUNT];
        for (name, node) in named {
            if node >= count {
                return Err(wrong(format!("bone {name} is node {node}, which does not exist")));
            }
            if let Some(bone) = if is_vrm0 { vrm0_bone(name) } else { Bone::from_name(name) } {
                node_of[bone as usize] = Some(node);
            }
        }
        let locals: Option<Vec<Transform>> = document.nodes.iter().map(local).collect();
        let locals =
            locals.ok_or_else(|| wrong("a node has no usable rotation, translation or scale; export it again"))?;
        let chain = chain(&parents, node_of.iter().flatten().copied())?;
        let to_wearer = if is_vrm0 { DQuat::from_xyzw(0.0, 1.0, 0.0, 0.0) } else { DQuat::IDENTITY };
        Ok(Rig { node_of, parents, chain, locals, to_wearer })
    }

    /// World transforms of the chain's nodes; others keep their local ones.
    fn stance(&self, local: impl Fn(usize) -> Transform) -> Vec<Transform> {
        let mut world = self.locals.clone();
        for &node in &self.chain {
            let own = local(node);
            world[node] = match self.parents[node].map(|parent| world[parent]) {
                Some(above) => Transform {
                    translation: above.translation + above.rotation * (above.scale * own.translation),
                    rotation: (above.rotation * own.rotation).normalize(),
                    scale: above.scale * own.scale,
                },
                None => own,
            };
        }
        world
    }
}

/// Bone names and their nodes.
type NamedNodes<'a> = Vec<(&'a str, usize)>;

/// The extension's bones, and whether they are those of VRM 0.x.
fn named_bones(extensions: &Extensions) -> Result<(NamedNodes<'_>, bool), RecordingError> {
    if let Some(humanoid) = extensions.animation.as_ref().or(extensions.vrm1.as_ref()) {
        let bones = humanoid.humanoid.human_bones.iter();
        return Ok((bones.map(|(name, bone)| (name.as_str(), bone.node)).collect(), false));
    }
    if let Some(humanoid) = &extensions.vrm0 {
        let bones = humanoid.humanoid.human_bones.iter();
        return Ok((bones.map(|bone| (bone.bone.as_str(), bone.node)).collect(), true));
    }
    Err(wrong("this glTF says of no node which bone it is; export it as .vrma or .vrm"))
}

fn local(node: &Node) -> Option<Transform> {
    let transform = match &node.matrix {
        Some(matrix) => {
            let matrix = DMat4::from_cols_array(matrix);
            let usable = matrix.is_finite() && matrix.determinant().abs() > 1e-12;
            let (scale, rotation, translation) = usable.then(|| matrix.to_scale_rotation_translation())?;
            Transform { translation, rotation, scale }
        }
        None => Transform {
            translation: DVec3::from_array(node.translation),
            rotation: DQuat::from_array(node.rotation),
            scale: DVec3::from_array(node.scale),
        },
    };
    let Transform { translation, rotation, scale } = transform;
    let usable = translation.abs().max_element() <= 1e6
        && (1e-6..1e6).contains(&rotation.length())
        && scale.abs().max_element() <= 1e6;
    usable.then(|| Transform { rotation: rotation.normalize(), ..transform })
}

/// The nodes and all above them, each after its parent.
fn chain(parents: &[Option<usize>], nodes: impl Iterator<Item = usize>) -> Result<Vec<usize>, RecordingError> {
    let mut listed = vec![false; parents.len()];
    let mut chain = Vec::new();
    for node in nodes {
        let mut upwards = Vec::new();
        let mut next = Some(node);
        while let Some(node) = next.filter(|&node| !listed[node]) {
            if upwards.len() > parents.len() {
                return Err(wrong(format!("node {node} is its own ancestor; glTF forbids it")));
            }
            upwards.push(node);
            next = parents[node];
        }
        for &node in upwards.iter().rev() {
            listed[node] = true;
            chain.push(node);
        }
    }
    Ok(chain)
}

/// One animated property of a node.
struct Curve {
    node: usize,
    is_rotation: bool,
    interpolation: Interpolation,
    times_s: Vec<f64>,
    /// Three components (the fourth 0) for a translation. With tangents before and after each key for cubic splines.
    values: Vec<[f64; 4]>,
}

impl Curve {
    /// The curve of a channel that moves the chain; `None` for others.
    fn new(
        document: &Document,
        binary: &[u8],
        animation: &Animation,
        channel: &Channel,
        rig: &Rig,
    ) -> Result<Option<Curve>, RecordingError> {
        let Some(node) = channel.target.node.filter(|node| rig.chain.contains(node)) else { return Ok(None) };
        let (is_rotation, kind) = match channel.target.path.as_str() {
            "rotation" => (true, "VEC4"),
            "translation" => (false, "VEC3"),
            _ => return Ok(None),
        };
        let sampler = animation.samplers.get(channel.sampler);
        let sampler = sampler.ok_or_else(|| wrong(format!("there is no sampler {}", channel.sampler)))?;
        let times_s: Vec<f64> = floats(document, binary, sampler.input, "SCALAR")?.iter().map(|t| t[0]).collect();
        let values = floats(document, binary, sampler.output, kind)?;
        let per_key = if sampler.interpolation == Interpolation::CubicSpline { 3 } else { 1 };
        let in_order = times_s.windows(2).all(|pair| pair[0] < pair[1]);
        if times_s.is_empty() || values.len() != times_s.len() * per_key || !in_order {
            return Err(wrong(format!("the keys of node {node} are not in order or not as many as their values")));
        }
        if !times_s.iter().all(|time_s| time_s.abs() <= LONGEST_S) {
            return Err(wrong("the animation is longer than a day; cut it into pieces"));
        }
        Ok(Some(Curve { node, is_rotation, interpolation: sampler.interpolation, times_s, values }))
    }

    fn apply(&self, time_s: f64, local: &mut Transform) {
        let next = self.times_s.partition_point(|&key_s| key_s <= time_s);
        let (from, to) = (next.saturating_sub(1), next.min(self.times_s.len() - 1));
        let span_s = self.times_s[to] - self.times_s[from];
        let t = if from == to || next == 0 { 0.0 } else { (time_s - self.times_s[from]) / span_s };
        let step = if self.interpolation == Interpolation::CubicSpline { 3 } else { 1 };
        let value = |key: usize, part: usize| self.values[key * step + part];
        let mixed = match self.interpolation {
            Interpolation::Step => value(from, 0),
            Interpolation::Linear if self.is_rotation => {
                let [a, b] = [value(from, 0), value(to, 0)].map(DQuat::from_array);
                let usable = a.length() > 1e-6 && b.length() > 1e-6;
                if usable { a.normalize().slerp(b.normalize(), t).to_array() } else { [0.0; 4] }
            }
            Interpolation::Linear => mix([(1.0 - t, value(from, 0)), (t, value(to, 0))]),
            Interpolation::CubicSpline => {
                let (t2, t3) = (t * t, t * t * t);
                mix([
                    (2.0 * t3 - 3.0 * t2 + 1.0, value(from, 1)),
                    ((t3 - 2.0 * t2 + t) * span_s, value(from, 2)),
                    (3.0 * t2 - 2.0 * t3, value(to, 1)),
                    ((t3 - t2) * span_s, value(to, 0)),
                ])
            }
        };
        if self.is_rotation {
            let rotation = DQuat::from_array(mixed);
            if (1e-6..1e6).contains(&rotation.length()) {
                local.rotation = rotation.normalize();
            }
        } else if mixed.iter().all(|number| number.abs() <= 1e6) {
            local.translation = DVec3::new(mixed[0], mixed[1], mixed[2]);
        }
    }
}

fn mix<const N: usize>(terms: [(f64, [f64; 4]); N]) -> [f64; 4] {
    terms.into_iter().fold([0.0; 4], |sum, (weight, value)| std::array::from_fn(|i| sum[i] + weight * value[i]))
}

/// The elements of an accessor of this type; normalised integers as fractions.
fn floats(document: &Document, binary: &[u8], index: usize, kind: &str) -> Result<Vec<[f64; 4]>, RecordingError> {
    let outside = || wrong(format!("accessor {index} lies outside the file; it was cut off, export it again"));
    let accessor = document.accessors.get(index).ok_or_else(outside)?;
    let unusable = || wrong(format!("accessor {index} is not stored as keys of an animation are; export it again"));
    if accessor.kind != kind || accessor.sparse.is_some() {
        return Err(unusable());
    }
    let view = accessor.buffer_view.and_then(|view| document.buffer_views.get(view)).ok_or_else(outside)?;
    if view.buffer != 0 {
        return Err(wrong("keys lie in another file; export everything into one"));
    }
    let end = view.byte_offset.checked_add(view.byte_length).ok_or_else(outside)?;
    let bytes = binary.get(view.byte_offset..end).ok_or_else(outside)?;
    let components = match kind {
        "SCALAR" => 1,
        "VEC3" => 3,
        _ => 4,
    };
    let size = match (accessor.component_type, accessor.normalized) {
        (5126, _) => 4,
        (5120 | 5121, true) => 1,
        (5122 | 5123, true) => 2,
        _ => return Err(unusable()),
    };
    let stride = view.byte_stride.unwrap_or(components * size);
    if stride < components * size {
        return Err(unusable());
    }
    let last = accessor.count.checked_sub(1).and_then(|last| last.checked_mul(stride)).ok_or_else(unusable)?;
    let length = last.checked_add(accessor.byte_offset).and_then(|at| at.checked_add(components * size));
    if length.is_none_or(|length| length > bytes.len()) {
        return Err(outside());
    }
    let component = |at: usize| -> f64 {
        match accessor.component_type {
            5126 => f64::from(f32::from_le_bytes([bytes[at], bytes[at + 1], bytes[at + 2], bytes[at + 3]])),
            5120 => (f64::from(bytes[at] as i8) / 127.0).max(-1.0),
            5121 => f64::from(bytes[at]) / 255.0,
            5122 => (f64::from(i16::from_le_bytes([bytes[at], bytes[at + 1]])) / 32767.0).max(-1.0),
            _ => f64::from(u16::from_le_bytes([bytes[at], bytes[at + 1]])) / 65535.0,
        }
    };
    let element = |i: usize| {
        let at = accessor.byte_offset + i * stride;
        std::array::from_fn(|c| if c < components { component(at + c * size) } else { 0.0 })
    };
    let elements: Vec<[f64; 4]> = (0..accessor.count).map(element).collect();
    if !elements.iter().flatten().all(|number| number.is_finite()) {
        return Err(wrong(format!("accessor {index} holds a number that is not finite; export it again")));
    }
    Ok(elements)
}

/// Where the animation starts, how far frames are apart, how many there are.
fn timing(curves: &[Curve]) -> Result<(f64, f64, usize), RecordingError> {
    let [shortest_s, longest_s] = FRAME_TIME_S;
    let times_s = || curves.iter().flat_map(|curve| curve.times_s.iter().copied());
    let start_s = times_s().fold(f64::INFINITY, f64::min);
    let end_s = times_s().fold(f64::NEG_INFINITY, f64::max);
    if curves.is_empty() {
        return Ok((0.0, longest_s, 1));
    }
    let gaps_s = curves.iter().flat_map(|curve| curve.times_s.windows(2).map(|pair| pair[1] - pair[0]));
    let gap_s = gaps_s.fold(longest_s, f64::min).max(shortest_s);
    // A whole number of frames: keys are 32-bit numbers, so no gap between them is quite the frame time.
    let steps = libm::round((end_s - start_s) / gap_s);
    if steps >= MOST_FRAMES as f64 {
        return Err(wrong(format!("more than {MOST_FRAMES} frames; cut the animation into pieces")));
    }
    let frame_time_s = if steps > 0.0 { (end_s - start_s) / steps } else { longest_s };
    Ok((start_s, frame_time_s, steps as usize + 1))
}
