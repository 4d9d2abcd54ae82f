//! The body: a skinned GLB or VRM in the T-pose. Read once into mesh, joints in the world's axes and weights, then judged. Knows no garment.
//!
//! `container.rs` opens the bytes, `numbers.rs` reads rows of numbers, `nodes.rs` says where nodes stand, `joints.rs` which of them are bones,
//! `pieces.rs` reads meshes, `rest.rs` brings them into the world by the bind matrices, `stance.rs` judges how the body stands.

mod container;
mod joints;
mod nodes;
mod numbers;
mod pieces;
mod rest;
mod stance;

use crate::diagnostic::{Diagnostic, Place};
use crate::ir::{Body, Part, Surface, WearerBody};
use container::Container;
use glam::{DMat4, DVec3, Vec3};
use joints::Joints;
use kitsuke::arrays::limits;
use kitsuke::skeleton::{Joint, Skeleton};
use nodes::Nodes;
use pieces::{Piece, pieces};
use rest::{Rest, Skin};
use stance::Fault;
use std::collections::BTreeSet;

/// Most joints of a skin.
const JOINTS: usize = 1024;
/// How far the lowest vertex may lie from the floor without a warning, metres.
const OFF_FLOOR_M: f32 = 0.1;

/// Reads a body.
pub fn read(file: &str, bytes: &[u8], report: &mut Vec<Diagnostic>) -> Option<Body> {
    let opened = container::open(bytes).map_err(Fault::from);
    let read = opened.and_then(|opened| body(&opened));
    match read {
        Ok((body, warnings)) => {
            report.extend(warnings.into_iter().map(|warning| warning.diagnostic(file)));
            Some(body)
        }
        Err(fault) => {
            report.push(Diagnostic::error("body", file, Place::File).problem(fault.problem).help(fault.help));
            None
        }
    }
}

/// Reads a wearer's body, which may come without a skin.
pub fn read_wearer(file: &str, bytes: &[u8], report: &mut Vec<Diagnostic>) -> Option<WearerBody> {
    match container::open(bytes).and_then(|opened| bare(&opened)) {
        Ok(None) => read(file, bytes, report).map(WearerBody::Skinned),
        Ok(Some(surface)) => Some(WearerBody::Bare(surface)),
        Err(problem) => {
            report.push(Diagnostic::error("body", file, Place::File).problem(problem).help(
                "Export the wearer as one GLB file in metres, in the T-pose, triangles with POSITION; with its skin if it has one.",
            ));
            None
        }
    }
}

impl From<String> for Fault {
    fn from(problem: String) -> Fault {
        let help = "Export the body as one GLB file in metres: mesh skinned to joints whose names say which bones they are (VRM 1.0, \
                    Mixamo, Rigify …), in the T-pose, triangles with POSITION, JOINTS_0 and WEIGHTS_0.";
        Fault { problem, help: help.to_owned() }
    }
}

/// What a reader of a sound body should know.
enum Warning {
    /// VRM 0.x.
    Turned,
    /// The file shows another pose than the bound one.
    OtherPose,
    /// Joints that are no bones.
    OtherJoints(String),
    /// Meshes without a skin, or skinned to something else.
    LeftOut(Vec<String>),
    /// Where the lowest vertex lies, metres.
    OffFloor(f32),
}

impl Warning {
    fn diagnostic(self, file: &str) -> Diagnostic {
        let warn = |code, problem: String, help: &str| {
            Diagnostic::warning(code, file, Place::File).problem(problem).help(help)
        };
        match self {
            Warning::Turned => warn(
                "body-turned",
                "the file is VRM 0.x, whose bodies face -Z; it was turned to face +Z".to_owned(),
                "Base and targets must face +Z, with the wearer's left at +X.",
            ),
            Warning::OtherPose => warn(
                "body-pose",
                "the file shows another pose than the T-pose in which the mesh was bound; the T-pose is used"
                    .to_owned(),
                "Reset the pose before the export if the shown one was meant.",
            ),
            Warning::OtherJoints(said) => warn(
                "body-joints",
                format!("joints that are no bones of a person move with the nearest that is: {said}"),
                "Nothing needs to be done for hair, skirts and twist joints; rename those that are bones.",
            ),
            Warning::LeftOut(names) => warn(
                "body-parts",
                format!("no bones move these meshes, which are left out: {}", names.join(", ")),
                "Join them with the skinned mesh if they are part of the body.",
            ),
            Warning::OffFloor(low_m) => warn(
                "body-place",
                format!("the lowest vertex lies at y = {low_m:.2} m, not near the floor at 0"),
                "Check that the kimono hangs on it there.",
            ),
        }
    }
}

