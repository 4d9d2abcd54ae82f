//! Texture coordinates for a fitted shape, so that a pattern keeps its size and aspect (P1, step 4). Knows shapes and flat pieces;
//! knows neither bodies nor tailoring.
//!
//! The wearer's flat pieces are the blend of the sizes' own ones. What is left, because a blend of shapes is not a drape of the blended
//! pieces, is taken up by moving the texture under the shape: with p the new coordinates, p⁰ the blended ones, x the triangles of the
//! fitted shape laid flat, plane vectors as complex numbers, and c = ⟨x, e⟩ over the edges e of a triangle,
//!
//! - E_s = min over rotations R of |e − R x|²: the distances on the shape;
//! - E_r = 2 |c| (1 − cos θ): each triangle's turn θ against p⁰;
//! - E_m = |e − e⁰|²: each vertex's movement against its neighbours'.
//!
//! In the paper ⟨x, e⟩ is Σ w x̄ e. A plane map is a turned scaling plus a mirrored one, the first changes a motif's size, the second draws it
//! out, and there both count the same. No flat piece lies on a bust without strain, but like cloth, which shears more easily than it
//! stretches, it can keep sizes: κ times the doubled signed area is added to Σ w |e|², so that sizes count (1 + κ) and shapes (1 − κ).
//!
//! The paper moves the edges of the tailoring dimensions by the change of their length and then goes from vertex to vertex. Here all
//! edges are dimension edges and all vertices move at once: rotations given the coordinates, then coordinates given the rotations,
//! neither of which can raise the energy (Liu et al. 2008, "A local/global approach to mesh parameterization"). For the second, a step is
//! taken with the matrix of Σ w |e|², which does not depend on the wearer and is at most 1 + κ times too soft. Islands do not see each
//! other, so that nothing is smoothed over a seam or a fold.

use crate::arrays::Mesh;
use crate::envelope_cholesky::{EnvelopeCholesky, FactorError};
use crate::fit::FitData;
use glam::{DVec2, Vec2, Vec3};

/// How much each energy counts.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Energies {
    /// Distances, E_s. Not below `turn`.
    pub distance: f64,
    /// Rotation, E_r.
    pub turn: f64,
    /// Movement, E_m.
    pub movement: f64,
    /// From 0, where a motif's size and its shape count the same, to below 1, where only its size counts: an error of size counts
    /// (1 + size) / (1 - size) times as much as one of shape.
    pub size: f64,
}

impl Energies {
    /// Those of the paper.
    pub const PAPER: Energies = Energies { distance: 2.8, turn: 1.0, movement: 0.5, size: 0.0 };
}

impl Default for Energies {
    /// Hardly any turn and movement. The paper knows one flat piece for all wearers; the blended ones are nearer, and where the blended
    /// shape is not, in the tucks under the obi, they hold the texture in a shape that the cloth does not have.
    fn default() -> Energies {
        Energies { distance: 2.8, turn: 0.02, movement: 0.002, size: 0.65 }
    }
}

/// Rounds of rotations and coordinates; five leave motifs a quarter more wrong, twice as many change little.
const ROUNDS: usize = 9;
/// How far a round's step goes, in steps of a matrix that is stiff enough. Below 2, from where on a step may raise the energy.
const STRIDE: f64 = 1.8;
/// Bounds of an edge's weight. Positive, so that the system is definite on any mesh.
const EDGE_WEIGHT: (f64, f64) = (0.02, 50.0);
/// Where the base itself cannot be laid flat without so much strain, edges count twice; at most [`STIFFEST`] times.
const STIFF_AT: f64 = 0.1;
const STIFFEST: f64 = 100.0;
/// Pull of every vertex to p⁰, relative to an edge of weight 1. It settles where an island lies and nothing else.
const PULL: f64 = 1e-7;

/// Corrects texture coordinates of one garment, for any wearer.
#[derive(Clone, Debug)]
pub struct Texturer {
    energies: Energies,
    triangles: Vec<Triangle>,
    /// The unique vertex that each vertex copies; itself where it is one.
    unique_of: Vec<u32>,
    /// The part whose size chooses a vertex's flat piece.
    part_of: Vec<u32>,
    /// Flat pieces of the base, then of the sizes, over all vertices.
    flat: Vec<Vec<Vec2>>,
    /// Of the matrix of Σ w |e|², plus [`PULL`].
    factor: EnvelopeCholesky,
}

#[derive(Clone, Copy, Debug)]
struct Triangle {
    vertices: [u32; 3],
    /// w of the edges from each corner to the next.
    weights: [f64; 3],
    /// κ times the stiffness, the weight of the doubled signed area. Below 0 where the texture shows mirrored.
    area: f64,
    /// Texture units per metre. Below 0 where the texture shows mirrored.
    uv_per_m: f64,
}

