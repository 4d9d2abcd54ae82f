//! Writes fields for the decoder, and finds for every patch what predicts it best.

use super::*;
use crate::pack::codec::Writer;

/// A reference must save so much to be worth naming: six bits, as [`cost`] counts them.
const NAMING: u32 = 6 << 15;

/// So many earlier fields are tried as references, the latest ones; more would take time, not bytes.
const TRIED: usize = 64;

/// Which fields move which vertices, and what predicts those along the mesh.
pub(super) struct Layout<'a> {
    /// Vertex counts, and the fields that move them.
    pub(super) segments: &'a [(usize, Vec<u16>)],
    /// One per vertex.
    pub(super) stencils: Vec<Stencil>,
    pub(super) field_count: usize,
}

impl<'a> Layout<'a> {
    pub(super) fn new(
        segments: &'a [(usize, Vec<u16>)],
        field_count: usize,
        lower: &Lower,
        positions_m: &[Vec3],
    ) -> Layout<'a> {
        let stencil = |vertex: usize| Stencil::new(vertex as u32, lower, positions_m);
        Layout { segments, stencils: (0..positions_m.len()).map(stencil).collect(), field_count }
    }

    /// Vectors of a row.
    pub(super) fn quads(&self) -> usize {
        quads(self.field_count)
    }

    /// All fields' values of a vertex side by side, vertex after vertex.
    pub(super) fn rows<T: Copy + Into<f32>>(&self, fields: &[&[[T; 3]]]) -> Vec<[f32; 4]> {
        let width = 4 * self.quads();
        let mut rows = vec![[0.0; 4]; self.stencils.len() * self.quads()];
        let values = rows.as_flattened_mut();
        let mut rest: Vec<_> = fields.iter().map(|field| field.iter()).collect();
        for Patch { vertices, fields } in patches(self.segments) {
            for &field in fields {
                let rest = &mut rest[usize::from(field)];
                for (vertex, steps) in vertices.clone().zip(rest) {
                    let lane = vertex * width + 3 * usize::from(field);
                    values[lane..lane + 3].copy_from_slice(&steps.map(T::into));
                }
            }
        }
        rows
    }

    /// What the prediction along the mesh leaves of rows.
    pub(super) fn left(&self, rows: &[[f32; 4]]) -> Vec<[f32; 4]> {
        let mut left = vec![[0.0; 4]; rows.len()];
        let quads = self.quads().max(1);
        for ((stencil, left), row) in self.stencils.iter().zip(left.chunks_mut(quads)).zip(rows.chunks(quads)) {
            stencil.predict(rows, quads, left);
            left.as_flattened_mut().iter_mut().zip(row.as_flattened()).for_each(|(left, value)| *left = value - *left);
        }
        left
    }

    /// For every patch and field of it the reference that saves most of what is [`left`](Layout::left), as its number.
    pub(super) fn references(&self, left: &[[f32; 4]]) -> Vec<Vec<u32>> {
        let width = 4 * self.quads();
        let left = left.as_flattened();
        let mut own = vec![0u32; self.field_count];
        // A patch coordinate by coordinate; those that it has not cost nothing.
        let mut columns = vec![[0.0; RUN]; 3 * self.field_count];
        let of_patch = |Patch { vertices, fields }: Patch<'_>| {
            for &field in fields {
                for (i, column) in columns[3 * usize::from(field)..][..3].iter_mut().enumerate() {
                    let lane = 3 * usize::from(field) + i;
                    column.fill(0.0);
                    column.iter_mut().zip(vertices.clone()).for_each(|(value, v)| *value = left[v * width + lane]);
                }
            }
            let columns = |field: u16| &columns[3 * usize::from(field)..][..3];
            let best = |&field: &u16| {
                let naming = |number: u32| if number == own[usize::from(field)] { 0 } else { NAMING };
                let own: u32 = columns(field).as_flattened().iter().map(|left| cost(*left)).sum();
                let (mut best, mut least) = (0, own + naming(0));
                let earlier = &fields[..fields.partition_point(|other| *other < field)];
                for &other in &earlier[earlier.len().saturating_sub(TRIED)..] {
                    for share in 0..4 {
                        let number = 1 + 4 * u32::from(other) + share;
                        let Some(Reference { share, .. }) = Reference::from_number(number) else { continue };
                        let both = columns(field).as_flattened().iter().zip(columns(other).as_flattened());
                        let with: u32 = both.map(|(own, other)| cost(own - share * other)).sum();
                        if with + naming(number) < least {
                            (best, least) = (number, with + naming(number));
                        }
                    }
                }
                best
            };
            let best: Vec<u32> = fields.iter().map(best).collect();
            for (&field, &best) in fields.iter().zip(&best) {
                own[usize::from(field)] = best;
            }
            best
        };
        patches(self.segments).map(of_patch).collect()
    }
}

