//! The viewer in a browser: what an artist sees while she saves. Passed over, with a message, where Chromium, node, the module that drives the
//! browser or the built command are not there.

use base64::Engine;
use base64::prelude::BASE64_STANDARD;
use kitsuke_tests::doors::{has, repository, run};
use sha2::{Digest, Sha256};
use std::fs;
use std::io::{BufRead, BufReader};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};

/// Where `npm install --prefix target/web-test puppeteer-core@24` puts it.
const MODULES: &str = "target/web-test/node_modules";

/// Ends the server with the test.
struct Server(Child);

impl Drop for Server {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

#[test]
fn an_artist_sees_what_she_saves() {
    let xtask = repository().join("target/release/xtask");
    let missing = [
        (repository().join(MODULES).join("puppeteer-core"), "npm install --prefix target/web-test puppeteer-core@24"),
        (xtask.clone(), "cargo build --release --package xtask"),
    ];
    if let Some((_, command)) = missing.iter().find(|(path, _)| !path.exists()) {
        return eprintln!("skipped: first run {command}");
    }
    if !(has("chromium") && has("node")) {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let [assets, catalog, cache, strangers] =
        ["assets-src", "catalog", "cache", "strangers"].map(|name| folder.path().join(name));
    copy(&repository().join("assets-src"), &assets);
    fs::create_dir_all(&strangers).unwrap();
    let mut command = Command::new(xtask);
    command
        .arg("view")
        .arg("komon")
        .arg("--assets")
        .arg(&assets)
        .arg("--catalog")
        .arg(&catalog)
        .arg("--cache")
        .arg(cache);
    let mut server = Server(command.stdout(Stdio::piped()).spawn().unwrap());
    let mut address = String::new();
    BufReader::new(server.0.stdout.take().unwrap()).read_line(&mut address).unwrap();
    let address = address.split_whitespace().next().unwrap().to_owned();
    let pictures = repository().join("target/web-test/pictures");
    fs::create_dir_all(&pictures).unwrap();
    let mut node = Command::new("node");
    node.arg(repository().join("tests/doors/view.mjs")).arg(address).arg(&assets).arg(pictures);
    node.arg(repository().join(MODULES)).arg("/usr/bin/chromium").arg(strangers);
    let output = node.output().unwrap();
    // Times are for those who read the log.
    eprintln!("{}", String::from_utf8_lossy(&output.stderr));
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stdout));
    insta::assert_snapshot!("viewer", String::from_utf8_lossy(&output.stdout));
}

fn copy(from: &Path, to: &PathBuf) {
    run(Command::new("cp").arg("-r").arg(from).arg(to));
}

/// What comes from others is what they published, and the page's import map is the one that the policy allows.
#[test]
fn the_page_is_what_it_says() {
    let viewer = repository().join("xtask/viewer");
    let read = |name: &str| fs::read_to_string(viewer.join(name)).unwrap();
    let published = read("vendor/README.md");
    let published: Vec<(&str, &str)> = published.lines().filter_map(|line| line.split_once("  ")).collect();
    assert_eq!(published.len(), 3);
    for (sum, name) in published {
        let found: String =
            Sha256::digest(read(&format!("vendor/{name}"))).iter().map(|b| format!("{b:02x}")).collect();
        assert_eq!(found, sum, "{name}");
    }
    let page = read("index.html");
    let (_, map) = page.split_once("<script type=\"importmap\">").unwrap();
    let sum = BASE64_STANDARD.encode(Sha256::digest(map.split_once("</script>").unwrap().0));
    assert!(read("policy.txt").contains(&format!("'sha256-{sum}'")), "policy.txt must allow {sum}");
}
