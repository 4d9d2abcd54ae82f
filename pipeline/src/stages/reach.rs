//! The bounds of what samples reach: the polytope that their poses span, from outside. Knows rotations only.
//!
//! Samples in general position span a polytope of very many faces, most of which nobody ever meets. So bounds are added one by
//! one where poses, thrown at the samples from all sides, still pass the bounds that are there: the bound's normal leads
//! from the nearest place of the polytope to the pose.

use super::numbers::Numbers;
use kitsuke::arrays::{PoseBound, PoseTable, limits};
use kitsuke::reach::angles;
use kitsuke::skeleton::Bone;

/// How closely the bounds enclose the samples.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Settings {
    /// A pose this far from all that the samples span is stopped, radians.
    pub tolerance_rad: f64,
    /// Poses thrown.
    pub poses: u32,
}

impl Default for Settings {
    fn default() -> Settings {
        Settings { tolerance_rad: 1f64.to_radians(), poses: 4000 }
    }
}

/// The bounds of the angles of some bones.
#[must_use]
pub fn bounds(bones: &[Bone], poses: &PoseTable, settings: &Settings) -> Vec<PoseBound> {
    let count = 3 * bones.len();
    let mut samples: Vec<Vec<f64>> = Vec::new();
    for row in 0..poses.rows() {
        let mut sample = vec![0.0; count];
        angles(bones, &poses.pose(row), &mut sample);
        if !samples.contains(&sample) {
            samples.push(sample);
        }
    }
    let mut bounds: Vec<PoseBound> = Vec::new();
    for (angle, sign) in (0..count).flat_map(|angle| [(angle, 1.0), (angle, -1.0)]) {
        let mut normal = vec![0.0; count];
        normal[angle] = sign;
        bounds.push(bound(&normal, &samples));
    }
    let mut numbers = Numbers(1);
    for _ in 0..settings.poses {
        let mut pose = thrown(&samples, &bounds, &mut numbers);
        hold(&mut pose, &bounds);
        let nearest = nearest(&pose, &samples);
        let apart: Vec<f64> = pose.iter().zip(&nearest).map(|(pose, nearest)| pose - nearest).collect();
        let distance = dot(&apart, &apart).sqrt();
        if distance > settings.tolerance_rad && bounds.len() < limits::LIMIT_BOUNDS {
            bounds.push(bound(&apart.iter().map(|x| x / distance).collect::<Vec<_>>(), &samples));
        }
    }
    bounds
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

/// As far as the samples reach in a direction; rounded up, so that none of them exceeds it.
fn bound(normal: &[f64], samples: &[Vec<f64>]) -> PoseBound {
    let normal: Vec<f32> = normal.iter().map(|&x| x as f32).collect();
    let along = |sample: &Vec<f64>| normal.iter().zip(sample).map(|(&n, x)| f64::from(n) * x).sum::<f64>();
    let most_rad = samples.iter().map(along).fold(0.0, f64::max) as f32;
    PoseBound { normal, most_rad: most_rad.next_up() }
}

/// A pose that a wearer might want: each joint's angles from some sample, exaggerated, or anything within the angles' own bounds.
fn thrown(samples: &[Vec<f64>], bounds: &[PoseBound], numbers: &mut Numbers) -> Vec<f64> {
    let count = samples[0].len();
    match numbers.below(3) {
        0 => {
            let most = |bound: usize| bounds[bound].most_rad + 0.1;
            (0..count).map(|angle| f64::from(numbers.between(-most(2 * angle + 1), most(2 * angle)))).collect()
        }
        1 => {
            // Half of the joints as in one sample, half as in another.
            let [a, b] = [(); 2].map(|()| &samples[numbers.below(samples.len())]);
            let scale = f64::from(numbers.between(0.3, 1.5));
            (0..count).map(|angle| scale * if angle < count / 2 { a[angle] } else { b[angle] }).collect()
        }
        _ => {
            let mut pose = Vec::with_capacity(count);
            for joint in 0..count / 3 {
                let sample = &samples[numbers.below(samples.len())];
                let scale = f64::from(numbers.between(0.0, 1.3));
                pose.extend(sample[3 * joint..3 * joint + 3].iter().map(|angle| scale * angle));
            }
            pose
        }
    }
}

/// Takes a pose to the bounds, one after the other.
fn hold(pose: &mut [f64], bounds: &[PoseBound]) {
    for _ in 0..30 {
        for bound in bounds {
            let along: f64 = bound.normal.iter().zip(&*pose).map(|(&n, x)| f64::from(n) * x).sum();
            let excess = along - f64::from(bound.most_rad);
            if excess > 0.0 {
                pose.iter_mut().zip(&bound.normal).for_each(|(x, &n)| *x -= excess * f64::from(n));
            }
        }
    }
}

/// The place of the samples' polytope that is nearest, by the pairwise method of Frank and Wolfe (Lacoste-Julien and Jaggi: On the
/// Global Linear Convergence of Frank-Wolfe Optimization Variants, 2015).
fn nearest(pose: &[f64], samples: &[Vec<f64>]) -> Vec<f64> {
    let mut shares = vec![0.0; samples.len()];
    shares[0] = 1.0;
    let mut place = samples[0].clone();
    for _ in 0..2000 {
        let slope: Vec<f64> = place.iter().zip(pose).map(|(place, pose)| place - pose).collect();
        let along: Vec<f64> = samples.iter().map(|sample| dot(&slope, sample)).collect();
        let to = (0..samples.len()).min_by(|&a, &b| along[a].total_cmp(&along[b])).expect("the base is a sample");
        let used = (0..samples.len()).filter(|&sample| shares[sample] > 0.0);
        let from = used.max_by(|&a, &b| along[a].total_cmp(&along[b])).expect("shares sum to one");
        let way: Vec<f64> = samples[to].iter().zip(&samples[from]).map(|(to, from)| to - from).collect();
        let (gain, length) = (along[from] - along[to], dot(&way, &way));
        if gain < 1e-9 || length < 1e-18 {
            break;
        }
        let step = (gain / length).min(shares[from]);
        shares[to] += step;
        shares[from] -= step;
        place.iter_mut().zip(&way).for_each(|(place, way)| *place += step * way);
    }
    place
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::Quat;

    #[test]
    fn the_nearest_place_of_a_triangle() {
        let triangle = [vec![0.0, 0.0], vec![1.0, 0.0], vec![0.0, 1.0]];
        for (pose, expected) in [([0.2, 0.3], [0.2, 0.3]), ([1.0, 1.0], [0.5, 0.5]), ([-1.0, 0.4], [0.0, 0.4])] {
            let found = nearest(&pose, &triangle);
            assert!(found.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-6), "{found:?} for {pose:?}");
        }
    }

    /// A step forward of either leg, not both: between them the polytope is narrow.
    #[test]
    fn bounds_hold_the_samples_and_what_lies_between_and_stop_what_is_beyond() {
        let turn = Quat::from_rotation_x;
        let rotations = [[0.0, 0.0], [-0.5, 0.2], [0.2, -0.5]].as_flattened().iter().map(|&x| turn(x)).collect();
        let bones = vec![Bone::LeftUpperLeg, Bone::RightUpperLeg];
        let poses = PoseTable { bones: bones.clone(), rotations };
        let bounds = bounds(&bones, &poses, &Settings::default());
        let exceeds = |left: f32, right: f32| {
            let pose = [left, 0.0, 0.0, right, 0.0, 0.0];
            let along =
                |bound: &PoseBound| bound.normal.iter().zip(pose).map(|(n, x)| n * x).sum::<f32>() - bound.most_rad;
            bounds.iter().map(along).fold(0.0, f32::max)
        };
        for (left, right) in [(0.0, 0.0), (-0.5, 0.2), (0.2, -0.5), (-0.15, -0.15), (-0.25, 0.1), (0.1, -0.25)] {
            assert!(exceeds(left, right) < 1e-6, "{left}, {right}");
        }
        for (left, right) in [(-0.4, -0.4), (0.2, 0.2), (-0.6, 0.2), (-0.3, 0.3)] {
            assert!(exceeds(left, right) > 0.05, "{left}, {right}");
        }
    }
}