/// About what a difference takes, in 1/32768 bits: the logarithm to base two of 1 and its size, straight between powers of two,
/// as the bits of floating-point numbers have it.
pub(super) fn cost(difference: f32) -> u32 {
    ((1.0 + difference.abs()).to_bits() - 1f32.to_bits()) >> 8
}

/// Writes fields for [`read`].
pub(in super::super) fn write(
    fields: &[&[[i16; 3]]],
    segments: &[(usize, Vec<u16>)],
    lower: &Lower,
    positions_m: &[Vec3],
    to: &mut Writer,
) {
    let layout = Layout::new(segments, fields.len(), lower, positions_m);
    let rows = layout.rows(fields);
    let quads = layout.quads();
    let references = layout.references(&layout.left(&rows));
    let mut own = vec![0u32; fields.len()];
    let mut changes: Vec<Vec<u32>> = Vec::new();
    let mut differences: Vec<(usize, Vec<u32>)> = Vec::new();
    let mut along = vec![[0.0; 4]; quads];
    for (patch, references) in patches(segments).zip(&references) {
        let change = |(&field, &reference): (&u16, &u32)| {
            let before = std::mem::replace(&mut own[usize::from(field)], reference);
            if before == reference { 0 } else { 1 + reference }
        };
        changes.push(patch.fields.iter().zip(references).map(change).collect());
        let mut runs = vec![Vec::with_capacity(RUN); 3 * patch.fields.len()];
        for vertex in patch.vertices {
            let row = rows[vertex * quads..][..quads].as_flattened();
            layout.stencils[vertex].predict(&rows, quads, &mut along);
            for (place, (&field, &reference)) in patch.fields.iter().zip(references).enumerate() {
                let predicted = predicted(3 * usize::from(field), reference, row, along.as_flattened());
                for i in 0..3 {
                    let difference = row[3 * usize::from(field) + i] - round(predicted[i]);
                    runs[3 * place + i].push(zigzag(difference as i32));
                }
            }
        }
        let lane = |place: usize| 3 * usize::from(patch.fields[place / 3]) + place % 3;
        differences.extend(runs.into_iter().enumerate().map(|(place, run)| (lane(place), run)));
    }
    rans::encode(changes.iter().flat_map(|changes| changes.chunks(RUN)).map(|run| (0, run)), to);
    rans::encode(differences.iter().map(|(lane, run)| (*lane, run.as_slice())), to);
}

/// What [`read`] predicts.
fn predicted(lane: usize, reference: u32, row: &[f32], along: &[f32]) -> [f32; 3] {
    let mut predicted = [along[lane], along[lane + 1], along[lane + 2]];
    if let Some(Reference { field, share }) = Reference::from_number(reference) {
        for i in 0..3 {
            predicted[i] += share * (row[3 * field + i] - along[3 * field + i]);
        }
    }
    predicted
}

fn zigzag(signed: i32) -> u32 {
    ((signed << 1) ^ (signed >> 31)) as u32
}
