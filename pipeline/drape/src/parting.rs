//! Cuts flat cloth along straight lines wherever they run (Shoda 2018, 3.2.3.5, there along the cells' edges): vertices near a line come onto it,
//! edges that cross it are split, and cloth parts along it. A new vertex lies in an old triangle; what the cloth carries there, such as places in
//! space, is carried along. Knows neither forces nor hands.

use crate::slit::Flat;
use glam::{DVec2, DVec3};
use std::collections::{BTreeMap, BTreeSet};

/// Vertices nearer to the line than this share of their shortest edge come onto it; those that may not move count as on it if they are
/// nearer than the second.
const NEAR: f64 = 0.2;
const ON: f64 = 0.02;
/// A vertex moves only where each of its triangles keeps this share of its area.
const KEEPS: f64 = 0.3;
/// Cosine from which on a border is straight at a vertex.
const STRAIGHT: f64 = 0.98;
/// What is crossed at a lower sine than this is run along.
const ALONG: f64 = 0.3;
/// Least doubled area of a triangle over its longest side squared.
const THINNEST: f64 = 1e-4;
/// Cut borders draw back by at most this share of their triangles' height, and where they turn by so many times what they should.
const DRAWN_BACK: f64 = 0.3;
const FARTHEST_BACK: f64 = 3.0;

/// How cloth is parted.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Blade {
    /// What the blade takes away, metres, at least 0: borders that lie in one place would never come apart.
    pub kerf_m: f64,
    /// Whether vertices come onto the line, which keeps triangles well shaped; otherwise cloth lies exactly where it was.
    pub moves: bool,
}

/// Cloth that was cut.
#[derive(Clone, Debug, PartialEq)]
pub struct Parted {
    /// Its flat shape; vertices that were there keep their numbers.
    pub flat: Flat,
    /// What it carries, a value to each vertex.
    pub carried: Vec<Vec<DVec3>>,
    /// Length of the cut, metres.
    pub cut_m: f64,
}

/// Why cloth is not cut.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum PartError {
    /// No line.
    #[error("a cut goes through at least two places, all finite")]
    Line,
    /// A line beside the cloth, or one that ends in its first triangle.
    #[error("the cut parts no two triangles of the cloth")]
    Misses,
    /// Too near to earlier cuts.
    #[error(
        "the cut would leave triangles without area or borders in one place: it runs too near along an earlier one"
    )]
    Thin,
}

/// Cloth while it is cut.
struct Net {
    places_m: Vec<DVec2>,
    triangles: Vec<[u32; 3]>,
    zones: Vec<u32>,
    carried: Vec<Vec<DVec3>>,
    /// Vertices that stay where they are.
    fixed: BTreeSet<u32>,
    /// Edges that part, their smaller vertex first.
    cut: BTreeSet<[u32; 2]>,
}

/// Cuts along a line of straight pieces, in flat coordinates, metres. It begins and ends inside the cloth or beyond its borders; a cut that ends inside leaves
/// cloth whole there. `carried` has a value for each vertex.
///
/// # Errors
/// When the line is none, misses the cloth, or would leave triangles without area or borders in one place.
///
/// # Panics
/// When `carried` has more or fewer values than the cloth vertices.
pub fn part(flat: &Flat, carried: &[&[DVec3]], line_m: &[DVec2], blade: Blade) -> Result<Parted, PartError> {
    assert!(carried.iter().all(|values| values.len() == flat.places_m.len()), "a value to each vertex");
    if line_m.len() < 2 || line_m.iter().any(|place_m| !place_m.is_finite()) {
        return Err(PartError::Line);
    }
    let mut net = Net {
        places_m: flat.places_m.clone(),
        triangles: flat.triangles.clone(),
        zones: flat.zones.clone(),
        carried: carried.iter().map(|values| values.to_vec()).collect(),
        fixed: BTreeSet::new(),
        cut: BTreeSet::new(),
    };
    let mut from = net.end(line_m[0], blade.moves);
    let mut from_m = from.map_or(line_m[0], |v| net.places_m[v as usize]);
    for &place_m in &line_m[1..] {
        let to = net.end(place_m, blade.moves);
        let to_m = to.map_or(place_m, |v| net.places_m[v as usize]);
        net.straight([from_m, to_m], [from, to], blade.moves);
        (from, from_m) = (to, to_m);
    }
    let cut_m = net.part(blade.kerf_m)?;
    if cut_m <= 0.0 {
        return Err(PartError::Misses);
    }
    let is_thin = net.triangles.iter().any(|corners| {
        let [a, b, c] = corners.map(|v| net.places_m[v as usize]);
        let longest_m2 = a.distance_squared(b).max(b.distance_squared(c)).max(c.distance_squared(a));
        (b - a).perp_dot(c - a) < THINNEST * longest_m2
    });
    if is_thin {
        return Err(PartError::Thin);
    }
    let flat = Flat { places_m: net.places_m, triangles: net.triangles, zones: net.zones };
    Ok(Parted { flat, carried: net.carried, cut_m })
}

