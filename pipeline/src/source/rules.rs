//! Rule sets, one TOML file each: names, sources, formulas; compiled to what the runtime evaluates. Knows no garment.

use super::formula::{self, Symbol};
use super::manifest::{self, Field, report_wrong};
use super::units::one_of;
use super::{closest, folder};
use crate::diagnostic::{self, Diagnostic, Place};
use kitsuke::measurement::Measurement;
use kitsuke::tailoring::{Check, DimensionRule, Level, Limit, Op, RuleSet, Side};
use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::Deserialize;
use std::borrow::Cow;
use std::collections::BTreeMap;
use std::io;
use std::ops::Range;
use std::path::Path;

/// The dimensions that every rule set gives, with their kanji.
pub const DIMENSIONS: [(&str, &str); 23] = [
    ("mitake", "身丈"),
    ("kitake", "着丈"),
    ("ohashori", "御端折り"),
    ("kurikoshi", "繰越"),
    ("tsukekomi", "付込み"),
    ("yuki", "裄"),
    ("sode_take", "袖丈"),
    ("sode_haba", "袖幅"),
    ("sode_tsuke", "袖付"),
    ("sode_guchi", "袖口"),
    ("sode_maru", "袖丸み"),
    ("kata_haba", "肩幅"),
    ("mae_haba", "前幅"),
    ("ushiro_haba", "後幅"),
    ("daki_haba", "抱幅"),
    ("okumi_haba", "衽幅"),
    ("aizuma_haba", "合褄幅"),
    ("eri_shita", "衿下"),
    ("eri_haba_se", "衿幅(背)"),
    ("eri_haba_saki", "衿幅(衿先)"),
    ("okumi_sagari", "衽下がり"),
    ("erikata_aki", "衿肩あき"),
    ("miyatsukuchi", "身八つ口"),
];

/// A file of rules.
#[derive(Debug, Deserialize, JsonSchema)]
#[schemars(title = "Rules", description = "A way to derive a kimono's dimensions from the body.", deny_unknown_fields)]
struct RulesFile {
    /// Who published the rules, for people.
    #[schemars(required)]
    source: Option<Field<String>>,
    /// The formula of every dimension.
    #[serde(default)]
    dimensions: BTreeMap<String, Field<Formula>>,
    /// Lengths that help to compute others.
    #[serde(default)]
    values: BTreeMap<String, Field<Formula>>,
    /// What a tailor checks before cutting.
    #[serde(default, rename = "check")]
    checks: Vec<CheckEntry>,
}

/// One `[[check]]`.
#[derive(Debug, Deserialize, JsonSchema)]
#[schemars(deny_unknown_fields)]
struct CheckEntry {
    /// For example `kata_ushiro`.
    #[schemars(required)]
    name: Option<Field<String>>,
    /// The formula of the length that is looked at.
    #[schemars(required)]
    value: Option<Field<Formula>>,
    /// Where it becomes bad.
    #[serde(default)]
    limits: Vec<LimitEntry>,
}

/// One limit of a check.
#[derive(Debug, Deserialize, JsonSchema)]
#[schemars(deny_unknown_fields)]
struct LimitEntry {
    /// A formula: values above it are bad.
    above: Option<Field<Formula>>,
    /// A formula: values below it are bad.
    below: Option<Field<Formula>>,
    /// How bad: `warn` or `impossible`.
    #[schemars(required)]
    verdict: Option<Field<VerdictName>>,
    /// What it means and what to do, for people.
    #[schemars(required)]
    text: Option<Field<String>>,
}

/// A formula that gives a length, for example `"hip_girth / 2 - 6 cm"`.
#[derive(Clone, Debug, Deserialize)]
#[serde(try_from = "toml::Value")]
struct Formula(String);

impl TryFrom<toml::Value> for Formula {
    type Error = String;

    fn try_from(value: toml::Value) -> Result<Formula, String> {
        match value {
            toml::Value::String(text) => Ok(Formula(text)),
            value => Err(format!("{value} is no formula; write it in double quotes and with units, as in \"49.2 cm\"")),
        }
    }
}

