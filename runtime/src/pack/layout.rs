//! The format of a pack, version 5.3. This file is its specification and its only home: what is written here, and the
//! readers and writers below it, side by side. How numbers and arrays become bytes stands in [`codec`](super::codec).
//!
//! Numbers are little-endian. `f32` and `f64` are IEEE 754, `text` is a `u16` length and as many bytes of UTF-8, `flag`
//! is a byte 0 or 1, `bone` is a byte: the number of a [`Bone`]. `column(n)` is n numbers as described in
//! [`codec`](super::codec); `residuals` are a `u32` length and as many bytes as described in `residuals`.
//!
//! # Container
//! | bytes | what |
//! |---|---|
//! | 0..8 | [`MAGIC`]: 0x89 and `kitsuke` |
//! | 8..10 | `u16` [`MAJOR`] version |
//! | 10..12 | `u16` [`MINOR`] version |
//! | 12..16 | `u32` number of sections n, at most [`SECTIONS`] |
//! | 16..20 | `u32` length of the pack |
//! | 20..20 + 28 n | section table, [`ENTRY_BYTES`] per section |
//! | then 8 | `u64` checksum of all bytes before it |
//! | then | the sections |
//!
//! An entry of the section table:
//!
//! | bytes | what |
//! |---|---|
//! | 0..4 | tag, four ASCII letters; each occurs once |
//! | 4..8 | `u32` encoding: 0 as it is, 1 one LZ4 block |
//! | 8..12 | `u32` offset in the pack |
//! | 12..16 | `u32` stored length |
//! | 16..20 | `u32` decoded length |
//! | 20..28 | `u64` checksum of the stored bytes |
//!
//! Checksums are XXH3 with 64 bits and seed 0. Sections stand in the order of the table; each begins at the first
//! multiple of [`ALIGNMENT`] after the end of the one before (of the header, for the first), the bytes between are 0,
//! and the last one ends the pack.
//!
//! A reader of 5.x reads every pack of version 5: later minor versions may add sections, which older readers skip,
//! and change nothing else. In a pack that is not newer than its reader an unknown section is an error. Packs of other
//! major versions are refused.
//!
//! # Sections
//! All of them must be there, but for those marked optional. Their contents, field after field; "per x" repeats what follows the colon:
//!
//! | tag | content |
//! |---|---|
//! | `INFO` | `text` id, `text` name, then as `u32`: unique vertices v, twins w, triangles t, parts p, drivers d, segments s, targets k, correctives c (the last of the targets), bones of the pose table b |
//! | `SKEL` | `u8` joint count; per joint: `bone`, `u8` parent (255: none), 3 `f32` rest position; `u8` count of what hangs; per frame: `u8` joint, `u8` heading, `u8` trunk |
//! | `MESH` | x, y, z of the positions, `floats(v)`; `flag` has uv; u, v, `floats(v + w)` if so, else `floats(0)`; the vertices that twins copy, `column(w)` of `u32`; corners of the triangles, `column(3 t)` of `u32`; source vertices, `column(v)` of `u32`; per part: `text` name, `u32` triangle count |
//! | `SKIN` | four `column(v)` of `u8` frames, then `column(v)` of `u16` for the second, third and fourth weight; the first is what they leave of 65535 |
//! | `DRIV` | per driver: `text` name, `f32` threshold, `u8` layer, `u8` joint count, per joint: `bone`; the pose table: b `bone`; k - c + 1 rows of b times x, y, z, w as `f32`; `u8` pose limit count, per limit: `u8` joint count, per joint: `bone`, `f32` margin, `u16` bound count, per bound: 3 `f32` per joint normal, `f32` most |
//! | `SEGS` | per segment: `u32` vertex count, `u8` driver count, per driver: `u8`, `flag` has masks; then per segment with masks and per driver of it: `column` of `u16`, one mask per vertex |
//! | `TGTS` | per target: `text` name, `u8` layer, `f32` step, `u16` segment count, per segment: `u16`; then the deltas of all targets that have segments as fields (`field`) |
//! | `RBFS` | `flag` has a default kernel, and if so, per layer (one more than the largest of the drivers) with m targets, n of them correctives: `f64` joint width, reach, ridge and mirror ridge, `u8` group count; per group: `text` name, `u8` driver count, per driver: `u8`, `u8` chain length, per joint: `bone`, `u8` parent in the chain (255: none), `flag` is carried, 3 `f64` axis, `f64` swing, `f64` twist, `u8` mirror (255: none), (m - n + 1) m `f64` own coefficients (with a mirror (2 (m - n) + 1) m), (m - n + 1) m `f64` joint coefficients, `u32` poses between the samples, per pose and joint of the chain: x, y, z, w as `f32`, then n `f64` coefficients per pose |
//! | `CERT` | `flag` has a certificate, and if so, as `f32`: speed, largest step, largest change of step; `bone` fastest joint; `u16` two nearest rows; `flag` has left-out errors, and if so, k - c times mean, p99, max as `f32`; the nearest pair as two `u16` and `f32` |
//! | `FITS` | optional: `u32` body count n + 1 (the base's, then one per size); per body: `text` name, `u8` count, per known measurement: `u8` number, `f32`; per joint of the skeleton: 3 `f32`; `u32` dimension count, per dimension: `text` name, kanji and rule, `f32` offset, `f32` load, `u32` count, `column` of `u32` vertices; `u32` rule set count, per rule set: `text` name and source, `u16` count, per dimension: `text` name and kanji, program; `u16` count, per check: `text` name, program, `u16` count, per limit: `u8` side, `u8` level, program, `text`; a program is a `u16` count and per step a `u8` number and its operand |
//! | `FLDS` | before 5.3 in place of `SFLD`: per part and size: `f32` step; `residuals` of n sizes of 3 axes of v vertices of the sum over the parts and of every part but the vertex's first |
//! | `SFLD` | since 5.3, with `FITS`: per part and size: `f32` step; then as fields (`field`) of v vertices, size after size: of the sum over the parts, then of every part but the vertex's first. Their runs are as long as vertices have the same first part; sums and differences wrap at 16 bits |
//! | `SZUV` | optional, with `FITS`: `f64` step; if 0, per size: u, v, `floats(v + w)`; else `residuals` of n sizes of u and v of v + w vertices, in steps |
//! | `ACCS` | optional, since 5.1: `text` body; `flag` has a texture, and if so, `text` name, `u32` width and height; `flag` has an obi, and if so, as `u32` its vertices n and triangles m, x, y, z of the positions, `floats(n)`, corners of the triangles, `column(3 m)` of `u32`, skin weights as in `SKIN`; `u32` path count, per path: `text` name and kanji, `f32` offset, `u32` count, `column` of `u32` vertices |
//! | `LOSS` | optional, since 5.2: `f32` budget; k - c times largest and 99th percentile of the error and share above half the budget as `f32`; `u32` poses; the same three of the surface |
//! | `TXTR` | optional, since 5.1, with a texture in `ACCS`: its image, a PNG file |
//!
//! Units and ranges are those of [`garment`](crate::garment), checked by [`Garment::new`](crate::garment::Garment::new)
//! on both sides.

