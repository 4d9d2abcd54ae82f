//! What is about the cloth of a scene, and how it moves. Knows no cloth.

use glam::DVec3;
use kitsuke_drape::body::Body;
use kitsuke_drape::drape::{Drape, Obstacle, Surroundings};

/// A body, if there is one, and pins.
#[derive(Default)]
pub struct Around {
    pub body: Option<Body>,
    pub moves: Option<Moves>,
    /// Pinned particles with their first places, and where each is after so many seconds. Pins that stand still need none.
    pub pins: Option<(Vec<(usize, DVec3)>, PinsAt)>,
    /// Seconds of a step.
    pub step_s: f64,
    /// Where the body's vertices are, and how far each went there in the last step.
    pub is_at_m: Option<[Vec<DVec3>; 2]>,
}

/// Where a pinned particle is that was somewhere, after so many seconds.
pub type PinsAt = fn(usize, DVec3, f64) -> DVec3;

/// A body that goes from one shape to another.
pub struct Moves {
    /// Its vertices at a share of the way, 0 to 1, metres.
    pub at_m: Box<dyn Fn(f64) -> Vec<DVec3>>,
    /// How long it takes, seconds.
    pub seconds: f64,
}

impl Around {
    pub fn of(body: Body) -> Around {
        Around { body: Some(body), ..Around::default() }
    }
}

impl Surroundings for Around {
    fn go(&mut self, drape: &mut Drape, after_steps: u64) -> bool {
        let now_s = after_steps as f64 * self.step_s;
        let then_s = now_s + self.step_s;
        let mut is_moving = false;
        if let Some((pins, at)) = &self.pins {
            for &(particle, first_m) in pins {
                let to_m = at(particle, first_m, then_s);
                is_moving |= to_m != at(particle, first_m, now_s);
                drape.move_pin(particle, to_m);
            }
        }
        if let (Some(moves), Some(body)) = (&self.moves, &mut self.body)
            // A step longer than the way, in which nothing moves any more.
            && (now_s <= moves.seconds + self.step_s || self.is_at_m.is_none())
        {
            let at_m = |seconds: f64| (moves.at_m)((seconds / moves.seconds).min(1.0));
            // None where a saved state goes on.
            let from_m = self.is_at_m.take().map_or_else(|| at_m(now_s), |[from_m, _]| from_m);
            let to_m = at_m(then_s);
            body.moved(&to_m).expect("a wearer posed is of numbers, and as many as before");
            is_moving |= from_m != to_m;
            let ways_m = to_m.iter().zip(&from_m).map(|(to, from)| *to - *from).collect();
            self.is_at_m = Some([to_m, ways_m]);
        }
        is_moving
    }

    fn obstacle(&self) -> Option<Obstacle<'_>> {
        let moves_m = self.is_at_m.as_ref().map(|[_, ways_m]| ways_m.as_slice());
        self.body.as_ref().map(|body| Obstacle { body, moves_m })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use kitsuke_drape::analytic_form;
    use kitsuke_drape::drape::Settings;
    use kitsuke_drape::sheet::{Grid, Sheet};
    use kitsuke_drape::woven::Woven;

    #[test]
    fn a_body_that_has_arrived_stands_still_there() {
        let (places_m, triangles) = analytic_form::sphere(DVec3::ZERO, 0.1, 16);
        let body = Body::new(&places_m, &triangles).unwrap();
        let grid = Grid { rows: 2, columns: 2, spacing_m: 0.1, corner_m: DVec3::Y, weft: DVec3::X, warp: DVec3::NEG_Z };
        let sheet = Sheet::from_grid(&grid).unwrap();
        let mut drape = Drape::new(&sheet, &Woven::default(), &Settings::default()).unwrap();
        // From the begin, and where a saved state goes on.
        for first in [0, 5, 40] {
            let from_m = places_m.clone();
            let at_m = Box::new(move |share: f64| from_m.iter().map(|p| *p + DVec3::X * share).collect());
            let moves = Some(Moves { at_m, seconds: 0.0123 });
            let mut around = Around { moves, step_s: 1.0 / 600.0, ..Around::of(body.clone()) };
            let mut way_m = 0.0;
            for step in first..60 {
                let is_moving = around.go(&mut drape, step);
                let moves_m = around.obstacle().unwrap().moves_m.unwrap();
                assert_eq!(is_moving, moves_m[0] != DVec3::ZERO, "{step}");
                assert!(step < 8 || moves_m.iter().all(|m| *m == DVec3::ZERO), "{step}: it has arrived");
                way_m += moves_m[0].x;
            }
            let share = (f64::from(first as u32) / 600.0 / 0.0123).min(1.0);
            assert!((way_m - (1.0 - share)).abs() < 1e-9, "{first}: {way_m}");
            let at_m = around.body.as_ref().unwrap().surface().positions_m()[0];
            assert!(at_m.distance(places_m[0] + DVec3::X) < 1e-12);
        }
    }
}
