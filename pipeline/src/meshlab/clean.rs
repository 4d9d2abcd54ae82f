//! One mesh in, the cleaned mesh out: the arrays go through a folder, `clean.py` does the rest. What comes back is held against what
//! went in before anybody sees it. Knows no file format but NPY.

use super::process::Ended;
use super::script::{self, array, indices, is_place};
use super::{CleanReport, MeshlabError};
use crate::source::clean_answer;
use crate::source::import::ImportedMesh;
use glam::DVec3;
use std::path::Path;
use std::time::Duration;

const SCRIPT: &str = include_str!("clean.py");
/// How a mesh is cleaned.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Settings {
    /// Vertices nearer to each other than this become one, metres.
    pub merge_m: f64,
    /// Pieces with a smaller share of the whole area are removed, 0 to 1.
    pub least_share: f64,
    /// Pieces with fewer triangles are removed. The largest piece always stays.
    pub least_triangles: u32,
    /// Borders up to this length are holes, longer ones are openings, metres. Neither is filled.
    pub hole_m: f64,
    /// How long it may take.
    pub limit: Duration,
}

impl Default for Settings {
    fn default() -> Settings {
        let limit = Duration::from_secs(120);
        Settings { merge_m: 1e-5, least_share: 0.005, least_triangles: 20, hole_m: 0.3, limit }
    }
}

/// A cleaned mesh, each part with where it came from.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Cleaned {
    /// Positions, metres, in the order of their sources.
    pub positions_m: Vec<DVec3>,
    /// Corners of the triangles, which face one way where the surface has two sides. They come in the order of the source triangle's
    /// corners, the last two exchanged where `is_turned`.
    pub triangles: Vec<[u32; 3]>,
    /// The vertex of the source of each vertex: of several merged ones the nearest; one twice where it was split.
    pub source_vertex: Vec<u32>,
    /// The triangle of the source of each triangle, ascending.
    pub source_triangle: Vec<u32>,
    /// Whether each triangle faces the other way than its source.
    pub is_turned: Vec<bool>,
    /// The border, as an index into the report's, on which each vertex lies.
    pub border_of_vertex: Vec<Option<u32>>,
    /// What was done.
    pub report: CleanReport,
}

impl Cleaned {
    /// Whether a vertex lies on a border.
    ///
    /// # Panics
    /// When there is no such vertex.
    #[must_use]
    pub fn is_border(&self, vertex: u32) -> bool {
        self.border_of_vertex[vertex as usize].is_some()
    }

    /// The cleaned mesh with texture coordinates, colours and parts of the mesh that was cleaned; in metres, axes as those that were
    /// cleaned.
    ///
    /// # Panics
    /// When this is not the mesh that was cleaned.
    #[must_use]
    pub fn carried(&self, source: &ImportedMesh) -> ImportedMesh {
        let of_triangles = || self.source_triangle.iter().map(|&triangle| triangle as usize);
        let uv = of_triangles().zip(&self.is_turned).filter(|_| !source.uv.is_empty());
        let colours = self.source_vertex.iter().filter(|_| !source.colours.is_empty());
        let parts = of_triangles().filter(|_| !source.part_of_triangle.is_empty());
        ImportedMesh {
            format: source.format,
            quad_count: 0,
            larger_count: 0,
            positions: self.positions_m.clone(),
            triangles: self.triangles.clone(),
            polygon_count: self.triangles.len(),
            uv: uv
                .map(|(i, turned)| {
                    let [a, b, c] = source.uv[i];
                    if *turned { [a, c, b] } else { [a, b, c] }
                })
                .collect(),
            colours: colours.map(|&vertex| source.colours[vertex as usize]).collect(),
            parts: source.parts.clone(),
            part_of_triangle: parts.map(|i| source.part_of_triangle[i]).collect(),
            morphs: source.morphs.clone(),
            texture: source.texture.clone(),
            unit_m: Some(1.0),
            axes: source.axes,
        }
    }
}

/// Cleans a mesh with the Python of an environment (see [`super::environment`]). The same mesh gives the same bytes.
///
/// # Errors
/// The mesh or the settings are beyond their limits; the process cannot be started, runs too long, dies or gives a wrong answer.
pub fn clean(
    python: &Path,
    positions_m: &[DVec3],
    triangles: &[[u32; 3]],
    settings: &Settings,
) -> Result<Cleaned, MeshlabError> {
    check_input(positions_m, triangles, settings).map_err(MeshlabError::Unfit)?;
    let temporary = std::env::temp_dir();
    let folder = tempfile::tempdir().map_err(|error| MeshlabError::io(&temporary, &error))?;
    let folder = folder.path();
    script::write_mesh(folder, positions_m, triangles)?;
    let Settings { merge_m, least_share, least_triangles, hole_m, limit } = *settings;
    let request = serde_json::json!({
        "folder": folder.to_string_lossy(), "merge_m": merge_m, "least_share": least_share, "least_triangles": least_triangles,
        "hole_m": hole_m,
    });
    let ended = script::run(python, folder, ("clean.py", SCRIPT), &request, limit)?;
    match ended.status {
        None => return Err(MeshlabError::TimedOut { limit }),
        Some(status) if status.success() => {}
        Some(_) => return Err(died(ended)),
    }
    let given = (positions_m.len(), triangles.len());
    cleaned(folder, given, &ended.stdout).map_err(|problem| MeshlabError::Answer { problem, tail: ended.tail })
}

