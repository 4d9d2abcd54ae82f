//! How many frames a second cloth under hands takes on one core, on grids as large as the paper's (Shoda 2018, 3.3: in real time at 22 x 22, with collisions at 21 x 21).

use glam::{DVec2, DVec3};
use kitsuke_drape::analytic_form;
use kitsuke_drape::body::Body;
use kitsuke_drape::drape;
use kitsuke_drape::hands::{Hand, Hands, Model};
use kitsuke_drape::slit::Flat;
use kitsuke_drape::springs;
use kitsuke_drape::woven::Woven;
use std::time::Instant;

const SIDE_M: f64 = 0.9;
const FRAMES_PER_S: f64 = 60.0;
/// Timed frames; as many seconds of two swings.
const FRAMES: usize = 240;

/// What the cloth meets.
#[derive(Clone, Copy, PartialEq)]
enum Meets {
    Nothing,
    Form,
    FormAndItself,
}

/// All figures by name, frames a second of the whole swing.
pub fn measure() -> Result<Vec<(&'static str, f64)>, String> {
    let one = rayon::ThreadPoolBuilder::new().num_threads(1).build().map_err(|error| error.to_string())?;
    one.install(|| {
        Ok(vec![
            ("hands_22_fps", woven(22, Meets::Form)?),
            ("hands_42_fps", woven(42, Meets::Form)?),
            ("hands_102_fps", woven(102, Meets::Form)?),
            ("hands_22_alone_fps", woven(22, Meets::Nothing)?),
            ("hands_42_alone_fps", woven(42, Meets::Nothing)?),
            ("hands_102_alone_fps", woven(102, Meets::Nothing)?),
            ("hands_22_itself_fps", woven(22, Meets::FormAndItself)?),
            ("hands_42_itself_fps", woven(42, Meets::FormAndItself)?),
            ("hands_102_itself_fps", woven(102, Meets::FormAndItself)?),
            ("hands_22_springs_fps", of_springs(22)?),
            ("hands_42_springs_fps", of_springs(42)?),
            ("hands_102_springs_fps", of_springs(102)?),
        ])
    })
}

fn woven(side: usize, meets: Meets) -> Result<f64, String> {
    let settings = drape::Settings {
        step_s: 1.0 / FRAMES_PER_S,
        parts: drape::parts_of_frame(SIDE_M / (side - 1) as f64),
        meets_itself: meets == Meets::FormAndItself,
        ..drape::Settings::default()
    };
    swung(side, Model::Woven(Woven::default(), settings), meets != Meets::Nothing)
}

fn of_springs(side: usize) -> Result<f64, String> {
    let settings = springs::Settings { step_s: 1.0 / FRAMES_PER_S, ..springs::Settings::default() };
    swung(side, Model::Springs(settings), true)
}

/// Cloth hangs by one corner before a dress form; a hand swings the other one against the form and away.
fn swung(side: usize, model: Model, meets_form: bool) -> Result<f64, String> {
    let (form_m, triangles) = analytic_form::dress_form(64);
    let form = Body::new(&form_m, &triangles).map_err(|error| error.to_string())?;
    let highest_m = form_m.iter().map(|p| p.y).fold(f64::NEG_INFINITY, f64::max);
    let spacing_m = DVec2::splat(SIDE_M / (side - 1) as f64);
    let flat = Flat::rectangle(DVec2::new(-0.5 * SIDE_M, -SIDE_M), side - 1, side - 1, spacing_m);
    let hung_m: Vec<DVec3> = flat.places_m.iter().map(|at| DVec3::new(at.x, highest_m + at.y, 0.25)).collect();
    let mut hands = Hands::new(flat, &hung_m, model, 0.1).map_err(|error| error.to_string())?;
    let [pinned, held] = hands.upper_corners();
    let from_m = hung_m[held as usize];
    hands.pin_particle(pinned);
    hands.see(Hand::Right, Some(from_m));
    hands.take(Hand::Right, held);
    let body = meets_form.then_some(&form);
    let started = Instant::now();
    for frame in 0..FRAMES {
        let time_s = frame as f64 / FRAMES_PER_S;
        let [x, y, z] = [1.5, 2.0, 1.1].map(|per_s| libm::cos(per_s * time_s) - 1.0);
        hands.see(Hand::Right, Some(from_m + DVec3::new(0.3 * x, 0.1 * y, 0.3 * z)));
        hands.step(body);
    }
    let fps = FRAMES as f64 / started.elapsed().as_secs_f64();
    let (mean, _) = drape::strain(hands.sheet(), &hands.state.positions_m);
    crate::places::say!("{side} x {side}: {fps:.0} frames a second, {:.2} % strain", 1e2 * mean);
    Ok(fps)
}
