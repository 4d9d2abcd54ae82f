//! Writing and opening packs: exact round trips, every version for ever, and hostile bytes.

use kitsuke::Pack;
use kitsuke::pack::write::write;
use kitsuke_tests::small_garment;

#[test]
fn the_small_garment_comes_back_exactly() {
    let garment = small_garment();
    let pack = write(&garment);
    assert!(pack.len() <= 20_000, "{} bytes", pack.len());
    assert_eq!(Pack::open(&pack).unwrap().garment().data(), garment.data());
}
