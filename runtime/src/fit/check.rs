//! The one validation of [`FitData`], for those who write packs and those who read them. Knows no bytes.

use super::{Dimension, Field, FitData, SizeBody};
use crate::arrays::{InvalidGarment, check_count, check_length, is_name, limits as garment_limits};
use crate::garment::Garment;
use crate::measurement::Measurement;
use crate::tailoring::InvalidRules;
use glam::Vec3;

/// Sizes beyond which nothing is fitted.
pub mod limits {
    /// Most size targets; one bit for each, and one for the base.
    pub const SIZES: usize = 127;
    /// Most measured dimensions.
    pub const DIMENSIONS: usize = 256;
    /// Most rule sets.
    pub const RULES: usize = 64;
    /// Most deltas of all fields together.
    pub const DELTAS: usize = 1 << 25;
    /// Greatest load of a dimension.
    pub const LOAD: f32 = 1e3;
    /// Greatest measurement, metres.
    pub const MEASUREMENT_M: f32 = 10.0;
}

/// Which element of a [`FitData`] is wrong, and what is wrong with it. Elements are numbered from 0.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum InvalidFit {
    /// There are too many elements, or too few, or an array differs in length from what it describes.
    #[error(transparent)]
    Arrays(#[from] InvalidGarment),
    /// A name is empty, too long, not printable or there twice.
    #[error("the name of {what} {index} must be its own, 1 to {max} bytes of printable text", max = garment_limits::NAME_BYTES)]
    Name {
        /// `body`, `dimension`, `rule of dimension` or `rule set`.
        what: &'static str,
        /// Its number.
        index: usize,
    },
    /// The parts are not those of the mesh, in its order.
    #[error("part {0} is not that of the mesh")]
    Part(usize),
    /// A measurement is not a plausible number.
    #[error("{} of body {body} is not above 0 and at most {max} m", measurement.name(), max = limits::MEASUREMENT_M)]
    Measurement {
        /// Number of the body.
        body: usize,
        /// Which measurement.
        measurement: Measurement,
    },
    /// A joint is not finite or out of bounds.
    #[error("joint {joint} of body {body} is not within {max} m of the origin", max = garment_limits::EXTENT_M)]
    Joint {
        /// Number of the body.
        body: usize,
        /// Number of the joint.
        joint: usize,
    },
    /// A path has fewer than two vertices, or one that does not exist, or the same one twice in succession.
    #[error("the path of dimension {0} must join two or more unique vertices of the mesh")]
    Path(usize),
    /// Offset or load of a dimension is out of range.
    #[error("offset or load of dimension {0} is out of range")]
    Dimension(usize),
    /// The step of a field is out of range.
    #[error("the step of field {0} is not above 0 and at most {max} m", max = garment_limits::EXTENT_M / 32767.0)]
    Step(usize),
    /// A texture coordinate is not finite or out of bounds.
    #[error("the texture coordinate of vertex {vertex} in size {size} is not within ±{max}", max = garment_limits::UV)]
    Uv {
        /// Number of the size target.
        size: usize,
        /// Number of the vertex.
        vertex: usize,
    },
    /// A rule set cannot be used.
    #[error("rule set {index}: {problem}")]
    Rules {
        /// Its number.
        index: usize,
        /// What is wrong.
        problem: InvalidRules,
    },
}

impl FitData {
    /// How many size targets there are.
    #[must_use]
    pub fn size_count(&self) -> usize {
        self.bodies.len().saturating_sub(1)
    }

