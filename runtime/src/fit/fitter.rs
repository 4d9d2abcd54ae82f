//! From a body to a kimono (P1): wanted dimensions by rules, weights by `solve`, the answer with its ranges and its verdict.

use super::dense::{cholesky, solve_lower};
use super::neighbours::Neighbours;
use super::paths::Paths;
use super::range::extremes_m;
use super::soften::{Solution, Task};
use super::solve::{Memory, Problem};
use super::{Field, FitData, InvalidFit};
use crate::garment::Garment;
use crate::measurement::{Measurement, Measurements};
use crate::tailoring::{NoDimension, RuleSet};
use glam::Vec3;
use pulp::{Arch, Simd, WithSimd};

/// How far a part may be extrapolated: what its negative weights, the base's included, may sum to. 1 reaches as far beyond the sizes as they
/// lie apart.
pub const EXTRAPOLATION: f64 = 1.0;

/// A dimension is reached when it differs from the wanted one by less than this share.
pub const TOLERANCE: f64 = 0.005;

/// A relative error of 1 of one dimension costs as much as moving the whole kimono by this much from what the neighbours wear (root mean
/// square, metres), on the body of a size, whose kimono is known; between here and [`FAR_M`] the squares are mixed by [`Fit::novelty`].
pub const NEAR_M: f64 = 1.0 / 9.0;

/// The same far from all bodies, where little is known.
pub const FAR_M: f64 = 1.0 / 3.0;

/// Nearer to a size's own body than this, by [`Fit::novelty`], its shape is known and needs no further size: about a centimetre of height.
const KNOWN: f64 = 0.05;

/// What a weight of 1 costs beside the movement that it makes, metres; keeps sizes that hardly differ from standing against each other.
pub const RIDGE_M: f64 = 1e-3;

/// How many vertices at most stand for all where movement is measured, evenly from the first on.
pub const SAMPLES: usize = 4096;

/// Fits one kimono to any number of wearers; threads share it.
#[derive(Clone, Debug)]
pub struct Fitter {
    data: FitData,
    /// T-pose positions of the base, metres.
    base_m: Vec<Vec3>,
    neighbours: Neighbours,
    problem: Problem,
    ranges_m: Vec<(f64, f64)>,
    /// For each rule set, where each dimension stands in it and how long it is on the base for a metre by the rules.
    drapes: Vec<Result<Vec<Drape>, FitError>>,
}

#[derive(Clone, Copy, Debug)]
struct Drape {
    rule: usize,
    draped_per_ruled: f64,
}

/// Working memory for fits; no fit depends on what the one before left in it.
#[derive(Clone, Debug, Default)]
pub struct Scratch {
    memory: Memory,
    neighbours: Vec<f64>,
    start: Vec<f64>,
    wanted_m: Vec<f64>,
    near: Solution,
    soft: Solution,
}

/// A fitted kimono.
#[derive(Clone, Debug, PartialEq)]
pub struct Fit {
    /// How much of each size target is in each part: a row per part, a weight per size target; the base has the rest of 1.
    pub weights: Vec<f32>,
    /// How near the wearer is to each body for which the kimono exists; sums to 1, negative where a body stands on the other side.
    pub neighbours: Vec<f32>,
    /// How little those bodies say about this wearer: 0 for one of them, 1 far from all.
    pub novelty: f32,
    /// What became of each dimension.
    pub dimensions: Vec<Reach>,
    /// Whether all are as wanted.
    pub verdict: Verdict,
    /// How far the kimono is from what the neighbours wear, root mean square over the cloth, metres.
    pub moved_m: f32,
    /// What was minimised, for comparison with other solvers: squared relative errors of the dimensions, and stiffness times movement squared.
    pub cost: f64,
    /// What a metre of movement costs, as a relative error: 1 over [`NEAR_M`] to [`FAR_M`], less where a dimension was missed otherwise.
    pub stiffness: f64,
}

