//! Which bone a joint's name means: one table per naming convention. Knows names only.

use crate::skeleton::Bone;

/// A naming convention: how left and right are written in place of `*`, and the names.
struct Convention {
    sides: [&'static str; 2],
    middle: &'static [(&'static str, Bone)],
    /// Name, left bone, right bone.
    sided: &'static [(&'static str, Bone, Bone)],
}

/// Mixamo, LAFAN1 and most exporters of character tools.
const MIXAMO: Convention = Convention {
    sides: ["Left", "Right"],
    middle: &[
        ("Hips", Bone::Hips),
        ("Spine", Bone::Spine),
        ("Spine1", Bone::Chest),
        ("Spine2", Bone::UpperChest),
        ("Neck", Bone::Neck),
        ("Head", Bone::Head),
    ],
    sided: &[
        ("*Shoulder", Bone::LeftShoulder, Bone::RightShoulder),
        ("*Arm", Bone::LeftUpperArm, Bone::RightUpperArm),
        ("*ForeArm", Bone::LeftLowerArm, Bone::RightLowerArm),
        ("*Hand", Bone::LeftHand, Bone::RightHand),
        ("*UpLeg", Bone::LeftUpperLeg, Bone::RightUpperLeg),
        ("*Thigh", Bone::LeftUpperLeg, Bone::RightUpperLeg),
        ("*Leg", Bone::LeftLowerLeg, Bone::RightLowerLeg),
        ("*Shin", Bone::LeftLowerLeg, Bone::RightLowerLeg),
        ("*Foot", Bone::LeftFoot, Bone::RightFoot),
        ("*ToeBase", Bone::LeftToes, Bone::RightToes),
        ("*Toe", Bone::LeftToes, Bone::RightToes),
        ("*HandThumb1", Bone::LeftThumbMetacarpal, Bone::RightThumbMetacarpal),
        ("*HandThumb2", Bone::LeftThumbProximal, Bone::RightThumbProximal),
        ("*HandThumb3", Bone::LeftThumbDistal, Bone::RightThumbDistal),
        ("*HandIndex1", Bone::LeftIndexProximal, Bone::RightIndexProximal),
        ("*HandIndex2", Bone::LeftIndexIntermediate, Bone::RightIndexIntermediate),
        ("*HandIndex3", Bone::LeftIndexDistal, Bone::RightIndexDistal),
        ("*HandMiddle1", Bone::LeftMiddleProximal, Bone::RightMiddleProximal),
        ("*HandMiddle2", Bone::LeftMiddleIntermediate, Bone::RightMiddleIntermediate),
        ("*HandMiddle3", Bone::LeftMiddleDistal, Bone::RightMiddleDistal),
        ("*HandRing1", Bone::LeftRingProximal, Bone::RightRingProximal),
        ("*HandRing2", Bone::LeftRingIntermediate, Bone::RightRingIntermediate),
        ("*HandRing3", Bone::LeftRingDistal, Bone::RightRingDistal),
        ("*HandPinky1", Bone::LeftLittleProximal, Bone::RightLittleProximal),
        ("*HandPinky2", Bone::LeftLittleIntermediate, Bone::RightLittleIntermediate),
        ("*HandPinky3", Bone::LeftLittleDistal, Bone::RightLittleDistal),
    ],
};

/// The CMU database as converted by cgspeed. Its `Neck` turns along with `Neck1`.
const CMU: Convention = Convention {
    sides: ["Left", "Right"],
    middle: &[
        ("Hips", Bone::Hips),
        ("LowerBack", Bone::Spine),
        ("Spine", Bone::Chest),
        ("Spine1", Bone::UpperChest),
        ("Neck1", Bone::Neck),
        ("Head", Bone::Head),
    ],
    sided: &[
        ("*Shoulder", Bone::LeftShoulder, Bone::RightShoulder),
        ("*Arm", Bone::LeftUpperArm, Bone::RightUpperArm),
        ("*ForeArm", Bone::LeftLowerArm, Bone::RightLowerArm),
        ("*Hand", Bone::LeftHand, Bone::RightHand),
        ("*UpLeg", Bone::LeftUpperLeg, Bone::RightUpperLeg),
        ("*Leg", Bone::LeftLowerLeg, Bone::RightLowerLeg),
        ("*Foot", Bone::LeftFoot, Bone::RightFoot),
        ("*ToeBase", Bone::LeftToes, Bone::RightToes),
    ],
};

