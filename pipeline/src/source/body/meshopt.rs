//! The codecs of EXT_meshopt_compression and KHR_meshopt_compression: compressed bytes to rows of bytes or indices, and the filters behind them.
//! The bytes come from strangers: memory is taken only for what they can fill, and nothing outside them is read. Knows no glTF.

/// What the bytes hold.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Mode {
    /// Rows of any kind.
    Attributes,
    /// Indices, three to a triangle.
    Triangles,
    /// Indices of any kind.
    Indices,
}

/// What rows went through before they were compressed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Filter {
    None,
    /// Directions as places on an octahedron.
    Octahedral,
    /// Rotations without their largest component.
    Quaternion,
    /// Floats as mantissa and exponent.
    Exponential,
    /// Colours as brightness and two differences.
    Colour,
}

/// Widest row, bytes.
const WIDEST: usize = 256;
/// A block has at most so many bytes and rows.
const BLOCK: (usize, usize) = (8192, 256);
/// Deltas are stored in groups of this many.
const GROUP: usize = 16;
/// How many edges and vertices a decoder of triangles remembers.
const REMEMBERED: usize = 16;

const SHORT: &str = "its data end early";
const LONG: &str = "its data go on after the last row";
const MANY: &str = "it has more rows than its data can hold";
const UNKNOWN: &str = "its data begin as no version that is known";

/// The `count` rows of `stride` bytes that `bytes` hold: little-endian indices where they are indices. By Khronos, KHR_meshopt_compression,
/// appendices A and B, which contain those of EXT_meshopt_compression, and the first version of triangles, which only the library knows.
///
/// # Errors
/// Rows that the mode or filter cannot have, more rows than the bytes can hold, or bytes that are damaged.
pub(super) fn decoded(
    bytes: &[u8],
    mode: Mode,
    filter: Filter,
    count: usize,
    stride: usize,
) -> Result<Vec<u8>, &'static str> {
    let is_width = match (mode, filter) {
        (Mode::Attributes, Filter::None | Filter::Exponential) => {
            stride.is_multiple_of(4) && (4..=WIDEST).contains(&stride)
        }
        (Mode::Attributes, Filter::Octahedral | Filter::Colour) => stride == 4 || stride == 8,
        (Mode::Attributes, Filter::Quaternion) => stride == 8,
        (_, Filter::None) => stride == 2 || stride == 4,
        _ => return Err("indices have no filter"),
    };
    if !is_width {
        return Err("its rows are of a width that its mode or filter cannot have");
    }
    if count.checked_mul(stride).is_none() {
        return Err(MANY);
    }
    match mode {
        Mode::Attributes => {
            let mut rows = attributes(bytes, count, stride)?;
            unfilter(&mut rows, filter, stride);
            Ok(rows)
        }
        Mode::Triangles => triangles(bytes, count, stride),
        Mode::Indices => indices(bytes, count, stride),
    }
}

/// The next `count` bytes.
fn take<'a>(data: &mut &'a [u8], count: usize) -> Result<&'a [u8], &'static str> {
    data.split_off(..count).ok_or(SHORT)
}

fn take_byte(data: &mut &[u8]) -> Result<u8, &'static str> {
    data.split_off_first().copied().ok_or(SHORT)
}

/// Data and the last `count` bytes behind them.
fn tailed(data: &[u8], count: usize) -> Result<(&[u8], &[u8]), &'static str> {
    Ok(data.split_at(data.len().checked_sub(count).ok_or(SHORT)?))
}

