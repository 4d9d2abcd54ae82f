//! Exports of one and the same cloth, written in many ways: each is recovered exactly, or refused with the right reason. The truth is the
//! numbering with which the test itself wrote the file; for the exports of `../shared/data/md_export` it is their `vertex_map.json`.

use glam::DVec3;
use kitsuke_pipeline::check::correspondence::{self, Evidence, Lost, Recovered};
use kitsuke_pipeline::diagnostic::Severity;
use kitsuke_pipeline::source::obj::{self, Mesh};
use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write;
use std::fs;
use std::path::{Path, PathBuf};

fn sample(file: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../assets-src/komon").join(file)
}

fn read(bytes: &[u8]) -> Mesh {
    let mut report = Vec::new();
    obj::read("test.obj", bytes, &mut report).unwrap_or_else(|| panic!("{report:?}"))
}

fn komon() -> (Mesh, Mesh) {
    let read_file = |file| read(&fs::read(sample(file)).unwrap());
    (read_file("base.obj"), read_file("poses/17_hands_before_belly.obj"))
}

/// A mesh as corners without numbers: how a file numbers them is up to who writes it.
#[derive(Clone)]
struct Cloth {
    /// Of each corner its name (vertex of the base, piece of an unwelded file), place and texture coordinates.
    faces: Vec<(usize, Vec<Point>)>,
    parts: Vec<String>,
}

#[derive(Clone, Copy)]
struct Point {
    /// Who has the same is one vertex in the file.
    name: (u32, u32),
    place: DVec3,
    uv: [f32; 2],
    /// The number of its texture coordinate in the base.
    uv_number: u32,
}

impl Cloth {
    /// The pose on the base's faces.
    fn new(base: &Mesh, pose: &Mesh) -> Cloth {
        let face = |face: &obj::Face| {
            let point = |corner: &obj::Corner| Point {
                name: (corner.vertex, 0),
                place: pose.positions[corner.vertex as usize],
                uv: base.uv[corner.uv.unwrap() as usize].to_array(),
                uv_number: corner.uv.unwrap(),
            };
            (face.part as usize, base.corners_of(face).iter().map(point).collect())
        };
        Cloth { faces: base.faces.iter().map(face).collect(), parts: base.parts.clone() }
    }

    fn map(mut self, change: impl Fn(usize, &mut Point)) -> Cloth {
        for (part, corners) in &mut self.faces {
            corners.iter_mut().for_each(|corner| change(*part, corner));
        }
        self
    }

    fn unwelded(self) -> Cloth {
        self.map(|_, corner| corner.name.1 = corner.uv_number)
    }

    /// The pieces, and so their faces, in reverse order.
    fn pieces_reversed(mut self) -> Cloth {
        let last = self.parts.len() - 1;
        self.parts.reverse();
        self.faces.iter_mut().for_each(|(part, _)| *part = last - *part);
        self.faces.sort_by_key(|(part, _)| *part);
        self
    }

    fn renamed(mut self) -> Cloth {
        self.parts.iter_mut().enumerate().for_each(|(i, name)| *name = format!("Pattern2D_{}", 183_400 + 37 * i));
        self
    }

    fn faces_shuffled(mut self) -> Cloth {
        shuffle(&mut self.faces, 5);
        self
    }

    /// Pairs of triangles of one piece that follow each other and share an edge become quads.
    fn quads(mut self) -> Cloth {
        let mut faces: Vec<(usize, Vec<Point>)> = Vec::new();
        for (part, corners) in self.faces {
            let joined = faces.last().and_then(|(last_part, last)| {
                (*last_part == part && last.len() == 3 && corners.len() == 3).then(|| quad(last, &corners)).flatten()
            });
            match joined {
                Some(quad) => faces.last_mut().unwrap().1 = quad,
                None => faces.push((part, corners)),
            }
        }
        self.faces = faces;
        self
    }

