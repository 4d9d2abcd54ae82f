//! Source → Ir: units become metres and radians, names become numbers, and every mistake of the artist is reported, all
//! in one run. Knows what garments are like, and no file format.

pub mod correspondence;
mod crushed;
mod drivers;
mod exchange;
mod gaps;
mod layers;
mod mesh;
mod moved;
mod near_skin;
mod paths;
mod placement;
mod pose_fit;
mod pose_words;
mod poses;
mod recovery;
mod regions;
mod sides;
mod signature;
mod size;
mod target;
mod texture;
mod thick;

use crate::diagnostic::{Diagnostic, Place, Severity};
use crate::ir;
use crate::source::Source;
use crate::source::folder::Folder;
use crate::source::manifest::{self, Field, Manifest, Up};
use crate::source::obj;
use crate::source::paths::Paths;
use crate::source::sizes::SizeTable;
use crate::source::tables::{PoseRow, PoseTable};
use crate::source::units::{Length, LengthUnit};
use crate::source::{in_metres, is_garment_id, rules};
use glam::{DVec3, Vec3};
use kitsuke::accessories::Texture;
use kitsuke::accessories::limits::TEXTURE_BYTES;
use kitsuke::arrays::limits;
use kitsuke::fit;
use kitsuke::tailoring::RuleSet;
use std::collections::{BTreeMap, BTreeSet};

/// The budget where the manifest gives none.
const DEFAULT_BUDGET: Length = Length { value: 0.2, unit: LengthUnit::Mm };
/// The budgets that can be kept: below, 16-bit deltas end; above, nobody would want the pack.
const BUDGET_M: std::ops::RangeInclusive<f64> = 1e-6..=0.01;

/// A file of the garment and the mesh in it.
#[derive(Clone, Copy)]
struct NamedMesh<'a> {
    file: &'a str,
    mesh: &'a obj::Mesh,
}