fn attributes(bytes: &[u8], count: usize, stride: usize) -> Result<Vec<u8>, &'static str> {
    let (&header, bytes) = bytes.split_first().ok_or(SHORT)?;
    let is_first = match header {
        0xa0 => true,
        0xa1 => false,
        _ => return Err(UNKNOWN),
    };
    let channel_count = stride / 4;
    let (tail_length, shortest) = if is_first { (stride, 32) } else { (stride + channel_count, 24) };
    let (mut data, tail) = tailed(bytes, tail_length.max(shortest))?;
    let (baseline, channels) = tail[tail.len() - tail_length..].split_at(stride);
    let rows_of_block = (BLOCK.0 / stride / GROUP * GROUP).min(BLOCK.1);
    // The least that so many rows take: two bits for each group of bytes, later two for each byte of a block.
    let least =
        if is_first { count.div_ceil(4 * GROUP) * stride } else { count.div_ceil(rows_of_block) * channel_count };
    if data.len() < least {
        return Err(MANY);
    }
    let mut previous = baseline.to_vec();
    let mut rows = vec![0; count * stride];
    for block in rows.chunks_mut(rows_of_block * stride) {
        let block_count = block.len() / stride;
        let controls = if is_first { &[] } else { take(&mut data, channel_count)? };
        for byte in 0..stride {
            let control = controls.get(byte / 4).map(|four| four >> (2 * (byte % 4)) & 3);
            let mut deltas = [0; BLOCK.1];
            match control {
                None => grouped(&mut data, &mut deltas[..block_count.next_multiple_of(GROUP)], [0, 2, 4, 8])?,
                Some(0) => grouped(&mut data, &mut deltas[..block_count.next_multiple_of(GROUP)], [0, 1, 2, 4])?,
                Some(1) => grouped(&mut data, &mut deltas[..block_count.next_multiple_of(GROUP)], [1, 2, 4, 8])?,
                Some(2) => {}
                Some(_) => deltas[..block_count].copy_from_slice(take(&mut data, block_count)?),
            }
            block.chunks_mut(stride).zip(deltas).for_each(|(row, delta)| row[byte] = delta);
        }
        for row in block.chunks_mut(stride) {
            let (fours, _) = row.as_chunks_mut::<4>();
            let (before, _) = previous.as_chunks::<4>();
            for (i, (four, before)) in fours.iter_mut().zip(before).enumerate() {
                *four = undelta(*four, *before, channels.get(i).copied().unwrap_or(0))?;
            }
            previous.copy_from_slice(row);
        }
    }
    if data.is_empty() { Ok(rows) } else { Err(LONG) }
}

/// The deltas of one byte of all rows of a block; `widths` are the bits of a delta by the two bits that each group has in front.
fn grouped(data: &mut &[u8], deltas: &mut [u8], widths: [usize; 4]) -> Result<(), &'static str> {
    let kinds = take(data, (deltas.len() / GROUP).div_ceil(4))?;
    for (i, group) in deltas.chunks_mut(GROUP).enumerate() {
        let width = widths[usize::from(kinds[i / 4] >> (2 * (i % 4)) & 3)];
        match width {
            0 => group.fill(0),
            8 => group.copy_from_slice(take(data, GROUP)?),
            _ => {
                let packed = take(data, GROUP * width / 8)?;
                // The largest number says that a whole byte stands behind the group.
                let largest = (1 << width) - 1;
                for (j, delta) in group.iter_mut().enumerate() {
                    let bit = j * width % 8;
                    let shift = if width == 1 { bit } else { 8 - width - bit };
                    let short = packed[j * width / 8] >> shift & largest;
                    *delta = if short == largest { take_byte(data)? } else { short };
                }
            }
        }
    }
    Ok(())
}

/// Four bytes of a row from their deltas and the row before.
fn undelta(delta: [u8; 4], before: [u8; 4], channel: u8) -> Result<[u8; 4], &'static str> {
    match (channel & 15, channel >> 4) {
        (0, 0) => Ok(std::array::from_fn(|i| before[i].wrapping_add(delta[i] >> 1 ^ (delta[i] & 1).wrapping_neg()))),
        (1, 0) => {
            let half = |i: usize| {
                let [delta, before] = [delta, before].map(|four| u16::from_le_bytes([four[i], four[i + 1]]));
                before.wrapping_add(delta >> 1 ^ (delta & 1).wrapping_neg()).to_le_bytes()
            };
            let ([a, b], [c, d]) = (half(0), half(2));
            Ok([a, b, c, d])
        }
        (2, turn) => {
            let turned = u32::from_le_bytes(delta).rotate_right(u32::from(turn));
            Ok((turned ^ u32::from_le_bytes(before)).to_le_bytes())
        }
        _ => Err("its rows are coded in a way that is not known"),
    }
}

/// What was pushed lately.
struct Recent<T> {
    entries: [T; REMEMBERED],
    pushed: usize,
}

impl<T: Copy + Default> Recent<T> {
    fn new() -> Recent<T> {
        Recent { entries: [T::default(); REMEMBERED], pushed: 0 }
    }

    fn push(&mut self, entry: T) {
        self.entries[self.pushed % REMEMBERED] = entry;
        self.pushed += 1;
    }

    /// What was pushed last but `back`.
    fn get(&self, back: usize) -> Result<T, &'static str> {
        let is_known = back < self.pushed.min(REMEMBERED);
        is_known
            .then(|| self.entries[(self.pushed - 1 - back) % REMEMBERED])
            .ok_or("a triangle refers to none before it")
    }
}

