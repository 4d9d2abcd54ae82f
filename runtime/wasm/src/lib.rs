//! # kitsuke-wasm: the runtime as a WebAssembly module
//!
//! The module exports the C interface as it is ([`kitsuke_ffi`]); `package/kitsuke.js` makes an ES module of it. No `unsafe` here, no
//! glue between the two that a tool would have to generate.

pub use kitsuke_ffi::*;
