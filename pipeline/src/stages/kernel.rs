//! The default kernel of a garment: which turning of which joint matters how much to the shape, and the coefficients
//! that interpolate the samples. Knows the arrays of a pack; how they are used per frame stands in
//! [`kitsuke::pose_blend::rbf`].
//!
//! Every layer is fitted by itself. What matters is decided by leaving one sample out: every target's shape is predicted from the other samples, and
//! the scales are chosen so that these predictions err least, measured on the cloth, not on the rates. Each trial costs
//! only matrices as large as the number of samples, because the error of a blend is a quadratic form of its rates.

use crate::ir;
use crate::stages::StageError;
use argmin::core::{CostFunction, Executor, State};
use argmin::solver::neldermead::NelderMead;
use glam::{DVec3, Quat};
use kitsuke::arrays::{ChainJoint, GarmentData, Group, Rbf, RbfLayer};
use kitsuke::pose_blend::rbf::{
    embed_rows, embed_samples, embedding_length, inverse_multiquadric, rows_of_layer, squared_distance, wendland,
};
use kitsuke::skeleton::{Bone, Skeleton};

/// Where the search for scales begins and may go.
#[derive(Clone, Debug, PartialEq)]
pub struct Settings {
    /// Scale of the direction in which a bone points, at the start.
    pub swing: f64,
    /// Scale of the turn about it, at the start.
    pub twist: f64,
    /// Smallest and largest scale.
    pub scales: (f64, f64),
    /// Width of what is left over after an arm's own shape, at the start; relative to the same distances.
    pub joint_width: f64,
    /// Narrowest and widest.
    pub joint_widths: (f64, f64),
    /// Ridge of the arm's own shape, at the start.
    pub ridge: f64,
    /// Smallest and largest ridge: below, coefficients that cancel cost digits; above, samples are averaged away.
    pub ridges: (f64, f64),
    /// Trials of the search.
    pub trials: u64,
}

