//! `cargo xtask audit`: how deep the cloth lies in the wearer's body, over many poses.

use crate::places::{Places, ended, say, write_whole};
use crate::shots;
use crate::wearers::Wearer;
use kitsuke::skeleton::Pose;
use kitsuke::{Garment, Limited};
use kitsuke_pipeline::ir::{self, Body};
use kitsuke_pipeline::look::frames::{Blend, Shot, Stage, own_poses};
use kitsuke_pipeline::look::scene::{Colours, Framing, Scene, View};
use kitsuke_pipeline::look::sheet::{Cell, contact_sheet, png_bytes};
use kitsuke_pipeline::measure::audit::{Audit, CLASSES_M, Depth, audit, deepest, pose_depths};
use kitsuke_pipeline::measure::pose_space;
use kitsuke_pipeline::measure::skirt::Legs;
use std::path::PathBuf;
use std::process::ExitCode;
use std::time::Instant;

/// Measure how deep the cloth lies in the wearer, and draw the worst pose
#[derive(clap::Args)]
#[command(mut_arg("body", |body| body.requires("wearer").help(BODY)))]
pub struct Args {
    /// A kimono's ID
    #[arg(value_name = "ID", default_value = "komon")]
    garment: String,
    /// How many poses, always the same ones
    #[arg(long, default_value_t = 2000, value_parser = clap::value_parser!(u32).range(1..=1_000_000))]
    poses: u32,
    /// Measure instead how far the legs lie outside the skirt in recorded motions
    #[arg(long, value_name = "FILE,…", value_delimiter = ',', num_args = 1.., conflicts_with = "poses")]
    motion: Vec<PathBuf>,
    /// Look at no more frames of a motion than this, evenly spaced
    #[arg(long, default_value_t = 200, value_parser = clap::value_parser!(u32).range(1..), requires = "motion")]
    frames: u32,
    /// Pose the wearer as recorded, even where the kimono would not let her
    #[arg(long, requires = "motion")]
    as_recorded: bool,
    #[command(flatten)]
    wearer: Wearer,
    /// Where the picture goes [default: reports/ in --catalog]
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    #[command(flatten)]
    read_as: shots::ReadAs,
    #[command(flatten)]
    places: Places,
}

/// What `--body` does here.
const BODY: &str = "Fit the kimono to the Nth body of a table, from 1, and measure it on that body";

/// Deeper than this is marked red, metres.
const MARKED_M: f32 = 0.002;

/// Measures; 1 when something cannot be read or written.
pub fn run(args: Args) -> ExitCode {
    ended(report(&args))
}

fn report(args: &Args) -> Result<(), String> {
    let pack = args.places.open(&args.garment)?;
    let (garment, source) = args.wearer.garment_and_source(&args.places, &pack)?;
    let source = source.ok_or("the body is needed to measure against")?;
    if !args.motion.is_empty() {
        return motions(args, &garment, &source);
    }
    let poses = pose_space::poses(&garment, 0, args.poses as usize);
    let began = Instant::now();
    let found = audit(&source.body, &garment, &poses);
    say!("{} poses in {:.0} s", poses.len(), began.elapsed().as_secs_f64());
    print_audit(&garment, &source.body, &found);
    print_samples(&garment, &source.body);

    let picture = draw(&garment, &source, &poses, &found)?;
    let name = [Some(garment.data().id.clone()), args.wearer.file_part()].into_iter().flatten();
    let name = format!("{}-audit.png", name.collect::<Vec<_>>().join("_"));
    let path = args.out.clone().unwrap_or_else(|| args.places.catalog.join("reports")).join(name);
    write_whole(&path, |out| out.write_all(&picture))?;
    say!("{}", path.display());
    Ok(())
}

