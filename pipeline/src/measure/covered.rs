//! Which skin of the wearer the kimono covers, whatever she does, so that nobody need draw it: blended cloth may then lie a little in the
//! body and nothing shows. Knows neither files nor pictures.

use crate::ir::Body;
use crate::look::frames::{Blend, Shot, Stage, own_poses};
use crate::look::raster::smooth_normals;
use crate::stages::laplacian::Neighbours;
use crate::stages::twins::Twins;
use glam::Vec3;
use kitsuke::skeleton::{Bone, Pose};
use kitsuke::{Frame, Garment, Scratch, evaluate};
use parry3d::query::{Ray, RayCast};
use parry3d::shape::TriMesh;
use rayon::prelude::*;
use std::cmp::Reverse;
use std::collections::BinaryHeap;

/// Visible skin goes on at least this far under the cloth, metres.
pub const RIM_M: f32 = 0.02;

/// Directions that are looked along from every place of the skin.
const RAYS: usize = 32;
/// At most so many of them may meet no cloth.
const OPEN_RAYS: usize = 6;
/// From at most so many of the [`views`] a place of the skin may be seen in a sample, and in the T-pose from none.
const SEEN_VIEWS: usize = 3;
/// Cloth farther off covers nothing, metres.
const FARTHEST_M: f32 = 0.6;
/// Cloth that lies no deeper than this in a leg covers it all the same, metres: samples of fitted kimono lie up to some centimetres inside.
const DEEPEST_IN_LEGS_M: f32 = 0.04;
/// The same for arms and trunk, metres; deeper is the other side of a wrist, where the cloth's other side would pass for a cover.
const DEEPEST_M: f32 = 0.01;
/// Whoever looks flatter along the skin than by this cosine sees none of it.
const GRAZING: f32 = 0.05;
/// What looks out from the skin stands so far off it, metres.
const OFF_M: f32 = 1e-3;

/// Whether the cloth covers each vertex of the body, in the order of [`Body::surface`]: in the base and in every sample of the garment
/// most directions away from the skin meet cloth, and hardly anybody who stands round the wearer sees it (in the base nobody), there and
/// up to [`RIM_M`] around. Head, neck, hands and feet never are covered. A triangle need not be drawn when all its corners are covered.
///
/// The garment must be that of the body: its own, or the fitted one with [`super::wearer::worn`].
#[must_use]
pub fn covered(garment: &Garment, body: &Body) -> Vec<bool> {
    let twins = Twins::of(body);
    let mut stage = Stage::new(garment);
    let mut under: Vec<u32> = (0..body.skin.len() as u32).filter(|&v| twins.first[v as usize] == v).collect();
    under.retain(|&v| limb(body, v).is_some());
    for shot in own_poses(garment) {
        under = under_cloth(&under, garment, body, &twins, &mut stage, &shot);
    }
    let mut covered: Vec<bool> = twins.first.iter().map(|first| under.binary_search(first).is_ok()).collect();
    without_rim(&mut covered, body);
    covered
}

/// A part of the wearer that clothes cover.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Limb {
    /// Upper and lower arms.
    Arms,
    /// Hips to shoulders.
    Trunk,
    /// Upper and lower legs.
    Legs,
}

/// What a vertex of the body belongs to, by the joint that it follows most; `None` for head, neck, hands and feet.
///
/// # Panics
/// When the body has no such vertex.
#[must_use]
pub fn limb(body: &Body, vertex: u32) -> Option<Limb> {
    let weights = &body.skin[vertex as usize];
    let (joint, _) = weights.iter().max_by(|a, b| a.1.total_cmp(&b.1))?;
    match body.skeleton.joints()[usize::from(*joint)].bone {
        Bone::Hips | Bone::Spine | Bone::Chest | Bone::UpperChest | Bone::LeftShoulder | Bone::RightShoulder => {
            Some(Limb::Trunk)
        }
        Bone::LeftUpperArm | Bone::LeftLowerArm | Bone::RightUpperArm | Bone::RightLowerArm => Some(Limb::Arms),
        Bone::LeftUpperLeg | Bone::LeftLowerLeg | Bone::RightUpperLeg | Bone::RightLowerLeg => Some(Limb::Legs),
        _ => None,
    }
}

