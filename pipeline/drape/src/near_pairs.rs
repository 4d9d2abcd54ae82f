//! Where cloth comes near itself: vertices with triangles and edges with edges, by their exact distances; and planes between them. As long as
//! all particles keep to their sides, cloth that was clear of itself stays so, however the solver moves it. Knows no forces.

use crate::parallel;
use crate::room::Side;
use crate::triangle_tree::{Extent, TriangleTree, nearest_on_triangle};
use glam::DVec3;

/// Two things that each go less than half of their distance do not meet; the rest is for rounding.
const OF_DISTANCE: f64 = 0.45;
/// Nearer than this the share shrinks with the distance, metres: what is pressed together comes ever nearer, but never meets, not even after
/// rounding.
const CLOSE_M: f64 = 5e-4;
/// Nearer than this two things have no plane between them, metres: they stay where they are.
const TOUCHING_M: f64 = 1e-12;
/// Pairs of triangles that a thread takes at once.
const AT_ONCE: usize = 2048;

/// A vertex and a triangle or two edges, as the vector from one to the other: the sum of four particles' places, each times a weight.
#[derive(Clone, Copy, Debug)]
pub struct NearPair {
    /// The particles.
    pub corners: [u32; 4],
    /// How many of them are of the first one: a vertex, or the ends of an edge.
    pub of_first: usize,
    /// 1 in sum over the first one, -1 over the second.
    pub weights: [f64; 4],
    /// Unit, from the second to the first.
    pub normal: DVec3,
    /// Metres.
    pub distance_m: f64,
    /// Whether an edge joins the two.
    pub are_neighbours: bool,
}

/// A mesh whose near pairs are found again and again.
#[derive(Clone, Debug)]
pub struct NearPairs {
    triangles: Vec<[u32; 3]>,
    tree: TriangleTree,
    /// For each triangle the corners and edges that no earlier triangle has, so that each pair is found once.
    vertices: Vec<[bool; 3]>,
    edges: Vec<[bool; 3]>,
    /// The neighbours of each vertex, ascending.
    neighbours: Vec<Vec<u32>>,
}

/// What is near at one time.
#[derive(Clone, Debug, Default)]
pub struct Found {
    /// Pairs nearer than was asked for pushing.
    pub pairs: Vec<NearPair>,
    /// Planes between all that is nearer than what was looked for, where they leave a particle less than [`Found::farthest_m`].
    pub sides: Vec<Side>,
    /// How far particles may go whichever way, metres, for what is beyond the reach.
    pub farthest_m: f64,
}

impl NearPairs {
    /// For a mesh with vertices at `positions_m`.
    ///
    /// # Panics
    /// When a triangle names a vertex that is not there.
    #[must_use]
    pub fn new(positions_m: &[DVec3], triangles: &[[u32; 3]]) -> NearPairs {
        let mut neighbours = vec![Vec::new(); positions_m.len()];
        let mut has_vertex = vec![false; positions_m.len()];
        let mut has_edge = std::collections::BTreeSet::new();
        let (mut vertices, mut edges) = (Vec::new(), Vec::new());
        for corners in triangles {
            vertices.push(corners.map(|v| !std::mem::replace(&mut has_vertex[v as usize], true)));
            let sides = [[corners[0], corners[1]], [corners[1], corners[2]], [corners[2], corners[0]]];
            edges.push(sides.map(|[a, b]| {
                neighbours[a as usize].push(b);
                neighbours[b as usize].push(a);
                has_edge.insert([a.min(b), a.max(b)])
            }));
        }
        for near in &mut neighbours {
            near.sort_unstable();
            near.dedup();
        }
        let tree = TriangleTree::new(positions_m, triangles);
        NearPairs { triangles: triangles.to_vec(), tree, vertices, edges, neighbours }
    }

