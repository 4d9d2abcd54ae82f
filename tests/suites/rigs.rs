//! BVH of rigs as other programs write them: bones along their own axes, OFFSETs in other axes than the frames, roots that
//! stand still above moving hips, positions in place of OFFSETs, several people. What is right comes from the poses that
//! were written, and from another program for the files beside the checkout.

use glam::{DQuat, DVec3, EulerRot, Quat, Vec3};
use kitsuke::skeleton::bvh::{self, Axis, Motion, Options, Reference, Rest};
use kitsuke::skeleton::recording;
use kitsuke::skeleton::{Bone, Pose, Skeleton};
use kitsuke_tests::motions::{self, LIMBS, Posed, Rigged, apart_deg, bones_along, dance, wearer};
use proptest::prelude::*;
use std::f64::consts::FRAC_PI_2;
use std::path::PathBuf;

fn read(text: &str) -> Motion {
    read_with(text, Options::default())
}

fn read_with(text: &str, options: Options) -> Motion {
    bvh::read_with(text.as_bytes(), &wearer(), options).unwrap_or_else(|error| panic!("{error}\n{text:.600}"))
}

fn refusal(text: &str) -> String {
    bvh::read(text.as_bytes(), &wearer()).expect_err("this is ambiguous").to_string()
}

fn says(motion: &Motion, words: &str) {
    assert!(motion.notes.iter().any(|note| note.contains(words)), "{words:?} in {:#?}", motion.notes);
}

/// OFFSETs with Z up, front -Y: axes of joints that a quarter turn about X stands upright.
fn z_up(wearer: &Skeleton) -> Vec<DQuat> {
    vec![DQuat::from_rotation_x(-FRAC_PI_2); wearer.joints().len()]
}

/// Largest angle between world rotations of these bones in two motions, degrees, and largest distance of the hips' ways, m.
fn farthest(found: &[Pose], expected: &[Pose], bones: &[Bone]) -> (f64, f32) {
    assert_eq!(found.len(), expected.len());
    let wearer = wearer();
    let (mut apart, mut way_m) = (0.0_f64, 0.0_f32);
    for (pose, written) in found.iter().zip(expected) {
        let (a, b) = (Posed::new(&wearer, pose), Posed::new(&wearer, written));
        for &bone in bones {
            apart = apart.max(apart_deg(a.rotation(bone), b.rotation(bone)));
        }
        let moved = written.hips_translation_m - expected[0].hips_translation_m;
        way_m = way_m.max(pose.hips_translation_m.distance(moved));
    }
    (apart, way_m)
}

/// The dance with the lower foot on the ground.
fn grounded() -> Vec<Pose> {
    let (wearer, mut poses) = (wearer(), dance());
    for pose in &mut poses {
        let posed = Posed::new(&wearer, pose);
        let feet_m = [Bone::LeftFoot, Bone::RightFoot].map(|foot| posed.joint(foot).y);
        pose.hips_translation_m.y -= (feet_m[0].min(feet_m[1]) - 0.07) as f32;
    }
    poses
}

fn all_bones() -> Vec<Bone> {
    wearer().joints().iter().map(|joint| joint.bone).collect()
}

/// Bones whose turn a rig without a pose gives when elbows and knees bend as hinges.
fn told_bones() -> Vec<Bone> {
    [&[Bone::UpperChest], &LIMBS[..]].concat()
}

