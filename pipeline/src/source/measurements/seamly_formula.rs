//! Formulas of Seamly2D and Valentina: sums, differences, products and quotients of numbers and of the measurements above. Knows no file.

use super::{number, shortened};

/// Longest formula, bytes.
const BYTES: usize = 1000;
/// Brackets within brackets at most.
const DEPTH: usize = 32;
const HELP: &str =
    "Formulas are + - * / and brackets over numbers and measurements above; or write the number that it gives.";

/// What is wrong and what to do.
type Wrong = (String, &'static str);

/// The value of a formula, given what stands above it: 0 for what has not been measured, `None` for what could not be read.
pub(super) fn evaluate(formula: &str, above: &[(&str, Option<f64>)]) -> Result<f64, Wrong> {
    let wrong = |what: String| (format!("`{}`: {what}", shortened(formula)), HELP);
    if formula.len() > BYTES {
        return Err(wrong(format!("the formula is longer than {BYTES} bytes")));
    }
    let mut rest = Rest { text: formula, above };
    let value = rest.sum(0).map_err(wrong)?;
    match rest.next() {
        Some(c) => Err(wrong(format!("`{c}` is not expected here"))),
        None if !value.is_finite() => Err(wrong("it has no value; is something divided by 0?".to_owned())),
        None => Ok(value),
    }
}

/// What has not been read yet.
struct Rest<'a> {
    text: &'a str,
    above: &'a [(&'a str, Option<f64>)],
}

impl Rest<'_> {
    /// The next character that is no blank.
    fn next(&mut self) -> Option<char> {
        self.text = self.text.trim_start();
        self.text.chars().next()
    }

    /// Takes the next character where it is one of these.
    fn take(&mut self, these: &str) -> Option<char> {
        let found = self.next().filter(|&c| these.contains(c))?;
        self.text = &self.text[found.len_utf8()..];
        Some(found)
    }

    fn sum(&mut self, depth: usize) -> Result<f64, String> {
        let mut sum = self.product(depth)?;
        while let Some(sign) = self.take("+-") {
            let term = self.product(depth)?;
            sum = if sign == '+' { sum + term } else { sum - term };
        }
        Ok(sum)
    }

    fn product(&mut self, depth: usize) -> Result<f64, String> {
        let mut product = self.factor(depth)?;
        while let Some(sign) = self.take("*/") {
            let factor = self.factor(depth)?;
            product = if sign == '*' { product * factor } else { product / factor };
        }
        Ok(product)
    }

    fn factor(&mut self, depth: usize) -> Result<f64, String> {
        if depth > DEPTH {
            return Err("there are too many brackets".to_owned());
        }
        if self.take("-").is_some() {
            return Ok(-self.factor(depth + 1)?);
        }
        if self.take("(").is_some() {
            let value = self.sum(depth + 1)?;
            return self.take(")").map(|_| value).ok_or_else(|| "a bracket is not closed".to_owned());
        }
        let start = self.next().ok_or("it ends where a number or a measurement is missing")?;
        let length = self.text.find(|c: char| !(c.is_alphanumeric() || "_@.".contains(c))).unwrap_or(self.text.len());
        let (word, text) = self.text.split_at(length);
        if word.is_empty() {
            return Err(format!("`{start}` is not expected here"));
        }
        self.text = text;
        if start.is_numeric() || start == '.' {
            return number(word).map_err(|(problem, _)| problem);
        }
        if self.next() == Some('(') {
            return Err(format!("the function {} is not known", shortened(word)));
        }
        match self.above.iter().rfind(|(name, _)| *name == word) {
            Some((_, Some(value))) if *value != 0.0 => Ok(*value),
            Some((_, Some(_))) => Err(format!("{word} has not been measured")),
            Some((_, None)) => Err(format!("{word} cannot be read")),
            None => Err(format!("there is no measurement {} above", shortened(word))),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const ABOVE: [(&str, Option<f64>); 4] =
        [("bust_circ", Some(83.0)), ("@own", Some(4.0)), ("hip_circ", Some(0.0)), ("waist_circ", None)];

    #[test]
    fn formulas_have_the_values_of_school() {
        for (formula, value) in [
            ("bust_circ + 8", 91.0),
            ("2*(bust_circ-@own)/ 4", 39.5),
            ("-1 + 2 * 3 - 4 / 8", 4.5),
            ("8 / 2 / 2", 2.0),
            ("  .5*bust_circ", 41.5),
        ] {
            assert_eq!(evaluate(formula, &ABOVE), Ok(value), "{formula}");
        }
    }

    #[test]
    fn what_has_no_value_says_why() {
        for (formula, problem) in [
            ("hip_circ + 1", "hip_circ has not been measured"),
            ("waist_circ", "waist_circ cannot be read"),
            ("@later / 2", "there is no measurement @later above"),
            ("sqrt(4)", "the function sqrt is not known"),
            ("2 * (bust_circ", "a bracket is not closed"),
            ("bust_circ 2", "`2` is not expected here"),
            ("bust_circ +", "it ends where"),
            ("1 / (4 - @own)", "divided by 0"),
            ("33,5 + 1", "`,` is not expected here"),
            ("bust_circ > 3 ? 1 : 2", "`>` is not expected here"),
        ] {
            let (found, _) = evaluate(formula, &ABOVE).unwrap_err();
            assert!(found.contains(problem), "{formula}: {found}");
        }
        let deep = "(".repeat(BYTES);
        assert!(evaluate(&deep, &ABOVE).unwrap_err().0.contains("too many brackets"));
    }
}