    /// Checks everything that fitting the garment relies on.
    ///
    /// # Errors
    /// Names the first element that breaks a rule.
    pub fn check(&self, garment: &Garment) -> Result<(), InvalidFit> {
        check_count("size targets", self.size_count(), 1, limits::SIZES)?;
        self.bodies.iter().enumerate().try_for_each(|(i, body)| check_body(i, body, garment))?;
        check_count("dimensions", self.dimensions.len(), 1, limits::DIMENSIONS)?;
        self.dimensions.iter().enumerate().try_for_each(|(i, dimension)| check_dimension(i, dimension, garment))?;
        let parts = &garment.data().mesh.parts;
        check_length("parts", self.parts.len(), parts.len())?;
        if let Some(part) = self.parts.iter().zip(parts).position(|(name, part)| *name != part.name) {
            return Err(InvalidFit::Part(part));
        }
        let field_count = parts.len() * self.size_count();
        check_count("deltas", field_count.saturating_mul(garment.unique_count()), 0, limits::DELTAS)?;
        check_length("fields", self.fields.len(), field_count)?;
        self.fields.iter().enumerate().try_for_each(|(i, field)| check_field(i, field, garment))?;
        check_length(
            "sizes with texture coordinates",
            self.uv.len(),
            if self.uv.is_empty() { 0 } else { self.size_count() },
        )?;
        for (size, uv) in self.uv.iter().enumerate() {
            check_length("texture coordinates of a size", uv.len(), garment.vertex_count())?;
            let is_bad = |uv: &glam::Vec2| uv.is_nan() || uv.abs().max_element() > garment_limits::UV;
            if let Some(vertex) = uv.iter().position(is_bad) {
                return Err(InvalidFit::Uv { size, vertex });
            }
        }
        check_count("rule sets", self.rules.len(), 0, limits::RULES)?;
        for (index, rules) in self.rules.iter().enumerate() {
            rules.validate().map_err(|problem| InvalidFit::Rules { index, problem })?;
        }
        distinct("body", self.bodies.iter().map(|body| &body.name))?;
        distinct("dimension", self.dimensions.iter().map(|dimension| &dimension.name))?;
        distinct("rule set", self.rules.iter().map(|rules| &rules.name))
    }
}

fn check_body(index: usize, body: &SizeBody, garment: &Garment) -> Result<(), InvalidFit> {
    for measurement in Measurement::ALL {
        let is_plausible = |value_m: f32| value_m > 0.0 && value_m <= limits::MEASUREMENT_M;
        if !body.measurements.get(measurement).is_none_or(is_plausible) {
            return Err(InvalidFit::Measurement { body: index, measurement });
        }
    }
    check_length("joints of a body", body.joints_m.len(), garment.data().skeleton.joints().len())?;
    let is_bad = |place: &Vec3| place.is_nan() || place.abs().max_element() > garment_limits::EXTENT_M;
    match body.joints_m.iter().position(is_bad) {
        Some(joint) => Err(InvalidFit::Joint { body: index, joint }),
        None => Ok(()),
    }
}

fn check_dimension(index: usize, dimension: &Dimension, garment: &Garment) -> Result<(), InvalidFit> {
    let Dimension { ja, rule, vertices, offset_m, load, .. } = dimension;
    if !is_name(rule) || ja.len() > garment_limits::NAME_BYTES {
        return Err(InvalidFit::Name { what: "rule of dimension", index });
    }
    let exist = vertices.iter().all(|&vertex| (vertex as usize) < garment.unique_count());
    if vertices.len() < 2 || !exist || vertices.windows(2).any(|pair| pair[0] == pair[1]) {
        return Err(InvalidFit::Path(index));
    }
    let is_sound = offset_m.abs() <= garment_limits::EXTENT_M && *load > 0.0 && *load <= limits::LOAD;
    if is_sound { Ok(()) } else { Err(InvalidFit::Dimension(index)) }
}

fn check_field(index: usize, field: &Field, garment: &Garment) -> Result<(), InvalidFit> {
    if !(field.step_m > 0.0 && field.step_m <= garment_limits::EXTENT_M / f32::from(i16::MAX)) {
        return Err(InvalidFit::Step(index));
    }
    Ok(check_length("deltas of a field", field.deltas.len(), garment.unique_count())?)
}

fn distinct<'a>(what: &'static str, names: impl Iterator<Item = &'a String>) -> Result<(), InvalidFit> {
    let mut known = std::collections::BTreeSet::new();
    for (index, name) in names.enumerate() {
        if !is_name(name) || !known.insert(name) {
            return Err(InvalidFit::Name { what, index });
        }
    }
    Ok(())
}
