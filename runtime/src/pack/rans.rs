//! The entropy coder: runs of unsigned numbers as bytes and back. Encoder and decoder side by side; what the numbers mean
//! is their callers' business.
//!
//! Numbers come in *runs* of at most [`RUN`] that are about equally large, such as one coordinate of neighbouring
//! vertices. Every run has a *class*, and every class its own table of frequencies: class 0 is a run of zeros, which takes
//! no further bytes. Tables instead of adaptive models, because then a run is decoded without a branch that depends on
//! the number before.
//!
//! A number below 16 is its own *token*; a larger one is written as a token that says how many bits it has and what the
//! two after the highest are, and its remaining bits stand uncompressed in a stream of their own. Tokens are coded by range
//! asymmetric numeral systems (Duda 2013) with [`PROBABILITY_BITS`] of precision: four states of 32 bits, used in turn,
//! because each waits for its own result before, and renormalised by 16 bits.
//!
//! | what | how |
//! |---|---|
//! | tables n | `u8`, 1 to 32: of the classes' differences, then of class 1, 2 … |
//! | per table | `u8` number of tokens m; m frequencies, each a `u8`, or if that is 255, a `u16`; they sum to 2048 |
//! | states | 4 `u32` |
//! | words w, bits b | `u32` each |
//! | words | w `u16`, in the order in which the decoder takes them |
//! | bits | b `u32`, lowest bit first |
//!
//! A run begins with the difference of its class to the class of the run before *of its lane*, zigzag-coded, coded with
//! the first state and table; then its tokens follow, the i-th with state i mod 4.

use super::ContentProblem;
use super::codec::Reader;

#[cfg(feature = "write")]
pub(super) use encode::encode;

/// Most numbers in a run.
pub(super) const RUN: usize = 64;
/// Most tables.
const TABLES: usize = 32;
/// Frequencies sum to two to the power of this.
const PROBABILITY_BITS: u32 = 11;
const SLOTS: usize = 1 << PROBABILITY_BITS;
/// States never lie below this.
const LEAST_STATE: u32 = 1 << 16;
/// Numbers below are their own tokens.
const LITERAL: u32 = 16;
/// Tokens that a number of 32 bits can have.
const TOKENS: usize = 128;

/// What a number is split into: its token, and how many bits follow.
fn extra_bits(token: u32) -> u32 {
    if token < LITERAL { 0 } else { (token - LITERAL) / 4 + 2 }
}

/// The least number of a token.
fn least(token: u32) -> u32 {
    if token < LITERAL { token } else { (4 + (token - LITERAL) % 4) << extra_bits(token) }
}

/// Per slot: the slot's place within its token, the token's frequency, the token.
type Table = [u32; SLOTS];

/// Decodes one sequence of runs.
pub(super) struct Decoder<'a> {
    /// Of the classes' differences, then of class 1, 2 …
    tables: Vec<Table>,
    /// Whether a table has tokens with further bits.
    has_extra: Vec<bool>,
    states: [u32; 4],
    words: &'a [[u8; 2]],
    words_at: usize,
    bits: &'a [[u8; 4]],
    bits_at: usize,
    pending: u64,
    pending_count: u32,
}

const DAMAGED: ContentProblem = ContentProblem::Codes;

