//! Decimal numbers, exactly as the standard library reads them, but faster where they are short.

/// Whole numbers up to this are exact.
const EXACT: u64 = 1 << 53;
/// The powers of ten that are exact.
const POWERS: [f64; 23] = [
    1e0, 1e1, 1e2, 1e3, 1e4, 1e5, 1e6, 1e7, 1e8, 1e9, 1e10, 1e11, 1e12, 1e13, 1e14, 1e15, 1e16, 1e17, 1e18, 1e19, 1e20,
    1e21, 1e22,
];

/// A finite number, rounded to the nearest.
pub(super) fn parse(word: &[u8]) -> Option<f64> {
    short(word).or_else(|| std::str::from_utf8(word).ok()?.parse().ok()).filter(|number: &f64| number.is_finite())
}

/// Numbers without exponent whose digits make an exact whole number: one division by an exact power of ten rounds once.
fn short(word: &[u8]) -> Option<f64> {
    let (is_negative, digits) = match word {
        [b'-', digits @ ..] => (true, digits),
        _ => (false, word),
    };
    // 18 digits and a point cannot overflow.
    if digits.len() > 19 {
        return None;
    }
    let (mut whole, mut count, mut point) = (0u64, 0, None);
    for &byte in digits {
        match byte {
            b'0'..=b'9' => {
                whole = whole * 10 + u64::from(byte - b'0');
                count += 1;
            }
            b'.' if point.is_none() => point = Some(count),
            _ => return None,
        }
    }
    if count == 0 || whole > EXACT {
        return None;
    }
    let size = whole as f64 / POWERS[count - point.unwrap_or(count)];
    Some(if is_negative { -size } else { size })
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn plain(word: &str) -> Option<u64> {
        word.parse::<f64>().ok().filter(|number| number.is_finite()).map(f64::to_bits)
    }

    #[test]
    fn odd_spellings_are_read_as_by_the_standard_library() {
        for word in [
            "0",
            "-0",
            "-0.0",
            "+1.5",
            ".5",
            "5.",
            ".",
            "-",
            "",
            "1e3",
            "1E-3",
            "1e400",
            "nan",
            "inf",
            "1.2.3",
            "--1",
            "9007199254740992",
            "9007199254740993",
            "0.000000000000000001",
            "99999999999999999999",
            "1_0",
            "0x10",
            "1234567890123456789",
            "123456789.0123456789",
            "1,5",
        ] {
            assert_eq!(parse(word.as_bytes()).map(f64::to_bits), plain(word), "{word}");
        }
    }

    proptest! {
        #[test]
        fn numbers_are_those_of_the_standard_library(
            word in "[-+]?[0-9]{0,19}(\\.[0-9]{0,19})?([eE][-+]?[0-9]{1,3})?", bits: u64
        ) {
            prop_assert_eq!(parse(word.as_bytes()).map(f64::to_bits), plain(&word));
            let word = f64::from_bits(bits).to_string();
            prop_assert_eq!(parse(word.as_bytes()).map(f64::to_bits), plain(&word));
        }
    }
}
