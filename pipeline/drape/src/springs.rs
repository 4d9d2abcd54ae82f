//! Cloth of masses and springs (Shoda 2018, 3.2.2): each particle of a grid hangs on eight neighbours, equations 3-1 to 3-4, and a body's surface throws it off, 3-7. Light
//! enough for hands, but rubber: see `drape` for woven cloth. Knows no hands and no cloth against cloth.
//!
//! Steps are divided so that the stiffest particle stays stable, and no particle goes farther in one of them than half of its distance from the body: the
//! paper's cloth explodes where hands shake.

use crate::body::Body;
use crate::drape::{State, Stepped};
use crate::fabric::{FabricError, above_zero, at_least_zero};
use crate::sheet::Sheet;
use glam::DVec3;
use std::collections::BTreeMap;

/// Springs pull at a particle with at most this share of what would throw it beyond its place of rest.
const STABLE: f64 = 0.5;

/// How cloth of springs is made and steps.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Settings {
    /// Simulated seconds of a step, above 0.
    pub step_s: f64,
    /// k_a of neighbours along warp and weft, N/m, above 0.
    pub along_n_per_m: f64,
    /// k_d of neighbours along the bias, N/m, at least 0.
    pub bias_n_per_m: f64,
    /// Mass, kg/m², above 0; all particles have the same.
    pub mass_kg_per_m2: f64,
    /// What air takes from velocities, 1/s: alpha of 3-4 is 1 - drag dt.
    pub drag_per_s: f64,
    /// Epsilon of 3-7, metres, above 0.
    pub clearance_m: f64,
    /// Metres per second squared, along Y.
    pub gravity_m_per_s2: f64,
}

impl Default for Settings {
    fn default() -> Settings {
        Settings {
            step_s: 1.0 / 60.0,
            along_n_per_m: 20.0,
            bias_n_per_m: 4.0,
            mass_kg_per_m2: 0.15,
            drag_per_s: 2.0,
            clearance_m: 0.01,
            gravity_m_per_s2: -9.80665,
        }
    }
}

#[derive(Clone, Copy, Debug)]
struct Spring {
    ends: [usize; 2],
    rest_m: f64,
    n_per_m: f64,
}

/// A sheet as masses and springs.
#[derive(Clone, Debug)]
pub struct Springs {
    settings: Settings,
    springs: Vec<Spring>,
    mass_kg: f64,
    /// Divisions of a step.
    parts: u32,
    held_m: BTreeMap<usize, DVec3>,
    forces_n: Vec<DVec3>,
}

impl Springs {
    /// Edges are springs, and so is the other diagonal of a cell of a grid.
    ///
    /// # Errors
    /// When a setting is not in its range.
    pub fn new(sheet: &Sheet, settings: &Settings) -> Result<Springs, FabricError> {
        above_zero("step_s", settings.step_s)?;
        above_zero("along_n_per_m", settings.along_n_per_m)?;
        at_least_zero("bias_n_per_m", settings.bias_n_per_m)?;
        above_zero("mass_kg_per_m2", settings.mass_kg_per_m2)?;
        at_least_zero("drag_per_s", settings.drag_per_s)?;
        above_zero("clearance_m", settings.clearance_m)?;
        at_least_zero("gravity_m_per_s2", settings.gravity_m_per_s2.abs())?;
        let is_bias = |grain: f64| grain.abs() < 0.7;
        let mut springs = Vec::new();
        let mut grains = BTreeMap::new();
        for edge in sheet.edges() {
            let n_per_m = if is_bias(edge.grain) { settings.bias_n_per_m } else { settings.along_n_per_m };
            springs.push(Spring { ends: edge.ends.map(|end| end as usize), rest_m: edge.rest_m, n_per_m });
            grains.insert(edge.ends, edge.grain);
        }
        for hinge in sheet.hinges() {
            let [a, b] = hinge.edge;
            if grains.get(&[a.min(b), a.max(b)]).is_some_and(|grain| is_bias(*grain)) {
                let ends = hinge.outer.map(|end| end as usize);
                springs.push(Spring { ends, rest_m: hinge.rest_m, n_per_m: settings.bias_n_per_m });
            }
        }
        let count = sheet.positions_m().len();
        let mass_kg = settings.mass_kg_per_m2 * sheet.area_m2() / count as f64;
        let mut pulls = vec![0.0_f64; count];
        for spring in &springs {
            spring.ends.iter().for_each(|end| pulls[*end] += spring.n_per_m);
        }
        let stiffest = pulls.into_iter().fold(0.0, f64::max);
        let most_s = (STABLE * mass_kg / stiffest.max(f64::MIN_POSITIVE)).sqrt();
        let parts = (settings.step_s / most_s).ceil().clamp(1.0, 1e4) as u32;
        Ok(Springs {
            settings: *settings,
            springs,
            mass_kg,
            parts,
            held_m: BTreeMap::new(),
            forces_n: vec![DVec3::ZERO; count],
        })
    }

