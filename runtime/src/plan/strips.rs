//! The order in which a garment's triangles are taken for their normals. Knows triangles only.
//!
//! Cloth is mostly a grid whose rows of vertices lie one after the other. Where two rows form a *strip* of quads, the
//! vertices of neighbouring quads are neighbours in memory, and a vector register takes a run of them. Triangles that
//! form no strip go one by one.

use std::mem::size_of_val;

/// Vertices of a row taken at a time, one in each lane of the vector registers; they bound one quad less.
pub(crate) const LANES: usize = 16;

/// Strips shorter than this are cheaper as single triangles.
pub(crate) const FEWEST_QUADS: usize = 4;

/// The triangles of a garment, ordered for summing their normals.
#[derive(Clone, Debug, Default)]
pub(crate) struct Strips {
    pub(crate) strips: Vec<Strip>,
    /// Triangles in no strip, by places in `loose_vertices`.
    pub(crate) loose: Vec<[u32; 3]>,
    pub(crate) loose_vertices: Vec<u32>,
}

/// Fewer than [`LANES`] quads side by side. Quad `k` has the corners a = `near + k`, b = a + 1, d = `far + k`, c = d + 1,
/// counter-clockwise a, b, c, d.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Strip {
    pub(crate) near: u32,
    pub(crate) far: u32,
    /// Which lanes are quads.
    pub(crate) quads: u16,
    /// Which quads are cut from a to c; the others are cut from b to d.
    pub(crate) cut_from_a: u16,
}

impl Strips {
    /// Of triangles over this many vertices.
    pub(crate) fn new(vertex_count: usize, triangles: &[[u32; 3]]) -> Strips {
        let (quads, loose) = quads(vertex_count, triangles);
        let mut plan = Strips::default();
        let mut place_of = vec![u32::MAX; vertex_count];
        let mut add_loose = |plan: &mut Strips, triangle: [u32; 3]| {
            let corners = triangle.map(|vertex| {
                let place = &mut place_of[vertex as usize];
                if *place == u32::MAX {
                    *place = plan.loose_vertices.len() as u32;
                    plan.loose_vertices.push(vertex);
                }
                *place
            });
            plan.loose.push(corners);
        };
        for run in quads.chunk_by(|one, next| (one.near + 1, one.far + 1) == (next.near, next.far)) {
            if run.len() < FEWEST_QUADS {
                run.iter().flat_map(|quad| quad.triangles).for_each(|t| add_loose(&mut plan, triangles[t as usize]));
                continue;
            }
            plan.strips.extend(run.chunks(LANES - 1).map(|quads| Strip {
                near: quads[0].near,
                far: quads[0].far,
                quads: u16::MAX >> (LANES - quads.len()),
                cut_from_a: quads.iter().rev().fold(0, |bits, quad| bits << 1 | u16::from(quad.is_cut_from_a)),
            }));
        }
        loose.into_iter().for_each(|triangle| add_loose(&mut plan, triangle));
        plan
    }

    /// How many bytes of it a frame reads.
    pub(crate) fn bytes(&self) -> usize {
        size_of_val(self.strips.as_slice())
            + size_of_val(self.loose.as_slice())
            + size_of_val(self.loose_vertices.as_slice())
    }
}

/// Two triangles that share an edge and could stand in a strip.
struct Quad {
    near: u32,
    far: u32,
    is_cut_from_a: bool,
    triangles: [u32; 2],
}

/// The quads among the triangles, neighbours in a strip one after the other, and the triangles left over.
fn quads(vertex_count: usize, triangles: &[[u32; 3]]) -> (Vec<Quad>, Vec<[u32; 3]>) {
    let turns = |[p, q, r]: [u32; 3]| [[p, q, r], [q, r, p], [r, p, q]];
    // By d: the triangle with the edge from c to d, where c = d + 1, and its third corner.
    let mut far_side: Vec<Option<(u32, u32)>> = vec![None; vertex_count];
    for (number, &triangle) in triangles.iter().enumerate() {
        for [c, d, third] in turns(triangle) {
            if c == d + 1 {
                far_side[d as usize] = Some((number as u32, third));
            }
        }
    }
    let mut is_taken = vec![false; triangles.len()];
    let mut quads = Vec::new();
    // Where a triangle could join two others, the one that goes on with the strip.
    let mut step = 0;
    for (number, &triangle) in triangles.iter().enumerate() {
        let number = number as u32;
        let far_side = &far_side;
        let candidates = turns(triangle).into_iter().filter(|[a, b, _]| *b == a + 1).flat_map(|[a, b, third]| {
            [(third.wrapping_sub(1), a, true), (third, b, false)].into_iter().filter_map(
                move |(far, corner, is_cut_from_a)| {
                    let (other, _) = (*far_side.get(far as usize)?).filter(|(_, third)| *third == corner)?;
                    (other != number).then_some(Quad { near: a, far, is_cut_from_a, triangles: [number, other] })
                },
            )
        });
        let is_free = |quad: &Quad| quad.triangles.iter().all(|&t| !is_taken[t as usize]);
        if let Some(quad) = candidates.filter(is_free).min_by_key(|quad| quad.far.wrapping_sub(quad.near) != step) {
            step = quad.far.wrapping_sub(quad.near);
            quad.triangles.iter().for_each(|&t| is_taken[t as usize] = true);
            quads.push(quad);
        }
    }
    quads.sort_unstable_by_key(|quad| (quad.far.wrapping_sub(quad.near), quad.near));
    let left = triangles.iter().zip(is_taken).filter(|(_, is_taken)| !is_taken);
    (quads, left.map(|(&triangle, _)| triangle).collect())
}
