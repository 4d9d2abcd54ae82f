//! Lengths and angles as artists write them (`"1.3 shaku"`, `"60 deg"`). Everything behind this file is metres and
//! radians.

use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::Deserialize;
use std::borrow::Cow;
use std::fmt;

/// A unit of length. Shaku, sun and bu are those of the kujira-jaku, the tailor's rule: 1 shaku = 10 sun = 100 bu =
/// 37.88 cm.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum LengthUnit {
    #[allow(missing_docs)]
    Mm,
    #[allow(missing_docs)]
    Cm,
    #[allow(missing_docs)]
    M,
    #[allow(missing_docs)]
    Shaku,
    #[allow(missing_docs)]
    Sun,
    #[allow(missing_docs)]
    Bu,
}

impl LengthUnit {
    /// Every unit.
    pub const ALL: [LengthUnit; 6] =
        [LengthUnit::Mm, LengthUnit::Cm, LengthUnit::M, LengthUnit::Shaku, LengthUnit::Sun, LengthUnit::Bu];

    /// As written in files.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            LengthUnit::Mm => "mm",
            LengthUnit::Cm => "cm",
            LengthUnit::M => "m",
            LengthUnit::Shaku => "shaku",
            LengthUnit::Sun => "sun",
            LengthUnit::Bu => "bu",
        }
    }

    /// Metres in one of it.
    #[must_use]
    pub const fn metres(self) -> f64 {
        match self {
            LengthUnit::Mm => 0.001,
            LengthUnit::Cm => 0.01,
            LengthUnit::M => 1.0,
            LengthUnit::Shaku => 0.3788,
            LengthUnit::Sun => 0.03788,
            LengthUnit::Bu => 0.003788,
        }
    }
}

/// A length with its unit, for example `"0.05 mm"`.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize)]
#[serde(try_from = "toml::Value")]
pub struct Length {
    /// How many of the unit; finite.
    pub value: f64,
    /// The unit it was written in.
    pub unit: LengthUnit,
}

impl Length {
    /// In metres.
    #[must_use]
    pub fn metres(self) -> f64 {
        self.value * self.unit.metres()
    }
}

impl fmt::Display for Length {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} {}", self.value, self.unit.name())
    }
}

impl TryFrom<toml::Value> for Length {
    type Error = String;

    fn try_from(value: toml::Value) -> Result<Length, String> {
        const EXPECTED: &str = "a length is a number and a unit (mm, cm, m, shaku, sun or bu), for example \"0.05 mm\"";
        let (value, unit) = number_and_unit(&value).ok_or(EXPECTED)?;
        let unit = LengthUnit::ALL.into_iter().find(|known| known.name() == unit).ok_or(EXPECTED)?;
        Ok(Length { value, unit })
    }
}

impl JsonSchema for Length {
    fn schema_name() -> Cow<'static, str> {
        "Length".into()
    }

    fn json_schema(_: &mut SchemaGenerator) -> Schema {
        json_schema!({
            "type": "string",
            "description": "A number and a unit: mm, cm, m, or shaku, sun, bu of the kujira-jaku (1 shaku = 37.88 cm).",
            "pattern": "^[-+0-9.eE]+ *(mm|cm|m|shaku|sun|bu)$",
        })
    }
}

/// An angle with its unit, for example `"60 deg"`.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize)]
#[serde(try_from = "toml::Value")]
pub struct Angle {
    /// How many of the unit; finite.
    pub value: f64,
    /// The unit it was written in.
    pub unit: AngleUnit,
}

/// A unit of angle.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum AngleUnit {
    /// Degrees, `deg`.
    Deg,
    /// Radians, `rad`.
    Rad,
}

impl AngleUnit {
    /// As written in files.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            AngleUnit::Deg => "deg",
            AngleUnit::Rad => "rad",
        }
    }
}

impl Angle {
    /// In radians.
    #[must_use]
    pub fn radians(self) -> f64 {
        match self.unit {
            AngleUnit::Deg => self.value.to_radians(),
            AngleUnit::Rad => self.value,
        }
    }
}

impl fmt::Display for Angle {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} {}", self.value, self.unit.name())
    }
}

impl TryFrom<toml::Value> for Angle {
    type Error = String;

    fn try_from(value: toml::Value) -> Result<Angle, String> {
        const EXPECTED: &str = "an angle is a number and a unit (deg or rad), for example \"60 deg\"";
        let (value, unit) = number_and_unit(&value).ok_or(EXPECTED)?;
        let unit = [AngleUnit::Deg, AngleUnit::Rad].into_iter().find(|known| known.name() == unit).ok_or(EXPECTED)?;
        Ok(Angle { value, unit })
    }
}

impl JsonSchema for Angle {
    fn schema_name() -> Cow<'static, str> {
        "Angle".into()
    }

    fn json_schema(_: &mut SchemaGenerator) -> Schema {
        json_schema!({
            "type": "string",
            "description": "A number and a unit: deg or rad.",
            "pattern": "^[-+0-9.eE]+ *(deg|rad)$",
        })
    }
}

/// Splits `"1.3 shaku"`; the number is finite.
fn number_and_unit(value: &toml::Value) -> Option<(f64, &str)> {
    let text = value.as_str()?.trim();
    let unit_start = text.rfind(|c: char| !c.is_ascii_alphabetic())? + 1;
    let (number, unit) = text.split_at_checked(unit_start)?;
    let number: f64 = number.trim_end().parse().ok()?;
    number.is_finite().then_some((number, unit))
}