    /// Quads cut along their other diagonal, unless that is an edge of other faces.
    fn cut_otherwise(mut self) -> Cloth {
        let edge = |a: &Point, b: &Point| (a.name.min(b.name), a.name.max(b.name));
        let next = |corners: &[Point], i: usize| corners[(i + 1) % corners.len()];
        let sides = self.faces.iter().flat_map(|(_, corners)| {
            (0..corners.len()).map(move |i| edge(&corners[i], &next(corners, i))).collect::<Vec<_>>()
        });
        let mut edges: BTreeSet<_> = sides.collect();
        let cut = |(part, corners): (usize, Vec<Point>)| match corners[..] {
            [a, b, c, d] if edges.insert(edge(&b, &d)) => vec![(part, vec![b, c, d]), (part, vec![b, d, a])],
            _ => vec![(part, corners)],
        };
        self.faces = self.faces.into_iter().flat_map(cut).collect();
        self
    }

    /// The file's text, its vertices in an order given by a seed (0: by first use), and the base's vertex of each.
    fn text(&self, seed: u64, scale: f64, decimals: usize, is_textured: bool) -> (String, Vec<u32>) {
        let mut names: Vec<(u32, u32)> = Vec::new();
        let mut places: BTreeMap<(u32, u32), DVec3> = BTreeMap::new();
        for point in self.faces.iter().flat_map(|(_, corners)| corners) {
            if places.insert(point.name, point.place).is_none() {
                names.push(point.name);
            }
        }
        if seed != 0 {
            shuffle(&mut names, seed);
        }
        let number: BTreeMap<(u32, u32), usize> = names.iter().copied().zip(1..).collect();
        let mut text = String::new();
        for name in &names {
            let [x, y, z] = (places[name] * scale).to_array();
            writeln!(text, "v {x:.decimals$} {y:.decimals$} {z:.decimals$}").unwrap();
        }
        let mut uvs: BTreeMap<[u32; 2], usize> = BTreeMap::new();
        let mut faces = String::new();
        let mut current = usize::MAX;
        for (part, corners) in &self.faces {
            if *part != current {
                current = *part;
                writeln!(faces, "g {}", self.parts[*part]).unwrap();
            }
            faces.push('f');
            for point in corners {
                write!(faces, " {}", number[&point.name]).unwrap();
                if is_textured {
                    let next = uvs.len() + 1;
                    let uv = *uvs.entry(point.uv.map(f32::to_bits)).or_insert_with(|| {
                        writeln!(text, "vt {:.4} {:.4}", point.uv[0], point.uv[1]).unwrap();
                        next
                    });
                    write!(faces, "/{uv}").unwrap();
                }
            }
            faces.push('\n');
        }
        (text + &faces, names.into_iter().map(|(vertex, _)| vertex).collect())
    }
}

fn quad(a: &[Point], b: &[Point]) -> Option<Vec<Point>> {
    let is_same = |a: &Point, b: &Point| a.name == b.name && a.uv == b.uv;
    let side = (0..3).find(|&i| (0..3).any(|j| is_same(&a[i], &b[(j + 1) % 3]) && is_same(&a[(i + 1) % 3], &b[j])))?;
    let apex = b.iter().find(|point| !a.iter().any(|known| is_same(known, point)))?;
    Some(vec![a[side], *apex, a[(side + 1) % 3], a[(side + 2) % 3]])
}

/// Always the same order for the same seed.
fn shuffle<T>(items: &mut [T], seed: u64) {
    let mut state = seed;
    for i in (1..items.len()).rev() {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        items.swap(i, ((state >> 33) % (i as u64 + 1)) as usize);
    }
}

/// Every vertex of the base was found, at its place.
fn assert_found(what: &str, found: &Recovered, base_vertex: &[u32], pose: &Mesh, scale: f64, decimals: usize) {
    for (vertex, &of) in found.vertex_of.iter().enumerate() {
        assert_eq!(base_vertex[of as usize] as usize, vertex, "{what}");
    }
    let tolerance = 10f64.powi(-(decimals as i32));
    for (own, wanted) in found.mesh.positions.iter().zip(&pose.positions) {
        assert!(own.distance(*wanted * scale) <= tolerance, "{what}: {own} and {wanted}");
    }
}

