//! How fast cloth is stepped: the scenes of `cloth_peer`, P2's relaxation, and a kimono that comes to rest.

use crate::drape_scene::{kimono, rested};
use crate::places::Places;
use glam::DVec3;
use kitsuke_drape::analytic_form;
use kitsuke_drape::body::Body;
use kitsuke_drape::depth_maps::DepthMaps;
use kitsuke_drape::drape::{Drape, Obstacle, Settings, strain};
use kitsuke_drape::fabric::Fabric;
use kitsuke_drape::relax;
use kitsuke_drape::sheet::{Grid, Sheet};
use kitsuke_drape::woven::Woven;
use std::time::Instant;

const SIDE: usize = 118;
const SPACING_M: f64 = 0.015;
/// Timed blocks; a figure is their median.
const BLOCKS: usize = 5;

/// All figures by name. Takes about a minute and a half.
pub fn measure(places: &Places, id: &str) -> Result<Vec<(&'static str, f64)>, String> {
    let mut hanging = sheet(2.0)?;
    for particle in 0..SIDE {
        let at_m = hanging.positions_m()[particle];
        hanging.pin(particle as u32, at_m).map_err(|error| error.to_string())?;
    }
    let settings = Settings { drag_per_s: 0.1, clearance_m: 0.003, ..Settings::default() };
    // As many parts as the peer's mean strain takes.
    let alone = Settings { meets_itself: false, parts: 6, ..settings };
    let (step_ms, strain_mean) = stepped(&hanging, &alone, None, 300, 60)?;
    let (positions_m, triangles) = analytic_form::sphere(DVec3::Y, 0.25, 64);
    let ball = Body::new(&positions_m, &triangles).map_err(|error| error.to_string())?;
    let (contact_ms, strain_contact_mean) = stepped(&sheet(1.55)?, &settings, Some(&ball), 300, 12)?;
    let mut scene = kimono::scene(places, id, 0, 0.03, None)?;
    let started = Instant::now();
    let certificate = rested(&mut scene, &Woven::default(), &Settings::default(), 8.0)?;
    let to_rest_s = started.elapsed().as_secs_f64();
    if !certificate.is_certified() {
        return Err(format!("the kimono does not come to certified rest:\n{certificate}"));
    }
    Ok(vec![
        ("relax_step_ms", relax_step_ms()?),
        ("drape_step_ms", step_ms),
        ("drape_strain_mean", strain_mean),
        ("drape_step_contact_ms", contact_ms),
        ("drape_strain_contact_mean", strain_contact_mean),
        ("drape_to_rest_s", to_rest_s),
    ])
}

/// The peer's sheet: flat, particle 0 at the corner where x and z are least, rows along +Z.
fn sheet(height_m: f64) -> Result<Sheet, String> {
    let half_m = 0.5 * SPACING_M * (SIDE - 1) as f64;
    let corner_m = DVec3::new(-half_m, height_m, -half_m);
    let grid = Grid { rows: SIDE, columns: SIDE, spacing_m: SPACING_M, corner_m, weft: DVec3::X, warp: DVec3::Z };
    Sheet::from_grid(&grid).map_err(|error| error.to_string())
}

/// Milliseconds of a step after so many of them, and the mean strain then, over blocks of so many.
fn stepped(
    sheet: &Sheet,
    settings: &Settings,
    body: Option<&Body>,
    before: usize,
    block: usize,
) -> Result<(f64, f64), String> {
    let woven =
        Woven { mass_kg_per_m2: 0.15, thickness_m: 0.003, friction: 0.3, body_friction: 0.3, ..Woven::default() };
    let mut drape = Drape::new(sheet, &woven, settings).map_err(|error| error.to_string())?;
    let mut state = drape.state(sheet);
    let obstacle = body.map(|body| Obstacle { body, moves_m: None });
    for _ in 0..before {
        drape.step(obstacle, &mut state);
    }
    let (mut times_ms, mut strains) = (Vec::new(), 0.0);
    for _ in 0..BLOCKS {
        let started = Instant::now();
        for _ in 0..block {
            drape.step(obstacle, &mut state);
        }
        times_ms.push(started.elapsed().as_secs_f64() * 1e3 / block as f64);
        strains += strain(sheet, &state.positions_m).0 / BLOCKS as f64;
    }
    times_ms.sort_by(f64::total_cmp);
    Ok((times_ms[BLOCKS / 2], strains))
}

/// A step of P2's relaxation of 42 x 42 particles on the dress form, with cloth against cloth.
fn relax_step_ms() -> Result<f64, String> {
    const ROWS: usize = 42;
    const STEPS: usize = 500;
    let (positions_m, triangles) = analytic_form::dress_form(64);
    let form = DepthMaps::new(&positions_m, &triangles, 0.005).map_err(|error| error.to_string())?;
    let highest_m = positions_m.iter().map(|p| p.y).fold(f64::NEG_INFINITY, f64::max);
    let corner_m = DVec3::new(-0.41, highest_m + 0.02, 0.41);
    let grid = Grid { rows: ROWS, columns: ROWS, spacing_m: 0.02, corner_m, weft: DVec3::X, warp: DVec3::NEG_Z };
    let sheet = Sheet::from_grid(&grid).map_err(|error| error.to_string())?;
    let fabric = Fabric::default();
    let mut state = relax::State::new(&sheet, &fabric).map_err(|error| error.to_string())?;
    let mut times_ms = Vec::new();
    for _ in 0..BLOCKS {
        let started = Instant::now();
        for _ in 0..STEPS {
            relax::step(&sheet, &fabric, Some(&form), &relax::Settings::default(), &mut state);
        }
        times_ms.push(started.elapsed().as_secs_f64() * 1e3 / STEPS as f64);
    }
    times_ms.sort_by(f64::total_cmp);
    Ok(times_ms[BLOCKS / 2])
}
