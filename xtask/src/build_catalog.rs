//! `cargo xtask build-catalog`: all packs that have to be built, and the index.

use crate::check::MessageFormat;
use crate::places::in_workspace;
use indicatif::{MultiProgress, ProgressBar, ProgressStyle};
use kitsuke_pipeline::StageRun;
use kitsuke_pipeline::catalog::{self, GarmentReport, Mode, Options, Outcome, Progress, Report};
use kitsuke_pipeline::diagnostic;
use kitsuke_pipeline::memo::Origin;
use std::collections::{BTreeMap, BTreeSet};
use std::io::IsTerminal;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::sync::Mutex;

/// Build the packs that have to be built, and the index
#[derive(clap::Args)]
pub struct Args {
    /// Garments to build; all when none is named
    ids: Vec<String>,
    /// Fail if the index would change
    #[arg(long, conflicts_with = "check")]
    locked: bool,
    /// Write nothing; fail if anything would change
    #[arg(long)]
    check: bool,
    /// Say why each garment is built and which stages ran
    #[arg(long)]
    explain: bool,
    /// Threads; as many as processors when not given
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024))]
    jobs: Option<u16>,
    /// Write every intermediate result into this folder
    #[arg(long, value_name = "DIR")]
    emit: Option<PathBuf>,
    /// The folder with one folder per kimono
    #[arg(long, value_name = "DIR", default_value_os_t = in_workspace("assets-src"))]
    assets: PathBuf,
    /// The folder of index and packs
    #[arg(long, value_name = "DIR", default_value_os_t = in_workspace("catalog"))]
    catalog: PathBuf,
    /// The folder of earlier results; may be deleted at any time
    #[arg(long, value_name = "DIR", default_value_os_t = in_workspace("target/kitsuke-cache"))]
    cache: PathBuf,
    /// How mistakes are written
    #[arg(long, value_enum, default_value_t)]
    message_format: MessageFormat,
}

/// Builds; fails when a garment has errors, or when `--locked` or `--check` finds a difference.
pub fn run(args: Args) -> ExitCode {
    let mode = match (args.locked, args.check) {
        (true, _) => Mode::Locked,
        (_, true) => Mode::Check,
        _ => Mode::Write,
    };
    let Args { ids, explain, jobs, emit, assets, catalog, cache, message_format, .. } = args;
    let options = Options { assets, catalog, cache, ids, mode, emit };
    let known = known_ids(&options.catalog);
    let threads = rayon::ThreadPoolBuilder::new().num_threads(jobs.unwrap_or(0).into()).build();
    let threads = threads.expect("the system starts as many threads as were asked for");
    let progress = Lines::new(&options.assets, message_format, explain);
    match threads.install(|| catalog::build(&options, &progress)) {
        Ok(report) => {
            if mode == Mode::Write && matches!(message_format, MessageFormat::Human) {
                next_steps(&report, &known, &options).iter().for_each(|line| println!("{line}"));
            }
            conclude(&report, mode)
        }
        Err(error) => {
            eprintln!("error: {error}");
            ExitCode::FAILURE
        }
    }
}

/// The garments of the index as it stands; of one that cannot be read none, for the build says so.
fn known_ids(catalog: &Path) -> BTreeSet<String> {
    let (index, unreadable) = catalog::index::read(&catalog.join("index.toml")).unwrap_or_default();
    index.into_keys().chain(unreadable).collect()
}

/// What comes after a garment's first build; nothing where all garments had been built before.
fn next_steps(report: &Report, known: &BTreeSet<String>, options: &Options) -> Vec<String> {
    let is_first =
        |garment: &&GarmentReport| matches!(garment.outcome, Outcome::Built(_)) && !known.contains(&garment.id);
    let new: Vec<&str> = report.garments.iter().filter(is_first).map(|garment| garment.id.as_str()).collect();
    let [id, ..] = new[..] else { return Vec::new() };
    let folders = [("--assets", &options.assets, "assets-src"), ("--catalog", &options.catalog, "catalog")];
    let elsewhere = folders.into_iter().filter(|(_, folder, usual)| **folder != in_workspace(usual));
    let elsewhere: String = elsewhere.map(|(option, folder, _)| format!(" {option} {}", folder.display())).collect();
    let index = options.catalog.join("index.toml");
    vec![
        format!("{}: new in the catalog. What comes next:", new.join(", ")),
        format!("  cargo xtask preview {id}{elsewhere}: look at base and targets"),
        format!("  cargo xtask leave-one-out {id}{elsewhere}: where a pose is missing"),
        format!("  cargo xtask suggest {id}{elsewhere}: which targets to make next, with rows for poses.csv"),
        format!("  git add {}: commit it with the kimono's folder", index.display()),
        "  sizes, so that it can be fitted to wearers: step 9 of assets-src/README.md, then cargo xtask fit".to_owned(),
    ]
}

