//! The frame: rates, masked blend in the base's unposed space, linear blend skinning, normals, seam twins (P0, step 3).
//! Each step is a function of its own, so that it can be measured. Knows no bytes of a pack, allocates nothing and
//! cannot fail.
//!
//! Blending and skinning are compiled for several sets of vector instructions, of which the widest that the machine
//! knows is chosen at run time. All of them give the same bits: sums are never reordered, and no multiplication is
//! fused with an addition.

mod normals;

use crate::clearance;
use crate::garment::{Garment, GarmentData, Segment, SkinWeights, limits};
use crate::pose_blend::{self, Rates};
use crate::skeleton::Pose;
use glam::{Affine3A, Vec3};
use normals::Normals;
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
    normals: normals::Work,
    clearance: clearance::Work,
}

/// What evaluation derives once from a garment's arrays.
#[derive(Clone, Debug)]
pub(crate) struct Plan {
    /// Which targets move each segment: the pieces of segment `s` are `of_segment[s]..of_segment[s + 1]`.
    of_segment: Vec<u32>,
    pieces: Vec<Piece>,
    /// Whether the masks of every vertex of a segment sum to one.
    is_whole: Vec<bool>,
    /// The masks segment by segment, driver by driver, each three times: for x, y and z.
    masks: Vec<u16>,
    skin: BlockedSkin,
    /// Over the unique vertices, so that normals are smooth across seams.
    normals: normals::Plan,
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
        let triangles: Vec<_> = data.mesh.triangles.iter().map(|corners| corners.map(original)).collect();
        let normals = normals::Plan::new(unique, &triangles);
        let is_whole = data.segments.iter().map(|segment| {
            let mut rows = segment.masks.chunks_exact(segment.drivers.len().max(1));
            rows.all(|row| row.iter().map(|&mask| u32::from(mask)).sum::<u32>() == u32::from(u16::MAX))
        });
        let is_whole: Vec<bool> = is_whole.collect();
        let mut masks = Vec::new();
        for Segment { drivers, masks: rows, .. } in &data.segments {
            for column in 0..drivers.len() {
                let of_driver = rows.iter().skip(column).step_by(drivers.len());
                masks.extend(of_driver.flat_map(|&mask| [mask; 3]));
            }
        }
        Plan { of_segment, pieces: by_segment.concat(), is_whole, masks, skin: BlockedSkin::new(&data.skin), normals }
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
            normals: normals::Work::new(garment.unique_count(), &garment.plan().normals),
            clearance: clearance::Work::new(&garment.data().proxies, &garment.data().skeleton),
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
    clear(garment, pose, scratch, frame.positions_m);
    normals(garment, frame.positions_m, scratch, frame.normals);
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
    let mut base_m: &[f32] = bytemuck::cast_slice(&data.mesh.positions_m);
    let mut masks = garment.plan().masks.as_slice();
    for (number, segment) in data.segments.iter().enumerate() {
        let floats = 3 * segment.vertex_count as usize;
        let (of_segment, rest) = blended_m.split_at_mut(floats);
        blended_m = rest;
        let base_of_segment = &base_m[..floats];
        base_m = &base_m[floats..];
        let is_whole = garment.plan().is_whole[number];
        let of_segment_masks = &masks[..3 * segment.masks.len()];
        masks = &masks[of_segment_masks.len()..];

        let pieces = garment.plan().pieces(number);
        let shares = Shares::of(segment, rates);
        let rates_of = |first: u8| rates.driver(usize::from(segment.drivers[usize::from(first)]));
        let blocks = of_segment.chunks_mut(FLOATS).zip(base_of_segment.chunks(FLOATS)).enumerate();
        for (block, (sums_m, base_m)) in blocks {
            let rows = block * BLOCK..block * BLOCK + sums_m.len() / 3;
            if let (true, [only]) = (is_whole, shares.firsts()) {
                let mut moves_m = [0.0; FLOATS];
                in_fours(data, pieces, &rows, [rates_of(*only)], |four| add_to_one(four, &mut moves_m));
                for ((sum_m, base_m), move_m) in sums_m.iter_mut().zip(base_m).zip(&moves_m) {
                    *sum_m = base_m + move_m;
                }
                continue;
            }
            sums_m.copy_from_slice(base_m);
            for pair in shares.firsts().chunks(2) {
                let mut moves_m = [[0.0; FLOATS]; 2];
                let [a_m, b_m] = &mut moves_m;
                match *pair {
                    [a, b] => {
                        let rates = [rates_of(a), rates_of(b)];
                        in_fours(data, pieces, &rows, rates, |four| add_to_two(four, a_m, b_m));
                    }
                    [a, ..] => in_fours(data, pieces, &rows, [rates_of(a)], |four| add_to_one(four, a_m)),
                    [] => unreachable!("chunks are not empty"),
                }
                for (first, moves_m) in pair.iter().zip(&moves_m) {
                    for column in shares.columns(*first) {
                        let masks = &of_segment_masks[column * floats + 3 * rows.start..][..sums_m.len()];
                        for ((sum_m, &mask), move_m) in sums_m.iter_mut().zip(masks).zip(moves_m) {
                            *sum_m += f32::from(mask) * (1.0 / 65535.0) * move_m;
                        }
                    }
                }
            }
        }
    }
}

