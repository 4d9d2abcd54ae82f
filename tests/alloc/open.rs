//! Opening holds no more memory than documented, whatever the bytes say.

use glam::{DVec3, Quat, Vec3};
use kitsuke::arrays::{ChainJoint, Group, Rbf, RbfLayer};
use kitsuke::arrays::{Driver, GarmentData, Part, Segment, Target, limits};
use kitsuke::pack::write::write;
use kitsuke::skeleton::{Bone, Joint, Skeleton};
use kitsuke::{Garment, Pack};
use kitsuke_tests::container::{Container, Section, for_each_damage};
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

/// Counts that a garment may not have, of things that are larger in memory than in the pack: refused before memory is taken.
#[test]
fn hostile_counts_stay_below_the_documented_memory() {
    let mut data = small_garment_data();
    data.pose_limits.clear();
    let sound = Container::of(&write(&Garment::new(data).expect("a garment"))).uncompressed();
    let check = |what: &str, change: &dyn Fn(&mut Container)| {
        let mut container = sound.clone();
        change(&mut container);
        let pack = compressed(container).to_pack();
        let (opened, usage) = super::usage(|| Pack::open(&pack).map(drop));
        assert!(opened.is_err(), "{what}");
        assert!(usage.peak_bytes <= bound(&pack, limits::DECODED_BYTES), "{what}: {} bytes, {usage:?}", pack.len());
    };
    check("bounds of no joints", &|container| {
        let drivers = &mut container.section(b"DRIV").stored;
        *drivers.last_mut().expect("a count") = 8;
        let limit = [&[0, 0, 0, 0, 0, 0xff, 0xff][..], &[0; 4 * 0xffff]].concat();
        (0..8).for_each(|_| drivers.extend(&limit));
    });
    check("groups of layers that nobody drives", &|container| {
        let layer_of_first = 2 + "leftShoulder".len() + 4;
        container.section(b"DRIV").stored[layer_of_first] = 255;
        let layer = |groups: u8| [&[0; 32][..], &[groups], &vec![0; 9 * usize::from(groups)]].concat();
        container.section(b"RBFS").stored = [&[1][..], &layer(0), &layer(255).repeat(255)].concat();
    });
}

/// With every section as LZ4 stores it.
fn compressed(mut container: Container) -> Container {
    for section in &mut container.sections {
        section.decoded_length = section.stored.len() as u32;
        section.stored = lz4_flex::block::compress(&section.stored);
        section.encoding = 1;
    }
    container
}

/// What a fit needs is decoded within the documented memory, too, however large the garment and few its bytes: fields of no sizes, and one
/// size whose fields take a bit per number.
#[test]
fn hostile_fits_stay_below_the_documented_memory() {
    let garment = compressed(Container::of(&write(&many_parts())).uncompressed());
    let joints = small_garment().data().skeleton.joints().len();
    for (sizes, is_older) in [(0, true), (1, true), (0, false), (1, false)] {
        let mut container = garment.clone();
        let body = |i: u8| [&[1, 0, b'a' + i, 0][..], &vec![0; 12 * joints]].concat();
        let bodies = (0..=sizes).flat_map(body).collect::<Vec<u8>>();
        let fits = [&[sizes + 1, 0, 0, 0][..], &bodies, &[0; 8]].concat();
        let parts = usize::from(sizes) * limits::PARTS;
        let residuals = vec![0xff; (parts * 3 * UNIQUE).div_ceil(8)];
        let older = [&vec![0; 4 * parts][..], &(residuals.len() as u32).to_le_bytes(), &residuals].concat();
        // Two coders of zeros alone: a table of one token, states, no words and no bits.
        let zeros = [&[1, 1, 255, 0, 8][..], &[0, 0, 1, 0].repeat(4), &[0; 8]].concat();
        let newer = [&vec![0; 4 * parts][..], &zeros, &zeros].concat();
        let (tag, fields) = if is_older { (*b"FLDS", older) } else { (*b"SFLD", newer) };
        for (tag, stored) in [(*b"FITS", fits), (tag, fields)] {
            container.sections.push(Section { tag, encoding: 0, decoded_length: 0, stored });
        }
        let uncompressed = container.sections.len() - 2;
        let fit = compressed(Container { sections: container.sections.split_off(uncompressed), major: 0, minor: 0 });
        container.sections.extend(fit.sections);
        let pack = container.to_pack();
        let opened = Pack::open(&pack).expect("the garment is sound");
        let (fit, usage) = super::usage(|| opened.fit_data().map(drop));
        assert!(fit.is_err(), "{sizes} {is_older}");
        let unpacked: usize = opened.sections().iter().map(|section| section.unpacked_length).sum();
        let values = 2 * parts * 3 * UNIQUE;
        let bound = 8 * (unpacked + values) + (2 << 20);
        assert!(usage.peak_bytes <= bound as isize, "{sizes} {is_older}: {unpacked}, {} bytes, {usage:?}", pack.len());
    }
}

/// Vertices of [`many_parts`].
const UNIQUE: usize = 1 << 14;

/// The small garment's skeleton under many triangles between the same two vertices, in as many parts as possible.
fn many_parts() -> Garment {
    let mut data = small_garment_data();
    data.mesh.positions_m = vec![Vec3::ZERO; UNIQUE];
    data.mesh.source_vertex = (0..UNIQUE as u32).collect();
    (data.mesh.uv, data.mesh.twin_of) = (Vec::new(), Vec::new());
    data.skin = vec![data.skin[0]; UNIQUE];
    data.mesh.triangles = (2..UNIQUE as u32).map(|v| [0, 1, v]).collect();
    let part = |i| Part { name: format!("{i:x}"), triangle_count: u32::from(i == 0) * (UNIQUE as u32 - 2) };
    data.mesh.parts = (0..limits::PARTS).map(part).collect();
    data.segments = vec![Segment { vertex_count: UNIQUE as u32, drivers: Vec::new(), masks: Vec::new() }];
    data.targets.iter_mut().for_each(|target| (target.segments, target.deltas) = (Vec::new(), Vec::new()));
    Garment::new(data).expect("within the limits")
}
