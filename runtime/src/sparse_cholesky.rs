//! Solves sparse symmetric positive definite systems: Cholesky factors with unknowns in nested dissection order (George 1973), which keeps
//! factors of meshes small whatever their shape. Knows nothing of meshes.
//!
//! Plain f64 in a fixed order, neither fused nor reordered, so that every machine gets the same bits. Only how many right-hand sides a
//! register holds depends on the processor.

use crate::envelope_cholesky::FactorError;
use pulp::Arch;

/// Most entries that the factor may have, 768 MiB with their rows.
pub const ENTRIES: usize = 1 << 26;
/// So few unknowns are not divided further.
const LEAF: usize = 48;
/// How often unknowns are divided at most, so that no matrix takes long to order.
const DIVISIONS: u32 = 48;
/// No row.
const NONE: u32 = u32::MAX;

/// The Cholesky factor L of a matrix A = L·Lᵀ, rows and columns reordered.
#[derive(Clone, Debug)]
pub struct SparseCholesky {
    /// The unknown that stands in each row.
    unknown_of: Vec<u32>,
    /// Where each column's entries below the diagonal begin; one more than there are columns.
    starts: Vec<usize>,
    /// Rows of the entries, ascending in each column.
    rows: Vec<u32>,
    values: Vec<f64>,
    inverse_diagonal: Vec<f64>,
}

/// A matrix's lower triangle, row by row: columns left of the diagonal, ascending.
struct Lower {
    starts: Vec<usize>,
    columns: Vec<u32>,
    values: Vec<f64>,
    diagonal: Vec<f64>,
}

impl SparseCholesky {
    /// Factors a symmetric matrix of `size` unknowns, given by `entries` (row, column, value) of one triangle and the diagonal.
    /// Entries that occur more than once are added up, in their order.
    ///
    /// # Errors
    /// When the matrix is not positive definite or its factor too large.
    ///
    /// # Panics
    /// When a row or column is not below `size`.
    pub fn new(size: usize, entries: &[(u32, u32, f64)]) -> Result<SparseCholesky, FactorError> {
        let unknown_of = nested_dissection(size, entries);
        let lower = Lower::new(&unknown_of, entries);
        let parent = elimination_tree(&lower);
        let mut marks = vec![NONE; size];
        let mut pattern = Vec::new();
        let mut counts = vec![0; size];
        let mut count = 0;
        for row in 0..size {
            row_pattern(&lower, &parent, row, &mut marks, &mut pattern);
            pattern.iter().for_each(|&column| counts[column as usize] += 1);
            count += pattern.len();
            if count > ENTRIES {
                return Err(FactorError::TooLarge { entries: count });
            }
        }
        let mut starts = vec![0; size + 1];
        for column in 0..size {
            starts[column + 1] = starts[column] + counts[column];
        }
        let mut ends = starts.clone();
        let (mut rows, mut values) = (vec![0; count], vec![0.0; count]);
        let mut inverse_diagonal = vec![0.0; size];
        let mut open = vec![0.0; size];
        marks.fill(NONE);
        for row in 0..size {
            row_pattern(&lower, &parent, row, &mut marks, &mut pattern);
            let mut pivot = lower.diagonal[row];
            for at in lower.starts[row]..lower.starts[row + 1] {
                open[lower.columns[at] as usize] = lower.values[at];
            }
            for &column in &pattern {
                let column = column as usize;
                let value = std::mem::take(&mut open[column]) * inverse_diagonal[column];
                for at in starts[column]..ends[column] {
                    open[rows[at] as usize] -= values[at] * value;
                }
                pivot -= value * value;
                rows[ends[column]] = row as u32;
                values[ends[column]] = value;
                ends[column] += 1;
            }
            if !(pivot > 0.0 && pivot < f64::INFINITY) {
                return Err(FactorError::NotPositiveDefinite { unknown: unknown_of[row] as usize });
            }
            inverse_diagonal[row] = 1.0 / pivot.sqrt();
        }
        Ok(SparseCholesky { unknown_of, starts, rows, values, inverse_diagonal })
    }

    /// How many unknowns there are.
    #[must_use]
    pub fn size(&self) -> usize {
        self.unknown_of.len()
    }

