//! `cargo xtask leave-one-out ID`: how well each way of blending predicts a target that it has not seen, and each way of fitting a size.

use crate::places::{Places, printed};
use crate::shots;
use kitsuke::Garment;
use kitsuke_pipeline::measure::leave_one_out::{Error, Method, Unseen, errors, unseen_errors};
use kitsuke_pipeline::measure::size_errors::{self, SizeError};
use kitsuke_pipeline::source::obj;
use rayon::prelude::*;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

/// Compare kernels by the error of each target when its row is left out of the pose table
#[derive(clap::Args)]
pub struct Args {
    /// The kimono, or a pack file
    id: String,
    /// Every target, not only the means
    #[arg(long)]
    targets: bool,
    /// Size targets instead: each predicted from the others for its own body, and each fitted to its own body with all
    #[arg(long)]
    sizes: bool,
    /// Shapes that no target knows, instead of targets left out: a pose table with an OBJ file in each row, beside the table
    #[arg(long, value_name = "FILE.csv", conflicts_with = "sizes")]
    unseen: Option<PathBuf>,
    #[command(flatten)]
    places: Places,
}

/// Prints the table; 1 when there is no pack.
pub fn run(args: Args) -> ExitCode {
    printed(match &args.unseen {
        Some(path) => unseen(&args, path),
        None if args.sizes => sizes(&args),
        None => table(&args),
    })
}

fn table(args: &Args) -> Result<String, String> {
    let pack = args.places.open(&args.id)?;
    let garment = pack.garment();
    let layers = 0..garment.data().layer_count();
    let mut texts: Vec<String> = layers.clone().map(|layer| head(garment, layer)).collect();
    for method in Method::ALL {
        let errors = errors(garment, method).map_err(|error| error.to_string())?;
        for (layer, text) in layers.clone().zip(&mut texts) {
            let samples = garment.data().targets_of_layer(layer).filter(|&target| target < errors.len());
            let of_layer: Vec<&Error> = samples.map(|target| &errors[target]).collect();
            *text += &line(method.name(), &summary(&of_layer));
            if args.targets {
                of_layer.iter().for_each(|error| *text += &line(&format!("  {}", error.target), error));
            }
        }
    }
    Ok(texts.join("\n"))
}

/// How far each way of blending lies from shapes that no target knows.
fn unseen(args: &Args, path: &Path) -> Result<String, String> {
    let pack = args.places.open(&args.id)?;
    let garment = pack.garment();
    let rows = shots::pose_table(path, garment.kernel())?;
    let shapes: Vec<Unseen> =
        rows.into_par_iter().map(|row| shape(garment, path, row)).collect::<Result<_, String>>()?;
    let mut text = columns(&format!("{} shapes, mm", shapes.len()));
    for method in Method::ALL {
        let errors = unseen_errors(garment, method, &shapes).map_err(|error| error.to_string())?;
        text += &line(method.name(), &summary(&errors.iter().collect::<Vec<_>>()));
        if args.targets {
            errors.iter().for_each(|error| text += &line(&format!("  {}", error.target), error));
        }
    }
    Ok(text)
}

/// A row of the table with the shape in its file, which is in metres, Y up and in the base's vertex order, as `evaluate` writes it.
fn shape(garment: &Garment, table: &Path, row: shots::Row) -> Result<Unseen, String> {
    let file =
        row.file.ok_or_else(|| format!("{}: the file of {} is not beside it", table.display(), row.shot.name))?;
    let file = table.with_file_name("").join(file);
    let mut report = Vec::new();
    let mesh = obj::read(&file.to_string_lossy(), &shots::read(&file)?, &mut report);
    let mesh = mesh.ok_or_else(|| shots::said(&report))?;
    let (found, count) = (mesh.positions.len(), garment.unique_count());
    if found != count {
        return Err(format!("{}: {found} vertices, but the kimono has {count}", file.display()));
    }
    let place = |&v: &u32| mesh.positions[v as usize].as_vec3();
    let positions_m = garment.data().mesh.source_vertex.iter().map(place).collect();
    Ok(Unseen { name: row.shot.name, pose: row.shot.pose, positions_m })
}

/// What the table of a layer is of: its groups.
fn head(garment: &Garment, layer: usize) -> String {
    let groups = garment.data().rbf.iter().flat_map(|rbf| &rbf.layers[layer].groups);
    let names: Vec<&str> = groups.map(|group| group.name.as_str()).collect();
    format!("{}\n{}", names.join(", "), columns("left out, mm"))
}

fn columns(title: &str) -> String {
    format!("{title:24} {:>8} {:>8} {:>8} {:>8}\n", "mean", "p95", "p99", "max")
}

/// How far fits lie from the size targets, and from the dimensions that the rules want.
fn sizes(args: &Args) -> Result<String, String> {
    let pack = args.places.open(&args.id)?;
    let (garment, fitter) = (pack.garment(), args.places.fitter(&pack)?);
    let head = |title| format!("{title:24} {:>10} {:>14} {:>14}\n", "mean, mm", "of wanted, %", "of target, %");
    let own = size_errors::on_own_bodies(garment, fitter.data()).map_err(|error| error.to_string())?;
    let mut text = head("on its own body") + &size_lines("fit", &own, true) + "\n" + &head("left out");
    for method in size_errors::Method::ALL {
        let errors = size_errors::left_out(garment, fitter.data(), method).map_err(|error| error.to_string())?;
        text += &size_lines(method.name(), &errors, args.targets);
    }
    Ok(text)
}

/// Means over the bodies, then each body.
fn size_lines(name: &str, errors: &[SizeError], is_each: bool) -> String {
    let line = |name: &str, mm: f64, of_wanted: f64, of_target: f64| {
        format!("{name:24} {mm:10.2} {:14.3} {:14.3}\n", 100.0 * of_wanted, 100.0 * of_target)
    };
    let mean = |of: fn(&SizeError) -> f64| errors.iter().map(of).sum::<f64>() / errors.len().max(1) as f64;
    let mut text =
        line(name, mean(|error| error.mean_mm), mean(|error| error.of_wanted), mean(|error| error.of_target));
    for error in errors.iter().filter(|_| is_each) {
        text += &line(&format!("  {}", error.body), error.mean_mm, error.of_wanted, error.of_target);
    }
    text
}

/// Means over the targets, and the largest error of all.
fn summary(errors: &[&Error]) -> Error {
    let mean = |of: fn(&Error) -> f64| errors.iter().map(|error| of(error)).sum::<f64>() / errors.len().max(1) as f64;
    Error {
        target: String::new(),
        mean_mm: mean(|error| error.mean_mm),
        p95_mm: mean(|error| error.p95_mm),
        p99_mm: mean(|error| error.p99_mm),
        max_mm: errors.iter().map(|error| error.max_mm).fold(0.0, f64::max),
    }
}

fn line(name: &str, error: &Error) -> String {
    format!("{name:24} {:8.2} {:8.1} {:8.1} {:8.1}\n", error.mean_mm, error.p95_mm, error.p99_mm, error.max_mm)
}
