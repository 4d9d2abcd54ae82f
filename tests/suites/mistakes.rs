//! The artist's mistakes: each file `tests/mistakes/NAME.txt` damages the small sound garment `tests/garments/tube` and
//! the exact message is `tests/mistakes/messages/NAME.snap`.
//!
//! A recipe begins with `# code: CODE`, the code that must be among the diagnostics, and a comment for people. Each
//! other line is a step, its fields separated by ` | ` (see [`step`]).

use kitsuke_pipeline::diagnostic::{self, Format};
use kitsuke_pipeline::source;
use proptest::prelude::*;
use std::fs;
use std::path::{Path, PathBuf};

fn tests_dir() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

/// A copy of the small garment and its body that a test may damage.
struct Workplace {
    assets: tempfile::TempDir,
    id: String,
}

impl Workplace {
    fn new() -> Workplace {
        let assets = tempfile::tempdir().unwrap();
        copy_folder(&tests_dir().join("garments"), assets.path());
        Workplace { assets, id: "tube".to_owned() }
    }

    fn garment(&self) -> PathBuf {
        self.assets.path().join(&self.id)
    }

    fn messages(&self, format: Format) -> String {
        let loaded = kitsuke_pipeline::load(&self.garment());
        let messages = diagnostic::render(&loaded.diagnostics, self.assets.path(), format);
        messages.replace(&*self.assets.path().to_string_lossy(), "ASSETS")
    }
}

fn copy_folder(from: &Path, to: &Path) {
    fs::create_dir_all(to).unwrap();
    for entry in fs::read_dir(from).unwrap() {
        let entry = entry.unwrap();
        let target = to.join(entry.file_name());
        if entry.file_type().unwrap().is_dir() {
            copy_folder(&entry.path(), &target);
        } else {
            fs::copy(entry.path(), target).unwrap();
        }
    }
}

