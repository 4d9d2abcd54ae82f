//! The project's own tables: CSV with columns like `body_height_cm`, and TOML with `[[wearer]]`.

use super::{Body, ROWS, Unit, Value, number, unit_names};
use crate::diagnostic::{Diagnostic, Place};
use crate::source::causes::Causes;
use crate::source::numbers::half_width;
use crate::source::units::number_and_unit;
use crate::source::{closest, delimited, utf8};
use kitsuke::measurement::Measurement;
use toml::de::{DeTable, DeValue};

/// Other names of measurements.
const ALIASES: [(&str, Measurement); 16] = [
    // A yuki that was computed from the height, not measured.
    ("back_neck_to_wrist_rule", Measurement::BackNeckToWrist),
    ("バスト", Measurement::BustGirth),
    ("ウエスト", Measurement::WaistGirth),
    ("ヒップ", Measurement::HipGirth),
    ("胸回り", Measurement::BustGirth),
    ("腰回り", Measurement::HipGirth),
    ("首回り", Measurement::NeckGirth),
    ("手首回り", Measurement::WristGirth),
    ("裄丈", Measurement::BackNeckToWrist),
    ("股下丈", Measurement::InsideLegLength),
    ("腕の長さ", Measurement::ArmLength),
    ("腕丈", Measurement::ArmLength),
    ("二の腕囲", Measurement::UpperArmGirth),
    ("太もも囲", Measurement::ThighGirth),
    ("アンダー", Measurement::UnderbustGirth),
    ("胴回り", Measurement::WaistGirth),
];

fn from_name(name: &str) -> Option<Measurement> {
    let of_list = Measurement::ALL.iter().find(|m| m.name() == name || m.ja() == name).copied();
    of_list.or_else(|| ALIASES.iter().find(|(alias, _)| *alias == name).map(|(_, measurement)| *measurement))
}

/// A header without its unit: `body_height_cm`, `身長(cm)` and `身長（cm）`.
fn split(header: &str) -> (&str, Option<Unit>) {
    let bracketed = header.strip_suffix([')', '）']).and_then(|rest| rest.rsplit_once(['(', '（']));
    let suffixed = header.rsplit_once('_');
    for (name, unit) in [bracketed, suffixed].into_iter().flatten() {
        if let Some(unit) = Unit::from_name(unit.trim()) {
            return (name.trim(), Some(unit));
        }
    }
    (header, None)
}

/// A measurement's name with something behind it that stands where a unit would: `body_height_in`, `身長(in)`.
fn split_at_unknown_unit(header: &str) -> Option<(&str, &str)> {
    let bracketed = header.strip_suffix([')', '）']).and_then(|rest| rest.rsplit_once(['(', '（']));
    let parts = [bracketed, header.rsplit_once('_')];
    parts.into_iter().flatten().find_map(|(name, unit)| from_name(name.trim()).map(|_| (name.trim(), unit.trim())))
}

fn unknown(name: &str) -> String {
    let is_begin = |m: &&Measurement| m.name().split('_').any(|part| part == name);
    let names = || Measurement::ALL.iter().map(|m| m.name());
    match Measurement::ALL.iter().find(is_begin).map(|m| m.name()).or_else(|| closest(name, names())) {
        Some(similar) => format!("there is no measurement `{name}`; did you mean `{similar}`?"),
        None => format!("there is no measurement `{name}`"),
    }
}

fn names() -> String {
    Measurement::ALL.iter().map(|m| m.name()).collect::<Vec<_>>().join(", ")
}

/// Reads a table with a header.
pub(super) fn read_table(file: &str, bytes: &[u8], report: &mut Vec<Diagnostic>) -> Option<Vec<Body>> {
    let text = utf8(file, bytes, report)?;
    let separator = delimited::separator(delimited::first_line(text).as_bytes());
    let cells = delimited::read(file, text, separator, ROWS, report)?;
    let before = report.len();
    let mut columns: Vec<Option<(Measurement, Unit)>> = Vec::new();
    for header in &cells.header {
        let (name, unit) = split(header);
        let wrong = |code, problem: String, help: String| {
            Diagnostic::error(code, file, cells.header_place.clone()).problem(problem).help(help)
        };
        let mut column = None;
        match (from_name(name), unit) {
            (Some(measurement), Some(unit)) => {
                if columns.iter().flatten().any(|(earlier, _)| *earlier == measurement) {
                    let problem = format!("the column `{header}` gives {} a second time", measurement.name());
                    report.push(wrong("measurement-column", problem, "Keep one of the columns.".to_owned()));
                }
                column = Some((measurement, unit));
            }
            (Some(_), None) => report.push(wrong(
                "measurement-unit",
                format!("the column `{header}` does not say its unit"),
                format!("Add the unit: {header}_cm, {header}_mm or {header}_m."),
            )),
            (None, Some(_)) => {
                report.push(wrong("measurement-column", unknown(name), format!("Measurements are {}.", names())));
            }
            // Other columns are the artist's own; but a slip of the pen is not.
            (None, None) => {
                if let Some((name, unit)) = split_at_unknown_unit(header) {
                    let meant = Unit::meant(unit).unwrap_or(Unit::CM).name();
                    let problem = format!("the column `{header}` has a unit that is not known: `{unit}`");
                    let help = format!("Call it {name}_{meant}; units are {}.", unit_names());
                    report.push(wrong("measurement-unit", problem, help));
                    columns.push(None);
                    continue;
                }
                let inner = name.rsplit_once('_').map_or(name, |(inner, _)| inner);
                let is_slip = |name: &str| closest(name, Measurement::ALL.iter().map(|m| m.name())).is_some();
                if is_slip(name) || is_slip(inner) {
                    let help = format!("Call it by the measurement and its unit, for example {}_cm.", "body_height");
                    report.push(wrong("measurement-column", unknown(name), help));
                }
            }
        }
        columns.push(column);
    }
    if report.len() == before && columns.iter().all(Option::is_none) {
        report.push(
            Diagnostic::error("measurement-column", file, cells.header_place.clone())
                .problem("no column is a measurement")
                .help(format!("Name columns like body_height_cm. Measurements are {}.", names())),
        );
    }
    if report.len() > before {
        return None;
    }
    let named = ["name", "body", "id"].into_iter().find_map(|name| cells.header.iter().position(|h| h == name));
    let mut causes = Causes::default();
    let mut bodies = Vec::new();
    for row in &cells.rows {
        let name = named.map_or(String::new(), |at| row.cells[at].clone());
        let place = Place::Line(row.line);
        let (mut values, mut is_damaged) = (Vec::new(), false);
        for ((cell, column), header) in row.cells.iter().zip(&columns).zip(&cells.header) {
            let Some((measurement, unit)) = *column else { continue };
            if cell.is_empty() {
                continue;
            }
            match number(cell) {
                Ok(written) => values.push(Value { measurement, written, unit, place: place.clone() }),
                Err((problem, help)) => {
                    is_damaged = true;
                    causes.add("measurement-number", format!("{header} {problem}"), || {
                        Diagnostic::error("measurement-number", file, place.clone())
                            .problem(format!("row {}, column {header}: {problem}", row.number))
                            .help(help)
                    });
                }
            }
        }
        bodies.push(Body { row: row.number, name, place, values, is_damaged });
    }
    causes.report("row", report);
    Some(bodies)
}

