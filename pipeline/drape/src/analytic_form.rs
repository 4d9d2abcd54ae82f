//! Closed bodies from formulas, for tests and measurements: what lies inside them is known exactly. Knows no cloth.

use glam::DVec3;

/// Heights of a woman's dress form with half its width and half its depth there, metres. Linear in between.
const SECTIONS_M: [[f64; 3]; 9] = [
    [0.70, 0.165, 0.115],
    [0.88, 0.175, 0.130],
    [1.05, 0.125, 0.095],
    [1.22, 0.160, 0.125],
    [1.34, 0.175, 0.095],
    [1.39, 0.140, 0.075],
    [1.42, 0.070, 0.060],
    [1.44, 0.055, 0.055],
    [1.50, 0.050, 0.050],
];

/// Half the width and half the depth of the dress form's elliptical section at a height, metres; none above and below it.
#[must_use]
pub fn dress_form_radii_m(height_m: f64) -> Option<[f64; 2]> {
    let pair = SECTIONS_M.windows(2).find(|pair| (pair[0][0]..=pair[1][0]).contains(&height_m))?;
    let share = (height_m - pair[0][0]) / (pair[1][0] - pair[0][0]);
    Some([1, 2].map(|of| pair[0][of] + share * (pair[1][of] - pair[0][of])))
}

/// A dress form on the axis of Y, from hip (0.70 m) to neck (1.50 m), with caps: positions in metres and triangles, outside
/// counter-clockwise. `segments` points around each of its sections, at least 3.
#[must_use]
pub fn dress_form(segments: usize) -> (Vec<DVec3>, Vec<[u32; 3]>) {
    // Sections between those of the table are on straight lines and would add nothing.
    let rings: Vec<[f64; 3]> = SECTIONS_M.to_vec();
    stacked(&rings, segments, DVec3::ZERO)
}

/// A sphere with its poles on Y: positions in metres and triangles, outside counter-clockwise, `segments` points around, at
/// least 3, and half as many rings.
#[must_use]
pub fn sphere(centre_m: DVec3, radius_m: f64, segments: usize) -> (Vec<DVec3>, Vec<[u32; 3]>) {
    let count = (segments / 2).max(2);
    let mut rings = Vec::new();
    for ring in 1..count {
        let angle_rad = std::f64::consts::PI * ring as f64 / count as f64;
        let around_m = radius_m * libm::sin(angle_rad);
        rings.push([-radius_m * libm::cos(angle_rad), around_m, around_m]);
    }
    let (mut positions_m, triangles) = stacked(&rings, segments, centre_m);
    let poles = positions_m.len() - 2;
    positions_m[poles] = centre_m - DVec3::Y * radius_m;
    positions_m[poles + 1] = centre_m + DVec3::Y * radius_m;
    (positions_m, triangles)
}

/// A cylinder on the axis of Y between two heights, with flat ends: positions in metres and triangles, outside counter-clockwise, `segments`
/// points around, at least 3.
#[must_use]
pub fn cylinder([low_m, high_m]: [f64; 2], radius_m: f64, segments: usize) -> (Vec<DVec3>, Vec<[u32; 3]>) {
    stacked(&[low_m, high_m].map(|height_m| [height_m, radius_m, radius_m]), segments, DVec3::ZERO)
}

/// Elliptical rings (height, half width, half depth) from below upward, joined and closed by a point in the middle of the
/// lowest and of the highest; these two points are the last ones.
fn stacked(rings: &[[f64; 3]], segments: usize, centre_m: DVec3) -> (Vec<DVec3>, Vec<[u32; 3]>) {
    let segments = segments.max(3);
    let mut positions_m = Vec::new();
    for &[height, width, depth] in rings {
        for segment in 0..segments {
            let angle_rad = std::f64::consts::TAU * segment as f64 / segments as f64;
            positions_m.push(centre_m + DVec3::new(width * libm::sin(angle_rad), height, depth * libm::cos(angle_rad)));
        }
    }
    let bottom = positions_m.len() as u32;
    positions_m.push(centre_m + DVec3::Y * rings[0][0]);
    positions_m.push(centre_m + DVec3::Y * rings[rings.len() - 1][0]);
    let at = |ring: usize, segment: usize| (ring * segments + segment % segments) as u32;
    let mut triangles = Vec::new();
    for segment in 0..segments {
        triangles.push([bottom, at(0, segment + 1), at(0, segment)]);
        for ring in 1..rings.len() {
            let [a, b] = [at(ring - 1, segment), at(ring - 1, segment + 1)];
            let [c, d] = [at(ring, segment), at(ring, segment + 1)];
            triangles.extend([[a, b, d], [a, d, c]]);
        }
        let top = rings.len() - 1;
        triangles.push([bottom + 1, at(top, segment), at(top, segment + 1)]);
    }
    (positions_m, triangles)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn volume_m3(positions_m: &[DVec3], triangles: &[[u32; 3]]) -> f64 {
        let corner = |v: u32| positions_m[v as usize];
        triangles.iter().map(|&[a, b, c]| corner(a).dot(corner(b).cross(corner(c))) / 6.0).sum()
    }

    #[test]
    fn bodies_are_closed_and_face_outward() {
        let (positions_m, triangles) = sphere(DVec3::new(3.0, 1.0, -2.0), 0.5, 128);
        let wanted = 4.0 / 3.0 * std::f64::consts::PI * 0.125;
        assert!((volume_m3(&positions_m, &triangles) / wanted - 1.0).abs() < 2e-3);
        let (positions_m, triangles) = cylinder([-0.1, 0.2], 0.5, 128);
        let wanted = std::f64::consts::PI * 0.25 * 0.3;
        assert!((volume_m3(&positions_m, &triangles) / wanted - 1.0).abs() < 2e-3);
        let (positions_m, triangles) = dress_form(64);
        // A woman's trunk is some 30 litres.
        assert!((0.02..0.05).contains(&volume_m3(&positions_m, &triangles)));
        let [width_m, depth_m] = dress_form_radii_m(0.88).unwrap();
        assert!((width_m, depth_m) == (0.175, 0.130) && dress_form_radii_m(1.51).is_none());
    }
}
