//! `cargo xtask evaluate`: frames as OBJ or NPY, and how far they lie from the target files.

use crate::places::{Places, ended, write_whole};
use crate::shots::{self, KernelName};
use crate::wearers;
use clap::ValueEnum;
use glam::{Vec2, Vec3};
use kitsuke::Garment;
use kitsuke::skeleton::Pose;
use kitsuke_pipeline::ir;
use kitsuke_pipeline::look::frames::{
    Distance, Shot, Stage, in_source_order, npy_frame, npy_header, own_poses, write_obj,
};
use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

/// Write frames of a kimono as OBJ or NPY
#[derive(clap::Args)]
pub struct Args {
    /// A kimono's ID, or the path of a pack
    #[arg(value_name = "ID")]
    garment: String,
    #[command(flatten)]
    frames: Frames,
    /// Where the files go
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    /// `npy`: float32 [frames, vertices, 3] positions.npy; `obj`: one file per frame. Metres, in the base file's order
    #[arg(long)]
    format: Format,
    /// Fit the kimono to the Nth body of a table, from 1: CSV, TOML, ANSUR II, FreeSewing JSON or Seamly .smis
    #[arg(long, value_name = "FILE#N")]
    body: Option<String>,
    /// The rule set of the fit [default: the kimono's own]
    #[arg(long, value_name = "NAME", requires = "body")]
    rules: Option<String>,
    /// Also write uv.npy, float32 [vertices, 2]: the texture coordinates of the base file's vertices in its order, then of their twins
    /// at texture seams; with --body those corrected for the fitted shape
    #[arg(long)]
    uv: bool,
    /// How poses become blend rates [default: the garment's own kernel]
    #[arg(long)]
    kernel: Option<KernelName>,
    #[command(flatten)]
    how: shots::How,
    #[command(flatten)]
    places: Places,
}

#[derive(clap::Args)]
#[group(required = true, multiple = false)]
struct Frames {
    /// Rotations from a pose table; its `file` entries need not exist
    #[arg(long, value_name = "FILE.csv")]
    poses: Option<PathBuf>,
    /// A recorded motion: BVH, .vrma, MediaPipe or DeepMimic JSON, Kinect CSV, or JSON Lines of `play --record`
    #[arg(long, value_name = "FILE")]
    motion: Option<PathBuf>,
    /// The garment's own pose table, each row with only its own target at full rate, the base first
    #[arg(long)]
    targets: bool,
}

#[derive(Clone, Copy, ValueEnum)]
enum Format {
    Obj,
    Npy,
}

/// Writes the frames; 1 when something cannot be read or written.
pub fn run(args: Args) -> ExitCode {
    ended(evaluate(&args))
}

fn evaluate(args: &Args) -> Result<(), String> {
    let pack = args.places.open(&args.garment)?;
    let fitted = args.body.as_ref().map(|body| wearers::fitted_to(&args.places, &pack, body, args.rules.as_deref()));
    let fitted = fitted.transpose()?;
    let garment = fitted.as_ref().map_or(pack.garment(), |fitted| &fitted.garment);
    let kernel = KernelName::of(args.kernel, garment)?;
    // Files show the kimono on the body of the base.
    let has_files = args.frames.motion.is_none() && fitted.is_none();
    let source = if has_files { args.places.source(&garment.data().id) } else { None };
    // Each shot with the positions of the file that it stands for, if it stands for one.
    let mut wanted_m: Vec<Option<&[Vec3]>> = Vec::new();
    let shots: Vec<Shot> = match (&args.frames.poses, &args.frames.motion) {
        (Some(table), _) => {
            let rows = shots::pose_table(table, kernel)?;
            let file_m =
                |row: &shots::Row| row.file.as_ref().and_then(|file| by_file(source.as_ref()?, file, &row.shot));
            wanted_m.extend(rows.iter().map(file_m));
            rows.into_iter().map(|row| row.shot).collect()
        }
        (_, Some(motion)) => shots::motion(motion, garment, kernel, args.how)?,
        _ => {
            let base = source.iter().map(|source| Some(source.base.positions_m.as_slice()));
            let targets =
                source.iter().flat_map(|source| &source.targets).map(|target| Some(target.positions_m.as_slice()));
            wanted_m.extend(base.chain(targets));
            own_poses(garment)
        }
    };
    if shots.is_empty() {
        return Err("there is no frame to write".into());
    }
    if args.uv {
        write_uv(garment, &args.out)?;
    }
    let mut stage = Stage::new(garment);
    match args.format {
        Format::Npy => write_whole(&args.out.join("positions.npy"), |out| {
            out.write_all(&npy_header(&[shots.len(), garment.unique_count(), 3]))?;
            shots.iter().try_for_each(|shot| out.write_all(&npy_frame(&in_source_order(garment, stage.show(shot).0))))
        })?,
        Format::Obj => {
            for (i, shot) in shots.iter().enumerate() {
                let ordered_m = in_source_order(garment, stage.show(shot).0);
                let path = args.out.join(format!("{i:04}_{}.obj", file_stem(&shot.name)));
                write_whole(&path, |mut out| write_obj(garment, &ordered_m, &mut out))?;
            }
        }
    }
    println!("{} frames of {} vertices in {}", shots.len(), garment.unique_count(), args.out.display());
    // A reader such as `head` may have gone.
    _ = std::io::stdout().write_all(distances(garment, &shots, &wanted_m).as_bytes());
    Ok(())
}

fn write_uv(garment: &Garment, folder: &Path) -> Result<(), String> {
    let mesh = &garment.data().mesh;
    if mesh.uv.is_empty() {
        return Err("this kimono has no texture coordinates".into());
    }
    let (unique, twins) = mesh.uv.split_at(garment.unique_count());
    let mut ordered = vec![Vec2::ZERO; unique.len()];
    for (&source, &uv) in mesh.source_vertex.iter().zip(unique) {
        ordered[source as usize] = uv;
    }
    ordered.extend(twins);
    write_whole(&folder.join("uv.npy"), |out| {
        out.write_all(&npy_header(&[ordered.len(), 2]))?;
        ordered.iter().flat_map(|uv| uv.to_array()).try_for_each(|value| out.write_all(&value.to_le_bytes()))
    })
}

/// The positions of a pose table's `file`, by its name in the garment's own table.
fn by_file<'a>(source: &'a ir::Garment, file: &str, shot: &Shot) -> Option<&'a [Vec3]> {
    match source.targets.iter().find(|target| target.file == file) {
        Some(target) => Some(&target.positions_m),
        None => (shot.pose == Pose::REST).then_some(&source.base.positions_m),
    }
}

/// How far each shot lies from its file, a line each.
fn distances(garment: &Garment, shots: &[Shot], wanted_m: &[Option<&[Vec3]>]) -> String {
    let mut text = String::new();
    let mut stage = Stage::new(garment);
    for (shot, wanted_m) in shots.iter().zip(wanted_m) {
        let Some(wanted_m) = wanted_m.filter(|wanted_m| wanted_m.len() == garment.unique_count()) else { continue };
        let Distance { max_m, mean_m, vertex } =
            Distance::between(&in_source_order(garment, stage.show(shot).0), wanted_m);
        let (name, max_mm, mean_mm) = (&shot.name, max_m * 1e3, mean_m * 1e3);
        text += &format!("{name:<28} max {max_mm:8.4} mm at vertex {vertex:<6} mean {mean_mm:8.4} mm\n");
    }
    text
}

/// A name without what a file name cannot hold.
fn file_stem(name: &str) -> String {
    name.chars().map(|c| if c.is_ascii_alphanumeric() || c == '-' { c } else { '_' }).collect()
}