/// Says how the catalog changed, or would have had to.
fn conclude(report: &Report, mode: Mode) -> ExitCode {
    let refused = mode != Mode::Write && !report.changes.is_empty();
    if refused {
        let (what, hint) = match mode {
            Mode::Locked => ("the index would change", "build without --locked and commit catalog/index.toml"),
            _ => ("the catalog would change", "build without --check"),
        };
        eprintln!("error: {what}:");
        report.changes.iter().for_each(|change| eprintln!("  {change}"));
        eprintln!("  {hint}");
    }
    if refused || !report.is_complete() { ExitCode::FAILURE } else { ExitCode::SUCCESS }
}

/// Bars on a terminal, plain lines elsewhere.
struct Lines<'a> {
    assets: &'a Path,
    format: MessageFormat,
    explain: bool,
    bars: Option<MultiProgress>,
    by_garment: Mutex<BTreeMap<String, ProgressBar>>,
}

impl Lines<'_> {
    fn new(assets: &Path, format: MessageFormat, explain: bool) -> Lines<'_> {
        let bars = std::io::stderr().is_terminal().then(MultiProgress::new);
        Lines { assets, format, explain, bars, by_garment: Mutex::default() }
    }

    /// Prints what was found, then lines for people, without tearing a bar. Programs read standard output, so there
    /// those lines go to standard error.
    fn print(&self, found: &[diagnostic::Diagnostic], lines: &[String]) {
        let print = || {
            print!("{}", diagnostic::render(found, self.assets, self.format.format()));
            for line in lines {
                match self.format {
                    MessageFormat::Human => println!("{line}"),
                    MessageFormat::Json | MessageFormat::Github => eprintln!("{line}"),
                }
            }
        };
        match &self.bars {
            Some(bars) => bars.suspend(print),
            None => print(),
        }
    }
}

impl Progress for Lines<'_> {
    fn note(&self, text: &str) {
        self.print(&[], &[format!("note: {text}")]);
    }

    fn started(&self, id: &str) {
        let Some(bars) = &self.bars else { return self.print(&[], &[format!("{id}: building")]) };
        let style = ProgressStyle::with_template("{prefix}: {spinner} {pos} stages, {msg}").expect("a fixed template");
        let bar = bars.add(ProgressBar::new_spinner().with_style(style).with_prefix(id.to_owned()));
        bar.set_message("reading");
        self.by_garment.lock().expect("no panic while held").insert(id.to_owned(), bar);
    }

    fn stage(&self, id: &str, run: &StageRun) {
        if let Some(bar) = self.by_garment.lock().expect("no panic while held").get(id) {
            bar.inc(1);
            bar.set_message(name(run));
        }
    }

    fn finished(&self, report: &GarmentReport) {
        if let Some(bar) = self.by_garment.lock().expect("no panic while held").remove(&report.id) {
            bar.finish_and_clear();
        }
        let mut lines = if self.explain { explanation(report) } else { Vec::new() };
        lines.push(summary(report));
        self.print(&report.diagnostics, &lines);
    }
}

fn name(run: &StageRun) -> String {
    run.target.as_ref().map_or_else(|| run.stage.to_owned(), |target| format!("{} of {target}", run.stage))
}

/// Why a garment was built, which stages ran, and which earlier results served.
fn explanation(report: &GarmentReport) -> Vec<String> {
    let id = &report.id;
    let mut lines: Vec<String> = report.reasons.iter().map(|reason| format!("{id}: {reason}")).collect();
    for (origin, what) in [(Origin::Computed, "ran"), (Origin::Remembered, "remembered")] {
        let names: Vec<String> = report.runs.iter().filter(|run| run.origin == origin).map(name).collect();
        if !names.is_empty() {
            lines.push(format!("{id}: {what}: {}", names.join(", ")));
        }
    }
    lines
}

fn summary(report: &GarmentReport) -> String {
    let id = &report.id;
    match &report.outcome {
        Outcome::UpToDate => format!("{id}: up to date"),
        Outcome::Failed => format!("{id}: not built, {}", diagnostic::summary(&report.diagnostics, id)),
        Outcome::Built(entry) => format!(
            "{id}: {} targets, {} bytes, error {:.3} mm at most, {:.3} mm on average",
            entry.targets.len(),
            entry.bytes,
            entry.max_mm,
            entry.mean_mm
        ),
    }
}
