//! Skin weights that the samples ask for: how much each joint moves each vertex, as the artist's shapes show it. Knows base, samples and
//! first weights, no body.
//!
//! The body under the cloth knows nothing of a sleeve that hangs free. Where weights are wrong, the deltas of the samples make up for
//! it, and between samples the rest of the error is left. So weights are fitted to the samples (as skinning decompositions do, Le
//! and Deng: Smooth Skinning Decomposition with Rigid Bones, 2012; here the bones are known): for each vertex the convex weights that
//! place it best in all samples, held near their first values and near those of its neighbours, so that they stay smooth over the mesh.
//! Cloth may follow joints and frames in which it hangs.

use super::deltas::{self, pose_of};
use super::hanging::layers_of_limbs;
use super::kernel::{Limb, limbs};
use super::laplacian::Neighbours;
use super::weights::shares;
use crate::ir::{self, TargetShape};
use glam::{Affine3A, DAffine3, DVec3};
use kitsuke::arrays::SkinWeights;
use kitsuke::skeleton::Skeleton;
use rayon::prelude::*;
use std::collections::BTreeSet;

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

/// Weights that differ by less are alike: a few units of a pack's 65535.
const ALIKE: f64 = 1e-4;

/// Joints that move a vertex, in a pack.
const MOST_JOINTS: usize = 4;

/// Weights between `first` and what the samples ask for.
#[must_use]
pub fn fitted(source: &ir::Garment, first: &[SkinWeights], settings: &Settings) -> Vec<SkinWeights> {
    let ir::Garment { base, body, pose_bones, .. } = source;
    let layers = layers_of_limbs(&source.drivers, &body.skeleton);
    let targets: Vec<&TargetShape> = source.targets.iter().filter(|target| layers.contains(&target.layer)).collect();
    if targets.is_empty() {
        return first.to_vec();
    }
    let frame_count = body.skeleton.frame_count();
    let posed_from_rest = |target: &&TargetShape| {
        let mut posed_from_rest = vec![Affine3A::IDENTITY; frame_count];
        body.skeleton.posed_from_rest(&pose_of(pose_bones, target), &mut posed_from_rest);
        posed_from_rest
    };
    let transforms: Vec<Vec<Affine3A>> = targets.iter().map(posed_from_rest).collect();
    let classes = classes(&body.skeleton, &transforms);
    let mut candidates = classes.clone();
    candidates.sort_unstable();
    candidates.dedup();
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
            let of_class = |class: &usize| {
                weights_of(skin).filter(|(joint, _)| classes[*joint] == *class).map(|(_, weight)| weight).sum()
            };
            candidates.iter().map(of_class).collect()
        })
        .collect();
    // A sleeve may follow its own arm and the trunk; what the other arm happens to do in the samples is no reason to follow it.
    let limb_of = limb_of(source, &layers);
    let allowed: Vec<Vec<bool>> = first
        .iter()
        .map(|skin| {
            let own: BTreeSet<usize> = weights_of(skin).filter_map(|(joint, _)| limb_of[joint]).collect();
            candidates.iter().map(|&frame| limb_of[frame].is_none_or(|limb| own.contains(&limb))).collect()
        })
        .collect();
    let neighbours = Neighbours::new(&base.positions_m, &base.triangles);
    let mut weights = start.clone();
    for _ in 0..settings.rounds {
        weights = (0..weights.len())
            .into_par_iter()
            .map(|v| {
                let near = neighbours.of(v);
                let mean =
                    |c: usize| near.iter().map(|&n| weights[n as usize][c]).sum::<f64>() / near.len().max(1) as f64;
                let smooth = if near.is_empty() { 0.0 } else { settings.smooth_m2 };
                let wanted: Vec<f64> = (0..candidates.len())
                    .map(|c| (settings.hold_m2 * start[v][c] + smooth * mean(c)) / (settings.hold_m2 + smooth))
                    .collect();
                systems[v].solve(&weights[v], &allowed[v], &wanted, settings.hold_m2 + smooth)
            })
            .collect();
    }
    let by_joint = |(weights, first): (&Vec<f64>, &SkinWeights)| {
        let mut by_joint = vec![0.0; frame_count];
        for (&class, &weight) in candidates.iter().zip(weights) {
            let members: Vec<(usize, f64)> = weights_of(first).filter(|(joint, _)| classes[*joint] == class).collect();
            let sum: f64 = members.iter().map(|(_, weight)| weight).sum();
            members.iter().for_each(|(joint, first)| by_joint[*joint] += weight * first / sum);
            if members.is_empty() {
                by_joint[nearest_of(class, first, &classes, &body.skeleton)] += weight;
            }
        }
        largest(&by_joint)
    };
    // Weights that crush a vertex in some sample leave it no way to its place there.
    let transforms: Vec<Vec<DAffine3>> =
        transforms.iter().map(|frames| frames.iter().map(Affine3A::as_daffine3).collect()).collect();
    let kept = |(weights, first): (&Vec<f64>, &SkinWeights)| {
        let skin = by_joint((weights, first));
        let is_crushed = transforms.iter().any(|frames| deltas::is_crushed(&deltas::blend(frames, &skin)));
        if is_crushed { *first } else { skin }
    };
    weights.par_iter().zip(first).map(kept).collect()
}

