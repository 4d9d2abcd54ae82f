//! Sheets that come to rest, against what can be worked out by hand.

use glam::{DVec2, DVec3};
use kitsuke_drape::analytic_form;
use kitsuke_drape::depth_maps::DepthMaps;
use kitsuke_drape::fabric::Fabric;
use kitsuke_drape::forces::{GRAVITY_M_PER_S2, particle_weight_n};
use kitsuke_drape::relax::{self, Settings, State, step, to_rest};
use kitsuke_drape::sheet::{Attachment, Grid, PatternMesh, Sheet};

/// A level sheet about the axis of Y.
fn level(particles: usize, side_m: f64, height_m: f64) -> Grid {
    let corner_m = DVec3::new(-0.5 * side_m, height_m, 0.5 * side_m);
    let spacing_m = side_m / (particles - 1) as f64;
    Grid { rows: particles, columns: particles, spacing_m, corner_m, weft: DVec3::X, warp: DVec3::NEG_Z }
}

/// A body of one square, 2 m wide, through the origin, sloped about Z.
fn slope(slope_rad: f64) -> DepthMaps {
    let along = DVec3::new(libm::cos(slope_rad), libm::sin(slope_rad), 0.0);
    let mut corners = vec![along - DVec3::Z, along + DVec3::Z, -along + DVec3::Z, -along - DVec3::Z];
    // A floor below, so that front and back see a body.
    for i in 0..4 {
        corners.push(corners[i] - DVec3::Y * 2.0);
    }
    let sides = [[0, 1, 2], [0, 2, 3], [4, 6, 5], [4, 7, 6], [1, 2, 6], [1, 6, 5], [3, 0, 4], [3, 4, 7]];
    DepthMaps::new(&corners, &sides, 0.01).unwrap()
}

#[test]
fn the_same_bytes_on_one_thread_and_on_two() {
    let (positions_m, triangles) = analytic_form::sphere(DVec3::ZERO, 0.2, 48);
    let body = DepthMaps::new(&positions_m, &triangles, 0.005).unwrap();
    // Large enough that every loop is divided among threads.
    let sheet = Sheet::from_grid(&level(60, 0.8, 0.205)).unwrap();
    let after = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| {
            let fabric = Fabric::default();
            let mut state = State::new(&sheet, &fabric).unwrap();
            let settings = Settings { gravity_step_m: 0.0003, ..Settings::default() };
            for _ in 0..400 {
                step(&sheet, &fabric, Some(&body), &settings, &mut state);
            }
            state.positions_m.iter().flat_map(|place| place.to_array().map(f64::to_bits)).collect::<Vec<u64>>()
        })
    };
    let (one, two) = (after(1), after(2));
    assert!(one == two);
    let first = sheet.positions_m()[0];
    assert!(f64::from_bits(one[1]) < first.y - 0.01, "the corner has fallen");
}

#[test]
fn flat_cloth_falls_by_its_weight_alone() {
    let sheet = Sheet::from_grid(&level(5, 0.4, 1.0)).unwrap();
    let fabric = Fabric::default();
    let mut state = State::new(&sheet, &fabric).unwrap();
    let farthest_m = step(&sheet, &fabric, None, &Settings::default(), &mut state);
    assert!((farthest_m - 0.001).abs() < 1e-12);
    for (now, then) in state.positions_m.iter().zip(sheet.positions_m()) {
        assert!((*now - (*then - DVec3::Y * 0.001)).length() < 1e-12);
    }
}

