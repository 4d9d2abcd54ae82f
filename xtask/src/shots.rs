//! Poses from tables and recordings, as shots to evaluate or draw.

use glam::Vec3;
use kitsuke::Garment;
use kitsuke::pose_blend::Kernel;
use kitsuke::skeleton::bvh;
use kitsuke::skeleton::filter::{Filter, Holt, OneEuro};
use kitsuke::skeleton::recording::{self, Recording};
use kitsuke::skeleton::{Pose, Skeleton};
use kitsuke_pipeline::diagnostic::{Diagnostic, Place};
use kitsuke_pipeline::look::frames::{Blend, Shot};
use kitsuke_pipeline::source::tables;
use std::fs;
use std::path::Path;

/// Longest table or recording that is read, bytes.
const FILE_BYTES: u64 = 256 << 20;
/// Longest motion that is written, frames: an hour at thirty a second.
const MOST_FRAMES: usize = 108_000;

/// A row of a pose table.
pub struct Row {
    pub shot: Shot,
    /// The row's `file`, if that exists beside the table.
    pub file: Option<String>,
}

/// The rows of a pose table, blended by this kernel. Only rotation columns are needed.
pub fn pose_table(path: &Path, kernel: Kernel) -> Result<Vec<Row>, String> {
    let mut report = Vec::new();
    let table = tables::read_rotations(&path.to_string_lossy(), &read(path)?, &mut report);
    let table = table.ok_or_else(|| said(&report))?;
    let row = |(i, (row, pose)): (usize, (&tables::PoseRow, Pose))| {
        let name = if row.name.is_empty() { format!("row_{i}") } else { row.name.clone() };
        let exists = !row.file.is_empty() && path.with_file_name("").join(&row.file).is_file();
        Row { shot: Shot { name, pose, blend: Blend::Kernel(kernel) }, file: exists.then(|| row.file.clone()) }
    };
    Ok(table.rows.iter().zip(table.poses()).enumerate().map(row).collect())
}

/// How a recorded motion is played.
#[derive(Clone, Copy, clap::Args)]
pub struct How {
    /// Apply the recorded translation of the hips
    #[arg(long, requires = "motion")]
    root_motion: bool,
    /// Smooth the recorded motion, as `play --filter` does a live one
    #[arg(long, requires = "motion")]
    filter: Option<FilterName>,
    /// Pose the wearer as recorded, even where the kimono would not let her
    #[arg(long, requires = "motion")]
    as_recorded: bool,
    #[command(flatten)]
    read_as: ReadAs,
}

impl How {
    /// As the kimono lets her, the hips in place.
    pub fn plain(read_as: ReadAs) -> How {
        How { root_motion: false, filter: None, as_recorded: false, read_as }
    }
}

/// How a BVH file is read where its own evidence leaves that open.
#[derive(Clone, Copy, clap::Args)]
pub struct ReadAs {
    /// The axis of a BVH file that points up: +X, -X, +Y, -Y, +Z or -Z [default: the one that its frames stand along]
    #[arg(long, value_name = "AXIS", requires = "motion", allow_hyphen_values = true)]
    up: Option<bvh::Axis>,
    /// Where the T-pose of a BVH file comes from: offsets, first-frame or directions (where bones point in the world over all frames)
    /// [default: OFFSETs or first frame if they are one, else directions]
    #[arg(long, value_name = "WHAT", requires = "motion")]
    rest: Option<bvh::Rest>,
}

impl ReadAs {
    fn options(self) -> bvh::Options {
        bvh::Options { up: self.up, rest: self.rest }
    }
}

/// The frames of a recorded motion on the garment's wearer, blended by this kernel.
pub fn motion(path: &Path, garment: &Garment, kernel: Kernel, how: How) -> Result<Vec<Shot>, String> {
    let recording = smoothed(path, garment, how)?;
    let poses = as_let(path, recording.frames.into_iter().map(|frame| frame.pose), garment, how);
    let shot = |(i, pose)| Shot { name: format!("frame_{i:05}"), pose, blend: Blend::Kernel(kernel) };
    Ok(poses.into_iter().enumerate().map(shot).collect())
}

/// A recorded motion at equal steps of time: when, seconds from its beginning, and how the wearer stands then.
pub fn sampled(path: &Path, garment: &Garment, fps: f64, how: How) -> Result<(Vec<f32>, Vec<Pose>), String> {
    let recording = smoothed(path, garment, how)?;
    let (Some(first_s), Some(last_s)) = (recording.times_s.first(), recording.times_s.last()) else {
        return Err(format!("{} has no frames", path.display()));
    };
    let frames = ((last_s - first_s) * fps).floor() as usize + 1;
    if frames > MOST_FRAMES {
        return Err(format!(
            "{} lasts {:.0} s, which is {frames} frames at {fps} a second, and no more than {MOST_FRAMES} are written: ask for fewer with --fps, \
             or cut the recording",
            path.display(),
            last_s - first_s
        ));
    }
    let poses = (0..frames).map(|frame| recording.pose_at(first_s + frame as f64 / fps));
    let times_s = (0..frames).map(|frame| (frame as f64 / fps) as f32).collect();
    Ok((times_s, as_let(path, poses, garment, how)))
}

