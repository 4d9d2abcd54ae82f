//! `cargo xtask clean FILE --out FILE.ply`: a scan without floating pieces, duplicates and non-manifold places, and what was done to it.

use crate::places::{ended, in_workspace, say, write_whole};
use glam::DVec3;
use kitsuke_pipeline::diagnostic::{self, Format, Severity};
use kitsuke_pipeline::meshlab::{self, Cleaned, Settings, environment};
use kitsuke_pipeline::source::import::{ImportedMesh, Part, Picture};
use kitsuke_pipeline::source::obj;
use kitsuke_pipeline::source::units::LengthUnit;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::time::Duration;

/// Clean a scan: merge duplicates, remove floating pieces, mend non-manifold places, mark holes
///
/// Uses pymeshlab (GPL-3) in a process of its own; the first time it is installed into the cache (about 130 MB to load), for which Python
/// 3.10 to 3.14 is needed. Nothing is filled or invented. Writes PLY in metres, Y up, front +Z, each vertex with its border (-1: none) and
/// each triangle with the number it had in the file.
#[derive(clap::Args)]
pub struct Args {
    /// The scan (OBJ)
    file: PathBuf,
    /// The file's unit
    #[arg(long, value_parser = unit)]
    unit: Option<LengthUnit>,
    /// The file's axis that points up: x, -x, y, -y, z or -z
    #[arg(long, value_parser = axis, allow_hyphen_values = true)]
    up: Option<DVec3>,
    /// The file's axis that points to the wearer's front
    #[arg(long, value_parser = axis, allow_hyphen_values = true)]
    front: Option<DVec3>,
    /// The cleaned mesh
    #[arg(long, value_name = "FILE.ply")]
    out: PathBuf,
    /// Vertices nearer to each other than this become one, mm
    #[arg(long, value_name = "MM", default_value_t = 0.01)]
    merge_mm: f64,
    /// Pieces with a smaller share of the whole area are removed, percent
    #[arg(long, value_name = "PERCENT", default_value_t = 0.5)]
    least_percent: f64,
    /// Pieces with fewer triangles are removed
    #[arg(long, value_name = "N", default_value_t = 20)]
    least_triangles: u32,
    /// Borders up to this length are listed as holes, longer ones as openings, mm
    #[arg(long, value_name = "MM", default_value_t = 300.0)]
    hole_mm: f64,
    /// How long it may take, seconds
    #[arg(long, value_name = "S", default_value_t = 120)]
    limit: u64,
    /// Where pymeshlab is installed
    #[arg(long, value_name = "DIR", default_value_os_t = in_workspace("target/kitsuke-cache"))]
    cache: PathBuf,
}

/// Prints what was done; 1 when the file cannot be read or pymeshlab cannot be had.
pub fn run(args: Args) -> ExitCode {
    ended(cleaned(&args))
}

fn unit(text: &str) -> Result<LengthUnit, String> {
    let known = LengthUnit::ALL.into_iter().find(|unit| unit.name() == text);
    known.ok_or_else(|| format!("a unit is one of {}", LengthUnit::ALL.map(LengthUnit::name).join(", ")))
}

fn axis(text: &str) -> Result<DVec3, String> {
    let (sign, name) = text.strip_prefix('-').map_or((1.0, text.trim_start_matches('+')), |name| (-1.0, name));
    let axis = match name {
        "x" | "X" => DVec3::X,
        "y" | "Y" => DVec3::Y,
        "z" | "Z" => DVec3::Z,
        _ => return Err("an axis is x, -x, y, -y, z or -z".to_owned()),
    };
    Ok(sign * axis)
}

