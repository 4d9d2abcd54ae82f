//! Where a hand that holds scissors cuts: its path in space as lines on the flat cloth, straight in spite of a hand that shakes (Shoda 2018, 3.2.3.5 I and II). Where cloth
//! lies double, through the layer that is nearest to the hand or through all. Knows neither how cloth is parted nor forces.

use crate::slit::Flat;
use crate::triangle_tree::{Extent, TriangleTree};
use glam::{DVec2, DVec3};
use std::collections::BTreeSet;

/// A line on the cloth is as straight as it may be without leaving the hand's way by more than hands shake, metres.
const SHAKES_M: f64 = 0.02;
/// Two hits that follow each other on the path are of one line where they are no farther apart on the cloth than so many steps of the path.
const FOLLOWS: f64 = 3.0;
/// Farther beside the cloth's border than this share of a cell, a hand is not above the cloth.
const BESIDE: f64 = 0.25;
/// Most places that are looked at.
const MOST: f64 = 4096.0;

/// Through what a hand cuts.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Layers {
    /// The layer that is nearest to it.
    Nearest,
    /// All within its reach.
    All,
}

/// The lines of a path through places in space, metres, on cloth with its vertices at `positions_m`, in flat coordinates, metres. Cloth farther than `reach_m` is not met.
#[must_use]
pub fn lines_on(flat: &Flat, positions_m: &[DVec3], path_m: &[DVec3], reach_m: f64, layers: Layers) -> Vec<Vec<DVec2>> {
    let cell_m = edge_mean_m(flat);
    let path_m: Vec<DVec3> = path_m.iter().copied().filter(|place_m| place_m.is_finite()).collect();
    let long_m: f64 = path_m.windows(2).map(|pair| pair[0].distance(pair[1])).sum();
    let step_m = (0.5 * cell_m).max(long_m / MOST);
    let cloth = Cloth { flat, positions_m, tree: TriangleTree::new(positions_m, &flat.triangles), open: open(flat) };
    // Lines that go on, and those that have ended.
    let (mut going, mut ended): (Vec<Line>, Vec<Line>) = (Vec::new(), Vec::new());
    let mut begins = true;
    for pair in path_m.windows(2) {
        let [from_m, to_m] = [pair[0], pair[1]];
        let count = (from_m.distance(to_m) / step_m).ceil().max(1.0) as usize;
        for i in 0..=count {
            let mut hits = cloth.below(from_m.lerp(to_m, i as f64 / count as f64), reach_m, layers, BESIDE * cell_m);
            let mut still = Vec::new();
            for mut line in going {
                let last_m = *line.places_m.last().expect("a line has places");
                let next = hits.iter().enumerate().min_by(|a, b| a.1.distance(last_m).total_cmp(&b.1.distance(last_m)));
                match next.filter(|(_, hit)| hit.distance(last_m) <= FOLLOWS * step_m).map(|(at, _)| at) {
                    Some(at) => {
                        line.places_m.push(hits.swap_remove(at));
                        still.push(line);
                    }
                    None => ended.push(Line { leaves: true, ..line }),
                }
            }
            still.extend(hits.into_iter().map(|hit| Line { places_m: vec![hit], comes: !begins, leaves: false }));
            going = still;
            begins = false;
        }
    }
    ended.extend(going);
    let far_m = |is_beyond: bool| if is_beyond { reach_m.max(cell_m) } else { cell_m };
    ended
        .into_iter()
        .filter_map(|line| straight(&line.places_m, cell_m, [line.comes, line.leaves].map(far_m), flat))
        .collect()
}

/// A hand's way on the cloth.
struct Line {
    places_m: Vec<DVec2>,
    /// Whether the hand was elsewhere before, and after.
    comes: bool,
    leaves: bool,
}

struct Cloth<'a> {
    flat: &'a Flat,
    positions_m: &'a [DVec3],
    tree: TriangleTree,
    /// Edges at the border, the smaller vertex first.
    open: BTreeSet<[u32; 2]>,
}

