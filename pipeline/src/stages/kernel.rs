//! The default kernel of a garment: which turning of which joint matters how much to the shape, and the coefficients
//! that interpolate the samples. Knows the arrays of a pack; how they are used per frame stands in
//! [`kitsuke::pose_blend::rbf`].
//!
//! Every layer is fitted by itself. What matters is decided by leaving one sample out: every target's shape is predicted from the other samples, and
//! the scales are chosen so that these predictions err least, measured on the cloth, not on the rates. Each trial costs
//! only matrices as large as the number of samples, because the error of a blend is a quadratic form of its rates, and all predictions
//! of a trial come out of one inverse.
//!
//! What one arm does is a sample of the other arm, too, mirrored and less believed. Its shape is written as a blend of the arm's own
//! samples, as nearly as that can be (`mirror`), so that it costs a frame nothing but the comparison of poses.

use super::matrix::Matrix;
use super::mirror::{Shapes, shapes};
use crate::ir;
use crate::stages::StageError;
use argmin::core::{CostFunction, Executor, State};
use argmin::solver::neldermead::NelderMead;
use glam::{DVec3, Quat};
use kitsuke::arrays::{ChainJoint, GarmentData, Group, Rbf, RbfLayer};
use kitsuke::pose_blend::rbf::{
    embed_known, embed_rows, embed_samples, embedding_length, inverse_multiquadric, rows_of_layer, squared_distance,
    wendland,
};
use kitsuke::skeleton::{Bone, Skeleton};
use std::collections::BTreeSet;

/// Where the search for scales begins and may go.
#[derive(Clone, Debug, PartialEq)]
pub struct Settings {
    /// Scale of turns across a bone, at the start.
    pub swing: f64,
    /// Scale of turns about it, at the start.
    pub twist: f64,
    /// Smallest and largest scale of turns across a bone.
    pub swings: (f64, f64),
    /// Smallest and largest scale of turns about it. Samples hardly twist, so that the search would let an unseen twist go far from them all.
    pub twists: (f64, f64),
    /// Width of what is left over after an arm's own shape, at the start; relative to the same distances.
    pub joint_width: f64,
    /// Narrowest and widest.
    pub joint_widths: (f64, f64),
    /// Ridge of the arm's own shape, at the start.
    pub ridge: f64,
    /// Smallest and largest ridge: below, coefficients that cancel cost digits; above, samples are averaged away.
    pub ridges: (f64, f64),
    /// Ridge of mirrored samples, at the start.
    pub mirror_ridge: f64,
    /// Smallest and largest: at the one they are believed as the arm's own, at the other not at all.
    pub mirror_ridges: (f64, f64),
    /// Trials of the search.
    pub trials: u64,
}

impl Default for Settings {
    fn default() -> Settings {
        Settings {
            swing: 0.5,
            twist: 0.2,
            swings: (0.02, 2.0),
            twists: (0.02, 0.3),
            joint_width: 0.5,
            joint_widths: (0.3, 3.0),
            ridge: 3e-3,
            ridges: (1e-3, 1e-1),
            mirror_ridge: 0.1,
            mirror_ridges: (1e-2, 1e2),
            trials: 800,
        }
    }
}

/// What the search chooses.
#[derive(Clone, Debug, PartialEq)]
pub struct Scales {
    /// Swing and twist by how many joints of the limb lie before the joint, the same for all limbs: an arm is an arm.
    pub joints: Vec<[f64; 2]>,
    /// See [`RbfLayer::joint_width`].
    pub joint_width: f64,
    /// Added to the diagonal of the limb's own system.
    pub ridge: f64,
    /// The same for mirrored samples.
    pub mirror_ridge: f64,
}

/// Drivers that blend together, before scales and coefficients are known: an arm, or both legs.
#[derive(Clone, Debug, PartialEq)]
pub struct Limb {
    /// The group's name.
    pub name: String,
    /// Its drivers.
    pub drivers: Vec<u8>,
    /// Their joints, each after the one that carries it.
    pub chain: Vec<Link>,
    /// The other limb of the layer with the same bones on the other side.
    pub mirror: Option<usize>,
}

impl Limb {
    /// How many joints of the chain no other carries: limbs that cloth goes round.
    #[must_use]
    pub fn roots(&self) -> usize {
        self.chain.iter().filter(|link| link.parent.is_none()).count()
    }
}

