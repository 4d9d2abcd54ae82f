//! The lines of a dress form where somebody knows them better than the rules do: a TOML file with any of `waist`, `hip`, `bust` (heights above
//! the ground), `centre_x` and `side_z` (planes), each a length with its unit. Knows no form.

use super::manifest::{self, Field, report_wrong};
use super::units::Length;
use crate::diagnostic::Diagnostic;
use schemars::JsonSchema;
use serde::Deserialize;

/// Lines that were given, metres.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct FormLines {
    /// Height of the waist.
    pub waist_m: Option<f64>,
    /// Height of the hip.
    pub hip_m: Option<f64>,
    /// Height of the bust.
    pub bust_m: Option<f64>,
    /// X of the plane through the centre lines, to the wearer's left.
    pub centre_x_m: Option<f64>,
    /// Z of the plane through the side lines, to the front.
    pub side_z_m: Option<f64>,
}

#[derive(Debug, Deserialize, JsonSchema)]
#[schemars(title = "Form lines", deny_unknown_fields)]
struct LinesFile {
    waist: Option<Field<Length>>,
    hip: Option<Field<Length>>,
    bust: Option<Field<Length>>,
    centre_x: Option<Field<Length>>,
    side_z: Option<Field<Length>>,
}

/// Reads the file; what is wrong is reported with its line, and then nothing is returned.
pub fn read(file: &str, bytes: &[u8], report: &mut Vec<Diagnostic>) -> Option<FormLines> {
    let before = report.len();
    let lines: LinesFile = manifest::parse(file, super::utf8(file, bytes, report)?, report)?;
    let mut metres = |field: &Option<Field<Length>>| {
        field.iter().for_each(|field| report_wrong(file, field, report));
        field.as_ref().and_then(Field::get).map(|length| length.metres())
    };
    let read = FormLines {
        waist_m: metres(&lines.waist),
        hip_m: metres(&lines.hip),
        bust_m: metres(&lines.bust),
        centre_x_m: metres(&lines.centre_x),
        side_z_m: metres(&lines.side_z),
    };
    (report.len() == before).then_some(read)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_are_read_and_mistakes_named() {
        let mut report = Vec::new();
        let lines = read("form.toml", b"waist = \"104.5 cm\"\nside_z = \"-8 mm\"\n", &mut report).unwrap();
        assert_eq!((lines.waist_m, lines.side_z_m, lines.hip_m), (Some(1.045), Some(-0.008), None));
        for (text, wanted) in [
            ("waist = 1.04\n", &["wrong-value"][..]),
            ("wast = \"1 m\"\n", &["unknown-key"]),
            ("waist = \"1 furlong\"\nhip = \"2\"\n", &["wrong-value", "wrong-value"]),
        ] {
            report.clear();
            assert_eq!(read("form.toml", text.as_bytes(), &mut report), None, "{text}");
            let codes: Vec<&str> = report.iter().map(|diagnostic| diagnostic.code.as_ref()).collect();
            assert_eq!(codes, wanted, "{text}");
        }
    }
}
