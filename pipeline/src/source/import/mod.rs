//! Meshes whose vertices need not be those of a base: scans, exports, dress forms, in any format we read. One file per
//! format; here is what they have in common. Knows no garment.

mod assembly;
mod fbx;
mod gltf;
mod obj;
mod placed;
mod ply;
mod soundness;

use super::obj::names;
use crate::diagnostic::{Diagnostic, Place};
use assembly::Assembly;
use glam::{DVec3, Vec2};
use std::io;
use std::path::Path;

pub use placed::{Placed, Said, Unplaced, placed};
pub use soundness::Soundness;

/// Longest file that is read, bytes.
const LONGEST: u64 = 2 << 30;
/// What is read, as it is said to people.
const READ: &str = "OBJ, PLY, GLB, glTF, VRM and FBX are read here";

/// A mesh as a file brings it: positions in the file's own order, unit and axes, polygons cut into triangles.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ImportedMesh {
    /// Of what kind the file is.
    pub format: Format,
    /// Positions in the file's unit and axes, in the file's order, nodes' transforms applied.
    pub positions: Vec<DVec3>,
    /// Corners of the triangles, each an index into `positions`.
    pub triangles: Vec<[u32; 3]>,
    /// How many polygons they were before they were cut.
    pub polygon_count: usize,
    /// How many of the polygons had four corners.
    pub quad_count: usize,
    /// How many had more than four.
    pub larger_count: usize,
    /// Texture coordinates of each triangle's corners, v upwards (0 at the picture's lowest row): one per triangle, or empty.
    pub uv: Vec<[Vec2; 3]>,
    /// Colours, sRGB: one per position, or empty.
    pub colours: Vec<[u8; 3]>,
    /// Groups, nodes, materials: what the file calls its parts, by first appearance.
    pub parts: Vec<Part>,
    /// The part of each triangle.
    pub part_of_triangle: Vec<u32>,
    /// Morph targets of a glTF file, by name or, where they have none, by number from 0; each once, by first appearance.
    pub morphs: Vec<String>,
    /// The base colour's picture.
    pub texture: Option<Picture>,
    /// Metres per unit, where the format or the file says so.
    pub unit_m: Option<f64>,
    /// Which way is up and which is front, where the format or the file says so.
    pub axes: Option<Axes>,
}

/// What is read.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Format {
    /// Wavefront OBJ, with its MTL beside it.
    #[default]
    Obj,
    /// PLY, text or binary.
    Ply,
    /// GLB, VRM, or glTF text.
    Gltf,
    /// FBX, text or binary.
    Fbx,
}

impl Format {
    /// As people know it.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Format::Obj => "OBJ",
            Format::Ply => "PLY",
            Format::Gltf => "glTF",
            Format::Fbx => "FBX",
        }
    }
}

/// What a file calls a part of its triangles.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct Part {
    /// Group, object, mesh or node.
    pub name: String,
    /// Its material, or nothing.
    pub material: String,
}

/// A picture that belongs to a mesh.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Picture {
    /// The name of a file, as the mesh's file writes it.
    Named(String),
    /// PNG or JPEG that the file holds.
    Held(Vec<u8>),
}

/// Axes of a file: which of its axes point up and to the front.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Axes {
    /// A unit vector along one axis.
    pub up: DVec3,
    /// A unit vector along another axis.
    pub front: DVec3,
}

/// What is wrong with a file, before anybody knows its name.
#[derive(Debug)]
struct Fault {
    code: &'static str,
    problem: String,
    help: String,
}

impl Fault {
    fn new(code: &'static str, problem: impl Into<String>, help: impl Into<String>) -> Fault {
        Fault { code, problem: problem.into(), help: help.into() }
    }

