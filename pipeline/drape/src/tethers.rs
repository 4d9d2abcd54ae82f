//! Cloth is never farther from what holds it than the cloth between is long (Kim, Chentanez and Müller, Long Range Attachments, 2012): few passes over fine cloth stretch it most
//! where all of it hangs from one particle, and tethers keep that short. Knows no solver.

use crate::sheet::Sheet;
use glam::DVec3;
use std::cmp::Reverse;
use std::collections::{BTreeMap, BinaryHeap};

/// Each particle is tethered to so many of what holds the cloth, the nearest.
const NEAREST: usize = 3;
/// Cloth stretches by this much before its tethers are taut.
const SLACK: f64 = 1.01;

/// A particle and one that is held.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Tether {
    /// Which particle.
    pub particle: u32,
    /// Which is held.
    pub held: u32,
    /// How far from that it may be, metres.
    pub far_m: f64,
}

/// How far each particle is from one along the edges of the cloth and across the cells that two triangles make, metres; infinite in other pieces.
///
/// # Panics
/// When there is no such particle.
#[must_use]
pub fn along_cloth_m(sheet: &Sheet, from: u32) -> Vec<f64> {
    let mut far_m = vec![f64::INFINITY; sheet.positions_m().len()];
    far_m[from as usize] = 0.0;
    // Ways above 0 are ordered as their bits are.
    let mut waiting = BinaryHeap::from([Reverse((0_u64, from))]);
    while let Some(Reverse((bits, at))) = waiting.pop() {
        let here_m = f64::from_bits(bits);
        if here_m > far_m[at as usize] {
            continue;
        }
        for &end in sheet.edges_at(at as usize) {
            let edge = &sheet.edges()[end as usize / 2];
            let other = edge.ends[1 - end as usize % 2];
            let there_m = here_m + edge.rest_m;
            if there_m < far_m[other as usize] {
                far_m[other as usize] = there_m;
                waiting.push(Reverse((there_m.to_bits(), other)));
            }
        }
    }
    far_m
}

/// The tethers of all particles to what is held, each with how far all are from it along the cloth; of each, to the nearest few.
#[must_use]
pub fn tethers(held: &BTreeMap<u32, Vec<f64>>) -> Vec<Tether> {
    let particles = held.values().next().map_or(0, Vec::len);
    let mut tethers = Vec::new();
    let mut ways: Vec<(f64, u32)> = Vec::new();
    for particle in 0..particles {
        ways.clear();
        ways.extend(held.iter().map(|(held, far_m)| (far_m[particle], *held)).filter(|(far_m, _)| far_m.is_finite()));
        ways.sort_by(|a, b| a.0.total_cmp(&b.0));
        let particle = particle as u32;
        tethers.extend(ways.iter().take(NEAREST).map(|&(far_m, held)| Tether { particle, held, far_m: far_m * SLACK }));
    }
    tethers
}

/// The place nearest to one that is no farther from another.
#[must_use]
pub fn within_m(place_m: DVec3, of_m: DVec3, far_m: f64) -> DVec3 {
    of_m + (place_m - of_m).clamp_length_max(far_m)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::parting::{Blade, part};
    use crate::slit::Flat;
    use glam::DVec2;

    #[test]
    fn ways_go_along_the_cloth_and_around_cuts() {
        let flat = Flat::rectangle(DVec2::ZERO, 10, 10, DVec2::splat(0.02));
        let line = [DVec2::new(0.09, -0.01), DVec2::new(0.09, 0.15)];
        let flat = part(&flat, &[], &line, Blade { kerf_m: 1e-3, moves: true }).unwrap().flat;
        let positions_m: Vec<DVec3> = flat.places_m.iter().map(|at| at.extend(0.0)).collect();
        let sheet = Sheet::from_flat(&flat.places_m, &flat.triangles, &positions_m).unwrap();
        let far_m = along_cloth_m(&sheet, 0);
        assert_eq!(far_m[0], 0.0);
        assert!((far_m[4] - 0.08).abs() < 1e-12 && (far_m[110] - 0.2).abs() < 1e-12);
        // To the other lower corner only above the cut.
        let over_m = 2.0 * DVec2::new(0.09, 0.15).length();
        assert!(far_m[10] > over_m && far_m[10] < 1.1 * over_m, "{}", far_m[10]);
        for (v, far_m) in far_m.iter().enumerate() {
            assert!(*far_m >= flat.places_m[v].length() - 1e-9, "no way is shorter than straight");
        }
        let held = BTreeMap::from([(0, along_cloth_m(&sheet, 0)), (110, along_cloth_m(&sheet, 110))]);
        let tethers = tethers(&held);
        assert_eq!(tethers.len(), 2 * positions_m.len());
        assert_eq!(tethers[0], Tether { particle: 0, held: 0, far_m: 0.0 });
    }
}