impl Net {
    fn corners_m(&self, triangle: usize) -> [DVec2; 3] {
        self.triangles[triangle].map(|v| self.places_m[v as usize])
    }

    /// The triangles at each vertex.
    fn around(&self) -> Vec<Vec<usize>> {
        let mut around = vec![Vec::new(); self.places_m.len()];
        for (triangle, corners) in self.triangles.iter().enumerate() {
            corners.iter().for_each(|&v| around[v as usize].push(triangle));
        }
        around
    }

    /// The vertex at which a cut begins, ends or turns: one that is there or comes there, or a new one; none beyond the cloth.
    fn end(&mut self, place_m: DVec2, moves: bool) -> Option<u32> {
        let (triangle, shares) = (0..self.triangles.len()).find_map(|triangle| {
            let shares = shares(self.corners_m(triangle), place_m);
            (shares.min_element() >= 0.0).then_some((triangle, shares))
        })?;
        let (corners, corners_m) = (self.triangles[triangle], self.corners_m(triangle));
        let sides_m = [0, 1, 2].map(|i| corners_m[(i + 1) % 3].distance(corners_m[(i + 2) % 3]));
        let shortest_m = sides_m[0].min(sides_m[1]).min(sides_m[2]);
        let nearest = (0..3)
            .min_by(|a, b| corners_m[*a].distance(place_m).total_cmp(&corners_m[*b].distance(place_m)))
            .expect("three corners");
        let away_m = corners_m[nearest].distance(place_m);
        let around: Vec<usize> =
            (0..self.triangles.len()).filter(|t| self.triangles[*t].contains(&corners[nearest])).collect();
        let is_inside = self.beside(corners[nearest], &around).is_empty();
        let comes = moves && is_inside && away_m < NEAR * shortest_m && self.comes(corners[nearest], place_m, &around);
        let vertex = if comes || away_m < ON * shortest_m {
            corners[nearest]
        } else {
            let opposite = shares.min_position();
            let [a, b] = [corners[(opposite + 1) % 3], corners[(opposite + 2) % 3]];
            let doubled_m2 = (corners_m[1] - corners_m[0]).perp_dot(corners_m[2] - corners_m[0]);
            if shares[opposite] * doubled_m2 / sides_m[opposite] < NEAR * shortest_m {
                let [a_m, b_m] = [a, b].map(|v| self.places_m[v as usize]);
                let share = (place_m - a_m).dot(b_m - a_m) / a_m.distance_squared(b_m);
                self.split([a, b], share.clamp(ON, 1.0 - ON))
            } else {
                let new = self.add(corners, shares);
                self.triangles[triangle] = [corners[0], corners[1], new];
                for i in 1..3 {
                    self.triangles.push([corners[i], corners[(i + 1) % 3], new]);
                    self.zones.push(self.zones[triangle]);
                }
                new
            }
        };
        self.fixed.insert(vertex);
        Some(vertex)
    }

