//! Whether a guess holds: every face of the other must lie where the base has faces, however both cut polygons into triangles, and copies
//! of one vertex must lie at one place. Knows not how the guess was made.

use super::{Guess, Lost, step_of_places};
use crate::source::obj::Mesh;
use glam::DVec3;
use std::collections::BTreeMap;

/// Cloth hardly stretches: an edge is one of the base's where its length is not farther off than this, as a share.
const STRAIN: f64 = 0.25;
/// Of the edges that must hold for so many; where only an order was guessed.
const SHARE: f64 = 0.99;

/// For each vertex of the base the first of the other that the guess takes for it.
pub(super) fn prove(base: &Mesh, other: &Mesh, guess: &Guess, by_lengths: bool) -> Result<Vec<u32>, Lost> {
    let of_base: Vec<Vec<u32>> =
        base.faces.iter().map(|face| base.corners_of(face).iter().map(|corner| corner.vertex).collect()).collect();
    let of_other: Vec<Vec<u32>> = other
        .faces
        .iter()
        .map(|face| &guess[face.first_corner as usize..][..face.corner_count as usize])
        .map(|corners| corners.iter().map(|corner| corner.vertex).collect())
        .collect();
    let (edges, other_edges) = (edges(&of_base), edges(&of_other));
    let is_shared = |edge: &&([u32; 2], usize)| other_edges.binary_search(edge).is_ok();
    let shared: Vec<[u32; 2]> = edges.iter().filter(is_shared).map(|(edge, _)| *edge).collect();
    // Where hardly an edge is shared, all faces are one patch, which proves nothing.
    if 2 * shared.len() < edges.len().min(other_edges.len()) {
        return Err(Lost::OtherFaces);
    }
    if patches(&of_base, &shared) != patches(&of_other, &shared) {
        return Err(Lost::OtherFaces);
    }
    let mut copies: Vec<(u32, u32, u32)> = Vec::new();
    for face in &other.faces {
        let guessed = &guess[face.first_corner as usize..][..face.corner_count as usize];
        let pairs = guessed.iter().zip(other.corners_of(face));
        copies.extend(pairs.map(|(guess, corner)| (guess.vertex, corner.vertex, face.part)));
    }
    copies.sort_unstable();
    copies.dedup_by_key(|copy| (copy.0, copy.1));
    let mut vertex_of = vec![u32::MAX; base.positions.len()];
    for &(vertex, copy, _) in copies.iter().rev() {
        vertex_of[vertex as usize] = copy;
    }
    if vertex_of.contains(&u32::MAX) {
        return Err(Lost::OtherFaces);
    }
    // In the order of the faces each face is one of the base's, whatever its vertices are.
    let said = |merged| if by_lengths { Lost::OtherFaces } else { merged };
    not_merged(base, copies.clone()).map_err(said)?;
    if by_lengths {
        let length = |places: &dyn Fn(u32) -> DVec3, [a, b]: [u32; 2]| places(a).distance(places(b));
        let at_rest = |edge| length(&|v| base.positions[v as usize], edge);
        let here = |edge| length(&|v| other.positions[vertex_of[v as usize] as usize], edge);
        let mut ratios: Vec<f64> =
            shared.iter().filter(|edge| at_rest(**edge) > 0.0).map(|edge| here(*edge) / at_rest(*edge)).collect();
        ratios.sort_unstable_by(f64::total_cmp);
        let usual = ratios.get(ratios.len() / 2).copied().unwrap_or(1.0);
        let off = ratios.iter().filter(|ratio| (*ratio / usual - 1.0).abs() > STRAIN || usual == 0.0).count();
        if off as f64 > (1.0 - SHARE) * ratios.len() as f64 {
            return Err(Lost::OtherLengths(off as f64 / ratios.len() as f64));
        }
    }
    one_place(other, &copies, &vertex_of)?;
    Ok(vertex_of)
}

