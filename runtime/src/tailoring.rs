//! Tailoring (仕立て): from body measurements to the dimensions of a kimono by published rules. A rule set is plain data, small programs that
//! were compiled from text when the kimono was built. Knows no mesh, no file and no text but names and what verdicts say.

use crate::measurement::{Measurement, Measurements};

/// A published way to derive a kimono's dimensions from the body.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct RuleSet {
    /// For example `women-a`.
    pub name: String,
    /// Who published it, for people.
    pub source: String,
    /// Every dimension, each computed from the body and from dimensions before it.
    pub dimensions: Vec<DimensionRule>,
    /// What a tailor checks before cutting.
    pub checks: Vec<Check>,
}

/// How one dimension is computed.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct DimensionRule {
    /// For example `sode_take`.
    pub name: String,
    /// For example 袖丈; empty for a value that only helps to compute others.
    pub ja: String,
    /// Gives metres.
    pub program: Vec<Op>,
}

/// A length that a tailor looks at, and its limits.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Check {
    /// For example `kata_ushiro`.
    pub name: String,
    /// Gives metres; may use every dimension.
    pub value: Vec<Op>,
    /// Where the value becomes bad.
    pub limits: Vec<Limit>,
}

/// A bound of a check.
#[derive(Clone, Debug, PartialEq)]
pub struct Limit {
    /// On which side of the bound the value is bad.
    pub side: Side,
    /// How bad it is there; not `Ok`.
    pub level: Level,
    /// Gives metres; may use every dimension.
    pub bound: Vec<Op>,
    /// What this means and what to do, for people.
    pub text: String,
}

/// A side of a bound.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub enum Side {
    /// Smaller than the bound.
    Below,
    /// Greater than the bound.
    Above,
}

/// How a check came out.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
#[repr(u8)]
pub enum Level {
    /// Within all limits.
    Ok,
    /// It can be sewn, with care or with other cloth.
    Warn,
    /// It cannot be sewn.
    Impossible,
}

/// One step of a program: takes its operands from the top of a stack, the last one topmost, and pushes one number. Lengths are metres,
/// conditions are 1 and 0.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Op {
    /// A number.
    Constant(f32),
    /// A measurement of the body.
    Measurement(Measurement),
    /// A dimension before this one, by its index in [`RuleSet::dimensions`].
    Dimension(u16),
    /// Takes one operand and gives the measurement in its stead where that is known.
    IfKnown(Measurement),
    /// a + b
    Add,
    /// a - b
    Subtract,
    /// a * b
    Multiply,
    /// a / b
    Divide,
    /// The smaller of a and b; of conditions: both.
    Minimum,
    /// The greater of a and b; of conditions: either.
    Maximum,
    /// The multiple of b nearest to a, of two the one farther from 0.
    Round,
    /// The least multiple of b that is not below a, but for a [`HAIR`].
    RoundUp,
    /// The greatest multiple of b that is not above a, but for a [`HAIR`].
    RoundDown,
    /// The diagonal of a rectangle with sides a and b.
    Hypotenuse,
    /// Whether a < b.
    Less,
    /// Whether a <= b.
    LessOrEqual,
    /// Takes condition, a, b; gives a where the condition holds, else b.
    Select,
}

/// How far, in steps, a number may lie beyond a multiple and is still rounded to it: multiples are not exact in binary.
pub const HAIR: f32 = 1e-4;

/// How far a value may lie beyond a limit and is still within it, metres: what binary numbers leave of sums.
const TOLERANCE_M: f32 = 1e-6;

/// Most dimensions, and most checks, of a rule set.
const ENTRIES: usize = 256;
/// Most steps of a program.
const STEPS: usize = 1024;
/// Most numbers on the stack.
const DEPTH: usize = 32;
/// Most bytes of a name, and of a text.
const NAME_BYTES: usize = 64;
const TEXT_BYTES: usize = 1024;

