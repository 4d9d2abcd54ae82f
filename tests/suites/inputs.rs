//! Recorded inputs: one motion through every format, the recordings of real tools against plain readings of the same files,
//! and files that are wrong.

use glam::{DMat3, DVec3, EulerRot};
use kitsuke::skeleton::filter::{Filter, FilterState, Holt, OneEuro};
use kitsuke::skeleton::positions::{FADE_S, Layout, Solver};
use kitsuke::skeleton::recording::{self, Format, Recording};
use kitsuke::skeleton::{Bone, Pose, Tracked, jsonl};
use kitsuke_tests::motions::{self, DANCE_FRAME_S, LIMBS, Posed, apart_deg, dance, wearer};
use std::path::PathBuf;

fn read(bytes: &[u8]) -> Recording {
    recording::read(bytes, &wearer()).unwrap_or_else(|error| panic!("{error}"))
}

/// The largest angle between the wearer's local rotations in two motions, degrees.
fn farthest_deg<'a>(poses: impl ExactSizeIterator<Item = &'a Pose>, expected: &[Pose]) -> f64 {
    assert_eq!(poses.len(), expected.len());
    let wearer = wearer();
    let of_pose = |(pose, expected): (&Pose, &Pose)| {
        let apart = wearer.joints().iter().map(|j| apart_deg(pose.rotation(j.bone), expected.rotation(j.bone)));
        apart.fold(0.0, f64::max)
    };
    poses.zip(expected).map(of_pose).fold(0.0, f64::max)
}

#[test]
fn one_motion_is_the_same_through_every_recorded_format() {
    let (wearer, poses) = (wearer(), dance());
    let orders = [(EulerRot::ZXY, ['Z', 'X', 'Y']), (EulerRot::ZYX, ['Z', 'Y', 'X']), (EulerRot::XYZ, ['X', 'Y', 'Z'])];
    let mut files: Vec<(String, Vec<u8>)> = orders
        .map(|(order, axes)| (format!("BVH {axes:?}"), motions::bvh(&wearer, &poses, order, axes).into_bytes()))
        .into();
    files.push(("VRMA".into(), motions::vrma(&wearer, &poses, &motions::odd_rest(&wearer))));
    for (name, bytes) in files {
        let recording = read(&bytes);
        let apart_deg = farthest_deg(recording.frames.iter().map(|frame| &frame.pose), &poses);
        println!("{name}: {apart_deg:.6}°");
        assert!(apart_deg < 0.01, "{name}: {apart_deg}° apart");
        for (frame, time_s) in recording.times_s.iter().enumerate() {
            assert!((time_s - frame as f64 * DANCE_FRAME_S).abs() < 1e-5, "{name}: frame {frame} at {time_s} s");
        }
        for (frame, expected) in recording.frames.iter().zip(&poses) {
            let moved_m = expected.hips_translation_m - poses[0].hips_translation_m;
            let first = recording.frames[0].pose.hips_translation_m;
            assert!((frame.pose.hips_translation_m - first).distance(moved_m) < 1e-4, "{name}");
        }
    }
}

#[test]
fn a_motion_whose_names_say_nothing_is_the_same() {
    let (wearer, poses) = (wearer(), dance());
    let text = motions::bvh(&wearer, &poses[..30], EulerRot::ZXY, ['Z', 'X', 'Y']);
    let named = wearer.joints().iter().enumerate().rev();
    let nameless = named
        .fold(text, |text, (i, joint)| text.replace(&format!(" {}\n{{", joint.bone.name()), &format!(" q{i}\n{{")));
    let recording = read(nameless.as_bytes());
    assert!(recording.notes.iter().any(|note| note.contains("branches")), "{:?}", recording.notes);
    let found = Posed::new(&wearer, &recording.frames[20].pose);
    let expected = Posed::new(&wearer, &poses[20]);
    for bone in LIMBS.into_iter().chain([Bone::Hips, Bone::UpperChest, Bone::LeftHand, Bone::RightFoot]) {
        let apart_deg = apart_deg(found.rotation(bone), expected.rotation(bone));
        assert!(apart_deg < 0.01, "{}: {apart_deg}°", bone.name());
    }
}

