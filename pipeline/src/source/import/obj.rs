//! OBJ with what the reader of garments passes over: materials, their pictures, colours of vertices. Geometry is read by that reader; the
//! few other lines in a second pass over the bytes.

use super::assembly::Assembly;
use super::{Fault, ImportedMesh, Picture, text};
use crate::diagnostic::{Diagnostic, Place};
use crate::source::obj::Mesh;
use glam::Vec2;
use std::path::{Path, PathBuf};

/// Longest material library, bytes.
const LONGEST_MTL: u64 = 16 << 20;
/// Most material libraries of one file.
const LIBRARIES: usize = 16;

/// What stands between the lines that the reader of garments reads.
#[derive(Default)]
struct Extras {
    /// Line and name of each `usemtl`.
    materials: Vec<(u32, Vec<u8>)>,
    /// What `mtllib` names.
    libraries: Vec<Vec<u8>>,
    /// Three numbers behind a `v` line's own, or nothing.
    colours: Vec<Option<[f32; 3]>>,
    /// Colours that ZBrush writes in comments, in the order of the vertices.
    painted: Vec<[u8; 3]>,
}

/// Reads a mesh.
pub(super) fn read(
    file: &str,
    bytes: &[u8],
    folder: Option<&Path>,
    report: &mut Vec<Diagnostic>,
    warnings: &mut Vec<Fault>,
) -> Option<ImportedMesh> {
    let (decoded, has_holes);
    let bytes = match bytes {
        [0xff, 0xfe, ..] | [0xfe, 0xff, ..] => {
            (decoded, _, has_holes) = encoding_rs::UTF_8.decode(bytes);
            if has_holes { bytes } else { decoded.as_bytes() }
        }
        _ => bytes,
    };
    let mesh = crate::source::obj::read(file, bytes, report)?;
    if let Some((encoding, line)) = mesh.names_read_as {
        let problem = format!("the names are read as {encoding}, not UTF-8, first in line {line}");
        warnings.push(Fault::new("mesh-names", problem, "Nothing needs to be done if the parts' names look right."));
    }
    let extras = extras(bytes, &mesh);
    match assembled(&mesh, &extras, folder, file, warnings) {
        Ok(mesh) => Some(mesh),
        Err(problem) => {
            let help = "Export the mesh again; every number must be finite.";
            report.push(Diagnostic::error("mesh-obj", file, Place::File).problem(problem).help(help));
            None
        }
    }
}

fn assembled(
    mesh: &Mesh,
    extras: &Extras,
    folder: Option<&Path>,
    file: &str,
    warnings: &mut Vec<Fault>,
) -> Result<ImportedMesh, String> {
    let mut assembly = Assembly::default();
    let colours = colours(extras, mesh.positions.len());
    for (vertex, (position, line)) in mesh.positions.iter().zip(&mesh.position_lines).enumerate() {
        assembly
            .position(*position, colours.get(vertex).copied().flatten(), || format!("the vertex of line {line}"))?;
    }
    let names: Vec<String> = extras.materials.iter().map(|(_, name)| text(name)).collect();
    let mut materials = extras.materials.iter().zip(&names).peekable();
    let mut material = "";
    let mut known: Option<(u32, u32)> = None;
    for face in &mesh.faces {
        while let Some((_, name)) = materials.next_if(|((line, _), _)| *line < face.line) {
            material = name;
            known = None;
        }
        // Names are looked up where they change, not at every face.
        let part = match known.filter(|(own, _)| *own == face.part) {
            Some((_, part)) => part,
            None => assembly.part(&mesh.parts[face.part as usize], material)?,
        };
        known = Some((face.part, part));
        let corners = mesh.corners_of(face);
        let vertices: Vec<u32> = corners.iter().map(|corner| corner.vertex).collect();
        let uv: Option<Vec<Vec2>> = corners.iter().map(|corner| Some(mesh.uv[corner.uv? as usize])).collect();
        assembly.polygon(&vertices, uv.as_deref(), part, || format!("the face of line {}", face.line))?;
    }
    let pictures = pictures(extras, folder, file, warnings);
    let picture = |part: usize| {
        let material = &assembly.parts()[part].material;
        pictures.iter().find(|(name, _)| name == material).map(|(_, picture)| Picture::Named(picture.clone()))
    };
    let texture = super::most_seen(&assembly, picture, warnings);
    Ok(ImportedMesh { texture, ..assembly.finish() })
}

fn extras(bytes: &[u8], mesh: &Mesh) -> Extras {
    let mut extras = Extras::default();
    let mut vertex_lines = mesh.position_lines.iter().copied().enumerate().peekable();
    for (line, number) in bytes.split(|&byte| byte == b'\n').zip(1_u32..) {
        if let Some((vertex, _)) = vertex_lines.next_if(|(_, own)| *own == number) {
            if let Some(colour) = trailing(line) {
                extras.colours.resize(mesh.positions.len(), None);
                extras.colours[vertex] = Some(colour);
            }
            continue;
        }
        let line = line.trim_ascii();
        if let Some(rest) = statement(line, b"usemtl") {
            extras.materials.push((number, rest.to_vec()));
        } else if let Some(rest) = statement(line, b"mtllib") {
            extras.libraries.push(rest.to_vec());
        } else if let Some(rest) = line.strip_prefix(b"#MRGB ") {
            let hex = |eight: &[u8; 8]| u32::from_str_radix(std::str::from_utf8(eight).ok()?, 16).ok();
            let colour = |packed: u32| [16, 8, 0].map(|shift| (packed >> shift) as u8);
            extras.painted.extend(rest.as_chunks::<8>().0.iter().map_while(hex).map(colour));
        }
    }
    extras
}

