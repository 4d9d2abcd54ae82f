//! # kitsuke: evaluates kimono blendshape packs
//!
//! Open a pack once, then evaluate it for every frame:
//!
//! ```
//! use glam::{Quat, Vec3};
//! use kitsuke::skeleton::{Bone, Pose};
//! use kitsuke::{Frame, Pack, Scratch, evaluate};
//!
//! # fn main() -> Result<(), kitsuke::OpenError> {
//! # let bytes = include_bytes!("../../tests/packs/v1.kitsuke");
//! let pack = Pack::open(bytes)?;
//! let garment = pack.garment();
//! let mut scratch = Scratch::new(garment);
//! let mut positions_m = vec![Vec3::ZERO; garment.vertex_count()];
//! let mut normals = positions_m.clone();
//!
//! let arm_down = Pose::REST.with(Bone::LeftUpperArm, Quat::from_rotation_z(-1.2));
//! evaluate(garment, &arm_down, &mut scratch, Frame { positions_m: &mut positions_m, normals: &mut normals });
//! # assert!(positions_m.iter().all(|position_m| position_m.y < 1.6));
//! # assert!(positions_m.iter().any(|position_m| position_m.y < 1.2));
//! # Ok(()) }
//! ```
//!
//! The crate opens no file, starts no thread and reads no clock.

pub mod evaluate;
pub mod garment;
pub mod pack;
pub mod pose_blend;
pub mod skeleton;

pub use evaluate::{Frame, Scratch, evaluate, evaluate_with_rates};
pub use garment::{Garment, InvalidGarment};
pub use pack::{OpenError, Pack};
pub use pose_blend::Rates;
