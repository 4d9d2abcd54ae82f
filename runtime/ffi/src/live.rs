//! Live wearers in the VMC protocol.

use crate::axes::Axes;
use crate::buffer::{self, given, given_mut, put_handle, slice};
use crate::pack::KitsukePack;
use crate::pose::{PoseData, put_if, put_tracked};
use crate::status::{Status, guarded};
use kitsuke::skeleton::vmc::Receiver;

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

/// The last whole pose, held and without confidence when it is older than `stale_after_s`. `confidence` as for recorded motion;
/// `age_s`, if not null, gets the seconds since it came, infinite before the first.
///
/// # Safety
/// `receiver` must be null or a handle, `pose` null or a place for a pose, `confidence` null or have room for as many numbers as there
/// are bones, `age_s` null or a place for a number.
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
