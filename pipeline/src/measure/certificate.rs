//! What a garment's blending promises between its samples: how fast the surface moves, that it does not jump, and how
//! wrong it is about shapes it has not seen. Measured on frames; knows only what an app knows, the run time.

use crate::ir;
use crate::measure::leave_one_out::{Error, Method, errors};
use crate::measure::pose_space::poses;
use crate::stages::StageError;
use glam::{Quat, Vec3};
use kitsuke::arrays::{Certificate, LeftOut, NearestPair, PoseTable};
use kitsuke::skeleton::angle_between_rad;
use kitsuke::skeleton::{Bone, Pose};
use kitsuke::{Frame, Garment, Scratch, evaluate};
use rayon::prelude::*;

/// How much is measured.
#[derive(Clone, Debug, PartialEq)]
pub struct Settings {
    /// Poses at which every joint is turned about every axis.
    pub poses: usize,
    /// Paths through the pose space.
    pub paths: usize,
    /// Steps along each.
    pub steps: usize,
}

impl Default for Settings {
    fn default() -> Settings {
        Settings { poses: 96, paths: 192, steps: 4 }
    }
}

/// One step: no joint turns farther than this.
const STEP_RAD: f32 = 0.01 * std::f32::consts::PI / 180.0;

/// The fastest movement found.
#[derive(Clone, Debug, PartialEq)]
pub struct Fastest {
    /// Millimetres per degree.
    pub speed_mm_per_deg: f32,
    /// The joint that was turned.
    pub joint: Bone,
    /// The sample poses between which it happened: the two nearest rows of the pose table.
    pub rows: [usize; 2],
}

/// Largest step and largest change from one step to the next, millimetres, along paths in steps of 0.01 degrees.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Smoothness {
    /// Farthest that any vertex moves in one step.
    pub step_mm: f32,
    /// Farthest that any vertex's movement differs between two consecutive steps.
    pub step_change_mm: f32,
}

/// Measures everything.
///
/// # Errors
/// When the kernel cannot be solved without one of the rows.
pub fn certificate(garment: &Garment, settings: &Settings) -> Result<Certificate, StageError> {
    let fastest = fastest(garment, settings.poses);
    let smoothness = smoothness(garment, settings.paths, settings.steps);
    let left_out = if garment.data().rbf.is_some() { errors(garment, Method::Default)? } else { Vec::new() };
    Ok(Certificate {
        speed_mm_per_deg: fastest.as_ref().map_or(0.0, |fastest| fastest.speed_mm_per_deg),
        fastest_joint: fastest.as_ref().map_or(Bone::Hips, |fastest| fastest.joint),
        fastest_rows: fastest.map_or([0, 0], |fastest| fastest.rows.map(|row| row as u16)),
        step_mm: smoothness.step_mm,
        step_change_mm: smoothness.step_change_mm,
        left_out: left_out.iter().map(left_out_entry).collect(),
        nearest: nearest_pair(&garment.data().poses),
    })
}

/// Compares the certificate with the artist's budgets.
///
/// # Errors
/// Names joint and poses of what is over budget.
pub fn keep_budgets(certificate: &Certificate, source: &ir::Garment) -> Result<(), StageError> {
    let row = |row: u16| match usize::from(row).checked_sub(1) {
        Some(target) => source.targets[target].name.as_str(),
        None => "the base",
    };
    let speed_mm = certificate.speed_mm_per_deg;
    if let Some(budget_mm) = source.speed_budget_m.map(|budget_m| budget_m * 1e3)
        && speed_mm > budget_mm
    {
        let [first, second] = certificate.fastest_rows.map(row);
        let joint = certificate.fastest_joint.name();
        return Err(StageError::new(
            "certificate",
            format!(
                "the cloth moves {speed_mm:.1} mm per degree of {joint} near the poses {first} and {second}, over \
                 speed_budget ({budget_mm:.1} mm): are their shapes of one kind, or is a pose between them missing?"
            ),
        ));
    }
    let worst = source.targets.iter().zip(&certificate.left_out).max_by(|a, b| a.1.max_mm.total_cmp(&b.1.max_mm));
    if let Some(budget_mm) = source.unseen_budget_m.map(|budget_m| budget_m * 1e3)
        && let Some((target, error)) = worst
        && error.max_mm > budget_mm
    {
        return Err(StageError::new(
            "certificate",
            format!(
                "the other poses predict {} only to {:.1} mm, over unseen_budget ({budget_mm:.1} mm): add poses near it",
                target.name, error.max_mm
            ),
        ));
    }
    Ok(())
}

fn left_out_entry(error: &Error) -> LeftOut {
    LeftOut { mean_mm: error.mean_mm as f32, p99_mm: error.p99_mm as f32, max_mm: error.max_mm as f32 }
}

/// Turns every joint of the pose table about every axis, in `count` poses, and keeps the fastest vertex.
#[must_use]
pub fn fastest(garment: &Garment, count: usize) -> Option<Fastest> {
    let table = &garment.data().poses;
    let found: Vec<Option<Fastest>> = poses(garment, 0, count)
        .par_iter()
        .map_init(
            || Frames::new(garment),
            |frames, pose| {
                frames.set(0, pose);
                let mut fastest: Option<Fastest> = None;
                for &joint in &table.bones {
                    for axis in [Vec3::X, Vec3::Y, Vec3::Z] {
                        let turn = small_turn(axis);
                        frames.set(1, &pose.clone().with(joint, (pose.rotation(joint) * turn).normalize()));
                        let speed_mm_per_deg = frames.farthest_mm() / 0.01;
                        if fastest.as_ref().is_none_or(|known| speed_mm_per_deg > known.speed_mm_per_deg) {
                            fastest = Some(Fastest { speed_mm_per_deg, joint, rows: nearest_rows(table, pose) });
                        }
                    }
                }
                fastest
            },
        )
        .collect();
    found.into_iter().flatten().max_by(|a, b| a.speed_mm_per_deg.total_cmp(&b.speed_mm_per_deg))
}

