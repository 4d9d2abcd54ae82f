//! Gaps in cloth of the size of one face: where a face was lost in all files alike, no comparison shows it. Knows no
//! units; what is meant to be open (hems, sleeves) is larger or bends otherwise.

use super::signature::piece_of_vertices;
use crate::source::obj::Mesh;
use glam::DVec3;
use std::collections::BTreeMap;
use std::f64::consts::{PI, TAU};

/// How far from flat the angles about a vertex may be in which the lost face would lie, radians.
const BEND: f64 = 0.6;
/// The widest angle of a lost face, radians: along an even border three vertices lie in line.
const WIDEST: f64 = 2.2;
/// A gap is at most so many times as large as the largest face of its piece.
const AREA: f64 = 1.5;
/// Pieces of fewer faces than this are too small to be called closed but for a gap.
const LEAST_FACES: usize = 5;

/// The vertices about each gap that one lost face would leave: a hole in flat cloth, a notch in an even border, the only
/// opening of a piece.
pub(super) fn find(mesh: &Mesh) -> Vec<Vec<u32>> {
    let next = open_edges(mesh);
    if next.is_empty() {
        return Vec::new();
    }
    let (piece_of, angles) = (piece_of_vertices(mesh), angles(mesh, &next));
    let mut pieces: BTreeMap<u32, Piece> = BTreeMap::new();
    for face in &mesh.faces {
        let vertices: Vec<u32> = mesh.corners_of(face).iter().map(|corner| corner.vertex).collect();
        let piece = pieces.entry(piece_of[vertices[0] as usize]).or_default();
        piece.face_count += 1;
        piece.largest = piece.largest.max(area(mesh, &vertices));
    }
    for (from, following) in &next {
        pieces.entry(piece_of[*from as usize]).or_default().open_count += following.len();
    }
    let after = |vertex: &u32| next.get(vertex).map_or(&[][..], Vec::as_slice);
    // Angles about the vertices were the face there, against those in flat cloth.
    let is_flat = |gap: &[u32], i: usize, flat: f64| {
        let angle = corner_angle(mesh, gap, i) + angles.get(&gap[i]).copied().unwrap_or(0.0);
        (angle - flat).abs() < BEND
    };
    // A hole may touch the border of its cloth in a vertex, where two borders meet then.
    let is_flat_round =
        |gap: &[u32], i: usize| is_flat(gap, i, TAU) || (after(&gap[i]).len() > 1 && is_flat(gap, i, PI));
    let is_gap = |gap: &[u32]| {
        let (n, piece) = (gap.len(), &pieces[&piece_of[gap[0] as usize]]);
        if area(mesh, gap) > AREA * piece.largest || (0..n).any(|i| corner_angle(mesh, gap, i) > WIDEST) {
            return false;
        }
        if after(&gap[n - 1]).contains(&gap[0]) {
            let is_least = gap.iter().all(|vertex| *vertex >= gap[0]);
            let is_only = piece.open_count == n && piece.face_count >= LEAST_FACES;
            return is_least && (is_only || (0..n).all(|i| is_flat_round(gap, i)));
        }
        is_flat(gap, 0, PI) && is_flat(gap, n - 1, PI) && (1..n - 1).all(|i| is_flat(gap, i, TAU))
    };
    let mut gaps = Vec::new();
    for &a in next.keys() {
        for &b in after(&a) {
            for &c in after(&b).iter().filter(|c| **c != a) {
                if is_gap(&[a, b, c]) {
                    gaps.push(vec![a, b, c]);
                }
                let fourth = after(&c).iter().filter(|d| **d != a && **d != b);
                gaps.extend(fourth.map(|d| vec![a, b, c, *d]).filter(|gap| is_gap(gap)));
            }
        }
    }
    gaps
}

/// What is known of a piece of cloth that hangs together.
#[derive(Default)]
struct Piece {
    face_count: usize,
    /// The area of its largest face.
    largest: f64,
    /// How many open edges it has.
    open_count: usize,
}

/// From each vertex on a border those that follow along it, several where borders meet.
fn open_edges(mesh: &Mesh) -> BTreeMap<u32, Vec<u32>> {
    let mut edges = Vec::with_capacity(mesh.corners.len());
    for face in &mesh.faces {
        let corners = mesh.corners_of(face);
        edges.extend((0..corners.len()).map(|i| (corners[i].vertex, corners[(i + 1) % corners.len()].vertex)));
    }
    edges.sort_unstable();
    edges.dedup();
    let mut next: BTreeMap<u32, Vec<u32>> = BTreeMap::new();
    for &(from, to) in edges.iter().filter(|(from, to)| edges.binary_search(&(*to, *from)).is_err()) {
        next.entry(to).or_default().push(from);
    }
    // More meet only where faces are no cloth.
    next.retain(|_, following| following.len() <= 3);
    next
}

