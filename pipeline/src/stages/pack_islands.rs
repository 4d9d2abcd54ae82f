//! Islands of texture coordinates laid side by side into one square: moved, all scaled alike, turned by a quarter at most, never
//! mirrored. Pieces of a pattern are nearly rectangles, so their bounding boxes are packed (bottom left along a skyline). Knows no mesh
//! beyond which corners are one.

use super::StageError;
use glam::{DVec2, Vec2};

/// More islands are no garment's.
const MOST: usize = 20_000;
/// By how much a square that was too small grows.
const GROWTH: f64 = 1.02;

/// How islands are packed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Settings {
    /// Space between islands and around them, as a share of the square's side.
    pub margin: f64,
    /// Whether islands may be turned by a quarter; then the grain of the cloth no longer runs the same way in all.
    pub may_turn: bool,
}

impl Default for Settings {
    fn default() -> Settings {
        Settings { margin: 8.0 / 2048.0, may_turn: false }
    }
}

/// Texture coordinates in one square.
#[derive(Clone, Debug, PartialEq)]
pub struct Packed {
    /// Of each triangle's corners, 0 to 1.
    pub uv: Vec<[Vec2; 3]>,
    /// The island of each triangle, by first appearance.
    pub island: Vec<u32>,
    /// How many islands.
    pub islands: usize,
    /// Those of them whose area is negative: mirrored, in what was given as in what is made.
    pub mirrored: Vec<u32>,
    /// By what all lengths were multiplied.
    pub scale: f64,
    /// The share of the square that triangles cover.
    pub covered: f64,
}

/// A rectangle to place, with its island.
struct Piece {
    island: usize,
    /// With its margin.
    size: DVec2,
    is_turned: bool,
}

/// Packs what hangs together by corners with one vertex and one texture coordinate.
///
/// # Errors
/// Coordinates are no numbers, or the islands have no size or are too many.
pub fn pack(triangles: &[[u32; 3]], uv: &[[Vec2; 3]], settings: &Settings) -> Result<Packed, StageError> {
    let fault = |problem: String| Err(StageError::new("pack islands", problem));
    if uv.len() != triangles.len() || uv.is_empty() {
        return fault("there are no texture coordinates to pack".to_owned());
    }
    if let Some(i) =
        uv.iter().position(|corners| corners.iter().any(|uv| !uv.is_finite() || uv.abs().max_element() > 1e6))
    {
        return fault(format!("the texture coordinates of triangle {i} are no places in a picture"));
    }
    let island = islands(triangles, uv);
    let count = island.iter().max().map_or(0, |&last| last as usize + 1);
    if count > MOST {
        return fault(format!(
            "{count} islands are more than {MOST}: are corners that belong together written as different ones?"
        ));
    }
    let (mut low, mut high) = (vec![DVec2::INFINITY; count], vec![DVec2::NEG_INFINITY; count]);
    let mut area = vec![0.0; count];
    let mut covered = 0.0;
    for (corners, &island) in uv.iter().zip(&island) {
        let [a, b, c] = corners.map(|uv| uv.as_dvec2());
        let island = island as usize;
        low[island] = low[island].min(a).min(b).min(c);
        high[island] = high[island].max(a).max(b).max(c);
        let signed = (b - a).perp_dot(c - a) / 2.0;
        area[island] += signed;
        covered += signed.abs();
    }
    let sizes: Vec<DVec2> = low.iter().zip(&high).map(|(low, high)| *high - *low).collect();
    let boxes: f64 = sizes.iter().map(|size| size.x * size.y).sum();
    let widest = sizes.iter().map(|size| size.max_element()).fold(0.0, f64::max);
    if widest <= 0.0 {
        return fault("the texture coordinates all lie at one place".to_owned());
    }
    let mut side = boxes.sqrt().max(widest);
    let (side, places) = loop {
        let margin = settings.margin * side;
        let mut pieces: Vec<Piece> = sizes
            .iter()
            .enumerate()
            .map(|(island, &size)| {
                let is_turned = settings.may_turn && size.x > size.y * (1.0 + 1e-4);
                let size = if is_turned { DVec2::new(size.y, size.x) } else { size };
                Piece { island, size: size + margin, is_turned }
            })
            .collect();
        // The highest first, then the widest, then the first.
        pieces.sort_by(|a, b| {
            b.size.y.total_cmp(&a.size.y).then(b.size.x.total_cmp(&a.size.x)).then(a.island.cmp(&b.island))
        });
        if let Some(places) = placed(&pieces, side - margin) {
            break (side, places.into_iter().map(|(at, is_turned)| (at + margin, is_turned)).collect::<Vec<_>>());
        }
        side *= GROWTH;
        if side > 1e3 * widest * (count as f64) {
            return fault("the margin leaves no room for the islands".to_owned());
        }
    };
    let moved = |uv: Vec2, island: usize| {
        let (at, is_turned) = places[island];
        let within = uv.as_dvec2() - low[island];
        // A quarter to the left: x goes up, and what was up goes left.
        let within = if is_turned { DVec2::new(sizes[island].y - within.y, within.x) } else { within };
        ((at + within) / side).as_vec2()
    };
    let packed = uv.iter().zip(&island).map(|(corners, &i)| corners.map(|uv| moved(uv, i as usize))).collect();
    Ok(Packed {
        uv: packed,
        islands: count,
        mirrored: (0..count as u32).filter(|&i| area[i as usize] < 0.0).collect(),
        scale: 1.0 / side,
        covered: covered / (side * side),
        island,
    })
}

