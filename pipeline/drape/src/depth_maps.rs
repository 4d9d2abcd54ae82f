//! A body as depth maps from front, back and above (P2, section 5): where cloth lies in it, and which way out. Knows no cloth.
//!
//! Between what front and back see, below what is seen from above, all counts as body: an arm that is held before the trunk
//! fills the gap behind it. Surfaces that none of the three sees (under the chin, a sole) do not exist.

use glam::DVec3;

/// Most cells of one map: 64 million numbers in all three would still be allocated, more is refused.
const MOST_CELLS: usize = 1 << 24;
/// Empty cells around the body, so that every cell that is looked at has neighbours.
const BORDER: f64 = 5.0;

/// One map: the outermost surface along one axis on a grid of cells. `outward` is +1 where greater is further out, -1 else.
#[derive(Clone, Debug)]
struct DepthMap {
    /// Which coordinates run along columns and rows, and which one is the depth.
    axes: [usize; 3],
    outward: f64,
    from_m: [f64; 2],
    counts: [usize; 2],
    /// Depth times `outward` at the middles of the cells, rows of columns; negative infinity where there is no body.
    depths_m: Vec<f64>,
}

/// A body, seen from front (+Z), back (-Z) and above (+Y).
#[derive(Clone, Debug)]
pub struct DepthMaps {
    cell_m: f64,
    maps: [DepthMap; 3],
}

/// Where the body's nearest visible surface is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Surface {
    /// Unit normal, out of the body.
    pub normal: DVec3,
    /// How deep the place lies in the body (below the surface and its clearance), metres, above 0.
    pub depth_m: f64,
}

/// Why a mesh gives no depth maps.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum DepthMapError {
    /// A coordinate is not a number.
    #[error("position {0} of the body is not finite")]
    NotFinite(usize),
    /// A triangle names a position that is not there.
    #[error("triangle {triangle} of the body names position {position} of {positions}")]
    Index {
        /// Number of the triangle, from 0.
        triangle: usize,
        /// The position that it names.
        position: u32,
        /// How many there are.
        positions: usize,
    },
    /// No triangles.
    #[error("the body has no triangles")]
    Empty,
    /// The cells are not above 0 or too small for the body.
    #[error("cells of {cell_m} m give maps of {cells} cells, must be 1 to {MOST_CELLS}")]
    Cells {
        /// Width of a cell.
        cell_m: f64,
        /// Cells of the largest map; 0 for a width that is no width.
        cells: f64,
    },
}

impl DepthMaps {
    /// From a triangle mesh in metres, which need not be closed, with cells of the given width (5 mm serve a person).
    ///
    /// # Errors
    /// When a number is not finite, an index is out of range, there are no triangles or a map would be above 16 million cells.
    pub fn new(positions_m: &[DVec3], triangles: &[[u32; 3]], cell_m: f64) -> Result<DepthMaps, DepthMapError> {
        if let Some(bad) = positions_m.iter().position(|place| !place.is_finite()) {
            return Err(DepthMapError::NotFinite(bad));
        }
        for (triangle, corners) in triangles.iter().enumerate() {
            if let Some(&position) = corners.iter().find(|&&corner| corner as usize >= positions_m.len()) {
                return Err(DepthMapError::Index { triangle, position, positions: positions_m.len() });
            }
        }
        if triangles.is_empty() {
            return Err(DepthMapError::Empty);
        }
        let (mut low_m, mut high_m) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
        for &corner in triangles.iter().flatten() {
            low_m = low_m.min(positions_m[corner as usize]);
            high_m = high_m.max(positions_m[corner as usize]);
        }
        let size_m = high_m - low_m;
        let cells = (size_m.y / cell_m + 2.0 * BORDER + 1.0) * (size_m.x.max(size_m.z) / cell_m + 2.0 * BORDER + 1.0);
        let cells = cells.max((size_m.x / cell_m + 2.0 * BORDER + 1.0) * (size_m.z / cell_m + 2.0 * BORDER + 1.0));
        if !(cell_m.is_finite() && cell_m > 0.0) || cells > MOST_CELLS as f64 {
            return Err(DepthMapError::Cells { cell_m, cells: if cell_m > 0.0 { cells } else { 0.0 } });
        }
        let map = |axes: [usize; 3], outward: f64| {
            let from_m = [low_m[axes[0]] - BORDER * cell_m, low_m[axes[1]] - BORDER * cell_m];
            let counts = [0, 1].map(|i| (size_m[axes[i]] / cell_m) as usize + 2 * BORDER as usize + 1);
            let depths_m = vec![f64::NEG_INFINITY; counts[0] * counts[1]];
            let mut map = DepthMap { axes, outward, from_m, counts, depths_m };
            for corners in triangles {
                rasterise(&mut map, cell_m, corners.map(|corner| positions_m[corner as usize]));
            }
            map
        };
        Ok(DepthMaps { cell_m, maps: [map([0, 1, 2], 1.0), map([0, 1, 2], -1.0), map([0, 2, 1], 1.0)] })
    }

