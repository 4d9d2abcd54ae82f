//! P2's way to rest: in every step the forces are added to the places as displacements, without velocity, then cloth is
//! moved out of cloth and out of the body. Knows no garments and no pictures.

use crate::cells::Cells;
use crate::cloth_contact::{self, Contact};
use crate::depth_maps::DepthMaps;
use crate::fabric::{self, Fabric, FabricError};
use crate::forces;
use crate::parallel;
use crate::sheet::Sheet;
use glam::DVec3;

/// Cloth so near the body is pressed onto it, metres.
const PRESSED_M: f64 = 0.02;

/// How steps are taken.
#[derive(Clone, Debug, PartialEq)]
pub struct Settings {
    /// How far a particle moves in a step under its own weight, metres, above 0. P2 adds forces to places as they are, in units
    /// of its own; this is what such a unit is worth. Greater is faster and rests less calmly; above a third of
    /// the cloth's thickness, cloth may pass through cloth.
    pub gravity_step_m: f64,
    /// Above this force, in weights of a particle, at least 1, the force is replaced (P2, section 4).
    pub limit_weights: f64,
    /// By this one, in weights: a little more than 1, at most `limit_weights`.
    pub instead_weights: f64,
    /// Coefficient of friction of cloth on the body, at least 0.
    pub body_friction: f64,
    /// Whether cloth is kept out of cloth.
    pub cloth_contacts: bool,
    /// What presses cloth within 2 cm of the body onto it, N/m², at least 0 (P3, 2.2.1: hands that smooth it; a weak one, less than the cloth
    /// weighs, or forces along the cloth are lost in the limit).
    pub pressure_n_per_m2: f64,
}

impl Default for Settings {
    fn default() -> Settings {
        Settings {
            gravity_step_m: 0.001,
            limit_weights: 1.2,
            instead_weights: 1.2,
            body_friction: 0.3,
            cloth_contacts: true,
            pressure_n_per_m2: 0.0,
        }
    }
}

/// Where a sheet is on its way, with room for what a step needs.
#[derive(Clone, Debug)]
pub struct State {
    /// Where the particles are, metres. May be moved between steps.
    pub positions_m: Vec<DVec3>,
    before_m: Vec<DVec3>,
    edge_forces_n: Vec<DVec3>,
    hinge_forces_n: Vec<[DVec3; 4]>,
    normals: Vec<DVec3>,
    cell_of: Vec<u32>,
    cells: Cells,
    /// What may touch what, and where the particles were when it was looked for.
    contacts: Vec<Contact>,
    listed_m: Vec<DVec3>,
}

/// What stops a sheet from being relaxed.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum RelaxError {
    /// A constant out of its range.
    #[error(transparent)]
    Constant(#[from] FabricError),
    /// Cloth that is too thick for its mesh: neighbours would push each other away.
    #[error("the cloth is {thickness_m} m thick, must be below half of its shortest edge of {edge_m} m")]
    Thickness {
        /// Thickness of the fabric.
        thickness_m: f64,
        /// Length of the shortest edge.
        edge_m: f64,
    },
}

impl State {
    /// At the places where the sheet was made.
    ///
    /// # Errors
    /// When a constant is out of its range or the cloth is too thick for its mesh.
    pub fn new(sheet: &Sheet, fabric: &Fabric) -> Result<State, RelaxError> {
        fabric::check(fabric)?;
        let thickness_m = fabric.thickness_m;
        let (mut edge_m, mut longest_m) = (f64::INFINITY, 0.0f64);
        for edge in sheet.edges() {
            edge_m = edge_m.min(edge.rest_m);
            longest_m = longest_m.max(edge.rest_m);
        }
        if 2.0 * thickness_m >= edge_m {
            return Err(RelaxError::Thickness { thickness_m, edge_m });
        }
        let positions_m = sheet.positions_m().to_vec();
        let middles_m: Vec<DVec3> = sheet.triangles().iter().map(|&corners| middle_m(corners, &positions_m)).collect();
        // No corner is farther from its triangle's middle than two thirds of the longest edge; a fifth more for stretching.
        let cells = Cells::new(0.8 * longest_m + thickness_m + margin_m(fabric), &middles_m);
        Ok(State {
            before_m: positions_m.clone(),
            positions_m,
            edge_forces_n: vec![DVec3::ZERO; sheet.edges().len()],
            hinge_forces_n: vec![[DVec3::ZERO; 4]; sheet.hinges().len()],
            normals: vec![DVec3::ZERO; sheet.triangles().len()],
            cell_of: vec![0; sheet.triangles().len()],
            cells,
            contacts: Vec::new(),
            listed_m: Vec::new(),
        })
    }
}

