//! A garment's targets as morph targets: plain sums of weight times delta, as glTF has them. There are no masks there, so what a mask lets
//! through of a target becomes part of the deltas. Knows no file.

use crate::stages::correctives::shares;
use crate::stages::matrix::principal;
use glam::{DVec3, Vec3};
use kitsuke::Garment;
use kitsuke::Rates;
use kitsuke::arrays::{GarmentData, Target};
use kitsuke::skeleton::Pose;
use rayon::prelude::*;
use std::collections::BTreeSet;

/// Blender cuts names after so many bytes of UTF-8.
const NAME_BYTES: usize = 63;
/// Components whose share of the movement is below this are nothing, of the largest.
const NOTHING: f64 = 1e-12;

/// A morph target.
#[derive(Clone, Debug, PartialEq)]
pub struct Morph {
    /// Unlike all others of the file.
    pub name: String,
    /// Per unique vertex, metres.
    pub deltas_m: Vec<Vec3>,
}

/// Morph targets and how much each counts, frame by frame.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Animated {
    /// The morph targets.
    pub morphs: Vec<Morph>,
    /// One row per frame.
    pub weights: Vec<Vec<f32>>,
    /// How much each counts in the base.
    pub rest: Vec<f32>,
    /// What the base is moved by where all weights are 0, per unique vertex, metres.
    pub offset_m: Vec<Vec3>,
}

/// One morph target for each sample: with weight 1 and its pose the sample's shape. Correctives belong to no pose and are left out.
pub fn of_samples(garment: &Garment) -> Animated {
    let data = garment.data();
    let all: Vec<u8> = (0..data.drivers.len() as u8).collect();
    let samples = &data.targets[..data.sample_count()];
    let morphs = samples.iter().map(|target| (target.name.clone(), masked(data, target, &all)));
    Animated::from_base(garment, named(morphs), Vec::new())
}

/// Morph targets as the drivers blend them in these poses, which may choose otherwise for each arm: one for each target and group of drivers
/// that ever counts. With every weight from 0 to 1, because programs clamp or cut others: what counts beyond is scaled into the deltas, what
/// counts against them moves the base.
pub fn of_poses(garment: &Garment, poses: &[Pose]) -> Animated {
    let data = garment.data();
    let groups = groups(data);
    let mut rates = Rates::new(data);
    let rows: Vec<Vec<f32>> = poses
        .iter()
        .map(|pose| {
            garment.blend_rates(garment.kernel(), &pose.sanitised(), &mut rates);
            groups.iter().flat_map(|(_, drivers)| rates.driver(usize::from(drivers[0])).iter().copied()).collect()
        })
        .collect();
    let counts = |column: &usize| rows.iter().any(|row| row[*column] != 0.0);
    let columns: Vec<usize> = (0..groups.len() * data.targets.len()).filter(counts).collect();
    let morph = |&column: &usize| {
        let ((group, drivers), target) =
            (&groups[column / data.targets.len()], &data.targets[column % data.targets.len()]);
        let is_only = groups.iter().filter(|(_, other)| layer(data, other) == target.layer).count() == 1;
        let name = if is_only { target.name.clone() } else { format!("{group} {}", target.name) };
        (name, masked(data, target, drivers))
    };
    let weights = rows.iter().map(|row| columns.iter().map(|&column| row[column]).collect()).collect();
    let morphs = named(columns.iter().map(morph));
    Animated::from_base(garment, morphs, weights)
}

/// The layer of a group's drivers.
fn layer(data: &GarmentData, drivers: &[u8]) -> u8 {
    data.drivers[usize::from(drivers[0])].layer
}

/// Drivers that always have the same rates: the groups of the default kernel, else each by itself.
fn groups(data: &GarmentData) -> Vec<(String, Vec<u8>)> {
    match &data.rbf {
        Some(rbf) => {
            let groups = rbf.layers.iter().flat_map(|layer| &layer.groups);
            groups.filter(|g| !g.drivers.is_empty()).map(|g| (g.name.clone(), g.drivers.clone())).collect()
        }
        None => (0..).zip(&data.drivers).map(|(number, driver)| (driver.name.clone(), vec![number])).collect(),
    }
}

/// What the masks of these drivers, those of its layer, let through of a target, per unique vertex.
fn masked(data: &GarmentData, target: &Target, drivers: &[u8]) -> Vec<Vec3> {
    let own: Vec<u8> =
        drivers.iter().copied().filter(|&driver| data.drivers[usize::from(driver)].layer == target.layer).collect();
    let shares = shares(&data.segments, &own);
    let mut deltas_m = vec![Vec3::ZERO; data.mesh.positions_m.len()];
    for (v, delta) in target.vertices(&data.segments).zip(&target.deltas) {
        deltas_m[v] = Vec3::from_array(delta.map(f32::from)) * (target.step_m * shares[v]);
    }
    deltas_m
}

