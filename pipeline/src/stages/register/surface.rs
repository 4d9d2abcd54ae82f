//! A scanned surface that answers what lies nearest, if it faces the same way. Knows nothing of the base that is laid onto it.

use glam::DVec3;
use parry3d::bounding_volume::Aabb;
use parry3d::math::Vector;
use parry3d::partitioning::{Bvh, BvhBuildStrategy, BvhNode};
use parry3d::query::PointQuery;

/// How often normals are averaged with those around: a scanner's noise turns single triangles.
const SMOOTHINGS: usize = 3;

/// Triangles with smooth normals; see [`Surface::new`].
pub(crate) struct Surface {
    positions_m: Vec<DVec3>,
    triangles: Vec<[u32; 3]>,
    normals: Vec<DVec3>,
    /// Whether each vertex lies on a border.
    is_border: Vec<bool>,
    tree: Bvh,
}

/// The place of a surface that is nearest to another place.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Hit {
    pub place_m: DVec3,
    /// Unit, smooth.
    pub normal: DVec3,
    pub triangle: u32,
    /// Shares of the triangle's corners.
    pub shares: [f64; 3],
    /// Whether it lies on a border.
    pub on_border: bool,
    pub distance_m: f64,
}

impl Surface {
    pub fn new(positions_m: Vec<DVec3>, triangles: Vec<[u32; 3]>) -> Surface {
        let normals = smooth_normals(&positions_m, &triangles);
        let is_border = border_vertices(positions_m.len(), &triangles);
        let tree = tree(&positions_m, &triangles);
        Surface { positions_m, triangles, normals, is_border, tree }
    }

    /// The same moved: places by `place`, directions by `direction`.
    pub fn moved(&self, place: impl Fn(DVec3) -> DVec3, direction: impl Fn(DVec3) -> DVec3) -> Surface {
        let positions_m: Vec<DVec3> = self.positions_m.iter().map(|&p| place(p)).collect();
        let tree = tree(&positions_m, &self.triangles);
        let normals = self.normals.iter().map(|&n| direction(n)).collect();
        Surface { positions_m, triangles: self.triangles.clone(), normals, is_border: self.is_border.clone(), tree }
    }

    /// The nearest place within a distance whose normal `accepts`.
    pub fn nearest(&self, from_m: DVec3, within_m: f64, accepts: impl Fn(DVec3) -> bool) -> Option<Hit> {
        let from = Vector::new(from_m.x as f32, from_m.y as f32, from_m.z as f32);
        let hit_of = |triangle: u32| {
            let corners = self.triangles[triangle as usize].map(|v| v as usize);
            let [a, b, c] = corners.map(|v| self.positions_m[v]);
            let shares = nearest_shares(from_m, a, b, c);
            let place_m = a * shares[0] + b * shares[1] + c * shares[2];
            let normal = corners.iter().zip(shares).map(|(&v, share)| self.normals[v] * share).sum::<DVec3>();
            let normal = normal.normalize_or_zero();
            // On a border edge two corners hold the place, on a border vertex one does.
            let held = corners.iter().zip(shares).filter(|(_, share)| *share > 1e-6);
            let on_border = shares.iter().any(|&share| share <= 1e-6) && held.clone().all(|(&v, _)| self.is_border[v]);
            Hit { place_m, normal, triangle, shares, on_border, distance_m: place_m.distance(from_m) }
        };
        let found = self.tree.find_best(
            within_m as f32,
            |node: &BvhNode, _| node.aabb().distance_to_local_point(from, true),
            |triangle, _| {
                let hit = hit_of(triangle);
                accepts(hit.normal).then_some(hit.distance_m as f32)
            },
        );
        found.map(|(triangle, _)| hit_of(triangle))
    }

    pub fn positions_m(&self) -> &[DVec3] {
        &self.positions_m
    }

    pub fn triangles(&self) -> &[[u32; 3]] {
        &self.triangles
    }

    pub fn normals(&self) -> &[DVec3] {
        &self.normals
    }

    /// Turns all normals over, where triangles face inwards.
    pub fn turn_over(&mut self) {
        self.normals.iter_mut().for_each(|normal| *normal = -*normal);
    }
}

fn tree(positions_m: &[DVec3], triangles: &[[u32; 3]]) -> Bvh {
    let boxes: Vec<Aabb> = triangles
        .iter()
        .map(|corners| {
            let points = corners.map(|v| {
                let p = positions_m[v as usize];
                Vector::new(p.x as f32, p.y as f32, p.z as f32)
            });
            Aabb::from_points(points)
        })
        .collect();
    Bvh::from_leaves(BvhBuildStrategy::Binned, &boxes)
}

