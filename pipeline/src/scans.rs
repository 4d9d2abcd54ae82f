//! Sizes that are scans: each is cleaned, the base is laid onto it, and it stands on its own wearer's shoulders. From then on it is a
//! shape like any other, vertex by vertex. Knows no check and no pack.

use crate::diagnostic::{Diagnostic, Place};
use crate::memo::{Key, Memo};
use crate::meshlab::{self, MeshlabError, environment};
use crate::source::folder::Folder;
use crate::source::import::{self, Placed, Unplaced};
use crate::source::manifest::{self, Field, Up};
use crate::source::sizes::{SizeRow, SizeTable};
use crate::source::units::LengthUnit;
use crate::source::{Source, in_metres, obj};
use crate::stages::register::{self, Registered, Rigid};
use glam::DVec3;
use kitsuke::skeleton::Bone;
use std::cell::OnceCell;
use std::path::Path;

/// Cloth within this of these joints rests on the shoulders, metres.
const SHOULDER_M: f64 = 0.12;
const SHOULDERS: [Bone; 2] = [Bone::LeftUpperArm, Bone::RightUpperArm];
/// A scan is laid on well when 80 % of it lie nearer to the cloth than this, metres.
const NEAR_M: f64 = 0.004;
/// And when at least this share of the cloth that a scanner can see was seen.
const SEEN: f64 = 0.7;

/// What to do where pymeshlab is not to be had.
const ELSEWHERE: &str = "Build the kimono on a machine that has it; or lay the base onto its scans there (cargo xtask register) and name the OBJ that comes out \
                         in the size table.";

/// Where scans are cleaned.
#[derive(Clone, Copy)]
pub struct Workshop<'a> {
    /// The cache: pymeshlab is installed in it, and what was laid on once is kept in it.
    pub cache: &'a Path,
    /// Told what takes long.
    pub tell: &'a (dyn Fn(&str) + Sync),
}

/// A scan as it was laid on, and how well.
#[derive(Clone, Debug, PartialEq)]
pub struct LaidScan {
    /// Its file, relative to the assets folder.
    pub file: String,
    /// The body of the row that names it.
    pub body: String,
    /// 1-based line of the size table.
    pub line: u32,
    /// The base's triangles.
    pub triangles: Vec<[u32; 3]>,
    /// What came out.
    pub laid: Laid,
}

