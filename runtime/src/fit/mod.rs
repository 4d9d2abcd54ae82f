//! Fits a kimono to a wearer (P1): measurements become tailoring dimensions (`tailoring`), dimensions become weights of the size targets, weights become
//! a shape. Knows no files; what it needs of a garment is [`FitData`], plain arrays from the pack.

mod check;
mod dense;
mod fitter;
mod neighbours;
mod paths;
mod range;
mod soften;
mod solve;
mod tailor;
pub mod texture;
mod transfer;

pub use check::{InvalidFit, limits};
pub use fitter::{
    EXTRAPOLATION, FAR_M, Fit, FitError, Fitter, NEAR_M, RIDGE_M, Reach, SAMPLES, Scratch, TOLERANCE, Verdict,
};
pub use tailor::{Fitted, Tailor, TailorError};
pub use transfer::Transfer;

use crate::measurement::Measurements;
use crate::tailoring::RuleSet;
use glam::{Vec2, Vec3};

/// Everything of a garment that fitting needs, as plain arrays.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct FitData {
    /// The bodies for which the kimono exists: row 0 wears the base, row i + 1 the size target i.
    pub bodies: Vec<SizeBody>,
    /// The dimensions that can be measured on the mesh.
    pub dimensions: Vec<Dimension>,
    /// Names of the parts whose sizes are chosen one by one, as in the mesh.
    pub parts: Vec<String>,
    /// Displacement fields, `parts.len()` rows of as many as there are size targets. Over all parts of one size they sum to that
    /// size's shape less the base, so that equal weights give the size target.
    pub fields: Vec<Field>,
    /// Texture coordinates of the size targets, over all vertices, twins included; empty when the garment has none.
    pub uv: Vec<Vec<Vec2>>,
    /// The rule sets with which the garment can be ordered; the first is its own.
    pub rules: Vec<RuleSet>,
}

/// A body for which a size of the kimono was made.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct SizeBody {
    /// For example `b04`.
    pub name: String,
    /// Its measurements.
    pub measurements: Measurements,
    /// T-pose positions of the garment's skeleton's joints on this body, metres.
    pub joints_m: Vec<Vec3>,
}

/// A tailoring dimension as a path along edges of the mesh.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Dimension {
    /// For example `sode_take_left`.
    pub name: String,
    /// For example 袖丈.
    pub ja: String,
    /// The dimension of the rule sets that says how long it should be, for example `sode_take`.
    pub rule: String,
    /// Unique vertices, each joined to the next by an edge.
    pub vertices: Vec<u32>,
    /// Added to the sum of the edge lengths, metres.
    pub offset_m: f32,
    /// λ of the paper: how much an error of this dimension counts; above 0.
    pub load: f32,
}

/// How one part's size moves the whole mesh.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Field {
    /// Metres per unit of `deltas`; above 0.
    pub step_m: f32,
    /// One per unique vertex, in units of `step_m`.
    pub deltas: Vec<[i16; 3]>,
}
