//! Builds the catalog: which garments have to be built, what is written where, and what the index says. The only place
//! that writes packs.
//!
//! Every file is written beside its place and renamed, so that a build killed at any moment leaves whole files.

mod emit;
pub mod index;
mod last_build;
mod report;
mod scan_report;

use crate::build::{Built, StageRun, build_garment};
use crate::diagnostic::{Diagnostic, Place};
use crate::memo::Memo;
use crate::scans::Workshop;
use crate::stages::regions::Remainder;
use crate::{load, source};
use index::{Entry, Index};
use kitsuke::Pack;
use kitsuke::pack::layout;
use last_build::LastBuild;
use rayon::prelude::*;
use std::collections::BTreeMap;
use std::io::Write;
use std::path::{Path, PathBuf};

/// What to build, and where.
#[derive(Clone, Debug)]
pub struct Options {
    /// Holds one folder per garment.
    pub assets: PathBuf,
    /// Holds `index.toml` and `packs/`.
    pub catalog: PathBuf,
    /// Holds results of stages and records of builds; may be deleted at any time.
    pub cache: PathBuf,
    /// The garments to build, besides those whose entries of the index cannot be read; empty means all, and then what is gone
    /// from `assets` goes from the catalog too.
    pub ids: Vec<String>,
    /// What may be written.
    pub mode: Mode,
    /// Where to write the results of all stages for looking at them.
    pub emit: Option<PathBuf>,
}

/// What a build may write into the catalog.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Mode {
    /// Index and packs.
    Write,
    /// Packs that agree with the index.
    Locked,
    /// Nothing.
    Check,
}

/// What happened to one garment.
#[derive(Clone, Debug)]
pub struct GarmentReport {
    /// Its ID.
    pub id: String,
    /// How it ended.
    pub outcome: Outcome,
    /// Why it was built, one line each: the inputs that changed.
    pub reasons: Vec<String>,
    /// The stages, sorted.
    pub runs: Vec<StageRun>,
    /// What the artist should know.
    pub diagnostics: Vec<Diagnostic>,
}

/// How the build of a garment ended.
#[derive(Clone, Debug)]
pub enum Outcome {
    /// Nothing had changed.
    UpToDate,
    /// It was built; this is its entry of the index.
    Built(Box<Entry>),
    /// It was not; the diagnostics say why.
    Failed,
}

/// What a build did.
#[derive(Clone, Debug)]
pub struct Report {
    /// Garment by garment, sorted.
    pub garments: Vec<GarmentReport>,
    /// How the catalog changed (or, where it may not be written, would have to), one line each.
    pub changes: Vec<String>,
}

impl Report {
    /// Whether every garment was built.
    #[must_use]
    pub fn is_complete(&self) -> bool {
        self.garments.iter().all(|garment| !matches!(garment.outcome, Outcome::Failed))
    }
}

/// Told what goes on, from any thread.
pub trait Progress: Sync {
    /// Something that a person should know before anything is built.
    fn note(&self, _text: &str) {}
    /// A garment has to be built.
    fn started(&self, _id: &str) {}
    /// A stage of it is done.
    fn stage(&self, _id: &str, _run: &StageRun) {}
    /// It is finished.
    fn finished(&self, _report: &GarmentReport) {}
}

/// Tells nobody.
pub struct Silent;

impl Progress for Silent {}

/// Why there is no report.
#[derive(Debug, thiserror::Error)]
pub enum CatalogError {
    /// A file or folder could not be read or written.
    #[error("{}: {problem}", path.display())]
    Io {
        /// Which.
        path: PathBuf,
        /// What the system says.
        problem: String,
    },
    /// The index is no TOML.
    #[error("{}:{line}: {problem}; restore it, or delete it and build the whole catalog", path.display())]
    Index {
        /// The file.
        path: PathBuf,
        /// Where, counted from 1.
        line: usize,
        /// What is wrong.
        problem: String,
    },
    /// There is no such garment.
    #[error("there is no garment {id} in {}{}", assets.display(), similar.as_ref().map_or_else(String::new, |id| format!("; did you mean {id}?")))]
    Unknown {
        /// What was asked for.
        id: String,
        /// Where.
        assets: PathBuf,
        /// What is there and spelled alike.
        similar: Option<String>,
    },
}

impl CatalogError {
    fn io(path: &Path, error: &impl std::fmt::Display) -> CatalogError {
        CatalogError::Io { path: path.to_owned(), problem: error.to_string() }
    }
}

