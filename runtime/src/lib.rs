//! # kitsuke: evaluates kimono blendshape packs
//!
//! Open a pack once, then evaluate it for every frame:
//!
//! ```
//! # fn show(bytes: &[u8], pose: &kitsuke::skeleton::Pose) -> Result<(), kitsuke::OpenError> {
//! let pack = kitsuke::Pack::open(bytes)?;
//! let garment = pack.garment();
//! let mut scratch = kitsuke::Scratch::new(garment);
//! let mut positions_m = vec![glam::Vec3::ZERO; garment.vertex_count()];
//! let mut normals = positions_m.clone();
//! let frame = kitsuke::Frame { positions_m: &mut positions_m, normals: &mut normals };
//! kitsuke::evaluate(garment, pose, &mut scratch, frame);
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
