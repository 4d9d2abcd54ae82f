//! Recorded motion: BVH text against an independent reading of the same file, and every mistake's message.

use glam::{DMat3, DVec3, Quat, Vec3};
use kitsuke::arrays::{Driver, GarmentData, Mesh, Part, PoseTable, Segment, SkinWeights, Target};
use kitsuke::garment::Garment;
use kitsuke::skeleton::bvh::{self, Motion, Reference};
use kitsuke::skeleton::{Bone, Joint, Pose, Skeleton};
use kitsuke::{Rates, pose_blend};
use kitsuke_pipeline::ir;
use proptest::prelude::*;
use std::path::Path;

/// A woman of 154 cm in the T-pose.
fn wearer() -> Skeleton {
    let joints: [(Bone, [f32; 3]); 20] = [
        (Bone::Hips, [0.0, 0.798, -0.067]),
        (Bone::Spine, [0.0, 0.807, 0.019]),
        (Bone::Chest, [0.0, 0.939, -0.004]),
        (Bone::UpperChest, [0.0, 1.155, 0.009]),
        (Bone::Neck, [0.0, 1.3, 0.0]),
        (Bone::Head, [0.0, 1.402, 0.042]),
        (Bone::LeftShoulder, [0.022, 1.232, 0.016]),
        (Bone::LeftUpperArm, [0.151, 1.222, 0.02]),
        (Bone::LeftLowerArm, [0.392, 1.222, 0.02]),
        (Bone::LeftHand, [0.587, 1.222, 0.024]),
        (Bone::RightShoulder, [-0.022, 1.232, 0.016]),
        (Bone::RightUpperArm, [-0.151, 1.222, 0.02]),
        (Bone::RightLowerArm, [-0.392, 1.222, 0.02]),
        (Bone::RightHand, [-0.587, 1.222, 0.024]),
        (Bone::LeftUpperLeg, [0.094, 0.76, 0.0]),
        (Bone::LeftLowerLeg, [0.09, 0.41, 0.01]),
        (Bone::LeftFoot, [0.09, 0.06, -0.02]),
        (Bone::RightUpperLeg, [-0.094, 0.76, 0.0]),
        (Bone::RightLowerLeg, [-0.09, 0.41, 0.01]),
        (Bone::RightFoot, [-0.09, 0.06, -0.02]),
    ];
    let index = |bone| joints.iter().position(|&(listed, _)| listed == bone).map(|i| i as u8);
    let joint = |&(bone, rest_m): &(Bone, [f32; 3])| Joint {
        bone,
        parent: bone.vrm_parent().and_then(index),
        rest_m: Vec3::from_array(rest_m),
    };
    Skeleton::new(joints.iter().map(joint).collect()).unwrap()
}

/// A file with one joint per limb bone, arms sideways, Y up, and these channels for the left upper arm.
fn text(channels: &str, frames: &[&str]) -> String {
    let joint = |name: &str, offset: &str, channels: &str, inside: &str| {
        format!("JOINT {name}\n{{\nOFFSET {offset}\nCHANNELS {channels}\n{inside}}}\n")
    };
    let end = |offset: &str| format!("End Site\n{{\nOFFSET {offset}\n}}\n");
    let left = joint("leftUpperArm", "2 1 0", channels, &joint("leftLowerArm", "3 0 0", "0", &end("3 0 0")));
    let right = joint("rightUpperArm", "-2 1 0", "0", &joint("rightLowerArm", "-3 0 0", "0", &end("-3 0 0")));
    let spine = joint("spine", "0 3 0", "0", &(left + &right));
    format!(
        "HIERARCHY\nROOT hips\n{{\nOFFSET 0 9 0\nCHANNELS 3 Xposition Yposition Zposition\n{spine}}}\nMOTION\n\
         Frames: {}\nFrame Time: 0.0083333\n{}\n",
        frames.len(),
        frames.join("\n")
    )
}

