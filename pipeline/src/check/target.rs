//! Whether a shape is the base in another pose or size: the same vertices in the same order, unit and axes. The
//! geometric tests rest on two facts: cloth hardly stretches, and most of a kimono stays where it is when the arms move.

use super::{NamedMesh, exchange, grouped, signature};
use crate::diagnostic::{Diagnostic, Place};
use crate::ir;
use crate::source::folder::Folder;
use crate::source::obj;
use glam::Vec3;

/// Median edge ratio beyond which the unit is wrong.
const UNIT_RATIO: f32 = 2.5;
/// An edge that is so many times longer than in the base (or so many times shorter) is no edge of the same cloth.
const STRETCH: f32 = 4.0;
/// Where more than this share of the edges is strained by more than [`STRAIN`], the vertices are in another order.
const DISORDER: f64 = 0.25;
/// See [`DISORDER`].
const STRAIN: f32 = 1.5;
/// Displacement of the resting part, as a share of the base's height, beyond which the target is elsewhere.
const DISPLACED: f32 = 0.05;

/// What is known of the base before the targets are compared with it.
pub(super) struct Reference<'a> {
    file: &'a str,
    mesh: &'a obj::Mesh,
    positions_m: &'a [Vec3],
    edges: Vec<[u32; 2]>,
    neighbours: Vec<Vec<u32>>,
    height_m: f32,
    /// Vertices that no arm moves: those under the obi, or all where there is none.
    resting: Vec<u32>,
    /// Faces as cycles from their least vertex, sorted.
    cycles: Vec<Vec<u32>>,
    /// How many vertices the base would have with its texture seams open.
    open_count: usize,
    distinct_count: usize,
}

impl<'a> Reference<'a> {
    pub(super) fn new(base: NamedMesh<'a>, surface: &'a ir::Surface, obi: Option<&ir::Surface>) -> Reference<'a> {
        let positions_m = &surface.positions_m;
        let (low, high) = bounds(positions_m);
        let all = 0..positions_m.len() as u32;
        let under_obi = |obi: &ir::Surface| {
            let (bottom, top) = bounds(&obi.positions_m);
            let is_under = |&v: &u32| {
                let p = positions_m[v as usize];
                (bottom.y..=top.y).contains(&p.y) && (bottom.x..=top.x).contains(&p.x)
            };
            all.clone().filter(is_under).collect::<Vec<u32>>()
        };
        let resting = obi.map(under_obi).filter(|resting| resting.len() >= 3).unwrap_or_else(|| all.clone().collect());
        let mut corners = base.mesh.corners.clone();
        corners.sort_unstable();
        corners.dedup();
        let edges = super::mesh::edges(&surface.triangles);
        Reference {
            neighbours: exchange::neighbours(positions_m.len(), &edges),
            file: base.file,
            mesh: base.mesh,
            positions_m,
            edges,
            height_m: (high - low).max_element().max(f32::MIN_POSITIVE),
            resting,
            cycles: sorted_cycles(base.mesh, false),
            open_count: corners.len(),
            distinct_count: distinct(positions_m),
        }
    }
}

/// Reports why the target is not the base in another pose; true when it is.
pub(super) fn check(
    base: &Reference<'_>,
    target: NamedMesh<'_>,
    positions_m: &[Vec3],
    report: &mut Vec<Diagnostic>,
) -> bool {
    let found = other_cloth(base, target, positions_m).or_else(|| displaced(base, positions_m));
    report_found(found, target, report)
}

/// Reports why the shape is not the base in another size; true when it is.
pub(super) fn check_size(
    base: &Reference<'_>,
    shape: NamedMesh<'_>,
    positions_m: &[Vec3],
    report: &mut Vec<Diagnostic>,
) -> bool {
    report_found(other_cloth(base, shape, positions_m), shape, report)
}

/// Why the vertices are not those of the base.
fn other_cloth(base: &Reference<'_>, target: NamedMesh<'_>, positions_m: &[Vec3]) -> Option<Mistake> {
    let by_program = |mistake| named_program(mistake, base, target.mesh);
    differing_count(base, positions_m)
        .map(by_program)
        .or_else(|| wrong_unit(base, positions_m))
        .or_else(|| wrong_axes(base, positions_m))
        .or_else(|| differing_faces(base, target.mesh).map(by_program))
        .or_else(|| wrong_order(base, positions_m).map(by_program))
}

