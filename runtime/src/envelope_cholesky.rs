//! Solves sparse symmetric positive definite systems: Cholesky factors kept as the envelope (skyline) of the matrix in reverse
//! Cuthill–McKee order, which suits meshes that are longer than wide. Knows nothing of meshes.
//!
//! Plain f64 in a fixed order, so that every machine gets the same bits; sparse libraries choose their kernels by the processor.

use std::collections::VecDeque;

/// Most entries that the factor's envelope may have, 512 MiB.
pub const ENVELOPE_ENTRIES: usize = 1 << 26;

/// The Cholesky factor L of a matrix A = L·Lᵀ, rows and columns reordered.
#[derive(Clone, Debug)]
pub struct EnvelopeCholesky {
    /// The unknown that stands in each row.
    unknown_of: Vec<u32>,
    /// Where each row of the envelope begins in `factor`; one more than there are rows.
    starts: Vec<usize>,
    /// Rows of L from their first entry to the diagonal, one after the other. The diagonal is stored as its inverse.
    factor: Vec<f64>,
}

/// Why a matrix was not factored.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum FactorError {
    /// It is singular, indefinite, or holds a NaN.
    #[error("the matrix is not positive definite at unknown {unknown}")]
    NotPositiveDefinite {
        /// The unknown whose pivot is not above 0.
        unknown: usize,
    },
    /// Its unknowns are so entangled that the factor would not fit.
    #[error("the factor would have {entries} entries; at most {ENVELOPE_ENTRIES} are possible")]
    TooLarge {
        /// How many there would be.
        entries: usize,
    },
}

impl EnvelopeCholesky {
    /// Factors a symmetric matrix of `size` unknowns, given by `entries` (row, column, value) of one triangle and the diagonal.
    /// Entries that occur more than once are added up, in their order.
    ///
    /// # Errors
    /// When the matrix is not positive definite or its factor too large.
    ///
    /// # Panics
    /// When a row or column is not below `size`.
    pub fn new(size: usize, entries: &[(u32, u32, f64)]) -> Result<EnvelopeCholesky, FactorError> {
        let unknown_of = reverse_cuthill_mckee(size, entries);
        let mut row_of = vec![0; size];
        for (row, &unknown) in unknown_of.iter().enumerate() {
            row_of[unknown as usize] = row;
        }
        let place = |&(a, b, _): &(u32, u32, f64)| {
            let (a, b) = (row_of[a as usize], row_of[b as usize]);
            (a.max(b), a.min(b))
        };
        let mut first: Vec<usize> = (0..size).collect();
        for entry in entries {
            let (row, column) = place(entry);
            first[row] = first[row].min(column);
        }
        let mut starts = vec![0];
        for (row, first) in first.iter().enumerate() {
            starts.push(starts[row] + row + 1 - first);
        }
        if starts[size] > ENVELOPE_ENTRIES {
            return Err(FactorError::TooLarge { entries: starts[size] });
        }
        let mut factor = vec![0.0; starts[size]];
        for entry in entries {
            let (row, column) = place(entry);
            factor[starts[row] + column - first[row]] += entry.2;
        }
        for row in 0..size {
            let (above, this) = factor.split_at_mut(starts[row]);
            let this = &mut this[..starts[row + 1] - starts[row]];
            for column in first[row]..row {
                let from = first[row].max(first[column]);
                let other = &above[starts[column] + from - first[column]..starts[column + 1]];
                let (inverse, other) = other.split_last().expect("every row has a diagonal");
                let at = column - first[row];
                let sum = dot(&this[from - first[row]..at], other);
                this[at] = (this[at] - sum) * inverse;
            }
            let (diagonal, left) = this.split_last_mut().expect("every row has a diagonal");
            let pivot = *diagonal - dot(left, left);
            if !(pivot > 0.0 && pivot < f64::INFINITY) {
                return Err(FactorError::NotPositiveDefinite { unknown: unknown_of[row] as usize });
            }
            *diagonal = 1.0 / pivot.sqrt();
        }
        Ok(EnvelopeCholesky { unknown_of, starts, factor })
    }

    /// How many unknowns there are.
    #[must_use]
    pub fn size(&self) -> usize {
        self.unknown_of.len()
    }

    /// How many numbers the factor has; a solve multiplies twice with each.
    #[must_use]
    pub fn entries(&self) -> usize {
        self.factor.len()
    }