/// Names after the joints themselves (collar, shoulder, elbow), as in older recording tools and one form of the CMU
/// database: here `LeftShoulder` is the upper arm.
const JOINTS: Convention = Convention {
    sides: ["Left", "Right"],
    middle: &[
        ("Hips", Bone::Hips),
        ("LowerBack", Bone::Spine),
        ("Chest", Bone::Chest),
        ("Chest2", Bone::UpperChest),
        ("Neck", Bone::Neck),
        ("Head", Bone::Head),
    ],
    sided: &[
        ("*Collar", Bone::LeftShoulder, Bone::RightShoulder),
        ("*Shoulder", Bone::LeftUpperArm, Bone::RightUpperArm),
        ("*Elbow", Bone::LeftLowerArm, Bone::RightLowerArm),
        ("*Wrist", Bone::LeftHand, Bone::RightHand),
        ("*Hip", Bone::LeftUpperLeg, Bone::RightUpperLeg),
        ("*Knee", Bone::LeftLowerLeg, Bone::RightLowerLeg),
        ("*Ankle", Bone::LeftFoot, Bone::RightFoot),
        ("*Toe", Bone::LeftToes, Bone::RightToes),
    ],
};

/// Kinect joints.
const KINECT: Convention = Convention {
    sides: ["Left", "Right"],
    middle: &[
        ("SpineBase", Bone::Hips),
        ("HipCenter", Bone::Hips),
        ("SpineMid", Bone::Spine),
        ("Spine", Bone::Spine),
        ("SpineShoulder", Bone::UpperChest),
        ("ShoulderCenter", Bone::UpperChest),
        ("Neck", Bone::Neck),
        ("Head", Bone::Head),
    ],
    sided: &[
        ("Shoulder*", Bone::LeftUpperArm, Bone::RightUpperArm),
        ("Elbow*", Bone::LeftLowerArm, Bone::RightLowerArm),
        ("Wrist*", Bone::LeftHand, Bone::RightHand),
        ("Hip*", Bone::LeftUpperLeg, Bone::RightUpperLeg),
        ("Knee*", Bone::LeftLowerLeg, Bone::RightLowerLeg),
        ("Ankle*", Bone::LeftFoot, Bone::RightFoot),
        ("Foot*", Bone::LeftToes, Bone::RightToes),
    ],
};

/// MakeHuman's default rig.
const MAKEHUMAN: Convention = Convention {
    sides: ["L", "R"],
    middle: &[
        ("root", Bone::Hips),
        ("spine04", Bone::Spine),
        ("spine02", Bone::Chest),
        ("spine01", Bone::UpperChest),
        ("neck01", Bone::Neck),
        ("head", Bone::Head),
        ("jaw", Bone::Jaw),
    ],
    sided: &[
        ("clavicle.*", Bone::LeftShoulder, Bone::RightShoulder),
        ("upperarm01.*", Bone::LeftUpperArm, Bone::RightUpperArm),
        ("lowerarm01.*", Bone::LeftLowerArm, Bone::RightLowerArm),
        ("wrist.*", Bone::LeftHand, Bone::RightHand),
        ("upperleg01.*", Bone::LeftUpperLeg, Bone::RightUpperLeg),
        ("lowerleg01.*", Bone::LeftLowerLeg, Bone::RightLowerLeg),
        ("foot.*", Bone::LeftFoot, Bone::RightFoot),
        ("eye.*", Bone::LeftEye, Bone::RightEye),
    ],
};

/// Bones as in VRM with the side behind, as in the dataset of Bandai-Namco Research.
const SIDE_BEHIND: Convention = Convention {
    sides: ["_L", "_R"],
    middle: &[
        ("Hips", Bone::Hips),
        ("Spine", Bone::Spine),
        ("Chest", Bone::Chest),
        ("Neck", Bone::Neck),
        ("Head", Bone::Head),
    ],
    sided: &[
        ("Shoulder*", Bone::LeftShoulder, Bone::RightShoulder),
        ("UpperArm*", Bone::LeftUpperArm, Bone::RightUpperArm),
        ("LowerArm*", Bone::LeftLowerArm, Bone::RightLowerArm),
        ("Hand*", Bone::LeftHand, Bone::RightHand),
        ("UpperLeg*", Bone::LeftUpperLeg, Bone::RightUpperLeg),
        ("LowerLeg*", Bone::LeftLowerLeg, Bone::RightLowerLeg),
        ("Foot*", Bone::LeftFoot, Bone::RightFoot),
        ("Toes*", Bone::LeftToes, Bone::RightToes),
    ],
};

/// In the order of preference where two explain equally many names.
const CONVENTIONS: [&Convention; 6] = [&MIXAMO, &CMU, &JOINTS, &KINECT, &MAKEHUMAN, &SIDE_BEHIND];

