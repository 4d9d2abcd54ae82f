//! OBJ meshes in the file's own vertex order, each element with its line. Reads `v`, `vt`, `f`, `g` and `o`; materials,
//! normals, colours and curves are passed over. Knows no unit and no garment. `lines` cuts the text into statements,
//! `piece` reads a piece of them, and here pieces become one mesh.
//!
//! Everything of a garment (targets, masks, paths) is keyed by the number of a `v` line, and every message needs the
//! line, hence a reader of our own instead of an importer that renumbers; the tests hold it against ufbx.

mod lines;
pub(super) mod names;
mod number;
mod piece;
#[cfg(test)]
#[allow(clippy::print_stdout)]
mod tests;
mod triangulation;

use super::causes::Causes;
use crate::diagnostic::{Diagnostic, Place};
use glam::{DVec3, Vec2};
use kitsuke::arrays::limits;
use piece::{Counts, Piece};
use rayon::prelude::*;
use std::collections::BTreeMap;
use std::io::{self, Read};
pub use triangulation::Triangles;

/// Name of the part of faces before any `g` or `o`.
const UNNAMED_PART: &[u8] = b"default";
/// Texts are read in pieces of about so many bytes, several at once; what is read does not depend on where they end.
const PIECE_BYTES: usize = 1 << 16;
/// About how many pieces are read at once, before they are joined.
const PIECES: usize = 32;
/// So much at least is read at once, so that what kind of file it is can be seen.
const LEAST_BYTES: usize = 1 << 12;

/// A polygon mesh as it stands in the file.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Mesh {
    /// Positions in the file's unit and axes, one per `v` line.
    pub positions: Vec<DVec3>,
    /// The line of each position.
    pub position_lines: Vec<u32>,
    /// Texture coordinates, one per `vt` line.
    pub uv: Vec<Vec2>,
    /// Polygons in file order.
    pub faces: Vec<Face>,
    /// Vertex and texture-coordinate index of every corner of every polygon.
    pub corners: Vec<Corner>,
    /// Names of the parts, by first appearance: the group's name, or the object's where there is no group.
    pub parts: Vec<String>,
    /// How many `vn` lines there are; normals are computed, not read.
    pub normal_count: usize,
    /// The encoding of the names where it is not UTF-8, and the line of the first that shows it.
    pub names_read_as: Option<(&'static str, u32)>,
}

/// One polygon of 3 or more corners.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Face {
    /// The line.
    pub line: u32,
    /// Its first corner.
    pub first_corner: u32,
    /// How many.
    pub corner_count: u32,
    /// Its part.
    pub part: u32,
}

/// One corner of a polygon.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct Corner {
    /// Index of the position.
    pub vertex: u32,
    /// Index of the texture coordinate, if it has one.
    pub uv: Option<u32>,
}

impl Mesh {
    /// The corners of a polygon.
    #[must_use]
    pub fn corners_of(&self, face: &Face) -> &[Corner] {
        &self.corners[face.first_corner as usize..][..face.corner_count as usize]
    }

    /// Whether every corner has a texture coordinate.
    #[must_use]
    pub fn is_textured(&self) -> bool {
        !self.corners.is_empty() && self.corners.iter().all(|corner| corner.uv.is_some())
    }
}

/// Reads a mesh; reports every line that cannot be understood.
pub fn read(file: &str, bytes: &[u8], report: &mut Vec<Diagnostic>) -> Option<Mesh> {
    read_in_pieces(file, bytes, PIECE_BYTES, report).expect("reading bytes cannot fail")
}

/// Reads a mesh from a file, of which only a block at a time is held beside the mesh; fails where it cannot be read.
pub fn read_from(file: &str, source: impl Read, report: &mut Vec<Diagnostic>) -> io::Result<Option<Mesh>> {
    read_in_pieces(file, source, PIECE_BYTES, report)
}

