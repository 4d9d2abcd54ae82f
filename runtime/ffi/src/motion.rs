//! Recorded motion and live senders.

use crate::axes::Axes;
use crate::buffer::{self, given, given_mut, put, put_handle, put_struct, slice, write_text};
use crate::pack::KitsukePack;
use crate::pose::{PoseData, out_of_range, put_if};
use crate::status::{Status, guarded};
use bytemuck::{Pod, Zeroable};
use kitsuke::skeleton::recording::{self, Recording};
use kitsuke::skeleton::vmc::Receiver;
use kitsuke::skeleton::{Bone, Tracked};

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

/// Receives a live wearer in the VMC protocol; the socket is the app's.
pub struct KitsukeReceiver(Receiver);

/// Makes a receiver for the wearer of a kimono.
///
/// # Safety
/// `pack` must be null or a handle, `receiver` a place for a handle.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn kitsuke_receiver_new(pack: *const KitsukePack, receiver: *mut *mut KitsukeReceiver) -> Status {
    guarded(|| {
        let make = || {
            // SAFETY: as the caller promises.
            let pack = unsafe { given("the pack", pack)? };
            Ok(KitsukeReceiver(Receiver::new(&pack.garment().data().skeleton)))
        };
        // SAFETY: as the caller promises.
        unsafe { put_handle("the receiver", receiver, make) }
    })
}

/// Frees a receiver.
///
/// # Safety
/// `receiver` must be null or a handle that has not been freed.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn kitsuke_receiver_free(receiver: *mut KitsukeReceiver) {
    // SAFETY: as the caller promises.
    unsafe { buffer::free(receiver) };
}

/// Takes a datagram that came at `now_s`, seconds on any clock that does not go back. `completed`, if not null, gets the number of poses
/// that it completed. Datagrams that are wrong are passed over.
///
/// # Safety
/// `receiver` must be null or a handle that no other thread uses, `bytes` must point to `length` bytes, `completed` be null or a place
/// for a number.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn kitsuke_receiver_datagram(
    receiver: *mut KitsukeReceiver,
    bytes: *const u8,
    length: usize,
    now_s: f64,
    completed: *mut u32,
) -> Status {
    guarded(|| {
        // SAFETY: as the caller promises.
        let (receiver, bytes) =
            unsafe { (given_mut("the receiver", receiver)?, slice("the datagram", bytes, length)?) };
        let mut poses = 0;
        receiver.0.datagram(bytes, now_s, |_| poses += 1);
        // SAFETY: as the caller promises.
        unsafe { put_if(completed, poses) };
        Ok(())
    })
}

/// The last whole pose, held and without confidence when it is older than `stale_after_s`. `confidence` as in [`kitsuke_motion_pose`];
/// `age_s`, if not null, gets the seconds since it came, infinite before the first.
///
/// # Safety
/// As [`kitsuke_motion_pose`]; `age_s` must be null or a place for a number.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn kitsuke_receiver_pose(
    receiver: *const KitsukeReceiver,
    now_s: f64,
    stale_after_s: f64,
    axes: i32,
    pose: *mut PoseData,
    confidence: *mut [f32; 55],
    age_s: *mut f64,
) -> Status {
    guarded(|| {
        let axes = Axes::of(axes)?;
        // SAFETY: as the caller promises.
        let receiver = unsafe { &given("the receiver", receiver)?.0 };
        // SAFETY: as the caller promises.
        unsafe {
            put_if(age_s, receiver.age_s(now_s));
            put_tracked(&receiver.pose(now_s, stale_after_s), axes, pose, confidence)
        }
    })
}

/// Takes the last whole pose as the sender's T-pose; [`Status::Range`] when there was none.
///
/// # Safety
/// `receiver` must be null or a handle that no other thread uses.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn kitsuke_receiver_calibrate(receiver: *mut KitsukeReceiver) -> Status {
    guarded(|| {
        // SAFETY: as the caller promises.
        let receiver = unsafe { &mut given_mut("the receiver", receiver)?.0 };
        if receiver.calibrate() { Ok(()) } else { Err((Status::Range, "no whole pose has come yet".to_owned())) }
    })
}

/// # Safety
/// `pose` must be null or a place for a pose, `confidence` null or have room for as many numbers as there are bones.
unsafe fn put_tracked(
    tracked: &Tracked,
    axes: Axes,
    pose: *mut PoseData,
    confidence: *mut [f32; Bone::COUNT],
) -> Result<(), crate::status::Failure> {
    // SAFETY: as the caller promises.
    unsafe {
        put("the pose", pose, PoseData::new(&tracked.pose, axes))?;
        put_if(confidence, tracked.confidence);
    }
    Ok(())
}
