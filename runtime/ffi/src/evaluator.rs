//! Frames: the kimono in a pose, into the caller's buffers.

use crate::axes::Axes;
use crate::buffer::{self, Attribute, given, given_mut, put_handle};
use crate::pack::{Kimono, KitsukePack};
use crate::pose::PoseData;
use crate::status::{Status, guarded};
use kitsuke::glam::{Affine3A, Vec3};
use kitsuke::{Frame, Scratch, evaluate, vertex_normals};
use std::sync::Arc;

/// A kimono with the working memory of one thread.
pub struct KitsukeEvaluator {
    kimono: Arc<Kimono>,
    axes: Axes,
    scratch: Scratch,
    /// What does not go straight into the caller's buffers.
    positions_m: Vec<Vec3>,
    normals: Vec<Vec3>,
    obi_m: Vec<Vec3>,
    obi_normals: Vec<Vec3>,
    posed_from_rest: Vec<Affine3A>,
}

/// Makes an evaluator of a kimono, one per thread; all its frames are in these axes.
///
/// # Safety
/// `pack` must be null or a handle, `evaluator` a place for a handle.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn kitsuke_evaluator_new(
    pack: *const KitsukePack,
    axes: i32,
    evaluator: *mut *mut KitsukeEvaluator,
) -> Status {
    guarded(|| {
        let axes = Axes::of(axes)?;
        let make = || {
            // SAFETY: as the caller promises.
            let kimono = unsafe { given("the pack", pack)?.0.clone() };
            let garment = kimono.garment();
            let obi_vertices = kimono.accessories().obi.as_ref().map_or(0, |obi| obi.positions_m.len());
            Ok(KitsukeEvaluator {
                axes,
                scratch: Scratch::new(garment),
                positions_m: vec![Vec3::ZERO; garment.vertex_count()],
                normals: vec![Vec3::ZERO; garment.vertex_count()],
                obi_m: vec![Vec3::ZERO; obi_vertices],
                obi_normals: vec![Vec3::ZERO; obi_vertices],
                posed_from_rest: vec![Affine3A::IDENTITY; garment.data().skeleton.frame_count()],
                kimono,
            })
        };
        // SAFETY: as the caller promises.
        unsafe { put_handle("the evaluator", evaluator, make) }
    })
}

/// Frees an evaluator.
///
/// # Safety
/// `evaluator` must be null or a handle that has not been freed.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn kitsuke_evaluator_free(evaluator: *mut KitsukeEvaluator) {
    // SAFETY: as the caller promises.
    unsafe { buffer::free(evaluator) };
}

/// Writes the kimono in this pose: positions, and unit normals unless `normals` is null. In glTF's axes, where both lie close together in
/// buffers of their own, nothing is copied. Does not allocate.
///
/// # Safety
/// `evaluator` must be null or a handle that no other thread uses, `pose` null or a pose; `positions` and `normals` null or attributes
/// whose buffers are as long as they say. Both may lie in one buffer, side by side.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn kitsuke_evaluate(
    evaluator: *mut KitsukeEvaluator,
    pose: *const PoseData,
    positions: *const Attribute,
    normals: *const Attribute,
) -> Status {
    guarded(|| {
        // SAFETY: as the caller promises.
        let (evaluator, pose) = unsafe { (given_mut("the evaluator", evaluator)?, given("the pose", pose)?) };
        // SAFETY: as the caller promises.
        let (positions, normals) =
            unsafe { (*given("the attribute of positions", positions)?, normals.as_ref().copied()) };
        let KitsukeEvaluator { kimono, axes, scratch, positions_m: own_m, normals: own_normals, .. } = evaluator;
        let (garment, axes) = (kimono.garment(), *axes);
        let (pose, count) = (pose.pose(axes), garment.vertex_count());
        let is_apart = normals.is_none_or(|normals| normals.data != positions.data);
        if axes == Axes::Gltf && is_apart {
            // SAFETY: as the caller promises; the two buffers are not the same.
            let straight = unsafe {
                let normals = normals.map(|normals| normals.slice("normals", count)).transpose()?;
                (positions.slice("positions", count)?, normals)
            };
            if let (Some(positions_m), None | Some(Some(_))) = straight {
                let normals = straight.1.flatten().unwrap_or_default();
                evaluate(garment, &pose, scratch, Frame { positions_m, normals });
                return Ok(());
            }
        }
        let wanted = if normals.is_some() { count } else { 0 };
        evaluate(garment, &pose, scratch, Frame { positions_m: own_m, normals: &mut own_normals[..wanted] });
        // SAFETY: as the caller promises; the one is written after the other.
        unsafe {
            positions.write("positions", own_m, |place_m| axes.place(place_m))?;
            normals.map_or(Ok(()), |to| to.write("normals", own_normals, |normal| axes.direction(normal)))
        }
    })
}

/// Writes the obi in this pose, which must be that of the kimono: positions, and unit normals unless `normals` is null. Does not allocate;
/// writes nothing where there is no obi.
///
/// # Safety
/// As [`kitsuke_evaluate`].
#[unsafe(no_mangle)]
pub unsafe extern "C" fn kitsuke_evaluate_obi(
    evaluator: *mut KitsukeEvaluator,
    pose: *const PoseData,
    positions: *const Attribute,
    normals: *const Attribute,
) -> Status {
    guarded(|| {
        // SAFETY: as the caller promises.
        let (evaluator, pose) = unsafe { (given_mut("the evaluator", evaluator)?, given("the pose", pose)?) };
        // SAFETY: as the caller promises.
        let (positions, normals) =
            unsafe { (*given("the attribute of positions", positions)?, normals.as_ref().copied()) };
        let KitsukeEvaluator { kimono, axes, obi_m, obi_normals, posed_from_rest, .. } = evaluator;
        let Some(obi) = &kimono.accessories().obi else { return Ok(()) };
        obi.pose(kimono.garment(), &pose.pose(*axes), posed_from_rest, obi_m);
        // SAFETY: as the caller promises.
        unsafe { positions.write("positions of the obi", obi_m, |place_m| axes.place(place_m)) }?;
        let Some(normals) = normals else { return Ok(()) };
        vertex_normals(obi_m, obi.triangles.iter().copied(), obi_normals);
        // SAFETY: as the caller promises; the one is written after the other.
        unsafe { normals.write("normals of the obi", obi_normals, |normal| axes.direction(normal)) }
    })
}
