//! An individual's measurements of Seamly2D (`.smis`) or Valentina (`.vit`): XML, a unit for the whole file, values that
//! may be formulas over the measurements above them.

use super::seamly_formula::evaluate;
use super::{Body, Unit, Value, number};
use crate::diagnostic::{Diagnostic, Place};
use crate::source::utf8;
use kitsuke::measurement::Measurement;
use roxmltree::{Document, Node, ParsingOptions};

/// Names that are a measurement.
const NAMES: [(&str, Measurement); 11] = [
    ("height", Measurement::BodyHeight),
    ("bust_circ", Measurement::BustGirth),
    ("lowbust_circ", Measurement::UnderbustGirth),
    ("waist_circ", Measurement::WaistGirth),
    ("hip_circ", Measurement::HipGirth),
    ("neck_circ", Measurement::NeckGirth),
    ("arm_upper_circ", Measurement::UpperArmGirth),
    ("arm_wrist_circ", Measurement::WristGirth),
    ("leg_thigh_upper_circ", Measurement::ThighGirth),
    ("leg_crotch_to_floor", Measurement::InsideLegLength),
    ("neck_back_to_waist_b", Measurement::BackNeckToWaist),
];
/// From the neck over the shoulder to the wrist: together the yuki; the second is the arm's length.
const YUKI: [&str; 2] = ["neck_back_to_shoulder_tip_b", "arm_shoulder_tip_to_wrist"];

/// Most XML nodes.
const NODES: u32 = 100_000;

/// Reads the one body of a file.
pub(super) fn read(file: &str, bytes: &[u8], report: &mut Vec<Diagnostic>) -> Option<Vec<Body>> {
    let text = utf8(file, bytes, report)?;
    let options = ParsingOptions { allow_dtd: false, nodes_limit: NODES, ..ParsingOptions::default() };
    let document = match Document::parse_with_options(text, options) {
        Ok(document) => document,
        Err(error) => {
            report.push(
                Diagnostic::error("xml-syntax", file, Place::Line(error.pos().row))
                    .problem(format!("this is no XML: {error}"))
                    .help("Save the measurements anew from SeamlyMe."),
            );
            return None;
        }
    };
    let root = document.root_element();
    if !["smis", "vit"].contains(&root.tag_name().name()) {
        let help = match root.tag_name().name() {
            "smms" | "vst" => "This is a table of many sizes; export one size as individual measurements (.smis).",
            _ => "Tables are CSV, TOML, ANSUR II, FreeSewing JSON or Seamly .smis.",
        };
        report.push(
            Diagnostic::error("xml-root", file, Place::Span(name_of(root)))
                .problem(format!("<{}> is no file of individual measurements", root.tag_name().name()))
                .help(help),
        );
        return None;
    }
    let child = |name: &str| root.children().find(|node| node.has_tag_name(name));
    let unit = child("unit").and_then(|node| Some((node, node.text()?.trim())));
    let Some(unit) = unit.and_then(|(_, name)| Unit::from_name(name)) else {
        let (place, problem) = match unit {
            Some((node, name)) => {
                (Place::Span(node.range()), format!("the unit `{}` is not known", super::shortened(name)))
            }
            None => (Place::File, "the file does not say its unit".to_owned()),
        };
        report.push(Diagnostic::error("xml-unit", file, place).problem(problem).help("<unit> is mm, cm or inch."));
        return None;
    };
    let before = report.len();
    let mut body = Body { row: 1, name: person(root), place: Place::File, values: Vec::new(), is_damaged: false };
    let mut yuki = [None, None];
    // What stands above, with 0 for what has not been measured and nothing for what cannot be read.
    let mut above: Vec<(&str, Option<f64>)> = Vec::new();
    for node in child("body-measurements").iter().flat_map(Node::children).filter(|node| node.has_tag_name("m")) {
        let name = node.attribute("name").unwrap_or_default();
        let measurement = NAMES.iter().find(|(known, _)| *known == name).map(|(_, measurement)| *measurement);
        let part = YUKI.iter().position(|known| *known == name);
        let is_used = measurement.is_some() || part.is_some();
        let place = Place::Span(node.range());
        if is_used && above.iter().any(|(earlier, _)| *earlier == name) {
            report.push(
                Diagnostic::error("measurement-column", file, place.clone())
                    .problem(format!("{name} is given a second time"))
                    .help("Keep one of the two."),
            );
        }
        let text = node.attribute("value").unwrap_or_default().trim();
        let is_formula = text.contains(|c: char| c.is_alphabetic() || "+-*/()@".contains(c));
        let written = match number(text) {
            Ok(written) => Ok(written),
            Err(_) if text.is_empty() => Ok(0.0),
            Err(_) if is_formula => evaluate(text, &above).map_err(|(problem, help)| (problem, help.to_owned())),
            Err((problem, help)) => Err((problem, help)),
        };
        above.push((name, written.as_ref().ok().copied()));
        if !is_used {
            continue;
        }
        let written = match written {
            Ok(written) => written,
            Err((problem, help)) => {
                report.push(
                    Diagnostic::error("measurement-number", file, place)
                        .problem(format!("{name}: {problem}"))
                        .help(help),
                );
                continue;
            }
        };
        // SeamlyMe writes 0 for what has not been measured.
        if written == 0.0 {
            continue;
        }
        if let Some(measurement) = measurement {
            body.values.push(Value { measurement, written, unit, place });
        } else if let Some(part) = part {
            yuki[part] = Some((written, place));
        }
    }
    if let [shoulder, Some((arm, place))] = yuki {
        let value = |measurement, written| Value { measurement, written, unit, place: place.clone() };
        body.values.push(value(Measurement::ArmLength, arm));
        if let Some((shoulder, _)) = shoulder {
            body.values.push(value(Measurement::BackNeckToWrist, shoulder + arm));
        }
    }
    body.is_damaged = report.len() > before;
    Some(vec![body])
}

/// The person's name, empty where the file has none.
fn person(root: Node<'_, '_>) -> String {
    let personal = root.children().find(|node| node.has_tag_name("personal"));
    let part = |name: &str| personal?.children().find(|node| node.has_tag_name(name))?.text().map(str::trim);
    let parts = ["given-name", "family-name"].into_iter().filter_map(part).filter(|part| !part.is_empty());
    parts.collect::<Vec<_>>().join(" ")
}

/// Where the name in an element's opening tag stands.
fn name_of(node: Node<'_, '_>) -> std::ops::Range<usize> {
    let start = node.range().start + 1;
    start..start + node.tag_name().name().len()
}
