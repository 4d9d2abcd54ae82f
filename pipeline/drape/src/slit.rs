//! Cuts into flat cloth along borders of its elements: new particles, and triangles on one side that take them; and the zones that a slit and its
//! extension divide cloth into (Shoda 2018, 2.2.2.1). Knows neither form nor forces.

use glam::DVec2;
use std::collections::BTreeSet;

/// Flat cloth: places along weft (X) and warp (Y), metres, and triangles that turn counter-clockwise.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Flat {
    /// Of each vertex.
    pub places_m: Vec<DVec2>,
    /// Three vertices each.
    pub triangles: Vec<[u32; 3]>,
    /// Of each triangle.
    pub zones: Vec<u32>,
}

/// Why cloth is not cut.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum SlitError {
    /// A path that is none.
    #[error("a slit goes along at least one edge, from a border of the cloth to where it ends: {0} vertices are none")]
    Short(usize),
    /// Two vertices that no edge joins.
    #[error("vertices {0} and {1} of the slit are not joined by an edge")]
    NoEdge(u32, u32),
    /// A vertex twice, or at a border in the middle of the way.
    #[error("vertex {0} of the slit lies on it twice or on a border of the cloth; a slit ends there")]
    Crosses(u32),
}

impl Flat {
    /// A rectangle of cells, from `low_m` on, diagonals turned from cell to cell, all of zone 0.
    #[must_use]
    pub fn rectangle(low_m: DVec2, columns: usize, rows: usize, spacing_m: DVec2) -> Flat {
        let mut flat = Flat::default();
        for row in 0..=rows {
            for column in 0..=columns {
                flat.places_m.push(low_m + DVec2::new(column as f64, row as f64) * spacing_m);
                if row == 0 || column == 0 {
                    continue;
                }
                let d = (row * (columns + 1) + column) as u32;
                let [a, b, c] = [d - columns as u32 - 2, d - columns as u32 - 1, d - 1];
                let pair = if (row + column) % 2 == 0 { [[a, b, d], [a, d, c]] } else { [[a, b, c], [b, d, c]] };
                flat.triangles.extend(pair);
            }
        }
        flat.zones = vec![0; flat.triangles.len()];
        flat
    }

    /// The middle of a triangle.
    #[must_use]
    pub fn middle_m(&self, triangle: usize) -> DVec2 {
        self.triangles[triangle].map(|v| self.places_m[v as usize]).iter().sum::<DVec2>() / 3.0
    }

    /// Cuts along a path of edges from a border to its last vertex, which stays whole. Triangles to the right of the way take new vertices; which are
    /// returned, in the order of the path without its last one.
    ///
    /// # Errors
    /// When the path is no path of edges, or touches itself or a border on its way. Then nothing is cut.
    pub fn slit(&mut self, path: &[u32]) -> Result<Vec<u32>, SlitError> {
        if path.len() < 2 {
            return Err(SlitError::Short(path.len()));
        }
        let sides: BTreeSet<[u32; 2]> =
            self.triangles.iter().flat_map(|[a, b, c]| [[*a, *b], [*b, *c], [*c, *a]]).collect();
        let mut met = BTreeSet::new();
        for (i, pair) in path.windows(2).enumerate() {
            let [a, b] = [pair[0], pair[1]];
            if !sides.contains(&[a, b]) || !sides.contains(&[b, a]) {
                return Err(SlitError::NoEdge(a, b));
            }
            let is_border = sides.iter().any(|&[c, d]| (c == b || d == b) && !sides.contains(&[d, c]));
            if !met.insert(a) || met.contains(&b) || (i + 2 < path.len() && is_border) {
                return Err(SlitError::Crosses(b));
            }
        }
        let cut: BTreeSet<[u32; 2]> =
            path.windows(2).flat_map(|pair| [[pair[0], pair[1]], [pair[1], pair[0]]]).collect();
        let mut added = Vec::new();
        let mut relinked = self.triangles.clone();
        for (i, &vertex) in path[..path.len() - 1].iter().enumerate() {
            let around: Vec<usize> =
                (0..self.triangles.len()).filter(|t| self.triangles[*t].contains(&vertex)).collect();
            // To the right of the way lies the triangle that has its edge the other way round.
            let has_side = |t: usize, side: [u32; 2]| {
                let [a, b, c] = self.triangles[t];
                [[a, b], [b, c], [c, a]].contains(&side)
            };
            let mut right: Vec<usize> =
                around.iter().copied().filter(|t| has_side(*t, [path[i + 1], vertex])).collect();
            let mut next = 0;
            while next < right.len() {
                let [a, b, c] = self.triangles[right[next]];
                for [from, to] in [[a, b], [b, c], [c, a]] {
                    if (from == vertex || to == vertex) && !cut.contains(&[from, to]) {
                        let beside = around.iter().copied().find(|t| has_side(*t, [to, from]));
                        right.extend(beside.filter(|t| !right.contains(t)));
                    }
                }
                next += 1;
            }
            let new = (self.places_m.len() + added.len()) as u32;
            added.push(new);
            for t in right {
                relinked[t].iter_mut().filter(|v| **v == vertex).for_each(|v| *v = new);
            }
        }
        for &vertex in &path[..path.len() - 1] {
            self.places_m.push(self.places_m[vertex as usize]);
        }
        self.triangles = relinked;
        Ok(added)
    }