fn report_found(found: Option<Mistake>, target: NamedMesh<'_>, report: &mut Vec<Diagnostic>) -> bool {
    let Some(Mistake { code, place, problem, help }) = found else { return true };
    report.push(Diagnostic::error(code, target.file, place).problem(problem).help(help));
    false
}

/// Reports shapes, each with its file, that are the base or another of them to the last digit, though `other` (pose or body)
/// differs.
pub(super) fn check_copies(
    folder: &Folder,
    base: &ir::Surface,
    shapes: &[(&str, &[Vec3])],
    other: &str,
    report: &mut Vec<Diagnostic>,
) {
    for (i, (file, positions_m)) in shapes.iter().enumerate() {
        let base = ("the base", &base.positions_m[..]);
        let mut known = std::iter::once(&base).chain(&shapes[..i]);
        if let Some((same, _)) = known.find(|(_, known_m)| known_m == positions_m) {
            report.push(
                Diagnostic::error("same-shape", folder.name_of(file).unwrap_or_default(), Place::File)
                    .problem(format!("the shape is that of {same} to the last digit, though the {other} is another"))
                    .help(format!("Export this {other} again; probably one file was saved twice.")),
            );
        }
    }
}

/// A mistake found; its file is the target's.
struct Mistake {
    code: &'static str,
    place: Place,
    problem: String,
    help: String,
}

fn mistake(code: &'static str, problem: String, help: &str) -> Option<Mistake> {
    Some(Mistake { code, place: Place::File, problem, help: help.to_owned() })
}

/// With the program whose habits explain the mistake, where one does.
fn named_program(mistake: Mistake, base: &Reference<'_>, target: &obj::Mesh) -> Mistake {
    let explained = matches!(mistake.code, "vertex-count" | "unwelded" | "faces" | "vertex-order");
    match signature::find(base.mesh, target).filter(|_| explained) {
        Some(signature::Signature { said, help }) => {
            Mistake { problem: format!("{}: {said}", mistake.problem), help: help.to_owned(), ..mistake }
        }
        None => mistake,
    }
}

fn differing_count(base: &Reference<'_>, positions_m: &[Vec3]) -> Option<Mistake> {
    let (has, wants) = (positions_m.len(), base.positions_m.len());
    if has == wants {
        return None;
    }
    let (has_text, wants_text, file) = (grouped(has), grouped(wants), base.file);
    if has == base.open_count {
        return mistake(
            "unwelded",
            format!("{has_text} vertices are those of {file} ({wants_text}) unwelded along its texture seams"),
            "Export with Weld on and Multiple Objects off, as the base was, so that every cloth point is one vertex.",
        );
    }
    if distinct(positions_m) == wants {
        return mistake(
            "unwelded",
            format!(
                "{has_text} vertices at {wants_text} places: the file is unwelded, {file} ({wants_text}) is welded"
            ),
            "Export with Weld on and Multiple Objects off, as the base was, so that every cloth point is one vertex.",
        );
    }
    if base.distinct_count < wants && has == base.distinct_count {
        return mistake(
            "unwelded",
            format!("{has_text} vertices: the file is welded, {file} ({wants_text}) is not"),
            "Export base and targets with the same Weld setting, best with Weld on.",
        );
    }
    mistake(
        "vertex-count",
        format!("{has_text} vertices, but {file} has {wants_text}"),
        "Export base and targets from one and the same garment: same particle distance, no remeshing, same Thin, Weld and \
         Multiple Objects settings.",
    )
}

fn wrong_unit(base: &Reference<'_>, positions_m: &[Vec3]) -> Option<Mistake> {
    let ratio = median(edge_ratios(base, positions_m).map(|(_, ratio)| ratio).collect())?;
    if (1.0 / UNIT_RATIO..=UNIT_RATIO).contains(&ratio) {
        return None;
    }
    let size = said_ratio(ratio);
    mistake(
        "unit",
        format!("the shape is {size} {}", base.file),
        "Export base and targets in the same unit; garment.toml's `unit` counts for all of them.",
    )
}

