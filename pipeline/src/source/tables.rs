//! `poses.csv`: one row per sample, its joint rotations relative to the T-pose, as quaternions or as angles in degrees. Knows nothing of
//! the files that its rows name.
//!
//! Angles `rx_deg`, `ry_deg`, `rz_deg` turn a joint about X, then about Y, then about Z: the axes of the T-pose (X to the wearer's left, Y up,
//! Z to the front), as they lie in the joint that it hangs on. Those that the table lacks are 0.

use super::causes::Causes;
use super::delimited::{self, Cells, Row};
use super::manifest::unknown_bone;
use super::numbers;
use crate::diagnostic::{Diagnostic, Place};
use glam::{DQuat, Quat};
use kitsuke::skeleton::{Bone, Pose};

/// How far a quaternion's length may lie from 1.
const UNIT_TOLERANCE: f64 = 1e-3;
/// Most rows that are read.
const ROWS: usize = 100_000;

/// The pose table as written.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct PoseTable {
    /// The joints that it gives, in the order of its columns.
    pub bones: Vec<Bone>,
    /// Its rows; the first is the base.
    pub rows: Vec<PoseRow>,
}

/// One row.
#[derive(Clone, Debug, PartialEq)]
pub struct PoseRow {
    /// 1-based line in the file.
    pub line: u32,
    /// The shape's file, relative to the garment folder, perhaps with a morph target behind `#`; empty where the table has no such column.
    pub file: String,
    /// The sample's name; empty where the table has no such column.
    pub name: String,
    /// Unit quaternions of the table's bones, relative to the T-pose.
    pub rotations: Vec<Quat>,
}

impl PoseTable {
    /// The poses of all rows; bones that the table lacks stay in the T-pose.
    #[must_use]
    pub fn poses(&self) -> Vec<Pose> {
        let pose =
            |row: &PoseRow| self.bones.iter().zip(&row.rotations).fold(Pose::REST, |pose, (&b, &q)| pose.with(b, q));
        self.rows.iter().map(pose).collect()
    }
}

/// What a header names.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Column {
    File,
    Name,
    /// Component 0..4 (x, y, z, w) of a bone's rotation.
    Rotation(Bone, usize),
    /// Angle about axis 0..3 (x, y, z), degrees.
    Angle(Bone, usize),
    Ignored,
}

/// Reads a garment's pose table: `file`, `name` and rotations.
pub fn read(file: &str, bytes: &[u8], report: &mut Vec<Diagnostic>) -> Option<PoseTable> {
    let before = report.len();
    let table = read_rotations(file, bytes, report)?;
    let mut causes = Causes::default();
    for row in &table.rows {
        for (what, value) in [("file", &row.file), ("name", &row.name)] {
            if value.is_empty() {
                causes.add("pose-row", what, || {
                    Diagnostic::error("pose-row", file, Place::Line(row.line))
                        .problem(format!("this row has no {what}"))
                        .help("Each row gives file, name and the joint rotations; the header's first columns are file,name.")
                });
            }
        }
    }
    causes.report("row", report);
    check_axes(file, bytes, &table, report);
    (report.len() == before).then_some(table)
}

/// A joint that lacks the column of one axis, about which the joint of the other side turns.
fn check_axes(file: &str, bytes: &[u8], table: &PoseTable, report: &mut Vec<Diagnostic>) {
    let Some(Cells { header, header_place, .. }) = read_csv(file, bytes, ROWS, &mut Vec::new()) else { return };
    let columns: Vec<Column> = header.iter().map(|name| column(file, name, &header_place, &mut Vec::new())).collect();
    for (&bone, axis) in table.bones.iter().flat_map(|bone| [0, 1, 2].map(|axis| (bone, axis))) {
        let has = |bone: Bone, axis: usize| columns.contains(&Column::Angle(bone, axis));
        let lacks_one = !has(bone, axis) && (0..3).all(|other| other == axis || has(bone, other));
        let other = bone.mirrored();
        let turns = |row: &PoseRow| {
            let at = table.bones.iter().position(|bone| *bone == other);
            at.is_some_and(|at| row.rotations[at].to_array()[axis].abs() > 1e-3)
        };
        if lacks_one && other != bone && has(other, axis) && table.rows.iter().any(turns) {
            let (missing, known) =
                (format!("{}_{}_deg", bone.name(), ANGLES[axis]), format!("{}_{}_deg", other.name(), ANGLES[axis]));
            report.push(
                Diagnostic::error("pose-column", file, header_place.clone())
                    .problem(format!("the column {missing} is missing, though there is {known}"))
                    .help(format!("Add {missing}; 0 is no rotation.")),
            );
        }
    }
}