/// What follows a keyword. Comments cannot be told from names, which may have any character.
fn statement<'a>(line: &'a [u8], keyword: &[u8]) -> Option<&'a [u8]> {
    let rest = line.strip_prefix(keyword)?;
    (rest.is_empty() || rest[0].is_ascii_whitespace()).then(|| rest.trim_ascii())
}

/// The three numbers behind the three of a position.
fn trailing(line: &[u8]) -> Option<[f32; 3]> {
    let line = line.split(|&byte| byte == b'#').next().unwrap_or_default();
    let mut words = line.split(u8::is_ascii_whitespace).filter(|word| !word.is_empty()).skip(4);
    let mut number = || std::str::from_utf8(words.next()?).ok()?.parse::<f32>().ok().filter(|n| n.is_finite());
    Some([number()?, number()?, number()?])
}

/// Colours in 8 bits; some programs write shares of 1, others of 255.
fn colours(extras: &Extras, count: usize) -> Vec<Option<[u8; 3]>> {
    if extras.colours.is_empty() {
        let is_whole = extras.painted.len() >= count;
        return if is_whole { extras.painted.iter().copied().map(Some).collect() } else { Vec::new() };
    }
    let largest = extras.colours.iter().flatten().flatten().fold(0.0_f32, |largest, share| largest.max(*share));
    let full = if largest > 1.0 { 1.0 } else { 255.0 };
    let channel = |share: f32| (share * full).round().clamp(0.0, 255.0) as u8;
    extras.colours.iter().map(|colour| colour.map(|shares| shares.map(channel))).collect()
}

/// Materials of the libraries with the pictures of their colours.
fn pictures(extras: &Extras, folder: Option<&Path>, file: &str, warnings: &mut Vec<Fault>) -> Vec<(String, String)> {
    let mut pictures = Vec::new();
    let Some(folder) = folder else { return pictures };
    for library in extras.libraries.iter().take(LIBRARIES) {
        let name = text(library);
        // Renamed meshes keep the name of a file that was renamed too.
        let renamed = || beside(folder, &Path::new(file).with_extension("mtl").file_name()?.to_string_lossy());
        let Some(path) = beside(folder, &name).or_else(renamed) else {
            let problem =
                format!("the materials' file {name} is not beside this one, so that its pictures are not known");
            warnings.push(Fault::new(
                "mesh-materials",
                problem,
                "Copy it beside the mesh, or say which picture to use.",
            ));
            continue;
        };
        let bytes = path.metadata().is_ok_and(|metadata| metadata.len() <= LONGEST_MTL).then(|| std::fs::read(&path));
        match bytes {
            Some(Ok(bytes)) => read_library(&bytes, &mut pictures),
            _ => {
                let problem = format!("the materials' file {name} cannot be read");
                warnings.push(Fault::new("mesh-materials", problem, "Export the mesh again with its materials."));
            }
        }
    }
    pictures
}

/// A file that lies beside the mesh or below, whatever path another machine had: `C:\work\base.mtl` is `base.mtl`.
fn beside(folder: &Path, name: &str) -> Option<PathBuf> {
    let name = name.trim_matches('"').replace('\\', "/");
    let is_below = !name.starts_with('/') && !name.contains(':') && name.split('/').all(|part| part != "..");
    let last = name.rsplit('/').next().unwrap_or_default();
    let places = [is_below.then(|| folder.join(&name)), (!last.is_empty()).then(|| folder.join(last))];
    places.into_iter().flatten().find(|place| place.is_file())
}

fn read_library(bytes: &[u8], pictures: &mut Vec<(String, String)>) {
    let mut material: Option<String> = None;
    let bytes = bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes);
    for line in bytes.split(|&byte| byte == b'\n') {
        let line = line.trim_ascii();
        if let Some(name) = statement(line, b"newmtl") {
            material = Some(text(name));
        } else if let (Some(rest), Some(material)) = (statement(line, b"map_Kd"), &material) {
            let picture = without_options(&text(rest));
            if !picture.is_empty() && pictures.iter().all(|(known, _)| known != material) {
                pictures.push((material.clone(), picture));
            }
        }
    }
}

/// The name of a picture without the options before it, such as `-s 1 1 1`. Names may have blanks.
fn without_options(rest: &str) -> String {
    let mut words: Vec<&str> = rest.split(' ').filter(|word| !word.is_empty()).collect();
    let values = |option: &str| match option {
        "-blendu" | "-blendv" | "-cc" | "-clamp" | "-imfchan" | "-texres" | "-bm" | "-boost" | "-type" => Some((1, 1)),
        "-mm" => Some((2, 2)),
        // One to three numbers.
        "-o" | "-s" | "-t" => Some((1, 3)),
        _ => None,
    };
    while let Some((least, most)) = words.first().and_then(|word| values(word)) {
        let is_number = |word: &&&str| word.parse::<f32>().is_ok();
        let numbers = words[1..].iter().take(most).take_while(is_number).count();
        let taken = 1 + numbers.max(least);
        if taken >= words.len() {
            return String::new();
        }
        words.drain(..taken);
    }
    match words.first() {
        // Where there was no option the name stands as it is, blanks and all.
        Some(first) if rest.starts_with(first) => rest.trim().trim_matches('"').to_owned(),
        Some(_) => words.join(" ").trim_matches('"').to_owned(),
        None => String::new(),
    }
}