fn read(text: &str) -> Motion {
    bvh::read(text.as_bytes(), &wearer()).unwrap_or_else(|error| panic!("{error}\n{text}"))
}

fn rotation_matrix(axis: char, degrees: f64) -> DMat3 {
    let (s, c) = (libm::sin(degrees.to_radians()), libm::cos(degrees.to_radians()));
    let rows = match axis {
        'X' => [[1.0, 0.0, 0.0], [0.0, c, -s], [0.0, s, c]],
        'Y' => [[c, 0.0, s], [0.0, 1.0, 0.0], [-s, 0.0, c]],
        _ => [[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]],
    };
    DMat3::from_cols_array_2d(&rows).transpose()
}

#[test]
fn every_order_of_channels_is_the_product_of_its_matrices() {
    let angles = [31.0, -72.0, 15.0];
    for order in ["XYZ", "XZY", "YXZ", "YZX", "ZXY", "ZYX"] {
        let names: Vec<String> = order.chars().map(|axis| format!("{axis}rotation")).collect();
        let expected =
            order.chars().zip(angles).fold(DMat3::IDENTITY, |m, (axis, angle)| m * rotation_matrix(axis, angle));
        let three = (format!("3 {}", names.join(" ")), "0 9 0 31 -72 15".to_owned());
        let six = (format!("6 Zposition {} Xposition Yposition", names.join(" ")), "0 9 0 0 31 -72 15 2 1".to_owned());
        for (channels, frame) in [three, six] {
            let motion = read(&text(&channels, &[&frame]));
            let turned = motion.poses[0].rotation(Bone::LeftUpperArm).as_dquat();
            for axis in DVec3::AXES {
                let (found, expected) = (turned * axis, expected * axis);
                assert!(found.distance(expected) < 1e-6, "{channels}: {found} instead of {expected}");
            }
        }
    }
}

#[test]
fn blanks_line_ends_and_case_do_not_matter() {
    let plain = text("3 Zrotation Xrotation Yrotation", &["0 9 0 10 20 30", "1 9 0 -10 2e1 3"]);
    let expected = read(&plain);
    assert_eq!((expected.poses.len(), expected.reference), (2, Reference::Offsets));
    let variants = [
        plain.replace('\n', "\r\n"),
        plain.replace('\n', " \t\n"),
        plain.replace(' ', "\t"),
        format!("\u{feff}{}\n\n", plain.replace("\n{", "{").replace("{\n", "{ \n")).replace('{', "\n{"),
        plain.replace("Zrotation", "ZROTATION").replace("OFFSET", "Offset"),
        plain.replace("spine", "mine:spine"),
        plain.trim_end().to_owned(),
    ];
    for variant in variants {
        assert_eq!(read(&variant), expected, "{variant:?}");
    }
}

