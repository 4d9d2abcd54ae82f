//! What the small numbers of a pack cost: how far its targets, and the posed surface between them, lie from what they would be without. The
//! rates are the pack's own on both sides. Knows only what an app knows, and the deltas as they were.

use crate::measure::pose_space;
use crate::stages::StageError;
use glam::{Affine3A, Vec3};
use kitsuke::arrays::{Compression, GarmentData, Loss, Target};
use kitsuke::{Garment, Rates};
use rayon::prelude::*;

/// Poses between the samples at which the surface is compared.
pub const POSES: usize = 500;
/// Where they begin among those of the pose space: not at the audit's, nor at the correctives'.
const FIRST: u64 = 1 << 21;
/// Single precision, metres: a budget is not broken by less.
const NOISE_M: f32 = 1e-6;
/// How often finer numbers are tried, and by how much finer than the budget would ask.
const TRIES: usize = 8;
const FINER: f32 = 0.97;

/// Compares a garment with the deltas of its samples as they were before compression, per base vertex, metres; `masks` per base vertex a row
/// of as many as there are drivers.
pub fn compression(garment: &Garment, masks: &[u16], deltas_m: &[Vec<Vec3>], budget_m: f32) -> Compression {
    let data = garment.data();
    let errors_m: Vec<Vec<Vec3>> = data.targets.par_iter().zip(deltas_m).map(|(t, d)| lost_m(data, t, d)).collect();
    let of_target = |(target, errors_m): (&Target, &Vec<Vec3>)| {
        let drivers = data.drivers.len();
        let share = |row: &[u16]| {
            let own = row.iter().zip(&data.drivers).filter(|(_, driver)| driver.layer == target.layer);
            own.map(|(&mask, _)| f32::from(mask)).sum::<f32>() / 65535.0
        };
        let shares = masks.chunks_exact(drivers.max(1)).map(share);
        loss(errors_m.iter().zip(shares).map(|(error_m, share)| error_m.length() * share).collect(), budget_m)
    };
    let targets = data.targets.par_iter().zip(&errors_m).map(of_target).collect();
    let poses = pose_space::poses(garment, FIRST, POSES);
    let of_pose = |pose: &kitsuke::skeleton::Pose| -> Vec<f32> {
        let mut rates = Rates::new(data);
        garment.blend_rates(garment.kernel(), pose, &mut rates);
        let mut posed_from_rest = vec![Affine3A::IDENTITY; data.skeleton.frame_count()];
        data.skeleton.posed_from_rest(&pose.with_arms_untwisted(), &mut posed_from_rest);
        let mut error_m = vec![Vec3::ZERO; garment.unique_count()];
        for driver in 0..data.drivers.len() {
            let of_driver = masks.iter().skip(driver).step_by(data.drivers.len());
            let mut moved_m = vec![Vec3::ZERO; garment.unique_count()];
            for (errors_m, &rate) in errors_m.iter().zip(rates.driver(driver)).filter(|(_, rate)| **rate != 0.0) {
                moved_m.iter_mut().zip(errors_m).for_each(|(moved_m, error_m)| *moved_m += *error_m * rate);
            }
            for ((error_m, moved_m), &mask) in error_m.iter_mut().zip(moved_m).zip(of_driver) {
                *error_m += moved_m * (f32::from(mask) / 65535.0);
            }
        }
        let posed = |(skin, &source): (&kitsuke::arrays::SkinWeights, &u32)| {
            let turned = |(&joint, &weight): (&u8, &u16)| {
                posed_from_rest[usize::from(joint)].transform_vector3(error_m[source as usize])
                    * (f32::from(weight) / 65535.0)
            };
            skin.joints.iter().zip(&skin.weights).map(turned).sum::<Vec3>().length()
        };
        data.skin.iter().zip(&data.mesh.source_vertex).map(posed).collect()
    };
    let surface = loss(poses.par_iter().flat_map_iter(of_pose).collect(), budget_m);
    Compression { budget_m, targets, poses: POSES as u32, surface }
}

/// The coarsest numbers whose posed surface keeps the budget: how fine targets must be for that follows from how the kernel adds them up, which
/// is measured. `compressed` makes a garment whose targets are as fine as this, metres, and says what that loses.
///
/// # Errors
/// Those of `compressed`, and when nothing keeps the budget.
pub fn within_budget<T>(
    budget_m: f32,
    compressed: impl Fn(f32) -> Result<(T, Compression), StageError>,
) -> Result<(T, Compression), StageError> {
    let mut radius_m = budget_m;
    for _ in 0..TRIES {
        let (made, lost) = compressed(radius_m)?;
        if lost.surface.max_m <= budget_m + NOISE_M {
            return Ok((made, lost));
        }
        radius_m *= FINER * budget_m / lost.surface.max_m;
    }
    let budget_mm = 1e3 * budget_m;
    Err(StageError::new(
        "compress",
        format!("the posed surface does not keep a budget of {budget_mm:.3} mm: give a larger one"),
    ))
}

/// Measures a finished garment again.
///
/// # Errors
/// When its surface does not keep the budget for which it was made.
pub fn keep_budget(garment: &Garment, masks: &[u16], deltas_m: &[Vec<Vec3>]) -> Result<(), StageError> {
    let Some(Compression { budget_m, .. }) = garment.data().compression else { return Ok(()) };
    let found = compression(garment, masks, deltas_m, budget_m).surface;
    if found.max_m <= budget_m + NOISE_M {
        return Ok(());
    }
    let (max_mm, budget_mm) = (1e3 * found.max_m, 1e3 * budget_m);
    Err(StageError::new(
        "verify",
        format!(
            "between its samples the surface lies {max_mm:.3} mm from what it was, over the budget of {budget_mm:.3} mm"
        ),
    ))
}

/// What a target has lost, per base vertex, metres.
fn lost_m(data: &GarmentData, target: &Target, wanted_m: &[Vec3]) -> Vec<Vec3> {
    let mut lost_m: Vec<Vec3> = wanted_m.iter().map(|wanted_m| -*wanted_m).collect();
    for (v, delta) in target.vertices(&data.segments).zip(&target.deltas) {
        lost_m[data.mesh.source_vertex[v] as usize] += Vec3::from_array(delta.map(f32::from)) * target.step_m;
    }
    lost_m
}

fn loss(mut errors_m: Vec<f32>, budget_m: f32) -> Loss {
    if errors_m.is_empty() {
        return Loss::default();
    }
    let above = errors_m.iter().filter(|error_m| **error_m > budget_m / 2.0).count();
    let above_half = above as f32 / errors_m.len() as f32;
    let p99 = (errors_m.len() - 1) * 99 / 100;
    let (_, p99_m, above) = errors_m.select_nth_unstable_by(p99, f32::total_cmp);
    let p99_m = *p99_m;
    Loss { max_m: above.iter().fold(p99_m, |most_m, error_m| most_m.max(*error_m)), p99_m, above_half }
}