/// What one thread needs to correct textures.
#[derive(Clone, Debug)]
pub struct TextureScratch {
    flat: Vec<DVec2>,
    laid: Vec<Laid>,
    /// What does not change from round to round of the right-hand side.
    fixed: Vec<[f64; 2]>,
    uv: Vec<[f64; 2]>,
    rows: Vec<[f64; 2]>,
    solver: Vec<[f64; 2]>,
}

/// A triangle of the shape, laid flat.
#[derive(Clone, Copy, Debug, Default)]
struct Laid {
    /// Edges from each corner to the next, texture units.
    edges: [DVec2; 3],
    /// The rotation that lays them on the blended flat pieces, as a unit complex number.
    as_blended: DVec2,
}

/// Why a garment's texture cannot be corrected.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum TextureError {
    /// There are no texture coordinates.
    #[error("the garment has no texture coordinates")]
    NoTexture,
    /// The mesh is no surface of cloth.
    #[error("the texture's islands cannot be solved for: {0}")]
    Factor(#[from] FactorError),
}

impl Texturer {
    /// Prepares a garment with the default energies.
    ///
    /// # Errors
    /// When it has no texture coordinates, or its triangles are so entangled that they cannot be solved for.
    ///
    /// # Panics
    /// When the mesh did not pass [`Garment::new`](crate::Garment::new) or the sizes [`FitData::check`].
    pub fn new(mesh: &Mesh, fit: &FitData) -> Result<Texturer, TextureError> {
        Texturer::with_energies(mesh, fit, Energies::default())
    }

    /// The same with other energies.
    ///
    /// # Errors
    /// As [`Texturer::new`].
    ///
    /// # Panics
    /// As [`Texturer::new`], and when an energy is below 0, `distance` is 0 or below `turn`, or `size` is not below 1.
    pub fn with_energies(mesh: &Mesh, fit: &FitData, energies: Energies) -> Result<Texturer, TextureError> {
        let Energies { distance, turn, movement, size } = energies;
        let is_possible = distance > 0.0 && turn >= 0.0 && distance >= turn && movement >= 0.0;
        assert!(is_possible && (0.0..1.0).contains(&size), "no energies: {energies:?}");
        if mesh.uv.is_empty() {
            return Err(TextureError::NoTexture);
        }
        let vertex_count = mesh.uv.len();
        assert!(fit.uv.iter().all(|uv| uv.len() == vertex_count), "every size has a texture coordinate per vertex");
        let unique_of: Vec<u32> = (0..mesh.positions_m.len() as u32).chain(mesh.twin_of.iter().copied()).collect();
        let triangles = weighted_triangles(mesh, &unique_of, size);
        let mut texturer = Texturer {
            energies,
            unique_of,
            part_of: parts_of_vertices(mesh),
            flat: vec![mesh.uv.clone()],
            factor: factor(vertex_count, &triangles)?,
            triangles,
        };
        texturer.stiffen(&mesh.positions_m)?;
        texturer.flat.extend_from_slice(&fit.uv);
        Ok(texturer)
    }

    /// Makes edges count more where the base cannot be laid flat, a shoulder or a bust: there the sizes cannot either, and the strain
    /// spreads over a larger piece of cloth instead of spoiling one motif.
    fn stiffen(&mut self, base_m: &[Vec3]) -> Result<(), TextureError> {
        let mut scratch = TextureScratch::new(self);
        self.begin(base_m, &[], &mut scratch);
        (0..ROUNDS).for_each(|_| self.round(&mut scratch));
        for (triangle, laid) in self.triangles.iter_mut().zip(&scratch.laid) {
            let strain =
                stretch(&triangle.edges(|v| DVec2::from(scratch.uv[v])), &laid.edges).map(|stretch| stretch - 1.0);
            let stiffness = 1.0 + (strain[0] * strain[0] + strain[1] * strain[1]) / (STIFF_AT * STIFF_AT);
            // What is no number, of a triangle without area, becomes the stiffest.
            triangle.weights = triangle.weights.map(|w| w * stiffness.min(STIFFEST));
            triangle.area *= stiffness.min(STIFFEST);
        }
        self.factor = factor(self.unique_of.len(), &self.triangles)?;
        Ok(())
    }

    /// How many sizes have flat pieces of their own.
    #[must_use]
    pub fn size_count(&self) -> usize {
        self.flat.len() - 1
    }

    /// The blend of the sizes' flat pieces. `weights` has a row per part with a weight for every size target; what a row lacks to 1
    /// counts for the base.
    ///
    /// # Panics
    /// When `weights` has fewer rows than the mesh has parts, or `uv` another length than the garment has vertices.
    pub fn blend(&self, weights: &[f32], uv: &mut [Vec2]) {
        assert_eq!(uv.len(), self.unique_of.len(), "one texture coordinate per vertex");
        uv.iter_mut().enumerate().for_each(|(v, uv)| *uv = self.blended(weights, v).as_vec2());
    }

    fn blended(&self, weights: &[f32], vertex: usize) -> DVec2 {
        let sizes = self.size_count();
        let base = self.flat[0][vertex].as_dvec2();
        let weights = &weights[self.part_of[vertex] as usize * sizes..][..sizes];
        let moved =
            self.flat[1..].iter().zip(weights).map(|(flat, &w)| (flat[vertex].as_dvec2() - base) * f64::from(w));
        base + moved.sum::<DVec2>()
    }

