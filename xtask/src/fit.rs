//! `cargo xtask fit`: the kimono for every body of a table.

use crate::places::{Places, printed, write_whole};
use crate::tailor::or_print;
use kitsuke::fit::{Fit, Fitter, Scratch, Verdict};
use kitsuke_pipeline::source::measurements::{self, Wearer};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::time::Instant;

/// Fit a kimono to every body of a table
#[derive(clap::Args)]
pub struct Args {
    /// A kimono's ID, or the path of a pack
    #[arg(value_name = "ID")]
    garment: String,
    /// A table of measurements: CSV, TOML, ANSUR II, FreeSewing JSON or Seamly .smis
    #[arg(long, value_name = "FILE")]
    bodies: PathBuf,
    /// Where the table of fits goes: a row per body; wanted, reached, shortest and longest of every dimension in cm
    #[arg(long, value_name = "FILE.csv")]
    out: Option<PathBuf>,
    /// The rule set [default: the kimono's own]
    #[arg(long, value_name = "NAME")]
    rules: Option<String>,
    #[command(flatten)]
    places: Places,
}

/// Fits, writes the table and prints what came of it; 1 when something cannot be read, fitted or written.
pub fn run(args: Args) -> ExitCode {
    let folder = args.bodies.parent().unwrap_or(Path::new(""));
    let Some(wearers) = or_print(measurements::load(&args.bodies), folder) else { return ExitCode::FAILURE };
    printed(fit(&args, &wearers))
}

fn fit(args: &Args, wearers: &[Wearer]) -> Result<String, String> {
    let fitter = args.places.fitter(&args.places.open(&args.garment)?)?;
    let rules = rule_set(&fitter, args.rules.as_deref())?;
    let mut scratch = Scratch::default();
    let begin = Instant::now();
    let fits = wearers.iter().map(|wearer| {
        let fit = fitter.fit(&wearer.measurements, rules, &mut scratch);
        fit.map_err(|error| format!("row {}, {}: {error}", wearer.row, wearer.name))
    });
    let fits: Vec<Fit> = fits.collect::<Result<_, String>>()?;
    let elapsed_s = begin.elapsed().as_secs_f64();
    if let Some(path) = &args.out {
        write_whole(path, |out| out.write_all(table(&fitter, wearers, &fits).as_bytes()))?;
    }
    Ok(summary(&fitter, &fits, elapsed_s))
}

/// Where the rule set of this name stands; the kimono's own without a name.
pub fn rule_set(fitter: &Fitter, name: Option<&str>) -> Result<usize, String> {
    let rules = &fitter.data().rules;
    let known = || rules.iter().map(|rules| rules.name.as_str()).collect::<Vec<_>>().join(", ");
    match name {
        Some(name) => rules.iter().position(|rules| rules.name == name).ok_or_else(|| match rules.is_empty() {
            true => "this kimono was built without rule sets".to_owned(),
            false => format!("this kimono has no rule set {name}, only {}", known()),
        }),
        None if rules.is_empty() => Err("this kimono was built without rule sets".to_owned()),
        None => Ok(0),
    }
}

/// The fits as CSV, lengths in cm.
fn table(fitter: &Fitter, wearers: &[Wearer], fits: &[Fit]) -> String {
    let mut text = String::from("row,name");
    for dimension in &fitter.data().dimensions {
        let name = &dimension.name;
        text += &format!(",wanted_{name},reached_{name},lo_{name},hi_{name}");
    }
    text += ",novelty,verdict\n";
    for (wearer, fit) in wearers.iter().zip(fits) {
        text += &format!("{},{}", wearer.row, quoted(&wearer.name));
        for reach in &fit.dimensions {
            for length_m in [reach.wanted_m, reach.reached_m, reach.lowest_m, reach.highest_m] {
                text += &format!(",{:.3}", length_m * 100.0);
            }
        }
        text += &format!(",{:.3},{}\n", fit.novelty, quoted(&fitter.explain(fit, &wearer.measurements)));
    }
    text
}

fn quoted(text: &str) -> String {
    if text.contains(['"', ',', '\n', '\r']) { format!("\"{}\"", text.replace('"', "\"\"")) } else { text.to_owned() }
}

/// How many are reached, how closely, and what is in the way.
fn summary(fitter: &Fitter, fits: &[Fit], elapsed_s: f64) -> String {
    let mut out_of_reach = BTreeMap::new();
    for fit in fits {
        if let Verdict::OutOfReach { dimension } = fit.verdict {
            *out_of_reach.entry(fitter.data().dimensions[dimension].name.as_str()).or_insert(0) += 1;
        }
    }
    let reachable = fits.len() - out_of_reach.values().sum::<usize>();
    let mut text = format!("{} bodies in {elapsed_s:.2} s, {reachable} of them reachable\n", fits.len());
    let all = || fits.iter().flat_map(|fit| fit.dimensions.iter().map(|reach| f64::from(reach.error().abs())));
    let of_reachable = fits.iter().filter(|fit| fit.verdict == Verdict::Reachable);
    let of_reachable = of_reachable.flat_map(|fit| fit.dimensions.iter().map(|reach| f64::from(reach.error().abs())));
    text += &errors("error of all dimensions", all().collect());
    text += &errors("error of the reachable", of_reachable.collect());
    for (name, count) in out_of_reach {
        text += &format!("{name:<20} out of reach for {count}\n");
    }
    text
}

fn errors(name: &str, mut errors: Vec<f64>) -> String {
    errors.sort_by(f64::total_cmp);
    let count = errors.len().max(1);
    let mean = errors.iter().sum::<f64>() / count as f64;
    let p95 = errors.get((count - 1) * 95 / 100).copied().unwrap_or(0.0);
    format!("{name:<24} mean {:.3} %, 95 % below {:.3} %\n", 100.0 * mean, 100.0 * p95)
}