/// Carries out one step of a recipe.
fn step(place: &mut Workplace, step: &str) {
    let fields: Vec<String> = step.split(" | ").map(|field| field.replace("\\n", "\n")).collect();
    let fields: Vec<&str> = fields.iter().map(String::as_str).collect();
    let garment = place.garment();
    let at = |file: &str| garment.join(file);
    let read = |file: &str| fs::read(at(file)).unwrap_or_else(|error| panic!("{step}: {error}"));
    let read_text = |file: &str| String::from_utf8(read(file)).unwrap();
    let write = |file: &str, bytes: &[u8]| fs::write(at(file), bytes).unwrap();
    match fields[..] {
        // The first occurrence, which must exist; in binary files, too.
        ["replace", file, old, new] => {
            let bytes = read(file);
            let found = bytes.windows(old.len()).position(|window| window == old.as_bytes());
            let start = found.unwrap_or_else(|| panic!("{step}: not found"));
            write(file, &[&bytes[..start], new.as_bytes(), &bytes[start + old.len()..]].concat());
        }
        ["append", file, text] => write(file, &[&read(file)[..], text.as_bytes(), b"\n"].concat()),
        ["write", file, text] => write(file, text.as_bytes()),
        ["folder", name] => fs::create_dir(at(name)).unwrap(),
        ["delete", file] => fs::remove_file(at(file)).unwrap(),
        ["copy", from, to] => write(to, &read(from)),
        ["rename", id] => {
            fs::rename(&garment, place.assets.path().join(id)).unwrap();
            place.id = id.to_owned();
        }
        ["twin", id] => copy_folder(&garment, &place.assets.path().join(id)),
        ["utf16", file] => {
            let units = read_text(file).encode_utf16().flat_map(u16::to_le_bytes).collect::<Vec<u8>>();
            write(file, &[b"\xff\xfe", &units[..]].concat());
        }
        // New coordinates, each as FACTOR?AXIS OFFSET?, for example `-x 1000y z+0.5`.
        ["map", file, axes] => {
            let axes: Vec<(f64, usize, f64)> = axes.split(' ').map(coordinate).collect();
            let map = |p: [f64; 3]| [0, 1, 2].map(|i| axes[i].0 * p[axes[i].1] + axes[i].2);
            write(file, with_vertices(&read_text(file), |all| all.into_iter().map(map).collect()).as_bytes());
        }
        // The same of texture coordinates, `x` for u and `y` for v.
        ["map-uv", file, axes] => {
            let axes: Vec<(f64, usize, f64)> = axes.split(' ').map(coordinate).collect();
            let line = |line: &str| match line.strip_prefix("vt ") {
                Some(uv) => {
                    let uv: Vec<f64> = uv.split(' ').map(|number| number.parse().unwrap()).collect();
                    let [u, v] = [0, 1].map(|i| axes[i].0 * uv[axes[i].1] + axes[i].2);
                    format!("vt {u:.4} {v:.4}\n")
                }
                None => format!("{line}\n"),
            };
            write(file, read_text(file).lines().map(line).collect::<String>().as_bytes());
        }
        // A piece that was not selected when its vertices' faces were exported.
        ["without", file, piece] => {
            let mut is_in_piece = false;
            let mut line = |line: &&str| {
                is_in_piece = line.strip_prefix("g ").map_or(is_in_piece, |name| name == piece);
                !is_in_piece
            };
            let text = read_text(file);
            let left: Vec<&str> = text.lines().filter(|text| line(text)).collect();
            write(file, left.join("\n").as_bytes());
        }
        ["invert", file] => {
            let mut image = image::open(at(file)).unwrap().into_luma8();
            image::imageops::invert(&mut image);
            image.save(at(file)).unwrap();
        }
        // Positions in reverse order under the same faces.
        ["reorder", file] => {
            let reversed = with_vertices(&read_text(file), |all| all.into_iter().rev().collect());
            write(file, reversed.as_bytes());
        }
        ["exchange", file, a, b] => {
            let (a, b): (usize, usize) = (a.parse().unwrap(), b.parse().unwrap());
            let exchanged = with_vertices(&read_text(file), |mut all| {
                all.swap(a - 1, b - 1);
                all
            });
            write(file, exchanged.as_bytes());
        }
        // One vertex moved by x, y and z.
        ["drag", file, vertex, by] => {
            let by: Vec<f64> = by.split(' ').map(|number| number.parse().unwrap()).collect();
            let dragged = with_vertices(&read_text(file), |mut all| {
                let vertex = &mut all[vertex.parse::<usize>().unwrap() - 1];
                *vertex = [0, 1, 2].map(|i| vertex[i] + by[i]);
                all
            });
            write(file, dragged.as_bytes());
        }
        // Positions in reverse order, and the faces follow.
        ["renumber", file] => {
            let text = with_vertices(&read_text(file), |all| all.into_iter().rev().collect());
            let count = text.lines().filter(|line| line.starts_with("v ")).count();
            write(file, with_faces(&text, |face| face.into_iter().map(|v| count + 1 - v).collect()).as_bytes());
        }
        ["flip", file] => write(file, with_faces(&read_text(file), |face| face.into_iter().rev().collect()).as_bytes()),
        // A target without texture coordinates, cut open along the texture seams of the base.
        ["unweld", file] => {
            let base = read_text("base.obj");
            let target = read_text(file);
            let positions: Vec<&str> = target.lines().filter(|line| line.starts_with("v ")).collect();
            let corners = base.lines().filter(|line| line.starts_with("f ")).flat_map(|line| line[2..].split(' '));
            let corners: Vec<(usize, usize)> = corners
                .map(|corner| corner.split_once('/').unwrap())
                .map(|(v, vt)| (vt.parse().unwrap(), v.parse().unwrap()))
                .collect();
            let vertex_of: std::collections::BTreeMap<usize, usize> = corners.iter().copied().collect();
            let mut text: String = vertex_of.values().map(|v| format!("{}\n", positions[v - 1])).collect();
            for face in corners.chunks(3) {
                text += &format!("f {} {} {}\n", face[0].0, face[1].0, face[2].0);
            }
            write(file, text.as_bytes());
        }
        // Two layers, as Thick exports: the other one a millimetre or less inside, its faces turned over.
        ["thicken", file] => {
            let text = read_text(file);
            let count = text.lines().filter(|line| line.starts_with("v ")).count();
            let of = |start: &str| text.lines().filter(|line| line.starts_with(start)).collect::<Vec<_>>().join("\n");
            let inner = with_vertices(&of("v "), |all| all.into_iter().map(|p| p.map(|x| 0.999 * x)).collect());
            let faces = with_faces(&of("f "), |face| face);
            let turned = with_faces(&of("f "), |face| face.into_iter().rev().map(|v| v + count).collect());
            write(file, format!("{}\n{inner}{faces}{turned}", of("v ")).as_bytes());
        }
        // About the vertical.
        ["turn", file, degrees] => {
            let (sin, cos) = degrees.parse::<f64>().unwrap().to_radians().sin_cos();
            let turn = |[x, y, z]: [f64; 3]| [cos * x + sin * z, y, cos * z - sin * x];
            write(file, with_vertices(&read_text(file), |all| all.into_iter().map(turn).collect()).as_bytes());
        }
        // The beginning of a JPEG.
        ["jpeg", file] => write(file, b"\xff\xd8\xff\xe0\x00\x10JFIF"),
        ["points", file] => {
            let text = read_text(file);
            let lines: Vec<&str> = text.lines().filter(|line| !line.starts_with("f ")).collect();
            write(file, lines.join("\n").as_bytes());
        }
        ["paint", file, side, grey] => {
            let (side, grey) = (side.parse().unwrap(), grey.parse().unwrap());
            image::GrayImage::from_pixel(side, side, image::Luma([grey])).save(at(file)).unwrap();
        }
        // As a download that broke off leaves it.
        ["cut", file, length] => write(file, &read(file)[..length.parse().unwrap()]),
        // Bytes of a GLB's binary chunk.
        ["patch", file, offset, byte, count] => {
            let mut bytes = read(file);
            let chunk = bytes.windows(4).position(|window| window == b"BIN\0").unwrap() + 4;
            let start = chunk + offset.parse::<usize>().unwrap();
            bytes[start..start + count.parse::<usize>().unwrap()].fill(byte.parse().unwrap());
            write(file, &bytes);
        }
        _ => panic!("no such step: {step}"),
    }
}

