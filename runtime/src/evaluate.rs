//! The frame: rates, masked blend in the base's unposed space, linear blend skinning, normals, seam twins (P0, step 3).
//! Each step is a function of its own, so that it can be measured. Knows no bytes of a pack, allocates nothing and
//! cannot fail.

use crate::garment::{Garment, GarmentData, Segment, SkinWeights};
use crate::pose_blend::{self, Rates};
use crate::skeleton::Pose;
use glam::{Affine3A, Vec3, Vec3A};

/// The caller's buffers for one frame, both [`Garment::vertex_count`] long: they can go to a GPU as they are.
#[derive(Debug)]
pub struct Frame<'a> {
    /// Posed positions, metres.
    pub positions_m: &'a mut [Vec3],
    /// Unit normals, outward.
    pub normals: &'a mut [Vec3],
}

/// Working memory for the frames of one garment; holds nothing from one frame to the next.
#[derive(Clone, Debug)]
pub struct Scratch {
    rates: Rates,
    pieces: Pieces,
    triangles: Vec<[u32; 3]>,
    /// The blended cloth before posing: x, y, z of every unique vertex, metres.
    blended_m: Vec<f32>,
    /// Masks of a mixed block as factors, three times per vertex, driver by driver.
    factors: Vec<f32>,
    posed_from_rest: Vec<Affine3A>,
    corners: Vec<Corner>,
}

/// A posed unique vertex with the sum of its triangles' normals; side by side because a triangle needs both.
#[derive(Clone, Copy, Debug, Default)]
struct Corner {
    position_m: Vec3A,
    normal: Vec3A,
}

/// Which targets move each segment, and where their deltas lie: the targets' own lists, seen from the segments.
#[derive(Clone, Debug)]
struct Pieces {
    /// The pieces of segment `s` are `of_segment[s]..of_segment[s + 1]`.
    of_segment: Vec<u32>,
    pieces: Vec<Piece>,
}

#[derive(Clone, Copy, Debug)]
struct Piece {
    target: u16,
    /// Index of the first delta in the target.
    start: u32,
}

/// Vertices blended at a time: small enough that a block's sums and factors stay in the first-level cache.
const BLOCK: usize = 512;

impl Scratch {
    /// Working memory for this garment.
    #[must_use]
    pub fn new(garment: &Garment) -> Scratch {
        let data = garment.data();
        let unique = data.mesh.positions_m.len();
        let most_drivers = data.segments.iter().map(|segment| segment.drivers.len()).max().unwrap_or(0);
        let original = |vertex: u32| match (vertex as usize).checked_sub(unique) {
            Some(twin) => data.mesh.twin_of[twin],
            None => vertex,
        };
        Scratch {
            rates: Rates::new(garment),
            pieces: Pieces::new(data),
            triangles: data.mesh.triangles.iter().map(|corners| corners.map(original)).collect(),
            blended_m: vec![0.0; 3 * unique],
            factors: vec![0.0; (most_drivers + 1) * 3 * BLOCK],
            posed_from_rest: vec![Affine3A::IDENTITY; data.skeleton.joints().len()],
            corners: vec![Corner::default(); unique],
        }
    }

    /// The rates that the last [`evaluate`] used.
    #[must_use]
    pub fn rates(&self) -> &Rates {
        &self.rates
    }
}

impl Pieces {
    fn new(data: &GarmentData) -> Pieces {
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
        Pieces { of_segment, pieces: by_segment.concat() }
    }

