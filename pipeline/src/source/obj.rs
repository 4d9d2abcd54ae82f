//! OBJ meshes in the file's own vertex order, each element with its line. Reads `v`, `vt`, `f`, `g` and `o`; materials,
//! normals, colours and curves are passed over. Knows no unit and no garment.
//!
//! Everything of a garment (targets, masks, paths) is keyed by the number of a `v` line, and every message needs the
//! line, hence a reader of our own instead of an importer that renumbers; the tests hold it against ufbx.

use crate::diagnostic::{Diagnostic, Place};
use glam::{DVec2, DVec3, Vec2};
use kitsuke::arrays::limits;
use std::borrow::Cow;

/// Most corners of one polygon.
const CORNERS: usize = 1024;
/// Name of the part of faces before any `g` or `o`.
const UNNAMED_PART: &str = "default";

/// A polygon mesh as it stands in the file.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Mesh {
    /// Positions in the file's unit and axes, one per `v` line.
    pub positions: Vec<DVec3>,
    /// The line of each position.
    pub position_lines: Vec<u32>,
    /// Texture coordinates, one per `vt` line.
    pub uv: Vec<Vec2>,
    /// Polygons in file order.
    pub faces: Vec<Face>,
    /// Vertex and texture-coordinate index of every corner of every polygon.
    pub corners: Vec<Corner>,
    /// Names of the parts, by first appearance: the group's name, or the object's where there is no group.
    pub parts: Vec<String>,
}

/// One polygon of 3 or more corners.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Face {
    /// The line.
    pub line: u32,
    /// Its first corner.
    pub first_corner: u32,
    /// How many.
    pub corner_count: u32,
    /// Its part.
    pub part: u32,
}

/// One corner of a polygon.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct Corner {
    /// Index of the position.
    pub vertex: u32,
    /// Index of the texture coordinate, if it has one.
    pub uv: Option<u32>,
}

/// The triangles of a [`Mesh`], grouped by part.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Triangles {
    /// The corners.
    pub corners: Vec<[Corner; 3]>,
    /// The polygon of each triangle.
    pub faces: Vec<u32>,
    /// How many triangles each of the mesh's parts has.
    pub part_counts: Vec<u32>,
}

impl Mesh {
    /// The corners of a polygon.
    #[must_use]
    pub fn corners_of(&self, face: &Face) -> &[Corner] {
        &self.corners[face.first_corner as usize..][..face.corner_count as usize]
    }

    /// Whether every corner has a texture coordinate.
    #[must_use]
    pub fn is_textured(&self) -> bool {
        !self.corners.is_empty() && self.corners.iter().all(|corner| corner.uv.is_some())
    }

    /// Cuts the polygons into triangles, those of one part together, otherwise in file order.
    #[must_use]
    pub fn triangulate(&self) -> Triangles {
        let mut triangles: Vec<(u32, u32, [Corner; 3])> = Vec::with_capacity(self.faces.len());
        for (number, face) in self.faces.iter().enumerate() {
            let corners = self.corners_of(face);
            let points: Vec<DVec3> = corners.iter().map(|corner| self.positions[corner.vertex as usize]).collect();
            let cut = cut_polygon(&points).into_iter();
            triangles.extend(cut.map(|triangle| (face.part, number as u32, triangle.map(|i| corners[i]))));
        }
        triangles.sort_by_key(|(part, ..)| *part);
        let mut part_counts = vec![0; self.parts.len()];
        for (part, ..) in &triangles {
            part_counts[*part as usize] += 1;
        }
        let faces = triangles.iter().map(|(_, face, _)| *face).collect();
        Triangles { corners: triangles.into_iter().map(|(.., corners)| corners).collect(), faces, part_counts }
    }
}