fn cleaned(args: &Args) -> Result<(), String> {
    let mesh = imported(&args.file)?;
    let file = args.file.display();
    let unit_m = args.unit.map(LengthUnit::metres).or(mesh.unit_m);
    let unit_m = unit_m.ok_or_else(|| format!("{file} does not say its unit: give it, for example --unit mm"))?;
    let up = args.up.or(mesh.axes.map(|axes| axes.up)).unwrap_or(DVec3::Y);
    let front = args.front.or(mesh.axes.map(|axes| axes.front)).unwrap_or(DVec3::Z);
    if up.dot(front) != 0.0 {
        return Err("up and front must be different axes".to_owned());
    }
    let left = up.cross(front);
    let place_m = |p: &DVec3| DVec3::new(p.dot(left), p.dot(up), p.dot(front)) * unit_m;
    let positions_m: Vec<DVec3> = mesh.positions.iter().map(place_m).collect();
    let python = environment::python(&args.cache, &|line| say!("{line}")).map_err(|error| error.to_string())?;
    let settings = Settings {
        merge_m: args.merge_mm * 1e-3,
        least_share: args.least_percent * 1e-2,
        least_triangles: args.least_triangles,
        hole_m: args.hole_mm * 1e-3,
        limit: Duration::from_secs(args.limit),
    };
    let cleaned =
        meshlab::clean(&python, &positions_m, &mesh.triangles, &settings).map_err(|error| error.to_string())?;
    say!("{}", table(&cleaned));
    write_whole(&args.out, |out| write_ply(&cleaned, &cleaned.carried(&mesh), out))?;
    say!("{}: metres, Y up, front +Z", args.out.display());
    Ok(())
}

/// Reads a mesh of any format that we read.
fn imported(path: &Path) -> Result<ImportedMesh, String> {
    let is_obj = path.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("obj"));
    if !is_obj {
        return Err(format!("{} is no OBJ, which is all that clean reads: save it as OBJ", path.display()));
    }
    let bytes = std::fs::read(path).map_err(|error| format!("cannot read {}: {error}", path.display()))?;
    let mut report = Vec::new();
    let name = path.file_name().unwrap_or_default().to_string_lossy();
    let mesh = obj::read(&name, &bytes, &mut report);
    let has_errors = report.iter().any(|diagnostic| diagnostic.severity == Severity::Error);
    let folder = path.parent().unwrap_or(Path::new("."));
    eprint!("{}", diagnostic::render(&diagnostic::sorted(report), folder, Format::Human { color: false }));
    let mesh = mesh.filter(|_| !has_errors).ok_or_else(|| format!("{} cannot be read", path.display()))?;
    let triangles = mesh.triangulate();
    let uv = triangles.corners.iter().filter(|_| mesh.is_textured());
    let parts = triangles.part_counts.iter().zip(0u32..);
    Ok(ImportedMesh {
        triangles: triangles.corners.iter().map(|corners| corners.map(|corner| corner.vertex)).collect(),
        uv: uv.map(|corners| corners.map(|c| c.uv.map_or(glam::Vec2::ZERO, |uv| mesh.uv[uv as usize]))).collect(),
        part_of_triangle: parts.flat_map(|(&count, part)| std::iter::repeat_n(part, count as usize)).collect(),
        parts: mesh.parts.iter().map(|name| Part { name: name.clone(), material: String::new() }).collect(),
        polygon_count: mesh.faces.len(),
        positions: mesh.positions,
        texture: None::<Picture>,
        ..ImportedMesh::default()
    })
}

/// How many of a list are printed.
const LISTED: usize = 12;

