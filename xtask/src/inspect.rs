//! `cargo xtask inspect`: what is in a pack, and what the importer sees in a source file.

use crate::places::printed;
use crate::shots::{read, said};
use glam::DVec3;
use kitsuke::Pack;
use kitsuke::accessories::{Accessories, Texture};
use kitsuke::arrays::{Certificate, Compression, GarmentData, LeftOut, Loss, RbfLayer};
use kitsuke::arrays::{ChainJoint, Rbf};
use kitsuke::pack::layout::MAGIC;
use kitsuke_pipeline::diagnostic::Diagnostic;
use kitsuke_pipeline::source::import::{self, ImportedMesh, Picture};
use kitsuke_pipeline::source::{body, tables};
use std::fmt::Write;
use std::io::Read;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

/// Say what is in a pack, or what the importer sees in a source file (obj, ply, glb, gltf, vrm, fbx, csv)
#[derive(clap::Args)]
pub struct Args {
    /// The file
    file: PathBuf,
}

/// So many parts are listed.
const PARTS: usize = 40;

/// Prints the contents; 1 when the file cannot be read or is none of these.
pub fn run(args: Args) -> ExitCode {
    printed(inspect(&args.file))
}

fn inspect(path: &Path) -> Result<String, String> {
    let file = path.to_string_lossy();
    let kind = path.extension().map(|kind| kind.to_string_lossy().to_ascii_lowercase());
    let mut report = Vec::new();
    let is_pack = starts_with_magic(path);
    if is_pack || kind.as_deref() == Some("csv") {
        let bytes = read(path)?;
        if is_pack {
            let pack = Pack::open(&bytes).map_err(|error| format!("{file}: {error}"))?;
            return Ok(pack_text(&pack, bytes.len()));
        }
        let table = tables::read_rotations(&file, &bytes, &mut report).ok_or_else(|| said(&report))?;
        return Ok(problems(table_text(&table), &report));
    }
    let mesh = import::read(&file, path, &mut report).map_err(|error| format!("cannot read {file}: {error}"))?;
    let mesh = mesh.ok_or_else(|| said(&report))?;
    let mut text = mesh_text(&mesh);
    if mesh.format == import::Format::Gltf {
        let bytes = read(path)?;
        if body::has_skin(&bytes)
            && let Some(body) = body::read(&file, &bytes, &mut report)
        {
            text = format!("{text}\nbody\n{}\n", body_text(&body));
        }
    }
    Ok(problems(text, &report))
}

/// Whether a file begins as a pack.
fn starts_with_magic(path: &Path) -> bool {
    let mut start = Vec::new();
    let length = MAGIC.len() as u64;
    std::fs::File::open(path).and_then(|file| file.take(length).read_to_end(&mut start)).is_ok_and(|_| start == MAGIC)
}

fn problems(mut text: String, report: &[Diagnostic]) -> String {
    match report.is_empty() {
        true => text.push_str("problems     none seen\n"),
        false => _ = writeln!(text, "problems     {}\n{}", report.len(), said(report)),
    }
    text
}

/// `line!(text, "label", "format", …)`: a label in its column, then the rest.
macro_rules! line {
    ($text:ident, $label:expr, $($rest:tt)*) => {{
        write!($text, "{:<12} ", $label).expect("strings take everything");
        writeln!($text, $($rest)*).expect("strings take everything");
    }};
}

fn pack_text(pack: &Pack, bytes: usize) -> String {
    let garment = pack.garment();
    let data = garment.data();
    let mut text = String::new();
    let (major, minor) = pack.version();
    line!(text, "pack", "{} \"{}\", format {major}.{minor}, {bytes} bytes", data.id, data.name);
    let (unique, twins) = (garment.unique_count(), data.mesh.twin_of.len());
    line!(text, "mesh", "{unique} vertices, {twins} seam twins, {} triangles", garment.triangle_count());
    text.push_str(&accessories_text(pack));
    text.push_str("\nsection       stored   unpacked  ratio\n");
    for section in pack.sections() {
        let ratio = section.unpacked_length as f64 / section.stored_length.max(1) as f64;
        line!(
            text,
            section.tag.to_string(),
            "{:>7} {:>10} {ratio:>6.2}",
            section.stored_length,
            section.unpacked_length
        );
    }
    text.push_str("\ndriver           threshold  joints\n");
    for driver in &data.drivers {
        let joints: Vec<&str> = driver.joints.iter().map(|joint| joint.name()).collect();
        line!(text, driver.name, "{:>9.1} deg  {}", driver.threshold_rad.to_degrees(), joints.join(", "));
    }
    text.push_str("\nsegment      vertices  drivers\n");
    for (i, segment) in data.segments.iter().enumerate() {
        let drivers: Vec<&str> = segment.drivers.iter().map(|&d| data.drivers[usize::from(d)].name.as_str()).collect();
        let drivers = if drivers.is_empty() { "none".to_owned() } else { drivers.join(", ") };
        line!(text, i, "{:>8}  {drivers}", segment.vertex_count);
    }
    if data.corrective_count > 0 {
        line!(text, "\ncorrectives", "the last {} targets, between the samples", data.corrective_count);
    }
    text.push_str("\ntarget                        step um  vertices     bytes  segments\n");
    for target in &data.targets {
        let segments: Vec<String> = target.segments.iter().map(u16::to_string).collect();
        let (step_um, count) = (target.step_m * 1e6, target.deltas.len());
        let bytes = size_of_val(target.deltas.as_slice());
        let row = format!("{:<28} {step_um:>8.3} {count:>9} {bytes:>9}  {}\n", target.name, segments.join(" "));
        text.push_str(&row);
    }
    if let Some(rbf) = &data.rbf {
        text.push_str(&kernel_text(rbf));
    }
    if let Some(certificate) = &data.certificate {
        text.push_str(&certificate_text(certificate, data));
    }
    if let Some(compression) = &data.compression {
        text.push_str(&compression_text(compression, data));
    }
    text.push_str("\npart         triangles\n");
    for part in &data.mesh.parts {
        line!(text, part.name, "{:>9}", part.triangle_count);
    }
    let bones: Vec<&str> = data.skeleton.joints().iter().map(|joint| joint.bone.name()).collect();
    line!(text, "\nbones", "{}: {}", bones.len(), bones.join(", "));
    text
}

