//! A piece of cloth as a net of particles: triangles, edges with their length and grain at rest, creases, seams, and what holds
//! it. Validated when it is made. Knows no forces and no body.

use glam::{DVec2, DVec3};

/// Most particles of a sheet.
pub const MOST_PARTICLES: usize = 1 << 22;
/// How many faulty triangles an error names.
const NAMED: usize = 8;
/// Doubled area over longest edge squared, below which a triangle is degenerate.
const FLAT: f64 = 1e-6;

/// An edge of triangles; the spring of P2's tension and shear.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Edge {
    /// Its particles, the smaller number first.
    pub ends: [u32; 2],
    /// Length in the flat pattern, metres, above 0. Where two panels are welded, the mean of both.
    pub rest_m: f64,
    /// Cosine of twice the angle from the warp in the pattern: 1 along the warp, 0 on the bias, -1 along the weft.
    pub grain: f64,
    /// Pattern area of its triangles over its length cubed, 1/m: times a tension per width of cloth at strain 1 (N/m) it is
    /// the coefficient of the quadratic force (N/m²), because area over length is the width of cloth that the edge stands for.
    pub width_per_length_squared: f64,
}

/// Two triangles at a shared edge.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hinge {
    /// The particles of the shared edge.
    pub edge: [u32; 2],
    /// The particle opposite it in either triangle.
    pub outer: [u32; 2],
    /// Length of the shared edge in the pattern, metres.
    pub rest_m: f64,
}

/// A particle that a linear spring draws to a place: for cloth that is tacked to a body or led by a hand.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Attachment {
    /// Which particle.
    pub particle: u32,
    /// Where it is drawn.
    pub place_m: DVec3,
    /// How hard, N/m, at least 0.
    pub stiffness_n_per_m: f64,
}

/// A mesh with pattern coordinates, from any modeller.
#[derive(Clone, Copy, Debug)]
pub struct PatternMesh<'a> {
    /// Where its vertices are, metres.
    pub positions_m: &'a [DVec3],
    /// Three vertices each; their order of turning does not matter.
    pub triangles: &'a [[u32; 3]],
    /// Pattern coordinates of the corners of each triangle: U along the weft, V along the warp.
    pub corners_uv: &'a [[DVec2; 3]],
    /// Metres per unit of U and V, above 0: 0.01 for coordinates in centimetres.
    pub metres_per_uv: f64,
    /// Pairs of vertices that become one particle, in the middle between them.
    pub welds: &'a [[u32; 2]],
}

/// A flat rectangle of particles at equal distances, its diagonals turned from cell to cell, so that neither bias is preferred.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Grid {
    /// Particles along the warp, at least 2.
    pub rows: usize,
    /// Particles along the weft, at least 2.
    pub columns: usize,
    /// Distance of neighbours, metres, above 0.
    pub spacing_m: f64,
    /// Where particle 0 is; row by row, the others follow.
    pub corner_m: DVec3,
    /// Direction of a row, a unit vector.
    pub weft: DVec3,
    /// Direction from row to row, a unit vector.
    pub warp: DVec3,
}

/// Why a mesh is no sheet.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum SheetError {
    /// A number is not finite or not in its range.
    #[error("{what} {number} is {value}, must be {range}")]
    Number {
        /// Of what.
        what: &'static str,
        /// Which one, from 0.
        number: usize,
        /// Its value.
        value: String,
        /// What it may be.
        range: &'static str,
    },
    /// Something names a particle or vertex that is not there.
    #[error("{what} {number} names vertex {vertex} of {vertices}")]
    Index {
        /// What names it.
        what: &'static str,
        /// Which one, from 0.
        number: usize,
        /// What it names.
        vertex: u32,
        /// How many there are.
        vertices: usize,
    },
    /// Lists that belong together have different lengths.
    #[error("{triangles} triangles but pattern coordinates for {corners}")]
    Corners {
        /// How many triangles.
        triangles: usize,
        /// How many have coordinates.
        corners: usize,
    },
    /// Triangles without area.
    #[error("{count} triangles have no area in {place}: {} {:?}", if *count > triangles.len() { "the first are" } else { "numbers" }, triangles)]
    Degenerate {
        /// Space or pattern.
        place: &'static str,
        /// How many.
        count: usize,
        /// Which ones, from 0; the first few.
        triangles: Vec<usize>,
    },
    /// More than two triangles at an edge.
    #[error("{} triangles share the edge of vertices {} and {}: numbers {triangles:?}; cloth has at most 2", triangles.len(), ends[0], ends[1])]
    Branching {
        /// The edge's particles.
        ends: [u32; 2],
        /// The triangles.
        triangles: Vec<usize>,
    },
    /// A vertex that no triangle has.
    #[error("vertex {0} belongs to no triangle")]
    Unused(usize),
    /// No triangles, or too many particles.
    #[error("{0} particles, must be 3 to {MOST_PARTICLES}")]
    Count(usize),
}

