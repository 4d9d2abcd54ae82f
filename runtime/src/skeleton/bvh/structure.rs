//! Which joint is which bone by how the skeleton branches, for files whose names say nothing. Knows parents and OFFSETs only.

use super::kinematics::Stance;
use super::text::RawJoint;
use crate::skeleton::Bone;
use glam::DVec3;

/// A branch counts as a limb from this share of the longest branch on.
const LIMB_SHARE: f64 = 0.3;

/// The bone of each joint; `None` as a whole where the skeleton does not branch like a body: hips with two legs and a
/// spine, and on the spine a joint with two arms.
pub(super) fn bones_of(joints: &[RawJoint], rest: &Stance) -> Option<Vec<Option<Bone>>> {
    let tree = Tree::new(joints, rest);
    let hips = (0..joints.len()).find(|&joint| tree.limbs(joint).len() >= 3)?;
    // The spine's branch is the one that parts again into two long ones.
    let parting = |&limb: &usize| tree.path(limb).into_iter().find(|&joint| tree.limbs(joint).len() >= 2);
    // A neck is no arm.
    let is_arm = |&limb: &usize| tree.length(limb) > LIMB_SHARE * tree.longest(hips);
    let is_spine =
        |limb: &usize| parting(limb).is_some_and(|at| tree.limbs(at).into_iter().filter(is_arm).count() >= 2);
    let spine = *tree.limbs(hips).iter().find(|&limb| is_spine(limb))?;
    let chest = parting(&spine)?;
    let legs: Vec<usize> = tree.limbs(hips).into_iter().filter(|&limb| limb != spine).take(2).collect();
    let arms: Vec<usize> = tree.limbs(chest).into_iter().take(2).collect();
    let ([leg_a, leg_b], [arm_a, arm_b]) = ([*legs.first()?, *legs.get(1)?], [*arms.first()?, *arms.get(1)?]);

    let left = tree.left(hips, chest, [leg_a, leg_b])?;
    let sorted = |a: usize, b: usize| {
        let side =
            |limb: usize| left.dot(rest.positions[*tree.path(limb).last().unwrap_or(&limb)] - rest.positions[hips]);
        if side(a) >= side(b) { [a, b] } else { [b, a] }
    };
    let mut bones = vec![None; joints.len()];
    bones[hips] = Some(Bone::Hips);
    // From the hips up to where the arms part.
    let mut trunk: Vec<usize> = tree.path(spine);
    trunk.truncate(trunk.iter().position(|&joint| joint == chest)? + 1);
    for (i, bone) in [Bone::Spine, Bone::Chest].into_iter().enumerate().take(trunk.len()) {
        bones[trunk[i]] = Some(bone);
    }
    if trunk.len() >= 3 {
        bones[chest] = Some(Bone::UpperChest);
    }
    let neck = tree.children(chest).filter(|&child| child != arm_a && child != arm_b);
    if let Some(neck) = neck.max_by(|&a, &b| tree.length(a).total_cmp(&tree.length(b))) {
        for (joint, bone) in tree.path(neck).into_iter().zip([Bone::Neck, Bone::Head]) {
            bones[joint] = Some(bone);
        }
    }
    use Bone::*;
    let arm_bones = [
        [LeftShoulder, LeftUpperArm, LeftLowerArm, LeftHand],
        [RightShoulder, RightUpperArm, RightLowerArm, RightHand],
    ];
    for (arm, [shoulder, upper, lower, hand]) in sorted(arm_a, arm_b).into_iter().zip(arm_bones) {
        let (path, at) = tree.longest_parts(arm)?;
        if at > 0 {
            bones[path[at - 1]] = Some(shoulder);
        }
        for (&joint, bone) in path[at..].iter().zip([upper, lower, hand]) {
            bones[joint] = Some(bone);
        }
    }
    let leg_bones =
        [[LeftUpperLeg, LeftLowerLeg, LeftFoot, LeftToes], [RightUpperLeg, RightLowerLeg, RightFoot, RightToes]];
    for (leg, named) in sorted(leg_a, leg_b).into_iter().zip(leg_bones) {
        let (path, at) = tree.longest_parts(leg)?;
        for (&joint, bone) in path[at..].iter().zip(named) {
            bones[joint] = Some(bone);
        }
    }
    Some(bones)
}

