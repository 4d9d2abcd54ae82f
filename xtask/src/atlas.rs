//! `cargo xtask atlas FILE.obj --out FILE.obj`: texture coordinates for a mesh that has none, or its own packed into one square.

use crate::places::{ended, say, write_whole};
use glam::{DVec3, Vec2};
use kitsuke_pipeline::diagnostic::{self, Format, Severity};
use kitsuke_pipeline::meshlab::{self, AtlasSettings, environment};
use kitsuke_pipeline::source::import::{self, ImportedMesh};
use kitsuke_pipeline::source::obj::{self, Mesh};
use kitsuke_pipeline::source::units::LengthUnit;
use kitsuke_pipeline::stages::pack_islands::{self, pack};
use std::collections::BTreeMap;
use std::fmt::Write;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

/// Give an OBJ texture coordinates (xatlas), or pack those that it has
///
/// Vertices stay as they are, line by line, so that targets and masks by vertex still fit. Without --pack-only charts are made anew by
/// xatlas, in the environment of `clean`. With it the islands of the file are laid side by side: never scaled against each other, never
/// mirrored, and turned only where --may-turn allows it.
#[derive(clap::Args)]
pub struct Args {
    /// The mesh (OBJ)
    file: PathBuf,
    /// The mesh with its new texture coordinates
    #[arg(long, value_name = "FILE.obj")]
    out: PathBuf,
    /// Pack the islands that the file has
    #[arg(long)]
    pack_only: bool,
    /// Islands may be turned by a quarter; then the grain of the cloth runs differently in them
    #[arg(long, requires = "pack_only")]
    may_turn: bool,
    /// Width and height of the texture, pixels
    #[arg(long, value_name = "PX", default_value_t = 2048, value_parser = clap::value_parser!(u32).range(16..=16384))]
    size_px: u32,
    /// Space between islands, pixels
    #[arg(long, value_name = "PX", default_value_t = 8)]
    padding_px: u32,
    /// The file's unit, for what is said of pixels per metre
    #[arg(long, value_parser = crate::scans::unit, default_value = "m")]
    unit: LengthUnit,
    /// How long xatlas may take, seconds
    #[arg(long, value_name = "S", default_value_t = 300)]
    limit: u64,
    /// Where xatlas is installed
    #[arg(long, value_name = "DIR", default_value_os_t = crate::places::in_workspace("target/kitsuke-cache"))]
    cache: PathBuf,
}

/// Writes the mesh; 1 when it cannot be read or laid out.
pub fn run(args: Args) -> ExitCode {
    ended(laid_out(&args))
}

fn laid_out(args: &Args) -> Result<(), String> {
    let file = args.file.display();
    let bytes = std::fs::read(&args.file).map_err(|error| format!("cannot read {file}: {error}"))?;
    if bytes.starts_with(&[0xff, 0xfe]) || bytes.starts_with(&[0xfe, 0xff]) {
        return Err(format!("{file} is UTF-16 text: save it as UTF-8"));
    }
    let name = args.file.file_name().unwrap_or_default().to_string_lossy();
    let mut report = Vec::new();
    let mesh = import::read_bytes(&name, &bytes, None, &mut report).filter(|mesh| mesh.format == import::Format::Obj);
    let polygons = mesh.as_ref().and_then(|_| obj::read(&name, &bytes, &mut Vec::new()));
    // Materials are not asked for, so that of warnings only those of the reader of garments count; errors are said.
    report.retain(|diagnostic| diagnostic.severity == Severity::Error);
    let folder = args.file.parent().unwrap_or(Path::new("."));
    eprint!("{}", diagnostic::render(&diagnostic::sorted(report), folder, Format::Human { color: false }));
    let (Some(mesh), Some(polygons)) = (mesh, polygons) else { return Err(format!("{file} cannot be read as OBJ")) };
    let cut: usize = polygons.faces.iter().map(|face| face.corner_count as usize - 2).sum();
    if cut != mesh.triangles.len() || mesh.positions.len() != polygons.positions.len() {
        return Err(format!("{file} has faces that cannot be cut into triangles"));
    }
    let uv = if args.pack_only { packed(args, &mesh)? } else { unwrapped(args, &mesh)? };
    let (text, split) = rewritten(&bytes, &polygons, &mesh, &uv);
    if split > 0 {
        say!("{split} polygons are written as triangles, because a cut goes through them");
    }
    write_whole(&args.out, |out| out.write_all(&text))
}

