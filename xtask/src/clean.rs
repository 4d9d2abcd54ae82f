//! `cargo xtask clean FILE --out FILE.ply`: a scan without floating pieces, duplicates and non-manifold places, and what was done to it.

use crate::places::{ended, say, write_whole};
use crate::scans::ScanArgs;
use kitsuke_pipeline::meshlab::Cleaned;
use kitsuke_pipeline::source::import::ImportedMesh;
use std::io::Write;
use std::path::PathBuf;
use std::process::ExitCode;

/// Clean a scan: merge duplicates, remove floating pieces, mend non-manifold places, mark holes
///
/// Uses pymeshlab (GPL-3) in a process of its own; the first time it is installed into the cache (about 130 MB to load), for which Python
/// 3.10 to 3.14 is needed. Nothing is filled or invented. Writes PLY in metres, Y up, front +Z, each vertex with its border (-1: none) and
/// each triangle with the number it had in the file.
#[derive(clap::Args)]
pub struct Args {
    #[command(flatten)]
    scan: ScanArgs,
    /// The cleaned mesh
    #[arg(long, value_name = "FILE.ply")]
    out: PathBuf,
}

/// Prints what was done; 1 when the file cannot be read or pymeshlab cannot be had.
pub fn run(args: Args) -> ExitCode {
    ended(cleaned(&args))
}

fn cleaned(args: &Args) -> Result<(), String> {
    let scan = args.scan.mesh.read()?;
    let cleaned = args.scan.clean(&scan)?;
    say!("{}", table(&cleaned));
    write_whole(&args.out, |out| write_ply(&cleaned, &cleaned.carried(&scan.mesh), out))?;
    say!("{}: metres, Y up, front +Z", args.out.display());
    Ok(())
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