/// What is wrong with a rule set.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum InvalidRules {
    /// There is too much of something.
    #[error("the rules have {found} {what}, more than {most}")]
    TooMany {
        /// Of what.
        what: &'static str,
        /// How many there are.
        found: usize,
        /// How many there may be.
        most: usize,
    },
    /// A name is empty, too long or there twice.
    #[error("`{0}` is no name, or names two things")]
    Name(String),
    /// A program cannot run.
    #[error("the program of `{of}` {problem} at step {step}")]
    Program {
        /// The dimension or check.
        of: String,
        /// Counted from 0.
        step: usize,
        /// What happens there.
        problem: &'static str,
    },
    /// A limit that says all is well.
    #[error("a limit of `{0}` has no level")]
    Level(String),
}

/// Why a dimension has no value.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum NoDimension {
    /// A measurement is not known.
    #[error("{dimension} needs {}, which is not known", .measurement.name())]
    Missing {
        /// Which dimension.
        dimension: String,
        /// Which measurement.
        measurement: Measurement,
    },
    /// A division by zero, or a number beyond all bodies.
    #[error("{0} is not a finite number for this body")]
    NotFinite(String),
}

/// The dimensions of a kimono for one wearer, metres, in the order of [`RuleSet::dimensions`].
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Dimensions(pub Vec<f32>);

/// How one check came out.
#[derive(Clone, Debug, PartialEq)]
pub struct Verdict<'a> {
    /// The check.
    pub check: &'a Check,
    /// Its value, metres.
    pub value_m: f32,
    /// How bad it is.
    pub level: Level,
    /// The worst limit that is passed, with its bound in metres; `None` when all is well.
    pub limit: Option<(&'a Limit, f32)>,
}

impl RuleSet {
    /// Whether the rules can be used: sizes, names, and that every program runs to its end with one number left.
    ///
    /// # Errors
    /// The first thing that is wrong.
    pub fn validate(&self) -> Result<(), InvalidRules> {
        at_most("dimensions", self.dimensions.len(), ENTRIES)?;
        at_most("checks", self.checks.len(), ENTRIES)?;
        at_most("bytes of source", self.source.len(), TEXT_BYTES)?;
        check_name(&self.name)?;
        for (i, rule) in self.dimensions.iter().enumerate() {
            check_name(&rule.name)?;
            at_most("bytes of a name", rule.ja.len(), NAME_BYTES)?;
            if self.dimensions[..i].iter().any(|other| other.name == rule.name) {
                return Err(InvalidRules::Name(rule.name.clone()));
            }
            check_program(&rule.name, &rule.program, i)?;
        }
        for (i, check) in self.checks.iter().enumerate() {
            check_name(&check.name)?;
            if self.checks[..i].iter().any(|other| other.name == check.name) {
                return Err(InvalidRules::Name(check.name.clone()));
            }
            check_program(&check.name, &check.value, self.dimensions.len())?;
            at_most("limits", check.limits.len(), ENTRIES)?;
            for limit in &check.limits {
                check_program(&check.name, &limit.bound, self.dimensions.len())?;
                at_most("bytes of text", limit.text.len(), TEXT_BYTES)?;
                if limit.level == Level::Ok {
                    return Err(InvalidRules::Level(check.name.clone()));
                }
            }
        }
        Ok(())
    }

    /// The dimensions of a kimono for a body.
    ///
    /// # Errors
    /// The first dimension that has no value, and why.
    ///
    /// # Panics
    /// The rules are not [valid](RuleSet::validate).
    pub fn dimensions(&self, body: &Measurements) -> Result<Dimensions, NoDimension> {
        let mut values_m = Vec::with_capacity(self.dimensions.len());
        for rule in &self.dimensions {
            match evaluate(&rule.program, body, &values_m) {
                Ok(value_m) if value_m.is_finite() => values_m.push(value_m),
                Ok(_) => return Err(NoDimension::NotFinite(rule.name.clone())),
                Err(measurement) => {
                    return Err(NoDimension::Missing { dimension: rule.name.clone(), measurement });
                }
            }
        }
        Ok(Dimensions(values_m))
    }

