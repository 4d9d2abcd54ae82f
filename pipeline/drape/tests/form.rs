//! Dress forms: of bodies from formulas, whose sections are known, and of real ones.

use glam::{DVec2, DVec3};
use kitsuke_drape::analytic_form;
use kitsuke_drape::body::Body;
use kitsuke_drape::depth_maps::DepthMaps;
use kitsuke_drape::drape::Settings;
use kitsuke_drape::fabric::Fabric;
use kitsuke_drape::form::{Cut, Form, FormError, Lines, direction};
use kitsuke_drape::mapping::DartKind;
use kitsuke_drape::relax;
use kitsuke_drape::sew::sew;
use kitsuke_drape::skirt::{Design, Draping, SkirtError, apart_m, laid_on, pattern, redrape};
use kitsuke_drape::skirt_by_forces::{Relaxing, by_forces};
use kitsuke_drape::woven::Woven;
use std::f64::consts::{PI, TAU};

/// An upright body of round level sections: radii (X, Z) at heights, an angle turned about +Y for each side.
fn turned(radii_m: impl Fn(f64) -> [f64; 2], heights: usize, tall_m: f64) -> (Vec<DVec3>, Vec<[u32; 3]>) {
    const AROUND: usize = 96;
    let (mut positions_m, mut triangles) = (Vec::new(), Vec::new());
    for level in 0..heights {
        let y = tall_m * level as f64 / (heights - 1) as f64;
        let [x, z] = radii_m(y);
        for i in 0..AROUND {
            let angle = TAU * i as f64 / AROUND as f64;
            positions_m.push(DVec3::new(x * libm::sin(angle), y, z * libm::cos(angle)));
        }
    }
    let at = |level: usize, i: usize| (level * AROUND + i % AROUND) as u32;
    let (below, above) = (positions_m.len() as u32, positions_m.len() as u32 + 1);
    positions_m.extend([DVec3::ZERO, DVec3::Y * tall_m]);
    for i in 0..AROUND {
        triangles.push([below, at(0, i + 1), at(0, i)]);
        triangles.push([above, at(heights - 1, i), at(heights - 1, i + 1)]);
        for level in 1..heights {
            triangles.push([at(level - 1, i), at(level - 1, i + 1), at(level, i + 1)]);
            triangles.push([at(level - 1, i), at(level, i + 1), at(level, i)]);
        }
    }
    (positions_m, triangles)
}

/// A person of 1.6 m from formulas: two legs up to 0.72 m, a trunk with hip at 0.82 m, waist at 1.0 m, bust at 1.15 m, a neck at 1.35 m and a head; arms
/// level at 1.25 m.
fn person() -> Body {
    let bump = |y: f64, at: f64, wide: f64| libm::exp(-(y - at) * (y - at) / (wide * wide));
    let trunk = move |y: f64| {
        let y = 0.7 + y;
        let neck = 0.11 * bump(y, 1.36, 0.06);
        let round = 0.12 + 0.06 * bump(y, 0.82, 0.1) + 0.03 * bump(y, 1.15, 0.08) - 0.01 * bump(y, 1.0, 0.05);
        [1.3 * round - neck, round - 0.8 * neck]
    };
    let mut parts = vec![turned(trunk, 120, 0.9)];
    parts[0].0.iter_mut().for_each(|p| p.y += 0.7);
    for side in [-1.0, 1.0] {
        let mut leg = turned(|y| [0.05 + 0.04 * y, 0.05 + 0.04 * y], 40, 0.72);
        leg.0.iter_mut().for_each(|p| p.x += side * 0.1);
        parts.push(leg);
        let mut arm = turned(|_| [0.04, 0.04], 40, 0.6);
        // Turned about Z, so that it still faces out.
        arm.0.iter_mut().for_each(|p| *p = DVec3::new(side * p.y, 1.25 - side * p.x, p.z));
        parts.push(arm);
    }
    let (mut positions_m, mut triangles) = (Vec::new(), Vec::new());
    for (part_m, corners) in parts {
        let before = positions_m.len() as u32;
        positions_m.extend(part_m);
        triangles.extend(corners.into_iter().map(|corners| corners.map(|v| v + before)));
    }
    Body::new(&positions_m, &triangles).unwrap()
}

