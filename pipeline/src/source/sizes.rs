//! `sizes.csv`: one row per body for which the kimono was made, with its measurements and the joints of its skeleton. Knows nothing of the
//! files that its rows name.

use super::causes::Causes;
use super::delimited::Row;
use super::manifest::unknown_bone;
use super::units::LengthUnit;
use super::{closest, numbers, tables};
use crate::diagnostic::{Diagnostic, Place};
use glam::DVec3;
use kitsuke::measurement::{Measurement, Measurements};
use kitsuke::skeleton::Bone;

/// Most rows that are read.
const ROWS: usize = 1000;

/// The size table as written.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct SizeTable {
    /// The joints that it gives, in the order of its columns.
    pub bones: Vec<Bone>,
    /// Its rows; the first is the base.
    pub rows: Vec<SizeRow>,
}

/// One row.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct SizeRow {
    /// 1-based line in the file.
    pub line: u32,
    /// The shape's file, relative to the garment folder.
    pub file: String,
    /// The body's name.
    pub body: String,
    /// What was measured of it.
    pub measurements: Measurements,
    /// T-pose positions of the table's bones, in the garment's unit and axes.
    pub joints: Vec<DVec3>,
}

/// What a header names.
#[derive(Clone, Copy, PartialEq)]
enum Column {
    File,
    Body,
    Measurement(Measurement, LengthUnit),
    /// Coordinate 0..3 of a bone's position.
    Joint(Bone, usize),
    Ignored,
}

/// Reads a garment's size table.
pub fn read(file: &str, bytes: &[u8], report: &mut Vec<Diagnostic>) -> Option<SizeTable> {
    let before = report.len();
    let table = tables::read_csv(file, bytes, ROWS, report)?;
    let before_header = report.len();
    let columns: Vec<Column> =
        table.header.iter().map(|header| column(file, header, &table.header_place, report)).collect();
    let mut bones: Vec<Bone> = Vec::new();
    for column in &columns {
        if let Column::Joint(bone, _) = column
            && !bones.contains(bone)
        {
            bones.push(*bone);
        }
    }
    check_header(file, &table.header_place, &columns, &bones, report);
    if report.len() > before_header {
        return None;
    }
    let mut causes = Causes::default();
    let mut rows = Vec::new();
    for Row { line, cells, .. } in &table.rows {
        let mut row = SizeRow { line: *line, joints: vec![DVec3::ZERO; bones.len()], ..SizeRow::default() };
        for ((value, column), header) in cells.iter().zip(&columns).zip(&table.header) {
            match *column {
                Column::File => row.file = value.to_owned(),
                Column::Body => row.body = value.to_owned(),
                Column::Ignored => {}
                Column::Measurement(..) if value.is_empty() => {}
                Column::Measurement(measurement, unit) => {
                    if let Some(number) = number(file, *line, header, value, &mut causes) {
                        let value_m = number * unit.metres();
                        check_plausible(file, *line, header, value, measurement, value_m, &mut causes);
                        row.measurements = row.measurements.with(measurement, value_m as f32);
                    }
                }
                Column::Joint(bone, axis) => {
                    let at = bones.iter().position(|b| *b == bone).expect("every joint column's bone is listed");
                    row.joints[at][axis] = number(file, *line, header, value, &mut causes).unwrap_or(0.0);
                }
            }
        }
        for (what, value) in [("file", &row.file), ("body", &row.body)] {
            if value.is_empty() {
                causes.add("size-row", what, || {
                    Diagnostic::error("size-row", file, Place::Line(*line))
                        .problem(format!("this row has no {what}"))
                        .help("Each row gives the shape's file, the body's name, its measurements and its joints.")
                });
            }
        }
        rows.push(row);
    }
    causes.report("cell", report);
    (report.len() == before).then_some(SizeTable { bones, rows })
}

fn number(file: &str, line: u32, header: &str, value: &str, causes: &mut Causes) -> Option<f64> {
    let number = numbers::read(value);
    if let Err(wrong) = &number {
        let cause = if wrong.cause.is_empty() { value } else { wrong.cause };
        causes.add("size-number", cause, || {
            Diagnostic::error("size-number", file, Place::Line(line))
                .problem(format!("{header}: {}", wrong.problem))
                .help(
                    wrong
                        .help
                        .as_deref()
                        .unwrap_or("Write numbers with a point; leave a measurement empty that is not known."),
                )
        });
    }
    number.ok()
}

