//! What is said to the artist: file, place, problem, hint. Stages and readers make [`Diagnostic`]s; only the renderers
//! at the end of this file know how they look.

use annotate_snippets::{AnnotationKind, Level, Origin, Renderer, Snippet};
use std::borrow::Cow;
use std::collections::BTreeMap;
use std::ops::Range;
use std::path::Path;

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
    /// A 1-based line; 0 where the file has no lines, which is the file as a whole.
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
    pub code: Cow<'static, str>,
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
        let place = if place == Place::Line(0) { Place::File } else { place };
        Diagnostic { severity: Severity::Error, code: code.into(), file, place, problem, help }
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

/// How many mistakes of one kind in one file are spelled out.
const OF_ONE_KIND: usize = 5;

/// Sorted by file and place, each once, so that one run reads like another; of many mistakes of one kind in one file
/// the first few and a count.
#[must_use]
pub fn sorted(mut diagnostics: Vec<Diagnostic>) -> Vec<Diagnostic> {
    let position = |place: &Place| match place {
        Place::File => (0, 0),
        Place::Line(line) => (1, *line as usize),
        Place::Span(span) => (2, span.start),
    };
    diagnostics.sort_by(|a, b| {
        let key = |d: &Diagnostic| (position(&d.place), d.severity);
        let of_place = key(a).cmp(&key(b)).then_with(|| a.code.cmp(&b.code));
        a.file.cmp(&b.file).then(of_place).then_with(|| a.problem.cmp(&b.problem))
    });
    diagnostics.dedup();
    let mut counts: BTreeMap<(String, Cow<'static, str>), usize> = BTreeMap::new();
    let mut kept: Vec<Diagnostic> = Vec::new();
    for diagnostic in diagnostics {
        let count = counts.entry((diagnostic.file.clone(), diagnostic.code.clone())).or_default();
        *count += 1;
        if *count <= OF_ONE_KIND {
            kept.push(diagnostic);
        }
    }
    for ((file, code), count) in counts {
        if let Some(more) = count.checked_sub(OF_ONE_KIND).filter(|&more| more > 0) {
            let last = kept.iter().rposition(|d| d.file == file && d.code == code).expect("some are kept");
            let plural = if more == 1 { "" } else { "s" };
            let note = Diagnostic { place: Place::File, ..kept[last].clone() };
            kept.insert(last + 1, note.problem(format!("and {more} more mistake{plural} of this kind in this file")));
        }
    }
    kept
}

/// How diagnostics are written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Format {
    /// For people: message, snippet, help.
    Human {
        /// With terminal colours.
        color: bool,
    },
    /// One JSON object per line: `severity`, `code`, `file`, `line`, `column`, `problem`, `help`; `line` and `column`
    /// count from 1 and are null where the whole file is meant.
    Json,
    /// Annotations of a GitHub workflow.
    Github,
}

/// Writes diagnostics whose files lie in `assets_dir`. Reads those files for snippets, where they still exist.
#[must_use]
pub fn render(diagnostics: &[Diagnostic], assets_dir: &Path, format: Format) -> String {
    let mut texts: BTreeMap<&str, Option<String>> = BTreeMap::new();
    let mut rendered = String::new();
    for diagnostic in diagnostics {
        let text = texts.entry(&diagnostic.file).or_insert_with(|| read_text(&assets_dir.join(&diagnostic.file)));
        rendered += &match format {
            Format::Human { color } => human(diagnostic, text.as_deref(), color),
            Format::Json => json(diagnostic, text.as_deref()),
            Format::Github => github(diagnostic, text.as_deref(), assets_dir),
        };
    }
    rendered
}

/// For example `3 errors, 1 warning in komon`.
#[must_use]
pub fn summary(diagnostics: &[Diagnostic], id: &str) -> String {
    let count = |severity| diagnostics.iter().filter(|diagnostic| diagnostic.severity == severity).count();
    let say = |n: usize, what: &str| format!("{n} {what}{}", if n == 1 { "" } else { "s" });
    match (count(Severity::Error), count(Severity::Warning)) {
        (0, 0) => format!("no mistakes in {id}"),
        (errors, 0) => format!("{} in {id}", say(errors, "error")),
        (0, warnings) => format!("{} in {id}", say(warnings, "warning")),
        (errors, warnings) => format!("{}, {} in {id}", say(errors, "error"), say(warnings, "warning")),
    }
}

/// The text of a file that a snippet may show.
fn read_text(path: &Path) -> Option<String> {
    const SNIPPET_BYTES: u64 = 64 << 20;
    let is_small = std::fs::metadata(path).is_ok_and(|metadata| metadata.len() <= SNIPPET_BYTES);
    let bytes = is_small.then(|| std::fs::read(path).ok())??;
    String::from_utf8(bytes).ok().filter(|text| !text.contains('\0'))
}

/// 1-based line and column (in characters) of a place.
fn line_and_column(place: &Place, text: Option<&str>) -> Option<(usize, usize)> {
    match place {
        Place::File => None,
        Place::Line(line) => Some((*line as usize, 1)),
        Place::Span(span) => {
            let before = text?.get(..span.start)?;
            let line_start = before.rfind('\n').map_or(0, |newline| newline + 1);
            Some((before.matches('\n').count() + 1, before[line_start..].chars().count() + 1))
        }
    }
}

