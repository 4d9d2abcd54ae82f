//! The T-pose of a rig whose OFFSETs form no pose: how its joints' own axes lie in the bones, from where bones point in the
//! world over the frames. Knows no stance that would be a T-pose.
//!
//! A bone's length gives two of three angles. The third, its twist, comes from what turns with it: the other side's hip or
//! shoulder on the trunk, the plane in which an elbow or knee bends. Where nothing tells, a bone is on average as the bone
//! above it, and turned to its direction the shortest way.

use super::kinematics::Stance;
use super::rig::{ARMS, LEGS, Rig, rest_direction};
use crate::skeleton::{Bone, Skeleton};
use glam::{DMat3, DQuat, DVec3};

/// An elbow or knee that bends less than this tells no plane: sine of 20°.
const BENDS_SIN: f64 = 0.35;
/// A limb bends in one plane if the normals agree so far in its own axes: length of their sum over the sum of lengths.
const STEADY: f64 = 0.7;

/// What directions in the world give.
pub(super) struct Directions {
    /// For every bone what `wearer from world * rotation` of its joint lacks to be its rotation relative to the T-pose.
    pub inverses: [DQuat; Bone::COUNT],
    /// Upper arms and thighs of limbs that hardly bend, so that nothing tells their twist.
    pub straight: Vec<Bone>,
}

/// Finds them over some frames, at least one; `None` where neither legs nor arms show the hips' left.
pub(super) fn find(rig: &Rig, stances: &[Stance], up: DVec3, wearer: &Skeleton) -> Option<Directions> {
    let seen = Seen { rig, stances, wearer };
    let mut inverses = [DQuat::IDENTITY; Bone::COUNT];
    let mut straight = Vec::new();
    let shoulders = [Bone::UpperChest, Bone::Chest, Bone::Spine].into_iter().find(|&bone| rig.joint(bone).is_some());
    for joint in wearer.joints() {
        let bone = joint.bone;
        let Some(own) = rig.joint(bone) else { continue };
        let along = next(bone).iter().find_map(|&next| seen.along(own, bone, next));
        inverses[bone as usize] = if bone == Bone::Hips {
            // The spine's root may lie in front of the hips or at the same height: up tells more.
            let upright = seen.mean(|stance| Some(stance.rotations[own].inverse() * up));
            frame(seen.left(own)?, (upright?, DVec3::Y))
        } else {
            // The nearest bone above that the file has, whose own is known by now.
            let mut above = bone.vrm_parent();
            while let Some(parent) = above.filter(|&parent| rig.joint(parent).is_none()) {
                above = parent.vrm_parent();
            }
            let above = above.unwrap_or(Bone::Hips);
            let as_above = seen.mean_turn(rig.joint(above)?, own).inverse() * inverses[above as usize];
            let across = match hinge_of(bone) {
                Some((limb, axis)) => {
                    let across = seen.hinge(own, bone, limb, axis);
                    if across.is_none() && bone == limb[0] {
                        straight.push(bone);
                    }
                    across
                }
                None if Some(bone) == shoulders => seen.left(own),
                None => None,
            };
            match (along, across) {
                (Some(along), Some(across)) => frame(along, across),
                (Some((recorded, rest)), None) => {
                    DQuat::from_rotation_arc((as_above * rest).normalize(), recorded) * as_above
                }
                (None, _) => as_above,
            }
            .normalize()
        };
    }
    Some(Directions { inverses, straight })
}

/// Frames as seen from joints.
struct Seen<'a> {
    rig: &'a Rig,
    stances: &'a [Stance],
    wearer: &'a Skeleton,
}

