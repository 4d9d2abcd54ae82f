//! The frame: rates, masked blend in the base's unposed space, linear blend skinning, normals, seam twins (P0, step 3).
//! Each step is a function of its own, so that it can be measured. Knows no bytes of a pack, allocates nothing and
//! cannot fail.

use crate::garment::{Garment, GarmentData, Segment, SkinWeights};
use crate::pose_blend::{self, Rates};
use crate::skeleton::Pose;
use glam::{Affine3A, Vec3, Vec3A, Vec4, Vec4Swizzles};
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

/// Vertices blended at a time, a multiple of 4: their sums and masks stay in the first-level cache while target after
/// target is added.
const BLOCK: usize = 128;

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
        Plan { of_segment, pieces: by_segment.concat(), triangles }
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
    let data = garment.data();
    rates.assert_fits(garment);
    let base_m: &[f32] = bytemuck::cast_slice(&data.mesh.positions_m);
    let mut first = 0;
    for (number, segment) in data.segments.iter().enumerate() {
        let pieces = garment.plan().pieces(number);
        let count = segment.vertex_count as usize;
        for row in (0..count).step_by(BLOCK) {
            let rows = row..count.min(row + BLOCK);
            let floats = 3 * (first + rows.start)..3 * (first + rows.end);
            let mut sums_m = [[Vec4::ZERO; 3]; BLOCK / 4];
            floats_of(&mut sums_m)[..floats.len()].copy_from_slice(&base_m[floats.clone()]);
            // Most cloth has one to four drivers, and then each delta is touched once.
            for column in (0..segment.drivers.len()).step_by(4) {
                let add_deltas = match segment.drivers.len() - column {
                    1 => add_deltas::<1>,
                    2 => add_deltas::<2>,
                    3 => add_deltas::<3>,
                    _ => add_deltas::<4>,
                };
                add_deltas(data, segment, column, rows.clone(), pieces, rates, &mut sums_m);
            }
            let length = floats.len();
            scratch.blended_m[floats].copy_from_slice(&floats_of(&mut sums_m)[..length]);
        }
        first += count;
    }
}

/// The coordinates of four vertices: `x y z x`, `y z x y`, `z x y z`.
type Four = [Vec4; 3];

fn floats_of(sums_m: &mut [Four]) -> &mut [f32] {
    bytemuck::cast_slice_mut(sums_m)
}

/// Adds what `D` drivers, columns of the segment's masks, contribute to a block of its vertices.
fn add_deltas<const D: usize>(
    data: &GarmentData,
    segment: &Segment,
    column: usize,
    rows: Range<usize>,
    pieces: &[Piece],
    rates: &Rates,
    sums_m: &mut [Four],
) {
    let drivers: [usize; D] = std::array::from_fn(|d| usize::from(segment.drivers[column + d]));
    // By four vertices, one lane each; in 1/65535, which the rates make up for.
    let mut masks = [[Vec4::splat(65535.0); D]; BLOCK / 4];
    if !segment.masks.is_empty() {
        for (i, row) in rows.clone().enumerate() {
            let row = &segment.masks[row * segment.drivers.len() + column..][..D];
            for (mask, &unpacked) in masks[i / 4].iter_mut().zip(row) {
                mask[i % 4] = f32::from(unpacked);
            }
        }
    }
    for piece in pieces {
        let target = &data.targets[usize::from(piece.target)];
        let rates = drivers.map(|driver| rates.driver(driver)[usize::from(piece.target)]);
        if rates == [0.0; D] {
            continue;
        }
        let rates_m = rates.map(|rate| Vec4::splat(rate * (target.step_m / 65535.0)));
        let start = piece.start as usize;
        let (fours, rest) = target.deltas[start + rows.start..start + rows.end].as_flattened().as_chunks();
        for ((sums_m, masks), deltas) in sums_m.iter_mut().zip(&masks).zip(fours) {
            add_four(sums_m, masks, &rates_m, deltas);
        }
        if !rest.is_empty() {
            let mut deltas = [0; 12];
            deltas[..rest.len()].copy_from_slice(rest);
            add_four(&mut sums_m[fours.len()], &masks[fours.len()], &rates_m, &deltas);
        }
    }
}

/// Adds one target's deltas to four vertices.
#[inline(always)]
fn add_four<const D: usize>(sums_m: &mut Four, masks: &[Vec4; D], rates_m: &[Vec4; D], deltas: &[i16; 12]) {
    let mut step_m = masks[0] * rates_m[0];
    for d in 1..D {
        step_m += masks[d] * rates_m[d];
    }
    let [a, b, c, d, e, f, g, h, i, j, k, l] = deltas.map(f32::from);
    sums_m[0] += step_m.xxxy() * Vec4::new(a, b, c, d);
    sums_m[1] += step_m.yyzz() * Vec4::new(e, f, g, h);
    sums_m[2] += step_m.zwww() * Vec4::new(i, j, k, l);
}

/// Step 2: linear blend skinning of the blended cloth by a sanitised pose whose arms are untwisted
/// ([`Pose::with_arms_untwisted`]).
///
/// # Panics
/// When `positions_m` is shorter than the unique vertices, or `scratch` was made for a garment of another shape.
pub fn skin(garment: &Garment, pose: &Pose, scratch: &mut Scratch, positions_m: &mut [Vec3]) {
    let data = garment.data();
    data.skeleton.posed_from_rest(&pose.with_arms_untwisted(), &mut scratch.posed_from_rest);
    let positions_m = &mut positions_m[..data.skin.len()];
    let vertices = scratch.blended_m.chunks_exact(3).zip(&data.skin).zip(&mut scratch.corners).zip(positions_m);
    for (((blended_m, weights), corner), position_m) in vertices {
        let blended_m = Vec3A::new(blended_m[0], blended_m[1], blended_m[2]);
        let posed = blended_transform(&scratch.posed_from_rest, weights).transform_point3a(blended_m);
        *corner = Corner { position_m: posed, normal: Vec3A::ZERO };
        *position_m = posed.into();
    }
}

/// The weighted mean of a vertex's joint transforms.
fn blended_transform(posed_from_rest: &[Affine3A], weights: &SkinWeights) -> Affine3A {
    let mut sum = Affine3A::ZERO;
    for (&joint, &weight) in weights.joints.iter().zip(&weights.weights) {
        if weight != 0 {
            let transform = &posed_from_rest[usize::from(joint)];
            let weight = f32::from(weight) * (1.0 / 65535.0);
            sum.matrix3.x_axis += weight * transform.matrix3.x_axis;
            sum.matrix3.y_axis += weight * transform.matrix3.y_axis;
            sum.matrix3.z_axis += weight * transform.matrix3.z_axis;
            sum.translation += weight * transform.translation;
        }
    }
    sum
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
        + size_of_val(data.skin.as_slice())
        + size_of_val(garment.plan().triangles.as_slice())
        + size_of_val(mesh.twin_of.as_slice());
    blended.sum::<usize>() + arrays + scratch + garment.vertex_count() * 2 * size_of::<Vec3>()
}
