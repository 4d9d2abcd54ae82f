//! Measures what mixing sizes part by part does to the cloth: triangles turned over, and how much more the deformation changes across seams
//! than elsewhere. Knows a fit's fields, not how they were made.

use glam::{Mat3, Vec3};
use kitsuke::fit::FitData;
use kitsuke::garment::Garment;
use rayon::prelude::*;

/// What was measured over all mixes.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Quality {
    /// How many mixes.
    pub mixes: usize,
    /// Triangles whose normal makes more than 90 degrees with those of the base and of every size used.
    pub turned: usize,
    /// Triangles where the sources agree (all their normals within 90 degrees of each other), but the mix makes more than 90 degrees with
    /// one that it uses.
    pub turned_from_agreed: usize,
    /// Triangles where the sources agree.
    pub agreed: usize,
    /// Change of the deformation gradient (Frobenius norm) from a triangle to its neighbour across a seam of parts, 99th percentile, mean
    /// over the mixes.
    pub across: f64,
    /// The same inside the parts.
    pub inside: f64,
    /// `across / inside` of single mixes: median, 99th percentile and largest.
    pub ratios: [f64; 3],
    /// How many mixes have a ratio above [`UNEVEN`].
    pub uneven: usize,
    /// Shortest edge of any mix, as a share of its shortest length in any source.
    pub least_edge: f64,
}

/// More than this, relative to what changes inside parts, is a step at a seam.
pub const UNEVEN: f64 = 1.5;

/// The weights of one mix: per part one per size, at least 0, summing to at most 1; the base has the rest.
///
/// Every third mix takes one size for each part, every third few sizes, the others any.
#[must_use]
pub fn random_weights(mix: u64, parts: usize, sizes: usize) -> Vec<f32> {
    let mut random = Random(mix.wrapping_mul(0x9e37_79b9_7f4a_7c15));
    let mut weights = Vec::with_capacity(parts * sizes);
    for _ in 0..parts {
        let mut row: Vec<f64> = match mix % 3 {
            0 => (0..=sizes).map(|_| -libm::log(1.0 - random.unit())).collect(),
            1 => {
                let chosen = (random.unit() * (sizes + 1) as f64) as usize;
                (0..=sizes).map(|size| if size == chosen { 1.0 } else { 0.0 }).collect()
            }
            _ => (0..=sizes).map(|_| libm::pow(random.unit(), 8.0)).collect(),
        };
        let sum: f64 = row.iter().sum();
        row.iter_mut().for_each(|weight| *weight /= sum.max(f64::MIN_POSITIVE));
        weights.extend(row[1..].iter().map(|weight| *weight as f32));
    }
    weights
}

/// SplitMix64 (Steele, Lea and Flood 2014).
struct Random(u64);

impl Random {
    /// In 0..1.
    fn unit(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) >> 11) as f64 / (1u64 << 53) as f64
    }
}

/// The unique vertices of the kimono with these weights (per part one per size), metres.
#[must_use]
pub fn mixed(garment: &Garment, fit: &FitData, weights: &[f32]) -> Vec<Vec3> {
    let mut positions_m = garment.data().mesh.positions_m.clone();
    for (field, &weight) in fit.fields.iter().zip(weights).filter(|(_, weight)| **weight != 0.0) {
        for (position_m, delta) in positions_m.iter_mut().zip(&field.deltas) {
            *position_m += weight * field.step_m * Vec3::from_array(delta.map(f32::from));
        }
    }
    positions_m
}

/// The base or a size, whole.
#[must_use]
pub fn source_shape(garment: &Garment, fit: &FitData, body: usize) -> Vec<Vec3> {
    let sizes = fit.size_count();
    let weights: Vec<f32> = (0..fit.fields.len()).map(|at| if at % sizes + 1 == body { 1.0 } else { 0.0 }).collect();
    mixed(garment, fit, &weights)
}

/// Measures `mixes` random mixes.
#[must_use]
pub fn measure(garment: &Garment, fit: &FitData, mixes: usize) -> Quality {
    let cloth = Cloth::new(garment, fit);
    let measured: Vec<Quality> =
        (0..mixes as u64).into_par_iter().map(|mix| cloth.measure(garment, fit, mix)).collect();
    let mut quality =
        Quality { mixes, agreed: cloth.agreed.iter().filter(|agreed| **agreed).count(), ..Quality::default() };
    quality.least_edge = f64::INFINITY;
    quality.ratios = [50, 99, 100].map(|percent| quantile(measured.iter().map(|mix| mix.ratios[2]).collect(), percent));
    for mix in measured {
        quality.turned += mix.turned;
        quality.turned_from_agreed += mix.turned_from_agreed;
        quality.across += mix.across / mixes as f64;
        quality.inside += mix.inside / mixes as f64;
        quality.uneven += usize::from(mix.ratios[2] > UNEVEN);
        quality.least_edge = quality.least_edge.min(mix.least_edge);
    }
    quality
}

/// What of the sources every mix is compared with.
struct Cloth {
    /// Over unique vertices.
    triangles: Vec<[u32; 3]>,
    /// Inverse of the base's edges and normal, per triangle.
    inverse_base: Vec<Mat3>,
    /// Pairs of triangles that share an edge, and whether they are of two parts.
    neighbours: Vec<(u32, u32, bool)>,
    /// Per source, per triangle.
    normals: Vec<Vec<Vec3>>,
    agreed: Vec<bool>,
    /// Edges with their shortest length in any source.
    edges: Vec<(u32, u32, f32)>,
}

