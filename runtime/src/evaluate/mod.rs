//! The frame: rates, masked blend in the base's unposed space, linear blend skinning, normals, seam twins (P0, step 3).
//! Each step is a function of its own, so that it can be measured. Knows no bytes of a pack, allocates nothing and
//! cannot fail.
//!
//! Blending and skinning are compiled for several sets of vector instructions, of which the widest that the machine
//! knows is chosen at run time. All of them give the same bits: sums are never reordered, and no multiplication is
//! fused with an addition.

mod blend;
mod normals;
mod skin;

pub use blend::blend;
pub use skin::skin;

use crate::garment::Garment;
use crate::plan::{LayerPart, Piece};
use crate::pose_blend::Rates;
use crate::skeleton::Pose;
use glam::{Affine3A, Vec3};
use normals::Normals;
use pulp::Arch;
use std::mem::size_of_val;

/// Vertices blended at a time: their sums stay in the first-level cache while target after target is added, and the
/// runs of deltas are long enough to be fetched ahead.
const BLOCK: usize = 512;
const FLOATS: usize = 3 * BLOCK;

/// The caller's buffers for one frame, [`Garment::vertex_count`] long: they can go to a GPU as they are.
#[derive(Debug)]
pub struct Frame<'a> {
    /// Posed positions, metres.
    pub positions_m: &'a mut [Vec3],
    /// Unit normals, outward; empty where none are wanted, which saves a quarter of the frame.
    pub normals: &'a mut [Vec3],
}

/// Working memory for the frames of one garment; no frame depends on what the one before left in it.
#[derive(Clone, Debug)]
pub struct Scratch {
    rates: Rates,
    /// The blended cloth before posing: x, y, z of every unique vertex, metres.
    blended_m: Vec<f32>,
    posed_from_rest: Vec<Affine3A>,
    normals: normals::Work,
}

impl Scratch {
    /// Working memory for this garment, or any other with as many vertices, joints, drivers and targets.
    #[must_use]
    pub fn new(garment: &Garment) -> Scratch {
        Scratch {
            rates: Rates::new(garment.data()),
            blended_m: vec![0.0; 3 * garment.unique_count()],
            posed_from_rest: vec![Affine3A::IDENTITY; garment.data().skeleton.frame_count()],
            normals: normals::Work::new(garment.unique_count(), &garment.plan().normals),
        }
    }

    /// The rates that the last [`evaluate`] used.
    #[must_use]
    pub fn rates(&self) -> &Rates {
        &self.rates
    }
}

/// Writes the kimono in this pose, with the blend rates of the garment's own kernel ([`Garment::kernel`]).
///
/// Whatever the pose holds, the frame is finite: rotations need not be unit quaternions, one that is not finite or has
/// no length counts as the T-pose, and a hips translation that is not finite as none (see [`Pose::sanitised`]).
///
/// # Panics
/// When a buffer is not [`Garment::vertex_count`] long, or `scratch` was made for a garment of another shape.
pub fn evaluate(garment: &Garment, pose: &Pose, scratch: &mut Scratch, frame: Frame<'_>) {
    let pose = pose.sanitised();
    let mut rates = std::mem::take(&mut scratch.rates);
    garment.blend_rates(garment.kernel(), &pose, &mut rates);
    evaluate_sanitised(garment, &pose, &rates, scratch, frame);
    scratch.rates = rates;
}

/// Writes the kimono in this pose, with the caller's blend rates instead of those that the pose gives.
///
/// # Panics
/// As [`evaluate`], and when `rates` was made for a garment of another shape.
pub fn evaluate_with_rates(garment: &Garment, pose: &Pose, rates: &Rates, scratch: &mut Scratch, frame: Frame<'_>) {
    evaluate_sanitised(garment, &pose.sanitised(), rates, scratch, frame);
}

fn evaluate_sanitised(garment: &Garment, pose: &Pose, rates: &Rates, scratch: &mut Scratch, frame: Frame<'_>) {
    assert_eq!(frame.positions_m.len(), garment.vertex_count(), "one position per vertex");
    if !frame.normals.is_empty() {
        assert_eq!(frame.normals.len(), garment.vertex_count(), "one normal per vertex, or none");
    }
    blend(garment, rates, scratch);
    skin(garment, pose, scratch, frame.positions_m);
    if !frame.normals.is_empty() {
        normals(garment, frame.positions_m, scratch, frame.normals);
    }
    twins(garment, frame);
}

/// Step 3: normals of the unique vertices: the mean of their triangles' normals weighted by area, across seams. Where
/// that has no direction, +Y.
///
/// # Panics
/// When `normals` is shorter than the unique vertices, or `scratch` was made for a garment of another shape.
pub fn normals(garment: &Garment, positions_m: &[Vec3], scratch: &mut Scratch, normals: &mut [Vec3]) {
    let unique = garment.unique_count();
    let (plan, work) = (&garment.plan().normals, &mut scratch.normals);
    let (positions_m, normals) = (&positions_m[..unique], &mut normals[..unique]);
    Arch::new().dispatch(Normals { plan, positions_m, work, normals });
}

