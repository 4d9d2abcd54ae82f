//! Texture coordinates against the cloth: whether the base's pieces lie in the texture evenly, and whether those of a size are the base's
//! pieces, not mirrored, turned, scaled or shrunk to a point. Knows no picture.

use crate::diagnostic::{Diagnostic, Place};
use crate::ir::{SizeShape, Surface};
use glam::{DVec2, Vec2, Vec3};
use kitsuke::arrays::limits;
use std::ops::Range;

/// A texture that repeats this often per metre of cloth is none: its coordinates count centimetres or millimetres.
const REPEATS: f64 = 50.0;
/// How much larger than on most pieces the texture may be on one, or how much smaller.
const UNEVEN: f64 = 4.0;
/// A piece with less than this share of the texture area that its cloth should have lies in a point or a line.
const FLAT: f64 = 1e-3;
/// How many times larger than on the base the texture may be on a size; on ten sizes of a sample 1.005.
const SCALE: f64 = 1.15;
/// How far the pieces of a size may be turned in the texture, degrees; on the sample less than 1.
const TURNED_DEG: f64 = 20.0;

/// The triangles of every piece, by its name; all of them where there are no pieces.
fn pieces(base: &Surface) -> Vec<(&str, Range<usize>)> {
    let mut end = 0;
    let mut run = |count: usize| {
        end += count;
        end - count..end
    };
    let named = base.parts.iter().map(|part| (part.name.as_str(), run(part.triangle_count as usize)));
    let pieces: Vec<(&str, Range<usize>)> = named.filter(|(_, run)| !run.is_empty()).collect();
    if pieces.is_empty() { vec![("", 0..base.triangles.len())] } else { pieces }
}

/// Whether coordinates lie where none may, which is said elsewhere.
fn is_far(base: &Surface) -> bool {
    base.uv.iter().any(|uv| uv.abs().max_element() > limits::UV)
}

/// Area of the cloth of some triangles, square metres.
fn cloth_m2(base: &Surface, positions_m: &[Vec3], run: Range<usize>) -> f64 {
    let area = |corners: &[u32; 3]| {
        let [a, b, c] = corners.map(|v| positions_m[v as usize].as_dvec3());
        (b - a).cross(c - a).length() / 2.0
    };
    base.triangles[run].iter().map(area).sum()
}

/// Area in the texture, triangles turned over counted as those that are not.
fn texture_area(base: &Surface, uv: &[Vec2], run: Range<usize>) -> f64 {
    let area = |corners: &[u32; 3]| {
        let [a, b, c] = corners.map(|i| uv[i as usize].as_dvec2());
        (b - a).perp_dot(c - a).abs() / 2.0
    };
    base.uv_triangles[run].iter().map(area).sum()
}

/// Reports pieces of the base that lie in the texture as no pattern does.
pub(super) fn check_base(file: &str, base: &Surface, report: &mut Vec<Diagnostic>) {
    let whole = 0..base.uv_triangles.len();
    if whole.is_empty() || is_far(base) {
        return;
    }
    let warn =
        |code, problem: String, help: &str| Diagnostic::warning(code, file, Place::File).problem(problem).help(help);
    // Lengths: texture per metre of cloth.
    let per_m = |run: &Range<usize>| {
        let cloth_m2 = cloth_m2(base, &base.positions_m, run.clone());
        libm::sqrt(texture_area(base, &base.uv, run.clone()) / cloth_m2)
    };
    let of_pieces: Vec<(&str, f64)> = pieces(base).iter().map(|(name, run)| (*name, per_m(run))).collect();
    let mut sorted: Vec<f64> = of_pieces.iter().map(|(_, per_m)| *per_m).collect();
    sorted.sort_by(f64::total_cmp);
    let usual = sorted[sorted.len() / 2];
    if !(usual > 0.0 && usual.is_finite()) {
        let problem =
            "the texture coordinates of most pieces lie in one point or line, so that no texture shows".to_owned();
        report.push(warn(
            "uv-area",
            problem,
            "Unwrap the pieces, best by their patterns, and export the base and all sizes again.",
        ));
        return;
    }
    if usual > REPEATS {
        let problem = format!(
            "the texture repeats every {:.1} mm of cloth: its coordinates are lengths, not 0 to 1",
            1e3 / usual
        );
        let help = "Export texture coordinates from 0 to 1 (Marvelous Designer: Unified UV Coordinates), those of the sizes, too.";
        report.push(warn("uv-range", problem, help));
    }
    for (name, per_m) in of_pieces {
        let help =
            "Give every piece the size in the texture that its cloth has; and export the base and all sizes again.";
        if per_m < libm::sqrt(FLAT) * usual {
            let problem = format!("the texture coordinates of the piece {name} lie in one point or line");
            report.push(warn("uv-area", problem, help));
        } else if !(1.0 / UNEVEN..=UNEVEN).contains(&(per_m / usual)) {
            let (factor, what) = if per_m < usual { (usual / per_m, "larger") } else { (per_m / usual, "smaller") };
            let problem = format!("the texture is {factor:.0} times {what} on the piece {name} than on most others");
            report.push(warn("uv-area", problem, help));
        }
    }
}

