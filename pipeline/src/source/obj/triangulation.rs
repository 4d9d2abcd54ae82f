//! Polygons cut into triangles. Knows nothing of text.

use super::{Corner, Mesh};
use glam::{DVec2, DVec3};

/// The triangles of a [`Mesh`], grouped by part.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Triangles {
    /// The corners.
    pub corners: Vec<[Corner; 3]>,
    /// The polygon of each triangle.
    pub faces: Vec<u32>,
    /// How many triangles each of the mesh's parts has.
    pub part_counts: Vec<u32>,
}

impl Mesh {
    /// Cuts the polygons into triangles, those of one part together, otherwise in file order.
    #[must_use]
    pub fn triangulate(&self) -> Triangles {
        let mut triangles: Vec<(u32, u32, [Corner; 3])> = Vec::with_capacity(self.faces.len());
        for (number, face) in self.faces.iter().enumerate() {
            let corners = self.corners_of(face);
            let points: Vec<DVec3> = corners.iter().map(|corner| self.positions[corner.vertex as usize]).collect();
            let cut = cut_polygon(&points).into_iter();
            triangles.extend(cut.map(|triangle| (face.part, number as u32, triangle.map(|i| corners[i]))));
        }
        triangles.sort_by_key(|(part, ..)| *part);
        let mut part_counts = vec![0; self.parts.len()];
        for (part, ..) in &triangles {
            part_counts[*part as usize] += 1;
        }
        let faces = triangles.iter().map(|(_, face, _)| *face).collect();
        Triangles { corners: triangles.into_iter().map(|(.., corners)| corners).collect(), faces, part_counts }
    }
}

/// Triangulates a polygon in space, concave ones too, by cutting ears in the plane of its area vector. Always gives
/// `points.len() - 2` triangles with the polygon's orientation; those of a polygon that crosses itself may overlap.
fn cut_polygon(points: &[DVec3]) -> Vec<[usize; 3]> {
    if points.len() == 3 {
        return vec![[0, 1, 2]];
    }
    let normal: DVec3 = (0..points.len()).map(|i| points[i].cross(points[(i + 1) % points.len()])).sum();
    let Some(normal) = normal.try_normalize() else {
        return (1..points.len() - 1).map(|i| [0, i, i + 1]).collect();
    };
    let (right, up) = normal.any_orthonormal_pair();
    let flat: Vec<DVec2> = points.iter().map(|p| DVec2::new(p.dot(right), p.dot(up))).collect();
    let turn = |a: usize, b: usize, c: usize| (flat[b] - flat[a]).perp_dot(flat[c] - flat[a]);
    let mut ring: Vec<usize> = (0..points.len()).collect();
    let mut triangles = Vec::with_capacity(points.len() - 2);
    while ring.len() > 3 {
        let n = ring.len();
        let ear = |&i: &usize| {
            let [a, b, c] = [ring[(i + n - 1) % n], ring[i], ring[(i + 1) % n]];
            let is_inside = |&p: &usize| turn(a, b, p) >= 0.0 && turn(b, c, p) >= 0.0 && turn(c, a, p) >= 0.0;
            let is_other = |p: &&usize| ![a, b, c].contains(p) && ![flat[a], flat[b], flat[c]].contains(&flat[**p]);
            turn(a, b, c) > 0.0 && !ring.iter().filter(is_other).any(is_inside)
        };
        // Start at the second corner, so that a convex polygon becomes the fan about its first corner.
        let i = (1..n).chain([0]).find(ear).unwrap_or(1);
        triangles.push([ring[(i + n - 1) % n], ring[i], ring[(i + 1) % n]]);
        ring.remove(i);
    }
    triangles.push([ring[0], ring[1], ring[2]]);
    triangles
}
