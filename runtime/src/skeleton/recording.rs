//! A recorded motion of any known format, told apart by its content. Knows the formats only by their readers. Pure: bytes in, poses out.

use super::filter::{Filter, FilterState};
use super::tracked::Tracked;
use super::{Pose, Skeleton, bvh, deepmimic, jsonl, kinect, mediapipe, vrma};

/// Poses of one wearer over time.
#[derive(Clone, Debug, PartialEq)]
pub struct Recording {
    /// What the bytes were.
    pub format: Format,
    /// Seconds of each frame, none before the one ahead of it, the first at 0; as many as `frames`, at least 1.
    pub times_s: Vec<f64>,
    /// Rotations relative to the T-pose.
    pub frames: Vec<Tracked>,
    /// How the file was understood where it left that open, each a sentence without a full stop.
    pub notes: Vec<String>,
}

/// The formats that are read.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Format {
    /// Biovision hierarchy.
    Bvh,
    /// Binary glTF with `VRMC_vrm_animation` (.vrma), or an animated VRM 1.0 or 0.x.
    Gltf,
    /// The recorder's own lines, rotations or positions.
    JsonLines,
    /// MediaPipe pose landmarks.
    MediaPipe,
    /// DeepMimic reference motion.
    DeepMimic,
    /// Kinect joints as comma-separated values.
    Kinect,
}

/// Most frames of a recording: 18 minutes at 120 Hz.
pub const MOST_FRAMES: usize = 1 << 17;
/// Longest recording, seconds.
pub const LONGEST_S: f64 = 86_400.0;

/// Why bytes are no usable recording.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("{place}{problem}")]
pub struct RecordingError {
    /// Where.
    pub place: Place,
    /// What is wrong there, and what to do.
    pub problem: String,
}

/// A place in a recording.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Place {
    /// Nowhere in particular.
    Whole,
    /// A line, counted from 1.
    Line(usize),
    /// A frame, counted from 1.
    Frame(usize),
}

impl std::fmt::Display for Place {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Place::Whole => Ok(()),
            Place::Line(line) => write!(f, "line {line}: "),
            Place::Frame(frame) => write!(f, "frame {frame}: "),
        }
    }
}

impl RecordingError {
    pub(super) fn new(place: Place, problem: impl Into<String>) -> RecordingError {
        RecordingError { place, problem: problem.into() }
    }
}

/// What the bytes are by their first characters (for JSON, by their keys), or nothing that is known.
#[must_use]
pub fn format_of(bytes: &[u8]) -> Option<Format> {
    if bytes.starts_with(b"glTF") {
        return Some(Format::Gltf);
    }
    let text = without_mark(bytes).trim_ascii_start();
    if text.first()? == &b'{' {
        let keys = keys(text);
        let has = |key: &str| keys.contains(&key.as_bytes());
        return match () {
            () if has("kitsuke_motion") => Some(Format::JsonLines),
            () if has("Frames") => Some(Format::DeepMimic),
            () if has("frames") => Some(Format::MediaPipe),
            () => None,
        };
    }
    let is_bvh = text.len() >= 9 && text[..9].eq_ignore_ascii_case(b"HIERARCHY");
    match () {
        () if is_bvh => Some(Format::Bvh),
        () if kinect::is_table(text) => Some(Format::Kinect),
        () => None,
    }
}

/// Text without a byte order mark.
fn without_mark(bytes: &[u8]) -> &[u8] {
    bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes)
}

/// Keys of the outermost object of a JSON text, as written, up to where it ends or is cut off.
fn keys(text: &[u8]) -> Vec<&[u8]> {
    let (mut keys, mut depth, mut at, mut last) = (Vec::new(), 0_usize, 0, None);
    while let Some(&byte) = text.get(at) {
        match byte {
            b'{' | b'[' => depth += 1,
            b'}' | b']' if depth <= 1 => break,
            b'}' | b']' => depth -= 1,
            b':' if depth == 1 => keys.extend(last.take()),
            b'"' => {
                let start = at + 1;
                at = start;
                while text.get(at).is_some_and(|&byte| byte != b'"') {
                    at += if text[at] == b'\\' { 2 } else { 1 };
                }
                last = text.get(start..at);
            }
            _ => {}
        }
        at += 1;
    }
    keys
}

/// Why nothing known is in the bytes.
fn unknown(bytes: &[u8]) -> RecordingError {
    let known = "known are BVH, .vrma and VRM (binary glTF), JSON Lines, MediaPipe and DeepMimic JSON, and Kinect joints as \
                 comma-separated values";
    let text = without_mark(bytes).trim_ascii_start();
    let keys = if text.starts_with(b"{") { keys(text) } else { Vec::new() };
    let problem = match keys.as_slice() {
        [] => format!("this is no recording that is known; {known}"),
        keys if keys.contains(&b"asset".as_slice()) => {
            "this is glTF as text; export it as binary glTF (.vrma, .vrm or .glb), which holds its animation".to_owned()
        }
        keys => {
            let shown = keys.iter().take(6).map(|key| {
                let key = String::from_utf8_lossy(&key[..key.len().min(30)]);
                format!("\"{key}\"")
            });
            let shown = shown.collect::<Vec<String>>().join(", ");
            format!(
                "this JSON is no recording that is known: it has {shown}, but MediaPipe's have \"frames\", DeepMimic's \"Frames\", and \
                 JSON Lines begin with \"kitsuke_motion\""
            )
        }
    };
    RecordingError::new(Place::Whole, problem)
}