pub(super) mod accessories;
#[cfg(feature = "fit")]
pub(super) mod fit;
#[cfg(feature = "fit")]
pub(super) mod size_fields;

use super::codec::{Column, Reader};
use super::field::{self, Lower};
use super::{ContentProblem, OpenError};
use crate::arrays::{
    Certificate, ChainJoint, Compression, Driver, Group, LeftOut, Loss, Mesh, NearestPair, Part, PoseBound, PoseLimit,
    PoseTable, Rbf, RbfLayer, Segment, SkinWeights, Target, limits,
};
use crate::skeleton::{Bone, Hanging, Joint, Skeleton};
use glam::{DVec3, Vec2, Vec3};
use std::fmt;
use xxhash_rust::xxh3::xxh3_64;

#[cfg(feature = "write")]
use {super::codec::Writer, crate::arrays::GarmentData};

/// The first bytes of every pack.
pub const MAGIC: [u8; 8] = *b"\x89kitsuke";
/// Readers refuse another major version.
pub const MAJOR: u16 = 5;
/// Grows when sections are added that older readers may skip.
pub const MINOR: u16 = 3;
/// Bytes before the section table.
pub const HEADER_BYTES: usize = 20;
/// Bytes of an entry of the section table.
pub const ENTRY_BYTES: usize = 28;
/// Where in an entry the checksum stands; it is the entry's last field.
pub const ENTRY_CHECKSUM: usize = 20;
/// Bytes of a checksum.
pub const CHECKSUM_BYTES: usize = 8;
/// Sections begin at multiples of this.
pub const ALIGNMENT: usize = 8;
/// Most sections in a pack.
pub const SECTIONS: usize = 64;

/// The checksum of the header and of sections.
#[must_use]
pub fn checksum(bytes: &[u8]) -> u64 {
    xxh3_64(bytes)
}