    /// A cut from one place to another; `ends` are the vertices there.
    fn straight(&mut self, [from_m, to_m]: [DVec2; 2], ends: [Option<u32>; 2], moves: bool) {
        let length_m = from_m.distance(to_m);
        if length_m == 0.0 {
            return;
        }
        let along = (to_m - from_m) / length_m;
        let is_within = |place_m: DVec2| {
            let at_m = along.dot(place_m - from_m);
            (-1e-9..=length_m + 1e-9).contains(&at_m)
        };
        let away_m = |place_m: DVec2| along.perp_dot(place_m - from_m);
        let mut on: BTreeSet<u32> = ends.into_iter().flatten().collect();
        let around = self.around();
        for v in 0..self.places_m.len() as u32 {
            let at_m = self.places_m[v as usize];
            if !is_within(at_m) || on.contains(&v) {
                continue;
            }
            let neighbours = around[v as usize].iter().flat_map(|t| self.triangles[*t]).filter(|other| *other != v);
            let shortest_m =
                neighbours.map(|other| self.places_m[other as usize].distance(at_m)).fold(f64::INFINITY, f64::min);
            let beyond_m = away_m(at_m);
            if beyond_m.abs() >= NEAR * shortest_m {
                continue;
            }
            let onto_m = match self.beside(v, &around[v as usize])[..] {
                [] => Some(at_m - along.perp() * beyond_m),
                // Along a border that is nearly straight, towards the neighbour on the line's side: the other's way would leave the cloth where it bends.
                [a, b] => {
                    let ways = [a, b].map(|other| (self.places_m[other as usize] - at_m).normalize_or_zero());
                    let is_straight = ways[0].dot(ways[1]) < -STRAIGHT;
                    let way = ways.into_iter().find(|way| is_straight && along.perp_dot(*way) * beyond_m <= 0.0);
                    let way = way.filter(|way| along.perp_dot(*way).abs() > ALONG);
                    way.map(|way| at_m - way * (beyond_m / along.perp_dot(way)))
                }
                _ => None,
            };
            let comes = moves && onto_m.is_some_and(|onto_m| self.comes(v, onto_m, &around[v as usize]));
            if comes || beyond_m.abs() < ON * shortest_m {
                on.insert(v);
            }
        }
        let crossed: Vec<([u32; 2], f64)> = self
            .edges()
            .into_keys()
            .filter(|edge| edge.iter().all(|v| !on.contains(v)))
            .filter_map(|edge| {
                let [a_m, b_m] = edge.map(|v| self.places_m[v as usize]);
                let [a, b] = [away_m(a_m), away_m(b_m)];
                let share = a / (a - b);
                (a * b < 0.0 && is_within(a_m.lerp(b_m, share))).then_some((edge, share))
            })
            .collect();
        for (edge, share) in crossed {
            on.insert(self.split(edge, share));
        }
        let parts = self.edges().into_keys().filter(|edge| edge.iter().all(|v| on.contains(v)));
        let parts: Vec<[u32; 2]> = parts.collect();
        self.cut.extend(parts);
        self.fixed.extend(on);
    }

    /// All edges, the smaller vertex first, with how many triangles have each.
    fn edges(&self) -> BTreeMap<[u32; 2], usize> {
        let mut edges = BTreeMap::new();
        for corners in &self.triangles {
            sides(*corners).for_each(|[a, b]| *edges.entry([a.min(b), a.max(b)]).or_insert(0) += 1);
        }
        edges
    }

    /// The neighbours of a vertex along the cloth's border; none inside.
    fn beside(&self, vertex: u32, around: &[usize]) -> Vec<u32> {
        let mut neighbours = BTreeMap::new();
        for &triangle in around {
            for other in self.triangles[triangle].into_iter().filter(|other| *other != vertex) {
                *neighbours.entry(other).or_insert(0) += 1;
            }
        }
        neighbours.into_iter().filter(|(_, count)| *count == 1).map(|(other, _)| other).collect()
    }

