//! Recorded motion.

use crate::axes::Axes;
use crate::buffer::{self, given, put, put_handle, put_struct, slice, write_text};
use crate::pack::KitsukePack;
use crate::pose::{PoseData, out_of_range, put_tracked};
use crate::status::{Status, guarded};
use bytemuck::{Pod, Zeroable};
use kitsuke::skeleton::recording::{self, Recording};

/// A recorded motion of any format that is read, on the wearer of one kimono.
pub struct KitsukeMotion(Recording);

/// What there is of a motion.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, Pod, Zeroable)]
pub struct MotionInfo {
    /// To be set by the caller: `sizeof` of this struct.
    pub struct_size: u32,
    /// Frames, at least 1.
    pub frame_count: u32,
    /// Time of the last frame, seconds.
    pub length_s: f64,
    /// Sentences that say how the file was understood where it left that open.
    pub note_count: u32,
    /// Unused.
    pub reserved: u32,
}

/// Reads a recorded motion: BVH, .vrma, VRM, MediaPipe, Kinect, DeepMimic or JSON Lines, told apart by content.
///
/// # Safety
/// `bytes` must point to `length` bytes, `pack` must be null or a handle, `motion` a place for a handle.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn kitsuke_motion_open(
    bytes: *const u8,
    length: usize,
    pack: *const KitsukePack,
    motion: *mut *mut KitsukeMotion,
) -> Status {
    guarded(|| {
        let open = || {
            // SAFETY: as the caller promises.
            let (bytes, pack) = unsafe { (slice("the motion", bytes, length)?, given("the pack", pack)?) };
            let read = recording::read(bytes, &pack.garment().data().skeleton);
            Ok(KitsukeMotion(read.map_err(|error| (Status::Motion, error.to_string()))?))
        };
        // SAFETY: as the caller promises.
        unsafe { put_handle("the motion", motion, open) }
    })
}

/// Frees a motion.
///
/// # Safety
/// `motion` must be null or a handle that has not been freed.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn kitsuke_motion_free(motion: *mut KitsukeMotion) {
    // SAFETY: as the caller promises.
    unsafe { buffer::free(motion) };
}

/// Fills in what there is, as far as `struct_size` reaches.
///
/// # Safety
/// `motion` must be null or a handle, `info` null or a struct of as many bytes as its first field says.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn kitsuke_motion_info(motion: *const KitsukeMotion, info: *mut MotionInfo) -> Status {
    guarded(|| {
        // SAFETY: as the caller promises.
        let recording = unsafe { &given("the motion", motion)?.0 };
        let found = MotionInfo {
            struct_size: 0,
            frame_count: recording.frames.len() as u32,
            length_s: recording.times_s.last().copied().unwrap_or_default(),
            note_count: recording.notes.len() as u32,
            reserved: 0,
        };
        // SAFETY: as the caller promises.
        unsafe { put_struct("info", info, &found) }
    })
}

/// Copies a note as [`kitsuke_message`](crate::kitsuke_message) does and returns its whole length, 0 when there is no such note.
///
/// # Safety
/// `motion` must be null or a handle, `buffer` null or have room for `capacity` bytes.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn kitsuke_motion_note(
    motion: *const KitsukeMotion,
    index: u32,
    buffer: *mut u8,
    capacity: usize,
) -> usize {
    // SAFETY: as the caller promises.
    let note = unsafe { motion.as_ref() }.and_then(|motion| motion.0.notes.get(index as usize));
    // SAFETY: as the caller promises.
    unsafe { write_text(note.map_or("", String::as_str), buffer, capacity) }
}

/// A frame's pose. `confidence`, if not null, gets a number from 0 to 1 per bone.
///
/// # Safety
/// `motion` must be null or a handle, `pose` null or a place for a pose, `confidence` null or have room for as many numbers as there are
/// bones.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn kitsuke_motion_pose(
    motion: *const KitsukeMotion,
    frame: u32,
    axes: i32,
    pose: *mut PoseData,
    confidence: *mut [f32; 55],
) -> Status {
    guarded(|| {
        let axes = Axes::of(axes)?;
        // SAFETY: as the caller promises.
        let recording = unsafe { &given("the motion", motion)?.0 };
        let (frame, count) = (frame as usize, recording.frames.len());
        let tracked = recording.frames.get(frame).ok_or_else(|| out_of_range("frame", frame, count))?;
        // SAFETY: as the caller promises.
        unsafe { put_tracked(tracked, axes, pose, confidence) }
    })
}

/// The pose at a time (seconds from the first frame; before it and after the last one these): between frames rotations go the shorter
/// way.
///
/// # Safety
/// As [`kitsuke_motion_pose`].
#[unsafe(no_mangle)]
pub unsafe extern "C" fn kitsuke_motion_pose_at(
    motion: *const KitsukeMotion,
    time_s: f64,
    axes: i32,
    pose: *mut PoseData,
) -> Status {
    guarded(|| {
        let axes = Axes::of(axes)?;
        // SAFETY: as the caller promises.
        let recording = unsafe { &given("the motion", motion)?.0 };
        // SAFETY: as the caller promises.
        unsafe { put("the pose", pose, PoseData::new(&recording.pose_at(time_s), axes)) }
    })
}