/// Turns what was read into a garment, or reports why that cannot be. What was absent in `source` is taken as
/// reported already.
pub fn check(source: Source, report: &mut Vec<Diagnostic>) -> Option<ir::Garment> {
    let Source { folder, manifest, poses, sizes, mut meshes, scans, masks, body, paths, rules, texture_png } = source;
    let manifest_file = format!("{}/{}", folder.id(), manifest::FILE_NAME);
    check_id(&folder, report);
    let budget_m = check_budget(&manifest, &manifest_file, report);
    for budget in [&manifest.speed_budget, &manifest.unseen_budget, &manifest.inside_budget].into_iter().flatten() {
        check_limit(budget, &manifest_file, report);
    }
    check_name(&manifest, &manifest_file, report);
    let lost = recover_orders(&folder, &manifest, (poses.as_ref(), sizes.as_ref()), &mut meshes, report);
    let mesh_of = |written: &str| {
        let (file, mesh) = meshes.get_key_value(&folder.name_of(written).ok()?)?;
        Some(NamedMesh { file, mesh })
    };
    let poses_file = value(&manifest.poses).and_then(|written| folder.name_of(written).ok());
    let poses = poses.zip(poses_file.as_deref());
    if let Some((table, file)) = &poses {
        poses::check(table, file, &manifest, &folder, report);
        sides::check(table, file, report);
        check_unused(&folder, table, file, &meshes.keys().cloned().collect(), report);
    }
    let drivers = drivers::check_drivers(&manifest, &manifest_file, poses.as_ref().map(|(table, _)| table), report);
    let pose_limits = drivers::check_limits(&manifest, &manifest_file, poses.as_ref().map(|(table, _)| table), report);
    if let Some(body) = &body {
        drivers::check_joints(&manifest, &manifest_file, poses.as_ref(), body, report);
    }
    let base_mesh = value(&manifest.base).and_then(|written| mesh_of(written));
    let obi_mesh = value(&manifest.obi).and_then(|written| mesh_of(written));
    for mesh in [base_mesh, obi_mesh].into_iter().flatten() {
        mesh::check(mesh, report);
    }
    let regions = base_mesh.and_then(|base| regions::check(&manifest, &manifest_file, &folder, base, &masks, report));

    // What follows compares places, which needs unit and axes.
    let unit = manifest.unit.as_ref().map_or(Some(LengthUnit::M), |unit| unit.get().copied())?;
    let up = manifest.up.as_ref().map_or(Some(Up::Y), |up| up.get().copied())?;
    let place = |position: &DVec3| in_metres(*position, unit, up).as_vec3();
    let base_mesh = base_mesh.filter(|base| !base.mesh.faces.is_empty())?;
    let base = surface(base_mesh.mesh, &place);
    let obi = obi_mesh.map(|obi| surface(obi.mesh, &place));
    let mut run = true;
    if let Some(paths) = &paths {
        let file = value(&manifest.paths).and_then(|written| folder.name_of(written).ok()).unwrap_or_default();
        run = paths::check(paths, &file, base_mesh.file, &base, report);
    }
    if let Some((code, problem, help)) = crushed::find_in_base(&base) {
        // What is compared with it would be called wrong in its stead.
        report.push(Diagnostic::error(code, base_mesh.file, Place::File).problem(problem).help(help));
        return None;
    }
    texture::check_base(base_mesh.file, &base, report);
    let near = body.as_ref().map_or(Vec::new(), |body| near_skin::pairs(&base.positions_m, body));
    let is_placed = body.as_ref().is_none_or(|body| placement::check(base_mesh, &base, unit, body, &near, report));
    let own = sizes.as_ref().and_then(|table| table.rows.first());
    if let (Some(paths), Some(own), true) = (&paths, own, run && is_placed) {
        let file = value(&manifest.paths).and_then(|written| folder.name_of(written).ok()).unwrap_or_default();
        let named: Vec<&RuleSet> =
            rule_names(&manifest).filter_map(|(_, name)| rules.get(&rules::file(name))).collect();
        paths::check_lengths(paths, &file, &base.positions_m, &own.measurements, &named, report);
    }
    if is_placed {
        regions::check_sides(&manifest, &folder, base_mesh, &masks, report);
    }
    let worn = obi_mesh.zip(obi.as_ref()).filter(|_| is_placed);
    let worn = worn.filter(|(mesh, obi)| placement::check_obi(*mesh, obi, &base, report)).map(|(_, obi)| obi);

    let mut targets = Vec::new();
    let reference = target::Reference::new(base_mesh, &base, worn, &lost);
    let mut written = Vec::new();
    let rows =
        poses.iter().flat_map(|(table, _)| table.rows.iter().zip(poses::untwisted(table)).zip(table.poses()).skip(1));
    let shape_rows = poses.iter().flat_map(|(table, _)| table.rows.iter().skip(1).map(|row| &row.file));
    let size_rows = sizes.iter().flat_map(|table| table.rows.iter().skip(1).map(|row| &row.file));
    let others: Vec<NamedMesh<'_>> = shape_rows.chain(size_rows).filter_map(|written| mesh_of(written)).collect();
    if target::check_base_alone(base_mesh, &others, &place, report) {
        return None;
    }
    // A file that two rows name is a mistake, already reported, and need not be held twice.
    let mut seen = BTreeSet::new();
    for ((row, rotations), pose) in rows {
        let Some(mesh) = mesh_of(&row.file).filter(|mesh| seen.insert(mesh.file)) else { continue };
        let positions_m: Vec<Vec3> = mesh.mesh.positions.iter().map(place).collect();
        if target::check(&reference, mesh, &positions_m, report) {
            let PoseRow { name, file, .. } = row.clone();
            targets.push(ir::TargetShape { name, file, layer: 0, rotations, positions_m });
            written.push(pose);
        }
    }
    let shapes: Vec<(&str, &[Vec3])> = targets.iter().map(|t| (t.file.as_str(), &t.positions_m[..])).collect();
    let copies = target::check_copies(&folder, &base, &shapes, "pose", report);
    if let (Some(body), Some((table, file)), true) = (&body, &poses, is_placed) {
        let mut found = pose_fit::faults(&base.positions_m, body, &near, &table.bones, &targets, &written);
        // That a copied shape is in no pose of its own is said already.
        found.retain(|fault| !matches!(fault, pose_fit::Fault::Row(target, ..) if copies.contains(target)));
        report.extend(found.iter().map(|fault| pose_words::diagnostic(fault, table, file, &targets)));
    }

    let mut fitted = None;
    if let (Some(table), Some(field)) = (&sizes, &manifest.sizes) {
        let file = field.get().and_then(|written| folder.name_of(written).ok()).unwrap_or_default();
        let skeleton = body.as_ref().map(|body| &body.skeleton);
        let named = size::Table { file: &file, table, place: &place };
        let bodies = size::check_table(&named, &folder, Some(base_mesh.file), skeleton, report);
        let (mut shapes, mut rows) = (Vec::new(), Vec::new());
        for (number, row) in table.rows.iter().enumerate().skip(1) {
            let Some(mesh) = mesh_of(&row.file) else { continue };
            let positions_m = mesh.mesh.positions.iter().map(place).collect();
            let shape = match scans.contains_key(mesh.file) {
                // It was made from the base, and `scans` has said what is wrong with it.
                true => Some(size::shape(base_mesh, mesh, &row.file, positions_m)),
                false => size::check_shape(&reference, base_mesh, mesh, &row.file, positions_m, report),
            };
            rows.extend(shape.is_some().then_some(number));
            shapes.extend(shape);
        }
        if let (Some(skeleton), true) = (skeleton, is_placed) {
            let worn =
                rows.iter().zip(&shapes).map(|(row, shape): (&usize, &ir::SizeShape)| (*row, &shape.positions_m[..]));
            size::check_worn(&named, &bodies, &worn.collect::<Vec<_>>(), &base.positions_m, skeleton, report);
        }
        let files = rows.iter().filter_map(|row| Some(mesh_of(&table.rows[*row].file)?.file));
        texture::check_sizes(base_mesh.file, &base, &files.zip(&shapes).collect::<Vec<_>>(), report);
        let copies: Vec<(&str, &[Vec3])> = shapes.iter().map(|s| (s.file.as_str(), &s.positions_m[..])).collect();
        target::check_copies(&folder, &base, &copies, "body", report);
        if !paths.iter().flat_map(|paths| paths.0.values()).any(|path| path.rule.is_some()) {
            report.push(
                Diagnostic::error("no-dimensions", &manifest_file, field.place())
                    .problem("there are sizes, but no path has a rule, so that nothing could be fitted")
                    .help("Give the paths of paths.toml the rule that says how long they should be, for example rule = \"sode_take\"."),
            );
        }
        fitted = Some(ir::Sizes { bodies, shapes });
    }
    check_rules(&manifest, &manifest_file, report);
    let texture_in_pack = value(&manifest.texture_in_pack).is_none_or(|is_in_pack| *is_in_pack);
    let texture = texture_png.zip(manifest.texture.as_ref()).and_then(|(png, field)| {
        if texture_in_pack && png.len() > TEXTURE_BYTES {
            report.push(too_large_for_pack(png.len(), &manifest_file, field.place()));
        }
        Texture::from_png(file_name(value(&manifest.texture)?).to_owned(), png)
    });
    if report.iter().any(|diagnostic| diagnostic.severity == Severity::Error) {
        return None;
    }
    // What targets move tells only where they are right.
    if let (Some((table, _)), true) = (&poses, base_mesh.mesh.is_textured()) {
        let of_base = (base_mesh, &base.positions_m[..]);
        moved::check(&manifest, &folder, of_base, &masks, (&table.bones, &targets), report);
    }
    let (pose_bones, mut drivers) = (poses?.0.bones, drivers?);
    layers::assign(&mut drivers, &pose_bones, &mut targets);
    let rules = rule_names(&manifest).filter_map(|(_, name)| rules.get(&rules::file(name)).cloned());
    Some(ir::Garment {
        id: folder.id().to_owned(),
        name: value(&manifest.name)?.clone(),
        base,
        body: body?,
        obi,
        texture,
        texture_in_pack,
        body_name: file_name(value(&manifest.body)?).rsplit_once('.').map_or("", |(name, _)| name).to_owned(),
        pose_bones,
        targets,
        drivers,
        pose_limits: pose_limits?,
        regions: regions?,
        correctives: value(&manifest.correctives).map_or(0, |count| usize::from(count.0)),
        paths: paths.into_iter().flat_map(measured_paths).collect(),
        sizes: fitted,
        rules: rules.collect(),
        budget_m: budget_m?,
        speed_budget_m: metres(&manifest.speed_budget),
        unseen_budget_m: metres(&manifest.unseen_budget),
        inside_budget_m: metres(&manifest.inside_budget),
    })
}

