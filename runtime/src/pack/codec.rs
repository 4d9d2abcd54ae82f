//! How numbers become bytes and come back: a bounded reader and a writer of the same primitives, side by side, and the
//! compression of a whole section. Knows nothing of garments or of what a pack contains.
//!
//! Long arrays are *columns*: the values of one coordinate, one after the other. A column stores, per value, its
//! wrapping difference to the value before (the first: to 0), zigzag-coded so that small differences of either sign are
//! small numbers, in runs of the entropy coder (`rans`). Columns of floating-point numbers begin with a byte: the
//! number of decimals d when all of them are the `f32` nearest to n / 10^d for whole n of 32 bits, which are then the
//! values (numbers from text files are of this kind); or 255, and the values are the numbers' bits.

use super::ContentProblem;
use super::rans::{self, RUN};
use glam::{Quat, Vec3};
use std::borrow::Cow;

/// No LZ4 block decodes to more than this many times its length.
pub const LZ4_EXPANSION: usize = 255;

/// Reads primitives from the decoded bytes of a section. Takes nothing that is not there.
pub(super) struct Reader<'a> {
    bytes: &'a [u8],
    at: usize,
    /// Bytes that coded arrays may still decode to.
    allowed: usize,
}

impl<'a> Reader<'a> {
    /// Of a section. Coded arrays may decode to `allowed` bytes.
    pub(super) fn new(bytes: &'a [u8], allowed: usize) -> Reader<'a> {
        Reader { bytes, at: 0, allowed }
    }

    /// How many bytes coded arrays may still decode to.
    pub(super) fn allowed(&self) -> usize {
        self.allowed
    }

    /// To be called before memory is taken for what is not stored byte by byte.
    pub(super) fn allow(&mut self, bytes: usize) -> Result<(), ContentProblem> {
        let too_much = ContentProblem::DecodedLength { decoded: bytes, allowed: self.allowed };
        self.allowed = self.allowed.checked_sub(bytes).ok_or(too_much)?;
        Ok(())
    }

    /// How many bytes have been read.
    pub(super) fn at(&self) -> usize {
        self.at
    }

    /// What has not been read.
    pub(super) fn rest(&mut self) -> &'a [u8] {
        let rest = &self.bytes[self.at..];
        self.at = self.bytes.len();
        rest
    }

    /// Everything must have been read.
    pub(super) fn finish(&self) -> Result<(), ContentProblem> {
        match self.bytes.len() - self.at {
            0 => Ok(()),
            left => Err(ContentProblem::LeftOver(left)),
        }
    }

