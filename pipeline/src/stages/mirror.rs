//! What the samples' shapes have to do with each other over the cloth of one limb, and what the other side's, mirrored, look like in
//! them. Knows no poses.

use super::correctives::shares;
use super::kernel::Limb;
use super::matrix::Matrix;
use glam::Vec3;
use kitsuke::arrays::{GarmentData, Mesh, Target};
use kitsuke::pose_blend::rbf::rows_of_layer;
use rayon::prelude::*;

/// How far a vertex may lie from its counterpart's mirror image for a normal that turns away by a right angle, metres: tells the two sheets of
/// a sleeve apart.
const NORMAL_M: f32 = 0.03;

/// Ridge of the blends, as a share of the shapes' mean square: blends that cancel would magnify what samples do not share.
const BLEND_RIDGE: f64 = 0.01;

/// Inner products of the samples' deltas over the cloth that a limb owns, m² per vertex of the garment.
#[derive(Clone, Debug)]
pub struct Shapes {
    /// Of the layer's samples, the base first.
    pub own: Matrix,
    /// Of each mirrored sample but the base with every sample, row by row; empty where there is no other side.
    mirrored: Vec<f64>,
}

/// The shapes of a layer's samples, limb by limb.
#[must_use]
pub fn shapes(data: &GarmentData, layer: usize, limbs: &[Limb]) -> Vec<Shapes> {
    let rows = rows_of_layer(data, layer);
    let deltas_m: Vec<Vec<Vec3>> = rows[1..].par_iter().map(|row| deltas_m(data, &data.targets[row - 1])).collect();
    let owners: Vec<Vec<f32>> = limbs.iter().map(|limb| shares(&data.segments, &limb.drivers)).collect();
    let normals = normals(&data.mesh);
    let of_limb = |(limb, owner): (&Limb, &Vec<f32>)| {
        let owned: Vec<usize> = (0..owner.len()).filter(|&v| owner[v] > 0.0).collect();
        let weighted = |place: &dyn Fn(usize) -> Vec3| -> Vec<Vec3> {
            owned.iter().map(|&v| place(v) * owner[v].sqrt()).collect()
        };
        let own: Vec<Vec<Vec3>> = deltas_m.iter().map(|deltas| weighted(&|v| deltas[v])).collect();
        let mirrored: Vec<Vec<Vec3>> = match limb.mirror {
            None => Vec::new(),
            Some(other) => {
                let counterparts = counterparts(&data.mesh, &normals, &owned, &owners[other]);
                let image = |deltas: &Vec<Vec3>| {
                    let images = counterparts.iter().zip(&owned).map(|(&other, &v)| {
                        other.map_or(Vec3::ZERO, |other| mirrored(deltas[other]) * owner[v].sqrt())
                    });
                    images.collect()
                };
                deltas_m.iter().map(image).collect()
            }
        };
        let vertices = owner.len() as f64;
        let product = |a: &[Vec3], b: &[Vec3]| -> f64 {
            a.iter().zip(b).map(|(a, b)| f64::from(a.dot(*b))).sum::<f64>() / vertices
        };
        let with_all = |shape: &Vec<Vec3>| -> Vec<f64> {
            std::iter::once(0.0).chain(own.iter().map(|other| product(shape, other))).collect()
        };
        let of_own: Vec<f64> = own.par_iter().flat_map_iter(with_all).collect();
        let samples = rows.len();
        Shapes {
            own: Matrix::new(samples, |i, j| if i == 0 { 0.0 } else { of_own[(i - 1) * samples + j] }),
            mirrored: mirrored.par_iter().flat_map_iter(with_all).collect(),
        }
    };
    limbs.iter().zip(&owners).map(of_limb).collect()
}

