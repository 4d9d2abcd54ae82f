//! How far particles may go before anything can meet: each keeps to its side of a plane between two things that are near, and goes no farther
//! than what was looked for. Along the planes all are free, so that layers slide and fall apart as they like. (Half-spaces instead of a
//! distance each, as in Chen et al., Offset Geometric Contact, 2025.) Knows no forces and no mesh.

use glam::DVec3;

/// How often a way is brought back before each of its planes.
const ROUNDS: usize = 3;

/// A particle and a plane that it must not cross.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Side {
    /// Which particle.
    pub particle: u32,
    /// Unit, away from the plane.
    pub normal: DVec3,
    /// How far the particle may go against the normal, metres, at least 0.
    pub slack_m: f64,
}

/// Where particles were, and how far each may go from there.
#[derive(Clone, Debug, Default)]
pub struct Room {
    from_m: Vec<DVec3>,
    /// Whichever way, metres.
    farthest_m: f64,
    /// So far no plane is met, metres.
    free_m: Vec<f64>,
    /// Where each particle's planes begin, and the end of the last.
    starts: Vec<u32>,
    /// Normals and slacks.
    planes: Vec<(DVec3, f64)>,
}

impl Room {
    /// For particles at `from_m` that go no farther than `farthest_m`, infinity for no bound.
    #[must_use]
    pub fn new(from_m: &[DVec3], farthest_m: f64, sides: &[Side]) -> Room {
        let mut free_m = vec![farthest_m; from_m.len()];
        let mut starts = vec![0_u32; from_m.len() + 1];
        for side in sides {
            let particle = side.particle as usize;
            free_m[particle] = free_m[particle].min(side.slack_m);
            starts[particle + 1] += 1;
        }
        for particle in 0..from_m.len() {
            starts[particle + 1] += starts[particle];
        }
        let mut next = starts.clone();
        let mut planes = vec![(DVec3::ZERO, 0.0); sides.len()];
        for side in sides {
            let at = &mut next[side.particle as usize];
            planes[*at as usize] = (side.normal, side.slack_m);
            *at += 1;
        }
        Room { from_m: from_m.to_vec(), farthest_m, free_m, starts, planes }
    }

    /// Where the particle was.
    #[must_use]
    pub fn from_m(&self, particle: usize) -> DVec3 {
        self.from_m[particle]
    }

    /// The place nearby to which the particle may go instead of `to_m`; none where it may go there.
    #[must_use]
    pub fn instead_m(&self, particle: usize, to_m: DVec3) -> Option<DVec3> {
        let from_m = self.from_m[particle];
        let asked_m = to_m - from_m;
        let free_m = self.free_m[particle];
        if asked_m.length_squared() <= free_m * free_m {
            return None;
        }
        let planes = &self.planes[self.starts[particle] as usize..self.starts[particle + 1] as usize];
        let mut way_m = asked_m;
        for _ in 0..ROUNDS {
            let mut is_within = true;
            for &(normal, slack_m) in planes {
                let beyond_m = -slack_m - normal.dot(way_m);
                if beyond_m > 0.0 {
                    is_within = false;
                    way_m += normal * beyond_m;
                }
            }
            if is_within {
                break;
            }
        }
        way_m = way_m.clamp_length_max(self.farthest_m);
        // Where planes meet at a sharp angle, back along the way.
        let mut share = 1.0_f64;
        for &(normal, slack_m) in planes {
            let against_m = -normal.dot(way_m);
            if against_m > slack_m {
                share = share.min(slack_m / against_m);
            }
        }
        way_m *= share;
        // Not for an accident of rounding.
        (way_m != asked_m).then(|| from_m + way_m)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn particles_slide_along_planes_and_stop_before_them() {
        let floor = Side { particle: 1, normal: DVec3::Y, slack_m: 0.1 };
        let wall = Side { particle: 1, normal: DVec3::new(-0.6, 0.8, 0.0), slack_m: 0.2 };
        let from_m = [DVec3::ZERO, DVec3::splat(2.0)];
        let room = Room::new(&from_m, 1.0, &[wall, floor]);
        let went_m = |particle: usize, way_m: DVec3| {
            room.instead_m(particle, from_m[particle] + way_m).map(|at_m| at_m - from_m[particle])
        };
        assert_eq!(went_m(0, DVec3::new(0.9, 0.0, 0.1)), None);
        assert!((went_m(0, DVec3::X * 3.0).unwrap() - DVec3::X).length() < 1e-12);
        assert_eq!(went_m(1, DVec3::new(-0.9, -0.05, 0.3)), None);
        assert!((went_m(1, DVec3::new(-0.5, -0.5, 0.2)).unwrap() - DVec3::new(-0.5, -0.1, 0.2)).length() < 1e-12);
        // Into the corner of both, from many sides.
        for i in 0..60 {
            let angle = 0.1 * f64::from(i);
            let way_m = DVec3::new(libm::cos(angle), libm::sin(angle), 0.3 * libm::sin(3.0 * angle)) * 1.4;
            let went_m = went_m(1, way_m).unwrap_or(way_m);
            assert!(went_m.length() <= 1.0 + 1e-9, "{went_m}");
            for side in [floor, wall] {
                assert!(went_m.dot(side.normal) >= -side.slack_m - 1e-9, "{way_m} {went_m}");
            }
        }
    }
}