/// `None` where the file has a skin.
fn bare(file: &Container) -> Result<Option<Surface>, String> {
    if file.document.skins().len() > 0 {
        return Ok(None);
    }
    let nodes = Nodes::new(&file.document, world_turn(file))?;
    let mut surface = Surface::default();
    for piece in pieces(file, |node| nodes.is_shown[node.index()])? {
        let rest = Rest::Bound(nodes.world[piece.node]);
        append(&mut surface, &piece, &rest)?;
    }
    if surface.triangles.is_empty() {
        return Err("the file has no mesh".to_owned());
    }
    Ok(Some(surface))
}

/// Bodies of VRM 0.x face -Z.
fn world_turn(file: &Container) -> DMat4 {
    if file.is_vrm0 { DMat4::from_diagonal(glam::DVec4::new(-1.0, 1.0, -1.0, 1.0)) } else { DMat4::IDENTITY }
}

fn body(file: &Container) -> Result<(Body, Vec<Warning>), Fault> {
    let skins = rest::skins(file, JOINTS)?;
    if skins.is_empty() {
        return Err("the file has no skin, so the body has no joints".to_owned().into());
    }
    let nodes = Nodes::new(&file.document, world_turn(file))?;
    let all: Vec<Piece> = pieces(file, |node| nodes.is_shown[node.index()])?;
    let mut seen = BTreeSet::new();
    let joint_nodes: Vec<usize> =
        skins.iter().flat_map(|skin| &skin.joints).copied().filter(|joint| seen.insert(*joint)).collect();
    let joints = Joints::new(&nodes, &file.humanoid, &joint_nodes)?;
    // A skin of something else, a prop, has none of the body's bones.
    let is_bone = |node: usize| joints.bones.iter().any(|(_, bone, _)| *bone == node);
    let moves_body = |skin: &Skin| skin.joints.iter().any(|&joint| nodes.upwards(joint).any(is_bone));
    let is_body: Vec<bool> = skins.iter().map(moves_body).collect();
    let (own, left_out): (Vec<Piece>, Vec<Piece>) =
        all.into_iter().partition(|piece| piece.skin.is_some_and(|skin| is_body[skin]));
    if own.iter().all(|piece| piece.triangles.is_empty()) {
        return Err("the skin moves no mesh".to_owned().into());
    }

    let shown: Vec<Rest> = skins.iter().map(|skin| skin.shown(&nodes)).collect();
    let is_at_rest = shown.iter().zip(&is_body).all(|(rest, is_body)| matches!(rest, Rest::Bound(_)) || !is_body);
    let mut warnings = Vec::new();
    let bound = (!is_at_rest).then(|| {
        let rests: Vec<Rest> = skins.iter().map(|skin| skin.bound(&nodes)).collect();
        assembled(&nodes, &skins, &joints, &own, &rests).ok().filter(|body| stance::fault(body).is_none())
    });
    let body = match bound.flatten() {
        Some(body) => {
            warnings.push(Warning::OtherPose);
            body
        }
        None => {
            let body = assembled(&nodes, &skins, &joints, &own, &shown)?;
            if let Some(fault) = stance::fault(&body) {
                let is_unbound = skins.iter().zip(&is_body).any(|(skin, is_body)| *is_body && !skin.is_bound);
                return Err(if is_unbound { unbound(fault) } else { fault });
            }
            body
        }
    };
    if file.is_vrm0 {
        warnings.push(Warning::Turned);
    }
    let mut moving = BTreeSet::new();
    for (piece, skin) in own.iter().filter_map(|piece| Some((piece, piece.skin?))) {
        let weighted = piece.influences.iter().filter(|(_, weight)| *weight > 0.0);
        moving.extend(weighted.map(|(joint, _)| skins[skin].joints[*joint as usize]));
    }
    warnings.extend(joints.said_of_others(&nodes, |node| moving.contains(&node)).map(Warning::OtherJoints));
    if !left_out.is_empty() {
        let names: BTreeSet<String> = left_out.into_iter().map(|piece| piece.name).collect();
        warnings.push(Warning::LeftOut(names.into_iter().take(8).collect()));
    }
    let low_m = body.surface.positions_m.iter().fold(f32::INFINITY, |low_m, place_m| low_m.min(place_m.y));
    if low_m.abs() > OFF_FLOOR_M {
        warnings.push(Warning::OffFloor(low_m));
    }
    Ok((body, warnings))
}

