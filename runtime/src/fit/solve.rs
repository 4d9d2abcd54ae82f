//! Bounded nonlinear least squares, small and deterministic: Gauss–Newton steps with a secant correction, whose quadratic programs are solved
//! exactly. Knows of kimono only that weights belong to parts.
//!
//! The unknowns z are scaled so that their square sum is the prior. A step minimises a quadratic model within the bounds: the curvature of the
//! residuals' squares is AᵀA, of the prior τ² I, and what the bending of the residuals themselves adds is learned from step to step by symmetric
//! rank-one updates (Dennis, Gay and Welsch 1981 with the update SR1). A bound that is passed is a half space (a *cut*) whose multiplier is found
//! in the dual, a least-squares problem in numbers not below 0. All points are within the bounds, and every step lowers the cost.

use super::dense::{add_scaled, cholesky, dot, solve, solve_lower, solve_upper};
use super::paths::Paths;
use pulp::{Arch, Simd, WithSimd};

/// Most steps; a dozen is much.
const STEPS: usize = 40;
/// Most tries of a step, each at most half as long as the one before.
const TRIES: usize = 12;
/// Most rounds of new cuts in a step.
const ROUNDS: usize = 60;
/// Most cuts that are kept at a time.
const CUTS: usize = 96;
/// A solution has come to rest when the model promises to lower the cost by no more than this share. The promise is 0 exactly where the
/// conditions of Karush, Kuhn and Tucker hold.
const REST: f64 = 1e-6;
/// How far the bound may be passed; what is left is taken off in the end.
const SLACK: f64 = 1e-7;

/// What does not change from wearer to wearer.
#[derive(Clone, Debug)]
pub(crate) struct Problem {
    /// The dimensions as functions of z.
    pub(crate) paths: Paths,
    /// L, row by row: the weights are `start + L⁻ᵀ z`.
    pub(crate) factor: Vec<f64>,
    /// Weights of each part; as many unknowns belong to it.
    pub(crate) sizes: usize,
    /// What the negative weights of a part, its base's included, may sum to.
    pub(crate) extrapolation: f64,
    /// λ of each dimension.
    pub(crate) loads: Vec<f64>,
}

/// A half space of the weights of one part: the weights whose bits are set, bit 0 for the base, are together at least -`extrapolation`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Cut {
    part: usize,
    negative: u128,
}

/// Working memory of [`Problem::solve`].
#[derive(Clone, Debug, Default)]
pub(crate) struct Memory {
    /// The edges at z = 0.
    origin_m: Vec<f64>,
    pub(crate) lengths_m: Vec<f64>,
    residuals: Vec<f64>,
    /// A: how the residuals change with the unknowns, a row each.
    jacobian: Vec<f64>,
    last_jacobian: Vec<f64>,
    /// S: what the residuals' own bending adds to the curvature, as far as it is known.
    secant: Vec<f64>,
    /// AᵀA + τ² I + S, factored.
    system: Vec<f64>,
    z: Vec<f64>,
    last_z: Vec<f64>,
    /// Half of the cost's gradient.
    gradient: Vec<f64>,
    step: Vec<f64>,
    /// The minimum of the model without bounds.
    free: Vec<f64>,
    /// The minimum within.
    next: Vec<f64>,
    weights: Vec<f64>,
    cuts: Vec<Cut>,
    /// Normals of the cuts, and what the system's lower factor makes of them.
    normals: Vec<f64>,
    lowered: Vec<f64>,
    gram: Vec<f64>,
    excess: Vec<f64>,
    multipliers: Vec<f64>,
    dual: Dual,
}

impl Problem {
    fn unknowns(&self) -> usize {
        self.paths.unknowns()
    }

    /// Minimises `Σ λ ((length - wanted) / wanted)² + (stiffness |z|)²` from the given weights on. Writes the weights and returns the cost; the
    /// lengths and z are left in the memory.
    pub(crate) fn solve(
        &self,
        start: &[f64],
        wanted_m: &[f64],
        stiffness: f64,
        weights: &mut [f64],
        memory: &mut Memory,
    ) -> f64 {
        memory.resize(self.unknowns(), self.paths.count());
        self.origin(start, memory);
        self.pull_within(weights);
        self.place(start, weights, memory);
        let mut cost = self.look(wanted_m, stiffness, memory);
        for _ in 0..STEPS {
            self.model(start, stiffness, memory);
            let slope = 2.0 * dot(&memory.gradient, &memory.step);
            if -slope <= REST * cost {
                break;
            }
            let Some(lower) = self.search(wanted_m, stiffness, cost, slope, memory) else { break };
            cost = lower;
            memory.learn();
        }
        self.weights_at(start, &memory.z, weights);
        if self.pull_within(weights) {
            self.place(start, weights, memory);
            cost = self.look(wanted_m, stiffness, memory);
        }
        cost
    }

