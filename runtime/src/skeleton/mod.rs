//! Bones, the wearer's skeleton and a pose of it. Knows no garment; each foreign recording format has a file of its
//! own beside this one, behind a feature.

mod angle;
mod bone;
#[cfg(feature = "bvh")]
pub mod bvh;
#[cfg(feature = "recordings")]
pub mod deepmimic;
pub mod filter;
mod hanging;
#[cfg(feature = "recordings")]
pub mod jsonl;
#[cfg(feature = "recordings")]
pub mod kinect;
#[cfg(feature = "recordings")]
pub mod mediapipe;
#[cfg(feature = "bvh")]
pub mod names;
#[cfg(feature = "vmc")]
pub mod osc;
#[cfg(feature = "positions")]
pub mod positions;
#[cfg(feature = "recordings")]
pub mod recording;
mod tracked;
mod twist;
#[cfg(feature = "vmc")]
pub mod vmc;
#[cfg(feature = "recordings")]
pub mod vrma;

pub use angle::angle_between_rad;
pub use bone::Bone;
use glam::{Affine3A, Quat, Vec3};
pub use hanging::Hanging;
pub use tracked::{RestPose, Tracked, Turned};

/// One joint of a [`Skeleton`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Joint {
    /// Which bone turns about this joint.
    pub bone: Bone,
    /// Index of the parent joint in the same skeleton, always smaller than the joint's own; `None` for the root alone.
    pub parent: Option<u8>,
    /// Position in the T-pose, metres, in the garment's space (Y up, front +Z, the wearer's left +X).
    pub rest_m: Vec3,
}

/// A skeleton in its T-pose: joints, each after its parent, whose axes are all parallel to the world's (the
/// VRM-normalised rest pose), so that a rest pose is positions alone. To it may belong frames in which cloth hangs.
#[derive(Clone, Debug, PartialEq)]
pub struct Skeleton {
    joints: Vec<Joint>,
    hanging: Vec<Hanging>,
}

/// Why a list of joints is no skeleton.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum SkeletonError {
    /// There is no joint, or more than there are bones.
    #[error("a skeleton has 1 to 55 joints, not {0}")]
    Count(usize),
    /// The first joint is not the one root, or a later one has no parent.
    #[error("joint {0} must have a parent, and the first joint must have none")]
    Root(usize),
    /// A joint comes before its parent.
    #[error("joint {0} comes before its parent")]
    Order(usize),
    /// Two joints are the same bone.
    #[error("bone {} occurs twice", .0.name())]
    Twice(Bone),
    /// A rest position is not a finite number within 100 m.
    #[error("joint {0} rests at no usable position")]
    Position(usize),
    /// A frame in which cloth hangs names a joint that there is not, or there are too many of them.
    #[error("hanging frame {0} is one too many or names a joint that the skeleton lacks")]
    Hanging(usize),
}

impl Skeleton {
    /// Checks that the joints form a tree in order, each bone once, at finite places.
    ///
    /// # Errors
    /// Names the first joint that breaks a rule.
    pub fn new(joints: Vec<Joint>) -> Result<Skeleton, SkeletonError> {
        if joints.is_empty() || joints.len() > Bone::COUNT {
            return Err(SkeletonError::Count(joints.len()));
        }
        let mut seen = [false; Bone::COUNT];
        for (i, joint) in joints.iter().enumerate() {
            if joint.parent.is_none() != (i == 0) {
                return Err(SkeletonError::Root(i));
            }
            if joint.parent.is_some_and(|parent| usize::from(parent) >= i) {
                return Err(SkeletonError::Order(i));
            }
            if std::mem::replace(&mut seen[joint.bone as usize], true) {
                return Err(SkeletonError::Twice(joint.bone));
            }
            if !(joint.rest_m.is_finite() && joint.rest_m.abs().max_element() <= 100.0) {
                return Err(SkeletonError::Position(i));
            }
        }
        Ok(Skeleton { joints, hanging: Vec::new() })
    }

    /// The same joints with these frames in which cloth hangs.
    ///
    /// # Errors
    /// When one names a joint that the skeleton lacks, or there are more than joints.
    pub fn with_hanging(self, hanging: Vec<Hanging>) -> Result<Skeleton, SkeletonError> {
        let count = self.joints.len();
        let is_known =
            |frame: &Hanging| [frame.joint, frame.heading, frame.trunk].iter().all(|&joint| usize::from(joint) < count);
        match hanging.iter().zip(0..).position(|(frame, number)| number >= count || !is_known(frame)) {
            Some(number) => Err(SkeletonError::Hanging(number)),
            None => Ok(Skeleton { hanging, ..self }),
        }
    }

    /// The joints, parents first.
    #[must_use]
    pub fn joints(&self) -> &[Joint] {
        &self.joints
    }

    /// The frames in which cloth hangs.
    #[must_use]
    pub fn hanging(&self) -> &[Hanging] {
        &self.hanging
    }

