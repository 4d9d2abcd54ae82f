//! The pose table against itself and the manifest: base row, names, files and poses that occur twice. Knows no shapes.

use super::{can_name_a_file, grouped, value};
use crate::diagnostic::{Diagnostic, Place};
use crate::source::causes::Causes;
use crate::source::folder::{Folder, composed};
use crate::source::manifest::{DriverEntry, Manifest};
use crate::source::tables::PoseTable;
use glam::Quat;
use kitsuke::arrays::limits;
use kitsuke::skeleton::Bone;
use std::collections::BTreeMap;

/// Cosine of half a degree: two rotations whose quaternions' product exceeds it are less than one degree apart.
const COS_HALF_DEGREE: f32 = 0.999_961_9;
/// What no rotation becomes where w is written first.
const HALF_TURN_ABOUT_X: Quat = Quat::from_xyzw(1.0, 0.0, 0.0, 0.0);

/// The pose table against itself and the manifest.
pub(super) fn check(table: &PoseTable, file: &str, manifest: &Manifest, folder: &Folder, report: &mut Vec<Diagnostic>) {
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
        for (what, key, shown) in [("name", composed(&row.name.to_lowercase()), &row.name), ("file", shape, &row.file)]
        {
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
pub(super) fn untwisted(table: &PoseTable) -> Vec<Vec<Quat>> {
    let poses = table.poses().into_iter().map(|pose| pose.with_arms_untwisted());
    poses.map(|pose| table.bones.iter().map(|&bone| pose.rotation(bone)).collect()).collect()
}

/// Whether two unit quaternions are less than one degree apart.
pub(super) fn is_near(a: Quat, b: Quat) -> bool {
    a.dot(b).abs() > COS_HALF_DEGREE
}
