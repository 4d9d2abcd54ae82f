//! Recorded motion from BVH text to poses of a wearer's skeleton. Pure: bytes in, poses out.
//!
//! - Joints are known by name (VRM and Unity, Mixamo and LAFAN1, CMU, joint-named, Kinect, MakeHuman), and where names say
//!   nothing by how they branch. The rotation of a joint that is no bone is not lost: the bones below it turn by it.
//! - Rotations are relative to the T-pose. The T-pose is taken from the OFFSETs where these hold the arms sideways
//!   within 25°, else from the first frame if that does, else from the OFFSETs ([`Reference`] says which). What then
//!   still lies between a limb's direction and that of the wearer's T-pose is closed by the shortest turn, limb by
//!   limb, so that arms and legs point where they pointed in the recording.
//! - Up becomes +Y and left +X, from the positions of hips and upper arms: files with Z up need no hint.
//! - Lengths are scaled by the ratio of the legs. The hips' way begins at the first frame.

mod names;
mod structure;
mod text;

pub use text::{BvhError, Problem, limits};

use super::{Bone, Pose, Skeleton};
use glam::{DMat3, DQuat, DVec3};
use text::{Recording, Stance};

/// A recording as poses.
#[derive(Clone, Debug, PartialEq)]
pub struct Motion {
    /// Seconds from one pose to the next.
    pub frame_time_s: f64,
    /// One pose per frame: rotations relative to the T-pose, hips translation relative to the first frame.
    pub poses: Vec<Pose>,
    /// Where the T-pose came from.
    pub reference: Reference,
    /// The wearer's metres per unit of the file, by the length of the legs; `None` where the file or the wearer has
    /// no legs, and then the hips stay in their place.
    pub metres_per_unit: Option<f64>,
    /// Whether joints were known by their names; if not, by how they branch, which is a guess.
    pub names_tell: bool,
    /// Joints that are no bone of the wearer.
    pub unmapped: Vec<String>,
}

/// What served as the T-pose of a recording.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Reference {
    /// The OFFSETs: they hold the arms sideways.
    Offsets,
    /// The first frame holds the arms sideways; the OFFSETs do not.
    FirstFrame,
    /// Neither does: the OFFSETs, with the arms turned sideways by the shortest turn.
    OffsetsTurned,
}

/// How far arms may be from sideways in what counts as a T-pose.
const SIDEWAYS_RAD: f64 = 25.0 * std::f64::consts::PI / 180.0;
/// An up direction this near to an axis is that axis: shoulders behind the hips do not tilt the whole body.
const ON_AXIS_RAD: f64 = 30.0 * std::f64::consts::PI / 180.0;

/// Reads a BVH file for this wearer.
///
/// Trailing blanks, tabs, either line end and a byte order mark are allowed, as are joints with any channels in any
/// order; position channels count for the root alone. Text that is not UTF-8 is read with replacement characters.
///
/// # Errors
/// The line, what is wrong there, and what to do.
pub fn read(bytes: &[u8], wearer: &Skeleton) -> Result<Motion, BvhError> {
    let recording = text::read(&String::from_utf8_lossy(bytes))?;
    let rig = Rig::new(&recording)?;
    let (reference, t_pose, file_to_wearer) = rig.reference(&recording)?;
    let t_pose_inverses = rig.t_pose_inverses(&t_pose, file_to_wearer, wearer);
    let metres_per_unit = rig.metres_per_unit(&t_pose, wearer);
    let first_hips = recording.frame(0).positions[rig.hips];

    let poses = (0..recording.frame_count()).map(|frame| {
        let stance = recording.frame(frame);
        let moved_m = file_to_wearer * (stance.positions[rig.hips] - first_hips) * metres_per_unit.unwrap_or(0.0);
        let mut pose = Pose { hips_translation_m: moved_m.as_vec3(), ..Pose::REST };
        // World rotations relative to the T-pose, by the wearer's joints.
        let mut turned: Vec<DQuat> = Vec::with_capacity(wearer.joints().len());
        for joint in wearer.joints() {
            let above = joint.parent.map_or(DQuat::IDENTITY, |parent| turned[usize::from(parent)]);
            let own = match rig.joint(joint.bone) {
                Some(source) => {
                    let own = file_to_wearer * stance.rotations[source] * t_pose_inverses[joint.bone as usize];
                    rig.swing(&stance, file_to_wearer, joint.bone, own, wearer) * own.normalize()
                }
                None => above,
            };
            turned.push(own);
            let local = above.inverse() * own;
            // Of the two quaternions of a rotation the one nearer to the T-pose's.
            pose.rotations[joint.bone as usize] = (if local.w < 0.0 { -local } else { local }).normalize().as_quat();
        }
        pose
    });
    let worn: Vec<usize> = wearer.joints().iter().filter_map(|joint| rig.joint(joint.bone)).collect();
    let names = recording.joints.iter().enumerate();
    Ok(Motion {
        frame_time_s: recording.frame_time_s,
        poses: poses.collect(),
        reference,
        metres_per_unit,
        names_tell: rig.names_tell,
        unmapped: names.filter(|(j, _)| !worn.contains(j)).map(|(_, joint)| joint.name.clone()).collect(),
    })
}