impl Cloth {
    fn new(garment: &Garment, fit: &FitData) -> Cloth {
        let mesh = &garment.data().mesh;
        let unique = |v: u32| mesh.unique(v);
        let triangles: Vec<[u32; 3]> = mesh.triangles.iter().map(|corners| corners.map(unique)).collect();
        let part_of: Vec<usize> = mesh
            .parts
            .iter()
            .enumerate()
            .flat_map(|(p, part)| std::iter::repeat_n(p, part.triangle_count as usize))
            .collect();
        let mut sides: Vec<(u32, u32, u32)> = Vec::new();
        for (t, &[a, b, c]) in triangles.iter().enumerate() {
            sides.extend([(a, b), (b, c), (c, a)].map(|(a, b)| (a.min(b), a.max(b), t as u32)));
        }
        sides.sort_unstable();
        let pairs = sides.windows(2).filter(|pair| (pair[0].0, pair[0].1) == (pair[1].0, pair[1].1));
        let neighbours = pairs.map(|pair| {
            let (s, t) = (pair[0].2, pair[1].2);
            (s, t, part_of[s as usize] != part_of[t as usize])
        });
        let shapes: Vec<Vec<Vec3>> = (0..fit.bodies.len()).map(|body| source_shape(garment, fit, body)).collect();
        let normals: Vec<Vec<Vec3>> = shapes.iter().map(|shape| normals(&triangles, shape)).collect();
        let agree = |t: usize| normals.iter().all(|a| normals.iter().all(|b| a[t].dot(b[t]) > 0.0));
        let mut edges: Vec<(u32, u32, f32)> = sides.iter().map(|&(a, b, _)| (a, b, f32::INFINITY)).collect();
        edges.dedup();
        for (a, b, least_m) in &mut edges {
            let lengths = shapes.iter().map(|shape| shape[*a as usize].distance(shape[*b as usize]));
            *least_m = lengths.fold(f32::INFINITY, f32::min);
        }
        let frames = frames(&triangles, &mesh.positions_m, &normals[0]);
        Cloth {
            inverse_base: frames.iter().map(Mat3::inverse).collect(),
            neighbours: neighbours.collect(),
            agreed: (0..triangles.len()).map(agree).collect(),
            edges,
            triangles,
            normals,
        }
    }

    fn measure(&self, garment: &Garment, fit: &FitData, mix: u64) -> Quality {
        let weights = random_weights(mix, fit.parts.len(), fit.size_count());
        let positions_m = mixed(garment, fit, &weights);
        let normals = normals(&self.triangles, &positions_m);
        let is_used =
            |source: usize| source == 0 || weights.iter().skip(source - 1).step_by(fit.size_count()).any(|w| *w > 0.0);
        let used: Vec<&Vec<Vec3>> = self
            .normals
            .iter()
            .enumerate()
            .filter(|(source, _)| is_used(*source))
            .map(|(_, normals)| normals)
            .collect();
        let mut quality = Quality::default();
        for (t, normal) in normals.iter().enumerate() {
            quality.turned += usize::from(used.iter().all(|source| source[t].dot(*normal) < 0.0));
            let is_against_one = used.iter().any(|source| source[t].dot(*normal) < 0.0);
            quality.turned_from_agreed += usize::from(self.agreed[t] && is_against_one);
        }
        let frames = frames(&self.triangles, &positions_m, &normals);
        let gradients: Vec<Mat3> =
            frames.iter().zip(&self.inverse_base).map(|(frame, inverse)| *frame * *inverse).collect();
        let change = |&(s, t, _): &(u32, u32, bool)| {
            let difference = gradients[s as usize] - gradients[t as usize];
            f64::from(difference.to_cols_array().iter().map(|x| x * x).sum::<f32>().sqrt())
        };
        let (across, inside): (Vec<_>, Vec<_>) = self.neighbours.iter().partition(|(_, _, is_across)| *is_across);
        quality.across = quantile(across.iter().map(change).collect(), 99);
        quality.inside = quantile(inside.iter().map(change).collect(), 99);
        quality.ratios = [quality.across / quality.inside; 3];
        let shares = self
            .edges
            .iter()
            .map(|&(a, b, least_m)| positions_m[a as usize].distance(positions_m[b as usize]) / least_m);
        quality.least_edge = f64::from(shares.fold(f32::INFINITY, f32::min));
        quality
    }
}

fn normals(triangles: &[[u32; 3]], positions_m: &[Vec3]) -> Vec<Vec3> {
    let normal = |&[a, b, c]: &[u32; 3]| {
        let [a, b, c] = [a, b, c].map(|v| positions_m[v as usize]);
        (b - a).cross(c - a).normalize_or_zero()
    };
    triangles.iter().map(normal).collect()
}

/// Two edges and the normal of each triangle.
fn frames(triangles: &[[u32; 3]], positions_m: &[Vec3], normals: &[Vec3]) -> Vec<Mat3> {
    let frame = |(&[a, b, c], &normal): (&[u32; 3], &Vec3)| {
        let [a, b, c] = [a, b, c].map(|v| positions_m[v as usize]);
        Mat3::from_cols(b - a, c - a, normal)
    };
    triangles.iter().zip(normals).map(frame).collect()
}

fn quantile(mut values: Vec<f64>, percent: usize) -> f64 {
    if values.is_empty() {
        return 0.0;
    }
    let at = (values.len() - 1) * percent / 100;
    *values.select_nth_unstable_by(at, f64::total_cmp).1
}
