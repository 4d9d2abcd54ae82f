//! The dimensions as functions of the unknowns: sums of edge lengths, and how they change (P1, step 2). Only the vertices of the paths are
//! kept, as edges, contiguous.

use super::dense::dot;
use pulp::{Arch, Simd, WithSimd};

/// Paths over a mesh that is a base plus fields times unknowns.
#[derive(Clone, Debug)]
pub(crate) struct Paths {
    unknowns: usize,
    /// Where each path's edges begin; one more than there are paths.
    starts: Vec<usize>,
    /// Added to each path's length, metres.
    offsets_m: Vec<f64>,
    /// x, y, z of each edge of the base, metres.
    base_m: Vec<f64>,
    /// How each coordinate of each edge changes with each unknown.
    changes: Vec<f64>,
}

impl Paths {
    pub(crate) fn new(unknowns: usize) -> Paths {
        Paths { unknowns, starts: vec![0], offsets_m: Vec::new(), base_m: Vec::new(), changes: Vec::new() }
    }

    /// Adds an edge to the path that is being made: its coordinates, and for each of them a row of changes.
    pub(crate) fn push_edge(&mut self, base_m: [f64; 3], changes: &[f64]) {
        assert_eq!(changes.len(), 3 * self.unknowns, "a change for each coordinate and unknown");
        self.base_m.extend(base_m);
        self.changes.extend_from_slice(changes);
    }

    /// Ends the path that is being made.
    pub(crate) fn end_path(&mut self, offset_m: f64) {
        self.starts.push(self.base_m.len() / 3);
        self.offsets_m.push(offset_m);
    }

    pub(crate) fn count(&self) -> usize {
        self.offsets_m.len()
    }

    pub(crate) fn unknowns(&self) -> usize {
        self.unknowns
    }

    /// The same paths over other unknowns: each row of changes is replaced in place.
    pub(crate) fn transform(&mut self, mut row: impl FnMut(&mut [f64])) {
        self.changes.chunks_exact_mut(self.unknowns).for_each(&mut row);
    }

    /// Writes the edges at these unknowns, metres; what [`Paths::lengths`] starts from.
    pub(crate) fn edges(&self, unknowns: &[f64], edges_m: &mut Vec<f64>) {
        edges_m.clear();
        let rows = self.changes.chunks_exact(self.unknowns);
        edges_m.extend(self.base_m.iter().zip(rows).map(|(base_m, row)| base_m + dot(row, unknowns)));
    }

    /// Writes each path's length, metres, and how it changes with each unknown, a row per path, where the edges are `origin_m` when all
    /// unknowns are 0. Compiled for several sets of vector instructions, all of which give the same bits.
    pub(crate) fn lengths(&self, origin_m: &[f64], unknowns: &[f64], lengths_m: &mut [f64], jacobian: &mut [f64]) {
        Arch::new().dispatch(Lengths { paths: self, origin_m, unknowns, lengths_m, jacobian });
    }

    /// One path's length, metres, from the base; its gradient is written.
    pub(crate) fn length(&self, path: usize, unknowns: &[f64], gradient: &mut [f64]) -> f64 {
        gradient.fill(0.0);
        let edges = self.starts[path]..self.starts[path + 1];
        let lengths = edges.map(|edge| self.edge(edge, &self.base_m[3 * edge..][..3], unknowns, gradient));
        lengths.sum::<f64>() + self.offsets_m[path]
    }

    /// Adds an edge's gradient and returns its length.
    #[inline(always)]
    fn edge(&self, edge: usize, origin_m: &[f64], unknowns: &[f64], gradient: &mut [f64]) -> f64 {
        let rows = &self.changes[3 * edge * self.unknowns..][..3 * self.unknowns];
        let (x, rest) = rows.split_at(self.unknowns);
        let (y, z) = rest.split_at(self.unknowns);
        let [dx, dy, dz] =
            [origin_m[0] + dot(x, unknowns), origin_m[1] + dot(y, unknowns), origin_m[2] + dot(z, unknowns)];
        let length_m = (dx * dx + dy * dy + dz * dz).sqrt();
        if length_m > 0.0 {
            let [along_x, along_y, along_z] = [dx, dy, dz].map(|value_m| value_m / length_m);
            for (((slope, x), y), z) in gradient.iter_mut().zip(x).zip(y).zip(z) {
                *slope += (along_x * x + along_y * y) + along_z * z;
            }
        }
        length_m
    }
}

struct Lengths<'a> {
    paths: &'a Paths,
    origin_m: &'a [f64],
    unknowns: &'a [f64],
    lengths_m: &'a mut [f64],
    jacobian: &'a mut [f64],
}

impl WithSimd for Lengths<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        let Lengths { paths, origin_m, unknowns, lengths_m, jacobian } = self;
        for (path, gradient) in jacobian.chunks_exact_mut(paths.unknowns).enumerate() {
            gradient.fill(0.0);
            lengths_m[path] = paths.offsets_m[path];
            for edge in paths.starts[path]..paths.starts[path + 1] {
                lengths_m[path] += paths.edge(edge, &origin_m[3 * edge..][..3], unknowns, gradient);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn gradients_are_those_of_the_lengths(
            changes in prop::collection::vec(-0.1..0.1f64, 4 * 9),
            unknowns in prop::collection::vec(-1.0..1.0f64, 3),
        ) {
            let mut paths = Paths::new(3);
            for edge in changes.chunks_exact(9) {
                paths.push_edge([1.0, 0.2, -0.3], edge);
            }
            paths.end_path(0.5);
            let (mut gradient, mut unused) = ([0.0; 3], [0.0; 3]);
            let length_m = paths.length(0, &unknowns, &mut gradient);
            for (unknown, slope) in gradient.iter().enumerate() {
                let mut moved = unknowns.clone();
                moved[unknown] += 1e-6;
                let change = (paths.length(0, &moved, &mut unused) - length_m) / 1e-6;
                prop_assert!((change - slope).abs() < 1e-5, "{change} {slope}");
            }
        }
    }
}
