//! What packs of version 1 hold in another form than those of today. Only readers: nothing is written like this any more.
//!
//! A column of version 1 stores, per value, its wrapping difference to the value before (the first: to 0), zigzag-coded,
//! and splits these numbers into byte planes: first the lowest byte of all, then the next. Positions and texture
//! coordinates are columns of `f32` bits, deltas columns of 16 bits, one per target and coordinate.

use super::ContentProblem;
use super::codec::Reader;
use crate::arrays::{Segment, Target};

/// The major version.
pub(super) const MAJOR: u16 = 1;
/// The last minor version of it that has sections of its own.
pub(super) const MINOR: u16 = 1;

/// A column of values of `width` bytes each.
pub(super) fn column(from: &mut Reader<'_>, width: usize, count: usize) -> Result<Vec<u32>, ContentProblem> {
    let planes = (0..width).map(|_| from.take(count)).collect::<Result<Vec<_>, _>>()?;
    let mask = u32::MAX >> (32 - 8 * width);
    let mut value = 0u32;
    let decoded = |at: usize| {
        let zigzag = planes.iter().rev().fold(0, |high, plane| high << 8 | u32::from(plane[at]));
        value = value.wrapping_add((zigzag >> 1) ^ (zigzag & 1).wrapping_neg());
        value & mask
    };
    Ok((0..count).map(decoded).collect())
}

/// The deltas of targets whose names, steps and segments have been read.
pub(super) fn read_deltas(
    mut targets: Vec<Target>,
    segments: &[Segment],
    from: &mut Reader<'_>,
) -> Result<Vec<Target>, ContentProblem> {
    for target in &mut targets {
        let mut count = 0usize;
        for &segment in &target.segments {
            let segment = segments.get(usize::from(segment)).ok_or(ContentProblem::Segment(segment))?;
            count = count.saturating_add(segment.vertex_count as usize);
        }
        let [x, y, z] = [column(from, 2, count)?, column(from, 2, count)?, column(from, 2, count)?];
        let steps = |number: u32| number as u16 as i16;
        target.deltas = (0..count).map(|vertex| [x[vertex], y[vertex], z[vertex]].map(steps)).collect();
    }
    Ok(targets)
}
