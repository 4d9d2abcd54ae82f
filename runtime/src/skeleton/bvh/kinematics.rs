//! Forward kinematics of one skeleton of a file, in the file's own units and axes. Knows neither bones nor wearers.

use super::text::{Channel, RawJoint, Recording};
use glam::{DQuat, DVec3};

/// So many frames, evenly spaced, are looked at where the whole recording is to be judged.
const SAMPLES: usize = 128;
/// Position channels whose mean is below this share of the joint's OFFSET are counted from there: a bone is not that short.
const FROM_OFFSET_SHARE: f64 = 0.25;

/// Every joint's rotation and position in the world.
#[derive(Clone, Default)]
pub(super) struct Stance {
    pub rotations: Vec<DQuat>,
    pub positions: Vec<DVec3>,
}

/// One skeleton and its frames.
pub(super) struct Figure<'a> {
    pub joints: &'a [RawJoint],
    recording: &'a Recording,
    first_channel: usize,
    /// From the parent where nothing turns: the OFFSETs, or the means of what replaces them.
    offsets: Vec<DVec3>,
    /// What a joint's position channels start from: `None` where they replace the OFFSET.
    from: Vec<Option<DVec3>>,
}

impl<'a> Figure<'a> {
    /// A skeleton of a recording by its number.
    pub fn new(recording: &'a Recording, skeleton: usize) -> Figure<'a> {
        let joints = recording.skeletons[skeleton].as_slice();
        let ahead = recording.skeletons[..skeleton].iter().flatten();
        let mut figure = Figure {
            joints,
            recording,
            first_channel: ahead.map(|joint| joint.channels.len()).sum(),
            offsets: joints.iter().map(|joint| joint.offset).collect(),
            from: vec![None; joints.len()],
        };
        figure.settle_positions();
        figure
    }

    /// Finds out what position channels of joints below others mean, and which bones they make.
    fn settle_positions(&mut self) {
        let mut channel = self.first_channel;
        for (i, joint) in self.joints.iter().enumerate() {
            let channels = channel..channel + joint.channels.len();
            channel = channels.end;
            if joint.parent.is_none() || !has_position(joint) {
                continue;
            }
            let (mut sum, mut length, mut count) = (DVec3::ZERO, 0.0, 0.0);
            for frame in self.sampled() {
                let mut moved = DVec3::ZERO;
                let mut given = joint.offset;
                for (channel, &number) in joint.channels.iter().zip(&self.recording.frame(frame)[channels.clone()]) {
                    if let Channel::Position(axis) = *channel {
                        (moved[axis], given[axis]) = (number, number);
                    }
                }
                (sum, length, count) = (sum + given, length + moved.length(), count + 1.0);
            }
            if length / count < FROM_OFFSET_SHARE * joint.offset.length() {
                self.from[i] = Some(joint.offset);
            } else {
                self.offsets[i] = sum / count;
            }
        }
    }

    /// How many joints below others have position channels that replace their OFFSETs, and how many such as are counted
    /// from the OFFSETs.
    pub fn moved_joints(&self) -> [usize; 2] {
        let below =
            || self.joints.iter().zip(&self.from).filter(|(joint, _)| joint.parent.is_some() && has_position(joint));
        let added = below().filter(|(_, from)| from.is_some()).count();
        [below().count() - added, added]
    }

    pub fn frame_count(&self) -> usize {
        self.recording.frame_count()
    }

    /// Frames, evenly spaced, the first among them.
    pub fn sampled(&self) -> impl Iterator<Item = usize> + use<> {
        let frames = self.frame_count();
        let samples = frames.min(SAMPLES);
        (0..samples).map(move |i| i * frames / samples)
    }

    /// The stance where nothing turns.
    pub fn rest(&self) -> Stance {
        let mut stance = Stance::default();
        for (joint, &offset) in self.joints.iter().zip(&self.offsets) {
            stance.push(joint, DQuat::IDENTITY, offset);
        }
        stance
    }

    /// The stance of a frame, with its channels as written.
    pub fn frame(&self, frame: usize) -> Stance {
        let mut stance = Stance::default();
        self.frame_into(frame, &mut stance);
        stance
    }

    /// The same in place of another stance.
    pub fn frame_into(&self, frame: usize, stance: &mut Stance) {
        stance.rotations.clear();
        stance.positions.clear();
        let mut numbers = self.recording.frame(frame)[self.first_channel..].iter();
        for (joint, &from) in self.joints.iter().zip(&self.from) {
            let (mut rotation, mut position) = (DQuat::IDENTITY, joint.offset);
            for (channel, &number) in joint.channels.iter().zip(numbers.by_ref()) {
                match *channel {
                    Channel::Position(axis) => position[axis] = from.map_or(0.0, |from| from[axis]) + number,
                    // The first rotation named is the outermost.
                    Channel::Rotation(axis) => {
                        rotation *= DQuat::from_axis_angle(DVec3::AXES[axis], number.to_radians());
                    }
                }
            }
            stance.push(joint, rotation, position);
        }
    }
}

impl Stance {
    /// Adds the next joint, turned and moved against its parent.
    fn push(&mut self, joint: &RawJoint, rotation: DQuat, position: DVec3) {
        let (turned, at) = match joint.parent {
            Some(parent) => (self.rotations[parent], self.positions[parent]),
            None => (DQuat::IDENTITY, DVec3::ZERO),
        };
        self.rotations.push((turned * rotation).normalize());
        self.positions.push(at + turned * position);
    }
}

fn has_position(joint: &RawJoint) -> bool {
    joint.channels.iter().any(|channel| matches!(channel, Channel::Position(_)))
}