/// Why a scan could not be laid on.
enum Fault {
    /// There is no pymeshlab, which is said once for all scans.
    NoMeshlab,
    /// What is wrong, and what to do.
    OfScan(String, &'static str),
}

/// Puts shapes in the place of the scans among the sizes and returns how they were laid on; reports why one cannot be made, or was made
/// badly.
pub fn register(source: &mut Source, workshop: Option<&Workshop<'_>>, report: &mut Vec<Diagnostic>) -> Vec<LaidScan> {
    let mut all = Vec::new();
    if source.scans.is_empty() {
        return all;
    }
    let Some((base_file, unit, up)) = frame(source) else { return all };
    let Some(base) = source.meshes.get(&base_file).filter(|base| !base.faces.is_empty()).cloned() else { return all };
    let base_m: Vec<DVec3> = base.positions.iter().map(|&p| in_metres(p, unit, up)).collect();
    let triangles: Vec<[u32; 3]> =
        base.triangulate().corners.iter().map(|corners| corners.map(|corner| corner.vertex)).collect();
    let sizes = source.sizes.clone().unwrap_or_default();
    let python = OnceCell::new();
    for (file, scan) in &source.scans {
        let row = sizes.rows.iter().skip(1).find(|row| source.folder.name_of(&row.file).as_ref() == Ok(file));
        let Some(row) = row else { continue };
        let fault =
            |problem: String, help: &str| Diagnostic::error("scan", file, Place::File).problem(problem).help(help);
        let Placed { positions_m, knows_front, metres_from_file } = match import::placed(&scan.mesh, &scan.said) {
            Ok(placed) => placed,
            Err(unplaced) => {
                let help = match unplaced {
                    Unplaced::NoUnit => "Write it in garment.toml, in its [[scan]]: unit = \"mm\", for example.",
                    Unplaced::OneAxis => "Write two different axes in its [[scan]] in garment.toml.",
                };
                report.push(fault(unplaced.to_string(), help));
                continue;
            }
        };
        let wrong = report.len();
        let landmarks: Vec<(DVec3, DVec3)> = scan
            .landmarks
            .iter()
            .map(|(place, landmark)| {
                let base = in_metres(landmark.base.into(), unit, up);
                let in_scan = metres_from_file * DVec3::from(landmark.scan);
                report.extend(far_landmark(&source.folder, place, (base, &base_m), (in_scan, &positions_m)));
                (base, in_scan)
            })
            .collect();
        if report.len() > wrong {
            continue;
        }
        let Some(workshop) = workshop else {
            report.push(fault("scans are not cleaned here".to_owned(), "Check or build the kimono with cargo xtask."));
            continue;
        };
        let make = || -> Result<Vec<f64>, Fault> {
            (workshop.tell)(&format!("{file}: cleaning and laying the base onto it"));
            let python = python.get_or_init(|| {
                environment::python(workshop.cache, &environment::PYMESHLAB, &|line| (workshop.tell)(line))
            });
            let Ok(python) = python else { return Err(Fault::NoMeshlab) };
            let cleaned = meshlab::clean(python, &positions_m, &scan.mesh.triangles, &meshlab::Settings::default());
            let cleaned = cleaned.map_err(|error| match error {
                MeshlabError::Unfit(_) | MeshlabError::TimedOut { .. } => Fault::OfScan(
                    error.to_string(),
                    "Mend or simplify the scan in another program and export it again.",
                ),
                _ => Fault::OfScan(error.to_string(), ELSEWHERE),
            })?;
            let scan = register::Scan {
                positions_m: cleaned.positions_m,
                triangles: cleaned.triangles,
                knows_front,
                landmarks: landmarks.clone(),
            };
            let laid = welded(&base_m, &triangles, &scan).map_err(|problem| {
                Fault::OfScan(problem, "Say its unit and axes in garment.toml ([[scan]]); or lay the base onto it in another program and name the OBJ instead.")
            })?;
            Ok(Laid::new(laid, scan, &cleaned.report.borders).flat())
        };
        let settings = (meshlab::Settings::default(), register::Settings::default());
        let key = Key::new("scan")
            .array(&flat(&positions_m))
            .array(&scan.mesh.triangles)
            .text(&format!("{knows_front} {settings:?} {landmarks:?}"))
            .array(&flat(&base_m))
            .array(&triangles);
        let laid = match Memo::new(&workshop.cache.join("scans")).recall(&key, make) {
            Ok((flat, _)) => Laid::of(&flat),
            Err(Fault::NoMeshlab) => continue,
            Err(Fault::OfScan(problem, help)) => {
                report.push(fault(problem, help));
                continue;
            }
        };
        report.extend(laid.warning(file));
        let standing = on_shoulders(&laid.positions_m, &base_m, &sizes, row, unit, up);
        let mesh = obj::Mesh {
            positions: laid.positions_m.iter().map(|&p| from_metres(standing.place(p), unit, up)).collect(),
            ..base.clone()
        };
        source.meshes.insert(file.clone(), mesh);
        let (body, triangles) = (row.body.clone(), triangles.clone());
        all.push(LaidScan { file: file.clone(), body, line: row.line, triangles, laid });
    }
    if let Some(Err(error)) = python.get() {
        let manifest_file = format!("{}/{}", source.folder.id(), manifest::FILE_NAME);
        let first = source.manifest.scans.iter().find_map(|scan| scan.file.as_ref());
        report.push(
            Diagnostic::error("scan", manifest_file, first.map_or(Place::File, Field::place))
                .problem(format!("the kimono's scans cannot be cleaned: {error}"))
                .help(ELSEWHERE),
        );
    }
    all
}

/// What is wrong with a landmark that lies far from the base or the scan that it is a place of.
fn far_landmark(
    folder: &Folder,
    place: &Place,
    (base_m, of_base_m): (DVec3, &[DVec3]),
    (scan_m, of_scan_m): (DVec3, &[DVec3]),
) -> Option<Diagnostic> {
    /// A scan may have a hole where the landmark would be, and be torn around it.
    const FAR_M: f64 = 0.1;
    let away_m = |at: DVec3, all: &[DVec3]| all.iter().map(|p| p.distance(at)).fold(f64::INFINITY, f64::min);
    for (name, at, all) in [("base", base_m, of_base_m), ("scan", scan_m, of_scan_m)] {
        let away_m = away_m(at, all);
        if away_m > FAR_M || away_m.is_nan() {
            let problem = format!("the landmark's `{name}` lies {:.0} mm from the {name}", 1e3 * away_m);
            let manifest_file = format!("{}/{}", folder.id(), manifest::FILE_NAME);
            return Some(Diagnostic::error("scan-landmark", manifest_file, place.clone()).problem(problem).help(
                "Write x, y and z as they stand in the file itself, in its own unit and axes; programs that turn a file upright on import show others.",
            ));
        }
    }
    None
}

/// The base's file, and the unit and axes of the garment's numbers.
fn frame(source: &Source) -> Option<(String, LengthUnit, Up)> {
    let manifest = &source.manifest;
    let base = source.folder.name_of(manifest.base.as_ref()?.get()?).ok()?;
    let unit = manifest.unit.as_ref().map_or(Some(LengthUnit::M), |unit| unit.get().copied())?;
    let up = manifest.up.as_ref().map_or(Some(Up::Y), |up| up.get().copied())?;
    Some((base, unit, up))
}

/// The base laid onto a scan; vertices of the base at one place stay at one place, as in an export that is not welded.
fn welded(base_m: &[DVec3], triangles: &[[u32; 3]], scan: &register::Scan) -> Result<Registered, String> {
    let mut order: Vec<u32> = (0..base_m.len() as u32).collect();
    let bits = |v: u32| base_m[v as usize].to_array().map(f64::to_bits);
    order.sort_by_key(|&v| (bits(v), v));
    let mut first = vec![0; base_m.len()];
    for same in order.chunk_by(|&a, &b| bits(a) == bits(b)) {
        same.iter().for_each(|&v| first[v as usize] = same[0]);
    }
    let mut unique: Vec<u32> = first.clone();
    unique.sort_unstable();
    unique.dedup();
    let number: Vec<u32> =
        first.iter().map(|v| unique.binary_search(v).expect("every first vertex is among the unique") as u32).collect();
    let places_m: Vec<DVec3> = unique.iter().map(|&v| base_m[v as usize]).collect();
    let corners: Vec<[u32; 3]> = triangles
        .iter()
        .map(|corners| corners.map(|v| number[v as usize]))
        .filter(|[a, b, c]| a != b && b != c && c != a)
        .collect();
    let laid = register::register(&places_m, &corners, scan, &register::Settings::default());
    let laid = laid.map_err(|error| error.problem)?;
    let of = |v: &u32| *v as usize;
    Ok(Registered {
        positions_m: number.iter().map(|v| laid.positions_m[of(v)]).collect(),
        confidence: number.iter().map(|v| laid.confidence[of(v)]).collect(),
        ..laid
    })
}

/// What is kept of a registration.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Laid {
    /// The base's vertices in the scan's shape, where the base stands, metres.
    pub positions_m: Vec<DVec3>,
    /// How much each was seen in the scan, 0 to 1.
    pub confidence: Vec<f64>,
    /// The cleaned scan, moved to where the base stands, metres.
    pub scan_m: Vec<DVec3>,
    /// Its triangles, facing as the base's do.
    pub scan_triangles: Vec<[u32; 3]>,
    /// Mean distance after the rigid motion alone, metres.
    pub aligned_m: f64,
    /// From each vertex that can be seen to the scan, metres.
    pub to_scan_m: Vec<f64>,
    /// From each vertex of the scan to the cloth, metres.
    pub from_scan_m: Vec<f64>,
    /// How many triangles are turned over.
    pub turned: usize,
    /// Lengths of the borders that cleaning left open, metres: the short ones.
    pub holes_m: Vec<f64>,
    /// The long ones.
    pub openings_m: Vec<f64>,
}