impl Default for Settings {
    fn default() -> Settings {
        Settings {
            swing: 0.4,
            twist: 0.2,
            scales: (0.02, 2.0),
            joint_width: 0.5,
            joint_widths: (0.3, 3.0),
            ridge: 3e-3,
            ridges: (1e-3, 1e-1),
            trials: 1500,
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
}

/// The limbs of a layer: the groups of the artist's drivers, in the order in which they first occur.
#[must_use]
pub fn limbs(drivers: &[ir::Driver], layer: usize, skeleton: &Skeleton) -> Vec<Limb> {
    let mut limbs: Vec<Limb> = Vec::new();
    for (number, driver) in drivers.iter().enumerate().filter(|(_, driver)| usize::from(driver.layer) == layer) {
        match limbs.iter_mut().find(|limb| limb.name == driver.group) {
            Some(limb) => limb.drivers.push(number as u8),
            None => limbs.push(Limb { name: driver.group.clone(), drivers: vec![number as u8], chain: Vec::new() }),
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
            limb.chain.push(Link { bone: joint.bone, axis, parent: parent.map(|parent| parent as u8), depth });
        }
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
            chain.push(Link { bone: joint.bone, axis: joint.axis, parent: joint.parent, depth });
        }
        Limb { name: group.name.clone(), drivers: group.drivers.clone(), chain }
    };
    let limbs = layer.groups.iter().map(limb).collect();
    (limbs, Scales { joints, joint_width: layer.joint_width, ridge: layer.ridge })
}

/// The default kernel: for every layer scales by leave-one-out error, and coefficients that give every sample back.
///
/// # Errors
/// When two samples are too near to each other to be told apart, naming them, or the search cannot run.
pub fn kernel(data: &GarmentData, drivers: &[ir::Driver], settings: &Settings) -> Result<Rbf, StageError> {
    let layer = |number: usize| {
        let limbs = limbs(drivers, number, &data.skeleton);
        let scales = tune(data, number, &limbs, settings)?;
        interpolate(data, number, &limbs, &scales)
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
fn tune(data: &GarmentData, layer: usize, limbs: &[Limb], settings: &Settings) -> Result<Scales, StageError> {
    let start = Scales {
        joints: vec![[settings.swing, settings.twist]; depths(limbs)],
        joint_width: settings.joint_width,
        ridge: settings.ridge,
    };
    let rows = rows_of_layer(data, layer);
    if rows.len() < 4 {
        // Too few samples to leave one out.
        return Ok(start);
    }
    let products = limbs.iter().map(|limb| products(data, &rows, limb)).collect();
    let search = Search { data, rows, limbs, settings, products };
    let first = to_logarithms(&start);
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
    /// Per limb the inner products of the samples' deltas, m².
    products: Vec<Matrix>,
}

impl CostFunction for Search<'_> {
    type Param = Vec<f64>;
    type Output = f64;

    /// Mean over limbs and targets of the root mean square error over the cloth, plus a little for leaving the start,
    /// so that a scale that does not matter stays where it is.
    fn cost(&self, logarithms: &Vec<f64>) -> Result<f64, argmin::core::Error> {
        let scales = from_logarithms(logarithms, self.settings);
        let distances = Distances::new(self.data, &self.rows, self.limbs, &scales);
        let mut sum = 0.0;
        for left_out in 1..distances.samples {
            let others: Vec<usize> = (0..distances.samples).filter(|&sample| sample != left_out).collect();
            let rows = distances.rates(&others, left_out, &scales);
            for (row, products) in rows.into_iter().zip(&self.products) {
                let Some(row) = row else { return Ok(f64::INFINITY) };
                let mut apart = vec![0.0; distances.samples];
                others.iter().zip(row).for_each(|(&sample, rate)| apart[sample] = rate);
                apart[left_out] -= 1.0;
                sum += products.quadratic_form(&apart).max(0.0).sqrt();
            }
        }
        let count = (distances.samples - 1) * self.limbs.len();
        let strayed: f64 = logarithms.iter().zip(self.start()).map(|(a, b)| (a - b) * (a - b)).sum();
        Ok(sum / count as f64 * (1.0 + 1e-4 * strayed))
    }
}

impl Search<'_> {
    fn start(&self) -> Vec<f64> {
        let joints = vec![[self.settings.swing, self.settings.twist]; depths(self.limbs)];
        to_logarithms(&Scales { joints, joint_width: self.settings.joint_width, ridge: self.settings.ridge })
    }
}

fn to_logarithms(scales: &Scales) -> Vec<f64> {
    let scalars = scales.joints.iter().flatten().chain([&scales.joint_width, &scales.ridge]);
    scalars.map(|&scalar| libm::log(scalar)).collect()
}

fn from_logarithms(logarithms: &[f64], settings: &Settings) -> Scales {
    let (joints, rest) = logarithms.split_at(logarithms.len() - 2);
    let within = |logarithm: f64, (least, most): (f64, f64)| libm::exp(logarithm).clamp(least, most);
    Scales {
        joints: joints.as_chunks::<2>().0.iter().map(|pair| pair.map(|x| within(x, settings.scales))).collect(),
        joint_width: within(rest[0], settings.joint_widths),
        ridge: within(rest[1], settings.ridges),
    }
}

/// A layer's kernel with these scales: coefficients that give every sample back.
///
/// # Errors
/// When two samples are too near to each other to be told apart, naming them.
pub fn interpolate(data: &GarmentData, layer: usize, limbs: &[Limb], scales: &Scales) -> Result<RbfLayer, StageError> {
    let rows = rows_of_layer(data, layer);
    let distances = Distances::new(data, &rows, limbs, scales);
    let all: Vec<usize> = (0..distances.samples).collect();
    let too_near = || {
        let (a, b) = distances.nearest_pair();
        let name = |sample: usize| if sample == 0 { "the base" } else { &data.targets[rows[sample] - 1].name };
        StageError::new("kernel", format!("the poses of {} and {} cannot be told apart", name(a), name(b)))
    };
    let joint_inverse = distances.joint_system(&all, scales).inverse().ok_or_else(too_near)?;
    let mut groups = Vec::new();
    for (number, limb) in limbs.iter().enumerate() {
        let own_inverse = distances.own_system(number, &all, scales).inverse().ok_or_else(too_near)?;
        // What the limb's own shape K (K + ridge)⁻¹ leaves of each sample is I - K (K + ridge)⁻¹ = ridge (K + ridge)⁻¹.
        let left = joint_inverse.times(&own_inverse);
        let joint = Matrix::new(left.size, |i, j| scales.ridge * left.at(i, j));
        groups.push(Group {
            name: limb.name.clone(),
            drivers: limb.drivers.clone(),
            chain: chain(limb, scales),
            own: own_inverse.without_first_column(),
            joint: joint.without_first_column(),
            centres: Vec::new(),
            corrective: Vec::new(),
        });
    }
    let limited: Vec<Bone> = data.pose_limits.iter().flat_map(|limit| limit.bones.iter().copied()).collect();
    let is_limited = limbs.iter().flat_map(|limb| &limb.chain).all(|link| limited.contains(&link.bone));
    Ok(RbfLayer { groups, joint_width: scales.joint_width, reach: distances.reach(is_limited), ridge: scales.ridge })
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
        let all: Vec<usize> = (0..rows.len()).collect();
        let alike = || StageError::new("correctives", "two poses between the samples cannot be told apart");
        let joint = distances.joint_system(&all, &scales).cholesky().ok_or_else(alike)?;
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
                let mut wider = vec![0.0; rows.len() * width];
                for (wide, row) in
                    wider.chunks_exact_mut(width.max(1)).zip(coefficients.chunks_exact(rows.len().max(2) - 1))
                {
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

/// Eigenvalues, the largest first, and unit eigenvectors of a symmetric matrix, by Jacobi's rotations.
pub(super) fn principal(size: usize, at: impl Fn(usize, usize) -> f64) -> Vec<(f64, Vec<f64>)> {
    let mut matrix = Matrix::new(size, at);
    // Row k is the k-th eigenvector.
    let mut vectors = Matrix::new(size, |i, j| if i == j { 1.0 } else { 0.0 });
    let norm: f64 = matrix.rows.iter().map(|x| x * x).sum();
    for _ in 0..30 {
        let off: f64 = (0..size).flat_map(|i| (0..i).map(move |j| (i, j))).map(|(i, j)| matrix.at(i, j).powi(2)).sum();
        if off <= 1e-24 * norm {
            break;
        }
        for p in 0..size {
            for q in p + 1..size {
                rotate(&mut matrix, &mut vectors, p, q);
            }
        }
    }
    let mut found: Vec<(f64, Vec<f64>)> = (0..size).map(|i| (matrix.at(i, i), vectors.row(i).to_vec())).collect();
    found.sort_by(|a, b| b.0.total_cmp(&a.0));
    found
}

/// Makes the entry (p, q) of a symmetric matrix 0.
fn rotate(matrix: &mut Matrix, vectors: &mut Matrix, p: usize, q: usize) {
    let apart = matrix.at(p, q);
    if apart == 0.0 {
        return;
    }
    let half = (matrix.at(q, q) - matrix.at(p, p)) / (2.0 * apart);
    let tangent = half.signum() / (half.abs() + (half * half + 1.0).sqrt());
    let cosine = 1.0 / (tangent * tangent + 1.0).sqrt();
    let sine = tangent * cosine;
    let size = matrix.size;
    let turn = |rows: &mut [f64], a: usize, b: usize| {
        let (x, y) = (rows[a], rows[b]);
        (rows[a], rows[b]) = (cosine * x - sine * y, sine * x + cosine * y);
    };
    for k in 0..size {
        turn(&mut matrix.rows, k * size + p, k * size + q);
    }
    for k in 0..size {
        turn(&mut matrix.rows, p * size + k, q * size + k);
        turn(&mut vectors.rows, p * size + k, q * size + k);
    }
}

fn chain(limb: &Limb, scales: &Scales) -> Vec<ChainJoint> {
    let joint = |&Link { bone, axis, parent, depth }: &Link| {
        let [swing, twist] = scales.joints[depth];
        ChainJoint { bone, parent, axis, swing, twist }
    };
    limb.chain.iter().map(joint).collect()
}

/// Squared distances of all samples, the base first.
struct Distances {
    samples: usize,
    own: Vec<Matrix>,
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
                let embeddings = embed_samples(&chain, &data.poses, rows);
                let row = |i: usize| &embeddings[i * length..(i + 1) * length];
                Matrix::new(samples, |i, j| squared_distance(row(i), row(j)))
            })
            .collect();
        let summed = Matrix::new(samples, |i, j| own.iter().map(|own| own.at(i, j)).sum());
        Distances { samples, own, summed }
    }