fn check_input(positions_m: &[DVec3], triangles: &[[u32; 3]], settings: &Settings) -> Result<(), String> {
    let Settings { merge_m, least_share, hole_m, .. } = *settings;
    script::check_mesh(positions_m, triangles)?;
    let bounds = [
        ("merge distance", merge_m, 0.1),
        ("least share", least_share, 1.0),
        ("size of holes", hole_m, script::FARTHEST_M),
    ];
    match bounds.iter().find(|(_, value, most)| !(0.0..=*most).contains(value)) {
        Some((name, value, most)) => Err(format!("the {name} is {value}, not within 0 and {most}")),
        None => Ok(()),
    }
}

fn died(ended: Ended) -> MeshlabError {
    // What the loader says on Linux, macOS and Windows.
    let missing = ["cannot open shared object file", "Library not loaded", "DLL load failed"];
    match missing.iter().any(|words| ended.tail.contains(words)) {
        true => MeshlabError::SharedLibrary { tail: ended.tail },
        false => MeshlabError::Died { how: ended.how(), tail: ended.tail },
    }
}

/// Reads what the process gave back, trusting nothing.
fn cleaned(folder: &Path, (vertices, triangles): (usize, usize), stdout: &[u8]) -> Result<Cleaned, String> {
    let text = std::str::from_utf8(stdout).map_err(|_| "it is no text")?;
    let report = clean_answer::read(text)?;
    // A vertex that is left is a corner, and no triangle is new.
    let (most_vertices, most_triangles) = (3 * triangles, triangles);
    let numbers: Vec<f64> = array(folder, "cleaned_positions", "<f8", 3, most_vertices)?;
    let positions_m: Vec<DVec3> = numbers.chunks_exact(3).map(DVec3::from_slice).collect();
    let corners: Vec<i32> = array(folder, "cleaned_triangles", "<i4", 3, most_triangles)?;
    let source_vertex: Vec<i32> = array(folder, "source_vertex", "<i4", 1, most_vertices)?;
    let source_triangle: Vec<i32> = array(folder, "source_triangle", "<i4", 1, most_triangles)?;
    let turned: Vec<u8> = array(folder, "turned", "|u1", 1, most_triangles)?;
    let border: Vec<i32> = array(folder, "border", "<i4", 1, most_vertices)?;

    let (v, t) = (positions_m.len(), corners.len() / 3);
    if [source_vertex.len(), border.len(), report.after.vertices as usize] != [v; 3] {
        return Err("its arrays disagree on the number of vertices".to_owned());
    }
    if [source_triangle.len(), turned.len(), report.after.triangles as usize] != [t; 3] {
        return Err("its arrays disagree on the number of triangles".to_owned());
    }
    if positions_m.iter().any(|&p| !is_place(p)) {
        return Err("a position is no place".to_owned());
    }
    let triangles_out: Vec<[u32; 3]> =
        indices(&corners, v, "a corner")?.chunks_exact(3).map(|c| [c[0], c[1], c[2]]).collect();
    if triangles_out.iter().any(|[a, b, c]| a == b || b == c || c == a) {
        return Err("a triangle has one vertex twice".to_owned());
    }
    let source_vertex = indices(&source_vertex, vertices, "the source of a vertex")?;
    let source_triangle = indices(&source_triangle, triangles, "the source of a triangle")?;
    if !source_triangle.is_sorted_by(|a, b| a < b) || !source_vertex.is_sorted() {
        return Err("the sources do not ascend".to_owned());
    }
    if turned.iter().any(|&turned| turned > 1) {
        return Err("a triangle is neither turned nor not".to_owned());
    }
    if border.iter().any(|&border| border < -1 || border >= report.borders.len() as i32) {
        return Err("a vertex lies on a border that does not exist".to_owned());
    }
    Ok(Cleaned {
        positions_m,
        triangles: triangles_out,
        source_vertex,
        source_triangle,
        is_turned: turned.into_iter().map(|turned| turned == 1).collect(),
        border_of_vertex: border.into_iter().map(|border| u32::try_from(border).ok()).collect(),
        report,
    })
}