impl Laid {
    fn new(laid: Registered, scan: register::Scan, borders: &[meshlab::Border]) -> Laid {
        let lengths_m = |is_hole: bool| {
            let of_kind = borders.iter().filter(|border| border.is_hole == is_hole);
            of_kind.map(|border| border.length_m).collect()
        };
        let facing = |[a, b, c]: [u32; 3]| if laid.is_inside_out { [a, c, b] } else { [a, b, c] };
        Laid {
            scan_m: scan.positions_m.iter().map(|&p| laid.base_from_scan.place(p)).collect(),
            scan_triangles: scan.triangles.into_iter().map(facing).collect(),
            positions_m: laid.positions_m,
            confidence: laid.confidence,
            aligned_m: laid.aligned_m,
            to_scan_m: laid.to_scan_m,
            from_scan_m: laid.from_scan_m,
            turned: laid.turned_over.len(),
            holes_m: lengths_m(true),
            openings_m: lengths_m(false),
        }
    }

    /// The share of the vertices that a scanner can see and that were seen.
    #[must_use]
    pub fn seen(&self) -> f64 {
        // `to_scan_m` has one entry per vertex that can be seen.
        self.confidence.iter().filter(|&&c| c > 0.5).count() as f64 / self.to_scan_m.len().max(1) as f64
    }

