//! Meshes of GLB, VRM and glTF files as they stand in the world: every node's primitives, moved by its transform or its skin as the file
//! shows them. Opening and numbers are those of the body's reader. Knows no bones.

use super::assembly::{Assembly, TRIANGLES, VERTICES};
use super::{Axes, Fault, ImportedMesh, Picture};
use crate::source::body::container::{Container, Looks, named, open_with_looks, plain};
use crate::source::body::nodes::Nodes;
use crate::source::body::numbers::floats;
use crate::source::body::pieces::{morphed_piece, piece};
use crate::source::body::rest::{Rest, skins};
use crate::source::body::{JOINTS, world_turn};
use crate::source::folder::composed;
use glam::{Affine2, DMat4, DVec3, Mat2, Vec2};
use gltf::Semantic;
use gltf::accessor::Dimensions;
use gltf::mesh::Mode;
use serde_json::Value;
use std::collections::BTreeSet;
use std::path::Path;

/// What to do about a file that is broken.
const EXPORT: &str = "Export the mesh again as GLB: triangles with POSITION, without Draco compression.";
/// Most vertices of all shapes of a file together.
const SHAPE_VERTICES: usize = 1 << 26;

fn fault(problem: String) -> Fault {
    Fault::new("mesh-gltf", problem, EXPORT)
}

/// Reads a mesh.
pub(super) fn read(bytes: &[u8], folder: Option<&Path>, warnings: &mut Vec<Fault>) -> Result<ImportedMesh, Fault> {
    let (file, looks) = open_with_looks(bytes, folder).map_err(fault)?;
    mesh(&file, &looks, folder, None, warnings)
}

/// Reads a mesh once with each of these morph targets alone; nothing for those that no mesh has. Returns what morph targets there are besides.
pub(super) fn read_morphs(
    bytes: &[u8],
    wanted: &[Option<&str>],
    warnings: &mut Vec<Fault>,
) -> Result<(Vec<Option<ImportedMesh>>, Vec<String>), Fault> {
    let (file, looks) = open_with_looks(bytes, None).map_err(fault)?;
    let names = names(&looks);
    let mut meshes: Vec<Option<ImportedMesh>> = Vec::new();
    for morph in wanted {
        if morph.is_some_and(|morph| !names.iter().any(|name| is_same(name, morph))) {
            meshes.push(None);
            continue;
        }
        let weight = |own: &String| if morph.is_some_and(|morph| is_same(own, morph)) { 1.0 } else { 0.0 };
        let weights: Vec<Vec<f32>> = looks.morphs.iter().map(|own| own.iter().map(weight).collect()).collect();
        if let Some(twice) = weights.iter().find(|own| own.iter().sum::<f32>() > 1.0) {
            let (count, morph) = (twice.len(), morph.unwrap_or_default());
            let problem = format!("two of a mesh's {count} morph targets are called {morph}");
            return Err(Fault::new("morph-target", problem, "Give each a name of its own, then export again."));
        }
        let first = if meshes.is_empty() { &mut *warnings } else { &mut Vec::new() };
        let read = mesh(&file, &looks, None, Some(&weights), first)?;
        if read.positions.len() * wanted.len() > SHAPE_VERTICES {
            let problem = format!("{} shapes of {} vertices are too many", wanted.len(), read.positions.len());
            return Err(Fault::new("mesh-gltf", problem, "Export fewer morph targets, or a lighter mesh."));
        }
        meshes.push(Some(read));
    }
    Ok((meshes, names))
}

/// The morph targets of all meshes, each name once.
fn names(looks: &Looks) -> Vec<String> {
    let mut known = BTreeSet::new();
    looks.morphs.iter().flatten().filter(|name| known.insert(*name)).cloned().collect()
}

/// Whether two names are the same to people.
fn is_same(a: &str, b: &str) -> bool {
    a == b || composed(a) == composed(b)
}