#[test]
fn a_person_from_formulas_has_her_lines_and_neither_arms_nor_head() {
    let body = person();
    let form = Form::of(&body, &Cut::default()).unwrap();
    assert_eq!(form.size(), [633, 256]);
    let Lines { waist_m, hip_m, bust_m, centre_x_m, side_z_m } = form.lines;
    assert!((waist_m - 0.99).abs() < 0.03 && (hip_m - 0.82).abs() < 0.02 && (bust_m - 1.15).abs() < 0.02, "{form:?}");
    assert!(centre_x_m.abs() < 1e-3 && side_z_m.abs() < 0.01);
    assert!((form.span_m()[1] - 1.36).abs() < 0.02 && (form.arms_m - 1.21).abs() < 0.01, "{:?}", form.span_m());
    for height_m in [0.5, 0.9, 1.1, 1.25, 1.3] {
        let section = form.section(height_m);
        let widest_m = (0..256).map(|i| section.at_m(TAU * f64::from(i) / 256.0).x).fold(0.0, f64::max);
        assert!(widest_m < 0.25, "{height_m}: {widest_m}");
    }
    // The trunk's own sections.
    let waist = form.section(1.0);
    assert!(
        (waist.radius_m(0.0) - waist.radius_m(PI)).abs() < 1e-3
            && (waist.radius_m(PI / 2.0) / waist.radius_m(0.0) - 1.3).abs() < 0.01
    );
    let apart = form.apart(&body, form.arms_m);
    assert!(apart.form_mean_m < 1e-4 && apart.form_max_m < 2e-3 && apart.body_max_m < 5e-3, "{apart:?}");
    assert!(apart.vertices > 1000 && apart.open > 0.02 && apart.open < 0.3);
    // What hangs straight down from the hip.
    let skirt = form.skirt();
    assert_eq!(skirt.section(0.5).radii_m(), skirt.section(0.7).radii_m());
    assert!(skirt.section(0.5).girth_m() >= form.section(hip_m).girth_m() - 1e-6);
}

#[test]
fn a_form_as_a_mesh_is_a_body_of_its_volume() {
    let (positions_m, triangles) = turned(|y| [0.2 - 0.05 * y, 0.15], 40, 1.5);
    let body = Body::new(&positions_m, &triangles).unwrap();
    let form = Form::of(&body, &Cut { sections: 100, places: 64, from: 0.1 }).unwrap();
    let (mesh_m, corners) = form.mesh(0.01);
    let grown = Body::new(&mesh_m, &corners).unwrap();
    let [low_m, high_m] = form.span_m();
    for i in 0..200 {
        let (turn, share) = (f64::from(i) * 2.4, f64::from(i) / 200.0);
        let y = low_m + (high_m - low_m) * share;
        let section = form.section(y);
        let place = |out_m: f64| {
            let at = section.middle_m + direction(turn) * (section.radius_m(turn) + out_m);
            DVec3::new(at.x, y, at.y)
        };
        assert!(grown.contains(place(0.008)) || !(0.01..0.99).contains(&share), "{i}");
        assert!(!grown.contains(place(0.012)), "{i}");
        assert!((section.angle_rad(section.at_m(turn)) - turn.rem_euclid(TAU)).abs() < 1e-9);
    }
    let section = form.section(0.7).grown(0.01);
    assert!(section.girth_m() > form.section(0.7).girth_m() + 0.055);
}

