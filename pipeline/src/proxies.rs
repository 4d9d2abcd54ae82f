//! Clearance proxies: points of the wearer's skin, limb by limb, and which cloth comes near them in a fixed sequence of
//! poses. Knows no pack.

use crate::StageError;
use crate::ir::Body;
use crate::laplacian::Neighbours;
use crate::pose_space;
use crate::weights::shares;
use glam::Vec3;
use kitsuke::clearance::{Guarded, Proxy, Surfel};
use kitsuke::evaluate::{blend, clear, skin};
use kitsuke::garment::{GarmentData, SkinWeights};
use kitsuke::skeleton::{Bone, Pose, Skeleton};
use kitsuke::{Garment, Rates, Scratch, pose_blend};
use rayon::prelude::*;
use std::collections::BTreeSet;

/// Counts up whenever the same input gives other proxies.
pub const VERSION: u32 = 2;

/// How finely the body is taken, and in how many poses cloth is looked for.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Settings {
    /// Arms up to the wrists.
    pub arm: Grain,
    /// Hands.
    pub hand: Grain,
    /// Trunk and thighs.
    pub trunk: Grain,
    /// Poses in which cloth is looked for.
    pub poses: usize,
    /// Cloth is guarded that is pushed farther than this in one of them, metres,
    pub least_push_m: f32,
    /// and cloth so many edges from such, so that none is left behind alone.
    pub rings: usize,
}

/// How finely a part of the body is taken.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Grain {
    /// Surfels that face one way stand no nearer than this, metres.
    pub spacing_m: f32,
    /// Where their weight ends, metres.
    pub radius_m: f32,
}

impl Default for Settings {
    fn default() -> Settings {
        Settings {
            arm: Grain { spacing_m: 0.016, radius_m: 0.038 },
            hand: Grain { spacing_m: 0.009, radius_m: 0.028 },
            trunk: Grain { spacing_m: 0.042, radius_m: 0.075 },
            poses: 1000,
            least_push_m: 0.004,
            rings: 1,
        }
    }
}

/// The part of a limb that a joint moves.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Limb {
    Trunk,
    Arm(Side),
    Hand(Side),
    /// Nothing that cloth of this cut comes near: head and shins.
    Other,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Side {
    Left,
    Right,
}

/// The limbs of a skeleton's joints.
fn limbs(skeleton: &Skeleton) -> Vec<Limb> {
    let mut limbs: Vec<Limb> = Vec::new();
    for joint in skeleton.joints() {
        let above = joint.parent.map_or(Limb::Trunk, |parent| limbs[usize::from(parent)]);
        limbs.push(match joint.bone {
            Bone::LeftUpperArm => Limb::Arm(Side::Left),
            Bone::RightUpperArm => Limb::Arm(Side::Right),
            Bone::LeftHand => Limb::Hand(Side::Left),
            Bone::RightHand => Limb::Hand(Side::Right),
            Bone::Neck | Bone::LeftLowerLeg | Bone::RightLowerLeg => Limb::Other,
            _ => above,
        });
    }
    limbs
}