#[test]
fn the_recorder_gives_back_the_same_bits() {
    let mut text = jsonl::header();
    let mut written: Vec<(f64, Tracked)> = Vec::new();
    for (i, pose) in dance().into_iter().enumerate() {
        let mut tracked = Tracked::certain(pose.with(Bone::Jaw, glam::Quat::from_xyzw(-0.0, 1e-30, 0.0, 1.0)));
        tracked.confidence[i % Bone::COUNT] = 0.1 + i as f32 / 977.0;
        tracked.confidence[Bone::LeftEye as usize] = 0.0;
        written.push((i as f64 * DANCE_FRAME_S, tracked));
    }
    written.push((99.0 + 1.0 / 3.0, Tracked::UNSEEN));
    for (time_s, tracked) in &written {
        jsonl::write_frame(&mut text, *time_s, tracked);
    }
    let recording = read(text.as_bytes());
    assert_eq!(recording.format, Format::JsonLines);
    let bits = |tracked: &Tracked| {
        let rotations = tracked.pose.rotations.map(|q| q.to_array().map(f32::to_bits));
        let hips = tracked.pose.hips_translation_m.to_array().map(f32::to_bits);
        (rotations, hips, tracked.confidence.map(f32::to_bits))
    };
    for (i, (time_s, tracked)) in written.iter().enumerate() {
        assert_eq!(recording.times_s[i].to_bits(), time_s.to_bits(), "time of frame {i}");
        assert_eq!(bits(&recording.frames[i]), bits(tracked), "frame {i}");
    }
    let mut again = jsonl::header();
    for (time_s, frame) in recording.times_s.iter().zip(&recording.frames) {
        jsonl::write_frame(&mut again, *time_s, frame);
    }
    assert_eq!(again, text);
}

/// The dance as a camera of this layout sees it, in the recorder's lines.
fn seen(layout: Layout) -> String {
    let wearer = wearer();
    let mut text = format!("{{\"kitsuke_motion\":1,\"holds\":\"positions\",\"layout\":\"{}\"}}\n", layout.name());
    for (i, pose) in dance().iter().enumerate() {
        let joint = |at: Option<[f64; 3]>| at.map(|[x, y, z]| [x, y, z, 1.0]);
        let joints: Vec<Option<[f64; 4]>> =
            motions::positions(layout, &Posed::new(&wearer, pose)).into_iter().map(joint).collect();
        text += &format!("{}\n", serde_json::json!({"t": i as f64 * DANCE_FRAME_S, "joints": joints}));
    }
    text
}

#[test]
fn positions_turn_arms_and_legs_as_they_were_turned() {
    let (wearer, poses) = (wearer(), dance());
    for layout in Layout::ALL {
        let recording = read(seen(layout).as_bytes());
        let mut farthest = [0.0_f64; LIMBS.len()];
        for (frame, expected) in recording.frames.iter().zip(&poses) {
            let (found, expected) = (Posed::new(&wearer, &frame.pose), Posed::new(&wearer, expected));
            for (bone, farthest) in LIMBS.into_iter().zip(&mut farthest) {
                *farthest = farthest.max(apart_deg(found.rotation(bone), expected.rotation(bone)));
                assert!(frame.confidence[bone as usize] == 1.0);
            }
        }
        println!("{}: {:.3?}°", layout.name(), farthest);
        assert!(farthest.iter().all(|&apart_deg| apart_deg < 2.0), "{}: {farthest:?}", layout.name());
    }
}