/// A number in sevens of bits, lowest first.
fn take_number(data: &mut &[u8]) -> Result<u32, &'static str> {
    let mut number = 0;
    for shift in [0, 7, 14, 21, 28] {
        let byte = take_byte(data)?;
        number |= u32::from(byte & 127) << shift;
        if byte < 128 {
            return Ok(number);
        }
    }
    Err("one of its numbers does not end")
}

/// A number with a sign in its lowest bit, as what is to be added.
const fn signed(number: u32) -> u32 {
    number >> 1 ^ (number & 1).wrapping_neg()
}

/// An index as the difference from the last one that was written so.
fn take_index(data: &mut &[u8], last: &mut u32) -> Result<u32, &'static str> {
    *last = last.wrapping_add(signed(take_number(data)?));
    Ok(*last)
}

/// The first index that no triangle has named yet.
const fn take_next(next: &mut u32) -> u32 {
    let taken = *next;
    *next = taken.wrapping_add(1);
    taken
}

fn triangles(bytes: &[u8], count: usize, stride: usize) -> Result<Vec<u8>, &'static str> {
    let (&header, bytes) = bytes.split_first().ok_or(SHORT)?;
    // Codes from here on name no vertex that was seen lately: 15 alone in the first version, then 13 and 14 besides.
    let first_free = match header {
        0xe0 => 15,
        0xe1 => 13,
        _ => return Err(UNKNOWN),
    };
    if !count.is_multiple_of(3) {
        return Err("its indices are no whole number of triangles");
    }
    let (mut data, table) = tailed(bytes, 16)?;
    let codes = take(&mut data, count / 3)?;
    if table[14..] != [0, 0] || table.iter().any(|pair| pair >> 4 == 15 || pair & 15 == 15) {
        return Err("its table is damaged");
    }
    let mut edges = Recent::<[u32; 2]>::new();
    let mut vertices = Recent::<u32>::new();
    let (mut next, mut last) = (0_u32, 0_u32);
    let mut rows = Vec::with_capacity(count * stride);
    for &code in codes {
        let [high, low] = [code >> 4, code & 15].map(usize::from);
        let triangle = if high < 15 {
            let [a, b] = edges.get(high)?;
            let c = match low {
                0 => take_next(&mut next),
                _ if low < first_free => vertices.get(low)?,
                15 => take_index(&mut data, &mut last)?,
                _ => {
                    last = last.wrapping_add(if low == 13 { u32::MAX } else { 1 });
                    last
                }
            };
            if low == 0 || low >= first_free {
                vertices.push(c);
            }
            edges.push([c, b]);
            edges.push([a, c]);
            [a, b, c]
        } else {
            let pair = if low < 14 { table[low] } else { take_byte(&mut data)? };
            if low >= 14 && pair == 0 {
                next = 0;
            }
            let kinds = [if low == 15 { 15 } else { 0 }, pair >> 4, pair & 15].map(usize::from);
            let mut triangle = [0; 3];
            for (vertex, kind) in triangle.iter_mut().zip(kinds) {
                *vertex = match kind {
                    0 => take_next(&mut next),
                    15 => take_index(&mut data, &mut last)?,
                    _ => vertices.get(kind - 1)?,
                };
            }
            let [a, b, c] = triangle;
            for (vertex, kind) in triangle.into_iter().zip(kinds) {
                if kind == 0 || kind == 15 {
                    vertices.push(vertex);
                }
            }
            edges.push([b, a]);
            edges.push([c, b]);
            edges.push([a, c]);
            triangle
        };
        triangle.iter().for_each(|vertex| rows.extend_from_slice(&vertex.to_le_bytes()[..stride]));
    }
    if data.is_empty() { Ok(rows) } else { Err(LONG) }
}

fn indices(bytes: &[u8], count: usize, stride: usize) -> Result<Vec<u8>, &'static str> {
    let (&header, bytes) = bytes.split_first().ok_or(SHORT)?;
    if header & 0xfe != 0xd0 {
        return Err(UNKNOWN);
    }
    let (mut data, _) = tailed(bytes, 4)?;
    if data.len() < count {
        return Err(MANY);
    }
    let mut last = [0_u32; 2];
    let mut rows = Vec::with_capacity(count * stride);
    for _ in 0..count {
        let number = take_number(&mut data)?;
        let last = &mut last[(number & 1) as usize];
        *last = last.wrapping_add(signed(number >> 1));
        rows.extend_from_slice(&last.to_le_bytes()[..stride]);
    }
    if data.is_empty() { Ok(rows) } else { Err(LONG) }
}