/// What became of a dimension, metres along the surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Reach {
    /// By the rules, times what the drape makes of the rules' value on the base.
    pub wanted_m: f32,
    /// On the fitted kimono.
    pub reached_m: f32,
    /// The shortest that the sizes can give, the same for all wearers.
    pub lowest_m: f32,
    /// The longest.
    pub highest_m: f32,
}

impl Reach {
    /// Reached over wanted, less 1.
    #[must_use]
    pub fn error(&self) -> f32 {
        self.reached_m / self.wanted_m - 1.0
    }
}

/// Whether the sizes can give what is wanted.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Verdict {
    /// Every dimension is within [`TOLERANCE`], near what the neighbours wear.
    Reachable,
    /// Every dimension is within [`TOLERANCE`], but only with sizes mixed otherwise than such bodies wear them: a shape that no target vouches
    /// for, [`Fit::moved_m`] away.
    Strayed,
    /// A size was made for such a body, and a dimension of it is not what is wanted. The size stays as it is.
    SizeDiffers {
        /// The dimension, by its number in [`FitData::dimensions`].
        dimension: usize,
        /// Whose size it is, by its number in [`FitData::bodies`].
        body: usize,
    },
    /// No weights within the bounds give all dimensions; the kimono is near what the neighbours wear.
    OutOfReach {
        /// The one that stays farthest from what is wanted, by its number in [`FitData::dimensions`].
        dimension: usize,
        /// How long it is where all dimensions come as near as they can, metres.
        nearest_m: f32,
    },
}

/// Why a kimono cannot be fitted.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum FitError {
    /// The data do not fit the garment or themselves.
    #[error(transparent)]
    Data(#[from] InvalidFit),
    /// A wearer, or the body of the base, is not known well enough for the rules.
    #[error(transparent)]
    Rules(#[from] NoDimension),
    /// The rules do not say how long a dimension is.
    #[error("the rule set {rules:?} has no {rule:?}, which {dimension} follows")]
    NoRule {
        /// The rule set.
        rules: String,
        /// What it lacks.
        rule: String,
        /// Which dimension follows it.
        dimension: String,
    },
    /// There is no such rule set.
    #[error(
        "there is no rule set {index}, the kimono was built with {count} of them; name some in garment.toml (rules)"
    )]
    NoRules {
        /// The rule set that was asked for, from 0.
        index: usize,
        /// How many there are.
        count: usize,
    },
    /// A dimension that is not a length of cloth.
    #[error("{dimension} would be {length_m} m long; a dimension is between 1 mm and 10 m")]
    Length {
        /// The dimension.
        dimension: String,
        /// What it would be, metres.
        length_m: f64,
    },
    /// There are too many weights to be found.
    #[error("{parts} parts and {sizes} size targets need more than {WEIGHTS} weights")]
    Count {
        /// Parts.
        parts: usize,
        /// Size targets.
        sizes: usize,
    },
}

/// Most weights of a fit.
const WEIGHTS: usize = 512;

impl Fitter {
    /// Prepares to fit the garment: everything that does not depend on the wearer is computed here.
    ///
    /// # Errors
    /// The first thing that is wrong with the data.
    pub fn new(garment: &Garment, data: FitData) -> Result<Fitter, FitError> {
        data.check(garment)?;
        let (parts, sizes) = (data.parts.len(), data.size_count());
        let weights = parts * sizes;
        if weights > WEIGHTS {
            return Err(FitError::Count { parts, sizes });
        }
        let base_m = garment.data().mesh.positions_m.clone();
        let bodies: Vec<Measurements> = data.bodies.iter().map(|body| body.measurements).collect();
        let mut paths = paths(&data, &base_m);
        let ranges_m = (0..paths.count()).map(|path| extremes_m(&paths, path, sizes, EXTRAPOLATION)).collect();
        let mut factor = movement_m2(&data.fields);
        assert!(cholesky(&mut factor, weights), "a sum of squares and a ridge");
        paths.transform(|row| solve_lower(&factor, weights, row));
        let draped_m = base_lengths_m(&paths);
        let drapes = data.rules.iter().map(|rules| drapes(&data, rules, &draped_m)).collect();
        let loads = data.dimensions.iter().map(|dimension| f64::from(dimension.load)).collect();
        let problem = Problem { paths, factor, sizes, extrapolation: EXTRAPOLATION, loads };
        Ok(Fitter { neighbours: Neighbours::new(&bodies), problem, ranges_m, drapes, base_m, data })
    }