#[test]
fn what_is_lost_is_held_and_fades_and_what_is_doubtful_pulls_slowly() {
    let wearer = wearer();
    let layout = Layout::MediaPipe33;
    let measured = |pose: &Pose, wrist: f64| {
        let mut joints: Vec<_> = motions::positions(layout, &Posed::new(&wearer, pose))
            .into_iter()
            .map(|at| at.map(|at| (at, 1.0)))
            .collect();
        joints[15] = joints[15].map(|(at, _)| (at, wrist));
        joints
    };
    let poses = dance();
    let arm = |tracked: &Tracked| tracked.pose.rotation(Bone::LeftLowerArm);
    let mut solver = Solver::new(layout, &wearer);
    let seen = solver.pose(&measured(&poses[0], 1.0), 0.0).clone();
    // Lost: all stays as it is.
    let mut lost = seen.clone();
    for _ in 0..30 {
        lost = solver.pose(&[], 1.0 / 60.0).clone();
        assert!(lost.pose.is_valid());
        assert_eq!(arm(&lost), arm(&seen));
    }
    let faded = libm::exp(-0.5 / FADE_S) as f32;
    assert!((lost.confidence[Bone::LeftLowerArm as usize] - faded).abs() < 1e-3);
    // Not a number is as good as lost.
    let broken = vec![Some(([f64::NAN, 0.0, 1e300], 1.0)); 33];
    assert_eq!(arm(solver.pose(&broken, 1.0 / 60.0)), arm(&seen));
    // Doubtful: no jump, but it comes.
    let other = measured(&poses[40], 0.4);
    let first = solver.pose(&other, 1.0 / 60.0).clone();
    let later = (0..180).fold(first.clone(), |_, _| solver.pose(&other, 1.0 / 60.0).clone());
    let way_deg = apart_deg(arm(&later), arm(&seen));
    assert!(way_deg > 10.0 && apart_deg(arm(&first), arm(&seen)) < 0.1 * way_deg);
    let forearm = |pose: &Pose| {
        let posed = Posed::new(&wearer, pose);
        posed.joint(Bone::LeftHand) - posed.joint(Bone::LeftLowerArm)
    };
    assert!(forearm(&later.pose).angle_between(forearm(&poses[40])).to_degrees() < 1.0);
    assert!((later.confidence[Bone::LeftLowerArm as usize] - 0.4).abs() < 1e-6);
    // Trusted: there at once.
    let trusted = solver.pose(&measured(&poses[80], 0.6), 1.0 / 60.0);
    assert!(apart_deg(arm(trusted), poses[80].rotation(Bone::LeftLowerArm)) < 2.0);
}

fn refusal(text: &str) -> String {
    recording::read(text.as_bytes(), &wearer()).expect_err(text).to_string()
}

