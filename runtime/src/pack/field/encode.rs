//! Writes fields for the decoder, and finds for every patch what predicts it best.

use super::*;
use crate::pack::codec::Writer;

/// A reference must save so many bits to be worth naming.
const NAMING: f64 = 6.0;

/// Writes fields for [`read`].
pub(in super::super) fn write(
    fields: &[&[[i16; 3]]],
    segments: &[(usize, Vec<u16>)],
    lower: &Lower,
    positions_m: &[Vec3],
    to: &mut Writer,
) {
    let rows = rows(fields, segments);
    let quads = quads(fields.len());
    let references = references(&rows, fields.len(), segments, lower, positions_m);
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
            Stencil::new(vertex as u32, lower, positions_m).predict(&rows, quads, &mut along);
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

/// All fields' values of a vertex side by side, vertex after vertex.
pub(super) fn rows<T: Copy + Into<f32>>(fields: &[&[[T; 3]]], segments: &[(usize, Vec<u16>)]) -> Vec<[f32; 4]> {
    let vertex_count: usize = segments.iter().map(|(count, _)| count).sum();
    let width = 4 * quads(fields.len());
    let mut rows = vec![[0.0; 4]; vertex_count * width / 4];
    let values = rows.as_flattened_mut();
    let mut rest: Vec<_> = fields.iter().map(|field| field.iter()).collect();
    for Patch { vertices, fields } in patches(segments) {
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

/// For every patch and field of it the reference that saves most, as its number.
pub(super) fn references(
    rows: &[[f32; 4]],
    field_count: usize,
    segments: &[(usize, Vec<u16>)],
    lower: &Lower,
    positions_m: &[Vec3],
) -> Vec<Vec<u32>> {
    let quads = quads(field_count);
    let width = 4 * quads;
    let mut own = vec![0u32; field_count];
    let of_patch = |Patch { vertices, fields }: Patch<'_>| {
        // What the prediction along the mesh leaves.
        let mut left = vec![[0.0; 4]; vertices.len() * quads];
        for (vertex, left) in vertices.clone().zip(left.chunks_mut(quads)) {
            Stencil::new(vertex as u32, lower, positions_m).predict(rows, quads, left);
            let row = rows[vertex * quads..].as_flattened();
            left.as_flattened_mut().iter_mut().zip(row).for_each(|(left, value)| *left = value - *left);
        }
        let left = left.as_flattened();
        let bits = |lane: usize, other: usize, share: f32| {
            let mut bits = 0.0;
            for rows in left.chunks(8 * width) {
                let row = |row: &[f32]| {
                    let size = |i: usize| f64::from(1.0 + 2.0 * (row[lane + i] - share * row[other + i]).abs());
                    size(0) * size(1) * size(2)
                };
                bits += libm::log2(rows.chunks(width).map(row).product());
            }
            bits
        };
        let best = |&field: &u16| {
            let lane = 3 * usize::from(field);
            let candidates =
                fields.iter().filter(|other| **other < field).flat_map(|other| (0..4).map(move |share| (other, share)));
            let candidates = candidates.map(|(&other, share)| {
                let number = 1 + 4 * u32::from(other) + share;
                (number, bits(lane, 3 * usize::from(other), (share + 1) as f32 / 4.0))
            });
            let naming = |(number, bits): (u32, f64)| {
                (number, bits + if number == own[usize::from(field)] { 0.0 } else { NAMING })
            };
            let all = std::iter::once((0, bits(lane, lane, 0.0))).chain(candidates).map(naming);

            all.min_by(|(_, a), (_, b)| a.total_cmp(b)).expect("none is a candidate").0
        };
        let best: Vec<u32> = fields.iter().map(best).collect();
        for (&field, &best) in fields.iter().zip(&best) {
            own[usize::from(field)] = best;
        }
        best
    };
    patches(segments).map(of_patch).collect()
}
