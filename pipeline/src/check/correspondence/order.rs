//! Guesses without texture coordinates: that faces, or vertices, stand in the base's order, as a whole or piece by piece. Knows no proof:
//! most guesses are wrong.

use super::{Evidence, Guess};
use crate::source::obj::{Corner, Mesh};
use glam::DVec3;

/// Another piece must lie so many times farther away to be out of question.
const CLEARLY: f64 = 1.5;

/// All guesses, the stronger ones first.
pub(super) fn guesses(base: &Mesh, other: &Mesh) -> Vec<(Guess, Evidence)> {
    let all = |mesh: &Mesh| vec![(0..mesh.faces.len()).collect::<Vec<usize>>()];
    let (whole, other_whole) = (all(base), all(other));
    let (parts, other_parts) = (faces_of_parts(base), faces_of_parts(other));
    let faces = |mesh: &Mesh, piece: &[usize]| -> Vec<u32> {
        piece.iter().map(|&face| mesh.faces[face].corner_count).collect()
    };
    let by_uv = |mesh: &Mesh, piece: &[usize]| vec![vertices_by_uv(mesh, piece).len() as u32];
    let by_number = |mesh: &Mesh, piece: &[usize]| vec![vertices_by_number(mesh, piece).len() as u32];
    let pair = |sign: Sign<'_>, other_sign: Sign<'_>| {
        let base_signs: Vec<Vec<u32>> = parts.iter().map(|piece| sign(base, piece)).collect();
        let other_signs: Vec<Vec<u32>> = other_parts.iter().map(|piece| other_sign(other, piece)).collect();
        pairs((base, &parts, &base_signs), (other, &other_parts, &other_signs))
    };
    let same = |pieces: &[Vec<usize>]| (0..pieces.len()).collect::<Vec<usize>>();
    let mut guesses = Vec::new();
    let mut add = |guess: Option<Guess>, evidence| guesses.extend(guess.map(|guess| (guess, evidence)));
    add(in_face_order(base, other, &whole, &other_whole, &same(&whole)), Evidence::Faces);
    if let Some(pairs) = pair(&faces, &faces) {
        add(in_face_order(base, other, &parts, &other_parts, &pairs), Evidence::Faces);
    }
    add(in_vertex_order(base, other, &whole, &other_whole, &same(&whole), vertices_by_uv), Evidence::Vertices);
    add(in_vertex_order(base, other, &whole, &other_whole, &same(&whole), vertices_by_number), Evidence::Vertices);
    if let Some(pairs) = pair(&by_uv, &by_number) {
        add(in_vertex_order(base, other, &parts, &other_parts, &pairs, vertices_by_uv), Evidence::Vertices);
    }
    if let Some(pairs) = pair(&by_number, &by_number) {
        add(in_vertex_order(base, other, &parts, &other_parts, &pairs, vertices_by_number), Evidence::Vertices);
    }
    guesses
}

fn faces_of_parts(mesh: &Mesh) -> Vec<Vec<usize>> {
    let mut faces = vec![Vec::new(); mesh.parts.len()];
    for (number, face) in mesh.faces.iter().enumerate() {
        faces[face.part as usize].push(number);
    }
    faces
}

/// What pieces that are one have alike.
type Sign<'a> = &'a dyn Fn(&Mesh, &[usize]) -> Vec<u32>;

/// Pieces of a mesh, each with what pieces that are one have alike.
type Pieces<'a> = (&'a Mesh, &'a [Vec<usize>], &'a [Vec<u32>]);