    /// Goes along the step, whole or shortened, until the cost is lower than it was by a share of what its slope promises. Where rounding
    /// hides all that is left, stays and returns `None`.
    fn search(&self, wanted_m: &[f64], stiffness: f64, cost: f64, slope: f64, memory: &mut Memory) -> Option<f64> {
        memory.last_z.copy_from_slice(&memory.z);
        std::mem::swap(&mut memory.jacobian, &mut memory.last_jacobian);
        let mut along = 1.0;
        for _ in 0..TRIES {
            memory.z.copy_from_slice(&memory.last_z);
            add_scaled(&mut memory.z, along, &memory.step);
            let here = self.look(wanted_m, stiffness, memory);
            if here <= cost + 1e-4 * along * slope {
                return Some(here);
            }
            // The minimum of the parabola through what is known.
            let parabola = -0.5 * slope * along * along / (here - cost - slope * along);
            along = parabola.clamp(0.1 * along, 0.5 * along);
        }
        memory.z.copy_from_slice(&memory.last_z);
        self.look(wanted_m, stiffness, memory);
        None
    }

    /// Shrinks the weights of parts that pass the bound towards the base, which is within every bound; says whether there were any.
    fn pull_within(&self, weights: &mut [f64]) -> bool {
        let mut is_pulled = false;
        for of_part in weights.chunks_exact_mut(self.sizes) {
            let beyond = negative(of_part).0 / self.extrapolation;
            if beyond > 1.0 {
                of_part.iter_mut().for_each(|weight| *weight /= beyond);
                is_pulled = true;
            }
        }
        is_pulled
    }

    /// Sets z to where it gives these weights.
    fn place(&self, start: &[f64], weights: &[f64], memory: &mut Memory) {
        for (z, (weight, start)) in memory.z.iter_mut().zip(weights.iter().zip(start)) {
            *z = weight - start;
        }
        self.to_unknowns(&mut memory.z);
    }

    /// Edges at z = 0: those of the base, moved by the start's weights.
    fn origin(&self, start: &[f64], memory: &mut Memory) {
        memory.z.copy_from_slice(start);
        self.to_unknowns(&mut memory.z);
        self.paths.edges(&memory.z, &mut memory.origin_m);
        memory.z.fill(0.0);
    }

    /// Weights become z: Lᵀ times them.
    pub(crate) fn to_unknowns(&self, weights: &mut [f64]) {
        let unknowns = self.unknowns();
        for row in 0..unknowns {
            // The diagonal of the factor is stored inverted.
            let below =
                (row + 1..unknowns).map(|below| self.factor[below * unknowns + row] * weights[below]).sum::<f64>();
            weights[row] = weights[row] / self.factor[row * unknowns + row] + below;
        }
    }

    fn weights_at(&self, start: &[f64], z: &[f64], weights: &mut [f64]) {
        weights.copy_from_slice(z);
        solve_upper(&self.factor, self.unknowns(), weights);
        add_scaled(weights, 1.0, start);
    }

    /// Lengths, residuals and their slopes at the memory's z; returns the cost.
    fn look(&self, wanted_m: &[f64], stiffness: f64, memory: &mut Memory) -> f64 {
        let Memory { origin_m, z, lengths_m, residuals, jacobian, .. } = memory;
        self.paths.lengths(origin_m, z, lengths_m, jacobian);
        for (i, row) in jacobian.chunks_exact_mut(z.len()).enumerate() {
            let scale = self.loads[i].sqrt() / wanted_m[i];
            residuals[i] = scale * (lengths_m[i] - wanted_m[i]);
            row.iter_mut().for_each(|slope| *slope *= scale);
        }
        dot(residuals, residuals) + stiffness * stiffness * dot(z, z)
    }

