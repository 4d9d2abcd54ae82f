//! Keeps the cloth out of the wearer's body (P0 leaves sleeves in it): vertices that have come too near are pushed out,
//! after skinning and before the normals. Knows no pack and no kernel.
//!
//! The body is a cloud of [`Surfel`]s, points of its skin with normals, which follow the skeleton by the body's own skin
//! weights. So the surface is that of the posed body itself, at the shoulder and the elbow too, where rigid shapes per
//! bone are off by centimetres. How far a point x lies outside is the mean of its heights over the planes of the
//! surfels around it, an implicit moving least squares surface (Shen, O'Brien, Shewchuk: Interpolating and Approximating
//! Implicit Surfaces from Polygon Soup, 2004):
//!
//! ```text
//! distance(x) = Σ wᵢ nᵢ·(x − pᵢ) / Σ wᵢ,    wᵢ = shareᵢ (1 − |x − pᵢ|² / radiusᵢ²)³ sideᵢ
//! ```
//!
//! and it is pushed along the mean normal. Every weight ends smoothly at its surfel's radius, so the push has no jump and
//! no corner, whatever comes near or goes. There is no search for a nearest point, which would jump from one side of an
//! arm to the other: cloth that rides on an arm knows on which side of it it lies ([`Guarded::side`]), and normals that
//! face away from there count less or not at all (sideᵢ: the square of nᵢ·side + ½ where that is above 0).
//!
//! The push is nothing beyond a margin, the whole depth inside, smooth between. Deep cloth is pushed a second time, which
//! takes away what the first push leaves where the body is round. At the samples exactness wins: the push fades away near each of them.

use crate::garment::{PoseTable, SkinWeights};
use crate::pose_blend::rbf::wendland;
use crate::skeleton::{Pose, Skeleton};
use glam::{Affine3A, Vec3, Vec3A};
use pulp::{Arch, Simd, WithSimd};

/// Cloth is pushed until it lies about this far outside, metres.
pub const MARGIN_M: f32 = 0.0025;
/// The push sets in smoothly over this distance, metres.
pub const RAMP_M: f32 = 0.005;

/// What is pushed farther than this is pushed again, and wholly so from twice that, metres.
const AGAIN_M: f32 = 0.006;
/// Pushes, one after the other.
const PASSES: usize = 2;
/// Sum of the weights of skin all round a point that lies on it: the integral of a weight, in squared radii.
const ON_SKIN: f32 = std::f32::consts::FRAC_PI_4;
/// The sum of weights falls about as the fourth power of 1 - depth² / radius². Where this is less, the push fades.
const SURE: f32 = 0.85;
/// Cosine between normal and side at which a surfel stops to count.
const SIDE_LEAST: f32 = -0.5;
/// Distance of a pose from a sample, radians, at which the push-out is whole again.
const SAMPLE_REACH_RAD: f64 = 0.22;

/// A limb or the trunk, and the cloth that is kept out of it.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Proxy {
    /// For example `leftArm`.
    pub name: String,
    /// Points of the skin. Those that follow one another should be near one another: they are skipped by eights.
    pub surfels: Vec<Surfel>,
    /// The cloth. Vertices that follow one another should be near one another: they are tested by eights.
    pub guarded: Vec<Guarded>,
}

/// A point of the body's skin in the T-pose, with its surroundings.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Surfel {
    /// Where it lies, metres.
    pub place_m: Vec3,
    /// Unit normal, outward.
    pub normal: Vec3,
    /// Where its weight ends, metres; above 0.
    pub radius_m: f32,
    /// Its weight: the area for which it stands, in squared radii; above 0.
    pub share: f32,
    /// The joints that move it.
    pub skin: SkinWeights,
}

/// A vertex that is kept out of a proxy.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Guarded {
    /// Unique vertex.
    pub vertex: u32,
    /// On which side of the body it lies in the T-pose, a unit vector in 1/127; all 0 where it may lie on any.
    pub side: [i8; 3],
}

/// Vertices tested and surfels skipped at a time.
const LANES: usize = 16;
type Lanes = [f32; LANES];