/// Name of a section.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct Tag(pub [u8; 4]);

impl fmt::Display for Tag {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.0.escape_ascii().fmt(f)
    }
}

/// Id, name and counts.
pub const INFO: Tag = Tag(*b"INFO");
/// The skeleton.
pub const SKEL: Tag = Tag(*b"SKEL");
/// The surface.
pub const MESH: Tag = Tag(*b"MESH");
/// Skin weights.
pub const SKIN: Tag = Tag(*b"SKIN");
/// Drivers and pose table.
pub const DRIV: Tag = Tag(*b"DRIV");
/// Segments and masks.
pub const SEGS: Tag = Tag(*b"SEGS");
/// Targets.
pub const TGTS: Tag = Tag(*b"TGTS");
/// The default kernel.
pub const RBFS: Tag = Tag(*b"RBFS");
/// The certificate.
pub const CERT: Tag = Tag(*b"CERT");
/// What a fit needs but fields and texture coordinates.
pub const FITS: Tag = Tag(*b"FITS");
/// Displacement fields, as before 5.3.
pub const FLDS: Tag = Tag(*b"FLDS");
/// Displacement fields.
pub const SFLD: Tag = Tag(*b"SFLD");
/// Texture coordinates of the sizes.
pub const SZUV: Tag = Tag(*b"SZUV");
/// What comes with the kimono.
pub const ACCS: Tag = Tag(*b"ACCS");
/// What compression lost.
pub const LOSS: Tag = Tag(*b"LOSS");
/// The texture's image.
pub const TXTR: Tag = Tag(*b"TXTR");
/// The sections that every pack has.
pub const REQUIRED: [Tag; 9] = [INFO, SKEL, MESH, SKIN, DRIV, SEGS, TGTS, RBFS, CERT];
/// The sections that a pack may have.
pub const OPTIONAL: [Tag; 7] = [FITS, FLDS, SFLD, SZUV, ACCS, TXTR, LOSS];

/// Whether this version has such a section.
#[must_use]
pub fn is_known(tag: Tag) -> bool {
    REQUIRED.contains(&tag) || OPTIONAL.contains(&tag)
}

/// An entry of the section table.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Entry {
    pub(super) tag: Tag,
    pub(super) encoding: u32,
    pub(super) offset: usize,
    pub(super) stored_length: usize,
    pub(super) decoded_length: usize,
    pub(super) checksum: u64,
}

/// Reads and checks everything before the sections: the version and the table.
pub(super) fn read_header(bytes: &[u8]) -> Result<((u16, u16), Vec<Entry>), OpenError> {
    if bytes.len() > limits::PACK_BYTES {
        return Err(OpenError::TooLong(bytes.len()));
    }
    if !bytes.starts_with(&MAGIC) {
        return Err(OpenError::NotAPack);
    }
    let truncated = |_| OpenError::Header("it ends within the header");
    let mut reader = Reader::new(&bytes[MAGIC.len()..], 0);
    let (major, minor) = (reader.u16().map_err(truncated)?, reader.u16().map_err(truncated)?);
    if major != MAJOR {
        return Err(OpenError::Version { major, minor });
    }
    let sections = reader.u32().map_err(truncated)? as usize;
    let length = reader.u32().map_err(truncated)? as usize;
    if sections > SECTIONS {
        return Err(OpenError::Header("it has more sections than possible"));
    }
    let mut table = Reader::new(reader.take(sections * ENTRY_BYTES).map_err(truncated)?, 0);
    let checked = MAGIC.len() + reader.at();
    if reader.u64().map_err(truncated)? != checksum(&bytes[..checked]) {
        return Err(OpenError::Header("its checksum does not match"));
    }
    if length != bytes.len() {
        return Err(OpenError::Length { stated: length, length: bytes.len() });
    }
    let entries = (0..sections).map(|_| read_entry(&mut table)).collect::<Result<_, _>>().map_err(truncated)?;
    Ok(((major, minor), entries))
}

/// Writes what [`read_header`] reads.
#[cfg(feature = "write")]
pub(super) fn write_header(entries: &[Entry], length: usize, to: &mut Writer) {
    to.take(&MAGIC);
    to.u16(MAJOR);
    to.u16(MINOR);
    to.count(entries.len());
    to.count(length);
    entries.iter().for_each(|entry| write_entry(entry, to));
    to.u64(checksum(&to.bytes));
}

/// Where the first section may begin.
pub(super) const fn header_length(sections: usize) -> usize {
    HEADER_BYTES + sections * ENTRY_BYTES + CHECKSUM_BYTES
}

