//! Small dense matrices. Own ones, because the linear algebra libraries choose their kernels by the processor, and packs must be the same
//! bytes on every machine.

/// Eigenvalues, the largest first, and unit eigenvectors of a symmetric matrix, by Jacobi's rotations.
pub fn principal(size: usize, at: impl Fn(usize, usize) -> f64) -> Vec<(f64, Vec<f64>)> {
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

/// A square matrix.
#[derive(Clone, Debug)]
pub struct Matrix {
    /// Rows and columns.
    pub size: usize,
    rows: Vec<f64>,
}

impl Matrix {
    /// Of these entries, by row and column.
    pub fn new(size: usize, at: impl Fn(usize, usize) -> f64) -> Matrix {
        Matrix { size, rows: (0..size * size).map(|i| at(i / size, i % size)).collect() }
    }

    /// An entry.
    pub fn at(&self, i: usize, j: usize) -> f64 {
        self.rows[i * self.size + j]
    }

    /// A row.
    pub fn row(&self, i: usize) -> &[f64] {
        &self.rows[i * self.size..(i + 1) * self.size]
    }

    /// The product with a vector.
    pub fn times_vector(&self, x: &[f64]) -> Vec<f64> {
        (0..self.size).map(|i| self.row(i).iter().zip(x).map(|(a, x)| a * x).sum()).collect()
    }

    /// x · M x.
    pub fn quadratic_form(&self, x: &[f64]) -> f64 {
        self.times_vector(x).iter().zip(x).map(|(a, x)| a * x).sum()
    }

    /// The lower Cholesky factor, if the matrix is symmetric and positive definite.
    pub fn cholesky(&self) -> Option<Matrix> {
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

    /// The solution of `L Lᵀ x = b` for this lower factor `L`.
    pub fn solve_twice(&self, b: &[f64]) -> Vec<f64> {
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
    pub fn inverse(&self) -> Option<Matrix> {
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
