//! # kitsuke-ffi: the C interface
//!
//! The one crate with `unsafe`. Every function is a thin shell: it turns pointers into references, calls `kitsuke`, and turns what comes
//! back into a status and numbers in the caller's buffers. The rules, the same for all functions:
//!
//! - **Handles** are opaque, made by `…_open` or `…_new` and given back once to the `…_free` of their name; null may be freed. Freeing one
//!   twice, or using it afterwards, is undefined, as with `free` of C. Handles made from another one outlive it.
//! - **Buffers** are the caller's: pointer and length; nothing is written beyond it, nothing is kept after the call.
//! - **Status**: [`Status`], 0 when all went well; then [`kitsuke_message`] says, in this thread, what was wrong. No panic
//!   crosses the border.
//! - **Text** is UTF-8 with a length, without a NUL where it goes in and with one where it comes out.
//! - **Threads**: packs are only read and may be shared. Evaluators, motions, receivers and fitters are one thread's at a time.
//! - **Axes** ([`Axes`]) are chosen per call: poses and places go in and come out in them, and triangles wind as the engine wants.

mod axes;
mod buffer;
mod evaluator;
#[cfg(feature = "fit")]
mod fit;
#[cfg(feature = "vmc")]
mod live;
#[cfg(feature = "recordings")]
mod motion;
mod pack;
mod pose;
mod status;

pub use axes::Axes;
pub use buffer::{Attribute, kitsuke_bytes_free, kitsuke_bytes_new};
pub use evaluator::{
    KitsukeEvaluator, kitsuke_evaluate, kitsuke_evaluate_obi, kitsuke_evaluator_free, kitsuke_evaluator_new,
};
#[cfg(feature = "fit")]
pub use fit::{
    FitInfo, KitsukeFitter, Reach, VerdictKind, kitsuke_fit, kitsuke_fitter_dimension_count, kitsuke_fitter_free,
    kitsuke_fitter_new, kitsuke_fitter_reach, kitsuke_fitter_rule_set_count, kitsuke_fitter_text,
    kitsuke_measurement_count, kitsuke_measurement_from_name, kitsuke_measurement_name,
};
#[cfg(feature = "vmc")]
pub use live::{
    KitsukeReceiver, kitsuke_receiver_calibrate, kitsuke_receiver_datagram, kitsuke_receiver_free,
    kitsuke_receiver_new, kitsuke_receiver_pose,
};
#[cfg(feature = "recordings")]
pub use motion::{
    KitsukeMotion, MotionInfo, kitsuke_motion_free, kitsuke_motion_info, kitsuke_motion_note, kitsuke_motion_open,
    kitsuke_motion_pose, kitsuke_motion_pose_at,
};
pub use pack::{
    KitsukePack, PackInfo, Text, kitsuke_pack_free, kitsuke_pack_index_count, kitsuke_pack_indices, kitsuke_pack_info,
    kitsuke_pack_joint, kitsuke_pack_obi_indices, kitsuke_pack_open, kitsuke_pack_path_length,
    kitsuke_pack_target_pose, kitsuke_pack_text, kitsuke_pack_texture, kitsuke_pack_uv,
};
pub use pose::{
    PoseData, kitsuke_bone_count, kitsuke_bone_from_name, kitsuke_bone_name, kitsuke_bone_parent, kitsuke_limit,
};
pub use status::{Status, kitsuke_message};

/// Grows whenever a function or struct of the interface changes.
pub const ABI_VERSION: u32 = 2;

/// The version of the interface that the library has; compare it with `KITSUKE_ABI_VERSION` of the header.
#[unsafe(no_mangle)]
pub extern "C" fn kitsuke_abi_version() -> u32 {
    ABI_VERSION
}
