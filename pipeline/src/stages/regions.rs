//! Region masks: which driver owns how much of each vertex. Knows the deltas, not how they are stored.

use crate::ir::{self, Driver, Surface, TargetShape};
use crate::stages::StageError;
use crate::stages::laplacian::{Neighbours, diffuse};
use crate::stages::weights::{WHOLE, shares};
use glam::{Quat, Vec3};
use kitsuke::skeleton::Bone;
use rayon::prelude::*;
use std::collections::BTreeSet;

/// How regions grow.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Settings {
    /// How far over the cloth a region blends into the next, metres.
    pub smoothing_m: f32,
    /// A vertex whose deltas have this root mean square is half believed, metres; what moves less says little about
    /// who moves it.
    pub believed_m: f32,
    /// A driver that explains less of a vertex than this share of what the strongest explains does not own it.
    pub least_share: f32,
}

impl Default for Settings {
    fn default() -> Settings {
        Settings { smoothing_m: 0.08, believed_m: 0.004, least_share: 0.5 }
    }
}

/// Masks in 1/65535, one row of `drivers.len()` per vertex of the base. What the drivers of one layer have in a grown row sums to
/// the whole everywhere, so that a target at full rate in all of them is reproduced; painted rows are as painted, scaled down
/// where a layer's sum to more.
///
/// # Errors
/// When the masks cannot be smoothed.
pub fn regions(
    base: &Surface,
    how: &ir::Regions,
    drivers: &[Driver],
    bones: &[Bone],
    targets: &[TargetShape],
    deltas: &[Vec<Vec3>],
    settings: &Settings,
) -> Result<Vec<u16>, StageError> {
    match how {
        ir::Regions::Painted(masks) => Ok(painted(masks, drivers, base.positions_m.len())),
        ir::Regions::Auto => {
            let mut all = vec![0; base.positions_m.len() * drivers.len()];
            let layers = drivers.iter().map(|driver| driver.layer).collect::<BTreeSet<_>>();
            for layer in layers {
                let places: Vec<usize> = (0..drivers.len()).filter(|&d| drivers[d].layer == layer).collect();
                let of_layer: Vec<usize> = (0..targets.len()).filter(|&t| targets[t].layer == layer).collect();
                let turned: Vec<&TargetShape> = of_layer.iter().map(|&target| &targets[target]).collect();
                let moved: Vec<&[Vec3]> = of_layer.iter().map(|&target| deltas[target].as_slice()).collect();
                let angles = angles(places.iter().map(|&place| &drivers[place]), bones, &turned);
                let grown = grown(base, &angles, &moved, settings)?;
                for (row, grown) in all.chunks_mut(drivers.len()).zip(grown.chunks(places.len())) {
                    places.iter().zip(grown).for_each(|(&place, &mask)| row[place] = mask);
                }
            }
            Ok(all)
        }
    }
}

/// Masks as painted, rounded down, so that no layer's sum in a row is more than the whole.
fn painted(masks: &[Vec<f32>], drivers: &[Driver], vertex_count: usize) -> Vec<u16> {
    let row = |v: usize| {
        let sum = |layer: u8| -> f64 {
            let of_layer = masks.iter().zip(drivers).filter(|(_, driver)| driver.layer == layer);
            of_layer.map(|(mask, _)| f64::from(mask[v])).sum()
        };
        let share = |(mask, driver): (&Vec<f32>, &Driver)| f64::from(mask[v]) / sum(driver.layer).max(1.0);
        masks.iter().zip(drivers).map(|both| (share(both) * f64::from(WHOLE)) as u16).collect::<Vec<_>>()
    };
    (0..vertex_count).flat_map(row).collect()
}

