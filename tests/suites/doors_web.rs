//! The door for the web: the committed modules do in node what Rust does, to the bit. Where they no longer do, `cargo xtask wasm` builds them
//! anew.

use kitsuke_tests::doors::{frames, has, inputs, repository, run};
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
