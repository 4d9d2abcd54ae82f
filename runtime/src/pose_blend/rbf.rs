//! The default kernel: interpolation of the samples by radial basis functions, exact at every sample and smooth
//! everywhere. Knows rotations only, no vertex; the numbers it runs on are chosen by the pipeline.
//!
//! Drivers are taken in groups, an arm each, so that a sleeve which shoulder and elbow move together is not counted
//! twice. A group *embeds* a pose: for every joint of its chain the rotation accumulated from the chain's start turns
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
use crate::arrays::{ChainJoint, GarmentData, PoseTable};
use crate::skeleton::{Bone, Pose};
use glam::DQuat;

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
/// When `embedding` is not [`embedding_length`] long.
pub fn embed(chain: &[ChainJoint], rotation: impl Fn(Bone) -> DQuat, embedding: &mut [f64]) {
    assert_eq!(embedding.len(), embedding_length(chain), "nine numbers per joint");
    let mut accumulated = DQuat::IDENTITY;
    for (joint, numbers) in chain.iter().zip(embedding.chunks_exact_mut(PER_JOINT)) {
        accumulated *= rotation(joint.bone);
        let (across, other) = joint.axis.any_orthonormal_pair();
        let directions = [(joint.axis, joint.swing), (across, joint.twist), (other, joint.twist)];
        for ((direction, scale), numbers) in directions.into_iter().zip(numbers.chunks_exact_mut(3)) {
            numbers.copy_from_slice(&(scale * (accumulated * direction)).to_array());
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

/// The embeddings of a garment's samples, computed once: group by group, sample by sample.
#[derive(Clone, Debug, Default)]
pub struct Samples {
    embeddings: Vec<Vec<f64>>,
}

impl Samples {
    /// Of checked arrays.
    #[must_use]
    pub fn new(data: &GarmentData) -> Samples {
        let groups = data.rbf.iter().flat_map(|rbf| &rbf.groups);
        Samples { embeddings: groups.map(|group| embed_samples(&group.chain, &data.poses)).collect() }
    }
}

/// The embeddings of all rows of a pose table, one after the other. Joints that the table does not give are at rest.
#[must_use]
pub fn embed_samples(chain: &[ChainJoint], poses: &PoseTable) -> Vec<f64> {
    let length = embedding_length(chain);
    let mut embeddings = vec![0.0; length * poses.rows()];
    for (row, embedding) in embeddings.chunks_exact_mut(length.max(1)).enumerate() {
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
    /// Squared distance to every sample, group by group.
    squared_distances: Vec<f64>,
    /// The same summed over the groups.
    summed: Vec<f64>,
    row: Vec<f64>,
}

impl Work {
    pub(super) fn new(data: &GarmentData) -> Work {
        let Some(rbf) = &data.rbf else { return Work::default() };
        let samples = data.targets.len() + 1;
        let longest = rbf.groups.iter().map(|group| embedding_length(&group.chain)).max().unwrap_or(0);
        Work {
            embedding: vec![0.0; longest],
            squared_distances: vec![0.0; samples * rbf.groups.len()],
            summed: vec![0.0; samples],
            row: vec![0.0; data.targets.len()],
        }
    }
}

/// The default kernel. Rates of a garment that was built without one are all 0.
///
/// A rotation that is not finite or has no length counts as the T-pose.
///
/// # Panics
/// When `rates` was made for a garment of another shape.
pub fn rbf(data: &GarmentData, samples: &Samples, pose: &Pose, rates: &mut Rates) {
    rates.assert_fits(data);
    rates.clear();
    let Some(rbf) = &data.rbf else { return };
    let targets = data.targets.len();
    let Work { embedding, squared_distances, summed, row } = &mut rates.work;
    let rotation = |bone| {
        let rotation = pose.rotation(bone).as_dquat();
        let length = rotation.length();
        if length > 1e-6 && length.is_finite() { rotation / length } else { DQuat::IDENTITY }
    };

    summed.fill(0.0);
    let own_distances = squared_distances.chunks_exact_mut(targets + 1);
    for ((group, samples), own) in rbf.groups.iter().zip(&samples.embeddings).zip(own_distances) {
        let embedding = &mut embedding[..embedding_length(&group.chain)];
        embed(&group.chain, rotation, embedding);
        for ((sample, own), summed) in samples.chunks_exact(embedding.len()).zip(own).zip(summed.iter_mut()) {
            *own = squared_distance(embedding, sample);
            *summed += *own;
        }
    }

    for (group, own) in rbf.groups.iter().zip(squared_distances.chunks_exact(targets + 1)) {
        row.fill(0.0);
        let far = own.iter().map(|&own| 1.0 - bump(own, rbf.reach)).product::<f64>();
        let kept = 1.0 - far;
        if kept > 0.0 {
            let coefficients = group.own.chunks_exact(targets.max(1)).zip(group.joint.chunks_exact(targets.max(1)));
            for ((&own, &summed), (own_row, joint_row)) in own.iter().zip(summed.iter()).zip(coefficients) {
                accumulate(row, kept * inverse_multiquadric(own), own_row);
                accumulate(row, kept * wendland(summed, rbf.joint_width), joint_row);
            }
        }
        for &driver in &group.drivers {
            for (target, &rate) in row.iter().enumerate() {
                rates.rates[usize::from(driver) * targets + target] = super::limited(rate as f32);
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
