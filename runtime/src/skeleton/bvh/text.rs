//! The text of a BVH file as joints and numbers. Knows neither bones nor units.

use glam::DVec3;

/// Sizes beyond which nothing is read; each is far above real recordings.
pub mod limits {
    /// Most joints.
    pub const JOINTS: usize = 1024;
    /// Most joints above one another.
    pub const DEPTH: usize = 128;
    /// Most frames: 18 minutes at 120 Hz.
    pub const FRAMES: usize = 1 << 17;
    /// Most numbers in all frames together.
    pub const NUMBERS: usize = 1 << 25;
    /// Largest number, either sign.
    pub const MAGNITUDE: f64 = 1e6;
    /// Longest time between frames, seconds.
    pub const FRAME_TIME_S: f64 = 3600.0;
}

/// Why a BVH file cannot be used.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("line {line}: {problem}")]
pub struct BvhError {
    /// The line, counted from 1.
    pub line: usize,
    /// What is wrong there, and what to do.
    pub problem: Problem,
}

/// What can be wrong with a BVH file.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum Problem {
    /// Another word was needed.
    #[error("found {found:?} where {expected} must stand; is this a BVH file?")]
    Expected {
        /// The word or number needed.
        expected: &'static str,
        /// The word found.
        found: String,
    },
    /// The file ends in the middle.
    #[error("the file ends where {expected} must stand; it was cut off, export it again")]
    End {
        /// The word or number needed.
        expected: &'static str,
    },
    /// A number is no number, not finite or too large.
    #[error("{found:?} is no number from -{max} to {max}; correct it or export the file again", max = limits::MAGNITUDE)]
    Number {
        /// The word found.
        found: String,
    },
    /// A channel that BVH does not know.
    #[error(
        "unknown channel {found:?}; channels are Xposition, Yposition, Zposition, Xrotation, Yrotation and Zrotation"
    )]
    Channel {
        /// The word found.
        found: String,
    },
    /// A joint has a channel twice.
    #[error("joint {joint:?} has the channel {found:?} twice; name each channel once")]
    ChannelTwice {
        /// The joint.
        joint: String,
        /// The channel.
        found: String,
    },
    /// A joint has too many channels.
    #[error("{found:?} is no number of channels; a joint has 0 to 6")]
    ChannelCount {
        /// The word found.
        found: String,
    },
    /// Two joints have the same name.
    #[error("a second joint is named {0:?}; rename one of them")]
    JointTwice(String),
    /// A joint lacks its name.
    #[error("a joint has no name; write it after ROOT or JOINT")]
    NoName,
    /// A joint lacks its OFFSET.
    #[error("joint {0:?} has no OFFSET; write one in its braces")]
    NoOffset(String),
    /// There are more joints than anyone has.
    #[error("more than {} joints; remove those that do not move the body", limits::JOINTS)]
    Joints,
    /// Joints are nested too deeply.
    #[error("joints are nested more than {} deep; is a brace missing?", limits::DEPTH)]
    Depth,
    /// No frame, or too many.
    #[error("{found:?} is no number of frames from 1 to {}; cut the recording into pieces", limits::FRAMES)]
    Frames {
        /// The word found.
        found: String,
    },
    /// Nothing moves.
    #[error("no joint has channels, so nothing moves; export the file again with rotations")]
    NoChannels,
    /// Frames times channels is too much.
    #[error(
        "{frames} frames of {channels} numbers are more than {} numbers; cut the recording into pieces",
        limits::NUMBERS
    )]
    Numbers {
        /// Frames.
        frames: usize,
        /// Channels of all joints.
        channels: usize,
    },
    /// The frame time is unusable.
    #[error("{found:?} is no time between frames; write seconds above 0, at most {}", limits::FRAME_TIME_S)]
    FrameTime {
        /// The word found.
        found: String,
    },
    /// A frame has too few or too many numbers.
    #[error(
        "frame {frame} has {found} numbers, but the channels of all joints are {expected}; correct the line or CHANNELS"
    )]
    FrameLength {
        /// The frame, counted from 1.
        frame: usize,
        /// Numbers in the line.
        found: usize,
        /// Channels of all joints.
        expected: usize,
    },
    /// Fewer frames than announced.
    #[error(
        "the file announces {expected} frames and ends after {found}; write \"Frames: {found}\" or export it again"
    )]
    FramesMissing {
        /// Announced.
        expected: usize,
        /// Found.
        found: usize,
    },
    /// More frames than announced.
    #[error("a frame after the {expected} that the file announces; correct \"Frames:\"")]
    FramesLeft {
        /// Announced.
        expected: usize,
    },
    /// No bone could be recognised.
    #[error(
        "no joint is known as {missing}; rename the joints to VRM names such as hips, leftUpperArm and rightUpperArm"
    )]
    Unknown {
        /// The missing bone.
        missing: &'static str,
    },
    /// The skeleton stands on no axis.
    #[error(
        "the joints of this skeleton do not show where up and left are; its OFFSETs from the hips to the arms and between the arms must not be 0"
    )]
    NoDirection,
    /// The evidence does not agree on which axis points up.
    #[error("which axis points up stays open: {evidence}; decide it with --up, such as --up {likely}")]
    UpUnclear {
        /// What speaks for what.
        evidence: String,
        /// The likeliest axis.
        likely: &'static str,
    },
    /// The OFFSETs are no clear pose, nor clearly none.
    #[error(
        "whether the OFFSETs are a pose stays open: they hold a leg {leg_deg:.0}° from straight down; decide it with --rest offsets, --rest \
         first-frame or --rest directions"
    )]
    RestUnclear {
        /// From straight down to the leg, degrees.
        leg_deg: f64,
    },
}

