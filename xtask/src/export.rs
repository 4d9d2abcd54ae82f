//! `cargo xtask export`: a kimono as GLB, for programs that know glTF and not us.

use crate::places::{Places, ended, say, write_whole};
use crate::shots;
use crate::wearers;
use kitsuke::Garment;
use kitsuke_pipeline::export::{Clip, Settings, glb};
use std::path::{Path, PathBuf};
use std::process::ExitCode;

/// Write a kimono as GLB for other programs: mesh, skin, morph targets, texture, and a motion
#[derive(clap::Args)]
pub struct Args {
    /// A kimono's ID, or the path of a pack
    #[arg(value_name = "ID")]
    garment: String,
    /// The file to write
    #[arg(long, value_name = "FILE")]
    glb: PathBuf,
    /// Numbers of 16 bits (KHR_mesh_quantization): half the size, and the grid's step is printed
    #[arg(long)]
    quantise: bool,
    /// Compressed besides (EXT_meshopt_compression): a tenth of the size, for viewers that know it
    #[arg(long)]
    meshopt: bool,
    /// A recorded motion as animation: BVH, .vrma, MediaPipe or DeepMimic JSON, Kinect CSV, or JSON Lines
    #[arg(long, value_name = "FILE")]
    motion: Option<PathBuf>,
    /// Frames a second of the animation
    #[arg(long, value_name = "N", default_value_t = 30.0, requires = "motion", value_parser = frames_per_s)]
    fps: f64,
    /// At most so many morph targets, those that show most of the motion: 8 for viewers that show no more
    #[arg(long, value_name = "N", requires = "motion", value_parser = clap::value_parser!(u16).range(1..=256))]
    morphs: Option<u16>,
    /// Fit the kimono to the Nth body of a table, from 1
    #[arg(long, value_name = "FILE#N")]
    body: Option<String>,
    /// The rule set of the fit [default: the kimono's own]
    #[arg(long, value_name = "NAME", requires = "body")]
    rules: Option<String>,
    #[command(flatten)]
    how: shots::How,
    #[command(flatten)]
    places: Places,
}

fn frames_per_s(text: &str) -> Result<f64, String> {
    let number = text.parse().ok().filter(|number: &f64| (1.0..=240.0).contains(number));
    number.ok_or_else(|| "frames a second are a number from 1 to 240".to_owned())
}

/// Writes the file; 1 when something cannot be read or written.
pub fn run(args: Args) -> ExitCode {
    ended(export(&args))
}

fn export(args: &Args) -> Result<(), String> {
    let pack = args.places.open(&args.garment)?;
    let fitted = args.body.as_ref().map(|body| wearers::fitted_to(&args.places, &pack, body, args.rules.as_deref()));
    let fitted = fitted.transpose()?;
    let garment = fitted.as_ref().map_or(pack.garment(), |fitted| &fitted.garment);
    let mut accessories = pack.accessories().clone();
    if fitted.is_some() {
        let base_m = &pack.garment().data().mesh.positions_m;
        accessories.obi = accessories.obi.map(|obi| obi.fitted(base_m, &garment.data().mesh.positions_m));
    }
    let clip = args.motion.as_ref().map(|path| clip(args, path, garment)).transpose()?;
    let settings = Settings {
        is_quantised: args.quantise,
        is_compressed: args.meshopt,
        most_morphs: args.morphs.map(usize::from),
    };
    let exported = glb(garment, &accessories, clip.as_ref(), settings).map_err(|error| error.to_string())?;
    write_whole(&args.glb, |file| file.write_all(&exported.glb))?;
    let (bytes, morphs) = (exported.glb.len(), exported.morphs.len());
    say!("{}: {bytes} bytes, {} vertices, {morphs} morph targets", args.glb.display(), garment.vertex_count());
    if let Some(clip) = &clip {
        say!("{} frames, {:.2} s", clip.poses.len(), clip.times_s.last().copied().unwrap_or(0.0));
    }
    if exported.step_m > 0.0 {
        let (step_mm, off_mm) = (1e3 * exported.step_m, 1e3 * exported.step_m * 3f32.sqrt() / 2.0);
        say!("on a grid of {step_mm:.4} mm: every place and delta within {off_mm:.4} mm");
    }
    if let Some((mean_m, most_m)) = exported.condensed_m {
        let (mean_mm, most_mm) = (1e3 * mean_m, 1e3 * most_m);
        say!(
            "with these morph targets the cloth lies {mean_mm:.3} mm from the whole blend on average, {most_mm:.2} mm at most"
        );
    }
    Ok(())
}

fn clip(args: &Args, path: &Path, garment: &Garment) -> Result<Clip, String> {
    let (times_s, poses) = shots::sampled(path, garment, args.fps, args.how)?;
    let name = path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
    Ok(Clip { name, times_s, poses })
}
