//! Opens the written pack again and compares every target with the artist's file. Knows only what an app knows: the
//! pack's bytes and the run time.

use crate::StageError;
use crate::deltas::pose_of;
use crate::ir;
use crate::regions::missing_share;
use glam::Vec3;
use kitsuke::garment::Garment;
use kitsuke::skeleton::Pose;
use kitsuke::{Frame, Pack, Rates, Scratch, evaluate, evaluate_with_rates};
use rayon::prelude::*;

/// What single precision adds to the budget, metres.
const NOISE_M: f32 = 2e-5;

/// How far a blended target lies from its file, over all vertices of the base, metres.
#[derive(Clone, Debug, PartialEq)]
pub struct TargetQuality {
    /// The target's name.
    pub name: String,
    /// With only this target, at full rate: what the pack lost.
    pub alone: Distance,
    /// With the rates that the paper's kernel gives in this pose: what blending mixes in besides.
    pub paper: Distance,
}

/// Distances of corresponding vertices, metres.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Distance {
    /// The largest.
    pub max_m: f32,
    /// The mean.
    pub mean_m: f32,
    /// The base vertex where it is largest.
    pub vertex: usize,
}

/// The errors of every target of the pack.
///
/// # Errors
/// When the pack does not open, or a vertex lies farther from its file than the budget, what painted masks cut off
/// (`masks` and `deltas` as given to `compress`) and single precision allow.
pub fn verify(
    source: &ir::Garment,
    masks: &[u16],
    deltas: &[Vec<Vec3>],
    pack: &[u8],
) -> Result<Vec<TargetQuality>, StageError> {
    let pack =
        Pack::open(pack).map_err(|error| StageError::new("verify", format!("the pack does not open: {error}")))?;
    let garment = pack.garment();
    let missing: Vec<f32> = masks.chunks(source.drivers.len().max(1)).map(missing_share).collect();
    (0..source.targets.len())
        .into_par_iter()
        .map(|t| {
            let target = &source.targets[t];
            let pose = pose_of(&source.pose_bones, target);
            let alone_m = alone(garment, &pose, t);
            for (v, (found, wanted)) in alone_m.iter().zip(&target.positions_m).enumerate() {
                let allowed_m = source.budget_m + NOISE_M + missing[v] * deltas[t][v].length();
                let error_m = found.distance(*wanted);
                // A NaN is no small error.
                if error_m.is_nan() || error_m > allowed_m {
                    return Err(StageError::new(
                        "verify",
                        format!(
                            "target {} ({}): vertex {v} lies {:.3} mm from its file, over the budget of {:.3} mm",
                            target.name,
                            target.file,
                            error_m * 1e3,
                            allowed_m * 1e3
                        ),
                    ));
                }
            }
            let paper_m = in_source_order(garment, |scratch, frame| evaluate(garment, &pose, scratch, frame));
            Ok(TargetQuality {
                name: target.name.clone(),
                alone: distance(&alone_m, &target.positions_m),
                paper: distance(&paper_m, &target.positions_m),
            })
        })
        .collect()
}

/// Positions with one target at full rate in all drivers, in the order of the base file, metres.
fn alone(garment: &Garment, pose: &Pose, target: usize) -> Vec<Vec3> {
    let mut rates = Rates::new(garment);
    for driver in 0..garment.data().drivers.len() {
        rates.set(driver, target, 1.0);
    }
    in_source_order(garment, |scratch, frame| evaluate_with_rates(garment, pose, &rates, scratch, frame))
}

/// Positions of a frame by base vertex, metres.
fn in_source_order(garment: &Garment, evaluate: impl FnOnce(&mut Scratch, Frame<'_>)) -> Vec<Vec3> {
    let mut positions_m = vec![Vec3::ZERO; garment.vertex_count()];
    let mut normals = positions_m.clone();
    let frame = Frame { positions_m: &mut positions_m, normals: &mut normals };
    evaluate(&mut Scratch::new(garment), frame);
    let source_vertex = &garment.data().mesh.source_vertex;
    let mut in_order_m = vec![Vec3::NAN; source_vertex.len()];
    for (position_m, &v) in positions_m.iter().zip(source_vertex) {
        in_order_m[v as usize] = *position_m;
    }
    in_order_m
}

fn distance(found_m: &[Vec3], wanted_m: &[Vec3]) -> Distance {
    let mut result = Distance::default();
    let mut sum_m = 0.0;
    for (vertex, (found, wanted)) in found_m.iter().zip(wanted_m).enumerate() {
        let distance_m = found.distance(*wanted);
        sum_m += f64::from(distance_m);
        if distance_m > result.max_m {
            (result.max_m, result.vertex) = (distance_m, vertex);
        }
    }
    result.mean_m = (sum_m / found_m.len().max(1) as f64) as f32;
    result
}
