//! The solver that makes shapes for production: woven cloth in SI units on a body that may move, in small steps of extended position based
//! dynamics, with Coulomb friction. Between two looks for near pairs no particle goes farther than its bound, so that cloth that was
//! clear of itself stays clear whatever happens. Knows no garments and no files.
//!
//! Each step looks once for what is near the cloth, then takes its parts: places go on with their velocities, edges and creases, cloth against
//! cloth and body and cloth correct them, and velocities are what came of it (Macklin et al., Small Steps in Physics Simulation, 2019).
//! Particles that come to their bounds wait there; if they are many, the step looks again.

use crate::body::{Body, Near};
use crate::certificate::{Bounds, Certificate, certify};
use crate::fabric::{FabricError, above_zero, at_least_zero};
use crate::links::{self, Crease, Link, flatten, keep_length};
use crate::near_pairs::{Found, NearPair, NearPairs};
use crate::parallel;
use crate::patches::{Patches, Sorted};
use crate::sheet::{Attachment, Sheet};
use crate::woven::Woven;
use glam::DVec3;
use rayon::prelude::*;

/// How fast cloth that lies too near to something is moved away from it at most, metres per second; and the share of what is missing in a part
/// of a step, so that it settles instead of being thrown to and fro.
const APART_M_PER_S: f64 = 0.1;
const APART: f64 = 0.1;
/// How fast the two ends of a thread are drawn together, metres per second.
const SEWN_M_PER_S: f64 = 0.5;
/// Nearer than this many thicknesses, and as far as particles go in a step besides, near pairs are looked for; at most
/// [`FARTHEST_M`], beyond which the step looks again instead.
const REACH: f64 = 2.0;
const FARTHEST_M: f64 = 0.012;
/// Pairs nearer than this many thicknesses, and as far as two particles go in a step besides, are pushed apart.
const PUSH: f64 = 1.1;
/// Neighbours in the mesh keep this share of the thickness only, and of the height of their triangles: their edge holds them apart already.
const OF_NEIGHBOURS: f64 = 0.3;
/// One particle in so many may wait at its bound before the step looks again.
const BOUND: usize = 200;

/// How the solver steps.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Settings {
    /// Simulated seconds of a step, above 0.
    pub step_s: f64,
    /// Parts of a step, each with one pass over all constraints; more make the cloth stretch less. At least 1.
    pub parts: u32,
    /// Share of its velocity that a particle loses to the air each second, 1/s, at least 0.
    pub drag_per_s: f64,
    /// Distance of the cloth's middle from the body, metres, above 0.
    pub clearance_m: f64,
    /// How deep in the body a particle may be and still be brought out, metres, at least 0.
    pub deepest_m: f64,
    /// Whether cloth keeps clear of itself; without, a step is faster.
    pub meets_itself: bool,
    /// Metres per second squared, along Y.
    pub gravity_m_per_s2: f64,
}

impl Default for Settings {
    fn default() -> Settings {
        Settings {
            step_s: 1.0 / 600.0,
            parts: 4,
            drag_per_s: 2.0,
            clearance_m: 0.004,
            deepest_m: 0.02,
            meets_itself: true,
            gravity_m_per_s2: -9.81,
        }
    }
}

/// A sheet of a woven cloth, ready to be stepped.
#[derive(Clone, Debug)]
pub struct Drape {
    woven: Woven,
    settings: Settings,
    patches: Patches,
    links: Sorted<Link>,
    creases: Sorted<Crease>,
    /// 0 of pinned particles; in the order of the patches.
    inverse_kg: Vec<f64>,
    /// How far each keeps its neighbours, metres, in the order of the patches.
    apart_m: Vec<f64>,
    pins_m: Vec<Option<DVec3>>,
    /// Places of the particles that threads draw together, and those that springs draw somewhere.
    threads: Vec<[usize; 2]>,
    attached: Vec<(usize, Attachment)>,
    /// As the sheet numbers them.
    triangles: Vec<[u32; 3]>,
    near_pairs: NearPairs,
}

/// Cloth in motion; all that a step goes on from, so that a saved state goes on with the same bytes.
#[derive(Clone, Debug, PartialEq)]
pub struct State {
    /// As the sheet numbers them.
    pub positions_m: Vec<DVec3>,
    /// Metres per second, with which the next part of a step begins. Cloth that constraints hold between each other has some at rest.
    pub velocities_m_per_s: Vec<DVec3>,
    /// Steps that were taken.
    pub steps: u64,
    /// How each particle went in the last step, or in as long as a caller looks at, metres per second; nothing goes on from it.
    pub went_m_per_s: Vec<DVec3>,
}

