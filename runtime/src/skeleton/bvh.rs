//! Recorded motion from BVH text to poses of a wearer's skeleton. Pure: bytes in, poses out.
//!
//! - Joints are known by name (VRM and Unity, Mixamo and LAFAN1, CMU, joint-named, Kinect, MakeHuman, Bandai-Namco), and
//!   where names say nothing by how they branch. The rotation of a joint that is no bone is not lost: the bones below it
//!   turn by it. Position channels of any joint count. Of several ROOTs the first that is a body is read.
//! - Up is the axis along which most frames stand, if OFFSETs, first frame or custom agree ([`Options::up`] decides where
//!   they do not); it becomes +Y, left of the T-pose +X.
//! - Rotations are relative to the T-pose. It is taken from the OFFSETs where these hold the arms sideways within 25°, else
//!   from the first frame if that does, else from the OFFSETs if they are a pose at all, else from where bones point in the
//!   world ([`Reference`] says which). What then still lies between a limb's direction and that of the wearer's T-pose is
//!   closed by the shortest turn, limb by limb, so that arms and legs point where they pointed in the recording.
//! - Lengths are scaled by the ratio of the legs. The hips' way begins at the first frame.

mod directions;
mod kinematics;
mod options;
mod rig;
mod structure;
mod text;
mod tpose;
mod upright;

pub use options::{Axis, Options, Rest};
pub use text::{BvhError, Problem, limits};

use super::{Bone, Pose, Skeleton};
use glam::{DQuat, DVec3};
use kinematics::{Figure, Stance};
use rig::{ARMS, LEGS, ON_AXIS_RAD, Rig, legs_length, rest_direction};
use text::Recording;
use tpose::Posture;
use upright::{Frames, Witnesses};

/// A recording as poses.
#[derive(Clone, Debug, PartialEq)]
pub struct Motion {
    /// Seconds from one pose to the next.
    pub frame_time_s: f64,
    /// One pose per frame: rotations relative to the T-pose, hips translation relative to the first frame.
    pub poses: Vec<Pose>,
    /// Where the T-pose came from.
    pub reference: Reference,
    /// The file's axis that points up.
    pub up: Axis,
    /// The wearer's metres per unit of the file, by the length of the legs; `None` where the file or the wearer has
    /// no legs, and then the hips stay in their place.
    pub metres_per_unit: Option<f64>,
    /// Whether joints were known by their names; if not, by how they branch, which is a guess.
    pub names_tell: bool,
    /// Joints that are no bone of the wearer.
    pub unmapped: Vec<String>,
    /// What was inferred and from what, each a sentence without a full stop.
    pub notes: Vec<String>,
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
    /// The OFFSETs are no pose: where bones point in the world over the frames.
    Directions,
}

/// Reads a BVH file for this wearer; what the file leaves open is decided by its own evidence.
///
/// Trailing blanks, tabs, either line end and a byte order mark are allowed, as are joints with any channels in any
/// order. Text that is not UTF-8 is read with replacement characters.
///
/// # Errors
/// The line, what is wrong there, and what to do.
pub fn read(bytes: &[u8], wearer: &Skeleton) -> Result<Motion, BvhError> {
    read_with(bytes, wearer, Options::default())
}