/// For each frame the limb that moves it, among those of these layers: their joints, what those carry, and what hangs from them.
fn limb_of(source: &ir::Garment, layers: &BTreeSet<u8>) -> Vec<Option<usize>> {
    let skeleton = &source.body.skeleton;
    let limbs: Vec<Limb> =
        layers.iter().flat_map(|&layer| limbs(&source.drivers, usize::from(layer), skeleton)).collect();
    let of_bone = |bone| limbs.iter().position(|limb| limb.chain.iter().any(|link| link.bone == bone));
    let mut limb_of: Vec<Option<usize>> = Vec::new();
    for joint in skeleton.joints() {
        let above = joint.parent.and_then(|parent| limb_of[usize::from(parent)]);
        limb_of.push(of_bone(joint.bone).or(above));
    }
    limb_of.extend(skeleton.hanging().iter().map(|hanging| of_bone(skeleton.bone(hanging.joint))));
    limb_of
}

/// For each frame the topmost one that does the same in every sample: they cannot be told apart.
fn classes(skeleton: &Skeleton, transforms: &[Vec<Affine3A>]) -> Vec<usize> {
    let mut classes: Vec<usize> = Vec::new();
    let parents = skeleton.joints().iter().map(|joint| joint.parent);
    let carriers = skeleton.hanging().iter().map(|hanging| Some(hanging.joint));
    for (number, above) in parents.chain(carriers).enumerate() {
        let above = above.map(usize::from);
        let follows = |parent: &usize| transforms.iter().all(|t| t[number].abs_diff_eq(t[*parent], 1e-5));
        classes.push(above.filter(follows).map_or(number, |parent| classes[parent]));
    }
    classes
}

/// The joint of a class that is next above the joint which moves the vertex most; the topmost one where none is above.
fn nearest_of(class: usize, first: &SkinWeights, classes: &[usize], skeleton: &Skeleton) -> usize {
    let most = weights_of(first).max_by(|a, b| a.1.total_cmp(&b.1));
    let mut at = most.map(|(joint, _)| joint);
    while let Some(joint) = at {
        if classes[joint] == class {
            return joint;
        }
        at = skeleton.joints()[joint].parent.map(usize::from);
    }
    class
}

/// The joints that move a vertex, with their weights.
fn weights_of(skin: &SkinWeights) -> impl Iterator<Item = (usize, f64)> + '_ {
    let pairs = skin.joints.iter().zip(&skin.weights).filter(|(_, weight)| **weight > 0);
    pairs.map(|(&joint, &weight)| (usize::from(joint), f64::from(weight) / 65535.0))
}

/// The largest of all joints' weights, as they stand in a pack.
fn largest(weights: &[f64]) -> SkinWeights {
    let mut order: Vec<usize> = (0..weights.len()).collect();
    order.sort_by(|&a, &b| weights[b].total_cmp(&weights[a]));
    // Of joints that move the vertex alike, such as both legs, either all stay or none does.
    let alike = |place: usize| weights[order[place]] - weights[order[place + 1]] < ALIKE;
    let kept = (1..=MOST_JOINTS.min(order.len() - 1)).rev().find(|&kept| !alike(kept - 1)).unwrap_or(MOST_JOINTS);
    order.truncate(kept);
    order.sort_unstable();
    let shares = shares(&order.iter().map(|&joint| weights[joint]).collect::<Vec<_>>());
    let mut skin = SkinWeights::default();
    for (slot, (&joint, &share)) in order.iter().zip(&shares).enumerate() {
        (skin.joints[slot], skin.weights[slot]) = (joint as u8, share);
    }
    skin
}

/// The mean squared error of a vertex as a quadratic form of its weights, which sum to one.
struct System {
    matrix: Vec<f64>,
}

impl System {
    fn new(size: usize) -> System {
        System { matrix: vec![0.0; size * size] }
    }

    /// One sample: where each joint alone would take the vertex, and where it should be.
    fn add(&mut self, places: &[DVec3], wanted: DVec3, share: f64) {
        let size = places.len();
        for i in 0..size {
            for j in 0..size {
                self.matrix[i * size + j] += share * (places[i] - wanted).dot(places[j] - wanted);
            }
        }
    }