fn read_entry(from: &mut Reader<'_>) -> Result<Entry, ContentProblem> {
    Ok(Entry {
        tag: Tag(from.u32()?.to_le_bytes()),
        encoding: from.u32()?,
        offset: from.u32()? as usize,
        stored_length: from.u32()? as usize,
        decoded_length: from.u32()? as usize,
        checksum: from.u64()?,
    })
}

#[cfg(feature = "write")]
fn write_entry(entry: &Entry, to: &mut Writer) {
    to.take(&entry.tag.0);
    to.u32(entry.encoding);
    to.count(entry.offset);
    to.count(entry.stored_length);
    to.count(entry.decoded_length);
    to.u64(entry.checksum);
}

/// The section `INFO`.
pub(super) struct Info {
    pub(super) id: String,
    pub(super) name: String,
    pub(super) unique: usize,
    pub(super) twins: usize,
    pub(super) triangles: usize,
    pub(super) parts: usize,
    pub(super) drivers: usize,
    pub(super) segments: usize,
    pub(super) targets: usize,
    pub(super) correctives: usize,
    pub(super) pose_bones: usize,
}

pub(super) fn read_info(from: &mut Reader<'_>) -> Result<Info, ContentProblem> {
    Ok(Info {
        id: from.text()?,
        name: from.text()?,
        unique: from.count("unique vertices", limits::VERTICES)?,
        twins: from.count("twins", limits::VERTICES)?,
        triangles: from.count("triangles", limits::TRIANGLES)?,
        parts: from.count("parts", limits::PARTS)?,
        drivers: from.count("drivers", limits::DRIVERS)?,
        segments: from.count("segments", limits::SEGMENTS)?,
        targets: from.count("targets", limits::TARGETS)?,
        correctives: from.count("correctives", limits::TARGETS)?,
        pose_bones: from.count("bones of the pose table", Bone::COUNT)?,
    })
}

#[cfg(feature = "write")]
pub(super) fn write_info(data: &GarmentData, to: &mut Writer) {
    to.text(&data.id);
    to.text(&data.name);
    to.count(data.mesh.positions_m.len());
    to.count(data.mesh.twin_of.len());
    to.count(data.mesh.triangles.len());
    to.count(data.mesh.parts.len());
    to.count(data.drivers.len());
    to.count(data.segments.len());
    to.count(data.targets.len());
    to.count(data.corrective_count);
    to.count(data.poses.bones.len());
}

/// The parent of a joint that has none.
const NO_PARENT: u8 = u8::MAX;

pub(super) fn read_skeleton(from: &mut Reader<'_>) -> Result<Skeleton, ContentProblem> {
    let joints: Vec<Joint> = (0..from.u8()?)
        .map(|_| {
            let bone = read_bone(from)?;
            let parent = Some(from.u8()?).filter(|&parent| parent != NO_PARENT);
            Ok(Joint { bone, parent, rest_m: from.vec3()? })
        })
        .collect::<Result<_, _>>()?;
    let hanging = (0..from.u8()?)
        .map(|_| Ok(Hanging { joint: from.u8()?, heading: from.u8()?, trunk: from.u8()? }))
        .collect::<Result<_, _>>()?;
    Skeleton::new(joints).and_then(|skeleton| skeleton.with_hanging(hanging)).map_err(ContentProblem::Skeleton)
}

#[cfg(feature = "write")]
pub(super) fn write_skeleton(skeleton: &Skeleton, to: &mut Writer) {
    to.u8(skeleton.joints().len() as u8);
    for joint in skeleton.joints() {
        to.u8(joint.bone as u8);
        to.u8(joint.parent.unwrap_or(NO_PARENT));
        to.vec3(joint.rest_m);
    }
    to.u8(skeleton.hanging().len() as u8);
    for &Hanging { joint, heading, trunk } in skeleton.hanging() {
        [joint, heading, trunk].into_iter().for_each(|joint| to.u8(joint));
    }
}

