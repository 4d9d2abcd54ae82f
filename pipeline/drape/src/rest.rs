//! How cloth comes to rest: it falls freely for a while, then drag grows until what still swings, and later what still trembles, lies still. Rest is looked at over a tenth
//! of a second, so that a tremble of less than a tenth of a millimetre is rest. Knows no scenes.

use crate::certificate::{Bounds, Certificate};
use crate::drape::{Drape, State, Stepped, Surroundings};

/// Over how long rest is looked at, seconds.
const LOOKED_AT_S: f64 = 0.1;
/// One particle in so many may wait at the end of its room when cloth rests: crumpled cloth is held by it, not by what presses it.
const WAITING: usize = 1000;

/// How cloth is brought to rest.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Course {
    /// As long as body or pins move, seconds; cloth does not rest before.
    pub moving_s: f64,
    /// How long cloth then falls freely, seconds; for as long again drag grows.
    pub free_s: f64,
    /// What air takes from velocities, 1/s: while cloth falls, then, and after three times as long. What swings comes to rest the soonest with about
    /// twice its frequency (rad/s); what still trembles then, where layers press each other, wants far more. (At 100/s a particle that moves at a
    /// millimetre per second lacks a hundredth of its weight to balance.)
    pub drag_per_s: [f64; 3],
    /// What is rest.
    pub bounds: Bounds,
}

impl Default for Course {
    fn default() -> Course {
        Course { moving_s: 0.0, free_s: 1.0, drag_per_s: [2.0, 10.0, 100.0], bounds: Bounds::default() }
    }
}

/// How long a state was simulated, seconds.
#[must_use]
pub fn simulated_s(drape: &Drape, state: &State) -> f64 {
    state.steps as f64 * drape.settings().step_s
}

/// A tenth of a second. A saved state goes on with the same bytes after each.
pub fn go_on(drape: &mut Drape, around: &mut dyn Surroundings, course: &Course, state: &mut State) -> Stepped {
    let free_s = simulated_s(drape, state) - course.moving_s;
    let grown = |from: f64| ((free_s + 0.5 * LOOKED_AT_S) / course.free_s - from).clamp(0.0, 1.0);
    let [falling, swinging, trembling] = course.drag_per_s;
    drape.set_drag(falling + (swinging - falling) * grown(1.0) + (trembling - swinging) * grown(3.0));
    let steps = (LOOKED_AT_S / drape.settings().step_s).round().max(1.0);
    drape.advance(steps as u32, around, state)
}

/// Whether cloth lies still after a tenth of a second that went so.
#[must_use]
pub fn is_still(drape: &Drape, course: &Course, state: &State, stepped: &Stepped) -> bool {
    let moves = simulated_s(drape, state) <= course.moving_s + LOOKED_AT_S && course.moving_s > 0.0;
    let waits = stepped.waiting * WAITING > state.positions_m.len();
    !moves && !waits && stepped.fastest_m_per_s <= course.bounds.fastest_m_per_s
}

/// Goes on until cloth lies still, at most until `most_s` have been simulated, and says whether it rests. `each` is told of each tenth of a
/// second.
pub fn to_rest(
    drape: &mut Drape,
    around: &mut dyn Surroundings,
    course: &Course,
    most_s: f64,
    state: &mut State,
    each: &mut dyn FnMut(&State, &Stepped),
) -> Certificate {
    loop {
        let stepped = go_on(drape, around, course, state);
        each(state, &stepped);
        if is_still(drape, course, state, &stepped) || simulated_s(drape, state) >= most_s {
            return drape.certify(around.obstacle().map(|obstacle| obstacle.body), course.bounds, state);
        }
    }
}
