//! Source → Ir: units become metres and radians, names become numbers, and every mistake of the artist is reported, all
//! in one run. Knows what garments are like, and no file format.

mod exchange;
mod gaps;
mod layers;
mod mesh;
mod near_skin;
mod placement;
mod pose_fit;
mod pose_words;
mod regions;
mod sides;
mod signature;
mod size;
mod target;

use crate::diagnostic::{Diagnostic, Place, Severity};
use crate::ir;
use crate::source::Source;
use crate::source::causes::Causes;
use crate::source::folder::Folder;
use crate::source::manifest::{self, BoneName, DriverEntry, Field, LimitEntry, Manifest, Up};
use crate::source::obj;
use crate::source::paths::Paths;
use crate::source::tables::{PoseRow, PoseTable};
use crate::source::units::{Length, LengthUnit};
use crate::source::{closest, is_garment_id, rules};
use glam::{DVec3, Quat, Vec3};
use kitsuke::arrays::{PoseLimit, limits};
use kitsuke::fit;
use kitsuke::skeleton::Bone;
use std::collections::{BTreeMap, BTreeSet};

/// The budget where the manifest gives none.
const DEFAULT_BUDGET: Length = Length { value: 0.05, unit: LengthUnit::Mm };
/// The budgets that can be kept: below, 16-bit deltas end; above, nobody would want the pack.
const BUDGET_M: std::ops::RangeInclusive<f64> = 1e-6..=0.01;
/// How much farther than the samples a limited joint may turn, degrees.
const MARGIN_DEG: std::ops::RangeInclusive<f64> = 0.5..=45.0;
/// How much a path may count in a fit.
const LOAD: std::ops::RangeInclusive<f64> = 1e-3..=1e3;
/// Cosine of half a degree: two rotations whose quaternions' product exceeds it are less than one degree apart.
const COS_HALF_DEGREE: f32 = 0.999_961_9;
/// What no rotation becomes where w is written first.
const HALF_TURN_ABOUT_X: Quat = Quat::from_xyzw(1.0, 0.0, 0.0, 0.0);

/// A file of the garment and the mesh in it.
#[derive(Clone, Copy)]
struct NamedMesh<'a> {
    file: &'a str,
    mesh: &'a obj::Mesh,
}