impl JsonSchema for Formula {
    fn schema_name() -> Cow<'static, str> {
        "Formula".into()
    }

    fn json_schema(_: &mut SchemaGenerator) -> Schema {
        json_schema!({ "type": "string" })
    }
}

/// How bad: it can be sewn with care or other cloth, or it cannot.
#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(try_from = "toml::Value")]
struct VerdictName(Level);

const VERDICTS: [(&str, VerdictName); 2] =
    [("warn", VerdictName(Level::Warn)), ("impossible", VerdictName(Level::Impossible))];

impl TryFrom<toml::Value> for VerdictName {
    type Error = String;

    fn try_from(value: toml::Value) -> Result<VerdictName, String> {
        one_of("verdict", &value, VERDICTS)
    }
}

impl JsonSchema for VerdictName {
    fn schema_name() -> Cow<'static, str> {
        "Verdict".into()
    }

    fn json_schema(_: &mut SchemaGenerator) -> Schema {
        json_schema!({ "type": "string", "enum": VERDICTS.map(|(name, _)| name) })
    }
}

/// The folder of rule sets inside the assets folder.
pub const FOLDER: &str = "rules";
/// Longest file of rules, bytes.
const RULES_BYTES: u64 = 1 << 20;
/// Most values of a rule set.
const VALUES: usize = 100;

/// The file of the rule set `name`, relative to the assets folder.
#[must_use]
pub fn file(name: &str) -> String {
    format!("{FOLDER}/{name}.toml")
}

/// The name of the rule set in a file; the inverse of [`file()`].
#[must_use]
pub fn name(file: &str) -> &str {
    let name = file.rsplit_once('/').map_or(file, |(_, name)| name);
    name.strip_suffix(".toml").unwrap_or(name)
}

/// The names of the rule sets in a folder, sorted.
///
/// # Errors
/// The folder cannot be read.
pub fn names(rules_dir: &Path) -> io::Result<Vec<String>> {
    let mut names = Vec::new();
    for entry in std::fs::read_dir(rules_dir)? {
        let name = entry?.file_name().into_string();
        names.extend(name.iter().filter_map(|name| name.strip_suffix(".toml")).map(str::to_owned));
    }
    names.sort();
    Ok(names)
}

/// Reads the rule set `name` of a folder.
///
/// # Errors
/// Everything that is wrong with it, or that there is none of this name; files are named relative to the folder.
pub fn load(rules_dir: &Path, name: &str) -> Result<RuleSet, Vec<Diagnostic>> {
    let file = format!("{name}.toml");
    let unreadable = |problem: String, help: &str| {
        vec![Diagnostic::error("rules-file", file.clone(), Place::File).problem(problem).help(help)]
    };
    let known = names(rules_dir).map_err(|error| {
        unreadable(format!("{} cannot be read: {error}", rules_dir.display()), "Name the folder that holds the rules.")
    })?;
    if !known.iter().any(|known| known == name) {
        let problem = match closest(name, known.iter().map(String::as_str)) {
            Some(similar) => format!("there are no rules `{name}`; are `{similar}` meant?"),
            None => format!("there are no rules `{name}`"),
        };
        return Err(unreadable(problem, &format!("There are {}.", known.join(", "))));
    }
    let bytes = folder::read_at_most(&rules_dir.join(&file), RULES_BYTES)
        .map_err(|error| unreadable(format!("the rules cannot be read: {error}"), "Put a file of rules there."))?;
    let mut report = Vec::new();
    read(&file, name, &bytes, &mut report).ok_or_else(|| diagnostic::sorted(report))
}

