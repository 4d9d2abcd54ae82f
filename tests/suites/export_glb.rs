//! Kimono as GLB: what plays the file, ours and others', shows what the runtime shows.

use glam::{DVec3, Vec3};
use kitsuke::skeleton::Pose;
use kitsuke::{Accessories, Frame, Garment, Pack, Rates, Scratch, evaluate, evaluate_with_rates};
use kitsuke_pipeline::export::{Clip, ExportError, Exported, Settings, glb};
use kitsuke_pipeline::source::import;
use kitsuke_tests::doors::{has, repository, xtask};
use kitsuke_tests::player::Player;
use kitsuke_tests::{motions, random, small_accessories, small_garment};
use serde_json::json;
use std::fs;
use std::path::PathBuf;
use std::process::Command;

const PLAIN: Settings = Settings { is_quantised: false, is_compressed: false, most_morphs: None };
const QUANTISED: Settings = Settings { is_quantised: true, ..PLAIN };
const COMPRESSED: Settings = Settings { is_compressed: true, ..PLAIN };

fn clip(seed: u64, frames: usize) -> Clip {
    let mut numbers = random::Numbers(seed);
    let poses = (0..frames).map(|_| numbers.pose()).collect();
    Clip { name: "motion".into(), times_s: (0..frames).map(|frame| frame as f32 / 30.0).collect(), poses }
}

fn posed_m(garment: &Garment, pose: &Pose) -> Vec<Vec3> {
    let mut positions_m = vec![Vec3::NAN; garment.vertex_count()];
    evaluate(garment, pose, &mut Scratch::new(garment), Frame { positions_m: &mut positions_m, normals: &mut [] });
    positions_m
}

/// A sample's shape in the T-pose.
fn sample_m(garment: &Garment, target: usize) -> Vec<Vec3> {
    let mut positions_m = vec![Vec3::NAN; garment.vertex_count()];
    let mut rates = Rates::new(garment.data());
    (0..garment.data().drivers.len()).for_each(|driver| rates.set(driver, target, 1.0));
    let frame = Frame { positions_m: &mut positions_m, normals: &mut [] };
    evaluate_with_rates(garment, &Pose::REST, &rates, &mut Scratch::new(garment), frame);
    positions_m
}

fn farthest_m(found_m: &[DVec3], wanted_m: &[Vec3]) -> f64 {
    assert_eq!(found_m.len(), wanted_m.len());
    found_m.iter().zip(wanted_m).map(|(found, wanted)| found.distance(wanted.as_dvec3())).fold(0.0, f64::max)
}

/// How far a file of so many morph targets may lie from the runtime: its grid, and single precision.
fn allowed_m(exported: &Exported) -> f64 {
    2e-5 + f64::from(exported.step_m) * (1 + exported.morphs.len()) as f64
}

#[test]
fn every_morph_target_is_its_sample_in_the_t_pose() {
    for garment in [small_garment(), random::garment(3), random::garment(8)] {
        for settings in [PLAIN, QUANTISED] {
            let exported = glb(&garment, &small_accessories(), None, settings).unwrap();
            let player = Player::open(&exported.glb);
            let data = garment.data();
            let names = player.json["meshes"][0]["extras"]["targetNames"].as_array().map_or(0, Vec::len);
            assert_eq!((exported.morphs.len(), names), (data.sample_count(), data.sample_count()));
            let allowed_m = allowed_m(&exported);
            assert!(farthest_m(&player.positions_m(0, None, None), &posed_m(&garment, &Pose::REST)) < 1.0, "it stands");
            for target in 0..data.sample_count() {
                let weights: Vec<f64> =
                    (0..data.sample_count()).map(|other| f64::from(u8::from(other == target))).collect();
                let found_m = player.positions_m(0, None, Some(&weights));
                let apart_m = farthest_m(&found_m, &sample_m(&garment, target));
                assert!(
                    apart_m < allowed_m,
                    "{settings:?} {}: {apart_m} m, {allowed_m} allowed",
                    exported.morphs[target]
                );
            }
        }
    }
}

