//! What a first solution misses is reached by a softer one, as stiff as can be. Knows problems, no verdicts.

use super::solve::{Memory, Problem};

/// Least square of the stiffness, relative to that of the first solution. There hardly anything but the bounds is in the way: what is missed
/// then, no weights give.
const SOFTEST: f64 = 1e-4;
/// Most solutions on the way.
const TRIES: usize = 10;
/// How closely the greatest error may come to the one that is allowed.
const CLOSE: f64 = 0.9;

/// Weights and what they give.
#[derive(Clone, Debug, Default)]
pub(crate) struct Solution {
    pub(crate) weights: Vec<f64>,
    pub(crate) lengths_m: Vec<f64>,
    pub(crate) stiffness: f64,
    pub(crate) cost: f64,
    /// How far it is from the start, root mean square, metres.
    pub(crate) moved_m: f64,
}

/// A problem for one wearer.
pub(crate) struct Task<'a> {
    pub(crate) problem: &'a Problem,
    pub(crate) start: &'a [f64],
    pub(crate) wanted_m: &'a [f64],
    /// Greatest relative error of a dimension that is none.
    pub(crate) tolerance: f64,
}

impl Task<'_> {
    /// Solves from the solution's weights on.
    pub(crate) fn solve(&self, stiffness: f64, solution: &mut Solution, memory: &mut Memory) {
        solution.stiffness = stiffness;
        solution.cost = self.problem.solve(self.start, self.wanted_m, stiffness, &mut solution.weights, memory);
        solution.lengths_m.clone_from(&memory.lengths_m);
        solution.moved_m = memory.moved_m();
    }

    /// The greatest relative error, and whose it is.
    pub(crate) fn worst(&self, solution: &Solution) -> (f64, usize) {
        let pairs = self.wanted_m.iter().zip(&solution.lengths_m);
        let errors = pairs.map(|(wanted_m, reached_m)| (reached_m / wanted_m - 1.0).abs());
        errors.zip(0..).max_by(|a, b| a.0.total_cmp(&b.0)).unwrap_or((0.0, 0))
    }

    /// Solves with less stiffness than `near`, which misses something, until nothing is missed; with the least where that does not help.
    ///
    /// What a spring s against a spring g misses of d is d s² / (s² + g), so that 1 over the error is a line in 1 / s², which is followed.
    pub(crate) fn soften(&self, near: &Solution, soft: &mut Solution, memory: &mut Memory) {
        soft.weights.clone_from(&near.weights);
        let first = 1.0 / (near.stiffness * near.stiffness);
        let aim = 2.0 / (self.tolerance * (1.0 + CLOSE));
        let (mut last, mut softness) = ((first, 1.0 / self.worst(near).0), 2.0 * first);
        let mut reached = None;
        for _ in 0..TRIES {
            self.solve(softness.sqrt().recip(), soft, memory);
            let error = self.worst(soft).0;
            if error <= self.tolerance {
                reached = Some(softness);
                if error >= CLOSE * self.tolerance {
                    return;
                }
            } else if softness >= first / SOFTEST {
                break;
            }
            let here = (softness, 1.0 / error);
            let rise = (here.1 - last.1) / (here.0 - last.0);
            let next = if rise > 0.0 { softness + (aim - here.1) / rise } else { 10.0 * softness };
            last = here;
            softness = next.clamp(first.max(0.1 * softness), (first / SOFTEST).min(10.0 * softness));
        }
        if let Some(softness) = reached.filter(|_| self.worst(soft).0 > self.tolerance) {
            self.solve(softness.sqrt().recip(), soft, memory);
        }
    }
}