/// Compiles a file of rules and reports everything that is wrong with it; nothing where anything is.
pub fn read(file: &str, name: &str, bytes: &[u8], report: &mut Vec<Diagnostic>) -> Option<RuleSet> {
    let before = report.len();
    let text = super::utf8(file, bytes, report)?;
    let rules: RulesFile = manifest::parse(file, text, report)?;
    check_names(file, &rules, report);
    let RulesFile { source, dimensions, values, checks } = &rules;
    if report.len() > before {
        return None;
    }

    let ordered = DIMENSIONS.iter().filter_map(|(name, ja)| Some((*name, *ja, dimensions.get(*name)?)));
    let entries: Vec<(&str, &str, &Field<Formula>)> =
        ordered.chain(values.iter().map(|(name, field)| (name.as_str(), "", field))).collect();
    let measurements = Measurement::ALL.iter().map(|&m| (m.name(), Symbol::Measurement(m)));
    let indexed = entries.iter().enumerate().map(|(i, (name, ..))| (*name, Symbol::Dimension(i as u16)));
    let symbols: Vec<(&str, Symbol)> = measurements.chain(indexed).collect();
    let mut compile = |of: &str, field: &Field<Formula>| -> Vec<Op> {
        report_wrong(file, field, report);
        let Some(Formula(formula)) = field.get() else { return Vec::new() };
        formula::compile(formula, &symbols).unwrap_or_else(|mistake| {
            let place = Place::Span(within(text, &field.span, formula, mistake.span));
            let problem = format!("in the formula of `{of}`: {}", mistake.problem);
            report.push(Diagnostic::error("formula", file, place).problem(problem).help(mistake.help));
            Vec::new()
        })
    };
    let programs: Vec<Vec<Op>> = entries.iter().map(|(name, _, field)| compile(name, field)).collect();
    let mut compiled_checks = Vec::new();
    for check in checks {
        let name = text_of(check.name.as_ref());
        let value = check.value.as_ref().map(|field| compile(&name, field));
        let mut limits = Vec::new();
        for limit in &check.limits {
            let bounds = [(Side::Above, &limit.above), (Side::Below, &limit.below)];
            for (side, field) in bounds {
                if let (Some(field), Some(verdict)) = (field, limit.verdict.as_ref().and_then(Field::get)) {
                    let (bound, text) = (compile(&name, field), text_of(limit.text.as_ref()));
                    limits.push(Limit { side, level: verdict.0, bound, text });
                }
            }
        }
        compiled_checks.push(Check { name, value: value.unwrap_or_default(), limits });
    }
    let order = by_need(&programs);
    if let Some(left) = (0..programs.len()).find(|i| !order.contains(i)) {
        let (name, _, field) = entries[in_circle(&programs, &order, left)];
        report.push(
            Diagnostic::error("rules-circle", file, field.place())
                .problem(format!("to compute `{name}`, `{name}` itself is needed"))
                .help("Give one dimension of the circle a formula that needs only measurements."),
        );
    }
    if report.len() > before {
        return None;
    }

    let mut place = vec![0; order.len()];
    order.iter().enumerate().for_each(|(new, &old)| place[old] = new as u16);
    let renumbered = |ops: &[Op]| -> Vec<Op> {
        let renumber = |op: &Op| if let Op::Dimension(i) = op { Op::Dimension(place[usize::from(*i)]) } else { *op };
        ops.iter().map(renumber).collect()
    };
    for check in &mut compiled_checks {
        check.value = renumbered(&check.value);
        check.limits.iter_mut().for_each(|limit| limit.bound = renumbered(&limit.bound));
    }
    let rule = |&i: &usize| {
        let (name, ja, _) = entries[i];
        DimensionRule { name: name.to_owned(), ja: ja.to_owned(), program: renumbered(&programs[i]) }
    };
    let rules = RuleSet {
        name: name.to_owned(),
        source: text_of(source.as_ref()),
        dimensions: order.iter().map(rule).collect(),
        checks: compiled_checks,
    };
    match rules.validate() {
        Ok(()) => Some(rules),
        Err(error) => {
            report.push(
                Diagnostic::error("rules", file, Place::File)
                    .problem(error.to_string())
                    .help("Make names and texts shorter, and divide long formulas with [values]."),
            );
            None
        }
    }
}

