//! Held against bytes that meshoptimizer 1.3.0 (npm) wrote and read again, and against damage.

use super::*;
use proptest::prelude::*;

/// Mode, filter, count and stride; what `MeshoptEncoder` wrote of a few waves, grids and random rows, and what `MeshoptDecoder` read of it.
#[rustfmt::skip]
const WRITTEN: [(Mode, Filter, usize, usize, &str, &str); 34] = [
    (Mode::Attributes, Filter::None, 5, 4, concat!("a0013fc0000075498a71013fc000007d98a439013fc00000498abf1f013fc00000832fb13900000000000000000000000000", "000000000000000000000000000000832c2725"), "832c272548ed02e3233947cb688be7722f6ed755"),
    (Mode::Attributes, Filter::None, 5, 4, "a1ff009e5a2353007036038b00f21434c3001cd2e79f00000000000000000000000000000000000000409a1bf600", "409a1bf68fd29404bced9e6daaebb8f980a556a9"),
    (Mode::Attributes, Filter::None, 5, 4, concat!("a0010fc0000003040301374000000606013bc00000060804013ec00000040a06000000000000000000000000000000000000", "0000000000000000000002000001"), "0200000102030303000204080205080900040a0c"),
    (Mode::Attributes, Filter::None, 5, 4, "a1ff0001020300000206020000040604020006060606000000000000000000000000000000000000000200010200", "0200010201010305020406080005080b0005090e"),
    (Mode::Attributes, Filter::None, 5, 4, concat!("a0013fc00000684069c7013fc00000d8f02b75013fc0000072fa986001380000000800000000000000000000000000000000", "0000000000000000000000005ed69539"), "5ed695399242ce3db2ba4b3e7da4973e1969c73e"),
    (Mode::Attributes, Filter::None, 5, 4, "a17f00acd4938a004f371de50090fc98600002000800000000000000000000000000000000000000de30853901", "de308539b458cd3d9e744b3ed465973e99d8c73e"),
    (Mode::Attributes, Filter::None, 5, 4, concat!("a0013fc00000737f755f010a800000013fc000006d6f856b010a800000000000000000000000000000000000000000000000", "000000000000000f001100"), "0f001100d500da009501a2015a025f022a032903"),
    (Mode::Attributes, Filter::None, 5, 4, "a1ff007b715389000002020200698f69570000020202000000000000000000000000000000000000000900100000", "09001000cb00db009201930168025e0223033203"),
    (Mode::Attributes, Filter::None, 5, 4, "a0000000000000000000000000000000000000000000000000000000000000000007070707", "0707070707070707070707070707070707070707"),
    (Mode::Attributes, Filter::None, 5, 4, "a1aa000000000000000000000000000000000000000707070700", "0707070707070707070707070707070707070707"),
    (Mode::Attributes, Filter::None, 5, 4, "a000010fc000000fcfef0128c000000400000000000000000000000000000000000000000000000000000000000050813f", "0050813f0050823f0048833f00e0833f0068853f"),
    (Mode::Attributes, Filter::None, 5, 4, "a1ba00c5dfda31000000000000000000000000000000000000000070853f52", "0070853f0058833f00a0853f0070833f00f8823f"),
    (Mode::Attributes, Filter::None, 20, 4, concat!("a1ff00892ea81da2aec824399c9425ad8b285ceb9eed000d7681fa355ea4979993c287db13df54a6aa7c0015268b7f7e1ca5", "98fb5de1fd26790e2cb49af100bcd4b80e60ce84d1e7d240cf2df5ad2bece91b000000000000000000000000000000000000", "00d530fdbd00"), concat!("d530fdbd9029f21ba7640585fb23bfe1eca07fe83d85be1894b4cc7ff80679c10abac558ed6d47e43b23184d8584a76d7240", "28051bd23beed5c8fe73e958051c17821b06a1d5757cf02ac207796849f9")),
    (Mode::Attributes, Filter::None, 20, 4, concat!("a00505081c6504d8000000040600241406216020422e00000006060080804808226248be000000040406088482882a664866", "bf0000000806080000000000000000000000000000000000000000000000000000000002020200"), concat!("0202020002020204010306080005060a00040a0e00060a0f01060c1301091017010a10180009141d020c1520020c1623010d", "1925020d1a29010f1c2c0010202f0210213001112334021425370215263b")),
    (Mode::Attributes, Filter::None, 20, 4, concat!("a155011927cf2204030403020003020042041612260416050002040204804466226284060f000402040602064a284684a44a", "640f0004080406000000000000000000000000000000000000000102000100"), concat!("0102000100020204010406060005060b0005080c01070a1000060d1202091015000811190009121b020a1520000d1622000d", "1a24010f1c29010e1c2c02111f2e02122130001222340014243600142739")),
    (Mode::Attributes, Filter::None, 20, 4, concat!("a00700bbe9b409ae30e0d547be8af37f52dbff0000004282c11e07001cd4ec43940a986b872c85b8199970ff000000dc04fb", "95070072fe96605c362a24221e1a14100c06bf00000003090d01380800000e00000000000000000000000000000000000000", "0000000000000000000ca29436"), concat!("0ca29436aeb0cd3d391a4c3e9390973e8e6ec73ee5b8f53efdbd103f6d09253f02d3373fde8f483f3da5573f8262643f08be", "6e3fc8b1763ff1647c3f839c7f3fa40a803fe50c7e3f848e793f9343723f")),
    (Mode::Attributes, Filter::None, 20, 4, concat!("a13f00eec8f0138460ea9d81afc9f82ed61aa00ae6f20094fff06f337ed9e7444f2fa873e582f607994000720096605c362a", "24221e1a14100c060203090d0106000a01000000000000000000000000000000000000009157933801"), concat!("9157933808a2cc3dec214c3e649a973eda62c73e9c7cf53eccbb103fc128253ff2b4373fb192483fd96a573ff452643f70a7", "6e3f07e1763ff2537c3fff947f3f4f10803fd4137e3fc760793f4081723f")),
    (Mode::Attributes, Filter::None, 20, 4, concat!("a007007d6b716f715b83636771934b8d5f5fff0000008f67676f050a8aa2a2a80000000700716b6f776f656f6f657159895f", "6d6bff0000006f696b77050a8aa2a8a800000000000000000000000000000000000000000000000000000000000000100008", "00"), concat!("10000800d100cf009b019901620261022a032503f103ed03c304ba04810582054f064a061b071707e207de079808b1087209", "6c092b0a3c0afb0a050bcb0bcf0b830c970c4f0d620d1b0e2c0ee30ef00e")),
    (Mode::Attributes, Filter::None, 20, 4, concat!("a17700696d797f53934d837b5b77755f71618f714d79050a8aa2a2a800000000736d658f5d5b6d8f5b5f79775969936b5f5f", "81050a8aa2a8a8000000000000000000000000000000000000000000000d00120000"), concat!("0d001200d800d800a101a10164026e0224032603fa03f703b004c9048905920547064a0609071c07db07ec079f08af086409", "7309340a460afb0a110bca0bc70b820c910c490d610d220e310ee50ef00e")),
    (Mode::Attributes, Filter::None, 20, 4, "a0000000000000000000000000000000000000000000000000000000000000000007070707", concat!("0707070707070707070707070707070707070707070707070707070707070707070707070707070707070707070707070707", "070707070707070707070707070707070707070707070707070707070707")),
    (Mode::Attributes, Filter::None, 20, 4, "a1aa000000000000000000000000000000000000000707070700", concat!("0707070707070707070707070707070707070707070707070707070707070707070707070707070707070707070707070707", "070707070707070707070707070707070707070707070707070707070707")),
    (Mode::Attributes, Filter::None, 20, 4, concat!("a0000700ef9030704fbf3fe0cf1f8040209ff03f0000001f10a0060022309660176125f30000000809040000000000000000", "0000000000000000000000000000000000000000000028853f"), concat!("0028853f00b0853f00f8863f0010873f0048853f0020853f00c0803f00a0833f0010863f00a8863f0098853f00d8813f00f8", "843f0008833f00b8843f0030813f0030853f0020803f0028803f0078823f")),
    (Mode::Attributes, Filter::None, 20, 4, "a1ba007296b445da9a80220023342454f9047af4a8f40000000000000000000000000000000000000000c0833f52", concat!("00c0833f0050803f00e0843f0040813f0068833f00b8853f0068813f0068853f0078843f0078843f0060853f00c0843f00e0", "853f0040873f0088803f00a8803f0078833f00d8843f0098813f0038863f")),
    (Mode::Attributes, Filter::Octahedral, 3, 4, "a1ef004593002a4e00030400000000000000000000000000000000000000ad317f8100", "923ef981aa0ea47f1d64b781"),
    (Mode::Attributes, Filter::Octahedral, 3, 8, "a1ffba0082e100478f0063ab002a50000304000000000000000000000000000096acd931ff7f01800001", "0391513f86f801806da9570daca2ff7ffc1ba9640eb60180"),
    (Mode::Attributes, Filter::Quaternion, 3, 8, "a1ffbf00db8300061100116c0005010093b0001d1c0006050000000000000000000000000000c1002a000f07fc070000", "9e638908db01e54fa02581df29aeee544449d7bc92d63245"),
    (Mode::Attributes, Filter::Exponential, 3, 12, concat!("a1ffffff00d2190000d600000200181400eada0007c900000100121700711300923800020000161b00000000000000000011", "cfffe58c3d00eae5d8ffed000000"), "00bcc3b80030763b006c9cbc0018c2be0004e43f00b0064200b4e9430048aeb90088763b"),
    (Mode::Attributes, Filter::Exponential, 3, 12, concat!("a1ffffef0086fb00045800020000100a00861900030800000200100a00e3a100267b00100a00000000000000000091ffffee", "cafeffeec32b00ee000000"), "0000deb900009bba000c2f3d0000ea3e00c07cbf004479410058b5430000000000000000"),
    (Mode::Attributes, Filter::Colour, 3, 4, "a1ff00086200c81800746f00083c0000000000000000000000000000000000000066b3008d00", "1966b31b47a41923bc9d765f"),
    (Mode::Attributes, Filter::Colour, 3, 8, concat!("a1ffff009e6a000864003fbb00ca1800eb5c00766f00512b00063e00000000000000000000000000007d66b3b2f6ff248d00", "00"), "3a197366d4b3481adf474ca5b918f72188bcaf9e1e76cb5f"),
    (Mode::Triangles, Filter::None, 24, 2, "e1fe1eff1efe1e100e0f0eff8410020c0f9110007687566778a9866589689801690000", "0000010007000700010008000a040b04110411040b041204020003000900090003000a000a00030004000a0004000b00"),
    (Mode::Indices, Filter::None, 24, 2, "d1000418161c02a9200519171d03120418161c02160418161c0200000000", "0000010007000100080007000a040b0411040b041204110402000300090003000a000900030004000a0004000b000a00"),
    (Mode::Triangles, Filter::None, 24, 4, "e1fe1eff1efe1e100e0f0eff8410020c0f9110007687566778a9866589689801690000", concat!("0000000001000000070000000700000001000000080000000a0400000b04000011040000110400000b040000120400000200", "0000030000000900000009000000030000000a0000000a00000003000000040000000a000000040000000b000000")),
    (Mode::Indices, Filter::None, 24, 4, "d1000418161c02a9200519171d03120418161c02160418161c0200000000", concat!("0000000001000000070000000100000008000000070000000a0400000b040000110400000b04000012040000110400000200", "00000300000009000000030000000a0000000900000003000000040000000a000000040000000b0000000a000000")),
];