/// Whether all settings are in their ranges.
///
/// # Errors
/// The first that is not.
pub fn check(settings: &Settings) -> Result<(), FabricError> {
    fabric::above_zero("gravity_step_m", settings.gravity_step_m)?;
    fabric::at_least_zero("body_friction", settings.body_friction)?;
    fabric::at_least_zero("pressure_n_per_m2", settings.pressure_n_per_m2)?;
    let limit = settings.limit_weights;
    if !(limit.is_finite() && limit >= 1.0) {
        return Err(FabricError { name: "limit_weights", value: limit, range: "finite and at least 1" });
    }
    let instead = settings.instead_weights;
    if !(1.0..=limit).contains(&instead) {
        return Err(FabricError { name: "instead_weights", value: instead, range: "from 1 to limit_weights" });
    }
    Ok(())
}

/// One step of the sheet for which the state was made; returns the greatest way of a particle, metres.
///
/// Fabric and settings are taken as checked ([`State::new`], [`check`]); other numbers give other places, no panic.
///
/// # Panics
/// When the state is that of another sheet.
pub fn step(sheet: &Sheet, fabric: &Fabric, body: Option<&DepthMaps>, settings: &Settings, state: &mut State) -> f64 {
    let State { positions_m, before_m, edge_forces_n, hinge_forces_n, normals, cell_of, cells, contacts, listed_m } =
        state;
    assert!(
        positions_m.len() == sheet.positions_m().len() && normals.len() == sheet.triangles().len(),
        "a state belongs to its sheet"
    );
    before_m.copy_from_slice(positions_m);
    let before_m: &[DVec3] = before_m;
    internal_forces(sheet, fabric, before_m, edge_forces_n, hinge_forces_n);
    let weight_n = forces::particle_weight_n(fabric.mass_kg_per_m2, sheet.area_m2(), before_m.len());
    let (limit_n, instead_n) = (settings.limit_weights * weight_n, settings.instead_weights * weight_n);
    let drawn_n = drawn_forces(sheet, fabric, before_m);
    let m_per_n = settings.gravity_step_m / weight_n;
    let press_n = settings.pressure_n_per_m2 * sheet.area_m2() / before_m.len() as f64;
    let pressing = body.filter(|_| press_n > 0.0);
    parallel::fill(positions_m, |particle| {
        if let Some(place_m) = sheet.pins()[particle] {
            return place_m;
        }
        let mut force_n = DVec3::new(0.0, -weight_n, 0.0);
        for &at in sheet.edges_at(particle) {
            let on_first_n = edge_forces_n[at as usize / 2];
            force_n += if at % 2 == 0 { on_first_n } else { -on_first_n };
        }
        for &at in sheet.hinges_at(particle) {
            force_n += hinge_forces_n[at as usize / 4][at as usize % 4];
        }
        // Sorted by particle: a few among many.
        let mut drawn = drawn_n.partition_point(|&(other, _)| (other as usize) < particle);
        while drawn < drawn_n.len() && drawn_n[drawn].0 as usize == particle {
            force_n += drawn_n[drawn].1;
            drawn += 1;
        }
        if let Some(surface) = pressing.and_then(|body| body.inside(before_m[particle], PRESSED_M)) {
            force_n -= surface.normal * press_n;
        }
        before_m[particle] + forces::limited_n(force_n, limit_n, instead_n) * m_per_n
    });
    if settings.cloth_contacts {
        let triangles = sheet.triangles();
        // What was found serves until a particle has gone half the margin.
        let farthest_m = 0.5 * margin_m(fabric);
        let has_gone = |(then, now): (&DVec3, &DVec3)| (*now - *then).length_squared() > farthest_m * farthest_m;
        if listed_m.is_empty() || listed_m.iter().zip(&*positions_m).any(has_gone) {
            parallel::fill(normals, |i| {
                cloth_contact::unit_normal(triangles[i].map(|corner| before_m[corner as usize]))
            });
            parallel::fill(cell_of, |i| cells.cell(middle_m(triangles[i], before_m)));
            cells.update(cell_of);
            let reach_m = fabric.thickness_m + margin_m(fabric);
            *contacts = cloth_contact::detect(triangles, before_m, normals, cells, reach_m);
            listed_m.clear();
            listed_m.extend_from_slice(before_m);
        }
        let (thickness_m, friction) = (fabric.thickness_m, fabric.friction);
        cloth_contact::resolve(contacts, triangles, sheet.pins(), before_m, positions_m, thickness_m, friction);
    }
    if !settings.cloth_contacts {
        listed_m.clear();
    }
    if let Some(body) = body {
        let moved_m: &[DVec3] = &positions_m.clone();
        parallel::fill(positions_m, |particle| {
            if sheet.pins()[particle].is_some() {
                return moved_m[particle];
            }
            out_of_body(body, before_m[particle], moved_m[particle], fabric.thickness_m, settings.body_friction)
        });
    }
    let mut farthest_squared = 0.0f64;
    for (now, before) in positions_m.iter().zip(before_m) {
        farthest_squared = farthest_squared.max((*now - *before).length_squared());
    }
    farthest_squared.sqrt()
}

