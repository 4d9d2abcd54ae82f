//! Pairs of vertices whose positions were exchanged: two lines of a file swapped, while its faces stayed. Cloth hardly
//! stretches, so giving the two their places back takes nearly all strain from the edges around them; where the cloth is
//! truly creased, an exchange makes things worse.

use glam::Vec3;

/// The strain of an edge beyond which its vertices are suspect: 0.3 median edges longer or shorter than at rest.
const SUSPECT: f32 = 0.09;
/// So many suspects at most are compared pair by pair; beyond, only with vertices near them.
const SUSPECTS: usize = 500;
/// The share of the strain that may remain when a pair that was exchanged is put right. In the sample's creased cloth at
/// least 0.7 remain, of exchanged vertices hardly ever more than 0.2.
const REMAINING: f32 = 0.4;
/// The strain that putting a pair right must take away at least. In cloth that is creased tightly a pair may look better exchanged by 0.5;
/// pairs that were exchanged take away 1.6 or more on the sample.
const SAVED: f32 = 0.75;

/// The share of the strain that may remain when a vertex that was moved alone is put back.
const MOVED: f32 = 0.1;

/// The neighbours of each vertex.
pub(super) fn neighbours(vertex_count: usize, edges: &[[u32; 2]]) -> Vec<Vec<u32>> {
    let mut neighbours = vec![Vec::new(); vertex_count];
    for &[a, b] in edges {
        neighbours[a as usize].push(b);
        neighbours[b as usize].push(a);
    }
    neighbours
}

/// Pairs of exchanged vertices, the least first.
pub(super) fn exchanged(rest_m: &[Vec3], positions_m: &[Vec3], neighbours: &[Vec<u32>]) -> Vec<[u32; 2]> {
    let mut cloth = Cloth { rest_m, positions_m: positions_m.to_vec(), neighbours, edge_m: 0.0 };
    let mut lengths_m: Vec<f32> =
        (0..rest_m.len() as u32).flat_map(|v| cloth.edges(v)).map(|(_, rest_m)| rest_m).collect();
    if lengths_m.is_empty() {
        return Vec::new();
    }
    let middle = lengths_m.len() / 2;
    cloth.edge_m = *lengths_m.select_nth_unstable_by(middle, f32::total_cmp).1;
    let suspects: Vec<u32> = (0..rest_m.len() as u32).filter(|&v| cloth.is_suspect(v)).collect();
    // A corner that changed places with a vertex near it may keep the lengths of its edges: two rings count, too.
    let mut pairs: Vec<[u32; 2]> = Vec::new();
    for (i, &a) in suspects.iter().enumerate() {
        let others = if suspects.len() <= SUSPECTS { &suspects[i + 1..] } else { &[] };
        let ring = &neighbours[a as usize];
        let rings = ring.iter().chain(ring.iter().flat_map(|&near| &neighbours[near as usize]));
        pairs.extend(others.iter().chain(rings).filter(|&&b| b != a).map(|&b| [a.min(b), a.max(b)]));
    }
    pairs.sort_unstable();
    pairs.dedup();
    let mut found: Vec<(f32, [u32; 2])> =
        pairs.into_iter().filter_map(|pair| Some((cloth.saved_by_exchange(pair)?, pair))).collect();
    found.sort_by(|(saved, pair), (other_saved, other)| other_saved.total_cmp(saved).then(pair.cmp(other)));
    // The clearest pair first: each that is put right can explain the strain about another.
    let mut put_right: Vec<[u32; 2]> = Vec::new();
    for (_, pair) in found {
        if cloth.saved_by_exchange(pair).is_some() {
            cloth.positions_m.swap(pair[0] as usize, pair[1] as usize);
            put_right.push(pair);
        }
    }
    put_right.sort_unstable();
    put_right
}

/// How often a place is drawn towards the lengths of its edges.
const STEPS: usize = 30;