    /// What the checks say about a kimono with these dimensions, as [`RuleSet::dimensions`] gave them, for this body. A check that needs a
    /// measurement that is not known is left out.
    ///
    /// # Panics
    /// The rules are not [valid](RuleSet::validate), or the dimensions are those of other rules.
    #[must_use]
    pub fn verdicts(&self, body: &Measurements, dimensions: &Dimensions) -> Vec<Verdict<'_>> {
        assert_eq!(dimensions.0.len(), self.dimensions.len(), "dimensions of other rules");
        self.checks.iter().filter_map(|check| check.verdict(body, &dimensions.0)).collect()
    }

    /// Where a dimension stands in [`Dimensions`].
    #[must_use]
    pub fn index_of(&self, name: &str) -> Option<usize> {
        self.dimensions.iter().position(|rule| rule.name == name)
    }
}

impl Check {
    fn verdict(&self, body: &Measurements, dimensions_m: &[f32]) -> Option<Verdict<'_>> {
        let value_m = evaluate(&self.value, body, dimensions_m).ok()?;
        let mut verdict = Verdict { check: self, value_m, level: Level::Ok, limit: None };
        for limit in &self.limits {
            let bound_m = evaluate(&limit.bound, body, dimensions_m).ok()?;
            let is_within = match limit.side {
                Side::Below => value_m >= bound_m - TOLERANCE_M,
                Side::Above => value_m <= bound_m + TOLERANCE_M,
            };
            // What is no number is within nothing. Of equal levels the last limit speaks.
            if !is_within && limit.level >= verdict.level {
                verdict = Verdict { level: limit.level, limit: Some((limit, bound_m)), ..verdict };
            }
        }
        Some(verdict)
    }
}

impl Op {
    /// As two numbers: which step, and what it carries (0 where it carries nothing).
    #[must_use]
    pub const fn to_code(self) -> (u8, u32) {
        match self {
            Op::Constant(value) => (0, value.to_bits()),
            Op::Measurement(measurement) => (1, measurement as u32),
            Op::Dimension(index) => (2, index as u32),
            Op::IfKnown(measurement) => (3, measurement as u32),
            Op::Add => (4, 0),
            Op::Subtract => (5, 0),
            Op::Multiply => (6, 0),
            Op::Divide => (7, 0),
            Op::Minimum => (8, 0),
            Op::Maximum => (9, 0),
            Op::Round => (10, 0),
            Op::RoundUp => (11, 0),
            Op::RoundDown => (12, 0),
            Op::Hypotenuse => (13, 0),
            Op::Less => (14, 0),
            Op::LessOrEqual => (15, 0),
            Op::Select => (16, 0),
        }
    }

    /// From what [`Op::to_code`] gave; `None` for anything else.
    #[must_use]
    pub fn from_code(code: u8, operand: u32) -> Option<Op> {
        let measurement = || Measurement::ALL.get(operand as usize).copied();
        let op = match code {
            0 => Op::Constant(f32::from_bits(operand)),
            1 => Op::Measurement(measurement()?),
            2 => Op::Dimension(u16::try_from(operand).ok()?),
            3 => Op::IfKnown(measurement()?),
            4 => Op::Add,
            5 => Op::Subtract,
            6 => Op::Multiply,
            7 => Op::Divide,
            8 => Op::Minimum,
            9 => Op::Maximum,
            10 => Op::Round,
            11 => Op::RoundUp,
            12 => Op::RoundDown,
            13 => Op::Hypotenuse,
            14 => Op::Less,
            15 => Op::LessOrEqual,
            16 => Op::Select,
            _ => return None,
        };
        (op.to_code() == (code, operand)).then_some(op)
    }

