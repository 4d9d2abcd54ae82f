//! Step 2 of a frame: linear blend skinning. Knows the blended cloth and the joints' transforms.

use super::{BLOCK, FLOATS, Scratch};
use crate::garment::Garment;
use crate::plan::{BlockedSkin, SKIN_LANES};
use crate::skeleton::Pose;
use glam::{Affine3A, Vec3};
use pulp::{Arch, Simd, WithSimd};

/// Step 2: linear blend skinning of the blended cloth by a sanitised pose whose arms are untwisted
/// ([`Pose::with_arms_untwisted`]).
///
/// # Panics
/// When `positions_m` is shorter than the unique vertices, or `scratch` was made for a garment of another shape.
pub fn skin(garment: &Garment, pose: &Pose, scratch: &mut Scratch, positions_m: &mut [Vec3]) {
    let data = garment.data();
    let Scratch { posed_from_rest, blended_m, .. } = scratch;
    data.skeleton.posed_from_rest(&pose.with_arms_untwisted(), posed_from_rest);
    assert_eq!(blended_m.len(), 3 * garment.unique_count(), "scratch of another garment");
    let positions_m = &mut positions_m[..garment.unique_count()];
    Arch::new().dispatch(Skin { skin: &garment.plan().skin, posed_from_rest, blended_m, positions_m });
}

pub(super) struct Skin<'a> {
    pub(super) skin: &'a BlockedSkin,
    pub(super) posed_from_rest: &'a [Affine3A],
    pub(super) blended_m: &'a [f32],
    pub(super) positions_m: &'a mut [Vec3],
}

impl WithSimd for Skin<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        let Skin { skin, posed_from_rest, blended_m, positions_m } = self;
        let mut joints = skin.joints.iter().zip(&skin.weights);
        let mut counts = skin.counts.iter();
        for (blended_m, positions_m) in blended_m.chunks(FLOATS).zip(positions_m.chunks_mut(BLOCK)) {
            let mut planes = [[0.0; BLOCK]; 3];
            let [x, y, z] = &mut planes;
            for (((x, y), z), blended_m) in x.iter_mut().zip(&mut *y).zip(&mut *z).zip(blended_m.as_chunks::<3>().0) {
                [*x, *y, *z] = *blended_m;
            }
            let [x_blocks, y_blocks, z_blocks] = [x, y, z].map(|plane| plane.as_chunks_mut::<SKIN_LANES>().0);
            let blocks = x_blocks.iter_mut().zip(y_blocks).zip(z_blocks).take(positions_m.len().div_ceil(SKIN_LANES));
            for (((x, y), z), &count) in blocks.zip(&mut counts) {
                let mut posed_m = [[0.0; SKIN_LANES]; 3];
                for (&joint, weights) in joints.by_ref().take(usize::from(count)) {
                    let Affine3A { matrix3, translation } = &posed_from_rest[usize::from(joint)];
                    let (a, b, c) = (matrix3.x_axis, matrix3.y_axis, matrix3.z_axis);
                    for (axis, posed_m) in posed_m.iter_mut().enumerate() {
                        let [a, b, c, d] = [a[axis], b[axis], c[axis], translation[axis]];
                        for i in 0..SKIN_LANES {
                            let weight = f32::from(weights[i]) * (1.0 / 65535.0);
                            posed_m[i] += weight * (a * x[i] + b * y[i] + (c * z[i] + d));
                        }
                    }
                }
                [*x, *y, *z] = posed_m;
            }
            let [x, y, z] = &planes;
            for (((position_m, x), y), z) in positions_m.iter_mut().zip(x).zip(y).zip(z) {
                *position_m = Vec3::new(*x, *y, *z);
            }
        }
    }
}
