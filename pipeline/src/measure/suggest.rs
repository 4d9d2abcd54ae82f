//! Which poses would teach a garment most. Knows the run time's garment and poses, no shape that is still to be made.
//!
//! The default kernel is a kriging predictor, so it knows how uncertain it is: at a pose x the shape of a limb has the variance
//! s²(x) = k(x, x) - k(x, S) (K + ridge)⁻¹ k(S, x) over the samples S, mirrored ones among them, in units of what the samples vary.
//! Of some candidates the one is chosen that lowers the mean variance over the poses that people take most (integrated variance;
//! Sacks, Welch, Mitchell and Wynn: Design and Analysis of Computer Experiments, 1989), as if it were added as a sample
//! of every limb that it turns, and mirrored; then the next one, given those. The largest variance alone would choose the rim of what
//! joints can do.
//!
//! Variances become millimetres by what the certificate knows: each target's error when it was left out, beside its variance then.

use crate::stages::StageError;
use crate::stages::kernel::{left_out_together, own_system, squared_distances};
use crate::stages::matrix::Matrix;
use kitsuke::Garment;
use kitsuke::arrays::{GarmentData, Group, RbfLayer};
use kitsuke::pose_blend::rbf::{
    embed_known, embed_poses, embedding_length, inverse_multiquadric, rows_of_layer, squared_distance,
};
use kitsuke::skeleton::{Bone, Pose};
use rayon::prelude::*;

/// What a layer is expected to err by, and what would help.
#[derive(Clone, Debug, PartialEq)]
pub struct Outlook {
    /// The joints that the layer's poses turn.
    pub bones: Vec<Bone>,
    /// Expected error over all poses now, root mean square, millimetres.
    pub before_mm: f64,
    /// The best candidates, the best first.
    pub suggestions: Vec<Suggestion>,
}

/// A pose worth making.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Suggestion {
    /// Which candidate.
    pub candidate: usize,
    /// How far the shape in this pose is expected to lie from the true one, with the suggestions before it made; mean over the garment,
    /// millimetres.
    pub error_mm: f64,
    /// The expected error over all poses of the layer with it and those before it made, root mean square, millimetres.
    pub after_mm: f64,
}

/// The best `count` candidates for a layer, to err as little as possible in `poses`. Candidates that turn none of the layer's joints are
/// passed over.
///
/// # Errors
/// When the garment has no default kernel, or too few targets to know its errors.
pub fn outlook(
    garment: &Garment,
    layer: usize,
    poses: &[Pose],
    candidates: &[Pose],
    count: usize,
) -> Result<Outlook, StageError> {
    let data = garment.data();
    let few = || StageError::new("suggest", "the kimono has too few targets to know how much it errs; make 4 first");
    let kernel = &data.rbf.as_ref().ok_or_else(few)?.layers[layer];
    let bones: Vec<Bone> = kernel.groups.iter().flat_map(|group| &group.chain).map(|joint| joint.bone).collect();
    let turns = |pose: &Pose| bones.iter().any(|&bone| pose.rotation(bone).xyz().length() > 1e-3);
    let mut left: Vec<usize> = (0..candidates.len()).filter(|&candidate| turns(&candidates[candidate])).collect();
    let offered: Vec<Pose> = left.iter().map(|&candidate| candidates[candidate].with_arms_untwisted()).collect();
    let poses: Vec<Pose> = poses.iter().map(Pose::with_arms_untwisted).collect();

    let mut limbs: Vec<Limb> = Vec::new();
    let mut variances_left_out = vec![0.0; data.samples_of_layer(layer).count()];
    for group in &kernel.groups {
        let known = Known::new(data, layer, kernel, group).ok_or_else(few)?;
        variances_left_out.iter_mut().zip(1..).for_each(|(sum, row)| *sum += known.variance_left_out(row));
        limbs.push(Limb::new(&known, group, &poses, &offered));
    }
    let errors_mm = data.certificate.as_ref().map(|certificate| certificate.left_out.as_slice()).unwrap_or_default();
    let sum_mm: f64 =
        data.samples_of_layer(layer).filter_map(|target| errors_mm.get(target)).map(|e| f64::from(e.mean_mm)).sum();
    let deviations: f64 = variances_left_out.iter().map(|variance| variance.max(0.0).sqrt()).sum();
    if sum_mm == 0.0 || deviations == 0.0 {
        return Err(few());
    }
    let mm = sum_mm / deviations;
    let over_poses_mm = |limbs: &[Limb]| {
        let sum: f64 = limbs.iter().map(|limb| (0..poses.len()).map(|x| limb.covariance.at(x, x)).sum::<f64>()).sum();
        mm * (sum.max(0.0) / poses.len().max(1) as f64).sqrt()
    };
    let before_mm = over_poses_mm(&limbs);
    let mut suggestions = Vec::new();
    let mut places: Vec<usize> = (0..left.len()).collect();
    for _ in 0..count.min(left.len()) {
        let gain = |&place: &usize| limbs.iter().map(|limb| limb.gain(place)).sum::<f64>();
        let gains: Vec<f64> = places.par_iter().map(gain).collect();
        let best = (0..places.len()).max_by(|&a, &b| gains[a].total_cmp(&gains[b])).expect("candidates are left");
        let (place, candidate) = (places.remove(best), left.remove(best));
        let variance: f64 = limbs.iter().map(|limb| limb.variance(place)).sum();
        limbs.par_iter_mut().for_each(|limb| limb.learn(place));
        let error_mm = mm * variance.max(0.0).sqrt();
        suggestions.push(Suggestion { candidate, error_mm, after_mm: over_poses_mm(&limbs) });
    }
    Ok(Outlook { bones, before_mm, suggestions })
}