/// Rows of numbers of different lengths, one after another.
#[derive(Clone, Debug, Default)]
struct Rows {
    starts: Vec<u32>,
    numbers: Vec<u32>,
}

/// A sheet of cloth. What it is made of never changes; seams, pins and attachments may.
#[derive(Clone, Debug)]
pub struct Sheet {
    positions_m: Vec<DVec3>,
    particle_of_vertex: Vec<u32>,
    triangles: Vec<[u32; 3]>,
    edges: Vec<Edge>,
    hinges: Vec<Hinge>,
    area_m2: f64,
    edges_at: Rows,
    hinges_at: Rows,
    pairs: Vec<[u32; 2]>,
    pins: Vec<Option<DVec3>>,
    attachments: Vec<Attachment>,
}

impl Sheet {
    /// From a mesh with pattern coordinates.
    ///
    /// # Errors
    /// When a number is not finite, an index is out of range, a triangle has no area in space or in the pattern, more than two
    /// share an edge, or a vertex has none; with the number of what is wrong.
    pub fn from_pattern(mesh: &PatternMesh) -> Result<Sheet, SheetError> {
        let vertices = mesh.positions_m.len();
        if !(3..=MOST_PARTICLES).contains(&vertices) {
            return Err(SheetError::Count(vertices));
        }
        if mesh.corners_uv.len() != mesh.triangles.len() {
            return Err(SheetError::Corners { triangles: mesh.triangles.len(), corners: mesh.corners_uv.len() });
        }
        check_positive("metres per pattern unit", 0, mesh.metres_per_uv)?;
        for (number, place) in mesh.positions_m.iter().enumerate() {
            check_finite("position", number, *place)?;
        }
        for (number, corners) in mesh.triangles.iter().enumerate() {
            check_indices("triangle", number, corners, vertices)?;
        }
        for (number, pair) in mesh.welds.iter().enumerate() {
            check_indices("weld", number, pair, vertices)?;
        }
        let (particle_of_vertex, positions_m) = welded(mesh.positions_m, mesh.welds);
        let triangles: Vec<[u32; 3]> =
            mesh.triangles.iter().map(|corners| corners.map(|vertex| particle_of_vertex[vertex as usize])).collect();
        let mut flat_m = Vec::with_capacity(triangles.len());
        for (number, corners) in mesh.corners_uv.iter().enumerate() {
            for uv in corners {
                check_finite("pattern coordinate of triangle", number, uv.extend(0.0))?;
            }
            flat_m.push(corners.map(|uv| (uv * mesh.metres_per_uv).extend(0.0)));
        }
        let in_space: Vec<[DVec3; 3]> =
            triangles.iter().map(|corners| corners.map(|particle| positions_m[particle as usize])).collect();
        check_areas("space", &in_space)?;
        check_areas("the pattern", &flat_m)?;
        let mut is_used = vec![false; positions_m.len()];
        for &particle in triangles.iter().flatten() {
            is_used[particle as usize] = true;
        }
        if let Some(unused) = is_used.iter().position(|used| !used) {
            let vertex = particle_of_vertex.iter().position(|&particle| particle as usize == unused);
            return Err(SheetError::Unused(vertex.unwrap_or(unused)));
        }
        let (edges, hinges) = edges_and_hinges(&triangles, &flat_m)?;
        let particles = positions_m.len();
        let edge_ends =
            edges.iter().enumerate().flat_map(|(i, edge)| (0..2).map(move |end| (edge.ends[end], 2 * i + end)));
        let hinge_corners = hinges.iter().enumerate().flat_map(|(i, hinge)| {
            let corners = [hinge.edge[0], hinge.edge[1], hinge.outer[0], hinge.outer[1]];
            (0..4).map(move |corner| (corners[corner], 4 * i + corner))
        });
        let (edges_at, hinges_at) = (rows(particles, edge_ends), rows(particles, hinge_corners));
        let area_m2 = flat_m.iter().map(|corners| 0.5 * doubled_area(corners)).sum();
        Ok(Sheet {
            positions_m,
            particle_of_vertex,
            triangles,
            edges,
            hinges,
            area_m2,
            edges_at,
            hinges_at,
            pairs: Vec::new(),
            pins: vec![None; particles],
            attachments: Vec::new(),
        })
    }

