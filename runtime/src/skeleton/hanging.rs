//! Cloth that hangs from a joint instead of turning with it. Knows no garment.

use super::Skeleton;
use glam::{Affine3A, Mat3A, Vec3A};

/// A frame that goes where a joint goes and stays upright on the trunk: the bag of a sleeve hangs from the elbow however the forearm is
/// turned, and swings about the trunk's vertical as the upper arm does.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Hanging {
    /// The joint that carries it.
    pub joint: u8,
    /// The joint whose turn about the trunk's vertical it follows.
    pub heading: u8,
    /// The joint that says what upright is.
    pub trunk: u8,
}

impl Hanging {
    /// The transform from the T-pose to the pose, given those of the joints.
    ///
    /// Where `heading` lies on its back against the trunk, half a turn about a horizontal axis, its turn about the vertical is not
    /// known; no arm without twist does that, and there the frame does not turn.
    pub(super) fn posed_from_rest(self, skeleton: &Skeleton, joints: &[Affine3A]) -> Affine3A {
        let [joint, heading, trunk] = [self.joint, self.heading, self.trunk].map(usize::from);
        let rest_m = Vec3A::from(skeleton.joints()[joint].rest_m);
        let matrix3 =
            joints[trunk].matrix3 * about_vertical(joints[trunk].matrix3.transpose() * joints[heading].matrix3);
        Affine3A { matrix3, translation: joints[joint].transform_point3a(rest_m) - matrix3 * rest_m }
    }
}

/// The part of a rotation that turns about Y (its twist, in swing-twist decomposition).
fn about_vertical(rotation: Mat3A) -> Mat3A {
    let [x, y, z] = [rotation.x_axis, rotation.y_axis, rotation.z_axis];
    // Four w² and four w y of the rotation's quaternion; the twist is (0, y, 0, w), normalised.
    let (w, y) = (1.0 + x.x + y.y + z.z, z.x - x.z);
    let length = (w * w + y * y).sqrt();
    if length < 1e-6 {
        return Mat3A::IDENTITY;
    }
    let (w, y) = (w / length, y / length);
    let (cosine, sine) = (w * w - y * y, 2.0 * w * y);
    Mat3A::from_cols(Vec3A::new(cosine, 0.0, -sine), Vec3A::Y, Vec3A::new(sine, 0.0, cosine))
}

#[cfg(test)]
mod tests {
    use super::super::{Bone, Joint, Pose};
    use super::*;
    use glam::{Quat, Vec3};
    use proptest::prelude::*;

    fn arm() -> Skeleton {
        let joint = |bone, parent, x| Joint { bone, parent, rest_m: Vec3::new(x, 1.2, 0.0) };
        let joints = vec![
            joint(Bone::Hips, None, 0.0),
            joint(Bone::LeftUpperArm, Some(0), 0.2),
            joint(Bone::LeftLowerArm, Some(1), 0.5),
        ];
        Skeleton::new(joints).unwrap().with_hanging(vec![Hanging { joint: 2, heading: 1, trunk: 0 }]).unwrap()
    }

    fn frames(pose: &Pose) -> [Affine3A; 4] {
        let mut frames = [Affine3A::IDENTITY; 4];
        arm().posed_from_rest(pose, &mut frames);
        frames
    }

    proptest! {
        #[test]
        fn it_goes_with_the_joint_and_stays_upright(
            turns in prop::array::uniform3(prop::array::uniform3(-1.2f32..1.2)),
        ) {
            let [hips, upper, lower] = turns.map(|turn| Quat::from_scaled_axis(Vec3::from(turn)));
            let pose = Pose::REST.with(Bone::Hips, hips).with(Bone::LeftUpperArm, upper).with(Bone::LeftLowerArm, lower);
            let [trunk, _, elbow, hanging] = frames(&pose);
            let elbow_m = Vec3::new(0.5, 1.2, 0.0);
            prop_assert!(hanging.transform_point3(elbow_m).distance(elbow.transform_point3(elbow_m)) < 1e-5);
            prop_assert!(hanging.transform_vector3(Vec3::Y).distance(trunk.transform_vector3(Vec3::Y)) < 1e-5);
            prop_assert!((hanging.matrix3.determinant() - 1.0).abs() < 1e-5);
        }

        #[test]
        fn it_swings_as_the_upper_arm_does(turn_rad in -2.5f32..2.5, drop_rad in -1.2f32..1.2) {
            let swung = Quat::from_rotation_y(turn_rad);
            // Lowered in its own plane, then swung: the plane is what hanging cloth follows.
            let pose = Pose::REST.with(Bone::LeftUpperArm, swung * Quat::from_rotation_z(drop_rad));
            let [.., hanging] = frames(&pose);
            prop_assert!(hanging.transform_vector3(Vec3::X).distance(swung * Vec3::X) < 1e-4);
        }
    }

    #[test]
    fn an_arm_turned_over_is_no_nan() {
        let half = Quat::from_rotation_x(std::f32::consts::PI);
        let [.., hanging] = frames(&Pose::REST.with(Bone::LeftUpperArm, half));
        assert!(hanging.is_finite());
    }

    #[test]
    fn a_joint_that_the_skeleton_lacks_is_refused() {
        let skeleton = Skeleton::new(arm().joints().to_vec()).unwrap();
        assert!(skeleton.with_hanging(vec![Hanging { joint: 3, heading: 1, trunk: 0 }]).is_err());
    }
}
