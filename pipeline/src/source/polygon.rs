//! Polygons cut into triangles. Knows no mesh and no file.

use glam::{DVec2, DVec3};

/// How often, per square of its corners, a polygon's corners are looked at in search of ears: polygons of up to so many corners are
/// always cut properly, and no file keeps us for long.
const LOOKS: usize = 64;
/// Polygons of more corners are looked at no more often than those of so many.
const MOST_SQUARED: usize = 1 << 12;

/// Triangulates a polygon in space, concave ones too, by cutting ears in the plane of its area vector. Always gives
/// `points.len() - 2` triangles with the polygon's orientation; those of a polygon that crosses itself, or of thousands of
/// corners wound like a spiral, may overlap.
pub(crate) fn cut(points: &[DVec3]) -> Vec<[usize; 3]> {
    if points.len() < 4 {
        return if points.len() == 3 { vec![[0, 1, 2]] } else { Vec::new() };
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
    let mut looks_left = LOOKS * points.len().min(MOST_SQUARED).pow(2);
    while ring.len() > 3 && looks_left > 0 {
        let n = ring.len();
        let ear = |&i: &usize| {
            looks_left = looks_left.saturating_sub(n);
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
    triangles.extend((1..ring.len() - 1).map(|i| [ring[0], ring[i], ring[i + 1]]));
    triangles
}