#[test]
fn other_axes_and_units_give_the_same_poses() {
    let legs = |text: &str| {
        let leg = |side: &str, x: &str| {
            format!(
                "JOINT {side}UpperLeg {{\nOFFSET {x} -1 0\nJOINT {side}LowerLeg {{\nOFFSET 0 -4 0\nJOINT {side}Foot {{\n\
                 OFFSET 0 -4 0\n}}\n}}\n}}\n"
            )
            .replace('{', "\n{")
        };
        text.replacen("JOINT spine", &(leg("left", "1") + &leg("right", "-1") + "JOINT spine"), 1)
    };
    let frames = ["3 9 1 10 20 30", "4 10 -1 -40 5 60"];
    let y_up = legs(&text("3 Zrotation Xrotation Yrotation", &frames));
    // Z up, front -Y, ten times the unit: x y z becomes x -z y.
    let mut z_up = String::new();
    for line in y_up.lines() {
        let words: Vec<&str> = line.split(' ').collect();
        let number = |i: usize| words[i].parse::<f64>().unwrap();
        z_up += &match words[0] {
            "OFFSET" => format!("OFFSET {} {} {}", 10.0 * number(1), -10.0 * number(3), 10.0 * number(2)),
            "CHANNELS" if words[1] == "3" && words[2] == "Zrotation" => {
                "CHANNELS 3 Yrotation Xrotation Zrotation".to_owned()
            }
            "3" | "4" => {
                let [x, y, z] = [0, 1, 2].map(|i| 10.0 * number(i));
                format!("{x} {} {y} {} {} {}", -z, -number(3), number(4), number(5))
            }
            _ => line.to_owned(),
        };
        z_up.push('\n');
    }
    let (one, other) = (read(&y_up), read(&z_up));
    assert!((one.metres_per_unit.unwrap() / other.metres_per_unit.unwrap() - 10.0).abs() < 1e-9);
    assert!((one.poses[1].hips_translation_m - other.poses[1].hips_translation_m).length() < 1e-6);
    assert!(one.poses[1].hips_translation_m.length() > 0.1);
    for (one, other) in one.poses.iter().zip(&other.poses) {
        for bone in Bone::ALL {
            assert!(one.rotation(bone).angle_between(other.rotation(bone)) < 1e-3, "{}", bone.name());
        }
    }
}

#[test]
fn hanging_arms_are_measured_from_the_first_frame_or_turned() {
    let hanging = |frames: &[&str]| {
        text("1 Zrotation", frames)
            .replace("OFFSET 3 0 0", "OFFSET 0 -3 0")
            .replace("OFFSET -3 0 0", "OFFSET 0 -3 0")
            .replace("CHANNELS 0\nJOINT rightLowerArm", "CHANNELS 1 Zrotation\nJOINT rightLowerArm")
    };
    let down = |bone| {
        let side = if bone == Bone::LeftUpperArm { -1.0 } else { 1.0 };
        Quat::from_rotation_z(side * std::f32::consts::FRAC_PI_2)
    };
    let from_first = read(&hanging(&["0 9 0 90 -90", "0 9 0 0 0"]));
    let turned = read(&hanging(&["0 9 0 0 0"]));
    assert_eq!((from_first.reference, turned.reference), (Reference::FirstFrame, Reference::OffsetsTurned));
    for bone in Bone::ALL {
        let expected =
            if matches!(bone, Bone::LeftUpperArm | Bone::RightUpperArm) { down(bone) } else { Quat::IDENTITY };
        assert!(from_first.poses[0].rotation(bone).angle_between(Quat::IDENTITY) < 2e-3, "{}", bone.name());
        for pose in [&from_first.poses[1], &turned.poses[0]] {
            assert!(pose.rotation(bone).angle_between(expected) < 2e-3, "{}", bone.name());
        }
    }
}

#[test]
fn a_joint_that_is_no_bone_turns_the_bones_below() {
    let good = text("1 Zrotation", &["0 9 0 30 10"]);
    let folded =
        good.replace("JOINT spine\n{\nOFFSET 0 3 0\nCHANNELS 0", "JOINT thing\n{\nOFFSET 0 3 0\nCHANNELS 1 Zrotation");
    let motion = read(&folded);
    assert_eq!(motion.unmapped, ["thing"]);
    let expected = Quat::from_rotation_z(40_f32.to_radians());
    assert!(motion.poses[0].rotation(Bone::LeftUpperArm).angle_between(expected) < 2e-3);
}