/// Eight posed surfels. Where one is missing, its share is 0.
#[derive(Clone, Copy, Debug, Default)]
struct Octet {
    place_m: [Lanes; 3],
    normal: [Lanes; 3],
    radius_m: Lanes,
    share: Lanes,
}

/// A sphere round everything that [`LANES`] surfels can reach: centres by coordinate, radii.
#[derive(Clone, Debug, Default)]
struct Spheres {
    centre_m: [Vec<f32>; 3],
    radius_m: Vec<f32>,
    /// Whether the vertices in question come near.
    is_near: Vec<bool>,
}

/// Working memory, so that a frame allocates nothing.
#[derive(Clone, Debug, Default)]
pub(crate) struct Work {
    body_from_rest: Vec<Affine3A>,
    octets: Vec<Octet>,
    spheres: Spheres,
    /// The surfels near the vertices in question.
    near: Vec<u32>,
}

impl Work {
    pub(crate) fn new(proxies: &[Proxy], skeleton: &Skeleton) -> Work {
        if proxies.is_empty() {
            return Work::default();
        }
        let most = proxies.iter().map(|proxy| proxy.surfels.len()).max().unwrap_or(0);
        let octets = most.div_ceil(LANES);
        let zeros = vec![0.0; octets];
        let centre_m = [zeros.clone(), zeros.clone(), zeros.clone()];
        Work {
            body_from_rest: vec![Affine3A::IDENTITY; skeleton.joints().len()],
            octets: vec![Octet::default(); octets],
            spheres: Spheres { centre_m, is_near: vec![false; zeros.len()], radius_m: zeros },
            near: vec![0; (octets + 1) * LANES],
        }
    }
}

/// How much of the push-out a pose gets: 0 at a sample, 1 far from all of them, twice smoothly differentiable.
#[must_use]
pub fn strength(samples: &PoseTable, pose: &Pose) -> f32 {
    let rows = samples.rotations.chunks_exact(samples.bones.len().max(1));
    let strengths = rows.map(|row| {
        let squared_rad: f64 = samples
            .bones
            .iter()
            .zip(row)
            .map(|(&bone, &sample)| {
                // The chord of half the angle, which is smooth at 0 and blind to the quaternions' signs.
                let (a, b) = (pose.rotation(bone).as_dquat(), sample.as_dquat());
                4.0 * (a - b).length_squared().min((a + b).length_squared())
            })
            .sum();
        1.0 - wendland(squared_rad, SAMPLE_REACH_RAD)
    });
    strengths.product::<f64>() as f32
}

/// What the push-out needs to know of a frame.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Scene<'a> {
    pub(crate) skeleton: &'a Skeleton,
    /// Of the body: its arms do twist.
    pub(crate) pose: &'a Pose,
    /// Of the cloth, whose arms do not.
    pub(crate) posed_from_rest: &'a [Affine3A],
    /// Skin weights of the cloth.
    pub(crate) skin: &'a [SkinWeights],
    /// See [`strength`].
    pub(crate) strength: f32,
}

/// Pushes the guarded vertices that are too near to the body out of it. What is not too near keeps its every bit.
pub(crate) fn push_out(proxies: &[Proxy], scene: Scene<'_>, work: &mut Work, positions_m: &mut [Vec3]) {
    if proxies.is_empty() || scene.strength <= 0.0 {
        return;
    }
    scene.skeleton.posed_from_rest(scene.pose, &mut work.body_from_rest);
    Arch::new().dispatch(PushOut { proxies, scene, work, positions_m });
}

struct PushOut<'a> {
    proxies: &'a [Proxy],
    scene: Scene<'a>,
    work: &'a mut Work,
    positions_m: &'a mut [Vec3],
}

impl WithSimd for PushOut<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) {
        let PushOut { proxies, scene, work, positions_m } = self;
        for proxy in proxies {
            let octets = &mut work.octets[..proxy.surfels.len().div_ceil(LANES)];
            pose(&proxy.surfels, &work.body_from_rest, octets);
            enclose(octets, &mut work.spheres);
            for block in proxy.guarded.chunks(LANES) {
                push_block(block, &scene, octets, &mut work.spheres, &mut work.near, positions_m);
            }
        }
    }
}

