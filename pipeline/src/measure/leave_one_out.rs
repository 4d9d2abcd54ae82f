//! How well kernels predict a shape that they have not seen: each row of the pose table in turn is left out, nothing
//! else, and the frame in its pose is compared with its target; or all rows stay, and shapes are given that none of them knows. Knows
//! the run time's garment, no source file.

use crate::stages::StageError;
use crate::stages::correctives::without_correctives;
use crate::stages::kernel;
use crate::stages::mirror::{Shapes, shapes};
use glam::{DQuat, DVec3, Vec3};
use kitsuke::arrays::{GarmentData, Group, InvalidGarment, Rbf, RbfLayer};
use kitsuke::pose_blend::{Kernel, rbf};
use kitsuke::skeleton::{Bone, Pose};
use kitsuke::{Frame, Garment, Rates, Scratch, evaluate_with_rates};
use rayon::prelude::*;

/// How far a predicted target lies from the true one, over all vertices, millimetres.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Error {
    /// The target that was left out.
    pub target: String,
    /// Mean.
    pub mean_mm: f64,
    /// 95th percentile.
    pub p95_mm: f64,
    /// 99th percentile.
    pub p99_mm: f64,
    /// Largest.
    pub max_mm: f64,
}

/// A way to blend the samples that are left.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Method {
    /// The garment's own default kernel, its coefficients solved anew without the row.
    Default,
    /// Moving least squares that interpolate, linear, in the default kernel's space (Lancaster and Salkauskas 1981).
    MovingLeastSquares,
    /// Shepard's method with local linear fits, in the default kernel's space (Franke and Nielson 1980).
    ModifiedShepard,
    /// The sample whose pose is nearest, over all joints.
    Nearest,
    /// The skinned base.
    Skinning,
    /// All samples by inverse squared pose difference over all joints (Shepard 1968).
    InverseDistance,
    /// The paper's kernel, driver by driver.
    Paper,
    /// Radial basis functions -r on the angles of one arm.
    LinearRbf,
    /// Thin-plate splines r² log r with a linear term on the rotation vectors of one arm.
    ThinPlate,
    /// Kriging of one arm with a constant mean: Matérn 3/2 of width 1.5 on rotation vectors from the trunk, those of the lower arm counting 0.7
    /// (Matheron 1963; Rasmussen and Williams 2006, equation 4.17).
    Matern,
}

impl Method {
    /// All, in the order of the table.
    pub const ALL: [Method; 10] = [
        Method::Default,
        Method::MovingLeastSquares,
        Method::ModifiedShepard,
        Method::Nearest,
        Method::Skinning,
        Method::InverseDistance,
        Method::Paper,
        Method::LinearRbf,
        Method::ThinPlate,
        Method::Matern,
    ];

    /// For the table.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Method::Default => "default kernel",
            Method::MovingLeastSquares => "moving least squares",
            Method::ModifiedShepard => "modified Shepard",
            Method::Nearest => "nearest target",
            Method::Skinning => "skinning only",
            Method::InverseDistance => "inverse distance",
            Method::Paper => "paper",
            Method::LinearRbf => "linear RBF per arm",
            Method::ThinPlate => "thin-plate RBF per arm",
            Method::Matern => "Matern 3/2 per arm",
        }
    }
}

/// The errors of a method, target by target. Correctives are left out: they know the sample that should not be known.
///
/// # Errors
/// When the default kernel cannot be solved without one of the rows.
pub fn errors(garment: &Garment, method: Method) -> Result<Vec<Error>, StageError> {
    let garment = &Garment::new(without_correctives(garment.data())).map_err(invalid)?;
    let data = garment.data();
    let of_layer = |(number, layer): (usize, &RbfLayer)| shapes(data, number, &kernel::limbs_and_scales(layer).0);
    // The other methods know the samples' poses alone.
    let shapes: Option<Vec<Vec<Shapes>>> =
        (method == Method::Default).then(|| layers(data).iter().enumerate().map(of_layer).collect());
    let error = |left_out| error_of(garment, shapes.as_deref(), method, left_out);
    (0..data.targets.len()).into_par_iter().map(error).collect()
}

fn invalid(error: InvalidGarment) -> StageError {
    StageError::new("leave-one-out", error.to_string())
}