/// A joint of a limb.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Link {
    /// The bone.
    pub bone: Bone,
    /// Where it points in the T-pose.
    pub axis: DVec3,
    /// The place in the chain of the joint that carries it.
    pub parent: Option<u8>,
    /// How many joints of the chain carry it.
    pub depth: usize,
    /// Whether it counts by how it is turned against the trunk, not against the joint that carries it.
    pub is_carried: bool,
}

/// The limbs of a layer: the groups of the artist's drivers, in the order in which they first occur.
#[must_use]
pub fn limbs(drivers: &[ir::Driver], layer: usize, skeleton: &Skeleton) -> Vec<Limb> {
    let mut limbs: Vec<Limb> = Vec::new();
    for (number, driver) in drivers.iter().enumerate().filter(|(_, driver)| usize::from(driver.layer) == layer) {
        match limbs.iter_mut().find(|limb| limb.name == driver.group) {
            Some(limb) => limb.drivers.push(number as u8),
            None => limbs.push(Limb {
                name: driver.group.clone(),
                drivers: vec![number as u8],
                chain: Vec::new(),
                mirror: None,
            }),
        }
    }
    for limb in &mut limbs {
        let moves = |bone: Bone| limb.drivers.iter().any(|&driver| drivers[usize::from(driver)].joints.contains(&bone));
        for joint in skeleton.joints().iter().filter(|joint| moves(joint.bone)) {
            let mut above = joint.parent;
            let mut parent = None;
            while let (Some(joint), None) = (above.map(|index| skeleton.joints()[usize::from(index)]), parent) {
                parent = limb.chain.iter().position(|link| link.bone == joint.bone);
                above = joint.parent;
            }
            let depth = parent.map_or(0, |parent| limb.chain[parent].depth + 1);
            let axis = direction(skeleton, joint.bone);
            limb.chain.push(Link {
                bone: joint.bone,
                axis,
                parent: parent.map(|parent| parent as u8),
                depth,
                is_carried: false,
            });
        }
        // Cloth round two limbs, a skirt, feels where the shins point: raised thighs with upright shins leave the hem where it was. A sleeve
        // feels the bend of the elbow, for it hangs upright by itself.
        let is_round_limbs = limb.roots() > 1;
        limb.chain.iter_mut().for_each(|link| link.is_carried = is_round_limbs);
    }
    let bones: Vec<BTreeSet<Bone>> =
        limbs.iter().map(|limb| limb.chain.iter().map(|link| link.bone).collect()).collect();
    for (limb, bones_of_limb) in limbs.iter_mut().zip(&bones) {
        let other: BTreeSet<Bone> = bones_of_limb.iter().map(|bone| bone.mirrored()).collect();
        // A pair of legs is its own other side; its mirrored samples were tried and tell it nothing.
        limb.mirror = bones.iter().position(|bones| *bones == other).filter(|_| other != *bones_of_limb);
    }
    limbs
}

/// The limbs and scales with which a layer's kernel was made.
#[must_use]
pub fn limbs_and_scales(layer: &RbfLayer) -> (Vec<Limb>, Scales) {
    let mut joints: Vec<[f64; 2]> = Vec::new();
    let limb = |group: &Group| {
        let mut chain: Vec<Link> = Vec::new();
        for joint in &group.chain {
            let depth = joint.parent.map_or(0, |parent| chain[usize::from(parent)].depth + 1);
            if depth == joints.len() {
                joints.push([joint.swing, joint.twist]);
            }
            let ChainJoint { bone, axis, parent, is_carried, .. } = *joint;
            chain.push(Link { bone, axis, parent, depth, is_carried });
        }
        let mirror = group.mirror.map(usize::from);
        Limb { name: group.name.clone(), drivers: group.drivers.clone(), chain, mirror }
    };
    let limbs = layer.groups.iter().map(limb).collect();
    let &RbfLayer { joint_width, ridge, mirror_ridge, .. } = layer;
    (limbs, Scales { joints, joint_width, ridge, mirror_ridge })
}