    /// How many operands it takes.
    const fn operands(self) -> usize {
        match self {
            Op::Constant(_) | Op::Measurement(_) | Op::Dimension(_) => 0,
            Op::IfKnown(_) => 1,
            Op::Select => 3,
            _ => 2,
        }
    }
}

fn at_most(what: &'static str, found: usize, most: usize) -> Result<(), InvalidRules> {
    if found <= most { Ok(()) } else { Err(InvalidRules::TooMany { what, found, most }) }
}

fn check_name(name: &str) -> Result<(), InvalidRules> {
    if (1..=NAME_BYTES).contains(&name.len()) { Ok(()) } else { Err(InvalidRules::Name(name.to_owned())) }
}

/// Whether a program runs to its end, with `earlier` dimensions known.
fn check_program(of: &str, program: &[Op], earlier: usize) -> Result<(), InvalidRules> {
    let wrong = |step, problem| Err(InvalidRules::Program { of: of.to_owned(), step, problem });
    at_most("steps in a program", program.len(), STEPS)?;
    let mut depth = 0usize;
    for (step, op) in program.iter().enumerate() {
        match *op {
            Op::Constant(value) if !value.is_finite() => return wrong(step, "has a constant that is not finite"),
            Op::Dimension(index) if usize::from(index) >= earlier => return wrong(step, "uses a later dimension"),
            _ => {}
        }
        let Some(rest) = depth.checked_sub(op.operands()) else { return wrong(step, "lacks an operand") };
        depth = rest + 1;
        if depth > DEPTH {
            return wrong(step, "needs too deep a stack");
        }
    }
    if depth == 1 { Ok(()) } else { wrong(program.len(), "does not leave one number") }
}

/// Runs a valid program. An operand that depends on an unknown measurement is that measurement, and so is everything that depends on it.
fn evaluate(program: &[Op], body: &Measurements, earlier_m: &[f32]) -> Result<f32, Measurement> {
    let mut stack = [Ok(0.0); DEPTH];
    let mut depth = 0;
    let known = |measurement: Measurement| body.get(measurement).ok_or(measurement);
    for op in program {
        depth -= op.operands();
        let operands = &stack[depth..];
        let two = |f: fn(f32, f32) -> f32| Ok(f(operands[0]?, operands[1]?));
        stack[depth] = match *op {
            Op::Constant(value) => Ok(value),
            Op::Measurement(measurement) => known(measurement),
            Op::Dimension(index) => Ok(earlier_m[usize::from(index)]),
            Op::IfKnown(measurement) => known(measurement).or(operands[0]),
            Op::Add => two(|a, b| a + b),
            Op::Subtract => two(|a, b| a - b),
            Op::Multiply => two(|a, b| a * b),
            Op::Divide => two(|a, b| a / b),
            Op::Minimum => two(|a, b| if b < a { b } else { a }),
            Op::Maximum => two(|a, b| if b > a { b } else { a }),
            Op::Round => two(|a, b| libm::roundf(a / b) * b),
            Op::RoundUp => two(|a, b| libm::ceilf(a / b - HAIR) * b),
            Op::RoundDown => two(|a, b| libm::floorf(a / b + HAIR) * b),
            Op::Hypotenuse => two(libm::hypotf),
            Op::Less => two(|a, b| f32::from(a < b)),
            Op::LessOrEqual => two(|a, b| f32::from(a <= b)),
            Op::Select => operands[0].and_then(|condition| operands[if condition != 0.0 { 1 } else { 2 }]),
        };
        depth += 1;
    }
    stack[0]
}

#[cfg(test)]
mod tests {
    use super::Op::{
        Add, Constant as C, Divide, Hypotenuse, IfKnown, Less, LessOrEqual, Maximum, Minimum, Multiply, Round,
        RoundDown, RoundUp, Select, Subtract,
    };
    use super::*;

