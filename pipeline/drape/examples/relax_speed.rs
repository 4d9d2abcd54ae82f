//! Steps per second of square sheets that fall on a dress form, with and without cloth against cloth, and how the cloth lies
//! then: `cargo run --release -p kitsuke-drape --example relax_speed`. Writes nothing but its lines.
#![allow(clippy::print_stdout)]

use glam::DVec3;
use kitsuke_drape::analytic_form;
use kitsuke_drape::depth_maps::DepthMaps;
use kitsuke_drape::fabric::Fabric;
use kitsuke_drape::relax::{Settings, State, step, to_rest};
use kitsuke_drape::sheet::{Grid, Sheet};
use std::time::Instant;

const SIDE_M: f64 = 1.0;
/// Steps toward rest; then steps are timed.
const STEPS: usize = 6000;
const TIMED_S: f64 = 1.0;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let (positions_m, triangles) = analytic_form::dress_form(96);
    let body = DepthMaps::new(&positions_m, &triangles, 0.005)?;
    let fabric = Fabric::default();
    println!(
        "particles   cloth-cloth   steps/s   steps   residual (weights)   last step (mm)   lowest (m)   in form (mm)"
    );
    for particles in [22, 42, 102] {
        let corner_m = DVec3::new(-0.5 * SIDE_M, 1.52, 0.5 * SIDE_M);
        let spacing_m = SIDE_M / (particles - 1) as f64;
        let grid =
            Grid { rows: particles, columns: particles, spacing_m, corner_m, weft: DVec3::X, warp: DVec3::NEG_Z };
        let sheet = Sheet::from_grid(&grid)?;
        for cloth_contacts in [false, true] {
            let settings = Settings { cloth_contacts, ..Settings::default() };
            let mut state = State::new(&sheet, &fabric)?;
            let rested = to_rest(&sheet, &fabric, Some(&body), &settings, 0.05, STEPS, &mut state);
            let (mut lowest_m, mut deepest_m) = (f64::INFINITY, 0.0f64);
            for &place_m in &state.positions_m {
                lowest_m = lowest_m.min(place_m.y);
                deepest_m = deepest_m.max(depth_in_form_m(place_m));
            }
            let settings = Settings { gravity_step_m: rested.gravity_step_m, ..settings };
            let (start, mut steps) = (Instant::now(), 0);
            while start.elapsed().as_secs_f64() < TIMED_S {
                step(&sheet, &fabric, Some(&body), &settings, &mut state);
                steps += 1;
            }
            println!(
                "{particles:>4} x {particles:<4} {:>10}   {:>7.0}   {:>5}   {:>18.3}   {:>14.4}   {lowest_m:>10.3}   {:>12.2}",
                if cloth_contacts { "yes" } else { "no" },
                f64::from(steps) / start.elapsed().as_secs_f64(),
                rested.steps,
                rested.residual_weights,
                1e3 * rested.gravity_step_m,
                1e3 * deepest_m
            );
        }
    }
    Ok(())
}

/// About how deep a place lies in the form, metres: how far its section would have to shrink; 0 outside.
fn depth_in_form_m(place_m: DVec3) -> f64 {
    let Some([width_m, depth_m]) = analytic_form::dress_form_radii_m(place_m.y) else { return 0.0 };
    let level = ((place_m.x / width_m).powi(2) + (place_m.z / depth_m).powi(2)).sqrt();
    ((1.0 - level) * width_m.min(depth_m)).max(0.0)
}