/// A joint as the file gives it.
#[derive(Clone, Debug)]
pub(super) struct RawJoint {
    pub name: String,
    /// Line of its name.
    pub line: usize,
    pub parent: Option<usize>,
    /// From the parent, in the file's units and axes.
    pub offset: DVec3,
    pub channels: Vec<Channel>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Channel {
    Position(usize),
    Rotation(usize),
}

const CHANNEL_NAMES: [(&str, Channel); 6] = [
    ("Xposition", Channel::Position(0)),
    ("Yposition", Channel::Position(1)),
    ("Zposition", Channel::Position(2)),
    ("Xrotation", Channel::Rotation(0)),
    ("Yrotation", Channel::Rotation(1)),
    ("Zrotation", Channel::Rotation(2)),
];

/// A whole file: skeletons, each of joints after their parents, and the numbers of all frames.
#[derive(Clone, Debug)]
pub(super) struct Recording {
    /// At least one; each begins with its ROOT.
    pub skeletons: Vec<Vec<RawJoint>>,
    pub frame_time_s: f64,
    channels: usize,
    numbers: Vec<f64>,
}

impl Recording {
    pub fn frame_count(&self) -> usize {
        self.numbers.len() / self.channels
    }

    /// The numbers of a frame, by channel, skeleton after skeleton.
    pub fn frame(&self, frame: usize) -> &[f64] {
        &self.numbers[frame * self.channels..][..self.channels]
    }
}

/// Reads a whole file.
pub(super) fn read(text: &str) -> Result<Recording, BvhError> {
    let mut words = Words { rest: text.strip_prefix('\u{feff}').unwrap_or(text), line: 1 };
    words.expect("HIERARCHY")?;
    let skeletons = read_skeletons(&mut words)?;
    let (frames, frames_line) = read_frame_count(&mut words)?;
    words.expect("Frame")?;
    words.expect("Time:")?;
    let (line, found) = words.next("the frame time")?;
    let frame_time_s = found
        .parse()
        .ok()
        .filter(|&time_s: &f64| time_s > 0.0 && time_s <= limits::FRAME_TIME_S)
        .ok_or_else(|| at(line, Problem::FrameTime { found: found.to_owned() }))?;
    let channels: usize = skeletons.iter().flatten().map(|joint| joint.channels.len()).sum();
    if channels == 0 {
        return Err(at(frames_line, Problem::NoChannels));
    }
    if frames * channels > limits::NUMBERS {
        return Err(at(frames_line, Problem::Numbers { frames, channels }));
    }
    let numbers = read_frames(&words, frames, channels)?;
    Ok(Recording { skeletons, frame_time_s, channels, numbers })
}

/// Everything between HIERARCHY and MOTION, which is taken as well.
fn read_skeletons(words: &mut Words<'_>) -> Result<Vec<Vec<RawJoint>>, BvhError> {
    let (mut skeletons, mut joints) = (Vec::new(), 0);
    words.expect("ROOT")?;
    loop {
        let skeleton = read_skeleton(words, limits::JOINTS - joints)?;
        joints += skeleton.len();
        skeletons.push(skeleton);
        let (line, found) = words.next("MOTION")?;
        if found.eq_ignore_ascii_case("MOTION") {
            return Ok(skeletons);
        }
        if !found.eq_ignore_ascii_case("ROOT") {
            let found = found.chars().take(40).collect();
            return Err(at(line, Problem::Expected { expected: "MOTION", found }));
        }
    }
}

/// The joints of one skeleton, after its word ROOT.
fn read_skeleton(words: &mut Words<'_>, most_joints: usize) -> Result<Vec<RawJoint>, BvhError> {
    let mut joints: Vec<RawJoint> = Vec::new();
    let mut names = std::collections::BTreeSet::new();
    // The open braces from the outermost: a joint and whether its OFFSET came, or an End Site.
    let mut open: Vec<Option<(usize, bool)>> = Vec::new();
    let mut begins = true;
    loop {
        if begins {
            let (line, name) = words.name();
            if name.is_empty() {
                return Err(at(line, Problem::NoName));
            }
            if !names.insert(name.to_owned()) {
                return Err(at(line, Problem::JointTwice(name.to_owned())));
            }
            if joints.len() == most_joints {
                return Err(at(line, Problem::Joints));
            }
            if open.len() == limits::DEPTH {
                return Err(at(line, Problem::Depth));
            }
            words.expect("{")?;
            let parent = open.last().and_then(|open| open.map(|(joint, _)| joint));
            open.push(Some((joints.len(), false)));
            let name = name.to_owned();
            joints.push(RawJoint { name, line, parent, offset: DVec3::ZERO, channels: Vec::new() });
            begins = false;
        }
        let Some(inside) = open.last_mut() else {
            return Ok(joints);
        };
        let (line, word) = words.next("OFFSET, CHANNELS, JOINT, End Site or }")?;
        match (word.to_ascii_uppercase().as_str(), inside) {
            ("OFFSET", inside) => {
                let offset = DVec3::new(words.number()?, words.number()?, words.number()?);
                if let Some((joint, has_offset)) = inside {
                    joints[*joint].offset = offset;
                    *has_offset = true;
                }
            }
            ("CHANNELS", Some((joint, _))) => {
                let channels = read_channels(words, &joints[*joint].name)?;
                joints[*joint].channels = channels;
            }
            ("JOINT", Some(_)) => begins = true,
            ("END", Some(_)) => {
                words.name();
                words.expect("{")?;
                open.push(None);
            }
            ("}", inside) => {
                if let Some((joint, false)) = inside {
                    return Err(at(line, Problem::NoOffset(joints[*joint].name.clone())));
                }
                open.pop();
            }
            _ => {
                let expected = "OFFSET, CHANNELS, JOINT, End Site or }";
                return Err(at(line, Problem::Expected { expected, found: word.to_owned() }));
            }
        }
    }
}

fn read_channels(words: &mut Words<'_>, joint: &str) -> Result<Vec<Channel>, BvhError> {
    let (line, found) = words.next("the number of channels")?;
    let count = found.parse().ok().filter(|&count: &usize| count <= 6);
    let count = count.ok_or_else(|| at(line, Problem::ChannelCount { found: found.to_owned() }))?;
    let mut channels = Vec::new();
    for _ in 0..count {
        let (line, found) = words.next("a channel")?;
        let channel = CHANNEL_NAMES.iter().find(|(name, _)| name.eq_ignore_ascii_case(found));
        let &(_, channel) = channel.ok_or_else(|| at(line, Problem::Channel { found: found.to_owned() }))?;
        if channels.contains(&channel) {
            return Err(at(line, Problem::ChannelTwice { joint: joint.to_owned(), found: found.to_owned() }));
        }
        channels.push(channel);
    }
    Ok(channels)
}

fn read_frame_count(words: &mut Words<'_>) -> Result<(usize, usize), BvhError> {
    words.expect("Frames:")?;
    let (line, found) = words.next("the number of frames")?;
    let frames = found.parse().ok().filter(|frames| (1..=limits::FRAMES).contains(frames));
    frames.map(|frames| (frames, line)).ok_or_else(|| at(line, Problem::Frames { found: found.to_owned() }))
}

/// One line per frame; blank lines do not count. What is announced allocates nothing: the numbers must be there.
fn read_frames(words: &Words<'_>, frames: usize, channels: usize) -> Result<Vec<f64>, BvhError> {
    let mut numbers = Vec::new();
    let (mut read, mut last_line) = (0, words.line);
    for (number, text) in words.rest.lines().enumerate() {
        let line = words.line + number;
        if text.trim().is_empty() {
            continue;
        }
        if read == frames {
            return Err(at(line, Problem::FramesLeft { expected: frames }));
        }
        read += 1;
        last_line = line;
        let before = numbers.len();
        for word in text.split_ascii_whitespace() {
            if numbers.len() - before == channels {
                let found = text.split_ascii_whitespace().count();
                return Err(at(line, Problem::FrameLength { frame: read, found, expected: channels }));
            }
            numbers.push(parse_number(line, word)?);
        }
        let found = numbers.len() - before;
        if found < channels {
            return Err(at(line, Problem::FrameLength { frame: read, found, expected: channels }));
        }
    }
    if read < frames {
        return Err(at(last_line, Problem::FramesMissing { expected: frames, found: read }));
    }
    Ok(numbers)
}

fn parse_number(line: usize, found: &str) -> Result<f64, BvhError> {
    let number = found.parse().ok().filter(|number: &f64| number.abs() <= limits::MAGNITUDE);
    number.ok_or_else(|| at(line, Problem::Number { found: found.chars().take(40).collect() }))
}

fn at(line: usize, problem: Problem) -> BvhError {
    BvhError { line, problem }
}

/// The words of a text, with their lines.
struct Words<'a> {
    rest: &'a str,
    line: usize,
}