/// Upper bone, lower bone, end.
type Limb = [Bone; 3];
const ARMS: [Limb; 2] = [
    [Bone::LeftUpperArm, Bone::LeftLowerArm, Bone::LeftHand],
    [Bone::RightUpperArm, Bone::RightLowerArm, Bone::RightHand],
];
const LEGS: [Limb; 2] = [
    [Bone::LeftUpperLeg, Bone::LeftLowerLeg, Bone::LeftFoot],
    [Bone::RightUpperLeg, Bone::RightLowerLeg, Bone::RightFoot],
];

/// Which joint of the file is which bone, as far as the names tell.
struct Rig {
    joint_of: [Option<usize>; Bone::COUNT],
    hips: usize,
    /// Whether names told that, not how the joints branch.
    names_tell: bool,
    /// Line to name where bones are missing.
    line: usize,
}

impl Rig {
    fn new(recording: &Recording) -> Result<Rig, BvhError> {
        let names: Vec<&str> = recording.joints.iter().map(|joint| joint.name.as_str()).collect();
        let by_name = names::bones_of(&names);
        let is_known = |bone| by_name.contains(&Some(bone));
        let needed = [Bone::Hips, Bone::LeftUpperArm, Bone::RightUpperArm];
        let by_structure = if needed.into_iter().all(is_known) {
            None
        } else {
            structure::bones_of(&recording.joints, &recording.rest())
        };
        let names_tell = by_structure.is_none();
        let mut joint_of = [None; Bone::COUNT];
        for (joint, bone) in by_structure.unwrap_or(by_name).into_iter().enumerate() {
            if let Some(bone) = bone {
                joint_of[bone as usize] = Some(joint);
            }
        }
        let line = recording.joints[0].line;
        let unknown = |missing| BvhError { line, problem: Problem::Unknown { missing } };
        let hips = joint_of[Bone::Hips as usize].ok_or_else(|| unknown("hips"))?;
        let rig = Rig { joint_of, hips, names_tell, line };
        for [upper, _, _] in ARMS {
            rig.joint(upper).ok_or_else(|| unknown(upper.name()))?;
        }
        Ok(rig)
    }

    fn joint(&self, bone: Bone) -> Option<usize> {
        self.joint_of[bone as usize]
    }

    /// From one bone to another in a stance, if both are there and apart.
    fn direction(&self, stance: &Stance, from: Bone, to: Bone) -> Option<DVec3> {
        let (from, to) = (self.joint(from)?, self.joint(to)?);
        (stance.positions[to] - stance.positions[from]).try_normalize()
    }

    /// The stance that counts as the T-pose, and the rotation from the file's axes to +X left, +Y up, +Z front.
    fn reference(&self, recording: &Recording) -> Result<(Reference, Stance, DQuat), BvhError> {
        let rest = recording.rest();
        let rest_axes = self.axes(&rest)?;
        if self.holds_arms_sideways(&rest, rest_axes) {
            return Ok((Reference::Offsets, rest, rest_axes));
        }
        let first = recording.frame(0);
        match self.axes(&first) {
            Ok(axes) if self.holds_arms_sideways(&first, axes) => Ok((Reference::FirstFrame, first, axes)),
            _ => Ok((Reference::OffsetsTurned, rest, rest_axes)),
        }
    }

