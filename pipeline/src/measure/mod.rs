//! What a finished garment is worth, in figures: how near it comes to its files, how smooth it is, how wrong about what it has
//! not seen. Changes nothing that it measures; no files, no prints.

pub mod audit;
pub mod certificate;
pub mod compression;
pub mod covered;
pub mod distortion;
pub mod leave_one_out;
pub mod pose_space;
pub mod size_errors;
pub mod skirt;
pub mod suggest;
pub mod verify;
pub mod wearer;
pub mod weld_quality;
