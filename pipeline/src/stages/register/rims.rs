//! The borders of the base as runs between corners, and how far a scan goes on beyond each of them.
//!
//! A scanned border is eaten: it ends before the cloth does, here by a millimetre, there by a hand's breadth, and never after it. What is
//! found along a whole run therefore decides for each of its vertices: a line near the outermost of what was found, and around it only
//! what agrees with it.

use super::borders::{Borders, beyond_m};
use super::surface::Surface;
use glam::DVec3;
use rayon::prelude::*;

/// A border that turns by more than this cosine within [`CORNER_HOPS`] on both sides has a corner.
const CORNER: f64 = 0.7;
const CORNER_HOPS: usize = 3;
/// What is found along a run counts outwards this many times as much as inwards.
const OUTWARDS: f64 = 8.0;
/// Nearer than this to the line counts no more, metres.
const NEAR_M: f64 = 0.002;
/// What is known counts this many times as much as what is found.
const KNOWN: f64 = 100.0;
/// Of a run's vertices this share must find something, and at least so many.
const FOUND: f64 = 0.3;
const LEAST: usize = 4;
/// A run that is shorter than this is moved as a whole, not turned, metres.
const TURNS_FROM_M: f64 = 0.15;
/// A run is turned by no more, metres per metre: what is found at its end alone would turn it out of the cloth.
const SLOPE: f64 = 0.05;
/// What is found nearer than this to the line may say where exactly the scan ends, metres.
const AGREE_M: f64 = 0.02;
/// A border and what it finds must find each other within this and a share of their distance, metres.
const BACK_M: f64 = 0.02;
const BACK: f64 = 0.3;
/// So many neighbours on each side say with a vertex where the scan ends.
const HOPS: usize = 6;

/// Borders of the base.
pub(super) struct Rims {
    /// Vertices one after another, none twice in a run.
    runs: Vec<Vec<u32>>,
    /// For each vertex of a run how far along it lies, metres of the base.
    along_m: Vec<Vec<f64>>,
}

impl Rims {
    /// From the border edges of the base, as their triangles go along them.
    pub fn of(base_m: &[DVec3], borders: &[[u32; 2]]) -> Rims {
        const NONE: u32 = u32::MAX;
        let mut next = vec![NONE; base_m.len()];
        let mut before = vec![NONE; base_m.len()];
        for &[a, b] in borders {
            next[a as usize] = b;
            before[b as usize] = a;
        }
        let far = |way: &[u32], from: u32| {
            let mut at = from;
            for _ in 0..CORNER_HOPS {
                if way[at as usize] != NONE {
                    at = way[at as usize];
                }
            }
            base_m[at as usize]
        };
        let is_corner = |v: u32| {
            let here = base_m[v as usize];
            let (back, ahead) = (here - far(&before, v), far(&next, v) - here);
            before[v as usize] == NONE || back.normalize_or_zero().dot(ahead.normalize_or_zero()) < CORNER
        };
        let starts: Vec<u32> = borders.iter().map(|&[a, _]| a).collect();
        let mut taken = vec![false; base_m.len()];
        let mut runs = Vec::new();
        // From corners first; what is left are loops without one.
        let corners = starts.iter().copied().filter(|&v| is_corner(v));
        for start in corners.chain(starts.iter().copied()) {
            let mut run = Vec::new();
            let mut at = start;
            while at != NONE && !taken[at as usize] {
                taken[at as usize] = true;
                run.push(at);
                at = next[at as usize];
                if at != NONE && is_corner(at) {
                    break;
                }
            }
            if !run.is_empty() {
                runs.push(run);
            }
        }
        let along_m = runs.iter().map(|run| {
            let mut at_m = 0.0;
            let mut all = vec![0.0];
            for pair in run.windows(2) {
                at_m += base_m[pair[0] as usize].distance(base_m[pair[1] as usize]);
                all.push(at_m);
            }
            all
        });
        let along_m = along_m.collect();
        Rims { runs, along_m }
    }
}

/// How a border of the base lies now.
#[derive(Clone, Copy, Debug)]
pub(super) struct Rim {
    /// Unit, across the border and out of the surface.
    pub outward: DVec3,
    /// How far the scan goes on outwards, metres; negative where it ends before.
    pub beyond_m: f64,
}

/// The base as it lies now, with unit normals.
pub(super) struct Lying<'a> {
    pub places: &'a [DVec3],
    pub triangles: &'a [[u32; 3]],
    pub normals: &'a [DVec3],
    pub seen: &'a [bool],
}

