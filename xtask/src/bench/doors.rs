//! The same frames through every door: C, C#, WebAssembly in node and in Chromium, each a client of its own (`xtask/doors/`). Doors whose
//! compiler or program is not there are named and left out.

use crate::places::in_workspace;
use flate2::Compression;
use flate2::write::GzEncoder;
use kitsuke::skeleton::Pose;
use std::fs;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::Command;

/// What was measured: key and value, in order.
pub type Figures = Vec<(String, f64)>;

/// Plays these poses of a pack through every door.
///
/// # Errors
/// When a client cannot be built or fails.
pub fn measure(pack: &[u8], poses: &[Pose]) -> Result<Figures, String> {
    let folder = tempfile::tempdir().map_err(|error| error.to_string())?;
    let at = |name: &str| folder.path().join(name);
    let write =
        |path: PathBuf, bytes: &[u8]| fs::write(&path, bytes).map_err(|error| format!("{}: {error}", path.display()));
    write(at("garment.kitsuke"), pack)?;
    let floats = poses.iter().flat_map(|pose| {
        let rotations = pose.rotations.iter().flat_map(|rotation| rotation.to_array());
        rotations.chain(pose.hips_translation_m.to_array()).collect::<Vec<f32>>()
    });
    write(at("poses.f32"), &floats.flat_map(f32::to_le_bytes).collect::<Vec<u8>>())?;

    let mut figures = Figures::new();
    let mut add = |door: &str, said: &str| {
        for (key, value) in said.lines().filter_map(|line| line.split_once(' ')) {
            let place = key.len() - key.trim_start_matches("chromium_").len();
            let (browser, figure) = key.split_at(place);
            let value = value.parse().map_err(|_| format!("the client of {door} said `{said}`"))?;
            figures.push((format!("{browser}{door}_{figure}_median"), value));
        }
        Ok::<_, String>(())
    };
    let doors = in_workspace("xtask/doors");
    let library = library()?;
    if has("cc", "--version") {
        let mut cc = Command::new("cc");
        cc.args(["-std=c11", "-O2", "-I"]).arg(in_workspace("runtime/ffi/include")).arg(doors.join("frame.c"));
        said(cc.arg(library.join("libkitsuke_ffi.a")).args(["-lpthread", "-ldl", "-lm", "-o"]).arg(at("c")))?;
        add("ffi", &said(Command::new(at("c")).arg(folder.path()))?)?;
    }
    if has("mcs", "--version") && has("mono", "--version") {
        let mut mcs = Command::new("mcs");
        mcs.args(["-unsafe", "-optimize", "-r:System.Core.dll"]).arg(format!("-out:{}", at("frame.exe").display()));
        mcs.args(sources(&in_workspace("runtime/unity/Runtime/Bindings"))?).arg(doors.join("Frame.cs"));
        said(&mut mcs)?;
        let mut mono = Command::new("mono");
        mono.env("LD_LIBRARY_PATH", &library).arg(at("frame.exe")).arg(folder.path());
        add("csharp", &said(&mut mono)?)?;
    }
    let package = in_workspace("runtime/wasm/package");
    if has("node", "--version") {
        let mut node = Command::new("node");
        node.arg(doors.join("frame.mjs")).arg(folder.path()).arg(&package);
        add("wasm", &said(node.arg(absolute("target/web-test/node_modules")?))?)?;
    }
    for (key, module) in [("wasm_gzip_bytes", "kitsuke.wasm"), ("wasm_core_gzip_bytes", "kitsuke-core.wasm")] {
        figures.push((key.to_owned(), gzip_bytes(&[&package.join(module), &package.join("kitsuke.js")])? as f64));
    }
    Ok(figures)
}

/// Where the native library lies, built as it is shipped.
fn library() -> Result<PathBuf, String> {
    let mut cargo = Command::new(env!("CARGO"));
    cargo.current_dir(in_workspace(".")).args(["build", "--quiet", "--release", "--package", "kitsuke-ffi"]);
    said(&mut cargo)?;
    absolute("target/release")
}

fn absolute(path: &str) -> Result<PathBuf, String> {
    std::path::absolute(in_workspace(path)).map_err(|error| error.to_string())
}

fn has(program: &str, question: &str) -> bool {
    let found = Command::new(program).arg(question).output().is_ok_and(|output| output.status.success());
    if !found {
        eprintln!("note: there is no {program}, so its door is left out");
    }
    found
}

fn said(command: &mut Command) -> Result<String, String> {
    let output = command.output().map_err(|error| format!("{command:?}: {error}"))?;
    match output.status.success() {
        true => Ok(String::from_utf8_lossy(&output.stdout).into_owned()),
        false => Err(format!("{command:?}: {}", String::from_utf8_lossy(&output.stderr))),
    }
}

fn sources(folder: &Path) -> Result<Vec<PathBuf>, String> {
    let files = fs::read_dir(folder).map_err(|error| format!("cannot read {}: {error}", folder.display()))?;
    let mut files: Vec<PathBuf> = files.flatten().map(|file| file.path()).collect();
    files.retain(|file| file.extension().is_some_and(|extension| extension == "cs"));
    files.sort();
    Ok(files)
}

/// What these files are together when a server sends them, each by itself.
fn gzip_bytes(files: &[&Path]) -> Result<usize, String> {
    let sizes = files.iter().map(|file| {
        let bytes = fs::read(file).map_err(|error| format!("cannot read {}: {error}", file.display()))?;
        let mut encoder = GzEncoder::new(Vec::new(), Compression::best());
        encoder
            .write_all(&bytes)
            .and_then(|()| encoder.finish())
            .map(|zipped| zipped.len())
            .map_err(|error| error.to_string())
    });
    sizes.sum()
}
