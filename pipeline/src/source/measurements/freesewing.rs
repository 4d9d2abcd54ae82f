//! The models of FreeSewing: JSON, millimetres, one object of measurements per model, or one model alone.
//!
//! They have no stature: waist to floor and the neck's side to the waist at the back are 0.863 of it (ANSUR II,
//! `waistheightomphalion + waistbacklength`, standard deviation 0.011). `shoulderToShoulder / 2 + shoulderToWrist` runs
//! over the shoulders' points and is longer than a yuki by a twentieth of the height, so the yuki is left to the rules.

use super::{Body, ROWS, Unit, Value};
use crate::diagnostic::{Diagnostic, Place};
use crate::source::utf8;
use kitsuke::measurement::Measurement;
use serde::Deserialize;
use serde::de::{Deserializer, MapAccess, Visitor};
use serde_json::Value as Json;
use std::fmt;

/// Measures that are a measurement.
const MEASURES: [(&str, Measurement); 10] = [
    ("chest", Measurement::BustGirth),
    ("underbust", Measurement::UnderbustGirth),
    ("waist", Measurement::WaistGirth),
    ("seat", Measurement::HipGirth),
    ("neck", Measurement::NeckGirth),
    ("biceps", Measurement::UpperArmGirth),
    ("wrist", Measurement::WristGirth),
    ("upperLeg", Measurement::ThighGirth),
    ("inseam", Measurement::InsideLegLength),
    ("shoulderToWrist", Measurement::ArmLength),
];

/// Height of the neck's side above the floor, measured over waist and back, relative to the stature.
const NECK_TO_STATURE: f64 = 0.863;

/// The entries of a JSON object in the order of the file.
struct Entries(Vec<(String, Json)>);

impl<'de> Deserialize<'de> for Entries {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Entries, D::Error> {
        struct InOrder;
        impl<'de> Visitor<'de> for InOrder {
            type Value = Entries;

            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str("an object of models")
            }

            fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<Entries, A::Error> {
                let mut entries = Vec::new();
                while let Some(entry) = map.next_entry()? {
                    entries.push(entry);
                }
                Ok(Entries(entries))
            }
        }
        deserializer.deserialize_map(InOrder)
    }
}

/// Reads the models.
pub(super) fn read(file: &str, bytes: &[u8], report: &mut Vec<Diagnostic>) -> Option<Vec<Body>> {
    let text = utf8(file, bytes, report)?;
    let entries: Entries = match serde_json::from_str(text) {
        Ok(entries) => entries,
        Err(error) => {
            report.push(
                Diagnostic::error("json-syntax", file, Place::Line(error.line() as u32))
                    .problem(format!("this is no JSON: {error}"))
                    .help("Save the models anew."),
            );
            return None;
        }
    };
    let is_one_model = entries.0.iter().any(|(_, value)| value.is_number());
    let models: Vec<(String, Json)> = match is_one_model {
        true => vec![(String::new(), Json::Object(entries.0.into_iter().collect()))],
        false => entries.0,
    };
    if models.len() > ROWS {
        report.push(
            Diagnostic::error("json-models", file, Place::File)
                .problem(format!("there are more than {ROWS} models"))
                .help("Divide the file."),
        );
        return None;
    }
    let numbered = models.into_iter().zip(1..);
    Some(numbered.map(|((name, model), row)| body(file, row, name, &model, report)).collect())
}

fn body(file: &str, row: usize, name: String, model: &Json, report: &mut Vec<Diagnostic>) -> Body {
    let before = report.len();
    let mut millimetres = |measure: &str| {
        let value = model.get(measure).filter(|value| !value.is_null())?;
        if value.as_f64().is_none() {
            report.push(
                Diagnostic::error("measurement-number", file, Place::File)
                    .problem(format!("{name}: {measure} is no number"))
                    .help("FreeSewing's measurements are numbers in millimetres."),
            );
        }
        value.as_f64()
    };
    let mut values = Vec::new();
    let mut push = |measurement, written| {
        values.push(Value { measurement, written, unit: Unit::MM, place: Place::File });
    };
    for (measure, measurement) in MEASURES {
        if let Some(written) = millimetres(measure) {
            push(measurement, written);
        }
    }
    if let (Some(waist), Some(back)) = (millimetres("waistToFloor"), millimetres("hpsToWaistBack")) {
        push(Measurement::BodyHeight, (waist + back) / NECK_TO_STATURE);
    }
    Body { row, name, place: Place::File, values, is_damaged: report.len() > before }
}