    /// The step to the minimum of the quadratic model within the bounds.
    fn model(&self, start: &[f64], stiffness: f64, memory: &mut Memory) {
        let unknowns = self.unknowns();
        memory.gradient.fill(0.0);
        add_scaled(&mut memory.gradient, stiffness * stiffness, &memory.z);
        for (row, &residual) in memory.jacobian.chunks_exact(unknowns).zip(&memory.residuals) {
            add_scaled(&mut memory.gradient, residual, row);
        }
        if !memory.factor(stiffness) {
            memory.secant.fill(0.0);
            assert!(memory.factor(stiffness), "a sum of squares and a positive stiffness");
        }
        memory.free.copy_from_slice(&memory.gradient);
        solve(&memory.system, unknowns, &mut memory.free);
        memory.free.iter_mut().zip(&memory.z).for_each(|(free, z)| *free = z - *free);
        // Cuts that mattered in the step before most likely matter again.
        memory.keep_active_cuts();
        (0..memory.cuts.len()).for_each(|cut| self.prepare(cut, start, memory));
        for _ in 0..ROUNDS {
            memory.solve_dual(unknowns);
            if memory.cuts.len() == CUTS {
                // Those that do not matter at this minimum make room; the minimum rises with every cut that is passed, so none comes back for ever.
                memory.keep_active_cuts();
                (0..memory.cuts.len()).for_each(|cut| self.prepare(cut, start, memory));
            }
            let mut weights = std::mem::take(&mut memory.weights);
            self.weights_at(start, &memory.next, &mut weights);
            let before = memory.cuts.len();
            for (part, of_part) in weights.chunks_exact(self.sizes).enumerate() {
                let (sum, negative) = negative(of_part);
                if sum <= self.extrapolation + SLACK {
                    continue;
                }
                let cut = Cut { part, negative };
                if memory.cuts.len() < CUTS && !memory.cuts.contains(&cut) {
                    memory.cuts.push(cut);
                    let cut = memory.cuts.len() - 1;
                    self.normal(cut, memory);
                    self.prepare(cut, start, memory);
                }
            }
            memory.weights = weights;
            if memory.cuts.len() == before {
                break;
            }
        }
        for (step, (next, z)) in memory.step.iter_mut().zip(memory.next.iter().zip(&memory.z)) {
            *step = next - z;
        }
    }

    /// The normal of a cut: -Σ w over its set, where the base's weight is 1 less those of all sizes, by the unknowns.
    fn normal(&self, cut: usize, memory: &mut Memory) {
        let Cut { part, negative } = memory.cuts[cut];
        let normal = &mut memory.normals[cut * self.unknowns()..][..self.unknowns()];
        normal.fill(0.0);
        for (size, slope) in normal[part * self.sizes..][..self.sizes].iter_mut().enumerate() {
            *slope = (negative & 1) as f64 - (negative >> (size + 1) & 1) as f64;
        }
        solve_lower(&self.factor, self.unknowns(), normal);
    }

    /// Excess of a cut over the bound at the free minimum, and its products with those before.
    fn prepare(&self, cut: usize, start: &[f64], memory: &mut Memory) {
        let unknowns = self.unknowns();
        let Cut { part, negative } = memory.cuts[cut];
        let of_part = &start[part * self.sizes..][..self.sizes];
        let sum = |from: f64, (size, weight): (usize, &f64)| from - (negative >> (size + 1) & 1) as f64 * weight;
        let base = (negative & 1) as f64 * (of_part.iter().sum::<f64>() - 1.0);
        let at_start = of_part.iter().enumerate().fold(base, sum);
        let normal = &memory.normals[cut * unknowns..][..unknowns];
        memory.excess[cut] = dot(normal, &memory.free) + at_start - self.extrapolation;
        let lowered = &mut memory.lowered[cut * unknowns..][..unknowns];
        lowered.copy_from_slice(normal);
        solve_lower(&memory.system, unknowns, lowered);
        let (others, lowered) = memory.lowered.split_at(cut * unknowns);
        let lowered = &lowered[..unknowns];
        for (other, of_other) in others.chunks_exact(unknowns).chain([lowered]).enumerate() {
            let product = dot(of_other, lowered);
            memory.gram[cut * CUTS + other] = product;
            memory.gram[other * CUTS + cut] = product;
        }
    }
}

