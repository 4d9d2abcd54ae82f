//! Which garments' files have changed. Knows nothing of what is done about it.

use notify::{EventKind, RecommendedWatcher, RecursiveMode, Watcher};
use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::sync::mpsc::{Receiver, RecvTimeoutError, channel};
use std::time::{Duration, Instant};

/// Programs write a file in several steps: what follows within this time belongs to the same change …
const QUIET: Duration = Duration::from_millis(120);
/// … but nobody waits longer than this.
const LONGEST: Duration = Duration::from_millis(800);

/// Changes of the files in a folder.
pub struct Changes {
    folder: PathBuf,
    events: Receiver<notify::Result<notify::Event>>,
    /// Ends the watching when it is dropped.
    _watcher: RecommendedWatcher,
}

/// What has changed, by the folder's own folders.
#[derive(Debug, Default, PartialEq, Eq)]
pub struct Changed {
    /// Garments, or what garments share (`bodies`, `rules`).
    pub folders: BTreeSet<String>,
    /// Something was overlooked: everything may have changed.
    pub everything: bool,
}

/// Begins to watch a folder.
///
/// # Errors
/// When the system does not allow it.
pub fn changes(folder: &Path) -> Result<Changes, String> {
    let cannot = |error: &dyn std::fmt::Display| format!("cannot watch {}: {error}", folder.display());
    let whole = folder.canonicalize().map_err(|error| cannot(&error))?;
    let (sender, events) = channel();
    let mut watcher =
        notify::recommended_watcher(move |event| _ = sender.send(event)).map_err(|error| cannot(&error))?;
    watcher.watch(&whole, RecursiveMode::Recursive).map_err(|error| cannot(&error))?;
    Ok(Changes { folder: whole, events, _watcher: watcher })
}

impl Changes {
    /// Waits for a change and for its end; nothing once nobody can send any more.
    pub fn next(&self) -> Option<Changed> {
        let mut changed = Changed::default();
        while changed == Changed::default() {
            self.add(self.events.recv().ok()?, &mut changed);
        }
        let first = Instant::now();
        while first.elapsed() < LONGEST {
            match self.events.recv_timeout(QUIET) {
                Ok(event) => self.add(event, &mut changed),
                Err(RecvTimeoutError::Timeout | RecvTimeoutError::Disconnected) => break,
            }
        }
        Some(changed)
    }

    fn add(&self, event: notify::Result<notify::Event>, changed: &mut Changed) {
        let Ok(event) = event else {
            changed.everything = true;
            return;
        };
        changed.everything |= event.need_rescan();
        if matches!(event.kind, EventKind::Access(_)) {
            return;
        }
        for path in &event.paths {
            let inside = path.strip_prefix(&self.folder).ok().and_then(|inside| inside.iter().next());
            changed.folders.extend(inside.map(|folder| folder.to_string_lossy().into_owned()));
        }
    }
}
