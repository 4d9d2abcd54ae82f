//! Shares of a whole as 16-bit numbers that still sum to the whole.

/// One, in packs.
pub const WHOLE: u16 = u16::MAX;

/// Shares in proportion to `weights`, summing to exactly 65535: rounded down, and the units left over given to the
/// largest fractions, the earlier first. All zero when no weight is above 0.
#[must_use]
pub fn shares(weights: &[f64]) -> Vec<u16> {
    let sum: f64 = weights.iter().sum();
    if sum <= 0.0 {
        return vec![0; weights.len()];
    }
    let exact: Vec<f64> = weights.iter().map(|w| w / sum * f64::from(WHOLE)).collect();
    let mut shares: Vec<u16> = exact.iter().map(|w| w.floor() as u16).collect();
    let left_over = u32::from(WHOLE) - shares.iter().map(|&s| u32::from(s)).sum::<u32>();
    let mut order: Vec<usize> = (0..weights.len()).filter(|&i| weights[i] > 0.0).collect();
    order.sort_by(|&a, &b| exact[b].fract().total_cmp(&exact[a].fract()));
    for &i in order.iter().cycle().take(left_over as usize) {
        shares[i] += 1;
    }
    shares
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn shares_sum_to_the_whole_and_stay_within_one_unit(weights in prop::collection::vec(0.0f64..3.0, 1..12)) {
            let shares = shares(&weights);
            let sum: f64 = weights.iter().sum();
            prop_assert_eq!(shares.iter().map(|&s| u32::from(s)).sum::<u32>(), 65535);
            for (share, weight) in shares.iter().zip(&weights) {
                prop_assert!((f64::from(*share) - weight / sum * 65535.0).abs() <= 1.0);
            }
        }
    }

    #[test]
    fn nothing_is_shared_among_zeros() {
        assert_eq!(shares(&[0.0, 0.0]), [0, 0]);
        assert_eq!(shares(&[1.0, 1.0, 0.0]), [32768, 32767, 0]);
    }
}
