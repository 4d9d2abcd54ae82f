//! The sections of a fit: bodies, dimensions and rules; the texture coordinates of the sizes.

use crate::arrays::limits as garment_limits;
use crate::fit::{Dimension, FitData, SizeBody, limits};
use crate::garment::Garment;
use crate::measurement::{Measurement, Measurements};
use crate::pack::ContentProblem;
use crate::pack::codec::Reader;
use crate::pack::residuals::{Predictor, ResidualReader};
use crate::tailoring::{Check, DimensionRule, Level, Limit, Op, RuleSet, Side};
use glam::Vec2;

#[cfg(feature = "write")]
use {crate::pack::codec::Writer, crate::pack::residuals::ResidualWriter};

/// The section `FITS`: everything but fields and texture coordinates.
pub(in crate::pack) fn read_fit(garment: &Garment, from: &mut Reader<'_>) -> Result<FitData, ContentProblem> {
    let bodies = from.count("bodies", limits::SIZES + 1)?;
    // Fields of no sizes would take memory without bytes.
    if bodies < 2 {
        return Err(ContentProblem::Number { what: "size target", number: 1 });
    }
    let bodies = (0..bodies).map(|_| read_body(garment, from)).collect::<Result<_, _>>()?;
    let dimensions = from.count("dimensions", limits::DIMENSIONS)?;
    let dimensions = (0..dimensions).map(|_| read_dimension(from)).collect::<Result<_, _>>()?;
    let rules = from.count("rule sets", limits::RULES)?;
    let rules = (0..rules).map(|_| read_rules(from)).collect::<Result<_, _>>()?;
    let parts = garment.data().mesh.parts.iter().map(|part| part.name.clone()).collect();
    Ok(FitData { bodies, dimensions, parts, fields: Vec::new(), uv: Vec::new(), rules })
}

#[cfg(feature = "write")]
pub(in crate::pack) fn write_fit(fit: &FitData, to: &mut Writer) {
    to.count(fit.bodies.len());
    fit.bodies.iter().for_each(|body| write_body(body, to));
    to.count(fit.dimensions.len());
    fit.dimensions.iter().for_each(|dimension| write_dimension(dimension, to));
    to.count(fit.rules.len());
    fit.rules.iter().for_each(|rules| write_rules(rules, to));
}

fn read_body(garment: &Garment, from: &mut Reader<'_>) -> Result<SizeBody, ContentProblem> {
    let name = from.text()?;
    let mut measurements = Measurements::default();
    for _ in 0..from.u8()? {
        let measurement = read_measurement(from)?;
        measurements = measurements.with(measurement, from.f32()?);
    }
    let joints = garment.data().skeleton.joints();
    Ok(SizeBody { name, measurements, joints_m: joints.iter().map(|_| from.vec3()).collect::<Result<_, _>>()? })
}

#[cfg(feature = "write")]
fn write_body(body: &SizeBody, to: &mut Writer) {
    to.text(&body.name);
    let known = Measurement::ALL.into_iter().filter_map(|m| Some((m, body.measurements.get(m)?)));
    to.u8(known.clone().count() as u8);
    for (measurement, value_m) in known {
        to.u8(measurement as u8);
        to.f32(value_m);
    }
    body.joints_m.iter().for_each(|&joint_m| to.vec3(joint_m));
}

fn read_measurement(from: &mut Reader<'_>) -> Result<Measurement, ContentProblem> {
    let number = from.u8()?;
    Measurement::ALL.get(usize::from(number)).copied().ok_or(ContentProblem::Number { what: "measurement", number })
}

fn read_dimension(from: &mut Reader<'_>) -> Result<Dimension, ContentProblem> {
    let [name, ja, rule] = [from.text()?, from.text()?, from.text()?];
    let [offset_m, load] = [from.f32()?, from.f32()?];
    let vertices = from.count("vertices of a path", garment_limits::VERTICES)?;
    Ok(Dimension { name, ja, rule, offset_m, load, vertices: from.column::<4>(vertices)?.collect() })
}

