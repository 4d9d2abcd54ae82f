//! Which whole points stand for a field: each lies within a ball around what is wanted, and of the points within it the one
//! is taken that lets all fields together take the fewest bytes. Knows how fields are predicted, not how differences are
//! coded.
//!
//! A ball holds two or three points. Which of them is nearest to its own prediction is easily said; but the vertices and
//! fields that are predicted from it then go by it, so that its error lives on in theirs. The points are therefore chosen
//! again, in several sweeps over the cloth, each as its own difference and all those that hang on it would have it
//! (iterated conditional modes, Besag 1986).

use super::encode::{Layout, cost};
use super::*;
use crate::arrays::Mesh;

/// Choices of what predicts a patch, each from the points that the one before led to.
const ROUNDS: usize = 2;
/// Sweeps after each: the third changes one point in a hundred.
const SWEEPS: usize = 3;
/// Whole numbers of a coordinate within a ball, at most.
const WIDEST: usize = 7;

/// Whole steps within `radius` steps of what is wanted, such that the fields take few bytes. `moved` is per run of vertices of the
/// mesh how many they are and which fields move them; `wanted` is per field x, y, z of those vertices, in steps, not yet whole. Every
/// ball must hold a whole point: the radius is √3/2 or more, and 3 at most.
///
/// # Panics
/// When the mesh, the runs and the fields do not fit each other, steps lie outside 16 bits, or the radius is another.
#[must_use]
pub fn quantise(mesh: &Mesh, moved: &[(usize, Vec<u16>)], wanted: &[Vec<Vec3>], radius: f32) -> Vec<Vec<[i16; 3]>> {
    assert!((0.866..=3.0).contains(&radius), "a radius of {radius} steps");
    let lower = Lower::new(mesh.positions_m.len(), &mesh.twin_of, &mesh.triangles);
    let centers: Vec<Vec<[f32; 3]>> =
        wanted.iter().map(|wanted| wanted.iter().map(|steps| steps.to_array()).collect()).collect();
    let centers: Vec<&[[f32; 3]]> = centers.iter().map(Vec::as_slice).collect();
    let layout = Layout::new(moved, wanted.len(), &lower, &mesh.positions_m);
    let centers = layout.rows(&centers);

    let mut chosen: Vec<[f32; 4]> = centers.iter().map(|values| values.map(f32::round)).collect();
    for round in 0..ROUNDS {
        let mut choice = Choice::new(&layout, &centers, chosen, radius);
        if round == 0 {
            choice.sweep(false);
        }
        for _ in 0..SWEEPS {
            choice.sweep(true);
        }
        chosen = choice.chosen;
    }
    let mut steps = vec![Vec::new(); wanted.len()];
    for patch in patches(moved) {
        append(&patch, &chosen, layout.quads(), &mut steps);
    }
    steps
}

/// The points chosen so far, and what hangs on them. All arrays of numbers hold the vectors of all fields side by side,
/// vertex after vertex.
struct Choice<'a> {
    layout: &'a Layout<'a>,
    centers: &'a [[f32; 4]],
    radius: f32,
    chosen: Vec<[f32; 4]>,
    /// What the prediction along the mesh leaves of them.
    left: Vec<[f32; 4]>,
    /// Numbers of a vertex.
    width: usize,
    /// Per vertex those that are predicted from it, with its weight there.
    dependents: Vec<Vec<(usize, f32)>>,
    /// Per vertex its patch; beyond all where nothing moves.
    patch_of: Vec<usize>,
    /// Per patch and field how it is predicted there; none where it does not move.
    hanging: Vec<Vec<Option<Hanging>>>,
    affected: Affected,
}

/// How a field is predicted across fields in a patch.
#[derive(Clone)]
struct Hanging {
    reference: Option<Reference>,
    /// The fields that name it, with the share of it that they add.
    followers: Vec<(usize, f32)>,
}

/// Differences that change with a point.
#[derive(Default)]
struct Affected {
    /// As they are, coordinate by coordinate.
    differences: [Vec<f32>; 3],
    /// How much of the point's change each of them takes.
    shares: Vec<f32>,
}

impl Affected {
    fn clear(&mut self) {
        self.differences.iter_mut().for_each(Vec::clear);
        self.shares.clear();
    }

    fn add(&mut self, difference: Vec3, share: f32) {
        self.differences.iter_mut().zip(difference.to_array()).for_each(|(all, one)| all.push(one));
        self.shares.push(share);
    }

