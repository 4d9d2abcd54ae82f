//! Writing and opening packs: exact round trips, every version for ever, and hostile bytes.

use glam::Vec3;
use kitsuke::arrays::{Compression, GarmentData, Loss};
use kitsuke::pack::write::{write, write_with};
use kitsuke::pack::{ContentProblem, layout};
use kitsuke::skeleton::Pose;
use kitsuke::{Accessories, Frame, Garment, OpenError, Pack, Scratch, evaluate};
use kitsuke_tests::container::{Container, Section, for_each_damage};
use kitsuke_tests::{random, small_accessories, small_fit, small_garment};
use proptest::prelude::*;
use std::fs;
use std::io::Write;
use std::path::Path;

#[test]
fn the_small_garment_comes_back_exactly() {
    let garment = small_garment();
    let pack = write(&garment);
    assert!(pack.len() <= 20_000, "{} bytes", pack.len());
    assert_eq!(Pack::open(&pack).unwrap().garment().data(), garment.data());
    assert_eq!(write(&garment), pack, "the same garment gives the same bytes");
}

/// The small garment with what its compression lost.
fn with_losses() -> Garment {
    let loss = |number: usize| Loss { max_m: 1e-5 * number as f32, p99_m: 5e-6, above_half: 0.25 };
    let data = small_garment().data().clone();
    let targets = (0..data.sample_count()).map(loss).collect();
    let compression = Compression { budget_m: 2e-4, targets, poses: 500, surface: loss(9) };
    Garment::new(GarmentData { compression: Some(compression), ..data }).unwrap()
}

/// Version 5.0, and one pack of every version since: they stay and open for ever.
const V5: &[u8] = include_bytes!("../packs/v5_0.kitsuke");
const VERSIONS: [&[u8]; 4] = [
    V5,
    include_bytes!("../packs/v5_1.kitsuke"),
    include_bytes!("../packs/v5_2.kitsuke"),
    include_bytes!("../packs/v5_3.kitsuke"),
];

/// 5.1 brought what comes with a kimono, 5.2 what its compression lost, 5.3 other bytes for the fields of sizes.
#[test]
fn every_version_opens() {
    for (minor, bytes) in VERSIONS.into_iter().enumerate() {
        let pack = Pack::open(bytes).unwrap();
        assert_eq!(pack.version(), (5, minor as u16));
        let (garment, accessories) = match minor {
            0 => (small_garment(), Accessories::default()),
            1 => (small_garment(), small_accessories()),
            _ => (with_losses(), small_accessories()),
        };
        assert_eq!(pack.garment().data(), garment.data(), "5.{minor}");
        assert_eq!(pack.fit_data(), Ok(Some(small_fit())), "5.{minor}");
        assert_eq!(*pack.accessories(), accessories, "5.{minor}");
    }
    assert_eq!(VERSIONS.len(), usize::from(layout::MINOR) + 1, "one pack of every version");
    assert_eq!(write_with(&with_losses(), &small_accessories(), Some(&small_fit())).unwrap(), VERSIONS[3]);
}

#[test]
#[ignore = "to be run once per version of the format, before its pack is committed"]
fn write_the_pack_of_this_version() {
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("packs").join(format!(
        "v{}_{}.kitsuke",
        layout::MAJOR,
        layout::MINOR
    ));
    let mut file = fs::File::create_new(file).expect("released packs are never written again");
    file.write_all(&write_with(&with_losses(), &small_accessories(), Some(&small_fit())).unwrap()).unwrap();
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
    let mut container = Container::of(V5);
    change(&mut container);
    Pack::open(&container.to_pack()).unwrap_err().to_string()
}

#[test]
fn sections_of_a_newer_minor_version_are_skipped() {
    let extra = Section { tag: *b"WXYZ", encoding: 77, decoded_length: u32::MAX, stored: vec![1, 2, 3] };
    for place in [0, 3, layout::REQUIRED.len()] {
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
        @"section WXYZ, byte 1400 of the pack: it is unknown"
    );
}

#[test]
fn other_major_versions_are_refused() {
    insta::assert_snapshot!(
        refusal(|container| (container.major, container.minor) = (layout::MAJOR + 1, 4)),
        @"the pack is of format version 6.4, and this version of kitsuke reads version 5: update kitsuke"
    );
    insta::assert_snapshot!(
        refusal(|container| container.major = 0),
        @"the pack is of format version 0.0, and this version of kitsuke reads version 5: build the pack anew"
    );
}

