//! A piece of a pattern as a mesh that keeps to its outline: a constrained Delaunay triangulation (crate `spade`), refined inside. The outline's places are
//! its only vertices there, so that runs of equally many places are sewn place to place. Knows neither form nor forces.

use glam::DVec2;
use spade::{AngleLimit, ConstrainedDelaunayTriangulation, Point2, RefinementParameters, Triangulation};

/// Angles that refinement strives for, degrees; beyond 30 it may not end.
const STRIVEN_DEG: f64 = 28.0;
/// Area of a triangle at most, in squares of an edge: half as much again as an equilateral one.
const LARGEST: f64 = 0.65;
/// Most vertices of a piece.
const MOST: usize = 1 << 20;

/// A mesh of a piece.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Cut {
    /// The outline's places in their order, those of holes, and those inside.
    pub places_m: Vec<DVec2>,
    /// Counter-clockwise.
    pub triangles: Vec<[u32; 3]>,
    /// Least angle of a triangle, radians.
    pub least_rad: f64,
    /// Mean length of edges, metres.
    pub edge_mean_m: f64,
}

/// Why an outline is not cut.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum CutError {
    /// Fewer than three places, or too many.
    #[error("an outline has {0} places, must be 3 to {MOST}")]
    Count(usize),
    /// A place that is no number.
    #[error("place {0} of the outline is not finite")]
    NotFinite(usize),
    /// An edge length that is none.
    #[error("edges of {0} m: must be finite and above 0")]
    Edge(f64),
    /// Two places at one place.
    #[error("places {0} and {1} of the outline lie at one place")]
    Same(usize, usize),
    /// An outline that crosses itself.
    #[error("the outline crosses itself between places {0} and {1}")]
    Crosses(usize, usize),
    /// Refinement came to no end.
    #[error("the outline is too fine for edges of {0} m: give its places at about that distance")]
    Endless(f64),
}