/// What the small numbers lost, as the pack says.
fn compression_text(compression: &Compression, data: &GarmentData) -> String {
    let mut text = String::from("\nlost, mm                         max       p99   above half\n");
    let mut row = |name: &str, Loss { max_m, p99_m, above_half }: Loss| {
        let (max_mm, p99_mm, share) = (1e3 * max_m, 1e3 * p99_m, 100.0 * above_half);
        text += &format!("{name:<28} {max_mm:>8.4}  {p99_mm:>8.4}  {share:>9.2} %\n");
    };
    for (target, &loss) in data.targets.iter().zip(&compression.targets) {
        row(&target.name, loss);
    }
    row(&format!("surface, {} poses", compression.poses), compression.surface);
    text + &format!("budget                       {:>8.4}\n", 1e3 * compression.budget_m)
}

fn accessories_text(pack: &Pack) -> String {
    let Accessories { body, texture, obi, paths } = pack.accessories();
    let mut text = String::new();
    if !body.is_empty() {
        line!(text, "made on", "{body}");
    }
    if let Some(Texture { name, size_px: [width, height], png }) = texture {
        let place = if png.is_empty() { "not in the pack".to_owned() } else { format!("{} bytes", png.len()) };
        line!(text, "texture", "{name}, {width} x {height} pixels, {place}");
    }
    if let Some(obi) = obi {
        line!(text, "obi", "{} vertices, {} triangles", obi.positions_m.len(), obi.triangles.len());
    }
    for path in paths {
        let length_cm = path.length_m(&pack.garment().data().mesh.positions_m) * 100.0;
        line!(text, "path", "{:<24} {length_cm:>7.2} cm  {}", path.name, path.ja);
    }
    text
}

fn mesh_text(mesh: &ImportedMesh) -> String {
    let mut text = String::new();
    let soundness = mesh.soundness();
    let (faces, quads, larger) = (mesh.polygon_count, mesh.quad_count, mesh.larger_count);
    line!(text, "format", "{}", mesh.format.name());
    line!(text, "vertices", "{} in the file's order, {} of them in no face", mesh.positions.len(), soundness.unused);
    line!(text, "faces", "{faces}: {} triangles, {quads} quads, {larger} larger", faces - quads - larger);
    let mut in_part = vec![0; mesh.parts.len()];
    mesh.part_of_triangle.iter().for_each(|&part| in_part[part as usize] += 1);
    for (number, (part, count)) in mesh.parts.iter().zip(in_part).enumerate().take(PARTS) {
        let material = if part.material.is_empty() { String::new() } else { format!(", material {}", part.material) };
        line!(text, if number == 0 { "parts" } else { "" }, "{}: {count} triangles{material}", part.name);
    }
    if mesh.parts.len() > PARTS {
        line!(text, "", "… and {} more", mesh.parts.len() - PARTS);
    }
    if !mesh.morphs.is_empty() {
        line!(text, "morphs", "{}: {}", mesh.morphs.len(), mesh.morphs.join(", "));
    }
    line!(text, "uv", "{}", if mesh.uv.is_empty() { "none" } else { "texture coordinates at the corners" });
    match &mesh.texture {
        Some(Picture::Named(name)) => line!(text, "texture", "{name}"),
        Some(Picture::Held(bytes)) => line!(text, "texture", "in the file, {} bytes", bytes.len()),
        None => line!(text, "texture", "none"),
    }
    if !mesh.colours.is_empty() {
        line!(text, "colours", "of vertices");
    }
    line!(text, "surface", "{} pieces, {} rims", soundness.components, soundness.border_loops);
    if soundness.degenerate + soundness.non_manifold_edges > 0 {
        let (flat, edges) = (soundness.degenerate, soundness.non_manifold_edges);
        line!(text, "", "{flat} triangles without area, {edges} edges of more than two triangles");
    }
    match mesh.axes {
        Some(axes) => line!(text, "axes", "up {}, front {}, by the file", axis(axes.up), axis(axes.front)),
        None => line!(text, "axes", "not said in the file"),
    }
    extent(&mut text, mesh.positions.iter().copied(), mesh.unit_m);
    text
}