    /// From flat cloth in one coordinate per vertex, metres, weft along X and warp along Y, that is somewhere in space.
    ///
    /// # Errors
    /// As [`Sheet::from_pattern`].
    pub fn from_flat(flat_m: &[DVec2], triangles: &[[u32; 3]], positions_m: &[DVec3]) -> Result<Sheet, SheetError> {
        if flat_m.len() != positions_m.len() {
            return Err(SheetError::Count(positions_m.len()));
        }
        for (number, corners) in triangles.iter().enumerate() {
            check_indices("triangle", number, corners, flat_m.len())?;
        }
        let corners_uv: Vec<[DVec2; 3]> = triangles.iter().map(|corners| corners.map(|v| flat_m[v as usize])).collect();
        Sheet::from_pattern(&PatternMesh {
            positions_m,
            triangles,
            corners_uv: &corners_uv,
            metres_per_uv: 1.0,
            welds: &[],
        })
    }

    /// From a flat rectangle.
    ///
    /// # Errors
    /// When it has fewer than 2 rows or columns or too many particles, or a number is not finite or no unit vector.
    pub fn from_grid(grid: &Grid) -> Result<Sheet, SheetError> {
        let count = grid.rows.saturating_mul(grid.columns);
        if grid.rows < 2 || grid.columns < 2 || count > MOST_PARTICLES {
            return Err(SheetError::Count(count));
        }
        check_positive("spacing", 0, grid.spacing_m)?;
        for (number, direction) in [grid.weft, grid.warp].into_iter().enumerate() {
            if !direction.is_finite() || (direction.length_squared() - 1.0).abs() > 1e-6 {
                let value = direction.to_string();
                return Err(SheetError::Number { what: "direction", number, value, range: "a unit vector" });
            }
        }
        let uv = |particle: usize| {
            DVec2::new((particle % grid.columns) as f64, (particle / grid.columns) as f64) * grid.spacing_m
        };
        let positions_m: Vec<DVec3> =
            (0..count).map(|p| grid.corner_m + grid.weft * uv(p).x + grid.warp * uv(p).y).collect();
        let mut triangles = Vec::new();
        for row in 1..grid.rows {
            for column in 1..grid.columns {
                let d = row * grid.columns + column;
                let [a, b, c] = [d - grid.columns - 1, d - grid.columns, d - 1];
                let pair = if (row + column) % 2 == 0 { [[a, b, d], [a, d, c]] } else { [[a, b, c], [b, d, c]] };
                triangles.extend(pair.map(|corners| corners.map(|particle| particle as u32)));
            }
        }
        let corners_uv: Vec<[DVec2; 3]> =
            triangles.iter().map(|corners| corners.map(|particle| uv(particle as usize))).collect();
        Sheet::from_pattern(&PatternMesh {
            positions_m: &positions_m,
            triangles: &triangles,
            corners_uv: &corners_uv,
            metres_per_uv: 1.0,
            welds: &[],
        })
    }

    /// Pairs of particles that a thread draws together, added to those that are there.
    ///
    /// # Errors
    /// When a pair names a particle that is not there. Then nothing is sewn.
    pub fn sew(&mut self, pairs: &[[u32; 2]]) -> Result<(), SheetError> {
        for (number, pair) in pairs.iter().enumerate() {
            check_indices("pair", number, pair, self.positions_m.len())?;
        }
        self.pairs.extend_from_slice(pairs);
        Ok(())
    }