/// `about 1000 times as large as`, `about 100 times as small as`.
pub(super) fn said_ratio(ratio: f32) -> String {
    let (factor, what) = if ratio >= 1.0 { (ratio, "large") } else { (1.0 / ratio, "small") };
    let power = [10.0, 100.0, 1000.0].into_iter().find(|power| (0.7..1.4).contains(&(factor / power)));
    match power {
        Some(power) => format!("about {power} times as {what} as"),
        None => format!("{factor:.1} times as {what} as"),
    }
}

type Turn = fn(Vec3) -> Vec3;

/// Axes as an exporter may have written them, and what to say of it.
const AXES: [(&str, &str, Turn); 5] = [
    ("mirrored", "mirrored: left and right are exchanged", |p| Vec3::new(-p.x, p.y, p.z)),
    ("up-axis", "lying on its back or face: another axis points up", |p| Vec3::new(p.x, p.z, -p.y)),
    ("up-axis", "lying on its back or face: another axis points up", |p| Vec3::new(p.x, -p.z, p.y)),
    ("up-axis", "lying and mirrored: Y and Z are exchanged", |p| Vec3::new(p.x, p.z, p.y)),
    ("front-axis", "facing backwards", |p| Vec3::new(-p.x, p.y, -p.z)),
];

fn wrong_axes(base: &Reference<'_>, positions_m: &[Vec3]) -> Option<Mistake> {
    let distance =
        |turn: Turn| median(positions_m.iter().zip(base.positions_m).map(|(t, b)| turn(*t).distance(*b)).collect());
    let as_is = distance(|p| p)?;
    let turned = AXES.iter().filter_map(|(code, said, turn)| Some((distance(*turn)?, *code, *said)));
    let (nearest, code, said) = turned.min_by(|a, b| a.0.total_cmp(&b.0))?;
    if as_is < DISPLACED * base.height_m || nearest > 0.4 * as_is {
        return None;
    }
    let help = match code {
        "mirrored" => "Export without mirroring; the wearer's left is +X, and left lies over right (右前).",
        _ => "Export base and targets with the same axes; garment.toml's `up` counts for all of them.",
    };
    mistake(code, format!("the shape is {said}, compared with {}", base.file), help)
}

fn differing_faces(base: &Reference<'_>, target: &obj::Mesh) -> Option<Mistake> {
    let help = "Export with the settings of the base: same garment, no remeshing, same order of patterns, same choice of \
                quads or triangles; vertex i must be the same cloth point in every file.";
    if target.faces.is_empty() {
        return mistake("faces", "the file has no faces, so its vertex order cannot be compared".to_owned(), help);
    }
    let vertices = |mesh: &obj::Mesh, face: &obj::Face| -> Vec<u32> {
        mesh.corners_of(face).iter().map(|corner| corner.vertex).collect()
    };
    let differs = |(a, b): (&obj::Face, &obj::Face)| vertices(base.mesh, a) != vertices(target, b);
    let first = base.mesh.faces.iter().zip(&target.faces).position(differs);
    if first.is_none() && base.mesh.faces.len() == target.faces.len() {
        return None;
    }
    // The same faces, listed in another order or begun at another corner, say the same.
    if sorted_cycles(target, false) == base.cycles {
        return None;
    }
    if sorted_cycles(target, true) == base.cycles {
        let problem = format!("every face is turned over, compared with {}", base.file);
        return mistake("flipped", problem, "Export without mirroring and without flipping normals.");
    }
    let Some(first) = first else {
        let (has, wants) = (grouped(target.faces.len()), grouped(base.mesh.faces.len()));
        let problem = format!("same vertex count, but {has} faces where {} has {wants}", base.file);
        return mistake("faces", problem, help);
    };
    let (face, base_face) = (&target.faces[first], &base.mesh.faces[first]);
    let problem = format!(
        "same vertex count, but the faces differ from {} first at face {} (there line {})",
        base.file,
        first + 1,
        base_face.line
    );
    Some(Mistake { code: "faces", place: Place::Line(face.line), problem, help: help.to_owned() })
}

