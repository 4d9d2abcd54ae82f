//! Tables of body measurements: the project's own (CSV, TOML) and those of ANSUR II, FreeSewing and Seamly, recognised
//! by their content. Every body is checked against what bodies have. Knows no garment and no rules.

mod ansur;
mod freesewing;
mod own;
mod seamly;
mod seamly_formula;

use super::causes::Causes;
use super::folder;
use super::numbers::{self, shortened};
use super::units::LengthUnit;
use crate::diagnostic::{self, Diagnostic, Place};
use encoding_rs::{Encoding, SHIFT_JIS, UTF_8};
use kitsuke::measurement::{Measurement, Measurements};
use std::fmt;
use std::path::Path;

/// Longest table, bytes.
const FILE_BYTES: u64 = 64 << 20;
/// Most wearers that are read from a table.
const ROWS: usize = 100_000;

/// One body of a table.
#[derive(Clone, Debug, PartialEq)]
pub struct Wearer {
    /// Which one of the table, counted from 1.
    pub row: usize,
    /// What the table calls it; `row N` where it has no name.
    pub name: String,
    /// What is known of it.
    pub measurements: Measurements,
}

/// Who made a table.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Format {
    /// Columns like `body_height_cm`.
    Table,
    /// `[[wearer]]` with entries like `body_height = "153.7 cm"`.
    Toml,
    /// The US Army's survey of 2012, in mm.
    AnsurII,
    /// The models of FreeSewing, JSON in mm.
    FreeSewing,
    /// An individual's measurements of Seamly2D or Valentina, XML.
    Seamly,
}

/// Reads the table at `path`.
///
/// # Errors
/// Everything that is wrong with it; the file is named relative to its folder.
pub fn load(path: &Path) -> Result<Vec<Wearer>, Vec<Diagnostic>> {
    let file = path.file_name().unwrap_or(path.as_os_str()).to_string_lossy();
    match folder::read_at_most(path, FILE_BYTES) {
        Ok(bytes) => read(&file, &bytes),
        Err(error) => Err(vec![
            Diagnostic::error("file", file, Place::File)
                .problem(format!("the table cannot be read: {error}"))
                .help("Name a table of measurements: CSV, TOML, ANSUR II, FreeSewing JSON or Seamly .smis."),
        ]),
    }
}

/// Reads a table from its bytes.
///
/// # Errors
/// Everything that is wrong with it.
pub fn read(file: &str, bytes: &[u8]) -> Result<Vec<Wearer>, Vec<Diagnostic>> {
    let mut report = Vec::new();
    let decoded = decoded(bytes);
    let bytes = decoded.as_deref().map_or(bytes, str::as_bytes);
    let wearers = match recognise(bytes) {
        _ if bytes.trim_ascii().is_empty() => {
            report.push(
                Diagnostic::error("no-wearers", file, Place::File)
                    .problem("the file is empty")
                    .help("Name a table of measurements: CSV, TOML, ANSUR II, FreeSewing JSON or Seamly .smis."),
            );
            None
        }
        Format::Table => own::read_table(file, bytes, &mut report),
        Format::Toml => own::read_toml(file, bytes, &mut report),
        Format::AnsurII => ansur::read(file, bytes, &mut report),
        Format::FreeSewing => freesewing::read(file, bytes, &mut report),
        Format::Seamly => seamly::read(file, bytes, &mut report),
    };
    let mut causes = Causes::default();
    let wearers: Vec<Wearer> = wearers.iter().flatten().map(|body| body.checked(file, &mut causes)).collect();
    causes.report("row", &mut report);
    if wearers.is_empty() && report.is_empty() {
        report.push(
            Diagnostic::error("no-wearers", file, Place::File)
                .problem("the table has no rows")
                .help("Give every wearer a row of measurements."),
        );
    }
    if report.is_empty() { Ok(wearers) } else { Err(diagnostic::sorted(report)) }
}

/// The text of a file in one of the two other encodings in which spreadsheets save: UTF-16, and the Shift-JIS of Japanese Windows, which is told by
/// its kana and kanji. `None` where it is in neither.
fn decoded(bytes: &[u8]) -> Option<String> {
    let is_table = || std::str::from_utf8(bytes).is_err() && recognise(bytes) == Format::Table;
    let (encoding, encoded) = match Encoding::for_bom(bytes) {
        Some((encoding, length)) if encoding != UTF_8 => (encoding, &bytes[length..]),
        None if is_table() => (SHIFT_JIS, bytes),
        _ => return None,
    };
    let text = encoding.decode_without_bom_handling_and_without_replacement(encoded)?;
    let is_japanese = || text.chars().any(|c| matches!(c, '\u{3041}'..='\u{30ff}' | '\u{4e00}'..='\u{9fff}'));
    (encoding != SHIFT_JIS || is_japanese()).then(|| text.into_owned())
}

