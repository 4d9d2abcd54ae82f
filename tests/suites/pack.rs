//! Writing and opening packs: exact round trips, every version for ever, and hostile bytes.

use glam::{Quat, Vec2, Vec3};
use kitsuke::garment::{Driver, GarmentData, Mesh, Part, PoseTable, Segment, SkinWeights, Target};
use kitsuke::pack::layout;
use kitsuke::pack::write::write;
use kitsuke::skeleton::{Bone, Joint, Skeleton};
use kitsuke::{Garment, OpenError, Pack};
use kitsuke_tests::container::{Container, Section, for_each_damage};
use kitsuke_tests::small_garment;
use proptest::prelude::*;
use std::fs;
use std::path::Path;

#[test]
fn the_small_garment_comes_back_exactly() {
    let garment = small_garment();
    let pack = write(&garment);
    assert!(pack.len() <= 20_000, "{} bytes", pack.len());
    assert_eq!(Pack::open(&pack).unwrap().garment().data(), garment.data());
    assert_eq!(write(&garment), pack, "the same garment gives the same bytes");
}

/// One pack of every released version stays in `packs/` and opens for ever.
#[test]
fn version_1_opens() {
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("packs/v1.kitsuke");
    if std::env::var_os("KITSUKE_WRITE_PACKS").is_some() {
        fs::write(&file, write(&small_garment())).unwrap();
    }
    let pack = Pack::open(&fs::read(&file).unwrap()).unwrap();
    assert_eq!(pack.version(), (1, 0));
    assert_eq!(pack.garment().data(), small_garment().data());
}

#[test]
fn the_container_is_as_specified() {
    let pack = write(&small_garment());
    let container = Container::of(&pack);
    assert_eq!(container.to_pack(), pack, "offsets, padding and checksums follow from the specification");

    let opened = Pack::open(&pack).unwrap();
    assert_eq!((opened.version().0, opened.version().1), (container.major, container.minor));
    assert_eq!(opened.sections().len(), container.sections.len());
    for (info, section) in opened.sections().iter().zip(&container.sections) {
        assert_eq!(info.tag.0, section.tag);
        assert_eq!(pack[info.offset..info.offset + info.stored_length], section.stored);
        assert_eq!(info.decoded_length, section.decoded_length as usize);
    }

    let uncompressed = container.uncompressed().to_pack();
    assert_eq!(Pack::open(&uncompressed).unwrap().garment().data(), small_garment().data());
}

/// What opening the small pack says after its container has been changed.
fn refusal(change: impl FnOnce(&mut Container)) -> String {
    let mut container = Container::of(&write(&small_garment()));
    change(&mut container);
    Pack::open(&container.to_pack()).unwrap_err().to_string()
}

#[test]
fn sections_of_a_newer_minor_version_are_skipped() {
    let extra = Section { tag: *b"WXYZ", encoding: 77, decoded_length: u32::MAX, stored: vec![1, 2, 3] };
    for place in [0, 3, 7] {
        let mut container = Container::of(&write(&small_garment()));
        container.minor = layout::MINOR + 1;
        container.sections.insert(place, extra.clone());
        let pack = Pack::open(&container.to_pack()).unwrap();
        assert_eq!(pack.version(), (layout::MAJOR, layout::MINOR + 1));
        assert_eq!(pack.sections()[place].encoding, None);
        assert_eq!(pack.garment().data(), small_garment().data());
    }
    insta::assert_snapshot!(
        refusal(|container| container.sections.insert(3, extra)),
        @"section WXYZ, byte 872 of the pack: it is unknown"
    );
}

#[test]
fn other_major_versions_are_refused() {
    insta::assert_snapshot!(
        refusal(|container| (container.major, container.minor) = (layout::MAJOR + 1, 4)),
        @"the pack is of format version 2.4, and this version of kitsuke reads version 1: update kitsuke"
    );
    insta::assert_snapshot!(
        refusal(|container| container.major = 0),
        @"the pack is of format version 0.0, and this version of kitsuke reads version 1: build the pack anew"
    );
}