    fn rules(programs: &[&[Op]]) -> RuleSet {
        let rule = |(i, program): (usize, &&[Op])| DimensionRule {
            name: format!("d{i}"),
            ja: String::new(),
            program: program.to_vec(),
        };
        RuleSet {
            name: "test".to_owned(),
            dimensions: programs.iter().enumerate().map(rule).collect(),
            ..RuleSet::default()
        }
    }

    fn value(program: &[Op], body: &Measurements) -> Result<f32, NoDimension> {
        let rules = rules(&[program]);
        assert_eq!(rules.validate(), Ok(()));
        rules.dimensions(body).map(|dimensions| dimensions.0[0])
    }

    #[test]
    fn every_step_does_what_it_says() {
        let body = Measurements::default().with(Measurement::HipGirth, 0.9);
        let hip = Op::Measurement(Measurement::HipGirth);
        for (program, expected) in [
            (&[hip, C(2.0), Divide, C(0.06), Subtract][..], 0.39),
            (&[C(2.0), C(3.0), Multiply, C(1.0), Add], 7.0),
            (&[C(2.0), C(-3.0), Minimum], -3.0),
            (&[C(2.0), C(-3.0), Maximum], 2.0),
            (&[C(3.0), C(-4.0), Hypotenuse], 5.0),
            (&[C(0.26), C(0.1), Round], 0.3),
            (&[C(-0.25), C(0.5), Round], -0.5),
            (&[C(0.21), C(0.1), RoundUp], 0.3),
            // 3 in binary tenths is a hair more or less than 0.3.
            (&[C(0.3), C(0.1), RoundUp], 0.3),
            (&[C(0.3), C(0.1), RoundDown], 0.3),
            (&[C(0.29), C(0.1), RoundDown], 0.2),
            (&[C(-0.29), C(0.1), RoundDown], -0.3),
            (&[C(1.0), C(2.0), Less], 1.0),
            (&[C(2.0), C(2.0), Less], 0.0),
            (&[C(2.0), C(2.0), LessOrEqual], 1.0),
            (&[C(2.5), C(2.0), LessOrEqual], 0.0),
            (&[C(1.0), C(7.0), C(8.0), Select], 7.0),
            (&[C(0.0), C(7.0), C(8.0), Select], 8.0),
            (&[C(0.34), IfKnown(Measurement::NeckGirth)], 0.34),
            (&[C(0.34), IfKnown(Measurement::HipGirth)], 0.9),
        ] {
            let found = value(program, &body).unwrap();
            assert!((found - expected).abs() < 1e-6, "{program:?}: {found}");
        }
    }

    #[test]
    fn what_is_not_known_matters_only_where_it_is_used() {
        let neck = Measurement::NeckGirth;
        let unknown = Op::Measurement(neck);
        let nobody = Measurements::default();
        let missing = Err(NoDimension::Missing { dimension: "d0".to_owned(), measurement: neck });
        assert_eq!(value(&[unknown, C(1.0), Maximum], &nobody), missing);
        assert_eq!(value(&[unknown, C(1.0), C(2.0), Select], &nobody), missing);
        assert_eq!(value(&[C(1.0), unknown, C(2.0), Select], &nobody), missing);
        assert_eq!(value(&[C(0.0), unknown, C(2.0), Select], &nobody), Ok(2.0));
        assert_eq!(value(&[unknown, IfKnown(neck)], &nobody), missing);
        assert_eq!(value(&[unknown, IfKnown(neck)], &nobody.with(neck, 0.3)), Ok(0.3));
        assert_eq!(value(&[C(1.0), C(0.0), Divide], &nobody), Err(NoDimension::NotFinite("d0".to_owned())));
    }

