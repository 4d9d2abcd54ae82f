//! OBJ files as other programs write them, with right values from `../shared/data/reports`, through reader and check.

use kitsuke_pipeline::source::obj::{self, Mesh};
use std::fs;
use std::path::{Path, PathBuf};

fn shared(file: &str) -> Option<Vec<u8>> {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../shared/data/reports").join(file);
    if !path.exists() {
        println!("skipped: {} is absent", path.display());
        return None;
    }
    Some(fs::read(path).unwrap())
}

fn read(file: &str) -> Option<Mesh> {
    let bytes = shared(file)?;
    let mut report = Vec::new();
    let mesh = obj::read(file, &bytes, &mut report);
    Some(mesh.unwrap_or_else(|| panic!("{file}: {report:?}")))
}

fn faces_of_parts(mesh: &Mesh) -> Vec<usize> {
    (0..mesh.parts.len()).map(|part| mesh.faces.iter().filter(|face| face.part as usize == part).count()).collect()
}

#[test]
fn names_in_shift_jis_are_five_parts_of_twelve() {
    for (file, second) in [("names.obj", "左衽"), ("names_end_in_5c.obj", "")] {
        let Some(mesh) = read(&format!("sjis_groups/{file}")) else { return };
        assert_eq!(faces_of_parts(&mesh), [12; 5], "{file}");
        assert_eq!((mesh.faces.len(), mesh.positions.len()), (60, 100), "{file}");
        assert!(mesh.parts.iter().all(|name| !name.contains('\u{fffd}')), "{file}: {:?}", mesh.parts);
        match second {
            "" => assert_eq!(mesh.parts.iter().filter(|name| name.ends_with('表')).count(), 4, "{:?}", mesh.parts),
            _ => assert_eq!(mesh.parts, ["左袖", second, "右袖", "右衽", "衿"]),
        }
        assert_eq!(mesh.names_read_as.map(|(encoding, _)| encoding), Some("Shift_JIS"), "{file}");
    }
}

#[test]
fn comments_end_faces_too() {
    let Some(mesh) = read("face_comment/face_comment.obj") else { return };
    let corners: Vec<u32> = mesh.faces.iter().map(|face| face.corner_count).collect();
    assert_eq!((mesh.positions.len(), corners, mesh.parts.len()), (5, vec![4, 3], 2));
}

/// The small garment with other texts of its shapes, in a folder of its own.
fn damaged(change: impl Fn(&str, String) -> Vec<u8>) -> (tempfile::TempDir, PathBuf) {
    let garments = Path::new(env!("CARGO_MANIFEST_DIR")).join("garments");
    let copy = tempfile::tempdir().unwrap();
    let mut folders = vec![PathBuf::new()];
    while let Some(folder) = folders.pop() {
        fs::create_dir_all(copy.path().join(&folder)).unwrap();
        for entry in fs::read_dir(garments.join(&folder)).unwrap() {
            let entry = entry.unwrap();
            let place = folder.join(entry.file_name());
            if entry.file_type().unwrap().is_dir() {
                folders.push(place);
            } else if place.extension().is_some_and(|extension| extension == "obj") {
                let text = fs::read_to_string(entry.path()).unwrap();
                fs::write(copy.path().join(&place), change(&place.to_string_lossy(), text)).unwrap();
            } else {
                fs::copy(entry.path(), copy.path().join(&place)).unwrap();
            }
        }
    }
    let garment = copy.path().join("tube");
    (copy, garment)
}

/// A code, and a file with what is wrong with it.
type Message = (String, String);
/// A group's line, and the vertices of its faces.
type Group = (String, Vec<Vec<usize>>);

/// What `check` says, and the parts of the garment where it is sound.
fn said(garment: &Path) -> (Vec<Message>, Vec<(String, u32)>) {
    let loaded = kitsuke_pipeline::load(garment);
    let said =
        loaded.diagnostics.into_iter().map(|d| (d.code.into_owned(), format!("{}: {}", d.file, d.problem))).collect();
    let parts = loaded.garment.map_or_else(Vec::new, |garment| garment.base.parts);
    (said, parts.into_iter().map(|part| (part.name, part.triangle_count)).collect())
}