/// Names that differ within the bytes that all programs keep.
fn named(morphs: impl Iterator<Item = (String, Vec<Vec3>)>) -> Vec<Morph> {
    let mut known = BTreeSet::new();
    let morph = |(name, deltas_m): (String, Vec<Vec3>)| {
        let mut unlike = cut(&name, NAME_BYTES).to_owned();
        for number in 2.. {
            if known.insert(unlike.clone()) {
                break;
            }
            let end = format!(" {number}");
            unlike = cut(&name, NAME_BYTES - end.len()).to_owned() + &end;
        }
        Morph { name: unlike, deltas_m }
    };
    morphs.map(morph).collect()
}

/// The longest beginning of so many bytes that is whole.
fn cut(name: &str, bytes: usize) -> &str {
    &name[..name.floor_char_boundary(bytes)]
}

impl Animated {
    /// Morph targets whose weights, per frame and target, are 0 at the base.
    fn from_base(garment: &Garment, morphs: Vec<Morph>, weights: Vec<Vec<f32>>) -> Animated {
        Animated { rest: vec![0.0; morphs.len()], morphs, weights, offset_m: vec![Vec3::ZERO; garment.unique_count()] }
    }

    /// The most movement that so few morph targets can show: those whose weighted sums come nearest to these over all frames and vertices, by
    /// the sum of squares (the principal components of the movement).
    pub fn condensed(&self, most: usize) -> Animated {
        let count = self.morphs.len();
        if count <= most {
            return self.clone();
        }
        let dot =
            |a: &[Vec3], b: &[Vec3]| -> f64 { a.iter().zip(b).map(|(a, b)| a.as_dvec3().dot(b.as_dvec3())).sum() };
        let products: Vec<Vec<f64>> = (0..count)
            .into_par_iter()
            .map(|i| (0..count).map(|j| dot(&self.morphs[i].deltas_m, &self.morphs[j].deltas_m)).collect())
            .collect();
        // The deltas by directions that are orthogonal: D = A U, with A the root of the products.
        let directions: Vec<(f64, Vec<f64>)> = principal(count, |i, j| products[i][j]);
        let least = NOTHING * directions[0].0;
        let directions: Vec<(f64, Vec<f64>)> = directions.into_iter().filter(|(size, _)| *size > least).collect();
        let along = |row: &[f32]| -> Vec<f64> {
            let sum = |(size, direction): &(f64, Vec<f64>)| {
                size.sqrt() * row.iter().zip(direction).map(|(&weight, share)| f64::from(weight) * share).sum::<f64>()
            };
            directions.iter().map(sum).collect()
        };
        let rows: Vec<Vec<f64>> = self.weights.iter().map(|row| along(row)).collect();
        let moved = principal(directions.len(), |i, j| rows.iter().map(|row| row[i] * row[j]).sum());
        let mut condensed = Animated { offset_m: self.offset_m.clone(), ..Animated::default() };
        condensed.weights = vec![Vec::new(); rows.len()];
        for (number, (_, component)) in moved.iter().take(most).enumerate() {
            // Back from the orthogonal directions to the deltas, so that weights are about as large as before.
            let shares: Vec<f64> = (0..count)
                .map(|k| {
                    let of = |((size, direction), along): (&(f64, Vec<f64>), &f64)| direction[k] * along / size.sqrt();
                    directions.iter().zip(component).map(of).sum()
                })
                .collect();
            let weights: Vec<f64> =
                rows.iter().map(|row| row.iter().zip(component).map(|(a, b)| a * b).sum()).collect();
            let largest = weights.iter().fold(0.0f64, |most, weight| most.max(weight.abs()));
            let scale = if largest > 0.0 { largest } else { 1.0 };
            let delta_m = |v: usize| {
                let sum: DVec3 = self.morphs.iter().zip(&shares).map(|(m, s)| m.deltas_m[v].as_dvec3() * *s).sum();
                (sum * scale).as_vec3()
            };
            let deltas_m = (0..self.offset_m.len()).into_par_iter().map(delta_m).collect();
            condensed.morphs.push(Morph { name: format!("component {}", number + 1), deltas_m });
            condensed.rest.push(0.0);
            for (row, weight) in condensed.weights.iter_mut().zip(weights) {
                row.push((weight / scale) as f32);
            }
        }
        condensed
    }