    pub(super) fn take(&mut self, needed: usize) -> Result<&'a [u8], ContentProblem> {
        let rest = &self.bytes[self.at..];
        let taken = rest.get(..needed).ok_or(ContentProblem::Ends { needed, left: rest.len() })?;
        self.at += needed;
        Ok(taken)
    }

    fn array<const N: usize>(&mut self) -> Result<[u8; N], ContentProblem> {
        Ok(self.take(N)?.try_into().expect("take gives as many bytes as asked"))
    }

    pub(super) fn u8(&mut self) -> Result<u8, ContentProblem> {
        Ok(self.array::<1>()?[0])
    }

    pub(super) fn flag(&mut self) -> Result<bool, ContentProblem> {
        match self.u8()? {
            0 => Ok(false),
            1 => Ok(true),
            other => Err(ContentProblem::Flag(other)),
        }
    }

    pub(super) fn u16(&mut self) -> Result<u16, ContentProblem> {
        Ok(u16::from_le_bytes(self.array()?))
    }

    pub(super) fn u32(&mut self) -> Result<u32, ContentProblem> {
        Ok(u32::from_le_bytes(self.array()?))
    }

    pub(super) fn u64(&mut self) -> Result<u64, ContentProblem> {
        Ok(u64::from_le_bytes(self.array()?))
    }

    pub(super) fn f32(&mut self) -> Result<f32, ContentProblem> {
        Ok(f32::from_le_bytes(self.array()?))
    }

    pub(super) fn f64(&mut self) -> Result<f64, ContentProblem> {
        Ok(f64::from_le_bytes(self.array()?))
    }

    pub(super) fn f64s(&mut self, count: usize) -> Result<Vec<f64>, ContentProblem> {
        let bytes = self.take(count.saturating_mul(8))?;
        Ok(bytes.as_chunks::<8>().0.iter().map(|&number| f64::from_le_bytes(number)).collect())
    }

    pub(super) fn vec3(&mut self) -> Result<Vec3, ContentProblem> {
        Ok(Vec3::new(self.f32()?, self.f32()?, self.f32()?))
    }

    pub(super) fn quat(&mut self) -> Result<Quat, ContentProblem> {
        Ok(Quat::from_xyzw(self.f32()?, self.f32()?, self.f32()?, self.f32()?))
    }

    /// A count, which must lie within the limit.
    pub(super) fn count(&mut self, what: &'static str, limit: usize) -> Result<usize, ContentProblem> {
        let count = self.u32()? as usize;
        if count > limit { Err(ContentProblem::Count { what, count, limit }) } else { Ok(count) }
    }

    pub(super) fn text(&mut self) -> Result<String, ContentProblem> {
        let length = usize::from(self.u16()?);
        let text = std::str::from_utf8(self.take(length)?).map_err(|_| ContentProblem::Utf8)?;
        Ok(text.to_owned())
    }

    /// A column of values of `WIDTH` bytes each.
    pub(super) fn column<const WIDTH: usize>(&mut self, count: usize) -> Result<Column, ContentProblem> {
        self.allow(count.saturating_mul(WIDTH))?;
        let mut values = vec![0; count];
        let mut runs = rans::Decoder::read(self, count.div_ceil(RUN))?;
        let (mut class, mut value) = (0, 0u32);
        for run in values.chunks_mut(RUN) {
            runs.run(&mut class, run)?;
            for number in run {
                value = value.wrapping_add(unzigzag(*number)) & mask::<WIDTH>();
                *number = value;
            }
        }
        runs.finish()?;
        Ok(values.into_iter())
    }

    /// Columns of floating-point numbers.
    pub(super) fn floats<const N: usize>(
        &mut self,
        count: usize,
    ) -> Result<[impl ExactSizeIterator<Item = f32> + use<N>; N], ContentProblem> {
        let decimals = self.u8()?;
        let scale = match decimals {
            BITS => None,
            decimals if usize::from(decimals) < POWERS.len() => Some(POWERS[usize::from(decimals)]),
            _ => return Err(ContentProblem::Decimals(decimals)),
        };
        let number = move |value: u32| match scale {
            None => f32::from_bits(value),
            Some(scale) => (f64::from(value as i32) / scale) as f32,
        };
        let columns = (0..N).map(|_| Ok(self.column::<4>(count)?.map(number))).collect::<Result<Vec<_>, _>>()?;
        Ok(columns.try_into().unwrap_or_else(|_| unreachable!("N columns were read")))
    }
}

/// The values of a column.
pub(super) type Column = std::vec::IntoIter<u32>;

/// Powers of ten by which numbers of text files are whole.
const POWERS: [f64; 8] = [1.0, 1e1, 1e2, 1e3, 1e4, 1e5, 1e6, 1e7];
/// In place of decimals: the values are the numbers' bits.
const BITS: u8 = u8::MAX;

/// Writes what [`Reader`] reads.
#[cfg(feature = "write")]
#[derive(Default)]
pub(super) struct Writer {
    pub(super) bytes: Vec<u8>,
}

#[cfg(feature = "write")]
impl Writer {
    pub(super) fn take(&mut self, bytes: &[u8]) {
        self.bytes.extend_from_slice(bytes);
    }

    pub(super) fn u8(&mut self, value: u8) {
        self.bytes.push(value);
    }

    pub(super) fn flag(&mut self, value: bool) {
        self.u8(u8::from(value));
    }

    pub(super) fn u16(&mut self, value: u16) {
        self.take(&value.to_le_bytes());
    }

    pub(super) fn u32(&mut self, value: u32) {
        self.take(&value.to_le_bytes());
    }

