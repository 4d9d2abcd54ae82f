//! Small dense linear algebra in f64 and in a fixed order, so that every machine gets the same bits. Knows nothing of fitting.

use pulp::{Arch, Simd, WithSimd};

/// Replaces the lower triangle of a symmetric matrix, `size` rows, by its Cholesky factor, diagonal inverted. `false` when it is not positive
/// definite.
#[must_use]
#[inline(always)]
pub(crate) fn cholesky(matrix: &mut [f64], size: usize) -> bool {
    for row in 0..size {
        let (above, below) = matrix.split_at_mut(row * size);
        for column in 0..row {
            let earlier = &above[column * size..][..size];
            let sum = below[column] - dot(&below[..column], &earlier[..column]);
            below[column] = sum * earlier[column];
        }
        let pivot = below[row] - dot(&below[..row], &below[..row]);
        if pivot.is_nan() || pivot <= 0.0 {
            return false;
        }
        below[row] = 1.0 / pivot.sqrt();
    }
    true
}

/// Solves with a factor of [`cholesky`].
pub(crate) fn solve(factor: &[f64], size: usize, right: &mut [f64]) {
    solve_lower(factor, size, right);
    solve_upper(factor, size, right);
}

/// L x = right. Compiled for several sets of vector instructions, all of which give the same bits.
pub(crate) fn solve_lower(factor: &[f64], size: usize, right: &mut [f64]) {
    Arch::new().dispatch(Lower { factor, size, right });
}

/// Lᵀ x = right; compiled likewise.
pub(crate) fn solve_upper(factor: &[f64], size: usize, right: &mut [f64]) {
    Arch::new().dispatch(Upper { factor, size, right });
}

struct Lower<'a> {
    factor: &'a [f64],
    size: usize,
    right: &'a mut [f64],
}

impl WithSimd for Lower<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        let Lower { factor, size, right } = self;
        for row in 0..size {
            let line = &factor[row * size..][..=row];
            right[row] = (right[row] - dot(&line[..row], &right[..row])) * line[row];
        }
    }
}

struct Upper<'a> {
    factor: &'a [f64],
    size: usize,
    right: &'a mut [f64],
}

impl WithSimd for Upper<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        let Upper { factor, size, right } = self;
        for row in (0..size).rev() {
            let line = &factor[row * size..][..=row];
            let value = right[row] * line[row];
            right[row] = value;
            add_scaled(&mut right[..row], -value, &line[..row]);
        }
    }
}

/// The sum of products; eight sums side by side, for vector instructions.
#[inline(always)]
pub(crate) fn dot(a: &[f64], b: &[f64]) -> f64 {
    let (a_eights, a_rest) = a.as_chunks::<8>();
    let (b_eights, b_rest) = b.as_chunks::<8>();
    let mut sums = [0.0; 8];
    for (a, b) in a_eights.iter().zip(b_eights) {
        for lane in 0..8 {
            sums[lane] += a[lane] * b[lane];
        }
    }
    let rest: f64 = a_rest.iter().zip(b_rest).map(|(a, b)| a * b).sum();
    ((sums[0] + sums[4]) + (sums[1] + sums[5])) + ((sums[2] + sums[6]) + (sums[3] + sums[7])) + rest
}

/// sums += scale * values
#[inline(always)]
pub(crate) fn add_scaled(sums: &mut [f64], scale: f64, values: &[f64]) {
    for (sum, value) in sums.iter_mut().zip(values) {
        *sum += scale * value;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn what_is_solved_gives_the_right_side_again(values in prop::collection::vec(-1.0..1.0f64, 49), right in prop::collection::vec(-1.0..1.0f64, 7)) {
            let mut matrix = vec![0.0; 49];
            for i in 0..7 {
                for j in 0..7 {
                    matrix[i * 7 + j] = dot(&values[i * 7..][..7], &values[j * 7..][..7]) + f64::from(u8::from(i == j));
                }
            }
            let mut factor = matrix.clone();
            prop_assert!(cholesky(&mut factor, 7));
            let mut solution = right.clone();
            solve(&factor, 7, &mut solution);
            for i in 0..7 {
                prop_assert!((dot(&matrix[i * 7..][..7], &solution) - right[i]).abs() < 1e-9);
            }
        }
    }

    #[test]
    fn an_indefinite_matrix_has_no_factor() {
        assert!(!cholesky(&mut [1.0, 2.0, 2.0, 1.0], 2));
        assert!(!cholesky(&mut [f64::NAN], 1));
    }
}
