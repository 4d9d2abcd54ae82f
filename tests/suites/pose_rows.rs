//! Rows of pose tables made from recordings, posed bodies and angles: what is read back is the pose they were made from.

use glam::{DMat4, DQuat, DVec3, Quat};
use kitsuke::skeleton::recording;
use kitsuke::skeleton::{Bone, Pose};
use kitsuke_pipeline::diagnostic::Diagnostic;
use kitsuke_pipeline::source::body::{self, PosedBody};
use kitsuke_pipeline::source::pose_rows::{Columns, Form, appended, read_angles};
use kitsuke_pipeline::source::tables;
use kitsuke_tests::doll::{Doll, Rig};
use kitsuke_tests::motions::{apart_deg, wearer};
use std::collections::BTreeSet;
use std::f64::consts::{FRAC_PI_2, PI};
use std::fs;
use std::path::{Path, PathBuf};

/// How far a pose that is read back may lie from the one that was written, radians.
const READ_BACK_RAD: f64 = 1e-4;

fn assets() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../assets-src")
}

/// Which bone of two poses is farthest apart, degrees.
fn farthest(a: &Pose, b: &Pose) -> (f64, Bone) {
    let apart = Bone::ALL.iter().map(|&bone| (apart_deg(a.rotation(bone), b.rotation(bone)), bone));
    apart.max_by(|a, b| a.0.total_cmp(&b.0)).unwrap()
}

fn assert_is_read_back(what: &str, columns: &Columns, poses: &[Pose]) {
    let rows: Vec<String> = poses.iter().map(|pose| columns.row("poses/a.obj", "a", pose)).collect();
    let text = format!("{}\n{}\n", columns.header(), rows.join("\n"));
    let mut report = Vec::new();
    let table = tables::read_rotations("poses.csv", text.as_bytes(), &mut report);
    let table = table.unwrap_or_else(|| panic!("{what}: {report:?}"));
    for (row, (read, pose)) in table.poses().iter().zip(poses).enumerate() {
        let (deg, bone) = farthest(read, pose);
        assert!(deg.to_radians() < READ_BACK_RAD, "{what}, row {row}: {} is off by {deg} degrees", bone.name());
    }
}

fn turn(axis: DVec3, angle_rad: f64) -> Quat {
    DQuat::from_axis_angle(axis.normalize(), angle_rad).as_quat()
}

#[test]
fn frames_of_recordings_are_read_back_from_their_rows() {
    for motion in ["two_arms.bvh", "walk_climb_sit.bvh"] {
        let bytes = fs::read(assets().join("motions").join(motion)).unwrap();
        let recording = recording::read(&bytes, &wearer()).unwrap();
        let poses: Vec<Pose> = recording.frames.iter().step_by(5).map(|frame| frame.pose.clone()).collect();
        for form in [Form::Degrees, Form::Quaternions] {
            assert_is_read_back(motion, &Columns::of(&Bone::ALL, form), &poses);
        }
    }
}

#[test]
fn any_rotation_is_read_back_and_turns_about_one_axis_are_one_angle() {
    let columns = Columns::of(&[Bone::LeftLowerArm], Form::Degrees);
    let axes = [DVec3::X, DVec3::Y, DVec3::Z, DVec3::new(1.0, 2.0, -0.5), DVec3::new(-0.3, 1.0, 0.3)];
    let angles = [0.0, 1e-4, 0.7, FRAC_PI_2 - 1e-6, FRAC_PI_2, FRAC_PI_2 + 1e-4, 2.1, PI - 1e-5, PI];
    let turns =
        axes.iter().flat_map(|&axis| angles.iter().flat_map(move |&angle| [turn(axis, angle), turn(axis, -angle)]));
    let poses: Vec<Pose> = turns.map(|rotation| Pose::REST.with(Bone::LeftLowerArm, rotation)).collect();
    assert_is_read_back("turns", &columns, &poses);
    for (axis, angle_deg, expected) in [
        (DVec3::Y, -90.0, "-90"),
        (DVec3::Y, -120.0, "-120"),
        (DVec3::Y, 88.0, "88"),
        (DVec3::X, 170.0, "170"),
        (DVec3::Z, -45.0, "-45"),
    ] {
        let row = columns.row("", "", &Pose::REST.with(Bone::LeftLowerArm, turn(axis, f64::to_radians(angle_deg))));
        let cells = ["0", "0", "0"].map(str::to_owned);
        let mut expected_cells = cells.clone();
        expected_cells[axis.to_array().iter().position(|part| *part == 1.0).unwrap()] = expected.to_owned();
        assert_eq!(row, format!(",,{}", expected_cells.join(",")));
    }
}