fn smoothed(path: &Path, garment: &Garment, how: How) -> Result<Recording, String> {
    let recording = recording(path, &garment.data().skeleton, how.read_as)?;
    Ok(match how.filter {
        Some(filter) => recording.filtered(&filter.filter()),
        None => recording,
    })
}

/// The poses as the kimono lets the wearer stand, with a note where that is far from how she stood.
fn as_let(path: &Path, poses: impl Iterator<Item = Pose>, garment: &Garment, how: How) -> Vec<Pose> {
    let mut turned_rad = 0.0f32;
    let mut posed = |mut pose: Pose| {
        if !how.root_motion {
            pose.hips_translation_m = Vec3::ZERO;
        }
        if how.as_recorded {
            return pose;
        }
        let limited = garment.limited(&pose);
        turned_rad = turned_rad.max(limited.turned_rad);
        limited.pose
    };
    let poses = poses.map(&mut posed).collect();
    if turned_rad.to_degrees() > 5.0 {
        let degrees = turned_rad.to_degrees();
        eprintln!(
            "note: {}: the kimono holds joints back by up to {degrees:.0} degrees; --as-recorded does not",
            path.display()
        );
    }
    poses
}

/// Every how many frames one is taken, so that of these no more than `most` are, evenly spaced.
pub fn step(frames: usize, most: usize) -> usize {
    frames.div_ceil(most).max(1)
}

/// Reads a recorded motion of any known format, and says how it was understood, so that a wrong guess is seen.
pub fn recording(path: &Path, wearer: &Skeleton, read_as: ReadAs) -> Result<Recording, String> {
    let recording = recording::read_with(&read(path)?, wearer, read_as.options());
    let recording = recording.map_err(|error| format!("{}: {error}", path.display()))?;
    for note in &recording.notes {
        eprintln!("note: {}: {note}", path.display());
    }
    Ok(recording)
}

/// All bytes of a file of reasonable length.
pub fn read(path: &Path) -> Result<Vec<u8>, String> {
    let unreadable = |error| format!("cannot read {}: {error}", path.display());
    let length = fs::metadata(path).map_err(unreadable)?.len();
    if length > FILE_BYTES {
        return Err(format!("{} is longer than {} MB", path.display(), FILE_BYTES >> 20));
    }
    fs::read(path).map_err(unreadable)
}

/// Diagnostics as plain lines, the first 20 of them.
pub fn said(report: &[Diagnostic]) -> String {
    let line = |d: &Diagnostic| {
        let place = if let Place::Line(line) = d.place { format!(":{line}") } else { String::new() };
        format!("{}{place}: {}. {}", d.file, d.problem, d.help)
    };
    let mut lines: Vec<String> = report.iter().take(20).map(line).collect();
    if report.len() > lines.len() {
        lines.push(format!("… and {} more", report.len() - lines.len()));
    }
    lines.join("\n")
}

/// A kernel by its name on the command line.
#[derive(Clone, Copy, clap::ValueEnum)]
pub enum KernelName {
    /// The paper's: normalised inverse pose differences among the similar samples, driver by driver
    Paper,
    /// The garment's own
    Default,
    /// Exact at the samples and smooth between them
    Rbf,
}

impl KernelName {
    /// The named kernel, or the garment's own.
    pub fn of(name: Option<KernelName>, garment: &Garment) -> Result<Kernel, String> {
        match name {
            Some(KernelName::Paper) => Ok(Kernel::Paper),
            Some(KernelName::Rbf) if garment.kernel() != Kernel::Rbf => {
                Err("this pack holds no kernel fitted to its samples; use --kernel paper".into())
            }
            Some(KernelName::Rbf) => Ok(Kernel::Rbf),
            None | Some(KernelName::Default) => Ok(garment.kernel()),
        }
    }
}

/// A filter by its name on the command line.
#[derive(Clone, Copy, clap::ValueEnum)]
pub enum FilterName {
    /// A low pass that opens as the turn gets faster
    OneEuro,
    /// Double exponential, the Kinect's
    Holt,
}

impl FilterName {
    /// The filter with its usual values.
    pub fn filter(self) -> Filter {
        match self {
            FilterName::OneEuro => Filter::OneEuro(OneEuro::default()),
            FilterName::Holt => Filter::Holt(Holt::default()),
        }
    }
}
