//! `cargo xtask leave-one-out ID`: how well each way of blending predicts a target that it has not seen, and each way of fitting a size.

use crate::places::{Places, printed};
use kitsuke::Garment;
use kitsuke_pipeline::measure::leave_one_out::{Error, Method, errors};
use kitsuke_pipeline::measure::size_errors::{self, SizeError};
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
    #[command(flatten)]
    places: Places,
}

/// Prints the table; 1 when there is no pack.
pub fn run(args: Args) -> ExitCode {
    printed(if args.sizes { sizes(&args) } else { table(&args) })
}

fn table(args: &Args) -> Result<String, String> {
    let pack = args.places.open(&args.id)?;
    let garment = pack.garment();
    let layers = 0..garment.data().layer_count();
    let mut texts: Vec<String> = layers.clone().map(|layer| head(garment, layer)).collect();
    for method in Method::ALL {
        let errors = errors(garment, method).map_err(|error| error.to_string())?;
        for (layer, text) in layers.clone().zip(&mut texts) {
            let of_layer: Vec<&Error> = garment.data().targets_of_layer(layer).map(|target| &errors[target]).collect();
            *text += &line(method.name(), &summary(&of_layer));
            if args.targets {
                of_layer.iter().for_each(|error| *text += &line(&format!("  {}", error.target), error));
            }
        }
    }
    Ok(texts.join("\n"))
}

/// What the table of a layer is of: its groups.
fn head(garment: &Garment, layer: usize) -> String {
    let groups = garment.data().rbf.iter().flat_map(|rbf| &rbf.layers[layer].groups);
    let names: Vec<&str> = groups.map(|group| group.name.as_str()).collect();
    format!("{}\n{:24} {:>8} {:>8} {:>8}\n", names.join(", "), "left out, mm", "mean", "p99", "max")
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
        p99_mm: mean(|error| error.p99_mm),
        max_mm: errors.iter().map(|error| error.max_mm).fold(0.0, f64::max),
    }
}

fn line(name: &str, error: &Error) -> String {
    format!("{name:24} {:8.2} {:8.1} {:8.1}\n", error.mean_mm, error.p99_mm, error.max_mm)
}
