//! The scene of the paper: a tight skirt draped on a wearer's form, its pattern, and the skirt that is sewn from it.

use super::on_form::{
    BACKGROUND, CLEARANCE_M, Drawn, OnForm, SIDE_PX, THICKNESS_M, all_rest, dressed, fault, on_form, smoothed, told,
};
use crate::pattern_files;
use crate::places::{say, write_whole};
use glam::{DVec2, Vec3};
use kitsuke_drape::body::Body;
use kitsuke_drape::depth_maps::DepthMaps;
use kitsuke_drape::drape::Settings;
use kitsuke_drape::fabric::Fabric;
use kitsuke_drape::form::Form;
use kitsuke_drape::pattern::Pattern;
use kitsuke_drape::relax;
use kitsuke_drape::skirt::{Design, Draping, Half, Redraped, laid_on, pattern, redrape};
use kitsuke_drape::skirt_by_forces::{Relaxed, Relaxing, by_forces};
use kitsuke_drape::woven::Woven;
use kitsuke_pipeline::look::sheet::{Cell, contact_sheet, png_bytes};
use std::time::Instant;

/// How far marks on the form's lines are apart, metres.
pub const MARKS_M: f64 = 0.01;
/// How much farther out the sewn skirt begins than where the first drape was, metres.
pub const AWAY_M: f64 = 0.01;
/// How fast cloth that is pressed into a groove of the form is moved out of it, metres per second.
const APART_M_PER_S: f64 = 0.005;
/// Of the form's depth maps, metres.
const DEPTH_CELL_M: f64 = 0.002;
/// By the papers' forces a half has so many steps, and rests below so much of a particle's weight.
const MOST_STEPS: usize = 4000;
const RESIDUAL_WEIGHTS: f64 = 0.05;
/// What presses it then, N/m²: a third of what it weighs.
const WEAK_N_PER_M2: f64 = 0.5;

