//! Joint positions to rotations, as cameras see a body (MediaPipe, Kinect). Pure: positions in, pose out; time comes as an argument. Knows no file format.
//!
//! - The pelvis turns with the line between the hips and the way up to the shoulders (or the spine, where that is seen);
//!   the chest with the line between the shoulders; what lies between them is shared by the bones of the spine.
//! - A limb's bone takes the shortest turn from its T-pose direction, seen from the bone above, to the measured one. Its
//!   length does not matter. Its twist comes from the plane in which elbow or knee bends; where they hardly bend, the
//!   last twist stays.
//! - Feet are flat where the recording shows them standing.
//! - What is not seen stays as it was, seen from the bone above, and its confidence fades; what is seen doubtfully pulls
//!   slowly. Every pose is valid whatever comes in.

mod feet;

use self::feet::Feet;
use super::tracked::{Tracked, nearest_to_rest};
use super::{Bone, Skeleton};
use glam::{DMat3, DQuat, DVec3, Vec3};

/// Which joint stands where in a list of positions, in which axes and units.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Layout {
    /// MediaPipe's 33 landmarks, "world" form: metres, x to the picture's right, y down, z away from the camera, the origin
    /// between the hips (so the wearer stays in place).
    MediaPipe33,
    /// Kinect v1: 20 joints, metres, x to the sensor's left, y up, z away from the sensor.
    Kinect20,
    /// Kinect v2: 25 joints, axes as v1.
    Kinect25,
    /// Azure Kinect: 32 joints, millimetres, x right, y down, z away from the camera.
    Azure32,
}

/// A place on the body. Sided places are left, then right.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Place {
    Pelvis,
    SpineMid,
    Neck,
    Head,
    Nose,
    Ear(usize),
    Shoulder(usize),
    Elbow(usize),
    Wrist(usize),
    Hand(usize),
    Index(usize),
    Little(usize),
    Hip(usize),
    Knee(usize),
    Ankle(usize),
    Toes(usize),
}

const LEFT: usize = 0;
const RIGHT: usize = 1;

impl Layout {
    /// Every layout.
    pub const ALL: [Layout; 4] = [Layout::MediaPipe33, Layout::Kinect20, Layout::Kinect25, Layout::Azure32];

    /// Its name in recordings.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Layout::MediaPipe33 => "mediapipe33",
            Layout::Kinect20 => "kinect20",
            Layout::Kinect25 => "kinect25",
            Layout::Azure32 => "azure32",
        }
    }

    /// The layout of this name.
    #[must_use]
    pub fn from_name(name: &str) -> Option<Layout> {
        Layout::ALL.into_iter().find(|layout| layout.name() == name)
    }

    /// How many positions a frame has.
    #[must_use]
    pub const fn joint_count(self) -> usize {
        match self {
            Layout::MediaPipe33 => 33,
            Layout::Kinect20 => 20,
            Layout::Kinect25 => 25,
            Layout::Azure32 => 32,
        }
    }

    /// From the layout's axes and units to metres, left +X, up +Y, front +Z, for someone who faces the camera.
    fn to_metres(self, [x, y, z]: [f64; 3]) -> DVec3 {
        match self {
            Layout::MediaPipe33 => DVec3::new(x, -y, -z),
            Layout::Kinect20 | Layout::Kinect25 => DVec3::new(-x, y, -z),
            Layout::Azure32 => DVec3::new(x, -y, -z) * 1e-3,
        }
    }

    /// Whether positions tell where in the room the body is.
    fn is_in_the_room(self) -> bool {
        self != Layout::MediaPipe33
    }

    fn index(self, place: Place) -> Option<usize> {
        use Place::*;
        // Per side: left index, right index.
        let sided = |indices: [usize; 2], side: usize| Some(indices[side]);
        match self {
            Layout::MediaPipe33 => match place {
                Nose => Some(0),
                Ear(side) => sided([7, 8], side),
                Shoulder(side) => sided([11, 12], side),
                Elbow(side) => sided([13, 14], side),
                Wrist(side) => sided([15, 16], side),
                Little(side) => sided([17, 18], side),
                Index(side) => sided([19, 20], side),
                Hip(side) => sided([23, 24], side),
                Knee(side) => sided([25, 26], side),
                Ankle(side) => sided([27, 28], side),
                Toes(side) => sided([31, 32], side),
                Pelvis | SpineMid | Neck | Head | Hand(_) => None,
            },
            Layout::Kinect20 | Layout::Kinect25 => match place {
                Pelvis => Some(0),
                SpineMid => Some(1),
                Neck => Some(2),
                Head => Some(3),
                Shoulder(side) => sided([4, 8], side),
                Elbow(side) => sided([5, 9], side),
                Wrist(side) => sided([6, 10], side),
                Hand(side) => sided([7, 11], side),
                Hip(side) => sided([12, 16], side),
                Knee(side) => sided([13, 17], side),
                Ankle(side) => sided([14, 18], side),
                Toes(side) => sided([15, 19], side),
                Nose | Ear(_) | Index(_) | Little(_) => None,
            },
            Layout::Azure32 => match place {
                Pelvis => Some(0),
                SpineMid => Some(1),
                Neck => Some(3),
                Shoulder(side) => sided([5, 12], side),
                Elbow(side) => sided([6, 13], side),
                Wrist(side) => sided([7, 14], side),
                Hand(side) => sided([8, 15], side),
                Hip(side) => sided([18, 22], side),
                Knee(side) => sided([19, 23], side),
                Ankle(side) => sided([20, 24], side),
                Toes(side) => sided([21, 25], side),
                Head => Some(26),
                Nose => Some(27),
                Ear(side) => sided([29, 31], side),
                Index(_) | Little(_) => None,
            },
        }
    }
}

