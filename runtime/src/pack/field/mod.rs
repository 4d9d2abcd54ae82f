//! The codec of vector fields over the cloth, such as the deltas of targets: whole steps per vertex and field. The decoder;
//! beside it the encoder, and the choice of the steps. Knows the mesh and numbers, not what the fields are for.
//!
//! A field is smooth over the cloth, and it resembles other fields. So every vector is predicted, and only the difference
//! is stored:
//!
//! 1. **Along the mesh.** The vertices decoded before that lie at most two edges away give the value that a plane through
//!    them has at the vertex: least squares weighted by the inverse fourth power of the distance in the base. The weights
//!    follow from the base's positions, so they cost no bytes, and they are the same for all fields.
//! 2. **Across fields.** A patch of a field may name an earlier field: a share (quarters) of what that field had beyond
//!    its own prediction at this vertex is added.
//!
//! Patches are runs of at most [`RUN`] vertices of one segment. Per patch and field the differences of each coordinate are
//! one run of the [entropy coder](super::rans).
//!
//! All arithmetic is in single precision in the order written here, without fused operations, so that every machine
//! decodes the same bits. Numbers of a hostile pack can give any steps, never a panic.

use super::ContentProblem;
use super::codec::Reader;
use super::rans::{self, RUN};
use glam::Vec3;
use std::ops::Range;

#[cfg(feature = "write")]
use crate::arrays::Segment;

#[cfg(feature = "write")]
mod choice;
#[cfg(feature = "write")]
mod encode;

#[cfg(feature = "write")]
pub use choice::quantise;
#[cfg(feature = "write")]
pub(super) use encode::write;

/// Neighbours of a vertex that stand before it and are remembered.
const LOWER: usize = 8;
/// Vertices from which one is predicted.
const STENCIL: usize = 8;
/// What keeps the plane from tilting where the vertices lie in line, in units of their mean squared distance.
const RIDGE: f32 = 5e-4;
/// Keeps weights finite where vertices coincide; likewise.
const NEAR: f32 = 1e-6;

/// Per vertex the neighbours that stand before it in the pack's order.
pub(super) struct Lower {
    counts: Vec<u8>,
    vertices: Vec<[u32; LOWER]>,
}

impl Lower {
    /// Of triangles that may name any numbers; those that name none of the `unique` vertices or their twins are left out.
    pub(super) fn new(unique: usize, twin_of: &[u32], triangles: &[[u32; 3]]) -> Lower {
        let mut lower = Lower { counts: vec![0; unique], vertices: vec![[0; LOWER]; unique] };
        let original = |vertex: u32| match (vertex as usize).checked_sub(unique) {
            Some(twin) => twin_of.get(twin).copied().unwrap_or(u32::MAX),
            None => vertex,
        };
        for corners in triangles {
            let [a, b, c] = corners.map(original);
            for (one, other) in [(a, b), (b, c), (c, a)] {
                let (low, high) = (one.min(other), one.max(other));
                let Some(count) = lower.counts.get_mut(high as usize).filter(|_| low < high) else { continue };
                let known = &mut lower.vertices[high as usize];
                let length = usize::from(*count);
                if length < LOWER && !known[..length].contains(&low) {
                    known[length] = low;
                    *count += 1;
                }
            }
        }
        lower
    }

    fn of(&self, vertex: u32) -> &[u32] {
        &self.vertices[vertex as usize][..usize::from(self.counts[vertex as usize])]
    }
}

/// From which vertices one is predicted, and by which weights.
#[derive(Clone, Copy)]
struct Stencil {
    count: usize,
    vertices: [u32; STENCIL],
    weights: [f32; STENCIL],
}

impl Stencil {
    /// Its neighbours before it and theirs; where there is none, the vertex before it in the pack.
    fn new(vertex: u32, lower: &Lower, positions_m: &[Vec3]) -> Stencil {
        let mut stencil = Stencil { count: 0, vertices: [0; STENCIL], weights: [0.0; STENCIL] };
        let mut add = |candidate: u32| {
            if stencil.count < STENCIL && !stencil.vertices[..stencil.count].contains(&candidate) {
                stencil.vertices[stencil.count] = candidate;
                stencil.count += 1;
            }
        };
        let near = lower.of(vertex);
        near.iter().for_each(|&neighbour| add(neighbour));
        near.iter().flat_map(|&neighbour| lower.of(neighbour)).for_each(|&second| add(second));
        if near.is_empty() && vertex > 0 {
            add(vertex - 1);
        }
        stencil.weigh(positions_m[vertex as usize], positions_m);
        stencil
    }