    /// The convex weights of allowed frames that are best together with a pull towards `wanted`, from `start`: pair after pair of weights is
    /// exchanged, the pair first that gains most.
    fn solve(&self, start: &[f64], allowed: &[bool], wanted: &[f64], pull: f64) -> Vec<f64> {
        let size = start.len();
        let mut weights = start.to_vec();
        let mut slope: Vec<f64> = (0..size)
            .map(|i| {
                let row = &self.matrix[i * size..(i + 1) * size];
                row.iter().zip(&weights).map(|(a, w)| a * w).sum::<f64>() + pull * (weights[i] - wanted[i])
            })
            .collect();
        for _ in 0..4 * size {
            let free = (0..size).filter(|&i| allowed[i]);
            let to = free.min_by(|&a, &b| slope[a].total_cmp(&slope[b])).expect("start uses allowed frames");
            let used = (0..size).filter(|&i| weights[i] > 0.0);
            let from = used.max_by(|&a, &b| slope[a].total_cmp(&slope[b])).expect("weights sum to one");
            let gain = slope[from] - slope[to];
            if gain < 1e-10 {
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ir::{Body, Driver, Regions, Surface};
    use glam::{Quat, Vec3};
    use kitsuke::skeleton::{Bone, Joint};

    /// A row of vertices along an arm in the T-pose, or along a leg, with one sample in which the second half follows the lower limb.
    fn limb(group_of_other: &str) -> (ir::Garment, Vec<SkinWeights>) {
        let joint = |bone, parent, x| Joint { bone, parent, rest_m: Vec3::new(x, 1.2, 0.0) };
        let skeleton = Skeleton::new(vec![
            joint(Bone::Hips, None, 0.0),
            joint(Bone::LeftUpperArm, Some(0), 0.2),
            joint(Bone::LeftLowerArm, Some(1), 0.5),
            joint(Bone::RightUpperArm, Some(0), -0.2),
        ])
        .unwrap();
        let bones = vec![Bone::LeftUpperArm, Bone::LeftLowerArm, Bone::RightUpperArm];
        let place = |v: u32| Vec3::new(0.25 + 0.05 * (v / 2) as f32, 1.2, 0.05 * (v % 2) as f32);
        let base = Surface {
            positions_m: (0..24).map(place).collect(),
            triangles: (0..22).map(|v| [v, v + 1, v + 2]).collect(),
            ..Surface::default()
        };
        let rotations = vec![Quat::from_rotation_z(-0.5), Quat::from_rotation_y(-1.2), Quat::IDENTITY];
        let driver = |name: &str, group: &str, joint| Driver {
            name: name.into(),
            group: group.into(),
            joints: vec![joint],
            threshold_rad: 1.0,
            layer: 0,
        };
        let drivers = vec![
            driver("upper", "left", bones[0]),
            driver("lower", "left", bones[1]),
            driver("other", group_of_other, bones[2]),
        ];
        let mut target =
            TargetShape { name: "bent".into(), file: "bent.obj".into(), layer: 0, rotations, positions_m: Vec::new() };
        let mut posed_from_rest = vec![Affine3A::IDENTITY; 4];
        skeleton.posed_from_rest(&pose_of(&bones, &target), &mut posed_from_rest);
        let follows = |v: usize| if v < 12 { 1 } else { 2 };
        target.positions_m = base
            .positions_m
            .iter()
            .enumerate()
            .map(|(v, p)| posed_from_rest[follows(v)].transform_point3(*p))
            .collect();
        let source = ir::Garment {
            id: "arm".into(),
            name: "arm".into(),
            base,
            body: Body { surface: Surface::default(), skeleton, skin: Vec::new() },
            obi: None,
            texture: None,
            texture_in_pack: false,
            body_name: String::new(),
            pose_bones: bones,
            targets: vec![target],
            drivers,
            pose_limits: Vec::new(),
            regions: Regions::Auto,
            correctives: 0,
            paths: Vec::new(),
            sizes: None,
            rules: Vec::new(),
            budget_m: 5e-5,
            speed_budget_m: None,
            unseen_budget_m: None,
            inside_budget_m: None,
        };
        let upper = SkinWeights { joints: [1, 0, 0, 0], weights: [65535, 0, 0, 0] };
        (source, vec![upper; 24])
    }

    fn weight(skin: &SkinWeights, joint: u8) -> f64 {
        let of_joint = skin.joints.iter().zip(&skin.weights).filter(|(other, _)| **other == joint);
        of_joint.map(|(_, &weight)| f64::from(weight) / 65535.0).sum()
    }

    #[test]
    fn weights_follow_the_joint_that_the_sample_shows() {
        let (source, first) = limb("right");
        let fitted = fitted(&source, &first, &Settings::default());
        for (v, skin) in fitted.iter().enumerate() {
            assert_eq!(skin.weights.iter().map(|&w| u32::from(w)).sum::<u32>(), 65535);
            let lower = weight(skin, 2);
            // Near the elbow neighbours of either side hold each other.
            assert!(if v < 8 { lower < 0.2 } else { v < 16 || lower > 0.8 }, "vertex {v}: {lower}");
        }
        assert!(fitted.windows(3).all(|near| (weight(&near[2], 2) - weight(&near[0], 2)).abs() < 0.5));
    }

    #[test]
    fn cloth_round_two_limbs_keeps_its_weights() {
        let (source, first) = limb("left");
        assert_eq!(fitted(&source, &first, &Settings::default()), first);
    }
}