impl Cloth<'_> {
    /// The places of the cloth under a hand.
    fn below(&self, hand_m: DVec3, reach_m: f64, layers: Layers, beside_m: f64) -> Vec<DVec2> {
        let Some(nearest) = self.tree.nearest(self.positions_m, hand_m, reach_m) else { return Vec::new() };
        let corners = self.flat.triangles[nearest.triangle as usize];
        let [a, b, c] = corners.map(|v| self.positions_m[v as usize]);
        let normal = (b - a).cross(c - a).normalize_or_zero();
        let way_m = hand_m - nearest.place_m;
        let is_beside = (way_m - normal * normal.dot(way_m)).length() > beside_m;
        let is_at_border = (0..3).any(|i| {
            let [a, b] = [corners[(i + 1) % 3], corners[(i + 2) % 3]];
            nearest.shares[i] <= 0.0 && self.open.contains(&[a.min(b), a.max(b)])
        });
        if is_beside && is_at_border {
            return Vec::new();
        }
        let flat_m = |corners: [u32; 3], shares: DVec3| -> DVec2 {
            (0..3).map(|i| self.flat.places_m[corners[i] as usize] * shares[i]).sum()
        };
        let mut hits = vec![flat_m(corners, nearest.shares)];
        if layers == Layers::Nearest {
            return hits;
        }
        // Upright through the nearest layer.
        let ends = [nearest.place_m - normal * reach_m, nearest.place_m + normal * reach_m];
        let along = Extent { low_m: ends[0].min(ends[1]), high_m: ends[0].max(ends[1]) };
        self.tree.overlapping(&along, |triangle, corners| {
            let corners_m = corners.map(|v| self.positions_m[v as usize]);
            if triangle != nearest.triangle
                && let Some(shares) = crossed(ends, corners_m)
            {
                let hit = flat_m(corners, shares);
                // On an edge, two triangles have the same.
                if hits.iter().all(|other| other.distance(hit) > 1e-6) {
                    hits.push(hit);
                }
            }
        });
        hits
    }
}

/// Where the way between two places crosses a triangle, in barycentric coordinates.
fn crossed([from_m, to_m]: [DVec3; 2], [a, b, c]: [DVec3; 3]) -> Option<DVec3> {
    let (way, ab, ac) = (to_m - from_m, b - a, c - a);
    let across = way.cross(ac);
    let volume = ab.dot(across);
    if volume == 0.0 {
        return None;
    }
    let v = (from_m - a).dot(across) / volume;
    let turned = (from_m - a).cross(ab);
    let w = way.dot(turned) / volume;
    let share = ac.dot(turned) / volume;
    let is_in = v >= 0.0 && w >= 0.0 && v + w <= 1.0 && (0.0..=1.0).contains(&share);
    is_in.then(|| DVec3::new(1.0 - v - w, v, w))
}

/// A line of as few straight pieces as it takes; where a border of the cloth is nearer to its begin or end than so far, beyond it. None of a single place.
fn straight(line_m: &[DVec2], cell_m: f64, far_m: [f64; 2], flat: &Flat) -> Option<Vec<DVec2>> {
    let mut line_m = straightened(line_m);
    line_m.dedup();
    if line_m.len() < 2 {
        return None;
    }
    let is_in = |place_m: DVec2| {
        flat.triangles.iter().any(|corners| {
            let [a, b, c] = corners.map(|v| flat.places_m[v as usize]);
            [[a, b], [b, c], [c, a]].iter().all(|[a, b]| (*b - *a).perp_dot(place_m - *a) >= 0.0)
        })
    };
    for far_m in far_m {
        line_m.reverse();
        let last = line_m.len() - 1;
        let way = (line_m[last] - line_m[last - 1]).normalize_or_zero();
        let steps = (far_m / cell_m).ceil() as usize;
        let beyond_m = (1..=steps).map(|i| line_m[last] + way * (far_m * i as f64 / steps as f64));
        if let Some(beyond_m) = beyond_m.into_iter().find(|place_m| !is_in(*place_m)) {
            line_m[last] = beyond_m;
        }
    }
    Some(line_m)
}

/// As few of the places as keep all others near the ways between them (Ramer, Douglas and Peucker).
fn straightened(line_m: &[DVec2]) -> Vec<DVec2> {
    let mut kept = BTreeSet::from([0, line_m.len() - 1]);
    let mut waiting = vec![[0, line_m.len() - 1]];
    while let Some([from, to]) = waiting.pop() {
        let away_m = |i: usize| away_m(line_m[i], line_m[from], line_m[to]);
        let farthest = (from + 1..to).max_by(|a, b| away_m(*a).total_cmp(&away_m(*b)));
        if let Some(i) = farthest.filter(|i| away_m(*i) > SHAKES_M) {
            kept.insert(i);
            waiting.extend([[from, i], [i, to]]);
        }
    }
    kept.into_iter().map(|i| line_m[i]).collect()
}

/// From the way between two places.
fn away_m(place_m: DVec2, from_m: DVec2, to_m: DVec2) -> f64 {
    let way = to_m - from_m;
    let share =
        if way == DVec2::ZERO { 0.0 } else { ((place_m - from_m).dot(way) / way.length_squared()).clamp(0.0, 1.0) };
    place_m.distance(from_m + way * share)
}