/// How a sheet came to rest.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Rested {
    /// How many steps were taken.
    pub steps: usize,
    /// What still moves the cloth at the end: the mean way of the particles over the last steps, as a force in weights of a
    /// particle. Trembling to and fro does not count.
    pub residual_weights: f64,
    /// The last step, as [`Settings::gravity_step_m`].
    pub gravity_step_m: f64,
    /// Whether the residual was below the wanted one before the steps were used up.
    pub is_at_rest: bool,
}

/// Steps after which progress is judged.
const WINDOW: usize = 50;
/// Below this residual, cloth that trembles takes smaller steps.
const STUCK_WEIGHTS: f64 = 0.15;
/// Above this residual, cloth falls and takes larger steps.
const FALLING_WEIGHTS: f64 = 0.4;
/// Correlation of one step's ways with the next one's, below which cloth trembles and above which it goes smoothly.
const TREMBLING: f64 = 0.3;
const SMOOTH: f64 = 0.5;
const SMALLER: f64 = 0.7;
const LARGER: f64 = 1.2;
/// The smallest step, in largest ones: with smaller ones nothing that can be seen moves any more.
const SMALLEST: f64 = 1e-3;

/// Steps until what moves the cloth is below `residual_weights` (0.05 is a calm cloth), or `most_steps` are done.
///
/// P2 has one step for all. But forces as displacements overshoot where taut cloth is stiff: with large steps it trembles so much
/// that it hardly falls. So the step of the settings is the largest one here; after every 50 steps it shrinks where cloth
/// trembles without getting on, and grows again where it moves smoothly.
///
/// # Panics
/// When the state is that of another sheet.
pub fn to_rest(
    sheet: &Sheet,
    fabric: &Fabric,
    body: Option<&DepthMaps>,
    settings: &Settings,
    residual_weights: f64,
    most_steps: usize,
    state: &mut State,
) -> Rested {
    let mut settings = settings.clone();
    let largest_step_m = settings.gravity_step_m;
    let mut rested =
        Rested { steps: 0, residual_weights: f64::INFINITY, gravity_step_m: largest_step_m, is_at_rest: false };
    let mut earlier_m = vec![DVec3::ZERO; state.positions_m.len()];
    while rested.steps < most_steps {
        let start_m = state.positions_m.clone();
        let (mut along, mut squares) = (0.0, 0.0);
        let window = WINDOW.min(most_steps - rested.steps);
        for _ in 0..window {
            step(sheet, fabric, body, &settings, state);
            for ((now, before), earlier) in state.positions_m.iter().zip(&state.before_m).zip(&mut earlier_m) {
                let moved_m = *now - *before;
                along += moved_m.dot(*earlier);
                squares += moved_m.length_squared();
                *earlier = moved_m;
            }
        }
        let mut ways_m = 0.0;
        for (start, end) in start_m.iter().zip(&state.positions_m) {
            ways_m += (*end - *start).length_squared().sqrt();
        }
        let way_m = ways_m / start_m.len() as f64;
        rested.steps += window;
        rested.residual_weights = way_m / (settings.gravity_step_m * window as f64);
        rested.gravity_step_m = settings.gravity_step_m;
        let is_trembling = along < TREMBLING * squares;
        // Cloth that trembles in place seems calm; smaller steps tell whether it is.
        if rested.residual_weights < residual_weights && !is_trembling {
            rested.is_at_rest = true;
            break;
        }
        if is_trembling && rested.residual_weights < STUCK_WEIGHTS {
            settings.gravity_step_m = (largest_step_m * SMALLEST).max(settings.gravity_step_m * SMALLER);
        } else if along > SMOOTH * squares || rested.residual_weights > FALLING_WEIGHTS {
            settings.gravity_step_m = largest_step_m.min(settings.gravity_step_m * LARGER);
        }
    }
    rested
}

