//! Cloth that meets itself before anything is simulated, brought clear: where it does, its surroundings are smoothed until it does not. Small
//! tucks come clear so; layers that lie through each other far from their borders do not, and are said. Knows no forces.

use crate::intersections::{Crossing, self_intersections};
use glam::DVec3;

/// Rounds of smoothing; every so many reach one ring of neighbours farther.
const ROUNDS: usize = 60;
const ROUNDS_PER_RING: usize = 6;
const PASSES: usize = 4;

/// What a repair did.
#[derive(Clone, Debug, PartialEq)]
pub struct Repaired {
    /// The vertices that were moved, ascending.
    pub moved: Vec<u32>,
    /// How far the farthest went, metres.
    pub farthest_m: f64,
    /// What still meets: none if all is well.
    pub left: Vec<Crossing>,
}

/// Moves vertices (metres) of cloth until it is clear of itself.
pub fn clear(positions_m: &mut [DVec3], triangles: &[[u32; 3]]) -> Repaired {
    let start_m = positions_m.to_vec();
    let neighbours = neighbours(positions_m.len(), triangles);
    let mut left = self_intersections(positions_m, triangles);
    for round in 0..ROUNDS {
        if left.is_empty() {
            break;
        }
        let mut is_in = vec![false; positions_m.len()];
        for crossing in &left {
            crossing.edge.iter().for_each(|&v| is_in[v as usize] = true);
            triangles[crossing.triangle as usize].iter().for_each(|&v| is_in[v as usize] = true);
        }
        for _ in 0..round / ROUNDS_PER_RING {
            let before = is_in.clone();
            for (v, near) in neighbours.iter().enumerate() {
                is_in[v] |= near.all.iter().any(|&n| before[n as usize]);
            }
        }
        for _ in 0..PASSES {
            let before_m = positions_m.to_vec();
            for (v, near) in neighbours.iter().enumerate().filter(|(v, _)| is_in[*v]) {
                // Borders go along themselves only, so that cloth does not shrink from them.
                let of = if near.border.is_empty() { &near.all } else { &near.border };
                let mean_m = of.iter().map(|&n| before_m[n as usize]).sum::<DVec3>() / of.len().max(1) as f64;
                positions_m[v] = 0.5 * (before_m[v] + mean_m);
            }
        }
        left = self_intersections(positions_m, triangles);
    }
    let (mut moved, mut farthest_m) = (Vec::new(), 0.0_f64);
    for (v, (from, to)) in start_m.iter().zip(positions_m.iter()).enumerate() {
        if from != to {
            moved.push(v as u32);
            farthest_m = farthest_m.max(from.distance(*to));
        }
    }
    Repaired { moved, farthest_m, left }
}

#[derive(Clone, Debug, Default)]
struct Near {
    all: Vec<u32>,
    /// Those along a border.
    border: Vec<u32>,
}

fn neighbours(count: usize, triangles: &[[u32; 3]]) -> Vec<Near> {
    let mut sides: Vec<[u32; 2]> = Vec::new();
    for [a, b, c] in triangles {
        sides.extend([[a, b], [b, c], [c, a]].map(|[a, b]| [*a.min(b), *a.max(b)]));
    }
    sides.sort_unstable();
    let mut near = vec![Near::default(); count];
    for same in sides.chunk_by(|a, b| a == b) {
        let [a, b] = same[0];
        for (from, to) in [(a, b), (b, a)] {
            near[from as usize].all.push(to);
            if same.len() == 1 {
                near[from as usize].border.push(to);
            }
        }
    }
    near
}
