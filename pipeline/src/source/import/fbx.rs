//! FBX, text and binary, in the file's own vertex order: all meshes with the transforms of their nodes. The library (C, behind a safe
//! interface) reads the scene; here it becomes one mesh. Knows no bones and no animation: what is read is the shape as it was bound.

use super::assembly::{Assembly, VERTICES};
use super::{Axes, Fault, ImportedMesh, Picture};
use glam::{DMat4, DVec3, DVec4, Vec2};

/// Most bytes that the library may take for a file.
const MEMORY: usize = 4 << 30;
/// What to do about a file that is broken.
const EXPORT: &str = "Export the mesh again as FBX 7.4 (2014) or newer, or as OBJ or GLB.";

/// Reads a mesh.
pub(super) fn read(bytes: &[u8], warnings: &mut Vec<Fault>) -> Result<ImportedMesh, Fault> {
    let fault = |problem: String| Fault::new("mesh-fbx", problem, EXPORT);
    let memory = || ufbx::AllocatorOpts { memory_limit: MEMORY, ..Default::default() };
    let options = ufbx::LoadOpts {
        temp_allocator: memory(),
        result_allocator: memory(),
        file_format: ufbx::FileFormat::Fbx,
        ignore_animation: true,
        skip_skin_vertices: true,
        index_error_handling: ufbx::IndexErrorHandling::AbortLoading,
        ..Default::default()
    };
    let scene = ufbx::load_memory(bytes, options).map_err(|error| {
        let details = error.info();
        let details = if details.is_empty() { String::new() } else { format!(" ({details})") };
        fault(format!("the scene cannot be read: {}{details}", error.description))
    })?;
    let mut assembly = Assembly::default();
    let mut pictures: Vec<Option<Picture>> = Vec::new();
    for mesh in &scene.meshes {
        for node in &mesh.element.instances {
            append(&mut assembly, mesh, node, &mut pictures).map_err(fault)?;
        }
    }
    if assembly.position_count() == 0 {
        let nodes = scene.nodes.len().saturating_sub(1);
        let other = scene.nurbs_surfaces.len() + scene.procedural_geometries.len();
        let problem = format!("the scene has {nodes} nodes and no mesh ({other} curved surfaces of other kinds)");
        return Err(Fault::new(
            "mesh-empty",
            problem,
            "Export again with the mesh selected, curved surfaces made polygons.",
        ));
    }
    super::note_skipped(&assembly, warnings);
    let texture = super::most_seen(&assembly, |part| pictures.get(part).cloned().flatten(), warnings);
    let unit_m = scene.settings.unit_meters;
    let axes = axes(&scene.settings.axes, warnings);
    let mesh = assembly.finish();
    let unit_m = Some(unit_m).filter(|unit_m| unit_m.is_finite() && *unit_m > 0.0);
    Ok(ImportedMesh { texture, unit_m, axes, ..mesh })
}

