//! The production solver: what it must do of itself, against formulas, and whatever is done to it.

use glam::DVec3;
use kitsuke_drape::analytic_form;
use kitsuke_drape::body::Body;
use kitsuke_drape::certificate::Bounds;
use kitsuke_drape::drape::{Drape, Obstacle, Settings, State, strain};
use kitsuke_drape::intersections::self_intersections;
use kitsuke_drape::near_pairs::NearPairs;
use kitsuke_drape::repair;
use kitsuke_drape::room::{Room, Side};
use kitsuke_drape::sheet::{Attachment, Grid, PatternMesh, Sheet};
use kitsuke_drape::woven::{PRESETS, Woven};

fn flat(side: usize, spacing_m: f64, height_m: f64) -> Sheet {
    let half_m = 0.5 * spacing_m * (side - 1) as f64;
    let corner_m = DVec3::new(-half_m, height_m, half_m);
    let grid = Grid { rows: side, columns: side, spacing_m, corner_m, weft: DVec3::X, warp: DVec3::NEG_Z };
    Sheet::from_grid(&grid).unwrap()
}

fn ball(radius_m: f64) -> Body {
    let (positions_m, triangles) = analytic_form::sphere(DVec3::ZERO, radius_m, 48);
    Body::new(&positions_m, &triangles).unwrap()
}

fn bits(state: &State) -> Vec<u64> {
    let all = state.positions_m.iter().chain(&state.velocities_m_per_s);
    all.flat_map(|v| v.to_array()).map(f64::to_bits).collect()
}

/// Numbers in -1..1, the same every time.
fn numbers(seed: u64) -> impl FnMut() -> f64 {
    let mut state = seed;
    move || {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 11) as f64 / (1u64 << 52) as f64 - 1.0
    }
}

/// A strip held at one end hangs at Peirce's angle: where it reaches out twice the bending length c = (B / weight)^(1/3), its end lies
/// 41.5° below (Peirce, The Handle of Cloth as a Measurable Quantity, 1930). Ours hangs up to 8° lower: a net of triangles also folds along
/// its diagonals, as if its bending were 0.8 of what is said.
#[test]
fn a_cantilever_hangs_as_its_bending_says() {
    for (bending_nm, is_warp) in [(2e-5, true), (1e-4, true), (5e-5, false)] {
        let woven = Woven { warp_bending_nm: bending_nm, weft_bending_nm: bending_nm, ..Woven::default() };
        let weight = woven.mass_kg_per_m2 * 9.81;
        let length_m = 2.0 * (bending_nm / weight).cbrt();
        let (cells, held, wide) = (16, 3, 7);
        let spacing_m = length_m / cells as f64;
        let long = cells + held;
        let (rows, columns) = if is_warp { (long, wide) } else { (wide, long) };
        let grid = Grid { rows, columns, spacing_m, corner_m: DVec3::ZERO, weft: DVec3::X, warp: DVec3::NEG_Z };
        let mut sheet = Sheet::from_grid(&grid).unwrap();
        let along = |particle: usize| if is_warp { particle / columns } else { particle % columns };
        for particle in (0..rows * columns).filter(|&particle| along(particle) < held) {
            let at_m = sheet.positions_m()[particle];
            sheet.pin(particle as u32, at_m).unwrap();
        }
        let settings = Settings { drag_per_s: 10.0, parts: 40, ..Settings::default() };
        let mut drape = Drape::new(&sheet, &woven, &settings).unwrap();
        let mut state = drape.state(&sheet);
        for _ in 0..1000 {
            drape.step(None, &mut state);
        }
        let middle = if is_warp { (rows - 1) * columns + wide / 2 } else { (wide / 2) * columns + columns - 1 };
        let from = if is_warp { (held - 1) * columns + wide / 2 } else { (wide / 2) * columns + held - 1 };
        let way = state.positions_m[middle] - state.positions_m[from];
        let out_m = if is_warp { -way.z } else { way.x };
        let angle = libm::atan2(-way.y, out_m).to_degrees();
        assert!((40.0..50.0).contains(&angle), "{bending_nm} {is_warp}: {angle}");
    }
}