/// Builds what has changed.
///
/// # Errors
/// When the catalog cannot be read or written, or a garment asked for does not exist. Mistakes in garments are no
/// errors here: they are in the report, all together.
pub fn build(options: &Options, progress: &dyn Progress) -> Result<Report, CatalogError> {
    let named = garment_ids(&options.assets, &options.ids)?;
    let index_path = options.catalog.join("index.toml");
    let _lock = (options.mode != Mode::Check).then(|| lock(&options.cache, progress)).transpose()?;
    let (old, unreadable) = index::read(&index_path)?;
    let mut ids = garment_ids(&options.assets, &[])?;
    ids.retain(|id| named.contains(id) || unreadable.contains(id));
    for id in &unreadable {
        let index = index_path.display();
        progress.note(&format!("{index}: the entry of {id} lacks figures, so {id} counts as not built"));
    }
    let builder = builder();
    let memo = Memo::new(&options.cache.join("stages"));
    let job = Job { options, index: &old, builder: &builder, memo: &memo, progress };
    let results: Vec<(GarmentReport, Option<NewPack>)> =
        ids.par_iter().map(|id| job.build(id)).collect::<Result<_, _>>()?;
    for folder in ["stages", "scans"] {
        Memo::new(&options.cache.join(folder)).trim();
    }

    let mut new = old.clone();
    if options.ids.is_empty() {
        new.retain(|id, _| ids.contains(id));
    }
    for (garment, _) in &results {
        if let Outcome::Built(entry) = &garment.outcome {
            new.insert(garment.id.clone(), Entry::clone(entry));
        }
    }
    let mut changes = index::differences(&old, &new);
    let gone = unreadable.iter().filter(|id| !ids.contains(id));
    changes.extend(gone.map(|id| format!("{id}: is in the index, but its garment is gone")));
    let mut reported = false;
    for (garment, pack) in &results {
        let Some(pack) = pack else { continue };
        let agrees = old.get(&garment.id) == new.get(&garment.id);
        let path = options.pack_path(&garment.id);
        let is_written = std::fs::read(&path).is_ok_and(|bytes| bytes == pack.bytes);
        let may_write = options.mode == Mode::Write || options.mode == Mode::Locked && agrees;
        if agrees && !is_written && options.mode != Mode::Locked {
            changes.push(format!("{}: its pack is not in the catalog", garment.id));
        }
        if may_write {
            if !is_written {
                write_renamed(&path, &pack.bytes)?;
            }
            write_renamed(&options.record_path(&garment.id), pack.record.to_text().as_bytes())?;
            write_renamed(&options.report_path(&garment.id), pack.report.as_bytes())?;
            reported = true;
        }
    }
    if reported {
        write_renamed(&options.report_path("index"), report::index(&new).as_bytes())?;
    }
    if options.mode == Mode::Write {
        for id in old.keys().chain(&unreadable).filter(|id| !new.contains_key(*id) && !ids.contains(id)) {
            remove(&options.pack_path(id))?;
            remove(&options.report_path(id))?;
        }
        if old != new || !unreadable.is_empty() || !index_path.exists() {
            write_renamed(&index_path, index::to_text(&new).as_bytes())?;
        }
    }
    Ok(Report { garments: results.into_iter().map(|(garment, _)| garment).collect(), changes })
}

impl Options {
    fn pack_path(&self, id: &str) -> PathBuf {
        pack_path(&self.catalog, id)
    }

    fn report_path(&self, id: &str) -> PathBuf {
        self.catalog.join("reports").join(format!("{id}.html"))
    }

    fn record_path(&self, id: &str) -> PathBuf {
        self.cache.join("builds").join(id)
    }
}

/// Where the pack of a garment lies in a catalog's folder.
#[must_use]
pub fn pack_path(catalog: &Path, id: &str) -> PathBuf {
    catalog.join("packs").join(format!("{id}.kitsuke"))
}

/// The garments named, by ID or by their folder, or all of the assets folder where none is, sorted.
///
/// # Errors
/// The folder cannot be read or holds no garment, or one that is named is not in it.
pub fn garment_ids(assets: &Path, named: &[String]) -> Result<Vec<String>, CatalogError> {
    let mut all = source::garment_ids(assets).map_err(|error| CatalogError::io(assets, &error))?;
    if all.is_empty() {
        let problem = "there is no garment folder (one that holds garment.toml)".to_owned();
        return Err(CatalogError::Io { path: assets.to_owned(), problem });
    }
    let named: Vec<String> = named.iter().map(|named| as_id(assets, named)).collect();
    for id in &named {
        if !all.contains(id) {
            let similar = source::closest(id, all.iter().map(String::as_str)).map(str::to_owned);
            return Err(CatalogError::Unknown { id: id.clone(), assets: assets.to_owned(), similar });
        }
    }
    all.retain(|id| named.is_empty() || named.contains(id));
    Ok(all)
}