    fn own_system(&self, limb: usize, rows: &[usize], scales: &Scales) -> Matrix {
        let ridge = |i, j| if i == j { scales.ridge } else { 0.0 };
        let own = &self.own[limb];
        Matrix::new(rows.len(), |i, j| inverse_multiquadric(own.at(rows[i], rows[j])) + ridge(i, j))
    }

    fn joint_system(&self, rows: &[usize], scales: &Scales) -> Matrix {
        Matrix::new(rows.len(), |i, j| wendland(self.summed.at(rows[i], rows[j]), scales.joint_width))
    }

    /// Per limb the rates of `rows` at the pose of `query`; `None` where the system is singular.
    fn rates(&self, rows: &[usize], query: usize, scales: &Scales) -> Vec<Option<Vec<f64>>> {
        let psi: Vec<f64> = rows.iter().map(|&row| wendland(self.summed.at(query, row), scales.joint_width)).collect();
        let joint = self.joint_system(rows, scales).solve(&psi);
        let limb = |(number, own): (usize, &Matrix)| {
            let phi: Vec<f64> = rows.iter().map(|&row| inverse_multiquadric(own.at(query, row))).collect();
            let system = self.own_system(number, rows, scales);
            // As in `interpolate`: φ (K + ridge)⁻¹ + ψ J⁻¹ ridge (K + ridge)⁻¹ with symmetric J and K.
            let joint = joint.as_ref()?;
            let both: Vec<f64> = phi.iter().zip(joint).map(|(phi, joint)| phi + scales.ridge * joint).collect();
            system.solve(&both)
        };
        self.own.iter().enumerate().map(limb).collect()
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
        if is_limited {
            let apart = self.own.iter().flat_map(|own| &own.rows).copied();
            return 2.0 * apart.filter(|&squared| squared > 1e-6).max_by(f64::total_cmp).unwrap_or(1.0).sqrt();
        }
        let apart = |own: &Matrix, a: usize| {
            let others = (0..self.samples).map(|b| own.at(a, b)).filter(|&squared| squared > 1e-6);
            others.min_by(f64::total_cmp)
        };
        let widest = self.own.iter().flat_map(|own| (0..self.samples).filter_map(move |a| apart(own, a)));
        1.4 * widest.max_by(f64::total_cmp).unwrap_or(1.0).sqrt()
    }
}