/// A measured position and its confidence from 0 to 1; what is not finite counts as not seen.
pub type Measured = ([f64; 3], f64);

/// From this confidence on a position is believed at once.
pub const TRUSTED: f64 = 0.5;
/// How fast a doubtful bone goes where it is measured: at confidence just below [`TRUSTED`], per second.
const DOUBTFUL_PULL_PER_S: f64 = 4.0;
/// After so long without being seen a bone's confidence is 1/e of what it was, seconds.
pub const FADE_S: f64 = 0.5;
/// Below the first angle between the parts of a limb its twist stays as it was, above the second it is as measured.
const BEND_RAD: [f64; 2] = [10.0 * DEG, 20.0 * DEG];
/// Elbows and knees that seem to bend from a farther twist than this are measured wrongly: no shoulder turns so far.
const FARTHEST_TWIST_RAD: f64 = 120.0 * DEG;
/// Farthest believable position, metres.
const FARTHEST_M: f64 = 100.0;
/// The time step in which a twist at half trust goes half way.
const TWIST_STEP_S: f64 = 1.0 / 30.0;
const DEG: f64 = std::f64::consts::PI / 180.0;

/// A direction or rotation with the confidence of what it was measured from.
type Seen<T> = Option<(T, f64)>;

/// Turns positions into poses of one wearer, frame after frame; holds what a frame leaves open.
#[derive(Clone, Debug)]
pub struct Solver {
    layout: Layout,
    rest: Rest,
    pose: Tracked,
    seen: [bool; Bone::COUNT],
    /// Twist of upper arms and legs against the shortest turn: left arm, right arm, left leg, right leg.
    twists_rad: [f64; 4],
    /// First pelvis position and the wearer's metres per measured metre.
    origin: Option<(DVec3, f64)>,
    feet: Feet,
}

/// The wearer's T-pose as far as it matters.
#[derive(Clone, Debug)]
struct Rest {
    /// Rotation of the frame of the torso, made as from measured positions.
    torso: DQuat,
    /// Directions of upper and lower part: left arm, right arm, left leg, right leg.
    limbs: [[DVec3; 2]; 4],
    /// Which of spine, chest and upper chest there are.
    spine: Vec<Bone>,
    leg_length_m: Option<f64>,
}

/// The positions of a frame in metres and the wearer's axes.
struct Positions<'a> {
    layout: Layout,
    measured: &'a [Option<Measured>],
}

impl Positions<'_> {
    fn at(&self, place: Place) -> Seen<DVec3> {
        let (position, confidence) = (*self.measured.get(self.layout.index(place)?)?)?;
        let position_m = self.layout.to_metres(position);
        let usable = position_m.abs().max_element() <= FARTHEST_M && confidence > 0.0;
        usable.then_some((position_m, confidence.min(1.0)))
    }

    fn mid(&self, place: fn(usize) -> Place) -> Seen<DVec3> {
        let ((left, a), (right, b)) = (self.at(place(LEFT))?, self.at(place(RIGHT))?);
        Some((0.5 * (left + right), a.min(b)))
    }

    /// From one place to another.
    fn along(&self, from: Place, to: Place) -> Seen<DVec3> {
        between(self.at(from), self.at(to))
    }
}

