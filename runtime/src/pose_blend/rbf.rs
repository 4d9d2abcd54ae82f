//! The default kernel: interpolation of the samples by radial basis functions, exact at every sample and smooth
//! everywhere. Knows rotations only, no vertex; the numbers it runs on are chosen by the pipeline.
//!
//! Every layer interpolates its own samples. Its drivers are taken in groups, an arm each, so that a sleeve which shoulder and elbow move together is not counted
//! twice. A group *embeds* a pose: for every joint of its chain the rotation accumulated from the trunk turns
//! the bone's axis and two directions across it, each scaled by how much it matters to the shape. Two poses are as far
//! apart as their embeddings, a distance in a Euclidean space that is smooth also at half a turn and blind to the
//! sign of quaternions. With D_g the distance in one group and D² the sum of D_g² over all groups,
//!
//! ```text
//! rates_g = σ_g · ( φ(D_g) · own_g  +  ψ(D / joint_width) · joint_g )
//! ```
//!
//! - φ(r) = 1/√(1 + r²), an inverse multiquadric: the shape of an arm from that arm's pose alone, with a ridge that
//!   averages samples which share the arm's pose and yet differ;
//! - ψ(r) = (1 − r)⁴ (4r + 1) below 1 (Wendland C²): what is left of each sample, near that sample in all groups, so
//!   that every sample comes back exactly;
//! - σ = 1 − Π (1 − bump(D_g / reach)) over the samples: 1 within half the reach of any sample, 0 beyond the reach of
//!   all, where the skinned base remains.
//!
//! Rates may be negative and need not sum to one. Everything is computed in double precision: the interpolation's
//! coefficients cancel, and single precision would cost tenths of a millimetre.

use super::Rates;
use crate::arrays::{ChainJoint, GarmentData, Group, PoseTable, RbfLayer, limits};
use crate::skeleton::{Bone, Pose};
use glam::{DQuat, Quat};

/// Numbers per chain joint in an embedding: three directions.
const PER_JOINT: usize = 9;

/// Length of the embeddings of a chain.
#[must_use]
pub fn embedding_length(chain: &[ChainJoint]) -> usize {
    PER_JOINT * chain.len()
}

/// Where the rotations of a chain's joints lie in the Euclidean space in which poses are compared.
///
/// # Panics
/// When `embedding` is not [`embedding_length`] long, or the chain longer than [`limits::CHAIN`].
pub fn embed(chain: &[ChainJoint], rotation: impl Fn(Bone) -> DQuat, embedding: &mut [f64]) {
    assert_eq!(embedding.len(), embedding_length(chain), "nine numbers per joint");
    let mut accumulated = [DQuat::IDENTITY; limits::CHAIN];
    for (place, (joint, numbers)) in chain.iter().zip(embedding.chunks_exact_mut(PER_JOINT)).enumerate() {
        let before = joint.parent.map_or(DQuat::IDENTITY, |parent| accumulated[usize::from(parent)]);
        let turned = before * rotation(joint.bone);
        accumulated[place] = turned;
        let (across, other) = joint.axis.any_orthonormal_pair();
        let directions = [(joint.axis, joint.swing), (across, joint.twist), (other, joint.twist)];
        for ((direction, scale), numbers) in directions.into_iter().zip(numbers.chunks_exact_mut(3)) {
            numbers.copy_from_slice(&(scale * (turned * direction)).to_array());
        }
    }
}

/// Squared distance of two embeddings.
#[must_use]
pub fn squared_distance(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| (a - b) * (a - b)).sum()
}

/// φ of a squared distance: 1 at 0, slowly falling, smooth everywhere.
#[must_use]
pub fn inverse_multiquadric(squared_distance: f64) -> f64 {
    1.0 / (1.0 + squared_distance).sqrt()
}

/// ψ of a squared distance: 1 at 0, twice smoothly differentiable, 0 beyond the width.
#[must_use]
pub fn wendland(squared_distance: f64, width: f64) -> f64 {
    let r = squared_distance.sqrt() / width;
    let inside = (1.0 - r).max(0.0);
    inside * inside * inside * inside * (4.0 * r + 1.0)
}