    /// How many frames cloth can be skinned to: the joints, then what hangs from them.
    #[must_use]
    pub fn frame_count(&self) -> usize {
        self.joints.len() + self.hanging.len()
    }

    /// The bone that carries a frame.
    ///
    /// # Panics
    /// When there is no such frame.
    #[must_use]
    pub fn bone(&self, frame: u8) -> Bone {
        let hanging = usize::from(frame).checked_sub(self.joints.len()).map(|number| self.hanging[number].joint);
        self.joints[usize::from(hanging.unwrap_or(frame))].bone
    }

    /// The index of a bone's joint, if this skeleton has it.
    #[must_use]
    pub fn index_of(&self, bone: Bone) -> Option<usize> {
        self.joints.iter().position(|joint| joint.bone == bone)
    }

    /// Where a bone's joint rests, metres, if this skeleton has it.
    #[must_use]
    pub fn rest_m(&self, bone: Bone) -> Option<Vec3> {
        self.index_of(bone).map(|joint| self.joints[joint].rest_m)
    }

    /// Writes, for every frame (joints, then what hangs), the transform from the T-pose to the pose (`posed_from_rest`), which is what
    /// skinning needs. Bones that the skeleton lacks are left out of the chain.
    ///
    /// # Panics
    /// When `posed_from_rest` is not [`Skeleton::frame_count`] long.
    pub fn posed_from_rest(&self, pose: &Pose, posed_from_rest: &mut [Affine3A]) {
        assert_eq!(posed_from_rest.len(), self.frame_count(), "one transform per frame");
        for (i, joint) in self.joints.iter().enumerate() {
            let rotation = pose.rotations[joint.bone as usize];
            let about_joint = Affine3A::from_translation(joint.rest_m)
                * Affine3A::from_quat(rotation)
                * Affine3A::from_translation(-joint.rest_m);
            posed_from_rest[i] = match joint.parent {
                Some(parent) => posed_from_rest[usize::from(parent)] * about_joint,
                None => Affine3A::from_translation(pose.hips_translation_m) * about_joint,
            };
        }
        let (joints, hung) = posed_from_rest.split_at_mut(self.joints.len());
        for (transform, hanging) in hung.iter_mut().zip(&self.hanging) {
            *transform = hanging.posed_from_rest(self, joints);
        }
    }
}

/// A pose: for every VRM bone the local rotation relative to the T-pose, and how far the hips have moved.
#[derive(Clone, Debug, PartialEq)]
pub struct Pose {
    /// Unit quaternions by `Bone as usize`; identity is the T-pose. World rotation of a joint = product from the root.
    pub rotations: [Quat; Bone::COUNT],
    /// Translation of the hips from their rest position, metres.
    pub hips_translation_m: Vec3,
}

impl Pose {
    /// The T-pose.
    pub const REST: Pose = Pose { rotations: [Quat::IDENTITY; Bone::COUNT], hips_translation_m: Vec3::ZERO };

    /// The local rotation of a bone.
    #[must_use]
    pub fn rotation(&self, bone: Bone) -> Quat {
        self.rotations[bone as usize]
    }

    /// This pose with one bone turned.
    #[must_use]
    pub fn with(mut self, bone: Bone, rotation: Quat) -> Pose {
        self.rotations[bone as usize] = rotation;
        self
    }

    /// This pose seen in a mirror: left does what right did, and the hips move to the other side.
    #[must_use]
    pub fn mirrored(&self) -> Pose {
        let image = |bone: Bone| {
            let q = self.rotation(bone.mirrored());
            Quat::from_xyzw(q.x, -q.y, -q.z, q.w)
        };
        let Vec3 { x, y, z } = self.hips_translation_m;
        Pose { rotations: Bone::ALL.map(image), hips_translation_m: Vec3::new(-x, y, z) }
    }

    /// This pose with every number usable: rotations normalised, those that are not finite or have no length replaced
    /// by the T-pose's, a hips translation that is not finite by none, a farther one than 1000 km brought back to it.
    #[must_use]
    pub fn sanitised(&self) -> Pose {
        const FARTHEST_M: Vec3 = Vec3::splat(1e6);
        let far = self.hips_translation_m.clamp(-FARTHEST_M, FARTHEST_M);
        Pose {
            rotations: self.rotations.map(|rotation| {
                let length = rotation.length();
                if length > 1e-6 && length < f32::INFINITY { rotation / length } else { Quat::IDENTITY }
            }),
            hips_translation_m: if self.hips_translation_m.is_finite() { far } else { Vec3::ZERO },
        }
    }

    /// Whether every number is finite and every rotation a unit quaternion within 1e-3.
    #[must_use]
    pub fn is_valid(&self) -> bool {
        self.hips_translation_m.is_finite()
            && self.rotations.iter().all(|q| q.is_finite() && (q.length_squared() - 1.0).abs() <= 2e-3)
    }
}

impl Default for Pose {
    fn default() -> Pose {
        Pose::REST
    }
}