#[test]
fn every_mistake_names_its_line_and_what_to_do() {
    let good = text("3 Zrotation Xrotation Yrotation", &["0 9 0 10 20 30", "0 9 0 10 20 30"]);
    let deep: String = (0..130).map(|i| format!("JOINT j{i}\n{{\nOFFSET 0 0 0\n")).collect();
    let many: String = (0..1030).map(|i| format!("JOINT j{i}\n{{\nOFFSET 0 0 0\n}}\n")).collect();
    let table: [(&str, String, &str); 22] = [
        ("empty", String::new(), "line 1: the file ends where HIERARCHY must stand; it was cut off, export it again"),
        ("other", "solid x".into(), "line 1: found \"solid\" where HIERARCHY must stand; is this a BVH file?"),
        ("name", good.replace("JOINT spine", "JOINT"), "line 6: a joint has no name; write it after ROOT or JOINT"),
        (
            "twice",
            good.replace("JOINT leftLowerArm", "JOINT spine"),
            "line 14: a second joint is named \"spine\"; rename one of them",
        ),
        (
            "offset",
            good.replace("OFFSET 0 3 0\n", ""),
            "line 37: joint \"spine\" has no OFFSET; write one in its braces",
        ),
        (
            "offset number",
            good.replace("OFFSET 0 3 0", "OFFSET 0 3"),
            "line 9: \"CHANNELS\" is no number from -1000000 to 1000000; correct it or export the file again",
        ),
        (
            "channel",
            good.replace("Zrotation", "Wrotation"),
            "line 13: unknown channel \"Wrotation\"; channels are Xposition, Yposition, Zposition, Xrotation, Yrotation \
             and Zrotation",
        ),
        (
            "channel twice",
            good.replace("Zrotation", "Xrotation"),
            "line 13: joint \"leftUpperArm\" has the channel \"Xrotation\" twice; name each channel once",
        ),
        (
            "channel count",
            good.replace("CHANNELS 3 Z", "CHANNELS 7 Z"),
            "line 13: \"7\" is no number of channels; a joint has 0 to 6",
        ),
        (
            "word",
            good.replace("JOINT spine", "BONE spine"),
            "line 6: found \"BONE\" where OFFSET, CHANNELS, JOINT, End Site or } must stand; is this a BVH file?",
        ),
        (
            "brace",
            good.replace("}\nMOTION", "MOTION"),
            "line 39: found \"MOTION\" where OFFSET, CHANNELS, JOINT, End Site or } must stand; is this a BVH file?",
        ),
        (
            "deep",
            good.replace("JOINT spine", &(deep + "JOINT spine")),
            "line 387: joints are nested more than 128 deep; is a brace missing?",
        ),
        (
            "many",
            good.replace("JOINT spine", &(many + "JOINT spine")),
            "line 4098: more than 1024 joints; remove those that do not move the body",
        ),
        (
            "no frames",
            good.replace("Frames: 2", "Frames: 0"),
            "line 41: \"0\" is no number of frames from 1 to 131072; cut the recording into pieces",
        ),
        (
            "many frames",
            good.replace("Frames: 2", "Frames: 99999999999"),
            "line 41: \"99999999999\" is no number of frames from 1 to 131072; cut the recording into pieces",
        ),
        (
            "time",
            good.replace("0.0083333", "0"),
            "line 42: \"0\" is no time between frames; write seconds above 0, at most 3600",
        ),
        (
            "not a number",
            good.replace("0 9 0 10", "0 9 NaN 10"),
            "line 43: \"NaN\" is no number from -1000000 to 1000000; correct it or export the file again",
        ),
        (
            "short frame",
            good.replace("20 30\n", "20\n"),
            "line 43: frame 1 has 5 numbers, but the channels of all joints are 6; correct the line or CHANNELS",
        ),
        (
            "long frame",
            good.replace("20 30\n0", "20 30 40\n0"),
            "line 43: frame 1 has 7 numbers, but the channels of all joints are 6; correct the line or CHANNELS",
        ),
        (
            "missing frames",
            good.replace("Frames: 2", "Frames: 3"),
            "line 44: the file announces 3 frames and ends after 2; write \"Frames: 2\" or export it again",
        ),
        (
            "frames left",
            good.replace("Frames: 2", "Frames: 1"),
            "line 44: a frame after the 1 that the file announces; correct \"Frames:\"",
        ),
        (
            "names",
            good.replace("leftUpperArm", "armL"),
            "line 2: no joint is known as leftUpperArm; rename the joints to VRM names such as hips, leftUpperArm and \
             rightUpperArm",
        ),
    ];
    for (mistake, text, message) in table {
        let error = bvh::read(text.as_bytes(), &wearer()).expect_err(mistake);
        assert_eq!(error.to_string(), message, "{mistake}");
    }
    let flat = good.replace("OFFSET 0 3 0", "OFFSET 0 0 0").replace(" 1 0\n", " 0 0\n");
    assert_eq!(
        bvh::read(flat.as_bytes(), &wearer()).unwrap_err().to_string(),
        "line 2: the joints of this skeleton do not show where up and left are; its OFFSETs from the hips to \
         the arms and between the arms must not be 0"
    );
    let still = good.replace("CHANNELS 3 Xposition Yposition Zposition", "").replace("CHANNELS 3 Z", "CHANNELS 0 Z");
    let still = still.replace("Zrotation Xrotation Yrotation", "");
    assert_eq!(
        bvh::read(still.as_bytes(), &wearer()).unwrap_err().to_string(),
        "line 41: no joint has channels, so nothing moves; export the file again with rotations"
    );
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 512, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn damaged_files_give_valid_poses_or_an_error(at in any::<prop::sample::Index>(), byte: u8, cut: bool) {
        let mut bytes = text("3 Zrotation Xrotation Yrotation", &["0 9 0 10 20 30"]).into_bytes();
        let at = at.index(bytes.len());
        bytes[at] = byte;
        if cut {
            bytes.truncate(at);
        }
        if let Ok(motion) = bvh::read(&bytes, &wearer()) {
            prop_assert!(motion.poses.iter().all(Pose::is_valid));
        }
    }
}

