//! Opening holds no more memory than documented, whatever the bytes say.

use glam::{DVec3, Quat, Vec3};
use kitsuke::arrays::{ChainJoint, Group, Rbf, RbfLayer};
use kitsuke::arrays::{Driver, GarmentData, Segment, Target, limits};
use kitsuke::pack::write::write;
use kitsuke::skeleton::{Bone, Joint, Skeleton};
use kitsuke::{Garment, Pack};
use kitsuke_tests::container::{Container, for_each_damage};
use kitsuke_tests::{random, small_garment, small_garment_data};

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

/// The part of the bound that grows, with a constant for tables of frequencies.
#[test]
fn good_packs_take_less_than_three_times_their_decoded_length() {
    let mut largest = 0;
    for seed in 0..50 {
        let pack = write(&random::garment(seed));
        let (opened, usage) = super::usage(|| Pack::open(&pack));
        let opened = opened.expect("a sound pack");
        let decoded: usize = opened.sections().iter().map(|section| section.unpacked_length).sum();
        assert!(usage.peak_bytes <= 3 * decoded as isize + 100_000, "seed {seed}: {decoded} bytes, {usage:?}");
        largest = largest.max(decoded);
    }
    assert!(largest > 200_000, "the constant must not decide: {largest}");
}

/// As many small things as possible: in memory they are larger than in the pack, and the constant must cover that.
#[test]
fn many_small_elements_stay_below_the_documented_memory() {
    for garment in [many_segments_and_targets(), many_chains()] {
        let pack = write(&Garment::new(garment).expect("within the limits"));
        let (opened, usage) = super::usage(|| Pack::open(&pack));
        let opened = opened.expect("a sound pack");
        let decoded: usize = opened.sections().iter().map(|section| section.unpacked_length).sum();
        assert!(usage.peak_bytes <= (3 * decoded + (2 << 20)) as isize, "{decoded} bytes, {usage:?}");
    }
}

fn many_segments_and_targets() -> GarmentData {
    let mut data = small_garment_data();
    let unique = limits::SEGMENTS;
    data.mesh.positions_m = vec![Vec3::ZERO; unique];
    data.mesh.source_vertex = (0..unique as u32).collect();
    data.mesh.uv.clear();
    data.skin = vec![data.skin[0]; unique];
    data.segments = vec![Segment { vertex_count: 1, drivers: vec![0], masks: Vec::new() }; unique];
    let target =
        |i| Target { name: format!("{i:x}"), layer: 0, step_m: 1e-5, segments: Vec::new(), deltas: Vec::new() };
    data.targets = (0..limits::TARGETS).map(target).collect();
    data.poses.rotations = vec![Quat::IDENTITY; 2 * (limits::TARGETS + 1)];
    data.rbf = None;
    let certificate = data.certificate.as_mut().expect("the small garment has a certificate");
    certificate.left_out = vec![certificate.left_out[0]; limits::TARGETS];
    data
}

fn many_chains() -> GarmentData {
    const TARGETS: usize = 35;
    let mut data = small_garment_data();
    let bones = &Bone::ALL[..limits::CHAIN];
    let joint = |(bone, i): (&Bone, u8)| Joint { bone: *bone, parent: i.checked_sub(1), rest_m: Vec3::ZERO };
    data.skeleton = Skeleton::new(bones.iter().zip(0..).map(joint).collect()).expect("joints in order");
    data.poses.bones = bones.to_vec();
    data.pose_limits.clear();
    data.poses.rotations = vec![Quat::IDENTITY; bones.len() * (TARGETS + 1)];
    let target =
        |i| Target { name: format!("{i:x}"), layer: 0, step_m: 1e-5, segments: Vec::new(), deltas: Vec::new() };
    data.targets = (0..TARGETS).map(target).collect();
    let driver = |i| Driver { name: format!("{i:x}"), joints: vec![Bone::Hips], threshold_rad: 1.0, layer: 0 };
    data.drivers = (0..limits::DRIVERS).map(driver).collect();
    let chain = bones.iter().map(|&bone| ChainJoint {
        bone,
        parent: None,
        is_carried: false,
        axis: DVec3::X,
        swing: 1.0,
        twist: 1.0,
    });
    let group = |i: usize| Group {
        name: format!("{i:x}"),
        drivers: vec![i as u8],
        chain: chain.clone().collect(),
        mirror: None,
        own: vec![0.0; TARGETS * (TARGETS + 1)],
        joint: vec![0.0; TARGETS * (TARGETS + 1)],
        centres: Vec::new(),
        corrective: Vec::new(),
    };
    let groups = (0..limits::DRIVERS).map(group).collect();
    data.rbf =
        Some(Rbf { layers: vec![RbfLayer { groups, joint_width: 1.0, reach: 1.0, ridge: 1e-6, mirror_ridge: 1e-6 }] });
    data.certificate = None;
    data
}