/// A strip on a cylinder has the energy of its curvature, whatever the mesh: half of bending times area over the squared radius.
#[test]
fn creases_hold_the_energy_of_a_cylinder() {
    let woven = Woven { warp_bending_nm: 3e-5, weft_bending_nm: 3e-5, ..Woven::default() };
    let sheet = flat(31, 0.01, 0.0);
    let radius_m = 0.2;
    let rolled: Vec<DVec3> = sheet
        .positions_m()
        .iter()
        .map(|p| DVec3::new(radius_m * libm::sin(p.x / radius_m), radius_m * libm::cos(p.x / radius_m), p.z))
        .collect();
    let mut energy = 0.0;
    for crease in kitsuke_drape::links::creases(&sheet, &woven) {
        let curved: DVec3 = (0..4).map(|i| rolled[crease.corners[i] as usize] * crease.factors[i]).sum();
        energy += 0.5 * curved.length_squared() / crease.compliance_m_per_n;
    }
    let expected = 0.5 * 3e-5 * sheet.area_m2() / (radius_m * radius_m);
    assert!((energy / expected - 1.0).abs() < 0.08, "{energy} {expected}");
}

#[test]
fn cloth_hangs_with_little_stretch_and_comes_to_certified_rest() {
    let mut sheet = flat(30, 0.015, 1.0);
    for particle in 0..30 {
        let at_m = sheet.positions_m()[particle];
        sheet.pin(particle as u32, at_m).unwrap();
    }
    let mut drape =
        Drape::new(&sheet, &Woven::default(), &Settings { drag_per_s: 8.0, ..Settings::default() }).unwrap();
    let mut state = drape.state(&sheet);
    for _ in 0..2000 {
        drape.step(None, &mut state);
    }
    let (mean, most) = strain(&sheet, &state.positions_m);
    assert!(mean < 0.003 && most < 0.02, "{mean} {most}");
    let certificate = drape.certify(None, Bounds::default(), &state);
    assert!(certificate.is_certified(), "{certificate}");
    // It hangs straight down below its row.
    let lowest = state.positions_m[29 * 30 + 15];
    assert!((lowest.y - (1.0 - 29.0 * 0.015)).abs() < 0.01 && (lowest.z - 0.2175).abs() < 0.03, "{lowest}");
}

#[test]
fn a_sheet_falls_over_a_ball_and_nothing_passes_through() {
    let sheet = flat(30, 0.015, 0.12);
    let body = ball(0.1);
    let at = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        let mut drape = Drape::new(&sheet, &Woven::default(), &Settings::default()).unwrap();
        let mut state = drape.state(&sheet);
        pool.install(|| {
            for _ in 0..400 {
                drape.step(Some(Obstacle { body: &body, moves_m: None }), &mut state);
            }
        });
        (drape, state)
    };
    let (drape, state) = at(1);
    assert!(bits(&state) == bits(&at(2).1), "threads change no bit");
    let certificate = drape.certify(Some(&body), Bounds { fastest_m_per_s: 10.0 }, &state);
    assert!(certificate.is_certified(), "{certificate}");
    assert!(state.positions_m.iter().any(|p| p.y < 0.0) && state.positions_m.iter().any(|p| p.y > 0.1));
}

#[test]
fn a_saved_state_goes_on_with_the_same_bytes() {
    let sheet = flat(20, 0.015, 0.12);
    let body = ball(0.1);
    let obstacle = Some(Obstacle { body: &body, moves_m: None });
    let mut drape = Drape::new(&sheet, &Woven::default(), &Settings::default()).unwrap();
    let mut state = drape.state(&sheet);
    let mut saved = None;
    for step in 0..200 {
        if step == 77 {
            saved = Some(state.clone());
        }
        drape.step(obstacle, &mut state);
    }
    let mut other = Drape::new(&sheet, &Woven::default(), &Settings::default()).unwrap();
    let mut resumed = saved.unwrap();
    for _ in 77..200 {
        other.step(obstacle, &mut resumed);
    }
    assert!(bits(&state) == bits(&resumed));
}