    fn axes(&self, stance: &Stance) -> Result<DQuat, BvhError> {
        let at = |bone| self.joint(bone).map_or(DVec3::ZERO, |joint| stance.positions[joint]);
        let [left_arm, right_arm] = [at(Bone::LeftUpperArm), at(Bone::RightUpperArm)];
        let up = ((left_arm + right_arm) * 0.5 - at(Bone::Hips)).try_normalize();
        let left = self
            .direction(stance, Bone::RightUpperArm, Bone::LeftUpperArm)
            .or_else(|| self.direction(stance, Bone::RightUpperLeg, Bone::LeftUpperLeg));
        let frame = up.zip(left).and_then(|(up, left)| {
            let along = DVec3::AXES.into_iter().flat_map(|axis| [axis, -axis]);
            let up = along.into_iter().find(|axis| axis.angle_between(up) <= ON_AXIS_RAD).unwrap_or(up);
            let left = left.reject_from_normalized(up).try_normalize()?;
            Some(DQuat::from_mat3(&DMat3::from_cols(left, up, left.cross(up))).inverse())
        });
        frame.ok_or(BvhError { line: self.line, problem: Problem::NoDirection })
    }

    fn holds_arms_sideways(&self, stance: &Stance, file_to_wearer: DQuat) -> bool {
        ARMS.into_iter().zip([DVec3::X, DVec3::NEG_X]).all(|([upper, lower, hand], sideways)| {
            [(upper, lower), (lower, hand)].into_iter().all(|(from, to)| {
                let direction = self.direction(stance, from, to);
                direction.is_none_or(|along| (file_to_wearer * along).angle_between(sideways) <= SIDEWAYS_RAD)
            })
        })
    }

    /// For every bone the rotation that its joint has, seen from the wearer's axes, when the wearer is in the T-pose;
    /// inverted, so that `file_to_wearer * rotation * inverse` is the bone's world rotation relative to the T-pose.
    fn t_pose_inverses(&self, stance: &Stance, file_to_wearer: DQuat, wearer: &Skeleton) -> [DQuat; Bone::COUNT] {
        let mut corrections = [DQuat::IDENTITY; Bone::COUNT];
        for (limb, is_arm) in ARMS.map(|arm| (arm, true)).into_iter().chain(LEGS.map(|leg| (leg, false))) {
            let [upper, lower, end] = limb;
            // A part whose end the file does not give continues the part above.
            let mut correction = DQuat::IDENTITY;
            for (bone, next) in [(upper, lower), (lower, end)] {
                let recorded = self.direction(stance, bone, next);
                if let Some((from, to)) = recorded.zip(rest_direction(wearer, bone, next)) {
                    correction = DQuat::from_rotation_arc(file_to_wearer * from, to);
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
        Bone::ALL.map(|bone| match self.joint(bone) {
            Some(joint) => {
                let inverse = stance.rotations[joint].inverse() * file_to_wearer.inverse();
                inverse * corrections[bone as usize].inverse()
            }
            None => DQuat::IDENTITY,
        })
    }

    /// What a limb's rotation lacks so that it points from its first joint to its last: rigs that split a limb in two
    /// bend it in the middle as well.
    fn swing(&self, stance: &Stance, file_to_wearer: DQuat, bone: Bone, own: DQuat, wearer: &Skeleton) -> DQuat {
        let parts = ARMS.into_iter().chain(LEGS).flat_map(|[upper, lower, end]| [(upper, lower), (lower, end)]);
        let next = parts.into_iter().find(|&(part, _)| part == bone).map(|(_, next)| next);
        let directions =
            next.and_then(|next| self.direction(stance, bone, next).zip(rest_direction(wearer, bone, next)));
        directions.map_or(DQuat::IDENTITY, |(recorded, rest)| {
            DQuat::from_rotation_arc((own * rest).normalize(), file_to_wearer * recorded)
        })
    }

    /// The ratio of the legs' lengths, which no pose changes.
    fn metres_per_unit(&self, stance: &Stance, wearer: &Skeleton) -> Option<f64> {
        let recorded = |bone| self.joint(bone).map(|joint| stance.positions[joint]);
        let worn = |bone| wearer.index_of(bone).map(|joint| wearer.joints()[joint].rest_m.as_dvec3());
        let (units, metres) = (legs_length(recorded)?, legs_length(worn)?);
        (units > 0.0).then(|| metres / units)
    }
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

fn rest_direction(wearer: &Skeleton, from: Bone, to: Bone) -> Option<DVec3> {
    let rest_m = |bone| wearer.index_of(bone).map(|joint| wearer.joints()[joint].rest_m.as_dvec3());
    (rest_m(to)? - rest_m(from)?).try_normalize()
}

/// Both legs from hip over knee to ankle.
fn legs_length(position: impl Fn(Bone) -> Option<DVec3>) -> Option<f64> {
    let mut length = 0.0;
    for [hip, knee, ankle] in LEGS {
        let (hip, knee, ankle) = (position(hip)?, position(knee)?, position(ankle)?);
        length += hip.distance(knee) + knee.distance(ankle);
    }
    Some(length)
}