#[test]
fn json_that_is_no_recording_says_what_it_is() {
    let gltf = refusal(r#"{"asset":{"version":"2.0"},"nodes":[]}"#);
    assert!(gltf.contains("glTF as text") && gltf.contains(".vrma"), "{gltf}");
    let other = refusal(r#"{"name":"a \"frames\": b","measurements":{"frames":1}}"#);
    assert!(other.contains("it has \"name\", \"measurements\"") && !other.contains("missing field"), "{other}");
    let cut = refusal("{\"Loop\": \"wrap\",\n\"Frames\": [[0.1, 0.2");
    assert!(cut.starts_with("line 2: it ends in the middle") && !cut.contains("MediaPipe"), "{cut}");
}

#[test]
fn an_error_in_json_names_one_line() {
    let lines = "{\"kitsuke_motion\":1,\"holds\":\"rotations\"}\n\n{\"t\":0.0,\"bones\":{}}\n";
    let cut = refusal(&format!("{lines}{{\"t\":0.1,\"bones\":{{"));
    assert!(cut.starts_with("line 4: it ends in the middle"), "{cut}");
    let wrong = refusal(&format!("{lines}{{\"t\":0.1,\"bone\":{{}}}}"));
    assert!(
        wrong.starts_with("line 4: unknown field `bone`") && wrong.contains("a line is like {\"t\":0.0"),
        "{wrong}"
    );
    let media = refusal("{\n\"frames\": [\n{\"worldLandmarks\": 3}]}");
    for message in [cut, wrong, media] {
        assert_eq!(
            message.matches("line ").count() - message.matches("a line ").count() - message.matches("or line ").count(),
            1,
            "{message}"
        );
    }
}

#[test]
fn kinect_tables_may_have_headings_and_semicolons() {
    let joints = motions::positions(Layout::Kinect25, &Posed::new(&wearer(), &dance()[3]));
    let numbers = |ticks: u32| {
        let joints = joints
            .iter()
            .flat_map(|at| at.unwrap_or_default().map(|number| format!("{number:.6}")).into_iter().chain(["2".into()]));
        std::iter::once(ticks.to_string()).chain(joints).collect::<Vec<String>>()
    };
    let rows = [numbers(0), numbers(333_333)];
    let plain = rows.each_ref().map(|row| row.join(",")).join("\n");
    let semicolons = rows.each_ref().map(|row| row.join(";")).join("\n");
    let commas = semicolons.replace('.', ",");
    let expected = read(plain.as_bytes());
    assert_eq!((expected.format, expected.frames.len()), (Format::Kinect, 2));
    let headings = "time,spine_base_x,spine_base_y";
    for text in
        [format!("{headings}\n{plain}"), semicolons, commas.clone(), format!("\u{feff}\"Zeit\";\"x\"\r\n{commas};\r\n")]
    {
        assert_eq!(read(text.as_bytes()), expected, "{text:.60}");
    }
    let twice = refusal(&format!("{headings}\n{plain}\n{headings}"));
    assert!(twice.starts_with("line 4: \"time\" is no number"), "{twice}");
}

#[test]
fn a_recording_is_smoothed_as_its_frames_would_be_live() {
    let Some(bytes) = shared("kinect_Ges01_wavehand.csv") else { return };
    let recording = read(&bytes);
    for filter in [Filter::OneEuro(OneEuro::default()), Filter::Holt(Holt::default())] {
        let smooth = recording.filtered(&filter);
        let mut state = FilterState::default();
        let steps_s = std::iter::once(0.0).chain(recording.times_s.windows(2).map(|pair| pair[1] - pair[0]));
        let live = recording.frames.iter().zip(steps_s).map(|(frame, dt_s)| filter.apply(&mut state, frame, dt_s));
        assert_eq!(smooth.frames, live.collect::<Vec<Tracked>>());
        let jerks = |frames: &[Tracked]| {
            let hand = |i: usize| frames[i].pose.rotation(Bone::LeftUpperArm);
            (2..frames.len())
                .map(|i| (apart_deg(hand(i), hand(i - 1)) - apart_deg(hand(i - 1), hand(i - 2))).abs())
                .sum::<f64>()
        };
        let (before, after) = (jerks(&recording.frames), jerks(&smooth.frames));
        println!("{filter:?}: {before:.1}° of jerks become {after:.1}°");
        assert!(after < 0.7 * before);
    }
}

/// How far the feet point up in a pose, left before right, degrees.
fn feet_deg(pose: &Pose) -> [f64; 2] {
    let wearer = wearer();
    let posed = Posed::new(&wearer, pose);
    [Bone::LeftFoot, Bone::RightFoot].map(|foot| elevation_deg((posed.rotation(foot) * glam::Vec3::Z).as_dvec3()))
}

/// Kinects put the toes of someone who stands 15° below the ankle in one recording, 33° in another, and now and then into the floor.
#[test]
fn feet_that_stand_are_flat_and_those_on_tiptoe_are_not() {
    let wearer = wearer();
    let rest = motions::positions(Layout::Kinect25, &Posed::new(&wearer, &Pose::REST));
    for below_deg in [15.0_f64, 33.0] {
        let drop_m = 0.12 * libm::tan(below_deg.to_radians());
        let mut text = "{\"kitsuke_motion\":1,\"holds\":\"positions\",\"layout\":\"kinect25\"}\n".to_owned();
        for frame in 0..60 {
            let mut joints = rest.clone();
            // A third of the time the right toes are in the floor; at the end the wearer is on tiptoe.
            let sunk_m = if frame % 3 == 1 { 0.045 } else { 0.0 };
            let raised_m = if frame >= 50 { 0.06 } else { 0.0 };
            for at in joints.iter_mut().flatten() {
                at[1] += raised_m;
            }
            for (ankle, toes, sunk_m) in [(14, 15, 0.0), (18, 19, sunk_m)] {
                let [x, y, z] = joints[ankle].unwrap();
                joints[toes] = Some([x, y - raised_m - drop_m - sunk_m, z - 0.12]);
            }
            let joints: Vec<_> = joints.into_iter().map(|at| at.map(|[x, y, z]| [x, y, z, 1.0])).collect();
            text += &format!("{}\n", serde_json::json!({"t": f64::from(frame) / 30.0, "joints": joints}));
        }
        let frames = read(text.as_bytes()).frames;
        for (i, frame) in frames.iter().enumerate() {
            let feet_deg = feet_deg(&frame.pose);
            if i < 50 {
                assert!(feet_deg.iter().all(|up_deg| up_deg.abs() < 1.0), "{below_deg}°, frame {i}: {feet_deg:?}");
            } else {
                let down_deg = -feet_deg[0];
                let tilt_deg = libm::atan2(0.06 + drop_m, 0.12).to_degrees() - below_deg;
                assert!((down_deg - tilt_deg).abs() < 1.0, "{below_deg}°, frame {i}: {down_deg}°, not {tilt_deg}°");
            }
        }
    }
    for file in ["kinect_Ges01_wavehand.csv", "kinect_Ges02_balancinghands.csv"] {
        let Some(bytes) = shared(file) else { return };
        let feet = read(&bytes).frames.into_iter().flat_map(|frame| feet_deg(&frame.pose));
        let [low, high] = feet.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], up| [low.min(up), high.max(up)]);
        println!("{file}: feet {low:.1}° to {high:.1}°");
        assert!(low > -10.0 && high < 10.0, "{file}: feet of someone who stands point {low}° to {high}° up");
    }
}

