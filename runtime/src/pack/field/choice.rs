//! Which whole points stand for a field: each lies within a ball around what is wanted, and of the points within it the one
//! is taken that lets all fields together take the fewest bytes. Knows how fields are predicted, not how differences are
//! coded.
//!
//! A ball holds two or three points. Which of them is nearest to its own prediction is easily said; but the vertices and
//! fields that are predicted from it then go by it, so that its error lives on in theirs. The points are therefore chosen
//! again, in several sweeps over the cloth, each as its own difference and all those that hang on it would have it
//! (iterated conditional modes, Besag 1986).

use super::encode::{references, rows};
use super::*;
use crate::arrays::{Mesh, Segment};

/// Choices of what predicts a patch, each from the points that the one before led to.
const ROUNDS: usize = 2;
/// Sweeps after each: the third changes one point in a hundred.
const SWEEPS: usize = 3;

/// A field that is to be stored, as long as the segments that it moves.
#[derive(Clone, Debug)]
pub struct Wanted {
    /// The segments, ascending.
    pub segments: Vec<u16>,
    /// x, y, z per vertex of those segments, in steps, not yet whole.
    pub steps: Vec<Vec3>,
}

/// Whole steps within `radius` steps of what is wanted, such that the fields take few bytes. Every ball must hold a whole
/// point: the radius is √3/2 or more.
///
/// # Panics
/// When the mesh, the segments and the fields do not fit each other, or steps lie outside 16 bits.
#[must_use]
pub fn quantise(mesh: &Mesh, segments: &[Segment], wanted: &[Wanted], radius: f32) -> Vec<Vec<[i16; 3]>> {
    let lower = Lower::new(mesh.positions_m.len(), &mesh.twin_of, &mesh.triangles);
    let moves = |segment: usize, field: u16| wanted[usize::from(field)].segments.contains(&(segment as u16));
    let moved = |(number, segment): (usize, &Segment)| {
        (segment.vertex_count as usize, (0..wanted.len() as u16).filter(|&field| moves(number, field)).collect())
    };
    let segments: Vec<(usize, Vec<u16>)> = segments.iter().enumerate().map(moved).collect();
    let centers: Vec<Vec<[f32; 3]>> =
        wanted.iter().map(|wanted| wanted.steps.iter().map(|steps| steps.to_array()).collect()).collect();
    let centers: Vec<&[[f32; 3]]> = centers.iter().map(Vec::as_slice).collect();
    let centers = rows(&centers, &segments);
    let stencils: Vec<Stencil> =
        (0..mesh.positions_m.len()).map(|v| Stencil::new(v as u32, &lower, &mesh.positions_m)).collect();

    let mut chosen: Vec<[f32; 4]> = centers.iter().map(|values| values.map(f32::round)).collect();
    for round in 0..ROUNDS {
        let references = references(&chosen, wanted.len(), &segments, &lower, &mesh.positions_m);
        let mut choice = Choice::new(&centers, chosen, radius, &stencils, quads(wanted.len()));
        choice.hang(&segments, &references, wanted.len());
        if round == 0 {
            choice.sweep(&segments, false);
        }
        for _ in 0..SWEEPS {
            choice.sweep(&segments, true);
        }
        chosen = choice.chosen;
    }
    let mut steps = vec![Vec::new(); wanted.len()];
    for patch in patches(&segments) {
        append(&patch, &chosen, quads(wanted.len()), &mut steps);
    }
    steps
}

/// The points chosen so far, and what hangs on them. All arrays of numbers hold the vectors of all fields side by side,
/// vertex after vertex.
struct Choice<'a> {
    centers: &'a [[f32; 4]],
    radius: f32,
    chosen: Vec<[f32; 4]>,
    /// What the prediction along the mesh leaves of them.
    left: Vec<[f32; 4]>,
    /// Numbers of a vertex.
    width: usize,
    /// Per vertex those that are predicted from it, with its weight there.
    dependents: Vec<Vec<(usize, f32)>>,
    /// Per vertex its patch.
    patch_of: Vec<usize>,
    /// Per patch and field how it is predicted there; none where it does not move.
    hanging: Vec<Vec<Option<Hanging>>>,
    /// Differences that change with the point in question, and how much by.
    affected: Vec<(Vec3, f32)>,
}

