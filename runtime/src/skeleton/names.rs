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

/// Blender's Rigify, the bones that deform.
const RIGIFY: Convention = Convention {
    sides: ["L", "R"],
    middle: &[
        ("spine", Bone::Hips),
        ("spine.001", Bone::Spine),
        ("spine.002", Bone::Chest),
        ("spine.003", Bone::UpperChest),
        ("spine.004", Bone::Neck),
        ("spine.006", Bone::Head),
        ("neck", Bone::Neck),
        ("head", Bone::Head),
    ],
    sided: &[
        ("shoulder.*", Bone::LeftShoulder, Bone::RightShoulder),
        ("upper_arm.*", Bone::LeftUpperArm, Bone::RightUpperArm),
        ("forearm.*", Bone::LeftLowerArm, Bone::RightLowerArm),
        ("hand.*", Bone::LeftHand, Bone::RightHand),
        ("thigh.*", Bone::LeftUpperLeg, Bone::RightUpperLeg),
        ("shin.*", Bone::LeftLowerLeg, Bone::RightLowerLeg),
        ("foot.*", Bone::LeftFoot, Bone::RightFoot),
        ("toe.*", Bone::LeftToes, Bone::RightToes),
    ],
};

/// Unreal's mannequins.
const UNREAL: Convention = Convention {
    sides: ["l", "r"],
    middle: &[
        ("pelvis", Bone::Hips),
        ("spine_01", Bone::Spine),
        ("spine_02", Bone::Chest),
        ("spine_03", Bone::UpperChest),
        ("neck_01", Bone::Neck),
        ("head", Bone::Head),
    ],
    sided: &[
        ("clavicle_*", Bone::LeftShoulder, Bone::RightShoulder),
        ("upperarm_*", Bone::LeftUpperArm, Bone::RightUpperArm),
        ("lowerarm_*", Bone::LeftLowerArm, Bone::RightLowerArm),
        ("hand_*", Bone::LeftHand, Bone::RightHand),
        ("thigh_*", Bone::LeftUpperLeg, Bone::RightUpperLeg),
        ("calf_*", Bone::LeftLowerLeg, Bone::RightLowerLeg),
        ("foot_*", Bone::LeftFoot, Bone::RightFoot),
        ("ball_*", Bone::LeftToes, Bone::RightToes),
    ],
};

/// 3ds Max's Biped.
const BIPED: Convention = Convention {
    sides: ["L", "R"],
    middle: &[
        ("Pelvis", Bone::Hips),
        ("Spine", Bone::Spine),
        ("Spine1", Bone::Chest),
        ("Spine2", Bone::UpperChest),
        ("Neck", Bone::Neck),
        ("Head", Bone::Head),
    ],
    sided: &[
        ("* Clavicle", Bone::LeftShoulder, Bone::RightShoulder),
        ("* UpperArm", Bone::LeftUpperArm, Bone::RightUpperArm),
        ("* Forearm", Bone::LeftLowerArm, Bone::RightLowerArm),
        ("* Hand", Bone::LeftHand, Bone::RightHand),
        ("* Thigh", Bone::LeftUpperLeg, Bone::RightUpperLeg),
        ("* Calf", Bone::LeftLowerLeg, Bone::RightLowerLeg),
        ("* Foot", Bone::LeftFoot, Bone::RightFoot),
        ("* Toe0", Bone::LeftToes, Bone::RightToes),
    ],
};

