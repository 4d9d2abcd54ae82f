//! The VMC protocol: datagrams to poses and back. Pure: no socket, no clock; time comes as an argument.
//!
//! - Bones arrive one by one; a pose is complete at the sender's time message (`/VMC/Ext/T`). A sender that sends none is
//!   followed by its bones: a bone that comes again begins the next pose. A sender that sends its time ahead of the bones is
//!   followed all the same, one of its frames later.
//! - Unity's axes (left-handed, y up, z front) become left +X, up +Y, front +Z. Rotations are normalised by the sender's rest
//!   pose, which is a model's ([`Receiver::set_rest`]) or the pose of a wearer in the T-pose ([`Receiver::calibrate`]); until
//!   then rotations are taken as normalised, as those of VRM 0.x models are.
//! - What is unknown, malformed or not a number is counted and ignored. Nothing is allocated after the first pose, nothing
//!   that a packet names is opened.

use super::osc::{self, Argument, Message, Part};
use super::tracked::{RestPose, Tracked, Turned};
use super::{Bone, Pose, Skeleton};
use glam::{DQuat, DVec3};

/// Farthest believable position, metres.
const FARTHEST_M: f32 = 100.0;
/// Shortest usable quaternion.
const SHORTEST_QUATERNION: f32 = 1e-6;
/// A sender whose time has not come for so long is followed by its bones, seconds.
const TIMELESS_S: f64 = 1.0;
/// No sender is faster, seconds between poses.
const SHORTEST_INTERVAL_S: f64 = 1e-3;
/// So many of the sender's intervals say what its usual pace is.
const PACE_INTERVALS: usize = 15;
/// Of them, from the longest: an interval that is no longer than this one is nothing unusual.
const UNUSUAL_FROM: usize = 4;
/// An interval lacks poses if it is longer than what is usual by more than this factor.
const LACKING: f64 = 1.5;
/// Longest datagram that is sent, bytes: whole within an Ethernet frame.
const SENT_DATAGRAM: usize = 1400;

/// What has come in since the start. Packets are counted, never logged.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Counters {
    /// Datagrams.
    pub datagrams: u64,
    /// Messages of the protocol that were used.
    pub messages: u64,
    /// Messages that were ignored: unknown addresses and bones.
    pub ignored: u64,
    /// Messages or datagrams that were malformed or held numbers that cannot be.
    pub malformed: u64,
    /// Poses.
    pub poses: u64,
    /// Poses that lack at the sender's usual pace: lost on the way, or left out by the sender. The protocol numbers no poses, so
    /// that only the sender's times tell, and a sender without a steady pace tells nothing.
    pub missing_poses: u64,
    /// Bones that were in the pose before and lacked in one.
    pub lost_bones: u64,
}

/// The last intervals between the sender's times, seconds: a steady sender (a game at 60 Hz) has one length of them, others
/// (a camera that now and then needs twice as long) have some long ones among them, and change their rate.
#[derive(Clone, Debug, Default)]
struct Pace {
    intervals_s: [f64; PACE_INTERVALS],
    taken: usize,
}

impl Pace {
    fn take(&mut self, interval_s: f64) {
        self.intervals_s[self.taken % PACE_INTERVALS] = interval_s;
        self.taken += 1;
    }

    /// How many poses lack in an interval. None before the pace is known, and none where several of the last intervals were as
    /// long: half of them say what is usual, the longest but a few what still is nothing unusual.
    fn missing(&self, interval_s: f64) -> u64 {
        if self.taken < PACE_INTERVALS {
            return 0;
        }
        let mut sorted_s = self.intervals_s;
        sorted_s.sort_unstable_by(f64::total_cmp);
        let (usual_s, long_s) = (sorted_s[PACE_INTERVALS / 2], sorted_s[PACE_INTERVALS - UNUSUAL_FROM]);
        if interval_s <= LACKING * long_s { 0 } else { (libm::round(interval_s / usual_s) as u64).saturating_sub(1) }
    }
}

#[derive(Clone, Copy, Debug)]
struct Root {
    position_m: DVec3,
    rotation: DQuat,
}