#[test]
fn what_is_no_body_or_no_line_is_said() {
    let body = person();
    let error = Form::of(&body, &Cut { places: 3, ..Cut::default() }).unwrap_err();
    assert_eq!(error.to_string(), "places is 3, must be 8 to 16384");
    let form = Form::of(&body, &Cut { sections: 64, places: 32, from: 0.27 }).unwrap();
    let lines = form.lines;
    let moved = form.clone().with_lines(Lines { waist_m: lines.waist_m + 0.02, ..lines }).unwrap();
    assert!((moved.lines.waist_m - lines.waist_m - 0.02).abs() < 1e-12);
    let error = form.clone().with_lines(Lines { waist_m: 1.9, ..lines }).unwrap_err();
    assert!(
        matches!(error, FormError::Line { line: "waist", .. })
            && error.to_string().contains("1.900 m is not on the form")
    );
    let error = form.clone().with_lines(Lines { hip_m: lines.bust_m, ..lines }).unwrap_err();
    assert!(matches!(error, FormError::Order { .. }), "{error}");
    // Nothing at the waist: two balls over one another.
    let (mut positions_m, mut triangles) = analytic_form::sphere(DVec3::ZERO, 0.3, 16);
    let count = positions_m.len() as u32;
    let above: Vec<DVec3> = positions_m.iter().map(|p| *p + DVec3::Y * 1.5).collect();
    positions_m.extend(above);
    triangles.extend(triangles.clone().iter().map(|corners| corners.map(|v| v + count)));
    let error = Form::of(&Body::new(&positions_m, &triangles).unwrap(), &Cut::default()).unwrap_err();
    assert!(error.to_string().contains("must stand upright along Y"), "{error}");
}

#[test]
fn sections_of_equal_places_are_equal_whatever_the_mesh() {
    let circle = |count: usize| {
        let (positions_m, triangles) = analytic_form::cylinder([0.0, 1.6], 0.2, count);
        Form::of(&Body::new(&positions_m, &triangles).unwrap(), &Cut { sections: 32, places: 64, from: 0.2 }).unwrap()
    };
    let (coarse, fine) = (circle(64), circle(512));
    for i in 0..64 {
        let turn = TAU * f64::from(i) / 64.0;
        let [a, b] = [&coarse, &fine].map(|form| form.section(0.8).at_m(turn));
        assert!(a.distance(b) < 1e-3 && (a.distance(DVec2::ZERO) - 0.2).abs() < 1e-3, "{a} {b}");
    }
}

/// From the form to the pattern: weft lengths as laid on, rest, seams, and what a tight skirt's pieces look like.
#[test]
fn a_tight_skirt_is_draped_and_its_pattern_read_off() {
    let form = Form::of(&person(), &Cut { sections: 200, places: 128, from: 0.2 }).unwrap().skirt();
    let (mesh_m, corners) = form.mesh(0.0);
    let body = Body::new(&mesh_m, &corners).unwrap();
    let design = Design { length_m: 0.45, cell_m: 0.015, ..Design::default() };
    let mut halves = laid_on(&form, &design, 0.002, 0.003).unwrap();
    let woven = Woven { thickness_m: 0.001, body_friction: 0.5, ..Woven::default() };
    let settings = Settings { clearance_m: 0.002, pressure_n_per_m2: 20.0, ..Settings::default() };
    let draping = Draping { body: &body, woven: &woven, settings, most_s: 6.0 };
    for half in &mut halves {
        assert!(half.arc_error_max < 1e-3, "{}: {}", half.name, half.arc_error_max);
        let certificate = half.relax(&draping).unwrap();
        assert!(certificate.is_certified(), "{certificate}");
        assert!(half.strain_mean < 0.01, "{}", half.strain_mean);
    }
    let pattern = pattern(&halves, 0.01).unwrap();
    assert_eq!((pattern.pieces.len(), pattern.seams.len()), (4, 8));
    for piece in &pattern.pieces {
        piece.check().unwrap();
    }
    for seam in &pattern.seams {
        assert!(pattern.unequal_m(*seam) < 5e-4, "{seam:?}");
    }
    // Round the hem and, darts closed, round the waist, the pieces are as long as the form with the cloth's clearance.
    let around_m = |names: &[&str]| -> f64 {
        let runs = pattern.pieces.iter().flat_map(|piece| &piece.runs);
        runs.filter(|run| names.contains(&run.name.as_str())).map(|run| run.length_m()).sum()
    };
    let girth_m = |height_m: f64| form.section(height_m).grown(0.002).girth_m();
    let hem_m = around_m(&["hem"]);
    assert!((hem_m / girth_m(form.lines.waist_m - 0.45) - 1.0).abs() < 0.01, "{hem_m}");
    let waist_m = around_m(&["waist 1", "waist 2"]);
    // Her waist is a third thinner than her hip: with one dart to a quarter, cloth shears between them.
    assert!((waist_m / girth_m(form.lines.waist_m) - 1.0).abs() < 0.07, "{waist_m}");
    assert!(hem_m - waist_m > 0.1, "a waist is thinner than a hip");

    // Cut, sewn and draped again.
    let worn = Draping { settings: Settings { pressure_n_per_m2: 0.0, ..settings }, ..draping };
    let redraped = redrape(&halves, &pattern, 0.02, 0.01, &worn).unwrap();
    assert!(redraped.least_rad.to_degrees() > 15.0, "{}", redraped.least_rad.to_degrees());
    let mean_m = redraped.from_first_m.iter().sum::<f64>() / redraped.from_first_m.len() as f64;
    assert!(mean_m < 0.006 && redraped.strain_mean < 0.015, "{mean_m} {}", redraped.strain_mean);
    let faults = [&redraped.certificate.self_crossings, &redraped.certificate.body_crossings];
    assert!(redraped.certificate.inside.is_empty() && faults.iter().all(|f| f.is_empty()), "{}", redraped.certificate);

    let short = Form::of(&person(), &Cut { sections: 64, places: 64, from: 0.45 }).unwrap().skirt();
    assert!(matches!(laid_on(&short, &design, 0.002, 0.001), Err(SkirtError::Form { .. })));
}

