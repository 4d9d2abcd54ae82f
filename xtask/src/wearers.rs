//! Bodies of tables, as options name them, the kimono fitted to them, and their own skin.

use crate::fit::rule_set;
use crate::places::Places;
use crate::tailor::or_print;
use kitsuke::fit::{Fitted, Tailor, Verdict};
use kitsuke::{Garment, Pack};
use kitsuke_pipeline::ir;
use kitsuke_pipeline::measure::wearer::worn;
use kitsuke_pipeline::source::body as body_file;
use kitsuke_pipeline::source::folder::{FILE_BYTES, read_at_most};
use kitsuke_pipeline::source::measurements;
use std::path::{Path, PathBuf};

/// Who wears the kimono, as options of a verb: its own wearer unless they name another. Verbs that need her skin make `--body` require
/// `--wearer`.
#[derive(clap::Args)]
pub struct Wearer {
    /// Fit the kimono to the Nth body of a table, from 1
    #[arg(long, value_name = "FILE#N")]
    body: Option<String>,
    /// That body itself, a GLB in the T-pose; without a skin it must be the kimono's own body in another shape
    #[arg(long, value_name = "GLB", requires = "body")]
    wearer: Option<PathBuf>,
    /// The rule set of the fit [default: the kimono's own]
    #[arg(long, value_name = "NAME", requires = "body")]
    rules: Option<String>,
}

impl Wearer {
    /// The pack's kimono, fitted to her, and its sources, with her skin where that is known; `None`, with a printed line, where they
    /// cannot be read.
    pub fn garment_and_source(&self, places: &Places, pack: &Pack) -> Result<(Garment, Option<ir::Garment>), String> {
        let source = places.source(&pack.garment().data().id);
        let Some(body) = &self.body else { return Ok((pack.garment().clone(), source)) };
        let fitted = fitted_to(places, pack, body, self.rules.as_deref())?;
        let Some(glb) = &self.wearer else { return Ok((fitted.garment, source)) };
        let base = source.ok_or("the kimono's own body is needed to know where its cloth lies on the skin")?;
        let source = worn_by(base, &fitted, glb, body)?;
        Ok((fitted.garment, Some(source)))
    }

    /// Whether only her measurements are known, not her skin.
    pub fn is_unseen(&self) -> bool {
        self.body.is_some() && self.wearer.is_none()
    }

    /// `FILE#N` as a part of the names of files.
    pub fn file_part(&self) -> Option<String> {
        let body = self.body.as_ref()?;
        Some(Path::new(body).file_name().unwrap_or_default().to_string_lossy().replace('#', "_"))
    }
}

/// The Nth body of a table as `FILE#N` names it, from 1; all of them without `#N`.
pub fn load(named: &str) -> Result<Vec<measurements::Wearer>, String> {
    // A file whose own name has a `#` is itself.
    let (file, row) = match named.rsplit_once('#') {
        Some((file, row)) if !Path::new(named).is_file() => {
            (file, Some(row.parse::<usize>().map_err(|_| format!("`{row}` in {named} is not the number of a row"))?))
        }
        _ => (named, None),
    };
    let file = Path::new(file);
    let Some(mut wearers) = or_print(measurements::load(file), file.parent().unwrap_or(Path::new(""))) else {
        return Err(format!("{} cannot be used", file.display()));
    };
    let count = wearers.len();
    wearers.retain(|wearer| row.is_none_or(|row| wearer.row == row));
    match row {
        Some(row) if wearers.is_empty() => Err(format!("{} has no row {row}, only 1 to {count}", file.display())),
        _ => Ok(wearers),
    }
}

/// The kimono for the one body that `FILE#N` names, by this rule set or its own; says on the error stream what is out of the ordinary.
pub fn fitted_to(places: &Places, pack: &Pack, body: &str, rules: Option<&str>) -> Result<Fitted, String> {
    let tailor = Tailor::new(pack.garment(), places.fit_data(pack)?).map_err(|error| error.to_string())?;
    let fitter = tailor.fitter();
    let rules = rule_set(fitter, rules)?;
    let wearers = load(body)?;
    let [wearer] = &wearers[..] else {
        return Err(format!("{body} has {} bodies; say which is meant, for example {body}#1", wearers.len()));
    };
    let fitted = tailor
        .fitted(pack.garment(), &wearer.measurements, rules)
        .map_err(|error| format!("row {}, {}: {error}", wearer.row, wearer.name))?;
    if fitted.fit.verdict != Verdict::Reachable {
        eprintln!("note: {}: {}", wearer.name, fitter.explain(&fitted.fit, &wearer.measurements));
    }
    Ok(fitted)
}

/// What a fitted kimono is worn over: its sources with the body of a GLB in the place of the base's. The GLB must be that of the body to
/// which the kimono was fitted, `FILE#N`.
fn worn_by(source: ir::Garment, fitted: &Fitted, glb: &Path, body: &str) -> Result<ir::Garment, String> {
    let file = glb.display();
    let bytes = read_at_most(glb, FILE_BYTES).map_err(|error| format!("cannot read the wearer {file}: {error}"))?;
    let mut report = Vec::new();
    let name = glb.file_name().unwrap_or(glb.as_os_str()).to_string_lossy();
    let read = body_file::read_wearer(&name, &bytes, &mut report).ok_or(report);
    let read = or_print(read, glb.parent().unwrap_or(Path::new(""))).ok_or(format!("{file} cannot be used"))?;
    worn(source, &fitted.garment, read).map_err(|error| {
        format!("{file} is not the wearer of the kimono fitted to {body}: {error}; name the GLB of that very body")
    })
}