const FILTERS: [Filter; 5] =
    [Filter::None, Filter::Octahedral, Filter::Quaternion, Filter::Exponential, Filter::Colour];

fn bytes(hex: &str) -> Vec<u8> {
    hex.as_bytes().chunks(2).map(|two| u8::from_str_radix(std::str::from_utf8(two).unwrap(), 16).unwrap()).collect()
}

#[test]
fn what_meshoptimizer_wrote_is_read_as_it_reads_it() {
    for (mode, filter, count, stride, written, read) in WRITTEN {
        let own = decoded(&bytes(written), mode, filter, count, stride);
        assert_eq!(own, Ok(bytes(read)), "{mode:?} {filter:?} {count} {stride}");
    }
}

#[test]
fn what_is_cut_off_or_too_long_is_refused() {
    for (mode, filter, count, stride, written, _) in WRITTEN {
        let written = bytes(written);
        let refused = |bytes: &[u8], count| decoded(bytes, mode, filter, count, stride).expect_err("damaged");
        refused(&[], count);
        refused(&written[..written.len() - 1], count);
        // More rows than the bytes can hold are refused before memory is taken.
        refused(&written, usize::MAX / 96 * 3);
        let (header, rest) = written.split_at(1);
        refused(&[header, &[0], rest].concat(), count);
        refused(&[&[0x11], rest].concat(), count);
    }
    let rows = |mode, filter, stride| decoded(&[0xa0; 64], mode, filter, 3, stride).unwrap_err();
    for stride in [0, 2, 6, 260] {
        assert!(rows(Mode::Attributes, Filter::None, stride).contains("width"));
    }
    assert!(rows(Mode::Attributes, Filter::Octahedral, 12).contains("width"));
    assert!(rows(Mode::Triangles, Filter::None, 8).contains("width"));
    assert!(rows(Mode::Indices, Filter::Colour, 4).contains("no filter"));
}