/// The island of each triangle, numbered by first appearance.
fn islands(triangles: &[[u32; 3]], uv: &[[Vec2; 3]]) -> Vec<u32> {
    let mut corners: Vec<((u32, [u32; 2]), u32)> = Vec::with_capacity(3 * triangles.len());
    for (i, (vertices, uv)) in triangles.iter().zip(uv).enumerate() {
        // Plus zero, so that both zeros are one.
        let keys = vertices.iter().zip(uv).map(|(&v, uv)| (v, (*uv + 0.0).to_array().map(f32::to_bits)));
        corners.extend(keys.map(|key| (key, i as u32)));
    }
    corners.sort_unstable();
    let mut parent: Vec<u32> = (0..triangles.len() as u32).collect();
    let root = |parent: &mut Vec<u32>, mut i: u32| {
        while parent[i as usize] != i {
            parent[i as usize] = parent[parent[i as usize] as usize];
            i = parent[i as usize];
        }
        i
    };
    for same in corners.chunk_by(|a, b| a.0 == b.0) {
        for &(_, triangle) in &same[1..] {
            let (a, b) = (root(&mut parent, same[0].1), root(&mut parent, triangle));
            parent[a.max(b) as usize] = a.min(b);
        }
    }
    let mut number = vec![None; triangles.len()];
    let mut count = 0;
    (0..triangles.len() as u32)
        .map(|i| {
            let root = root(&mut parent, i) as usize;
            *number[root].get_or_insert_with(|| {
                count += 1;
                count - 1
            })
        })
        .collect()
}

/// Lower left corners by island, where all pieces fit into a square; each goes where its top comes lowest.
fn placed(pieces: &[Piece], side: f64) -> Option<Vec<(DVec2, bool)>> {
    // Steps of the skyline: where each begins and how high it is.
    let mut skyline = vec![(0.0, 0.0)];
    let mut places = vec![(DVec2::ZERO, false); pieces.len()];
    for piece in pieces {
        let spot = (0..skyline.len()).filter_map(|first| {
            let x: f64 = skyline[first].0;
            let end = x + piece.size.x;
            let under = skyline[first..].iter().take_while(|(start, _)| *start < end);
            let y = under.map(|(_, height)| *height).fold(0.0, f64::max);
            (end <= side * (1.0 + 1e-12) && y + piece.size.y <= side * (1.0 + 1e-12)).then_some((y, x))
        });
        let (y, x) = spot.min_by(|a, b| a.0.total_cmp(&b.0).then(a.1.total_cmp(&b.1)))?;
        places[piece.island] = (DVec2::new(x, y), piece.is_turned);
        let end = x + piece.size.x;
        let after = skyline.iter().rev().find(|(start, _)| *start <= end).map_or(0.0, |step| step.1);
        let mut next: Vec<(f64, f64)> = skyline.iter().copied().filter(|(start, _)| *start < x).collect();
        next.push((x, y + piece.size.y));
        if end < side {
            next.push((end, after));
        }
        next.extend(skyline.iter().copied().filter(|(start, _)| *start > end));
        skyline = next;
    }
    Some(places)
}