impl<'a> Decoder<'a> {
    /// Reads tables and states; the runs, `most_runs` of them, are decoded as they are asked for. Each table but the first is that of a
    /// run at least: building one takes longer than reading its few bytes.
    pub(super) fn read(from: &mut Reader<'a>, most_runs: usize) -> Result<Decoder<'a>, ContentProblem> {
        let count = usize::from(from.u8()?);
        if count == 0 || count > TABLES.min(most_runs.saturating_add(1)) {
            return Err(DAMAGED);
        }
        let mut tables = Vec::with_capacity(count);
        let mut has_extra = Vec::with_capacity(count);
        for _ in 0..count {
            let (table, tokens) = read_table(from)?;
            tables.push(table);
            has_extra.push(tokens > LITERAL as usize);
        }
        let states = [from.u32()?, from.u32()?, from.u32()?, from.u32()?];
        let (words, bits) = (from.u32()? as usize, from.u32()? as usize);
        let (words, _) = from.take(words.saturating_mul(2))?.as_chunks::<2>();
        let (bits, _) = from.take(bits.saturating_mul(4))?.as_chunks::<4>();
        let (words_at, bits_at, pending, pending_count) = (0, 0, 0, 0);
        Ok(Decoder { tables, has_extra, states, words, words_at, bits, bits_at, pending, pending_count })
    }

    /// The next run, `numbers.len()` numbers of them; `class` is that of the run before of the same lane, 0 at first.
    pub(super) fn run(&mut self, class: &mut u8, numbers: &mut [u32]) -> Result<(), ContentProblem> {
        let difference = next(&self.tables[0], &mut self.states[0], self.words, &mut self.words_at);
        *class = class.wrapping_add(((difference >> 1) ^ (difference & 1).wrapping_neg()) as u8);
        if *class == 0 {
            numbers.fill(0);
            return if self.words_at > self.words.len() { Err(DAMAGED) } else { Ok(()) };
        }
        let table = self.tables.get(usize::from(*class)).ok_or(DAMAGED)?;
        // In registers.
        let (words, mut at, [mut a, mut b, mut c, mut d]) = (self.words, self.words_at, self.states);
        let (fours, rest) = numbers.as_chunks_mut::<4>();
        for four in fours {
            four[0] = next(table, &mut a, words, &mut at);
            four[1] = next(table, &mut b, words, &mut at);
            four[2] = next(table, &mut c, words, &mut at);
            four[3] = next(table, &mut d, words, &mut at);
        }
        for (number, state) in rest.iter_mut().zip([&mut a, &mut b, &mut c]) {
            *number = next(table, state, words, &mut at);
        }
        (self.words_at, self.states) = (at, [a, b, c, d]);
        if self.has_extra[usize::from(*class)] {
            for number in numbers.iter_mut().filter(|number| **number >= LITERAL) {
                *number = least(*number) | self.take_bits(extra_bits(*number));
            }
        }
        if at > words.len() || self.bits_at > self.bits.len() { Err(DAMAGED) } else { Ok(()) }
    }

    /// All that was written must have been taken.
    pub(super) fn finish(self) -> Result<(), ContentProblem> {
        let all = self.words_at == self.words.len() && self.bits_at == self.bits.len();
        if all && self.states == [LEAST_STATE; 4] { Ok(()) } else { Err(DAMAGED) }
    }

    /// At most 31 bits; zeros after the end, which the caller notices.
    fn take_bits(&mut self, count: u32) -> u32 {
        if self.pending_count < count {
            let word = self.bits.get(self.bits_at).map_or(0, |&word| u32::from_le_bytes(word));
            self.bits_at += 1;
            self.pending |= u64::from(word) << self.pending_count;
            self.pending_count += 32;
        }
        let taken = self.pending as u32 & ((1 << count) - 1);
        self.pending >>= count;
        self.pending_count -= count;
        taken
    }
}

/// The next token; after the end of the words it goes on with zeros, which the caller notices.
#[inline(always)]
fn next(table: &Table, state: &mut u32, words: &[[u8; 2]], at: &mut usize) -> u32 {
    let entry = table[(*state & (SLOTS as u32 - 1)) as usize];
    let frequency = entry >> PROBABILITY_BITS & (2 * SLOTS as u32 - 1);
    let place = entry & (SLOTS as u32 - 1);
    let decoded = frequency.wrapping_mul(*state >> PROBABILITY_BITS).wrapping_add(place);
    let word = words.get(*at).map_or(0, |&word| u32::from(u16::from_le_bytes(word)));
    // Chosen, not branched: which of the two is needed cannot be foreseen.
    let is_low = decoded < LEAST_STATE;
    *state = if is_low { decoded << 16 | word } else { decoded };
    *at += usize::from(is_low);
    entry >> (2 * PROBABILITY_BITS + 1)
}

/// A table, and how many tokens it has.
fn read_table(from: &mut Reader<'_>) -> Result<(Table, usize), ContentProblem> {
    let tokens = usize::from(from.u8()?);
    if tokens > TOKENS {
        return Err(DAMAGED);
    }
    let mut table = [0; SLOTS];
    let mut end = 0;
    for token in 0..tokens {
        let frequency = match from.u8()? {
            u8::MAX => usize::from(from.u16()?),
            frequency => usize::from(frequency),
        };
        let slots = table.get_mut(end..end + frequency).ok_or(DAMAGED)?;
        end += frequency;
        for (slot, place) in slots.iter_mut().zip(0u32..) {
            *slot = (token as u32) << (2 * PROBABILITY_BITS + 1) | (frequency as u32) << PROBABILITY_BITS | place;
        }
    }
    if end == SLOTS { Ok((table, tokens)) } else { Err(DAMAGED) }
}

#[cfg(feature = "write")]
mod encode {
    use super::*;
    use crate::pack::codec::Writer;

