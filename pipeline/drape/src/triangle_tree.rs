//! A tree of boxes about triangles: which of them lie in a box, which two of them may meet, which one is nearest to a place. Built
//! once for a mesh and fitted anew when its vertices move. Knows no cloth and no body.
//!
//! An edge is a triangle `[a, b, b]`, a vertex `[a, a, a]`. Nodes are halved at the median centre along their longest side, so
//! that no query goes deeper than the logarithm of the count; what is built from the same mesh is the same tree.

use crate::parallel;
use glam::DVec3;

/// Most triangles of a leaf.
const LEAF: usize = 8;
/// Nodes that a query may hold back: one per level, and halving 2³² triangles takes 32 levels.
const DEEPEST: usize = 40;
/// Pairs of subtrees that are handed to threads, at least, where there are so many.
const TASKS: usize = 128;

/// A box along the axes, closed: what touches it is in it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Extent {
    /// Its least coordinates, metres.
    pub low_m: DVec3,
    /// Its greatest coordinates, metres.
    pub high_m: DVec3,
}

#[derive(Clone, Copy, Debug)]
struct Node {
    extent: Extent,
    /// Of a leaf its first triangle, of others the second child; the first one is the next node.
    next: u32,
    /// Triangles of a leaf; 0 of others.
    count: u32,
}

/// Boxes about the triangles of a mesh.
#[derive(Clone, Debug)]
pub struct TriangleTree {
    /// Parents before their children.
    nodes: Vec<Node>,
    /// In the order of the leaves, as the next two: a triangle's box, corners and number in the mesh.
    boxes: Vec<Extent>,
    corners: Vec<[u32; 3]>,
    numbers: Vec<u32>,
}

/// The place on a mesh that is nearest to another one.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Nearest {
    /// The triangle on which it lies; on its border, any one of those that meet there.
    pub triangle: u32,
    /// Where it is.
    pub place_m: DVec3,
    /// Barycentric coordinates in the triangle, each 0 to 1.
    pub shares: DVec3,
    /// Squared distance, square metres.
    pub squared_m2: f64,
}

impl Extent {
    /// Around places; of none, a box that overlaps nothing.
    #[must_use]
    pub fn around(places_m: &[DVec3]) -> Extent {
        let mut extent = Extent { low_m: DVec3::INFINITY, high_m: DVec3::NEG_INFINITY };
        for &place in places_m {
            extent = Extent { low_m: extent.low_m.min(place), high_m: extent.high_m.max(place) };
        }
        extent
    }

    /// Around both.
    #[must_use]
    pub fn union(self, other: Extent) -> Extent {
        Extent { low_m: self.low_m.min(other.low_m), high_m: self.high_m.max(other.high_m) }
    }

    /// Larger by a distance on every side.
    #[must_use]
    pub fn grown(self, by_m: f64) -> Extent {
        Extent { low_m: self.low_m - by_m, high_m: self.high_m + by_m }
    }

    /// Whether the two have a place in common.
    #[must_use]
    pub fn overlaps(&self, other: &Extent) -> bool {
        // All six are compared, which is faster than to leave early.
        let from = self.low_m.cmple(other.high_m);
        let to = other.low_m.cmple(self.high_m);
        (from & to).all()
    }

    /// Squared distance to a place, square metres; 0 inside.
    fn squared_m2(&self, place_m: DVec3) -> f64 {
        (self.low_m - place_m).max(place_m - self.high_m).max(DVec3::ZERO).length_squared()
    }
}

