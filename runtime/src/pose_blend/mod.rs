//! From a pose to blend rates: how much each target counts for each driver (P0, steps 1 and 2). Knows rotations only,
//! no vertex.

pub mod rbf;

use crate::arrays::{GarmentData, PoseTable};
use crate::skeleton::{Bone, Pose, angle_between_rad};

/// Differences below this count as this: an input on a sample gives that sample all but 0.001 % of the rate, and
/// samples whose rotations are the same up to the rounding of their table share evenly.
const LEAST_DIFFERENCE_RAD: f32 = 1e-5;

/// Largest rate that [`Rates::set`] keeps, either sign; far beyond it frames would lose their finite numbers.
const LARGEST_RATE: f32 = 100.0;

/// Blend rates: for every driver, how much every target counts. What is missing to 1 is the base's share.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Rates {
    targets: usize,
    /// Row by row, one row of `targets` rates per driver. Those of another layer's targets are 0.
    rates: Vec<f32>,
    layer_of_driver: Vec<u8>,
    layer_of_target: Vec<u8>,
    work: rbf::Work,
}

impl Rates {
    /// Rates for this garment, all 0: the base alone.
    #[must_use]
    pub fn new(data: &GarmentData) -> Rates {
        let rates = vec![0.0; data.drivers.len() * data.targets.len()];
        Rates {
            targets: data.targets.len(),
            rates,
            layer_of_driver: data.drivers.iter().map(|driver| driver.layer).collect(),
            layer_of_target: data.targets.iter().map(|target| target.layer).collect(),
            work: rbf::Work::new(data),
        }
    }

    /// How many drivers and targets these rates are for.
    #[must_use]
    pub fn shape(&self) -> (usize, usize) {
        (self.layer_of_driver.len(), self.targets)
    }

    /// The rates of all targets for one driver.
    ///
    /// # Panics
    /// When there is no such driver.
    #[must_use]
    pub fn driver(&self, driver: usize) -> &[f32] {
        &self.rates[driver * self.targets..(driver + 1) * self.targets]
    }

    /// Sets one rate. Any finite number is allowed (1 shows the target wholly, more exaggerates it) and kept within
    /// ±100; what is not a number counts as 0. A driver does not move the targets of another layer: that rate stays 0.
    ///
    /// # Panics
    /// When there is no such driver or target.
    pub fn set(&mut self, driver: usize, target: usize, rate: f32) {
        assert!(target < self.targets, "target {target} of {}", self.targets);
        if self.layer_of_driver[driver] == self.layer_of_target[target] {
            self.rates[driver * self.targets + target] = limited(rate);
        }
    }

    /// Sets all rates to 0.
    pub fn clear(&mut self) {
        self.rates.fill(0.0);
    }

    /// Whether a target counts for any driver.
    #[must_use]
    pub fn is_active(&self, target: usize) -> bool {
        self.rates.iter().skip(target).step_by(self.targets.max(1)).any(|&rate| rate != 0.0)
    }
}

fn limited(rate: f32) -> f32 {
    if rate.is_nan() { 0.0 } else { rate.clamp(-LARGEST_RATE, LARGEST_RATE) }
}

/// Which kernel turns a pose into rates.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kernel {
    /// [`paper`]: normalised inverse pose differences within a threshold, driver by driver.
    Paper,
    /// [`rbf::rbf`]: exact, smooth, fitted to the garment.
    Rbf,
}

/// The kernel of the paper (P0, steps 1 and 2), driver by driver.
///
/// The pose difference D of a sample is the root of the summed squares of the angles between its rotations and those
/// of the input, over the driver's joints. The samples with D no larger than the driver's threshold are similar; the
/// base is a sample as well. Each similar sample's rate is proportional to 1/D, and the rates sum to 1. With no
/// similar sample all rates are 0, which leaves the skinned base. A driver's samples are those of its layer.
///
/// The text of the paper's formula for the rate is lost; inverse pose difference is our reading of "from the pose
/// differences of the n similar poses". D below 1e-5 rad counts as 1e-5 rad, so that an input on a sample is no
/// division by zero. A rotation and its negated quaternion are the same; a rotation that is not finite is far from
/// every sample.
///
/// # Panics
/// When `rates` was made for a garment of another shape.
pub fn paper(data: &GarmentData, pose: &Pose, rates: &mut Rates) {
    rates.assert_fits(data);
    rates.clear();
    for (driver, row) in data.drivers.iter().zip(rates.rates.chunks_exact_mut(data.targets.len().max(1))) {
        let closeness = |sample: usize| {
            if sample > data.sample_count() || sample > 0 && data.targets[sample - 1].layer != driver.layer {
                return None;
            }
            let difference_rad = pose_difference_rad(&data.poses, sample, &driver.joints, pose);
            // Not a number compares as false, so it is never similar.
            (difference_rad <= driver.threshold_rad).then(|| 1.0 / difference_rad.max(LEAST_DIFFERENCE_RAD))
        };
        let mut sum = closeness(0).unwrap_or(0.0);
        for (target, rate) in row.iter_mut().enumerate() {
            *rate = closeness(target + 1).unwrap_or(0.0);
            sum += *rate;
        }
        if sum > 0.0 {
            row.iter_mut().for_each(|rate| *rate /= sum);
        }
    }
}

impl Rates {
    pub(crate) fn assert_fits(&self, data: &GarmentData) {
        assert!(
            self.layer_of_target.len() == data.targets.len() && self.layer_of_driver.len() == data.drivers.len(),
            "the rates were made for another garment"
        );
    }
}

/// D of the paper: how far the pose is from a row of the table, over these joints. Radians.
fn pose_difference_rad(table: &PoseTable, row: usize, joints: &[Bone], pose: &Pose) -> f32 {
    let sample = table.row(row);
    let squares = joints.iter().map(|&bone| {
        let column = table.bones.iter().position(|&listed| listed == bone).expect("a checked driver's joint is listed");
        let angle = angle_between_rad(pose.rotation(bone), sample[column]);
        angle * angle
    });
    squares.sum::<f32>().sqrt()
}
