//! Which joint of a file is which bone, and what a stance of them shows. Knows neither frames nor what they decide.

use super::kinematics::{Figure, Stance};
use super::structure;
use super::text::{BvhError, Problem};
use crate::skeleton::names::bones_of;
use crate::skeleton::{Bone, Skeleton};
use glam::{DMat3, DQuat, DVec3};

/// Upper bone, lower bone, end.
pub(super) type Limb = [Bone; 3];
pub(super) const ARMS: [Limb; 2] = [
    [Bone::LeftUpperArm, Bone::LeftLowerArm, Bone::LeftHand],
    [Bone::RightUpperArm, Bone::RightLowerArm, Bone::RightHand],
];
pub(super) const LEGS: [Limb; 2] = [
    [Bone::LeftUpperLeg, Bone::LeftLowerLeg, Bone::LeftFoot],
    [Bone::RightUpperLeg, Bone::RightLowerLeg, Bone::RightFoot],
];

/// An up direction this near to an axis is that axis: shoulders behind the hips do not tilt the whole body.
pub(super) const ON_AXIS_RAD: f64 = 30.0 * std::f64::consts::PI / 180.0;

/// Which joint of the file is which bone, as far as the names tell.
pub(super) struct Rig {
    joint_of: [Option<usize>; Bone::COUNT],
    pub hips: usize,
    /// Whether names told that, not how the joints branch.
    pub names_tell: bool,
    /// Line to name where bones are missing.
    pub line: usize,
}

impl Rig {
    pub fn new(figure: &Figure<'_>) -> Result<Rig, BvhError> {
        let names: Vec<&str> = figure.joints.iter().map(|joint| joint.name.as_str()).collect();
        let by_name = bones_of(&names);
        let is_known = |bone| by_name.contains(&Some(bone));
        let needed = [Bone::Hips, Bone::LeftUpperArm, Bone::RightUpperArm];
        let by_structure =
            if needed.into_iter().all(is_known) { None } else { structure::bones_of(figure.joints, &figure.rest()) };
        let names_tell = by_structure.is_none();
        let mut joint_of = [None; Bone::COUNT];
        for (joint, bone) in by_structure.unwrap_or(by_name).into_iter().enumerate() {
            if let Some(bone) = bone {
                joint_of[bone as usize] = Some(joint);
            }
        }
        let line = figure.joints[0].line;
        let unknown = |missing| BvhError { line, problem: Problem::Unknown { missing } };
        let hips = joint_of[Bone::Hips as usize].ok_or_else(|| unknown("hips"))?;
        let rig = Rig { joint_of, hips, names_tell, line };
        for [upper, _, _] in ARMS {
            rig.joint(upper).ok_or_else(|| unknown(upper.name()))?;
        }
        Ok(rig)
    }

    pub fn joint(&self, bone: Bone) -> Option<usize> {
        self.joint_of[bone as usize]
    }

    /// From one bone to another in a stance, if both are there and apart.
    pub fn direction(&self, stance: &Stance, from: Bone, to: Bone) -> Option<DVec3> {
        let (from, to) = (self.joint(from)?, self.joint(to)?);
        (stance.positions[to] - stance.positions[from]).try_normalize()
    }

    /// From the hips to the middle between the arms.
    pub fn trunk(&self, stance: &Stance) -> Option<DVec3> {
        let at = |bone| self.joint(bone).map_or(DVec3::ZERO, |joint| stance.positions[joint]);
        let [left_arm, right_arm] = [at(Bone::LeftUpperArm), at(Bone::RightUpperArm)];
        ((left_arm + right_arm) * 0.5 - at(Bone::Hips)).try_normalize()
    }

    /// From the right arm to the left one, or so with the legs.
    pub fn left(&self, stance: &Stance) -> Option<DVec3> {
        self.direction(stance, Bone::RightUpperArm, Bone::LeftUpperArm)
            .or_else(|| self.direction(stance, Bone::RightUpperLeg, Bone::LeftUpperLeg))
    }

    /// The rotation from the file's axes to +X left, +Y up, +Z front, as a stance shows them.
    pub fn axes(&self, stance: &Stance) -> Result<DQuat, BvhError> {
        let frame = self.trunk(stance).zip(self.left(stance)).and_then(|(up, left)| {
            let along = DVec3::AXES.into_iter().flat_map(|axis| [axis, -axis]);
            let up = along.into_iter().find(|axis| axis.angle_between(up) <= ON_AXIS_RAD).unwrap_or(up);
            let left = left.reject_from_normalized(up).try_normalize()?;
            Some(DQuat::from_mat3(&DMat3::from_cols(left, up, left.cross(up))).inverse())
        });
        frame.ok_or(BvhError { line: self.line, problem: Problem::NoDirection })
    }
}

/// From one bone to another in the wearer's T-pose, if both are there and apart.
pub(super) fn rest_direction(wearer: &Skeleton, from: Bone, to: Bone) -> Option<DVec3> {
    let rest_m = |bone| wearer.index_of(bone).map(|joint| wearer.joints()[joint].rest_m.as_dvec3());
    (rest_m(to)? - rest_m(from)?).try_normalize()
}

/// Both legs from hip over knee to ankle.
pub(super) fn legs_length(position: impl Fn(Bone) -> Option<DVec3>) -> Option<f64> {
    let mut length = 0.0;
    for [hip, knee, ankle] in LEGS {
        let (hip, knee, ankle) = (position(hip)?, position(knee)?, position(ankle)?);
        length += hip.distance(knee) + knee.distance(ankle);
    }
    Some(length)
}