/// The shared recordings, or nothing where they are absent.
fn shared(file: &str) -> Option<Vec<u8>> {
    let path = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../../shared/data/motions").join(file);
    let bytes = std::fs::read(&path).ok();
    if bytes.is_none() {
        println!("skipped: {} is absent", path.display());
    }
    bytes
}

fn elevation_deg(along: DVec3) -> f64 {
    libm::asin(along.y / along.length()).to_degrees()
}

/// Elevation of both upper and lower arms in a pose, left before right.
fn arms_deg(pose: &Pose) -> [f64; 4] {
    let wearer = wearer();
    let posed = Posed::new(&wearer, pose);
    let parts = [
        (Bone::LeftUpperArm, Bone::LeftLowerArm),
        (Bone::LeftLowerArm, Bone::LeftHand),
        (Bone::RightUpperArm, Bone::RightLowerArm),
        (Bone::RightLowerArm, Bone::RightHand),
    ];
    parts.map(|(from, to)| elevation_deg(posed.joint(to) - posed.joint(from)))
}

/// Elevations of both upper and lower arms per frame, as the file itself says; `None` where it does not or is in doubt.
type Elevations = Vec<[Option<f64>; 4]>;

#[test]
fn arms_of_real_recordings_are_raised_as_they_were() {
    type Plain = fn(&str) -> Elevations;
    let table: [(&str, Format, Plain); 6] = [
        ("kinect_Ges01_wavehand.csv", Format::Kinect, plain_kinect),
        ("kinect_Ges02_balancinghands.csv", Format::Kinect, plain_kinect),
        ("mediapipe_sports2d_demo.json", Format::MediaPipe, plain_mediapipe),
        ("humanoid3d_walk.txt", Format::DeepMimic, plain_deepmimic),
        ("humanoid3d_punch.txt", Format::DeepMimic, plain_deepmimic),
        ("humanoid3d_dance_a.txt", Format::DeepMimic, plain_deepmimic),
    ];
    for (file, format, plain) in table {
        let Some(bytes) = shared(file) else { return };
        let recording = read(&bytes);
        let expected = plain(std::str::from_utf8(&bytes).unwrap());
        assert_eq!((recording.format, recording.frames.len()), (format, expected.len()), "{file}");
        let mut ranges = [[f64::INFINITY, f64::NEG_INFINITY]; 4];
        for (i, (frame, expected)) in recording.frames.iter().zip(&expected).enumerate() {
            assert!(frame.pose.is_valid(), "{file}, frame {i}");
            for (part, (found, expected)) in arms_deg(&frame.pose).into_iter().zip(expected).enumerate() {
                ranges[part] = [ranges[part][0].min(found), ranges[part][1].max(found)];
                let Some(expected) = expected else { continue };
                assert!(
                    (found - expected).abs() < 0.1,
                    "{file}, frame {i}, part {part}: {found}° instead of {expected}°"
                );
            }
        }
        let [left, _, right, _] = ranges;
        let seconds = recording.times_s.last().unwrap();
        println!(
            "{file}: {} frames in {seconds:.2} s, upper arms left {:.1}° to {:.1}°, right {:.1}° to {:.1}°",
            recording.frames.len(),
            left[0],
            left[1],
            right[0],
            right[1]
        );
    }
}