#[test]
fn rows_have_the_columns_of_a_table_and_go_to_its_end() {
    let pose = Pose::REST.with(Bone::LeftUpperArm, turn(DVec3::Z, -0.5)).with(Bone::RightLowerArm, turn(DVec3::X, 1.0));
    let komma = "file,name,index,leftUpperArm_rz_deg,rightLowerArm_qx,rightLowerArm_qy,rightLowerArm_qz,rightLowerArm_qw\n\
                 base.obj,t_pose,0,0,0,0,0,1\n";
    for (what, table) in [
        ("commas", komma.to_owned()),
        ("semicolons of Excel", komma.replace(',', ";").replace('\n', "\r\n")),
        ("tabs without an end", komma.replace(',', "\t").trim_end().to_owned()),
        (
            "a mark and blank columns",
            format!("\u{feff}{}", komma.replace(",index,", ",,").replace("t_pose,0,", "t_pose,,")),
        ),
    ] {
        let mut report = Vec::new();
        let columns = Columns::of_table("poses.csv", table.as_bytes(), &mut report).unwrap();
        let text = appended(
            table.as_bytes(),
            &[columns.row("poses/b.obj", "b", &pose), columns.row("poses/c.obj", "c", &Pose::REST)],
        );
        let read = tables::read("poses.csv", &text, &mut report).unwrap_or_else(|| panic!("{what}: {report:?}"));
        assert_eq!(report, [], "{what}");
        let rows: Vec<(&str, &str)> = read.rows.iter().map(|row| (row.file.as_str(), row.name.as_str())).collect();
        assert_eq!(rows, [("base.obj", "t_pose"), ("poses/b.obj", "b"), ("poses/c.obj", "c")], "{what}");
        assert!(farthest(&read.poses()[1], &pose).0.to_radians() < READ_BACK_RAD, "{what}");
        assert_eq!(columns.lost(&pose), [], "{what}");
    }
}

#[test]
fn turns_without_columns_are_told() {
    let table = "file,name,leftUpperArm_rz_deg,leftUpperArm_rx_deg\nbase.obj,t_pose,0,0\n";
    let columns = Columns::of_table("poses.csv", table.as_bytes(), &mut Vec::new()).unwrap();
    let pose = Pose::REST
        .with(Bone::Hips, turn(DVec3::Y, 2.0))
        .with(Bone::Spine, turn(DVec3::X, 0.1))
        .with(Bone::Neck, turn(DVec3::X, 0.01))
        .with(Bone::LeftUpperArm, turn(DVec3::Y, 0.2));
    let lost: Vec<(Bone, i32, Vec<String>)> =
        columns.lost(&pose).into_iter().map(|lost| (lost.bone, lost.apart_deg.round() as i32, lost.missing)).collect();
    assert_eq!(
        lost,
        [(Bone::LeftUpperArm, 11, vec!["leftUpperArm_ry_deg".to_owned()]), (Bone::Spine, 6, vec![])],
        "the neck's half degree and the hips need no word"
    );
}