/// The direction between two places that are apart.
fn between(from: Seen<DVec3>, to: Seen<DVec3>) -> Seen<DVec3> {
    let ((from, a), (to, b)) = (from?, to?);
    let along = to - from;
    (along.length() > 1e-4).then(|| (along.normalize(), a.min(b)))
}

/// The rotation whose X is `left` and whose Y is nearest to `up`; none where they are nearly parallel.
fn frame(left: Seen<DVec3>, up: Seen<DVec3>) -> Seen<DQuat> {
    let ((left, a), (up, b)) = (left?, up?);
    let front = left.cross(up);
    (front.length() > 0.1).then(|| {
        let front = front.normalize();
        (DQuat::from_mat3(&DMat3::from_cols(left, front.cross(left), front)).normalize(), a.min(b))
    })
}

impl Solver {
    /// For positions of this layout on this wearer.
    #[must_use]
    pub fn new(layout: Layout, wearer: &Skeleton) -> Solver {
        Solver {
            layout,
            rest: Rest::new(wearer),
            pose: Tracked::UNSEEN,
            seen: [false; Bone::COUNT],
            twists_rad: [0.0; 4],
            origin: None,
            feet: Feet::default(),
        }
    }

    /// The pose of a frame, `dt_s` seconds after the one before (0 for the first). Positions beyond those given count as
    /// not seen, as do those that are `None`, not finite, farther than 100 m or of confidence 0.
    pub fn pose(&mut self, measured: &[Option<Measured>], dt_s: f64) -> &Tracked {
        let dt_s = if dt_s >= 0.0 { dt_s.min(1e6) } else { 0.0 };
        let positions = Positions { layout: self.layout, measured };
        let hips = self.torso(&positions, dt_s);
        let chest = self.rest.spine.iter().fold(hips, |turned, &bone| turned * self.held(bone));
        self.head(&positions, chest, dt_s);
        for side in [LEFT, RIGHT] {
            self.arm(&positions, side, chest, dt_s);
            self.leg(&positions, side, hips, dt_s);
        }
        self.walk(&positions);
        &self.pose
    }

