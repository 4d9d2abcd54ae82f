//! Tables as spreadsheets and editors save them, with right values from `../shared/data/reports` and from the tables of
//! komon themselves.

use kitsuke_pipeline::diagnostic::{Diagnostic, Place};
use kitsuke_pipeline::source::measurements;
use kitsuke_pipeline::source::sizes::{self, SizeTable};
use kitsuke_pipeline::source::tables::{self, PoseTable};
use std::fs;
use std::path::Path;

fn root() -> &'static Path {
    Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/.."))
}

fn of_komon(table: &str) -> Vec<Vec<String>> {
    let text = fs::read_to_string(root().join("assets-src/komon").join(table)).unwrap();
    text.lines().map(|line| line.split(',').map(str::to_owned).collect()).collect()
}

fn joined(rows: &[Vec<String>], separator: &str, end: &str) -> String {
    rows.iter().map(|row| row.join(separator) + end).collect()
}

/// A table in all the ways in which spreadsheets save it.
fn variants(rows: &[Vec<String>]) -> Vec<(&'static str, Vec<u8>)> {
    let map = |change: &dyn Fn(usize, &Vec<String>) -> Vec<String>| -> Vec<Vec<String>> {
        rows.iter().enumerate().map(|(i, row)| change(i, row)).collect()
    };
    let blank = vec![String::new(); rows[0].len()];
    let mut with_blanks = vec![blank.clone()];
    for row in rows {
        with_blanks.extend([row.clone(), blank.clone()]);
    }
    let with = |at: usize| {
        map(&|_, row| {
            let mut row = row.clone();
            row.insert(at.min(row.len()), String::new());
            row
        })
    };
    let only_rows =
        |i: usize, row: &Vec<String>| [row.clone(), if i == 3 { blank.clone() } else { Vec::new() }].concat();
    let quoted = map(&|_, row| row.iter().map(|cell| format!("\"{cell}\"")).collect());
    let spaced = map(&|_, row| row.iter().map(|cell| format!(" {cell} ")).collect());
    vec![
        ("plain", joined(rows, ",", "\n").into()),
        ("byte order mark and CRLF", [b"\xef\xbb\xbf", joined(rows, ",", "\r\n").as_bytes()].concat()),
        ("carriage returns", joined(rows, ",", "\r").into()),
        ("semicolons", joined(rows, ";", "\r\n").into()),
        ("tabs", joined(rows, "\t", "\n").into()),
        ("blank rows", joined(&with_blanks, ",", "\r\n").into()),
        ("blank rows of semicolons", joined(&with_blanks, ";", "\n").into()),
        ("empty lines", joined(rows, ",", "\n\n").into()),
        ("empty last column", joined(&with(usize::MAX), ",", "\n").into()),
        ("empty first column", joined(&with(0), ",", "\n").into()),
        ("empty column in the middle", joined(&with(3), ",", "\n").into()),
        ("one row with empty cells behind it", joined(&map(&only_rows), ",", "\n").into()),
        ("quoted", joined(&quoted, ",", "\r\n").into()),
        ("blanks about cells", joined(&spaced, ",", "\n").into()),
    ]
}

fn poses(bytes: &[u8]) -> Result<PoseTable, Vec<Diagnostic>> {
    let mut report = Vec::new();
    tables::read("poses.csv", bytes, &mut report).ok_or(report)
}

fn without_lines(mut table: PoseTable) -> PoseTable {
    table.rows.iter_mut().for_each(|row| row.line = 0);
    table
}

#[test]
fn pose_tables_of_spreadsheets_are_those_of_editors() {
    let rows = of_komon("poses.csv");
    let right = without_lines(poses(joined(&rows, ",", "\n").as_bytes()).unwrap());
    assert_eq!(right.rows.len(), 55);
    for (name, bytes) in variants(&rows) {
        let table = poses(&bytes).unwrap_or_else(|report| panic!("{name}: {report:?}"));
        assert_eq!(without_lines(table), right, "{name}");
    }
}