/// A cloth that hangs bears its weight in its upper edges: per width `mass g height = K strain²`.
#[test]
fn a_hanging_sheet_stretches_by_the_constant_of_its_grain() {
    let fabric = Fabric::default();
    for (weft, warp, per_width_n_per_m) in
        [(DVec3::X, DVec3::NEG_Y, fabric.warp_n_per_m), (DVec3::NEG_Y, DVec3::X, fabric.weft_n_per_m)]
    {
        let grid = Grid { rows: 9, columns: 9, spacing_m: 0.04, corner_m: DVec3::ZERO, weft, warp };
        let mut sheet = Sheet::from_grid(&grid).unwrap();
        for particle in 0..81u32 {
            let place_m = sheet.positions_m()[particle as usize];
            if place_m.y == 0.0 {
                sheet.pin(particle, place_m).unwrap();
            }
        }
        let mut state = State::new(&sheet, &fabric).unwrap();
        let rested = to_rest(&sheet, &fabric, None, &Settings::default(), 0.02, 60_000, &mut state);
        assert!(rested.is_at_rest, "{rested:?}");
        // Below the highest row hang 7.5 of 8 rows of squares; gravity has the weight of 8 of 9 rows of particles there.
        let load_n_per_m = fabric.mass_kg_per_m2 * GRAVITY_M_PER_S2 * 0.32 * 8.0 / 9.0;
        let wanted = (load_n_per_m / per_width_n_per_m).sqrt();
        let (mut strains, mut edges) = (0.0, 0.0);
        for edge in sheet.edges() {
            let [a, b] = edge.ends.map(|end| end as usize);
            let [from_m, to_m] = [a, b].map(|end| sheet.positions_m()[end]);
            if from_m.x == to_m.x && from_m.y.max(to_m.y) == 0.0 {
                strains += (state.positions_m[a] - state.positions_m[b]).length() / edge.rest_m - 1.0;
                edges += 1.0;
            }
        }
        assert!((strains / edges / wanted - 1.0).abs() < 0.1, "{} wanted {wanted}", strains / edges);
    }
}

#[test]
fn attachments_bear_the_weight_and_threads_draw_together() {
    let mut sheet = Sheet::from_grid(&level(5, 0.4, 1.0)).unwrap();
    let attachments: Vec<Attachment> = (0..25)
        .map(|particle| Attachment {
            particle,
            place_m: sheet.positions_m()[particle as usize],
            stiffness_n_per_m: 2.0,
        })
        .collect();
    sheet.attach(&attachments).unwrap();
    let fabric = Fabric::default();
    let mut state = State::new(&sheet, &fabric).unwrap();
    let settings = Settings::default();
    assert!(to_rest(&sheet, &fabric, None, &settings, 1e-6, 20_000, &mut state).is_at_rest);
    let sunk_m = particle_weight_n(fabric.mass_kg_per_m2, 0.16, 25) / 2.0;
    assert!(state.positions_m.iter().all(|place| (1.0 - place.y - sunk_m).abs() < 1e-5), "{sunk_m}");

    // Two opposite edges, sewn together, make a tube.
    sheet.attach(&[]).unwrap();
    let pairs: Vec<[u32; 2]> = (0..5).map(|row| [5 * row, 5 * row + 4]).collect();
    sheet.sew(&pairs).unwrap();
    for row in 0..5 {
        sheet.pin(5 * row + 2, sheet.positions_m()[5 * row as usize + 2]).unwrap();
    }
    for _ in 0..3000 {
        step(&sheet, &fabric, None, &settings, &mut state);
    }
    let gap_m =
        |state: &State, [a, b]: [u32; 2]| (state.positions_m[a as usize] - state.positions_m[b as usize]).length();
    assert!(pairs.iter().all(|&pair| gap_m(&state, pair) < 0.02), "{}", gap_m(&state, pairs[0]));
}

