//! Diffusion over a mesh: neighbours of vertices, and one linear system that carries values from where they are known
//! to where they are not. Knows nothing of garments.

use crate::stages::StageError;
use glam::Vec3;

/// Which vertices are joined by an edge of a triangle, or lie at the very same place (so that an unwelded seam does not
/// part the cloth). Compressed rows, each ascending.
#[derive(Clone, Debug)]
pub struct Neighbours {
    starts: Vec<usize>,
    joined: Vec<u32>,
}

impl Neighbours {
    /// From a mesh whose triangles index its positions.
    #[must_use]
    pub fn new(positions_m: &[Vec3], triangles: &[[u32; 3]]) -> Neighbours {
        let edges = triangles.iter().flat_map(|&[a, b, c]| [(a, b), (b, c), (c, a)]);
        let mut pairs: Vec<(u32, u32)> = edges.chain(coincident(positions_m)).filter(|(a, b)| a != b).collect();
        pairs.extend_from_within(..);
        let half = pairs.len() / 2;
        for pair in &mut pairs[half..] {
            *pair = (pair.1, pair.0);
        }
        pairs.sort_unstable();
        pairs.dedup();
        let starts = (0..=positions_m.len()).map(|v| pairs.partition_point(|&(a, _)| (a as usize) < v)).collect();
        Neighbours { starts, joined: pairs.into_iter().map(|(_, b)| b).collect() }
    }

    /// How many vertices.
    #[must_use]
    pub fn vertex_count(&self) -> usize {
        self.starts.len() - 1
    }

    /// The vertices joined to one, ascending.
    #[must_use]
    pub fn of(&self, vertex: usize) -> &[u32] {
        &self.joined[self.starts[vertex]..self.starts[vertex + 1]]
    }

    /// Mean length of the edges, metres; 0 when there is none.
    #[must_use]
    pub fn mean_edge_m(&self, positions_m: &[Vec3]) -> f64 {
        let lengths = (0..self.vertex_count())
            .flat_map(|v| self.of(v).iter().map(move |&n| f64::from(positions_m[v].distance(positions_m[n as usize]))));
        lengths.sum::<f64>() / self.joined.len().max(1) as f64
    }

    /// One round of smoothing: every value moves half way to the mean of its neighbours.
    #[must_use]
    pub fn smoothed(&self, values: &[f64]) -> Vec<f64> {
        (0..self.vertex_count())
            .map(|v| match self.of(v) {
                [] => values[v],
                near => {
                    0.5 * values[v] + 0.5 * near.iter().map(|&n| values[n as usize]).sum::<f64>() / near.len() as f64
                }
            })
            .collect()
    }
}

/// Chains of vertices at exactly the same position.
fn coincident(positions_m: &[Vec3]) -> Vec<(u32, u32)> {
    // Adding 0 turns -0 into 0, so that equal places have equal bits.
    let place = |&v: &u32| (positions_m[v as usize] + Vec3::ZERO).to_array().map(f32::to_bits);
    let mut order: Vec<u32> = (0..positions_m.len() as u32).collect();
    order.sort_by_key(|v| (place(v), *v));
    order.windows(2).filter(|pair| place(&pair[0]) == place(&pair[1])).map(|pair| (pair[0], pair[1])).collect()
}

