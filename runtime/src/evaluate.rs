//! The frame: rates, masked blend in the base's unposed space, linear blend skinning, normals, seam twins (P0, step 3).
//! Each step is a function of its own, so that it can be measured. Knows no bytes of a pack, allocates nothing and
//! cannot fail.
//!
//! Blending and skinning are compiled for several sets of vector instructions, of which the widest that the machine
//! knows is chosen at run time. All of them give the same bits: sums are never reordered, and no multiplication is
//! fused with an addition.

use crate::garment::{Garment, GarmentData, Segment, SkinWeights, limits};
use crate::pose_blend::{self, Rates};
use crate::skeleton::Pose;
use glam::{Affine3A, Vec3, Vec3A};
use pulp::{Arch, Simd, WithSimd};
use std::collections::BTreeMap;
use std::mem::size_of_val;
use std::ops::Range;

/// The caller's buffers for one frame, both [`Garment::vertex_count`] long: they can go to a GPU as they are.
#[derive(Debug)]
pub struct Frame<'a> {
    /// Posed positions, metres.
    pub positions_m: &'a mut [Vec3],
    /// Unit normals, outward.
    pub normals: &'a mut [Vec3],
}

/// Working memory for the frames of one garment; no frame depends on what the one before left in it.
#[derive(Clone, Debug)]
pub struct Scratch {
    rates: Rates,
    /// The blended cloth before posing: x, y, z of every unique vertex, metres.
    blended_m: Vec<f32>,
    posed_from_rest: Vec<Affine3A>,
    corners: Vec<Corner>,
}

/// A posed unique vertex with the sum of its triangles' normals; side by side because a triangle needs both.
#[derive(Clone, Copy, Debug, Default)]
struct Corner {
    position_m: Vec3A,
    normal: Vec3A,
}

/// What evaluation derives once from a garment's arrays.
#[derive(Clone, Debug)]
pub(crate) struct Plan {
    /// Which targets move each segment: the pieces of segment `s` are `of_segment[s]..of_segment[s + 1]`.
    of_segment: Vec<u32>,
    pieces: Vec<Piece>,
    /// Whether the masks of every vertex of a segment sum to one.
    is_whole: Vec<bool>,
    skin: BlockedSkin,
    /// Triangles over the unique vertices, so that normals are smooth across seams.
    triangles: Vec<[u32; 3]>,
}

/// A target's deltas in one segment.
#[derive(Clone, Copy, Debug)]
struct Piece {
    target: u16,
    /// Index of the first delta in the target.
    start: u32,
}

/// Vertices blended at a time: their sums stay in the first-level cache while target after target is added, and the
/// runs of deltas are long enough to be fetched ahead.
const BLOCK: usize = 512;
const FLOATS: usize = 3 * BLOCK;

/// Vertices skinned at a time, one in each lane of the vector registers.
const LANES: usize = 16;

/// Skin weights by blocks of [`LANES`] vertices: neighbours are moved by the same few joints.
#[derive(Clone, Debug, Default)]
struct BlockedSkin {
    /// How many joints move each block.
    counts: Vec<u8>,
    /// Those joints, block after block.
    joints: Vec<u8>,
    /// The weights of each such joint in 1/65535, 0 where it does not move the vertex.
    weights: Vec<[u16; LANES]>,
}

impl BlockedSkin {
    fn new(skin: &[SkinWeights]) -> BlockedSkin {
        let mut blocked = BlockedSkin::default();
        for block in skin.chunks(LANES) {
            let mut by_joint = BTreeMap::new();
            for (lane, vertex) in block.iter().enumerate() {
                for (&joint, &weight) in vertex.joints.iter().zip(&vertex.weights) {
                    if weight != 0 {
                        by_joint.entry(joint).or_insert([0; LANES])[lane] += weight;
                    }
                }
            }
            blocked.counts.push(by_joint.len() as u8);
            blocked.joints.extend(by_joint.keys());
            blocked.weights.extend(by_joint.values());
        }
        blocked
    }