    /// The value at the vertex of the plane that fits the others best.
    fn weigh(&mut self, center_m: Vec3, positions_m: &[Vec3]) {
        let count = self.count;
        let mut apart = [Vec3::ZERO; STENCIL];
        let mut squared = [0.0; STENCIL];
        let mut sum = 0.0;
        for k in 0..count {
            apart[k] = positions_m[self.vertices[k] as usize] - center_m;
            squared[k] = apart[k].length_squared();
            sum += squared[k];
        }
        let scale = count as f32 / (sum + f32::MIN_POSITIVE);
        let root = scale.sqrt();
        let (mut total, mut mean) = (0.0, Vec3::ZERO);
        for k in 0..count {
            apart[k] *= root;
            let near = squared[k] * scale + NEAR;
            self.weights[k] = 1.0 / (near * near);
            total += self.weights[k];
            mean += apart[k] * self.weights[k];
        }
        let part = 1.0 / total;
        mean *= part;
        // Covariance: xx, yy, zz, xy, xz, yz.
        let (mut straight, mut mixed) = (Vec3::splat(RIDGE), Vec3::ZERO);
        for (apart, weight) in apart.iter().zip(&self.weights).take(count) {
            let from_mean = apart - mean;
            let weighted = from_mean * (weight * part);
            straight += weighted * from_mean;
            mixed += Vec3::new(weighted.x * from_mean.y, weighted.x * from_mean.z, weighted.y * from_mean.z);
        }
        let [xx, yy, zz] = straight.to_array();
        let [xy, xz, yz] = mixed.to_array();
        let adjugate_x = Vec3::new(yy * zz - yz * yz, xz * yz - xy * zz, xy * yz - xz * yy);
        let adjugate_y = Vec3::new(adjugate_x.y, xx * zz - xz * xz, xy * xz - xx * yz);
        let adjugate_z = Vec3::new(adjugate_x.z, adjugate_y.z, xx * yy - xy * xy);
        let determinant = xx * adjugate_x.x + xy * adjugate_x.y + xz * adjugate_x.z;
        let slope = (adjugate_x * mean.x + adjugate_y * mean.y + adjugate_z * mean.z) / determinant;
        for (apart, weight) in apart.iter().zip(&mut self.weights).take(count) {
            *weight *= part * (1.0 - (apart - mean).dot(slope));
        }
    }

    /// Predicts the vectors of all fields from those at other vertices, of which `quads` stand side by side per vertex.
    fn predict(&self, rows: &[[f32; 4]], quads: usize, along: &mut [[f32; 4]]) {
        let (blocks, rest) = along.as_chunks_mut::<4>();
        let first = 4 * blocks.len();
        for (block, along) in blocks.iter_mut().enumerate() {
            *along = self.sum(rows, quads, 4 * block);
        }
        for (quad, along) in rest.iter_mut().enumerate() {
            [*along] = self.sum(rows, quads, first + quad);
        }
    }

    /// The weighted sum of so few of a row's quads, from the `first` on, that it stays in registers.
    fn sum<const N: usize>(&self, rows: &[[f32; 4]], quads: usize, first: usize) -> [[f32; 4]; N] {
        let mut sums = [[0.0; 4]; N];
        for (&vertex, &weight) in self.vertices.iter().zip(&self.weights).take(self.count) {
            let from = &rows[vertex as usize * quads + first..][..N];
            for quad in 0..N {
                for lane in 0..4 {
                    sums[quad][lane] += weight * from[quad][lane];
                }
            }
        }
        sums
    }
}

/// Adding this leaves no bits for fractions.
const FRACTIONLESS: f32 = 12_582_912.0;

/// Rounds to the nearest whole number, halves to even; beyond 2²² in some way that is the same everywhere.
fn round(value: f32) -> f32 {
    (value + FRACTIONLESS) - FRACTIONLESS
}

/// A whole number of 16 bits; others wrap.
fn whole(value: f32) -> i16 {
    (value + FRACTIONLESS).to_bits() as i16
}

/// Rows hold the vectors of all fields side by side, and are filled up to whole vectors of four numbers.
fn quads(field_count: usize) -> usize {
    (3 * field_count).div_ceil(4)
}

/// Per segment its vertex count and the fields that move it, ascending, from what each field moves.
#[cfg(feature = "write")]
#[must_use]
pub fn moved<'a>(segments: &[Segment], fields: impl Iterator<Item = &'a [u16]>) -> Vec<(usize, Vec<u16>)> {
    let mut moved: Vec<(usize, Vec<u16>)> =
        segments.iter().map(|segment| (segment.vertex_count as usize, Vec::new())).collect();
    for (number, segments) in fields.enumerate() {
        segments.iter().for_each(|&segment| moved[usize::from(segment)].1.push(number as u16));
    }
    moved
}

/// A run of vertices of one segment, and the fields that are not zero there.
struct Patch<'a> {
    vertices: Range<usize>,
    fields: &'a [u16],
}

