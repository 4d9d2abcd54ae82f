//! One piece of an OBJ text, read by itself once it is known how many elements stand before it. Knows no names' text.

use super::lines::{Keyword, Statement, Statements, ends_word, name, take_word};
use super::{Corner, Face, number};
use glam::{DVec3, Vec2};

/// Most corners of one polygon.
const CORNERS: usize = 1024;
/// Numbers beyond are no places of cloth in any unit.
const LARGEST: f64 = 1e12;

/// How many elements a text has.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Counts {
    pub lines: u32,
    pub positions: usize,
    pub uv: usize,
    pub normals: usize,
}

impl Counts {
    /// Those of a text that begins at a statement.
    pub fn of(text: &[u8]) -> Counts {
        let mut counts = Counts::default();
        let mut statements = Statements::new(text, 0);
        for statement in &mut statements {
            match statement.keyword {
                Keyword::Position => counts.positions += 1,
                Keyword::TextureCoordinate => counts.uv += 1,
                Keyword::Normal => counts.normals += 1,
                _ => {}
            }
        }
        counts.lines = statements.next_line();
        counts
    }

    /// Those of a text and the one behind it.
    pub fn and(self, other: Counts) -> Counts {
        Counts {
            lines: self.lines.saturating_add(other.lines),
            positions: self.positions + other.positions,
            uv: self.uv + other.uv,
            normals: self.normals + other.normals,
        }
    }
}

/// What stands in a piece.
#[derive(Default)]
pub(super) struct Piece {
    pub positions: Vec<DVec3>,
    pub position_lines: Vec<u32>,
    pub uv: Vec<Vec2>,
    /// Their first corners count within the piece; they have no parts yet.
    pub faces: Vec<Face>,
    pub corners: Vec<Corner>,
    pub names: Vec<NameStatement>,
    pub problems: Vec<Problem>,
}

/// A `g` or `o`.
pub(super) struct NameStatement {
    pub line: u32,
    pub is_group: bool,
    pub name: Vec<u8>,
    /// How many faces of the piece stand before it.
    pub faces_before: usize,
}

/// What is wrong with a line.
pub(super) struct Problem {
    pub code: &'static str,
    pub line: u32,
    pub text: String,
}

impl Piece {
    /// Reads a text that begins at a statement, with so much before it, in place of what was read before.
    pub fn read(&mut self, text: &[u8], before: Counts) {
        let Piece { positions, position_lines, uv, faces, corners, names, problems } = self;
        positions.clear();
        position_lines.clear();
        uv.clear();
        faces.clear();
        corners.clear();
        names.clear();
        problems.clear();
        for Statement { line, keyword, rest } in Statements::new(text, before.lines.saturating_add(1)) {
            match keyword {
                Keyword::Position => {
                    let position = self.numbers::<3>(line, &rest, 3).unwrap_or_default();
                    self.positions.push(DVec3::from_array(position));
                    self.position_lines.push(line);
                }
                Keyword::TextureCoordinate => {
                    let [u, v] = self.numbers::<2>(line, &rest, 1).unwrap_or_default();
                    self.uv.push(Vec2::new(u as f32, v as f32));
                }
                Keyword::Face => self.face(line, &rest, before),
                Keyword::Group | Keyword::Object => {
                    let (name, faces_before) = (name(&rest).to_vec(), self.faces.len());
                    self.names.push(NameStatement { line, is_group: keyword == Keyword::Group, name, faces_before });
                }
                Keyword::Normal | Keyword::Other => {}
            }
        }
    }

    fn refuse(&mut self, code: &'static str, line: u32, text: String) {
        self.problems.push(Problem { code, line, text });
    }

