//! A kimono whose arrays have been checked ([`Garment`]), with what is derived from them once. Knows neither the bytes of a pack
//! nor how a frame is made.

use crate::arrays::{GarmentData, InvalidGarment};
use crate::plan::Plan;
use crate::pose_blend::rbf::{Samples, rbf};
use crate::pose_blend::{Kernel, Rates, paper};
use crate::reach::{Limited, limited};
use crate::skeleton::Pose;

/// A kimono whose every index and number has been checked, with what evaluation derives from it once.
#[derive(Clone, Debug)]
pub struct Garment {
    data: GarmentData,
    samples: Samples,
    plan: Plan,
}

impl Garment {
    /// Checks everything that evaluation relies on, so that it can neither fail nor index out of bounds. Rotations of
    /// the pose table that are unit quaternions within 1e-3 are normalised.
    ///
    /// # Errors
    /// Names the first element that breaks a rule.
    pub fn new(mut data: GarmentData) -> Result<Garment, InvalidGarment> {
        data.check()?;
        for rotation in &mut data.poses.rotations {
            // Only where needed: a second normalisation may change the last bit, and packs must come back as written.
            if (rotation.length_squared() - 1.0).abs() > 1e-6 {
                *rotation = rotation.normalize();
            }
        }
        Ok(Garment { samples: Samples::new(&data), plan: Plan::new(&data), data })
    }

    /// What frames are made with.
    pub(crate) fn plan(&self) -> &Plan {
        &self.plan
    }

    /// The kernel that [`evaluate`](crate::evaluate::evaluate) uses: the default one where the garment has it.
    #[must_use]
    pub fn kernel(&self) -> Kernel {
        if self.data.rbf.is_some() { Kernel::Rbf } else { Kernel::Paper }
    }

    /// The blend rates of a pose by this kernel, however its arms are twisted ([`Pose::with_arms_untwisted`]).
    ///
    /// # Panics
    /// When `rates` was made for a garment of another shape.
    pub fn blend_rates(&self, kernel: Kernel, pose: &Pose, rates: &mut Rates) {
        let pose = pose.with_arms_untwisted();
        match kernel {
            Kernel::Paper => paper(&self.data, &pose, rates),
            Kernel::Rbf => rbf(&self.data, &self.samples, &pose, rates),
        }
    }

    /// The pose as the kimono allows it: joints that would turn farther than its samples reach, and the margin beyond them, are held
    /// back ([`PoseLimit`](crate::arrays::PoseLimit)). Show the wearer in this pose, too, or legs come through the skirt. Smooth, and a
    /// function of the pose alone; a pose that exceeds nothing comes back bit for bit. What is no rotation is mended first
    /// ([`Pose::sanitised`]).
    #[must_use]
    pub fn limited(&self, pose: &Pose) -> Limited {
        let mended = if pose.is_valid() { None } else { Some(pose.sanitised()) };
        limited(&self.data.pose_limits, mended.as_ref().unwrap_or(pose))
    }

    /// The checked arrays.
    #[must_use]
    pub fn data(&self) -> &GarmentData {
        &self.data
    }

    /// Vertices of a frame: the unique ones, then the seam twins.
    #[must_use]
    pub fn vertex_count(&self) -> usize {
        self.unique_count() + self.data.mesh.twin_of.len()
    }

    /// Vertices without seam twins.
    #[must_use]
    pub fn unique_count(&self) -> usize {
        self.data.mesh.positions_m.len()
    }

    /// Triangles over all vertices.
    #[must_use]
    pub fn triangle_count(&self) -> usize {
        self.data.mesh.triangles.len()
    }
}