/// Reports wrong, missing and unknown names.
fn check_names(file: &str, rules: &RulesFile, report: &mut Vec<Diagnostic>) {
    rules.source.iter().for_each(|field| report_wrong(file, field, report));
    for (key, field) in &rules.dimensions {
        if !DIMENSIONS.iter().any(|(known, _)| known == key) {
            let problem = match closest(key, DIMENSIONS.iter().map(|(known, _)| *known)) {
                Some(similar) => format!("there is no dimension `{key}`; did you mean `{similar}`?"),
                None => format!("there is no dimension `{key}`"),
            };
            report.push(
                Diagnostic::error("unknown-dimension", file, field.place())
                    .problem(problem)
                    .help("What only helps to compute dimensions stands under [values]."),
            );
        }
    }
    for (known, ja) in DIMENSIONS {
        if !rules.dimensions.contains_key(known) {
            report.push(
                Diagnostic::error("missing-dimension", file, Place::File)
                    .problem(format!("the dimension `{known}` ({ja}) is missing"))
                    .help(format!("Add `{known} = \"…\"` under [dimensions]; \"0 cm\" if the kimono has none.")),
            );
        }
    }
    if rules.values.len() > VALUES {
        report.push(
            Diagnostic::error("rules", file, Place::File)
                .problem(format!("there are {} values, more than {VALUES}", rules.values.len()))
                .help("Write them into the formulas that use them."),
        );
    }
    for (key, field) in &rules.values {
        let is_taken =
            DIMENSIONS.iter().any(|(known, _)| known == key) || Measurement::ALL.iter().any(|m| m.name() == key);
        let is_word = key.chars().all(|c| c.is_ascii_lowercase() || c.is_ascii_digit() || c == '_')
            && key.starts_with(|c: char| c.is_ascii_lowercase());
        if is_taken || !is_word || formula::is_reserved(key) {
            report.push(
                Diagnostic::error("value-name", file, field.place())
                    .problem(format!("a value cannot be called `{key}`"))
                    .help("Names are a-z, 0-9 and _, and no dimension, measurement, unit or function has them."),
            );
        }
    }
    for check in &rules.checks {
        check.name.iter().for_each(|field| report_wrong(file, field, report));
        for limit in &check.limits {
            limit.verdict.iter().for_each(|field| report_wrong(file, field, report));
            limit.text.iter().for_each(|field| report_wrong(file, field, report));
            if limit.above.is_some() == limit.below.is_some() {
                let place = limit.verdict.as_ref().map_or(Place::File, Field::place);
                report.push(
                    Diagnostic::error("limit", file, place)
                        .problem("a limit is either `above` or `below` a length")
                        .help("Write { above = \"8 bu\", verdict = \"warn\", text = \"…\" }."),
                );
            }
        }
    }
}

fn text_of(field: Option<&Field<String>>) -> String {
    field.and_then(Field::get).cloned().unwrap_or_default()
}

/// Where part of a formula stands in the file, or the whole formula where the string in the file is written otherwise
/// than it reads.
fn within(text: &str, quoted: &Range<usize>, formula: &str, part: Range<usize>) -> Range<usize> {
    let start = quoted.start + 1;
    let is_plain = text.get(start..quoted.end.saturating_sub(1)) == Some(formula);
    if is_plain { start + part.start..start + part.end } else { quoted.clone() }
}

/// One of the programs that need themselves, starting at one that `order` had to leave out: whoever keeps asking for
/// what is left out and needed ends up in a circle.
fn in_circle(programs: &[Vec<Op>], order: &[usize], left: usize) -> usize {
    let is_left = |op: &Op| match op {
        Op::Dimension(needed) => Some(usize::from(*needed)).filter(|needed| !order.contains(needed)),
        _ => None,
    };
    let needed = |at: usize| programs[at].iter().find_map(is_left);
    (0..programs.len()).fold(left, |at, _| needed(at).expect("what is left out needs something that is left out"))
}

/// An order in which every program comes after those that it needs; what needs itself, and what needs that, is left out.
fn by_need(programs: &[Vec<Op>]) -> Vec<usize> {
    let mut order = Vec::new();
    let mut is_placed = vec![false; programs.len()];
    let is_met = |op: &Op, is_placed: &[bool]| !matches!(op, Op::Dimension(i) if !is_placed[usize::from(*i)]);
    while let Some(next) =
        (0..programs.len()).find(|&i| !is_placed[i] && programs[i].iter().all(|op| is_met(op, &is_placed)))
    {
        is_placed[next] = true;
        order.push(next);
    }
    order
}