/// Triangulates a polygon in space, concave ones too, by cutting ears in the plane of its area vector. Always gives
/// `points.len() - 2` triangles with the polygon's orientation; those of a polygon that crosses itself may overlap.
fn cut_polygon(points: &[DVec3]) -> Vec<[usize; 3]> {
    if points.len() == 3 {
        return vec![[0, 1, 2]];
    }
    let normal: DVec3 = (0..points.len()).map(|i| points[i].cross(points[(i + 1) % points.len()])).sum();
    let Some(normal) = normal.try_normalize() else {
        return (1..points.len() - 1).map(|i| [0, i, i + 1]).collect();
    };
    let (right, up) = normal.any_orthonormal_pair();
    let flat: Vec<DVec2> = points.iter().map(|p| DVec2::new(p.dot(right), p.dot(up))).collect();
    let turn = |a: usize, b: usize, c: usize| (flat[b] - flat[a]).perp_dot(flat[c] - flat[a]);
    let mut ring: Vec<usize> = (0..points.len()).collect();
    let mut triangles = Vec::with_capacity(points.len() - 2);
    while ring.len() > 3 {
        let n = ring.len();
        let ear = |&i: &usize| {
            let [a, b, c] = [ring[(i + n - 1) % n], ring[i], ring[(i + 1) % n]];
            let is_inside = |&p: &usize| turn(a, b, p) >= 0.0 && turn(b, c, p) >= 0.0 && turn(c, a, p) >= 0.0;
            let is_other = |p: &&usize| ![a, b, c].contains(p) && ![flat[a], flat[b], flat[c]].contains(&flat[**p]);
            turn(a, b, c) > 0.0 && !ring.iter().filter(is_other).any(is_inside)
        };
        // Start at the second corner, so that a convex polygon becomes the fan about its first corner.
        let i = (1..n).chain([0]).find(ear).unwrap_or(1);
        triangles.push([ring[(i + n - 1) % n], ring[i], ring[(i + 1) % n]]);
        ring.remove(i);
    }
    triangles.push([ring[0], ring[1], ring[2]]);
    triangles
}

/// Reads a mesh; reports every line that cannot be understood.
pub fn read(file: &str, bytes: &[u8], report: &mut Vec<Diagnostic>) -> Option<Mesh> {
    let before = report.len();
    if let Some(problem) = foreign_content(bytes) {
        report.push(
            Diagnostic::error("obj-encoding", file, Place::File)
                .problem(problem)
                .help("Export the shape as Wavefront OBJ, a text file in UTF-8."),
        );
        return None;
    }
    let mut reader = Reader { file, report, mesh: Mesh::default(), group: None, object: None, part: None };
    for (line, text) in logical_lines(bytes) {
        let text = String::from_utf8_lossy(&text);
        reader.statement(line, &text);
        if reader.mesh.positions.len() > limits::VERTICES || reader.mesh.faces.len() > limits::TRIANGLES {
            reader.refuse(
                "obj-limit",
                line,
                "the mesh is larger than 4,194,304 vertices or 8,388,608 faces".to_owned(),
            );
            return None;
        }
    }
    let mesh = reader.finish();
    (report.len() == before).then_some(mesh)
}

/// Says what a file is that is no OBJ text.
fn foreign_content(bytes: &[u8]) -> Option<&'static str> {
    match bytes {
        [0xff, 0xfe, ..] | [0xfe, 0xff, ..] => Some("the file is UTF-16 text"),
        _ if bytes.starts_with(b"Kaydara FBX") => Some("the file is an FBX scene, not OBJ"),
        _ if bytes.starts_with(b"PK\x03\x04") => Some("the file is an archive (a ZPRJ or ZIP), not OBJ"),
        _ if bytes.starts_with(b"glTF") => Some("the file is a GLB scene, not OBJ"),
        _ if bytes.iter().take(4096).any(|&byte| byte == 0) => Some("the file is binary, or UTF-16 text, not OBJ"),
        _ => None,
    }
}