/// The names of the small garment's groups in Shift-JIS, some with 0x5C as their last byte.
fn japanese(text: &str) -> Vec<u8> {
    let names: [(&str, &[u8]); 3] = [
        ("g migoro", b"g \x90g\x8d\xa0\x95\x5c"),
        ("g sode_left", b"g \x8d\xb6\x91\xb3"),
        ("g sode_right", b"g \x89E\x91\xb3\x95\x5c"),
    ];
    let line = |line: &str| {
        let name = names.iter().find(|(name, _)| *name == line).map_or(line.as_bytes(), |(_, bytes)| bytes);
        [name, b"\n"].concat()
    };
    text.lines().flat_map(line).collect()
}

#[test]
fn a_garment_with_japanese_names_is_checked_whole() {
    let (_copy, garment) = damaged(|_, text| text.into_bytes());
    let (before, parts_before) = said(&garment);
    assert_eq!(before, []);
    let (_copy, garment) = damaged(|_, text| japanese(&text));
    let (said, parts) = said(&garment);
    assert_eq!(said.iter().map(|(code, _)| code.as_str()).collect::<Vec<_>>(), ["names-encoding"], "{said:?}");
    assert_eq!(parts.iter().map(|(name, _)| &**name).collect::<Vec<_>>(), ["身頃表", "左袖", "右袖表"]);
    let counts = |parts: &[(String, u32)]| parts.iter().map(|(_, count)| *count).collect::<Vec<_>>();
    assert_eq!(counts(&parts), counts(&parts_before));
}

/// Two triangles that share an edge, as quads.
fn as_quads(text: &str) -> String {
    let lines: Vec<&str> = text.lines().collect();
    let corners = |line: &str| -> Vec<String> { line.split(' ').skip(1).map(str::to_owned).collect() };
    let (mut i, mut quads) = (0, String::new());
    while i < lines.len() {
        let pair = lines.get(i + 1).filter(|next| lines[i].starts_with("f ") && next.starts_with("f "));
        let pair = pair.map(|next| (corners(lines[i]), corners(next)));
        match pair.filter(|(a, b)| a[1] == b[0] && a[2] == b[2]) {
            Some((a, b)) => {
                quads += &format!("f {} {} {} {}\n", a[0], a[1], b[1], a[2]);
                i += 2;
            }
            None => {
                quads += &format!("{}\n", lines[i]);
                i += 1;
            }
        }
    }
    quads
}

/// Vertex lines and faces with their vertices alone, by group.
fn taken_apart(text: &str) -> (Vec<String>, Vec<Group>) {
    let (mut vertices, mut groups) = (Vec::new(), Vec::new());
    for line in text.lines() {
        if line.starts_with("v ") {
            vertices.push(line.to_owned());
        } else if line.starts_with("g ") {
            groups.push((line.to_owned(), Vec::new()));
        } else if let Some(corners) = line.strip_prefix("f ") {
            let vertex = |corner: &str| corner.split('/').next().unwrap().parse::<usize>().unwrap() - 1;
            groups.last_mut().unwrap().1.push(corners.split(' ').map(vertex).collect());
        }
    }
    (vertices, groups)
}

/// The text of a mesh whose vertices stand in this order.
fn renumbered(vertices: &[String], groups: &[Group], order: &[usize]) -> String {
    let mut text: String = order.iter().map(|old| format!("{}\n", vertices[*old])).collect();
    for (name, faces) in groups {
        text += &format!("{name}\n");
        for face in faces {
            let new = |old: &usize| (order.iter().position(|o| o == old).unwrap() + 1).to_string();
            text += &format!("f {}\n", face.iter().map(new).collect::<Vec<_>>().join(" "));
        }
    }
    text
}

/// The groups by name, last first, each with its vertices behind one another.
fn as_blender(text: &str) -> String {
    let (vertices, mut groups) = taken_apart(text);
    groups.reverse();
    let mut order: Vec<usize> = Vec::new();
    for (_, faces) in &groups {
        let mut of_group = faces.concat();
        of_group.sort_unstable();
        order.extend(of_group.into_iter().filter(|v| !order.contains(v)).collect::<std::collections::BTreeSet<_>>());
    }
    renumbered(&vertices, &groups, &order)
}