/// Undoes a filter. Rows that no filter makes give some numbers: casts of floats stop at the ends and take what is no number for 0.
fn unfilter(rows: &mut [u8], filter: Filter, stride: usize) {
    let bytes = |row: &[u8; 4]| row.map(|byte| f32::from(byte as i8));
    let halves = |row: &[u8; 8]| [0, 2, 4, 6].map(|i| i16::from_le_bytes([row[i], row[i + 1]]));
    match (filter, stride) {
        (Filter::None, _) => {}
        (Filter::Octahedral, 4) => {
            for row in rows.as_chunks_mut::<4>().0 {
                let [x, y, z] = direction(bytes(row), 127.0);
                *row = [x as i8 as u8, y as i8 as u8, z as i8 as u8, row[3]];
            }
        }
        (Filter::Octahedral, _) => {
            for row in rows.as_chunks_mut::<8>().0 {
                let own = halves(row);
                let [x, y, z] = direction(own.map(f32::from), 32767.0).map(|n| n as i16);
                *row = eight([x, y, z, own[3]].map(i16::to_le_bytes));
            }
        }
        (Filter::Quaternion, _) => {
            for row in rows.as_chunks_mut::<8>().0 {
                *row = eight(rotation(halves(row)).map(i16::to_le_bytes));
            }
        }
        (Filter::Exponential, _) => {
            for four in rows.as_chunks_mut::<4>().0 {
                *four = float(i32::from_le_bytes(*four)).to_le_bytes();
            }
        }
        (Filter::Colour, 4) => {
            for row in rows.as_chunks_mut::<4>().0 {
                let [y, co, cg, a] = *row;
                let own = [i32::from(y), i32::from(co as i8), i32::from(cg as i8), i32::from(a)];
                *row = colour(own, 255.0).map(|n| n as u8);
            }
        }
        (Filter::Colour, _) => {
            for row in rows.as_chunks_mut::<8>().0 {
                let [y, co, cg, a] = halves(row);
                let own = [i32::from(y as u16), i32::from(co), i32::from(cg), i32::from(a as u16)];
                *row = eight(colour(own, 65535.0).map(|n| (n as u16).to_le_bytes()));
            }
        }
    }
}

fn eight(halves: [[u8; 2]; 4]) -> [u8; 8] {
    std::array::from_fn(|i| halves[i / 2][i % 2])
}

/// A unit vector times `most` from x, y and 1 on an octahedron.
fn direction([x, y, one, _]: [f32; 4], most: f32) -> [f32; 3] {
    let [x, y] = [x / one, y / one];
    let z = 1.0 - x.abs() - y.abs();
    // The lower half is folded outwards.
    let fold = z.min(0.0);
    let [x, y] = [x, y].map(|n| n - fold.abs().copysign(n));
    let length = (x * x + y * y + z * z).sqrt();
    [x, y, z].map(|n| (n / length * most).round())
}

/// A unit quaternion, normalised, from its three smaller components, and from 1 with the largest one's place in two bits.
fn rotation([x, y, z, one]: [i16; 4]) -> [i16; 4] {
    let largest = usize::from(one as u16 & 3);
    let scale = std::f32::consts::FRAC_1_SQRT_2 / f32::from(one | 3);
    let [x, y, z] = [x, y, z].map(|n| f32::from(n) * scale);
    let w = (1.0 - x * x - y * y - z * z).max(0.0).sqrt();
    let mut turned = [w, x, y, z].map(|n| (n * 32767.0).round() as i16);
    turned.rotate_right(largest);
    turned
}

/// A float from 24 bits of mantissa under 8 of exponent.
fn float(packed: i32) -> f32 {
    let power = f64::from_bits((((packed >> 24) + 1023) as u64) << 52);
    (power * f64::from(packed << 8 >> 8)) as f32
}

/// Red, green, blue and alpha up to `most` from brightness, two differences, and alpha with a bit above it that says how many bits there are.
fn colour([y, co, cg, alpha]: [i32; 4], most: f32) -> [f32; 4] {
    let own_most = (1 << (32 - alpha.leading_zeros())) - 1;
    let alpha = alpha & own_most >> 1;
    let rgba = [y + co - cg, y + cg, y - co - cg, alpha << 1 | alpha & 1];
    rgba.map(|n| (n as f32 * (most / own_most as f32)).round())
}

#[cfg(test)]
mod tests;
