//! `cargo xtask covered`: which skin of the wearer an app need not draw under the kimono.

use crate::places::{Places, ended, say, write_whole};
use crate::shots::{self, How, ReadAs};
use crate::wearers::Wearer;
use kitsuke::Garment;
use kitsuke::skeleton::Pose;
use kitsuke_pipeline::ir::Body;
use kitsuke_pipeline::look::frames::npy_header_of;
use kitsuke_pipeline::measure::covered::{Limb, area_m2, covered, limb, seen};
use std::path::{Path, PathBuf};
use std::process::ExitCode;

/// Say which skin the kimono always covers, so that an app can leave it out and less skin shows through the cloth
#[derive(clap::Args)]
#[command(mut_arg("body", |body| body.requires("wearer")))]
pub struct Args {
    /// A kimono's ID
    #[arg(value_name = "ID", default_value = "komon")]
    garment: String,
    /// Write one truth value per vertex of the body's GLB, in the file's order: .npy of bool, or .csv with a line of 0 or 1 each. A file
    /// with several meshes counts through its nodes and their primitives; meshes that its skin does not move are left out
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,
    /// Measure in recorded motions how much skin is seen that the cloth hides in the T-pose, with all skin drawn and without the covered
    #[arg(long, value_name = "FILE,…", value_delimiter = ',', num_args = 1..)]
    motion: Vec<PathBuf>,
    /// Look at no more frames of a motion than this, evenly spaced
    #[arg(long, default_value_t = 100, value_parser = clap::value_parser!(u32).range(1..), requires = "motion")]
    frames: u32,
    #[command(flatten)]
    wearer: Wearer,
    #[command(flatten)]
    read_as: ReadAs,
    #[command(flatten)]
    places: Places,
}

/// Writes and measures; 1 when something cannot be read or written.
pub fn run(args: Args) -> ExitCode {
    ended(report(&args))
}

fn report(args: &Args) -> Result<(), String> {
    let write = args.out.as_deref().map(|path| Ok::<_, String>((path, Format::of(path)?))).transpose()?;
    let pack = args.places.open(&args.garment)?;
    let (garment, source) = args.wearer.garment_and_source(&args.places, &pack)?;
    let source = source.ok_or("the body is needed to know its skin")?;
    let mask = covered(&garment, &source.body);
    if let Some((path, format)) = write {
        write_whole(path, |out| out.write_all(&format.bytes(&mask)))?;
        say!("{}: {} vertices", path.display(), mask.len());
    }
    print_mask(&source.body, &mask);
    motions(args, &garment, &source.body, &mask)
}

/// How a mask is written.
#[derive(Clone, Copy)]
enum Format {
    Npy,
    Csv,
}

impl Format {
    fn of(path: &Path) -> Result<Format, String> {
        match path.extension().and_then(|extension| extension.to_str()) {
            Some("npy") => Ok(Format::Npy),
            Some("csv") => Ok(Format::Csv),
            _ => Err(format!("{} is neither .npy nor .csv: end the name of --out in one of them", path.display())),
        }
    }

    fn bytes(self, mask: &[bool]) -> Vec<u8> {
        match self {
            Format::Npy => {
                npy_header_of("|b1", &[mask.len()]).into_iter().chain(mask.iter().map(|&v| v.into())).collect()
            }
            Format::Csv => mask.iter().flat_map(|&covered| if covered { *b"1\n" } else { *b"0\n" }).collect(),
        }
    }
}

fn print_mask(body: &Body, mask: &[bool]) {
    let is_covered = |v: u32| mask[v as usize];
    let triangles = &body.surface.triangles;
    let left_out = triangles.iter().filter(|triangle| triangle.iter().all(|&v| is_covered(v))).count();
    let vertices = mask.iter().filter(|covered| **covered).count();
    say!("covered: {vertices} of {} vertices, {left_out} of {} triangles", mask.len(), triangles.len());
    for (name, part) in [("arms", Limb::Arms), ("trunk", Limb::Trunk), ("legs", Limb::Legs)] {
        let all_m2 = area_m2(body, |v| limb(body, v) == Some(part));
        let covered_m2 = area_m2(body, |v| limb(body, v) == Some(part) && is_covered(v));
        say!("{name}: {:.0} of {:.0} cm² remain visible", (all_m2 - covered_m2) * 1e4, all_m2 * 1e4);
    }
}

/// A line per motion.
fn motions(args: &Args, garment: &Garment, body: &Body, mask: &[bool]) -> Result<(), String> {
    if args.motion.is_empty() {
        return Ok(());
    }
    say!(
        "{:32} {:>6} {:>9} {:>9} {:>9} {:>9}",
        "skin seen through cloth, cm²",
        "frames",
        "all: mean",
        "max",
        "rest: mean",
        "max"
    );
    for path in &args.motion {
        let how = How::plain(args.read_as);
        let shots = shots::motion(path, garment, garment.kernel(), how)?;
        let step = shots::step(shots.len(), args.frames as usize);
        let poses: Vec<Pose> = shots.into_iter().step_by(step).map(|shot| shot.pose).collect();
        let found = seen(garment, body, mask, &poses);
        let figures = |cm2: &dyn Fn(usize) -> f32| {
            let all = (0..found.len()).map(cm2);
            (all.clone().sum::<f32>() / found.len().max(1) as f32, all.fold(0.0, f32::max))
        };
        let (all_mean, all_max) = figures(&|i| found[i].of_all_m2 * 1e4);
        let (rest_mean, rest_max) = figures(&|i| found[i].of_rest_m2 * 1e4);
        say!(
            "{:32} {:6} {all_mean:9.1} {all_max:9.1} {rest_mean:9.1} {rest_max:9.1}",
            path.file_name().unwrap_or_default().to_string_lossy(),
            poses.len(),
        );
    }
    Ok(())
}
