//! Integers on a mesh in few bits: each is predicted from vertices before it, and what the prediction missed is written in an adaptive
//! Golomb–Rice code. Knows nothing of what the numbers mean.

use super::ContentProblem;

/// Where a vertex continues the plane of a neighbouring triangle: a + b − c, all of them before it.
type Parallelogram = [u32; 3];

/// For every vertex what predicts it.
#[derive(Clone, Debug)]
pub(super) struct Predictor {
    /// The parallelograms of vertex `v` are `starts[v]..starts[v + 1]`.
    starts: Vec<u32>,
    parallelograms: Vec<Parallelogram>,
    /// A vertex before it that shares an edge, for those without parallelogram; itself where there is none.
    before: Vec<u32>,
}

impl Predictor {
    /// Of a mesh whose triangles index `vertex_count` vertices.
    pub(super) fn new(vertex_count: usize, triangles: &[[u32; 3]]) -> Predictor {
        let mut before: Vec<u32> = (0..vertex_count as u32).collect();
        // Every side of every triangle with the corner opposite.
        let mut sides: Vec<(u32, u32, u32)> = Vec::with_capacity(3 * triangles.len());
        for &[a, b, c] in triangles {
            sides.extend([(a, b, c), (b, c, a), (c, a, b)].map(|(a, b, c)| (a.min(b), a.max(b), c)));
        }
        sides.sort_unstable();
        for &(a, b, _) in &sides {
            // Of several the last one, which is the nearest in memory.
            before[b as usize] = if before[b as usize] == b { a } else { before[b as usize].max(a) };
        }
        let parallelogram = |pair: &[(u32, u32, u32)]| {
            let ((a, b, c), (other_a, other_b, d)) = (pair[0], pair[1]);
            let last = c.max(d);
            ((a, b) == (other_a, other_b) && c != d && last > b).then_some((last, [a, b, c.min(d)]))
        };
        // Counted before, so that no more memory is taken than needed.
        let mut found: Vec<(u32, Parallelogram)> =
            Vec::with_capacity(sides.windows(2).filter_map(parallelogram).count());
        found.extend(sides.windows(2).filter_map(parallelogram));
        drop(sides);
        found.sort_unstable();
        let mut starts = vec![0; vertex_count + 1];
        for (vertex, _) in &found {
            starts[*vertex as usize + 1] += 1;
        }
        for v in 0..vertex_count {
            starts[v + 1] += starts[v];
        }
        Predictor { starts, parallelograms: found.into_iter().map(|(_, corners)| corners).collect(), before }
    }

    /// What the values before `vertex` let expect of it. Wraps.
    fn predict(&self, vertex: usize, values: &[i32]) -> i32 {
        let range = self.starts[vertex] as usize..self.starts[vertex + 1] as usize;
        let at = |v: u32| values[v as usize];
        match &self.parallelograms[range] {
            [] if self.before[vertex] as usize == vertex => 0,
            [] => at(self.before[vertex]),
            [[a, b, c]] => at(*a).wrapping_add(at(*b)).wrapping_sub(at(*c)),
            all => {
                let of = |[a, b, c]: &Parallelogram| i64::from(at(*a)) + i64::from(at(*b)) - i64::from(at(*c));
                let sum: i64 = all.iter().map(of).sum();
                (sum + all.len() as i64 / 2).div_euclid(all.len() as i64) as i32
            }
        }
    }
}

/// How long the residuals of one kind have been of late; their codes follow it.
#[derive(Clone, Copy, Debug)]
struct Recent {
    sum: u64,
    count: u32,
}

impl Recent {
    const NEW: Recent = Recent { sum: 8, count: 1 };
    /// After so many the older ones count half.
    const MEMORY: u32 = 64;

    /// How many low bits are written as they are: about the logarithm of the mean.
    fn low_bits(self) -> u32 {
        (0..31).find(|&bits| u64::from(self.count) << bits >= self.sum).unwrap_or(31)
    }

    fn note(&mut self, zigzag: u32) {
        self.sum += u64::from(zigzag);
        self.count += 1;
        if self.count == Recent::MEMORY {
            self.sum /= 2;
            self.count /= 2;
        }
    }
}

/// A code with so many zeros is an escape: the number follows in 32 bits.
const ESCAPE: u32 = 24;

/// Reads residuals. Every one takes at least a bit.
pub(super) struct ResidualReader<'a> {
    bytes: &'a [u8],
    at_bit: usize,
    recent: Vec<Recent>,
}

