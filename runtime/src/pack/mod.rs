//! The pack: a garment as bytes. Opening checks everything once; what a pack contains stands in [`layout`], how numbers
//! are stored in [`codec`]. Knows nothing of files or frames.
//!
//! # Limits
//! A pack is hostile input. What lies beyond these limits is refused, counts before memory is taken for what they count.
//!
//! | what | at most |
//! |---|---|
//! | bytes of a pack | 256 MiB ([`limits::PACK_BYTES`]) |
//! | bytes that n bytes decode to, garment, accessories and fit together | 255 n, 512 MiB ([`limits::DECODED_BYTES`]), and the limit of [`Pack::open_with_limit`] |
//! | memory of [`Pack::open`] | 3 times as much and 2 MiB |
//! | memory of `Pack::fit_data` beside the open pack | 8 times as much and 2 MiB |
//! | sections | 64 ([`layout::SECTIONS`]) |
//! | vertices with seam twins, triangles, parts | 2²², 2²³, 256 |
//! | targets, drivers and layers, segments | 4096, 32, 4096 |
//! | poses between the samples, joints in a chain | 1024 of all groups, 16 |
//! | pose limits, their joints, their bounds | 8, 8, 1024 |
//! | bytes of a name | 256 |
//! | coordinates, texture coordinates | ±100 m, ±1024 |
//! | sizes, dimensions, rule sets | 127, 256, 64 |
//! | deltas of all sizes' fields | 2²⁵ |
//! | dimensions, checks and limits of a rule set; steps of a program | 256 each; 1024 |
//! | vertices and triangles of the obi, paths | 2¹⁸ and 2¹⁹, 256 |
//! | texture | 16384 pixels a side, 64 MiB |

pub mod codec;
mod field;
pub mod layout;
mod rans;
#[cfg(feature = "fit")]
mod residuals;
#[cfg(feature = "write")]
pub mod write;

use crate::accessories::{Accessories, InvalidAccessories};
use crate::arrays::{GarmentData, InvalidGarment, limits};
#[cfg(feature = "fit")]
use crate::fit::{FitData, InvalidFit};
use crate::garment::Garment;
use crate::skeleton::SkeletonError;
use codec::{Encoding, Reader};
use layout::{Entry, Info, Tag};

/// No pack decodes to more than this many times its length.
const EXPANSION: usize = codec::LZ4_EXPANSION;

/// An open pack.
#[derive(Clone, Debug)]
pub struct Pack {
    version: (u16, u16),
    sections: Vec<SectionInfo>,
    garment: Garment,
    accessories: Accessories,
    /// The sections of a fit as they are stored.
    #[cfg(feature = "fit")]
    fit: Vec<(SectionInfo, Vec<u8>)>,
    /// Bytes that the arrays in them may decode to: what the garment has left.
    #[cfg(feature = "fit")]
    fit_allowed: usize,
}

/// What the section table of a pack says.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SectionInfo {
    /// The section's name.
    pub tag: Tag,
    /// How it is stored; `None` in a section of a newer version.
    pub encoding: Option<Encoding>,
    /// Where it begins, bytes.
    pub offset: usize,
    /// Bytes in the pack.
    pub stored_length: usize,
    /// Bytes once decoded.
    pub decoded_length: usize,
    /// Bytes once the arrays in it are decoded, too.
    pub unpacked_length: usize,
}

impl Pack {
    /// Opens a pack and checks everything in it. The bytes are not needed afterwards.
    ///
    /// # Errors
    /// When the bytes are no pack, are damaged, or break a limit or rule; says which section and element, and why.
    /// Nothing in a pack, however wrong, makes it panic.
    ///
    /// # Memory
    /// Opening n bytes never holds more than 3 × min(255 n, [`limits::DECODED_BYTES`]) + 2 MiB.
    pub fn open(bytes: &[u8]) -> Result<Pack, OpenError> {
        Pack::open_with_limit(bytes, limits::DECODED_BYTES)
    }

