//! Drivers and limits of the manifest, and whether pose table and body have their joints. Knows no shapes.

use super::{can_name_a_file, value};
use crate::diagnostic::{Diagnostic, Place};
use crate::ir;
use crate::source::manifest::{BoneName, DriverEntry, Field, LimitEntry, Manifest};
use crate::source::tables::PoseTable;
use kitsuke::arrays::{PoseLimit, limits};
use kitsuke::skeleton::Bone;

/// Poses that are draped lie farther apart, radians: 10 degrees.
const LEAST_THRESHOLD_RAD: f64 = 0.1745;

/// How much farther than the samples a limited joint may turn, degrees.
const MARGIN_DEG: std::ops::RangeInclusive<f64> = 0.5..=45.0;

/// Named joints that are right, with their places.
pub(super) fn right_joints(joints: &Option<Vec<Field<BoneName>>>) -> impl Iterator<Item = (&Field<BoneName>, Bone)> {
    joints.iter().flatten().filter_map(|field| Some((field, field.get()?.0)))
}

/// The drivers of the manifest; `None` when one of them is incomplete.
pub(super) fn check_drivers(
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
        } else if let (Some(field), Some(threshold)) = (&driver.threshold, value(&driver.threshold))
            && threshold.radians() < LEAST_THRESHOLD_RAD
        {
            report.push(
                Diagnostic::warning("threshold", file, field.place())
                    .problem(format!("a threshold of {threshold} lets hardly any pose be similar to another"))
                    .help("60 deg suits shoulders and elbows; a number that was meant in radians is written \"1.05 rad\"."),
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
    super::sides::check_groups(manifest, file, report);
    manifest.drivers.iter().map(driver).collect()
}

/// The limits of the manifest; `None` when one of them is incomplete.
pub(super) fn check_limits(
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
pub(super) fn check_joints(
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