/// A body at the end of a step.
#[derive(Clone, Copy, Debug)]
pub struct Obstacle<'a> {
    /// Where it is then.
    pub body: &'a Body,
    /// How far each of its vertices went in the step, metres; none stood still.
    pub moves_m: Option<&'a [DVec3]>,
}

/// What a step did.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Stepped {
    /// Of the fastest particle that is not pinned, over the whole step, metres per second.
    pub fastest_m_per_s: f64,
    /// Root of the mean squared speed of the cloth's mass.
    pub speed_m_per_s: f64,
    /// Pairs of cloth near cloth in the last look.
    pub pairs: usize,
    /// Particles near the body.
    pub on_body: usize,
    /// How often near pairs were looked for.
    pub looks: u32,
    /// Particles that wait at their bound at the end.
    pub waiting: usize,
}

/// A particle near a body.
#[derive(Clone, Copy, Debug)]
struct Touch {
    place: u32,
    /// A place of the body's surface at the end of the step, and how far it goes in the step, metres.
    at_m: DVec3,
    move_m: DVec3,
    normal: DVec3,
}

impl Drape {
    /// # Errors
    /// When a constant of the cloth or a setting is not in its range.
    pub fn new(sheet: &Sheet, woven: &Woven, settings: &Settings) -> Result<Drape, FabricError> {
        woven.check()?;
        above_zero("step_s", settings.step_s)?;
        above_zero("parts", f64::from(settings.parts))?;
        at_least_zero("drag_per_s", settings.drag_per_s)?;
        above_zero("clearance_m", settings.clearance_m)?;
        at_least_zero("deepest_m", settings.deepest_m)?;
        at_least_zero("gravity_m_per_s2", settings.gravity_m_per_s2.abs())?;
        let patches = Patches::of(sheet.positions_m());
        let placed = |particle: u32| patches.place_of[particle as usize];
        let links: Vec<Link> =
            links::links(sheet, woven).into_iter().map(|link| Link { ends: link.ends.map(placed), ..link }).collect();
        let creases: Vec<Crease> = links::creases(sheet, woven)
            .into_iter()
            .map(|crease| Crease { corners: crease.corners.map(placed), ..crease })
            .collect();
        let links =
            patches.sorted(&links, |link| link.ends, |link, by| Link { ends: link.ends.map(|end| end - by), ..*link });
        let creases = patches.sorted(
            &creases,
            |crease| crease.corners,
            |crease, by| Crease { corners: crease.corners.map(|corner| corner - by), ..*crease },
        );
        let masses_kg = links::masses_kg(sheet, woven);
        let inverse_kg = patches.particle_at.iter().map(|&particle| {
            let particle = particle as usize;
            if sheet.pins()[particle].is_some() { 0.0 } else { 1.0 / masses_kg[particle] }
        });
        let heights_m = links::heights_m(sheet);
        let apart_m = patches.particle_at.iter().map(|&particle| OF_NEIGHBOURS * heights_m[particle as usize]);
        Ok(Drape {
            apart_m: apart_m.collect(),
            woven: *woven,
            settings: *settings,
            links,
            creases,
            inverse_kg: inverse_kg.collect(),
            pins_m: sheet.pins().to_vec(),
            threads: sheet.pairs().iter().map(|pair| pair.map(|end| placed(end) as usize)).collect(),
            attached: sheet.attachments().iter().map(|&one| (placed(one.particle) as usize, one)).collect(),
            triangles: sheet.triangles().to_vec(),
            near_pairs: NearPairs::new(sheet.positions_m(), sheet.triangles()),
            patches,
        })
    }

    /// The cloth where its sheet is, at rest.
    #[must_use]
    pub fn state(&self, sheet: &Sheet) -> State {
        let positions_m = sheet.positions_m().to_vec();
        let still = vec![DVec3::ZERO; positions_m.len()];
        State { velocities_m_per_s: still.clone(), went_m_per_s: still, positions_m, steps: 0 }
    }

    /// Where a pinned particle goes in the next step, as far as its bound allows; of others, nothing changes.
    pub fn move_pin(&mut self, particle: usize, to_m: DVec3) {
        if let Some(pin) = &mut self.pins_m[particle] {
            *pin = to_m;
        }
    }

    /// What air takes from velocities from the next step on, 1/s.
    pub fn set_drag(&mut self, per_s: f64) {
        self.settings.drag_per_s = per_s;
    }