    /// Solves A x = b for `N` right-hand sides at once. `x` holds b and then x, `scratch` anything; both have one row per
    /// unknown. Allocates nothing.
    ///
    /// # Panics
    /// When one of the two has another length than [`EnvelopeCholesky::size`].
    pub fn solve<const N: usize>(&self, x: &mut [[f64; N]], scratch: &mut [[f64; N]]) {
        assert_eq!((x.len(), scratch.len()), (self.size(), self.size()), "one row per unknown");
        for (row, &unknown) in self.unknown_of.iter().enumerate() {
            let (inverse, left) = self.row(row);
            let mut sum = x[unknown as usize];
            for (l, known) in left.iter().zip(&scratch[row - left.len()..row]) {
                for (sum, known) in sum.iter_mut().zip(known) {
                    *sum -= l * known;
                }
            }
            scratch[row] = sum.map(|sum| sum * inverse);
        }
        for (row, &unknown) in self.unknown_of.iter().enumerate().rev() {
            let (inverse, left) = self.row(row);
            let solved = scratch[row].map(|value| value * inverse);
            x[unknown as usize] = solved;
            for (l, open) in left.iter().zip(&mut scratch[row - left.len()..row]) {
                for (open, solved) in open.iter_mut().zip(&solved) {
                    *open -= l * solved;
                }
            }
        }
    }

    /// The inverse of a row's diagonal, and the row's entries left of it.
    fn row(&self, row: usize) -> (f64, &[f64]) {
        let (inverse, left) =
            self.factor[self.starts[row]..self.starts[row + 1]].split_last().expect("every row has a diagonal");
        (*inverse, left)
    }
}

/// The sum of products in eight interleaved sums: a fixed order that vector registers can hold.
fn dot(a: &[f64], b: &[f64]) -> f64 {
    let mut sums = [0.0; 8];
    let (a, b) = (a.chunks_exact(8), b.chunks_exact(8));
    let rest: f64 = a.remainder().iter().zip(b.remainder()).map(|(a, b)| a * b).sum();
    for (a, b) in a.zip(b) {
        for (sum, (a, b)) in sums.iter_mut().zip(a.iter().zip(b)) {
            *sum += a * b;
        }
    }
    let [s0, s1, s2, s3, s4, s5, s6, s7] = sums;
    (((s0 + s4) + (s1 + s5)) + ((s2 + s6) + (s3 + s7))) + rest
}

/// An order of the unknowns in which those that share an entry stand near each other: breadth first from an unknown at the rim,
/// those with few neighbours first, and then reversed (George 1971).
fn reverse_cuthill_mckee(size: usize, entries: &[(u32, u32, f64)]) -> Vec<u32> {
    let mut pairs: Vec<(u32, u32)> =
        entries.iter().filter(|(a, b, _)| a != b).flat_map(|&(a, b, _)| [(a, b), (b, a)]).collect();
    pairs.sort_unstable();
    pairs.dedup();
    let mut starts = vec![0; size + 1];
    for &(a, _) in &pairs {
        starts[a as usize + 1] += 1;
    }
    for i in 0..size {
        starts[i + 1] += starts[i];
    }
    let degree = |unknown: u32| starts[unknown as usize + 1] - starts[unknown as usize];
    // Neighbours with few neighbours first.
    for unknown in 0..size {
        pairs[starts[unknown]..starts[unknown + 1]].sort_by_key(|&(_, neighbour)| (degree(neighbour), neighbour));
    }
    let neighbours = |unknown: u32| &pairs[starts[unknown as usize]..starts[unknown as usize + 1]];
    let mut order = Vec::with_capacity(size);
    let mut level = vec![u32::MAX; size];
    for start in 0..size as u32 {
        if level[start as usize] != u32::MAX {
            continue;
        }
        // From the far end of the far end: a rim, found in two or three rounds.
        let begin = order.len();
        let (mut root, mut depth) = (start, 0);
        loop {
            order.truncate(begin);
            breadth_first(root, neighbours, &mut level, &mut order);
            let deepest = level[order[order.len() - 1] as usize];
            if deepest <= depth && root != start {
                break;
            }
            depth = deepest;
            let last_level = order[begin..].iter().copied().filter(|&unknown| level[unknown as usize] == deepest);
            let next = last_level.min_by_key(|&unknown| (degree(unknown), unknown)).expect("the root at least");
            if next == root {
                break;
            }
            order[begin..].iter().for_each(|&unknown| level[unknown as usize] = u32::MAX);
            root = next;
        }
    }
    order.reverse();
    order
}