/// Asks of every vertex which driver's turning explains its movement, then smooths the answers over the cloth and
/// carries them to where hardly anything moves.
fn grown(base: &Surface, angles: &[Vec<f64>], deltas: &[&[Vec3]], settings: &Settings) -> Result<Vec<u16>, StageError> {
    let vertex_count = base.positions_m.len();
    let driver_count = angles.len();
    let influences: Vec<Vec<f64>> = (0..vertex_count)
        .into_par_iter()
        .map(|v| {
            let movement: Vec<f64> = deltas.iter().map(|delta| f64::from(delta[v].length())).collect();
            nonnegative_least_squares(angles, &movement)
        })
        .collect();
    // A shoulder lifts the whole sleeve, an elbow moves less and less of it: each driver is measured by what it does
    // elsewhere, or the strongest would own everything.
    let usual: Vec<f64> = (0..driver_count)
        .map(|d| (influences.iter().map(|row| row[d] * row[d]).sum::<f64>() / vertex_count as f64).sqrt())
        .collect();
    let relative = |(&influence, &usual): (&f64, &f64)| if usual > 0.0 { influence / usual } else { 0.0 };
    let explained: Vec<Vec<f64>> =
        influences.iter().map(|row| normalised(row.iter().zip(&usual).map(relative).collect())).collect();

    let neighbours = Neighbours::new(&base.positions_m, &base.triangles);
    // The diffusion forgets over sqrt(1 / anchor) edges.
    let edges = f64::from(settings.smoothing_m) / neighbours.mean_edge_m(&base.positions_m).max(1e-6);
    let weak = f64::from(settings.believed_m).powi(2) * deltas.len() as f64;
    let anchors: Vec<f64> = (0..vertex_count)
        .map(|v| {
            let energy: f64 = deltas.iter().map(|delta| f64::from(delta[v].length_squared())).sum();
            let is_explained = explained[v].iter().any(|&share| share > 0.0);
            if is_explained { energy / (energy + weak) / edges.powi(2) } else { 0.0 }
        })
        .collect();
    let smooth: Vec<Vec<f64>> = (0..driver_count)
        .into_par_iter()
        .map(|d| diffuse(&neighbours, &anchors, &explained.iter().map(|row| row[d]).collect::<Vec<_>>()))
        .collect::<Result<_, StageError>>()?;

    // Lowering all shares alike, instead of cutting the small ones off, leaves no step at a region's edge.
    let least = f64::from(settings.least_share);
    Ok((0..vertex_count)
        .flat_map(|v| {
            let strongest = smooth.iter().map(|mask| mask[v]).fold(0.0, f64::max);
            let owned: Vec<f64> = smooth.iter().map(|mask| (mask[v] - least * strongest).max(0.0)).collect();
            // Where nothing ever moves, every driver is as good as any other.
            shares(&if strongest > 0.0 { owned } else { vec![1.0; driver_count] })
        })
        .collect())
}

/// Per driver and target how far its joints turn from the T-pose, radians: the root of the sum of the squared angles.
fn angles<'a>(drivers: impl Iterator<Item = &'a Driver>, bones: &[Bone], targets: &[&TargetShape]) -> Vec<Vec<f64>> {
    let of_target = |driver: &Driver, target: &TargetShape| {
        let turned = bones.iter().zip(&target.rotations).filter(|(bone, _)| driver.joints.contains(bone));
        turned.map(|(_, &rotation)| angle_rad(rotation).powi(2)).sum::<f64>().sqrt()
    };
    drivers.map(|driver| targets.iter().map(|target| of_target(driver, target)).collect()).collect()
}

fn angle_rad(rotation: Quat) -> f64 {
    2.0 * libm::atan2(f64::from(rotation.xyz().length()), f64::from(rotation.w.abs()))
}

