//! Rows of a pose table made from poses, in the columns of a table or in columns of one's own; and poses from angles as people type them.
//! Knows no garment, and not where poses come from.

use super::tables::{self, ANGLES, AXES, Column, Written};
use super::{delimited, numbers, utf8};
use crate::diagnostic::{Diagnostic, Place};
use glam::{DMat3, DQuat, Quat};
use kitsuke::skeleton::{Bone, Pose, angle_between_rad};

/// Decimals of an angle in degrees: three angles are then off by 2e-5 rad at most.
const ANGLE_DECIMALS: usize = 3;
/// Decimals of a quaternion's parts, as in all tables.
const PART_DECIMALS: usize = 6;
/// Turns that columns fail to give and that are smaller are not worth a word, degrees.
const WORTH_A_WORD_DEG: f32 = 1.0;
/// Where the upright axis comes nearer to the turned one than this, turns about both are one turn, radians.
const ONE_TURN_RAD: f64 = 1e-5;

/// How rotations are written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Form {
    /// `JOINT_rx_deg`, `JOINT_ry_deg`, `JOINT_rz_deg`.
    Degrees,
    /// `JOINT_qx`, `JOINT_qy`, `JOINT_qz`, `JOINT_qw`.
    Quaternions,
}

/// What the cells of a row are.
#[derive(Debug)]
pub struct Columns {
    separator: char,
    /// Headers and what they mean; no meaning where the cell stays blank.
    columns: Vec<(String, Option<Column>)>,
}

/// A turn that the columns cannot give.
#[derive(Clone, Debug, PartialEq)]
pub struct Lost {
    /// Whose.
    pub bone: Bone,
    /// How far what they give lies from it, degrees.
    pub apart_deg: f32,
    /// The columns that are missing; none where the table has nothing of the bone.
    pub missing: Vec<String>,
}

impl Columns {
    /// `file`, `name` and the rotations of these bones.
    #[must_use]
    pub fn of(bones: &[Bone], form: Form) -> Columns {
        let mut columns = vec![("file".to_owned(), Some(Column::File)), ("name".to_owned(), Some(Column::Name))];
        for &bone in bones {
            columns.extend(match form {
                Form::Degrees => [0, 1, 2].map(|i| (angle_name(bone, i), Some(Column::Angle(bone, i)))).to_vec(),
                Form::Quaternions => {
                    let part = |i: usize| (format!("{}_{}", bone.name(), AXES[i]), Some(Column::Rotation(bone, i)));
                    [0, 1, 2, 3].map(part).to_vec()
                }
            });
        }
        Columns { separator: ',', columns }
    }

    /// Those of a table.
    pub fn of_table(file: &str, bytes: &[u8], report: &mut Vec<Diagnostic>) -> Option<Columns> {
        let line = delimited::first_line(utf8(file, bytes, report)?);
        let separator = delimited::separator(line.as_bytes());
        let mut reader = csv::ReaderBuilder::new()
            .delimiter(separator)
            .has_headers(false)
            .trim(csv::Trim::All)
            .from_reader(line.as_bytes());
        let headers = reader.records().next().and_then(Result::ok).unwrap_or_default();
        let before = report.len();
        let meaning = |header: &str| {
            // A column without a name has nothing in it.
            let column = (!header.is_empty()).then(|| tables::column(file, header, &Place::Line(1), report));
            (header.to_owned(), column)
        };
        let columns = headers.iter().map(meaning).collect();
        (report.len() == before).then_some(Columns { separator: separator.into(), columns })
    }

    /// The table's first line.
    #[must_use]
    pub fn header(&self) -> String {
        self.joined(self.columns.iter().map(|(header, _)| header.clone()))
    }

