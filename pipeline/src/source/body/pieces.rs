//! The meshes of a glTF file as the skins see them: places with the shapes that are on by default, triangles, joints and weights. Every
//! index and number is checked after decoding. Knows no bones and no world.

use super::container::Container;
use super::numbers::{floats, integers};
use glam::Vec3;
use gltf::Semantic;
use gltf::accessor::Dimensions;
use gltf::mesh::Mode;
use kitsuke::arrays::limits;

/// How far a vertex's weights may be from summing to 1, for each four of them.
const WEIGHT_TOLERANCE: f32 = 0.02;
/// Most joints that move one vertex, in fours.
const SETS: u32 = 4;

/// One primitive of a mesh at one node.
pub(in crate::source) struct Piece {
    /// The mesh's name.
    pub name: String,
    /// The node that shows it.
    pub node: usize,
    /// The skin that moves it.
    pub skin: Option<usize>,
    /// In the space of the skin's bind matrices, or of the node where there is no skin.
    pub positions: Vec<Vec3>,
    /// Vertices of this piece.
    pub triangles: Vec<[u32; 3]>,
    /// Joint of the skin and weight, `width` per vertex, in the file's order; weights are not negative.
    pub influences: Vec<(u32, f32)>,
    /// Influences per vertex; 0 without a skin.
    pub width: usize,
}