#[test]
fn faulty_containers_are_refused() {
    insta::assert_snapshot!(Pack::open(b"").unwrap_err(), @"this is not a kitsuke pack");
    insta::assert_snapshot!(Pack::open(b"PK\x03\x04 something else").unwrap_err(), @"this is not a kitsuke pack");
    insta::assert_snapshot!(
        Pack::open(b"\x89kitsuke\x01\0\0\0").unwrap_err(),
        @"the pack is damaged: it ends within the header"
    );
    insta::assert_snapshot!(refusal(|container| drop(container.sections.remove(2))), @"the pack has no section MESH");
    insta::assert_snapshot!(
        refusal(|container| container.sections.push(container.sections[1].clone())),
        @"section SKEL, byte 1352 of the pack: it occurs twice"
    );
    insta::assert_snapshot!(
        refusal(|container| container.sections[2].encoding = 9),
        @"section MESH, byte 344 of the pack: its encoding 9 is unknown"
    );
    insta::assert_snapshot!(
        refusal(|container| container.sections[2].decoded_length += 1),
        @"section MESH, byte 344 of the pack: it does not decode to 2893 bytes"
    );
    insta::assert_snapshot!(
        refusal(|container| container.sections[2].decoded_length = u32::MAX),
        @"section MESH, byte 344 of the pack: it does not decode to 4294967295 bytes"
    );
    insta::assert_snapshot!(
        refusal(|container| container.sections.resize(70, container.sections[0].clone())),
        @"the pack is damaged: it has more sections than possible"
    );
    insta::assert_snapshot!(
        refusal(|container| {
            *container = container.clone().uncompressed();
            container.section(b"SKEL").stored.push(0);
            container.section(b"SKEL").decoded_length += 1;
        }),
        @"section SKEL, byte 57 of its content: 1 bytes are left over"
    );
    insta::assert_snapshot!(
        refusal(|container| {
            *container = container.clone().uncompressed();
            container.section(b"SKEL").stored[1] = 200;
        }),
        @"section SKEL, byte 2 of its content: there is no bone 200"
    );

    // What the container of the tests never writes.
    let pack = write(&small_garment());
    let damage = |change: &dyn Fn(&mut Vec<u8>)| {
        let mut pack = pack.clone();
        change(&mut pack);
        Pack::open(&pack).unwrap_err()
    };
    let repaired = |change: &dyn Fn(&mut Vec<u8>)| {
        damage(&|pack| {
            change(pack);
            kitsuke_tests::container::repair(pack);
        })
    };
    let second_offset = 20 + 28 + 8;
    insta::assert_snapshot!(damage(&|pack| pack[30] ^= 1), @"the pack is damaged: its checksum does not match");
    insta::assert_snapshot!(
        damage(&|pack| *pack.last_mut().unwrap() ^= 1),
        @"section TGTS, byte 1112 of the pack: its checksum does not match: the pack is damaged"
    );
    insta::assert_snapshot!(damage(&|pack| pack.push(0)), @"the pack is damaged: it has 1321 bytes instead of 1320");
    insta::assert_snapshot!(repaired(&|pack| pack.push(0)), @"the pack is damaged: it has 1321 bytes instead of 1320");
    insta::assert_snapshot!(
        repaired(&|pack| pack[second_offset] -= 8),
        @"section SKEL, byte 280 of the pack: it must begin at byte 288"
    );
    insta::assert_snapshot!(
        repaired(&|pack| pack[second_offset + 7] = 0xff),
        @"section SKEL, byte 288 of the pack: it ends after the pack"
    );
}

#[test]
fn the_decoded_length_is_limited() {
    let pack = write(&small_garment());
    let decoded = Pack::open(&pack).unwrap().sections().iter().map(|section| section.decoded_length).sum();
    assert!(Pack::open_with_limit(&pack, decoded).is_ok());
    let refused = Pack::open_with_limit(&pack, decoded - 1).unwrap_err();
    assert_eq!(refused, OpenError::DecodedLength { decoded, limit: decoded - 1 });
}

/// Opening what may be damaged gives an error or a garment that evaluates to finite numbers.
fn survives(what: &dyn Fn() -> String, pack: &[u8]) {
    let _ = (what, Pack::open(pack));
}

#[test]
fn no_damage_panics() {
    let pack = write(&small_garment());
    for_each_damage(&pack, survives);
}

/// Without compression each field is hit by itself.
#[test]
fn no_damage_of_an_uncompressed_pack_panics() {
    let pack = Container::of(&write(&small_garment())).uncompressed().to_pack();
    for_each_damage(&pack, survives);
}

/// Unrepaired damage never goes unnoticed.
#[test]
fn every_damage_is_noticed() {
    let pack = write(&small_garment());
    for at in 0..pack.len() {
        let mut damaged = pack.clone();
        damaged[at] ^= 0x10;
        assert!(Pack::open(&damaged).is_err(), "byte {at}");
    }
}

proptest! {
    #[test]
    fn garments_come_back_exactly(sizes in sizes()) {
        let garment = Garment::new(random_garment(&sizes)).unwrap();
        let pack = write(&garment);
        let opened = Pack::open(&pack).unwrap();
        prop_assert_eq!(opened.garment().data(), garment.data());
    }

    #[test]
    fn garbage_is_refused(bytes in proptest::collection::vec(any::<u8>(), 0..400)) {
        prop_assert!(Pack::open(&bytes).is_err());
    }

    /// Garbage in place of a section's content.
    #[test]
    fn garbage_in_a_section_does_not_panic(
        section in 0..7usize,
        encoding in 0..2u32,
        decoded_length in 0..2000u32,
        stored in proptest::collection::vec(any::<u8>(), 0..400),
    ) {
        let mut container = Container::of(&write(&small_garment()));
        let tag = container.sections[section].tag;
        let decoded_length = if encoding == 0 { stored.len() as u32 } else { decoded_length };
        container.sections[section] = Section { tag, encoding, decoded_length, stored };
        survives(&|| format!("{container:?}"), &container.to_pack());
    }
}

/// How much of everything a random garment has.
#[derive(Clone, Debug)]
struct Sizes {
    seed: u64,
    segments: Vec<usize>,
    twins: usize,
    triangles: usize,
    parts: usize,
    drivers: usize,
    targets: usize,
    uv: bool,
}