/// Turns the datagrams of one sender into poses of one wearer.
#[derive(Clone, Debug)]
pub struct Receiver {
    wearer: Skeleton,
    rest: RestPose,
    root: Root,
    hips_m: DVec3,
    /// Local rotations of the pose that is coming in, and of the whole pose before it.
    coming: [Option<DQuat>; Bone::COUNT],
    last: [Option<DQuat>; Bone::COUNT],
    pose: Tracked,
    counters: Counters,
    /// When the sender's time came last, and what it said.
    marker: Option<(f64, f32)>,
    pace: Pace,
    /// When the last pose was complete.
    complete_s: Option<f64>,
}

impl Receiver {
    /// For this wearer.
    #[must_use]
    pub fn new(wearer: &Skeleton) -> Receiver {
        Receiver {
            wearer: wearer.clone(),
            rest: RestPose::NORMALISED,
            root: Root { position_m: DVec3::ZERO, rotation: DQuat::IDENTITY },
            hips_m: DVec3::ZERO,
            coming: [None; Bone::COUNT],
            last: [None; Bone::COUNT],
            pose: Tracked::UNSEEN,
            counters: Counters::default(),
            marker: None,
            pace: Pace::default(),
            complete_s: None,
        }
    }

    /// Takes the sender's rest pose from its model.
    pub fn set_rest(&mut self, rest: RestPose) {
        self.rest = rest;
    }

    /// Takes the last whole pose as the sender's T-pose. Returns whether there was one.
    pub fn calibrate(&mut self) -> bool {
        if self.last[Bone::Hips as usize].is_none() {
            return false;
        }
        let mut rest = RestPose { hips_m: Some(self.hips_in_the_room_m()), ..RestPose::NORMALISED };
        for bone in Bone::ALL {
            if let Some(local) = self.last[bone as usize] {
                rest.local[bone as usize] = local;
            }
            // A bone that was not sent stands as the one above it.
            let above = bone.vrm_parent().map_or(DQuat::IDENTITY, |parent| rest.world[parent as usize]);
            rest.world[bone as usize] = (above * rest.local[bone as usize]).normalize();
        }
        self.rest = rest;
        true
    }

    /// Takes a datagram that came at `now_s` (seconds on any clock that does not go back) and hands on every pose that it
    /// completes.
    pub fn datagram(&mut self, datagram: &[u8], now_s: f64, mut complete: impl FnMut(&Tracked)) {
        self.counters.datagrams += 1;
        for part in osc::parts(datagram) {
            let Part::Message(message) = part else {
                self.counters.malformed += 1;
                continue;
            };
            match self.message(&message, now_s, &mut complete) {
                Some(true) => self.counters.messages += 1,
                Some(false) => self.counters.ignored += 1,
                None => self.counters.malformed += 1,
            }
        }
    }

    /// What has come in.
    #[must_use]
    pub fn counters(&self) -> Counters {
        self.counters
    }

    /// Seconds since the last whole pose; infinite before the first.
    #[must_use]
    pub fn age_s(&self, now_s: f64) -> f64 {
        self.complete_s.map_or(f64::INFINITY, |complete_s| now_s - complete_s)
    }

    /// The last whole pose. Older than `stale_after_s`, it is held, and its confidence is 0.
    #[must_use]
    pub fn pose(&self, now_s: f64, stale_after_s: f64) -> Tracked {
        let mut pose = self.pose.clone();
        if self.age_s(now_s) > stale_after_s {
            pose.confidence = [0.0; Bone::COUNT];
        }
        pose
    }

