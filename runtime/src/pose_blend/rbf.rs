//! The default kernel: interpolation of the samples by radial basis functions, exact at every sample and smooth
//! everywhere. Knows rotations only, no vertex; the numbers it runs on are chosen by the pipeline.
//!
//! Every layer interpolates its own samples. Its drivers are taken in groups, an arm each, so that a sleeve which shoulder and elbow move together is not counted
//! twice. A group *embeds* a pose: the rotation vector of every joint of its chain, local or from the trunk on, turns across the bone and
//! turns about it each scaled by how much they matter to the shape. Two poses are as far apart as their embeddings. With D_g the distance in one group and D² the
//! sum of D_g² over all groups,
//!
//! ```text
//! rates_g = σ_g · ( φ(D_g) · own_g  +  ψ(D / joint_width) · joint_g )
//! ```
//!
//! - φ(r) = 1/√(1 + r²), an inverse multiquadric: the shape of an arm from that arm's pose alone, with a ridge that
//!   averages samples which share the arm's pose and yet differ. The samples of the other arm, mirrored, are samples as well, with a
//!   ridge of their own that believes them less;
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
use glam::{DQuat, DVec3, Quat};

/// Numbers per chain joint in an embedding: a rotation vector.
const PER_JOINT: usize = 3;

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
    assert_eq!(embedding.len(), embedding_length(chain), "three numbers per joint");
    let mut carried = [DQuat::IDENTITY; limits::CHAIN];
    for (place, (joint, numbers)) in chain.iter().zip(embedding.chunks_exact_mut(PER_JOINT)).enumerate() {
        let own = rotation(joint.bone);
        carried[place] = joint.parent.map_or(own, |parent| carried[usize::from(parent)] * own);
        let turn = turn(if joint.is_carried { carried[place] } else { own });
        let about = joint.axis * joint.axis.dot(turn);
        numbers.copy_from_slice(&(joint.swing * (turn - about) + joint.twist * about).to_array());
    }
}

/// The rotation vector of a unit quaternion, radians: axis times angle θ, times 1 − (θ/π)¹⁶. The last factor is 0.95 or more up to 150
/// degrees, where joints end, and takes the vector to 0 at half a turn, where its sign would jump.
fn turn(rotation: DQuat) -> DVec3 {
    let sine = rotation.xyz().length();
    if sine < 1e-12 {
        return DVec3::ZERO;
    }
    let angle_rad = 2.0 * libm::atan2(sine, rotation.w.abs());
    let share = angle_rad / std::f64::consts::PI;
    let squared = share * share;
    let eighth = squared * squared * (squared * squared);
    rotation.xyz() * (angle_rad * (1.0 - eighth * eighth) * rotation.w.signum() / sine)
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
    /// Those of the layer, then those of the other side.
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
            let embedded = |group: &Group| {
                let samples = embed_known(&group.chain, group.mirror.is_some(), &data.poses, &rows);
                Embedded { samples, centres: embed_rows(&group.chain, &group.centres) }
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
    let pose = |row: &[Quat]| chain.iter().zip(row).fold(Pose::REST, |pose, (joint, &q)| pose.with(joint.bone, q));
    embed_poses(chain, rotations.chunks_exact(chain.len().max(1)).map(pose))
}

/// The embeddings of poses, one after the other.
#[must_use]
pub fn embed_poses(chain: &[ChainJoint], poses: impl IntoIterator<Item = Pose>) -> Vec<f64> {
    let length = embedding_length(chain);
    let mut embeddings = Vec::new();
    for pose in poses {
        let first = embeddings.len();
        embeddings.resize(first + length, 0.0);
        embed(chain, |bone| pose.rotation(bone).as_dquat().normalize(), &mut embeddings[first..]);
    }
    embeddings
}

/// The embeddings of these rows of a pose table, one after the other. Joints that the table does not give are at rest.
#[must_use]
pub fn embed_samples(chain: &[ChainJoint], poses: &PoseTable, rows: &[usize]) -> Vec<f64> {
    embed_poses(chain, rows.iter().map(|&row| poses.pose(row)))
}

/// The embeddings of all samples that a group knows: those of these rows, the base first, then, where it has a mirror, all but the base as
/// the other side does them ([`Pose::mirrored`]).
#[must_use]
pub fn embed_known(chain: &[ChainJoint], has_mirror: bool, poses: &PoseTable, rows: &[usize]) -> Vec<f64> {
    let mut embeddings = embed_samples(chain, poses, rows);
    if has_mirror {
        embeddings.extend(embed_poses(chain, rows.iter().skip(1).map(|&row| poses.pose(row).mirrored())));
    }
    embeddings
}

/// Working memory of [`rbf`], so that a frame allocates nothing.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Work {
    /// The embeddings of a layer's groups.
    embeddings: Vec<f64>,
    /// Squared distance to every sample that a group knows, group by group.
    squared_distances: Vec<f64>,
    /// Squared distance to every sample of the layer, over all groups.
    summed: Vec<f64>,
    /// The rates of a layer's targets.
    row: Vec<f64>,
    /// Each layer's targets.
    targets: Vec<Vec<usize>>,
    /// How many of them belong to a sample.
    samples: Vec<usize>,
}

