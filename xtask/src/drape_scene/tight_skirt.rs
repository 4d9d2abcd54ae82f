//! The scene of the paper: a tight skirt draped on a wearer's form, its pattern, and the skirt that is sewn from it.

use crate::form::FormArgs;
use crate::pattern_files;
use crate::places::{say, write_whole};
use glam::{DVec2, DVec3, Vec3};
use kitsuke_drape::body::Body;
use kitsuke_drape::drape::Settings;
use kitsuke_drape::form::Form;
use kitsuke_drape::pattern::Pattern;
use kitsuke_drape::skirt::{Design, Half, Redraped, laid_on, pattern, redrape};
use kitsuke_drape::woven::Woven;
use kitsuke_pipeline::look::raster::{Camera, Lens, Paint, Shape, render, smooth_normals};
use kitsuke_pipeline::look::sheet::{Cell, contact_sheet, png_bytes};
use std::path::Path;

const FORM: [u8; 3] = [214, 190, 170];
/// Of zones.
const CLOTH: [[u8; 3]; 2] = [[96, 110, 150], [150, 104, 96]];
const BACKGROUND: [u8; 3] = [244, 243, 240];
const SIDE_PX: u32 = 640;
/// Distance of cloth from the form and of layers from each other, metres.
const CLEARANCE_M: f64 = 0.002;
const THICKNESS_M: f64 = 0.001;
/// How far marks on the form's lines are apart, metres.
const MARKS_M: f64 = 0.01;
/// How much farther out the sewn skirt begins than where the first drape was, metres.
const AWAY_M: f64 = 0.01;

/// Drapes a skirt of a length (metres) on a body's form and writes its pattern with seam allowance, pictures and figures.
pub fn draped(
    form: &FormArgs,
    length_m: f64,
    allowance_mm: f64,
    out: &Path,
    json: Option<&Path>,
) -> Result<(), String> {
    let (body, form) = form.make()?;
    let apart = form.apart(&body, form.arms_m);
    let taut = form.skirt();
    let (form_m, form_triangles) = taut.mesh(0.0);
    let taut_body = Body::new(&form_m, &form_triangles).map_err(|error| error.to_string())?;
    let design = Design { length_m, ..Design::default() };
    let mut halves = laid_on(&taut, &design, CLEARANCE_M, 2.0 * THICKNESS_M).map_err(|error| error.to_string())?;
    let woven = Woven {
        thickness_m: THICKNESS_M,
        body_friction: 0.5,
        ..Woven::preset("yukata").expect("there is such a preset")
    };
    let settings = Settings { clearance_m: CLEARANCE_M, pressure_n_per_m2: 20.0, ..Settings::default() };
    for half in &mut halves {
        let certificate = half.relax(&taut_body, &woven, &settings).map_err(|error| error.to_string())?;
        let dart = half.mapping.darts[0];
        say!(
            "{}: weft lengths laid on are off by {:.3} % at most; dart of {:.1} mm at the waist; at rest {:.3} % mean strain: {certificate}",
            half.name,
            1e2 * half.arc_error_max,
            1e3 * dart.amount_m,
            1e2 * half.strain_mean
        );
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
    let worn = Settings { pressure_n_per_m2: 0.0, ..settings };
    let redraped = redrape(&halves, &pattern, design.cell_m, AWAY_M, &taut_body, &woven, &worn)
        .map_err(|error| error.to_string())?;
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
    let pictures = pictures(&taut, &halves, &pattern, &redraped)?;
    write_whole(&out.join("tight-skirt.png"), |out| out.write_all(&pictures))?;
    let svg = pattern_files::svg(&pattern, allowance_mm);
    write_whole(&out.join("pattern.svg"), |out| out.write_all(svg.as_bytes()))?;
    let dxf = pattern_files::dxf(&pattern, allowance_mm)?;
    write_whole(&out.join("pattern.dxf"), |out| out.write_all(&dxf))?;
    if let Some(path) = json {
        let worst = |of: fn(&Half) -> f64| halves.iter().map(of).fold(0.0, f64::max);
        let figures = serde_json::json!({
            "form_mean_mm": 1e3 * apart.form_mean_m.max(apart.body_mean_m),
            "form_max_mm": 1e3 * apart.form_max_m.max(apart.body_max_m),
            "arc_error_max": worst(|half| half.arc_error_max),
            "strain_mean": worst(|half| half.strain_mean),
            "front_dart_mm": 1e3 * halves[0].mapping.darts[0].amount_m,
            "back_dart_mm": 1e3 * halves[1].mapping.darts[0].amount_m,
            "seam_length_max_mm": 1e3 * seam_length_max_m,
            "redrape_mean_mm": 1e3 * redrape_mean_m,
            "redrape_p95_mm": 1e3 * redrape_p95_m,
            "redrape_strain_mean": redraped.strain_mean,
            "least_angle_deg": redraped.least_rad.to_degrees(),
            "certified": redraped.certificate.is_certified(),
            "inside": redraped.certificate.inside.len(),
            "self_pairs": redraped.certificate.self_crossings.len(),
        });
        write_whole(path, |out| writeln!(out, "{figures:#}"))?;
    }
    Ok(())
}

fn pictures(form: &Form, halves: &[Half; 2], pattern: &Pattern, redraped: &Redraped) -> Result<Vec<u8>, String> {
    let mut cells = Vec::new();
    for (name, side) in [("front", Vec3::Z), ("right side", Vec3::NEG_X), ("behind", Vec3::NEG_Z)] {
        for (when, at) in [("laid on", 0), ("at rest", 1)] {
            let cloths: Vec<Drawn> = halves
                .iter()
                .map(|half| {
                    let places_m = if at == 0 { &half.laid_m } else { &half.rests_m };
                    let colours = half.flat.vertex_zones().iter().map(|zone| CLOTH[*zone as usize % 2]).collect();
                    Drawn { places_m, triangles: &half.flat.triangles, colours }
                })
                .collect();
            cells.push(Cell { caption: format!("{when}, {name}"), picture: dressed(form, &cloths, side) });
        }
    }
    cells.push(Cell { caption: "pattern".to_owned(), picture: flat_picture(pattern) });
    let sewn =
        |places_m| Drawn { places_m, triangles: &redraped.triangles, colours: vec![CLOTH[0]; redraped.rests_m.len()] };
    for (caption, places_m, side) in [
        ("sewn, as it begins", &redraped.began_m, Vec3::Z),
        ("sewn, at rest, front", &redraped.rests_m, Vec3::Z),
        ("sewn, at rest, right side", &redraped.rests_m, Vec3::NEG_X),
        ("sewn, at rest, behind", &redraped.rests_m, Vec3::NEG_Z),
        ("sewn, at rest, from the left", &redraped.rests_m, Vec3::new(0.8, 0.3, 0.6)),
    ] {
        cells.push(Cell { caption: caption.to_owned(), picture: dressed(form, &[sewn(places_m)], side) });
    }
    png_bytes(&contact_sheet(&cells, 4)).map_err(|error| error.to_string())
}

struct Drawn<'a> {
    places_m: &'a [DVec3],
    triangles: &'a [[u32; 3]],
    colours: Vec<[u8; 3]>,
}

