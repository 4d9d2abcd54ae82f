//! What a kimono lets its wearer do: poses beyond what its samples reach are brought back, smoothly and without memory, before
//! anything is evaluated. Knows rotations only, no vertex.
//!
//! A joint's rotation is its rotation vector, three angles about x, y and z; the angles of all joints that a limit names are
//! one point. The samples' points span a polytope, which the pipeline found and whose *bounds* the garment holds
//! ([`PoseLimit`]). Inside it a pose stays as it is. Outside the cloth pushes back: a bound that is exceeded by e pushes with
//! e² / (m - e), m the margin, against a wearer who pulls with the distance from the pose she wants. The pose comes to rest
//! where both are equal, at the minimum of the strictly convex
//!
//! ```text
//! F(y) = ½ |y - x|² + Σ φ(e_i(y)),   φ'(e) = e² / (m - e) above 0, 0 below
//! ```
//!
//! the proximal map of the bounds: a function of the pose alone that never moves two poses apart, has no corner (φ is twice
//! continuously differentiable) but at half a turn of a joint, where a rotation comes from the other side, and never exceeds a bound by the margin. Alone, a bound lets m·e / (m + e) pass.

use crate::arrays::{PoseBound, PoseLimit, limits};
use crate::skeleton::{Bone, Pose, angle_between_rad};
use glam::{Quat, Vec3};
use std::f32::consts::PI;

/// Most angles of a limit.
const ANGLES: usize = 3 * limits::LIMIT_JOINTS;
/// Newton's method needs about ten steps; more are a bug in the bounds, and the pose of then is good enough.
const STEPS: usize = 60;
/// Rest, radians.
const REST: f64 = 1e-9;

/// A pose as the kimono allows it.
#[derive(Clone, Debug, PartialEq)]
pub struct Limited {
    /// The pose; the one that was given, bit for bit, where it exceeds nothing.
    pub pose: Pose,
    /// The farthest that any joint was turned back, radians.
    pub turned_rad: f32,
}

/// The pose with every limit met. Limits must be checked, rotations finite and of length 1 ([`Pose::sanitised`]).
#[must_use]
pub fn limited(pose_limits: &[PoseLimit], pose: &Pose) -> Limited {
    let mut limited = Limited { pose: pose.clone(), turned_rad: 0.0 };
    for limit in pose_limits {
        let mut wanted = [0.0; ANGLES];
        let wanted = &mut wanted[..3 * limit.bones.len()];
        angles(&limit.bones, pose, wanted);
        if limit.bounds.iter().all(|bound| dot(&bound.normal, wanted) <= f64::from(bound.most_rad)) {
            continue;
        }
        let mut found = [0.0; ANGLES];
        let found = &mut found[..wanted.len()];
        come_to_rest(limit, wanted, found);
        for (&bone, angles) in limit.bones.iter().zip(found.as_chunks::<3>().0) {
            let turned = rotation(Vec3::from_array(angles.map(|angle| angle as f32)));
            limited.turned_rad = limited.turned_rad.max(angle_between_rad(pose.rotation(bone), turned));
            limited.pose.rotations[bone as usize] = turned;
        }
    }
    limited
}

/// The rotation vectors of these bones, one after the other: axis times angle, the angle from 0 to π.
///
/// # Panics
/// When `angles` has not three places per bone.
pub fn angles(bones: &[Bone], pose: &Pose, angles: &mut [f64]) {
    assert_eq!(angles.len(), 3 * bones.len(), "three angles per bone");
    for (&bone, angles) in bones.iter().zip(angles.as_chunks_mut::<3>().0) {
        *angles = rotation_vector(pose.rotation(bone)).to_array().map(f64::from);
    }
}

fn dot(normal: &[f32], angles: &[f64]) -> f64 {
    normal.iter().zip(angles).map(|(&a, b)| f64::from(a) * b).sum()
}