    /// Looks for all that comes nearer than `reach_m` and lists what comes nearer than `push_m`. The same on any number of threads.
    pub fn find(&mut self, positions_m: &[DVec3], reach_m: f64, push_m: f64) -> Found {
        self.tree.refit(positions_m);
        let near = self.tree.self_pairs(reach_m);
        let this = &*self;
        let farthest_m = OF_DISTANCE * reach_m;
        let parts = parallel::collect_each(near.len().div_ceil(AT_ONCE), |part, found: &mut Vec<Found>| {
            let (mut pairs, mut sides) = (Vec::new(), Vec::new());
            for &[first, second] in &near[part * AT_ONCE..near.len().min((part + 1) * AT_ONCE)] {
                this.near(positions_m, [first, second], reach_m, &mut |pair, is_first| {
                    add_sides(positions_m, &pair, farthest_m, &mut sides);
                    if is_first && pair.distance_m > 0.0 && pair.distance_m < push_m {
                        pairs.push(NearPair { are_neighbours: this.are_neighbours(&pair), ..pair });
                    }
                });
            }
            found.push(Found { pairs, sides, farthest_m });
        });
        let mut found = Found { pairs: Vec::new(), sides: Vec::new(), farthest_m };
        for part in parts {
            found.pairs.extend(part.pairs);
            found.sides.extend(part.sides);
        }
        found
    }

    /// Adds the near pairs of two triangles. Where the nearest places are on an edge or a vertex of a triangle, all triangles there and their
    /// edges find the same: `add` is told of one of them that it is the first.
    fn near(&self, positions_m: &[DVec3], pair: [u32; 2], reach_m: f64, add: &mut impl FnMut(NearPair, bool)) {
        let corners = [self.triangles[pair[0] as usize], self.triangles[pair[1] as usize]];
        let at = |v: u32| positions_m[v as usize];
        let places = [
            [at(corners[0][0]), at(corners[0][1]), at(corners[0][2])],
            [at(corners[1][0]), at(corners[1][1]), at(corners[1][2])],
        ];
        let squared_reach = reach_m * reach_m;
        let boxes = [Extent::around(&places[0]).grown(reach_m), Extent::around(&places[1]).grown(reach_m)];
        for (of, other) in [(0, 1), (1, 0)] {
            let triangle = corners[other];
            for side in 0..3 {
                let (vertex, place_m) = (corners[of][side], places[of][side]);
                if !self.vertices[pair[of] as usize][side]
                    || !boxes[other].overlaps(&Extent { low_m: place_m, high_m: place_m })
                    || triangle.contains(&vertex)
                {
                    continue;
                }
                let (nearest_m, shares) = nearest_on_triangle(places[other], place_m);
                let way = place_m - nearest_m;
                let squared = way.length_squared();
                if squared < squared_reach {
                    let distance_m = squared.sqrt();
                    let near = NearPair {
                        corners: [vertex, triangle[0], triangle[1], triangle[2]],
                        of_first: 1,
                        weights: [1.0, -shares.x, -shares.y, -shares.z],
                        normal: way / distance_m.max(f64::MIN_POSITIVE),
                        distance_m,
                        are_neighbours: false,
                    };
                    add(near, self.has_first(pair[other] as usize, shares));
                }
            }
        }
        const SIDES: [[usize; 2]; 3] = [[0, 1], [1, 2], [2, 0]];
        for [i, j] in SIDES {
            let (first, ends) = ([corners[0][i], corners[0][j]], [places[0][i], places[0][j]]);
            let around = Extent { low_m: ends[0].min(ends[1]), high_m: ends[0].max(ends[1]) };
            if !self.edges[pair[0] as usize][i] || !boxes[1].overlaps(&around) {
                continue;
            }
            let around = around.grown(reach_m);
            for [k, l] in SIDES {
                let (second, others) = ([corners[1][k], corners[1][l]], [places[1][k], places[1][l]]);
                if !self.edges[pair[1] as usize][k]
                    || !around.overlaps(&Extent { low_m: others[0].min(others[1]), high_m: others[0].max(others[1]) })
                    || first.contains(&second[0])
                    || first.contains(&second[1])
                {
                    continue;
                }
                let [s, t] = nearest_of_edges(ends, others);
                let way = ends[0] + (ends[1] - ends[0]) * s - others[0] - (others[1] - others[0]) * t;
                let squared = way.length_squared();
                if squared < squared_reach {
                    let distance_m = squared.sqrt();
                    let near = NearPair {
                        corners: [first[0], first[1], second[0], second[1]],
                        of_first: 2,
                        weights: [1.0 - s, s, t - 1.0, -t],
                        normal: way / distance_m.max(f64::MIN_POSITIVE),
                        distance_m,
                        are_neighbours: false,
                    };
                    add(near, s > 0.0 && s < 1.0 && t > 0.0 && t < 1.0);
                }
            }
        }
    }

