//! How a texture lies on a shape: how much larger or smaller, how much drawn out, how much turned. Knows meshes; knows nothing of how
//! texture coordinates are made.

use glam::{DVec2, Vec2, Vec3};
use kitsuke::arrays::Mesh;
use kitsuke::fit::texture::{laid_flat, stretch};
use std::collections::BTreeMap;

/// Side of the square of cloth that stands for a motif, metres.
const MOTIF_M: f64 = 0.05;
/// Motifs of which less of the area lies on the piece are left out: a seam cuts them off.
const MOTIF_SHARE: f64 = 0.6;

/// How the texture lies on one part, or on all.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Distortion {
    /// Root of the mean, over the cloth's area, of (σ − 1)², where σ are both singular values of the map from cloth to shape.
    pub rms: f64,
    /// How much larger (above 0) or smaller a motif of 5 cm comes out than it is, where that is worst: the mean of both singular values
    /// over the motif, less 1.
    pub motif: f64,
    /// How much a motif of 5 cm is drawn out where that is worst: half of the difference of both singular values, mean over the motif. A
    /// circle becomes an ellipse whose axes are longer and shorter by this share.
    pub drawn_out: f64,
    /// How far the grain is turned in the texture against what it is compared with, 99 % of the cloth's area less than this, degrees.
    pub turned_deg: f64,
}

/// A texture on a shape.
#[derive(Clone, Copy, Debug)]
pub struct Worn<'a> {
    /// Triangles, parts and twins.
    pub mesh: &'a Mesh,
    /// Positions of the unique vertices, metres.
    pub positions_m: &'a [Vec3],
    /// Texture coordinates, twins included.
    pub uv: &'a [Vec2],
    /// Texture coordinates against which rotation is measured.
    pub straight_uv: &'a [Vec2],
    /// Metres of cloth per texture unit.
    pub m_per_uv: f64,
}

/// Metres of cloth per texture unit: the median over the edges of the base's triangles.
#[must_use]
pub fn m_per_uv(mesh: &Mesh) -> f64 {
    let mut ratios: Vec<f64> = triangles(mesh, &mesh.positions_m)
        .flat_map(|(vertices, laid_m)| {
            let texture = edges(&vertices.map(|v| mesh.uv[v as usize].as_dvec2()));
            laid_m.into_iter().zip(texture).map(|(laid_m, texture)| laid_m.length() / texture.length())
        })
        .filter(|ratio| ratio.is_finite())
        .collect();
    ratios.sort_by(f64::total_cmp);
    ratios.get(ratios.len() / 2).copied().unwrap_or(1.0)
}

/// A row per part, in the mesh's order, and the whole behind them.
///
/// # Panics
/// When arrays are shorter than the mesh's.
#[must_use]
pub fn distortion(worn: &Worn<'_>) -> Vec<Distortion> {
    let mut measured = triangles(worn.mesh, worn.positions_m).map(|(vertices, laid_m)| {
        let cloth_m = vertices.map(|v| worn.uv[v as usize].as_dvec2() * worn.m_per_uv);
        let straight = edges(&vertices.map(|v| worn.straight_uv[v as usize].as_dvec2()));
        let texture = edges(&cloth_m);
        let turn: DVec2 = straight.iter().zip(&texture).map(|(a, b)| DVec2::new(a.dot(*b), a.perp_dot(*b))).sum();
        Measured {
            stretch: stretch(&texture, &laid_m),
            area_m2: texture[0].perp_dot(texture[1]).abs() / 2.0,
            turned_rad: libm::atan2(turn.y, turn.x).abs(),
            middle_m: (cloth_m[0] + cloth_m[1] + cloth_m[2]) / 3.0,
        }
    });
    let parts: Vec<Vec<Measured>> =
        worn.mesh.parts.iter().map(|part| measured.by_ref().take(part.triangle_count as usize).collect()).collect();
    let rows = parts.iter().map(|part| Distortion {
        motif: worst_motif(part, |[large, small]| (large + small) / 2.0 - 1.0),
        drawn_out: worst_motif(part, |[large, small]| (large - small) / 2.0),
        ..of(part.iter())
    });
    let mut rows: Vec<Distortion> = rows.collect();
    let worst =
        |of: fn(&Distortion) -> f64| rows.iter().map(of).max_by(|a, b| a.abs().total_cmp(&b.abs())).unwrap_or(0.0);
    let (motif, drawn_out) = (worst(|row| row.motif), worst(|row| row.drawn_out));
    rows.push(Distortion { motif, drawn_out, ..of(parts.iter().flatten()) });
    rows
}

/// One triangle.
#[derive(Clone, Copy)]
struct Measured {
    stretch: [f64; 2],
    /// Of cloth.
    area_m2: f64,
    turned_rad: f64,
    /// On the cloth.
    middle_m: DVec2,
}

