//! Sizes that are scans: each is cleaned, the base is laid onto it, and it stands on its own wearer's shoulders. From then on it is a
//! shape like any other, vertex by vertex. Knows no check and no pack.

use crate::diagnostic::{Diagnostic, Place};
use crate::memo::{Key, Memo};
use crate::meshlab::{self, environment};
use crate::source::import::Axes;
use crate::source::manifest::Up;
use crate::source::sizes::{SizeRow, SizeTable};
use crate::source::units::LengthUnit;
use crate::source::{ScanFile, Source, in_metres, obj};
use crate::stages::register::{self, Registered, Rigid};
use glam::DVec3;
use kitsuke::skeleton::Bone;
use std::path::Path;

/// Cloth within this of these joints rests on the shoulders, metres.
const SHOULDER_M: f64 = 0.12;
const SHOULDERS: [Bone; 2] = [Bone::LeftUpperArm, Bone::RightUpperArm];
/// A scan is laid on well when 80 % of it lie nearer to the cloth than this, metres.
const NEAR_M: f64 = 0.004;
/// And when at least this share of the cloth that a scanner can see was seen.
const SEEN: f64 = 0.7;

/// Where scans are cleaned.
#[derive(Clone, Copy)]
pub struct Workshop<'a> {
    /// The cache: pymeshlab is installed in it, and what was laid on once is kept in it.
    pub cache: &'a Path,
    /// Told what takes long.
    pub tell: &'a (dyn Fn(&str) + Sync),
}