/// The layers of the default kernel.
fn layers(data: &GarmentData) -> &[RbfLayer] {
    data.rbf.as_ref().map_or(&[], |rbf| &rbf.layers)
}

/// `shapes` are those of the default kernel, where it is the method.
fn error_of(
    garment: &Garment,
    shapes: Option<&[Vec<Shapes>]>,
    method: Method,
    left_out: usize,
) -> Result<Error, StageError> {
    let data = garment.data();
    let pose = data.poses.pose(left_out + 1);
    let rest = without(data, shapes, left_out)?;
    let mut rates = Rates::new(rest.data());
    predict(&rest, layers(data), method, &pose, &mut rates);
    let predicted_m = positions(&rest, &pose, &rates);
    let mut alone = Rates::new(garment.data());
    (0..data.drivers.len()).for_each(|driver| alone.set(driver, left_out, 1.0));
    let true_m = positions(garment, &pose, &alone);

    let unique = garment.unique_count();
    Ok(apart(data.targets[left_out].name.clone(), &predicted_m[..unique], &true_m[..unique]))
}

/// A shape that no sample knows.
#[derive(Clone, Debug)]
pub struct Unseen {
    /// For the table.
    pub name: String,
    /// Its pose.
    pub pose: Pose,
    /// Its unique vertices in the garment's order, posed, metres.
    pub positions_m: Vec<Vec3>,
}

/// The errors of a method that knows all samples, shape by shape. Correctives are left out, as in [`errors`].
///
/// # Errors
/// When the garment is none without its correctives, which a checked one is.
pub fn unseen_errors(garment: &Garment, method: Method, shapes: &[Unseen]) -> Result<Vec<Error>, StageError> {
    let garment = Garment::new(without_correctives(garment.data())).map_err(invalid)?;
    let error = |shape: &Unseen| {
        let mut rates = Rates::new(garment.data());
        predict(&garment, layers(garment.data()), method, &shape.pose.with_arms_untwisted(), &mut rates);
        let predicted_m = positions(&garment, &shape.pose, &rates);
        apart(shape.name.clone(), &predicted_m[..garment.unique_count()], &shape.positions_m)
    };
    Ok(shapes.par_iter().map(error).collect())
}

fn apart(target: String, predicted_m: &[Vec3], true_m: &[Vec3]) -> Error {
    let mut errors: Vec<f64> = predicted_m.iter().zip(true_m).map(|(a, b)| f64::from(a.distance(*b)) * 1e3).collect();
    errors.sort_by(f64::total_cmp);
    let at = |percent: usize| errors[(errors.len() * percent / 100).min(errors.len() - 1)];
    Error {
        target,
        mean_mm: errors.iter().sum::<f64>() / errors.len() as f64,
        p95_mm: at(95),
        p99_mm: at(99),
        max_mm: at(100),
    }
}

fn positions(garment: &Garment, pose: &Pose, rates: &Rates) -> Vec<Vec3> {
    let mut positions_m = vec![Vec3::ZERO; garment.vertex_count()];
    let mut normals = positions_m.clone();
    let frame = Frame { positions_m: &mut positions_m, normals: &mut normals };
    evaluate_with_rates(garment, pose, rates, &mut Scratch::new(garment), frame);
    positions_m
}

/// The garment without one target and its row, with the default kernel where its shapes are given; that keeps its scales.
fn without(data: &GarmentData, shapes: Option<&[Vec<Shapes>]>, target: usize) -> Result<Garment, StageError> {
    let mut rest = data.clone();
    rest.targets.remove(target);
    let bones = rest.poses.bones.len();
    rest.poses.rotations.drain((target + 1) * bones..(target + 2) * bones);
    (rest.rbf, rest.certificate, rest.compression) = (None, None, None);
    if let (Some(rbf), Some(shapes)) = (&data.rbf, shapes) {
        let layer = |(number, layer): (usize, &RbfLayer)| {
            let (limbs, scales) = kernel::limbs_and_scales(layer);
            let place = rbf::rows_of_layer(data, number).iter().position(|&row| row == target + 1);
            let without = |shapes: &Shapes| place.map_or_else(|| shapes.clone(), |place| shapes.without(place));
            let shapes: Vec<Shapes> = shapes[number].iter().map(without).collect();
            kernel::interpolate(&rest, number, &limbs, &shapes, &scales)
        };
        rest.rbf = Some(Rbf { layers: rbf.layers.iter().enumerate().map(layer).collect::<Result<_, _>>()? });
    }
    Garment::new(rest).map_err(invalid)
}