/// The default kernel: for every layer scales by leave-one-out error, and coefficients that give every sample back.
///
/// # Errors
/// When two samples are too near to each other to be told apart, naming them, or the search cannot run.
pub fn kernel(data: &GarmentData, drivers: &[ir::Driver], settings: &Settings) -> Result<Rbf, StageError> {
    let layer = |number: usize| {
        let limbs = limbs(drivers, number, &data.skeleton);
        let shapes = shapes(data, number, &limbs);
        let scales = tune(data, number, &limbs, &shapes, settings)?;
        interpolate(data, number, &limbs, &shapes, &scales)
    };
    Ok(Rbf { layers: (0..data.layer_count()).map(layer).collect::<Result<_, _>>()? })
}

/// Where a bone points in the T-pose: to its first child, else away from its parent.
fn direction(skeleton: &Skeleton, bone: Bone) -> DVec3 {
    let joints = skeleton.joints();
    let index = skeleton.index_of(bone).expect("a checked driver's joint is in the skeleton");
    let child = joints.iter().find(|joint| joint.parent.is_some_and(|parent| usize::from(parent) == index));
    let from_parent = joints[index].parent.map(|parent| (joints[usize::from(parent)].rest_m, joints[index].rest_m));
    let ends = child.map(|child| (joints[index].rest_m, child.rest_m)).or(from_parent);
    ends.and_then(|(from, to)| (to - from).as_dvec3().try_normalize()).unwrap_or(DVec3::Y)
}

/// How many joints the longest way from the trunk has.
fn depths(limbs: &[Limb]) -> usize {
    limbs.iter().flat_map(|limb| &limb.chain).map(|link| link.depth + 1).max().unwrap_or(0)
}

/// Chooses the scales of a layer by leave-one-out error.
fn tune(
    data: &GarmentData,
    layer: usize,
    limbs: &[Limb],
    shapes: &[Shapes],
    settings: &Settings,
) -> Result<Scales, StageError> {
    let start = Scales {
        joints: vec![[settings.swing, settings.twist]; depths(limbs)],
        joint_width: settings.joint_width,
        ridge: settings.ridge,
        mirror_ridge: settings.mirror_ridge,
    };
    let rows = rows_of_layer(data, layer);
    if rows.len() < 4 {
        // Too few samples to leave one out.
        return Ok(start);
    }
    let first = to_logarithms(&start);
    let blends = shapes.iter().map(|shapes| (1..rows.len()).map(|row| shapes.blends_without(row)).collect()).collect();
    let search = Search { data, rows, limbs, settings, start: first.clone(), shapes, blends };
    let mut simplex = vec![first.clone()];
    for i in 0..first.len() {
        let mut corner = first.clone();
        corner[i] += 0.7;
        simplex.push(corner);
    }
    let failed = |error: argmin::core::Error| StageError::new("kernel", error.to_string());
    let solver = NelderMead::new(simplex).with_sd_tolerance(1e-7).map_err(failed)?;
    let result = Executor::new(search, solver)
        .configure(|state| state.max_iters(settings.trials))
        .timer(false)
        .run()
        .map_err(failed)?;
    let best =
        result.state().get_best_param().ok_or_else(|| StageError::new("kernel", "the search found no scales"))?;
    Ok(from_logarithms(best, settings))
}

/// The search: logarithms of the scales in, leave-one-out error out.
struct Search<'a> {
    data: &'a GarmentData,
    /// The rows of the layer, the base first.
    rows: Vec<usize>,
    limbs: &'a [Limb],
    settings: &'a Settings,
    start: Vec<f64>,
    /// Per limb.
    shapes: &'a [Shapes],
    /// Per limb and left-out row, the base never among them: [`Shapes::blends_without`].
    blends: Vec<Vec<Vec<f64>>>,
}

impl CostFunction for Search<'_> {
    type Param = Vec<f64>;
    type Output = f64;

    /// Mean over limbs and targets of the root mean square error over the cloth, plus a little for leaving the start,
    /// so that a scale that does not matter stays where it is.
    fn cost(&self, logarithms: &Vec<f64>) -> Result<f64, argmin::core::Error> {
        let scales = from_logarithms(logarithms, self.settings);
        let distances = Distances::new(self.data, &self.rows, self.limbs, &scales);
        let samples = distances.samples;
        let Some(joint) = distances.joint_system(&scales).inverse() else { return Ok(f64::INFINITY) };
        let mut sum = 0.0;
        for (limb, (shapes, blends)) in self.shapes.iter().zip(&self.blends).enumerate() {
            let Some(own) = distances.own_system(limb, &scales).inverse() else { return Ok(f64::INFINITY) };
            for (left_out, blends) in (1..samples).zip(blends) {
                let rates = rates_without(&own, &joint, samples, left_out, scales.ridge);
                let (rates, mirrored) = rates.split_at(samples);
                let mut apart = rates.to_vec();
                for (rate, blend) in mirrored.iter().zip(blends.chunks_exact(samples)) {
                    apart.iter_mut().zip(blend).for_each(|(apart, share)| *apart += rate * share);
                }
                apart[left_out] -= 1.0;
                sum += shapes.own.quadratic_form(&apart).max(0.0).sqrt();
            }
        }
        let count = (samples - 1) * self.limbs.len();
        let strayed: f64 = logarithms.iter().zip(&self.start).map(|(a, b)| (a - b) * (a - b)).sum();
        Ok(sum / count as f64 * (1.0 + STRAYING * strayed))
    }
}