pub(super) fn read_mesh(info: &Info, from: &mut Reader<'_>) -> Result<Mesh, ContentProblem> {
    let vertices = info.unique + info.twins;
    let [x, y, z] = from.floats(info.unique)?;
    let positions_m = x.zip(y).zip(z).map(|((x, y), z)| Vec3::new(x, y, z)).collect();
    let has_uv = from.flag()?;
    let [u, v] = from.floats(if has_uv { vertices } else { 0 })?;
    let uv = u.zip(v).map(|(u, v)| Vec2::new(u, v)).collect();
    let twin_of = from.column::<4>(info.twins)?.collect();
    let mut corners = from.column::<4>(3 * info.triangles)?;
    let mut corner = || corners.next().expect("three corners per triangle");
    let triangles = (0..info.triangles).map(|_| [corner(), corner(), corner()]).collect();
    let source_vertex = from.column::<4>(info.unique)?.collect();
    let parts = (0..info.parts)
        .map(|_| Ok(Part { name: from.text()?, triangle_count: from.u32()? }))
        .collect::<Result<_, _>>()?;
    Ok(Mesh { positions_m, uv, twin_of, triangles, parts, source_vertex })
}

#[cfg(feature = "write")]
pub(super) fn write_mesh(mesh: &Mesh, to: &mut Writer) {
    to.floats(&mesh.positions_m, |position| position.to_array());
    to.flag(!mesh.uv.is_empty());
    to.floats(&mesh.uv, |uv| uv.to_array());
    to.column::<4>(mesh.twin_of.iter().copied());
    to.column::<4>(mesh.triangles.iter().flatten().copied());
    to.column::<4>(mesh.source_vertex.iter().copied());
    for part in &mesh.parts {
        to.text(&part.name);
        to.u32(part.triangle_count);
    }
}

pub(super) fn read_skin(count: usize, from: &mut Reader<'_>) -> Result<Vec<SkinWeights>, ContentProblem> {
    let mut joints = read_columns::<1, 4>(count, from)?;
    let mut weights = read_columns::<2, 3>(count, from)?;
    let skin = |_| {
        let joints = next(&mut joints).map(|joint| joint as u8);
        let [b, c, d] = next(&mut weights).map(|weight| weight as u16);
        // Weights beyond 65535 wrap here and then do not sum to it.
        let first = u16::MAX.wrapping_sub(b).wrapping_sub(c).wrapping_sub(d);
        SkinWeights { joints, weights: [first, b, c, d] }
    };
    Ok((0..count).map(skin).collect())
}

#[cfg(feature = "write")]
pub(super) fn write_skin(skin: &[SkinWeights], to: &mut Writer) {
    for place in 0..4 {
        to.column::<1>(skin.iter().map(|vertex| u32::from(vertex.joints[place])));
    }
    for place in 1..4 {
        to.column::<2>(skin.iter().map(|vertex| u32::from(vertex.weights[place])));
    }
}

/// What the section `DRIV` holds.
pub(super) type Poses = (Vec<Driver>, PoseTable, Vec<PoseLimit>);

pub(super) fn read_drivers(info: &Info, from: &mut Reader<'_>) -> Result<Poses, ContentProblem> {
    let drivers = (0..info.drivers)
        .map(|_| {
            let (name, threshold_rad, layer) = (from.text()?, from.f32()?, from.u8()?);
            let joints = (0..from.u8()?).map(|_| read_bone(from)).collect::<Result<_, _>>()?;
            Ok(Driver { name, joints, threshold_rad, layer })
        })
        .collect::<Result<_, _>>()?;
    let bones = (0..info.pose_bones).map(|_| read_bone(from)).collect::<Result<_, _>>()?;
    let rows = info.targets.saturating_sub(info.correctives) + 1;
    let rotations = (0..rows * info.pose_bones).map(|_| from.quat()).collect::<Result<_, _>>()?;
    let pose_limits = (0..from.u8()?)
        .map(|_| {
            let bones = (0..from.u8()?).map(|_| read_bone(from)).collect::<Result<_, _>>()?;
            let (bones, margin_rad): (Vec<Bone>, f32) = (bones, from.f32()?);
            let bound_count = usize::from(from.u16()?);
            within("bounds of a pose limit", bound_count, limits::LIMIT_BOUNDS)?;
            let bounds = (0..bound_count)
                .map(|_| {
                    let normal = (0..3 * bones.len()).map(|_| from.f32()).collect::<Result<_, _>>()?;
                    Ok(PoseBound { normal, most_rad: from.f32()? })
                })
                .collect::<Result<_, _>>()?;
            Ok(PoseLimit { bones, margin_rad, bounds })
        })
        .collect::<Result<_, _>>()?;
    Ok((drivers, PoseTable { bones, rotations }, pose_limits))
}

