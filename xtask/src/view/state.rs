//! What the page shows: per garment whether it is built and what is wrong, numbered, so that pages learn of every change. Builds what has
//! changed.

use super::watch::{Changed, Changes};
use kitsuke::Pack;
use kitsuke_pipeline::catalog::{self, Mode, Options, Outcome, Silent};
use kitsuke_pipeline::diagnostic::{self, Diagnostic, Format, Severity};
use kitsuke_pipeline::{Workshop, draft, ir, load_with};
use serde_json::{Value, json};
use std::collections::BTreeMap;
use std::path::PathBuf;
use std::sync::{Arc, Mutex};
use tokio::sync::watch;

/// Folders.
pub struct Places {
    pub assets: PathBuf,
    pub catalog: PathBuf,
    pub cache: PathBuf,
}

/// A garment as the page knows it.
#[derive(Clone, Default)]
struct Shown {
    name: String,
    /// `building`, `built` or `failed`.
    status: &'static str,
    /// Counts the packs that could be shown; 0 before the first.
    pack: u64,
    /// The shapes as saved, until they are built.
    draft: Option<Arc<Vec<u8>>>,
    errors: usize,
    warnings: usize,
    /// In the words of `check`.
    said: String,
    /// What it was made from, when it was last sound.
    source: Option<Arc<ir::Garment>>,
}

/// All garments.
pub struct State {
    pub places: Places,
    shown: Mutex<BTreeMap<String, Shown>>,
    /// Counts changes.
    version: watch::Sender<u64>,
}

impl State {
    /// Nothing is built yet.
    pub fn new(places: Places, ids: &[String]) -> State {
        let shown = ids.iter().map(|id| (id.clone(), Shown { status: "building", ..Shown::default() })).collect();
        State { places, shown: Mutex::new(shown), version: watch::Sender::new(1) }
    }

    /// Builds everything, then whatever changes, until nobody watches any more.
    pub fn keep_built(&self, changes: &Changes) {
        let mut changed = Changed { everything: true, ..Changed::default() };
        loop {
            for id in self.touched(&changed) {
                self.build(&id);
            }
            let Some(next) = changes.next() else { return };
            changed = next;
        }
    }

    /// The garments of a change: shared folders belong to all.
    fn touched(&self, changed: &Changed) -> Vec<String> {
        let shown = self.shown.lock().expect("no panic while held");
        let all =
            changed.everything || changed.folders.iter().any(|folder| !shown.contains_key(folder) && is_shared(folder));
        shown.keys().filter(|id| all || changed.folders.contains(*id)).cloned().collect()
    }

    fn build(&self, id: &str) {
        self.change(id, |shown| shown.status = "building");
        // What is wrong is told before anything is built.
        let tell = |_: &str| self.change(id, |shown| shown.status = "scans");
        let workshop = Workshop { cache: &self.places.cache, tell: &tell };
        let loaded = load_with(&self.places.assets.join(id), Some(&workshop));
        let source = loaded.garment.map(Arc::new);
        self.say(id, &loaded.diagnostics, source.is_some());
        if source.is_none() {
            return self.change(id, |shown| shown.status = "failed");
        }
        if let (Some(source), Some(built)) = (&source, self.built_pack(id)) {
            let draft = draft(source, &built).map(Arc::new);
            self.change(id, |shown| {
                shown.source = Some(Arc::clone(source));
                // The pack of an earlier day is shown at once, too.
                shown.pack += u64::from(draft.is_some() || shown.pack == 0);
                shown.draft = draft;
            });
        }
        let Places { assets, catalog, cache } = &self.places;
        let options = Options {
            assets: assets.clone(),
            catalog: catalog.clone(),
            cache: cache.clone(),
            ids: vec![id.to_owned()],
            mode: Mode::Write,
            emit: None,
        };
        match catalog::build(&options, &Silent) {
            Ok(report) => {
                for garment in report.garments.into_iter().filter(|garment| garment.id == id) {
                    let is_built = !matches!(garment.outcome, Outcome::Failed);
                    self.say(id, &garment.diagnostics, is_built);
                    self.change(id, |shown| {
                        shown.status = if is_built { "built" } else { "failed" };
                        if is_built {
                            shown.pack += 1;
                            shown.draft = None;
                            shown.source = source.clone();
                        }
                    });
                }
            }
            Err(error) => self.change(id, |shown| {
                shown.status = "failed";
                shown.said = format!("error: {error}");
            }),
        }
    }

    fn say(&self, id: &str, found: &[Diagnostic], is_sound: bool) {
        let count = |severity| found.iter().filter(|diagnostic| diagnostic.severity == severity).count();
        let mut said = diagnostic::render(found, &self.places.assets, Format::Human { color: false });
        if found.is_empty() && is_sound {
            said = format!("no mistakes in {id}");
        }
        let [errors, warnings] = [Severity::Error, Severity::Warning].map(count);
        self.change(id, |shown| (shown.errors, shown.warnings, shown.said) = (errors, warnings, said));
    }

    fn change(&self, id: &str, change: impl FnOnce(&mut Shown)) {
        change(self.shown.lock().expect("no panic while held").entry(id.to_owned()).or_default());
        self.version.send_modify(|version| *version += 1);
    }

    /// The garments as JSON, once there is a change after `version`.
    pub async fn after(&self, version: u64) -> Value {
        let mut changes = self.version.subscribe();
        // A page asks again when nothing has come for a while.
        let wait = changes.wait_for(|now| *now > version);
        let _ = tokio::time::timeout(std::time::Duration::from_secs(20), wait).await;
        let now = *self.version.borrow();
        let shown = self.shown.lock().expect("no panic while held");
        let garments: Vec<Value> = shown
            .iter()
            .map(|(id, shown)| {
                json!({
                    "id": id, "name": shown.name, "status": shown.status, "pack": shown.pack,
                    "draft": shown.draft.is_some(), "errors": shown.errors, "warnings": shown.warnings, "said": shown.said,
                })
            })
            .collect();
        json!({ "version": now, "garments": garments })
    }

    /// What a garment was made from, when it was last sound.
    pub fn source(&self, id: &str) -> Option<Arc<ir::Garment>> {
        self.shown.lock().expect("no panic while held").get(id)?.source.clone()
    }

    /// The bytes of a garment's pack, or of its draft.
    pub fn pack_bytes(&self, id: &str) -> Option<Vec<u8>> {
        let draft = self.shown.lock().expect("no panic while held").get(id)?.draft.clone();
        match draft {
            Some(draft) => Some(draft.to_vec()),
            None => std::fs::read(catalog::pack_path(&self.places.catalog, id)).ok(),
        }
    }

    fn built_pack(&self, id: &str) -> Option<Pack> {
        Pack::open(&std::fs::read(catalog::pack_path(&self.places.catalog, id)).ok()?).ok()
    }

    /// A garment's pack, opened.
    pub fn pack(&self, id: &str) -> Option<Pack> {
        Pack::open(&self.pack_bytes(id)?).ok()
    }
}

/// Folders beside the garments that garments read.
fn is_shared(folder: &str) -> bool {
    matches!(folder, "bodies" | "rules")
}