/// Darts that overlap and darts whose cloth is cut away, two to a quarter: both rest, nearly at the same places, and their patterns can be sewn.
#[test]
fn darts_overlap_or_are_removed_one_or_more_to_a_quarter() {
    let form = Form::of(&person(), &Cut { sections: 200, places: 128, from: 0.2 }).unwrap().skirt();
    let (mesh_m, corners) = form.mesh(0.0);
    let body = Body::new(&mesh_m, &corners).unwrap();
    let design = Design { length_m: 0.35, cell_m: 0.015, ..Design::default() };
    let woven = Woven { thickness_m: 0.001, body_friction: 0.5, ..Woven::default() };
    let settings = Settings { clearance_m: 0.002, pressure_n_per_m2: 20.0, ..Settings::default() };
    let draping = Draping { body: &body, woven: &woven, settings, most_s: 6.0 };
    for (design, darts) in [(design.clone(), 1), (design.clone().with_pairs(), 2)] {
        let [overlapping, removed] = [DartKind::Overlapping, DartKind::Removed].map(|kind| {
            let mut halves = laid_on(&form, &design.clone().with(kind), 0.002, 0.002).unwrap();
            for half in &mut halves {
                assert_eq!(half.mapping.darts.len(), darts);
                assert!(half.arc_error_max < 1e-3, "{kind:?} {darts} {}: {}", half.name, half.arc_error_max);
                let certificate = half.relax(&draping).unwrap();
                assert!(certificate.is_certified(), "{kind:?} {darts} {}: {certificate}", half.name);
                assert!(half.strain_mean < 0.02, "{kind:?} {darts} {}: {}", half.name, half.strain_mean);
            }
            let pattern = pattern(&halves, 0.01).unwrap();
            assert_eq!(pattern.seams.len(), 4 * darts + 4);
            pattern.pieces.iter().for_each(|piece| piece.check().unwrap());
            assert!(pattern.seams.iter().all(|seam| pattern.unequal_m(*seam) < 5e-4));
            assert!(sew(&pattern, 0.02, 0.0).is_ok());
            halves
        });
        for ((over, removed), amounts) in overlapping.iter().zip(&removed).zip(&design.darts) {
            let apart = apart_m(over, removed);
            let mean_m = apart.iter().sum::<f64>() / apart.len() as f64;
            assert!(apart.len() > 300 && mean_m < 0.003, "{darts} {}: {mean_m} of {}", over.name, apart.len());
            // What is removed is as wide at the waist as what overlaps.
            let waist_m = form.lines.waist_m;
            for (number, plan) in amounts.iter().enumerate() {
                let [taken, wanted] = [removed.mapping.taken_m(number, waist_m), over.mapping.darts[number].amount_m];
                assert!(
                    (taken - wanted).abs() < 1e-4 + 0.02 * wanted && plan.kind == DartKind::Overlapping,
                    "{taken} {wanted}"
                );
                assert_eq!(removed.mapping.taken_m(number, removed.mapping.darts[number].tip_m), 0.0);
            }
        }
    }
    let mut close = design.with_pairs();
    close.darts[1][1].at = close.darts[1][0].at + 0.02;
    let error = laid_on(&form, &close, 0.002, 0.002).unwrap_err();
    assert!(error.to_string().starts_with("dart 2 of the right back at 0.35 of the waist"), "{error}");
}