impl Seen<'_> {
    /// The mean direction over the frames that show one.
    fn mean(&self, of: impl Fn(&Stance) -> Option<DVec3>) -> Option<DVec3> {
        let sum: DVec3 = self.stances.iter().filter_map(of).sum();
        sum.try_normalize()
    }

    /// From a bone to another in the axes of the first one's joint, and in the wearer's T-pose.
    fn along(&self, own: usize, bone: Bone, next: Bone) -> Option<(DVec3, DVec3)> {
        let rest = rest_direction(self.wearer, bone, next)?;
        let local = |stance: &Stance| Some(stance.rotations[own].inverse() * self.rig.direction(stance, bone, next)?);
        Some((self.mean(local)?, rest))
    }

    /// To the left in a joint's axes, and in the wearer's T-pose: by the hips for the hips, else by the shoulders.
    fn left(&self, own: usize) -> Option<(DVec3, DVec3)> {
        let legs = [Bone::RightUpperLeg, Bone::LeftUpperLeg];
        let shoulders = [Bone::RightShoulder, Bone::LeftShoulder];
        let arms = [Bone::RightUpperArm, Bone::LeftUpperArm];
        let pairs = if own == self.rig.hips { [legs, arms, shoulders] } else { [shoulders, arms, legs] };
        pairs.into_iter().find_map(|[right, left]| {
            let rest = rest_direction(self.wearer, right, left).unwrap_or(DVec3::X);
            let local =
                |stance: &Stance| Some(stance.rotations[own].inverse() * self.rig.direction(stance, right, left)?);
            Some((self.mean(local)?, rest))
        })
    }

    /// The normal of the plane in which a limb bends, in the axes of a joint of the limb and in the wearer's T-pose; the more
    /// bent, the more it counts.
    fn hinge(&self, own: usize, bone: Bone, [upper, lower, end]: [Bone; 3], axis: DVec3) -> Option<(DVec3, DVec3)> {
        let (mut sum, mut lengths, mut bends_rad) = (DVec3::ZERO, 0.0, 0.0);
        for stance in self.stances {
            let parts = self.rig.direction(stance, upper, lower).zip(self.rig.direction(stance, lower, end));
            let Some((a, b)) = parts.filter(|(a, b)| a.cross(*b).length() >= BENDS_SIN) else { continue };
            let across = a.cross(b);
            sum += stance.rotations[own].inverse() * across;
            lengths += across.length();
            bends_rad += across.length() * a.angle_between(b);
        }
        let recorded = sum.try_normalize().filter(|_| sum.length() >= STEADY * lengths)?;
        // The wearer's limb bent as far: its parts need not be in line in the T-pose, nor at right angles to the axis.
        let [a, b] = [(upper, lower), (lower, end)].map(|(from, to)| rest_direction(self.wearer, from, to));
        let bent = DQuat::from_axis_angle(axis, bends_rad / lengths);
        let across = a?.cross(bent * b?).try_normalize()?;
        Some((recorded, if bone == lower { bent.inverse() * across } else { across }))
    }

    /// The mean rotation of a joint seen from another.
    fn mean_turn(&self, above: usize, own: usize) -> DQuat {
        let mut sum = DQuat::from_xyzw(0.0, 0.0, 0.0, 0.0);
        for stance in self.stances {
            let turn = stance.rotations[above].inverse() * stance.rotations[own];
            sum = sum + if sum.dot(turn) < 0.0 { -turn } else { turn };
        }
        if sum.length() > 1e-9 { sum.normalize() } else { DQuat::IDENTITY }
    }
}

/// The rotation that takes the wearer's directions to the joint's: the first pair exactly, the second as near as that lets
/// it. Each pair is the joint's, then the wearer's.
fn frame(first: (DVec3, DVec3), second: (DVec3, DVec3)) -> DQuat {
    let basis = |along: DVec3, across: DVec3| {
        let across =
            across.reject_from_normalized(along).try_normalize().unwrap_or_else(|| along.any_orthonormal_vector());
        DMat3::from_cols(along, across, along.cross(across))
    };
    let (joint, wearer) = (basis(first.0, second.0), basis(first.1, second.1));
    DQuat::from_mat3(&(joint * wearer.transpose()))
}

/// The limb of an upper or lower part, and the axis about which its lower part bends in the T-pose: elbows forward, knees
/// backward.
fn hinge_of(bone: Bone) -> Option<([Bone; 3], DVec3)> {
    let limbs = ARMS.into_iter().zip([DVec3::NEG_Y, DVec3::Y]).chain(LEGS.into_iter().zip([DVec3::X, DVec3::X]));
    limbs.into_iter().find(|([upper, lower, _], _)| bone == *upper || bone == *lower)
}

/// The bones towards which a bone may point, the nearest first.
fn next(bone: Bone) -> &'static [Bone] {
    use Bone::*;
    match bone {
        Spine => &[Chest, UpperChest, Neck, Head],
        Chest => &[UpperChest, Neck, Head],
        UpperChest => &[Neck, Head],
        Neck => &[Head],
        LeftShoulder => &[LeftUpperArm],
        RightShoulder => &[RightUpperArm],
        LeftUpperArm => &[LeftLowerArm],
        RightUpperArm => &[RightLowerArm],
        LeftLowerArm => &[LeftHand],
        RightLowerArm => &[RightHand],
        LeftHand => &[LeftMiddleProximal],
        RightHand => &[RightMiddleProximal],
        LeftUpperLeg => &[LeftLowerLeg],
        RightUpperLeg => &[RightLowerLeg],
        LeftLowerLeg => &[LeftFoot],
        RightLowerLeg => &[RightFoot],
        LeftFoot => &[LeftToes],
        RightFoot => &[RightToes],
        _ => &[],
    }
}