    /// The same with every weight from 0 to 1.
    pub fn within_one(mut self) -> Animated {
        for (k, morph) in self.morphs.iter_mut().enumerate() {
            let least = self.weights.iter().fold(self.rest[k].min(0.0), |least, row| least.min(row[k]));
            let most = self.weights.iter().fold(self.rest[k].max(1.0), |most, row| most.max(row[k]));
            let scale = most - least;
            for (offset_m, delta_m) in self.offset_m.iter_mut().zip(&mut morph.deltas_m) {
                *offset_m += least * *delta_m;
                *delta_m *= scale;
            }
            let within = |weight: f32| ((weight - least) / scale).clamp(0.0, 1.0);
            self.rest[k] = within(self.rest[k]);
            self.weights.iter_mut().for_each(|row| row[k] = within(row[k]));
        }
        self
    }

    /// How far this lies from another of the same frames: mean and largest over frames and vertices before they are posed, which posing does not
    /// enlarge; metres.
    pub fn apart_m(&self, other: &Animated) -> (f64, f64) {
        let of_frame = |frame: usize| {
            let (one, two) = (self.frame_m(frame), other.frame_m(frame));
            let apart = one.iter().zip(&two).map(|(one, two)| f64::from(one.distance(*two)));
            apart.fold((0.0, 0.0f64), |(sum, most), apart| (sum + apart, most.max(apart)))
        };
        let frames: Vec<(f64, f64)> = (0..self.weights.len()).into_par_iter().map(of_frame).collect();
        let sum: f64 = frames.iter().map(|(sum, _)| sum).sum();
        let most = frames.iter().fold(0.0, |most: f64, (_, own)| most.max(*own));
        (sum / (frames.len() * self.offset_m.len()).max(1) as f64, most)
    }

    /// What a frame adds to the base, per unique vertex, metres.
    pub fn frame_m(&self, frame: usize) -> Vec<Vec3> {
        let mut sum_m = self.offset_m.clone();
        for (morph, &weight) in self.morphs.iter().zip(&self.weights[frame]).filter(|(_, weight)| **weight != 0.0) {
            sum_m.iter_mut().zip(&morph.deltas_m).for_each(|(sum_m, delta_m)| *sum_m += *delta_m * weight);
        }
        sum_m
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn animated(count: usize) -> Animated {
        let delta =
            |k: usize, v: usize| Vec3::new((k * v % 5) as f32, (k + v) as f32 - 3.0, (v % (k + 2)) as f32) * 0.01;
        let morph = |k: usize| Morph { name: k.to_string(), deltas_m: (0..12).map(|v| delta(k, v)).collect() };
        let row = |frame: usize| (0..count).map(|k| ((frame * (k + 3)) % 7) as f32 * 0.4 - 0.8).collect();
        let (morphs, weights) = ((0..count).map(morph).collect(), (0..9).map(row).collect());
        Animated { morphs, weights, rest: vec![0.0; count], offset_m: vec![Vec3::ZERO; 12] }
    }

    #[test]
    fn weights_within_one_show_the_same() {
        let before = animated(4);
        let after = before.clone().within_one();
        assert!(after.weights.iter().flatten().chain(&after.rest).all(|weight| (0.0..=1.0).contains(weight)));
        assert!(after.apart_m(&before).1 < 1e-7);
        let mut at_rest = after.clone();
        at_rest.weights = vec![after.rest.clone()];
        assert!(at_rest.frame_m(0).iter().all(|moved_m| moved_m.length() < 1e-7), "the base is the base");
    }

    #[test]
    fn few_components_show_as_much_as_they_can() {
        let all = animated(6);
        let apart: Vec<f64> = (1..=6).map(|most| all.condensed(most).apart_m(&all).0).collect();
        assert!(apart.windows(2).all(|pair| pair[1] <= pair[0] + 1e-9), "{apart:?}");
        assert!(apart[5] < 1e-9 && apart[0] > 1e-4, "{apart:?}");
        // Three frames that repeat are of rank three.
        let mut three = all.clone();
        (3..9).for_each(|frame| three.weights[frame] = three.weights[frame % 3].clone());
        assert!(three.condensed(3).apart_m(&three).1 < 1e-6);
    }

    #[test]
    fn names_differ_within_63_bytes() {
        let long = "袖".repeat(40);
        let named = named([long.clone(), long, "a".into(), "a".into()].into_iter().map(|name| (name, Vec::new())));
        let names: Vec<&str> = named.iter().map(|morph| morph.name.as_str()).collect();
        assert!(names.iter().all(|name| name.len() <= NAME_BYTES), "{names:?}");
        assert_eq!((names[0].chars().count(), names[2], names[3]), (21, "a", "a 2"));
        assert!(names[1].ends_with(" 2") && names[0] != names[1]);
    }
}