impl<'a> ResidualReader<'a> {
    /// Residuals of so many kinds.
    pub(super) fn new(bytes: &'a [u8], kinds: usize) -> ResidualReader<'a> {
        ResidualReader { bytes, at_bit: 0, recent: vec![Recent::NEW; kinds] }
    }

    /// The value of `vertex`, of which the values before it are known.
    pub(super) fn value(&mut self, kind: usize, predictor: &Predictor, vertex: usize, values: &[i32]) -> i32 {
        let zigzag = self.zigzag(kind);
        let residual = (zigzag >> 1) as i32 ^ -((zigzag & 1) as i32);
        predictor.predict(vertex, values).wrapping_add(residual)
    }

    /// Beyond the end it reads zeros, which [`ResidualReader::finish`] tells.
    fn zigzag(&mut self, kind: usize) -> u32 {
        let window = self.window();
        let zeros = window.trailing_zeros().min(ESCAPE);
        let low_bits = self.recent[kind].low_bits();
        let zigzag = if zeros == ESCAPE {
            self.at_bit += (ESCAPE + 32) as usize;
            (window >> ESCAPE) as u32
        } else {
            self.at_bit += (zeros + 1 + low_bits) as usize;
            (zeros << low_bits) | (window >> (zeros + 1)) as u32 & ((1 << low_bits) - 1)
        };
        self.recent[kind].note(zigzag);
        zigzag
    }

    /// At least the next 57 bits.
    fn window(&self) -> u64 {
        let rest = self.bytes.get(self.at_bit / 8..).unwrap_or_default();
        let word = match rest.first_chunk::<8>() {
            Some(word) => u64::from_le_bytes(*word),
            None => rest.iter().rev().fold(0, |word, byte| word << 8 | u64::from(*byte)),
        };
        word >> (self.at_bit % 8)
    }

    /// All bytes must have been read, and none beyond.
    pub(super) fn finish(&self) -> Result<(), ContentProblem> {
        let read = self.at_bit.div_ceil(8);
        match self.bytes.len().checked_sub(read) {
            Some(0) => Ok(()),
            Some(left) => Err(ContentProblem::LeftOver(left)),
            None => Err(ContentProblem::Ends { needed: read, left: self.bytes.len() }),
        }
    }
}

/// Writes what [`ResidualReader`] reads.
#[cfg(feature = "write")]
pub(super) struct ResidualWriter {
    bytes: Vec<u8>,
    /// Bits not yet in `bytes`, fewer than 8.
    open: u64,
    open_bits: u32,
    recent: Vec<Recent>,
}

#[cfg(feature = "write")]
impl ResidualWriter {
    pub(super) fn new(kinds: usize) -> ResidualWriter {
        ResidualWriter { bytes: Vec::new(), open: 0, open_bits: 0, recent: vec![Recent::NEW; kinds] }
    }

    /// `values` up to and with that of `vertex`.
    pub(super) fn value(&mut self, kind: usize, predictor: &Predictor, vertex: usize, values: &[i32]) {
        let residual = values[vertex].wrapping_sub(predictor.predict(vertex, values));
        let zigzag = ((residual << 1) ^ (residual >> 31)) as u32;
        let low_bits = self.recent[kind].low_bits();
        let zeros = zigzag >> low_bits;
        if zeros >= ESCAPE {
            self.bits(0, ESCAPE);
            self.bits(u64::from(zigzag), 32);
        } else {
            self.bits(1 << zeros, zeros + 1);
            self.bits(u64::from(zigzag) & ((1 << low_bits) - 1), low_bits);
        }
        self.recent[kind].note(zigzag);
    }

    fn bits(&mut self, bits: u64, count: u32) {
        self.open |= bits << self.open_bits;
        self.open_bits += count;
        while self.open_bits >= 8 {
            self.bytes.push(self.open as u8);
            self.open >>= 8;
            self.open_bits -= 8;
        }
    }

    pub(super) fn finish(mut self) -> Vec<u8> {
        if self.open_bits > 0 {
            self.bytes.push(self.open as u8);
        }
        self.bytes
    }
}

#[cfg(all(test, feature = "write"))]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// Two triangles side by side, then one of its own, then a loose vertex.
    const TRIANGLES: [[u32; 3]; 3] = [[0, 1, 2], [2, 1, 3], [4, 5, 6]];

    #[test]
    fn planes_are_predicted() {
        let predictor = Predictor::new(8, &TRIANGLES);
        let values = [10, 20, 30, 0, 7, 0, 0, 0];
        assert_eq!(predictor.predict(0, &values), 0);
        assert_eq!(predictor.predict(1, &values), 10);
        assert_eq!(predictor.predict(3, &values), 40);
        assert_eq!(predictor.predict(4, &values), 0);
        assert_eq!(predictor.predict(5, &values), 7);
        assert_eq!(predictor.predict(7, &values), 0);
    }

    proptest! {
        #[test]
        fn any_values_come_back(values in prop::collection::vec(prop_oneof![-3i32..3, -3000i32..3000, any::<i32>()], 8)) {
            let predictor = Predictor::new(8, &TRIANGLES);
            let mut writer = ResidualWriter::new(2);
            (0..8).for_each(|vertex| writer.value(vertex % 2, &predictor, vertex, &values));
            let bytes = writer.finish();
            let mut reader = ResidualReader::new(&bytes, 2);
            let mut read = [0; 8];
            for vertex in 0..8 {
                read[vertex] = reader.value(vertex % 2, &predictor, vertex, &read);
            }
            prop_assert_eq!(&read[..], &values[..]);
            prop_assert_eq!(reader.finish(), Ok(()));
            let mut short = ResidualReader::new(&bytes[..bytes.len() - 1], 2);
            (0..8).for_each(|vertex| { short.value(vertex % 2, &predictor, vertex, &read); });
            prop_assert!(short.finish().is_err());
        }
    }

    #[test]
    fn smooth_values_take_few_bits() {
        let n = 60u32;
        let at = |x: u32, y: u32| y * n + x;
        let cells = (0..n - 1).flat_map(|y| (0..n - 1).map(move |x| (x, y)));
        let triangles: Vec<[u32; 3]> = cells
            .flat_map(|(x, y)| [[at(x, y), at(x + 1, y), at(x, y + 1)], [at(x + 1, y), at(x + 1, y + 1), at(x, y + 1)]])
            .collect();
        let predictor = Predictor::new((n * n) as usize, &triangles);
        let values: Vec<i32> = (0..n * n).map(|v| ((v % n) * (v % n) / 3 + 250 * (v / n)) as i32).collect();
        let mut writer = ResidualWriter::new(1);
        (0..values.len()).for_each(|vertex| writer.value(0, &predictor, vertex, &values));
        let bits = 8 * writer.finish().len();
        assert!(bits < 3 * values.len(), "{bits} bits for {} values", values.len());
    }
}
