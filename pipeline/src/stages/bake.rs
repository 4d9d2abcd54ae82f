//! The colours of a scan in the texture space of the base that was registered to it, with how far each can be trusted. Texels in their
//! thousands ask the scan's surface what lies nearest and faces the same way; what nobody saw is filled from around it and says so.
//! Knows no file and no garment.

use super::StageError;
use super::register::surface::{Surface, smooth_normals};
use crate::light::{linear, srgb};
use glam::{DVec2, DVec3, Vec2, Vec3, Vec4};
use image::{GrayImage, Rgb, RgbImage};
use rayon::prelude::*;

/// No triangle of the base.
const NONE: u32 = u32::MAX;
/// Widest and highest texture, pixels.
pub const SIDE_PX: u32 = 8192;
/// A triangle whose texture coordinates span more than this many times the picture is a mistake.
const WIDEST_UV: f64 = 8.0;
/// Nearer than this a place of the scan is the base's own, whatever else is near, metres.
const OWN_M: f64 = 1e-3;
/// How far beyond a scan's border its colour still holds, metres.
const BEYOND_BORDER_M: f64 = 1e-3;

/// The base as the scan wears it.
#[derive(Clone, Copy, Debug)]
pub struct Base<'a> {
    /// Registered positions, metres.
    pub positions_m: &'a [DVec3],
    /// Facing outwards.
    pub triangles: &'a [[u32; 3]],
    /// How much each position was seen in the scan, 0 to 1.
    pub confidence: &'a [f64],
    /// Texture coordinates, v upwards; those beyond 0 to 1 lie in the picture where it repeats.
    pub uv: &'a [Vec2],
    /// The texture coordinates of each triangle's corners.
    pub uv_triangles: &'a [[u32; 3]],
}

/// A scan where the base stands.
#[derive(Clone, Copy, Debug)]
pub struct Scan<'a> {
    /// Metres.
    pub positions_m: &'a [DVec3],
    /// Facing outwards, or all of them inwards.
    pub triangles: &'a [[u32; 3]],
    /// What colours it.
    pub colours: Colours<'a>,
}

/// Where a scan has its colours.
#[derive(Clone, Copy, Debug)]
pub enum Colours<'a> {
    /// sRGB, one per position.
    PerVertex(&'a [[u8; 3]]),
    /// A picture, sRGB, and the coordinates of each triangle's corners in it, v upwards; it repeats.
    Picture(&'a RgbImage, &'a [[Vec2; 3]]),
}

/// How colours are taken over.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Settings {
    /// Width and height of what is made, pixels.
    pub size_px: u32,
    /// How far a texel's place looks for the scan, metres. Confidence falls to 0 there.
    pub within_m: f64,
    /// Cosine of the largest angle between the base's direction and the scan's.
    pub least_facing: f64,
    /// By how much islands grow over their edges, pixels.
    pub gutter_px: u32,
}

impl Default for Settings {
    fn default() -> Settings {
        Settings { size_px: 2048, within_m: 0.01, least_facing: 0.5, gutter_px: 8 }
    }
}

/// Colours in the texture space of a base.
#[derive(Clone, Debug, PartialEq)]
pub struct Baked {
    /// sRGB, top row first.
    pub colour: RgbImage,
    /// 255 where the scan lies close and faces the same way, 0 where a colour is only taken from around, and between islands.
    pub confidence: GrayImage,
    /// Texels that the base covers.
    pub covered: usize,
    /// Those of them that got a colour of the scan.
    pub seen: usize,
}

