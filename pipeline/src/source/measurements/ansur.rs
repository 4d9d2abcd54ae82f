//! ANSUR II, the US Army's survey of 2012: millimetres, semicolons or commas, Latin-1.
//!
//! The yuki is `span / 2 - handlength` and 2 cm for the arm's hanging: 0.40 of the height and 2 cm, as the trade
//! measures it. `sleevelengthspinewrist` is taken over the bent elbow and is too long by a tenth of the height,
//! `biacromialbreadth / 2 + sleeveoutseam` by a twentieth. `bicepscircumferenceflexed` is a tensed arm's and serves
//! nothing here; there is no underbust. Weights are in tenths of a kilogram and are not read.

use super::{Body, ROWS, Unit, Value, number};
use crate::diagnostic::{Diagnostic, Place};
use crate::source::causes::Causes;
use crate::source::delimited;
use kitsuke::measurement::Measurement;

/// Columns that are a measurement.
const COLUMNS: [(&str, Measurement); 11] = [
    ("stature", Measurement::BodyHeight),
    ("chestcircumference", Measurement::BustGirth),
    ("waistcircumference", Measurement::WaistGirth),
    ("buttockcircumference", Measurement::HipGirth),
    ("neckcircumference", Measurement::NeckGirth),
    ("wristcircumference", Measurement::WristGirth),
    ("thighcircumference", Measurement::ThighGirth),
    ("crotchheight", Measurement::InsideLegLength),
    ("biacromialbreadth", Measurement::ShoulderWidth),
    ("sleeveoutseam", Measurement::ArmLength),
    ("waistbacklength", Measurement::BackNeckToWaist),
];

/// What the arm's hanging adds to the yuki.
const YUKI_SLACK_MM: f64 = 20.0;

/// Whether a line is the header of ANSUR II.
pub(super) fn is_header(line: &[u8]) -> bool {
    let separator = delimited::separator(line);
    let has = |name: &str| line.split(|&byte| byte == separator).any(|cell| cell.eq_ignore_ascii_case(name.as_bytes()));
    has("stature") && has("buttockcircumference")
}

/// Reads the survey.
pub(super) fn read(file: &str, bytes: &[u8], report: &mut Vec<Diagnostic>) -> Option<Vec<Body>> {
    // Every byte is a character of Latin-1; only places and trades have other letters than ASCII.
    let text: String =
        bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes).iter().map(|&byte| char::from(byte)).collect();
    let separator = delimited::separator(delimited::first_line(&text).as_bytes());
    let cells = delimited::read(file, &text, separator, ROWS, report)?;
    let column = |name: &str| cells.header.iter().position(|header| header.eq_ignore_ascii_case(name));
    let columns = COLUMNS.map(|(name, measurement)| (name, column(name), measurement));
    let (span, hand, id) = (column("span"), column("handlength"), column("subjectid"));
    let mut causes = Causes::default();
    let mut bodies = Vec::new();
    for row in &cells.rows {
        let place = Place::Line(row.line);
        let mut is_damaged = false;
        let mut millimetres = |name: &str, at: Option<usize>| {
            let cell = at.map(|at| row.cells[at].as_str()).filter(|cell| !cell.is_empty())?;
            let mut say = |(problem, help)| {
                is_damaged = true;
                causes.add("measurement-number", format!("{name} {problem}"), || {
                    Diagnostic::error("measurement-number", file, place.clone())
                        .problem(format!("row {}, column {name}: {problem}", row.number))
                        .help(help)
                });
            };
            number(cell).map_err(&mut say).ok()
        };
        let mut values = Vec::new();
        let mut push = |measurement, written| {
            values.push(Value { measurement, written, unit: Unit::MM, place: place.clone() });
        };
        for &(name, at, measurement) in &columns {
            if let Some(written) = millimetres(name, at) {
                push(measurement, written);
            }
        }
        if let (Some(span), Some(hand)) = (millimetres("span", span), millimetres("handlength", hand)) {
            push(Measurement::BackNeckToWrist, span / 2.0 - hand + YUKI_SLACK_MM);
        }
        let name = id.map_or(String::new(), |at| row.cells[at].clone());
        bodies.push(Body { row: row.number, name, place: place.clone(), values, is_damaged });
    }
    causes.report("row", report);
    Some(bodies)
}