    #[test]
    fn programs_that_cannot_run_are_refused() {
        let deepest: Vec<Op> = [vec![C(1.0); DEPTH], vec![Add; DEPTH - 1]].concat();
        assert_eq!(rules(&[&deepest]).validate(), Ok(()));
        let too_deep: Vec<Op> = [vec![C(1.0); DEPTH + 1], vec![Add; DEPTH]].concat();
        for (program, step) in [
            (&[][..], 0),
            (&[C(1.0), C(1.0)], 2),
            (&[Add], 0),
            (&[C(1.0), Add], 1),
            (&[C(1.0), C(1.0), Select], 2),
            (&[IfKnown(Measurement::HipGirth)], 0),
            (&[Op::Dimension(0)], 0),
            (&[C(f32::NAN)], 0),
            (&too_deep, DEPTH),
        ] {
            match rules(&[program]).validate() {
                Err(InvalidRules::Program { step: found, .. }) => assert_eq!(found, step, "{program:?}"),
                other => panic!("{program:?}: {other:?}"),
            }
        }
        assert!(rules(&[&[C(1.0)], &[Op::Dimension(0)]]).validate().is_ok());
        assert!(rules(&[&vec![C(1.0); STEPS + 1]]).validate().is_err());
        let mut twice = rules(&[&[C(1.0)], &[C(1.0)]]);
        twice.dimensions[1].name = "d0".to_owned();
        assert_eq!(twice.validate(), Err(InvalidRules::Name("d0".to_owned())));
    }

    #[test]
    fn steps_and_their_codes_are_one_to_one() {
        let mut count = 0;
        for code in 0..=u8::MAX {
            for operand in
                [0, 1, 5, Measurement::COUNT as u32 - 1, Measurement::COUNT as u32, 0xffff, 0x1_0000, u32::MAX]
            {
                if let Some(op) = Op::from_code(code, operand) {
                    assert_eq!(op.to_code(), (code, operand));
                    count += usize::from(operand == 0);
                }
            }
        }
        assert_eq!(count, 17);
        assert_eq!(Op::from_code(4, 1), None);
        assert_eq!(Op::from_code(1, Measurement::COUNT as u32), None);
    }

    #[test]
    fn verdicts_name_the_worst_limit() {
        let limit =
            |side, level, bound: f32| Limit { side, level, bound: vec![Op::Constant(bound)], text: format!("{bound}") };
        let mut rules = rules(&[&[Op::Measurement(Measurement::HipGirth)]]);
        rules.checks = vec![Check {
            name: "c".to_owned(),
            value: vec![Op::Dimension(0)],
            limits: vec![
                limit(Side::Above, Level::Impossible, 1.2),
                limit(Side::Above, Level::Warn, 1.0),
                limit(Side::Above, Level::Warn, 1.1),
                limit(Side::Below, Level::Warn, 0.8),
            ],
        }];
        rules.validate().unwrap();
        for (hip_m, level, text) in [
            (0.79, Level::Warn, "0.8"),
            (0.8, Level::Ok, ""),
            (1.0, Level::Ok, ""),
            (1.000_01, Level::Warn, "1"),
            (1.15, Level::Warn, "1.1"),
            (1.3, Level::Impossible, "1.2"),
        ] {
            let body = Measurements::default().with(Measurement::HipGirth, hip_m);
            let verdicts = rules.verdicts(&body, &rules.dimensions(&body).unwrap());
            assert_eq!((verdicts[0].level, verdicts[0].value_m), (level, hip_m));
            assert_eq!(verdicts[0].limit.map_or("", |(limit, _)| &limit.text), text, "{hip_m}");
        }
        rules.checks[0].value = vec![Op::Measurement(Measurement::NeckGirth)];
        let body = Measurements::default().with(Measurement::HipGirth, 1.0);
        assert_eq!(rules.verdicts(&body, &rules.dimensions(&body).unwrap()), []);
        rules.checks[0].limits[0].level = Level::Ok;
        assert_eq!(rules.validate(), Err(InvalidRules::Level("c".to_owned())));
    }
}
