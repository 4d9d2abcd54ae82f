//! A body as a closed triangle mesh: how far from it a place lies, on which side, and where its surface is nearest. Knows no cloth.
//!
//! Inside is where the surface winds around a place at least once. For a closed mesh that winding number is a whole number, and it is
//! counted exactly: the triangles ahead of the place along an axis, +1 where the way leaves the body and -1 where it enters
//! (crate `robust` decides each). So closed parts within or through one another (eyeballs in a head, an arm pressed into the
//! trunk) are one body, which the normal of the nearest triangle (Baerentzen and Aanaes, Signed Distance Computation Using the
//! Angle Weighted Pseudonormal, 2005) would get wrong there, and nothing is approximated, as a hierarchical winding number
//! (Barill et al., Fast Winding Numbers for Soups and Clouds, 2018) would. The price is that a mesh must be closed; one with holes
//! is closed first, by a fan from the middle of each.
//!
//! Distances are to all triangles, also to those that lie in another part of the body.

use crate::intersections::{Crossing, Surface, below, flat, left};
use crate::triangle_tree::Extent;
use glam::DVec3;
use std::collections::BTreeMap;

/// Most triangles, so that their numbers and those of the fans fit.
const MOST_TRIANGLES: usize = 1 << 28;
/// How many faulty edges an error names.
const NAMED: usize = 8;
/// Nearer to a triangle, metres, the way from it has no direction but the triangle's own.
const ON_SURFACE_M: f64 = 1e-9;

/// A closed mesh, outside counter-clockwise.
#[derive(Clone, Debug)]
pub struct Body {
    surface: Surface,
    /// Vertices that were given; behind them, the middles of holes.
    vertices: usize,
    /// Around each hole, the vertices whose mean its middle is.
    rims: Vec<Vec<u32>>,
}

/// The place of a body that is nearest to another one.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Near {
    /// Distance from the surface, metres; below 0 inside.
    pub distance_m: f64,
    /// Unit vector along which the distance grows fastest. Zero on a triangle without area.
    pub normal: DVec3,
    /// The nearest place.
    pub place_m: DVec3,
    /// The triangle on which it lies; behind those that were given come the fans of holes.
    pub triangle: u32,
    /// Its barycentric coordinates there, each 0 to 1.
    pub shares: DVec3,
}

/// Why a mesh is no body.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum BodyError {
    /// A coordinate is not a number.
    #[error("position {0} of the body is not finite")]
    NotFinite(usize),
    /// A triangle names a position that is not there.
    #[error("triangle {triangle} of the body names position {position} of {positions}")]
    Index {
        /// Number of the triangle, from 0.
        triangle: usize,
        /// The position that it names.
        position: u32,
        /// How many there are.
        positions: usize,
    },
    /// Too few or too many triangles.
    #[error("the body has {0} triangles, must be 1 to {MOST_TRIANGLES}")]
    Count(usize),
    /// Edges that do not have as many triangles on one side as on the other.
    #[error(
        "{count} edges of the body are open, with a triangle on one side only or two that face opposite ways{}: of positions {}",
        if *count > edges.len() { "; the first are" } else { "" },
        edges.iter().map(|[a, b]| format!("{a}-{b}")).collect::<Vec<_>>().join(", ")
    )]
    Open {
        /// How many.
        count: usize,
        /// The positions at their ends, ascending; the first few.
        edges: Vec<[u32; 2]>,
    },
    /// No inside.
    #[error(
        "the body's triangles enclose {volume_m3} m³, must be above 0; seen from outside, they turn counter-clockwise"
    )]
    Volume {
        /// What is enclosed, cubic metres.
        volume_m3: f64,
    },
    /// Other positions than it was made of.
    #[error("{moved} positions for a body of {vertices}")]
    Moved {
        /// How many are given.
        moved: usize,
        /// How many it has.
        vertices: usize,
    },
}

impl Body {
    /// From a closed mesh in metres; it may consist of parts, and these may overlap.
    ///
    /// # Errors
    /// When a number is not finite, an index is out of range, there are no triangles, edges are open (with their vertices), or no
    /// volume is enclosed, as by triangles that face inward.
    pub fn new(positions_m: &[DVec3], triangles: &[[u32; 3]]) -> Result<Body, BodyError> {
        check_mesh(positions_m, triangles)?;
        let open = open_edges(triangles);
        if !open.is_empty() {
            let edges = open.iter().take(NAMED).map(|&([a, b], _)| [a.min(b), a.max(b)]).collect();
            return Err(BodyError::Open { count: open.len(), edges });
        }
        closed(positions_m.to_vec(), triangles, Vec::new())
    }