/// Reads `[[wearer]]` tables.
pub(super) fn read_toml(file: &str, bytes: &[u8], report: &mut Vec<Diagnostic>) -> Option<Vec<Body>> {
    let text = utf8(file, bytes, report)?;
    let document = match DeTable::parse(text) {
        Ok(document) => document,
        Err(error) => {
            report.push(
                Diagnostic::error("toml-syntax", file, error.span().map_or(Place::File, Place::Span))
                    .problem(error.message())
                    .help("Mend the TOML here; strings stand in double quotes."),
            );
            return None;
        }
    };
    const EXAMPLE: &str = "Write [[wearer]] and below it lines like body_height = \"153.7 cm\".";
    let mut bodies = Vec::new();
    for (key, value) in document.get_ref() {
        let wearers = match value.get_ref() {
            DeValue::Array(wearers) if key.get_ref() == "wearer" && wearers.len() <= ROWS => wearers,
            _ => {
                report.push(
                    Diagnostic::error("unknown-key", file, Place::Span(key.span()))
                        .problem(format!("`{}` is no list of wearers", key.get_ref()))
                        .help(EXAMPLE),
                );
                continue;
            }
        };
        for (i, wearer) in wearers.iter().enumerate() {
            let DeValue::Table(entries) = wearer.get_ref() else {
                report.push(
                    Diagnostic::error("wrong-value", file, Place::Span(wearer.span()))
                        .problem("this is no wearer")
                        .help(EXAMPLE),
                );
                continue;
            };
            let place = Place::Span(wearer.span());
            let mut body = Body { row: i + 1, name: String::new(), place, values: Vec::new(), is_damaged: false };
            let before = report.len();
            for (key, value) in entries {
                let (key_name, place) = (key.get_ref().as_ref(), Place::Span(value.span()));
                let string = if let DeValue::String(string) = value.get_ref() { Some(string.as_ref()) } else { None };
                match (key_name, from_name(key_name), string) {
                    ("name", _, Some(name)) => body.name = name.to_owned(),
                    (_, Some(measurement), _) if body.values.iter().any(|value| value.measurement == measurement) => {
                        report.push(
                            Diagnostic::error("unknown-key", file, Place::Span(key.span()))
                                .problem(format!("`{key_name}` gives {} a second time", measurement.name()))
                                .help("Keep one of the two."),
                        );
                    }
                    (_, Some(measurement), string) => {
                        let text = string.map(|string| toml::Value::String(half_width(string)));
                        let length = text.as_ref().and_then(number_and_unit);
                        match length.and_then(|(written, unit)| Some((written, Unit::from_name(unit)?))) {
                            Some((written, unit)) => body.values.push(Value { measurement, written, unit, place }),
                            None => report.push(
                                Diagnostic::error("wrong-value", file, place)
                                    .problem(format!("{key_name} is no length"))
                                    .help(format!(
                                        "Write a number and a unit in double quotes, for example \"153.7 cm\"; units are {}.",
                                        unit_names()
                                    )),
                            ),
                        }
                    }
                    ("name", ..) => report.push(
                        Diagnostic::error("wrong-value", file, place)
                            .problem("the name is no text")
                            .help("Write the name in double quotes."),
                    ),
                    _ => report.push(
                        Diagnostic::error("unknown-key", file, Place::Span(key.span()))
                            .problem(unknown(key_name))
                            .help(format!("Keys are name, {}.", names())),
                    ),
                }
            }
            body.is_damaged = report.len() > before;
            bodies.push(body);
        }
    }
    Some(bodies)
}