/// The statements with their 1-based first lines: a `\` at a line's end joins the next line.
fn logical_lines(bytes: &[u8]) -> impl Iterator<Item = (u32, Cow<'_, [u8]>)> {
    let bytes = bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes);
    let mut lines = bytes.split(|&byte| byte == b'\n').map(|line| line.strip_suffix(b"\r").unwrap_or(line)).zip(1u32..);
    std::iter::from_fn(move || {
        let (line, number) = lines.next()?;
        let mut whole = Cow::Borrowed(line);
        while let Some(start) = whole.strip_suffix(b"\\") {
            let mut joined = start.to_vec();
            joined.push(b' ');
            let next = lines.next();
            joined.extend_from_slice(next.map_or(&b""[..], |(line, _)| line));
            whole = Cow::Owned(joined);
        }
        Some((number, whole))
    })
}

struct Reader<'a> {
    file: &'a str,
    report: &'a mut Vec<Diagnostic>,
    mesh: Mesh,
    group: Option<String>,
    object: Option<String>,
    /// Part of the faces that follow; found anew after each `g` and `o`.
    part: Option<u32>,
}

impl Reader<'_> {
    fn refuse(&mut self, code: &'static str, line: u32, problem: String) {
        let help = match code {
            "obj-number" => "Export the shape again; every number must be finite.",
            "obj-face" => "Export the shape again; a face needs three or more corners that name vertices of the file.",
            _ => "Export a lighter mesh.",
        };
        self.report.push(Diagnostic::error(code, self.file, Place::Line(line)).problem(problem).help(help));
    }

    fn statement(&mut self, line: u32, text: &str) {
        let text = text.trim();
        let (keyword, rest) = text.split_once([' ', '\t']).unwrap_or((text, ""));
        match keyword {
            "v" => {
                let position = self.numbers::<3>(line, rest, 3).unwrap_or_default();
                self.mesh.positions.push(DVec3::from_array(position));
                self.mesh.position_lines.push(line);
            }
            "vt" => {
                let [u, v] = self.numbers::<2>(line, rest, 1).unwrap_or_default();
                self.mesh.uv.push(Vec2::new(u as f32, v as f32));
            }
            "f" => self.face(line, rest),
            "g" | "o" => {
                let name = Some(rest.trim()).filter(|name| !name.is_empty()).map(str::to_owned);
                *(if keyword == "g" { &mut self.group } else { &mut self.object }) = name;
                self.part = None;
            }
            _ => {}
        }
    }

    /// The first `N` numbers of a line, of which `required` must stand there; the others are 0.
    fn numbers<const N: usize>(&mut self, line: u32, text: &str, required: usize) -> Option<[f64; N]> {
        let mut numbers = [0.0; N];
        let mut words = text.split_ascii_whitespace();
        for (i, number) in numbers.iter_mut().enumerate() {
            let Some(word) = words.next() else {
                if i < required {
                    self.refuse("obj-number", line, format!("{required} numbers are needed here, there are {i}"));
                    return None;
                }
                break;
            };
            match word.parse::<f64>() {
                Ok(parsed) if parsed.is_finite() => *number = parsed,
                _ => {
                    self.refuse("obj-number", line, format!("`{}` is no finite number", shortened(word)));
                    return None;
                }
            }
        }
        Some(numbers)
    }

    fn face(&mut self, line: u32, text: &str) {
        let first_corner = self.mesh.corners.len();
        for word in text.split_ascii_whitespace() {
            match self.corner(word) {
                Ok(corner) => self.mesh.corners.push(corner),
                Err(problem) => {
                    self.mesh.corners.truncate(first_corner);
                    return self.refuse("obj-face", line, problem);
                }
            }
        }
        let corner_count = self.mesh.corners.len() - first_corner;
        if !(3..=CORNERS).contains(&corner_count) {
            self.mesh.corners.truncate(first_corner);
            return self.refuse("obj-face", line, format!("a face of {corner_count} corners"));
        }
        let part = self.current_part();
        let (first_corner, corner_count) = (first_corner as u32, corner_count as u32);
        self.mesh.faces.push(Face { line, first_corner, corner_count, part });
    }

    /// `v`, `v/vt`, `v//vn` or `v/vt/vn`. Numbers count from 1, or backwards from the last element so far; whether a
    /// forward reference exists shows at the end of the file.
    fn corner(&self, word: &str) -> Result<Corner, String> {
        let mut indices = word.split('/');
        let vertex = indices.next().unwrap_or_default();
        let index = |text: &str, count: usize| {
            let number: i64 = text.parse().map_err(|_| format!("`{}` is no corner", shortened(word)))?;
            let index = if number < 0 { count as i64 + number } else { number - 1 };
            u32::try_from(index).map_err(|_| format!("there is no element {number} before this line"))
        };
        let uv = indices.next().filter(|uv| !uv.is_empty());
        Ok(Corner {
            vertex: index(vertex, self.mesh.positions.len())?,
            uv: uv.map(|uv| index(uv, self.mesh.uv.len())).transpose()?,
        })
    }

    fn current_part(&mut self) -> u32 {
        if let Some(part) = self.part {
            return part;
        }
        let name = self.group.as_ref().or(self.object.as_ref()).map_or(UNNAMED_PART, String::as_str);
        let parts = &mut self.mesh.parts;
        let part = parts.iter().position(|known| known == name).unwrap_or_else(|| {
            parts.push(name.to_owned());
            parts.len() - 1
        });
        self.part = Some(part as u32);
        part as u32
    }

    /// Checks the indices, which may point forward, against the whole file.
    fn finish(mut self) -> Mesh {
        let (vertices, uvs) = (self.mesh.positions.len(), self.mesh.uv.len());
        let mut broken = Vec::new();
        for face in &self.mesh.faces {
            for corner in self.mesh.corners_of(face) {
                if corner.vertex as usize >= vertices {
                    broken
                        .push((face.line, format!("vertex {} is named, but there are {vertices}", corner.vertex + 1)));
                }
                if let Some(uv) = corner.uv.filter(|&uv| uv as usize >= uvs) {
                    broken.push((face.line, format!("texture coordinate {} is named, but there are {uvs}", uv + 1)));
                }
            }
        }
        for (line, problem) in broken {
            self.refuse("obj-face", line, problem);
        }
        self.mesh
    }
}