    /// One step.
    ///
    /// # Panics
    /// When the state has more or fewer particles than the sheet, or the body's moves another number than its vertices.
    pub fn step(&mut self, obstacle: Option<Obstacle>, state: &mut State) -> Stepped {
        let parts = self.settings.parts;
        let part_s = self.settings.step_s / f64::from(parts);
        let in_patches = |of: &[DVec3]| -> Vec<DVec3> {
            self.patches.particle_at.iter().map(|&particle| of[particle as usize]).collect()
        };
        let mut places_m = in_patches(&state.positions_m);
        let mut velocities = in_patches(&state.velocities_m_per_s);
        let pins: Vec<(usize, DVec3)> = self
            .patches
            .particle_at
            .iter()
            .enumerate()
            .filter_map(|(place, &particle)| self.pins_m[particle as usize].map(|to_m| (place, to_m)))
            .collect();
        let mut before_m = places_m.clone();
        let mut were_m = places_m.clone();
        let mut looked = None;
        let mut stepped = Stepped::default();
        for part in 0..parts {
            let left = parts - part;
            let Look { found, touches, from_m } = match looked.take() {
                Some(look) => look,
                None => {
                    stepped.looks += 1;
                    self.look(obstacle, &places_m, &velocities, left)
                }
            };
            let drag = 1.0 / (1.0 + self.settings.drag_per_s * part_s);
            let fall = DVec3::Y * (self.settings.gravity_m_per_s2 * part_s);
            were_m.copy_from_slice(&places_m);
            before_m.copy_from_slice(&places_m);
            for place in 0..places_m.len() {
                if self.inverse_kg[place] > 0.0 {
                    velocities[place] = (velocities[place] + fall) * drag;
                    places_m[place] += velocities[place] * part_s;
                }
            }
            for &(place, to_m) in &pins {
                let way = to_m - places_m[place];
                places_m[place] += way / f64::from(left);
            }
            self.hold(&mut places_m, part_s);
            self.sew(&mut places_m, &before_m, part_s);
            for pair in &found.pairs {
                self.keep_apart(pair, &mut places_m, &mut before_m, part_s);
            }
            for touch in &touches {
                let share = f64::from(left - 1) / f64::from(parts);
                let (share_now, were_m) = (1.0 / f64::from(parts), were_m[touch.place as usize]);
                self.keep_off(touch, [share, share_now], were_m, &mut places_m, &mut before_m, part_s);
            }
            let mut bound = 0;
            for (place, at_m) in places_m.iter_mut().enumerate() {
                let way = *at_m - from_m[place];
                let bound_m = found.bounds_m[place];
                if way.length_squared() > bound_m * bound_m {
                    bound += 1;
                    *at_m = from_m[place] + way * (bound_m / way.length());
                }
                velocities[place] = (*at_m - before_m[place]) / part_s;
            }
            stepped.waiting = bound;
            stepped.pairs = found.pairs.len();
            stepped.on_body = touches.len();
            if bound * BOUND <= places_m.len() {
                looked = Some(Look { found, touches, from_m });
            }
        }
        let (mut energy, mut mass) = (0.0, 0.0);
        for (place, &particle) in self.patches.particle_at.iter().enumerate() {
            let went = (places_m[place] - state.positions_m[particle as usize]) / self.settings.step_s;
            state.positions_m[particle as usize] = places_m[place];
            state.velocities_m_per_s[particle as usize] = velocities[place];
            state.went_m_per_s[particle as usize] = went;
            if self.inverse_kg[place] > 0.0 {
                let squared = went.length_squared();
                stepped.fastest_m_per_s = stepped.fastest_m_per_s.max(squared.sqrt());
                energy += squared / self.inverse_kg[place];
                mass += 1.0 / self.inverse_kg[place];
            }
        }
        stepped.speed_m_per_s = (energy / f64::max(mass, f64::MIN_POSITIVE)).sqrt();
        state.steps += 1;
        stepped
    }

