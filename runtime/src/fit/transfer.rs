//! A fitted shape as a garment that moves: pose targets made on one body serve the kimono of another (P1 meets P0). Knows no measurements and
//! no weights.
//!
//! Deformation transfer (Sumner and Popović 2004): a target turns and bends every triangle of the base; the fitted triangles are turned and
//! bent in the same way, and one Poisson system finds the vertices that agree best. Displacements that were merely carried over, scaled or
//! turned vertex by vertex, stretch sleeves that are wider or longer than the base's two to four times as much.

use super::FitData;
use crate::arrays::{GarmentData, InvalidGarment, check_length};
use crate::envelope_cholesky::FactorError;
use crate::garment::Garment;
use crate::skeleton::{Joint, Skeleton};
use crate::sparse_cholesky::SparseCholesky;
use glam::{DVec3, Mat3, Vec3};

/// A vertex that no target moves.
const FIXED: u32 = u32::MAX;
/// How strongly targets are held where they were, as a share of each vertex's stiffness: settles pieces that hang on nothing.
const HOLD: f64 = 1e-6;
/// Targets that are solved for at once, in one sweep over the factor.
const TOGETHER: usize = 8;
/// Their coordinates.
const COLUMNS: usize = 3 * TOGETHER;
/// A sine of a corner below which its triangle has no usable shape.
const LEAST_SINE: f32 = 1e-6;

/// What the transfer needs of a garment; made once, serves any number of wearers.
#[derive(Clone, Debug)]
pub struct Transfer {
    /// Per unique vertex its unknown, or [`FIXED`].
    unknown_of: Vec<u32>,
    unknowns: usize,
    /// Those with a corner that is not fixed.
    triangles: Vec<Triangle>,
    /// How strongly each unknown is held.
    hold: Vec<f64>,
    factor: SparseCholesky,
}

/// Working memory for the targets that are solved for at once.
struct Block {
    /// Per unique vertex.
    deltas_m: Vec<[Vec3; TOGETHER]>,
    /// Right-hand sides, then solutions, per unknown.
    wanted: Vec<[f64; COLUMNS]>,
    scratch: Vec<[f64; COLUMNS]>,
}

#[derive(Clone, Copy, Debug)]
struct Triangle {
    corners: [u32; 3],
    /// Half the cotangent at each corner of the base.
    half_cotangents: [f32; 3],
    /// Inverse of two edges and the normal of the base.
    inverse_frame: Mat3,
}

impl Transfer {
    /// Prepares the transfer of a garment's targets.
    ///
    /// # Errors
    /// When the cloth that targets move is too entangled for the solver.
    pub fn new(garment: &Garment) -> Result<Transfer, FactorError> {
        let data = garment.data();
        let base_m = &data.mesh.positions_m;
        let mut is_moved = Vec::with_capacity(garment.unique_count());
        for segment in &data.segments {
            is_moved.extend(std::iter::repeat_n(!segment.drivers.is_empty(), segment.vertex_count as usize));
        }
        let unique = |v: u32| data.mesh.unique(v);
        let triangles = data.mesh.triangles.iter().map(|corners| corners.map(unique));
        let triangles: Vec<Triangle> = triangles
            .filter(|corners| corners.iter().any(|&v| is_moved[v as usize]))
            .filter_map(|corners| Triangle::new(corners, base_m))
            .collect();

        let mut unknown_of = vec![FIXED; base_m.len()];
        let mut unknowns = 0;
        for &v in triangles.iter().flat_map(|triangle| &triangle.corners) {
            if is_moved[v as usize] && unknown_of[v as usize] == FIXED {
                unknown_of[v as usize] = unknowns;
                unknowns += 1;
            }
        }
        let mut entries = Vec::with_capacity(9 * triangles.len());
        let mut hold = vec![0.0; unknowns as usize];
        for (from, to, weight) in triangles.iter().flat_map(Triangle::sides) {
            let [a, b] = [from, to].map(|v| unknown_of[v as usize]);
            for unknown in [a, b].into_iter().filter(|unknown| *unknown != FIXED) {
                entries.push((unknown, unknown, weight));
                hold[unknown as usize] += HOLD * weight.abs();
            }
            if a != FIXED && b != FIXED {
                entries.push((a, b, -weight));
            }
        }
        entries.extend(hold.iter().zip(0..).map(|(&hold, unknown)| (unknown, unknown, hold)));
        let unknowns = unknowns as usize;
        Ok(Transfer { factor: SparseCholesky::new(unknowns, &entries)?, unknown_of, unknowns, triangles, hold })
    }