/// The pieces of all nodes for which `is_wanted`, in the order of nodes and primitives.
pub(super) fn pieces(file: &Container, is_wanted: impl Fn(&gltf::Node<'_>) -> bool) -> Result<Vec<Piece>, String> {
    let mut pieces = Vec::new();
    let (mut vertices, mut triangles) = (0, 0);
    for node in file.document.nodes().filter(|node| is_wanted(node)) {
        for primitive in node.mesh().iter().flat_map(gltf::Mesh::primitives) {
            let piece = piece(file, &node, &primitive)?;
            vertices += piece.positions.len();
            triangles += piece.triangles.len();
            if vertices > limits::VERTICES {
                return Err(format!("the body has more than {} vertices", limits::VERTICES));
            }
            if triangles > limits::TRIANGLES {
                return Err(format!("the body has more than {} triangles", limits::TRIANGLES));
            }
            pieces.push(piece);
        }
    }
    Ok(pieces)
}

/// One primitive at one node, with the morph targets on that are so in the file.
pub(in crate::source) fn piece(
    file: &Container,
    node: &gltf::Node<'_>,
    primitive: &gltf::Primitive<'_>,
) -> Result<Piece, String> {
    let weights = node.weights().or_else(|| node.mesh()?.weights()).unwrap_or_default();
    morphed_piece(file, node, primitive, weights)
}

/// One primitive at one node, with weights of its morph targets in their order.
pub(in crate::source) fn morphed_piece(
    file: &Container,
    node: &gltf::Node<'_>,
    primitive: &gltf::Primitive<'_>,
    weights: &[f32],
) -> Result<Piece, String> {
    let mesh = node.mesh().expect("the primitive is of this node's mesh");
    let name = mesh.name().unwrap_or("body").to_owned();
    let mut positions = vectors(file, &attribute(&name, primitive, &Semantic::Positions)?)?;
    for (target, &weight) in primitive.morph_targets().zip(weights).filter(|(_, weight)| **weight != 0.0) {
        let Some(accessor) = target.positions() else { continue };
        let moves = vectors(file, &accessor)?;
        if moves.len() != positions.len() {
            return Err(format!("a shape of mesh {name} moves {} of {} vertices", moves.len(), positions.len()));
        }
        positions.iter_mut().zip(moves).for_each(|(position, way)| *position += weight * way);
    }
    let indices: Vec<u32> = match primitive.indices() {
        Some(accessor) => integers::<1>(file, &accessor, Dimensions::Scalar)?.into_iter().map(|[i]| i).collect(),
        None => (0..positions.len() as u32).collect(),
    };
    if let Some(index) = indices.iter().find(|&&index| index as usize >= positions.len()) {
        return Err(format!("mesh {name} names vertex {index}, but has {}", positions.len()));
    }
    let triangles = triangles(&name, primitive.mode(), &indices)?;
    let skin = node.skin().map(|skin| skin.index());
    let (influences, width) = match node.skin() {
        Some(skin) => influences(file, &name, primitive, positions.len(), skin.joints().len())?,
        None => (Vec::new(), 0),
    };
    Ok(Piece { name, node: node.index(), skin, positions, triangles, influences, width })
}

/// The triangles that indices make. In strips a vertex may stand twice to turn the strip; what lies between is no triangle.
fn triangles(name: &str, mode: Mode, indices: &[u32]) -> Result<Vec<[u32; 3]>, String> {
    let is_whole = |t: &[u32; 3]| t[0] != t[1] && t[1] != t[2] && t[2] != t[0];
    let of_strip = |(i, w): (usize, &[u32])| if i % 2 == 0 { [w[0], w[1], w[2]] } else { [w[0], w[2], w[1]] };
    match mode {
        Mode::Triangles => match indices.as_chunks::<3>() {
            (triangles, []) => Ok(triangles.to_vec()),
            _ => Err(format!("mesh {name} has {} indices, which is no whole number of triangles", indices.len())),
        },
        Mode::TriangleStrip => Ok(indices.windows(3).enumerate().map(of_strip).filter(is_whole).collect()),
        Mode::TriangleFan => {
            let rim = indices.get(1..).unwrap_or_default();
            Ok(rim.windows(2).map(|w| [w[0], w[1], indices[0]]).filter(is_whole).collect())
        }
        _ => Err(format!("mesh {name} has primitives that are no triangles")),
    }
}

/// Joints and weights of a primitive, and how many there are per vertex.
fn influences(
    file: &Container,
    name: &str,
    primitive: &gltf::Primitive<'_>,
    vertices: usize,
    joint_count: usize,
) -> Result<(Vec<(u32, f32)>, usize), String> {
    let mut sets = Vec::new();
    for set in 0.. {
        let [joints, weights] = [Semantic::Joints(set), Semantic::Weights(set)];
        if set > 0 && primitive.get(&joints).is_none() {
            break;
        }
        if set == SETS {
            return Err(format!("mesh {name} has more than {} joints per vertex", 4 * SETS));
        }
        let joints = integers::<4>(file, &attribute(name, primitive, &joints)?, Dimensions::Vec4)?;
        let weights = floats::<4>(file, &attribute(name, primitive, &weights)?, Dimensions::Vec4)?;
        if joints.len() != vertices || weights.len() != vertices {
            return Err(format!("mesh {name} has not one position, joint and weight row per vertex"));
        }
        sets.push((joints, weights));
    }
    let width = 4 * sets.len();
    let mut influences = Vec::with_capacity(width * vertices);
    for vertex in 0..vertices {
        let first = influences.len();
        for (joints, weights) in &sets {
            influences.extend(joints[vertex].into_iter().zip(weights[vertex]));
        }
        let own = &mut influences[first..];
        let sum: f32 = own.iter().map(|(_, weight)| weight).sum();
        let tolerance = WEIGHT_TOLERANCE * sets.len() as f32;
        let is_share = |weight: f32| (0.0..=1.0 + tolerance).contains(&weight);
        if !own.iter().all(|(_, weight)| is_share(*weight)) || (sum - 1.0).abs() > tolerance {
            return Err(format!("the skin weights of vertex {vertex} of mesh {name} sum to {sum}, not 1"));
        }
        for (joint, weight) in own {
            if *weight > 0.0 && *joint as usize >= joint_count {
                return Err(format!(
                    "vertex {vertex} of mesh {name} follows joint {joint}, but the skin has {joint_count}"
                ));
            }
            *weight /= sum;
        }
    }
    Ok((influences, width))
}

fn vectors(file: &Container, accessor: &gltf::Accessor<'_>) -> Result<Vec<Vec3>, String> {
    Ok(floats::<3>(file, accessor, Dimensions::Vec3)?.into_iter().map(Vec3::from_array).collect())
}

fn attribute<'a>(
    name: &str,
    primitive: &gltf::Primitive<'a>,
    semantic: &Semantic,
) -> Result<gltf::Accessor<'a>, String> {
    primitive.get(semantic).ok_or_else(|| format!("mesh {name} has no {}", semantic.to_string()))
}