    /// [`Pack::open`] with a smaller limit, `decoded_bytes`, for all decoded sections together, those of [`Pack::fit_data`] included.
    ///
    /// # Errors
    /// As [`Pack::open`].
    pub fn open_with_limit(bytes: &[u8], decoded_bytes: usize) -> Result<Pack, OpenError> {
        let (version, entries) = layout::read_header(bytes)?;
        let mut sections = check_sections(bytes, version, &entries)?;
        let limit = decoded_bytes.min(EXPANSION.saturating_mul(bytes.len()));
        let allowed = check_decoded_length(&sections, limit)?;
        let mut sections_read = Sections { bytes, sections: &mut sections, allowed };
        let garment = Garment::new(read_garment(&mut sections_read)?)?;
        let accessories = read_accessories(&mut sections_read, &garment)?;
        #[cfg(feature = "fit")]
        let fit_allowed = sections_read.allowed;
        Ok(Pack {
            version,
            garment,
            accessories,
            #[cfg(feature = "fit")]
            fit: stored_fit(bytes, &sections),
            #[cfg(feature = "fit")]
            fit_allowed,
            sections,
        })
    }

    /// What fitting the garment to a wearer needs, decoded and checked; `None` when it has no sizes.
    ///
    /// # Errors
    /// When these sections are wrong, or decode to more than the limit with which the pack was opened has left; says which and what.
    ///
    /// # Memory
    /// Beside the open pack of n bytes never more than 8 × min(255 n, [`limits::DECODED_BYTES`]) + 2 MiB.
    #[cfg(feature = "fit")]
    pub fn fit_data(&self) -> Result<Option<FitData>, OpenError> {
        if self.fit.is_empty() {
            return Ok(None);
        }
        let garment = &self.garment;
        let mut allowed = self.fit_allowed;
        let find = |tag| self.fit.iter().find(|(section, _)| section.tag == tag);
        let need = |tag| find(tag).ok_or(OpenError::Missing(tag));
        let mut fit = read_stored(need(layout::FITS)?, &mut allowed, |from| layout::fit::read_fit(garment, from))?;
        let sizes = fit.size_count();
        fit.fields = match find(layout::FLDS) {
            Some(older) => {
                read_stored(older, &mut allowed, |from| layout::size_fields::read_before_5_3(garment, sizes, from))?
            }
            None => {
                let read = |from: &mut Reader<'_>| layout::size_fields::read(garment, sizes, from);
                read_stored(need(layout::SFLD)?, &mut allowed, read)?
            }
        };
        if let Some(section) = find(layout::SZUV) {
            fit.uv = read_stored(section, &mut allowed, |from| layout::fit::read_uv(garment, sizes, from))?;
        }
        fit.check(garment)?;
        Ok(Some(fit))
    }

    /// The garment.
    #[must_use]
    pub fn garment(&self) -> &Garment {
        &self.garment
    }

    /// What comes with the garment: obi, texture, measured paths; empty in packs that were written without.
    #[must_use]
    pub fn accessories(&self) -> &Accessories {
        &self.accessories
    }

    /// The garment, without the rest.
    #[must_use]
    pub fn into_garment(self) -> Garment {
        self.garment
    }

    /// Major and minor version of the format in which the pack was written.
    #[must_use]
    pub fn version(&self) -> (u16, u16) {
        self.version
    }

    /// The section table, in the order of the pack.
    #[must_use]
    pub fn sections(&self) -> &[SectionInfo] {
        &self.sections
    }
}