/// The rates of a method in a pose, layer by layer; limbs and scales are those of the default kernel's `layers`.
fn predict(garment: &Garment, layers: &[RbfLayer], method: Method, pose: &Pose, rates: &mut Rates) {
    match method {
        Method::Default => return garment.blend_rates(garment.kernel(), pose, rates),
        Method::Paper => return garment.blend_rates(Kernel::Paper, pose, rates),
        Method::Skinning => return,
        _ => {}
    }
    let data = garment.data();
    for (number, layer) in layers.iter().enumerate() {
        // Ways that are not exact would move a layer that rests; that is not what is compared.
        if layer.groups.iter().flat_map(bones).all(|bone| is_rest(rotation(pose, bone))) {
            continue;
        }
        let rows = rbf::rows_of_layer(data, number);
        let samples: Vec<Pose> = rows.iter().map(|&row| data.poses.pose(row)).collect();
        let mut set = |drivers: &[u8], weights: &[f64]| {
            for &driver in drivers {
                // The first weight is the base's, whose delta is nothing.
                let weighted = rows.iter().zip(weights).skip(1);
                weighted.for_each(|(&row, &weight)| rates.set(usize::from(driver), row - 1, weight as f32));
            }
        };
        let all: Vec<u8> = layer.groups.iter().flat_map(|group| group.drivers.iter().copied()).collect();
        let joints: Vec<Bone> = layer.groups.iter().flat_map(bones).collect();
        match method {
            Method::Nearest => {
                let differences = differences_rad(&joints, &samples, pose);
                let nearest =
                    (0..samples.len()).min_by(|&a, &b| differences[a].total_cmp(&differences[b])).unwrap_or(0);
                let weights: Vec<f64> = (0..samples.len()).map(|row| f64::from(u8::from(row == nearest))).collect();
                set(&all, &weights);
            }
            Method::InverseDistance => {
                let differences = differences_rad(&joints, &samples, pose);
                let near: Vec<f64> = differences.iter().map(|d| 1.0 / (d * d).max(1e-8)).collect();
                let sum: f64 = near.iter().sum();
                set(&all, &near.iter().map(|near| near / sum).collect::<Vec<_>>());
            }
            _ => {
                for group in &layer.groups {
                    let weights = match method {
                        Method::LinearRbf => linear_rbf(&bones(group), &samples, pose),
                        Method::ThinPlate => thin_plate(&bones(group), &samples, pose),
                        Method::Matern => matern(group, &samples, pose),
                        Method::MovingLeastSquares => {
                            let (embedded, at) = embedded(group, &samples, pose);
                            moving_least_squares(&embedded, &at)
                        }
                        _ => {
                            let (embedded, at) = embedded(group, &samples, pose);
                            modified_shepard(&embedded, &at)
                        }
                    };
                    set(&group.drivers, &weights);
                }
            }
        }
    }
}

fn bones(group: &Group) -> Vec<Bone> {
    group.chain.iter().map(|joint| joint.bone).collect()
}

fn is_rest(rotation: DQuat) -> bool {
    rotation.xyz().length() < 1e-6
}

fn rotation(pose: &Pose, bone: Bone) -> DQuat {
    pose.rotation(bone).as_dquat().normalize()
}

/// Root of the summed squared angles, per sample.
fn differences_rad(bones: &[Bone], samples: &[Pose], pose: &Pose) -> Vec<f64> {
    let angle = |a: DQuat, b: DQuat| {
        let between = a.conjugate() * b;
        2.0 * libm::atan2(between.xyz().length(), between.w.abs())
    };
    let difference = |sample: &Pose| {
        let squares = bones.iter().map(|&bone| angle(rotation(pose, bone), rotation(sample, bone)).powi(2));
        squares.sum::<f64>().sqrt()
    };
    samples.iter().map(difference).collect()
}

fn linear_rbf(bones: &[Bone], samples: &[Pose], pose: &Pose) -> Vec<f64> {
    let rows: Vec<Vec<f64>> = samples.iter().map(|sample| differences_rad(bones, samples, sample)).collect();
    // A small ridge: samples that share the arm's pose make equal rows.
    let at = |i: usize, j: usize| -rows[i][j] - if i == j { 1e-3 } else { 0.0 };
    let wanted: Vec<f64> = differences_rad(bones, samples, pose).iter().map(|r| -r).collect();
    solve(samples.len(), at, &wanted)
}