/// The mesh, with the morph targets on that are so in the file, or with these weights of each mesh's own.
fn mesh(
    file: &Container,
    looks: &Looks,
    folder: Option<&Path>,
    weights: Option<&[Vec<f32>]>,
    warnings: &mut Vec<Fault>,
) -> Result<ImportedMesh, Fault> {
    let mut assembly = Assembly::default();
    // The material of each part: names need not tell them apart.
    let mut materials: Vec<Option<usize>> = Vec::new();
    let nodes = Nodes::new(&file.document, DMat4::IDENTITY).map_err(fault)?;
    let has_skins = file.document.nodes().any(|node| node.mesh().is_some() && node.skin().is_some());
    let skins = if has_skins { skins(file, JOINTS).map_err(fault)? } else { Vec::new() };
    let (mut lines, mut triangles) = (0, 0);
    for node in file.document.nodes().filter(|node| nodes.is_shown[node.index()]) {
        let Some(mesh) = node.mesh() else { continue };
        for (number, primitive) in mesh.primitives().enumerate() {
            if !matches!(primitive.mode(), Mode::Triangles | Mode::TriangleStrip | Mode::TriangleFan) {
                lines += 1;
                continue;
            }
            let piece = match weights {
                None => piece(file, &node, &primitive),
                Some(weights) => {
                    let own = weights.get(mesh.index()).map_or(&[][..], Vec::as_slice);
                    morphed_piece(file, &node, &primitive, own)
                }
            };
            let piece = piece.map_err(fault)?;
            triangles += piece.triangles.len();
            if assembly.position_count() + piece.positions.len() > VERTICES || triangles > TRIANGLES {
                return Err(fault(format!("the mesh has more than {VERTICES} vertices or {TRIANGLES} triangles")));
            }
            let material = looks.material_of.get(mesh.index()).and_then(|own| own.get(number).copied().flatten());
            let material_value = material.and_then(|material| looks.root.get("materials")?.get(material));
            let material_name = material_value.and_then(|value| value.get("name")?.as_str()).unwrap_or_default();
            let name = [node.name(), mesh.name()].into_iter().flatten().find(|name| !name.is_empty());
            let name = name.unwrap_or("default");
            let part = assembly.part(name, material_name).map_err(fault)?;
            materials.resize(assembly.parts().len(), material);
            let (set, placing) = material_value.and_then(base_colour).map(texture_use).unwrap_or_default();
            let uv = texture_coordinates(file, &primitive, set, placing, piece.positions.len()).map_err(fault)?;
            let colours = colours(file, &primitive, piece.positions.len()).map_err(fault)?;
            let rest = piece.skin.and_then(|skin| skins.get(skin)).map(|skin| skin.shown(&nodes));
            let world = match &rest {
                Some(Rest::Bound(world)) => *world,
                Some(Rest::Shown(_)) => DMat4::IDENTITY,
                None => nodes.world[piece.node],
            };
            let first = assembly.position_count() as u32;
            for (vertex, &place) in piece.positions.iter().enumerate() {
                let place = match &rest {
                    Some(shown @ Rest::Shown(_)) => {
                        shown.vertex_m(place, &piece.influences[vertex * piece.width..][..piece.width]).as_dvec3()
                    }
                    _ => world.transform_point3(place.as_dvec3()),
                };
                let colour = colours.as_ref().map(|colours| colours[vertex]);
                assembly.position(place, colour, || format!("vertex {vertex} of mesh {name}")).map_err(fault)?;
            }
            let is_mirrored = world.determinant() < 0.0;
            for triangle in &piece.triangles {
                let [a, b, c] = *triangle;
                let own = if is_mirrored { [a, c, b] } else { [a, b, c] };
                let uv = uv.as_ref().map(|uv| own.map(|v| uv[v as usize]));
                let corners = own.map(|v| v + first);
                let naming = || format!("mesh {name}");
                assembly.polygon(&corners, uv.as_ref().map(<[Vec2; 3]>::as_slice), part, naming).map_err(fault)?;
            }
        }
    }
    if lines > 0 {
        let problem = format!("{lines} primitives are points or lines and were passed over");
        warnings.push(Fault::new("mesh-faces", problem, "Nothing needs to be done if only surfaces are wanted."));
    }
    let picture = |part: usize| {
        picture(file, looks, folder, looks.root.get("materials")?.get(materials.get(part).copied().flatten()?)?)
    };
    let texture = super::most_seen(&assembly, picture, warnings);
    // Bodies of VRM 0.x face the other way.
    let front = world_turn(file).transform_vector3(DVec3::Z);
    let mesh = assembly.finish();
    Ok(ImportedMesh {
        morphs: names(looks),
        texture,
        unit_m: Some(1.0),
        axes: Some(Axes { up: DVec3::Y, front }),
        ..mesh
    })
}