/// Takes a scan's colours over into the texture space of a base. The same bytes on any number of threads.
///
/// # Errors
/// When the base has no usable texture coordinates, or nothing of the scan lies near it.
///
/// # Panics
/// When arrays do not belong together.
pub fn bake(base: &Base<'_>, scan: &Scan<'_>, settings: &Settings) -> Result<Baked, StageError> {
    let fault = |problem: String| Err(StageError::new("bake", problem));
    assert_eq!(base.positions_m.len(), base.confidence.len(), "one confidence per position");
    let Settings { size_px, .. } = *settings;
    if !(1..=SIDE_PX).contains(&size_px) {
        return fault(format!("a texture has 1 to {SIDE_PX} pixels along a side, not {size_px}"));
    }
    if base.uv_triangles.len() != base.triangles.len() || base.triangles.is_empty() {
        return fault("the base has no texture coordinates: make some (cargo xtask atlas)".to_owned());
    }
    if scan.triangles.is_empty() {
        return fault("the scan has no triangles".to_owned());
    }
    let islands = islands(base);
    let owner = match owners(base, size_px) {
        Ok(owner) => owner,
        Err(problem) => return fault(problem),
    };
    let covered = owner.iter().filter(|&&t| t != NONE).count();
    let mut light = seen_light(base, scan, settings, &owner);
    let seen = light.iter().filter(|texel| texel.w > 0.0).count();
    if seen == 0 {
        return fault("nothing of the scan lies near the base, so no texel has a colour".to_owned());
    }
    let confidence = light.iter().map(|texel| (texel.w * 255.0).round() as u8).collect();
    fill(&mut light, &owner, &islands, size_px as usize);
    dilate(&mut light, &owner, size_px as usize, settings.gutter_px);
    let colours: Vec<[u8; 3]> = light.par_iter().map(|texel| srgb(texel.truncate())).collect();
    let bytes = colours.into_iter().flatten().collect();
    Ok(Baked {
        colour: RgbImage::from_raw(size_px, size_px, bytes).expect("three bytes per texel"),
        confidence: GrayImage::from_raw(size_px, size_px, confidence).expect("one byte per texel"),
        covered,
        seen,
    })
}

/// The island of each triangle: what hangs together by texture coordinates, however often a file repeats them.
fn islands(base: &Base<'_>) -> Vec<u32> {
    let key = |i: u32| base.uv[i as usize].to_array().map(f32::to_bits);
    let mut order: Vec<u32> = (0..base.uv.len() as u32).collect();
    order.sort_unstable_by_key(|&i| (key(i), i));
    let mut parent: Vec<u32> = (0..base.uv.len() as u32).collect();
    for same in order.chunk_by(|&a, &b| key(a) == key(b)) {
        same.iter().for_each(|&i| parent[i as usize] = same[0]);
    }
    let root = |parent: &mut Vec<u32>, mut i: u32| {
        while parent[i as usize] != i {
            parent[i as usize] = parent[parent[i as usize] as usize];
            i = parent[i as usize];
        }
        i
    };
    for corners in base.uv_triangles {
        let [a, b, c] = corners.map(|i| root(&mut parent, i));
        let least = a.min(b).min(c);
        [a, b, c].iter().for_each(|&i| parent[i as usize] = least);
    }
    base.uv_triangles.iter().map(|corners| root(&mut parent, corners[0])).collect()
}

/// Corners of a triangle in texels, y downwards.
fn texels_of(base: &Base<'_>, triangle: usize, size_px: u32) -> [DVec2; 3] {
    let size = f64::from(size_px);
    base.uv_triangles[triangle].map(|i| {
        let uv = base.uv[i as usize].as_dvec2();
        DVec2::new(uv.x * size, (1.0 - uv.y) * size)
    })
}

/// Shares of a triangle's corners at a point of its plane; `None` where it has no area.
fn shares_at([a, b, c]: [DVec2; 3], at: DVec2) -> Option<[f64; 3]> {
    let doubled = (b - a).perp_dot(c - a);
    let shares = [(c - b).perp_dot(at - b), (a - c).perp_dot(at - c), (b - a).perp_dot(at - a)];
    (doubled != 0.0).then(|| shares.map(|area| area / doubled))
}

/// The triangle that covers each texel's middle: the first where several do. Coordinates beyond the picture wrap round.
fn owners(base: &Base<'_>, size_px: u32) -> Result<Vec<u32>, String> {
    let size = size_px as usize;
    let mut owner = vec![NONE; size * size];
    for triangle in 0..base.triangles.len() {
        let corners = texels_of(base, triangle, size_px);
        let low = corners[0].min(corners[1]).min(corners[2]);
        let high = corners[0].max(corners[1]).max(corners[2]);
        let is_finite = corners.iter().all(|corner| corner.is_finite() && corner.abs().max_element() < 1e9);
        if !is_finite || (high - low).max_element() > WIDEST_UV * f64::from(size_px) {
            return Err(format!("the texture coordinates of triangle {triangle} are no places in a picture"));
        }
        for y in (low.y - 0.5).ceil() as i64..=(high.y - 0.5).floor() as i64 {
            for x in (low.x - 0.5).ceil() as i64..=(high.x - 0.5).floor() as i64 {
                let Some(shares) = shares_at(corners, DVec2::new(x as f64 + 0.5, y as f64 + 0.5)) else { continue };
                let at = y.rem_euclid(size as i64) as usize * size + x.rem_euclid(size as i64) as usize;
                // A little over its edges, so that rounding leaves no gap between neighbours.
                if owner[at] == NONE && shares.iter().all(|&share| share >= -1e-9) {
                    owner[at] = triangle as u32;
                }
            }
        }
    }
    Ok(owner)
}

