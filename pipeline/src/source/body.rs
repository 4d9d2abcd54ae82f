//! The body: a skinned GLB in the T-pose whose joints carry VRM 1.0 names. Every index and number is checked after
//! decoding, since the glTF library checks only the JSON. Knows no garment.

use super::manifest::unknown_bone;
use crate::diagnostic::{Diagnostic, Place};
use crate::ir::{Body, Part, Surface, WearerBody};
use glam::{Mat4, Quat, Vec3};
use gltf::accessor::{DataType, Dimensions};
use kitsuke::arrays::limits;
use kitsuke::skeleton::{Bone, Joint, Skeleton};

/// How far a joint's rest rotation, scale or bind pose may lie from the VRM-normalised T-pose.
const TOLERANCE: f32 = 1e-3;
/// Most joints of a skin.
const JOINTS: usize = 256;
/// How far a vertex's weights may be from summing to 1.
const WEIGHT_TOLERANCE: f32 = 0.02;

/// Reads a body.
pub fn read(file: &str, bytes: &[u8], report: &mut Vec<Diagnostic>) -> Option<Body> {
    decode(bytes)
        .map_err(|problem| {
            report.push(Diagnostic::error("body", file, Place::File).problem(problem).help(
                "Export the body as one GLB file in metres: mesh skinned to joints with VRM 1.0 names, in a VRM-normalised \
                 T-pose (no joint rotations), triangles with POSITION, JOINTS_0 and WEIGHTS_0.",
            ));
        })
        .ok()
}