    /// Moves a vertex, unless it is fixed, a triangle would lose too much of its area or the cloth would grow over its border. Whether it is there now.
    fn comes(&mut self, vertex: u32, to_m: DVec2, around: &[usize]) -> bool {
        if self.fixed.contains(&vertex) {
            return false;
        }
        let doubled_m2 = |[a, b, c]: [DVec2; 3]| (b - a).perp_dot(c - a);
        let mut within: Option<(f64, usize, DVec3)> = None;
        let (mut all_m2, mut grown_m2) = (0.0, 0.0);
        for &triangle in around {
            let before_m = self.corners_m(triangle);
            let after_m = [0, 1, 2].map(|i| if self.triangles[triangle][i] == vertex { to_m } else { before_m[i] });
            if doubled_m2(after_m) < KEEPS * doubled_m2(before_m) {
                return false;
            }
            all_m2 += doubled_m2(before_m);
            grown_m2 += doubled_m2(after_m) - doubled_m2(before_m);
            let shares = shares(before_m, to_m);
            if within.is_none_or(|(least, ..)| shares.min_element() > least) {
                within = Some((shares.min_element(), triangle, shares));
            }
        }
        let Some((_, triangle, shares)) = within else { return false };
        if grown_m2 > 1e-9 * all_m2 {
            return false;
        }
        let corners = self.triangles[triangle];
        for values in &mut self.carried {
            values[vertex as usize] = (0..3).map(|i| values[corners[i] as usize] * shares[i]).sum();
        }
        self.places_m[vertex as usize] = to_m;
        true
    }

    /// A new vertex in a triangle.
    fn add(&mut self, corners: [u32; 3], shares: DVec3) -> u32 {
        self.places_m.push((0..3).map(|i| self.places_m[corners[i] as usize] * shares[i]).sum());
        for values in &mut self.carried {
            values.push((0..3).map(|i| values[corners[i] as usize] * shares[i]).sum());
        }
        self.places_m.len() as u32 - 1
    }

    /// A new vertex on an edge, at a share of the way.
    fn split(&mut self, [a, b]: [u32; 2], share: f64) -> u32 {
        let new = self.add([a, b, b], DVec3::new(1.0 - share, share, 0.0));
        for triangle in 0..self.triangles.len() {
            let corners = self.triangles[triangle];
            if corners.contains(&a) && corners.contains(&b) {
                self.triangles[triangle] = corners.map(|v| if v == b { new } else { v });
                self.triangles.push(corners.map(|v| if v == a { new } else { v }));
                self.zones.push(self.zones[triangle]);
            }
        }
        if self.cut.remove(&[a.min(b), a.max(b)]) {
            self.cut.extend([[a, new], [b, new]]);
        }
        new
    }

    /// Parts the cloth along what was cut: at each vertex, triangles that are joined by other edges only through it get a vertex of their own. How much was cut,
    /// metres; an error where borders have no room to come apart.
    fn part(&mut self, kerf_m: f64) -> Result<f64, PartError> {
        let edges = self.edges();
        let is_inner = |edge: &&[u32; 2]| edges.get(*edge) == Some(&2);
        let length_m = |[a, b]: &[u32; 2]| self.places_m[*a as usize].distance(self.places_m[*b as usize]);
        let cut_m: f64 = self.cut.iter().filter(is_inner).map(length_m).sum();
        let around = self.around();
        let on: BTreeSet<u32> = self.cut.iter().flatten().copied().collect();
        let mut parted = self.triangles.clone();
        // Vertices on either side, with the triangles there.
        let mut borders: Vec<(u32, Vec<usize>)> = Vec::new();
        let mut count = self.places_m.len() as u32;
        for vertex in on {
            let fans = self.fans(vertex, &around[vertex as usize]);
            if fans.len() < 2 {
                continue;
            }
            for (i, fan) in fans.into_iter().enumerate() {
                let mine = if i == 0 { vertex } else { count };
                count += u32::from(i > 0);
                for &triangle in &fan {
                    parted[triangle].iter_mut().filter(|v| **v == vertex).for_each(|v| *v = mine);
                }
                borders.push((mine, fan));
            }
        }
        let mut of = 0;
        let mut stays = false;
        let mut moved = Vec::new();
        for (mine, fan) in &borders {
            if (*mine as usize) < self.places_m.len() {
                of = *mine;
                stays = false;
            }
            let (triangle, shares) = match self.drawn_back(of, fan, 0.5 * kerf_m) {
                Some(back) => back,
                // One border may stay where the others draw back; two would lie in one place, and cloth would meet itself.
                None if stays => return Err(PartError::Thin),
                None => {
                    stays = true;
                    (fan[0], DVec3::from_array(self.triangles[fan[0]].map(|v| f64::from(v == of))))
                }
            };
            let corners = self.triangles[triangle];
            let place_m: DVec2 = (0..3).map(|i| self.places_m[corners[i] as usize] * shares[i]).sum();
            let values: Vec<DVec3> = (self.carried.iter())
                .map(|values| (0..3).map(|i| values[corners[i] as usize] * shares[i]).sum())
                .collect();
            moved.push((*mine as usize, place_m, values));
        }
        self.places_m.resize(count as usize, DVec2::ZERO);
        self.carried.iter_mut().for_each(|values| values.resize(count as usize, DVec3::ZERO));
        for (vertex, place_m, values) in moved {
            self.places_m[vertex] = place_m;
            self.carried.iter_mut().zip(values).for_each(|(carried, value)| carried[vertex] = value);
        }
        self.triangles = parted;
        Ok(cut_m)
    }

