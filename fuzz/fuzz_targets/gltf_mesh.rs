//! See `tests/hostile.rs`.
#![no_main]

#[path = "../../tests/hostile.rs"]
#[allow(dead_code)]
mod hostile;

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| hostile::gltf_mesh(bytes));