    /// How many numbers the factor has; a solve multiplies twice with each.
    #[must_use]
    pub fn entries(&self) -> usize {
        self.values.len() + self.size()
    }

    /// Solves A x = b for `N` right-hand sides at once. `x` holds b and then x, `scratch` anything; both have one row per
    /// unknown. Allocates nothing.
    ///
    /// # Panics
    /// When one of the two has another length than [`SparseCholesky::size`].
    pub fn solve<const N: usize>(&self, x: &mut [[f64; N]], scratch: &mut [[f64; N]]) {
        assert_eq!((x.len(), scratch.len()), (self.size(), self.size()), "one row per unknown");
        // Wide registers hold more right-hand sides; neither sums nor products change by it.
        Arch::new().dispatch(|| self.sweep(x, scratch));
    }

    #[inline(always)]
    fn sweep<const N: usize>(&self, x: &mut [[f64; N]], scratch: &mut [[f64; N]]) {
        for (row, &unknown) in self.unknown_of.iter().enumerate() {
            scratch[row] = x[unknown as usize];
        }
        for column in 0..self.size() {
            let inverse = self.inverse_diagonal[column];
            let solved = scratch[column].map(|value| value * inverse);
            scratch[column] = solved;
            let range = self.starts[column]..self.starts[column + 1];
            for (&row, l) in self.rows[range.clone()].iter().zip(&self.values[range]) {
                for (open, solved) in scratch[row as usize].iter_mut().zip(&solved) {
                    *open -= l * solved;
                }
            }
        }
        for column in (0..self.size()).rev() {
            let mut sum = scratch[column];
            let range = self.starts[column]..self.starts[column + 1];
            for (&row, l) in self.rows[range.clone()].iter().zip(&self.values[range]) {
                for (sum, known) in sum.iter_mut().zip(&scratch[row as usize]) {
                    *sum -= l * known;
                }
            }
            let inverse = self.inverse_diagonal[column];
            scratch[column] = sum.map(|sum| sum * inverse);
            x[self.unknown_of[column] as usize] = scratch[column];
        }
    }
}

impl Lower {
    fn new(unknown_of: &[u32], entries: &[(u32, u32, f64)]) -> Lower {
        let size = unknown_of.len();
        let mut row_of = vec![0; size];
        for (row, &unknown) in unknown_of.iter().enumerate() {
            row_of[unknown as usize] = row;
        }
        let mut diagonal = vec![0.0; size];
        let mut left = Vec::with_capacity(entries.len());
        for &(a, b, value) in entries {
            let (a, b) = (row_of[a as usize], row_of[b as usize]);
            if a == b {
                diagonal[a] += value;
            } else {
                left.push((a.max(b), a.min(b), value));
            }
        }
        // Stable, so that equal places are added up in their order.
        left.sort_by_key(|&(row, column, _)| (row, column));
        let (mut starts, mut columns, mut values) = (vec![0; size + 1], Vec::new(), Vec::new());
        let mut last = None;
        for (row, column, value) in left {
            match values.last_mut() {
                Some(sum) if last == Some((row, column)) => *sum += value,
                _ => {
                    columns.push(column as u32);
                    values.push(value);
                    starts[row + 1] += 1;
                }
            }
            last = Some((row, column));
        }
        for row in 0..size {
            starts[row + 1] += starts[row];
        }
        Lower { starts, columns, values, diagonal }
    }

    fn columns(&self, row: usize) -> &[u32] {
        &self.columns[self.starts[row]..self.starts[row + 1]]
    }
}

/// For each column the row of its first entry below the diagonal (Liu 1990); [`NONE`] where there is none.
fn elimination_tree(lower: &Lower) -> Vec<u32> {
    let size = lower.diagonal.len();
    let (mut parent, mut ancestor) = (vec![NONE; size], vec![NONE; size]);
    for row in 0..size {
        for &column in lower.columns(row) {
            let mut at = column as usize;
            while at != row {
                let next = std::mem::replace(&mut ancestor[at], row as u32);
                if next == NONE {
                    parent[at] = row as u32;
                    break;
                }
                at = next as usize;
            }
        }
    }
    parent
}

