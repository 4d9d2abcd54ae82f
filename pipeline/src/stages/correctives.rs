//! Correctives: what keeps the cloth out of the body between the samples. Knows a garment's arrays and the wearer's body, not where
//! the poses come from.
//!
//! Blends of sampled shapes are linear and bodies are round, so half way between two good shapes the cloth may lie in a thigh. Here the
//! garment is posed between its samples, the cloth that lies in the body is pushed out, its surroundings follow smoothly, and the pushes
//! of all poses are taken apart into few shapes (principal components). What a shape counts in a new pose is interpolated among
//! those poses by the default kernel, and is 0 at every sample: there the artist's shape stays.

use super::kernel;
use super::laplacian::Neighbours;
use super::posed_body::PosedBody;
use crate::ir::Body;
use crate::stages::StageError;
use glam::{Affine3A, Mat3, Quat, Vec3};
use kitsuke::arrays::{GarmentData, Segment, Target};
use kitsuke::evaluate::{blend, skin};
use kitsuke::pack::write::{Wanted, quantise};
use kitsuke::skeleton::{Bone, Pose};
use kitsuke::{Garment, Rates, Scratch};
use rayon::prelude::*;

/// How cloth is pushed.
#[derive(Clone, Debug, PartialEq)]
pub struct Settings {
    /// Poses at which cloth is pushed, per layer.
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
            tolerance_m: 0.0005,
            shapes: 12,
            step_m: 0.0002,
        }
    }
}

/// The garment with correctives for all layers.
///
/// `poses` are poses between the samples; each layer takes from them what its joints do.
///
/// # Errors
/// When the coefficients cannot be found, which for finite poses they can.
pub fn with_correctives(
    garment: &Garment,
    body: &Body,
    poses: &[Pose],
    settings: &Settings,
) -> Result<GarmentData, StageError> {
    let mut data = garment.data().clone();
    let Some(rbf) = &garment.data().rbf else { return Ok(data) };
    let cloth = Cloth::new(garment);
    let mut shapes = Vec::new();
    for (number, layer) in rbf.layers.iter().enumerate() {
        let owners: Vec<Vec<f32>> = layer.groups.iter().map(|group| shares(&data.segments, &group.drivers)).collect();
        let all: Vec<f32> = (0..garment.unique_count()).map(|v| owners.iter().map(|owner| owner[v]).sum()).collect();
        let clearances_m = clearances(garment, body, number, settings);
        let joints: Vec<Bone> = layer.groups.iter().flat_map(|g| &g.chain).map(|joint| joint.bone).collect();
        let alone = |pose: &Pose| joints.iter().fold(Pose::REST, |alone, &bone| alone.with(bone, pose.rotation(bone)));
        let poses: Vec<Pose> = poses.iter().take(settings.poses).map(alone).collect();
        let pushes: Vec<Vec<Vec3>> = poses
            .par_iter()
            .map(|pose| {
                let push = Push { garment, body, cloth: &cloth, owned: &all, clearances_m: &clearances_m, settings };
                push.at(pose)
            })
            .collect();
        for (group, owner) in layer.groups.iter().zip(&owners) {
            let basis = Basis::new(&pushes, owner, settings);
            let bones: Vec<Bone> = group.chain.iter().map(|joint| joint.bone).collect();
            let centres: Vec<Quat> = poses
                .iter()
                .flat_map(|pose| {
                    let pose = pose.with_arms_untwisted();
                    bones.iter().map(move |&bone| pose.rotation(bone)).collect::<Vec<_>>()
                })
                .collect();
            if let Ok(dir) = std::env::var("DUMP") {
                let mut chain = group.chain.clone();
                chain.iter_mut().for_each(|j| (j.swing, j.twist) = (1.0, 1.0));
                let mut out = String::new();
                let rows = kitsuke::pose_blend::rbf::rows_of_layer(&data, number);
                let es = kitsuke::pose_blend::rbf::embed_samples(&chain, &data.poses, &rows);
                let ec = kitsuke::pose_blend::rbf::embed_rows(&chain, &centres);
                let len = kitsuke::pose_blend::rbf::embedding_length(&chain);
                let s = basis.shapes_m.len();
                let norms: Vec<f64> = basis.shapes_m.iter().map(|x| x.iter().zip(owner).map(|(d, o)| f64::from(d.length_squared() * o)).sum::<f64>().sqrt()).collect();
                for (i, e) in es.chunks(len).chain(ec.chunks(len)).enumerate() {
                    let r = i as isize - rows.len() as isize;
                    let vals: Vec<f64> = if r < 0 { vec![0.0; s] } else { (0..s).map(|k| basis.rates[r as usize * s + k] * norms[k]).collect() };
                    out += &e.iter().chain(&vals).map(|x| format!("{x:.6}")).collect::<Vec<_>>().join(" ");
                    out += "\n";
                }
                std::fs::write(format!("{dir}/{}_{}_{}.txt", group.name, rows.len(), s), out).unwrap();
            }
            shapes.push((number, group.name.clone(), centres, basis));
        }
    }
    append(&mut data, &shapes, settings)?;
    Ok(data)
}