    fn said(self, file: &str, of: fn(&'static str, String, Place) -> Diagnostic) -> Diagnostic {
        of(self.code, file.to_owned(), Place::File).problem(self.problem).help(self.help)
    }
}

/// Reads a mesh of any kind that is known, by what the file holds and then by its name; data, materials and names of pictures may stand
/// in files beside it. What is wrong is reported, and nothing is returned where it cannot be mended.
///
/// # Errors
/// The file cannot be read.
pub fn read(file: &str, path: &Path, report: &mut Vec<Diagnostic>) -> io::Result<Option<ImportedMesh>> {
    let length = std::fs::metadata(path)?.len();
    if length > LONGEST {
        let problem = format!("the file has {length} bytes; at most {LONGEST} are read");
        report.push(Diagnostic::error("mesh-size", file, Place::File).problem(problem).help("Export a lighter mesh."));
        return Ok(None);
    }
    Ok(read_bytes(file, &std::fs::read(path)?, path.parent(), report))
}

/// Reads a mesh as [`read`] does from its bytes; without a folder all must lie inside them.
pub fn read_bytes(
    file: &str,
    bytes: &[u8],
    folder: Option<&Path>,
    report: &mut Vec<Diagnostic>,
) -> Option<ImportedMesh> {
    let mut warnings = Vec::new();
    let format = format(file, bytes);
    let mesh = format.and_then(|format| {
        let mesh = match format {
            Format::Obj => return Ok(obj::read(file, bytes, folder, report, &mut warnings).map(|mesh| (mesh, format))),
            Format::Ply => ply::read(bytes, &mut warnings),
            Format::Gltf => gltf::read(bytes, folder, &mut warnings),
            Format::Fbx => fbx::read(bytes, &mut warnings),
        };
        mesh.map(|mesh| Some((mesh, format)))
    });
    let mesh = match mesh {
        Ok(Some((mesh, format))) => ImportedMesh { format, ..mesh },
        Ok(None) => return None,
        Err(fault) => {
            report.push(fault.said(file, Diagnostic::error));
            return None;
        }
    };
    if mesh.positions.is_empty() {
        let fault = Fault::new(
            "mesh-empty",
            "the file has no vertices",
            "Export the mesh again, with what is to be seen selected.",
        );
        report.push(fault.said(file, Diagnostic::error));
        return None;
    }
    if mesh.triangles.is_empty() {
        let problem = format!("the file has {} vertices and no faces", mesh.positions.len());
        let help =
            "Make a surface of the points in the scanner's program (Poisson or ball pivoting), then export again.";
        warnings.push(Fault::new("mesh-faces", problem, help));
    }
    report.extend(warnings.into_iter().map(|warning| warning.said(file, Diagnostic::warning)));
    Some(mesh)
}

/// Reads a glTF file once for each of the `wanted` morph targets, with that one alone on, or with none on. A morph target that the file does
/// not have gives nothing. Returns the names of those that it has besides. All data must lie inside the file.
pub(super) fn read_morphs(
    file: &str,
    bytes: &[u8],
    wanted: &[Option<&str>],
    report: &mut Vec<Diagnostic>,
) -> Option<(Vec<Option<ImportedMesh>>, Vec<String>)> {
    let mut warnings = Vec::new();
    match gltf::read_morphs(bytes, wanted, &mut warnings) {
        Ok(read) => {
            report.extend(warnings.into_iter().map(|warning| warning.said(file, Diagnostic::warning)));
            Some(read)
        }
        Err(fault) => {
            report.push(fault.said(file, Diagnostic::error));
            None
        }
    }
}

/// Of what kind a file is.
fn format(file: &str, bytes: &[u8]) -> Result<Format, Fault> {
    let kind = Path::new(file).extension().map(|kind| kind.to_string_lossy().to_ascii_lowercase()).unwrap_or_default();
    let text = bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes).trim_ascii_start();
    let start = &text[..text.len().min(4096)];
    let has = |word: &[u8]| memchr::memmem::find(start, word).is_some();
    match start {
        _ if bytes.starts_with(b"glTF") => return Ok(Format::Gltf),
        _ if bytes.starts_with(b"ply\n") || bytes.starts_with(b"ply\r") => return Ok(Format::Ply),
        _ if bytes.starts_with(b"Kaydara FBX Binary") => return Ok(Format::Fbx),
        [b';', ..] if has(b"FBX") => return Ok(Format::Fbx),
        _ if start.starts_with(b"FBXHeaderExtension") => return Ok(Format::Fbx),
        [b'{', ..] if kind != "obj" => return Ok(Format::Gltf),
        _ => {}
    }
    let unread = |what: &str, help: &str| Err(Fault::new("mesh-format", format!("{what}; {READ}"), help));
    match kind.as_str() {
        "obj" => Ok(Format::Obj),
        "ply" | "fbx" | "glb" | "gltf" | "vrm" => {
            let problem = format!("the file is named .{kind}, but does not begin as one");
            unread(&problem, "Export it again; a file that came through mail or a chat may have been cut or repacked.")
        }
        _ if bytes.starts_with(b"PK\x03\x04") => unread(
            "the file is an archive (ZIP, or a project of Marvelous Designer or CLO)",
            "Unpack it, or open the project and choose File > Export > OBJ (or FBX).",
        ),
        "stl" => unread(
            "STL files have neither shared vertices nor texture",
            "Export as PLY or OBJ; MeshLab and Blender convert STL files and merge their vertices.",
        ),
        "mcx" | "xml" | "mc" | "pc2" | "mdd" | "abc" => unread(
            "the file holds how points move, not a mesh",
            "Export the shape itself, from Marvelous Designer or Maya as OBJ or FBX.",
        ),
        "zprj" | "zpac" | "avt" | "blend" | "max" | "ma" | "mb" | "c4d" | "ztl" | "usd" | "usdz" | "usda" | "usdc"
        | "dae" | "3ds" | "x3d" | "wrl" | "3mf" | "off" => {
            let problem = format!("files .{kind} are not read");
            unread(&problem, "Open it in its program, or in Blender, and export as OBJ, FBX or GLB.")
        }
        _ if is_obj(start) => Ok(Format::Obj),
        _ => unread("this is no mesh that is known", "Export the mesh as OBJ, PLY, GLB or FBX."),
    }
}