    /// As `new`, from a mesh with holes: each is closed by a fan from the mean of its vertices, and this belongs to the body as any
    /// triangle does.
    ///
    /// # Errors
    /// As `new`, but for open edges.
    pub fn with_holes_closed(positions_m: &[DVec3], triangles: &[[u32; 3]]) -> Result<Body, BodyError> {
        check_mesh(positions_m, triangles)?;
        let open = open_edges(triangles);
        let (rim_of, rims) = rims(&open);
        let mut all = triangles.to_vec();
        for &([a, b], count) in &open {
            let middle = (positions_m.len() + rim_of[&a]) as u32;
            all.extend(std::iter::repeat_n([b, a, middle], count as usize));
        }
        closed(with_middles(positions_m, &rims), &all, rims)
    }

    /// Moves the vertices that were given. What they enclose is not looked at again.
    ///
    /// # Errors
    /// When their number is another one or a coordinate is not finite. Then none moves.
    pub fn moved(&mut self, positions_m: &[DVec3]) -> Result<(), BodyError> {
        if positions_m.len() != self.vertices {
            return Err(BodyError::Moved { moved: positions_m.len(), vertices: self.vertices });
        }
        check_finite(positions_m)?;
        self.surface.refit(&with_middles(positions_m, &self.rims));
        Ok(())
    }

    /// What is given for the vertices that were given, metres, also for the middles of holes.
    ///
    /// # Panics
    /// When their number is another one.
    #[must_use]
    pub fn also_middles(&self, given_m: &[DVec3]) -> Vec<DVec3> {
        assert_eq!(given_m.len(), self.vertices, "one to each vertex of the body");
        with_middles(given_m, &self.rims)
    }

    /// Its closed surface, with the fans of holes behind what was given.
    #[must_use]
    pub fn surface(&self) -> &Surface {
        &self.surface
    }

    /// Where it passes through or touches itself; such a body is sound, but see the head of this module.
    #[must_use]
    pub fn self_intersections(&self) -> Vec<Crossing> {
        self.surface.self_intersections()
    }

    /// The nearest place of the surface, if it is not farther than `within_m` (at least 0, infinity for any), on either side.
    #[must_use]
    pub fn signed_distance(&self, place_m: DVec3, within_m: f64) -> Option<Near> {
        let positions_m = self.surface.positions_m();
        let nearest = self.surface.tree().nearest(positions_m, place_m, within_m)?;
        let length_m = nearest.squared_m2.sqrt();
        // Places on the surface are outside.
        let sign = if length_m > 0.0 && self.contains(place_m) { -1.0 } else { 1.0 };
        let normal = if length_m > ON_SURFACE_M {
            (place_m - nearest.place_m) * (sign / length_m)
        } else {
            let [a, b, c] = self.surface.triangles()[nearest.triangle as usize].map(|v| positions_m[v as usize]);
            (b - a).cross(c - a).normalize_or_zero()
        };
        Some(Near {
            distance_m: sign * length_m,
            normal,
            place_m: nearest.place_m,
            triangle: nearest.triangle,
            shares: nearest.shares,
        })
    }

    /// Whether a place lies inside. Exact, but on the surface it may be either.
    #[must_use]
    pub fn contains(&self, place_m: DVec3) -> bool {
        self.winding_number(place_m) >= 1
    }

    /// How many times the surface winds around a place: 0 outside, 1 inside, 2 where two parts overlap. Exact, but for places on
    /// the surface, which get the number of one of its sides.
    #[must_use]
    pub fn winding_number(&self, place_m: DVec3) -> i32 {
        let extent = self.surface.tree().extent();
        if !(place_m.cmpge(extent.low_m) & place_m.cmple(extent.high_m)).all() {
            return 0;
        }
        // The shortest way out of the box meets the fewest triangles.
        let (up_m, down_m) = (extent.high_m - place_m, place_m - extent.low_m);
        let axis = up_m.min(down_m).min_position();
        let is_up = up_m[axis] <= down_m[axis];
        let mut ahead = Extent { low_m: place_m, high_m: place_m };
        if is_up {
            ahead.high_m[axis] = f64::INFINITY;
        } else {
            ahead.low_m[axis] = f64::NEG_INFINITY;
        }
        let (positions_m, from) = (self.surface.positions_m(), flat(place_m, axis));
        let mut winding = 0;
        self.surface.tree().overlapping(&ahead, |_, corners| {
            let corners_m = corners.map(|corner| positions_m[corner as usize]);
            let turn = turn_around(from, corners_m.map(|corner_m| flat(corner_m, axis)));
            if turn == 0 {
                return;
            }
            // The triangle looks up the axis if it turns left; a place below its plane then has it ahead on the way up.
            let is_above = below(corners_m[0], corners_m[1], corners_m[2], place_m) * f64::from(turn) > 0.0;
            if is_above == is_up {
                winding += if is_up { turn } else { -turn };
            }
        });
        winding
    }
}