/// One step about an axis, so small that its sine is the angle.
fn small_turn(axis: Vec3) -> Quat {
    let half = axis * (STEP_RAD / 2.0);
    Quat::from_xyzw(half.x, half.y, half.z, 1.0).normalize()
}

/// Walks paths between poses of the pose space, each from a place on it in so many steps.
#[must_use]
pub fn smoothness(garment: &Garment, paths: usize, steps: usize) -> Smoothness {
    let table = &garment.data().poses;
    let ends = poses(garment, 0, 2 * paths);
    let walked: Vec<Smoothness> = (0..paths)
        .into_par_iter()
        .map_init(
            || Frames::new(garment),
            |frames, path| {
                let (from, to) = (&ends[path], &ends[paths + path]);
                // Where on the path: evenly over all paths, so that ends and middles are both walked.
                let start = path as f32 / paths.max(1) as f32;
                let step = STEP_RAD / farthest_turn_rad(table, from, to).max(STEP_RAD);
                let mut found = Smoothness::default();
                for number in 0..=steps {
                    frames.push(&between(from, to, start + number as f32 * step));
                    if number >= 1 {
                        found.step_mm = found.step_mm.max(frames.farthest_mm());
                    }
                    if number >= 2 {
                        found.step_change_mm = found.step_change_mm.max(frames.farthest_change_mm());
                    }
                }
                found
            },
        )
        .collect();
    walked.into_iter().fold(Smoothness::default(), |all, one| Smoothness {
        step_mm: all.step_mm.max(one.step_mm),
        step_change_mm: all.step_change_mm.max(one.step_change_mm),
    })
}

/// The pose at a share of the way, along the shortest arc of every joint.
fn between(from: &Pose, to: &Pose, share: f32) -> Pose {
    let mut pose = from.clone();
    for (rotation, &end) in pose.rotations.iter_mut().zip(&to.rotations) {
        *rotation = rotation.slerp(end, share);
    }
    pose
}

fn farthest_turn_rad(table: &PoseTable, a: &Pose, b: &Pose) -> f32 {
    table.bones.iter().map(|&bone| angle_between_rad(a.rotation(bone), b.rotation(bone))).fold(0.0, f32::max)
}

/// Rows by distance from the pose: the root of the summed squared angles.
fn nearest_rows(table: &PoseTable, pose: &Pose) -> [usize; 2] {
    let rows = table.rows();
    let distance = |row: usize| -> f32 {
        table
            .bones
            .iter()
            .zip(table.row(row))
            .map(|(&bone, &q)| angle_between_rad(pose.rotation(bone), q).powi(2))
            .sum()
    };
    let mut order: Vec<(f32, usize)> = (0..rows).map(|row| (distance(row), row)).collect();
    order.sort_by(|a, b| a.0.total_cmp(&b.0));
    [order[0].1, order.get(1).map_or(order[0].1, |second| second.1)]
}

/// The two rows of the table that are hardest to tell apart.
fn nearest_pair(table: &PoseTable) -> NearestPair {
    let rows = table.rows();
    let pairs = (0..rows).flat_map(|b| (0..b).map(move |a| (a, b)));
    let apart = |(a, b): (usize, usize)| {
        let squares = table.row(a).iter().zip(table.row(b)).map(|(&a, &b)| angle_between_rad(a, b).powi(2));
        NearestPair { rows: [a as u16, b as u16], apart_deg: squares.sum::<f32>().sqrt().to_degrees() }
    };
    let nearest = pairs.map(apart).min_by(|a, b| a.apart_deg.total_cmp(&b.apart_deg));
    nearest.unwrap_or(NearestPair { rows: [0, 0], apart_deg: 0.0 })
}

/// Positions of the last three frames.
struct Frames<'a> {
    garment: &'a Garment,
    scratch: Scratch,
    normals: Vec<Vec3>,
    positions_m: [Vec<Vec3>; 3],
}

impl<'a> Frames<'a> {
    fn new(garment: &'a Garment) -> Frames<'a> {
        let zeros = vec![Vec3::ZERO; garment.vertex_count()];
        let positions_m = [zeros.clone(), zeros.clone(), zeros.clone()];
        Frames { garment, scratch: Scratch::new(garment), normals: zeros, positions_m }
    }

    fn set(&mut self, place: usize, pose: &Pose) {
        let frame = Frame { positions_m: &mut self.positions_m[place], normals: &mut self.normals };
        evaluate(self.garment, pose, &mut self.scratch, frame);
    }

    /// The newest frame goes to place 0, the others move on.
    fn push(&mut self, pose: &Pose) {
        self.positions_m.rotate_right(1);
        self.set(0, pose);
    }

    fn farthest_mm(&self) -> f32 {
        let [new, old, _] = &self.positions_m;
        new.iter().zip(old).map(|(new, old)| new.distance_squared(*old)).fold(0.0, f32::max).sqrt() * 1e3
    }

    fn farthest_change_mm(&self) -> f32 {
        let [new, middle, old] = &self.positions_m;
        let steps = new.iter().zip(middle).zip(old).map(|((new, middle), old)| ((*new - *middle), (*middle - *old)));
        steps.map(|(after, before)| after.distance_squared(before)).fold(0.0, f32::max).sqrt() * 1e3
    }
}