#[test]
fn rigs_with_bones_along_their_own_axes_move_as_they_were_moved() {
    let (wearer, poses) = (wearer(), grounded());
    let rig = |axis, twist| Rigged::new(bones_along(&wearer, axis, twist));
    let z_world = DQuat::from_rotation_x(FRAC_PI_2);
    let table = [
        ("x", rig(DVec3::X, 0.0), Axis::PlusY),
        ("y, twisted", Rigged { order: (EulerRot::ZYX, ['Z', 'Y', 'X']), ..rig(DVec3::Y, 0.7) }, Axis::PlusY),
        ("-z, inches", Rigged { units: 100.0 / 2.54, ..rig(DVec3::NEG_Z, 1.9) }, Axis::PlusY),
        ("x, prefix", Rigged { prefix: "Character1_", ..rig(DVec3::X, -2.4) }, Axis::PlusY),
        ("y, Z up in the world", Rigged { world: z_world, ..rig(DVec3::Y, 0.3) }, Axis::PlusZ),
        ("-x, below a root", Rigged { reference: Some(z_world), ..rig(DVec3::NEG_X, 0.9) }, Axis::PlusY),
        ("y, places", Rigged { places_everywhere: true, ..rig(DVec3::Y, 0.5) }, Axis::PlusY),
    ];
    for (name, rig, up) in table {
        let motion = read(&rig.bvh(&wearer, &poses));
        assert_eq!((motion.reference, motion.up), (Reference::Directions, up), "{name}: {:#?}", motion.notes);
        says(&motion, "OFFSETs form no pose");
        let (apart, way_m) = farthest(&motion.poses, &poses, &told_bones());
        let (rest, _) = farthest(&motion.poses, &poses, &all_bones());
        println!("{name}: {apart:.4}°, with means {rest:.3}°, way {:.3} mm", way_m * 1e3);
        assert!(apart < 1.0 && rest < 3.0 && way_m < 1e-3, "{name}: {apart}°, {rest}°, {way_m} m");
    }
}

#[test]
fn offsets_in_other_axes_than_the_frames_are_turned() {
    let (wearer, poses) = (wearer(), grounded());
    let tilted = |rest: DQuat| Rigged::new(vec![rest; wearer.joints().len()]);
    let quarter = DQuat::from_rotation_x(-FRAC_PI_2);
    let table = [
        ("Z up, ZXY", Rigged::new(z_up(&wearer)), Axis::PlusZ),
        (
            "Z up, XYZ, inches",
            Rigged { order: (EulerRot::XYZ, ['X', 'Y', 'Z']), units: 39.37, ..tilted(quarter) },
            Axis::PlusZ,
        ),
        (
            "Z up, YXZ, prefix",
            Rigged { order: (EulerRot::YXZ, ['Y', 'X', 'Z']), prefix: "a:", ..tilted(quarter) },
            Axis::PlusZ,
        ),
        ("X up", tilted(DQuat::from_rotation_z(FRAC_PI_2)), Axis::PlusX),
        ("-Z up", tilted(DQuat::from_rotation_x(FRAC_PI_2)), Axis::MinusZ),
        ("Z up, turned by a root", Rigged { reference: Some(quarter), ..tilted(quarter) }, Axis::PlusZ),
    ];
    for (name, rig, offsets_up) in table {
        for first in [Pose::REST, poses[0].clone()] {
            let poses: Vec<Pose> = std::iter::once(first).chain(poses[1..60].iter().cloned()).collect();
            let motion = read(&rig.bvh(&wearer, &poses));
            assert_eq!((motion.reference, motion.up), (Reference::Offsets, Axis::PlusY), "{name}: {:#?}", motion.notes);
            says(&motion, &format!("OFFSETs have {offsets_up} up and the frames turn them"));
            let (apart, way_m) = farthest(&motion.poses, &poses, &all_bones());
            println!("{name}: {apart:.4}°, way {:.3} mm", way_m * 1e3);
            assert!(apart < 0.01 && way_m < 1e-4, "{name}: {apart}°, {way_m} m");
        }
    }
}

#[test]
fn the_way_is_that_of_the_hips_whatever_stands_above_them() {
    let (wearer, poses) = (wearer(), &dance()[..60]);
    let upright = || Rigged::new(vec![DQuat::IDENTITY; wearer.joints().len()]);
    let turned = |rotation| Rigged { reference: Some(rotation), ..upright() };
    let table = [
        ("still", turned(DQuat::IDENTITY)),
        ("turned", turned(DQuat::from_rotation_y(2.1))),
        ("inches, odd turn", Rigged { units: 39.37, ..turned(DQuat::from_euler(EulerRot::XYZ, 0.4, -0.9, 0.2)) }),
        ("places of every joint", Rigged { places_everywhere: true, ..turned(DQuat::from_rotation_y(-0.4)) }),
        ("places of every joint, no root above", Rigged { places_everywhere: true, ..upright() }),
        ("prefix", Rigged { prefix: "Character1_", ..turned(DQuat::IDENTITY) }),
    ];
    for (name, rig) in table {
        let motion = read(&rig.bvh(&wearer, poses));
        assert_eq!(motion.reference, Reference::Offsets, "{name}: {:#?}", motion.notes);
        let (apart, way_m) = farthest(&motion.poses, poses, &all_bones());
        println!("{name}: {apart:.4}°, way {:.3} mm", way_m * 1e3);
        assert!(apart < 0.01 && way_m < 1e-4, "{name}: {apart}°, {way_m} m");
        says(&motion, "position channels replace the OFFSETs of joints besides the root");
        assert!(motion.poses[59].hips_translation_m.length() > 0.1);
    }
}

