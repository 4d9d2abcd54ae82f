//! The viewer in a browser: what an artist sees while she saves. Passed over, with a message, where Chromium, node, the module that drives the
//! browser or the built command are not there.

use base64::Engine;
use base64::prelude::BASE64_STANDARD;
use kitsuke::glam::{Affine3A, Quat, Vec3};
use kitsuke::skeleton::{Bone, Pose};
use kitsuke::{Frame, Pack, Scratch, evaluate};
use kitsuke_pipeline::look::raster::{Camera, Lens, Paint, Shape, render, smooth_normals};
use kitsuke_pipeline::look::texture::Texture;
use kitsuke_tests::doors::{self, Ended, has, repository, run};
use sha2::{Digest, Sha256};
use std::fs;
use std::io::{BufRead, BufReader};
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

/// Where `npm install --prefix target/web-test puppeteer-core@24` puts it.
const MODULES: &str = "target/web-test/node_modules";

#[test]
fn an_artist_sees_what_she_saves() {
    if !repository().join(MODULES).join("puppeteer-core").exists() {
        return eprintln!("skipped: first run npm install --prefix target/web-test puppeteer-core@24");
    }
    let Some(mut command) = doors::xtask() else { return };
    if !(has("chromium") && has("node")) {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let [assets, catalog, cache, strangers] =
        ["assets-src", "catalog", "cache", "strangers"].map(|name| folder.path().join(name));
    copy(&repository().join("assets-src"), &assets);
    fs::create_dir_all(&strangers).unwrap();
    command
        .arg("view")
        .arg("komon")
        .arg("--assets")
        .arg(&assets)
        .arg("--catalog")
        .arg(&catalog)
        .arg("--cache")
        .arg(cache);
    let mut server = Ended(command.stdout(Stdio::piped()).spawn().unwrap());
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
    let pack = fs::read(catalog.join("packs/komon.kitsuke")).unwrap();
    let (outline, alike) = compared(&repository().join("target/web-test/pictures"), &pack);
    eprintln!(
        "browser and rasteriser: {:.2} % of the outlines' pixels differ, likeness of shades {alike:.3}",
        100.0 * outline
    );
    assert!(outline < 0.01 && alike > 0.9);
}

/// The page's picture of a pose against the software rasteriser's: the share of the drawn pixels that only one of them draws, and the
/// correlation of the luminances where both do (lights differ, so that shades do).
fn compared(pictures: &Path, pack: &[u8]) -> (f64, f64) {
    let browser = image::open(pictures.join("still.png")).unwrap().to_rgb8();
    let still: serde_json::Value = serde_json::from_slice(&fs::read(pictures.join("still.json")).unwrap()).unwrap();
    let numbers = |value: &serde_json::Value| -> Vec<f32> {
        value.as_array().unwrap().iter().map(|number| number.as_f64().unwrap() as f32).collect()
    };
    let mut pose = Pose::REST;
    let data = numbers(&still["pose"]);
    pose.rotations.iter_mut().zip(data.chunks(4)).for_each(|(to, q)| *to = Quat::from_slice(q));
    pose.hips_translation_m = Vec3::from_slice(&data[4 * Bone::COUNT..]);

    let pack = Pack::open(pack).unwrap();
    let (garment, mesh) = (pack.garment(), &pack.garment().data().mesh);
    let mut positions_m = vec![Vec3::ZERO; garment.vertex_count()];
    let mut normals = positions_m.clone();
    evaluate(
        garment,
        &pose,
        &mut Scratch::new(garment),
        Frame { positions_m: &mut positions_m, normals: &mut normals },
    );
    let texture = Texture::from_png(&pack.accessories().texture.as_ref().unwrap().png).unwrap();
    let obi = pack.accessories().obi.as_ref().unwrap();
    let mut obi_m = vec![Vec3::ZERO; obi.positions_m.len()];
    obi.pose(garment, &pose, &mut vec![Affine3A::IDENTITY; garment.data().skeleton.frame_count()], &mut obi_m);
    let obi_normals = smooth_normals(&obi_m, &obi.triangles);
    let cloth = Shape {
        positions_m: &positions_m,
        normals: &normals,
        triangles: &mesh.triangles,
        paint: Paint::Textured(&texture, &mesh.uv),
        inside: Some([222, 216, 200]),
    };
    let band = Shape {
        positions_m: &obi_m,
        normals: &obi_normals,
        triangles: &obi.triangles,
        paint: Paint::Plain([196, 160, 64]),
        inside: None,
    };
    let camera = Camera {
        eye_m: Vec3::from_slice(&numbers(&still["eye"])),
        target_m: Vec3::from_slice(&numbers(&still["target"])),
        lens: Lens::Perspective { height_rad: still["heightDeg"].as_f64().unwrap().to_radians() as f32 },
    };
    const BACKGROUND: [u8; 3] = [0xe9, 0xe8, 0xe6];
    let ours = render(&[cloth, band], &camera, [browser.width(), browser.height()], BACKGROUND);
    ours.save(pictures.join("still_rasteriser.png")).unwrap();

    let drawn = |pixel: &image::Rgb<u8>| pixel.0.iter().zip(BACKGROUND).any(|(&a, b)| a.abs_diff(b) > 8);
    let shade = |pixel: &image::Rgb<u8>| pixel.0.iter().map(|&c| f64::from(c)).sum::<f64>();
    let (mut either, mut one) = (0.0, 0.0);
    let mut shades: Vec<(f64, f64)> = Vec::new();
    for (a, b) in browser.pixels().zip(ours.pixels()) {
        either += f64::from(u8::from(drawn(a) || drawn(b)));
        one += f64::from(u8::from(drawn(a) != drawn(b)));
        if drawn(a) && drawn(b) {
            shades.push((shade(a), shade(b)));
        }
    }
    let count = shades.len() as f64;
    let (mean_a, mean_b) =
        (shades.iter().map(|s| s.0).sum::<f64>() / count, shades.iter().map(|s| s.1).sum::<f64>() / count);
    let sum = |f: &dyn Fn(f64, f64) -> f64| shades.iter().map(|s| f(s.0 - mean_a, s.1 - mean_b)).sum::<f64>();
    (one / either, sum(&|a, b| a * b) / (sum(&|a, _| a * a) * sum(&|_, b| b * b)).sqrt())
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