/// What leaving the start costs the search, as a share of the error: an e-fold change of a scale must gain more than this. Else scales
/// that hardly matter would end wherever the simplex happened to shrink.
const STRAYING: f64 = 3e-3;

/// What every row that a limb knows counts in the pose of a sample, had the layer been fitted without this sample and its mirror image:
/// rows of the samples, then of the mirrored ones. `own` and `joint` are the inverses of the systems with it.
///
/// With C = (K + ridge)⁻¹ and B the rows left out, the rest predicts these rows with I - C_BB⁻¹ C_B (the formula of leave-one-out
/// kriging, Dubrule 1983), and C without them is C - C_·B C_BB⁻¹ C_B·. The rates are those of [`interpolate`].
fn rates_without(own: &Matrix, joint: &Matrix, samples: usize, left_out: usize, ridge: f64) -> Vec<f64> {
    let (out, inverse) = left_out_together(own, samples, left_out);
    // What is left of the other samples, near them: ψ J⁻¹ ridge (K + ridge)⁻¹.
    let near: Vec<f64> = (0..samples)
        .map(|row| if row == left_out { 0.0 } else { -ridge * joint.at(left_out, row) / joint.at(left_out, left_out) })
        .collect();
    let mut rates = vec![0.0; own.size];
    for (row, &near) in near.iter().enumerate().filter(|(_, near)| **near != 0.0) {
        rates.iter_mut().zip(own.row(row)).for_each(|(rate, own)| *rate += near * own);
    }
    let of_out: Vec<f64> = out.iter().map(|&row| rates[row]).collect();
    for (place, &row) in out.iter().enumerate() {
        let first: f64 = inverse.at(0, place);
        let back: f64 = (0..out.len()).map(|i| of_out[i] * inverse.at(i, place)).sum();
        rates.iter_mut().zip(own.row(row)).for_each(|(rate, own)| *rate -= (first + back) * own);
    }
    out.iter().for_each(|&row| rates[row] = 0.0);
    rates
}

fn to_logarithms(scales: &Scales) -> Vec<f64> {
    let scalars = scales.joints.iter().flatten().chain([&scales.joint_width, &scales.ridge, &scales.mirror_ridge]);
    scalars.map(|&scalar| libm::log(scalar)).collect()
}

fn from_logarithms(logarithms: &[f64], settings: &Settings) -> Scales {
    let (joints, rest) = logarithms.split_at(logarithms.len() - 3);
    let within = |logarithm: f64, (least, most): (f64, f64)| libm::exp(logarithm).clamp(least, most);
    Scales {
        joints: joints
            .as_chunks::<2>()
            .0
            .iter()
            .map(|&[swing, twist]| [within(swing, settings.swings), within(twist, settings.twists)])
            .collect(),
        joint_width: within(rest[0], settings.joint_widths),
        ridge: within(rest[1], settings.ridges),
        mirror_ridge: within(rest[2], settings.mirror_ridges),
    }
}