/// How near one sample is: 1 within half the reach, 0 beyond it, twice smoothly differentiable between.
#[must_use]
pub fn bump(squared_distance: f64, reach: f64) -> f64 {
    let t = (2.0 * squared_distance.sqrt() / reach - 1.0).clamp(0.0, 1.0);
    1.0 - t * t * t * (t * (6.0 * t - 15.0) + 10.0)
}

/// The embeddings of a garment's samples, computed once: layer by layer, group by group, the base first.
#[derive(Clone, Debug, Default)]
pub struct Samples {
    layers: Vec<Vec<Embedded>>,
}

/// What a group compares poses with.
#[derive(Clone, Debug, Default)]
struct Embedded {
    samples: Vec<f64>,
    centres: Vec<f64>,
}

impl Samples {
    /// Of checked arrays.
    #[must_use]
    pub fn new(data: &GarmentData) -> Samples {
        let layers = data.rbf.iter().flat_map(|rbf| rbf.layers.iter().enumerate());
        let of_layer = |(number, layer): (usize, &RbfLayer)| {
            let rows = rows_of_layer(data, number);
            let embedded = |group: &Group| Embedded {
                samples: embed_samples(&group.chain, &data.poses, &rows),
                centres: embed_rows(&group.chain, &group.centres),
            };
            layer.groups.iter().map(embedded).collect()
        };
        Samples { layers: layers.map(of_layer).collect() }
    }
}

/// The rows of the pose table that a layer blends: the base's, then those of the layer's samples.
#[must_use]
pub fn rows_of_layer(data: &GarmentData, layer: usize) -> Vec<usize> {
    std::iter::once(0).chain(data.samples_of_layer(layer).map(|target| target + 1)).collect()
}

/// The embeddings of poses that are given as the rotations of the chain's joints, one after the other.
#[must_use]
pub fn embed_rows(chain: &[ChainJoint], rotations: &[Quat]) -> Vec<f64> {
    let length = embedding_length(chain);
    let rows = rotations.chunks_exact(chain.len().max(1));
    let mut embeddings = vec![0.0; length * rows.len()];
    for (row, embedding) in rows.zip(embeddings.chunks_exact_mut(length.max(1))) {
        let place = |bone| chain.iter().position(|joint| joint.bone == bone).expect("asked for joints of the chain");
        embed(chain, |bone| row[place(bone)].as_dquat().normalize(), embedding);
    }
    embeddings
}

/// The embeddings of these rows of a pose table, one after the other. Joints that the table does not give are at rest.
#[must_use]
pub fn embed_samples(chain: &[ChainJoint], poses: &PoseTable, rows: &[usize]) -> Vec<f64> {
    let length = embedding_length(chain);
    let mut embeddings = vec![0.0; length * rows.len()];
    for (&row, embedding) in rows.iter().zip(embeddings.chunks_exact_mut(length.max(1))) {
        let sample = poses.row(row);
        let rotation = |bone| match poses.bones.iter().position(|&listed| listed == bone) {
            Some(column) => sample[column].as_dquat().normalize(),
            None => DQuat::IDENTITY,
        };
        embed(chain, rotation, embedding);
    }
    embeddings
}

/// Working memory of [`rbf`], so that a frame allocates nothing.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Work {
    embedding: Vec<f64>,
    /// Squared distance to every sample of the layer, group by group.
    squared_distances: Vec<f64>,
    /// The same summed over the groups.
    summed: Vec<f64>,
    /// The rates of a layer's targets.
    row: Vec<f64>,
    /// Each layer's targets.
    targets: Vec<Vec<usize>>,
}

