//! Darts on a form: those that overlap and those whose cloth is cut away beforehand, one and two to a quarter, and the skirt sewn with two.

use super::on_form::{CLEARANCE_M, Drawn, OnForm, THICKNESS_M, all_rest, dressed, fault, on_form, smoothed, told};
use super::tight_skirt::{AWAY_M, MARKS_M, flat_picture};
use crate::places::{say, write_whole};
use glam::Vec3;
use kitsuke_drape::body::Body;
use kitsuke_drape::drape::Settings;
use kitsuke_drape::mapping::DartKind::{Overlapping, Removed};
use kitsuke_drape::skirt::{Design, Draping, Half, apart_m, laid_on, pattern, redrape};
use kitsuke_pipeline::look::sheet::{Cell, contact_sheet, png_bytes};
use serde_json::{Map, Value, json};

/// Drapes halves of a skirt with each kind of darts on a body's form, and writes pictures and figures.
pub fn draped(on: &OnForm) -> Result<(), String> {
    let said = |error: &dyn std::fmt::Display| error.to_string();
    let (_, form) = on.form.make()?;
    let taut = form.skirt();
    let (form_m, form_triangles) = taut.mesh(0.0);
    let taut_body = Body::new(&form_m, &form_triangles).map_err(|error| said(&error))?;
    let woven = on_form(on.woven);
    let draping = Draping { body: &taut_body, woven: &woven, settings: smoothed(), most_s: on.most_s };
    let one = Design { length_m: on.length_m, ..Design::default() };
    let two = one.clone().with_pairs();
    let designs = [
        ("overlapping", one.clone().with(Overlapping)),
        ("removed", one.with(Removed)),
        ("two_overlapping", two.clone().with(Overlapping)),
        ("two_removed", two.with(Removed)),
    ];
    let (mut figures, mut unrested, mut all) = (Map::new(), Vec::new(), Vec::new());
    let (mut inside, mut self_pairs) = (0, 0);
    for (name, design) in &designs {
        let mut halves = laid_on(&taut, design, CLEARANCE_M, 2.0 * THICKNESS_M).map_err(|error| said(&error))?;
        for half in &mut halves {
            let certificate = half.relax(&draping).map_err(|error| said(&error))?;
            let of = format!("{name}, {}", half.name);
            say!("{of}: {}: {certificate}", told(half));
            unrested.extend(fault(&of, &certificate));
            inside += certificate.inside.len();
            self_pairs += certificate.self_crossings.len();
        }
        let worst = |of: fn(&Half) -> f64| halves.iter().map(of).fold(0.0, f64::max);
        figures.insert(format!("{name}_arc_error_max"), json!(worst(|half| half.arc_error_max)));
        figures.insert(format!("{name}_strain_mean"), json!(worst(|half| half.strain_mean)));
        for (half, side) in halves.iter().zip(["front", "back"]) {
            let amount_m = half.mapping.darts.iter().map(|dart| dart.amount_m).fold(0.0, f64::max);
            figures.insert(format!("{name}_{side}_dart_mm"), json!(1e3 * amount_m));
        }
        all.push(halves);
    }
    for (number, name) in [(0, "kinds"), (2, "two_kinds")] {
        let mut apart: Vec<f64> =
            all[number].iter().zip(&all[number + 1]).flat_map(|(over, removed)| apart_m(over, removed)).collect();
        apart.sort_by(f64::total_cmp);
        let (mean_m, p95_m) = (apart.iter().sum::<f64>() / apart.len() as f64, apart[apart.len() * 95 / 100]);
        say!("{name}: {:.2} mm from each other on average, 95 % within {:.2}", 1e3 * mean_m, 1e3 * p95_m);
        figures.insert(format!("{name}_mean_mm"), json!(1e3 * mean_m));
        figures.insert(format!("{name}_p95_mm"), json!(1e3 * p95_m));
    }
    let last = &all[3];
    let pattern = pattern(last, MARKS_M).map_err(|error| said(&error))?;
    for piece in &pattern.pieces {
        piece.check().map_err(|error| said(&error))?;
    }
    let worn = Draping { settings: Settings { pressure_n_per_m2: 0.0, ..draping.settings }, ..draping };
    let redraped = redrape(last, &pattern, designs[3].1.cell_m, AWAY_M, &worn).map_err(|error| said(&error))?;
    let from_first_m = &redraped.from_first_m;
    let mean_m = from_first_m.iter().sum::<f64>() / from_first_m.len() as f64;
    let p95_m = from_first_m[from_first_m.len() * 95 / 100];
    say!(
        "sewn with two darts to a quarter and draped again: {:.2} mm from the first drape on average, 95 % within {:.2}: {}",
        1e3 * mean_m,
        1e3 * p95_m,
        redraped.certificate
    );
    unrested.extend(fault("the skirt sewn with two darts to a quarter", &redraped.certificate));
    for (key, value) in [
        ("redrape_mean_mm", json!(1e3 * mean_m)),
        ("redrape_p95_mm", json!(1e3 * p95_m)),
        ("inside", json!(inside + redraped.certificate.inside.len())),
        ("self_pairs", json!(self_pairs + redraped.certificate.self_crossings.len())),
        ("certified", json!(unrested.is_empty())),
    ] {
        figures.insert(key.to_owned(), value);
    }
    let mut cells = Vec::new();
    let slanted = Vec3::new(-0.7, 0.1, 0.7);
    for (halves, (name, _)) in all.iter().zip(&designs) {
        let cloths = |at: fn(&'_ Half<'_>) -> Vec<glam::DVec3>| halves.each_ref().map(at);
        let (laid, rests) = (cloths(|half| half.laid_m.clone()), cloths(|half| half.rests_m.clone()));
        for (when, places_m, of, side) in [
            ("laid on, front", &laid, 0, slanted),
            ("at rest, front", &rests, 0, slanted),
            ("at rest, front", &rests, 0, Vec3::Z),
            ("laid on, back", &laid, 1, slanted * Vec3::new(1.0, 1.0, -1.0)),
            ("at rest, back", &rests, 1, slanted * Vec3::new(1.0, 1.0, -1.0)),
            ("at rest, back", &rests, 1, Vec3::NEG_Z),
        ] {
            let picture = dressed(&taut, &[Drawn::of(&halves[of], &places_m[of])], side);
            cells.push(Cell { caption: format!("{}, {when}", name.replace('_', " ")), picture });
        }
    }
    cells.push(Cell { caption: "pattern, two removed".to_owned(), picture: flat_picture(&pattern) });
    for (caption, side) in [("front", Vec3::Z), ("right side", Vec3::NEG_X), ("behind", Vec3::NEG_Z)] {
        let picture = dressed(&taut, &[Drawn::sewn(&redraped.rests_m, &redraped.triangles)], side);
        cells.push(Cell { caption: format!("sewn, at rest, {caption}"), picture });
    }
    let picture = png_bytes(&contact_sheet(&cells, 6)).map_err(|error| said(&error))?;
    write_whole(&on.out.join("darts.png"), |out| out.write_all(&picture))?;
    if let Some(path) = on.json {
        let figures = Value::Object(figures);
        write_whole(path, |out| writeln!(out, "{figures:#}"))?;
    }
    all_rest(&unrested, on.most_s)
}