/// Which drivers of a segment have the same rates, for example because one group sets them: each delta is touched once
/// for all of them.
struct Shares {
    /// For every driver of the segment the first one with the same rates.
    first: [u8; limits::DRIVERS],
    drivers: usize,
    /// The drivers that are such firsts.
    firsts: [u8; limits::DRIVERS],
    count: usize,
}

impl Shares {
    fn of(segment: &Segment, rates: &Rates) -> Shares {
        let mut shares = Shares {
            first: [0; limits::DRIVERS],
            drivers: segment.drivers.len(),
            firsts: [0; limits::DRIVERS],
            count: 0,
        };
        let rates_of = |column: u8| rates.driver(usize::from(segment.drivers[usize::from(column)]));
        for column in 0..segment.drivers.len() as u8 {
            let known = shares.firsts().iter().copied().find(|&first| rates_of(first) == rates_of(column));
            let first = known.unwrap_or(column);
            if first == column {
                shares.firsts[shares.count] = column;
                shares.count += 1;
            }
            shares.first[usize::from(column)] = first;
        }
        shares
    }

    fn firsts(&self) -> &[u8] {
        &self.firsts[..self.count]
    }

    /// The drivers like this first one.
    fn columns(&self, first: u8) -> impl Iterator<Item = usize> {
        (0..self.drivers).filter(move |&column| self.first[column] == first)
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
    let Scratch { posed_from_rest, blended_m, .. } = scratch;
    data.skeleton.posed_from_rest(&pose.with_arms_untwisted(), posed_from_rest);
    assert_eq!(blended_m.len(), 3 * garment.unique_count(), "scratch of another garment");
    let positions_m = &mut positions_m[..garment.unique_count()];
    Arch::new().dispatch(Skin { skin: &garment.plan().skin, posed_from_rest, blended_m, positions_m });
}

struct Skin<'a> {
    skin: &'a BlockedSkin,
    posed_from_rest: &'a [Affine3A],
    blended_m: &'a [f32],
    positions_m: &'a mut [Vec3],
}

impl WithSimd for Skin<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        let Skin { skin, posed_from_rest, blended_m, positions_m } = self;
        let mut joints = skin.joints.iter().zip(&skin.weights);
        let mut counts = skin.counts.iter();
        for (blended_m, positions_m) in blended_m.chunks(FLOATS).zip(positions_m.chunks_mut(BLOCK)) {
            let mut planes = [[0.0; BLOCK]; 3];
            let [x, y, z] = &mut planes;
            for (((x, y), z), blended_m) in x.iter_mut().zip(&mut *y).zip(&mut *z).zip(blended_m.as_chunks::<3>().0) {
                [*x, *y, *z] = *blended_m;
            }
            let [x_blocks, y_blocks, z_blocks] = [x, y, z].map(|plane| plane.as_chunks_mut::<LANES>().0);
            let blocks = x_blocks.iter_mut().zip(y_blocks).zip(z_blocks).take(positions_m.len().div_ceil(LANES));
            for (((x, y), z), &count) in blocks.zip(&mut counts) {
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
                [*x, *y, *z] = posed_m;
            }
            let [x, y, z] = &planes;
            for (((position_m, x), y), z) in positions_m.iter_mut().zip(x).zip(y).zip(z) {
                *position_m = Vec3::new(*x, *y, *z);
            }
        }
    }
}