/// The patches of segments, of which each has a vertex count and the fields that move it, ascending.
fn patches<'a>(segments: &'a [(usize, Vec<u16>)]) -> impl Iterator<Item = Patch<'a>> {
    let firsts = segments.iter().scan(0, |end, (count, _)| {
        let first = *end;
        *end += count;
        Some(first)
    });
    segments.iter().zip(firsts).filter(|((_, fields), _)| !fields.is_empty()).flat_map(|((count, fields), first)| {
        let begins = (first..first + count).step_by(RUN);
        begins.map(move |begin| Patch { vertices: begin..(begin + RUN).min(first + count), fields })
    })
}

/// Appends what the rows hold of a patch to the steps of its fields.
fn append(patch: &Patch<'_>, rows: &[[f32; 4]], quads: usize, steps: &mut [Vec<[i16; 3]>]) {
    for field in patch.fields.iter().map(|&field| usize::from(field)) {
        let values = rows[patch.vertices.start * quads..patch.vertices.end * quads].chunks_exact(quads);
        steps[field].extend(values.map(|row| row.as_flattened().as_chunks::<3>().0[field].map(whole)));
    }
}

/// Of an earlier field: number of that field, and which share of its difference is added.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Reference {
    field: usize,
    share: f32,
}

impl Reference {
    /// 0 for none.
    fn from_number(number: u32) -> Option<Reference> {
        let number = number.checked_sub(1)?;
        Some(Reference { field: (number / 4) as usize, share: (number % 4 + 1) as f32 / 4.0 })
    }
}

/// Steps of the fields over all vertices that `segments` cover, from what [`write`] wrote. `positions_m` and `lower` are
/// of those vertices.
pub(super) fn read(
    from: &mut Reader<'_>,
    field_count: usize,
    segments: &[(usize, Vec<u16>)],
    lower: &Lower,
    positions_m: &[Vec3],
) -> Result<Vec<Vec<[i16; 3]>>, ContentProblem> {
    let vertex_count = segments.iter().fold(0usize, |sum, (count, _)| sum.saturating_add(*count));
    if vertex_count != positions_m.len() {
        return Err(ContentProblem::Codes);
    }
    from.allow(vertex_count.saturating_mul(6 * field_count))?;
    let mut references = rans::Decoder::read(from, usize::MAX)?;
    let mut differences = rans::Decoder::read(from, usize::MAX)?;
    let mut lengths = vec![0; field_count];
    for (count, fields) in segments {
        fields.iter().for_each(|&field| lengths[usize::from(field)] += count);
    }
    let mut steps: Vec<Vec<[i16; 3]>> = lengths.into_iter().map(Vec::with_capacity).collect();

    let quads = quads(field_count);
    let width = 4 * quads;
    let mut rows = vec![[0.0f32; 4]; vertex_count * quads];
    let mut along = vec![[0.0f32; 4]; quads];
    let mut own = vec![0u32; field_count];
    let mut reference_class = 0;
    let mut classes = vec![0u8; 3 * field_count];
    let mut changes = vec![0u32; field_count];
    let mut terms = Vec::with_capacity(field_count);
    let mut numbers = [0u32; RUN];
    for Patch { vertices, fields } in patches(segments) {
        let changes = &mut changes[..fields.len()];
        for changes in changes.chunks_mut(RUN) {
            references.run(&mut reference_class, changes)?;
        }
        terms.clear();
        for (field, &change) in fields.iter().map(|&field| usize::from(field)).zip(&*changes) {
            if change > 0 {
                own[field] = change - 1;
            }
            terms.push(match Reference::from_number(own[field]) {
                None => (field, Reference { field, share: 0.0 }),
                Some(reference) if reference.field < field => (field, reference),
                Some(_) => return Err(ContentProblem::Codes),
            });
        }
        // The differences first, where the values will stand.
        for lane in fields.iter().flat_map(|&field| 3 * usize::from(field)..3 * usize::from(field) + 3) {
            let numbers = &mut numbers[..vertices.len()];
            differences.run(&mut classes[lane], numbers)?;
            let patch = rows.as_flattened_mut()[vertices.start * width..].chunks_exact_mut(width);
            for (row, &number) in patch.zip(&*numbers) {
                row[lane] = ((number >> 1) ^ (number & 1).wrapping_neg()) as i32 as f32;
            }
        }
        for vertex in vertices.clone() {
            let (before, row) = rows.split_at_mut(vertex * quads);
            Stencil::new(vertex as u32, lower, positions_m).predict(before, quads, &mut along);
            let (row, _) = row[..quads].as_flattened_mut().as_chunks_mut::<3>();
            let (along, _) = along.as_flattened().as_chunks::<3>();
            for &(field, Reference { field: other, share }) in &terms {
                for i in 0..3 {
                    row[field][i] += round(along[field][i] + share * (row[other][i] - along[other][i]));
                }
            }
        }
        append(&Patch { vertices, fields }, &rows, quads, &mut steps);
    }
    references.finish()?;
    differences.finish()?;
    Ok(steps)
}