    /// Where a vertex of a border comes to lie when the border draws back by `back_m` into its own triangles, as a place in one of these: borders stay parallel, and at the
    /// cloth's outline it goes along that. None where there is no room, in triangles much narrower than `back_m`.
    fn drawn_back(&self, vertex: u32, fan: &[usize], back_m: f64) -> Option<(usize, DVec3)> {
        let at_m = self.places_m[vertex as usize];
        // Counter-clockwise, the fan begins at one border and ends at the other.
        let turned = |triangle: &usize| {
            let [a, b, c] = self.triangles[*triangle];
            if a == vertex {
                [b, c]
            } else if b == vertex {
                [c, a]
            } else {
                [a, b]
            }
        };
        let (firsts, lasts): (Vec<u32>, Vec<u32>) = fan.iter().map(turned).map(|[first, last]| (first, last)).unzip();
        // At a corner of more than half a turn, into the cloth where the outline would go on; along the outline itself the border would come over the other one.
        let along = |outline: DVec2, normal: DVec2| {
            let slant = outline.dot(normal);
            outline / slant.abs().max(ALONG).copysign(slant)
        };
        let first = firsts.iter().find(|v| !lasts.contains(v));
        let last = lasts.iter().find(|v| !firsts.contains(v));
        let way = first.zip(last).map_or(DVec2::ZERO, |(&first, &last)| {
            let ways = [first, last].map(|other| (self.places_m[other as usize] - at_m).normalize_or_zero());
            let normals = [ways[0].perp(), -ways[1].perp()];
            let is_cut = [first, last].map(|other| self.cut.contains(&[vertex.min(other), vertex.max(other)]));
            match is_cut {
                [true, true] => {
                    let both = normals[0] + normals[1];
                    both / (0.5 * both.length_squared()).max(1e-9)
                }
                [true, false] => along(ways[1], normals[0]),
                [false, true] => along(ways[0], normals[1]),
                [false, false] => ways[0] + ways[1],
            }
        });
        let mut way_m = (way * back_m).clamp_length_max(FARTHEST_BACK * back_m);
        let within = |to_m: DVec2| {
            let shares = fan.iter().map(|triangle| (*triangle, shares(self.corners_m(*triangle), to_m)));
            shares.max_by(|a, b| a.1.min_element().total_cmp(&b.1.min_element())).expect("a fan has triangles")
        };
        for _ in 0..8 {
            let (triangle, shares) = within(at_m + way_m);
            let own = self.triangles[triangle].iter().position(|v| *v == vertex).map_or(0.0, |i| shares[i]);
            if shares.min_element() > -1e-3 && own >= 1.0 - DRAWN_BACK {
                return Some((triangle, shares));
            }
            way_m *= 0.5;
        }
        None
    }

