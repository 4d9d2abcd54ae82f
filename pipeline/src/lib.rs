//! Builds kimono packs: Source → Ir → Pack. `build` is the table of contents; one file per stage.

pub mod check;
pub mod diagnostic;
pub mod frames;
pub mod ir;
pub mod raster;
pub mod scene;
pub mod sheet;
pub mod source;