/// Spreads values over the mesh: minimises `sum_edges (x_a - x_b)^2 + sum_v anchor_v (x_v - value_v)^2`.
///
/// An anchor of infinity holds its vertex, 0 leaves it to its neighbours, between the two it pulls; a vertex that
/// reaches no anchor keeps a mean of its piece's values. The graph Laplacian (unit weights, not cotangents) keeps the
/// result between the smallest and the largest value, so that weights and masks stay weights and masks.
///
/// # Errors
/// When the solver does not converge, which for finite values it does.
pub fn diffuse(neighbours: &Neighbours, anchors: &[f64], values: &[f64]) -> Result<Vec<f64>, StageError> {
    let held: Vec<bool> = anchors.iter().map(|anchor| anchor.is_infinite()).collect();
    let free_degree = |v: usize| neighbours.of(v).len() as f64 + anchors[v];
    let diagonal: Vec<f64> =
        (0..values.len()).map(|v| if held[v] || free_degree(v) == 0.0 { 1.0 } else { free_degree(v) }).collect();
    let product = |x: &[f64], out: &mut [f64]| {
        for (v, out) in out.iter_mut().enumerate() {
            *out = if held[v] {
                x[v]
            } else {
                let near = neighbours.of(v).iter().filter(|&&n| !held[n as usize]);
                free_degree(v) * x[v] - near.map(|&n| x[n as usize]).sum::<f64>()
            };
        }
    };
    let wanted: Vec<f64> = (0..values.len())
        .map(|v| {
            if held[v] {
                return values[v];
            }
            let near = neighbours.of(v).iter().filter(|&&n| held[n as usize]);
            anchors[v] * values[v] + near.map(|&n| values[n as usize]).sum::<f64>()
        })
        .collect();
    conjugate_gradient(product, &diagonal, &wanted, values)
}

/// Relative residual at which the solution counts as found.
const TOLERANCE: f64 = 1e-10;