#[test]
fn the_motion_of_the_bench_keeps_eight_targets_active() {
    let assets = Path::new(env!("CARGO_MANIFEST_DIR")).join("../assets-src");
    let bytes = std::fs::read(assets.join("motions/two_arms.bvh")).unwrap();
    let source = kitsuke_pipeline::load(&assets.join("komon")).garment.unwrap();
    let motion = bvh::read(&bytes, &source.body.skeleton).unwrap();
    assert_eq!((motion.reference, motion.unmapped.as_slice()), (Reference::Offsets, [].as_slice()));
    assert!((8.0..10.0).contains(&(motion.frame_time_s * motion.poses.len() as f64)));
    assert!(motion.poses.iter().all(Pose::is_valid));
    let step = motion
        .poses
        .windows(2)
        .flat_map(|pair| Bone::ALL.map(|b| pair[0].rotation(b).angle_between(pair[1].rotation(b))));
    assert!(step.fold(0.0, f32::max) < 0.04, "a jump");

    // komon's pose table and drivers on one vertex that nothing moves.
    let rows = std::iter::repeat_n(Quat::IDENTITY, source.pose_bones.len());
    let targets = source.targets.iter();
    let garment = Garment::new(GarmentData {
        id: "poses".to_owned(),
        name: "poses".to_owned(),
        skeleton: source.body.skeleton,
        mesh: Mesh {
            positions_m: vec![Vec3::ZERO],
            triangles: vec![[0; 3]],
            parts: vec![Part { name: "all".to_owned(), triangle_count: 1 }],
            source_vertex: vec![0],
            ..Mesh::default()
        },
        skin: vec![SkinWeights { joints: [0; 4], weights: [u16::MAX, 0, 0, 0] }],
        drivers: source
            .drivers
            .into_iter()
            .map(|ir::Driver { name, joints, threshold_rad, layer, .. }| Driver { name, joints, threshold_rad, layer })
            .collect(),
        segments: vec![Segment { vertex_count: 1, ..Segment::default() }],
        targets: targets
            .clone()
            .map(|t| Target { name: t.name.clone(), layer: t.layer, step_m: 1e-5, ..Target::default() })
            .collect(),
        poses: PoseTable {
            bones: source.pose_bones,
            rotations: rows.chain(targets.flat_map(|t| t.rotations.clone())).collect(),
        },
        pose_limits: Vec::new(),
        rbf: None,
        certificate: None,
        compression: None,
        corrective_count: 0,
    })
    .unwrap();
    let mut rates = Rates::new(garment.data());
    let mut active: Vec<usize> = Vec::new();
    for pose in &motion.poses {
        pose_blend::paper(garment.data(), pose, &mut rates);
        active.push((0..garment.data().targets.len()).filter(|&target| rates.is_active(target)).count());
    }
    assert!(active.iter().all(|&count| count >= 8), "{active:?}");
}

