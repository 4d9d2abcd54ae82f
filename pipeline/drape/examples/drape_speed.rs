//! How fast `drape` steps a sheet of 118 x 118 particles, hanging by a row and folded over a sphere, and how much it stretches.
//! `cargo run --release -p kitsuke-drape --example drape_speed [PARTS [STEPS_PER_S]]`. Writes nothing but its lines.
#![allow(clippy::print_stdout)]

use glam::DVec3;
use kitsuke_drape::analytic_form;
use kitsuke_drape::body::Body;
use kitsuke_drape::certificate::Bounds;
use kitsuke_drape::drape::{Drape, Obstacle, Settings, strain};
use kitsuke_drape::sheet::{Grid, Sheet};
use kitsuke_drape::woven::Woven;
use std::time::Instant;

const SIDE: usize = 118;
const SPACING_M: f64 = 0.015;

fn main() {
    let parts = std::env::args().nth(1).map_or(4, |text| text.parse().expect("PARTS is a number"));
    let half_m = 0.5 * SPACING_M * (SIDE - 1) as f64;
    let flat = |height_m: f64| Grid {
        rows: SIDE,
        columns: SIDE,
        spacing_m: SPACING_M,
        corner_m: DVec3::new(-half_m, height_m, half_m),
        weft: DVec3::X,
        warp: DVec3::NEG_Z,
    };
    let per_s = std::env::args().nth(2).map_or(600.0, |text| text.parse().expect("STEPS_PER_S is a number"));
    let settings = Settings { parts, step_s: 1.0 / per_s, ..Settings::default() };
    let mut hanging = Sheet::from_grid(&flat(2.0)).expect("the grid is a sheet");
    for particle in 0..SIDE {
        let at_m = hanging.positions_m()[particle];
        hanging.pin(particle as u32, at_m).expect("the particle is there");
    }
    run("hanging", &hanging, &Settings { meets_itself: false, ..settings }, None);
    let (positions_m, triangles) = analytic_form::sphere(DVec3::ZERO, 0.25, 64);
    let body = Body::new(&positions_m, &triangles).expect("a sphere is a body");
    let falling = Sheet::from_grid(&flat(0.3)).expect("the grid is a sheet");
    run("folding", &falling, &settings, Some(&body));
}

fn run(name: &str, sheet: &Sheet, settings: &Settings, body: Option<&Body>) {
    let mut drape = Drape::new(sheet, &Woven::default(), settings).expect("the settings are sound");
    let mut state = drape.state(sheet);
    for block in 0..12 {
        let started = Instant::now();
        let mut looks = 0;
        let mut last = Default::default();
        let steps = (0.1 / settings.step_s).round() as u32;
        for _ in 0..steps {
            let obstacle = body.map(|body| Obstacle { body, moves_m: None });
            let stepped = drape.step(obstacle, &mut state);
            looks += stepped.looks;
            last = stepped;
        }
        let ms = started.elapsed().as_secs_f64() * 1e3 / 60.0; // of 1/600 s
        let (mean, most) = strain(sheet, &state.positions_m);
        let certificate = drape.certify(body, Bounds::default(), &state);
        println!(
            "{name} {:.1} s: {ms:.2} ms per 1/600 s, {:.1} looks, strain {:.3} % mean {:.1} % most, {} pairs, {} on body, speed {:.3} m/s fastest {:.2}, {} inside, {} + {} crossings",
            f64::from(block + 1) * 0.1,
            f64::from(looks) / f64::from(steps),
            1e2 * mean,
            1e2 * most,
            last.pairs,
            last.on_body,
            last.speed_m_per_s,
            last.fastest_m_per_s,
            certificate.inside.len(),
            certificate.self_crossings.len(),
            certificate.body_crossings.len()
        );
    }
}
