//! Cloth that was laid onto a scan, beside the scan: one over the other, how far they lie apart, and what was seen. Knows nobody who laid
//! it on.

use super::raster::{Camera, Paint, Shape, render, smooth_normals};
use super::sheet::Cell;
use glam::{DVec3, Vec3};

/// How many pictures there are from each side.
pub const COLUMNS: usize = 3;
/// A distance that is drawn fully red, metres.
const FULL_M: f64 = 0.01;
const CLOTH: [u8; 3] = [96, 110, 150];
const SCAN: [u8; 3] = [226, 178, 110];
const BACKGROUND: [u8; 3] = [244, 243, 240];

/// Cloth and scan at one place.
#[derive(Clone, Copy, Debug)]
pub struct LaidOn<'a> {
    /// Vertices of the cloth, metres.
    pub cloth_m: &'a [DVec3],
    /// Its triangles.
    pub triangles: &'a [[u32; 3]],
    /// How much each of its vertices was seen, 0 to 1.
    pub confidence: &'a [f64],
    /// Vertices of the scan, metres.
    pub scan_m: &'a [DVec3],
    /// Its triangles.
    pub scan_triangles: &'a [[u32; 3]],
    /// How far each of its vertices lies from the cloth, metres.
    pub from_scan_m: &'a [f64],
}

/// Pictures from the front, then from behind, [`COLUMNS`] each, of so many pixels each way: the scan (yellow) and the cloth (blue) at one
/// place; the scan by its distance from the cloth; the cloth by what was seen of it.
///
/// # Panics
/// When the arrays do not belong together.
#[must_use]
pub fn pictures(laid: &LaidOn<'_>, side_px: u32) -> Vec<Cell> {
    let from_scan: Vec<[u8; 3]> = laid.from_scan_m.iter().map(|d| heat(d / FULL_M)).collect();
    let unseen: Vec<[u8; 3]> = laid.confidence.iter().map(|c| heat(1.0 - c)).collect();
    let (cloth, scan) = (Surface::new(laid.cloth_m, laid.triangles), Surface::new(laid.scan_m, laid.scan_triangles));
    let both = [cloth.shape(Paint::Plain(CLOTH)), scan.shape(Paint::Plain(SCAN))];
    let mut cells = Vec::new();
    for (name, camera) in Camera::front_and_behind(&cloth.positions_m) {
        let mut draw = |caption: &str, shapes: &[Shape<'_>]| {
            let picture = render(shapes, &camera, [side_px; 2], BACKGROUND);
            cells.push(Cell { caption: format!("{caption}, {name}"), picture });
        };
        draw("scan over cloth", &both);
        draw("scan, 10 mm red", &[scan.shape(Paint::PerVertex(&from_scan))]);
        draw("cloth, unseen red", &[cloth.shape(Paint::PerVertex(&unseen))]);
    }
    cells
}

/// Blue at 0, red at 1 and above.
fn heat(share: f64) -> [u8; 3] {
    let share = share.clamp(0.0, 1.0);
    [(70.0 + 170.0 * share) as u8, (130.0 - 70.0 * share) as u8, (200.0 - 160.0 * share) as u8]
}

/// A mesh as the rasteriser wants it.
struct Surface<'a> {
    positions_m: Vec<Vec3>,
    normals: Vec<Vec3>,
    triangles: &'a [[u32; 3]],
}

impl Surface<'_> {
    fn new<'a>(positions_m: &[DVec3], triangles: &'a [[u32; 3]]) -> Surface<'a> {
        let positions_m: Vec<Vec3> = positions_m.iter().map(|p| p.as_vec3()).collect();
        Surface { normals: smooth_normals(&positions_m, triangles), positions_m, triangles }
    }

    fn shape<'a>(&'a self, paint: Paint<'a>) -> Shape<'a> {
        let Surface { positions_m, normals, triangles } = self;
        Shape { positions_m, normals, triangles, paint, inside: None }
    }
}