/// The columns of a row of L left of the diagonal, ascending: what the tree reaches from those of the matrix.
fn row_pattern(lower: &Lower, parent: &[u32], row: usize, marks: &mut [u32], pattern: &mut Vec<u32>) {
    pattern.clear();
    marks[row] = row as u32;
    for &column in lower.columns(row) {
        let mut at = column;
        while marks[at as usize] != row as u32 {
            marks[at as usize] = row as u32;
            pattern.push(at);
            at = parent[at as usize];
        }
    }
    pattern.sort_unstable();
}

/// An order of the unknowns in which what separates two halves comes after both, and so on inside the halves. A level of a search breadth
/// first from the rim separates what lies before it from what lies behind.
fn nested_dissection(size: usize, entries: &[(u32, u32, f64)]) -> Vec<u32> {
    let graph = Graph::new(size, entries);
    let mut level = vec![NONE; size];
    // The piece to which each unknown belongs; a search stays inside.
    let mut piece = vec![0; size];
    let mut pieces = 1;
    let mut order = Vec::with_capacity(size);
    let mut open = vec![((0..size as u32).collect::<Vec<u32>>(), 0)];
    // From the last unknown to the first.
    while let Some((unknowns, divisions)) = open.pop() {
        if unknowns.len() <= LEAF || divisions == DIVISIONS {
            order.extend(unknowns.into_iter().rev());
            continue;
        }
        unknowns.iter().for_each(|&unknown| level[unknown as usize] = NONE);
        let mut reached = Vec::with_capacity(unknowns.len());
        graph.search(unknowns[0], &piece, &mut level, &mut reached);
        if reached.len() < unknowns.len() {
            // Components one by one.
            let mut next = reached.len();
            let mut components = vec![reached];
            for &unknown in &unknowns {
                if next < unknowns.len() && level[unknown as usize] == NONE {
                    let mut component = Vec::new();
                    graph.search(unknown, &piece, &mut level, &mut component);
                    next += component.len();
                    components.push(component);
                }
            }
            for component in components {
                component.iter().for_each(|&unknown| piece[unknown as usize] = pieces);
                pieces += 1;
                open.push((component, divisions + 1));
            }
            continue;
        }
        let rim = reached[reached.len() - 1];
        unknowns.iter().for_each(|&unknown| level[unknown as usize] = NONE);
        reached.clear();
        graph.search(rim, &piece, &mut level, &mut reached);
        let deepest = level[reached[reached.len() - 1] as usize];
        if deepest < 2 {
            order.extend(reached);
            continue;
        }
        let middle = level[reached[reached.len() / 2] as usize].clamp(1, deepest - 1);
        let is_behind = |unknown: u32| level[unknown as usize] > middle;
        let is_between = |unknown: u32| {
            level[unknown as usize] == middle
                && graph.neighbours(unknown).iter().any(|&other| {
                    piece[other as usize] == piece[unknown as usize] && level[other as usize] == middle + 1
                })
        };
        let (between, halves): (Vec<u32>, Vec<u32>) = reached.iter().partition(|&&unknown| is_between(unknown));
        let (behind, before): (Vec<u32>, Vec<u32>) = halves.into_iter().partition(|&unknown| is_behind(unknown));
        for half in [&between, &behind, &before] {
            half.iter().for_each(|&unknown| piece[unknown as usize] = pieces);
            pieces += 1;
        }
        order.extend(between);
        open.extend([(behind, divisions + 1), (before, divisions + 1)]);
    }
    order.reverse();
    order
}

/// Who shares an entry with whom.
struct Graph {
    starts: Vec<usize>,
    neighbours: Vec<u32>,
}

impl Graph {
    fn new(size: usize, entries: &[(u32, u32, f64)]) -> Graph {
        let both = entries.iter().filter(|(a, b, _)| a != b).flat_map(|&(a, b, _)| [(a, b), (b, a)]);
        let mut pairs: Vec<(u32, u32)> = both.collect();
        pairs.sort_unstable();
        pairs.dedup();
        let mut starts = vec![0; size + 1];
        pairs.iter().for_each(|&(a, _)| starts[a as usize + 1] += 1);
        for unknown in 0..size {
            starts[unknown + 1] += starts[unknown];
        }
        Graph { starts, neighbours: pairs.into_iter().map(|(_, b)| b).collect() }
    }

