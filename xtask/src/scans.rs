//! Scans as the verbs get them: a file of any kind we read, its unit and axes as the file or the command line says, metres out.

use crate::places::{Places, say};
use crate::registration_error::read_truth;
use glam::{DMat3, DVec3};
use kitsuke_pipeline::diagnostic::{self, Format, Severity};
use kitsuke_pipeline::ir;
use kitsuke_pipeline::meshlab::{self, Cleaned, Settings, environment};
use kitsuke_pipeline::source::import::{self, ImportedMesh, Picture, Placed, Said, Unplaced};
use kitsuke_pipeline::source::picture;
use kitsuke_pipeline::source::units::LengthUnit;
use kitsuke_pipeline::stages::register::{self, Registered};
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

/// A mesh of any kind we read, with its unit and axes, as options of a verb.
#[derive(clap::Args)]
pub struct MeshArgs {
    /// The mesh (OBJ, PLY, GLB, glTF, FBX)
    pub file: PathBuf,
    /// The file's unit, where the file does not say it
    #[arg(long, value_parser = unit)]
    unit: Option<LengthUnit>,
    /// The file's axis that points up: x, -x, y, -y, z or -z
    #[arg(long, value_parser = axis, allow_hyphen_values = true)]
    up: Option<DVec3>,
    /// The file's axis that points to the wearer's front
    #[arg(long, value_parser = axis, allow_hyphen_values = true)]
    front: Option<DVec3>,
}

/// A scan and how it is read and cleaned, as options of a verb.
#[derive(clap::Args)]
pub struct ScanArgs {
    #[command(flatten)]
    pub mesh: MeshArgs,
    /// A place of the base (metres, Y up) and the same in the scan (as its file counts); may be given several times
    #[arg(long, value_name = "X,Y,Z,X,Y,Z", value_parser = landmark, allow_hyphen_values = true)]
    landmark: Vec<[DVec3; 2]>,
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
    /// How long cleaning may take, seconds
    #[arg(long, value_name = "S", default_value_t = 120)]
    limit: u64,
    /// Where pymeshlab is installed
    #[arg(long, value_name = "DIR", default_value_os_t = crate::places::in_workspace("target/kitsuke-cache"))]
    pub cache: PathBuf,
}

/// A scan that was read.
pub struct Scan {
    /// As in the file.
    pub mesh: ImportedMesh,
    /// Its positions in metres, Y up, front +Z.
    pub positions_m: Vec<DVec3>,
    /// Whether the front is known.
    pub knows_front: bool,
    /// What takes places of the file there.
    pub metres_from_file: DMat3,
}

impl MeshArgs {
    /// A file whose axes are as it says, or Y up and the front +Z.
    pub fn of(file: &Path, unit: Option<LengthUnit>) -> MeshArgs {
        MeshArgs { file: file.to_owned(), unit, up: None, front: None }
    }

    /// Reads the file; what is wrong with it is printed or the error.
    pub fn read(&self) -> Result<Scan, String> {
        let mesh = imported(&self.file)?;
        let said = Said { unit: self.unit, up: self.up, front: self.front };
        let Placed { positions_m, knows_front, metres_from_file } = import::placed(&mesh, &said).map_err(|fault| {
            let help = match fault {
                Unplaced::NoUnit => "give it, for example --unit mm",
                Unplaced::OneAxis => "give two different ones, for example --up z --front -y",
            };
            format!("{}: {fault}: {help}", self.file.display())
        })?;
        Ok(Scan { mesh, positions_m, knows_front, metres_from_file })
    }
}

impl ScanArgs {
    /// Cleans it with pymeshlab.
    pub fn clean(&self, scan: &Scan) -> Result<Cleaned, String> {
        let python = environment::python(&self.cache, &environment::PYMESHLAB, &|line| say!("{line}"))
            .map_err(|error| error.to_string())?;
        let settings = Settings {
            merge_m: self.merge_mm * 1e-3,
            least_share: self.least_percent * 1e-2,
            least_triangles: self.least_triangles,
            hole_m: self.hole_mm * 1e-3,
            limit: Duration::from_secs(self.limit),
        };
        meshlab::clean(&python, &scan.positions_m, &scan.mesh.triangles, &settings).map_err(|error| error.to_string())
    }
}

/// A kimono, a scan, and the one laid onto the other.
pub struct Registration {
    pub garment: ir::Garment,
    /// The base's vertices, metres.
    pub base_m: Vec<DVec3>,
    /// The scan as it was cleaned.
    pub scan: register::Scan,
    /// The same with its colours, texture coordinates and parts.
    pub coloured: ImportedMesh,
    pub laid: Registered,
    /// The right shape, if it was asked for, metres.
    pub truth: Option<Vec<DVec3>>,
    /// How long laying on took, without reading and cleaning.
    pub seconds: f64,
}

