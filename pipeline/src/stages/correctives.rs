//! Correctives: what keeps the cloth out of the body between the samples. Knows a garment's arrays and the wearer's body, not where
//! the poses come from.
//!
//! Blends of sampled shapes are linear and bodies are round, so half way between two good shapes the cloth may lie in a thigh. Here the
//! garment is posed between its samples, the cloth that lies in the body is pushed out, its surroundings follow smoothly, and the pushes
//! of all poses are taken apart into few shapes (principal components). What a shape counts in a new pose is interpolated among
//! those poses by the default kernel, and is 0 at every sample: there the artist's shape stays.

use super::laplacian::Neighbours;
use super::posed_body::PosedBody;
use super::{kernel, matrix};
use crate::ir::Body;
use crate::stages::StageError;
use glam::{Affine3A, DVec3, Mat3, Quat, Vec3};
use kitsuke::arrays::{GarmentData, RbfLayer, Segment, SkinWeights, Target};
use kitsuke::evaluate::{blend, skin};
use kitsuke::pack::write::{moved, quantise};
use kitsuke::pose_blend::rbf::rows_of_layer;
use kitsuke::skeleton::Pose;
use kitsuke::{Garment, Rates, Scratch};
use rayon::prelude::*;

/// Half the diagonal of a cell of the grid, in its steps, and somewhat more: every ball of this radius holds a point of it.
const RADIUS: f32 = 0.9;

/// Cloth this much farther from the body than it should be is not drawn into it by its neighbours, metres.
const NEAR_M: f32 = 0.02;

/// Cloth that its neighbours would move by less stays, metres: a hundredth of what shapes are stored to.
const LEAST_M: f32 = 2e-6;

/// How cloth is pushed.
#[derive(Clone, Debug, PartialEq)]
pub struct Settings {
    /// Poses at which cloth is pushed.
    pub poses: usize,
    /// How far from the body pushed cloth shall lie, where the samples lie as far from it, metres.
    pub clearance_m: f32,
    /// Cloth deeper than this is left alone: it has no near way out, metres.
    pub deepest_m: f32,
    /// How fast a push fades along the cloth: the share of it that each round of smoothing loses.
    pub fading: f32,
    /// How often cloth is pushed and smoothed.
    pub rounds: usize,
    /// Rounds of smoothing after each push.
    pub sweeps: usize,
    /// Pushes are stored to within this, root mean square over the cloth that moves, metres.
    pub tolerance_m: f64,
    /// Most shapes of a group.
    pub shapes: usize,
    /// The grid on which shapes are stored, metres at full rate.
    pub step_m: f32,
}

impl Default for Settings {
    fn default() -> Settings {
        Settings {
            poses: 160,
            clearance_m: 0.004,
            deepest_m: 0.08,
            fading: 0.02,
            rounds: 5,
            sweeps: 40,
            tolerance_m: 0.0002,
            shapes: 8,
            step_m: 0.0002,
        }
    }
}

/// What keeps the cloth of one group's drivers out of the body.
#[derive(Clone, Debug, PartialEq)]
pub struct Correctives {
    /// Shape after shape what each unique vertex is moved by before posing, metres at full rate.
    shapes_m: Vec<Vec<Vec3>>,
    /// Pose after pose what each shape counts, at most 1.
    rates: Vec<f32>,
}

impl Correctives {
    /// As the memo keeps them: how many shapes, their rates, their coordinates.
    pub fn numbers(&self) -> impl Iterator<Item = f32> {
        let coordinates = self.shapes_m.iter().flatten().flat_map(|move_m| move_m.to_array());
        std::iter::once(self.shapes_m.len() as f32).chain(self.rates.iter().copied()).chain(coordinates)
    }

    /// Takes one group's correctives from the front of the memo's numbers.
    fn take(numbers: &mut &[f32], poses: usize, vertices: usize) -> Correctives {
        let mut take = |count: usize| {
            let (taken, rest) = numbers.split_at(count);
            *numbers = rest;
            taken
        };
        let shapes = take(1)[0] as usize;
        let rates = take(poses * shapes).to_vec();
        let shapes_m =
            (0..shapes).map(|_| take(3 * vertices).chunks_exact(3).map(Vec3::from_slice).collect()).collect();
        Correctives { shapes_m, rates }
    }
}