    /// The garment as `positions_m` (one per unique vertex, T-pose, metres) fits it, worn by a body whose joints rest at `joints_m` (one
    /// per joint of its skeleton). The garment must be that of [`Transfer::new`].
    ///
    /// Base and skeleton are the wearer's, and every target is transferred. Blending stays as it is, since it compares only rotations; the
    /// certificate, which speaks of the base, is left out.
    ///
    /// # Errors
    /// When there are too many or too few positions or joints, or when some are out of bounds.
    pub fn tailored(
        &self,
        garment: &Garment,
        positions_m: &[Vec3],
        joints_m: &[Vec3],
    ) -> Result<Garment, InvalidGarment> {
        let data = garment.data();
        let joints = data.skeleton.joints();
        check_length("fitted positions", positions_m.len(), self.unknown_of.len())?;
        check_length("joints of the wearer", joints_m.len(), joints.len())?;
        check_length("unique vertices", garment.unique_count(), self.unknown_of.len())?;
        let joints = joints.iter().zip(joints_m).map(|(joint, &rest_m)| Joint { rest_m, ..*joint }).collect();
        let hanging = data.skeleton.hanging().to_vec();
        let skeleton = Skeleton::new(joints).and_then(|skeleton| skeleton.with_hanging(hanging));
        let skeleton = skeleton.map_err(InvalidGarment::Skeleton)?;
        let mut data = GarmentData { skeleton, certificate: None, compression: None, ..data.clone() };
        let mut block = Block::new(positions_m.len(), self.unknowns);
        for targets in data.targets.chunks_mut(TOGETHER) {
            block.deltas_m.fill([Vec3::ZERO; TOGETHER]);
            for (at, target) in targets.iter().enumerate() {
                for (v, delta) in target.vertices(&data.segments).zip(&target.deltas) {
                    block.deltas_m[v][at] = Vec3::from_array(delta.map(f32::from)) * target.step_m;
                }
            }
            self.transfer(&data.mesh.positions_m, positions_m, &mut block);
            for (at, target) in targets.iter_mut().enumerate() {
                let delta_m = |v: usize| block.deltas_m[v][at];
                let largest_m =
                    target.vertices(&data.segments).fold(0.0, |most: f32, v| most.max(delta_m(v).abs().max_element()));
                // Where steps no longer fit into 16 bits they become coarser.
                let step_m = target.step_m.max(largest_m / f32::from(i16::MAX));
                let steps = |v: usize| (delta_m(v) / step_m).round().to_array().map(|step| step as i16);
                target.deltas = target.vertices(&data.segments).map(steps).collect();
                target.step_m = step_m;
            }
        }
        data.mesh.positions_m.copy_from_slice(positions_m);
        Garment::new(data)
    }