/// Step 4: seam twins copy the vertices that they are twins of.
pub fn twins(garment: &Garment, frame: Frame<'_>) {
    let mesh = &garment.data().mesh;
    let unique = mesh.positions_m.len();
    let (originals, twins) = frame.positions_m.split_at_mut(unique);
    for (twin, &original) in twins.iter_mut().zip(&mesh.twin_of) {
        *twin = originals[original as usize];
    }
    let (originals, twins) = frame.normals.split_at_mut(unique.min(frame.normals.len()));
    for (twin, &original) in twins.iter_mut().zip(&mesh.twin_of) {
        *twin = originals[original as usize];
    }
}

/// Bytes that a frame with these rates reads and writes, each array counted once: what memory at least has to deliver.
#[must_use]
pub fn bytes_touched(garment: &Garment, rates: &Rates) -> usize {
    let data = garment.data();
    let (mesh, segments) = (&data.mesh, data.segments.iter().zip(&garment.plan().segments));
    let blended = segments.map(|(segment, parts)| {
        let count = segment.vertex_count as usize;
        let is_active = |part: &LayerPart, piece: &Piece| {
            let driver = |column: &u8| usize::from(segment.drivers[usize::from(*column)]);
            part.columns.iter().any(|column| rates.driver(driver(column))[usize::from(piece.target)] != 0.0)
        };
        let active = parts.iter().flat_map(|part| part.pieces.iter().filter(move |piece| is_active(part, piece)));
        active.count() * count * size_of::<[i16; 3]>() + size_of_val(segment.masks.as_slice())
    });
    let plan = garment.plan();
    let scratch =
        garment.unique_count() * size_of::<Vec3>() + normals::Work::new(garment.unique_count(), &plan.normals).bytes();
    let arrays = size_of_val(mesh.positions_m.as_slice())
        + plan.skin.bytes()
        + plan.normals.bytes()
        + size_of_val(mesh.twin_of.as_slice());
    blended.sum::<usize>() + arrays + scratch + garment.vertex_count() * 2 * size_of::<Vec3>()
}

#[cfg(test)]
mod tests {
    use super::blend::Blend;
    use super::skin::Skin;
    use super::*;
    use crate::Pack;
    use crate::plan::Plan;
    use crate::skeleton::Bone;
    use glam::Quat;
    use pulp::{Scalar, Simd};

    #[test]
    fn vector_instructions_change_no_bit() {
        let pack = Pack::open(include_bytes!("../../../tests/packs/v5_0.kitsuke")).unwrap();
        let garment = pack.garment();
        let pose = Pose::REST.with(Bone::LeftUpperArm, Quat::from_rotation_z(-0.8));
        let mut rates = Rates::new(garment.data());
        let (drivers, targets) = rates.shape();
        for (driver, target) in (0..drivers).flat_map(|driver| (0..targets).map(move |target| (driver, target))) {
            rates.set(driver, target, 0.3 + driver as f32 / 7.0 - target as f32 / 11.0);
        }
        let frame = |blend: &mut dyn FnMut(Blend), skin: &mut dyn FnMut(Skin), normals: &mut dyn FnMut(Normals)| {
            let Scratch { mut blended_m, mut posed_from_rest, normals: mut work, .. } = Scratch::new(garment);
            let mut positions_m = vec![Vec3::ZERO; garment.unique_count()];
            let mut unit = positions_m.clone();
            garment.data().skeleton.posed_from_rest(&pose, &mut posed_from_rest);
            let Plan { skin: plan, normals: normals_plan, .. } = garment.plan();
            blend(Blend { garment, rates: &rates, blended_m: &mut blended_m });
            let (posed_from_rest, blended_m) = (&posed_from_rest, &blended_m);
            skin(Skin { skin: plan, posed_from_rest, blended_m, positions_m: &mut positions_m });
            normals(Normals { plan: normals_plan, positions_m: &positions_m, work: &mut work, normals: &mut unit });
            positions_m.append(&mut unit);
            positions_m.iter().map(|v| v.to_array().map(f32::to_bits)).collect::<Vec<_>>()
        };
        macro_rules! frame_by {
            ($run:expr) => {
                frame(&mut |step| $run(step), &mut |step| $run(step), &mut |step| $run(step))
            };
        }
        let arch = Arch::new();
        let best = frame_by!(|step| arch.dispatch(step));
        let scalar = Scalar::new();
        assert_eq!(best, frame_by!(|step| Simd::vectorize(scalar, step)), "scalar");
        #[cfg(target_arch = "x86_64")]
        if let Some(v3) = pulp::x86::V3::try_new() {
            assert_eq!(best, frame_by!(|step| Simd::vectorize(v3, step)), "AVX2");
        }
        assert!(best.iter().any(|bits| *bits != [0; 3]));
    }
}