#[test]
fn faulty_containers_are_refused() {
    insta::assert_snapshot!(Pack::open(b"").unwrap_err(), @"this is not a kitsuke pack");
    insta::assert_snapshot!(Pack::open(b"PK\x03\x04 something else").unwrap_err(), @"this is not a kitsuke pack");
    insta::assert_snapshot!(
        Pack::open(b"\x89kitsuke\x05\0\0\0").unwrap_err(),
        @"the pack is damaged: it ends within the header"
    );
    insta::assert_snapshot!(refusal(|container| drop(container.sections.remove(2))), @"the pack has no section MESH");
    insta::assert_snapshot!(
        refusal(|container| container.sections.push(container.sections[1].clone())),
        @"section SKEL, byte 3400 of the pack: it occurs twice"
    );
    insta::assert_snapshot!(
        refusal(|container| container.sections[2].encoding = 9),
        @"section MESH, byte 488 of the pack: its encoding 9 is unknown"
    );
    insta::assert_snapshot!(
        refusal(|container| container.sections[2].decoded_length += 1),
        @"section MESH, byte 488 of the pack: it does not decode to 1747 bytes"
    );
    insta::assert_snapshot!(
        refusal(|container| container.sections[2].decoded_length = u32::MAX),
        @"section MESH, byte 488 of the pack: it does not decode to 4294967295 bytes"
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
        @"section SKEL, byte 61 of its content: bytes left over: 1"
    );
    insta::assert_snapshot!(
        refusal(|container| {
            *container = container.clone().uncompressed();
            container.section(b"SKEL").stored[1] = 200;
        }),
        @"section SKEL, byte 2 of its content: there is no bone 200"
    );

    // What the container of the tests never writes.
    let damage = |change: &dyn Fn(&mut Vec<u8>)| {
        let mut pack = V5.to_vec();
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
        @"section SZUV, byte 3176 of the pack: its checksum does not match: the pack is damaged"
    );
    insta::assert_snapshot!(damage(&|pack| pack.push(0)), @"the pack is damaged: it has 3372 bytes instead of 3371");
    insta::assert_snapshot!(repaired(&|pack| pack.push(0)), @"the pack is damaged: it has 3372 bytes instead of 3371");
    insta::assert_snapshot!(
        repaired(&|pack| pack[second_offset] -= 8),
        @"section SKEL, byte 424 of the pack: it must begin at byte 432"
    );
    insta::assert_snapshot!(
        repaired(&|pack| pack[second_offset + 7] = 0xff),
        @"section SKEL, byte 432 of the pack: it ends after the pack"
    );
}

/// What a garment leaves of the limit is what its fit may decode to.
#[test]
fn the_decoded_length_of_a_fit_is_limited() {
    let limits = || (1000..100_000).step_by(500);
    let opens = |&limit: &usize| Pack::open_with_limit(V5, limit).is_ok();
    let fits = |&limit: &usize| Pack::open_with_limit(V5, limit).is_ok_and(|pack| pack.fit_data().is_ok());
    let (opened, fitted) = (limits().find(opens).unwrap(), limits().find(fits).unwrap());
    assert!(opened < fitted, "{opened} and {fitted}");
    let refused = Pack::open_with_limit(V5, opened).unwrap().fit_data().unwrap_err();
    assert!(matches!(refused, OpenError::Content { problem: ContentProblem::DecodedLength { .. }, .. }), "{refused}");
}

#[test]
fn the_decoded_length_is_limited() {
    let pack = write(&small_garment());
    let opened = Pack::open(&pack).unwrap();
    let unpacked = opened.sections().iter().map(|section| section.unpacked_length).sum();
    assert!(Pack::open_with_limit(&pack, unpacked).is_ok());
    let refused = Pack::open_with_limit(&pack, unpacked - 1).unwrap_err();
    assert!(matches!(refused, OpenError::Content { problem: ContentProblem::DecodedLength { .. }, .. }), "{refused}");
    let decoded = opened.sections().iter().map(|section| section.decoded_length).sum();
    let refused = Pack::open_with_limit(&pack, decoded - 1).unwrap_err();
    assert_eq!(refused, OpenError::DecodedLength { decoded, limit: decoded - 1 });
}

/// Whether these bytes open; if so, frames of the garment must be finite.
fn opens(what: &dyn Fn() -> String, pack: &[u8]) -> bool {
    let Ok(pack) = Pack::open(pack) else { return false };
    let garment = pack.garment();
    let mut scratch = Scratch::new(garment);
    let mut numbers = random::Numbers(7);
    for pose in [Pose::REST, numbers.pose(), numbers.pose(), numbers.pose()] {
        let mut positions_m = vec![Vec3::NAN; garment.vertex_count()];
        let mut normals = positions_m.clone();
        evaluate(garment, &pose, &mut scratch, Frame { positions_m: &mut positions_m, normals: &mut normals });
        let is_finite = positions_m.iter().chain(&normals).all(|vector| vector.is_finite());
        assert!(is_finite, "{}: not finite in {pose:?}", what());
    }
    true
}

/// Damages the pack in every way; how many of the results open nevertheless.
fn damages_that_open(pack: &[u8]) -> usize {
    let mut opened = 0;
    for_each_damage(pack, |what, damaged| opened += usize::from(opens(what, damaged)));
    opened
}

#[test]
fn damage_gives_an_error_or_finite_frames() {
    let pack = write(&small_garment());
    assert!(damages_that_open(&pack) > 500, "damage must reach the frames, too");
    // Without compression each field is hit by itself.
    let uncompressed = Container::of(V5).uncompressed().to_pack();
    assert!(damages_that_open(&uncompressed) > 5_000, "damage must reach the frames, too");
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
    fn garments_come_back_exactly(seed in any::<u64>()) {
        let garment = random::garment(seed);
        let opened = Pack::open(&write(&garment)).unwrap();
        // Not with `prop_assert_eq!`, which would print both garments.
        prop_assert!(opened.garment().data() == garment.data());
    }

    #[test]
    fn garbage_is_refused(bytes in proptest::collection::vec(any::<u8>(), 0..400)) {
        prop_assert!(Pack::open(&bytes).is_err());
    }

    /// Garbage in place of a section's content.
    #[test]
    fn garbage_in_a_section_does_not_panic(
        section in 0..layout::REQUIRED.len(),
        encoding in 0..2u32,
        decoded_length in 0..2000u32,
        stored in proptest::collection::vec(any::<u8>(), 0..400),
    ) {
        let mut container = Container::of(V5);
        let tag = container.sections[section].tag;
        let decoded_length = if encoding == 0 { stored.len() as u32 } else { decoded_length };
        container.sections[section] = Section { tag, encoding, decoded_length, stored };
        opens(&|| format!("{container:?}"), &container.to_pack());
    }
}