/// How much farther than its thickness cloth is looked for, so that not every step has to look.
fn margin_m(fabric: &Fabric) -> f64 {
    fabric.thickness_m
}

fn middle_m(corners: [u32; 3], positions_m: &[DVec3]) -> DVec3 {
    let [a, b, c] = corners.map(|corner| positions_m[corner as usize]);
    (a + b + c) / 3.0
}

fn internal_forces(
    sheet: &Sheet,
    fabric: &Fabric,
    places_m: &[DVec3],
    edge_forces_n: &mut [DVec3],
    hinge_forces_n: &mut [[DVec3; 4]],
) {
    let place = |particle: u32| places_m[particle as usize];
    parallel::fill(edge_forces_n, |i| {
        let edge = &sheet.edges()[i];
        let per_width_n_per_m =
            forces::along_grain(fabric.warp_n_per_m, fabric.weft_n_per_m, fabric.bias_n_per_m, edge.grain);
        let extension = per_width_n_per_m * edge.width_per_length_squared;
        forces::tension_on_first_n(extension, extension * fabric.compression, edge.rest_m, edge.ends.map(place))
    });
    parallel::fill(hinge_forces_n, |i| {
        let hinge = &sheet.hinges()[i];
        forces::bending_n(fabric.bending_n * hinge.rest_m, hinge.edge.map(place), hinge.outer.map(place))
    });
}

/// The forces of threads and attachments, ascending by particle.
fn drawn_forces(sheet: &Sheet, fabric: &Fabric, places_m: &[DVec3]) -> Vec<(u32, DVec3)> {
    let mut drawn_n = Vec::with_capacity(2 * sheet.pairs().len() + sheet.attachments().len());
    for &[a, b] in sheet.pairs() {
        let force_n = (places_m[b as usize] - places_m[a as usize]) * fabric.thread_n_per_m;
        drawn_n.extend([(a, force_n), (b, -force_n)]);
    }
    for attachment in sheet.attachments() {
        let particle = attachment.particle;
        let to_place_m = attachment.place_m - places_m[particle as usize];
        drawn_n.push((particle, to_place_m * attachment.stiffness_n_per_m));
    }
    // Stable, so that the forces on one particle stay in the order of pairs and attachments.
    drawn_n.sort_by_key(|&(particle, _)| particle);
    drawn_n
}

/// Where a particle ends that came from `before_m` to `place_m`: pushed out to the thickness, its slide held by friction.
fn out_of_body(body: &DepthMaps, before_m: DVec3, place_m: DVec3, thickness_m: f64, friction: f64) -> DVec3 {
    let Some(surface) = body.inside(place_m, thickness_m) else { return place_m };
    let moved_m = place_m - before_m;
    let slide_m = moved_m - surface.normal * surface.normal.dot(moved_m);
    let held_m = slide_m - forces::after_friction_m(slide_m, surface.depth_m, friction);
    let out_m = place_m + surface.normal * surface.depth_m - held_m;
    // Where the surface is curved, the tangent plane of the old place is not that of the new one.
    match body.inside(out_m, thickness_m) {
        Some(surface) => out_m + surface.normal * surface.depth_m,
        None => out_m,
    }
}