struct Tree<'a> {
    joints: &'a [RawJoint],
    rest: &'a Stance,
    /// Length of the longest way from each joint's parent down through it.
    lengths: Vec<f64>,
}

impl Tree<'_> {
    fn new<'a>(joints: &'a [RawJoint], rest: &'a Stance) -> Tree<'a> {
        let mut below = vec![0.0_f64; joints.len()];
        let mut lengths = vec![0.0; joints.len()];
        for (i, joint) in joints.iter().enumerate().rev() {
            lengths[i] = joint.offset.length() + below[i];
            if let Some(parent) = joint.parent {
                below[parent] = below[parent].max(lengths[i]);
            }
        }
        Tree { joints, rest, lengths }
    }

    fn length(&self, joint: usize) -> f64 {
        self.lengths[joint]
    }

    fn children(&self, joint: usize) -> impl Iterator<Item = usize> {
        (joint + 1..self.joints.len()).filter(move |&child| self.joints[child].parent == Some(joint))
    }

    fn longest(&self, joint: usize) -> f64 {
        self.children(joint).map(|child| self.length(child)).fold(0.0, f64::max)
    }

    /// The branches of at least two joints that are long, the longest first.
    fn limbs(&self, joint: usize) -> Vec<usize> {
        let least = LIMB_SHARE * self.longest(joint);
        let is_limb = |&child: &usize| self.length(child) > least && self.children(child).next().is_some();
        let mut limbs: Vec<usize> = self.children(joint).filter(is_limb).collect();
        limbs.sort_by(|&a, &b| self.length(b).total_cmp(&self.length(a)));
        limbs
    }

    /// Down the longest way.
    fn path(&self, joint: usize) -> Vec<usize> {
        let longest = |joint: usize| self.children(joint).max_by(|&a, &b| self.length(a).total_cmp(&self.length(b)));
        std::iter::successors(Some(joint), |&joint| longest(joint)).collect()
    }

    /// A limb's joints and the place of the first of its two longest parts that follow each other.
    fn longest_parts(&self, limb: usize) -> Option<(Vec<usize>, usize)> {
        let path = self.path(limb);
        let part = |i: usize| path.get(i + 1).map_or(0.0, |&next| self.joints[next].offset.length());
        let at = (0..path.len().checked_sub(1)?)
            .max_by(|&a, &b| (part(a) + part(a + 1)).total_cmp(&(part(b) + part(b + 1))))?;
        Some((path, at))
    }

    /// Where left is: across up and the way the toes point, or, without toes, across up and the file's front.
    fn left(&self, hips: usize, chest: usize, legs: [usize; 2]) -> Option<DVec3> {
        let at = |joint: usize| self.rest.positions[joint];
        let up = (at(chest) - at(hips)).try_normalize()?;
        let toes = legs.into_iter().filter_map(|leg| {
            let (path, at_upper) = self.longest_parts(leg)?;
            Some(at(*path.get(at_upper + 3)?) - at(path[at_upper + 2]))
        });
        let toes: DVec3 = toes.sum();
        let files_front = if up.y.abs() >= up.z.abs() { DVec3::Z } else { DVec3::NEG_Y };
        let front = toes.reject_from_normalized(up).try_normalize().unwrap_or(files_front);
        up.cross(front).try_normalize()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::skeleton::bvh::kinematics::Figure;
    use crate::skeleton::bvh::text;

    /// A body of joints whose names say nothing: name, OFFSET, what hangs on it.
    fn body(toes: &str) -> String {
        let joint = |offset: &str, inside: String| format!("JOINT {{n}} {{\nOFFSET {offset}\nCHANNELS 0\n{inside}}}\n");
        let side = |x: &str| {
            let foot = joint("0 -40 0", if toes.is_empty() { String::new() } else { joint(toes, String::new()) });
            let leg = joint(&format!("{x}10 -5 0"), joint("0 -40 1", foot));
            let hand = joint(&format!("{x}25 0 0"), joint(&format!("{x}8 0 0"), String::new()));
            let arm = joint(&format!("{x}2 20 0"), joint(&format!("{x}12 0 0"), joint(&format!("{x}28 0 0"), hand)));
            (leg, arm)
        };
        let ((right_leg, right_arm), (left_leg, left_arm)) = (side("-"), side(""));
        let head = joint("0 22 0", joint("0 10 2", String::new()));
        let breast = joint("5 10 5", String::new());
        let chest = joint("0 15 0", joint("0 15 0", right_arm + &head + &breast + &left_arm));
        let hips = joint("0 90 0", right_leg + &joint("0 10 0", chest) + &left_leg);
        let mut text = format!("HIERARCHY\n{}MOTION\nFrames: 1\nFrame Time: 1\n0\n", hips.replacen("JOINT", "ROOT", 1));
        text = text.replacen("CHANNELS 0", "CHANNELS 1 Xrotation", 1);
        let mut number = 0;
        while let Some(at) = text.find("{n}") {
            text.replace_range(at..at + 3, &format!("j{number}"));
            number += 1;
        }
        text
    }

    #[test]
    fn bones_are_known_by_how_the_body_branches() {
        for (toes, left_is_plus_x) in [("0 -5 12", true), ("", true), ("0 -5 -12", false)] {
            let recording = text::read(&body(toes)).unwrap();
            let figure = Figure::new(&recording, 0);
            let rest = figure.rest();
            let bones = bones_of(figure.joints, &rest).expect("this branches like a body");
            let at =
                |bone: Bone| bones.iter().position(|&found| found == Some(bone)).map(|joint| rest.positions[joint]);
            let sign = if left_is_plus_x { 1.0 } else { -1.0 };
            let expected = [
                (Bone::Hips, [0.0, 90.0, 0.0]),
                (Bone::Spine, [0.0, 100.0, 0.0]),
                (Bone::Chest, [0.0, 115.0, 0.0]),
                (Bone::UpperChest, [0.0, 130.0, 0.0]),
                (Bone::Neck, [0.0, 152.0, 0.0]),
                (Bone::Head, [0.0, 162.0, 2.0]),
                (Bone::LeftShoulder, [sign * 2.0, 150.0, 0.0]),
                (Bone::LeftUpperArm, [sign * 14.0, 150.0, 0.0]),
                (Bone::LeftLowerArm, [sign * 42.0, 150.0, 0.0]),
                (Bone::RightHand, [-sign * 67.0, 150.0, 0.0]),
                (Bone::LeftUpperLeg, [sign * 10.0, 85.0, 0.0]),
                (Bone::RightLowerLeg, [-sign * 10.0, 45.0, 1.0]),
                (Bone::RightFoot, [-sign * 10.0, 5.0, 1.0]),
            ];
            for (bone, place) in expected {
                assert_eq!(at(bone), Some(DVec3::from_array(place)), "{} with toes {toes:?}", bone.name());
            }
            assert_eq!(at(Bone::LeftToes).is_some(), !toes.is_empty());
        }
    }

    #[test]
    fn what_is_no_body_has_no_bones() {
        let stick = "HIERARCHY\nROOT a {\nOFFSET 0 0 0\nCHANNELS 1 Xrotation\nJOINT b {\nOFFSET 0 1 0\n}\n}\nMOTION\nFrames: 1\nFrame Time: 1\n0\n";
        let recording = text::read(stick).unwrap();
        let figure = Figure::new(&recording, 0);
        assert_eq!(bones_of(figure.joints, &figure.rest()), None);
    }
}