/// The papers' forces, with the same lines held, bring a half nearly where `drape` does: outside the form, clear of itself, its pins where they were.
#[test]
fn a_half_relaxed_by_forces_comes_near_where_it_is_draped() {
    let form = Form::of(&person(), &Cut { sections: 200, places: 128, from: 0.2 }).unwrap().skirt();
    let (mesh_m, corners) = form.mesh(0.0);
    let body = Body::new(&mesh_m, &corners).unwrap();
    let (farther_m, farther_corners) = form.mesh(0.001);
    let maps = DepthMaps::new(&farther_m, &farther_corners, 0.002).unwrap();
    let design = Design { length_m: 0.35, cell_m: 0.015, ..Design::default() };
    let woven = Woven { thickness_m: 0.001, body_friction: 0.5, ..Woven::default() };
    let settings = Settings { clearance_m: 0.002, pressure_n_per_m2: 20.0, ..Settings::default() };
    let mut half = laid_on(&form, &design, 0.002, 0.002).unwrap().into_iter().next().unwrap();
    half.relax(&Draping { body: &body, woven: &woven, settings, most_s: 6.0 }).unwrap();
    let fabric = Fabric { mass_kg_per_m2: woven.mass_kg_per_m2, thickness_m: 0.001, ..Fabric::default() };
    let settings = relax::Settings {
        gravity_step_m: 0.0003,
        body_friction: 0.5,
        pressure_n_per_m2: 0.5,
        ..relax::Settings::default()
    };
    let relaxing = Relaxing {
        form: &maps,
        body: &body,
        fabric: &fabric,
        settings: &settings,
        residual_weights: 0.05,
        most_steps: 3000,
    };
    let relaxed = by_forces(&half, &relaxing).unwrap();
    assert_eq!(relaxed.places_m.len(), half.rests_m.len());
    let (apart_m, count) = (&relaxed.from_drape_m, relaxed.from_drape_m.len());
    let (mean_m, p95_m) = (apart_m.iter().sum::<f64>() / count as f64, apart_m[count * 95 / 100]);
    assert!((1e-5..0.003).contains(&mean_m) && p95_m < 0.008, "{mean_m} {p95_m}");
    assert!(relaxed.strain_mean < 0.01, "{}", relaxed.strain_mean);
    assert!(relaxed.certificate.is_certified(), "{}", relaxed.certificate);
    // Where lines hold it, both have it in one place.
    assert!(apart_m[count / 20] < 1e-9, "{}", apart_m[count / 20]);
    let settings = relax::Settings { pressure_n_per_m2: -1.0, ..settings.clone() };
    let error = by_forces(&half, &Relaxing { settings: &settings, ..relaxing }).unwrap_err();
    assert_eq!(error.to_string(), "pressure_n_per_m2 is -1, must be finite and at least 0");
    let thick = Fabric { thickness_m: 0.01, ..fabric.clone() };
    let error = by_forces(&half, &Relaxing { fabric: &thick, ..relaxing }).unwrap_err();
    assert!(error.to_string().starts_with("the cloth is 0.01 m thick"), "{error}");
}
