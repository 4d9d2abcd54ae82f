//! How well a fit predicts the sizes of a kimono: each on its own body, and each when it is left out. Knows no files.

use glam::Vec3;
use kitsuke::Garment;
use kitsuke::fit::{Dimension, FitData, FitError, Fitter, Scratch};
use kitsuke::measurement::{Measurement, Measurements};

/// A way to predict the kimono of a body from those of others.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Method {
    /// The runtime's fit.
    Fit,
    /// The kimono of the body whose measurements are nearest.
    Nearest,
    /// Mean of all kimono, weighted by the inverse of the distance in measurement space.
    InverseDistance,
    /// Ridge regression of the shape on the measurements, with the strength that does best on these very bodies.
    Ridge,
}

impl Method {
    /// Every method, ours first.
    pub const ALL: [Method; 4] = [Method::Fit, Method::Nearest, Method::InverseDistance, Method::Ridge];

    /// For tables.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Method::Fit => "fit",
            Method::Nearest => "nearest size",
            Method::InverseDistance => "inverse distance",
            Method::Ridge => "ridge regression",
        }
    }
}

/// How far a prediction lies from what is true or wanted.
#[derive(Clone, Debug, PartialEq)]
pub struct SizeError {
    /// The body.
    pub body: String,
    /// Mean distance of the unique vertices from the size target, millimetres.
    pub mean_mm: f64,
    /// Mean relative error of the dimensions against what the rules want.
    pub of_wanted: f64,
    /// Mean relative error of the dimensions against the size target's own.
    pub of_target: f64,
}

/// What the regression and the distances look at; bodies that lack one of these are compared by the others.
const FEATURES: [Measurement; 5] = [
    Measurement::BodyHeight,
    Measurement::BustGirth,
    Measurement::WaistGirth,
    Measurement::HipGirth,
    Measurement::BackNeckToWrist,
];

/// Strengths that the regression chooses from.
const RIDGES: [f64; 7] = [0.03, 0.1, 0.3, 0.5, 1.0, 2.0, 4.0];

/// Every size fitted to its own body.
///
/// # Errors
/// As [`Fitter::new`] and [`Fitter::fit`].
pub fn on_own_bodies(garment: &Garment, data: &FitData) -> Result<Vec<SizeError>, FitError> {
    let fitter = Fitter::new(garment, data.clone())?;
    (0..data.size_count()).map(|size| fitted(garment, data, &fitter, size)).collect()
}

/// Every size predicted from the others and the base.
///
/// # Errors
/// As [`Fitter::new`] and [`Fitter::fit`].
pub fn left_out(garment: &Garment, data: &FitData, method: Method) -> Result<Vec<SizeError>, FitError> {
    let sizes = 0..data.size_count();
    if method == Method::Fit {
        return sizes.map(|size| fitted(garment, data, &Fitter::new(garment, without(data, size))?, size)).collect();
    }
    // What the rules want does not depend on the sizes that are known.
    let fitter = Fitter::new(garment, data.clone())?;
    let mut best: Option<(f64, Vec<SizeError>)> = None;
    let ridges = if method == Method::Ridge { &RIDGES[..] } else { &[0.0] };
    for &ridge in ridges {
        let mut errors = Vec::new();
        for size in sizes.clone() {
            let weights = match method {
                Method::Ridge => regression(data, size, ridge),
                _ => by_distance(data, size, method == Method::Nearest),
            };
            let mut shape_m = garment.data().mesh.positions_m.clone();
            for (other, weight) in weights.iter().enumerate().skip(1) {
                add(data, other - 1, *weight as f32, &mut shape_m);
            }
            errors.push(compared(garment, data, &fitter, size, &shape_m)?);
        }
        let sum: f64 = errors.iter().map(|error| error.mean_mm).sum();
        if best.as_ref().is_none_or(|(least, _)| sum < *least) {
            best = Some((sum, errors));
        }
    }
    Ok(best.map(|(_, errors)| errors).unwrap_or_default())
}

fn fitted(garment: &Garment, data: &FitData, fitter: &Fitter, size: usize) -> Result<SizeError, FitError> {
    let fit = fitter.fit(&data.bodies[size + 1].measurements, 0, &mut Scratch::default())?;
    let mut shape_m = vec![Vec3::ZERO; garment.unique_count()];
    fitter.shape(&fit, &mut shape_m);
    compared(garment, data, fitter, size, &shape_m)
}

fn compared(
    garment: &Garment,
    data: &FitData,
    fitter: &Fitter,
    size: usize,
    shape_m: &[Vec3],
) -> Result<SizeError, FitError> {
    let body = &data.bodies[size + 1];
    let fit = fitter.fit(&body.measurements, 0, &mut Scratch::default())?;
    let mut true_m = garment.data().mesh.positions_m.clone();
    add(data, size, 1.0, &mut true_m);
    let distances_m = shape_m.iter().zip(&true_m).map(|(a, b)| f64::from(a.distance(*b)));
    let mean_mm = distances_m.sum::<f64>() * 1e3 / shape_m.len() as f64;
    let (mut of_wanted, mut of_target) = (0.0, 0.0);
    for (dimension, reach) in data.dimensions.iter().zip(&fit.dimensions) {
        let length_m = length_m(dimension, shape_m);
        of_wanted += (length_m / f64::from(reach.wanted_m) - 1.0).abs();
        of_target += (length_m / self::length_m(dimension, &true_m) - 1.0).abs();
    }
    let count = data.dimensions.len() as f64;
    Ok(SizeError { body: body.name.clone(), mean_mm, of_wanted: of_wanted / count, of_target: of_target / count })
}

