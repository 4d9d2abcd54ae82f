//! Which sizes a body lies between: weights of the bodies for which a kimono exists, from measurements alone. Knows no kimono.
//!
//! A ridge regression on stature and girths gives the trend, and a Matérn kernel adds what the regression leaves of each body, so that a body
//! for which a size was made gets that size alone, and weights change smoothly between and beyond the bodies.

use super::dense;
use crate::measurement::{Measurement, Measurements};

/// What is compared, and how strongly its slope is drawn to 0 (in bodies: this many bodies' worth of evidence against it). Lengths of a kimono
/// follow stature closely; what girths do to a drape is small beside its noise.
const FEATURES: [(Measurement, f64); 4] = [
    (Measurement::BodyHeight, 0.1),
    (Measurement::BustGirth, 1.0),
    (Measurement::WaistGirth, 1.0),
    (Measurement::HipGirth, 1.0),
];

/// How far a body's own size reaches, in standard deviations of the bodies.
const REACH: f64 = 1.0;

/// The bodies, ready to be compared with a wearer.
#[derive(Clone, Debug)]
pub(crate) struct Neighbours {
    bodies: usize,
    /// One for each set of features that a wearer may be known by, by the bits of [`FEATURES`].
    regressions: Vec<Option<Regression>>,
}

#[derive(Clone, Debug)]
struct Regression {
    /// Mean and standard deviation of each feature over the bodies; the features that are not used are left out.
    scales: Vec<(Measurement, f64, f64)>,
    /// The bodies' standardised features, a row each.
    rows: Vec<f64>,
    /// Weights of all bodies for the constant and for each feature.
    trend: Vec<f64>,
    /// Inverse of the kernel matrix of the bodies.
    inverse: Vec<f64>,
}

impl Neighbours {
    pub(crate) fn new(bodies: &[Measurements]) -> Neighbours {
        let sets = 0..1 << FEATURES.len();
        let regressions = sets.map(|set: usize| {
            let used = FEATURES.iter().enumerate().filter(|(bit, _)| set >> bit & 1 == 1);
            Regression::new(bodies, &used.map(|(_, &feature)| feature).collect::<Vec<_>>())
        });
        Neighbours { bodies: bodies.len(), regressions: regressions.collect() }
    }

    /// Writes each body's weight; they sum to 1 and some may be negative. Returns how little the bodies say about this wearer: 0 for one of
    /// them, 1 far from all.
    pub(crate) fn weights(&self, wearer: &Measurements, weights: &mut [f64]) -> f64 {
        let mut set = 0;
        for (bit, &(feature, _)) in FEATURES.iter().enumerate() {
            // A feature that some body lacks has no regression.
            if wearer.get(feature).is_some_and(f32::is_finite) && self.regressions[1 << bit].is_some() {
                set |= 1 << bit;
            }
        }
        match &self.regressions[set] {
            Some(regression) if set != 0 => regression.weights(wearer, self.bodies, weights),
            _ => {
                weights.fill(0.0);
                weights[0] = 1.0;
                1.0
            }
        }
    }
}

impl Regression {
    /// `None` when a body lacks a feature, or when two bodies do not differ.
    fn new(bodies: &[Measurements], features: &[(Measurement, f64)]) -> Option<Regression> {
        let count = bodies.len();
        let mut scales = Vec::new();
        for &(feature, _) in features {
            let values = bodies.iter().map(|body| body.get(feature).map(f64::from)).collect::<Option<Vec<_>>>()?;
            let mean = values.iter().sum::<f64>() / count as f64;
            let variance = values.iter().map(|value| (value - mean) * (value - mean)).sum::<f64>() / count as f64;
            scales.push((feature, mean, variance.sqrt().max(1e-3)));
        }
        let rows: Vec<f64> = bodies.iter().flat_map(|body| standardised(body, &scales)).collect();
        // Normal equations of the regression: constant and features by bodies.
        let width = features.len() + 1;
        let column = |body: usize, of: usize| if of == 0 { 1.0 } else { rows[body * features.len() + of - 1] };
        let mut normal = vec![0.0; width * width];
        for i in 0..width {
            for j in 0..width {
                normal[i * width + j] = (0..count).map(|body| column(body, i) * column(body, j)).sum();
            }
            if i > 0 {
                normal[i * width + i] += features[i - 1].1;
            }
        }
        if !dense::cholesky(&mut normal, width) {
            return None;
        }
        let mut trend = vec![0.0; width * count];
        let mut right = vec![0.0; width];
        for body in 0..count {
            (0..width).for_each(|of| right[of] = column(body, of));
            dense::solve(&normal, width, &mut right);
            (0..width).for_each(|of| trend[of * count + body] = right[of]);
        }
        let mut kernel = vec![0.0; count * count];
        for i in 0..count {
            for j in 0..count {
                let [a, b] = [i, j].map(|body| &rows[body * features.len()..][..features.len()]);
                kernel[i * count + j] = matern(a, b);
            }
        }
        if !dense::cholesky(&mut kernel, count) {
            return None;
        }
        let mut inverse = vec![0.0; count * count];
        for (i, row) in inverse.chunks_exact_mut(count).enumerate() {
            row[i] = 1.0;
            dense::solve(&kernel, count, row);
        }
        Some(Regression { scales, rows, trend, inverse })
    }