    /// The first `N` numbers of a line, of which `required` must stand there; the others are 0.
    fn numbers<const N: usize>(&mut self, line: u32, mut text: &[u8], required: usize) -> Option<[f64; N]> {
        let mut numbers = [0.0; N];
        for (i, number) in numbers.iter_mut().enumerate() {
            let Some(word) = take_word(&mut text) else {
                if i < required {
                    self.refuse("obj-number", line, format!("{required} numbers are needed here, there are {i}"));
                    return None;
                }
                break;
            };
            let Some(parsed) = number::parse(word) else {
                self.refuse("obj-number", line, format!("`{}` is no finite number", shortened(word)));
                return None;
            };
            if parsed.abs() > LARGEST {
                self.refuse("obj-number", line, format!("`{}` is too large a number", shortened(word)));
                return None;
            }
            *number = parsed;
        }
        Some(numbers)
    }

    fn face(&mut self, line: u32, mut text: &[u8], before: Counts) {
        let first_corner = self.corners.len();
        loop {
            text = text.trim_ascii_start();
            let corner = match plain_corner(text) {
                Some((corner, length)) => {
                    text = &text[length..];
                    Ok(corner)
                }
                None => match take_word(&mut text) {
                    Some(word) => self.corner(word, before),
                    None => break,
                },
            };
            match corner {
                Ok(corner) => self.corners.push(corner),
                Err(problem) => {
                    self.corners.truncate(first_corner);
                    return self.refuse("obj-face", line, problem);
                }
            }
        }
        let corner_count = self.corners.len() - first_corner;
        if !(3..=CORNERS).contains(&corner_count) {
            self.corners.truncate(first_corner);
            return self.refuse("obj-face", line, format!("a face of {corner_count} corners"));
        }
        let (first_corner, corner_count) = (first_corner as u32, corner_count as u32);
        self.faces.push(Face { line, first_corner, corner_count, part: 0 });
    }

    /// `v`, `v/vt`, `v//vn` or `v/vt/vn`. Numbers count from 1, or backwards from the last element so far; whether a
    /// forward reference exists shows at the end of the file.
    fn corner(&self, word: &[u8], before: Counts) -> Result<Corner, String> {
        let mut indices = word.split(|byte| *byte == b'/');
        let vertex = indices.next().unwrap_or_default();
        let index = |text: &[u8], count: usize| {
            let number = std::str::from_utf8(text).ok().and_then(|text| text.parse::<i64>().ok());
            let number = number.ok_or_else(|| format!("`{}` is no corner", shortened(word)))?;
            let index = if number < 0 { count as i64 + number } else { number - 1 };
            u32::try_from(index).map_err(|_| format!("there is no element {number} before this line"))
        };
        let uv = indices.next().filter(|uv| !uv.is_empty());
        Ok(Corner {
            vertex: index(vertex, before.positions + self.positions.len())?,
            uv: uv.map(|uv| index(uv, before.uv + self.uv.len())).transpose()?,
        })
    }
}

/// The corner at the beginning of a text and its length, where it is spelled in the usual way: numbers of the file,
/// counted from 1.
fn plain_corner(text: &[u8]) -> Option<(Corner, usize)> {
    let (vertex, mut at) = plain_index(text)?;
    let mut uv = None;
    if text.get(at) == Some(&b'/') {
        at += 1;
        if text.get(at) != Some(&b'/') {
            let (index, length) = plain_index(&text[at..])?;
            uv = Some(index);
            at += length;
        }
        if text.get(at) == Some(&b'/') {
            at += 1;
            at += text[at..].iter().take_while(|byte| byte.is_ascii_digit()).count();
        }
    }
    text.get(at).is_none_or(|byte| ends_word(*byte)).then_some((Corner { vertex, uv }, at))
}

/// The index that a number of at most 9 digits names, and how many digits that are.
fn plain_index(text: &[u8]) -> Option<(u32, usize)> {
    let mut number = 0;
    let mut length = 0;
    while let Some(byte @ b'0'..=b'9') = text.get(length) {
        if length == 9 {
            return None;
        }
        number = number * 10 + u32::from(byte - b'0');
        length += 1;
    }
    Some((number.checked_sub(1)?, length))
}

fn shortened(word: &[u8]) -> String {
    let word = String::from_utf8_lossy(word);
    let mut short: String = word.chars().take(24).collect();
    if short.len() < word.len() {
        short.push('…');
    }
    short
}
