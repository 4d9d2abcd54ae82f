//! Pictures of a scene: how it went, and its end from two sides with what fails in red.

use super::Scene;
use crate::places::write_whole;
use glam::{DVec3, Vec3};
use kitsuke_drape::certificate::Certificate;
use kitsuke_drape::drape::State;
use kitsuke_pipeline::look::raster::{Camera, Paint, Shape, render, smooth_normals};
use kitsuke_pipeline::look::sheet::{Cell, contact_sheet, png_bytes};
use std::path::Path;

const CLOTH: [u8; 3] = [96, 110, 150];
const INSIDE: [u8; 3] = [196, 160, 150];
const BODY: [u8; 3] = [214, 190, 170];
const FAULT: [u8; 3] = [230, 40, 30];
const BACKGROUND: [u8; 3] = [244, 243, 240];
const SIDE_PX: u32 = 640;

/// The cloth from the front.
pub fn frame(scene: &Scene, state: &State, seconds: f64) -> Cell {
    let colours = vec![CLOTH; state.positions_m.len()];
    let [front, _] = drawn(scene, state, &colours);
    Cell { caption: format!("{seconds:.2} s"), picture: front }
}

/// Writes the film and the end.
pub fn write(
    path: &Path,
    scene: &Scene,
    state: &State,
    film: Vec<Cell>,
    certificate: &Certificate,
) -> Result<(), String> {
    let mut colours = vec![CLOTH; state.positions_m.len()];
    for crossing in &certificate.self_crossings {
        crossing.edge.iter().for_each(|&v| colours[v as usize] = FAULT);
        scene.sheet.triangles()[crossing.triangle as usize].iter().for_each(|&v| colours[v as usize] = FAULT);
    }
    for inside in &certificate.inside {
        colours[inside.particle as usize] = FAULT;
    }
    let [front, behind] = drawn(scene, state, &colours);
    let mut cells = film;
    cells.push(Cell { caption: "end, front".to_owned(), picture: front });
    cells.push(Cell { caption: "end, behind".to_owned(), picture: behind });
    let png = png_bytes(&contact_sheet(&cells, 4)).map_err(|error| error.to_string())?;
    write_whole(path, |out| out.write_all(&png))
}

fn drawn(scene: &Scene, state: &State, colours: &[[u8; 3]]) -> [image::RgbImage; 2] {
    let single = |places_m: &[DVec3]| -> Vec<Vec3> { places_m.iter().map(|p| p.as_vec3()).collect() };
    let cloth_m = single(&state.positions_m);
    let normals = smooth_normals(&cloth_m, scene.sheet.triangles());
    let mut shapes = vec![Shape {
        positions_m: &cloth_m,
        normals: &normals,
        triangles: scene.sheet.triangles(),
        paint: Paint::PerVertex(colours),
        inside: Some(INSIDE),
    }];
    let body = scene.body.as_ref().map(|body| {
        let places_m = single(body.surface().positions_m());
        let normals = smooth_normals(&places_m, body.surface().triangles());
        (places_m, normals, body.surface().triangles())
    });
    if let Some((positions_m, normals, triangles)) = &body {
        shapes.push(Shape { positions_m, normals, triangles, paint: Paint::Plain(BODY), inside: None });
    }
    let start_m = single(scene.sheet.positions_m());
    Camera::front_and_behind(&start_m).map(|(_, camera)| render(&shapes, &camera, [SIDE_PX; 2], BACKGROUND))
}
