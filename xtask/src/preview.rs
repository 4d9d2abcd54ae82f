//! `cargo xtask preview`: contact sheets of kimono on their wearers.

use crate::places::{Places, ended, write_whole};
use crate::shots::{self, KernelName};
use crate::wearers::Wearer;
use clap::ValueEnum;
use kitsuke_pipeline::catalog;
use kitsuke_pipeline::look::frames::{Blend, Shot, Stage, own_poses};
use kitsuke_pipeline::look::scene::{Colours, Figure, Framing, Scene, View};
use kitsuke_pipeline::look::sheet::{Cell, contact_sheet, png_bytes, side_by_side};
use kitsuke_pipeline::measure::covered::covered;
use std::path::PathBuf;
use std::process::ExitCode;

/// Draw a contact sheet per kimono: base and targets from front, side and back, as one PNG
#[derive(clap::Args)]
#[command(mut_arg("body", |body| body.help(BODY)))]
pub struct Args {
    /// Kimono IDs or pack paths [default: every folder in --assets that holds a garment.toml]
    #[arg(value_name = "ID")]
    garments: Vec<String>,
    /// Where the PNGs go [default: reports/ in --catalog]
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Draw frames of a recorded motion, evenly spaced, instead of the targets
    #[arg(long, value_name = "FILE")]
    motion: Option<PathBuf>,
    /// Draw the rows of a pose table, blended by the kernel, instead of the targets
    #[arg(long, value_name = "FILE.csv", conflicts_with = "motion")]
    poses: Option<PathBuf>,
    /// How many frames of the motion
    #[arg(long, default_value_t = 12, value_parser = clap::value_parser!(u16).range(1..=100), requires = "motion")]
    frames: u16,
    /// Draw only these poses of the kimono's pose table
    #[arg(long, value_name = "NAME,…", value_delimiter = ',', conflicts_with = "motion")]
    only: Vec<String>,
    /// From where
    #[arg(long, value_delimiter = ',', default_values = ["front", "side", "back"])]
    views: Vec<ViewName>,
    #[command(flatten)]
    wearer: Wearer,
    /// Draw the wearer's skin under the cloth, too, which shows where cloth lies in the body; other --colours than cloth always do
    #[arg(long)]
    all_skin: bool,
    /// What the colours of the cloth say
    #[arg(long, default_value = "cloth")]
    colours: ColoursName,
    /// The distance from the target files that is drawn red, mm
    #[arg(long, value_name = "MM", default_value_t = 1.0)]
    red_at: f32,
    /// Blend by this kernel [default: each target alone; in motion the garment's own kernel]
    #[arg(long)]
    kernel: Option<KernelName>,
    /// Height of a picture, pixels
    #[arg(long, value_name = "PX", default_value_t = 320, value_parser = clap::value_parser!(u32).range(16..=2048))]
    height: u32,
    /// Cells per row
    #[arg(long, default_value_t = 4, value_parser = clap::value_parser!(u16).range(1..=100))]
    columns: u16,
    #[command(flatten)]
    how: shots::How,
    #[command(flatten)]
    places: Places,
}

/// What `--body` does here.
const BODY: &str =
    "Fit the kimono to the Nth body of a table, from 1, and draw it without the wearer unless --wearer names her";

#[derive(Clone, Copy, ValueEnum)]
enum ViewName {
    Front,
    /// The wearer's left
    Side,
    Back,
    /// Between front and left, a little from above
    Quarter,
}

#[derive(Clone, Copy, PartialEq, ValueEnum)]
enum ColoursName {
    /// As the cloth looks
    Cloth,
    /// Region masks, one colour per driver
    Regions,
    /// Joints by skin weight
    Skin,
    /// Distance from the target files
    Error,
}

/// Draws the sheets; 1 when something cannot be read or written.
pub fn run(args: Args) -> ExitCode {
    let ids = match args.garments.as_slice() {
        [] => catalog::garment_ids(&args.places.assets, &[]).map_err(|error| error.to_string()),
        named => Ok(named.to_vec()),
    };
    ended(ids.and_then(|ids| ids.iter().try_for_each(|id| preview(&args, id))))
}