    fn bytes(&self) -> usize {
        self.counts.len() + self.joints.len() + size_of_val(self.weights.as_slice())
    }
}

impl Plan {
    /// Of checked arrays.
    pub(crate) fn new(data: &GarmentData) -> Plan {
        let mut by_segment = vec![Vec::new(); data.segments.len()];
        for (number, target) in data.targets.iter().enumerate() {
            let mut start = 0;
            for &segment in &target.segments {
                let segment = usize::from(segment);
                by_segment[segment].push(Piece { target: number as u16, start });
                start += data.segments[segment].vertex_count;
            }
        }
        let mut of_segment = vec![0];
        for pieces in &by_segment {
            of_segment.push(of_segment[of_segment.len() - 1] + pieces.len() as u32);
        }
        let unique = data.mesh.positions_m.len();
        let original = |vertex: u32| match (vertex as usize).checked_sub(unique) {
            Some(twin) => data.mesh.twin_of[twin],
            None => vertex,
        };
        let triangles = data.mesh.triangles.iter().map(|corners| corners.map(original)).collect();
        let is_whole = data.segments.iter().map(|segment| {
            let mut rows = segment.masks.chunks_exact(segment.drivers.len().max(1));
            rows.all(|row| row.iter().map(|&mask| u32::from(mask)).sum::<u32>() == u32::from(u16::MAX))
        });
        let (is_whole, skin) = (is_whole.collect(), BlockedSkin::new(&data.skin));
        Plan { of_segment, pieces: by_segment.concat(), is_whole, skin, triangles }
    }

    fn pieces(&self, segment: usize) -> &[Piece] {
        &self.pieces[self.of_segment[segment] as usize..self.of_segment[segment + 1] as usize]
    }
}

impl Scratch {
    /// Working memory for this garment, or any other with as many vertices, joints, drivers and targets.
    #[must_use]
    pub fn new(garment: &Garment) -> Scratch {
        Scratch {
            rates: Rates::new(garment),
            blended_m: vec![0.0; 3 * garment.unique_count()],
            posed_from_rest: vec![Affine3A::IDENTITY; garment.data().skeleton.joints().len()],
            corners: vec![Corner::default(); garment.unique_count()],
        }
    }

    /// The rates that the last [`evaluate`] used.
    #[must_use]
    pub fn rates(&self) -> &Rates {
        &self.rates
    }
}

/// Writes the kimono in this pose, with the blend rates of the garment's own kernel ([`Garment::kernel`]).
///
/// Whatever the pose holds, the frame is finite: rotations need not be unit quaternions, one that is not finite or has
/// no length counts as the T-pose, and a hips translation that is not finite as none (see [`Pose::sanitised`]).
///
/// # Panics
/// When a buffer is not [`Garment::vertex_count`] long, or `scratch` was made for a garment of another shape.
pub fn evaluate(garment: &Garment, pose: &Pose, scratch: &mut Scratch, frame: Frame<'_>) {
    let pose = pose.sanitised();
    let mut rates = std::mem::take(&mut scratch.rates);
    pose_blend::rates(garment.kernel(), garment, &pose, &mut rates);
    evaluate_sanitised(garment, &pose, &rates, scratch, frame);
    scratch.rates = rates;
}

/// Writes the kimono in this pose, with the caller's blend rates instead of those that the pose gives.
///
/// # Panics
/// As [`evaluate`], and when `rates` was made for a garment of another shape.
pub fn evaluate_with_rates(garment: &Garment, pose: &Pose, rates: &Rates, scratch: &mut Scratch, frame: Frame<'_>) {
    evaluate_sanitised(garment, &pose.sanitised(), rates, scratch, frame);
}

