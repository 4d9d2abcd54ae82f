//! How a sensor sees feet that stand, found in its own recording: how far below the ankle's level it puts the toes, and where
//! the floor is.
//!
//! - What sensors call ankle and toes lies differently in every foot: in two recordings of one Kinect, of people who only stand, the toes
//!   are seen 15° and 33° below the ankle. No fixed angle serves both; but whoever stands on both straight legs has flat feet,
//!   so the angle of those frames is the angle of flat feet.
//! - Kinects put toes of a standing foot into the floor now and then, 4 cm deep. Toes can be lower than those of a flat foot only
//!   by as much as the ankle is raised above where it stands, so a foot points down no further than that.

use super::{LEFT, Layout, Measured, Place, Positions, RIGHT, TRUSTED, between};
use glam::DVec3;

const DEG: f64 = super::DEG;
/// Toes below the ankle where no frame shows a standing wearer: ankle height over foot length is about a half.
const USUAL_RAD: f64 = 26.6 * DEG;
/// Angles that feet can have.
const BELIEVABLE_RAD: [f64; 2] = [0.0, 50.0 * DEG];
/// Legs of a standing wearer lean less than this (that the sensor leans is in it) …
const LEAN_RAD: f64 = 20.0 * DEG;
/// … bend less than this at the knee …
const BEND_RAD: f64 = 15.0 * DEG;
/// … and have their ankles at one height, metres.
const LEVEL_M: f64 = 0.05;
/// Fewer frames of standing say nothing.
const FEWEST: usize = 5;
/// Ankles are raised from where they stand, not lowered; where they are lower by more, the floor is not level to the sensor, metres.
const FLOOR_M: f64 = 0.03;

/// How feet that stand are seen.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Feet {
    /// The toes' direction from the ankle below the ankle's level.
    toes_below_rad: f64,
    /// Left and right foot on the floor, where it is known.
    soles: Option<[Sole; 2]>,
}

/// A foot that stands.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Sole {
    ankle_height_m: f64,
    length_m: f64,
}

impl Default for Feet {
    fn default() -> Feet {
        Feet { toes_below_rad: USUAL_RAD, soles: None }
    }
}

impl Feet {
    /// As these frames show them.
    pub(super) fn of<'a>(layout: Layout, frames: impl Iterator<Item = &'a [Option<Measured>]>) -> Feet {
        let standing: Vec<[Foot; 2]> =
            frames.filter_map(|measured| standing(&Positions { layout, measured })).collect();
        if standing.len() < FEWEST {
            return Feet::default();
        }
        let [low, high] = BELIEVABLE_RAD;
        // Of both feet together: one of them may be seen wrongly most of the time.
        let below_rad = middle(standing.iter().flatten().map(|foot| foot.toes_below_rad));
        let sole = |side: usize| {
            let mut heights_m: Vec<f64> = standing.iter().map(|feet| feet[side].ankle_height_m).collect();
            heights_m.sort_unstable_by(f64::total_cmp);
            let [low_m, middle_m] = [heights_m.len() / 10, heights_m.len() / 2].map(|i| heights_m[i]);
            let length_m = middle(standing.iter().map(|feet| feet[side].length_m));
            (middle_m - low_m < FLOOR_M).then_some(Sole { ankle_height_m: middle_m, length_m })
        };
        let soles = if layout.is_in_the_room() { sole(LEFT).zip(sole(RIGHT)) } else { None };
        Feet { toes_below_rad: below_rad.clamp(low, high), soles: soles.map(|(left, right)| [left, right]) }
    }

    /// The toes' direction from the ankle in the T-pose.
    pub(super) fn rest(&self) -> DVec3 {
        DVec3::new(0.0, -libm::sin(self.toes_below_rad), libm::cos(self.toes_below_rad))
    }

    /// The toes' direction from this ankle, turned up until they are not in the floor.
    pub(super) fn above_the_floor(&self, side: usize, ankle_m: DVec3, along: DVec3) -> DVec3 {
        let Some(soles) = &self.soles else { return along };
        let Sole { ankle_height_m, length_m } = soles[side];
        let raised = ((ankle_m.y - ankle_height_m) / length_m).clamp(0.0, 1.0);
        let farthest_rad = self.toes_below_rad + libm::asin(raised);
        let level = along.with_y(0.0);
        match level.try_normalize() {
            Some(level) if below_rad(along) > farthest_rad => {
                level * libm::cos(farthest_rad) - DVec3::Y * libm::sin(farthest_rad)
            }
            _ => along,
        }
    }
}

/// A foot in a frame in which the wearer stands.
struct Foot {
    toes_below_rad: f64,
    ankle_height_m: f64,
    length_m: f64,
}

/// The feet, left before right, of someone who is seen to stand on both legs.
fn standing(positions: &Positions) -> Option<[Foot; 2]> {
    let trusted = |place| positions.at(place).filter(|&(_, confidence)| confidence >= TRUSTED);
    let foot = |side: usize| {
        let [hip, knee, ankle] = [Place::Hip(side), Place::Knee(side), Place::Ankle(side)].map(trusted);
        let toes = trusted(Place::Toes(side));
        let [(thigh, _), (shank, _), (along, _)] = [between(hip, knee)?, between(knee, ankle)?, between(ankle, toes)?];
        let (ankle, toes) = (ankle?.0, toes?.0);
        let is_upright = [thigh, shank].into_iter().all(|part| part.angle_between(DVec3::NEG_Y) < LEAN_RAD);
        let stands = is_upright && thigh.angle_between(shank) < BEND_RAD;
        let length_m = ankle.distance(toes);
        stands.then(|| Foot { toes_below_rad: below_rad(along), ankle_height_m: ankle.y, length_m })
    };
    let feet = [foot(LEFT)?, foot(RIGHT)?];
    ((feet[LEFT].ankle_height_m - feet[RIGHT].ankle_height_m).abs() < LEVEL_M).then_some(feet)
}

/// How far a direction points below the level.
fn below_rad(along: DVec3) -> f64 {
    libm::atan2(-along.y, libm::hypot(along.x, along.z))
}

fn middle(numbers: impl Iterator<Item = f64>) -> f64 {
    let mut sorted: Vec<f64> = numbers.collect();
    sorted.sort_unstable_by(f64::total_cmp);
    sorted[sorted.len() / 2]
}