/// The correctives of every group of the default kernel, layer by layer. `poses` lie between the samples; each layer takes from them
/// what its own joints do.
#[must_use]
pub fn correctives(garment: &Garment, body: &Body, poses: &[Pose], settings: &Settings) -> Vec<Correctives> {
    let neighbours = neighbours(garment);
    let mut found = Vec::new();
    for (number, layer) in garment.data().rbf.iter().flat_map(|rbf| rbf.layers.iter().enumerate()) {
        let segments = &garment.data().segments;
        let owners: Vec<Vec<f32>> = layer.groups.iter().map(|group| shares(segments, &group.drivers)).collect();
        let owned: Vec<f32> = (0..garment.unique_count()).map(|v| owners.iter().map(|owner| owner[v]).sum()).collect();
        let clearances_m = clearances(garment, body, number, settings);
        let push =
            Push { garment, body, neighbours: &neighbours, owned: &owned, clearances_m: &clearances_m, settings };
        let pushes: Vec<Vec<Vec3>> = poses.par_iter().map(|pose| push.at(&alone(layer, pose))).collect();
        found.extend(owners.iter().map(|owner| components(&pushes, owner, settings)));
    }
    found
}

/// The garment with these correctives, as [`Correctives::numbers`] of all groups after each other, made for the same poses.
///
/// # Errors
/// When the coefficients cannot be found because two poses cannot be told apart.
pub fn with_correctives(
    garment: &Garment,
    poses: &[Pose],
    mut numbers: &[f32],
    settings: &Settings,
) -> Result<GarmentData, StageError> {
    let mut data = garment.data().clone();
    let layers = garment.data().rbf.iter().flat_map(|rbf| &rbf.layers).enumerate();
    let mut places = Vec::new();
    let mut wanted = Vec::new();
    for (number, layer) in layers {
        for group in &layer.groups {
            let found = Correctives::take(&mut numbers, poses.len(), garment.unique_count());
            for (place, shape_m) in found.shapes_m.iter().enumerate() {
                let name = format!("{} corrective {}", group.name, place + 1);
                let (target, steps) = target(&data, name, number as u8, shape_m, settings.step_m);
                wanted.push(steps);
                data.targets.push(target);
            }
            let turned = poses.iter().map(Pose::with_arms_untwisted);
            let centres: Vec<Quat> =
                turned.flat_map(|pose| group.chain.iter().map(move |joint| pose.rotation(joint.bone))).collect();
            places.push((centres, found.rates));
        }
    }
    data.corrective_count = wanted.len();
    let first = data.targets.len() - wanted.len();
    let moved = moved(&data.segments, data.targets[first..].iter().map(|target| target.segments.as_slice()));
    let quantised = quantise(&data.mesh, &moved, &wanted, RADIUS);
    data.targets[first..].iter_mut().zip(quantised).for_each(|(target, deltas)| target.deltas = deltas);
    kernel::correct(&mut data, &places)?;
    Ok(data)
}

/// The garment as it blends without correctives.
#[must_use]
pub fn without_correctives(data: &GarmentData) -> GarmentData {
    let mut data = data.clone();
    let samples = data.sample_count();
    for number in 0..data.layer_count() {
        let all = data.targets_of_layer(number).count();
        let kept = data.samples_of_layer(number).count();
        let layers = data.rbf.iter_mut().flat_map(|rbf| &mut rbf.layers[number].groups);
        for group in layers {
            for coefficients in [&mut group.own, &mut group.joint] {
                *coefficients = coefficients.chunks_exact(all.max(1)).flat_map(|row| &row[..kept]).copied().collect();
            }
            group.centres.clear();
            group.corrective.clear();
        }
    }
    data.targets.truncate(samples);
    data.corrective_count = 0;
    data
}

/// What a layer takes from a pose.
fn alone(layer: &RbfLayer, pose: &Pose) -> Pose {
    let joints = layer.groups.iter().flat_map(|group| &group.chain);
    joints.fold(Pose::REST, |alone, joint| alone.with(joint.bone, pose.rotation(joint.bone)))
}

/// The cloth, seams closed.
fn neighbours(garment: &Garment) -> Neighbours {
    let mesh = &garment.data().mesh;
    let triangles: Vec<[u32; 3]> = mesh.triangles.iter().map(|corners| corners.map(|v| mesh.unique(v))).collect();
    Neighbours::new(&mesh.positions_m, &triangles)
}

/// How much of each vertex some drivers own, 0 to 1.
pub(crate) fn shares(segments: &[Segment], drivers: &[u8]) -> Vec<f32> {
    let mut shares = Vec::new();
    for segment in segments {
        let width = segment.drivers.len();
        for v in 0..segment.vertex_count as usize {
            let mask = |column: usize| match segment.masks.is_empty() {
                true => 1.0,
                false => f32::from(segment.masks[v * width + column]) / 65535.0,
            };
            let own = (0..width).filter(|&column| drivers.contains(&segment.drivers[column]));
            shares.push(own.map(mask).sum());
        }
    }
    shares
}