    /// Looks for what is near.
    fn look(&mut self, obstacle: Option<Obstacle>, places_m: &[DVec3], velocities: &[DVec3], left: u32) -> Look {
        let Settings { step_s, parts, clearance_m, deepest_m, .. } = self.settings;
        let ahead_s = step_s * f64::from(left) / f64::from(parts);
        let mut fastest = 0.0_f64;
        let mut in_sheet_m = vec![DVec3::ZERO; places_m.len()];
        for (place, &particle) in self.patches.particle_at.iter().enumerate() {
            in_sheet_m[particle as usize] = places_m[place];
            fastest = fastest.max(velocities[place].length_squared());
        }
        let goes_m = fastest.sqrt() * ahead_s;
        let thickness_m = self.woven.thickness_m;
        let reach_m = (REACH * thickness_m + 2.5 * goes_m).min(FARTHEST_M.max(REACH * thickness_m));
        // What is farther apart comes no nearer than the thickness before the next look, or waits at its bound.
        let push_m = (PUSH * thickness_m + 2.0 * goes_m).min(reach_m);
        let free = || Found { pairs: Vec::new(), bounds_m: vec![f64::INFINITY; places_m.len()] };
        let found =
            if self.settings.meets_itself { self.near_pairs.find(&in_sheet_m, reach_m, push_m) } else { free() };
        let Found { mut pairs, bounds_m } = found;
        for pair in &mut pairs {
            pair.corners = pair.corners.map(|particle| self.patches.place_of[particle as usize]);
        }
        let bounds_m = self.patches.particle_at.iter().map(|&particle| bounds_m[particle as usize]).collect();
        let mut touches = Vec::new();
        if let Some(Obstacle { body, moves_m }) = obstacle {
            let within_m = clearance_m + reach_m;
            touches = parallel::collect(places_m.len(), |place, touches: &mut Vec<Touch>| {
                let at_m = places_m[place];
                let deep = || body.contains(at_m).then(|| body.signed_distance(at_m, deepest_m)).flatten();
                if self.inverse_kg[place] > 0.0
                    && let Some(near) = body.signed_distance(at_m, within_m).or_else(deep)
                {
                    let Near { normal, place_m: at_m, triangle, shares, .. } = near;
                    let move_m = moves_m.map_or(DVec3::ZERO, |moves_m| {
                        let corners = body.surface().triangles()[triangle as usize];
                        (0..3)
                            .map(|i| moves_m.get(corners[i] as usize).copied().unwrap_or(DVec3::ZERO) * shares[i])
                            .sum()
                    });
                    touches.push(Touch { place: place as u32, at_m, move_m, normal });
                }
            });
        }
        Look { found: Found { pairs, bounds_m }, touches, from_m: places_m.to_vec() }
    }

    /// One pass over edges and creases, patches side by side, then what crosses them. Always in the same order: passes that go to and fro have
    /// two different ends, and cloth would never rest.
    fn hold(&self, places_m: &mut [DVec3], part_s: f64) {
        let per_s2 = 1.0 / (part_s * part_s);
        let mut work: Vec<(usize, &mut [DVec3])> = self.patches.slices(places_m).into_iter().enumerate().collect();
        work.par_iter_mut().for_each(|(patch, places_m)| {
            let inverse_kg = &self.inverse_kg[self.patches.starts[*patch] as usize..];
            self.links.inner[*patch].iter().for_each(|link| keep_length(link, places_m, inverse_kg, per_s2));
            self.creases.inner[*patch].iter().for_each(|crease| flatten(crease, places_m, inverse_kg, per_s2));
        });
        self.links.crossing.iter().for_each(|link| keep_length(link, places_m, &self.inverse_kg, per_s2));
        self.creases.crossing.iter().for_each(|crease| flatten(crease, places_m, &self.inverse_kg, per_s2));
    }

    /// Threads come together at their speed until they are as near as layers lie; attachments pull.
    fn sew(&self, places_m: &mut [DVec3], before_m: &[DVec3], part_s: f64) {
        for &[a, b] in &self.threads {
            let share = self.inverse_kg[a] + self.inverse_kg[b];
            let way = places_m[b] - places_m[a];
            let length_m = way.length();
            let before_m = before_m[a].distance(before_m[b]);
            let wanted_m = (before_m - SEWN_M_PER_S * part_s).max(self.woven.thickness_m);
            if share > 0.0 && length_m > wanted_m {
                let step = way * ((length_m - wanted_m) / (length_m * share));
                places_m[a] += step * self.inverse_kg[a];
                places_m[b] -= step * self.inverse_kg[b];
            }
        }
        for &(place, Attachment { place_m, stiffness_n_per_m, .. }) in &self.attached {
            let per_n = self.inverse_kg[place] * part_s * part_s * stiffness_n_per_m;
            let way = place_m - places_m[place];
            places_m[place] += way * (per_n / (1.0 + per_n));
        }
    }

