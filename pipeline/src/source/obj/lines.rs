//! OBJ text as statements: where lines end, where they go on, where comments begin. Knows no element's meaning.

use memchr::{memchr, memrchr};
use std::borrow::Cow;

/// What a statement is about.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Keyword {
    Position,
    TextureCoordinate,
    Normal,
    Face,
    Group,
    Object,
    /// Passed over.
    Other,
}

/// One statement.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Statement<'a> {
    /// Its first line, counted from 1.
    pub line: u32,
    pub keyword: Keyword,
    /// What follows the keyword, comment included.
    pub rest: Cow<'a, [u8]>,
}

/// The statements of a text that begins at a statement.
pub(super) struct Statements<'a> {
    text: &'a [u8],
    /// The next line.
    line: u32,
}

impl<'a> Statements<'a> {
    /// The statements of a text whose first line has this number.
    pub fn new(text: &'a [u8], line: u32) -> Statements<'a> {
        Statements { text, line }
    }

    /// The number of the line after the last one given.
    pub fn next_line(&self) -> u32 {
        self.line
    }

    fn take_line(&mut self) -> Option<&'a [u8]> {
        if self.text.is_empty() {
            return None;
        }
        let (line, rest) = match memchr(b'\n', self.text) {
            Some(end) => (&self.text[..end], &self.text[end + 1..]),
            None => (self.text, &[][..]),
        };
        self.text = rest;
        self.line += 1;
        Some(line.strip_suffix(b"\r").unwrap_or(line))
    }
}

impl<'a> Iterator for Statements<'a> {
    type Item = Statement<'a>;

    fn next(&mut self) -> Option<Statement<'a>> {
        let line = self.line;
        let text = self.take_line()?;
        if let Some(start) = continued(text) {
            let (keyword, rest, goes_on) = split(start);
            if goes_on {
                let mut whole = rest.to_vec();
                let mut next = self.take_line();
                while let Some(text) = next {
                    whole.push(b' ');
                    let start = continued(text);
                    whole.extend_from_slice(start.unwrap_or(text));
                    next = start.and_then(|_| self.take_line());
                }
                return Some(Statement { line, keyword, rest: Cow::Owned(whole) });
            }
        }
        let (keyword, rest, _) = split(text);
        Some(Statement { line, keyword, rest: Cow::Borrowed(rest) })
    }
}

/// A line without the `\` at its end by which it goes on in the next; none where there is no such, or a comment.
fn continued(line: &[u8]) -> Option<&[u8]> {
    line.strip_suffix(b"\\").filter(|start| memchr(b'#', start).is_none())
}

/// A line's keyword, what follows it, and whether a `\` at the end continues it. Names never go on: the last byte of
/// many in Shift-JIS is a `\`.
fn split(line: &[u8]) -> (Keyword, &[u8], bool) {
    let line = line.trim_ascii_start();
    let end = line.iter().position(u8::is_ascii_whitespace).unwrap_or(line.len());
    let (keyword, goes_on) = match &line[..end] {
        b"v" => (Keyword::Position, true),
        b"vt" => (Keyword::TextureCoordinate, true),
        b"vn" => (Keyword::Normal, true),
        b"f" => (Keyword::Face, true),
        b"l" | b"p" => (Keyword::Other, true),
        b"g" => (Keyword::Group, false),
        b"o" => (Keyword::Object, false),
        _ => (Keyword::Other, false),
    };
    (keyword, &line[end..], goes_on)
}

/// Takes the first word off a text; none where only blanks or a comment are left.
pub(super) fn take_word<'a>(text: &mut &'a [u8]) -> Option<&'a [u8]> {
    let start = text.trim_ascii_start();
    // `1.#INF` and `-1.#IND` are how some programs spell what is no number, and no numbers with comments.
    let is_end = |at: &usize| ends_word(start[*at]) && !(start[*at] == b'#' && *at > 0 && start[*at - 1] == b'.');
    let end = (0..start.len()).find(is_end).unwrap_or(start.len());
    *text = &start[end..];
    (end > 0).then(|| &start[..end])
}

/// Whether a byte ends the word before it.
pub(super) fn ends_word(byte: u8) -> bool {
    byte.is_ascii_whitespace() || byte == b'#'
}

/// A name without the comment behind it, which begins at a `#` after a blank: `part#2 # left` is `part#2`.
pub(super) fn name(rest: &[u8]) -> &[u8] {
    let is_comment = |at: &usize| rest[..*at].last().is_none_or(u8::is_ascii_whitespace);
    let end = memchr::memchr_iter(b'#', rest).find(is_comment).unwrap_or(rest.len());
    rest[..end].trim_ascii()
}

/// Where the last statement ends that ends in a line break; 0 where there is none.
pub(super) fn last_end(text: &[u8]) -> usize {
    let mut end = text.len();
    while let Some(at) = memrchr(b'\n', &text[..end]) {
        if !may_go_on(&text[..at]) {
            return at + 1;
        }
        end = at;
    }
    0
}

/// Whether a line, of which this is the end, may go on in the next.
fn may_go_on(line: &[u8]) -> bool {
    line.strip_suffix(b"\r").unwrap_or(line).ends_with(b"\\")
}

/// Cuts a text after line ends where a statement ends, too, into pieces of about so many bytes.
pub(super) fn pieces(mut text: &[u8], bytes: usize) -> impl Iterator<Item = &[u8]> {
    std::iter::from_fn(move || {
        let mut end = bytes.min(text.len());
        loop {
            let Some(at) = memchr(b'\n', &text[end..]) else {
                end = text.len();
                break;
            };
            let line = &text[..end + at];
            end += at + 1;
            if !may_go_on(line) {
                break;
            }
        }
        let (piece, rest) = text.split_at(end);
        text = rest;
        (!piece.is_empty()).then_some(piece)
    })
}