fn read_in_pieces(
    file: &str,
    mut source: impl Read,
    piece_bytes: usize,
    report: &mut Vec<Diagnostic>,
) -> io::Result<Option<Mesh>> {
    let mut block_bytes = (PIECES * piece_bytes).max(LEAST_BYTES);
    let mut block = Vec::with_capacity(2 * block_bytes);
    let mut reader = Reader::new(file, report);
    let mut pieces: Vec<Piece> = Vec::new();
    let mut before: Option<Counts> = None;
    loop {
        let is_last = source.by_ref().take(block_bytes as u64).read_to_end(&mut block)? < block_bytes;
        if before.is_none() {
            if let Some(problem) = foreign_content(&block) {
                reader.refuse_file(problem);
                return Ok(None);
            }
            if block.starts_with(b"\xef\xbb\xbf") {
                block.drain(..3);
            }
        }
        let end = if is_last { block.len() } else { lines::last_end(&block) };
        let texts: Vec<&[u8]> = lines::pieces(&block[..end], piece_bytes).collect();
        // Indices may count backwards from a line, so that a piece must know what stands before it.
        let counts: Vec<Counts> = texts.par_iter().map(|text| Counts::of(text)).collect();
        let mut after = before.unwrap_or_default();
        let mut known = Vec::with_capacity(counts.len());
        for counts in counts {
            known.push(after);
            after = after.and(counts);
        }
        pieces.resize_with(texts.len().max(pieces.len()), Piece::default);
        let read = texts.par_iter().zip(known).zip(&mut pieces);
        read.for_each(|((text, before), piece)| piece.read(text, before));
        for piece in &mut pieces[..texts.len()] {
            if reader.join(piece).is_none() {
                reader.causes.report("line", reader.report);
                return Ok(None);
            }
        }
        before = Some(after);
        if is_last {
            reader.mesh.normal_count = after.normals;
            return Ok(reader.finish());
        }
        if end == 0 {
            // A statement longer than all that was read.
            block_bytes *= 2;
        }
        block.drain(..end);
    }
}

/// Says what a file is that is no OBJ text.
fn foreign_content(bytes: &[u8]) -> Option<&'static str> {
    match bytes {
        [0xff, 0xfe, ..] | [0xfe, 0xff, ..] => Some("the file is UTF-16 text"),
        _ if bytes.starts_with(b"Kaydara FBX") => Some("the file is an FBX scene, not OBJ"),
        _ if bytes.starts_with(b"PK\x03\x04") => Some("the file is an archive (a ZPRJ or ZIP), not OBJ"),
        _ if bytes.starts_with(b"glTF") => Some("the file is a GLB scene, not OBJ"),
        _ if ends_in_cr_alone(&bytes[..bytes.len().min(4096)]) => {
            Some("the lines end in CR alone, as no program of today writes them; they must end in LF or CRLF")
        }
        _ if bytes.iter().take(4096).any(|&byte| byte == 0) => Some("the file is binary, or UTF-16 text, not OBJ"),
        _ => None,
    }
}

fn ends_in_cr_alone(start: &[u8]) -> bool {
    start.iter().filter(|&&byte| byte == b'\r').count() > 2 && !start.contains(&b'\n')
}

struct Reader<'a> {
    file: &'a str,
    report: &'a mut Vec<Diagnostic>,
    causes: Causes,
    mesh: Mesh,
    group: Vec<u8>,
    object: Vec<u8>,
    /// Part of the faces that follow; found anew after each `g` and `o`.
    part: Option<u32>,
    /// The parts by the bytes of their names.
    parts: BTreeMap<Vec<u8>, u32>,
    /// The bytes of each part's name, and the line of the name.
    part_names: Vec<(Vec<u8>, u32)>,
    /// The line of the last `g` or `o`.
    name_line: u32,
}

