//! Deforms the base onto a surface: rounds of nearest places and one sparse system, looser from round to round.

use super::super::StageError;
use super::Settings;
use super::borders::Borders;
use super::rims::{Ends, Lying, Rims};
use super::rotation::{nearest_rotation, outer};
use super::surface::{Surface, border_edges, normals, smooth_normals};
use super::system::{Matrix, solve};
use super::visible::covers;
use glam::{DMat3, DVec3};
use kitsuke::sparse_cholesky::SparseCholesky;
use rayon::prelude::*;

/// Surfaces that face away from each other by more than this cosine are different layers.
pub(super) const SAME_WAY: f64 = 0.5;
/// How much a landmark counts: as much as a hundred places of the surface.
const LANDMARK: f64 = 100.0;
/// However near the end, the base's borders look so far for where the scan ends, and what they find so far is trusted, metres: a whole run
/// says it.
const BORDER_FROM_M: f64 = 0.05;
const BORDER_TRUST_M: f64 = 0.1;
/// How much what lies over a hidden vertex pulls at it.
const COVERED: f64 = 0.1;
/// An edge may become longer or shorter by this share of its length; how much it counts that it stays so.
const STRETCH: f64 = 0.08;
const LIMIT: f64 = 10.0;
/// Every vertex is held where it is by so much, so that the equations always have one solution.
const HELD: f64 = 1e-6;
/// So often the surroundings of triangles that stayed turned over are smoothed towards the base's own shape.
const UNTANGLINGS: usize = 40;

pub(super) struct Laid {
    pub positions_m: Vec<DVec3>,
    pub confidence: Vec<f64>,
    pub turned_over: Vec<u32>,
}

/// Neighbours along edges, each once, ascending.
fn neighbours(count: usize, triangles: &[[u32; 3]]) -> Vec<Vec<u32>> {
    let mut of = vec![Vec::new(); count];
    for &[a, b, c] in triangles {
        for [from, to] in [[a, b], [b, c], [c, a]] {
            of[from as usize].push(to);
            of[to as usize].push(from);
        }
    }
    for near in &mut of {
        near.sort_unstable();
        near.dedup();
    }
    of
}

/// What pulls at a vertex: a place, how strongly, and along which direction.
#[derive(Clone, Copy, Debug)]
struct Pull {
    to_m: DVec3,
    weight: f64,
    /// Unit: across a surface, along a border.
    direction: DVec3,
    /// How much the direction and what is square to it count.
    shares: [f64; 2],
}

impl Pull {
    /// The matrix whose quadratic form is the pull's energy.
    fn matrix(&self) -> DMat3 {
        let [along, square] = self.shares.map(|share| share * self.weight);
        outer(self.direction, self.direction) * (along - square) + DMat3::from_diagonal(DVec3::splat(square))
    }
}

/// How far places are looked for, metres.
#[derive(Clone, Copy, Debug)]
struct Reach {
    surface_m: f64,
    border_m: f64,
    /// How much more a border counts than a place of the surface.
    border: f64,
    /// How much a pull counts in the directions in which cloth may slide: along a surface, along a border.
    inertia: f64,
}

