//! What is said to the artist: file, place, problem, hint. Stages and readers make [`Diagnostic`]s; only the renderers
//! at the end of this file know how they look.

use std::ops::Range;

/// How bad it is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Severity {
    /// The pack is not built.
    Error,
    /// The pack is built; the artist should look.
    Warning,
}

/// Where in a file.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub enum Place {
    /// The file as a whole.
    #[default]
    File,
    /// A 1-based line.
    Line(u32),
    /// A byte range of a text file, shown as a snippet.
    Span(Range<usize>),
}

/// One thing that is wrong, said so that an artist can mend it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Diagnostic {
    /// How bad.
    pub severity: Severity,
    /// A stable kebab-case name, for example `vertex-count`.
    pub code: &'static str,
    /// Path as the artist knows it: relative to the garment folder's parent, `/` as separator.
    pub file: String,
    /// Where in the file.
    pub place: Place,
    /// What is wrong, one sentence, naming the element.
    pub problem: String,
    /// What to do, one sentence.
    pub help: String,
}

impl Diagnostic {
    /// An error; [`Diagnostic::problem`] and [`Diagnostic::help`] complete it.
    #[must_use]
    pub fn error(code: &'static str, file: impl Into<String>, place: Place) -> Diagnostic {
        let (file, problem, help) = (file.into(), String::new(), String::new());
        Diagnostic { severity: Severity::Error, code, file, place, problem, help }
    }

    /// A warning; [`Diagnostic::problem`] and [`Diagnostic::help`] complete it.
    #[must_use]
    pub fn warning(code: &'static str, file: impl Into<String>, place: Place) -> Diagnostic {
        Diagnostic { severity: Severity::Warning, ..Diagnostic::error(code, file, place) }
    }

    /// With what is wrong.
    #[must_use]
    pub fn problem(mut self, problem: impl Into<String>) -> Diagnostic {
        self.problem = problem.into();
        self
    }

    /// With what to do.
    #[must_use]
    pub fn help(mut self, help: impl Into<String>) -> Diagnostic {
        self.help = help.into();
        self
    }
}

/// Sorted by file and place, so that one run reads like another.
#[must_use]
pub fn sorted(mut diagnostics: Vec<Diagnostic>) -> Vec<Diagnostic> {
    let position = |place: &Place| match place {
        Place::File => (0, 0),
        Place::Line(line) => (1, *line as usize),
        Place::Span(span) => (2, span.start),
    };
    diagnostics.sort_by(|a, b| {
        let key = |d: &Diagnostic| (position(&d.place), d.severity, d.code);
        a.file.cmp(&b.file).then_with(|| key(a).cmp(&key(b))).then_with(|| a.problem.cmp(&b.problem))
    });
    diagnostics.dedup();
    diagnostics
}