/// VRoid Studio.
const VROID: Convention = Convention {
    sides: ["L", "R"],
    middle: &[
        ("C_Hips", Bone::Hips),
        ("C_Spine", Bone::Spine),
        ("C_Chest", Bone::Chest),
        ("C_UpperChest", Bone::UpperChest),
        ("C_Neck", Bone::Neck),
        ("C_Head", Bone::Head),
    ],
    sided: &[
        ("*_Shoulder", Bone::LeftShoulder, Bone::RightShoulder),
        ("*_UpperArm", Bone::LeftUpperArm, Bone::RightUpperArm),
        ("*_LowerArm", Bone::LeftLowerArm, Bone::RightLowerArm),
        ("*_Hand", Bone::LeftHand, Bone::RightHand),
        ("*_UpperLeg", Bone::LeftUpperLeg, Bone::RightUpperLeg),
        ("*_LowerLeg", Bone::LeftLowerLeg, Bone::RightLowerLeg),
        ("*_Foot", Bone::LeftFoot, Bone::RightFoot),
        ("*_ToeBase", Bone::LeftToes, Bone::RightToes),
    ],
};

/// Names after limbs and joints mixed, as avatars for VRChat have them: here `Left leg` is the upper leg.
const VRCHAT: Convention = Convention {
    sides: ["Left", "Right"],
    middle: &[
        ("Hips", Bone::Hips),
        ("Spine", Bone::Spine),
        ("Chest", Bone::Chest),
        ("Neck", Bone::Neck),
        ("Head", Bone::Head),
    ],
    sided: &[
        ("* shoulder", Bone::LeftShoulder, Bone::RightShoulder),
        ("* arm", Bone::LeftUpperArm, Bone::RightUpperArm),
        ("* elbow", Bone::LeftLowerArm, Bone::RightLowerArm),
        ("* wrist", Bone::LeftHand, Bone::RightHand),
        ("* leg", Bone::LeftUpperLeg, Bone::RightUpperLeg),
        ("* knee", Bone::LeftLowerLeg, Bone::RightLowerLeg),
        ("* ankle", Bone::LeftFoot, Bone::RightFoot),
        ("* toe", Bone::LeftToes, Bone::RightToes),
    ],
};

/// In the order of preference where two explain equally many names.
const CONVENTIONS: [&Convention; 11] =
    [&MIXAMO, &CMU, &JOINTS, &KINECT, &MAKEHUMAN, &SIDE_BEHIND, &RIGIFY, &UNREAL, &BIPED, &VROID, &VRCHAT];

/// What the names of some tools begin with, whatever character they are of.
const PREFIXES: [&str; 6] = ["mixamorig", "J_Bip_", "Bip001", "Bip01", "DEF-", "ORG-"];

impl Convention {
    fn bone(&self, name: &str) -> Option<Bone> {
        let middle = self.middle.iter().find(|(known, _)| is_same(known, name)).map(|&(_, bone)| bone);
        middle.or_else(|| {
            let is = |known: &str, side: usize| is_same(&known.replace('*', self.sides[side]), name);
            self.sided.iter().find_map(|&(known, left, right)| {
                is(known, 0).then_some(left).or_else(|| is(known, 1).then_some(right))
            })
        })
    }
}

/// Whether two names differ at most in case and in what stands between their words, which exporters change.
fn is_same(known: &str, name: &str) -> bool {
    let letters = |name: &str| -> Vec<char> {
        name.chars().filter(|c| !matches!(c, ' ' | '_' | '.' | '-')).map(|c| c.to_ascii_lowercase()).collect()
    };
    letters(known) == letters(name)
}

/// The bone of each name, by the convention that knows most of them; VRM's own names (and Unity's, which differ in
/// case alone) come first. No bone is given twice: the first joint has it. What stands before a colon is a prefix of
/// the character's and does not count, nor does a tool's, nor what all names begin with up to an underscore.
#[must_use]
pub fn bones_of(names: &[&str]) -> Vec<Option<Bone>> {
    let names = &without_numbers(names);
    let prefix = common_prefix(names);
    let bare: Vec<&str> = names.iter().map(|name| bare(name, prefix)).collect();
    let vrm = |name: &str| Bone::ALL.into_iter().find(|bone| is_same(bone.name(), name));
    let mut best = distinct(&bare, vrm);
    for convention in CONVENTIONS {
        let found = distinct(&bare, |name| convention.bone(name));
        if found.iter().flatten().count() > best.iter().flatten().count() {
            best = found;
        }
    }
    best
}