/// For example `-Z`.
fn axis(direction: DVec3) -> String {
    let number = direction.abs().max_position();
    format!("{}{}", if direction[number] < 0.0 { '-' } else { '+' }, ["X", "Y", "Z"][number])
}

fn body_text(body: &kitsuke_pipeline::ir::Body) -> String {
    let mut text = String::new();
    line!(text, "vertices", "{}", body.surface.positions_m.len());
    line!(text, "triangles", "{}", body.surface.triangles.len());
    let bones: Vec<&str> = body.skeleton.joints().iter().map(|joint| joint.bone.name()).collect();
    line!(text, "bones", "{}: {}", bones.len(), bones.join(", "));
    extent(&mut text, body.surface.positions_m.iter().map(|p| p.as_dvec3()), None);
    text
}

fn table_text(table: &tables::PoseTable) -> String {
    let mut text = String::new();
    let bones: Vec<&str> = table.bones.iter().map(|bone| bone.name()).collect();
    line!(text, "bones", "{}: {}", bones.len(), bones.join(", "));
    line!(text, "rows", "{}", table.rows.len());
    for row in &table.rows {
        line!(text, "", "{:<28} {}", row.name, row.file);
    }
    text
}

/// The box round the positions, and the file's unit, or that in which a garment or body of that size would be.
fn extent(text: &mut String, positions: impl Iterator<Item = DVec3>, unit_m: Option<f64>) {
    let start = (DVec3::INFINITY, DVec3::NEG_INFINITY);
    let (least, most) = positions.fold(start, |(least, most), p| (least.min(p), most.max(p)));
    if !(least.is_finite() && most.is_finite()) {
        return;
    }
    let size = most - least;
    line!(text, "from", "{:.4} {:.4} {:.4}", least.x, least.y, least.z);
    line!(text, "to", "{:.4} {:.4} {:.4}", most.x, most.y, most.z);
    line!(text, "size", "{:.4} x {:.4} x {:.4}", size.x, size.y, size.z);
    // What people wear is between a child's sleeve and a train: 0.4 m to 4 m.
    let units = [("mm", 1e-3), ("cm", 1e-2), ("m", 1.0)];
    if let Some(unit_m) = unit_m {
        let same = |(_, metres): &&(&str, f64)| (unit_m / metres - 1.0).abs() < 1e-6;
        let name = units.iter().find(same).map_or_else(|| format!("{unit_m} m"), |(name, _)| (*name).to_owned());
        line!(text, "unit", "{name}, by the file");
        return;
    }
    let likely = units.iter().find(|(_, metres)| (0.4..4.0).contains(&(size.max_element() * metres)));
    line!(text, "unit", "{}", likely.map_or("neither mm, cm nor m looks likely", |(name, _)| *name));
}

fn kernel_text(rbf: &Rbf) -> String {
    let mut text = String::from("\nkernel\n");
    for (number, RbfLayer { groups, joint_width, reach, ridge, mirror_ridge }) in rbf.layers.iter().enumerate() {
        line!(
            text,
            "layer",
            "{number}: reach {reach:.3}, joint width {joint_width:.3}, ridge {ridge:.4}, mirrored {mirror_ridge:.3}"
        );
        for group in groups {
            let joint = |joint: &ChainJoint| format!("{} {:.3}/{:.3}", joint.bone.name(), joint.swing, joint.twist);
            let joints: Vec<String> = group.chain.iter().map(joint).collect();
            line!(text, group.name, "swing/twist {}", joints.join(", "));
        }
    }
    text
}

fn certificate_text(certificate: &Certificate, data: &GarmentData) -> String {
    let row = |row: u16| match usize::from(row).checked_sub(1) {
        Some(target) => data.targets[target].name.as_str(),
        None => "base",
    };
    let Certificate { speed_mm_per_deg, fastest_joint, step_mm, step_change_mm, nearest, .. } = certificate;
    let mut text = String::from("\ncertificate\n");
    let [first, second] = certificate.fastest_rows.map(row);
    line!(text, "speed", "{speed_mm_per_deg:.2} mm per degree of {}, near {first} and {second}", fastest_joint.name());
    line!(text, "steps", "{step_mm:.4} mm per 0.01 degrees, changing by {step_change_mm:.4} mm at most");
    let [first, second] = nearest.rows.map(row);
    line!(text, "nearest", "{first} and {second}, {:.1} degrees apart", nearest.apart_deg);
    if !certificate.left_out.is_empty() {
        text.push_str("\nleft out, mm                     mean      p99      max\n");
        for (target, error) in data.targets.iter().zip(&certificate.left_out) {
            let LeftOut { mean_mm, p99_mm, max_mm } = error;
            text.push_str(&format!("{:<28} {mean_mm:>8.2} {p99_mm:>8.1} {max_mm:>8.1}\n", target.name));
        }
    }
    text
}
