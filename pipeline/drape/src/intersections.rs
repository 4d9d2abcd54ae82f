//! Where triangles pass through or touch each other: edges that meet triangles, decided without rounding. Knows no cloth, no
//! body and no forces.
//!
//! The signs come from Shewchuk's adaptive predicates (Adaptive Precision Floating-Point Arithmetic and Fast Robust Geometric
//! Predicates, 1997; crate `robust`), so that each answer is exact for the coordinates as they are stored, unless differences of
//! them are so large or so small (above 1e70 m, below 1e-70 m) that products of three are no numbers. Closed edges meet closed triangles: touching is meeting, also of vertices that have equal
//! coordinates and different numbers, as along a seam that is not welded.
//!
//! What is asked:
//! - An edge and a triangle that share no vertex meet if they have a place in common. If the edge lies in the plane of the
//!   triangle, this is decided in a projection along an axis in which the triangle keeps an area.
//! - Triangles that share one vertex meet elsewhere if and only if the edge of one of them opposite to it meets the other, which is
//!   of the first kind.
//! - Triangles that share an edge meet elsewhere if and only if they are folded flat onto each other: in one plane, on one side of
//!   the edge. Then that edge is said to meet the second one.
//!
//! A surface of triangles with area has none of these if and only if it is embedded. A triangle without area is met by nothing; its
//! edges meet others.

use crate::parallel;
use crate::triangle_tree::{Extent, TriangleTree};
use glam::{DVec2, DVec3};
use robust::{Coord, Coord3D};

/// Triangles in space and the tree that finds them, kept while the vertices move.
#[derive(Clone, Debug)]
pub struct Surface {
    positions_m: Vec<DVec3>,
    triangles: Vec<[u32; 3]>,
    /// Of each triangle, which of its edges (from a corner to the next one) no triangle before it has.
    own_edges: Vec<[bool; 3]>,
    tree: TriangleTree,
}

/// Which of two surfaces.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Of {
    /// The first one, or the only one.
    First,
    /// The second one.
    Second,
}

/// An edge that meets a triangle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Crossing {
    /// Whose edge it is; among two surfaces, the triangle is the other one's.
    pub edge_of: Of,
    /// The vertices of the edge, the smaller number first.
    pub edge: [u32; 2],
    /// The number of the triangle.
    pub triangle: u32,
    /// A place that both have, rounded, metres.
    pub place_m: DVec3,
}

impl Surface {
    /// Triangles of vertices at finite places.
    ///
    /// # Panics
    /// When a triangle names a vertex that is not there.
    #[must_use]
    pub fn new(positions_m: &[DVec3], triangles: &[[u32; 3]]) -> Surface {
        let mut edges: Vec<([u32; 2], u32, usize)> = Vec::with_capacity(3 * triangles.len());
        for (number, corners) in triangles.iter().enumerate() {
            for side in 0..3 {
                edges.push((edge(*corners, side), number as u32, side));
            }
        }
        edges.sort_unstable();
        let mut own_edges = vec![[false; 3]; triangles.len()];
        for (i, &(ends, triangle, side)) in edges.iter().enumerate() {
            own_edges[triangle as usize][side] = i == 0 || edges[i - 1].0 != ends;
        }
        let tree = TriangleTree::new(positions_m, triangles);
        Surface { positions_m: positions_m.to_vec(), triangles: triangles.to_vec(), own_edges, tree }
    }

    /// Moves the vertices to finite places.
    ///
    /// # Panics
    /// When there are more or fewer places than vertices.
    pub fn refit(&mut self, positions_m: &[DVec3]) {
        self.positions_m.copy_from_slice(positions_m);
        self.tree.refit(positions_m);
    }

    /// Where the vertices are, metres.
    #[must_use]
    pub fn positions_m(&self) -> &[DVec3] {
        &self.positions_m
    }

    /// Three vertices each.
    #[must_use]
    pub fn triangles(&self) -> &[[u32; 3]] {
        &self.triangles
    }

    /// The boxes about the triangles.
    #[must_use]
    pub fn tree(&self) -> &TriangleTree {
        &self.tree
    }