/// Reads a wearer's body, which may come without a skin.
pub fn read_wearer(file: &str, bytes: &[u8], report: &mut Vec<Diagnostic>) -> Option<WearerBody> {
    match decode_bare(bytes) {
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

/// `None` where the file has a skin.
fn decode_bare(bytes: &[u8]) -> Result<Option<Surface>, String> {
    let (document, buffers) = open(bytes)?;
    if document.skins().next().is_some() {
        return Ok(None);
    }
    let nodes: Vec<gltf::Node<'_>> = document.nodes().collect();
    let rest = rest_transforms(&document, &nodes)?;
    let mut surface = Surface::default();
    for node in &nodes {
        if let (Some(mesh), Some((place, _))) = (node.mesh(), rest[node.index()]) {
            for primitive in mesh.primitives() {
                append_surface(&mut surface, mesh.name().unwrap_or("body"), &primitive, &buffers, Some(place))?;
            }
        }
    }
    if surface.triangles.is_empty() {
        return Err("the file has no mesh".to_owned());
    }
    Ok(Some(surface))
}

fn open(bytes: &[u8]) -> Result<(gltf::Document, Vec<gltf::buffer::Data>), String> {
    let gltf::Gltf { document, blob } =
        gltf::Gltf::from_slice(bytes).map_err(|error| format!("this is no readable GLB: {error}"))?;
    let buffers = gltf::import_buffers(&document, None, blob)
        .map_err(|error| format!("a buffer cannot be read ({error}); all data must lie inside the GLB"))?;
    Ok((document, buffers))
}

fn decode(bytes: &[u8]) -> Result<Body, String> {
    let (document, buffers) = open(bytes)?;
    let skin = document.skins().next().ok_or("the file has no skin, so the body has no joints")?;
    let nodes: Vec<gltf::Node<'_>> = document.nodes().collect();
    let rest = rest_transforms(&document, &nodes)?;

    // Joints in the order of the bones, which puts parents first; `slot_of` maps the skin's joints to them.
    let joint_nodes: Vec<usize> = skin.joints().map(|node| node.index()).take(JOINTS + 1).collect();
    if joint_nodes.len() > JOINTS {
        return Err(format!("the skin has more than {JOINTS} joints"));
    }
    let mut bones: Vec<(Bone, usize)> = Vec::new();
    for &node in &joint_nodes {
        let name = nodes[node].name().unwrap_or_default();
        bones.push((Bone::from_name(name).ok_or_else(|| unknown_bone(name))?, node));
    }
    bones.sort();
    let slot_of_node = |node: usize| bones.iter().position(|(_, n)| *n == node).map(|slot| slot as u8);
    let mut joints = Vec::new();
    for &(bone, node) in &bones {
        let transform = rest[node].ok_or_else(|| format!("joint {} hangs in no scene", bone.name()))?;
        let place = &transform.0;
        let mut ancestor = transform.1;
        while let Some(node) = ancestor
            && slot_of_node(node).is_none()
        {
            ancestor = rest[node].and_then(|(_, parent)| parent);
        }
        if !is_translation(place) {
            return Err(format!("joint {} is rotated or scaled in the rest pose", bone.name()));
        }
        joints.push(Joint { bone, parent: ancestor.and_then(slot_of_node), rest_m: place.w_axis.truncate() });
    }
    let skeleton = Skeleton::new(joints).map_err(|error| format!("the joints form no skeleton: {error}"))?;

    if let Some(accessor) = skin.inverse_bind_matrices() {
        let matrices = floats::<16>(&accessor, &buffers, Dimensions::Mat4)?;
        for (matrix, &node) in matrices.iter().zip(&joint_nodes) {
            let bound = rest[node].map_or(Mat4::IDENTITY, |(place, _)| place) * Mat4::from_cols_array(matrix);
            if !bound.abs_diff_eq(Mat4::IDENTITY, TOLERANCE) {
                let name = nodes[node].name().unwrap_or_default();
                return Err(format!(
                    "joint {name} does not rest where the mesh was bound to it, so the mesh is not in the T-pose"
                ));
            }
        }
    }
    let slots: Vec<u8> = joint_nodes.iter().map(|&node| slot_of_node(node).expect("every joint has a slot")).collect();
    let mut body = Body { surface: Surface::default(), skeleton, skin: Vec::new() };
    for node in &nodes {
        if let Some(mesh) = node.mesh()
            && node.skin().is_some_and(|used| used.index() == skin.index())
        {
            for primitive in mesh.primitives() {
                append(&mut body, mesh.name().unwrap_or("body"), &primitive, &buffers, &slots)?;
            }
        }
    }
    if body.surface.triangles.is_empty() {
        return Err("the skin moves no mesh".to_owned());
    }
    Ok(body)
}

/// For every node that hangs in the scene graph its transform in the rest pose, and its parent.
#[allow(clippy::type_complexity)]
fn rest_transforms(
    document: &gltf::Document,
    nodes: &[gltf::Node<'_>],
) -> Result<Vec<Option<(Mat4, Option<usize>)>>, String> {
    let mut rest: Vec<Option<(Mat4, Option<usize>)>> = vec![None; nodes.len()];
    let roots = document.scenes().flat_map(|scene| scene.nodes().map(|node| node.index()).collect::<Vec<_>>());
    let mut pending: Vec<(usize, Option<usize>)> = roots.map(|root| (root, None)).collect();
    let mut visited = 0;
    while let Some((node, parent)) = pending.pop() {
        visited += 1;
        if visited > nodes.len() * 2 {
            return Err("the nodes form no tree".to_owned());
        }
        let above = parent.and_then(|parent| rest[parent]).map_or(Mat4::IDENTITY, |(transform, _)| transform);
        let local = Mat4::from_cols_array_2d(&nodes[node].transform().matrix());
        rest[node] = Some((above * local, parent));
        pending.extend(nodes[node].children().map(|child| (child.index(), Some(node))));
    }
    Ok(rest)
}

fn is_translation(transform: &Mat4) -> bool {
    let mut turned = *transform;
    turned.w_axis = Mat4::IDENTITY.w_axis;
    transform.is_finite() && turned.abs_diff_eq(Mat4::from_quat(Quat::IDENTITY), TOLERANCE)
}

/// Appends one primitive's triangles and skin weights to the body.
fn append(
    body: &mut Body,
    name: &str,
    primitive: &gltf::Primitive<'_>,
    buffers: &[gltf::buffer::Data],
    slots: &[u8],
) -> Result<(), String> {
    let first = body.surface.positions_m.len();
    append_surface(&mut body.surface, name, primitive, buffers, None)?;
    let joints = integers::<4>(&attribute(name, primitive, &gltf::Semantic::Joints(0))?, buffers, Dimensions::Vec4)?;
    let weights = floats::<4>(&attribute(name, primitive, &gltf::Semantic::Weights(0))?, buffers, Dimensions::Vec4)?;
    if primitive.get(&gltf::Semantic::Joints(1)).is_some() {
        return Err(format!("mesh {name} has more than four joints per vertex"));
    }
    let count = body.surface.positions_m.len() - first;
    if joints.len() != count || weights.len() != count {
        return Err(format!("mesh {name} has not one position, joint and weight row per vertex"));
    }
    for (vertex, (joints, weights)) in joints.iter().zip(&weights).enumerate() {
        let sum: f32 = weights.iter().sum();
        if weights.iter().any(|weight| !(0.0..=1.0 + WEIGHT_TOLERANCE).contains(weight))
            || (sum - 1.0).abs() > WEIGHT_TOLERANCE
        {
            return Err(format!("the skin weights of vertex {vertex} of mesh {name} sum to {sum}, not 1"));
        }
        let mut row = [(0, 0.0); 4];
        for ((place, &joint), &weight) in row.iter_mut().zip(joints).zip(weights) {
            if weight > 0.0 {
                let slot = slots.get(joint as usize).ok_or_else(|| {
                    format!("vertex {vertex} of mesh {name} follows joint {joint}, but the skin has {}", slots.len())
                })?;
                *place = (*slot, weight / sum);
            }
        }
        body.skin.push(row);
    }
    Ok(())
}

/// Appends one primitive's vertices, moved by `place` if there is one, and triangles.
fn append_surface(
    surface: &mut Surface,
    name: &str,
    primitive: &gltf::Primitive<'_>,
    buffers: &[gltf::buffer::Data],
    place: Option<Mat4>,
) -> Result<(), String> {
    if primitive.mode() != gltf::mesh::Mode::Triangles {
        return Err(format!("mesh {name} has primitives that are no triangles"));
    }
    let positions = floats::<3>(&attribute(name, primitive, &gltf::Semantic::Positions)?, buffers, Dimensions::Vec3)?;
    let first = surface.positions_m.len();
    if first + positions.len() > limits::VERTICES {
        return Err(format!("the body has more than {} vertices", limits::VERTICES));
    }
    for (vertex, position) in positions.iter().enumerate() {
        let position = Vec3::from_array(*position);
        let position = place.map_or(position, |place| place.transform_point3(position));
        if !(position.is_finite() && position.abs().max_element() <= limits::EXTENT_M) {
            return Err(format!("vertex {vertex} of mesh {name} lies at {position}"));
        }
        surface.positions_m.push(position);
    }
    let indices: Vec<u32> = match primitive.indices() {
        Some(accessor) => integers::<1>(&accessor, buffers, Dimensions::Scalar)?.into_iter().map(|[i]| i).collect(),
        None => (0..positions.len() as u32).collect(),
    };
    if let Some(index) = indices.iter().find(|&&index| index as usize >= positions.len()) {
        return Err(format!("mesh {name} names vertex {index}, but has {}", positions.len()));
    }
    let (triangles, rest) = indices.as_chunks::<3>();
    if !rest.is_empty() {
        return Err(format!("mesh {name} has {} indices, which is no whole number of triangles", indices.len()));
    }
    if surface.triangles.len() + triangles.len() > limits::TRIANGLES {
        return Err(format!("the body has more than {} triangles", limits::TRIANGLES));
    }
    surface.triangles.extend(triangles.iter().map(|triangle| triangle.map(|index| index + first as u32)));
    surface.parts.push(Part { name: name.to_owned(), triangle_count: triangles.len() as u32 });
    Ok(())
}

fn attribute<'a>(
    name: &str,
    primitive: &gltf::Primitive<'a>,
    semantic: &gltf::Semantic,
) -> Result<gltf::Accessor<'a>, String> {
    primitive.get(semantic).ok_or_else(|| format!("mesh {name} has no {}", semantic.to_string()))
}

/// The rows of an accessor as bytes, one slice of `N` components each.
fn rows<'a, const N: usize>(
    accessor: &gltf::Accessor<'_>,
    buffers: &'a [gltf::buffer::Data],
    dimensions: Dimensions,
) -> Result<impl Iterator<Item = &'a [u8]> + use<'a, N>, String> {
    let index = accessor.index();
    if accessor.dimensions() != dimensions {
        return Err(format!("accessor {index} has another shape than its use wants"));
    }
    let view = accessor.view().filter(|_| accessor.sparse().is_none());
    let view = view.ok_or_else(|| format!("accessor {index} is sparse or empty, which is not read here"))?;
    let size = N * accessor.data_type().size();
    let stride = view.stride().unwrap_or(size);
    let (count, start) = (accessor.count(), accessor.offset());
    let span = count.checked_sub(1).and_then(|last| last.checked_mul(stride)?.checked_add(size));
    let viewed = view
        .offset()
        .checked_add(view.length())
        .and_then(|end| buffers.get(view.buffer().index())?.get(view.offset()..end));
    let bytes = span
        .filter(|_| stride >= size && count <= 3 * limits::TRIANGLES)
        .and_then(|span| viewed?.get(start..start.checked_add(span)?))
        .ok_or_else(|| format!("accessor {index} reaches beyond its buffer"))?;
    Ok(bytes.chunks(stride).map(move |row| &row[..size]))
}

