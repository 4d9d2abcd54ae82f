//! Scenes of textile laboratories, with what they measure: the cantilever and the drape meter. Knows no pictures.

use super::around::Around;
use super::curves::{elastica, peirce_m};
use super::{Figures, Scene};
use glam::{DVec2, DVec3};
use kitsuke_drape::analytic_form;
use kitsuke_drape::body::Body;
use kitsuke_drape::drape::Settings;
use kitsuke_drape::sheet::{Grid, PatternMesh, Sheet, SheetError};
use kitsuke_drape::woven::Woven;
use std::f64::consts::{PI, TAU};

/// Of the cantilever: cells along what hangs, rows of particles that are held, and particles across.
const CELLS: usize = 16;
const HELD: usize = 3;
const WIDE: usize = 7;

/// The cantilever hangs out so many bending lengths.
const LENGTHS: f64 = 2.0;

const SUPPORT_M: f64 = 0.09;
const DISC_M: f64 = 0.15;
/// Rings of the disc; some of them end at the edge of the support.
const RINGS: usize = 30;
/// Sides of the cells that the shadow is counted in.
const SHADOW_M: f64 = 0.0005;
/// What the rim goes out and in again by less is no node.
const NODE_M: f64 = 0.002;

fn bending_length_m(woven: &Woven) -> f64 {
    libm::cbrt(woven.warp_bending_nm / (woven.mass_kg_per_m2 * 9.81))
}

/// A strip along the warp, held level at one end, reaches out twice its bending length.
pub fn cantilever(woven: &Woven) -> Result<Scene, SheetError> {
    let spacing_m = LENGTHS * bending_length_m(woven) / CELLS as f64;
    let grid = Grid {
        rows: HELD + CELLS,
        columns: WIDE,
        spacing_m,
        corner_m: DVec3::new(-spacing_m * (HELD - 1) as f64, 0.0, -0.5 * spacing_m * (WIDE - 1) as f64),
        weft: DVec3::Z,
        warp: DVec3::X,
    };
    let mut sheet = Sheet::from_grid(&grid)?;
    for particle in 0..HELD * WIDE {
        let at_m = sheet.positions_m()[particle];
        sheet.pin(particle as u32, at_m)?;
    }
    Ok(Scene { figures: Some(Box::new(of_cantilever)), parts: 80, ..Scene::of(sheet) })
}

/// The angle of the chord with the bending length that follows, and the way to the elastica of each place of the middle line.
fn of_cantilever(_: &Scene, woven: &Woven, positions_m: &[DVec3]) -> Figures {
    let length_m = LENGTHS * bending_length_m(woven);
    let line: Vec<DVec2> =
        (HELD - 1..HELD + CELLS).map(|row| positions_m[row * WIDE + WIDE / 2].truncate() / length_m).collect();
    let wanted = elastica(LENGTHS, CELLS + 1);
    let below_rad = |line: &[DVec2]| libm::atan2(-line[CELLS].y, line[CELLS].x);
    let farthest = line.iter().zip(&wanted).map(|(at, wanted)| at.distance(*wanted)).fold(0.0, f64::max);
    vec![
        ("chord_deg", below_rad(&line).to_degrees()),
        ("elastica_chord_deg", below_rad(&wanted).to_degrees()),
        ("bending_length_mm", 1e3 * peirce_m(length_m, below_rad(&line))),
        ("analytic_bending_length_mm", 1e3 * bending_length_m(woven)),
        ("farthest_from_elastica_mm", 1e3 * farthest * length_m),
    ]
}

/// Cusick's drape meter (ISO 9073-9): a disc of 30 cm, held between two of 18 cm, hangs over their edge. Its shadow is the larger the stiffer
/// the cloth is for its weight; `for cloth in chirimen yukata tsumugi omeshi obi; do cargo xtask drape-scene drape-coefficient --cloth $cloth
/// --out DIR/$cloth; done` shows all presets, the softest first.
pub fn drape_coefficient() -> Result<Scene, SheetError> {
    let clearance_m = Settings::default().clearance_m;
    let (positions_m, triangles) = disc(clearance_m);
    let corners_uv: Vec<[DVec2; 3]> = triangles
        .iter()
        .map(|corners| corners.map(|v| positions_m[v as usize]).map(|p| DVec2::new(p.x, -p.z)))
        .collect();
    let mut sheet = Sheet::from_pattern(&PatternMesh {
        positions_m: &positions_m,
        triangles: &triangles,
        corners_uv: &corners_uv,
        metres_per_uv: 1.0,
        welds: &[],
    })?;
    for (particle, &at_m) in positions_m.iter().enumerate() {
        if DVec2::new(at_m.x, at_m.z).length() < SUPPORT_M + 1e-6 {
            sheet.pin(particle as u32, at_m)?;
        }
    }
    // The cloth goes round the edge in its clearance.
    let (body_m, body_triangles) = analytic_form::cylinder([-0.01, 0.0], SUPPORT_M - clearance_m, 96);
    let body = Body::new(&body_m, &body_triangles).expect("a cylinder is a body");
    Ok(Scene { around: Around::of(body), figures: Some(Box::new(of_drape_meter)), parts: 20, ..Scene::of(sheet) })
}

/// Particles around a ring, at about the distance of the rings; the 0th is the middle.
fn around(ring: usize) -> usize {
    (TAU * ring as f64).round() as usize
}