/// Where the base's borders are to go.
pub(super) struct Ends<'a> {
    pub rims: Rims,
    /// Vertices and where they are known to lie, metres.
    pub fixed: &'a [(usize, DVec3)],
    pub scan: &'a Surface,
    pub scan_borders: Borders,
}

impl Ends<'_> {
    /// For each vertex on a border that is seen where the scan ends beyond it, or where it is known to lie; looks no farther than
    /// `within_m`, metres.
    pub fn of(&self, base: &Lying, within_m: f64) -> Vec<Option<Rim>> {
        let Lying { places, triangles, normals, seen } = *base;
        let Ends { rims, fixed, scan, scan_borders } = self;
        let own = Borders::of(places, triangles, normals);
        let mut all = vec![None; places.len()];
        for (run, along_m) in rims.runs.iter().zip(&rims.along_m) {
            let direction = |i: usize| {
                let ends = [i.saturating_sub(1), (i + 1).min(run.len() - 1)].map(|at| places[run[at] as usize]);
                (ends[1] - ends[0]).normalize_or_zero()
            };
            let outward = |i: usize| direction(i).cross(normals[run[i] as usize]).normalize_or_zero();
            let found = |i: usize| {
                let v = run[i] as usize;
                if !seen[v] {
                    return None;
                }
                let out = outward(i);
                if let Some((_, to_m)) = fixed.iter().find(|(vertex, _)| *vertex == v) {
                    return Some((*to_m - places[v]).dot(out));
                }
                beyond_m(scan, places[v], normals[v], out, within_m).or_else(|| {
                    let hit = scan_borders.nearest(places[v], within_m, direction(i), out)?;
                    // A border of the scan belongs to the nearest border of the base, not to any that has it nearest.
                    let back = own.nearest(hit.place_m, within_m + 1.0, hit.along, hit.outward)?;
                    let is_mutual = back.place_m.distance(places[v]) < BACK_M + BACK * hit.distance_m;
                    is_mutual.then_some((hit.place_m - places[v]).dot(out))
                })
            };
            let ends: Vec<Option<f64>> = (0..run.len()).into_par_iter().map(found).collect();
            let weight = |v: u32| if fixed.iter().any(|(vertex, _)| *vertex == v as usize) { KNOWN } else { 1.0 };
            let mut pairs = Vec::new();
            for ((&along_m, end), &v) in along_m.iter().zip(&ends).zip(run) {
                pairs.extend(end.map(|end_m| (along_m, end_m, weight(v))));
            }
            let seen_count = run.iter().filter(|&&v| seen[v as usize]).count();
            if pairs.len() < LEAST || (pairs.len() as f64) < FOUND * seen_count as f64 {
                continue;
            }
            let line = outer_line(&pairs, along_m[along_m.len() - 1] >= TURNS_FROM_M);
            for (i, &v) in run.iter().enumerate() {
                if !seen[v as usize] {
                    continue;
                }
                let expected_m = line[0] + line[1] * along_m[i];
                let window = i.saturating_sub(HOPS)..(i + HOPS + 1).min(run.len());
                let mut near: Vec<f64> =
                    ends[window].iter().flatten().copied().filter(|end| (end - expected_m).abs() < AGREE_M).collect();
                near.sort_by(f64::total_cmp);
                let beyond_m = if near.len() > HOPS { near[near.len() / 2] } else { expected_m };
                all[v as usize] = Some(Rim { outward: outward(i), beyond_m });
            }
        }
        all
    }
}

/// Offset and slope of a line through (along, found, how much it counts) that lies near the outermost of what was found: quantile regression,
/// found by weighting again and again.
fn outer_line(found: &[(f64, f64, f64)], may_turn: bool) -> [f64; 2] {
    const ROUNDS: usize = 30;
    let mut line = [found.iter().map(|f| f.1).sum::<f64>() / found.len() as f64, 0.0];
    for _ in 0..ROUNDS {
        let [mut w, mut ws, mut wss, mut wf, mut wsf] = [0.0; 5];
        for &(s, f, counts) in found {
            let off = f - line[0] - line[1] * s;
            let weight = counts * (if off > 0.0 { OUTWARDS } else { 1.0 }) / off.abs().max(NEAR_M);
            w += weight;
            ws += weight * s;
            wss += weight * s * s;
            wf += weight * f;
            wsf += weight * s * f;
        }
        let spread = w * wss - ws * ws;
        let slope =
            if may_turn && spread > 1e-12 * w * w { ((w * wsf - ws * wf) / spread).clamp(-SLOPE, SLOPE) } else { 0.0 };
        line = [(wf - slope * ws) / w, slope];
    }
    line
}