    /// What all of them take when a coordinate of the point changes.
    fn cost(&self, axis: usize, change: f32) -> u32 {
        let both = self.differences[axis].iter().zip(&self.shares);
        both.map(|(difference, share)| cost(difference + change * share)).fold(0, u32::wrapping_add)
    }
}

impl<'a> Choice<'a> {
    fn new(layout: &'a Layout<'a>, centers: &'a [[f32; 4]], chosen: Vec<[f32; 4]>, radius: f32) -> Choice<'a> {
        let left = layout.left(&chosen);
        let mut dependents = vec![Vec::new(); layout.stencils.len()];
        for (vertex, stencil) in layout.stencils.iter().enumerate() {
            for (&before, &weight) in stencil.vertices.iter().zip(&stencil.weights).take(stencil.count) {
                dependents[before as usize].push((vertex, weight));
            }
        }
        let mut patch_of = vec![usize::MAX; layout.stencils.len()];
        let mut hanging = Vec::new();
        for (patch, references) in patches(layout.segments).zip(layout.references(&left)) {
            patch_of[patch.vertices.clone()].fill(hanging.len());
            let mut here: Vec<Option<Hanging>> = vec![None; layout.field_count];
            for (&field, number) in patch.fields.iter().zip(references) {
                let reference = Reference::from_number(number);
                if let Some(Reference { field: other, share }) = reference {
                    let other = here[other].as_mut().expect("a reference names an earlier field of its patch");
                    other.followers.push((usize::from(field), share));
                }
                here[usize::from(field)] = Some(Hanging { reference, followers: Vec::new() });
            }
            hanging.push(here);
        }
        let (width, affected) = (4 * layout.quads(), Affected::default());
        Choice { layout, centers, radius, chosen, left, width, dependents, patch_of, hanging, affected }
    }

    /// Chooses every point once; by its own difference alone where nothing follows what is chosen yet.
    fn sweep(&mut self, heeds_others: bool) {
        for patch in patches(self.layout.segments) {
            for vertex in patch.vertices.clone() {
                for &field in patch.fields {
                    self.choose(vertex, usize::from(field), heeds_others);
                }
            }
        }
    }

    fn choose(&mut self, vertex: usize, field: usize, heeds_others: bool) {
        let lane = vertex * self.width + 3 * field;
        let vector = |values: &[[f32; 4]]| Vec3::from_slice(&values.as_flattened()[lane..]);
        let (center, now) = (vector(self.centers), vector(&self.chosen));
        // Balls overlap the end of what is stored.
        let end = f32::from(i16::MAX);
        let low = (center - self.radius).ceil().max(Vec3::splat(-end));
        let high = (center + self.radius).floor().min(Vec3::splat(end));
        let counts = (high - low + 1.0).max(Vec3::ZERO).to_array().map(|count| count as usize);
        if counts.iter().product::<usize>() <= 1 {
            return;
        }

        let mut affected = std::mem::take(&mut self.affected);
        affected.clear();
        self.add(vertex, field, 1.0, heeds_others, &mut affected);
        for &(dependent, weight) in self.dependents[vertex].iter().filter(|_| heeds_others) {
            self.add(dependent, field, -weight, true, &mut affected);
        }
        // Coordinates cost on their own, only the ball ties them to each other.
        let mut costs = [[0; WIDEST]; 3];
        for axis in 0..3 {
            for (place, cost) in costs[axis].iter_mut().enumerate().take(counts[axis]) {
                *cost = affected.cost(axis, low[axis] + place as f32 - now[axis]);
            }
        }
        self.affected = affected;
        let (mut best, mut least) = (now, (u32::MAX, true));
        for x in 0..counts[0] {
            for y in 0..counts[1] {
                for z in 0..counts[2] {
                    let point = low + Vec3::new(x as f32, y as f32, z as f32);
                    let cost = costs[0][x].wrapping_add(costs[1][y]).wrapping_add(costs[2][z]);
                    let cost = (cost, point != now);
                    if cost < least && point.distance_squared(center) <= self.radius * self.radius {
                        (best, least) = (point, cost);
                    }
                }
            }
        }
        if best == now {
            return;
        }
        let change = best - now;
        best.write_to_slice(&mut self.chosen.as_flattened_mut()[lane..]);
        let left = self.left.as_flattened_mut();
        for i in 0..3 {
            left[lane + i] += change[i];
            for &(dependent, weight) in &self.dependents[vertex] {
                left[dependent * self.width + 3 * field + i] -= weight * change[i];
            }
        }
    }

    /// Adds the difference of a field at a vertex, and if asked those of the fields that add a share of it. Where the field does not
    /// move there is none.
    fn add(&self, vertex: usize, field: usize, share: f32, with_followers: bool, affected: &mut Affected) {
        let left = |field: usize| Vec3::from_slice(&self.left.as_flattened()[vertex * self.width + 3 * field..]);
        let Some(patch) = self.hanging.get(self.patch_of[vertex]) else { return };
        let difference = |field: usize, hanging: &Hanging| {
            let across = hanging.reference.map_or(Vec3::ZERO, |Reference { field, share }| left(field) * share);
            left(field) - across
        };
        let Some(hanging) = &patch[field] else { return };
        affected.add(difference(field, hanging), share);
        for &(follower, of_it) in hanging.followers.iter().filter(|_| with_followers) {
            let hanging = patch[follower].as_ref().expect("fields that follow are of the patch");
            affected.add(difference(follower, hanging), -share * of_it);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::pack::codec::Writer;

    /// A sheet of `side` times `side` vertices in two runs, of which only the first moves with every field.
    fn sheet(side: u32) -> (Mesh, [(usize, Vec<u16>); 2]) {
        let place = |v: u32| Vec3::new((v % side) as f32, (v / side) as f32, 0.0) * 0.01;
        let corner = |v: u32| [[v, v + 1, v + side], [v + 1, v + side + 1, v + side]];
        let cells = (0..side * (side - 1)).filter(|v| v % side + 1 < side);
        let mesh = Mesh {
            positions_m: (0..side * side).map(place).collect(),
            triangles: cells.flat_map(corner).collect(),
            ..Mesh::default()
        };
        let (count, half) = ((side * side) as usize, (side * side / 2) as usize);
        (mesh, [(half, vec![0, 1, 2]), (count - half, vec![0, 2])])
    }

    /// Waves with noise of half a step, the second field like the first.
    fn fields(vertex_count: usize, half: usize) -> Vec<Vec<Vec3>> {
        let mut state = 7u32;
        let mut noise = || {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            (state >> 8) as f32 / (1 << 24) as f32 - 0.5
        };
        let mut field = |count: usize, phase: f32| -> Vec<Vec3> {
            let step = |v: usize| {
                let wave = 40.0 * libm::sinf(v as f32 * 0.011 + phase);
                Vec3::new(wave + noise(), 0.5 * wave + noise(), noise())
            };
            (0..count).map(step).collect()
        };
        vec![field(vertex_count, 0.0), field(half, 0.2), field(vertex_count, 2.0)]
    }

    #[test]
    fn points_stay_within_their_balls_and_take_fewer_bytes_than_the_nearest() {
        let (mesh, moved) = sheet(40);
        let (count, half) = (mesh.positions_m.len(), moved[0].0);
        let wanted = fields(count, half);
        let lower = Lower::new(count, &[], &mesh.triangles);
        let bytes = |steps: &[Vec<[i16; 3]>]| {
            let steps: Vec<&[[i16; 3]]> = steps.iter().map(Vec::as_slice).collect();
            let mut to = Writer::default();
            super::super::write(&steps, &moved, &lower, &mesh.positions_m, &mut to);
            to.bytes.len()
        };
        let nearest = |wanted: &Vec<Vec3>| wanted.iter().map(|s| s.round().to_array().map(|s| s as i16)).collect();
        let nearest: Vec<Vec<[i16; 3]>> = wanted.iter().map(nearest).collect();
        for radius in [0.867, 1.5] {
            let chosen = quantise(&mesh, &moved, &wanted, radius);
            for (steps, wanted) in chosen.iter().zip(&wanted) {
                assert_eq!(steps.len(), wanted.len());
                for (step, wanted) in steps.iter().zip(wanted) {
                    let off = Vec3::from_array(step.map(f32::from)).distance(*wanted);
                    assert!(off <= radius * 1.0001, "{off} of {radius}");
                }
            }
            let share = bytes(&chosen) as f32 / bytes(&nearest) as f32;
            // By its own difference alone each point would bring 0.90 and 0.84.
            let most = if radius < 1.0 { 0.88 } else { 0.835 };
            assert!(share < most, "with a radius of {radius} the points take {share} of the nearest ones' bytes");
        }
    }

    #[test]
    fn what_lies_at_the_end_of_the_numbers_stays_within_them() {
        let (mesh, _) = sheet(4);
        let end = Vec3::new(32766.9, -32766.9, 32767.0);
        let chosen = quantise(&mesh, &[(16, vec![0])], &[vec![end; 16]], 1.0);
        assert!(chosen[0].iter().flatten().all(|&step| step.unsigned_abs() >= 32766), "{chosen:?}");
    }
}
