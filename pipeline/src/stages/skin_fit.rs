//! Skin weights that the samples ask for: how much each joint moves each vertex, as the artist's shapes show it. Knows base, samples and
//! first weights, no body.
//!
//! Between two samples the deltas of a vertex go along a straight line, while a vertex that follows a joint goes along an arc: a lap that
//! its weights do not let follow the thigh falls a chord's height into it (14 mm between two poses that are 30 degrees apart). So
//! weights are fitted to the samples (as skinning decompositions do, Le and Deng: Smooth Skinning Decomposition with Rigid
//! Bones, 2012; here the bones are known): for each vertex the convex weights that place it best in all samples, held near their
//! first values and near those of their neighbours, so that they stay smooth over the mesh.

use super::laplacian::Neighbours;
use super::weights::shares;
use crate::ir;
use crate::stages::deltas::pose_of;
use glam::{Affine3A, DVec3};
use kitsuke::arrays::SkinWeights;
use rayon::prelude::*;

/// Counts up whenever the same input gives other weights.
pub const VERSION: u32 = 1;

/// How closely weights follow the samples.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Settings {
    /// How strongly weights are held at their first values: mean squared metres over the samples that a whole unit of weight is worth.
    pub hold_m2: f64,
    /// How strongly they are held at the mean of their neighbours', likewise.
    pub smooth_m2: f64,
    /// Rounds in which neighbours take note of each other.
    pub rounds: usize,
}

impl Default for Settings {
    fn default() -> Settings {
        Settings { hold_m2: 1e-4, smooth_m2: 1e-2, rounds: 60 }
    }
}

/// Joints that move a vertex, in a pack.
const MOST_JOINTS: usize = 4;

/// Weights between `first` and what the samples ask for.
#[must_use]
pub fn fitted(source: &ir::Garment, first: &[SkinWeights], settings: &Settings) -> Vec<SkinWeights> {
    let ir::Garment { base, body, pose_bones, targets, .. } = source;
    let joint_count = body.skeleton.joints().len();
    let transforms: Vec<Vec<Affine3A>> = targets
        .iter()
        .map(|target| {
            let mut posed_from_rest = vec![Affine3A::IDENTITY; joint_count];
            body.skeleton.posed_from_rest(&pose_of(pose_bones, target), &mut posed_from_rest);
            posed_from_rest
        })
        .collect();
    // Joints that do the same in every sample cannot be told apart: the first of them stands for all that hold no weight yet.
    let candidates: Vec<usize> = (0..joint_count)
        .filter(|&joint| {
            let is_used = first.iter().any(|skin| skin.joints.iter().zip(&skin.weights).any(|(&j, &w)| usize::from(j) == joint && w > 0));
            let is_driven = targets.iter().zip(&transforms).any(|(_, of_sample)| {
                let above = body.skeleton.joints()[joint].parent.map_or(Affine3A::IDENTITY, |p| of_sample[usize::from(p)]);
                !of_sample[joint].abs_diff_eq(above, 1e-5)
            });
            is_used || is_driven
        })
        .collect();
    let problem = |v: usize| {
        let rest_m = base.positions_m[v];
        let mut system = System::new(candidates.len());
        for (target, of_sample) in targets.iter().zip(&transforms) {
            let places: Vec<DVec3> =
                candidates.iter().map(|&joint| of_sample[joint].transform_point3(rest_m).as_dvec3()).collect();
            system.add(&places, target.positions_m[v].as_dvec3(), 1.0 / targets.len() as f64);
        }
        system
    };
    let systems: Vec<System> = (0..base.positions_m.len()).into_par_iter().map(problem).collect();
    let start: Vec<Vec<f64>> = first
        .iter()
        .map(|skin| {
            let weight = |joint: usize| {
                let of_joint = skin.joints.iter().zip(&skin.weights).filter(|(j, _)| usize::from(**j) == joint);
                of_joint.map(|(_, &weight)| f64::from(weight) / 65535.0).sum()
            };
            candidates.iter().map(|&joint| weight(joint)).collect()
        })
        .collect();
    let neighbours = Neighbours::new(&base.positions_m, &base.triangles);
    let mut weights = start.clone();
    for _ in 0..settings.rounds {
        weights = (0..weights.len())
            .into_par_iter()
            .map(|v| {
                let near = neighbours.of(v);
                let mean = |c: usize| near.iter().map(|&n| weights[n as usize][c]).sum::<f64>() / near.len().max(1) as f64;
                let smooth = if near.is_empty() { 0.0 } else { settings.smooth_m2 };
                let wanted: Vec<f64> = (0..candidates.len())
                    .map(|c| (settings.hold_m2 * start[v][c] + smooth * mean(c)) / (settings.hold_m2 + smooth))
                    .collect();
                systems[v].solve(&weights[v], &wanted, settings.hold_m2 + smooth, None)
            })
            .collect();
    }
    (0..weights.len())
        .into_par_iter()
        .map(|v| {
            let mut order: Vec<usize> = (0..candidates.len()).collect();
            order.sort_by(|&a, &b| weights[v][b].total_cmp(&weights[v][a]));
            order.truncate(MOST_JOINTS);
            order.sort_unstable();
            let mut kept = vec![0.0; candidates.len()];
            let sum: f64 = order.iter().map(|&c| weights[v][c]).sum();
            order.iter().for_each(|&c| kept[c] = weights[v][c] / sum);
            let row: Vec<f64> = order.iter().map(|&c| kept[c]).collect();
            let shared = shares(&row);
            let mut skin = SkinWeights::default();
            for (place, (&c, &share)) in order.iter().zip(&shared).enumerate() {
                (skin.joints[place], skin.weights[place]) = (candidates[c] as u8, share);
            }
            skin
        })
        .collect()
}