impl Convention {
    fn bone(&self, name: &str) -> Option<Bone> {
        let middle = self.middle.iter().find(|(known, _)| known.eq_ignore_ascii_case(name)).map(|&(_, bone)| bone);
        middle.or_else(|| {
            let is = |known: &str, side: usize| known.replace('*', self.sides[side]).eq_ignore_ascii_case(name);
            self.sided.iter().find_map(|&(known, left, right)| {
                is(known, 0).then_some(left).or_else(|| is(known, 1).then_some(right))
            })
        })
    }
}

/// The bone of each name, by the convention that knows most of them; VRM's own names (and Unity's, which differ in
/// case alone) come first. No bone is given twice: the first joint has it. What stands before a colon is a prefix of
/// the character's and does not count, nor does Mixamo's, nor what all names begin with up to an underscore.
pub(super) fn bones_of(names: &[&str]) -> Vec<Option<Bone>> {
    let prefix = common_prefix(names);
    let bare: Vec<&str> = names.iter().map(|name| bare(&name[prefix..])).collect();
    let vrm = |name: &str| Bone::ALL.into_iter().find(|bone| bone.name().eq_ignore_ascii_case(name));
    let mut best = distinct(&bare, vrm);
    for convention in CONVENTIONS {
        let found = distinct(&bare, |name| convention.bone(name));
        if found.iter().flatten().count() > best.iter().flatten().count() {
            best = found;
        }
    }
    best
}

fn bare(name: &str) -> &str {
    let name = name.rsplit(':').next().unwrap_or(name);
    name.strip_prefix("mixamorig").map_or(name, |rest| rest.trim_start_matches('_'))
}

/// Length of what all of several names begin with, up to its last underscore.
fn common_prefix(names: &[&str]) -> usize {
    let [first, others @ ..] = names else { return 0 };
    let ends = first.match_indices('_').map(|(at, _)| at + 1);
    let mut common = ends.filter(|&end| others.iter().all(|name| name.starts_with(&first[..end])));
    if others.is_empty() { 0 } else { common.next_back().unwrap_or(0) }
}

fn distinct(names: &[&str], bone_of: impl Fn(&str) -> Option<Bone>) -> Vec<Option<Bone>> {
    let mut taken = [false; Bone::COUNT];
    let mut take = |bone: Bone| (!std::mem::replace(&mut taken[bone as usize], true)).then_some(bone);
    names.iter().map(|name| bone_of(name).and_then(&mut take)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_same_name_means_what_its_neighbours_say() {
        let table: [(&[&str], &[Option<Bone>]); 8] = [
            (
                &["hips", "leftShoulder", "leftUpperArm"],
                &[Some(Bone::Hips), Some(Bone::LeftShoulder), Some(Bone::LeftUpperArm)],
            ),
            (
                &["mixamorig:Hips", "mixamorig:LeftShoulder", "mixamorig:LeftArm"],
                &[Some(Bone::Hips), Some(Bone::LeftShoulder), Some(Bone::LeftUpperArm)],
            ),
            (
                &["Hips", "LowerBack", "Spine", "LeftArm"],
                &[Some(Bone::Hips), Some(Bone::Spine), Some(Bone::Chest), Some(Bone::LeftUpperArm)],
            ),
            (
                &["Hips", "LeftCollar", "LeftShoulder", "LeftElbow"],
                &[Some(Bone::Hips), Some(Bone::LeftShoulder), Some(Bone::LeftUpperArm), Some(Bone::LeftLowerArm)],
            ),
            (&["SpineBase", "ShoulderRight", "thing"], &[Some(Bone::Hips), Some(Bone::RightUpperArm), None]),
            (
                &["root", "clavicle.L", "upperarm02.L", "Root"],
                &[Some(Bone::Hips), Some(Bone::LeftShoulder), None, None],
            ),
            (
                &["Character1_Reference", "Character1_Hips", "Character1_LeftShoulder", "Character1_LeftArm"],
                &[None, Some(Bone::Hips), Some(Bone::LeftShoulder), Some(Bone::LeftUpperArm)],
            ),
            (
                &["joint_Root", "Hips", "Shoulder_L", "UpperArm_L", "LowerLeg_R"],
                &[
                    None,
                    Some(Bone::Hips),
                    Some(Bone::LeftShoulder),
                    Some(Bone::LeftUpperArm),
                    Some(Bone::RightLowerLeg),
                ],
            ),
        ];
        for (names, bones) in table {
            assert_eq!(bones_of(names), bones, "{names:?}");
        }
    }
}