#[test]
fn positions_near_0_are_counted_from_offsets() {
    let (wearer, poses) = (wearer(), &dance()[..20]);
    let plain = Rigged::new(vec![DQuat::IDENTITY; wearer.joints().len()]);
    let places = Rigged { places_everywhere: true, ..plain.clone() };
    // OFFSETs of the one, channels of the other, all places 0 but the root's.
    let (joints, _) = plain.skeleton(&wearer, poses);
    let (_, frames) = places.skeleton(&wearer, poses);
    let joints = joints.replace("CHANNELS 3 ", "CHANNELS 6 Xposition Yposition Zposition ");
    let zeroed = |frame: &String| {
        let numbers = frame.split(' ').enumerate();
        let zeroed = numbers.map(|(i, number)| if i >= 6 && i % 6 < 3 { "0" } else { number });
        zeroed.collect::<Vec<&str>>().join(" ")
    };
    let motion = read(&motions::bvh_file(&[joints], &[frames.iter().map(zeroed).collect()]));
    says(&motion, "near 0, so they are counted from their OFFSETs");
    let (apart, way_m) = farthest(&motion.poses, poses, &all_bones());
    assert!(apart < 0.01 && way_m < 1e-4, "{apart}°, {way_m} m");
}

#[test]
fn of_several_people_the_first_body_is_read_and_that_is_said() {
    let (wearer, all) = (wearer(), dance());
    let (first, second) = (&all[..30], &all[100..130]);
    let rig = |prefix| Rigged { prefix, ..Rigged::new(vec![DQuat::IDENTITY; wearer.joints().len()]) };
    let one = rig("").skeleton(&wearer, first);
    let (prop, prop_frames) = (
        "ROOT camera\n{\nOFFSET 0 0 0\nCHANNELS 3 Xposition Yposition Zposition\n}\n".to_owned(),
        vec!["1 2 3".to_owned(); 30],
    );
    let reference = Rigged { reference: Some(DQuat::from_rotation_y(1.0)), ..rig("") }.skeleton(&wearer, first);
    let other = |prefix| rig(prefix).skeleton(&wearer, second);
    let prop = (prop, prop_frames);
    let table = [
        ("prefix", vec![one.clone(), other("B:")], "2 skeletons (ROOTs); the first, \"hips\""),
        ("same names", vec![one.clone(), other("")], "2 skeletons (ROOTs); the first, \"hips\""),
        ("three", vec![one.clone(), other("b_"), other("c_")], "3 skeletons (ROOTs); the first, \"hips\""),
        ("camera first", vec![prop.clone(), one.clone()], "number 2, the first that is a body, \"hips\""),
        ("below a root", vec![reference, prop], "the first, \"Reference\""),
    ];
    for (name, skeletons, said) in table {
        let (joints, frames): (Vec<String>, Vec<Vec<String>>) = skeletons.into_iter().unzip();
        let motion = read(&motions::bvh_file(&joints, &frames));
        says(&motion, said);
        let (apart, way_m) = farthest(&motion.poses, first, &all_bones());
        assert!(apart < 0.01 && way_m < 1e-4, "{name}: {apart}°, {way_m} m");
    }
}