/// What a file seems to be.
#[must_use]
pub fn recognise(bytes: &[u8]) -> Format {
    let bytes = bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes);
    let significant = |line: &&[u8]| !line.is_empty() && !line.starts_with(b"#");
    let first = bytes.split(|&byte| byte == b'\n').map(<[u8]>::trim_ascii).find(significant).unwrap_or_default();
    match first {
        [b'<', ..] => Format::Seamly,
        [b'{', ..] => Format::FreeSewing,
        [b'[', ..] => Format::Toml,
        _ if first.contains(&b'=') => Format::Toml,
        _ if ansur::is_header(first) => Format::AnsurII,
        _ => Format::Table,
    }
}

/// A body as a table gives it, not yet checked.
struct Body {
    /// Counted from 1.
    row: usize,
    name: String,
    place: Place,
    values: Vec<Value>,
    /// Whether something of it has been reported and is left out.
    is_damaged: bool,
}

/// A measurement as a table gives it.
struct Value {
    measurement: Measurement,
    written: f64,
    unit: Unit,
    place: Place,
}

/// What measurements are written in.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Unit {
    Of(LengthUnit),
    Inch,
}

impl Unit {
    const ALL: [Unit; 7] = {
        let [mm, cm, m, shaku, sun, bu] = LengthUnit::ALL;
        [Unit::Of(mm), Unit::Of(cm), Unit::Of(m), Unit::Of(shaku), Unit::Of(sun), Unit::Of(bu), Unit::Inch]
    };
    const MM: Unit = Unit::Of(LengthUnit::Mm);
    const CM: Unit = Unit::Of(LengthUnit::Cm);
    const M: Unit = Unit::Of(LengthUnit::M);

    const fn name(self) -> &'static str {
        match self {
            Unit::Of(unit) => unit.name(),
            Unit::Inch => "inch",
        }
    }

    const fn metres(self) -> f64 {
        match self {
            Unit::Of(unit) => unit.metres(),
            Unit::Inch => 0.0254,
        }
    }

    fn from_name(name: &str) -> Option<Unit> {
        Unit::ALL.into_iter().find(|unit| unit.name() == name)
    }

    /// The unit that a name which is none may mean.
    fn meant(name: &str) -> Option<Unit> {
        match name.to_ascii_lowercase().trim_end_matches(['s', '.']) {
            "in" | "inche" | "inch" | "\"" => Some(Unit::Inch),
            "cm" | "centimeter" | "centimetre" => Some(Unit::CM),
            "mm" | "millimeter" | "millimetre" => Some(Unit::MM),
            "m" | "meter" | "metre" => Some(Unit::M),
            _ => None,
        }
    }
}

/// For messages.
fn unit_names() -> String {
    Unit::ALL.map(Unit::name).join(", ")
}

impl Value {
    fn metres(&self) -> f64 {
        self.written * self.unit.metres()
    }

    fn is_plausible(&self) -> bool {
        is_plausible(self.measurement, self.metres())
    }
}

impl fmt::Display for Value {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (name, unit) = (self.measurement.name(), self.unit.name());
        match self.written.abs() < 1e6 {
            // What was computed from other columns has more digits than it is worth.
            true => write!(f, "{name} {} {unit}", (self.written * 1e4).round() / 1e4),
            false => write!(f, "{name} {:e} {unit}", self.written),
        }
    }
}

/// Least and largest plausible value, centimetres. The bounds are whole millimetres, which an f32 in metres only comes near.
fn plausible_cm(measurement: Measurement) -> (f64, f64) {
    let (low_m, high_m) = measurement.plausible_m();
    (to_cm(f64::from(low_m)), to_cm(f64::from(high_m)))
}

fn is_plausible(measurement: Measurement, metres: f64) -> bool {
    let (low_cm, high_cm) = plausible_cm(measurement);
    // A hair for what rounding of the written values leaves.
    (low_cm - 1e-9..=high_cm + 1e-9).contains(&(metres * 100.0))
}

/// How large the first measurement is in units of the second: least and greatest ratio that bodies have.
const RATIOS: [(Measurement, Measurement, f64, f64); 16] = {
    use Measurement::*;
    [
        (UnderbustGirth, BustGirth, 0.65, 1.0),
        (WaistGirth, BustGirth, 0.5, 1.5),
        (WaistGirth, HipGirth, 0.45, 1.5),
        (BustGirth, HipGirth, 0.55, 1.6),
        (NeckGirth, BustGirth, 0.2, 0.6),
        (UpperArmGirth, ThighGirth, 0.3, 0.9),
        (WristGirth, UpperArmGirth, 0.25, 0.95),
        (ThighGirth, HipGirth, 0.4, 0.8),
        (BustGirth, BodyHeight, 0.35, 1.1),
        (HipGirth, BodyHeight, 0.35, 1.2),
        (InsideLegLength, BodyHeight, 0.36, 0.58),
        (ShoulderWidth, BodyHeight, 0.16, 0.33),
        (ArmLength, BodyHeight, 0.24, 0.43),
        (BackNeckToWaist, BodyHeight, 0.18, 0.36),
        (BackNeckToWrist, BodyHeight, 0.3, 0.55),
        (ArmLength, BackNeckToWrist, 0.55, 0.98),
    ]
};