    /// Holds a particle at a place, metres, whatever draws it.
    ///
    /// # Errors
    /// When there is no such particle or the place is not finite.
    pub fn pin(&mut self, particle: u32, place_m: DVec3) -> Result<(), SheetError> {
        check_indices("pin", 0, &[particle], self.positions_m.len())?;
        check_finite("place of pin", 0, place_m)?;
        self.pins[particle as usize] = Some(place_m);
        Ok(())
    }

    /// Lets a particle go.
    ///
    /// # Errors
    /// When there is no such particle.
    pub fn unpin(&mut self, particle: u32) -> Result<(), SheetError> {
        check_indices("pin", 0, &[particle], self.positions_m.len())?;
        self.pins[particle as usize] = None;
        Ok(())
    }

    /// Replaces all attachments.
    ///
    /// # Errors
    /// When one names a particle that is not there, or a number is not finite or below 0. Then the old ones stay.
    pub fn attach(&mut self, attachments: &[Attachment]) -> Result<(), SheetError> {
        for (number, attachment) in attachments.iter().enumerate() {
            check_indices("attachment", number, &[attachment.particle], self.positions_m.len())?;
            check_finite("place of attachment", number, attachment.place_m)?;
            let value = attachment.stiffness_n_per_m;
            if !(value.is_finite() && value >= 0.0) {
                let range = "finite and at least 0";
                let what = "stiffness of attachment";
                return Err(SheetError::Number { what, number, value: value.to_string(), range });
            }
        }
        self.attachments = attachments.to_vec();
        Ok(())
    }

    /// Where the particles were when the sheet was made, metres.
    #[must_use]
    pub fn positions_m(&self) -> &[DVec3] {
        &self.positions_m
    }

    /// The particle of each vertex of the mesh; a weld gives two vertices the same one.
    #[must_use]
    pub fn particle_of_vertex(&self) -> &[u32] {
        &self.particle_of_vertex
    }

    /// Three particles each, in the order of the mesh.
    #[must_use]
    pub fn triangles(&self) -> &[[u32; 3]] {
        &self.triangles
    }

    /// All edges, ascending by their ends.
    #[must_use]
    pub fn edges(&self) -> &[Edge] {
        &self.edges
    }

    /// All pairs of triangles that share an edge, in the order of the edges.
    #[must_use]
    pub fn hinges(&self) -> &[Hinge] {
        &self.hinges
    }

    /// Area of the pattern, square metres.
    #[must_use]
    pub fn area_m2(&self) -> f64 {
        self.area_m2
    }

    /// Pairs that a thread draws together.
    #[must_use]
    pub fn pairs(&self) -> &[[u32; 2]] {
        &self.pairs
    }

    /// Where each particle is held, if it is.
    #[must_use]
    pub fn pins(&self) -> &[Option<DVec3>] {
        &self.pins
    }

    /// What springs draw to places.
    #[must_use]
    pub fn attachments(&self) -> &[Attachment] {
        &self.attachments
    }

    /// The edges at a particle, as edge times 2 plus which of its ends it is.
    pub(crate) fn edges_at(&self, particle: usize) -> &[u32] {
        row(&self.edges_at, particle)
    }

    /// The hinges at a particle, as hinge times 4 plus which corner it is: edge, edge, outer, outer.
    pub(crate) fn hinges_at(&self, particle: usize) -> &[u32] {
        row(&self.hinges_at, particle)
    }
}

fn row(rows: &Rows, number: usize) -> &[u32] {
    &rows.numbers[rows.starts[number] as usize..rows.starts[number + 1] as usize]
}

/// The numbers of each row, in the order in which they come.
fn rows(count: usize, entries: impl Iterator<Item = (u32, usize)> + Clone) -> Rows {
    let mut starts = vec![0u32; count + 1];
    for (row, _) in entries.clone() {
        starts[row as usize + 1] += 1;
    }
    for row in 0..count {
        starts[row + 1] += starts[row];
    }
    let mut next = starts.clone();
    let mut numbers = vec![0; starts[count] as usize];
    for (row, number) in entries {
        numbers[next[row as usize] as usize] = number as u32;
        next[row as usize] += 1;
    }
    Rows { starts, numbers }
}