/// Whether of a pair that seems exchanged only one was moved: putting that one alone where its edges have their lengths takes away as much strain
/// about both. Gives it, and how far it was moved, metres.
pub(super) fn moved_alone(
    rest_m: &[Vec3],
    positions_m: &[Vec3],
    neighbours: &[Vec<u32>],
    [a, b]: [u32; 2],
) -> Option<(u32, f32)> {
    let mut cloth = Cloth { rest_m, positions_m: positions_m.to_vec(), neighbours, edge_m: 1.0 };
    let strain = |cloth: &Cloth<'_>| -> f32 {
        let around = |vertex: u32| {
            let at_m = cloth.positions_m[vertex as usize];
            cloth
                .edges(vertex)
                .map(move |(end, rest_m)| cloth.edge_strain(at_m, cloth.positions_m[end as usize], rest_m))
        };
        around(a).chain(around(b)).sum()
    };
    let as_is = strain(&cloth);
    cloth.positions_m.swap(a as usize, b as usize);
    let exchanged = strain(&cloth);
    cloth.positions_m.swap(a as usize, b as usize);
    let put_back = [a, b].map(|vertex| {
        let at_m = cloth.by_edges(vertex);
        let moved_m = std::mem::replace(&mut cloth.positions_m[vertex as usize], at_m);
        let left = strain(&cloth);
        cloth.positions_m[vertex as usize] = moved_m;
        (left, vertex, moved_m.distance(at_m))
    });
    let (left, vertex, by_m) = put_back.into_iter().min_by(|a, b| a.0.total_cmp(&b.0))?;
    (left < exchanged.min(MOVED * as_is)).then_some((vertex, by_m))
}

struct Cloth<'a> {
    rest_m: &'a [Vec3],
    positions_m: Vec<Vec3>,
    neighbours: &'a [Vec<u32>],
    /// The median edge at rest.
    edge_m: f32,
}

