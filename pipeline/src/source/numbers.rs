//! Numbers as spreadsheets and keyboards write them: what is wrong with one that cannot be read, and how it is written
//! rightly. Knows no meaning of any number.

/// Why a cell is no number.
#[derive(Debug, PartialEq)]
pub(super) struct NoNumber {
    /// What all cells with this mistake have in common; empty where it is the cell's own.
    pub cause: &'static str,
    /// What is wrong.
    pub problem: String,
    /// What to do, where that is certain.
    pub help: Option<String>,
}

/// Dashes that spreadsheets and word processors write for a minus.
const MINUSES: [char; 6] = ['\u{2212}', '\u{2010}', '\u{2011}', '\u{2012}', '\u{2013}', '\u{2014}'];

/// Reads a finite number.
///
/// # Errors
/// What is wrong with it.
pub(super) fn read(text: &str) -> Result<f64, NoNumber> {
    if let Some(number) = finite(text) {
        return Ok(number);
    }
    if text.is_empty() {
        return Err(NoNumber { cause: "empty", problem: "the cell is empty".to_owned(), help: None });
    }
    let narrow = half_width(text);
    let dashed: String = narrow.chars().map(|c| if MINUSES.contains(&c) { '-' } else { c }).collect();
    let plain = if dashed.contains('.') { dashed.clone() } else { dashed.replacen(',', ".", 1) };
    if finite(&plain).is_none() {
        let computed = text.starts_with('#') && text.ends_with(['!', '?', 'A', '#']);
        return Err(NoNumber {
            cause: if computed { "error" } else { "" },
            problem: format!("`{}` is no number", shortened(text)),
            help: computed.then(|| {
                "The spreadsheet could not compute or show this cell: mend its formula or widen the column, and export again."
                    .to_owned()
            }),
        });
    }
    let (cause, what, how) = if narrow != text {
        ("full-width", "full-width characters", "type numbers in half-width (半角), or replace them in all cells")
    } else if dashed != narrow {
        ("minus", "a dash (such as U+2212) for the minus", "replace it by the keyboard's minus (U+002D) in all cells")
    } else {
        (
            "comma",
            "a decimal comma",
            "decimals take a point, in all cells (in a spreadsheet set its language to English and export again)",
        )
    };
    Err(NoNumber {
        cause,
        problem: format!("`{}` has {what}", shortened(text)),
        help: Some(format!("Write {plain}; {how}.")),
    })
}

fn finite(text: &str) -> Option<f64> {
    text.parse().ok().filter(|number: &f64| number.is_finite())
}

/// Digits, points and signs as Japanese keyboards also write them, `１５８．５`, become those that are read.
pub(super) fn half_width(text: &str) -> String {
    let narrow = |c: char| match c {
        '０'..='９' | '．' | '＋' | '－' | '，' => char::from_u32(u32::from(c) - 0xfee0).unwrap_or(c),
        _ => c,
    };
    text.chars().map(narrow).collect()
}

/// The beginning of a text, short enough for a message.
pub(super) fn shortened(text: &str) -> String {
    match text.char_indices().nth(40) {
        Some((end, _)) => format!("{}…", &text[..end]),
        None => text.to_owned(),
    }
}

/// How many decimals a number is written with; `None` where it has an exponent.
pub(super) fn decimals(text: &str) -> Option<usize> {
    match text.contains(['e', 'E']) {
        true => None,
        false => Some(text.split_once('.').map_or(0, |(_, decimals)| decimals.len())),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_keyboards_and_spreadsheets_write_is_named_with_its_mending() {
        for (text, cause, mended) in [
            ("−0.382683", "minus", "-0.382683"),
            ("–0.5", "minus", "-0.5"),
            ("−0,5", "minus", "-0.5"),
            ("０．５", "full-width", "0.5"),
            ("－0.5", "full-width", "-0.5"),
            ("0,707", "comma", "0.707"),
            ("3,06E-17", "comma", "3.06E-17"),
        ] {
            let error = read(text).unwrap_err();
            assert_eq!(error.cause, cause, "{text}");
            assert!(error.help.unwrap().starts_with(&format!("Write {mended};")), "{text}");
        }
        for (text, cause) in
            [("", "empty"), ("#REF!", "error"), ("#N/A", "error"), ("1,234.5", ""), ("NaN", ""), ("x", "")]
        {
            assert_eq!(read(text).unwrap_err().cause, cause, "{text}");
        }
        assert_eq!(read("-3.06E-17"), Ok(-3.06e-17));
    }
}