fn human(diagnostic: &Diagnostic, text: Option<&str>, color: bool) -> String {
    let level = match diagnostic.severity {
        Severity::Error => Level::ERROR,
        Severity::Warning => Level::WARNING,
    };
    let title = level.primary_title(&diagnostic.problem).id(&*diagnostic.code);
    let help = Level::HELP.message(&diagnostic.help);
    let line_text;
    let snippet = match (&diagnostic.place, text) {
        (Place::Span(span), Some(text)) if text.get(span.clone()).is_some() => {
            Some(Snippet::source(text).annotation(AnnotationKind::Primary.span(span.clone())))
        }
        (Place::Line(line), Some(text)) => {
            line_text = text.lines().nth((*line as usize).saturating_sub(1)).map(shortened);
            line_text.as_deref().map(|line_text| {
                let span = 0..line_text.len();
                Snippet::source(line_text).line_start(*line as usize).annotation(AnnotationKind::Primary.span(span))
            })
        }
        _ => None,
    };
    let group = match snippet {
        Some(snippet) => title.element(snippet.path(&diagnostic.file)).element(help),
        None => {
            let origin = Origin::path(&diagnostic.file);
            title
                .element(match line_and_column(&diagnostic.place, text) {
                    Some((line, column)) => origin.line(line).char_column(column),
                    None => origin,
                })
                .element(help)
        }
    };
    let renderer = if color { Renderer::styled() } else { Renderer::plain() };
    format!("{}\n\n", renderer.render(&[group]))
}

/// The beginning of a line, short enough for a snippet.
fn shortened(line: &str) -> String {
    const CHARACTERS: usize = 80;
    let mut short: String = line.trim_end().chars().take(CHARACTERS).collect();
    if line.trim_end().chars().count() > CHARACTERS {
        short.push('…');
    }
    short
}

fn json(diagnostic: &Diagnostic, text: Option<&str>) -> String {
    let at = line_and_column(&diagnostic.place, text);
    let object = serde_json::json!({
        "severity": severity_name(diagnostic.severity),
        "code": diagnostic.code,
        "file": diagnostic.file,
        "line": at.map(|(line, _)| line),
        "column": at.map(|(_, column)| column),
        "problem": diagnostic.problem,
        "help": diagnostic.help,
    });
    format!("{object}\n")
}

fn github(diagnostic: &Diagnostic, text: Option<&str>, assets_dir: &Path) -> String {
    let message = |text: &str| text.replace('%', "%25").replace('\r', "%0D").replace('\n', "%0A");
    let property = |text: &str| message(text).replace(':', "%3A").replace(',', "%2C");
    let file = assets_dir.join(&diagnostic.file).to_string_lossy().replace('\\', "/");
    let at = line_and_column(&diagnostic.place, text);
    let at = at.map_or(String::new(), |(line, column)| format!(",line={line},col={column}"));
    let Diagnostic { code, problem, help, .. } = diagnostic;
    let severity = severity_name(diagnostic.severity);
    format!("::{severity} file={}{at},title={code}::{}\n", property(&file), message(&format!("{problem}\n{help}")))
}

const fn severity_name(severity: Severity) -> &'static str {
    match severity {
        Severity::Error => "error",
        Severity::Warning => "warning",
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn many_of_one_kind_become_a_count() {
        let line = |line| Diagnostic::error("obj-number", "a/base.obj", Place::Line(line)).problem("no number");
        let other = Diagnostic::warning("other", "a/base.obj", Place::Line(3)).problem("other");
        let mut all: Vec<Diagnostic> = (1..=100).rev().map(line).collect();
        all.push(other.clone());
        all.push(line(7));
        let kept = sorted(all);
        assert_eq!(kept.len(), OF_ONE_KIND + 2);
        assert_eq!(kept[0], line(1));
        assert!(kept.contains(&other));
        assert_eq!(kept.last().unwrap().problem, "and 95 more mistakes of this kind in this file");
    }

    #[test]
    fn summaries_count() {
        let error = Diagnostic::error("a", "f", Place::File);
        let warning = Diagnostic::warning("a", "f", Place::File);
        assert_eq!(summary(&[], "komon"), "no mistakes in komon");
        assert_eq!(summary(&[error.clone(), error.clone(), warning.clone()], "komon"), "2 errors, 1 warning in komon");
        assert_eq!(summary(&[error], "komon"), "1 error in komon");
        assert_eq!(summary(&[warning.clone(), warning], "komon"), "2 warnings in komon");
    }

    #[test]
    fn github_annotations_are_escaped() {
        let diagnostic = Diagnostic::error("c", "a,b:c/x.obj", Place::Line(3)).problem("100 % wrong").help("do: it");
        let text = render(&[diagnostic], Path::new("assets-src"), Format::Github);
        assert_eq!(text, "::error file=assets-src/a%2Cb%3Ac/x.obj,line=3,col=1,title=c::100 %25 wrong%0Ado: it\n");
    }

    #[test]
    fn places_outside_the_file_are_harmless() {
        let dir = tempfile::tempdir().unwrap();
        std::fs::write(dir.path().join("t"), "é = 1\n").unwrap();
        for place in [Place::File, Place::Line(0), Place::Line(99), Place::Span(1..2), Place::Span(5..500)] {
            let diagnostic = Diagnostic::error("c", "t", place).problem("p").help("h");
            for format in [Format::Human { color: true }, Format::Human { color: false }, Format::Json, Format::Github]
            {
                assert!(render(std::slice::from_ref(&diagnostic), dir.path(), format).contains('p'));
            }
        }
    }
}