/// A layer's kernel with these scales: coefficients that give every sample back. `shapes` are the layer's, limb by limb.
///
/// # Errors
/// When two samples are too near to each other to be told apart, naming them.
pub fn interpolate(
    data: &GarmentData,
    layer: usize,
    limbs: &[Limb],
    shapes: &[Shapes],
    scales: &Scales,
) -> Result<RbfLayer, StageError> {
    let rows = rows_of_layer(data, layer);
    let distances = Distances::new(data, &rows, limbs, scales);
    let samples = distances.samples;
    let too_near = || {
        let (a, b) = distances.nearest_pair();
        let name = |sample: usize| if sample == 0 { "the base" } else { &data.targets[rows[sample] - 1].name };
        StageError::new("kernel", format!("the poses of {} and {} cannot be told apart", name(a), name(b)))
    };
    let joint_inverse = distances.joint_system(scales).inverse().ok_or_else(too_near)?;
    let mut groups = Vec::new();
    for (number, (limb, shapes)) in limbs.iter().zip(shapes).enumerate() {
        let inverse = distances.own_system(number, scales).inverse().ok_or_else(too_near)?;
        // Every row as a blend of the samples: its own sample, or what comes nearest to a mirrored one.
        let blends = shapes.blends_without(0);
        let own: Vec<f64> = (0..inverse.size)
            .flat_map(|row| {
                let mut coefficients = inverse.row(row)[..samples].to_vec();
                for (&share, blend) in inverse.row(row)[samples..].iter().zip(blends.chunks_exact(samples)) {
                    coefficients.iter_mut().zip(blend).for_each(|(sum, blend)| *sum += share * blend);
                }
                coefficients
            })
            .collect();
        // What the limb's own shape leaves of each sample is I - K C = ridge C on the samples' rows.
        let joint: Vec<f64> = (0..samples)
            .flat_map(|row| {
                let mut coefficients = vec![0.0; samples];
                for (&share, left) in joint_inverse.row(row).iter().zip(own.chunks_exact(samples)) {
                    coefficients.iter_mut().zip(left).for_each(|(sum, left)| *sum += share * (scales.ridge * left));
                }
                coefficients
            })
            .collect();
        let without_base = |coefficients: &[f64]| -> Vec<f64> {
            coefficients.chunks_exact(samples).flat_map(|row| &row[1..]).copied().collect()
        };
        groups.push(Group {
            name: limb.name.clone(),
            drivers: limb.drivers.clone(),
            chain: chain(limb, scales),
            mirror: limb.mirror.map(|mirror| mirror as u8),
            own: without_base(&own),
            joint: without_base(&joint),
            centres: Vec::new(),
            corrective: Vec::new(),
        });
    }
    let limited: Vec<Bone> = data.pose_limits.iter().flat_map(|limit| limit.bones.iter().copied()).collect();
    let is_limited = limbs.iter().flat_map(|limb| &limb.chain).all(|link| limited.contains(&link.bone));
    let &Scales { joint_width, ridge, mirror_ridge, .. } = scales;
    Ok(RbfLayer { groups, joint_width, reach: distances.reach(is_limited), ridge, mirror_ridge })
}

/// Makes the default kernel set the correctives' rates. For every group, layer by layer, `places` has poses between the samples
/// (rotations of the chain's joints) and pose by pose what each of the group's own correctives counts there; the correctives stand
/// at the end of `data.targets`, group by group.
///
/// # Errors
/// When two of the poses are too near to each other to be told apart.
pub fn correct(data: &mut GarmentData, places: &[(Vec<Quat>, Vec<f32>)]) -> Result<(), StageError> {
    let Some(mut rbf) = data.rbf.take() else { return Ok(()) };
    let mut places = places.iter();
    for (number, layer) in rbf.layers.iter_mut().enumerate() {
        let rows = rows_of_layer(data, number);
        let correctives = data.targets_of_layer(number).count() + 1 - rows.len();
        let (limbs, scales) = limbs_and_scales(layer);
        let distances = Distances::new(data, &rows, &limbs, &scales);
        let alike = || StageError::new("correctives", "two poses between the samples cannot be told apart");
        let joint = distances.joint_system(&scales).cholesky().ok_or_else(alike)?;
        let mut first = 0;
        for (group, (centres, rates)) in layer.groups.iter_mut().zip(&mut places) {
            let count = centres.len() / group.chain.len();
            let shapes = rates.len().checked_div(count).unwrap_or(0);
            let mut embedded = embed_samples(&group.chain, &data.poses, &rows);
            embedded.extend(embed_rows(&group.chain, centres));
            let place =
                |i: usize| &embedded[i * embedding_length(&group.chain)..(i + 1) * embedding_length(&group.chain)];
            let near =
                Matrix::new(rows.len() + count, |i, j| inverse_multiquadric(squared_distance(place(i), place(j))));
            let ridge = |i, j| if i == j { CORRECTIVE_RIDGE } else { 0.0 };
            let own = Matrix::new(near.size, |i, j| near.at(i, j) + ridge(i, j)).cholesky().ok_or_else(alike)?;

            // New columns; the old ones stay as they are.
            let width = rows.len() - 1 + correctives;
            for coefficients in [&mut group.own, &mut group.joint] {
                let narrow = coefficients.chunks_exact(rows.len().max(2) - 1);
                let mut wider = vec![0.0; narrow.len().max(rows.len()) * width];
                for (wide, row) in wider.chunks_exact_mut(width.max(1)).zip(narrow) {
                    wide[..row.len()].copy_from_slice(row);
                }
                *coefficients = wider;
            }
            group.corrective = vec![0.0; count * correctives];
            for shape in 0..shapes {
                let mut wanted = vec![0.0; rows.len()];
                wanted.extend((0..count).map(|pose| f64::from(rates[pose * shapes + shape])));
                let solved = own.solve_twice(&wanted);
                // At the samples nothing may be left, however the ridge smoothed.
                let left: Vec<f64> = near.times_vector(&solved)[..rows.len()].iter().map(|left| -left).collect();
                let left = joint.solve_twice(&left);
                for row in 0..rows.len() {
                    let at = row * width + rows.len() - 1 + first + shape;
                    (group.own[at], group.joint[at]) = (solved[row], left[row]);
                }
                for pose in 0..count {
                    group.corrective[pose * correctives + first + shape] = solved[rows.len() + pose];
                }
            }
            first += shapes;
            group.centres.clone_from(centres);
        }
    }
    data.rbf = Some(rbf);
    Ok(())
}