    /// A row.
    #[must_use]
    pub fn row(&self, file: &str, name: &str, pose: &Pose) -> String {
        self.joined(self.columns.iter().map(|(_, column)| match column {
            Some(Column::File) => file.to_owned(),
            Some(Column::Name) => name.to_owned(),
            Some(Column::Angle(bone, i)) => written(angles_deg(pose.rotation(*bone))[*i], ANGLE_DECIMALS),
            Some(Column::Rotation(bone, i)) => {
                written(pose.rotation(*bone).as_dquat().normalize().to_array()[*i], PART_DECIMALS)
            }
            Some(Column::Ignored) | None => String::new(),
        }))
    }

    /// Turns that a row would not give back, the greatest first; of all bones but the hips, on which the kimono rests.
    #[must_use]
    pub fn lost(&self, pose: &Pose) -> Vec<Lost> {
        let mut lost: Vec<Lost> =
            Bone::ALL.iter().filter_map(|&bone| self.lost_of(bone, pose.rotation(bone))).collect();
        lost.sort_by(|a, b| b.apart_deg.total_cmp(&a.apart_deg));
        lost
    }

    fn lost_of(&self, bone: Bone, rotation: Quat) -> Option<Lost> {
        let has = |wanted: fn(&Column) -> Option<Bone>| {
            self.columns.iter().any(|(_, column)| column.as_ref().and_then(wanted) == Some(bone))
        };
        let has_angles = has(|column| if let Column::Angle(bone, _) = column { Some(*bone) } else { None });
        let has_parts = has(|column| if let Column::Rotation(bone, _) = column { Some(*bone) } else { None });
        if has_parts || bone == Bone::Hips && !has_angles {
            return None;
        }
        let has_axis = |i: usize| self.columns.iter().any(|(_, column)| *column == Some(Column::Angle(bone, i)));
        let mut given_deg = angles_deg(rotation);
        let mut missing = Vec::new();
        for i in (0..3).filter(|&i| !has_axis(i)) {
            if given_deg[i].abs() > 0.5 * f64::from(WORTH_A_WORD_DEG) {
                missing.push(angle_name(bone, i));
            }
            given_deg[i] = 0.0;
        }
        if !has_angles {
            missing.clear();
        }
        let apart_deg = angle_between_rad(rotation, of_angles_deg(given_deg)).to_degrees();
        (apart_deg > WORTH_A_WORD_DEG).then_some(Lost { bone, apart_deg, missing })
    }

    fn joined(&self, cells: impl Iterator<Item = String>) -> String {
        cells.collect::<Vec<String>>().join(&self.separator.to_string())
    }
}

/// A table with rows at its end, which end as its lines do.
#[must_use]
pub fn appended(table: &[u8], rows: &[String]) -> Vec<u8> {
    let has = |end: &str| table.windows(end.len()).any(|window| window == end.as_bytes());
    let end = ["\r\n", "\n", "\r"].into_iter().find(|end| has(end)).unwrap_or("\n");
    let mut text = table.to_vec();
    if !table.ends_with(end.as_bytes()) {
        text.extend_from_slice(end.as_bytes());
    }
    rows.iter().for_each(|row| text.extend_from_slice(format!("{row}{end}").as_bytes()));
    text
}