    /// The poses of frames at these times, in order, with feet as the frames show them.
    pub(super) fn recording<'a>(
        mut self,
        times_s: &[f64],
        frames: impl Iterator<Item = &'a [Option<Measured>]> + Clone,
    ) -> Vec<Tracked> {
        self.feet = Feet::of(self.layout, frames.clone());
        let before_s = std::iter::once(0.0).chain(times_s.iter().copied());
        let steps_s = times_s.iter().zip(before_s).map(|(time_s, before_s)| time_s - before_s);
        steps_s.zip(frames).map(|(dt_s, measured)| self.pose(measured, dt_s).clone()).collect()
    }

    fn held(&self, bone: Bone) -> DQuat {
        self.pose.pose.rotations[bone as usize].as_dquat().normalize()
    }

    /// Takes what was measured of a bone's local rotation; returns what it now is.
    fn take(&mut self, bone: Bone, measured: Seen<DQuat>, dt_s: f64) -> DQuat {
        let i = bone as usize;
        let held = self.held(bone);
        let measured = measured.filter(|(rotation, _)| rotation.is_finite());
        let faded = self.pose.confidence[i] * libm::exp(-dt_s / FADE_S) as f32;
        let (rotation, confidence) = match measured {
            Some((rotation, confidence)) if confidence >= TRUSTED || !self.seen[i] => {
                self.seen[i] = true;
                (rotation, confidence as f32)
            }
            Some((rotation, confidence)) => {
                let pull = 1.0 - libm::exp(-dt_s * DOUBTFUL_PULL_PER_S * confidence / TRUSTED);
                (held.slerp(rotation, pull), faded.max(confidence as f32))
            }
            None => (held, faded),
        };
        let rotation = nearest_to_rest(rotation);
        self.pose.pose.rotations[i] = rotation.as_quat();
        self.pose.confidence[i] = confidence;
        rotation
    }

    /// Hips and spine; returns the rotation of the hips.
    fn torso(&mut self, positions: &Positions, dt_s: f64) -> DQuat {
        let (hip, shoulder) = (positions.mid(Place::Hip), positions.mid(Place::Shoulder));
        let (spine, pelvis) = (positions.at(Place::SpineMid), positions.at(Place::Pelvis));
        let rest = self.rest.torso.inverse();
        let through = between(hip, shoulder);
        // The spine's lower half where it is seen; it rests upright.
        let up = between(pelvis, spine);
        let hips_left = positions.along(Place::Hip(RIGHT), Place::Hip(LEFT));
        let hips = match frame(hips_left, up) {
            Some(hips) => Some(hips),
            None => frame(hips_left, through).map(|(turned, confidence)| (turned * rest, confidence)),
        };
        let hips = self.take(Bone::Hips, hips, dt_s);
        let chest_left = positions.along(Place::Shoulder(RIGHT), Place::Shoulder(LEFT));
        let chest = match frame(chest_left, between(spine, shoulder)) {
            Some(chest) => Some(chest),
            None => frame(chest_left, through).map(|(turned, confidence)| (turned * rest, confidence)),
        };
        let bones = self.rest.spine.clone();
        let share = chest.map(|(chest, confidence)| {
            let whole = nearest_to_rest(hips.inverse() * chest);
            (DQuat::IDENTITY.slerp(whole, 1.0 / bones.len().max(1) as f64), confidence)
        });
        for bone in bones {
            self.take(bone, share, dt_s);
        }
        hips
    }

    /// Neck and head share the turn from the chest.
    fn head(&mut self, positions: &Positions, chest: DQuat, dt_s: f64) {
        let left = positions.along(Place::Ear(RIGHT), Place::Ear(LEFT));
        let front = between(positions.mid(Place::Ear), positions.at(Place::Nose));
        let by_face = left.zip(front).and_then(|((left, a), (front, b))| {
            let up = front.cross(left);
            let (turned, _) = frame(Some((left, a)), (up.length() > 0.1).then(|| (up.normalize(), b)))?;
            Some((chest.inverse() * turned, a.min(b)))
        });
        let neck = if self.layout == Layout::MediaPipe33 { None } else { positions.at(Place::Neck) };
        let turn = by_face.or_else(|| {
            let (up, confidence) = between(neck, positions.at(Place::Head))?;
            Some((DQuat::from_rotation_arc(DVec3::Y, chest.inverse() * up), confidence))
        });
        let half = turn.map(|(turn, confidence)| (DQuat::IDENTITY.slerp(nearest_to_rest(turn), 0.5), confidence));
        self.take(Bone::Neck, half, dt_s);
        self.take(Bone::Head, half, dt_s);
    }

    fn arm(&mut self, positions: &Positions, side: usize, chest: DQuat, dt_s: f64) {
        let (upper, lower, hand, hinge) = if side == LEFT {
            (Bone::LeftUpperArm, Bone::LeftLowerArm, Bone::LeftHand, DVec3::NEG_Y)
        } else {
            (Bone::RightUpperArm, Bone::RightLowerArm, Bone::RightHand, DVec3::Y)
        };
        let upper_along = positions.along(Place::Shoulder(side), Place::Elbow(side));
        let lower_along = positions.along(Place::Elbow(side), Place::Wrist(side));
        let turned = self.limb(side, [upper, lower], chest, hinge, [upper_along, lower_along], dt_s);
        let [_, forearm] = self.rest.limbs[side];
        // The palm: from the wrist to the knuckles, and across from the little finger to the index.
        let wrist = positions.at(Place::Wrist(side));
        let (index, little) = (positions.at(Place::Index(side)), positions.at(Place::Little(side)));
        let knuckles = index.zip(little).map(|((a, p), (b, q))| (0.5 * (a + b), p.min(q)));
        let along = between(wrist, knuckles.or_else(|| positions.at(Place::Hand(side))));
        let turn = along.map(|(along, confidence)| {
            let seen = turned.inverse() * along;
            let swing = DQuat::from_rotation_arc(forearm, seen);
            let across = between(little, index).map(|(across, _)| turned.inverse() * across);
            let twist_rad = across.and_then(|across| angle_about(seen, swing * DVec3::Z, across));
            (DQuat::from_axis_angle(seen, twist_rad.unwrap_or(0.0)) * swing, confidence)
        });
        self.take(hand, turn, dt_s);
    }

    fn leg(&mut self, positions: &Positions, side: usize, hips: DQuat, dt_s: f64) {
        let [upper, lower, foot] = LEGS[side];
        let upper_along = positions.along(Place::Hip(side), Place::Knee(side));
        let lower_along = positions.along(Place::Knee(side), Place::Ankle(side));
        let turned = self.limb(2 + side, [upper, lower], hips, DVec3::X, [upper_along, lower_along], dt_s);
        let ankle = positions.at(Place::Ankle(side));
        let toes = ankle.zip(positions.along(Place::Ankle(side), Place::Toes(side)));
        let turn = toes.map(|((ankle_m, _), (along, confidence))| {
            let along = self.feet.above_the_floor(side, ankle_m, along);
            (DQuat::from_rotation_arc(self.feet.rest(), turned.inverse() * along), confidence)
        });
        self.take(foot, turn, dt_s);
    }

    /// Upper and lower part of a limb below a bone that is turned by `above`; returns how the lower part is turned.
    fn limb(
        &mut self,
        number: usize,
        [upper, lower]: [Bone; 2],
        above: DQuat,
        hinge: DVec3,
        along: [Seen<DVec3>; 2],
        dt_s: f64,
    ) -> DQuat {
        let [upper_rest, lower_rest] = self.rest.limbs[number];
        let [upper_along, lower_along] =
            along.map(|seen| seen.map(|(d, confidence)| (above.inverse() * d, confidence)));
        let turn = upper_along.map(|(along, confidence)| {
            let swing = DQuat::from_rotation_arc(upper_rest, along);
            if let Some((lower_along, trust)) = lower_along
                && let Some(twist_rad) = hinge_twist(along, swing * hinge, lower_along, hinge.dot(lower_rest))
                && twist_rad.abs() <= FARTHEST_TWIST_RAD
            {
                let bend_rad = along.angle_between(lower_along);
                let weight = smooth_step(BEND_RAD, bend_rad) * if trust.min(confidence) >= TRUSTED { 1.0 } else { 0.0 };
                let held = libm::pow(1.0 - weight, dt_s / TWIST_STEP_S);
                let held = if weight == 1.0 { 0.0 } else { held };
                self.twists_rad[number] = twist_rad + held * (self.twists_rad[number] - twist_rad);
            }
            (DQuat::from_axis_angle(along, self.twists_rad[number]) * swing, confidence)
        });
        let upper_turned = above * self.take(upper, turn, dt_s);
        // Elbow and knee bend about their hinge; the shortest turn closes what is left.
        let seen = along[1].map(|(along, confidence)| {
            let along = upper_turned.inverse() * along;
            let bend = DQuat::from_axis_angle(hinge, angle_about(hinge, lower_rest, along).unwrap_or(0.0));
            (DQuat::from_rotation_arc(bend * lower_rest, along) * bend, confidence)
        });
        upper_turned * self.take(lower, seen, dt_s)
    }

    /// The way of the pelvis from its first place, scaled to the wearer's legs.
    fn walk(&mut self, positions: &Positions) {
        let pelvis = positions.at(Place::Pelvis).or_else(|| positions.mid(Place::Hip));
        let Some((pelvis, _)) = pelvis.filter(|&(_, c)| self.layout.is_in_the_room() && c >= TRUSTED) else { return };
        if self.origin.is_none() {
            let at = |bone| {
                let leg = LEGS.into_iter().enumerate();
                let mut places = leg.flat_map(|(side, leg)| {
                    leg.into_iter().zip([Place::Hip(side), Place::Knee(side), Place::Ankle(side)])
                });
                places.find(|&(known, _)| known == bone).and_then(|(_, place)| positions.at(place)).map(|(at, _)| at)
            };
            let ratio = self.rest.leg_length_m.zip(leg_length_m(at)).map(|(wearer, seen)| wearer / seen);
            self.origin = Some((pelvis, ratio.unwrap_or(1.0).clamp(0.25, 4.0)));
        }
        if let Some((first, scale)) = self.origin {
            self.pose.pose.hips_translation_m = ((pelvis - first) * scale).as_vec3();
        }
    }
}

