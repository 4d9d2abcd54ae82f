//! The recorder: poses as JSON Lines, read back bit for bit; and joint positions in the same form, for trackers that have
//! no format of their own. One JSON object per line, UTF-8.
//!
//! Rotations. The first line is the header, each line after it a frame:
//!
//! ```text
//! {"kitsuke_motion":1,"holds":"rotations"}
//! {"t":0.0,"hips_m":[x,y,z],"bones":{"leftUpperArm":[x,y,z,w,confidence],…}}
//! ```
//!
//! `t` seconds, none before the line ahead of it; `hips_m` translation of the hips from their T-pose place in metres (absent:
//! none); `bones` local rotations relative to the T-pose as unit quaternions by VRM 1.0 name, confidence from 0 to 1. A bone
//! that is absent is in the T-pose with confidence 0. Axes: left +X, up +Y, front +Z.
//!
//! Positions, in axes and units of the layout ([`Layout`]: `mediapipe33`, `kinect20`, `kinect25`, `azure32`), `null` where a
//! joint was not seen; an empty list is a lost frame:
//!
//! ```text
//! {"kitsuke_motion":1,"holds":"positions","layout":"kinect25"}
//! {"t":0.0,"joints":[[x,y,z,confidence],null,…]}
//! ```

use super::positions::{Layout, Measured, Solver};
use super::recording::{Format, MOST_FRAMES, Place, Recording, RecordingError, json_problem, times_from_first};
use super::tracked::Tracked;
use super::{Bone, Skeleton};
use glam::{Quat, Vec3};
use serde::Deserialize;
use std::collections::BTreeMap;
use std::fmt::Write;

const VERSION: u32 = 1;

/// What lines look like, for messages.
const HEADER: &str = r#"{"kitsuke_motion":1,"holds":"rotations"}"#;
const ROTATIONS: &str = r#"{"t":0.0,"hips_m":[x,y,z],"bones":{"leftUpperArm":[x,y,z,w,confidence]}}"#;
const POSITIONS: &str = r#"{"t":0.0,"joints":[[x,y,z,confidence],null]}"#;

