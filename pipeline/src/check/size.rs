//! Whether the sizes of a kimono fit together: the table, the skeletons of its bodies, and shapes that are the base tailored otherwise.

use super::target::{self, Reference};
use super::{NamedMesh, grouped};
use crate::diagnostic::{Diagnostic, Place};
use crate::ir;
use crate::source::folder::Folder;
use crate::source::obj::{Corner, Mesh};
use crate::source::sizes::SizeTable;
use glam::{DVec3, Vec3};
use kitsuke::fit::{SizeBody, limits};
use kitsuke::measurement::Measurement;
use kitsuke::skeleton::{Bone, Skeleton};

/// How far the joints of the table's first row may lie from those of the garment's body, metres.
const SAME_JOINT_M: f32 = 2e-3;
/// How far a joint may lie from the base's, as a share of the skeleton's height: between the bodies of a child and of a giant.
const JOINT_SHIFT: f32 = 0.5;

/// The size table with its name, and how to read its numbers.
pub(super) struct Table<'a> {
    pub(super) file: &'a str,
    pub(super) table: &'a SizeTable,
    pub(super) place: &'a dyn Fn(&DVec3) -> Vec3,
}

/// The bodies of the table, with their joints in the skeleton's order; reports what is wrong with the table.
pub(super) fn check_table(
    Table { file, table, place }: &Table<'_>,
    folder: &Folder,
    base_file: Option<&str>,
    skeleton: Option<&Skeleton>,
    report: &mut Vec<Diagnostic>,
) -> Vec<SizeBody> {
    let Some((base, shapes)) = table.rows.split_first().filter(|(_, shapes)| !shapes.is_empty()) else {
        report.push(
            Diagnostic::error("no-sizes", *file, Place::File)
                .problem("the size table has no size but the base")
                .help("Give one row per shape: first the base, then the kimono on each other body; or remove `sizes` from garment.toml."),
        );
        return Vec::new();
    };
    if shapes.len() > limits::SIZES {
        report.push(
            Diagnostic::error("too-many-sizes", *file, Place::File)
                .problem(format!("{} sizes are more than a pack can hold", grouped(shapes.len())))
                .help(format!("Use at most {}.", limits::SIZES)),
        );
    }
    if base_file.is_some() && folder.name_of(&base.file).ok().as_deref() != base_file {
        report.push(
            Diagnostic::error("base-row", *file, Place::Line(base.line))
                .problem(format!("the first row names `{}`, which is not the base of garment.toml", base.file))
                .help("The first row is the base and the body that wears it; put it there."),
        );
    }
    for (i, row) in table.rows.iter().enumerate() {
        for earlier in &table.rows[..i] {
            let same_file = folder.name_of(&earlier.file).ok() == folder.name_of(&row.file).ok();
            for (what, shown, is_same) in [
                ("file", &row.file, same_file),
                ("body", &row.body, earlier.body.to_lowercase() == row.body.to_lowercase()),
            ] {
                if is_same {
                    report.push(
                        Diagnostic::error("duplicate-size", *file, Place::Line(row.line))
                            .problem(format!("the {what} `{shown}` stands in line {} already", earlier.line))
                            .help("Give every size a file and a body of its own (upper and lower case count as the same)."),
                    );
                }
            }
        }
        if row.body.len() > kitsuke::arrays::limits::NAME_BYTES || row.body.chars().any(char::is_control) {
            report.push(
                Diagnostic::error("size-name", *file, Place::Line(row.line))
                    .problem("the body's name is too long or not printable")
                    .help(format!("Use at most {} bytes of printable text.", kitsuke::arrays::limits::NAME_BYTES)),
            );
        }
    }
    let Some(skeleton) = skeleton else { return Vec::new() };
    if !has_all_joints(file, table, skeleton, report) {
        return Vec::new();
    }
    let bodies: Vec<SizeBody> = table.rows.iter().map(|row| body(table, row, skeleton, place)).collect();
    check_joints(file, table, &bodies, skeleton, report);
    bodies
}

fn body(
    table: &SizeTable,
    row: &crate::source::sizes::SizeRow,
    skeleton: &Skeleton,
    place: &dyn Fn(&DVec3) -> Vec3,
) -> SizeBody {
    let at = |bone: Bone| table.bones.iter().position(|b| *b == bone).expect("the table has every joint");
    let joints_m = skeleton.joints().iter().map(|joint| place(&row.joints[at(joint.bone)])).collect();
    SizeBody { name: row.body.clone(), measurements: row.measurements, joints_m }
}