#[test]
fn what_the_evidence_leaves_open_is_asked() {
    let wearer = wearer();
    let lie = Quat::from_rotation_x(-std::f32::consts::FRAC_PI_2);
    let lying = |pose: &Pose| pose.clone().with(Bone::Hips, lie * pose.rotation(Bone::Hips));
    let poses = &dance()[..60];
    let asleep: Vec<Pose> = poses.iter().map(lying).collect();
    let plain = Rigged::new(vec![DQuat::IDENTITY; wearer.joints().len()]);

    // Who lies all the time, or a rig turned into other axes?
    let text = plain.bvh(&wearer, &asleep);
    let message = refusal(&text);
    assert!(
        message
            .contains("100 % of 60 frames looked at stand along -Z, feet are not at height 0, its OFFSETs have +Y up"),
        "{message}"
    );
    assert!(message.ends_with("decide it with --up, such as --up -Z"), "{message}");
    let told = read_with(&text, Options { up: Some(Axis::PlusY), ..Options::default() });
    assert!(farthest(&told.poses, &asleep, &all_bones()).0 < 0.01);
    // The same with Z up, head towards +Y: custom alone does not stand the wearer up.
    let z_world = DQuat::from_rotation_x(FRAC_PI_2);
    let text = Rigged { world: z_world, ..Rigged::new(z_up(&wearer)) }.bvh(&wearer, &asleep);
    let message = refusal(&text);
    assert!(
        message.contains("along +Y, feet are not at height 0, its OFFSETs have +Z up, and the format"),
        "{message}"
    );
    let told = read_with(&text, Options { up: Some(Axis::PlusZ), ..Options::default() });
    assert!(farthest(&told.poses, &asleep, &all_bones()).0 < 0.01);
    // Who gets up at the end stands along the pose's up.
    let woken: Vec<Pose> = asleep.iter().cloned().chain(poses[..5].iter().cloned()).collect();
    let motion = read(&plain.bvh(&wearer, &woken));
    says(&motion, "up is +Y by its T-pose and the format's custom, though only 8 %");
    assert!(farthest(&motion.poses, &woken, &all_bones()).0 < 0.01);

    // Bones along an axis and Z up, in the air: only the frames say so.
    let hover: Vec<Pose> = poses
        .iter()
        .map(|pose| Pose { hips_translation_m: pose.hips_translation_m + 3.0 * Vec3::Y, ..pose.clone() })
        .collect();
    let rig = Rigged { world: z_world, ..Rigged::new(bones_along(&wearer, DVec3::X, 0.4)) };
    let text = rig.bvh(&wearer, &hover);
    let message = refusal(&text);
    assert!(
        message.contains("stand along +Z, feet are not at height 0, its OFFSETs form no pose")
            && message.contains("--up +Z"),
        "{message}"
    );
    let told = read_with(&text, Options { up: Some(Axis::PlusZ), ..Options::default() });
    let (apart, way_m) = farthest(&told.poses, &hover, &told_bones());
    assert!(apart < 1.0 && way_m < 1e-3, "{apart}°, {way_m} m");

    // OFFSETs of someone who sits: a pose or none?
    let mut sits = vec![DQuat::IDENTITY; wearer.joints().len()];
    for (joint, rest) in wearer.joints().iter().zip(&mut sits) {
        if joint.bone.name().contains("Leg") || joint.bone.name().contains("Foot") {
            *rest = DQuat::from_rotation_x(FRAC_PI_2);
        }
    }
    let text = Rigged::new(sits).bvh(&wearer, poses);
    let message = refusal(&text);
    assert!(message.contains("from straight down; decide it with --rest offsets, --rest first-frame"), "{message}");
    let told = read_with(&text, Options { rest: Some(Rest::Directions), ..Options::default() });
    assert!(farthest(&told.poses, poses, &told_bones()).0 < 1.0);
    let told = read_with(&text, Options { rest: Some(Rest::FirstFrame), ..Options::default() });
    assert_eq!(told.reference, Reference::FirstFrame);
    says(&told, "first frame, as told");
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 256, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn damaged_rigs_give_valid_poses_or_an_error(at in any::<prop::sample::Index>(), byte: u8, rest in 0..4_usize, flat: bool) {
        let wearer = wearer();
        let rig = Rigged { places_everywhere: true, ..Rigged::new(bones_along(&wearer, DVec3::X, 0.3)) };
        let mut bytes = rig.bvh(&wearer, &dance()[..3]).into_bytes();
        let at = at.index(bytes.len());
        bytes[at] = byte;
        if flat {
            // All places 0 or 1.
            bytes.iter_mut().filter(|byte| byte.is_ascii_digit()).for_each(|byte| *byte &= 0xf1);
        }
        let rest = [None, Some(Rest::Offsets), Some(Rest::FirstFrame), Some(Rest::Directions)][rest];
        if let Ok(motion) = bvh::read_with(&bytes, &wearer, Options { rest, ..Options::default() }) {
            prop_assert!(motion.poses.iter().all(Pose::is_valid));
        }
    }
}

