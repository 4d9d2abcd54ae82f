//! What the small numbers of a pack cost: how far its targets, and the posed surface between them, lie from what they would be without. The
//! rates are the pack's own on both sides. Knows only what an app knows, and the deltas as they were.

use crate::measure::pose_space;
use crate::measure::weld_quality::random_weights;
use crate::stages::StageError;
use glam::{Affine3A, Vec3};
use kitsuke::arrays::{Compression, GarmentData, Loss, Target};
use kitsuke::fit::Field;
use kitsuke::{Garment, Rates};
use rayon::prelude::*;

/// Poses between the samples at which the surface is compared.
pub const POSES: usize = 500;
/// Where they begin among those of the pose space: not at the audit's, nor at the correctives'.
const FIRST: u64 = 1 << 21;
/// Mixes of sizes at which a fit is compared.
const MIXES: u64 = 99;
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
    let owned: Vec<Owned> =
        (0..data.drivers.len()).map(|d| Owned::new(masks, d, data.drivers.len(), &errors_m)).collect();
    let of_pose = |pose: &kitsuke::skeleton::Pose| -> Vec<f32> {
        let mut rates = Rates::new(data);
        garment.blend_rates(garment.kernel(), pose, &mut rates);
        let mut posed_from_rest = vec![Affine3A::IDENTITY; data.skeleton.frame_count()];
        data.skeleton.posed_from_rest(&pose.with_arms_untwisted(), &mut posed_from_rest);
        let mut error_m = vec![Vec3::ZERO; garment.unique_count()];
        for (driver, owned) in owned.iter().enumerate() {
            let mut moved_m = vec![Vec3::ZERO; owned.vertices.len()];
            for (errors_m, &rate) in owned.errors_m.iter().zip(rates.driver(driver)).filter(|(_, rate)| **rate != 0.0) {
                moved_m.iter_mut().zip(errors_m).for_each(|(moved_m, error_m)| *moved_m += *error_m * rate);
            }
            for (&(vertex, share), moved_m) in owned.vertices.iter().zip(moved_m) {
                error_m[vertex] += moved_m * share;
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

/// The base vertices of a driver's region.
struct Owned {
    /// Vertex, and how much of it the driver owns.
    vertices: Vec<(usize, f32)>,
    /// Per target what it has lost there, metres.
    errors_m: Vec<Vec<Vec3>>,
}

impl Owned {
    fn new(masks: &[u16], driver: usize, drivers: usize, errors_m: &[Vec<Vec3>]) -> Owned {
        let of_driver = masks.iter().skip(driver).step_by(drivers).enumerate().filter(|(_, mask)| **mask > 0);
        let vertices: Vec<(usize, f32)> = of_driver.map(|(v, &mask)| (v, f32::from(mask) / 65535.0)).collect();
        let of_target = |errors_m: &Vec<Vec3>| vertices.iter().map(|&(vertex, _)| errors_m[vertex]).collect();
        let errors_m = errors_m.iter().map(of_target).collect();
        Owned { vertices, errors_m }
    }
}

/// What the steps of the fields of sizes lose of any wearer's shape: over random mixes of sizes, part by part. `fields_m` are per part,
/// size and base vertex, as they were; `fields` per part and size, as they are stored, in the order of `source_vertex`.
pub fn sizes(fields_m: &[[f32; 3]], fields: &[Field], source_vertex: &[u32], sizes: usize, budget_m: f32) -> Loss {
    let vertices = source_vertex.len();
    let lost = |(field_m, field): (&[[f32; 3]], &Field)| -> Vec<Vec3> {
        let is_m = field.deltas.iter().map(|steps| Vec3::from_array(steps.map(f32::from)) * field.step_m);
        is_m.zip(source_vertex).map(|(is_m, &v)| is_m - Vec3::from_array(field_m[v as usize])).collect()
    };
    let errors_m: Vec<Vec<Vec3>> = fields_m.par_chunks_exact(vertices.max(1)).zip(fields).map(lost).collect();
    let of_mix = |mix: u64| -> Vec<f32> {
        let mut sum_m = vec![Vec3::ZERO; vertices];
        let weights = random_weights(mix, errors_m.len() / sizes.max(1), sizes);
        for (errors_m, weight) in errors_m.iter().zip(weights).filter(|(_, weight)| *weight != 0.0) {
            sum_m.iter_mut().zip(errors_m).for_each(|(sum_m, error_m)| *sum_m += *error_m * weight);
        }
        sum_m.into_iter().map(Vec3::length).collect()
    };
    loss((0..MIXES).into_par_iter().flat_map_iter(of_mix).collect(), budget_m)
}

/// The coarsest numbers that keep the budget: how fine they must be for that follows from how errors add up, which is measured. `compressed` makes
/// something whose numbers are as fine as this, metres, and says what that loses.
///
/// # Errors
/// Those of `compressed`, and when nothing keeps the budget.
pub fn within_budget<T>(
    budget_m: f32,
    compressed: impl Fn(f32) -> Result<(T, Loss), StageError>,
) -> Result<(T, Loss), StageError> {
    let mut radius_m = budget_m;
    for _ in 0..TRIES {
        let (made, lost) = compressed(radius_m)?;
        if lost.max_m <= budget_m + NOISE_M {
            return Ok((made, lost));
        }
        radius_m *= FINER * budget_m / lost.max_m;
    }
    let budget_mm = 1e3 * budget_m;
    Err(StageError::new("compress", format!("no numbers keep a budget of {budget_mm:.3} mm: give a larger one")))
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

#[cfg(test)]
mod tests {
    use super::*;

    /// Two parts, three sizes, five vertices.
    fn fields_of(step_m: f32) -> Vec<Field> {
        let delta = |at: usize| field_m(at).map(|x_m| (x_m / step_m).round() as i16);
        (0..6).map(|field| Field { step_m, deltas: (0..5).map(|v| delta(5 * field + v)).collect() }).collect()
    }

    fn field_m(at: usize) -> [f32; 3] {
        [at as f32 * 1.37e-3, (at % 7) as f32 * -0.71e-3, 0.1]
    }

    #[test]
    fn steps_of_sizes_are_as_coarse_as_any_mix_lets_them_be() {
        let fields_m: Vec<[f32; 3]> = (0..2 * 3 * 5).map(field_m).collect();
        let (budget_m, order) = (0.2e-3, [0, 1, 2, 3, 4]);
        let made = |step_m: f32| {
            let fields = fields_of(step_m);
            let lost = sizes(&fields_m, &fields, &order, 3, budget_m);
            Ok((fields, lost))
        };
        let (fields, lost) = within_budget(budget_m, made).unwrap();
        assert!(lost.max_m <= budget_m + NOISE_M && fields[0].step_m > 0.2 * budget_m, "{lost:?}");
        // Whole sizes, part by part, and their halves are mixes, too.
        let error_m = |field: usize, v: usize| {
            let is_m = Vec3::from_array(fields[field].deltas[v].map(f32::from)) * fields[field].step_m;
            is_m - Vec3::from_array(fields_m[5 * field + v])
        };
        for (one, other) in (0..3).flat_map(|one| (0..3).map(move |other| (one, other))) {
            for v in 0..5 {
                let both = (error_m(one, v) + error_m(3 + other, v)).length();
                assert!(both <= budget_m * 1.001, "{both} in sizes {one} and {other}");
            }
        }
        // In the pack's order others stand at the same places.
        let mut turned = fields_of(budget_m / 8.0);
        turned.iter_mut().for_each(|field| field.deltas.reverse());
        assert!(sizes(&fields_m, &turned, &[4, 3, 2, 1, 0], 3, budget_m).max_m < budget_m);
        assert!(sizes(&fields_m, &turned, &order, 3, budget_m).max_m > budget_m);
        let none = vec![Field { step_m: 1e-4, deltas: vec![[0; 3]; 5] }; 6];
        let wrong = sizes(&fields_m, &none, &order, 3, budget_m);
        assert!(wrong.max_m > 0.1 && wrong.above_half > 0.9, "{wrong:?}");
    }
}