/// Shares of the corners at the point of a triangle that is nearest to a place (Ericson, Real-Time Collision Detection, 5.1.5).
fn nearest_shares(p: DVec3, a: DVec3, b: DVec3, c: DVec3) -> [f64; 3] {
    let (ab, ac, ap) = (b - a, c - a, p - a);
    let (d1, d2) = (ab.dot(ap), ac.dot(ap));
    if d1 <= 0.0 && d2 <= 0.0 {
        return [1.0, 0.0, 0.0];
    }
    let bp = p - b;
    let (d3, d4) = (ab.dot(bp), ac.dot(bp));
    if d3 >= 0.0 && d4 <= d3 {
        return [0.0, 1.0, 0.0];
    }
    let vc = d1 * d4 - d3 * d2;
    if vc <= 0.0 && d1 >= 0.0 && d3 <= 0.0 {
        let v = if d1 > d3 { d1 / (d1 - d3) } else { 0.0 };
        return [1.0 - v, v, 0.0];
    }
    let cp = p - c;
    let (d5, d6) = (ab.dot(cp), ac.dot(cp));
    if d6 >= 0.0 && d5 <= d6 {
        return [0.0, 0.0, 1.0];
    }
    let vb = d5 * d2 - d1 * d6;
    if vb <= 0.0 && d2 >= 0.0 && d6 <= 0.0 {
        let w = if d2 > d6 { d2 / (d2 - d6) } else { 0.0 };
        return [1.0 - w, 0.0, w];
    }
    let va = d3 * d6 - d5 * d4;
    if va <= 0.0 && d4 - d3 >= 0.0 && d5 - d6 >= 0.0 {
        let along = (d4 - d3) + (d5 - d6);
        let w = if along > 0.0 { (d4 - d3) / along } else { 0.0 };
        return [0.0, 1.0 - w, w];
    }
    let sum = va + vb + vc;
    let (v, w) = (vb / sum, vc / sum);
    [1.0 - v - w, v, w]
}

/// Unit normals, weighted by area and averaged with those around.
pub(crate) fn smooth_normals(positions_m: &[DVec3], triangles: &[[u32; 3]]) -> Vec<DVec3> {
    let mut normals = normals(positions_m, triangles);
    for _ in 0..SMOOTHINGS {
        let mut sums = normals.clone();
        for corners in triangles {
            let sum: DVec3 = corners.iter().map(|&v| normals[v as usize]).sum();
            corners.iter().for_each(|&v| sums[v as usize] += sum);
        }
        normals = sums.into_iter().map(DVec3::normalize_or_zero).collect();
    }
    normals
}

/// Unit normals, weighted by area; zero where no triangle stands.
pub(super) fn normals(positions_m: &[DVec3], triangles: &[[u32; 3]]) -> Vec<DVec3> {
    let mut normals = vec![DVec3::ZERO; positions_m.len()];
    for corners in triangles {
        let [a, b, c] = corners.map(|v| positions_m[v as usize]);
        corners.iter().for_each(|&v| normals[v as usize] += (b - a).cross(c - a));
    }
    normals.into_iter().map(DVec3::normalize_or_zero).collect()
}

/// Whether each vertex lies on an edge of one triangle alone.
pub(super) fn border_vertices(count: usize, triangles: &[[u32; 3]]) -> Vec<bool> {
    let mut is_border = vec![false; count];
    for [a, b] in border_edges(triangles) {
        is_border[a as usize] = true;
        is_border[b as usize] = true;
    }
    is_border
}

/// Edges of one triangle alone, as that triangle goes along them.
pub(super) fn border_edges(triangles: &[[u32; 3]]) -> Vec<[u32; 2]> {
    let mut edges: Vec<([u32; 2], bool)> = Vec::with_capacity(3 * triangles.len());
    for &[a, b, c] in triangles {
        for [from, to] in [[a, b], [b, c], [c, a]] {
            edges.push(if from < to { ([from, to], false) } else { ([to, from], true) });
        }
    }
    edges.sort_unstable();
    edges
        .chunk_by(|a, b| a.0 == b.0)
        .filter(|same| same.len() == 1)
        .map(|same| {
            let ([a, b], is_turned) = same[0];
            if is_turned { [b, a] } else { [a, b] }
        })
        .collect()
}