#[test]
fn a_motion_plays_as_the_runtime_poses() {
    for (seed, garment) in
        [(1, small_garment()), (2, random::garment(3)), (3, random::garment(5)), (4, random::garment(8))]
    {
        let clip = clip(seed, 12);
        for settings in [PLAIN, QUANTISED] {
            let exported = glb(&garment, &Accessories::default(), Some(&clip), settings).unwrap();
            let player = Player::open(&exported.glb);
            for (frame, pose) in clip.poses.iter().enumerate() {
                let apart_m = farthest_m(&player.positions_m(0, Some(frame), None), &posed_m(&garment, pose));
                let allowed_m = allowed_m(&exported);
                assert!(
                    apart_m < allowed_m,
                    "garment {seed}, {settings:?}, frame {frame}: {apart_m} m, {allowed_m} allowed"
                );
            }
            let at_rest_m = player.positions_m(0, None, None);
            let mut base_m = garment.data().mesh.positions_m.clone();
            base_m.extend(garment.data().mesh.twin_of.iter().map(|&v| garment.data().mesh.positions_m[v as usize]));
            assert!(farthest_m(&at_rest_m, &base_m) < allowed_m(&exported), "without motion it is the base");
            let channels = &player.json["animations"][0]["channels"];
            let of_weights = |channel: &&serde_json::Value| channel["target"]["path"] == "weights";
            if let Some(channel) = channels.as_array().unwrap().iter().find(of_weights) {
                let sampler = &player.json["animations"][0]["samplers"][channel["sampler"].as_u64().unwrap() as usize];
                let weights = player.rows(&sampler["output"]).concat();
                assert!(weights.iter().all(|weight| (0.0..=1.0).contains(weight)), "programs clamp others");
            }
        }
    }
}

#[test]
fn few_morph_targets_err_as_much_as_is_said() {
    let (garment, clip) = (small_garment(), clip(9, 20));
    let all = glb(&garment, &Accessories::default(), Some(&clip), PLAIN).unwrap();
    let few = Settings { most_morphs: Some(all.morphs.len() / 2), ..PLAIN };
    let few = glb(&garment, &Accessories::default(), Some(&clip), few).unwrap();
    assert_eq!(few.morphs.len(), all.morphs.len() / 2);
    let (mean_m, most_m) = few.condensed_m.expect("there were more");
    assert!(all.condensed_m.is_none() && most_m >= mean_m && most_m > 0.0);
    let player = Player::open(&few.glb);
    for (frame, pose) in clip.poses.iter().enumerate() {
        let apart_m = farthest_m(&player.positions_m(0, Some(frame), None), &posed_m(&garment, pose));
        assert!(apart_m <= most_m + 2e-5, "{apart_m} {:?}", few.condensed_m);
    }
}

/// Two frames as DeepMimic has them: arms raised in the first, and the second so many seconds later.
fn deep_mimic(seconds: f64) -> String {
    let turned = |radians: f64| [libm::cos(radians / 2.0), 0.0, 0.0, libm::sin(radians / 2.0)];
    let frame = |raised: f64| {
        let mut row = vec![seconds, 0.0, 0.9, 0.0, 1.0, 0.0, 0.0, 0.0];
        // Chest and neck; right hip, knee, ankle; right shoulder, elbow; the same on the left.
        let joints = [[1.0, 0.0, 0.0, 0.0]; 2].into_iter().map(|turn| turn.to_vec());
        row.extend(joints.flatten());
        for shoulder in [raised; 2] {
            row.extend([1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0]);
            row.extend(turned(shoulder));
            row.push(0.0);
        }
        row
    };
    json!({ "Loop": "none", "Frames": [frame(2.5), frame(0.0)] }).to_string()
}