/// Rows of floats; normalised integers count as fractions.
fn floats<const N: usize>(
    accessor: &gltf::Accessor<'_>,
    buffers: &[gltf::buffer::Data],
    dimensions: Dimensions,
) -> Result<Vec<[f32; N]>, String> {
    let read: fn(&[u8]) -> f32 = match (accessor.data_type(), accessor.normalized()) {
        (DataType::F32, _) => |b| f32::from_le_bytes([b[0], b[1], b[2], b[3]]),
        (DataType::U8, true) => |b| f32::from(b[0]) / 255.0,
        (DataType::U16, true) => |b| f32::from(u16::from_le_bytes([b[0], b[1]])) / 65535.0,
        (other, _) => return Err(format!("accessor {} holds {other:?}, which is not read here", accessor.index())),
    };
    let size = accessor.data_type().size();
    let row = |row: &[u8]| std::array::from_fn(|i| read(&row[i * size..]));
    Ok(rows::<N>(accessor, buffers, dimensions)?.map(row).collect())
}

/// Rows of unsigned integers.
fn integers<const N: usize>(
    accessor: &gltf::Accessor<'_>,
    buffers: &[gltf::buffer::Data],
    dimensions: Dimensions,
) -> Result<Vec<[u32; N]>, String> {
    let read: fn(&[u8]) -> u32 = match accessor.data_type() {
        DataType::U8 => |b| u32::from(b[0]),
        DataType::U16 => |b| u32::from(u16::from_le_bytes([b[0], b[1]])),
        DataType::U32 => |b| u32::from_le_bytes([b[0], b[1], b[2], b[3]]),
        other => return Err(format!("accessor {} holds {other:?}, which is not read here", accessor.index())),
    };
    let size = accessor.data_type().size();
    let row = |row: &[u8]| std::array::from_fn(|i| read(&row[i * size..]));
    Ok(rows::<N>(accessor, buffers, dimensions)?.map(row).collect())
}