impl Cloth<'_> {
    fn is_suspect(&self, vertex: u32) -> bool {
        let at_m = self.positions_m[vertex as usize];
        self.edges(vertex)
            .any(|(other, rest_m)| self.edge_strain(at_m, self.positions_m[other as usize], rest_m) > SUSPECT)
    }

    /// The strain that goes away when the two change places; `None` unless that puts them right.
    fn saved_by_exchange(&self, [a, b]: [u32; 2]) -> Option<f32> {
        let at = |vertex: u32| self.positions_m[vertex as usize];
        let around = |vertex: u32, at_m: Vec3, at_other_m: Vec3, other: u32| -> f32 {
            let of_edge = |(end, rest_m)| {
                let end_m = if end == other { at_other_m } else { at(end) };
                self.edge_strain(at_m, end_m, rest_m)
            };
            self.edges(vertex).map(of_edge).sum()
        };
        let before = around(a, at(a), at(b), b) + around(b, at(b), at(a), a);
        let after = around(a, at(b), at(a), b) + around(b, at(a), at(b), a);
        (after < REMAINING * before && before - after > SAVED).then_some(before - after)
    }

    /// Where a vertex lies when its edges have their lengths, from the middle of their other ends.
    fn by_edges(&self, vertex: u32) -> Vec3 {
        let ends: Vec<(Vec3, f32)> =
            self.edges(vertex).map(|(end, rest_m)| (self.positions_m[end as usize], rest_m)).collect();
        let count = ends.len().max(1) as f32;
        let middle = ends.iter().map(|(end_m, _)| *end_m).sum::<Vec3>() / count;
        let drawn = |at_m: Vec3, _| {
            let wanted = ends.iter().map(|(end_m, rest_m)| *end_m + (at_m - *end_m).normalize_or_zero() * *rest_m);
            wanted.sum::<Vec3>() / count
        };
        (0..STEPS).fold(middle, drawn)
    }

    /// The edges of a vertex that have a length at rest, each as its other end and that length.
    fn edges(&self, vertex: u32) -> impl Iterator<Item = (u32, f32)> {
        let length = move |&other: &u32| (other, self.rest_m[vertex as usize].distance(self.rest_m[other as usize]));
        self.neighbours[vertex as usize].iter().map(length).filter(|(_, rest_m)| *rest_m > 0.0)
    }

    /// The square of how much longer or shorter than at rest an edge is, in median edges: short edges, which creases
    /// strain most, count little.
    fn edge_strain(&self, a_m: Vec3, b_m: Vec3, rest_m: f32) -> f32 {
        ((a_m.distance(b_m) - rest_m) / self.edge_m).powi(2)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SIDE: u32 = 12;

    /// A sheet of squares with a diagonal each, draped over a cylinder of 5 cm, and its edges.
    fn sheet() -> (Vec<Vec3>, Vec<Vec3>, Vec<Vec<u32>>) {
        let at = |v: u32| ((v % SIDE) as f32 * 0.015, (v / SIDE) as f32 * 0.015);
        let rest_m: Vec<Vec3> = (0..SIDE * SIDE).map(|v| Vec3::new(at(v).0, at(v).1, 0.0)).collect();
        let bent = |v: u32| {
            let (x, y) = at(v);
            let angle = f64::from(x / 0.05);
            Vec3::new(0.05 * libm::sin(angle) as f32, y, 0.05 - 0.05 * libm::cos(angle) as f32)
        };
        let mut edges = Vec::new();
        for v in 0..SIDE * SIDE {
            let (right, up) = (v % SIDE + 1 < SIDE, v / SIDE + 1 < SIDE);
            edges.extend(right.then_some([v, v + 1]));
            edges.extend(up.then_some([v, v + SIDE]));
            edges.extend((right && up).then_some([v, v + SIDE + 1]));
        }
        (rest_m, (0..SIDE * SIDE).map(bent).collect(), neighbours((SIDE * SIDE) as usize, &edges))
    }

    #[test]
    fn every_exchange_is_found_and_nothing_else() {
        let (rest_m, bent_m, neighbours) = sheet();
        assert_eq!(exchanged(&rest_m, &bent_m, &neighbours), [[0; 2]; 0]);
        for a in 0..SIDE * SIDE {
            for b in a + 1..SIDE * SIDE {
                let mut wrong_m = bent_m.clone();
                wrong_m.swap(a as usize, b as usize);
                assert_eq!(exchanged(&rest_m, &wrong_m, &neighbours), [[a, b]]);
            }
        }
    }

    #[test]
    fn several_exchanges_are_found() {
        let (rest_m, mut wrong_m, neighbours) = sheet();
        let pairs = [[14, 15], [40, 100], [66, 78]];
        pairs.iter().for_each(|&[a, b]: &[usize; 2]| wrong_m.swap(a, b));
        assert_eq!(exchanged(&rest_m, &wrong_m, &neighbours), pairs.map(|pair| pair.map(|v| v as u32)));
    }

    #[test]
    fn a_vertex_that_was_dragged_is_told_from_an_exchange() {
        let (rest_m, bent_m, neighbours) = sheet();
        for vertex in [40u32, 66, 77] {
            let mut wrong_m = bent_m.clone();
            wrong_m[vertex as usize] += Vec3::new(0.0, 0.02, 0.03);
            for pair in [[vertex, vertex + 1], [vertex + SIDE, vertex]] {
                let (moved, by_m) = moved_alone(&rest_m, &wrong_m, &neighbours, pair).unwrap();
                assert!(moved == vertex && (by_m - 0.036).abs() < 0.003, "{moved} by {by_m}");
            }
            for other in [vertex + 1, vertex + SIDE, vertex + 30] {
                let mut wrong_m = bent_m.clone();
                wrong_m.swap(vertex as usize, other as usize);
                assert_eq!(moved_alone(&rest_m, &wrong_m, &neighbours, [vertex, other]), None);
            }
        }
    }

    /// Sound cloth, tightly folded, in which two vertices lie as if exchanged.
    #[test]
    fn a_fold_is_no_exchange() {
        let root = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
        let path = root.join("../shared/data/komon/crumpled/b07.obj");
        let Ok(bytes) = std::fs::read(&path) else {
            #[allow(clippy::print_stdout)]
            {
                println!("skipped: {} is absent", path.display());
            }
            return;
        };
        let places = |bytes: &[u8]| -> Vec<Vec3> {
            let mesh = crate::source::obj::read("cloth.obj", bytes, &mut Vec::new()).unwrap();
            mesh.positions.iter().map(|place| place.as_vec3()).collect()
        };
        let base = std::fs::read(root.join("assets-src/komon/base.obj")).unwrap();
        let mesh = crate::source::obj::read("base.obj", &base, &mut Vec::new()).unwrap();
        let triangles: Vec<[u32; 3]> =
            mesh.triangulate().corners.iter().map(|c| c.map(|corner| corner.vertex)).collect();
        let (rest_m, mut folded_m) = (places(&base), places(&bytes));
        let neighbours = neighbours(rest_m.len(), &super::super::mesh::edges(&triangles));
        assert_eq!(exchanged(&rest_m, &folded_m, &neighbours), [[0; 2]; 0]);
        for pair in [[100u32, 101], [9000, 9020]] {
            let [a, b] = pair.map(|v| v as usize);
            folded_m.swap(a, b);
            assert!(exchanged(&rest_m, &folded_m, &neighbours).contains(&pair), "{pair:?}");
            folded_m.swap(a, b);
        }
    }
}