fn has_all_joints(file: &str, table: &SizeTable, skeleton: &Skeleton, report: &mut Vec<Diagnostic>) -> bool {
    let lacking: Vec<&str> = skeleton
        .joints()
        .iter()
        .map(|joint| joint.bone)
        .filter(|bone| !table.bones.contains(bone))
        .map(Bone::name)
        .collect();
    if !lacking.is_empty() {
        report.push(
            Diagnostic::error("size-joints", file, Place::Line(1))
                .problem(format!("the table does not say where these joints are: {}", lacking.join(", ")))
                .help("Add the columns JOINT_x, JOINT_y, JOINT_z for every joint of the body of garment.toml."),
        );
    }
    for bone in table.bones.iter().filter(|bone| skeleton.index_of(**bone).is_none()) {
        report.push(
            Diagnostic::error("size-joints", file, Place::Line(1))
                .problem(format!("the table places {}, which the body of garment.toml does not have", bone.name()))
                .help("Remove its columns, or use a body with that joint."),
        );
    }
    lacking.is_empty()
}

fn check_joints(file: &str, table: &SizeTable, bodies: &[SizeBody], skeleton: &Skeleton, report: &mut Vec<Diagnostic>) {
    let rest_m: Vec<Vec3> = skeleton.joints().iter().map(|joint| joint.rest_m).collect();
    let (low, high) = target::bounds(&rest_m);
    let height_m = (high - low).max_element();
    for (row, body) in table.rows.iter().zip(bodies) {
        let is_base = row.line == table.rows[0].line;
        let limit_m = if is_base { SAME_JOINT_M } else { JOINT_SHIFT * height_m };
        let distances =
            skeleton.joints().iter().zip(&body.joints_m).map(|(joint, at)| (joint.rest_m.distance(*at), joint.bone));
        let farthest = distances.max_by(|a, b| a.0.total_cmp(&b.0)).filter(|(distance_m, _)| *distance_m > limit_m);
        let Some((distance_m, bone)) = farthest else { continue };
        let problem = if is_base {
            format!("{} lies {:.1} mm from its place in the body of garment.toml", bone.name(), distance_m * 1e3)
        } else {
            format!("{} lies {distance_m:.2} m from its place in the base's body", bone.name())
        };
        report.push(
            Diagnostic::error("size-joints", file, Place::Line(row.line))
                .problem(problem)
                .help("Joints are places in the T-pose in the unit and axes of garment.toml; the first row is the body of garment.toml."),
        );
    }
}

/// Joints near which the cloth lies on the body in the T-pose: it goes where they go from body to body.
const WORN: [Bone; 5] = [Bone::Neck, Bone::LeftUpperArm, Bone::RightUpperArm, Bone::LeftLowerArm, Bone::RightLowerArm];
/// One in so many vertices of the cloth, those nearest to a joint, lie around it.
const AROUND: usize = 70;
/// How far the cloth around a joint may lie from where the joint takes it, as a share of the skeleton's height: on ten bodies of a
/// sample no more than 0.018, on that of another one 4 cm shorter 0.04.
const OFF_JOINT: f32 = 0.03;
/// How far the ratio of body height to skeleton may lie from the base's; on the sample 0.005.
const OFF_HEIGHT: f32 = 0.04;