    /// Rounds of assigning runs to classes.
    const ROUNDS: usize = 6;
    /// What changing the class between runs of a lane costs, roughly, bits.
    const CHANGE: f64 = 3.0;

    /// Writes runs, each with its lane, for [`Decoder`].
    pub(in super::super) fn encode<'a>(runs: impl Iterator<Item = (usize, &'a [u32])>, to: &mut Writer) {
        let runs: Vec<(usize, &[u32])> = runs.collect();
        let tokens: Vec<Vec<u8>> = runs.iter().map(|(_, run)| run.iter().map(|&n| token(n)).collect()).collect();
        let classes = classify(&runs, &tokens);
        let count = classes.iter().max().map_or(0, |&class| usize::from(class));

        let lanes = runs.iter().map(|&(lane, _)| lane + 1).max().unwrap_or(0);
        let mut before = vec![0u8; lanes];
        let difference = |(&(lane, _), &class): (&(usize, &[u32]), &u8)| {
            let signed = i32::from(class) - i32::from(before[lane]);
            before[lane] = class;
            ((signed << 1) ^ (signed >> 31)) as u8
        };
        let differences: Vec<u8> = runs.iter().zip(&classes).map(difference).collect();

        let mut histograms = vec![[0u32; TOKENS]; count + 1];
        differences.iter().for_each(|&difference| histograms[0][usize::from(difference)] += 1);
        for (tokens, &class) in tokens.iter().zip(&classes).filter(|(_, class)| **class > 0) {
            tokens.iter().for_each(|&token| histograms[usize::from(class)][usize::from(token)] += 1);
        }
        let tables: Vec<[u32; TOKENS]> = histograms.iter().map(frequencies).collect();

        // Backwards, because the decoder takes last what was put first.
        let mut states = [LEAST_STATE; 4];
        let mut words = Vec::new();
        for ((tokens, &class), &difference) in tokens.iter().zip(&classes).zip(&differences).rev() {
            for (i, &token) in tokens.iter().enumerate().rev().filter(|_| class > 0) {
                put(&tables[usize::from(class)], token, &mut states[i % 4], &mut words);
            }
            put(&tables[0], difference, &mut states[0], &mut words);
        }
        words.reverse();
        let (mut bits, mut pending, mut pending_count) = (Vec::new(), 0u64, 0);
        for (&number, &token) in runs.iter().flat_map(|(_, run)| *run).zip(tokens.iter().flatten()) {
            let count = extra_bits(token.into());
            pending |= u64::from(number - least(token.into())) << pending_count;
            pending_count += count;
            if pending_count >= 32 {
                bits.push(pending as u32);
                pending >>= 32;
                pending_count -= 32;
            }
        }
        if pending_count > 0 {
            bits.push(pending as u32);
        }

        to.u8(tables.len() as u8);
        tables.iter().for_each(|table| write_table(table, to));
        states.into_iter().for_each(|state| to.u32(state));
        to.count(words.len());
        to.count(bits.len());
        words.into_iter().for_each(|word| to.u16(word));
        bits.into_iter().for_each(|word| to.u32(word));
    }

    fn token(number: u32) -> u8 {
        if number < LITERAL {
            return number as u8;
        }
        let extra = number.ilog2() - 2;
        (LITERAL + 4 * (extra - 2) + (number >> extra) - 4) as u8
    }

    /// A class for every run, so that few bits are needed: first by size, then in turns with the tables that follow from
    /// it. Classes ascend with their numbers' size.
    fn classify(runs: &[(usize, &[u32])], tokens: &[Vec<u8>]) -> Vec<u8> {
        let is_zero = |tokens: &[u8]| tokens.iter().all(|&token| token == 0);
        let total: usize = tokens.iter().filter(|tokens| !is_zero(tokens)).map(Vec::len).sum();
        let most = (1 + total / 2048).min(TABLES - 8);
        let size = |tokens: &[u8]| tokens.iter().map(|&t| f64::from(t)).sum::<f64>() / tokens.len() as f64;
        let mut by_size: Vec<usize> = (0..tokens.len()).filter(|&run| !is_zero(&tokens[run])).collect();
        by_size.sort_by(|&a, &b| size(&tokens[a]).total_cmp(&size(&tokens[b])));
        let mut classes = vec![0u8; tokens.len()];
        for (place, &run) in by_size.iter().enumerate() {
            classes[run] = (1 + place * most / by_size.len()) as u8;
        }
        let lanes = runs.iter().map(|&(lane, _)| lane + 1).max().unwrap_or(0);
        for _ in 0..ROUNDS {
            let costs: Vec<[f64; TOKENS]> = (1..=most).map(|class| bits_of(tokens, &classes, class as u8)).collect();
            let mut before = vec![0u8; lanes];
            for (run, tokens) in tokens.iter().enumerate() {
                let before = &mut before[runs[run].0];
                if !is_zero(tokens) {
                    let cost = |class: u8| {
                        let table = &costs[usize::from(class) - 1];
                        let change = if class == *before { 0.0 } else { CHANGE };
                        change + tokens.iter().map(|&token| table[usize::from(token)]).sum::<f64>()
                    };
                    let best = (1..=most as u8).min_by(|&a, &b| cost(a).total_cmp(&cost(b)));
                    classes[run] = best.expect("there is a class");
                }
                *before = classes[run];
            }
        }
        // Classes without runs go, so that every table has frequencies.
        let mut used: Vec<u8> = classes.clone();
        used.sort_unstable();
        used.dedup();
        let first = usize::from(used.first() != Some(&0));
        let renumbered = |class: &u8| if *class == 0 { 0 } else { used.binary_search(class).expect("used") + first };
        classes.iter().map(|class| renumbered(class) as u8).collect()
    }

    /// What each token costs in a class, bits.
    fn bits_of(tokens: &[Vec<u8>], classes: &[u8], class: u8) -> [f64; TOKENS] {
        let mut counts = [0.02; TOKENS];
        for tokens in tokens.iter().zip(classes).filter(|(_, c)| **c == class).map(|(tokens, _)| tokens) {
            tokens.iter().for_each(|&token| counts[usize::from(token)] += 1.0);
        }
        let total: f64 = counts.iter().sum();
        std::array::from_fn(|token| libm::log2(total / counts[token]) + f64::from(extra_bits(token as u32)))
    }

    /// Frequencies that sum to the slots, at least one for every token that occurs.
    fn frequencies(histogram: &[u32; TOKENS]) -> [u32; TOKENS] {
        let total: u64 = histogram.iter().map(|&count| u64::from(count)).sum();
        let mut frequencies = [0; TOKENS];
        if total == 0 {
            frequencies[0] = SLOTS as u32;
            return frequencies;
        }
        for (frequency, &count) in frequencies.iter_mut().zip(histogram).filter(|(_, count)| **count > 0) {
            *frequency = ((u64::from(count) * SLOTS as u64 / total) as u32).max(1);
        }
        // What rounding left goes to, or comes from, the most frequent ones.
        loop {
            let sum: u32 = frequencies.iter().sum();
            let most = (0..TOKENS).max_by_key(|&token| (frequencies[token], TOKENS - token)).expect("tokens");
            match (SLOTS as u32).cmp(&sum) {
                std::cmp::Ordering::Equal => return frequencies,
                std::cmp::Ordering::Greater => frequencies[most] += SLOTS as u32 - sum,
                std::cmp::Ordering::Less => frequencies[most] -= (sum - SLOTS as u32).min(frequencies[most] / 2),
            }
        }
    }

    fn write_table(table: &[u32; TOKENS], to: &mut Writer) {
        let tokens = table.iter().rposition(|&frequency| frequency > 0).map_or(0, |last| last + 1);
        to.u8(tokens as u8);
        for &frequency in &table[..tokens] {
            to.u8(frequency.min(255) as u8);
            if frequency >= 255 {
                to.u16(frequency as u16);
            }
        }
    }

    /// Puts a token onto a state.
    fn put(table: &[u32; TOKENS], token: u8, state: &mut u32, words: &mut Vec<u16>) {
        let token = usize::from(token);
        let (start, frequency) = (table[..token].iter().sum::<u32>(), table[token]);
        if u64::from(*state) >= u64::from(LEAST_STATE >> PROBABILITY_BITS << 16) * u64::from(frequency) {
            words.push(*state as u16);
            *state >>= 16;
        }
        *state = ((*state / frequency) << PROBABILITY_BITS) + *state % frequency + start;
    }
}

