//! Lines of a form on cloth that lies on it, and back in the flat cloth: a level ray from a section's middle through a place of the form meets a
//! triangle of the right zone, and its barycentric coordinates say where that is in the pattern (Shoda 2018, 2.2.2.3). Knows no forces.

use crate::form::direction;
use crate::slit::Flat;
use glam::{DVec2, DVec3};

/// A place on cloth.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct OnCloth {
    /// Which triangle.
    pub triangle: u32,
    /// Barycentric coordinates in it.
    pub shares: DVec3,
}

impl OnCloth {
    /// Where that is in the flat cloth.
    #[must_use]
    pub fn flat_m(&self, flat: &Flat) -> DVec2 {
        let corners = flat.triangles[self.triangle as usize];
        (0..3).map(|i| flat.places_m[corners[i] as usize] * self.shares[i]).sum()
    }

    /// Where it is on cloth with its vertices at `positions_m`.
    #[must_use]
    pub fn place_m(&self, flat: &Flat, positions_m: &[DVec3]) -> DVec3 {
        let corners = flat.triangles[self.triangle as usize];
        (0..3).map(|i| positions_m[corners[i] as usize] * self.shares[i]).sum()
    }
}

/// Where a level ray from `middle_m` at an angle meets cloth of a zone first; none where it does not.
#[must_use]
pub fn met(flat: &Flat, positions_m: &[DVec3], zone: u32, middle_m: DVec3, angle_rad: f64) -> Option<OnCloth> {
    let toward = direction(angle_rad);
    let way = DVec3::new(toward.x, 0.0, toward.y);
    let mut first: Option<(f64, OnCloth)> = None;
    for (triangle, corners) in flat.triangles.iter().enumerate() {
        if flat.zones[triangle] != zone {
            continue;
        }
        let [a, b, c] = corners.map(|v| positions_m[v as usize] - middle_m);
        if a.y.min(b.y).min(c.y) > 0.0 || a.y.max(b.y).max(c.y) < 0.0 {
            continue;
        }
        let Some((far_m, shares)) = through(way, [a, b, c]) else { continue };
        if far_m > 0.0 && first.is_none_or(|(nearest_m, _)| far_m < nearest_m) {
            first = Some((far_m, OnCloth { triangle: triangle as u32, shares }));
        }
    }
    first.map(|(_, on)| on)
}

/// The triangle of a zone of flat cloth in which a place lies, or to which it is nearest.
#[must_use]
pub fn in_flat(flat: &Flat, zone: u32, place_m: DVec2) -> Option<OnCloth> {
    let at_m = place_m.extend(0.0);
    let mut best: Option<(f64, OnCloth)> = None;
    for (triangle, corners) in flat.triangles.iter().enumerate() {
        if flat.zones[triangle] != zone {
            continue;
        }
        let corners_m = corners.map(|v| flat.places_m[v as usize].extend(0.0));
        let (nearest_m, shares) = crate::triangle_tree::nearest_on_triangle(corners_m, at_m);
        let squared = nearest_m.distance_squared(at_m);
        if best.is_none_or(|(least, _)| squared < least) {
            best = Some((squared, OnCloth { triangle: triangle as u32, shares }));
        }
    }
    best.map(|(_, on)| on)
}

/// How far a ray from the origin goes to a triangle, and where in it (Möller and Trumbore); both sides count, borders belong to it.
fn through(way: DVec3, [a, b, c]: [DVec3; 3]) -> Option<(f64, DVec3)> {
    const BORDER: f64 = 1e-9;
    let (ab, ac) = (b - a, c - a);
    let across = way.cross(ac);
    let volume = ab.dot(across);
    if volume.abs() < 1e-18 {
        return None;
    }
    let v = -a.dot(across) / volume;
    let turned = (-a).cross(ab);
    let w = way.dot(turned) / volume;
    if v < -BORDER || w < -BORDER || v + w > 1.0 + BORDER {
        return None;
    }
    Some((ac.dot(turned) / volume, DVec3::new(1.0 - v - w, v, w)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::TAU;

    #[test]
    fn what_is_marked_on_a_cylinder_is_found_in_the_flat_cloth() {
        // 30 cm of cloth round a cylinder of 10 cm from the front to the left, above another zone of it that lies farther out.
        let mut flat = Flat::rectangle(DVec2::ZERO, 30, 20, DVec2::splat(0.01));
        flat.divide(0.15);
        let radius_m = 0.1;
        let rolled = |place: &DVec2| {
            let far_m = if place.x > 0.15 { 0.11 } else { radius_m };
            let at = direction(place.x / radius_m) * far_m;
            DVec3::new(at.x, 1.0 + place.y, at.y)
        };
        let positions_m: Vec<DVec3> = flat.places_m.iter().map(rolled).collect();
        for i in 0..20 {
            let (turn, height_m) = (0.07 * f64::from(i), 1.003 + 0.0095 * f64::from(i));
            let on = met(&flat, &positions_m, 0, DVec3::Y * height_m, turn).unwrap();
            let flat_m = on.flat_m(&flat);
            assert!(flat_m.distance(DVec2::new(turn * radius_m, height_m - 1.0)) < 1e-4, "{i}: {flat_m}");
            let at_m = on.place_m(&flat, &positions_m);
            assert!(
                (at_m.y - height_m).abs() < 1e-12
                    && (crate::form::angle_rad(DVec2::new(at_m.x, at_m.z)) - turn).abs() < 1e-9
            );
            let again = in_flat(&flat, 0, flat_m).unwrap();
            assert!(again.flat_m(&flat).distance(flat_m) < 1e-12);
            assert_eq!(met(&flat, &positions_m, 1, DVec3::Y * height_m, turn), None);
        }
        assert_eq!(met(&flat, &positions_m, 0, DVec3::Y * 2.0, 0.0), None);
        assert_eq!(met(&flat, &positions_m, 0, DVec3::Y, TAU / 2.0), None);
    }
}
