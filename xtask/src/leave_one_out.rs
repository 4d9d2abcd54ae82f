//! `cargo xtask leave-one-out ID`: how well each way of blending predicts a target that it has not seen.

use crate::places::Places;
use kitsuke_pipeline::leave_one_out::{Error, Method, errors};
use std::process::ExitCode;

/// Compare kernels by the error of each target when its row is left out of the pose table
#[derive(clap::Args)]
pub struct Args {
    /// The kimono, or a pack file
    id: String,
    /// Every target, not only the means
    #[arg(long)]
    targets: bool,
    #[command(flatten)]
    places: Places,
}

/// Prints the table; 1 when there is no pack.
pub fn run(args: Args) -> ExitCode {
    match table(&args) {
        Ok(text) => {
            print!("{text}");
            ExitCode::SUCCESS
        }
        Err(message) => {
            eprintln!("error: {message}");
            ExitCode::FAILURE
        }
    }
}

fn table(args: &Args) -> Result<String, String> {
    let pack = args.places.open(&args.id)?;
    let mut text = format!("{:24} {:>8} {:>8} {:>8}\n", "left out, mm", "mean", "p99", "max");
    for method in Method::ALL {
        let errors = errors(pack.garment(), method).map_err(|error| error.to_string())?;
        text += &line(method.name(), &summary(&errors));
        if args.targets {
            errors.iter().for_each(|error| text += &line(&format!("  {}", error.target), error));
        }
    }
    Ok(text)
}

/// Means over the targets, and the largest error of all.
fn summary(errors: &[Error]) -> Error {
    let mean = |of: fn(&Error) -> f64| errors.iter().map(of).sum::<f64>() / errors.len().max(1) as f64;
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