impl TriangleTree {
    /// For triangles of vertices at `positions_m`, all finite. At most 2³¹ triangles.
    ///
    /// # Panics
    /// When a triangle names a vertex that is not there.
    #[must_use]
    pub fn new(positions_m: &[DVec3], triangles: &[[u32; 3]]) -> TriangleTree {
        let mut numbers: Vec<u32> = (0..triangles.len() as u32).collect();
        let middles_m: Vec<DVec3> = triangles
            .iter()
            .map(|corners| {
                let extent = extent_of(positions_m, corners);
                0.5 * (extent.low_m + extent.high_m)
            })
            .collect();
        let empty = Extent::around(&[]);
        let mut nodes: Vec<Node> = Vec::new();
        // Range of triangles, and the parent whose second child it is.
        let mut waiting: Vec<(usize, usize, Option<usize>)> = vec![(0, triangles.len(), None)];
        while let Some((from, to, parent)) = waiting.pop() {
            if let Some(parent) = parent {
                let second = nodes.len() as u32;
                nodes[parent].next = second;
            }
            if to - from <= LEAF {
                nodes.push(Node { extent: empty, next: from as u32, count: (to - from) as u32 });
                continue;
            }
            let mut span = empty;
            for &number in &numbers[from..to] {
                let middle_m = middles_m[number as usize];
                span = span.union(Extent { low_m: middle_m, high_m: middle_m });
            }
            let axis = (span.high_m - span.low_m).max_position();
            let half = (to - from) / 2;
            let along = |number: u32| middles_m[number as usize][axis];
            numbers[from..to]
                .select_nth_unstable_by(half, |&a, &b| along(a).total_cmp(&along(b)).then_with(|| a.cmp(&b)));
            waiting.push((from + half, to, Some(nodes.len())));
            waiting.push((from, from + half, None));
            nodes.push(Node { extent: empty, next: 0, count: 0 });
        }
        let corners: Vec<[u32; 3]> = numbers.iter().map(|&number| triangles[number as usize]).collect();
        let mut tree = TriangleTree { nodes, boxes: vec![empty; corners.len()], corners, numbers };
        tree.refit(positions_m);
        tree
    }

    /// Fits the boxes to vertices that have moved. Far from where the tree was built, it stays right but gets slower.
    ///
    /// # Panics
    /// When there are fewer positions than before.
    pub fn refit(&mut self, positions_m: &[DVec3]) {
        for i in (0..self.nodes.len()).rev() {
            let Node { next, count, .. } = self.nodes[i];
            let mut extent = Extent::around(&[]);
            if count > 0 {
                for item in next as usize..(next + count) as usize {
                    self.boxes[item] = extent_of(positions_m, &self.corners[item]);
                    extent = extent.union(self.boxes[item]);
                }
            } else if !self.boxes.is_empty() {
                extent = self.nodes[i + 1].extent.union(self.nodes[next as usize].extent);
            }
            self.nodes[i].extent = extent;
        }
    }

    /// The box about all triangles.
    #[must_use]
    pub fn extent(&self) -> Extent {
        self.nodes[0].extent
    }

    /// Calls `visit` with every triangle (its number and corners) whose box overlaps `extent`, in an order that the tree alone
    /// decides.
    pub fn overlapping(&self, extent: &Extent, mut visit: impl FnMut(u32, [u32; 3])) {
        let mut waiting = [0u32; DEEPEST];
        let mut held = 1;
        while held > 0 {
            held -= 1;
            let at = waiting[held] as usize;
            let node = &self.nodes[at];
            if !node.extent.overlaps(extent) {
                continue;
            }
            if node.count == 0 && !self.boxes.is_empty() {
                waiting[held] = node.next;
                waiting[held + 1] = at as u32 + 1;
                held += 2;
                continue;
            }
            for item in node.next as usize..(node.next + node.count) as usize {
                if self.boxes[item].overlaps(extent) {
                    visit(self.numbers[item], self.corners[item]);
                }
            }
        }
    }