/// Appends a mesh where a node shows it.
fn append(
    assembly: &mut Assembly,
    mesh: &ufbx::Mesh,
    node: &ufbx::Node,
    pictures: &mut Vec<Option<Picture>>,
) -> Result<(), String> {
    if assembly.position_count() + mesh.vertices.len() > VERTICES {
        return Err(format!("the mesh has more than {VERTICES} vertices"));
    }
    let name: &str = &node.element.name;
    let name = [name, &mesh.element.name].into_iter().find(|name| !name.is_empty()).unwrap_or("default");
    let world = matrix(&node.geometry_to_world);
    let first = assembly.position_count() as u32;
    let mut colours: Vec<Option<[u8; 3]>> = vec![None; mesh.vertices.len()];
    if mesh.vertex_color.exists {
        for (&vertex, &colour) in mesh.vertex_indices.iter().zip(&mesh.vertex_color.indices) {
            let colour = mesh.vertex_color.values.get(colour as usize).map(|colour| {
                [colour.x, colour.y, colour.z].map(|share| (share.clamp(0.0, 1.0) * 255.0).round() as u8)
            });
            // Corners of one vertex may differ; the first is taken.
            if let Some(own) = colours.get_mut(vertex as usize).filter(|own| own.is_none()) {
                *own = colour;
            }
        }
    }
    for (vertex, (place, colour)) in mesh.vertices.iter().zip(colours).enumerate() {
        let place = world.transform_point3(DVec3::new(place.x, place.y, place.z));
        assembly.position(place, colour, || format!("vertex {vertex} of mesh {name}"))?;
    }
    let mut part_of_material: Vec<Option<u32>> = Vec::new();
    let is_mirrored = world.determinant() < 0.0;
    for (number, face) in mesh.faces.iter().enumerate() {
        let range = face.index_begin as usize..(face.index_begin as usize).saturating_add(face.num_indices as usize);
        let naming = || format!("face {number} of mesh {name}");
        let Some(own) = mesh.vertex_indices.get(range.clone()) else {
            return Err(format!("{} has corners that the file has not", naming()));
        };
        let count = mesh.vertices.len();
        if let Some(vertex) = own.iter().find(|&&vertex| vertex as usize >= count) {
            return Err(format!("{} names vertex {vertex}, but there are {count}", naming()));
        }
        let mut corners: Vec<u32> = own.iter().map(|vertex| vertex + first).collect();
        let mut uv = texture_coordinates(mesh, range);
        if is_mirrored {
            corners.reverse();
            uv.iter_mut().for_each(|uv| uv.reverse());
        }
        let material = mesh.face_material.get(number).map_or(0, |&material| material as usize);
        if material >= part_of_material.len() && material <= mesh.materials.len().max(node.materials.len()) {
            part_of_material.resize(material + 1, None);
        }
        let part = match part_of_material.get(material).copied().flatten() {
            Some(part) => part,
            None => {
                let own = node.materials.get(material).or_else(|| mesh.materials.get(material));
                let part = assembly.part(name, own.map_or("", |own| &own.element.name))?;
                if pictures.len() <= part as usize {
                    pictures.resize(part as usize + 1, own.and_then(|own| picture(own)));
                }
                if let Some(known) = part_of_material.get_mut(material) {
                    *known = Some(part);
                }
                part
            }
        };
        assembly.polygon(&corners, uv.as_deref(), part, naming)?;
    }
    Ok(())
}

fn texture_coordinates(mesh: &ufbx::Mesh, corners: std::ops::Range<usize>) -> Option<Vec<Vec2>> {
    let own = &mesh.vertex_uv;
    let place = |&index: &u32| own.values.get(index as usize).map(|uv| Vec2::new(uv.x as f32, uv.y as f32));
    if own.exists { own.indices.get(corners)?.iter().map(place).collect() } else { None }
}

/// The picture of a material's colour.
fn picture(material: &ufbx::Material) -> Option<Picture> {
    let maps = [&material.fbx.diffuse_color, &material.pbr.base_color];
    let texture = maps.into_iter().find_map(|map| map.texture.as_ref())?;
    let held: &[u8] = &texture.content;
    if held.starts_with(b"\x89PNG") || held.starts_with(b"\xff\xd8\xff") {
        return Some(Picture::Held(held.to_vec()));
    }
    let names: [&str; 3] = [&texture.relative_filename, &texture.filename, &texture.absolute_filename];
    names.into_iter().find(|name| !name.is_empty()).map(|name| Picture::Named(name.to_owned()))
}

fn matrix(m: &ufbx::Matrix) -> DMat4 {
    DMat4::from_cols(
        DVec4::new(m.m00, m.m10, m.m20, 0.0),
        DVec4::new(m.m01, m.m11, m.m21, 0.0),
        DVec4::new(m.m02, m.m12, m.m22, 0.0),
        DVec4::new(m.m03, m.m13, m.m23, 1.0),
    )
}

/// Up and front, where the file says both.
fn axes(axes: &ufbx::CoordinateAxes, warnings: &mut Vec<Fault>) -> Option<Axes> {
    let [right, up, front] = [axes.right, axes.up, axes.front].map(axis);
    let (up, front) = (up?, front?);
    if right.is_some_and(|right| up.cross(front).dot(right) < 0.0) {
        let problem = "the file's axes are left-handed, so that left and right may be exchanged";
        warnings.push(Fault::new(
            "mesh-axes",
            problem,
            "Check that the left front lies over the right one; export with right-handed axes.",
        ));
    }
    (up.dot(front) == 0.0).then_some(Axes { up, front })
}

fn axis(axis: ufbx::CoordinateAxis) -> Option<DVec3> {
    Some(match axis {
        ufbx::CoordinateAxis::PositiveX => DVec3::X,
        ufbx::CoordinateAxis::NegativeX => DVec3::NEG_X,
        ufbx::CoordinateAxis::PositiveY => DVec3::Y,
        ufbx::CoordinateAxis::NegativeY => DVec3::NEG_Y,
        ufbx::CoordinateAxis::PositiveZ => DVec3::Z,
        ufbx::CoordinateAxis::NegativeZ => DVec3::NEG_Z,
        ufbx::CoordinateAxis::Unknown => return None,
    })
}