#[test]
fn the_first_version_of_triangles_remembers_two_vertices_more() {
    // Three new vertices, then eleven times the last edge and a new one: 14 in all. Then the last edge and the vertex 13 before the last.
    let mut written = vec![0xe0, 0xf0];
    written.extend([0; 11]);
    written.push(0x0d);
    written.extend([0; 16]);
    let indices = decoded(&written, Mode::Triangles, Filter::None, 39, 2).unwrap();
    assert_eq!(indices[..6], [0, 0, 1, 0, 2, 0]);
    assert_eq!(indices[72..], [0, 0, 13, 0, 0, 0]);
    written[0] = 0xe1;
    let indices = decoded(&written, Mode::Triangles, Filter::None, 39, 4).unwrap();
    assert_eq!(indices[152..], u32::MAX.to_le_bytes());
}

#[test]
fn triangles_that_refer_to_none_before_them_are_refused() {
    let refused = |codes: &[u8], data: &[u8], table: u8| {
        let mut tail = [0; 16];
        tail[0] = table;
        decoded(&[&[0xe1], codes, data, &tail].concat(), Mode::Triangles, Filter::None, 3 * codes.len(), 4).unwrap_err()
    };
    assert!(refused(&[0x00], &[], 0).contains("none before it"));
    assert!(refused(&[0xf0, 0x30], &[], 0).contains("none before it"));
    assert!(refused(&[0xf0, 0x03], &[], 0).contains("none before it"));
    assert!(refused(&[0xf0], &[], 0x10).contains("none before it"));
    assert!(refused(&[0xf0], &[], 0xf0).contains("table"));
    assert!(refused(&[0xff], &[0xff, 0x80, 0x80, 0x80, 0x80, 0x80], 0).contains("does not end"));
    assert!(refused(&[0xff], &[0xff, 2, 2], 0).contains("end early"));
}