    /// The place on the triangles that is nearest to `place_m` and not farther than `within_m` (infinity for any); none where there
    /// is none. `positions_m` are those to which the tree was fitted. Triangles without area count as their edges, or not at all.
    #[must_use]
    pub fn nearest(&self, positions_m: &[DVec3], place_m: DVec3, within_m: f64) -> Option<Nearest> {
        let mut best_m2 = within_m * within_m;
        let mut found: Option<Nearest> = None;
        let mut waiting = [(0u32, 0.0f64); DEEPEST];
        waiting[0] = (0, self.nodes[0].extent.squared_m2(place_m));
        let mut held = 1;
        while held > 0 {
            held -= 1;
            let (at, squared_m2) = waiting[held];
            if squared_m2 > best_m2 {
                continue;
            }
            let node = &self.nodes[at as usize];
            if node.count == 0 && !self.boxes.is_empty() {
                let children = [at + 1, node.next];
                let mut pair = children.map(|child| (child, self.nodes[child as usize].extent.squared_m2(place_m)));
                if pair[0].1 < pair[1].1 {
                    pair.swap(0, 1);
                }
                // The nearer one is taken up next.
                for child in pair {
                    if child.1 <= best_m2 {
                        waiting[held] = child;
                        held += 1;
                    }
                }
                continue;
            }
            for item in node.next as usize..(node.next + node.count) as usize {
                if self.boxes[item].squared_m2(place_m) > best_m2 {
                    continue;
                }
                let corners_m = self.corners[item].map(|corner| positions_m[corner as usize]);
                let (nearest_m, shares) = nearest_on_triangle(corners_m, place_m);
                let squared_m2 = (nearest_m - place_m).length_squared();
                // Without area it may be no number, which is neither.
                if squared_m2 < best_m2 || (found.is_none() && squared_m2 <= best_m2) {
                    best_m2 = squared_m2;
                    found = Some(Nearest { triangle: self.numbers[item], place_m: nearest_m, shares, squared_m2 });
                }
            }
        }
        found
    }

    /// All pairs of different triangles whose boxes come nearer than `reach_m` (at least 0) along every axis or overlap, the
    /// smaller number first. On all threads; the tree alone decides the order.
    #[must_use]
    pub fn self_pairs(&self, reach_m: f64) -> Vec<[u32; 2]> {
        pairs(self, self, true, reach_m)
    }

    /// The same of a triangle of this tree and one of another.
    #[must_use]
    pub fn pairs(&self, other: &TriangleTree, reach_m: f64) -> Vec<[u32; 2]> {
        pairs(self, other, false, reach_m)
    }
}

fn pairs(a: &TriangleTree, b: &TriangleTree, is_same: bool, reach_m: f64) -> Vec<[u32; 2]> {
    if a.boxes.is_empty() || b.boxes.is_empty() {
        return Vec::new();
    }
    // Pairs of nodes are opened level by level until there are enough for all threads.
    let mut tasks = vec![[0u32, 0]];
    let mut found = Vec::new();
    while !tasks.is_empty() && tasks.len() < TASKS {
        let mut opened = Vec::new();
        for pair in tasks {
            open(a, b, is_same, reach_m, pair, &mut opened, &mut found);
        }
        tasks = opened;
    }
    found.extend(parallel::collect_each(tasks.len(), |task, found: &mut Vec<[u32; 2]>| {
        let mut waiting = vec![tasks[task]];
        while let Some(pair) = waiting.pop() {
            open(a, b, is_same, reach_m, pair, &mut waiting, found);
        }
    }));
    found
}

