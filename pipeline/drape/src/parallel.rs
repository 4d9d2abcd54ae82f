//! Arrays filled on all threads, each element from its number alone, so that threads change no bit. Knows no cloth.

use rayon::prelude::*;

/// Shorter arrays are filled by the calling thread: waking another one takes longer.
const PARALLEL_FROM: usize = 2048;
const CHUNK: usize = 512;

/// `out[i] = value(i)`.
pub fn fill<T: Send>(out: &mut [T], value: impl Fn(usize) -> T + Sync) {
    if out.len() < PARALLEL_FROM {
        for (i, out) in out.iter_mut().enumerate() {
            *out = value(i);
        }
        return;
    }
    out.par_chunks_mut(CHUNK).enumerate().for_each(|(chunk, out)| {
        for (i, out) in out.iter_mut().enumerate() {
            *out = value(chunk * CHUNK + i);
        }
    });
}

/// All that `values` adds for each of `count` numbers, in the order of the numbers.
pub fn collect<T: Send>(count: usize, values: impl Fn(usize, &mut Vec<T>) + Sync) -> Vec<T> {
    if count < PARALLEL_FROM {
        let mut all = Vec::new();
        for i in 0..count {
            values(i, &mut all);
        }
        return all;
    }
    collect_each(count.div_ceil(CHUNK), |chunk, found| {
        for i in chunk * CHUNK..count.min((chunk + 1) * CHUNK) {
            values(i, found);
        }
    })
}

/// As `collect`, where each number alone is work enough for a thread.
pub fn collect_each<T: Send>(count: usize, values: impl Fn(usize, &mut Vec<T>) + Sync) -> Vec<T> {
    let parts: Vec<Vec<T>> = (0..count)
        .into_par_iter()
        .map(|i| {
            let mut found = Vec::new();
            values(i, &mut found);
            found
        })
        .collect();
    parts.into_iter().flatten().collect()
}
