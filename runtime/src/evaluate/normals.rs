//! Normals of posed cloth: for every vertex the mean of its triangles' normals, weighted by area. Knows positions and
//! triangles only; the order in which triangles are taken stands in [`Strips`].

use crate::plan::{LANES, Strip, Strips};
use glam::{Vec3, Vec3A};
use pulp::{Simd, WithSimd};
use std::mem::size_of_val;

/// What one corner of each quad gets, as x, y and z. It begins with a 0, so that what quad k gives to its second vertex
/// stands beside what quad k + 1 gives to its first.
type Moves = [[f32; LANES + 1]; 3];

/// Working memory.
#[derive(Clone, Debug, Default)]
pub(crate) struct Work {
    positions_m: Planes,
    sums: Planes,
    corners: Vec<Corner>,
}

/// One array per coordinate, with a block to spare at the end.
#[derive(Clone, Debug, Default)]
struct Planes([Vec<f32>; 3]);

/// A loose triangle's vertex with the sum of its normals; side by side because a triangle needs both.
#[derive(Clone, Copy, Debug, Default)]
struct Corner {
    position_m: Vec3A,
    normal: Vec3A,
}

impl Work {
    /// For this plan and as many vertices as it was made for.
    pub(crate) fn new(vertex_count: usize, plan: &Strips) -> Work {
        let planes = Planes([(); 3].map(|()| vec![0.0; vertex_count.next_multiple_of(LANES) + LANES]));
        let corners = vec![Corner::default(); plan.loose_vertices.len()];
        Work { positions_m: planes.clone(), sums: planes, corners }
    }

    /// How many bytes a frame reads and writes.
    pub(crate) fn bytes(&self) -> usize {
        let planes = |planes: &Planes| size_of_val(planes.0[0].as_slice()) * 3;
        planes(&self.positions_m) + planes(&self.sums) + size_of_val(self.corners.as_slice())
    }
}

/// Writes the unit normals of these positions; +Y where the sum has no direction.
pub(super) struct Normals<'a> {
    pub(super) plan: &'a Strips,
    pub(super) positions_m: &'a [Vec3],
    pub(super) work: &'a mut Work,
    pub(super) normals: &'a mut [Vec3],
}

impl WithSimd for Normals<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let Normals { plan, positions_m, work: Work { positions_m: planes, sums, corners }, normals } = self;
        planes.read(positions_m);
        sums.0.iter_mut().for_each(|sums| sums.fill(0.0));

        for strip in &plan.strips {
            add_strip(simd, strip, planes, sums);
        }
        add_loose(plan, positions_m, corners);
        let [x, y, z] = &mut sums.0;
        for (corner, &vertex) in corners.iter().zip(&plan.loose_vertices) {
            let vertex = vertex as usize;
            x[vertex] += corner.normal.x;
            y[vertex] += corner.normal.y;
            z[vertex] += corner.normal.z;
        }
        for (((normal, &x), &y), &z) in normals.iter_mut().zip(&*x).zip(&*y).zip(&*z) {
            let length = (x * x + y * y + z * z).sqrt();
            let has_direction = length > 0.0 && length < f32::INFINITY;
            let per_length = 1.0 / length;
            let unit = Vec3::new(x * per_length, y * per_length, z * per_length);
            *normal = if has_direction { unit } else { Vec3::Y };
        }
    }
}

/// A vector for each lane.
type Vectors<S> = [<S as Simd>::f32s; 3];

impl Planes {
    #[inline(always)]
    fn read(&mut self, vectors: &[Vec3]) {
        let [x, y, z] = &mut self.0;
        let count = vectors.len();
        let (x, y, z) = (&mut x[..count], &mut y[..count], &mut z[..count]);
        for i in 0..count {
            x[i] = vectors[i].x;
            y[i] = vectors[i].y;
            z[i] = vectors[i].z;
        }
    }

    #[inline(always)]
    fn at<S: Simd>(&self, first: usize) -> Vectors<S> {
        let [x, y, z] = &self.0;
        let lanes = first..first + S::F32_LANES;
        [
            S::as_simd_f32s(&x[lanes.clone()]).0[0],
            S::as_simd_f32s(&y[lanes.clone()]).0[0],
            S::as_simd_f32s(&z[lanes]).0[0],
        ]
    }

