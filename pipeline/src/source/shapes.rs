//! A glTF file as base and targets of a garment: its mesh without morph targets, and with each of those that are named alone. All have the same
//! vertices, those that seams and materials split put together again. Knows no unit, no manifest and no table.

use super::import;
use super::obj::{Corner, Face, Mesh};
use crate::diagnostic::{Diagnostic, Place};
use glam::DVec3;
use std::collections::{BTreeMap, BTreeSet};

/// Endings of such files.
const ENDINGS: [&str; 3] = [".glb", ".gltf", ".vrm"];
/// What stands between a file and one of its morph targets.
const MARK: char = '#';

/// What a file has of what was asked for.
#[derive(Debug)]
pub(super) struct Shapes {
    /// The mesh by the morph target that is on; of none by "".
    pub meshes: BTreeMap<String, Mesh>,
    /// The names of all its morph targets.
    pub morphs: Vec<String>,
}

/// File and morph target of a shape as they are written, `kimono.glb#arms down`.
pub(super) fn parted(written: &str) -> (&str, Option<&str>) {
    match written.split_once(MARK) {
        Some((file, morph)) if is_gltf(file) => (file, Some(morph)),
        _ => (written, None),
    }
}

/// Whether a file is of this kind, by its name.
pub(super) fn is_gltf(file: &str) -> bool {
    let file = file.to_ascii_lowercase();
    ENDINGS.iter().any(|ending| file.ends_with(ending))
}

/// Reads the mesh without morph targets, and with each of those that are wanted and that the file has.
pub(super) fn read(
    file: &str,
    bytes: &[u8],
    wanted: &BTreeSet<String>,
    report: &mut Vec<Diagnostic>,
) -> Option<Shapes> {
    let wanted: Vec<Option<&str>> = [None].into_iter().chain(wanted.iter().map(|name| Some(name.as_str()))).collect();
    let (read, morphs) = import::read_morphs(file, bytes, &wanted, report)?;
    let base = read.first()?.as_ref()?;
    if base.triangles.is_empty() {
        let problem = "the mesh has no faces";
        let help = "Export the surface, not points or lines.";
        report.push(Diagnostic::error("no-faces", file, Place::File).problem(problem).help(help));
        return None;
    }
    // Bodies of VRM 0.x face the other way.
    let is_turned = base.axes.is_some_and(|axes| axes.front.z < 0.0);
    let place = |position: DVec3| if is_turned { DVec3::new(-position.x, position.y, -position.z) } else { position };
    let places: Vec<Vec<DVec3>> =
        read.iter().flatten().map(|mesh| mesh.positions.iter().copied().map(place).collect()).collect();
    let vertex_of = joined(&places);
    let mut own = Mesh { parts: base.parts.iter().map(|part| part.name.clone()).collect(), ..Mesh::default() };
    let mut known = BTreeMap::new();
    for (t, (triangle, &part)) in base.triangles.iter().zip(&base.part_of_triangle).enumerate() {
        let first_corner = own.corners.len() as u32;
        own.faces.push(Face { line: 0, first_corner, corner_count: 3, part });
        for (i, &corner) in triangle.iter().enumerate() {
            let vertex = vertex_of[corner as usize];
            let uv = base.uv.get(t).map(|uv| {
                let uv = uv[i];
                *known.entry((vertex, uv.to_array().map(f32::to_bits))).or_insert_with(|| {
                    own.uv.push(uv);
                    own.uv.len() as u32 - 1
                })
            });
            own.corners.push(Corner { vertex, uv });
        }
    }
    let firsts: Vec<usize> = firsts(&vertex_of);
    own.position_lines = vec![0; firsts.len()];
    let names = wanted.iter().zip(&read).filter(|(_, mesh)| mesh.is_some()).map(|(name, _)| name.unwrap_or_default());
    let with = |places: &Vec<DVec3>| Mesh { positions: firsts.iter().map(|&v| places[v]).collect(), ..own.clone() };
    let meshes = names.map(str::to_owned).zip(places.iter().map(with)).collect();
    Some(Shapes { meshes, morphs })
}

/// Which vertex each one is, counted by first appearance, if those are one that lie at the same places in all shapes.
fn joined(places: &[Vec<DVec3>]) -> Vec<u32> {
    let count = places.first().map_or(0, Vec::len);
    let key = |v: usize| places.iter().flat_map(move |places| places[v].to_array().map(|n| (n + 0.0).to_bits()));
    let mut order: Vec<usize> = (0..count).collect();
    order.sort_by(|&a, &b| key(a).cmp(key(b)).then(a.cmp(&b)));
    let mut first: Vec<usize> = (0..count).collect();
    for pair in order.windows(2) {
        if key(pair[0]).eq(key(pair[1])) {
            first[pair[1]] = first[pair[0]];
        }
    }
    let (mut vertex_of, mut next) = (vec![0; count], 0);
    for v in 0..count {
        if first[v] == v {
            vertex_of[v] = next;
            next += 1;
        } else {
            vertex_of[v] = vertex_of[first[v]];
        }
    }
    vertex_of
}

/// Where each vertex appears first.
fn firsts(vertex_of: &[u32]) -> Vec<usize> {
    let mut firsts = Vec::new();
    for (place, &vertex) in vertex_of.iter().enumerate() {
        if vertex as usize == firsts.len() {
            firsts.push(place);
        }
    }
    firsts
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_files_of_gltf_have_morph_targets() {
        assert_eq!(parted("a/kimono.glb#arms/down #2"), ("a/kimono.glb", Some("arms/down #2")));
        assert_eq!(parted("kimono.GLTF#"), ("kimono.GLTF", Some("")));
        assert_eq!(parted("a#b.obj"), ("a#b.obj", None));
        assert_eq!(parted("kimono.glb"), ("kimono.glb", None));
    }

    #[test]
    fn vertices_are_one_that_never_part() {
        let at = |xs: [f64; 4]| xs.map(|x| DVec3::new(x, 0.0, 0.0)).to_vec();
        assert_eq!(joined(&[at([1.0, 0.0, 1.0, -0.0])]), [0, 1, 0, 1]);
        assert_eq!(joined(&[at([1.0, 0.0, 1.0, -0.0]), at([1.0, 0.0, 2.0, 0.0])]), [0, 1, 2, 1]);
    }
}