    /// Whether a triangle is the first at a place in it.
    fn has_first(&self, triangle: usize, shares: DVec3) -> bool {
        match shares.to_array().map(|share| share > 0.0) {
            [true, true, true] => true,
            [true, true, false] => self.edges[triangle][0],
            [false, true, true] => self.edges[triangle][1],
            [true, false, true] => self.edges[triangle][2],
            [true, false, false] => self.vertices[triangle][0],
            [false, true, false] => self.vertices[triangle][1],
            _ => self.vertices[triangle][2],
        }
    }

    /// Whether an edge joins the two.
    fn are_neighbours(&self, pair: &NearPair) -> bool {
        let (first, second) = pair.corners.split_at(pair.of_first);
        first.iter().any(|&a| second.iter().any(|b| self.neighbours[a as usize].binary_search(b).is_ok()))
    }
}

/// All of the first one lies on the normal's side of its nearest place, all of the second on the other side of its own: each may go as far as to
/// these, and a share of the distance between them.
fn add_sides(positions_m: &[DVec3], pair: &NearPair, farthest_m: f64, sides: &mut Vec<Side>) {
    let touch = pair.distance_m < TOUCHING_M;
    let share_m = OF_DISTANCE * pair.distance_m * (pair.distance_m / CLOSE_M).min(1.0);
    for (mine, normal) in [(0..pair.of_first, pair.normal), (pair.of_first..4, -pair.normal)] {
        let nearest_m: DVec3 =
            mine.clone().map(|i| positions_m[pair.corners[i] as usize] * pair.weights[i].abs()).sum();
        for i in mine {
            let particle = pair.corners[i];
            if touch {
                [DVec3::X, DVec3::NEG_X, DVec3::Y, DVec3::NEG_Y, DVec3::Z, DVec3::NEG_Z]
                    .into_iter()
                    .for_each(|normal| sides.push(Side { particle, normal, slack_m: 0.0 }));
                continue;
            }
            let slack_m = (positions_m[particle as usize] - nearest_m).dot(normal).max(0.0) + share_m;
            if slack_m < farthest_m {
                sides.push(Side { particle, normal, slack_m });
            }
        }
    }
}

/// Shares along two edges of their nearest places (Ericson, Real-Time Collision Detection, 5.1.9).
fn nearest_of_edges([a, b]: [DVec3; 2], [c, d]: [DVec3; 2]) -> [f64; 2] {
    let (along, other, between) = (b - a, d - c, a - c);
    let (aa, bb) = (along.length_squared(), other.length_squared());
    let (ab, ac, bc) = (along.dot(other), along.dot(between), other.dot(between));
    let spread = aa * bb - ab * ab;
    let mut s = if spread > 1e-12 * aa * bb { ((ab * bc - ac * bb) / spread).clamp(0.0, 1.0) } else { 0.0 };
    let mut t = if bb > 0.0 { (ab * s + bc) / bb } else { 0.0 };
    if t < 0.0 {
        t = 0.0;
        s = if aa > 0.0 { (-ac / aa).clamp(0.0, 1.0) } else { 0.0 };
    } else if t > 1.0 {
        t = 1.0;
        s = if aa > 0.0 { ((ab - ac) / aa).clamp(0.0, 1.0) } else { 0.0 };
    }
    [s, t]
}