#[test]
fn tables_of_reports_have_the_19_rows_of_komon() {
    for file in ["blank_rows.csv", "trailing_comma.csv"] {
        let path = root().join("../shared/data/reports/csv_from_excel").join(file);
        if !path.exists() {
            println!("skipped: {} is absent", path.display());
            return;
        }
        let table = poses(&fs::read(&path).unwrap()).unwrap();
        let ours = poses(&fs::read(root().join("assets-src/komon/poses.csv")).unwrap()).unwrap();
        assert_eq!(table.rows.len(), 19, "{file}");
        for row in &table.rows {
            let same = ours.rows.iter().find(|ours| ours.name == row.name).unwrap();
            for (bone, rotation) in table.bones.iter().zip(&row.rotations) {
                let at = ours.bones.iter().position(|ours| ours == bone).unwrap();
                assert!(rotation.abs_diff_eq(same.rotations[at], 1e-6), "{file}: {}", row.name);
            }
        }
    }
}

#[test]
fn size_tables_of_spreadsheets_are_those_of_editors() {
    let rows = of_komon("sizes.csv");
    let read = |bytes: &[u8]| {
        let mut report = Vec::new();
        let table: Option<SizeTable> = sizes::read("sizes.csv", bytes, &mut report);
        let mut table = table.unwrap_or_else(|| panic!("{report:?}"));
        table.rows.iter_mut().for_each(|row| row.line = 0);
        table
    };
    let right = read(joined(&rows, ",", "\n").as_bytes());
    for (name, bytes) in variants(&rows) {
        assert_eq!(read(&bytes), right, "{name}");
    }
}

#[test]
fn body_tables_of_spreadsheets_are_those_of_editors() {
    let text = "name,body_height_cm,hip_girth_cm,note\nA,158,90,x\nB,161.5,92,\nC,170,99,y\nD,152,88,z";
    let rows: Vec<Vec<String>> = text.lines().map(|line| line.split(',').map(str::to_owned).collect()).collect();
    let right = measurements::read("bodies.csv", text.as_bytes()).unwrap();
    assert_eq!(right.len(), 4);
    for (name, bytes) in variants(&rows) {
        assert_eq!(measurements::read("bodies.csv", &bytes).unwrap(), right, "{name}");
    }
}

#[test]
fn lines_in_messages_are_those_of_the_file() {
    let rows = of_komon("poses.csv");
    for (name, bytes) in variants(&rows) {
        let end = if name == "carriage returns" { "\r" } else { "\n" };
        let text = String::from_utf8(bytes).unwrap().replacen("0.923880", "!!", 1);
        let text = text.replacen("a_pose_45\"", "a_pose\n_45\"", 1);
        let line = 1 + text[..text.find("!!").unwrap()].matches(end).count() as u32;
        // A quoted line break lies inside the row, which begins a line above.
        let begins = if name == "quoted" { line - 1 } else { line };
        let report = poses(text.as_bytes()).unwrap_err();
        let wrong: Vec<&Diagnostic> = report.iter().filter(|d| d.code == "pose-number").collect();
        assert_eq!(wrong.iter().map(|d| &d.place).collect::<Vec<_>>(), [&Place::Line(begins)], "{name}: {report:?}");
    }
}

#[test]
fn many_equal_rows_are_one_message_with_a_count() {
    let rows = of_komon("poses.csv");
    for (change, problem) in [
        ("", "has length"),
        ("x", "`x` is no number"),
        ("0,5", "`0,5` has a decimal comma"),
        ("−0.5", "`−0.5` has a dash (such as U+2212) for the minus"),
        ("45", "these are degrees"),
    ] {
        let mut row: Vec<String> = rows[1].iter().map(|cell| format!("\"{cell}\"")).collect();
        row[2] = format!("\"{}\"", if change.is_empty() { "0.3" } else { change });
        let text = joined(&rows[..1], ",", "\n") + &(row.join(",") + "\n").repeat(20_000);
        let report = poses(text.as_bytes()).unwrap_err();
        assert_eq!(report.len(), 1, "{report:?}");
        assert!(report[0].problem.contains(problem), "{report:?}");
        assert!(report[0].problem.contains("and 19999 more"), "{report:?}");
    }
}