/// The proxies of a body, guarding nothing yet: trunk and arms, so far as it has them.
#[must_use]
pub fn proxies(body: &Body, settings: &Settings) -> Vec<Proxy> {
    let limbs = limbs(&body.skeleton);
    let share = |vertex: usize, is_wanted: &dyn Fn(Limb) -> bool| -> f32 {
        body.skin[vertex].iter().filter(|(joint, _)| is_wanted(limbs[usize::from(*joint)])).map(|(_, w)| w).sum()
    };
    let all = 0..body.surface.positions_m.len();
    let skin = Skin::new(body);
    let arm = |name: &str, side: Side| {
        let of_hand = |vertex: usize| share(vertex, &|limb| limb == Limb::Hand(side));
        let of_arm = |vertex: usize| of_hand(vertex) + share(vertex, &|limb| limb == Limb::Arm(side));
        let (hand, arm): (Vec<usize>, Vec<usize>) =
            all.clone().filter(|&vertex| of_arm(vertex) > 0.25).partition(|&vertex| of_hand(vertex) >= 0.7);
        let mut surfels = skin.surfels(&arm, settings.arm);
        surfels.extend(skin.surfels(&hand, settings.hand));
        (name.to_owned(), surfels)
    };
    let is_arm = |limb| matches!(limb, Limb::Arm(_) | Limb::Hand(_));
    let trunk = all
        .clone()
        .filter(|&vertex| share(vertex, &is_arm) <= 0.75 && share(vertex, &|limb| limb == Limb::Other) < 0.5);
    let trunk = ("trunk".to_owned(), skin.surfels(&trunk.collect::<Vec<_>>(), settings.trunk));
    let parts = [arm("leftArm", Side::Left), arm("rightArm", Side::Right), trunk];
    let proxy = |(name, mut surfels): (String, Vec<Surfel>)| {
        let original = surfels.clone();
        // Over a round limb the planes of neighbours lie above the skin: they are moved until the skin is at height 0.
        for _ in 0..CALIBRATIONS {
            let heights_m: Vec<f32> = original.iter().map(|surfel| height_m(&surfels, surfel.place_m)).collect();
            for (surfel, height_m) in surfels.iter_mut().zip(heights_m) {
                surfel.place_m += height_m * surfel.normal;
            }
        }
        let order = in_clusters(&original.iter().map(|surfel| surfel.place_m).collect::<Vec<_>>());
        Proxy { name, surfels: order.into_iter().map(|i| surfels[i]).collect(), guarded: Vec::new() }
    };
    parts.into_iter().filter(|(_, surfels)| !surfels.is_empty()).map(proxy).collect()
}

const CALIBRATIONS: usize = 3;

/// The body's skin with what surfels are made of.
struct Skin<'a> {
    body: &'a Body,
    normals: Vec<Vec3>,
    areas_m2: Vec<f32>,
}

impl Skin<'_> {
    fn new(body: &Body) -> Skin<'_> {
        let places_m = &body.surface.positions_m;
        let (mut normals, mut areas_m2) = (vec![Vec3::ZERO; places_m.len()], vec![0.0; places_m.len()]);
        for corners in &body.surface.triangles {
            let [a, b, c] = corners.map(|corner| places_m[corner as usize]);
            let doubled_area = (b - a).cross(c - a);
            for &corner in corners {
                normals[corner as usize] += doubled_area;
                areas_m2[corner as usize] += doubled_area.length() / 6.0;
            }
        }
        let normals = normals.into_iter().map(Vec3::normalize_or_zero).collect();
        Skin { body, normals, areas_m2 }
    }

    /// As many of these vertices as stand far enough apart, each with the area of those left out that it is nearest to.
    fn surfels(&self, vertices: &[usize], grain: Grain) -> Vec<Surfel> {
        let places_m = &self.body.surface.positions_m;
        let mut kept: Vec<usize> = Vec::new();
        for &vertex in vertices.iter().filter(|&&vertex| self.normals[vertex] != Vec3::ZERO) {
            let is_beside = |&known: &usize| {
                places_m[known].distance(places_m[vertex]) < grain.spacing_m
                    && self.normals[known].dot(self.normals[vertex]) > 0.3
            };
            if !kept.iter().any(is_beside) {
                kept.push(vertex);
            }
        }
        let mut areas_m2 = vec![0.0; kept.len()];
        for &vertex in vertices {
            let distance_m = |i: &usize| places_m[kept[*i]].distance_squared(places_m[vertex]);
            if let Some(nearest) = (0..kept.len()).min_by(|a, b| distance_m(a).total_cmp(&distance_m(b))) {
                areas_m2[nearest] += self.areas_m2[vertex];
            }
        }
        let surfel = |(&vertex, area_m2): (&usize, f32)| Surfel {
            place_m: places_m[vertex],
            normal: self.normals[vertex],
            radius_m: grain.radius_m,
            share: (area_m2 / (grain.radius_m * grain.radius_m)).clamp(1e-6, 1e3),
            skin: quantised(&self.body.skin[vertex]),
        };
        kept.iter().zip(areas_m2).map(surfel).collect()
    }
}

