//! The door for the web: the committed modules do in node what Rust does, to the bit. Where they no longer do, `cargo xtask wasm` builds them
//! anew.

use kitsuke_tests::doors::{example, frames, has, inputs, repository, run};
use std::fs;
use std::process::Command;

#[test]
fn node_gets_the_same_bits() {
    if !has("node") {
        return;
    }
    let (folder, pack, poses) = inputs();
    let mut node = Command::new("node");
    node.arg(repository().join("tests/doors/web.mjs"))
        .arg(folder.path())
        .arg(repository().join("runtime/wasm/package"));
    let said = run(&mut node);
    let same = fs::read(folder.path().join("frames.f32")).unwrap() == frames(&pack, &poses);
    assert!(same, "other bits than Rust's: cargo xtask wasm");
    insta::assert_snapshot!("web_client", said);
}

/// The example of the package's page does what it says.
#[test]
fn the_example_runs() {
    if !has("node") {
        return;
    }
    let (folder, ..) = inputs();
    let package = repository().join("runtime/wasm/package");
    let example = example("runtime/wasm/package/README.md", "js");
    let example = example.replace("\"kitsuke\"", &format!("\"file://{}/kitsuke.js\"", package.display()));
    let script = format!(
        "import {{ readFileSync }} from \"node:fs\";\n\
         const [bytes, recording] = [\"garment.kitsuke\", \"motion.bvh\"].map((name) => readFileSync(name));\n\
         const geometry = {{ index: new Uint32Array(324), uv: new Float32Array(140), position: new Float32Array(210), normal: new Float32Array(210) }};\n\
         {example}\nframe(1.5);\nconsole.log(geometry.position.some((x) => x !== 0), geometry.position.every(Number.isFinite));\n"
    );
    fs::write(folder.path().join("example.mjs"), script).unwrap();
    assert_eq!(run(Command::new("node").arg("example.mjs").current_dir(folder.path())), "true true\n");
}