    /// Cloth against cloth: what is nearer than the thickness goes apart, and rubs.
    fn keep_apart(&self, pair: &NearPair, places_m: &mut [DVec3], before_m: &mut [DVec3], part_s: f64) {
        let corners = pair.corners.map(|corner| corner as usize);
        let across = |of: &[DVec3]| -> DVec3 { (0..4).map(|i| of[corners[i]] * pair.weights[i]).sum() };
        let now = across(places_m);
        let thickness_m = if pair.are_neighbours {
            corners.iter().map(|&corner| self.apart_m[corner]).fold(OF_NEIGHBOURS * self.woven.thickness_m, f64::min)
        } else {
            self.woven.thickness_m
        };
        let missing_m = thickness_m - now.dot(pair.normal);
        if missing_m <= 0.0 {
            return;
        }
        let then = across(before_m);
        // What was too near before is moved apart slowly and without a velocity.
        let old_m = (thickness_m - then.dot(pair.normal)).clamp(0.0, missing_m);
        let apart_m = (APART * old_m).min(APART_M_PER_S * part_s);
        let push_m = missing_m - old_m + apart_m;
        let share: f64 = (0..4).map(|i| self.inverse_kg[corners[i]] * pair.weights[i] * pair.weights[i]).sum();
        if share <= 0.0 {
            return;
        }
        let slide = now - then;
        let slide = slide - pair.normal * slide.dot(pair.normal);
        let slid_m = slide.length();
        let stop = if slid_m > 0.0 { (self.woven.friction * (push_m - apart_m) / slid_m).min(1.0) } else { 0.0 };
        for i in 0..4 {
            let weight = self.inverse_kg[corners[i]] * pair.weights[i] / share;
            places_m[corners[i]] += (pair.normal * push_m - slide * stop) * weight;
            before_m[corners[i]] += pair.normal * (apart_m * weight);
        }
    }

    /// Cloth against the body, which has `share_left` of its way in this step before it and goes by `share_now` in this part, at whose begin the
    /// particle was at `was_m`.
    fn keep_off(
        &self,
        touch: &Touch,
        [share_left, share_now]: [f64; 2],
        was_m: DVec3,
        places_m: &mut [DVec3],
        before_m: &mut [DVec3],
        part_s: f64,
    ) {
        let place = touch.place as usize;
        let surface_m = touch.at_m - touch.move_m * share_left;
        let missing_m = self.settings.clearance_m - (places_m[place] - surface_m).dot(touch.normal);
        if missing_m <= 0.0 {
            return;
        }
        let then_m = surface_m - touch.move_m * share_now;
        // Other layers moved it without a velocity; not into the body.
        before_m[place] += touch.normal * (was_m - before_m[place]).dot(touch.normal).max(0.0);
        let old_m = (self.settings.clearance_m - (was_m - then_m).dot(touch.normal)).clamp(0.0, missing_m);
        let apart_m = (APART * old_m).min(APART_M_PER_S * part_s);
        let push_m = missing_m - old_m + apart_m;
        let slide = places_m[place] - before_m[place] - touch.move_m * share_now;
        let slide = slide - touch.normal * slide.dot(touch.normal);
        let slid_m = slide.length();
        let stop = if slid_m > 0.0 { (self.woven.body_friction * (push_m - apart_m) / slid_m).min(1.0) } else { 0.0 };
        places_m[place] += touch.normal * push_m - slide * stop;
        before_m[place] += touch.normal * apart_m;
    }

    /// Whether the cloth rests.
    #[must_use]
    pub fn certify(&self, body: Option<&Body>, bounds: Bounds, state: &State) -> Certificate {
        certify(&state.positions_m, &state.went_m_per_s, &self.triangles, body, bounds)
    }
}

/// What a look found, and from where bounds count.
struct Look {
    found: Found,
    touches: Vec<Touch>,
    from_m: Vec<DVec3>,
}

/// Mean and largest strain of edges along warp and weft (|length / rest - 1|); bias edges shear and are left out.
#[must_use]
pub fn strain(sheet: &Sheet, positions_m: &[DVec3]) -> (f64, f64) {
    let (mut sum, mut most, mut count) = (0.0, 0.0_f64, 0);
    for edge in sheet.edges().iter().filter(|edge| edge.grain.abs() > 0.9) {
        let [a, b] = edge.ends.map(|end| positions_m[end as usize]);
        let strain = (a.distance(b) / edge.rest_m - 1.0).abs();
        sum += strain;
        most = most.max(strain);
        count += 1;
    }
    (sum / f64::from(count.max(1)), most)
}