fn dressed(form: &Form, cloths: &[Drawn], side: Vec3) -> image::RgbImage {
    let single = |places_m: &[DVec3]| -> Vec<Vec3> { places_m.iter().map(|p| p.as_vec3()).collect() };
    let (form_m, form_triangles) = form.mesh(0.0);
    let form_m = single(&form_m);
    let form_normals = smooth_normals(&form_m, &form_triangles);
    let lit: Vec<(Vec<Vec3>, Vec<Vec3>)> = cloths
        .iter()
        .map(|cloth| {
            let places_m = single(cloth.places_m);
            let normals = smooth_normals(&places_m, cloth.triangles);
            (places_m, normals)
        })
        .collect();
    let mut shapes = vec![Shape {
        positions_m: &form_m,
        normals: &form_normals,
        triangles: &form_triangles,
        paint: Paint::Plain(FORM),
        inside: None,
    }];
    for (cloth, (positions_m, normals)) in cloths.iter().zip(&lit) {
        let paint = Paint::PerVertex(&cloth.colours);
        shapes.push(Shape { positions_m, normals, triangles: cloth.triangles, paint, inside: Some(CLOTH[0]) });
    }
    let [low_m, _] = form.span_m();
    let (low_m, high_m) = (low_m as f32, form.lines.waist_m as f32 + 0.1);
    let target_m = Vec3::new(form.lines.centre_x_m as f32, 0.5 * (low_m + high_m), form.lines.side_z_m as f32);
    let camera = Camera {
        eye_m: target_m + 3.0 * side,
        target_m,
        lens: Lens::Orthographic { height_m: 1.05 * (high_m - low_m) },
    };
    render(&shapes, &camera, [SIDE_PX; 2], BACKGROUND)
}

/// All pieces side by side.
fn flat_picture(pattern: &Pattern) -> image::RgbImage {
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