/// Turns what was read into a garment, or reports why that cannot be. What was absent in `source` is taken as
/// reported already.
pub fn check(source: Source, report: &mut Vec<Diagnostic>) -> Option<ir::Garment> {
    let Source { folder, manifest, poses, sizes, meshes, masks, body, paths, rules, texture_png } = source;
    let manifest_file = format!("{}/{}", folder.id(), manifest::FILE_NAME);
    check_id(&folder, report);
    let budget_m = check_budget(&manifest, &manifest_file, report);
    for budget in [&manifest.speed_budget, &manifest.unseen_budget, &manifest.inside_budget].into_iter().flatten() {
        check_limit(budget, &manifest_file, report);
    }
    check_name(&manifest, &manifest_file, report);
    let mesh_of = |written: &str| {
        let (file, mesh) = meshes.get_key_value(&folder.name_of(written).ok()?)?;
        Some(NamedMesh { file, mesh })
    };
    let poses_file = value(&manifest.poses).and_then(|written| folder.name_of(written).ok());
    let poses = poses.zip(poses_file.as_deref());
    if let Some((table, file)) = &poses {
        check_poses(table, file, &manifest, &folder, report);
        sides::check(table, file, report);
    }
    let drivers = check_drivers(&manifest, &manifest_file, poses.as_ref().map(|(table, _)| table), report);
    let pose_limits = check_limits(&manifest, &manifest_file, poses.as_ref().map(|(table, _)| table), report);
    if let Some(body) = &body {
        check_joints(&manifest, &manifest_file, poses.as_ref(), body, report);
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
    let place = |position: &DVec3| in_metres(*position, unit, up);
    let base_mesh = base_mesh.filter(|base| !base.mesh.faces.is_empty())?;
    let base = surface(base_mesh.mesh, &place);
    let obi = obi_mesh.map(|obi| surface(obi.mesh, &place));
    if let Some(paths) = &paths {
        let file = value(&manifest.paths).and_then(|written| folder.name_of(written).ok()).unwrap_or_default();
        check_paths(paths, &file, base_mesh.file, &base, report);
    }
    let near = body.as_ref().map_or(Vec::new(), |body| near_skin::pairs(&base.positions_m, body));
    let is_placed = body.as_ref().is_none_or(|body| placement::check(base_mesh, &base, unit, body, &near, report));
    if let (Some(mesh), Some(obi)) = (obi_mesh, &obi)
        && is_placed
    {
        placement::check_obi(mesh, obi, &base, report);
    }

    let mut targets = Vec::new();
    let reference = target::Reference::new(base_mesh, &base, obi.as_ref().filter(|_| is_placed));
    let rows = poses.iter().flat_map(|(table, _)| table.rows.iter().zip(untwisted(table)).skip(1));
    // A file that two rows name is a mistake, already reported, and need not be held twice.
    let mut seen = BTreeSet::new();
    for (row, rotations) in rows {
        let Some(mesh) = mesh_of(&row.file).filter(|mesh| seen.insert(mesh.file)) else { continue };
        let positions_m: Vec<Vec3> = mesh.mesh.positions.iter().map(place).collect();
        if target::check(&reference, mesh, &positions_m, report) {
            let PoseRow { name, file, .. } = row.clone();
            targets.push(ir::TargetShape { name, file, layer: 0, rotations, positions_m });
        }
    }
    if let (Some(body), Some((table, file)), true) = (&body, &poses, is_placed) {
        let found = pose_fit::faults(&base.positions_m, body, &near, &table.bones, &targets);
        report.extend(found.iter().map(|fault| pose_words::diagnostic(fault, table, file, &targets)));
    }
    let shapes: Vec<(&str, &[Vec3])> = targets.iter().map(|t| (t.file.as_str(), &t.positions_m[..])).collect();
    target::check_copies(&folder, &base, &shapes, "pose", report);

    let mut fitted = None;
    if let (Some(table), Some(field)) = (&sizes, &manifest.sizes) {
        let file = field.get().and_then(|written| folder.name_of(written).ok()).unwrap_or_default();
        let skeleton = body.as_ref().map(|body| &body.skeleton);
        let named = size::Table { file: &file, table, place: &place };
        let bodies = size::check_table(&named, &folder, Some(base_mesh.file), skeleton, report);
        let mut shapes = Vec::new();
        for row in table.rows.iter().skip(1) {
            let Some(mesh) = mesh_of(&row.file) else { continue };
            let positions_m = mesh.mesh.positions.iter().map(place).collect();
            shapes.extend(size::check_shape(&reference, base_mesh, mesh, &row.file, positions_m, report));
        }
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
    if report.iter().any(|diagnostic| diagnostic.severity == Severity::Error) {
        return None;
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
        texture_png,
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

/// A position of a file as metres, Y up, front +Z.
fn in_metres(position: DVec3, unit: LengthUnit, up: Up) -> Vec3 {
    let turned = match up {
        Up::Y => position,
        Up::Z => DVec3::new(position.x, position.z, -position.y),
    };
    (turned * unit.metres()).as_vec3()
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

/// The pose table against itself and the manifest.
fn check_poses(table: &PoseTable, file: &str, manifest: &Manifest, folder: &Folder, report: &mut Vec<Diagnostic>) {
    let Some((base, targets)) = table.rows.split_first() else {
        report.push(
            Diagnostic::error("no-base-row", file, Place::File)
                .problem("the pose table has no rows")
                .help("Give one row per shape: first the base in the T-pose, then each target."),
        );
        return;
    };
    let base_file = value(&manifest.base).and_then(|written| folder.name_of(written).ok());
    if base_file.is_some() && folder.name_of(&base.file).ok() != base_file {
        report.push(
            Diagnostic::error("base-row", file, Place::Line(base.line))
                .problem(format!("the first row names `{}`, which is not the base of garment.toml", base.file))
                .help("The first row is the base in the T-pose; put it there, rotations 0, 0, 0, 1."),
        );
    } else if base.rotations.iter().all(|q| is_near(*q, HALF_TURN_ABOUT_X)) {
        report.push(
            Diagnostic::error("base-pose", file, Place::Line(base.line))
                .problem("every joint of the base has 1 in the column of qx and 0 in that of qw: w is written first")
                .help("Move the columns' values: the order is qx, qy, qz, qw, so 0, 0, 0, 1 is no rotation; or rename the columns in the order w, x, y, z."),
        );
        // What the rows are is not known before that is mended.
        return;
    } else if let Some(at) = base.rotations.iter().position(|q| !is_near(*q, Quat::IDENTITY)) {
        report.push(
            Diagnostic::error("base-pose", file, Place::Line(base.line))
                .problem(format!("the base is not in the T-pose: {} is turned", table.bones[at].name()))
                .help("Drape the base in the T-pose; its rotations are 0, 0, 0, 1, and all others are relative to it."),
        );
    }
    if targets.is_empty() {
        report.push(
            Diagnostic::error("no-targets", file, Place::File)
                .problem("there are no targets, only the base, so nothing could move")
                .help("Export the kimono in each pose (poses/01_name.obj, …) and add a row per pose."),
        );
    }
    if targets.len() > limits::TARGETS {
        report.push(
            Diagnostic::error("too-many-targets", file, Place::File)
                .problem(format!("{} targets are more than a pack can hold", grouped(targets.len())))
                .help(format!("Use at most {}.", grouped(limits::TARGETS))),
        );
        // Rows are compared two by two.
        return;
    }
    check_rows(table, file, manifest, folder, report);
}

/// Rows against each other: names, files and poses that occur twice.
fn check_rows(table: &PoseTable, file: &str, manifest: &Manifest, folder: &Folder, report: &mut Vec<Diagnostic>) {
    let mut causes = Causes::default();
    let mut lines_of: BTreeMap<(&str, String), u32> = BTreeMap::new();
    for row in &table.rows {
        let shape = folder.name_of(&row.file).unwrap_or_else(|_| row.file.clone());
        for (what, key, shown) in [("name", row.name.to_lowercase(), &row.name), ("file", shape, &row.file)] {
            let line = *lines_of.entry((what, key)).or_insert(row.line);
            if line != row.line {
                causes.add("duplicate-target", format!("{what} {line}"), || {
                    Diagnostic::error("duplicate-target", file, Place::Line(row.line))
                        .problem(format!("the {what} `{shown}` stands in line {line} already"))
                        .help(
                            "Give every target a file and a name of its own (upper and lower case count as the same).",
                        )
                });
            }
        }
        if row.name.len() > limits::NAME_BYTES || !can_name_a_file(&row.name) {
            causes.add("target-name", "", || {
                Diagnostic::error("target-name", file, Place::Line(row.line))
                    .problem("the name is too long or has characters that no file name may have")
                    .help(format!("Use at most {} bytes of printable text without / and \\.", limits::NAME_BYTES))
            });
        }
    }
    // Unless every driver is right, nobody knows which joints are compared.
    let driven = |driver: &DriverEntry| -> Option<Vec<Bone>> {
        driver.joints.as_ref()?.iter().map(|joint| joint.get().map(|name| name.0)).collect()
    };
    let joints: Option<Vec<Vec<Bone>>> = manifest.drivers.iter().map(driven).collect();
    let joints = joints.unwrap_or_default().concat();
    let rotations = untwisted(table);
    // Each row is held against those that are no copies themselves, so that many copies cost no more than one.
    let mut own: Vec<usize> = Vec::new();
    for (i, row) in table.rows.iter().enumerate().take(limits::TARGETS + 1) {
        let copied = |&of: &usize| Some((of, copied(table, &rotations, &joints, i, of)?));
        let Some((of, said)) = own.iter().find_map(copied) else {
            own.push(i);
            continue;
        };
        let other = &table.rows[of];
        causes.add("equal-poses", format!("{of} {said}"), || {
            Diagnostic::error("equal-poses", file, Place::Line(row.line))
                .problem(format!("the poses `{}` and `{}` (line {}) {said}", row.name, other.name, other.line))
                .help("Correct the rotations, leave one of the two out, or give a driver the joint that differs.")
        });
    }
    causes.report("row", report);
}

/// Why nobody can tell two rows apart, as the rest of a sentence; `None` where they differ.
fn copied(table: &PoseTable, rotations: &[Vec<Quat>], joints: &[Bone], a: usize, b: usize) -> Option<&'static str> {
    let differing = table.bones.iter().zip(rotations[a].iter().zip(&rotations[b]));
    let mut differing = differing.filter(|(_, (a, b))| !is_near(**a, **b)).map(|(bone, _)| bone).peekable();
    if differing.peek().is_none() {
        let (a, b) = (&table.rows[a].rotations, &table.rows[b].rotations);
        return Some(match a.iter().zip(b).all(|(a, b)| is_near(*a, *b)) {
            true => "differ by less than 1 degree in every joint",
            false => "differ only in the twist of arms, which turn inside the sleeves",
        });
    }
    (!joints.is_empty() && !differing.any(|bone| joints.contains(bone)))
        .then_some("differ only in joints that no driver compares")
}

/// The rotations of every row as the cloth follows them.
fn untwisted(table: &PoseTable) -> Vec<Vec<Quat>> {
    let poses = table.poses().into_iter().map(|pose| pose.with_arms_untwisted());
    poses.map(|pose| table.bones.iter().map(|&bone| pose.rotation(bone)).collect()).collect()
}

/// Whether two unit quaternions are less than one degree apart.
fn is_near(a: Quat, b: Quat) -> bool {
    a.dot(b).abs() > COS_HALF_DEGREE
}

/// Named joints that are right, with their places.
fn right_joints(joints: &Option<Vec<Field<BoneName>>>) -> impl Iterator<Item = (&Field<BoneName>, Bone)> {
    joints.iter().flatten().filter_map(|field| Some((field, field.get()?.0)))
}

/// The drivers of the manifest; `None` when one of them is incomplete.
fn check_drivers(
    manifest: &Manifest,
    file: &str,
    poses: Option<&PoseTable>,
    report: &mut Vec<Diagnostic>,
) -> Option<Vec<ir::Driver>> {
    if manifest.drivers.is_empty() || manifest.drivers.len() > limits::DRIVERS {
        report.push(
            Diagnostic::error("driver-count", file, Place::File)
                .problem(format!("there are {} drivers", manifest.drivers.len()))
                .help(format!("Give 1 to {} [[driver]] tables: joints whose poses choose the shape.", limits::DRIVERS)),
        );
    }
    let mut names: Vec<&str> = Vec::new();
    for driver in &manifest.drivers {
        if let (Some(field), Some(name)) = (&driver.name, value(&driver.name)) {
            if names.contains(&name.as_str()) {
                report.push(
                    Diagnostic::error("duplicate-driver", file, field.place())
                        .problem(format!("two drivers are called `{name}`"))
                        .help("Give every driver a name of its own."),
                );
            }
            if name.is_empty() || name.len() > limits::NAME_BYTES || !can_name_a_file(name) {
                report.push(
                    Diagnostic::error("driver-name", file, field.place())
                        .problem("the driver's name is empty, too long, or has characters that no file name may have")
                        .help(format!("Use 1 to {} bytes of printable text without / and \\.", limits::NAME_BYTES)),
                );
            }
            names.push(name);
        }
        check_joint_names(&driver.joints, driver.name.as_ref(), file, poses, report);
        if let (Some(field), Some(threshold)) = (&driver.threshold, value(&driver.threshold))
            && !(threshold.radians() > 0.0 && threshold.radians() <= std::f64::consts::PI)
        {
            report.push(
                Diagnostic::error("threshold", file, field.place())
                    .problem(format!("a threshold of {threshold} lets no pose or every pose be similar"))
                    .help("Choose more than 0 and at most 180 deg; 60 deg suits shoulders and elbows."),
            );
        }
    }
    let driver = |driver: &DriverEntry| {
        Some(ir::Driver {
            name: value(&driver.name)?.clone(),
            group: value(&driver.group).or(value(&driver.name))?.clone(),
            joints: right_joints(&driver.joints).map(|(_, bone)| bone).collect(),
            threshold_rad: value(&driver.threshold)?.radians() as f32,
            layer: 0,
        })
    };
    sides::check_groups(manifest, file, report);
    manifest.drivers.iter().map(driver).collect()
}

/// The limits of the manifest; `None` when one of them is incomplete.
fn check_limits(
    manifest: &Manifest,
    file: &str,
    poses: Option<&PoseTable>,
    report: &mut Vec<Diagnostic>,
) -> Option<Vec<PoseLimit>> {
    if manifest.limits.len() > limits::POSE_LIMITS {
        report.push(
            Diagnostic::error("limit-count", file, Place::File)
                .problem(format!("there are {} [[limit]] tables", manifest.limits.len()))
                .help(format!("Give at most {}; joints that hold each other back stand in one.", limits::POSE_LIMITS)),
        );
    }
    for limit in &manifest.limits {
        check_joint_names(&limit.joints, limit.margin.as_ref(), file, poses, report);
        if let (Some(field), Some(margin)) = (&limit.margin, value(&limit.margin))
            && !MARGIN_DEG.contains(&margin.radians().to_degrees())
        {
            report.push(
                Diagnostic::error("limit-margin", file, field.place())
                    .problem(format!("a margin of {margin} stops the wearer dead or not at all"))
                    .help("Choose 0.5 to 45 deg; 5 deg is usual."),
            );
        }
    }
    let limit = |limit: &LimitEntry| {
        Some(PoseLimit {
            bones: right_joints(&limit.joints).map(|(_, bone)| bone).collect(),
            margin_rad: value(&limit.margin)?.radians() as f32,
            bounds: Vec::new(),
        })
    };
    manifest.limits.iter().map(limit).collect()
}

/// The joints of a driver or limit; what is wrong with all of them is said at `owner`.
fn check_joint_names<T>(
    joints: &Option<Vec<Field<BoneName>>>,
    owner: Option<&Field<T>>,
    file: &str,
    poses: Option<&PoseTable>,
    report: &mut Vec<Diagnostic>,
) {
    if joints.as_ref().is_some_and(Vec::is_empty) {
        report.push(
            Diagnostic::error("driver-joints", file, owner.map_or(Place::File, Field::place))
                .problem("there are no joints in this list")
                .help("Name one or more, for example joints = [\"rightLowerArm\"]."),
        );
    }
    let mut seen = Vec::new();
    for (field, bone) in right_joints(joints) {
        if seen.contains(&bone) {
            report.push(
                Diagnostic::error("driver-joints", file, field.place())
                    .problem(format!("the joint {} is named twice", bone.name()))
                    .help("Name each joint once."),
            );
        }
        seen.push(bone);
        if poses.is_some_and(|table| !table.bones.contains(&bone)) {
            report.push(
                Diagnostic::error("missing-joint", file, field.place())
                    .problem(format!("the pose table gives no rotations of {}", bone.name()))
                    .help(format!("Add the columns {0}_qx,{0}_qy,{0}_qz,{0}_qw, or name another joint.", bone.name())),
            );
        }
    }
}

/// Whether the body has the joints of drivers, limits and pose table, and those that carry the skirt.
fn check_joints(
    manifest: &Manifest,
    file: &str,
    poses: Option<&(PoseTable, &str)>,
    body: &ir::Body,
    report: &mut Vec<Diagnostic>,
) {
    let lacks = |bone: &Bone| body.skeleton.index_of(*bone).is_none();
    let body_place = manifest.body.as_ref().map_or(Place::File, Field::place);
    for bone in [Bone::Hips, Bone::LeftUpperLeg, Bone::RightUpperLeg].iter().filter(|bone| lacks(bone)) {
        report.push(
            Diagnostic::error("missing-joint", file, body_place.clone())
                .problem(format!("the body has no joint {}, which carries the skirt", bone.name()))
                .help("Use a body with the joints hips, leftUpperLeg and rightUpperLeg."),
        );
    }
    let of_drivers = manifest.drivers.iter().map(|driver| &driver.joints);
    let joints = of_drivers.chain(manifest.limits.iter().map(|limit| &limit.joints)).flat_map(right_joints);
    for (field, bone) in joints.filter(|(_, bone)| lacks(bone)) {
        report.push(
            Diagnostic::error("missing-joint", file, field.place())
                .problem(format!("the body has no joint {}", bone.name()))
                .help("Name a joint of the body's skeleton."),
        );
    }
    if let Some((table, poses_file)) = poses {
        for bone in table.bones.iter().filter(|bone| lacks(bone)) {
            report.push(
                Diagnostic::error("missing-joint", *poses_file, Place::Line(1))
                    .problem(format!("the table turns {}, which the body does not have", bone.name()))
                    .help("Remove its columns, or use a body with that joint."),
            );
        }
    }
}

/// Paths run along edges of the base.
fn check_paths(paths: &Paths, file: &str, base_file: &str, base: &ir::Surface, report: &mut Vec<Diagnostic>) {
    let edges = mesh::edges(&base.triangles);
    let count = base.positions_m.len();
    for (name, path) in &paths.0 {
        if let (Some(field), Some(load)) = (&path.load, value(&path.load))
            && !LOAD.contains(load)
        {
            report.push(
                Diagnostic::error("path-load", file, field.place())
                    .problem(format!("a load of {load} makes the path {name} count for nothing or for everything"))
                    .help("Choose 0.001 to 1000; 1 is usual."),
            );
        }
        if let (Some(field), Some(rule)) = (&path.rule, value(&path.rule))
            && !rules::DIMENSIONS.iter().any(|(known, _)| known == rule)
        {
            let problem = match closest(rule, rules::DIMENSIONS.iter().map(|(known, _)| *known)) {
                Some(similar) => format!("the rule sets have no dimension `{rule}`; did you mean `{similar}`?"),
                None => format!("the rule sets have no dimension `{rule}`"),
            };
            let all: Vec<&str> = rules::DIMENSIONS.iter().map(|(known, _)| *known).collect();
            report.push(
                Diagnostic::error("path-rule", file, field.place())
                    .problem(problem)
                    .help(format!("The dimensions are {}.", all.join(", "))),
            );
        }
        let Some(vertices) = &path.vertices else { continue };
        let known: Vec<(Place, u32)> =
            vertices.iter().filter_map(|field| Some((field.place(), *field.get()?))).collect();
        if vertices.len() < 2 {
            report.push(
                Diagnostic::error("short-path", file, vertices.first().map_or(Place::File, Field::place))
                    .problem(format!("the path {name} joins no two vertices"))
                    .help("A path needs two or more vertices."),
            );
        }
        for (place, vertex) in &known {
            if *vertex as usize >= count {
                report.push(
                    Diagnostic::error("path-vertex", file, place.clone())
                        .problem(format!("vertex {vertex} of the path {name} does not exist in {base_file}"))
                        .help(format!("Vertices are numbered from 0 to {}.", count.saturating_sub(1))),
                );
            }
        }
        for pair in known.windows(2) {
            let ((_, from), (place, to)) = (&pair[0], &pair[1]);
            let is_edge = edges.binary_search(&[*from.min(to), *from.max(to)]).is_ok();
            if !is_edge && (*from.max(to) as usize) < count {
                report.push(
                    Diagnostic::error("path-off-edge", file, place.clone())
                        .problem(format!("no edge of {base_file} joins vertices {from} and {to} of the path {name}"))
                        .help("Name every vertex on the way, from neighbour to neighbour, numbered from 0."),
                );
            }
        }
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