fn plain_kinect(text: &str) -> Elevations {
    let elevations = |line: &str| {
        let numbers: Vec<f64> = line.split(',').filter_map(|word| word.trim().parse().ok()).collect();
        let joint = |i: usize| {
            let at = &numbers[1 + 4 * i..5 + 4 * i];
            (at[3] == 2.0).then(|| DVec3::new(at[0], at[1], at[2]))
        };
        [(4, 5), (5, 6), (8, 9), (9, 10)].map(|(from, to)| Some(elevation_deg(joint(to)? - joint(from)?)))
    };
    text.lines().filter(|line| !line.trim().is_empty()).map(elevations).collect()
}

fn plain_mediapipe(text: &str) -> Elevations {
    let file: serde_json::Value = serde_json::from_str(text).unwrap();
    let elevations = |frame: &serde_json::Value| {
        let joint = |i: usize| {
            let at: Vec<f64> = frame["worldLandmarks"][i].as_array()?.iter().filter_map(|n| n.as_f64()).collect();
            (at[3] >= 0.5).then(|| DVec3::new(at[0], -at[1], at[2]))
        };
        [(11, 13), (13, 15), (12, 14), (14, 16)].map(|(from, to)| Some(elevation_deg(joint(to)? - joint(from)?)))
    };
    file["frames"].as_array().unwrap().iter().map(elevations).collect()
}

/// Upper arms hang along -y of the shoulder; matrices from the quaternions' definition.
fn plain_deepmimic(text: &str) -> Elevations {
    let file: serde_json::Value = serde_json::from_str(text).unwrap();
    let matrix = |q: &[f64]| {
        let length = q.iter().map(|n| n * n).sum::<f64>().sqrt();
        let [w, x, y, z] = [q[0] / length, q[1] / length, q[2] / length, q[3] / length];
        DMat3::from_cols(
            DVec3::new(1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y + w * z), 2.0 * (x * z - w * y)),
            DVec3::new(2.0 * (x * y - w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z + w * x)),
            DVec3::new(2.0 * (x * z + w * y), 2.0 * (y * z - w * x), 1.0 - 2.0 * (x * x + y * y)),
        )
    };
    let elevations = |frame: &serde_json::Value| {
        let numbers: Vec<f64> = frame.as_array().unwrap().iter().filter_map(|n| n.as_f64()).collect();
        let chest = matrix(&numbers[4..8]) * matrix(&numbers[8..12]);
        let arm = |shoulder: usize| {
            let arm = chest * matrix(&numbers[shoulder..shoulder + 4]);
            let (s, c) = (libm::sin(numbers[shoulder + 4]), libm::cos(numbers[shoulder + 4]));
            [Some(elevation_deg(arm * DVec3::NEG_Y)), Some(elevation_deg(arm * DVec3::new(s, -c, 0.0)))]
        };
        let ([left_upper, left_lower], [right_upper, right_lower]) = (arm(39), arm(25));
        [left_upper, left_lower, right_upper, right_lower]
    };
    file["Frames"].as_array().unwrap().iter().map(elevations).collect()
}

#[test]
fn every_shared_recording_plays() {
    let folder = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../../shared/data/motions");
    let Ok(entries) = std::fs::read_dir(&folder) else {
        println!("skipped: {} is absent", folder.display());
        return;
    };
    for entry in entries {
        let path = entry.unwrap().path();
        let recording = recording::read(&std::fs::read(&path).unwrap(), &wearer());
        let recording = recording.unwrap_or_else(|error| panic!("{}: {error}", path.display()));
        assert!(recording.frames.iter().all(|frame| frame.pose.is_valid()), "{}", path.display());
        let arms = recording.frames.iter().map(|frame| arms_deg(&frame.pose));
        let mut ranges = [[f64::INFINITY, f64::NEG_INFINITY]; 4];
        for arm in arms {
            for (range, elevation) in ranges.iter_mut().zip(arm) {
                *range = [range[0].min(elevation), range[1].max(elevation)];
            }
        }
        println!(
            "{:<34} {:?} {} frames {:.2} s, left {:.1?}°, right {:.1?}°; {}",
            path.file_name().unwrap().to_string_lossy(),
            recording.format,
            recording.frames.len(),
            recording.times_s.last().unwrap(),
            ranges[0],
            ranges[2],
            recording.notes.join("; ")
        );
    }
}
