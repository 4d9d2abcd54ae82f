//! Curves that hanging things follow, from their equations: the heavy elastica and the catenary. Knows no cloth.

use glam::DVec2;

/// Steps along the elastica from one place to the next.
const STEPS: usize = 64;
const BISECTIONS: usize = 60;

/// A heavy strip that is held level at one end: `places` of it at equal distances along it, the held end first, as shares of its length outward
/// and upward. It solves B θ'' = -w (L - s) cos θ with θ(0) = 0 and θ'(L) = 0, where θ is how far the strip points down at the length s, and
/// `lengths`, L over the bending length (B/w)^(1/3), is all that its form depends on; at most 4, where it hangs straight down.
pub fn elastica(lengths: f64, places: usize) -> Vec<DVec2> {
    let weight = lengths * lengths * lengths;
    let (mut low, mut high) = (0.0, 0.5 * weight);
    for _ in 0..BISECTIONS {
        let bent = 0.5 * (low + high);
        // The more it is bent where it is held, the less level it lies, and the less its weight straightens it.
        if shot(weight, bent, places).1 < 0.0 { low = bent } else { high = bent }
    }
    shot(weight, 0.5 * (low + high), places).0
}

/// Places of the strip and how much it is bent at its end if it is bent so much where it is held.
fn shot(weight: f64, bent: f64, places: usize) -> (Vec<DVec2>, f64) {
    let steps = STEPS * (places - 1);
    let step = 1.0 / steps as f64;
    let (mut at, mut angle, mut bent) = (DVec2::ZERO, 0.0, bent);
    let mut line = vec![at];
    for i in 1..=steps {
        // By the middle of each step.
        let beyond = 1.0 - (i as f64 - 0.5) * step;
        let middle = angle + 0.5 * step * bent;
        bent -= step * weight * beyond * libm::cos(middle);
        angle = middle + 0.5 * step * bent;
        at += DVec2::new(libm::cos(middle), -libm::sin(middle)) * step;
        if i % STEPS == 0 {
            line.push(at);
        }
    }
    (line, bent)
}

/// The bending length of a strip of a length whose chord lies at an angle below the horizontal (Peirce, The Handle of Cloth as a Measurable
/// Quantity, 1930).
pub fn peirce_m(length_m: f64, angle_rad: f64) -> f64 {
    length_m * libm::cbrt(libm::cos(0.5 * angle_rad) / (8.0 * libm::tan(angle_rad)))
}

/// How far a chain hangs below its ends, which are level and nearer than its length.
pub fn catenary_sag_m(length_m: f64, between_m: f64) -> f64 {
    let half_m = 0.5 * between_m;
    // Of the parameter a, of which the chain is y = a cosh(x / a).
    let (mut low, mut high) = (half_m / 100.0, half_m * 1e4);
    for _ in 0..BISECTIONS {
        let a = 0.5 * (low + high);
        if 2.0 * a * libm::sinh(half_m / a) > length_m { low = a } else { high = a }
    }
    low * (libm::cosh(half_m / low) - 1.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Peirce's formula is his approximation of the elastica; at twice the bending length it says 41.5°.
    #[test]
    fn the_elastica_hangs_at_peirces_angle_and_as_a_beam_where_it_is_stiff() {
        let line = elastica(2.0, 17);
        let end = line[16];
        let angle_rad = libm::atan2(-end.y, end.x);
        assert!((angle_rad.to_degrees() - 41.5).abs() < 1.0, "{}", angle_rad.to_degrees());
        assert!((peirce_m(2.0, angle_rad) - 1.0).abs() < 0.02, "{}", peirce_m(2.0, angle_rad));
        let stiff = elastica(0.2, 3);
        assert!((-stiff[2].y / (0.2f64.powi(3) / 8.0) - 1.0).abs() < 1e-3, "w L⁴ / 8 B: {}", stiff[2].y);
        let longest = line.windows(2).map(|pair| pair[0].distance(pair[1])).fold(0.0, f64::max);
        assert!(longest <= 1.0 / 16.0);
    }

    #[test]
    fn a_chain_hangs_as_its_hyperbola() {
        // y = cosh x from -1 to 1.
        assert!((catenary_sag_m(2.0 * 1f64.sinh(), 2.0) - (1f64.cosh() - 1.0)).abs() < 1e-9);
    }
}
