//! Writes packs. The same garment gives the same bytes.

use super::codec::{Encoding, Writer, encode};
use super::layout::{self, Entry, Tag};
#[cfg(feature = "fit")]
use crate::accessories::{Accessories, InvalidAccessories};
#[cfg(feature = "fit")]
use crate::fit::{FitData, InvalidFit};
use crate::garment::Garment;

pub use super::field::{moved, quantise};
#[cfg(feature = "fit")]
pub use super::layout::size_fields::quantise as quantise_size_fields;

/// The garment as a pack, which [`Pack::open`](super::Pack::open) gives back exactly.
///
/// A garment of very many large targets can exceed the limits on whole packs
/// ([`PACK_BYTES`](crate::arrays::limits::PACK_BYTES), [`DECODED_BYTES`](crate::arrays::limits::DECODED_BYTES)); such a
/// pack is written, and refused when it is opened.
///
/// # Panics
/// When a section would be longer than 4 GiB.
#[must_use]
pub fn write(garment: &Garment) -> Vec<u8> {
    pack(&garment_sections(garment))
}

/// The garment with what comes with it and, where it has sizes, what fitting it needs;
/// [`Pack::accessories`](super::Pack::accessories) and [`Pack::fit_data`](super::Pack::fit_data) give them back exactly.
///
/// # Errors
/// When one of them is not that of the garment, or breaks another rule.
///
/// # Panics
/// As [`write()`].
#[cfg(feature = "fit")]
pub fn write_with(garment: &Garment, accessories: &Accessories, fit: Option<&FitData>) -> Result<Vec<u8>, Invalid> {
    accessories.check(garment)?;
    let mut sections = garment_sections(garment);
    if *accessories != Accessories::default() {
        sections.push(section(layout::ACCS, |to| layout::accessories::write_accessories(accessories, to)));
    }
    if let Some(texture) = accessories.texture.as_ref().filter(|texture| !texture.png.is_empty()) {
        sections.push(section(layout::TXTR, |to| to.take(&texture.png)));
    }
    if let Some(fit) = fit {
        fit.check(garment)?;
        sections.push(section(layout::FITS, |to| layout::fit::write_fit(fit, to)));
        sections.push(section(layout::SFLD, |to| layout::size_fields::write(garment, fit, to)));
        if !fit.uv.is_empty() {
            sections.push(section(layout::SZUV, |to| layout::fit::write_uv(garment, &fit.uv, to)));
        }
    }
    Ok(pack(&sections))
}

/// Why something cannot be written with a garment.
#[cfg(feature = "fit")]
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum Invalid {
    /// What comes with it breaks a rule.
    #[error(transparent)]
    Accessories(#[from] InvalidAccessories),
    /// What fitting needs breaks a rule.
    #[error(transparent)]
    Fit(#[from] InvalidFit),
}

/// Tag, decoded length and stored bytes of a section.
type Section = (Tag, usize, (Encoding, Vec<u8>));

fn garment_sections(garment: &Garment) -> Vec<Section> {
    let data = garment.data();
    let mut sections = vec![
        section(layout::INFO, |to| layout::write_info(data, to)),
        section(layout::SKEL, |to| layout::write_skeleton(&data.skeleton, to)),
        section(layout::MESH, |to| layout::write_mesh(&data.mesh, to)),
        section(layout::SKIN, |to| layout::write_skin(&data.skin, to)),
        section(layout::DRIV, |to| layout::write_drivers(data, to)),
        section(layout::SEGS, |to| layout::write_segments(&data.segments, to)),
        section(layout::TGTS, |to| layout::write_targets(data, to)),
        section(layout::RBFS, |to| layout::write_rbf(data.rbf.as_ref(), to)),
        section(layout::CERT, |to| layout::write_certificate(data.certificate.as_ref(), to)),
    ];
    if let Some(compression) = &data.compression {
        sections.push(section(layout::LOSS, |to| layout::write_compression(compression, to)));
    }
    sections
}

/// The sections after their header.
fn pack(sections: &[Section]) -> Vec<u8> {
    let mut end = layout::header_length(sections.len());
    let entries: Vec<Entry> = sections
        .iter()
        .map(|(tag, decoded_length, (encoding, stored))| {
            let offset = end.next_multiple_of(layout::ALIGNMENT);
            end = offset + stored.len();
            Entry {
                tag: *tag,
                encoding: encoding.number(),
                offset,
                stored_length: stored.len(),
                decoded_length: *decoded_length,
                checksum: layout::checksum(stored),
            }
        })
        .collect();
    let mut pack = Writer::default();
    layout::write_header(&entries, end, &mut pack);
    for (entry, (_, _, (_, stored))) in entries.iter().zip(sections) {
        pack.bytes.resize(entry.offset, 0);
        pack.take(stored);
    }
    pack.bytes
}

fn section(tag: Tag, write: impl FnOnce(&mut Writer)) -> Section {
    let mut content = Writer::default();
    write(&mut content);
    (tag, content.bytes.len(), encode(content.bytes))
}