impl Work {
    pub(super) fn new(data: &GarmentData) -> Work {
        let Some(rbf) = &data.rbf else { return Work::default() };
        let targets: Vec<Vec<usize>> =
            (0..rbf.layers.len()).map(|layer| data.targets_of_layer(layer).collect()).collect();
        let samples: Vec<usize> = (0..targets.len()).map(|layer| data.samples_of_layer(layer).count()).collect();
        let most = |count: &dyn Fn(usize) -> usize| (0..targets.len()).map(count).max().unwrap_or(0);
        let of_groups =
            |layer: usize, count: &dyn Fn(&Group) -> usize| rbf.layers[layer].groups.iter().map(count).sum::<usize>();
        Work {
            embeddings: vec![0.0; most(&|layer| of_groups(layer, &|group| embedding_length(&group.chain)))],
            squared_distances: vec![
                0.0;
                most(&|layer| of_groups(layer, &|group| rows_of_group(group, samples[layer])))
            ],
            summed: vec![0.0; most(&|layer| samples[layer] + 1)],
            row: vec![0.0; most(&|layer| targets[layer].len())],
            targets,
            samples,
        }
    }
}

/// How many samples a group knows: those of the layer and the base, then those of the other side.
fn rows_of_group(group: &Group, samples: usize) -> usize {
    1 + samples + if group.mirror.is_some() { samples } else { 0 }
}

/// The default kernel, layer by layer. Rates of a garment that was built without one are all 0.
///
/// A rotation that is not finite or has no length counts as the T-pose.
///
/// # Panics
/// When `rates` was made for a garment of another shape.
pub fn rbf(data: &GarmentData, samples_of: &Samples, pose: &Pose, rates: &mut Rates) {
    rates.assert_fits(data);
    rates.clear();
    let Some(rbf) = &data.rbf else { return };
    let rotation = |bone| {
        let rotation = pose.rotation(bone).as_dquat();
        let length = rotation.length();
        if length > 1e-6 && length.is_finite() { rotation / length } else { DQuat::IDENTITY }
    };
    let all = data.targets.len();
    let Work { embeddings, squared_distances, summed, row, targets, samples } = &mut rates.work;
    for (number, (layer, embedded)) in rbf.layers.iter().zip(&samples_of.layers).enumerate() {
        let (targets, samples) = (targets[number].as_slice(), samples[number]);
        let (summed, row) = (&mut summed[..=samples], &mut row[..targets.len()]);

        summed.fill(0.0);
        let (mut embedding_rest, mut own_rest) = (embeddings.as_mut_slice(), squared_distances.as_mut_slice());
        for (group, embedded) in layer.groups.iter().zip(embedded) {
            let embedding;
            (embedding, embedding_rest) = embedding_rest.split_at_mut(embedding_length(&group.chain));
            embed(&group.chain, rotation, embedding);
            let own;
            (own, own_rest) = own_rest.split_at_mut(rows_of_group(group, samples));
            for (own, sample) in own.iter_mut().zip(embedded.samples.chunks_exact(embedding.len())) {
                *own = squared_distance(embedding, sample);
            }
            summed.iter_mut().zip(&*own).for_each(|(summed, own)| *summed += own);
        }

        let (mut embedding_rest, mut own_rest) = (embeddings.as_slice(), squared_distances.as_slice());
        for (group, embedded) in layer.groups.iter().zip(embedded) {
            let embedding;
            (embedding, embedding_rest) = embedding_rest.split_at(embedding_length(&group.chain));
            let own;
            (own, own_rest) = own_rest.split_at(rows_of_group(group, samples));
            row.fill(0.0);
            let far = own.iter().map(|&own| 1.0 - bump(own, layer.reach)).product::<f64>();
            let kept = 1.0 - far;
            if kept > 0.0 {
                let width = targets.len().max(1);
                for (&own, coefficients) in own.iter().zip(group.own.chunks_exact(width)) {
                    accumulate(row, kept * inverse_multiquadric(own), coefficients);
                }
                for (&summed, coefficients) in summed.iter().zip(group.joint.chunks_exact(width)) {
                    accumulate(row, kept * wendland(summed, layer.joint_width), coefficients);
                }
                let correctives = &mut row[samples..];
                let centres = embedded.centres.chunks_exact(embedding.len());
                for (centre, coefficients) in centres.zip(group.corrective.chunks_exact(correctives.len().max(1))) {
                    let near = inverse_multiquadric(squared_distance(embedding, centre));
                    accumulate(correctives, kept * near, coefficients);
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