#[derive(Deserialize)]
struct Header {
    kitsuke_motion: u32,
    holds: String,
    layout: Option<String>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct RotationsLine {
    t: f64,
    #[serde(default)]
    hips_m: [f32; 3],
    bones: BTreeMap<String, [f32; 5]>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct PositionsLine {
    t: f64,
    joints: Vec<Option<[f64; 4]>>,
}

/// The first line of a recording of rotations, with its line end.
#[must_use]
pub fn header() -> String {
    format!("{{\"kitsuke_motion\":{VERSION},\"holds\":\"rotations\"}}\n")
}

/// Appends a frame at this time (seconds, finite, none before the one written last) as a line.
///
/// # Panics
/// When the pose is not valid or the time not finite, because JSON has no such numbers.
pub fn write_frame(out: &mut String, time_s: f64, tracked: &Tracked) {
    let Tracked { pose, confidence } = tracked;
    assert!(time_s.is_finite() && pose.is_valid() && confidence.iter().all(|c| c.is_finite()), "finite numbers");
    // Debug formatting gives the shortest decimal that reads back as the same bits.
    let Vec3 { x, y, z } = pose.hips_translation_m;
    _ = write!(out, "{{\"t\":{time_s:?},\"hips_m\":[{x:?},{y:?},{z:?}],\"bones\":{{");
    let mut first = true;
    for bone in Bone::ALL {
        let ([x, y, z, w], confidence) = (pose.rotation(bone).to_array(), confidence[bone as usize]);
        let is_unseen = [x, y, z, w, confidence].map(f32::to_bits) == [0.0, 0.0, 0.0, 1.0, 0.0].map(f32::to_bits);
        if !is_unseen {
            let comma = if first { "" } else { "," };
            _ = write!(out, "{comma}\"{}\":[{x:?},{y:?},{z:?},{w:?},{confidence:?}]", bone.name());
            first = false;
        }
    }
    out.push_str("}}\n");
}

/// Reads a recording for this wearer; poses that were recorded as rotations are for any wearer.
///
/// # Errors
/// The line, what is wrong there, and what to do.
pub fn read(bytes: &[u8], wearer: &Skeleton) -> Result<Recording, RecordingError> {
    let bytes = bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes);
    let lines = bytes.split(|&byte| byte == b'\n').enumerate().map(|(i, line)| (i + 1, line.trim_ascii()));
    let mut lines = lines.filter(|(_, line)| !line.is_empty());
    let wrong = |line: usize, problem: String| RecordingError::new(Place::Line(line), problem);
    let (line, text) = lines.next().ok_or_else(|| wrong(1, "the file is empty; record again".into()))?;
    let header: Header = parse(line, text, HEADER)?;
    if header.kitsuke_motion != VERSION {
        return Err(wrong(
            line,
            format!("version {} is not known, only {VERSION}; record again", header.kitsuke_motion),
        ));
    }
    let layout = match (header.holds.as_str(), header.layout.as_deref()) {
        ("rotations", _) => None,
        ("positions", Some(name)) if Layout::from_name(name).is_some() => Layout::from_name(name),
        ("positions", _) => {
            let known = Layout::ALL.map(Layout::name).join(", ");
            return Err(wrong(line, format!("\"layout\" must be one of {known}")));
        }
        _ => return Err(wrong(line, "\"holds\" must be \"rotations\" or \"positions\"".into())),
    };
    let (mut given_s, mut frames, mut joints) = (Vec::new(), Vec::new(), Vec::new());
    let mut frame_lines = Vec::new();
    for (line, text) in lines {
        if given_s.len() == MOST_FRAMES {
            return Err(wrong(line, format!("more than {MOST_FRAMES} frames; cut the recording into pieces")));
        }
        match layout {
            None => {
                let frame: RotationsLine = parse(line, text, ROTATIONS)?;
                frames.push(tracked(&frame).map_err(|problem| wrong(line, problem))?);
                given_s.push(frame.t);
            }
            Some(layout) => {
                let frame: PositionsLine = parse(line, text, POSITIONS)?;
                if !frame.joints.is_empty() && frame.joints.len() != layout.joint_count() {
                    let (found, expected) = (frame.joints.len(), layout.joint_count());
                    return Err(wrong(line, format!("{found} joints instead of {expected}; correct the layout")));
                }
                let measured = |joint: &Option<[f64; 4]>| joint.map(|[x, y, z, confidence]| ([x, y, z], confidence));
                joints.push(frame.joints.iter().map(measured).collect::<Vec<Option<Measured>>>());
                given_s.push(frame.t);
            }
        }
        frame_lines.push(line);
    }
    if given_s.is_empty() {
        return Err(wrong(line, "there is no frame after the header; record again".into()));
    }
    let times_s = times_from_first(&given_s, Place::Frame).map_err(|error| match error.place {
        Place::Frame(frame) => RecordingError { place: Place::Line(frame_lines[frame - 1]), ..error },
        _ => error,
    })?;
    if let Some(layout) = layout {
        frames = Solver::new(layout, wearer).recording(&times_s, joints.iter().map(Vec::as_slice));
    }
    Ok(Recording { format: Format::JsonLines, times_s, frames, notes: vec![] })
}

fn parse<'a, T: Deserialize<'a>>(line: usize, text: &'a [u8], form: &str) -> Result<T, RecordingError> {
    serde_json::from_slice(text).map_err(|error| {
        RecordingError::new(Place::Line(line), json_problem(&error, &format!("a line is like {form}")))
    })
}

fn tracked(line: &RotationsLine) -> Result<Tracked, String> {
    let mut tracked = Tracked::UNSEEN;
    tracked.pose.hips_translation_m = Vec3::from_array(line.hips_m);
    for (name, &[x, y, z, w, confidence]) in &line.bones {
        let bone = Bone::from_name(name).ok_or_else(|| format!("{name:?} is no bone; use VRM 1.0 names"))?;
        if !(0.0..=1.0).contains(&confidence) {
            return Err(format!("the confidence of {name} is {confidence}; it goes from 0 to 1"));
        }
        tracked.pose.rotations[bone as usize] = Quat::from_xyzw(x, y, z, w);
        tracked.confidence[bone as usize] = confidence;
    }
    if !tracked.pose.is_valid() {
        return Err("a rotation is no unit quaternion or a number is not finite; normalise the rotations".into());
    }
    Ok(tracked)
}