/// Whether a text begins with what only OBJ files have.
fn is_obj(start: &[u8]) -> bool {
    let is_known =
        |line: &[u8]| [b"v ".as_slice(), b"mtllib ", b"vt ", b"vn "].iter().any(|word| line.starts_with(word));
    start.split(|&byte| byte == b'\n').take(64).any(is_known)
}

/// Bytes of a name as text, in whatever encoding.
fn text(bytes: &[u8]) -> String {
    match names::decode(&[bytes]) {
        Ok(decoded) => decoded.names.into_iter().next().unwrap_or_default(),
        Err(_) => String::from_utf8_lossy(bytes).into_owned(),
    }
}

/// Says that polygons were passed over.
fn note_skipped(assembly: &Assembly, warnings: &mut Vec<Fault>) {
    if assembly.skipped > 0 {
        let problem = format!("{} faces have fewer than three corners and were passed over", assembly.skipped);
        warnings.push(Fault::new("mesh-faces", problem, "Nothing needs to be done: they are points and lines."));
    }
}

/// Of the pictures that parts' materials name, that of the most triangles; says so where there are several.
fn most_seen(
    assembly: &Assembly,
    picture_of: impl Fn(usize) -> Option<Picture>,
    warnings: &mut Vec<Fault>,
) -> Option<Picture> {
    let mut seen: Vec<(Picture, usize)> = Vec::new();
    for (part, count) in assembly.triangles_of_parts().into_iter().enumerate() {
        let Some(picture) = picture_of(part).filter(|_| count > 0) else { continue };
        match seen.iter_mut().find(|(known, _)| *known == picture) {
            Some((_, sum)) => *sum += count,
            None => seen.push((picture, count)),
        }
    }
    let most = seen.iter().map(|(_, count)| *count).max()?;
    let pictures = seen.len();
    let (picture, _) = seen.into_iter().find(|(_, count)| *count == most)?;
    if pictures > 1 {
        let problem = format!("the parts have {pictures} pictures; that of the most triangles is taken for all");
        let help = "Bake the colours into one picture if all are to be seen.";
        warnings.push(Fault::new("mesh-texture", problem, help));
    }
    Some(picture)
}
