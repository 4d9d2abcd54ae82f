//! Whether a shape is the base in another pose or size: the same vertices in the same order, unit and axes. The
//! geometric tests rest on two facts: cloth hardly stretches, and most of a kimono stays where it is when the arms move.

use super::correspondence::{Lost, sorted_cycles};
use super::{NamedMesh, crushed, exchange, grouped, recovery, signature};
use crate::diagnostic::{Diagnostic, Place};
use crate::ir;
use crate::source::folder::Folder;
use crate::source::obj;
use glam::{DVec3, Vec3};
use std::collections::{BTreeMap, BTreeSet};

/// Median edge ratio beyond which the unit of a size is wrong.
const UNIT_RATIO: f32 = 2.5;
/// Median edge ratio beyond which a target is no other pose: on 55 drapes of one kimono it is 1.000, on other sizes 0.94 to 1.17.
const SCALE: f32 = 1.015;
/// An edge that is so many times longer than in the base (or so many times shorter) is no edge of the same cloth.
const STRETCH: f32 = 4.0;
/// Where more than this share of the edges is strained by more than [`STRAIN`], the vertices are in another order.
const DISORDER: f64 = 0.25;
/// See [`DISORDER`].
const STRAIN: f32 = 1.5;
/// Shapes that are nowhere farther apart were one before they were rounded, metres.
const ROUNDING_M: f32 = 1e-3;
/// Coordinates in such steps were rounded, metres.
const STEP_M: f32 = 0.01;
/// Displacement of the resting part, as a share of the base's height, beyond which the target is elsewhere.
const DISPLACED: f32 = 0.05;
/// The same where an obi says what rests.
const DISPLACED_UNDER_OBI: f32 = 0.02;
/// How far the part under the obi may turn, degrees.
const TURNED_DEG: f64 = 4.0;

/// What is known of the base before the targets are compared with it.
pub(super) struct Reference<'a> {
    file: &'a str,
    mesh: &'a obj::Mesh,
    positions_m: &'a [Vec3],
    edges: Vec<[u32; 2]>,
    neighbours: Vec<Vec<u32>>,
    height_m: f32,
    /// Median length of its edges, metres.
    edge_m: f32,
    has_obi: bool,
    /// Vertices that no arm moves: those under the obi, or all where there is none.
    resting: Vec<u32>,
    /// Faces as cycles from their least vertex, sorted.
    cycles: Vec<Vec<u32>>,
    /// How many vertices the base would have with its texture seams open.
    open_count: usize,
    distinct_count: usize,
    /// Why the order of a file could not be recovered.
    lost: &'a BTreeMap<String, Lost>,
}

