//! Cloth against cloth: particles that come nearer to a triangle than the cloth is thick. Knows no forces and no body.
//!
//! Edges against edges are not looked at: where cloth is folded finer than its triangles, they may pass each other.

use crate::cells::Cells;
use crate::forces;
use crate::parallel;
use glam::DVec3;

/// A particle beside a triangle of which it is no corner.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Contact {
    particle: u32,
    triangle: u32,
    /// On which side of the triangle the particle was when it was found: 1 is that of the normal, -1 the other.
    side: f64,
}

/// What lies nearer than `reach_m` to what.
pub fn detect(
    triangles: &[[u32; 3]],
    positions_m: &[DVec3],
    normals: &[DVec3],
    cells: &Cells,
    reach_m: f64,
) -> Vec<Contact> {
    let mut contacts = parallel::collect(positions_m.len(), |particle, found: &mut Vec<Contact>| {
        let place_m = positions_m[particle];
        for triangle in cells.around(place_m) {
            let corners = triangles[triangle as usize];
            let distance_m = normals[triangle as usize].dot(place_m - positions_m[corners[0] as usize]);
            if distance_m.abs() >= reach_m || corners.contains(&(particle as u32)) {
                continue;
            }
            let shares = shares(corners.map(|corner| positions_m[corner as usize]), place_m);
            // Until it is looked for again, the particle may come over the border of a triangle.
            if shares.is_some_and(|shares| shares.min_element() >= -0.2) {
                let side = if distance_m >= 0.0 { 1.0 } else { -1.0 };
                found.push(Contact { particle: particle as u32, triangle, side });
            }
        }
    });
    // Cells keep no order of their own.
    contacts.sort_unstable_by_key(|contact| (contact.particle, contact.triangle));
    contacts
}

/// Moves particles and triangles apart to the thickness, on the side where they were, one contact after another, and lets
/// friction hold what slides. Held particles stay.
pub fn resolve(
    contacts: &[Contact],
    triangles: &[[u32; 3]],
    pins: &[Option<DVec3>],
    before_m: &[DVec3],
    positions_m: &mut [DVec3],
    thickness_m: f64,
    friction: f64,
) {
    for contact in contacts {
        let corners = triangles[contact.triangle as usize].map(|corner| corner as usize);
        let particle = contact.particle as usize;
        let corners_m = corners.map(|corner| positions_m[corner]);
        let Some(shares) = shares(corners_m, positions_m[particle]) else { continue };
        if shares.min_element() < 0.0 {
            continue;
        }
        let normal = unit_normal(corners_m) * contact.side;
        let gap_m = normal.dot(positions_m[particle] - corners_m[0]);
        if gap_m >= thickness_m {
            continue;
        }
        let is_free = |particle: usize| if pins[particle].is_some() { 0.0 } else { 1.0 };
        let mobility = is_free(particle) + (0..3).map(|i| is_free(corners[i]) * shares[i] * shares[i]).sum::<f64>();
        if mobility == 0.0 {
            continue;
        }
        let push_m = thickness_m - gap_m;
        let mut slide_m = positions_m[particle] - before_m[particle];
        for i in 0..3 {
            slide_m -= (corners_m[i] - before_m[corners[i]]) * shares[i];
        }
        slide_m -= normal * normal.dot(slide_m);
        let held_m = slide_m - forces::after_friction_m(slide_m, push_m, friction);
        let apart_m = (normal * push_m - held_m) / mobility;
        positions_m[particle] += apart_m * is_free(particle);
        for i in 0..3 {
            positions_m[corners[i]] -= apart_m * (is_free(corners[i]) * shares[i]);
        }
    }
}

/// The unit normal of a triangle; 0 without area.
pub fn unit_normal(corners_m: [DVec3; 3]) -> DVec3 {
    let vector = (corners_m[1] - corners_m[0]).cross(corners_m[2] - corners_m[0]);
    let length = vector.length_squared().sqrt();
    if length > 0.0 { vector / length } else { DVec3::ZERO }
}

/// Barycentric coordinates of a place, seen along the triangle's normal; none without area.
fn shares(corners_m: [DVec3; 3], place_m: DVec3) -> Option<DVec3> {
    let [u, v, w] = [corners_m[1] - corners_m[0], corners_m[2] - corners_m[0], place_m - corners_m[0]];
    let (uu, uv, vv, wu, wv) = (u.dot(u), u.dot(v), v.dot(v), w.dot(u), w.dot(v));
    let determinant = uu * vv - uv * uv;
    if determinant <= 0.0 {
        return None;
    }
    let (b, c) = ((vv * wu - uv * wv) / determinant, (uu * wv - uv * wu) / determinant);
    Some(DVec3::new(1.0 - b - c, b, c))
}

#[cfg(test)]
mod tests {
    use super::*;

    const TRIANGLES: [[u32; 3]; 1] = [[0, 1, 2]];

    fn places(height_m: f64) -> [DVec3; 4] {
        [DVec3::ZERO, DVec3::Z, DVec3::X, DVec3::new(0.25, height_m, 0.25)]
    }

    fn contacts(before_m: &[DVec3; 4]) -> Vec<Contact> {
        let normals = [unit_normal([before_m[0], before_m[1], before_m[2]])];
        let middle_m = (before_m[0] + before_m[1] + before_m[2]) / 3.0;
        detect(&TRIANGLES, before_m, &normals, &Cells::new(1.0, &[middle_m]), 0.1)
    }

    #[test]
    fn a_particle_that_came_through_goes_back_to_its_side() {
        for side in [1.0, -1.0] {
            let before_m = places(0.02 * side);
            let mut now_m = places(-0.005 * side);
            resolve(&contacts(&before_m), &TRIANGLES, &[None; 4], &before_m, &mut now_m, 0.01, 0.0);
            let corner = |i: usize| now_m[i];
            let normal = unit_normal([corner(0), corner(1), corner(2)]);
            let gap = normal.dot(now_m[3] - now_m[0]) * side;
            assert!((gap - 0.01).abs() < 1e-4, "{gap}");
            // Nothing is won or lost: equal masses, so the sum of places stays.
            let moved: DVec3 = now_m.iter().zip(places(-0.005 * side)).map(|(now, then)| *now - then).sum();
            assert!(moved.length() < 1e-15, "{moved}");
        }
        assert!(contacts(&places(0.2)).is_empty());
    }

    #[test]
    fn friction_holds_a_slide_and_pins_hold_altogether() {
        let before_m = places(0.01);
        let mut now_m = places(0.0);
        now_m[3].x += 0.002;
        let pins = [Some(DVec3::ZERO), Some(DVec3::Z), Some(DVec3::X), None];
        let slid = now_m;
        resolve(&contacts(&before_m), &TRIANGLES, &pins, &before_m, &mut now_m, 0.01, 0.1);
        // Pushed 10 mm, so 1 mm of the 2 mm is held.
        assert!((now_m[3] - DVec3::new(0.251, 0.01, 0.25)).length() < 1e-12, "{}", now_m[3]);
        assert_eq!(now_m[..3], slid[..3]);
    }
}