/// A BVH file read as plainly as possible: names, parents, and per frame world positions by matrices.
struct Plain {
    names: Vec<String>,
    parents: Vec<usize>,
    offsets: Vec<DVec3>,
    channels: Vec<Vec<String>>,
    frames: Vec<Vec<f64>>,
}

impl Plain {
    fn new(text: &str) -> Plain {
        let mut plain = Plain { names: vec![], parents: vec![], offsets: vec![], channels: vec![], frames: vec![] };
        let (head, motion) = text.split_once("MOTION").unwrap();
        let mut open = vec![];
        for line in head.lines() {
            let words: Vec<&str> = line.split_whitespace().collect();
            match words.first().copied() {
                Some("ROOT" | "JOINT" | "End") => {
                    plain.names.push(if words[0] == "End" { "End".to_owned() } else { words[1].to_owned() });
                    plain.parents.push(open.last().copied().unwrap_or(usize::MAX));
                    plain.offsets.push(DVec3::ZERO);
                    plain.channels.push(vec![]);
                    open.push(plain.names.len() - 1);
                }
                Some("OFFSET") => {
                    let n: Vec<f64> = words[1..].iter().map(|w| w.parse().unwrap()).collect();
                    *plain.offsets.last_mut().unwrap() = DVec3::new(n[0], n[1], n[2]);
                }
                Some("CHANNELS") => {
                    *plain.channels.last_mut().unwrap() = words[2..].iter().map(|&w| w.to_owned()).collect();
                }
                Some("}") => drop(open.pop()),
                _ => {}
            }
        }
        let rows = motion.lines().skip(3).filter(|line| !line.trim().is_empty());
        plain.frames.extend(rows.map(|row| row.split_whitespace().map(|w| w.parse().unwrap()).collect()));
        plain
    }

    fn positions(&self, frame: usize) -> Vec<DVec3> {
        let mut numbers = self.frames[frame].iter();
        let mut world: Vec<(DMat3, DVec3)> = vec![];
        for joint in 0..self.names.len() {
            let mut local = DMat3::IDENTITY;
            for channel in &self.channels[joint] {
                let number = *numbers.next().unwrap();
                if channel.ends_with("rotation") {
                    local *= rotation_matrix(channel.chars().next().unwrap(), number);
                }
            }
            let (rotation, position) = match self.parents[joint] {
                usize::MAX => (DMat3::IDENTITY, DVec3::ZERO),
                parent => world[parent],
            };
            world.push((rotation * local, position + rotation * self.offsets[joint]));
        }
        world.into_iter().map(|(_, position)| position).collect()
    }
}

fn elevation_deg(along: DVec3, up: DVec3) -> f64 {
    90.0 - along.angle_between(up).to_degrees()
}