/// How far from the body each vertex shall stay: as far as in every sample of the layer, at most as far as set, at least outside.
fn clearances(garment: &Garment, body: &Body, layer: usize, settings: &Settings) -> Vec<f32> {
    let rows = rows_of_layer(garment.data(), layer);
    let of_row = |row: &usize| {
        let pose = garment.data().poses.pose(*row);
        let posed_m = posed(garment, &pose);
        let body = PosedBody::new(body, &pose);
        let distance = |place: &Vec3| body.place(*place, settings.clearance_m, settings.deepest_m);
        posed_m.iter().map(|place| distance(place).map_or(settings.clearance_m, |place| place.0)).collect()
    };
    let of_rows: Vec<Vec<f32>> = rows.par_iter().map(of_row).collect();
    let least = |v: usize| of_rows.iter().map(|row: &Vec<f32>| row[v]).fold(settings.clearance_m, f32::min).max(0.0);
    (0..garment.unique_count()).map(least).collect()
}

/// The unique vertices in a pose, blended by the garment's own kernel, metres.
pub(crate) fn posed(garment: &Garment, pose: &Pose) -> Vec<Vec3> {
    let (mut scratch, mut rates) = (Scratch::new(garment), Rates::new(garment.data()));
    let mut positions_m = vec![Vec3::ZERO; garment.unique_count()];
    garment.blend_rates(garment.kernel(), pose, &mut rates);
    blend(garment, &rates, &mut scratch);
    skin(garment, pose, &mut scratch, &mut positions_m);
    positions_m
}

/// Pushes cloth out of the body in one pose.
struct Push<'a> {
    garment: &'a Garment,
    body: &'a Body,
    neighbours: &'a Neighbours,
    /// How much of each vertex the layer owns.
    owned: &'a [f32],
    clearances_m: &'a [f32],
    settings: &'a Settings,
}

impl Push<'_> {
    /// What each vertex has to be moved by before posing, metres.
    fn at(&self, pose: &Pose) -> Vec<Vec3> {
        let settings = self.settings;
        let body = PosedBody::new(self.body, pose);
        let blended_m = posed(self.garment, pose);
        let count = blended_m.len();
        let mut moves_m = vec![Vec3::ZERO; count];
        let mut is_held: Vec<bool> = self.owned.iter().map(|&owned| owned < 0.5).collect();
        // Cloth that is far from the body stays far: later rounds only look at what is near.
        let mut near: Vec<usize> = (0..count).filter(|&v| !is_held[v]).collect();
        // How far each vertex lay when it was last looked at, and how far it had been moved: it is nearer by what it moved since at most.
        let mut seen = vec![(0.0, Vec3::ZERO); count];
        for _ in 0..settings.rounds {
            let mut pushed = false;
            near.retain(|&v| {
                let wanted_m = self.clearances_m[v];
                let (lay_m, moved_m) = seen[v];
                if lay_m - moves_m[v].distance(moved_m) > wanted_m {
                    return true;
                }
                let place = body.place(blended_m[v] + moves_m[v], wanted_m + NEAR_M, settings.deepest_m);
                let Some((distance_m, outward)) = place else { return false };
                seen[v] = (distance_m, moves_m[v]);
                if distance_m < wanted_m {
                    moves_m[v] += (wanted_m - distance_m) * outward;
                    is_held[v] = true;
                    pushed = true;
                }
                true
            });
            if !pushed {
                break;
            }
            self.smooth(&mut moves_m, &is_held);
        }
        self.unposed(pose, &moves_m)
    }

    /// Lets the vertices that are not held follow their neighbours. What is around those that move is looked at, and no other.
    fn smooth(&self, moves_m: &mut [Vec3], is_held: &[bool]) {
        let mut may_move = vec![false; moves_m.len()];
        for v in (0..moves_m.len()).filter(|&v| moves_m[v] != Vec3::ZERO) {
            self.neighbours.of(v).iter().for_each(|&n| may_move[n as usize] = true);
        }
        for _ in 0..self.settings.sweeps {
            for v in 0..moves_m.len() {
                if !may_move[v] || is_held[v] {
                    continue;
                }
                let near = self.neighbours.of(v);
                let sum: Vec3 = near.iter().map(|&n| moves_m[n as usize]).sum();
                let move_m = sum * ((1.0 - self.settings.fading) / near.len() as f32);
                if move_m.length_squared() < LEAST_M * LEAST_M {
                    moves_m[v] = Vec3::ZERO;
                    continue;
                }
                if moves_m[v] == Vec3::ZERO {
                    near.iter().for_each(|&n| may_move[n as usize] = true);
                }
                moves_m[v] = move_m;
            }
        }
    }

    /// Moves of posed cloth as moves of cloth before posing.
    fn unposed(&self, pose: &Pose, moves_m: &[Vec3]) -> Vec<Vec3> {
        let data = self.garment.data();
        let mut posed_from_rest = vec![Affine3A::IDENTITY; data.skeleton.frame_count()];
        data.skeleton.posed_from_rest(&pose.with_arms_untwisted(), &mut posed_from_rest);
        let unposed = |((move_m, skin), owned): ((&Vec3, &SkinWeights), &f32)| {
            if move_m.length_squared() < 1e-12 {
                return Vec3::ZERO;
            }
            let mut turned = Mat3::ZERO;
            for (&joint, &weight) in skin.joints.iter().zip(&skin.weights) {
                let matrix: Mat3 = posed_from_rest[usize::from(joint)].matrix3.into();
                turned += matrix * (f32::from(weight) / 65535.0);
            }
            // Where joints turned far against each other crush the cloth, a move has no counterpart.
            if turned.determinant() < 0.1 { Vec3::ZERO } else { turned.inverse() * *move_m / owned.max(0.5) }
        };
        moves_m.iter().zip(&data.skin).zip(self.owned).map(unposed).collect()
    }
}

