//! What the last successful build of a garment was made from, so that a build without changes is only hashing, and a
//! rebuild can say why. A file of the cache: losing it costs a rebuild.

use crate::diagnostic::{Diagnostic, Place, Severity};
use crate::source::InputFile;
use std::collections::BTreeMap;
use std::fmt::Write;
use std::path::Path;

/// Inputs and result of a build.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct LastBuild {
    /// blake3 of the program that built it, so that a changed stage is not taken for no change.
    pub builder: String,
    /// blake3 of the pack.
    pub pack: String,
    /// blake3 of its entry in the index.
    pub entry: String,
    /// blake3 of every input file by its path.
    pub inputs: BTreeMap<String, String>,
    /// What the artist was told; it holds as long as nothing changes.
    pub said: Vec<Diagnostic>,
}

impl LastBuild {
    /// Inputs as `source` lists them.
    #[must_use]
    pub fn inputs(files: &[InputFile]) -> BTreeMap<String, String> {
        files.iter().map(|file| (file.path.clone(), file.blake3.clone())).collect()
    }

    /// Reads the record, if there is one.
    #[must_use]
    pub fn read(path: &Path) -> Option<LastBuild> {
        let mut record = LastBuild::default();
        for line in std::fs::read_to_string(path).ok()?.lines() {
            let (key, value) = line.split_once(' ')?;
            match key {
                "builder" => record.builder = value.to_owned(),
                "pack" => record.pack = value.to_owned(),
                "entry" => record.entry = value.to_owned(),
                "said" => record.said.push(diagnostic(value)?),
                "input" => {
                    let (hash, path) = value.split_once(' ')?;
                    record.inputs.insert(path.to_owned(), hash.to_owned());
                }
                _ => return None,
            }
        }
        Some(record)
    }

    /// The record as text.
    #[must_use]
    pub fn to_text(&self) -> String {
        let mut text = format!("builder {}\npack {}\nentry {}\n", self.builder, self.pack, self.entry);
        for (path, hash) in &self.inputs {
            let _ = writeln!(text, "input {hash} {path}");
        }
        for said in &self.said {
            let _ = writeln!(text, "said {}", line(said));
        }
        text
    }

    /// Why a build from `inputs` by `builder` is no repetition of this one, one line each.
    #[must_use]
    pub fn reasons(&self, builder: &str, inputs: &BTreeMap<String, String>) -> Vec<String> {
        let mut reasons = Vec::new();
        if self.builder != builder || builder.is_empty() {
            reasons.push("the builder itself changed".to_owned());
        }
        for (path, hash) in inputs {
            match self.inputs.get(path) {
                None => reasons.push(format!("{path} is new")),
                Some(old) if old != hash => reasons.push(format!("{path} changed")),
                Some(_) => {}
            }
        }
        let gone = self.inputs.keys().filter(|path| !inputs.contains_key(*path));
        reasons.extend(gone.map(|path| format!("{path} is gone")));
        reasons
    }
}

/// A diagnostic as one line: its parts between tabs.
fn line(said: &Diagnostic) -> String {
    let severity = match said.severity {
        Severity::Error => "error",
        Severity::Warning => "warning",
    };
    let place = match &said.place {
        Place::File => "file".to_owned(),
        Place::Line(line) => format!("line {line}"),
        Place::Span(span) => format!("span {} {}", span.start, span.end),
    };
    let parts = [severity, &said.code, &place, &said.file, &said.problem, &said.help];
    let escaped = |part: &str| part.replace('\\', r"\\").replace('\t', r"\t").replace('\n', r"\n");
    parts.map(escaped).join("\t")
}

/// What [`line`] wrote.
fn diagnostic(line: &str) -> Option<Diagnostic> {
    let unescaped = |part: &str| {
        let mut text = String::new();
        let mut characters = part.chars();
        while let Some(character) = characters.next() {
            text.push(match character {
                '\\' => match characters.next()? {
                    't' => '\t',
                    'n' => '\n',
                    other => other,
                },
                other => other,
            });
        }
        Some(text)
    };
    let parts: Vec<String> = line.split('\t').map(unescaped).collect::<Option<_>>()?;
    let [severity, code, place, file, problem, help]: [String; 6] = parts.try_into().ok()?;
    let severity = match severity.as_str() {
        "error" => Severity::Error,
        "warning" => Severity::Warning,
        _ => return None,
    };
    let words: Vec<&str> = place.split(' ').collect();
    let place = match words[..] {
        ["file"] => Place::File,
        ["line", line] => Place::Line(line.parse().ok()?),
        ["span", start, end] => Place::Span(start.parse().ok()?..end.parse().ok()?),
        _ => return None,
    };
    Some(Diagnostic { severity, code: code.into(), file, place, problem, help })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn reasons_name_the_files() {
        let inputs = |list: &[(&str, &str)]| list.iter().map(|&(path, hash)| (path.into(), hash.into())).collect();
        let record = LastBuild {
            builder: "b".into(),
            pack: "p".into(),
            entry: "e".into(),
            said: vec![
                Diagnostic::warning("c", "komon/a.obj", Place::Line(3)).problem("one\nline\t\\n").help("x"),
                Diagnostic::warning("d", "komon/a.obj", Place::Span(3..9)).problem("p").help("h"),
            ],
            inputs: inputs(&[("komon/a b.obj", "1"), ("komon/base.obj", "2"), ("komon/c.obj", "3")]),
        };
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("komon");
        assert_eq!(LastBuild::read(&path), None);
        std::fs::write(&path, record.to_text()).unwrap();
        assert_eq!(LastBuild::read(&path).as_ref(), Some(&record));

        assert_eq!(record.reasons("b", &record.inputs), [""; 0]);
        let now = inputs(&[("komon/a b.obj", "9"), ("komon/base.obj", "2"), ("komon/d.obj", "4")]);
        let wanted =
            ["the builder itself changed", "komon/a b.obj changed", "komon/d.obj is new", "komon/c.obj is gone"];
        assert_eq!(record.reasons("c", &now), wanted);
        std::fs::write(&path, "nonsense\n").unwrap();
        assert_eq!(LastBuild::read(&path), None);
    }
}