fn coordinate(text: &str) -> (f64, usize, f64) {
    let axis = text.find(['x', 'y', 'z']).unwrap();
    let factor = match &text[..axis] {
        "" => 1.0,
        "-" => -1.0,
        number => number.parse().unwrap(),
    };
    let offset = text[axis + 1..].parse().unwrap_or(0.0);
    (factor, usize::from(text.as_bytes()[axis] - b'x'), offset)
}

fn with_vertices(text: &str, change: impl FnOnce(Vec<[f64; 3]>) -> Vec<[f64; 3]>) -> String {
    let parse = |line: &str| {
        let mut numbers = line[2..].split(' ').map(|number| number.parse::<f64>().unwrap());
        std::array::from_fn(|_| numbers.next().unwrap())
    };
    let all = text.lines().filter(|line| line.starts_with("v ")).map(parse).collect();
    let mut changed = change(all).into_iter();
    let line = |line: &str| match line.starts_with("v ") {
        true => changed.next().map(|[x, y, z]| format!("v {x:.4} {y:.4} {z:.4}\n")).unwrap(),
        false => format!("{line}\n"),
    };
    text.lines().map(line).collect()
}

/// Faces of vertex numbers alone.
fn with_faces(text: &str, change: impl Fn(Vec<usize>) -> Vec<usize>) -> String {
    let line = |line: &str| match line.strip_prefix("f ") {
        Some(corners) => {
            let vertex = |corner: &str| corner.split('/').next().unwrap().parse().unwrap();
            let face = change(corners.split(' ').map(vertex).collect());
            format!("f {}\n", face.iter().map(usize::to_string).collect::<Vec<_>>().join(" "))
        }
        None => format!("{line}\n"),
    };
    text.lines().map(line).collect()
}

