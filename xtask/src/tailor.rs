//! `cargo xtask tailor`: the dimensions of a kimono by a rule set, for every body of a table.

use crate::places::in_workspace;
use kitsuke::tailoring::{Level, RuleSet, Side, Verdict};
use kitsuke_pipeline::diagnostic::{self, Diagnostic, Format};
use kitsuke_pipeline::source::measurements::{self, Wearer};
use kitsuke_pipeline::source::rules;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::process::ExitCode;

/// Print the tailoring dimensions of bodies, and what a tailor would say
#[derive(clap::Args)]
pub struct Args {
    /// A table of measurements: CSV, TOML, ANSUR II, FreeSewing JSON or Seamly .smis
    #[arg(long, value_name = "FILE")]
    bodies: PathBuf,
    /// The rule set
    #[arg(long, value_name = "NAME", default_value = "women-a")]
    rules: String,
    /// Only this row, counted from 1
    #[arg(long, value_name = "N")]
    row: Option<usize>,
    /// The folder with the rule sets
    #[arg(long, value_name = "DIR", default_value_os_t = in_workspace("assets-src/rules"))]
    rules_dir: PathBuf,
}

/// Prints; 1 when table or rules are wrong, or a body lacks a measurement.
pub fn run(args: Args) -> ExitCode {
    let bodies_dir = args.bodies.parent().unwrap_or(Path::new(""));
    let rules = or_print(rules::load(&args.rules_dir, &args.rules), &args.rules_dir);
    let wearers = or_print(measurements::load(&args.bodies), bodies_dir);
    let (Some(rules), Some(wearers)) = (rules, wearers) else { return ExitCode::FAILURE };
    let shown: Vec<&Wearer> = wearers.iter().filter(|wearer| args.row.is_none_or(|row| wearer.row == row)).collect();
    if shown.is_empty() {
        eprintln!("error: the table has no row {}, only 1 to {}", args.row.unwrap_or_default(), wearers.len());
        return ExitCode::FAILURE;
    }
    println!("{}: {}", rules.name, rules.source);
    let mut counts = BTreeMap::new();
    let mut is_complete = true;
    for wearer in &shown {
        is_complete &= print_wearer(&rules, wearer, &mut counts);
    }
    if shown.len() > 1 {
        println!("\nof {} wearers", shown.len());
        for check in &rules.checks {
            let count = |level| counts.get(&(check.name.as_str(), level)).copied().unwrap_or(0);
            println!("  {:<14}{:>6} warn{:>6} impossible", check.name, count(Level::Warn), count(Level::Impossible));
        }
    }
    if is_complete { ExitCode::SUCCESS } else { ExitCode::FAILURE }
}

/// What was read, or the messages on the error stream.
pub fn or_print<T>(read: Result<T, Vec<Diagnostic>>, folder: &Path) -> Option<T> {
    let print =
        |report: Vec<Diagnostic>| eprint!("{}", diagnostic::render(&report, folder, Format::Human { color: false }));
    read.map_err(print).ok()
}

fn print_wearer<'a>(rules: &'a RuleSet, wearer: &Wearer, counts: &mut BTreeMap<(&'a str, Level), usize>) -> bool {
    println!("\nrow {}, {}", wearer.row, wearer.name);
    let dimensions = match rules.dimensions(&wearer.measurements) {
        Ok(dimensions) => dimensions,
        Err(error) => {
            eprintln!("error: row {}, {}: {error}", wearer.row, wearer.name);
            return false;
        }
    };
    for (rule, value_m) in rules.dimensions.iter().zip(&dimensions.0).filter(|(rule, _)| !rule.ja.is_empty()) {
        println!("  {:<14}{:>8.2} cm  {}  {}", rule.name, value_m * 100.0, kujira(*value_m), rule.ja);
    }
    for verdict in rules.verdicts(&wearer.measurements, &dimensions) {
        *counts.entry((verdict.check.name.as_str(), verdict.level)).or_default() += 1;
        println!("  {}", said(&verdict));
    }
    true
}

/// In shaku, sun and bu, to a tenth of a bu.
fn kujira(length_m: f32) -> String {
    const BU_M: f32 = 0.003_788;
    let tenths = (length_m.abs() / BU_M * 10.0).round() as u64;
    let sign = if length_m < 0.0 && tenths > 0 { "-" } else { " " };
    format!("{sign}{} shaku {} sun {}.{} bu", tenths / 1000, tenths / 100 % 10, tenths / 10 % 10, tenths % 10)
}

fn said(verdict: &Verdict<'_>) -> String {
    let name_and_value = format!("{:<14}{:>8.2} cm", verdict.check.name, verdict.value_m * 100.0);
    match verdict.limit {
        None => format!("{name_and_value}  ok"),
        Some((limit, bound_m)) => {
            let level = if verdict.level == Level::Warn { "warn" } else { "impossible" };
            let side = if limit.side == Side::Above { "above" } else { "below" };
            format!("{name_and_value}  {level}, {side} {:.2} cm: {}", bound_m * 100.0, limit.text)
        }
    }
}
