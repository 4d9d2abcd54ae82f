//! Which vertex of another export is which vertex of the base: guesses (by texture coordinates, by the order of faces, by that of vertices),
//! each of which must be proved by all faces before it is believed. Knows no garment, unit or file.

mod order;
mod proof;
mod texture;

use crate::source::obj::{Corner, Mesh};
use glam::{DVec3, Vec2};

/// What identified the vertices.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Evidence {
    /// Places in the texture.
    Texture,
    /// Faces stand in the base's order.
    Faces,
    /// Vertices stand in the base's order, piece by piece.
    Vertices,
}

/// The other mesh, put in the order of the base.
#[derive(Clone, Debug, PartialEq)]
pub struct Recovered {
    /// The base's vertices and faces with the other's places and texture coordinates.
    pub mesh: Mesh,
    /// For each vertex of the base that of the other; of several copies at one place the first.
    pub vertex_of: Vec<u32>,
    /// What identified them.
    pub evidence: Evidence,
}

/// Why the order cannot be recovered.
#[derive(Clone, Debug, PartialEq)]
pub enum Lost {
    /// It is another mesh: faces are missing, more, or join other vertices.
    OtherFaces,
    /// Neither faces nor vertices stand in the base's order, and there are no texture coordinates to go by.
    NoTexture,
    /// So many places of vertices in the texture are nowhere in the base's.
    OtherTexture(usize),
    /// So many places in the texture are those of several vertices, and no edge tells which.
    Overlapping(usize),
    /// Copies of one vertex lie apart.
    Torn {
        /// The base's vertex.
        vertex: u32,
        /// The pieces that the copies belong to, as the other calls them.
        parts: [String; 2],
        /// How far, in the other's unit.
        apart: f64,
    },
    /// Vertices that lie apart in the base are one.
    Merged([u32; 2]),
    /// This share of the edges has other lengths, so that the order of faces or vertices was chance.
    OtherLengths(f64),
}

/// Whether the other has the vertices of the base, joined by the same faces (or by all of them turned over).
#[must_use]
pub fn is_in_order(base: &Mesh, other: &Mesh) -> bool {
    let vertices =
        |mesh: &Mesh, face| mesh.corners_of(face).iter().map(|corner: &Corner| corner.vertex).collect::<Vec<_>>();
    if base.positions.len() != other.positions.len() || base.faces.len() != other.faces.len() {
        return false;
    }
    let mut pairs = base.faces.iter().zip(&other.faces);
    if pairs.all(|(a, b)| vertices(base, a) == vertices(other, b)) {
        return true;
    }
    let wanted = sorted_cycles(base, false);
    sorted_cycles(other, false) == wanted || sorted_cycles(other, true) == wanted
}

/// The faces as cycles from their least vertex, sorted; reversed ones when `turned_over`.
pub(super) fn sorted_cycles(mesh: &Mesh, turned_over: bool) -> Vec<Vec<u32>> {
    let cycle = |face| {
        let mut cycle: Vec<u32> = mesh.corners_of(face).iter().map(|corner| corner.vertex).collect();
        if turned_over {
            cycle.reverse();
        }
        let least = (0..cycle.len()).min_by_key(|&i| cycle[i]).unwrap_or(0);
        cycle.rotate_left(least);
        cycle
    };
    let mut cycles: Vec<Vec<u32>> = mesh.faces.iter().map(cycle).collect();
    cycles.sort_unstable();
    cycles
}

