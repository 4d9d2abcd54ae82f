//! The body: a skinned GLB or VRM in the T-pose. Read once into mesh, joints in the world's axes and weights, then judged. Knows no garment.
//!
//! `container.rs` opens the bytes (`compressed.rs` and `meshopt.rs` decompress them), `numbers.rs` reads rows of numbers, `nodes.rs` says where
//! nodes stand, `joints.rs` which of them are bones, `pieces.rs` reads meshes, `rest.rs` brings them into the world by the bind matrices,
//! `stance.rs` judges how the body stands, `posed.rs` reads the pose that a file shows instead.

mod compressed;
pub(super) mod container;
mod joints;
mod meshopt;
pub(super) mod nodes;
pub(super) mod numbers;
pub(super) mod pieces;
mod posed;
pub(super) mod rest;
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
pub use posed::{PosedBody, read_pose};
use rest::{Rest, Skin};
use stance::Fault;
use std::collections::BTreeSet;

/// Most joints of a skin.
pub(super) const JOINTS: usize = 1024;
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

/// Whether a file has a skin, so that it may be a body.
#[must_use]
pub fn has_skin(bytes: &[u8]) -> bool {
    container::open(bytes).is_ok_and(|file| file.document.skins().len() > 0)
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
pub(super) fn world_turn(file: &Container) -> DMat4 {
    if file.is_vrm0 { DMat4::from_diagonal(glam::DVec4::new(-1.0, 1.0, -1.0, 1.0)) } else { DMat4::IDENTITY }
}

/// What a skinned file holds, before anybody asks how it stands.
struct Rig {
    /// How the file's world is turned.
    turn: DMat4,
    nodes: Nodes,
    skins: Vec<Skin>,
    /// Which skins move the body; one of something else, a prop, has none of its bones.
    is_body: Vec<bool>,
    joints: Joints,
    /// The body's meshes.
    own: Vec<Piece>,
    /// Other meshes.
    left_out: Vec<Piece>,
}

fn rig(file: &Container) -> Result<Rig, Fault> {
    let skins = rest::skins(file, JOINTS)?;
    if skins.is_empty() {
        return Err("the file has no skin, so the body has no joints".to_owned().into());
    }
    let turn = world_turn(file);
    let nodes = Nodes::new(&file.document, turn)?;
    let all: Vec<Piece> = pieces(file, |node| nodes.is_shown[node.index()])?;
    let mut seen = BTreeSet::new();
    let joint_nodes: Vec<usize> =
        skins.iter().flat_map(|skin| &skin.joints).copied().filter(|joint| seen.insert(*joint)).collect();
    let joints = Joints::new(&nodes, &file.humanoid, &joint_nodes)?;
    let is_bone = |node: usize| joints.bones.iter().any(|(_, bone, _)| *bone == node);
    let moves_body = |skin: &Skin| skin.joints.iter().any(|&joint| nodes.upwards(joint).any(is_bone));
    let is_body: Vec<bool> = skins.iter().map(moves_body).collect();
    let (own, left_out): (Vec<Piece>, Vec<Piece>) =
        all.into_iter().partition(|piece| piece.skin.is_some_and(|skin| is_body[skin]));
    if own.iter().all(|piece| piece.triangles.is_empty()) {
        return Err("the skin moves no mesh".to_owned().into());
    }
    Ok(Rig { turn, nodes, skins, is_body, joints, own, left_out })
}

/// A body that stands in the T-pose.
struct Standing {
    body: Body,
    /// How each skin rests.
    rests: Vec<Rest>,
    /// Whether the file shows another pose.
    is_other_shown: bool,
}

/// The body as it was bound if that is a T-pose, else as it is shown.
fn standing(rig: &Rig) -> Result<Standing, Fault> {
    let shown: Vec<Rest> = rig.skins.iter().map(|skin| skin.shown(&rig.nodes)).collect();
    let is_at_rest = shown.iter().zip(&rig.is_body).all(|(rest, is_body)| matches!(rest, Rest::Bound(_)) || !is_body);
    if !is_at_rest {
        // Blender binds in the world, others in the space of what the joints hang on.
        let above: Vec<Rest> = rig.skins.iter().map(|skin| skin.bound(&rig.nodes)).collect();
        let world: Vec<Rest> = rig.skins.iter().map(|_| Rest::Bound(rig.turn)).collect();
        for rests in [above, world] {
            let bound = assembled(rig, &rests).ok().filter(|body| stance::fault(body).is_none());
            if let Some(body) = bound {
                return Ok(Standing { body, rests, is_other_shown: true });
            }
        }
    }
    let body = assembled(rig, &shown)?;
    match stance::fault(&body) {
        None => Ok(Standing { body, rests: shown, is_other_shown: false }),
        Some(fault) => {
            let is_unbound = rig.skins.iter().zip(&rig.is_body).any(|(skin, is_body)| *is_body && !skin.is_bound);
            Err(if is_unbound { unbound(fault) } else { fault })
        }
    }
}

fn body(file: &Container) -> Result<(Body, Vec<Warning>), Fault> {
    let rig = rig(file)?;
    let Standing { body, is_other_shown, .. } = standing(&rig)?;
    let Rig { nodes, skins, joints, own, left_out, .. } = rig;
    let mut warnings = Vec::new();
    if is_other_shown {
        warnings.push(Warning::OtherPose);
    }
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

/// A node's frame at rest, world from node.
fn frame(rig: &Rig, rests: &[Rest], node: usize) -> DMat4 {
    let of_skins = || rig.skins.iter().zip(rests);
    let own = of_skins().find(|(skin, _)| skin.joints.contains(&node));
    let own =
        own.or_else(|| of_skins().find(|(skin, _)| rig.nodes.upwards(node).any(|above| skin.joints.contains(&above))));
    own.and_then(|(skin, rest)| skin.frame(&rig.nodes, rest, node)).unwrap_or(rig.nodes.world[node])
}

/// Mesh, joints and weights in the world.
fn assembled(rig: &Rig, rests: &[Rest]) -> Result<Body, Fault> {
    let Rig { nodes, skins, joints, own, .. } = rig;
    let joint = |&(bone, node, parent): &(_, usize, Option<u8>)| {
        let (rest_m, shown_m) = (frame(rig, rests, node).w_axis.truncate(), nodes.world[node].w_axis.truncate());
        // The shown place is the file's own number, without the rounding of an inverse.
        let rest_m: DVec3 = if rest_m.distance(shown_m) < rest::NONE { shown_m } else { rest_m };
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
    for piece in own {
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