fn evaluate_sanitised(garment: &Garment, pose: &Pose, rates: &Rates, scratch: &mut Scratch, frame: Frame<'_>) {
    assert_eq!(frame.positions_m.len(), garment.vertex_count(), "one position per vertex");
    assert_eq!(frame.normals.len(), garment.vertex_count(), "one normal per vertex");
    blend(garment, rates, scratch);
    skin(garment, pose, scratch, frame.positions_m);
    normals(garment, scratch, frame.normals);
    twins(garment, frame);
}

/// Step 1: base plus masked, rated deltas, unposed, into the scratch.
///
/// # Panics
/// When `rates` or `scratch` was made for a garment of another shape.
pub fn blend(garment: &Garment, rates: &Rates, scratch: &mut Scratch) {
    rates.assert_fits(garment);
    assert_eq!(scratch.blended_m.len(), 3 * garment.unique_count(), "scratch of another garment");
    Arch::new().dispatch(Blend { garment, rates, blended_m: &mut scratch.blended_m });
}

struct Blend<'a> {
    garment: &'a Garment,
    rates: &'a Rates,
    blended_m: &'a mut [f32],
}

impl WithSimd for Blend<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        blend_segments(self.garment, self.rates, self.blended_m);
    }
}

#[inline(always)]
fn blend_segments(garment: &Garment, rates: &Rates, mut blended_m: &mut [f32]) {
    let data = garment.data();
    blended_m.copy_from_slice(bytemuck::cast_slice(&data.mesh.positions_m));
    for (number, segment) in data.segments.iter().enumerate() {
        let (of_segment, rest) = blended_m.split_at_mut(3 * segment.vertex_count as usize);
        blended_m = rest;
        let pieces = garment.plan().pieces(number);
        let shares = Shares::of(segment, rates);
        for (block, sums_m) in of_segment.chunks_mut(FLOATS).enumerate() {
            let rows = block * BLOCK..block * BLOCK + sums_m.len() / 3;
            for pair in shares.firsts[..shares.count].chunks(2) {
                let rates_of = |first: u8| rates.driver(usize::from(segment.drivers[usize::from(first)]));
                let (mut a_m, mut b_m) = ([0.0; FLOATS], [0.0; FLOATS]);
                match *pair {
                    [a, b] => {
                        let rates = [rates_of(a), rates_of(b)];
                        in_fours(data, pieces, &rows, rates, |four| add_to_two(four, &mut a_m, &mut b_m));
                        shares.add(segment, b, rows.clone(), &b_m, sums_m);
                    }
                    [a, ..] => in_fours(data, pieces, &rows, [rates_of(a)], |four| add_to_one(four, &mut a_m)),
                    [] => unreachable!("chunks are not empty"),
                }
                if shares.count == 1 && garment.plan().is_whole[number] {
                    for (sum_m, move_m) in sums_m.iter_mut().zip(&a_m) {
                        *sum_m += move_m;
                    }
                } else {
                    shares.add(segment, pair[0], rows.clone(), &a_m, sums_m);
                }
            }
        }
    }
}

/// Which drivers of a segment have the same rates, for example because one group sets them: their masks can be added
/// up, and each delta is touched once for all of them.
struct Shares {
    /// For every driver of the segment the first one with the same rates.
    first: [u8; limits::DRIVERS],
    /// The drivers that are such firsts.
    firsts: [u8; limits::DRIVERS],
    count: usize,
}

impl Shares {
    fn of(segment: &Segment, rates: &Rates) -> Shares {
        let mut shares = Shares { first: [0; limits::DRIVERS], firsts: [0; limits::DRIVERS], count: 0 };
        let rates_of = |column: u8| rates.driver(usize::from(segment.drivers[usize::from(column)]));
        for column in 0..segment.drivers.len() as u8 {
            let known = &shares.firsts[..shares.count];
            let first = known.iter().copied().find(|&first| rates_of(first) == rates_of(column)).unwrap_or(column);
            if first == column {
                shares.firsts[shares.count] = column;
                shares.count += 1;
            }
            shares.first[usize::from(column)] = first;
        }
        shares
    }

