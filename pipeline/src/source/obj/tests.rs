//! The reader against files of other projects, ufbx, and the shortest possible reader.

use super::*;
use proptest::prelude::*;
use std::path::{Path, PathBuf};

fn read_text(text: &str) -> Result<Mesh, Vec<Diagnostic>> {
    read_bytes(text.as_bytes())
}

fn read_bytes(bytes: &[u8]) -> Result<Mesh, Vec<Diagnostic>> {
    let mut report = Vec::new();
    read("test.obj", bytes, &mut report).ok_or(report)
}

const SQUARE: &str = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\n";

fn triangles(faces: &str) -> Vec<[u32; 3]> {
    let mesh = read_text(&format!("{SQUARE}{faces}")).unwrap();
    mesh.triangulate().corners.iter().map(|corners| corners.map(|corner| corner.vertex)).collect()
}

#[test]
fn faces_in_every_spelling() {
    for face in ["f 1 2 3 4", "f 1/ 2/ 3/ 4/", "f 1//9 2//9 3//9 4//9", "f -4 -3 -2 -1", "f\t1 2 \\\n 3 4\r"] {
        assert_eq!(triangles(face), [[0, 1, 2], [0, 2, 3]], "{face}");
    }
}

#[test]
fn parts_are_runs_of_triangles_even_when_a_group_recurs() {
    let mesh =
        read_text(&format!("{SQUARE}f 1 2 3\ng sode left\nf 1 2 4\ng\nf 2 3 4\no eri\nf 3 4 1\ng sode left\nf 1 3 4"))
            .unwrap();
    assert_eq!(mesh.parts, ["default", "sode left", "eri"]);
    let triangles = mesh.triangulate();
    assert_eq!(triangles.part_counts, [2, 2, 1]);
    assert_eq!(triangles.faces, [0, 2, 1, 4, 3]);
}

#[test]
fn a_concave_polygon_is_cut_inside() {
    // An arrow head whose fan about the first corner would leave it.
    let mesh = read_text("v 0 0 0\nv 4 -3 0\nv 1 0 0\nv 4 3 0\nf 2 3 4 1").unwrap();
    let area = |corners: &[Corner; 3]| {
        let [a, b, c] = corners.map(|corner| mesh.positions[corner.vertex as usize]);
        (b - a).cross(c - a).z / 2.0
    };
    let areas: Vec<f64> = mesh.triangulate().corners.iter().map(area).collect();
    assert!(areas.iter().all(|area| *area > 0.0), "{areas:?}");
    assert!((areas.iter().sum::<f64>() - 3.0).abs() < 1e-12, "{areas:?}");
}

#[test]
fn mistakes_name_their_lines() {
    let check = |text: &str, code: &str, line: u32| {
        let report = read_text(text).unwrap_err();
        assert_eq!((&*report[0].code, &report[0].place), (code, &Place::Line(line)), "{text}: {report:?}");
    };
    check("v 0 0 0\nv 1 nan 0\n", "obj-number", 2);
    check("v 0 0 0\nv 1 -1.#IND 0\n", "obj-number", 2);
    check("v 0 0 1.#INF\n", "obj-number", 1);
    check("v 0 0\n", "obj-number", 1);
    check("v 1e999 0 0\n", "obj-number", 1);
    check(&format!("{SQUARE}f 1 2 5"), "obj-face", 5);
    check(&format!("{SQUARE}f 1 2 0"), "obj-face", 5);
    check(&format!("{SQUARE}f 1 2 -5"), "obj-face", 5);
    check(&format!("{SQUARE}f 1/1 2/1 3/1"), "obj-face", 5);
    check(&format!("{SQUARE}f 1 2"), "obj-face", 5);
    check(&format!("{SQUARE}f 1 2 99999999999999999999"), "obj-face", 5);
    check(&format!("{SQUARE}\\\n\\\nf 1 2 x"), "obj-face", 7);
    assert_eq!(read_bytes(b"\xff\xfev\0 \0").unwrap_err()[0].code, "obj-encoding");
    assert_eq!(read_bytes(b"Kaydara FBX Binary  ").unwrap_err()[0].code, "obj-encoding");
    assert!(read_bytes(SQUARE.replace('\n', "\r").as_bytes()).unwrap_err()[0].problem.contains("CR alone"));
}