/// Why bytes could not be opened as a pack.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum OpenError {
    /// They do not begin like a pack.
    #[error("this is not a kitsuke pack")]
    NotAPack,
    /// They are more than [`limits::PACK_BYTES`].
    #[error("the pack has {0} bytes; at most {max} are possible", max = limits::PACK_BYTES)]
    TooLong(usize),
    /// Another major version wrote it.
    #[error(
        "the pack is of format version {major}.{minor}, and this version of kitsuke reads version {known}: {}",
        if *major > layout::MAJOR { "update kitsuke" } else { "build the pack anew" }, known = layout::MAJOR
    )]
    Version {
        /// Major version of the pack.
        major: u16,
        /// Minor version of the pack.
        minor: u16,
    },
    /// The header is cut off or damaged.
    #[error("the pack is damaged: {0}")]
    Header(&'static str),
    /// It is longer or shorter than it says.
    #[error("the pack is damaged: it has {length} bytes instead of {stated}")]
    Length {
        /// The length that the header states.
        stated: usize,
        /// The length that there is.
        length: usize,
    },
    /// A section is not there.
    #[error("the pack has no section {0}")]
    Missing(Tag),
    /// The decoded sections would be longer than allowed.
    #[error("the pack decodes to {decoded} bytes; at most {limit} are allowed")]
    DecodedLength {
        /// The decoded length that the section table states.
        decoded: usize,
        /// The limit.
        limit: usize,
    },
    /// A section is wrong as a whole.
    #[error("section {tag}, byte {offset} of the pack: {problem}")]
    Section {
        /// The section.
        tag: Tag,
        /// Where it begins according to the section table, bytes.
        offset: usize,
        /// What is wrong.
        problem: SectionProblem,
    },
    /// A section's content is wrong.
    #[error("section {tag}, byte {at} of its content: {problem}")]
    Content {
        /// The section.
        tag: Tag,
        /// How many of its decoded bytes had been read.
        at: usize,
        /// What is wrong.
        problem: ContentProblem,
    },
    /// The garment breaks a rule.
    #[error(transparent)]
    Garment(#[from] InvalidGarment),
    /// What comes with it breaks a rule.
    #[error(transparent)]
    Accessories(#[from] InvalidAccessories),
    /// What fitting needs breaks a rule.
    #[cfg(feature = "fit")]
    #[error(transparent)]
    Fit(#[from] InvalidFit),
}

/// What is wrong with a section as a whole.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum SectionProblem {
    /// It begins elsewhere than after the section before it.
    #[error("it must begin at byte {expected}")]
    Offset {
        /// Where it must begin.
        expected: usize,
    },
    /// It ends after the pack.
    #[error("it ends after the pack")]
    Ends,
    /// The bytes before it are not all 0.
    #[error("the bytes before it are not 0")]
    Padding,
    /// It is not the first of its name.
    #[error("it occurs twice")]
    Twice,
    /// This version of the format has no such section.
    #[error("it is unknown")]
    Unknown,
    /// Its checksum does not match.
    #[error("its checksum does not match: the pack is damaged")]
    Checksum,
    /// This version of the format has no such encoding.
    #[error("its encoding {0} is unknown")]
    Encoding(u32),
    /// It does not decode to the length that the section table states.
    #[error("it does not decode to {decoded_length} bytes")]
    Decode {
        /// The stated length.
        decoded_length: usize,
    },
}

/// What is wrong with the content of a section.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum ContentProblem {
    /// It ends too early.
    #[error("{needed} bytes are needed and {left} are left")]
    Ends {
        /// Bytes needed.
        needed: usize,
        /// Bytes left.
        left: usize,
    },
    /// It ends too late.
    #[error("bytes left over: {0}")]
    LeftOver(usize),
    /// A count is above its limit.
    #[error("there are {count} {what}; at most {limit} are possible")]
    Count {
        /// Of what.
        what: &'static str,
        /// How many there are.
        count: usize,
        /// How many there may be.
        limit: usize,
    },
    /// A flag is neither 0 nor 1.
    #[error("a flag is {0}, which is neither 0 nor 1")]
    Flag(u8),
    /// A text is not UTF-8.
    #[error("a text is not UTF-8")]
    Utf8,
    /// There is no such bone.
    #[error("there is no bone {0}")]
    Bone(u8),
    /// There is no such segment.
    #[error("there is no segment {0}")]
    Segment(u16),
    /// A number stands for nothing.
    #[error("there is no {what} {number}")]
    Number {
        /// What it should stand for.
        what: &'static str,
        /// The number.
        number: u8,
    },
    /// Coded arrays would be longer than allowed.
    #[error("it would decode to {decoded} bytes more, where {allowed} are allowed")]
    DecodedLength {
        /// Bytes needed.
        decoded: usize,
        /// Bytes allowed.
        allowed: usize,
    },
    /// Numbers have more decimals than possible.
    #[error("numbers with {0} decimals are not possible")]
    Decimals(u8),
    /// Entropy-coded numbers are not what an encoder writes.
    #[error("its coded numbers are damaged")]
    Codes,
    /// The joints are no skeleton.
    #[error(transparent)]
    Skeleton(SkeletonError),
}

/// Checks the section table: where sections lie, that each is intact, and that none is missing or unknown.
fn check_sections(bytes: &[u8], version: (u16, u16), entries: &[Entry]) -> Result<Vec<SectionInfo>, OpenError> {
    let mut sections: Vec<SectionInfo> = Vec::with_capacity(entries.len());
    let mut end = layout::header_length(entries.len());
    let newer = version.1 > layout::MINOR;
    for entry in entries {
        let &Entry { tag, offset, stored_length, decoded_length, .. } = entry;
        let fail = |problem| Err(OpenError::Section { tag, offset, problem });
        let expected = end.next_multiple_of(layout::ALIGNMENT);
        if offset != expected {
            return fail(SectionProblem::Offset { expected });
        }
        let Some(padding) = bytes.get(end..offset) else { return fail(SectionProblem::Ends) };
        if padding.iter().any(|&byte| byte != 0) {
            return fail(SectionProblem::Padding);
        }
        end = offset.saturating_add(stored_length);
        let Some(stored) = bytes.get(offset..end) else { return fail(SectionProblem::Ends) };
        if layout::checksum(stored) != entry.checksum {
            return fail(SectionProblem::Checksum);
        }
        if sections.iter().any(|section| section.tag == tag) {
            return fail(SectionProblem::Twice);
        }
        let known = layout::is_known(tag);
        if !known && !newer {
            return fail(SectionProblem::Unknown);
        }
        let encoding = Encoding::from_number(entry.encoding);
        match encoding {
            None if known => return fail(SectionProblem::Encoding(entry.encoding)),
            // Before anything is allocated for it.
            Some(encoding) if known && decoded_length > encoding.longest_decoded(stored_length) => {
                return fail(SectionProblem::Decode { decoded_length });
            }
            _ => {}
        }
        let unpacked_length = decoded_length;
        sections.push(SectionInfo { tag, encoding, offset, stored_length, decoded_length, unpacked_length });
    }
    if end != bytes.len() {
        return Err(OpenError::Length { stated: end, length: bytes.len() });
    }
    let missing = |tag: &&Tag| !sections.iter().any(|section| section.tag == **tag);
    match layout::REQUIRED.iter().find(missing) {
        Some(&tag) => Err(OpenError::Missing(tag)),
        None => Ok(sections),
    }
}

/// How many bytes the arrays in the sections may decode to.
fn check_decoded_length(sections: &[SectionInfo], limit: usize) -> Result<usize, OpenError> {
    let known = sections.iter().filter(|section| layout::is_known(section.tag));
    let decoded = known.fold(0usize, |sum, section| sum.saturating_add(section.decoded_length));
    limit.checked_sub(decoded).ok_or(OpenError::DecodedLength { decoded, limit })
}

/// Decodes the sections one after the other, so that only one of them is in memory beside the garment.
fn read_garment(sections: &mut Sections<'_>) -> Result<GarmentData, OpenError> {
    let info = sections.read(layout::INFO, layout::read_info)?;
    let skeleton = sections.read(layout::SKEL, layout::read_skeleton)?;
    let mesh = sections.read(layout::MESH, |from| layout::read_mesh(&info, from))?;
    let skin = sections.read(layout::SKIN, |from| layout::read_skin(info.unique, from))?;
    let (drivers, poses, pose_limits) = sections.read(layout::DRIV, |from| layout::read_drivers(&info, from))?;
    let segments = sections.read(layout::SEGS, |from| layout::read_segments(&info, from))?;
    let targets = sections.read(layout::TGTS, |from| layout::read_targets(&info, &mesh, &segments, from))?;
    let rbf = sections.read(layout::RBFS, |from| layout::read_rbf(&drivers, &targets, info.correctives, from))?;
    let certificate = sections.read(layout::CERT, |from| layout::read_certificate(&info, from))?;
    let samples = info.targets.saturating_sub(info.correctives);
    let compression = match sections.has(layout::LOSS) {
        true => Some(sections.read(layout::LOSS, |from| layout::read_compression(samples, from))?),
        false => None,
    };
    let Info { id, name, correctives: corrective_count, .. } = info;
    Ok(GarmentData {
        id,
        name,
        skeleton,
        mesh,
        skin,
        drivers,
        segments,
        targets,
        corrective_count,
        poses,
        pose_limits,
        rbf,
        certificate,
        compression,
    })
}

/// Decodes and checks what comes with the garment, where the pack has it.
fn read_accessories(sections: &mut Sections<'_>, garment: &Garment) -> Result<Accessories, OpenError> {
    let mut accessories = match sections.has(layout::ACCS) {
        true => sections.read(layout::ACCS, layout::accessories::read_accessories)?,
        false => Accessories::default(),
    };
    if sections.has(layout::TXTR) {
        let png = sections.read(layout::TXTR, |from| Ok(from.rest().to_vec()))?;
        accessories.texture.as_mut().ok_or(OpenError::Missing(layout::ACCS))?.png = png;
    }
    accessories.check(garment)?;
    Ok(accessories)
}

/// The sections of a pack whose table has been checked.
struct Sections<'a> {
    bytes: &'a [u8],
    sections: &'a mut [SectionInfo],
    /// Bytes that coded arrays may still decode to.
    allowed: usize,
}