fn recipes() -> Vec<PathBuf> {
    let entries = fs::read_dir(tests_dir().join("mistakes")).unwrap().map(|entry| entry.unwrap().path());
    let mut recipes: Vec<PathBuf> = entries.filter(|path| path.extension().is_some_and(|e| e == "txt")).collect();
    recipes.sort();
    recipes
}

fn damaged(recipe: &str) -> Workplace {
    let mut place = Workplace::new();
    for line in recipe.lines().filter(|line| !line.is_empty() && !line.starts_with('#')) {
        step(&mut place, line);
    }
    place
}

/// Carries a recipe out and compares the messages with the snapshot; says what else is wrong.
fn check(path: &Path) -> Result<(), String> {
    let name = path.file_stem().unwrap().to_string_lossy();
    let recipe = fs::read_to_string(path).unwrap();
    let place = damaged(&recipe);
    let messages = place.messages(Format::Human { color: false });
    snapshots().bind(|| insta::assert_snapshot!(&*name, messages));
    let code =
        recipe.lines().next().and_then(|line| line.strip_prefix("# code: ")).expect("the first line is the code");
    let diagnostics = kitsuke_pipeline::load(&place.garment()).diagnostics;
    let is_complete = |d: &diagnostic::Diagnostic| !d.problem.is_empty() && !d.help.is_empty();
    if !diagnostics.iter().any(|d| d.code == code) || !diagnostics.iter().all(is_complete) {
        return Err(format!("{name}: no `{code}`, or an empty message, among\n{messages}"));
    }
    Ok(())
}

fn snapshots() -> insta::Settings {
    let mut settings = insta::Settings::clone_current();
    settings.set_prepend_module_to_snapshot(false);
    settings.set_omit_expression(true);
    settings.set_snapshot_path(tests_dir().join("mistakes/messages"));
    settings
}

#[test]
fn the_small_garment_is_sound() {
    let place = Workplace::new();
    let loaded = kitsuke_pipeline::load(&place.garment());
    assert_eq!(loaded.diagnostics, []);
    let mut inputs = source::input_files(&place.garment()).unwrap();
    inputs.sort();
    assert_eq!(loaded.inputs, inputs, "both ways to read name the same inputs");
    assert_eq!(inputs.len(), 16);
}

#[test]
fn the_template_with_a_base_alone_lacks_only_targets() {
    let assets = tempfile::tempdir().unwrap();
    let sources = tests_dir().join("../assets-src");
    copy_folder(&sources.join("_template"), &assets.path().join("mine"));
    copy_folder(&sources.join("bodies"), &assets.path().join("bodies"));
    fs::copy(sources.join("komon/base.obj"), assets.path().join("mine/base.obj")).unwrap();
    let codes: Vec<String> = kitsuke_pipeline::load(&assets.path().join("mine"))
        .diagnostics
        .into_iter()
        .map(|d| d.code.into_owned())
        .collect();
    assert_eq!(codes, ["no-targets"]);
}

#[test]
fn the_schema_of_the_manifest_is_up_to_date() {
    let committed = fs::read_to_string(tests_dir().join("../assets-src/garment.schema.json")).unwrap();
    assert_eq!(committed, source::manifest::schema(), "run `cargo xtask schema`");
}

/// The sample's own table has joint positions besides; of a list of poses only the rotations are read.
#[test]
fn foreign_columns_of_a_pose_table_are_passed_over() {
    let path = tests_dir().join("../../shared/data/komon/poses.csv");
    let Ok(bytes) = fs::read(&path) else {
        println!("skipped: {} is absent", path.display());
        return;
    };
    let mut report = Vec::new();
    let table = source::tables::read("poses.csv", &bytes, &mut report).unwrap();
    assert_eq!((report.len(), table.rows.len(), table.bones.len()), (0, 19, 6));
    let ours = fs::read(tests_dir().join("../assets-src/komon/poses.csv")).unwrap();
    let ours = source::tables::read_rotations("poses.csv", &ours, &mut report).unwrap();
    // Ours has the poses of legs besides.
    assert_eq!(table.poses(), ours.poses()[..19]);
}

