//! Pictures of a scene: how it went, and its end from two sides with what fails in red.

use super::Scene;
use crate::places::write_whole;
use glam::{DVec3, Vec3};
use kitsuke_drape::certificate::Certificate;
use kitsuke_drape::drape::{Settings, State};
use kitsuke_pipeline::look::raster::{Camera, Lens, Paint, Shape, render, smooth_normals};
use kitsuke_pipeline::look::sheet::{Cell, contact_sheet, png_bytes};
use std::path::Path;

const CLOTH: [u8; 3] = [96, 110, 150];
const INSIDE: [u8; 3] = [196, 160, 150];
const BODY: [u8; 3] = [214, 190, 170];
const FAULT: [u8; 3] = [230, 40, 30];
const BACKGROUND: [u8; 3] = [244, 243, 240];
const SIDE_PX: u32 = 640;
/// From where the end is seen from above.
const ABOVE: Vec3 = Vec3::new(0.3, 1.0, 0.5);

/// The cloth at a time.
pub struct Frame {
    seconds: f64,
    positions_m: Vec<DVec3>,
    body_m: Vec<DVec3>,
}

impl Frame {
    pub fn of(scene: &Scene, state: &State, settings: &Settings) -> Frame {
        let body_m = scene.around.body.as_ref().map_or(Vec::new(), |body| body.surface().positions_m().to_vec());
        Frame { seconds: state.steps as f64 * settings.step_s, positions_m: state.positions_m.clone(), body_m }
    }
}

/// Writes the film and its end. All pictures show the same part of space, with the cloth of every frame.
pub fn write(path: &Path, scene: &Scene, film: &[Frame], certificate: &Certificate) -> Result<(), String> {
    let all = film.iter().flat_map(|frame| frame.positions_m.iter().chain(&frame.body_m));
    let all_m: Vec<Vec3> = all.map(|p| p.as_vec3()).collect();
    let [front, behind, above] = [Vec3::Z, Vec3::NEG_Z, ABOVE].map(|side| around(&all_m, side));
    let plain = vec![CLOTH; scene.sheet.positions_m().len()];
    let mut cells = Vec::new();
    for frame in film {
        let picture = drawn(scene, frame, &plain, &front);
        cells.push(Cell { caption: format!("{:.2} s", frame.seconds), picture });
    }
    let mut colours = plain;
    for crossing in &certificate.self_crossings {
        crossing.edge.iter().for_each(|&v| colours[v as usize] = FAULT);
        scene.sheet.triangles()[crossing.triangle as usize].iter().for_each(|&v| colours[v as usize] = FAULT);
    }
    for inside in &certificate.inside {
        colours[inside.particle as usize] = FAULT;
    }
    if let Some(end) = film.last() {
        for (side, camera) in [("front", &front), ("behind", &behind), ("above", &above)] {
            let picture = drawn(scene, end, &colours, camera);
            cells.push(Cell { caption: format!("end, {side}"), picture });
        }
    }
    let png = png_bytes(&contact_sheet(&cells, 4)).map_err(|error| error.to_string())?;
    write_whole(path, |out| out.write_all(&png))
}

/// A camera that sees all of it from a side.
fn around(places_m: &[Vec3], side: Vec3) -> Camera {
    let least_m = places_m.iter().copied().reduce(Vec3::min).unwrap_or(Vec3::ZERO);
    let most_m = places_m.iter().copied().reduce(Vec3::max).unwrap_or(Vec3::ONE);
    let (target_m, size_m) = (0.5 * (least_m + most_m), most_m - least_m);
    let height_m = 1.1 * if side == ABOVE { size_m.length() } else { size_m.x.max(size_m.y) };
    Camera { eye_m: target_m + side * size_m.length(), target_m, lens: Lens::Orthographic { height_m } }
}

fn drawn(scene: &Scene, frame: &Frame, colours: &[[u8; 3]], camera: &Camera) -> image::RgbImage {
    let single = |places_m: &[DVec3]| -> Vec<Vec3> { places_m.iter().map(|p| p.as_vec3()).collect() };
    let cloth_m = single(&frame.positions_m);
    let normals = smooth_normals(&cloth_m, scene.sheet.triangles());
    let mut shapes = vec![Shape {
        positions_m: &cloth_m,
        normals: &normals,
        triangles: scene.sheet.triangles(),
        paint: Paint::PerVertex(colours),
        inside: Some(INSIDE),
    }];
    let body = scene.around.body.as_ref().map(|body| {
        let places_m = single(&frame.body_m);
        let normals = smooth_normals(&places_m, body.surface().triangles());
        (places_m, normals, body.surface().triangles())
    });
    if let Some((positions_m, normals, triangles)) = &body {
        shapes.push(Shape { positions_m, normals, triangles, paint: Paint::Plain(BODY), inside: None });
    }
    render(&shapes, camera, [SIDE_PX; 2], BACKGROUND)
}