#[cfg(feature = "write")]
pub(super) fn write_drivers(data: &GarmentData, to: &mut Writer) {
    let GarmentData { drivers, poses, pose_limits, .. } = data;
    for driver in drivers {
        to.text(&driver.name);
        to.f32(driver.threshold_rad);
        to.u8(driver.layer);
        to.u8(driver.joints.len() as u8);
        driver.joints.iter().for_each(|&bone| to.u8(bone as u8));
    }
    poses.bones.iter().for_each(|&bone| to.u8(bone as u8));
    poses.rotations.iter().flat_map(|rotation| rotation.to_array()).for_each(|component| to.f32(component));
    to.u8(pose_limits.len() as u8);
    for limit in pose_limits {
        to.u8(limit.bones.len() as u8);
        limit.bones.iter().for_each(|&bone| to.u8(bone as u8));
        to.f32(limit.margin_rad);
        to.u16(limit.bounds.len() as u16);
        for bound in &limit.bounds {
            bound.normal.iter().for_each(|&number| to.f32(number));
            to.f32(bound.most_rad);
        }
    }
}

pub(super) fn read_segments(info: &Info, from: &mut Reader<'_>) -> Result<Vec<Segment>, ContentProblem> {
    let heads = (0..info.segments)
        .map(|_| {
            let vertex_count = from.u32()?;
            let driver_count = usize::from(from.u8()?);
            // Every column of masks brings tables of its own, which take time.
            within("drivers of a segment", driver_count, info.drivers)?;
            Ok((vertex_count, from.take(driver_count)?.to_vec(), from.flag()?))
        })
        .collect::<Result<Vec<_>, _>>()?;
    let segment = |(vertex_count, drivers, has_masks): (u32, Vec<u8>, bool)| {
        let columns = (0..if has_masks { drivers.len() } else { 0 })
            .map(|_| from.column::<2>(vertex_count as usize))
            .collect::<Result<Vec<_>, _>>()?;
        Ok(Segment { vertex_count, drivers, masks: interleave(columns) })
    };
    heads.into_iter().map(segment).collect()
}

#[cfg(feature = "write")]
pub(super) fn write_segments(segments: &[Segment], to: &mut Writer) {
    for segment in segments {
        to.u32(segment.vertex_count);
        to.u8(segment.drivers.len() as u8);
        to.take(&segment.drivers);
        to.flag(!segment.masks.is_empty());
    }
    for segment in segments.iter().filter(|segment| !segment.masks.is_empty()) {
        for driver in 0..segment.drivers.len() {
            to.column::<2>(segment.masks.iter().skip(driver).step_by(segment.drivers.len()).map(|&mask| mask.into()));
        }
    }
}

pub(super) fn read_targets(
    info: &Info,
    mesh: &Mesh,
    segments: &[Segment],
    from: &mut Reader<'_>,
) -> Result<Vec<Target>, ContentProblem> {
    let mut targets = (0..info.targets)
        .map(|_| {
            let (name, layer, step_m) = (from.text()?, from.u8()?, from.f32()?);
            let segments = (0..from.u16()?).map(|_| from.u16()).collect::<Result<_, _>>()?;
            Ok(Target { name, layer, step_m, segments, deltas: Vec::new() })
        })
        .collect::<Result<Vec<_>, _>>()?;
    let mut moved: Vec<(usize, Vec<u16>)> =
        segments.iter().map(|segment| (segment.vertex_count as usize, Vec::new())).collect();
    let mut moving: Vec<&mut Target> = targets.iter_mut().filter(|target| !target.segments.is_empty()).collect();
    for (number, target) in moving.iter().enumerate() {
        for &segment in &target.segments {
            let (_, fields) = moved.get_mut(usize::from(segment)).ok_or(ContentProblem::Segment(segment))?;
            // Named twice, it is refused when the garment is checked.
            if fields.last() != Some(&(number as u16)) {
                fields.push(number as u16);
            }
        }
    }
    let lower = Lower::new(info.unique, &mesh.twin_of, &mesh.triangles);
    let fields = field::read(from, moving.len(), &moved, &lower, &mesh.positions_m)?;
    for (target, deltas) in moving.iter_mut().zip(fields) {
        target.deltas = deltas;
    }
    Ok(targets)
}

#[cfg(feature = "write")]
pub(super) fn write_targets(data: &GarmentData, to: &mut Writer) {
    let GarmentData { mesh, segments, targets, .. } = data;
    for target in targets {
        to.text(&target.name);
        to.u8(target.layer);
        to.f32(target.step_m);
        to.u16(target.segments.len() as u16);
        target.segments.iter().for_each(|&segment| to.u16(segment));
    }
    let moving: Vec<&Target> = targets.iter().filter(|target| !target.segments.is_empty()).collect();
    let moved = field::moved(segments, moving.iter().map(|target| target.segments.as_slice()));
    let lower = Lower::new(mesh.positions_m.len(), &mesh.twin_of, &mesh.triangles);
    let fields: Vec<&[[i16; 3]]> = moving.iter().map(|target| target.deltas.as_slice()).collect();
    field::write(&fields, &moved, &lower, &mesh.positions_m, to);
}