impl Work {
    pub(super) fn new(data: &GarmentData) -> Work {
        let Some(rbf) = &data.rbf else { return Work::default() };
        let targets: Vec<Vec<usize>> =
            (0..rbf.layers.len()).map(|layer| data.targets_of_layer(layer).collect()).collect();
        let targets_of_layer = targets.iter().map(Vec::len).max().unwrap_or(0);
        let samples = (0..targets.len()).map(|layer| rows_of_layer(data, layer).len()).max().unwrap_or(0);
        let groups = rbf.layers.iter().map(|layer| layer.groups.len()).max().unwrap_or(0);
        let chains = rbf.layers.iter().flat_map(|layer| &layer.groups).map(|group| embedding_length(&group.chain));
        Work {
            embedding: vec![0.0; chains.max().unwrap_or(0)],
            squared_distances: vec![0.0; samples * groups],
            summed: vec![0.0; samples],
            row: vec![0.0; targets_of_layer],
            targets,
        }
    }
}

/// The default kernel, layer by layer. Rates of a garment that was built without one are all 0.
///
/// A rotation that is not finite or has no length counts as the T-pose.
///
/// # Panics
/// When `rates` was made for a garment of another shape.
pub fn rbf(data: &GarmentData, samples: &Samples, pose: &Pose, rates: &mut Rates) {
    rates.assert_fits(data);
    rates.clear();
    let Some(rbf) = &data.rbf else { return };
    let rotation = |bone| {
        let rotation = pose.rotation(bone).as_dquat();
        let length = rotation.length();
        if length > 1e-6 && length.is_finite() { rotation / length } else { DQuat::IDENTITY }
    };
    let all = data.targets.len();
    for (number, (layer, samples)) in rbf.layers.iter().zip(&samples.layers).enumerate() {
        let Work { embedding, squared_distances, summed, row, targets } = &mut rates.work;
        let targets = targets[number].as_slice();
        let correctives = targets.iter().filter(|&&target| target >= data.sample_count()).count();
        let rows = targets.len() - correctives + 1;
        let (summed, row) = (&mut summed[..rows], &mut row[..targets.len()]);

        summed.fill(0.0);
        let own_distances = squared_distances.chunks_exact_mut(rows);
        for ((group, embedded), own) in layer.groups.iter().zip(samples).zip(own_distances) {
            let embedding = &mut embedding[..embedding_length(&group.chain)];
            embed(&group.chain, rotation, embedding);
            let samples = embedded.samples.chunks_exact(embedding.len());
            for ((sample, own), summed) in samples.zip(own).zip(summed.iter_mut()) {
                *own = squared_distance(embedding, sample);
                *summed += *own;
            }
        }

        for ((group, embedded), own) in layer.groups.iter().zip(samples).zip(squared_distances.chunks_exact(rows)) {
            row.fill(0.0);
            let far = own.iter().map(|&own| 1.0 - bump(own, layer.reach)).product::<f64>();
            let kept = 1.0 - far;
            if kept > 0.0 {
                let width = targets.len().max(1);
                let coefficients = group.own.chunks_exact(width).zip(group.joint.chunks_exact(width));
                for ((&own, &summed), (own_row, joint_row)) in own.iter().zip(summed.iter()).zip(coefficients) {
                    accumulate(row, kept * inverse_multiquadric(own), own_row);
                    accumulate(row, kept * wendland(summed, layer.joint_width), joint_row);
                }
                if correctives > 0 {
                    let embedding = &mut embedding[..embedding_length(&group.chain)];
                    embed(&group.chain, rotation, embedding);
                    let centres = embedded.centres.chunks_exact(embedding.len());
                    for (centre, coefficients) in centres.zip(group.corrective.chunks_exact(correctives)) {
                        let near = inverse_multiquadric(squared_distance(embedding, centre));
                        accumulate(&mut row[rows - 1..], kept * near, coefficients);
                    }
                }
            }
            for &driver in &group.drivers {
                for (&target, &rate) in targets.iter().zip(&*row) {
                    rates.rates[usize::from(driver) * all + target] = super::limited(rate as f32);
                }
            }
        }
    }
}

fn accumulate(row: &mut [f64], factor: f64, coefficients: &[f64]) {
    if factor != 0.0 {
        for (sum, coefficient) in row.iter_mut().zip(coefficients) {
            *sum += factor * coefficient;
        }
    }
}
