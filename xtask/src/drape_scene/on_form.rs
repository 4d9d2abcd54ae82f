//! What scenes on a dress form share: what they are told, the cloth and the hands that smooth it, how they end, and pictures. Knows no scene.

use crate::form::FormArgs;
use glam::{DVec3, Vec3};
use kitsuke_drape::certificate::Certificate;
use kitsuke_drape::drape::Settings;
use kitsuke_drape::form::Form;
use kitsuke_drape::skirt::Half;
use kitsuke_drape::woven::Woven;
use kitsuke_pipeline::look::raster::{Camera, Lens, Paint, Shape, render, smooth_normals};
use std::path::Path;

const FORM: [u8; 3] = [214, 190, 170];
/// Of zones.
const CLOTH: [[u8; 3]; 3] = [[96, 110, 150], [150, 104, 96], [112, 140, 104]];
pub const BACKGROUND: [u8; 3] = [244, 243, 240];
pub const SIDE_PX: u32 = 640;
/// Distance of cloth from the form and of layers from each other, metres.
pub const CLEARANCE_M: f64 = 0.002;
pub const THICKNESS_M: f64 = 0.001;

/// What a scene on a form is told.
pub struct OnForm<'a> {
    pub form: FormArgs,
    pub woven: Woven,
    /// From waist to hem, metres.
    pub length_m: f64,
    /// Most seconds of each drape.
    pub most_s: f64,
    pub out: &'a Path,
    pub json: Option<&'a Path>,
}

/// Cloth as it is draped on forms.
pub fn on_form(woven: Woven) -> Woven {
    Woven { thickness_m: THICKNESS_M, body_friction: 0.5, ..woven }
}

/// How cloth comes to rest under hands that smooth it.
pub fn smoothed() -> Settings {
    Settings { clearance_m: CLEARANCE_M, pressure_n_per_m2: 20.0, ..Settings::default() }
}

/// How a half was laid on and rests.
pub fn told(half: &Half) -> String {
    let darts: Vec<String> = half.mapping.darts.iter().map(|dart| format!("{:.1}", 1e3 * dart.amount_m)).collect();
    format!(
        "weft lengths laid on are off by {:.3} % at most; darts of {} mm at the waist; at rest {:.3} % mean strain",
        1e2 * half.arc_error_max,
        darts.join(" and "),
        1e2 * half.strain_mean
    )
}

/// What keeps cloth from certified rest, with what it is.
pub fn fault(of: &str, certificate: &Certificate) -> Option<String> {
    (!certificate.is_certified()).then(|| format!("{of} does not come to certified rest:\n{certificate}"))
}

/// An error where anything does not rest.
pub fn all_rest(unrested: &[String], most_s: f64) -> Result<(), String> {
    if unrested.is_empty() { Ok(()) } else { Err(format!("within {most_s} s {}", unrested.join("\n"))) }
}

/// Cloth in a picture.
pub struct Drawn<'a> {
    /// Metres.
    pub places_m: &'a [DVec3],
    /// Counter-clockwise as seen from outside.
    pub triangles: Vec<[u32; 3]>,
    /// Of each vertex.
    pub colours: Vec<[u8; 3]>,
}

impl<'a> Drawn<'a> {
    /// A half, with its zones in colours.
    pub fn of(half: &'a Half, places_m: &'a [DVec3]) -> Drawn<'a> {
        let colours = half.flat.vertex_zones().iter().map(|zone| CLOTH[*zone as usize % CLOTH.len()]).collect();
        // Where angles fall along the weft, the cloth's other side is outside.
        let is_turned = half.mapping.sense() < 0.0;
        let triangles = half.flat.triangles.iter().map(|&[a, b, c]| if is_turned { [a, c, b] } else { [a, b, c] });
        Drawn { places_m, triangles: triangles.collect(), colours }
    }

    /// Sewn cloth.
    pub fn sewn(places_m: &'a [DVec3], triangles: &'a [[u32; 3]]) -> Drawn<'a> {
        Drawn { places_m, triangles: triangles.to_vec(), colours: vec![CLOTH[0]; places_m.len()] }
    }
}

/// Cloth on its form, seen from a side.
pub fn dressed(form: &Form, cloths: &[Drawn], side: Vec3) -> image::RgbImage {
    let single = |places_m: &[DVec3]| -> Vec<Vec3> { places_m.iter().map(|p| p.as_vec3()).collect() };
    let (form_m, form_triangles) = form.mesh(0.0);
    let form_m = single(&form_m);
    let form_normals = smooth_normals(&form_m, &form_triangles);
    let lit: Vec<(Vec<Vec3>, Vec<Vec3>)> = cloths
        .iter()
        .map(|cloth| {
            let places_m = single(cloth.places_m);
            let normals = smooth_normals(&places_m, &cloth.triangles);
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
        shapes.push(Shape { positions_m, normals, triangles: &cloth.triangles, paint, inside: None });
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
