//! Where the twist of an arm goes. Knows no cloth; `evaluate` and the pipeline pose cloth by what this makes of a pose.

use super::{Bone, Pose};
use glam::Quat;

/// The bones of an arm from the shoulder out; in the T-pose all lie along X.
const ARMS: [[Bone; 3]; 2] = [
    [Bone::LeftUpperArm, Bone::LeftLowerArm, Bone::LeftHand],
    [Bone::RightUpperArm, Bone::RightLowerArm, Bone::RightHand],
];

impl Pose {
    /// This pose with the twist of upper and lower arms handed down to the hands: every bone points where it did, the
    /// hands are turned as they were, but no arm turns about its own length.
    ///
    /// So loose cloth follows an arm. The arm spins inside the sleeve, and the bag hangs where the bones' directions let
    /// it hang; a skinned sleeve that turned with the arm would be wrung at the elbow and carry its bag against gravity.
    /// Two poses that differ by twist alone are one pose to the cloth, which samples cannot tell apart either.
    ///
    /// With a local rotation q = s·t, t the twist about X and s the swing that brings X where q brings it, s stays and t
    /// goes to the next bone: q' = t·q. This is smooth but where a bone points opposite to its T-pose direction seen
    /// from the bone before (an upper arm straight through the chest, a lower arm folded wholly back). A rotation
    /// without a number or a length stays as it is.
    #[must_use]
    pub fn with_arms_untwisted(&self) -> Pose {
        let mut pose = self.clone();
        for bones in ARMS {
            let [upper, lower, hand] = bones.map(|bone| bone as usize);
            let rotations = &mut pose.rotations;
            let (swing, twist) = swing_and_twist(rotations[upper]);
            rotations[upper] = swing;
            let (swing, twist) = swing_and_twist(twist * rotations[lower]);
            rotations[lower] = swing;
            rotations[hand] = twist * rotations[hand];
        }
        pose
    }
}

/// q = swing · twist, the twist a unit quaternion about X, the swing about an axis across X and exactly so.
fn swing_and_twist(q: Quat) -> (Quat, Quat) {
    let length = (q.x * q.x + q.w * q.w).sqrt();
    if !(length > 1e-9 && length < f32::INFINITY) {
        return (q, Quat::IDENTITY);
    }
    let (sin, cos) = (q.x / length, q.w / length);
    let swing = Quat::from_xyzw(0.0, q.y * cos - q.z * sin, q.y * sin + q.z * cos, length);
    (swing, Quat::from_xyzw(sin, 0.0, 0.0, cos))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn forearms_spin_inside_their_sleeves() {
        for degrees in [-179.0_f32, -150.0, -90.0, 30.0, 150.0] {
            let twist = Quat::from_rotation_x(degrees.to_radians());
            let bent = Quat::from_rotation_y(-1.0);
            let twisted = Pose::REST.with(Bone::LeftLowerArm, bent * twist).with_arms_untwisted();
            assert!(twisted.rotation(Bone::LeftLowerArm).abs_diff_eq(bent, 1e-6), "{degrees}");
            assert!(twisted.rotation(Bone::LeftHand).abs_diff_eq(twist, 1e-6), "{degrees}");
        }
    }

    #[test]
    fn what_is_no_rotation_stays() {
        for q in [Quat::from_xyzw(f32::NAN, 0.0, 0.0, 1.0), Quat::from_xyzw(0.0, 1.0, 0.0, 0.0)] {
            let pose = Pose::REST.with(Bone::RightUpperArm, q).with_arms_untwisted();
            assert_eq!(pose.rotation(Bone::RightUpperArm).to_array().map(f32::to_bits), q.to_array().map(f32::to_bits));
            assert_eq!(pose.rotation(Bone::RightLowerArm), Quat::IDENTITY);
        }
    }
}