#[cfg(all(test, feature = "write"))]
mod tests {
    use super::*;
    use crate::pack::codec::Writer;
    use proptest::prelude::*;

    fn bytes(runs: &[(usize, Vec<u32>)]) -> Vec<u8> {
        let mut to = Writer::default();
        encode(runs.iter().map(|(lane, run)| (*lane, run.as_slice())), &mut to);
        to.bytes
    }

    fn decoded(bytes: &[u8], runs: &[(usize, Vec<u32>)]) -> Result<Vec<Vec<u32>>, ContentProblem> {
        let mut reader = Reader::new(bytes, 0);
        let mut decoder = Decoder::read(&mut reader, usize::MAX)?;
        let mut classes = [0; 8];
        let runs = runs.iter().map(|(lane, run)| {
            let mut numbers = vec![7; run.len()];
            decoder.run(&mut classes[*lane], &mut numbers)?;
            Ok(numbers)
        });
        let runs = runs.collect::<Result<_, _>>()?;
        decoder.finish()?;
        reader.finish()?;
        Ok(runs)
    }

    fn runs() -> impl Strategy<Value = Vec<(usize, Vec<u32>)>> {
        let number = (0..=32u32, any::<u32>()).prop_map(|(bits, number)| number.unbounded_shr(32 - bits));
        prop::collection::vec((0..8usize, prop::collection::vec(number, 1..=RUN)), 0..200)
    }