/// What the negative weights of a part sum to, its base's included, and which they are, bit 0 for the base.
pub(crate) fn negative(weights: &[f64]) -> (f64, u128) {
    let base = 1.0 - weights.iter().sum::<f64>();
    let all = std::iter::once(&base).chain(weights).enumerate().filter(|(_, weight)| **weight < 0.0);
    all.fold((0.0, 0), |(sum, which), (bit, weight)| (sum - weight, which | 1 << bit))
}

impl Memory {
    /// How far the last solution is from its start, root mean square, metres.
    pub(crate) fn moved_m(&self) -> f64 {
        dot(&self.z, &self.z).sqrt()
    }

    fn resize(&mut self, unknowns: usize, dimensions: usize) {
        let resize = |values: &mut Vec<f64>, length| values.resize(length, 0.0);
        let Memory { z, last_z, gradient, step, free, next, weights, .. } = self;
        for values in [z, last_z, gradient, step, free, next, weights] {
            resize(values, unknowns);
        }
        for values in [&mut self.lengths_m, &mut self.residuals] {
            resize(values, dimensions);
        }
        for values in [&mut self.jacobian, &mut self.last_jacobian] {
            resize(values, dimensions * unknowns);
        }
        for values in [&mut self.secant, &mut self.system] {
            resize(values, unknowns * unknowns);
        }
        self.secant.fill(0.0);
        resize(&mut self.normals, CUTS * unknowns);
        resize(&mut self.lowered, CUTS * unknowns);
        resize(&mut self.gram, CUTS * CUTS);
        resize(&mut self.excess, CUTS);
        self.multipliers.clear();
        self.multipliers.reserve(CUTS);
        self.cuts.clear();
        self.cuts.reserve(CUTS);
        self.dual.reserve();
    }

    /// Factors the curvature; `false` when it is not positive definite. Compiled for several sets of vector instructions, all of which give
    /// the same bits.
    fn factor(&mut self, stiffness: f64) -> bool {
        let Memory { jacobian, secant, system, .. } = self;
        Arch::new().dispatch(Factor { unknowns: self.z.len(), stiffness, jacobian, secant, system })
    }

    /// Corrects S by what the last step has shown: the slopes' change along it, times the residuals.
    fn learn(&mut self) {
        let unknowns = self.z.len();
        let Memory { z, last_z, step, next: miss, secant, jacobian, last_jacobian, residuals, .. } = self;
        for (step, (z, last_z)) in step.iter_mut().zip(z.iter().zip(&*last_z)) {
            *step = z - last_z;
        }
        for (miss, row) in miss.iter_mut().zip(secant.chunks_exact(unknowns)) {
            *miss = -dot(row, step);
        }
        let rows = jacobian.chunks_exact(unknowns).zip(last_jacobian.chunks_exact(unknowns));
        for ((row, last_row), &residual) in rows.zip(&*residuals) {
            add_scaled(miss, residual, row);
            add_scaled(miss, -residual, last_row);
        }
        let along = dot(miss, step);
        // Otherwise the update would be more rounding than knowledge.
        if along * along > 1e-16 * dot(miss, miss) * dot(step, step) {
            for (row, &of_row) in secant.chunks_exact_mut(unknowns).zip(&*miss) {
                add_scaled(row, of_row / along, miss);
            }
        }
    }

    fn keep_active_cuts(&mut self) {
        let unknowns = self.z.len();
        let mut kept = 0;
        for cut in 0..self.multipliers.len() {
            if self.multipliers[cut] > 0.0 {
                self.cuts[kept] = self.cuts[cut];
                self.multipliers[kept] = self.multipliers[cut];
                self.normals.copy_within(cut * unknowns..(cut + 1) * unknowns, kept * unknowns);
                kept += 1;
            }
        }
        self.cuts.truncate(kept);
        self.multipliers.truncate(kept);
    }

    /// The multipliers of all cuts, and where they leave the unknowns.
    fn solve_dual(&mut self, unknowns: usize) {
        self.multipliers.resize(self.cuts.len(), 0.0);
        self.dual.solve(&self.gram, &self.excess, &mut self.multipliers);
        self.next.fill(0.0);
        for (lowered, &multiplier) in self.lowered.chunks_exact(unknowns).zip(&self.multipliers) {
            if multiplier > 0.0 {
                add_scaled(&mut self.next, -multiplier, lowered);
            }
        }
        solve_upper(&self.system, unknowns, &mut self.next);
        add_scaled(&mut self.next, 1.0, &self.free);
    }
}