/// Appends everything that `root` reaches, nearest first, and marks each with its distance.
fn breadth_first<'a>(root: u32, neighbours: impl Fn(u32) -> &'a [(u32, u32)], level: &mut [u32], order: &mut Vec<u32>) {
    let mut queue = VecDeque::from([root]);
    level[root as usize] = 0;
    while let Some(unknown) = queue.pop_front() {
        order.push(unknown);
        for &(_, neighbour) in neighbours(unknown) {
            if level[neighbour as usize] == u32::MAX {
                level[neighbour as usize] = level[unknown as usize] + 1;
                queue.push_back(neighbour);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// The Laplacian of a `width` by `height` grid plus the identity.
    fn grid(width: u32, height: u32) -> Vec<(u32, u32, f64)> {
        let mut entries = Vec::new();
        for y in 0..height {
            for x in 0..width {
                let v = y * width + x;
                entries.push((v, v, 1.0));
                for other in [(x + 1 < width).then(|| v + 1), (y + 1 < height).then(|| v + width)].into_iter().flatten()
                {
                    entries.extend([(v, v, 1.0), (other, other, 1.0), (v, other, -1.0)]);
                }
            }
        }
        entries
    }

    fn product(entries: &[(u32, u32, f64)], x: &[[f64; 2]]) -> Vec<[f64; 2]> {
        let mut y = vec![[0.0; 2]; x.len()];
        for &(a, b, value) in entries {
            let (a, b) = (a as usize, b as usize);
            for k in 0..2 {
                y[a][k] += value * x[b][k];
                if a != b {
                    y[b][k] += value * x[a][k];
                }
            }
        }
        y
    }

    proptest! {
        /// Sums of squares along random edges plus a random diagonal, pieces not joined included.
        #[test]
        fn the_solution_solves(
            edges in prop::collection::vec((0u32..40, 0u32..40, 0.01f64..10.0), 0..120),
            diagonal in prop::collection::vec(0.01f64..2.0, 40),
            wanted in prop::collection::vec(prop::array::uniform2(-5.0f64..5.0), 40),
        ) {
            let mut entries: Vec<_> = diagonal.iter().zip(0..).map(|(&d, v)| (v, v, d)).collect();
            for (a, b, weight) in edges.into_iter().filter(|(a, b, _)| a != b) {
                entries.extend([(a, a, weight), (b, b, weight), (a, b, -weight)]);
            }
            let factor = EnvelopeCholesky::new(40, &entries).unwrap();
            let mut x = product(&entries, &wanted);
            factor.solve(&mut x, &mut vec![[f64::NAN; 2]; 40]);
            for (x, wanted) in x.iter().flatten().zip(wanted.iter().flatten()) {
                prop_assert!((x - wanted).abs() < 1e-9, "{x} is not {wanted}");
            }
        }
    }

    #[test]
    fn a_grid_has_a_narrow_envelope_however_it_is_numbered() {
        let (width, height) = (8, 100);
        let shuffled = |v: u32| v * 347 % (width * height);
        let entries: Vec<_> =
            grid(width, height).into_iter().map(|(a, b, value)| (shuffled(a), shuffled(b), value)).collect();
        let factor = EnvelopeCholesky::new((width * height) as usize, &entries).unwrap();
        assert!(factor.entries() < (width + 2) as usize * factor.size(), "{} entries", factor.entries());
    }

    #[test]
    fn what_is_not_positive_definite_is_named() {
        let error = |entries: &[(u32, u32, f64)]| EnvelopeCholesky::new(2, entries).unwrap_err();
        for last in [0.0, 1.0, -1.0, f64::NAN, f64::INFINITY] {
            let entries = [(0, 0, 1.0), (0, 1, 1.0), (1, 1, last)];
            assert!(matches!(error(&entries), FactorError::NotPositiveDefinite { .. }), "{last}");
        }
        assert_eq!(error(&[(0, 0, 1.0)]), FactorError::NotPositiveDefinite { unknown: 1 });
    }

    #[test]
    fn an_entangled_matrix_is_refused_before_anything_is_allocated() {
        let size = 1 << 14;
        let hub = (1..size).map(|v| (0, v, -1.0));
        let far = (1..size).map(|v| (v, size - v, -1.0));
        let spread = (1..size).map(|v| (v, v * 7919 % size, -1.0));
        let entries: Vec<_> = hub.chain(far).chain(spread).collect();
        let error = EnvelopeCholesky::new(size as usize, &entries).unwrap_err();
        assert!(matches!(error, FactorError::TooLarge { .. }), "{error}");
    }

    #[test]
    fn no_unknowns_are_no_trouble() {
        EnvelopeCholesky::new(0, &[]).unwrap().solve::<1>(&mut [], &mut []);
    }
}