    proptest! {
        #[test]
        fn runs_come_back(runs in runs()) {
            let numbers: Vec<Vec<u32>> = runs.iter().map(|(_, run)| run.clone()).collect();
            prop_assert_eq!(decoded(&bytes(&runs), &runs), Ok(numbers));
        }

        #[test]
        fn damage_does_not_panic(runs in runs(), at in any::<prop::sample::Index>(), bit in 0..8u8) {
            let mut bytes = bytes(&runs);
            let at = at.index(bytes.len());
            bytes[at] ^= 1u8 << bit;
            let _ = decoded(&bytes, &runs);
            prop_assert!(decoded(&bytes[..at], &runs).is_err());
        }
    }

    #[test]
    fn tokens_cover_every_number() {
        for token in 1..116 {
            assert_eq!(least(token), least(token - 1) + (1 << extra_bits(token - 1)), "token {token}");
        }
        assert_eq!(least(127) | ((1 << extra_bits(127)) - 1), u32::MAX);
    }

    #[test]
    fn small_numbers_take_about_their_entropy() {
        // Half zeros, a quarter ones, an eighth twos and threes: 1.75 bits each.
        let numbers: Vec<u32> =
            (0..64_000u32).map(|i| [0, 0, 0, 0, 1, 1, 2, 3][(i.wrapping_mul(0x9e37_79b9) >> 29) as usize]).collect();
        let runs: Vec<(usize, Vec<u32>)> = numbers.chunks(RUN).map(|run| (0, run.to_vec())).collect();
        let bits = 8.0 * bytes(&runs).len() as f64 / 64_000.0;
        assert!((1.7..1.8).contains(&bits), "{bits}");
    }
}
