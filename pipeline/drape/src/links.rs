//! What holds cloth together, as constraints of extended position based dynamics (Macklin, Müller and Chentanez, XPBD, 2016): edges keep
//! their length, creases resist. One pass of Gauss and Seidel; small steps do the rest (Macklin et al., Small Steps in Physics
//! Simulation, 2019). Knows no contacts.

use crate::sheet::Sheet;
use crate::woven::Woven;
use glam::DVec3;
use std::collections::BTreeMap;

/// An edge of the cloth.
#[derive(Clone, Copy, Debug)]
pub struct Link {
    /// Its particles' places.
    pub ends: [u32; 2],
    /// Length in the pattern, metres.
    pub rest_m: f64,
    /// Metres per newton.
    pub compliance_m_per_n: f64,
}

/// Two triangles at an edge: the sum of their particles' places, each times a factor, is how much they bend (Bergou et al., A Quadratic
/// Bending Model for Inextensible Surfaces, 2006). Energy is half of bending times its square over the area of the two, which is that of
/// a cylinder, exactly for squares rolled along a side and for equilateral triangles rolled any way.
#[derive(Clone, Copy, Debug)]
pub struct Crease {
    /// Places of the edge's ends and of the two particles opposite.
    pub corners: [u32; 4],
    /// The factors; they add up to 0.
    pub factors: [f64; 4],
    /// Compliance of the sum's length, m/N.
    pub compliance_m_per_n: f64,
}

/// Least area of a triangle, in squares of its longest side.
const THINNEST: f64 = 0.05;

/// Mass of each particle, kg: a third of each of its triangles.
#[must_use]
pub fn masses_kg(sheet: &Sheet, woven: &Woven) -> Vec<f64> {
    let lengths_m = lengths_m(sheet);
    let mut masses = vec![0.0; sheet.positions_m().len()];
    for corners in sheet.triangles() {
        let area_m2 = area_m2(corners_lengths_m(&lengths_m, *corners));
        corners.iter().for_each(|&v| masses[v as usize] += area_m2 / 3.0 * woven.mass_kg_per_m2);
    }
    masses
}

/// The least height of the triangles at each particle, metres.
#[must_use]
pub fn heights_m(sheet: &Sheet) -> Vec<f64> {
    let lengths_m = lengths_m(sheet);
    let mut heights_m = vec![f64::INFINITY; sheet.positions_m().len()];
    for corners in sheet.triangles() {
        let sides_m = corners_lengths_m(&lengths_m, *corners);
        let height_m = 2.0 * area_m2(sides_m) / sides_m[0].max(sides_m[1]).max(sides_m[2]);
        corners.iter().for_each(|&v| heights_m[v as usize] = heights_m[v as usize].min(height_m));
    }
    heights_m
}

/// One link per edge of the cloth, its ends numbered as the sheet does.
#[must_use]
pub fn links(sheet: &Sheet, woven: &Woven) -> Vec<Link> {
    sheet
        .edges()
        .iter()
        .map(|edge| {
            // Shear by an angle makes the bias longer by half of it, and the bias edge of a square of warp and weft stands for half its width.
            let bias = 4.0 * woven.shear_n_per_m;
            let per_width = crate::forces::along_grain(woven.warp_n_per_m, woven.weft_n_per_m, bias, edge.grain);
            let width_m = edge.width_per_length_squared * edge.rest_m * edge.rest_m;
            let stiffness_n_per_m = per_width * width_m / edge.rest_m;
            Link { ends: edge.ends, rest_m: edge.rest_m, compliance_m_per_n: 1.0 / stiffness_n_per_m }
        })
        .collect()
}

