//! Step 1 of a frame: the masked blend in the base's unposed space. Knows deltas and rates, no pose.

use super::{BLOCK, FLOATS, Scratch};
use crate::arrays::{GarmentData, Segment, limits};
use crate::garment::Garment;
use crate::plan::Piece;
use crate::pose_blend::Rates;
use pulp::{Arch, Simd, WithSimd};
use std::ops::Range;

/// Step 1: base plus masked, rated deltas, unposed, into the scratch.
///
/// # Panics
/// When `rates` or `scratch` was made for a garment of another shape.
pub fn blend(garment: &Garment, rates: &Rates, scratch: &mut Scratch) {
    rates.assert_fits(garment.data());
    assert_eq!(scratch.blended_m.len(), 3 * garment.unique_count(), "scratch of another garment");
    Arch::new().dispatch(Blend { garment, rates, blended_m: &mut scratch.blended_m });
}

pub(super) struct Blend<'a> {
    pub(super) garment: &'a Garment,
    pub(super) rates: &'a Rates,
    pub(super) blended_m: &'a mut [f32],
}

impl WithSimd for Blend<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        blend_segments(self.garment, self.rates, self.blended_m);
    }
}

#[inline(always)]
fn blend_segments(garment: &Garment, rates: &Rates, mut blended_m: &mut [f32]) {
    let data = garment.data();
    let mut base_m: &[f32] = bytemuck::cast_slice(&data.mesh.positions_m);
    let mut masks = garment.plan().masks.as_slice();
    for (segment, parts) in data.segments.iter().zip(&garment.plan().segments) {
        let floats = 3 * segment.vertex_count as usize;
        let (of_segment, rest) = blended_m.split_at_mut(floats);
        blended_m = rest;
        let base_of_segment = &base_m[..floats];
        base_m = &base_m[floats..];
        let of_segment_masks = &masks[..3 * segment.masks.len()];
        masks = &masks[of_segment_masks.len()..];

        of_segment.copy_from_slice(base_of_segment);
        for part in parts {
            let shares = Shares::of(segment, &part.columns, rates);
            let rates_of = |first: u8| rates.driver(usize::from(segment.drivers[usize::from(first)]));
            for (block, sums_m) in of_segment.chunks_mut(FLOATS).enumerate() {
                let rows = block * BLOCK..block * BLOCK + sums_m.len() / 3;
                if let (true, [only]) = (part.is_whole, shares.firsts()) {
                    in_fours(data, &part.pieces, &rows, [rates_of(*only)], |four| add_to_one(four, sums_m));
                    continue;
                }
                for pair in shares.firsts().chunks(2) {
                    let mut moves_m = [[0.0; FLOATS]; 2];
                    let [a_m, b_m] = &mut moves_m;
                    match *pair {
                        [a, b] => {
                            let rates = [rates_of(a), rates_of(b)];
                            in_fours(data, &part.pieces, &rows, rates, |four| add_to_two(four, a_m, b_m));
                        }
                        [a, ..] => in_fours(data, &part.pieces, &rows, [rates_of(a)], |four| add_to_one(four, a_m)),
                        [] => unreachable!("chunks are not empty"),
                    }
                    for (first, moves_m) in pair.iter().zip(&moves_m) {
                        for column in shares.columns(*first) {
                            let masks = &of_segment_masks[column * floats + 3 * rows.start..][..sums_m.len()];
                            for ((sum_m, &mask), move_m) in sums_m.iter_mut().zip(masks).zip(moves_m) {
                                *sum_m += f32::from(mask) * (1.0 / 65535.0) * move_m;
                            }
                        }
                    }
                }
            }
        }
    }
}

/// Which of a layer's drivers in a segment have the same rates, for example because one group sets them: each delta is
/// touched once for all of them.
struct Shares<'a> {
    /// Columns of the layer's drivers.
    columns: &'a [u8],
    /// For each of them the first one with the same rates.
    first: [u8; limits::DRIVERS],
    /// The columns that are such firsts.
    firsts: [u8; limits::DRIVERS],
    count: usize,
}