#[test]
fn too_many_frames_are_refused_and_joints_held_back_are_noted() {
    let folder = tempfile::tempdir().unwrap();
    let (motion, out) = (folder.path().join("motion.txt"), folder.path().join("motion.glb"));
    let export = |seconds: f64, more: &[&str]| {
        fs::write(&motion, deep_mimic(seconds)).unwrap();
        let mut command = xtask()?;
        command.args(["export", "tests/packs/v5_2.kitsuke", "--motion"]).arg(&motion).arg("--glb").arg(&out).args(more);
        let output = command.output().unwrap();
        Some((output.status.success(), String::from_utf8_lossy(&output.stderr).into_owned()))
    };
    let Some((is_written, said)) = export(0.5, &[]) else { return };
    assert!(is_written && said.contains("the kimono holds joints back by up to"), "{said}");
    let (is_written, said) = export(0.5, &["--as-recorded"]).unwrap();
    assert!(is_written && !said.contains("holds joints back"), "{said}");
    fs::remove_file(&out).unwrap();
    let (is_written, said) = export(900.0, &["--fps", "240"]).unwrap();
    assert!(!is_written && said.contains("no more than 108000 are written"), "{said}");
    assert!(!out.exists(), "nothing is written");
}

#[test]
fn motions_that_are_none_are_refused() {
    let garment = small_garment();
    for (times_s, frames) in [(vec![], 0), (vec![0.0, 0.0], 2), (vec![0.1, 0.2], 2), (vec![0.0], 2)] {
        let clip = Clip { times_s, ..clip(1, frames) };
        assert_eq!(glb(&garment, &Accessories::default(), Some(&clip), PLAIN), Err(ExportError::Motion));
    }
}

#[test]
fn our_own_importer_reads_the_base_back() {
    let garment = small_garment();
    for (settings, name) in [(PLAIN, "plain.glb"), (QUANTISED, "quantised.glb")] {
        let exported = glb(&garment, &Accessories::default(), None, settings).unwrap();
        let mut report = Vec::new();
        let mesh = import::read_bytes(name, &exported.glb, None, &mut report).unwrap_or_else(|| panic!("{report:?}"));
        assert_eq!(mesh.triangles.len(), garment.triangle_count());
        let base_m = &garment.data().mesh.positions_m;
        for (corners, wanted) in mesh.triangles.iter().zip(&garment.data().mesh.triangles) {
            for (&found, &wanted) in corners.iter().zip(wanted) {
                let apart_m = mesh.positions[found as usize]
                    .distance(base_m[garment.data().mesh.unique(wanted) as usize].as_dvec3());
                assert!(apart_m < allowed_m(&exported), "{name}: {apart_m} m");
            }
        }
        assert_eq!(mesh.uv.is_empty(), garment.data().mesh.uv.is_empty());
    }
}

#[test]
fn the_same_kimono_is_the_same_bytes() {
    let (garment, clip) = (small_garment(), clip(4, 10));
    for settings in [PLAIN, COMPRESSED, Settings { most_morphs: Some(2), ..COMPRESSED }] {
        let one = glb(&garment, &small_accessories(), Some(&clip), settings).unwrap();
        assert!(one.glb == glb(&garment, &small_accessories(), Some(&clip), settings).unwrap().glb, "{settings:?}");
    }
}

/// The folder of npm's pinned packages, fetched once; `None`, with a message, where there is no node or no network.
fn packages() -> Option<PathBuf> {
    let folder = repository().join("target/node");
    let wanted = ["gltf-validator@2.0.0-dev.3.10", "three@0.187.0"];
    if !has("node") || !has("npm") {
        eprintln!("skipped: there is no node with npm");
        return None;
    }
    let mark = folder.join("fetched");
    if fs::read_to_string(&mark).ok().as_deref() != Some(&wanted.join(" ")) {
        fs::create_dir_all(&folder).unwrap();
        let mut npm = Command::new("npm");
        npm.args(["install", "--no-audit", "--no-fund", "--silent", "--prefix"]).arg(&folder).args(wanted);
        if !npm.status().is_ok_and(|status| status.success()) {
            eprintln!("skipped: npm cannot fetch {}", wanted.join(" and "));
            return None;
        }
        fs::write(mark, wanted.join(" ")).unwrap();
    }
    Some(folder.join("node_modules"))
}

fn node(script: &str, arguments: &[&str]) -> String {
    let output =
        Command::new("node").arg(repository().join("tests/doors").join(script)).args(arguments).output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    String::from_utf8(output.stdout).unwrap()
}