/// Puts the pairs of children of two nodes that may meet in `waiting`, and pairs of triangles of two leaves in `found`.
fn open(
    a: &TriangleTree,
    b: &TriangleTree,
    is_same: bool,
    reach_m: f64,
    [i, j]: [u32; 2],
    waiting: &mut Vec<[u32; 2]>,
    found: &mut Vec<[u32; 2]>,
) {
    let (left, right) = (&a.nodes[i as usize], &b.nodes[j as usize]);
    let is_itself = is_same && i == j;
    if left.count > 0 && right.count > 0 {
        for first in left.next as usize..(left.next + left.count) as usize {
            let extent = a.boxes[first].grown(reach_m);
            let from = if is_itself { first + 1 } else { right.next as usize };
            for second in from..(right.next + right.count) as usize {
                if extent.overlaps(&b.boxes[second]) {
                    let pair = [a.numbers[first], b.numbers[second]];
                    found.push(if is_same && pair[0] > pair[1] { [pair[1], pair[0]] } else { pair });
                }
            }
        }
        return;
    }
    if is_itself {
        waiting.extend([[i + 1, i + 1], [left.next, left.next], [i + 1, left.next]]);
        return;
    }
    let halves = |node: &Node, at: u32| if node.count > 0 { [Some(at), None] } else { [Some(at + 1), Some(node.next)] };
    for first in halves(left, i).into_iter().flatten() {
        let extent = a.nodes[first as usize].extent.grown(reach_m);
        for second in halves(right, j).into_iter().flatten() {
            if extent.overlaps(&b.nodes[second as usize].extent) {
                waiting.push([first, second]);
            }
        }
    }
}

fn extent_of(positions_m: &[DVec3], corners: &[u32; 3]) -> Extent {
    let [a, b, c] = corners.map(|corner| positions_m[corner as usize]);
    Extent { low_m: a.min(b).min(c), high_m: a.max(b).max(c) }
}

