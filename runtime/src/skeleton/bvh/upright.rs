//! Where up is in a file: what its frames show, held against what its OFFSETs, its first frame and the format say. Knows
//! no T-pose.
//!
//! Frames alone do not decide: who lies all the time looks like who stands in other axes. So another witness must agree,
//! or the caller decides.

use super::kinematics::Stance;
use super::options::Axis;
use super::rig::{LEGS, Limb, Rig};
use crate::skeleton::Bone;
use glam::DVec3;

/// A frame stands along an axis if trunk and body are within this of it: cosine of 60°.
const STANDS_COS: f64 = 0.5;
/// An axis that this share of the frames stands along is the frames' up.
const MOST: f64 = 0.5;
/// An up along which fewer frames stand is none that this motion shows.
const HARDLY: f64 = 0.05;
/// Feet are on the ground if the lower one's height, in shares of the body's, is at most this: median of the frames.
const GROUND_SHARE: f64 = 0.15;

/// What some frames show.
pub(super) struct Frames {
    count: usize,
    /// How many stand along each axis.
    standing: [usize; 6],
    /// Whether feet are at height 0 along the axis that most frames stand along.
    on_ground: bool,
}

impl Frames {
    pub fn new(rig: &Rig, stances: &[Stance]) -> Frames {
        let mut standing = [0; 6];
        let voted: Vec<(Axis, &Stance)> =
            stances.iter().filter_map(|stance| Some((standing_along(rig, stance)?, stance))).collect();
        for &(axis, _) in &voted {
            standing[axis as usize] += 1;
        }
        let mut frames = Frames { count: stances.len(), standing, on_ground: false };
        let up = frames.most();
        let mut heights: Vec<f64> = voted
            .iter()
            .filter(|&&(axis, _)| axis == up)
            .filter_map(|(_, stance)| {
                let high = |at: DVec3| at.dot(up.vector());
                let [left, right] = feet(rig, stance)?.map(high);
                let (lower, height) = (left.min(right), high(head(rig, stance)?) - left.min(right));
                (height > 0.0).then(|| lower / height)
            })
            .collect();
        heights.sort_by(f64::total_cmp);
        frames.on_ground = heights.get(heights.len() / 2).is_some_and(|height| height.abs() <= GROUND_SHARE);
        frames
    }

    /// The axis that most frames stand along; of equals +Y, then the first.
    fn most(&self) -> Axis {
        let votes = |axis: &&Axis| 2 * self.standing[**axis as usize] + usize::from(**axis == Axis::PlusY);
        *Axis::ALL.iter().rev().max_by_key(votes).unwrap_or(&Axis::PlusY)
    }

    /// The share of the frames that stands along an axis.
    fn share(&self, axis: Axis) -> f64 {
        self.standing[axis as usize] as f64 / self.count.max(1) as f64
    }

    /// In words, how many frames stand along an axis.
    pub fn said(&self, axis: Axis) -> String {
        let share = 100.0 * self.share(axis);
        match self.count {
            1 => format!("the one frame {} along {axis}", if share > 0.0 { "stands" } else { "does not stand" }),
            count => format!("{share:.0} % of {count} frames looked at stand along {axis}"),
        }
    }
}

/// What else speaks for an axis.
pub(super) struct Witnesses {
    /// Up of the OFFSETs, if they form a pose.
    pub offsets: Option<Axis>,
    /// Up of the first frame, if it is a T-pose.
    pub first_frame: Option<Axis>,
}

/// The axis that points up, and why.
pub(super) struct Up {
    pub axis: Axis,
    /// A sentence without a full stop.
    pub note: String,
}

/// Decides which axis points up.
///
/// # Errors
/// The evidence in words, and the likeliest axis, if it does not agree.
pub(super) fn decide(frames: &Frames, witnesses: &Witnesses, given: Option<Axis>) -> Result<Up, (String, Axis)> {
    if let Some(axis) = given {
        return Ok(Up { axis, note: format!("up is {axis} as told; {}", frames.said(axis)) });
    }
    let most = frames.most();
    let shown = frames.share(most) >= MOST;
    let mut agree = Vec::new();
    if witnesses.offsets == Some(most) {
        agree.push("its OFFSETs have it so");
    }
    if witnesses.first_frame == Some(most) {
        agree.push("the T-pose in its first frame stands so");
    }
    // Against OFFSETs that are a pose, custom alone is too little: someone may lie along +Y.
    let custom_counts = !agree.is_empty() || witnesses.offsets.is_none() || frames.on_ground;
    if most == Axis::PlusY && custom_counts {
        agree.push("it is the format's custom");
    }
    if frames.on_ground && (witnesses.offsets.is_none() || most == Axis::PlusY) {
        agree.push("feet are at height 0");
    }
    let is_custom = witnesses.offsets == Some(Axis::PlusY) || witnesses.first_frame == Some(Axis::PlusY);
    match () {
        () if shown && !agree.is_empty() => {
            let turned = witnesses.offsets.filter(|&offsets| offsets != most);
            let turned = turned
                .map_or(String::new(), |offsets| format!("; its OFFSETs have {offsets} up and the frames turn them"));
            Ok(Up {
                axis: most,
                note: format!("up is {most}: {}, and {}{turned}", frames.said(most), agree.join(" and ")),
            })
        }
        // Pose and custom agree, and the frames do not show another axis, or stand so at times.
        () if is_custom && (!shown || frames.share(Axis::PlusY) >= HARDLY) => {
            let axis = Axis::PlusY;
            Ok(Up {
                axis,
                note: format!("up is {axis} by its T-pose and the format's custom, though only {}", frames.said(axis)),
            })
        }
        () => {
            let pose = witnesses
                .offsets
                .map_or("its OFFSETs form no pose".to_owned(), |up| format!("its OFFSETs have {up} up"));
            let first =
                witnesses.first_frame.map_or(String::new(), |up| format!(", the T-pose in its first frame {up}"));
            let ground = if frames.on_ground { "" } else { ", feet are not at height 0" };
            Err((format!("{}{ground}, {pose}{first}, and the format's custom is +Y", frames.said(most)), most))
        }
    }
}

/// The axis along which someone stands in a stance: hips above feet, arms above hips, head above all.
fn standing_along(rig: &Rig, stance: &Stance) -> Option<Axis> {
    let trunk = rig.trunk(stance)?;
    let ends = feet(rig, stance).zip(head(rig, stance));
    let body = ends.and_then(|([left, right], head)| (head - 0.5 * (left + right)).try_normalize());
    let body = body.unwrap_or(trunk);
    let axis = Axis::nearest(trunk + body);
    [trunk, body].into_iter().all(|along| along.dot(axis.vector()) >= STANDS_COS).then_some(axis)
}

/// Both feet, or what there is of both legs.
fn feet(rig: &Rig, stance: &Stance) -> Option<[DVec3; 2]> {
    let end = |leg: Limb| leg.into_iter().rev().find_map(|bone| rig.joint(bone)).map(|joint| stance.positions[joint]);
    let [left, right] = LEGS.map(end);
    left.zip(right).map(|(left, right)| [left, right])
}

fn head(rig: &Rig, stance: &Stance) -> Option<DVec3> {
    let top = [Bone::Head, Bone::Neck, Bone::UpperChest, Bone::Chest];
    top.into_iter().find_map(|bone| rig.joint(bone)).map(|joint| stance.positions[joint])
}