    /// What the fitter was made of.
    #[must_use]
    pub fn data(&self) -> &FitData {
        &self.data
    }

    /// Fits the kimono to a wearer by one of the garment's rule sets (an index in [`FitData::rules`]; 0 is its own).
    ///
    /// # Errors
    /// When there is no such rule set, when it needs a measurement that is not known, or does not say what the garment's dimensions need.
    pub fn fit(&self, wearer: &Measurements, rules: usize, scratch: &mut Scratch) -> Result<Fit, FitError> {
        let no_rules = FitError::NoRules { index: rules, count: self.drapes.len() };
        let drapes = self.drapes.get(rules).ok_or(no_rules)?.as_ref().map_err(FitError::clone)?;
        let ruled_m = self.data.rules[rules].dimensions(wearer)?.0;
        scratch.wanted_m.clear();
        for (drape, dimension) in drapes.iter().zip(&self.data.dimensions) {
            let length_m = f64::from(ruled_m[drape.rule]) * drape.draped_per_ruled;
            scratch.wanted_m.push(plausible_m(&dimension.name, length_m)?);
        }
        let Scratch { memory, neighbours, start, wanted_m, near, soft } = scratch;
        neighbours.resize(self.problem.sizes + 1, 0.0);
        let novelty = self.neighbours.weights(wearer, neighbours);
        start.clear();
        self.data.parts.iter().for_each(|_| start.extend_from_slice(&neighbours[1..]));
        let stiffness = 1.0 / (NEAR_M * NEAR_M + novelty * (FAR_M * FAR_M - NEAR_M * NEAR_M)).sqrt();
        near.weights.clone_from(start);
        let task = Task { problem: &self.problem, start, wanted_m, tolerance: TOLERANCE };
        task.solve(stiffness, near, memory);
        let (solution, verdict) = match task.worst(near) {
            (error, _) if error <= TOLERANCE => (near, Verdict::Reachable),
            (_, dimension) if novelty < KNOWN => (near, Verdict::SizeDiffers { dimension, body: greatest(neighbours) }),
            _ => {
                task.soften(near, soft, memory);
                match task.worst(soft) {
                    // What cannot be had is no reason to leave what such bodies wear.
                    (error, dimension) if error > TOLERANCE => {
                        (near, Verdict::OutOfReach { dimension, nearest_m: soft.lengths_m[dimension] as f32 })
                    }
                    _ => (soft, Verdict::Strayed),
                }
            }
        };
        let reach = |((&wanted_m, &reached_m), &(lowest_m, highest_m)): ((&f64, &f64), &(f64, f64))| Reach {
            wanted_m: wanted_m as f32,
            reached_m: reached_m as f32,
            lowest_m: lowest_m as f32,
            highest_m: highest_m as f32,
        };
        Ok(Fit {
            weights: solution.weights.iter().map(|&weight| weight as f32).collect(),
            neighbours: neighbours.iter().map(|&weight| weight as f32).collect(),
            novelty: novelty as f32,
            dimensions: wanted_m.iter().zip(&solution.lengths_m).zip(&self.ranges_m).map(reach).collect(),
            verdict,
            moved_m: solution.moved_m as f32,
            cost: solution.cost,
            stiffness: solution.stiffness,
        })
    }

