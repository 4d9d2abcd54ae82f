//! What the cleaning of a mesh answers (`meshlab/clean.py`), as one JSON object: read, and held within bounds. Knows no process.

use serde::Deserialize;

/// What a cleaning did.
#[derive(Clone, Debug, Default, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CleanReport {
    /// The mesh as it came.
    pub before: Figures,
    /// The mesh as it was given back.
    pub after: Figures,
    /// What each step changed.
    pub steps: Steps,
    /// Triangles that face the other way than in the file, of those that are left.
    pub turned_triangles: u32,
    /// Floating pieces that were removed, the largest first.
    pub removed: Vec<Removed>,
    /// The borders that are left, the longest first.
    pub borders: Vec<Border>,
    /// What the user should know.
    pub warnings: Vec<String>,
}

/// A mesh in figures.
#[derive(Clone, Copy, Debug, Default, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Figures {
    /// Vertices, used or not.
    pub vertices: u32,
    /// Triangles.
    pub triangles: u32,
    /// Pieces that hang together by vertices.
    pub components: u32,
    /// Edges of more than two triangles.
    pub non_manifold_edges: u32,
    /// Vertices, of those on no such edge, whose triangles are several fans.
    pub non_manifold_vertices: u32,
    /// Borders: what hangs together by edges of one triangle.
    pub borders: u32,
    /// Length of all borders, metres.
    pub border_m: f64,
    /// Area, square metres.
    pub area_m2: f64,
}

/// What the steps changed, in their order.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Steps {
    /// Vertices without triangles, removed.
    pub unused_vertices: u32,
    /// Vertices merged with another at exactly their place.
    pub exact_duplicates: u32,
    /// Vertices merged with another nearer than the distance of the settings.
    pub near_duplicates: u32,
    /// Triangles removed because two corners were one, or because they had no area.
    pub degenerate_triangles: u32,
    /// Triangles removed because another has the same corners.
    pub duplicate_triangles: u32,
    /// Triangles removed so that no edge has more than two.
    pub non_manifold_triangles: u32,
    /// Vertices added where one held several fans of triangles.
    pub split_vertices: u32,
}

/// A floating piece that was removed.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Removed {
    /// Its triangles.
    pub triangles: u32,
    /// Its area, square metres.
    pub area_m2: f64,
    /// The mean of its vertices, metres.
    pub place_m: [f64; 3],
}

/// A border of the cleaned mesh.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Border {
    /// Its length, metres.
    pub length_m: f64,
    /// Its vertices.
    pub vertices: u32,
    /// The mean of its vertices, metres.
    pub place_m: [f64; 3],
    /// Whether it is so short that it is a hole, not an opening such as a hem; see the settings.
    pub is_hole: bool,
}

/// Reads an answer.
///
/// # Errors
/// What is wrong with it.
pub fn read(text: &str) -> Result<CleanReport, String> {
    let report: CleanReport = serde_json::from_str(text).map_err(|error| error.to_string())?;
    let figures = [report.before, report.after].into_iter().flat_map(|f| [f.border_m, f.area_m2]);
    let sizes = report.removed.iter().map(|bit| bit.area_m2).chain(report.borders.iter().map(|border| border.length_m));
    if figures.chain(sizes).any(|size| !(0.0..f64::MAX).contains(&size)) {
        return Err("a length or an area is below zero or has no bounds".to_owned());
    }
    Ok(report)
}
