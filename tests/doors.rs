//! What the tests of all doors need: a pack and poses for clients, what Rust makes of them, compilers and the native library.

use crate::{random, small_accessories, small_fit, small_garment};
use glam::Vec3;
use kitsuke::pack::write::write_with;
use kitsuke::skeleton::Pose;
use kitsuke::{Frame, Pack, Scratch, evaluate};
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Child, Command};

/// The root of the work tree.
#[must_use]
pub fn repository() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR")).parent().expect("tests/ is in the repository")
}

/// The verbs as they are built, in the work tree; none with a message where they are not.
#[must_use]
pub fn xtask() -> Option<Command> {
    let path = repository().join("target/release/xtask");
    if !path.exists() {
        eprintln!("skipped: first run cargo build --release --package xtask");
        return None;
    }
    let mut command = Command::new(path);
    command.current_dir(repository());
    Some(command)
}

/// A child that ends with its test, also where that fails.
pub struct Ended(pub Child);

impl Drop for Ended {
    fn drop(&mut self) {
        // It may have ended already.
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

/// Poses that the clients read: 223 floats each, rotations by bone, then the hips.
fn poses(count: usize) -> Vec<Pose> {
    let mut numbers = random::Numbers(20);
    (0..count).map(|_| numbers.pose()).collect()
}

fn as_floats(poses: &[Pose]) -> Vec<u8> {
    let floats = poses.iter().flat_map(|pose| {
        let rotations = pose.rotations.iter().flat_map(|rotation| rotation.to_array());
        rotations.chain(pose.hips_translation_m.to_array()).collect::<Vec<f32>>()
    });
    floats.flat_map(f32::to_le_bytes).collect()
}

/// What Rust makes of these poses: positions, then normals, frame after frame.
///
/// # Panics
/// When the pack does not open.
#[must_use]
pub fn frames(pack: &[u8], poses: &[Pose]) -> Vec<u8> {
    let pack = Pack::open(pack).unwrap();
    let garment = pack.garment();
    let mut scratch = Scratch::new(garment);
    let [mut positions_m, mut normals] = [(); 2].map(|()| vec![Vec3::ZERO; garment.vertex_count()]);
    let mut bytes = Vec::new();
    for pose in poses {
        evaluate(garment, pose, &mut scratch, Frame { positions_m: &mut positions_m, normals: &mut normals });
        let vectors = positions_m.iter().chain(&normals);
        bytes.extend(vectors.flat_map(|vector| vector.to_array()).flat_map(f32::to_le_bytes));
    }
    bytes
}

/// A folder with a pack, poses and a motion, for clients; the pack and the poses.
///
/// # Panics
/// When they cannot be written.
#[must_use]
pub fn inputs() -> (tempfile::TempDir, Vec<u8>, Vec<Pose>) {
    let folder = tempfile::tempdir().unwrap();
    let pack = write_with(&small_garment(), &small_accessories(), Some(&small_fit())).unwrap();
    let poses = poses(200);
    fs::write(folder.path().join("garment.kitsuke"), &pack).unwrap();
    fs::write(folder.path().join("poses.f32"), as_floats(&poses)).unwrap();
    fs::copy(repository().join("assets-src/motions/two_arms.bvh"), folder.path().join("motion.bvh")).unwrap();
    (folder, pack, poses)
}

/// Where cargo puts the libraries of this build.
fn libraries() -> PathBuf {
    // target/PROFILE/deps/suites-HASH
    std::env::current_exe().unwrap().parent().unwrap().parent().unwrap().to_owned()
}

/// Whether a program is there; says so where it is not.
#[must_use]
pub fn has(program: &str) -> bool {
    let found = Command::new(program).arg("--version").output().is_ok_and(|output| output.status.success());
    if !found {
        eprintln!("skipped: there is no {program}");
    }
    found
}

/// What a program prints.
///
/// # Panics
/// When it fails.
pub fn run(command: &mut Command) -> String {
    let output = command.output().unwrap();
    let said = format!("{}{}", String::from_utf8_lossy(&output.stdout), String::from_utf8_lossy(&output.stderr));
    assert!(output.status.success(), "{command:?}: {said}");
    said
}

/// Builds the library for C in the profile of this build, and nothing else of the workspace. The static one's file; the dynamic one lies
/// beside it.
///
/// # Panics
/// When cargo fails.
#[must_use]
pub fn ffi_library() -> PathBuf {
    let folder = libraries();
    // Two profiles share a folder (Cargo.toml).
    let profile = match (folder.file_name().unwrap().to_str().unwrap(), cfg!(debug_assertions)) {
        ("debug", _) => "dev",
        ("release", true) => "bench",
        (other, _) => other,
    };
    let mut cargo = Command::new(env!("CARGO"));
    cargo.current_dir(repository()).args(["build", "--quiet", "-p", "kitsuke-ffi", "--lib", "--profile", profile]);
    run(cargo.arg("--target-dir").arg(folder.parent().unwrap()));
    folder.join("libkitsuke_ffi.a")
}

/// The first example of a page in this language, which must be short.
///
/// # Panics
/// When there is none.
#[must_use]
pub fn example(page: &str, language: &str) -> String {
    let text = fs::read_to_string(repository().join(page)).unwrap();
    let (_, rest) = text.split_once(&format!("```{language}\n")).expect("an example");
    let (example, _) = rest.split_once("```").expect("its end");
    assert!(example.lines().count() < 30, "{page}: longer than 30 lines");
    example.to_owned()
}