/// The same where the caller decides some of what the file leaves open.
///
/// # Errors
/// The line, what is wrong there, and what to do.
pub fn read_with(bytes: &[u8], wearer: &Skeleton, options: Options) -> Result<Motion, BvhError> {
    let recording = text::read(&String::from_utf8_lossy(bytes))?;
    let (figure, rig, chosen) = first_body(&recording)?;
    let sampled: Vec<Stance> = figure.sampled().map(|frame| figure.frame(frame)).collect();
    let reading = Reading::new(&figure, &rig, &sampled, wearer, options)?;
    let metres_per_unit = metres_per_unit(&rig, &figure.rest(), wearer);
    let first_hips = sampled[0].positions[rig.hips];

    let mut stance = Stance::default();
    let poses = (0..figure.frame_count()).map(|frame| {
        figure.frame_into(frame, &mut stance);
        let moved = reading.wearer_from_world * (stance.positions[rig.hips] - first_hips);
        let mut pose = Pose { hips_translation_m: (moved * metres_per_unit.unwrap_or(0.0)).as_vec3(), ..Pose::REST };
        // World rotations relative to the T-pose, by the wearer's joints.
        let mut turned: Vec<DQuat> = Vec::with_capacity(wearer.joints().len());
        for joint in wearer.joints() {
            let above = joint.parent.map_or(DQuat::IDENTITY, |parent| turned[usize::from(parent)]);
            let own = match rig.joint(joint.bone) {
                Some(source) => {
                    let own =
                        reading.wearer_from_world * stance.rotations[source] * reading.inverses[joint.bone as usize];
                    swing(&rig, &stance, reading.wearer_from_world, joint.bone, own, wearer) * own.normalize()
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
    let poses = poses.collect();
    let worn: Vec<usize> = wearer.joints().iter().filter_map(|joint| rig.joint(joint.bone)).collect();
    let names = figure.joints.iter().enumerate();
    let mut notes = reading.notes;
    notes.push(match metres_per_unit {
        Some(metres) => format!("one unit is {metres:.5} m by the length of the legs"),
        None => "it has no legs, so the hips stay in their place".to_owned(),
    });
    notes.extend(notes_of_figure(&figure, &recording, chosen, rig.names_tell));
    Ok(Motion {
        frame_time_s: recording.frame_time_s,
        poses,
        reference: reading.reference,
        up: reading.up,
        metres_per_unit,
        names_tell: rig.names_tell,
        unmapped: names.filter(|(j, _)| !worn.contains(j)).map(|(_, joint)| joint.name.clone()).collect(),
        notes,
    })
}

/// The first skeleton with the joints of a body, and its number; if none has, what the first one lacks.
fn first_body(recording: &Recording) -> Result<(Figure<'_>, Rig, usize), BvhError> {
    let mut lacking = None;
    for skeleton in 0..recording.skeletons.len() {
        let figure = Figure::new(recording, skeleton);
        match Rig::new(&figure) {
            Ok(rig) => return Ok((figure, rig, skeleton)),
            Err(error) => lacking = lacking.or(Some(error)),
        }
    }
    Err(lacking.unwrap_or(BvhError { line: 1, problem: Problem::NoDirection }))
}

/// How a file is to be read: axes and T-pose, and why.
struct Reading {
    reference: Reference,
    up: Axis,
    /// From the file's world to +X left, +Y up, +Z front.
    wearer_from_world: DQuat,
    /// By bone what `wearer_from_world * rotation` lacks to be relative to the T-pose.
    inverses: [DQuat; Bone::COUNT],
    notes: Vec<String>,
}

impl Reading {
    fn new(
        figure: &Figure<'_>,
        rig: &Rig,
        sampled: &[Stance],
        wearer: &Skeleton,
        options: Options,
    ) -> Result<Reading, BvhError> {
        let at_root = |problem| BvhError { line: rig.line, problem };
        let (rest, first) = (figure.rest(), &sampled[0]);
        if rig.axes(&rest).is_err() && sampled.iter().all(|stance| rig.axes(stance).is_err()) {
            return Err(at_root(Problem::NoDirection));
        }
        let (of_rest, of_first) = (Posture::of(rig, &rest), Posture::of(rig, first));
        let chosen = match (options.rest, of_rest, of_first) {
            (Some(Rest::Offsets), Posture::Tee(axes), _) => (Reference::Offsets, axes),
            (Some(Rest::Offsets), ..) => (Reference::OffsetsTurned, rig.axes(&rest)?),
            (Some(Rest::FirstFrame), ..) => (Reference::FirstFrame, rig.axes(first)?),
            (Some(Rest::Directions), ..) => (Reference::Directions, DQuat::IDENTITY),
            (None, Posture::Tee(axes), _) => (Reference::Offsets, axes),
            (None, _, Posture::Tee(axes)) => (Reference::FirstFrame, axes),
            (None, Posture::Other(axes), _) => (Reference::OffsetsTurned, axes),
            (None, Posture::None, _) => (Reference::Directions, DQuat::IDENTITY),
            (None, Posture::Unclear(leg_deg), _) => return Err(at_root(Problem::RestUnclear { leg_deg })),
        };
        let (reference, axes) = chosen;

        let up_of = |posture| match posture {
            Posture::Tee(axes) | Posture::Other(axes) => on_axis(axes.inverse() * DVec3::Y),
            Posture::Unclear(_) | Posture::None => None,
        };
        let witnesses = Witnesses {
            offsets: up_of(of_rest),
            first_frame: if matches!(of_first, Posture::Tee(_)) { up_of(of_first) } else { None },
        };
        let frames = Frames::new(rig, sampled);
        let up = upright::decide(&frames, &witnesses, options.up)
            .map_err(|(evidence, likely)| at_root(Problem::UpUnclear { evidence, likely: likely.name() }))?;
        // The T-pose says where front is too, unless the frames stand along another axis than it does.
        let is_posed = reference != Reference::Directions && on_axis(axes.inverse() * DVec3::Y) == Some(up.axis);
        let wearer_from_world = if is_posed { axes } else { to_plus_y(up.axis) };

        let mut straight = Vec::new();
        let inverses = match reference {
            Reference::Offsets | Reference::OffsetsTurned => tpose::inverses(rig, &rest, axes, wearer),
            Reference::FirstFrame => tpose::inverses(rig, first, axes, wearer),
            Reference::Directions => {
                let found = directions::find(rig, sampled, up.axis.vector(), wearer);
                let found = found.ok_or_else(|| at_root(Problem::NoDirection))?;
                straight = found.straight;
                found.inverses
            }
        };
        let mut notes = vec![said_of_rest(reference, sampled.len(), options.rest.is_some()), up.note];
        if !straight.is_empty() {
            let bones: Vec<&str> = straight.iter().map(|bone| bone.name()).collect();
            notes.push(format!("the limbs below {} hardly bend, so their twist is a guess", bones.join(", ")));
        }
        notes.extend(said_of_front(rig, sampled, wearer_from_world, is_posed));
        Ok(Reading { reference, up: up.axis, wearer_from_world, inverses, notes })
    }
}

/// The axis that a direction follows, if it does.
fn on_axis(direction: DVec3) -> Option<Axis> {
    let nearest = Axis::nearest(direction);
    (nearest.vector().angle_between(direction) <= ON_AXIS_RAD).then_some(nearest)
}

/// The shortest turn of an axis to +Y; -Y turns about Z.
fn to_plus_y(axis: Axis) -> DQuat {
    match axis {
        Axis::MinusY => DQuat::from_xyzw(0.0, 0.0, 1.0, 0.0),
        _ => DQuat::from_rotation_arc(axis.vector(), DVec3::Y),
    }
}

fn said_of_rest(reference: Reference, frames: usize, is_told: bool) -> String {
    let said = match reference {
        Reference::Offsets => "the T-pose is its OFFSETs",
        Reference::FirstFrame => "the T-pose is its first frame",
        Reference::OffsetsTurned => "the T-pose is its OFFSETs with the arms turned sideways",
        Reference::Directions if is_told => {
            return format!("the T-pose is made from where bones point in the world over {frames} frames, as told");
        }
        Reference::Directions => {
            return format!(
                "its OFFSETs form no pose, and its first frame is no T-pose: the T-pose is made from where bones point in the world over \
                 {frames} frames, twist from the planes in which elbows and knees bend"
            );
        }
    };
    if is_told { format!("{said}, as told") } else { said.to_owned() }
}

/// Which of the file's axes became front, and how many frames face there.
fn said_of_front(rig: &Rig, sampled: &[Stance], wearer_from_world: DQuat, is_posed: bool) -> Option<String> {
    let front = wearer_from_world.inverse() * DVec3::Z;
    let faces = |stance: &&Stance| {
        let across = rig.left(stance).zip(rig.trunk(stance)).map(|(left, up)| left.cross(up));
        across.is_some_and(|facing| facing.dot(front) > 0.0)
    };
    let share = 100.0 * sampled.iter().filter(faces).count() as f64 / sampled.len() as f64;
    let from = if is_posed { "where its T-pose faces" } else { "as custom has it where that is up" };
    let axis = on_axis(front)?;
    Some(format!("front is {axis}, {from}; {share:.0} % of the frames face that half of the room"))
}

/// What is to be said of joints and channels.
fn notes_of_figure(figure: &Figure<'_>, recording: &Recording, chosen: usize, names_tell: bool) -> Vec<String> {
    let mut notes = Vec::new();
    let roots = recording.skeletons.len();
    if roots > 1 {
        let name = &figure.joints[0].name;
        let which = if chosen == 0 {
            "the first".to_owned()
        } else {
            format!("number {}, the first that is a body", chosen + 1)
        };
        notes.push(format!(
            "it has {roots} skeletons (ROOTs); {which}, {name:?}, is read; split the file to read another"
        ));
    }
    let [replaced, added] = figure.moved_joints();
    if replaced > 0 {
        notes.push(format!("position channels replace the OFFSETs of joints besides the root: {replaced}"));
    }
    if added > 0 {
        notes.push(format!(
            "position channels of joints besides the root are near 0, so they are counted from their OFFSETs: {added}"
        ));
    }
    if !names_tell {
        notes.push(
            "no joint has a name that is known, so bones were told by how the skeleton branches; VRM names are surer"
                .to_owned(),
        );
    }
    notes
}

/// What a limb's rotation lacks so that it points from its first joint to its last: rigs that split a limb in two
/// bend it in the middle as well.
fn swing(rig: &Rig, stance: &Stance, wearer_from_world: DQuat, bone: Bone, own: DQuat, wearer: &Skeleton) -> DQuat {
    let parts = ARMS.into_iter().chain(LEGS).flat_map(|[upper, lower, end]| [(upper, lower), (lower, end)]);
    let next = parts.into_iter().find(|&(part, _)| part == bone).map(|(_, next)| next);
    let directions = next.and_then(|next| rig.direction(stance, bone, next).zip(rest_direction(wearer, bone, next)));
    directions.map_or(DQuat::IDENTITY, |(recorded, rest)| {
        DQuat::from_rotation_arc((own * rest).normalize(), wearer_from_world * recorded)
    })
}

/// The ratio of the legs' lengths, which no pose changes.
fn metres_per_unit(rig: &Rig, stance: &Stance, wearer: &Skeleton) -> Option<f64> {
    let recorded = |bone| rig.joint(bone).map(|joint| stance.positions[joint]);
    let worn = |bone| wearer.index_of(bone).map(|joint| wearer.joints()[joint].rest_m.as_dvec3());
    let (units, metres) = (legs_length(recorded)?, legs_length(worn)?);
    (units > 0.0).then(|| metres / units)
}