/// How a field is predicted across fields in a patch.
#[derive(Clone, Default)]
struct Hanging {
    reference: Option<Reference>,
    /// The fields that name it, with the share of it that they add.
    followers: Vec<(usize, f32)>,
}

impl<'a> Choice<'a> {
    fn new(
        centers: &'a [[f32; 4]],
        chosen: Vec<[f32; 4]>,
        radius: f32,
        stencils: &[Stencil],
        quads: usize,
    ) -> Choice<'a> {
        let mut dependents = vec![Vec::new(); stencils.len()];
        let mut left = chosen.clone();
        for (vertex, stencil) in stencils.iter().enumerate() {
            let along = &mut left[vertex * quads..][..quads];
            stencil.predict(&chosen, quads, along);
            let values = chosen[vertex * quads..].as_flattened();
            along.as_flattened_mut().iter_mut().zip(values).for_each(|(left, value)| *left = value - *left);
            for (&before, &weight) in stencil.vertices.iter().zip(&stencil.weights).take(stencil.count) {
                dependents[before as usize].push((vertex, weight));
            }
        }
        let (patch_of, hanging) = (vec![0; stencils.len()], Vec::new());
        Choice { centers, radius, chosen, left, width: 4 * quads, dependents, patch_of, hanging, affected: Vec::new() }
    }

    /// Notes how fields are predicted from each other.
    fn hang(&mut self, segments: &[(usize, Vec<u16>)], references: &[Vec<u32>], field_count: usize) {
        for (patch, references) in patches(segments).zip(references) {
            self.patch_of[patch.vertices.clone()].fill(self.hanging.len());
            let mut hanging = vec![None; field_count];
            for (&field, &number) in patch.fields.iter().zip(references) {
                let reference = Reference::from_number(number);
                hanging[usize::from(field)] = Some(Hanging { reference, followers: Vec::new() });
                // An earlier field of the patch, so it stands there already.
                if let Some(Reference { field: other, share }) = reference {
                    let other = hanging[other].get_or_insert_default();
                    other.followers.push((usize::from(field), share));
                }
            }
            self.hanging.push(hanging);
        }
    }

    /// Chooses every point once; by its own difference alone where nothing follows what is chosen yet.
    fn sweep(&mut self, segments: &[(usize, Vec<u16>)], heeds_others: bool) {
        for patch in patches(segments) {
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
        let mut affected = std::mem::take(&mut self.affected);
        affected.clear();
        affected.extend(self.difference(vertex, field).map(|difference| (difference, 1.0)));
        if heeds_others {
            self.hang_on(vertex, field, 1.0, &mut affected);
            for &(dependent, weight) in &self.dependents[vertex] {
                affected.extend(self.difference(dependent, field).map(|difference| (difference, -weight)));
                self.hang_on(dependent, field, -weight, &mut affected);
            }
        }
        let bits = |point: Vec3| -> f32 {
            let change = point - now;
            affected.iter().map(|(difference, share)| bits(*difference + change * *share)).sum()
        };
        let (mut best, mut least) = (now, bits(now));
        let (low, high) = ((center - self.radius).ceil(), (center + self.radius).floor());
        let whole = |i: usize| low[i] as i32..=high[i] as i32;
        for (x, y, z) in whole(0).flat_map(|x| whole(1).flat_map(move |y| whole(2).map(move |z| (x, y, z)))) {
            let point = Vec3::new(x as f32, y as f32, z as f32);
            let is_allowed = point.distance_squared(center) <= self.radius * self.radius;
            let is_stored = point.abs().max_element() <= f32::from(i16::MAX);
            if is_allowed && is_stored && point != now {
                let bits = bits(point);
                if bits < least {
                    (best, least) = (point, bits);
                }
            }
        }
        self.affected = affected;
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

    /// The differences at a vertex of the fields that add a share of this one's, of which `share` changes.
    fn hang_on(&self, vertex: usize, field: usize, share: f32, affected: &mut Vec<(Vec3, f32)>) {
        let hanging = self.hanging[self.patch_of[vertex]][field].iter();
        for &(follower, of_it) in hanging.flat_map(|hanging| &hanging.followers) {
            affected.extend(self.difference(vertex, follower).map(|difference| (difference, -share * of_it)));
        }
    }

    /// What would be stored of a field at a vertex, were it not rounded; none where it does not move.
    fn difference(&self, vertex: usize, field: usize) -> Option<Vec3> {
        let left = |field: usize| Vec3::from_slice(&self.left.as_flattened()[vertex * self.width + 3 * field..]);
        let hanging = self.hanging.get(self.patch_of[vertex])?[field].as_ref()?;
        let across = hanging.reference.map_or(Vec3::ZERO, |Reference { field, share }| left(field) * share);
        Some(left(field) - across)
    }
}

/// About what three differences take: the logarithm to base two of 1 and each, straight between powers of two, as the
/// bits of floating-point numbers have it.
fn bits(difference: Vec3) -> f32 {
    let bits = |difference: f32| (1.0 + difference.abs()).to_bits() as f32 / (1 << 23) as f32;
    bits(difference.x) + bits(difference.y) + bits(difference.z)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::pack::codec::Writer;

    /// A sheet of `side` times `side` vertices in two segments, of which only the first moves with every field.
    fn sheet(side: u32) -> (Mesh, Vec<Segment>) {
        let place = |v: u32| Vec3::new((v % side) as f32, (v / side) as f32, 0.0) * 0.01;
        let corner = |v: u32| [[v, v + 1, v + side], [v + 1, v + side + 1, v + side]];
        let cells = (0..side * (side - 1)).filter(|v| v % side + 1 < side);
        let mesh = Mesh {
            positions_m: (0..side * side).map(place).collect(),
            triangles: cells.flat_map(corner).collect(),
            ..Mesh::default()
        };
        let half = side * side / 2;
        let segment = |vertex_count: u32| Segment { vertex_count, drivers: vec![0], masks: Vec::new() };
        (mesh, vec![segment(half), segment(side * side - half)])
    }

    /// Waves with noise of half a step, the second field like the first.
    fn fields(vertex_count: usize, half: usize) -> Vec<Wanted> {
        let mut state = 7u32;
        let mut noise = || {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            (state >> 8) as f32 / (1 << 24) as f32 - 0.5
        };
        let mut field = |segments: Vec<u16>, count: usize, phase: f32| {
            let step = |v: usize| {
                let wave = 40.0 * libm::sinf(v as f32 * 0.011 + phase);
                Vec3::new(wave + noise(), 0.5 * wave + noise(), noise())
            };
            let steps = (0..count).map(step).collect();
            Wanted { segments, steps }
        };
        vec![field(vec![0, 1], vertex_count, 0.0), field(vec![0], half, 0.2), field(vec![0, 1], vertex_count, 2.0)]
    }

    #[test]
    fn points_stay_within_their_balls_and_take_fewer_bytes_than_the_nearest() {
        let (mesh, segments) = sheet(40);
        let (count, half) = (mesh.positions_m.len(), segments[0].vertex_count as usize);
        let wanted = fields(count, half);
        let moved = [(half, vec![0, 1, 2]), (count - half, vec![0, 2])];
        let lower = Lower::new(count, &[], &mesh.triangles);
        let bytes = |steps: &[Vec<[i16; 3]>]| {
            let steps: Vec<&[[i16; 3]]> = steps.iter().map(Vec::as_slice).collect();
            let mut to = Writer::default();
            super::super::write(&steps, &moved, &lower, &mesh.positions_m, &mut to);
            to.bytes.len()
        };
        let nearest = |wanted: &Wanted| wanted.steps.iter().map(|s| s.round().to_array().map(|s| s as i16)).collect();
        let nearest: Vec<Vec<[i16; 3]>> = wanted.iter().map(nearest).collect();
        for radius in [0.867, 1.5] {
            let chosen = quantise(&mesh, &segments, &wanted, radius);
            for (steps, wanted) in chosen.iter().zip(&wanted) {
                assert_eq!(steps.len(), wanted.steps.len());
                for (step, wanted) in steps.iter().zip(&wanted.steps) {
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
        let (mesh, segments) = sheet(4);
        let end = Vec3::new(32766.9, -32766.9, 32767.0);
        let wanted = Wanted { segments: vec![0, 1], steps: vec![end; 16] };
        let chosen = quantise(&mesh, &segments, &[wanted], 1.0);
        assert!(chosen[0].iter().flatten().all(|&step| step.unsigned_abs() >= 32766), "{chosen:?}");
    }
}
