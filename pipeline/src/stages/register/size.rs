//! How long, wide and deep a scan is beside the base: three factors. A kimono is cut by its wearer's measures, and where cloth shows no
//! mark, nothing else says how much of it goes round her.

use super::align::solved;
use super::surface::{Surface, smooth_normals};
use glam::DVec3;

/// About so many places of each look for the other.
const SAMPLES: usize = 2000;
/// How far, metres, from the first round to the last.
const WITHIN_M: [f64; 2] = [0.12, 0.04];
const ROUNDS: usize = 20;
/// A wearer differs no more from the base's; a scan that does is torn.
const LEAST: f64 = 0.8;
const MOST: f64 = 1.25;
/// How much the base's own size counts, in pairs times their squared distance from the middle, m²: a factor of which nothing tells stays 1.
const HELD: f64 = 0.2;
/// How much standing still counts, in pairs.
const STILL: f64 = 1e-3;

/// A pair's direction, the place of the base, and how far it has to go along the direction, metres; how much it counts.
type Row = (DVec3, DVec3, f64, f64);

/// The base as long, wide and deep as the scan that stands where it does, metres.
pub(super) fn sized_m(base_m: &[DVec3], triangles: &[[u32; 3]], seen: &[bool], scan: &Surface) -> Vec<DVec3> {
    let all: Vec<usize> = (0..base_m.len()).filter(|&v| seen[v]).collect();
    let of_base: Vec<usize> = all.iter().copied().step_by(all.len().div_ceil(SAMPLES).max(1)).collect();
    let of_scan: Vec<usize> =
        (0..scan.positions_m().len()).step_by(scan.positions_m().len().div_ceil(SAMPLES).max(1)).collect();
    let middle = of_base.iter().map(|&v| base_m[v]).sum::<DVec3>() / of_base.len().max(1) as f64;
    let (mut scale, mut shift_m) = (DVec3::ONE, DVec3::ZERO);
    let placed = |scale: DVec3, shift_m: DVec3| -> Vec<DVec3> {
        base_m.iter().map(|&p| middle + scale * (p - middle) + shift_m).collect()
    };
    for round in 0..ROUNDS {
        let share = round as f64 / (ROUNDS - 1) as f64;
        let within_m = WITHIN_M[0] * libm::pow(WITHIN_M[1] / WITHIN_M[0], share);
        let places = placed(scale, shift_m);
        let mut rows = Vec::new();
        let normals = smooth_normals(&places, triangles);
        for &v in &of_base {
            let hit = scan.nearest(places[v], within_m, |normal| normal.dot(normals[v]) > 0.5);
            // Across the surface, or wherever a border lies.
            rows.extend(hit.map(|hit| {
                let to = hit.place_m - places[v];
                let along = if hit.on_border { to.normalize_or_zero() } else { hit.normal };
                (along, places[v], along.dot(to), trust(hit.distance_m, within_m))
            }));
        }
        let own = Surface::new(places, triangles.to_vec());
        for &v in &of_scan {
            let (place, normal) = (scan.positions_m()[v], scan.normals()[v]);
            let hit = own.nearest(place, within_m, |other| other.dot(normal) > 0.5).filter(|hit| hit.on_border);
            rows.extend(hit.map(|hit| {
                let to = place - hit.place_m;
                let along = to.normalize_or_zero();
                (along, hit.place_m, along.dot(to), trust(hit.distance_m, within_m))
            }));
        }
        let Some([growth, step_m]) = best(&rows, middle + shift_m, scale) else { break };
        scale = (scale + growth).clamp(DVec3::splat(LEAST), DVec3::splat(MOST));
        shift_m += step_m;
    }
    placed(scale, shift_m)
}

/// Trust fades with distance (Geman and McClure).
fn trust(distance_m: f64, within_m: f64) -> f64 {
    let away = distance_m / (0.5 * within_m);
    1.0 / ((1.0 + away * away) * (1.0 + away * away))
}

/// The change of the factors and of the shift that brings the pairs together best.
fn best(rows: &[Row], middle: DVec3, scale: DVec3) -> Option<[DVec3; 2]> {
    let mut system = [[0.0; 7]; 6];
    for &(along, place, away_m, weight) in rows {
        let grown = along * (place - middle) / scale;
        let row = [grown.x, grown.y, grown.z, along.x, along.y, along.z];
        for i in 0..6 {
            (0..6).for_each(|j| system[i][j] += weight * row[i] * row[j]);
            system[i][6] += weight * row[i] * away_m;
        }
    }
    for axis in 0..3 {
        system[axis][axis] += HELD;
        system[axis][6] += HELD * (1.0 - scale[axis]);
        system[3 + axis][3 + axis] += STILL;
    }
    let [a, b, c, x, y, z] = solved(system)?;
    Some([DVec3::new(a, b, c), DVec3::new(x, y, z)])
}