/// Linear light of the texels that see the scan, and in `w` how far they can be trusted; 0 for all others.
fn seen_light(base: &Base<'_>, scan: &Scan<'_>, settings: &Settings, owner: &[u32]) -> Vec<Vec4> {
    let size = settings.size_px as usize;
    let normals = smooth_normals(base.positions_m, base.triangles);
    let mut surface = Surface::new(scan.positions_m.to_vec(), scan.triangles.to_vec());
    if faces_inwards(base, &normals, &surface, settings.within_m) {
        surface.turn_over();
    }
    let own = Surface::new(base.positions_m.to_vec(), base.triangles.to_vec());
    let texel = |index: usize| -> Option<Vec4> {
        let triangle = Some(owner[index]).filter(|&t| t != NONE)? as usize;
        let corners = texels_of(base, triangle, settings.size_px);
        // The texel as the triangle sees it, whose coordinates may lie beyond the picture.
        let middle = (corners[0] + corners[1] + corners[2]) / 3.0;
        let within = DVec2::new((index % size) as f64 + 0.5, (index / size) as f64 + 0.5);
        let whole = |about: DVec2| within + ((about - within) / size as f64).round() * size as f64;
        let shares = wrapped_shares(corners, whole(middle), size as f64)?;
        let vertices = base.triangles[triangle].map(|v| v as usize);
        let mean = |value: &dyn Fn(usize) -> f64| vertices.iter().zip(shares).map(|(&v, share)| value(v) * share).sum();
        let trusted: f64 = mean(&|v| base.confidence[v]);
        if trusted * 255.0 < 0.5 {
            return None;
        }
        let place_m: DVec3 = vertices.iter().zip(shares).map(|(&v, share)| base.positions_m[v] * share).sum();
        let normal = vertices.iter().zip(shares).map(|(&v, share)| normals[v] * share).sum::<DVec3>();
        let normal = normal.normalize_or_zero();
        let hit = surface.nearest(place_m, settings.within_m, |n| n.dot(normal) > settings.least_facing)?;
        let away = place_m - hit.place_m;
        let aside_m = (away - hit.normal * hit.normal.dot(away)).length();
        // Beside the scan's border lies a hole, not its last colour.
        if hit.on_border && aside_m > BEYOND_BORDER_M {
            return None;
        }
        // A place of the scan that another layer of the base lies on belongs to that layer.
        if hit.distance_m > OWN_M {
            let nearer = own.nearest(hit.place_m, hit.distance_m, |n| n.dot(hit.normal) > settings.least_facing);
            if nearer.is_some_and(|nearer| {
                nearer.distance_m < 0.5 * hit.distance_m && nearer.place_m.distance(place_m) > 0.8 * hit.distance_m
            }) {
                return None;
            }
        }
        let near = 1.0 - (hit.distance_m / settings.within_m).powi(2);
        let least = settings.least_facing;
        let facing = ((hit.normal.dot(normal) - least) / (0.9 - least).max(1e-6)).clamp(0.0, 1.0);
        let confidence = ((trusted.min(1.0) * near * facing) * 255.0).round() / 255.0;
        let light = light_at(scan, hit.triangle as usize, hit.shares);
        (confidence > 0.0).then(|| light.extend(confidence as f32))
    };
    (0..owner.len()).into_par_iter().with_min_len(size).map(|index| texel(index).unwrap_or(Vec4::ZERO)).collect()
}

/// Shares at a texel or at one of those that the picture repeats beside it: the triangle may lie over its edge.
fn wrapped_shares(corners: [DVec2; 3], at: DVec2, size: f64) -> Option<[f64; 3]> {
    let beside = [0.0, -1.0, 1.0].into_iter().flat_map(|y| [0.0, -1.0, 1.0].map(|x| DVec2::new(x, y) * size));
    let mut all = beside.filter_map(|by| shares_at(corners, at + by));
    all.find(|shares| shares.iter().all(|&share| share >= -1e-6))
}

