//! The frames of a skeleton as nodes of a glTF file: the joints, then what hangs from them, as children of the joints that carry it. Knows no
//! cloth.

use glam::{Affine3A, Quat, Vec3};
use kitsuke::skeleton::{Pose, Skeleton};
use serde_json::{Value, json};

/// Joints whose places against their parents differ by less than this keep them, metres.
const STILL_M: f32 = 1e-6;

/// What moves a node, frame by frame, against its parent.
pub struct Keys {
    /// x, y, z, w.
    pub rotations: Vec<[f32; 4]>,
    /// Metres; none where it stays in its place.
    pub translations_m: Option<Vec<[f32; 3]>>,
}

/// The parent of each frame.
fn parents(skeleton: &Skeleton) -> Vec<Option<usize>> {
    let joints = skeleton.joints().iter().map(|joint| joint.parent.map(usize::from));
    joints.chain(skeleton.hanging().iter().map(|hanging| Some(usize::from(hanging.joint)))).collect()
}

/// Where each frame is in the T-pose, metres.
pub fn rest_m(skeleton: &Skeleton) -> Vec<Vec3> {
    let joints = skeleton.joints();
    let hanging = skeleton.hanging().iter().map(|hanging| joints[usize::from(hanging.joint)].rest_m);
    joints.iter().map(|joint| joint.rest_m).chain(hanging).collect()
}

/// The frames without parent.
pub fn roots(skeleton: &Skeleton) -> impl Iterator<Item = usize> {
    parents(skeleton).into_iter().enumerate().filter(|(_, parent)| parent.is_none()).map(|(frame, _)| frame)
}

/// A node for each frame, by the names of VRM's bones.
pub fn nodes(skeleton: &Skeleton) -> Vec<Value> {
    let (parents, rest_m) = (parents(skeleton), rest_m(skeleton));
    let node = |frame: usize| {
        let bone = skeleton.bone(frame as u8).name();
        let is_joint = frame < skeleton.joints().len();
        let name = if is_joint { bone.to_owned() } else { format!("{bone}_hanging") };
        let from_m = parents[frame].map_or(Vec3::ZERO, |parent| rest_m[parent]);
        let mut node = json!({ "name": name, "translation": (rest_m[frame] - from_m).to_array() });
        let children: Vec<usize> = (0..parents.len()).filter(|&other| parents[other] == Some(frame)).collect();
        if !children.is_empty() {
            node["children"] = json!(children);
        }
        node
    };
    (0..parents.len()).map(node).collect()
}

/// How each frame moves in these poses, as the cloth sees them: arms without twist.
pub fn keys(skeleton: &Skeleton, poses: &[Pose]) -> Vec<Keys> {
    let (parents, rest_m) = (parents(skeleton), rest_m(skeleton));
    let mut rotations: Vec<Vec<[f32; 4]>> = vec![Vec::with_capacity(poses.len()); parents.len()];
    let mut translations_m: Vec<Vec<[f32; 3]>> = vec![Vec::with_capacity(poses.len()); parents.len()];
    let mut posed_from_rest = vec![Affine3A::IDENTITY; skeleton.frame_count()];
    for pose in poses {
        skeleton.posed_from_rest(&pose.sanitised().with_arms_untwisted(), &mut posed_from_rest);
        for (frame, &parent) in parents.iter().enumerate() {
            let place = |frame: usize| {
                let turn = Quat::from_mat3a(&posed_from_rest[frame].matrix3).normalize();
                (turn, posed_from_rest[frame].transform_point3(rest_m[frame]))
            };
            let ((turn, at_m), (parent_turn, parent_m)) =
                (place(frame), parent.map_or((Quat::IDENTITY, Vec3::ZERO), place));
            let mut own = (parent_turn.inverse() * turn).normalize();
            // A rotation and its negative are the same, but not what lies between two keys.
            if rotations[frame].last().is_some_and(|before| Quat::from_array(*before).dot(own) < 0.0) {
                own = -own;
            }
            rotations[frame].push(own.to_array());
            translations_m[frame].push((parent_turn.inverse() * (at_m - parent_m)).to_array());
        }
    }
    let still = |frame: usize, rows: &[[f32; 3]]| {
        let from_m = parents[frame].map_or(Vec3::ZERO, |parent| rest_m[parent]);
        rows.iter().all(|row| Vec3::from_array(*row).distance(rest_m[frame] - from_m) < STILL_M)
    };
    let rows = rotations.into_iter().zip(translations_m).enumerate();
    rows.map(|(frame, (rotations, rows))| Keys { rotations, translations_m: (!still(frame, &rows)).then_some(rows) })
        .collect()
}
