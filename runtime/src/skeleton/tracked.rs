//! A pose as inputs give it: with a confidence for every bone. Knows no format.

use super::{Bone, Pose, Skeleton};
use glam::{DQuat, DVec3};

/// A pose and how far each bone of it can be trusted.
#[derive(Clone, Debug, PartialEq)]
pub struct Tracked {
    /// Rotations relative to the T-pose; always valid ([`Pose::is_valid`]).
    pub pose: Pose,
    /// From 0 (never seen) to 1 (certain), by `Bone as usize`.
    pub confidence: [f32; Bone::COUNT],
}

impl Tracked {
    /// The T-pose, of which nothing has been seen.
    pub const UNSEEN: Tracked = Tracked { pose: Pose::REST, confidence: [0.0; Bone::COUNT] };

    /// A pose that is certain in every bone.
    #[must_use]
    pub fn certain(pose: Pose) -> Tracked {
        Tracked { pose, confidence: [1.0; Bone::COUNT] }
    }
}

/// The rest pose of a model or a sender, in the wearer's axes: local rotations relative to it are normalised as
/// world · local⁻¹ · rotation · world⁻¹ (VRM, `how_to_transform_human_pose.md`).
#[derive(Clone, Debug, PartialEq)]
pub struct RestPose {
    /// Local rest rotations by `Bone as usize`.
    pub local: [DQuat; Bone::COUNT],
    /// World rest rotations.
    pub world: [DQuat; Bone::COUNT],
    /// Where the hips rest, metres; `None` where that is not known.
    pub hips_m: Option<DVec3>,
}

impl RestPose {
    /// No rest rotation anywhere.
    pub const NORMALISED: RestPose =
        RestPose { local: [DQuat::IDENTITY; Bone::COUNT], world: [DQuat::IDENTITY; Bone::COUNT], hips_m: None };
}

/// World rotations relative to the T-pose, by `Bone as usize`, where they are known.
pub type Turned = [Option<DQuat>; Bone::COUNT];

impl Pose {
    /// The pose of this wearer whose bones are turned so (unit quaternions). A bone that is not known goes with its parent; a
    /// bone that the wearer lacks is left out, and the bones below it turn all the same (VRM, `how_to_transform_human_pose.md`).
    #[must_use]
    pub fn from_turned(wearer: &Skeleton, turned: &Turned, hips_translation_m: DVec3) -> Pose {
        let mut pose = Pose { hips_translation_m: hips_translation_m.as_vec3(), ..Pose::REST };
        let mut world = [DQuat::IDENTITY; Bone::COUNT];
        for (index, joint) in wearer.joints().iter().enumerate() {
            let above = joint.parent.map_or(DQuat::IDENTITY, |parent| world[usize::from(parent)]);
            let own = turned[joint.bone as usize].unwrap_or(above);
            world[index] = own;
            pose.rotations[joint.bone as usize] = nearest_to_rest(above.inverse() * own).as_quat();
        }
        pose
    }
}

/// Of the two unit quaternions of a rotation the one nearer to the T-pose's.
pub(super) fn nearest_to_rest(q: DQuat) -> DQuat {
    (if q.w < 0.0 { -q } else { q }).normalize()
}
