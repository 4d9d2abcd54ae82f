//! How a session went, as a strip of pictures: cloth, hands, what they hold or would take, and pins. Knows no solver.

use super::session::{Session, Shown};
use crate::places::write_whole;
use glam::{DVec3, Vec3};
use kitsuke_drape::analytic_form::sphere;
use kitsuke_pipeline::look::raster::{Camera, Lens, Paint, Shape, render, smooth_normals};
use kitsuke_pipeline::look::sheet::{Cell, contact_sheet, png_bytes};
use std::path::Path;

const CLOTH: [u8; 3] = [96, 110, 150];
const INSIDE: [u8; 3] = [150, 160, 190];
const BODY: [u8; 3] = [214, 190, 170];
/// Of the left and the right hand, what they would take, and pins.
const HANDS: [[u8; 3]; 2] = [[40, 130, 60], [200, 90, 20]];
const CANDIDATE: [u8; 3] = [250, 220, 40];
const PIN: [u8; 3] = [220, 30, 40];
const BACKGROUND: [u8; 3] = [244, 243, 240];
const SIDE_PX: u32 = 480;

/// A mesh with its normals.
struct Lit {
    positions_m: Vec<Vec3>,
    normals: Vec<Vec3>,
    triangles: Vec<[u32; 3]>,
    colour: [u8; 3],
    inside: Option<[u8; 3]>,
}

impl Lit {
    fn of(positions_m: &[DVec3], triangles: &[[u32; 3]], colour: [u8; 3], inside: Option<[u8; 3]>) -> Lit {
        let positions_m: Vec<Vec3> = positions_m.iter().map(|p| p.as_vec3()).collect();
        Lit {
            normals: smooth_normals(&positions_m, triangles),
            positions_m,
            triangles: triangles.to_vec(),
            colour,
            inside,
        }
    }

    fn ball(at_m: DVec3, radius_m: f64, colour: [u8; 3]) -> Lit {
        let (positions_m, triangles) = sphere(at_m, radius_m, 12);
        Lit::of(&positions_m, &triangles, colour, None)
    }
}

/// Cloth that is farther from where it began is not in the pictures, metres.
const SHOWN_M: f32 = 2.0;

/// Writes the strip: all pictures show the same part of space, from slightly above and beside the wearer; the end also from behind the cloth.
pub fn write(path: &Path, session: &Session) -> Result<(), String> {
    let mut film: Vec<Shown> = session.film().to_vec();
    film.push(session.shown());
    // All that happens near where the cloth began is seen, with the ground beside it; what was thrown farther is not.
    let surface = session.body().surface();
    let body = Lit::of(surface.positions_m(), surface.triangles(), BODY, None);
    let began_m = film.first().and_then(|shown| shown.positions_m.first()).map_or(Vec3::ZERO, |at_m| at_m.as_vec3());
    let cloth = film.iter().flat_map(|shown| shown.positions_m.iter().map(|at_m| at_m.as_vec3()));
    let near = cloth.filter(|at_m| at_m.distance(began_m) < SHOWN_M);
    let person = body.positions_m.iter().copied().filter(|at_m| at_m.y > 0.0);
    let mut places_m: Vec<Vec3> = near.chain(person).collect();
    places_m.extend(places_m.clone().into_iter().map(|at_m| at_m * Vec3::new(1.0, 0.0, 1.0)));
    let body = Some(body);
    let [front, behind] = [Vec3::new(0.5, 0.35, 1.0), Vec3::new(0.5, 0.35, -1.0)].map(|side| around(&places_m, side));
    let end = film.last().cloned();
    let mut cells: Vec<Cell> = film.iter().map(|shown| cell(shown, body.as_ref(), &front)).collect();
    if let Some(end) = end {
        let mut from_behind = cell(&end, body.as_ref(), &behind);
        from_behind.caption = "end, from behind".to_owned();
        cells.push(from_behind);
    }
    let png = png_bytes(&contact_sheet(&cells, 6)).map_err(|error| error.to_string())?;
    write_whole(path, |out| out.write_all(&png))
}

fn cell(shown: &Shown, body: Option<&Lit>, camera: &Camera) -> Cell {
    let mut lit = vec![Lit::of(&shown.positions_m, &shown.triangles, CLOTH, Some(INSIDE))];
    for (hand, colour) in HANDS.into_iter().enumerate() {
        lit.extend(shown.hands_m[hand].map(|at_m| Lit::ball(at_m, 0.025, colour)));
        let marked = |particle: u32, colour: [u8; 3]| Lit::ball(shown.positions_m[particle as usize], 0.014, colour);
        lit.extend(shown.candidates[hand].map(|particle| marked(particle, CANDIDATE)));
        lit.extend(shown.held[hand].map(|particle| marked(particle, colour)));
    }
    lit.extend(shown.pinned_m.iter().map(|at_m| Lit::ball(*at_m, 0.012, PIN)));
    let shapes: Vec<Shape> = (lit.iter().chain(body))
        .map(|lit| Shape {
            positions_m: &lit.positions_m,
            normals: &lit.normals,
            triangles: &lit.triangles,
            paint: Paint::Plain(lit.colour),
            inside: lit.inside,
        })
        .collect();
    let mut caption = format!("{:.2} s", shown.time_s);
    for act in &shown.acts {
        caption += &format!(", {act}");
    }
    Cell { caption, picture: render(&shapes, camera, [SIDE_PX; 2], BACKGROUND) }
}

/// A camera that sees all of it from a side.
fn around(places_m: &[Vec3], side: Vec3) -> Camera {
    let least_m = places_m.iter().copied().reduce(Vec3::min).unwrap_or(Vec3::ZERO);
    let most_m = places_m.iter().copied().reduce(Vec3::max).unwrap_or(Vec3::ONE);
    let (target_m, size_m) = (0.5 * (least_m + most_m), most_m - least_m);
    let eye_m = target_m + side.normalize() * (size_m.length() + 1.0);
    Camera { eye_m, target_m, lens: Lens::Orthographic { height_m: 0.9 * size_m.length().max(0.5) } }
}