/// Reads only what a list of poses needs: the rotations. `file` and `name` may be absent, and files need not exist.
pub fn read_rotations(file: &str, bytes: &[u8], report: &mut Vec<Diagnostic>) -> Option<PoseTable> {
    let before = report.len();
    let Cells { header: headers, header_place, rows: records } = read_csv(file, bytes, ROWS, report)?;
    let before_header = report.len();
    let columns: Vec<Column> = headers.iter().map(|header| column(file, header, &header_place, report)).collect();
    let mut bones: Vec<Bone> = Vec::new();
    for column in &columns {
        if let Column::Rotation(bone, _) | Column::Angle(bone, _) = column
            && !bones.contains(bone)
        {
            bones.push(*bone);
        }
    }
    for bone in &bones {
        if has_angles_alone(file, *bone, &columns, &header_place, report) {
            continue;
        }
        for (i, axis) in AXES.iter().enumerate() {
            let count = columns.iter().filter(|c| matches!(c, Column::Rotation(b, j) if b == bone && *j == i)).count();
            if count != 1 {
                let problem = match count {
                    0 => format!("the column {}_{axis} is missing", bone.name()),
                    _ => format!("the column {}_{axis} occurs {count} times", bone.name()),
                };
                report.push(
                    Diagnostic::error("pose-column", file, header_place.clone())
                        .problem(problem)
                        .help(format!("A joint's rotation is four columns: {0}_qx,{0}_qy,{0}_qz,{0}_qw.", bone.name())),
                );
            }
        }
    }
    if bones.is_empty() {
        report.push(
            Diagnostic::error("pose-column", file, header_place.clone())
                .problem("the pose table has no joint rotations")
                .help("Add columns per joint: rightUpperArm_rz_deg (and rx, ry), or rightUpperArm_qx,rightUpperArm_qy,rightUpperArm_qz,rightUpperArm_qw."),
        );
    }
    if report.len() > before_header {
        return None;
    }
    let (mut of_cells, mut of_rotations) = (Causes::default(), Causes::default());
    let mut rows = Vec::new();
    let mut largest_deg: Option<f64> = None;
    for Row { line, cells, .. } in records {
        let mut row = PoseRow { line, file: String::new(), name: String::new(), rotations: Vec::new() };
        let mut parts = vec![Written::default(); bones.len()];
        for ((value, column), header) in cells.iter().zip(&columns).zip(&headers) {
            match column {
                Column::File => row.file = value.to_owned(),
                Column::Name => row.name = value.to_owned(),
                Column::Ignored => {}
                Column::Rotation(bone, i) | Column::Angle(bone, i) => {
                    let at = bones.iter().position(|b| b == bone).expect("every rotation column's bone is listed");
                    let number = numbers::read(value);
                    let is_angle = matches!(column, Column::Angle(..));
                    let value_deg = number.as_ref().ok().copied();
                    if let (true, Some(angle_deg)) = (is_angle, value_deg) {
                        largest_deg = Some(largest_deg.unwrap_or(0.0).max(angle_deg.abs()));
                    }
                    match is_angle {
                        true => parts[at].turn(*i, value_deg),
                        false => parts[at].add(*i, value, value_deg),
                    }
                    if let Err(wrong) = number {
                        let cause = if wrong.cause.is_empty() { value } else { wrong.cause };
                        of_cells.add("pose-number", cause, || {
                            Diagnostic::error("pose-number", file, Place::Line(line))
                                .problem(format!("{header}: {}", wrong.problem))
                                .help(wrong.help.as_deref().unwrap_or(if is_angle {
                                    "Give the angle in degrees; 0 is no rotation."
                                } else {
                                    "Give the joint's rotation against the T-pose as a unit quaternion; 0, 0, 0, 1 is no rotation."
                                }))
                        });
                    }
                }
            }
        }
        for (bone, part) in bones.iter().zip(parts) {
            if let Some((cause, problem, help)) = part.mistake() {
                of_rotations.add("pose-quaternion", cause, || {
                    Diagnostic::error("pose-quaternion", file, Place::Line(line))
                        .problem(format!("the rotation of {} {problem}", bone.name()))
                        .help(help)
                });
            }
            row.rotations.push(part.rotation());
        }
        rows.push(row);
    }
    of_cells.report("cell", report);
    of_rotations.report("rotation", report);
    if report.len() == before && rows.len() > 1 {
        check_radians(file, &header_place, largest_deg, report);
    }
    (report.len() == before).then_some(PoseTable { bones, rows })
}

