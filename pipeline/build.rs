//! A hash over everything that a stage's result depends on beside its inputs: the sources of the stages, of the run time that they
//! use, and the versions of the libraries. So the memo forgets by itself when code changes.

use std::path::{Path, PathBuf};

/// Relative to this crate.
const SOURCES: [&str; 9] = [
    "src/meshlab",
    "src/scans.rs",
    "src/build.rs",
    "src/ir.rs",
    "src/light.rs",
    "src/measure",
    "src/stages",
    "../runtime/src",
    "../Cargo.lock",
];

fn main() {
    let mut files = Vec::new();
    for source in SOURCES {
        println!("cargo::rerun-if-changed={source}");
        collect(Path::new(source), &mut files);
    }
    files.sort();
    let mut hasher = blake3::Hasher::new();
    for file in files {
        let bytes = std::fs::read(&file).unwrap_or_else(|error| panic!("cannot read {}: {error}", file.display()));
        hasher.update(file.to_string_lossy().as_bytes());
        hasher.update(&(bytes.len() as u64).to_le_bytes());
        hasher.update(&bytes);
    }
    println!("cargo::rustc-env=KITSUKE_STAGES={}", hasher.finalize().to_hex());
}

fn collect(path: &Path, files: &mut Vec<PathBuf>) {
    match std::fs::read_dir(path) {
        Ok(folder) => folder.flatten().for_each(|entry| collect(&entry.path(), files)),
        Err(_) => files.push(path.to_owned()),
    }
}
