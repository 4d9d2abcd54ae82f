//! The rotation in a matrix, and the rigid motion between two sets of places. Plain f64, the same bits everywhere.

use glam::{DMat3, DMat4, DQuat, DVec3, DVec4};

/// The rotation that is nearest to a matrix in the least-squares sense, reflections left out (Horn 1987: the largest eigenvector of a
/// symmetric 4 × 4 matrix, here by Jacobi rotations). The identity for a matrix of zeros.
pub(super) fn nearest_rotation(m: DMat3) -> DMat3 {
    // m takes b to a: s[i][j] = sum of b_i a_j is its transpose.
    let s = m.transpose();
    let at = |row: usize, column: usize| s.col(column)[row];
    let (xx, xy, xz) = (at(0, 0), at(0, 1), at(0, 2));
    let (yx, yy, yz) = (at(1, 0), at(1, 1), at(1, 2));
    let (zx, zy, zz) = (at(2, 0), at(2, 1), at(2, 2));
    let n = DMat4::from_cols_array_2d(&[
        [xx + yy + zz, yz - zy, zx - xz, xy - yx],
        [yz - zy, xx - yy - zz, xy + yx, zx + xz],
        [zx - xz, xy + yx, -xx + yy - zz, yz + zy],
        [xy - yx, zx + xz, yz + zy, -xx - yy + zz],
    ]);
    let (values, vectors) = eigenvectors(n);
    let largest = (0..4).max_by(|&a, &b| values[a].total_cmp(&values[b])).expect("four");
    let q = vectors.col(largest);
    DMat3::from_quat(DQuat::from_xyzw(q.y, q.z, q.w, q.x).normalize())
}

/// Eigenvalues and eigenvectors (columns) of a symmetric matrix, by Jacobi's rotations.
fn eigenvectors(mut n: DMat4) -> (DVec4, DMat4) {
    let mut vectors = DMat4::IDENTITY;
    for _ in 0..12 {
        let of = |i: usize, j: usize| n.col(j)[i];
        let off: f64 = (0..4).flat_map(|i| (0..i).map(move |j| (i, j))).map(|(i, j)| of(i, j) * of(i, j)).sum();
        let on: f64 = (0..4).map(|i| of(i, i) * of(i, i)).sum();
        if off <= 1e-28 * on {
            break;
        }
        for p in 0..4 {
            for q in p + 1..4 {
                let between = n.col(q)[p];
                if between == 0.0 {
                    continue;
                }
                let theta = (n.col(q)[q] - n.col(p)[p]) / (2.0 * between);
                let t = theta.signum() / (theta.abs() + (theta * theta + 1.0).sqrt());
                let c = 1.0 / (t * t + 1.0).sqrt();
                let s = t * c;
                let mut turn = DMat4::IDENTITY;
                turn.col_mut(p)[p] = c;
                turn.col_mut(q)[q] = c;
                turn.col_mut(p)[q] = -s;
                turn.col_mut(q)[p] = s;
                n = turn.transpose() * n * turn;
                vectors *= turn;
            }
        }
    }
    (DVec4::new(n.x_axis.x, n.y_axis.y, n.z_axis.z, n.w_axis.w), vectors)
}

/// A rotation and then a shift: neither scale nor reflection.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Rigid {
    /// The rotation.
    pub rotation: DMat3,
    /// Metres.
    pub shift_m: DVec3,
}

impl Rigid {
    /// Nothing moves.
    pub const IDENTITY: Rigid = Rigid { rotation: DMat3::IDENTITY, shift_m: DVec3::ZERO };

    /// Where a place goes, metres.
    #[must_use]
    pub fn place(&self, p: DVec3) -> DVec3 {
        self.rotation * p + self.shift_m
    }

    /// This motion after another one.
    #[must_use]
    pub fn after(&self, first: &Rigid) -> Rigid {
        Rigid { rotation: self.rotation * first.rotation, shift_m: self.place(first.shift_m) }
    }

    /// The one that takes `from` nearest to `to` (metres, one by one, with weights), in the least-squares sense (Horn 1987).
    ///
    /// # Panics
    /// When there are not as many of each.
    #[must_use]
    pub fn between(from: &[DVec3], to: &[DVec3], weights: &[f64]) -> Rigid {
        assert!(from.len() == to.len() && from.len() == weights.len(), "one of each");
        let total: f64 = weights.iter().sum();
        if total <= 0.0 {
            return Rigid::IDENTITY;
        }
        let mean = |places: &[DVec3]| places.iter().zip(weights).map(|(&p, &w)| p * w).sum::<DVec3>() / total;
        let (from_mean, to_mean) = (mean(from), mean(to));
        let mut sum = DMat3::ZERO;
        for ((&from, &to), &weight) in from.iter().zip(to).zip(weights) {
            sum += outer((to - to_mean) * weight, from - from_mean);
        }
        let rotation = nearest_rotation(sum);
        Rigid { rotation, shift_m: to_mean - rotation * from_mean }
    }
}

/// a bᵀ.
pub(super) fn outer(a: DVec3, b: DVec3) -> DMat3 {
    DMat3::from_cols(a * b.x, a * b.y, a * b.z)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rotations_are_found_and_never_mirrored() {
        for turn in [0.0, 0.3, 1.5, 3.1] {
            let rotation = DMat3::from_axis_angle(DVec3::new(0.3, -0.5, 0.8).normalize(), turn);
            let stretched = rotation * DMat3::from_diagonal(DVec3::new(0.9, 1.2, 0.1));
            assert!((nearest_rotation(stretched) - rotation).abs_diff_eq(DMat3::ZERO, 1e-9), "{turn}");
        }
        let mirror = DMat3::from_diagonal(DVec3::new(-1.0, 1.0, 1.0));
        assert!((nearest_rotation(mirror).determinant() - 1.0).abs() < 1e-9);
        let from = [DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::Z];
        let motion = Rigid { rotation: DMat3::from_rotation_y(0.7), shift_m: DVec3::new(1.0, -2.0, 3.0) };
        let found = Rigid::between(&from, &from.map(|p| motion.place(p)), &[1.0, 2.0, 0.5, 1.0]);
        assert!(
            (found.rotation - motion.rotation).abs_diff_eq(DMat3::ZERO, 1e-9)
                && found.shift_m.abs_diff_eq(motion.shift_m, 1e-9)
        );
    }
}