/// Garments to show other programs: a small one, and the sample where its pack is built.
fn shown() -> Vec<(Garment, Accessories, Clip)> {
    // The image of the small ones is only the beginning of one.
    let small = Accessories { texture: None, ..small_accessories() };
    let mut shown =
        vec![(small_garment(), small, clip(6, 8)), (random::garment(8), Accessories::default(), clip(7, 8))];
    match fs::read(repository().join("catalog/packs/komon.kitsuke")) {
        Ok(bytes) => {
            let pack = Pack::open(&bytes).unwrap();
            let poses: Vec<Pose> =
                motions::dance().iter().step_by(40).map(|pose| pack.garment().limited(pose).pose).collect();
            let times_s = (0..poses.len()).map(|frame| frame as f32 / 2.0).collect();
            shown.push((
                pack.garment().clone(),
                pack.accessories().clone(),
                Clip { name: "dance".into(), times_s, poses },
            ));
        }
        Err(_) => eprintln!("skipped: the pack of komon is not built (cargo xtask build-catalog)"),
    }
    shown
}

#[test]
fn the_validator_of_khronos_has_nothing_to_say() {
    let Some(packages) = packages() else { return };
    let folder = tempfile::tempdir().unwrap();
    let mut files = Vec::new();
    for (number, (garment, accessories, clip)) in shown().iter().enumerate() {
        for (kind, settings) in [("plain", PLAIN), ("quantised", QUANTISED), ("compressed", COMPRESSED)] {
            for clip in [None, Some(clip)] {
                let path = folder.path().join(format!("{number}_{kind}_{}.glb", clip.is_some()));
                fs::write(&path, glb(garment, accessories, clip, settings).unwrap().glb).unwrap();
                files.push(path);
            }
        }
    }
    let mut arguments = vec![packages.to_str().unwrap()];
    arguments.extend(files.iter().map(|path| path.to_str().unwrap()));
    let said = node("validate.mjs", &arguments);
    assert_eq!(said.lines().count(), files.len());
    for (line, path) in said.lines().zip(&files) {
        // Infos only: a small kimono without image has texture coordinates for nothing, and meshopt is an extension that the validator passes over.
        let report: serde_json::Value = serde_json::from_str(line).unwrap();
        assert_eq!(
            (&report["numErrors"], &report["numWarnings"]),
            (&json!(0), &json!(0)),
            "{}: {report}",
            path.display()
        );
    }
}

#[test]
fn three_shows_what_the_runtime_shows() {
    let Some(packages) = packages() else { return };
    let folder = tempfile::tempdir().unwrap();
    for (garment, accessories, clip) in &shown() {
        for settings in [PLAIN, QUANTISED, COMPRESSED] {
            let (file, out) = (folder.path().join("kimono.glb"), folder.path().join("positions.f32"));
            let exported = glb(garment, accessories, Some(clip), settings).unwrap();
            fs::write(&file, &exported.glb).unwrap();
            let times: Vec<String> = clip.times_s.iter().map(f32::to_string).collect();
            let mut arguments = vec![packages.to_str().unwrap(), file.to_str().unwrap(), out.to_str().unwrap()];
            arguments.extend(times.iter().map(String::as_str));
            node("three.mjs", &arguments);
            let bytes = fs::read(&out).unwrap();
            let numbers: Vec<f32> = bytes.as_chunks::<4>().0.iter().map(|&number| f32::from_le_bytes(number)).collect();
            let frames: Vec<&[f32]> = numbers.chunks_exact(3 * garment.vertex_count()).collect();
            assert_eq!(frames.len(), clip.poses.len());
            for (frame, pose) in frames.iter().zip(&clip.poses) {
                let found_m: Vec<DVec3> =
                    frame.as_chunks::<3>().0.iter().map(|p| Vec3::from_array(*p).as_dvec3()).collect();
                let apart_m = farthest_m(&found_m, &posed_m(garment, pose));
                assert!(apart_m < allowed_m(&exported) + 2e-5, "{}: {settings:?}: {apart_m} m", garment.data().id);
            }
        }
    }
}