    /// Whether the message was used; `None` when it is malformed.
    fn message(&mut self, message: &Message<'_>, now_s: f64, complete: &mut impl FnMut(&Tracked)) -> Option<bool> {
        match message.address {
            "/VMC/Ext/Bone/Pos" => {
                let (name, position_m, rotation) = name_and_pose(message)?;
                let Some(bone) = bone_of(name) else { return Some(false) };
                let is_timeless = self.marker.is_none_or(|(came_s, _)| now_s - came_s > TIMELESS_S);
                if is_timeless && self.coming[bone as usize].is_some() {
                    self.complete(now_s, complete);
                }
                self.coming[bone as usize] = Some(rotation);
                if bone == Bone::Hips {
                    self.hips_m = position_m;
                }
                Some(true)
            }
            "/VMC/Ext/Root/Pos" => {
                let (_, position_m, rotation) = name_and_pose(message)?;
                self.root = Root { position_m, rotation };
                Some(true)
            }
            "/VMC/Ext/T" => {
                let [Argument::Float(time_s)] = message.arguments()? else { return None };
                if !time_s.is_finite() {
                    return None;
                }
                self.count_missing(time_s);
                self.marker = Some((now_s, time_s));
                if self.coming.iter().any(Option::is_some) {
                    self.complete(now_s, complete);
                }
                Some(true)
            }
            _ => Some(false),
        }
    }

    /// Poses that lack between the sender's last time and this one.
    fn count_missing(&mut self, time_s: f32) {
        let Some((_, before_s)) = self.marker else { return };
        let passed_s = f64::from(time_s) - f64::from(before_s);
        if (SHORTEST_INTERVAL_S..TIMELESS_S).contains(&passed_s) {
            self.counters.missing_poses += self.pace.missing(passed_s);
            self.pace.take(passed_s);
        }
    }

    fn hips_in_the_room_m(&self) -> DVec3 {
        self.root.position_m + self.root.rotation * self.hips_m
    }

    /// The pose that came in is whole.
    fn complete(&mut self, now_s: f64, complete: &mut impl FnMut(&Tracked)) {
        let coming = std::mem::replace(&mut self.coming, [None; Bone::COUNT]);
        let mut turned: Turned = [None; Bone::COUNT];
        for bone in Bone::ALL {
            let i = bone as usize;
            self.counters.lost_bones += u64::from(self.pose.confidence[i] == 1.0 && coming[i].is_none());
            // A bone that lacks in this pose is held.
            self.last[i] = coming[i].or(self.last[i]);
            self.pose.confidence[i] = match (coming[i], self.last[i]) {
                (Some(_), _) => 1.0,
                (None, Some(_)) => self.pose.confidence[i] * 0.5,
                (None, None) => 0.0,
            };
            let above = match bone.vrm_parent() {
                Some(parent) => turned[parent as usize].unwrap_or(DQuat::IDENTITY),
                None => self.root.rotation,
            };
            let normalised = self.last[i].map_or(DQuat::IDENTITY, |local| {
                self.rest.world[i] * self.rest.local[i].inverse() * local * self.rest.world[i].inverse()
            });
            turned[i] = Some((above * normalised).normalize());
        }
        let at_m = self.hips_in_the_room_m();
        let rest_at_m = *self.rest.hips_m.get_or_insert(at_m);
        let worn_m = self.wearer.rest_m(Bone::Hips).map_or(rest_at_m.y, |at| f64::from(at.y));
        let scale = if rest_at_m.y > 0.1 { (worn_m / rest_at_m.y).clamp(0.25, 4.0) } else { 1.0 };
        self.pose.pose = Pose::from_turned(&self.wearer, &turned, (at_m - rest_at_m) * scale);
        self.counters.poses += 1;
        self.complete_s = Some(now_s);
        complete(&self.pose);
    }
}

/// A name, a position and a rotation, turned from Unity's axes; `None` where they are not all there or cannot be.
fn name_and_pose<'a>(message: &Message<'a>) -> Option<(&'a str, DVec3, DQuat)> {
    let arguments = message.arguments::<8>()?;
    let Argument::Text(name) = arguments[0] else { return None };
    let mut numbers = [0.0_f32; 7];
    for (number, argument) in numbers.iter_mut().zip(&arguments[1..]) {
        let Argument::Float(value) = *argument else { return None };
        *number = value;
    }
    let [x, y, z, qx, qy, qz, qw] = numbers;
    let length = (qx * qx + qy * qy + qz * qz + qw * qw).sqrt();
    let is_near = [x, y, z].into_iter().all(|number| number.abs() <= FARTHEST_M);
    if !(is_near && length > SHORTEST_QUATERNION && length < f32::INFINITY) {
        return None;
    }
    let position_m = DVec3::new(-f64::from(x), f64::from(y), f64::from(z));
    let rotation = DQuat::from_xyzw(f64::from(qx), -f64::from(qy), -f64::from(qz), f64::from(qw));
    Some((name, position_m, rotation.normalize()))
}