    /// As numbers for the cache: each list with its length before it.
    fn flat(&self) -> Vec<f64> {
        let indices: Vec<f64> = self.scan_triangles.iter().flatten().map(|&v| f64::from(v)).collect();
        let mut all = Vec::new();
        for list in [
            &[self.aligned_m, self.turned as f64][..],
            &flat(&self.positions_m),
            &self.confidence,
            &flat(&self.scan_m),
            &indices,
            &self.to_scan_m,
            &self.from_scan_m,
            &self.holes_m,
            &self.openings_m,
        ] {
            all.push(list.len() as f64);
            all.extend(list);
        }
        all
    }

    /// From what [`Laid::flat`] gave: the cache holds it by its checksum.
    fn of(mut flat: &[f64]) -> Laid {
        let mut list = || {
            let (length, rest) = flat.split_first().expect("each list has its length before it");
            let (list, rest) = rest.split_at(*length as usize);
            flat = rest;
            list
        };
        let places = |list: &[f64]| list.chunks_exact(3).map(DVec3::from_slice).collect();
        let figures = list();
        Laid {
            aligned_m: figures[0],
            turned: figures[1] as usize,
            positions_m: places(list()),
            confidence: list().to_vec(),
            scan_m: places(list()),
            scan_triangles: list().chunks_exact(3).map(|t| [t[0] as u32, t[1] as u32, t[2] as u32]).collect(),
            to_scan_m: list().to_vec(),
            from_scan_m: list().to_vec(),
            holes_m: list().to_vec(),
            openings_m: list().to_vec(),
        }
    }

    fn warning(&self, file: &str) -> Option<Diagnostic> {
        let mut distances_m = self.from_scan_m.clone();
        distances_m.sort_by(f64::total_cmp);
        let near_m = distances_m.get(distances_m.len() * 4 / 5).copied().unwrap_or(0.0);
        if near_m <= NEAR_M && self.seen() >= SEEN && self.turned == 0 {
            return None;
        }
        let problem = format!(
            "the scan was laid on badly in places: 80 % of it lie within {:.1} mm of the cloth, {:.0} % of the cloth that a scanner can see was seen, \
             {} triangles are turned over (rigidly laid on, it lay {:.0} mm away)",
            1e3 * near_m,
            100.0 * self.seen(),
            self.turned,
            1e3 * self.aligned_m
        );
        Some(Diagnostic::warning("scan-quality", file, Place::File).problem(problem).help(
            "Look at it in the report of the build, or with cargo xtask register ID SCAN --out FILE.obj --picture FILE.png. Scan again what is missing, or mend the shape by hand and name the OBJ instead.",
        ))
    }
}

/// The coordinates of places, one after the other.
fn flat(places_m: &[DVec3]) -> Vec<f64> {
    places_m.iter().flat_map(|p| p.to_array()).collect()
}

/// How a shape that stands where the base stands comes to its own wearer: its cloth over the shoulders lies on hers as the base's on the
/// shoulders of the base's wearer. Without their joints it stays.
fn on_shoulders(
    laid_m: &[DVec3],
    base_m: &[DVec3],
    sizes: &SizeTable,
    row: &SizeRow,
    unit: LengthUnit,
    up: Up,
) -> Rigid {
    let joint_m = |row: &SizeRow, bone: Bone| {
        let at = sizes.bones.iter().position(|other| *other == bone)?;
        Some(in_metres(*row.joints.get(at)?, unit, up))
    };
    let Some(base_row) = sizes.rows.first() else { return Rigid::IDENTITY };
    let joints: Option<Vec<(DVec3, DVec3)>> =
        SHOULDERS.iter().map(|&bone| Some((joint_m(base_row, bone)?, joint_m(row, bone)?))).collect();
    let Some(joints) = joints else { return Rigid::IDENTITY };
    let weights: Vec<f64> = base_m
        .iter()
        .map(|p| if joints.iter().any(|(joint, _)| joint.distance(*p) < SHOULDER_M) { 1.0 } else { 0.0 })
        .collect();
    let standing = Rigid::between(laid_m, base_m, &weights);
    let gone: DVec3 = joints.iter().map(|(from, to)| *to - *from).sum::<DVec3>() / joints.len() as f64;
    Rigid { rotation: standing.rotation, shift_m: standing.shift_m + gone }
}

/// The inverse of [`in_metres`].
fn from_metres(p: DVec3, unit: LengthUnit, up: Up) -> DVec3 {
    let p = p / unit.metres();
    match up {
        Up::Y => p,
        Up::Z => DVec3::new(p.x, -p.z, p.y),
    }
}