fn quantised(weights: &[(u8, f32); 4]) -> SkinWeights {
    let shares = shares(&weights.map(|(_, weight)| f64::from(weight)));
    SkinWeights { joints: weights.map(|(joint, _)| joint), weights: shares.try_into().expect("four weights") }
}

/// The height of a point over surfels at rest, as frames take it, whatever side it is on.
fn height_m(surfels: &[Surfel], place_m: Vec3) -> f32 {
    let (mut sum, mut weights) = (0.0, 0.0);
    for surfel in surfels {
        let from = place_m - surfel.place_m;
        let inside = (1.0 - from.length_squared() / (surfel.radius_m * surfel.radius_m)).max(0.0);
        let weight = inside * inside * inside * surfel.share;
        sum += weight * from.dot(surfel.normal);
        weights += weight;
    }
    if weights > 0.0 { sum / weights } else { 0.0 }
}

/// Cloth of a proxy's own arm knows its side; this much of it must follow the arm.
const OWN_SHARE: f32 = 0.4;

/// Lets every proxy guard these unique vertices: pairs of a proxy's number and a vertex.
pub fn assign(proxies: &mut [Proxy], garment: &GarmentData, guarded: &[[u32; 2]]) {
    let limbs = limbs(&garment.skeleton);
    let base_m = &garment.mesh.positions_m;
    for (number, proxy) in proxies.iter_mut().enumerate() {
        let (side, upper) = match proxy.name.as_str() {
            "leftArm" => (Some(Side::Left), Bone::LeftUpperArm),
            "rightArm" => (Some(Side::Right), Bone::RightUpperArm),
            _ => (None, Bone::Hips),
        };
        let axis_m = garment.skeleton.index_of(upper).map(|joint| garment.skeleton.joints()[joint].rest_m);
        let guard = |vertex: u32| {
            let skin = &garment.skin[vertex as usize];
            let is_own = |joint: u8| {
                side.is_some_and(|side| [Limb::Arm(side), Limb::Hand(side)].contains(&limbs[usize::from(joint)]))
            };
            let own = skin.joints.iter().zip(&skin.weights).filter(|(joint, _)| is_own(**joint));
            let own: f32 = own.map(|(_, &weight)| f32::from(weight) / 65535.0).sum();
            // In the T-pose the arms lie along X.
            let out = axis_m.map(|axis_m| (base_m[vertex as usize] - axis_m).with_x(0.0).normalize_or_zero());
            let out = out.filter(|_| own > OWN_SHARE).unwrap_or(Vec3::ZERO);
            Guarded { vertex, side: (out * 127.0).to_array().map(|side| side.round() as i8) }
        };
        let vertices: Vec<u32> = guarded.iter().filter(|[p, _]| *p == number as u32).map(|[_, v]| *v).collect();
        let order = in_clusters(&vertices.iter().map(|&vertex| base_m[vertex as usize]).collect::<Vec<_>>());
        proxy.guarded = order.into_iter().map(|i| guard(vertices[i])).collect();
    }
}