    /// Adds to a row of vertices what the quads give to their first vertex in the row and to their second.
    #[inline(always)]
    fn add(&mut self, row: usize, first: &Moves, second: &Moves) {
        for (plane, (first, second)) in self.0.iter_mut().zip(first.iter().zip(second)) {
            let sums = &mut plane[row..row + LANES];
            for (sum, (first, second)) in sums.iter_mut().zip(first[1..].iter().zip(second)) {
                *sum += first + second;
            }
        }
    }
}

/// 1 shifted by each lane's number.
const LANE_BITS: [u32; LANES] = {
    let mut bits = [1; LANES];
    let mut lane = 0;
    while lane < LANES {
        bits[lane] <<= lane;
        lane += 1;
    }
    bits
};

#[inline(always)]
fn add_strip<S: Simd>(simd: S, strip: &Strip, positions_m: &Planes, sums: &mut Planes) {
    let zero = [simd.splat_f32s(0.0); 3];
    // Of a, d, b and c.
    let mut moves: [Moves; 4] = [[[0.0; LANES + 1]; 3]; 4];
    for step in 0..LANES / S::F32_LANES {
        let lane = step * S::F32_LANES;
        let (near, far) = (strip.near as usize + lane, strip.far as usize + lane);
        let (quads, cut_from_a) = (strip.quads >> lane, strip.cut_from_a >> lane);
        if quads == 0 {
            break;
        }
        let (a, b) = (positions_m.at::<S>(near), positions_m.at::<S>(near + 1));
        let (d, c) = (positions_m.at::<S>(far), positions_m.at::<S>(far + 1));
        let (is_quad, is_cut_from_a) = (mask(simd, quads), mask(simd, cut_from_a));
        // The two triangles are a, b, (c or d) and c, d, (a or b).
        let third = select(simd, is_cut_from_a, c, d);
        let first = cross(simd, minus(simd, b, a), minus(simd, third, a));
        let first = select(simd, is_quad, first, zero);
        let third = select(simd, is_cut_from_a, a, b);
        let second = cross(simd, minus(simd, d, c), minus(simd, third, c));
        let second = select(simd, is_quad, second, zero);
        let [fx, fy, fz] = first;
        let [sx, sy, sz] = second;
        let both = [simd.add_f32s(fx, sx), simd.add_f32s(fy, sy), simd.add_f32s(fz, sz)];
        let of_corners = [
            select(simd, is_cut_from_a, both, first),
            select(simd, is_cut_from_a, second, both),
            select(simd, is_cut_from_a, first, both),
            select(simd, is_cut_from_a, both, second),
        ];
        for (moves, of_corner) in moves.iter_mut().zip(of_corners) {
            for (moves, of_corner) in moves.iter_mut().zip(of_corner) {
                S::as_mut_simd_f32s(&mut moves[1..]).0[step] = of_corner;
            }
        }
    }
    let (near, far) = (strip.near as usize, strip.far as usize);
    sums.add(near, &moves[0], &moves[2]);
    sums.add(far, &moves[1], &moves[3]);
}

#[inline(always)]
fn mask<S: Simd>(simd: S, bits: u16) -> S::m32s {
    let lane_bits = S::as_simd_u32s(&LANE_BITS).0[0];
    simd.equal_u32s(simd.and_u32s(simd.splat_u32s(u32::from(bits)), lane_bits), lane_bits)
}

#[inline(always)]
fn select<S: Simd>(simd: S, mask: S::m32s, [ax, ay, az]: Vectors<S>, [bx, by, bz]: Vectors<S>) -> Vectors<S> {
    [simd.select_f32s(mask, ax, bx), simd.select_f32s(mask, ay, by), simd.select_f32s(mask, az, bz)]
}