/// The data as if a size had never been made.
fn without(data: &FitData, size: usize) -> FitData {
    let mut data = data.clone();
    let sizes = data.size_count();
    data.bodies.remove(size + 1);
    let mut field = 0..;
    data.fields.retain(|_| field.next().is_none_or(|field| field % sizes != size));
    data.uv.clear();
    data
}

/// Adds a share of what a size moves.
fn add(data: &FitData, size: usize, weight: f32, shape_m: &mut [Vec3]) {
    for field in data.fields.iter().skip(size).step_by(data.size_count()) {
        for (position_m, delta) in shape_m.iter_mut().zip(&field.deltas) {
            *position_m += weight * field.step_m * Vec3::from(delta.map(f32::from));
        }
    }
}

fn length_m(dimension: &Dimension, positions_m: &[Vec3]) -> f64 {
    let edges = dimension.vertices.windows(2);
    let lengths_m = edges.map(|edge| f64::from(positions_m[edge[0] as usize].distance(positions_m[edge[1] as usize])));
    lengths_m.sum::<f64>() + f64::from(dimension.offset_m)
}

/// The features of all bodies, standardised over those that are known: all but the one of `size`.
fn features(data: &FitData, size: usize) -> Vec<Vec<f64>> {
    let known = |body: &Measurements, feature: Measurement| match feature {
        // As the kimono trade estimates it where nobody measured.
        Measurement::BackNeckToWrist => {
            Some(body.get(feature).or(body.get(Measurement::BodyHeight).map(|h| 0.4 * h + 0.02))?)
        }
        _ => body.get(feature),
    };
    let mut rows = vec![Vec::new(); data.bodies.len()];
    for feature in FEATURES {
        let values: Option<Vec<f64>> =
            data.bodies.iter().map(|body| known(&body.measurements, feature).map(f64::from)).collect();
        let Some(values) = values else { continue };
        let others = || values.iter().enumerate().filter(|(body, _)| *body != size + 1).map(|(_, value)| value);
        let count = (values.len() - 1) as f64;
        let mean = others().sum::<f64>() / count;
        let deviation = (others().map(|value| (value - mean) * (value - mean)).sum::<f64>() / count).sqrt();
        rows.iter_mut().zip(&values).for_each(|(row, value)| row.push((value - mean) / deviation.max(1e-9)));
    }
    rows
}

/// Weights of all bodies by distance from the one of `size`, which gets none.
fn by_distance(data: &FitData, size: usize, is_nearest: bool) -> Vec<f64> {
    let rows = features(data, size);
    let square = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| (a - b) * (a - b)).sum::<f64>();
    let near = |body: usize| if body == size + 1 { 0.0 } else { 1.0 / square(&rows[body], &rows[size + 1]).max(1e-12) };
    let mut weights: Vec<f64> = (0..rows.len()).map(near).collect();
    if is_nearest {
        let most = weights.iter().copied().fold(0.0, f64::max);
        weights.iter_mut().for_each(|weight| *weight = f64::from(u8::from(*weight == most)));
    }
    let sum: f64 = weights.iter().sum();
    weights.iter_mut().for_each(|weight| *weight /= sum);
    weights
}

/// Weights of all bodies by ridge regression: what each adds to the prediction for the one of `size`, which adds nothing.
fn regression(data: &FitData, size: usize, ridge: f64) -> Vec<f64> {
    let rows = features(data, size);
    let width = rows[0].len() + 1;
    let row = |body: usize| std::iter::once(1.0).chain(rows[body].iter().copied()).collect::<Vec<f64>>();
    // Normal equations with the wanted body's row on the right, solved by Gauss and Jordan; they are tiny.
    let mut system = vec![vec![0.0; width + 1]; width];
    for body in (0..rows.len()).filter(|body| *body != size + 1) {
        let row = row(body);
        for (line, a) in system.iter_mut().zip(&row) {
            line.iter_mut().zip(&row).for_each(|(entry, b)| *entry += a * b);
        }
    }
    for (i, (line, value)) in system.iter_mut().zip(row(size + 1)).enumerate() {
        line[i] += if i > 0 { ridge } else { 0.0 };
        line[width] = value;
    }
    for pivot in 0..width {
        let line: Vec<f64> = system[pivot].iter().map(|entry| entry / system[pivot][pivot]).collect();
        for (other, eliminated) in system.iter_mut().enumerate() {
            let factor = if other == pivot { 0.0 } else { eliminated[pivot] };
            eliminated.iter_mut().zip(&line).for_each(|(entry, value)| *entry -= factor * value);
        }
        system[pivot] = line;
    }
    let dot = |body: usize| row(body).iter().zip(&system).map(|(a, line)| a * line[width]).sum();
    (0..rows.len()).map(|body| if body == size + 1 { 0.0 } else { dot(body) }).collect()
}