fn of<'a>(triangles: impl Iterator<Item = &'a Measured>) -> Distortion {
    let mut turns: Vec<(f64, f64)> = Vec::new();
    let (mut squares, mut area_m2) = (0.0, 0.0);
    // Texture without area shows nothing.
    for triangle in triangles.filter(|triangle| triangle.area_m2 > 0.0) {
        area_m2 += triangle.area_m2;
        squares += triangle.area_m2
            * triangle.stretch.map(|stretch| (stretch - 1.0) * (stretch - 1.0)).iter().sum::<f64>()
            / 2.0;
        turns.push((triangle.turned_rad, triangle.area_m2));
    }
    turns.sort_by(|a, b| a.0.total_cmp(&b.0));
    let mut below_m2 = 0.0;
    let turned = turns.iter().find(|(_, triangle_m2)| {
        below_m2 += triangle_m2;
        below_m2 >= 0.99 * area_m2
    });
    let turned_deg = turned.map_or(0.0, |(turned_rad, _)| turned_rad.to_degrees());
    Distortion {
        rms: if area_m2 > 0.0 { (squares / area_m2).sqrt() } else { 0.0 },
        turned_deg,
        ..Distortion::default()
    }
}

/// The greatest mean error of a motif. Motifs lie side by side and once more shifted by half of their side along either direction and along
/// both.
fn worst_motif(triangles: &[Measured], error: impl Fn([f64; 2]) -> f64) -> f64 {
    let mut worst = 0.0f64;
    for shift in [[0.0, 0.0], [0.5, 0.0], [0.0, 0.5], [0.5, 0.5]] {
        let mut motifs: BTreeMap<(i64, i64), (f64, f64)> = BTreeMap::new();
        for triangle in triangles.iter().filter(|triangle| triangle.area_m2 > 0.0) {
            let place = (triangle.middle_m / MOTIF_M + DVec2::from(shift)).floor();
            let (sum, area_m2) = motifs.entry((place.x as i64, place.y as i64)).or_default();
            *sum += triangle.area_m2 * error(triangle.stretch);
            *area_m2 += triangle.area_m2;
        }
        let whole = motifs.values().filter(|(_, area_m2)| *area_m2 >= MOTIF_SHARE * MOTIF_M * MOTIF_M);
        for error in whole.map(|(sum, area_m2)| sum / area_m2) {
            worst = if error.abs() > worst.abs() { error } else { worst };
        }
    }
    worst
}

/// Each triangle's vertices, and its edges laid flat, metres.
fn triangles<'a>(mesh: &'a Mesh, positions_m: &'a [Vec3]) -> impl Iterator<Item = ([u32; 3], [DVec2; 3])> + 'a {
    mesh.triangles.iter().map(move |&vertices| {
        let [a, b, c] = vertices.map(|v| positions_m[mesh.unique(v) as usize]);
        (vertices, laid_flat(a, b, c))
    })
}

fn edges(&[a, b, c]: &[DVec2; 3]) -> [DVec2; 3] {
    [b - a, c - b, a - c]
}

#[cfg(test)]
mod tests {
    use super::*;
    use kitsuke::arrays::Part;

    /// A sheet of 0.3 m by 0.3 m, stretched and bent into a right angle, with a texture of 2 m per unit that is turned.
    #[test]
    fn a_stretched_sheet() {
        let (count, turn) = (31u32, 0.3f32);
        let place = |v: u32| Vec2::new((v % count) as f32, (v / count) as f32) * 0.01;
        let all = || (0..count * count).map(place);
        let corner = |v: u32| [[v, v + 1, v + count], [v + 1, v + count + 1, v + count]];
        let rows = (0..count - 1).flat_map(|y| (0..count - 1).map(move |x| y * count + x));
        let mesh = Mesh {
            positions_m: all().map(|p| Vec3::new(p.x, p.y.min(0.15), (p.y - 0.15).max(0.0))).collect(),
            uv: all().map(|p| p / 2.0).collect(),
            triangles: rows.flat_map(corner).collect(),
            parts: vec![Part { name: "sheet".into(), triangle_count: 2 * (count - 1) * (count - 1) }],
            ..Mesh::default()
        };
        assert!((m_per_uv(&mesh) - 2.0).abs() < 1e-5);
        let positions_m: Vec<Vec3> = mesh.positions_m.iter().map(|&p| p * Vec3::new(1.1, 1.0, 1.0)).collect();
        let uv: Vec<Vec2> = mesh.uv.iter().map(|uv| Vec2::from_angle(turn).rotate(*uv)).collect();
        let worn = Worn { mesh: &mesh, positions_m: &positions_m, uv: &uv, straight_uv: &mesh.uv, m_per_uv: 2.0 };
        let rows = distortion(&worn);
        assert_eq!(rows.len(), 2);
        for row in rows {
            assert!((row.rms - 0.1 / 2f64.sqrt()).abs() < 1e-5, "{row:?}");
            assert!((row.motif - 0.05).abs() < 1e-5 && (row.drawn_out - 0.05).abs() < 1e-5, "{row:?}");
            assert!((row.turned_deg - f64::from(turn).to_degrees()).abs() < 1e-3, "{row:?}");
        }
    }
}