/// Lays the base on; `fixed` are vertices and where they come to lie, metres.
pub(super) fn deform(
    base_m: &[DVec3],
    triangles: &[[u32; 3]],
    seen: &[bool],
    fixed: &[(usize, DVec3)],
    scan: &Surface,
    settings: &Settings,
) -> Result<Laid, StageError> {
    let count = base_m.len();
    let near = neighbours(count, triangles);
    let base_normals = normals(base_m, triangles);
    let covers = covers(base_m, triangles, seen);
    let bend_of = |v: usize, places: &[DVec3]| {
        let mean: DVec3 = near[v].iter().map(|&n| places[n as usize]).sum();
        places[v] - mean / near[v].len().max(1) as f64
    };
    let base_bends: Vec<DVec3> = (0..count).map(|v| bend_of(v, base_m)).collect();
    let bends = bend_products(&near);
    let borders = Borders::of(scan.positions_m(), scan.triangles(), scan.normals());
    let rims = Rims::of(base_m, &border_edges(triangles));
    let ends = Ends { rims, fixed, scan, scan_borders: borders };

    let lengths = |length_m: f64| length_m * (1.0 - STRETCH)..=length_m * (1.0 + STRETCH);
    let mut edges: Vec<[u32; 2]> = Vec::new();
    for v in 0..count as u32 {
        edges.extend(near[v as usize].iter().filter(|&&n| n > v).map(|&n| [v, n]));
    }
    let mut is_limited = vec![false; edges.len()];
    let mut places = base_m.to_vec();
    let mut weights = vec![0.0; count];
    let rounds = settings.phases.iter().flat_map(|phase| (0..phase.rounds).map(move |round| (phase, round)));
    for (phase, round) in rounds {
        let share = round as f64 / (phase.rounds.max(2) - 1) as f64;
        let between = |[first, last]: [f64; 2]| first * libm::pow(last / first, share);
        let stiff = between(phase.stiff);
        let reach = Reach {
            surface_m: between(phase.within_m),
            border_m: between(phase.border_m),
            border: phase.border,
            inertia: phase.inertia,
        };
        let stretch = stiff.sqrt() * settings.stretch;
        let mut entries: Vec<(u32, u32, f64)> = bends.iter().map(|&(a, b, value)| (a, b, stiff * value)).collect();
        for (&[v, n], is_limited) in edges.iter().zip(&mut is_limited) {
            let length_m = |of: &[DVec3]| of[v as usize].distance(of[n as usize]);
            *is_limited |= !lengths(length_m(base_m)).contains(&length_m(&places));
            let stretch = if *is_limited { stretch + LIMIT } else { stretch };
            entries.extend([(v, v, stretch), (n, n, stretch), (n, v, -stretch)]);
        }
        let held = Matrix::new(count, &entries);
        let mut factor = None;
        for _ in 0..phase.steps {
            let turns = turns(base_m, &places, &near, &base_normals, &normals(&places, triangles));
            let pulls = pulls(&places, triangles, seen, scan, &ends, reach);
            let mut right: Vec<DVec3> = vec![DVec3::ZERO; count];
            let mut own: Vec<DMat3> = vec![DMat3::from_diagonal(DVec3::splat(HELD)); count];
            for v in 0..count {
                // Bend: the vertex against the mean of its neighbours, as in the base, turned along.
                let wanted = turns[v] * base_bends[v] * stiff;
                right[v] += wanted;
                let part = wanted / near[v].len().max(1) as f64;
                near[v].iter().for_each(|&n| right[n as usize] -= part);
                right[v] += HELD * places[v];
                weights[v] = pulls[v].map_or(0.0, |pull| pull.weight);
                if let Some(pull) = pulls[v] {
                    let matrix = pull.matrix();
                    own[v] += matrix;
                    right[v] += matrix * pull.to_m;
                } else if let Some(cover) = &covers[v] {
                    let corners = triangles[cover.triangle as usize].map(|c| c as usize);
                    let mix = |places: &[DVec3]| -> DVec3 {
                        corners.iter().zip(cover.shares).map(|(&c, s)| places[c] * s).sum()
                    };
                    let to = mix(&places) + turns[corners[0]] * (base_m[v] - mix(base_m));
                    own[v] += DMat3::from_diagonal(DVec3::splat(COVERED));
                    right[v] += COVERED * to;
                }
            }
            // Stretch: each edge as in the base, turned along with both its ends; cloth hardly stretches, so that an edge that once was too long
            // or too short is held to what cloth allows.
            for (&[v, n], &is_limited) in edges.iter().zip(&is_limited) {
                let (v, n) = (v as usize, n as usize);
                let as_in_base = (turns[v] + turns[n]) * (base_m[v] - base_m[n]) * 0.5;
                let mut wanted = as_in_base * stretch;
                if is_limited {
                    let now = places[v] - places[n];
                    let allowed = lengths(base_m[v].distance(base_m[n]));
                    wanted += now.normalize_or_zero() * now.length().clamp(*allowed.start(), *allowed.end()) * LIMIT;
                }
                right[v] += wanted;
                right[n] -= wanted;
            }
            for &(v, to_m) in fixed {
                own[v] += DMat3::from_diagonal(DVec3::splat(LANDMARK));
                right[v] += LANDMARK * to_m;
            }
            // The factor of a round's first step serves all its steps: it only has to be near.
            let near = match &mut factor {
                Some(factor) => factor,
                none => {
                    let means = own.iter().enumerate().map(|(v, m)| {
                        let trace = m.x_axis.x + m.y_axis.y + m.z_axis.z;
                        (v as u32, v as u32, trace / 3.0)
                    });
                    let all: Vec<(u32, u32, f64)> = entries.iter().copied().chain(means).collect();
                    let found = SparseCholesky::new(count, &all).map_err(|error| {
                        StageError::new("register", format!("the base cannot be laid onto the scan: {error}"))
                    })?;
                    none.insert(found)
                }
            };
            solve(&held, &own, near, &right, &mut places);
        }
    }
    let turned_over = untangle(base_m, &mut places, triangles, &near, &base_normals, &base_bends);
    Ok(Laid { positions_m: places, confidence: weights.into_iter().map(|w| w.min(1.0)).collect(), turned_over })
}

/// Smooths the surroundings of triangles that are turned over towards the base's own shape; returns those that stay so.
fn untangle(
    base_m: &[DVec3],
    places: &mut [DVec3],
    triangles: &[[u32; 3]],
    near: &[Vec<u32>],
    base_normals: &[DVec3],
    base_bends: &[DVec3],
) -> Vec<u32> {
    for round in 0.. {
        let turns = turns(base_m, places, near, base_normals, &normals(places, triangles));
        let turned = turned_over(base_m, places, triangles, &turns);
        if turned.is_empty() || round == UNTANGLINGS {
            return turned;
        }
        for v in around(&turned, triangles, near) {
            let mean = near[v].iter().map(|&n| places[n as usize]).sum::<DVec3>() / near[v].len() as f64;
            places[v] = 0.5 * (places[v] + mean + turns[v] * base_bends[v]);
        }
    }
    unreachable!("the last round returns")
}

