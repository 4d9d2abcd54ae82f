//! Sewing alone: a bag of a front, a back and a round bottom, cut from their outlines, sewn with curved seams and with ease, hung up by its rim. Knows no
//! form.

use super::{Figures, Scene};
use glam::{DVec2, DVec3};
use kitsuke_drape::pattern::{Pattern, Piece, Run};
use kitsuke_drape::sew::{Sewn, sew};
use kitsuke_drape::sheet::{PatternMesh, Sheet};
use std::collections::BTreeMap;
use std::f64::consts::{PI, TAU};

/// Of the bottom, metres.
const RADIUS_M: f64 = 0.08;
const HIGH_M: f64 = 0.16;
/// How much higher the front is than the back it is sewn to, metres.
const EASED_M: f64 = 0.004;
/// How long edges are, about, metres.
const EDGE_M: f64 = 0.008;
/// Sides of the bottom's outline.
const SIDES: usize = 96;

/// The bag, with its rim held.
pub fn scene() -> Result<Scene, String> {
    let pattern = bag();
    for piece in &pattern.pieces {
        piece.check().map_err(|error| error.to_string())?;
    }
    let sewn = sew(&pattern, EDGE_M, 1.5 * EASED_M).map_err(|error| error.to_string())?;
    let positions_m: Vec<DVec3> =
        sewn.places_m.iter().zip(&sewn.pieces).map(|(at, piece)| begins_m(&pattern, *piece, *at)).collect();
    let corners_uv: Vec<[DVec2; 3]> =
        sewn.triangles.iter().map(|corners| corners.map(|v| sewn.places_m[v as usize])).collect();
    let mut sheet = Sheet::from_pattern(&PatternMesh {
        positions_m: &positions_m,
        triangles: &sewn.triangles,
        corners_uv: &corners_uv,
        metres_per_uv: 1.0,
        welds: &sewn.welds,
    })
    .map_err(|error| error.to_string())?;
    for rim in [&sewn.runs[0][2], &sewn.runs[1][2]] {
        for &vertex in rim {
            let particle = sheet.particle_of_vertex()[vertex as usize];
            sheet.pin(particle, sheet.positions_m()[particle as usize]).map_err(|error| error.to_string())?;
        }
    }
    let figures =
        move |scene: &Scene, _: &_, positions_m: &[DVec3]| measured(&pattern, &sewn, &scene.sheet, positions_m);
    Ok(Scene { figures: Some(Box::new(figures)), ..Scene::of(sheet) })
}

/// Front, back and bottom.
fn bag() -> Pattern {
    let round = |i: usize| {
        let angle = TAU * i as f64 / SIDES as f64;
        DVec2::new(libm::cos(angle), libm::sin(angle)) * RADIUS_M
    };
    let half = |name: &str, from: usize| Run {
        name: name.to_owned(),
        places_m: (from..=from + SIDES / 2).map(|i| round(i % SIDES)).collect(),
    };
    let halves = vec![half("front", 0), half("back", SIDES / 2)];
    let wide_m = halves[0].length_m();
    let panel = |name: &str, high_m: f64| {
        let corners = [DVec2::ZERO, DVec2::X * wide_m, DVec2::new(wide_m, high_m), DVec2::Y * high_m];
        let runs = ["hem", "right side", "rim", "left side"].iter().enumerate();
        let runs =
            runs.map(|(i, run)| Run { name: (*run).to_owned(), places_m: vec![corners[i], corners[(i + 1) % 4]] });
        piece(name, runs.collect())
    };
    let pieces = vec![panel("front", HIGH_M + EASED_M), panel("back", HIGH_M), piece("bottom", halves)];
    let seams = vec![[[0, 1], [1, 3]], [[1, 1], [0, 3]], [[0, 0], [2, 0]], [[1, 0], [2, 1]]];
    Pattern { pieces, seams }
}

fn piece(name: &str, runs: Vec<Run>) -> Piece {
    Piece { name: name.to_owned(), runs, grain_m: [DVec2::ZERO, DVec2::Y * 0.05], notches_m: Vec::new() }
}

/// Where a place of a piece begins: panels upright round the bottom, the front as high as the back.
fn begins_m(pattern: &Pattern, piece: usize, at_m: DVec2) -> DVec3 {
    if piece == 2 {
        return DVec3::new(at_m.x, 0.0, at_m.y);
    }
    let rim_m = &pattern.pieces[piece].runs[2].places_m[0];
    let (around, up) = (PI * (1.0 + at_m.x / rim_m.x), at_m.y / rim_m.y);
    let side = if piece == 0 { 1.0 } else { -1.0 };
    DVec3::new(side * RADIUS_M * libm::cos(around), HIGH_M * up, -side * RADIUS_M * libm::sin(around))
}

/// What seams and cloth are like at rest.
fn measured(pattern: &Pattern, sewn: &Sewn, sheet: &Sheet, positions_m: &[DVec3]) -> Figures {
    let (mut unequal_m, mut eased_m, mut longer_m) = (0.0_f64, 0.0_f64, 0.0_f64);
    for seam in &pattern.seams {
        let differ_m = pattern.unequal_m(*seam);
        let is_eased = seam[0][1] == 1;
        if is_eased {
            eased_m = eased_m.max(differ_m)
        } else {
            unequal_m = unequal_m.max(differ_m)
        }
        let before_m = 0.5 * (pattern.run(seam[0]).length_m() + pattern.run(seam[1]).length_m());
        let [piece, run] = seam[0];
        let at = |vertex: u32| positions_m[sheet.particle_of_vertex()[vertex as usize] as usize];
        let after_m: f64 = sewn.runs[piece][run].windows(2).map(|pair| at(pair[0]).distance(at(pair[1]))).sum();
        longer_m = longer_m.max((after_m - before_m).abs());
    }
    let mut triangles_at: BTreeMap<[u32; 2], usize> = BTreeMap::new();
    for &[a, b, c] in sheet.triangles() {
        for [from, to] in [[a, b], [b, c], [c, a]] {
            *triangles_at.entry([from.min(to), from.max(to)]).or_default() += 1;
        }
    }
    let with = |count: usize| triangles_at.values().filter(|triangles| **triangles == count).count();
    let euler = sheet.positions_m().len() as f64 - triangles_at.len() as f64 + sheet.triangles().len() as f64;
    vec![
        ("seams", pattern.seams.len() as f64),
        ("seam_unequal_max_mm", 1e3 * unequal_m),
        ("eased_mm", 1e3 * eased_m),
        ("seam_rest_differs_max_mm", 1e3 * longer_m),
        ("least_angle_deg", sewn.least_rad.to_degrees()),
        ("welds", sewn.welds.len() as f64),
        ("border_edges", with(1) as f64),
        ("branching_edges", triangles_at.values().filter(|triangles| **triangles > 2).count() as f64),
        ("euler", euler),
    ]
}