/// What a missing bind matrix does is seen in how the body stands.
fn unbound(fault: Fault) -> Fault {
    Fault {
        problem: format!(
            "a skin has no bind matrices (inverseBindMatrices), so by the format every vertex is moved by the places of its joints: {}",
            fault.problem
        ),
        help: "Export the skin with its bind matrices.".to_owned(),
    }
}

/// Mesh, joints and weights in the world.
fn assembled(nodes: &Nodes, skins: &[Skin], joints: &Joints, pieces: &[Piece], rests: &[Rest]) -> Result<Body, Fault> {
    let place_m = |node: usize| {
        let of_skins = skins.iter().zip(rests).find(|(skin, _)| skin.joints.contains(&node));
        let of_skins = of_skins.or_else(|| {
            skins.iter().zip(rests).find(|(skin, _)| nodes.upwards(node).any(|above| skin.joints.contains(&above)))
        });
        let place_m = of_skins.and_then(|(skin, rest)| skin.place_m(nodes, rest, node));
        place_m.unwrap_or_else(|| nodes.world[node].w_axis.truncate())
    };
    let joint = |&(bone, node, parent): &(_, usize, Option<u8>)| {
        let rest_m: DVec3 = place_m(node);
        Joint { bone, parent, rest_m: rest_m.as_vec3() }
    };
    let bones: Vec<Joint> = joints.bones.iter().map(joint).collect();
    if let Some(fault) = stance::wrong_size(bones.iter().map(|joint| joint.rest_m)) {
        return Err(fault);
    }
    let skeleton = Skeleton::new(bones);
    let skeleton = skeleton.map_err(|error| format!("the joints form no skeleton: {error}"))?;
    let slots: Vec<Vec<u8>> =
        skins.iter().map(|skin| skin.joints.iter().map(|&node| joints.slot(node).unwrap_or(0)).collect()).collect();
    let mut body = Body { surface: Surface::default(), skeleton, skin: Vec::new() };
    for piece in pieces {
        let skin = piece.skin.unwrap_or(0);
        append(&mut body.surface, piece, &rests[skin])?;
        body.skin.extend(piece.influences.chunks(piece.width).map(|influences| row(influences, &slots[skin])));
    }
    Ok(body)
}

/// A vertex's four greatest weights over the bones; joints that go with one bone count together.
fn row(influences: &[(u32, f32)], slots: &[u8]) -> [(u8, f32); 4] {
    let mut merged: Vec<(u8, f32)> = Vec::new();
    for &(joint, weight) in influences.iter().filter(|(_, weight)| *weight > 0.0) {
        let slot = slots[joint as usize];
        match merged.iter_mut().find(|(known, _)| *known == slot) {
            Some((_, sum)) => *sum += weight,
            None => merged.push((slot, weight)),
        }
    }
    if merged.len() > 4 {
        merged.sort_by(|a, b| b.1.total_cmp(&a.1));
        merged.truncate(4);
        let sum: f32 = merged.iter().map(|(_, weight)| weight).sum();
        merged.iter_mut().for_each(|(_, weight)| *weight /= sum);
    }
    std::array::from_fn(|at| merged.get(at).copied().unwrap_or((0, 0.0)))
}

/// Appends a piece's vertices and triangles.
fn append(surface: &mut Surface, piece: &Piece, rest: &Rest) -> Result<(), String> {
    let first = surface.positions_m.len() as u32;
    for (vertex, &place) in piece.positions.iter().enumerate() {
        let influences = &piece.influences[vertex * piece.width..][..piece.width];
        let place_m: Vec3 = rest.vertex_m(place, influences);
        if !(place_m.is_finite() && place_m.abs().max_element() <= limits::EXTENT_M) {
            return Err(format!("vertex {vertex} of mesh {} lies at {place_m}", piece.name));
        }
        surface.positions_m.push(place_m);
    }
    surface.triangles.extend(piece.triangles.iter().map(|triangle| triangle.map(|index| index + first)));
    surface.parts.push(Part { name: piece.name.clone(), triangle_count: piece.triangles.len() as u32 });
    Ok(())
}
