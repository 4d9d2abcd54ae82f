//! Texture coordinates for a mesh that has none, by xatlas in a process of its own: charts and their packing. The mesh's vertices keep
//! their numbers: what xatlas splits are texture coordinates alone. Knows no file format but NPY.

use super::MeshlabError;
use super::script::{self, array, indices};
use glam::{DVec2, DVec3, Vec2};
use std::path::Path;
use std::time::Duration;

const SCRIPT: &str = include_str!("atlas.py");
/// Widest and highest atlas that may come back, pixels.
const SIDE_PX: u64 = 1 << 16;

/// How texture coordinates are made.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AtlasSettings {
    /// The size of texture for which charts are packed, pixels.
    pub size_px: u32,
    /// Space between charts, pixels.
    pub padding_px: u32,
    /// How long it may take.
    pub limit: Duration,
}

impl Default for AtlasSettings {
    fn default() -> AtlasSettings {
        AtlasSettings { size_px: 2048, padding_px: 8, limit: Duration::from_secs(300) }
    }
}

/// Texture coordinates of a mesh.
#[derive(Clone, Debug, PartialEq)]
pub struct Atlas {
    /// Coordinates, 0 to 1, u and v to one scale.
    pub uv: Vec<Vec2>,
    /// The coordinates of each triangle's corners, in the order of the mesh.
    pub uv_triangles: Vec<[u32; 3]>,
    /// The vertex of each coordinate.
    pub vertex_of_uv: Vec<u32>,
    /// How many charts.
    pub charts: usize,
    /// Charts that are mirrored: their area is negative.
    pub mirrored: usize,
    /// The share of the square that triangles cover.
    pub covered: f64,
    /// Width of the square in metres of cloth, by the areas of all triangles; how many texels a metre gets is their count by this.
    pub side_m: f64,
}

/// Makes texture coordinates with the Python of an environment (see [`super::environment`]). The same mesh gives the same bytes.
///
/// # Errors
/// The mesh or the settings are beyond their limits; xatlas is not there; the process cannot be started, runs too long, dies or gives a
/// wrong answer.
pub fn atlas(
    python: &Path,
    positions_m: &[DVec3],
    triangles: &[[u32; 3]],
    settings: &AtlasSettings,
) -> Result<Atlas, MeshlabError> {
    let AtlasSettings { size_px, padding_px, limit } = *settings;
    script::check_mesh(positions_m, triangles).map_err(MeshlabError::Unfit)?;
    if !(16..=16_384).contains(&size_px) || padding_px > size_px / 8 {
        let problem = format!(
            "a texture of {size_px} pixels with {padding_px} between charts: 16 to 16384 it may have, and an eighth of that between"
        );
        return Err(MeshlabError::Unfit(problem));
    }
    let temporary = std::env::temp_dir();
    let folder = tempfile::tempdir().map_err(|error| MeshlabError::io(&temporary, &error))?;
    let folder = folder.path();
    script::write_mesh(folder, positions_m, triangles)?;
    let request =
        serde_json::json!({ "folder": folder.to_string_lossy(), "padding_px": padding_px, "size_px": size_px });
    let ended = script::run(python, folder, ("atlas.py", SCRIPT), &request, limit)?;
    let problem = match ended.status {
        None => format!("took longer than {} s and was ended", limit.as_secs_f64()),
        Some(status) if status.success() => match made(folder, positions_m, triangles, &ended.stdout) {
            Ok(atlas) => return Ok(atlas),
            Err(problem) => format!("gave a wrong answer: {problem}"),
        },
        Some(_) if ended.tail.contains("No module named 'xatlas'") => return Err(MeshlabError::NoXatlas),
        Some(_) => format!("ended with {}", ended.how()),
    };
    Err(MeshlabError::Atlas { problem, tail: ended.tail })
}

/// Reads what the process gave back, trusting nothing.
fn made(folder: &Path, positions_m: &[DVec3], triangles: &[[u32; 3]], stdout: &[u8]) -> Result<Atlas, String> {
    let answer: serde_json::Value = serde_json::from_slice(stdout).map_err(|error| error.to_string())?;
    let side = |name: &str| answer[name].as_u64().filter(|side| (1..=SIDE_PX).contains(side)).map(|side| side as f64);
    let (Some(width), Some(height)) = (side("width_px"), side("height_px")) else {
        return Err("it has no size".to_owned());
    };
    let most = 3 * triangles.len();
    let source: Vec<i32> = array(folder, "source_vertex", "<i4", 1, most)?;
    let corners: Vec<i32> = array(folder, "uv_triangles", "<i4", 3, triangles.len())?;
    let numbers: Vec<f64> = array(folder, "uv", "<f8", 2, most)?;
    let chart: Vec<i32> = array(folder, "chart", "<i4", 1, most)?;
    let vertex_of_uv = indices(&source, positions_m.len(), "the vertex of a coordinate")?;
    let uv_triangles: Vec<[u32; 3]> =
        indices(&corners, source.len(), "a corner")?.chunks_exact(3).map(|c| [c[0], c[1], c[2]]).collect();
    if [numbers.len() / 2, chart.len()] != [source.len(); 2] {
        return Err("its arrays disagree on the number of coordinates".to_owned());
    }
    let is_same = |(made, given): (&[u32; 3], &[u32; 3])| made.map(|i| vertex_of_uv[i as usize]) == *given;
    if uv_triangles.len() != triangles.len() || !uv_triangles.iter().zip(triangles).all(is_same) {
        return Err("its triangles are not those of the mesh".to_owned());
    }
    let uv_px: Vec<DVec2> = numbers.chunks_exact(2).map(DVec2::from_slice).collect();
    let largest = width.max(height);
    if uv_px.iter().any(|uv| !uv.is_finite() || uv.min_element() < 0.0 || uv.max_element() > largest) {
        return Err("a coordinate lies outside the atlas".to_owned());
    }
    // Triangles without area lie in no chart.
    let charts = chart.iter().max().map_or(0, |&last| (last + 1).max(0) as usize);
    if charts > triangles.len() {
        return Err("it has more charts than triangles".to_owned());
    }
    let mut area_of_chart = vec![0.0; charts];
    let (mut area_px, mut area_m2) = (0.0, 0.0);
    for (uv, vertices) in uv_triangles.iter().zip(triangles) {
        let [a, b, c] = uv.map(|i| uv_px[i as usize]);
        let signed = (b - a).perp_dot(c - a) / 2.0;
        area_px += signed.abs();
        if let Ok(chart) = usize::try_from(chart[uv[0] as usize]) {
            area_of_chart[chart] += signed;
        }
        let [a, b, c] = vertices.map(|v| positions_m[v as usize]);
        area_m2 += (b - a).cross(c - a).length() / 2.0;
    }
    if area_px <= 0.0 {
        return Err("its triangles have no area".to_owned());
    }
    Ok(Atlas {
        uv: uv_px.iter().map(|uv| (*uv / largest).as_vec2()).collect(),
        uv_triangles,
        vertex_of_uv,
        charts,
        mirrored: area_of_chart.iter().filter(|area| **area < 0.0).count(),
        covered: area_px / (largest * largest),
        side_m: (area_m2 / area_px).sqrt() * largest,
    })
}