    /// The nearest way out for a place that lies in the body, or nearer to its surface than the clearance (metres, at least 0);
    /// none for a place outside.
    ///
    /// A surface along which all three maps look (the side of the trunk) keeps no clearance, and along which one of them looks (the
    /// top of a shoulder) none beyond a cell and a half.
    #[must_use]
    pub fn inside(&self, place_m: DVec3, clearance_m: f64) -> Option<Surface> {
        let mut nearest: Option<Surface> = None;
        let mut is_beside = false;
        for map in &self.maps {
            let (height_m, slopes) = match sample(map, self.cell_m, place_m) {
                Sample::Surface { height_m, slopes } => (height_m, slopes),
                Sample::Beside => {
                    is_beside = true;
                    continue;
                }
                Sample::Nothing => return None,
            };
            // The surface is height(a, b); its normal leans against the slopes.
            let steepness = (1.0 + slopes[0] * slopes[0] + slopes[1] * slopes[1]).sqrt();
            let depth_m = (height_m - place_m[map.axes[2]] * map.outward) / steepness + clearance_m;
            if depth_m <= 0.0 {
                return None;
            }
            if nearest.is_none_or(|nearest| depth_m < nearest.depth_m) {
                let mut normal = DVec3::ZERO;
                normal[map.axes[0]] = -slopes[0] / steepness;
                normal[map.axes[1]] = -slopes[1] / steepness;
                normal[map.axes[2]] = map.outward / steepness;
                nearest = Some(Surface { normal, depth_m });
            }
        }
        // Beside an outline a place is outside; another map may see that it is over the body, as on top of a shoulder.
        nearest.filter(|nearest| !is_beside || nearest.depth_m <= clearance_m)
    }
}

/// What a map has at a place.
enum Sample {
    /// Height of the surface (depth times `outward`, metres) with its slopes along columns and rows.
    Surface { height_m: f64, slopes: [f64; 2] },
    /// No body, but some within two cells.
    Beside,
    /// No body.
    Nothing,
}

/// Draws one triangle: the outermost depth stays in each cell whose middle it covers, its border included.
fn rasterise(map: &mut DepthMap, cell_m: f64, corners_m: [DVec3; 3]) {
    let [column, row, depth] = map.axes;
    // In cells, so that the middle of cell i is at i.
    let across = corners_m.map(|corner| (corner[column] - map.from_m[0]) / cell_m - 0.5);
    let along = corners_m.map(|corner| (corner[row] - map.from_m[1]) / cell_m - 0.5);
    let doubled = (across[1] - across[0]) * (along[2] - along[0]) - (across[2] - across[0]) * (along[1] - along[0]);
    if doubled == 0.0 {
        return;
    }
    let range = |values: [f64; 3], count: usize| {
        let low = values[0].min(values[1]).min(values[2]).ceil().max(0.0) as usize;
        let high = values[0].max(values[1]).max(values[2]).floor().min(count as f64 - 1.0) as usize;
        low..=high
    };
    for j in range(along, map.counts[1]) {
        for i in range(across, map.counts[0]) {
            let (x, y) = (i as f64, j as f64);
            let share =
                |a: usize, b: usize| ((across[a] - x) * (along[b] - y) - (across[b] - x) * (along[a] - y)) / doubled;
            let shares = [share(1, 2), share(2, 0), share(0, 1)];
            // A little beyond the border, so that no cell falls between two triangles.
            if shares.iter().all(|&share| share >= -1e-9) {
                let at_m: f64 = (0..3).map(|corner| shares[corner] * corners_m[corner][depth]).sum();
                let cell = &mut map.depths_m[j * map.counts[0] + i];
                *cell = cell.max(at_m * map.outward);
            }
        }
    }
}