    /// Corrects the texture of a shape: `positions_m` of its unique vertices in the T-pose (more are not read), `weights` as for
    /// [`Texturer::blend`]. Writes one coordinate per vertex, twins included. Allocates nothing.
    ///
    /// # Panics
    /// As [`Texturer::blend`], and when there are fewer positions than unique vertices or the scratch is of another garment.
    pub fn correct(&self, positions_m: &[Vec3], weights: &[f32], scratch: &mut TextureScratch, uv: &mut [Vec2]) {
        assert_eq!(uv.len(), self.unique_of.len(), "one texture coordinate per vertex");
        self.begin(positions_m, weights, scratch);
        (0..ROUNDS).for_each(|_| self.round(scratch));
        uv.iter_mut().zip(&scratch.uv).for_each(|(uv, &solved)| *uv = DVec2::from(solved).as_vec2());
    }

    /// Lays the shape's triangles flat and starts from the blended pieces.
    fn begin(&self, positions_m: &[Vec3], weights: &[f32], scratch: &mut TextureScratch) {
        let TextureScratch { flat, laid, fixed, uv, .. } = scratch;
        let Energies { distance, turn, movement, .. } = self.energies;
        for (vertex, flat) in flat.iter_mut().enumerate() {
            *flat = self.blended(weights, vertex);
            uv[vertex] = flat.to_array();
            fixed[vertex] = (*flat * PULL).to_array();
        }
        for (triangle, laid) in self.triangles.iter().zip(laid) {
            let [a, b, c] = triangle.vertices.map(|v| positions_m[self.unique_of[v as usize] as usize]);
            laid.edges = laid_flat(a, b, c).map(|edge| edge * triangle.uv_per_m.abs());
            if triangle.uv_per_m < 0.0 {
                laid.edges = laid.edges.map(|edge| DVec2::new(edge.x, -edge.y));
            }
            let blended = triangle.edges(|v| flat[v]);
            laid.as_blended = triangle.rotation(&laid.edges, &blended);
            let wanted = |k: usize| {
                (laid.edges[k].rotate(laid.as_blended) * turn + blended[k] * movement) / (distance + movement)
            };
            triangle.scatter(wanted, fixed);
        }
    }

    /// Rotations given the coordinates, then a step towards the coordinates that are best for them.
    fn round(&self, TextureScratch { laid, fixed, uv, rows, solver, .. }: &mut TextureScratch) {
        let Energies { distance, turn, movement, size } = self.energies;
        // ws E_s + wr E_r = (ws - wr) E_s + wr |e - R⁰ x|²: the last is fixed, so that the rotations serve only the rest.
        let share = (distance - turn) / (distance + movement);
        for ((row, fixed), uv) in rows.iter_mut().zip(&*fixed).zip(&*uv) {
            *row = (DVec2::from(*fixed) - DVec2::from(*uv) * PULL).to_array();
        }
        for (triangle, laid) in self.triangles.iter().zip(&*laid) {
            let edges = triangle.edges(|v| DVec2::from(uv[v]));
            let rotation = triangle.rotation(&laid.edges, &edges);
            triangle.scatter(|k| laid.edges[k].rotate(rotation) * share - edges[k], rows);
        }
        self.factor.solve(rows, solver);
        let stride = STRIDE / (1.0 + size);
        for (uv, step) in uv.as_flattened_mut().iter_mut().zip(rows.as_flattened()) {
            *uv += stride * step;
        }
    }
}

impl TextureScratch {
    /// For this garment.
    #[must_use]
    pub fn new(texturer: &Texturer) -> TextureScratch {
        let count = texturer.unique_of.len();
        TextureScratch {
            flat: vec![DVec2::ZERO; count],
            laid: vec![Laid::default(); texturer.triangles.len()],
            fixed: vec![[0.0; 2]; count],
            uv: vec![[0.0; 2]; count],
            rows: vec![[0.0; 2]; count],
            solver: vec![[0.0; 2]; count],
        }
    }
}

impl Triangle {
    /// Edges from each corner to the next.
    fn edges(&self, at: impl Fn(usize) -> DVec2) -> [DVec2; 3] {
        let [a, b, c] = self.vertices.map(|v| at(v as usize));
        [b - a, c - b, a - c]
    }

    /// The rotation that best turns `from` into `to`, as a unit complex number; none where every one is as good.
    fn rotation(&self, from: &[DVec2; 3], to: &[DVec2; 3]) -> DVec2 {
        self.product(from, to).normalize_or(DVec2::X)
    }