/// What is wrong with a JSON text, without the line and column, which the place of the error says, and with what to do.
pub(super) fn json_problem(error: &serde_json::Error, form: &str) -> String {
    let whole = error.to_string();
    let problem = whole.rfind(" at line ").map_or(whole.as_str(), |end| &whole[..end]);
    if error.is_eof() {
        format!("it ends in the middle ({problem}); the file or line is cut off, copy or record it again")
    } else {
        format!("{problem} (column {}); {form}", error.column())
    }
}

/// Reads a recording for this wearer.
///
/// # Errors
/// What is wrong, where, and what to do.
pub fn read(bytes: &[u8], wearer: &Skeleton) -> Result<Recording, RecordingError> {
    read_with(bytes, wearer, bvh::Options::default())
}

/// The same where the caller decides some of what BVH leaves open. Other formats leave neither axes nor T-pose open: with them,
/// options that decide something are refused.
///
/// # Errors
/// What is wrong, where, and what to do.
pub fn read_with(bytes: &[u8], wearer: &Skeleton, options: bvh::Options) -> Result<Recording, RecordingError> {
    let format = format_of(bytes);
    if format.is_some_and(|format| format != Format::Bvh) && options != bvh::Options::default() {
        return Err(RecordingError::new(
            Place::Whole,
            "--up and --rest decide how BVH is read; leave them out, this is no BVH",
        ));
    }
    let recording = match format {
        Some(Format::Bvh) => read_bvh(bytes, wearer, options)?,
        Some(Format::Gltf) => vrma::read(bytes, wearer)?,
        Some(Format::JsonLines) => jsonl::read(bytes, wearer)?,
        Some(Format::MediaPipe) => mediapipe::read(bytes, wearer)?,
        Some(Format::DeepMimic) => deepmimic::read(bytes, wearer)?,
        Some(Format::Kinect) => kinect::read(bytes, wearer)?,
        None => return Err(unknown(bytes)),
    };
    debug_assert!(recording.frames.len() == recording.times_s.len() && !recording.frames.is_empty());
    Ok(recording)
}

impl Recording {
    /// The motion as a filter smooths it when its frames come at their times.
    #[must_use]
    pub fn filtered(&self, filter: &Filter) -> Recording {
        let mut state = FilterState::default();
        let mut before_s = 0.0;
        let frame = |(time_s, tracked): (&f64, &Tracked)| {
            let passed_s = time_s - std::mem::replace(&mut before_s, *time_s);
            filter.apply(&mut state, tracked, passed_s)
        };
        let frames = self.times_s.iter().zip(&self.frames).map(frame).collect();
        Recording { frames, ..self.clone() }
    }

    /// The pose at a time, seconds from the first frame: before it and after the last one these, between two frames every rotation the
    /// shorter way.
    #[must_use]
    pub fn pose_at(&self, time_s: f64) -> Pose {
        let after = self.times_s.partition_point(|&frame_s| frame_s <= time_s);
        let [before, after] = [after.saturating_sub(1), after.min(self.frames.len() - 1)];
        let [before_s, after_s] = [self.times_s[before], self.times_s[after]];
        let [before, after] = [&self.frames[before].pose, &self.frames[after].pose];
        if after_s <= before_s {
            return before.clone();
        }
        let share = ((time_s - before_s) / (after_s - before_s)) as f32;
        let mut pose = before.clone();
        for (rotation, &after) in pose.rotations.iter_mut().zip(&after.rotations) {
            *rotation = rotation.slerp(after, share);
        }
        pose.hips_translation_m = before.hips_translation_m.lerp(after.hips_translation_m, share);
        pose
    }
}

/// Checks and rebases the times of a recording: finite, in order, the first at 0.
pub(super) fn times_from_first(times_s: &[f64], place: fn(usize) -> Place) -> Result<Vec<f64>, RecordingError> {
    let first_s = times_s.first().copied().unwrap_or(0.0);
    let mut last_s = 0.0;
    let rebase = |(i, &time_s): (usize, &f64)| {
        let time_s = time_s - first_s;
        if !(time_s >= last_s && time_s <= LONGEST_S) {
            let problem =
                "its time lies before the frame ahead of it or beyond a day; correct the times or cut the recording";
            return Err(RecordingError::new(place(i + 1), problem));
        }
        last_s = time_s;
        Ok(time_s)
    };
    times_s.iter().enumerate().map(rebase).collect()
}

fn read_bvh(bytes: &[u8], wearer: &Skeleton, options: bvh::Options) -> Result<Recording, RecordingError> {
    let motion = bvh::read_with(bytes, wearer, options)
        .map_err(|error| RecordingError::new(Place::Line(error.line), error.problem.to_string()))?;
    let mut notes = motion.notes;
    notes.extend(unmapped_note(&motion.unmapped));
    Ok(Recording {
        format: Format::Bvh,
        times_s: (0..motion.poses.len()).map(|frame| frame as f64 * motion.frame_time_s).collect(),
        frames: motion.poses.into_iter().map(Tracked::certain).collect(),
        notes,
    })
}

/// So many joints of a recording are named in a note.
const SHOWN_JOINTS: usize = 12;

/// Says which joints are no bone, if there are any.
pub(super) fn unmapped_note(unmapped: &[String]) -> Option<String> {
    let (shown, more) = unmapped.split_at(unmapped.len().min(SHOWN_JOINTS));
    let more = if more.is_empty() { String::new() } else { format!(" and {} more", more.len()) };
    (!shown.is_empty()).then(|| format!("joints that are no bone of the wearer: {}{more}", shown.join(", ")))
}