/// Nobody has quaternions: all rows of komon as angles, by glam's conversion, are the same rotations.
#[test]
fn angles_in_degrees_are_the_same_rotations() {
    let rows = of_komon("poses.csv");
    let joints: Vec<&str> = rows[0].iter().filter_map(|header| header.strip_suffix("_qx")).collect();
    let columns = joints.iter().flat_map(|joint| ["rx", "ry", "rz"].map(|axis| format!(",{joint}_{axis}_deg")));
    let mut text = format!("file,name{}\n", columns.collect::<String>());
    for row in &rows[1..] {
        text += &format!("{},{}", row[0], row[1]);
        for numbers in row[2..].chunks(4) {
            let [x, y, z, w]: [f64; 4] = std::array::from_fn(|i| numbers[i].parse().unwrap());
            let (rz, ry, rx) = glam::DQuat::from_xyzw(x, y, z, w).normalize().to_euler(glam::EulerRot::ZYX);
            text += &[rx, ry, rz].map(|angle| format!(",{:.5}", angle.to_degrees())).concat();
        }
        text += "\n";
    }
    let read = |bytes: &[u8]| tables::read("poses.csv", bytes, &mut Vec::new()).unwrap();
    let quaternions = read(&fs::read(root().join("assets-src/komon/poses.csv")).unwrap());
    let angles = read(text.as_bytes());
    assert_eq!(angles.bones, quaternions.bones);
    for (a, b) in angles.rows.iter().zip(&quaternions.rows) {
        let apart = a.rotations.iter().zip(&b.rotations).map(|(a, b)| a.angle_between(*b).to_degrees());
        assert!(apart.fold(0.0, f32::max) < 0.1, "{}", a.name);
        let dots = a.rotations.iter().zip(&b.rotations).map(|(a, b)| 1.0 - a.dot(*b).abs());
        assert!(dots.fold(0.0, f32::max) < 1e-6, "{}", a.name);
    }
}

#[test]
fn one_angle_is_enough_and_a_rotation_is_given_once() {
    let read = |text: &str| {
        let mut report = Vec::new();
        tables::read_rotations("poses.csv", text.as_bytes(), &mut report).ok_or(report)
    };
    let table = read(
        "name,leftUpperArm_rz_deg,leftLowerArm_qx,leftLowerArm_qy,leftLowerArm_qz,leftLowerArm_qw\nbase,0,0,0,0,1\ndown,-45,0,0,0,1\n",
    );
    let down = table.unwrap().rows[1].rotations[0];
    assert!(down.abs_diff_eq(glam::Quat::from_xyzw(0.0, 0.0, -0.382_683, 0.923_880), 1e-5), "{down}");
    // X first, then Y: the arm that points to the left goes forward by the turn about Y alone.
    let table = read("name,leftUpperArm_rx_deg,leftUpperArm_ry_deg\na,90,-90\n").unwrap();
    let points = table.rows[0].rotations[0] * glam::Vec3::X;
    assert!(points.abs_diff_eq(glam::Vec3::Z, 1e-6), "{points}");
    for (text, code) in [
        ("name,leftUpperArm_rz_deg,leftUpperArm_rz_deg\na,1,2\n", "pose-column"),
        (
            "name,leftUpperArm_rz_deg,leftUpperArm_qx,leftUpperArm_qy,leftUpperArm_qz,leftUpperArm_qw\na,1,0,0,0,1\n",
            "pose-column",
        ),
        ("name,leftUpperArm_rz_deg\na,700\n", "pose-quaternion"),
        ("name,leftUpperArm_rz_deg\na,steep\n", "pose-number"),
        ("name,leftUpperarm_rz_deg\na,1\n", "pose-column"),
    ] {
        assert_eq!(read(text).unwrap_err()[0].code, code, "{text}");
    }
}