    /// Holds a particle at a place from the next step on.
    pub fn hold(&mut self, particle: usize, to_m: DVec3) {
        self.held_m.insert(particle, to_m);
    }

    /// Lets a particle go that was held.
    pub fn let_go(&mut self, particle: usize) {
        self.held_m.remove(&particle);
    }

    /// How it steps.
    #[must_use]
    pub fn settings(&self) -> &Settings {
        &self.settings
    }

    /// One step.
    ///
    /// # Panics
    /// When the state has another number of particles than the sheet.
    pub fn step(&mut self, body: Option<&Body>, state: &mut State) -> Stepped {
        assert_eq!(state.positions_m.len(), self.forces_n.len(), "a place to each particle");
        let from_m = state.positions_m.clone();
        let part_s = self.settings.step_s / f64::from(self.parts);
        for part in 0..self.parts {
            self.part(body, part_s, self.parts - part, state);
        }
        state.steps += 1;
        let mut stepped = Stepped::default();
        let mut squares = 0.0;
        for (particle, (from_m, at_m)) in from_m.iter().zip(&state.positions_m).enumerate() {
            let speed = from_m.distance(*at_m) / self.settings.step_s;
            state.went_m_per_s[particle] = speed;
            if !self.held_m.contains_key(&particle) {
                stepped.fastest_m_per_s = stepped.fastest_m_per_s.max(speed);
                squares += speed * speed;
            }
        }
        stepped.speed_m_per_s = (squares / from_m.len() as f64).sqrt();
        stepped
    }

    /// A division of a step, of which so many are left with this one.
    fn part(&mut self, body: Option<&Body>, part_s: f64, left: u32, state: &mut State) {
        let Settings { drag_per_s, clearance_m, gravity_m_per_s2, .. } = self.settings;
        self.forces_n.fill(DVec3::Y * (gravity_m_per_s2 * self.mass_kg));
        for Spring { ends: [a, b], rest_m, n_per_m } in &self.springs {
            let way = state.positions_m[*b] - state.positions_m[*a];
            let length_m = way.length();
            if length_m > 0.0 {
                let force_n = way * (n_per_m * (length_m - rest_m) / length_m);
                self.forces_n[*a] += force_n;
                self.forces_n[*b] -= force_n;
            }
        }
        let per_n = part_s * part_s / self.mass_kg;
        let alpha = (1.0 - drag_per_s * part_s).max(0.0);
        for (particle, at_m) in state.positions_m.iter_mut().enumerate() {
            let from_m = *at_m;
            if let Some(to_m) = self.held_m.get(&particle) {
                *at_m += (*to_m - from_m) / f64::from(left);
            } else {
                let way = state.velocities_m_per_s[particle] * (alpha * part_s) + self.forces_n[particle] * per_n;
                *at_m += way.clamp_length_max(0.5 * clearance_m);
                if let Some(near) = body.and_then(|body| body.signed_distance(*at_m, clearance_m)) {
                    *at_m += near.normal * (clearance_m - near.distance_m);
                }
            }
            state.velocities_m_per_s[particle] = (*at_m - from_m) / part_s;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sheet::Grid;

    #[test]
    fn a_thread_of_cells_hangs_as_long_as_its_springs_and_weights_say() {
        // A ladder of two columns, held above: each rung hangs on springs that carry what is below.
        let rows = 6;
        let grid = Grid { rows, columns: 2, spacing_m: 0.05, corner_m: DVec3::Y, weft: DVec3::X, warp: DVec3::NEG_Y };
        let sheet = Sheet::from_grid(&grid).unwrap();
        let settings = Settings { bias_n_per_m: 0.0, drag_per_s: 8.0, ..Settings::default() };
        let mut springs = Springs::new(&sheet, &settings).unwrap();
        let count = sheet.positions_m().len();
        let mut state = State {
            positions_m: sheet.positions_m().to_vec(),
            velocities_m_per_s: vec![DVec3::ZERO; count],
            steps: 0,
            went_m_per_s: vec![0.0; count],
        };
        [0, 1].into_iter().for_each(|top| springs.hold(top, state.positions_m[top]));
        for _ in 0..1200 {
            springs.step(None, &mut state);
        }
        let weight_n = 0.15 * sheet.area_m2() / count as f64 * 9.80665;
        let mut wanted_m = 1.0;
        for row in 1..rows {
            wanted_m -= 0.05 + weight_n * (rows - row) as f64 / 20.0;
            let at_m = state.positions_m[2 * row].y;
            assert!((at_m - wanted_m).abs() < 1e-6, "{row}: {at_m} {wanted_m}");
        }
    }
}
