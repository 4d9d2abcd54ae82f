//! The doors beside Rust: the C header is that of the crate, and a C program gets the same bits. Compilers that a machine lacks are
//! named and their tests passed over.

use glam::Vec3;
use kitsuke::pack::write::write_with;
use kitsuke::{Frame, Pack, Scratch, evaluate};
use kitsuke_tests::{random, small_accessories, small_fit, small_garment};
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

fn repository() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR")).parent().unwrap()
}

/// `runtime/ffi/include/kitsuke.h` is written anew with `INSTA_UPDATE=always`, as snapshots are.
#[test]
fn the_header_is_that_of_the_crate() {
    let folder = repository().join("runtime/ffi");
    let config = cbindgen::Config::from_file(folder.join("cbindgen.toml")).unwrap();
    let bindings = cbindgen::Builder::new().with_crate(&folder).with_config(config).generate().unwrap();
    let mut header = Vec::new();
    bindings.write(&mut header);
    let header = String::from_utf8(header).unwrap();
    let file = folder.join("include/kitsuke.h");
    if std::env::var("INSTA_UPDATE").is_ok_and(|update| update == "always") {
        fs::write(&file, &header).unwrap();
    }
    let committed = fs::read_to_string(&file).unwrap_or_default();
    assert!(committed == header, "{} is not that of the crate: run with INSTA_UPDATE=always", file.display());
}

/// Poses that the clients read: 223 floats each, rotations by bone, then the hips.
fn poses(count: usize) -> Vec<kitsuke::skeleton::Pose> {
    let mut numbers = random::Numbers(20);
    (0..count).map(|_| numbers.pose()).collect()
}

fn as_floats(poses: &[kitsuke::skeleton::Pose]) -> Vec<u8> {
    let floats = poses.iter().flat_map(|pose| {
        let rotations = pose.rotations.iter().flat_map(|rotation| rotation.to_array());
        rotations.chain(pose.hips_translation_m.to_array()).collect::<Vec<f32>>()
    });
    floats.flat_map(f32::to_le_bytes).collect()
}

/// What Rust makes of these poses: positions, then normals, frame after frame.
fn frames(pack: &[u8], poses: &[kitsuke::skeleton::Pose]) -> Vec<u8> {
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

/// A folder with a pack and poses, for clients.
fn inputs() -> (tempfile::TempDir, Vec<u8>, Vec<kitsuke::skeleton::Pose>) {
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

fn has(program: &str) -> bool {
    let found = Command::new(program).arg("--version").output().is_ok_and(|output| output.status.success());
    if !found {
        eprintln!("skipped: there is no {program}");
    }
    found
}

fn run(command: &mut Command) -> String {
    let output = command.output().unwrap();
    let said = format!("{}{}", String::from_utf8_lossy(&output.stdout), String::from_utf8_lossy(&output.stderr));
    assert!(output.status.success(), "{command:?}: {said}");
    said
}

/// Builds the library for C, in the profile of this build and with the features that the whole workspace has, so that little is compiled
/// anew.
fn ffi_library() -> PathBuf {
    let folder = libraries();
    let profile = folder.file_name().unwrap().to_str().unwrap();
    let profile = if profile == "debug" { "dev" } else { profile };
    let mut cargo = Command::new(env!("CARGO"));
    cargo.current_dir(repository()).args(["build", "--quiet", "--workspace", "--lib", "--profile", profile]);
    run(cargo.arg("--target-dir").arg(folder.parent().unwrap()));
    folder.join("libkitsuke_ffi.a")
}

#[test]
fn a_c_program_gets_the_same_bits() {
    if !has("cc") {
        return;
    }
    let (folder, pack, poses) = inputs();
    let library = ffi_library();
    let compiled = |name: &str, flags: &[&str]| {
        let client = folder.path().join(name);
        let mut cc = Command::new("cc");
        cc.args(["-std=c11", "-Wall", "-Wextra", "-Werror", "-pedantic", "-O1", "-g", "-pthread"])
            .args(flags)
            .arg("-I");
        cc.arg(repository().join("runtime/ffi/include")).arg(repository().join("tests/doors/client.c"));
        run(cc.arg(&library).args(["-ldl", "-lm", "-o"]).arg(&client));
        client
    };
    let client = compiled("client", &[]);
    let said = run(Command::new(&client).arg(folder.path()));
    assert!(fs::read(folder.path().join("frames.f32")).unwrap() == frames(&pack, &poses), "other bits than Rust's");
    insta::assert_snapshot!("c_client", said);
    run(Command::new(compiled("watched", &["-fsanitize=address,undefined", "-fno-sanitize-recover"]))
        .arg(folder.path()));
    if has("valgrind") {
        let mut valgrind = Command::new("valgrind");
        valgrind.args(["--quiet", "--error-exitcode=9", "--leak-check=full", "--errors-for-leak-kinds=definite"]);
        run(valgrind.arg(&client).arg(folder.path()));
    }
}
