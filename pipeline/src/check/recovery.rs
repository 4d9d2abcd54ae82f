//! Puts exports whose vertices stand in another order than the base's into its order, and says once per file what was done; or why it
//! could not be. Knows not how vertices are found again.

use super::correspondence::{self, Evidence, Lost, Recovered};
use super::grouped;
use crate::diagnostic::{Diagnostic, Place};
use crate::source::obj::Mesh;
use rayon::prelude::*;
use std::collections::BTreeMap;

/// Puts the named meshes in the base's order; gives why not, by file, for those that cannot be.
pub(super) fn recover(
    base_file: &str,
    files: &[String],
    meshes: &mut BTreeMap<String, Mesh>,
    report: &mut Vec<Diagnostic>,
) -> BTreeMap<String, Lost> {
    let Some(base) = meshes.get(base_file) else { return BTreeMap::new() };
    let others: Vec<(&String, &Mesh)> =
        files.iter().filter(|file| *file != base_file).filter_map(|file| Some((file, meshes.get(file)?))).collect();
    let found: Vec<(&String, &Mesh, Result<Recovered, Lost>)> = others
        .par_iter()
        .filter(|(_, mesh)| !correspondence::is_in_order(base, mesh))
        .map(|(file, mesh)| (*file, *mesh, correspondence::recover(base, mesh)))
        .collect();
    if is_base_alone(base, &others, &found) {
        return BTreeMap::new();
    }
    let (mut lost, mut recovered) = (BTreeMap::new(), Vec::new());
    for (file, mesh, result) in found {
        match result {
            Ok(found) => {
                report.push(said(base_file, base, file, mesh, &found));
                recovered.push((file.clone(), found.mesh));
            }
            Err(reason) => {
                lost.insert(file.clone(), reason);
            }
        }
    }
    meshes.extend(recovered);
    lost
}

/// Whether the base alone is not welded, and nothing but the order speaks for the others: then the base should be exported again, because
/// its numbers are wrong in the paths, too.
fn is_base_alone(
    base: &Mesh,
    others: &[(&String, &Mesh)],
    found: &[(&String, &Mesh, Result<Recovered, Lost>)],
) -> bool {
    let count = |mesh: &Mesh| (mesh.positions.len(), mesh.faces.len());
    let by_texture =
        |result: &Result<Recovered, Lost>| result.as_ref().is_ok_and(|found| found.evidence == Evidence::Texture);
    let [(_, first), _, ..] = others else { return false };
    found.len() == others.len()
        && others.iter().all(|(_, mesh)| count(mesh) == count(first))
        && first.positions.len() < base.positions.len()
        && !found.iter().any(|(_, _, result)| by_texture(result))
}

fn said(base_file: &str, base: &Mesh, file: &str, mesh: &Mesh, found: &Recovered) -> Diagnostic {
    let (has, wants) = (mesh.positions.len(), base.positions.len());
    let (has_text, wants_text) = (grouped(has), grouped(wants));
    let is_renumbered = found.vertex_of.iter().zip(0..).any(|(&vertex, number)| vertex != number);
    let differs = match has.cmp(&wants) {
        std::cmp::Ordering::Greater => {
            format!("{has_text} vertices where {base_file} has {wants_text}, because pieces are not welded here")
        }
        std::cmp::Ordering::Less => {
            format!("{has_text} vertices where {base_file} has {wants_text}, because pieces are welded here")
        }
        _ if is_renumbered => format!("the vertices stand in another order than in {base_file}"),
        _ => format!("the vertices are those of {base_file}, but polygons are cut otherwise"),
    };
    let by = match found.evidence {
        Evidence::Texture => "the texture coordinates",
        Evidence::Faces => "the faces, which stand in the base's order",
        Evidence::Vertices => "the order within each piece, and all faces agree",
    };
    Diagnostic::warning("recovered", file, Place::File)
        .problem(format!("{differs}; which is which was recovered from {by}"))
        .help("Nothing needs to be done. Exported with the settings of the base (Weld, quads or triangles, one object), files need no recovery.")
}

/// What a reason adds to the message about a file: the rest of a sentence, if it says more, and what to do.
pub(super) fn explained(lost: &Lost) -> Option<(String, &'static str)> {
    Some(match lost {
        Lost::OtherFaces | Lost::OtherLengths(_) => return None,
        Lost::NoTexture => (
            "without texture coordinates nothing tells which vertex is which".to_owned(),
            "Export base and targets with texture coordinates: by them the order is recovered. Or export with the settings of the base.",
        ),
        Lost::OtherTexture(count) => (
            format!(
                "{} places in the texture are nowhere in the base's, so that they do not tell which vertex is which",
                grouped(*count)
            ),
            "Export base and targets with the same texture coordinates (the same Unified UV Coordinates setting), or with the same Weld setting.",
        ),
        Lost::Overlapping(count) => (
            format!(
                "{} places in the texture are those of several vertices, because pieces overlap there",
                grouped(*count)
            ),
            "Lay the pieces side by side in the texture, or name them (groups) alike in all files, or export with the settings of the base.",
        ),
        Lost::Torn { vertex, parts: [a, b], apart } => (
            format!(
                "{a} and {b} are torn apart: the two copies of vertex {} of the base lie {apart:.3} apart, in the file's unit",
                vertex + 1
            ),
            "Look whether a seam is open or a piece was moved alone, let the simulation come to rest, and export again.",
        ),
        Lost::Merged([a, b]) => (
            format!("vertices {} and {} of the base, which lie apart, are one here", a + 1, b + 1),
            "Export without merging vertices by distance (Weld joins only what is sewn).",
        ),
    })
}
