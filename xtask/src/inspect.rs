//! `cargo xtask inspect`: what is in a pack, and what the importer sees in a source file.

use crate::places::printed;
use crate::shots::{read, said};
use glam::DVec3;
use kitsuke::Pack;
use kitsuke::accessories::{Accessories, Texture};
use kitsuke::arrays::{Certificate, GarmentData, LeftOut, RbfLayer};
use kitsuke::arrays::{ChainJoint, Rbf};
use kitsuke::pack::layout::MAGIC;
use kitsuke_pipeline::diagnostic::Diagnostic;
use kitsuke_pipeline::source::{body, obj, tables};
use std::fmt::Write;
use std::fs::File;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

/// Say what is in a pack, or what the importer sees in a source file (obj, glb, csv)
#[derive(clap::Args)]
pub struct Args {
    /// The file
    file: PathBuf,
}

/// Prints the contents; 1 when the file cannot be read or is none of these.
pub fn run(args: Args) -> ExitCode {
    printed(inspect(&args.file))
}

fn inspect(path: &Path) -> Result<String, String> {
    let file = path.to_string_lossy();
    let kind = path.extension().map(|kind| kind.to_string_lossy().to_ascii_lowercase());
    let mut report = Vec::new();
    // A large scan is not held twice, as text and as mesh.
    if kind.as_deref() == Some("obj") {
        let mesh = File::open(path).and_then(|source| obj::read_from(&file, source, &mut report));
        let mesh = mesh.map_err(|error| format!("cannot read {file}: {error}"))?;
        let mesh = mesh.ok_or_else(|| said(&report))?;
        return Ok(problems(mesh_text(&mesh), &report));
    }
    let bytes = read(path)?;
    let text = match kind.as_deref() {
        _ if bytes.starts_with(&MAGIC) => {
            return Pack::open(&bytes)
                .map(|pack| pack_text(&pack, bytes.len()))
                .map_err(|error| format!("{file}: {error}"));
        }
        Some("glb") => body::read(&file, &bytes, &mut report).map(|body| body_text(&body)),
        Some("csv") => tables::read_rotations(&file, &bytes, &mut report).map(|table| table_text(&table)),
        _ => return Err(format!("{file} is neither a pack nor a source file that can be inspected (obj, glb, csv)")),
    };
    let text = text.ok_or_else(|| said(&report))?;
    Ok(problems(text, &report))
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
    text.push_str("\npart         triangles\n");
    for part in &data.mesh.parts {
        line!(text, part.name, "{:>9}", part.triangle_count);
    }
    let bones: Vec<&str> = data.skeleton.joints().iter().map(|joint| joint.bone.name()).collect();
    line!(text, "\nbones", "{}: {}", bones.len(), bones.join(", "));
    text
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

fn mesh_text(mesh: &obj::Mesh) -> String {
    let mut text = String::new();
    let (mut triangles, mut quads, mut larger) = (0, 0, 0);
    let mut in_part = vec![0; mesh.parts.len()];
    for face in &mesh.faces {
        *(match face.corner_count {
            3 => &mut triangles,
            4 => &mut quads,
            _ => &mut larger,
        }) += 1;
        in_part[face.part as usize] += 1;
    }
    let mut used = vec![false; mesh.positions.len()];
    mesh.corners.iter().for_each(|corner| used[corner.vertex as usize] = true);
    let unused = used.iter().filter(|used| !**used).count();
    line!(text, "vertices", "{}, {unused} of them in no face", mesh.positions.len());
    line!(text, "faces", "{}: {triangles} triangles, {quads} quads, {larger} larger", mesh.faces.len());
    let complete = if mesh.is_textured() { "every corner has one" } else { "not every corner has one" };
    line!(text, "uv", "{} texture coordinates, {complete}", mesh.uv.len());
    if mesh.normal_count > 0 {
        line!(text, "normals", "{} passed over: they are computed", mesh.normal_count);
    }
    for (part, (name, count)) in mesh.parts.iter().zip(in_part).enumerate() {
        line!(text, if part == 0 { "parts" } else { "" }, "{name}: {count} faces");
    }
    if let Some((encoding, line)) = mesh.names_read_as {
        line!(text, "names", "read as {encoding}, not UTF-8, first in line {line}");
    }
    extent(&mut text, mesh.positions.iter().copied());
    text
}

fn body_text(body: &kitsuke_pipeline::ir::Body) -> String {
    let mut text = String::new();
    line!(text, "vertices", "{}", body.surface.positions_m.len());
    line!(text, "triangles", "{}", body.surface.triangles.len());
    let bones: Vec<&str> = body.skeleton.joints().iter().map(|joint| joint.bone.name()).collect();
    line!(text, "bones", "{}: {}", bones.len(), bones.join(", "));
    extent(&mut text, body.surface.positions_m.iter().map(|p| p.as_dvec3()));
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

/// The box round the positions, and in which unit a garment or body of that size would be.
fn extent(text: &mut String, positions: impl Iterator<Item = DVec3>) {
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
