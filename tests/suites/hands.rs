//! `cargo xtask hands` as it is built, and its scenes: what they do, and that a recorded session does it again. Passed over, with a message, where the
//! command or a pack is not built.

use kitsuke_tests::doors::{self, Ended, repository};
use std::fs;
use std::io::{BufRead, BufReader, Read};
use std::path::Path;
use std::process::{Output, Stdio};

fn xtask(arguments: &[&str], out: &Path) -> Option<Output> {
    let mut command = doors::xtask()?;
    command.args(arguments).arg("--out").arg(out).arg("--json").arg(out.join("figures.json"));
    Some(command.output().unwrap())
}

fn said(output: &Output) -> String {
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    String::from_utf8_lossy(&output.stdout).into_owned()
}

fn figure(out: &Path, name: &str) -> f64 {
    let figures: serde_json::Value = serde_json::from_slice(&fs::read(out.join("figures.json")).unwrap()).unwrap();
    figures[name].as_f64().unwrap_or_else(|| panic!("{name} in {figures}"))
}

/// Plays the recorded session of a folder again: the same cloth, byte for byte.
fn assert_replays(out: &Path) {
    let again = tempfile::tempdir().unwrap();
    let session = out.join("session.toml");
    let output = xtask(&["hands", "--script", session.to_str().unwrap()], again.path()).unwrap();
    said(&output);
    for file in ["cloth.obj", "session.toml"] {
        assert!(fs::read(out.join(file)).unwrap() == fs::read(again.path().join(file)).unwrap(), "{file}");
    }
}

#[test]
fn a_scene_is_cut_in_pieces_and_its_session_does_it_again() {
    let out = tempfile::tempdir().unwrap();
    let Some(output) = xtask(&["drape-scene", "hands-cut"], out.path()) else { return };
    let said = said(&output);
    assert!(said.contains("right takes scissors") && !said.contains("in vain"), "{said}");
    // What was cut off below and at the side lies on the ground.
    assert_eq!(figure(out.path(), "pieces"), 3.0);
    assert!(figure(out.path(), "cut_mm") > 1800.0 && figure(out.path(), "strain_mean") < 0.03);
    assert_eq!((figure(out.path(), "self_pairs"), figure(out.path(), "inside")), (0.0, 0.0));
    assert!(fs::read(out.path().join("hands.png")).unwrap().starts_with(b"\x89PNG"));
    assert_replays(out.path());
}

#[test]
fn corners_are_moved_let_go_and_taken_again() {
    let out = tempfile::tempdir().unwrap();
    let Some(output) = xtask(&["drape-scene", "hands-move"], out.path()) else { return };
    let said = said(&output);
    assert!(
        said.matches("both move").count() == 2 && said.contains("left holds") && said.contains("right holds"),
        "{said}"
    );
    assert!(figure(out.path(), "strain_max") < 0.5 && figure(out.path(), "speed_max_m_per_s") < 3.0);
}

#[test]
fn a_kinect_moves_cloth_and_its_session_does_it_again() {
    let motion = repository().join("assets-src/motions/kinect_Ges02_balancinghands.csv");
    let motion = if motion.exists() {
        motion
    } else {
        repository().join("../shared/data/motions/kinect_Ges02_balancinghands.csv")
    };
    if !motion.exists() || !repository().join("catalog/packs").is_dir() {
        eprintln!("skipped: no recorded motion of a Kinect, or no pack (cargo xtask build-catalog)");
        return;
    }
    let out = tempfile::tempdir().unwrap();
    let arguments =
        ["hands", "--motion", motion.to_str().unwrap(), "--move", "--filter", "one-euro", "--particles", "22"];
    let Some(output) = xtask(&arguments, out.path()) else { return };
    assert!(said(&output).contains("both move"));
    assert!(figure(out.path(), "frames") > 250.0 && figure(out.path(), "strain_mean") < 0.03);
    assert_replays(out.path());
}

#[test]
fn a_live_wearer_moves_cloth_and_the_session_does_it_again() {
    let motion = repository().join("assets-src/motions/two_arms.bvh");
    let (Some(mut command), Some(mut replay)) = (doors::xtask(), doors::xtask()) else { return };
    if !repository().join("catalog/packs").is_dir() {
        eprintln!("skipped: no pack (cargo xtask build-catalog)");
        return;
    }
    let out = tempfile::tempdir().unwrap();
    command.args(["hands", "--vmc", "127.0.0.1:0", "--seconds", "4", "--move", "--particles", "12", "--filter"]);
    command.arg("one-euro").arg("--out").arg(out.path()).arg("--json").arg(out.path().join("figures.json"));
    command.stdout(Stdio::piped());
    let mut hands = Ended(command.spawn().unwrap());
    let mut said = BufReader::new(hands.0.stdout.take().unwrap());
    let mut line = String::new();
    said.read_line(&mut line).unwrap();
    let address = line.trim().strip_prefix("listens at ").unwrap_or_else(|| panic!("{line}"));
    replay.arg("replay").arg(&motion).args(["--vmc", address, "--times", "3"]);
    let sender = Ended(replay.stdout(Stdio::null()).stderr(Stdio::null()).spawn().unwrap());
    let mut rest = String::new();
    said.read_to_string(&mut rest).unwrap();
    assert!(hands.0.wait().unwrap().success(), "{rest}");
    drop(sender);
    assert!(rest.contains("both move"), "{rest}");
    assert!(figure(out.path(), "frames") > 60.0 && figure(out.path(), "strain_mean") < 0.05, "{rest}");
    assert_replays(out.path());
}

#[test]
fn mistakes_of_a_script_are_named_with_their_lines() {
    let out = tempfile::tempdir().unwrap();
    let script = out.path().join("wrong.toml");
    fs::write(&script, "[[moment]]\ntime_s = 1.0\ndo = [\"left punch\"]\n\n[[moment]]\ntime_s = 0.5\n").unwrap();
    let Some(output) = xtask(&["hands", "--script", script.to_str().unwrap()], out.path()) else { return };
    assert_eq!(output.status.code(), Some(1));
    let errors = String::from_utf8_lossy(&output.stderr);
    for wanted in ["wrong.toml:3", "left punch", "wrong.toml:6", "in the order of their times"] {
        assert!(errors.contains(wanted), "{wanted}: {errors}");
    }
}