fn check_finite(what: &'static str, number: usize, value: DVec3) -> Result<(), SheetError> {
    if value.is_finite() {
        return Ok(());
    }
    Err(SheetError::Number { what, number, value: value.to_string(), range: "finite" })
}

fn check_positive(what: &'static str, number: usize, value: f64) -> Result<(), SheetError> {
    if value.is_finite() && value > 0.0 {
        return Ok(());
    }
    Err(SheetError::Number { what, number, value: value.to_string(), range: "finite and above 0" })
}

fn check_indices(what: &'static str, number: usize, named: &[u32], vertices: usize) -> Result<(), SheetError> {
    match named.iter().find(|&&vertex| vertex as usize >= vertices) {
        None => Ok(()),
        Some(&vertex) => Err(SheetError::Index { what, number, vertex, vertices }),
    }
}

fn doubled_area(corners_m: &[DVec3; 3]) -> f64 {
    (corners_m[1] - corners_m[0]).cross(corners_m[2] - corners_m[0]).length_squared().sqrt()
}

fn check_areas(place: &'static str, triangles_m: &[[DVec3; 3]]) -> Result<(), SheetError> {
    let is_degenerate = |corners_m: &[DVec3; 3]| {
        let [a, b, c] = *corners_m;
        let longest = (b - a).length_squared().max((c - b).length_squared()).max((a - c).length_squared());
        // Asked this way round because what overflows is degenerate, too.
        let has_area = doubled_area(corners_m) > FLAT * longest;
        !has_area
    };
    let mut bad: Vec<usize> = (0..triangles_m.len()).filter(|&i| is_degenerate(&triangles_m[i])).collect();
    if bad.is_empty() {
        return Ok(());
    }
    let count = bad.len();
    bad.truncate(NAMED);
    Err(SheetError::Degenerate { place, count, triangles: bad })
}

/// The particle of each vertex, numbered by first vertices, and where the particles are: in the mean of their vertices.
fn welded(positions_m: &[DVec3], welds: &[[u32; 2]]) -> (Vec<u32>, Vec<DVec3>) {
    let mut parent: Vec<u32> = (0..positions_m.len() as u32).collect();
    for pair in welds {
        let [a, b] = pair.map(|vertex| root(&mut parent, vertex));
        parent[a.max(b) as usize] = a.min(b);
    }
    let mut particle_of_vertex = vec![0u32; positions_m.len()];
    let mut sums_m: Vec<(DVec3, f64)> = Vec::new();
    for vertex in 0..positions_m.len() {
        // The root is the smallest of its vertices, so it has its number already.
        let first = root(&mut parent, vertex as u32) as usize;
        if first == vertex {
            particle_of_vertex[vertex] = sums_m.len() as u32;
            sums_m.push((DVec3::ZERO, 0.0));
        }
        let particle = particle_of_vertex[first];
        particle_of_vertex[vertex] = particle;
        let sum = &mut sums_m[particle as usize];
        *sum = (sum.0 + positions_m[vertex], sum.1 + 1.0);
    }
    (particle_of_vertex, sums_m.into_iter().map(|(sum, count)| sum / count).collect())
}

fn root(parent: &mut [u32], mut vertex: u32) -> u32 {
    while parent[vertex as usize] != vertex {
        let above = parent[parent[vertex as usize] as usize];
        parent[vertex as usize] = above;
        vertex = above;
    }
    vertex
}