/// Drapes a skirt on a body's form and writes its pattern with seam allowance (millimetres), pictures and figures.
pub fn draped(on: &OnForm, allowance_mm: f64) -> Result<(), String> {
    let (body, form) = on.form.make()?;
    let apart = form.apart(&body, form.arms_m);
    let taut = form.skirt();
    let (form_m, form_triangles) = taut.mesh(0.0);
    let taut_body = Body::new(&form_m, &form_triangles).map_err(|error| error.to_string())?;
    let design = Design { length_m: on.length_m, ..Design::default() };
    let mut halves = laid_on(&taut, &design, CLEARANCE_M, 2.0 * THICKNESS_M).map_err(|error| error.to_string())?;
    let woven = on_form(on.woven);
    let draping = Draping {
        body: &taut_body,
        woven: &woven,
        settings: Settings { apart_m_per_s: APART_M_PER_S, ..smoothed() },
        most_s: on.most_s,
    };
    let mut unrested = Vec::new();
    let mut drape_s = Vec::new();
    for half in &mut halves {
        let began = Instant::now();
        let certificate = half.relax(&draping).map_err(|error| error.to_string())?;
        drape_s.push(began.elapsed().as_secs_f64());
        say!("{}: {}: {certificate}", half.name, told(half));
        unrested.extend(fault(half.name, &certificate));
    }
    let relaxed = relaxed(&taut, &taut_body, &halves, &woven)?;
    for ((half, relaxed), drape_s) in halves.iter().zip(&relaxed).zip(&drape_s) {
        say!("{}: {}; `drape` took {drape_s:.1} s", half.name, relaxed.told());
    }
    let pattern = pattern(&halves, MARKS_M).map_err(|error| error.to_string())?;
    for piece in &pattern.pieces {
        piece.check().map_err(|error| error.to_string())?;
    }
    let seam_length_max_m = pattern.seams.iter().map(|seam| pattern.unequal_m(*seam)).fold(0.0, f64::max);
    for piece in &pattern.pieces[2..] {
        let runs: Vec<String> =
            piece.runs.iter().map(|run| format!("{} {:.1}", run.name, 1e3 * run.length_m())).collect();
        say!("{}: {} mm", piece.name, runs.join(", "));
    }
    let worn = Draping { settings: Settings { pressure_n_per_m2: 0.0, ..draping.settings }, ..draping };
    let redraped = redrape(&halves, &pattern, design.cell_m, AWAY_M, &worn).map_err(|error| error.to_string())?;
    unrested.extend(fault("the sewn skirt", &redraped.certificate));
    let from_first_m = &redraped.from_first_m;
    let (redrape_mean_m, redrape_p95_m) =
        (from_first_m.iter().sum::<f64>() / from_first_m.len() as f64, from_first_m[from_first_m.len() * 95 / 100]);
    say!(
        "sewn from {} triangles of at least {:.0} degrees and draped again: {:.2} mm from the first drape on average, 95 % within {:.2}; {:.3} % mean strain: {}",
        redraped.triangles.len(),
        redraped.least_rad.to_degrees(),
        1e3 * redrape_mean_m,
        1e3 * redrape_p95_m,
        1e2 * redraped.strain_mean,
        redraped.certificate
    );
    let pictures = pictures(&taut, &halves, &relaxed, &pattern, &redraped)?;
    write_whole(&on.out.join("tight-skirt.png"), |out| out.write_all(&pictures))?;
    let svg = pattern_files::svg(&pattern, allowance_mm);
    write_whole(&on.out.join("pattern.svg"), |out| out.write_all(svg.as_bytes()))?;
    let dxf = pattern_files::dxf(&pattern, allowance_mm)?;
    write_whole(&on.out.join("pattern.dxf"), |out| out.write_all(&dxf))?;
    if let Some(path) = on.json {
        let worst = |of: fn(&Half) -> f64| halves.iter().map(of).fold(0.0, f64::max);
        let farthest = |of: fn(&ByForces) -> f64| relaxed.iter().map(of).fold(0.0, f64::max);
        let figures = serde_json::json!({
            "form_mean_mm": 1e3 * apart.form_mean_m.max(apart.body_mean_m),
            "form_max_mm": 1e3 * apart.form_max_m.max(apart.body_max_m),
            "arc_error_max": worst(|half| half.arc_error_max),
            "strain_mean": worst(|half| half.strain_mean),
            "front_dart_mm": 1e3 * halves[0].mapping.darts[0].amount_m,
            "back_dart_mm": 1e3 * halves[1].mapping.darts[0].amount_m,
            "relax_mean_mm": farthest(|relaxed| 1e3 * relaxed.mean_m),
            "relax_p95_mm": farthest(|relaxed| 1e3 * relaxed.p95_m),
            "relax_strain_mean": farthest(|relaxed| relaxed.half.strain_mean),
            "relax_s": farthest(|relaxed| relaxed.took_s),
            "relax_self_pairs": relaxed.iter().map(|relaxed| relaxed.half.certificate.self_crossings.len()).sum::<usize>(),
            "relax_rests": relaxed.iter().all(|relaxed| relaxed.half.rested.is_at_rest),
            "seam_length_max_mm": 1e3 * seam_length_max_m,
            "redrape_mean_mm": 1e3 * redrape_mean_m,
            "redrape_p95_mm": 1e3 * redrape_p95_m,
            "redrape_strain_mean": redraped.strain_mean,
            "least_angle_deg": redraped.least_rad.to_degrees(),
            "certified": unrested.is_empty(),
            "inside": redraped.certificate.inside.len(),
            "self_pairs": redraped.certificate.self_crossings.len(),
        });
        write_whole(path, |out| writeln!(out, "{figures:#}"))?;
    }
    all_rest(&unrested, on.most_s)
}

/// A half relaxed by the papers' forces.
struct ByForces {
    half: Relaxed,
    took_s: f64,
    /// From where `drape` brought it, metres.
    mean_m: f64,
    p95_m: f64,
}

impl ByForces {
    fn told(&self) -> String {
        let Relaxed { rested, certificate, strain_mean, .. } = &self.half;
        let rests = if rested.is_at_rest { "rests" } else { "does not rest" };
        format!(
            "by the papers' forces it {rests} after {} steps ({:.1} s, {:.2} of its weight moves it), {:.2} mm from where `drape` brought it on average, 95 % within {:.2}; {:.3} % mean strain; {} particles in the form, {} self-intersections",
            rested.steps,
            self.took_s,
            rested.residual_weights,
            1e3 * self.mean_m,
            1e3 * self.p95_m,
            1e2 * strain_mean,
            certificate.inside.len(),
            certificate.self_crossings.len()
        )
    }
}