/// Whether more of the base finds a scan beside it that faces the other way than one that faces as the base does. A lining, which faces
/// the other way beside what does not, says nothing.
fn faces_inwards(base: &Base<'_>, normals: &[DVec3], surface: &Surface, within_m: f64) -> bool {
    /// More say nothing more.
    const ASKED: usize = 2000;
    let step = base.positions_m.len().div_ceil(ASKED).max(1);
    let asked = (0..base.positions_m.len()).step_by(step).filter(|&v| base.confidence[v] > 0.0);
    let finds = |v: usize, side: f64| {
        let accepts = |n: DVec3| side * n.dot(normals[v]) > 0.0;
        i64::from(surface.nearest(base.positions_m[v], within_m, accepts).is_some())
    };
    asked.map(|v| finds(v, 1.0) - finds(v, -1.0)).sum::<i64>() < 0
}

/// Linear light of a scan's place.
fn light_at(scan: &Scan<'_>, triangle: usize, shares: [f64; 3]) -> Vec3 {
    let shares = shares.map(|share| share as f32);
    match scan.colours {
        Colours::PerVertex(colours) => {
            scan.triangles[triangle].iter().zip(shares).map(|(&v, share)| linear(colours[v as usize]) * share).sum()
        }
        Colours::Picture(picture, uv) => {
            let uv: Vec2 = uv[triangle].iter().zip(shares).map(|(&uv, share)| uv * share).sum();
            bilinear(picture, uv)
        }
    }
}

fn bilinear(picture: &RgbImage, uv: Vec2) -> Vec3 {
    let (width, height) = (i64::from(picture.width()), i64::from(picture.height()));
    let at = Vec2::new(uv.x * width as f32, (1.0 - uv.y) * height as f32) - 0.5;
    let (corner, part) = (at.floor(), at - at.floor());
    let (x, y) = (corner.x as i64, corner.y as i64);
    let texel = |x: i64, y: i64| {
        let Rgb(colour) = picture.get_pixel(x.rem_euclid(width) as u32, y.rem_euclid(height) as u32);
        linear(*colour)
    };
    let upper = texel(x, y).lerp(texel(x + 1, y), part.x);
    let lower = texel(x, y + 1).lerp(texel(x + 1, y + 1), part.x);
    upper.lerp(lower, part.y)
}

/// Gives covered texels without a colour one of those around them in their island: means over ever larger squares, the smallest that
/// knows any (push and pull, Gortler et al. 1996).
fn fill(light: &mut [Vec4], owner: &[u32], islands: &[u32], size: usize) {
    let mut texels: Vec<(u32, u32)> = Vec::new();
    texels.extend((0..owner.len()).filter(|&i| owner[i] != NONE).map(|i| (islands[owner[i] as usize], i as u32)));
    texels.sort_unstable();
    let seen = light.iter().filter(|texel| texel.w > 0.0);
    let sum = seen.fold(glam::DVec4::ZERO, |sum, texel| sum + (texel.truncate() * texel.w).extend(texel.w).as_dvec4());
    let everywhere = (sum.truncate() / sum.w.max(f64::MIN_POSITIVE)).as_vec3();
    let of_islands: Vec<&[(u32, u32)]> = texels.chunk_by(|a, b| a.0 == b.0).collect();
    let known: &[Vec4] = light;
    let filled: Vec<Vec<(u32, Vec3)>> = of_islands
        .into_par_iter()
        .map(|island| {
            let unseen = || island.iter().map(|&(_, i)| i).filter(|&i| known[i as usize].w == 0.0);
            if unseen().next().is_none() {
                return Vec::new();
            }
            if unseen().count() == island.len() {
                return unseen().map(|i| (i, everywhere)).collect();
            }
            pushed(island, known, size, unseen())
        })
        .collect();
    // What lies between the islands is of no colour in particular: far mip levels get the mean, not black.
    for (texel, _) in light.iter_mut().zip(owner).filter(|(texel, t)| texel.w == 0.0 && **t == NONE) {
        *texel = everywhere.extend(0.0);
    }
    for (i, colour) in filled.into_iter().flatten() {
        light[i as usize] = colour.extend(0.0);
    }
}

/// Sums of colours, weighted, and the weights, over squares of a bounding box.
struct Squares {
    width: usize,
    height: usize,
    sums: Vec<Vec4>,
}

impl Squares {
    fn doubled(&self) -> Squares {
        let (width, height) = (self.width.div_ceil(2), self.height.div_ceil(2));
        let mut sums = vec![Vec4::ZERO; width * height];
        for y in 0..self.height {
            for x in 0..self.width {
                sums[y / 2 * width + x / 2] += self.sums[y * self.width + x];
            }
        }
        Squares { width, height, sums }
    }