/// Whatever is done to it: cloth that was clear of itself stays so.
#[test]
fn shaken_cloth_stays_clear_of_itself() {
    for seed in 0..2 {
        let mut sheet = flat(16, 0.012, 0.5);
        for particle in [0_u32, 15, 120, 255] {
            let at_m = sheet.positions_m()[particle as usize];
            sheet.pin(particle, at_m).unwrap();
        }
        let mut number = numbers(seed);
        let mut drape = Drape::new(&sheet, &Woven::default(), &Settings::default()).unwrap();
        let mut state = drape.state(&sheet);
        for _ in 0..12 {
            let to =
                [0, 15, 120, 255].map(|pin| (pin, DVec3::new(number(), number(), number()) * 0.08 + DVec3::Y * 0.5));
            for _ in 0..15 {
                for (pin, to_m) in to {
                    // At most 2 m/s: pins are told where to be and are not bound.
                    let way = to_m - state.positions_m[pin];
                    drape.move_pin(pin, state.positions_m[pin] + way.clamp_length_max(2.0 / 600.0));
                }
                drape.step(None, &mut state);
            }
            assert!(state.positions_m.iter().all(|p| p.is_finite()));
            let crossings = self_intersections(&state.positions_m, sheet.triangles());
            assert!(crossings.is_empty(), "seed {seed}: {crossings:?}");
        }
    }
}

/// Near pairs against all pairs.
#[test]
fn all_that_is_near_is_found() {
    let sheet = flat(9, 0.01, 0.0);
    let mut number = numbers(3);
    let positions_m: Vec<DVec3> =
        sheet.positions_m().iter().map(|p| *p * 0.3 + DVec3::new(number(), number(), number()) * 0.01).collect();
    let reach_m = 0.004;
    let found = NearPairs::new(sheet.positions_m(), sheet.triangles()).find(&positions_m, reach_m, reach_m);
    // Distances of places sampled on all pairs of triangles that share no vertex are no less than what was found for their corners.
    let mut least = vec![f64::INFINITY; positions_m.len()];
    for pair in &found.pairs {
        let way: DVec3 = (0..4).map(|i| positions_m[pair.corners[i] as usize] * pair.weights[i]).sum();
        assert!((way - pair.normal * pair.distance_m).length() < 1e-12);
        assert!((pair.weights.iter().sum::<f64>()).abs() < 1e-12);
        pair.corners.iter().for_each(|&v| least[v as usize] = least[v as usize].min(pair.distance_m));
    }
    let samples: Vec<DVec3> = (0..=6)
        .flat_map(|i| (0..=6 - i).map(move |j| DVec3::new(f64::from(i), f64::from(j), f64::from(6 - i - j)) / 6.0))
        .collect();
    for (i, first) in sheet.triangles().iter().enumerate() {
        for second in &sheet.triangles()[i + 1..] {
            if first.iter().any(|v| second.contains(v)) {
                continue;
            }
            let place = |corners: &[u32; 3], shares: &DVec3| -> DVec3 {
                (0..3).map(|k| positions_m[corners[k] as usize] * shares[k]).sum()
            };
            let mut nearest = f64::INFINITY;
            for a in &samples {
                for b in &samples {
                    nearest = nearest.min(place(first, a).distance(place(second, b)));
                }
            }
            let claimed = first.iter().chain(second).map(|&v| least[v as usize]).fold(f64::INFINITY, f64::min);
            assert!(nearest >= reach_m || claimed <= nearest + 1e-12, "{first:?} {second:?}: {nearest} {claimed}");
        }
    }
    // Of two that are near, one at least stands so near its plane.
    for pair in &found.pairs {
        let slack_m = |side: &Side| pair.corners.contains(&side.particle).then_some(side.slack_m);
        let nearest_m = found.sides.iter().filter_map(slack_m).fold(f64::INFINITY, f64::min);
        assert!(nearest_m <= 0.45 * pair.distance_m * (pair.distance_m / 5e-4).min(1.0) + 1e-12);
    }
}