fn shortened(word: &str) -> String {
    let mut short: String = word.chars().take(24).collect();
    if short.len() < word.len() {
        short.push('…');
    }
    short
}

#[cfg(test)]
#[allow(clippy::print_stdout)]
mod tests {
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
        let mesh = read_text(&format!(
            "{SQUARE}f 1 2 3\ng sode left\nf 1 2 4\ng\nf 2 3 4\no eri\nf 3 4 1\ng sode left\nf 1 3 4"
        ))
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
            assert_eq!((report[0].code, &report[0].place), (code, &Place::Line(line)), "{text}: {report:?}");
        };
        check("v 0 0 0\nv 1 nan 0\n", "obj-number", 2);
        check("v 0 0 0\nv 1 -1.#IND 0\n", "obj-number", 2);
        check("v 0 0\n", "obj-number", 1);
        check("v 1e999 0 0\n", "obj-number", 1);
        check(&format!("{SQUARE}f 1 2 5"), "obj-face", 5);
        check(&format!("{SQUARE}f 1 2 0"), "obj-face", 5);
        check(&format!("{SQUARE}f 1 2 -5"), "obj-face", 5);
        check(&format!("{SQUARE}f 1/1 2/1 3/1"), "obj-face", 5);
        check(&format!("{SQUARE}f 1 2"), "obj-face", 5);
        check(&format!("{SQUARE}f 1 2 99999999999999999999"), "obj-face", 5);
        check(&format!("{SQUARE}\\\n\\\nf 1 2 x"), "obj-face", 5);
        assert_eq!(read_bytes(b"\xff\xfev\0 \0").unwrap_err()[0].code, "obj-encoding");
        assert_eq!(read_bytes(b"Kaydara FBX Binary  ").unwrap_err()[0].code, "obj-encoding");
    }

    /// All `v` lines, read by the shortest possible code.
    fn naive_positions(text: &str) -> Vec<DVec3> {
        let numbers =
            |line: &str| line.split_whitespace().skip(1).map(|word| word.parse().unwrap()).collect::<Vec<f64>>();
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

    proptest! {
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
}