fn preview(args: &Args, id_or_path: &str) -> Result<(), String> {
    let pack = args.places.open(id_or_path)?;
    let (garment, source) = args.wearer.garment_and_source(&args.places, &pack)?;
    let garment = &garment;
    let mut scene = Scene::new(garment, source.as_ref());
    if args.wearer.is_unseen() {
        // Body and obi of the source are another wearer's.
        scene = scene.unworn();
    } else if let (Some(source), ColoursName::Cloth, false) = (&source, args.colours, args.all_skin) {
        // As an app draws her; measuring what is covered takes seconds, and the other colours are for those who look for faults.
        scene = scene.without_covered(&covered(garment, &source.body));
    }
    let kernel = KernelName::of(args.kernel, garment)?;
    let shots = match (&args.motion, &args.poses) {
        (Some(motion), _) => evenly(&shots::motion(motion, garment, kernel, args.how)?, usize::from(args.frames)),
        (None, Some(table)) => {
            let rows = shots::pose_table(table, kernel)?.into_iter();
            chosen(rows.map(|row| row.shot).collect(), &args.only)?
        }
        (None, None) => chosen(own_poses(garment), &args.only)?,
    };
    let colours = match args.colours {
        ColoursName::Cloth => Colours::Cloth,
        ColoursName::Regions => Colours::Regions,
        ColoursName::Skin => Colours::Joints,
        ColoursName::Error => Colours::Error(args.red_at.max(1e-6) / 1e3),
    };
    let mut stage = Stage::new(garment);
    let figures: Vec<Figure> = shots
        .iter()
        .map(|shot| {
            let blend = if args.kernel.is_some() { Blend::Kernel(kernel) } else { shot.blend };
            scene.figure(&mut stage, &Shot { blend, ..shot.clone() }, colours)
        })
        .collect();
    let framings: Vec<Framing> = args.views.iter().map(|&view| Framing::of(&figures, view.into())).collect();
    let cells: Vec<Cell> = figures
        .iter()
        .zip(&shots)
        .map(|(figure, shot)| {
            let views = framings.iter().map(|&framing| scene.draw(figure, framing, args.height));
            Cell { caption: shot.name.clone(), picture: side_by_side(&views.collect::<Vec<_>>()) }
        })
        .collect();
    let png = png_bytes(&contact_sheet(&cells, usize::from(args.columns))).map_err(|error| error.to_string())?;
    let dir = args.out.clone().unwrap_or_else(|| args.places.catalog.join("reports"));
    let shown = args.motion.as_deref().or(args.poses.as_deref());
    let motion = shown.and_then(|path| path.file_stem()).map(|stem| stem.to_string_lossy());
    let kind = if args.colours == ColoursName::Cloth { None } else { args.colours.to_possible_value() };
    let name = [
        Some(garment.data().id.clone()),
        args.wearer.file_part(),
        motion.map(Into::into),
        kind.map(|kind| kind.get_name().to_owned()),
    ];
    let path = dir.join(format!("{}.png", name.into_iter().flatten().collect::<Vec<String>>().join("_")));
    write_whole(&path, |out| out.write_all(&png))?;
    println!("{}: {} shapes, {} kB", path.display(), cells.len(), png.len() / 1000);
    Ok(())
}

/// So many of the shots, first and last among them.
fn evenly(shots: &[Shot], count: usize) -> Vec<Shot> {
    let count = count.min(shots.len());
    (0..count).map(|i| shots[i * (shots.len() - 1) / (count - 1).max(1)].clone()).collect()
}

fn chosen(shots: Vec<Shot>, names: &[String]) -> Result<Vec<Shot>, String> {
    if names.is_empty() {
        return Ok(shots);
    }
    let find = |name: &String| {
        shots.iter().find(|shot| shot.name == *name).cloned().ok_or_else(|| {
            let known: Vec<&str> = shots.iter().map(|shot| shot.name.as_str()).collect();
            format!("there is no pose `{name}`; there are {}", known.join(", "))
        })
    };
    names.iter().map(find).collect()
}

impl From<ViewName> for View {
    fn from(name: ViewName) -> View {
        match name {
            ViewName::Front => View::Front,
            ViewName::Side => View::Side,
            ViewName::Back => View::Back,
            ViewName::Quarter => View::Quarter,
        }
    }
}
