//! Registration of a base onto a scan: a sheet wound round a column with a flap over its beginning, and a scan of a known other shape of it.

use glam::DVec3;
use kitsuke_pipeline::stages::StageError;
use kitsuke_pipeline::stages::register::{Registered, Rigid, Scan, Settings, register};
use std::f64::consts::TAU;

/// How far round the sheet goes, turns: the last part lies over the first.
const TURNS: f64 = 1.12;
const AROUND: u32 = 48;
const UP: u32 = 14;

/// The sheet at shares of its width and height, metres; `grown` 0 is the base's shape, 1 the scan's.
fn place(u: f64, v: f64, grown: f64) -> DVec3 {
    let angle = TAU * TURNS * u;
    let layer = 1.0 + 0.05 * TURNS * u;
    let (x, z) = (0.2 + 0.01 * grown * v, 0.14 - 0.008 * grown * (1.0 - v));
    DVec3::new(x * layer * libm::sin(angle), (0.6 + 0.02 * grown) * v, z * layer * libm::cos(angle))
}

/// Squares between the lines of a grid, facing outwards, those that `keep` wants.
fn squares(around: u32, up: u32, keep: impl Fn(f64, f64) -> bool) -> Vec<[u32; 3]> {
    let mut triangles = Vec::new();
    for (i, j) in (0..up).flat_map(|j| (0..around).map(move |i| (i, j))) {
        if keep((f64::from(i) + 0.5) / f64::from(around), (f64::from(j) + 0.5) / f64::from(up)) {
            let at = j * (around + 1) + i;
            let over = at + around + 1;
            triangles.extend([[at, at + 1, over], [at + 1, over + 1, over]]);
        }
    }
    triangles
}

fn grid(around: u32, up: u32) -> Vec<(f64, f64)> {
    let share = |i: u32, of: u32| f64::from(i) / f64::from(of);
    (0..=up).flat_map(|j| (0..=around).map(move |i| (share(i, around), share(j, up)))).collect()
}

fn base() -> (Vec<DVec3>, Vec<[u32; 3]>) {
    (grid(AROUND, UP).into_iter().map(|(u, v)| place(u, v, 0.0)).collect(), squares(AROUND, UP, |_, _| true))
}

fn in_hole(u: f64, v: f64) -> bool {
    (0.5..0.58).contains(&u) && (0.4..0.6).contains(&v)
}

/// How the scan stands.
fn stands() -> Rigid {
    let (sin, cos) = (libm::sin(0.05), libm::cos(0.05));
    let rotation = glam::DMat3::from_cols(DVec3::new(cos, 0.0, -sin), DVec3::Y, DVec3::new(sin, 0.0, cos));
    Rigid { rotation, shift_m: DVec3::new(0.02, -0.01, 0.015) }
}

/// A scan: another mesh, noise of half a millimetre, without what the flap hides, with a hole and a stray piece.
fn scan() -> Scan {
    let (around, up) = (88, 27);
    let hidden = (TURNS - 1.0) / TURNS;
    let mut seed = 7_u32;
    let mut noise = || {
        seed = seed.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        (f64::from(seed >> 8) / f64::from(1 << 24) - 0.5) * 1e-3
    };
    let mut positions_m: Vec<DVec3> = grid(around, up)
        .into_iter()
        .map(|(u, v)| stands().place(place(u, v, 1.0) + DVec3::new(noise(), noise(), noise())))
        .collect();
    let mut triangles = squares(around, up, |u, v| u > hidden && !in_hole(u, v));
    let stray = positions_m.len() as u32;
    positions_m.extend([DVec3::new(0.5, 0.2, 0.0), DVec3::new(0.55, 0.2, 0.0), DVec3::new(0.5, 0.25, 0.0)]);
    triangles.push([stray, stray + 1, stray + 2]);
    Scan { positions_m, triangles, knows_front: true, landmarks: Vec::new() }
}

fn laid(scan: &Scan) -> Result<Registered, StageError> {
    let (base_m, triangles) = base();
    register(&base_m, &triangles, scan, &Settings::default())
}

/// From each vertex to where it stands in the scan, metres.
fn errors_m(laid: &Registered) -> Vec<f64> {
    let truth = grid(AROUND, UP).into_iter().map(|(u, v)| stands().place(place(u, v, 1.0)));
    truth.zip(&laid.positions_m).map(|(p, at)| laid.base_from_scan.place(p).distance(*at)).collect()
}

fn mean(of: impl Iterator<Item = f64>) -> f64 {
    let all: Vec<f64> = of.collect();
    all.iter().sum::<f64>() / all.len() as f64
}

