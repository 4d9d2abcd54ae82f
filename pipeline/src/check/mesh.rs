//! Whether one mesh is sound by itself: faces, vertices, texture coordinates, parts.

use super::{NamedMesh, gaps};
use crate::diagnostic::{Diagnostic, Place};
use crate::source::causes::Causes;
use crate::source::obj::Corner;
use glam::Vec2;
use kitsuke::arrays::limits;

/// Triangles smaller than this times the square of their longest side have no usable normal.
const LEAST_RELATIVE_AREA: f64 = 1e-6;

/// Reports what is wrong with the base or the obi.
pub(super) fn check(NamedMesh { file, mesh }: NamedMesh<'_>, report: &mut Vec<Diagnostic>) {
    if mesh.faces.is_empty() {
        report.push(
            Diagnostic::error("no-faces", file, Place::File)
                .problem("the mesh has no faces")
                .help("Export the surface, not points or lines."),
        );
        return;
    }
    let mut causes = Causes::default();
    for face in &mesh.faces {
        let mut vertices: Vec<u32> = mesh.corners_of(face).iter().map(|corner| corner.vertex).collect();
        vertices.sort_unstable();
        if let Some(pair) = vertices.windows(2).find(|pair| pair[0] == pair[1]) {
            let problem = format!("the face uses vertex {} twice", pair[0] + 1);
            causes.add("repeated-vertex", problem.clone(), || {
                Diagnostic::error("repeated-vertex", file, Place::Line(face.line))
                    .problem(problem)
                    .help("Remove degenerate faces in the base, then export base and targets again.")
            });
        }
    }
    let triangles = mesh.triangulate();
    for (corners, &face) in triangles.corners.iter().zip(&triangles.faces) {
        let [a, b, c] = corners.map(|corner| mesh.positions[corner.vertex as usize]);
        let longest = (b - a).length_squared().max((c - b).length_squared()).max((a - c).length_squared());
        let vertices = corners.map(|corner| corner.vertex + 1);
        let is_repeated = vertices[0] == vertices[1] || vertices[1] == vertices[2] || vertices[2] == vertices[0];
        if !is_repeated && (b - a).cross(c - a).length() <= LEAST_RELATIVE_AREA * longest {
            let [a, b, c] = vertices;
            let problem = format!("the triangle of vertices {a}, {b} and {c} has no area");
            causes.add("zero-area", problem.clone(), || {
                Diagnostic::warning("zero-area", file, Place::Line(mesh.faces[face as usize].line))
                    .problem(problem)
                    .help("Its shading will be wrong; merge its vertices in the base, then export base and targets again.")
            });
        }
    }
    let mut used = vec![false; mesh.positions.len()];
    for corner in &mesh.corners {
        used[corner.vertex as usize] = true;
    }
    for vertex in used.iter().enumerate().filter(|(_, used)| !**used).map(|(vertex, _)| vertex) {
        let problem = format!("vertex {} belongs to no face", vertex + 1);
        causes.add("isolated-vertex", "", || {
            Diagnostic::error("isolated-vertex", file, Place::Line(mesh.position_lines[vertex])).problem(problem).help(
                "Delete loose vertices, or export the piece whose they are, too; then export base and targets again.",
            )
        });
    }
    causes.report("place", report);
    for gap in gaps::find(mesh) {
        let names: Vec<String> = gap.iter().map(|vertex| (vertex + 1).to_string()).collect();
        let (last, others) = names.split_last().expect("gaps have three or four vertices");
        report.push(
            Diagnostic::warning("lost-face", file, Place::Line(mesh.position_lines[gap[0] as usize]))
                .problem(format!("between vertices {} and {last} a face seems to be missing", others.join(", ")))
                .help(
                    "Compare the number of faces that `cargo xtask inspect` says with that of the program that made the garment; \
                     if it should be closed there, close it or export all shapes again.",
                ),
        );
    }
    if let Some((encoding, line)) = mesh.names_read_as {
        report.push(
            Diagnostic::warning("names-encoding", file, Place::Line(line))
                .problem(format!("the names of the pieces are not UTF-8; read as {encoding} they are {}", mesh.parts.join(", ")))
                .help("If they read wrongly, save the file in UTF-8, or give the pieces names of letters A to Z and digits."),
        );
    }
    let is_far = |uv: &&Vec2| uv.abs().max_element() > limits::UV;
    if let Some(uv) = mesh.uv.iter().find(is_far) {
        report.push(
            Diagnostic::error("uv-range", file, Place::File)
                .problem(format!("a texture coordinate lies at {:.1}, {:.1}, beyond {}", uv.x, uv.y, limits::UV))
                .help("Export texture coordinates from 0 to 1, not in millimetres (Marvelous Designer: Unified UV Coordinates)."),
        );
    }
    let is_bare = |corner: &Corner| corner.uv.is_none();
    if mesh.corners.iter().any(|corner| corner.uv.is_some())
        && let Some(face) = mesh.faces.iter().find(|face| mesh.corners_of(face).iter().any(is_bare))
    {
        report.push(
            Diagnostic::error("partial-uv", file, Place::Line(face.line))
                .problem("this face has no texture coordinates, but others have")
                .help("Unwrap all pieces, or export without texture coordinates."),
        );
    }
    let is_unusable = |name: &String| name.len() > limits::NAME_BYTES || name.contains(char::is_control);
    if mesh.parts.len() > limits::PARTS || mesh.parts.iter().any(is_unusable) {
        report.push(
            Diagnostic::error("parts", file, Place::File)
                .problem(format!(
                    "the mesh has {} groups, or one whose name is too long or has control characters",
                    mesh.parts.len()
                ))
                .help(format!("Use at most {} groups: one per piece of cloth.", limits::PARTS)),
        );
    }
}

/// The edges of triangles, lesser vertex first, sorted, each once.
pub(super) fn edges(triangles: &[[u32; 3]]) -> Vec<[u32; 2]> {
    let edge = |a: u32, b: u32| [a.min(b), a.max(b)];
    let mut edges: Vec<[u32; 2]> =
        triangles.iter().flat_map(|&[a, b, c]| [edge(a, b), edge(b, c), edge(c, a)]).collect();
    edges.sort_unstable();
    edges.dedup();
    edges
}