/// Ridge of the correctives' system. Pushes have kinks where cloth begins to touch; followed closely they would swing between the
/// poses (1e-6: legs up to 80 mm outside in recorded motions instead of 36).
const CORRECTIVE_RIDGE: f64 = 1e-3;

fn chain(limb: &Limb, scales: &Scales) -> Vec<ChainJoint> {
    let joint = |&Link { bone, axis, parent, depth, is_carried }: &Link| {
        let [swing, twist] = scales.joints[depth];
        ChainJoint { bone, parent, is_carried, axis, swing, twist }
    };
    limb.chain.iter().map(joint).collect()
}

/// Squared distances of embeddings of this length.
pub(crate) fn squared_distances(embeddings: &[f64], length: usize) -> Matrix {
    let row = |i: usize| &embeddings[i * length..(i + 1) * length];
    Matrix::new(embeddings.len() / length, |i, j| squared_distance(row(i), row(j)))
}

/// K + ridge of all that a limb knows, from its squared distances: so many samples, the base first, then the mirrored ones, which have
/// the second ridge.
pub(crate) fn own_system(squared_distances: &Matrix, samples: usize, ridges: [f64; 2]) -> Matrix {
    let ridge = |i, j| if i == j { ridges[usize::from(i >= samples)] } else { 0.0 };
    Matrix::new(squared_distances.size, |i, j| inverse_multiquadric(squared_distances.at(i, j)) + ridge(i, j))
}

/// The rows of a sample and of its mirror image, if a limb knows that, and how their shapes vary, ridges included, had neither been seen:
/// with C the inverse of the limb's own system, C_BB⁻¹.
pub(crate) fn left_out_together(own: &Matrix, samples: usize, left_out: usize) -> (Vec<usize>, Matrix) {
    let mirrored = samples + left_out - 1;
    let out = if mirrored < own.size { vec![left_out, mirrored] } else { vec![left_out] };
    let inner = Matrix::new(out.len(), |i, j| own.at(out[i], out[j]));
    let inverse = inner.inverse().expect("a part of a positive definite matrix is positive definite");
    (out, inverse)
}

/// Squared distances of all samples, the base first.
struct Distances {
    samples: usize,
    /// Per limb, mirrored samples after the layer's own.
    own: Vec<Matrix>,
    /// Over all limbs.
    summed: Matrix,
}

impl Distances {
    fn new(data: &GarmentData, rows: &[usize], limbs: &[Limb], scales: &Scales) -> Distances {
        let samples = rows.len();
        let own: Vec<Matrix> = limbs
            .iter()
            .map(|limb| {
                let chain = chain(limb, scales);
                let length = embedding_length(&chain);
                squared_distances(&embed_known(&chain, limb.mirror.is_some(), &data.poses, rows), length)
            })
            .collect();
        let summed = Matrix::new(samples, |i, j| own.iter().map(|own| own.at(i, j)).sum());
        Distances { samples, own, summed }
    }