fn check_plausible(
    file: &str,
    line: u32,
    header: &str,
    value: &str,
    measurement: Measurement,
    value_m: f64,
    causes: &mut Causes,
) {
    let (least_m, most_m) = measurement.plausible_m();
    if !(f64::from(least_m)..=f64::from(most_m)).contains(&value_m) {
        causes.add("size-measurement", header, || {
            Diagnostic::error("size-measurement", file, Place::Line(line))
                .problem(format!(
                    "{header} is {value}, but bodies have {:.0} to {:.0} cm",
                    least_m * 100.0,
                    most_m * 100.0
                ))
                .help("Correct the number, or the unit at the end of the column's name: _mm, _cm or _m.")
        });
    }
}

/// Columns that are missing or occur twice.
fn check_header(file: &str, place: &Place, columns: &[Column], bones: &[Bone], report: &mut Vec<Diagnostic>) {
    let mut wanted = vec![(Column::File, "file".to_owned()), (Column::Body, "body".to_owned())];
    for &bone in bones {
        wanted.extend((0..3).map(|axis| (Column::Joint(bone, axis), format!("{}_{}", bone.name(), AXES[axis]))));
    }
    let measured = Measurement::ALL.into_iter().filter(|measurement| {
        columns.iter().filter(|c| matches!(c, Column::Measurement(m, _) if m == measurement)).count() > 1
    });
    let twice = measured.map(|measurement| format!("the measurement {} occurs twice", measurement.name()));
    let wrong =
        wanted.into_iter().filter_map(|(column, name)| match columns.iter().filter(|c| **c == column).count() {
            0 => Some(format!("the column {name} is missing")),
            1 => None,
            count => Some(format!("the column {name} occurs {count} times")),
        });
    let mut wrong: Vec<String> = wrong.chain(twice).collect();
    if !columns.iter().any(|column| matches!(column, Column::Measurement(..))) {
        wrong.push("the size table has no measurements".to_owned());
    }
    for problem in wrong {
        report.push(Diagnostic::error("size-column", file, place.clone()).problem(problem).help(HELP));
    }
}

const AXES: [&str; 3] = ["x", "y", "z"];
const HELP: &str = "Columns are file, body, measurements with their unit (bust_girth_cm …), and per joint of the body its VRM 1.0 name with _x, \
                    _y, _z: its place in the T-pose, in the unit and axes of garment.toml.";

/// What a header means; reports one that means nothing.
fn column(file: &str, header: &str, place: &Place, report: &mut Vec<Diagnostic>) -> Column {
    match header {
        "file" => return Column::File,
        "body" => return Column::Body,
        "index" => return Column::Ignored,
        _ => {}
    }
    let (name, suffix) = header.rsplit_once('_').unwrap_or((header, ""));
    let measurement = Measurement::ALL.into_iter().find(|measurement| measurement.name() == name);
    let unit = LengthUnit::ALL.into_iter().find(|unit| unit.name() == suffix);
    let axis = AXES.iter().position(|axis| *axis == suffix);
    let has_no_unit = Measurement::ALL.iter().any(|measurement| measurement.name() == header);
    let problem = match (measurement, unit, axis) {
        _ if has_no_unit => format!("the column `{header}` says no unit"),
        (Some(measurement), Some(unit), _) => return Column::Measurement(measurement, unit),
        (None, Some(_), _) => match closest(name, Measurement::ALL.iter().map(|measurement| measurement.name())) {
            Some(similar) => format!("there is no measurement `{name}`; did you mean `{similar}`?"),
            None => format!("there is no measurement `{name}`"),
        },
        (_, None, Some(axis)) => match Bone::from_name(name) {
            Some(bone) => return Column::Joint(bone, axis),
            None => unknown_bone(name),
        },
        _ => format!("the column `{header}` means nothing here"),
    };
    report.push(Diagnostic::error("size-column", file, place.clone()).problem(problem).help(HELP));
    Column::Ignored
}