/// Reads a kimono, a scan and the right shape, cleans the scan and lays the kimono's base onto it.
pub fn registration(places: &Places, id: &str, args: &ScanArgs, truth: Option<&Path>) -> Result<Registration, String> {
    let garment =
        places.source_with(id, &args.cache).ok_or_else(|| format!("{id} has mistakes: cargo xtask check {id}"))?;
    let base_m: Vec<DVec3> = garment.base.positions_m.iter().map(|p| p.as_dvec3()).collect();
    // Before anything long is computed.
    let truth = truth.map(|path| read_truth(path, base_m.len())).transpose()?;
    let read = args.mesh.read()?;
    let cleaned = args.clean(&read)?;
    let coloured = cleaned.carried(&read.mesh);
    let scan = register::Scan {
        positions_m: cleaned.positions_m,
        triangles: cleaned.triangles,
        knows_front: read.knows_front,
        landmarks: args.landmark.iter().map(|&[base_m, scan]| (base_m, read.metres_from_file * scan)).collect(),
    };
    let started = Instant::now();
    let laid = register::register(&base_m, &garment.base.triangles, &scan, &register::Settings::default());
    let laid = laid.map_err(|error| error.to_string())?;
    Ok(Registration { garment, base_m, scan, coloured, laid, truth, seconds: started.elapsed().as_secs_f64() })
}

/// The picture of a scan: in the file, or a file beside it or in a folder there.
pub fn picture_of(file: &Path, mesh: &ImportedMesh) -> Result<Option<image::RgbImage>, String> {
    const LONGEST: u64 = 1 << 30;
    let decoded = |name: String, bytes: &[u8]| match picture::decode(bytes) {
        Ok(image) => Ok(Some(image.into_rgb8())),
        Err(problem) => Err(format!("{name}: {problem}")),
    };
    match &mesh.texture {
        None => Ok(None),
        Some(Picture::Held(bytes)) => decoded(format!("the picture in {}", file.display()), bytes),
        Some(Picture::Named(name)) => {
            // Programs write the paths of the machine they ran on: the name alone may lie beside the file.
            let name = name.replace('\\', "/");
            let folder = file.parent().unwrap_or(Path::new(""));
            let last = name.rsplit('/').next().unwrap_or_default();
            let stays = Path::new(&name).components().all(|part| matches!(part, std::path::Component::Normal(_)));
            let names = stays.then_some(name.as_str()).into_iter().chain([last]);
            let path = names.map(|name| folder.join(name)).find(|path| path.is_file());
            let path = path.ok_or_else(|| {
                format!("{} names the picture {name}, which does not lie beside it: put it there", file.display())
            })?;
            let cannot = |error: std::io::Error| format!("cannot read {}: {error}", path.display());
            let length = std::fs::metadata(&path).map_err(cannot)?.len();
            if length > LONGEST {
                return Err(format!("{} has {length} bytes; at most {LONGEST} are read", path.display()));
            }
            decoded(path.display().to_string(), &std::fs::read(&path).map_err(cannot)?)
        }
    }
}

/// A unit of length by its name.
pub fn unit(text: &str) -> Result<LengthUnit, String> {
    let known = LengthUnit::ALL.into_iter().find(|unit| unit.name() == text);
    known.ok_or_else(|| format!("a unit is one of {}", LengthUnit::ALL.map(LengthUnit::name).join(", ")))
}

fn landmark(text: &str) -> Result<[DVec3; 2], String> {
    let numbers: Vec<f64> = text.split(',').filter_map(|part| part.trim().parse().ok()).collect();
    match numbers[..] {
        [a, b, c, d, e, f] => Ok([DVec3::new(a, b, c), DVec3::new(d, e, f)]),
        _ => Err("a landmark is six numbers: x,y,z of the base and x,y,z of the scan".to_owned()),
    }
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

fn imported(path: &Path) -> Result<ImportedMesh, String> {
    let mut report = Vec::new();
    let name = path.file_name().unwrap_or_default().to_string_lossy();
    let mesh = import::read(&name, path, &mut report);
    let mesh = mesh.map_err(|error| format!("cannot read {}: {error}", path.display()))?;
    let has_errors = report.iter().any(|diagnostic| diagnostic.severity == Severity::Error);
    let folder = path.parent().unwrap_or(Path::new("."));
    eprint!("{}", diagnostic::render(&diagnostic::sorted(report), folder, Format::Human { color: false }));
    mesh.filter(|_| !has_errors).ok_or_else(|| format!("{} cannot be read", path.display()))
}