/// One crease per inner edge, its corners numbered as the sheet does; none where nothing resists.
#[must_use]
pub fn creases(sheet: &Sheet, woven: &Woven) -> Vec<Crease> {
    let lengths_m = lengths_m(sheet);
    let grain: BTreeMap<[u32; 2], f64> = sheet.edges().iter().map(|edge| (edge.ends, edge.grain)).collect();
    let mut creases = Vec::new();
    for hinge in sheet.hinges() {
        let [a, b] = hinge.edge;
        // Threads that run across the crease bend.
        let along_warp = 0.5 * (1.0 + grain[&[a.min(b), a.max(b)]]);
        let bending_nm = woven.weft_bending_nm * along_warp + woven.warp_bending_nm * (1.0 - along_warp);
        if bending_nm <= 0.0 {
            continue;
        }
        let mut factors = [0.0; 4];
        let mut area = 0.0;
        for (side, &outer) in hinge.outer.iter().enumerate() {
            // Lengths opposite to a, b and outer.
            let [at_a, at_b, at_outer] = corners_lengths_m(&lengths_m, [a, b, outer]);
            let area_m2 = area_m2([at_a, at_b, at_outer]);
            let cotangent = |near: f64, other: f64, opposite: f64| {
                (near * near + other * other - opposite * opposite) / (4.0 * area_m2)
            };
            let (cot_a, cot_b) = (cotangent(at_b, at_outer, at_a), cotangent(at_a, at_outer, at_b));
            factors[0] += cot_b;
            factors[1] += cot_a;
            factors[2 + side] -= cot_a + cot_b;
            area += area_m2;
        }
        creases.push(Crease {
            corners: [a, b, hinge.outer[0], hinge.outer[1]],
            factors,
            compliance_m_per_n: area / bending_nm,
        });
    }
    creases
}

/// Brings an edge nearer to its length; `per_s2` is 1 over the squared step.
#[inline]
pub fn keep_length(link: &Link, places_m: &mut [DVec3], inverse_kg: &[f64], per_s2: f64) {
    let [a, b] = link.ends.map(|end| end as usize);
    let (from_a, from_b) = (inverse_kg[a], inverse_kg[b]);
    let way = places_m[b] - places_m[a];
    let length_m = way.length();
    // One law at every length: a hard limit at 5 % made cloth that swings without drag faster and faster, until it flew apart.
    let share = from_a + from_b + link.compliance_m_per_n * per_s2;
    if share <= 0.0 || length_m <= 0.0 {
        return;
    }
    let step = way * ((length_m - link.rest_m) / (length_m * share));
    places_m[a] += step * from_a;
    places_m[b] -= step * from_b;
}

/// Makes a crease flatter.
#[inline]
pub fn flatten(crease: &Crease, places_m: &mut [DVec3], inverse_kg: &[f64], per_s2: f64) {
    let corners = crease.corners.map(|corner| corner as usize);
    let mut curved = DVec3::ZERO;
    let mut share = crease.compliance_m_per_n * per_s2;
    for (corner, factor) in corners.into_iter().zip(crease.factors) {
        curved += places_m[corner] * factor;
        share += inverse_kg[corner] * factor * factor;
    }
    if share <= 0.0 {
        return;
    }
    let step = curved / share;
    for (corner, factor) in corners.into_iter().zip(crease.factors) {
        places_m[corner] -= step * (inverse_kg[corner] * factor);
    }
}

fn lengths_m(sheet: &Sheet) -> BTreeMap<[u32; 2], f64> {
    sheet.edges().iter().map(|edge| (edge.ends, edge.rest_m)).collect()
}

/// The lengths opposite to three corners.
fn corners_lengths_m(lengths_m: &BTreeMap<[u32; 2], f64>, [a, b, c]: [u32; 3]) -> [f64; 3] {
    [[b, c], [c, a], [a, b]].map(|[from, to]| lengths_m[&[from.min(to), from.max(to)]])
}

/// By Heron. Seams hold cloths of unequal length together, so that the three need not quite make a triangle; and what is thinner than a
/// tenth of its length counts as so thin, or a crease at it would be as stiff as steel.
fn area_m2([a, b, c]: [f64; 3]) -> f64 {
    let half = 0.5 * (a + b + c);
    let longest = a.max(b).max(c);
    (half * (half - a) * (half - b) * (half - c)).max(0.0).sqrt().max(THINNEST * longest * longest)
}