impl Rest {
    fn new(wearer: &Skeleton) -> Rest {
        let at = |bone| wearer.rest_m(bone).map(Vec3::as_dvec3).map(|at| (at, 1.0));
        let mid = |[left, right]: [Bone; 2]| Some((0.5 * (at(left)?.0 + at(right)?.0), 1.0));
        let up =
            between(mid([Bone::LeftUpperLeg, Bone::RightUpperLeg]), mid([Bone::LeftUpperArm, Bone::RightUpperArm]));
        let torso = frame(Some((DVec3::X, 1.0)), up).map_or(DQuat::IDENTITY, |(torso, _)| torso);
        let limb = |[upper, lower, end]: [Bone; 3], rest: DVec3| {
            let part = |from, to| between(at(from), at(to)).map_or(rest, |(along, _)| along);
            [part(upper, lower), part(lower, end)]
        };
        let spine = [Bone::Spine, Bone::Chest, Bone::UpperChest];
        Rest {
            torso,
            limbs: [
                limb([Bone::LeftUpperArm, Bone::LeftLowerArm, Bone::LeftHand], DVec3::X),
                limb([Bone::RightUpperArm, Bone::RightLowerArm, Bone::RightHand], DVec3::NEG_X),
                limb(LEGS[LEFT], DVec3::NEG_Y),
                limb(LEGS[RIGHT], DVec3::NEG_Y),
            ],
            spine: spine.into_iter().filter(|&bone| wearer.index_of(bone).is_some()).collect(),
            leg_length_m: leg_length_m(|bone| wearer.rest_m(bone).map(Vec3::as_dvec3)),
        }
    }
}