/// Solves `A x = wanted` for a symmetric positive (semi)definite `A`, given as a product, from `start`, preconditioned
/// by the diagonal.
///
/// An own solver in plain f64: a pack must be the same bytes on any x86-64 machine, and the sparse libraries choose
/// their kernels by the processor they find at run time. Sums run in vertex order on one thread.
fn conjugate_gradient(
    product: impl Fn(&[f64], &mut [f64]),
    diagonal: &[f64],
    wanted: &[f64],
    start: &[f64],
) -> Result<Vec<f64>, StageError> {
    let mut x = start.to_vec();
    let mut along = vec![0.0; x.len()];
    product(&x, &mut along);
    let mut residual: Vec<f64> = wanted.iter().zip(&along).map(|(b, a)| b - a).collect();
    let small = TOLERANCE * dot(wanted, wanted).max(dot(&residual, &residual)).sqrt();
    let mut direction: Vec<f64> = residual.iter().zip(diagonal).map(|(r, d)| r / d).collect();
    let mut energy = dot(&residual, &direction);
    for _ in 0..10 * x.len() + 100 {
        if dot(&residual, &residual).sqrt() <= small {
            return Ok(x);
        }
        product(&direction, &mut along);
        let step = energy / dot(&direction, &along);
        if !step.is_finite() {
            break;
        }
        for i in 0..x.len() {
            x[i] += step * direction[i];
            residual[i] -= step * along[i];
        }
        let preconditioned: Vec<f64> = residual.iter().zip(diagonal).map(|(r, d)| r / d).collect();
        let energy_before = std::mem::replace(&mut energy, dot(&residual, &preconditioned));
        let keep = energy / energy_before;
        for (direction, z) in direction.iter_mut().zip(preconditioned) {
            *direction = z + keep * *direction;
        }
    }
    Err(StageError::new("laplacian", "the diffusion over the mesh does not converge: are there NaN positions?"))
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// A flat grid of `n` by `n` vertices.
    fn grid(n: usize) -> Neighbours {
        let at = |x: usize, y: usize| (y * n + x) as u32;
        let cells = (0..n - 1).flat_map(|y| (0..n - 1).map(move |x| (x, y)));
        let triangles: Vec<[u32; 3]> = cells
            .flat_map(|(x, y)| [[at(x, y), at(x + 1, y), at(x, y + 1)], [at(x + 1, y), at(x + 1, y + 1), at(x, y + 1)]])
            .collect();
        let positions: Vec<Vec3> = (0..n * n).map(|v| Vec3::new((v % n) as f32, (v / n) as f32, 0.0)).collect();
        Neighbours::new(&positions, &triangles)
    }

    /// The same minimum by Gaussian elimination on the full matrix, held vertices as rows of the identity.
    fn dense(neighbours: &Neighbours, anchors: &[f64], values: &[f64]) -> Vec<f64> {
        let n = values.len();
        let mut rows: Vec<Vec<f64>> = (0..n)
            .map(|v| {
                let mut row = vec![0.0; n + 1];
                if anchors[v].is_infinite() {
                    row[v] = 1.0;
                    row[n] = values[v];
                } else {
                    row[v] = neighbours.of(v).len() as f64 + anchors[v];
                    neighbours.of(v).iter().for_each(|&b| row[b as usize] = -1.0);
                    row[n] = anchors[v] * values[v];
                }
                row
            })
            .collect();
        for pivot in 0..n {
            let best = (pivot..n).max_by(|&a, &b| rows[a][pivot].abs().total_cmp(&rows[b][pivot].abs())).unwrap();
            rows.swap(pivot, best);
            let pivot_row = rows[pivot].clone();
            for (i, row) in rows.iter_mut().enumerate() {
                let factor = row[pivot] / pivot_row[pivot];
                if i != pivot && factor != 0.0 {
                    row.iter_mut().zip(&pivot_row).for_each(|(a, b)| *a -= factor * b);
                }
            }
        }
        (0..n).map(|v| rows[v][n] / rows[v][v]).collect()
    }

    proptest! {
        #[test]
        fn diffusion_agrees_with_elimination_and_stays_between_the_values(
            values in prop::collection::vec(0.0f64..1.0, 36),
            kinds in prop::collection::vec(0u8..4, 36),
        ) {
            let neighbours = grid(6);
            let anchor = |kind: &u8| [0.0, 0.0, 0.3, f64::INFINITY][*kind as usize];
            let mut anchors: Vec<f64> = kinds.iter().map(anchor).collect();
            anchors[7] = 1.0;
            let found = diffuse(&neighbours, &anchors, &values).unwrap();
            for (v, (a, b)) in found.iter().zip(dense(&neighbours, &anchors, &values)).enumerate() {
                prop_assert!((a - b).abs() < 1e-7, "vertex {v}: {a} but {b}");
                prop_assert!((-1e-9..=1.0 + 1e-9).contains(a));
            }
        }
    }

    #[test]
    fn a_piece_without_anchor_takes_the_mean_of_its_values() {
        let triangles = [[0, 1, 2], [3, 4, 5]];
        let positions: Vec<Vec3> = (0..6).map(|v| Vec3::new(v as f32, (v * v) as f32, 0.0)).collect();
        let neighbours = Neighbours::new(&positions, &triangles);
        let anchors = [f64::INFINITY, 0.0, 0.0, 0.0, 0.0, 0.0];
        let found = diffuse(&neighbours, &anchors, &[2.0, 0.0, 0.0, 1.0, 4.0, 7.0]).unwrap();
        for (found, wanted) in found.iter().zip([2.0, 2.0, 2.0, 4.0, 4.0, 4.0]) {
            assert!((found - wanted).abs() < 1e-6, "{found} is not {wanted}");
        }
    }

    #[test]
    fn an_unwelded_seam_joins_its_two_sides() {
        let place = [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [1.0, 0.0], [-0.0, 1.0], [1.0, 1.0]];
        let positions: Vec<Vec3> = place.iter().map(|&[x, y]| Vec3::new(x, y, 0.0)).collect();
        let neighbours = Neighbours::new(&positions, &[[0, 1, 2], [3, 5, 4]]);
        assert_eq!(neighbours.of(1), [0, 2, 3]);
        assert_eq!(neighbours.of(4), [2, 3, 5]);
        assert_eq!(neighbours.smoothed(&[0.0, 1.0, 1.0, 1.0, 1.0, 4.0])[0], 0.5);
    }
}