struct Factor<'a> {
    unknowns: usize,
    stiffness: f64,
    jacobian: &'a [f64],
    secant: &'a [f64],
    system: &'a mut [f64],
}

impl WithSimd for Factor<'_> {
    type Output = bool;

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) -> bool {
        let Factor { unknowns, stiffness, jacobian, secant, system } = self;
        for (row, line) in system.chunks_exact_mut(unknowns).enumerate() {
            let line = &mut line[..=row];
            line.copy_from_slice(&secant[row * unknowns..][..=row]);
            line[row] += stiffness * stiffness;
            for slopes in jacobian.chunks_exact(unknowns) {
                add_scaled(line, slopes[row], &slopes[..=row]);
            }
        }
        cholesky(system, unknowns)
    }
}

/// Working memory of the dual.
#[derive(Clone, Debug, Default)]
struct Dual {
    passive: Vec<usize>,
    factor: Vec<f64>,
    solution: Vec<f64>,
}

impl Dual {
    fn reserve(&mut self) {
        self.passive.clear();
        self.passive.reserve(CUTS);
        self.factor.resize(CUTS * CUTS, 0.0);
        self.solution.clear();
        self.solution.reserve(CUTS);
    }

    /// Minimises `½ x G x - e x` over x not below 0 (Lawson and Hanson's active set), from a guess; rows of `gram` are [`CUTS`] apart.
    fn solve(&mut self, gram: &[f64], excess: &[f64], x: &mut [f64]) {
        self.passive.clear();
        self.passive.extend((0..x.len()).filter(|&i| x[i] > 0.0));
        // Each round lowers the objective, so none comes twice; rounding alone could go on.
        for _ in 0..4 * x.len() {
            self.descend(gram, excess, x);
            let slope = |i: usize| excess[i] - self.passive.iter().map(|&j| gram[i * CUTS + j] * x[j]).sum::<f64>();
            let candidates = (0..x.len()).filter(|i| !self.passive.contains(i)).map(|i| (slope(i), i));
            match candidates.max_by(|a, b| a.0.total_cmp(&b.0)) {
                Some((steepest, entering)) if steepest > 1e-12 => self.passive.push(entering),
                _ => return,
            }
        }
    }

    /// Moves to the minimum over the passive ones, leaving out those that would fall below 0.
    fn descend(&mut self, gram: &[f64], excess: &[f64], x: &mut [f64]) {
        while !self.passive.is_empty() {
            if !self.solve_passive(gram, excess) {
                // The newest depends on the others.
                self.passive.pop().into_iter().for_each(|i| x[i] = 0.0);
                continue;
            }
            let reached = self.passive.iter().zip(&self.solution);
            let blocked = reached.clone().filter(|(_, value)| **value <= 0.0);
            let share = blocked.map(|(&i, &value)| x[i] / (x[i] - value)).fold(1.0, f64::min);
            for (&i, &value) in reached {
                // What blocks the way ends at 0 exactly.
                let is_blocking = value <= 0.0 && x[i] / (x[i] - value) <= share;
                x[i] = if is_blocking { 0.0 } else { x[i] + share * (value - x[i]) };
            }
            let before = self.passive.len();
            self.passive.retain(|&i| x[i] > 0.0);
            if self.passive.len() == before {
                return;
            }
        }
    }

    /// The minimum over the passive ones; `false` when they depend on each other.
    fn solve_passive(&mut self, gram: &[f64], excess: &[f64]) -> bool {
        let count = self.passive.len();
        self.solution.clear();
        for (row, &i) in self.passive.iter().enumerate() {
            for (column, &j) in self.passive.iter().enumerate() {
                self.factor[row * count + column] = gram[i * CUTS + j];
            }
            self.factor[row * count + row] *= 1.0 + 1e-12;
            self.solution.push(excess[i]);
        }
        let is_definite = cholesky(&mut self.factor[..count * count], count);
        if is_definite {
            solve(&self.factor, count, &mut self.solution);
        }
        is_definite
    }
}