/// Coulomb: cloth holds on a slope whose tangent is below the coefficient, and slides on a steeper one.
#[test]
fn friction_holds_on_a_slope_up_to_its_angle() {
    let fabric = Fabric { thickness_m: 0.001, ..Fabric::default() };
    let body = slope(0.35);
    let along = DVec3::new(libm::cos(0.35), libm::sin(0.35), 0.0);
    let grid =
        Grid { rows: 5, columns: 5, spacing_m: 0.05, corner_m: DVec3::Y * 0.002, weft: along, warp: DVec3::NEG_Z };
    let sheet = Sheet::from_grid(&grid).unwrap();
    let slid_m = |friction: f64| {
        let mut state = State::new(&sheet, &fabric).unwrap();
        let settings = Settings { body_friction: friction, ..Settings::default() };
        for _ in 0..200 {
            step(&sheet, &fabric, Some(&body), &settings, &mut state);
        }
        (sheet.positions_m()[12] - state.positions_m[12]).dot(along)
    };
    let tangent = libm::tan(0.35);
    assert!(slid_m(tangent * 1.05).abs() < 0.003, "{}", slid_m(tangent * 1.05));
    // 200 steps of gravity along the slope, less what friction takes.
    let wanted_m = 0.2 * (libm::sin(0.35) - 0.5 * tangent * libm::cos(0.35));
    assert!((slid_m(tangent * 0.5) / wanted_m - 1.0).abs() < 0.1, "{} wanted {wanted_m}", slid_m(tangent * 0.5));
}

#[test]
fn cloth_lies_on_the_dress_form_and_not_in_it() {
    let (positions_m, triangles) = analytic_form::dress_form(96);
    let body = DepthMaps::new(&positions_m, &triangles, 0.005).unwrap();
    let sheet = Sheet::from_grid(&level(22, 0.8, 1.52)).unwrap();
    let fabric = Fabric::default();
    let mut state = State::new(&sheet, &fabric).unwrap();
    to_rest(&sheet, &fabric, Some(&body), &Settings::default(), 0.05, 6000, &mut state);
    let (mut on_form, mut lowest_m) = (0, f64::INFINITY);
    for &place in &state.positions_m {
        lowest_m = place.y.min(lowest_m);
        let Some([width_m, depth_m]) = analytic_form::dress_form_radii_m(place.y) else { continue };
        let level = ((place.x / width_m).powi(2) + (place.z / depth_m).powi(2)).sqrt();
        assert!((1.0 - level) * width_m.min(depth_m) < 0.001, "{place}");
        on_form += usize::from((level - 1.0) * width_m.min(depth_m) < 0.01);
    }
    assert!(on_form > 30 && lowest_m < 1.2, "{on_form} {lowest_m}");
}

/// Two level sheets in one, the second 2 cm above the first and turned, dropped on the ground.
#[test]
fn cloth_lies_on_cloth() {
    let lower = Sheet::from_grid(&level(12, 0.33, 0.01)).unwrap();
    let upper = Sheet::from_grid(&level(9, 0.2, 0.03)).unwrap();
    let first = lower.positions_m().len() as u32;
    let positions_m = [lower.positions_m(), upper.positions_m()].concat();
    let mut triangles = lower.triangles().to_vec();
    triangles.extend(upper.triangles().iter().map(|corners| corners.map(|corner| corner + first)));
    let uv = |particle: u32| DVec2::new(positions_m[particle as usize].x, positions_m[particle as usize].z);
    let corners_uv: Vec<[DVec2; 3]> = triangles.iter().map(|corners| corners.map(uv)).collect();
    let mesh = PatternMesh {
        positions_m: &positions_m,
        triangles: &triangles,
        corners_uv: &corners_uv,
        metres_per_uv: 1.0,
        welds: &[],
    };
    let sheet = Sheet::from_pattern(&mesh).unwrap();
    let (ground, fabric) = (slope(0.0), Fabric::default());
    for cloth_contacts in [true, false] {
        let settings = Settings { cloth_contacts, ..Settings::default() };
        let mut state = State::new(&sheet, &fabric).unwrap();
        for _ in 0..300 {
            step(&sheet, &fabric, Some(&ground), &settings, &mut state);
        }
        let (below, above) = state.positions_m.split_at(first as usize);
        assert!(below.iter().all(|place| (place.y - fabric.thickness_m).abs() < 0.002), "{cloth_contacts}");
        let wanted_m = if cloth_contacts { 2.0 } else { 1.0 } * fabric.thickness_m;
        assert!(above.iter().all(|place| (place.y - wanted_m).abs() < 0.002), "{cloth_contacts} {}", above[40]);
    }
}