/// Hip, knee and ankle; left before right.
pub(super) const LEGS: [[Bone; 3]; 2] = [
    [Bone::LeftUpperLeg, Bone::LeftLowerLeg, Bone::LeftFoot],
    [Bone::RightUpperLeg, Bone::RightLowerLeg, Bone::RightFoot],
];

/// Mean length of the legs from hip over knee to ankle, if both are there and not of length 0.
pub(super) fn leg_length_m(position_m: impl Fn(Bone) -> Option<DVec3>) -> Option<f64> {
    let mut length_m = 0.0;
    for [hip, knee, ankle] in LEGS {
        let (hip, knee, ankle) = (position_m(hip)?, position_m(knee)?, position_m(ankle)?);
        length_m += 0.5 * (hip.distance(knee) + knee.distance(ankle));
    }
    (length_m > 0.0).then_some(length_m)
}

/// The angle about `axis` from one direction to another, both seen along it; none where one of them is along it.
fn angle_about(axis: DVec3, from: DVec3, to: DVec3) -> Option<f64> {
    let (from, to) = (from.reject_from_normalized(axis), to.reject_from_normalized(axis));
    (from.length() > 1e-3 && to.length() > 1e-3).then(|| libm::atan2(axis.dot(from.cross(to)), from.dot(to)))
}

/// How far a limb's upper part is twisted about its direction `along` from a twist in which its hinge is `hinge`: so far that
/// the lower part, at `lower_along`, is to the hinge as it is at rest (`across`, a cosine), bent forwards about it.
fn hinge_twist(along: DVec3, hinge: DVec3, lower_along: DVec3, across: f64) -> Option<f64> {
    let upright = hinge.reject_from_normalized(along);
    // The lower part's cosine to the hinge is a + b cos(twist) + c sin(twist).
    let a = lower_along.dot(along) * hinge.dot(along);
    let (b, c) = (lower_along.dot(upright), lower_along.dot(along.cross(upright)));
    let reach = libm::hypot(b, c);
    if reach < 1e-3 {
        return None;
    }
    let apart_rad = libm::acos(((across - a) / reach).clamp(-1.0, 1.0));
    let twists_rad = [1.0, -1.0].map(|sign| libm::atan2(c, b) + sign * apart_rad);
    let forwards = |twist_rad: f64| {
        let hinge = DQuat::from_axis_angle(along, twist_rad) * hinge;
        hinge.cross(along).dot(lower_along)
    };
    let twist_rad = if forwards(twists_rad[0]) > forwards(twists_rad[1]) { twists_rad[0] } else { twists_rad[1] };
    Some(libm::remainder(twist_rad, std::f64::consts::TAU))
}

fn smooth_step([low, high]: [f64; 2], x: f64) -> f64 {
    let t = ((x - low) / (high - low)).clamp(0.0, 1.0);
    t * t * (3.0 - 2.0 * t)
}
