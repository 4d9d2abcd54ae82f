//! Level cuts through a closed triangle mesh: the loops in which planes of one height meet it. Knows neither bodies nor cloth.

use glam::{DVec2, DVec3};
use std::collections::BTreeMap;

/// A closed line in a level plane: X and Z, metres, the last place joined to the first. Seen from above with X to the right and Z down, outer loops of
/// a mesh that faces outside go clockwise.
pub type Loop = Vec<DVec2>;

/// The loops at each of `heights_m` (ascending, finite), in an order that the mesh alone decides. Vertices at a height count as above it.
///
/// # Panics
/// When a triangle names a vertex that is not there.
#[must_use]
pub fn slices(positions_m: &[DVec3], triangles: &[[u32; 3]], heights_m: &[f64]) -> Vec<Vec<Loop>> {
    // Of each plane, from the edge where a piece of line begins to the one where it ends.
    let mut pieces: Vec<BTreeMap<[u32; 2], [u32; 2]>> = vec![BTreeMap::new(); heights_m.len()];
    for corners in triangles {
        let ys = corners.map(|v| positions_m[v as usize].y);
        let (low, high) = (ys[0].min(ys[1]).min(ys[2]), ys[0].max(ys[1]).max(ys[2]));
        let first = heights_m.partition_point(|height| *height <= low);
        for (plane, &height) in heights_m.iter().enumerate().skip(first) {
            if height > high {
                break;
            }
            let is_above = ys.map(|y| y >= height);
            // Down through one edge and up through another: the inside is always on the same side of the line.
            let mut ends = [None; 2];
            for i in 0..3 {
                let j = (i + 1) % 3;
                if is_above[i] != is_above[j] {
                    let edge = [corners[i].min(corners[j]), corners[i].max(corners[j])];
                    ends[usize::from(is_above[j])] = Some(edge);
                }
            }
            if let [Some(down), Some(up)] = ends {
                pieces[plane].insert(down, up);
            }
        }
    }
    let at_m = |[a, b]: [u32; 2], height: f64| {
        let (a, b) = (positions_m[a as usize], positions_m[b as usize]);
        let share = (height - a.y) / (b.y - a.y);
        let at = a.lerp(b, share);
        DVec2::new(at.x, at.z)
    };
    (pieces.into_iter().zip(heights_m))
        .map(|(mut pieces, &height)| {
            let mut loops = Vec::new();
            while let Some((first, mut next)) = pieces.pop_first() {
                let mut line = vec![at_m(first, height)];
                while next != first {
                    line.push(at_m(next, height));
                    // Of a mesh that is open, the rest of the line is missing.
                    let Some(after) = pieces.remove(&next) else { break };
                    next = after;
                }
                if line.len() > 2 {
                    loops.push(line);
                }
            }
            loops
        })
        .collect()
}

/// Area of a closed line with its sign, square metres.
#[must_use]
pub fn area_m2(line: &[DVec2]) -> f64 {
    let pairs = line.iter().zip(line.iter().cycle().skip(1));
    0.5 * pairs.map(|(a, b)| a.perp_dot(*b)).sum::<f64>()
}

/// The middle of the area of a closed line; of one without area, the mean of its places.
#[must_use]
pub fn middle_m(line: &[DVec2]) -> DVec2 {
    let from_m = line[0];
    let (mut sum, mut area) = (DVec2::ZERO, 0.0);
    for (a, b) in line.iter().zip(line.iter().cycle().skip(1)) {
        let (a, b) = (*a - from_m, *b - from_m);
        sum += (a + b) * (a.perp_dot(b) / 3.0);
        area += a.perp_dot(b);
    }
    if area.abs() < 1e-12 { line.iter().sum::<DVec2>() / line.len() as f64 } else { from_m + sum / area }
}

/// Length of a closed line, metres.
#[must_use]
pub fn girth_m(line: &[DVec2]) -> f64 {
    line.iter().zip(line.iter().cycle().skip(1)).map(|(a, b)| a.distance(*b)).sum()
}

