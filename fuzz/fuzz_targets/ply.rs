//! See `tests/hostile.rs`.
#![no_main]

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| kitsuke_tests::hostile::ply(bytes));