/// Reads `leftUpperArm_rz_deg=-45 rightUpperArm_rz_deg=45`: columns of a pose table with their angles. Gives the bones that are named, and the
/// pose; reports every mistake.
pub fn read_angles(text: &str, report: &mut Vec<Diagnostic>) -> Option<(Vec<Bone>, Pose)> {
    const FILE: &str = "--angles";
    let before = report.len();
    let error =
        |problem: String, help: &str| Diagnostic::error("pose-angles", FILE, Place::File).problem(problem).help(help);
    let mut of_bones: Vec<(Bone, Written, [bool; 3])> = Vec::new();
    for entry in text.split(|c: char| c.is_whitespace() || c == ';').filter(|entry| !entry.is_empty()) {
        let Some((header, value)) = entry.split_once('=') else {
            report.push(error(
                format!("`{entry}` is no column with its angle"),
                "Write each as leftUpperArm_rz_deg=-45, without blanks about the `=`.",
            ));
            continue;
        };
        let value_deg = numbers::read(value);
        let said = report.len();
        let column = tables::column(FILE, header, &Place::File, report);
        // What is no angle at all needs no number.
        if let Err(wrong) = &value_deg
            && header.ends_with("_deg")
        {
            let help = wrong.help.as_deref().unwrap_or("Give the angle in degrees.");
            report.push(error(format!("{header}: {}", wrong.problem), help));
        }
        let Column::Angle(bone, axis) = column else {
            if report.len() == said {
                report.push(error(
                    format!("`{header}` is no angle"),
                    "Give angles of joints: JOINT_rx_deg, JOINT_ry_deg, JOINT_rz_deg.",
                ));
            }
            continue;
        };
        let at = of_bones.iter().position(|(known, ..)| *known == bone).unwrap_or_else(|| {
            of_bones.push((bone, Written::default(), [false; 3]));
            of_bones.len() - 1
        });
        let (_, written, is_given) = &mut of_bones[at];
        if std::mem::replace(&mut is_given[axis], true) {
            report.push(error(format!("{header} is given twice"), "Give each angle once."));
        }
        written.turn(axis, value_deg.ok());
    }
    for (bone, written, _) in &of_bones {
        if let Some((_, problem, help)) = written.mistake() {
            report.push(error(format!("the rotation of {} {problem}", bone.name()), &help));
        }
    }
    if of_bones.is_empty() && report.len() == before {
        report.push(error("there is no angle".to_owned(), "Give columns with their angles: leftUpperArm_rz_deg=-45."));
    }
    let pose = of_bones.iter().fold(Pose::REST, |pose, (bone, written, _)| pose.with(*bone, written.rotation()));
    (report.len() == before).then(|| (of_bones.into_iter().map(|(bone, ..)| bone).collect(), pose))
}

fn angle_name(bone: Bone, axis: usize) -> String {
    format!("{}_{}_deg", bone.name(), ANGLES[axis])
}

fn of_angles_deg(angles_deg: [f64; 3]) -> Quat {
    let mut written = Written::default();
    angles_deg.into_iter().enumerate().for_each(|(i, angle_deg)| written.turn(i, Some(angle_deg)));
    written.rotation()
}

/// The angles about X, then Y, then Z of the T-pose that make a rotation. Of the two ways there are the one that turns less in all, and where
/// the turns about X and Z are one turn, that about X.
fn angles_deg(rotation: Quat) -> [f64; 3] {
    let m = DMat3::from_quat(rotation.as_dquat().normalize());
    let is_one_turn = m.x_axis.x.hypot(m.x_axis.y) < ONE_TURN_RAD;
    let z = if is_one_turn { 0.0 } else { libm::atan2(m.x_axis.y, m.x_axis.x) };
    // What is left once the last turn is taken back: the other two then belong to it, however ill it is determined.
    let half_z = -z / 2.0;
    let left = DMat3::from_quat(DQuat::from_xyzw(0.0, 0.0, libm::sin(half_z), libm::cos(half_z))) * m;
    let x = libm::atan2(-left.z_axis.y, left.y_axis.y);
    let y = libm::atan2(-left.x_axis.z, left.x_axis.x);
    let half_turn = |angle: f64| std::f64::consts::PI.copysign(angle);
    let (way, other) = ([x, y, z], [x - half_turn(x), half_turn(y) - y, z - half_turn(z)]);
    let length = |way: [f64; 3]| way.iter().map(|angle| angle.abs()).sum::<f64>();
    let shorter = if length(other) < length(way) { other } else { way };
    shorter.map(f64::to_degrees)
}

/// A number as people write it: no zeros at the end, no minus before nothing.
fn written(number: f64, decimals: usize) -> String {
    let text = format!("{number:.decimals$}");
    let short = text.trim_end_matches('0').trim_end_matches('.');
    if short == "-0" { "0".to_owned() } else { short.to_owned() }
}
