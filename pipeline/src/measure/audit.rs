//! How deep the cloth lies in the wearer, pose after pose, measured against the skinned mesh of the body. Knows neither files nor
//! how poses are chosen.

use crate::ir::{self, Body};
use crate::stages::StageError;
use crate::stages::correctives::posed;
use crate::stages::posed_body::PosedBody;
use glam::Vec3;
use kitsuke::Garment;
use kitsuke::skeleton::Pose;
use rayon::prelude::*;

/// Cloth deeper than this counts as this deep, metres.
pub const DEEPEST_M: f32 = 0.08;
/// Upper ends of the classes of [`Audit::classes`], metres; the last class holds everything deeper.
pub const CLASSES_M: [f32; 6] = [0.0005, 0.001, 0.002, 0.005, 0.01, 0.02];

/// How many poses a build takes.
pub const BUILD_POSES: usize = 96;

/// At most so many vertices of a pose are made certain of.
const CERTAIN: usize = 40;

/// Cloth that lies in the body.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Depth {
    /// How deep, metres; 0 when none does.
    pub depth_m: f32,
    /// Number of the pose among those measured.
    pub pose: usize,
    /// Unique vertex of the garment.
    pub vertex: u32,
    /// The joint that the nearest skin follows most, a number in the body's skeleton.
    pub joint: u8,
}

/// What was found in a series of poses.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Audit {
    /// The deepest vertex of each pose.
    pub by_pose: Vec<Depth>,
    /// How many vertices of all poses lie how deep; see [`CLASSES_M`].
    pub classes: [usize; CLASSES_M.len() + 1],
}

impl Audit {
    /// The deepest vertex of all poses.
    #[must_use]
    pub fn worst(&self) -> Depth {
        deepest(&self.by_pose)
    }

    /// How many poses have a vertex deeper than this.
    #[must_use]
    pub fn poses_beyond(&self, depth_m: f32) -> usize {
        self.by_pose.iter().filter(|depth| depth.depth_m > depth_m).count()
    }

    /// The poses by their deepest vertex, the deepest first.
    #[must_use]
    pub fn worst_poses(&self) -> Vec<Depth> {
        let mut worst = self.by_pose.clone();
        worst.sort_by(|a, b| b.depth_m.total_cmp(&a.depth_m));
        worst
    }

    fn add(&mut self, depths: &[Depth]) {
        self.by_pose.push(deepest(depths));
        for depth in depths {
            let class = CLASSES_M.iter().position(|&end_m| depth.depth_m <= end_m);
            self.classes[class.unwrap_or(CLASSES_M.len())] += 1;
        }
    }
}

/// The deepest of some vertices; depth 0 where there are none.
#[must_use]
pub fn deepest(depths: &[Depth]) -> Depth {
    depths.iter().copied().max_by(|a, b| a.depth_m.total_cmp(&b.depth_m)).unwrap_or_default()
}

/// Compares the deepest of some poses with the artist's budget.
///
/// # Errors
/// Names vertex, bone and depth of what is over budget.
pub fn keep_budget(deepest: &Depth, garment: &Garment, source: &ir::Garment) -> Result<(), StageError> {
    let Some(budget_m) = source.inside_budget_m.filter(|budget_m| deepest.depth_m > *budget_m) else { return Ok(()) };
    let bone = source.body.skeleton.joints()[usize::from(deepest.joint)].bone;
    let vertex = garment.data().mesh.source_vertex[deepest.vertex as usize];
    Err(StageError::new(
        "audit",
        format!(
            "vertex {vertex} lies {:.1} mm inside {} in pose {} of the audit, over inside_budget ({:.1} mm): add a target near that \
             pose (cargo xtask audit draws it)",
            deepest.depth_m * 1e3,
            bone.name(),
            deepest.pose,
            budget_m * 1e3
        ),
    ))
}

/// Measures these poses with the garment's own kernel.
///
/// # Panics
/// When the body's surface is no triangle mesh, which no stage before lets pass.
#[must_use]
pub fn audit(body: &Body, garment: &Garment, poses: &[Pose]) -> Audit {
    let measure = |(number, pose): (usize, &Pose)| pose_depths(body, garment, number, pose);
    let found: Vec<Vec<Depth>> = poses.par_iter().enumerate().map(measure).collect();
    let mut audit = Audit::default();
    found.iter().for_each(|depths| audit.add(depths));
    audit
}

/// Every vertex that lies in the body in this pose, the deepest first.
#[must_use]
pub fn pose_depths(body: &Body, garment: &Garment, number: usize, pose: &Pose) -> Vec<Depth> {
    let pose = pose.sanitised();
    let posed_body = PosedBody::new(body, &pose);
    let positions_m = posed(garment, &pose);
    let depth = |(vertex, place_m): (usize, &Vec3)| {
        let (depth_m, joint) = posed_body.depth(*place_m, DEEPEST_M)?;
        Some(Depth { depth_m, pose: number, vertex: vertex as u32, joint })
    };
    let mut depths: Vec<Depth> = positions_m.iter().enumerate().filter_map(depth).collect();
    depths.sort_by(|a, b| b.depth_m.total_cmp(&a.depth_m));
    // The nearest skin may belong to a fold of the posed body, whose side says nothing. The deepest are made certain.
    let is_inside = |depth: &Depth| posed_body.winding(positions_m[depth.vertex as usize]) > 0.5;
    let outside = depths.iter().take(CERTAIN).take_while(|depth| !is_inside(depth)).count();
    depths.drain(..outside);
    depths
}
