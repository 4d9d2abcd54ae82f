//! Ir → Pack, one file per stage: plain functions from what a stage needs to what it makes. No files, no globals, no prints;
//! settings stand beside their stage.

pub mod accessories;
pub mod bake;
pub mod compress;
pub mod correctives;
pub mod deltas;
mod error;
pub mod fit_data;
pub mod hanging;
pub mod kernel;
pub(crate) mod laplacian;
pub(crate) mod matrix;
pub mod mirror;
pub(crate) mod numbers;
pub mod pack_islands;
pub mod painted;
pub(crate) mod posed_body;
pub mod reach;
pub mod regions;
pub mod register;
pub mod skin;
pub mod skin_fit;
pub(crate) mod twins;
mod weights;
pub mod weld;

pub use error::StageError;