/// Whatever places are asked for: those in the room are clear.
#[test]
fn cloth_in_its_room_stays_clear() {
    let rows = 12;
    let sheet = flat(rows, 0.01, 0.0);
    let both: Vec<[u32; 3]> =
        (0..2).flat_map(|i| sheet.triangles().iter().map(move |t| t.map(|v| v + 144 * i))).collect();
    let mut number = numbers(5);
    let mut at_m: Vec<DVec3> = sheet.positions_m().to_vec();
    at_m.extend(sheet.positions_m().iter().map(|p| *p + DVec3::new(0.003, 0.0012, 0.004)));
    for place_m in &mut at_m {
        place_m.y += 0.004 * libm::sin(60.0 * place_m.x) + 0.0002 * number();
    }
    let mut near_pairs = NearPairs::new(&at_m, &both);
    for round in 0..20 {
        assert!(self_intersections(&at_m, &both).is_empty(), "{round}");
        let found = near_pairs.find(&at_m, 0.004, 0.002);
        let room = Room::new(&at_m, found.farthest_m, &found.sides);
        let asked_m: Vec<DVec3> = at_m.iter().map(|p| *p + DVec3::new(number(), number(), number()) * 0.003).collect();
        assert!(!self_intersections(&asked_m, &both).is_empty());
        for (v, asked_m) in asked_m.into_iter().enumerate() {
            at_m[v] = room.instead_m(v, asked_m).unwrap_or(asked_m);
        }
    }
}

/// A large sheet that falls from the horizontal and swings about its row without any drag gains no energy.
#[test]
fn what_swings_freely_does_not_go_faster_than_it_fell() {
    let mut sheet = flat(118, 0.015, 2.0);
    for particle in 0..118 {
        let at_m = sheet.positions_m()[particle];
        sheet.pin(particle as u32, at_m).unwrap();
    }
    let settings = Settings { drag_per_s: 0.0, meets_itself: false, ..Settings::default() };
    let mut drape = Drape::new(&sheet, &Woven::default(), &settings).unwrap();
    let mut state = drape.state(&sheet);
    let fallen_m = 2.0 * 1.755;
    for _ in 0..480 {
        let stepped = drape.step(None, &mut state);
        assert!(stepped.speed_m_per_s * stepped.speed_m_per_s < 2.0 * 9.81 * fallen_m, "{stepped:?}");
    }
    assert!(strain(&sheet, &state.positions_m).0 < 0.03);
}

#[test]
fn presets_are_in_range_and_errors_name_the_constant() {
    for (name, woven) in PRESETS {
        woven.check().unwrap();
        assert_eq!(Woven::preset(name), Some(woven));
    }
    let sheet = flat(3, 0.01, 0.0);
    let bad = Woven { shear_n_per_m: 0.0, ..Woven::default() };
    let error = Drape::new(&sheet, &bad, &Settings::default()).unwrap_err();
    assert_eq!(error.to_string(), "shear_n_per_m is 0, must be finite and above 0");
    let error = Drape::new(&sheet, &Woven::default(), &Settings { parts: 0, ..Settings::default() }).unwrap_err();
    assert_eq!(error.to_string(), "parts is 0, must be finite and above 0");
}

#[test]
fn a_tuck_that_meets_itself_comes_clear_and_layers_that_do_not_are_said() {
    let sheet = flat(20, 0.015, 0.0);
    // A crease in the middle whose crest is pushed through the cloth beside it.
    let mut tucked: Vec<DVec3> = sheet.positions_m().to_vec();
    for v in [10 * 20 + 9, 10 * 20 + 10, 11 * 20 + 9] {
        tucked[v] += DVec3::new(0.025, 0.0, 0.02);
        tucked[v].y = if v == 210 { 0.004 } else { -0.003 };
    }
    assert!(!self_intersections(&tucked, sheet.triangles()).is_empty());
    let repaired = repair::clear(&mut tucked, sheet.triangles());
    assert!(repaired.left.is_empty() && !repaired.moved.is_empty(), "{repaired:?}");
    assert!(self_intersections(&tucked, sheet.triangles()).is_empty());
    assert!(repaired.farthest_m < 0.04 && repaired.moved.len() < 60, "{repaired:?}");

    // Two sheets through each other: no smoothing takes them apart.
    let mut crossed: Vec<DVec3> = sheet.positions_m().to_vec();
    crossed.extend(sheet.positions_m().iter().map(|p| DVec3::new(p.x, p.z, 0.003)));
    let both: Vec<[u32; 3]> =
        (0..2).flat_map(|i| sheet.triangles().iter().map(move |t| t.map(|v| v + 400 * i))).collect();
    let repaired = repair::clear(&mut crossed, &both);
    assert!(!repaired.left.is_empty());
}

