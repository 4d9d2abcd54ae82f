//! What ARCHITECTURE.md promises of the code itself, held against the sources. The numbers are those of its list; what
//! an invariant says of results is tested in the suites that are named beside it.

use kitsuke::skeleton::Bone;
use kitsuke_pipeline::catalog::{self, Mode, Options, Silent};
use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};

fn repository() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR")).parent().unwrap()
}

/// The Rust files of a folder, at any depth.
fn rust_files(folder: &str) -> Vec<PathBuf> {
    let mut files = Vec::new();
    let mut folders = vec![repository().join(folder)];
    while let Some(folder) = folders.pop() {
        for entry in fs::read_dir(folder).unwrap() {
            let path = entry.unwrap().path();
            if path.is_dir() {
                folders.push(path);
            } else if path.extension().is_some_and(|extension| extension == "rs") {
                files.push(path);
            }
        }
    }
    assert!(!files.is_empty(), "{folder} has no Rust files");
    files.sort();
    files
}

/// Where the code of the files, comments left out, has one of these words.
fn uses(files: &[PathBuf], words: &[&str]) -> Vec<String> {
    let mut found = Vec::new();
    for path in files {
        for (i, line) in fs::read_to_string(path).unwrap().lines().enumerate() {
            let code = line.split("//").next().unwrap();
            let mut of_line = code.split(|c: char| !c.is_alphanumeric() && c != '_');
            if of_line.any(|word| words.contains(&word)) {
                let file = path.strip_prefix(repository()).unwrap();
                found.push(format!("{}:{}: {}", file.display(), i + 1, line.trim()));
            }
        }
    }
    found
}

fn without(files: Vec<PathBuf>, folder: &str) -> Vec<PathBuf> {
    let folder = repository().join(folder);
    files.into_iter().filter(|file| !file.starts_with(&folder)).collect()
}

/// Invariant 1. That `evaluate` does not allocate is tested in `alloc/`, that it cannot fail in the suites `frame` and `pack`.
#[test]
fn the_runtime_opens_no_file_starts_no_thread_and_reads_no_clock() {
    let outside = ["fs", "File", "net", "process", "env", "io", "thread", "rayon", "Instant", "SystemTime"];
    let said = ["print", "println", "eprint", "eprintln", "dbg"];
    assert_eq!(uses(&rust_files("runtime/src"), &[&outside[..], &said[..]].concat()), [""; 0]);
    // The socket stands in a crate of its own, which waits but starts nothing.
    let in_live = ["fs", "File", "process", "env", "thread", "rayon", "SystemTime"];
    assert_eq!(uses(&rust_files("live/src"), &[&in_live[..], &said[..]].concat()), [""; 0]);
}

/// Invariant 2.
#[test]
fn only_source_derives_deserialize_and_reads_foreign_formats() {
    let words = ["Deserialize", "serde", "schemars", "csv", "gltf", "roxmltree"];
    let files = rust_files("pipeline/src");
    assert_eq!(uses(&without(files, "pipeline/src/source"), &words), [""; 0]);
}

/// Invariant 3.
#[test]
fn stages_touch_no_files_no_globals_and_no_terminal() {
    let files = [rust_files("pipeline/src/stages"), rust_files("pipeline/src/measure")].concat();
    let words =
        ["fs", "File", "env", "io", "print", "println", "eprintln", "static", "thread_local", "Mutex", "Instant"];
    let found = uses(&files, &words);
    let is_state = |line: &String| !line.contains("&'static ");
    assert_eq!(found.into_iter().filter(is_state).collect::<Vec<_>>(), [""; 0]);
}

/// The same of cloth, which an interactive app links without the pipeline: neither files nor formats.
#[test]
fn cloth_knows_no_files_no_formats_and_no_terminal() {
    let words =
        ["fs", "File", "env", "io", "print", "println", "eprintln", "static", "thread_local", "Mutex", "Instant"];
    let formats = ["serde", "Deserialize", "csv", "gltf", "kitsuke", "kitsuke_pipeline"];
    let found = uses(&rust_files("pipeline/drape/src"), &[&words[..], &formats[..]].concat());
    assert_eq!(found.into_iter().filter(|line| !line.contains("&'static ")).collect::<Vec<_>>(), [""; 0]);
}

