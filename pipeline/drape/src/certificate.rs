//! Whether cloth lies at rest, outside the body and clear of itself, and what says so: measured on positions alone, with exact
//! tests, so that it holds whatever solver brought the cloth there. Knows no forces.

use crate::body::Body;
use crate::intersections::{Crossing, Of, Surface};
use glam::DVec3;
use std::fmt;

/// Coordinates beyond this, metres, are a solver's accident.
const FARTHEST_M: f64 = 1e6;
/// How many of each kind the text names.
const NAMED: usize = 5;

/// What is still rest.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bounds {
    /// Greatest speed of a particle, metres per second, at least 0.
    pub fastest_m_per_s: f64,
}

/// A particle that moves.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Fastest {
    /// Which one.
    pub particle: u32,
    /// Where it is, metres.
    pub place_m: DVec3,
    /// How fast, metres per second.
    pub speed_m_per_s: f64,
}

/// A particle in the body.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Inside {
    /// Which one.
    pub particle: u32,
    /// Where it is, metres.
    pub place_m: DVec3,
    /// How far below the surface, metres, above 0.
    pub depth_m: f64,
}

/// What was found of a sheet of cloth.
#[derive(Clone, Debug, PartialEq)]
pub struct Certificate {
    /// What was asked.
    pub bounds: Bounds,
    /// Particles whose place or speed is no number, or that are beyond 1000 km; then the rest is not looked at.
    pub lost: Vec<u32>,
    /// The fastest particle, of equals the first; none of no cloth.
    pub fastest: Option<Fastest>,
    /// Particles in the body, ascending.
    pub inside: Vec<Inside>,
    /// Edges of the cloth (`Of::First`) that meet triangles of the body, and the other way round.
    pub body_crossings: Vec<Crossing>,
    /// Edges of the cloth that meet its triangles.
    pub self_crossings: Vec<Crossing>,
}

impl Default for Bounds {
    /// A millimetre per second.
    fn default() -> Bounds {
        Bounds { fastest_m_per_s: 0.001 }
    }
}

impl Certificate {
    /// Whether the cloth is at rest, outside the body and clear of itself.
    #[must_use]
    pub fn is_certified(&self) -> bool {
        self.lost.is_empty()
            && self.fastest.is_none_or(|fastest| fastest.speed_m_per_s <= self.bounds.fastest_m_per_s)
            && self.inside.is_empty()
            && self.body_crossings.is_empty()
            && self.self_crossings.is_empty()
    }
}

/// Looks at cloth: three particles to a triangle, a place (metres) and a speed (metres per second) to a particle.
///
/// # Panics
/// When there are more or fewer speeds than places, or a triangle names a particle that is not there.
#[must_use]
pub fn certify(
    positions_m: &[DVec3],
    speeds_m_per_s: &[f64],
    triangles: &[[u32; 3]],
    body: Option<&Body>,
    bounds: Bounds,
) -> Certificate {
    assert_eq!(positions_m.len(), speeds_m_per_s.len(), "a speed to each particle");
    let mut certificate = Certificate {
        bounds,
        lost: Vec::new(),
        fastest: None,
        inside: Vec::new(),
        body_crossings: Vec::new(),
        self_crossings: Vec::new(),
    };
    for (particle, (&place_m, &speed_m_per_s)) in positions_m.iter().zip(speeds_m_per_s).enumerate() {
        let particle = particle as u32;
        // No number is within a distance of no number.
        if !(place_m.abs().cmple(DVec3::splat(FARTHEST_M)).all() && speed_m_per_s.is_finite()) {
            certificate.lost.push(particle);
        } else if certificate.fastest.is_none_or(|fastest| speed_m_per_s > fastest.speed_m_per_s) {
            certificate.fastest = Some(Fastest { particle, place_m, speed_m_per_s });
        }
    }
    if !certificate.lost.is_empty() {
        return certificate;
    }
    let cloth = Surface::new(positions_m, triangles);
    certificate.self_crossings = cloth.self_intersections();
    if let Some(body) = body {
        certificate.body_crossings = cloth.crossings(body.surface());
        certificate.inside = crate::parallel::collect(positions_m.len(), |particle, inside: &mut Vec<Inside>| {
            let place_m = positions_m[particle];
            // Seldom inside, and the distance takes longer.
            if !body.contains(place_m) {
                return;
            }
            let near = body.signed_distance(place_m, f64::INFINITY);
            let depth_m = near.map_or(0.0, |near| -near.distance_m);
            if depth_m > 0.0 {
                inside.push(Inside { particle: particle as u32, place_m, depth_m });
            }
        });
    }
    certificate
}