pub(super) fn read_rbf(
    drivers: &[Driver],
    targets: &[Target],
    correctives: usize,
    from: &mut Reader<'_>,
) -> Result<Option<Rbf>, ContentProblem> {
    if !from.flag()? {
        return Ok(None);
    }
    let layer_count = drivers.iter().map(|driver| usize::from(driver.layer) + 1).max().unwrap_or(0);
    within("layers", layer_count, limits::DRIVERS)?;
    let layers = (0..layer_count).map(|layer| {
        let count = |targets: &[Target]| targets.iter().filter(|t| usize::from(t.layer) == layer).count();
        let (samples, correctives) = targets.split_at(targets.len().saturating_sub(correctives));
        read_rbf_layer(count(samples), count(correctives), from)
    });
    Ok(Some(Rbf { layers: layers.collect::<Result<_, _>>()? }))
}

fn read_rbf_layer(samples: usize, correctives: usize, from: &mut Reader<'_>) -> Result<RbfLayer, ContentProblem> {
    let [joint_width, reach, ridge, mirror_ridge] = [from.f64()?, from.f64()?, from.f64()?, from.f64()?];
    let width = samples + correctives;
    let group_count = usize::from(from.u8()?);
    within("groups", group_count, limits::DRIVERS)?;
    let groups = (0..group_count)
        .map(|_| {
            let name = from.text()?;
            let driver_count = usize::from(from.u8()?);
            let drivers = from.take(driver_count)?.to_vec();
            let chain: Vec<ChainJoint> = (0..from.u8()?).map(|_| read_chain_joint(from)).collect::<Result<_, _>>()?;
            let mirror = Some(from.u8()?).filter(|&mirror| mirror != NO_MIRROR);
            let own = from.f64s((samples + 1 + mirror.map_or(0, |_| samples)) * width)?;
            let joint = from.f64s((samples + 1) * width)?;
            let centre_count = from.count("poses between the samples", limits::CENTRES)?;
            let centres = (0..centre_count * chain.len()).map(|_| from.quat()).collect::<Result<_, _>>()?;
            let corrective = from.f64s(centre_count * correctives)?;
            Ok(Group { name, drivers, chain, mirror, own, joint, centres, corrective })
        })
        .collect::<Result<_, _>>()?;
    Ok(RbfLayer { groups, joint_width, reach, ridge, mirror_ridge })
}

/// The mirror of a group that has none.
const NO_MIRROR: u8 = u8::MAX;

fn read_chain_joint(from: &mut Reader<'_>) -> Result<ChainJoint, ContentProblem> {
    let bone = read_bone(from)?;
    let parent = Some(from.u8()?).filter(|&parent| parent != NO_PARENT);
    let is_carried = from.flag()?;
    let axis = DVec3::new(from.f64()?, from.f64()?, from.f64()?);
    Ok(ChainJoint { bone, parent, is_carried, axis, swing: from.f64()?, twist: from.f64()? })
}

#[cfg(feature = "write")]
pub(super) fn write_rbf(rbf: Option<&Rbf>, to: &mut Writer) {
    to.flag(rbf.is_some());
    let Some(rbf) = rbf else { return };
    for RbfLayer { groups, joint_width, reach, ridge, mirror_ridge } in &rbf.layers {
        to.f64s(&[*joint_width, *reach, *ridge, *mirror_ridge]);
        to.u8(groups.len() as u8);
        for group in groups {
            to.text(&group.name);
            to.u8(group.drivers.len() as u8);
            to.take(&group.drivers);
            to.u8(group.chain.len() as u8);
            for joint in &group.chain {
                to.u8(joint.bone as u8);
                to.u8(joint.parent.unwrap_or(NO_PARENT));
                to.flag(joint.is_carried);
                to.f64s(&joint.axis.to_array());
                to.f64s(&[joint.swing, joint.twist]);
            }
            to.u8(group.mirror.unwrap_or(NO_MIRROR));
            to.f64s(&group.own);
            to.f64s(&group.joint);
            to.count(group.centres.len() / group.chain.len().max(1));
            group.centres.iter().flat_map(|rotation| rotation.to_array()).for_each(|component| to.f32(component));
            to.f64s(&group.corrective);
        }
    }
}

