//! Cloth under two hands (Shoda 2018, chapter 3): state and operations, in any order, one hand while the other does something else. What a hand holds goes with it, but
//! never faster than hands work nor farther from what else is held than the cloth between is long, so that nothing a hand does (jumps of a metre, places that are no
//! numbers, frames without it) tears or throws the cloth. Knows no sensors, no files and no clock.

use crate::body::Body;
use crate::drape::{self, Drape, State, Stepped};
use crate::fabric::{FabricError, above_zero};
use crate::intersections::self_intersections;
use crate::parting::{Blade, PartError, Parted, part};
use crate::scissors::{Layers, lines_on};
use crate::sheet::{Sheet, SheetError};
use crate::slit::Flat;
use crate::springs::{self, Springs};
use crate::tethers::{along_cloth_m, tethers, within_m};
use crate::woven::Woven;
use glam::{DVec2, DVec3};
use std::collections::{BTreeMap, BTreeSet};

/// Who pulls farther than this has nothing in the hand any more, metres.
const SLIPS_M: f64 = 0.3;
/// Out of fingers cloth slips, too, whose threads there are longer than this share of their length, and so many metres.
const SLIPS_STRETCHED: f64 = 1.5;
const SLIPS_LONGER_M: f64 = 0.005;
/// A hand's place goes no faster, metres per second.
const FASTEST_M_PER_S: f64 = 3.0;
/// What is pinned goes to its place no faster, metres per second.
const PINNED_M_PER_S: f64 = 0.5;
/// Scissors take away so much, metres.
const KERF_M: f64 = 1e-3;
/// Most places of a path that is cut.
const MOST_PLACES: usize = 1 << 16;

/// A hand.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Hand {
    /// The left one.
    Left,
    /// The right one.
    Right,
}

/// What a hand holds.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Held {
    /// Which particle.
    pub particle: u32,
    /// Where it is from the hand, metres: it does not jump into the hand.
    pub from_hand_m: DVec3,
}

/// What cloth is made of, and how it steps.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Model {
    /// Woven cloth by the solver for production, clear of itself.
    Woven(Woven, drape::Settings),
    /// Masses and springs as in the paper; cloth goes through itself.
    Springs(springs::Settings),
}

