//! Opening holds no more memory than documented, whatever the bytes say.

use kitsuke::Pack;
use kitsuke::pack::write::write;
use kitsuke_tests::container::{Container, for_each_damage};
use kitsuke_tests::{random, small_garment};

/// The bound that `Pack::open` documents.
fn bound(pack: &[u8], decoded_bytes: usize) -> isize {
    (3 * decoded_bytes.min(255 * pack.len()) + (2 << 20)) as isize
}

#[test]
fn damaged_packs_stay_below_the_documented_memory() {
    const DECODED_BYTES: usize = 64 << 10;
    let pack = write(&small_garment());
    for pack in [Container::of(&pack).uncompressed().to_pack(), pack] {
        for_each_damage(&pack, |what, damaged| {
            let (_, usage) = super::usage(|| drop(Pack::open_with_limit(damaged, DECODED_BYTES)));
            assert!(usage.peak_bytes <= bound(damaged, DECODED_BYTES), "{}: {usage:?}", what());
        });
    }
}

/// The part of the bound that grows, without the constant.
#[test]
fn good_packs_take_less_than_three_times_their_decoded_length() {
    let mut largest = 0;
    for seed in 0..50 {
        let pack = write(&random::garment(seed));
        let (opened, usage) = super::usage(|| Pack::open(&pack));
        let opened = opened.expect("a sound pack");
        let decoded: usize = opened.sections().iter().map(|section| section.decoded_length).sum();
        assert!(usage.peak_bytes <= 3 * decoded as isize + 20_000, "seed {seed}: {decoded} bytes, {usage:?}");
        largest = largest.max(decoded);
    }
    assert!(largest > 100_000, "the constant must not decide: {largest}");
}