impl fmt::Display for Certificate {
    /// A line for all that is well, or one for each thing that is not, with the first few places.
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        let mut faults = Vec::new();
        let named = |lines: Vec<String>, count: usize| {
            let more = if count > NAMED { format!(", and {} more", count - NAMED) } else { String::new() };
            lines.join(", ") + &more
        };
        if !self.lost.is_empty() {
            let lines = self.lost.iter().take(NAMED).map(u32::to_string).collect();
            faults.push(format!(
                "{} are lost, their place or speed is no number or beyond 1000 km: {}",
                counted(self.lost.len(), "particle"),
                named(lines, self.lost.len())
            ));
        }
        if let Some(fastest) = self.fastest.filter(|fastest| fastest.speed_m_per_s > self.bounds.fastest_m_per_s) {
            faults.push(format!(
                "particle {} at {} moves at {:.3} mm/s, at most {:.3} is rest",
                fastest.particle,
                millimetres(fastest.place_m),
                1e3 * fastest.speed_m_per_s,
                1e3 * self.bounds.fastest_m_per_s
            ));
        }
        if !self.inside.is_empty() {
            let line = |inside: &Inside| {
                format!(
                    "particle {} at {}, {:.3} mm deep",
                    inside.particle,
                    millimetres(inside.place_m),
                    1e3 * inside.depth_m
                )
            };
            let lines = self.inside.iter().take(NAMED).map(line).collect();
            faults.push(format!(
                "{} inside the body: {}",
                counted(self.inside.len(), "particle"),
                named(lines, self.inside.len())
            ));
        }
        let (of_cloth, of_body): (Vec<Crossing>, Vec<Crossing>) =
            self.body_crossings.iter().partition(|crossing| crossing.edge_of == Of::First);
        for (crossings, edge, triangle) in [
            (&of_cloth, "edge of the cloth", "the body's triangle"),
            (&of_body, "edge of the body", "the cloth's triangle"),
            (&self.self_crossings, "edge of the cloth", "its own triangle"),
        ] {
            if crossings.is_empty() {
                continue;
            }
            let line = |crossing: &Crossing| {
                let [a, b] = crossing.edge;
                format!("{a}-{b} through {triangle} {} at {}", crossing.triangle, millimetres(crossing.place_m))
            };
            let lines = crossings.iter().take(NAMED).map(line).collect();
            let count = counted(crossings.len(), "crossing");
            faults.push(format!("{count} of an {edge}: {}", named(lines, crossings.len())));
        }
        if faults.is_empty() {
            let speed = self.fastest.map_or(0.0, |fastest| 1e3 * fastest.speed_m_per_s);
            return write!(
                f,
                "at rest, outside the body and clear of itself; the fastest particle moves at {speed:.3} mm/s"
            );
        }
        write!(f, "{}", faults.join("\n"))
    }
}

fn counted(count: usize, of: &str) -> String {
    if count == 1 { format!("1 {of}") } else { format!("{count} {of}s") }
}

fn millimetres(place_m: DVec3) -> String {
    let [x, y, z] = (1e3 * place_m).to_array();
    format!("({x:.1}, {y:.1}, {z:.1}) mm")
}