impl Sections<'_> {
    fn has(&self, tag: Tag) -> bool {
        self.sections.iter().any(|section| section.tag == tag)
    }

    fn read<T>(
        &mut self,
        tag: Tag,
        read: impl FnOnce(&mut Reader<'_>) -> Result<T, ContentProblem>,
    ) -> Result<T, OpenError> {
        let section = self.sections.iter_mut().find(|section| section.tag == tag).ok_or(OpenError::Missing(tag))?;
        let stored = &self.bytes[section.offset..section.offset + section.stored_length];
        let before = self.allowed;
        let content = read_stored(&(*section, stored), &mut self.allowed, read);
        section.unpacked_length += before - self.allowed;
        content
    }
}

/// The sections of a fit, to be decoded when somebody wants to fit.
#[cfg(feature = "fit")]
fn stored_fit(bytes: &[u8], sections: &[SectionInfo]) -> Vec<(SectionInfo, Vec<u8>)> {
    let of_fit = sections
        .iter()
        .filter(|section| [layout::FITS, layout::FLDS, layout::SFLD, layout::SZUV].contains(&section.tag));
    of_fit.map(|section| (*section, bytes[section.offset..section.offset + section.stored_length].to_vec())).collect()
}

fn read_stored<T>(
    (section, stored): &(SectionInfo, impl AsRef<[u8]>),
    allowed: &mut usize,
    read: impl FnOnce(&mut Reader<'_>) -> Result<T, ContentProblem>,
) -> Result<T, OpenError> {
    let &SectionInfo { tag, offset, decoded_length, .. } = section;
    let stored = stored.as_ref();
    let decoded = section.encoding.and_then(|encoding| encoding.decode(stored, decoded_length));
    let problem = SectionProblem::Decode { decoded_length };
    let decoded = decoded.ok_or(OpenError::Section { tag, offset, problem })?;
    let mut reader = Reader::new(&decoded, *allowed);
    let content = read(&mut reader).and_then(|content| reader.finish().map(|()| content));
    *allowed = reader.allowed();
    content.map_err(|problem| OpenError::Content { tag, at: reader.at(), problem })
}