    fn neighbours(&self, unknown: u32) -> &[u32] {
        &self.neighbours[self.starts[unknown as usize]..self.starts[unknown as usize + 1]]
    }

    /// Appends everything in its piece that `root` reaches, nearest first, and marks each with its distance.
    fn search(&self, root: u32, piece: &[u32], level: &mut [u32], reached: &mut Vec<u32>) {
        let mut at = reached.len();
        level[root as usize] = 0;
        reached.push(root);
        while let Some(&unknown) = reached.get(at) {
            at += 1;
            for &other in self.neighbours(unknown) {
                if level[other as usize] == NONE && piece[other as usize] == piece[unknown as usize] {
                    level[other as usize] = level[unknown as usize] + 1;
                    reached.push(other);
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::envelope_cholesky::EnvelopeCholesky;
    use proptest::prelude::*;

    /// The Laplacian of a grid plus the identity, its vertices numbered at random.
    fn grid(side: u32) -> Vec<(u32, u32, f64)> {
        let v = |x: u32, y: u32| (y * side + x) * 347 % (side * side);
        let mut entries = Vec::new();
        for (x, y) in (0..side).flat_map(|y| (0..side).map(move |x| (x, y))) {
            entries.push((v(x, y), v(x, y), 5.0));
            entries.extend((x + 1 < side).then(|| (v(x, y), v(x + 1, y), -1.0)));
            entries.extend((y + 1 < side).then(|| (v(x, y), v(x, y + 1), -1.0)));
        }
        entries
    }

    proptest! {
        /// Sums of squares along random edges plus a random diagonal, pieces not joined included.
        #[test]
        fn the_solution_is_that_of_the_envelope(
            edges in prop::collection::vec((0u32..200, 0u32..200, 0.01f64..10.0), 0..500),
            diagonal in prop::collection::vec(0.01f64..2.0, 200),
            wanted in prop::collection::vec(prop::array::uniform3(-5.0f64..5.0), 200),
        ) {
            let mut entries: Vec<_> = diagonal.iter().zip(0..).map(|(&d, v)| (v, v, d)).collect();
            for (a, b, weight) in edges.into_iter().filter(|(a, b, _)| a != b) {
                entries.extend([(a, a, weight), (b, b, weight), (a, b, -weight)]);
            }
            let mut scratch = vec![[f64::NAN; 3]; 200];
            let (mut x, mut expected) = (wanted.clone(), wanted);
            SparseCholesky::new(200, &entries).unwrap().solve(&mut x, &mut scratch);
            EnvelopeCholesky::new(200, &entries).unwrap().solve(&mut expected, &mut scratch);
            for (x, expected) in x.iter().flatten().zip(expected.iter().flatten()) {
                prop_assert!((x - expected).abs() < 1e-8 * (1.0 + expected.abs()), "{x} is not {expected}");
            }
        }
    }

    #[test]
    fn a_square_grid_has_a_far_smaller_factor_than_the_envelope() {
        let (side, entries) = (100, grid(100));
        let sparse = SparseCholesky::new((side * side) as usize, &entries).unwrap();
        let envelope = EnvelopeCholesky::new((side * side) as usize, &entries).unwrap();
        assert!(2 * sparse.entries() < envelope.entries(), "{} {}", sparse.entries(), envelope.entries());
    }

    #[test]
    fn every_unknown_stands_once() {
        for entries in [grid(20), Vec::new(), (1..400).map(|v| (0, v, -1.0)).collect()] {
            let mut order = nested_dissection(400, &entries);
            order.sort_unstable();
            assert!(order.iter().copied().eq(0..400));
        }
    }

    #[test]
    fn what_is_not_positive_definite_is_named() {
        for last in [0.0, 1.0, -1.0, f64::NAN, f64::INFINITY] {
            let entries = [(0, 0, 1.0), (0, 1, 1.0), (1, 1, last)];
            let error = SparseCholesky::new(2, &entries).unwrap_err();
            assert!(matches!(error, FactorError::NotPositiveDefinite { .. }), "{last}");
        }
    }

    #[test]
    fn no_unknowns_are_no_trouble() {
        SparseCholesky::new(0, &[]).unwrap().solve::<1>(&mut [], &mut []);
    }
}