    pub(super) fn u64(&mut self, value: u64) {
        self.take(&value.to_le_bytes());
    }

    pub(super) fn f32(&mut self, value: f32) {
        self.take(&value.to_le_bytes());
    }

    pub(super) fn f64s(&mut self, values: &[f64]) {
        values.iter().for_each(|value| self.take(&value.to_le_bytes()));
    }

    pub(super) fn vec3(&mut self, value: Vec3) {
        value.to_array().into_iter().for_each(|coordinate| self.f32(coordinate));
    }

    pub(super) fn count(&mut self, count: usize) {
        self.u32(u32::try_from(count).expect("counts of a checked garment lie within the limits"));
    }

    pub(super) fn text(&mut self, text: &str) {
        self.u16(u16::try_from(text.len()).expect("texts of a checked garment are short"));
        self.take(text.as_bytes());
    }

    /// Values must fit into `WIDTH` bytes.
    pub(super) fn column<const WIDTH: usize>(&mut self, values: impl Iterator<Item = u32>) {
        let mut before = 0;
        let differences = values.map(|value| {
            debug_assert!(value <= mask::<WIDTH>(), "{value} does not fit into {WIDTH} bytes");
            let difference = value.wrapping_sub(before);
            before = value;
            zigzag::<WIDTH>(difference)
        });
        let differences: Vec<u32> = differences.collect();
        rans::encode(differences.chunks(RUN).map(|run| (0, run)), self);
    }

    /// Columns of the coordinates of values.
    pub(super) fn floats<T, const N: usize>(&mut self, values: &[T], coordinates: impl Fn(&T) -> [f32; N]) {
        let whole = |number: f32, scale: f64| {
            let value = (f64::from(number) * scale).round() as i32;
            ((f64::from(value) / scale) as f32).to_bits() == number.to_bits()
        };
        let fits = |scale: &f64| values.iter().flat_map(&coordinates).all(|number| whole(number, *scale));
        let decimals = POWERS.iter().position(fits);
        self.u8(decimals.map_or(BITS, |decimals| decimals as u8));
        for i in 0..N {
            let value = |number: f32| match decimals {
                Some(decimals) => (f64::from(number) * POWERS[decimals]).round() as i32 as u32,
                None => number.to_bits(),
            };
            self.column::<4>(values.iter().map(|item| value(coordinates(item)[i])));
        }
    }
}

/// The values that fit into `WIDTH` bytes.
const fn mask<const WIDTH: usize>() -> u32 {
    u32::MAX >> (32 - 8 * WIDTH)
}

/// 0, -1, 1, -2, 2 … as 0, 1, 2, 3, 4 …, of differences modulo 256 to the power of `WIDTH`.
#[cfg(feature = "write")]
fn zigzag<const WIDTH: usize>(difference: u32) -> u32 {
    let unused_bits = 32 - 8 * WIDTH;
    let signed = (difference << unused_bits) as i32 >> unused_bits;
    ((signed << 1) ^ (signed >> 31)) as u32 & mask::<WIDTH>()
}

fn unzigzag(zigzag: u32) -> u32 {
    (zigzag >> 1) ^ (zigzag & 1).wrapping_neg()
}

/// How the bytes of a section are stored.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Encoding {
    /// As they are.
    Raw,
    /// As one LZ4 block, without a length before it.
    Lz4,
}

impl Encoding {
    /// Its number in the section table.
    #[must_use]
    pub fn number(self) -> u32 {
        match self {
            Encoding::Raw => 0,
            Encoding::Lz4 => 1,
        }
    }

    /// The encoding of this number.
    #[must_use]
    pub fn from_number(number: u32) -> Option<Encoding> {
        [Encoding::Raw, Encoding::Lz4].into_iter().find(|encoding| encoding.number() == number)
    }

    /// The most bytes that `stored` bytes can decode to.
    #[must_use]
    pub fn longest_decoded(self, stored: usize) -> usize {
        match self {
            Encoding::Raw => stored,
            Encoding::Lz4 => stored.saturating_mul(LZ4_EXPANSION),
        }
    }