/// The sum of the angles of the faces about each vertex on a border.
fn angles(mesh: &Mesh, next: &BTreeMap<u32, Vec<u32>>) -> BTreeMap<u32, f64> {
    let mut on_border = vec![false; mesh.positions.len()];
    next.keys().for_each(|vertex| on_border[*vertex as usize] = true);
    let mut angles = BTreeMap::new();
    for face in &mesh.faces {
        let vertices: Vec<u32> = mesh.corners_of(face).iter().map(|corner| corner.vertex).collect();
        for (i, vertex) in vertices.iter().enumerate().filter(|(_, vertex)| on_border[**vertex as usize]) {
            *angles.entry(*vertex).or_insert(0.0) += corner_angle(mesh, &vertices, i);
        }
    }
    angles
}

fn position(mesh: &Mesh, vertex: u32) -> DVec3 {
    mesh.positions[vertex as usize]
}

/// The angle of a polygon at its corner `i`.
fn corner_angle(mesh: &Mesh, polygon: &[u32], i: usize) -> f64 {
    let n = polygon.len();
    let [before, at, after] = [(i + n - 1) % n, i, (i + 1) % n].map(|i| position(mesh, polygon[i]));
    let (a, b) = ((before - at).normalize_or_zero(), (after - at).normalize_or_zero());
    libm::atan2(a.cross(b).length(), a.dot(b))
}

fn area(mesh: &Mesh, polygon: &[u32]) -> f64 {
    let origin = position(mesh, polygon[0]);
    let spoke = |vertex: u32| position(mesh, vertex) - origin;
    polygon.windows(2).map(|edge| spoke(edge[0]).cross(spoke(edge[1]))).sum::<DVec3>().length() / 2.0
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A sheet of quads, or of triangles, each face's text.
    fn sheet(columns: usize, rows: usize, triangles: bool) -> (String, Vec<String>) {
        let places = (0..=rows).flat_map(|j| (0..=columns).map(move |i| (i, j)));
        let vertices = places.map(|(i, j)| format!("v {i} {j} {}\n", 0.1 * ((i * j) % 3) as f64)).collect();
        let mut faces = Vec::new();
        for j in 0..rows {
            for i in 0..columns {
                let a = j * (columns + 1) + i + 1;
                let (b, c, d) = (a + 1, a + columns + 2, a + columns + 1);
                match triangles {
                    true => faces.extend([format!("f {a} {b} {c}\n"), format!("f {a} {c} {d}\n")]),
                    false => faces.push(format!("f {a} {b} {c} {d}\n")),
                }
            }
        }
        (vertices, faces)
    }

    fn gaps(vertices: &str, faces: &[String]) -> Vec<Vec<u32>> {
        let text = format!("{vertices}{}", faces.concat());
        find(&crate::source::obj::read("test.obj", text.as_bytes(), &mut Vec::new()).unwrap())
    }

    #[test]
    fn whole_sheets_have_no_gaps_and_every_lost_face_leaves_one() {
        for triangles in [false, true] {
            let (vertices, faces) = sheet(6, 5, triangles);
            assert_eq!(gaps(&vertices, &faces), Vec::<Vec<u32>>::new());
            for lost in 0..faces.len() {
                let mut left = faces.clone();
                let vertices_of: Vec<u32> =
                    left.remove(lost).split_whitespace().skip(1).map(|v| v.parse::<u32>().unwrap() - 1).collect();
                // At the sheet's own corners nothing is lost but the corner.
                let corners = [0, 6, 35, 41];
                if vertices_of.iter().any(|vertex| corners.contains(vertex)) {
                    continue;
                }
                let found = gaps(&vertices, &left);
                assert_eq!(found.len(), 1, "triangles {triangles}, face {lost}: {found:?}");
                let mut found = found[0].clone();
                let mut wanted = vertices_of.clone();
                found.sort_unstable();
                wanted.sort_unstable();
                assert_eq!(found, wanted);
            }
        }
    }

    #[test]
    fn a_closed_box_without_one_side_has_a_gap_and_a_square_tube_has_none() {
        let vertices = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nv 0 0 1\nv 1 0 1\nv 1 1 1\nv 0 1 1\n";
        let faces = ["f 1 4 3 2\n", "f 5 6 7 8\n", "f 1 2 6 5\n", "f 2 3 7 6\n", "f 3 4 8 7\n", "f 4 1 5 8\n"];
        let faces: Vec<String> = faces.iter().map(|face| (*face).to_owned()).collect();
        assert!(gaps(vertices, &faces).is_empty());
        assert_eq!(gaps(vertices, &faces[1..]), [[0, 3, 2, 1]]);
        assert!(gaps(vertices, &faces[2..]).is_empty());
    }
}