proptest! {
    #[test]
    fn no_bytes_make_it_panic(
        header in prop::sample::select(vec![0xa0, 0xa1, 0xe0, 0xe1, 0xd0, 0xd1, 0]),
        garbage in prop::collection::vec(any::<u8>(), 0..600),
        count in 0_usize..700,
        stride in prop::sample::select(vec![2_usize, 4, 8, 12, 64, 256]),
    ) {
        let mut written = vec![header];
        written.extend(garbage);
        for mode in [Mode::Attributes, Mode::Triangles, Mode::Indices] {
            for filter in FILTERS {
                if let Ok(rows) = decoded(&written, mode, filter, count, stride) {
                    prop_assert_eq!(rows.len(), count * stride);
                }
            }
        }
    }

    /// Literal deltas reach the filters with any rows whatever.
    #[test]
    fn no_rows_make_a_filter_panic(rows in prop::collection::vec(any::<[u8; 8]>(), 1..40)) {
        for filter in FILTERS {
            for stride in [4, 8] {
                let mut own = rows.concat();
                unfilter(&mut own, filter, if filter == Filter::Quaternion { 8 } else { stride });
                prop_assert_eq!(own.len(), 8 * rows.len());
            }
        }
    }

    #[test]
    fn no_damage_makes_it_panic(which in 0..WRITTEN.len(), at in any::<prop::sample::Index>(), byte in any::<u8>()) {
        let (mode, filter, count, stride, written, _) = WRITTEN[which];
        let mut written = bytes(written);
        let at = at.index(written.len());
        written[at] = byte;
        if let Ok(rows) = decoded(&written, mode, filter, count, stride) {
            prop_assert_eq!(rows.len(), count * stride);
        }
    }
}