/// All `v` lines, read by the shortest possible code.
fn naive_positions(text: &str) -> Vec<DVec3> {
    let numbers = |line: &str| line.split_whitespace().skip(1).map(|word| word.parse().unwrap()).collect::<Vec<f64>>();
    text.lines().filter(|line| line.starts_with("v ")).map(|line| DVec3::from_slice(&numbers(line))).collect()
}

#[test]
fn the_sample_keeps_its_vertex_order_and_agrees_with_ufbx() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../assets-src/komon/base.obj");
    let text = std::fs::read_to_string(path).unwrap();
    let mesh = read_text(&text).unwrap();
    assert_eq!(mesh.positions, naive_positions(&text));
    assert_eq!(mesh.parts.len(), 7);

    let options = ufbx::LoadOpts { obj_merge_objects: true, obj_merge_groups: true, ..Default::default() };
    let scene = ufbx::load_memory(text.as_bytes(), options).unwrap();
    let other = &scene.meshes[0];
    let place = |p: &ufbx::Vec3| DVec3::new(p.x, p.y, p.z);
    assert_eq!(mesh.positions, other.vertices.iter().map(place).collect::<Vec<_>>());
    assert_eq!(mesh.corners.iter().map(|c| c.vertex).collect::<Vec<_>>(), other.vertex_indices.to_vec());
    let texture_coordinate = |corner: &Corner| mesh.uv[corner.uv.unwrap() as usize];
    let same = (0..mesh.corners.len()).all(|i| {
        let uv = other.vertex_uv[i];
        texture_coordinate(&mesh.corners[i]) == Vec2::new(uv.x as f32, uv.y as f32)
    });
    assert!(same, "texture coordinates differ from ufbx's");
}

fn shared(folder: &str) -> Option<PathBuf> {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../shared/data").join(folder);
    if !path.exists() {
        println!("skipped: {} is absent", path.display());
    }
    path.exists().then_some(path)
}

/// Odd files of other projects: how many vertices, faces and triangles each gives, or the code of its first error.
#[test]
fn odd_files_load_in_order_or_are_refused() {
    let Some(folder) = shared("obj_quirks") else { return };
    let mut paths: Vec<PathBuf> = ["assimp", "trimesh", "ufbx"]
        .iter()
        .flat_map(|project| std::fs::read_dir(folder.join(project)).unwrap())
        .map(|entry| entry.unwrap().path())
        .filter(|path| path.extension().is_some_and(|extension| extension == "obj"))
        .collect();
    paths.sort();
    let mut summary = String::new();
    for path in paths {
        let bytes = std::fs::read(&path).unwrap();
        let said = match read_bytes(&bytes) {
            Ok(mesh) => {
                let is_vertex = |line: &&[u8]| line.trim_ascii_start().starts_with(b"v ");
                let lines = bytes.split(|byte| *byte == b'\n').filter(is_vertex).count();
                assert_eq!(mesh.positions.len(), lines, "{}", path.display());
                let triangles = mesh.triangulate();
                let wanted: usize = mesh.faces.iter().map(|face| face.corner_count as usize - 2).sum();
                assert_eq!(triangles.corners.len(), wanted, "{}", path.display());
                let parts = mesh.parts.len();
                format!("{lines} vertices, {} faces, {wanted} triangles, {parts} parts", mesh.faces.len())
            }
            Err(report) => format!("{}: {}", report[0].code, report[0].problem),
        };
        summary += &format!("{}: {said}\n", path.file_name().unwrap().to_string_lossy());
    }
    assert_eq!(summary, include_str!("odd_obj_files.txt"));
}

