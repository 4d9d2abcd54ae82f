//! What a look at an imported mesh tells of it as a surface: holes, pieces, edges of three faces. Vertices at one place count as one here,
//! for many formats part them where texture coordinates do. Judges nothing.

use super::ImportedMesh;
use glam::DVec3;

/// A triangle whose height is a smaller share of its longest edge has no area.
const FLAT: f64 = 1e-9;

/// Figures of a surface.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Soundness {
    /// Vertices of no triangle.
    pub unused: usize,
    /// Triangles without area.
    pub degenerate: usize,
    /// Edges of more than two triangles.
    pub non_manifold_edges: usize,
    /// Rims: connected edges of one triangle.
    pub border_loops: usize,
    /// Pieces that no edge and no vertex connects.
    pub components: usize,
}

impl ImportedMesh {
    /// Looks at the surface.
    #[must_use]
    pub fn soundness(&self) -> Soundness {
        let count = self.positions.len();
        let mut is_used = vec![false; count];
        self.triangles.iter().flatten().for_each(|&v| is_used[v as usize] = true);
        let places = places(&self.positions);
        let triangles: Vec<[u32; 3]> = self.triangles.iter().map(|t| t.map(|v| places[v as usize])).collect();
        let is_flat = |[a, b, c]: &[u32; 3]| {
            let [a, b, c] = [a, b, c].map(|&v| self.positions[v as usize]);
            let longest = (b - a).length_squared().max((c - b).length_squared()).max((a - c).length_squared());
            (b - a).cross(c - a).length() <= FLAT * longest
        };
        let (flat, whole): (Vec<[u32; 3]>, Vec<[u32; 3]>) = triangles.iter().partition(|triangle| is_flat(triangle));
        let edge = |a: u32, b: u32| (a.min(b), a.max(b));
        let mut edges: Vec<(u32, u32)> =
            whole.iter().flat_map(|&[a, b, c]| [edge(a, b), edge(b, c), edge(c, a)]).collect();
        edges.sort_unstable();
        let runs = || edges.chunk_by(|a, b| a == b);
        let border: Vec<(u32, u32)> = runs().filter(|run| run.len() == 1).map(|run| run[0]).collect();
        Soundness {
            unused: is_used.iter().filter(|used| !**used).count(),
            degenerate: flat.len(),
            non_manifold_edges: runs().filter(|run| run.len() > 2).count(),
            border_loops: pieces(count, border.iter().copied()),
            components: pieces(count, triangles.iter().flat_map(|&[a, b, c]| [(a, b), (b, c)])),
        }
    }
}

/// The first vertex that lies where each vertex lies.
fn places(positions: &[DVec3]) -> Vec<u32> {
    // Zeros of both signs are one place.
    let key = |v: u32| (positions[v as usize] + DVec3::ZERO).to_array().map(f64::to_bits);
    let mut order: Vec<u32> = (0..positions.len() as u32).collect();
    order.sort_unstable_by_key(|&v| (key(v), v));
    let mut places = vec![0; positions.len()];
    for run in order.chunk_by(|&a, &b| key(a) == key(b)) {
        run.iter().for_each(|&v| places[v as usize] = run[0]);
    }
    places
}

/// How many pieces the links make, of what they touch.
fn pieces(count: usize, links: impl Iterator<Item = (u32, u32)>) -> usize {
    let mut above: Vec<u32> = (0..count as u32).collect();
    let mut is_touched = vec![false; count];
    let top = |above: &mut Vec<u32>, mut v: u32| {
        while above[v as usize] != v {
            above[v as usize] = above[above[v as usize] as usize];
            v = above[v as usize];
        }
        v
    };
    for (a, b) in links {
        [a, b].into_iter().for_each(|v| is_touched[v as usize] = true);
        let (a, b) = (top(&mut above, a), top(&mut above, b));
        above[a.max(b) as usize] = a.min(b);
    }
    (0..count).filter(|&v| is_touched[v] && above[v] == v as u32).count()
}