/// A level disc of round rings, each turned against the one before by another share, so that folds find no direction better than others.
fn disc(height_m: f64) -> (Vec<DVec3>, Vec<[u32; 3]>) {
    /// The golden section: its multiples' fractions are spread evenly.
    const TURN: f64 = 0.618_033_988_749_895;
    let angle_rad = |ring: usize, i: usize| TAU * (i as f64 + (ring as f64 * TURN).fract()) / around(ring) as f64;
    let mut positions_m = vec![DVec3::Y * height_m];
    let mut triangles = Vec::new();
    let mut first = [0, 0];
    for ring in 1..=RINGS {
        first = [first[1], positions_m.len()];
        let radius_m = DISC_M * ring as f64 / RINGS as f64;
        for i in 0..around(ring) {
            let (sin, cos) = (libm::sin(angle_rad(ring, i)), libm::cos(angle_rad(ring, i)));
            positions_m.push(DVec3::new(radius_m * sin, height_m, radius_m * cos));
        }
        let inner_count = around(ring - 1);
        let inner_at = |i: usize| (first[0] + i % inner_count.max(1)) as u32;
        let outer_at = |i: usize| (first[1] + i % around(ring)) as u32;
        let (mut inner, mut outer) = (0, 0);
        while inner < inner_count || outer < around(ring) {
            // The shorter of both diagonals.
            let is_outer = inner == inner_count
                || outer < around(ring)
                    && (angle_rad(ring, outer + 1) - angle_rad(ring - 1, inner)).abs()
                        < (angle_rad(ring - 1, inner + 1) - angle_rad(ring, outer)).abs();
            let next = if is_outer { outer_at(outer + 1) } else { inner_at(inner + 1) };
            triangles.push([outer_at(outer), next, inner_at(inner)]);
            if is_outer { outer += 1 } else { inner += 1 }
        }
    }
    (positions_m, triangles)
}

/// The drape coefficient and the nodes, in which the rim stands out.
fn of_drape_meter(scene: &Scene, _: &Woven, positions_m: &[DVec3]) -> Figures {
    let from_above: Vec<DVec2> = positions_m.iter().map(|p| DVec2::new(p.x, p.z)).collect();
    let support_m2 = PI * SUPPORT_M * SUPPORT_M;
    let coefficient =
        (shadow_m2(&from_above, scene.sheet.triangles()) - support_m2) / (PI * DISC_M * DISC_M - support_m2);
    let rim_m: Vec<f64> = from_above[from_above.len() - around(RINGS)..].iter().map(|p| p.length()).collect();
    vec![("drape_coefficient_percent", 1e2 * coefficient), ("nodes", nodes(&rim_m) as f64)]
}

/// Area that triangles cover together, counted in cells.
fn shadow_m2(places_m: &[DVec2], triangles: &[[u32; 3]]) -> f64 {
    let side = 2 * (DISC_M / SHADOW_M) as usize + 8;
    let middle = DVec2::splat(0.5 * side as f64);
    let mut is_dark = vec![false; side * side];
    for corners in triangles {
        let [a, b, c] = corners.map(|v| places_m[v as usize] / SHADOW_M + middle);
        let turned = (b - a).perp_dot(c - a).signum();
        let (low, high) = (a.min(b).min(c).max(DVec2::ZERO), a.max(b).max(c));
        for y in low.y as usize..=(high.y as usize).min(side - 1) {
            for x in low.x as usize..=(high.x as usize).min(side - 1) {
                let at = DVec2::new(x as f64 + 0.5, y as f64 + 0.5);
                let is_in = [(a, b), (b, c), (c, a)].iter().all(|(p, q)| turned * (*q - *p).perp_dot(at - *p) >= 0.0);
                is_dark[y * side + x] |= is_in;
            }
        }
    }
    is_dark.iter().filter(|dark| **dark).count() as f64 * SHADOW_M * SHADOW_M
}

/// How often a closed line goes out and in again by [`NODE_M`], from its innermost place on.
fn nodes(radii_m: &[f64]) -> usize {
    let innermost = (0..radii_m.len()).min_by(|&a, &b| radii_m[a].total_cmp(&radii_m[b])).unwrap_or(0);
    let (mut count, mut is_out) = (0, false);
    let mut turn_m = radii_m[innermost];
    for i in 1..=radii_m.len() {
        let radius_m = radii_m[(innermost + i) % radii_m.len()];
        if is_out && radius_m < turn_m - NODE_M {
            count += 1;
            (is_out, turn_m) = (false, radius_m);
        } else if !is_out && radius_m > turn_m + NODE_M {
            (is_out, turn_m) = (true, radius_m);
        }
        turn_m = if is_out { turn_m.max(radius_m) } else { turn_m.min(radius_m) };
    }
    count
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_flat_disc_casts_its_whole_shadow_and_has_no_nodes() {
        let scene = drape_coefficient().unwrap();
        let figures = of_drape_meter(&scene, &Woven::default(), scene.sheet.positions_m());
        assert!((figures[0].1 - 100.0).abs() < 0.3 && figures[1].1 == 0.0, "{figures:?}");
    }

    #[test]
    fn nodes_are_counted_around_the_rim() {
        for (folds, size_m, wanted) in [(7, 0.01, 7), (1, 0.01, 1), (7, 0.0005, 0)] {
            let radius_m = |i: usize| 0.1 + size_m * libm::sin(TAU * (folds * i) as f64 / 180.0);
            let radii_m: Vec<f64> = (0..180).map(radius_m).collect();
            assert_eq!(nodes(&radii_m), wanted);
        }
    }
}