/// Puts targets and sizes in the order of the base, where they stand in another; gives why that cannot be, by file.
fn recover_orders(
    folder: &Folder,
    manifest: &Manifest,
    (poses, sizes): (Option<&PoseTable>, Option<&SizeTable>),
    meshes: &mut BTreeMap<String, obj::Mesh>,
    report: &mut Vec<Diagnostic>,
) -> BTreeMap<String, correspondence::Lost> {
    let name = |written: &String| folder.name_of(written).ok();
    let Some(base_file) = value(&manifest.base).and_then(name) else { return BTreeMap::new() };
    let obi_file = value(&manifest.obi).and_then(name);
    let targets = poses.into_iter().flat_map(|table| table.rows.iter().skip(1).map(|row| &row.file));
    let shapes = sizes.into_iter().flat_map(|table| table.rows.iter().skip(1).map(|row| &row.file));
    let files: BTreeSet<String> =
        targets.chain(shapes).filter_map(name).filter(|file| Some(file) != obi_file.as_ref()).collect();
    recovery::recover(&base_file, &files.into_iter().collect::<Vec<_>>(), meshes, report)
}

/// The last part of a path of the manifest.
fn file_name(path: &str) -> &str {
    path.rsplit('/').next().unwrap_or(path)
}

fn too_large_for_pack(bytes: usize, manifest_file: &str, place: Place) -> Diagnostic {
    Diagnostic::error("texture-bytes", manifest_file, place)
        .problem(format!("the texture has {} MB; at most {} MB travel in a pack", bytes >> 20, TEXTURE_BYTES >> 20))
        .help("Save it with fewer pixels, or write texture_in_pack = false and let the app bring it.")
}

