//! Writes packs. The same garment gives the same bytes.

use super::codec::{Encoding, Writer, encode};
use super::layout::{self, Entry, Tag};
use crate::garment::Garment;

/// The garment as a pack, which [`Pack::open`](super::Pack::open) gives back exactly.
///
/// A garment of very many large targets can exceed the limits on whole packs
/// ([`PACK_BYTES`](crate::garment::limits::PACK_BYTES), [`DECODED_BYTES`](crate::garment::limits::DECODED_BYTES)); such a
/// pack is written, and refused when it is opened.
///
/// # Panics
/// When a section would be longer than 4 GiB.
#[must_use]
pub fn write(garment: &Garment) -> Vec<u8> {
    let data = garment.data();
    let sections = [
        section(layout::INFO, |to| layout::write_info(data, to)),
        section(layout::SKEL, |to| layout::write_skeleton(&data.skeleton, to)),
        section(layout::MESH, |to| layout::write_mesh(&data.mesh, to)),
        section(layout::SKIN, |to| layout::write_skin(&data.skin, to)),
        section(layout::DRIV, |to| layout::write_drivers(&data.drivers, &data.poses, to)),
        section(layout::SEGS, |to| layout::write_segments(&data.segments, to)),
        section(layout::TGTS, |to| layout::write_targets(&data.targets, to)),
        section(layout::RBFS, |to| layout::write_rbf(data.rbf.as_ref(), to)),
        section(layout::CERT, |to| layout::write_certificate(data.certificate.as_ref(), to)),
    ];
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
    for (entry, (_, _, (_, stored))) in entries.iter().zip(&sections) {
        pack.bytes.resize(entry.offset, 0);
        pack.take(stored);
    }
    pack.bytes
}

/// Tag, decoded length and stored bytes of a section.
fn section(tag: Tag, write: impl FnOnce(&mut Writer)) -> (Tag, usize, (Encoding, Vec<u8>)) {
    let mut content = Writer::default();
    write(&mut content);
    (tag, content.bytes.len(), encode(content.bytes))
}