impl Shapes {
    /// Every mirrored sample as the blend of samples that comes nearest to it: one row per mirrored sample, one column per sample, the base
    /// first. Neither the sample `left_out` nor its mirror image counts; 0 leaves out none, for the base has no shape.
    #[must_use]
    pub fn blends_without(&self, left_out: usize) -> Vec<f64> {
        let samples = self.own.size;
        let kept: Vec<usize> = (1..samples).filter(|&sample| sample != left_out).collect();
        let mut blends = vec![0.0; self.mirrored.len()];
        let trace: f64 = kept.iter().map(|&sample| self.own.at(sample, sample)).sum();
        let ridge = BLEND_RIDGE * trace / kept.len().max(1) as f64;
        let system = Matrix::new(kept.len(), |i, j| self.own.at(kept[i], kept[j]) + if i == j { ridge } else { 0.0 });
        // Samples without any shape, in the limb's cloth, have no blend.
        let Some(factor) = system.cholesky() else { return blends };
        let rows = blends.chunks_exact_mut(samples).zip(self.mirrored.chunks_exact(samples)).zip(1..);
        for ((blend, products), _) in rows.filter(|(_, sample)| *sample != left_out) {
            let wanted: Vec<f64> = kept.iter().map(|&sample| products[sample]).collect();
            kept.iter().zip(factor.solve_twice(&wanted)).for_each(|(&sample, share)| blend[sample] = share);
        }
        blends
    }

    /// The same without a sample, when its row is gone from the pose table.
    #[must_use]
    pub fn without(&self, left_out: usize) -> Shapes {
        let samples = self.own.size;
        let kept: Vec<usize> = (0..samples).filter(|&sample| sample != left_out).collect();
        let rows = self.mirrored.chunks_exact(samples).zip(1..).filter(|(_, sample)| *sample != left_out);
        Shapes {
            own: Matrix::new(kept.len(), |i, j| self.own.at(kept[i], kept[j])),
            mirrored: rows.flat_map(|(row, _)| kept.iter().map(|&sample| row[sample])).collect(),
        }
    }
}

/// The deltas of a target, for every unique vertex, metres.
fn deltas_m(data: &GarmentData, target: &Target) -> Vec<Vec3> {
    let mut deltas_m = vec![Vec3::ZERO; data.mesh.positions_m.len()];
    for (v, step) in target.vertices(&data.segments).zip(&target.deltas) {
        deltas_m[v] = Vec3::from_array(step.map(f32::from)) * target.step_m;
    }
    deltas_m
}

/// A vector as the mirror at the plane X = 0 shows it.
fn mirrored(v: Vec3) -> Vec3 {
    Vec3::new(-v.x, v.y, v.z)
}

/// For each of these vertices the vertex, among those that the other limb owns, whose mirror image is nearest in place and normal.
fn counterparts(mesh: &Mesh, normals: &[Vec3], owned: &[usize], other: &[f32]) -> Vec<Option<usize>> {
    let images: Vec<(usize, Vec3, Vec3)> = (0..other.len())
        .filter(|&v| other[v] > 0.0)
        .map(|v| (v, mirrored(mesh.positions_m[v]), mirrored(normals[v]) * NORMAL_M))
        .collect();
    let nearest = |v: &usize| {
        let (place, normal) = (mesh.positions_m[*v], normals[*v] * NORMAL_M);
        let apart = |image: &(usize, Vec3, Vec3)| image.1.distance_squared(place) + image.2.distance_squared(normal);
        images.iter().min_by(|a, b| apart(a).total_cmp(&apart(b))).map(|image| image.0)
    };
    owned.par_iter().map(nearest).collect()
}

/// Unit normals of the unique vertices in the T-pose; zero where there is no area.
fn normals(mesh: &Mesh) -> Vec<Vec3> {
    let mut normals = vec![Vec3::ZERO; mesh.positions_m.len()];
    let welded = mesh.triangles.iter().map(|corners| corners.map(|v| mesh.unique(v)));
    kitsuke::vertex_normals(&mesh.positions_m, welded, &mut normals);
    normals
}
