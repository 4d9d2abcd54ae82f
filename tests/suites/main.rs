//! All suites, one binary.

mod frame;
mod garment;
mod look;
mod motion;
mod pack;