/// What a limb's samples say.
struct Known {
    /// Embeddings of the samples, the base first, then the mirrored ones.
    places: Vec<f64>,
    length: usize,
    samples: usize,
    /// (K + ridge)⁻¹.
    inverse: Matrix,
    ridges: [f64; 2],
}

impl Known {
    /// `None` where samples cannot be told apart.
    fn new(data: &GarmentData, layer: usize, kernel: &RbfLayer, group: &Group) -> Option<Known> {
        let rows = rows_of_layer(data, layer);
        let places = embed_known(&group.chain, group.mirror.is_some(), &data.poses, &rows);
        let length = embedding_length(&group.chain);
        let ridges = [kernel.ridge, kernel.mirror_ridge];
        let system = own_system(&squared_distances(&places, length), rows.len(), ridges);
        Some(Known { inverse: system.inverse()?, samples: rows.len(), places, length, ridges })
    }

    /// The variance of a sample's shape had neither it nor its mirror image been seen.
    fn variance_left_out(&self, row: usize) -> f64 {
        left_out_together(&self.inverse, self.samples, row).1.at(0, 0) - self.ridges[0]
    }
}

/// How uncertain a limb's shape is: covariances of the poses, then of the candidates, then of the candidates mirrored, where samples are.
struct Limb {
    covariance: Matrix,
    poses: usize,
    candidates: usize,
    ridges: [f64; 2],
}

impl Limb {
    fn new(known: &Known, group: &Group, poses: &[Pose], candidates: &[Pose]) -> Limb {
        let mut places = embed_poses(&group.chain, poses.iter().chain(candidates).cloned());
        if group.mirror.is_some() {
            places.extend(embed_poses(&group.chain, candidates.iter().map(Pose::mirrored)));
        }
        let count = places.len() / known.length;
        let place = |i: usize| &places[i * known.length..(i + 1) * known.length];
        let near: Vec<Vec<f64>> = (0..count)
            .into_par_iter()
            .map(|i| {
                let samples = known.places.chunks_exact(known.length);
                samples.map(|sample| inverse_multiquadric(squared_distance(place(i), sample))).collect()
            })
            .collect();
        let explained: Vec<Vec<f64>> = near.par_iter().map(|near| known.inverse.times_vector(near)).collect();
        let rows: Vec<Vec<f64>> = (0..count)
            .into_par_iter()
            .map(|i| {
                let covariance = |j: usize| {
                    let known: f64 = near[i].iter().zip(&explained[j]).map(|(a, b)| a * b).sum();
                    inverse_multiquadric(squared_distance(place(i), place(j))) - known
                };
                (0..count).map(covariance).collect()
            })
            .collect();
        Limb {
            covariance: Matrix::new(count, |i, j| rows[i][j]),
            poses: poses.len(),
            candidates: candidates.len(),
            ridges: known.ridges,
        }
    }

    fn variance(&self, candidate: usize) -> f64 {
        let row = self.poses + candidate;
        self.covariance.at(row, row)
    }

    /// The rows that a candidate would add as samples, and the inverse of what they vary by.
    fn added(&self, candidate: usize) -> (Vec<usize>, Matrix) {
        let own = self.poses + candidate;
        let image = own + self.candidates;
        let rows = if image < self.covariance.size { vec![own, image] } else { vec![own] };
        let ridge = |i: usize, j: usize| if i == j { self.ridges[i] } else { 0.0 };
        let inner = Matrix::new(rows.len(), |i, j| self.covariance.at(rows[i], rows[j]) + ridge(i, j));
        let inverse = inner.inverse().expect("a covariance with a ridge is positive definite");
        (rows, inverse)
    }

    /// By how much a candidate lowers the variances of all poses together.
    fn gain(&self, candidate: usize) -> f64 {
        let (rows, inverse) = self.added(candidate);
        let of_pose = |x: usize| {
            let at: Vec<f64> = rows.iter().map(|&row| self.covariance.at(row, x)).collect();
            inverse.quadratic_form(&at)
        };
        (0..self.poses).map(of_pose).sum()
    }

    /// The same limb with a candidate as a sample.
    fn learn(&mut self, candidate: usize) {
        let (rows, inverse) = self.added(candidate);
        let at: Vec<Vec<f64>> = rows.iter().map(|&row| self.covariance.row(row).to_vec()).collect();
        let old = &self.covariance;
        self.covariance = Matrix::new(old.size, |i, j| {
            let mut known = 0.0;
            for a in 0..rows.len() {
                for b in 0..rows.len() {
                    known += at[a][i] * inverse.at(a, b) * at[b][j];
                }
            }
            old.at(i, j) - known
        });
    }
}