/// The value of a key that is there and right.
fn value<T>(field: &Option<Field<T>>) -> Option<&T> {
    field.as_ref()?.get()
}

/// A number with thousands separators, as in `13,924`.
fn grouped(number: usize) -> String {
    let digits = number.to_string();
    let grouped: Vec<&str> = digits.as_bytes().rchunks(3).rev().map(|d| std::str::from_utf8(d).unwrap_or("")).collect();
    grouped.join(",")
}

/// A mesh as triangles in metres.
fn surface(mesh: &obj::Mesh, place: &dyn Fn(&DVec3) -> Vec3) -> ir::Surface {
    let triangles = mesh.triangulate();
    let part = |(name, &triangle_count): (&String, &u32)| ir::Part { name: name.clone(), triangle_count };
    let mut surface = ir::Surface {
        positions_m: mesh.positions.iter().map(place).collect(),
        triangles: triangles.corners.iter().map(|corners| corners.map(|corner| corner.vertex)).collect(),
        parts: mesh.parts.iter().zip(&triangles.part_counts).map(part).collect(),
        ..ir::Surface::default()
    };
    if mesh.is_textured() {
        surface.uv.clone_from(&mesh.uv);
        let uv_of = |corner: obj::Corner| corner.uv.expect("every corner of a textured mesh has a texture coordinate");
        surface.uv_triangles = triangles.corners.iter().map(|corners| corners.map(uv_of)).collect();
    }
    surface
}