    /// The verdict in words: how far the kimono strays, or which dimension is out of reach and which size target would help.
    #[must_use]
    pub fn explain(&self, fit: &Fit, wearer: &Measurements) -> String {
        let name = |dimension: usize| &self.data.dimensions[dimension].name;
        match fit.verdict {
            Verdict::Reachable => "reachable".to_owned(),
            Verdict::Strayed => {
                let moved_mm = 1e3 * fit.moved_m;
                format!("reachable only by moving {moved_mm:.0} mm away from what neighbouring sizes wear")
            }
            Verdict::SizeDiffers { dimension, body } => {
                let (name, size) = (name(dimension), &self.data.bodies[body].name);
                let percent = 100.0 * fit.dimensions[dimension].error();
                format!(
                    "{name} of size {size}, which was made for such a body, differs by {percent:+.1} % from what is wanted; \
                     check the rules or drape {size} anew"
                )
            }
            Verdict::OutOfReach { dimension, nearest_m } => {
                let side = if fit.dimensions[dimension].wanted_m > nearest_m { "above" } else { "below" };
                let (name, nearest_cm) = (name(dimension), 100.0 * nearest_m);
                let body = measured(wearer);
                format!("{name} {side} {nearest_cm:.1} cm is out of reach; add a size target of about {body} cm")
            }
        }
    }

    /// Writes the fitted kimono in the T-pose: the unique vertices, metres.
    ///
    /// # Panics
    /// When there is not one position per unique vertex, or the fit is one of another garment.
    pub fn shape(&self, fit: &Fit, positions_m: &mut [Vec3]) {
        assert_eq!(positions_m.len(), self.base_m.len(), "one position per unique vertex");
        assert_eq!(fit.weights.len(), self.data.fields.len(), "a weight per field");
        let base_m = bytemuck::cast_slice(&self.base_m);
        let positions_m = bytemuck::cast_slice_mut(positions_m);
        Arch::new().dispatch(Shape { base_m, fields: &self.data.fields, weights: &fit.weights, positions_m });
    }
}

/// Where the greatest value stands.
fn greatest(values: &[f64]) -> usize {
    (0..values.len()).max_by(|&a, &b| values[a].total_cmp(&values[b])).unwrap_or(0)
}

/// What tells one body from another, in cm, as far as it is known.
fn measured(wearer: &Measurements) -> String {
    let known = [("height", Measurement::BodyHeight), ("bust", Measurement::BustGirth), ("hip", Measurement::HipGirth)];
    let known = known.iter().filter_map(|&(name, of)| Some(format!("{name} {:.0}", 100.0 * wearer.get(of)?)));
    known.collect::<Vec<_>>().join(", ")
}

/// The base plus fields times weights, coordinate by coordinate. Compiled for several sets of vector instructions, all of which give the same
/// bits.
struct Shape<'a> {
    base_m: &'a [f32],
    fields: &'a [Field],
    weights: &'a [f32],
    positions_m: &'a mut [f32],
}

/// Coordinates whose sums stay in the first-level cache.
const BLOCK: usize = 3 * 512;

impl WithSimd for Shape<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        let Shape { base_m, fields, weights, positions_m } = self;
        for (block, (sums_m, base_m)) in positions_m.chunks_mut(BLOCK).zip(base_m.chunks(BLOCK)).enumerate() {
            sums_m.copy_from_slice(base_m);
            let mut terms = fields.iter().zip(weights).filter(|(_, weight)| **weight != 0.0).map(|(field, weight)| {
                (weight * field.step_m, &field.deltas.as_flattened()[BLOCK * block..][..base_m.len()])
            });
            // Four at a time, so that the sums are loaded and stored once for the four; what is missing to four counts 0.
            while let Some(first) = terms.next() {
                let mut next = || terms.next().unwrap_or((0.0, first.1));
                add_four(sums_m, [first, next(), next(), next()]);
            }
        }
    }
}