/// New charts.
fn unwrapped(args: &Args, mesh: &ImportedMesh) -> Result<Vec<[Vec2; 3]>, String> {
    let python = environment::python(&args.cache, &environment::PYMESHLAB, &|line| say!("{line}"))
        .map_err(|error| error.to_string())?;
    let positions_m: Vec<DVec3> = mesh.positions.iter().map(|&p| p * args.unit.metres()).collect();
    let settings = AtlasSettings {
        size_px: args.size_px,
        padding_px: args.padding_px,
        limit: std::time::Duration::from_secs(args.limit),
    };
    let atlas = meshlab::atlas(&python, &positions_m, &mesh.triangles, &settings).map_err(|error| error.to_string())?;
    say!(
        "{} charts, {} of them mirrored; {} texture coordinates of {} vertices; {:.0} % of the square; {:.0} pixels per metre",
        atlas.charts,
        atlas.mirrored,
        atlas.uv.len(),
        mesh.positions.len(),
        100.0 * atlas.covered,
        f64::from(args.size_px) / atlas.side_m
    );
    Ok(atlas.uv_triangles.iter().map(|corners| corners.map(|i| atlas.uv[i as usize])).collect())
}

/// The file's own islands.
fn packed(args: &Args, mesh: &ImportedMesh) -> Result<Vec<[Vec2; 3]>, String> {
    if mesh.uv.is_empty() {
        return Err(format!(
            "{} has no texture coordinates to pack; without --pack-only they are made",
            args.file.display()
        ));
    }
    let margin = f64::from(args.padding_px) / f64::from(args.size_px);
    let settings = pack_islands::Settings { margin, may_turn: args.may_turn };
    let packed = pack(&mesh.triangles, &mesh.uv, &settings).map_err(|error| error.to_string())?;
    let area: f64 = mesh
        .triangles
        .iter()
        .map(|t| {
            let [a, b, c] = t.map(|v| mesh.positions[v as usize] * args.unit.metres());
            (b - a).cross(c - a).length() / 2.0
        })
        .sum();
    say!(
        "{} islands, {} of them mirrored; {:.0} % of the square; {:.0} pixels per metre; all lengths times {:.4}",
        packed.islands,
        packed.mirrored.len(),
        100.0 * packed.covered,
        f64::from(args.size_px) * (packed.covered / area.max(f64::MIN_POSITIVE)).sqrt(),
        packed.scale
    );
    Ok(packed.uv)
}

/// The file with these coordinates of its triangles' corners: `vt`, `vn` and `f` lines are new, all others as they were. Polygons stay
/// whole where their triangles agree; how many do not.
fn rewritten(bytes: &[u8], polygons: &Mesh, mesh: &ImportedMesh, uv: &[[Vec2; 3]]) -> (Vec<u8>, usize) {
    let mut known: BTreeMap<(u32, [u32; 2]), usize> = BTreeMap::new();
    let (mut coordinates, mut split, mut first) = (String::new(), 0, 0);
    let mut faces: BTreeMap<u32, String> = BTreeMap::new();
    for face in &polygons.faces {
        let count = face.corner_count as usize - 2;
        let mut of_vertex: BTreeMap<u32, Vec<usize>> = BTreeMap::new();
        let mut triangles = String::new();
        for i in first..first + count {
            triangles += "f";
            for (&vertex, uv) in mesh.triangles[i].iter().zip(uv[i]) {
                let next = known.len() + 1;
                let number = *known.entry((vertex, uv.to_array().map(f32::to_bits))).or_insert(next);
                if number == next {
                    _ = writeln!(coordinates, "vt {:.7} {:.7}", uv.x, uv.y);
                }
                _ = write!(triangles, " {}/{number}", vertex + 1);
                of_vertex.entry(vertex).or_default().push(number);
            }
            triangles += "\n";
        }
        first += count;
        let agree = of_vertex.values().all(|numbers| numbers.iter().all(|number| *number == numbers[0]));
        let text = faces.entry(face.line).or_default();
        if agree && count > 1 {
            text.push('f');
            for corner in polygons.corners_of(face) {
                _ = write!(text, " {}/{}", corner.vertex + 1, of_vertex[&corner.vertex][0]);
            }
            text.push('\n');
        } else {
            split += usize::from(count > 1);
            *text += &triangles;
        }
    }
    let mut out = Vec::with_capacity(bytes.len() + coordinates.len());
    let (mut coordinates, mut goes_on) = (Some(coordinates), false);
    for (line, number) in bytes.split_inclusive(|&byte| byte == b'\n').zip(1_u32..) {
        let text = line.trim_ascii();
        // A line that goes on behind `\` goes where its beginning goes.
        let is_new = goes_on
            || [b"vt".as_slice(), b"vn", b"f"].iter().any(|word| {
                text.strip_prefix(*word).is_some_and(|rest| rest.first().is_some_and(u8::is_ascii_whitespace))
            });
        if let Some(face) = faces.get(&number) {
            out.extend(coordinates.take().unwrap_or_default().into_bytes());
            out.extend(face.as_bytes());
        }
        if !is_new {
            out.extend(line);
        }
        goes_on = is_new && text.ends_with(b"\\");
    }
    (out, split)
}
