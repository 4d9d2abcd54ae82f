//! What serves as the T-pose: which stance forms one, and how every joint is turned in it. Knows no votes over frames.

use super::kinematics::Stance;
use super::rig::{ARMS, LEGS, Rig, rest_direction};
use crate::skeleton::{Bone, Skeleton};
use glam::{DQuat, DVec3};

/// How far arms may be from sideways in what counts as a T-pose.
const SIDEWAYS_RAD: f64 = 25.0 * std::f64::consts::PI / 180.0;
/// Legs nearer to straight down than this are those of a pose, degrees.
const LEGS_DOWN_DEG: f64 = 75.0;
/// Legs farther from straight down than this are those of no pose, degrees.
const NO_LEGS_DEG: f64 = 105.0;
/// Arms nearer to straight up than this are those of no pose: OFFSETs all along one axis.
const NO_ARMS_RAD: f64 = 30.0 * std::f64::consts::PI / 180.0;

/// What a stance is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Posture {
    /// A T-pose, with the rotation from its axes to +X left, +Y up, +Z front.
    Tee(DQuat),
    /// A pose whose arms are not sideways, with the same rotation.
    Other(DQuat),
    /// Perhaps a pose: so far from straight down is a leg, degrees.
    Unclear(f64),
    /// No pose: legs beside the trunk, arms along it, or no direction at all.
    None,
}

impl Posture {
    pub fn of(rig: &Rig, stance: &Stance) -> Posture {
        let Ok(axes) = rig.axes(stance) else { return Posture::None };
        let seen = |from, to| rig.direction(stance, from, to).map(|along| axes * along);
        let part = |[upper, lower, end]: [Bone; 3]| seen(upper, end).or_else(|| seen(upper, lower));
        let legs_deg = LEGS.into_iter().filter_map(part).map(|leg| leg.angle_between(DVec3::NEG_Y).to_degrees());
        let leg_deg = legs_deg.fold(0.0, f64::max);
        let arm_up = ARMS.into_iter().filter_map(part).any(|arm| arm.angle_between(DVec3::Y) < NO_ARMS_RAD);
        if leg_deg > NO_LEGS_DEG || arm_up {
            return Posture::None;
        }
        if leg_deg > LEGS_DOWN_DEG {
            return Posture::Unclear(leg_deg);
        }
        let sideways = ARMS.into_iter().zip([DVec3::X, DVec3::NEG_X]).all(|([upper, lower, hand], sideways)| {
            let parts = [(upper, lower), (lower, hand)].into_iter();
            parts.filter_map(|(from, to)| seen(from, to)).all(|along| along.angle_between(sideways) <= SIDEWAYS_RAD)
        });
        if sideways { Posture::Tee(axes) } else { Posture::Other(axes) }
    }
}

/// For every bone the rotation that its joint has in a stance that is the T-pose, seen from the wearer's axes; inverted,
/// so that `wearer from world * rotation * inverse` is the bone's world rotation relative to the T-pose. `axes` turns the
/// stance to the wearer's axes.
pub(super) fn inverses(rig: &Rig, stance: &Stance, axes: DQuat, wearer: &Skeleton) -> [DQuat; Bone::COUNT] {
    let mut corrections = [DQuat::IDENTITY; Bone::COUNT];
    for (limb, is_arm) in ARMS.map(|arm| (arm, true)).into_iter().chain(LEGS.map(|leg| (leg, false))) {
        let [upper, lower, end] = limb;
        // A part whose end the file does not give continues the part above.
        let mut correction = DQuat::IDENTITY;
        for (bone, next) in [(upper, lower), (lower, end)] {
            let recorded = rig.direction(stance, bone, next);
            if let Some((from, to)) = recorded.zip(rest_direction(wearer, bone, next)) {
                correction = DQuat::from_rotation_arc(axes * from, to);
            }
            corrections[bone as usize] = correction;
        }
        if is_arm {
            // A hand continues its forearm, fingers their hand; feet stand on the ground whatever the legs do.
            corrections[end as usize] = corrections[lower as usize];
            for bone in Bone::ALL {
                if let Some(parent) = bone.vrm_parent().filter(|&parent| is_in_hand(parent, end)) {
                    corrections[bone as usize] = corrections[parent as usize];
                }
            }
        }
    }
    Bone::ALL.map(|bone| match rig.joint(bone) {
        Some(joint) => stance.rotations[joint].inverse() * axes.inverse() * corrections[bone as usize].inverse(),
        None => DQuat::IDENTITY,
    })
}

fn is_in_hand(mut bone: Bone, hand: Bone) -> bool {
    while bone != hand {
        match bone.vrm_parent() {
            Some(parent) => bone = parent,
            None => return false,
        }
    }
    true
}
