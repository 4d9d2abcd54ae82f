//! All suites, one binary.

mod frame;
mod look;
mod pack;