/// Reports sizes that do not lie on the bodies of their rows, and heights that are not those of the rows' joints.
pub(super) fn check_worn(
    Table { file, table, .. }: &Table<'_>,
    bodies: &[SizeBody],
    shapes: &[(usize, &[Vec3])],
    base_m: &[Vec3],
    skeleton: &Skeleton,
    report: &mut Vec<Diagnostic>,
) {
    let Some(base) = bodies.first() else { return };
    let (low, high) = target::bounds(&base.joints_m);
    let height_m = (high - low).max_element();
    let joints: Vec<(Bone, usize)> = WORN.iter().filter_map(|&bone| Some((bone, skeleton.index_of(bone)?))).collect();
    let around = |joint: usize| {
        let mut by_distance: Vec<(f32, u32)> =
            base_m.iter().zip(0..).map(|(place_m, v)| (place_m.distance_squared(base.joints_m[joint]), v)).collect();
        by_distance.sort_unstable_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        by_distance.truncate(base_m.len().div_ceil(AROUND));
        by_distance
    };
    let around: Vec<Vec<(f32, u32)>> = joints.iter().map(|(_, joint)| around(*joint)).collect();
    for (row, shape_m) in shapes {
        let body = &bodies[*row];
        let off = joints.iter().zip(&around).map(|((bone, joint), near)| {
            let moved: Vec3 = near.iter().map(|(_, v)| shape_m[*v as usize] - base_m[*v as usize]).sum();
            let off = moved / near.len().max(1) as f32 - (body.joints_m[*joint] - base.joints_m[*joint]);
            (off.length(), *bone)
        });
        let Some((off_m, bone)) = off.max_by(|a, b| a.0.total_cmp(&b.0)).filter(|(m, _)| *m > OFF_JOINT * height_m)
        else {
            continue;
        };
        report.push(
            Diagnostic::error("size-place", *file, Place::Line(table.rows[*row].line))
                .problem(format!(
                    "the shape `{}` does not lie on the body of its row: around {} it is {:.0} cm from there",
                    table.rows[*row].file,
                    bone.name(),
                    off_m * 100.0
                ))
                .help("Look whether the row has another body's file or joints, and whether the kimono was draped there in the T-pose and not moved since."),
        );
    }
    let tallness = |row: usize| {
        let (low, high) = target::bounds(&bodies[row].joints_m);
        Some(bodies[row].measurements.get(Measurement::BodyHeight)? / (high.y - low.y))
    };
    for (row, body) in bodies.iter().enumerate().skip(1) {
        let Some((own, usual)) = tallness(row).zip(tallness(0)) else { continue };
        if (own / usual - 1.0).abs() > OFF_HEIGHT {
            let expected_m = body.measurements.get(Measurement::BodyHeight).unwrap_or_default() * usual / own;
            report.push(
                Diagnostic::warning("size-height", *file, Place::Line(table.rows[row].line))
                    .problem(format!(
                        "the body height of {} does not go with its joints, which are those of a body of about {:.0} cm",
                        body.name,
                        expected_m * 100.0
                    ))
                    .help("Look whether the measurements or the joints are those of another row."),
            );
        }
    }
}

/// One size's shape, if it is the base tailored otherwise; reports why not.
pub(super) fn check_shape(
    reference: &Reference<'_>,
    base: NamedMesh<'_>,
    shape: NamedMesh<'_>,
    file: &str,
    positions_m: Vec<Vec3>,
    report: &mut Vec<Diagnostic>,
) -> Option<ir::SizeShape> {
    if !target::check_size(reference, shape, &positions_m, report) || !has_same_uv(base, shape, report) {
        return None;
    }
    Some(self::shape(base, shape, file, positions_m))
}

/// A size's shape; without texture coordinates where the base has none.
pub(super) fn shape(base: NamedMesh<'_>, shape: NamedMesh<'_>, file: &str, positions_m: Vec<Vec3>) -> ir::SizeShape {
    let uv = if base.mesh.is_textured() { shape.mesh.uv.clone() } else { Vec::new() };
    ir::SizeShape { file: file.to_owned(), positions_m, uv }
}

/// Whether the texture coordinates are those of the base, up to where on the cloth they are.
fn has_same_uv(base: NamedMesh<'_>, shape: NamedMesh<'_>, report: &mut Vec<Diagnostic>) -> bool {
    if !base.mesh.is_textured() {
        return true;
    }
    let problem = if !shape.mesh.is_textured() {
        format!("the size has no texture coordinates, but {} has", base.file)
    } else if shape.mesh.uv.len() != base.mesh.uv.len() {
        let (has, wants) = (grouped(shape.mesh.uv.len()), grouped(base.mesh.uv.len()));
        format!("{has} texture coordinates, but {} has {wants}", base.file)
    } else if corner_cycles(shape.mesh) != corner_cycles(base.mesh) {
        format!("the corners of the faces have other texture coordinates (vt numbers) than in {}", base.file)
    } else {
        return true;
    };
    report.push(Diagnostic::error("size-uv", shape.file, Place::File).problem(problem).help(
        "Export every size with the texture coordinates of its own pattern pieces and with the settings of the base; vt number i must \
         be the same point of the same piece in every file.",
    ));
    false
}

/// The faces as cycles of corners from the least, sorted.
fn corner_cycles(mesh: &Mesh) -> Vec<Vec<Corner>> {
    let cycle = |corners: &[Corner]| {
        let least = (0..corners.len()).min_by_key(|&i| corners[i]).unwrap_or(0);
        [&corners[least..], &corners[..least]].concat()
    };
    let mut cycles: Vec<Vec<Corner>> = mesh.faces.iter().map(|face| cycle(mesh.corners_of(face))).collect();
    cycles.sort_unstable();
    cycles
}
