//! A guess by places in the texture, where islands overlap by names, by which way they are turned, and by edges from where they do not.
//! Knows no places in space.

use super::{Guess, Lost, step_of_texture};
use crate::source::obj::{Corner, Mesh};
use glam::Vec2;
use std::collections::{BTreeMap, BTreeSet};

/// A vertex's place in the texture, as one piece has it.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
struct Site {
    corner: Corner,
    part: u32,
    /// Whether the faces there are turned over in the texture.
    is_mirrored: bool,
}

pub(super) fn guess(base: &Mesh, other: &Mesh) -> Result<Guess, Lost> {
    let (base_sites, _) = sites(base);
    let (own_sites, site_of_corner) = sites(other);
    // Both were rounded from the same number.
    let tolerance = (0.5 * (step_of_texture(&base.uv) + step_of_texture(&other.uv)) * 1.02) as f32 + 2e-7;
    let place = |mesh: &Mesh, site: &Site| site.corner.uv.map_or(Vec2::ZERO, |uv| mesh.uv[uv as usize]);
    let cell = |at: Vec2| [(at.x / (2.0 * tolerance)).floor() as i64, (at.y / (2.0 * tolerance)).floor() as i64];
    let mut cells: BTreeMap<[i64; 2], Vec<u32>> = BTreeMap::new();
    for (number, site) in (0..).zip(&base_sites) {
        cells.entry(cell(place(base, site))).or_default().push(number);
    }
    let part_of_name = names_in_common(base, other);
    let near = |site: &Site| -> Vec<Corner> {
        let at = place(other, site);
        let [x, y] = cell(at);
        let around = (-1..=1).flat_map(|i| (-1..=1).map(move |j| [x + i, y + j]));
        let found = around.filter_map(|cell| cells.get(&cell)).flatten().map(|&number| base_sites[number as usize]);
        let mut found: Vec<(f32, Site)> =
            found.map(|known| ((place(base, &known) - at).abs().max_element(), known)).collect();
        found.retain(|(distance, _)| *distance <= tolerance);
        let nearest = found.iter().fold(f32::INFINITY, |nearest, (distance, _)| nearest.min(*distance));
        found.retain(|(distance, _)| *distance <= nearest + 1e-7);
        let mut found: Vec<Site> = found.into_iter().map(|(_, site)| site).collect();
        if let Some(part_of_name) = &part_of_name {
            keep(&mut found, |known| known.part == part_of_name[site.part as usize]);
        }
        keep(&mut found, |known| known.is_mirrored == site.is_mirrored);
        let mut found: Vec<Corner> = found.into_iter().map(|site| site.corner).collect();
        found.sort_unstable();
        found.dedup_by_key(|corner| corner.vertex);
        found
    };
    let mut candidates: Vec<Vec<Corner>> = own_sites.iter().map(near).collect();
    let unknown = candidates.iter().filter(|candidates| candidates.is_empty()).count();
    if unknown > 0 {
        return Err(Lost::OtherTexture(unknown));
    }
    resolve(base, other, &own_sites, &site_of_corner, &mut candidates);
    let open = candidates.iter().filter(|candidates| candidates.len() > 1).count();
    if open > 0 {
        return Err(Lost::Overlapping(open));
    }
    Ok(site_of_corner.iter().map(|&site| candidates[site as usize][0]).collect())
}

/// Keeps those that fit, if any do.
fn keep<T: Copy>(list: &mut Vec<T>, fits: impl Fn(&T) -> bool) -> bool {
    let kept: Vec<T> = list.iter().copied().filter(|item| fits(item)).collect();
    let is_less = !kept.is_empty() && kept.len() < list.len();
    if is_less {
        *list = kept;
    }
    is_less
}

/// The sites of a mesh, sorted, and that of each corner.
fn sites(mesh: &Mesh) -> (Vec<Site>, Vec<u32>) {
    let mut of_corners = Vec::with_capacity(mesh.corners.len());
    for face in &mesh.faces {
        let corners = mesh.corners_of(face);
        let at = |i: usize| corners[i % corners.len()].uv.map_or(Vec2::ZERO, |uv| mesh.uv[uv as usize]);
        let area: f32 = (0..corners.len()).map(|i| (at(i) - at(0)).perp_dot(at(i + 1) - at(0))).sum();
        of_corners.extend(corners.iter().map(|&corner| Site { corner, part: face.part, is_mirrored: area < 0.0 }));
    }
    let sites: BTreeSet<Site> = of_corners.iter().copied().collect();
    let sites: Vec<Site> = sites.into_iter().collect();
    let number = |site: &Site| sites.binary_search(site).map_or(0, |at| at as u32);
    let numbers = of_corners.iter().map(number).collect();
    (sites, numbers)
}

/// The base's part of each part of the other, where all have the same names.
fn names_in_common(base: &Mesh, other: &Mesh) -> Option<Vec<u32>> {
    let part_of = |name: &String| base.parts.iter().position(|known| known == name).map(|part| part as u32);
    other.parts.iter().map(part_of).collect()
}

/// Lets what is known decide what is open, along faces and from copy to copy, until nothing more follows.
fn resolve(base: &Mesh, other: &Mesh, sites: &[Site], site_of_corner: &[u32], candidates: &mut [Vec<Corner>]) {
    if candidates.iter().all(|candidates| candidates.len() == 1) {
        return;
    }
    let mut mates: BTreeSet<[u32; 2]> = BTreeSet::new();
    for face in &base.faces {
        let corners = base.corners_of(face);
        mates.extend(corners.iter().flat_map(|a| corners.iter().map(|b| [a.vertex, b.vertex])));
    }
    let known = |candidates: &[Vec<Corner>], site: usize| match candidates[site][..] {
        [corner] => Some(corner.vertex),
        _ => None,
    };
    let mut of_vertex: Vec<Vec<u32>> = vec![Vec::new(); other.positions.len()];
    for (number, site) in (0..).zip(sites) {
        of_vertex[site.corner.vertex as usize].push(number);
    }
    let faces: Vec<&[u32]> = other
        .faces
        .iter()
        .map(|face| &site_of_corner[face.first_corner as usize..][..face.corner_count as usize])
        .collect();
    loop {
        let mut has_changed = false;
        // Back and forth, because files list faces row by row.
        for group in faces.iter().chain(faces.iter().rev()) {
            for &site in *group {
                for &mate in *group {
                    if candidates[site as usize].len() > 1
                        && let Some(vertex) = known(candidates, mate as usize)
                    {
                        has_changed |=
                            keep(&mut candidates[site as usize], |corner| mates.contains(&[vertex, corner.vertex]));
                    }
                }
            }
        }
        // One vertex of the other is one of the base, unless only the base has it open.
        for group in &of_vertex {
            let sure: Vec<u32> = group.iter().filter_map(|&site| known(candidates, site as usize)).collect();
            for &site in group {
                if !sure.is_empty() && candidates[site as usize].len() > 1 {
                    has_changed |= keep(&mut candidates[site as usize], |corner| sure.contains(&corner.vertex));
                }
            }
        }
        if !has_changed {
            return;
        }
    }
}