    /// Adds what the drivers like `first` move, by their masks.
    #[inline(always)]
    fn add(&self, segment: &Segment, first: u8, rows: Range<usize>, moves_m: &[f32], sums_m: &mut [f32]) {
        let columns = segment.drivers.len();
        let mut counts = [0.0; limits::DRIVERS];
        for (counts, &of) in counts.iter_mut().zip(&self.first[..columns]) {
            *counts = if of == first { 1.0 / 65535.0 } else { 0.0 };
        }
        let masks = &segment.masks[rows.start * columns..rows.end * columns];
        let vertices = sums_m.as_chunks_mut::<3>().0.iter_mut().zip(moves_m.as_chunks::<3>().0);
        for ((sum_m, move_m), row) in vertices.zip(masks.chunks_exact(columns)) {
            let mask: f32 = row.iter().zip(&counts).map(|(&mask, counts)| f32::from(mask) * counts).sum();
            for (sum, by) in sum_m.iter_mut().zip(move_m) {
                *sum += mask * by;
            }
        }
    }
}

/// A target's deltas of some vertices, with metres per unit for each of `D` sums.
#[derive(Clone, Copy)]
struct Term<'a, const D: usize> {
    deltas: &'a [i16],
    rates_m: [f32; D],
}

/// Hands out the active targets of a segment four at a time, so that the sums are loaded and stored once for the four;
/// what is missing to four counts 0.
#[inline(always)]
fn in_fours<const D: usize>(
    data: &GarmentData,
    pieces: &[Piece],
    rows: &Range<usize>,
    rates: [&[f32]; D],
    mut add: impl FnMut(&[Term<D>; 4]),
) {
    let mut active = pieces.iter().filter_map(|piece| {
        let target = &data.targets[usize::from(piece.target)];
        let rates_m = rates.map(|rates| rates[usize::from(piece.target)] * target.step_m);
        let start = piece.start as usize;
        let deltas = target.deltas[start + rows.start..start + rows.end].as_flattened();
        (rates_m != [0.0; D]).then_some(Term { deltas, rates_m })
    });
    while let Some(first) = active.next() {
        let none = Term { rates_m: [0.0; D], ..first };
        let mut next = || active.next().unwrap_or(none);
        add(&[first, next(), next(), next()]);
    }
}

#[inline(always)]
fn add_to_one([a, b, c, d]: &[Term<1>; 4], sums_m: &mut [f32; FLOATS]) {
    let [[by_a], [by_b], [by_c], [by_d]] = [a.rates_m, b.rates_m, c.rates_m, d.rates_m];
    let deltas = a.deltas.iter().zip(b.deltas).zip(c.deltas.iter().zip(d.deltas));
    for (sum_m, ((&a, &b), (&c, &d))) in sums_m.iter_mut().zip(deltas) {
        let [a, b, c, d] = [f32::from(a), f32::from(b), f32::from(c), f32::from(d)];
        *sum_m += (by_a * a + by_b * b) + (by_c * c + by_d * d);
    }
}

#[inline(always)]
fn add_to_two([a, b, c, d]: &[Term<2>; 4], first_m: &mut [f32; FLOATS], second_m: &mut [f32; FLOATS]) {
    let [by_a, by_b, by_c, by_d] = [a.rates_m, b.rates_m, c.rates_m, d.rates_m];
    let deltas = a.deltas.iter().zip(b.deltas).zip(c.deltas.iter().zip(d.deltas));
    for ((first_m, second_m), ((&a, &b), (&c, &d))) in first_m.iter_mut().zip(second_m).zip(deltas) {
        let [a, b, c, d] = [f32::from(a), f32::from(b), f32::from(c), f32::from(d)];
        *first_m += (by_a[0] * a + by_b[0] * b) + (by_c[0] * c + by_d[0] * d);
        *second_m += (by_a[1] * a + by_b[1] * b) + (by_c[1] * c + by_d[1] * d);
    }
}

