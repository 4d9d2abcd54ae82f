//! A pack with some shapes exchanged and everything else as it was built: what an artist sees a second after she saved a target, while the
//! build goes on. Exact in the target's own pose; regions, skin weights and correctives are still those of the shape before.

use crate::ir;
use crate::stages::deltas::deltas;
use crate::stages::fit_data::packed_from_source;
use glam::Vec3;
use kitsuke::Pack;
use kitsuke::arrays::{GarmentData, Target};
use kitsuke::garment::Garment;
use kitsuke::pack::write::write_with;
use rayon::prelude::*;

/// Rotations that differ by no more are the same row.
const SAME_ROTATION: f32 = 1e-5;

/// The pack with the shapes of `source`, without its sizes; `None` where more than shapes has changed, or no shape has.
#[must_use]
pub fn draft(source: &ir::Garment, built: &Pack) -> Option<Vec<u8>> {
    let data = built.garment().data();
    if !is_same_but_for_shapes(source, data) {
        return None;
    }
    let packed = packed_from_source(&data.mesh);
    let skin: Vec<_> = packed.iter().map(|&v| data.skin[v as usize]).collect();
    let exchanged: Vec<Option<Target>> = source
        .targets
        .par_iter()
        .zip(&data.targets)
        .map(|(shape, target)| {
            let moved = deltas(&source.base.positions_m, &skin, &data.skeleton, &source.pose_bones, shape).ok()?;
            let moved: Vec<Vec3> = data.mesh.source_vertex.iter().map(|&v| moved[v as usize]).collect();
            is_other(target, &moved, data, source.budget_m).then(|| with_shape(target, &moved, data))
        })
        .collect();
    if exchanged.iter().all(Option::is_none) {
        return None;
    }
    let mut data = GarmentData { certificate: None, compression: None, ..data.clone() };
    for (target, exchanged) in data.targets.iter_mut().zip(exchanged) {
        *target = exchanged.unwrap_or_else(|| target.clone());
    }
    write_with(&Garment::new(data).ok()?, built.accessories(), None).ok()
}

fn is_same_but_for_shapes(source: &ir::Garment, data: &GarmentData) -> bool {
    let rotations = source.targets.iter().flat_map(|target| &target.rotations);
    let rows = data.poses.rotations.iter().skip(data.poses.bones.len());
    let base_m = &source.base.positions_m;
    base_m.len() == data.mesh.positions_m.len()
        && data.mesh.source_vertex.iter().zip(&data.mesh.positions_m).all(|(&v, p)| base_m[v as usize] == *p)
        && source.pose_bones == data.poses.bones
        && source.targets.len() == data.sample_count()
        && source.targets.iter().zip(&data.targets).all(|(shape, target)| shape.name == target.name)
        && rotations.clone().count() == rows.len()
        && rotations.zip(rows).all(|(a, b)| a.dot(*b).abs() > 1.0 - SAME_ROTATION)
}

/// Whether a shape is not that of the pack: farther from it than the budget and its steps explain.
fn is_other(target: &Target, moved: &[Vec3], data: &GarmentData, budget_m: f32) -> bool {
    let mut differs_m = moved.to_vec();
    for (v, delta) in target.vertices(&data.segments).zip(&target.deltas) {
        differs_m[v] -= Vec3::from_array(delta.map(f32::from)) * target.step_m;
    }
    let bound_m = 2.0 * (budget_m + target.step_m);
    // Where a target has no segment the build found nothing worth keeping, up to the same bound.
    differs_m.iter().any(|difference_m| difference_m.length() > bound_m)
}

/// The target with other deltas (per unique vertex, metres), in whole steps.
fn with_shape(target: &Target, moved: &[Vec3], data: &GarmentData) -> Target {
    let mut with = Target { segments: Vec::new(), deltas: Vec::new(), ..target.clone() };
    let mut start = 0;
    for (number, segment) in data.segments.iter().enumerate() {
        let run = &moved[start..start + segment.vertex_count as usize];
        start += run.len();
        let steps = run.iter().map(|delta_m| (*delta_m / target.step_m).round().to_array().map(|step| step as i16));
        let is_driven = segment.drivers.iter().any(|&driver| data.drivers[usize::from(driver)].layer == target.layer);
        if is_driven && steps.clone().any(|steps| steps != [0; 3]) {
            with.segments.push(number as u16);
            with.deltas.extend(steps);
        }
    }
    with
}