/// Which set of texture coordinates a texture wants, and where on the picture it puts them (KHR_texture_transform, in which gltfpack undoes
/// quantisation). It turns as that extension's examples say, and as viewers do: from v to u.
fn texture_use(texture: &Value) -> (u32, Affine2) {
    let transform = texture.get("extensions").and_then(|all| all.get("KHR_texture_transform"));
    let own = |name: &str| transform?.get(name);
    let number = |value: &Value| value.as_f64().map(|number| number as f32);
    let pair = |name: &str| Some(Vec2::new(number(own(name)?.get(0)?)?, number(own(name)?.get(1)?)?));
    let set = own("texCoord").or_else(|| texture.get("texCoord")).and_then(Value::as_u64);
    let (sin, cos) = libm::sincosf(own("rotation").and_then(number).unwrap_or(0.0));
    let turned = Mat2::from_cols(Vec2::new(cos, -sin), Vec2::new(sin, cos));
    let scaled = Mat2::from_diagonal(pair("scale").unwrap_or(Vec2::ONE));
    let placing = Affine2::from_mat2_translation(turned * scaled, pair("offset").unwrap_or(Vec2::ZERO));
    (set.and_then(|set| u32::try_from(set).ok()).unwrap_or(0), placing)
}

fn base_colour(material: &Value) -> Option<&Value> {
    let own = material.get("pbrMetallicRoughness").and_then(|pbr| pbr.get("baseColorTexture"));
    let older = || material.get("extensions")?.get("KHR_materials_pbrSpecularGlossiness")?.get("diffuseTexture");
    own.or_else(older)
}

/// Texture coordinates, v upwards.
fn texture_coordinates(
    file: &Container,
    primitive: &gltf::Primitive<'_>,
    set: u32,
    placing: Affine2,
    count: usize,
) -> Result<Option<Vec<Vec2>>, String> {
    let own = primitive.get(&Semantic::TexCoords(set)).or_else(|| primitive.get(&Semantic::TexCoords(0)));
    let Some(accessor) = own else { return Ok(None) };
    let rows = floats::<2>(file, &accessor, Dimensions::Vec2)?;
    let upwards = |row: [f32; 2]| {
        let Vec2 { x: u, y: v } = placing.transform_point2(Vec2::from_array(row));
        Vec2::new(u, 1.0 - v)
    };
    match rows.len() == count {
        true => Ok(Some(rows.into_iter().map(upwards).collect())),
        false => Err(format!("there are {} texture coordinates for {count} vertices", rows.len())),
    }
}

/// Colours of vertices, which the format keeps in linear light.
fn colours(file: &Container, primitive: &gltf::Primitive<'_>, count: usize) -> Result<Option<Vec<[u8; 3]>>, String> {
    let Some(accessor) = primitive.get(&Semantic::Colors(0)) else { return Ok(None) };
    let rows: Vec<[f32; 3]> = match accessor.dimensions() {
        Dimensions::Vec4 => {
            floats::<4>(file, &accessor, Dimensions::Vec4)?.into_iter().map(|[r, g, b, _]| [r, g, b]).collect()
        }
        _ => floats::<3>(file, &accessor, Dimensions::Vec3)?,
    };
    match rows.len() == count {
        true => Ok(Some(rows.into_iter().map(|row| row.map(srgb)).collect())),
        false => Err(format!("there are {} colours for {count} vertices", rows.len())),
    }
}

fn srgb(linear: f32) -> u8 {
    let linear = if linear.is_finite() { linear.clamp(0.0, 1.0) } else { 0.0 };
    let share = if linear <= 0.003_130_8 { 12.92 * linear } else { 1.055 * libm::powf(linear, 1.0 / 2.4) - 0.055 };
    (share * 255.0).round() as u8
}

/// The picture of a material's colour.
fn picture(file: &Container, looks: &Looks, folder: Option<&Path>, material: &Value) -> Option<Picture> {
    let element = |list: &str, number: &Value| looks.root.get(list)?.get(number.as_u64()? as usize);
    let texture = element("textures", base_colour(material)?.get("index")?)?;
    let image = element("images", texture.get("source")?)?;
    if let Some(uri) = image.get("uri").and_then(Value::as_str) {
        return match uri.starts_with("data:") {
            true => named(uri, folder).ok().filter(|bytes| is_picture(bytes)).map(Picture::Held),
            false => Some(Picture::Named(plain(uri))),
        };
    }
    let view = file.document.views().nth(image.get("bufferView")?.as_u64()? as usize)?;
    let bytes = file.buffers.get(view.buffer().index())?;
    let bytes = bytes.get(view.offset()..view.offset().checked_add(view.length())?)?;
    is_picture(bytes).then(|| Picture::Held(bytes.to_vec()))
}

fn is_picture(bytes: &[u8]) -> bool {
    bytes.starts_with(b"\x89PNG") || bytes.starts_with(b"\xff\xd8\xff")
}
