//! The container of a pack, read and written once more from its specification (`kitsuke::pack::layout`) with plain
//! numbers, so that tests can take packs apart, damage them, and put them together with valid checksums.

use xxhash_rust::xxh3::xxh3_64;

/// A pack's header and sections. Offsets, lengths and checksums follow from them.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Container {
    /// Major version.
    pub major: u16,
    /// Minor version.
    pub minor: u16,
    /// The sections in their order.
    pub sections: Vec<Section>,
}

/// A section as stored.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Section {
    /// Four letters.
    pub tag: [u8; 4],
    /// 0 as it is, 1 LZ4.
    pub encoding: u32,
    /// Decoded length as stated.
    pub decoded_length: u32,
    /// The stored bytes.
    pub stored: Vec<u8>,
}

impl Container {
    /// Takes a sound pack apart.
    #[must_use]
    pub fn of(pack: &[u8]) -> Container {
        let sections = (0..u32_at(pack, 12) as usize).map(|i| {
            let entry = &pack[20 + 28 * i..][..28];
            let (offset, length) = (u32_at(entry, 8) as usize, u32_at(entry, 12) as usize);
            Section {
                tag: entry[..4].try_into().expect("4 bytes"),
                encoding: u32_at(entry, 4),
                decoded_length: u32_at(entry, 16),
                stored: pack[offset..offset + length].to_vec(),
            }
        });
        Container { major: u16_at(pack, 8), minor: u16_at(pack, 10), sections: sections.collect() }
    }

    /// Puts it together.
    #[must_use]
    pub fn to_pack(&self) -> Vec<u8> {
        let mut pack = b"\x89kitsuke".to_vec();
        pack.extend(self.major.to_le_bytes());
        pack.extend(self.minor.to_le_bytes());
        pack.extend((self.sections.len() as u32).to_le_bytes());
        pack.resize(20 + 28 * self.sections.len() + 8, 0);
        for (i, section) in self.sections.iter().enumerate() {
            pack.resize(pack.len().next_multiple_of(8), 0);
            let offset = pack.len() as u32;
            pack.extend(&section.stored);
            let entry = &mut pack[20 + 28 * i..][..28];
            entry[..4].copy_from_slice(&section.tag);
            for (at, number) in
                [(4, section.encoding), (8, offset), (12, section.stored.len() as u32), (16, section.decoded_length)]
            {
                entry[at..at + 4].copy_from_slice(&number.to_le_bytes());
            }
        }
        repair(&mut pack);
        pack
    }

    /// The same with no section compressed.
    #[must_use]
    pub fn uncompressed(mut self) -> Container {
        for section in self.sections.iter_mut().filter(|section| section.encoding == 1) {
            let decoded = lz4_flex::block::decompress(&section.stored, section.decoded_length as usize);
            section.stored = decoded.expect("sound sections decode");
            section.encoding = 0;
        }
        self
    }

    /// A section by its name.
    pub fn section(&mut self, tag: &[u8; 4]) -> &mut Section {
        self.sections.iter_mut().find(|section| section.tag == *tag).expect("the section is there")
    }
}

/// Makes the stated length and every checksum of a damaged pack right again, as far as there is a place for them.
pub fn repair(pack: &mut [u8]) {
    if pack.len() < 20 {
        return;
    }
    let length = pack.len() as u32;
    pack[16..20].copy_from_slice(&length.to_le_bytes());
    let table_end = (u32_at(pack, 12) as usize).saturating_mul(28).saturating_add(20);
    if table_end > pack.len() {
        return;
    }
    for entry in (20..table_end).step_by(28) {
        let (offset, length) = (u32_at(pack, entry + 8) as usize, u32_at(pack, entry + 12) as usize);
        if let Some(stored) = pack.get(offset..offset.saturating_add(length)) {
            let checksum = xxh3_64(stored);
            pack[entry + 20..entry + 28].copy_from_slice(&checksum.to_le_bytes());
        }
    }
    let checksum = xxh3_64(&pack[..table_end]);
    if let Some(place) = pack.get_mut(table_end..table_end + 8) {
        place.copy_from_slice(&checksum.to_le_bytes());
    }
}

/// The pack cut off at every byte, with every byte changed in several ways, and with every bit of header and section table flipped; each
/// once as it is and once repaired. Calls `check` with what was done and the damaged pack.
pub fn for_each_damage(pack: &[u8], mut check: impl FnMut(&dyn Fn() -> String, &[u8])) {
    let mut both = |what: &dyn Fn() -> String, damaged: &mut [u8]| {
        check(what, damaged);
        repair(damaged);
        check(&|| format!("{}, repaired", what()), damaged);
    };
    for length in 0..pack.len() {
        both(&|| format!("cut off at byte {length}"), &mut pack[..length].to_vec());
    }
    let mut damaged = pack.to_vec();
    let table_end = 20 + 28 * u32_at(pack, 12) as usize + 8;
    for at in 0..pack.len() {
        let bits: [u8; 8] = std::array::from_fn(|bit| 1 << bit);
        let flips = if at < table_end { &bits[..] } else { &[0x01, 0x80] };
        for &flip in [0xff].iter().chain(flips) {
            damaged.copy_from_slice(pack);
            damaged[at] ^= flip;
            both(&|| format!("byte {at} ^ {flip:#x}"), &mut damaged);
        }
    }
}

fn u16_at(bytes: &[u8], at: usize) -> u16 {
    u16::from_le_bytes(bytes[at..at + 2].try_into().expect("2 bytes"))
}

fn u32_at(bytes: &[u8], at: usize) -> u32 {
    u32::from_le_bytes(bytes[at..at + 4].try_into().expect("4 bytes"))
}