/// Reports sizes whose texture coordinates are not those of the base's pieces; once, where all of them differ from the base alike.
pub(super) fn check_sizes(base_file: &str, base: &Surface, sizes: &[(&str, &SizeShape)], report: &mut Vec<Diagnostic>) {
    if base.uv_triangles.is_empty() || is_far(base) {
        return;
    }
    let wrong: Vec<Option<String>> =
        sizes.iter().map(|(_, shape)| wrong(base, &shape.positions_m, &shape.uv)).collect();
    let push = |file: &str, problem: String, help: &str, report: &mut Vec<Diagnostic>| {
        report.push(Diagnostic::error("size-uv", file, Place::File).problem(problem).help(help));
    };
    if let [Some(first), others @ ..] = &wrong[..]
        && !others.is_empty()
        && others.iter().all(|other| other.as_ref() == Some(first))
    {
        let problem =
            format!("the texture coordinates of all {} sizes are {first}, compared with the base's", wrong.len());
        let help = "Export the base's texture coordinates again, as those of the sizes were exported.";
        push(base_file, problem, help, report);
        return;
    }
    for ((file, _), wrong) in sizes.iter().zip(wrong) {
        let Some(wrong) = wrong else { continue };
        let problem = format!("the texture coordinates are {wrong}, compared with {base_file}");
        let help = "Export the size again with the texture settings of the base; the pieces may be larger or smaller, but lie as they do there.";
        push(file, problem, help, report);
    }
}

/// What is wrong with texture coordinates of a size, if anything is.
fn wrong(base: &Surface, positions_m: &[Vec3], uv: &[Vec2]) -> Option<String> {
    let pieces = pieces(base);
    let found = pieces.iter().map(|(name, run)| Some((*name, wrong_piece(base, positions_m, uv, run.clone())?)));
    let found: Vec<(&str, String)> = found.flatten().collect();
    let (name, first) = found.first()?;
    let alike = found.iter().filter(|(_, other)| other == first).count();
    Some(match alike {
        _ if alike == pieces.len() => first.clone(),
        1 => format!("{first} on the piece {name}"),
        alike => format!("{first} on the piece {name} and on {} more", alike - 1),
    })
}

/// What carries the base's piece to this one: a turn with a scale is a complex factor, which turns over what it is given or not.
fn wrong_piece(base: &Surface, positions_m: &[Vec3], uv: &[Vec2], run: Range<usize>) -> Option<String> {
    let cloth = cloth_m2(base, positions_m, run.clone()) / cloth_m2(base, &base.positions_m, run.clone());
    let wanted = cloth * texture_area(base, &base.uv, run.clone());
    let has = texture_area(base, uv, run.clone());
    if !(wanted > 0.0 && wanted.is_finite()) {
        return None;
    }
    if has < FLAT * wanted {
        return Some("shrunk to a point or line".to_owned());
    }
    let mut corners: Vec<u32> = base.uv_triangles[run].concat();
    corners.sort_unstable();
    corners.dedup();
    let middle = |uv: &[Vec2]| corners.iter().map(|&i| uv[i as usize].as_dvec2()).sum::<DVec2>() / corners.len() as f64;
    let (from_middle, to_middle) = (middle(&base.uv), middle(uv));
    let (mut straight, mut turned_over) = (DVec2::ZERO, DVec2::ZERO);
    for &i in &corners {
        let (from, to) = (base.uv[i as usize].as_dvec2() - from_middle, uv[i as usize].as_dvec2() - to_middle);
        straight += DVec2::new(from.dot(to), from.perp_dot(to));
        turned_over += DVec2::new(from.x * to.x - from.y * to.y, from.x * to.y + from.y * to.x);
    }
    let degrees = |factor: DVec2| libm::atan2(factor.y, factor.x).to_degrees();
    if turned_over.length() > straight.length() {
        return Some(match degrees(turned_over).abs() {
            0.0..=45.0 => "turned over from top to bottom (v is 1 - v)".to_owned(),
            135.0..=180.0 => "turned over from left to right (u is 1 - u)".to_owned(),
            _ => "turned over (u and v are exchanged)".to_owned(),
        });
    }
    let turned_deg = degrees(straight).abs();
    if turned_deg > TURNED_DEG {
        return Some(format!("turned by {:.0} degrees", (turned_deg / 5.0).round() * 5.0));
    }
    let scale = libm::sqrt(has / wanted);
    if !(1.0 / SCALE..=SCALE).contains(&scale) {
        return Some(format!("{scale:.1} times as large as this cloth's"));
    }
    None
}