/// Step 2: linear blend skinning of the blended cloth by a sanitised pose whose arms are untwisted
/// ([`Pose::with_arms_untwisted`]).
///
/// # Panics
/// When `positions_m` is shorter than the unique vertices, or `scratch` was made for a garment of another shape.
pub fn skin(garment: &Garment, pose: &Pose, scratch: &mut Scratch, positions_m: &mut [Vec3]) {
    let data = garment.data();
    let Scratch { posed_from_rest, blended_m, corners, .. } = scratch;
    data.skeleton.posed_from_rest(&pose.with_arms_untwisted(), posed_from_rest);
    assert_eq!(corners.len(), garment.unique_count(), "scratch of another garment");
    Arch::new().dispatch(Skin { skin: &garment.plan().skin, posed_from_rest, blended_m, corners, positions_m });
}

struct Skin<'a> {
    skin: &'a BlockedSkin,
    posed_from_rest: &'a [Affine3A],
    blended_m: &'a [f32],
    corners: &'a mut [Corner],
    positions_m: &'a mut [Vec3],
}

impl WithSimd for Skin<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        let Skin { skin, posed_from_rest, blended_m, corners, positions_m } = self;
        let positions_m = &mut positions_m[..corners.len()];
        let mut joints = skin.joints.iter().zip(&skin.weights);
        let blocks = blended_m.chunks(3 * LANES).zip(corners.chunks_mut(LANES)).zip(positions_m.chunks_mut(LANES));
        for (((blended_m, corners), positions_m), &count) in blocks.zip(&skin.counts) {
            let mut rest_m = [[0.0; LANES]; 3];
            let [x, y, z] = &mut rest_m;
            for (((x, y), z), blended_m) in x.iter_mut().zip(y).zip(z).zip(blended_m.as_chunks::<3>().0) {
                [*x, *y, *z] = *blended_m;
            }
            let [x, y, z] = rest_m;
            let mut posed_m = [[0.0; LANES]; 3];
            for (&joint, weights) in joints.by_ref().take(usize::from(count)) {
                let Affine3A { matrix3, translation } = &posed_from_rest[usize::from(joint)];
                let (a, b, c) = (matrix3.x_axis, matrix3.y_axis, matrix3.z_axis);
                for (axis, posed_m) in posed_m.iter_mut().enumerate() {
                    let [a, b, c, d] = [a[axis], b[axis], c[axis], translation[axis]];
                    for i in 0..LANES {
                        let weight = f32::from(weights[i]) * (1.0 / 65535.0);
                        posed_m[i] += weight * (a * x[i] + b * y[i] + (c * z[i] + d));
                    }
                }
            }
            let [x, y, z] = posed_m;
            for (i, (corner, position_m)) in corners.iter_mut().zip(positions_m).enumerate() {
                *corner = Corner { position_m: Vec3A::new(x[i], y[i], z[i]), normal: Vec3A::ZERO };
                *position_m = Vec3::new(x[i], y[i], z[i]);
            }
        }
    }
}

/// Step 3: normals of the unique vertices: the mean of their triangles' normals weighted by area, across seams. Where
/// that has no direction, +Y.
///
/// # Panics
/// When `normals` is shorter than the unique vertices, or `scratch` was made for a garment of another shape.
pub fn normals(garment: &Garment, scratch: &mut Scratch, normals: &mut [Vec3]) {
    let corners = scratch.corners.as_mut_slice();
    let normals = &mut normals[..corners.len()];
    for &[a, b, c] in &garment.plan().triangles {
        let [a, b, c] = [a as usize, b as usize, c as usize];
        let origin = corners[a].position_m;
        let doubled_area = (corners[b].position_m - origin).cross(corners[c].position_m - origin);
        corners[a].normal += doubled_area;
        corners[b].normal += doubled_area;
        corners[c].normal += doubled_area;
    }
    for (corner, normal) in corners.iter().zip(normals) {
        let length = corner.normal.length();
        *normal = if length > 0.0 && length < f32::INFINITY { (corner.normal / length).into() } else { Vec3::Y };
    }
}