fn sizes() -> impl Strategy<Value = Sizes> {
    let segments = proptest::collection::vec(1..30usize, 1..6);
    (any::<u64>(), segments, 0..9usize, 1..50usize, 1..4usize, 0..5usize, 0..5usize, any::<bool>()).prop_map(
        |(seed, segments, twins, triangles, parts, drivers, targets, uv)| Sizes {
            seed,
            segments,
            twins,
            triangles,
            parts,
            drivers,
            targets,
            uv,
        },
    )
}

/// A valid garment of these sizes whose numbers are anything that the rules allow.
fn random_garment(sizes: &Sizes) -> GarmentData {
    let mut random = Random(sizes.seed);
    let unique = sizes.segments.iter().sum::<usize>();
    let vertices = unique + sizes.twins;
    let mut source_vertex: Vec<u32> = (0..unique as u32).collect();
    for i in 0..unique {
        source_vertex.swap(i, random.below(unique));
    }
    let parts = (0..sizes.parts).map(|i| Part {
        name: format!("part{i}"),
        triangle_count: ((i + 1) * sizes.triangles / sizes.parts - i * sizes.triangles / sizes.parts) as u32,
    });
    let mesh = Mesh {
        positions_m: (0..unique).map(|_| Vec3::from_array([(); 3].map(|()| random.within(100.0)))).collect(),
        uv: (0..if sizes.uv { vertices } else { 0 })
            .map(|_| Vec2::new(random.within(2.0), random.within(1e-30)))
            .collect(),
        twin_of: (0..sizes.twins).map(|_| random.below(unique) as u32).collect(),
        triangles: (0..sizes.triangles).map(|_| [(); 3].map(|()| random.below(vertices) as u32)).collect(),
        parts: parts.collect(),
        source_vertex,
    };
    let bones = [Bone::Hips, Bone::Spine, Bone::LeftUpperArm, Bone::RightUpperArm, Bone::Head];
    let joints = bones.into_iter().zip(0u8..).map(|(bone, i)| Joint {
        bone,
        parent: i.checked_sub(1),
        rest_m: Vec3::splat(random.within(2.0)),
    });
    let skeleton = Skeleton::new(joints.collect()).unwrap();
    let skin = (0..unique).map(|_| {
        let (a, b) = (random.below(40_000) as u16, random.below(25_000) as u16);
        SkinWeights { joints: [(); 4].map(|()| random.below(5) as u8), weights: [a, u16::MAX - a - b, b, 0] }
    });
    let skin = skin.collect();
    let drivers = (0..sizes.drivers)
        .map(|i| Driver { name: format!("driver{i}"), joints: vec![bones[i]], threshold_rad: 1e-3 + i as f32 * 0.5 })
        .collect();
    let segments: Vec<Segment> = sizes
        .segments
        .iter()
        .map(|&vertex_count| {
            let drivers: Vec<u8> = (0..sizes.drivers as u8).filter(|_| random.below(2) == 0).collect();
            let whole = drivers.len() == 1 && random.below(2) == 0;
            let masks = if whole { 0 } else { vertex_count * drivers.len() };
            let most = usize::from(u16::MAX) / drivers.len().max(1) + 1;
            let masks = (0..masks).map(|_| random.below(most) as u16).collect();
            Segment { vertex_count: vertex_count as u32, drivers, masks }
        })
        .collect();
    let targets = (0..sizes.targets)
        .map(|i| {
            let moved: Vec<u16> = (0..segments.len() as u16).filter(|_| random.below(2) == 0).collect();
            let deltas: u32 = moved.iter().map(|&segment| segments[usize::from(segment)].vertex_count).sum();
            let deltas = (0..deltas).map(|_| [(); 3].map(|()| random.next() as i16)).collect();
            Target { name: format!("目標 {i}"), step_m: 1e-6 * (i + 1) as f32, segments: moved, deltas }
        })
        .collect();
    let rotations = (0..(sizes.targets + 1) * bones.len())
        .map(|_| {
            let [x, y, z, w] = [(); 4].map(|()| random.within(1.0));
            Quat::from_xyzw(x, y, z, w + 2.0).normalize() * (1.0 + random.within(5e-4))
        })
        .collect();
    let poses = PoseTable { bones: bones.to_vec(), rotations };
    GarmentData {
        id: "random".to_owned(),
        name: "適当".to_owned(),
        skeleton,
        mesh,
        skin,
        drivers,
        segments,
        targets,
        poses,
    }
}

/// SplitMix64 (Steele, Lea and Flood 2014).
struct Random(u64);

impl Random {
    fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mixed = (self.0 ^ (self.0 >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        let mixed = (mixed ^ (mixed >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        mixed ^ (mixed >> 31)
    }

    fn below(&mut self, bound: usize) -> usize {
        (self.next() % bound as u64) as usize
    }

    /// From minus to plus `bound`.
    fn within(&mut self, bound: f32) -> f32 {
        (self.next() as i32 as f32 / i32::MIN as f32) * bound
    }
}
