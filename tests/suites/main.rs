//! All suites, one binary.

mod build;
mod frame;
mod garment;
mod look;
mod motion;
mod pack;