/// A room stands on rooms before it in these lists and imports from no other.
#[test]
fn rooms_stand_on_the_floors_below_them() {
    let runtime: &[&[&str]] = &[
        &["skeleton", "measurement", "envelope_cholesky", "vertex_normals"],
        &["arrays", "tailoring", "sparse_cholesky"],
        &["plan", "pose_blend", "reach"],
        &["garment"],
        &["accessories", "evaluate", "fit"],
        &["pack"],
    ];
    let pipeline: &[&[&str]] = &[
        &["diagnostic", "ir", "light", "memo"],
        &["source", "look", "stages"],
        &["check", "export", "measure", "meshlab"],
        &["scans", "build", "draft"],
        &["load"],
        &["catalog"],
    ];
    let drape: &[&[&str]] = &[
        &["analytic_form", "cells", "depth_maps", "fabric", "forces", "parallel", "sheet", "slit"],
        &["cloth_contact", "parting", "patches", "room", "slices", "triangle_tree", "woven"],
        &["cut", "intersections", "links", "near_pairs", "pattern", "relax", "scissors", "tethers"],
        &["body", "contacts", "repair", "sew"],
        &["certificate", "form"],
        &["drape", "mapping", "outline"],
        &["rest", "springs"],
        &["hands", "skirt"],
        &["gestures", "skirt_by_forces"],
    ];
    let crates = [("runtime/src", runtime), ("pipeline/src", pipeline), ("pipeline/drape/src", drape)];
    for (folder, floors) in crates {
        let floor_of = |room: &str| floors.iter().position(|floor| floor.contains(&room));
        for path in rust_files(folder) {
            let place = path.strip_prefix(repository().join(folder)).unwrap();
            let room = place.iter().next().unwrap().to_str().unwrap().trim_end_matches(".rs");
            if room == "lib" {
                continue;
            }
            let floor = floor_of(room).unwrap_or_else(|| panic!("{folder}/{room} stands on no floor"));
            let text = fs::read_to_string(&path).unwrap();
            // Tests may climb.
            let text = text.split("#[cfg(test)]\nmod tests").next().unwrap();
            let code: String = text.lines().map(|line| line.split("//").next().unwrap()).collect::<Vec<_>>().join("\n");
            let named = code.split("crate::").skip(1).flat_map(|rest| match rest.strip_prefix('{') {
                Some(group) => group.split('}').next().unwrap().split(',').collect(),
                None => vec![rest],
            });
            for name in named {
                let name = name.trim().split(|c: char| !(c.is_alphanumeric() || c == '_')).next().unwrap();
                let is_below = name == room || floor_of(name).is_some_and(|other| other < floor);
                assert!(is_below, "{folder}/{} imports from {name}", place.display());
            }
        }
    }
}

/// Invariant 4. That frames are in metres is tested in the suite `look` against the artist's files.
#[test]
fn the_sample_stands_upright_in_metres_with_its_left_at_plus_x() {
    let garment = kitsuke_pipeline::load(&repository().join("assets-src/komon")).garment.expect("the sample is sound");
    let at = |bone| garment.body.skeleton.joints()[garment.body.skeleton.index_of(bone).unwrap()].rest_m;
    assert!((0.5..1.5).contains(&at(Bone::Hips).y), "{:?}", at(Bone::Hips));
    assert!(at(Bone::Head).y > at(Bone::Hips).y + 0.3);
    assert!(at(Bone::LeftUpperArm).x > 0.05 && at(Bone::RightUpperArm).x < -0.05);
    assert!(garment.drivers.iter().all(|driver| (0.0..=std::f32::consts::PI).contains(&driver.threshold_rad)));
}