#[cfg(feature = "write")]
fn write_dimension(Dimension { name, ja, rule, offset_m, load, vertices }: &Dimension, to: &mut Writer) {
    [name, ja, rule].into_iter().for_each(|text| to.text(text));
    [offset_m, load].into_iter().for_each(|&number| to.f32(number));
    to.count(vertices.len());
    to.column::<4>(vertices.iter().copied());
}

fn read_rules(from: &mut Reader<'_>) -> Result<RuleSet, ContentProblem> {
    let [name, source] = [from.text()?, from.text()?];
    let dimensions = (0..from.u16()?)
        .map(|_| {
            from.allow(size_of::<DimensionRule>())?;
            Ok(DimensionRule { name: from.text()?, ja: from.text()?, program: read_program(from)? })
        })
        .collect::<Result<_, _>>()?;
    let checks = (0..from.u16()?)
        .map(|_| {
            from.allow(size_of::<Check>())?;
            let (name, value) = (from.text()?, read_program(from)?);
            let limits = (0..from.u16()?).map(|_| read_limit(from)).collect::<Result<_, _>>()?;
            Ok(Check { name, value, limits })
        })
        .collect::<Result<_, _>>()?;
    Ok(RuleSet { name, source, dimensions, checks })
}

#[cfg(feature = "write")]
fn write_rules(RuleSet { name, source, dimensions, checks }: &RuleSet, to: &mut Writer) {
    to.text(name);
    to.text(source);
    to.u16(dimensions.len() as u16);
    for DimensionRule { name, ja, program } in dimensions {
        to.text(name);
        to.text(ja);
        write_program(program, to);
    }
    to.u16(checks.len() as u16);
    for Check { name, value, limits } in checks {
        to.text(name);
        write_program(value, to);
        to.u16(limits.len() as u16);
        limits.iter().for_each(|limit| write_limit(limit, to));
    }
}

const SIDES: [Side; 2] = [Side::Below, Side::Above];
const LEVELS: [Level; 3] = [Level::Ok, Level::Warn, Level::Impossible];

fn read_limit(from: &mut Reader<'_>) -> Result<Limit, ContentProblem> {
    from.allow(size_of::<Limit>())?;
    let of = |what, number: u8| ContentProblem::Number { what, number };
    let side = from.u8()?;
    let side = *SIDES.get(usize::from(side)).ok_or(of("side", side))?;
    let level = from.u8()?;
    let level = *LEVELS.get(usize::from(level)).ok_or(of("level", level))?;
    Ok(Limit { side, level, bound: read_program(from)?, text: from.text()? })
}

#[cfg(feature = "write")]
fn write_limit(limit: &Limit, to: &mut Writer) {
    to.u8(limit.side as u8);
    to.u8(limit.level as u8);
    write_program(&limit.bound, to);
    to.text(&limit.text);
}

/// The steps without operand, in the order of their numbers.
const PLAIN: [Op; 13] = [
    Op::Add,
    Op::Subtract,
    Op::Multiply,
    Op::Divide,
    Op::Minimum,
    Op::Maximum,
    Op::Round,
    Op::RoundUp,
    Op::RoundDown,
    Op::Hypotenuse,
    Op::Less,
    Op::LessOrEqual,
    Op::Select,
];
const CONSTANT: u8 = 0;
const MEASUREMENT: u8 = 1;
const DIMENSION: u8 = 2;
const IF_KNOWN: u8 = 3;
/// The number of the first of [`PLAIN`].
const FIRST_PLAIN: u8 = 4;

fn read_program(from: &mut Reader<'_>) -> Result<Vec<Op>, ContentProblem> {
    let count = from.u16()?;
    from.allow(usize::from(count) * size_of::<Op>())?;
    let op = |_| {
        Ok(match from.u8()? {
            CONSTANT => Op::Constant(from.f32()?),
            MEASUREMENT => Op::Measurement(read_measurement(from)?),
            DIMENSION => Op::Dimension(from.u16()?),
            IF_KNOWN => Op::IfKnown(read_measurement(from)?),
            number => *PLAIN
                .get(usize::from(number - FIRST_PLAIN))
                .ok_or(ContentProblem::Number { what: "step of a program", number })?,
        })
    };
    (0..count).map(op).collect()
}