    /// The section's bytes; `None` when they are not exactly `decoded_length`. The caller bounds that length.
    pub(super) fn decode(self, stored: &[u8], decoded_length: usize) -> Option<Cow<'_, [u8]>> {
        match self {
            Encoding::Raw => (stored.len() == decoded_length).then_some(Cow::Borrowed(stored)),
            Encoding::Lz4 => {
                let mut decoded = vec![0; decoded_length];
                let length = lz4_flex::block::decompress_into(stored, &mut decoded).ok()?;
                (length == decoded_length).then_some(Cow::Owned(decoded))
            }
        }
    }
}

/// Encodes a section in the shorter way.
#[cfg(feature = "write")]
pub(super) fn encode(decoded: Vec<u8>) -> (Encoding, Vec<u8>) {
    let compressed = lz4_flex::block::compress(&decoded);
    if compressed.len() < decoded.len() { (Encoding::Lz4, compressed) } else { (Encoding::Raw, decoded) }
}

#[cfg(all(test, feature = "write"))]
mod tests {
    use super::*;

    fn reading(bytes: &[u8]) -> Reader<'_> {
        Reader::new(bytes, 1 << 20)
    }

    fn column<const WIDTH: usize>(values: &[u32]) -> Vec<u8> {
        let mut writer = Writer::default();
        writer.column::<WIDTH>(values.iter().copied());
        writer.bytes
    }

    #[test]
    fn columns_come_back() {
        fn check<const WIDTH: usize>(values: &[u32]) {
            let bytes = column::<WIDTH>(values);
            let mut reader = reading(&bytes);
            let column = reader.column::<WIDTH>(values.len()).unwrap();
            assert_eq!(column.len(), values.len());
            assert_eq!(column.collect::<Vec<_>>(), values);
            assert_eq!(reader.finish(), Ok(()));
        }
        check::<1>(&[0, 255, 0, 127, 128, 1, 254]);
        check::<2>(&[0, 0xffff, 0x7fff, 0x8000, 0xff, 0x100, 0]);
        check::<4>(&[0, u32::MAX, 0x7fff_ffff, 0x8000_0000, 1, 0xffff, 0x1_0000]);
    }

    #[test]
    fn nothing_is_read_beyond_the_end() {
        let mut reader = reading(&[1, 2, 3]);
        assert_eq!(reader.u32(), Err(ContentProblem::Ends { needed: 4, left: 3 }));
        assert_eq!(reader.column::<2>(2).err(), Some(ContentProblem::Ends { needed: 1, left: 0 }));
        let mut reader = reading(&[1, 0, b'a', 7]);
        assert_eq!(reader.text().as_deref(), Ok("a"));
        assert_eq!(reader.flag(), Err(ContentProblem::Flag(7)));
        assert_eq!(reading(&[1, 0, 0xff]).text(), Err(ContentProblem::Utf8));
        // A table takes a thousand times its bytes to build, so there are no more than runs can name.
        let tables = [&[2][..], &[1, 255, 0, 8].repeat(2), &1u32.to_le_bytes().repeat(6)].concat();
        assert_eq!(reading(&tables).column::<4>(0).err(), Some(ContentProblem::Codes));
        let too_much = ContentProblem::DecodedLength { decoded: usize::MAX, allowed: 1 << 20 };
        assert_eq!(reading(&[0xff; 2]).column::<4>(usize::MAX).err(), Some(too_much));
    }

    #[test]
    fn sections_decode_to_exactly_their_length() {
        for content in [&b""[..], b"short", &[7; 100_000]] {
            let (encoding, stored) = encode(content.to_vec());
            assert!(stored.len() <= content.len());
            assert!(content.len() <= encoding.longest_decoded(stored.len()));
            assert_eq!(encoding.decode(&stored, content.len()).as_deref(), Some(content));
            assert_eq!(encoding.decode(&stored, content.len() + 1), None);
            if !content.is_empty() {
                assert_eq!(encoding.decode(&stored, content.len() - 1), None);
            }
        }
    }
}