fn table(cleaned: &Cleaned) -> String {
    let report = &cleaned.report;
    let (before, after) = (report.before, report.after);
    let mut text = format!("{:<24}{:>12}{:>12}\n", "", "before", "after");
    let counts = [
        ("vertices", before.vertices, after.vertices),
        ("triangles", before.triangles, after.triangles),
        ("pieces", before.components, after.components),
        ("non-manifold edges", before.non_manifold_edges, after.non_manifold_edges),
        ("non-manifold vertices", before.non_manifold_vertices, after.non_manifold_vertices),
        ("borders", before.borders, after.borders),
    ];
    for (name, before, after) in counts {
        text += &format!("{name:<24}{before:>12}{after:>12}\n");
    }
    text += &format!("{:<24}{:>12.0}{:>12.0}\n", "borders, mm", before.border_m * 1e3, after.border_m * 1e3);
    text += &format!("{:<24}{:>12.4}{:>12.4}\n\n", "area, m²", before.area_m2, after.area_m2);
    let steps = report.steps;
    let changes = [
        ("vertices without triangles removed", steps.unused_vertices),
        ("vertices at one place merged", steps.exact_duplicates),
        ("vertices nearly at one place merged", steps.near_duplicates),
        ("triangles without area removed", steps.degenerate_triangles),
        ("triangles that were there twice removed", steps.duplicate_triangles),
        ("triangles at non-manifold edges removed", steps.non_manifold_triangles),
        ("vertices added where one held two sheets", steps.split_vertices),
        ("triangles turned over", report.turned_triangles),
    ];
    for (name, count) in changes {
        text += &format!("{count:>8} {name}\n");
    }
    let place = |[x, y, z]: [f64; 3]| format!("({x:.3}, {y:.3}, {z:.3}) m");
    let triangles: u64 = report.removed.iter().map(|bit| u64::from(bit.triangles)).sum();
    text += &format!("{:>8} floating pieces removed, {triangles} triangles in all\n", report.removed.len());
    for bit in report.removed.iter().take(LISTED) {
        text += &format!("{:>16} triangles, {:>8.2} cm² at {}\n", bit.triangles, bit.area_m2 * 1e4, place(bit.place_m));
    }
    text += &more(report.removed.len());
    for (is_hole, name) in [(false, "openings"), (true, "holes, which are left open")] {
        let borders: Vec<_> = report.borders.iter().filter(|border| border.is_hole == is_hole).collect();
        let length_mm = borders.iter().map(|border| border.length_m).sum::<f64>() * 1e3;
        text += &format!("{:>8} {name}, {length_mm:.0} mm in all\n", borders.len());
        for border in borders.iter().take(LISTED) {
            text += &format!(
                "{:>13.0} mm, {:>5} vertices, round {}\n",
                border.length_m * 1e3,
                border.vertices,
                place(border.place_m)
            );
        }
        text += &more(borders.len());
    }
    for warning in &report.warnings {
        text += &format!("warning: {warning}\n");
    }
    text
}

fn more(count: usize) -> String {
    match count.saturating_sub(LISTED) {
        0 => String::new(),
        more => format!("{:>16} more\n", format!("and {more}")),
    }
}

/// Binary PLY, little-endian.
fn write_ply(cleaned: &Cleaned, mesh: &ImportedMesh, out: &mut dyn Write) -> std::io::Result<()> {
    let has_colours = !mesh.colours.is_empty();
    let colours = if has_colours { "property uchar red\nproperty uchar green\nproperty uchar blue\n" } else { "" };
    write!(
        out,
        "ply\nformat binary_little_endian 1.0\ncomment metres, Y up, front +Z\nelement vertex {}\nproperty float x\nproperty float y\n\
         property float z\n{colours}property int border\nelement face {}\nproperty list uchar int vertex_indices\n\
         property int source_triangle\nend_header\n",
        mesh.positions.len(),
        mesh.triangles.len(),
    )?;
    for (i, position) in mesh.positions.iter().enumerate() {
        for coordinate in position.as_vec3().to_array() {
            out.write_all(&coordinate.to_le_bytes())?;
        }
        if has_colours {
            out.write_all(&mesh.colours[i])?;
        }
        let border = cleaned.border_of_vertex[i].map_or(-1, |border| border as i32);
        out.write_all(&border.to_le_bytes())?;
    }
    for (triangle, source) in mesh.triangles.iter().zip(&cleaned.source_triangle) {
        out.write_all(&[3])?;
        for number in triangle.iter().chain([source]) {
            out.write_all(&(*number as i32).to_le_bytes())?;
        }
    }
    Ok(())
}