/// Puts shapes in the place of the scans among the sizes; reports why one cannot be made, or was made badly.
pub fn register(source: &mut Source, workshop: Option<&Workshop<'_>>, report: &mut Vec<Diagnostic>) {
    if source.scans.is_empty() {
        return;
    }
    let Some((base_file, unit, up)) = frame(source) else { return };
    let Some(base) = source.meshes.get(&base_file).filter(|base| !base.faces.is_empty()).cloned() else { return };
    let base_m: Vec<DVec3> = base.positions.iter().map(|&p| in_metres(p, unit, up)).collect();
    let triangles: Vec<[u32; 3]> =
        base.triangulate().corners.iter().map(|corners| corners.map(|corner| corner.vertex)).collect();
    let sizes = source.sizes.clone().unwrap_or_default();
    for (file, scan) in &source.scans {
        let row = sizes.rows.iter().skip(1).find(|row| source.folder.name_of(&row.file).as_ref() == Ok(file));
        let Some(row) = row else { continue };
        let fault =
            |problem: String, help: &str| Diagnostic::error("scan", file, Place::File).problem(problem).help(help);
        let scan_m = match scan_m(scan) {
            Ok(scan_m) => scan_m,
            Err((problem, help)) => {
                report.push(fault(problem, help));
                continue;
            }
        };
        let Some(workshop) = workshop else {
            report.push(fault("scans are not cleaned here".to_owned(), "Check or build the kimono with cargo xtask."));
            continue;
        };
        let make = || -> Result<Vec<f64>, String> {
            (workshop.tell)(&format!("{file}: cleaning and laying the base onto it"));
            let python = environment::python(workshop.cache, &environment::PYMESHLAB, &|line| (workshop.tell)(line));
            let python = python.map_err(|error| error.to_string())?;
            let cleaned = meshlab::clean(&python, &scan_m, &scan.mesh.triangles, &meshlab::Settings::default());
            let cleaned = cleaned.map_err(|error| error.to_string())?;
            let scan = register::Scan {
                positions_m: cleaned.positions_m,
                triangles: cleaned.triangles,
                knows_front: knows_front(scan),
                landmarks: Vec::new(),
            };
            let laid = welded(&base_m, &triangles, &scan)?;
            Ok(flat(&laid))
        };
        let key = Key::new("scan")
            .text(&scan.blake3)
            .text(&format!("{:?} {:?} {:?}", scan.unit, scan.up, scan.front))
            .array(&base_m.iter().flat_map(|p| p.to_array()).collect::<Vec<f64>>())
            .array(&triangles)
            .text(&format!("{:?} {:?}", meshlab::Settings::default(), register::Settings::default()));
        let laid = match Memo::new(&workshop.cache.join("scans")).recall(&key, make) {
            Ok((flat, _)) => Laid::of(&flat, base_m.len()),
            Err(problem) => {
                report.push(fault(problem, "Say its unit and axes in garment.toml ([[scan]]); or lay the base onto it in another program and name the OBJ instead."));
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
    }
}

/// The base's file, and the unit and axes of the garment's numbers.
fn frame(source: &Source) -> Option<(String, LengthUnit, Up)> {
    let manifest = &source.manifest;
    let base = source.folder.name_of(manifest.base.as_ref()?.get()?).ok()?;
    let unit = manifest.unit.as_ref().map_or(Some(LengthUnit::M), |unit| unit.get().copied())?;
    let up = manifest.up.as_ref().map_or(Some(Up::Y), |up| up.get().copied())?;
    Some((base, unit, up))
}

fn knows_front(scan: &ScanFile) -> bool {
    scan.front.is_some() || scan.mesh.axes.is_some()
}

/// The scan in metres, Y up, front +Z.
fn scan_m(scan: &ScanFile) -> Result<Vec<DVec3>, (String, &'static str)> {
    let unit_m = scan.unit.map(LengthUnit::metres).or(scan.mesh.unit_m);
    let help = "Write it in garment.toml, in its [[scan]]: unit = \"mm\", for example.";
    let unit_m = unit_m.ok_or_else(|| ("the scan does not say its unit".to_owned(), help))?;
    let axes = scan.up.map(|up| match up {
        Up::Y => Axes { up: DVec3::Y, front: DVec3::Z },
        Up::Z => Axes { up: DVec3::Z, front: DVec3::NEG_Y },
    });
    let mut axes = axes.or(scan.mesh.axes).unwrap_or(Axes { up: DVec3::Y, front: DVec3::Z });
    if let Some(front) = scan.front {
        axes.front = front;
    }
    if axes.up.dot(axes.front) != 0.0 {
        let problem = "the scan's `up` and `front` are one axis".to_owned();
        return Err((problem, "Write two different axes in its [[scan]] in garment.toml."));
    }
    let left = axes.up.cross(axes.front);
    let place_m = |p: &DVec3| DVec3::new(p.dot(left), p.dot(axes.up), p.dot(axes.front)) * unit_m;
    Ok(scan.mesh.positions.iter().map(place_m).collect())
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
struct Laid {
    positions_m: Vec<DVec3>,
    /// Mean distance after the rigid motion; 80 % of the scan lie nearer to the cloth; metres.
    aligned_m: f64,
    near_m: f64,
    /// The share of the cloth that can be seen and was.
    seen: f64,
    turned: usize,
}

fn flat(laid: &Registered) -> Vec<f64> {
    let mut distances_m = laid.from_scan_m.clone();
    distances_m.sort_by(f64::total_cmp);
    let near_m = distances_m.get(distances_m.len() * 4 / 5).copied().unwrap_or(0.0);
    // `to_scan_m` has one entry per vertex that can be seen.
    let seen = laid.confidence.iter().filter(|&&c| c > 0.5).count() as f64 / laid.to_scan_m.len().max(1) as f64;
    let mut flat = vec![laid.aligned_m, near_m, seen, laid.turned_over.len() as f64];
    flat.extend(laid.positions_m.iter().flat_map(|p| p.to_array()));
    flat
}

impl Laid {
    fn of(flat: &[f64], count: usize) -> Laid {
        let positions_m = flat[4..].chunks_exact(3).take(count).map(DVec3::from_slice).collect();
        Laid { positions_m, aligned_m: flat[0], near_m: flat[1], seen: flat[2], turned: flat[3] as usize }
    }

    fn warning(&self, file: &str) -> Option<Diagnostic> {
        if self.near_m <= NEAR_M && self.seen >= SEEN && self.turned == 0 {
            return None;
        }
        let problem = format!(
            "the scan was laid on badly in places: 80 % of it lie within {:.1} mm of the cloth, {:.0} % of the cloth that a scanner can see was seen, \
             {} triangles are turned over (rigidly laid on, it lay {:.0} mm away)",
            1e3 * self.near_m,
            100.0 * self.seen,
            self.turned,
            1e3 * self.aligned_m
        );
        Some(Diagnostic::warning("scan-quality", file, Place::File).problem(problem).help(
            "Look at it: cargo xtask register ID SCAN --out FILE.obj --picture FILE.png. Scan again what is missing, or mend the shape by hand and name the OBJ instead.",
        ))
    }
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
