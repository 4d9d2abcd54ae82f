//! The skinned body in a pose, to be asked where places lie. Knows no cloth.

use super::twins::Twins;
use crate::ir::Body;
use glam::Vec3;
use kitsuke::skeleton::Pose;
use parry3d::query::PointQueryWithLocation;
use parry3d::shape::{TriMesh, TriMeshFlags};

/// The posed body, ready for questions.
pub(crate) struct PosedBody<'a> {
    body: &'a Body,
    /// For each vertex the first one at its place.
    first: Vec<u32>,
    /// Over the first vertices at each place, with the triangles in the body's order.
    pub(crate) mesh: TriMesh,
}

impl<'a> PosedBody<'a> {
    pub(crate) fn new(body: &'a Body, pose: &Pose) -> PosedBody<'a> {
        let points = body.posed_m(pose).iter().map(|p| p.to_array().into()).collect();
        // Where the file has a seam the skin must be closed, or nobody can tell inside from outside beside it.
        let Twins { first, triangles } = Twins::of(body);
        let mesh = TriMesh::with_flags(points, triangles, TriMeshFlags::ORIENTED);
        PosedBody { body, first, mesh: mesh.expect("the body's surface has triangles") }
    }

    /// How far outside a point lies, negative inside, and the direction that leads out there; `None` where the skin is farther than
    /// `farthest_m` outside or `deepest_m` inside.
    pub(crate) fn place(&self, place_m: Vec3, farthest_m: f32, deepest_m: f32) -> Option<(f32, Vec3)> {
        let place = place_m.to_array().into();
        let (nearest, (triangle, _)) =
            self.mesh.project_local_point_and_get_location_with_max_dist(place, false, deepest_m.max(farthest_m))?;
        let to_skin = Vec3::new(nearest.point.x, nearest.point.y, nearest.point.z) - place_m;
        let distance_m = to_skin.length();
        let outward = if nearest.is_inside { to_skin } else { -to_skin };
        let outward = if distance_m > 1e-5 {
            outward / distance_m
        } else {
            let [a, b, c] = self.mesh.indices()[triangle as usize].map(|v| {
                let corner = self.mesh.vertices()[v as usize];
                Vec3::new(corner.x, corner.y, corner.z)
            });
            (b - a).cross(c - a).normalize_or_zero()
        };
        match nearest.is_inside {
            true => Some((-distance_m, outward)),
            false => (distance_m <= farthest_m).then_some((distance_m, outward)),
        }
    }

    /// How deep a point lies in the body, at most `deepest_m`, and the joint of the skin that is nearest.
    pub(crate) fn depth(&self, place_m: Vec3, deepest_m: f32) -> Option<(f32, u8)> {
        let place = place_m.to_array().into();
        let (nearest, (triangle, _)) =
            self.mesh.project_local_point_and_get_location_with_max_dist(place, false, deepest_m)?;
        let depth_m = Vec3::new(nearest.point.x, nearest.point.y, nearest.point.z).distance(place_m);
        let corner = self.body.surface.triangles[triangle as usize][0] as usize;
        let joint = self.body.skin[corner].iter().max_by(|a, b| a.1.total_cmp(&b.1)).map_or(0, |(joint, _)| *joint);
        nearest.is_inside.then_some((depth_m, joint))
    }

    /// Whether the skin at a vertex is pressed into another part of the body.
    pub(crate) fn is_buried(&self, vertex: u32) -> bool {
        /// Just outside, metres.
        const OUTSIDE_M: f32 = 1e-3;
        let place = |v: u32| Vec3::from_array(self.mesh.vertices()[v as usize].to_array());
        let vertex = self.first[vertex as usize];
        let mut normal = Vec3::ZERO;
        for triangle in self.mesh.indices().iter().filter(|triangle| triangle.contains(&vertex)) {
            let [a, b, c] = triangle.map(place);
            normal += (b - a).cross(c - a);
        }
        self.winding(place(vertex) + OUTSIDE_M * normal.normalize_or_zero()) > 0.5
    }

    /// How often a closed surface winds round a point, by the solid angles of its triangles (van Oosterom, Strackee: The
    /// Solid Angle of a Plane Triangle, 1983): 1 or more inside, even where the surface passes through itself.
    pub(crate) fn winding(&self, place_m: Vec3) -> f32 {
        let corners = self.mesh.vertices();
        let solid_rad = |triangle: &[u32; 3]| {
            let [a, b, c] = triangle.map(|v| {
                let p = corners[v as usize];
                Vec3::new(p.x, p.y, p.z) - place_m
            });
            let [la, lb, lc] = [a.length(), b.length(), c.length()];
            let whole = la * lb * lc + a.dot(b) * lc + b.dot(c) * la + c.dot(a) * lb;
            2.0 * libm::atan2f(a.dot(b.cross(c)), whole)
        };
        self.mesh.indices().iter().map(solid_rad).sum::<f32>() / (4.0 * std::f32::consts::PI)
    }
}