    /// Turns deltas from the base into deltas from the fitted shape.
    fn transfer(&self, base_m: &[Vec3], fitted_m: &[Vec3], block: &mut Block) {
        let Block { deltas_m, wanted, scratch } = block;
        wanted.fill([0.0; COLUMNS]);
        for triangle in &self.triangles {
            let [base, fitted] = [base_m, fitted_m].map(|places_m| triangle.corners.map(|v| places_m[v as usize]));
            let deltas = triangle.corners.map(|v| &deltas_m[v as usize]);
            let sides = [fitted[1] - fitted[0], fitted[2] - fitted[0]];
            // The fitted sides as the base's frame sees them: every target's frame takes them along.
            let seen = sides.map(|side| triangle.inverse_frame * side);
            let [at_a, at_b, at_c] = triangle.half_cotangents;
            for target in 0..TOGETHER {
                let moved = deltas.map(|deltas| deltas[target]);
                if moved == [Vec3::ZERO; 3] {
                    continue;
                }
                let Some(frame) = frame([base[0] + moved[0], base[1] + moved[1], base[2] + moved[2]]) else { continue };
                let [ab, ac] = [frame * seen[0] - sides[0], frame * seen[1] - sides[1]];
                let (bc, ca, ab) = (at_a * (ab - ac), at_b * ac, at_c * ab);
                for (v, pull) in triangle.corners.into_iter().zip([-ca - ab, ab + bc, ca - bc]) {
                    let unknown = self.unknown_of[v as usize];
                    if unknown != FIXED {
                        add(&mut wanted[unknown as usize], target, pull.as_dvec3());
                    }
                }
            }
        }
        for (&unknown, deltas_m) in self.unknown_of.iter().zip(&*deltas_m).filter(|(unknown, _)| **unknown != FIXED) {
            for (target, delta_m) in deltas_m.iter().enumerate() {
                add(&mut wanted[unknown as usize], target, self.hold[unknown as usize] * delta_m.as_dvec3());
            }
        }
        self.factor.solve(wanted, scratch);
        for (&unknown, deltas_m) in self.unknown_of.iter().zip(deltas_m).filter(|(unknown, _)| **unknown != FIXED) {
            for (delta_m, solved_m) in deltas_m.iter_mut().zip(wanted[unknown as usize].chunks_exact(3)) {
                *delta_m = DVec3::from_slice(solved_m).as_vec3();
            }
        }
    }
}

impl Block {
    fn new(vertices: usize, unknowns: usize) -> Block {
        let rows = vec![[0.0; COLUMNS]; unknowns];
        Block { deltas_m: vec![[Vec3::ZERO; TOGETHER]; vertices], wanted: rows.clone(), scratch: rows }
    }
}

/// Adds to the columns of one target.
fn add(row: &mut [f64; COLUMNS], target: usize, summand: DVec3) {
    for (sum, summand) in row[3 * target..][..3].iter_mut().zip(summand.to_array()) {
        *sum += summand;
    }
}

impl Triangle {
    /// `None` when it has no usable shape.
    fn new(corners: [u32; 3], base_m: &[Vec3]) -> Option<Triangle> {
        let places = corners.map(|v| base_m[v as usize]);
        let half_cotangent = |corner: usize| {
            let (a, b) = (places[(corner + 1) % 3] - places[corner], places[(corner + 2) % 3] - places[corner]);
            let twice_area = a.cross(b).length();
            (twice_area > LEAST_SINE * a.length() * b.length()).then(|| 0.5 * a.dot(b) / twice_area)
        };
        let half_cotangents = [half_cotangent(0)?, half_cotangent(1)?, half_cotangent(2)?];
        Some(Triangle { corners, half_cotangents, inverse_frame: frame(places)?.inverse() })
    }

    /// Each side with its share of the stiffness.
    fn sides(&self) -> [(u32, u32, f64); 3] {
        let ([a, b, c], [at_a, at_b, at_c]) = (self.corners, self.half_cotangents.map(f64::from));
        [(b, c, at_a), (c, a, at_b), (a, b, at_c)]
    }
}

/// Two edges and the unit normal; `None` without area.
fn frame([a, b, c]: [Vec3; 3]) -> Option<Mat3> {
    let normal = (b - a).cross(c - a).try_normalize()?;
    Some(Mat3::from_cols(b - a, c - a, normal))
}

impl FitData {
    /// The joints of a wearer who is like the bodies with these weights, metres.
    ///
    /// # Panics
    /// When there are not as many weights as bodies.
    #[must_use]
    pub fn joints_m(&self, weights: &[f32]) -> Vec<Vec3> {
        assert_eq!(weights.len(), self.bodies.len(), "one weight per body");
        let joint =
            |joint: usize| self.bodies.iter().zip(weights).map(|(body, weight)| body.joints_m[joint] * *weight).sum();
        (0..self.bodies.first().map_or(0, |body| body.joints_m.len())).map(joint).collect()
    }
}