fn check_id(folder: &Folder, report: &mut Vec<Diagnostic>) {
    let id = folder.id();
    if !is_garment_id(id) {
        report.push(
            Diagnostic::error("garment-id", id, Place::File)
                .problem(format!("the folder's name `{id}` is the kimono's ID, and no valid one"))
                .help("Name the folder with a-z, 0-9, _ and - only, beginning with a letter or digit."),
        );
    }
    for other in folder.same_but_for_case() {
        report.push(
            Diagnostic::error("duplicate-id", id, Place::File)
                .problem(format!("the folder `{other}` beside it has the same ID but for upper and lower case"))
                .help("Rename one of the two; many file systems take them for the same."),
        );
    }
}

/// Shapes that lie beside those of the table and that no row names.
fn check_unused(folder: &Folder, table: &PoseTable, file: &str, used: &BTreeSet<String>, report: &mut Vec<Diagnostic>) {
    let named: Option<BTreeSet<String>> = table.rows.iter().map(|row| folder.name_of(&row.file).ok()).collect();
    // Of a path that cannot be read nobody knows which file it means.
    let Some(named) = named else { return };
    // Beside the base anything may lie, and what lies in the folder of another kimono is that one's.
    let own = format!("{}/", folder.id());
    let is_target = |name: &&str| name.strip_prefix(&own).is_some_and(|rest| rest.contains('/'));
    let targets = named.iter().map(String::as_str).filter(is_target);
    // Where a named file is missing, one that lies there is said to be meant.
    let unused = if named.is_subset(used) { folder.unused(targets, used) } else { Vec::new() };
    if let Some(first) = unused.first() {
        let more = match unused.len() - 1 {
            0 => String::new(),
            more => format!(" (and {more} more)"),
        };
        report.push(
            Diagnostic::warning("unused-file", file, Place::File)
                .problem(format!("no row names {first}{more}, which lies beside the targets"))
                .help("Add a row for it, or move it elsewhere if it is not meant."),
        );
    }
}

fn metres(field: &Option<Field<Length>>) -> Option<f32> {
    value(field).map(|length| length.metres() as f32)
}

fn check_budget(manifest: &Manifest, file: &str, report: &mut Vec<Diagnostic>) -> Option<f32> {
    let Some(field) = &manifest.budget else { return Some(DEFAULT_BUDGET.metres() as f32) };
    let budget = *field.get()?;
    if !BUDGET_M.contains(&budget.metres()) {
        report.push(
            Diagnostic::error("budget", file, field.place())
                .problem(format!("a budget of {budget} cannot be kept or is of no use"))
                .help("Choose 0.001 mm to 10 mm; 0.05 mm cannot be seen."),
        );
        return None;
    }
    Some(budget.metres() as f32)
}

/// A length that something measured is held against.
fn check_limit(field: &Field<Length>, file: &str, report: &mut Vec<Diagnostic>) {
    if let Some(length) = field.get().filter(|length| !(length.metres() > 0.0 && length.metres().is_finite())) {
        report.push(
            Diagnostic::error("budget", file, field.place())
                .problem(format!("nothing stays below {length}"))
                .help("Give a length above 0, or leave the line out."),
        );
    }
}

/// The name that people read travels in the pack.
fn check_name(manifest: &Manifest, file: &str, report: &mut Vec<Diagnostic>) {
    let (Some(field), Some(name)) = (&manifest.name, value(&manifest.name)) else { return };
    if name.trim().is_empty() || name.len() > limits::NAME_BYTES || name.chars().any(char::is_control) {
        report.push(
            Diagnostic::error("name", file, field.place())
                .problem("the name is empty, too long, or has characters that cannot be printed")
                .help(format!("Give 1 to {} bytes of printable text, for example \"小紋 komon\".", limits::NAME_BYTES)),
        );
    }
}