#[test]
fn angles_give_the_pose_and_every_mistake_is_named() {
    let (bones, pose) =
        read_angles("leftUpperArm_rz_deg=-45; spine_rx_deg=10\nspine_ry_deg=5", &mut Vec::new()).unwrap();
    assert_eq!(bones, [Bone::LeftUpperArm, Bone::Spine]);
    let spine = turn(DVec3::Y, f64::to_radians(5.0)) * turn(DVec3::X, f64::to_radians(10.0));
    let expected = Pose::REST.with(Bone::LeftUpperArm, turn(DVec3::Z, -PI / 4.0)).with(Bone::Spine, spine);
    assert!(farthest(&pose, &expected).0 < 1e-4);

    let mistakes = "leftUperArm_rz_deg=-45 rightUpperArm_rz_deg=4,5 foo spine_qx=1 head_rx_deg=1 head_rx_deg=2 hips_rx_deg=720 name=a neck_rx=3";
    let mut report = Vec::new();
    assert_eq!(read_angles(mistakes, &mut report), None);
    for words in [
        "did you mean `leftUpperArm`?",
        "rightUpperArm_rz_deg: `4,5` has a decimal comma",
        "`foo` is no column with its angle",
        "`spine_qx` is no angle",
        "head_rx_deg is given twice",
        "the rotation of hips is an angle of 720 degrees",
        "`name` is no angle",
        "the column `neck_rx` means nothing here",
    ] {
        assert!(report.iter().any(|said: &Diagnostic| said.problem.contains(words)), "{words:?} in {report:#?}");
    }
    assert_eq!(report.len(), 8);
    report.clear();
    assert_eq!(read_angles(" ", &mut report), None);
    assert_eq!(report[0].problem, "there is no angle");
}

/// How a bone of the posed doll is turned, in the axes of the T-pose.
fn posed(name: &str) -> DQuat {
    let number = f64::from(name.bytes().map(u32::from).sum::<u32>() % 17);
    match name {
        "hips" => DQuat::from_rotation_y(0.6),
        "leftUpperArm" => DQuat::from_rotation_z(-1.2) * DQuat::from_rotation_x(0.3),
        "leftLowerArm" => DQuat::from_rotation_y(-FRAC_PI_2),
        "rightUpperLeg" => DQuat::from_rotation_x(-1.4),
        _ => DQuat::from_axis_angle(DVec3::new(1.0, number - 8.0, 2.0).normalize(), 0.02 * number),
    }
}

fn assert_is_posed(
    what: &str,
    read: Option<PosedBody>,
    report: &[Diagnostic],
    turned: &dyn Fn(&str) -> DQuat,
    is_own_rest: bool,
) {
    let read = read.unwrap_or_else(|| panic!("{what}: {report:?}"));
    assert_eq!(read.is_own_rest, is_own_rest, "{what}");
    for (name, ..) in Doll::read().joints {
        let deg = apart_deg(read.pose.rotation(Bone::from_name(&name).unwrap()), turned(&name).as_quat());
        assert!(deg < 0.05, "{what}: {name} is off by {deg} degrees");
    }
}

fn read_pose(bytes: &[u8], wearer_bytes: &[u8], report: &mut Vec<Diagnostic>) -> Option<PosedBody> {
    let wearer = body::read("wearer.glb", wearer_bytes, &mut Vec::new()).unwrap();
    body::read_pose("posed.glb", bytes, &wearer.skeleton, wearer_bytes, report)
}

/// Axes of joints along nothing in particular.
fn odd_turn(joint: usize) -> DQuat {
    DQuat::from_axis_angle(DVec3::new(1.0, joint as f64, -2.0).normalize(), 0.9 + joint as f64)
}