    /// Where it meets itself, ascending by edge, then by triangle; the same on any number of threads.
    #[must_use]
    pub fn self_intersections(&self) -> Vec<Crossing> {
        let pairs = self.tree.self_pairs(0.0);
        let found = parallel::collect(pairs.len(), |i, found: &mut Vec<Crossing>| {
            let [first, second] = pairs[i];
            let (a, b) = (self.triangles[first as usize], self.triangles[second as usize]);
            if a.iter().filter(|corner| b.contains(corner)).count() >= 2 {
                found.extend(folded_flat(&self.positions_m, a, b, second));
                return;
            }
            for (of, triangle) in [(first, second), (second, first)] {
                let corners = self.triangles[triangle as usize];
                for edge in self.own_edges(of) {
                    if !edge.iter().any(|end| corners.contains(end)) {
                        let place_m = meeting(ends_m(&self.positions_m, edge), corners_m(&self.positions_m, corners));
                        found.extend(place_m.map(|place_m| Crossing { edge_of: Of::First, edge, triangle, place_m }));
                    }
                }
            }
        });
        sorted(found)
    }

    /// Where it (the first) and another one (the second) meet, ascending by whose edge it is, the edge and the triangle; the same on
    /// any number of threads.
    #[must_use]
    pub fn crossings(&self, other: &Surface) -> Vec<Crossing> {
        let pairs = self.tree.pairs(&other.tree, 0.0);
        let found = parallel::collect(pairs.len(), |i, found: &mut Vec<Crossing>| {
            let [first, second] = pairs[i];
            for (edge_of, with, number, against, triangle) in
                [(Of::First, self, first, other, second), (Of::Second, other, second, self, first)]
            {
                let triangle_m = corners_m(&against.positions_m, against.triangles[triangle as usize]);
                for edge in with.own_edges(number) {
                    let place_m = meeting(ends_m(&with.positions_m, edge), triangle_m);
                    found.extend(place_m.map(|place_m| Crossing { edge_of, edge, triangle, place_m }));
                }
            }
        });
        sorted(found)
    }

    /// The edges that are looked at along with a triangle, each once in all.
    fn own_edges(&self, triangle: u32) -> impl Iterator<Item = [u32; 2]> + use<> {
        let (corners, own) = (self.triangles[triangle as usize], self.own_edges[triangle as usize]);
        (0..3).filter(move |&side| own[side]).map(move |side| edge(corners, side))
    }
}

/// Where a surface meets itself: `Surface::self_intersections` of one that is asked once.
///
/// # Panics
/// When a triangle names a vertex that is not there.
#[must_use]
pub fn self_intersections(positions_m: &[DVec3], triangles: &[[u32; 3]]) -> Vec<Crossing> {
    Surface::new(positions_m, triangles).self_intersections()
}

/// Where two surfaces meet: `Surface::crossings` of two that are asked once.
///
/// # Panics
/// When a triangle names a vertex that is not there.
#[must_use]
pub fn crossings(
    first_m: &[DVec3],
    first_triangles: &[[u32; 3]],
    second_m: &[DVec3],
    second_triangles: &[[u32; 3]],
) -> Vec<Crossing> {
    Surface::new(first_m, first_triangles).crossings(&Surface::new(second_m, second_triangles))
}

/// A place that a closed edge and a closed triangle have in common. Whether there is one is exact; a triangle without area has
/// none.
#[must_use]
pub fn meeting(edge_m: [DVec3; 2], triangle_m: [DVec3; 3]) -> Option<DVec3> {
    let ([p, q], [a, b, c]) = (edge_m, triangle_m);
    if !Extent::around(&edge_m).overlaps(&Extent::around(&triangle_m)) {
        return None;
    }
    let (p_below, q_below) = (below(a, b, c, p), below(a, b, c, q));
    if is_same_side(p_below, q_below) {
        return None;
    }
    if p_below == 0.0 && q_below == 0.0 {
        return meeting_in_plane(edge_m, triangle_m);
    }
    // One place of the edge's line lies in the plane. It is in the triangle if the line passes all sides on the same hand.
    let hands = [below(p, q, a, b), below(p, q, b, c), below(p, q, c, a)];
    if is_mixed(hands) {
        return None;
    }
    Some(p.lerp(q, p_below / (p_below - q_below)))
}

