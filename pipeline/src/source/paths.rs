//! `paths.toml`: the tailoring dimensions as vertex paths of the base. Knows nothing of the mesh.

use super::manifest::{self, Field};
use super::units::Length;
use crate::diagnostic::Diagnostic;
use schemars::JsonSchema;
use serde::Deserialize;
use std::collections::BTreeMap;

/// Every path by its name.
#[derive(Debug, Default, Deserialize, JsonSchema)]
#[serde(transparent)]
pub struct Paths(pub BTreeMap<String, PathEntry>);

/// One `[name]`.
#[derive(Debug, Deserialize, JsonSchema)]
#[schemars(deny_unknown_fields)]
pub struct PathEntry {
    /// Kanji.
    #[serde(default)]
    pub ja: String,
    /// The dimension of the rule sets that says how long it should be, for example `sode_take`. A path without a rule is not fitted.
    pub rule: Option<Field<String>>,
    /// How much an error of this dimension counts in a fit; 1 unless given.
    pub load: Option<Field<f64>>,
    /// Added to the sum of the edge lengths.
    pub offset: Option<Length>,
    /// Vertex numbers from 0, each joined to the next by an edge of the base.
    #[schemars(required)]
    pub vertices: Option<Vec<Field<u32>>>,
}

/// Reads the paths.
pub fn read(file: &str, bytes: &[u8], report: &mut Vec<Diagnostic>) -> Option<Paths> {
    let text = super::utf8(file, bytes, report)?;
    let paths: Paths = manifest::parse(file, text, report)?;
    for PathEntry { rule, load, vertices, .. } in paths.0.values() {
        rule.iter().for_each(|field| manifest::report_wrong(file, field, report));
        load.iter().for_each(|field| manifest::report_wrong(file, field, report));
        vertices.iter().flatten().for_each(|field| manifest::report_wrong(file, field, report));
    }
    Some(paths)
}