/// A line per motion: how far the legs lie outside the skirt, and how often the kimono held them back.
fn motions(args: &Args, garment: &Garment, source: &ir::Garment) -> Result<(), String> {
    const HELD_RAD: f32 = 5.0 * std::f32::consts::PI / 180.0;
    say!(
        "{:32} {:>6} {:>9} {:>9} {:>9} {:>11} {:>9}",
        "legs outside, mm",
        "frames",
        "median",
        "95 %",
        "max",
        "held > 5°",
        "held max"
    );
    let legs = Legs::new(garment, source);
    for path in &args.motion {
        let recording = shots::recording(path, &garment.data().skeleton, args.read_as)?;
        let step = shots::step(recording.frames.len(), args.frames as usize);
        let frames = recording.frames.iter().step_by(step);
        let limited: Vec<Limited> = frames.map(|frame| garment.limited(&frame.pose)).collect();
        let recorded = recording.frames.iter().step_by(step).map(|frame| frame.pose.sanitised());
        let poses: Vec<Pose> = if args.as_recorded {
            recorded.collect()
        } else {
            limited.iter().map(|limited| limited.pose.clone()).collect()
        };
        let outside = legs.outside(&poses);
        let mut sorted: Vec<f32> = outside.iter().map(|outside| outside.distance_m * 1e3).collect();
        sorted.sort_by(f32::total_cmp);
        let at = |share: f64| sorted[((sorted.len() as f64 * share) as usize).min(sorted.len() - 1)];
        let held = limited.iter().filter(|limited| limited.turned_rad > HELD_RAD).count();
        let most_deg = limited.iter().map(|limited| limited.turned_rad).fold(0.0, f32::max).to_degrees();
        let worst =
            (0..outside.len()).max_by(|&a, &b| outside[a].distance_m.total_cmp(&outside[b].distance_m)).unwrap_or(0);
        say!(
            "{:32} {:6} {:9.2} {:9.2} {:9.2} {:9.1} % {:8.0}°  frame {}, skin vertex {}",
            path.file_name().unwrap_or_default().to_string_lossy(),
            poses.len(),
            at(0.5),
            at(0.95),
            at(1.0),
            100.0 * held as f64 / poses.len() as f64,
            most_deg,
            worst * step,
            outside[worst].vertex,
        );
    }
    Ok(())
}

fn print_audit(garment: &Garment, body: &Body, found: &Audit) {
    for least_mm in [2, 5] {
        let beyond = found.poses_beyond(least_mm as f32 * 1e-3);
        let share = 100.0 * beyond as f64 / found.by_pose.len().max(1) as f64;
        say!("{share:5.1} % of the poses have cloth deeper than {least_mm} mm in the body");
    }
    say!("the worst:");
    for worst in found.worst_poses().iter().take(10) {
        say!("  {}", described(garment, body, worst));
    }
    say!("vertices of all poses by depth:");
    let ends = CLASSES_M.iter().map(|end_m| format!("up to {} mm", end_m * 1e3));
    for (end, count) in ends.chain(["deeper".to_owned()]).zip(found.classes) {
        say!("  {end:<12} {count:>9} vertices");
    }
}

/// At the samples the cloth of the base is as the artist made it, that of a fitted kimono as it was transferred.
fn print_samples(garment: &Garment, body: &Body) {
    say!("at the samples:");
    for (number, shot) in own_poses(garment).iter().enumerate() {
        let worst = deepest(&pose_depths(body, garment, number, &shot.pose));
        if worst.depth_m > 1e-3 {
            say!("  {:<26} {}", shot.name, described(garment, body, &worst));
        }
    }
}

fn described(garment: &Garment, body: &Body, depth: &Depth) -> String {
    let bone = body.skeleton.joints()[usize::from(depth.joint)].bone;
    let source_vertex = garment.data().mesh.source_vertex[depth.vertex as usize];
    let mm = depth.depth_m * 1e3;
    format!("{mm:.2} mm in {} at vertex {source_vertex} of the base file, pose {}", bone.name(), depth.pose)
}

/// The three worst poses from two sides, penetrating cloth red.
fn draw(garment: &Garment, source: &ir::Garment, poses: &[Pose], found: &Audit) -> Result<Vec<u8>, String> {
    let mut cells = Vec::new();
    for worst in found.worst_poses().iter().take(3).map(|depth| depth.pose) {
        cells.extend(draw_pose(garment, source, worst, &poses[worst]));
    }
    png_bytes(&contact_sheet(&cells, 2)).map_err(|error| error.to_string())
}

fn draw_pose(garment: &Garment, source: &ir::Garment, worst: usize, pose: &Pose) -> [Cell; 2] {
    let deep = pose_depths(&source.body, garment, worst, pose);
    let deep: Vec<u32> = deep.iter().filter(|depth| depth.depth_m > MARKED_M).map(|depth| depth.vertex).collect();
    let shot = Shot { name: String::new(), pose: pose.clone(), blend: Blend::Kernel(garment.kernel()) };
    let scene = Scene::new(garment, Some(source));
    let mut figure = scene.figure(&mut Stage::new(garment), &shot, Colours::Error(1.0));
    figure.mark(&deep);
    [View::Front, View::Side].map(|view| {
        let framing = Framing::of(std::slice::from_ref(&figure), view);
        Cell { caption: format!("pose {worst}"), picture: scene.draw(&figure, framing, 640) }
    })
}