/// The squared error of a vertex as a quadratic form of its weights: wᵀ A w − 2 bᵀ w.
struct System {
    matrix: Vec<f64>,
    right: Vec<f64>,
}

impl System {
    fn new(size: usize) -> System {
        System { matrix: vec![0.0; size * size], right: vec![0.0; size] }
    }

    /// One sample: where each joint alone would take the vertex, and where it should be.
    fn add(&mut self, places: &[DVec3], wanted: DVec3, share: f64) {
        let size = places.len();
        // Relative to the wanted place, since weights sum to one: the right-hand side is 0.
        for i in 0..size {
            for j in 0..size {
                self.matrix[i * size + j] += share * (places[i] - wanted).dot(places[j] - wanted);
            }
        }
    }

    /// The convex weights that are best together with a pull towards `wanted`, from `start`: pair after pair of weights is exchanged, the
    /// pair first that gains most.
    fn solve(&self, start: &[f64], wanted: &[f64], pull: f64, _: Option<()>) -> Vec<f64> {
        let size = start.len();
        let mut weights = start.to_vec();
        let mut slope: Vec<f64> = (0..size)
            .map(|i| {
                let row = &self.matrix[i * size..(i + 1) * size];
                row.iter().zip(&weights).map(|(a, w)| a * w).sum::<f64>() - self.right[i] + pull * (weights[i] - wanted[i])
            })
            .collect();
        for _ in 0..4 * size {
            let to = (0..size).min_by(|&a, &b| slope[a].total_cmp(&slope[b])).expect("there are joints");
            let used = (0..size).filter(|&i| weights[i] > 0.0);
            let from = used.max_by(|&a, &b| slope[a].total_cmp(&slope[b])).expect("weights sum to one");
            let gain = slope[from] - slope[to];
            if gain < 1e-9 {
                break;
            }
            let at = |i: usize, j: usize| self.matrix[i * size + j] + if i == j { pull } else { 0.0 };
            let bend = at(to, to) + at(from, from) - 2.0 * at(to, from);
            let step = if bend > 1e-15 { (gain / bend).min(weights[from]) } else { weights[from] };
            weights[to] += step;
            weights[from] = if step == weights[from] { 0.0 } else { weights[from] - step };
            for (i, slope) in slope.iter_mut().enumerate() {
                *slope += step * (at(i, to) - at(i, from));
            }
        }
        weights
    }
}