    fn of(&self, segment: usize) -> &[Piece] {
        &self.pieces[self.of_segment[segment] as usize..self.of_segment[segment + 1] as usize]
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
    normals(scratch, frame.normals);
    twins(garment, frame);
}

/// Step 1: base plus masked, rated deltas, unposed, into the scratch.
///
/// # Panics
/// When `rates` or `scratch` was made for a garment of another shape.
pub fn blend(garment: &Garment, rates: &Rates, scratch: &mut Scratch) {
    let data = garment.data();
    rates.assert_fits(garment);
    let base: &[f32] = bytemuck::cast_slice(&data.mesh.positions_m);
    scratch.blended_m.copy_from_slice(base);
    let mut rest = scratch.blended_m.as_mut_slice();
    for (number, segment) in data.segments.iter().enumerate() {
        let (blended, after) = rest.split_at_mut(3 * segment.vertex_count as usize);
        rest = after;
        let pieces = scratch.pieces.of(number);
        if segment.masks.is_empty() {
            blend_owned(data, segment, pieces, rates, blended);
        } else {
            blend_mixed(data, segment, pieces, rates, &mut scratch.factors, blended);
        }
    }
}

/// A segment that one driver owns wholly.
fn blend_owned(data: &GarmentData, segment: &Segment, pieces: &[Piece], rates: &Rates, blended: &mut [f32]) {
    let [driver] = segment.drivers[..] else { return };
    let rates = rates.driver(usize::from(driver));
    for (number, block) in blended.chunks_mut(3 * BLOCK).enumerate() {
        for piece in pieces {
            let target = &data.targets[usize::from(piece.target)];
            let scale_m = rates[usize::from(piece.target)] * target.step_m;
            if scale_m == 0.0 {
                continue;
            }
            let start = 3 * (piece.start as usize + number * BLOCK);
            let deltas = &target.deltas.as_flattened()[start..start + block.len()];
            for (sum, &delta) in block.iter_mut().zip(deltas) {
                *sum += scale_m * f32::from(delta);
            }
        }
    }
}

/// A segment that several drivers share, or that fades out.
fn blend_mixed(
    data: &GarmentData,
    segment: &Segment,
    pieces: &[Piece],
    rates: &Rates,
    factors: &mut [f32],
    blended: &mut [f32],
) {
    let drivers = segment.drivers.len();
    let (coefficients, factors) = factors.split_at_mut(3 * BLOCK);
    for (number, block) in blended.chunks_mut(3 * BLOCK).enumerate() {
        let length = block.len();
        let coefficients = &mut coefficients[..length];
        let masks = &segment.masks[number * BLOCK * drivers..][..length / 3 * drivers];
        for (d, factors) in factors.chunks_exact_mut(3 * BLOCK).take(drivers).enumerate() {
            for (factor, row) in factors.chunks_exact_mut(3).zip(masks.chunks_exact(drivers)) {
                factor.fill(f32::from(row[d]) * (1.0 / 65535.0));
            }
        }
        for piece in pieces {
            let target = &data.targets[usize::from(piece.target)];
            let scale_m = |driver: u8| rates.driver(usize::from(driver))[usize::from(piece.target)] * target.step_m;
            if segment.drivers.iter().all(|&driver| scale_m(driver) == 0.0) {
                continue;
            }
            coefficients.fill(0.0);
            for (&driver, factors) in segment.drivers.iter().zip(factors.chunks_exact(3 * BLOCK)) {
                let scale_m = scale_m(driver);
                for (coefficient, factor) in coefficients.iter_mut().zip(factors) {
                    *coefficient += scale_m * factor;
                }
            }
            let start = 3 * (piece.start as usize + number * BLOCK);
            let deltas = &target.deltas.as_flattened()[start..start + length];
            for ((sum, coefficient), &delta) in block.iter_mut().zip(coefficients.iter()).zip(deltas) {
                *sum += coefficient * f32::from(delta);
            }
        }
    }
}

/// Step 2: linear blend skinning of the blended cloth by a sanitised pose.
///
/// # Panics
/// When `positions_m` is shorter than the unique vertices, or `scratch` was made for a garment of another shape.
pub fn skin(garment: &Garment, pose: &Pose, scratch: &mut Scratch, positions_m: &mut [Vec3]) {
    let data = garment.data();
    data.skeleton.posed_from_rest(pose, &mut scratch.posed_from_rest);
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
/// When `normals` is shorter than the unique vertices.
pub fn normals(scratch: &mut Scratch, normals: &mut [Vec3]) {
    let corners = scratch.corners.as_mut_slice();
    for &[a, b, c] in &scratch.triangles {
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