/// Unity's `HumanBodyBones` differ from VRM 1.0 in the first letter and in the thumbs.
const THUMBS: [(&str, Bone); 6] = [
    ("LeftThumbProximal", Bone::LeftThumbMetacarpal),
    ("LeftThumbIntermediate", Bone::LeftThumbProximal),
    ("LeftThumbDistal", Bone::LeftThumbDistal),
    ("RightThumbProximal", Bone::RightThumbMetacarpal),
    ("RightThumbIntermediate", Bone::RightThumbProximal),
    ("RightThumbDistal", Bone::RightThumbDistal),
];

fn bone_of(name: &str) -> Option<Bone> {
    let thumb = THUMBS.iter().find(|(unity, _)| *unity == name).map(|&(_, bone)| bone);
    let same = |bone: &Bone| {
        let (vrm, unity) = (bone.name().as_bytes(), name.as_bytes());
        !bone.name().contains("Thumb")
            && vrm.len() == unity.len()
            && vrm[0].to_ascii_uppercase() == unity[0]
            && vrm[1..] == unity[1..]
    };
    thumb.or_else(|| Bone::ALL.into_iter().find(same))
}

/// Unity's name of a bone.
fn unity_name(bone: Bone) -> String {
    let thumb = THUMBS.iter().find(|&&(_, vrm)| vrm == bone).map(|&(unity, _)| unity.to_owned());
    thumb.unwrap_or_else(|| {
        let (first, rest) = bone.name().split_at(1);
        first.to_ascii_uppercase() + rest
    })
}

/// The datagrams of a pose of this wearer, the sender's time (seconds) last, as a sender with a normalised model writes
/// them. Each is a bundle that fits into an Ethernet frame.
#[must_use]
pub fn datagrams(pose: &Pose, wearer: &Skeleton, time_s: f32) -> Vec<Vec<u8>> {
    let mut datagrams: Vec<Vec<u8>> = Vec::new();
    let mut bundle = Vec::new();
    osc::write_bundle_head(&mut bundle);
    let mut add = |address: &str, arguments: &[Argument<'_>]| {
        let mut element = Vec::new();
        osc::write_element(&mut element, address, arguments);
        if bundle.len() + element.len() > SENT_DATAGRAM {
            datagrams.push(std::mem::take(&mut bundle));
            osc::write_bundle_head(&mut bundle);
        }
        bundle.extend(element);
    };
    add("/VMC/Ext/OK", &[Argument::Int(1)]);
    let placed = |name: &str, add: &mut dyn FnMut(&[Argument<'_>]), at_m: glam::Vec3, q: glam::Quat| {
        let numbers = [-at_m.x, at_m.y, at_m.z, q.x, -q.y, -q.z, q.w].map(Argument::Float);
        let mut arguments = [Argument::Text(name); 8];
        arguments[1..].copy_from_slice(&numbers);
        add(&arguments);
    };
    placed("root", &mut |a| add("/VMC/Ext/Root/Pos", a), glam::Vec3::ZERO, glam::Quat::IDENTITY);
    for joint in wearer.joints() {
        let from_m =
            joint.parent.map_or(-pose.hips_translation_m, |parent| wearer.joints()[usize::from(parent)].rest_m);
        let (name, rotation) = (unity_name(joint.bone), pose.rotation(joint.bone));
        placed(&name, &mut |a| add("/VMC/Ext/Bone/Pos", a), joint.rest_m - from_m, rotation);
    }
    add("/VMC/Ext/T", &[Argument::Float(time_s)]);
    datagrams.push(bundle);
    datagrams
}
