//! Skin weights of the kimono from those of the body under it. Knows nothing of targets and packs.
//!
//! The body lends its weights where the cloth lies on it; where it hangs free (the bag of a sleeve, the hem) they are
//! filled in over the mesh (Abdrashitov, Raichstat, Monsen, Hill: Robust Skin Weights Transfer via Weight Inpainting,
//! 2023). A kimono is worn as a tube: below the obi the cloth follows both thighs alike, below the knees both lower legs alike, and never
//! one leg.

use crate::ir::{Body, Surface};
use crate::stages::StageError;
use crate::stages::laplacian::{Neighbours, diffuse};
use crate::stages::weights::shares;
use glam::Vec3;
use kitsuke::arrays::SkinWeights;
use kitsuke::skeleton::{Bone, Skeleton};
use parry3d::query::PointQueryWithLocation;
use parry3d::shape::TriMesh;
use rayon::prelude::*;

/// Where the body's weights are believed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Settings {
    /// Cloth farther than this from the body does not take its weights, metres.
    pub near_m: f32,
    /// Cloth whose normal differs more than this from the body's does not either, radians.
    pub aligned_rad: f32,
    /// Rounds of smoothing at the end.
    pub smoothing_rounds: u32,
    /// How far below the knees the skirt follows the lower legs alone, metres.
    pub knee_m: f32,
}

impl Default for Settings {
    fn default() -> Settings {
        Settings { near_m: 0.05, aligned_rad: 50f32.to_radians(), smoothing_rounds: 8, knee_m: 0.05 }
    }
}

/// Joints that move cloth. Every other joint's weight goes to the nearest of these above it: hands to the lower arm
/// (a sleeve is an open bag), head and neck to the chest (a collar lies on the shoulders), legs to the hips.
const CLOTH_BONES: [Bone; 10] = [
    Bone::Hips,
    Bone::Spine,
    Bone::Chest,
    Bone::UpperChest,
    Bone::LeftShoulder,
    Bone::LeftUpperArm,
    Bone::LeftLowerArm,
    Bone::RightShoulder,
    Bone::RightUpperArm,
    Bone::RightLowerArm,
];

/// Weights for every vertex of the base, at most four joints of the body's skeleton each, left and right leg always alike.
/// `skirt_top_m` is the height where the skirt begins.
///
/// # Errors
/// When the body has no surface.
pub fn skin(
    base: &Surface,
    body: &Body,
    skirt_top_m: f32,
    settings: &Settings,
) -> Result<Vec<SkinWeights>, StageError> {
    let lent = lend(base, body, settings)?;
    let neighbours = Neighbours::new(&base.positions_m, &base.triangles);
    let columns: Vec<Vec<f64>> = lent
        .weights_by_joint
        .par_iter()
        .map(|weights| {
            if weights.iter().all(|&w| w == 0.0) {
                return Ok(weights.clone());
            }
            let anchors: Vec<f64> = lent.believed.iter().map(|&b| if b { f64::INFINITY } else { 0.0 }).collect();
            let filled = diffuse(&neighbours, &anchors, weights)?;
            Ok((0..settings.smoothing_rounds).fold(filled, |weights, _| neighbours.smoothed(&weights)))
        })
        .collect::<Result<_, StageError>>()?;
    let skirt = Skirt::new(&body.skeleton, skirt_top_m, settings);
    Ok((0..base.positions_m.len())
        .map(|v| {
            let row: Vec<f64> = columns.iter().map(|column| column[v].max(0.0)).collect();
            quantise(&row, &skirt, base.positions_m[v].y)
        })
        .collect())
}

/// What the body lends to the cloth.
struct Lent {
    /// Per joint of the skeleton, one weight per vertex of the base.
    weights_by_joint: Vec<Vec<f64>>,
    /// Whether the cloth lies on the body there.
    believed: Vec<bool>,
}

/// The weights of the closest point of the body, carried to joints that move cloth.
fn lend(base: &Surface, body: &Body, settings: &Settings) -> Result<Lent, StageError> {
    let skin = &body.surface;
    let points = skin.positions_m.iter().map(|p| p.to_array().into()).collect();
    let mesh = TriMesh::new(points, skin.triangles.clone())
        .map_err(|error| StageError::new("skin", format!("the body's surface is no triangle mesh: {error}")))?;
    let body_normals = vertex_normals(skin);
    let cloth_normals = vertex_normals(base);
    let carried_to = cloth_joints(&body.skeleton);
    let aligned = libm::cosf(settings.aligned_rad);
    let rows: Vec<(Vec<f64>, bool)> = (0..base.positions_m.len())
        .into_par_iter()
        .map(|v| {
            let position_m = base.positions_m[v];
            let (_, (triangle, place)) = mesh.project_local_point_and_get_location(position_m.to_array().into(), false);
            // A flat triangle has no barycentric coordinates; its first corner stands for it.
            let corners = place.barycentric_coordinates().unwrap_or([1.0, 0.0, 0.0]);
            let mut row = vec![0.0; carried_to.len()];
            let (mut nearest_m, mut normal) = (Vec3::ZERO, Vec3::ZERO);
            for (&corner, share) in skin.triangles[triangle as usize].iter().zip(corners) {
                nearest_m += share * skin.positions_m[corner as usize];
                normal += share * body_normals[corner as usize];
                for (joint, weight) in body.skin[corner as usize] {
                    row[carried_to[usize::from(joint)]] += f64::from(share) * f64::from(weight);
                }
            }
            let believed = nearest_m.distance(position_m) <= settings.near_m
                && normal.normalize_or_zero().dot(cloth_normals[v]) >= aligned;
            (row, believed)
        })
        .collect();
    let weights_by_joint = (0..carried_to.len()).map(|j| rows.iter().map(|(row, _)| row[j]).collect()).collect();
    Ok(Lent { weights_by_joint, believed: rows.iter().map(|(_, believed)| *believed).collect() })
}

