//! What people look at: frames as files, and pictures by an own deterministic rasteriser.

pub mod frames;
pub mod laid_on;
pub mod raster;
pub mod scene;
pub mod sheet;
pub mod texture;
