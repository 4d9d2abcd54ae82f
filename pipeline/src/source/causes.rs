//! Equal mistakes of one file as one message with a count, so that a file of many bad rows costs no more than one of
//! few. Knows no meaning of any mistake.

use crate::diagnostic::Diagnostic;
use std::collections::BTreeMap;

/// How many causes of one code are spelled out; what all others share is their number.
const SPELLED_OUT: usize = 4;

/// Mistakes by their causes, each with where it was met first and how often.
#[derive(Default)]
pub(crate) struct Causes {
    /// In the order in which they were met: no more than [`SPELLED_OUT`] of a code.
    found: Vec<((&'static str, String), Found)>,
    spelled_out: BTreeMap<&'static str, usize>,
    others: BTreeMap<&'static str, Found>,
}

struct Found {
    first: Diagnostic,
    count: usize,
}

impl Causes {
    /// One more mistake; `cause` is what it has in common with those that shall be counted with it.
    pub(crate) fn add(
        &mut self,
        code: &'static str,
        cause: impl Into<String>,
        diagnostic: impl FnOnce() -> Diagnostic,
    ) {
        let key = (code, cause.into());
        if let Some((_, found)) = self.found.iter_mut().find(|(known, _)| *known == key) {
            found.count += 1;
            return;
        }
        let spelled_out = self.spelled_out.entry(code).or_default();
        if *spelled_out < SPELLED_OUT {
            *spelled_out += 1;
            self.found.push((key, Found { first: diagnostic(), count: 1 }));
        } else {
            self.others.entry(code).or_insert_with(|| Found { first: diagnostic(), count: 0 }).count += 1;
        }
    }

    /// Whether there was no mistake.
    pub(crate) fn is_empty(&self) -> bool {
        self.found.is_empty()
    }

    /// Says every cause once. `unit` is what is counted, for example `row`.
    pub(crate) fn report(self, unit: &str, report: &mut Vec<Diagnostic>) {
        let plural = |count: usize| if count == 1 { "" } else { "s" };
        for (_, Found { mut first, count }) in self.found {
            if count > 1 {
                first.problem += &format!(" (and {} more {unit}{} like this)", count - 1, plural(count - 1));
            }
            report.push(first);
        }
        for Found { mut first, count } in self.others.into_values() {
            if count > 1 {
                first.problem += &format!(" (and {} more mistake{} of this kind)", count - 1, plural(count - 1));
            }
            report.push(first);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::diagnostic::Place;

    #[test]
    fn equal_causes_are_counted_and_others_beyond_a_few_too() {
        let mut causes = Causes::default();
        for line in 1..=1000 {
            for cause in [format!("same {}", line % 2), format!("own {line}")] {
                let problem = cause.clone();
                let make = move || Diagnostic::error("code", "t.csv", Place::Line(line)).problem(problem);
                causes.add("code", cause, make);
            }
        }
        let mut report = Vec::new();
        causes.report("row", &mut report);
        let said: Vec<&str> = report.iter().map(|diagnostic| diagnostic.problem.as_str()).collect();
        assert_eq!(
            said,
            [
                "same 1 (and 499 more rows like this)",
                "own 1",
                "same 0 (and 499 more rows like this)",
                "own 2",
                "own 3 (and 997 more mistakes of this kind)"
            ]
        );
    }
}