/// For each joint the nearest one at or above it that moves cloth; the root where there is none.
fn cloth_joints(skeleton: &Skeleton) -> Vec<usize> {
    let joints = skeleton.joints();
    let mut carried_to = Vec::with_capacity(joints.len());
    for (i, joint) in joints.iter().enumerate() {
        carried_to.push(match joint.parent {
            Some(parent) if !CLOTH_BONES.contains(&joint.bone) => carried_to[usize::from(parent)],
            _ => i,
        });
    }
    carried_to
}

/// Unit normals of the vertices, weighted by area; zero where no triangle is.
fn vertex_normals(surface: &Surface) -> Vec<Vec3> {
    let mut normals = vec![Vec3::ZERO; surface.positions_m.len()];
    for triangle in &surface.triangles {
        let [a, b, c] = triangle.map(|v| surface.positions_m[v as usize]);
        for v in triangle {
            normals[*v as usize] += (b - a).cross(c - a);
        }
    }
    normals.into_iter().map(Vec3::normalize_or_zero).collect()
}

/// Where the hips hand over to the thighs, and these to the lower legs.
struct Skirt {
    hips: usize,
    /// Joints of both upper and of both lower legs; none when the skeleton has not both.
    legs: [Option<[u8; 2]>; 2],
    top_m: f32,
    knee_m: f32,
    shin_m: f32,
}

impl Skirt {
    fn new(skeleton: &Skeleton, top_m: f32, settings: &Settings) -> Skirt {
        let joint = |bone| skeleton.index_of(bone);
        let height_m = |bone| joint(bone).map(|i| skeleton.joints()[i].rest_m.y);
        let pair = |left, right| joint(left).zip(joint(right)).map(|(l, r)| [l as u8, r as u8]);
        let hips = joint(Bone::Hips).unwrap_or(0);
        let hips_m = skeleton.joints()[hips].rest_m.y;
        let knee_m = height_m(Bone::LeftLowerLeg).unwrap_or(0.5 * hips_m).min(top_m - 0.05);
        let thighs = pair(Bone::LeftUpperLeg, Bone::RightUpperLeg);
        let shins = thighs.and(pair(Bone::LeftLowerLeg, Bone::RightLowerLeg));
        Skirt { hips, legs: [thighs, shins], top_m, knee_m, shin_m: knee_m - settings.knee_m }
    }

    /// How much of the hips' weight both thighs and both lower legs take at a height: the thighs 0 at the obi and all at the
    /// knee, from there on the lower legs, smoothly.
    fn leg_shares(&self, height_m: f32) -> [f64; 2] {
        let smooth = |from_m: f32, to_m: f32| {
            let t = f64::from(((from_m - height_m) / (from_m - to_m)).clamp(0.0, 1.0));
            t * t * (3.0 - 2.0 * t)
        };
        let below_obi = if self.legs[0].is_some() { smooth(self.top_m, self.knee_m) } else { 0.0 };
        let below_knee = if self.legs[1].is_some() { smooth(self.knee_m, self.shin_m) } else { 0.0 };
        [below_obi * (1.0 - below_knee), below_obi * below_knee]
    }
}