    /// Triangles beyond a warp line, towards greater weft, are of the next zone.
    pub fn divide(&mut self, weft_m: f64) {
        for triangle in 0..self.triangles.len() {
            if self.middle_m(triangle).x > weft_m {
                self.zones[triangle] += 1;
            }
        }
    }

    /// The zone of each vertex: the least of its triangles'.
    #[must_use]
    pub fn vertex_zones(&self) -> Vec<u32> {
        let mut zones = vec![u32::MAX; self.places_m.len()];
        for (corners, zone) in self.triangles.iter().zip(&self.zones) {
            corners.iter().for_each(|&v| zones[v as usize] = zones[v as usize].min(*zone));
        }
        zones
    }

    /// The vertices nearest to a warp line and above a height, from the highest down.
    #[must_use]
    pub fn along_warp(&self, weft_m: f64, from_warp_m: f64) -> Vec<u32> {
        let away = |place: &DVec2| (place.x - weft_m).abs();
        let nearest = self.places_m.iter().map(away).fold(f64::INFINITY, f64::min);
        let mut path: Vec<u32> = (0..self.places_m.len() as u32)
            .filter(|v| {
                let place = self.places_m[*v as usize];
                away(&place) <= nearest + 1e-9 && place.y >= from_warp_m - 1e-9
            })
            .collect();
        path.sort_by(|a, b| self.places_m[*b as usize].y.total_cmp(&self.places_m[*a as usize].y));
        path
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Open edges, and whether every edge has at most two triangles that face the same way.
    fn borders(flat: &Flat) -> usize {
        let sides: Vec<[u32; 2]> = flat.triangles.iter().flat_map(|[a, b, c]| [[*a, *b], [*b, *c], [*c, *a]]).collect();
        let set: BTreeSet<[u32; 2]> = sides.iter().copied().collect();
        assert_eq!(set.len(), sides.len(), "no edge twice in the same direction");
        sides.iter().filter(|[a, b]| !set.contains(&[*b, *a])).count()
    }

    #[test]
    fn a_slit_parts_cloth_along_its_edges_and_nowhere_else() {
        let mut flat = Flat::rectangle(DVec2::new(-0.1, 0.0), 6, 8, DVec2::new(0.02, 0.03));
        assert_eq!((flat.places_m.len(), flat.triangles.len(), borders(&flat)), (63, 96, 28));
        let path = flat.along_warp(-0.04, 0.15);
        assert_eq!(path.len(), 4);
        let added = flat.slit(&path).unwrap();
        flat.divide(-0.04);
        assert_eq!((added.len(), flat.places_m.len(), borders(&flat)), (3, 66, 28 + 6));
        for (old, new) in path.iter().zip(&added) {
            assert_eq!(flat.places_m[*old as usize], flat.places_m[*new as usize]);
        }
        let zones = flat.vertex_zones();
        for (corners, zone) in flat.triangles.iter().zip(&flat.zones) {
            let beyond = corners.iter().map(|v| flat.places_m[*v as usize].x).sum::<f64>() / 3.0 > -0.04;
            assert_eq!(*zone, u32::from(beyond));
            // Downwards, the right is where X is less.
            assert!(beyond || path[..3].iter().all(|v| !corners.contains(v)), "right triangles have the new vertices");
        }
        assert!(added.iter().all(|v| zones[*v as usize] == 0) && path[..3].iter().all(|v| zones[*v as usize] == 1));
    }

    #[test]
    fn what_is_no_path_is_said_and_cuts_nothing() {
        let flat = Flat::rectangle(DVec2::ZERO, 4, 4, DVec2::ONE);
        for (path, wanted) in [
            (vec![22], SlitError::Short(1)),
            (vec![22, 12], SlitError::NoEdge(22, 12)),
            (vec![22, 17, 22], SlitError::Crosses(22)),
            (vec![20, 15, 16], SlitError::NoEdge(20, 15)),
        ] {
            let mut cut = flat.clone();
            assert_eq!(cut.slit(&path), Err(wanted));
            assert_eq!(cut, flat);
        }
    }
}
