//! All suites, one binary.

mod blending;
mod build;
mod frame;
mod garment;
mod invariants;
mod look;
mod mistakes;
mod motion;
mod pack;
mod skinning;