/// The ID of a garment that is named by the path of its folder; else what was named.
fn as_id(assets: &Path, named: &str) -> String {
    let path = Path::new(named);
    let id = path.file_name().and_then(|name| name.to_str()).unwrap_or(named);
    let is_same = |a: &Path, b: &Path| a.canonicalize().is_ok_and(|a| b.canonicalize().is_ok_and(|b| a == b));
    match is_same(path, &assets.join(id)) || named.trim_end_matches(['/', '\\']) == id {
        true => id.to_owned(),
        false => named.to_owned(),
    }
}

/// The hash of the running program: another program may build other packs from the same inputs. Empty when it cannot be
/// read (it was replaced while it runs); then nothing counts as up to date.
fn builder() -> String {
    let program = std::env::current_exe().and_then(std::fs::read);
    program.map(|bytes| hash(&bytes)).unwrap_or_default()
}

/// What the builds of all garments share.
struct Job<'a> {
    options: &'a Options,
    index: &'a Index,
    builder: &'a str,
    memo: &'a Memo,
    progress: &'a dyn Progress,
}

/// A pack to be written, with the record of its build.
struct NewPack {
    bytes: Vec<u8>,
    /// In HTML.
    report: String,
    record: LastBuild,
}

impl Job<'_> {
    fn build(&self, id: &str) -> Result<(GarmentReport, Option<NewPack>), CatalogError> {
        let folder = self.options.assets.join(id);
        let last = LastBuild::read(&self.options.record_path(id));
        let mut report = GarmentReport {
            id: id.to_owned(),
            outcome: Outcome::Failed,
            reasons: Vec::new(),
            runs: Vec::new(),
            diagnostics: Vec::new(),
        };
        // Files that cannot be read are reported by `load`, with everything else that is wrong.
        if let Ok(inputs) = source::input_files(&folder) {
            report.reasons = self.reasons(id, last.as_ref(), &LastBuild::inputs(&inputs));
            if report.reasons.is_empty() && self.options.emit.is_none() {
                report.outcome = Outcome::UpToDate;
                // What the build said holds as long as nothing has changed.
                report.diagnostics = last.map(|last| last.said).unwrap_or_default();
                self.progress.finished(&report);
                return Ok((report, None));
            }
        }
        self.progress.started(id);
        let tell = |line: &str| self.progress.note(&format!("{id}: {line}"));
        let workshop = Workshop { cache: &self.options.cache, tell: &tell };
        let loaded = load::load_with(&folder, Some(&workshop));
        report.diagnostics = loaded.diagnostics;
        let mut pack = None;
        if let Some(garment) = loaded.garment {
            let runs = std::sync::Mutex::new(Vec::new());
            let built = build_garment(&garment, self.memo, &|run| {
                self.progress.stage(id, &run);
                runs.lock().expect("no thread panics while it holds this").push(run);
            });
            report.runs = runs.into_inner().expect("no thread panics while it holds this");
            report.runs.sort_by(|a, b| (a.stage, &a.target).cmp(&(b.stage, &b.target)));
            match built {
                Ok(built) => {
                    if let Some(folder) = &self.options.emit {
                        emit::emit(&folder.join(id), &garment, &built)?;
                    }
                    report.diagnostics.extend(remainder_warnings(id, &built));
                    let entry = Entry::new(&built, target_bytes(&built.pack));
                    pack = Some(NewPack {
                        report: report::html(
                            &garment,
                            &built,
                            &entry,
                            &loaded.scans,
                            &report.diagnostics,
                            &self.options.assets,
                        ),
                        record: LastBuild {
                            builder: self.builder.to_owned(),
                            pack: entry.blake3.clone(),
                            entry: hash(entry.to_text().as_bytes()),
                            inputs: LastBuild::inputs(&loaded.inputs),
                            said: report.diagnostics.clone(),
                        },
                        bytes: built.pack,
                    });
                    report.outcome = Outcome::Built(Box::new(entry));
                }
                Err(error) => report.diagnostics.push(
                    Diagnostic::error("stage", format!("{id}/garment.toml"), Place::File)
                        .problem(error.to_string())
                        .help("Mend the named target, the body's skin weights or the budget."),
                ),
            }
        }
        self.progress.finished(&report);
        Ok((report, pack))
    }

    /// Why a garment has to be built; empty when its pack and its entry are those of the same inputs.
    fn reasons(&self, id: &str, last: Option<&LastBuild>, inputs: &BTreeMap<String, String>) -> Vec<String> {
        let Some(last) = last else { return vec!["there is no record of an earlier build".to_owned()] };
        let mut reasons = last.reasons(self.builder, inputs);
        let pack = std::fs::read(self.options.pack_path(id)).map(|bytes| hash(&bytes));
        if !pack.is_ok_and(|pack| pack == last.pack) {
            reasons.push("the pack in the catalog is missing or another".to_owned());
        }
        let entry = self.index.get(id).map(|entry| hash(entry.to_text().as_bytes()));
        if entry.as_ref() != Some(&last.entry) {
            reasons.push("the index says something else".to_owned());
        }
        reasons
    }
}

