//! Contacts as constraints of extended position based dynamics: cloth against cloth and cloth against a body that moves push apart what is too
//! near, and rub by Coulomb's law. Knows neither how contacts are found nor what else holds cloth.

use crate::near_pairs::NearPair;
use glam::DVec3;

/// Of what is missing, the share that is mended in a part of a step, so that cloth settles instead of being thrown to and fro.
const APART: f64 = 0.1;
/// Neighbours in the mesh keep this share of the thickness only, and of the height of their triangles: their edge holds them apart already.
pub const OF_NEIGHBOURS: f64 = 0.3;

/// A particle near a body.
#[derive(Clone, Copy, Debug)]
pub struct Touch {
    /// Its place.
    pub place: u32,
    /// A place of the body's surface at the end of the step, metres.
    pub at_m: DVec3,
    /// How far that goes in the step, metres.
    pub move_m: DVec3,
    /// Unit, out of the body.
    pub normal: DVec3,
}

/// A part of a step.
pub struct Part<'a> {
    /// Where particles are.
    pub places_m: &'a mut [DVec3],
    /// Where they were before the part, but for what moved them without a velocity.
    pub before_m: &'a mut [DVec3],
    /// Where they were before the part.
    pub were_m: &'a [DVec3],
    /// 0 of those that are held.
    pub inverse_kg: &'a [f64],
    /// Seconds.
    pub part_s: f64,
    /// How fast what was too near is moved apart at most, metres per second.
    pub apart_m_per_s: f64,
    /// Shares of the body's way in this step: what is left after the part, and what it goes in it.
    pub way_left: f64,
    /// See above.
    pub way_now: f64,
}

impl Part<'_> {
    /// How far what was too near by `old_m` goes apart, slowly and without a velocity.
    fn apart_m(&self, old_m: f64) -> f64 {
        (APART * old_m).min(self.apart_m_per_s * self.part_s)
    }

    /// Cloth against cloth keeps its thickness, neighbours what each of them asks for.
    pub fn keep_apart(&mut self, pair: &NearPair, thickness_m: f64, neighbours_m: &[f64], friction: f64) {
        let corners = pair.corners.map(|corner| corner as usize);
        let across = |of: &[DVec3]| -> DVec3 { (0..4).map(|i| of[corners[i]] * pair.weights[i]).sum() };
        let now = across(self.places_m);
        let thickness_m = if pair.are_neighbours {
            corners.iter().map(|&corner| neighbours_m[corner]).fold(OF_NEIGHBOURS * thickness_m, f64::min)
        } else {
            thickness_m
        };
        let missing_m = thickness_m - now.dot(pair.normal);
        if missing_m <= 0.0 {
            return;
        }
        let then = across(self.before_m);
        let old_m = (thickness_m - then.dot(pair.normal)).clamp(0.0, missing_m);
        let apart_m = self.apart_m(old_m);
        let push_m = missing_m - old_m + apart_m;
        let share: f64 = (0..4).map(|i| self.inverse_kg[corners[i]] * pair.weights[i] * pair.weights[i]).sum();
        if share <= 0.0 {
            return;
        }
        let slide = now - then;
        let slide = slide - pair.normal * slide.dot(pair.normal);
        let slid_m = slide.length();
        let stop = if slid_m > 0.0 { (friction * push_m / slid_m).min(1.0) } else { 0.0 };
        for (corner, weight) in corners.into_iter().zip(pair.weights) {
            let weight = self.inverse_kg[corner] * weight / share;
            self.places_m[corner] += (pair.normal * push_m - slide * stop) * weight;
            self.before_m[corner] += pair.normal * (apart_m * weight);
        }
    }

    /// Cloth against the body keeps its clearance.
    pub fn keep_off(&mut self, touch: &Touch, clearance_m: f64, friction: f64) {
        let place = touch.place as usize;
        let surface_m = touch.at_m - touch.move_m * self.way_left;
        let missing_m = clearance_m - (self.places_m[place] - surface_m).dot(touch.normal);
        if missing_m <= 0.0 {
            return;
        }
        let then_m = surface_m - touch.move_m * self.way_now;
        // Other layers moved it without a velocity; not into the body.
        self.before_m[place] += touch.normal * (self.were_m[place] - self.before_m[place]).dot(touch.normal).max(0.0);
        let old_m = (clearance_m - (self.were_m[place] - then_m).dot(touch.normal)).clamp(0.0, missing_m);
        let apart_m = self.apart_m(old_m);
        let push_m = missing_m - old_m + apart_m;
        let slide = self.places_m[place] - self.before_m[place] - touch.move_m * self.way_now;
        let slide = slide - touch.normal * slide.dot(touch.normal);
        let slid_m = slide.length();
        let stop = if slid_m > 0.0 { (friction * push_m / slid_m).min(1.0) } else { 0.0 };
        self.places_m[place] += touch.normal * push_m - slide * stop;
        self.before_m[place] += touch.normal * apart_m;
    }
}