pub(super) fn read_certificate(info: &Info, from: &mut Reader<'_>) -> Result<Option<Certificate>, ContentProblem> {
    if !from.flag()? {
        return Ok(None);
    }
    let [speed_mm_per_deg, step_mm, step_change_mm] = [from.f32()?, from.f32()?, from.f32()?];
    let fastest_joint = read_bone(from)?;
    let fastest_rows = [from.u16()?, from.u16()?];
    let left_out = (0..if from.flag()? { info.targets.saturating_sub(info.correctives) } else { 0 })
        .map(|_| Ok(LeftOut { mean_mm: from.f32()?, p99_mm: from.f32()?, max_mm: from.f32()? }))
        .collect::<Result<_, _>>()?;
    let nearest = NearestPair { rows: [from.u16()?, from.u16()?], apart_deg: from.f32()? };
    Ok(Some(Certificate { speed_mm_per_deg, fastest_joint, fastest_rows, step_mm, step_change_mm, left_out, nearest }))
}

#[cfg(feature = "write")]
pub(super) fn write_certificate(certificate: Option<&Certificate>, to: &mut Writer) {
    to.flag(certificate.is_some());
    let Some(certificate) = certificate else { return };
    let Certificate { speed_mm_per_deg, step_mm, step_change_mm, fastest_joint, fastest_rows, left_out, nearest } =
        certificate;
    [speed_mm_per_deg, step_mm, step_change_mm].into_iter().for_each(|&figure| to.f32(figure));
    to.u8(*fastest_joint as u8);
    fastest_rows.iter().for_each(|&row| to.u16(row));
    to.flag(!left_out.is_empty());
    left_out.iter().flat_map(|error| [error.mean_mm, error.p99_mm, error.max_mm]).for_each(|figure| to.f32(figure));
    nearest.rows.iter().for_each(|&row| to.u16(row));
    to.f32(nearest.apart_deg);
}

pub(super) fn read_compression(samples: usize, from: &mut Reader<'_>) -> Result<Compression, ContentProblem> {
    let budget_m = from.f32()?;
    let targets = (0..samples).map(|_| read_loss(from)).collect::<Result<_, _>>()?;
    Ok(Compression { budget_m, targets, poses: from.u32()?, surface: read_loss(from)? })
}

fn read_loss(from: &mut Reader<'_>) -> Result<Loss, ContentProblem> {
    Ok(Loss { max_m: from.f32()?, p99_m: from.f32()?, above_half: from.f32()? })
}

#[cfg(feature = "write")]
pub(super) fn write_compression(compression: &Compression, to: &mut Writer) {
    let write_loss = |loss: &Loss, to: &mut Writer| {
        [loss.max_m, loss.p99_m, loss.above_half].into_iter().for_each(|figure| to.f32(figure));
    };
    to.f32(compression.budget_m);
    compression.targets.iter().for_each(|loss| write_loss(loss, to));
    to.u32(compression.poses);
    write_loss(&compression.surface, to);
}

/// Checks a count that is not a `u32`, where what is counted takes more memory than bytes.
fn within(what: &'static str, count: usize, limit: usize) -> Result<(), ContentProblem> {
    if count > limit { Err(ContentProblem::Count { what, count, limit }) } else { Ok(()) }
}

fn read_bone(from: &mut Reader<'_>) -> Result<Bone, ContentProblem> {
    let number = from.u8()?;
    Bone::from_index(number).ok_or(ContentProblem::Bone(number))
}

fn read_columns<const WIDTH: usize, const N: usize>(
    count: usize,
    from: &mut Reader<'_>,
) -> Result<[Column; N], ContentProblem> {
    let columns = (0..N).map(|_| from.column::<WIDTH>(count)).collect::<Result<Vec<_>, _>>()?;
    Ok(columns.try_into().unwrap_or_else(|_| unreachable!("N columns were read")))
}

/// The next value of each column.
fn next<const N: usize>(columns: &mut [Column; N]) -> [u32; N] {
    columns.each_mut().map(|column| column.next().expect("columns hold as many values as were asked for"))
}

/// Columns of masks as rows, one after the other.
fn interleave(mut columns: Vec<Column>) -> Vec<u16> {
    let rows = columns.first().map_or(0, ExactSizeIterator::len);
    let mut masks = Vec::with_capacity(rows * columns.len());
    for _ in 0..rows {
        masks.extend(columns.iter_mut().filter_map(Iterator::next).map(|mask| mask as u16));
    }
    masks
}