#[test]
fn cloth_follows_a_body_that_moves() {
    let sheet = flat(24, 0.015, 0.11);
    let (start_m, triangles) = analytic_form::sphere(DVec3::ZERO, 0.1, 48);
    let mut body = Body::new(&start_m, &triangles).unwrap();
    let mut drape =
        Drape::new(&sheet, &Woven { body_friction: 0.8, ..Woven::default() }, &Settings::default()).unwrap();
    let mut state = drape.state(&sheet);
    for _ in 0..300 {
        drape.step(Some(Obstacle { body: &body, moves_m: None }), &mut state);
    }
    // 30 cm to the side at 0.3 m/s: friction takes the cloth along.
    let move_m = DVec3::X * (0.3 / 600.0);
    let moves_m = vec![move_m; start_m.len()];
    for step in 0..600 {
        let moved: Vec<DVec3> = start_m.iter().map(|p| *p + move_m * f64::from(step + 1)).collect();
        body.moved(&moved).unwrap();
        drape.step(Some(Obstacle { body: &body, moves_m: Some(&moves_m) }), &mut state);
    }
    let middle = state.positions_m.iter().sum::<DVec3>() / state.positions_m.len() as f64;
    assert!((middle.x - 0.3).abs() < 0.03, "{middle}");
    let certificate = drape.certify(Some(&body), Bounds { fastest_m_per_s: 10.0 }, &state);
    assert!(certificate.is_certified(), "{certificate}");
}

#[test]
fn cloth_that_starts_in_a_body_comes_out() {
    let sheet = flat(20, 0.015, 0.09);
    let body = ball(0.1);
    assert!(sheet.positions_m().iter().any(|p| body.contains(*p)));
    let mut drape =
        Drape::new(&sheet, &Woven::default(), &Settings { drag_per_s: 10.0, ..Settings::default() }).unwrap();
    let mut state = drape.state(&sheet);
    for _ in 0..1500 {
        drape.step(Some(Obstacle { body: &body, moves_m: None }), &mut state);
    }
    let certificate = drape.certify(Some(&body), Bounds::default(), &state);
    assert!(certificate.inside.is_empty() && certificate.body_crossings.is_empty(), "{certificate}");
}

/// Two panels side by side are sewn along the sides that face each other; a spring carries one particle's weight as it says.
#[test]
fn threads_sew_and_attachments_carry() {
    let panel = flat(10, 0.02, 0.0);
    let shifted = |by: DVec3| panel.positions_m().iter().map(move |p| *p + by).collect::<Vec<_>>();
    let positions_m = [shifted(DVec3::X * -0.13), shifted(DVec3::X * 0.13)].concat();
    let triangles: Vec<[u32; 3]> =
        (0..2).flat_map(|i| panel.triangles().iter().map(move |t| t.map(|v| v + 100 * i))).collect();
    let corners_uv: Vec<[glam::DVec2; 3]> =
        triangles.iter().map(|t| t.map(|v| positions_m[v as usize]).map(|p| glam::DVec2::new(p.x, -p.z))).collect();
    let mesh = PatternMesh {
        positions_m: &positions_m,
        triangles: &triangles,
        corners_uv: &corners_uv,
        metres_per_uv: 1.0,
        welds: &[],
    };
    let mut sheet = Sheet::from_pattern(&mesh).unwrap();
    let pairs: Vec<[u32; 2]> = (0..10).map(|row| [10 * row + 9, 100 + 10 * row]).collect();
    sheet.sew(&pairs).unwrap();
    let settings = Settings { gravity_m_per_s2: 0.0, drag_per_s: 5.0, ..Settings::default() };
    let mut drape = Drape::new(&sheet, &Woven::default(), &settings).unwrap();
    let mut state = drape.state(&sheet);
    for _ in 0..600 {
        drape.step(None, &mut state);
    }
    for [a, b] in pairs {
        let gap_m = state.positions_m[a as usize].distance(state.positions_m[b as usize]);
        assert!(gap_m < 0.0025, "{a} {b}: {gap_m}");
    }
    let certificate = drape.certify(None, Bounds::default(), &state);
    assert!(certificate.is_certified(), "{certificate}");

    let mut hung = flat(5, 0.01, 0.0);
    let place_m = hung.positions_m()[12];
    let weight_n = Woven::default().mass_kg_per_m2 * hung.area_m2() * 9.81;
    hung.attach(&[Attachment { particle: 12, place_m, stiffness_n_per_m: weight_n / 0.02 }]).unwrap();
    let settings = Settings { drag_per_s: 10.0, ..Settings::default() };
    let mut drape = Drape::new(&hung, &Woven::default(), &settings).unwrap();
    let mut state = drape.state(&hung);
    for _ in 0..2000 {
        drape.step(None, &mut state);
    }
    assert!((state.positions_m[12].y + 0.02).abs() < 0.001, "{}", state.positions_m[12]);
}

