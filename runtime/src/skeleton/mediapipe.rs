//! MediaPipe pose landmarks as JSON to poses. Frames in which nobody was found are held.
//!
//! `{"fps": 30, "frames": [{"t": 0.0, "worldLandmarks": [[x, y, z, visibility], …33] or null}, …]}`. A landmark may be an
//! object `{"x": …, "y": …, "z": …, "visibility": …}` as well; where `t` is absent, `fps` counts (30 if that is absent too).

use super::Skeleton;
use super::positions::{Layout, Measured, Solver};
use super::recording::{Format, MOST_FRAMES, Place, Recording, RecordingError, json_problem, times_from_first};
use serde::Deserialize;

#[derive(Deserialize)]
struct Document {
    fps: Option<f64>,
    frames: Vec<Frame>,
}

#[derive(Deserialize)]
struct Frame {
    t: Option<f64>,
    #[serde(alias = "world_landmarks", alias = "poseWorldLandmarks", rename = "worldLandmarks")]
    world: Option<Vec<Landmark>>,
}

#[derive(Deserialize)]
#[serde(untagged)]
enum Landmark {
    Four([f64; 4]),
    Three([f64; 3]),
    Named { x: f64, y: f64, z: f64, visibility: Option<f64> },
}

impl Landmark {
    fn measured(&self) -> Option<Measured> {
        let (position, visibility) = match *self {
            Landmark::Four([x, y, z, visibility]) => ([x, y, z], visibility),
            Landmark::Three(position) => (position, 1.0),
            Landmark::Named { x, y, z, visibility } => ([x, y, z], visibility.unwrap_or(1.0)),
        };
        Some((position, visibility))
    }
}

/// Reads a recording for this wearer.
///
/// # Errors
/// The frame or line, what is wrong there, and what to do.
pub fn read(bytes: &[u8], wearer: &Skeleton) -> Result<Recording, RecordingError> {
    let bytes = bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes);
    let file: Document = serde_json::from_slice(bytes).map_err(|error| {
        let form = "a MediaPipe recording has \"frames\" with \"worldLandmarks\" of 33 positions each";
        let problem = json_problem(&error, form);
        RecordingError::new(Place::Line(error.line()), problem)
    })?;
    let layout = Layout::MediaPipe33;
    if file.frames.is_empty() || file.frames.len() > MOST_FRAMES {
        let problem = format!("there are {} frames; a recording has 1 to {MOST_FRAMES}", file.frames.len());
        return Err(RecordingError::new(Place::Whole, problem));
    }
    let fps = file.fps.unwrap_or(30.0);
    if !(fps > 0.0 && fps <= 1e4) {
        return Err(RecordingError::new(Place::Whole, "\"fps\" must be above 0 and at most 10000"));
    }
    let mut frames = Vec::with_capacity(file.frames.len());
    for (i, frame) in file.frames.iter().enumerate() {
        let landmarks = frame.world.as_deref().unwrap_or_default();
        if !landmarks.is_empty() && landmarks.len() != layout.joint_count() {
            let problem = format!("{} landmarks instead of 33; use the pose landmarker", landmarks.len());
            return Err(RecordingError::new(Place::Frame(i + 1), problem));
        }
        frames.push(landmarks.iter().map(Landmark::measured).collect::<Vec<_>>());
    }
    let lost = frames.iter().filter(|frame| frame.is_empty()).count();
    if lost == frames.len() {
        let problem = "no frame has \"worldLandmarks\"; record those too, picture coordinates have no depth in metres";
        return Err(RecordingError::new(Place::Whole, problem));
    }
    let given_s = file.frames.iter().enumerate().map(|(i, frame)| frame.t.unwrap_or(i as f64 / fps));
    let times_s = times_from_first(&given_s.collect::<Vec<_>>(), Place::Frame)?;
    let solved = Solver::new(layout, wearer).recording(&times_s, frames.iter().map(Vec::as_slice));
    let notes = if lost == 0 { vec![] } else { vec![format!("nobody was found in {lost} of {} frames", frames.len())] };
    Ok(Recording { format: Format::MediaPipe, frames: solved, times_s, notes })
}