/// The convex hull, counter-clockwise from the place with the least X (Andrew's monotone chain). Fewer than three places on a line or a point.
#[must_use]
pub fn hull(places_m: &[DVec2]) -> Loop {
    let mut sorted = places_m.to_vec();
    sorted.sort_by(|a, b| a.x.total_cmp(&b.x).then(a.y.total_cmp(&b.y)));
    sorted.dedup();
    let mut chain: Loop = Vec::new();
    for pass in 0..2 {
        let start = chain.len();
        let mut add = |place_m: DVec2| {
            while chain.len() >= start + 2
                && (chain[chain.len() - 1] - chain[chain.len() - 2]).perp_dot(place_m - chain[chain.len() - 2]) <= 0.0
            {
                chain.pop();
            }
            chain.push(place_m);
        };
        if pass == 0 {
            sorted.iter().for_each(|p| add(*p))
        } else {
            sorted.iter().rev().for_each(|p| add(*p))
        }
        chain.pop();
    }
    chain
}

/// How far along a ray from `from_m` (direction a unit vector) a closed line is met the last time, metres; none where it is not met.
#[must_use]
pub fn last_met_m(line: &[DVec2], from_m: DVec2, direction: DVec2) -> Option<f64> {
    let mut farthest_m: Option<f64> = None;
    for (a, b) in line.iter().zip(line.iter().cycle().skip(1)) {
        let (a, b) = (*a - from_m, *b - from_m);
        let (side_a, side_b) = (direction.perp_dot(a), direction.perp_dot(b));
        // Half open, so that a corner on the ray belongs to one side.
        if (side_a <= 0.0) == (side_b <= 0.0) {
            continue;
        }
        let along_m = a.lerp(b, side_a / (side_a - side_b)).dot(direction);
        if along_m >= 0.0 {
            farthest_m = Some(farthest_m.map_or(along_m, |m| m.max(along_m)));
        }
    }
    farthest_m
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::analytic_form::{cylinder, sphere};
    use std::f64::consts::PI;

    #[test]
    fn a_ball_and_a_tube_are_cut_into_circles() {
        let (positions_m, triangles) = sphere(DVec3::new(0.1, 1.0, 0.2), 0.3, 128);
        let heights_m = [0.6, 0.8, 1.0, 1.2, 1.31];
        let cuts = slices(&positions_m, &triangles, &heights_m);
        assert_eq!(cuts.iter().map(Vec::len).collect::<Vec<_>>(), [0, 1, 1, 1, 0]);
        for (loops, height) in cuts.iter().zip(heights_m) {
            for line in loops {
                let radius_m = libm::sqrt(0.09 - (height - 1.0) * (height - 1.0));
                assert!((girth_m(line) / (2.0 * PI * radius_m) - 1.0).abs() < 2e-3);
                assert!((area_m2(line).abs() / (PI * radius_m * radius_m) - 1.0).abs() < 4e-3);
                assert!(middle_m(line).distance(DVec2::new(0.1, 0.2)) < 1e-3);
                assert!((area_m2(&hull(line)) / area_m2(line).abs() - 1.0).abs() < 1e-9);
                let met_m = last_met_m(line, DVec2::new(0.1, 0.2), DVec2::Y).unwrap();
                assert!((met_m - radius_m).abs() < 1e-3);
            }
        }
        // Two tubes give two loops that turn the same way.
        let (mut positions_m, mut triangles) = cylinder([0.0, 1.0], 0.1, 32);
        let (others_m, more) = cylinder([0.0, 1.0], 0.1, 32);
        let count = positions_m.len() as u32;
        positions_m.extend(others_m.iter().map(|p| *p + DVec3::X));
        triangles.extend(more.iter().map(|corners| corners.map(|v| v + count)));
        let loops = &slices(&positions_m, &triangles, &[0.5])[0];
        assert_eq!(loops.len(), 2);
        assert!(area_m2(&loops[0]).signum() == area_m2(&loops[1]).signum());
    }

    #[test]
    fn hulls_are_convex_and_hold_all() {
        let places_m: Vec<DVec2> =
            (0..60).map(|i| DVec2::new(libm::sin(f64::from(i * i)), libm::cos(f64::from(i * 7)) * 0.4)).collect();
        let hull = hull(&places_m);
        assert!(area_m2(&hull) > 0.0);
        for (a, b) in hull.iter().zip(hull.iter().cycle().skip(1)) {
            assert!(places_m.iter().all(|p| (*b - *a).perp_dot(*p - *a) >= -1e-12));
        }
        assert_eq!(super::hull(&[DVec2::ZERO, DVec2::X, DVec2::Y, DVec2::ONE, DVec2::splat(0.5)]).len(), 4);
    }
}