#[test]
fn options_of_bvh_are_refused_where_they_mean_nothing() {
    let lines = "{\"kitsuke_motion\":1,\"holds\":\"rotations\"}\n{\"t\":0.0,\"bones\":{}}\n";
    let up = Options { up: Some(Axis::PlusZ), ..Options::default() };
    let refused = recording::read_with(lines.as_bytes(), &wearer(), up).expect_err("this is no BVH").to_string();
    assert_eq!(refused, "--up and --rest decide how BVH is read; leave them out, this is no BVH");
    assert!(recording::read_with(lines.as_bytes(), &wearer(), Options::default()).is_ok());
}

#[test]
fn axes_are_read_as_they_are_written() {
    for axis in Axis::ALL {
        assert_eq!(axis.name().parse(), Ok(axis));
        assert_eq!(axis.name().to_lowercase().trim_start_matches('+').parse(), Ok(axis));
    }
    assert!("up".parse::<Axis>().is_err() && "".parse::<Axis>().is_err() && "+-Z".parse::<Axis>().is_err());
}

/// Files of the kinds that people met, with what is right computed by another program.
#[test]
fn odd_files_of_other_programs_are_read_rightly() {
    let folder = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../../shared/data/reports");
    if !folder.is_dir() {
        println!("skipped: {} is absent", folder.display());
        return;
    }
    let text = |file: &str| std::fs::read_to_string(folder.join(file)).unwrap();
    let directions = text("plain/expected_directions.csv");
    let bone = |name: &str| Bone::ALL.into_iter().find(|bone| bone.name() == name).unwrap();
    let wearer = wearer();
    // File, which of the expected frames its frames are, whether only directions are known.
    let table: [(&str, &[usize], bool); 6] = [
        ("plain/standard.bvh", &[1, 2, 3], false),
        ("bones_along_x/bones_along_x.bvh", &[2, 3], true),
        ("turned_root/turned_root.bvh", &[2, 3], false),
        ("turned_root/turned_root_tframe.bvh", &[1, 2, 3], false),
        ("reference_root/reference_root.bvh", &[1, 2, 3], false),
        ("two_people/two_people.bvh", &[1, 2, 3], false),
    ];
    let rotations = text("plain/expected_poses.csv");
    let mut rows = rotations.lines().map(|line| line.split(',').collect::<Vec<&str>>());
    let heads = rows.next().unwrap();
    let rows: Vec<Vec<&str>> = rows.collect();
    for (file, frames, only_directions) in table {
        let motion = read(&text(file));
        assert_eq!(motion.poses.len(), frames.len(), "{file}");
        let (mut farthest, mut apart) = (0.0_f64, 0.0_f64);
        for (pose, &number) in motion.poses.iter().zip(frames) {
            let posed = Posed::new(&wearer, pose);
            for line in directions.lines().skip(1) {
                let words: Vec<&str> = line.split(',').collect();
                if words[0] != number.to_string() {
                    continue;
                }
                let along = (posed.joint(bone(words[2])) - posed.joint(bone(words[1]))).normalize();
                let expected = DVec3::from_array([3, 4, 5].map(|i| words[i].parse().unwrap()));
                farthest = farthest.max(along.angle_between(expected.normalize()).to_degrees());
            }
            if only_directions {
                continue;
            }
            for joint in wearer.joints() {
                let first = heads.iter().position(|head| *head == format!("{}_qx", joint.bone.name()));
                let expected = first.map_or(Quat::IDENTITY, |first| {
                    Quat::from_array([0, 1, 2, 3].map(|i| rows[number - 1][first + i].parse().unwrap()))
                });
                apart = apart.max(apart_deg(pose.rotation(joint.bone), expected));
            }
        }
        println!("{file}: directions {farthest:.3}°, rotations {apart:.3}°");
        assert!(farthest < 0.6 && apart < 0.6, "{file}: {farthest}°, {apart}°");
    }
    let way = read(&text("reference_root/reference_root.bvh"));
    let expected = [[0.0, 0.0, 0.0], [0.1, -0.05, 0.2], [0.3, 0.0, 0.5]].map(Vec3::from_array);
    for (pose, expected) in way.poses.iter().zip(expected) {
        assert!(pose.hips_translation_m.distance(expected) < 2e-3, "{}", pose.hips_translation_m);
    }
    says(&read(&text("two_people/two_people.bvh")), "2 skeletons (ROOTs); the first, \"Hips\", is read");
    says(&read(&text("turned_root/turned_root.bvh")), "OFFSETs have +Z up and the frames turn them");
}