    /// ⟨from, to⟩
    fn product(&self, from: &[DVec2; 3], to: &[DVec2; 3]) -> DVec2 {
        let conjugate = |a: DVec2, b: DVec2| DVec2::new(a.dot(b), a.perp_dot(b));
        let edges = self.weights.iter().zip(from.iter().zip(to));
        let sum: DVec2 = edges.map(|(&w, (from, to))| conjugate(*from, *to) * w).sum();
        let doubled_area = (conjugate(from[1], to[0]) - conjugate(from[0], to[1])).perp() / 2.0;
        sum + doubled_area * self.area
    }

    /// Adds what it means for the right-hand side that the edges want to be so.
    fn scatter(&self, wanted: impl Fn(usize) -> DVec2, rows: &mut [[f64; 2]]) {
        let wanted: [DVec2; 3] = std::array::from_fn(wanted);
        let pulls: [DVec2; 3] = std::array::from_fn(|k| wanted[k] * self.weights[k]);
        for (k, &vertex) in self.vertices.iter().enumerate() {
            let row = &mut rows[vertex as usize];
            // A corner sees the area by the edge that it faces.
            let pull = pulls[(k + 2) % 3] - pulls[k] + wanted[(k + 1) % 3].perp() * (self.area / 2.0);
            *row = [row[0] + pull.x, row[1] + pull.y];
        }
    }
}

/// The matrix of Σ w |e|² and [`PULL`], factored.
fn factor(vertex_count: usize, triangles: &[Triangle]) -> Result<EnvelopeCholesky, FactorError> {
    let mut entries: Vec<(u32, u32, f64)> = (0..vertex_count as u32).map(|v| (v, v, PULL)).collect();
    for Triangle { vertices, weights, .. } in triangles {
        for (k, &w) in weights.iter().enumerate() {
            let (a, b) = (vertices[k], vertices[(k + 1) % 3]);
            if a != b {
                entries.extend([(a, a, w), (b, b, w), (a, b, -w)]);
            }
        }
    }
    EnvelopeCholesky::new(vertex_count, &entries)
}

/// How much a triangle is stretched: the singular values, the larger first, of the linear map that takes the edges `from` to the edges
/// `to`, each from one corner to the next. Infinite or no number where `from` has no area.
#[must_use]
pub fn stretch(from: &[DVec2; 3], to: &[DVec2; 3]) -> [f64; 2] {
    let doubled_area = from[0].perp_dot(from[1]);
    // Columns of the map.
    let x = (to[0] * from[1].y - to[1] * from[0].y) / doubled_area;
    let y = (to[1] * from[0].x - to[0] * from[1].x) / doubled_area;
    // Every plane map is a turned scaling plus a mirrored one.
    let turned = DVec2::new(x.x + y.y, x.y - y.x).length() / 2.0;
    let mirrored = DVec2::new(x.x - y.y, x.y + y.x).length() / 2.0;
    [turned + mirrored, (turned - mirrored).abs()]
}

/// Edges of a triangle from each corner to the next, laid into the plane counter-clockwise, the first along x; metres.
#[must_use]
pub fn laid_flat(a: Vec3, b: Vec3, c: Vec3) -> [DVec2; 3] {
    let (ab, ac) = ((b - a).as_dvec3(), (c - a).as_dvec3());
    let length = ab.length();
    // A triangle whose first edge has no length stands upright.
    let along = if length > 0.0 { ac.dot(ab) / length } else { 0.0 };
    let height = (ac.length_squared() - along * along).max(0.0).sqrt();
    let (b, c) = (DVec2::new(length, 0.0), DVec2::new(along, height));
    [b, c - b, -c]
}

/// Triangles with the cotangent weights of the base's shape, and with the scale and side of the texture on their island: the median over
/// the island's edges, which neither a few slivers nor the strain of a drape moves, and the side on which most of its area lies.
fn weighted_triangles(mesh: &Mesh, unique_of: &[u32], size: f64) -> Vec<Triangle> {
    let island_of = islands(mesh.uv.len(), &mesh.triangles);
    let mut ratios: Vec<(u32, f64)> = Vec::with_capacity(3 * mesh.triangles.len());
    let mut uv_per_m = vec![0.0; mesh.uv.len()];
    let mut areas = uv_per_m.clone();
    let mut triangles: Vec<Triangle> = mesh
        .triangles
        .iter()
        .map(|&vertices| {
            let [a, b, c] = vertices.map(|v| mesh.positions_m[unique_of[v as usize] as usize]);
            let edges = laid_flat(a, b, c);
            let doubled_area = edges[0].perp_dot(edges[1]);
            let weights = std::array::from_fn(|k| {
                let cotangent = -edges[(k + 1) % 3].dot(edges[(k + 2) % 3]) / doubled_area;
                // A triangle without area has none.
                if cotangent.is_nan() { EDGE_WEIGHT.0 } else { (cotangent / 2.0).clamp(EDGE_WEIGHT.0, EDGE_WEIGHT.1) }
            });
            let [u, v, w]: [f64; 3] = weights;
            // Twice the root is 1 where no weight is bounded; always, the area weighs less than the edges.
            let area = 2.0 * size * (u * v + v * w + w * u).sqrt();
            let triangle = Triangle { vertices, weights, area, uv_per_m: 0.0 };
            let texture = triangle.edges(|v| mesh.uv[v].as_dvec2());
            let island = island_of[vertices[0] as usize];
            areas[island as usize] += texture[0].perp_dot(texture[1]);
            let pairs = texture.iter().zip(edges).filter(|(_, edge)| edge.length_squared() > 0.0);
            ratios.extend(pairs.map(|(texture, edge)| (island, texture.length() / edge.length())));
            triangle
        })
        .collect();
    ratios.sort_by(|a, b| a.0.cmp(&b.0).then(a.1.total_cmp(&b.1)));
    for of_island in ratios.chunk_by(|a, b| a.0 == b.0) {
        let (island, median) = of_island[of_island.len() / 2];
        uv_per_m[island as usize] = if areas[island as usize] < 0.0 { -median } else { median };
    }
    for triangle in &mut triangles {
        triangle.uv_per_m = uv_per_m[island_of[triangle.vertices[0] as usize] as usize];
        triangle.area = triangle.area.copysign(triangle.uv_per_m);
    }
    triangles
}