#[test]
fn a_base_takes_a_scans_shape_and_what_is_hidden_goes_along() {
    let with = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        let known = [(0.3, 0.1), (0.6, 0.9), (0.9, 0.2)];
        let landmark = |(u, v): (f64, f64)| (place(u, v, 0.0), stands().place(place(u, v, 1.0)));
        let scan = Scan { landmarks: known.map(landmark).to_vec(), ..scan() };
        pool.install(|| laid(&scan)).unwrap()
    };
    let one = with(1);
    let two = with(2);
    let bits = |laid: &Registered| -> Vec<[u64; 3]> {
        laid.positions_m.iter().map(|p| p.to_array().map(f64::to_bits)).collect()
    };
    assert!(bits(&one) == bits(&two), "threads do not change the result");
    let errors_m = errors_m(&one);
    let places = grid(AROUND, UP);
    let seen = mean(errors_m.iter().zip(&one.confidence).filter(|(_, c)| **c > 0.5).map(|(e, _)| *e));
    assert!(seen < 0.006, "{seen}");
    let under_flap = 0.6 * (TURNS - 1.0) / TURNS;
    let hidden = mean(errors_m.iter().zip(&places).filter(|(_, (u, _))| *u < under_flap).map(|(e, _)| *e));
    assert!(hidden < 0.007, "{hidden}");
    for ((u, v), confidence) in places.iter().zip(&one.confidence) {
        assert!(*confidence == 0.0 || !((0.52..0.56).contains(u) && (0.45..0.55).contains(v)), "{u} {v} {confidence}");
    }
    assert_eq!(one.turned_over, [0_u32; 0]);
}

#[test]
fn a_scan_may_face_inwards() {
    let mut scan = scan();
    scan.triangles.iter_mut().for_each(|t| t.swap(1, 2));
    let laid = laid(&scan).unwrap();
    let error = mean(errors_m(&laid).into_iter());
    assert!(error < 0.006, "{error}");
}

#[test]
fn another_thing_is_refused() {
    let positions_m = grid(20, 20).into_iter().map(|(u, v)| DVec3::new(2.0 * u, 0.0, 2.0 * v)).collect();
    let floor = Scan { positions_m, triangles: squares(20, 20, |_, _| true), ..Scan::default() };
    let error = laid(&floor).unwrap_err().to_string();
    assert!(error.contains("does not look like the base"), "{error}");
    let error = laid(&Scan::default()).unwrap_err().to_string();
    assert!(error.contains("there is none"), "{error}");
}

#[test]
fn a_landmark_comes_to_lie_where_it_was_seen() {
    // A point in the middle of the cloth, said to lie 12 mm farther along the cloth than it does: only a landmark can move it so.
    let (u, v) = (0.75, 0.5);
    let said = stands().place(place(u + 0.012 / (place(u + 0.01, v, 1.0).distance(place(u, v, 1.0)) * 100.0), v, 1.0));
    let known = [(0.3, 0.1), (0.6, 0.9), (0.9, 0.2)].map(|(u, v)| (place(u, v, 0.0), stands().place(place(u, v, 1.0))));
    let mark = place(u, v, 0.0);
    let base = base().0;
    let vertex = (0..base.len()).min_by(|&a, &b| base[a].distance(mark).total_cmp(&base[b].distance(mark))).unwrap();
    let away_m = |landmarks: Vec<(DVec3, DVec3)>| {
        let laid = laid(&Scan { landmarks, ..scan() }).unwrap();
        (laid.base_from_scan.place(said) + base[vertex] - mark).distance(laid.positions_m[vertex])
    };
    let (with, without) = (away_m([&known[..], &[(mark, said)]].concat()), away_m(known.to_vec()));
    assert!(with < 0.003, "{with}");
    assert!(without > 0.008, "{without}");
}

/// The largest factor by which an edge of the base is longer or shorter than in other places.
fn most_stretch(laid_m: &[DVec3], places_m: &[DVec3]) -> f64 {
    let mut most = 1.0_f64;
    for &[a, b, c] in &base().1 {
        for (a, b) in [(a, b), (b, c), (c, a)] {
            let length_m = |of: &[DVec3]| of[a as usize].distance(of[b as usize]);
            let ratio = length_m(laid_m) / length_m(places_m);
            most = most.max(ratio.max(1.0 / ratio));
        }
    }
    most
}

#[test]
fn a_larger_wearers_scan_says_how_wide_the_cloth_is() {
    let wide = |p: DVec3| DVec3::new(1.08 * p.x, p.y, p.z);
    let mut scan = scan();
    scan.positions_m.iter_mut().for_each(|p| *p = wide(*p));
    let laid = laid(&scan).unwrap();
    let truth: Vec<DVec3> = grid(AROUND, UP).into_iter().map(|(u, v)| wide(stands().place(place(u, v, 1.0)))).collect();
    let away_m = |(p, at): (&DVec3, &DVec3)| laid.base_from_scan.place(*p).distance(*at);
    let error = mean(truth.iter().zip(&laid.positions_m).map(away_m));
    // 7.7 mm where the base keeps its own width at first.
    assert!(error < 0.006, "{error}");
    let stretch = most_stretch(&laid.positions_m, &truth);
    assert!(stretch < 1.1, "{stretch}");
}

#[test]
fn what_pulls_at_one_place_tears_no_cloth() {
    // A landmark that lies 60 mm beside its place, beyond two edges.
    let known = [(0.3, 0.1), (0.6, 0.9), (0.9, 0.2)].map(|(u, v)| (place(u, v, 0.0), stands().place(place(u, v, 1.0))));
    let wrong = (place(0.75, 0.5, 0.0), stands().place(place(0.75 + 60e-3 / 1.3, 0.5, 1.0)));
    let laid = laid(&Scan { landmarks: [&known[..], &[wrong]].concat(), ..scan() }).unwrap();
    let stretch = most_stretch(&laid.positions_m, &base().0);
    // 1.46 where nothing holds edges; the suite `scans` builds sizes of real scans, whose edges were stretched 2.8 times.
    assert!(stretch < 1.42, "{stretch}");
}