fn rule_names(manifest: &Manifest) -> impl Iterator<Item = (&Field<String>, &str)> {
    manifest.rules.iter().flatten().filter_map(|field| Some((field, field.get()?.as_str())))
}

/// Whether the sizes have rules, each once and no more than a pack holds, and the rules sizes.
fn check_rules(manifest: &Manifest, manifest_file: &str, report: &mut Vec<Diagnostic>) {
    let fields = manifest.rules.as_deref().unwrap_or_default();
    match (&manifest.sizes, fields) {
        (Some(sizes), []) => report.push(
            Diagnostic::error("no-rules", manifest_file, sizes.place())
                .problem("there are sizes, but no rules that say how long a wearer's kimono should be")
                .help("Name rule sets, the kimono's own first, for example rules = [\"women-a\"]; rules/README.md describes them."),
        ),
        (None, [first, ..]) => report.push(
            Diagnostic::error("no-sizes", manifest_file, first.place())
                .problem("there are rules, but no sizes that could be fitted by them")
                .help("Name the table of sizes with the key `sizes`, or remove the key `rules`."),
        ),
        _ => {}
    }
    if let Some(field) = fields.get(fit::limits::RULES) {
        report.push(
            Diagnostic::error("rules", manifest_file, field.place())
                .problem(format!("there are {} rule sets, more than {}", fields.len(), fit::limits::RULES))
                .help("Keep those by which this kimono is ordered."),
        );
    }
    for (i, (field, name)) in rule_names(manifest).enumerate() {
        if rule_names(manifest).take(i).any(|(_, earlier)| earlier == name) {
            report.push(
                Diagnostic::error("rules", manifest_file, field.place())
                    .problem(format!("the rules `{name}` are named twice"))
                    .help("Remove one of them."),
            );
        }
    }
}

fn measured_paths(paths: Paths) -> impl Iterator<Item = ir::MeasuredPath> {
    paths.0.into_iter().map(|(name, path)| ir::MeasuredPath {
        name,
        ja: path.ja,
        vertices: path.vertices.iter().flatten().filter_map(|vertex| vertex.get().copied()).collect(),
        offset_m: path.offset.map_or(0.0, |offset| offset.metres() as f32),
        rule: value(&path.rule).cloned(),
        load: value(&path.load).map_or(1.0, |load| *load as f32),
    })
}

/// Whether a name may be part of the name of a file, as those of targets and drivers are.
fn can_name_a_file(name: &str) -> bool {
    !name.chars().any(|c| c.is_control() || c == '/' || c == '\\')
}

#[cfg(test)]
mod tests {
    #[test]
    fn the_sample_is_clean() {
        let sample = concat!(env!("CARGO_MANIFEST_DIR"), "/../assets-src/komon");
        let loaded = crate::load(std::path::Path::new(sample));
        assert_eq!(loaded.diagnostics, []);
        let garment = loaded.garment.unwrap();
        assert_eq!(garment.base.positions_m.len(), 13_924);
        assert_eq!(garment.base.triangles.len(), 27_340);
        assert_eq!(garment.base.uv.len(), 14_585);
        assert_eq!(garment.targets.len(), 54);
        assert_eq!(garment.body.skeleton.joints().len(), 20);
        assert_eq!(garment.paths.len(), 17);
        assert_eq!(garment.drivers.len(), 8);
    }

    #[test]
    fn numbers_are_grouped() {
        let check = |number, expected: &str| assert_eq!(super::grouped(number), expected);
        check(0, "0");
        check(999, "999");
        check(1_000, "1,000");
        check(13_924, "13,924");
        check(1_234_567, "1,234,567");
    }
}