/// Coulomb with a pressure of `p` weights: on a slope of `a` cloth goes by `sin a - friction (cos a + p)` of a step. What is farther than 2 cm from the
/// body is not pressed.
#[test]
fn a_weak_pressure_holds_cloth_on_a_body() {
    let fabric = Fabric { thickness_m: 0.001, ..Fabric::default() };
    let weight_n_per_m2 = fabric.mass_kg_per_m2 * GRAVITY_M_PER_S2;
    let body = slope(0.35);
    let along = DVec3::new(libm::cos(0.35), libm::sin(0.35), 0.0);
    let fell_m = |above_m: f64, weights: f64, steps: usize| {
        let corner_m = DVec3::Y * above_m;
        let grid = Grid { rows: 5, columns: 5, spacing_m: 0.05, corner_m, weft: along, warp: DVec3::NEG_Z };
        let sheet = Sheet::from_grid(&grid).unwrap();
        let mut state = State::new(&sheet, &fabric).unwrap();
        let pressure_n_per_m2 = weights * weight_n_per_m2;
        let settings =
            Settings { gravity_step_m: 0.0003, body_friction: 0.3, pressure_n_per_m2, ..Settings::default() };
        for _ in 0..steps {
            step(&sheet, &fabric, Some(&body), &settings, &mut state);
        }
        sheet.positions_m()[12] - state.positions_m[12]
    };
    for weights in [0.0, 0.05, 0.1, 0.15] {
        let slid_m = (fell_m(0.002, weights, 600) - fell_m(0.002, weights, 100)).dot(along);
        let wanted_m = 500.0 * 0.0003 * (libm::sin(0.35) - 0.3 * (libm::cos(0.35) + weights));
        assert!((slid_m - wanted_m).abs() < 1e-4, "{weights}: {slid_m} wanted {wanted_m}");
    }
    let slid_m = (fell_m(0.002, 0.25, 600) - fell_m(0.002, 0.25, 100)).dot(along);
    assert!(slid_m.abs() < 1e-6, "{slid_m}");
    assert_eq!(fell_m(0.05, 0.1, 1), fell_m(0.05, 0.0, 1));
    assert!(fell_m(0.01, 0.1, 1).y > fell_m(0.01, 0.0, 1).y + 2e-5);
}

#[test]
fn constants_out_of_their_range_are_named() {
    let sheet = Sheet::from_grid(&level(5, 0.5, 1.0)).unwrap();
    let error = |fabric: Fabric| State::new(&sheet, &fabric).unwrap_err().to_string();
    let negative = Fabric { weft_n_per_m: -1.0, ..Fabric::default() };
    assert_eq!(error(negative), "weft_n_per_m is -1, must be finite and at least 0");
    assert_eq!(error(Fabric { compression: 1.5, ..Fabric::default() }), "compression is 1.5, must be from 0 to 1");
    assert_eq!(
        error(Fabric { thickness_m: 0.0625, ..Fabric::default() }),
        "the cloth is 0.0625 m thick, must be below half of its shortest edge of 0.125 m"
    );
    assert!(relax::check(&Settings::default()).is_ok());
    for bad in [
        Settings { gravity_step_m: 0.0, ..Settings::default() },
        Settings { limit_weights: 0.5, ..Settings::default() },
        Settings { instead_weights: 9.0, ..Settings::default() },
        Settings { body_friction: f64::NAN, ..Settings::default() },
        Settings { pressure_n_per_m2: -1.0, ..Settings::default() },
    ] {
        assert!(relax::check(&bad).is_err(), "{bad:?}");
    }
}