/// The bone of a name in VRM 0.x, which counts the joints of a thumb from the proximal phalanx, VRM 1.0 from the metacarpal.
#[must_use]
pub fn vrm0_bone(name: &str) -> Option<Bone> {
    match name {
        "leftThumbProximal" => Some(Bone::LeftThumbMetacarpal),
        "leftThumbIntermediate" => Some(Bone::LeftThumbProximal),
        "rightThumbProximal" => Some(Bone::RightThumbMetacarpal),
        "rightThumbIntermediate" => Some(Bone::RightThumbProximal),
        _ => Bone::from_name(name),
    }
}

/// A name without its tool's or character's prefix; `common` bytes are what all names begin with.
fn bare(name: &str, common: usize) -> &str {
    let own = name.rsplit(':').next().unwrap_or(name);
    let known = PREFIXES.iter().find_map(|prefix| own.strip_prefix(prefix));
    match known {
        Some(rest) => rest.trim_start_matches(['_', ' ']),
        None if own.len() < name.len() => own,
        None => &name[common..],
    }
}

/// The names without the number that a converter gave to each of them: `Hips_01`, `Spine_02`.
fn without_numbers<'a>(names: &[&'a str]) -> Vec<&'a str> {
    let bare = |name: &&'a str| {
        let (start, number) = name.rsplit_once('_')?;
        (number.len() > 1 && number.bytes().all(|byte| byte.is_ascii_digit())).then_some(start)
    };
    let all: Option<Vec<&str>> = names.iter().map(bare).collect();
    all.unwrap_or_else(|| names.to_vec())
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
        let table: [(&[&str], &[Option<Bone>]); 14] = [
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
                &["Bip01", "Bip01 Pelvis", "Bip01 L UpperArm", "Bip01_R_Calf"],
                &[None, Some(Bone::Hips), Some(Bone::LeftUpperArm), Some(Bone::RightLowerLeg)],
            ),
            (
                &["pelvis", "spine_01", "clavicle_l", "upperarm_l", "upperarm_twist_01_l", "calf_r"],
                &[
                    Some(Bone::Hips),
                    Some(Bone::Spine),
                    Some(Bone::LeftShoulder),
                    Some(Bone::LeftUpperArm),
                    None,
                    Some(Bone::RightLowerLeg),
                ],
            ),
            (
                &["DEF-spine", "DEF-spine.001", "DEF-upper_arm.L", "DEF-forearm.L", "DEF-thigh.R"],
                &[
                    Some(Bone::Hips),
                    Some(Bone::Spine),
                    Some(Bone::LeftUpperArm),
                    Some(Bone::LeftLowerArm),
                    Some(Bone::RightUpperLeg),
                ],
            ),
            (
                &["Root", "J_Bip_C_Hips", "J_Bip_L_UpperArm", "J_Sec_Hair1_01", "J_Bip_R_LowerLeg"],
                &[None, Some(Bone::Hips), Some(Bone::LeftUpperArm), None, Some(Bone::RightLowerLeg)],
            ),
            (
                &["mixamorig:Hips_01", "mixamorig:Spine_02", "mixamorig:Spine1_03", "mixamorig:LeftForeArm_010"],
                &[Some(Bone::Hips), Some(Bone::Spine), Some(Bone::Chest), Some(Bone::LeftLowerArm)],
            ),
            (
                &["Hips", "Left shoulder", "Left arm", "Left elbow", "Right leg", "Right knee"],
                &[
                    Some(Bone::Hips),
                    Some(Bone::LeftShoulder),
                    Some(Bone::LeftUpperArm),
                    Some(Bone::LeftLowerArm),
                    Some(Bone::RightUpperLeg),
                    Some(Bone::RightLowerLeg),
                ],
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