fn as_trimesh(text: &str) -> String {
    let (vertices, groups) = taken_apart(text);
    let mut order: Vec<usize> = Vec::new();
    for vertex in groups.iter().flat_map(|(_, faces)| faces.concat()) {
        if !order.contains(&vertex) {
            order.push(vertex);
        }
    }
    renumbered(&vertices, &groups, &order)
}

fn as_vtk(text: &str) -> String {
    let (vertices, groups) = taken_apart(text);
    let faces: Vec<Vec<usize>> = groups.into_iter().flat_map(|(_, faces)| faces).collect();
    let mut written: String = faces.concat().iter().map(|vertex| format!("{}\n", vertices[*vertex])).collect();
    let mut next = 1;
    for face in faces {
        let corners: Vec<String> = (next..next + face.len()).map(|corner| corner.to_string()).collect();
        written += &format!("f {}\n", corners.join(" "));
        next += face.len();
    }
    written
}

/// Quads dropped; one triangle is left.
fn as_open3d(text: &str) -> String {
    text.lines()
        .filter(|line| !line.starts_with("f ") || line.split(' ').count() == 4)
        .map(|l| format!("{l}\n"))
        .collect()
}

fn as_triangles(text: &str) -> String {
    let line = |line: &str| match line.split(' ').collect::<Vec<_>>()[..] {
        ["f", a, b, c, d] => format!("f {a} {b} {c}\nf {a} {c} {d}\n"),
        _ => format!("{line}\n"),
    };
    text.lines().map(line).collect()
}

/// Each face begun at its second corner.
fn as_meshlab(text: &str) -> String {
    let line = |line: &str| match line.strip_prefix("f ").and_then(|corners| corners.split_once(' ')) {
        Some((first, others)) => format!("f {others} {first}\n"),
        None => format!("{line}\n"),
    };
    text.lines().map(line).collect()
}

#[test]
fn programs_are_named_that_renumber_a_target() {
    let target = "poses/01_right_down.obj";
    type Case = (&'static str, fn(&str) -> String, Option<(&'static str, &'static str)>);
    let cases: [Case; 6] = [
        ("blender", as_blender, Some(("faces", "Blender"))),
        ("trimesh", as_trimesh, Some(("faces", "trimesh and tobj"))),
        ("vtk", as_vtk, Some(("unwelded", "VTK"))),
        ("open3d", as_open3d, Some(("faces", "open3d"))),
        ("triangles", as_triangles, Some(("faces", "cut into triangles"))),
        ("meshlab", as_meshlab, None),
    ];
    for (program, written_by, expected) in cases {
        // One triangle stays in all files, so that open3d leaves something.
        let quads = |text: String| as_quads(&text.replacen("\nf ", "\n#\nf ", 2));
        let (_copy, garment) = damaged(|file, text| {
            let text = quads(text);
            if file.ends_with(target) { written_by(&text) } else { text }.into_bytes()
        });
        let (said, _) = said(&garment);
        match expected {
            None => assert_eq!(said, [], "{program}"),
            Some((code, name)) => {
                assert_eq!(
                    said.iter().map(|(code, _)| code.as_str()).collect::<Vec<_>>(),
                    [code],
                    "{program}: {said:?}"
                );
                assert!(said[0].1.contains(target) && said[0].1.contains(name), "{program}: {said:?}");
            }
        }
    }
}

#[test]
fn a_face_lost_in_all_files_is_found() {
    let (_copy, garment) = damaged(|file, text| {
        let all: Vec<&str> = text.lines().collect();
        let faces: Vec<usize> = (0..all.len()).filter(|i| all[*i].starts_with("f ")).collect();
        let lost = if file.ends_with("obi.obj") { usize::MAX } else { faces[30] };
        let left: Vec<&str> = (0..all.len()).filter(|i| *i != lost).map(|i| all[i]).collect();
        left.join("\n").into_bytes()
    });
    let (said, parts) = said(&garment);
    assert_eq!(said.iter().map(|(code, _)| code.as_str()).collect::<Vec<_>>(), ["lost-face"], "{said:?}");
    assert!(!parts.is_empty(), "a warning, no error");
}
