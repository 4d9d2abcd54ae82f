//! The solver that makes shapes for production: woven cloth in SI units on a body that may move, in small steps of extended position based
//! dynamics, with Coulomb friction. Between two looks for what is near, each particle keeps to its room, so that cloth that was clear of itself
//! stays clear whatever happens. Knows no garments and no files.
//!
//! A step takes its parts: places go on with their velocities, edges and creases, cloth against cloth and body and cloth correct them, and
//! velocities are what came of it (Macklin et al., Small Steps in Physics Simulation, 2019). What is near is looked for before a step, again
//! when many particles are at the end of their room, and no more often where neither cloth nor body moves much.

use crate::body::{Body, Near};
use crate::certificate::{Bounds, Certificate, certify};
use crate::contacts::{OF_NEIGHBOURS, Part, Touch};
use crate::fabric::{FabricError, above_zero, at_least_zero};
use crate::links::{self, Crease, Link, flatten, keep_length};
use crate::near_pairs::{Found, NearPair, NearPairs};
use crate::parallel;
use crate::patches::{Patches, Sorted};
use crate::room::Room;
use crate::sheet::{Attachment, Sheet};
use crate::tethers::{Tether, within_m};
use crate::woven::Woven;
use glam::DVec3;
use rayon::prelude::*;

/// How fast the two ends of a thread are drawn together, metres per second.
const SEWN_M_PER_S: f64 = 0.5;
/// Nearer than this many thicknesses, and as far as particles go in a step besides, near pairs are looked for; at most
/// [`FARTHEST_M`], beyond which the step looks again instead.
const REACH: f64 = 2.5;
const FARTHEST_M: f64 = 0.012;
/// Pairs nearer than this many thicknesses, and as far as two particles go in a step besides, are pushed apart.
const PUSH: f64 = 1.5;
/// One particle in so many may wait at the end of its room, or have gone farther than pairs were looked for, before the solver looks again.
const BOUND: usize = 50;
/// A look serves at most so many steps.
const LASTS: u32 = 12;

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
    /// What presses cloth that is near the body onto it, N/m²: hands that smooth it.
    pub pressure_n_per_m2: f64,
    /// How fast cloth that lies too near to something is moved away from it at most, without a velocity, metres per second, above 0. Where hands press
    /// cloth into grooves of a body, which of their sides is nearest changes from look to look; slowly, that moves it less than rest allows.
    pub apart_m_per_s: f64,
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
            pressure_n_per_m2: 0.0,
            apart_m_per_s: 0.1,
            meets_itself: true,
            gravity_m_per_s2: -9.81,
        }
    }
}

/// Parts that a step of 1/60 s needs for cloth with cells so large, metres: the finer, the more, or the cloth stretches.
#[must_use]
pub fn parts_of_frame(cell_m: f64) -> u32 {
    (0.2 / cell_m).clamp(8.0, 24.0) as u32
}

/// A sheet of a woven cloth, ready to be stepped.
#[derive(Clone, Debug)]
pub struct Drape {
    woven: Woven,
    settings: Settings,
    patches: Patches,
    links: Sorted<Link>,
    creases: Sorted<Crease>,
    /// 0 of pinned particles; in the order of the patches. And what it is where they are not pinned.
    inverse_kg: Vec<f64>,
    free_inverse_kg: Vec<f64>,
    /// How far each keeps its neighbours, metres, in the order of the patches.
    apart_m: Vec<f64>,
    /// Places of pinned particles, ascending, and where they go.
    pins_m: Vec<(usize, DVec3)>,
    /// Places of the particles that threads draw together, and those that springs draw somewhere.
    threads: Vec<[usize; 2]>,
    attached: Vec<(usize, Attachment)>,
    /// Places of a particle and of one that is held, and how far the first may be from it, metres.
    tethers: Vec<(usize, usize, f64)>,
    /// Newtons.
    most_pull_n: f64,
    /// As the sheet numbers them.
    triangles: Vec<[u32; 3]>,
    /// In the order of the patches.
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
    /// How far each particle came from where it was in the steps that were taken last, at the most, divided by how long they took, metres per
    /// second: who comes back has moved, too. Nothing goes on from it.
    pub went_m_per_s: Vec<f64>,
}

