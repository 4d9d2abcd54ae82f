//! `cargo xtask drape-scene` as it is built: what it writes, how it ends, and that it goes on from where it was interrupted. Passed over, with a
//! message, where the command is not built.

use kitsuke_tests::doors::repository;
use std::fs;
use std::io::{BufRead, BufReader, Read};
use std::path::Path;
use std::process::{Command, Output, Stdio};

/// A small scene that comes to rest in a fraction of a second.
const SMALL: [&str; 5] = ["cantilever", "--cloth", "obi", "--parts", "4"];

/// The verb with its result in a folder; none where it is not built.
fn drape_scene(arguments: &[&str], out: &Path) -> Option<Command> {
    let xtask = repository().join("target/release/xtask");
    if !xtask.exists() {
        eprintln!("skipped: first run cargo build --release --package xtask");
        return None;
    }
    let mut command = Command::new(xtask);
    command.arg("drape-scene").args(arguments).arg("--out").arg(out).arg("--json").arg(out.join("figures.json"));
    Some(command)
}

fn figures(out: &Path) -> serde_json::Value {
    serde_json::from_slice(&fs::read(out.join("figures.json")).unwrap()).unwrap()
}

fn errors(output: &Output) -> String {
    String::from_utf8_lossy(&output.stderr).into_owned()
}

#[test]
fn a_scene_that_rests_writes_picture_shape_and_figures() {
    let folder = tempfile::tempdir().unwrap();
    let Some(mut command) = drape_scene(&SMALL, folder.path()) else { return };
    let output = command.output().unwrap();
    assert!(output.status.success(), "{}", errors(&output));
    let said = String::from_utf8_lossy(&output.stdout);
    assert!(said.contains("at rest, outside the body and clear of itself"), "{said}");
    let figures = figures(folder.path());
    assert_eq!(figures["certified"], true);
    assert!((figures["elastica_chord_deg"].as_f64().unwrap() - 41.5).abs() < 0.1, "{figures}");
    assert!(figures["above_lowest_before_mj"].is_number() && figures["bending_length_mm"].is_number());
    assert!(fs::read(folder.path().join("cantilever.png")).unwrap().starts_with(b"\x89PNG"));
    let shape = fs::read_to_string(folder.path().join("cantilever.obj")).unwrap();
    let count = |kind: &str| shape.lines().filter(|line| line.starts_with(kind)).count();
    assert_eq!((count("v "), count("f ")), (19 * 7, 2 * 18 * 6));
}

#[test]
fn a_scene_that_does_not_rest_says_what_moves() {
    let folder = tempfile::tempdir().unwrap();
    let Some(mut command) = drape_scene(&["twist", "--seconds", "0.05"], folder.path()) else { return };
    let output = command.output().unwrap();
    assert_eq!(output.status.code(), Some(1));
    let errors = errors(&output);
    assert!(errors.contains("does not come to certified rest in 0.05 s"), "{errors}");
    assert!(errors.contains("particle ") && errors.contains("mm/s, at most 1.000 is rest"), "{errors}");
    assert_eq!(figures(folder.path())["certified"], false);
    assert!(folder.path().join("twist.png").is_file(), "what does not rest is shown as well");
}

#[test]
fn what_is_no_scene_and_what_is_no_state_are_told() {
    let folder = tempfile::tempdir().unwrap();
    let Some(mut command) = drape_scene(&["curtain"], folder.path()) else { return };
    let output = command.output().unwrap();
    assert_eq!(output.status.code(), Some(2));
    let said = errors(&output);
    assert!(said.contains("invalid value 'curtain'") && said.contains("possible values: kimono, hanging"), "{said}");
    let of = "kitsuke drape-scene twist --cloth chirimen --parts 4\n";
    for (state, wanted) in [
        ("of another".to_owned(), "twist.state is no state of drape-scene; delete it"),
        (
            of.replace("chirimen", "obi"),
            "is of `twist --cloth obi --parts 4`, not of `twist --cloth chirimen --parts 4`",
        ),
        (format!("{of}short"), "has 5 bytes behind its first line"),
    ] {
        fs::write(folder.path().join("twist.state"), state).unwrap();
        let output = drape_scene(&["twist"], folder.path()).unwrap().output().unwrap();
        assert_eq!(output.status.code(), Some(1));
        assert!(errors(&output).contains(wanted), "{}", errors(&output));
    }
}

