//! Memory use of live poses.

use crate::usage;
use kitsuke::skeleton::vmc::{self, Receiver};
use kitsuke::skeleton::{Bone, Tracked};
use kitsuke_tests::motions::{dance, wearer};

#[test]
fn datagrams_of_any_kind_allocate_nothing() {
    let wearer = wearer();
    let datagrams: Vec<Vec<u8>> = dance()[..60].iter().flat_map(|pose| vmc::datagrams(pose, &wearer, 1.0)).collect();
    let mut receiver = Receiver::new(&wearer);
    let mut last = Tracked::UNSEEN;
    let (_, used) = usage(|| {
        for (i, datagram) in datagrams.iter().enumerate() {
            receiver.datagram(datagram, i as f64 * 0.01, |pose| last.clone_from(pose));
            // The same cut off, and bytes of it elsewhere.
            receiver.datagram(&datagram[..i * 7 % datagram.len()], i as f64 * 0.01, |_| {});
            receiver.datagram(&datagram[i..], i as f64 * 0.01, |_| {});
        }
        receiver.calibrate()
    });
    assert_eq!(used.allocations, 0);
    assert!(receiver.counters().malformed > 60 && last.confidence[Bone::Hips as usize] == 1.0);
}