/// Looks into a map: bilinear between the middles of four cells that all have body; at an outline, the nearest cell's plane.
fn sample(map: &DepthMap, cell_m: f64, place_m: DVec3) -> Sample {
    let at = [0, 1].map(|i| (place_m[map.axes[i]] - map.from_m[i]) / cell_m - 0.5);
    let has_neighbours = |i: usize| at[i] >= 2.0 && at[i] < map.counts[i] as f64 - 3.0;
    if !(has_neighbours(0) && has_neighbours(1)) {
        return Sample::Nothing;
    }
    let cell = [at[0] as usize, at[1] as usize];
    let part = [at[0] - cell[0] as f64, at[1] - cell[1] as f64];
    let height = |i: usize, j: usize| map.depths_m[j * map.counts[0] + i];
    let [i, j] = cell;
    let [a, b, c, d] = [height(i, j), height(i + 1, j), height(i, j + 1), height(i + 1, j + 1)];
    if a.is_finite() && b.is_finite() && c.is_finite() && d.is_finite() {
        let [u, v] = part;
        let height_m = (a * (1.0 - u) + b * u) * (1.0 - v) + (c * (1.0 - u) + d * u) * v;
        let slopes = [(b - a) * (1.0 - v) + (d - c) * v, (c - a) * (1.0 - u) + (d - b) * u];
        return Sample::Surface { height_m, slopes: slopes.map(|slope| slope / cell_m) };
    }
    let [i, j] = [0, 1].map(|k| cell[k] + usize::from(part[k] >= 0.5));
    let middle = height(i, j);
    if !middle.is_finite() {
        let is_beside = (j - 2..=j + 2).any(|j| (i - 2..=i + 2).any(|i| height(i, j).is_finite()));
        return if is_beside { Sample::Beside } else { Sample::Nothing };
    }
    let slope = |before: f64, after: f64| match (before.is_finite(), after.is_finite()) {
        (true, true) => 0.5 * (after - before),
        (true, false) => middle - before,
        (false, true) => after - middle,
        (false, false) => 0.0,
    };
    let slopes = [slope(height(i - 1, j), height(i + 1, j)), slope(height(i, j - 1), height(i, j + 1))];
    let height_m = middle + slopes[0] * (at[0] - i as f64) + slopes[1] * (at[1] - j as f64);
    Sample::Surface { height_m, slopes: slopes.map(|slope| slope / cell_m) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::analytic_form;

    #[test]
    fn a_sphere_pushes_out_along_its_radius() {
        let centre_m = DVec3::new(0.1, 1.0, -0.2);
        let (positions_m, triangles) = analytic_form::sphere(centre_m, 0.2, 128);
        let maps = DepthMaps::new(&positions_m, &triangles, 0.004).unwrap();
        for direction in [DVec3::Z, DVec3::NEG_Z, DVec3::Y, DVec3::new(0.5, 0.6, 0.4), DVec3::new(-0.3, 0.2, -0.8)] {
            let direction = direction.normalize();
            let surface = maps.inside(centre_m + direction * 0.19, 0.0).unwrap();
            assert!((surface.depth_m - 0.01).abs() < 1e-3, "{direction}: {surface:?}");
            assert!(surface.normal.dot(direction) > 0.99, "{direction}: {surface:?}");
            assert_eq!(maps.inside(centre_m + direction * 0.203, 0.0), None, "{direction}");
            let near = maps.inside(centre_m + direction * 0.203, 0.005).unwrap();
            assert!((near.depth_m - 0.002).abs() < 1e-3, "{direction}: {near:?}");
        }
        // At the side, where front and back see an edge, the way out is still sideways.
        let surface = maps.inside(centre_m + DVec3::X * 0.197, 0.0).unwrap();
        assert!(surface.normal.x > 0.8 && surface.depth_m < 0.02, "{surface:?}");
        assert_eq!(maps.inside(centre_m + DVec3::X * 5.0, 0.01), None);
    }

    #[test]
    fn every_place_well_inside_the_form_is_seen_as_inside() {
        let (positions_m, triangles) = analytic_form::dress_form(96);
        let maps = DepthMaps::new(&positions_m, &triangles, 0.005).unwrap();
        let (mut inside, mut outside) = (0, 0);
        for step in 0..20_000 {
            // Places spread by multiples of irrational numbers.
            let part = |by: f64| (f64::from(step) * by).fract();
            let place = DVec3::new(part(0.754_877) - 0.5, 0.71 + 0.78 * part(0.569_840), part(0.819_173) - 0.5) * 1.0;
            let [width, depth] = analytic_form::dress_form_radii_m(place.y).unwrap();
            let level = ((place.x / width).powi(2) + (place.z / depth).powi(2)).sqrt();
            if level < 0.9 {
                assert!(maps.inside(place, 0.0).is_some(), "{place}");
                inside += 1;
            } else if level > 1.1 && !(1.33..1.46).contains(&place.y) {
                assert!(maps.inside(place, 0.0).is_none(), "{place}");
                outside += 1;
            }
        }
        assert!(inside > 500 && outside > 5_000, "{inside} {outside}");
    }

    #[test]
    fn what_is_wrong_with_a_body_is_said() {
        let positions = [DVec3::ZERO, DVec3::X, DVec3::Y];
        let error = |positions: &[DVec3], triangles: &[[u32; 3]], cell_m: f64| {
            DepthMaps::new(positions, triangles, cell_m).unwrap_err().to_string()
        };
        assert_eq!(error(&positions, &[[0, 1, 3]], 0.01), "triangle 0 of the body names position 3 of 3");
        assert_eq!(error(&[DVec3::NAN], &[], 0.01), "position 0 of the body is not finite");
        assert_eq!(error(&positions, &[], 0.01), "the body has no triangles");
        for cell_m in [0.0, -1.0, f64::NAN, 1e-6, f64::INFINITY] {
            assert!(error(&positions, &[[0, 1, 2]], cell_m).starts_with("cells of "), "{cell_m}");
        }
    }
}