/// Direction between two joints of the wearer in a pose, from the product of rotations.
fn posed_direction(skeleton: &Skeleton, pose: &Pose, bone: Bone, next: Bone) -> DVec3 {
    let mut chain = vec![];
    let mut joint = skeleton.index_of(bone);
    while let Some(index) = joint {
        chain.push(pose.rotation(skeleton.joints()[index].bone));
        joint = skeleton.joints()[index].parent.map(usize::from);
    }
    let world = chain.into_iter().rev().fold(Quat::IDENTITY, |world, local| world * local);
    let rest_m = |bone| skeleton.joints()[skeleton.index_of(bone).unwrap()].rest_m;
    (world * (rest_m(next) - rest_m(bone))).as_dvec3()
}

/// The recordings of several tools: file, up axis, joints of both arms from shoulder to wrist, joints of a leg.
#[test]
fn limbs_of_real_recordings_point_where_they_pointed() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../shared/data/motions");
    if !folder.is_dir() {
        println!("skipped: {} is absent", folder.display());
        return;
    }
    let mixamo =
        ["LeftArm", "LeftForeArm", "LeftHand", "RightArm", "RightForeArm", "RightHand", "LeftUpLeg", "LeftLeg"];
    let joints =
        ["LeftShoulder", "LeftElbow", "LeftWrist", "RightShoulder", "RightElbow", "RightWrist", "LeftHip", "LeftKnee"];
    let makehuman = [
        "upperarm01.L",
        "lowerarm01.L",
        "wrist.L",
        "upperarm01.R",
        "lowerarm01.R",
        "wrist.R",
        "upperleg01.L",
        "lowerleg01.L",
    ];
    let table = [
        ("bvhtoolbox_walk01.bvh", DVec3::Y, mixamo, Reference::Offsets),
        ("cmu_12_01_walk.bvh", DVec3::Y, mixamo, Reference::Offsets),
        ("cmu_131_01.bvh", DVec3::Y, joints, Reference::OffsetsTurned),
        ("cmu_131_02.bvh", DVec3::Y, joints, Reference::OffsetsTurned),
        ("makehuman_pose_sit01.bvh", DVec3::Z, makehuman, Reference::OffsetsTurned),
        ("makehuman_pose_standing01.bvh", DVec3::Z, makehuman, Reference::OffsetsTurned),
    ];
    let wearer = wearer();
    let bones = [
        (Bone::LeftUpperArm, Bone::LeftLowerArm, 0),
        (Bone::LeftLowerArm, Bone::LeftHand, 1),
        (Bone::RightUpperArm, Bone::RightLowerArm, 3),
        (Bone::RightLowerArm, Bone::RightHand, 4),
        (Bone::LeftUpperLeg, Bone::LeftLowerLeg, 6),
    ];
    for (file, up, names, reference) in table {
        let bytes = std::fs::read(folder.join(file)).unwrap();
        let motion = bvh::read(&bytes, &wearer).unwrap_or_else(|error| panic!("{file}: {error}"));
        let plain = Plain::new(&String::from_utf8_lossy(&bytes));
        println!(
            "{file}: {} poses, {:?}, {:?} m/unit, {} unmapped",
            motion.poses.len(),
            motion.reference,
            motion.metres_per_unit,
            motion.unmapped.len()
        );
        assert_eq!((motion.poses.len(), motion.reference), (plain.frames.len(), reference), "{file}");
        assert!(motion.poses.iter().all(Pose::is_valid), "{file}");
        let joint = |name: &str| plain.names.iter().position(|listed| listed == name).unwrap();
        for (number, pose) in motion.poses.iter().enumerate().step_by(7) {
            let positions = plain.positions(number);
            for (bone, next, name) in bones {
                let recorded = positions[joint(names[name + 1])] - positions[joint(names[name])];
                let recorded = elevation_deg(recorded, up);
                let posed = elevation_deg(posed_direction(&wearer, pose, bone, next), DVec3::Y);
                assert!(
                    (posed - recorded).abs() < 0.5,
                    "{file}, frame {number}, {}: {posed:.1}° instead of {recorded:.1}°",
                    bone.name()
                );
            }
        }
    }
}