#[test]
fn only_numbers_go_on_in_the_next_line() {
    let mesh = read_text(
        "# left \\\ng sode\\\nv 0 0 \\\n 0\nv\\\n1 0 0\nvn 0 0 \\\n1\nv 1 1 0 # \\\nmtllib a\\\nv 0 1 0 #x\nusemtl b\\\n\
         f 1 2 \\\r\n3 # 4 \\\nf 1/1 3/1 4/1# last\nvt 0 # 1\no eri # right\nf 1 2 3 4\ng part#2 #\nf 1 2 3",
    )
    .unwrap();
    assert_eq!(mesh.positions.len(), 4);
    assert_eq!(mesh.position_lines, [3, 5, 9, 11]);
    assert_eq!(
        mesh.faces.iter().map(|face| (face.line, face.corner_count, face.part)).collect::<Vec<_>>(),
        [(13, 3, 0), (15, 3, 0), (18, 4, 0), (20, 3, 1)]
    );
    assert_eq!((mesh.uv.len(), mesh.normal_count), (1, 1));
    // A group's name goes before the object's.
    assert_eq!(mesh.parts, ["sode\\", "part#2"]);
}

#[test]
fn names_of_other_bytes_are_other_parts_or_refused() {
    // 左 and 右 in Shift-JIS, whose bytes are replacement characters in UTF-8.
    let faces = |names: [&[u8]; 2]| {
        let [a, b] = names;
        [SQUARE.as_bytes(), b"g ", a, b"\nf 1 2 3\ng ", b, b"\nf 1 3 4\n"].concat()
    };
    let mesh = read_bytes(&faces([b"\x8d\xb6", b"\x89E"])).unwrap();
    assert_eq!(mesh.parts, ["左", "右"]);
    assert_eq!(mesh.names_read_as, Some(("Shift_JIS", 5)));
    // Two codes of one character.
    let report = read_bytes(&faces([b"\x8d\xb6\x81\xe6", b"\x8d\xb6\x87\x9a"])).unwrap_err();
    assert_eq!((&*report[0].code, &report[0].place), ("obj-names", &Place::Line(7)), "{report:?}");
    let report = read_bytes(&faces([b"\x8d\xb6", b"\x81"])).unwrap_err();
    assert_eq!((&*report[0].code, &report[0].place), ("obj-names", &Place::Line(7)), "{report:?}");
}

#[test]
fn a_text_is_the_same_in_blocks_of_any_size() {
    // Statements and a comment that are longer than the least block, lines that go on at any place, relative indices.
    let mut text = format!("{SQUARE}# {}\nv 1 2 {} 3\n", "long ".repeat(3000), "\\\r\n ".repeat(3000));
    for i in 0..2000 {
        text += &format!("g {}\\\nv {i} 0 {}0\nf -1 -2 \\\n{} # \\\n", i / 500, "\\\n".repeat(i % 3), i + 1);
    }
    let whole = read_in_pieces("test.obj", text.as_bytes(), text.len(), &mut Vec::new()).unwrap().unwrap();
    assert_eq!((whole.positions.len(), whole.faces.len(), whole.parts.len()), (2005, 2000, 4));
    assert_eq!(as_naive(&whole), naive(&text.replace('\r', "")));
    for piece_bytes in [1, 100, 1000, PIECE_BYTES] {
        let read = read_in_pieces("test.obj", text.as_bytes(), piece_bytes, &mut Vec::new()).unwrap().unwrap();
        assert_eq!(read, whole, "{piece_bytes}");
    }
}

/// Vertices and texture coordinates of the corners, and the name of the part.
type NaiveFace = (Vec<(usize, Option<usize>)>, String);

