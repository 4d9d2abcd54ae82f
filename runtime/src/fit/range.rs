//! How short and how long a dimension can become within the bounds of the weights. Knows of kimono only that weights belong to parts.

use super::dense::dot;
use super::paths::Paths;

/// Most Frank–Wolfe steps of a search.
const STEPS: usize = 200;
/// A minimum is found when it is known this closely, metres.
const CLOSE_M: f64 = 1e-5;

/// The least and the greatest length of a path, metres, over all weights that are within the bounds: in each part, the weights of its `sizes`
/// and of the base sum to 1, and the negative ones to no less than `-extrapolation`.
///
/// A length is a convex function of the weights. So the least is enclosed from below by tangents, and the greatest lies at a corner, where the
/// ascent from the best of the bodies ends.
pub(crate) fn extremes_m(paths: &Paths, path: usize, sizes: usize, extrapolation: f64) -> (f64, f64) {
    let mut gradient = vec![0.0; paths.unknowns()];
    let mut corner = vec![0.0; paths.unknowns()];
    let mut weights = vec![0.0; paths.unknowns()];
    let mut greatest_m = f64::NEG_INFINITY;
    let mut shortest = (f64::INFINITY, 0);
    for body in 0..=sizes {
        wear(body, sizes, &mut weights);
        let mut length_m = paths.length(path, &weights, &mut gradient);
        shortest = if length_m < shortest.0 { (length_m, body) } else { shortest };
        for _ in 0..STEPS {
            greatest_m = greatest_m.max(length_m);
            farthest_corner(&gradient, sizes, extrapolation, 1.0, &mut corner);
            weights.copy_from_slice(&corner);
            length_m = paths.length(path, &weights, &mut gradient);
            if length_m <= greatest_m {
                break;
            }
        }
    }
    wear(shortest.1, sizes, &mut weights);
    let mut least_m = f64::NEG_INFINITY;
    for step in 0..STEPS {
        let length_m = paths.length(path, &weights, &mut gradient);
        farthest_corner(&gradient, sizes, extrapolation, -1.0, &mut corner);
        let gap_m = dot(&gradient, &weights) - dot(&gradient, &corner);
        least_m = least_m.max(length_m - gap_m);
        if gap_m < CLOSE_M {
            break;
        }
        let share = 2.0 / (step as f64 + 2.0);
        weights.iter_mut().zip(&corner).for_each(|(weight, corner)| *weight += share * (corner - *weight));
    }
    // No path is shorter than nothing, and the tangents of one that can vanish say little.
    (least_m.max(0.0), greatest_m)
}

/// All parts from one body.
fn wear(body: usize, sizes: usize, weights: &mut [f64]) {
    for of_part in weights.chunks_exact_mut(sizes) {
        of_part.fill(0.0);
        body.checked_sub(1).into_iter().for_each(|size| of_part[size] = 1.0);
    }
}

/// The corner of the bounds that lies farthest along `sign` times the gradient: of each part, more than the whole of the body that lies
/// farthest, less than nothing of the one that lies nearest.
fn farthest_corner(gradient: &[f64], sizes: usize, extrapolation: f64, sign: f64, corner: &mut [f64]) {
    corner.fill(0.0);
    for (slopes, weights) in gradient.chunks_exact(sizes).zip(corner.chunks_exact_mut(sizes)) {
        // The base's slope is 0.
        let (mut farthest, mut nearest) = ((0.0, None), (0.0, None));
        for (size, slope) in slopes.iter().enumerate() {
            let along = sign * slope;
            farthest = if along > farthest.0 { (along, Some(size)) } else { farthest };
            nearest = if along < nearest.0 { (along, Some(size)) } else { nearest };
        }
        farthest.1.into_iter().for_each(|size| weights[size] += 1.0 + extrapolation);
        nearest.1.into_iter().for_each(|size| weights[size] -= extrapolation);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn no_weights_within_the_bounds_pass_the_extremes(
            changes in prop::collection::vec(-0.05..0.05f64, 4 * 3 * 6),
            shares in prop::collection::vec(0.0..1.0f64, 2 * 8),
        ) {
            let mut paths = Paths::new(6);
            for edge in changes.chunks_exact(18) {
                paths.push_edge([0.3, 0.0, 0.1], edge);
            }
            paths.end_path(0.1);
            let (least_m, greatest_m) = extremes_m(&paths, 0, 3, 0.5);
            // (1 + e) times one mean of the four bodies less e times another.
            let mut weights = vec![0.0; 6];
            for (part, shares) in shares.chunks_exact(8).enumerate() {
                let (more, less) = shares.split_at(4);
                let sums = [more, less].map(|shares| shares.iter().sum::<f64>() + 1e-9);
                for size in 0..3 {
                    weights[part * 3 + size] = 1.5 * more[size + 1] / sums[0] - 0.5 * less[size + 1] / sums[1];
                }
            }
            let length_m = paths.length(0, &weights, &mut [0.0; 6]);
            prop_assert!((least_m - 1e-9..=greatest_m + 1e-9).contains(&length_m), "{least_m} {length_m} {greatest_m}");
        }
    }
}