/// The four largest weights as shares; a pair of legs counts as two and stays equal, but for the odd unit.
fn quantise(row: &[f64], skirt: &Skirt, height_m: f32) -> SkinWeights {
    let leg_shares = skirt.leg_shares(height_m);
    let mut wanted: Vec<([u8; 2], f64)> = row.iter().enumerate().map(|(j, &w)| ([j as u8; 2], w)).collect();
    wanted[skirt.hips].1 *= 1.0 - leg_shares[0] - leg_shares[1];
    for (pair, share) in skirt.legs.iter().zip(leg_shares) {
        wanted.extend(pair.map(|pair| (pair, row[skirt.hips] * share)));
    }
    // Less than half a unit would be stored as nothing.
    wanted.retain(|(_, weight)| *weight > 0.5 / 65535.0);
    wanted.sort_by(|a, b| b.1.total_cmp(&a.1));
    let mut free = 4;
    wanted.retain(|([one, other], _)| {
        let places = if one == other { 1 } else { 2 };
        let fits = places <= free;
        free -= if fits { places } else { 0 };
        fits
    });
    if wanted.is_empty() {
        wanted.push(([skirt.hips as u8; 2], 1.0));
    }
    let weights = shares(&wanted.iter().map(|(_, weight)| *weight).collect::<Vec<_>>());
    let mut skin = SkinWeights::default();
    let mut places = skin.joints.iter_mut().zip(&mut skin.weights);
    let mut store = |stored: (u8, u16)| places.next().map(|(joint, weight)| (*joint, *weight) = stored);
    for (([one, other], _), weight) in wanted.into_iter().zip(weights) {
        if one == other {
            store((one, weight));
        } else {
            store((one, weight - weight / 2));
            store((other, weight / 2));
        }
    }
    skin
}

#[cfg(test)]
mod tests {
    use super::*;
    use kitsuke::skeleton::Joint;
    use proptest::prelude::*;

    /// Hips, both legs, trunk and one arm; the hips at 0.9 m, the knees at 0.45 m.
    fn skeleton() -> Skeleton {
        let joint = |bone, parent, y| Joint { bone, parent, rest_m: Vec3::new(0.0, y, 0.0) };
        Skeleton::new(vec![
            joint(Bone::Hips, None, 0.9),
            joint(Bone::LeftUpperLeg, Some(0), 0.85),
            joint(Bone::LeftLowerLeg, Some(1), 0.45),
            joint(Bone::RightUpperLeg, Some(0), 0.85),
            joint(Bone::Spine, Some(0), 1.0),
            joint(Bone::Neck, Some(4), 1.3),
            joint(Bone::LeftUpperArm, Some(4), 1.2),
            joint(Bone::LeftLowerArm, Some(6), 1.2),
            joint(Bone::LeftHand, Some(7), 1.2),
            joint(Bone::LeftThumbDistal, Some(8), 1.2),
            joint(Bone::RightLowerLeg, Some(3), 0.45),
        ])
        .unwrap()
    }

    #[test]
    fn joints_that_move_no_cloth_hand_over_to_those_above_them() {
        assert_eq!(cloth_joints(&skeleton()), [0, 0, 0, 0, 4, 4, 6, 7, 7, 7, 0]);
    }

    proptest! {
        #[test]
        fn weights_sum_to_the_whole_and_legs_are_equal(
            row in prop::collection::vec(prop_oneof![Just(0.0), 0.0f64..1.0], 11),
            height_m in 0.0f32..1.5,
        ) {
            let row: Vec<f64> = row.iter().zip(cloth_joints(&skeleton())).enumerate()
                .map(|(j, (&weight, carried_to))| if carried_to == j { weight } else { 0.0 }).collect();
            let skirt = Skirt::new(&skeleton(), 0.8, &Settings { knee_m: 0.15, ..Settings::default() });
            let skin = quantise(&row, &skirt, height_m);
            let of = |joint: u8| -> u32 {
                skin.joints.iter().zip(skin.weights).filter(|(j, _)| **j == joint).map(|(_, w)| u32::from(w)).sum()
            };
            prop_assert_eq!(skin.weights.iter().map(|&w| u32::from(w)).sum::<u32>(), 65535);
            // But for the odd unit.
            prop_assert!(of(1).abs_diff(of(3)) <= 2 && of(2).abs_diff(of(10)) <= 2);
            prop_assert!(height_m > 0.3 || of(1) <= 2 || row[0] == 0.0, "the thighs have no share far below the knee");
            prop_assert!(height_m < 0.8 || of(1) == 0, "above the obi's edge");
            prop_assert!(height_m > 0.45 || of(0) <= 1 || row[0] == 0.0, "below the knee the hips have no share");
        }
    }

    #[test]
    fn thighs_and_lower_legs_take_over_smoothly() {
        let skirt = Skirt::new(&skeleton(), 0.9, &Settings { knee_m: 0.15, ..Settings::default() });
        let shares: Vec<[f64; 2]> = (0..=90).map(|cm| skirt.leg_shares(0.9 - 0.01 * cm as f32)).collect();
        let of_legs: Vec<f64> = shares.iter().map(|[thighs, shins]| thighs + shins).collect();
        assert!(of_legs.is_sorted() && of_legs[0] == 0.0 && of_legs[45] > 0.999);
        let shins: Vec<f64> = shares.iter().map(|[_, shins]| *shins).collect();
        assert!(shins.is_sorted() && shins[45] < 1e-9 && shins[60] > 0.999);
        assert!(of_legs.windows(2).all(|pair| pair[1] - pair[0] < 0.04), "no step");
        assert!(shins.windows(2).all(|pair| pair[1] - pair[0] < 0.11), "no step");
    }
}
