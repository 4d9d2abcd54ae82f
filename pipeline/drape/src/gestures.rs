//! One person works with the hands alone: a hand that closes takes, one that opens lets go, and one that stays somewhere does what comes next there, so that nobody has to
//! press keys (Shoda 2018, 3.4, wants that): it takes, pins on a body, cuts; with the other hand raised, it takes scissors or lets go. Knows no sensors and moves no cloth.

use crate::body::Body;
use crate::hands::{Hand, Hands};
use glam::DVec3;

/// A hand stays while it is nearer to one place than this, metres, for so long, seconds.
const STAYS_M: f64 = 0.04;
const STAYS_S: f64 = 0.8;
/// After it did something it must have gone this far before it stays again, metres.
const LEAVES_M: f64 = 0.1;

/// What is seen of a hand.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Seen {
    /// Where it is, metres; none where it is not seen.
    pub place_m: Option<DVec3>,
    /// Whether it is closed, if that is known.
    pub is_closed: Option<bool>,
    /// Whether it is raised above the head.
    pub is_raised: bool,
}

/// What a hand means.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Meaning {
    /// Take the candidate.
    Pinch,
    /// Let go.
    Release,
    /// Pin what it holds.
    Pin,
    /// Take scissors.
    Scissors,
    /// Cut where they went.
    Cut,
}

/// What hands did lately.
#[derive(Clone, Debug, Default)]
pub struct Gestures {
    hands: [Lately; 2],
}

#[derive(Clone, Copy, Debug, Default)]
struct Lately {
    /// Where it began to stay, metres, and for how long it has, seconds.
    stays: Option<(DVec3, f64)>,
    /// Where it did something, metres.
    did_m: Option<DVec3>,
    was_closed: Option<bool>,
}

impl Gestures {
    /// What the hands mean that are seen so, so many seconds after they were last. Pins go on `body`.
    pub fn see(&mut self, seen: [Seen; 2], after_s: f64, hands: &Hands, body: Option<&Body>) -> Vec<(Hand, Meaning)> {
        let mut meanings = Vec::new();
        for hand in [Hand::Left, Hand::Right] {
            let (own, other) = (seen[hand as usize], seen[1 - hand as usize]);
            let lately = &mut self.hands[hand as usize];
            let Some(at_m) = own.place_m.filter(|at_m| at_m.is_finite()) else {
                // Who is lost has not stayed.
                lately.stays = None;
                continue;
            };
            let holds = hands.held(hand).is_some();
            let changed = own.is_closed.filter(|is_closed| lately.was_closed.is_some_and(|was| was != *is_closed));
            lately.was_closed = own.is_closed.or(lately.was_closed);
            let meaning = match changed {
                Some(true) if !holds => Some(Meaning::Pinch),
                Some(false) if holds => Some(Meaning::Release),
                _ if !own.is_raised && lately.stayed(at_m, after_s) => {
                    let has_scissors = hands.has_scissors(hand);
                    match (has_scissors, holds, other.is_raised) {
                        (true, ..) => Some(Meaning::Cut),
                        (_, true, false) => hands.is_at_body(hand, body).then_some(Meaning::Pin),
                        (_, true, true) => Some(Meaning::Release),
                        (_, false, true) => Some(Meaning::Scissors),
                        // A hand whose grip is known takes by it.
                        (_, false, false) => {
                            (own.is_closed.is_none() && hands.candidate(hand).is_some()).then_some(Meaning::Pinch)
                        }
                    }
                }
                _ => None,
            };
            if let Some(meaning) = meaning {
                lately.did_m = Some(at_m);
                lately.stays = None;
                meanings.push((hand, meaning));
            }
        }
        meanings
    }
}

impl Lately {
    /// Whether the hand has stayed here long enough.
    fn stayed(&mut self, at_m: DVec3, after_s: f64) -> bool {
        if let Some(did_m) = self.did_m {
            if did_m.distance(at_m) < LEAVES_M {
                return false;
            }
            self.did_m = None;
        }
        match &mut self.stays {
            Some((from_m, for_s)) if from_m.distance(at_m) < STAYS_M => {
                *for_s += after_s.max(0.0);
                *for_s >= STAYS_S
            }
            _ => {
                self.stays = Some((at_m, 0.0));
                false
            }
        }
    }
}