/// Of an edge in the plane of a triangle.
fn meeting_in_plane([p, q]: [DVec3; 2], [a, b, c]: [DVec3; 3]) -> Option<DVec3> {
    let axis = (0..3).find(|&axis| left(flat(a, axis), flat(b, axis), flat(c, axis)) != 0.0)?;
    let flat_corners = [a, b, c].map(|corner| flat(corner, axis));
    let (flat_p, flat_q) = (flat(p, axis), flat(q, axis));
    for (end, flat_end) in [(p, flat_p), (q, flat_q)] {
        let hands: [f64; 3] = std::array::from_fn(|i| left(flat_corners[i], flat_corners[(i + 1) % 3], flat_end));
        if !is_mixed(hands) {
            return Some(end);
        }
    }
    // Both ends outside: then it passes a side.
    for i in 0..3 {
        let (from, to) = (flat_corners[i], flat_corners[(i + 1) % 3]);
        let (p_left, q_left) = (left(from, to, flat_p), left(from, to, flat_q));
        let (from_left, to_left) = (left(flat_p, flat_q, from), left(flat_p, flat_q, to));
        if is_same_side(p_left, q_left) || is_same_side(from_left, to_left) {
            continue;
        }
        // Along a side on its own line, it passes the other two at their ends.
        if p_left != q_left {
            return Some(p.lerp(q, p_left / (p_left - q_left)));
        }
    }
    None
}

/// Of triangles that share an edge.
fn folded_flat(positions_m: &[DVec3], a: [u32; 3], b: [u32; 3], triangle: u32) -> Option<Crossing> {
    let side = (0..3).find(|&side| edge(a, side).iter().all(|end| b.contains(end)))?;
    let edge = edge(a, side);
    let ends = ends_m(positions_m, edge);
    let opposite = |corners: [u32; 3]| corners.into_iter().find(|corner| !edge.contains(corner));
    let [one, other] = [opposite(a)?, opposite(b)?].map(|corner| positions_m[corner as usize]);
    // Most hinges are wide open, more than rounding could make of one that is shut.
    let (along_m, one_m, other_m) = (ends[1] - ends[0], one - ends[0], other - ends[0]);
    let shut = along_m.cross(one_m).dot(along_m.cross(other_m));
    if shut < -1e-9 * along_m.length_squared() * one_m.length() * other_m.length() {
        return None;
    }
    if below(ends[0], ends[1], one, other) != 0.0 {
        return None;
    }
    let hand = |corner: DVec3, axis: usize| left(flat(ends[0], axis), flat(ends[1], axis), flat(corner, axis));
    let axis = (0..3).find(|&axis| hand(one, axis) != 0.0)?;
    is_same_side(hand(one, axis), hand(other, axis)).then(|| Crossing {
        edge_of: Of::First,
        edge,
        triangle,
        place_m: ends[0].midpoint(ends[1]),
    })
}

fn is_same_side(one: f64, other: f64) -> bool {
    // Not their product, which may be too small for a number.
    (one > 0.0 && other > 0.0) || (one < 0.0 && other < 0.0)
}

fn is_mixed(hands: [f64; 3]) -> bool {
    hands.iter().any(|&hand| hand > 0.0) && hands.iter().any(|&hand| hand < 0.0)
}

/// Above 0 where `d` lies below the plane of `a`, `b`, `c` (seen from above counter-clockwise), 0 in it; six times a volume.
pub(crate) fn below(a: DVec3, b: DVec3, c: DVec3, d: DVec3) -> f64 {
    let [a, b, c, d] = [a, b, c, d].map(|place| Coord3D { x: place.x, y: place.y, z: place.z });
    robust::orient3d(a, b, c, d)
}

/// Above 0 where `c` lies on the left hand of the way from `a` to `b`, 0 on its line; twice an area.
pub(crate) fn left(a: DVec2, b: DVec2, c: DVec2) -> f64 {
    let [a, b, c] = [a, b, c].map(|place| Coord { x: place.x, y: place.y });
    robust::orient2d(a, b, c)
}

/// Seen against an axis.
pub(crate) fn flat(place_m: DVec3, axis: usize) -> DVec2 {
    DVec2::new(place_m[(axis + 1) % 3], place_m[(axis + 2) % 3])
}

/// From a corner to the next one.
fn edge(corners: [u32; 3], side: usize) -> [u32; 2] {
    let (from, to) = (corners[side], corners[(side + 1) % 3]);
    [from.min(to), from.max(to)]
}

fn ends_m(positions_m: &[DVec3], edge: [u32; 2]) -> [DVec3; 2] {
    edge.map(|end| positions_m[end as usize])
}

fn corners_m(positions_m: &[DVec3], corners: [u32; 3]) -> [DVec3; 3] {
    corners.map(|corner| positions_m[corner as usize])
}

fn sorted(mut crossings: Vec<Crossing>) -> Vec<Crossing> {
    crossings.sort_unstable_by_key(|crossing| (crossing.edge_of, crossing.edge, crossing.triangle));
    crossings
}