impl<'a> Reader<'a> {
    fn new(file: &'a str, report: &'a mut Vec<Diagnostic>) -> Reader<'a> {
        Reader {
            file,
            report,
            causes: Causes::default(),
            mesh: Mesh::default(),
            group: Vec::new(),
            object: Vec::new(),
            part: None,
            parts: BTreeMap::new(),
            part_names: Vec::new(),
            name_line: 1,
        }
    }

    fn refuse(&mut self, code: &'static str, line: u32, problem: String) {
        let help = match code {
            "obj-number" => "Export the shape again; every number must be finite.",
            "obj-face" => "Export the shape again; a face needs three or more corners that name vertices of the file.",
            "obj-names" => {
                "Save the file in UTF-8, or give the pieces names of letters A to Z and digits, then export all shapes again."
            }
            _ => "Export a lighter mesh.",
        };
        let file = self.file;
        let said = |problem: &str| Diagnostic::error(code, file, Place::Line(line)).problem(problem).help(help);
        self.causes.add(code, problem.clone(), || said(&problem));
    }

    fn refuse_file(&mut self, problem: &str) {
        self.report.push(
            Diagnostic::error("obj-encoding", self.file, Place::File)
                .problem(problem)
                .help("Export the shape as Wavefront OBJ, a text file in UTF-8."),
        );
    }

    /// Adds the next piece; none where the mesh becomes too large.
    fn join(&mut self, piece: &mut Piece) -> Option<()> {
        let Piece { positions, position_lines, uv, faces, corners, names, problems } = piece;
        for problem in problems.drain(..) {
            self.refuse(problem.code, problem.line, problem.text);
        }
        let (vertices_left, faces_left) =
            (limits::VERTICES - self.mesh.positions.len(), limits::TRIANGLES - self.mesh.faces.len());
        let lines = [position_lines.get(vertices_left).copied(), faces.get(faces_left).map(|face| face.line)];
        if let Some(line) = lines.into_iter().flatten().min() {
            let problem = "the mesh is larger than 4,194,304 vertices or 8,388,608 faces".to_owned();
            self.refuse("obj-limit", line, problem);
            return None;
        }
        let mut names = names.iter().peekable();
        let first_corner = self.mesh.corners.len() as u32;
        self.mesh.faces.reserve(faces.len());
        for (number, face) in faces.iter().enumerate() {
            while let Some(statement) = names.next_if(|statement| statement.faces_before <= number) {
                self.rename(statement);
            }
            let part = self.current_part();
            self.mesh.faces.push(Face { first_corner: first_corner + face.first_corner, part, ..*face });
        }
        names.for_each(|statement| self.rename(statement));
        self.mesh.positions.extend_from_slice(positions);
        self.mesh.position_lines.extend_from_slice(position_lines);
        self.mesh.uv.extend_from_slice(uv);
        self.mesh.corners.extend_from_slice(corners);
        Some(())
    }

    fn rename(&mut self, statement: &piece::NameStatement) {
        (if statement.is_group { &mut self.group } else { &mut self.object }).clone_from(&statement.name);
        self.name_line = statement.line;
        self.part = None;
    }

    fn current_part(&mut self) -> u32 {
        if let Some(part) = self.part {
            return part;
        }
        let names = [&self.group, &self.object, UNNAMED_PART];
        let name = names.into_iter().find(|name| !name.is_empty()).unwrap_or_default();
        let next = self.part_names.len() as u32;
        let part = self.parts.get(name).copied().unwrap_or(next);
        if part == next {
            self.parts.insert(name.to_vec(), next);
            self.part_names.push((name.to_vec(), self.name_line));
        }
        self.part = Some(part);
        part
    }

    /// Checks the indices, which may point forward, against the whole file, and decodes the names.
    fn finish(mut self) -> Option<Mesh> {
        let (vertices, uvs) = (self.mesh.positions.len(), self.mesh.uv.len());
        let lacks_vertex = |corner: &Corner| corner.vertex as usize >= vertices;
        let lacks_uv = |corner: &Corner| corner.uv.is_some_and(|uv| uv as usize >= uvs);
        if self.mesh.corners.iter().any(|corner| lacks_vertex(corner) || lacks_uv(corner)) {
            for number in 0..self.mesh.faces.len() {
                let face = self.mesh.faces[number];
                for corner in face.first_corner..face.first_corner + face.corner_count {
                    let corner = self.mesh.corners[corner as usize];
                    if lacks_vertex(&corner) {
                        let problem = format!("vertex {} is named, but there are {vertices}", corner.vertex + 1);
                        self.refuse("obj-face", face.line, problem);
                    }
                    if let Some(uv) = corner.uv.filter(|_| lacks_uv(&corner)) {
                        let problem = format!("texture coordinate {} is named, but there are {uvs}", uv + 1);
                        self.refuse("obj-face", face.line, problem);
                    }
                }
            }
        }
        self.decode_names();
        let is_sound = self.causes.is_empty();
        self.causes.report("line", self.report);
        is_sound.then_some(self.mesh)
    }

    fn decode_names(&mut self) {
        let bytes: Vec<&[u8]> = self.part_names.iter().map(|(name, _)| &**name).collect();
        let decoded = match names::decode(&bytes) {
            Ok(decoded) => decoded,
            Err((name, encoding)) => {
                let problem = format!(
                    "the name of this piece is text neither in UTF-8 nor in {encoding}, in which others seem to be"
                );
                return self.refuse("obj-names", self.part_names[name].1, problem);
            }
        };
        let mut lines: BTreeMap<&str, u32> = BTreeMap::new();
        let mut alike = Vec::new();
        for (name, (_, line)) in decoded.names.iter().zip(&self.part_names) {
            if let Some(first) = lines.insert(name, *line) {
                alike.push((
                    *line,
                    format!("the piece's name and that of line {first} are different bytes, but both read `{name}`"),
                ));
            }
        }
        for (line, problem) in alike {
            self.refuse("obj-names", line, problem);
        }
        self.mesh.names_read_as = decoded.foreign.map(|(encoding, name)| (encoding, self.part_names[name].1));
        self.mesh.parts = decoded.names;
    }
}