impl<'a> Reference<'a> {
    pub(super) fn new(
        base: NamedMesh<'a>,
        surface: &'a ir::Surface,
        obi: Option<&ir::Surface>,
        lost: &'a BTreeMap<String, Lost>,
    ) -> Reference<'a> {
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
        let has_obi = obi.is_some();
        let resting = obi.map(under_obi).filter(|resting| resting.len() >= 3).unwrap_or_else(|| all.clone().collect());
        let mut corners = base.mesh.corners.clone();
        corners.sort_unstable();
        corners.dedup();
        let edges = sides(base.mesh);
        Reference {
            neighbours: exchange::neighbours(positions_m.len(), &edges),
            file: base.file,
            mesh: base.mesh,
            positions_m,
            edge_m: crushed::median_m(positions_m, &edges),
            has_obi,
            edges,
            height_m: (high - low).max_element().max(f32::MIN_POSITIVE),
            resting,
            cycles: sorted_cycles(base.mesh, false),
            open_count: corners.len(),
            distinct_count: distinct(positions_m),
            lost,
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
    let found = other_cloth(base, target, positions_m, SCALE)
        .or_else(|| displaced(base, positions_m))
        .or_else(|| turned(base, positions_m));
    report_found(found, target, report)
}

/// Reports why the shape is not the base in another size; true when it is.
pub(super) fn check_size(
    base: &Reference<'_>,
    shape: NamedMesh<'_>,
    positions_m: &[Vec3],
    report: &mut Vec<Diagnostic>,
) -> bool {
    report_found(other_cloth(base, shape, positions_m, UNIT_RATIO), shape, report)
}

/// Why the vertices are not those of the base; its edges may be `scale` times as long.
fn other_cloth(base: &Reference<'_>, target: NamedMesh<'_>, positions_m: &[Vec3], scale: f32) -> Option<Mistake> {
    let by_program = |mistake| with_loss(named_program(mistake, base, target.mesh), base.lost.get(target.file));
    differing_count(base, target.mesh, positions_m)
        .map(by_program)
        .or_else(|| no_cloth(base, positions_m))
        .or_else(|| wrong_unit(base, positions_m))
        .or_else(|| wrong_axes(base, positions_m))
        .or_else(|| differing_faces(base, target.mesh).map(by_program))
        .or_else(|| scaled(base, positions_m, scale))
        .or_else(|| wrong_order(base, positions_m).map(by_program))
}

/// Reports a base whose vertices or faces are others than those that all other shapes have alike, which would else be blamed one by one;
/// true when it is.
pub(super) fn check_base_alone(
    base: NamedMesh<'_>,
    others: &[NamedMesh<'_>],
    place: &dyn Fn(&DVec3) -> Vec3,
    report: &mut Vec<Diagnostic>,
) -> bool {
    let [first, second, ..] = others else { return false };
    let count = |shape: &NamedMesh<'_>| (shape.mesh.positions.len(), shape.mesh.faces.len());
    if first.file == second.file
        || count(first) == count(&base)
        || others.iter().any(|other| count(other) != count(first))
    {
        return false;
    }
    let (surface, lost) = (super::surface(first.mesh, place), BTreeMap::new());
    let usual = Reference::new(NamedMesh { file: "every other shape", mesh: first.mesh }, &surface, None, &lost);
    let base_m: Vec<Vec3> = base.mesh.positions.iter().map(place).collect();
    let found = differing_count(&usual, base.mesh, &base_m).or_else(|| differing_faces(&usual, base.mesh));
    let found = found.map(|mistake| named_program(mistake, &usual, base.mesh));
    let help = "Export the base again as all the others: the same pieces, particle distance, Thin, Weld and Multiple Objects settings, no remeshing; \
                or, if the base is right, all the others.";
    !report_found(found.map(|mistake| Mistake { help: help.to_owned(), ..mistake }), base, report)
}

fn report_found(found: Option<Mistake>, target: NamedMesh<'_>, report: &mut Vec<Diagnostic>) -> bool {
    let Some(Mistake { code, place, problem, help }) = found else { return true };
    report.push(Diagnostic::error(code, target.file, place).problem(problem).help(help));
    false
}

/// Reports shapes, each with its file, that are the base or another of them but for rounding, though `other` (pose or body)
/// differs. Gives the numbers of both.
pub(super) fn check_copies(
    folder: &Folder,
    base: &ir::Surface,
    shapes: &[(&str, &[Vec3])],
    other: &str,
    report: &mut Vec<Diagnostic>,
) -> BTreeSet<usize> {
    let farthest_m = |a: &[Vec3], b: &[Vec3]| {
        let is_near = |(a, b): (&Vec3, &Vec3)| a.distance_squared(*b) < ROUNDING_M * ROUNDING_M;
        a.iter().zip(b).all(is_near).then(|| a.iter().zip(b).fold(0.0f32, |most, (a, b)| most.max(a.distance(*b))))
    };
    let mut copies = BTreeSet::new();
    for (i, (file, positions_m)) in shapes.iter().enumerate() {
        let base = (None, "the base", &base.positions_m[..]);
        let known = shapes[..i].iter().enumerate().map(|(j, (name, known_m))| (Some(j), *name, *known_m));
        let mut known = std::iter::once(base).chain(known);
        let found = known.find_map(|(j, same, known_m)| Some((j, same, farthest_m(known_m, positions_m)?)));
        let Some((j, same, apart_m)) = found else { continue };
        copies.extend(j.into_iter().chain([i]));
        let how = if apart_m == 0.0 { "to the last digit" } else { "but for rounding" };
        report.push(
            Diagnostic::error("same-shape", folder.name_of(file).unwrap_or_default(), Place::File)
                .problem(format!("the shape is that of {same} {how}, though the {other} is another"))
                .help(format!("Export this {other} again; probably one file was saved twice.")),
        );
    }
    copies
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

/// With the reason why the order could not be recovered, where it says more than the mistake.
fn with_loss(mistake: Mistake, lost: Option<&Lost>) -> Mistake {
    let is_of_order = matches!(mistake.code, "vertex-count" | "unwelded" | "faces");
    match lost.filter(|_| is_of_order).and_then(recovery::explained) {
        Some((said, help)) => {
            Mistake { problem: format!("{}; {said}", mistake.problem), help: help.to_owned(), ..mistake }
        }
        None => mistake,
    }
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

/// The pieces of the base that a mesh with named pieces lacks.
fn lacking(base: &obj::Mesh, mesh: &obj::Mesh) -> Option<String> {
    let lacking: Vec<&str> = base.parts.iter().filter(|part| !mesh.parts.contains(part)).map(String::as_str).collect();
    let has_others = mesh.parts.iter().any(|part| base.parts.contains(part));
    (has_others && !lacking.is_empty()).then(|| lacking.join(", "))
}

fn differing_count(base: &Reference<'_>, mesh: &obj::Mesh, positions_m: &[Vec3]) -> Option<Mistake> {
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
    let problem = format!("{has_text} vertices, but {file} has {wants_text}");
    if let Some(lacking) = lacking(base.mesh, mesh) {
        let help = "Select all pieces before exporting; hidden ones are left out by some programs.";
        return mistake("vertex-count", format!("{problem}; these pieces are missing: {lacking}"), help);
    }
    if has == 2 * wants {
        let help = "Export Thin, not Thick (Blender: without a Solidify modifier).";
        return mistake("vertex-count", format!("{problem}: twice as many, the cloth has two layers"), help);
    }
    if has == wants + base.edges.len() {
        let help = "Export without a Subdivision modifier; choose no other particle distance.";
        return mistake("vertex-count", format!("{problem}: the mesh was subdivided"), help);
    }
    mistake(
        "vertex-count",
        problem,
        "Export base and targets from one and the same garment: same particle distance, no remeshing, same Thin, Weld and \
         Multiple Objects settings (Blender: no Merge by Distance, Decimate or Subdivision).",
    )
}

fn no_cloth(base: &Reference<'_>, positions_m: &[Vec3]) -> Option<Mistake> {
    // In the unit of the file: a shape in centimetres is judged by its unit.
    let ratio = median(edge_ratios(base, positions_m).map(|(_, ratio)| ratio).collect())?;
    let edge_m = base.edge_m * if ratio > 0.0 { ratio } else { 1.0 };
    let (code, problem, help) = crushed::find(positions_m, &base.edges, edge_m)?;
    mistake(code, problem, help)
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

/// All of the cloth is larger or smaller than in the base.
fn scaled(base: &Reference<'_>, positions_m: &[Vec3], scale: f32) -> Option<Mistake> {
    let ratios: Vec<f32> = edge_ratios(base, positions_m).map(|(_, ratio)| ratio).collect();
    let ratio = median(ratios.clone())?;
    let is_alike = |of_edge: &&f32| (1.0 / STRAIN..=STRAIN).contains(&(**of_edge / ratio));
    // In another order edges differ among themselves.
    if (1.0 / scale..=scale).contains(&ratio)
        || (ratios.iter().filter(is_alike).count() as f64) < (1.0 - DISORDER) * ratios.len() as f64
    {
        return None;
    }
    if positions_m.iter().all(|place_m| is_whole(place_m * (1.0 / STEP_M))) {
        return mistake(
            "rounded",
            "all coordinates are whole centimetres: they were rounded when the file was written".to_owned(),
            "Export with more decimals (of metres four or more).",
        );
    }
    mistake(
        "scale",
        format!("the cloth is {ratio:.3} times as large as {}, though cloth hardly stretches", base.file),
        "Export with scale 1 as the base was (Blender: apply the object's scale), and from the same body: another size is no pose.",
    )
}

fn is_whole(steps: Vec3) -> bool {
    (steps - steps.round()).abs().max_element() < 1e-3
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
    let missing = lacking(base.mesh, target);
    let Some(first) = first.filter(|_| missing.is_none()) else {
        let (has, wants) = (grouped(target.faces.len()), grouped(base.mesh.faces.len()));
        let problem = format!("same vertex count, but {has} faces where {} has {wants}", base.file);
        let problem = match missing {
            Some(lacking) => format!("{problem}; these pieces are missing: {lacking}"),
            None => problem,
        };
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
    let moved = |pair: [u32; 2]| exchange::moved_alone(base.positions_m, positions_m, &base.neighbours, pair);
    if let Some((vertex, by_m)) = pairs.first().filter(|_| pairs.len() == 1).and_then(|pair| moved(*pair)) {
        let problem = format!(
            "vertex {} was moved by itself: it lies {:.1} cm from where the edges around it have it in {}",
            vertex + 1,
            100.0 * by_m,
            base.file
        );
        return mistake("vertex-moved", problem, "Move it back, or export the shape again as it came to rest.");
    }
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
    mistake(
        "stretched",
        problem,
        "Look whether the simulation broke there or had not come to rest, and whether a piece was moved alone; then export again.",
    )
}

fn displaced(base: &Reference<'_>, positions_m: &[Vec3]) -> Option<Mistake> {
    let axis = |i: usize| {
        median(base.resting.iter().map(|&v| (positions_m[v as usize] - base.positions_m[v as usize])[i]).collect())
    };
    let moved = Vec3::new(axis(0)?, axis(1)?, axis(2)?);
    let limit = if base.has_obi { DISPLACED_UNDER_OBI } else { DISPLACED };
    if moved.length() <= limit * base.height_m {
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

/// The figure was turned as a whole: what lies under the obi turned about the vertical.
fn turned(base: &Reference<'_>, positions_m: &[Vec3]) -> Option<Mistake> {
    if !base.has_obi {
        return None;
    }
    let middle = |places_m: &[Vec3]| {
        let sum: Vec3 = base.resting.iter().map(|&v| places_m[v as usize]).sum();
        sum / base.resting.len() as f32
    };
    let (from_m, to_m) = (middle(base.positions_m), middle(positions_m));
    let (mut along, mut across) = (0.0, 0.0);
    for &v in &base.resting {
        let (a, b) = (base.positions_m[v as usize] - from_m, positions_m[v as usize] - to_m);
        along += f64::from(a.x * b.x + a.z * b.z);
        across += f64::from(a.z * b.x - a.x * b.z);
    }
    let angle_deg = libm::atan2(across, along).to_degrees();
    if angle_deg.abs() <= TURNED_DEG {
        return None;
    }
    let side = if angle_deg > 0.0 { "left" } else { "right" };
    mistake(
        "turned",
        format!(
            "what lies under the obi is turned by {:.0} degrees to the wearer's {side}, compared with {}",
            angle_deg.abs(),
            base.file
        ),
        "Leave the figure's hips and trunk as they are in every pose; only the joints of the table may turn.",
    )
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

/// The sides of all polygons, lesser vertex first, sorted, each once. Diagonals are none: a quad's was chosen by its shape in the base, and
/// one that is crumpled there opens to many times its length elsewhere, though no thread stretches.
fn sides(mesh: &obj::Mesh) -> Vec<[u32; 2]> {
    let of_face = |face: &obj::Face| {
        let corners = mesh.corners_of(face);
        let next = corners.iter().cycle().skip(1);
        corners.iter().zip(next).map(|(a, b)| [a.vertex.min(b.vertex), a.vertex.max(b.vertex)]).collect::<Vec<_>>()
    };
    let mut sides: Vec<[u32; 2]> = mesh.faces.iter().flat_map(of_face).collect();
    sides.sort_unstable();
    sides.dedup();
    sides
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