/// Weights of kriging. Joints are taken from the trunk on: each rotation follows the joint that carries it.
fn matern(group: &Group, samples: &[Pose], pose: &Pose) -> Vec<f64> {
    const WIDTH: f64 = 1.5;
    const NOISE: f64 = 0.01;
    let features = |pose: &Pose| -> Vec<f64> {
        let mut turned: Vec<(DQuat, usize)> = Vec::new();
        let mut features = Vec::new();
        for joint in &group.chain {
            let (before, depth) = joint.parent.map_or((DQuat::IDENTITY, 0), |parent| turned[usize::from(parent)]);
            let rotation = before * rotation(pose, joint.bone);
            // The shoulder only carries the arm.
            let is_limb = !matches!(joint.bone, Bone::LeftShoulder | Bone::RightShoulder);
            turned.push((rotation, depth + usize::from(is_limb)));
            let share = [1.0, 0.7][depth.min(1)];
            if is_limb {
                features.extend((rotation_vector(rotation) * share).to_array());
            }
        }
        features
    };
    let places: Vec<Vec<f64>> = samples.iter().map(features).collect();
    let here = features(pose);
    let near = |a: &[f64], b: &[f64]| {
        let r = (3.0 * rbf::squared_distance(a, b)).sqrt() / WIDTH;
        (1.0 + r) * libm::exp(-r)
    };
    let n = samples.len();
    let at = |i: usize, j: usize| match (i < n, j < n) {
        (true, true) => near(&places[i], &places[j]) + if i == j { NOISE } else { 0.0 },
        (false, false) => 0.0,
        _ => 1.0,
    };
    let wanted: Vec<f64> = (0..=n).map(|i| if i < n { near(&places[i], &here) } else { 1.0 }).collect();
    let mut weights = solve(n + 1, at, &wanted);
    weights.truncate(n);
    weights
}

/// Axis times angle, at most half a turn; radians.
fn rotation_vector(rotation: DQuat) -> DVec3 {
    let rotation = if rotation.w < 0.0 { -rotation } else { rotation };
    let sine = rotation.xyz().length();
    if sine > 1e-12 { rotation.xyz() * (2.0 * libm::atan2(sine, rotation.w) / sine) } else { DVec3::ZERO }
}

fn thin_plate(bones: &[Bone], samples: &[Pose], pose: &Pose) -> Vec<f64> {
    let vector = |pose: &Pose| -> Vec<f64> {
        bones.iter().flat_map(|&bone| rotation_vector(rotation(pose, bone)).to_array()).collect()
    };
    let vectors: Vec<Vec<f64>> = samples.iter().map(vector).collect();
    let here = vector(pose);
    let phi = |a: &[f64], b: &[f64]| {
        let squared = rbf::squared_distance(a, b);
        if squared > 0.0 { 0.5 * squared * libm::log(squared) } else { 0.0 }
    };
    let (n, m) = (samples.len(), here.len() + 1);
    let linear = |x: &[f64], k: usize| if k == 0 { 1.0 } else { x[k - 1] };
    let at = |i: usize, j: usize| match (i < n, j < n) {
        (true, true) => phi(&vectors[i], &vectors[j]) + if i == j { 1e-3 } else { 0.0 },
        (true, false) => linear(&vectors[i], j - n),
        (false, true) => linear(&vectors[j], i - n),
        // Directions in which no sample lies are left alone.
        (false, false) => {
            if i == j {
                -1e-6
            } else {
                0.0
            }
        }
    };
    let wanted: Vec<f64> =
        (0..n + m).map(|i| if i < n { phi(&vectors[i], &here) } else { linear(&here, i - n) }).collect();
    let mut weights = solve(n + m, at, &wanted);
    weights.truncate(n);
    weights
}

fn embedded(group: &Group, samples: &[Pose], pose: &Pose) -> (Vec<Vec<f64>>, Vec<f64>) {
    let embed = |pose: &Pose| {
        let mut embedding = vec![0.0; rbf::embedding_length(&group.chain)];
        rbf::embed(&group.chain, |bone| rotation(pose, bone), &mut embedding);
        embedding
    };
    (samples.iter().map(embed).collect(), embed(pose))
}

