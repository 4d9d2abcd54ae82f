//! Names of groups and objects: from bytes to text. Names of one file are in one encoding, and bytes decide which are
//! the same: names never become one part because decoding made them equal.

use chardetng::{EncodingDetector, Iso2022JpDetection, Utf8Detection};
use encoding_rs::{EUC_JP, Encoding, ISO_2022_JP, SHIFT_JIS, UTF_8};
use std::borrow::Cow;

/// Names as text.
#[derive(Debug)]
pub(in crate::source) struct Decoded {
    pub names: Vec<String>,
    /// The encoding, and which name shows first that it is not UTF-8; none where it is.
    pub foreign: Option<(&'static str, usize)>,
}

/// Decodes names. Fails with the number of a name that is text in no encoding that fits the others, and with the name
/// of the likeliest encoding.
pub(in crate::source) fn decode(names: &[&[u8]]) -> Result<Decoded, (usize, &'static str)> {
    // ISO-2022-JP is seven-bit: its escapes give it away.
    let is_foreign = |name: &&[u8]| std::str::from_utf8(name).is_err() || name.contains(&0x1b);
    let Some(first) = names.iter().position(is_foreign) else {
        return Ok(Decoded { names: with(UTF_8, names)?, foreign: None });
    };
    let guessed = guess(names);
    let likely = [guessed, SHIFT_JIS, EUC_JP, ISO_2022_JP];
    let decoded = likely.into_iter().find_map(|encoding| Some((with(encoding, names).ok()?, encoding)));
    match decoded {
        Some((names, encoding)) => Ok(Decoded { names, foreign: Some((encoding.name(), first)) }),
        None => Err((with(guessed, names).err().map_or(first, |(name, _)| name), guessed.name())),
    }
}

/// The likeliest encoding, of a kimono's file rather a Japanese one.
fn guess(names: &[&[u8]]) -> &'static Encoding {
    let mut detector = EncodingDetector::new(Iso2022JpDetection::Allow);
    detector.feed(&names.join(&b'\n'), true);
    detector.guess(Some(b"jp"), Utf8Detection::Deny)
}

/// The names in this encoding, or which of them is no text in it.
fn with(encoding: &'static Encoding, names: &[&[u8]]) -> Result<Vec<String>, (usize, &'static str)> {
    let decode = |(number, name): (usize, &&[u8])| {
        let text = encoding.decode_without_bom_handling_and_without_replacement(name);
        text.map(Cow::into_owned).ok_or((number, encoding.name()))
    };
    names.iter().enumerate().map(decode).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    #[test]
    fn names_are_read_in_the_encoding_in_which_they_were_written() {
        let kimono = ["左袖", "左衽", "右袖", "右衽", "衿"];
        let tables = ["袖表", "身頃表", "衿能", "ソデ"];
        let cases: [(&[&str], &'static Encoding); 9] = [
            (&kimono, UTF_8),
            (&kimono, SHIFT_JIS),
            (&kimono, EUC_JP),
            (&kimono, ISO_2022_JP),
            (&tables, SHIFT_JIS),
            (&tables, EUC_JP),
            (&["default", "袖"], SHIFT_JIS),
            // 袖 alone would be two bytes that are a letter in UTF-8.
            (&["左袖"], EUC_JP),
            (&["ｿﾃﾞ", "ﾐｺﾞﾛ", "ｴﾘ"], SHIFT_JIS),
        ];
        for (names, encoding) in cases {
            let bytes: Vec<Cow<'_, [u8]>> = names.iter().map(|name| encoding.encode(name).0).collect();
            let bytes: Vec<&[u8]> = bytes.iter().map(|name| &**name).collect();
            let decoded = decode(&bytes).unwrap();
            assert_eq!(decoded.names, names, "{}", encoding.name());
            let said = decoded.foreign.map_or("UTF-8", |(name, _)| name);
            assert_eq!(said, encoding.name(), "{names:?}");
        }
    }

    #[test]
    fn names_that_are_text_in_no_encoding_are_told() {
        // UTF-8 cut within a character, between names in Shift-JIS.
        let (number, _) = decode(&[b"sode", b"\x8d\xb6\x91\xb3", b"\x81"]).unwrap_err();
        assert_eq!(number, 2);
        // Ärmel and Rückenteil of another continent.
        assert_eq!(decode(&[b"\xc4rmel", b"R\xfcckenteil"]).unwrap_err(), (1, "Shift_JIS"));
    }
}