/// What the simplest code makes of a text without mistakes: lines that go on are joined first, then split at blanks.
fn naive(text: &str) -> (Vec<DVec3>, Vec<Vec2>, Vec<NaiveFace>) {
    let (mut positions, mut uv, mut faces) = (Vec::new(), Vec::new(), Vec::new());
    let (mut group, mut object) = (String::new(), String::new());
    let mut lines = text.split('\n');
    while let Some(line) = lines.next() {
        let keyword = line.split_whitespace().next().unwrap_or_default().trim_end_matches('\\').to_owned();
        let mut line = line.to_owned();
        while ["v", "vt", "vn", "f", "l", "p"].contains(&&*keyword) && line.ends_with('\\') && !line.contains('#') {
            line.pop();
            line = format!("{line} {}", lines.next().unwrap_or_default());
        }
        let words: Vec<&str> = line.split('#').next().unwrap().split_whitespace().skip(1).collect();
        let numbers = || words.iter().map(|word| word.parse().unwrap()).chain([0.0; 3]).collect::<Vec<f64>>();
        match &*keyword {
            "v" => positions.push(DVec3::from_slice(&numbers())),
            "vt" => uv.push(Vec2::new(numbers()[0] as f32, numbers()[1] as f32)),
            "g" => group = words.join(" "),
            "o" => object = words.join(" "),
            "f" => {
                let index = |word: &str, count: usize| match word.parse::<i64>().unwrap() {
                    number @ ..0 => (count as i64 + number) as usize,
                    number => number as usize - 1,
                };
                let corner = |word: &&str| {
                    let mut indices = word.split('/');
                    let vertex = index(indices.next().unwrap(), positions.len());
                    (vertex, indices.next().filter(|text| !text.is_empty()).map(|text| index(text, uv.len())))
                };
                let name = [&*group, &*object, "default"].into_iter().find(|name| !name.is_empty()).unwrap();
                faces.push((words.iter().map(corner).collect(), name.to_owned()));
            }
            _ => {}
        }
    }
    (positions, uv, faces)
}

fn as_naive(mesh: &Mesh) -> (Vec<DVec3>, Vec<Vec2>, Vec<NaiveFace>) {
    let corner = |corner: &Corner| (corner.vertex as usize, corner.uv.map(|uv| uv as usize));
    let face =
        |face: &Face| (mesh.corners_of(face).iter().map(corner).collect(), mesh.parts[face.part as usize].clone());
    (mesh.positions.clone(), mesh.uv.clone(), mesh.faces.iter().map(face).collect())
}

proptest! {
    /// Whatever the pieces in which it is read, a text gives what the simplest reader makes of it, line by line.
    #[test]
    fn pieces_of_any_size_give_what_the_simplest_reader_gives(
        statements in prop::collection::vec(
            "(v( -?[0-9]{1,3}(\\.[0-9]{1,3})?(e-?[0-9])?( \\\\\n)?){3}|vt( [0-9]\\.[0-9]){2}|vn 0 0 1|\
              f( -?[12](/-?[12](/-?[0-9])?|//[0-9])?( \\\\\n)?){3,5}|[go] ?[ab#]{0,2}|usemtl x\\\\)( ?#[ -~]{0,3}\\\\?)?",
            0..40
        ),
        piece_bytes in 1..200_usize
    ) {
        let text = format!("v 0 0 0\nv 1 0 0\nvt 0 0\nvt 1 0\n{}", statements.join("\n"));
        let mut report = Vec::new();
        let mesh = read_in_pieces("test.obj", text.as_bytes(), piece_bytes, &mut report).unwrap();
        prop_assert_eq!(&mesh, &read_bytes(text.as_bytes()).ok());
        let mesh = mesh.unwrap_or_else(|| panic!("{text}: {report:?}"));
        // `#` within a name is the one thing that the simplest reader does not know.
        if !statements.iter().any(|statement| statement.starts_with(['g', 'o']) && statement.contains('#')) {
            prop_assert_eq!(as_naive(&mesh), naive(&text));
        }
    }

    #[test]
    fn any_bytes_are_read_or_refused(bytes in prop::collection::vec(any::<u8>(), 0..400)) {
        let _ = read_bytes(&bytes);
    }

    #[test]
    fn any_statements_are_read_or_refused(
        statements in prop::collection::vec("(v|vt|f|g|o)( -?[0-9]{1,2}(/[0-9]?)?){0,7}( \\\\)?", 0..40)
    ) {
        if let Ok(mesh) = read_text(&statements.join("\n")) {
            let triangles = mesh.triangulate();
            let count = mesh.positions.len();
            prop_assert!(triangles.corners.iter().flatten().all(|corner| (corner.vertex as usize) < count));
        }
    }
}