/// Weights 1/d² with a Gaussian fall-off, ridge on the slopes.
fn moving_least_squares(samples: &[Vec<f64>], at: &[f64]) -> Vec<f64> {
    let near: Vec<f64> = samples
        .iter()
        .map(|sample| {
            let squared = rbf::squared_distance(sample, at);
            libm::exp(-squared) / (squared + 1e-9)
        })
        .collect();
    let total: f64 = near.iter().sum();
    let column = |row: usize, k: usize| if k == 0 { 1.0 } else { samples[row][k - 1] - at[k - 1] };
    let m = at.len() + 1;
    let normal = |i: usize, j: usize| {
        let sum: f64 = (0..samples.len()).map(|row| near[row] * column(row, i) * column(row, j)).sum();
        sum + if i == j { (1e-9 + if i > 0 { 2e-3 } else { 0.0 }) * total } else { 0.0 }
    };
    let first: Vec<f64> = (0..m).map(|k| if k == 0 { 1.0 } else { 0.0 }).collect();
    let solution = solve(m, normal, &first);
    (0..samples.len()).map(|row| near[row] * (0..m).map(|k| column(row, k) * solution[k]).sum::<f64>()).collect()
}

/// Local linear fits through each sample, blended by ((R - d) / (R d))².
fn modified_shepard(samples: &[Vec<f64>], at: &[f64]) -> Vec<f64> {
    let n = samples.len();
    let m = at.len();
    let distances: Vec<f64> = samples.iter().map(|sample| rbf::squared_distance(sample, at).sqrt()).collect();
    // As far as the sixth nearest sample.
    let mut sorted = distances.clone();
    sorted.sort_by(f64::total_cmp);
    let radius = sorted[n.min(6) - 1] * 1.5 + 1e-9;
    let near: Vec<f64> = distances.iter().map(|d| ((radius - d).max(0.0) / (radius * d.max(1e-6))).powi(2)).collect();
    let total: f64 = near.iter().sum();
    let mut weights = vec![0.0; n];
    for (i, near) in near.iter().enumerate().filter(|(_, near)| **near > 0.0) {
        let share = near / total;
        let fall: Vec<f64> =
            samples.iter().map(|sample| libm::exp(-rbf::squared_distance(sample, &samples[i]) / 2.25)).collect();
        let sum: f64 = fall.iter().sum();
        let apart = |row: usize, k: usize| samples[row][k] - samples[i][k];
        let normal = |a: usize, b: usize| {
            let sum_ab: f64 = (0..n).map(|row| fall[row] * apart(row, a) * apart(row, b)).sum();
            sum_ab + if a == b { 3e-3 * sum } else { 0.0 }
        };
        let step: Vec<f64> = (0..m).map(|k| at[k] - samples[i][k]).collect();
        let slope = solve(m, normal, &step);
        for row in 0..n {
            let weight = fall[row] * (0..m).map(|k| apart(row, k) * slope[k]).sum::<f64>();
            weights[row] += share * weight;
            weights[i] -= share * weight;
        }
        weights[i] += share;
    }
    weights
}

/// The solution of a small dense system by elimination with pivoting; what has no pivot gets 0.
fn solve(n: usize, at: impl Fn(usize, usize) -> f64, wanted: &[f64]) -> Vec<f64> {
    let mut rows: Vec<Vec<f64>> = (0..n).map(|i| (0..n).map(|j| at(i, j)).chain([wanted[i]]).collect()).collect();
    for k in 0..n {
        let pivot = (k..n).max_by(|&a, &b| rows[a][k].abs().total_cmp(&rows[b][k].abs())).unwrap_or(k);
        rows.swap(k, pivot);
        if rows[k][k].abs() < 1e-14 {
            continue;
        }
        let (above, below) = rows.split_at_mut(k + 1);
        for row in below {
            let factor = row[k] / above[k][k];
            row[k..].iter_mut().zip(&above[k][k..]).for_each(|(a, b)| *a -= factor * b);
        }
    }
    let mut x = vec![0.0; n];
    for k in (0..n).rev() {
        let known: f64 = (k + 1..n).map(|j| rows[k][j] * x[j]).sum();
        x[k] = if rows[k][k].abs() < 1e-14 { 0.0 } else { (rows[k][n] - known) / rows[k][k] };
    }
    x
}