impl Shares<'_> {
    fn of<'a>(segment: &Segment, columns: &'a [u8], rates: &Rates) -> Shares<'a> {
        let mut shares = Shares { columns, first: [0; limits::DRIVERS], firsts: [0; limits::DRIVERS], count: 0 };
        let rates_of = |column: u8| rates.driver(usize::from(segment.drivers[usize::from(column)]));
        for (place, &column) in columns.iter().enumerate() {
            let known = shares.firsts().iter().copied().find(|&first| rates_of(first) == rates_of(column));
            let first = known.unwrap_or(column);
            if first == column {
                shares.firsts[shares.count] = column;
                shares.count += 1;
            }
            shares.first[place] = first;
        }
        shares
    }

    fn firsts(&self) -> &[u8] {
        &self.firsts[..self.count]
    }

    /// The columns of the drivers like this first one.
    fn columns(&self, first: u8) -> impl Iterator<Item = usize> {
        let alike = self.columns.iter().zip(&self.first).filter(move |(_, other)| **other == first);
        alike.map(|(&column, _)| usize::from(column))
    }
}

/// A target's deltas of some vertices, with metres per unit for each of `D` sums.
#[derive(Clone, Copy)]
struct Term<'a, const D: usize> {
    deltas: &'a [i16],
    rates_m: [f32; D],
}

/// Hands out the active targets of a segment four at a time, so that the sums are loaded and stored once for the four;
/// what is missing to four counts 0.
#[inline(always)]
fn in_fours<const D: usize>(
    data: &GarmentData,
    pieces: &[Piece],
    rows: &Range<usize>,
    rates: [&[f32]; D],
    mut add: impl FnMut(&[Term<D>; 4]),
) {
    let mut active = pieces.iter().filter_map(|piece| {
        let target = &data.targets[usize::from(piece.target)];
        let rates_m = rates.map(|rates| rates[usize::from(piece.target)] * target.step_m);
        let start = piece.start as usize;
        let deltas = target.deltas[start + rows.start..start + rows.end].as_flattened();
        (rates_m != [0.0; D]).then_some(Term { deltas, rates_m })
    });
    while let Some(first) = active.next() {
        let none = Term { rates_m: [0.0; D], ..first };
        let mut next = || active.next().unwrap_or(none);
        add(&[first, next(), next(), next()]);
    }
}

#[inline(always)]
fn add_to_one([a, b, c, d]: &[Term<1>; 4], sums_m: &mut [f32]) {
    let [[by_a], [by_b], [by_c], [by_d]] = [a.rates_m, b.rates_m, c.rates_m, d.rates_m];
    let deltas = a.deltas.iter().zip(b.deltas).zip(c.deltas.iter().zip(d.deltas));
    for (sum_m, ((&a, &b), (&c, &d))) in sums_m.iter_mut().zip(deltas) {
        let [a, b, c, d] = [f32::from(a), f32::from(b), f32::from(c), f32::from(d)];
        *sum_m += (by_a * a + by_b * b) + (by_c * c + by_d * d);
    }
}

#[inline(always)]
fn add_to_two([a, b, c, d]: &[Term<2>; 4], first_m: &mut [f32], second_m: &mut [f32]) {
    let [by_a, by_b, by_c, by_d] = [a.rates_m, b.rates_m, c.rates_m, d.rates_m];
    let deltas = a.deltas.iter().zip(b.deltas).zip(c.deltas.iter().zip(d.deltas));
    for ((first_m, second_m), ((&a, &b), (&c, &d))) in first_m.iter_mut().zip(second_m).zip(deltas) {
        let [a, b, c, d] = [f32::from(a), f32::from(b), f32::from(c), f32::from(d)];
        *first_m += (by_a[0] * a + by_b[0] * b) + (by_c[0] * c + by_d[0] * d);
        *second_m += (by_a[1] * a + by_b[1] * b) + (by_c[1] * c + by_d[1] * d);
    }
}
