//! Scenes from formulas: sheets that hang, fall over a ball, are twisted, or fall onto each other.

use super::around::{Around, PinsAt};
use super::curves::catenary_sag_m;
use super::{Figures, Scene, laboratory};
use glam::DVec3;
use kitsuke_drape::analytic_form;
use kitsuke_drape::body::Body;
use kitsuke_drape::sheet::{Grid, PatternMesh, Sheet, SheetError};
use kitsuke_drape::woven::Woven;

const SPACING_M: f64 = 0.015;

/// The scene of a name, of a cloth.
pub fn scene(name: &str, woven: &Woven) -> Result<Scene, String> {
    let made = match name {
        "cantilever" => laboratory::cantilever(woven),
        "drape-coefficient" => laboratory::drape_coefficient(),
        "hanging" => hanging(),
        "sphere" => sphere(),
        "twist" => twist(),
        "layers" => layers(),
        other => return Err(format!("there is no scene {other}")),
    };
    made.map_err(|error| error.to_string())
}

fn flat(rows: usize, columns: usize, height_m: f64) -> Grid {
    let half_m = |count: usize| 0.5 * SPACING_M * (count - 1) as f64;
    let corner_m = DVec3::new(-half_m(columns), height_m, half_m(rows));
    Grid { rows, columns, spacing_m: SPACING_M, corner_m, weft: DVec3::X, warp: DVec3::NEG_Z }
}

fn pinned(sheet: &mut Sheet, particles: impl Iterator<Item = usize>) -> Result<(), SheetError> {
    for particle in particles {
        let at_m = sheet.positions_m()[particle];
        sheet.pin(particle as u32, at_m)?;
    }
    Ok(())
}

/// All pins of a sheet go where they are told.
fn moving(sheet: &Sheet, at: PinsAt) -> Around {
    let pins = sheet.pins().iter().enumerate().filter_map(|(particle, pin)| pin.map(|first_m| (particle, first_m)));
    Around { pins: Some((pins.collect(), at)), ..Around::default() }
}

/// A square of one metre held by two corners that are 60 cm apart. Nothing trembles in it, and with more drag what swings only creeps.
fn hanging() -> Result<Scene, SheetError> {
    let mut sheet = Sheet::from_grid(&flat(67, 67, 1.0))?;
    pinned(&mut sheet, [0, 66].into_iter())?;
    let pins: PinsAt = |particle: usize, from_m: DVec3, seconds: f64| {
        let to_m = DVec3::new(if particle == 0 { -0.3 } else { 0.3 }, from_m.y, from_m.z);
        from_m.lerp(to_m, seconds.min(1.0))
    };
    let around = moving(&sheet, pins);
    Ok(Scene { around, figures: Some(Box::new(of_hanging)), parts: 10, drag_per_s: [6.0, 6.0], ..Scene::of(sheet) })
}

/// How far the upper edge sags, beside a chain of its length between the same places.
fn of_hanging(scene: &Scene, _: &Woven, positions_m: &[DVec3]) -> Figures {
    let edge_m = &positions_m[..67];
    let lowest_m = edge_m.iter().map(|p| p.y).fold(f64::INFINITY, f64::min);
    let length_m: f64 = scene.sheet.positions_m()[..67].windows(2).map(|pair| pair[0].distance(pair[1])).sum();
    vec![
        ("sag_mm", 1e3 * (edge_m[0].y - lowest_m)),
        ("catenary_sag_mm", 1e3 * catenary_sag_m(length_m, edge_m[0].distance(edge_m[66]))),
    ]
}

/// A square of 90 cm falls over a ball of 40 cm.
fn sphere() -> Result<Scene, SheetError> {
    let (positions_m, triangles) = analytic_form::sphere(DVec3::ZERO, 0.2, 64);
    let body = Body::new(&positions_m, &triangles).expect("a ball is a body");
    Ok(Scene { around: Around::of(body), ..Scene::of(Sheet::from_grid(&flat(61, 61, 0.22))?) })
}

/// A band of 30 by 60 cm whose ends are turned against each other, half a turn each, and come nearer by a quarter. Wound by two turns it is
/// stretched by two thirds in places, and does not come to rest.
fn twist() -> Result<Scene, SheetError> {
    let (rows, columns) = (41, 21);
    let half_m = |count: usize| 0.5 * SPACING_M * (count - 1) as f64;
    let corner_m = DVec3::new(-half_m(rows), 0.0, half_m(columns));
    let grid = Grid { rows, columns, spacing_m: SPACING_M, corner_m, weft: DVec3::NEG_Z, warp: DVec3::X };
    let mut sheet = Sheet::from_grid(&grid)?;
    let last = rows * columns;
    pinned(&mut sheet, (0..columns).chain(last - columns..last))?;
    let pins: PinsAt = |_: usize, from_m: DVec3, seconds: f64| {
        let share = (seconds / 4.0).min(1.0);
        let angle = from_m.x.signum() * std::f64::consts::PI * share;
        let (sin, cos) = (libm::sin(angle), libm::cos(angle));
        DVec3::new(from_m.x * (1.0 - 0.25 * share), -from_m.z * sin, from_m.z * cos)
    };
    let around = moving(&sheet, pins);
    Ok(Scene { around, ..Scene::of(sheet) })
}

/// Ten squares of 45 cm fall onto a dome, the top of a ball of a metre, one after the other. (From a ball of 40 cm they all slide: a step has one pass
/// over contacts, which carries the pressure of some layers down to the lowest one, and its friction with it, but not of ten.)
fn layers() -> Result<Scene, SheetError> {
    let (mut positions_m, mut triangles, mut corners_uv) = (Vec::new(), Vec::new(), Vec::new());
    for layer in 0..10 {
        let sheet = Sheet::from_grid(&flat(31, 31, 0.52 + 0.02 * f64::from(layer)))?;
        let before = positions_m.len() as u32;
        let turned = 0.3 * f64::from(layer);
        let (sin, cos) = (libm::sin(turned), libm::cos(turned));
        for corners in sheet.triangles() {
            triangles.push(corners.map(|v| v + before));
            corners_uv.push(corners.map(|v| sheet.positions_m()[v as usize]).map(|p| glam::DVec2::new(p.x, -p.z)));
        }
        positions_m
            .extend(sheet.positions_m().iter().map(|p| DVec3::new(cos * p.x + sin * p.z, p.y, cos * p.z - sin * p.x)));
    }
    let mesh = PatternMesh {
        positions_m: &positions_m,
        triangles: &triangles,
        corners_uv: &corners_uv,
        metres_per_uv: 1.0,
        welds: &[],
    };
    let (body_m, body_triangles) = analytic_form::sphere(DVec3::ZERO, 0.5, 160);
    let body = Body::new(&body_m, &body_triangles).expect("a ball is a body");
    Ok(Scene { around: Around::of(body), ..Scene::of(Sheet::from_pattern(&mesh)?) })
}
