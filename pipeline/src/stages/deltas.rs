//! A target shape as deltas from the base, in the base's unposed space. Knows one target at a time.

use crate::ir::TargetShape;
use crate::stages::StageError;
use glam::{Affine3A, DAffine3, DMat3, DVec3, Vec3};
use kitsuke::arrays::SkinWeights;
use kitsuke::skeleton::{Bone, Pose, Skeleton};

/// Determinant of the blended rotations below which a vertex counts as crushed: two joints blended half and half reach
/// it when they differ by 164 degrees. The inverse would make waves of a millimetre out of a tenth.
const LEAST_DETERMINANT: f64 = 0.02;

/// The target's pose; what its table does not give stays in the T-pose.
#[must_use]
pub fn pose_of(bones: &[Bone], target: &TargetShape) -> Pose {
    bones.iter().zip(&target.rotations).fold(Pose::REST, |pose, (&bone, &rotation)| pose.with(bone, rotation))
}

/// For every vertex of the base what must be added to it so that skinning in the target's pose gives the target, metres.
///
/// # Errors
/// When the skin weights crush a vertex in that pose, so that no delta could bring it to its place.
pub fn deltas(
    base_m: &[Vec3],
    skin: &[SkinWeights],
    skeleton: &Skeleton,
    bones: &[Bone],
    target: &TargetShape,
) -> Result<Vec<Vec3>, StageError> {
    let mut posed_from_rest = vec![Affine3A::IDENTITY; skeleton.frame_count()];
    skeleton.posed_from_rest(&pose_of(bones, target), &mut posed_from_rest);
    let posed_from_rest: Vec<DAffine3> = posed_from_rest.iter().map(|transform| transform.as_daffine3()).collect();
    (0..base_m.len())
        .map(|v| {
            let blended = blend(&posed_from_rest, &skin[v]);
            if is_crushed(&blended) {
                return Err(StageError::new(
                    "deltas",
                    format!(
                        "target {} ({}): vertex {v} is crushed by its skin weights in this pose; joints that move it \
                         turn more than 160 degrees against each other",
                        target.name, target.file
                    ),
                ));
            }
            let unposed_m = blended.inverse().transform_point3(target.positions_m[v].as_dvec3());
            Ok((unposed_m - base_m[v].as_dvec3()).as_vec3())
        })
        .collect()
}

/// Whether a vertex has no usable way back from where this takes it.
pub(super) fn is_crushed(blended: &DAffine3) -> bool {
    blended.matrix3.determinant() < LEAST_DETERMINANT
}

/// The transform of a vertex by linear blend skinning.
pub(super) fn blend(posed_from_rest: &[DAffine3], skin: &SkinWeights) -> DAffine3 {
    let mut matrix3 = DMat3::ZERO;
    let mut translation = DVec3::ZERO;
    for (joint, weight) in skin.joints.into_iter().zip(skin.weights) {
        let weight = f64::from(weight) / 65535.0;
        matrix3 += posed_from_rest[usize::from(joint)].matrix3 * weight;
        translation += posed_from_rest[usize::from(joint)].translation * weight;
    }
    DAffine3 { matrix3, translation }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::stages::weights::shares;
    use glam::Quat;
    use kitsuke::skeleton::Joint;
    use proptest::prelude::*;

    fn arm() -> Skeleton {
        let joint = |bone, parent, x| Joint { bone, parent, rest_m: Vec3::new(x, 1.2, 0.0) };
        Skeleton::new(vec![
            joint(Bone::Hips, None, 0.0),
            joint(Bone::LeftUpperArm, Some(0), 0.2),
            joint(Bone::LeftLowerArm, Some(1), 0.5),
        ])
        .unwrap()
    }

    fn target(rotations: Vec<Quat>, positions_m: Vec<Vec3>) -> TargetShape {
        TargetShape { name: "bent".into(), file: "poses/bent.obj".into(), layer: 0, rotations, positions_m }
    }

    const BONES: [Bone; 2] = [Bone::LeftUpperArm, Bone::LeftLowerArm];

    proptest! {
        /// Skins base + wanted delta forward in f64, and finds that delta again.
        #[test]
        fn unposing_undoes_posing(
            weights in prop::collection::vec(0.01f64..1.0, 3),
            turns in prop::collection::vec(-1.2f32..1.2, 6),
            base in prop::array::uniform3(-1.0f32..1.0),
            delta in prop::array::uniform3(-0.3f32..0.3),
        ) {
            let weights = shares(&weights);
            let skin = SkinWeights { joints: [0, 1, 2, 0], weights: [weights[0], weights[1], weights[2], 0] };
            let rotations: Vec<Quat> =
                turns.chunks(3).map(|t| Quat::from_scaled_axis(Vec3::from_slice(t))).collect();
            let (base, delta) = (Vec3::from(base), Vec3::from(delta));
            let pose = pose_of(&BONES, &target(rotations.clone(), vec![]));
            let mut transforms = [Affine3A::IDENTITY; 3];
            arm().posed_from_rest(&pose, &mut transforms);
            let posed: DVec3 = (0..3)
                .map(|j| {
                    f64::from(skin.weights[j]) / 65535.0
                        * transforms[j].as_daffine3().transform_point3((base + delta).as_dvec3())
                })
                .sum();
            let found = deltas(&[base], &[skin], &arm(), &BONES, &target(rotations, vec![posed.as_vec3()]));
            match found {
                Ok(found) => prop_assert!(found[0].distance(delta) < 2e-5, "{} is not {delta}", found[0]),
                Err(error) => prop_assert!(error.to_string().contains("vertex 0")),
            }
        }
    }

    #[test]
    fn a_crushed_vertex_is_refused_by_name() {
        let skin = SkinWeights { joints: [1, 2, 0, 0], weights: [32768, 32767, 0, 0] };
        let folded = target(vec![Quat::IDENTITY, Quat::from_rotation_y(3.1)], vec![Vec3::ZERO; 2]);
        let whole = SkinWeights { joints: [1, 0, 0, 0], weights: [65535, 0, 0, 0] };
        let error = deltas(&[Vec3::ZERO; 2], &[whole, skin], &arm(), &BONES, &folded).unwrap_err().to_string();
        assert!(error.contains("target bent (poses/bent.obj): vertex 1 is crushed"), "{error}");
    }
}