#[test]
fn a_posed_body_gives_the_turns_of_its_joints() {
    let doll = Doll::read();
    let plain = doll.written(&Rig::default()).glb();
    let upright = DQuat::from_rotation_x(FRAC_PI_2);
    let in_armature = DMat4::from_scale_rotation_translation(DVec3::splat(0.01), upright, DVec3::ZERO).inverse();
    let none = |_: usize| DQuat::IDENTITY;
    let above = (DVec3::ZERO, upright, 0.01);
    type Axes<'a> = &'a dyn Fn(usize) -> DQuat;
    let cases: [(&str, Axes<'_>, _, DMat4); 4] = [
        ("the axes of the world", &none, Rig::default().above, DMat4::IDENTITY),
        ("axes of its own", &odd_turn, Rig::default().above, DMat4::IDENTITY),
        ("a scaled armature, bound in it", &odd_turn, above, in_armature),
        ("a scaled armature, bound in the world", &odd_turn, above, DMat4::IDENTITY),
    ];
    for (what, turned, above, mesh_from_world) in cases {
        let shown = |joint: usize| turned(joint).inverse() * posed(&doll.joints[joint].0) * turned(joint);
        let file = doll.written(&Rig { above, turned, mesh_from_world, shown: &shown, ..Rig::default() });
        let mut report = Vec::new();
        let read = read_pose(&file.glb(), &plain, &mut report);
        assert_is_posed(what, read, &report, &posed, true);
    }
}

#[test]
fn a_body_bound_in_its_pose_is_held_against_the_wearers_own_or_refused() {
    let doll = Doll::read();
    let a_pose = |name: &str| match name {
        "leftUpperArm" => DQuat::from_rotation_z(-0.8),
        "rightUpperArm" => DQuat::from_rotation_z(0.8),
        "leftLowerArm" => DQuat::from_rotation_y(-0.5),
        _ => DQuat::IDENTITY,
    };
    let mut world: Vec<DQuat> = Vec::new();
    for (name, parent, _) in &doll.joints {
        world.push(parent.map_or(DQuat::IDENTITY, |parent| world[parent]) * a_pose(name));
    }
    let bound = doll.posed(&a_pose);
    let wearer = doll.written(&Rig { turned: &odd_turn, ..Rig::default() }).glb();
    let mut report = Vec::new();
    let same_axes = bound.written(&Rig { turned: &|joint| world[joint] * odd_turn(joint), ..Rig::default() }).glb();
    let read = read_pose(&same_axes, &wearer, &mut report);
    assert_is_posed("bound with its axes", read, &report, &a_pose, false);

    let plain = doll.written(&Rig::default()).glb();
    for (what, file, problem) in [
        ("other axes", bound.written(&Rig::default()).glb(), "the file was not bound in a T-pose"),
        ("the T-pose", plain.clone(), "no joint is turned"),
        ("no glTF", b"posed".to_vec(), ""),
    ] {
        let mut report = Vec::new();
        assert_eq!(read_pose(&file, &plain, &mut report), None, "{what}");
        assert!(report.len() == 1 && report[0].problem.contains(problem), "{what}: {report:?}");
    }
}

#[test]
fn the_recommended_poses_are_a_sound_table_with_the_columns_of_the_template() {
    let read = |name: &str| fs::read_to_string(assets().join("_template").join(name)).unwrap();
    let (text, mut report) = (read("recommended_poses.csv"), Vec::new());
    let table = tables::read("recommended_poses.csv", text.as_bytes(), &mut report).unwrap();
    assert_eq!(report, []);
    let template: Vec<String> = read("poses.csv").lines().map(str::to_owned).collect();
    assert_eq!(text.lines().take(2).collect::<Vec<&str>>(), template, "rows can be copied as they are");
    let of_legs = |pose: &Pose| {
        pose.rotation(Bone::LeftUpperLeg) != Quat::IDENTITY || pose.rotation(Bone::RightUpperLeg) != Quat::IDENTITY
    };
    let poses = table.poses();
    assert_eq!(poses.iter().filter(|pose| of_legs(pose)).count(), 9);
    assert_eq!(poses.len() - 1 - 9, 12);
    let names: BTreeSet<&String> = table.rows.iter().flat_map(|row| [&row.file, &row.name]).collect();
    assert_eq!(names.len(), 2 * poses.len());
    for (i, pose) in poses.iter().enumerate() {
        assert!(poses[..i].iter().all(|other| farthest(pose, other).0 > 5.0), "{} is a copy", table.rows[i].name);
    }
}