/// For each vertex the least vertex of its island: what triangles join by their vertices, twins included.
fn islands(vertex_count: usize, triangles: &[[u32; 3]]) -> Vec<u32> {
    fn root(island_of: &mut [u32], vertex: u32) -> u32 {
        let mut at = vertex;
        while island_of[at as usize] != at {
            // Halves the way for the next who asks.
            island_of[at as usize] = island_of[island_of[at as usize] as usize];
            at = island_of[at as usize];
        }
        at
    }
    let mut island_of: Vec<u32> = (0..vertex_count as u32).collect();
    for &[a, b, c] in triangles {
        for (a, b) in [(a, b), (b, c)] {
            let (a, b) = (root(&mut island_of, a), root(&mut island_of, b));
            island_of[a.max(b) as usize] = a.min(b);
        }
    }
    for vertex in 0..vertex_count as u32 {
        island_of[vertex as usize] = root(&mut island_of, vertex);
    }
    island_of
}

/// The part of each vertex: that of its first triangle.
fn parts_of_vertices(mesh: &Mesh) -> Vec<u32> {
    let mut part_of = vec![u32::MAX; mesh.uv.len()];
    let mut triangles = mesh.triangles.iter();
    for (part, number) in mesh.parts.iter().zip(0..) {
        for &vertex in triangles.by_ref().take(part.triangle_count as usize).flatten() {
            part_of[vertex as usize] = number.min(part_of[vertex as usize]);
        }
    }
    // What no triangle shows may follow any.
    part_of.into_iter().map(|part| if part == u32::MAX { 0 } else { part }).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::arrays::Part;
    use proptest::prelude::*;

    /// Columns and rows of vertices of a piece.
    const PIECE: [usize; 2] = [5, 9];
    const COUNT: usize = PIECE[0] * PIECE[1];
    /// Texture units per metre.
    const SCALE: f32 = 0.3;

    /// Vertices of a flat piece, `width_m` by `length_m`.
    fn piece(width_m: f32, length_m: f32) -> impl Iterator<Item = Vec2> {
        let [columns, rows] = PIECE;
        let share = move |v: usize| {
            Vec2::new((v % columns) as f32 / (columns - 1) as f32, (v / columns) as f32 / (rows - 1) as f32)
        };
        (0..COUNT).map(move |v| share(v) * Vec2::new(width_m, length_m))
    }

    /// Two flat pieces side by side, the second seen from behind.
    fn flat(width_m: f32, length_m: f32) -> Vec<Vec2> {
        let left = piece(width_m, length_m);
        let right = piece(width_m, length_m).map(move |p| Vec2::new(3.0 - p.x, p.y));
        left.chain(right).map(|p| p * SCALE).collect()
    }

    /// The same pieces wound round an upright cylinder, without strain.
    fn wound(width_m: f32, length_m: f32) -> Vec<Vec3> {
        const RADIUS_M: f32 = 0.4;
        let at = |along: f32, up: f32| {
            Vec3::new(RADIUS_M * libm::sinf(along / RADIUS_M), up, RADIUS_M * libm::cosf(along / RADIUS_M))
        };
        let left = piece(width_m, length_m).map(|p| at(p.x, p.y));
        let right = piece(width_m, length_m).map(|p| at(-p.x, p.y));
        left.chain(right).collect()
    }

    fn mesh() -> Mesh {
        let [columns, rows] = PIECE;
        let cells = (0..rows - 1).flat_map(|y| (0..columns - 1).map(move |x| (y * columns + x) as u32));
        let next = columns as u32;
        let left: Vec<[u32; 3]> = cells.flat_map(|v| [[v, v + 1, v + next], [v + 1, v + next + 1, v + next]]).collect();
        let right = left.iter().map(|&[a, b, c]| [a, c, b].map(|v| v + COUNT as u32));
        let part = |name: &str| Part { name: name.to_owned(), triangle_count: left.len() as u32 };
        Mesh {
            positions_m: wound(0.3, 0.9),
            uv: flat(0.3, 0.9),
            parts: vec![part("left"), part("right")],
            triangles: left.iter().copied().chain(right).collect(),
            ..Mesh::default()
        }
    }

    /// A wide size and a long one.
    const SIZES: [[f32; 2]; 2] = [[0.4, 0.9], [0.3, 1.2]];

    fn fit_data() -> FitData {
        FitData { uv: SIZES.map(|[width_m, length_m]| flat(width_m, length_m)).to_vec(), ..FitData::default() }
    }

    fn corrected(texturer: &Texturer, positions_m: &[Vec3], weights: &[f32]) -> Vec<Vec2> {
        let mut uv = vec![Vec2::NAN; 2 * COUNT];
        texturer.correct(positions_m, weights, &mut TextureScratch::new(texturer), &mut uv);
        uv
    }

    fn farthest(a: &[Vec2], b: &[Vec2]) -> f32 {
        a.iter().zip(b).map(|(a, b)| a.distance(*b)).fold(0.0, f32::max)
    }

    #[test]
    fn a_size_gives_its_own_flat_pieces() {
        let texturer = Texturer::new(&mesh(), &fit_data()).unwrap();
        for (size, [width_m, length_m]) in SIZES.into_iter().enumerate() {
            let mut weights = [0.0; 4];
            [weights[size], weights[2 + size]] = [1.0; 2];
            let uv = corrected(&texturer, &wound(width_m, length_m), &weights);
            // The cylinder is one of flat facets; chords are a little shorter than arcs.
            assert!(farthest(&uv, &flat(width_m, length_m)) < 1e-3 * SCALE, "size {size}");
        }
    }

    #[test]
    fn what_the_flat_pieces_do_not_know_is_taken_up_by_the_shape() {
        // Weights of 0, but the shape of the long size: the texture has to grow by itself, about the middle of each piece.
        let texturer = Texturer::new(&mesh(), &fit_data()).unwrap();
        let before = SIZES[1][1] / 0.9 - 1.0;
        let uv = corrected(&texturer, &wound(SIZES[1][0], SIZES[1][1]), &[0.0; 4]);
        let height = |from: usize| (uv[from + COUNT - 1].y - uv[from].y) / SCALE;
        for from in [0, COUNT] {
            let after = SIZES[1][1] / height(from) - 1.0;
            assert!(after.abs() < 0.1 * before, "piece at {from}: {after} of {before}");
        }
    }

    #[test]
    fn pieces_do_not_see_each_other() {
        let texturer = Texturer::new(&mesh(), &fit_data()).unwrap();
        let shape_m = wound(0.3, 0.9);
        let mut other_m = shape_m.clone();
        other_m[..COUNT].iter_mut().for_each(|position_m| *position_m *= 1.3);
        let [uv, other] =
            [&shape_m, &other_m].map(|positions_m| corrected(&texturer, positions_m, &[0.1, 0.0, 0.3, 0.2]));
        assert_eq!(uv[COUNT..], other[COUNT..]);
        assert!(farthest(&uv[..COUNT], &other[..COUNT]) > 0.01);
    }

    #[test]
    fn without_texture_there_is_nothing_to_correct() {
        let bare = Mesh { uv: Vec::new(), ..mesh() };
        assert_eq!(Texturer::new(&bare, &FitData::default()).unwrap_err(), TextureError::NoTexture);
    }

    #[test]
    fn stretch_gives_singular_values() {
        let closed = |a: DVec2, b: DVec2| [a, b - a, -b];
        let (a, b) = (DVec2::new(2.0, 1.0), DVec2::new(-1.0, 3.0));
        let turned = DVec2::from_angle(1.1);
        // Turned, then scaled along the axes, then turned; and the same mirrored.
        let map = |p: DVec2| (p.rotate(turned) * DVec2::new(3.0, 0.5)).rotate(DVec2::from_angle(-0.4));
        for mirror in [1.0, -1.0] {
            let image = |p: DVec2| map(p) * DVec2::new(mirror, 1.0);
            let [large, small] = stretch(&closed(a, b), &closed(image(a), image(b)));
            assert!((large - 3.0).abs() < 1e-12 && (small - 0.5).abs() < 1e-12, "{large} {small}");
        }
    }

    /// The energy and its three parts as the module's first lines have them, triangle by triangle, with nothing shared but the weights.
    fn energy(texturer: &Texturer, positions_m: &[Vec3], blended: &[DVec2], uv: &[DVec2]) -> f64 {
        texturer.triangles.iter().map(|triangle| triangle_energy(texturer, triangle, positions_m, blended, uv)).sum()
    }

    fn triangle_energy(
        texturer: &Texturer,
        triangle: &Triangle,
        positions_m: &[Vec3],
        blended: &[DVec2],
        uv: &[DVec2],
    ) -> f64 {
        let Energies { distance, turn, movement, .. } = texturer.energies;
        let corners = triangle.vertices.map(|v| v as usize);
        let [a, b, c] = corners.map(|v| positions_m[v].as_dvec3() * triangle.uv_per_m.abs());
        // Another way to lay a triangle flat: by its three lengths.
        let (ab, bc, ca) = (a.distance(b), b.distance(c), c.distance(a));
        let x = if ab > 0.0 { (ab * ab + ca * ca - bc * bc) / (2.0 * ab) } else { 0.0 };
        let y = (ca * ca - x * x).max(0.0).sqrt() * triangle.uv_per_m.signum();
        let laid = [DVec2::ZERO, DVec2::new(ab, 0.0), DVec2::new(x, y)];
        let pairs = [(0, 1), (1, 2), (2, 0)].into_iter().zip(triangle.weights);
        let (mut size, mut with_uv, mut with_blended, mut moved) = (0.0, DVec2::ZERO, DVec2::ZERO, 0.0);
        for ((i, j), w) in pairs {
            let x = laid[j] - laid[i];
            let e = uv[corners[j]] - uv[corners[i]];
            let e0 = blended[corners[j]] - blended[corners[i]];
            size += w * (x.length_squared() + e.length_squared());
            with_uv += w * DVec2::new(x.dot(e), x.perp_dot(e));
            with_blended += w * DVec2::new(x.dot(e0), x.perp_dot(e0));
            moved += w * e.distance_squared(e0);
        }
        // Doubled areas by corners, and their mixed form, linear in one place and conjugate linear in the other.
        let mixed = |from: [DVec2; 3], to: [DVec2; 3]| {
            let at = |k: usize| {
                let across = -(to[(k + 1) % 3] - to[(k + 2) % 3]).perp() / 2.0;
                DVec2::new(from[k].dot(across), from[k].perp_dot(across))
            };
            (at(0) + at(1) + at(2)) * triangle.area
        };
        let [new, old] = [uv, blended].map(|uv| corners.map(|v| uv[v]));
        let change = [0, 1, 2].map(|k| new[k] - old[k]);
        size += mixed(laid, laid).x + mixed(new, new).x;
        with_uv += mixed(laid, new);
        with_blended += mixed(laid, old);
        moved += mixed(change, change).x;
        let cosine = with_uv.normalize_or(DVec2::X).dot(with_blended.normalize_or(DVec2::X));
        let turned = 2.0 * with_uv.length() * (1.0 - cosine);
        distance * (size - 2.0 * with_uv.length()) + turn * turned + movement * moved
    }

    /// Rotation, coordinates, rotation, … for so many rounds; the energies on the way.
    fn energies(texturer: &Texturer, positions_m: &[Vec3], weights: &[f32], rounds: usize) -> (Vec<DVec2>, Vec<f64>) {
        let mut scratch = TextureScratch::new(texturer);
        texturer.begin(positions_m, weights, &mut scratch);
        let uv = |scratch: &TextureScratch| scratch.uv.iter().copied().map(DVec2::from).collect::<Vec<_>>();
        let mut energies = vec![energy(texturer, positions_m, &scratch.flat, &uv(&scratch))];
        for _ in 0..rounds {
            texturer.round(&mut scratch);
            energies.push(energy(texturer, positions_m, &scratch.flat, &uv(&scratch)));
        }
        (uv(&scratch), energies)
    }

    /// The paper's way: the edges of a dimension are stretched about their middle by the change of their length, then every vertex that
    /// shares an edge with one already moved finds its own best place, and so on outward. Then again over all, until nothing moves.
    fn swept(
        texturer: &Texturer,
        positions_m: &[Vec3],
        dimension: &[usize],
        blended: &[DVec2],
        sweeps: usize,
    ) -> Vec<DVec2> {
        let mut uv = blended.to_vec();
        let mut moved = vec![false; uv.len()];
        let scale = texturer.triangles[0].uv_per_m.abs();
        for pair in dimension.windows(2) {
            let [a, b] = [pair[0], pair[1]];
            let ratio =
                scale * positions_m[a].as_dvec3().distance(positions_m[b].as_dvec3()) / blended[a].distance(blended[b]);
            // Each edge about the end that the one before has already set; about its middle for the first.
            let from = if moved[a] {
                uv[a]
            } else {
                blended[a].midpoint(blended[b]) + (blended[a] - blended[b]) * ratio / 2.0
            };
            (uv[a], uv[b]) = (from, from + (blended[b] - blended[a]) * ratio);
            (moved[a], moved[b]) = (true, true);
        }
        let local = |uv: &mut Vec<DVec2>, vertex: usize| {
            let round: Vec<&Triangle> =
                texturer.triangles.iter().filter(|triangle| triangle.vertices.contains(&(vertex as u32))).collect();
            let cost = |uv: &[DVec2]| {
                round.iter().map(|triangle| triangle_energy(texturer, triangle, positions_m, blended, uv)).sum::<f64>()
            };
            // Coordinate search: nothing to get wrong.
            let mut step = 0.01;
            let mut best = cost(uv);
            while step > 1e-7 {
                let at = uv[vertex];
                let found = [DVec2::X, -DVec2::X, DVec2::Y, -DVec2::Y].into_iter().find_map(|way| {
                    uv[vertex] = at + way * step;
                    let cost = cost(uv);
                    (cost < best).then_some((uv[vertex], cost))
                });
                match found {
                    Some((place, cost)) => (uv[vertex], best) = (place, cost),
                    None => {
                        uv[vertex] = at;
                        step /= 2.0;
                    }
                }
            }
        };
        while let Some(vertex) = (0..COUNT).find(|&v| {
            let joined =
                |t: &Triangle| t.vertices.contains(&(v as u32)) && t.vertices.iter().any(|&n| moved[n as usize]);
            !moved[v] && texturer.triangles.iter().any(joined)
        }) {
            local(&mut uv, vertex);
            moved[vertex] = true;
        }
        for _ in 0..sweeps {
            (0..COUNT).for_each(|vertex| local(&mut uv, vertex));
        }
        uv
    }

    #[test]
    fn the_sweep_of_the_paper_ends_at_the_same_energy() {
        // One piece, fitted to a shape that is wider below, longer and bent.
        let piece_m: Vec<Vec3> =
            wound(0.3, 1.0).iter().map(|p| Vec3::new(p.x * (1.2 - 0.3 * p.y), p.y, p.z + 0.2 * p.y * p.y)).collect();
        let half = |mesh: Mesh| Mesh {
            positions_m: mesh.positions_m[..COUNT].to_vec(),
            uv: mesh.uv[..COUNT].to_vec(),
            triangles: mesh.triangles[..mesh.triangles.len() / 2].to_vec(),
            parts: mesh.parts[..1].to_vec(),
            ..Mesh::default()
        };
        for of in [Energies::PAPER, Energies::default()] {
            let texturer = Texturer::with_energies(&half(mesh()), &FitData::default(), of).unwrap();
            let (_, energies) = energies(&texturer, &piece_m, &[], 60);
            let blended: Vec<DVec2> = texturer.flat[0].iter().map(|uv| uv.as_dvec2()).collect();
            let dimension: Vec<usize> = (0..PIECE[1]).map(|row| row * PIECE[0] + 2).collect();
            let [once, settled] = [0, 150].map(|sweeps| {
                energy(&texturer, &piece_m, &blended, &swept(&texturer, &piece_m, &dimension, &blended, sweeps))
            });
            let [start, used, best] = [energies[0], energies[ROUNDS], energies[60]];
            assert!((best - settled).abs() < 0.01 * (start - best), "{best} is not {settled}, from {start}");
            assert!(used <= once && used - best < 0.05 * (start - best), "{used} of {once}, {best}");
        }
    }

    proptest! {
        #[test]
        fn no_shape_raises_the_energy_or_makes_a_piece_drift(
            moves in prop::collection::vec(prop::array::uniform3(-0.2f32..0.2), 2 * COUNT),
            collapsed in prop::collection::vec(0usize..2 * COUNT, 0..6),
            weights in prop::array::uniform4(-1.0f32..2.0),
        ) {
            let texturer = Texturer::new(&mesh(), &fit_data()).unwrap();
            let mut positions_m: Vec<Vec3> =
                wound(0.3, 0.9).iter().zip(moves).map(|(&p, moved)| p + Vec3::from(moved)).collect();
            for at in collapsed {
                positions_m[at] = positions_m[(at + 1) % (2 * COUNT)];
            }
            let (uv, energies) = energies(&texturer, &positions_m, &weights, 8);
            prop_assert!(energies.windows(2).all(|pair| pair[1] <= pair[0] * (1.0 + 1e-9)), "{energies:?}");
            let mut blended = vec![Vec2::ZERO; 2 * COUNT];
            texturer.blend(&weights, &mut blended);
            for piece in [0..COUNT, COUNT..2 * COUNT] {
                let mean = uv[piece.clone()].iter().sum::<DVec2>() / COUNT as f64;
                let wanted = blended[piece].iter().map(|uv| uv.as_dvec2()).sum::<DVec2>() / COUNT as f64;
                prop_assert!(mean.distance(wanted) < 1e-6, "{mean} is not {wanted}");
            }
        }
    }

    #[test]
    fn a_base_with_triangles_that_are_none_or_mirrored_is_no_trouble() {
        let mut mesh = mesh();
        mesh.positions_m[7] = mesh.positions_m[8];
        mesh.uv[30] = mesh.uv[31];
        mesh.uv.swap(COUNT + 12, COUNT + 13);
        mesh.triangles[3] = [4; 3];
        let texturer = Texturer::new(&mesh, &fit_data()).unwrap();
        let uv = corrected(&texturer, &wound(0.35, 1.0), &[0.5, 0.3, 0.5, 0.3]);
        assert!(uv.iter().all(|uv| uv.is_finite() && uv.abs().max_element() < 2.0), "{uv:?}");
    }
}