/// A body at the end of a step.
#[derive(Clone, Copy, Debug)]
pub struct Obstacle<'a> {
    /// Where it is then.
    pub body: &'a Body,
    /// How far each of its vertices went in the step, metres; none stood still.
    pub moves_m: Option<&'a [DVec3]>,
}

/// What is about cloth, and moves.
pub trait Surroundings {
    /// Brings the body and the cloth's pins to where they are at the end of the step that comes after so many. Whether either moves in it.
    fn go(&mut self, drape: &mut Drape, after_steps: u64) -> bool;
    /// The body there.
    fn obstacle(&self) -> Option<Obstacle<'_>>;
}

/// A body that stands still, or none.
impl Surroundings for Option<&Body> {
    fn go(&mut self, _: &mut Drape, _: u64) -> bool {
        false
    }

    fn obstacle(&self) -> Option<Obstacle<'_>> {
        self.map(|body| Obstacle { body, moves_m: None })
    }
}

/// For a step alone.
struct AtOnce<'a>(Option<Obstacle<'a>>);

impl Surroundings for AtOnce<'_> {
    fn go(&mut self, _: &mut Drape, _: u64) -> bool {
        true
    }

    fn obstacle(&self) -> Option<Obstacle<'_>> {
        self.0
    }
}

/// What steps did.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Stepped {
    /// Of the fastest particle that is not pinned, as in [`State::went_m_per_s`], metres per second.
    pub fastest_m_per_s: f64,
    /// Root of the mean squared speed of the cloth's mass, of the same.
    pub speed_m_per_s: f64,
    /// Pairs of cloth near cloth in the last look.
    pub pairs: usize,
    /// Particles near the body.
    pub on_body: usize,
    /// How often near pairs were looked for.
    pub looks: u32,
    /// Particles that wait at the end of their room after the last step.
    pub waiting: usize,
}

/// Places and velocities in the order of the patches.
struct Motion {
    places_m: Vec<DVec3>,
    velocities: Vec<DVec3>,
    /// Room for parts: places before them, with and without what moved particles without a velocity.
    before_m: Vec<DVec3>,
    were_m: Vec<DVec3>,
}

