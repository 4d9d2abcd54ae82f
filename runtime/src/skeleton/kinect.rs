//! Kinect joints as comma-separated values to poses: a line is the time in ticks of 100 ns, then x, y, z and tracking state of 20 or 25 joints.

use super::Skeleton;
use super::positions::{Layout, Measured, Solver};
use super::recording::{Format, MOST_FRAMES, Place, Recording, RecordingError, times_from_first};

/// How far a joint is believed by its tracking state: not tracked, inferred, tracked.
const CONFIDENCE: [f64; 3] = [0.0, 0.3, 1.0];
const SECONDS_PER_TICK: f64 = 1e-7;

/// Whether text without a byte order mark may be such a table: its first or second line begins with a number and has several.
pub(super) fn is_table(text: &[u8]) -> bool {
    let mut lines = text.split(|&byte| byte == b'\n').map(<[u8]>::trim_ascii).filter(|line| !line.is_empty());
    let is_row = |line: &[u8]| line[0].is_ascii_digit() && line.iter().any(|&byte| byte == b',' || byte == b';');
    let joints = |line: &[u8]| {
        let numbers = String::from_utf8_lossy(line);
        is_row(line) && is_length(words(&numbers).count())
    };
    lines.next().is_some_and(is_row) || lines.next().is_some_and(joints)
}

/// Whether a line of so many numbers has the time and all joints.
fn is_length(numbers: usize) -> bool {
    [Layout::Kinect20, Layout::Kinect25].iter().any(|layout| numbers == 1 + 4 * layout.joint_count())
}

/// The parts of a line: between semicolons if there are any, with decimal commas as some countries write them, else between commas.
fn words(line: &str) -> impl Iterator<Item = std::borrow::Cow<'_, str>> {
    let separator = if line.contains(';') { ';' } else { ',' };
    let line = line.trim().trim_end_matches(separator);
    line.split(separator).map(|word| match word.contains(',') {
        true => word.trim().replace(',', ".").into(),
        false => word.trim().into(),
    })
}

/// Reads a recording for this wearer. Blank lines, a line of headings at the top, semicolons instead of commas and a comma at the
/// end of a line are allowed.
///
/// # Errors
/// The line, what is wrong there, and what to do.
pub fn read(bytes: &[u8], wearer: &Skeleton) -> Result<Recording, RecordingError> {
    let text = String::from_utf8_lossy(bytes);
    let mut rows: Vec<(f64, Vec<Option<Measured>>)> = Vec::new();
    let mut is_top = true;
    for (i, line) in text.lines().enumerate() {
        let line = line.trim().trim_start_matches('\u{feff}');
        let is_headings = is_top && line.starts_with(|c: char| c.is_alphabetic() || c == '"' || c == '#');
        if line.is_empty() || is_headings {
            is_top &= line.is_empty();
            continue;
        }
        is_top = false;
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
    for word in words(line) {
        let number = word.parse().ok().filter(|number: &f64| number.is_finite());
        let shown = || word.chars().take(40).collect::<String>();
        row.push(number.ok_or_else(|| {
            format!("{:?} is no number; write x, y, z and state with commas or semicolons between", shown())
        })?);
        if row.len() > most {
            break;
        }
    }
    if !is_length(row.len()) {
        return Err("a line has the time and 4 numbers for each of 20 or 25 joints; export it so".to_owned());
    }
    Ok(row)
}

fn measured(joint: &[f64]) -> Option<Measured> {
    let state = (0..CONFIDENCE.len()).find(|&state| joint[3] == state as f64)?;
    (CONFIDENCE[state] > 0.0).then(|| ([joint[0], joint[1], joint[2]], CONFIDENCE[state]))
}