    /// Sums at a place, in units of these squares, from the four whose middles are around it.
    fn at(&self, place: Vec2) -> Vec4 {
        let corner = (place - 0.5).floor();
        let part = place - 0.5 - corner;
        let of = |x: f32, y: f32| {
            let (x, y) = (x.clamp(0.0, (self.width - 1) as f32), y.clamp(0.0, (self.height - 1) as f32));
            self.sums[y as usize * self.width + x as usize]
        };
        let upper = of(corner.x, corner.y).lerp(of(corner.x + 1.0, corner.y), part.x);
        let lower = of(corner.x, corner.y + 1.0).lerp(of(corner.x + 1.0, corner.y + 1.0), part.x);
        upper.lerp(lower, part.y)
    }
}

fn pushed(island: &[(u32, u32)], known: &[Vec4], size: usize, unseen: impl Iterator<Item = u32>) -> Vec<(u32, Vec3)> {
    let place = |i: u32| (i as usize % size, i as usize / size);
    let (mut low, mut high) = ((size, size), (0, 0));
    for &(_, i) in island {
        let (x, y) = place(i);
        low = (low.0.min(x), low.1.min(y));
        high = (high.0.max(x), high.1.max(y));
    }
    let (width, height) = (high.0 - low.0 + 1, high.1 - low.1 + 1);
    let mut finest = Squares { width, height, sums: vec![Vec4::ZERO; width * height] };
    for &(_, i) in island {
        let (x, y) = place(i);
        let texel = known[i as usize];
        finest.sums[(y - low.1) * width + x - low.0] = (texel.truncate() * texel.w).extend(texel.w);
    }
    let mut levels = vec![finest];
    while levels.last().is_some_and(|level| level.width.max(level.height) > 1) {
        levels.push(levels[levels.len() - 1].doubled());
    }
    unseen
        .map(|i| {
            let (x, y) = place(i);
            let at = Vec2::new((x - low.0) as f32 + 0.5, (y - low.1) as f32 + 0.5);
            // Each level fills what the finer ones left open.
            let (mut sum, mut open, mut scale) = (Vec3::ZERO, 1.0, 1.0);
            for level in &levels {
                let found = level.at(at / scale);
                if found.w > 0.0 {
                    // Not all at once, so that levels pass over into each other.
                    let share = open * found.w.min(1.0);
                    sum += found.truncate() / found.w * share;
                    open -= share;
                }
                if open <= 1e-3 {
                    break;
                }
                scale *= 2.0;
            }
            (i, sum / (1.0 - open))
        })
        .collect()
}

/// Lets islands grow over their edges: each round, texels beside what is covered get the mean of it.
fn dilate(light: &mut [Vec4], owner: &[u32], size: usize, rounds: u32) {
    let mut is_covered: Vec<bool> = owner.iter().map(|&t| t != NONE).collect();
    let beside = |i: u32| {
        let (x, y) = (i as usize % size, i as usize / size);
        let (left, right) = (x.saturating_sub(1), (x + 1).min(size - 1));
        let (up, down) = (y.saturating_sub(1), (y + 1).min(size - 1));
        (up..=down).flat_map(move |y| (left..=right).map(move |x| (y * size + x) as u32))
    };
    let open_beside = |from: &mut dyn Iterator<Item = u32>, is_covered: &[bool]| -> Vec<u32> {
        let mut open: Vec<u32> = from.flat_map(beside).filter(|&i| !is_covered[i as usize]).collect();
        open.sort_unstable();
        open.dedup();
        open
    };
    let mut covered = (0..owner.len() as u32).filter(|&i| owner[i as usize] != NONE);
    let mut edge = open_beside(&mut covered, &is_covered);
    for _ in 0..rounds {
        let mean = |&i: &u32| {
            let near = beside(i).filter(|&n| is_covered[n as usize]);
            let (sum, count) = near.fold((Vec3::ZERO, 0.0), |(s, c), n| (s + light[n as usize].truncate(), c + 1.0));
            sum / count
        };
        let means: Vec<Vec3> = edge.par_iter().map(mean).collect();
        for (&i, colour) in edge.iter().zip(means) {
            light[i as usize] = colour.extend(0.0);
            is_covered[i as usize] = true;
        }
        edge = open_beside(&mut edge.iter().copied(), &is_covered);
    }
}