/// What was found near.
struct Look {
    pairs: Vec<NearPair>,
    touches: Vec<Touch>,
    room: Room,
    /// Who goes farther may come near to what was not found.
    slack_m: f64,
    /// Steps that it has served.
    steps: u32,
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
        at_least_zero("pressure_n_per_m2", settings.pressure_n_per_m2)?;
        above_zero("apart_m_per_s", settings.apart_m_per_s)?;
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
        let free_inverse_kg: Vec<f64> =
            patches.particle_at.iter().map(|&particle| 1.0 / masses_kg[particle as usize]).collect();
        let mut inverse_kg = free_inverse_kg.clone();
        let mut pins_m: Vec<(usize, DVec3)> = (sheet.pins().iter().zip(0..))
            .filter_map(|(pin, particle)| pin.map(|to_m| (placed(particle) as usize, to_m)))
            .collect();
        pins_m.sort_by_key(|pin| pin.0);
        pins_m.iter().for_each(|pin| inverse_kg[pin.0] = 0.0);
        let heights_m = links::heights_m(sheet);
        let places_m: Vec<DVec3> =
            patches.particle_at.iter().map(|&particle| sheet.positions_m()[particle as usize]).collect();
        let placed_triangles: Vec<[u32; 3]> = sheet.triangles().iter().map(|corners| corners.map(placed)).collect();
        let apart_m = patches.particle_at.iter().map(|&particle| OF_NEIGHBOURS * heights_m[particle as usize]);
        Ok(Drape {
            apart_m: apart_m.collect(),
            woven: *woven,
            settings: *settings,
            links,
            creases,
            inverse_kg,
            free_inverse_kg,
            pins_m,
            threads: sheet.pairs().iter().map(|pair| pair.map(|end| placed(end) as usize)).collect(),
            attached: sheet.attachments().iter().map(|&one| (placed(one.particle) as usize, one)).collect(),
            tethers: Vec::new(),
            most_pull_n: f64::INFINITY,
            triangles: sheet.triangles().to_vec(),
            near_pairs: NearPairs::new(&places_m, &placed_triangles),
            patches,
        })
    }

    /// The cloth where its sheet is, at rest.
    #[must_use]
    pub fn state(&self, sheet: &Sheet) -> State {
        let positions_m = sheet.positions_m().to_vec();
        let count = positions_m.len();
        State { positions_m, velocities_m_per_s: vec![DVec3::ZERO; count], steps: 0, went_m_per_s: vec![0.0; count] }
    }

    /// Where a pinned particle goes in the next step, as far as its room allows; of others, nothing changes.
    pub fn move_pin(&mut self, particle: usize, to_m: DVec3) {
        let place = self.patches.place_of[particle] as usize;
        if let Ok(pin) = self.pins_m.binary_search_by_key(&place, |pin| pin.0) {
            self.pins_m[pin].1 = to_m;
        }
    }

    /// Holds a particle at a place from the next step on, whatever draws it.
    pub fn hold(&mut self, particle: usize, to_m: DVec3) {
        let place = self.patches.place_of[particle] as usize;
        match self.pins_m.binary_search_by_key(&place, |pin| pin.0) {
            Ok(pin) => self.pins_m[pin].1 = to_m,
            Err(pin) => self.pins_m.insert(pin, (place, to_m)),
        }
        self.inverse_kg[place] = 0.0;
    }

    /// Lets a particle go that was held or pinned.
    pub fn let_go(&mut self, particle: usize) {
        let place = self.patches.place_of[particle] as usize;
        if let Ok(pin) = self.pins_m.binary_search_by_key(&place, |pin| pin.0) {
            self.pins_m.remove(pin);
        }
        self.inverse_kg[place] = self.free_inverse_kg[place];
    }

    /// Replaces all springs that draw particles somewhere; none draws harder than `most_n`, newtons.
    pub fn attach(&mut self, attachments: &[Attachment], most_n: f64) {
        let placed = |particle: u32| self.patches.place_of[particle as usize] as usize;
        self.attached = attachments.iter().map(|&one| (placed(one.particle), one)).collect();
        self.most_pull_n = most_n;
    }

    /// Replaces all tethers.
    pub fn tether(&mut self, tethers: &[Tether]) {
        let placed = |particle: u32| self.patches.place_of[particle as usize] as usize;
        self.tethers = tethers.iter().map(|one| (placed(one.particle), placed(one.held), one.far_m)).collect();
        self.tethers.sort_by_key(|one| (one.0, one.1));
    }

    /// How it steps.
    #[must_use]
    pub fn settings(&self) -> &Settings {
        &self.settings
    }

    /// What air takes from velocities from the next step on, 1/s.
    pub fn set_drag(&mut self, per_s: f64) {
        self.settings.drag_per_s = per_s;
    }

    /// One step, of a body that may be anywhere else in the next.
    ///
    /// # Panics
    /// As [`Drape::advance`].
    pub fn step(&mut self, obstacle: Option<Obstacle>, state: &mut State) -> Stepped {
        self.advance(1, &mut AtOnce(obstacle), state)
    }

    /// So many steps. What goes on from a state saved after them is the same as if they had been more, only if those were taken in as many at
    /// once: each call looks anew for what is near.
    ///
    /// # Panics
    /// When the state has more or fewer particles than the sheet, or the body's moves another number than its vertices.
    pub fn advance(&mut self, steps: u32, around: &mut dyn Surroundings, state: &mut State) -> Stepped {
        let count = self.patches.particle_at.len();
        assert_eq!([state.positions_m.len(), state.velocities_m_per_s.len()], [count; 2], "a place to each particle");
        let in_patches = |of: &[DVec3]| -> Vec<DVec3> {
            self.patches.particle_at.iter().map(|&particle| of[particle as usize]).collect()
        };
        let from_m = in_patches(&state.positions_m);
        let mut motion = Motion {
            velocities: in_patches(&state.velocities_m_per_s),
            before_m: from_m.clone(),
            were_m: from_m.clone(),
            places_m: from_m.clone(),
        };
        let mut farthest_m2 = vec![0.0_f64; count];
        let mut look = None;
        let mut stepped = Stepped::default();
        for _ in 0..steps {
            if around.go(self, state.steps) {
                look = None;
            }
            look = self.one_step(around.obstacle(), look, &mut motion, &mut stepped);
            state.steps += 1;
            for (farthest_m2, (from_m, at_m)) in farthest_m2.iter_mut().zip(from_m.iter().zip(&motion.places_m)) {
                *farthest_m2 = farthest_m2.max(from_m.distance_squared(*at_m));
            }
        }
        let seconds = self.settings.step_s * f64::from(steps.max(1));
        let (mut energy, mut mass) = (0.0, 0.0);
        for (place, &particle) in self.patches.particle_at.iter().enumerate() {
            let particle = particle as usize;
            state.positions_m[particle] = motion.places_m[place];
            state.velocities_m_per_s[particle] = motion.velocities[place];
            state.went_m_per_s[particle] = farthest_m2[place].sqrt() / seconds;
            if self.inverse_kg[place] > 0.0 {
                let speed = state.went_m_per_s[particle];
                stepped.fastest_m_per_s = stepped.fastest_m_per_s.max(speed);
                energy += speed * speed / self.inverse_kg[place];
                mass += 1.0 / self.inverse_kg[place];
            }
        }
        stepped.speed_m_per_s = (energy / f64::max(mass, f64::MIN_POSITIVE)).sqrt();
        stepped
    }

    /// One step with what was found before it, if that still serves; what serves the next one.
    fn one_step(
        &mut self,
        obstacle: Option<Obstacle>,
        mut look: Option<Look>,
        motion: &mut Motion,
        stepped: &mut Stepped,
    ) -> Option<Look> {
        let parts = self.settings.parts;
        for part in 0..parts {
            let left = parts - part;
            let near = look.take().unwrap_or_else(|| {
                stepped.looks += 1;
                self.look(obstacle, motion, left)
            });
            stepped.waiting = self.part(&near, motion, left);
            stepped.pairs = near.pairs.len();
            stepped.on_body = near.touches.len();
            if stepped.waiting * BOUND <= motion.places_m.len() {
                look = Some(near);
            }
        }
        let mut look = look?;
        look.steps += 1;
        let slack_m2 = look.slack_m * look.slack_m;
        let strayed = (motion.places_m.iter().enumerate())
            .filter(|(place, at_m)| look.room.from_m(*place).distance_squared(**at_m) > slack_m2)
            .count();
        (look.steps < LASTS && strayed * BOUND <= motion.places_m.len()).then_some(look)
    }

    /// A part of a step, of which so many are left with this one; how many particles wait at the end of their room.
    fn part(&self, look: &Look, motion: &mut Motion, left: u32) -> usize {
        let parts = f64::from(self.settings.parts);
        let part_s = self.settings.step_s / parts;
        let drag = 1.0 / (1.0 + self.settings.drag_per_s * part_s);
        let fall = DVec3::Y * (self.settings.gravity_m_per_s2 * part_s);
        let Motion { places_m, velocities, before_m, were_m } = motion;
        let press = self.settings.pressure_n_per_m2 / self.woven.mass_kg_per_m2 * part_s;
        for touch in look.touches.iter().filter(|_| press > 0.0) {
            velocities[touch.place as usize] -= touch.normal * press;
        }
        were_m.copy_from_slice(places_m);
        before_m.copy_from_slice(places_m);
        for (place, at_m) in places_m.iter_mut().enumerate() {
            if self.inverse_kg[place] > 0.0 {
                velocities[place] = (velocities[place] + fall) * drag;
                *at_m += velocities[place] * part_s;
            }
        }
        for &(place, to_m) in &self.pins_m {
            let way = to_m - places_m[place];
            places_m[place] += way / f64::from(left);
        }
        self.keep_together(places_m, part_s);
        self.sew(places_m, before_m, part_s);
        for &(place, held, far_m) in &self.tethers {
            if self.inverse_kg[place] > 0.0 {
                places_m[place] = within_m(places_m[place], places_m[held], far_m);
            }
        }
        let mut now = Part {
            places_m,
            before_m,
            were_m,
            inverse_kg: &self.inverse_kg,
            part_s,
            apart_m_per_s: self.settings.apart_m_per_s,
            way_left: f64::from(left - 1) / parts,
            way_now: 1.0 / parts,
        };
        for pair in &look.pairs {
            now.keep_apart(pair, self.woven.thickness_m, &self.apart_m, self.woven.friction);
        }
        for touch in &look.touches {
            now.keep_off(touch, self.settings.clearance_m, self.woven.body_friction);
        }
        let mut waiting = 0;
        for (place, at_m) in places_m.iter_mut().enumerate() {
            if let Some(instead_m) = look.room.instead_m(place, *at_m) {
                waiting += 1;
                *at_m = instead_m;
            }
            velocities[place] = (*at_m - before_m[place]) / part_s;
        }
        waiting
    }

    /// Looks for what is near, when so many parts of the step are left.
    fn look(&mut self, obstacle: Option<Obstacle>, motion: &Motion, left: u32) -> Look {
        let Settings { step_s, parts, clearance_m, deepest_m, .. } = self.settings;
        let places_m = &motion.places_m;
        let ahead_s = step_s * f64::from(left) / f64::from(parts);
        // Of all but the few that may wait: whoever is thrown does not decide how far all others look.
        let mut speeds2: Vec<f64> = motion.velocities.iter().map(|velocity| velocity.length_squared()).collect();
        let few = speeds2.len() / BOUND;
        let goes_m = speeds2.select_nth_unstable_by(few, |a, b| b.total_cmp(a)).1.sqrt() * ahead_s;
        let thickness_m = self.woven.thickness_m;
        let reach_m = (REACH * thickness_m + 2.5 * goes_m).min(FARTHEST_M.max(REACH * thickness_m));
        let push_m = (PUSH * thickness_m + 2.0 * goes_m).min(reach_m);
        let found = if self.settings.meets_itself {
            self.near_pairs.find(places_m, reach_m, push_m)
        } else {
            Found { farthest_m: f64::INFINITY, ..Found::default() }
        };
        let mut touches = Vec::new();
        if let Some(Obstacle { body, moves_m }) = obstacle {
            let within_m = clearance_m + reach_m;
            let moves_m = moves_m.map(|moves_m| body.also_middles(moves_m));
            touches = parallel::collect(places_m.len(), |place, touches: &mut Vec<Touch>| {
                let at_m = places_m[place];
                let deep = || body.contains(at_m).then(|| body.signed_distance(at_m, deepest_m)).flatten();
                if self.inverse_kg[place] > 0.0
                    && let Some(near) = body.signed_distance(at_m, within_m).or_else(deep)
                {
                    let Near { normal, place_m: at_m, triangle, shares, .. } = near;
                    let move_m = moves_m.as_ref().map_or(DVec3::ZERO, |moves_m| {
                        let corners = body.surface().triangles()[triangle as usize];
                        (0..3).map(|i| moves_m[corners[i] as usize] * shares[i]).sum()
                    });
                    touches.push(Touch { place: place as u32, at_m, move_m, normal });
                }
            });
        }
        Look {
            pairs: found.pairs,
            touches,
            room: Room::new(places_m, found.farthest_m, &found.sides),
            slack_m: 0.5 * (push_m - thickness_m),
            steps: 0,
        }
    }

    /// One pass over edges and creases, patches side by side, then what crosses them. Always in the same order: passes that go to and fro have
    /// two different ends, and cloth would never rest.
    fn keep_together(&self, places_m: &mut [DVec3], part_s: f64) {
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
            let per_n = self.inverse_kg[place] * part_s * part_s;
            let way = place_m - places_m[place];
            let pull = way * (stiffness_n_per_m / (1.0 + per_n * stiffness_n_per_m));
            places_m[place] += pull.clamp_length_max(self.most_pull_n) * per_n;
        }
    }

    /// Whether the cloth rests.
    #[must_use]
    pub fn certify(&self, body: Option<&Body>, bounds: Bounds, state: &State) -> Certificate {
        certify(&state.positions_m, &state.went_m_per_s, &self.triangles, body, bounds)
    }
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
