//! From a scan to a target: the base's own mesh is laid onto a scanned surface, so that every vertex stays the same point of cloth.
//!
//! First the scan is moved rigidly (`align`), then the base is made as long and wide as it (`size`) and deformed (`deform`): nearest places
//! that face the same way pull at what a scanner can see (`visible`), borders go to where the scan ends (`borders`, `rims`), what lies hidden
//! goes with what lies over it, and the base's own curvature holds all together, more loosely from round to round (Amberg, Romdhani and
//! Vetter 2007 anneal so; the energy is that of Sorkine's Laplacian coordinates, turned along locally). Cloth hardly stretches: edges that
//! become too long or too short are held. Knows no file and no garment.

mod align;
mod borders;
mod deform;
mod rims;
mod rotation;
mod size;
pub(super) mod surface;
mod system;
mod visible;

use super::StageError;
use glam::DVec3;
pub use rotation::Rigid;
use surface::Surface;

/// A scan, ready to be registered: cleaned, metres, Y up.
#[derive(Clone, Debug, Default)]
pub struct Scan {
    /// Metres.
    pub positions_m: Vec<DVec3>,
    /// Facing outwards, or all of them inwards.
    pub triangles: Vec<[u32; 3]>,
    /// Whether +Z is known to be the front, so that other directions need not be tried.
    pub knows_front: bool,
    /// Places of the base with their places in the scan, metres: three or more replace the search for a start, and the vertex that is nearest
    /// to each comes to lie at its place in the scan.
    pub landmarks: Vec<(DVec3, DVec3)>,
}

/// Rounds that become looser and look less far. Pairs are the first round's and the last one's.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Phase {
    /// How many rounds.
    pub rounds: usize,
    /// Solutions of each round.
    pub steps: usize,
    /// How much more a bend counts than a distance.
    pub stiff: [f64; 2],
    /// How far places are looked for, metres.
    pub within_m: [f64; 2],
    /// How far borders look for where the scan ends, metres: a hem lies elsewhere on a wearer of another height.
    pub border_m: [f64; 2],
    /// How much more a border counts than a place of the surface: first it says where cloth slides to, then it only agrees.
    pub border: f64,
    /// How much cloth is held against sliding along the scan: 0 slides freely, 1 counts like the distance itself.
    pub inertia: f64,
}

/// How stiffly the base is laid on.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Settings {
    /// First cloth slides to where borders pull it, stiff enough to go as a whole; then it only goes into the scan's folds.
    pub phases: [Phase; 2],
    /// How much stretch counts beside bend.
    pub stretch: f64,
}

impl Default for Settings {
    fn default() -> Settings {
        let slide = Phase {
            rounds: 3,
            steps: 4,
            stiff: [3e6, 1e6],
            within_m: [0.08, 0.05],
            border_m: [0.2, 0.1],
            border: 4.0,
            inertia: 0.002,
        };
        let settle = Phase {
            rounds: 5,
            steps: 3,
            stiff: [1e5, 1.0],
            within_m: [0.05, 0.015],
            border_m: [0.1, 0.015],
            border: 1.0,
            inertia: 1.0,
        };
        Settings { phases: [slide, settle], stretch: 1e-3 }
    }
}

/// The base as the scan wears it.
#[derive(Clone, Debug)]
pub struct Registered {
    /// The base's vertices, metres, where the base stands.
    pub positions_m: Vec<DVec3>,
    /// How much each vertex was seen in the scan, 0 to 1; what was not goes with its surroundings.
    pub confidence: Vec<f64>,
    /// Where the scan was taken to.
    pub base_from_scan: Rigid,
    /// Whether the scan's triangles were taken as facing inwards.
    pub is_inside_out: bool,
    /// Mean distance of the base from the scan after the rigid motion alone, metres.
    pub aligned_m: f64,
    /// Triangles turned by more than 90 degrees against their surroundings' turn.
    pub turned_over: Vec<u32>,
    /// From each vertex that is seen to the scan, metres: nearest places that face the same way, at most 10 cm.
    pub to_scan_m: Vec<f64>,
    /// From each vertex of the scan to the base, metres, at most 10 cm.
    pub from_scan_m: Vec<f64>,
}