/// Why hands cannot have their way.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum HandsError {
    /// Constants out of range.
    #[error(transparent)]
    Fabric(#[from] FabricError),
    /// Cloth that is none.
    #[error(transparent)]
    Sheet(#[from] SheetError),
    /// No scissors in that hand, or no places that they went through.
    #[error("nothing to cut along: the hand has no scissors, or was not seen with them")]
    NoPath,
    /// A cut that is none.
    #[error(transparent)]
    Part(#[from] PartError),
    /// Layers that lie too near to each other.
    #[error("the cloth lies too near to itself to be cut here; draw it apart first")]
    Close,
    /// Places for other cloth, or that are no numbers.
    #[error("{given} places for cloth of {particles} particles, or one of them is not finite")]
    Places {
        /// How many.
        given: usize,
        /// How many it has.
        particles: usize,
    },
}

/// Steps cloth.
#[derive(Clone, Debug)]
enum Solver {
    Woven(Box<Drape>),
    Springs(Springs),
}

/// Cloth and two hands.
#[derive(Clone, Debug)]
pub struct Hands {
    model: Model,
    solver: Solver,
    flat: Flat,
    sheet: Sheet,
    /// The cloth.
    pub state: State,
    /// Where each hand was seen last, and where it is for the cloth, metres.
    seen_m: [Option<DVec3>; 2],
    is_m: [Option<DVec3>; 2],
    held: [Option<Held>; 2],
    /// Where scissors in a hand went, metres.
    scissors_m: [Option<Vec<DVec3>>; 2],
    /// Particles that are pinned, and where.
    pinned_m: BTreeMap<u32, DVec3>,
    /// How far all particles are along the cloth from each that is held or pinned, metres.
    far_m: BTreeMap<u32, Vec<f64>>,
    /// How near a hand must be to take a particle or to cut, metres.
    reach_m: f64,
}

impl Solver {
    fn of(model: &Model, sheet: &Sheet) -> Result<Solver, FabricError> {
        Ok(match model {
            Model::Woven(woven, settings) => Solver::Woven(Box::new(Drape::new(sheet, woven, settings)?)),
            Model::Springs(settings) => Solver::Springs(Springs::new(sheet, settings)?),
        })
    }

    fn hold(&mut self, particle: u32, to_m: DVec3) {
        match self {
            Solver::Woven(drape) => drape.hold(particle as usize, to_m),
            Solver::Springs(springs) => springs.hold(particle as usize, to_m),
        }
    }

    fn let_go(&mut self, particle: u32) {
        match self {
            Solver::Woven(drape) => drape.let_go(particle as usize),
            Solver::Springs(springs) => springs.let_go(particle as usize),
        }
    }

    fn step(&mut self, body: Option<&Body>, state: &mut State) -> Stepped {
        match self {
            Solver::Woven(drape) => drape.advance(1, &mut { body }, state),
            Solver::Springs(springs) => springs.step(body, state),
        }
    }
}

impl Model {
    fn step_s(&self) -> f64 {
        match self {
            Model::Woven(_, settings) => settings.step_s,
            Model::Springs(settings) => settings.step_s,
        }
    }

    fn clearance_m(&self) -> f64 {
        match self {
            Model::Woven(_, settings) => settings.clearance_m,
            Model::Springs(settings) => settings.clearance_m,
        }
    }
}

impl Hands {
    /// Cloth at rest, with its vertices at `positions_m`. A hand takes what is nearer than `reach_m`, metres.
    ///
    /// # Errors
    /// When the cloth is none, or a constant of it or a setting is not in its range.
    pub fn new(flat: Flat, positions_m: &[DVec3], model: Model, reach_m: f64) -> Result<Hands, HandsError> {
        above_zero("reach_m", reach_m)?;
        let sheet = Sheet::from_flat(&flat.places_m, &flat.triangles, positions_m)?;
        let state = State {
            positions_m: positions_m.to_vec(),
            velocities_m_per_s: vec![DVec3::ZERO; positions_m.len()],
            steps: 0,
            went_m_per_s: vec![0.0; positions_m.len()],
        };
        Ok(Hands {
            solver: Solver::of(&model, &sheet)?,
            model,
            flat,
            sheet,
            state,
            seen_m: [None; 2],
            is_m: [None; 2],
            held: [None; 2],
            scissors_m: [None, None],
            pinned_m: BTreeMap::new(),
            far_m: BTreeMap::new(),
            reach_m,
        })
    }

    /// Where a hand is now; none or no numbers where it is not seen: then it stays.
    pub fn see(&mut self, hand: Hand, place_m: Option<DVec3>) {
        let Some(place_m) = place_m.filter(|place_m| place_m.is_finite()) else { return };
        self.seen_m[hand as usize] = Some(place_m);
        self.is_m[hand as usize].get_or_insert(place_m);
        if let Some(path_m) = self.scissors_m[hand as usize].as_mut().filter(|path_m| path_m.len() < MOST_PLACES) {
            path_m.push(place_m);
        }
    }

    /// The particle that a hand would take: the nearest within its reach that neither hand holds; pinned ones, too. None where it holds one or scissors.
    #[must_use]
    pub fn candidate(&self, hand: Hand) -> Option<u32> {
        let at_m = self.is_m[hand as usize]?;
        if self.held[hand as usize].is_some() || self.scissors_m[hand as usize].is_some() {
            return None;
        }
        let is_free = |particle: u32| self.held.iter().flatten().all(|held| held.particle != particle);
        self.nearest(at_m, is_free)
    }

    /// Takes the candidate, which is pinned no more. Which one.
    pub fn pinch(&mut self, hand: Hand) -> Option<u32> {
        let particle = self.candidate(hand)?;
        self.take(hand, particle);
        Some(particle)
    }

    /// Takes a particle wherever it is, for example a corner to move cloth by it; false where the hand is not seen, has scissors, or the other one holds it.
    pub fn take(&mut self, hand: Hand, particle: u32) -> bool {
        let Some(at_m) = self.is_m[hand as usize] else { return false };
        let other = self.held[1 - hand as usize];
        if particle as usize >= self.state.positions_m.len()
            || self.scissors_m[hand as usize].is_some()
            || other.is_some_and(|held| held.particle == particle)
        {
            return false;
        }
        self.unpin(particle);
        self.drop_held(hand);
        let from_hand_m = self.state.positions_m[particle as usize] - at_m;
        // From afar it comes into the hand, or it would slip at once.
        let from_hand_m = from_hand_m.clamp_length_max(self.reach_m);
        self.held[hand as usize] = Some(Held { particle, from_hand_m });
        true
    }

    /// Both hands take the upper corners of the cloth, each the one on its side, to move it by them; what they held before they let go. Which ones.
    pub fn take_corners(&mut self) -> Option<[u32; 2]> {
        let corners = self.upper_corners();
        let [left, right] = [Hand::Left, Hand::Right];
        let places_m = [self.is_m[0]?, self.is_m[1]?];
        let at_m = corners.map(|corner| self.state.positions_m[corner as usize]);
        let is_turned = places_m[0].distance(at_m[1]) + places_m[1].distance(at_m[0])
            < places_m[0].distance(at_m[0]) + places_m[1].distance(at_m[1]);
        let corners = if is_turned { [corners[1], corners[0]] } else { corners };
        self.drop_held(left);
        self.drop_held(right);
        (self.take(left, corners[0]) && self.take(right, corners[1])).then_some(corners)
    }

    /// The ends of the cloth's upper border, least weft first.
    #[must_use]
    pub fn upper_corners(&self) -> [u32; 2] {
        let places_m = &self.flat.places_m;
        let end = |sense: f64| {
            let far_m = |v: &u32| places_m[*v as usize].y + sense * places_m[*v as usize].x;
            (0..places_m.len() as u32).max_by(|a, b| far_m(a).total_cmp(&far_m(b))).unwrap_or(0)
        };
        [end(-1.0), end(1.0)]
    }

    /// Lets go of what the hand holds; of nothing, unpins the nearest pinned particle within reach. Which one. Scissors are put away without a cut.
    pub fn release(&mut self, hand: Hand) -> Option<u32> {
        if self.scissors_m[hand as usize].take().is_some() {
            return None;
        }
        if let Some(particle) = self.drop_held(hand) {
            return Some(particle);
        }
        let at_m = self.is_m[hand as usize]?;
        let pinned = self.nearest(at_m, |particle| self.pinned_m.contains_key(&particle))?;
        self.unpin(pinned);
        Some(pinned)
    }

    /// Where the hand would pin what it holds: on a body within reach, at the nearest place of it, clear of it, or where it is.
    #[must_use]
    pub fn pin_place_m(&self, hand: Hand, body: Option<&Body>) -> Option<DVec3> {
        let held = self.held[hand as usize]?;
        let at_m = self.state.positions_m[held.particle as usize];
        let near = body.and_then(|body| body.signed_distance(at_m, self.reach_m));
        Some(near.map_or(at_m, |near| near.place_m + near.normal * self.model.clearance_m()))
    }

    /// Whether what the hand holds is within its reach of a body.
    #[must_use]
    pub fn is_at_body(&self, hand: Hand, body: Option<&Body>) -> bool {
        let held_m = self.held[hand as usize].map(|held| self.state.positions_m[held.particle as usize]);
        held_m.zip(body).is_some_and(|(at_m, body)| body.signed_distance(at_m, self.reach_m).is_some())
    }

    /// Pins what the hand holds there; the hand is free then. Which one.
    pub fn pin(&mut self, hand: Hand, body: Option<&Body>) -> Option<u32> {
        let place_m = self.pin_place_m(hand, body)?;
        let held = self.held[hand as usize].take()?;
        self.pinned_m.insert(held.particle, place_m);
        Some(held.particle)
    }

    /// Pins a particle where it is.
    ///
    /// # Panics
    /// When there is no such particle.
    pub fn pin_particle(&mut self, particle: u32) {
        self.pinned_m.insert(particle, self.state.positions_m[particle as usize]);
    }

    /// The hand takes scissors, and puts down what it holds: from here on its path is what will be cut.
    pub fn take_scissors(&mut self, hand: Hand) {
        self.drop_held(hand);
        self.scissors_m[hand as usize] = Some(self.seen_m[hand as usize].into_iter().collect());
    }

    /// Whether a hand has scissors.
    #[must_use]
    pub fn has_scissors(&self, hand: Hand) -> bool {
        self.scissors_m[hand as usize].is_some()
    }

    /// Cuts along the way of the hand's scissors, and puts them away. Length of the cut, metres.
    ///
    /// # Errors
    /// As [`Hands::cut_along`], or when the hand has none.
    pub fn cut(&mut self, hand: Hand, layers: Layers) -> Result<f64, HandsError> {
        let path_m = self.scissors_m[hand as usize].take().ok_or(HandsError::NoPath)?;
        self.cut_along(&path_m, layers)
    }

    /// Cuts the cloth along a path in space, metres, straight on the cloth between the path's turns. What is held or pinned stays so; particles keep their numbers.
    /// Length of the cut, metres.
    ///
    /// # Errors
    /// When the path meets no cloth, or the cloth cannot be cut there. Then nothing is cut.
    pub fn cut_along(&mut self, path_m: &[DVec3], layers: Layers) -> Result<f64, HandsError> {
        if path_m.is_empty() {
            return Err(HandsError::NoPath);
        }
        let lines = lines_on(&self.flat, &self.state.positions_m, path_m, self.reach_m, layers);
        let before = self_intersections(&self.state.positions_m, &self.flat.triangles).len();
        let mut problem = HandsError::Part(PartError::Misses);
        // Vertices that come onto the line leave the cloth's surface by a hair; where layers lie close, they stay.
        for moves in [true, false] {
            let carried = vec![self.state.positions_m.clone(), self.state.velocities_m_per_s.clone()];
            match part_along(&self.flat, carried, &lines, Blade { kerf_m: KERF_M, moves }) {
                Ok(parted) => {
                    let crossings = || self_intersections(&parted.carried[0], &parted.flat.triangles).len();
                    if matches!(self.model, Model::Woven(..)) && crossings() > before {
                        problem = HandsError::Close;
                        continue;
                    }
                    self.becomes(parted.flat, parted.carried)?;
                    return Ok(parted.cut_m);
                }
                Err(error) => problem = error.into(),
            }
        }
        Err(problem)
    }

    fn becomes(&mut self, flat: Flat, mut carried: Vec<Vec<DVec3>>) -> Result<(), HandsError> {
        let velocities_m_per_s = carried.pop().expect("places and velocities");
        let positions_m = carried.pop().expect("places and velocities");
        let sheet = Sheet::from_flat(&flat.places_m, &flat.triangles, &positions_m)?;
        self.solver = Solver::of(&self.model, &sheet)?;
        self.far_m.clear();
        let went_m_per_s = vec![0.0; positions_m.len()];
        self.state = State { positions_m, velocities_m_per_s, steps: self.state.steps, went_m_per_s };
        (self.flat, self.sheet) = (flat, sheet);
        Ok(())
    }

    /// Lays the cloth somewhere else, at rest, for example by a mapping onto a form (chapter 2): a place to each particle. Hands and pins let go.
    ///
    /// # Errors
    /// When there are more or fewer places than particles, or one is not finite. Then nothing changes.
    pub fn lay(&mut self, places_m: &[DVec3]) -> Result<(), HandsError> {
        let particles = self.state.positions_m.len();
        if places_m.len() != particles || places_m.iter().any(|place_m| !place_m.is_finite()) {
            return Err(HandsError::Places { given: places_m.len(), particles });
        }
        self.drop_held(Hand::Left);
        self.drop_held(Hand::Right);
        let pinned: Vec<u32> = self.pinned_m.keys().copied().collect();
        pinned.into_iter().for_each(|particle| self.unpin(particle));
        self.state.positions_m = places_m.to_vec();
        self.state.velocities_m_per_s.fill(DVec3::ZERO);
        Ok(())
    }

    /// What a hand holds.
    #[must_use]
    pub fn held(&self, hand: Hand) -> Option<Held> {
        self.held[hand as usize]
    }

    /// Where a hand is for the cloth, metres.
    #[must_use]
    pub fn place_m(&self, hand: Hand) -> Option<DVec3> {
        self.is_m[hand as usize]
    }

    /// Where particles are pinned, metres.
    #[must_use]
    pub fn pinned_m(&self) -> &BTreeMap<u32, DVec3> {
        &self.pinned_m
    }

    /// The cloth's flat shape with all cuts.
    #[must_use]
    pub fn flat(&self) -> &Flat {
        &self.flat
    }

    /// The cloth as a net.
    #[must_use]
    pub fn sheet(&self) -> &Sheet {
        &self.sheet
    }

    /// One step of the cloth. What a hand has pulled away from slips out of it.
    pub fn step(&mut self, body: Option<&Body>) -> Stepped {
        self.tie();
        let step_s = self.model.step_s();
        for hand in 0..2 {
            let (Some(seen_m), Some(is_m)) = (self.seen_m[hand], &mut self.is_m[hand]) else { continue };
            *is_m += (seen_m - *is_m).clamp_length_max(FASTEST_M_PER_S * step_s);
            let Some(held) = self.held[hand] else { continue };
            let wanted_m = *is_m + held.from_hand_m;
            let place_m = self.allowed_m(held.particle, wanted_m);
            if place_m.distance(wanted_m) > SLIPS_M || self.is_stretched(held.particle) {
                self.held[hand] = None;
                self.solver.let_go(held.particle);
                continue;
            }
            let at_m = self.state.positions_m[held.particle as usize];
            let way_m = (place_m - at_m).clamp_length_max(FASTEST_M_PER_S * step_s);
            self.solver.hold(held.particle, at_m + way_m);
        }
        for (&particle, place_m) in &self.pinned_m {
            let at_m = self.state.positions_m[particle as usize];
            let way_m = (*place_m - at_m).clamp_length_max(PINNED_M_PER_S * step_s);
            self.solver.hold(particle, at_m + way_m);
        }
        self.solver.step(body, &mut self.state)
    }

    /// Tethers the cloth to what is held and pinned now.
    fn tie(&mut self) {
        let held = self.held.iter().flatten().map(|held| held.particle);
        let anchors: BTreeSet<u32> = held.chain(self.pinned_m.keys().copied()).collect();
        if self.far_m.keys().eq(&anchors) {
            return;
        }
        self.far_m.retain(|particle, _| anchors.contains(particle));
        for particle in anchors {
            self.far_m.entry(particle).or_insert_with(|| along_cloth_m(&self.sheet, particle));
        }
        if let Solver::Woven(drape) = &mut self.solver {
            drape.tether(&tethers(&self.far_m));
        }
    }

    /// The place near a wanted one that is no farther from all else that is held than the cloth between is long.
    fn allowed_m(&self, particle: u32, wanted_m: DVec3) -> DVec3 {
        let mut place_m = wanted_m;
        for _ in 0..3 {
            for (&other, far_m) in self.far_m.iter().filter(|(other, _)| **other != particle) {
                place_m = within_m(place_m, self.state.positions_m[other as usize], far_m[particle as usize]);
            }
        }
        place_m
    }

    /// Whether the threads at a particle are stretched beyond what fingers hold.
    fn is_stretched(&self, particle: u32) -> bool {
        self.sheet.edges_at(particle as usize).iter().any(|end| {
            let edge = &self.sheet.edges()[*end as usize / 2];
            let [a, b] = edge.ends.map(|end| self.state.positions_m[end as usize]);
            a.distance(b) > edge.rest_m * SLIPS_STRETCHED + SLIPS_LONGER_M
        })
    }

    fn drop_held(&mut self, hand: Hand) -> Option<u32> {
        let held = self.held[hand as usize].take()?;
        self.solver.let_go(held.particle);
        Some(held.particle)
    }

    fn unpin(&mut self, particle: u32) {
        if self.pinned_m.remove(&particle).is_some() {
            self.solver.let_go(particle);
        }
    }

    fn nearest(&self, at_m: DVec3, is_wanted: impl Fn(u32) -> bool) -> Option<u32> {
        let mut best: Option<(f64, u32)> = None;
        for (particle, place_m) in self.state.positions_m.iter().enumerate() {
            let squared_m2 = place_m.distance_squared(at_m);
            let particle = particle as u32;
            if squared_m2 <= self.reach_m * self.reach_m
                && best.is_none_or(|(least_m2, _)| squared_m2 < least_m2)
                && is_wanted(particle)
            {
                best = Some((squared_m2, particle));
            }
        }
        best.map(|(_, particle)| particle)
    }
}

/// Cuts along every line that meets the cloth, or along none. `carried` has a value for each vertex.
fn part_along(
    flat: &Flat,
    carried: Vec<Vec<DVec3>>,
    lines_m: &[Vec<DVec2>],
    blade: Blade,
) -> Result<Parted, PartError> {
    let mut all = Parted { flat: flat.clone(), carried, cut_m: 0.0 };
    for line_m in lines_m {
        let carried: Vec<&[DVec3]> = all.carried.iter().map(Vec::as_slice).collect();
        match part(&all.flat, &carried, line_m, blade) {
            Ok(parted) => all = Parted { cut_m: all.cut_m + parted.cut_m, ..parted },
            Err(PartError::Misses) => {}
            Err(error) => return Err(error),
        }
    }
    if all.cut_m > 0.0 { Ok(all) } else { Err(PartError::Misses) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn all_lines_are_cut_or_none() {
        let flat = Flat::rectangle(DVec2::ZERO, 10, 10, DVec2::splat(0.02));
        let blade = Blade { kerf_m: KERF_M, moves: true };
        let along = |lines_m: &[Vec<DVec2>]| part_along(&flat, Vec::new(), lines_m, blade).map(|parted| parted.cut_m);
        let across = |y_m: f64| vec![DVec2::new(-0.1, y_m), DVec2::new(0.3, y_m)];
        let both_m = along(&[across(0.05), across(0.15)]).unwrap();
        assert!((both_m - 0.4).abs() < 1e-9, "{both_m}");
        assert_eq!(along(&[across(0.05), across(f64::NAN)]), Err(PartError::Line), "nothing is cut, and why is said");
        let beside_too_m = along(&[across(0.5), across(0.05)]).unwrap();
        assert!((beside_too_m - 0.2).abs() < 1e-9, "what misses the cloth is no mistake: {beside_too_m}");
        assert_eq!(along(&[across(0.5)]), Err(PartError::Misses));
    }
}