/// The area of the triangles of a body of which each corner is so, square metres.
#[must_use]
pub fn area_m2(body: &Body, is_so: impl Fn(u32) -> bool) -> f32 {
    let triangles = body.surface.triangles.iter().filter(|triangle| triangle.iter().all(|&v| is_so(v)));
    triangles.map(|&triangle| doubled_area(&body.surface.positions_m, triangle).length() / 2.0).sum()
}

/// Skin that the base covers and that is seen all the same from front, back, left or right.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Seen {
    /// When all skin is drawn, square metres.
    pub of_all_m2: f32,
    /// When covered skin is not, square metres.
    pub of_rest_m2: f32,
}

/// What is seen in each pose of skin that the T-pose hides, with the mask of [`covered`] and without.
///
/// # Panics
/// When the mask is not as long as the body has vertices.
#[must_use]
pub fn seen(garment: &Garment, body: &Body, covered: &[bool], poses: &[Pose]) -> Vec<Seen> {
    assert_eq!(covered.len(), body.skin.len(), "one flag per vertex");
    let twins = Twins::of(body);
    let all: Vec<u32> = (0..body.skin.len() as u32).filter(|&v| limb(body, v).is_some()).collect();
    let base = &own_poses(garment)[0];
    let mut hidden = vec![false; body.skin.len()];
    under_cloth(&all, garment, body, &twins, &mut Stage::new(garment), base)
        .iter()
        .for_each(|&v| hidden[v as usize] = true);
    let (hidden, rest): (Vec<[u32; 3]>, Vec<[u32; 3]>) =
        body.surface.triangles.iter().partition(|triangle| triangle.iter().all(|&v| hidden[v as usize]));
    let drawn = |triangle: &&[u32; 3]| triangle.iter().any(|&v| !covered[v as usize]);
    let drawn_of_hidden: Vec<[u32; 3]> = hidden.iter().filter(drawn).copied().collect();
    let in_pose = |scratch: &mut Scratch, pose: &Pose| {
        let pose = pose.sanitised();
        let body_m = body.posed_m(&pose);
        let mut cloth_m = vec![Vec3::ZERO; garment.vertex_count()];
        let mut normals = cloth_m.clone();
        evaluate(garment, &pose, scratch, Frame { positions_m: &mut cloth_m, normals: &mut normals });
        let Some(cloth) = mesh(&cloth_m, &garment.data().mesh.triangles) else { return Seen::default() };
        let of = |triangles: &[[u32; 3]]| {
            let skin = mesh(&body_m, &[triangles, &rest].concat());
            let meets = |ray: &Ray| {
                [Some(&cloth), skin.as_ref()].into_iter().flatten().any(|mesh| mesh.intersects_local_ray(ray, f32::MAX))
            };
            triangles.iter().map(|&triangle| seen_m2(&body_m, triangle, meets)).sum()
        };
        Seen { of_all_m2: of(&hidden), of_rest_m2: of(&drawn_of_hidden) }
    };
    poses.par_iter().map_init(|| Scratch::new(garment), in_pose).collect()
}

/// The triangle's area if from its middle one can look out at the front, the back or a side.
fn seen_m2(positions_m: &[Vec3], triangle: [u32; 3], meets: impl Fn(&Ray) -> bool) -> f32 {
    let doubled = doubled_area(positions_m, triangle);
    let normal = doubled.normalize_or_zero();
    let middle_m = triangle.map(|v| positions_m[v as usize]).iter().sum::<Vec3>() / 3.0;
    let is_seen = [Vec3::Z, Vec3::NEG_Z, Vec3::X, Vec3::NEG_X]
        .iter()
        .any(|&towards| normal.dot(towards) > GRAZING && !meets(&ray(middle_m + OFF_M * normal, towards)));
    if is_seen { doubled.length() / 2.0 } else { 0.0 }
}

fn doubled_area(positions_m: &[Vec3], triangle: [u32; 3]) -> Vec3 {
    let [a, b, c] = triangle.map(|v| positions_m[v as usize]);
    (b - a).cross(c - a)
}

fn ray(from_m: Vec3, towards: Vec3) -> Ray {
    Ray::new(from_m.to_array().into(), towards.to_array().into())
}

fn mesh(positions_m: &[Vec3], triangles: &[[u32; 3]]) -> Option<TriMesh> {
    TriMesh::new(positions_m.iter().map(|p| p.to_array().into()).collect(), triangles.to_vec()).ok()
}

