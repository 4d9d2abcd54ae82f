//! `poses.csv`: one row per sample, its joint rotations as quaternions relative to the T-pose. Knows nothing of the
//! files that its rows name.

use super::delimited::{self, Cells, Row};
use super::manifest::unknown_bone;
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
    /// The shape's file, relative to the garment folder; empty where the table has no such column.
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
enum Column {
    File,
    Name,
    /// Component 0..4 (x, y, z, w) of a bone's rotation.
    Rotation(Bone, usize),
    Ignored,
}

/// Reads a garment's pose table: `file`, `name` and rotations.
pub fn read(file: &str, bytes: &[u8], report: &mut Vec<Diagnostic>) -> Option<PoseTable> {
    let before = report.len();
    let table = read_rotations(file, bytes, report)?;
    for row in &table.rows {
        for (what, value) in [("file", &row.file), ("name", &row.name)] {
            if value.is_empty() {
                report.push(
                    Diagnostic::error("pose-row", file, Place::Line(row.line))
                        .problem(format!("this row has no {what}"))
                        .help("Each row gives file, name and the joint rotations; the header's first columns are file,name."),
                );
            }
        }
    }
    (report.len() == before).then_some(table)
}

/// Reads only what a list of poses needs: the rotations. `file` and `name` may be absent, and files need not exist.
pub fn read_rotations(file: &str, bytes: &[u8], report: &mut Vec<Diagnostic>) -> Option<PoseTable> {
    let before = report.len();
    let Cells { header: headers, rows: records } = read_csv(file, bytes, ROWS, report)?;
    let before_header = report.len();
    let columns: Vec<Column> = headers.iter().map(|header| column(file, header, report)).collect();
    let mut bones: Vec<Bone> = Vec::new();
    for column in &columns {
        if let Column::Rotation(bone, _) = column
            && !bones.contains(bone)
        {
            bones.push(*bone);
        }
    }
    for bone in &bones {
        for (i, axis) in AXES.iter().enumerate() {
            let count = columns.iter().filter(|c| matches!(c, Column::Rotation(b, j) if b == bone && *j == i)).count();
            if count != 1 {
                let problem = match count {
                    0 => format!("the column {}_{axis} is missing", bone.name()),
                    _ => format!("the column {}_{axis} occurs {count} times", bone.name()),
                };
                report.push(
                    Diagnostic::error("pose-column", file, Place::Line(1))
                        .problem(problem)
                        .help(format!("A joint's rotation is four columns: {0}_qx,{0}_qy,{0}_qz,{0}_qw.", bone.name())),
                );
            }
        }
    }
    if bones.is_empty() {
        report.push(
            Diagnostic::error("pose-column", file, Place::Line(1))
                .problem("the pose table has no joint rotations")
                .help("Add four columns per joint, for example rightUpperArm_qx,rightUpperArm_qy,rightUpperArm_qz,rightUpperArm_qw."),
        );
    }
    if report.len() > before_header {
        return None;
    }
    let mut rows = Vec::new();
    for Row { line, cells, .. } in records {
        let mut row = PoseRow { line, file: String::new(), name: String::new(), rotations: Vec::new() };
        let mut parts = vec![[0.0f64; 4]; bones.len()];
        for ((value, column), header) in cells.iter().zip(&columns).zip(&headers) {
            match column {
                Column::File => row.file = value.to_owned(),
                Column::Name => row.name = value.to_owned(),
                Column::Ignored => {}
                Column::Rotation(bone, i) => match value.parse::<f64>() {
                    Ok(number) if number.is_finite() => {
                        let at = bones.iter().position(|b| b == bone).expect("every rotation column's bone is listed");
                        parts[at][*i] = number;
                    }
                    _ => report.push(
                        Diagnostic::error("pose-number", file, Place::Line(line))
                            .problem(format!("{header} is `{value}`, which is no number"))
                            .help("Give the joint's rotation against the T-pose as a unit quaternion; 0, 0, 0, 1 is no rotation."),
                    ),
                },
            }
        }
        for (bone, part) in bones.iter().zip(parts) {
            let q = DQuat::from_array(part);
            if (q.length() - 1.0).abs() > UNIT_TOLERANCE && report.len() == before {
                report.push(
                    Diagnostic::error("pose-quaternion", file, Place::Line(line))
                        .problem(format!("the rotation of {} has length {:.4}, not 1", bone.name(), q.length()))
                        .help("Columns are qx, qy, qz, qw in this order; 0, 0, 0, 1 is no rotation."),
                );
            }
            row.rotations.push(q.normalize().as_quat());
        }
        rows.push(row);
    }
    (report.len() == before).then_some(PoseTable { bones, rows })
}

/// Reads a table of at most `most` rows between commas; nothing where it is no table.
pub(super) fn read_csv(file: &str, bytes: &[u8], most: usize, report: &mut Vec<Diagnostic>) -> Option<Cells> {
    let text = super::utf8(file, bytes, report)?;
    let separators = match delimited::separator(delimited::first_line(text).as_bytes()) {
        b';' => "semicolons",
        b'\t' => "tabs",
        comma => return delimited::read(file, text, comma, most, report),
    };
    report.push(
        Diagnostic::error("csv-syntax", file, Place::Line(1))
            .problem(format!("the columns are separated by {separators}, not by commas"))
            .help("Save the table with commas between columns, and with points in numbers."),
    );
    None
}

const AXES: [&str; 4] = ["qx", "qy", "qz", "qw"];

/// What a header means; reports one that means nothing.
fn column(file: &str, header: &str, report: &mut Vec<Diagnostic>) -> Column {
    match header {
        "file" => return Column::File,
        "name" => return Column::Name,
        "index" | "body" => return Column::Ignored,
        _ => {}
    }
    let (bone, axis) = header.rsplit_once('_').unwrap_or((header, ""));
    let component = AXES.iter().position(|known| *known == axis);
    let is_position = matches!(axis, "x" | "y" | "z");
    let problem = match (component, Bone::from_name(bone)) {
        (Some(component), Some(bone)) => return Column::Rotation(bone, component),
        (None, Some(_)) if is_position => return Column::Ignored,
        (component, None) if component.is_some() || is_position => unknown_bone(bone),
        _ => format!("the column `{header}` means nothing here"),
    };
    report.push(
        Diagnostic::error("pose-column", file, Place::Line(1))
            .problem(problem)
            .help("Columns are file, name and, per joint, its VRM 1.0 name with _qx, _qy, _qz, _qw."),
    );
    Column::Ignored
}
