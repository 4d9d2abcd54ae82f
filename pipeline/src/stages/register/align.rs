//! Where a scan stands: the rigid motion that lays it onto the base. Neither scales nor mirrors, whatever would fit better.

use super::rotation::Rigid;
use super::surface::Surface;
use glam::{DMat3, DQuat, DVec3};
use rayon::prelude::*;

/// About so many vertices of the base look for their place in the scan.
const SAMPLES: usize = 800;
/// How far they look, metres, round after round.
const WITHIN_M: [f64; 6] = [0.4, 0.25, 0.15, 0.1, 0.06, 0.04];
/// Steps of each round.
const STEPS: usize = 6;
/// Then so many steps towards planes, which let surfaces slide.
const PLANE_STEPS: usize = 12;
/// This share of the pairs counts, the nearest ones.
const KEPT: f64 = 0.8;
/// Farther is as far as this when starts are compared, metres.
const FAR_M: f64 = 0.1;
/// Where the front is not known, so many directions are tried.
const STARTS: usize = 12;

/// The motion that takes the scan onto the base, and the mean distance of the base's samples, metres (those without a place count as
/// 10 cm). Landmarks (of the base, of the scan; metres) replace the search for a start.
pub(super) fn align(
    base_m: &[DVec3],
    normals: &[DVec3],
    seen: &[bool],
    scan: &Surface,
    landmarks: &[(DVec3, DVec3)],
    knows_front: bool,
) -> (Rigid, f64) {
    let all: Vec<usize> = (0..base_m.len()).filter(|&v| seen[v]).collect();
    let samples: Vec<usize> = all.iter().copied().step_by(all.len().div_ceil(SAMPLES).max(1)).collect();
    let middle = |places: &mut dyn Iterator<Item = DVec3>| {
        let (mut sum, mut count) = (DVec3::ZERO, 0.0);
        places.for_each(|p| (sum, count) = (sum + p, count + 1.0));
        if count > 0.0 { sum / count } else { DVec3::ZERO }
    };
    let base_middle = middle(&mut samples.iter().map(|&v| base_m[v]));
    let scan_middle = middle(&mut scan.positions_m().iter().copied());
    let turned = |yaw_rad: f64| {
        let rotation = DMat3::from_cols(
            DVec3::new(libm::cos(yaw_rad), 0.0, -libm::sin(yaw_rad)),
            DVec3::Y,
            DVec3::new(libm::sin(yaw_rad), 0.0, libm::cos(yaw_rad)),
        );
        Rigid { rotation, shift_m: base_middle - rotation * scan_middle }
    };
    let starts: Vec<Rigid> = match landmarks {
        [_, _, _, ..] => {
            let (base, scan): (Vec<DVec3>, Vec<DVec3>) = landmarks.iter().copied().unzip();
            vec![Rigid::between(&scan, &base, &vec![1.0; base.len()])]
        }
        _ if knows_front => [0.0, 0.35, -0.35].map(turned).to_vec(),
        _ => (0..STARTS).map(|i| turned(std::f64::consts::TAU * i as f64 / STARTS as f64)).collect(),
    };
    let first = if landmarks.len() >= 3 { 2 } else { 0 };
    let tried = starts.into_par_iter().map(|start| {
        let mut motion = start;
        for within_m in &WITHIN_M[first..] {
            for _ in 0..STEPS {
                motion = step(base_m, normals, &samples, scan, &motion, *within_m);
            }
        }
        for _ in 0..PLANE_STEPS {
            motion = plane_step(base_m, normals, &samples, scan, &motion, WITHIN_M[WITHIN_M.len() - 1]);
        }
        let away_m = |&v: &usize| {
            pair(base_m, normals, v, scan, &motion, FAR_M)
                .map_or(FAR_M, |(base, scan)| base.distance(motion.place(scan)))
        };
        (motion, samples.iter().map(away_m).sum::<f64>() / samples.len().max(1) as f64)
    });
    let tried: Vec<(Rigid, f64)> = tried.collect();
    let mut best = tried[0];
    for &other in &tried[1..] {
        if other.1 < best.1 {
            best = other;
        }
    }
    best
}