/// Step 3: pushes the skinned cloth out of the body.
///
/// # Panics
/// When `positions_m` is shorter than the unique vertices, or `scratch` was made for a garment of other proxies.
pub fn clear(garment: &Garment, pose: &Pose, scratch: &mut Scratch, positions_m: &mut [Vec3]) {
    let data = garment.data();
    let Scratch { posed_from_rest, clearance, .. } = scratch;
    let strength = clearance::strength(&data.poses, pose);
    let scene = clearance::Scene { skeleton: &data.skeleton, pose, posed_from_rest, skin: &data.skin, strength };
    clearance::push_out(&data.proxies, scene, clearance, positions_m);
}

/// Step 4: normals of the unique vertices: the mean of their triangles' normals weighted by area, across seams. Where
/// that has no direction, +Y.
///
/// # Panics
/// When `normals` is shorter than the unique vertices, or `scratch` was made for a garment of another shape.
pub fn normals(garment: &Garment, positions_m: &[Vec3], scratch: &mut Scratch, normals: &mut [Vec3]) {
    let unique = garment.unique_count();
    let (plan, work) = (&garment.plan().normals, &mut scratch.normals);
    let (positions_m, normals) = (&positions_m[..unique], &mut normals[..unique]);
    Arch::new().dispatch(Normals { plan, positions_m, work, normals });
}

/// Step 5: seam twins copy the vertices that they are twins of.
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
    let plan = garment.plan();
    let scratch =
        garment.unique_count() * size_of::<Vec3>() + normals::Work::new(garment.unique_count(), &plan.normals).bytes();
    let arrays = size_of_val(mesh.positions_m.as_slice())
        + plan.skin.bytes()
        + plan.normals.bytes()
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
        let frame = |blend: &mut dyn FnMut(Blend), skin: &mut dyn FnMut(Skin), normals: &mut dyn FnMut(Normals)| {
            let Scratch { mut blended_m, mut posed_from_rest, normals: mut work, .. } = Scratch::new(garment);
            let mut positions_m = vec![Vec3::ZERO; garment.unique_count()];
            let mut unit = positions_m.clone();
            garment.data().skeleton.posed_from_rest(&pose, &mut posed_from_rest);
            let Plan { skin: plan, normals: normals_plan, .. } = garment.plan();
            blend(Blend { garment, rates: &rates, blended_m: &mut blended_m });
            let (posed_from_rest, blended_m) = (&posed_from_rest, &blended_m);
            skin(Skin { skin: plan, posed_from_rest, blended_m, positions_m: &mut positions_m });
            normals(Normals { plan: normals_plan, positions_m: &positions_m, work: &mut work, normals: &mut unit });
            positions_m.append(&mut unit);
            positions_m.iter().map(|v| v.to_array().map(f32::to_bits)).collect::<Vec<_>>()
        };
        macro_rules! frame_by {
            ($run:expr) => {
                frame(&mut |step| $run(step), &mut |step| $run(step), &mut |step| $run(step))
            };
        }
        let arch = Arch::new();
        let best = frame_by!(|step| arch.dispatch(step));
        let scalar = Scalar::new();
        assert_eq!(best, frame_by!(|step| Simd::vectorize(scalar, step)), "scalar");
        #[cfg(target_arch = "x86_64")]
        if let Some(v3) = pulp::x86::V3::try_new() {
            assert_eq!(best, frame_by!(|step| Simd::vectorize(v3, step)), "AVX2");
        }
        assert!(best.iter().any(|bits| *bits != [0; 3]));
    }
}