#[test]
fn one_cloth_written_in_many_ways_is_recovered_exactly() {
    let (base, pose) = komon();
    let plain = Cloth::new(&base, &pose);
    let (texture, faces) = (Evidence::Texture, Evidence::Faces);
    let cases: Vec<(&str, Cloth, u64, bool, Evidence)> = vec![
        ("unwelded", plain.clone().unwelded(), 0, true, texture),
        ("vertices shuffled", plain.clone(), 3, true, texture),
        ("unwelded, shuffled, faces too", plain.clone().unwelded().faces_shuffled(), 4, true, texture),
        ("pieces in another order", plain.clone().pieces_reversed(), 0, true, texture),
        ("other names", plain.clone().pieces_reversed().renamed().unwelded(), 0, true, texture),
        ("quads", plain.clone().quads(), 7, true, texture),
        ("quads cut along the other diagonal", plain.clone().quads().cut_otherwise().unwelded(), 8, true, texture),
        ("unwelded, no texture", plain.clone().unwelded(), 0, false, faces),
        ("shuffled, no texture", plain.clone(), 9, false, faces),
        ("pieces in another order, no texture", plain.clone().pieces_reversed().unwelded(), 0, false, faces),
        ("the same with other names", plain.clone().pieces_reversed().renamed().unwelded(), 2, false, faces),
    ];
    for (what, cloth, seed, is_textured, evidence) in cases {
        for (scale, decimals) in [(1.0, 5), (1000.0, 2)] {
            let (text, base_vertex) = cloth.text(seed, scale, decimals, is_textured);
            let other = read(text.as_bytes());
            assert!(!correspondence::is_in_order(&base, &other), "{what}");
            let found = correspondence::recover(&base, &other).unwrap_or_else(|lost| panic!("{what}: {lost:?}"));
            assert_eq!(found.evidence, evidence, "{what}");
            assert_found(what, &found, &base_vertex, &pose, scale, decimals);
        }
    }
}

/// A base that is not welded, and targets that are.
#[test]
fn welded_again_is_recovered_too() {
    let (welded, pose) = komon();
    let (text, _) = Cloth::new(&welded, &welded).unwelded().text(0, 1.0, 5, true);
    let base = read(text.as_bytes());
    assert_eq!(base.positions.len(), 14_585);
    for (seed, is_textured) in [(6, true), (0, false)] {
        let (text, base_vertex) = Cloth::new(&welded, &pose).text(seed, 1.0, 5, is_textured);
        let other = read(text.as_bytes());
        assert_eq!(other.positions.len(), 13_924);
        let found = correspondence::recover(&base, &other).unwrap();
        let (_, of_base) = Cloth::new(&welded, &welded).unwelded().text(0, 1.0, 5, true);
        for (vertex, &of) in found.vertex_of.iter().enumerate() {
            assert_eq!(base_vertex[of as usize], of_base[vertex], "vertex {vertex}");
        }
    }
}

/// Left and right pieces lie upon each other in the texture.
#[test]
fn pieces_that_overlap_in_the_texture_are_told_apart_or_refused() {
    let (welded, pose) = komon();
    let part = |name: &str| welded.parts.iter().position(|part| part == name).unwrap();
    let (left, right) = (part("sode_left"), part("sode_right"));
    let bounds = |wanted: usize| {
        let corners = welded.faces.iter().filter(|face| face.part as usize == wanted);
        let us =
            corners.flat_map(|face| welded.corners_of(face)).map(|corner| welded.uv[corner.uv.unwrap() as usize].x);
        us.fold((f32::INFINITY, f32::NEG_INFINITY), |(low, high), u| (low.min(u), high.max(u)))
    };
    let ((low, high), (to_low, _)) = (bounds(right), bounds(left));
    let moved = |cloth: Cloth, is_mirrored: bool| {
        cloth.map(|part, point| {
            if part == right {
                let u = if is_mirrored { high - point.uv[0] } else { point.uv[0] - low };
                // As a file has it.
                point.uv[0] = ((to_low + u) * 1e4).round() / 1e4;
            }
        })
    };
    for is_mirrored in [true, false] {
        let base = read(moved(Cloth::new(&welded, &welded), is_mirrored).text(0, 1.0, 5, true).0.as_bytes());
        let (_, of_base) = moved(Cloth::new(&welded, &welded), is_mirrored).text(0, 1.0, 5, true);
        let welded_other = moved(Cloth::new(&welded, &pose), is_mirrored).faces_shuffled();
        for (what, cloth) in [
            ("names", welded_other.clone().unwelded()),
            ("names and seams", welded_other.clone()),
            ("seams alone", welded_other.clone().renamed()),
        ] {
            let (text, base_vertex) = cloth.text(12, 1.0, 5, true);
            let found = correspondence::recover(&base, &read(text.as_bytes()));
            let found = found.unwrap_or_else(|lost| panic!("{what}, mirrored: {is_mirrored}: {lost:?}"));
            assert_eq!(found.evidence, Evidence::Texture);
            for (vertex, &of) in found.vertex_of.iter().enumerate() {
                assert_eq!(base_vertex[of as usize], of_base[vertex], "{what}, mirrored: {is_mirrored}");
            }
        }
    }
    // Both sleeves have the very same texture coordinates, and neither a name nor a seam tells which is which.
    let twice = |cloth: Cloth| {
        let faces = cloth.faces.iter().filter(|(part, _)| *part == left).cloned().collect::<Vec<_>>();
        let copy = faces.iter().cloned().map(|(_, corners)| {
            let moved = |mut point: Point| {
                point.name.1 = 1;
                point.place.x -= 2.0;
                point
            };
            (right, corners.into_iter().map(moved).collect())
        });
        Cloth { faces: faces.iter().cloned().chain(copy).collect(), parts: cloth.parts }
    };
    let base = read(twice(Cloth::new(&welded, &welded)).text(0, 1.0, 5, true).0.as_bytes());
    let other = twice(Cloth::new(&welded, &pose)).renamed().faces_shuffled().text(13, 1.0, 5, true).0;
    let lost = correspondence::recover(&base, &read(other.as_bytes())).unwrap_err();
    assert!(matches!(lost, Lost::Overlapping(count) if count > 3000), "{lost:?}");
}