/// A vertex of the base and its place in the scan, before the motion.
fn pair(
    base_m: &[DVec3],
    normals: &[DVec3],
    vertex: usize,
    scan: &Surface,
    motion: &Rigid,
    within_m: f64,
) -> Option<(DVec3, DVec3)> {
    let back = motion.rotation.transpose();
    let (from, normal) = (back * (base_m[vertex] - motion.shift_m), back * normals[vertex]);
    let hit = scan.nearest(from, within_m, |other| other.dot(normal) > 0.5)?;
    (!hit.on_border).then_some((base_m[vertex], hit.place_m))
}

fn step(
    base_m: &[DVec3],
    normals: &[DVec3],
    samples: &[usize],
    scan: &Surface,
    motion: &Rigid,
    within_m: f64,
) -> Rigid {
    let mut pairs: Vec<(DVec3, DVec3)> =
        samples.iter().filter_map(|&v| pair(base_m, normals, v, scan, motion, within_m)).collect();
    if pairs.len() < 10 {
        return *motion;
    }
    pairs.sort_by(|a, b| {
        let away = |(base, scan): &(DVec3, DVec3)| base.distance_squared(motion.place(*scan));
        away(a).total_cmp(&away(b))
    });
    pairs.truncate((KEPT * pairs.len() as f64) as usize);
    let (base, scan): (Vec<DVec3>, Vec<DVec3>) = pairs.into_iter().unzip();
    Rigid::between(&scan, &base, &vec![1.0; base.len()])
}

/// As [`step`], but towards the tangent planes of the base (Chen and Medioni 1991), with small angles.
fn plane_step(
    base_m: &[DVec3],
    normals: &[DVec3],
    samples: &[usize],
    scan: &Surface,
    motion: &Rigid,
    within_m: f64,
) -> Rigid {
    let mut rows: Vec<([f64; 6], f64)> = Vec::new();
    for &v in samples {
        let Some((base, from)) = pair(base_m, normals, v, scan, motion, within_m) else { continue };
        let (p, n) = (motion.place(from), normals[v]);
        let turn = p.cross(n);
        rows.push(([turn.x, turn.y, turn.z, n.x, n.y, n.z], n.dot(base - p)));
    }
    rows.sort_by(|a, b| a.1.abs().total_cmp(&b.1.abs()));
    rows.truncate((KEPT * rows.len() as f64) as usize);
    let mut system = [[0.0; 7]; 6];
    for (row, right) in &rows {
        for i in 0..6 {
            (0..6).for_each(|j| system[i][j] += row[i] * row[j]);
            system[i][6] += row[i] * right;
        }
    }
    let Some(x) = solved(system).filter(|_| rows.len() >= 50) else { return *motion };
    let turn = DVec3::new(x[0], x[1], x[2]);
    let angle = turn.length();
    let rotation = if angle > 1e-12 { DMat3::from_quat(small_turn(turn / angle, angle)) } else { DMat3::IDENTITY };
    Rigid { rotation, shift_m: DVec3::new(x[3], x[4], x[5]) }.after(motion)
}

fn small_turn(axis: DVec3, angle_rad: f64) -> DQuat {
    let (sin, cos) = (libm::sin(0.5 * angle_rad), libm::cos(0.5 * angle_rad));
    DQuat::from_xyzw(axis.x * sin, axis.y * sin, axis.z * sin, cos)
}

/// Gaussian elimination of a symmetric positive definite system, its right side in the last column; `None` where it is singular.
pub(super) fn solved(mut system: [[f64; 7]; 6]) -> Option<[f64; 6]> {
    for i in 0..6 {
        let pivot = system[i];
        if pivot[i].is_nan() || pivot[i] <= 1e-9 {
            return None;
        }
        for row in system.iter_mut().skip(i + 1) {
            let share = row[i] / pivot[i];
            row.iter_mut().zip(pivot).for_each(|(to, from)| *to -= share * from);
        }
    }
    let mut x = [0.0; 6];
    for i in (0..6).rev() {
        let known: f64 = (i + 1..6).map(|j| system[i][j] * x[j]).sum();
        x[i] = (system[i][6] - known) / system[i][i];
    }
    Some(x)
}
