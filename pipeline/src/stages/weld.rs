//! Displacement fields that let every part take its size by itself: one per part and size over the whole mesh, so that any weights leave no
//! gap and no step, and equal weights give the size (P1, "displacement of the parts", here by construction). Knows nothing of fitting.
//!
//! A part's field has, in the least-squares sense, the gradient of the size's displacement times the part's *share*, which is 1 on the part,
//! 0 elsewhere, and falls off smoothly across its seams: a Poisson problem on the base. Shares sum to 1, so the fields of all parts sum
//! to the displacement itself. A sleeve that grows thus pushes nothing and tears nothing: it keeps its own shape and travels with the
//! shoulder to which it is sewn.

use crate::ir::{SizeShape, Surface};
use crate::stages::StageError;
use glam::DVec3;
use kitsuke::envelope_cholesky::EnvelopeCholesky;
use rayon::prelude::*;

/// How the shares of the parts meet.
#[derive(Clone, Copy, Debug)]
pub struct Settings {
    /// How far shares reach across seams, in mean edge lengths.
    pub ramp_edges: f64,
}

impl Default for Settings {
    fn default() -> Settings {
        Settings { ramp_edges: 1.5 }
    }
}

/// A sine of a corner below which its triangle has no usable cotangents, and joins nothing.
const LEAST_SINE: f64 = 1e-9;

/// The fields: per part of the base, per size, one vector per vertex, metres. Over all parts of a size they sum to its displacement.
///
/// Gradients leave a field's place open. It is settled where the kimono rests: there, weighted by `rests` (per vertex), the mean of a
/// field is the mean of the size's displacement times the part's share.
///
/// # Errors
/// When the base's equations cannot be solved.
pub fn weld(
    base: &Surface,
    sizes: &[SizeShape],
    rests: &[f64],
    settings: &Settings,
) -> Result<Vec<[f32; 3]>, StageError> {
    let stiffness = Stiffness::new(base);
    let shares = shares(base, &stiffness, settings.ramp_edges)?;
    let factor = stiffness.factor(0.0)?;
    let anchors = anchors(&stiffness, rests);
    let displacements: Vec<Vec<DVec3>> = sizes
        .iter()
        .map(|size| size.positions_m.iter().zip(&base.positions_m).map(|(s, b)| s.as_dvec3() - b.as_dvec3()).collect())
        .collect();
    let fields: Vec<Vec<[f32; 3]>> = (0..shares.len() * sizes.len())
        .into_par_iter()
        .map(|at| {
            let (share, displacement) = (&shares[at / sizes.len()], &displacements[at % sizes.len()]);
            let field = field(&stiffness, &factor, &anchors, share, displacement);
            field.into_iter().map(|moved_m| moved_m.as_vec3().to_array()).collect()
        })
        .collect();
    Ok(fields.concat())
}

/// One part's field of one size, metres.
fn field(
    stiffness: &Stiffness,
    factor: &EnvelopeCholesky,
    anchors: &[Vec<(u32, f64)>],
    share: &[f64],
    displacement: &[DVec3],
) -> Vec<DVec3> {
    let mut wanted = vec![[0.0; 3]; displacement.len()];
    for (corners, halves) in &stiffness.triangles {
        let [a, b, c] = corners.map(|v| v as usize);
        let mean_share = (share[a] + share[b] + share[c]) / 3.0;
        for (from, to, weight) in [(b, c, halves[0]), (c, a, halves[1]), (a, b, halves[2])] {
            let pull = (weight * mean_share * (displacement[from] - displacement[to])).to_array();
            for i in 0..3 {
                wanted[from][i] += pull[i];
                wanted[to][i] -= pull[i];
            }
        }
    }
    let mut scratch = vec![[0.0; 3]; wanted.len()];
    factor.solve(&mut wanted, &mut scratch);
    let mut field: Vec<DVec3> = wanted.into_iter().map(DVec3::from_array).collect();
    for (piece, anchor) in stiffness.pieces.iter().zip(anchors) {
        let is = anchor.iter().map(|&(v, mass)| mass * field[v as usize]).sum::<DVec3>();
        let shall = anchor.iter().map(|&(v, mass)| mass * share[v as usize] * displacement[v as usize]).sum::<DVec3>();
        piece.iter().for_each(|&v| field[v as usize] += shall - is);
    }
    field
}

/// Per piece of connected cloth the vertices that settle its place, with masses that sum to 1: where it rests, or all of it.
fn anchors(stiffness: &Stiffness, rests: &[f64]) -> Vec<Vec<(u32, f64)>> {
    let normalised = |masses: Vec<(u32, f64)>| {
        let sum: f64 = masses.iter().map(|(_, mass)| mass).sum();
        masses.into_iter().map(|(v, mass)| (v, mass / sum)).collect()
    };
    let anchor = |piece: &Vec<u32>| {
        let resting: Vec<(u32, f64)> = piece
            .iter()
            .map(|&v| (v, rests[v as usize] * stiffness.areas[v as usize]))
            .filter(|(_, m)| *m > 0.0)
            .collect();
        normalised(if resting.is_empty() { piece.iter().map(|&v| (v, 1.0)).collect() } else { resting })
    };
    stiffness.pieces.iter().map(anchor).collect()
}