/// Step 4: seam twins copy the vertices that they are twins of.
pub fn twins(garment: &Garment, frame: Frame<'_>) {
    let mesh = &garment.data().mesh;
    let unique = mesh.positions_m.len();
    let (originals, twins) = frame.positions_m.split_at_mut(unique);
    for (twin, &original) in twins.iter_mut().zip(&mesh.twin_of) {
        *twin = originals[original as usize];
    }
    let (originals, twins) = frame.normals.split_at_mut(unique);
    for (twin, &original) in twins.iter_mut().zip(&mesh.twin_of) {
        *twin = originals[original as usize];
    }
}

/// Bytes that a frame with these rates reads and writes, each array counted once: what memory at least has to deliver.
#[must_use]
pub fn bytes_touched(garment: &Garment, rates: &Rates) -> usize {
    let data = garment.data();
    let (mesh, segments) = (&data.mesh, data.segments.iter().enumerate());
    let blended = segments.map(|(number, segment)| {
        let count = segment.vertex_count as usize;
        let active = garment.plan().pieces(number).iter().filter(|piece| {
            let rate = |&driver: &u8| rates.driver(usize::from(driver))[usize::from(piece.target)];
            segment.drivers.iter().any(|driver| rate(driver) != 0.0)
        });
        active.count() * count * size_of::<[i16; 3]>() + size_of_val(segment.masks.as_slice())
    });
    let scratch = garment.unique_count() * (size_of::<Vec3>() + size_of::<Corner>());
    let arrays = size_of_val(mesh.positions_m.as_slice())
        + garment.plan().skin.bytes()
        + size_of_val(garment.plan().triangles.as_slice())
        + size_of_val(mesh.twin_of.as_slice());
    blended.sum::<usize>() + arrays + scratch + garment.vertex_count() * 2 * size_of::<Vec3>()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Pack;
    use crate::skeleton::Bone;
    use glam::Quat;
    use pulp::Scalar;

    #[test]
    fn vector_instructions_change_no_bit() {
        let pack = Pack::open(include_bytes!("../../tests/packs/v1.kitsuke")).unwrap();
        let garment = pack.garment();
        let pose = Pose::REST.with(Bone::LeftUpperArm, Quat::from_rotation_z(-0.8));
        let mut rates = Rates::new(garment);
        let (drivers, targets) = rates.shape();
        for (driver, target) in (0..drivers).flat_map(|driver| (0..targets).map(move |target| (driver, target))) {
            rates.set(driver, target, 0.3 + driver as f32 / 7.0 - target as f32 / 11.0);
        }
        let mut scratch = Scratch::new(garment);
        let mut positions_m = vec![Vec3::ZERO; garment.vertex_count()];
        blend(garment, &rates, &mut scratch);
        skin(garment, &pose, &mut scratch, &mut positions_m);

        let mut plain = scratch.clone();
        let mut plain_m = vec![Vec3::ZERO; garment.vertex_count()];
        plain.blended_m.fill(0.0);
        let Scratch { posed_from_rest, blended_m, corners, .. } = &mut plain;
        Blend { garment, rates: &rates, blended_m }.with_simd(Scalar::new());
        let skin = &garment.plan().skin;
        Skin { skin, posed_from_rest, blended_m, corners, positions_m: &mut plain_m }.with_simd(Scalar::new());

        let bits =
            |positions_m: &[Vec3]| -> Vec<_> { positions_m.iter().map(|p| p.to_array().map(f32::to_bits)).collect() };
        assert_eq!(bits(&positions_m), bits(&plain_m));
        assert!(positions_m.iter().any(|position_m| *position_m != Vec3::ZERO));
    }
}
