//! The pose in which a GLB or VRM shows its body: how far each bone is turned against the T-pose. Knows no pose table.
//!
//! A bone's turn in the world is (world from bone, shown) · (bone from world, at rest), whatever the axes of its joint. At rest it is as
//! its own file bound it, if that is a T-pose, else as the same joint is in the wearer's own file.

use super::stance::{Fault, LIMBS, angle_deg};
use super::{Rig, Standing, container, frame, rig, standing};
use crate::diagnostic::{Diagnostic, Place};
use glam::{DMat3, DMat4, DQuat, DVec3};
use kitsuke::skeleton::{Bone, Pose, Skeleton};
use std::collections::BTreeMap;

/// How far a limb may point from where its turn takes it, degrees; rigs of other proportions stray a little.
const STRAY_DEG: f32 = 8.0;
/// A body whose joints turn less is in the T-pose, radians.
const TURN_RAD: f32 = 2e-3;

/// A body in another pose than the T-pose.
#[derive(Clone, Debug, PartialEq)]
pub struct PosedBody {
    /// How the wearer's bones are turned, and where the hips have gone.
    pub pose: Pose,
    /// Whether the file itself was bound in a T-pose; else its joints were held against those of the wearer's own file.
    pub is_own_rest: bool,
}

/// Reads the pose that a file shows, for this wearer, whose own file may be needed to know the T-pose.
pub fn read_pose(
    file: &str,
    bytes: &[u8],
    wearer: &Skeleton,
    wearer_bytes: &[u8],
    report: &mut Vec<Diagnostic>,
) -> Option<PosedBody> {
    let posed = container::open(bytes).map_err(Fault::from).and_then(|opened| {
        let shown = rig(&opened)?;
        match standing(&shown) {
            Ok(Standing { rests, .. }) => Ok((turned(&shown, &frames(&shown, &rests), wearer), true)),
            Err(fault) => by_wearer(&shown, &fault, wearer, wearer_bytes).map(|pose| (pose, false)),
        }
    });
    let posed = posed.and_then(|(pose, is_own_rest)| match is_turned(&pose) {
        true => Ok(PosedBody { pose, is_own_rest }),
        false => Err(unposed()),
    });
    posed
        .map_err(|Fault { problem, help }| {
            report.push(Diagnostic::error("posed-body", file, Place::File).problem(problem).help(help));
        })
        .ok()
}

fn is_turned(pose: &Pose) -> bool {
    // The half angle, from the length of the vector part: the arc cosine knows no small angles.
    let half_rad = |bone: &Bone| libm::asinf(pose.rotation(*bone).xyz().length().min(1.0));
    Bone::ALL.iter().filter(|bone| **bone != Bone::Hips).any(|bone| 2.0 * half_rad(bone) > TURN_RAD)
}

fn unposed() -> Fault {
    Fault {
        problem: "the file shows the body in the T-pose: no joint is turned".to_owned(),
        help: "Export it as it is posed. In Blender's glTF export switch off Data > Armature > Use Rest Position Armature; an animation \
               alone is not read."
            .to_owned(),
    }
}

/// Frames at rest, world from bone.
fn frames(rig: &Rig, rests: &[super::Rest]) -> BTreeMap<Bone, DMat4> {
    rig.joints.bones.iter().map(|&(bone, node, _)| (bone, frame(rig, rests, node))).collect()
}

/// The shown pose against these frames.
fn turned(shown: &Rig, rest: &BTreeMap<Bone, DMat4>, wearer: &Skeleton) -> Pose {
    let in_world = turns(shown, rest);
    let mut pose = Pose::REST;
    let mut world: Vec<DQuat> = Vec::new();
    for joint in wearer.joints() {
        let above = joint.parent.map_or(DQuat::IDENTITY, |parent| world[usize::from(parent)]);
        // A bone that the file lacks goes with the one above it.
        let own = in_world.get(&joint.bone).copied().unwrap_or(above);
        pose = pose.with(joint.bone, (above.inverse() * own).normalize().as_quat());
        world.push(own);
    }
    let hips = shown.joints.bones.iter().find(|(bone, ..)| *bone == Bone::Hips);
    if let Some((&(_, node, _), at_rest)) = hips.zip(rest.get(&Bone::Hips)) {
        let way_m: DVec3 = (shown.nodes.world[node].w_axis - at_rest.w_axis).truncate();
        pose.hips_translation_m = way_m.as_vec3();
    }
    pose
}

/// How the bones are turned in the world.
fn turns(shown: &Rig, rest: &BTreeMap<Bone, DMat4>) -> BTreeMap<Bone, DQuat> {
    let turn = |&(bone, node, _): &(Bone, usize, Option<u8>)| {
        let turn = DMat3::from_mat4(shown.nodes.world[node]) * DMat3::from_mat4(*rest.get(&bone)?).inverse();
        Some((bone, rotation(turn)))
    };
    shown.joints.bones.iter().filter_map(turn).collect()
}

/// The rotation in a matrix that may scale.
fn rotation(turn: DMat3) -> DQuat {
    let x = turn.x_axis.normalize_or(DVec3::X);
    let y = turn.y_axis.reject_from_normalized(x).normalize_or(DVec3::Y);
    DQuat::from_mat3(&DMat3::from_cols(x, y, x.cross(y))).normalize()
}

/// The pose of a body that was bound in another pose than the T-pose, by the joints of the wearer's own file, which must be of the same rig.
fn by_wearer(shown: &Rig, fault: &Fault, wearer: &Skeleton, wearer_bytes: &[u8]) -> Result<Pose, Fault> {
    let opened = container::open(wearer_bytes)?;
    let own = rig(&opened)?;
    let rests = standing(&own)?.rests;
    let rest = frames(&own, &rests);
    let in_world = turns(shown, &rest);
    let place_m = |bone: Bone| {
        let node = shown.joints.bones.iter().find(|(own, ..)| *own == bone).map(|&(_, node, _)| node)?;
        Some(shown.nodes.world[node].w_axis.truncate())
    };
    let strays_deg = |[from, to]: [Bone; 2]| {
        let at_rest = (rest.get(&to)?.w_axis - rest.get(&from)?.w_axis).truncate();
        let (by_turn, by_place) = (*in_world.get(&from)? * at_rest, place_m(to)? - place_m(from)?);
        Some((from, angle_deg(by_turn.as_vec3(), by_place.as_vec3())))
    };
    let pieces = LIMBS.iter().flat_map(|limb| [[limb.bones[0], limb.bones[1]], [limb.bones[1], limb.bones[2]]]);
    let farthest = pieces.filter_map(strays_deg).max_by(|a, b| a.1.total_cmp(&b.1));
    match farthest {
        Some((bone, stray_deg)) if stray_deg > STRAY_DEG => Err(Fault {
            problem: format!(
                "the file was not bound in a T-pose ({}), and the axes of its joints are not those of the kimono's body, whose T-pose would \
                 serve: {} points {stray_deg:.0} degrees from where its axes do",
                fault.problem,
                bone.name()
            ),
            help: "Pose the very body of garment.toml (in Blender: import it, pose it, leave its rest pose as it is) and export that.".to_owned(),
        }),
        _ => Ok(turned(shown, &rest, wearer)),
    }
}