    fn own_system(&self, limb: usize, scales: &Scales) -> Matrix {
        own_system(&self.own[limb], self.samples, [scales.ridge, scales.mirror_ridge])
    }

    fn joint_system(&self, scales: &Scales) -> Matrix {
        Matrix::new(self.samples, |i, j| wendland(self.summed.at(i, j), scales.joint_width))
    }

    fn nearest_pair(&self) -> (usize, usize) {
        let pairs = (0..self.samples).flat_map(|a| (0..a).map(move |b| (b, a)));
        pairs.min_by(|&(a, b), &(c, d)| self.summed.at(a, b).total_cmp(&self.summed.at(c, d))).unwrap_or((0, 0))
    }

    /// Somewhat farther than the largest distance of a sample to its nearest other pose in any one limb, so that the
    /// samples hold hands. The factor is the smallest that left the leave-one-out error of the sample kimono as it was.
    ///
    /// Limbs that are kept within what the samples reach are never far from them: there nothing fades.
    fn reach(&self, is_limited: bool) -> f64 {
        let samples = 0..self.samples;
        if is_limited {
            let apart =
                self.own.iter().flat_map(|own| samples.clone().flat_map(|a| &own.row(a)[..self.samples])).copied();
            return 2.0 * apart.filter(|&squared| squared > 1e-6).max_by(f64::total_cmp).unwrap_or(1.0).sqrt();
        }
        let apart = |own: &Matrix, a: usize| {
            let others = samples.clone().map(|b| own.at(a, b)).filter(|&squared| squared > 1e-6);
            others.min_by(f64::total_cmp)
        };
        let widest = self.own.iter().flat_map(|own| samples.clone().filter_map(move |a| apart(own, a)));
        1.4 * widest.max_by(f64::total_cmp).unwrap_or(1.0).sqrt()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        /// Against systems solved without the rows.
        #[test]
        fn leaving_out_is_what_solving_without_the_sample_gives(
            places in prop::collection::vec(-2.0f64..2.0, 7),
            left_out in 1usize..4,
        ) {
            // Four samples and three mirrored ones on a line.
            let squared = |i: usize, j: usize| (places[i] - places[j]).powi(2);
            let (ridge, mirror_ridge) = (0.01, 0.1);
            let noise = |i: usize| if i < 4 { ridge } else { mirror_ridge };
            let own = |i: usize, j: usize| inverse_multiquadric(squared(i, j)) + if i == j { noise(i) } else { 0.0 };
            let joint = |i: usize, j: usize| wendland(squared(i, j), 1.0) + if i == j { 1e-3 } else { 0.0 };
            let inverses = (Matrix::new(7, own).inverse().unwrap(), Matrix::new(4, joint).inverse().unwrap());
            let found = rates_without(&inverses.0, &inverses.1, 4, left_out, ridge);

            let kept: Vec<usize> = (0..7).filter(|&row| row != left_out && row != 4 + left_out - 1).collect();
            let samples: Vec<usize> = kept.iter().copied().filter(|&row| row < 4).collect();
            let inverse = Matrix::new(5, |i, j| own(kept[i], kept[j])).inverse().unwrap();
            let near: Vec<f64> = samples.iter().map(|&row| wendland(squared(left_out, row), 1.0)).collect();
            let near = Matrix::new(3, |i, j| joint(samples[i], samples[j])).cholesky().unwrap().solve_twice(&near);
            let mut wanted = vec![0.0; 7];
            for (j, &row) in kept.iter().enumerate() {
                let phi: f64 =
                    (0..5).map(|i| inverse_multiquadric(squared(left_out, kept[i])) * inverse.at(i, j)).sum();
                let left: f64 = (0..3).map(|i| near[i] * ridge * inverse.at(i, j)).sum();
                wanted[row] = phi + left;
            }
            for (row, (found, wanted)) in found.iter().zip(&wanted).enumerate() {
                prop_assert!((found - wanted).abs() < 1e-6 * (1.0 + wanted.abs()), "row {row}: {found}, not {wanted}");
            }
        }
    }
}