/// Two lines of a file change places, in cloth that is creased elsewhere.
#[test]
fn exchanged_vertices_of_the_sample_are_found_and_creases_are_not() {
    let assets = tempfile::tempdir().unwrap();
    let sources = tests_dir().join("../assets-src");
    copy_folder(&sources.join("komon"), &assets.path().join("komon"));
    copy_folder(&sources.join("bodies"), &assets.path().join("bodies"));
    copy_folder(&sources.join("rules"), &assets.path().join("rules"));
    let mut place = Workplace { assets, id: "komon".to_owned() };
    assert_eq!(kitsuke_pipeline::load(&place.garment()).diagnostics, []);
    step(&mut place, "exchange | poses/05_right_down.obj | 5001 | 5002");
    step(&mut place, "drag | poses/04_right_45.obj | 3001 | 0 0.02 0.03");
    step(&mut place, "exchange | poses/18_right_up_bent_left_down.obj | 301 | 9001");
    let diagnostics = kitsuke_pipeline::load(&place.garment()).diagnostics;
    let said: Vec<(&str, &str)> = diagnostics.iter().map(|d| (&*d.code, d.problem.as_str())).collect();
    let expected = |pair: &str| format!("vertices {pair} are exchanged, compared with komon/base.obj");
    let (first, second) = (expected("5001 and 5002"), expected("301 and 9001"));
    let dragged = said.iter().find(|(code, _)| *code == "vertex-moved");
    assert!(
        dragged.is_some_and(|(_, problem)| problem.starts_with("vertex 3001 was moved by itself: it lies 3.")),
        "{said:?}"
    );
    let said: Vec<(&str, &str)> = said.into_iter().filter(|(code, _)| *code != "vertex-moved").collect();
    assert_eq!(said, [("vertex-order", first.as_str()), ("vertex-order", second.as_str())]);
}

#[test]
fn every_mistake_has_its_message() {
    let recipes = recipes();
    assert!(recipes.len() >= 25, "{} recipes", recipes.len());
    let wrong: Vec<String> = recipes.iter().filter_map(|recipe| check(recipe).err()).collect();
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

#[test]
fn every_message_has_its_recipe() {
    for entry in fs::read_dir(tests_dir().join("mistakes/messages")).unwrap() {
        let path = entry.unwrap().path();
        // Messages that were not accepted yet come and go beside them.
        if path.extension().is_none_or(|extension| extension != "snap") {
            continue;
        }
        let name = path.file_stem().unwrap().to_string_lossy().into_owned();
        let is_format = name.starts_with("format_");
        assert!(is_format || tests_dir().join(format!("mistakes/{name}.txt")).exists(), "{} is stale", path.display());
    }
}

#[test]
fn machine_formats_are_stable() {
    let place = damaged(&fs::read_to_string(tests_dir().join("mistakes/many-at-once.txt")).unwrap());
    let json = place.messages(Format::Json);
    for line in json.lines() {
        serde_json::from_str::<serde_json::Value>(line).unwrap();
    }
    snapshots().bind(|| {
        insta::assert_snapshot!("format_json", json);
        insta::assert_snapshot!("format_github", place.messages(Format::Github));
    });
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 200, ..ProptestConfig::default() })]

    /// Damaged anywhere, every file of the garment is read or refused, and what is said can be shown.
    #[test]
    fn random_damage_never_panics(file in 0..12usize, damage in prop::collection::vec((any::<u32>(), any::<u8>()), 1..6), cut: Option<u16>) {
        let place = Workplace::new();
        let files = source::input_files(&place.garment()).unwrap();
        let path = place.assets.path().join(&files[file].path);
        let mut bytes = fs::read(&path).unwrap();
        for (at, value) in damage {
            let at = at as usize % bytes.len();
            bytes[at] = value;
        }
        if let Some(cut) = cut {
            bytes.truncate(usize::from(cut) % bytes.len());
        }
        fs::write(&path, bytes).unwrap();
        for format in [Format::Human { color: false }, Format::Json, Format::Github] {
            let _ = place.messages(format);
        }
        let _ = source::input_files(&place.garment());
    }
}