#[cfg(feature = "write")]
fn write_program(program: &[Op], to: &mut Writer) {
    to.u16(program.len() as u16);
    for op in program {
        match *op {
            Op::Constant(number) => {
                to.u8(CONSTANT);
                to.f32(number);
            }
            Op::Measurement(measurement) => [MEASUREMENT, measurement as u8].into_iter().for_each(|byte| to.u8(byte)),
            Op::Dimension(dimension) => {
                to.u8(DIMENSION);
                to.u16(dimension);
            }
            Op::IfKnown(measurement) => [IF_KNOWN, measurement as u8].into_iter().for_each(|byte| to.u8(byte)),
            plain => {
                let number = PLAIN.iter().position(|known| *known == plain).expect("every other step stands there");
                to.u8(FIRST_PLAIN + number as u8);
            }
        }
    }
}

/// The section `SZUV`, of as many sizes as the fit has.
pub(in crate::pack) fn read_uv(
    garment: &Garment,
    sizes: usize,
    from: &mut Reader<'_>,
) -> Result<Vec<Vec<Vec2>>, ContentProblem> {
    let count = garment.vertex_count();
    let step = from.f64()?;
    if step == 0.0 {
        let read = |_| {
            let [u, v] = from.floats(count)?;
            Ok(u.zip(v).map(|(u, v)| Vec2::new(u, v)).collect())
        };
        return (0..sizes).map(read).collect();
    }
    let length = from.u32()? as usize;
    let mut reader = ResidualReader::new(from.take(length)?, 2);
    let values = sizes.saturating_mul(2 * count);
    if values > 8 * length {
        return Err(ContentProblem::Ends { needed: values.div_ceil(8), left: length });
    }
    from.allow(4 * values)?;
    let predictor = Predictor::new(count, &garment.data().mesh.triangles);
    let mut uv = vec![vec![Vec2::ZERO; count]; sizes];
    let mut known = vec![0i32; count];
    for uv in &mut uv {
        for axis in 0..2 {
            for (v, uv) in uv.iter_mut().enumerate() {
                known[v] = reader.value(axis, &predictor, v, &known);
                uv[axis] = from_steps(known[v], step);
            }
        }
    }
    reader.finish()?;
    Ok(uv)
}

#[cfg(feature = "write")]
pub(in crate::pack) fn write_uv(garment: &Garment, uv: &[Vec<Vec2>], to: &mut Writer) {
    let is_exact = |step: &&f64| {
        uv.iter()
            .flatten()
            .flat_map(|uv| uv.to_array())
            .all(|x| from_steps(in_steps(x, **step), **step).to_bits() == x.to_bits())
    };
    let Some(&step) = UV_STEPS.iter().find(is_exact) else {
        to.f64s(&[0.0]);
        uv.iter().for_each(|uv| to.floats(uv, |uv| uv.to_array()));
        return;
    };
    to.f64s(&[step]);
    let predictor = Predictor::new(garment.vertex_count(), &garment.data().mesh.triangles);
    let mut writer = ResidualWriter::new(2);
    for uv in uv {
        for axis in 0..2 {
            let values: Vec<i32> = uv.iter().map(|uv| in_steps(uv[axis], step)).collect();
            (0..values.len()).for_each(|v| writer.value(axis, &predictor, v, &values));
        }
    }
    let bits = writer.finish();
    to.count(bits.len());
    to.take(&bits);
}

/// Steps of which texture coordinates may be whole multiples: files have so many decimals.
#[cfg(feature = "write")]
const UV_STEPS: [f64; 3] = [1e-4, 1e-5, 1e-6];

#[cfg(feature = "write")]
fn in_steps(coordinate: f32, step: f64) -> i32 {
    (f64::from(coordinate) / step).round() as i32
}

fn from_steps(steps: i32, step: f64) -> f32 {
    (f64::from(steps) * step) as f32
}