/// Skins the surfels. Normals turn as the skin around them does on average.
#[inline(always)]
fn pose(surfels: &[Surfel], body_from_rest: &[Affine3A], octets: &mut [Octet]) {
    for (surfels, octet) in surfels.chunks(LANES).zip(octets) {
        // What is missing to eight repeats the last one, without a share.
        octet.share = [0.0; LANES];
        for i in 0..LANES {
            let surfel = &surfels[i.min(surfels.len() - 1)];
            let (mut place_m, mut normal) = (Vec3A::ZERO, Vec3A::ZERO);
            for (&joint, &weight) in surfel.skin.joints.iter().zip(&surfel.skin.weights) {
                if weight != 0 {
                    let weight = f32::from(weight) * (1.0 / 65535.0);
                    let transform = &body_from_rest[usize::from(joint)];
                    place_m += weight * transform.transform_point3a(surfel.place_m.into());
                    normal += weight * transform.transform_vector3a(surfel.normal.into());
                }
            }
            let normal = normal.normalize_or_zero();
            for axis in 0..3 {
                octet.place_m[axis][i] = place_m[axis];
                octet.normal[axis][i] = normal[axis];
            }
            octet.radius_m[i] = surfel.radius_m;
            if i < surfels.len() {
                octet.share[i] = surfel.share;
            }
        }
    }
}

/// The spheres of the octets.
#[inline(always)]
fn enclose(octets: &[Octet], spheres: &mut Spheres) {
    for (number, octet) in octets.iter().enumerate() {
        let [x, y, z] = &octet.place_m;
        let centre_m = octet.place_m.map(|c| c.iter().sum::<f32>() / LANES as f32);
        let mut radius_m = 0.0f32;
        for i in 0..LANES {
            let [dx, dy, dz] = [x[i] - centre_m[0], y[i] - centre_m[1], z[i] - centre_m[2]];
            radius_m = radius_m.max((dx * dx + dy * dy + dz * dz).sqrt() + octet.radius_m[i]);
        }
        // Rounding must not cut off a weight that is not yet 0.
        spheres.radius_m[number] = radius_m * 1.0001;
        for (centres_m, centre_m) in spheres.centre_m.iter_mut().zip(centre_m) {
            centres_m[number] = centre_m;
        }
    }
}

#[inline(always)]
fn push_block(
    block: &[Guarded],
    scene: &Scene<'_>,
    octets: &[Octet],
    spheres: &mut Spheres,
    near: &mut [u32],
    positions_m: &mut [Vec3],
) {
    // What is missing to eight repeats the last one.
    let last = block.len() - 1;
    let mut places_m = [[0.0; LANES]; 3];
    for i in 0..LANES {
        let place_m = positions_m[block[i.min(last)].vertex as usize];
        (places_m[0][i], places_m[1][i], places_m[2][i]) = (place_m.x, place_m.y, place_m.z);
    }
    let mut sides = None;
    let mut strengths = [scene.strength; LANES];
    for _ in 0..PASSES {
        let bounds = Sphere::round(&places_m);
        if !mark_near(&bounds, octets.len(), spheres) {
            return;
        }
        let sides = sides.get_or_insert_with(|| Sides::new(block, scene));
        let near = list_near(&bounds, sides, octets, &spheres.is_near, near);
        let sums = if sides.spread < 2.0 {
            sum::<true>(&places_m, &sides.posed, octets, near)
        } else {
            sum::<false>(&places_m, &sides.posed, octets, near)
        };
        let Some(pushes_m) = pushes(&sums, &mut strengths) else { return };
        for (places_m, pushes_m) in places_m.iter_mut().zip(&pushes_m) {
            for i in 0..LANES {
                places_m[i] += pushes_m[i];
            }
        }
        for (i, guarded) in block.iter().enumerate() {
            if pushes_m[0][i] != 0.0 || pushes_m[1][i] != 0.0 || pushes_m[2][i] != 0.0 {
                positions_m[guarded.vertex as usize] = Vec3::new(places_m[0][i], places_m[1][i], places_m[2][i]);
            }
        }
        if strengths == [0.0; LANES] {
            return;
        }
    }
}

/// A sphere round a block of vertices.
struct Sphere {
    centre_m: [f32; 3],
    radius_m: f32,
}