/// The corners of triangles and their neighbours, ascending.
fn around(of: &[u32], triangles: &[[u32; 3]], near: &[Vec<u32>]) -> Vec<usize> {
    let corners = of.iter().flat_map(|&t| triangles[t as usize]);
    let mut all: Vec<usize> =
        corners.flat_map(|v| near[v as usize].iter().copied().chain([v])).map(|v| v as usize).collect();
    all.sort_unstable();
    all.dedup();
    all
}

/// Triangles whose normal has turned by more than 90 degrees beyond the turn of their corners.
fn turned_over(base_m: &[DVec3], places: &[DVec3], triangles: &[[u32; 3]], turns: &[DMat3]) -> Vec<u32> {
    let normal = |places: &[DVec3], corners: &[u32; 3]| {
        let [a, b, c] = corners.map(|v| places[v as usize]);
        (b - a).cross(c - a)
    };
    let is_over = |(_, corners): &(usize, &[u32; 3])| {
        let turn = corners.iter().fold(DMat3::ZERO, |sum, &v| sum + turns[v as usize]);
        (turn * normal(base_m, corners)).dot(normal(places, corners)) < 0.0
    };
    triangles.iter().enumerate().filter(is_over).map(|(t, _)| t as u32).collect()
}

/// The lower triangle of the matrix of all bends: the sum over vertices of bᵀb, where b takes places to the vertex's bend.
fn bend_products(near: &[Vec<u32>]) -> Vec<(u32, u32, f64)> {
    let mut entries = Vec::new();
    for (v, near) in near.iter().enumerate() {
        let share = -1.0 / near.len().max(1) as f64;
        let row: Vec<(u32, f64)> = std::iter::once((v as u32, 1.0)).chain(near.iter().map(|&n| (n, share))).collect();
        for &(a, x) in &row {
            entries.extend(row.iter().filter(|(b, _)| *b <= a).map(|&(b, y)| (a, b, x * y)));
        }
    }
    entries
}

/// How each vertex' surroundings have turned since the base. The normal counts like an edge: what is flat turns about no line.
fn turns(base_m: &[DVec3], places: &[DVec3], near: &[Vec<u32>], from: &[DVec3], to: &[DVec3]) -> Vec<DMat3> {
    let raw = |v: usize| {
        let mut sum = DMat3::ZERO;
        let mut squares = 0.0;
        for &n in &near[v] {
            let edge = base_m[n as usize] - base_m[v];
            sum += outer(places[n as usize] - places[v], edge);
            squares += edge.length_squared();
        }
        sum + outer(to[v], from[v]) * (squares / near[v].len().max(1) as f64)
    };
    let raw: Vec<DMat3> = (0..base_m.len()).into_par_iter().map(raw).collect();
    let turn = |v: usize| {
        let sum = near[v].iter().fold(raw[v] * 2.0, |sum, &n| sum + raw[n as usize]);
        nearest_rotation(sum)
    };
    (0..base_m.len()).into_par_iter().map(turn).collect()
}

/// What pulls at each vertex that is seen.
fn pulls(
    places: &[DVec3],
    triangles: &[[u32; 3]],
    seen: &[bool],
    scan: &Surface,
    ends: &Ends,
    reach: Reach,
) -> Vec<Option<Pull>> {
    let normals = smooth_normals(places, triangles);
    // Trust fades with distance (Geman and McClure).
    let trust = |distance_m: f64, within_m: f64| {
        let away = distance_m / (0.5 * within_m);
        1.0 / ((1.0 + away * away) * (1.0 + away * away))
    };
    let lying = Lying { places, triangles, normals: &normals, seen };
    let ends = ends.of(&lying, reach.border_m.max(BORDER_FROM_M));
    let pull = |v: usize| {
        let (place, normal) = (places[v], normals[v]);
        if !seen[v] {
            return None;
        }
        if let Some(rim) = ends[v] {
            let weight = reach.border * trust(rim.beyond_m.abs(), reach.border_m.max(BORDER_TRUST_M));
            let to_m = place + rim.outward * rim.beyond_m;
            return Some(Pull { to_m, weight, direction: rim.outward, shares: [1.0, reach.inertia] });
        }
        let hit = scan.nearest(place, reach.surface_m, |other| other.dot(normal) > SAME_WAY)?;
        let weight = trust(hit.distance_m, reach.surface_m);
        (!hit.on_border).then_some(Pull {
            to_m: hit.place_m,
            weight,
            direction: hit.normal,
            shares: [1.0, reach.inertia],
        })
    };
    (0..places.len()).into_par_iter().map(pull).collect()
}