fn edge_mean_m(flat: &Flat) -> f64 {
    let mut sum_m = 0.0;
    for [a, b, c] in &flat.triangles {
        let [a, b, c] = [a, b, c].map(|v| flat.places_m[*v as usize]);
        sum_m += a.distance(b) + b.distance(c) + c.distance(a);
    }
    sum_m / (3 * flat.triangles.len()).max(1) as f64
}

fn open(flat: &Flat) -> BTreeSet<[u32; 2]> {
    let mut open = BTreeSet::new();
    for [a, b, c] in &flat.triangles {
        for [a, b] in [[a, b], [b, c], [c, a]] {
            let edge = [*a.min(b), *a.max(b)];
            if !open.remove(&edge) {
                open.insert(edge);
            }
        }
    }
    open
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_shaking_hand_cuts_straight_and_through_as_many_layers_as_asked() {
        // 20 by 30 cm that hangs double over a rod at Y 0: 15 cm in front and behind, 2 cm apart.
        let flat = Flat::rectangle(DVec2::new(0.0, -0.15), 10, 15, DVec2::splat(0.02));
        let folded = |at: &DVec2| DVec3::new(at.x, -at.y.abs(), if at.y > 0.0 { 0.01 } else { -0.01 });
        let positions_m: Vec<DVec3> = flat.places_m.iter().map(folded).collect();
        let path_m: Vec<DVec3> = (0..60)
            .map(|i| {
                let shake = 0.006 * libm::sin(37.0 * f64::from(i));
                DVec3::new(-0.05 + 0.005 * f64::from(i), -0.075 + shake, 0.05 + shake)
            })
            .collect();
        for (layers, wanted) in [(Layers::Nearest, 1), (Layers::All, 2)] {
            let lines = lines_on(&flat, &positions_m, &path_m, 0.1, layers);
            assert_eq!(lines.len(), wanted, "{lines:?}");
            for line in &lines {
                assert_eq!(line.len(), 2, "straight: {line:?}");
                assert!(line[0].x < 0.0 && line[1].x > 0.2, "from border to border: {line:?}");
                assert!(line.iter().all(|place| (place.y.abs() - 0.075).abs() < 0.01));
            }
            let in_front = lines.iter().filter(|line| line[0].y > 0.0).count();
            assert_eq!(in_front, 1, "the layer before the hand, and the one behind it");
        }
        let far_m: Vec<DVec3> = path_m.iter().map(|place_m| *place_m + DVec3::Z).collect();
        assert!(lines_on(&flat, &positions_m, &far_m, 0.1, Layers::All).is_empty());
        assert!(lines_on(&flat, &positions_m, &[], 0.1, Layers::All).is_empty());
        assert!(lines_on(&flat, &positions_m, &[DVec3::NAN; 3], 0.1, Layers::All).is_empty());
    }

    #[test]
    fn a_hand_that_comes_from_elsewhere_cuts_the_border_though_it_was_out_of_reach_there() {
        let flat = Flat::rectangle(DVec2::ZERO, 10, 10, DVec2::splat(0.02));
        // The cloth bends away to the left, and the hand goes straight on.
        let bent = |at: &DVec2| DVec3::new(at.x, at.y, -4.0 * (0.1 - at.x).max(0.0));
        let positions_m: Vec<DVec3> = flat.places_m.iter().map(bent).collect();
        for (from, to) in [(-0.1, 0.19), (0.19, -0.1)] {
            let path_m = [DVec3::new(from, 0.1, 0.02), DVec3::new(to, 0.1, 0.02)];
            let lines = lines_on(&flat, &positions_m, &path_m, 0.1, Layers::Nearest);
            assert_eq!(lines.len(), 1);
            assert!(lines[0].iter().any(|at| at.x < 0.0) && lines[0].iter().any(|at| at.x > 0.185), "{lines:?}");
        }
    }

    #[test]
    fn a_cut_into_the_middle_ends_there() {
        let flat = Flat::rectangle(DVec2::ZERO, 10, 10, DVec2::splat(0.02));
        let positions_m: Vec<DVec3> = flat.places_m.iter().map(|at| at.extend(0.0)).collect();
        let path_m = [DVec3::new(-0.03, 0.05, 0.02), DVec3::new(0.09, 0.05, 0.02), DVec3::new(0.09, 0.12, 0.02)];
        let lines = lines_on(&flat, &positions_m, &path_m, 0.1, Layers::Nearest);
        assert_eq!(lines.len(), 1);
        let [from, turn, to] = lines[0][..] else { panic!("{lines:?}") };
        assert!(
            from.x < 0.0 && turn.distance(DVec2::new(0.09, 0.05)) < 0.021 && to.distance(DVec2::new(0.09, 0.12)) < 1e-9
        );
    }
}