/// Inner products of the samples' deltas over the cloth that a limb owns, m² per vertex of the garment.
fn products(data: &GarmentData, rows: &[usize], limb: &Limb) -> Matrix {
    let samples = rows.len();
    let mut sums = vec![0.0f64; samples * samples];
    let mut first_delta = vec![0usize; samples];
    for (number, segment) in data.segments.iter().enumerate() {
        let columns: Vec<usize> =
            (0..segment.drivers.len()).filter(|&c| limb.drivers.contains(&segment.drivers[c])).collect();
        let share = |v: usize| match segment.masks.chunks_exact(segment.drivers.len().max(1)).nth(v) {
            Some(row) => columns.iter().map(|&c| f64::from(row[c])).sum::<f64>() / f64::from(u16::MAX),
            None => {
                if columns.is_empty() {
                    0.0
                } else {
                    1.0
                }
            }
        };
        let count = segment.vertex_count as usize;
        let shares: Vec<f64> = (0..count).map(share).collect();
        let mut moving: Vec<(usize, f64, &[[i16; 3]])> = Vec::new();
        for (sample, &row) in rows.iter().enumerate().skip(1) {
            let target = &data.targets[row - 1];
            if target.segments.contains(&(number as u16)) {
                moving.push((sample, f64::from(target.step_m), &target.deltas[first_delta[sample]..][..count]));
                first_delta[sample] += count;
            }
        }
        for (at, &(i, step_i, a)) in moving.iter().enumerate() {
            for &(j, step_j, b) in &moving[at..] {
                let dot = |(a, b): (&[i16; 3], &[i16; 3])| -> i64 {
                    a.iter().zip(b).map(|(&a, &b)| i64::from(a) * i64::from(b)).sum()
                };
                let sum: f64 = a.iter().zip(b).map(dot).zip(&shares).map(|(dot, share)| share * dot as f64).sum();
                sums[i * samples + j] += sum * step_i * step_j;
            }
        }
    }
    let vertices = data.mesh.positions_m.len() as f64;
    Matrix::new(samples, |i, j| sums[i.min(j) * samples + i.max(j)] / vertices)
}