#[test]
#[cfg(unix)]
fn an_interrupted_scene_goes_on_with_the_same_bytes() {
    let [whole, parted] = [(); 2].map(|()| tempfile::tempdir().unwrap());
    let Some(mut command) = drape_scene(&SMALL, whole.path()) else { return };
    assert!(command.output().unwrap().status.success());
    let state = parted.path().join("cantilever.state");
    let mut command = drape_scene(&SMALL, parted.path()).unwrap();
    let mut first = command.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
    let mut said = BufReader::new(first.stdout.take().unwrap());
    said.read_line(&mut String::new()).unwrap();
    let interrupt = Command::new("sh").arg("-c").arg(format!("kill -INT {}", first.id())).status().unwrap();
    assert!(interrupt.success());
    said.read_to_string(&mut String::new()).unwrap();
    let output = first.wait_with_output().unwrap();
    assert!(output.status.code() == Some(1) && errors(&output).contains("interrupted"), "{}", errors(&output));
    assert!(state.is_file());
    let output = drape_scene(&SMALL, parted.path()).unwrap().output().unwrap();
    assert!(output.status.success() && String::from_utf8_lossy(&output.stdout).starts_with("goes on from"));
    assert!(!state.exists());
    let shape = |out: &Path| fs::read(out.join("cantilever.obj")).unwrap();
    assert!(shape(whole.path()) == shape(parted.path()));
}

#[test]
fn a_form_is_written_with_lines_that_may_be_corrected() {
    let folder = tempfile::tempdir().unwrap();
    let xtask = repository().join("target/release/xtask");
    if !xtask.exists() {
        eprintln!("skipped: first run cargo build --release --package xtask");
        return;
    }
    let body = repository().join("assets-src/bodies/b04.glb");
    let form = |more: &[&str]| {
        let mut command = Command::new(&xtask);
        command.arg("form").arg(&body).args(["--sections", "200", "--places", "96"]).args(more);
        command.arg("--out").arg(folder.path()).arg("--json").arg(folder.path().join("figures.json"));
        command.output().unwrap()
    };
    let output = form(&[]);
    assert!(output.status.success(), "{}", errors(&output));
    let found = figures(folder.path());
    let at = |key: &str| found[key].as_f64().unwrap();
    assert!(at("form_mean_mm") < 1.0 && at("form_max_mm") < 5.0, "{found}");
    assert!(at("hip_m") < at("waist_m") && at("waist_m") < at("bust_m") && at("waist_girth_m") < at("hip_girth_m"));
    assert!(folder.path().join("form.png").is_file() && folder.path().join("form.obj").is_file());
    let lines = folder.path().join("form.toml");
    let text = fs::read_to_string(&lines).unwrap();
    let lower = text.replacen("waist = \"", "waist = \"0", 1);
    fs::write(&lines, &lower).unwrap();
    assert!(form(&["--lines", lines.to_str().unwrap()]).status.success(), "what was written is read");
    for (wrong, wanted) in [
        ("waist = \"3 m\"\n", "the waist line at 3.000 m is not on the form"),
        ("wast = \"1 m\"\n", "wast"),
        ("waist = \"1 m\"\nhip = \"1.1 m\"\n", "must lie above one another"),
    ] {
        fs::write(&lines, wrong).unwrap();
        let output = form(&["--lines", lines.to_str().unwrap()]);
        assert!(output.status.code() == Some(1) && errors(&output).contains(wanted), "{}", errors(&output));
    }
}