/// Those of the vertices that lie under cloth in this shot.
fn under_cloth(
    vertices: &[u32],
    garment: &Garment,
    body: &Body,
    twins: &Twins,
    stage: &mut Stage<'_>,
    shot: &Shot,
) -> Vec<u32> {
    let Some(cloth) = mesh(stage.show(shot).0, &garment.data().mesh.triangles) else { return Vec::new() };
    let positions_m = body.posed_m(&shot.pose.sanitised());
    let normals = smooth_normals(&positions_m, &twins.triangles);
    let skin = mesh(&positions_m, &twins.triangles);
    let around = directions();
    let views = views();
    let seen_at_most = if shot.blend == Blend::Alone(None) { 0 } else { SEEN_VIEWS };
    let is_under = |v: &&u32| {
        let first = twins.first[**v as usize] as usize;
        let (place_m, normal) = (positions_m[first], normals[first]);
        let (side, other_side) = normal.any_orthonormal_pair();
        let deepest_m = if limb(body, **v) == Some(Limb::Legs) { DEEPEST_IN_LEGS_M } else { DEEPEST_M };
        // From just under the skin, through it.
        let is_open = |towards: Vec3, farthest_m| {
            !cloth.intersects_local_ray(&ray(place_m - deepest_m * normal, towards), farthest_m)
        };
        let is_open_around = |d: &&Vec3| is_open(d.x * side + d.y * other_side + d.z * normal, FARTHEST_M);
        let is_seen = |&&towards: &&Vec3| {
            normal.dot(towards) > GRAZING
                && is_open(towards, f32::MAX)
                && !skin
                    .as_ref()
                    .is_some_and(|skin| skin.intersects_local_ray(&ray(place_m + OFF_M * normal, towards), f32::MAX))
        };
        normal != Vec3::ZERO
            && around.iter().filter(is_open_around).take(OPEN_RAYS + 1).count() <= OPEN_RAYS
            && views.iter().filter(is_seen).take(seen_at_most + 1).count() <= seen_at_most
    };
    vertices.par_iter().filter(is_under).copied().collect()
}

/// From where people look at a wearer: all round, level and from above.
fn views() -> Vec<Vec3> {
    const AROUND: usize = 16;
    const UP_RAD: [f32; 3] = [0.0, 0.35, 0.8];
    let view = |up_rad: f32, i: usize| {
        let angle = i as f32 * std::f32::consts::TAU / AROUND as f32;
        let level = libm::cosf(up_rad);
        Vec3::new(level * libm::sinf(angle), libm::sinf(up_rad), level * libm::cosf(angle))
    };
    UP_RAD.iter().flat_map(|&up_rad| (0..AROUND).map(move |i| view(up_rad, i))).collect()
}

/// Directions about +Z on a spiral, the denser the steeper: each stands for an equal share of what is seen of the skin.
fn directions() -> [Vec3; RAYS] {
    const GOLDEN_RAD: f32 = 2.399_963_2;
    std::array::from_fn(|i| {
        let sine_squared = (i as f32 + 0.5) / RAYS as f32;
        let (sine, angle) = (sine_squared.sqrt(), i as f32 * GOLDEN_RAD);
        Vec3::new(sine * libm::cosf(angle), sine * libm::sinf(angle), (1.0 - sine_squared).sqrt())
    })
}

/// Takes what lies no farther than [`RIM_M`] from skin that is not covered, along edges, out of the mask.
fn without_rim(covered: &mut [bool], body: &Body) {
    let positions_m = &body.surface.positions_m;
    let neighbours = Neighbours::new(positions_m, &body.surface.triangles);
    let mut away_m: Vec<f32> = covered.iter().map(|&covered| if covered { f32::MAX } else { 0.0 }).collect();
    // Distances are not negative, so their bits are in their order.
    let open = (0..covered.len() as u32).filter(|&v| !covered[v as usize]);
    let mut pending: BinaryHeap<Reverse<(u32, u32)>> = open.map(|v| Reverse((0, v))).collect();
    while let Some(Reverse((bits, v))) = pending.pop() {
        if away_m[v as usize].to_bits() < bits {
            continue;
        }
        for &to in neighbours.of(v as usize) {
            let to_m = away_m[v as usize] + positions_m[v as usize].distance(positions_m[to as usize]);
            if to_m <= RIM_M && to_m < away_m[to as usize] {
                away_m[to as usize] = to_m;
                covered[to as usize] = false;
                pending.push(Reverse((to_m.to_bits(), to)));
            }
        }
    }
}