fn wrong_order(base: &Reference<'_>, positions_m: &[Vec3]) -> Option<Mistake> {
    let help = "Export with the settings of the base; vertex i must be the same cloth point in every file.";
    let beyond = |limit: f32| {
        edge_ratios(base, positions_m)
            .filter(move |(_, ratio)| !(1.0 / limit..=limit).contains(ratio))
            .map(|(edge, _)| edge)
    };
    if beyond(STRAIN).count() as f64 > DISORDER * base.edges.len() as f64 {
        let problem = format!("same faces as {}, but the positions stand in another order", base.file);
        return mistake("vertex-order", problem, help);
    }
    let pairs = exchange::exchanged(base.positions_m, positions_m, &base.neighbours);
    if let Some([a, b]) = pairs.first() {
        let more = match pairs.len() - 1 {
            0 => String::new(),
            1 => ", and so are two others".to_owned(),
            more => format!(", and so are {more} other pairs"),
        };
        let problem = format!("vertices {} and {} are exchanged, compared with {}{more}", a + 1, b + 1, base.file);
        return mistake("vertex-order", problem, help);
    }
    let wrong: Vec<[u32; 2]> = beyond(STRETCH).collect();
    let [a, b] = *wrong.first()?;
    let problem = format!(
        "{} edges are more than {STRETCH} times longer or shorter than in {}, first that of vertices {} and {}",
        grouped(wrong.len()),
        base.file,
        a + 1,
        b + 1
    );
    mistake("stretched", problem, "Look whether the simulation broke there, and export again.")
}

fn displaced(base: &Reference<'_>, positions_m: &[Vec3]) -> Option<Mistake> {
    let axis = |i: usize| {
        median(base.resting.iter().map(|&v| (positions_m[v as usize] - base.positions_m[v as usize])[i]).collect())
    };
    let moved = Vec3::new(axis(0)?, axis(1)?, axis(2)?);
    if moved.length() <= DISPLACED * base.height_m {
        return None;
    }
    let problem = format!(
        "the part that rests lies {:.2} m from its place in {} (x {:+.2}, y {:+.2}, z {:+.2} m)",
        moved.length(),
        base.file,
        moved.x,
        moved.y,
        moved.z
    );
    mistake("displaced", problem, "Leave the body's hips where they are in every pose; only the joints may turn.")
}

/// The edges that have a length, each with its length here against its length in the base.
fn edge_ratios<'a>(
    base: &'a Reference<'_>,
    positions_m: &'a [Vec3],
) -> impl Iterator<Item = ([u32; 2], f32)> + use<'a> {
    let length = |positions_m: &[Vec3], [a, b]: [u32; 2]| positions_m[a as usize].distance(positions_m[b as usize]);
    let base_positions_m = base.positions_m;
    let with_ratio = move |&edge: &[u32; 2]| {
        let at_rest = length(base_positions_m, edge);
        (at_rest > 0.0).then(|| (edge, length(positions_m, edge) / at_rest))
    };
    base.edges.iter().filter_map(with_ratio)
}

/// The faces as cycles from their least vertex, sorted; reversed ones when `turned_over`.
fn sorted_cycles(mesh: &obj::Mesh, turned_over: bool) -> Vec<Vec<u32>> {
    let cycle = |face: &obj::Face| {
        let mut cycle: Vec<u32> = mesh.corners_of(face).iter().map(|corner| corner.vertex).collect();
        if turned_over {
            cycle.reverse();
        }
        let least = (0..cycle.len()).min_by_key(|&i| cycle[i]).unwrap_or(0);
        cycle.rotate_left(least);
        cycle
    };
    let mut cycles: Vec<Vec<u32>> = mesh.faces.iter().map(cycle).collect();
    cycles.sort_unstable();
    cycles
}

/// How many different places there are.
fn distinct(positions_m: &[Vec3]) -> usize {
    let mut bits: Vec<[u32; 3]> = positions_m.iter().map(|p| p.to_array().map(f32::to_bits)).collect();
    bits.sort_unstable();
    bits.dedup();
    bits.len()
}

/// Least and greatest coordinates; zero for no points.
pub(super) fn bounds(positions_m: &[Vec3]) -> (Vec3, Vec3) {
    let corners = positions_m.iter().map(|p| (*p, *p)).reduce(|(low, high), (p, _)| (low.min(p), high.max(p)));
    corners.unwrap_or_default()
}

fn median(mut values: Vec<f32>) -> Option<f32> {
    let middle = values.len() / 2;
    (!values.is_empty()).then(|| *values.select_nth_unstable_by(middle, f32::total_cmp).1)
}