/// Layers that press on the lowest one do not press it into the body.
#[test]
fn a_stack_falls_on_a_ball_and_stays_outside() {
    let (mut positions_m, mut triangles, mut corners_uv) = (Vec::new(), Vec::new(), Vec::new());
    for layer in 0..5 {
        let sheet = flat(14, 0.015, 0.105 + 0.008 * f64::from(layer));
        let before = positions_m.len() as u32;
        for corners in sheet.triangles() {
            triangles.push(corners.map(|v| v + before));
            corners_uv.push(corners.map(|v| sheet.positions_m()[v as usize]).map(|p| glam::DVec2::new(p.x, -p.z)));
        }
        // Turned, so that no edge lies on another.
        let (sin, cos) = (libm::sin(0.3 * f64::from(layer)), libm::cos(0.3 * f64::from(layer)));
        let turned = |p: &DVec3| DVec3::new(cos * p.x + sin * p.z, p.y, cos * p.z - sin * p.x);
        positions_m.extend(sheet.positions_m().iter().map(turned));
    }
    let mesh = PatternMesh {
        positions_m: &positions_m,
        triangles: &triangles,
        corners_uv: &corners_uv,
        metres_per_uv: 1.0,
        welds: &[],
    };
    let (sheet, body) = (Sheet::from_pattern(&mesh).unwrap(), ball(0.1));
    let mut drape = Drape::new(&sheet, &Woven::default(), &Settings::default()).unwrap();
    let mut state = drape.state(&sheet);
    for _ in 0..240 {
        drape.step(Some(Obstacle { body: &body, moves_m: None }), &mut state);
    }
    let certificate = drape.certify(Some(&body), Bounds { fastest_m_per_s: 10.0 }, &state);
    assert!(certificate.is_certified(), "{certificate}");
}

/// A hand swings one corner of fine cloth, in long steps: where each pass goes along the cloth from below, it flies apart within two seconds.
#[test]
fn fine_cells_and_long_steps_do_not_explode() {
    const SIDE: usize = 62;
    let spacing_m = 0.9 / (SIDE - 1) as f64;
    let grid = Grid { rows: SIDE, columns: SIDE, spacing_m, corner_m: DVec3::ZERO, weft: DVec3::X, warp: DVec3::Y };
    let mut sheet = Sheet::from_grid(&grid).unwrap();
    let [pinned, particle] = [SIDE * SIDE - SIDE, SIDE * SIDE - 1];
    let [pinned_m, from_m] = [pinned, particle].map(|particle| sheet.positions_m()[particle]);
    sheet.pin(pinned as u32, pinned_m).unwrap();
    let settings = Settings { step_s: 1.0 / 60.0, parts: 10, meets_itself: false, ..Settings::default() };
    let mut drape = Drape::new(&sheet, &Woven::default(), &settings).unwrap();
    let mut state = drape.state(&sheet);
    for frame in 0..240 {
        let time_s = f64::from(frame) / 60.0;
        let [x, y, z] = [1.5, 2.0, 1.1].map(|per_s| libm::cos(per_s * time_s) - 1.0);
        let place_m = from_m + DVec3::new(0.3 * x, 0.1 * y, 0.3 * z);
        drape.attach(&[Attachment { particle: particle as u32, place_m, stiffness_n_per_m: 400.0 }], 2.0);
        let stepped = drape.step(None, &mut state);
        assert!(stepped.speed_m_per_s < 5.0, "frame {frame}: {stepped:?}");
    }
    let (mean, _) = strain(&sheet, &state.positions_m);
    assert!(mean < 0.06, "{mean}");
}
