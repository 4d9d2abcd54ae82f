//! Builds kimono packs: Source → Ir → Pack. [`load`] reads and checks an artist's folder, [`build_garment`] is the table of
//! contents of what is computed from it.
//!
//! Each folder is a room that stands on the rooms below it and knows none above: `catalog` on `build` on `measure` on
//! `stages`; `load` on `check` on `source`; `meshlab` on `source`; `look` on `ir`; `export` on `stages`.

mod build;
pub mod catalog;
pub mod check;
pub mod diagnostic;
mod draft;
pub mod export;
pub mod ir;
pub mod light;
mod load;
pub mod look;
pub mod measure;
pub mod memo;
pub mod meshlab;
mod scans;
pub mod source;
pub mod stages;

pub use build::{Built, StageRun, build_garment};
pub use draft::draft;
pub use load::{Loaded, load, load_with};
pub use scans::{Laid, LaidScan, Workshop};
