//! Opening holds no more memory than documented.

use kitsuke::Pack;
use kitsuke::pack::write::write;

#[test]
fn a_good_pack_stays_below_the_documented_memory() {
    let pack = write(&kitsuke_tests::small_garment());
    let (opened, usage) = super::usage(|| Pack::open(&pack));
    assert!(opened.is_ok());
    assert!(usage.peak_bytes <= 3 * 255 * pack.len() as isize + (1 << 20), "{usage:?}");
}