/// Vertices and their neighbours.
struct Cloth {
    neighbours: Neighbours,
}

impl Cloth {
    fn new(garment: &Garment) -> Cloth {
        let mesh = &garment.data().mesh;
        let unique = garment.unique_count();
        let original = |v: u32| (v as usize).checked_sub(unique).map_or(v, |twin| mesh.twin_of[twin]);
        let triangles: Vec<[u32; 3]> = mesh.triangles.iter().map(|t| t.map(original)).collect();
        Cloth { neighbours: Neighbours::new(&mesh.positions_m, &triangles) }
    }
}

/// How much of each vertex some drivers own, 0 to 1.
fn shares(segments: &[Segment], drivers: &[u8]) -> Vec<f32> {
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
    let rows = kitsuke::pose_blend::rbf::rows_of_layer(garment.data(), layer);
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

fn posed(garment: &Garment, pose: &Pose) -> Vec<Vec3> {
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
    cloth: &'a Cloth,
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
        let is_fixed = is_held.clone();
        for _ in 0..settings.rounds {
            let mut pushed = false;
            for v in (0..count).filter(|&v| !is_fixed[v]) {
                let place = blended_m[v] + moves_m[v];
                let wanted_m = self.clearances_m[v];
                let Some((distance_m, outward)) = body.place(place, wanted_m, settings.deepest_m) else { continue };
                if distance_m < wanted_m {
                    moves_m[v] += (wanted_m - distance_m) * outward;
                    is_held[v] = true;
                    pushed = true;
                }
            }
            if !pushed {
                break;
            }
            self.smooth(&mut moves_m, &is_held);
        }
        if std::env::var("DBG").is_ok() {
            let mut left = (0..count).filter(|&v| !is_fixed[v]).filter_map(|v| body.place(blended_m[v] + moves_m[v], 0.0, 0.08)).map(|p| -p.0).collect::<Vec<_>>();
            left.sort_by(f32::total_cmp);
            let most = moves_m.iter().map(|m| m.length()).fold(0.0, f32::max);
            let un = self.unposed(pose, &moves_m).iter().map(|m| m.length()).fold(0.0, f32::max);
            eprintln!("pushed at most {:.1} mm, unposed {:.1}; left {} inside, deepest {:.2} mm", most * 1e3, un * 1e3, left.iter().filter(|d| **d > 0.001).count(), left.last().unwrap_or(&0.0) * 1e3);
        }
        self.unposed(pose, &moves_m)
    }

    /// Lets the vertices that are not held follow their neighbours.
    fn smooth(&self, moves_m: &mut [Vec3], is_held: &[bool]) {
        for _ in 0..self.settings.sweeps {
            for v in (0..moves_m.len()).filter(|&v| !is_held[v]) {
                let near = self.cloth.neighbours.of(v);
                if !near.is_empty() {
                    let sum: Vec3 = near.iter().map(|&n| moves_m[n as usize]).sum();
                    moves_m[v] = sum * ((1.0 - self.settings.fading) / near.len() as f32);
                }
            }
        }
    }

    /// Moves of posed cloth as moves of cloth before posing.
    fn unposed(&self, pose: &Pose, moves_m: &[Vec3]) -> Vec<Vec3> {
        let data = self.garment.data();
        let mut posed_from_rest = vec![Affine3A::IDENTITY; data.skeleton.joints().len()];
        data.skeleton.posed_from_rest(&pose.with_arms_untwisted(), &mut posed_from_rest);
        let unposed = |((move_m, skin), owned): ((&Vec3, &kitsuke::arrays::SkinWeights), &f32)| {
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

/// Principal components of the pushes of a group.
struct Basis {
    /// Shape after shape, metres at full rate.
    shapes_m: Vec<Vec<Vec3>>,
    /// Pose after pose what each shape counts, at most 1.
    rates: Vec<f64>,
}

impl Basis {
    fn new(pushes_m: &[Vec<Vec3>], owner: &[f32], settings: &Settings) -> Basis {
        let count = pushes_m.len();
        let moving: Vec<usize> = (0..owner.len())
            .filter(|&v| owner[v] > 0.0 && pushes_m.iter().any(|push| push[v] != Vec3::ZERO))
            .collect();
        let product = |i: usize, j: usize| -> f64 {
            let dot = |&v: &usize| f64::from(owner[v]) * f64::from(pushes_m[i][v].dot(pushes_m[j][v]));
            moving.iter().map(dot).sum()
        };
        let upper: Vec<Vec<f64>> =
            (0..count).into_par_iter().map(|i| (i..count).map(|j| product(i, j)).collect()).collect();
        let gram = |i: usize, j: usize| upper[i.min(j)][i.max(j) - i.min(j)];
        let components = kernel::principal(count, gram);
        let mut left: f64 = components.iter().map(|(value, _)| value.max(0.0)).sum();
        let scale = (count * moving.len().max(1)) as f64;
        let mut chosen = Vec::new();
        for (value, vector) in components.iter().take(settings.shapes) {
            if (left / scale).sqrt() < settings.tolerance_m {
                break;
            }
            left -= value;
            chosen.push(vector);
        }
        eprintln!(
            "basis: {} poses, {} moving vertices, {} shapes, left rms {:.2} mm (all {:.2} mm)",
            count,
            moving.len(),
            chosen.len(),
            (left.max(0.0) / scale).sqrt() * 1e3,
            (components.iter().map(|c| c.0.max(0.0)).sum::<f64>() / scale).sqrt() * 1e3
        );
        let mut shapes_m = Vec::new();
        let mut rates = vec![0.0; count * chosen.len()];
        for (s, vector) in chosen.iter().enumerate() {
            // P ≈ Σ u (uᵀ P): the shape is uᵀ P times the largest entry of u.
            let most = vector.iter().fold(0.0f64, |most, u| most.max(u.abs()));
            let mut shape_m = vec![Vec3::ZERO; owner.len()];
            for &v in &moving {
                let sum: glam::DVec3 = pushes_m.iter().zip(vector.iter()).map(|(push, u)| push[v].as_dvec3() * *u).sum();
                shape_m[v] = (sum * most).as_vec3();
            }
            shapes_m.push(shape_m);
            (0..count).for_each(|pose| rates[pose * chosen.len() + s] = vector[pose] / most);
        }
        Basis { shapes_m, rates }
    }
}

/// Adds the shapes of all groups to the garment.
fn append(
    data: &mut GarmentData,
    shapes: &[(usize, String, Vec<Quat>, Basis)],
    settings: &Settings,
) -> Result<(), StageError> {
    let samples = data.targets.len();
    let mut wanted = Vec::new();
    for (layer, name, _, basis) in shapes {
        for (number, shape_m) in basis.shapes_m.iter().enumerate() {
            let mut segments = Vec::new();
            let mut steps = Vec::new();
            let mut start = 0;
            for (s, segment) in data.segments.iter().enumerate() {
                let run = &shape_m[start..start + segment.vertex_count as usize];
                start += segment.vertex_count as usize;
                let is_driven = segment.drivers.iter().any(|&d| usize::from(data.drivers[usize::from(d)].layer) == *layer);
                if is_driven && run.iter().any(|delta| delta.length() > settings.step_m) {
                    segments.push(s as u16);
                    steps.extend(run.iter().map(|delta| *delta / settings.step_m));
                }
            }
            wanted.push(Wanted { segments: segments.clone(), steps });
            data.targets.push(Target {
                name: format!("{name} corrective {}", number + 1),
                layer: *layer as u8,
                step_m: settings.step_m,
                segments,
                deltas: Vec::new(),
            });
        }
    }
    for (target, deltas) in data.targets[samples..].iter_mut().zip(quantise(&data.mesh, &data.segments, &wanted, 0.9)) {
        target.deltas = deltas;
    }
    data.corrective_count = data.targets.len() - samples;
    kernel::correct(data, shapes.iter().map(|(_, _, centres, basis)| (centres.as_slice(), basis.rates.as_slice())))
}
