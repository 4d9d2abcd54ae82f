//! All suites, one binary.
mod look;