/// The nonnegative `x` that minimises `|sum_j x_j columns_j - wanted|`, by cyclic coordinate descent, which converges
/// for every such problem. A column of zeros gets 0.
fn nonnegative_least_squares(columns: &[Vec<f64>], wanted: &[f64]) -> Vec<f64> {
    // Columns that are nearly alike need many rounds; most problems rest after a few.
    const ROUNDS: usize = 5000;
    const REST: f64 = 1e-9;
    let mut x = vec![0.0; columns.len()];
    let mut missing = wanted.to_vec();
    for _ in 0..ROUNDS {
        let mut largest = 0.0f64;
        for (x, column) in x.iter_mut().zip(columns) {
            let length_squared: f64 = column.iter().map(|a| a * a).sum();
            if length_squared == 0.0 {
                continue;
            }
            let along: f64 = column.iter().zip(&missing).map(|(a, m)| a * m).sum();
            let step = (along / length_squared).max(-*x);
            *x += step;
            missing.iter_mut().zip(column).for_each(|(m, a)| *m -= step * a);
            largest = largest.max(step.abs() * length_squared.sqrt());
        }
        if largest < REST {
            break;
        }
    }
    x
}

fn normalised(mut row: Vec<f64>) -> Vec<f64> {
    let sum: f64 = row.iter().sum();
    if sum > 0.0 {
        row.iter_mut().for_each(|share| *share /= sum);
    }
    row
}

/// The largest movement that masks which sum to less than the whole take from the targets that turn one driver.
#[derive(Clone, Debug, PartialEq)]
pub struct Remainder {
    /// The driver.
    pub driver: String,
    /// What is lost of the delta, metres.
    pub lost_m: f32,
    /// At which vertex of the base.
    pub vertex: usize,
    /// In which target.
    pub target: String,
}

/// What masks cut off the deltas, for each driver that loses anything.
#[must_use]
pub fn remainders(
    masks: &[u16],
    drivers: &[Driver],
    bones: &[Bone],
    targets: &[TargetShape],
    deltas: &[Vec<Vec3>],
) -> Vec<Remainder> {
    let shapes: Vec<&TargetShape> = targets.iter().collect();
    let angles = angles(drivers.iter(), bones, &shapes);
    let mut worst: Vec<Remainder> = Vec::new();
    for (driver, angles) in drivers.iter().zip(&angles) {
        let missing = missing_shares(masks, drivers, driver.layer);
        let is_turning = |target: &TargetShape, angle: f64| target.layer == driver.layer && angle > 1e-6;
        let turning = targets.iter().zip(deltas).zip(angles).filter(|((target, _), angle)| is_turning(target, **angle));
        let losses = turning.flat_map(|((target, deltas), _)| {
            let lost_m = deltas.iter().zip(missing.clone()).map(|(delta, missing)| missing * delta.length());
            lost_m.enumerate().map(move |(vertex, lost_m)| (lost_m, vertex, target))
        });
        if let Some((lost_m, vertex, target)) = losses.max_by(|a, b| a.0.total_cmp(&b.0))
            && lost_m > 0.0
        {
            worst.push(Remainder { driver: driver.name.clone(), lost_m, vertex, target: target.name.clone() });
        }
    }
    worst
}

