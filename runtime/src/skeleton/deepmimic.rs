//! DeepMimic reference motions (`humanoid3d_*.txt`) to poses.
//!
//! A frame is 44 numbers: seconds to the next frame, the root's position, then rotations relative to a body that stands
//! upright with its arms hanging, x to its front, y up, z to its right: quaternions with w first, or one angle about z for
//! knees and elbows.

use super::positions::{LEGS, leg_length_m};
use super::recording::{Format, LONGEST_S, MOST_FRAMES, Place, Recording, RecordingError, json_problem};
use super::tracked::{Tracked, Turned};
use super::{Bone, Pose, Skeleton};
use glam::{DQuat, DVec3, Vec3};
use serde::Deserialize;
use std::f64::consts::FRAC_PI_2;

const NUMBERS: usize = 44;
/// Thigh and shank of the body that the rotations belong to, metres.
const LEG_LENGTH_M: f64 = 0.421546 + 0.409870;

#[derive(Deserialize)]
struct Document {
    #[serde(rename = "Frames")]
    frames: Vec<Vec<f64>>,
}

/// Reads a motion for this wearer. The hips' way begins at the first frame.
///
/// # Errors
/// The frame or line, what is wrong there, and what to do.
pub fn read(bytes: &[u8], wearer: &Skeleton) -> Result<Recording, RecordingError> {
    let bytes = bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes);
    let file: Document = serde_json::from_slice(bytes).map_err(|error| {
        let problem = json_problem(&error, &format!("a DeepMimic motion has \"Frames\" of {NUMBERS} numbers each"));
        RecordingError::new(Place::Line(error.line()), problem)
    })?;
    if file.frames.is_empty() || file.frames.len() > MOST_FRAMES {
        let problem = format!("there are {} frames; a motion has 1 to {MOST_FRAMES}", file.frames.len());
        return Err(RecordingError::new(Place::Whole, problem));
    }
    let scale =
        leg_length_m(|bone| wearer.rest_m(bone).map(Vec3::as_dvec3)).map_or(1.0, |length_m| length_m / LEG_LENGTH_M);
    let (mut times_s, mut frames, mut time_s) = (Vec::new(), Vec::new(), 0.0);
    let mut first_root = None;
    let arms = arms_from_rest(wearer);
    for (i, numbers) in file.frames.iter().enumerate() {
        let wrong = |problem: &str| RecordingError::new(Place::Frame(i + 1), problem);
        if numbers.len() != NUMBERS {
            return Err(wrong(&format!(
                "{} numbers instead of {NUMBERS}; is this a motion of the humanoid?",
                numbers.len()
            )));
        }
        if !numbers.iter().all(|number| number.abs() <= 1e6) {
            return Err(wrong("a number is not finite or beyond a million; export the motion again"));
        }
        let turned =
            turned(numbers, &arms).ok_or_else(|| wrong("a quaternion has no length; export the motion again"))?;
        let root = to_wearer() * DVec3::new(numbers[1], numbers[2], numbers[3]);
        let moved_m = (root - *first_root.get_or_insert(root)) * scale;
        frames.push(Tracked::certain(Pose::from_turned(wearer, &turned, moved_m)));
        times_s.push(time_s);
        if !(0.0..=1e3).contains(&numbers[0]) {
            return Err(wrong("the time to the next frame is not from 0 to 1000 seconds; correct the first number"));
        }
        time_s += numbers[0];
        if time_s > LONGEST_S {
            return Err(wrong("the motion is longer than a day; cut it into pieces"));
        }
    }
    Ok(Recording { format: Format::DeepMimic, times_s, frames, notes: vec![] })
}

/// From x front, y up, z right to x left, y up, z front.
fn to_wearer() -> DQuat {
    DQuat::from_rotation_y(-FRAC_PI_2)
}

/// For upper and lower arms, left before right, the turn from the wearer's T-pose to hanging straight down.
fn arms_from_rest(wearer: &Skeleton) -> [[DQuat; 2]; 2] {
    let arms = [
        ([Bone::LeftUpperArm, Bone::LeftLowerArm, Bone::LeftHand], DVec3::X, -FRAC_PI_2),
        ([Bone::RightUpperArm, Bone::RightLowerArm, Bone::RightHand], DVec3::NEG_X, FRAC_PI_2),
    ];
    arms.map(|([upper, lower, hand], sideways, down_rad)| {
        let part = |from, to| {
            let at = |bone| wearer.rest_m(bone).map(Vec3::as_dvec3);
            let along = at(from).zip(at(to)).and_then(|(from, to)| (to - from).try_normalize()).unwrap_or(sideways);
            DQuat::from_rotation_z(down_rad) * DQuat::from_rotation_arc(along, sideways)
        };
        [part(upper, lower), part(lower, hand)]
    })
}

/// World rotations relative to the T-pose, if every quaternion has a length.
fn turned(numbers: &[f64], arms_from_rest: &[[DQuat; 2]; 2]) -> Option<Turned> {
    let quaternion = |at: usize| {
        let q = DQuat::from_xyzw(numbers[at + 1], numbers[at + 2], numbers[at + 3], numbers[at]);
        (q.length() > 1e-6).then(|| q.normalize())
    };
    let about_z = |at: usize| DQuat::from_rotation_z(numbers[at]);
    let root = quaternion(4)?;
    let chest = root * quaternion(8)?;
    let mut turned: Turned = [None; Bone::COUNT];
    let mut set = |bone: Bone, world: DQuat, hanging_from_t: DQuat| {
        turned[bone as usize] = Some(to_wearer() * world * to_wearer().inverse() * hanging_from_t);
    };
    let stands = DQuat::IDENTITY;
    set(Bone::Hips, root, stands);
    set(Bone::Chest, chest, stands);
    set(Bone::Neck, chest * quaternion(12)?, stands);
    // Hip, knee, ankle; shoulder, elbow; the right ones first.
    for (side, [hip, knee, ankle], [shoulder, elbow]) in [(1, [16, 20, 21], [25, 29]), (0, [30, 34, 35], [39, 43])] {
        let thigh = root * quaternion(hip)?;
        let shank = thigh * about_z(knee);
        let [upper, lower, foot] = LEGS[side];
        set(upper, thigh, stands);
        set(lower, shank, stands);
        set(foot, shank * quaternion(ankle)?, stands);
        let arm = chest * quaternion(shoulder)?;
        let [upper, lower] =
            [[Bone::LeftUpperArm, Bone::LeftLowerArm], [Bone::RightUpperArm, Bone::RightLowerArm]][side];
        set(upper, arm, arms_from_rest[side][0]);
        set(lower, arm * about_z(elbow), arms_from_rest[side][1]);
    }
    Some(turned)
}
