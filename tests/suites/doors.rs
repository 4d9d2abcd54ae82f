//! The doors beside Rust: the C header is that of the crate, and a C program gets the same bits. Compilers that a machine lacks are
//! named and their tests passed over.

use kitsuke_tests::doors::{example, ffi_library, frames, has, inputs, repository, run};
use std::fs;
use std::process::Command;

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

#[test]
fn the_example_in_c_runs() {
    if !has("cc") {
        return;
    }
    let (folder, ..) = inputs();
    let (source, program) = (folder.path().join("example.c"), folder.path().join("example"));
    fs::write(&source, example("runtime/ffi/README.md", "c")).unwrap();
    let mut cc = Command::new("cc");
    cc.args(["-std=c11", "-Wall", "-Wextra", "-Werror", "-pedantic", "-O1", "-pthread", "-I"]);
    cc.arg(repository().join("runtime/ffi/include")).arg(&source).arg(ffi_library()).args(["-ldl", "-lm", "-o"]);
    run(cc.arg(&program));
    insta::assert_snapshot!("c_example", run(Command::new(&program).current_dir(folder.path())));
}