/// Edges and hinges from triangles and their corners in the pattern, ascending by ends.
fn edges_and_hinges(triangles: &[[u32; 3]], flat_m: &[[DVec3; 3]]) -> Result<(Vec<Edge>, Vec<Hinge>), SheetError> {
    let mut sides: Vec<([u32; 2], usize, usize)> = Vec::with_capacity(3 * triangles.len());
    for (triangle, corners) in triangles.iter().enumerate() {
        for corner in 0..3 {
            let [a, b] = [corners[corner], corners[(corner + 1) % 3]];
            sides.push(([a.min(b), a.max(b)], triangle, corner));
        }
    }
    sides.sort_unstable();
    let (mut edges, mut hinges) = (Vec::new(), Vec::new());
    for same in sides.chunk_by(|a, b| a.0 == b.0) {
        let ends = same[0].0;
        if same.len() > 2 {
            return Err(SheetError::Branching { ends, triangles: same.iter().map(|side| side.1).collect() });
        }
        let (mut lengths_m, mut grains, mut area_m2) = (0.0, 0.0, 0.0);
        for &(_, triangle, corner) in same {
            let along_m = flat_m[triangle][(corner + 1) % 3] - flat_m[triangle][corner];
            let (weft, warp) = (along_m.x * along_m.x, along_m.y * along_m.y);
            lengths_m += (weft + warp).sqrt();
            grains += (warp - weft) / (warp + weft);
            area_m2 += 0.5 * doubled_area(&flat_m[triangle]);
        }
        let sides = same.len() as f64;
        let rest_m = lengths_m / sides;
        let width_per_length_squared = area_m2 / (rest_m * rest_m * rest_m);
        edges.push(Edge { ends, rest_m, grain: grains / sides, width_per_length_squared });
        if let &[(_, first, a), (_, second, b)] = same {
            let outer = [triangles[first][(a + 2) % 3], triangles[second][(b + 2) % 3]];
            hinges.push(Hinge { edge: ends, outer, rest_m });
        }
    }
    Ok((edges, hinges))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn grid(rows: usize, columns: usize) -> Grid {
        Grid { rows, columns, spacing_m: 0.1, corner_m: DVec3::ZERO, weft: DVec3::X, warp: DVec3::Y }
    }

    #[test]
    fn a_grid_has_the_edges_areas_and_grain_of_its_squares() {
        let sheet = Sheet::from_grid(&grid(3, 4)).unwrap();
        // 3 rows of 3, 4 columns of 2, 6 diagonals; all but the 10 of the border are shared.
        assert_eq!((sheet.edges().len(), sheet.hinges().len(), sheet.triangles().len()), (23, 13, 12));
        assert!((sheet.area_m2() - 0.06).abs() < 1e-15);
        for edge in sheet.edges() {
            let [a, b] = edge.ends.map(|end| sheet.positions_m()[end as usize]);
            assert!((edge.rest_m - (b - a).length()).abs() < 1e-15);
            let wanted = if a.y == b.y {
                -1.0
            } else if a.x == b.x {
                1.0
            } else {
                0.0
            };
            assert!((edge.grain - wanted).abs() < 1e-12, "{edge:?}");
        }
        // An inner edge along the warp stands for 10 cm of cloth, one of the border for half.
        let width_m = |ends: [u32; 2]| {
            let edge = sheet.edges().iter().find(|edge| edge.ends == ends).unwrap();
            edge.width_per_length_squared * edge.rest_m * edge.rest_m
        };
        assert!((width_m([1, 5]) - 0.1).abs() < 1e-12 && (width_m([0, 4]) - 0.05).abs() < 1e-12);
        for (i, hinge) in sheet.hinges().iter().enumerate() {
            assert!(sheet.hinges_at(hinge.outer[1] as usize).contains(&(4 * i as u32 + 3)));
        }
    }

    const SQUARE: [DVec3; 4] = [DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::new(1.0, 1.0, 0.0)];

    fn uvs(triangles: &[[u32; 3]]) -> Vec<[DVec2; 3]> {
        triangles.iter().map(|corners| corners.map(|v| SQUARE[v as usize % 4].truncate() * 50.0)).collect()
    }

    fn mesh<'a>(positions_m: &'a [DVec3], triangles: &'a [[u32; 3]], uv: &'a [[DVec2; 3]]) -> PatternMesh<'a> {
        PatternMesh { positions_m, triangles, corners_uv: uv, metres_per_uv: 0.01, welds: &[] }
    }

    #[test]
    fn lengths_and_grain_are_those_of_the_pattern_not_of_space() {
        let triangles = [[0, 1, 2], [1, 3, 2]];
        let uv = uvs(&triangles);
        let sheet = Sheet::from_pattern(&mesh(&SQUARE, &triangles, &uv)).unwrap();
        assert!((sheet.edges()[0].rest_m - 0.5).abs() < 1e-15 && sheet.edges()[0].grain == -1.0);
        assert!((sheet.area_m2() - 0.25).abs() < 1e-15);
        assert_eq!(sheet.hinges(), [Hinge { edge: [1, 2], outer: [0, 3], rest_m: 0.5 * 2f64.sqrt() }]);
    }

    #[test]
    fn welds_make_one_particle_of_two_vertices() {
        // Two squares side by side, a gap of 0.2 between them.
        let positions: Vec<DVec3> = SQUARE.iter().copied().chain(SQUARE.map(|p| p + DVec3::X * 1.2)).collect();
        let triangles = [[0, 1, 2], [1, 3, 2], [4, 5, 6], [5, 7, 6]];
        let uv = uvs(&triangles);
        let welds = [[1, 4], [6, 3]];
        let sheet = Sheet::from_pattern(&PatternMesh { welds: &welds, ..mesh(&positions, &triangles, &uv) }).unwrap();
        assert_eq!(sheet.particle_of_vertex(), [0, 1, 2, 3, 1, 4, 3, 5]);
        assert!((sheet.positions_m()[1] - DVec3::X * 1.1).length() < 1e-15);
        assert_eq!(sheet.hinges().len(), 3);
        assert!(sheet.hinges().iter().any(|hinge| hinge.edge == [1, 3]));
    }

    #[test]
    fn what_is_wrong_with_a_mesh_is_said() {
        let good = [[0, 1, 2], [1, 3, 2]];
        let error = |positions: &[DVec3], triangles: &[[u32; 3]], uv: &[[DVec2; 3]]| {
            Sheet::from_pattern(&mesh(positions, triangles, uv)).unwrap_err().to_string()
        };
        let mut positions = SQUARE;
        positions[2].y = f64::NAN;
        assert!(error(&positions, &good, &uvs(&good)).starts_with("position 2 is [0, NaN, 0], must be finite"));
        assert_eq!(error(&SQUARE, &[[0, 1, 2], [1, 9, 2]], &uvs(&good)), "triangle 1 names vertex 9 of 4");
        assert_eq!(error(&SQUARE, &good, &uvs(&good)[..1]), "2 triangles but pattern coordinates for 1");
        let thin = [[0, 1, 2], [1, 3, 3]];
        assert_eq!(error(&SQUARE, &thin, &uvs(&good)), "1 triangles have no area in space: numbers [1]");
        assert_eq!(error(&SQUARE, &good, &uvs(&thin)), "1 triangles have no area in the pattern: numbers [1]");
        let five = [SQUARE[0], SQUARE[1], SQUARE[2], SQUARE[3], DVec3::Z];
        assert_eq!(error(&five, &good, &uvs(&good)), "vertex 4 belongs to no triangle");
        let three = [[0, 1, 2], [1, 3, 2], [1, 2, 4]];
        let uv = [uvs(&good), uvs(&good[..1])].concat();
        let wanted = "3 triangles share the edge of vertices 1 and 2: numbers [0, 1, 2]; cloth has at most 2";
        assert_eq!(error(&five, &three, &uv), wanted);
        assert_eq!(error(&SQUARE[..2], &[], &[]), format!("2 particles, must be 3 to {MOST_PARTICLES}"));
        for bad in [grid(1, 5), grid(usize::MAX, 3), Grid { spacing_m: 0.0, ..grid(3, 3) }] {
            assert!(Sheet::from_grid(&bad).is_err(), "{bad:?}");
        }
        assert!(Sheet::from_grid(&Grid { weft: DVec3::X * 2.0, ..grid(3, 3) }).is_err());
        let mut sheet = Sheet::from_grid(&grid(2, 2)).unwrap();
        assert_eq!(sheet.sew(&[[0, 1], [2, 4]]).unwrap_err().to_string(), "pair 1 names vertex 4 of 4");
        assert!(sheet.pin(4, DVec3::ZERO).is_err() && sheet.pin(0, DVec3::NAN).is_err() && sheet.unpin(4).is_err());
        let attachment = Attachment { particle: 0, place_m: DVec3::ZERO, stiffness_n_per_m: -1.0 };
        assert!(sheet.attach(&[attachment]).is_err() && sheet.pairs().is_empty());
    }
}
