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
