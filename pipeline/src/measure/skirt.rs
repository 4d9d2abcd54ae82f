//! How far the wearer's legs lie outside the skirt, frame after frame: the body's skin against the cloth's inner side. Knows
//! neither files nor how poses are chosen.

use crate::ir;
use crate::stages::posed_body::PosedBody;
use glam::Vec3;
use kitsuke::skeleton::{Bone, Pose};
use kitsuke::{Frame, Garment, Scratch, evaluate};
use parry3d::query::PointQueryWithLocation;
use parry3d::shape::{TriMesh, TriMeshFlags, TrianglePointLocation};
use rayon::prelude::*;
use std::collections::BTreeMap;

/// Skin farther from the cloth than this is not looked at, metres.
const FARTHEST_M: f32 = 0.5;

/// The skin that lies farthest outside.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Outside {
    /// How far from the cloth, metres; 0 where all of the legs is inside.
    pub distance_m: f32,
    /// The vertex of the body.
    pub vertex: u32,
}

/// The skirt of a garment and the legs in it, ready to be posed.
#[derive(Clone, Debug)]
pub struct Legs<'a> {
    garment: &'a Garment,
    body: &'a ir::Body,
    /// Vertices of the body that upper and lower legs move.
    skin: Vec<u32>,
    /// Triangles of the garment below the obi, over its unique vertices.
    triangles: Vec<[u32; 3]>,
    /// Edges of one triangle alone: hem, open front, and where the skirt was cut from the rest.
    rim: Vec<[u32; 2]>,
}

impl<'a> Legs<'a> {
    /// Of the source's body, which wears the garment: that on which it was made, or that of [`super::wearer::worn`] for a fitted one. The
    /// skirt begins at the obi's lower edge, or at the hips without an obi.
    #[must_use]
    pub fn new(garment: &'a Garment, source: &'a ir::Garment) -> Legs<'a> {
        const LEGS: [Bone; 4] = [Bone::LeftUpperLeg, Bone::LeftLowerLeg, Bone::RightUpperLeg, Bone::RightLowerLeg];
        let joints = source.body.skeleton.joints();
        let is_leg = |weights: &[(u8, f32); 4]| {
            let most =
                weights.iter().max_by(|a, b| a.1.total_cmp(&b.1)).map(|(joint, _)| joints[usize::from(*joint)].bone);
            most.is_some_and(|bone| LEGS.contains(&bone))
        };
        let skin = source.body.skin.iter().zip(0..).filter(|(weights, _)| is_leg(weights)).map(|(_, v)| v).collect();
        let mesh = &garment.data().mesh;
        let top_m = source.skirt_top_m();
        // Sleeves hang as low; they follow the arms.
        let follows_legs = |v: u32| {
            let weights = &garment.data().skin[v as usize];
            let of_legs = weights.joints.iter().zip(weights.weights).filter(|(joint, _)| {
                let bone = garment.data().skeleton.bone(**joint);
                bone == Bone::Hips || LEGS.contains(&bone)
            });
            of_legs.map(|(_, weight)| u32::from(weight)).sum::<u32>() > 32_768
        };
        let is_skirt =
            |triangle: &[u32; 3]| triangle.iter().all(|&v| mesh.positions_m[v as usize].y < top_m && follows_legs(v));
        let triangles: Vec<[u32; 3]> =
            mesh.triangles.iter().map(|t| t.map(|v| mesh.unique(v))).filter(is_skirt).collect();
        let mut uses: BTreeMap<[u32; 2], u32> = BTreeMap::new();
        for &[a, b, c] in &triangles {
            for [from, to] in [[a, b], [b, c], [c, a]] {
                *uses.entry([from.min(to), from.max(to)]).or_default() += 1;
            }
        }
        let rim = uses.into_iter().filter(|(_, count)| *count == 1).map(|(edge, _)| edge).collect();
        Legs { garment, body: &source.body, skin, triangles, rim }
    }

    /// The farthest outside in each pose. Skin whose nearest cloth is the skirt's rim is below the hem or in the open front, where
    /// legs may be seen; skin that is pressed into another part of the body is not seen at all.
    #[must_use]
    pub fn outside(&self, poses: &[Pose]) -> Vec<Outside> {
        poses
            .par_iter()
            .map_init(|| Scratch::new(self.garment), |scratch, pose| self.outside_in(pose, scratch))
            .collect()
    }

    fn outside_in(&self, pose: &Pose, scratch: &mut Scratch) -> Outside {
        let mut positions_m = vec![Vec3::ZERO; self.garment.vertex_count()];
        let mut normals = positions_m.clone();
        evaluate(self.garment, pose, scratch, Frame { positions_m: &mut positions_m, normals: &mut normals });
        let points = positions_m[..self.garment.unique_count()].iter().map(|p| p.to_array().into()).collect();
        let Ok(skirt) = TriMesh::with_flags(points, self.triangles.clone(), TriMeshFlags::ORIENTED) else {
            return Outside::default();
        };
        let body = PosedBody::new(self.body, pose);
        let mut farthest = Outside::default();
        for &vertex in &self.skin {
            let place = body.mesh.vertices()[vertex as usize];
            let found = skirt.project_local_point_and_get_location_with_max_dist(place, false, FARTHEST_M);
            let Some((nearest, (triangle, location))) = found else { continue };
            let distance_m = (nearest.point - place).length();
            let is_farther = !nearest.is_inside && distance_m > farthest.distance_m;
            if is_farther && !self.is_rim(triangle, location) && !body.is_buried(vertex) {
                farthest = Outside { distance_m, vertex };
            }
        }
        farthest
    }

    fn is_rim(&self, triangle: u32, location: TrianglePointLocation) -> bool {
        let [a, b, c] = self.triangles[triangle as usize];
        let has = |from: u32, to: u32| self.rim.binary_search(&[from.min(to), from.max(to)]).is_ok();
        match location {
            TrianglePointLocation::OnEdge(0, _) => has(a, b),
            TrianglePointLocation::OnEdge(1, _) => has(b, c),
            TrianglePointLocation::OnEdge(_, _) => has(c, a),
            TrianglePointLocation::OnVertex(corner) => {
                let corner = [a, b, c][corner as usize];
                self.rim.iter().any(|edge| edge.contains(&corner))
            }
            _ => false,
        }
    }
}
