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
//! # let bytes = include_bytes!("../../tests/packs/v5_0.kitsuke");
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
//! Many wearers at once: the garment is shared, every thread has a [`Scratch`] of its own.
//!
//! ```
//! # use glam::Vec3;
//! # use kitsuke::skeleton::Pose;
//! # use kitsuke::{Frame, Pack, Scratch, evaluate};
//! # fn main() -> Result<(), kitsuke::OpenError> {
//! # let pack = Pack::open(include_bytes!("../../tests/packs/v5_0.kitsuke"))?;
//! # let garment = pack.garment();
//! # let poses = vec![Pose::REST; 4];
//! # let mut wearers = vec![(vec![Vec3::ZERO; garment.vertex_count()], vec![Vec3::ZERO; garment.vertex_count()]); 4];
//! std::thread::scope(|threads| {
//!     for (poses, wearers) in poses.chunks(2).zip(wearers.chunks_mut(2)) {
//!         threads.spawn(move || {
//!             let mut scratch = Scratch::new(garment);
//!             for (pose, (positions_m, normals)) in poses.iter().zip(wearers) {
//!                 evaluate(garment, pose, &mut scratch, Frame { positions_m, normals });
//!             }
//!         });
//!     }
//! });
//! # assert!(wearers.iter().all(|wearer| *wearer == wearers[0]));
//! # Ok(()) }
//! ```
//!
//! A kimono with sizes fits itself to a wearer; the fitter is made once and shared, too.
//!
//! ```
//! # #[cfg(feature = "fit")]
//! # fn fit(pack: &kitsuke::Pack) -> Result<Vec<glam::Vec3>, Box<dyn std::error::Error>> {
//! use kitsuke::fit::{Fitter, Scratch};
//! use kitsuke::measurement::{Measurement, Measurements};
//!
//! let garment = pack.garment();
//! let fitter = Fitter::new(garment, pack.fit_data()?.ok_or("a kimono of one size")?)?;
//! let wearer = Measurements::default()
//!     .with(Measurement::BodyHeight, 1.62)
//!     .with(Measurement::BustGirth, 0.88)
//!     .with(Measurement::HipGirth, 0.95);
//! let fit = fitter.fit(&wearer, 0, &mut Scratch::default())?;
//! println!("{}", fitter.explain(&fit, &wearer));
//!
//! let mut positions_m = vec![glam::Vec3::ZERO; garment.unique_count()];
//! fitter.shape(&fit, &mut positions_m);
//! # Ok(positions_m)
//! # }
//! ```
//!
//! The crate opens no file, starts no thread and reads no clock.

pub mod accessories;
pub mod arrays;
#[cfg(feature = "fit")]
pub mod envelope_cholesky;
pub mod evaluate;
#[cfg(feature = "fit")]
pub mod fit;
pub mod garment;
#[cfg(feature = "fit")]
pub mod measurement;
pub mod pack;
mod plan;
pub mod pose_blend;
pub mod reach;
pub mod skeleton;
#[cfg(feature = "fit")]
pub mod sparse_cholesky;
#[cfg(feature = "fit")]
pub mod tailoring;
mod vertex_normals;

pub use accessories::Accessories;
pub use arrays::InvalidGarment;
pub use evaluate::{Frame, Scratch, evaluate, evaluate_with_rates};
pub use garment::Garment;
/// The vectors and rotations of this crate's interface.
pub use glam;
pub use pack::{OpenError, Pack};
pub use pose_blend::Rates;
pub use reach::Limited;
pub use vertex_normals::vertex_normals;