impl Sphere {
    #[inline(always)]
    fn round(places_m: &[Lanes; 3]) -> Sphere {
        let bounds = places_m.map(|c| c.iter().fold((f32::MAX, f32::MIN), |(a, b), &c| (a.min(c), b.max(c))));
        let size_m = Vec3::from_array(bounds.map(|(least_m, most_m)| most_m - least_m));
        // Rounding must not cut off a weight that is not yet 0.
        let radius_m = 0.5001 * size_m.length() + 1e-6;
        Sphere { centre_m: bounds.map(|(least_m, most_m)| 0.5 * (least_m + most_m)), radius_m }
    }
}

/// Marks the octets that a block of vertices may touch; whether there are any.
#[inline(always)]
fn mark_near(block: &Sphere, octets: usize, spheres: &mut Spheres) -> bool {
    let Spheres { centre_m: [x, y, z], radius_m, is_near } = spheres;
    let (x, y, z, radius_m) = (&x[..octets], &y[..octets], &z[..octets], &radius_m[..octets]);
    let is_near = &mut is_near[..octets];
    let mut any = false;
    for i in 0..octets {
        let [dx, dy, dz] = [x[i] - block.centre_m[0], y[i] - block.centre_m[1], z[i] - block.centre_m[2]];
        let reach_m = radius_m[i] + block.radius_m;
        is_near[i] = dx * dx + dy * dy + dz * dz < reach_m * reach_m;
        any |= is_near[i];
    }
    any
}

/// Lists the surfels that a block of vertices touches and that face its sides.
#[inline(always)]
fn list_near<'a>(block: &Sphere, sides: &Sides, octets: &[Octet], is_near: &[bool], near: &'a mut [u32]) -> &'a [u32] {
    let mut count = 0;
    for (number, octet) in octets.iter().enumerate().filter(|(number, _)| is_near[*number]) {
        let ([x, y, z], [normal_x, normal_y, normal_z]) = (&octet.place_m, &octet.normal);
        let mut touches = [0; LANES];
        for i in 0..LANES {
            let [dx, dy, dz] = [x[i] - block.centre_m[0], y[i] - block.centre_m[1], z[i] - block.centre_m[2]];
            let reach_m = octet.radius_m[i] + block.radius_m;
            let facing = sides.mean.x * normal_x[i] + sides.mean.y * normal_y[i] + sides.mean.z * normal_z[i];
            let is_reached = dx * dx + dy * dy + dz * dz < reach_m * reach_m;
            touches[i] = u32::from(is_reached & (facing + sides.spread > SIDE_LEAST));
        }
        for (i, touches) in touches.iter().enumerate() {
            near[count] = (number * LANES + i) as u32;
            count += *touches as usize;
        }
    }
    &near[..count]
}

/// The sides of a block's vertices in the pose, their mean, and how far any of them is from it.
struct Sides {
    posed: [Lanes; 3],
    mean: Vec3,
    /// 2 where the vertices may lie on any side: then every surfel counts.
    spread: f32,
}

impl Sides {
    #[inline(always)]
    fn new(block: &[Guarded], scene: &Scene<'_>) -> Sides {
        if block.iter().all(|guarded| guarded.side == [0; 3]) {
            return Sides { posed: [[0.0; LANES]; 3], mean: Vec3::ZERO, spread: 2.0 };
        }
        let mut each = [Vec3::ZERO; LANES];
        for (side, guarded) in each.iter_mut().zip(block) {
            let rest = Vec3A::from_array(guarded.side.map(|side| f32::from(side) * (1.0 / 127.0)));
            let skin = &scene.skin[guarded.vertex as usize];
            for (&joint, &weight) in skin.joints.iter().zip(&skin.weights).filter(|(_, weight)| **weight != 0) {
                let transform = &scene.posed_from_rest[usize::from(joint)];
                *side += Vec3::from(f32::from(weight) * (1.0 / 65535.0) * transform.transform_vector3a(rest));
            }
        }
        let mean = each[..block.len()].iter().sum::<Vec3>() / block.len() as f32;
        let spread = each[..block.len()].iter().map(|side| side.distance(mean)).fold(0.0, f32::max) + 1e-5;
        Sides { posed: [0, 1, 2].map(|axis| each.map(|side| side[axis])), mean, spread }
    }
}