#[inline(always)]
fn add_four(sums_m: &mut [f32], [a, b, c, d]: [(f32, &[i16]); 4]) {
    let deltas = a.1.iter().zip(b.1).zip(c.1.iter().zip(d.1));
    for (sum_m, ((&of_a, &of_b), (&of_c, &of_d))) in sums_m.iter_mut().zip(deltas) {
        let [of_a, of_b, of_c, of_d] = [of_a, of_b, of_c, of_d].map(f32::from);
        *sum_m += (a.0 * of_a + b.0 * of_b) + (c.0 * of_c + d.0 * of_d);
    }
}

/// The dimensions' paths over the weights.
fn paths(data: &FitData, base_m: &[Vec3]) -> Paths {
    let mut paths = Paths::new(data.fields.len());
    for dimension in &data.dimensions {
        for pair in dimension.vertices.windows(2) {
            let [from, to] = [pair[0], pair[1]].map(|vertex| vertex as usize);
            let mut changes = Vec::with_capacity(3 * data.fields.len());
            for axis in 0..3 {
                let along = |field: &Field| {
                    f64::from(field.step_m) * (f64::from(field.deltas[to][axis]) - f64::from(field.deltas[from][axis]))
                };
                changes.extend(data.fields.iter().map(along));
            }
            let [from_m, to_m] = [from, to].map(|vertex| base_m[vertex].as_dvec3());
            paths.push_edge((to_m - from_m).to_array(), &changes);
        }
        paths.end_path(f64::from(dimension.offset_m));
    }
    paths
}

/// How the base's paths are draped, metres.
fn base_lengths_m(paths: &Paths) -> Vec<f64> {
    let still = vec![0.0; paths.unknowns()];
    (0..paths.count()).map(|path| paths.length(path, &still, &mut still.clone())).collect()
}

/// The mean square of the movement that any weights make, m²: a symmetric matrix over the fields. Sums of whole numbers, so exact.
fn movement_m2(fields: &[Field]) -> Vec<f64> {
    let count = fields.len();
    let stride = fields[0].deltas.len().div_ceil(SAMPLES).max(1);
    let samples: Vec<Vec<i32>> = fields
        .iter()
        .map(|field| field.deltas.iter().step_by(stride).flatten().map(|&delta| i32::from(delta)).collect())
        .collect();
    let vertices = (samples[0].len() / 3).max(1) as f64;
    let mut movement_m2 = vec![0.0; count * count];
    for i in 0..count {
        for j in 0..=i {
            let product: i64 = samples[i].iter().zip(&samples[j]).map(|(a, b)| i64::from(a * b)).sum();
            let steps_m2 = f64::from(fields[i].step_m) * f64::from(fields[j].step_m);
            movement_m2[i * count + j] = product as f64 * steps_m2 / vertices;
        }
        movement_m2[i * count + i] += RIDGE_M * RIDGE_M;
    }
    movement_m2
}

/// What the rules mean for the base, dimension by dimension.
fn drapes(data: &FitData, rules: &RuleSet, draped_m: &[f64]) -> Result<Vec<Drape>, FitError> {
    let ruled_m = rules.dimensions(&data.bodies[0].measurements)?.0;
    let of = |(dimension, &draped_m): (&super::Dimension, &f64)| {
        let rule = rules.index_of(&dimension.rule).ok_or_else(|| FitError::NoRule {
            rules: rules.name.clone(),
            rule: dimension.rule.clone(),
            dimension: dimension.name.clone(),
        })?;
        let ruled_m = plausible_m(&dimension.name, f64::from(ruled_m[rule]))?;
        Ok(Drape { rule, draped_per_ruled: plausible_m(&dimension.name, draped_m)? / ruled_m })
    };
    data.dimensions.iter().zip(draped_m).map(of).collect()
}

fn plausible_m(dimension: &str, length_m: f64) -> Result<f64, FitError> {
    if (1e-3..=10.0).contains(&length_m) {
        Ok(length_m)
    } else {
        Err(FitError::Length { dimension: dimension.to_owned(), length_m })
    }
}
