//! The equations of a round: a sparse symmetric matrix that is one number per pair of vertices, a block of each vertex's own, and conjugate
//! gradients. Knows no cloth.

use glam::{DMat3, DVec3};
use kitsuke::sparse_cholesky::SparseCholesky;
use rayon::prelude::*;

/// A symmetric matrix by rows.
pub(super) struct Matrix {
    starts: Vec<usize>,
    columns: Vec<u32>,
    values: Vec<f64>,
}

impl Matrix {
    /// From entries of one triangle and the diagonal; those that stand at one place are added up.
    pub fn new(size: usize, entries: &[(u32, u32, f64)]) -> Matrix {
        let mirrored = entries.iter().filter(|(a, b, _)| a != b).map(|&(a, b, value)| (b, a, value));
        let mut all: Vec<(u32, u32, f64)> = entries.iter().copied().chain(mirrored).collect();
        all.sort_by_key(|&(a, b, _)| (a, b));
        let (mut starts, mut columns, mut values) = (vec![0; size + 1], Vec::new(), Vec::new());
        for same in all.chunk_by(|a, b| (a.0, a.1) == (b.0, b.1)) {
            columns.push(same[0].1);
            values.push(same.iter().map(|entry| entry.2).sum());
            starts[same[0].0 as usize + 1] = columns.len();
        }
        for row in 0..size {
            starts[row + 1] = starts[row + 1].max(starts[row]);
        }
        Matrix { starts, columns, values }
    }

    fn times(&self, row: usize, x: &[DVec3]) -> DVec3 {
        let range = self.starts[row]..self.starts[row + 1];
        self.columns[range.clone()].iter().zip(&self.values[range]).map(|(&c, &value)| x[c as usize] * value).sum()
    }
}

/// Solves (held + own) x = right by conjugate gradients from where x is, with the factor of a matrix that is near for a preconditioner.
pub(super) fn solve(held: &Matrix, own: &[DMat3], near: &SparseCholesky, right: &[DVec3], x: &mut [DVec3]) {
    /// The residual, in the preconditioner's measure, has to fall by this factor.
    const LEFT: f64 = 1e-8;
    const STEPS: usize = 60;
    let times = |x: &[DVec3]| -> Vec<DVec3> {
        (0..x.len()).into_par_iter().map(|v| held.times(v, x) + own[v] * x[v]).collect()
    };
    let dot = |a: &[DVec3], b: &[DVec3]| a.iter().zip(b).map(|(a, b)| a.dot(*b)).sum::<f64>();
    let mut scratch = vec![[0.0; 3]; x.len()];
    let mut conditioned = |residual: &[DVec3]| -> Vec<DVec3> {
        let mut solved: Vec<[f64; 3]> = residual.iter().map(|p| p.to_array()).collect();
        near.solve(&mut solved, &mut scratch);
        solved.into_iter().map(DVec3::from_array).collect()
    };
    let mut residual: Vec<DVec3> = right.iter().zip(times(x)).map(|(b, ax)| *b - ax).collect();
    let mut z = conditioned(&residual);
    let mut direction = z.clone();
    let mut size = dot(&residual, &z);
    let first = size;
    for _ in 0..STEPS {
        if size <= LEFT * LEFT * first || size == 0.0 {
            break;
        }
        let image = times(&direction);
        let step = size / dot(&direction, &image);
        for v in 0..x.len() {
            x[v] += step * direction[v];
            residual[v] -= step * image[v];
        }
        z = conditioned(&residual);
        let next = dot(&residual, &z);
        direction = z.iter().zip(&direction).map(|(z, d)| *z + *d * (next / size)).collect();
        size = next;
    }
}
