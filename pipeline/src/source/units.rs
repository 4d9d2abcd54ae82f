//! Lengths and angles as artists write them (`"1.3 shaku"`, `"60 deg"`). Everything behind this file is metres and
//! radians.

use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::Deserialize;
use std::borrow::Cow;
use std::fmt;

/// A unit of length. Shaku, sun and bu are those of the kujira-jaku, the tailor's rule: 1 shaku = 10 sun = 100 bu =
/// 37.88 cm.
#[allow(missing_docs)]
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(try_from = "toml::Value")]
pub enum LengthUnit {
    Mm,
    Cm,
    M,
    Shaku,
    Sun,
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

impl TryFrom<toml::Value> for LengthUnit {
    type Error = String;

    fn try_from(value: toml::Value) -> Result<LengthUnit, String> {
        one_of("unit of length", &value, LengthUnit::ALL.map(|unit| (unit.name(), unit)))
    }
}

impl JsonSchema for LengthUnit {
    fn schema_name() -> Cow<'static, str> {
        "LengthUnit".into()
    }

    fn json_schema(_: &mut SchemaGenerator) -> Schema {
        json_schema!({ "type": "string", "enum": LengthUnit::ALL.map(LengthUnit::name) })
    }
}

/// The one of several values that `value` names.
pub(super) fn one_of<T: Copy>(
    what: &str,
    value: &toml::Value,
    all: impl IntoIterator<Item = (&'static str, T)> + Clone,
) -> Result<T, String> {
    let found = all.clone().into_iter().find(|(name, _)| value.as_str() == Some(name));
    found.map(|(_, one)| one).ok_or_else(|| {
        let names: Vec<String> = all.into_iter().map(|(name, _)| format!("\"{name}\"")).collect();
        format!("{value} is no {what}; write {}", names.join(" or "))
    })
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
pub(super) fn number_and_unit(value: &toml::Value) -> Option<(f64, &str)> {
    let text = value.as_str()?.trim();
    let unit_start = text.rfind(|c: char| !c.is_ascii_alphabetic())? + 1;
    let (number, unit) = text.split_at_checked(unit_start)?;
    let number: f64 = number.trim_end().parse().ok()?;
    number.is_finite().then_some((number, unit))
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn length(text: &str) -> Option<f64> {
        Length::try_from(toml::Value::String(text.to_owned())).ok().map(Length::metres)
    }

    #[test]
    fn lengths_as_artists_write_them() {
        let check = |text, expected: f64| {
            let metres = length(text).unwrap_or_else(|| panic!("{text}"));
            assert!((metres - expected).abs() < 1e-12, "{text}: {metres}");
        };
        check("0.05 mm", 0.000_05);
        check("8.712 cm", 0.087_12);
        check("1.3 shaku", 0.492_44);
        check("4sun", 0.151_52);
        check("-5 bu", -0.018_94);
        check("  2   m ", 2.0);
        check("1e-3 m", 0.001);
        for wrong in ["", "mm", "5", "5 inch", "1,5 cm", "nan m", "inf m", "5 mm mm", "5 MM"] {
            assert_eq!(length(wrong), None, "{wrong}");
        }
        assert!(Length::try_from(toml::Value::Float(0.05)).is_err(), "a length without unit is ambiguous");
    }

    #[test]
    fn ten_bu_are_a_sun_and_ten_sun_a_shaku() {
        let check =
            |ten: &str, one: &str| assert!((length(ten).unwrap() - length(one).unwrap()).abs() < 1e-15, "{ten}");
        check("10 bu", "1 sun");
        check("10 sun", "1 shaku");
        check("37.88 cm", "1 shaku");
    }

    proptest! {
        #[test]
        fn written_lengths_and_angles_read_back(value in -1e6..1e6f64, unit in 0..LengthUnit::ALL.len(), is_deg: bool) {
            let written = Length { value, unit: LengthUnit::ALL[unit] };
            prop_assert_eq!(Length::try_from(toml::Value::String(written.to_string())), Ok(written));
            let angle = Angle { value, unit: if is_deg { AngleUnit::Deg } else { AngleUnit::Rad } };
            prop_assert_eq!(Angle::try_from(toml::Value::String(angle.to_string())), Ok(angle));
        }
    }
}
