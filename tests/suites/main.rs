//! All suites, one binary.

mod look;
mod pack;