/// Per part its share of every vertex: its own cloth, diffused over the mesh. Shares are at least 0 and sum to 1.
fn shares(base: &Surface, stiffness: &Stiffness, ramp_edges: f64) -> Result<Vec<Vec<f64>>, StageError> {
    let neighbours = crate::stages::laplacian::Neighbours::new(&base.positions_m, &base.triangles);
    let reach_m = ramp_edges * neighbours.mean_edge_m(&base.positions_m);
    let factor = stiffness.factor(1.0 / (reach_m * reach_m).max(f64::MIN_POSITIVE))?;
    let mut triangles = base.triangles.iter();
    let mut shares: Vec<Vec<f64>> = Vec::new();
    let mut scratch = vec![[0.0]; base.positions_m.len()];
    for part in &base.parts {
        let mut share = vec![[0.0]; base.positions_m.len()];
        for corners in triangles.by_ref().take(part.triangle_count as usize) {
            let third = area(base, corners) / 3.0 / (reach_m * reach_m);
            corners.iter().for_each(|&v| share[v as usize][0] += third);
        }
        factor.solve(&mut share, &mut scratch);
        // Cotangents of wide corners are negative and may undershoot a little.
        shares.push(share.into_iter().map(|[share]| share.max(0.0)).collect());
    }
    for v in 0..base.positions_m.len() {
        let sum: f64 = shares.iter().map(|share| share[v]).sum();
        if sum > 0.0 {
            shares.iter_mut().for_each(|share| share[v] /= sum);
        } else {
            shares[0][v] = 1.0;
        }
    }
    Ok(shares)
}

fn area(base: &Surface, corners: &[u32; 3]) -> f64 {
    let [a, b, c] = corners.map(|v| base.positions_m[v as usize].as_dvec3());
    0.5 * (b - a).cross(c - a).length()
}

/// The base's cotangent Laplacian, triangle by triangle.
struct Stiffness {
    /// Corners of each usable triangle, and half the cotangent at each corner.
    triangles: Vec<([u32; 3], [f64; 3])>,
    /// A third of the area of the triangles around each vertex, square metres.
    areas: Vec<f64>,
    /// Connected vertices.
    pieces: Vec<Vec<u32>>,
}

impl Stiffness {
    fn new(base: &Surface) -> Stiffness {
        let mut areas = vec![0.0; base.positions_m.len()];
        let mut triangles = Vec::with_capacity(base.triangles.len());
        for corners in &base.triangles {
            corners.iter().for_each(|&v| areas[v as usize] += area(base, corners) / 3.0);
            let places = corners.map(|v| base.positions_m[v as usize].as_dvec3());
            let half_cotangent = |corner: usize| {
                let (a, b) = (places[(corner + 1) % 3] - places[corner], places[(corner + 2) % 3] - places[corner]);
                let twice_area = a.cross(b).length();
                (twice_area > LEAST_SINE * a.length() * b.length()).then(|| 0.5 * a.dot(b) / twice_area)
            };
            if let (Some(a), Some(b), Some(c)) = (half_cotangent(0), half_cotangent(1), half_cotangent(2)) {
                triangles.push((*corners, [a, b, c]));
            }
        }
        let pieces = pieces(base.positions_m.len(), triangles.iter().map(|(corners, _)| *corners));
        Stiffness { triangles, areas, pieces }
    }

    /// The factor of the Laplacian plus `screening` (per square metre) times the areas. Without screening the first vertex of every piece
    /// is held at 0.
    fn factor(&self, screening: f64) -> Result<EnvelopeCholesky, StageError> {
        let mut entries = Vec::with_capacity(9 * self.triangles.len());
        for &([a, b, c], halves) in &self.triangles {
            for (from, to, weight) in [(b, c, halves[0]), (c, a, halves[1]), (a, b, halves[2])] {
                entries.extend([(from, from, weight), (to, to, weight), (from, to, -weight)]);
            }
        }
        if screening > 0.0 {
            entries.extend(self.areas.iter().zip(0..).map(|(area, v)| (v, v, screening * area)));
        }
        entries
            .extend(self.pieces.iter().filter(|piece| screening == 0.0 || piece.len() == 1).map(|p| (p[0], p[0], 1.0)));
        EnvelopeCholesky::new(self.areas.len(), &entries).map_err(|error| StageError::new("weld", error.to_string()))
    }
}

/// Sets of vertices that triangles connect, each ascending, by their first vertex.
fn pieces(vertex_count: usize, triangles: impl Iterator<Item = [u32; 3]>) -> Vec<Vec<u32>> {
    let mut root: Vec<u32> = (0..vertex_count as u32).collect();
    fn find(root: &mut [u32], mut v: u32) -> u32 {
        while root[v as usize] != v {
            root[v as usize] = root[root[v as usize] as usize];
            v = root[v as usize];
        }
        v
    }
    for [a, b, c] in triangles {
        for (a, b) in [(a, b), (b, c)] {
            let (a, b) = (find(&mut root, a), find(&mut root, b));
            root[a.max(b) as usize] = a.min(b);
        }
    }
    let mut pieces: Vec<Vec<u32>> = vec![Vec::new(); vertex_count];
    for v in 0..vertex_count as u32 {
        pieces[find(&mut root, v) as usize].push(v);
    }
    pieces.retain(|piece| !piece.is_empty());
    pieces
}