/// Principal components of the pushes, weighted by how much of each vertex the group owns.
fn components(pushes_m: &[Vec<Vec3>], owner: &[f32], settings: &Settings) -> Correctives {
    let count = pushes_m.len();
    let is_moved = |v: &usize| owner[*v] > 0.0 && pushes_m.iter().any(|push| push[*v] != Vec3::ZERO);
    let moved: Vec<usize> = (0..owner.len()).filter(is_moved).collect();
    let product = |i: usize, j: usize| -> f64 {
        let at = |&v: &usize| f64::from(owner[v]) * f64::from(pushes_m[i][v].dot(pushes_m[j][v]));
        moved.iter().map(at).sum()
    };
    let upper: Vec<Vec<f64>> =
        (0..count).into_par_iter().map(|i| (i..count).map(|j| product(i, j)).collect()).collect();
    let components = matrix::principal(count, |i, j| upper[i.min(j)][i.max(j) - i.min(j)]);
    let numbers = (count * moved.len()).max(1) as f64;
    let mut left: f64 = components.iter().map(|(value, _)| value.max(0.0)).sum();
    let mut chosen: Vec<&[f64]> = Vec::new();
    for (value, vector) in components.iter().take(settings.shapes) {
        if (left / numbers).sqrt() <= settings.tolerance_m {
            break;
        }
        left -= value;
        chosen.push(vector);
    }
    // The pushes P are about Σ u (uᵀ P); the largest entry of each u is divided out of the rates.
    let most: Vec<f64> = chosen.iter().map(|vector| vector.iter().fold(0.0f64, |most, u| most.max(u.abs()))).collect();
    let shape = |(vector, most): (&&[f64], &f64)| {
        let mut shape_m = vec![Vec3::ZERO; owner.len()];
        for &v in &moved {
            let sum: DVec3 = pushes_m.iter().zip(*vector).map(|(push, u)| push[v].as_dvec3() * *u).sum();
            shape_m[v] = (sum * *most).as_vec3();
        }
        shape_m
    };
    let shapes_m = chosen.iter().zip(&most).map(shape).collect();
    let rates =
        (0..count).flat_map(|pose| chosen.iter().zip(&most).map(move |(vector, most)| (vector[pose] / most) as f32));
    Correctives { shapes_m, rates: rates.collect() }
}

/// A shape as a target yet without deltas, and its steps, not yet whole. Segments in which nothing moves by a step are left out.
fn target(data: &GarmentData, name: String, layer: u8, shape_m: &[Vec3], step_m: f32) -> (Target, Vec<Vec3>) {
    let mut target = Target { name, layer, step_m, segments: Vec::new(), deltas: Vec::new() };
    let mut steps = Vec::new();
    let mut rest = shape_m;
    for (number, segment) in data.segments.iter().enumerate() {
        let (run, after) = rest.split_at(segment.vertex_count as usize);
        rest = after;
        let is_driven = segment.drivers.iter().any(|&driver| data.drivers[usize::from(driver)].layer == layer);
        if is_driven && run.iter().any(|move_m| move_m.length() > step_m) {
            target.segments.push(number as u16);
            steps.extend(run.iter().map(|move_m| *move_m / step_m));
        }
    }
    (target, steps)
}
