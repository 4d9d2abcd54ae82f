//! Borders of base and scan: which belongs to which, and where a scanned surface ends beyond a border of the base.

use super::deform::SAME_WAY;
use super::surface::{Surface, border_edges};
use glam::DVec3;

/// Borders that run or end in other directions than by these cosines are different borders.
const ALONG: f64 = 0.7;
const OUTWARD: f64 = 0.3;
/// Shorter borders are holes, metres.
const OPENING_M: f64 = 0.3;
/// How often the directions of borders are averaged with those before and after.
const SMOOTHINGS: usize = 8;
/// Steps outwards along a scan, metres.
const STEP_M: f64 = 0.005;
/// A step that lands farther than this from the surface has left it: the layer beneath is another one, metres.
const OFF_M: f64 = 0.002;
/// So many steps in turn may miss: scans are torn near their borders.
const MISSES: usize = 2;

/// Long borders as edges, each with the directions along it and out of the surface. A scan's borders are ragged: directions are those of a
/// longer stretch.
pub(super) struct Borders {
    edges: Vec<(DVec3, DVec3)>,
    along: Vec<DVec3>,
    outward: Vec<DVec3>,
}

impl Borders {
    /// The borders of at least [`OPENING_M`]: shorter ones are holes.
    pub fn of(positions_m: &[DVec3], triangles: &[[u32; 3]], normals: &[DVec3]) -> Borders {
        let all = border_edges(triangles);
        let lengths_m = loop_lengths_m(positions_m, &all);
        let long: Vec<[u32; 2]> = all
            .into_iter()
            .zip(lengths_m)
            .filter(|(_, length_m)| *length_m >= OPENING_M)
            .map(|(edge, _)| edge)
            .collect();
        let mut directions: Vec<DVec3> =
            long.iter().map(|[a, b]| positions_m[*b as usize] - positions_m[*a as usize]).collect();
        let mut at = vec![DVec3::ZERO; positions_m.len()];
        for _ in 0..SMOOTHINGS {
            at.fill(DVec3::ZERO);
            for ([a, b], direction) in long.iter().zip(&directions) {
                at[*a as usize] += *direction;
                at[*b as usize] += *direction;
            }
            for ([a, b], direction) in long.iter().zip(&mut directions) {
                *direction = (at[*a as usize] + at[*b as usize]) * 0.25;
            }
        }
        let (mut edges, mut along, mut outward) = (Vec::new(), Vec::new(), Vec::new());
        for ([a, b], direction) in long.into_iter().zip(directions) {
            let (from, to) = (positions_m[a as usize], positions_m[b as usize]);
            if from != to {
                let normal = normals[a as usize] + normals[b as usize];
                edges.push((from, to));
                along.push(direction.normalize_or_zero());
                outward.push(direction.cross(normal).normalize_or_zero());
            }
        }
        Borders { edges, along, outward }
    }

    /// The nearest border that runs and ends in about these directions: its place, the directions there, and how far it is.
    pub fn nearest(&self, from_m: DVec3, within_m: f64, along: DVec3, outward: DVec3) -> Option<BorderHit> {
        let mut best = None;
        let mut least = within_m;
        for ((&(a, b), &direction), &out) in self.edges.iter().zip(&self.along).zip(&self.outward) {
            if out.dot(outward) < OUTWARD || direction.dot(along) < ALONG {
                continue;
            }
            let edge = b - a;
            let place_m = a + edge * ((from_m - a).dot(edge) / edge.length_squared()).clamp(0.0, 1.0);
            let distance_m = place_m.distance(from_m);
            if distance_m < least {
                (best, least) = (Some(BorderHit { place_m, along: direction, outward: out, distance_m }), distance_m);
            }
        }
        best
    }
}

#[derive(Clone, Copy, Debug)]
pub(super) struct BorderHit {
    pub place_m: DVec3,
    pub along: DVec3,
    pub outward: DVec3,
    pub distance_m: f64,
}

/// For each border edge the length of all that hang together with it, metres.
fn loop_lengths_m(positions_m: &[DVec3], edges: &[[u32; 2]]) -> Vec<f64> {
    let mut first: Vec<u32> = (0..positions_m.len() as u32).collect();
    fn root(first: &mut [u32], mut v: u32) -> u32 {
        while first[v as usize] != v {
            first[v as usize] = first[first[v as usize] as usize];
            v = first[v as usize];
        }
        v
    }
    for &[a, b] in edges {
        let (a, b) = (root(&mut first, a), root(&mut first, b));
        first[a.max(b) as usize] = a.min(b);
    }
    let mut lengths_m = vec![0.0; positions_m.len()];
    for &[a, b] in edges {
        lengths_m[root(&mut first, a) as usize] += positions_m[a as usize].distance(positions_m[b as usize]);
    }
    edges.iter().map(|&[a, _]| lengths_m[root(&mut first, a) as usize]).collect()
}

/// How far the scan goes on beyond a place at a border of the base, outwards along its surface, metres; negative where it ends before.
pub(super) fn beyond_m(scan: &Surface, place: DVec3, normal: DVec3, outward: DVec3, within_m: f64) -> Option<f64> {
    let start = scan.nearest(place, within_m, |other| other.dot(normal) > SAME_WAY)?;
    let first = (start.place_m - place).dot(outward);
    if start.on_border {
        return Some(first);
    }
    let (mut at, mut end, mut misses, mut facing) = (start.place_m, start.place_m, 0, start.normal);
    // A scan may bend away for good: then walking outwards gains nothing, and the steps run out.
    for _ in 0..(2.0 * within_m / STEP_M) as usize {
        if (end - place).dot(outward) >= within_m {
            return None;
        }
        let ahead = (outward - facing * outward.dot(facing)).normalize_or_zero();
        let next = at + ahead * STEP_M;
        let hit = scan.nearest(next, OFF_M, |other| other.dot(facing) > SAME_WAY).filter(|hit| !hit.on_border);
        if let Some(hit) = hit {
            (at, end, misses, facing) = (hit.place_m, hit.place_m, 0, hit.normal);
        } else {
            (at, misses) = (next, misses + 1);
            if misses > MISSES {
                return Some((end - place).dot(outward));
            }
        }
        if facing.dot(normal) < 0.0 {
            return None;
        }
    }
    None
}