/// How often a triangle in the plane turns around a place, -1, 0 or 1. Its border belongs to one side of each edge, whichever
/// triangle has it, so that triangles side by side count every place once (Sunday, Inclusion of a Point in a Polygon, 2001).
fn turn_around(place: glam::DVec2, corners: [glam::DVec2; 3]) -> i32 {
    let mut turn = 0;
    for i in 0..3 {
        let (from, to) = (corners[i], corners[(i + 1) % 3]);
        let is_rising = from.y <= place.y;
        if is_rising == (to.y <= place.y) {
            continue;
        }
        // The same numbers whichever way the edge runs.
        let (low, high) = if is_rising { (from, to) } else { (to, from) };
        if left(low, high, place) > 0.0 {
            turn += if is_rising { 1 } else { -1 };
        }
    }
    turn
}

fn check_finite(positions_m: &[DVec3]) -> Result<(), BodyError> {
    positions_m.iter().position(|place| !place.is_finite()).map_or(Ok(()), |bad| Err(BodyError::NotFinite(bad)))
}

fn check_mesh(positions_m: &[DVec3], triangles: &[[u32; 3]]) -> Result<(), BodyError> {
    if !(1..=MOST_TRIANGLES).contains(&triangles.len()) {
        return Err(BodyError::Count(triangles.len()));
    }
    check_finite(positions_m)?;
    for (triangle, corners) in triangles.iter().enumerate() {
        if let Some(&position) = corners.iter().find(|&&corner| corner as usize >= positions_m.len()) {
            return Err(BodyError::Index { triangle, position, positions: positions_m.len() });
        }
    }
    Ok(())
}

fn closed(positions_m: Vec<DVec3>, triangles: &[[u32; 3]], rims: Vec<Vec<u32>>) -> Result<Body, BodyError> {
    // About its first vertex: far from the origin, less is lost by rounding.
    let origin_m = positions_m[triangles[0][0] as usize];
    let mut volume_m3 = 0.0;
    for corners in triangles {
        let [a, b, c] = corners.map(|corner| positions_m[corner as usize] - origin_m);
        volume_m3 += a.dot(b.cross(c)) / 6.0;
    }
    if volume_m3 <= 0.0 {
        return Err(BodyError::Volume { volume_m3 });
    }
    let vertices = positions_m.len() - rims.len();
    Ok(Body { surface: Surface::new(&positions_m, triangles), vertices, rims })
}

/// Edges along which more triangles run one way than the other, in the direction of those, with how many more; ascending by their
/// ends.
fn open_edges(triangles: &[[u32; 3]]) -> Vec<([u32; 2], u32)> {
    let mut ways: Vec<([u32; 2], i32)> = Vec::with_capacity(3 * triangles.len());
    for corners in triangles {
        for i in 0..3 {
            let (from, to) = (corners[i], corners[(i + 1) % 3]);
            if from != to {
                ways.push(if from < to { ([from, to], 1) } else { ([to, from], -1) });
            }
        }
    }
    ways.sort_unstable();
    let mut open = Vec::new();
    for edge in ways.chunk_by(|a, b| a.0 == b.0) {
        let more: i32 = edge.iter().map(|&(_, way)| way).sum();
        let [low, high] = edge[0].0;
        if more != 0 {
            open.push((if more > 0 { [low, high] } else { [high, low] }, more.unsigned_abs()));
        }
    }
    open
}

/// The rim at each vertex of open edges, and the vertices of each: what hangs together is one rim.
fn rims(open: &[([u32; 2], u32)]) -> (BTreeMap<u32, usize>, Vec<Vec<u32>>) {
    let mut neighbours: BTreeMap<u32, Vec<u32>> = BTreeMap::new();
    for &([a, b], _) in open {
        neighbours.entry(a).or_default().push(b);
        neighbours.entry(b).or_default().push(a);
    }
    let (mut rim_of, mut rims) = (BTreeMap::new(), Vec::new());
    for &first in neighbours.keys() {
        let (mut rim, mut waiting) = (Vec::new(), vec![first]);
        while let Some(vertex) = waiting.pop() {
            if let std::collections::btree_map::Entry::Vacant(place) = rim_of.entry(vertex) {
                place.insert(rims.len());
                rim.push(vertex);
                waiting.extend(&neighbours[&vertex]);
            }
        }
        if !rim.is_empty() {
            rims.push(rim);
        }
    }
    (rim_of, rims)
}

/// The positions and behind them the mean of each rim.
fn with_middles(positions_m: &[DVec3], rims: &[Vec<u32>]) -> Vec<DVec3> {
    let mut all = positions_m.to_vec();
    for rim in rims {
        let sum_m: DVec3 = rim.iter().map(|&vertex| positions_m[vertex as usize]).sum();
        all.push(sum_m / rim.len() as f64);
    }
    all
}