/// Copies of one vertex lie at one place.
fn one_place(other: &Mesh, copies: &[(u32, u32, u32)], vertex_of: &[u32]) -> Result<(), Lost> {
    let tolerance = 2.0 * step_of_places(&other.positions);
    let place = |vertex: u32| other.positions[vertex as usize];
    let part_of = |copy: u32| copies.iter().find(|known| known.1 == copy).map_or(0, |known| known.2);
    let apart = copies.iter().map(|&(vertex, copy, part)| {
        let first = vertex_of[vertex as usize];
        (place(first).distance(place(copy)), vertex, first, part)
    });
    match apart.max_by(|a, b| a.0.total_cmp(&b.0)).filter(|farthest| farthest.0 > tolerance) {
        Some((apart, vertex, first, part)) => {
            let parts = [part_of(first), part].map(|part| other.parts.get(part as usize).cloned().unwrap_or_default());
            Err(Lost::Torn { vertex, parts, apart })
        }
        None => Ok(()),
    }
}

/// What is one vertex in the other lies at one place in the base.
fn not_merged(base: &Mesh, mut copies: Vec<(u32, u32, u32)>) -> Result<(), Lost> {
    let tolerance = 2.0 * step_of_places(&base.positions);
    copies.sort_unstable_by_key(|&(vertex, copy, _)| (copy, vertex));
    let place = |vertex: u32| base.positions[vertex as usize];
    let merged = copies
        .windows(2)
        .find(|pair| pair[0].1 == pair[1].1 && place(pair[0].0).distance(place(pair[1].0)) > tolerance);
    merged.map_or(Ok(()), |pair| Err(Lost::Merged([pair[0].0, pair[1].0])))
}

fn edge(a: u32, b: u32) -> [u32; 2] {
    [a.min(b), a.max(b)]
}

fn sides(face: &[u32]) -> impl Iterator<Item = [u32; 2]> + '_ {
    (0..face.len()).map(|i| [face[i], face[(i + 1) % face.len()]])
}

/// All edges, sorted, each with how many sides of faces lie there: a quad's other diagonal may be an edge of faces beside it.
fn edges(faces: &[Vec<u32>]) -> Vec<([u32; 2], usize)> {
    let mut edges: Vec<[u32; 2]> = faces.iter().flat_map(|face| sides(face)).map(|[a, b]| edge(a, b)).collect();
    edges.sort_unstable();
    edges.chunk_by(|a, b| a == b).map(|same| (same[0], same.len())).collect()
}

/// The surface cut along the edges that both meshes have: each patch by its sides, sorted. Faces that are cut alike are patches of their
/// own, and a quad is one patch whichever of its diagonals a file has.
fn patches(faces: &[Vec<u32>], shared: &[[u32; 2]]) -> Vec<Vec<[u32; 2]>> {
    let mut above: Vec<usize> = (0..faces.len()).collect();
    fn root(above: &mut [usize], mut face: usize) -> usize {
        while above[face] != face {
            above[face] = above[above[face]];
            face = above[face];
        }
        face
    }
    let mut first_at: BTreeMap<[u32; 2], usize> = BTreeMap::new();
    for (number, face) in faces.iter().enumerate() {
        for [a, b] in sides(face).filter(|[a, b]| shared.binary_search(&edge(*a, *b)).is_err()) {
            let first = *first_at.entry(edge(a, b)).or_insert(number);
            let (a, b) = (root(&mut above, first), root(&mut above, number));
            above[a.max(b)] = a.min(b);
        }
    }
    let mut patches: Vec<Vec<[u32; 2]>> = vec![Vec::new(); faces.len()];
    for (number, face) in faces.iter().enumerate() {
        let patch = root(&mut above, number);
        patches[patch].extend(sides(face).filter(|[a, b]| shared.binary_search(&edge(*a, *b)).is_ok()));
    }
    patches.retain(|patch| !patch.is_empty());
    patches.iter_mut().for_each(|patch| patch.sort_unstable());
    patches.sort_unstable();
    patches
}
