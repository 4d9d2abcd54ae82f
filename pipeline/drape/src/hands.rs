//! Cloth under two hands (Shoda 2018, chapter 3): state and operations, in any order, one hand while the other does something else. A hand draws what it
//! holds like a spring that is never stronger than fingers are, so that nothing it does (jumps of a metre, places that are no numbers, frames without it)
//! tears or throws the cloth. Knows no sensors, no files and no clock.

use crate::body::Body;
use crate::drape::{Drape, Settings, State, Stepped};
use crate::fabric::FabricError;
use crate::sheet::{Attachment, Sheet};
use crate::woven::Woven;
use glam::DVec3;
use std::collections::BTreeMap;

/// How a hand draws, N/m, and how hard at most, newtons: a pinch that holds a square metre of silk, and that stretches its threads by less
/// than a tenth.
const DRAWS_N_PER_M: f64 = 400.0;
const MOST_N: f64 = 2.0;
/// Who pulls farther than this has nothing in the hand any more, metres.
const SLIPS_M: f64 = 0.3;
/// A hand's place goes no faster, metres per second.
const FASTEST_M_PER_S: f64 = 3.0;
/// What is pinned goes to its place no faster, metres per second.
const PINNED_M_PER_S: f64 = 0.5;

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

/// Cloth and two hands.
#[derive(Clone, Debug)]
pub struct Hands {
    drape: Drape,
    /// The cloth.
    pub state: State,
    /// Where each hand was seen last, and where it is for the cloth, metres.
    seen_m: [Option<DVec3>; 2],
    is_m: [Option<DVec3>; 2],
    held: [Option<Held>; 2],
    /// Particles that are pinned, and where.
    pinned_m: BTreeMap<u32, DVec3>,
    step_s: f64,
    clearance_m: f64,
    /// How near a hand must be to take a particle, metres.
    reach_m: f64,
}

impl Hands {
    /// Cloth that hangs where its sheet is. A hand takes what is nearer than `reach_m`, metres.
    ///
    /// # Errors
    /// When a constant of the cloth or a setting is not in its range.
    pub fn new(sheet: &Sheet, woven: &Woven, settings: &Settings, reach_m: f64) -> Result<Hands, FabricError> {
        crate::fabric::above_zero("reach_m", reach_m)?;
        let mut drape = Drape::new(sheet, woven, settings)?;
        drape.attach(&[], MOST_N);
        let pins = sheet.pins().iter().zip(0..).filter_map(|(pin, particle)| pin.map(|at_m| (particle, at_m)));
        Ok(Hands {
            state: drape.state(sheet),
            drape,
            seen_m: [None; 2],
            is_m: [None; 2],
            held: [None; 2],
            pinned_m: pins.collect(),
            step_s: settings.step_s,
            clearance_m: settings.clearance_m,
            reach_m,
        })
    }

    /// Where a hand is now; none or no numbers where it is not seen: then it stays.
    pub fn see(&mut self, hand: Hand, place_m: Option<DVec3>) {
        if let Some(place_m) = place_m.filter(|place_m| place_m.is_finite()) {
            self.seen_m[hand as usize] = Some(place_m);
            self.is_m[hand as usize].get_or_insert(place_m);
        }
    }

    /// The particle that a hand would take: the nearest within its reach that neither hand holds; pinned ones, too. None where it has one.
    #[must_use]
    pub fn candidate(&self, hand: Hand) -> Option<u32> {
        let at_m = self.is_m[hand as usize]?;
        if self.held[hand as usize].is_some() {
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

    /// Takes a particle wherever it is, for example a corner to move cloth by it; false where the hand is not seen or the other one holds it.
    pub fn take(&mut self, hand: Hand, particle: u32) -> bool {
        let Some(at_m) = self.is_m[hand as usize] else { return false };
        let other = self.held[1 - hand as usize];
        if particle as usize >= self.state.positions_m.len() || other.is_some_and(|held| held.particle == particle) {
            return false;
        }
        self.unpin(particle);
        let from_hand_m = self.state.positions_m[particle as usize] - at_m;
        // From afar it comes into the hand, or it would slip at once.
        let from_hand_m = from_hand_m.clamp_length_max(self.reach_m);
        self.held[hand as usize] = Some(Held { particle, from_hand_m });
        true
    }

    /// Lets go of what the hand holds; of nothing, unpins the nearest pinned particle within reach. Which one.
    pub fn release(&mut self, hand: Hand) -> Option<u32> {
        if let Some(held) = self.held[hand as usize].take() {
            return Some(held.particle);
        }
        let at_m = self.is_m[hand as usize]?;
        let pinned = self.nearest(at_m, |particle| self.pinned_m.contains_key(&particle))?;
        self.unpin(pinned);
        Some(pinned)
    }

    /// Pins what the hand holds where it is, or where a body is within reach, at the nearest place of it, clear of it; the hand is free then. Which one.
    pub fn pin(&mut self, hand: Hand, body: Option<&Body>) -> Option<u32> {
        let held = self.held[hand as usize].take()?;
        let at_m = self.state.positions_m[held.particle as usize];
        let near = body.and_then(|body| body.signed_distance(at_m, self.reach_m));
        let place_m = near.map_or(at_m, |near| near.place_m + near.normal * self.clearance_m);
        self.pinned_m.insert(held.particle, place_m);
        Some(held.particle)
    }

    /// What a hand holds.
    #[must_use]
    pub fn held(&self, hand: Hand) -> Option<Held> {
        self.held[hand as usize]
    }

    /// Where particles are pinned, metres.
    #[must_use]
    pub fn pinned_m(&self) -> &BTreeMap<u32, DVec3> {
        &self.pinned_m
    }

    /// One step of the cloth. What a hand has pulled away from slips out of it.
    pub fn step(&mut self, body: Option<&Body>) -> Stepped {
        let mut drawn = Vec::new();
        for hand in 0..2 {
            let (Some(seen_m), Some(is_m)) = (self.seen_m[hand], &mut self.is_m[hand]) else { continue };
            *is_m += (seen_m - *is_m).clamp_length_max(FASTEST_M_PER_S * self.step_s);
            let Some(held) = self.held[hand] else { continue };
            let place_m = *is_m + held.from_hand_m;
            if place_m.distance(self.state.positions_m[held.particle as usize]) > SLIPS_M {
                self.held[hand] = None;
                continue;
            }
            drawn.push(Attachment { particle: held.particle, place_m, stiffness_n_per_m: DRAWS_N_PER_M });
        }
        self.drape.attach(&drawn, MOST_N);
        for (&particle, place_m) in &self.pinned_m {
            let at_m = self.state.positions_m[particle as usize];
            let way_m = (*place_m - at_m).clamp_length_max(PINNED_M_PER_S * self.step_s);
            self.drape.hold(particle as usize, at_m + way_m);
        }
        self.drape.advance(1, &mut { body }, &mut self.state)
    }

    fn unpin(&mut self, particle: u32) {
        if self.pinned_m.remove(&particle).is_some() {
            self.drape.let_go(particle as usize);
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