/// Sums over the surfels, by vertex.
struct Sums {
    weight: Lanes,
    height_m: Lanes,
    normal: [Lanes; 3],
}

#[inline(always)]
fn sum<const SIDED: bool>(places_m: &[Lanes; 3], sides: &[Lanes; 3], octets: &[Octet], near: &[u32]) -> Sums {
    let [x, y, z] = *places_m;
    let [side_x, side_y, side_z] = *sides;
    let (mut weights, mut heights_m) = ([0.0; LANES], [0.0; LANES]);
    let (mut normals_x, mut normals_y, mut normals_z) = ([0.0; LANES], [0.0; LANES], [0.0; LANES]);
    for &surfel in near {
        let (octet, of_octet) = (&octets[surfel as usize / LANES], surfel as usize % LANES);
        let place_m = [0, 1, 2].map(|axis| octet.place_m[axis][of_octet]);
        let normal = [0, 1, 2].map(|axis| octet.normal[axis][of_octet]);
        let (radius_m, share) = (octet.radius_m[of_octet], octet.share[of_octet]);
        let per_squared_radius = 1.0 / (radius_m * radius_m);
        for i in 0..LANES {
            let (dx, dy, dz) = (x[i] - place_m[0], y[i] - place_m[1], z[i] - place_m[2]);
            let inside = (1.0 - (dx * dx + dy * dy + dz * dz) * per_squared_radius).max(0.0);
            let mut weight = inside * inside * inside * share;
            if SIDED {
                let facing = side_x[i] * normal[0] + side_y[i] * normal[1] + side_z[i] * normal[2];
                let side = (facing - SIDE_LEAST).max(0.0);
                weight *= side * side;
            }
            weights[i] += weight;
            heights_m[i] += weight * (dx * normal[0] + dy * normal[1] + dz * normal[2]);
            normals_x[i] += weight * normal[0];
            normals_y[i] += weight * normal[1];
            normals_z[i] += weight * normal[2];
        }
    }
    Sums { weight: weights, height_m: heights_m, normal: [normals_x, normals_y, normals_z] }
}

/// What the sums push, by vertex; `None` where they push nothing. `strengths` become those of the next push.
#[inline(always)]
fn pushes(sums: &Sums, strengths: &mut Lanes) -> Option<[Lanes; 3]> {
    let mut any = false;
    for i in 0..LANES {
        any |= sums.height_m[i] < (MARGIN_M + 0.5 * RAMP_M) * sums.weight[i];
    }
    if !any {
        return None;
    }
    let [x, y, z] = &sums.normal;
    let mut by = [0.0; LANES];
    for i in 0..LANES {
        let weight = sums.weight[i].max(1e-12);
        let length = (x[i] * x[i] + y[i] * y[i] + z[i] * z[i]).sqrt().max(1e-12);
        // Too far from all surfels, or between two sides: there is no telling.
        let sure = (weight * (1.0 / ON_SKIN)).sqrt().sqrt() * (1.0 / SURE);
        let trust = smoothstep(sure) * smoothstep((length / weight - 0.1) * (1.0 / 0.7));
        let push_m = strengths[i] * trust * push_m(sums.height_m[i] / weight);
        by[i] = if push_m > 0.0 { push_m / length } else { 0.0 };
        strengths[i] *= trust * smoothstep((push_m - AGAIN_M) * (1.0 / AGAIN_M));
    }
    Some([x, y, z].map(|normal| std::array::from_fn(|i| normal[i] * by[i])))
}

/// How far cloth at this distance is pushed: nothing well outside, out of the body to [`MARGIN_M`] within it.
#[must_use]
#[inline(always)]
pub fn push_m(distance_m: f32) -> f32 {
    let inside_m = (MARGIN_M + 0.5 * RAMP_M - distance_m).max(0.0);
    if inside_m < RAMP_M { inside_m * inside_m * (0.5 / RAMP_M) } else { inside_m - 0.5 * RAMP_M }
}

/// 0 below 0, 1 above 1, smooth between.
#[inline(always)]
fn smoothstep(t: f32) -> f32 {
    let t = t.clamp(0.0, 1.0);
    t * t * (3.0 - 2.0 * t)
}