#[inline(always)]
fn minus<S: Simd>(simd: S, [ax, ay, az]: Vectors<S>, [bx, by, bz]: Vectors<S>) -> Vectors<S> {
    [simd.sub_f32s(ax, bx), simd.sub_f32s(ay, by), simd.sub_f32s(az, bz)]
}

#[inline(always)]
fn cross<S: Simd>(simd: S, [ax, ay, az]: Vectors<S>, [bx, by, bz]: Vectors<S>) -> Vectors<S> {
    [
        simd.sub_f32s(simd.mul_f32s(ay, bz), simd.mul_f32s(az, by)),
        simd.sub_f32s(simd.mul_f32s(az, bx), simd.mul_f32s(ax, bz)),
        simd.sub_f32s(simd.mul_f32s(ax, by), simd.mul_f32s(ay, bx)),
    ]
}

/// Sums the normals of the triangles in no strip.
#[inline(always)]
fn add_loose(plan: &Strips, positions_m: &[Vec3], corners: &mut [Corner]) {
    for (corner, &vertex) in corners.iter_mut().zip(&plan.loose_vertices) {
        *corner = Corner { position_m: positions_m[vertex as usize].into(), normal: Vec3A::ZERO };
    }
    for triangle in &plan.loose {
        let [a, b, c] = triangle.map(|corner| corner as usize);
        let origin = corners[a].position_m;
        let doubled_area = (corners[b].position_m - origin).cross(corners[c].position_m - origin);
        corners[a].normal += doubled_area;
        corners[b].normal += doubled_area;
        corners[c].normal += doubled_area;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plan::FEWEST_QUADS;
    use pulp::{Arch, Scalar};

    /// A bumpy sheet of some quads by two, cut in alternating directions, with a triangle that leaves the order.
    fn sheet(quads: u32) -> (Vec<Vec3>, Vec<[u32; 3]>) {
        let columns = quads + 1;
        let positions_m = (0..3 * columns).map(|v| {
            let (column, row) = ((v % columns) as f32, (v / columns) as f32);
            Vec3::new(column, row, ((7 * v) % 5) as f32 * 0.1)
        });
        let mut triangles = vec![[0, 3 * columns - 1, quads]];
        for (row, column) in (0..2).flat_map(|row| (0..quads).map(move |column| (row, column))) {
            let a = row * columns + column;
            let [b, c, d] = [a + 1, a + 1 + columns, a + columns];
            triangles.extend(if column % 3 == 0 { [[a, b, c], [c, d, a]] } else { [[d, a, b], [b, c, d]] });
        }
        (positions_m.collect(), triangles)
    }

    #[test]
    fn strips_of_any_length_give_what_their_triangles_give_on_any_machine() {
        for quads in 1..40 {
            let (positions_m, triangles) = sheet(quads);
            let plan = Strips::new(positions_m.len(), &triangles);
            let in_strips: u32 = plan.strips.iter().map(|strip| strip.quads.count_ones()).sum();
            assert_eq!(in_strips, if quads as usize >= FEWEST_QUADS { 2 * quads } else { 0 }, "{quads}");
            assert_eq!(plan.loose.len() + 2 * in_strips as usize, triangles.len());

            let mut work = Work::new(positions_m.len(), &plan);
            let mut normals = |run: &dyn Fn(Normals)| {
                let mut normals = vec![Vec3::NAN; positions_m.len()];
                let (plan, positions_m) = (&plan, positions_m.as_slice());
                run(Normals { plan, positions_m, work: &mut work, normals: &mut normals });
                normals
            };
            let found = normals(&|step| Arch::new().dispatch(step));
            assert_eq!(found, normals(&|step| Simd::vectorize(Scalar::new(), step)), "{quads}");

            let mut sums = vec![Vec3::ZERO; positions_m.len()];
            for corners in &triangles {
                let [a, b, c] = corners.map(|v| positions_m[v as usize]);
                corners.iter().for_each(|&v| sums[v as usize] += (b - a).cross(c - a));
            }
            for (vertex, (found, sum)) in found.iter().zip(sums).enumerate() {
                assert!(found.distance(sum.normalize()) < 1e-5, "{quads}, {vertex}: {found} for {sum}");
            }
        }
    }
}