/// How much of each vertex no driver of a layer owns, 0 to 1.
pub(crate) fn missing_shares(masks: &[u16], drivers: &[Driver], layer: u8) -> Vec<f32> {
    let missing = |row: &[u16]| {
        let of_layer = row.iter().zip(drivers).filter(|(_, driver)| driver.layer == layer);
        1.0 - of_layer.map(|(&mask, _)| f32::from(mask)).sum::<f32>() / f32::from(WHOLE)
    };
    masks.chunks(drivers.len().max(1)).map(missing).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        /// At the minimum no coordinate can be moved with gain: the gradient is 0 where x > 0, and not below 0 elsewhere.
        #[test]
        fn least_squares_reach_the_minimum(
            columns in prop::collection::vec(prop::collection::vec(0.0f64..2.0, 8), 3),
            wanted in prop::collection::vec(0.0f64..1.0, 8),
        ) {
            let x = nonnegative_least_squares(&columns, &wanted);
            for (j, column) in columns.iter().enumerate() {
                let gradient: f64 = (0..8)
                    .map(|k| column[k] * (columns.iter().zip(&x).map(|(c, x)| c[k] * x).sum::<f64>() - wanted[k]))
                    .sum();
                prop_assert!(x[j] >= 0.0 && gradient >= -1e-3, "gradient {gradient}");
                prop_assert!(x[j] < 1e-6 || gradient.abs() < 1e-3, "gradient {gradient}");
            }
        }
    }

    /// A strip of cloth of which one driver moves the left end and another the right.
    fn strip() -> (Surface, Vec<Driver>, Vec<TargetShape>, Vec<Vec<Vec3>>) {
        let n = 40;
        let positions_m: Vec<Vec3> =
            (0..2 * n).map(|v| Vec3::new(0.02 * (v / 2) as f32, 0.02 * (v % 2) as f32, 0.0)).collect();
        let triangles = (0..2 * n as u32 - 2).map(|v| [v, v + 1, v + 2]).collect();
        let base = Surface { positions_m, triangles, ..Surface::default() };
        let driver = |name: &str, bone| Driver {
            name: name.into(),
            group: name.into(),
            joints: vec![bone],
            threshold_rad: 1.0,
            layer: 0,
        };
        let drivers = vec![driver("left", Bone::LeftUpperArm), driver("right", Bone::RightUpperArm)];
        let turn = Quat::from_rotation_z(1.0);
        let target = |rotations| TargetShape {
            name: "t".into(),
            file: "t.obj".into(),
            layer: 0,
            rotations,
            positions_m: base.positions_m.clone(),
        };
        let targets = vec![target(vec![turn, Quat::IDENTITY]), target(vec![Quat::IDENTITY, turn])];
        let moved =
            |from, to| (0..2 * n).map(move |v| if (from..to).contains(&v) { Vec3::Y * 0.1 } else { Vec3::ZERO });
        let deltas = vec![moved(0, 30).collect(), moved(50, 80).collect()];
        (base, drivers, targets, deltas)
    }

    const BONES: [Bone; 2] = [Bone::LeftUpperArm, Bone::RightUpperArm];

    #[test]
    fn grown_masks_share_every_vertex_wholly_and_blend() {
        let (base, drivers, targets, deltas) = strip();
        let how = ir::Regions::Auto;
        let masks = regions(&base, &how, &drivers, &BONES, &targets, &deltas, &Settings::default()).unwrap();
        for row in masks.chunks(2) {
            assert_eq!(u32::from(row[0]) + u32::from(row[1]), 65535);
        }
        let left: Vec<u16> = masks.iter().step_by(2).copied().collect();
        assert!(left[0] == 65535 && left[79] == 0, "the ends have one owner: {} {}", left[0], left[79]);
        for (v, pair) in left.windows(2).enumerate() {
            assert!(pair[0].abs_diff(pair[1]) < 8000, "a step of {} at vertex {v}", pair[0].abs_diff(pair[1]));
        }
        assert_eq!(remainders(&masks, &drivers, &BONES, &targets, &deltas), []);
    }

    #[test]
    fn painted_masks_report_what_they_cut_off() {
        let (base, drivers, targets, deltas) = strip();
        let mut left = vec![1.0; 80];
        left[3] = 0.25;
        let how = ir::Regions::Painted(vec![left, vec![0.0; 80]]);
        let masks = regions(&base, &how, &drivers, &BONES, &targets, &deltas, &Settings::default()).unwrap();
        let lost = remainders(&masks, &drivers, &BONES, &targets, &deltas);
        assert_eq!(lost.len(), 1, "{lost:?}");
        assert_eq!((lost[0].driver.as_str(), lost[0].vertex), ("left", 3));
        assert!((lost[0].lost_m - 0.075).abs() < 1e-5, "{lost:?}");
    }
}
