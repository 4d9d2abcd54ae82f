//! The wearer as the page draws her: a skinned mesh, as plain arrays.

use kitsuke_pipeline::ir::Body;
use serde_json::json;

/// A header in JSON (its length first, `u32`, the text padded to four bytes), then per vertex three positions, per vertex four joints,
/// per vertex four weights, then three corners per triangle; all as 32-bit floats but the corners, which are `u32`. Little-endian.
pub fn bytes(body: &Body) -> Vec<u8> {
    let joint = |joint: &kitsuke::skeleton::Joint| json!({ "bone": joint.bone.name(), "parent": joint.parent, "rest": joint.rest_m.to_array() });
    let joints: Vec<_> = body.skeleton.joints().iter().map(joint).collect();
    let (vertices, triangles) = (body.surface.positions_m.len(), body.surface.triangles.len());
    let mut header = json!({ "vertices": vertices, "triangles": triangles, "joints": joints }).to_string().into_bytes();
    header.resize(header.len().next_multiple_of(4), b' ');
    let mut bytes = (header.len() as u32).to_le_bytes().to_vec();
    bytes.append(&mut header);
    let mut floats = |values: &mut dyn Iterator<Item = f32>| bytes.extend(values.flat_map(f32::to_le_bytes));
    floats(&mut body.surface.positions_m.iter().flat_map(|p| p.to_array()));
    floats(&mut body.skin.iter().flatten().map(|&(joint, _)| f32::from(joint)));
    floats(&mut body.skin.iter().flatten().map(|&(_, weight)| weight));
    bytes.extend(body.surface.triangles.iter().flatten().flat_map(|corner| corner.to_le_bytes()));
    bytes
}