/// The base's piece of each piece of the other: by names, else the nearest that has the same sign.
fn pairs((base, parts, signs): Pieces<'_>, (other, other_parts, other_signs): Pieces<'_>) -> Option<Vec<usize>> {
    let (count, other_count) = (parts.iter().flatten().count(), other_parts.iter().flatten().count());
    let filled = |parts: &[Vec<usize>]| parts.iter().filter(|piece| !piece.is_empty()).count();
    if count == 0 || other_count == 0 || filled(parts) != filled(other_parts) {
        return None;
    }
    let by_name = |name: &String| base.parts.iter().position(|known| known == name);
    let named: Option<Vec<usize>> = other.parts.iter().map(by_name).collect();
    if let Some(named) = named {
        return named.iter().zip(other_signs).all(|(&part, sign)| signs[part] == *sign).then_some(named);
    }
    let middles: Vec<DVec3> = parts.iter().map(|piece| middle(base, piece)).collect();
    let mut taken = vec![false; parts.len()];
    let mut pairs = Vec::new();
    for (piece, sign) in other_parts.iter().zip(other_signs) {
        let at = middle(other, piece);
        let mut near: Vec<(f64, usize)> = (0..parts.len())
            .filter(|&part| signs[part] == *sign && !parts[part].is_empty())
            .map(|part| (middles[part].distance(at), part))
            .collect();
        near.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        let part = match near[..] {
            [] if piece.is_empty() => 0,
            [] => return None,
            [(_, part)] => part,
            [(nearest, part), (next, _), ..] => (next > CLEARLY * nearest).then_some(part)?,
        };
        if !piece.is_empty() && std::mem::replace(&mut taken[part], true) {
            return None;
        }
        pairs.push(part);
    }
    Some(pairs)
}

/// Where a piece lies, in sizes of the whole, so that no unit counts.
fn middle(mesh: &Mesh, piece: &[usize]) -> DVec3 {
    let (low, high) = mesh
        .positions
        .iter()
        .fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(low, high), place| (low.min(*place), high.max(*place)));
    let corners = piece.iter().flat_map(|&face| mesh.corners_of(&mesh.faces[face]));
    let (sum, count) = corners
        .fold((DVec3::ZERO, 0usize), |(sum, count), corner| (sum + mesh.positions[corner.vertex as usize], count + 1));
    sum / count.max(1) as f64 / (high - low).length().max(f64::MIN_POSITIVE)
}

fn in_face_order(
    base: &Mesh,
    other: &Mesh,
    parts: &[Vec<usize>],
    other_parts: &[Vec<usize>],
    pairs: &[usize],
) -> Option<Guess> {
    let mut guess = vec![Corner { vertex: 0, uv: None }; other.corners.len()];
    for (piece, &part) in other_parts.iter().zip(pairs) {
        if piece.is_empty() {
            continue;
        }
        if piece.len() != parts[part].len() {
            return None;
        }
        for (&face, &of_base) in piece.iter().zip(&parts[part]) {
            let (face, of_base) = (&other.faces[face], &base.faces[of_base]);
            if face.corner_count != of_base.corner_count {
                return None;
            }
            guess[face.first_corner as usize..][..face.corner_count as usize].copy_from_slice(base.corners_of(of_base));
        }
    }
    Some(guess)
}

fn in_vertex_order(
    base: &Mesh,
    other: &Mesh,
    parts: &[Vec<usize>],
    other_parts: &[Vec<usize>],
    pairs: &[usize],
    list: fn(&Mesh, &[usize]) -> Vec<Corner>,
) -> Option<Guess> {
    let mut guess = vec![Corner { vertex: 0, uv: None }; other.corners.len()];
    for (piece, &part) in other_parts.iter().zip(pairs) {
        let (own, wanted) = (vertices_by_number(other, piece), list(base, &parts[part]));
        if piece.is_empty() {
            continue;
        }
        if own.len() != wanted.len() {
            return None;
        }
        for &face in piece {
            let face = &other.faces[face];
            let guessed = &mut guess[face.first_corner as usize..][..face.corner_count as usize];
            for (guess, corner) in guessed.iter_mut().zip(other.corners_of(face)) {
                let rank = own.binary_search_by_key(&corner.vertex, |corner| corner.vertex).ok()?;
                *guess = wanted[rank];
            }
        }
    }
    Some(guess)
}

/// The vertices of a piece in the order of their numbers.
fn vertices_by_number(mesh: &Mesh, piece: &[usize]) -> Vec<Corner> {
    let mut corners: Vec<Corner> = piece.iter().flat_map(|&face| mesh.corners_of(&mesh.faces[face])).copied().collect();
    corners.sort_unstable();
    corners.dedup_by_key(|corner| corner.vertex);
    corners
}

/// The vertices of a piece in the order of their texture coordinates, as an export that is not welded numbers them.
fn vertices_by_uv(mesh: &Mesh, piece: &[usize]) -> Vec<Corner> {
    let mut corners: Vec<Corner> = piece.iter().flat_map(|&face| mesh.corners_of(&mesh.faces[face])).copied().collect();
    corners.sort_unstable_by_key(|corner| (corner.uv, corner.vertex));
    corners.dedup();
    corners
}