/// Newton's method with the step halved until the way is still downhill at its end.
fn come_to_rest(limit: &PoseLimit, wanted: &[f64], found: &mut [f64]) {
    let count = wanted.len();
    let margin = f64::from(limit.margin_rad);
    let excess = |bound: &PoseBound, at: &[f64]| dot(&bound.normal, at) - f64::from(bound.most_rad);
    // From the T-pose, which exceeds nothing, toward the pose until a bound has had half its margin.
    let share = |bound: &PoseBound| {
        let (along, most) = (dot(&bound.normal, wanted), f64::from(bound.most_rad) + 0.5 * margin);
        if along > most { most / along } else { 1.0 }
    };
    let share = limit.bounds.iter().map(share).fold(1.0, f64::min);
    found.iter_mut().zip(wanted).for_each(|(found, wanted)| *found = share * wanted);

    let mut slope = [0.0; ANGLES];
    let mut system = [0.0; ANGLES * ANGLES];
    for _ in 0..STEPS {
        for i in 0..count {
            slope[i] = found[i] - wanted[i];
            system[i * count..(i + 1) * count].fill(0.0);
            system[i * count + i] = 1.0;
        }
        for bound in &limit.bounds {
            let e = excess(bound, found);
            if e > 0.0 {
                let left = margin - e;
                let (push, stiffness) = (e * e / left, e * (2.0 * margin - e) / (left * left));
                for i in 0..count {
                    let n = f64::from(bound.normal[i]);
                    slope[i] += push * n;
                    for j in 0..=i {
                        system[i * count + j] += stiffness * n * f64::from(bound.normal[j]);
                    }
                }
            }
        }
        let mut step = slope;
        solve(&mut system[..count * count], &mut step[..count]);
        let downhill: f64 = step.iter().zip(&slope).map(|(step, slope)| step * slope).sum();
        let length = step[..count].iter().map(|x| x * x).sum::<f64>().sqrt();
        let mut at = [0.0; ANGLES];
        let mut part = 1.0;
        loop {
            at.iter_mut().zip(found.iter().zip(&step)).for_each(|(at, (found, step))| *at = found - part * step);
            let mut still: f64 = (0..count).map(|i| (at[i] - wanted[i]) * step[i]).sum();
            let mut is_within = true;
            for bound in &limit.bounds {
                let e = excess(bound, &at[..count]);
                is_within &= e < margin;
                if e > 0.0 && e < margin {
                    still += e * e / (margin - e) * dot(&bound.normal, &step[..count]);
                }
            }
            if is_within && still >= -0.5 * downhill || part < 1e-6 {
                break;
            }
            part *= 0.5;
        }
        if part < 1e-6 {
            return;
        }
        found.copy_from_slice(&at[..count]);
        if part * length < REST {
            return;
        }
    }
}

/// Solves a symmetric positive definite system, of which the lower half is given and overwritten, by Cholesky's method.
fn solve(system: &mut [f64], x: &mut [f64]) {
    let n = x.len();
    for i in 0..n {
        for j in 0..=i {
            let known: f64 = (0..j).map(|k| system[i * n + k] * system[j * n + k]).sum();
            let left = system[i * n + j] - known;
            // The system is the identity plus squares, so its pivots are 1 or more.
            system[i * n + j] = if i == j { left.max(1e-300).sqrt() } else { left / system[j * n + j] };
        }
    }
    for i in 0..n {
        let known: f64 = (0..i).map(|k| system[i * n + k] * x[k]).sum();
        x[i] = (x[i] - known) / system[i * n + i];
    }
    for i in (0..n).rev() {
        let known: f64 = (i + 1..n).map(|k| system[k * n + i] * x[k]).sum();
        x[i] = (x[i] - known) / system[i * n + i];
    }
}

fn rotation_vector(q: Quat) -> Vec3 {
    let q = if q.w < 0.0 { -q } else { q };
    let sine = q.xyz().length();
    // Near 0 the angle is twice the sine.
    let per_sine = if sine > 1e-6 { 2.0 * libm::atan2f(sine, q.w) / sine } else { 2.0 };
    q.xyz() * per_sine
}

fn rotation(vector: Vec3) -> Quat {
    let angle = vector.length().min(PI);
    if angle < 1e-6 {
        return Quat::from_xyzw(0.5 * vector.x, 0.5 * vector.y, 0.5 * vector.z, 1.0);
    }
    let xyz = vector * (libm::sinf(0.5 * angle) / vector.length());
    Quat::from_xyzw(xyz.x, xyz.y, xyz.z, libm::cosf(0.5 * angle))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rotation_vectors_come_back() {
        for angle in [0.0, 1e-7, 1e-3, 1.0, 3.0, 3.1] {
            let q = Quat::from_axis_angle(Vec3::new(0.6, -0.8, 0.0), angle);
            for q in [q, -q] {
                assert!(angle_between_rad(rotation(rotation_vector(q)), q) < 1e-6, "{angle}");
            }
        }
    }

    /// One bound, whose rest is known in closed form.
    #[test]
    fn a_bound_alone_lets_the_known_share_pass() {
        let bound = PoseBound { normal: vec![0.6, 0.0, 0.8], most_rad: 0.2 };
        let limit = PoseLimit { bones: vec![Bone::LeftUpperLeg], margin_rad: 0.1, bounds: vec![bound] };
        for beyond in [1e-4, 0.03, 0.5, 2.0] {
            let wanted = [0.6 * (0.2 + beyond), 0.3, 0.8 * (0.2 + beyond)];
            let mut found = [0.0; 3];
            come_to_rest(&limit, &wanted, &mut found);
            let passed = 0.6 * found[0] + 0.8 * found[2] - 0.2;
            let expected = 0.1 * beyond / (0.1 + beyond);
            assert!((passed - expected).abs() < 1e-6, "{beyond}: {passed} for {expected}");
            assert!((found[1] - 0.3).abs() < 1e-9, "along the bound nothing changes");
        }
    }
}