/// The vertices that the proxies push in some pose of the [`pose_space`], and those around them: pairs of a proxy's
/// number and a vertex, sorted.
///
/// # Errors
/// When the proxies break a rule of the garment.
pub fn near(garment: &Garment, proxies: &[Proxy], settings: &Settings) -> Result<Vec<[u32; 2]>, StageError> {
    let data = garment.data();
    let poses = pose_space::poses(&data.poses, settings.poses);
    let mut all: BTreeSet<[u32; 2]> = BTreeSet::new();
    for (number, proxy) in proxies.iter().enumerate() {
        let mut alone = [proxy.clone()];
        let everything: Vec<[u32; 2]> = (0..garment.unique_count() as u32).map(|vertex| [0, vertex]).collect();
        assign(&mut alone, data, &everything);
        let garment = Garment::new(GarmentData { proxies: alone.to_vec(), ..data.clone() })
            .map_err(|error| StageError::new("proxies", error.to_string()))?;
        let found = poses.par_iter().map(|pose| pushed(&garment, pose, settings.least_push_m));
        let found: Vec<Vec<u32>> = found.collect();
        all.extend(found.into_iter().flatten().map(|vertex| [number as u32, vertex]));
    }
    let unique = |vertex: u32| match (vertex as usize).checked_sub(data.mesh.positions_m.len()) {
        Some(twin) => data.mesh.twin_of[twin],
        None => vertex,
    };
    let triangles: Vec<[u32; 3]> = data.mesh.triangles.iter().map(|triangle| triangle.map(unique)).collect();
    let neighbours = Neighbours::new(&data.mesh.positions_m, &triangles);
    for _ in 0..settings.rings {
        let beside = |&[p, vertex]: &[u32; 2]| neighbours.of(vertex as usize).iter().map(move |&v| [p, v]);
        let wider: Vec<[u32; 2]> = all.iter().flat_map(beside).collect();
        all.extend(wider);
    }
    Ok(all.into_iter().collect())
}

fn pushed(garment: &Garment, pose: &Pose, least_push_m: f32) -> Vec<u32> {
    let (mut scratch, mut rates) = (Scratch::new(garment), Rates::new(garment));
    let mut skinned_m = vec![Vec3::ZERO; garment.vertex_count()];
    pose_blend::rates(garment.kernel(), garment, pose, &mut rates);
    blend(garment, &rates, &mut scratch);
    skin(garment, pose, &mut scratch, &mut skinned_m);
    let mut cleared_m = skinned_m.clone();
    clear(garment, pose, &mut scratch, &mut cleared_m);
    let is_pushed = |&vertex: &usize| cleared_m[vertex].distance(skinned_m[vertex]) > least_push_m;
    (0..garment.unique_count()).filter(is_pushed).map(|vertex| vertex as u32).collect()
}

/// An order in which places that follow one another by eights lie near one another: halves, quarters … along the longest
/// side.
fn in_clusters(places_m: &[Vec3]) -> Vec<usize> {
    fn sort(places_m: &[Vec3], order: &mut [usize]) {
        const TOGETHER: usize = 8;
        if order.len() <= TOGETHER {
            return;
        }
        let places = || order.iter().map(|&i| places_m[i]);
        let size_m = places().reduce(Vec3::max).unwrap_or_default() - places().reduce(Vec3::min).unwrap_or_default();
        let axis = size_m.max_position();
        order.sort_by(|&a, &b| places_m[a][axis].total_cmp(&places_m[b][axis]).then(a.cmp(&b)));
        let (first, second) = order.split_at_mut((order.len() / 2).next_multiple_of(TOGETHER));
        sort(places_m, first);
        sort(places_m, second);
    }
    let mut order: Vec<usize> = (0..places_m.len()).collect();
    sort(places_m, &mut order);
    order
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn clusters_hold_every_place_once_and_neighbours_together() {
        let places_m: Vec<Vec3> = (0..100).map(|i| Vec3::new((i * 37 % 100) as f32, 0.0, 0.0)).collect();
        let order = in_clusters(&places_m);
        let mut sorted = order.clone();
        sorted.sort_unstable();
        assert_eq!(sorted, (0..100).collect::<Vec<_>>());
        for eight in order.chunks(8) {
            let x: Vec<f32> = eight.iter().map(|&i| places_m[i].x).collect();
            let width = x.iter().copied().fold(f32::MIN, f32::max) - x.iter().copied().fold(f32::MAX, f32::min);
            assert!(width < 8.0, "{x:?}");
        }
    }
}
