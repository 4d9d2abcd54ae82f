//! Which cloth of the base a scanner can see: not the layer under the overlap of the fronts, nor the inside of a fold. Knows no scan.

use super::surface::{Surface, normals};
use glam::DVec3;
use parry3d::math::Vector;
use parry3d::query::{Ray, RayCast};
use parry3d::shape::TriMesh;
use rayon::prelude::*;

/// Directions that are looked along.
const RAYS: usize = 96;
/// Flatter along the cloth than by this cosine nobody sees it.
const GRAZING: f64 = 0.25;
/// This share of the other directions must be free.
const FREE: f64 = 0.12;
/// What looks out from the cloth stands so far off it, metres: layers lie a few millimetres apart.
const OFF_M: f64 = 5e-4;
/// Cloth that is farther than this from all that is seen follows nothing, metres.
const COVER_M: f64 = 0.06;

/// What covers a vertex: a triangle that is seen, and shares of its corners.
#[derive(Clone, Copy, Debug)]
pub(super) struct Cover {
    pub triangle: u32,
    pub shares: [f64; 3],
}

/// Whether each vertex is seen from outside.
pub(super) fn seen(positions_m: &[DVec3], triangles: &[[u32; 3]]) -> Vec<bool> {
    let normals = normals(positions_m, triangles);
    let points = positions_m.iter().map(|p| vector(*p)).collect();
    let Ok(mesh) = TriMesh::new(points, triangles.to_vec()) else { return vec![true; positions_m.len()] };
    let directions: Vec<DVec3> = (0..RAYS).map(direction).collect();
    let is_seen = |(place_m, normal): (&DVec3, &DVec3)| {
        let open: Vec<&DVec3> = directions.iter().filter(|direction| direction.dot(*normal) > GRAZING).collect();
        let from = vector(*place_m + *normal * OFF_M);
        let meets_nothing = |direction: &&&DVec3| {
            let ray = Ray::new(from, vector(***direction));
            mesh.cast_local_ray(&ray, 3.0, false).is_none()
        };
        open.iter().filter(meets_nothing).count() as f64 >= FREE * open.len() as f64
    };
    positions_m.par_iter().zip(&normals).map(is_seen).collect()
}

/// For each vertex that is not seen what lies over it, if anything does.
pub(super) fn covers(positions_m: &[DVec3], triangles: &[[u32; 3]], seen: &[bool]) -> Vec<Option<Cover>> {
    let of_seen = triangles.iter().enumerate().filter(|(_, corners)| corners.iter().all(|&v| seen[v as usize]));
    let (numbers, over): (Vec<u32>, Vec<[u32; 3]>) = of_seen.map(|(t, corners)| (t as u32, *corners)).unzip();
    if over.is_empty() {
        return vec![None; positions_m.len()];
    }
    let surface = Surface::new(positions_m.to_vec(), over);
    let cover = |v: usize| {
        let hit = surface.nearest(positions_m[v], COVER_M, |_| true).filter(|_| !seen[v])?;
        Some(Cover { triangle: numbers[hit.triangle as usize], shares: hit.shares })
    };
    (0..positions_m.len()).into_par_iter().map(cover).collect()
}

/// Directions all over the sphere, evenly.
fn direction(i: usize) -> DVec3 {
    const GOLDEN_ANGLE: f64 = 2.399_963_229_728_653;
    let z = 1.0 - (2.0 * i as f64 + 1.0) / RAYS as f64;
    let (sin, cos) = (libm::sin(GOLDEN_ANGLE * i as f64), libm::cos(GOLDEN_ANGLE * i as f64));
    let r = (1.0 - z * z).sqrt();
    DVec3::new(r * cos, z, r * sin)
}

fn vector(p: DVec3) -> Vector {
    Vector::new(p.x as f32, p.y as f32, p.z as f32)
}