#[test]
fn what_is_not_the_same_cloth_is_refused_with_the_reason() {
    let (base, pose) = komon();
    let plain = Cloth::new(&base, &pose);
    let refusal = |cloth: &Cloth, seed, is_textured| {
        let other = read(cloth.text(seed, 1000.0, 2, is_textured).0.as_bytes());
        correspondence::recover(&base, &other).map(|found| found.evidence).unwrap_err()
    };
    let mut fewer = plain.clone().unwelded();
    fewer.faces.remove(9000);
    assert_eq!(refusal(&fewer, 0, true), Lost::OtherFaces);
    assert_eq!(refusal(&fewer, 0, false), Lost::OtherFaces);
    let mut turned_over = plain.clone().unwelded();
    turned_over.faces.iter_mut().for_each(|(_, corners)| corners.reverse());
    assert_eq!(refusal(&turned_over, 0, true), Lost::OtherFaces);
    let mut twice = plain.clone().unwelded();
    twice.faces[100] = twice.faces[101].clone();
    assert_eq!(refusal(&twice, 0, true), Lost::OtherFaces);
    // Neither order nor texture.
    assert_eq!(refusal(&plain.clone().faces_shuffled(), 3, false), Lost::NoTexture);
    // Other texture coordinates, and nothing else to go by.
    let scaled = plain.clone().map(|_, point| point.uv = point.uv.map(|x| 0.73 * x + 0.001));
    assert!(matches!(refusal(&scaled.clone().faces_shuffled(), 3, true), Lost::OtherTexture(count) if count > 10_000));
    // With the faces in order they are not needed.
    let (text, base_vertex) = scaled.unwelded().text(0, 1.0, 5, true);
    let found = correspondence::recover(&base, &read(text.as_bytes())).unwrap();
    assert_eq!(found.evidence, Evidence::Faces);
    assert_found("scaled texture", &found, &base_vertex, &pose, 1.0, 5);
    // A sleeve was moved by 4 mm and is no longer sewn on.
    let sleeve = base.parts.iter().position(|part| part == "sode_left").unwrap();
    let torn = plain.clone().unwelded().map(|part, point| {
        if part == sleeve {
            point.place.x += 0.004;
        }
    });
    for is_textured in [true, false] {
        match refusal(&torn, 0, is_textured) {
            Lost::Torn { parts, apart, .. } => {
                assert!(parts.contains(&"sode_left".to_owned()), "{parts:?}");
                assert!((apart - 4.0).abs() < 0.03, "{apart}");
            }
            lost => panic!("{lost:?}"),
        }
    }
    // Faces in order, and places in none.
    let (text, _) = plain.text(0, 1.0, 5, false);
    let mut other = read(text.as_bytes());
    shuffle(&mut other.positions, 21);
    assert!(matches!(correspondence::recover(&base, &other), Err(Lost::OtherLengths(share)) if share > 0.5));
}

