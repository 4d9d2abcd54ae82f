//! Kinect joints as comma-separated values to poses: a line is the time in ticks of 100 ns, then x, y, z and tracking state of 20 or 25 joints.

use super::Skeleton;
use super::positions::{Layout, Measured, Solver};
use super::recording::{Format, MOST_FRAMES, Place, Recording, RecordingError, times_from_first};

/// How far a joint is believed by its tracking state: not tracked, inferred, tracked.
const CONFIDENCE: [f64; 3] = [0.0, 0.3, 1.0];
const SECONDS_PER_TICK: f64 = 1e-7;

/// Reads a recording for this wearer. Blank lines and a comma at the end of a line are allowed.
///
/// # Errors
/// The line, what is wrong there, and what to do.
pub fn read(bytes: &[u8], wearer: &Skeleton) -> Result<Recording, RecordingError> {
    let text = String::from_utf8_lossy(bytes);
    let mut rows: Vec<(f64, Vec<Option<Measured>>)> = Vec::new();
    for (i, line) in text.lines().enumerate() {
        let line = line.trim().trim_start_matches('\u{feff}').trim_end_matches(',');
        if line.is_empty() {
            continue;
        }
        let wrong = |problem: String| RecordingError::new(Place::Line(i + 1), problem);
        if rows.len() == MOST_FRAMES {
            return Err(wrong(format!("more than {MOST_FRAMES} frames; cut the recording into pieces")));
        }
        let row = numbers(line).map_err(wrong)?;
        let joints: Vec<_> = row[1..].chunks_exact(4).map(measured).collect();
        if rows.first().is_some_and(|(_, first)| first.len() != joints.len()) {
            return Err(wrong("another number of joints than in the first line; record with one sensor".into()));
        }
        rows.push((row[0] * SECONDS_PER_TICK, joints));
    }
    let layout = match rows.first() {
        Some((_, joints)) if joints.len() == Layout::Kinect20.joint_count() => Layout::Kinect20,
        Some(_) => Layout::Kinect25,
        None => return Err(RecordingError::new(Place::Whole, "there is no frame; record again")),
    };
    let ticks_s: Vec<f64> = rows.iter().map(|(time_s, _)| *time_s).collect();
    let times_s = times_from_first(&ticks_s, Place::Line)?;
    let frames = Solver::new(layout, wearer).recording(&times_s, rows.iter().map(|(_, joints)| joints.as_slice()));
    Ok(Recording { format: Format::Kinect, frames, times_s, notes: vec![format!("{} joints", layout.joint_count())] })
}

/// The time and four numbers for each of 20 or 25 joints.
fn numbers(line: &str) -> Result<Vec<f64>, String> {
    let most = 1 + 4 * Layout::Kinect25.joint_count();
    let mut row = Vec::with_capacity(most);
    for word in line.split(',') {
        let number = word.trim().parse().ok().filter(|number: &f64| number.is_finite());
        let shown = || word.chars().take(40).collect::<String>();
        row.push(
            number.ok_or_else(|| format!("{:?} is no number; write x, y, z and state with commas between", shown()))?,
        );
        if row.len() > most {
            break;
        }
    }
    if row.len() != most && row.len() != 1 + 4 * Layout::Kinect20.joint_count() {
        return Err("a line has the time and 4 numbers for each of 20 or 25 joints; export it so".to_owned());
    }
    Ok(row)
}

fn measured(joint: &[f64]) -> Option<Measured> {
    let state = (0..CONFIDENCE.len()).find(|&state| joint[3] == state as f64)?;
    (CONFIDENCE[state] > 0.0).then(|| ([joint[0], joint[1], joint[2]], CONFIDENCE[state]))
}