fn hash(bytes: &[u8]) -> String {
    blake3::hash(bytes).to_hex().to_string()
}

/// How much of a pack the targets take.
fn target_bytes(pack: &[u8]) -> u64 {
    let pack = Pack::open(pack).expect("verified by the build");
    let targets = pack.sections().iter().filter(|section| section.tag == layout::TGTS);
    targets.map(|section| section.stored_length as u64).sum()
}

/// What painted masks cut off, as warnings.
fn remainder_warnings<'a>(id: &'a str, built: &'a Built) -> impl Iterator<Item = Diagnostic> + 'a {
    // What would be said as 0.0 mm is nothing.
    let is_seen = |remainder: &&Remainder| remainder.lost_m >= 0.05e-3;
    built.remainders.iter().filter(is_seen).map(move |remainder| {
        Diagnostic::warning("mask-remainder", format!("{id}/garment.toml"), Place::File)
            .problem(format!(
                "the painted masks cut off up to {:.1} mm where {} moves the cloth (target {}, vertex {})",
                remainder.lost_m * 1e3,
                remainder.driver,
                remainder.target,
                remainder.vertex
            ))
            .help("Paint the mask farther, or set regions = \"auto\".")
    })
}

/// Lets only one build at a time write a catalog (its cache stands for it), else the one that ends last takes the other's entry out of the
/// index. The system lets go of the lock when the process ends, however it does.
fn lock(cache: &Path, progress: &dyn Progress) -> Result<std::fs::File, CatalogError> {
    let path = cache.join("lock");
    let io = |error| CatalogError::io(&path, &error);
    std::fs::create_dir_all(cache).map_err(io)?;
    let mut file =
        std::fs::OpenOptions::new().read(true).write(true).create(true).truncate(false).open(&path).map_err(io)?;
    match file.try_lock() {
        Ok(()) => {}
        Err(std::fs::TryLockError::WouldBlock) => {
            let owner = std::fs::read_to_string(&path).unwrap_or_default();
            progress.note(&format!("another build ({}) writes this catalog; this one waits for it", owner.trim()));
            file.lock().map_err(io)?;
        }
        Err(std::fs::TryLockError::Error(error)) => return Err(io(error)),
    }
    file.set_len(0).and_then(|()| writeln!(file, "process {}", std::process::id())).map_err(io)?;
    Ok(file)
}

/// Writes a file beside its place and renames it.
fn write_renamed(path: &Path, bytes: &[u8]) -> Result<(), CatalogError> {
    let io = |error| CatalogError::io(path, &error);
    let folder = path.parent().expect("every path of the catalog lies in a folder");
    std::fs::create_dir_all(folder).map_err(io)?;
    let mut beside = tempfile::Builder::new();
    #[cfg(unix)]
    beside.permissions(std::os::unix::fs::PermissionsExt::from_mode(0o644));
    let mut file = beside.prefix(".tmp-").tempfile_in(folder).map_err(io)?;
    file.write_all(bytes).map_err(io)?;
    file.into_temp_path().persist(path).map_err(|error| io(error.error))
}

fn remove(path: &Path) -> Result<(), CatalogError> {
    match std::fs::remove_file(path) {
        Err(error) if error.kind() != std::io::ErrorKind::NotFound => Err(CatalogError::io(path, &error)),
        _ => Ok(()),
    }
}