/// Puts the other mesh in the order of the base.
///
/// # Errors
/// Why that cannot be done: nothing tells the vertices, or it is not the same cloth.
pub fn recover(base: &Mesh, other: &Mesh) -> Result<Recovered, Lost> {
    // What is missing or subdivided can be no other order.
    if base.faces.is_empty()
        || triangle_count(base) != triangle_count(other)
        || has_loose_vertices(base)
        || has_loose_vertices(other)
    {
        return Err(Lost::OtherFaces);
    }
    let mut lost = None;
    // The first reason is that of the strongest guess; what is torn or merged is proved to be the same cloth.
    let mut note = |reason: Lost| {
        let is_proof = matches!(reason, Lost::Torn { .. } | Lost::Merged(_));
        if lost.is_none() || (is_proof && !matches!(lost, Some(Lost::Torn { .. } | Lost::Merged(_)))) {
            lost = Some(reason);
        }
    };
    if base.is_textured() && other.is_textured() {
        let proved =
            texture::guess(base, other).and_then(|guess| Ok((proof::prove(base, other, &guess, false)?, guess)));
        match proved {
            Ok((vertex_of, guess)) => return Ok(recovered(base, other, vertex_of, &guess, Evidence::Texture)),
            Err(reason) => note(reason),
        }
    }
    for (guess, evidence) in order::guesses(base, other) {
        match proof::prove(base, other, &guess, true) {
            Ok(vertex_of) => return Ok(recovered(base, other, vertex_of, &guess, evidence)),
            // Most guesses are wrong, which tells nothing of the file.
            Err(Lost::OtherFaces) => {}
            Err(reason) => note(reason),
        }
    }
    let none = if base.is_textured() && other.is_textured() { Lost::OtherFaces } else { Lost::NoTexture };
    Err(lost.unwrap_or(none))
}

fn triangle_count(mesh: &Mesh) -> usize {
    mesh.faces.iter().map(|face| face.corner_count as usize - 2).sum()
}

fn has_loose_vertices(mesh: &Mesh) -> bool {
    let mut is_used = vec![false; mesh.positions.len()];
    mesh.corners.iter().for_each(|corner| is_used[corner.vertex as usize] = true);
    is_used.contains(&false)
}

/// A guess: the base's corner (vertex and texture coordinate) of each corner of the other.
type Guess = Vec<Corner>;

fn recovered(base: &Mesh, other: &Mesh, vertex_of: Vec<u32>, guess: &Guess, evidence: Evidence) -> Recovered {
    let mut mesh = Mesh {
        positions: vertex_of.iter().map(|&vertex| other.positions[vertex as usize]).collect(),
        position_lines: vertex_of.iter().map(|&vertex| other.position_lines[vertex as usize]).collect(),
        normal_count: other.normal_count,
        names_read_as: other.names_read_as,
        ..base.clone()
    };
    if base.is_textured() && other.is_textured() {
        for (corner, own) in other.corners.iter().zip(guess) {
            if let (Some(to), Some(from)) = (own.uv, corner.uv) {
                mesh.uv[to as usize] = other.uv[from as usize];
            }
        }
    } else {
        mesh.uv = Vec::new();
        mesh.corners.iter_mut().for_each(|corner| corner.uv = None);
    }
    Recovered { mesh, vertex_of, evidence }
}

/// The step in which numbers were written: that of the fewest decimals that hold them all, but none finer than `least`.
fn step(numbers: impl Iterator<Item = f64> + Clone, least: f64) -> f64 {
    let steps = (0..9).map(|decimals| 10f64.powi(-decimals));
    let is_whole = |number: f64, step: f64| {
        let count = number / step;
        (count - count.round()).abs() <= 1e-6 * count.abs().max(1.0) + 0.1 * least / step
    };
    let mut steps = steps.take_while(|step| *step > least);
    steps.find(|step| numbers.clone().all(|number| is_whole(number, *step))).unwrap_or(least)
}

fn step_of_places(places: &[DVec3]) -> f64 {
    let numbers = places.iter().flat_map(|place| place.to_array());
    let largest = numbers.clone().fold(0.0f64, |largest, number| largest.max(number.abs()));
    step(numbers, 1e-7 * largest)
}

fn step_of_texture(uv: &[Vec2]) -> f64 {
    let numbers = uv.iter().flat_map(|uv| uv.to_array()).map(f64::from);
    let largest = numbers.clone().fold(0.0f64, |largest, number| largest.max(number.abs()));
    // Numbers of 32 bits.
    step(numbers, 2e-7 * largest)
}