/// The exports of the shared data and the base's vertex of each of theirs.
fn md_exports() -> Option<(PathBuf, Vec<u32>)> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../shared/data/md_export");
    let Ok(bytes) = fs::read(folder.join("vertex_map.json")) else {
        println!("skipped: {} is absent", folder.display());
        return None;
    };
    let map: serde_json::Value = serde_json::from_slice(&bytes).unwrap();
    let of = map["base_vertex"].as_array().unwrap().iter().map(|vertex| vertex.as_u64().unwrap() as u32).collect();
    Some((folder, of))
}

const MD_POSES: [(&str, &str); 2] = [
    ("komon_pose_01_a_pose_45.obj", "poses/01_a_pose_45.obj"),
    ("komon_pose_17_hands_before_belly.obj", "poses/17_hands_before_belly.obj"),
];

#[test]
fn exports_of_marvelous_designer_are_the_targets_themselves() {
    let Some((folder, base_vertex)) = md_exports() else { return };
    let (base, _) = komon();
    let files = [("komon base.obj", "base.obj"), MD_POSES[0], MD_POSES[1]];
    for ((file, original), evidence) in files.into_iter().zip([Evidence::Texture, Evidence::Texture, Evidence::Faces]) {
        let found = correspondence::recover(&base, &read(&fs::read(folder.join(file)).unwrap())).unwrap();
        assert_eq!(found.evidence, evidence, "{file}");
        let pose = read(&fs::read(sample(original)).unwrap());
        assert_found(file, &found, &base_vertex, &pose, 1000.0, 1);
    }
    // And on their own base, which is quads and not welded, as the vertices stand.
    let base = read(&fs::read(folder.join("komon base.obj")).unwrap());
    for (file, _) in MD_POSES {
        let found = correspondence::recover(&base, &read(&fs::read(folder.join(file)).unwrap())).unwrap();
        assert!((0..14_585).eq(found.vertex_of), "{file}");
    }
}

/// A garment of the sample with these two targets, its base and obi in millimetres.
fn garment(base_name: &str, base: &str, targets: &[(&str, String)]) -> tempfile::TempDir {
    let assets = tempfile::tempdir().unwrap();
    let folder = assets.path().join("mine");
    fs::create_dir_all(folder.join("poses")).unwrap();
    fs::create_dir_all(assets.path().join("bodies")).unwrap();
    fs::copy(sample("../bodies/b04.glb"), assets.path().join("bodies/b04.glb")).unwrap();
    fs::write(folder.join(base_name), base).unwrap();
    fs::write(folder.join("obi.obj"), millimetres(&fs::read_to_string(sample("obi.obj")).unwrap(), 2)).unwrap();
    let table = fs::read_to_string(sample("poses.csv")).unwrap();
    let mut rows: Vec<String> = table.lines().take(2).map(str::to_owned).collect();
    rows[1] = rows[1].replace("base.obj", base_name);
    for (file, text) in targets {
        let row = table.lines().find(|row| row.contains(file.trim_start_matches("poses/"))).unwrap();
        rows.push(row.to_owned());
        fs::write(folder.join(file), text).unwrap();
    }
    fs::write(folder.join("poses.csv"), rows.join("\n")).unwrap();
    let manifest = fs::read_to_string(sample("garment.toml")).unwrap();
    let is_kept =
        |line: &&str| !["paths", "sizes", "rules", "texture", "mask", "#"].iter().any(|key| line.starts_with(key));
    let manifest: Vec<&str> = manifest.lines().filter(is_kept).collect();
    let manifest = manifest.join("\n").replace("unit = \"m\"", "unit = \"mm\"");
    fs::write(folder.join("garment.toml"), manifest.replace("\"base.obj\"", &format!("\"{base_name}\""))).unwrap();
    assets
}

fn millimetres(text: &str, decimals: usize) -> String {
    let line = |line: &str| match line.strip_prefix("v ") {
        Some(numbers) => {
            let number = |number: &str| format!(" {:.decimals$}", 1000.0 * number.parse::<f64>().unwrap());
            format!("v{}\n", numbers.split(' ').map(number).collect::<String>())
        }
        None => format!("{line}\n"),
    };
    text.lines().map(line).collect()
}

