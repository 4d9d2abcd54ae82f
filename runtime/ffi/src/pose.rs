//! Poses and bones as the interface has them.

use crate::axes::Axes;
use crate::buffer::{given, put, slice, write_text};
use crate::pack::KitsukePack;
use crate::status::{Failure, Status, guarded};
use kitsuke::glam::{Quat, Vec3};
#[cfg(any(feature = "recordings", feature = "vmc"))]
use kitsuke::skeleton::Tracked;
use kitsuke::skeleton::{Bone, Pose};

/// A pose: for every bone of VRM 1.0 the rotation relative to the T-pose in its parent's axes, which in the T-pose are the world's, and
/// how far the hips have moved. What is no rotation counts as the T-pose.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct PoseData {
    /// Quaternions x, y, z, w by the bones' numbers.
    pub rotations: [[f32; 4]; 55],
    /// From where they rest, in the axes' unit.
    pub hips_translation: [f32; 3],
}

impl PoseData {
    pub(crate) fn pose(&self, axes: Axes) -> Pose {
        Pose {
            rotations: self.rotations.map(|q| axes.rotation(Quat::from_array(q))),
            hips_translation_m: axes.place_back(Vec3::from_array(self.hips_translation)),
        }
    }

    pub(crate) fn new(pose: &Pose, axes: Axes) -> PoseData {
        PoseData {
            rotations: pose.rotations.map(|q| axes.rotation(q).to_array()),
            hips_translation: axes.place(pose.hips_translation_m).to_array(),
        }
    }
}

/// How many bones there are: as many as [`PoseData`] has rotations.
#[unsafe(no_mangle)]
pub extern "C" fn kitsuke_bone_count() -> u32 {
    Bone::COUNT as u32
}

/// Copies a bone's VRM 1.0 name, for example `leftUpperArm`, as [`kitsuke_message`](crate::kitsuke_message) does; returns its length,
/// 0 when there is no such bone.
///
/// # Safety
/// `buffer` must be null or have room for `capacity` bytes.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn kitsuke_bone_name(bone: u32, buffer: *mut u8, capacity: usize) -> usize {
    let name = Bone::ALL.get(bone as usize).map_or("", |bone| bone.name());
    // SAFETY: as the caller promises.
    unsafe { write_text(name, buffer, capacity) }
}

/// The bone that carries a bone in VRM 1.0, whose number is lower, or -1: none, or there is no such bone. A skeleton may lack bones; what
/// carries a joint of a kimono's says [`kitsuke_pack_joint`](crate::kitsuke_pack_joint).
#[unsafe(no_mangle)]
pub extern "C" fn kitsuke_bone_parent(bone: u32) -> i32 {
    let parent = Bone::ALL.get(bone as usize).and_then(|bone| bone.vrm_parent());
    parent.map_or(-1, |parent| parent as i32)
}

/// The number of a bone by its VRM 1.0 name, or -1.
///
/// # Safety
/// `name` must point to `length` bytes.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn kitsuke_bone_from_name(name: *const u8, length: usize) -> i32 {
    // SAFETY: as the caller promises.
    let name = unsafe { slice("the name", name, length) }.unwrap_or_default();
    Bone::ALL.iter().position(|bone| bone.name().as_bytes() == name).map_or(-1, |number| number as i32)
}

/// The pose as the kimono allows it: show the wearer in this pose, too. `turned_rad`, if not null, gets the farthest that a joint was
/// turned back.
///
/// # Safety
/// Pointers must be null or valid; `pose` and `limited` may be the same.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn kitsuke_limit(
    pack: *const KitsukePack,
    axes: i32,
    pose: *const PoseData,
    limited: *mut PoseData,
    turned_rad: *mut f32,
) -> Status {
    guarded(|| {
        let axes = Axes::of(axes)?;
        // SAFETY: as the caller promises; each pointer is read before anything is written.
        let (pack, pose) = unsafe { (given("the pack", pack)?, given("the pose", pose)?.pose(axes)) };
        let held = pack.garment().limited(&pose);
        // SAFETY: as above.
        unsafe { put("the limited pose", limited, PoseData::new(&held.pose, axes)) }?;
        // SAFETY: as above.
        unsafe { put_if(turned_rad, held.turned_rad) };
        Ok(())
    })
}

/// Writes where the caller wants it.
///
/// # Safety
/// `to` must be null or have room for a value.
pub(crate) unsafe fn put_if<T>(to: *mut T, value: T) {
    if !to.is_null() {
        // SAFETY: not null, and the caller promises room.
        unsafe { to.write(value) };
    }
}

/// What is said of a number that names nothing.
pub(crate) fn out_of_range(what: &str, number: usize, count: usize) -> Failure {
    (Status::Range, format!("there is no {what} {number}; there are {count}, numbered from 0"))
}

#[cfg(any(feature = "recordings", feature = "vmc"))]
/// # Safety
/// `pose` must be null or a place for a pose, `confidence` null or have room for as many numbers as there are bones.
pub(crate) unsafe fn put_tracked(
    tracked: &Tracked,
    axes: Axes,
    pose: *mut PoseData,
    confidence: *mut [f32; Bone::COUNT],
) -> Result<(), Failure> {
    // SAFETY: as the caller promises.
    unsafe {
        put("the pose", pose, PoseData::new(&tracked.pose, axes))?;
        put_if(confidence, tracked.confidence);
    }
    Ok(())
}
