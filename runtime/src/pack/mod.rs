//! The pack: a garment as bytes.
pub mod codec;
pub mod layout;
#[cfg(feature = "write")]
pub mod write;