/// Each warning once per file, no errors, and the very same shapes.
#[test]
fn a_garment_of_such_exports_is_that_of_the_originals() {
    let (base, _) = komon();
    let base_text = millimetres(&fs::read_to_string(sample("base.obj")).unwrap(), 2);
    let originals: Vec<(&str, Mesh)> =
        MD_POSES.iter().map(|(_, file)| (*file, read(&fs::read(sample(file)).unwrap()))).collect();
    let written = |change: &dyn Fn(Cloth) -> Cloth, seed, is_textured| -> Vec<(&str, String)> {
        let text = |pose: &Mesh| change(Cloth::new(&base, pose)).text(seed, 1000.0, 2, is_textured).0;
        originals.iter().map(|(file, pose)| (*file, text(pose))).collect()
    };
    let straight: Vec<(&str, String)> =
        originals.iter().map(|(file, _)| (*file, millimetres(&fs::read_to_string(sample(file)).unwrap(), 2))).collect();
    let load = |base_name: &str, base: &str, targets: &[(&str, String)]| {
        let assets = garment(base_name, base, targets);
        let loaded = kitsuke_pipeline::load(&assets.path().join("mine"));
        let codes: Vec<String> = loaded.diagnostics.iter().map(|d| d.code.to_string()).collect();
        let errors: Vec<_> = loaded.diagnostics.iter().filter(|d| d.severity == Severity::Error).collect();
        assert!(errors.is_empty(), "{errors:?}");
        (loaded.garment.unwrap(), codes)
    };
    let (wanted, codes) = load("base.obj", &base_text, &straight);
    assert_eq!(codes, [""; 0]);
    let cases = [
        written(&|cloth| cloth.unwelded().faces_shuffled(), 31, true),
        written(&|cloth| cloth.pieces_reversed().renamed().unwelded(), 0, false),
    ];
    for targets in &cases {
        let (own, codes) = load("base.obj", &base_text, targets);
        assert_eq!(codes, ["recovered"; 2]);
        for (own, wanted) in own.targets.iter().zip(&wanted.targets) {
            assert_eq!(own.positions_m, wanted.positions_m);
        }
        assert_eq!(own.base, wanted.base);
    }
    let Some((folder, _)) = md_exports() else { return };
    let text = |file: &str| String::from_utf8(fs::read(folder.join(file)).unwrap()).unwrap();
    let targets: Vec<(&str, String)> = MD_POSES.iter().map(|(file, original)| (*original, text(file))).collect();
    let (own, codes) = load("base.obj", &base_text, &targets);
    assert_eq!(codes, ["recovered"; 2]);
    for (own, wanted) in own.targets.iter().zip(&wanted.targets) {
        // The original's decimals are of a tenth of a millimetre.
        let farthest = own.positions_m.iter().zip(&wanted.positions_m).map(|(a, b)| a.distance(*b)).fold(0.0, f32::max);
        assert!(farthest < 1e-4, "{}: {farthest}", own.file);
    }
    // Their own base: quads, hexagons, not welded.
    let (own, codes) = load("komon base.obj", &text("komon base.obj"), &targets);
    assert_eq!(codes, ["recovered"; 2]);
    assert_eq!(own.base.positions_m.len(), 14_585);
}

/// An export in another unit is put in order and then said to be too large.
#[test]
fn another_unit_is_said_besides() {
    let (base, pose) = komon();
    let base_text = millimetres(&fs::read_to_string(sample("base.obj")).unwrap(), 2);
    let in_metres = Cloth::new(&base, &pose).unwelded().text(0, 1.0, 5, true).0;
    let assets = garment("base.obj", &base_text, &[(MD_POSES[1].1, in_metres)]);
    let loaded = kitsuke_pipeline::load(&assets.path().join("mine"));
    let unit = loaded.diagnostics.iter().find(|d| d.code == "unit").expect("the unit is another");
    assert!(unit.problem.contains("about 1000 times as small as"), "{}", unit.problem);
    assert!(loaded.diagnostics.iter().any(|d| d.code == "recovered"));
}