impl Body {
    /// The wearer; reports measurements that no body has, and those that do not go together.
    fn checked(&self, file: &str, causes: &mut Causes) -> Wearer {
        let row = self.row;
        let name = if self.name.is_empty() { format!("row {row}") } else { self.name.clone() };
        let said = if self.name.is_empty() { name.clone() } else { format!("row {row}, {name}") };
        if self.values.is_empty() && !self.is_damaged {
            causes.add("no-measurements", "", || {
                Diagnostic::error("no-measurements", file, self.place.clone())
                    .problem(format!("{said}: no measurement is given"))
                    .help("Give at least the body height and the hip girth, or delete the row.")
            });
        }
        let mut measurements = Measurements::default();
        for value in &self.values {
            if value.is_plausible() {
                measurements = measurements.with(value.measurement, value.metres() as f32);
            } else {
                let (low_cm, high_cm) = plausible_cm(value.measurement);
                causes.add("implausible", format!("{value} {}", self.guess(value)), || {
                    Diagnostic::error("implausible", file, value.place.clone())
                        .problem(format!("{said}: {value} is not between {low_cm} and {high_cm} cm"))
                        .help(self.guess(value))
                });
            }
        }
        if !self.values.iter().all(Value::is_plausible) {
            return Wearer { row, name, measurements };
        }
        let find = |measurement| self.values.iter().find(|value| value.measurement == measurement);
        for (first, second, least, greatest) in RATIOS {
            let (Some(first), Some(second)) = (find(first), find(second)) else { continue };
            let ratio = first.metres() / second.metres();
            // A hair for what rounding of the written values leaves.
            if !(least - 1e-9..=greatest + 1e-9).contains(&ratio) {
                let is_exchanged = (least..=greatest).contains(&(1.0 / ratio));
                let help = match is_exchanged {
                    true => format!("Are {} and {} exchanged?", first.measurement.name(), second.measurement.name()),
                    false => "Measure both again; what is not known is left out.".to_owned(),
                };
                let problem =
                    format!("{first} is {ratio:.2} times {second}; bodies have {least:.2} to {greatest:.2} times");
                causes.add("impossible-body", problem.clone(), || {
                    Diagnostic::error("impossible-body", file, first.place.clone())
                        .problem(format!("{said}: {problem}"))
                        .help(help)
                });
            }
        }
        Wearer { row, name, measurements }
    }

    /// What may have happened to a value that no body has.
    fn guess(&self, wrong: &Value) -> String {
        let fits = |value: &&Value| {
            value.measurement != wrong.measurement
                && is_plausible(value.measurement, wrong.metres())
                && is_plausible(wrong.measurement, value.metres())
        };
        if let Some(other) = self.values.iter().find(fits) {
            let (a, b) = (wrong.measurement.name(), other.measurement.name());
            return format!("Are {a} and {b} exchanged? {b} is {} cm.", to_cm(other.metres()));
        }
        let other_unit = |unit: &Unit| is_plausible(wrong.measurement, wrong.written * unit.metres());
        match [Unit::CM, Unit::MM, Unit::M, Unit::Inch].into_iter().find(other_unit) {
            Some(unit) => {
                let would_be_cm = to_cm(wrong.written * unit.metres());
                format!("Is the value in {}? That would be {would_be_cm} cm.", unit.name())
            }
            None => "Measure again; what is not known is left out.".to_owned(),
        }
    }
}

/// Centimetres, to a tenth of a millimetre.
fn to_cm(metres: f64) -> f64 {
    (metres * 1e4).round() / 1e2
}

/// A number as tables have it; `Err` is what is wrong and what to do.
fn number(text: &str) -> Result<f64, (String, String)> {
    let text = &numbers::half_width(text);
    numbers::read(text).map_err(|wrong| {
        let help = wrong.help.unwrap_or_else(|| {
            match text.starts_with(|c: char| c.is_ascii_digit()) {
                true => "Write the number alone; the unit stands in the column's name, as in body_height_cm.",
                false => "Write a number; what is not known is left empty.",
            }
            .to_owned()
        });
        (wrong.problem, help)
    })
}
