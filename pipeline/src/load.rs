//! Source → Ir in one call. Knows neither stages nor packs.

use crate::diagnostic::{self, Diagnostic, Severity};
use crate::scans::{self, LaidScan, Workshop};
use crate::source::InputFile;
use crate::{check, ir, source};
use std::path::Path;

/// What a garment folder gave.
#[derive(Debug)]
pub struct Loaded {
    /// The checked garment; `None` when there is an error.
    pub garment: Option<ir::Garment>,
    /// Errors and warnings, sorted.
    pub diagnostics: Vec<Diagnostic>,
    /// Every file that was read, by path.
    pub inputs: Vec<InputFile>,
    /// How its scans were laid on, by file.
    pub scans: Vec<LaidScan>,
}

/// Reads and checks a garment folder without scans: all mistakes in one run.
#[must_use]
pub fn load(garment_dir: &Path) -> Loaded {
    load_with(garment_dir, None)
}

/// Reads and checks a garment folder: all mistakes in one run. Its scans are cleaned in the workshop.
#[must_use]
pub fn load_with(garment_dir: &Path, workshop: Option<&Workshop<'_>>) -> Loaded {
    let mut report = Vec::new();
    let (mut source, inputs) = source::read(garment_dir, &mut report);
    let mut laid = Vec::new();
    if let Some(source) = &mut source {
        laid = scans::register(source, workshop, &mut report);
    }
    let garment = source.and_then(|source| check::check(source, &mut report));
    let diagnostics = diagnostic::sorted(report);
    let is_sound = diagnostics.iter().all(|diagnostic| diagnostic.severity != Severity::Error);
    assert_eq!(garment.is_some(), is_sound, "a garment is refused exactly when the reason is reported");
    Loaded { garment, diagnostics, inputs, scans: laid }
}
