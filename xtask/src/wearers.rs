//! Bodies of tables, as options name them, and the kimono fitted to them.

use crate::fit::rule_set;
use crate::places::Places;
use crate::tailor::or_print;
use kitsuke::Pack;
use kitsuke::fit::Verdict;
use kitsuke_pipeline::look::fitted::{Fitted, fitted};
use kitsuke_pipeline::source::measurements::{self, Wearer};
use std::path::Path;

/// The Nth body of a table as `FILE#N` names it, from 1; all of them without `#N`.
pub fn load(named: &str) -> Result<Vec<Wearer>, String> {
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
    let fitter = places.fitter(pack)?;
    let rules = rule_set(&fitter, rules)?;
    let wearers = load(body)?;
    let [wearer] = &wearers[..] else {
        return Err(format!("{body} has {} bodies; say which is meant, for example {body}#1", wearers.len()));
    };
    let fitted = fitted(pack.garment(), &fitter, &wearer.measurements, rules)
        .map_err(|error| format!("row {}, {}: {error}", wearer.row, wearer.name))?;
    if fitted.fit.verdict != Verdict::Reachable {
        eprintln!("note: {}: {}", wearer.name, fitter.explain(&fitted.fit, &wearer.measurements));
    }
    Ok(fitted)
}