    fn weights(&self, wearer: &Measurements, bodies: usize, weights: &mut [f64]) -> f64 {
        let width = self.scales.len();
        let mut place = [0.0; FEATURES.len()];
        standardised(wearer, &self.scales).zip(&mut place).for_each(|(value, place)| *place = value);
        let trend_at = |place: &[f64], body: usize| {
            self.trend[body] + (0..width).map(|of| place[of] * self.trend[(of + 1) * bodies + body]).sum::<f64>()
        };
        (0..bodies).for_each(|body| weights[body] = trend_at(&place, body));
        let mut known = 0.0;
        for i in 0..bodies {
            let row = |body: usize| &self.rows[body * width..][..width];
            let inverse = &self.inverse[i * bodies..][..bodies];
            let share: f64 = (0..bodies).map(|body| inverse[body] * matern(&place[..width], row(body))).sum();
            known += share * matern(&place[..width], row(i));
            (0..bodies).for_each(|body| weights[body] -= share * trend_at(row(i), body));
            weights[i] += share;
        }
        (1.0 - known).clamp(0.0, 1.0)
    }
}

fn standardised<'a>(body: &'a Measurements, scales: &'a [(Measurement, f64, f64)]) -> impl Iterator<Item = f64> + 'a {
    // Beyond all people, so that what follows stays finite.
    scales.iter().map(|&(feature, mean, deviation)| {
        ((body.get(feature).map_or(mean, f64::from) - mean) / deviation).clamp(-100.0, 100.0)
    })
}

/// The Matérn kernel of smoothness 3/2: once differentiable, 1 at no distance.
fn matern(a: &[f64], b: &[f64]) -> f64 {
    let square: f64 = a.iter().zip(b).map(|(a, b)| (a - b) * (a - b)).sum();
    let distance = (3.0 * square).sqrt() / REACH;
    (1.0 + distance) * libm::exp(-distance)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn body(height_m: f32, hip_m: f32) -> Measurements {
        Measurements::default().with(Measurement::BodyHeight, height_m).with(Measurement::HipGirth, hip_m)
    }

    fn bodies() -> Vec<Measurements> {
        [(1.54, 0.95), (1.46, 0.87), (1.61, 0.88), (1.64, 1.06), (1.78, 1.26)].map(|(h, hip)| body(h, hip)).to_vec()
    }

    #[test]
    fn a_body_of_a_size_gets_that_size_alone() {
        let bodies = bodies();
        let neighbours = Neighbours::new(&bodies);
        for (own, body) in bodies.iter().enumerate() {
            let mut weights = [0.0; 5];
            assert!(neighbours.weights(body, &mut weights) < 1e-9);
            for (other, weight) in weights.iter().enumerate() {
                assert!((weight - f64::from(own == other)).abs() < 1e-9, "{own} {other} {weight}");
            }
        }
    }

    #[test]
    fn weights_sum_to_one_and_change_without_jumps() {
        let neighbours = Neighbours::new(&bodies());
        let mut last: Option<[f64; 5]> = None;
        for step in 0..4000 {
            let mut weights = [0.0; 5];
            let along = step as f32 / 4000.0;
            neighbours.weights(&body(1.3 + 0.7 * along, 0.8 + 0.5 * along), &mut weights);
            assert!((weights.iter().sum::<f64>() - 1.0).abs() < 1e-9, "{weights:?}");
            if let Some(last) = last {
                assert!(weights.iter().zip(last).all(|(now, last)| (now - last).abs() < 0.01), "{last:?} {weights:?}");
            }
            last = Some(weights);
        }
    }

    #[test]
    fn what_is_not_known_of_the_wearer_is_not_compared() {
        let neighbours = Neighbours::new(&bodies());
        let mut weights = [0.0; 5];
        let novelty = neighbours.weights(&Measurements::default().with(Measurement::WaistGirth, 0.7), &mut weights);
        assert_eq!((weights, novelty), ([1.0, 0.0, 0.0, 0.0, 0.0], 1.0));
        neighbours.weights(&Measurements::default().with(Measurement::BodyHeight, 1.46), &mut weights);
        assert!((weights[1] - 1.0).abs() < 1e-9, "{weights:?}");
    }
}
