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
    let mut times_us = Vec::new();
    let fits = wearers.iter().map(|wearer| {
        let begin = Instant::now();
        let fit = fitter.fit(&wearer.measurements, rules, &mut scratch);
        times_us.push(begin.elapsed().as_secs_f64() * 1e6);
        fit.map_err(|error| format!("row {}, {}: {error}", wearer.row, wearer.name))
    });
    let fits: Vec<Fit> = fits.collect::<Result<_, String>>()?;
    if let Some(path) = &args.out {
        write_whole(path, |out| out.write_all(table(&fitter, wearers, &fits).as_bytes()))?;
    }
    Ok(summary(&fitter, &fits, times_us))
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

/// How many are reached, how closely, what is in the way, and how long it took.
fn summary(fitter: &Fitter, fits: &[Fit], times_us: Vec<f64>) -> String {
    let mut missed = BTreeMap::new();
    for fit in fits {
        let (dimension, how) = match fit.verdict {
            Verdict::OutOfReach { dimension, .. } => (dimension, "is out of reach"),
            Verdict::SizeDiffers { dimension, .. } => (dimension, "differs in the size made for such a body"),
            Verdict::Reachable | Verdict::Strayed => continue,
        };
        *missed.entry((how, fitter.data().dimensions[dimension].name.as_str())).or_insert(0) += 1;
    }
    let of = |verdict: Verdict| fits.iter().filter(move |fit| fit.verdict == verdict);
    let (near, strayed) = (of(Verdict::Reachable).count(), of(Verdict::Strayed).count());
    let mut text = format!(
        "{} bodies: {} reachable, {near} near what neighbouring sizes wear, {strayed} only by moving away from it\n",
        fits.len(),
        near + strayed
    );
    let errors = |fits: &mut dyn Iterator<Item = &Fit>| {
        fits.flat_map(|fit| fit.dimensions.iter().map(|reach| 100.0 * f64::from(reach.error().abs()))).collect()
    };
    text += &line("error of all dimensions, %", errors(&mut fits.iter()));
    text += &line("of the reachable bodies, %", errors(&mut of(Verdict::Reachable).chain(of(Verdict::Strayed))));
    let moved_mm = |verdict| of(verdict).map(|fit| 1e3 * f64::from(fit.moved_m)).collect();
    text += &line("moved, those near, mm", moved_mm(Verdict::Reachable));
    text += &line("moved, the others, mm", moved_mm(Verdict::Strayed));
    text += &line("fit_us", times_us);
    for ((how, name), count) in missed {
        text += &format!("{name} {how}: {count}\n");
    }
    text
}

fn line(name: &str, mut values: Vec<f64>) -> String {
    values.sort_by(f64::total_cmp);
    let count = values.len().max(1);
    let mean = values.iter().sum::<f64>() / count as f64;
    let [median, p95, most] =
        [50, 95, 100].map(|percent| values.get((count - 1) * percent / 100).copied().unwrap_or(0.0));
    format!("{name:<28} mean {mean:.3}, median {median:.3}, 95 % below {p95:.3}, at most {most:.3}\n")
}