/// The nearest place of a closed triangle and its barycentric coordinates (Ericson, Real-Time Collision Detection, 5.1.5).
pub(crate) fn nearest_on_triangle([a, b, c]: [DVec3; 3], place_m: DVec3) -> (DVec3, DVec3) {
    let (ab, ac) = (b - a, c - a);
    let from_a = place_m - a;
    let (d1, d2) = (ab.dot(from_a), ac.dot(from_a));
    if d1 <= 0.0 && d2 <= 0.0 {
        return (a, DVec3::X);
    }
    let from_b = place_m - b;
    let (d3, d4) = (ab.dot(from_b), ac.dot(from_b));
    if d3 >= 0.0 && d4 <= d3 {
        return (b, DVec3::Y);
    }
    let beyond_ab = d1 * d4 - d3 * d2;
    if beyond_ab <= 0.0 && d1 >= 0.0 && d3 <= 0.0 {
        let share = d1 / (d1 - d3);
        return (a + ab * share, DVec3::new(1.0 - share, share, 0.0));
    }
    let from_c = place_m - c;
    let (d5, d6) = (ab.dot(from_c), ac.dot(from_c));
    if d6 >= 0.0 && d5 <= d6 {
        return (c, DVec3::Z);
    }
    let beyond_ac = d5 * d2 - d1 * d6;
    if beyond_ac <= 0.0 && d2 >= 0.0 && d6 <= 0.0 {
        let share = d2 / (d2 - d6);
        return (a + ac * share, DVec3::new(1.0 - share, 0.0, share));
    }
    let beyond_bc = d3 * d6 - d5 * d4;
    if beyond_bc <= 0.0 && d4 >= d3 && d5 >= d6 {
        let share = (d4 - d3) / ((d4 - d3) + (d5 - d6));
        return (b + (c - b) * share, DVec3::new(0.0, 1.0 - share, share));
    }
    let whole = beyond_bc + beyond_ac + beyond_ab;
    let (v, w) = (beyond_ac / whole, beyond_ab / whole);
    (a + ab * v + ac * w, DVec3::new(1.0 - v - w, v, w))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Numbers in -1..1, the same every time.
    fn numbers(seed: u64) -> impl FnMut() -> f64 {
        let mut state = seed;
        move || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (state >> 11) as f64 / (1u64 << 52) as f64 - 1.0
        }
    }

    fn soup(seed: u64, count: usize, size_m: f64) -> (Vec<DVec3>, Vec<[u32; 3]>) {
        let mut number = numbers(seed);
        let mut positions_m = Vec::new();
        for _ in 0..count {
            let middle_m = DVec3::new(number(), number(), number());
            for _ in 0..3 {
                positions_m.push(middle_m + size_m * DVec3::new(number(), number(), number()));
            }
        }
        (positions_m, (0..count as u32).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect())
    }

    #[test]
    fn queries_find_what_comparing_all_finds_also_after_moving() {
        for count in [0, 1, 3, 5, 9, 200, 900] {
            let (mut positions_m, triangles) = soup(count as u64, count, 0.1);
            let mut tree = TriangleTree::new(&positions_m, &triangles);
            let (other_m, other) = soup(77, 300, 0.2);
            let other_tree = TriangleTree::new(&other_m, &other);
            for _ in 0..2 {
                let boxes = |positions_m: &[DVec3], triangles: &[[u32; 3]]| -> Vec<Extent> {
                    triangles.iter().map(|corners| extent_of(positions_m, corners)).collect()
                };
                let (mine, others) = (boxes(&positions_m, &triangles), boxes(&other_m, &other));
                let (mut selves, mut between) = (Vec::new(), Vec::new());
                for (i, extent) in mine.iter().enumerate() {
                    let near = |(j, other): (usize, &Extent)| extent.grown(0.03).overlaps(other).then_some(j as u32);
                    selves.extend(mine.iter().enumerate().skip(i + 1).filter_map(near).map(|j| [i as u32, j]));
                    between.extend(others.iter().enumerate().filter_map(near).map(|j| [i as u32, j]));
                }
                let sorted = |mut pairs: Vec<[u32; 2]>| {
                    pairs.sort_unstable();
                    pairs
                };
                assert!(sorted(tree.self_pairs(0.03)) == selves);
                assert!(sorted(tree.pairs(&other_tree, 0.03)) == between);
                for (j, extent) in others.iter().enumerate() {
                    let mut found = Vec::new();
                    tree.overlapping(&extent.grown(0.03), |number, _| found.push(number));
                    found.sort_unstable();
                    let wanted = (0..count as u32).filter(|&i| mine[i as usize].overlaps(&extent.grown(0.03)));
                    assert!(found.iter().copied().eq(wanted), "{j}");
                }
                for &place in &other_m[..60] {
                    let squared = |corners: &[u32; 3]| {
                        let corners_m = corners.map(|corner| positions_m[corner as usize]);
                        (nearest_on_triangle(corners_m, place).0 - place).length_squared()
                    };
                    let wanted = triangles.iter().map(squared).fold(f64::INFINITY, f64::min);
                    let found = tree.nearest(&positions_m, place, f64::INFINITY);
                    assert_eq!(found.map_or(f64::INFINITY, |found| found.squared_m2), wanted);
                    let within_m = 0.1;
                    let is_near = tree.nearest(&positions_m, place, within_m).is_some();
                    assert_eq!(is_near, wanted <= within_m * within_m);
                }
                let mut number = numbers(5);
                for place in &mut positions_m {
                    *place += 0.3 * DVec3::new(number(), number(), number());
                }
                tree.refit(&positions_m);
            }
        }
    }

    /// Against places all over the triangle.
    #[test]
    fn no_place_of_a_triangle_is_nearer_than_the_nearest() {
        let mut number = numbers(3);
        for _ in 0..200 {
            let mut place = || DVec3::new(number(), number(), number());
            let (corners_m, from_m) = ([place(), place(), place()], place());
            let (nearest_m, shares) = nearest_on_triangle(corners_m, from_m);
            assert!(shares.min_element() >= 0.0 && (shares.element_sum() - 1.0).abs() < 1e-12);
            let by_shares = corners_m[0] * shares.x + corners_m[1] * shares.y + corners_m[2] * shares.z;
            assert!((by_shares - nearest_m).length() < 1e-12);
            for i in 0..=20 {
                for j in 0..=20 - i {
                    let (v, w) = (f64::from(i) / 20.0, f64::from(j) / 20.0);
                    let other_m = corners_m[0] * (1.0 - v - w) + corners_m[1] * v + corners_m[2] * w;
                    assert!((other_m - from_m).length() >= (nearest_m - from_m).length() - 1e-12);
                }
            }
        }
    }
}