/// A rotation as its four cells have it.
#[derive(Clone, Copy, Default)]
pub(super) struct Written {
    parts: [f64; 4],
    /// The most decimals of any part; whoever rounds cells rounds them alike.
    decimals: usize,
    /// Whether a cell is no number.
    is_damaged: bool,
    /// Angles about X, Y and Z, where the table gives those.
    angles_deg: Option<[f64; 3]>,
}

impl Written {
    fn add(&mut self, i: usize, text: &str, number: Option<f64>) {
        self.parts[i] = number.unwrap_or(0.0);
        self.decimals = self.decimals.max(numbers::decimals(text).unwrap_or(usize::MAX));
        self.is_damaged |= number.is_none();
    }

    pub fn turn(&mut self, i: usize, angle_deg: Option<f64>) {
        self.angles_deg.get_or_insert_default()[i] = angle_deg.unwrap_or(0.0);
        self.is_damaged |= angle_deg.is_none();
    }

    pub fn rotation(&self) -> Quat {
        let Some(angles_deg) = self.angles_deg else { return DQuat::from_array(self.parts).normalize().as_quat() };
        let about = |i: usize| {
            let half = (angles_deg[i] / 2.0).to_radians();
            let mut parts = [0.0, 0.0, 0.0, libm::cos(half)];
            parts[i] = libm::sin(half);
            DQuat::from_array(parts)
        };
        (about(2) * about(1) * about(0)).normalize().as_quat()
    }

    /// Why this is no rotation, what is wrong, and what to do.
    pub fn mistake(&self) -> Option<(&'static str, String, String)> {
        if let Some(angles_deg) = self.angles_deg {
            let far_deg = angles_deg.into_iter().find(|angle_deg| angle_deg.abs() > 360.0 && !self.is_damaged)?;
            return Some((
                "angle",
                format!("is an angle of {far_deg} degrees, more than a whole turn"),
                "Give angles from -180 to 180 degrees.".to_owned(),
            ));
        }
        let [x, y, z, w] = self.parts;
        let length = DQuat::from_array(self.parts).length();
        if self.is_damaged || (length - 1.0).abs() <= UNIT_TOLERANCE {
            return None;
        }
        let largest = self.parts.iter().fold(0.0f64, |largest, part| largest.max(part.abs()));
        // Each of four parts is off by half a step, so their length by no more than one.
        let step = 0.1f64.powi(self.decimals.min(9) as i32);
        let turns: Vec<(char, f64)> =
            ['x', 'y', 'z'].into_iter().zip(self.parts).filter(|(_, turn)| *turn != 0.0).collect();
        if (1..=2).contains(&self.decimals) && (length - 1.0).abs() <= step + 1e-9 {
            let said = if self.decimals == 1 { "one decimal" } else { "two decimals" };
            return Some((
                "rounded",
                format!("has length {length:.4}, not 1: its numbers were rounded to {said} by a spreadsheet"),
                "Format the cells with six decimals and export again.".to_owned(),
            ));
        }
        if largest > std::f64::consts::PI {
            let help = match turns[..] {
                [(axis, degrees)] if w == 0.0 || w == 1.0 => {
                    let half = (degrees / 2.0).to_radians();
                    format!(
                        "A turn of {degrees} degrees about {axis} is q{axis} = {:.6}, qw = {:.6} and 0 in the two others.",
                        libm::sin(half),
                        libm::cos(half)
                    )
                }
                _ => "Give unit quaternions: for a turn of A degrees about one axis sin(A/2) in its column and cos(A/2) in qw."
                    .to_owned(),
            };
            return Some((
                "degrees",
                format!("is {x}, {y}, {z}, {w}; a quaternion's numbers lie between -1 and 1, these are degrees"),
                help,
            ));
        }
        Some((
            "length",
            format!("has length {length:.4}, not 1"),
            "Columns are qx, qy, qz, qw in this order; 0, 0, 0, 1 is no rotation.".to_owned(),
        ))
    }
}