/// Invariant 5. That packs of every version open is tested in the suite `pack`.
#[test]
fn section_tags_stand_in_the_layout_alone() {
    let layout = repository().join("runtime/src/pack/layout.rs");
    let text = fs::read_to_string(&layout).unwrap();
    let tags: Vec<String> = text.match_indices("Tag(*b\"").map(|(at, _)| text[at + 5..at + 12].to_owned()).collect();
    assert!(tags.len() >= 8 && tags.iter().all(|tag| tag.len() == 7 && tag.ends_with('"')), "{tags:?}");
    let mut files = [rust_files("runtime/src"), rust_files("pipeline/src"), rust_files("xtask/src")].concat();
    files.retain(|file| *file != layout);
    for file in files {
        let text = fs::read_to_string(&file).unwrap();
        assert!(tags.iter().all(|tag| !text.contains(tag.as_str())), "{} names a section by its bytes", file.display());
    }
}

/// Invariant 6. That bytes are the same on any threads in any folder is tested in the suite `build`; clippy forbids hash maps,
/// clocks and the sines of the standard library.
#[test]
fn nothing_that_feeds_a_pack_chooses_its_instructions_by_processor() {
    let words = ["is_x86_feature_detected", "target_feature", "mul_add", "HashMap", "HashSet", "RandomState"];
    let files = ["runtime/src", "pipeline/src", "pipeline/drape/src"].map(rust_files).concat();
    assert_eq!(uses(&files, &words), [""; 0]);
}

/// Invariant 8.
#[test]
fn unsafe_stands_at_the_c_border_and_in_the_counting_allocator_alone() {
    let border = repository().join("runtime/ffi");
    let mut folders = ["runtime", "live", "pipeline", "xtask"].map(rust_files).concat();
    folders.retain(|file| !file.starts_with(&border));
    // The keyword, not the word: compilers of other languages have options of this name.
    let keyword = ["{", "fn", "impl", "extern", "trait", "("]
        .map(|next| ["unsafe ", "unsafe"].map(|word| format!("{word}{next}")));
    for path in folders {
        let text = fs::read_to_string(&path).unwrap();
        let found = text.lines().find(|line| keyword.iter().flatten().any(|keyword| line.contains(keyword.as_str())));
        assert_eq!(found, None, "{}", path.display());
    }
    for manifest in ["Cargo.toml", "xtask/Cargo.toml"] {
        let text = fs::read_to_string(repository().join(manifest)).unwrap();
        assert!(text.contains("unsafe_code = \"forbid\""), "{manifest}");
    }
    for manifest in [
        "runtime/Cargo.toml",
        "runtime/wasm/Cargo.toml",
        "live/Cargo.toml",
        "pipeline/Cargo.toml",
        "pipeline/drape/Cargo.toml",
    ] {
        let text = fs::read_to_string(repository().join(manifest)).unwrap();
        assert!(text.contains("[lints]\nworkspace = true"), "{manifest}");
    }
}

/// Invariant 9.
#[test]
fn every_intermediate_can_be_written_out() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    let options = Options {
        assets: repository().join("tests/garments"),
        catalog: at("catalog"),
        cache: at("cache"),
        ids: vec!["tube".to_owned()],
        mode: Mode::Write,
        emit: Some(at("emitted")),
    };
    assert!(catalog::build(&options, &Silent).unwrap().is_complete());
    let entries = fs::read_dir(at("emitted/tube")).unwrap().map(|entry| entry.unwrap().file_name());
    let names: BTreeSet<String> = entries.map(|name| name.into_string().unwrap()).collect();
    for kind in ["skin_", "region_", "delta_", "unposed_"] {
        assert!(names.iter().any(|name| name.starts_with(kind)), "no {kind} among {names:?}");
    }
    let garment = kitsuke_pipeline::load(&repository().join("tests/garments/tube")).garment.unwrap();
    assert_eq!(names.iter().filter(|name| name.starts_with("region_")).count(), garment.drivers.len());
    assert_eq!(names.iter().filter(|name| name.starts_with("delta_")).count(), garment.targets.len());
}