/// A small square matrix. An own one, because the linear algebra libraries choose their kernels by the processor, and
/// packs must be the same bytes on every machine.
#[derive(Clone, Debug)]
struct Matrix {
    size: usize,
    rows: Vec<f64>,
}

impl Matrix {
    fn new(size: usize, at: impl Fn(usize, usize) -> f64) -> Matrix {
        Matrix { size, rows: (0..size * size).map(|i| at(i / size, i % size)).collect() }
    }

    fn at(&self, i: usize, j: usize) -> f64 {
        self.rows[i * self.size + j]
    }

    fn row(&self, i: usize) -> &[f64] {
        &self.rows[i * self.size..(i + 1) * self.size]
    }

    fn times_vector(&self, x: &[f64]) -> Vec<f64> {
        (0..self.size).map(|i| self.row(i).iter().zip(x).map(|(a, x)| a * x).sum()).collect()
    }

    fn times(&self, other: &Matrix) -> Matrix {
        Matrix::new(self.size, |i, j| (0..self.size).map(|k| self.at(i, k) * other.at(k, j)).sum())
    }

    fn quadratic_form(&self, x: &[f64]) -> f64 {
        self.times_vector(x).iter().zip(x).map(|(a, x)| a * x).sum()
    }

    fn without_first_column(&self) -> Vec<f64> {
        (0..self.size).flat_map(|i| &self.row(i)[1..]).copied().collect()
    }

    /// The lower Cholesky factor, if the matrix is symmetric and positive definite.
    fn cholesky(&self) -> Option<Matrix> {
        let mut factor = Matrix { size: self.size, rows: vec![0.0; self.rows.len()] };
        for i in 0..self.size {
            for j in 0..=i {
                let known: f64 = (0..j).map(|k| factor.at(i, k) * factor.at(j, k)).sum();
                let left = self.at(i, j) - known;
                factor.rows[i * self.size + j] = match i == j {
                    // Far above rounding, far below what two poses a degree apart leave.
                    true => (left > 1e-12).then(|| left.sqrt())?,
                    false => left / factor.at(j, j),
                };
            }
        }
        Some(factor)
    }

    /// The solution of `self x = b`.
    fn solve(&self, b: &[f64]) -> Option<Vec<f64>> {
        Some(self.cholesky()?.solve_twice(b))
    }

    /// The solution of `L Lᵀ x = b` for this lower factor `L`.
    fn solve_twice(&self, b: &[f64]) -> Vec<f64> {
        let mut x = b.to_vec();
        for i in 0..self.size {
            let known: f64 = (0..i).map(|k| self.at(i, k) * x[k]).sum();
            x[i] = (x[i] - known) / self.at(i, i);
        }
        for i in (0..self.size).rev() {
            let known: f64 = (i + 1..self.size).map(|k| self.at(k, i) * x[k]).sum();
            x[i] = (x[i] - known) / self.at(i, i);
        }
        x
    }

    /// The inverse of a symmetric positive definite matrix.
    fn inverse(&self) -> Option<Matrix> {
        let factor = self.cholesky()?;
        let unit = |j: usize| (0..self.size).map(|i| if i == j { 1.0 } else { 0.0 }).collect::<Vec<_>>();
        let columns: Vec<Vec<f64>> = (0..self.size).map(|j| factor.solve_twice(&unit(j))).collect();
        Some(Matrix::new(self.size, |i, j| columns[j][i]))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn principal_axes_are_those_of_the_matrix(entries in prop::collection::vec(-1.0f64..1.0, 28)) {
            // The lower triangle of a symmetric matrix of 7 rows.
            let at = |i: usize, j: usize| entries[i.max(j) * (i.max(j) + 1) / 2 + i.min(j)];
            let found = principal(7, at);
            prop_assert!(found.windows(2).all(|pair| pair[0].0 >= pair[1].0));
            for (place, (value, vector)) in found.iter().enumerate() {
                for i in 0..7 {
                    let product: f64 = (0..7).map(|j| at(i, j) * vector[j]).sum();
                    prop_assert!((product - value * vector[i]).abs() < 1e-9, "axis {place}");
                }
                for (_, other) in &found[..place] {
                    prop_assert!(other.iter().zip(vector).map(|(a, b)| a * b).sum::<f64>().abs() < 1e-9);
                }
            }
        }
    }
}