/// Poses that turn no joint by more than a few degrees are angles in radians.
fn check_radians(file: &str, header: &Place, largest_deg: Option<f64>, report: &mut Vec<Diagnostic>) {
    if let Some(largest) = largest_deg.filter(|largest| (0.1..=std::f64::consts::PI).contains(largest)) {
        report.push(
            Diagnostic::error("pose-radians", file, header.clone())
                .problem(format!("the largest angle of the table is {largest} degrees: these are radians"))
                .help("Give the angles in degrees: multiply by 57.29578."),
        );
    }
}

/// Reads a table of at most `most` rows; nothing where it is no table.
pub(super) fn read_csv(file: &str, bytes: &[u8], most: usize, report: &mut Vec<Diagnostic>) -> Option<Cells> {
    let text = super::utf8(file, bytes, report)?;
    delimited::read(file, text, delimited::separator(delimited::first_line(text).as_bytes()), most, report)
}

pub(super) const AXES: [&str; 4] = ["qx", "qy", "qz", "qw"];
pub(super) const ANGLES: [&str; 3] = ["rx", "ry", "rz"];

/// Whether a bone's rotation is given as angles; reports columns that say it twice.
fn has_angles_alone(file: &str, bone: Bone, columns: &[Column], place: &Place, report: &mut Vec<Diagnostic>) -> bool {
    let angles =
        |i: usize| columns.iter().filter(|c| matches!(c, Column::Angle(b, j) if *b == bone && *j == i)).count();
    let counts = [angles(0), angles(1), angles(2)];
    if counts == [0; 3] {
        return false;
    }
    let is_twice = columns.iter().any(|column| matches!(column, Column::Rotation(b, _) if *b == bone));
    if is_twice || counts.iter().any(|count| *count > 1) {
        report.push(
            Diagnostic::error("pose-column", file, place.clone())
                .problem(format!("the rotation of {} is given more than once", bone.name()))
                .help("Give it as angles (_rx_deg, _ry_deg, _rz_deg) or as a quaternion (_qx, _qy, _qz, _qw), each column once."),
        );
    }
    true
}

/// What a header means; reports one that means nothing.
pub(super) fn column(file: &str, header: &str, place: &Place, report: &mut Vec<Diagnostic>) -> Column {
    match header {
        "file" => return Column::File,
        "name" => return Column::Name,
        "index" | "body" => return Column::Ignored,
        _ => {}
    }
    let angle = header.strip_suffix("_deg").and_then(|angle| angle.rsplit_once('_'));
    let angle = angle.and_then(|(bone, axis)| Some((bone, ANGLES.iter().position(|known| *known == axis)?)));
    if let Some((Some(bone), axis)) = angle.map(|(bone, axis)| (Bone::from_name(bone), axis)) {
        return Column::Angle(bone, axis);
    }
    let (bone, axis) = header.rsplit_once('_').unwrap_or((header, ""));
    let component = AXES.iter().position(|known| *known == axis);
    let is_position = matches!(axis, "x" | "y" | "z");
    let problem = match (component, Bone::from_name(bone)) {
        _ if let Some((bone, _)) = angle => unknown_bone(bone),
        (Some(component), Some(bone)) => return Column::Rotation(bone, component),
        (None, Some(_)) if is_position => return Column::Ignored,
        (component, None) if component.is_some() || is_position => unknown_bone(bone),
        _ => format!("the column `{header}` means nothing here"),
    };
    report.push(
        Diagnostic::error("pose-column", file, place.clone())
            .problem(problem)
            .help("Columns are file, name and, per joint, its VRM 1.0 name with _rx_deg, _ry_deg, _rz_deg, or with _qx, _qy, _qz, _qw."),
    );
    Column::Ignored
}