    /// The triangles at a vertex in groups that edges join which are not cut.
    fn fans(&self, vertex: u32, around: &[usize]) -> Vec<Vec<usize>> {
        let mut left: Vec<usize> = around.to_vec();
        let mut fans = Vec::new();
        while !left.is_empty() {
            let mut fan = vec![left.remove(0)];
            let mut next = 0;
            while next < fan.len() {
                for other in self.triangles[fan[next]].into_iter().filter(|other| *other != vertex) {
                    if !self.cut.contains(&[vertex.min(other), vertex.max(other)])
                        && let Some(beside) = left.iter().position(|t| self.triangles[*t].contains(&other))
                    {
                        fan.push(left.remove(beside));
                    }
                }
                next += 1;
            }
            fans.push(fan);
        }
        fans
    }
}

fn sides([a, b, c]: [u32; 3]) -> impl Iterator<Item = [u32; 2]> {
    [[a, b], [b, c], [c, a]].into_iter()
}

/// Barycentric coordinates, below 0 outside.
fn shares([a, b, c]: [DVec2; 3], place_m: DVec2) -> DVec3 {
    let doubled_m2 = (b - a).perp_dot(c - a);
    let of_b = (place_m - a).perp_dot(c - a) / doubled_m2;
    let of_c = (b - a).perp_dot(place_m - a) / doubled_m2;
    DVec3::new(1.0 - of_b - of_c, of_b, of_c)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::intersections::{Crossing, self_intersections};
    use proptest::prelude::*;

    const BLADE: Blade = Blade { kerf_m: 1e-3, moves: true };

    fn cloth() -> Flat {
        Flat::rectangle(DVec2::ZERO, 10, 12, DVec2::new(0.02, 0.025))
    }

    fn area_m2(flat: &Flat) -> f64 {
        let doubled = |corners: &[u32; 3]| {
            let [a, b, c] = corners.map(|v| flat.places_m[v as usize]);
            (b - a).perp_dot(c - a)
        };
        assert!(flat.triangles.iter().all(|corners| doubled(corners) > 0.0), "none is turned over");
        flat.triangles.iter().map(|corners| 0.5 * doubled(corners)).sum()
    }

    /// Pieces, and open edges; every edge has at most two triangles, every vertex one fan of them.
    fn pieces(flat: &Flat) -> (usize, usize) {
        let mut edges: BTreeMap<[u32; 2], Vec<usize>> = BTreeMap::new();
        for (triangle, corners) in flat.triangles.iter().enumerate() {
            sides(*corners).for_each(|[a, b]| edges.entry([a.min(b), a.max(b)]).or_default().push(triangle));
        }
        assert!(edges.values().all(|at| at.len() <= 2), "a manifold");
        let open = edges.values().filter(|at| at.len() == 1).count();
        let mut ends = vec![0; flat.places_m.len()];
        let of_open = edges.iter().filter(|(_, at)| at.len() == 1).flat_map(|(edge, _)| edge);
        of_open.for_each(|v| ends[*v as usize] += 1);
        assert!(ends.iter().all(|count| *count == 0 || *count == 2), "one fan at each vertex");
        let mut piece: Vec<usize> = (0..flat.triangles.len()).collect();
        fn root(piece: &mut [usize], mut of: usize) -> usize {
            while piece[of] != of {
                piece[of] = piece[piece[of]];
                of = piece[of];
            }
            of
        }
        for at in edges.values().filter(|at| at.len() == 2) {
            let [a, b] = [root(&mut piece, at[0]), root(&mut piece, at[1])];
            piece[a] = b;
        }
        (piece.iter().enumerate().filter(|(of, to)| of == *to).count(), open)
    }

    /// A sheet rolled up, so that what is carried is not flat.
    fn rolled(flat: &Flat) -> Vec<DVec3> {
        let place = |at: &DVec2| {
            let turn = at.x / 0.1;
            DVec3::new(0.1 * libm::sin(turn), at.y, 0.1 * libm::cos(turn))
        };
        flat.places_m.iter().map(place).collect()
    }

    #[test]
    fn a_cut_from_border_to_border_makes_two_pieces_along_a_straight_line() {
        let flat = cloth();
        let at_m = rolled(&flat);
        // Slanting, along a row, through corners of cells, and along a turn.
        let lines: [&[(f64, f64)]; 5] = [
            &[(-0.01, 0.08), (0.23, 0.21)],
            &[(-0.01, 0.1), (0.3, 0.1)],
            &[(0.0, 0.0), (0.2, 0.25)],
            &[(0.05, -0.1), (0.07, 0.4)],
            &[(-0.01, 0.11), (0.093, 0.117), (0.12, 0.31)],
        ];
        for line in lines {
            let line: Vec<DVec2> = line.iter().map(|place| DVec2::from(*place)).collect();
            let parted = part(&flat, &[&at_m], &line, BLADE).unwrap();
            assert_eq!(pieces(&parted.flat).0, 2, "{line:?}");
            let lost_m2 = area_m2(&flat) - area_m2(&parted.flat);
            assert!(lost_m2 > 0.0 && lost_m2 < 1.1e-3 * parted.cut_m, "{line:?}: {lost_m2} of {}", parted.cut_m);
            // New borders lie along the line, half a kerf away.
            let exact = part(&flat, &[&at_m], &line, Blade { kerf_m: 0.0, moves: true }).unwrap();
            for v in flat.places_m.len()..exact.flat.places_m.len() {
                let at = exact.flat.places_m[v];
                let away_m = line
                    .windows(2)
                    .map(|pair| (pair[1] - pair[0]).normalize().perp_dot(at - pair[0]).abs())
                    .fold(f64::INFINITY, f64::min);
                assert!(away_m < 0.02 * 0.025, "{line:?}: {away_m} m");
            }
            // What is carried stays on the roll: chords of 2 cm are 0.5 mm deep.
            for (v, at) in parted.carried[0].iter().enumerate() {
                let far_m = DVec2::new(at.x, at.z).length();
                assert!((0.0985..0.1001).contains(&far_m) && (at.y - parted.flat.places_m[v].y).abs() < 1e-9);
            }
        }
    }

    #[test]
    fn a_cut_that_ends_inside_leaves_cloth_whole_there_and_a_second_one_frees_a_piece() {
        let flat = cloth();
        let cut = |flat: &Flat, line: &[(f64, f64)]| {
            let line: Vec<DVec2> = line.iter().map(|place| DVec2::from(*place)).collect();
            part(flat, &[], &line, BLADE).map(|parted| parted.flat)
        };
        let (_, before) = pieces(&flat);
        let once = cut(&flat, &[(0.11, 0.5), (0.097, 0.12)]).unwrap();
        assert_eq!(pieces(&once).0, 1);
        assert!(pieces(&once).1 >= before + 12, "two more borders");
        // Into the end of the first: a corner comes off.
        let twice = cut(&once, &[(0.3, 0.16), (0.09, 0.16)]).unwrap();
        assert_eq!(pieces(&twice).0, 2);
        // A hole.
        let hole = [(0.05, 0.05), (0.15, 0.05), (0.15, 0.15), (0.05, 0.15), (0.05, 0.05)];
        assert_eq!(pieces(&cut(&flat, &hole).unwrap()).0, 2);
        assert_eq!(cut(&flat, &[(0.3, 0.0), (0.3, 1.0)]), Err(PartError::Misses));
        assert_eq!(cut(&flat, &[(0.1, 0.1)]), Err(PartError::Line));
        assert_eq!(cut(&flat, &[(0.1, 0.1), (f64::NAN, 0.2)]), Err(PartError::Line));
    }

    #[test]
    fn a_sliver_beside_an_earlier_cut_that_is_narrower_than_the_blade_is_not_cut() {
        // Pieces of the second line cross where its first piece leaves a sliver between it and the border of the first line, a few micrometres high. Of
        // the four corners there, two have no room to draw back.
        let lines: [&[(f64, f64)]; 2] = [
            &[(0.0, 0.1057142842141176), (0.21656015769441675, 0.18086465628422102)],
            &[
                (-0.013794106120003471, 0.0951020710558992),
                (0.17054672798360823, 0.16992350376017062),
                (0.09939995837314938, 0.0684904243637957),
                (0.04555708925687756, 0.2521301342456422),
            ],
        ];
        let [first, second] = lines.map(|line| line.iter().map(|place| DVec2::from(*place)).collect::<Vec<_>>());
        let blade = Blade { moves: false, ..BLADE };
        let once = part(&cloth(), &[], &first, blade).unwrap().flat;
        let twice = part(&once, &[&rolled(&once)], &second, blade);
        let crossings = twice.map(|twice| self_intersections(&twice.carried[0], &twice.flat.triangles));
        assert_eq!(crossings, Err(PartError::Thin));
    }

    /// Where the cloth lies over itself, laid out flat.
    fn overlaps(flat: &Flat) -> Vec<Crossing> {
        let places_m: Vec<DVec3> = flat.places_m.iter().map(|place_m| place_m.extend(0.0)).collect();
        self_intersections(&places_m, &flat.triangles)
    }

    #[test]
    fn a_cut_from_the_end_of_an_earlier_one_lays_no_cloth_over_cloth() {
        // The earlier cut's borders are outline there, on one side of the later cut at a corner of more than half a turn.
        for moves in [true, false] {
            let blade = Blade { moves, ..BLADE };
            let end_m = DVec2::new(0.1, 0.125);
            let once = part(&cloth(), &[], &[DVec2::new(-0.01, 0.125), end_m], blade).unwrap().flat;
            for to_m in [(0.3, 0.13), (0.3, 0.4), (0.1, 0.4), (-0.01, 0.19), (-0.01, 0.05), (0.1, -0.1), (0.3, 0.0)] {
                let twice = part(&once, &[], &[end_m, to_m.into()], blade).unwrap();
                assert_eq!(overlaps(&twice.flat), [], "to {to_m:?}, moves: {moves}");
                let lost_m2 = area_m2(&once) - area_m2(&twice.flat);
                assert!(lost_m2 > 0.0 && lost_m2 < 1.1e-3 * twice.cut_m, "to {to_m:?}: {lost_m2} of {}", twice.cut_m);
            }
        }
    }

    #[test]
    fn a_border_that_comes_onto_a_line_stays_on_its_side_of_a_narrow_slit() {
        // Both lines leave the cloth in one place, the first nearly along the outline.
        let lines = [[(0.1866, 0.2875), (0.2171, 0.0)], [(0.1273, -0.0244), (0.23, 0.2673)]];
        let mut flat = cloth();
        for line in lines {
            flat = part(&flat, &[], &line.map(DVec2::from), BLADE).unwrap().flat;
            assert_eq!(overlaps(&flat), []);
        }
    }

    proptest! {
        #[test]
        fn however_often_cloth_is_cut_it_stays_a_manifold(
            lines in prop::collection::vec(prop::collection::vec((-0.03..0.23, -0.03..0.33), 2..5), 1..5),
            moves in any::<bool>(),
        ) {
            let mut flat = cloth();
            let whole_m2 = area_m2(&flat);
            let mut cut_m = 0.0;
            for line in lines {
                let line: Vec<DVec2> = line.into_iter().map(DVec2::from).collect();
                match part(&flat, &[&rolled(&flat)], &line, Blade { moves, ..BLADE }) {
                    Ok(parted) => {
                        let crossings = self_intersections(&parted.carried[0], &parted.flat.triangles);
                        prop_assert!(crossings.is_empty(), "{crossings:?}");
                        cut_m += parted.cut_m;
                        flat = parted.flat;
                    }
                    Err(error) => prop_assert!(error == PartError::Misses || error == PartError::Thin),
                }
                pieces(&flat);
                let overlaps = overlaps(&flat);
                prop_assert!(overlaps.is_empty(), "{overlaps:?}");
                let lost_m2 = whole_m2 - area_m2(&flat);
                prop_assert!(lost_m2 >= -1e-12 && lost_m2 <= 2e-3 * cut_m + 1e-12, "{lost_m2} of {cut_m}");
            }
        }
    }
}