/// Cuts along closed lines of places, the outline first, then holes in it; edges inside are about `edge_m` long, metres.
///
/// # Errors
/// When a line has too few places, two at one place, or crosses itself or another one.
pub fn cut(lines: &[&[DVec2]], edge_m: f64) -> Result<Cut, CutError> {
    if !(edge_m.is_finite() && edge_m > 0.0) {
        return Err(CutError::Edge(edge_m));
    }
    let places_m: Vec<DVec2> = lines.iter().flat_map(|line| line.iter().copied()).collect();
    let shortest = lines.iter().map(|line| line.len()).min().unwrap_or(0);
    if shortest < 3 || places_m.len() > MOST {
        return Err(CutError::Count(if shortest < 3 { shortest } else { places_m.len() }));
    }
    if let Some(place) = places_m.iter().position(|place| !place.is_finite()) {
        return Err(CutError::NotFinite(place));
    }
    let mut sorted: Vec<usize> = (0..places_m.len()).collect();
    sorted.sort_by(|&a, &b| {
        let (a, b) = (places_m[a], places_m[b]);
        a.x.total_cmp(&b.x).then(a.y.total_cmp(&b.y))
    });
    if let Some(pair) = sorted.windows(2).find(|pair| places_m[pair[0]] == places_m[pair[1]]) {
        return Err(CutError::Same(pair[0].min(pair[1]), pair[0].max(pair[1])));
    }
    let mut sides = Vec::new();
    let mut first = 0;
    for line in lines {
        sides.extend((0..line.len()).map(|i| [first + i, first + (i + 1) % line.len()]));
        first += line.len();
    }
    let points = places_m.iter().map(|place| Point2::new(place.x, place.y)).collect();
    let mut crossing = None;
    let net = ConstrainedDelaunayTriangulation::<Point2<f64>>::try_bulk_load_cdt(points, sides, |[a, b]| {
        crossing.get_or_insert((a.min(b), a.max(b)));
    });
    if let Some((a, b)) = crossing {
        return Err(CutError::Crosses(a, b));
    }
    let mut net = net.map_err(|_| CutError::NotFinite(0))?;
    let refined = net.refine(
        RefinementParameters::new()
            .exclude_outer_faces(true)
            .keep_constraint_edges()
            .with_angle_limit(AngleLimit::from_deg(STRIVEN_DEG))
            .with_min_required_area(0.1 * edge_m * edge_m)
            .with_max_allowed_area(LARGEST * edge_m * edge_m)
            .with_max_additional_vertices(MOST),
    );
    if !refined.refinement_complete {
        return Err(CutError::Endless(edge_m));
    }
    let outside: std::collections::BTreeSet<usize> = refined.excluded_faces.iter().map(|face| face.index()).collect();
    let all_m: Vec<DVec2> = net.vertices().map(|v| DVec2::new(v.position().x, v.position().y)).collect();
    let triangles: Vec<[u32; 3]> = net
        .inner_faces()
        .filter(|face| !outside.contains(&face.fix().index()))
        .map(|face| face.vertices().map(|v| v.fix().index() as u32))
        .collect();
    let (mut least_rad, mut sum_m) = (f64::INFINITY, 0.0);
    for corners in &triangles {
        for i in 0..3 {
            let [at, a, b] = [i, (i + 1) % 3, (i + 2) % 3].map(|i| all_m[corners[i] as usize]);
            least_rad = least_rad.min((a - at).angle_to(b - at).abs());
            sum_m += at.distance(a);
        }
    }
    let edge_mean_m = sum_m / (3 * triangles.len()).max(1) as f64;
    Ok(Cut { places_m: all_m, triangles, least_rad, edge_mean_m })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::slices::area_m2;

    fn covered_m2(cut: &Cut) -> f64 {
        let corners = |triangle: &[u32; 3]| triangle.map(|v| cut.places_m[v as usize]);
        cut.triangles.iter().map(|triangle| area_m2(&corners(triangle))).sum()
    }

    #[test]
    fn a_piece_with_a_dart_and_a_hole_is_covered_and_no_more() {
        // 30 by 20 cm with a notch from above and a square hole, places about a centimetre apart.
        let corners = [(0.0, 0.0), (0.3, 0.0), (0.3, 0.2), (0.17, 0.2), (0.15, 0.1), (0.13, 0.2), (0.0, 0.2)];
        let divided = |corners: &[(f64, f64)]| -> Vec<DVec2> {
            let mut line = Vec::new();
            for (i, from) in corners.iter().enumerate() {
                let (from, to) = (DVec2::from(*from), DVec2::from(corners[(i + 1) % corners.len()]));
                let count = (from.distance(to) / 0.01).round() as usize;
                line.extend((0..count).map(|k| from.lerp(to, k as f64 / count as f64)));
            }
            line
        };
        let (outline, hole) = (divided(&corners), divided(&[(0.2, 0.05), (0.2, 0.09), (0.26, 0.09), (0.26, 0.05)]));
        let cut = cut(&[&outline, &hole], 0.01).unwrap();
        let wanted = area_m2(&outline) - area_m2(&hole).abs();
        assert!((covered_m2(&cut) - wanted).abs() < 1e-12, "{}", covered_m2(&cut));
        assert_eq!(&cut.places_m[..outline.len()], &outline);
        let sides = |places: usize| (0..places).map(move |i| [i as u32, ((i + 1) % places) as u32]);
        for [a, b] in sides(outline.len()) {
            let has = cut.triangles.iter().filter(|t| t.contains(&a) && t.contains(&b)).count();
            assert_eq!(has, 1, "the outline's side {a}-{b} stays whole");
        }
        assert!(
            cut.least_rad.to_degrees() > 10.0 && (cut.edge_mean_m / 0.01 - 1.0).abs() < 0.15,
            "{} {}",
            cut.least_rad.to_degrees(),
            cut.edge_mean_m
        );
        assert_eq!(super::cut(&[&outline, &hole], 0.01).unwrap(), cut);
    }

    #[test]
    fn what_is_no_outline_is_said() {
        let square = [DVec2::ZERO, DVec2::X, DVec2::ONE, DVec2::Y];
        let bow = [DVec2::ZERO, DVec2::ONE, DVec2::X, DVec2::Y];
        assert_eq!(cut(&[&square[..2]], 0.1), Err(CutError::Count(2)));
        assert_eq!(cut(&[&square], 0.0), Err(CutError::Edge(0.0)));
        assert!(matches!(cut(&[&bow], 0.1), Err(CutError::Crosses(..))));
        let twice = [DVec2::ZERO, DVec2::X, DVec2::ONE, DVec2::X, DVec2::Y];
        assert_eq!(cut(&[&twice], 0.1), Err(CutError::Same(1, 3)));
        let lost = [DVec2::ZERO, DVec2::X, DVec2::NAN];
        assert_eq!(cut(&[&lost], 0.1), Err(CutError::NotFinite(2)));
    }
}