/// Lays the base (metres, its triangles facing outwards) onto a scan.
///
/// # Errors
/// When base or scan have no surface, the scan is nowhere near the base's shape, or the equations cannot be solved.
pub fn register(
    base_m: &[DVec3],
    triangles: &[[u32; 3]],
    scan: &Scan,
    settings: &Settings,
) -> Result<Registered, StageError> {
    /// A scan that after its rigid motion lies farther from the base than this on average is another thing, metres.
    const OTHER_M: f64 = 0.06;
    let fault = |reason: String| StageError::new("register", reason);
    if triangles.is_empty() || scan.triangles.is_empty() {
        return Err(fault("a scan is registered by its surface, and there is none".to_owned()));
    }
    let mut surface = Surface::new(scan.positions_m.clone(), scan.triangles.clone());
    let seen = visible::seen(base_m, triangles);
    let normals = surface::smooth_normals(base_m, triangles);
    let (mut motion, mut aligned_m) =
        align::align(base_m, &normals, &seen, &surface, &scan.landmarks, scan.knows_front);
    // A scan whose triangles all face inwards fits better turned over.
    surface.turn_over();
    let (other, other_m) = align::align(base_m, &normals, &seen, &surface, &scan.landmarks, scan.knows_front);
    let is_inside_out = other_m < aligned_m;
    if is_inside_out {
        (motion, aligned_m) = (other, other_m);
    } else {
        surface.turn_over();
    }
    if aligned_m > OTHER_M {
        return Err(fault(format!(
            "the scan does not look like the base: laid onto each other they lie {:.0} mm apart on average; are unit, up and front right, and is \
             it the same kimono in the same pose? Three landmarks tell where it stands",
            1000.0 * aligned_m
        )));
    }
    let surface = surface.moved(|p| motion.place(p), |n| motion.rotation * n);
    let fixed = fixed(base_m, &scan.landmarks, &motion);
    let sized_m = size::sized_m(base_m, triangles, &seen, &surface);
    let laid = deform::deform(&sized_m, triangles, &seen, &fixed, &surface, settings)?;
    let (to_scan_m, from_scan_m) = apart(&laid.positions_m, triangles, &seen, &surface);
    Ok(Registered {
        from_scan_m,
        to_scan_m,
        turned_over: laid.turned_over,
        confidence: laid.confidence,
        positions_m: laid.positions_m,
        base_from_scan: motion,
        is_inside_out,
        aligned_m,
    })
}

/// For each landmark the vertex that is nearest to it and where that comes to lie, metres.
fn fixed(base_m: &[DVec3], landmarks: &[(DVec3, DVec3)], base_from_scan: &Rigid) -> Vec<(usize, DVec3)> {
    let nearest = |at_m: DVec3| {
        let mut best = (0, f64::INFINITY);
        for (v, place_m) in base_m.iter().enumerate() {
            let away = place_m.distance_squared(at_m);
            if away < best.1 {
                best = (v, away);
            }
        }
        best.0
    };
    let place = |&(base, scan): &(DVec3, DVec3)| {
        let vertex = nearest(base);
        (vertex, base_from_scan.place(scan) + base_m[vertex] - base)
    };
    landmarks.iter().map(place).collect()
}

/// How far a shape of the base and a scan that stands where the base does lie apart, as [`Registered::to_scan_m`] and
/// [`Registered::from_scan_m`]: one measure for whoever laid the base on. The scan's triangles face as the base's do.
#[must_use]
pub fn distances_m(
    base_m: &[DVec3],
    laid_m: &[DVec3],
    triangles: &[[u32; 3]],
    scan: (&[DVec3], &[[u32; 3]]),
) -> (Vec<f64>, Vec<f64>) {
    let surface = Surface::new(scan.0.to_vec(), scan.1.to_vec());
    apart(laid_m, triangles, &visible::seen(base_m, triangles), &surface)
}

fn apart(laid_m: &[DVec3], triangles: &[[u32; 3]], seen: &[bool], surface: &Surface) -> (Vec<f64>, Vec<f64>) {
    /// Farther is as far as this, metres.
    const FAR_M: f64 = 0.1;
    let laid_normals = surface::smooth_normals(laid_m, triangles);
    let to_scan_m = (0..laid_m.len()).filter(|&v| seen[v]).map(|v| {
        let hit = surface.nearest(laid_m[v], FAR_M, |n| n.dot(laid_normals[v]) > 0.5);
        hit.map_or(FAR_M, |hit| hit.distance_m)
    });
    let to_scan_m = to_scan_m.collect();
    let whole = Surface::new(laid_m.to_vec(), triangles.to_vec());
    let from_scan_m =
        surface.positions_m().iter().map(|&p| whole.nearest(p, FAR_M, |_| true).map_or(FAR_M, |hit| hit.distance_m));
    (to_scan_m, from_scan_m.collect())
}
