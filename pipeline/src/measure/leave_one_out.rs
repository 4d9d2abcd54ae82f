//! How well kernels predict a shape that they have not seen: each row of the pose table in turn is left out, nothing
//! else, and the frame in its pose is compared with its target. Knows the run time's garment, no source file.

use crate::stages::StageError;
use crate::stages::correctives::without_correctives;
use crate::stages::kernel;
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
}

impl Method {
    /// All, in the order of the table.
    pub const ALL: [Method; 9] = [
        Method::Default,
        Method::MovingLeastSquares,
        Method::ModifiedShepard,
        Method::Nearest,
        Method::Skinning,
        Method::InverseDistance,
        Method::Paper,
        Method::LinearRbf,
        Method::ThinPlate,
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
        }
    }
}

/// The errors of a method, target by target. Correctives are left out: they know the sample that should not be known.
///
/// # Errors
/// When the default kernel cannot be solved without one of the rows.
pub fn errors(garment: &Garment, method: Method) -> Result<Vec<Error>, StageError> {
    let garment = &Garment::new(without_correctives(garment.data())).map_err(invalid)?;
    (0..garment.data().targets.len()).into_par_iter().map(|left_out| error_of(garment, method, left_out)).collect()
}

fn invalid(error: InvalidGarment) -> StageError {
    StageError::new("leave-one-out", error.to_string())
}

fn error_of(garment: &Garment, method: Method, left_out: usize) -> Result<Error, StageError> {
    let data = garment.data();
    let pose = data.poses.pose(left_out + 1);
    let rest = without(data, left_out)?;
    let mut rates = Rates::new(rest.data());
    predict(&rest, method, &pose, &mut rates);
    let predicted_m = positions(&rest, &pose, &rates);
    let mut alone = Rates::new(garment.data());
    (0..data.drivers.len()).for_each(|driver| alone.set(driver, left_out, 1.0));
    let true_m = positions(garment, &pose, &alone);

    let unique = garment.unique_count();
    let mut errors: Vec<f64> =
        predicted_m[..unique].iter().zip(&true_m[..unique]).map(|(a, b)| f64::from(a.distance(*b)) * 1e3).collect();
    errors.sort_by(f64::total_cmp);
    Ok(Error {
        target: data.targets[left_out].name.clone(),
        mean_mm: errors.iter().sum::<f64>() / unique as f64,
        p99_mm: errors[(unique * 99 / 100).min(unique - 1)],
        max_mm: errors[unique - 1],
    })
}

fn positions(garment: &Garment, pose: &Pose, rates: &Rates) -> Vec<Vec3> {
    let mut positions_m = vec![Vec3::ZERO; garment.vertex_count()];
    let mut normals = positions_m.clone();
    let frame = Frame { positions_m: &mut positions_m, normals: &mut normals };
    evaluate_with_rates(garment, pose, rates, &mut Scratch::new(garment), frame);
    positions_m
}

/// The garment without one target and its row; the default kernel keeps its scales.
fn without(data: &GarmentData, target: usize) -> Result<Garment, StageError> {
    let mut rest = data.clone();
    rest.targets.remove(target);
    let bones = rest.poses.bones.len();
    rest.poses.rotations.drain((target + 1) * bones..(target + 2) * bones);
    (rest.rbf, rest.certificate) = (None, None);
    if let Some(rbf) = &data.rbf {
        let layer = |(number, layer): (usize, &RbfLayer)| {
            let (limbs, scales) = kernel::limbs_and_scales(layer);
            kernel::interpolate(&rest, number, &limbs, &scales)
        };
        rest.rbf = Some(Rbf { layers: rbf.layers.iter().enumerate().map(layer).collect::<Result<_, _>>()? });
    }
    Garment::new(rest).map_err(invalid)
}

/// The rates of a method in a pose, layer by layer.
fn predict(garment: &Garment, method: Method, pose: &Pose, rates: &mut Rates) {
    match method {
        Method::Default => return garment.blend_rates(garment.kernel(), pose, rates),
        Method::Paper => return garment.blend_rates(Kernel::Paper, pose, rates),
        Method::Skinning => return,
        _ => {}
    }
    let data = garment.data();
    for (number, layer) in data.rbf.iter().flat_map(|rbf| rbf.layers.iter().enumerate()) {
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

fn thin_plate(bones: &[Bone], samples: &[Pose], pose: &Pose) -> Vec<f64> {
    let vector = |pose: &Pose| -> Vec<f64> {
        let rotations = bones.iter().map(|&bone| rotation(pose, bone));
        let of = |q: DQuat| {
            let q = if q.w < 0.0 { -q } else { q };
            let sine = q.xyz().length();
            let angle = 2.0 * libm::atan2(sine, q.w);
            (if sine > 1e-12 { q.xyz() * (angle / sine) } else { DVec3::ZERO }).to_array()
        };
        rotations.flat_map(of).collect()
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