impl<'a> Words<'a> {
    /// Skips blanks and line ends, counting lines.
    fn skip_blanks(&mut self) {
        let trimmed = self.rest.trim_start();
        self.line += self.rest[..self.rest.len() - trimmed.len()].matches('\n').count();
        self.rest = trimmed;
    }

    fn next(&mut self, expected: &'static str) -> Result<(usize, &'a str), BvhError> {
        self.skip_blanks();
        if self.rest.is_empty() {
            return Err(at(self.line, Problem::End { expected }));
        }
        let (word, rest) = self.rest.split_at(self.rest.find(char::is_whitespace).unwrap_or(self.rest.len()));
        self.rest = rest;
        Ok((self.line, word))
    }

    fn expect(&mut self, expected: &'static str) -> Result<(), BvhError> {
        let (line, found) = self.next(expected)?;
        if found.eq_ignore_ascii_case(expected) {
            return Ok(());
        }
        Err(at(line, Problem::Expected { expected, found: found.chars().take(40).collect() }))
    }

    fn number(&mut self) -> Result<f64, BvhError> {
        let (line, found) = self.next("a number")?;
        parse_number(line, found)
    }

    /// The rest of the line up to an opening brace: names may hold blanks.
    fn name(&mut self) -> (usize, &'a str) {
        let end = self.rest.find(['\n', '{']).unwrap_or(self.rest.len());
        let (name, rest) = self.rest.split_at(end);
        self.rest = rest;
        (self.line, name.trim())
    }
}