/// Halves that `drape` has brought to rest, relaxed from where it began by the papers' forces, with the cloth's weight, thickness and friction; it
/// stretches like P2's.
fn relaxed(form: &Form, body: &Body, halves: &[Half; 2], woven: &Woven) -> Result<Vec<ByForces>, String> {
    let (positions_m, triangles) = form.mesh(CLEARANCE_M - THICKNESS_M);
    let maps = DepthMaps::new(&positions_m, &triangles, DEPTH_CELL_M).map_err(|error| error.to_string())?;
    let fabric = Fabric {
        mass_kg_per_m2: woven.mass_kg_per_m2,
        thickness_m: woven.thickness_m,
        friction: woven.friction,
        ..Fabric::default()
    };
    let settings = relax::Settings {
        gravity_step_m: 0.3 * THICKNESS_M,
        body_friction: woven.body_friction,
        pressure_n_per_m2: WEAK_N_PER_M2,
        ..relax::Settings::default()
    };
    let relaxing = Relaxing {
        form: &maps,
        body,
        fabric: &fabric,
        settings: &settings,
        residual_weights: RESIDUAL_WEIGHTS,
        most_steps: MOST_STEPS,
    };
    let one = |half: &Half| {
        let began = Instant::now();
        let half = by_forces(half, &relaxing).map_err(|error| error.to_string())?;
        let apart_m = &half.from_drape_m;
        let mean_m = apart_m.iter().sum::<f64>() / apart_m.len() as f64;
        let p95_m = apart_m[apart_m.len() * 95 / 100];
        Ok(ByForces { took_s: began.elapsed().as_secs_f64(), mean_m, p95_m, half })
    };
    halves.iter().map(one).collect()
}

fn pictures(
    form: &Form,
    halves: &[Half; 2],
    relaxed: &[ByForces],
    pattern: &Pattern,
    redraped: &Redraped,
) -> Result<Vec<u8>, String> {
    let mut cells = Vec::new();
    for (name, side) in [("front", Vec3::Z), ("right side", Vec3::NEG_X), ("behind", Vec3::NEG_Z)] {
        for (when, at) in [("laid on", 0), ("at rest", 1), ("by the papers' forces", 2)] {
            let places_m =
                |number: usize| [&halves[number].laid_m, &halves[number].rests_m, &relaxed[number].half.places_m][at];
            let cloths: Vec<Drawn> =
                halves.iter().enumerate().map(|(number, half)| Drawn::of(half, places_m(number))).collect();
            cells.push(Cell { caption: format!("{when}, {name}"), picture: dressed(form, &cloths, side) });
        }
    }
    cells.push(Cell { caption: "pattern".to_owned(), picture: flat_picture(pattern) });
    for (caption, places_m, side) in [
        ("sewn, as it begins", &redraped.began_m, Vec3::Z),
        ("sewn, at rest, front", &redraped.rests_m, Vec3::Z),
        ("sewn, at rest, right side", &redraped.rests_m, Vec3::NEG_X),
        ("sewn, at rest, behind", &redraped.rests_m, Vec3::NEG_Z),
        ("sewn, at rest, from the left", &redraped.rests_m, Vec3::new(0.8, 0.3, 0.6)),
    ] {
        cells.push(Cell {
            caption: caption.to_owned(),
            picture: dressed(form, &[Drawn::sewn(places_m, &redraped.triangles)], side),
        });
    }
    png_bytes(&contact_sheet(&cells, 3)).map_err(|error| error.to_string())
}

/// All pieces side by side.
pub fn flat_picture(pattern: &Pattern) -> image::RgbImage {
    const GAP_M: f64 = 0.03;
    let mut picture = image::RgbImage::from_pixel(SIDE_PX, SIDE_PX, image::Rgb(BACKGROUND));
    let outlines: Vec<Vec<DVec2>> = pattern.pieces.iter().map(kitsuke_drape::pattern::Piece::outline_m).collect();
    let span = |outline: &[DVec2]| {
        let low = outline.iter().copied().reduce(DVec2::min).unwrap_or_default();
        (low, outline.iter().copied().reduce(DVec2::max).unwrap_or_default() - low)
    };
    let wide_m: f64 = outlines.iter().map(|outline| span(outline).1.x + GAP_M).sum::<f64>() + GAP_M;
    let px_per_m = f64::from(SIDE_PX) / wide_m;
    let mut x_m = GAP_M;
    for outline in &outlines {
        let (low, size) = span(outline);
        for (a, b) in outline.iter().zip(outline.iter().cycle().skip(1)) {
            let steps = (a.distance(*b) * px_per_m * 2.0).ceil() as usize + 1;
            for i in 0..=steps {
                let at = (a.lerp(*b, i as f64 / steps as f64) - low + DVec2::new(x_m, GAP_M)) * px_per_m;
                let (x, y) = (at.x as u32, SIDE_PX.saturating_sub(at.y as u32 + 1));
                if x < SIDE_PX {
                    picture.put_pixel(x, y, image::Rgb([20, 30, 60]));
                }
            }
        }
        x_m += size.x + GAP_M;
    }
    picture
}
